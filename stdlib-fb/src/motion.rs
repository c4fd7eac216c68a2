//! Motion: kinematics, splines, time laws and the blocks on axes.
//!
//! The types of `takt-abi` (AXIS_REF_SM3 and its enumerations) are listed in `lib.rs`, not here.

use takt_abi::{BlockDesc, EnumDesc, FnDesc, StructDesc};

/// The blocks of this topic.
pub const BLOCKS: &[&BlockDesc] = &[];
/// The functions of this topic.
pub const FUNCTIONS: &[&FnDesc] = &[];
/// The structures of this topic.
pub const STRUCTS: &[&StructDesc] = &[];
/// The enumerations of this topic.
pub const ENUMS: &[&EnumDesc] = &[];
/// Other names of types: (alias, canonical).
pub const ALIASES: &[(&str, &str)] = &[];
