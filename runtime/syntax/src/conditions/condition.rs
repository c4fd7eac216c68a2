//! The expression behind `{IF`: its grammar and its value.

use super::facts::{View, key};
use crate::lexer::shorten;
use std::collections::HashMap;

/// Deepest nesting of brackets and NOT.
const MAX_DEPTH: u32 = 50;

/// What a condition may ask for besides defines.
const KINDS: &str = "`variable:`, `type:`, `pou:`, `task:` or `resource:`";

/// What is wrong with a condition.
#[derive(Debug)]
pub(super) struct Fault {
    /// Starts lower-case.
    pub message: String,
    /// What to do.
    pub help: Option<&'static str>,
}

fn fault<T>(message: String) -> Result<T, Fault> {
    Err(Fault { message, help: Some("write for example `{IF defined(NAME) AND NOT defined(pou: Other)}`") })
}

/// Whether the condition holds.
pub(super) fn holds(
    text: &str,
    defines: &HashMap<String, String>,
    project: &HashMap<String, String>,
    view: &View<'_>,
) -> Result<bool, Fault> {
    let mut reader = Reader { rest: text, depth: 0, defines, project, view };
    let value = reader.or()?;
    match reader.rest.trim_start() {
        "" => Ok(value),
        rest => fault(format!("expected `AND`, `OR` or `}}`, found `{}`", shorten(rest))),
    }
}

struct Reader<'a> {
    rest: &'a str,
    depth: u32,
    defines: &'a HashMap<String, String>,
    project: &'a HashMap<String, String>,
    view: &'a View<'a>,
}

impl<'a> Reader<'a> {
    /// The word that comes next; empty if it is a sign.
    fn peek_word(&mut self) -> &'a str {
        self.rest = self.rest.trim_start();
        let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest.len());
        &self.rest[..end]
    }

    fn take(&mut self, length: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(length);
        self.rest = rest;
        taken
    }

    fn eat_word(&mut self, word: &str) -> bool {
        let next = self.peek_word();
        let found = next.eq_ignore_ascii_case(word);
        if found {
            self.take(next.len());
        }
        found
    }

    fn eat(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start();
        let found = self.rest.starts_with(sign);
        if found {
            self.take(sign.len_utf8());
        }
        found
    }

    fn expect(&mut self, sign: char) -> Result<(), Fault> {
        if self.eat(sign) { Ok(()) } else { fault(format!("expected `{sign}`, found {}", self.found())) }
    }

    fn found(&mut self) -> String {
        match self.peek_word() {
            "" => self.rest.chars().next().map_or("the end of the pragma".to_owned(), |sign| format!("`{sign}`")),
            word => format!("`{}`", shorten(word)),
        }
    }

    fn or(&mut self) -> Result<bool, Fault> {
        let mut value = self.and()?;
        while self.eat_word("OR") {
            value |= self.and()?;
        }
        Ok(value)
    }

    fn and(&mut self) -> Result<bool, Fault> {
        let mut value = self.operand()?;
        while self.eat_word("AND") {
            value &= self.operand()?;
        }
        Ok(value)
    }

    fn operand(&mut self) -> Result<bool, Fault> {
        let mut is_negated = false;
        while self.eat_word("NOT") {
            is_negated = !is_negated;
        }
        let value = if self.eat('(') {
            self.depth += 1;
            if self.depth > MAX_DEPTH {
                return fault(format!("nested more than {MAX_DEPTH} levels deep"));
            }
            let value = self.or()?;
            self.expect(')')?;
            self.depth -= 1;
            value
        } else {
            self.question()?
        };
        Ok(value != is_negated)
    }

    fn question(&mut self) -> Result<bool, Fault> {
        let word = self.peek_word();
        let name = key(word);
        if !matches!(name.as_str(), "DEFINED" | "PROJECT_DEFINED" | "HASTYPE" | "HASVALUE" | "HASATTRIBUTE" | "HASCONSTANTVALUE") {
            return fault(format!("expected `defined(…)`, `hasvalue(…)`, `hastype(…)` or `hasattribute(…)`, found {}", self.found()));
        }
        self.take(word.len());
        self.expect('(')?;
        let value = match name.as_str() {
            "DEFINED" => self.defined()?,
            "PROJECT_DEFINED" => self.name().map(|name| self.project.contains_key(&name))?,
            "HASVALUE" => self.has_value()?,
            "HASTYPE" => self.has_type()?,
            "HASATTRIBUTE" => self.has_attribute()?,
            _ => self.has_constant_value()?,
        };
        self.expect(')')?;
        Ok(value)
    }

    /// A name, dotted, upper case.
    fn name(&mut self) -> Result<String, Fault> {
        let mut name = String::new();
        loop {
            let word = self.peek_word();
            if word.is_empty() {
                let found = self.found();
                return fault(format!("expected a name, found {found}"));
            }
            name.push_str(&key(word));
            self.take(word.len());
            if !self.eat('.') {
                return Ok(name);
            }
            name.push('.');
        }
    }

    /// `pou: name`: what is asked for (upper case, empty for a define) and its name.
    fn subject(&mut self) -> Result<(String, String), Fault> {
        let name = self.name()?;
        if self.eat(':') {
            return Ok((name, self.name()?));
        }
        Ok((String::new(), name))
    }

    fn defined(&mut self) -> Result<bool, Fault> {
        let (kind, name) = self.subject()?;
        Ok(match kind.as_str() {
            "" => self.defines.contains_key(&name),
            "VARIABLE" => self.view.variable(&name).is_some(),
            "TYPE" => is_elementary(&name) || self.view.ty(&name).is_some(),
            "POU" => self.view.pou(&name).is_some(),
            "TASK" => self.view.own.tasks.contains(&name) || self.view.all.tasks.contains(&name),
            "RESOURCE" => self.view.own.resources.contains(&name) || self.view.all.resources.contains(&name),
            _ => return fault(format!("expected {KINDS}, found `{}:`", shorten(&kind))),
        })
    }

    fn has_value(&mut self) -> Result<bool, Fault> {
        let name = self.name()?;
        self.expect(',')?;
        let value = self.quoted()?;
        Ok(self.defines.get(&name).is_some_and(|known| known == value))
    }

    fn has_type(&mut self) -> Result<bool, Fault> {
        let (kind, name) = self.subject()?;
        if !matches!(kind.as_str(), "" | "VARIABLE") {
            return fault(format!("expected `variable:`, found `{}:`", shorten(&kind)));
        }
        self.expect(',')?;
        let end = closing_bracket(self.rest);
        let wanted = key(self.take(end)).split_whitespace().collect::<String>();
        let Some(variable) = self.view.variable(&name) else { return Ok(false) };
        Ok(variable.ty.split_whitespace().collect::<String>() == wanted)
    }

    fn has_attribute(&mut self) -> Result<bool, Fault> {
        let (kind, name) = self.subject()?;
        let attributes = match kind.as_str() {
            "VARIABLE" => self.view.variable(&name).map(|variable| &variable.attributes),
            "POU" => self.view.pou(&name).map(|scope| &scope.attributes),
            "TYPE" => self.view.ty(&name).map(|scope| &scope.attributes),
            "" => return fault(format!("expected `pou:`, `type:` or `variable:` before `{}`", shorten(&name))),
            _ => return fault(format!("expected `pou:`, `type:` or `variable:`, found `{}:`", shorten(&kind))),
        };
        self.expect(',')?;
        let wanted = self.quoted()?;
        Ok(attributes.is_some_and(|known| known.iter().any(|(name, _)| name.eq_ignore_ascii_case(wanted))))
    }

    /// `hasconstantvalue(variable, 5)`: equality of literals, as far as both are whole numbers or spelled alike.
    fn has_constant_value(&mut self) -> Result<bool, Fault> {
        let (_, name) = self.subject()?;
        self.expect(',')?;
        let end = closing_bracket(self.rest);
        let wanted = self.take(end).trim();
        if wanted.contains(',') {
            return fault("a comparison other than `=` is not supported in `hasconstantvalue`".to_owned());
        }
        let Some(variable) = self.view.variable(&name).filter(|variable| variable.constant) else { return Ok(false) };
        let number = |text: &str| text.parse::<i128>().ok();
        Ok(variable.value.eq_ignore_ascii_case(wanted) || number(&variable.value).is_some_and(|value| number(wanted) == Some(value)))
    }

    fn quoted(&mut self) -> Result<&'a str, Fault> {
        self.rest = self.rest.trim_start();
        let quote = self.rest.chars().next().filter(|quote| matches!(quote, '\'' | '"'));
        let end = quote.and_then(|quote| self.rest[1..].find(quote));
        match end {
            Some(end) => Ok(&self.take(end + 2)[1..end + 1]),
            None => {
                let found = self.found();
                fault(format!("expected a text in `'`, found {found}"))
            }
        }
    }
}

/// Length up to the bracket that closes the present one.
fn closing_bracket(text: &str) -> usize {
    let mut depth = 0_usize;
    for (at, sign) in text.char_indices() {
        match sign {
            '(' => depth += 1,
            ')' if depth == 0 => return at,
            ')' => depth -= 1,
            _ => {}
        }
    }
    text.len()
}

fn is_elementary(name: &str) -> bool {
    const NAMES: &[&str] = &[
        "BOOL",
        "BIT",
        "BYTE",
        "WORD",
        "DWORD",
        "LWORD",
        "SINT",
        "INT",
        "DINT",
        "LINT",
        "USINT",
        "UINT",
        "UDINT",
        "ULINT",
        "REAL",
        "LREAL",
        "TIME",
        "LTIME",
        "DATE",
        "LDATE",
        "TOD",
        "LTOD",
        "TIME_OF_DAY",
        "DT",
        "LDT",
        "DATE_AND_TIME",
        "STRING",
        "WSTRING",
        "CHAR",
        "WCHAR",
    ];
    NAMES.contains(&name)
}
