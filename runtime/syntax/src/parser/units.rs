//! What stands at the top of a file.

use super::{Parser, is_end, is_var};
use crate::lexer::{Kind, Token};
use crate::tree::{self, Access, Globals, Interface, Modifiers, Name, Pou, PouKind, Unit};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// The whole file.
    pub(super) fn file(&mut self) -> tree::File {
        let mut file = tree::File::default();
        while self.kind() != Kind::Eof {
            let before = self.at;
            self.unit(&mut file.units);
            self.failed = false;
            self.open.truncate(self.outer_homes.len());
            if self.at == before {
                self.bump();
            }
        }
        self.end_namespaces();
        file.addresses = std::mem::take(&mut self.addresses);
        file
    }

    fn unit(&mut self, units: &mut Vec<Unit>) {
        match self.kind() {
            Kind::Function => units.push(Unit::Pou(self.pou(PouKind::Function, Kind::EndFunction))),
            Kind::FunctionBlock => units.push(Unit::Pou(self.pou(PouKind::FunctionBlock, Kind::EndFunctionBlock))),
            Kind::Program => units.push(Unit::Pou(self.pou(PouKind::Program, Kind::EndProgram))),
            Kind::Type => units.extend(self.type_block().into_iter().map(Unit::Type)),
            Kind::VarGlobal | Kind::VarConfig => {
                let pragmas = self.pragmas(self.at);
                let home = self.home.clone();
                units.extend(self.var_block().map(|vars| Unit::Globals(Globals { pragmas, vars, home })));
            }
            Kind::Configuration => units.push(Unit::Configuration(self.configuration())),
            Kind::Class if self.starts_soft_unit() => units.push(Unit::Pou(self.pou(PouKind::FunctionBlock, Kind::EndClass))),
            Kind::Interface if self.starts_soft_unit() => units.push(Unit::Interface(self.interface())),
            Kind::Namespace if self.starts_soft_unit() => self.enter_namespace(),
            Kind::Using if self.starts_soft_unit() => self.use_for_all(),
            Kind::Method | Kind::Property | Kind::Action if self.starts_member() => self.member_behind(units),
            Kind::EndNamespace => self.leave_namespace(),
            Kind::Semi => {
                self.bump();
            }
            _ => self.homeless(),
        }
    }

    /// A METHOD, PROPERTY or ACTION behind the END_ of its block.
    fn member_behind(&mut self, units: &mut [Unit]) {
        let word = self.token();
        let (owner, member) = self.unit_member();
        let pou = match &owner {
            None => match units.last_mut() {
                Some(Unit::Pou(pou)) => Some(pou),
                _ => None,
            },
            Some(owner) => units.iter_mut().rev().find_map(|unit| match unit {
                Unit::Pou(pou) if pou.name.text.eq_ignore_ascii_case(&owner.text) => Some(pou),
                _ => None,
            }),
        };
        if let Some(pou) = pou {
            return member.join(pou);
        }
        let span = self.span_of(word);
        let diagnostic = match owner {
            None => Diagnostic::new(Code::UnexpectedToken, span, format!("`{}` belongs to no program unit", word.kind.text()))
                .help("it stands inside of its FUNCTION_BLOCK or PROGRAM or directly behind it"),
            Some(owner) => {
                let message = format!("expected the name of a unit of this file before `.`, found `{}`", owner.text);
                Diagnostic::new(Code::UnexpectedToken, owner.span, message)
                    .help("a member stands inside of its FUNCTION_BLOCK or PROGRAM or in the same file behind it")
            }
        };
        self.tell(diagnostic);
    }

    fn empty_pou(&self, kind: PouKind, start: Token) -> Pou {
        let span = self.span_of(start);
        Pou {
            kind,
            name: Name { text: String::new(), span },
            modifiers: Modifiers::default(),
            extends: None,
            implements: Vec::new(),
            result: None,
            vars: Vec::new(),
            body: Vec::new(),
            methods: Vec::new(),
            properties: Vec::new(),
            actions: Vec::new(),
            pragmas: Vec::new(),
            doc: None,
            home: self.home.clone(),
            span,
            end: span,
        }
    }

    /// Something that is no unit: one message, and on to the next unit.
    fn homeless(&mut self) {
        let token = self.token();
        let found = self.describe(token);
        let diagnostic = Diagnostic::new(Code::UnexpectedToken, self.span_of(token), String::new());
        let (message, help) = if is_end(token.kind) {
            (format!("{found} belongs to no open unit"), None)
        } else if is_var(token.kind) {
            let help = "variables are declared in a PROGRAM, FUNCTION_BLOCK or FUNCTION; global ones in VAR_GLOBAL";
            (format!("expected a program unit, found {found}"), Some(help))
        } else {
            let help = "statements stand in a unit: `PROGRAM main … END_PROGRAM`";
            (format!("expected a program unit such as PROGRAM or TYPE, found {found}"), Some(help))
        };
        let is_forgiven = self.is_homeless && is_end(token.kind);
        self.is_homeless = !is_end(token.kind);
        if !self.is_known_trouble() && !is_forgiven {
            self.tell(Diagnostic { message, help: help.map(str::to_owned), ..diagnostic });
        }
        self.bump();
        while !self.starts_unit() {
            self.bump();
        }
        self.brackets = 0;
    }

    fn starts_unit(&self) -> bool {
        use Kind::*;
        match self.kind() {
            // `PROGRAM p WITH task : Main` and `PROGRAM p : Main` belong to a configuration.
            Program => !matches!(self.peek(2).kind, With | Colon),
            Eof | Function | FunctionBlock | Type | VarGlobal | VarConfig | Configuration => true,
            _ => self.starts_soft_unit() || self.starts_member(),
        }
    }

    /// FUNCTION, FUNCTION_BLOCK, PROGRAM or CLASS.
    fn pou(&mut self, kind: PouKind, end: Kind) -> Pou {
        let index = self.at;
        let start = self.bump();
        self.is_homeless = false;
        self.open_block(start, end);
        let mut pou = self.empty_pou(kind, start);
        pou.pragmas = self.pragmas(index);
        pou.doc = self.doc_before(index);
        pou.modifiers = self.modifiers();
        if matches!(self.kind(), Kind::Extends | Kind::Implements) && self.peek(1).kind.is_name() {
            let diagnostic = self.unexpected("the name of the unit");
            self.tell(diagnostic);
        } else {
            pou.name = self.name("the name of the unit");
        }
        let using = self.using();
        pou.home.using.extend(using);
        if self.kind() == Kind::VarGeneric && !self.failed {
            pou.vars.extend(self.var_block());
        }
        if self.kind() == Kind::Extends && !self.failed {
            self.bump();
            pou.extends = Some(self.qualified_name("the name of a block"));
            self.refuse_generic_base();
        }
        if self.kind() == Kind::Implements && !self.failed {
            self.bump();
            pou.implements = self.name_list();
        }
        if self.eat(Kind::Colon) {
            pou.result = Some(self.type_expr());
        }
        self.end_header();
        let using = self.using();
        pou.home.using.extend(using);
        self.pou_contents(&mut pou);
        pou.end = self.end_of_block();
        pou.span = self.span_from(start.start);
        pou
    }

    fn pou_contents(&mut self, pou: &mut Pou) {
        let vars = self.var_blocks();
        pou.vars.extend(vars);
        loop {
            self.foreign_body();
            let body = self.statements();
            pou.body.extend(body);
            pou.vars.append(&mut self.late_vars);
            if !self.starts_member() {
                return;
            }
            self.member_of(pou);
        }
    }

    /// `EXTENDS Base<6>`.
    fn refuse_generic_base(&mut self) {
        if self.kind() != Kind::Lt || self.failed {
            return;
        }
        let open = self.bump();
        self.tell(Diagnostic::new(Code::NotSupported, self.span_of(open), "values for a generic base block are not supported"));
        while !matches!(self.kind(), Kind::Gt | Kind::Eof) && !self.token().starts_line {
            self.bump();
        }
        self.eat(Kind::Gt);
    }

    /// Closes the innermost block; the place of its END_, or where it is missing.
    pub(super) fn end_of_block(&mut self) -> crate::Span {
        let taken = self.at;
        let token = self.close_block();
        if self.at > taken { self.span_of(token) } else { self.gap() }
    }

    /// Ends the first line of a unit or member, behind which a `;`, a section or a statement may stand.
    pub(super) fn end_header(&mut self) {
        self.eat(Kind::Semi);
        let next = self.token();
        let behind = self.peek(1);
        let is_statement = matches!(
            behind.kind,
            Kind::Assign | Kind::TryAssign | Kind::Eq | Kind::LParen | Kind::LBracket | Kind::Dot | Kind::Caret | Kind::Colon
        );
        let is_lone_name = next.kind == Kind::Ident && (!is_statement || behind.starts_line) && !self.is_letter_sign(1, "S");
        let is_sign =
            !next.kind.is_name() && !next.kind.is_reserved() && !matches!(next.kind, Kind::Eof | Kind::Dot | Kind::Direct | Kind::Bad);
        if !self.failed && !next.starts_line && (is_lone_name || is_sign) {
            let mut diagnostic = self.unexpected("the end of the line or `:` and a type");
            if next.kind == Kind::LParen {
                diagnostic.help = Some("parameters are declared in VAR_INPUT … END_VAR".to_owned());
            }
            if !self.is_known_trouble() {
                self.tell(diagnostic);
            }
            self.failed = true;
        }
        if self.failed {
            while !self.token().starts_line && !self.starts_unit() && !is_var(self.kind()) && !is_end(self.kind()) {
                self.bump();
            }
            self.failed = false;
            self.brackets = 0;
        }
    }

    pub(super) fn name_list(&mut self) -> Vec<Name> {
        let mut names = vec![self.qualified_name("a name")];
        while self.eat(Kind::Comma) {
            names.push(self.qualified_name("a name"));
        }
        names
    }

    /// ABSTRACT, FINAL, OVERRIDE and access, in any order, in front of a name.
    pub(super) fn modifiers(&mut self) -> Modifiers {
        let mut modifiers = Modifiers::default();
        while self.peek(1).kind.is_name() && !matches!(self.peek(1).kind, Kind::Extends | Kind::Implements) {
            match self.kind() {
                Kind::Abstract => modifiers.is_abstract = true,
                Kind::Final => modifiers.is_final = true,
                Kind::Override => modifiers.is_override = true,
                Kind::Public => modifiers.access = Access::Public,
                Kind::Private => modifiers.access = Access::Private,
                Kind::Protected => modifiers.access = Access::Protected,
                Kind::Internal => modifiers.access = Access::Internal,
                _ => break,
            }
            self.bump();
        }
        modifiers
    }

    fn interface(&mut self) -> Interface {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndInterface);
        let (pragmas, doc) = (self.pragmas(index), self.doc_before(index));
        self.modifiers();
        let name = self.name("the name of the interface");
        let extends = if self.kind() == Kind::Extends && !self.failed {
            self.bump();
            self.name_list()
        } else {
            Vec::new()
        };
        self.end_header();
        let mut holder = self.empty_pou(PouKind::FunctionBlock, start);
        while self.starts_member() && self.kind() != Kind::Action {
            self.unit_member().1.join(&mut holder);
        }
        if !is_end(self.kind()) && !self.starts_unit() {
            self.tell(self.unexpected("`METHOD`, `PROPERTY` or `END_INTERFACE`"));
            while !is_end(self.kind()) && !self.starts_unit() {
                self.bump();
            }
        }
        self.end_of_block();
        let span = self.span_from(start.start);
        let Pou { methods, properties, home, .. } = holder;
        Interface { name, extends, methods, properties, pragmas, doc, home, span }
    }
}
