//! Walks a TOML table by hand, so that every mistake is found and has its place.
//!
//! A [`Table`] remembers which keys were asked for; what is left when it is finished is unknown and refused. A value that is wrong is reported and read
//! as if it were not there.

use super::Located;
use super::duration::{DURATION_HELP, parse_duration};
use super::error::Sink;
use super::number;
use crate::spelling::nearest;
use std::ops::{Range, RangeInclusive};
use takt_abi::Time;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A table being read.
pub(super) struct Table<'a, 's> {
    table: &'a DeTable<'a>,
    /// `[axis.Theta1]`; empty at the root.
    heading: String,
    span: Range<usize>,
    asked: Vec<String>,
    sink: &'s mut Sink,
}

impl<'a, 's> Table<'a, 's> {
    /// The whole document.
    pub(super) fn root(table: &'a DeTable<'a>, sink: &'s mut Sink) -> Self {
        Self { table, heading: String::new(), span: 0..0, asked: Vec::new(), sink }
    }
    /// Where the table starts.
    pub(super) fn span(&self) -> Range<usize> {
        self.span.clone()
    }
    /// Reports a mistake.
    pub(super) fn error(&mut self, span: Range<usize>, message: impl Into<String>, help: impl Into<String>) {
        self.sink.push(span, message, help);
    }
    fn value(&mut self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        if !self.asked.iter().any(|asked| asked == key) {
            self.asked.push(key.to_string());
        }
        self.table.get(key)
    }
    fn wrong(&mut self, key: &str, value: &Spanned<DeValue<'_>>, expected: &str, help: &str) {
        let found = describe(value.get_ref());
        self.sink.push(value.span(), format!("`{key}` in {} must be {expected}, found {found}", self.place()), help);
    }
    fn place(&self) -> String {
        if self.heading.is_empty() { "the manifest".into() } else { format!("[{}]", self.heading) }
    }
    fn child<R>(&mut self, key: &str, value: &'a Spanned<DeValue<'a>>, read: impl FnOnce(&mut Table<'a, '_>) -> R) -> Option<R> {
        let DeValue::Table(table) = value.get_ref() else {
            self.wrong(key, value, "a table", "write it as a heading with keys under it, or as { key = value }");
            return None;
        };
        let heading = if self.heading.is_empty() { key.to_string() } else { format!("{}.{key}", self.heading) };
        let mut inner = Table { table, heading, span: value.span(), asked: Vec::new(), sink: self.sink };
        let result = read(&mut inner);
        inner.finish();
        Some(result)
    }
    /// Reads a table, if it is there.
    pub(super) fn section<R>(&mut self, key: &str, read: impl FnOnce(&mut Table<'a, '_>) -> R) -> Option<R> {
        let value = self.value(key)?;
        self.child(key, value, read)
    }
    /// Reads every table under a heading, in the order of the text.
    pub(super) fn named_sections(&mut self, key: &str, mut read: impl FnMut(Located<String>, &mut Table<'a, '_>)) {
        self.section(key, |outer| {
            for name in outer.free_keys() {
                outer.free_section(&name.value.clone(), |inner| read(name, inner));
            }
        });
    }
    /// All keys in the order of the text; they count as known.
    pub(super) fn free_keys(&mut self) -> Vec<Located<String>> {
        let mut keys: Vec<_> = self.table.keys().map(|key| Located { value: key.get_ref().to_string(), span: key.span() }).collect();
        keys.sort_by_key(|key| key.span.start);
        self.asked.extend(keys.iter().map(|key| key.value.clone()));
        keys
    }
    /// Whether a key holds a table.
    pub(super) fn is_table(&self, key: &str) -> bool {
        self.table.get(key).is_some_and(|value| value.get_ref().is_table())
    }
    /// A table under a key from [`Table::free_keys`].
    pub(super) fn free_section(&mut self, key: &str, read: impl FnOnce(&mut Table<'a, '_>)) {
        if let Some(value) = self.table.get(key) {
            self.child(key, value, read);
        }
    }
    /// A text under a key from [`Table::free_keys`].
    pub(super) fn free_string(&mut self, key: &str) -> Option<Located<String>> {
        self.string(key)
    }
    /// A text.
    pub(super) fn string(&mut self, key: &str) -> Option<Located<String>> {
        let value = self.value(key)?;
        match value.get_ref() {
            DeValue::String(text) => Some(Located { value: text.to_string(), span: value.span() }),
            _ => {
                self.wrong(key, value, "a text", "put it in double quotes");
                None
            }
        }
    }
    /// A text that must be there.
    pub(super) fn required_string(&mut self, key: &str) -> Option<Located<String>> {
        self.require(key);
        self.string(key)
    }
    /// Reports a key that is not there.
    pub(super) fn require(&mut self, key: &str) {
        if self.value(key).is_none() {
            let (place, span) = (self.place(), self.span());
            self.error(span, format!("{place} has no `{key}`"), format!("add `{key} = …`; docs/manifest.md shows every key"));
        }
    }
    /// A list of texts.
    pub(super) fn strings(&mut self, key: &str) -> Option<Vec<Located<String>>> {
        let value = self.value(key)?;
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong(key, value, "a list of texts", "write it as [\"…\", \"…\"]");
            return None;
        };
        let mut texts = Vec::new();
        for item in items.iter() {
            match item.get_ref() {
                DeValue::String(text) => texts.push(Located { value: text.to_string(), span: item.span() }),
                _ => self.wrong(key, item, "a list of texts", "put each in double quotes"),
            }
        }
        Some(texts)
    }
    /// A list of tables.
    pub(super) fn tables<R>(&mut self, key: &str, mut read: impl FnMut(&mut Table<'a, '_>) -> Option<R>) -> Vec<R> {
        let Some(value) = self.value(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            let text = format!("write each as [[{}.{key}]], or as a list of {{ key = value }}", self.heading);
            self.wrong(key, value, "a list of tables", &text);
            return Vec::new();
        };
        items.iter().filter_map(|item| self.child(key, item, &mut read).flatten()).collect()
    }
    /// TRUE or FALSE.
    pub(super) fn boolean(&mut self, key: &str) -> Option<bool> {
        let value = self.value(key)?;
        if let DeValue::Boolean(bit) = value.get_ref() {
            return Some(*bit);
        }
        self.wrong(key, value, "true or false", "write it without quotes");
        None
    }
    /// One of a few words.
    pub(super) fn choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Option<T> {
        let text = self.string(key)?;
        if let Some((_, choice)) = choices.iter().find(|(name, _)| *name == text.value) {
            return Some(*choice);
        }
        let names: Vec<_> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let help = nearest(&text.value, choices.iter().map(|(name, _)| *name))
            .map_or_else(String::new, |name| format!("did you mean \"{name}\"?"));
        let message = format!("`{key}` in {} must be {}, found \"{}\"", self.place(), names.join(" or "), text.value);
        self.error(text.span, message, help);
        None
    }
    /// A number in a range.
    pub(super) fn number(&mut self, key: &str, range: RangeInclusive<f64>) -> Option<f64> {
        let value = self.value(key)?;
        let Some(number) = plain_number(value.get_ref()) else {
            self.wrong(key, value, "a number", "write it without quotes and units");
            return None;
        };
        self.in_range(key, value.span(), number, range)
    }
    /// A number that must be there.
    pub(super) fn required_number(&mut self, key: &str, range: RangeInclusive<f64>) -> Option<f64> {
        self.require(key);
        self.number(key, range)
    }
    /// A number or an expression of numbers, in a range.
    pub(super) fn arithmetic(&mut self, key: &str, range: RangeInclusive<f64>) -> Option<f64> {
        let value = self.value(key)?;
        let DeValue::String(text) = value.get_ref() else { return self.number(key, range) };
        match number::evaluate(text) {
            Ok(number) => self.in_range(key, value.span(), number, range),
            Err((at, expected)) => {
                let start = (value.span().start + 1 + at).min(value.span().end);
                self.error(
                    start..value.span().end,
                    format!("`{key}` in {}: expected {expected} here", self.place()),
                    "an expression has numbers and + - * / ( )",
                );
                None
            }
        }
    }
    fn in_range(&mut self, key: &str, span: Range<usize>, number: f64, range: RangeInclusive<f64>) -> Option<f64> {
        if range.contains(&number) {
            return Some(number);
        }
        let (low, high) = (range.start(), range.end());
        self.error(
            span,
            format!("`{key}` in {} must be from {low} to {high}, found {number}", self.place()),
            "see docs/manifest.md for its unit",
        );
        None
    }
    /// `true`, `false` or a number; true is 1.
    pub(super) fn bit_or_number(&mut self, key: &str) -> Option<f64> {
        let value = self.value(key)?;
        let number = match value.get_ref() {
            DeValue::Boolean(bit) => Some(f64::from(u8::from(*bit))),
            other => plain_number(other).filter(|number| number.is_finite()),
        };
        if number.is_none() {
            self.wrong(key, value, "true, false or a number", "write it without quotes");
        }
        number
    }
    /// A value as ST text: `TRUE`, `12.5`, or the text as it stands.
    pub(super) fn literal(&mut self, key: &str) -> Option<Located<String>> {
        let value = self.value(key)?;
        let text = match value.get_ref() {
            DeValue::Boolean(true) => "TRUE".to_string(),
            DeValue::Boolean(false) => "FALSE".to_string(),
            DeValue::String(text) => text.to_string(),
            DeValue::Integer(number) if number.radix() == 10 => number.as_str().to_string(),
            DeValue::Integer(number) => format!("{}#{}", number.radix(), number.as_str()),
            DeValue::Float(number) => number.as_str().to_string(),
            _ => {
                self.wrong(key, value, "true, false, a number or ST text", "put an ST literal in double quotes: \"T#2s\"");
                return None;
            }
        };
        Some(Located { value: text, span: value.span() })
    }
    /// A duration, zero allowed.
    pub(super) fn duration(&mut self, key: &str) -> Option<Time> {
        let value = self.value(key)?;
        let DeValue::String(text) = value.get_ref() else {
            self.wrong(key, value, "a duration", DURATION_HELP);
            return None;
        };
        let duration = parse_duration(text);
        if duration.is_none() {
            self.wrong(key, value, "a duration", DURATION_HELP);
        }
        duration
    }
    /// Refuses the keys nobody asked for.
    pub(super) fn finish(&mut self) {
        let unknown: Vec<_> = self.table.keys().filter(|key| !self.asked.iter().any(|asked| asked == key.get_ref())).collect();
        for key in unknown {
            let name: &str = key.get_ref();
            let help = match nearest(name, self.asked.iter().map(String::as_str)) {
                Some(known) => format!("did you mean `{known}`?"),
                None => format!("known here: {}", self.asked.join(", ")),
            };
            let message = format!("unknown key `{name}` in {}", self.place());
            self.sink.push(key.span(), message, help);
        }
    }
}

fn plain_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|number| number as f64),
        DeValue::Float(number) => number.as_str().parse().ok(),
        _ => None,
    }
}

fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) if text.chars().count() <= 40 => format!("the text \"{text}\""),
        DeValue::String(_) => "a text".into(),
        DeValue::Integer(number) => format!("the number {}", number.as_str()),
        DeValue::Float(number) => format!("the number {}", number.as_str()),
        DeValue::Boolean(bit) => format!("{bit}"),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(_) => "a list".into(),
        DeValue::Table(_) => "a table".into(),
    }
}
