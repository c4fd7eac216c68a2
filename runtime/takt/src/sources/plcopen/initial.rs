//! Initial values, as elements give them.

use super::super::xml::Element;
use std::ops::Range;

/// An initial value in ST and where it stands; `None` for an empty element.
pub(super) fn of(holder: &Element<'_>) -> Option<(String, Range<usize>)> {
    let value = holder.children().find(|child| matches!(child.name, "simpleValue" | "arrayValue" | "structValue"))?;
    match value.name {
        "simpleValue" => {
            let attribute = value.attribute("value")?;
            Some((attribute.value.trim().to_string(), attribute.at.clone())).filter(|(text, _)| !text.is_empty())
        }
        "arrayValue" => Some((format!("[{}]", list(value, repeated)), value.open.clone())),
        _ => Some((format!("({})", list(value, member)), value.open.clone())),
    }
}

fn list(value: &Element<'_>, one: fn(&Element<'_>) -> Option<String>) -> String {
    value.children().filter(|child| child.name == "value").filter_map(one).collect::<Vec<_>>().join(", ")
}

/// `3(0)`, or the value alone.
fn repeated(value: &Element<'_>) -> Option<String> {
    let (text, _) = of(value)?;
    match value.value("repetitionValue").filter(|times| !times.is_empty() && *times != "1") {
        Some(times) => Some(format!("{times}({text})")),
        None => Some(text),
    }
}

fn member(value: &Element<'_>) -> Option<String> {
    let (text, _) = of(value)?;
    Some(format!("{} := {text}", value.value("member")?))
}
