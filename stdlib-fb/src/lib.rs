//! The standard function blocks: timers, counters and edges in ST, G-code, kinematics and motion in Rust.
//!
//! [`LIBRARY`] is all that the compiler is handed. A block that can be written in ST stands in `st/` and is compiled with every program that uses
//! it; a block in Rust is one declaration that holds its fields, its documentation and its body. No block knows the compiler, the engine or a bus.

pub mod cnc;
pub mod file;
pub mod motion;
pub mod standard;

use takt_abi::{
    AppInfo, AxisRef, AxisState, BlockDesc, BufferMode, ControllerMode, Direction, EnumDesc, FnDesc, Library, SmcError, StructDesc,
    TaskInfo,
};

/// Everything that a program may use without declaring it.
pub static LIBRARY: Library = Library {
    name: "Takt",
    blocks: &BLOCKS,
    functions: &FUNCTIONS,
    structs: &STRUCTS,
    enums: &ENUMS,
    aliases: &ALIASES,
    sources: &[
        ("counters.st", include_str!("../st/counters.st")),
        ("dates.st", include_str!("../st/dates.st")),
        ("edges.st", include_str!("../st/edges.st")),
        ("latches.st", include_str!("../st/latches.st")),
        ("system.st", include_str!("../st/system.st")),
        ("tc2_files.st", include_str!("../st/tc2_files.st")),
        ("tc2_format.st", include_str!("../st/tc2_format.st")),
        ("tc2_ring.st", include_str!("../st/tc2_ring.st")),
        ("tc2_strings.st", include_str!("../st/tc2_strings.st")),
        ("tc2_system.st", include_str!("../st/tc2_system.st")),
        ("timers.st", include_str!("../st/timers.st")),
        ("types.st", include_str!("../st/types.st")),
        ("util_bits.st", include_str!("../st/util_bits.st")),
        ("util_codes.st", include_str!("../st/util_codes.st")),
        ("util_controllers.st", include_str!("../st/util_controllers.st")),
        ("util_functions.st", include_str!("../st/util_functions.st")),
        ("util_math.st", include_str!("../st/util_math.st")),
        ("util_signals.st", include_str!("../st/util_signals.st")),
    ],
};

/// The types that `takt-abi` itself declares, because the engine reads them too.
const SHARED_STRUCTS: &[&StructDesc] = &[AppInfo::DESC, AxisRef::DESC, TaskInfo::DESC];
const SHARED_ENUMS: &[&EnumDesc] = &[AxisState::DESC, Direction::DESC, BufferMode::DESC, ControllerMode::DESC, SmcError::DESC];
const SHARED_ALIASES: &[(&str, &str)] = &[
    ("AXIS_REF", "AXIS_REF_SM3"),
    ("SMC_VIRTUAL_AXIS", "AXIS_REF_SM3"),
    // The CODESYS libraries whose names programs write before a block's.
    ("Standard", "Takt"),
    ("Standard64", "Takt"),
    ("Util", "Takt"),
    ("Tc2_Standard", "Takt"),
    ("Tc2_System", "Takt"),
    ("Tc2_Utilities", "Takt"),
    ("Tc2_Math", "Takt"),
    ("Tc2_EtherCAT", "Takt"),
    ("IBaseLibrary", "Takt"),
    ("SM3_Basic", "Takt"),
    ("SM3_CNC", "Takt"),
    ("__SYSTEM", "Takt"),
];

const BLOCK_TABLES: &[&[&BlockDesc]] = &[cnc::BLOCKS, file::BLOCKS, motion::BLOCKS, standard::counters::BLOCKS];
const FUNCTION_TABLES: &[&[&FnDesc]] = &[
    cnc::FUNCTIONS,
    motion::FUNCTIONS,
    standard::arguments::FUNCTIONS,
    standard::clock::FUNCTIONS,
    standard::date::FUNCTIONS,
    standard::decimal::FUNCTIONS,
    standard::format::FUNCTIONS,
    standard::memory::FUNCTIONS,
    standard::number::FUNCTIONS,
    standard::parse::FUNCTIONS,
    standard::report::FUNCTIONS,
    standard::text::FUNCTIONS,
];
const ALIAS_TABLES: &[&[(&str, &str)]] = &[SHARED_ALIASES, cnc::ALIASES, file::ALIASES, motion::ALIASES, standard::memory::ALIASES];

static BLOCKS: [&BlockDesc; total(BLOCK_TABLES)] = join(BLOCK_TABLES);
static FUNCTIONS: [&FnDesc; total(FUNCTION_TABLES)] = join(FUNCTION_TABLES);
const STRUCT_TABLES: &[&[&StructDesc]] = &[SHARED_STRUCTS, cnc::STRUCTS, file::STRUCTS, motion::STRUCTS];
static STRUCTS: [&StructDesc; total(STRUCT_TABLES)] = join(STRUCT_TABLES);
const ENUM_TABLES: &[&[&EnumDesc]] = &[SHARED_ENUMS, cnc::ENUMS, file::ENUMS, motion::ENUMS];
static ENUMS: [&EnumDesc; total(ENUM_TABLES)] = join(ENUM_TABLES);
static ALIASES: [(&str, &str); total(ALIAS_TABLES)] = join(ALIAS_TABLES);

/// How many entries the tables have together.
const fn total<T>(parts: &[&[T]]) -> usize {
    let (mut sum, mut part) = (0, 0);
    while part < parts.len() {
        sum += parts[part].len();
        part += 1;
    }
    sum
}

/// The tables of the topics, one after the other. `N` is the sum of their lengths.
const fn join<T: Copy, const N: usize>(parts: &[&[T]]) -> [T; N] {
    let mut first = 0;
    while parts[first].is_empty() {
        first += 1;
    }
    let mut all = [parts[first][0]; N];
    let (mut part, mut at) = (0, 0);
    while part < parts.len() {
        let mut i = 0;
        while i < parts[part].len() {
            all[at] = parts[part][i];
            at += 1;
            i += 1;
        }
        part += 1;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::LIBRARY;
    use std::collections::BTreeSet;

    #[test]
    fn every_name_is_declared_once_and_every_alias_leads_somewhere() {
        let mut names = BTreeSet::new();
        let blocks = LIBRARY.blocks.iter().flat_map(|b| std::iter::once(b.name).chain(b.aliases.iter().copied()));
        let types = LIBRARY.structs.iter().map(|s| s.name).chain(LIBRARY.enums.iter().map(|e| e.name));
        for name in blocks.chain(types).chain(LIBRARY.functions.iter().map(|f| f.name)) {
            assert!(names.insert(name.to_ascii_uppercase()), "{name} is declared twice");
        }
        names.insert(LIBRARY.name.to_ascii_uppercase());
        for (alias, target) in LIBRARY.aliases {
            assert!(names.contains(&target.to_ascii_uppercase()), "{alias} stands for {target}, which nobody declares");
            assert!(names.insert(alias.to_ascii_uppercase()), "{alias} is declared twice");
        }
    }

    #[test]
    fn every_block_type_and_function_is_documented() {
        for block in LIBRARY.blocks {
            assert!(!block.doc.trim().is_empty(), "{} has no documentation", block.name);
        }
        for function in LIBRARY.functions {
            assert!(!function.doc.trim().is_empty(), "{} has no documentation", function.name);
        }
    }
}
