//! ReadNCFile: streams a G-code file from the project's folder `nc`.

use super::source::{NcSource, Phase, Settings};
use super::trouble::{Kind, Trouble};
use super::types::{SentenceQueue, VarList};
use takt_abi::{Bool, Cx, Env, Fault, Ptr, SmcError, Str, function_block};

function_block! {
    /// Streams a G-code file from the project's folder `nc` to an NCInterpreter.
    ///
    /// The rising edge of `bExecute` opens the file; from then on call the block in every scan of a slow task, before the NCInterpreter that is given its
    /// `sentences`. Files of any size need the same memory (two chunks of 256 KiB). `bDone` says that the whole file has been read, not that it has been
    /// interpreted. A missing, empty, binary or changing file, a line of more than 4096 bytes and a path that leaves the folder end in `bError`, with
    /// the place in `ErrorLine`, `ErrorColumn` and a sentence for people in `ErrorText`. UTF-8, GBK and Latin-1 are read.
    pub block ReadNCFile as ReadNcFile aliases ["SMC_ReadNCFile2"] resource NcSource {
        input {
            /// The rising edge starts.
            bExecute: Bool,
            /// With the rising edge: the file follows the one that is being read.
            bAppend: Bool,
            /// Stops reading and forgets what has been read.
            bAbort: Bool,
            /// File, relative to the folder `nc`.
            sFileName: Str<256>,
            /// Variables for expressions; not used yet.
            pvl: Ptr<VarList>,
            /// Path velocity before the first F, per second.
            fDefaultVel: f64,
            /// Path acceleration before the first E, per s²; 0: the planner's own.
            fDefaultAccel: f64,
            /// Path deceleration before the first E-, per s²; 0: the planner's own.
            fDefaultDecel: f64,
            /// Velocity of rapids (G0) before the first FF, per second; 0: that of feed moves.
            fDefaultVelFF: f64,
            /// Acceleration of rapids before the first EF, per s²; 0: that of feed moves.
            fDefaultAccelFF: f64,
            /// Deceleration of rapids before the first EF-, per s²; 0: that of feed moves.
            fDefaultDecelFF: f64,
            /// Folders of subprograms; not used yet.
            aSubProgramDirs: [Str<175>; 5],
            /// `( )` is a comment; else only `(* *)`.
            bParenthesesAsComments: Bool = Bool::TRUE,
            /// Everything is always checked.
            bEnableSyntaxChecks: Bool = Bool::TRUE
        }
        output {
            /// The whole file has been read.
            bDone: Bool,
            /// Reading.
            bBusy: Bool,
            /// An error; see `ErrorText`.
            bError: Bool,
            /// Its number.
            ErrorID: SmcError,
            /// Line of the error, from 1; 0: the file as a whole.
            ErrorLine: u32,
            /// Column of the error in bytes, from 1; 0: the line as a whole.
            ErrorColumn: u32,
            /// What is wrong, where, and what to do.
            ErrorText: Str<256>,
            /// For the NCInterpreter.
            sentences: SentenceQueue,
            /// Size of the file, bytes.
            nFileSize: u64,
            /// How much of it has been read, bytes.
            nBytesRead: u64,
            /// Lines that have been handed to the interpreter.
            nLinesRead: u32
        }
        state {
            last: Bool,
            shown: Bool
        }
    }
    fn cycle(fb, cx) {
        fb.run(cx)
    }
}

impl ReadNcFile {
    fn run(&mut self, cx: &mut Cx<'_>) -> Result<(), Fault> {
        let rising = self.bExecute.get() && !self.last.get();
        self.last = self.bExecute;
        let Some(own) = cx.own() else {
            self.show_error(Kind::NoReader.at(0, 0), &self.sFileName.clone());
            return Ok(());
        };
        self.sentences.hReader = own;
        let settings = self.settings();
        let Env { resources, host, .. } = &mut *cx.env;
        let Some(source) = resources.get::<NcSource>(own) else { return Err(Fault::Panic) };
        if self.bAbort.get() {
            source.abort();
        } else if rising {
            source.start(self.sFileName, settings, self.bAppend.get());
            self.shown = Bool::FALSE;
        }
        source.pump(host.as_mut());
        let (size, read) = source.progress();
        (self.nFileSize, self.nBytesRead, self.nLinesRead) = (size, read, source.line());
        self.show(source.phase(), source.path());
        Ok(())
    }

    fn settings(&self) -> Settings {
        Settings {
            feed: [self.fDefaultVel, self.fDefaultAccel, self.fDefaultDecel].map(finite),
            rapid: [self.fDefaultVelFF, self.fDefaultAccelFF, self.fDefaultDecelFF].map(finite),
            parentheses: self.bParenthesesAsComments.get(),
        }
    }

    /// Sets the outputs. With `bExecute` low the end of the work shows in one call.
    fn show(&mut self, phase: Phase, file: &Str<256>) {
        let over = self.shown.get() && !self.bExecute.get();
        (self.bDone, self.bBusy) = (Bool::FALSE, Bool::FALSE);
        match phase {
            Phase::Reading => self.bBusy = Bool::TRUE,
            Phase::Read if !over => self.bDone = Bool::TRUE,
            Phase::Failed(trouble) if !over => return self.show_error(trouble, file),
            _ => {}
        }
        self.shown = (over || self.bDone.get()).into();
        if self.bError.get() {
            self.clear_error();
        }
    }

    fn show_error(&mut self, trouble: Trouble, file: &Str<256>) {
        (self.bDone, self.bBusy) = (Bool::FALSE, Bool::FALSE);
        if !self.bError.get() || self.ErrorID != trouble.kind.error() || self.ErrorLine != trouble.line || !self.shown.get() {
            (self.bError, self.ErrorID) = (Bool::TRUE, trouble.kind.error());
            (self.ErrorLine, self.ErrorColumn) = (trouble.line, trouble.column);
            self.ErrorText = trouble.text(file);
        }
        self.shown = Bool::TRUE;
    }

    fn clear_error(&mut self) {
        (self.bError, self.ErrorID) = (Bool::FALSE, SmcError::SMC_NO_ERROR);
        (self.ErrorLine, self.ErrorColumn, self.ErrorText) = (0, 0, Str::EMPTY);
    }
}

/// What is no usable number counts as not given.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

#[cfg(test)]
pub(crate) mod tests;
