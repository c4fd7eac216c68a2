//! FILE.GetPos, SetPos, EOF, Flush, GetSize, Delete, Rename: what is neither opening nor moving bytes.

use super::FileError;
use super::job::Job;
use super::open::file;
use super::trigger::{Action, Step, file_block, pins};
use takt_abi::{Bool, Cx, Env, Fault, Lword, Request, Str};

/// Runs the job of the instance; `answered` is told the size of the file.
pub(super) fn run(cx: &mut Cx<'_>, request: impl FnOnce() -> Request, answered: impl FnOnce(u64)) -> Result<Step, Fault> {
    let Some(own) = cx.own() else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
    let Env { resources, host, .. } = &mut *cx.env;
    let Some(job) = resources.get::<Job>(own) else { return Err(Fault::Panic) };
    Ok(match job.run(host.as_mut(), request) {
        None => Step::Busy,
        Some(Err(error)) => Step::Over(error.into()),
        Some(Ok(chunk)) => {
            answered(chunk.file_size);
            job.give_back(chunk.data);
            Step::Over(FileError::NO_ERROR)
        }
    })
}

/// The path of an open file.
fn path(cx: &mut Cx<'_>, handle: Lword) -> Option<Str<256>> {
    file(&mut cx.env.resources, handle).map(|f| f.path)
}

/// A name that is not empty.
pub(super) fn named(name: &Str<256>) -> Step {
    if name.bytes().is_empty() { Step::Over(FileError::WRONG_PARAMETER) } else { Step::Busy }
}

file_block! {
    /// `FILE.GetPos` of CODESYS' CAA File: where the next byte is read or written. Done in the call that starts it.
    FILE_GetPos as FileGetPos ["FILE.GetPos"] resource Job;
    input {
        /// The file.
        hFile: Lword
    }
    output {
        /// Bytes before the position.
        udiPos: u32
    }
    state {}
}

impl Action for FileGetPos {
    pins!();
    fn clear(&mut self) {
        self.udiPos = 0;
    }
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let Some(open) = file(&mut cx.env.resources, self.hFile) else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
        self.udiPos = u32::try_from(open.position).unwrap_or(u32::MAX);
        Ok(Step::Over(FileError::NO_ERROR))
    }
    fn step(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Over(FileError::NO_ERROR))
    }
}

file_block! {
    /// `FILE.SetPos` of CODESYS' CAA File: moves the place of the next byte. Done in the call that starts it.
    FILE_SetPos as FileSetPos ["FILE.SetPos"] resource Job;
    input {
        /// The file.
        hFile: Lword,
        /// Bytes before the position.
        udiPos: u32
    }
    output {}
    state {}
}

impl Action for FileSetPos {
    pins!();
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let Some(open) = file(&mut cx.env.resources, self.hFile) else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
        open.position = self.udiPos.into();
        Ok(Step::Over(FileError::NO_ERROR))
    }
    fn step(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Over(FileError::NO_ERROR))
    }
}

file_block! {
    /// `FILE.EOF` of CODESYS' CAA File: whether the position is at the end of the file.
    FILE_EOF as FileEof ["FILE.EOF"] resource Job;
    input {
        /// The file.
        hFile: Lword
    }
    output {
        /// There is nothing more to read.
        xEOF: Bool
    }
    state {}
}

impl Action for FileEof {
    pins!();
    fn clear(&mut self) {
        self.xEOF = Bool::FALSE;
    }
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Busy)
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let Some(open) = file(&mut cx.env.resources, self.hFile).copied() else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
        run(cx, || Request::Size { path: open.path }, |size| self.xEOF = (open.position >= size).into())
    }
}

file_block! {
    /// `FILE.Flush` of CODESYS' CAA File: what was written is on the disk when it is done.
    FILE_Flush as FileFlush ["FILE.Flush"] resource Job;
    input {
        /// The file.
        hFile: Lword
    }
    output {}
    state {}
}

impl Action for FileFlush {
    pins!();
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Busy)
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let Some(path) = path(cx, self.hFile) else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
        run(cx, || Request::Sync { path }, drop)
    }
}

file_block! {
    /// `FILE.GetSize` of CODESYS' CAA File: the size of a file.
    FILE_GetSize as FileGetSize ["FILE.GetSize"] resource Job;
    input {
        /// The file, relative to `data`.
        sFileName: Str<256>
    }
    output {
        /// Bytes.
        szSize: u64
    }
    state {}
}

impl Action for FileGetSize {
    pins!();
    fn clear(&mut self) {
        self.szSize = 0;
    }
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(named(&self.sFileName))
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let path = self.sFileName;
        run(cx, || Request::Size { path }, |size| self.szSize = size)
    }
}

file_block! {
    /// `FILE.Delete` of CODESYS' CAA File: deletes a file.
    FILE_Delete as FileDelete ["FILE.Delete"] resource Job;
    input {
        /// The file, relative to `data`.
        sFileName: Str<256>
    }
    output {}
    state {}
}

impl Action for FileDelete {
    pins!();
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(named(&self.sFileName))
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let path = self.sFileName;
        run(cx, || Request::Delete { path }, drop)
    }
}

file_block! {
    /// `FILE.Rename` of CODESYS' CAA File: gives a file another name that nothing has yet.
    FILE_Rename as FileRename ["FILE.Rename"] resource Job;
    input {
        /// The file, relative to `data`.
        sFileNameOld: Str<256>,
        /// Its new name, relative to `data`.
        sFileNameNew: Str<256>
    }
    output {}
    state {}
}

impl Action for FileRename {
    pins!();
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(match named(&self.sFileNameOld) {
            Step::Busy => named(&self.sFileNameNew),
            over => over,
        })
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let (path, to) = (self.sFileNameOld, self.sFileNameNew);
        if let Some(own) = cx.own()
            && let Some(job) = cx.env.resources.get::<Job>(own)
            && job.is_idle()
        {
            let mut buffer = job.buffer();
            buffer.extend_from_slice(to.bytes());
            job.give_back(buffer);
        }
        run(cx, || Request::Rename { path }, drop)
    }
}
