//! TwinCAT's files: `.TcPOU`, `.TcDUT`, `.TcGVL`, `.TcIO`, `.TcTLEO`.
//!
//! Declaration and implementation of a unit are texts of their own in these files and have no END_; members follow behind. What comes out is one unit
//! of ST.

use super::layout::{Writer, cut};
use super::words::words;
use super::xml::{Element, Piece};
use takt_syntax::Code;

/// Writes what a file holds. `stem` is its name without folder and extension.
pub(super) fn write(root: &Element<'_>, stem: &str, writer: &mut Writer) {
    if root.name != "TcPlcObject" {
        let message = format!("expected <TcPlcObject>, found <{}>", root.name);
        return writer.refuse(Code::BadFile, root.open.clone(), message, "export the file again from TwinCAT XAE");
    }
    let mut is_empty = true;
    for object in root.children() {
        is_empty = false;
        let name = object.value("Name").unwrap_or(stem).to_string();
        match object.name {
            "POU" => unit(object, &name, writer),
            "Itf" => interface(object, &name, writer),
            "DUT" | "EnumerationTextList" => whole(object, &name, writer),
            "GVL" | "ParameterList" => globals(object, &name, stem, writer),
            other => {
                let message = format!("<{other}> is no program unit, type, list of variables or interface");
                writer.refuse(Code::BadFile, object.open.clone(), message, "name only files with ST in them");
            }
        }
    }
    if is_empty {
        writer.refuse(Code::BadFile, root.open.clone(), "the file holds no object".into(), "export the file again from TwinCAT XAE");
    }
}

/// The text of a declaration; an empty one if there is none.
fn declaration<'a>(object: &Element<'a>) -> Vec<Piece<'a>> {
    object.child("Declaration").map(Element::pieces).unwrap_or_default()
}

fn joined(pieces: &[Piece<'_>]) -> String {
    pieces.iter().map(|piece| piece.text.as_ref()).collect()
}

/// PROGRAM, FUNCTION_BLOCK or FUNCTION with everything in it.
fn unit(object: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    let pieces = declaration(object);
    let text = joined(&pieces);
    let Some(end) = words(&text).next().and_then(|(_, word)| end_of(word)) else {
        let at = object.child("Declaration").map_or_else(|| object.open.clone(), Element::text_place);
        let message = format!("expected PROGRAM, FUNCTION_BLOCK or FUNCTION at the beginning of the declaration of `{name}`");
        return writer.refuse(Code::BadFile, at, message, "open the unit in TwinCAT XAE and save it again");
    };
    writer.copy_lines(&pieces);
    writer.gap();
    body(object, name, writer);
    members(object, name, writer);
    writer.put_line(end, object.close.clone());
}

fn end_of(word: &str) -> Option<&'static str> {
    let ends = [("PROGRAM", "END_PROGRAM"), ("FUNCTION_BLOCK", "END_FUNCTION_BLOCK"), ("FUNCTION", "END_FUNCTION")];
    ends.iter().find(|(begin, _)| word.eq_ignore_ascii_case(begin)).map(|(_, end)| *end)
}

/// Interfaces have members and no body.
fn interface(object: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    writer.copy_lines(&declaration(object));
    members(object, name, writer);
    writer.put_line("END_INTERFACE", object.close.clone());
}

/// Types stand in their file with their END_.
fn whole(object: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    writer.copy_lines(&declaration(object));
}

/// Statements, or a message where they are in another language.
fn body(object: &Element<'_>, name: &str, writer: &mut Writer) {
    let Some(implementation) = object.child("Implementation") else { return };
    for language in implementation.children() {
        match language.name {
            "ST" => writer.copy_lines(&language.pieces()),
            other => {
                let message = format!("the body of `{name}` is written in {}, not in ST", language_name(other));
                writer.refuse(Code::OtherLanguage, language.open.clone(), message, REWRITE);
            }
        }
    }
}

/// What to do about a body that is drawn.
pub(super) const REWRITE: &str = "write the body in ST; everything else of the file is read";

fn language_name(element: &str) -> &str {
    match element {
        "NWL" => "ladder diagram, function block diagram or instruction list",
        "SFC" => "sequential function chart",
        "CFC" => "continuous function chart",
        other => other,
    }
}

/// Methods, properties and actions, in the order of the file.
fn members(object: &Element<'_>, unit: &str, writer: &mut Writer) {
    for member in object.children() {
        let name = format!("{unit}.{}", member.value("Name").unwrap_or("?"));
        if matches!(member.name, "Method" | "Property" | "Action") {
            writer.gap();
        }
        match member.name {
            "Method" => {
                writer.copy_lines(&declaration(member));
                body(member, &name, writer);
                writer.put_line("END_METHOD", member.close.clone());
            }
            "Property" => property(member, &name, writer),
            "Action" => {
                let attribute = member.attribute("Name");
                let at = attribute.map_or_else(|| member.open.clone(), |name| name.at.clone());
                writer.put_line(&format!("ACTION {}", member.value("Name").unwrap_or_default()), at);
                body(member, &name, writer);
                writer.put_line("END_ACTION", member.close.clone());
            }
            "Transition" => {
                let message = format!("`{name}` is a transition of a sequential function chart");
                writer.refuse(Code::OtherLanguage, member.open.clone(), message, REWRITE);
            }
            _ => {}
        }
    }
}

fn property(property: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.copy_lines(&declaration(property));
    for (element, begin, end) in [("Get", "GET", "END_GET"), ("Set", "SET", "END_SET")] {
        let Some(accessor) = property.child(element) else { continue };
        writer.put_line(begin, accessor.open.clone());
        writer.copy_lines(&declaration(accessor));
        body(accessor, &format!("{name}.{element}"), writer);
        writer.put_line(end, accessor.close.clone());
    }
    writer.put_line("END_PROPERTY", property.close.clone());
}

/// A list of global variables. The compiler calls it as the file is called, or as an attribute says.
fn globals(object: &Element<'_>, name: &str, stem: &str, writer: &mut Writer) {
    writer.unit(name);
    let pieces = declaration(object);
    match writer.needs_name(name, stem) {
        true => named_globals(&pieces, name, writer),
        false => writer.copy_lines(&pieces),
    }
}

/// Copies sections of global variables with the name of their list in front of each.
pub(super) fn named_globals(pieces: &[Piece<'_>], name: &str, writer: &mut Writer) {
    let text = joined(pieces);
    let attribute = format!("{{attribute 'gvl_name' := '{name}'}} ");
    let mut marks = words(&text).filter(|(_, word)| word.eq_ignore_ascii_case("VAR_GLOBAL")).map(|(at, _)| at).peekable();
    let mut is_first = true;
    let mut before = 0;
    for piece in pieces {
        let mut done = 0;
        while let Some(at) = marks.next_if(|at| *at < before + piece.text.len()) {
            let mut part = piece.clone();
            cut(&mut part, done..at - before);
            copy_part(part, &mut is_first, writer);
            let place = piece.at.start + (at - before).min(piece.at.len());
            if is_first {
                writer.line(place);
                is_first = false;
            }
            writer.put(&attribute, place..place + "VAR_GLOBAL".len().min(piece.at.end - place));
            done = at - before;
        }
        let mut part = piece.clone();
        cut(&mut part, done..piece.text.len());
        copy_part(part, &mut is_first, writer);
        before += piece.text.len();
    }
}

fn copy_part(part: Piece<'_>, is_first: &mut bool, writer: &mut Writer) {
    if *is_first && part.text.trim().is_empty() {
        return;
    }
    match std::mem::take(is_first) {
        true => {
            writer.line(part.at.start);
            writer.copy(&[part]);
        }
        false => writer.copy(&[part]),
    }
}
