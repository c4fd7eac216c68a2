//! Running a case: compile, both executors, compare.

use crate::case::{Case, Expected, Waveform, expectations, waveform};
use std::sync::Arc;
use takt_abi::Time;
use takt_compile::{Input, Options as Choices, Output};
use takt_engine::{Engine, ExecutorKind, NoBus, Options, Preemption, Reset};
use takt_ir::{Place, Program};
use takt_syntax::Source;

/// Compiles one source with the standard library.
pub fn compile(source: &str) -> Output {
    compile_with(source, &Choices::default())
}

/// Compiles one source with the standard library and choices.
pub fn compile_with(source: &str, choices: &Choices) -> Output {
    let sources = [Source { name: "case.st".into(), text: source.into() }];
    takt_compile::compile(Input { sources: &sources, libraries: &[&takt_stdlib_fb::LIBRARY], options: choices })
}

/// The messages of a compilation as a case expects them.
pub fn found(output: &Output) -> Vec<Expected> {
    let place = |d: &takt_syntax::Diagnostic| {
        let text = &output.files[d.span.file.0 as usize].text;
        let before = &text[..(d.span.start as usize).min(text.len())];
        let line = before.matches('\n').count() + 1;
        (line, before.rsplit('\n').next().unwrap_or("").chars().count() + 1)
    };
    let mut all: Vec<Expected> = output
        .diagnostics
        .iter()
        .map(|d| {
            let (line, column) = place(d);
            let help = d.help.as_ref().map_or_else(String::new, |help| format!(" ({help})"));
            Expected { line, column, code: d.code.text().into(), text: d.message.clone() + &help }
        })
        .collect();
    all.sort_by_key(|e| (e.line, e.column));
    all
}

/// Whether a case holds; else what is wrong.
pub fn run_case(case: &Case) -> Result<(), String> {
    match case.kind.as_str() {
        "check" => check(case, &Choices::default()),
        "lint" => check(case, &Choices { lint: true, ..Choices::default() }),
        "run" => run(case),
        "ir" => run_ir(case),
        other => Err(format!("`{other}` is not a kind of case")),
    }
}

fn check(case: &Case, choices: &Choices) -> Result<(), String> {
    let mut expected = expectations(&case.source);
    expected.sort_by_key(|e| (e.line, e.column));
    let found = found(&compile_with(&case.source, choices));
    let fits = |(e, f): (&Expected, &Expected)| (e.line, e.column, &e.code) == (f.line, f.column, &f.code) && f.text.contains(&e.text);
    if expected.len() == found.len() && expected.iter().zip(&found).all(fits) {
        return Ok(());
    }
    let list = |all: &[Expected]| {
        all.iter().map(|e| format!("\n    {}:{} {} {}", e.line + case.line - 1, e.column, e.code, e.text)).collect::<String>()
    };
    Err(format!("expected:{}\n  found:{}", list(&expected), list(&found)))
}

fn run(case: &Case) -> Result<(), String> {
    let wave = waveform(&case.source)?;
    let output = compile(&case.source);
    let errors: Vec<_> = found(&output).into_iter().filter(|e| e.code.starts_with('E')).collect();
    let Some(program) = output.program else { return Err(format!("does not compile: {errors:?}")) };
    takt_ir::verify(&program).map_err(|e| format!("the verifier refuses it: {e}"))?;
    both(program, &wave)
}

fn run_ir(case: &Case) -> Result<(), String> {
    let wave = waveform(&case.source)?;
    let known = |name: &str| {
        let desc = takt_ir::text::NATIVES.iter().chain(takt_stdlib_fb::LIBRARY.functions).find(|d| d.name == name)?;
        Some(takt_ir::Native { name: desc.name, call: desc.call })
    };
    let program = takt_ir::parse_program(&case.source, &known).map_err(|e| format!("{}:{}: {}", e.line, e.column, e.message))?;
    match (takt_ir::verify(&program), &wave.refused) {
        (Ok(()), None) => both(program, &wave),
        (Ok(()), Some(reason)) => Err(format!("the verifier lets it pass; expected it to be refused: {reason}")),
        (Err(e), Some(reason)) if e.to_string().contains(reason.as_str()) => Ok(()),
        (Err(e), _) => Err(format!("the verifier refuses it: {e}")),
    }
}

/// Plays the waveform in both executors and compares them.
fn both(program: Program, wave: &Waveform) -> Result<(), String> {
    let program = Arc::new(program);
    let interpreted = play(&program, wave, ExecutorKind::Interpreter).map_err(|e| format!("interpreter: {e}"))?;
    let compiled = play(&program, wave, ExecutorKind::Jit).map_err(|e| format!("machine code: {e}"))?;
    compare(&interpreted, &compiled)
}

/// Loads a program without a bus.
pub fn load(program: &Arc<Program>, executor: ExecutorKind) -> Result<Engine, String> {
    let options = Options { executor, fuel_limit: 1_000_000, ..Options::default() };
    takt_engine::load(program.clone(), options, Box::new(NoBus)).map_err(|e| e.to_string())
}

fn play(program: &Arc<Program>, wave: &Waveform, executor: ExecutorKind) -> Result<Engine, String> {
    let preempt = wave.preempt.iter().map(|(task, at_fuel, cycle)| Preemption { cycle: *cycle, task: *task, at_fuel: *at_fuel });
    let options = Options { executor, fuel_limit: 1_000_000, preempt: preempt.collect(), ..Options::default() };
    let mut engine = takt_engine::load(program.clone(), options, Box::new(NoBus)).map_err(|e| e.to_string())?;
    let scans = wave.rows.iter().map(|r| r.values.len()).max().unwrap_or(1);
    for scan in 0..scans {
        for (_, kind) in wave.resets.iter().filter(|(before, _)| *before == scan + 1) {
            let kind = match kind.as_str() {
                "warm" => Reset::Warm,
                "cold" => Reset::Cold,
                "origin" => Reset::Origin,
                other => return Err(format!("`{other}` is no kind of restart")),
            };
            engine.reset(kind).map_err(|record| format!("the restart ends in a fault: {record}"))?;
        }
        for row in wave.rows.iter().filter(|r| r.drives) {
            if let Some(value) = row.values.get(scan).filter(|v| *v != "_") {
                let place = place(program, &row.path)?;
                let bytes = takt_ir::parse_value(&program.types, place.ty, value).map_err(|e| format!("`{}`: {e}", row.path))?;
                engine.write(place, &bytes).map_err(|e| e.to_string())?;
            }
        }
        engine.step(Time(scan as i64 * wave.every));
        if let Some(fault) = engine.fault() {
            return expected_fault(wave, fault).map(|()| engine);
        }
        for row in wave.rows.iter().filter(|r| !r.drives) {
            if let Some(value) = row.values.get(scan).filter(|v| *v != "_") {
                expect(program, &engine, &row.path, value).map_err(|e| format!("scan {}: {e}", scan + 1))?;
            }
        }
    }
    match &wave.fault {
        Some(fault) => Err(format!("expected the fault `{fault}`, found none")),
        None => Ok(engine),
    }
}

fn expected_fault(wave: &Waveform, fault: &takt_engine::FaultRecord) -> Result<(), String> {
    let found = format!("{} at {}:{}", fault.fault.name(), fault.place.line, fault.place.column);
    if wave.fault.as_deref() != Some(&found) {
        return Err(format!("expected the fault `{}`, found `{found}`: {fault}", wave.fault.as_deref().unwrap_or("none")));
    }
    let stack: Vec<_> = fault.stack.iter().map(|f| format!("{}:{}", f.body, f.line)).collect();
    match &wave.stack {
        Some(expected) if *expected != stack.join(" ") => Err(format!("expected the stack `{expected}`, found `{}`", stack.join(" "))),
        _ => Ok(()),
    }
}

/// A path; a bare name may be one of the only program's variables.
fn place(program: &Program, path: &str) -> Result<Place, String> {
    let direct = takt_ir::resolve(program, path);
    let inside = |prefix: &str| takt_ir::resolve(program, &format!("{prefix}.{path}")).ok();
    direct.or_else(|e| inside("main").or_else(|| inside("plc_prg")).ok_or(format!("`{path}`: {e}")))
}

fn expect(program: &Program, engine: &Engine, path: &str, value: &str) -> Result<(), String> {
    let place = place(program, path)?;
    let shown = takt_ir::format_value(&program.types, place.ty, engine.read(place));
    if shown == value {
        return Ok(());
    }
    match takt_ir::parse_value(&program.types, place.ty, value) {
        Ok(bytes) if takt_ir::format_value(&program.types, place.ty, &bytes) == shown => Ok(()),
        Ok(_) => Err(format!("`{path}` expected {value}, found {shown}")),
        Err(e) => Err(format!("`{path}` expected {value} ({e}), found {shown}")),
    }
}

/// The whole memory of two runs, bit for bit, and their faults.
pub fn compare(a: &Engine, b: &Engine) -> Result<(), String> {
    if a.fault() != b.fault() {
        return Err(format!("the executors differ: interpreter {:?}, machine code {:?}", a.fault(), b.fault()));
    }
    match a.image().iter().zip(b.image()).position(|(x, y)| x != y) {
        None => Ok(()),
        Some(at) => Err(format!(
            "the executors differ at byte {at} ({}): interpreter {}, machine code {}",
            name_of(a.program(), at),
            a.image()[at],
            b.image()[at]
        )),
    }
}

fn name_of(program: &Program, at: usize) -> String {
    let inside = program.globals.iter().find(|g| (g.offset as usize..(g.offset + program.types.size(g.ty)) as usize).contains(&at));
    inside.map_or("stack".into(), |g| format!("{} + {}", g.name, at - g.offset as usize))
}
