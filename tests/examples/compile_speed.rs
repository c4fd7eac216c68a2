//! How long compilation takes, by phase, and how that grows with the program.
//!
//! `cargo run --release -p takt-tests --example compile_speed [LINES]…` (10 000, 30 000, 100 000 and 1 000 000 without arguments). `split` is the time in
//! which the same text is cut into its words in the same run: what any reader of the text needs at the least. Each size runs in its own process, so that its
//! peak of memory (Linux) is its own.

use std::hint::black_box;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};
use takt_compile::{Input, Options};
use takt_syntax::{FileId, Source};

const SIZES: [usize; 4] = [10_000, 30_000, 100_000, 1_000_000];

/// One row of the table.
struct Row {
    lines: usize,
    split: Duration,
    parse: Duration,
    check: Duration,
    verify: Duration,
    code: Duration,
    /// MiB after `check` and at the end.
    memory: [u64; 2],
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [flag, lines] = arguments.as_slice()
        && flag == "--one"
    {
        return one(lines);
    }
    let sizes: Option<Vec<usize>> = arguments.iter().map(|a| a.parse().ok()).collect();
    let Some(sizes) = sizes else {
        eprintln!("expected numbers of lines, found `{}`", arguments.join(" "));
        return ExitCode::from(2);
    };
    println!("  lines      split      parse      check     verify       code      total  MiB check  MiB all   lines/s  check/split");
    let mut before: Option<(usize, f64, f64)> = None;
    for lines in if sizes.is_empty() { SIZES.to_vec() } else { sizes } {
        let Some((measured, check, total)) = apart(lines) else { return ExitCode::FAILURE };
        if let Some((lines, earlier_check, earlier_total)) = before {
            let more = measured as f64 / lines as f64;
            println!("  {more:.1} x the lines: check {:.1} x, total {:.1} x", check / earlier_check, total / earlier_total);
        }
        before = Some((measured, check, total));
    }
    ExitCode::SUCCESS
}

/// Measures a size in a process of its own and shows its row: lines, seconds of `check` and of all.
fn apart(lines: usize) -> Option<(usize, f64, f64)> {
    let output = Command::new(std::env::current_exe().ok()?).args(["--one", &lines.to_string()]).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    print!("{}{text}", String::from_utf8_lossy(&output.stderr));
    let columns: Vec<f64> = text.split_whitespace().filter_map(|c| c.parse().ok()).collect();
    Some((*columns.first()? as usize, *columns.get(3)?, *columns.get(6)?))
}

fn one(lines: &str) -> ExitCode {
    let Ok(lines) = lines.parse() else { return ExitCode::from(2) };
    match measure(takt_tests::large::program(lines)) {
        Ok(row) => {
            print(&row);
            ExitCode::SUCCESS
        }
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn measure(text: String) -> Result<Row, String> {
    let lines = text.lines().count();
    let (split, _) = timed(|| words(&text));
    let (parse, tree) = timed(|| takt_syntax::parse(FileId(0), &text));
    drop(tree);
    let sources = [Source { name: "large.st".into(), text }];
    let options = Options::default();
    let input = Input { sources: &sources, libraries: &[&takt_stdlib_fb::LIBRARY], options: &options };
    let (check, output) = timed(|| takt_compile::compile(input));
    let after_check = peak();
    let program =
        output.program.ok_or_else(|| format!("{:?}", output.diagnostics.iter().find(|d| d.severity() == takt_syntax::Severity::Error)))?;
    let (verify, sound) = timed(|| takt_ir::verify(&program));
    sound.map_err(|e| e.to_string())?;
    let (code, compiled) = timed(|| takt_jit::compile(&program));
    compiled.map_err(|e| e.to_string())?;
    Ok(Row { lines, split, parse, check, verify, code, memory: [after_check, peak()] })
}

/// Words of a text and the sum of their lengths.
fn words(text: &str) -> (usize, usize) {
    let words = text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
    black_box(words.fold((0, 0), |(n, sum), word| (n + 1, sum + black_box(word).len())))
}

fn timed<T>(work: impl FnOnce() -> T) -> (Duration, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed(), result)
}

fn print(row: &Row) {
    let s = |d: Duration| d.as_secs_f64();
    // `code` verifies for itself.
    let total = row.check + row.code;
    let [after_check, all] = row.memory;
    let (rate, ratio) = (row.lines as f64 / s(total), s(row.check) / s(row.split));
    print!("{:>7} {:>10.4} {:>10.4} {:>10.4}", row.lines, s(row.split), s(row.parse), s(row.check));
    println!(" {:>10.4} {:>10.4} {:>10.4} {after_check:>10} {all:>8} {rate:>9.0} {ratio:>12.1}", s(row.verify), s(row.code), s(total));
}

/// The most memory this process has held, in MiB; 0 where the system does not say.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok()).map_or(0, |kib| kib / 1024)
}
