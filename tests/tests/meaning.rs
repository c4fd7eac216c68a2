//! The meaning of operators and conversions: every operator over every pair of types with their edge values, in both executors and folded, against
//! a table that a program in another language computed (`tests/oracle`).

#[path = "meaning/constants.rs"]
mod constants;
#[path = "meaning/table.rs"]
mod table;
#[path = "meaning/variables.rs"]
mod variables;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use table::{Table, Unit};

/// Units of one program.
const BATCH: usize = 24;

fn read() -> Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/meaning/table.txt");
    Table::read(&std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// Gives `work` the units in batches of one arithmetic, on two threads; the sum of what it counts, and what is wrong.
fn in_batches(work: impl Fn(&Table, &[&Unit<'_>]) -> (usize, Vec<String>) + Sync) -> usize {
    let table = read();
    let units = table.units();
    let (plain, iec): (Vec<&Unit<'_>>, Vec<&Unit<'_>>) = units.iter().partition(|u| !u.iec);
    let batches: Vec<&[&Unit<'_>]> = plain.chunks(BATCH).chain(iec.chunks(BATCH)).collect();
    let (next, count) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let take = || {
        let mut wrong = Vec::new();
        while let Some(batch) = batches.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (counted, found) = work(&table, batch);
            count.fetch_add(counted, Ordering::Relaxed);
            wrong.extend(found);
        }
        wrong
    };
    let wrong: Vec<String> = std::thread::scope(|scope| {
        let threads = [scope.spawn(take), scope.spawn(take)];
        threads.into_iter().flat_map(|t| t.join().expect("a finding is no panic")).collect()
    });
    assert!(wrong.is_empty(), "{} rows differ:\n{}", wrong.len(), wrong[..wrong.len().min(40)].join("\n"));
    count.into_inner()
}

#[test]
fn variables_are_computed_as_the_table_says() {
    let rows = |batch: &[&Unit<'_>]| batch.iter().flat_map(|u| &u.lines).map(|l| l.cells.len()).sum();
    let count = in_batches(|table, batch| (rows(batch), variables::run(table, batch)));
    assert!(count > 200_000, "{count} rows");
}

#[test]
fn divisions_by_zero_are_faults() {
    let count = in_batches(variables::faults);
    assert!(count > 400, "{count} rows");
}

#[test]
fn constants_are_folded_to_what_is_computed() {
    let count = in_batches(constants::run);
    assert!(count > 20_000, "{count} rows");
}

#[test]
fn divisions_by_a_constant_zero_are_reported() {
    in_batches(|table, batch| (0, constants::refused(table, batch)));
}
