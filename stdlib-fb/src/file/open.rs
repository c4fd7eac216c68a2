//! FILE.Open and FILE.Close: the table of open files.

use super::job::Job;
use super::trigger::{Action, Step, file_block, pins};
use super::{FileError, FileMode};
use takt_abi::{Bool, Cx, Env, Fault, Handle, Lword, Plain, Request, Resource, Resources, Str};

/// The mode of an open folder.
pub(super) const FOLDER: FileMode = FileMode(-1);

/// Files that one FILE.Open holds open at the most.
const FILES: usize = 8;

/// An open file. The host opens it anew for each request, so this is all there is.
#[derive(Debug, Clone, Copy)]
pub(super) struct OpenFile {
    pub(super) path: Str<256>,
    pub(super) mode: FileMode,
    /// Where the next byte is read or written.
    pub(super) position: u64,
    /// The last byte of its handle.
    id: u8,
}

impl OpenFile {
    pub(super) fn reads(&self) -> bool {
        !matches!(self.mode, FileMode::MWRITE | FileMode::MAPPD)
    }
    pub(super) fn writes(&self) -> bool {
        self.mode != FileMode::MREAD
    }
    pub(super) fn appends(&self) -> bool {
        matches!(self.mode, FileMode::MAPPD | FileMode::MAPPDPLUS)
    }
}

/// The files of a FILE.Open.
#[derive(Debug, Default)]
pub struct Opener {
    job: Job,
    files: [Option<OpenFile>; FILES],
    last_id: u8,
}

impl Opener {
    /// Puts a file in; its id, or `None` if there is no place.
    fn add(&mut self, path: Str<256>, mode: FileMode, position: u64) -> Option<u8> {
        let free = self.files.iter().position(Option::is_none)?;
        let used = |id: u8| self.files.iter().flatten().any(|f| f.id == id);
        let id = (1..=u8::MAX).map(|n| self.last_id.wrapping_add(n)).find(|id| *id != 0 && !used(*id))?;
        self.last_id = id;
        self.files[free] = Some(OpenFile { path, mode, position, id });
        Some(id)
    }
    fn place(&mut self, id: u8) -> Option<&mut Option<OpenFile>> {
        self.files.iter_mut().find(|f| f.is_some_and(|f| f.id == id))
    }
}

impl Resource for Opener {
    fn save(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.save_into(&mut bytes);
        bytes
    }
    fn save_into(&self, out: &mut Vec<u8>) {
        out.push(self.last_id);
        for file in &self.files {
            out.push(file.map_or(0, |f| f.id));
            if let Some(file) = file {
                out.extend_from_slice(&file.mode.0.to_le_bytes());
                out.extend_from_slice(&file.position.to_le_bytes());
                out.extend_from_slice(&file.path.0);
            }
        }
        self.job.save_into(out);
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        *self = Self::default();
        let Some(restored) = restored(bytes) else { return false };
        *self = restored;
        true
    }
    fn as_any(&mut self) -> &mut dyn std::any::Any {
        self
    }
}

fn restored(bytes: &[u8]) -> Option<Opener> {
    let (last_id, mut rest) = bytes.split_first()?;
    let mut opener = Opener { last_id: *last_id, ..Opener::default() };
    for place in &mut opener.files {
        let (id, tail) = rest.split_first()?;
        rest = tail;
        if *id != 0 {
            let (file, tail) = rest.split_at_checked(2 + 8 + 256)?;
            let (mode, position, path) = (FileMode(i16::load(file)), u64::load(&file[2..]), Str::load(&file[10..]));
            *place = Some(OpenFile { path, mode, position, id: *id });
            rest = tail;
        }
    }
    opener.job.restore(rest).then_some(opener)
}

/// `hFile`: the resource's handle with the file's id in the highest byte.
fn join(handle: Handle, id: u8) -> Lword {
    Lword(handle.0 | u64::from(id) << 56)
}

fn split(file: Lword) -> (Handle, u8) {
    (Handle(file.0 & (u64::MAX >> 8)), (file.0 >> 56) as u8)
}

/// The open file that `hFile` names.
pub(super) fn file(resources: &mut Resources, file: Lword) -> Option<&mut OpenFile> {
    let (handle, id) = split(file);
    resources.get::<Opener>(handle)?.place(id)?.as_mut()
}

file_block! {
    /// `FILE.Open` of CODESYS' CAA File: opens a file in the folder `data`, or makes it, and gives a handle to the other blocks.
    FILE_Open as FileOpen ["FILE.Open"] resource Opener;
    input {
        /// The file, relative to `data`.
        sFileName: Str<256>,
        /// How it is opened.
        eFileMode: FileMode,
        /// Not used, as in CODESYS.
        xExclusive: Bool
    }
    output {
        /// For the other blocks; 0 is none.
        hFile: Lword
    }
    state {}
}

impl Action for FileOpen {
    pins!();
    fn clear(&mut self) {
        self.hFile = Lword(0);
    }
    fn begin(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        let known = (FileMode::MWRITE.0..=FileMode::MAPPDPLUS.0).contains(&self.eFileMode.0);
        Ok(if known && !self.sFileName.bytes().is_empty() { Step::Busy } else { Step::Over(FileError::WRONG_PARAMETER) })
    }
    fn step(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        let (path, mode) = (self.sFileName, self.eFileMode);
        let request = || match mode {
            FileMode::MREAD | FileMode::MREADPLUS => Request::Size { path },
            FileMode::MAPPD | FileMode::MAPPDPLUS => Request::Create { path, keep: true },
            _ => Request::Create { path, keep: false },
        };
        answered(cx, path, mode, request, &mut self.hFile)
    }
}

/// Puts a file or folder into the table of the instance when the host has answered well.
pub(super) fn answered(
    cx: &mut Cx<'_>,
    path: Str<256>,
    mode: FileMode,
    request: impl FnOnce() -> Request,
    handle: &mut Lword,
) -> Result<Step, Fault> {
    let Some(own) = cx.own() else { return Ok(Step::Over(FileError::HANDLE_INVALID)) };
    let Env { resources, host, .. } = &mut *cx.env;
    let Some(opener) = resources.get::<Opener>(own) else { return Err(Fault::Panic) };
    let chunk = match opener.job.run(host.as_mut(), request) {
        None => return Ok(Step::Busy),
        Some(Err(error)) => return Ok(Step::Over(error.into())),
        Some(Ok(chunk)) => chunk,
    };
    let mut buffer = chunk.data;
    buffer.clear();
    opener.job.give_back(buffer);
    let appends = matches!(mode, FileMode::MAPPD | FileMode::MAPPDPLUS);
    let Some(id) = opener.add(path, mode, if appends { chunk.file_size } else { 0 }) else {
        return Ok(Step::Over(FileError::ASM_CREATEJOB_FAILED));
    };
    *handle = join(own, id);
    Ok(Step::Over(FileError::NO_ERROR))
}

/// Takes what `handle` names out of its table.
pub(super) fn close(cx: &mut Cx<'_>, handle: Lword) -> FileError {
    let (handle, id) = split(handle);
    match cx.env.resources.get::<Opener>(handle).and_then(|opener| opener.place(id)) {
        Some(place) => {
            *place = None;
            FileError::NO_ERROR
        }
        None => FileError::HANDLE_INVALID,
    }
}

file_block! {
    /// `FILE.Close` of CODESYS' CAA File: gives a handle back.
    FILE_Close as FileClose ["FILE.Close"] resource Job;
    input {
        /// The file.
        hFile: Lword
    }
    output {}
    state {}
}

impl Action for FileClose {
    pins!();
    fn begin(&mut self, cx: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Over(close(cx, self.hFile)))
    }
    fn step(&mut self, _: &mut Cx<'_>) -> Result<Step, Fault> {
        Ok(Step::Busy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_files_is_full_at_eight_and_ids_are_not_reused_at_once() {
        let mut opener = Opener::default();
        let ids: Vec<_> = (0..9).map(|_| opener.add(Str::new("a"), FileMode::MREAD, 0)).collect();
        assert_eq!(ids, [1, 2, 3, 4, 5, 6, 7, 8].map(Some).into_iter().chain([None]).collect::<Vec<_>>());
        *opener.place(3).expect("open") = None;
        assert_eq!(opener.add(Str::new("b"), FileMode::MREAD, 7), Some(9));
        assert!(opener.place(3).is_none());
    }

    #[test]
    fn a_saved_table_comes_back() {
        let mut opener = Opener::default();
        opener.add(Str::new("log.txt"), FileMode::MAPPD, 42);
        let saved = opener.save();
        let mut other = Opener::default();
        assert!(other.restore(&saved));
        assert_eq!(other.save(), saved);
        assert!(!other.restore(&saved[..saved.len() - 1]) && other.place(1).is_none());
    }
}
