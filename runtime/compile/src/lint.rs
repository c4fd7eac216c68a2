//! Warnings that find mistakes in programs that are otherwise right.
//!
//! Three sources, each the cheapest for what it finds: the tree ([`uses`], [`flow`]), the types while bodies are lowered ([`typed`]), and the IR where
//! tasks meet ([`tasks`]). The tree's walk knows names, not scopes; where it cannot decide it is silent, so that a warning is worth reading. Nothing is
//! said of libraries, nor of a program with errors.

mod flow;
mod names;
mod tasks;
mod typed;
mod uses;

use crate::scope::{Member, Owner};
use crate::unit::Compiler;
use rustc_hash::{FxHashMap as HashMap, FxHashSet as HashSet};
use takt_syntax::{Code, Diagnostic, Severity, Span};

/// What all units say of names, by key.
struct Known {
    /// Per unit how it uses the names that stand in it.
    uses: Vec<HashMap<String, u8>>,
    /// Names that stand behind a dot anywhere: members seen from outside.
    members: HashSet<String>,
    /// Names of properties: reading and writing one runs code.
    properties: HashSet<String>,
    /// Per block the units that see its variables: its own, and those of what extends it.
    seen_by: HashMap<usize, Vec<usize>>,
}

impl<'a> Compiler<'a> {
    /// Whether warnings about this place are wanted.
    pub(crate) fn linted(&self, span: Span) -> bool {
        self.options.lint && (span.file.0 as usize) < self.user_files
    }

    /// Looks for likely mistakes in a program without errors.
    pub(crate) fn lint(&mut self) {
        if !self.options.lint || self.diagnostics.iter().any(spoils) {
            return;
        }
        let known = self.known_names();
        for pou in 0..self.pous.len() {
            let interface = matches!(self.pous[pou].owner, Some(Owner::Interface(_)));
            if !self.pous[pou].library && !interface {
                self.lint_variables(pou, &known);
                self.lint_result(pou, &known);
                self.lint_statements(pou, &known);
            }
        }
        self.lint_tasks();
    }

    fn known_names(&self) -> Known {
        let mut members = HashSet::default();
        let mut seen_by: HashMap<usize, Vec<usize>> = HashMap::default();
        let mut uses = Vec::with_capacity(self.pous.len());
        for (unit, pou) in self.pous.iter().enumerate() {
            if pou.library {
                uses.push(HashMap::default());
                continue;
            }
            let mut found = names::Names::default();
            found.unit(&pou.tree);
            let found = names::folded(found.names);
            members.extend(found.iter().filter(|(_, how)| *how & names::MEMBER != 0).map(|(name, _)| name.clone()));
            uses.push(found);
            let own = if let Some(Owner::Pou(owner)) = pou.owner { owner } else { unit };
            self.bases(own).for_each(|base| seen_by.entry(base).or_default().push(unit));
            if own != unit {
                seen_by.entry(unit).or_default().push(unit);
            }
        }
        Known { uses, members, properties: self.property_names(), seen_by }
    }

    fn property_names(&self) -> HashSet<String> {
        let blocks = self.pous.iter().flat_map(|pou| &pou.members);
        let all = blocks.chain(self.interfaces.iter().flat_map(|interface| &interface.members));
        all.filter(|(_, member)| matches!(member, Member::Property { .. })).map(|(name, _)| name.clone()).collect()
    }
}

/// Whether a message says that the program may not be what was meant. Functions without a program to run are complete.
fn spoils(diagnostic: &Diagnostic) -> bool {
    diagnostic.severity() == Severity::Error && diagnostic.code != Code::NoProgram
}
