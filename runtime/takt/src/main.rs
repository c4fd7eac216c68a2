//! The `takt` command.

use clap::Parser;
use std::process::ExitCode;
use takt::commands::{self, Cli};

/// The exit code of a defect of Takt.
const DEFECT: u8 = 101;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match std::panic::catch_unwind(|| commands::execute(cli)) {
        Ok(exit) => ExitCode::from(exit as u8),
        Err(_) => {
            eprintln!("{}", takt::language::Word::DefectOfTakt.text(takt::language::of_environment()));
            ExitCode::from(DEFECT)
        }
    }
}
