//! A host of files in memory, a reader with its interpreter and a consumer; what files do to them.

use super::*;
use crate::cnc::interpreter::NcInterpreter;
use crate::cnc::queue::{DeleteObj, GetCount, GetObj};
use crate::cnc::types::{GeoInfo, MoveType, PosInfo};
use std::collections::BTreeMap;
use takt_abi::{CHUNK, Chunk, Host, HostError, InOut, Plain, Request, Ticket, Time};

/// Where the content of a file comes from.
pub(crate) enum Content {
    Bytes(Vec<u8>),
    /// So many bytes of the same value.
    Endless(u8, u64),
    /// Grows after its first chunk.
    Growing(Vec<u8>),
    Fails(HostError),
}

/// A host of files in memory: a request is completed by the next latch.
#[derive(Default)]
pub(crate) struct Files {
    pub files: BTreeMap<String, Content>,
    asked: Vec<(Ticket, Request, Vec<u8>)>,
    done: BTreeMap<Ticket, Result<Chunk, HostError>>,
    tickets: u64,
    /// Refuses so many requests as busy first.
    pub busy: u32,
}

impl Files {
    pub(crate) fn with(name: &str, content: impl Into<Vec<u8>>) -> Self {
        let mut files = Self::default();
        files.files.insert(name.into(), Content::Bytes(content.into()));
        files
    }
    fn read(&self, request: Request, mut data: Vec<u8>) -> Result<Chunk, HostError> {
        let Request::Read { path, offset, .. } = request else { return Err(HostError::Absent) };
        let content = self.files.get(path.to_text().as_ref()).ok_or(HostError::NotFound)?;
        data.clear();
        let slice = |bytes: &[u8]| bytes[(offset as usize).min(bytes.len())..].iter().copied().take(CHUNK).collect::<Vec<_>>();
        let file_size = match content {
            Content::Fails(error) => return Err(*error),
            Content::Bytes(bytes) => {
                data.extend(slice(bytes));
                bytes.len() as u64
            }
            Content::Growing(bytes) => {
                data.extend(slice(bytes));
                bytes.len() as u64 + u64::from(offset > 0)
            }
            Content::Endless(byte, size) => {
                data.resize((size - offset).min(CHUNK as u64) as usize, *byte);
                *size
            }
        };
        Ok(Chunk { data, file_size })
    }
}

impl Host for Files {
    fn submit(&mut self, request: Request, buffer: &mut Vec<u8>) -> Result<Ticket, HostError> {
        if self.busy > 0 {
            self.busy -= 1;
            return Err(HostError::Busy);
        }
        self.tickets += 1;
        self.asked.push((Ticket(self.tickets), request, std::mem::take(buffer)));
        Ok(Ticket(self.tickets))
    }
    fn latch(&mut self, _: bool) {
        for (ticket, request, buffer) in std::mem::take(&mut self.asked) {
            let result = self.read(request, buffer);
            self.done.insert(ticket, result);
        }
    }
    fn take(&mut self, ticket: Ticket) -> Option<Result<Chunk, HostError>> {
        self.done.remove(&ticket)
    }
}

/// An environment for one block or two.
pub(crate) fn env(host: impl Host + 'static) -> Env {
    Env { task: 1, bus_period: Time::from_millis(1), ..Env::new(Time::from_millis(10), Box::new(host)) }
}

const READER: u64 = 64;
const INTERPRETER: u64 = 8 * 1024;
const BUFFER: u64 = 16 * 1024;

/// A reader and an interpreter in an image, called once per scan in this order.
pub(crate) struct Rig {
    pub env: Env,
    pub image: Vec<u8>,
    pub reader: ReadNcFile,
    pub interpreter: NcInterpreter,
    pub scans: u32,
}

impl Rig {
    pub(crate) fn new(host: impl Host + 'static, capacity: u32) -> Self {
        let mut env = env(host);
        env.resources.add(READER, ReadNcFile::DESC.resource.expect("has one")());
        let reader = ReadNcFile { bExecute: Bool::TRUE, fDefaultVel: 10.0, sFileName: Str::new("job.cnc"), ..ReadNcFile::INIT };
        let size = capacity * size_of::<GeoInfo>() as u32;
        let at = (READER as usize + std::mem::offset_of!(ReadNcFile, sentences)) as u64;
        let interpreter = NcInterpreter {
            bExecute: Bool::TRUE,
            nSizeOutQueue: size,
            pbyBufferOutQueue: Ptr::at(BUFFER),
            sentences: InOut::load(&at.to_le_bytes()),
            ..NcInterpreter::INIT
        };
        Self { env, image: vec![0; BUFFER as usize + size as usize], reader, interpreter, scans: 0 }
    }

    /// Calls `f` as a block at `this`.
    pub(crate) fn with<R>(&mut self, this: u64, f: impl FnOnce(&mut Cx<'_>, &mut ReadNcFile, &mut NcInterpreter) -> R) -> R {
        let mut fuel = i64::MAX;
        let mut cx = Cx::new(&mut self.image, &mut self.env, &mut fuel, this);
        f(&mut cx, &mut self.reader, &mut self.interpreter)
    }

    pub(crate) fn scan(&mut self) {
        self.scans += 1;
        self.env.host.latch(true);
        self.with(READER, |cx, reader, _| {
            reader.cycle(cx).expect("no fault");
            cx.store(READER, reader).expect("in the image");
        });
        self.with(INTERPRETER, |cx, _, interpreter| {
            // The consumer changes the queue in the image between the calls.
            if interpreter.poqDataOut.0 != 0 {
                interpreter.Queue = cx.deref(interpreter.poqDataOut).expect("in the image");
            }
            interpreter.cycle(cx).expect("no fault");
            cx.store(INTERPRETER, interpreter).expect("in the image");
        });
    }

    /// Takes everything out of the queue.
    pub(crate) fn consume(&mut self, mut each: impl FnMut(&GeoInfo)) {
        self.with(0, |cx, _, interpreter| {
            while GetCount::call(cx, interpreter.poqDataOut).expect("a queue") > 0 {
                let first = GetObj::call(cx, interpreter.poqDataOut, 0).expect("runs");
                each(&cx.deref(first).expect("an element"));
                DeleteObj::call(cx, interpreter.poqDataOut, 0).expect("runs");
            }
        });
    }

    /// Scans and consumes until both blocks are done or one has an error.
    pub(crate) fn run(&mut self) -> Vec<GeoInfo> {
        let mut all = Vec::new();
        for _ in 0..100_000 {
            self.scan();
            self.consume(|g| all.push(*g));
            if self.interpreter.bDone.get() || self.interpreter.bError.get() {
                break;
            }
        }
        all
    }

    /// The error of the interpreter: number, line, column, text.
    pub(crate) fn error(&self) -> (SmcError, u32, u32, String) {
        let i = &self.interpreter;
        assert_eq!(i.bError.get(), i.wErrorID != SmcError::SMC_NO_ERROR);
        (i.wErrorID, i.ErrorLine, i.ErrorColumn, i.ErrorText.to_text().into_owned())
    }
}

fn job(content: impl Into<Vec<u8>>) -> Rig {
    Rig::new(Files::with("job.cnc", content), 50)
}

fn refused(mut rig: Rig, error: SmcError, line: u32, column: u32, says: &str) {
    rig.run();
    let (id, at_line, at_column, text) = rig.error();
    assert_eq!((id, at_line, at_column), (error, line, column), "{text}");
    assert!(text.starts_with("job.cnc") && text.contains(says), "{text}");
    assert!(!rig.interpreter.Queue.bEndOfList.get() && !rig.interpreter.bDone.get());
}

fn file(content: Content) -> Rig {
    let mut files = Files::default();
    files.files.insert("job.cnc".into(), content);
    Rig::new(files, 50)
}

#[test]
fn a_short_file_is_read_and_decoded_in_two_scans() {
    let mut rig = job("G1 X1\nX2\r\n(no end)\nX3 M8");
    let all = rig.run();
    assert_eq!(all.iter().map(|g| g.iSourceLine_No).collect::<Vec<_>>(), [0, 1, 3, 3]);
    assert!(rig.interpreter.Queue.bEndOfList.get() && rig.interpreter.bDone.get());
    rig.scan();
    assert_eq!((rig.scans, rig.reader.bDone.get(), rig.reader.nLinesRead), (3, true, 4));
    assert!(all[3].bLastBlock.get() && !all[0].bLastBlock.get());
}

#[test]
fn bad_files_are_refused_at_once() {
    refused(Rig::new(Files::default(), 50), SmcError::SMC_FILE_DOESNT_EXIST, 0, 0, "no such file");
    refused(job(""), SmcError::SMC_FILE_EMPTY, 0, 0, "empty");
    refused(job("G1 X1\nG1\0X1\n"), SmcError::SMC_FILE_NOT_TEXT, 2, 0, "not a text file");
    refused(job(vec![0x7F, b'E', b'L', b'F', 0, 1]), SmcError::SMC_FILE_NOT_TEXT, 1, 0, "not a text file");
    refused(file(Content::Fails(HostError::Outside)), SmcError::SMC_FILE_OUTSIDE_FOLDER, 0, 0, "leaves");
    refused(file(Content::Fails(HostError::Os(5))), SmcError::SMC_FILE_NOT_READABLE, 0, 0, "system error 5");
    refused(file(Content::Fails(HostError::NotReadable)), SmcError::SMC_FILE_NOT_READABLE, 0, 0, "plain file");
    let big = || Content::Endless(b'X', 10_000_000_000);
    refused(file(big()), SmcError::SMC_FILE_LINE_TOO_LONG, 1, 0, "4096");
    refused(file(Content::Endless(0, 10_000_000_000)), SmcError::SMC_FILE_NOT_TEXT, 1, 0, "NUL");
    let mut rig = file(big());
    rig.run();
    assert_eq!(rig.scans, 2);
    refused(job(format!("G1 X1\n({})\n", "a".repeat(5000))), SmcError::SMC_FILE_LINE_TOO_LONG, 2, 0, "4096");
    let mut rig = job("G1 X1");
    rig.reader.sFileName = Str::EMPTY;
    rig.run();
    assert_eq!(rig.error().0, SmcError::SMC_FILE_NO_NAME);
}

#[test]
fn a_file_that_changes_while_it_is_read_is_refused() {
    let lines = "G1 X1 Y2 Z3\nX0\n".repeat(30_000);
    refused(file(Content::Growing(lines.into_bytes())), SmcError::SMC_FILE_CHANGED, 0, 0, "changed");
}

#[test]
fn bad_blocks_name_file_line_and_column() {
    refused(job("(a)\nG1 X1\nX2 H4\n"), SmcError::SMC_NC_UNKNOWN_WORD, 3, 4, "job.cnc:3:4: unknown word `H`");
    refused(job("G1 X1\nG1 XNaN"), SmcError::SMC_NC_NUMBER_INVALID, 2, 5, "not a number");
    refused(job("G1 X1e308"), SmcError::SMC_NC_NUMBER_OUT_OF_RANGE, 1, 5, "out of range");
    refused(job("G1 X"), SmcError::SMC_NC_WORD_WITHOUT_NUMBER, 1, 4, "`X12.5`");
    refused(job("G1 X1\nG01"), SmcError::SMC_NC_WORD_MISSING, 2, 1, "`G1` without an axis word");
    refused(job("G2 X5 Y0 I3"), SmcError::SMC_NC_ARC_INVALID, 1, 1, "does not close");
    refused(job("G1 X1 F0"), SmcError::SMC_NC_FEED_ZERO, 1, 1, "feed of zero");
    refused(job("G1 X1\n(* open\nX5\n"), SmcError::SMC_NC_COMMENT_OPEN, 3, 0, "does not end");
}

#[test]
fn after_an_error_the_next_job_runs() {
    let mut rig = job("G1 X1 H1");
    rig.run();
    (rig.reader.bExecute, rig.interpreter.bExecute) = (Bool::FALSE, Bool::FALSE);
    rig.scan();
    assert!(!rig.interpreter.bError.get() || rig.interpreter.shown.get());
    rig.scan();
    assert_eq!((rig.interpreter.bError.get(), rig.interpreter.ErrorLine), (false, 0), "shown once");
    let mut files = Files::with("next.cnc", "G1 X7");
    files.busy = 2;
    rig.env.host = Box::new(files);
    rig.reader.sFileName = Str::new("next.cnc");
    (rig.reader.bExecute, rig.interpreter.bExecute) = (Bool::TRUE, Bool::TRUE);
    let all = rig.run();
    assert_eq!((all.len(), all[0].piDestPos.dX, all[0].iObj_No), (1, 7.0, 1));
}

#[test]
fn the_end_shows_in_one_call_when_execute_is_low() {
    let mut rig = job("G1 X1");
    rig.scan();
    (rig.reader.bExecute, rig.interpreter.bExecute) = (Bool::FALSE, Bool::FALSE);
    rig.scan();
    assert!(rig.reader.bDone.get() && rig.interpreter.bDone.get());
    rig.scan();
    assert!(!rig.reader.bDone.get() && !rig.interpreter.bDone.get());
}

#[test]
fn a_full_queue_holds_the_interpreter_back() {
    let text: String = (1..=500).map(|i| format!("G1 X{i}\n")).collect();
    let mut rig = Rig::new(Files::with("job.cnc", text), 5);
    for _ in 0..10 {
        rig.scan();
        assert!(rig.interpreter.Queue.nCount <= 5);
    }
    assert!(rig.interpreter.Queue.bFull.get() && rig.interpreter.bBusy.get());
    let all = rig.run();
    assert_eq!(all.iter().map(|g| g.piDestPos.dX).collect::<Vec<_>>(), (1..=500).map(f64::from).collect::<Vec<_>>());
    let mut small = Rig::new(Files::with("job.cnc", "G1 X1"), 4);
    small.scan();
    assert_eq!(small.error().0, SmcError::SMC_DEC_BUFFER_TOO_SMALL);
}

#[test]
fn a_call_is_bounded_by_lines_and_by_bytes() {
    let mut rig = job("G1 X1\nX2\n".repeat(1000));
    rig.scan();
    rig.scan();
    assert_eq!(rig.interpreter.iLineNumberDecoded, 47, "the queue is full");
    rig.consume(|_| ());
    let mut rig = job(format!("({})\n", "a".repeat(2000)).repeat(100));
    rig.scan();
    rig.scan();
    assert_eq!(rig.interpreter.iLineNumberDecoded, 1, "two lines of 2002 bytes");
    let mut rig = job("\n".repeat(1000));
    rig.scan();
    rig.scan();
    assert_eq!(rig.interpreter.iLineNumberDecoded, 63);
}

#[test]
fn files_follow_each_other_with_append() {
    let mut files = Files::with("job.cnc", "G1 X1 F5\nX2");
    files.files.insert("b.cnc".into(), Content::Bytes(b"X3\nX4".to_vec()));
    let mut rig = Rig::new(files, 50);
    rig.scan();
    (rig.reader.bExecute, rig.reader.bAppend) = (Bool::FALSE, Bool::TRUE);
    rig.reader.sFileName = Str::new("b.cnc");
    rig.with(READER, |cx, reader, _| reader.cycle(cx)).expect("no fault");
    rig.reader.bExecute = Bool::TRUE;
    let all = rig.run();
    assert_eq!(all.iter().map(|g| (g.piDestPos.dX, g.iSourceLine_No)).collect::<Vec<_>>(), [(1.0, 0), (2.0, 1), (3.0, 0), (4.0, 1)]);
}

#[test]
fn abort_empties_everything() {
    let mut rig = job("G1 X1\nX2");
    rig.scan();
    rig.scan();
    assert_eq!(rig.interpreter.Queue.nCount, 2);
    (rig.reader.bAbort, rig.interpreter.bAbort) = (Bool::TRUE, Bool::TRUE);
    rig.scan();
    assert_eq!(rig.interpreter.Queue.nCount, 0);
    assert!(!rig.interpreter.bBusy.get() && !rig.reader.bBusy.get());
}

#[test]
fn encodings_of_comments_do_not_matter() {
    let mut text = b"\xEF\xBB\xBF(\xE7\x82\xB9\xE8\x83\xB6)\n".to_vec();
    text.extend(b"G1 X1 (\xB5\xE3\xBD\xBA)\nX2 ; \xFCber\n");
    let mut rig = job(text);
    assert_eq!(rig.run().len(), 2, "{:?}", rig.error());
}

#[test]
fn a_million_lines_stream_through_bounded_memory() {
    let mut text = String::with_capacity(40_000_000);
    for i in 0..1_000_000u32 {
        use std::fmt::Write;
        let _ = writeln!(text, "N{i} G01 X{}.{:03} Y{:.3} Z1", i % 300, i % 997, f64::from(i % 777) * 0.37);
    }
    let mut rig = Rig::new(Files::with("job.cnc", text), 200);
    let (mut count, mut first) = (0u32, None);
    while !rig.interpreter.bDone.get() {
        rig.scan();
        for _ in 0..100 {
            rig.consume(|_| count += 1);
            rig.with(INTERPRETER, |cx, _, interpreter| {
                interpreter.Queue = cx.deref(interpreter.poqDataOut).expect("in the image");
                interpreter.cycle(cx).expect("no fault");
                cx.store(INTERPRETER, interpreter).expect("in the image");
            });
        }
        if count > 0 && first.is_none() {
            first = Some(rig.scans);
        }
        assert!(!rig.interpreter.bError.get(), "{:?}", rig.error());
    }
    rig.consume(|_| count += 1);
    rig.scan();
    assert_eq!((count, first, rig.reader.nLinesRead), (1_000_000, Some(2), 1_000_000));
}

#[test]
fn random_bytes_never_panic() {
    let mut seed = 11u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as u32
    };
    let alphabet = b"GGXYZABCFEMNIJKRT0123456789.+- \n\n()*;/%$#";
    for round in 0..3000 {
        let length = random() as usize % 400;
        let text: Vec<u8> =
            (0..length).map(|_| if round % 3 == 0 { random() as u8 } else { alphabet[random() as usize % alphabet.len()] }).collect();
        let mut rig = job(text);
        rig.run();
        assert!(rig.interpreter.bDone.get() || rig.interpreter.bError.get());
    }
}

#[test]
fn random_blocks_never_make_elements_that_are_not_finite() {
    let mut seed = 21u64;
    let mut random = move |n: u32| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as u32 % n
    };
    let codes =
        ["G0", "G1", "G2", "G3", "G17", "G18", "G19", "G53", "G54", "G55", "G56", "G90", "G91", "G92", "G98", "G99", "M8", "F5", ""];
    for round in 0..3000 {
        let mut text = String::new();
        for _ in 0..20 {
            text += codes[random(codes.len() as u32) as usize];
            for letter in ["X", "Y", "Z", "A", "I", "J", "R", "C"] {
                if random(3) == 0 {
                    text += &format!(" {letter}{}", ["0", "5", "-10", "0.001", "1000000000", "90"][random(6) as usize]);
                }
            }
            text += "\n";
        }
        let mut rig = job(text.clone());
        rig.interpreter.eOriConv.0 = round % 5;
        for g in rig.run() {
            let numbers = [g.dLength, g.dVel, g.dT1, g.dT2, g.dP1, g.dP2, g.dP3].into_iter().chain(g.piDestPos.axes());
            assert!(numbers.into_iter().all(f64::is_finite), "{text}");
        }
    }
}

#[test]
fn the_phone_job_is_as_long_as_its_truth_says() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/");
    let text = std::fs::read(format!("{folder}phone.cnc")).expect("the job");
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{folder}phone_truth.json")).expect("truth")).expect("json");
    let mut rig = job(text);
    rig.interpreter.piStartPosition = PosInfo { dX: 1.0, ..PosInfo::INIT };
    let all = rig.run();
    assert!(rig.interpreter.bDone.get(), "{:?}", rig.error());
    let feeds: Vec<_> = all.iter().filter(|g| g.iMoveType == MoveType::LIN).collect();
    let marks: Vec<_> = all.iter().filter(|g| g.iMoveType == MoveType::MCOMMAND).map(|g| (g.iM_No, g.iSourceLine_No + 1)).collect();
    let length: f64 = feeds.iter().map(|g| g.dLength).sum();
    let total = truth["meta"]["total_length_mm"].as_f64().expect("length");
    assert!((length - total).abs() < 2e-3, "{length} {total}");
    assert_eq!(feeds.len() as u64, truth["meta"]["n_points"].as_u64().expect("points") + 3);
    assert_eq!(marks, [(8, 8), (9, 867)]);
    assert!(feeds.iter().all(|g| g.dVel == 20.0) && feeds.windows(2).all(|w| w[0].piDestPos.axes() == w[1].piStartPos.axes()));
}

#[test]
fn a_saved_source_goes_on_where_it_was() {
    let text: String = (1..60_000).map(|i| format!("G1 X{i}.5 Y2\n")).collect();
    let expected = job(text.clone()).run().len();
    for scans in [0, 1, 2, 3, 40, 400] {
        let mut rig = job(text.clone());
        let mut count = 0;
        for _ in 0..scans {
            rig.scan();
            rig.consume(|_| count += 1);
        }
        let saved = rig.env.resources.save();
        let mut resource = ReadNcFile::DESC.resource.expect("has one")();
        assert!(!resource.restore(&saved[0].1[..saved[0].1.len() - 1]), "cut");
        assert!(resource.restore(&saved[0].1));
        assert_eq!(resource.save(), saved[0].1);
        let own = rig.env.resources.of(READER).expect("owns");
        rig.env.resources.take(own);
        rig.env.resources.put(own, resource);
        assert_eq!(count + rig.run().len(), expected, "{scans}");
    }
}
