//! The `takt` command.

use clap::Parser;
use std::process::ExitCode;
use takt::commands::{self, Cli};

#[global_allocator]
static ALLOCATOR: takt::realtime::guard::Counting = takt::realtime::guard::Counting;

/// The exit code of a defect of Takt.
const DEFECT: u8 = 101;

fn main() -> ExitCode {
    let cli = Cli::parse();
    // Compiled code runs on the thread that steps the engine; its stack is sized for the deepest recursion that is allowed.
    let tool = std::thread::Builder::new()
        .name("takt".into())
        .stack_size(takt::machine::NATIVE_STACK + (16 << 20))
        .spawn(move || commands::execute(cli));
    match tool.map(std::thread::JoinHandle::join) {
        Ok(Ok(exit)) => ExitCode::from(exit as u8),
        Err(error) => {
            eprintln!("error: there is no thread with {} MiB of stack: {error}", takt::machine::NATIVE_STACK >> 20);
            ExitCode::from(DEFECT)
        }
        Ok(Err(_)) => {
            eprintln!("{}", takt::language::Word::DefectOfTakt.text(takt::language::of_environment()));
            ExitCode::from(DEFECT)
        }
    }
}
