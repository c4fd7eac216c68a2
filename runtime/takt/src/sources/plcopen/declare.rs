//! Variables, as elements give them.

use super::super::layout::{Writer, comment};
use super::super::xml::Element;
use super::{data, initial, types};

/// Kinds of sections by their elements.
const SECTIONS: &[(&str, &str)] = &[
    ("inputVars", "VAR_INPUT"),
    ("outputVars", "VAR_OUTPUT"),
    ("inOutVars", "VAR_IN_OUT"),
    ("localVars", "VAR"),
    ("tempVars", "VAR_TEMP"),
    ("externalVars", "VAR_EXTERNAL"),
    ("globalVars", "VAR_GLOBAL"),
];

/// All sections of an interface, in the order of the file.
pub(super) fn sections(interface: &Element<'_>, writer: &mut Writer) {
    for list in interface.children() {
        if let Some((_, keyword)) = SECTIONS.iter().find(|(element, _)| *element == list.name) {
            section(keyword, list, writer);
        } else if list.name == "accessVars" {
            writer.left(&list.open, "access variables", "VAR_ACCESS is not part of this version");
        }
    }
}

/// A section and its variables; nothing for an empty one.
pub(super) fn section(keyword: &str, list: &Element<'_>, writer: &mut Writer) {
    if !list.children().any(|child| child.name == "variable") {
        return;
    }
    let mut line = keyword.to_string();
    for qualifier in ["constant", "retain", "persistent"] {
        if list.value(qualifier).is_some_and(is_true) {
            line.push(' ');
            line.push_str(&qualifier.to_uppercase());
        }
    }
    writer.put_line(&line, list.open.clone());
    variables(list, writer);
    writer.put_line("END_VAR", list.close.clone());
}

fn is_true(value: &str) -> bool {
    matches!(value, "true" | "1")
}

/// Declarations of variables or fields.
pub(super) fn variables(list: &Element<'_>, writer: &mut Writer) {
    for variable in list.children().filter(|child| child.name == "variable") {
        documentation(variable, writer);
        attributes(variable, writer);
        declaration(variable, writer);
    }
}

/// `{attribute 'name' := 'value'}` for the attributes of CODESYS.
pub(super) fn attributes(element: &Element<'_>, writer: &mut Writer) {
    let holders = [Some(element), element.child("interface")];
    let lists = holders.into_iter().flatten().filter_map(|holder| data(holder, "attributes")?.child("Attributes"));
    for attribute in lists.flat_map(Element::children) {
        let Some(name) = attribute.value("Name") else { continue };
        let text = match attribute.value("Value").filter(|value| !value.is_empty()) {
            Some(value) => format!("{{attribute '{name}' := '{value}'}}"),
            None => format!("{{attribute '{name}'}}"),
        };
        writer.put_line(&text, attribute.open.clone());
    }
}

/// What people wrote about something, as a comment.
pub(super) fn documentation(element: &Element<'_>, writer: &mut Writer) {
    let Some(documentation) = element.child("documentation") else { return };
    let text = comment(&documentation.text());
    if !text.is_empty() {
        writer.put_indented(&format!("(* {text} *)"), documentation.text_place());
    }
}

fn declaration(variable: &Element<'_>, writer: &mut Writer) {
    let Some(name) = variable.attribute("name") else { return };
    writer.put_indented(&name.value, name.at.clone());
    if let Some(address) = variable.attribute("address").filter(|address| !address.value.is_empty()) {
        writer.put(" AT ", address.at.clone());
        writer.put(&address.value, address.at.clone());
    }
    let (text, at) = types::of(variable.child("type").unwrap_or(variable));
    let initial = variable.child("initialValue").and_then(initial::of);
    writer.put(" : ", name.at.clone());
    writer.finish_declaration(&text, at, initial);
}
