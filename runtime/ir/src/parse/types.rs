//! Types of the text form, read.

use super::ParseError;
use super::cursor::Cursor;
use crate::print::types::{KINDS, SECTIONS, kind_name, section_name};
use crate::types::{Enumeration, Field, StructKind, Structure, Type, TypeId, elem_name};
use std::sync::Arc;
use takt_abi::Elem;

pub(super) fn parse(cursor: &mut Cursor<'_>) -> Result<Type, ParseError> {
    let word = cursor.word()?;
    if let Some(elem) = elem_of(word) {
        return Ok(Type::Elem(elem));
    }
    if let Some(kind) = KINDS.into_iter().find(|k| kind_name(*k) == word) {
        return structure(cursor, kind).map(|s| Type::Struct(Arc::new(s)));
    }
    Ok(match word {
        "string" => Type::String(cursor.number()?),
        "wstring" => Type::WString(cursor.number()?),
        "array" => {
            let elem = TypeId(cursor.number()?);
            cursor.expect("[")?;
            Type::Array { elem, dims: cursor.list("]", |c| c.range(|t| t.parse().ok()))? }
        }
        "open" => Type::OpenArray { elem: TypeId(cursor.number()?), dims: cursor.number()? },
        "enum" => {
            let (name, base) = (cursor.text()?, elem(cursor)?);
            cursor.expect("{")?;
            Type::Enum(Arc::new(Enumeration { name, base, members: cursor.list("}", member)? }))
        }
        "pointer" => Type::Pointer(TypeId(cursor.number()?)),
        "interface" => Type::Interface(cursor.text()?.into()),
        "reference" => Type::Reference(TypeId(cursor.number()?)),
        "subrange" => {
            let base = elem(cursor)?;
            let (low, high) = cursor.range(|t| t.parse().ok())?;
            Type::Subrange { base, low, high }
        }
        "bit" => Type::Bit(cursor.number()?),
        "error" => Type::Error,
        other => return Err(cursor.wrong_last(&format!("expected a type, found `{other}`"))),
    })
}

fn elem_of(word: &str) -> Option<Elem> {
    use Elem::*;
    let all = [
        Bool, Byte, Word, Dword, Lword, Sint, Int, Dint, Lint, Usint, Uint, Udint, Ulint, Real, Lreal, Time, Ltime, Date, Ldate, Tod, Ltod,
        Dt, Ldt, Char, Wchar,
    ];
    all.into_iter().find(|e| elem_name(*e) == word)
}
fn elem(cursor: &mut Cursor<'_>) -> Result<Elem, ParseError> {
    let word = cursor.word()?;
    elem_of(word).ok_or_else(|| cursor.wrong_last(&format!("expected an elementary type, found `{word}`")))
}

fn structure(cursor: &mut Cursor<'_>, kind: StructKind) -> Result<Structure, ParseError> {
    let name = cursor.text()?;
    cursor.expect("size")?;
    let size = cursor.number()?;
    cursor.expect("align")?;
    let align = cursor.number()?;
    cursor.expect("{")?;
    Ok(Structure { name, kind, fields: cursor.list("}", field)?, size, align })
}
fn field(cursor: &mut Cursor<'_>) -> Result<Field, ParseError> {
    let word = cursor.word()?;
    let section = SECTIONS.into_iter().find(|s| section_name(*s) == word);
    let section = section.ok_or_else(|| cursor.wrong_last(&format!("expected a section, found `{word}`")))?;
    let (name, ty) = (cursor.text()?, TypeId(cursor.number()?));
    cursor.expect("at")?;
    Ok(Field { name, ty, offset: cursor.number()?, section, doc: cursor.doc()? })
}
fn member(cursor: &mut Cursor<'_>) -> Result<(String, i64), ParseError> {
    let name = cursor.text()?;
    cursor.expect("=")?;
    Ok((name, cursor.number()?))
}
