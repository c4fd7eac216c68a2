//! G-code: from a file to a queue of path elements.

use takt_abi::{BlockDesc, Bool, EnumDesc, FnDesc, SmcError, StructDesc, function_block, native_fn};

/// The blocks of this topic.
pub const BLOCKS: &[&BlockDesc] = &[ReadNcFile::DESC];
/// The functions of this topic.
pub const FUNCTIONS: &[&FnDesc] = &[IsError::DESC];
/// The structures of this topic.
pub const STRUCTS: &[&StructDesc] = &[];
/// The enumerations of this topic.
pub const ENUMS: &[&EnumDesc] = &[];
/// Other names of types: (alias, canonical).
pub const ALIASES: &[(&str, &str)] = &[];

function_block! {
    /// Reads a G-code file.
    pub block ReadNCFile as ReadNcFile aliases ["SMC_ReadNCFile2"] {
        input { bExecute: Bool }
        output { bError: Bool }
        state {}
    }
    fn cycle(fb, _cx) {
        fb.bError = fb.bExecute;
        Ok(())
    }
}

native_fn! {
    /// Whether `ErrorID` is an error.
    pub fn SMC_IsError as IsError(_cx, ErrorID: SmcError) -> Bool { Ok((ErrorID.0 != 0).into()) }
}
