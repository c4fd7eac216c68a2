//! What retained variables cost a scan: 64 KiB of them, in one array and as thousands of small variables, beside a plain copy of as many bytes in the same run.
//!
//! `cargo run --release -p takt-tests --example retain_cost`. `step` is a whole step with a snapshot less the same without, medians of many; the last column is
//! its ratio to the plain copy.

use std::hint::black_box;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use takt_abi::Time;
use takt_engine::{NoBus, Options, RetainLayout};
use takt_tests::bench;

const BYTES: usize = 64 << 10;
const TIMES: usize = 2001;

fn median(mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..TIMES)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_nanos() as f64 / 1000.0
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[TIMES / 2]
}

/// Declarations of 64 KiB.
fn programs() -> Vec<(&'static str, String)> {
    let mixed = |i: usize| format!("b{i} : BOOL; r{i} : LREAL;\n");
    let mixed: String = (0..BYTES / 9).map(mixed).collect();
    // Every other variable is in a list that is not retained, with gaps too large to copy along.
    let block = "FUNCTION_BLOCK FB VAR RETAIN n : LINT; END_VAR VAR rest : ARRAY [1..7] OF LINT; END_VAR END_FUNCTION_BLOCK\n\
                 TYPE S : STRUCT fb : FB; pad : ARRAY [1..200] OF BYTE; END_STRUCT END_TYPE\n";
    vec![
        ("one array", format!("VAR_GLOBAL RETAIN a : ARRAY [1..{}] OF LREAL; END_VAR", BYTES / 8)),
        ("14 562 variables", format!("VAR_GLOBAL RETAIN {mixed} END_VAR")),
        ("1024 blocks apart", format!("{block}VAR_GLOBAL a : ARRAY [1..{}] OF S; END_VAR", BYTES / 64)),
    ]
}

fn main() -> ExitCode {
    println!("{:20} {:>8} {:>10} {:>10} {:>10} {:>8}", "64 KiB as", "bytes", "copy µs", "plain µs", "step µs", "ratio");
    let mut worst: f64 = 0.0;
    for (name, vars) in programs() {
        let output = bench::compile(&format!("{vars}\nPROGRAM main\nEND_PROGRAM"));
        let Some(program) = output.program.map(Arc::new) else {
            eprintln!("{name} does not compile: {:?}", output.diagnostics.first());
            return ExitCode::FAILURE;
        };
        let layout = RetainLayout::new(&program);
        let load = |interval| {
            let options = Options { retain_interval: interval, ..Options::default() };
            takt_engine::load(program.clone(), options, Box::new(NoBus))
        };
        let (Ok(mut with), Ok(mut without)) = (load(Some(Time(0))), load(None)) else {
            eprintln!("{name} cannot be loaded");
            return ExitCode::FAILURE;
        };
        let (image, mut bytes) = (with.image().to_vec(), vec![0; layout.len()]);
        let copy = median(|| layout.copy(black_box(&image), black_box(&mut bytes)));
        let source = vec![1u8; layout.len()];
        let plain = median(|| black_box(&mut bytes).copy_from_slice(black_box(&source)));
        let mut reader = with.snapshots();
        let step = |engine: &mut takt_engine::Engine| engine.step(engine.next_release());
        let mut times = Vec::with_capacity(TIMES);
        for _ in 0..TIMES {
            let start = Instant::now();
            step(&mut with);
            let middle = Instant::now();
            step(&mut without);
            times.push((middle - start).as_nanos() as f64 / 1000.0 - middle.elapsed().as_nanos() as f64 / 1000.0);
            if let Some((reader, snapshot)) = reader.as_mut().and_then(|reader| reader.newest().map(|snapshot| (reader, snapshot))) {
                reader.give_back(snapshot);
            }
        }
        times.sort_by(f64::total_cmp);
        let step = times[TIMES / 2];
        worst = worst.max(step);
        println!("{name:20} {:>8} {copy:>10.2} {plain:>10.2} {step:>10.2} {:>8.2}", layout.len(), step / plain);
    }
    println!("worst: {worst:.2} µs (20 µs are allowed)");
    ExitCode::SUCCESS
}
