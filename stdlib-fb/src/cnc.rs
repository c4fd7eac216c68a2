//! G-code: from a file to a queue of path elements.
//!
//! The chain is ReadNCFile → `sentences` → NCInterpreter → SMC_OUTQUEUE of SMC_GEOINFO in a buffer of the ST program. Every stage streams, so a file of
//! any size needs the same memory and the first element is there after a few scans. Both blocks belong in the same slow task.
//!
//! The dialect is the CODESYS one: G0-G4, G17-G19, G53-G56, G90-G92, G98, G99, F, FF, E, EF, M. Every other word is refused with file, line and column.
//! It deliberately lacks expressions, subprograms, splines and tool corrections, and any other dialect: these are tables and stages to come.

pub mod arc;
pub mod decode;
mod errors;
pub mod frame;
mod interpreter;
pub mod number;
mod queue;
mod reader;
pub mod source;
pub mod trouble;
pub mod types;
pub mod words;

pub use errors::ErrorString;
pub use interpreter::NcInterpreter;
pub use queue::{AppendObj, DeleteObj, GetCount, GetLastObj, GetObj, GetObjFromEnd, IsFull, OutQueueInit, SetObj, SetQueueCapacity};
pub use reader::ReadNcFile;

use takt_abi::{BlockDesc, EnumDesc, FnDesc, StructDesc};

/// The blocks of this topic.
pub const BLOCKS: &[&BlockDesc] = &[ReadNcFile::DESC, NcInterpreter::DESC];
/// The functions of this topic.
pub const FUNCTIONS: &[&FnDesc] = &[
    AppendObj::DESC,
    DeleteObj::DESC,
    ErrorString::DESC,
    GetCount::DESC,
    GetLastObj::DESC,
    GetObj::DESC,
    GetObjFromEnd::DESC,
    IsFull::DESC,
    OutQueueInit::DESC,
    SetObj::DESC,
    SetQueueCapacity::DESC,
];
/// The structures of this topic.
pub const STRUCTS: &[&StructDesc] = &[
    types::Vector3::DESC,
    types::PosInfo::DESC,
    types::GeoInfo::DESC,
    types::OutQueue::DESC,
    types::SentenceQueue::DESC,
    types::VarList::DESC,
    frame::Frame::DESC,
    decode::Modal::DESC,
];
/// The enumerations of this topic.
pub const ENUMS: &[&EnumDesc] = &[types::MoveType::DESC, types::OriConvention::DESC, types::DecoderStatus::DESC, types::Language::DESC];
/// Other names of types: (alias, canonical).
pub const ALIASES: &[(&str, &str)] = &[];
