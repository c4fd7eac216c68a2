//! How the blocks of this topic behave: `xExecute` starts, `xDone` or `xError` ends, as in CODESYS' behaviour model ETrig.

use super::FileError;
use takt_abi::{Bool, Cx, Fault};

/// Where an action stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Not yet over.
    Busy,
    /// Over, well or with an error.
    Over(FileError),
}

/// The pins that all blocks share.
pub(super) struct Pins<'a> {
    pub(super) execute: bool,
    pub(super) last: &'a mut Bool,
    pub(super) done: &'a mut Bool,
    pub(super) busy: &'a mut Bool,
    pub(super) error: &'a mut Bool,
    pub(super) code: &'a mut FileError,
}

/// What a block does between its start and its end.
pub(super) trait Action {
    /// Its pins.
    fn pins(&mut self) -> Pins<'_>;
    /// The start.
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault>;
    /// Each call after it, until it is over.
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault>;
    /// Resets its own outputs.
    fn clear(&mut self) {}
}

/// A call of the block. What ended while `xExecute` was FALSE shows for one call.
pub(super) fn call<A: Action>(action: &mut A, cx: &mut Cx<'_>) -> Result<(), Fault> {
    let pins = action.pins();
    let rising = pins.execute && !pins.last.get();
    *pins.last = pins.execute.into();
    let (execute, busy) = (pins.execute, pins.busy.get());
    let mut step = Step::Busy;
    if !busy {
        if !rising && execute {
            return Ok(());
        }
        (*pins.done, *pins.error, *pins.code) = (Bool::FALSE, Bool::FALSE, FileError::NO_ERROR);
        action.clear();
        if !rising {
            return Ok(());
        }
        step = action.begin(cx)?;
        *action.pins().busy = Bool::TRUE;
    }
    if step == Step::Busy {
        step = action.step(cx)?;
    }
    if let Step::Over(code) = step {
        let pins = action.pins();
        *pins.busy = Bool::FALSE;
        // An aborted action is neither done nor in error.
        let error = !matches!(code, FileError::NO_ERROR | FileError::ABORT);
        (*pins.done, *pins.error) = ((code == FileError::NO_ERROR).into(), error.into());
        *pins.code = code;
    }
    Ok(())
}

/// Declares a block of this topic: the shared pins, then its own.
macro_rules! file_block {
    ($(#[doc = $doc:literal])* $st:ident as $rust:ident [$alias:literal] resource $res:ty;
     input { $($input:tt)* } output { $($output:tt)* } state { $($state:tt)* }) => {
        takt_abi::function_block! {
            $(#[doc = $doc])*
            pub block $st as $rust aliases [$alias] resource $res {
                input {
                    /// The rise starts.
                    xExecute: takt_abi::Bool,
                    $($input)*
                }
                output {
                    /// It is done.
                    xDone: takt_abi::Bool,
                    /// It is under way.
                    xBusy: takt_abi::Bool,
                    /// It failed; see `eError`.
                    xError: takt_abi::Bool,
                    /// Why.
                    eError: crate::file::FileError,
                    $($output)*
                }
                state { last: takt_abi::Bool, $($state)* }
            }
            fn cycle(fb, cx) { crate::file::trigger::call(fb, cx) }
        }
    };
}

/// The shared pins of a block declared so.
macro_rules! pins {
    () => {
        fn pins(&mut self) -> crate::file::trigger::Pins<'_> {
            crate::file::trigger::Pins {
                execute: self.xExecute.get(),
                last: &mut self.last,
                done: &mut self.xDone,
                busy: &mut self.xBusy,
                error: &mut self.xError,
                code: &mut self.eError,
            }
        }
    };
}

pub(super) use {file_block, pins};
