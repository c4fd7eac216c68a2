//! `[live]`, `[report]` and `[plot]`: what people are shown of a run.

use super::Located;
use super::reader::Table;

/// A value with its label.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// For people; may be empty.
    pub label: String,
    /// Path of the variable.
    pub value: Located<String>,
    /// Unit; may be empty.
    pub unit: String,
    /// Places after the point of a REAL, if given.
    pub digits: Option<usize>,
    /// Multiplies a number.
    pub scale: f64,
}

/// What a plot draws.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plot {
    /// X, Y, Z of the tool centre point, mm.
    pub tcp: Option<[Located<String>; 3]>,
    /// Its speed, mm/s.
    pub speed: Option<Located<String>>,
    /// Table angles theta1, theta2, degrees.
    pub tool: Option<[Located<String>; 2]>,
    /// Counts up with each dot.
    pub dots: Option<Located<String>>,
    /// The valve's command.
    pub valve: Option<Located<String>>,
    /// Condition: this scan belongs to the plot.
    pub only: Option<Located<String>>,
    /// Highest frequency of the valve, Hz.
    pub frequency_limit: Option<f64>,
}

pub(super) fn read_items(table: &mut Table<'_, '_>, key: &str) -> Vec<Item> {
    table.tables(key, |inner| {
        let label = inner.string("label").map_or_else(String::new, |label| label.value);
        let value = inner.required_string("value");
        let unit = inner.string("unit").map_or_else(String::new, |unit| unit.value);
        let digits = inner.number("digits", 0.0..=9.0).map(|digits| digits as usize);
        let scale = inner.number("scale", -1e12..=1e12).unwrap_or(1.0);
        Some(Item { label, value: value?, unit, digits, scale })
    })
}

pub(super) fn read_plot(table: &mut Table<'_, '_>) -> Plot {
    Plot {
        tcp: fixed(table, "tcp"),
        speed: table.string("speed"),
        tool: fixed(table, "tool"),
        dots: table.string("dots"),
        valve: table.string("valve"),
        only: table.string("while"),
        frequency_limit: table.number("frequency-limit", 1e-3..=1e6),
    }
}

fn fixed<const N: usize>(table: &mut Table<'_, '_>, key: &str) -> Option<[Located<String>; N]> {
    let names = table.strings(key)?;
    let found = names.len();
    let names: Result<[Located<String>; N], _> = names.try_into();
    if names.is_err() {
        let span = table.span();
        table.error(span, format!("`{key}` in [plot] must have {N} variables, found {found}"), "docs/manifest.md says which");
    }
    names.ok()
}
