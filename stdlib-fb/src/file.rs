//! Files in the folder `data` of the project: the blocks of CODESYS' library CAA File.
//!
//! A block asks in one scan and is answered in a later one, so no scan waits for a disk: call it in every scan while `xBusy`. FILE.Open gives a handle to
//! the others; the file itself is opened by the host for each request, so a handle costs nothing and nothing leaks. Paths are relative to `data`; one
//! that leaves it, by name or by link, is refused. Memory is bounded: eight files per FILE.Open, 256 KiB per FILE.Read and FILE.Write.
//!
//! Lacks FILE.Copy, removing and renaming folders, and attributes and times of files.

mod data;
mod folder;
mod job;
mod manage;
mod open;
mod trigger;

pub use data::{FileRead, FileWrite};
pub use folder::{DirEntry, FileDirClose, FileDirCreate, FileDirList, FileDirOpen};
pub use manage::{FileDelete, FileEof, FileFlush, FileGetPos, FileGetSize, FileRename, FileSetPos};
pub use open::{FileClose, FileOpen};

use takt_abi::{BlockDesc, EnumDesc, HostError, StructDesc, st_enum};

st_enum! {
    /// How FILE.Open opens a file.
    pub enum FILE_MODE as FileMode(i16, Int, qualified_only) {
        /// Writes; the file is made, or emptied.
        MWRITE = 0,
        /// Reads; the file must exist.
        MREAD = 1,
        /// Reads and writes; the file is made, or emptied.
        MRDWR = 2,
        /// Writes behind the end; the file is made if need be.
        MAPPD = 3,
        /// Reads and writes; the file must exist.
        MREADPLUS = 4,
        /// Reads and writes; the file is made, or emptied.
        MWRITEPLUS = 5,
        /// Reads, and writes behind the end; the file is made if need be.
        MAPPDPLUS = 6,
    }
}
st_enum! {
    /// What went wrong with a file.
    pub enum FILE_ERROR as FileError(i16, Int, qualified_only) {
        /// Nothing.
        NO_ERROR = 0,
        FIRST_ERROR = 5100,
        /// It took longer than `udiTimeOut`.
        TIME_OUT = 5101,
        /// `xAbort` came.
        ABORT = 5102,
        /// `hFile` is no open file.
        HANDLE_INVALID = 5103,
        /// There is no such file.
        NOT_EXIST = 5104,
        /// There is such a file already.
        EXIST = 5105,
        NO_MORE_ENTRIES = 5106,
        NOT_EMPTY = 5107,
        /// The file may not be written.
        READ_ONLY_CAA = 5108,
        /// An input is wrong: an empty name, a mode that there is not, reading what was opened to be written.
        WRONG_PARAMETER = 5109,
        /// The system refused.
        ERROR_UNKNOWN = 5110,
        WRITE_INCOMPLETE = 5111,
        /// There is no folder `data` here (a test without files).
        FILE_NOT_IMPLEMENTED = 5112,
        /// Too many files are open.
        ASM_CREATEJOB_FAILED = 5113,
        /// The path leaves the folder `data`.
        FILE_OPERATION_DENIED = 5114,
    }
}

impl From<HostError> for FileError {
    fn from(error: HostError) -> Self {
        match error {
            HostError::NotFound => Self::NOT_EXIST,
            HostError::Exists => Self::EXIST,
            HostError::Outside => Self::FILE_OPERATION_DENIED,
            HostError::NotWritable => Self::READ_ONLY_CAA,
            HostError::NotReadable | HostError::Os(_) | HostError::Busy => Self::ERROR_UNKNOWN,
            HostError::Absent => Self::FILE_NOT_IMPLEMENTED,
        }
    }
}

/// The blocks of this topic.
pub const BLOCKS: &[&BlockDesc] = &[
    FileOpen::DESC,
    FileClose::DESC,
    FileRead::DESC,
    FileWrite::DESC,
    FileGetPos::DESC,
    FileSetPos::DESC,
    FileEof::DESC,
    FileFlush::DESC,
    FileGetSize::DESC,
    FileDelete::DESC,
    FileRename::DESC,
    FileDirOpen::DESC,
    FileDirList::DESC,
    FileDirClose::DESC,
    FileDirCreate::DESC,
];
/// The structures of this topic.
pub const STRUCTS: &[&StructDesc] = &[DirEntry::DESC];
/// The enumerations of this topic.
pub const ENUMS: &[&EnumDesc] = &[FileMode::DESC, FileError::DESC];
/// Other names: (alias, canonical).
pub const ALIASES: &[(&str, &str)] = &[
    ("FILE", "Takt"),
    ("CAA", "Takt"),
    ("FILE.MODE", "FILE_MODE"),
    ("FILE.ERROR", "FILE_ERROR"),
    ("FILE.FILE_DIR_ENTRY", "FILE_DIR_ENTRY"),
];
