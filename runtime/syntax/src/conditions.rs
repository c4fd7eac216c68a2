//! Conditional compilation: `{IF defined(x)} … {ELSE} … {END_IF}` and the other pragmas that act before anything is parsed.
//!
//! The seam is the list of tokens: what an `{IF}` excludes is taken out of it before the parser sees it, with its comments, its pragmas and whatever the
//! lexer had to say of it. So an excluded part may hold anything that has balanced comments, and the tree needs no notion of conditions. What a condition
//! may ask for besides the defines (`defined(pou: X)`, `hastype(variable: x, INT)`) is collected from tokens too, of this file up to the place and, by
//! [`Conditions::scan`], of all files of a project.
//!
//! A `{define}` holds to the end of its program unit, or outside of units to the end of the file. Lacks: conditions do not see through an `{IF}` of
//! another file that itself asks for names, other than for defines.

mod apply;
mod condition;
mod facts;

pub(crate) use apply::apply;

use crate::lexer::{self, Lexed};
use crate::parser::MAX_TEXT;
use crate::tree::Suppressed;
use crate::{FileId, Source};
use facts::{Facts, key};
use std::collections::HashMap;

/// What is defined by the machine that programs are compiled for.
const TARGET: &[(&str, &str)] = &[("IsLittleEndian", ""), ("IsFPUSupported", ""), ("RegisterSize", "64"), ("PackMode", "8")];

/// What conditional pragmas may ask for: the defines of a project and the names that its files declare.
#[derive(Debug, Clone)]
pub struct Conditions {
    defines: HashMap<String, String>,
    facts: Facts,
}

impl Default for Conditions {
    fn default() -> Self {
        let defines = TARGET.iter().map(|(name, value)| (key(name), (*value).to_owned())).collect();
        Self { defines, facts: Facts::default() }
    }
}

impl Conditions {
    /// Of the files of a project, and of `defines` with their values, which may be empty.
    ///
    /// The names that files declare are collected only if a file asks for any.
    pub fn of<'a>(sources: impl Iterator<Item = &'a Source> + Clone, defines: &[(String, String)]) -> Self {
        let mut conditions = Self::default();
        for (name, value) in defines {
            conditions.define(name, value);
        }
        if sources.clone().any(|source| asks(&source.text)) {
            sources.for_each(|source| conditions.scan(source));
        }
        conditions
    }

    /// Defines a name for all files.
    pub fn define(&mut self, name: &str, value: &str) {
        self.defines.insert(key(name), value.to_owned());
    }

    /// Declares a program unit that no scanned file holds: one of a library.
    pub fn add_pou(&mut self, name: &str) {
        self.facts.pous.entry(key(name)).or_default();
    }

    /// Declares a type that no scanned file holds: one of a library.
    pub fn add_type(&mut self, name: &str) {
        self.facts.types.entry(key(name)).or_default();
    }

    /// Collects the names that a file declares. Its name gives the name of its global list.
    pub fn scan(&mut self, source: &Source) {
        let stem = source.name.rsplit(['/', '\\']).next().unwrap_or("");
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        if source.text.len() > MAX_TEXT {
            return;
        }
        let mut lexed = lexer::lex(FileId(0), &source.text);
        let facts = apply::scan(&mut lexed, &source.text, stem, self);
        self.facts.join(facts);
    }

    pub(crate) fn apply(&self, lexed: &mut Lexed, file: FileId, text: &str) -> Vec<Suppressed> {
        if lexed.has_directives { apply(lexed, file, text, self) } else { Vec::new() }
    }
}

/// Whether a text may hold a conditional pragma.
pub(crate) fn asks(text: &str) -> bool {
    text.match_indices('{').any(|(at, _)| {
        let word = text[at + 1..].trim_start();
        word.get(..2).is_some_and(|word| word.eq_ignore_ascii_case("if"))
    })
}
