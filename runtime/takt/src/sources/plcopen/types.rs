//! Types, as elements give them.

use super::super::layout::Writer;
use super::super::xml::Element;
use super::{data, declare, initial};
use std::ops::Range;

/// The type inside of `<type>` or `<baseType>`, in ST, and where it stands. What is not known is named, so that the compiler can say so.
pub(super) fn of(holder: &Element<'_>) -> (String, Range<usize>) {
    let known = |child: &&Element<'_>| !matches!(child.name, "addData" | "documentation" | "initialValue");
    let Some(ty) = holder.children().find(known) else { return ("ANY".into(), holder.open.clone()) };
    let base = || ty.child("baseType").map_or_else(|| "ANY".to_string(), |base| of(base).0);
    let text = match ty.name {
        "derived" => {
            return ty.attribute("name").map_or_else(|| ("ANY".into(), ty.open.clone()), |name| (name.value.to_string(), name.at.clone()));
        }
        "string" | "wstring" => match ty.value("length").filter(|length| !length.is_empty()) {
            Some(length) => format!("{}({length})", ty.name.to_uppercase()),
            None => ty.name.to_uppercase(),
        },
        "array" => format!("ARRAY[{}] OF {}", dimensions(ty), base()),
        "pointer" => format!("POINTER TO {}", base()),
        "reference" => format!("REFERENCE TO {}", base()),
        "subrangeSigned" | "subrangeUnsigned" => {
            let range = ty.child("range").map(bounds).unwrap_or_default();
            format!("{}({range})", base())
        }
        "enum" => enumeration(ty),
        other => other.to_uppercase(),
    };
    (text, ty.open.clone())
}

fn dimensions(array: &Element<'_>) -> String {
    array.children().filter(|child| child.name == "dimension").map(bounds).collect::<Vec<_>>().join(", ")
}

fn bounds(range: &Element<'_>) -> String {
    match (range.value("lower").unwrap_or_default(), range.value("upper").unwrap_or_default()) {
        ("*", _) | ("", "") => "*".into(),
        (lower, upper) => format!("{lower}..{upper}"),
    }
}

/// `(red := 1, green)`, and the type behind it where one is given.
fn enumeration(ty: &Element<'_>) -> String {
    let values = ty.child("values").map(enumerators).unwrap_or_default();
    match ty.child("baseType") {
        Some(base) => format!("({values}) {}", of(base).0),
        None => format!("({values})"),
    }
}

fn enumerators(values: &Element<'_>) -> String {
    let one = |value: &Element<'_>| {
        let name = value.value("name")?;
        Some(match value.value("value").filter(|number| !number.is_empty()) {
            Some(number) => format!("{name} := {number}"),
            None => name.to_string(),
        })
    };
    values.children().filter_map(one).collect::<Vec<_>>().join(", ")
}

/// A type of the project.
pub(super) fn data_type(element: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    if let Some(text) = data(element, "interfaceasplaintext") {
        return writer.copy_lines(&text.pieces());
    }
    declare::documentation(element, writer);
    declare::attributes(element, writer);
    let Some(base) = element.child("baseType") else { return };
    let at = element.attribute("name").map_or_else(|| element.open.clone(), |name| name.at.clone());
    match base.child("struct") {
        Some(fields) => {
            let extends = data(element, "datatypeinheritance").and_then(|data| data.descend(&["Inheritance", "Extends"]));
            let extends = extends.map(|base| format!(" EXTENDS {}", base.text())).unwrap_or_default();
            writer.put_line(&format!("TYPE {name}{extends} :"), at);
            fields_of("STRUCT", "END_STRUCT", fields, writer);
        }
        None => {
            let (text, place) = of(base);
            writer.line(at.start);
            writer.put(&format!("TYPE {name} : "), at);
            writer.finish_declaration(&text, place, element.child("initialValue").and_then(initial::of));
        }
    }
    writer.put_line("END_TYPE", element.close.clone());
}

/// A union, which PLCopen XML itself does not have.
pub(super) fn union(element: &Element<'_>, name: &str, writer: &mut Writer) {
    writer.unit(name);
    declare::attributes(element, writer);
    let at = element.attribute("name").map_or_else(|| element.open.clone(), |name| name.at.clone());
    writer.put_line(&format!("TYPE {name} :"), at);
    fields_of("UNION", "END_UNION", element, writer);
    writer.put_line("END_TYPE", element.close.clone());
}

fn fields_of(begin: &str, end: &str, fields: &Element<'_>, writer: &mut Writer) {
    writer.put_line(begin, fields.open.clone());
    declare::variables(fields, writer);
    writer.put_line(end, fields.close.clone());
}
