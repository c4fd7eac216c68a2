//! VAR sections and the declarations in them.

use super::{Parser, is_end, is_statement_end, is_var};
use crate::lexer::{Kind, Token};
use crate::tree::{Name, VarBlock, VarDecl, VarKind};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// VAR sections up to something else.
    pub(super) fn var_blocks(&mut self) -> Vec<VarBlock> {
        let mut blocks = Vec::new();
        while is_var(self.kind()) && !matches!(self.kind(), Kind::VarGlobal | Kind::VarConfig) {
            blocks.extend(self.var_block());
        }
        blocks
    }

    /// One VAR section; `None` for VAR_ACCESS, which holds no variables.
    pub(super) fn var_block(&mut self) -> Option<VarBlock> {
        self.failed = false;
        let start = self.bump();
        self.open_block(start, Kind::EndVar);
        let kind = var_kind(start.kind);
        if kind.is_none() {
            self.access_declarations();
            self.close_block();
            self.eat(Kind::Semi);
            return None;
        }
        let (mut constant, mut retain, mut persistent) = (false, false, false);
        while let Some(qualifier) = self.qualifier() {
            constant |= qualifier == Kind::Constant;
            retain |= qualifier == Kind::Retain;
            persistent |= qualifier == Kind::Persistent;
        }
        let vars = self.declarations();
        self.close_block();
        let span = self.span_from(start.start);
        self.eat(Kind::Semi);
        Some(VarBlock { kind: kind?, constant, retain, persistent, vars, span })
    }

    fn qualifier(&mut self) -> Option<Kind> {
        use Kind::{Constant, Internal, NonRetain, Persistent, Private, Protected, Public, Retain};
        let known = matches!(self.kind(), Constant | Retain | NonRetain | Persistent | Public | Private | Protected | Internal);
        let is_name = matches!(self.peek(1).kind, Kind::Colon | Kind::Comma | Kind::At);
        (known && !is_name).then(|| self.bump().kind)
    }

    /// Declarations of variables or fields up to the END_ of the innermost block or to what cannot be one.
    pub(super) fn declarations(&mut self) -> Vec<VarDecl> {
        let mut list = Vec::new();
        let mut is_closed = None;
        loop {
            if self.kind() == Kind::Ident {
                self.respell();
                self.respell_end();
            }
            let (brackets, before) = (self.brackets, self.at);
            if self.eat(Kind::Semi) {
                continue;
            }
            if self.kind().is_reserved() && matches!(self.peek(1).kind, Kind::Colon | Kind::At) && !is_end(self.kind()) {
                self.keyword_as_name();
            } else if self.is_block_boundary() {
                return list;
            } else if self.kind().is_name() {
                let declares = matches!(self.peek(1).kind, Kind::Colon | Kind::Comma | Kind::At | Kind::Dot);
                if !declares && !*is_closed.get_or_insert_with(|| self.is_closed_ahead()) {
                    return list;
                }
                self.declaration(&mut list);
            } else {
                self.unexpected_here("the name of a variable");
            }
            if self.failed {
                self.recover_declaration(brackets);
            }
            if self.at == before {
                self.bump();
            }
        }
    }

    /// Whether the declarations cannot go on here.
    pub(super) fn is_block_boundary(&self) -> bool {
        use Kind::*;
        let kind = self.kind();
        match kind {
            Eof | Function | FunctionBlock | Program | Type | Configuration => true,
            If | Case | For | While | Repeat | Exit | Return | Jmp | Elsif | Else | Until => true,
            _ if kind.is_contextual() => (self.starts_member() || self.starts_soft_unit()) && self.peek(2).kind != Colon,
            _ if is_statement_end(kind) => self.closes_something(kind),
            _ => is_var(kind) || is_end(kind),
        }
    }

    /// Whether an END_ of the innermost block comes before the next section or unit.
    fn is_closed_ahead(&self) -> bool {
        let Some(end) = self.open.last().map(|open| open.end) else { return false };
        let rest = &self.lexed.tokens[self.at..];
        let stop =
            rest.iter().find(|token| is_var(token.kind) || is_end(token.kind) || matches!(token.kind, Kind::Function | Kind::Program));
        stop.is_some_and(|token| token.kind == end)
    }

    /// `a, b AT %IX0.0 : INT := 5;`.
    fn declaration(&mut self, list: &mut Vec<VarDecl>) {
        let index = self.at;
        let mut names = Vec::new();
        loop {
            let name = self.declared_name();
            let at = if self.eat(Kind::At) { self.location() } else { None };
            names.push((name, at));
            if self.failed || !self.eat(Kind::Comma) {
                break;
            }
        }
        if !self.failed && !self.eat(Kind::Colon) {
            self.missing_colon(&names[names.len() - 1].0, names.len());
        }
        if self.failed {
            return;
        }
        let (ty, fb_init) = self.type_with_arguments();
        let fb_inits = self.arguments_of_elements(&ty);
        self.refuse_edge();
        let init = self.initializer();
        self.end_declaration();
        let pragmas = self.pragmas(index);
        let doc = self.doc_behind().or_else(|| self.doc_before(index));
        let (last_name, last_at) = match names.pop() {
            Some(last) => last,
            None => return,
        };
        let last = VarDecl { name: last_name, at: last_at, ty, init, fb_init, fb_inits, pragmas, doc };
        for (name, at) in names {
            list.push(VarDecl { name, at, ..last.clone() });
        }
        list.push(last);
    }

    /// The name of a variable; in VAR_CONFIG the path of one: `PLC_PRG.lamps[1].on`.
    fn declared_name(&mut self) -> Name {
        let mut name = self.qualified_name("the name of a variable");
        let is_path = self.open.last().is_some_and(|open| open.start.kind == Kind::VarConfig);
        while is_path && self.kind() == Kind::LBracket && !self.failed {
            let open = self.bump();
            while matches!(self.kind(), Kind::Int | Kind::Minus | Kind::Comma) || self.kind().is_name() {
                self.bump();
            }
            self.close(Kind::RBracket, open);
            if self.eat(Kind::Dot) {
                self.qualified_name("the name of a member");
            }
            name.span = self.span_from(name.span.start);
            name.text = self.text[name.span.start as usize..name.span.end as usize].split_whitespace().collect();
        }
        name
    }

    fn location(&mut self) -> Option<crate::tree::Direct> {
        if self.kind() == Kind::Direct {
            return Some(self.direct());
        }
        self.unexpected_here("a direct address such as `%IX0.0`");
        None
    }

    fn missing_colon(&mut self, name: &Name, names: usize) {
        let next = self.token();
        let mut diagnostic = self.unexpected("`:` and a type");
        if next.kind.is_name() && !next.starts_line && names == 1 {
            diagnostic.help = Some(format!("a declaration is written `{} : {};`", self.text_of(next), name.text));
        } else if next.starts_line || next.kind == Kind::Semi {
            diagnostic.span = self.gap();
        }
        if !self.is_known_trouble() {
            self.tell(diagnostic);
        }
        self.failed = true;
    }

    /// Takes the `;` of a declaration; where it is merely missing, says so and goes on.
    pub(super) fn end_declaration(&mut self) {
        if self.failed || self.eat(Kind::Semi) {
            return;
        }
        let next = self.token();
        let begins =
            next.starts_line || next.kind == Kind::Eof || is_end(next.kind) || next.kind.is_name() && self.peek(1).kind == Kind::Colon;
        if !begins || self.is_known_trouble() {
            return self.unexpected_here("`;`");
        }
        let message = format!("expected `;`, found {}", self.describe(next));
        let can_follow = next.kind.is_name() || next.kind == Kind::Eof || next.kind.is_reserved();
        let span = if can_follow { self.gap() } else { self.span_of(next) };
        self.tell(Diagnostic::new(Code::UnexpectedToken, span, message));
        self.failed = !can_follow;
    }

    /// Skips to the next declaration: behind a `;`, to a word that ends the block, or to a name that begins a line in front of a `:`.
    pub(super) fn recover_declaration(&mut self, brackets: i32) {
        while self.kind() != Kind::Eof {
            if self.kind() == Kind::Semi {
                self.bump();
                break;
            }
            let Token { kind, starts_line, .. } = self.token();
            let is_next = kind.is_name() && matches!(self.peek(1).kind, Kind::Colon | Kind::Comma | Kind::At);
            if self.is_block_boundary() || starts_line && is_next && self.brackets <= brackets {
                break;
            }
            self.bump();
        }
        self.brackets = brackets;
        self.failed = false;
    }
}

fn var_kind(kind: Kind) -> Option<VarKind> {
    Some(match kind {
        Kind::Var => VarKind::Var,
        Kind::VarInput => VarKind::Input,
        Kind::VarOutput => VarKind::Output,
        Kind::VarInOut => VarKind::InOut,
        Kind::VarTemp => VarKind::Temp,
        Kind::VarStat => VarKind::Stat,
        Kind::VarInst => VarKind::Inst,
        Kind::VarGlobal => VarKind::Global,
        Kind::VarExternal => VarKind::External,
        Kind::VarConfig => VarKind::Config,
        Kind::VarGeneric => VarKind::Generic,
        _ => return None,
    })
}
