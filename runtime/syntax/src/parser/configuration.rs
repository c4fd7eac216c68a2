//! CONFIGURATION, RESOURCE, TASK and program instances.

use super::{Parser, is_end};
use crate::lexer::Kind;
use crate::tree::{AccessDecl, Arg, Configuration, Expr, Name, ProgramDecl, TaskDecl};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    pub(super) fn configuration(&mut self) -> Configuration {
        let start = self.bump();
        self.open_block(start, Kind::EndConfiguration);
        let name = self.name("the name of the configuration");
        self.end_header();
        let span = self.span_of(start);
        let mut out = Configuration {
            name,
            globals: Vec::new(),
            tasks: Vec::new(),
            programs: Vec::new(),
            resources: Vec::new(),
            access: Vec::new(),
            home: self.home.clone(),
            span,
        };
        self.parts(&mut out);
        self.end_of_block();
        out.span = self.span_from(start.start);
        out
    }

    /// What stands in a configuration or resource, up to its END_.
    fn parts(&mut self, out: &mut Configuration) {
        let mut is_mended = false;
        loop {
            let brackets = self.brackets;
            let before = self.at;
            match self.kind() {
                Kind::Eof | Kind::Function | Kind::FunctionBlock | Kind::Type => return,
                Kind::EndResource if !self.is_in_resource() && is_mended => {
                    self.bump();
                }
                kind if is_end(kind) => return,
                Kind::VarAccess => self.access_block(out),
                Kind::VarGlobal | Kind::VarConfig => out.globals.extend(self.var_block()),
                Kind::Resource if !self.is_in_resource() => self.resource(out),
                Kind::Task => out.tasks.push(self.task()),
                Kind::Program if self.is_program_unit() => return,
                Kind::Program => out.programs.push(self.program()),
                Kind::Semi => {
                    self.bump();
                }
                _ => self.unexpected_here("`RESOURCE`, `TASK`, `PROGRAM` or `VAR_GLOBAL`"),
            }
            if self.failed {
                is_mended = true;
                self.recover_part(brackets, before);
            }
        }
    }

    fn is_in_resource(&self) -> bool {
        self.open.iter().any(|open| open.end == Kind::EndResource)
    }

    fn access_block(&mut self, out: &mut Configuration) {
        self.failed = false;
        let start = self.bump();
        self.open_block(start, Kind::EndVar);
        out.access.extend(self.access_declarations());
        self.close_block();
        self.eat(Kind::Semi);
    }

    /// `name : resource.program.variable : INT READ_ONLY;` up to END_VAR.
    pub(super) fn access_declarations(&mut self) -> Vec<AccessDecl> {
        let message = "`VAR_ACCESS` has no effect: no communication service reads its names";
        let place = self.span_of(self.previous());
        self.tell(Diagnostic::new(Code::NoEffect, place, message).help("variables are read and written by their own paths"));
        let mut list = Vec::new();
        while !self.is_block_boundary() {
            let (brackets, before) = (self.brackets, self.at);
            list.extend(self.access_declaration());
            if self.failed {
                self.recover_declaration(brackets);
            }
            if self.at == before {
                self.bump();
            }
        }
        list
    }

    fn access_declaration(&mut self) -> Option<AccessDecl> {
        let name = self.name("the name of an access path");
        self.expect(Kind::Colon);
        let path = self.access_path();
        self.expect(Kind::Colon);
        let ty = self.type_expr();
        let right = self.token();
        let is_writable = self.is_word(right, "READ_WRITE");
        if is_writable || self.is_word(right, "READ_ONLY") {
            self.bump();
        }
        let is_read = !self.failed;
        self.end_declaration();
        is_read.then_some(AccessDecl { name, path, ty, is_writable })
    }

    /// `resource.program.variable[1]`, `%IX0.0` or `resource.%MW5`, which is the address alone.
    fn access_path(&mut self) -> Expr {
        if self.kind().is_name() && self.peek(1).kind == Kind::Dot && self.peek(2).kind == Kind::Direct && !self.failed {
            self.bump();
            self.bump();
        }
        self.place()
    }

    /// Whether PROGRAM begins a unit: the END_ of the configuration was forgotten.
    fn is_program_unit(&self) -> bool {
        let behind = self.peek(2);
        self.peek(1).kind.is_name()
            && (behind.starts_line || behind.kind == Kind::Eof || super::is_var(behind.kind))
            && behind.kind != Kind::With
    }

    fn resource(&mut self, out: &mut Configuration) {
        let start = self.bump();
        self.open_block(start, Kind::EndResource);
        out.resources.push(self.name("the name of the resource"));
        if self.kind() == Kind::On && !self.failed {
            self.bump();
            self.qualified_name("the name of a processor");
        }
        self.end_header();
        self.parts(out);
        self.end_of_block();
    }

    /// `TASK fast(INTERVAL := T#1ms, PRIORITY := 0);`
    fn task(&mut self) -> TaskDecl {
        let pragmas = self.pragmas(self.at);
        let start = self.bump();
        let name = self.name("the name of the task");
        let mut args = Vec::new();
        let open = self.token();
        if self.expect(Kind::LParen) {
            while !self.failed && self.kind() != Kind::RParen {
                args.push(self.task_argument());
                if !self.eat(Kind::Comma) {
                    break;
                }
            }
            self.close(Kind::RParen, open);
        }
        let span = self.span_from(start.start);
        self.end_part();
        TaskDecl { name, args, pragmas, span }
    }

    fn task_argument(&mut self) -> (Name, Expr) {
        let name = self.name("INTERVAL, PRIORITY or SINGLE");
        self.expect(Kind::Assign);
        (name, self.expression())
    }

    /// `PROGRAM p WITH fast : Main;`
    fn program(&mut self) -> ProgramDecl {
        let start = self.bump();
        let mut retain = false;
        if matches!(self.kind(), Kind::Retain | Kind::NonRetain) && self.peek(1).kind.is_name() && self.peek(1).kind != Kind::With {
            retain = self.bump().kind == Kind::Retain;
        }
        let name = self.name("the name of the program instance");
        let task = self.with_task();
        self.expect(Kind::Colon);
        let ty = self.qualified_name("the name of a program");
        let (blocks, connections) = self.connections();
        let span = self.span_from(start.start);
        self.end_part();
        ProgramDecl { name, retain, task, ty, blocks, connections, span }
    }

    fn with_task(&mut self) -> Option<Name> {
        if self.kind() != Kind::With || self.failed {
            return None;
        }
        self.bump();
        Some(self.name("the name of a task"))
    }

    /// `(fb WITH slow, x := GVL.a, y => GVL.b)` behind the type of a program instance.
    fn connections(&mut self) -> (Vec<(Name, Name)>, Vec<Arg>) {
        let (mut blocks, mut connections) = (Vec::new(), Vec::new());
        let open = self.token();
        if self.failed || !self.eat(Kind::LParen) {
            return (blocks, connections);
        }
        while !self.failed && self.kind() != Kind::RParen {
            if self.kind().is_name() && self.peek(1).kind == Kind::With {
                let block = self.name("the name of a block");
                blocks.extend(self.with_task().map(|task| (block, task)));
            } else {
                connections.extend(self.argument().map(|(arg, _)| arg));
            }
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RParen, open);
        (blocks, connections)
    }

    fn end_part(&mut self) {
        if self.failed || self.eat(Kind::Semi) {
            return;
        }
        let next = self.token();
        if next.starts_line && !self.is_known_trouble() {
            let message = format!("expected `;`, found {}", self.describe(next));
            self.tell(Diagnostic::new(Code::UnexpectedToken, self.gap(), message));
        } else {
            self.unexpected_here("`;`");
        }
    }

    fn recover_part(&mut self, brackets: i32, before: usize) {
        if self.at == before {
            self.bump();
        }
        loop {
            let token = self.token();
            let is_part = matches!(token.kind, Kind::Resource | Kind::Task | Kind::Program) && token.starts_line;
            match token.kind {
                Kind::Eof => break,
                Kind::Semi => {
                    self.bump();
                    break;
                }
                kind if is_part || is_end(kind) || super::is_var(kind) => break,
                _ => {
                    self.bump();
                }
            }
        }
        self.brackets = brackets;
        self.failed = false;
    }
}
