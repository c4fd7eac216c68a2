//! CONFIGURATION, RESOURCE, TASK and program instances.

use super::{Parser, is_end};
use crate::lexer::Kind;
use crate::tree::{Configuration, Expr, Name, ProgramDecl, TaskDecl};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    pub(super) fn configuration(&mut self) -> Configuration {
        let start = self.bump();
        self.open_block(start, Kind::EndConfiguration);
        let name = self.name("the name of the configuration");
        self.end_header();
        let span = self.span_of(start);
        let mut out = Configuration { name, globals: Vec::new(), tasks: Vec::new(), programs: Vec::new(), resources: Vec::new(), span };
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
                Kind::EndResource if self.open.len() == 1 && is_mended => {
                    self.bump();
                }
                kind if is_end(kind) => return,
                Kind::VarGlobal | Kind::VarConfig | Kind::VarAccess => out.globals.extend(self.var_block()),
                Kind::Resource if self.open.len() == 1 => self.resource(out),
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
        if matches!(self.kind(), Kind::Retain | Kind::NonRetain) && self.peek(1).kind.is_name() && self.peek(1).kind != Kind::With {
            self.bump();
        }
        let name = self.name("the name of the program instance");
        let mut task = None;
        if self.kind() == Kind::With && !self.failed {
            self.bump();
            task = Some(self.name("the name of a task"));
        }
        self.expect(Kind::Colon);
        let ty = self.qualified_name("the name of a program");
        if self.kind() == Kind::LParen && !self.failed {
            let open = self.token();
            self.arguments();
            let message = "connections of a program instance are not supported";
            let help = "read and write its variables in a program: `p.x := GVL.y;`";
            self.tell(Diagnostic::new(Code::NotSupported, self.span_of(open), message).help(help));
        }
        let span = self.span_from(start.start);
        self.end_part();
        ProgramDecl { name, task, ty, span }
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
