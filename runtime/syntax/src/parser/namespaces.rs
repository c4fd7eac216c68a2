//! NAMESPACE and USING: where the units of a file stand.
//!
//! The tree stays a flat list; each unit carries its [`Home`](crate::tree::Home).

use super::Parser;
use crate::lexer::Kind;
use crate::tree::Name;
use crate::{Code, Diagnostic};

/// Deepest nesting of namespaces; each unit carries the names of those around it.
const MAX_NAMESPACES: usize = 30;
/// Most namespaces that are used in one place, for the same reason.
const MAX_USING: usize = 100;

impl Parser<'_> {
    /// `NAMESPACE INTERNAL a.b`: what follows, up to END_NAMESPACE, stands in it.
    pub(super) fn enter_namespace(&mut self) {
        let start = self.bump();
        self.outer_homes.push(self.home.clone());
        self.open_block(start, Kind::EndNamespace);
        while matches!(self.kind(), Kind::Internal | Kind::Public) && self.peek(1).kind.is_name() {
            self.home.is_internal |= self.bump().kind == Kind::Internal;
        }
        loop {
            let name = self.name("the name of the namespace");
            if self.home.namespace.len() >= MAX_NAMESPACES {
                let message = format!("namespaces are nested more than {MAX_NAMESPACES} levels deep");
                self.tell(Diagnostic::new(Code::TooDeep, name.span, message));
                // What is in it belongs nowhere, and its END_ is no second mistake.
                self.lexed.truncated = true;
                self.at = self.lexed.tokens.len() - 1;
                return;
            }
            self.home.namespace.push(name);
            if !self.eat(Kind::Dot) {
                break;
            }
        }
        self.eat(Kind::Semi);
    }

    /// END_NAMESPACE.
    pub(super) fn leave_namespace(&mut self) {
        let Some(home) = self.outer_homes.pop() else {
            let span = self.span_of(self.token());
            self.tell(Diagnostic::new(Code::UnexpectedToken, span, "`END_NAMESPACE` belongs to no open NAMESPACE"));
            self.bump();
            return;
        };
        self.home = home;
        self.close_block();
        self.eat(Kind::Semi);
    }

    /// Namespaces that are open at the end of the file.
    pub(super) fn end_namespaces(&mut self) {
        while let Some(home) = self.outer_homes.pop() {
            self.home = home;
            self.close_block();
        }
    }

    /// `USING a;` outside of a unit.
    pub(super) fn use_for_all(&mut self) {
        let place = self.span_of(self.token());
        let mut names = self.using();
        let room = MAX_USING.saturating_sub(self.home.using.len());
        if names.len() > room {
            let message = format!("more than {MAX_USING} namespaces are used in one place");
            self.tell(Diagnostic::new(Code::TooDeep, place, message).help("write the names with their namespace: `a.b.f()`"));
            names.truncate(room);
        }
        self.home.using.extend(names);
    }

    /// `USING a.b, c;` as often as it stands here.
    pub(super) fn using(&mut self) -> Vec<Name> {
        let mut names = Vec::new();
        while self.kind() == Kind::Using && self.peek(1).kind.is_name() && !self.failed {
            self.bump();
            names.extend(self.name_list());
            self.eat(Kind::Semi);
        }
        names
    }
}
