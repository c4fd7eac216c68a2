//! Types in the text form: one line each, numbered from 0; parts are named by number.
//!
//! ```text
//! type INT
//! type string 80
//! type array 0 [0..9, 1..2]
//! type struct "Point" size 16 align 8 { state "x" 0 at 0, state "y" 0 at 8 doc "mm" }
//! type enum "WAY" INT { "forth" = 1, "back" = 2 }
//! type pointer 0
//! type subrange INT -5..5
//! type bit 3
//! ```

use super::{Doc, Quoted};
use crate::types::{StructKind, Structure, Type, Types, elem_name};
use std::fmt::{self, Write};
use takt_abi::Section;

pub(super) fn print(types: &Types, out: &mut String) -> fmt::Result {
    for ty in types.all() {
        write!(out, "type ")?;
        match ty {
            Type::Elem(elem) => write!(out, "{}", elem_name(*elem))?,
            Type::String(n) => write!(out, "string {n}")?,
            Type::WString(n) => write!(out, "wstring {n}")?,
            Type::Array { elem, dims } => {
                let dims: Vec<String> = dims.iter().map(|(low, high)| format!("{low}..{high}")).collect();
                write!(out, "array {} [{}]", elem.0, dims.join(", "))?;
            }
            Type::OpenArray { elem, dims } => write!(out, "open {} {dims}", elem.0)?,
            Type::Struct(s) => structure(s, out)?,
            Type::Enum(e) => {
                let members: Vec<String> = e.members.iter().map(|(name, value)| format!("{} = {value}", Quoted(name))).collect();
                write!(out, "enum {} {} {{ {} }}", Quoted(&e.name), elem_name(e.base), members.join(", "))?;
            }
            Type::Pointer(target) => write!(out, "pointer {}", target.0)?,
            Type::Reference(target) => write!(out, "reference {}", target.0)?,
            Type::Interface(name) => write!(out, "interface {}", Quoted(name))?,
            Type::Subrange { base, low, high } => write!(out, "subrange {} {low}..{high}", elem_name(*base))?,
            Type::Bit(n) => write!(out, "bit {n}")?,
            Type::Error => write!(out, "error")?,
        }
        out.push('\n');
    }
    Ok(())
}

fn structure(s: &Structure, out: &mut String) -> fmt::Result {
    write!(out, "{} {} size {} align {} {{", kind_name(s.kind), Quoted(&s.name), s.size, s.align)?;
    for (i, field) in s.fields.iter().enumerate() {
        let comma = if i > 0 { "," } else { "" };
        let (section, name) = (section_name(field.section), Quoted(&field.name));
        write!(out, "{comma} {section} {name} {} at {}{}", field.ty.0, field.offset, Doc(&field.doc))?;
    }
    write!(out, " }}")
}

/// All kinds of structured types.
pub(crate) const KINDS: [StructKind; 4] = [StructKind::Struct, StructKind::Union, StructKind::Block, StructKind::Program];

pub(crate) fn kind_name(kind: StructKind) -> &'static str {
    match kind {
        StructKind::Struct => "struct",
        StructKind::Union => "union",
        StructKind::Block => "block",
        StructKind::Program => "program",
    }
}

/// All sections.
pub(crate) const SECTIONS: [Section; 4] = [Section::Input, Section::Output, Section::InOut, Section::State];

pub(crate) fn section_name(section: Section) -> &'static str {
    match section {
        Section::Input => "input",
        Section::Output => "output",
        Section::InOut => "inout",
        Section::State => "state",
    }
}
