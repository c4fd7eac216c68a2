//! Each deliberate mistake of the code generator is seen by the programs of the usual test run: the proof that they look closely enough.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use takt_ir::Program;
use takt_jit::{Defect, compile_with};
use takt_tests::agreement::{NATIVE_STACK, compile};
use takt_tests::case::cases;
use takt_tests::generate::generate;
use takt_tests::trial::{Outcome, Start, compiled, interpreted};

/// Generated programs of a usual test run.
const PROGRAMS: u64 = 2000;

/// Programs that are made at a time.
const SLICE: u64 = 50;

/// Mistakes that no ST program shows, and why. The random IR of the code generator's own tests finds them.
const BELOW_ST: &[(Defect, &str)] = &[
    (Defect::LocalsDirty, "the compiler gives every local a value before it is read"),
    (Defect::CostIgnored, "every poll of an ST program costs one unit"),
    (Defect::BranchByte, "every condition of an ST program is 0 or 1"),
];

struct Run {
    program: Program,
    start: Start,
    expected: Outcome,
}

/// Enough of everything: each case of the suite runs to its end.
const PLENTY: Start = Start { scans: 2, fuel: 5000, slow_polls: 60, flag: 0, depth_limit: 60, stack: 1 << 20 };

fn run(program: Program, start: Start) -> Run {
    let expected = interpreted(&program, start);
    Run { program, start, expected }
}

/// The cases of `suite/run` that have one task.
fn of_suite() -> Vec<Run> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("suite/run");
    let mut files: Vec<_> = std::fs::read_dir(folder).expect("the suite").map(|e| e.expect("an entry").path()).collect();
    files.sort();
    let texts = files.iter().filter_map(|path| std::fs::read_to_string(path).ok());
    let all: Vec<_> = texts.flat_map(|text| cases(&text)).collect();
    let programs = all.iter().filter_map(|case| compile(&case.source, false).ok()).filter(|p| p.tasks.len() == 1);
    programs.map(|program| run(program, PLENTY)).collect()
}

fn of_seeds(seeds: std::ops::Range<u64>) -> Vec<Run> {
    let compiled = |seed| {
        let generated = generate(seed);
        compile(&generated.source, generated.iec_arithmetic).ok().map(|program| run(program, Start::of(seed)))
    };
    seeds.filter_map(compiled).collect()
}

fn shows(run: &Run, defect: Defect) -> bool {
    let code = compile_with(&run.program, defect).expect("the program is good");
    compiled(&run.program, &code, run.start) != run.expected
}

/// Looks for each defect in these programs, on two threads; those that none shows are left.
fn search(runs: &[Run], defects: &[Defect]) -> Vec<Defect> {
    let (next, left) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || {
        while let Some(defect) = defects.get(next.fetch_add(1, Ordering::Relaxed)) {
            if !runs.iter().any(|run| shows(run, *defect)) {
                left.lock().expect("no panic").push(*defect);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..2 {
            std::thread::Builder::new().stack_size(NATIVE_STACK).spawn_scoped(scope, work).expect("a thread");
        }
    });
    left.into_inner().expect("no panic")
}

/// On a thread with much stack: the interpreter runs here.
fn missed() -> Vec<Defect> {
    assert!(Defect::all().len() >= 20);
    let wanted = |d: &Defect| BELOW_ST.iter().all(|(below, _)| below != d);
    let all: Vec<Defect> = Defect::all().iter().copied().filter(wanted).collect();
    let mut left = search(&of_suite(), &all);
    println!("the suite leaves {left:?}");
    for first in (0..PROGRAMS).step_by(SLICE as usize) {
        if left.is_empty() {
            break;
        }
        left = search(&of_seeds(first..first + SLICE), &left);
        println!("seeds to {} leave {left:?}", first + SLICE);
    }
    left
}

#[test]
fn every_seeded_defect_is_found() {
    let thread = std::thread::Builder::new().stack_size(NATIVE_STACK).spawn(missed).expect("a thread");
    assert_eq!(thread.join().expect("no panic"), []);
}

#[test]
fn correct_code_shows_no_difference() {
    let work = || assert!(of_suite().iter().chain(&of_seeds(0..100)).all(|run| !shows(run, Defect::None)));
    std::thread::Builder::new().stack_size(NATIVE_STACK).spawn(work).expect("a thread").join().expect("no difference");
}
