//! Messages about declarations that clash: names declared twice, types and constants that need themselves.

use crate::scope::{Member, key};
use crate::unit::Compiler;
use takt_ir::{Type, TypeId};
use takt_syntax::tree::{Name, VarDecl};
use takt_syntax::{Code, Note, Span};

impl<'a> Compiler<'a> {
    /// The second declaration of a name; the first one counts.
    pub(crate) fn declared_twice(&mut self, name: &Name, within: Option<&str>, first: Option<Span>) {
        let place = within.map_or_else(String::new, |within| format!(" in `{within}`"));
        let diagnostic = self.report(Code::DuplicateName, name.span, format!("`{}` is declared twice{place}", name.text));
        diagnostic.notes.extend(first.map(|span| Note { span, message: "first declared here".into() }));
    }

    /// Where a member of a block or interface is declared.
    pub(crate) fn declared_member_at(&self, member: Member) -> Option<Span> {
        let unit = match member {
            Member::Method(unit) | Member::Action(unit) => Some(unit),
            Member::Property { get, set } => get.or(set),
        };
        unit.map(|unit| self.pous[unit].tree.name.span)
    }

    /// What is being resolved from a name on, with the places where each names the next; `at` is where the last names the first.
    fn cycle(&self, name: &Name, at: Span) -> (String, Vec<Span>) {
        let start = self.inside.iter().rposition(|(open, _)| open.span == name.span).unwrap_or(self.inside.len());
        let chain = self.inside.get(start..).unwrap_or_default();
        let names: Vec<String> = chain.iter().map(|(open, _)| format!("`{}`", open.text)).chain([format!("`{}`", name.text)]).collect();
        let places = chain.iter().skip(1).map(|(_, at)| *at).chain([at]).collect();
        (names.join(" → "), places)
    }

    /// A type that has a member of its own type, directly or through others.
    pub(crate) fn contains_itself(&mut self, name: &Name, at: Span) {
        let (chain, places) = self.cycle(name, at);
        let (first, rest) = places.split_first().map_or((at, &[][..]), |(first, rest)| (*first, rest));
        let through = if rest.is_empty() { String::new() } else { format!(": {chain}") };
        let diagnostic = self.report(Code::Circular, first, format!("`{}` contains itself{through}", name.text));
        diagnostic.notes.extend(rest.iter().map(|span| Note { span: *span, message: "and this contains".into() }));
        diagnostic.help = Some("use POINTER TO or REFERENCE TO to break the cycle".into());
    }

    /// A constant whose value needs itself.
    pub(crate) fn depends_on_itself(&mut self, name: &Name) {
        let (chain, places) = self.cycle(name, name.span);
        let through = if places.len() > 1 { format!(": {chain}") } else { String::new() };
        let diagnostic = self.report(Code::Circular, name.span, format!("`{}` depends on itself{through}", name.text));
        let others = places.iter().take(places.len().saturating_sub(1));
        diagnostic.notes.extend(others.map(|span| Note { span: *span, message: "through this one".into() }));
    }

    /// A scalar constant has no value only if that was reported.
    pub(crate) fn lacks_value(&self, ty: TypeId, decl: &VarDecl) -> bool {
        let scalar =
            matches!(self.types.get(ty), Type::Elem(_) | Type::Subrange { .. } | Type::Enum(_) | Type::String(_) | Type::WString(_));
        scalar && matches!(decl.init, Some(takt_syntax::tree::Init::Expr(_)))
    }

    /// Arguments of FB_Init for what has none.
    pub(crate) fn check_arguments_of_init(&mut self, decl: &VarDecl, ty: TypeId) {
        let Some(arg) = decl.fb_init.first().or_else(|| decl.fb_inits.iter().flatten().next()) else { return };
        let mut element = ty;
        while let Type::Array { elem, .. } = self.types.get(element) {
            element = *elem;
        }
        let block = self.pou_of_type.get(&element).copied();
        let takes = block.is_some_and(|pou| self.bases(pou).any(|b| self.pous[b].members.contains_key("FB_INIT")));
        if !takes && (block.is_some() || *self.types.get(element) != Type::Error) {
            let name = block.map_or_else(|| self.types.name(element), |pou| self.pous[pou].tree.name.text.clone());
            self.report(Code::BadArgument, arg.span, format!("`{name}` has no method FB_Init that takes arguments"));
        }
    }

    /// A name that is declared nowhere: said once per unit, with the first few places where it is used too.
    pub(crate) fn unknown_name(&mut self, unit: Option<usize>, name: &str, span: Span, help: Option<String>) {
        const SHOWN: usize = 3;
        let entry = (unit, key(name));
        let first = self.unknown.get(&entry).and_then(|i| self.diagnostics.get_mut(*i)).filter(|first| first.code == Code::UnknownName);
        if let Some(first) = first {
            let again = first.span == span || first.notes.iter().any(|note| note.span == span);
            if !again && first.notes.len() < SHOWN {
                first.notes.push(Note { span, message: "used here too".into() });
            }
            return;
        }
        self.unknown.insert(entry, self.diagnostics.len());
        self.report(Code::UnknownName, span, format!("`{name}` is not declared")).help = help;
    }
}
