//! Program units, interfaces and their members.

use super::super::layout::Writer;
use super::super::twincat::REWRITE;
use super::super::words::words;
use super::super::xml::Element;
use super::{all_data, data, declare, types};
use takt_syntax::Code;

/// A kind of unit: its `pouType`, and the words around it.
const KINDS: &[(&str, &str, &str)] = &[
    ("program", "PROGRAM", "END_PROGRAM"),
    ("functionBlock", "FUNCTION_BLOCK", "END_FUNCTION_BLOCK"),
    ("function", "FUNCTION", "END_FUNCTION"),
];

/// PROGRAM, FUNCTION_BLOCK or FUNCTION.
pub(super) fn unit(pou: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    let kind = pou.value("pouType").unwrap_or_default();
    let Some((_, begin, end)) = KINDS.iter().find(|(known, ..)| *known == kind) else {
        let message = format!("expected pouType program, functionBlock or function, found `{kind}`");
        return writer.refuse(Code::BadFile, pou.open.clone(), message, "export the project again");
    };
    let end = match declared(pou, writer) {
        Some(word) => KINDS.iter().find(|(_, begin, _)| word.eq_ignore_ascii_case(begin)).map_or(*end, |(.., end)| end),
        None => {
            header(begin, pou, name, writer);
            end
        }
    };
    members(pou, name, writer);
    writer.put_line(end, pou.close.clone());
}

/// Copies the declaration that CODESYS gives as plain text, if there is one, and returns its first word.
fn declared(element: &Element<'_>, writer: &mut Writer) -> Option<String> {
    let inner = || element.child("interface").and_then(|interface| data(interface, "interfaceasplaintext"));
    // TwinCAT leaves the wrapping out in members.
    let bare = || element.child("InterfaceAsPlainText");
    let pieces = data(element, "interfaceasplaintext").or_else(inner).or_else(bare)?.pieces();
    let text: String = pieces.iter().map(|piece| piece.text.as_ref()).collect();
    let word = words(&text).next()?.1.to_string();
    writer.copy_lines(&pieces);
    Some(word)
}

/// `FUNCTION name : INT` and the variables.
fn header(begin: &str, element: &Element<'_>, name: &str, writer: &mut Writer) {
    declare::documentation(element, writer);
    let interface = element.child("interface");
    if let Some(interface) = interface {
        declare::documentation(interface, writer);
    }
    declare::attributes(element, writer);
    let at = element.attribute("name").map_or_else(|| element.open.clone(), |name| name.at.clone());
    let heritage = heritage(element);
    let access = access(element);
    writer.line(at.start);
    writer.put(&format!("{begin} {access}{name}{heritage}"), at.clone());
    if let Some(result) = interface.and_then(|interface| interface.child("returnType")) {
        let (text, place) = types::of(result);
        writer.put(" : ", at);
        writer.put(&text, place);
    }
    writer.end_line();
    if let Some(interface) = interface {
        declare::sections(interface, writer);
    }
}

/// ` EXTENDS a IMPLEMENTS b, c`.
fn heritage(element: &Element<'_>) -> String {
    let holders = [Some(element), element.child("interface")];
    let Some(list) = holders.into_iter().flatten().find_map(|holder| data(holder, "pouinheritance")?.child("Inheritance")) else {
        return String::new();
    };
    let named = |name: &str| list.children().filter(|child| child.name == name).map(Element::text).collect::<Vec<_>>().join(", ");
    let clause = |word: &str, names: String| if names.is_empty() { names } else { format!(" {word} {names}") };
    clause("EXTENDS", named("Extends")) + &clause("IMPLEMENTS", named("Implements"))
}

/// `PRIVATE `, `ABSTRACT `, …
fn access(element: &Element<'_>) -> String {
    let holders = [Some(element), element.child("interface")];
    let Some(list) = holders.into_iter().flatten().find_map(|holder| data(holder, "accessmodifiers")?.child("AccessModifiers")) else {
        return String::new();
    };
    let words = ["Public", "Private", "Protected", "Internal", "Abstract", "Final"];
    let given = words.iter().filter(|word| list.value(word).is_some_and(|value| value.eq_ignore_ascii_case("true")));
    given.map(|word| format!("{} ", word.to_uppercase())).collect()
}

/// Actions, bodies, methods and properties, in the order of the file.
fn members(element: &Element<'_>, name: &str, writer: &mut Writer) {
    for child in element.children() {
        match child.name {
            "actions" => child.children().for_each(|action| member(action, name, writer)),
            "transitions" => {
                let message = format!("`{name}` has transitions of a sequential function chart");
                writer.refuse(Code::OtherLanguage, child.open.clone(), message, REWRITE);
            }
            "body" => {
                writer.gap();
                body(child, name, writer);
            }
            _ => {}
        }
    }
    for (kind, data) in all_data(element) {
        if matches!(kind, "method" | "property" | "action") {
            data.children().for_each(|member| self::member(member, name, writer));
        }
    }
}

fn member(element: &Element<'_>, unit: &str, writer: &mut Writer) {
    let Some(name) = element.value("name") else { return };
    let full = format!("{unit}.{name}");
    writer.gap();
    match element.name {
        "Method" | "method" => {
            if declared(element, writer).is_none() {
                header("METHOD", element, name, writer);
            }
            members(element, &full, writer);
            writer.put_line("END_METHOD", element.close.clone());
        }
        "Property" | "property" => property(element, name, &full, writer),
        "Action" | "action" => action(element, unit, writer),
        _ => {}
    }
}

fn action(element: &Element<'_>, unit: &str, writer: &mut Writer) {
    let Some(name) = element.attribute("name") else { return };
    writer.put_line(&format!("ACTION {}", name.value), name.at.clone());
    members(element, &format!("{unit}.{}", name.value), writer);
    writer.put_line("END_ACTION", element.close.clone());
}

fn property(element: &Element<'_>, name: &str, full: &str, writer: &mut Writer) {
    if declared(element, writer).is_none() {
        header("PROPERTY", element, name, writer);
    }
    for (accessor, begin, end) in [("GetAccessor", "GET", "END_GET"), ("SetAccessor", "SET", "END_SET")] {
        let Some(accessor) = element.child(accessor) else { continue };
        writer.put_line(begin, accessor.open.clone());
        if declared(accessor, writer).is_none()
            && let Some(interface) = accessor.child("interface")
        {
            declare::sections(interface, writer);
        }
        members(accessor, full, writer);
        writer.put_line(end, accessor.close.clone());
    }
    writer.put_line("END_PROPERTY", element.close.clone());
}

/// An interface: signatures wherever its data stand, no bodies.
pub(super) fn interface(element: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    if declared(element, writer).is_none() {
        let at = element.attribute("name").map_or_else(|| element.open.clone(), |name| name.at.clone());
        let bases: Vec<String> = element.children().filter(|child| child.name == "Extends").map(Element::text).collect();
        let extends = if bases.is_empty() { heritage(element) } else { format!(" EXTENDS {}", bases.join(", ")) };
        writer.put_line(&format!("INTERFACE {name}{extends}"), at);
    }
    for group in element.children().filter(|child| matches!(child.name, "Methods" | "Properties")) {
        group.children().for_each(|one| member(one, name, writer));
    }
    members(element, name, writer);
    writer.put_line("END_INTERFACE", element.close.clone());
}

/// Statements, or a message where they are in another language.
fn body(body: &Element<'_>, name: &str, writer: &mut Writer) {
    for language in body.children() {
        let found = match language.name {
            "ST" => {
                writer.copy_lines(&language.pieces());
                continue;
            }
            "documentation" => continue,
            "addData" => match all_data(body).find(|(kind, _)| matches!(*kind, "cfc" | "st" | "ucfb" | "executecode")) {
                Some((kind, _)) => kind.to_uppercase(),
                None => continue,
            },
            other => other.to_string(),
        };
        let message = format!("the body of `{name}` is written in {}, not in ST", long_name(&found));
        writer.refuse(Code::OtherLanguage, language.open.clone(), message, REWRITE);
    }
}

fn long_name(language: &str) -> &str {
    match language {
        "LD" => "ladder diagram (LD)",
        "FBD" => "function block diagram (FBD)",
        "SFC" => "sequential function chart (SFC)",
        "IL" => "instruction list (IL)",
        "CFC" => "continuous function chart (CFC)",
        other => other,
    }
}
