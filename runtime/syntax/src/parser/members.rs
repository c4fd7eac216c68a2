//! METHOD, PROPERTY and ACTION.

use super::Parser;
use crate::lexer::Kind;
use crate::tree::{Action, Method, Name, Pou, Property, Stmt, TypeExpr, VarBlock, VarDecl, VarKind};

impl Parser<'_> {
    /// Reads one member into its unit.
    pub(super) fn member_of(&mut self, pou: &mut Pou) {
        match self.kind() {
            Kind::Method => pou.methods.push(self.method()),
            Kind::Property => pou.properties.push(self.property()),
            _ => pou.actions.push(self.action()),
        }
    }

    fn method(&mut self) -> Method {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndMethod);
        let (pragmas, doc) = (self.pragmas(index), self.doc_before(index));
        let modifiers = self.modifiers();
        let name = self.name("the name of the method");
        let result = if self.eat(Kind::Colon) { Some(self.type_expr()) } else { None };
        self.end_header();
        let (vars, body) = self.contents();
        self.end_of_block();
        Method { name, modifiers, result, vars, body, pragmas, doc, span: self.span_from(start.start) }
    }

    /// Declarations and statements.
    fn contents(&mut self) -> (Vec<VarBlock>, Vec<Stmt>) {
        let outer = std::mem::take(&mut self.late_vars);
        let mut vars = self.var_blocks();
        let body = self.statements();
        vars.extend(std::mem::replace(&mut self.late_vars, outer));
        (vars, body)
    }

    fn property(&mut self) -> Property {
        let start = self.bump();
        self.open_block(start, Kind::EndProperty);
        let modifiers = self.modifiers();
        let name = self.name("the name of the property");
        self.expect(Kind::Colon);
        let ty = self.type_expr();
        self.end_header();
        let (mut get, mut set) = (None, None);
        let shared = self.var_blocks();
        loop {
            match self.kind() {
                Kind::Get => get = Some(self.accessor(Kind::EndGet, &shared)),
                Kind::Set => set = Some(self.accessor(Kind::EndSet, &shared)),
                _ => break,
            }
        }
        if self.kind() != Kind::EndProperty {
            self.unexpected_here("`GET`, `SET` or `END_PROPERTY`");
            while !matches!(self.kind(), Kind::EndProperty | Kind::Eof) && !self.is_block_boundary() {
                self.bump();
            }
        }
        self.failed = false;
        self.end_of_block();
        if let Some((vars, _)) = &mut set {
            vars.insert(0, new_value(&name, &ty));
        }
        Property { name, modifiers, ty, get, set, span: self.span_from(start.start) }
    }

    /// GET or SET. In an interface it may be the word alone.
    fn accessor(&mut self, end: Kind, shared: &[VarBlock]) -> (Vec<VarBlock>, Vec<Stmt>) {
        let start = self.bump();
        self.eat(Kind::Semi);
        if matches!(self.kind(), Kind::Get | Kind::Set | Kind::EndProperty) {
            return (shared.to_vec(), Vec::new());
        }
        self.open_block(start, end);
        let (vars, body) = self.contents();
        self.end_of_block();
        self.eat(Kind::Semi);
        (shared.iter().cloned().chain(vars).collect(), body)
    }

    fn action(&mut self) -> Action {
        let start = self.bump();
        self.open_block(start, Kind::EndAction);
        let name = self.name("the name of the action");
        self.eat(Kind::Colon);
        self.end_header();
        let body = self.statements();
        self.end_of_block();
        Action { name, body, span: self.span_from(start.start) }
    }
}

/// What SET is given: an input with the name of the property.
fn new_value(name: &Name, ty: &TypeExpr) -> VarBlock {
    let (name, ty) = (name.clone(), ty.clone());
    let span = name.span;
    let value = VarDecl { name, at: None, ty, init: None, fb_init: Vec::new(), pragmas: Vec::new(), doc: None };
    VarBlock { kind: VarKind::Input, constant: false, retain: false, persistent: false, vars: vec![value], span }
}
