//! NCInterpreter: turns the lines of a reader into path elements in a queue.

use super::decode::{Elements, Flow, Modal, decode};
use super::queue::ELEMENT;
use super::source::{NcSource, Next, Settings};
use super::trouble::{Kind, Trouble};
use super::types::{DecoderStatus, GeoInfo, OriConvention, OutQueue, PosInfo, SentenceQueue, Vector3};
use super::words::{Comments, Words};
use std::mem::offset_of;
use takt_abi::{Bool, Cx, Fault, Handle, Plain, Ptr, SmcError, Str, function_block};

/// Lines that one call decodes at the most.
const LINES: u32 = 64;
/// A call begins no line after so many bytes: comments cost time too.
const BYTES: usize = 2 * 1024;
/// Elements that the buffer must hold.
const LEAST: u64 = 5;

function_block! {
    /// Decodes G-code into path elements (SMC_GEOINFO) in a queue whose buffer belongs to the program.
    ///
    /// The rising edge of `bExecute` starts with an empty queue at `piStartPosition`; from then on call the block in every scan of a slow task, behind the
    /// ReadNCFile whose `sentences` it is given. A call decodes at most 64 lines or 2 KiB (less than 20 µs); it may be called more than once in a scan. It waits when the
    /// queue is full and goes on when there is room. `poqDataOut` is the queue: take elements out with SMC_GetObj and SMC_DeleteObj. At the end of the file, or
    /// at M2 or M30, `bDone` and `poqDataOut^.bEndOfList` become TRUE. An error ends the work: elements decoded before it stay in the queue, `bEndOfList` stays FALSE.
    ///
    /// Words: N, X Y Z A B C P Q U V W, I J K R, F FF E EF, T, M. G0 G1 G2 G3 (arcs and helices in the plane of G17 G18 G19, centre by I J K as G98 or G99 says, or R),
    /// G4 T (s), G90 G91, G92. G54 sets the coordinate system (shift by the axis words, scale by I J K; A B C turn it unless `eOriConv` is ADDAXES, which shifts them),
    /// G55 changes it in its own coordinates, G56 moves it so that the tool has the given coordinates, G53 resets it.
    ///
    /// M functions are elements of type MCOMMAND with `iM_No`; those of a block act before its move, except M0, M1 and M60. A move that goes nowhere makes no element. G92 makes
    /// none either: the next element starts where G92 says, so the path jumps unless the tool is there.
    pub block NCInterpreter as NcInterpreter aliases ["SMC_NCInterpreter"] {
        input {
            /// The rising edge starts.
            bExecute: Bool,
            /// Stops and empties the queue.
            bAbort: Bool,
            /// With the rising edge: keeps queue, position and everything the last program has set.
            bAppend: Bool,
            /// Where the tool is at the start, in machine coordinates.
            piStartPosition: PosInfo,
            /// Length of the tool at the start; must be 0.
            vStartToolLength: Vector3,
            /// Size of the buffer in bytes: at least 5 SMC_GEOINFO.
            nSizeOutQueue: u32,
            /// The buffer of the queue.
            pbyBufferOutQueue: Ptr<[GeoInfo; 1]>,
            /// What A, B and C are when G54 or G55 turn the coordinate system.
            eOriConv: OriConvention,
            /// Everything is always checked.
            bEnableSyntaxChecks: Bool = Bool::TRUE
        }
        output {
            /// The program has been decoded.
            bDone: Bool,
            /// Decoding, or waiting for lines or room.
            bBusy: Bool,
            /// An error; see `ErrorText`.
            bError: Bool,
            /// Its number.
            wErrorID: SmcError,
            /// The queue.
            poqDataOut: Ptr<OutQueue>,
            /// What it is doing.
            iStatus: DecoderStatus,
            /// The line that was decoded last, from 0; -1: none yet.
            iLineNumberDecoded: i32 = -1,
            /// Line of the error, from 1; 0: no line.
            ErrorLine: u32,
            /// Column of the error in bytes, from 1; 0: the line as a whole.
            ErrorColumn: u32,
            /// What is wrong, where, and what to do.
            ErrorText: Str<256>
        }
        inout {
            /// The output `sentences` of a ReadNCFile.
            sentences: SentenceQueue
        }
        state {
            /// The queue that `poqDataOut` points to.
            Queue: OutQueue,
            Modal: Modal,
            begun: Bool,
            last: Bool,
            shown: Bool
        }
    }
    fn cycle(fb, cx) {
        fb.run(cx)
    }
}

/// How a call of the decoder ended.
enum Stop {
    Wait,
    End,
    Failed(Trouble),
}

impl NcInterpreter {
    fn run(&mut self, cx: &mut Cx<'_>) -> Result<(), Fault> {
        self.poqDataOut = Ptr::at(cx.this + offset_of!(Self, Queue) as u64);
        let rising = self.bExecute.get() && !self.last.get();
        self.last = self.bExecute;
        if self.bAbort.get() {
            self.Queue.start(self.pbyBufferOutQueue.0, self.capacity());
            self.finish(DecoderStatus::WAIT_PROG);
        } else if rising {
            self.start();
        } else if !self.bBusy.get() {
            self.one_call_only();
        }
        if self.bBusy.get() { self.decode(cx) } else { Ok(()) }
    }

    fn capacity(&self) -> u32 {
        (u64::from(self.nSizeOutQueue) / ELEMENT) as u32
    }

    fn start(&mut self) {
        self.finish(DecoderStatus::READ_WORD);
        if !self.bAppend.get() {
            self.Queue.start(self.pbyBufferOutQueue.0, self.capacity());
            self.Modal = Modal { piProgram: self.piStartPosition, piMachine: self.piStartPosition, ..Modal::INIT };
            (self.begun, self.iLineNumberDecoded) = (Bool::FALSE, -1);
        }
        self.Queue.bEndOfList = Bool::FALSE;
        let trouble = if u64::from(self.Queue.nCapacity) < LEAST || self.Queue.pbyBuffer.0 == 0 {
            Some(Kind::QueueTooSmall)
        } else if self.vStartToolLength.array() != [0.0; 3] {
            Some(Kind::ToolLength)
        } else if !self.piStartPosition.axes().iter().all(|v| v.is_finite()) {
            Some(Kind::NumberInvalid)
        } else {
            None
        };
        match trouble {
            Some(kind) => self.fail(kind.at(0, 0), &Str::new("NCInterpreter")),
            None => self.bBusy = Bool::TRUE,
        }
    }

    /// Ends the work in hand and clears the outputs.
    fn finish(&mut self, status: DecoderStatus) {
        (self.bDone, self.bBusy, self.bError, self.shown) = (Bool::FALSE, Bool::FALSE, Bool::FALSE, Bool::FALSE);
        (self.wErrorID, self.ErrorLine, self.ErrorColumn) = (SmcError::SMC_NO_ERROR, 0, 0);
        (self.ErrorText, self.iStatus) = (Str::EMPTY, status);
    }

    /// With `bExecute` low the end of the work shows in one call.
    fn one_call_only(&mut self) {
        if !self.bExecute.get() && (self.bDone.get() || self.bError.get()) {
            if self.shown.get() {
                self.finish(self.iStatus);
            }
            self.shown = Bool::TRUE;
        }
    }

    fn fail(&mut self, trouble: Trouble, file: &Str<256>) {
        self.finish(DecoderStatus::WAIT_PROG);
        (self.bError, self.wErrorID) = (Bool::TRUE, trouble.kind.error());
        (self.ErrorLine, self.ErrorColumn, self.ErrorText) = (trouble.line, trouble.column, trouble.text(file));
        self.shown = (!self.bExecute.get()).into();
    }

    fn decode(&mut self, cx: &mut Cx<'_>) -> Result<(), Fault> {
        let handle = cx.get(self.sentences)?.hReader;
        if handle == Handle(0) {
            return Ok(());
        }
        let Some(mut resource) = cx.env.resources.take(handle) else {
            self.fail(Kind::NoReader.at(0, 0), &Str::new("NCInterpreter"));
            return Ok(());
        };
        let result = match resource.as_any().downcast_mut::<NcSource>() {
            Some(source) => self.lines(cx, source),
            None => {
                self.fail(Kind::NoReader.at(0, 0), &Str::new("NCInterpreter"));
                Ok(())
            }
        };
        cx.env.resources.put(handle, resource);
        result
    }

    fn lines(&mut self, cx: &mut Cx<'_>, source: &mut NcSource) -> Result<(), Fault> {
        let settings = *source.settings();
        let (mut words, mut elements) = (Words::default(), Elements::default());
        let (mut budget, mut lines) = (BYTES, LINES);
        while lines > 0 && budget > 0 && !self.Queue.is_full() {
            lines -= 1;
            match self.line(source, &settings, &mut words, &mut elements, &mut budget) {
                Ok(None) => {}
                Ok(Some(Stop::Wait)) => break,
                Ok(Some(Stop::Failed(trouble))) | Err(trouble) => {
                    self.fail(trouble, source.path());
                    break;
                }
                Ok(Some(Stop::End)) => {
                    self.append(cx, &elements)?;
                    self.Queue.end(cx)?;
                    self.finish(DecoderStatus::PROG_READ);
                    self.bDone = Bool::TRUE;
                    self.shown = (!self.bExecute.get()).into();
                    break;
                }
            }
            *cx.fuel -= 1;
            self.append(cx, &elements)?;
        }
        Ok(())
    }

    /// Decodes the next line into `elements`.
    fn line(
        &mut self,
        source: &mut NcSource,
        settings: &Settings,
        words: &mut Words,
        elements: &mut Elements,
        budget: &mut usize,
    ) -> Result<Option<Stop>, Trouble> {
        elements.clear();
        let (number, text) = match source.next_line() {
            Next::Line(number, text) => (number, text),
            Next::Wait => return Ok(Some(Stop::Wait)),
            Next::Failed(trouble) => return Ok(Some(Stop::Failed(trouble))),
            Next::End if self.Modal.bComment.get() => return Err(Kind::CommentOpen.at(source.line(), 0)),
            Next::End => return Ok(Some(Stop::End)),
        };
        *budget = budget.saturating_sub(text.len());
        if !self.begun.get() {
            self.begin(settings);
        }
        self.iLineNumberDecoded = number.saturating_sub(1).min(i32::MAX as u32) as i32;
        let mut comments = Comments { parentheses: settings.parentheses, open: self.Modal.bComment.get() };
        words.read(text, &mut comments).map_err(|t| Trouble { line: number, ..t })?;
        self.Modal.bComment = comments.open.into();
        let flow = decode(words, &mut self.Modal, self.eOriConv, number, elements)?;
        Ok((flow == Flow::End).then_some(Stop::End))
    }

    /// The first line is there, and with it what the reader was told.
    fn begin(&mut self, settings: &Settings) {
        self.begun = Bool::TRUE;
        [self.Modal.dVel, self.Modal.dAccel, self.Modal.dDecel] = settings.feed;
        [self.Modal.dVelFF, self.Modal.dAccelFF, self.Modal.dDecelFF] = settings.rapid;
    }

    fn append(&mut self, cx: &mut Cx<'_>, elements: &Elements) -> Result<(), Fault> {
        for element in elements.as_slice() {
            self.Queue.append(cx, element)?;
        }
        Ok(())
    }
}
