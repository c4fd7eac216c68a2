//! FILE.Read and FILE.Write: bytes between a file and the program's memory, chunk by chunk.

use super::FileError;
use super::job::{Job, Transfer};
use super::open::{OpenFile, file};
use super::trigger::{Action, Step, file_block, pins};
use takt_abi::{Bool, CHUNK, Cx, Env, Fault, Folder, Handle, Lword, Request, Time};

/// Bytes that one unit of fuel pays for.
const FUEL_BYTES: i64 = 256;

/// Why a transfer ends before it is over: abort and time-out.
fn ended(abort: Bool, timeout: u32, started: i64, now: Time) -> Option<FileError> {
    let late = timeout > 0 && now.0.saturating_sub(started) > i64::from(timeout) * 1000;
    match (abort.get(), late) {
        (true, _) => Some(FileError::ABORT),
        (_, true) => Some(FileError::TIME_OUT),
        _ => None,
    }
}

fn job(env: &mut Env, own: Handle) -> Option<&mut Job> {
    env.resources.get::<Transfer>(own).map(|t| &mut t.0)
}

/// The start of a transfer: all of its bytes are the program's.
fn within(cx: &mut Cx<'_>, buffer: u64, size: u64) -> Result<Step, Fault> {
    if size > 0 {
        let length = usize::try_from(size).map_err(|_| Fault::WildPointer { offset: buffer, size })?;
        cx.bytes(buffer, length)?;
    }
    Ok(Step::Busy)
}

/// The file, and the resource of the instance. What `ended`, or has no open file, abandons its request.
fn ready(cx: &mut Cx<'_>, ended: Option<FileError>, handle: Lword) -> Result<(OpenFile, Handle), FileError> {
    let own = cx.own();
    let found = match (ended, file(&mut cx.env.resources, handle).copied(), own) {
        (Some(code), ..) => Err(code),
        (None, Some(open), Some(own)) => Ok((open, own)),
        _ => Err(FileError::HANDLE_INVALID),
    };
    if found.is_err()
        && let Some(job) = own.and_then(|own| job(cx.env, own))
    {
        job.abandon();
    }
    found
}

file_block! {
    /// `FILE.Read` of CODESYS' CAA File: reads from the file's position on, at most `szBuffer` bytes.
    FILE_Read as FileRead ["FILE.Read"] resource Transfer;
    input {
        /// Ends it.
        xAbort: Bool,
        /// The longest it may take, µs; 0: for ever.
        udiTimeOut: u32,
        /// The file.
        hFile: Lword,
        /// Where the bytes go, from the rise of `xExecute` on.
        pBuffer: u64,
        /// How many fit.
        szBuffer: u64
    }
    output {
        /// `xAbort` ended it.
        xAborted: Bool,
        /// Bytes read; fewer than `szBuffer` at the end of the file.
        szSize: u64
    }
    state { buffer: u64, size: u64, moved: u64, started: i64 }
}

impl FileRead {
    /// One answer of the host.
    fn receive(&mut self, cx: &mut Cx<'_>, open: OpenFile, data: &[u8]) -> Result<Step, Fault> {
        let wanted = usize::try_from(self.size.saturating_sub(self.moved)).unwrap_or(usize::MAX);
        let length = data.len().min(wanted);
        if length > 0 {
            let to = self.buffer.checked_add(self.moved).ok_or(Fault::WildPointer { offset: self.buffer, size: self.size })?;
            cx.bytes_mut(to, length)?.copy_from_slice(&data[..length]);
            *cx.fuel = cx.fuel.saturating_sub(length as i64 / FUEL_BYTES);
        }
        self.moved += length as u64;
        if let Some(file) = file(&mut cx.env.resources, self.hFile) {
            file.position = open.position + length as u64;
        }
        if data.len() < CHUNK || self.moved >= self.size {
            self.szSize = self.moved;
            return Ok(Step::Over(FileError::NO_ERROR));
        }
        Ok(Step::Busy)
    }
}

impl Action for FileRead {
    pins!();
    fn clear(&mut self) {
        (self.xAborted, self.szSize) = (Bool::FALSE, 0);
    }
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        (self.moved, self.started) = (0, cx.now.0);
        (self.buffer, self.size) = (self.pBuffer, self.szBuffer);
        within(cx, self.buffer, self.size)
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let (open, own) = match ready(cx, ended(self.xAbort, self.udiTimeOut, self.started, cx.now), self.hFile) {
            Ok(found) => found,
            Err(code) => {
                self.xAborted = (code == FileError::ABORT).into();
                return Ok(Step::Over(code));
            }
        };
        if !open.reads() {
            return Ok(Step::Over(FileError::WRONG_PARAMETER));
        }
        let Env { resources, host, .. } = &mut *cx.env;
        let Some(Transfer(job)) = resources.get::<Transfer>(own) else { return Err(Fault::Panic) };
        let request = || Request::Read { folder: Folder::Data, path: open.path, offset: open.position };
        match job.run(host.as_mut(), request) {
            None => Ok(Step::Busy),
            Some(Err(error)) => Ok(Step::Over(error.into())),
            Some(Ok(chunk)) => {
                let step = self.receive(cx, open, &chunk.data);
                if let Some(job) = self::job(cx.env, own) {
                    job.give_back(chunk.data);
                }
                // The next chunk is asked for at once.
                if step == Ok(Step::Busy) { self.step(cx) } else { step }
            }
        }
    }
}

file_block! {
    /// `FILE.Write` of CODESYS' CAA File: writes `szSize` bytes from the file's position on, or behind its end where it was opened so.
    FILE_Write as FileWrite ["FILE.Write"] resource Transfer;
    input {
        /// Ends it; what is written stays.
        xAbort: Bool,
        /// The longest it may take, µs; 0: for ever.
        udiTimeOut: u32,
        /// The file.
        hFile: Lword,
        /// Where the bytes are; do not change them while `xBusy`.
        pBuffer: u64,
        /// How many.
        szSize: u64
    }
    output {
        /// `xAbort` ended it.
        xAborted: Bool
    }
    state { buffer: u64, size: u64, moved: u64, started: i64 }
}

impl FileWrite {
    /// Puts the bytes of the next request into the job's buffer.
    fn fill(&self, cx: &mut Cx<'_>, own: Handle) -> Result<(), Fault> {
        let length = self.size.saturating_sub(self.moved).min(CHUNK as u64) as usize;
        let from = self.buffer.checked_add(self.moved).ok_or(Fault::WildPointer { offset: self.buffer, size: self.size })?;
        cx.bytes(from, length)?;
        let mut buffer = job(cx.env, own).map(Job::buffer).unwrap_or_default();
        buffer.extend_from_slice(cx.bytes(from, length)?);
        *cx.fuel = cx.fuel.saturating_sub(length as i64 / FUEL_BYTES);
        if let Some(job) = job(cx.env, own) {
            job.give_back(buffer);
        }
        Ok(())
    }
}

impl Action for FileWrite {
    pins!();
    fn clear(&mut self) {
        self.xAborted = Bool::FALSE;
    }
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        (self.moved, self.started) = (0, cx.now.0);
        (self.buffer, self.size) = (self.pBuffer, self.szSize);
        within(cx, self.buffer, self.size)
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let (open, own) = match ready(cx, ended(self.xAbort, self.udiTimeOut, self.started, cx.now), self.hFile) {
            Ok(found) => found,
            Err(code) => {
                self.xAborted = (code == FileError::ABORT).into();
                return Ok(Step::Over(code));
            }
        };
        if !open.writes() {
            return Ok(Step::Over(FileError::WRONG_PARAMETER));
        }
        if self.moved >= self.size {
            return Ok(Step::Over(FileError::NO_ERROR));
        }
        if job(cx.env, own).is_some_and(|job| job.is_idle()) {
            self.fill(cx, own)?;
        }
        let Env { resources, host, .. } = &mut *cx.env;
        let Some(Transfer(job)) = resources.get::<Transfer>(own) else { return Err(Fault::Panic) };
        let request = || Request::Write { path: open.path, offset: (!open.appends()).then_some(open.position) };
        match job.run(host.as_mut(), request) {
            None => return Ok(Step::Busy),
            Some(Err(error)) => return Ok(Step::Over(error.into())),
            Some(Ok(chunk)) => {
                let written = chunk.data.len() as u64;
                job.give_back(chunk.data);
                self.moved += written;
                if let Some(file) = file(resources, self.hFile) {
                    file.position = if open.appends() { chunk.file_size } else { open.position + written };
                }
            }
        }
        // The next chunk is asked for at once.
        self.step(cx)
    }
}
