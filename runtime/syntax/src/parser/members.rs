//! METHOD, PROPERTY and ACTION.

use super::{Parser, is_end, is_var};
use crate::lexer::Kind;
use crate::tree::{Access, Action, Method, Name, Pou, Property, Stmt, TypeExpr, VarBlock, VarDecl, VarKind};
use crate::{Code, Diagnostic};

/// A member before it has found its unit.
pub(super) enum Member {
    Method(Method),
    Property(Property),
    Action(Action),
}

/// GET or SET: declarations, statements and who may use it.
type Accessor = ((Vec<VarBlock>, Vec<Stmt>), Option<Access>);

impl Member {
    /// Gives it to its unit.
    pub(super) fn join(self, pou: &mut Pou) {
        match self {
            Self::Method(method) => pou.methods.push(method),
            Self::Property(property) => pou.properties.push(property),
            Self::Action(action) => pou.actions.push(action),
        }
    }
}

impl Parser<'_> {
    /// Reads one member into its unit.
    pub(super) fn member_of(&mut self, pou: &mut Pou) {
        let (owner, member) = self.unit_member();
        if let Some(owner) = owner
            && !owner.text.eq_ignore_ascii_case(&pou.name.text)
        {
            let message = format!("expected a member of `{}`, found one of `{}`", pou.name.text, owner.text);
            let help = format!("`{}` ends before it, or the name is written without `{}.`", pou.name.text, owner.text);
            self.tell(Diagnostic::new(Code::UnexpectedToken, owner.span, message).help(help));
        }
        member.join(pou);
    }

    /// One member, and the unit that its name says it belongs to (`METHOD Motor.start`).
    pub(super) fn unit_member(&mut self) -> (Option<Name>, Member) {
        let mut owner = None;
        let member = match self.kind() {
            Kind::Method => Member::Method(self.method(&mut owner)),
            Kind::Property => Member::Property(self.property(&mut owner)),
            _ => Member::Action(self.action(&mut owner)),
        };
        self.eat(Kind::Semi);
        (owner, member)
    }

    fn member_name(&mut self, what: &str, owner: &mut Option<Name>) -> Name {
        let name = self.name(what);
        if self.kind() == Kind::Dot && self.peek(1).kind.is_name() && !self.failed {
            self.bump();
            *owner = Some(name);
            return self.name(what);
        }
        name
    }

    fn is_in_interface(&self) -> bool {
        self.open.iter().any(|open| open.end == Kind::EndInterface)
    }

    fn method(&mut self, owner: &mut Option<Name>) -> Method {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndMethod);
        let (pragmas, doc) = (self.pragmas(index), self.doc_before(index));
        let modifiers = self.modifiers();
        let name = self.member_name("the name of the method", owner);
        let result = if self.eat(Kind::Colon) { Some(self.type_expr()) } else { None };
        self.end_header();
        let (vars, body) = self.contents();
        // In an interface a method is its head; it need not be closed.
        if self.is_in_interface() && (self.starts_member() || self.kind() == Kind::EndInterface) {
            self.open.pop();
        } else {
            self.end_of_block();
        }
        Method { name, modifiers, result, vars, body, pragmas, doc, span: self.span_from(start.start) }
    }

    /// Declarations and statements.
    fn contents(&mut self) -> (Vec<VarBlock>, Vec<Stmt>) {
        let outer = std::mem::take(&mut self.late_vars);
        let mut vars = self.var_blocks();
        self.foreign_body();
        let body = self.statements();
        vars.extend(std::mem::replace(&mut self.late_vars, outer));
        (vars, body)
    }

    fn property(&mut self, owner: &mut Option<Name>) -> Property {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndProperty);
        let (pragmas, doc) = (self.pragmas(index), self.doc_before(index));
        let modifiers = self.modifiers();
        let name = self.member_name("the name of the property", owner);
        self.expect(Kind::Colon);
        let ty = self.type_expr();
        self.end_header();
        let (mut get, mut set) = ((None, None), (None, None));
        let shared = self.var_blocks();
        while let Some((word, access)) = self.accessor_head() {
            let (end, place) = if word == Kind::Get { (Kind::EndGet, &mut get) } else { (Kind::EndSet, &mut set) };
            let (contents, own) = self.accessor(end, &shared);
            *place = (Some(contents), access.or(own));
        }
        if self.kind() != Kind::EndProperty {
            if !self.is_block_boundary() {
                self.unexpected_here("`GET`, `SET` or `END_PROPERTY`");
            }
            while !matches!(self.kind(), Kind::EndProperty | Kind::Eof) && !self.is_block_boundary() {
                self.bump();
            }
        }
        self.failed = false;
        self.end_of_block();
        if let Some((vars, _)) = &mut set.0 {
            vars.insert(0, new_value(&name, &ty));
        }
        let access = |own: Option<Access>| own.unwrap_or(modifiers.access);
        let (get_access, set_access) = (access(get.1), access(set.1));
        let span = self.span_from(start.start);
        Property { name, modifiers, ty, get: get.0, set: set.0, get_access, set_access, pragmas, doc, span }
    }

    /// GET or SET, behind its access if that stands before it.
    fn accessor_head(&mut self) -> Option<(Kind, Option<Access>)> {
        let access = access(self.kind());
        let ahead = usize::from(access.is_some());
        let word = self.peek(ahead).kind;
        if !matches!(word, Kind::Get | Kind::Set) {
            return None;
        }
        if ahead > 0 {
            self.bump();
        }
        Some((word, access))
    }

    /// GET or SET. In an interface it may be the word alone.
    fn accessor(&mut self, end: Kind, shared: &[VarBlock]) -> Accessor {
        let start = self.bump();
        let next = self.peek(1);
        let own = access(self.kind()).filter(|_| next.starts_line || is_var(next.kind) || is_end(next.kind));
        if own.is_some() {
            self.bump();
        }
        self.eat(Kind::Semi);
        if matches!(self.kind(), Kind::Get | Kind::Set | Kind::EndProperty) {
            return ((shared.to_vec(), Vec::new()), own);
        }
        self.open_block(start, end);
        let (vars, body) = self.contents();
        self.end_of_block();
        self.eat(Kind::Semi);
        ((shared.iter().cloned().chain(vars).collect(), body), own)
    }

    fn action(&mut self, owner: &mut Option<Name>) -> Action {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndAction);
        let (pragmas, doc) = (self.pragmas(index), self.doc_before(index));
        let name = self.member_name("the name of the action", owner);
        self.eat(Kind::Colon);
        self.end_header();
        self.foreign_body();
        let body = self.statements();
        self.end_of_block();
        Action { name, body, pragmas, doc, span: self.span_from(start.start) }
    }
}

/// What SET is given: an input with the name of the property.
fn new_value(name: &Name, ty: &TypeExpr) -> VarBlock {
    let (name, ty) = (name.clone(), ty.clone());
    let span = name.span;
    let value = VarDecl { name, at: None, ty, init: None, fb_init: Vec::new(), fb_inits: Vec::new(), pragmas: Vec::new(), doc: None };
    VarBlock { kind: VarKind::Input, constant: false, retain: false, persistent: false, vars: vec![value], span }
}

/// Who may use a member, as a word says it.
fn access(word: Kind) -> Option<Access> {
    Some(match word {
        Kind::Public => Access::Public,
        Kind::Private => Access::Private,
        Kind::Protected => Access::Protected,
        Kind::Internal => Access::Internal,
        _ => return None,
    })
}
