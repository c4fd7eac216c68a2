//! Types as written, TYPE blocks and initial values.

use super::Parser;
use super::slips::is_integer_type;
use crate::lexer::{Kind, Token};
use crate::tree::{
    Arg, ArgKind, EnumBody, Expr, ExprKind, Home, Init, InitItem, LiteralValue, Name, TypeDecl, TypeExpr, TypeExprKind, TypeKind,
};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    /// A type.
    pub(super) fn type_expr(&mut self) -> TypeExpr {
        self.type_in(false).0
    }

    /// The type of a variable, and the arguments for its FB_Init.
    pub(super) fn type_with_arguments(&mut self) -> (TypeExpr, Vec<Arg>) {
        self.type_in(true)
    }

    fn type_in(&mut self, may_have_arguments: bool) -> (TypeExpr, Vec<Arg>) {
        let start = self.token();
        let mut args = Vec::new();
        let kind = if self.failed || !self.enter() {
            TypeExprKind::Error
        } else {
            let kind = self.type_kind(start, may_have_arguments, &mut args);
            self.leave();
            kind
        };
        let span = if kind == TypeExprKind::Error { self.gap() } else { self.span_from(start.start) };
        (TypeExpr { kind, span }, args)
    }

    fn type_kind(&mut self, start: Token, may_have_arguments: bool, args: &mut Vec<Arg>) -> TypeExprKind {
        match start.kind {
            Kind::Array => self.array_type(),
            Kind::Pointer if self.peek(1).kind == Kind::To => TypeExprKind::Pointer(self.target_type()),
            Kind::Ident if self.peek(1).kind == Kind::To && self.is_word(start, "REF") => TypeExprKind::Reference(self.target_type()),
            Kind::Reference if self.peek(1).kind == Kind::To => TypeExprKind::Reference(self.target_type()),
            Kind::RefTo => {
                self.bump();
                TypeExprKind::RefTo(Box::new(self.type_expr()))
            }
            Kind::Struct => {
                self.bump();
                self.refuse_overlap();
                TypeExprKind::Struct(self.fields(start, Kind::EndStruct))
            }
            Kind::LParen => TypeExprKind::Enum(Box::new(self.enum_body(None))),
            Kind::Ident if self.is_word(start, "STRING") => TypeExprKind::String(self.string_length()),
            Kind::Ident if self.is_word(start, "WSTRING") => TypeExprKind::WString(self.string_length()),
            kind if kind.is_name() => self.named_type(may_have_arguments, args),
            _ => {
                self.missing_type();
                TypeExprKind::Error
            }
        }
    }

    pub(super) fn is_word(&self, token: Token, word: &str) -> bool {
        self.text_of(token).eq_ignore_ascii_case(word)
    }

    fn missing_type(&mut self) {
        let token = self.token();
        let mut diagnostic = self.unexpected("a type");
        if token.starts_line || matches!(token.kind, Kind::Semi | Kind::Assign) {
            diagnostic.span = self.gap();
        }
        if !self.is_known_trouble() {
            self.tell(diagnostic);
        }
        self.failed = true;
    }

    fn target_type(&mut self) -> Box<TypeExpr> {
        self.bump();
        self.bump();
        Box::new(self.type_expr())
    }

    /// The length of a string in `(…)` or `[…]`.
    fn string_length(&mut self) -> Option<Box<Expr>> {
        self.bump();
        let open = self.token();
        let close = match open.kind {
            Kind::LParen => Kind::RParen,
            Kind::LBracket => Kind::RBracket,
            _ => return None,
        };
        self.bump();
        let length = self.expression();
        self.close(close, open);
        Some(Box::new(length))
    }

    fn array_type(&mut self) -> TypeExprKind {
        self.bump();
        let open = self.token();
        if !self.expect(Kind::LBracket) {
            return TypeExprKind::Error;
        }
        let mut dims = Vec::new();
        loop {
            if self.eat(Kind::Star) {
                dims.push(None);
            } else {
                let low = self.expression();
                if !self.failed && self.kind() != Kind::DotDot {
                    let diagnostic = self.unexpected("`..` and the upper bound");
                    self.tell(diagnostic.help("bounds are written `ARRAY [0..9] OF INT`: ten elements, the last has index 9"));
                    self.failed = true;
                }
                self.eat(Kind::DotDot);
                dims.push(Some((low, self.expression())));
            }
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        if !self.close(Kind::RBracket, open) {
            self.failed |= self.kind() != Kind::Of;
        }
        self.expect_or_assume(Kind::Of, "an array is written `ARRAY [0..9] OF INT`");
        TypeExprKind::Array { dims, elem: Box::new(self.type_expr()) }
    }

    fn named_type(&mut self, may_have_arguments: bool, args: &mut Vec<Arg>) -> TypeExprKind {
        let mut path = vec![self.name("a type")];
        while self.eat(Kind::Dot) {
            path.push(self.name("a type behind `.`"));
        }
        if self.kind() == Kind::Lt && !self.failed {
            return self.generic_type(path, may_have_arguments, args);
        }
        if self.kind() != Kind::LParen || self.failed {
            return TypeExprKind::Named(path);
        }
        let is_integer = path.len() == 1 && is_integer_type(&path[0].text);
        let names_member = self.peek(1).kind.is_name() && matches!(self.peek(2).kind, Kind::Assign | Kind::Comma | Kind::RParen);
        if is_integer && names_member {
            return TypeExprKind::Enum(Box::new(self.enum_body(path.pop())));
        }
        if self.peek(1).kind == Kind::RParen || names_member {
            if may_have_arguments {
                *args = self.arguments().0;
            }
            return TypeExprKind::Named(path);
        }
        self.subrange_or_arguments(path, may_have_arguments, args)
    }

    /// `FB<6, N>`, and the arguments for its FB_Init.
    fn generic_type(&mut self, path: Vec<Name>, may_have_arguments: bool, args: &mut Vec<Arg>) -> TypeExprKind {
        self.bump();
        let outer = std::mem::replace(&mut self.is_in_angles, true);
        let mut values = vec![self.expression()];
        while self.eat(Kind::Comma) {
            values.push(self.expression());
        }
        self.is_in_angles = outer;
        self.expect(Kind::Gt);
        if self.kind() == Kind::LParen && may_have_arguments && !self.failed {
            *args = self.arguments().0;
        }
        TypeExprKind::Generic { path, values }
    }

    /// `[(a := 1), (2)]`: arguments of FB_Init for the elements of an array of blocks.
    pub(super) fn arguments_of_elements(&mut self, ty: &TypeExpr) -> Vec<Vec<Arg>> {
        let mut list = Vec::new();
        let open = self.token();
        let is_list = open.kind == Kind::LBracket && self.peek(1).kind == Kind::LParen && matches!(ty.kind, TypeExprKind::Array { .. });
        if !is_list || self.failed {
            return list;
        }
        self.bump();
        while self.kind() == Kind::LParen && !self.failed {
            list.push(self.arguments().0);
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RBracket, open);
        list
    }

    /// `INT(0..9)` or `FB(1, x)`, which differ behind the first expression.
    fn subrange_or_arguments(&mut self, mut path: Vec<Name>, may_have_arguments: bool, args: &mut Vec<Arg>) -> TypeExprKind {
        let open = self.bump();
        let first = self.token();
        let low = self.expression();
        if self.kind() == Kind::DotDot && path.len() == 1 && !self.failed {
            self.bump();
            let high = self.expression();
            self.close(Kind::RParen, open);
            let base = path.swap_remove(0);
            return TypeExprKind::Subrange { base, low: Box::new(low), high: Box::new(high) };
        }
        if !may_have_arguments && !self.failed {
            self.unexpected_here("`..` and the upper bound");
        }
        args.push(Arg { name: None, kind: ArgKind::In, value: Some(low), span: self.span_from(first.start) });
        if self.kind() == Kind::Comma && !self.failed {
            // The comma stands where the bracket of an argument list would.
            args.extend(self.arguments().0);
        } else {
            self.close(Kind::RParen, open);
        }
        TypeExprKind::Named(path)
    }

    /// `(a, b := 5) INT := a`, with the `base` where it was written before.
    fn enum_body(&mut self, base: Option<Name>) -> EnumBody {
        let open = self.bump();
        let mut members = Vec::new();
        loop {
            let name = self.name("the name of an enumerator");
            if self.failed {
                break;
            }
            let value = if self.eat(Kind::Assign) { Some(self.expression()) } else { None };
            members.push((name, value));
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RParen, open);
        let base = match base {
            None if self.kind().is_name() && !self.failed && !self.token().starts_line => Some(self.name("a type")),
            base => base,
        };
        let init = if self.eat(Kind::Assign) { Some(self.expression()) } else { None };
        EnumBody { members, base, init }
    }

    // TYPE blocks.

    /// TYPE … END_TYPE.
    pub(super) fn type_block(&mut self) -> Vec<TypeDecl> {
        let index = self.at;
        let start = self.bump();
        self.open_block(start, Kind::EndType);
        let block_pragmas = self.pragmas(index);
        let mut block_doc = self.doc_before(index);
        let mut list = Vec::new();
        loop {
            let (brackets, before) = (self.brackets, self.at);
            if self.is_block_boundary() {
                break;
            }
            if self.kind().is_name() {
                let first = self.at;
                let mut pragmas = block_pragmas.clone();
                pragmas.extend(self.pragmas(first));
                let doc = self.doc_before(first);
                let mut decl = self.type_decl();
                decl.doc = doc.or(block_doc.take());
                decl.pragmas = pragmas;
                decl.home = self.home.clone();
                list.push(decl);
            } else {
                self.unexpected_here("the name of a type");
            }
            if self.failed {
                self.recover_type(brackets);
            }
            if self.at == before {
                self.bump();
            }
        }
        self.close_block();
        list
    }

    /// Skips to the next type, behind the fields of one whose head could not be read.
    fn recover_type(&mut self, brackets: i32) {
        let rest = &self.lexed.tokens[self.at..];
        let boundary = |kind: Kind| {
            matches!(kind, Kind::Semi | Kind::EndType | Kind::EndStruct | Kind::EndUnion | Kind::Struct | Kind::Eof)
                || matches!(kind, Kind::Type | Kind::Program | Kind::Function | Kind::FunctionBlock)
        };
        let mut ends = rest.iter().map(|token| token.kind).filter(|&kind| boundary(kind) && kind != Kind::Semi);
        let opens_first = rest.iter().find(|token| boundary(token.kind)).is_some_and(|token| token.kind == Kind::Struct);
        let has_fields = match ends.next() {
            Some(Kind::EndStruct | Kind::EndUnion) => true,
            Some(Kind::Struct) if opens_first => matches!(ends.next(), Some(Kind::EndStruct)),
            _ => false,
        };
        if !has_fields {
            return self.recover_declaration(brackets);
        }
        while !matches!(self.kind(), Kind::EndStruct | Kind::EndUnion) {
            self.bump();
        }
        self.bump();
        self.brackets = brackets;
        self.failed = false;
        self.eat(Kind::Semi);
    }

    fn type_decl(&mut self) -> TypeDecl {
        let start = self.token();
        while matches!(self.kind(), Kind::Public | Kind::Internal) && self.peek(1).kind.is_name() {
            self.bump();
        }
        let name = self.name("the name of a type");
        let extends = if self.kind() == Kind::Extends {
            self.bump();
            Some(self.qualified_name("the name of a structure"))
        } else {
            None
        };
        self.expect(Kind::Colon);
        let kind = self.declared_type(extends);
        let span = self.span_from(start.start);
        self.end_type(&kind);
        TypeDecl { name, kind, pragmas: Vec::new(), doc: None, home: Home::default(), span }
    }

    /// Takes the `;`, which a structure need not have.
    fn end_type(&mut self, kind: &TypeKind) {
        if matches!(kind, TypeKind::Struct { .. } | TypeKind::Union { .. }) {
            self.eat(Kind::Semi);
        } else {
            self.end_declaration();
        }
    }

    fn declared_type(&mut self, extends: Option<Name>) -> TypeKind {
        let start = self.token();
        match start.kind {
            Kind::Struct if !self.failed => {
                self.bump();
                self.refuse_overlap();
                let extends = match self.kind() {
                    Kind::Extends if self.peek(1).kind.is_name() => {
                        self.bump();
                        Some(self.qualified_name("the name of a structure"))
                    }
                    _ => extends,
                };
                TypeKind::Struct { extends, fields: self.fields(start, Kind::EndStruct) }
            }
            Kind::Union if !self.failed => {
                self.bump();
                TypeKind::Union { fields: self.fields(start, Kind::EndUnion) }
            }
            _ => self.plain_type(),
        }
    }

    fn plain_type(&mut self) -> TypeKind {
        let ty = self.type_expr();
        if let TypeExprKind::Enum(body) = ty.kind {
            return TypeKind::Enum(*body);
        }
        TypeKind::Alias { ty, init: self.initializer() }
    }

    /// The fields of a structure or union, to its END_.
    fn fields(&mut self, start: Token, end: Kind) -> Vec<crate::tree::VarDecl> {
        self.open_block(start, end);
        self.eat(Kind::Semi);
        let fields = self.declarations();
        self.close_block();
        fields
    }

    // Initial values.

    /// `:= value` if there is one.
    pub(super) fn initializer(&mut self) -> Option<Init> {
        if self.failed {
            return None;
        }
        match self.kind() {
            Kind::Assign => {
                self.bump();
            }
            Kind::Eq => {
                self.slip_equal("an initial value is assigned with `:=`");
                self.bump();
            }
            Kind::Ident if self.is_ref_sign(0) => {
                self.bump();
                self.bump();
            }
            _ => return None,
        }
        if self.token().starts_line && (self.kind().is_reserved() || self.peek(1).kind == Kind::Colon) {
            let message = format!("expected an initial value, found {}", self.describe(self.token()));
            self.report(Code::UnexpectedToken, self.gap(), message);
            return None;
        }
        let first = self.initial_value();
        Some(self.bare_list(first))
    }

    /// `1, 2, 3(0)` without brackets, as in programs for CoDeSys 2.3.
    fn bare_list(&mut self, first: Init) -> Init {
        let start = first.span().start;
        let mut items = match first {
            Init::Expr(count) if self.kind() == Kind::LParen && !self.failed && is_number(&count) => vec![self.repeated(count)],
            first if self.has_more_values() => vec![InitItem::One(first)],
            first => return first,
        };
        while self.has_more_values() {
            self.bump();
            items.push(self.array_item());
        }
        Init::Array(items, self.span_from(start))
    }

    /// Whether a `,` and another value follow, and not a field or declaration.
    fn has_more_values(&self) -> bool {
        let (value, behind) = (self.peek(1).kind, self.peek(2).kind);
        let is_value = matches!(value, Kind::Int | Kind::Literal | Kind::True | Kind::False | Kind::Minus | Kind::LParen | Kind::LBracket)
            || value.is_name() && matches!(behind, Kind::Comma | Kind::Semi | Kind::RParen | Kind::Dot | Kind::Hash);
        !self.failed && self.kind() == Kind::Comma && is_value
    }

    fn initial_value(&mut self) -> Init {
        if self.kind() == Kind::Struct && self.peek(1).kind == Kind::LParen {
            self.bump();
        }
        let is_struct = self.kind() == Kind::LParen
            && (self.peek(1).kind == Kind::RParen || self.peek(1).kind.is_name() && self.peek(2).kind == Kind::Assign);
        if self.failed || !(is_struct || self.kind() == Kind::LBracket) {
            return Init::Expr(self.expression());
        }
        let open = self.token();
        if !self.enter() {
            return Init::Expr(Expr { kind: ExprKind::Error, span: self.span_of(open) });
        }
        let init = if is_struct { self.struct_value() } else { self.array_value() };
        self.leave();
        init
    }

    fn struct_value(&mut self) -> Init {
        let open = self.bump();
        let mut fields = Vec::new();
        while !self.failed && self.kind() != Kind::RParen {
            let name = self.name("the name of a field");
            self.expect(Kind::Assign);
            if self.failed {
                break;
            }
            let first = self.initial_value();
            fields.push((name, self.bare_list(first)));
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RParen, open);
        Init::Struct(fields, self.span_from(open.start))
    }

    fn array_value(&mut self) -> Init {
        let open = self.bump();
        let mut items = Vec::new();
        while !self.failed && self.kind() != Kind::RBracket {
            items.push(self.array_item());
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RBracket, open);
        Init::Array(items, self.span_from(open.start))
    }

    fn array_item(&mut self) -> InitItem {
        if self.is_named_repeat() {
            let token = self.bump();
            let count = Expr { kind: ExprKind::Name(self.text_of(token).to_owned()), span: self.span_of(token) };
            return self.repeated(count);
        }
        let init = self.initial_value();
        match init {
            Init::Expr(count) if self.kind() == Kind::LParen && !self.failed => {
                if !is_number(&count) {
                    self.tell(Diagnostic::new(Code::UnexpectedToken, count.span, "expected the number of repetitions before `(`"));
                }
                self.repeated(count)
            }
            init => InitItem::One(init),
        }
    }

    /// `N([…])`, `N((x := 1))`: what a call cannot be.
    fn is_named_repeat(&self) -> bool {
        self.kind().is_name()
            && self.peek(1).kind == Kind::LParen
            && (self.peek(2).kind == Kind::LBracket
                || self.peek(2).kind == Kind::LParen && self.peek(3).kind.is_name() && self.peek(4).kind == Kind::Assign)
    }

    fn repeated(&mut self, count: Expr) -> InitItem {
        let open = self.bump();
        let mut values = Vec::new();
        while !self.failed && self.kind() != Kind::RParen {
            values.push(self.initial_value());
            if !self.eat(Kind::Comma) {
                break;
            }
        }
        self.close(Kind::RParen, open);
        InitItem::Repeat(count, values)
    }
}

fn is_number(expr: &Expr) -> bool {
    matches!(&expr.kind, ExprKind::Literal(literal) if matches!(literal.value, LiteralValue::Int(_)))
}
