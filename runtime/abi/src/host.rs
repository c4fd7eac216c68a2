//! The world outside a scan: files, read and written in chunks by a service that `takt` implements. Requests are served in the order they were made.
//!
//! A request leaves in one scan; its completion is latched at the start of a later scan (in simulation: the next). No scan waits for a disk.

use std::any::Any;

/// Bytes that one request reads at the most.
pub const CHUNK: usize = 256 * 1024;

/// The folder of the project that a path is relative to. A path that leaves it, by name or by link, is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Folder {
    /// `nc/`: G-code.
    Nc,
    /// `data/`: what programs read and write.
    Data,
}

/// What a block asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Reads up to [`CHUNK`] bytes of a file from `offset`.
    Read {
        /// Where the path starts.
        folder: Folder,
        /// Relative path, UTF-8.
        path: crate::Str<256>,
        /// First byte.
        offset: u64,
    },
    /// Writes the bytes of the buffer to a file in `data/` that exists.
    Write {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
        /// Where the first byte goes; `None`: behind the last.
        offset: Option<u64>,
    },
    /// Makes an empty file in `data/`.
    Create {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
        /// Whether a file that exists keeps its content.
        keep: bool,
    },
    /// Makes a folder in `data/`.
    CreateFolder {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
        /// Whether the folders it lies in are made too.
        parents: bool,
    },
    /// Asks for the name, in the order of bytes, that follows the one in the buffer in a folder of `data/`; it comes back in the buffer, a folder's with a `/`
    /// behind it, nothing if there is none. Names that are not UTF-8 or longer than 255 bytes are passed over.
    Next {
        /// Relative path, UTF-8; `.` is `data` itself.
        path: crate::Str<256>,
    },
    /// Asks for the size of a file in `data/`.
    Size {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
    },
    /// Puts what was written to a file in `data/` on the disk.
    Sync {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
    },
    /// Deletes a file in `data/`.
    Delete {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
    },
    /// Gives a file in `data/` the path in the buffer, which nothing there has yet.
    Rename {
        /// Relative path, UTF-8.
        path: crate::Str<256>,
    },
}

/// Names a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ticket(pub u64);

/// Why a request failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostError {
    /// No such file.
    NotFound,
    /// The path leaves its folder, or is not a plain relative path.
    Outside,
    /// A folder, device or unreadable file.
    NotReadable,
    /// A file that may not be written.
    NotWritable,
    /// There is a file of that name already.
    Exists,
    /// The operating system reported this error number.
    Os(i32),
    /// Too many requests under way; ask again in the next scan.
    Busy,
    /// There is no host (a test without files).
    Absent,
}

/// What a request brought.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Chunk {
    /// The bytes that were read; fewer than [`CHUNK`] only at the end of the file. For other requests the buffer that was given.
    pub data: Vec<u8>,
    /// Size of the file in bytes afterwards.
    pub file_size: u64,
}

/// Implemented by `takt`; also by tests.
pub trait Host {
    /// Queues a request; never blocks. The host takes `buffer` (and leaves an empty one) only with a request that it accepts; it comes back as
    /// [`Chunk::data`], so that nothing is allocated in a scan.
    fn submit(&mut self, request: Request, buffer: &mut Vec<u8>) -> Result<Ticket, HostError>;
    /// At the start of a scan: makes finished requests visible to [`Host::take`]. With `wait`, waits for all of them (virtual time).
    fn latch(&mut self, wait: bool);
    /// The completion of a request, once, if it has been latched. On an error the buffer is lost.
    fn take(&mut self, ticket: Ticket) -> Option<Result<Chunk, HostError>>;
    /// Requests under way and completions, for a checkpoint in the same process; waits for the former. `None`: it cannot.
    fn save(&mut self) -> Option<Box<dyn Any + Send>> {
        None
    }
    /// Puts back what [`Host::save`] gave; false, and unchanged, when it is not that. Files stay as they are.
    fn restore(&mut self, _: &dyn Any) -> bool {
        false
    }
}

/// A host without files.
#[derive(Debug, Default)]
pub struct NoHost;

impl Host for NoHost {
    fn submit(&mut self, _: Request, _: &mut Vec<u8>) -> Result<Ticket, HostError> {
        Err(HostError::Absent)
    }
    fn latch(&mut self, _: bool) {}
    fn take(&mut self, _: Ticket) -> Option<Result<Chunk, HostError>> {
        None
    }
}
