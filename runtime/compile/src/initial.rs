//! Initial values: bytes where they are constant, statements of the start body where they are not.

use crate::constant::{Value, store};
use crate::expression::{Kind, Lowering, Operand};
use crate::scope::{Progress, key, same};
use crate::unit::Compiler;
use std::rc::Rc;
use takt_ir::{Base, Inst, StructKind, Type, TypeId};
use takt_syntax::tree::{self, Init, InitItem};
use takt_syntax::{Code, FileId, Span};

/// What is set by code at the start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Late<'a> {
    pub(crate) offset: u32,
    pub(crate) ty: TypeId,
    pub(crate) what: What<'a>,
}

/// What is set by code.
#[derive(Debug, Clone, Copy)]
pub(crate) enum What<'a> {
    /// To the value of an expression.
    Expr(&'a tree::Expr),
    /// By the instances themselves: members, FB_Init with the arguments of the declaration, initial values of the declaration.
    Construct(&'a tree::VarDecl),
}

/// Bytes of initial values that a variable or a type has at the most. Zeros at the end are not counted.
pub(crate) const LARGEST_INITIAL: u64 = 256 << 20;

/// Initial bytes being written, and what cannot be bytes.
pub(crate) struct Target<'a, 'b> {
    /// The unit whose names the expressions may use.
    pub(crate) pou: Option<usize>,
    /// As many as have been written; 0 behind them.
    pub(crate) bytes: &'b mut Vec<u8>,
    pub(crate) late: &'b mut Vec<Late<'a>>,
}

impl Target<'_, '_> {
    /// Room for a value. `None`: it is behind [`LARGEST_INITIAL`].
    fn room(&mut self, at: u32, size: usize) -> Option<&mut [u8]> {
        let (start, end) = (at as usize, at as usize + size);
        if end as u64 > LARGEST_INITIAL {
            return None;
        }
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        self.bytes.get_mut(start..end)
    }
}

/// What is left of an array: the next element's offset, the end, bytes per element.
struct Room {
    next: u32,
    end: u32,
    size: u32,
}

/// A constant, something else, or an error that has been reported.
pub(crate) enum Known {
    Value(Value),
    Dynamic,
    Error,
}

impl Late<'_> {
    pub(crate) fn span(&self) -> Span {
        match self.what {
            What::Expr(expr) => expr.span,
            What::Construct(decl) => decl.name.span,
        }
    }
}

impl<'a> Compiler<'a> {
    /// Lowers `expr` apart and tells whether it is constant. With `want`, converted to it.
    pub(crate) fn known(&mut self, expr: &'a tree::Expr, pou: Option<usize>, want: Option<TypeId>) -> (Known, TypeId) {
        let mut lowering = Lowering::scratch(self, pou);
        lowering.imagine_instance();
        let mut operand = lowering.expr(expr);
        if let Some(want) = want {
            operand = lowering.convert(operand, want);
        }
        let Operand { ty, kind, .. } = operand;
        let known = match kind {
            Kind::Const(value) => Known::Value(value),
            Kind::Error => Known::Error,
            _ => Known::Dynamic,
        };
        (known, ty)
    }

    /// An integer constant; reports what is none.
    pub(crate) fn constant_int(&mut self, expr: &'a tree::Expr, pou: Option<usize>) -> Option<i128> {
        match self.known(expr, pou, None).0 {
            Known::Value(Value::Int(v)) => Some(v),
            Known::Error => None,
            Known::Value(_) => {
                self.report(Code::TypeMismatch, expr.span, "expected an integer constant");
                None
            }
            Known::Dynamic => {
                self.report(Code::NotConstant, expr.span, "expected a constant, found a variable or call");
                None
            }
        }
    }

    /// Whether constants of a type have a [`Value`]: scalars and strings.
    pub(crate) fn folds(&self, ty: TypeId) -> bool {
        !matches!(
            self.types.get(ty),
            Type::Array { .. } | Type::Struct(_) | Type::Error | Type::Pointer(_) | Type::Reference(_) | Type::Interface(_)
        )
    }

    /// The value of a scalar or string CONSTANT.
    pub(crate) fn constant_of(&mut self, decl: &'a tree::VarDecl, ty: TypeId, pou: Option<usize>) -> Option<Value> {
        let Some(Init::Expr(expr)) = &decl.init else { return None };
        if !self.folds(ty) {
            return None;
        }
        match self.known(expr, pou, Some(ty)).0 {
            Known::Value(v) => Some(v),
            Known::Error => None,
            Known::Dynamic => {
                self.report(Code::NotConstant, expr.span, format!("the value of the constant `{}` is not constant", decl.name.text));
                None
            }
        }
    }

    /// Initial bytes of a type, without zeros at their end. `None`: all are 0, or [`Compiler::initial_fits`] does not hold.
    pub(crate) fn type_bytes(&mut self, ty: TypeId) -> Option<Rc<Vec<u8>>> {
        if let Some(bytes) = self.type_init.get(&ty) {
            return Some(bytes.clone());
        }
        match self.types.get(ty).clone() {
            Type::Array { elem, .. } => {
                let one = self.type_bytes(elem)?;
                let (all, each) = (self.types.size(ty), self.types.size(elem).max(1));
                let mut bytes = Vec::new();
                if u64::from(all) <= LARGEST_INITIAL && !one.is_empty() {
                    bytes.reserve_exact(all as usize);
                    for _ in 0..all / each {
                        bytes.extend_from_slice(&one);
                        bytes.resize(bytes.len().next_multiple_of(each as usize), 0);
                    }
                }
                let bytes = Rc::new(bytes);
                self.type_init.insert(ty, bytes.clone());
                Some(bytes)
            }
            Type::Subrange { base, low, high } if !(low..=high).contains(&0) => {
                let mut bytes = vec![0; takt_ir::elem_size(base) as usize];
                store(&Value::Int(low), base, &mut bytes);
                Some(Rc::new(bytes))
            }
            _ => None,
        }
    }

    /// Whether there is memory for the initial values of a type, while the program is compiled; reports it.
    pub(crate) fn initial_fits(&mut self, ty: TypeId, span: Span) -> bool {
        // An array whose elements are not 0 and that is too large has a template without bytes.
        let empty = self.type_bytes(ty).is_some_and(|bytes| bytes.is_empty());
        if empty {
            self.too_much(span);
        }
        !empty
    }

    fn too_much(&mut self, span: Span) {
        self.report(Code::TooLarge, span, "its initial values take more than 256 MiB").help =
            Some("let a loop of the program set them, or declare it behind the variables that are smaller".into());
    }

    /// Writes a variable's initial value at `at`: its type's, then its own. What is not constant goes to `late`.
    pub(crate) fn fill(&mut self, decl: &'a tree::VarDecl, ty: TypeId, at: u32, target: &mut Target<'a, '_>) {
        if !self.initial_fits(ty, decl.name.span) {
            return;
        }
        if let Some(template) = self.type_bytes(ty) {
            match target.room(at, template.len()) {
                Some(bytes) => bytes.copy_from_slice(&template),
                None => return self.too_much(decl.name.span),
            }
        }
        let alias = match &decl.ty.kind {
            tree::TypeExprKind::Named(parts) => parts.last().and_then(|n| self.alias_init(&n.text)),
            _ => None,
        };
        if let Some(init) = decl.init.as_ref().or(alias) {
            self.overlay(init, ty, at, target);
        }
        if self.constructs(ty) {
            target.late.push(Late { offset: at, ty, what: What::Construct(decl) });
        }
    }

    /// The initial value that a type alias gives its variables.
    fn alias_init(&mut self, name: &str) -> Option<&'a Init> {
        let Some(crate::scope::Item::Type(i)) = self.global_name(name) else { return None };
        match &self.declared[i].tree.kind {
            tree::TypeKind::Alias { init, .. } if self.declared[i].state == Progress::Done => init.as_ref(),
            _ => None,
        }
    }

    fn overlay(&mut self, init: &'a Init, ty: TypeId, at: u32, target: &mut Target<'a, '_>) {
        if *self.types.get(ty) == Type::Error {
            return;
        }
        match init {
            Init::Expr(expr) => {
                self.overlay_expr(expr, ty, at, target);
            }
            Init::Array(items, span) => self.overlay_array(items, ty, at, target, *span),
            Init::Struct(members, span) => self.overlay_struct(members, ty, at, target, *span),
        }
    }

    /// False if the expression is wrong.
    fn overlay_expr(&mut self, expr: &'a tree::Expr, ty: TypeId, at: u32, target: &mut Target<'a, '_>) -> bool {
        if let Type::Reference(_) = self.types.get(ty) {
            target.late.push(Late { offset: at, ty, what: What::Expr(expr) });
            return true;
        }
        let bit = match *self.types.get(ty) {
            Type::Bit(bit) => Some(bit),
            _ => None,
        };
        let wanted = if bit.is_some() { self.elem(takt_abi::Elem::Bool) } else { ty };
        match self.known(expr, target.pou, Some(wanted)).0 {
            Known::Value(value) if value.is_zero() && at as usize >= target.bytes.len() => {}
            Known::Value(value) => {
                let Some(bytes) = target.room(at, self.types.size(ty) as usize) else {
                    self.too_much(expr.span);
                    return false;
                };
                match bit {
                    Some(bit) => bytes[0] = bytes[0] & !(1 << bit) | u8::from(value.word() != 0) << bit,
                    None => self.store_value(&value, ty, bytes),
                }
            }
            Known::Dynamic => target.late.push(Late { offset: at, ty, what: What::Expr(expr) }),
            Known::Error => return false,
        }
        true
    }

    fn overlay_array(&mut self, items: &'a [InitItem], ty: TypeId, at: u32, target: &mut Target<'a, '_>, span: Span) {
        let Type::Array { elem, dims } = self.types.get(ty).clone() else {
            let name = self.types.name(ty);
            self.report(Code::BadInitializer, span, format!("expected a value of type `{name}`, found a list"));
            return;
        };
        // A list of lists gives the rows of an array of several dimensions.
        let nested = |item: &InitItem| match item {
            InitItem::One(init) => matches!(init, Init::Array(..)),
            InitItem::Repeat(_, inits) => inits.iter().all(|init| matches!(init, Init::Array(..))),
        };
        let elem = match &dims[..] {
            [_, rest @ ..] if !rest.is_empty() && items.iter().all(nested) => self.types.intern(Type::Array { elem, dims: rest.to_vec() }),
            _ => elem,
        };
        let mut room = Room { next: at, end: at + self.types.size(ty), size: self.types.size(elem).max(1) };
        for item in items {
            if self.overlay_item(item, elem, &mut room, target, span).is_none() {
                return;
            }
        }
    }

    /// `None` if the list cannot go on.
    fn overlay_item(&mut self, item: &'a InitItem, elem: TypeId, room: &mut Room, target: &mut Target<'a, '_>, span: Span) -> Option<()> {
        if let InitItem::One(Init::Expr(expr)) = item
            && let Some((count, value)) = self.named_repeat(expr, target.pou)
        {
            let count = self.repetitions(count, 1, room, span)?;
            for _ in 0..count {
                if value.is_some_and(|expr| !self.overlay_expr(expr, elem, room.next, target)) {
                    return None;
                }
                room.next += room.size;
            }
            return Some(());
        }
        let (count, values) = match item {
            InitItem::One(init) => (1, std::slice::from_ref(init)),
            InitItem::Repeat(count, values) => (self.constant_int(count, target.pou)?, values.as_slice()),
        };
        let count = self.repetitions(count, values.len(), room, span)?;
        let start = room.next;
        for init in values {
            self.overlay(init, elem, room.next, target);
            room.next += room.size;
        }
        let stride = if values.is_empty() { room.size } else { room.next - start };
        let copies = count.saturating_sub(u32::from(!values.is_empty()));
        // Zeros behind what has been written are there already.
        if !values.is_empty() && (start as usize) < target.bytes.len() {
            let Some(bytes) = target.room(start, (copies as usize + 1) * stride as usize) else {
                self.too_much(span);
                return None;
            };
            for i in 1..=copies as usize {
                bytes.copy_within(..stride as usize, i * stride as usize);
            }
        }
        room.next += copies * stride;
        Some(())
    }

    /// How often a list of `width` values is written, if there is room.
    fn repetitions(&mut self, count: i128, width: usize, room: &Room, span: Span) -> Option<u32> {
        let most = (room.end - room.next) / room.size;
        let needed = count.saturating_mul(width.max(1) as i128);
        if count < 0 {
            self.report(Code::BadInitializer, span, format!("a repetition counts from 0, found {count}"));
        } else if needed > most.into() {
            self.report(
                Code::BadInitializer,
                span,
                format!("the list is longer than the array: there is room for {most} more, found {needed}"),
            );
        } else {
            return Some(count as u32);
        }
        None
    }

    /// `N(x)` with a constant N: a repetition that reads like a call.
    fn named_repeat(&mut self, expr: &'a tree::Expr, pou: Option<usize>) -> Option<(i128, Option<&'a tree::Expr>)> {
        let tree::ExprKind::Call(callee, args) = &expr.kind else { return None };
        let tree::ExprKind::Name(name) = &callee.kind else { return None };
        let local = pou.is_some_and(|p| self.pous[p].index.contains_key(&key(name)));
        if !local && !matches!(self.global_name(name), Some(crate::scope::Item::Global(_))) {
            return None;
        }
        let count = self.constant_int(callee, pou)?;
        Some((count, args.first().and_then(|a| a.value.as_ref())))
    }

    fn overlay_struct(&mut self, members: &'a [(tree::Name, Init)], ty: TypeId, at: u32, target: &mut Target<'a, '_>, span: Span) {
        let Type::Struct(structure) = self.types.get(ty).clone() else {
            let name = self.types.name(ty);
            self.report(Code::BadInitializer, span, format!("expected a value of type `{name}`, found a structure"));
            return;
        };
        for (name, init) in members {
            let Some(field) = structure.fields.iter().find(|f| same(&f.name, &name.text)) else {
                let near = crate::near::nearest(&key(&name.text), structure.fields.iter().map(|f| key(&f.name)));
                let near = near.and_then(|n| structure.fields.iter().find(|f| key(&f.name) == n).map(|f| f.name.clone()));
                self.report(Code::UnknownMember, name.span, format!("`{}` has no member `{}`", structure.name, name.text)).help =
                    near.map(|n| format!("did you mean `{n}`?"));
                continue;
            };
            if structure.kind == StructKind::Block && field.section == takt_abi::Section::InOut {
                self.report(Code::BadInitializer, name.span, format!("`{}` is a VAR_IN_OUT and gets its variable at each call", name.text));
                continue;
            }
            self.overlay(init, field.ty, at + field.offset, target);
        }
    }

    /// Writes a constant of the type of its place.
    pub(crate) fn store_value(&mut self, value: &Value, ty: TypeId, bytes: &mut [u8]) {
        match (self.types.get(ty), value) {
            (Type::Elem(e) | Type::Subrange { base: e, .. }, v) => store(v, *e, bytes),
            (Type::Enum(e), v) => store(v, e.base, bytes),
            (Type::Pointer(_) | Type::Reference(_) | Type::Interface(_), Value::Int(v)) => {
                bytes[..8].copy_from_slice(&(*v as u64).to_le_bytes())
            }
            (Type::String(n), Value::Text(text)) => {
                let len = text.len().min(*n as usize);
                bytes[..=*n as usize].fill(0);
                bytes[..len].copy_from_slice(&text[..len]);
            }
            (Type::WString(n), Value::Wide(text)) => {
                bytes[..2 * (*n as usize + 1)].fill(0);
                for (i, unit) in text.iter().take(*n as usize).enumerate() {
                    bytes[2 * i..2 * i + 2].copy_from_slice(&unit.to_le_bytes());
                }
            }
            _ => {}
        }
    }

    /// The body that sets what is not bytes.
    pub(crate) fn initialise(&mut self) {
        let late = std::mem::take(&mut self.late);
        let first = late.first().map(|(.., late)| late.span());
        let Some(span) = first.or(self.far.first().map(|_| Span { file: FileId(0), start: 0, end: 0 })) else { return };
        let id = self.reserve("(initial values)", span);
        let far = std::mem::take(&mut self.far);
        let mut lowering = Lowering::new(self, id, "(initial values)", None, span);
        for (offset, bytes) in far {
            let (data, len) = (lowering.pool(&bytes), bytes.len() as u32);
            lowering.b.push(Inst::Data { dst: Base::Image, offset, data, len });
        }
        for (pou, home, late) in late {
            lowering.enter(pou);
            lowering.c.home = home;
            lowering.set_late(Base::Image, 0, late);
        }
        let body = lowering.finish();
        self.program.bodies[id.0 as usize] = body;
        self.program.init_body = Some(id);
    }
}
