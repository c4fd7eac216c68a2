//! Checking and lowering statements.

use crate::constant::{Value, range};
use crate::expression::{BLOCK_VARIABLE, Kind, Loop, Lowering, Operand};
use crate::operator::{Class, is_unsigned_64};
use crate::place::Place;
use crate::scope::key;
use takt_abi::Elem;
use takt_ir::{Base, BlockId, Inst, Local, Op, Term, Ty, Type, TypeId};
use takt_syntax::tree::{AssignOp, CaseLabel, Expr, ExprKind, Stmt, StmtKind};
use takt_syntax::{Code, Span};

/// Values of CASE ranges up to which a range becomes single labels.
const EXPANDED_RANGE: i128 = 64;

impl<'a> Lowering<'_, 'a> {
    pub(crate) fn statements(&mut self, statements: &'a [Stmt]) {
        for statement in statements {
            let mark = self.b.mark();
            self.statement(statement);
            self.b.release(mark);
        }
    }

    fn statement(&mut self, s: &'a Stmt) {
        match &s.kind {
            StmtKind::Assign { targets, value } => self.assignment(targets, value, s.span),
            StmtKind::Expr(e) => self.expression_statement(e),
            StmtKind::If { arms, otherwise } => self.if_statement(arms, otherwise.as_deref()),
            StmtKind::Case { value, arms, otherwise } => self.case_statement(value, arms, otherwise.as_deref()),
            StmtKind::For { var, from, to, by, body } => self.for_statement(var, from, to, by.as_ref(), body, s.span),
            StmtKind::While { cond, body } => self.while_statement(cond, body, s.span),
            StmtKind::Repeat { body, until } => self.repeat_statement(body, until, s.span),
            StmtKind::Exit => self.leave(s.span, "EXIT", |l| l.exit),
            StmtKind::Continue => self.leave(s.span, "CONTINUE", |l| l.next),
            StmtKind::Return => {
                self.leave_protected(0);
                self.return_();
            }
            StmtKind::Jump(label) => {
                let block = self.label(&label.text, label.span, false);
                self.jump_back(block, s.span);
            }
            StmtKind::Label(label) => {
                let block = self.label(&label.text, label.span, true);
                self.b.continue_in(block);
            }
            StmtKind::Empty | StmtKind::Error => {}
            StmtKind::Try { body, catch, finally } => self.try_statement(body, catch.as_ref(), finally.as_deref(), s.span),
        }
    }

    fn expression_statement(&mut self, e: &'a Expr) {
        let operand = self.expr(e);
        if operand.is_error() || matches!(e.kind, ExprKind::Call(..) | ExprKind::Assign(..)) {
            self.lint_call(e, &operand);
            return;
        }
        let block = matches!(self.c.types.get(operand.ty), Type::Struct(s) if s.kind == takt_ir::StructKind::Block);
        let diagnostic = self.report(Code::BadStatement, e.span, "this value is not used");
        diagnostic.help = Some(if block { "call the block: `name(…);`" } else { "assign it with `:=`, or remove it" }.into());
    }

    /// A jump to a place that may be earlier: it takes fuel.
    fn jump_back(&mut self, block: BlockId, span: Span) {
        let site = self.site(span);
        self.b.push(Inst::Poll { cost: 1, site });
        self.b.end(Term::Jump(block));
    }

    fn label(&mut self, name: &str, span: Span, defines: bool) -> BlockId {
        let block = match self.labels.get(&key(name)) {
            Some((block, defined, _)) => {
                let (block, again) = (*block, *defined && defines);
                if again {
                    self.report(Code::DuplicateLabel, span, format!("the label `{name}` is defined twice"));
                }
                block
            }
            None => self.b.block(),
        };
        let defined = defines || self.labels.get(&key(name)).is_some_and(|l| l.1);
        self.labels.insert(key(name), (block, defined, span));
        block
    }

    /// Reports jumps to labels that are nowhere.
    pub(crate) fn check_labels(&mut self) {
        let mut missing: Vec<_> = self.labels.iter().filter(|(_, l)| !l.1).map(|(n, l)| (l.2, n.clone())).collect();
        missing.sort_by_key(|(span, _)| span.start);
        for (span, name) in missing {
            self.report(Code::UnknownName, span, format!("there is no label `{name}`"));
        }
    }

    fn leave(&mut self, span: Span, word: &str, to: fn(&Loop) -> BlockId) {
        match self.loops.last().map(to) {
            Some(block) => {
                self.leave_protected(self.loops.len());
                self.b.end(Term::Jump(block));
            }
            None => {
                self.report(Code::BadStatement, span, format!("{word} is only possible inside FOR, WHILE or REPEAT"));
            }
        }
    }

    pub(crate) fn return_(&mut self) {
        let value = match &self.result {
            Some((_, crate::scope::Storage::Register(local))) => Some(*local),
            Some((ty, crate::scope::Storage::Frame(offset))) if self.scalar(*ty).is_some() => {
                let (place, ty) = (Place::Memory { base: Base::Frame, offset: *offset }, *ty);
                let span = Span { file: takt_syntax::FileId(0), start: 0, end: 0 };
                Some(self.load(&place, ty, span))
            }
            _ => None,
        };
        self.b.end(Term::Return(value));
    }

    fn assignment(&mut self, targets: &'a [(Expr, AssignOp)], value: &'a Expr, span: Span) {
        let value = match targets.last() {
            Some((_, AssignOp::Ref)) => self.reference_to(value),
            _ => self.expr(value),
        };
        let mut value = value;
        for (target, op) in targets.iter().rev() {
            match op {
                AssignOp::Assign => {
                    let place = self.target(target);
                    self.assign(place.clone(), value.clone());
                    if targets.len() > 1 && !place.is_error() {
                        value = self.read_back(place);
                    }
                }
                AssignOp::Set | AssignOp::Reset => self.set_or_reset(target, value.clone(), *op),
                AssignOp::Ref => self.assign_reference(target, value.clone()),
                AssignOp::Try => self.try_assign(target, value.clone(), span),
            }
        }
    }

    fn set_or_reset(&mut self, target: &'a Expr, value: Operand, op: AssignOp) {
        let place = self.target(target);
        let value = self.condition_operand(value);
        let place_ok = self.condition_operand(place.clone());
        if value.is_error() || place_ok.is_error() {
            return;
        }
        let cond = self.value(&value);
        let (then, end) = (self.b.block(), self.b.block());
        self.b.end(Term::Branch { cond, then, other: end });
        self.b.go_to(then);
        let ty = self.bool_type();
        let constant = self.constant(Value::Int(i128::from(op == AssignOp::Set)), ty, place.span);
        self.assign(place, constant);
        self.b.continue_in(end);
    }

    /// The pointer that `REF=` stores: of another reference, or of a variable.
    fn reference_to(&mut self, e: &'a Expr) -> Operand {
        let operand = match self.thing_raw(e) {
            crate::expression::Thing::Value(operand) => operand,
            crate::expression::Thing::Member(bound) if bound.is_property() => self.get_property(*bound, e.span),
            _ => return self.expr(e),
        };
        if operand.is_error() || matches!(self.c.types.get(operand.ty), Type::Reference(_)) {
            return operand;
        }
        if let Kind::Const(Value::Int(0)) = operand.kind {
            return operand;
        }
        self.address_of(operand, e.span)
    }

    fn assign_reference(&mut self, target: &'a Expr, value: Operand) {
        let place = match self.thing_raw(target) {
            crate::expression::Thing::Value(place) => place,
            crate::expression::Thing::Member(bound) if bound.is_property() => {
                return if !value.is_error() {
                    self.set_property(&bound, value, target.span)
                };
            }
            _ => return drop(self.expr(target)),
        };
        if place.is_error() || value.is_error() {
            return;
        }
        let Type::Reference(to) = *self.c.types.get(place.ty) else {
            let name = self.type_name(place.ty);
            self.report(Code::TypeMismatch, place.span, format!("`REF=` needs a REFERENCE, found `{name}`"));
            return;
        };
        let from = match self.c.types.get(value.ty) {
            Type::Pointer(t) | Type::Reference(t) => Some(*t),
            _ => None,
        };
        if from.is_some_and(|from| !self.refers_to(to, from)) {
            let (wanted, found) = (self.type_name(to), from.map(|f| self.type_name(f)).unwrap_or_default());
            self.report(Code::TypeMismatch, value.span, format!("expected a variable of type `{wanted}`, found `{found}`"));
            return;
        }
        let (Kind::Place(target), word) = (place.kind.clone(), self.value(&value)) else { return };
        self.store(&target, place.ty, word, true, place.span);
    }

    /// `target := value` with all checks.
    pub(crate) fn assign(&mut self, target: Operand, value: Operand) {
        let target = self.follow(target);
        if target.is_error() {
            return;
        }
        if let Kind::Property(bound) = &target.kind {
            return if !value.is_error() {
                self.set_property(bound, value, target.span)
            };
        }
        let place = match (&target.kind, target.fixed) {
            (Kind::Place(place), None) => place.clone(),
            (_, why) => {
                let code = if why == Some(BLOCK_VARIABLE) { Code::NotAccessible } else { Code::NotAssignable };
                let why = why.unwrap_or("an expression");
                self.report(code, target.span, format!("{why} cannot be assigned"));
                return;
            }
        };
        if value.is_error() {
            return;
        }
        self.assign_place(&place, target.ty, value, target.span);
    }

    /// Stores a value of any type into a place of type `ty`.
    pub(crate) fn assign_place(&mut self, place: &Place, ty: TypeId, value: Operand, span: Span) {
        match (self.class(ty), &value.kind) {
            (Class::Text | Class::Wide, _) => {
                let value = self.convert(value, ty);
                if !value.is_error() {
                    self.assign_text(place, ty, &value, span);
                }
            }
            (Class::Other, Kind::Place(Place::Memory { .. })) if value.ty == ty && self.is_unassignable(ty) => {
                let name = self.type_name(ty);
                self.report(Code::NotAssignable, span, format!("instances of `{name}` cannot be assigned: it says `no_assign`"));
            }
            (Class::Other, Kind::Place(Place::Memory { base, offset })) if value.ty == ty => {
                let Place::Memory { base: dst, offset: dst_offset } = place else { return };
                let (src, src_offset, len) = (*base, *offset, self.c.types.size(ty));
                self.b.push(Inst::Move { dst: *dst, dst_offset: *dst_offset, src, src_offset, len });
            }
            _ => {
                let value = self.convert(value, ty);
                if value.is_error() {
                    return;
                }
                let src = self.value(&value);
                self.store(place, ty, src, value.exact, span);
            }
        }
    }

    /// `reference ?= value`: as `REF=` if the instance is of the type, else NULL.
    fn try_assign(&mut self, target: &'a Expr, value: Operand, span: Span) {
        let crate::expression::Thing::Value(place) = self.thing_raw(target) else { return drop(self.expr(target)) };
        if place.is_error() || value.is_error() {
            return;
        }
        let of = match *self.c.types.get(place.ty) {
            Type::Reference(to) | Type::Pointer(to) => self.c.pou_of_type.get(&to).copied().map(crate::scope::Owner::Pou),
            Type::Interface(_) => self.c.interface_of_type.get(&place.ty).copied().map(crate::scope::Owner::Interface),
            _ => None,
        };
        let (Some(of), Some(pointer), Kind::Place(target)) = (of, self.instance_pointer(&value), place.kind.clone()) else {
            self.report(Code::TypeMismatch, span, "`?=` needs an interface, or a POINTER or REFERENCE TO a block, on both sides");
            return;
        };
        let family = self.c.family_number(of);
        let site = self.site(span);
        let (found, zero) = (self.b.local(Ty::I64), self.b.int(0));
        self.b.push(Inst::IsA { dst: found, pointer, family });
        let word = self.b.op(Op::Select, &[found, pointer, zero], site);
        self.store(&target, place.ty, word, true, span);
    }

    /// `{attribute 'no_assign'}` of a block, or of a block inside.
    fn is_unassignable(&self, ty: TypeId) -> bool {
        let says = |pou: &usize| self.c.bases(*pou).any(|b| self.c.pous[b].tree.pragmas.iter().any(|p| p.name == "no_assign"));
        match self.c.types.get(ty) {
            Type::Array { elem, .. } => self.is_unassignable(*elem),
            Type::Struct(_) => self.c.pou_of_type.get(&ty).is_some_and(says),
            _ => false,
        }
    }

    /// Binds a local REFERENCE where it is declared.
    pub(crate) fn bind_initial(&mut self, local: Local, e: &'a Expr) {
        let pointer = self.reference_to(e);
        if !pointer.is_error() {
            let src = self.value(&pointer);
            self.b.push(Inst::Copy { dst: local, src });
        }
    }

    /// Sets a variable's initial value that is not bytes.
    pub(crate) fn set_initial(&mut self, base: Base, offset: u32, ty: TypeId, e: &'a Expr) {
        let mark = self.b.mark();
        let value = match self.c.types.get(ty) {
            Type::Reference(_) => {
                let value = self.reference_to(e);
                Operand { ty, ..value }
            }
            _ => self.expr(e),
        };
        if !value.is_error() {
            let (place, ty) = self.bit_place(Place::Memory { base, offset }, ty);
            self.assign_place(&place, ty, value, e.span);
        }
        self.b.release(mark);
    }

    pub(crate) fn condition(&mut self, e: &'a Expr) -> Local {
        let operand = self.expr(e);
        let operand = self.condition_operand(operand);
        self.value(&operand)
    }

    fn if_statement(&mut self, arms: &'a [(Expr, Vec<Stmt>)], otherwise: Option<&'a [Stmt]>) {
        let end = self.b.block();
        for (cond, body) in arms {
            let cond = self.condition(cond);
            let (then, other) = (self.b.block(), self.b.block());
            self.b.end(Term::Branch { cond, then, other });
            self.b.go_to(then);
            self.statements(body);
            self.b.end(Term::Jump(end));
            self.b.go_to(other);
        }
        self.statements(otherwise.unwrap_or_default());
        self.b.continue_in(end);
    }

    fn case_statement(&mut self, value: &'a Expr, arms: &'a [(Vec<CaseLabel>, Vec<Stmt>)], otherwise: Option<&'a [Stmt]>) {
        let selector = self.expr(value);
        if matches!(self.class(selector.ty), Class::Text | Class::Wide) {
            return self.case_of_texts(selector, arms, otherwise);
        }
        let (ty, usable) = match self.class(selector.ty) {
            Class::Int(_) | Class::Char(_) | Class::Bool | Class::Duration(_) => (selector.ty, true),
            _ => (selector.ty, false),
        };
        if !usable && !selector.is_error() {
            let name = self.operand_name(&selector);
            self.report(Code::TypeMismatch, value.span, format!("CASE needs an integer or enumeration, found {name}"));
        }
        let word = self.exact_value(&selector);
        let (end, default) = (self.b.block(), self.b.block());
        let mut cases: Vec<(i64, BlockId)> = Vec::new();
        let mut ranges: Vec<(i128, i128, BlockId)> = Vec::new();
        let mut seen: Vec<(i128, i128, Span)> = Vec::new();
        let blocks: Vec<BlockId> = arms.iter().map(|_| self.b.block()).collect();
        for ((labels, _), block) in arms.iter().zip(&blocks) {
            for label in labels {
                let Some((low, high, span)) = self.case_label(label, ty, usable) else { continue };
                if let Some((_, _, first)) = seen.iter().find(|(l, h, _)| low <= *h && *l <= high).copied() {
                    self.report(Code::DuplicateLabel, span, "this label is covered already")
                        .notes
                        .push(takt_syntax::Note { span: first, message: "here".into() });
                    continue;
                }
                seen.push((low, high, span));
                if high - low < EXPANDED_RANGE {
                    cases.extend((low..=high).map(|v| (v as i64, *block)));
                } else {
                    ranges.push((low, high, *block));
                }
            }
        }
        if otherwise.is_none() {
            self.lint_case(ty, &seen, value.span);
        }
        self.case_ranges(word, &ranges, ty, value.span);
        self.b.end(Term::Switch { value: word, cases, default });
        for ((_, body), block) in arms.iter().zip(&blocks) {
            self.b.go_to(*block);
            self.statements(body);
            self.b.end(Term::Jump(end));
        }
        self.b.go_to(default);
        self.statements(otherwise.unwrap_or_default());
        self.b.continue_in(end);
    }

    /// CASE over a string: its labels are texts, compared in order.
    fn case_of_texts(&mut self, selector: Operand, arms: &'a [(Vec<CaseLabel>, Vec<Stmt>)], otherwise: Option<&'a [Stmt]>) {
        let end = self.b.block();
        for (labels, body) in arms {
            let (then, next) = (self.b.block(), self.b.block());
            for label in labels {
                let CaseLabel::Value(e) = label else {
                    let span = if let CaseLabel::Range(low, high) = label { low.span.to(high.span) } else { selector.span };
                    self.report(Code::TypeMismatch, span, "a CASE over a string has no ranges");
                    continue;
                };
                let text = self.expr(e);
                if !text.is_error() && !matches!(text.kind, Kind::Const(_)) {
                    self.report(Code::NotConstant, e.span, "a CASE label must be a constant");
                }
                let hit = self.binary(takt_syntax::tree::BinaryOp::Eq, selector.clone(), text, e.span);
                let cond = self.value(&hit);
                let other = self.b.block();
                self.b.end(Term::Branch { cond, then, other });
                self.b.go_to(other);
            }
            self.b.end(Term::Jump(next));
            self.b.go_to(then);
            self.statements(body);
            self.b.end(Term::Jump(end));
            self.b.go_to(next);
        }
        self.statements(otherwise.unwrap_or_default());
        self.b.continue_in(end);
    }

    fn case_ranges(&mut self, word: Local, ranges: &[(i128, i128, BlockId)], ty: TypeId, span: Span) {
        let site = self.site(span);
        let unsigned = self.scalar(ty).is_some_and(is_unsigned_64);
        for (low, high, block) in ranges {
            let (low, high) = (self.b.int(*low as i64), self.b.int(*high as i64));
            let (ge, le) = if unsigned { (Op::GeU, Op::LeU) } else { (Op::Ge, Op::Le) };
            let above = self.b.op(ge, &[word, low], site);
            let below = self.b.op(le, &[word, high], site);
            let cond = self.b.op(Op::And, &[above, below], site);
            let next = self.b.block();
            self.b.end(Term::Branch { cond, then: *block, other: next });
            self.b.go_to(next);
        }
    }

    fn case_label(&mut self, label: &'a CaseLabel, ty: TypeId, usable: bool) -> Option<(i128, i128, Span)> {
        let (low, high) = match label {
            CaseLabel::Value(e) => (e, e),
            CaseLabel::Range(low, high) => (low, high),
        };
        let low_value = self.label_value(low, ty, usable)?;
        let high_value = if std::ptr::eq(low, high) { low_value } else { self.label_value(high, ty, usable)? };
        if low_value > high_value {
            self.report(Code::OutOfRange, low.span.to(high.span), format!("the range {low_value}..{high_value} is empty"));
            return None;
        }
        Some((low_value, high_value, low.span.to(high.span)))
    }

    fn label_value(&mut self, e: &'a Expr, ty: TypeId, usable: bool) -> Option<i128> {
        let operand = self.expr(e);
        if operand.is_error() || !usable {
            return None;
        }
        if !matches!(operand.kind, Kind::Const(_)) {
            self.report(Code::NotConstant, e.span, "a CASE label must be a constant");
            return None;
        }
        match self.convert(operand, ty).kind {
            Kind::Const(Value::Int(v)) => Some(v),
            _ => None,
        }
    }

    fn while_statement(&mut self, cond: &'a Expr, body: &'a [Stmt], span: Span) {
        let (head, inside, exit) = (self.b.block(), self.b.block(), self.b.block());
        self.b.continue_in(head);
        let cond = self.condition(cond);
        self.b.end(Term::Branch { cond, then: inside, other: exit });
        self.b.go_to(inside);
        self.loops.push(Loop { exit, next: head });
        let next = self.b.block();
        if let Some(last) = self.loops.last_mut() {
            last.next = next;
        }
        self.statements(body);
        self.loops.pop();
        self.b.continue_in(next);
        self.jump_back(head, span);
        self.b.go_to(exit);
    }

    fn repeat_statement(&mut self, body: &'a [Stmt], until: &'a Expr, span: Span) {
        let (inside, next, exit) = (self.b.block(), self.b.block(), self.b.block());
        self.b.continue_in(inside);
        self.loops.push(Loop { exit, next });
        self.statements(body);
        self.loops.pop();
        self.b.continue_in(next);
        let cond = self.condition(until);
        let again = self.b.block();
        self.b.end(Term::Branch { cond, then: exit, other: again });
        self.b.go_to(again);
        self.jump_back(inside, span);
        self.b.go_to(exit);
    }

    fn for_statement(&mut self, var: &'a Expr, from: &'a Expr, to: &'a Expr, by: Option<&'a Expr>, body: &'a [Stmt], span: Span) {
        let control = self.expr(var);
        let elem = match self.class(control.ty) {
            Class::Int(e) => Some(e),
            _ => {
                if !control.is_error() {
                    let name = self.operand_name(&control);
                    self.report(Code::TypeMismatch, var.span, format!("the variable of FOR must be an integer, found {name}"));
                }
                None
            }
        };
        let start = self.expr(from);
        let start_ok = self.integer_operand(&start, "the start of FOR");
        if let (Some(_), true) = (elem, start_ok) {
            self.assign(control.clone(), start);
        }
        let elem = elem.unwrap_or(Elem::Dint);
        let (inside, next, exit) = (self.b.block(), self.b.block(), self.b.block());
        let value = self.value(&control);
        let more = self.for_condition(value, to, by, elem, span);
        self.b.end(Term::Branch { cond: more, then: inside, other: exit });
        self.b.go_to(inside);
        self.loops.push(Loop { exit, next });
        self.statements(body);
        self.loops.pop();
        self.b.continue_in(next);
        self.for_step(&control, to, by, elem, inside, exit, span);
        self.b.go_to(exit);
    }

    fn integer_operand(&mut self, operand: &Operand, what: &str) -> bool {
        let ok = matches!(self.class(operand.ty), Class::Int(_)) && !matches!(operand.kind, Kind::Void);
        if !ok && !operand.is_error() {
            let name = self.operand_name(operand);
            self.report(Code::TypeMismatch, operand.span, format!("{what} must be an integer, found {name}"));
        }
        ok
    }

    /// The step's value: `None` for the constant 1.
    fn for_by(&mut self, by: Option<&'a Expr>) -> Operand {
        let lint = self.c.elem(Elem::Lint);
        match by {
            None => {
                let span = Span { file: takt_syntax::FileId(0), start: 0, end: 0 };
                self.constant(Value::Int(1), lint, span)
            }
            Some(e) => {
                let operand = self.expr(e);
                if let Kind::Const(Value::Int(0)) = operand.kind {
                    self.report(Code::OutOfRange, e.span, "a step of 0 never ends");
                }
                self.integer_operand(&operand, "the step of FOR");
                operand
            }
        }
    }

    /// Whether a value (in 64 bits) is not beyond the end.
    fn for_condition(&mut self, value: Local, to: &'a Expr, by: Option<&'a Expr>, elem: Elem, span: Span) -> Local {
        let site = self.site(span);
        let end = self.expr(to);
        self.integer_operand(&end, "the end of FOR");
        let end = self.value(&end);
        let (le, ge) = if is_unsigned_64(elem) { (Op::LeU, Op::GeU) } else { (Op::Le, Op::Ge) };
        let step = self.for_by(by);
        match step.kind {
            Kind::Const(Value::Int(v)) if v >= 0 => self.b.op(le, &[value, end], site),
            Kind::Const(_) => self.b.op(ge, &[value, end], site),
            _ => {
                let step = self.value(&step);
                let zero = self.b.int(0);
                let up = self.b.op(Op::Ge, &[step, zero], site);
                let below = self.b.op(le, &[value, end], site);
                let above = self.b.op(ge, &[value, end], site);
                self.b.op(Op::Select, &[up, below, above], site)
            }
        }
    }

    /// Adds the step in 64 bits, stores it cut, and goes on if the uncut value is not beyond the end.
    #[allow(clippy::too_many_arguments, reason = "the parts of one statement")]
    fn for_step(&mut self, control: &Operand, to: &'a Expr, by: Option<&'a Expr>, elem: Elem, inside: BlockId, exit: BlockId, span: Span) {
        let site = self.site(span);
        let old = self.value(control);
        let before = self.b.local(Ty::I64);
        self.b.push(Inst::Copy { dst: before, src: old });
        let step = self.for_by(by);
        let up = match &step.kind {
            Kind::Const(Value::Int(v)) => Some(*v >= 0),
            _ => None,
        };
        let step = self.value(&step);
        let sum = self.b.op(Op::Add, &[before, step], site);
        if let Kind::Place(place) = control.kind.clone() {
            self.store(&place, control.ty, sum, false, span);
        }
        let mut more = self.for_condition(sum, to, by, elem, span);
        if range(elem).1 > i128::from(u32::MAX) {
            let wrapped = self.wrapped(before, sum, step, up, elem, span);
            more = self.b.op(Op::And, &[more, wrapped], site);
        }
        let again = self.b.block();
        self.b.end(Term::Branch { cond: more, then: again, other: exit });
        self.b.go_to(again);
        self.jump_back(inside, span);
    }

    /// 1 unless the 64-bit sum passed the limit of its type.
    fn wrapped(&mut self, before: Local, sum: Local, step: Local, up: Option<bool>, elem: Elem, span: Span) -> Local {
        let site = self.site(span);
        let (gt, lt) = if is_unsigned_64(elem) { (Op::GtU, Op::LtU) } else { (Op::Gt, Op::Lt) };
        match up {
            Some(true) => self.b.op(gt, &[sum, before], site),
            Some(false) => self.b.op(lt, &[sum, before], site),
            None => {
                let zero = self.b.int(0);
                let rising = self.b.op(Op::Ge, &[step, zero], site);
                let above = self.b.op(gt, &[sum, before], site);
                let below = self.b.op(lt, &[sum, before], site);
                self.b.op(Op::Select, &[rising, above, below], site)
            }
        }
    }
}
