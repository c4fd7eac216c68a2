//! Random ST programs in both executors: no difference, no crash, no hang, no refusal; and nothing of the IR that they do not reach.
//!
//! 2 000 programs in the usual run. `TAKT_PROGRAMS=100000 cargo test --release -p takt-tests --test generated -- --nocapture` is the long one,
//! `TAKT_FIRST=50000` starts at another seed, `TAKT_SEED=17` runs one program and shows it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use takt_abi::Fault;
use takt_ir::Program;
use takt_tests::agreement::{Finding, NATIVE_STACK, examine};
use takt_tests::coverage::{Table, marked};
use takt_tests::generate::{Generated, generate};
use takt_tests::shrink::shrink;
use takt_tests::trial::{Start, compiled, interpreted};

/// Programs that are also run without an engine, marked, for the table: one of so many, and in a long run one of more.
const MARKED: u64 = 2;
const MARKED_OF_MANY: u64 = 16;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Runs a marked program in both executors, compares everything with the fuel, and counts what it reached.
fn count(program: &Arc<Program>, seed: u64, table: &mut Table) -> Result<(), Finding> {
    let marked = marked(program);
    takt_ir::verify(&marked.program).map_err(|e| Finding::Unsound(format!("with marks: {e}")))?;
    let code = takt_jit::compile(&marked.program).map_err(|e| Finding::Unsound(format!("with marks: {e}")))?;
    let start = Start::of(seed);
    let (a, b) = (interpreted(&marked.program, start), compiled(&marked.program, &code, start));
    table.run(&marked, &a.image, 0);
    table.run(&marked, &b.image, 1);
    table.fault(a.fault, 0);
    table.fault(b.fault, 1);
    if a == b {
        Ok(())
    } else {
        Err(Finding::Differs(format!("with marks: {:?} and {:?}", (a.fault, a.site, a.fuel, a.polls), (b.fault, b.site, b.fuel, b.polls))))
    }
}

fn test(generated: &Generated, marked: u64, table: &mut Table) -> Result<Option<Fault>, Finding> {
    let (program, fault) = examine(generated)?;
    if generated.seed.is_multiple_of(marked) {
        count(&program, generated.seed, table)?;
    }
    Ok(fault)
}

/// Takes seeds until there are none left, or three findings.
fn work(next: &AtomicU64, end: u64, findings: &AtomicU64) -> (Table, Vec<(Generated, Finding)>) {
    let (mut table, mut found) = (Table::default(), Vec::new());
    let marked = if end - next.load(Ordering::Relaxed) > 10_000 { MARKED_OF_MANY } else { MARKED };
    loop {
        let seed = next.fetch_add(1, Ordering::Relaxed);
        if seed >= end || findings.load(Ordering::Relaxed) >= 3 {
            return (table, found);
        }
        let generated = generate(seed);
        if let Err(finding) = test(&generated, marked, &mut table) {
            findings.fetch_add(1, Ordering::Relaxed);
            found.push(shrink(&generated, &finding));
        }
    }
}

#[test]
fn random_programs_run_alike_and_reach_everything() {
    let (first, end) = match number("TAKT_SEED") {
        Some(seed) => (seed, seed + 1),
        None => {
            let first = number("TAKT_FIRST").unwrap_or(0);
            (first, first + number("TAKT_PROGRAMS").unwrap_or(2000))
        }
    };
    let (next, findings) = (AtomicU64::new(first), AtomicU64::new(0));
    let (mut table, mut found) = (Table::default(), Vec::new());
    std::thread::scope(|scope| {
        let spawn = || std::thread::Builder::new().stack_size(NATIVE_STACK).spawn_scoped(scope, || work(&next, end, &findings));
        let threads: Vec<_> = (0..2).map(|_| spawn().expect("a thread")).collect();
        for thread in threads {
            let (t, f) = thread.join().expect("findings are values, not panics");
            table.merge(t);
            found.extend(f);
        }
    });
    if end == first + 1 {
        println!("{}", generate(first).source);
    }
    println!("{table}");
    let shown: Vec<String> =
        found.iter().map(|(g, f)| format!("seed {}{}: {f}\n{}", g.seed, if g.iec_arithmetic { " (iec)" } else { "" }, g.source)).collect();
    assert!(shown.is_empty(), "{}", shown.join("\n"));
    if end - first >= 2000 {
        assert_eq!(table.missing(), Vec::<String>::new(), "never reached");
    }
}
