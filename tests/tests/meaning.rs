//! The meaning of operators and conversions: every operator over every pair of types with their edge values, in both executors and folded, against
//! a table that a program in another language computed (`tests/oracle`).

#[path = "meaning/constants.rs"]
mod constants;
#[path = "meaning/table.rs"]
mod table;
#[path = "meaning/variables.rs"]
mod variables;

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use table::{Table, Unit};
use takt_compile::Options;
use takt_tests::bench;
use takt_tests::case::Case;

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
    let count = count.into_inner();
    println!("{count} rows");
    count
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

/// What the compiler says of each assignment of the table, in lines of their own.
fn said(table: &Table, strict: bool) -> Vec<char> {
    let mut source = String::from("PROGRAM main VAR");
    let mut types: Vec<&String> = table.implicit.iter().map(|(source, ..)| source).collect();
    types.dedup();
    for ty in types {
        let _ = write!(source, " v_{ty} : {ty};");
    }
    source.push_str(" END_VAR\n");
    for (from, to, _) in &table.implicit {
        let _ = writeln!(source, "v_{to} := v_{from};");
    }
    source.push_str("END_PROGRAM\n");
    let found = bench::found(&bench::compile_with(&source, &Options { strict, ..Options::default() }));
    let codes: HashMap<usize, String> = found.into_iter().map(|d| (d.line, d.code)).collect();
    let verdict = |line: usize| codes.get(&line).map_or('.', |code| if code == "W0301" { 'w' } else { 'e' });
    (0..table.implicit.len()).map(|i| verdict(i + 2)).collect()
}

#[test]
fn implicit_conversions_are_silent_warned_of_or_refused() {
    let table = read();
    assert!(table.implicit.len() > 500, "{} pairs", table.implicit.len());
    for strict in [false, true] {
        let wrong: Vec<String> = table
            .implicit
            .iter()
            .zip(said(&table, strict))
            .filter_map(|((from, to, verdict), said)| {
                let expected = if strict && *verdict == 'w' { 'e' } else { *verdict };
                (said != expected).then(|| format!("{to} := {from}: expected {expected}, found {said} (strict: {strict})"))
            })
            .collect();
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }
}

/// The page of decisions is true: each of its snippets runs and leaves what it says.
#[test]
fn the_page_says_what_is_so() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/meaning.md");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let snippets: Vec<&str> = text.split("```iecst\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(snippets.len() >= 6, "{} snippets", snippets.len());
    for (n, snippet) in snippets.iter().enumerate() {
        assert!(snippet.contains("//| "), "snippet {n} says nothing");
        let case = Case { name: format!("snippet {n}"), kind: "run".into(), source: (*snippet).into(), line: 1 };
        bench::run_case(&case).unwrap_or_else(|e| panic!("snippet {n}: {e}\n{snippet}"));
    }
}
