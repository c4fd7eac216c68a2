//! One program in both executors: what is a finding, and what both agreed on.

use crate::bench::compare;
use crate::generate::Generated;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use takt_abi::{Fault, Time};
use takt_compile::{Input, Options as Choices};
use takt_engine::{ExecutorKind, NoBus, Options};
use takt_ir::Program;
use takt_syntax::{Severity, Source};

/// Scans of a program.
const SCANS: i64 = 3;

/// Bytes of native stack that a thread needs that runs generated programs.
pub const NATIVE_STACK: usize = 256 << 20;

/// What is wrong with a program, or with Takt.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// The compiler refuses a program that is right.
    Rejected(String),
    /// The verifier, or the code generator, refuses what the compiler made.
    Unsound(String),
    /// The executors differ.
    Differs(String),
    /// Something panicked.
    Panicked(String),
}

impl Finding {
    /// Whether two findings are of one kind (while a program is made smaller).
    pub fn is_like(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (head, text) = match self {
            Self::Rejected(text) => ("the compiler refuses a program that is right", text),
            Self::Unsound(text) => ("the program is not sound", text),
            Self::Differs(text) => ("the executors differ", text),
            Self::Panicked(text) => ("a panic", text),
        };
        write!(f, "{head}: {text}")
    }
}

/// Compiles a generated program, and verifies it.
pub fn compile(source: &str, iec_arithmetic: bool) -> Result<Program, Finding> {
    let sources = [Source { name: "generated.st".into(), text: source.into() }];
    let choices = Choices { iec_arithmetic, ..Choices::default() };
    let output = takt_compile::compile(Input { sources: &sources, libraries: &[&takt_stdlib_fb::LIBRARY], options: &choices });
    let errors = output.diagnostics.iter().filter(|d| d.severity() == Severity::Error);
    let line = |at: u32| source.get(..at as usize).map_or(0, |before| before.matches('\n').count() + 1);
    let shown: Vec<String> = errors.map(|d| format!("\n  line {}: {} {}", line(d.span.start), d.code.text(), d.message)).collect();
    match output.program {
        Some(program) if shown.is_empty() => {
            takt_ir::verify(&program).map_err(|e| Finding::Unsound(e.to_string()))?;
            Ok(program)
        }
        _ => Err(Finding::Rejected(shown.concat())),
    }
}

/// Runs a program in both executors, through the engine; what both agreed on as a fault.
pub fn run(program: &Arc<Program>) -> Result<Option<Fault>, Finding> {
    let load = |executor| {
        let options = Options { executor, fuel_limit: 20_000, depth_limit: 100, ..Options::default() };
        takt_engine::load(program.clone(), options, Box::new(NoBus))
    };
    let (mut a, mut b) = match (load(ExecutorKind::Interpreter), load(ExecutorKind::Jit)) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(takt_engine::LoadError::Initial(a)), Err(takt_engine::LoadError::Initial(b))) if a == b => return Ok(Some(a.fault)),
        (a, b) => return Err(Finding::Unsound(format!("{:?} {:?}", a.err(), b.err()))),
    };
    if b.native_stack() > NATIVE_STACK / 2 {
        return Err(Finding::Unsound(format!("it needs {} bytes of native stack", b.native_stack())));
    }
    for scan in 0..SCANS {
        let now = Time(scan * 10_000_000);
        a.step(now);
        b.step(now);
        if a.image() != b.image() || a.fault() != b.fault() {
            compare(&a, &b).map_err(|e| Finding::Differs(format!("scan {scan}: {e}")))?;
        }
        if let Some(fault) = a.fault() {
            return match fault.fault {
                Fault::Panic => Err(Finding::Panicked(fault.to_string())),
                fault => Ok(Some(fault)),
            };
        }
    }
    Ok(None)
}

/// Everything from text to comparison; a panic anywhere is a finding.
pub fn examine(generated: &Generated) -> Result<(Arc<Program>, Option<Fault>), Finding> {
    let all = || {
        let program = Arc::new(compile(&generated.source, generated.iec_arithmetic)?);
        let fault = run(&program)?;
        Ok((program, fault))
    };
    catch_unwind(AssertUnwindSafe(all)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned().or_else(|| panic.downcast_ref::<&str>().map(|s| s.to_string()));
        Err(Finding::Panicked(text.unwrap_or_default()))
    })
}
