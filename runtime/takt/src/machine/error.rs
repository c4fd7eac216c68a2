//! Why a machine cannot be built, why a variable cannot be reached, and why a run is over.

use crate::manifest::ManifestErrors;
use crate::program::Compiled;
use crate::retain::Refusal;
use std::fmt;
use takt_abi::Fault;
use takt_engine::{AccessError, LoadError};
use takt_ir::{SymbolError, ValueError};

/// Why a machine cannot be built.
#[derive(Debug)]
pub enum BuildError {
    /// The sources or conditions have errors.
    Program(Box<Compiled>),
    /// The manifest names what the program does not have.
    Manifest(ManifestErrors),
    /// The engine refuses the program.
    Load(LoadError),
    /// Retained values do not go with the program.
    Retain(Vec<Refusal>),
    /// The file service cannot be started.
    Files(std::io::Error),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Program(compiled) => {
                let (errors, _) = compiled.counts();
                write!(f, "the program has {errors} errors")?;
                for diagnostic in &compiled.diagnostics {
                    let spot = compiled.locate(diagnostic.span);
                    let place = crate::manifest::Place::of(spot.text, spot.range.start);
                    write!(f, "\n{}:{}:{}: {} {}", spot.file, place.line, place.column, diagnostic.code.text(), diagnostic.message)?;
                }
                Ok(())
            }
            Self::Manifest(errors) => write!(f, "{errors}"),
            Self::Load(error) => write!(f, "{error}"),
            Self::Retain(refused) => {
                write!(f, "retained values do not go with the program:")?;
                refused.iter().try_for_each(|refusal| write!(f, "\n  {}: {}", refusal.path, refusal.reason))?;
                write!(
                    f,
                    "\nNothing was loaded or changed. `takt retain export` writes the values down to be corrected and imported; \
                     `takt run --cold` starts RETAIN variables, `takt run --origin` all of them, with their initial values"
                )
            }
            Self::Files(error) => write!(f, "the file service: {error}"),
        }
    }
}
impl std::error::Error for BuildError {}

/// Why a variable cannot be read or written from outside.
#[derive(Debug, Clone, PartialEq)]
pub enum VariableError {
    /// There is no such variable.
    Name(SymbolError),
    /// The text is no value of its type.
    Value(ValueError),
    /// It has another type than asked for.
    Kind {
        /// The variable.
        path: String,
        /// Its type.
        found: String,
        /// What was asked for.
        expected: &'static str,
    },
    /// It cannot be written from outside.
    Access {
        /// The variable.
        path: String,
        /// Why.
        error: AccessError,
    },
}

impl fmt::Display for VariableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(error) => write!(f, "{error}"),
            Self::Value(error) => write!(f, "{error}"),
            Self::Kind { path, found, expected } => write!(f, "`{path}` is `{found}`, expected {expected}"),
            Self::Access { path, error } => write!(f, "`{path}`: {error}"),
        }
    }
}
impl std::error::Error for VariableError {}

/// Why a run is over.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// The condition of `--until`.
    Until,
    /// The manifest says that the demonstration is over.
    Done,
    /// It was not over in its time; with what the operator waited for.
    TimedOut {
        /// The condition, as it stands in the manifest.
        waiting_for: String,
    },
    /// The program faulted; see [`crate::machine::Machine::fault`].
    Fault,
    /// A condition cannot be evaluated.
    Condition {
        /// The condition.
        text: String,
        /// Why.
        fault: Fault,
    },
}
