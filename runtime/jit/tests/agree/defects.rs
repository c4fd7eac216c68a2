//! Each deliberate mistake of the code generator must be seen by the random programs of a usual test run: the proof that they look closely enough.

use crate::bench::{Start, differs};
use crate::generator::random_program;
use crate::random::start;
use takt_jit::Defect;

/// The first random program that shows the defect.
fn found_by(defect: Defect, programs: u64) -> Option<u64> {
    (0..programs).find(|seed| differs(&random_program(*seed), start(*seed), defect))
}

#[test]
fn every_seeded_defect_is_found() {
    assert!(Defect::all().len() >= 20);
    let found: Vec<(Defect, Option<u64>)> = Defect::all().iter().map(|defect| (*defect, found_by(*defect, 5000))).collect();
    for (defect, seed) in &found {
        println!("{defect:?}: {seed:?}");
    }
    let missed: Vec<Defect> = found.into_iter().filter(|(_, seed)| seed.is_none()).map(|(defect, _)| defect).collect();
    assert_eq!(missed, []);
}

#[test]
fn correct_code_shows_no_difference() {
    assert!((0..200).all(|seed| !differs(&random_program(seed), Start::default(), Defect::None)));
}
