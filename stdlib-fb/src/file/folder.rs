//! FILE.DirOpen, DirList, DirClose, DirCreate: folders.

use super::FileError;
use super::job::Job;
use super::manage::{named, run};
use super::open::{FOLDER, Opener, answered, close, file};
use super::trigger::{Action, Step, file_block, pins};
use takt_abi::{Bool, Cx, Env, Fault, Lword, Request, StDateTime, Str, st_struct};

st_struct! {
    /// An entry of a folder.
    pub struct FILE_DIR_ENTRY as DirEntry {
        /// Bytes of a file.
        szSize: u64,
        /// Its name.
        sEntry: Str<256>,
        /// It is a folder.
        xDirectory: Bool,
        /// Not used, as in CODESYS.
        xExclusive: Bool,
        /// Not known here: DT#1970-01-01-00:00:00.
        dtLastModification: StDateTime,
    }
}

file_block! {
    /// `FILE.DirOpen` of CODESYS' CAA File: gives a handle to FILE.DirList; `./` is `data` itself.
    FILE_DirOpen as FileDirOpen ["FILE.DirOpen"] resource Opener;
    input {
        /// The folder, relative to `data`.
        sDirName: Str<256>
    }
    output {
        /// For FILE.DirList and FILE.DirClose; 0 is none.
        hDir: Lword
    }
    state {}
}

impl Action for FileDirOpen {
    pins!();
    fn clear(&mut self) {
        self.hDir = Lword(0);
    }
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(named(&self.sDirName))
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let path = self.sDirName;
        answered(cx, path, FOLDER, || Request::Next { path }, &mut self.hDir)
    }
}

file_block! {
    /// `FILE.DirList` of CODESYS' CAA File: the next entry of a folder, in the order of names; after the last one `NO_MORE_ENTRIES`.
    FILE_DirList as FileDirList ["FILE.DirList"] resource Job;
    input {
        /// The folder.
        hDir: Lword
    }
    output {
        /// The entry.
        deDirEntry: DirEntry
    }
    state { of: Lword, name: Str<256> }
}

impl Action for FileDirList {
    pins!();
    fn clear(&mut self) {
        self.deDirEntry = DirEntry::default();
    }
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        if self.of != self.hDir {
            (self.of, self.name) = (self.hDir, Str::EMPTY);
        }
        Ok(Step::Busy)
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let folder = file(&mut cx.env.resources, self.hDir).copied().filter(|f| f.mode == FOLDER);
        let (Some(folder), Some(own)) = (folder, cx.own()) else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
        let Env { resources, host, .. } = &mut *cx.env;
        let Some(job) = resources.get::<Job>(own) else { return Err(Fault::Panic) };
        if job.is_idle() {
            let mut buffer = job.buffer();
            buffer.extend_from_slice(self.name.bytes());
            job.give_back(buffer);
        }
        let chunk = match job.run(host.as_mut(), || Request::Next { path: folder.path }) {
            None => return Ok(Step::Busy),
            Some(Err(error)) => return Ok(Step::Over(error.into())),
            Some(Ok(chunk)) => chunk,
        };
        let name = String::from_utf8_lossy(&chunk.data);
        self.name = Str::new(&name);
        self.deDirEntry = DirEntry {
            szSize: chunk.file_size,
            sEntry: Str::new(name.trim_end_matches('/')),
            xDirectory: name.ends_with('/').into(),
            ..DirEntry::default()
        };
        let code = if chunk.data.is_empty() { FileError::NO_MORE_ENTRIES } else { FileError::NO_ERROR };
        job.give_back(chunk.data);
        Ok(Step::Over(code))
    }
}

file_block! {
    /// `FILE.DirClose` of CODESYS' CAA File: gives a handle back.
    FILE_DirClose as FileDirClose ["FILE.DirClose"] resource Job;
    input {
        /// The folder.
        hDir: Lword
    }
    output {}
    state {}
}

impl Action for FileDirClose {
    pins!();
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Over(close(cx, self.hDir)))
    }
    fn step(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Over(FileError::NO_ERROR))
    }
}

file_block! {
    /// `FILE.DirCreate` of CODESYS' CAA File: makes a folder.
    FILE_DirCreate as FileDirCreate ["FILE.DirCreate"] resource Job;
    input {
        /// The folder, relative to `data`.
        sDirName: Str<256>,
        /// The folders it lies in are made too.
        xParent: Bool
    }
    output {}
    state {}
}

impl Action for FileDirCreate {
    pins!();
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(named(&self.sDirName))
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let (path, parents) = (self.sDirName, self.xParent.get());
        run(cx, || Request::CreateFolder { path, parents }, drop)
    }
}
