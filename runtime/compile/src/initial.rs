//! Initial values: bytes where they are constant, statements of the start body where they are not.

use crate::constant::{Value, store};
use crate::expression::{Kind, Lowering, Operand};
use crate::scope::{Progress, key};
use crate::unit::Compiler;
use std::rc::Rc;
use takt_ir::{Base, StructKind, Type, TypeId};
use takt_syntax::tree::{self, Init, InitItem};
use takt_syntax::{Code, Span};

/// An initial value that is set by code.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Late<'a> {
    pub(crate) offset: u32,
    pub(crate) ty: TypeId,
    pub(crate) expr: &'a tree::Expr,
    pub(crate) pou: Option<usize>,
}

/// A constant, something else, or an error that has been reported.
pub(crate) enum Known {
    Value(Value),
    Dynamic,
    Error,
}

impl<'a> Compiler<'a> {
    /// Lowers `expr` apart and tells whether it is constant. With `want`, converted to it.
    pub(crate) fn known(&mut self, expr: &'a tree::Expr, pou: Option<usize>, want: Option<TypeId>) -> (Known, TypeId) {
        let mut lowering = Lowering::scratch(self, pou);
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

    /// The value of a scalar or string CONSTANT.
    pub(crate) fn constant_of(&mut self, decl: &'a tree::VarDecl, ty: TypeId, pou: Option<usize>) -> Option<Value> {
        let Some(Init::Expr(expr)) = &decl.init else { return None };
        if matches!(self.types.get(ty), Type::Array { .. } | Type::Struct(_) | Type::Error | Type::Pointer(_) | Type::Reference(_)) {
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

    /// Initial bytes of a type.
    pub(crate) fn type_bytes(&mut self, ty: TypeId) -> Option<Rc<Vec<u8>>> {
        if let Some(bytes) = self.type_init.get(&ty) {
            return Some(bytes.clone());
        }
        match self.types.get(ty).clone() {
            Type::Array { elem, .. } => {
                let one = self.type_bytes(elem)?;
                let count = self.types.size(ty) as usize / one.len().max(1);
                let bytes = Rc::new(one.repeat(count));
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

    /// Writes a variable's initial value at `at`: its type's, then its own. What is not constant goes to `late`.
    pub(crate) fn fill(
        &mut self,
        decl: &'a tree::VarDecl,
        ty: TypeId,
        pou: Option<usize>,
        bytes: &mut [u8],
        at: u32,
        late: &mut Vec<(u32, TypeId, &'a tree::Expr)>,
    ) {
        if let Some(template) = self.type_bytes(ty) {
            bytes[at as usize..at as usize + template.len()].copy_from_slice(&template);
        }
        let alias = match &decl.ty.kind {
            tree::TypeExprKind::Named(parts) => parts.last().and_then(|n| self.alias_init(&n.text)),
            _ => None,
        };
        if let Some(init) = decl.init.as_ref().or(alias) {
            self.overlay(init, ty, pou, bytes, at, late, decl.name.span);
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

    #[allow(clippy::too_many_arguments, reason = "the walk over an initialiser carries its place")]
    pub(crate) fn overlay(
        &mut self,
        init: &'a Init,
        ty: TypeId,
        pou: Option<usize>,
        bytes: &mut [u8],
        at: u32,
        late: &mut Vec<(u32, TypeId, &'a tree::Expr)>,
        span: Span,
    ) {
        if *self.types.get(ty) == Type::Error {
            return;
        }
        match init {
            Init::Expr(expr) => match self.known(expr, pou, Some(ty)).0 {
                Known::Value(value) => self.store_value(&value, ty, &mut bytes[at as usize..]),
                Known::Dynamic => late.push((at, ty, expr)),
                Known::Error => {}
            },
            Init::Array(items, span) => {
                let Type::Array { elem, .. } = *self.types.get(ty) else {
                    let name = self.types.name(ty);
                    self.report(Code::BadInitializer, *span, format!("expected a value of type `{name}`, found a list"));
                    return;
                };
                let size = self.types.size(elem).max(1);
                let end = at + self.types.size(ty);
                let mut next = at;
                for item in items {
                    if !self.overlay_item(item, elem, pou, bytes, (&mut next, end, size), late, *span) {
                        return;
                    }
                }
            }
            Init::Struct(members, span) => self.overlay_struct(members, ty, pou, bytes, at, late, *span),
        }
        let _ = span;
    }

    #[allow(clippy::too_many_arguments, reason = "the walk over an initialiser carries its place")]
    fn overlay_item(
        &mut self,
        item: &'a InitItem,
        elem: TypeId,
        pou: Option<usize>,
        bytes: &mut [u8],
        (next, end, size): (&mut u32, u32, u32),
        late: &mut Vec<(u32, TypeId, &'a tree::Expr)>,
        span: Span,
    ) -> bool {
        if let InitItem::One(Init::Expr(expr)) = item
            && let Some((count, value)) = self.named_repeat(expr, pou)
        {
            return self.overlay_named_repeat(count, value, elem, pou, bytes, (next, end, size), late, span);
        }
        let (count, values) = match item {
            InitItem::One(init) => (1, std::slice::from_ref(init)),
            InitItem::Repeat(count, values) => match self.constant_int(count, pou) {
                Some(n) if n >= 0 => (n.min(i128::from(u32::MAX)) as u64, values.as_slice()),
                Some(n) => {
                    self.report(Code::BadInitializer, count.span, format!("a repetition counts from 0, found {n}"));
                    return false;
                }
                None => return false,
            },
        };
        let width = values.len().max(1) as u64;
        if count.saturating_mul(width).saturating_mul(size.into()) > u64::from(end - *next) {
            let most = (end - *next) / size;
            self.report(
                Code::BadInitializer,
                span,
                format!("the list is longer than the array: there is room for {most} more, found {}", count.saturating_mul(width)),
            );
            return false;
        }
        let Some(_) = values.first() else {
            *next += count as u32 * size;
            return true;
        };
        let start = *next;
        for init in values {
            self.overlay(init, elem, pou, bytes, *next, late, span);
            *next += size;
        }
        let stride = (*next - start) as usize;
        for i in 1..count as usize {
            let from = start as usize;
            bytes.copy_within(from..from + stride, from + i * stride);
            *next += stride as u32;
        }
        true
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

    #[allow(clippy::too_many_arguments, reason = "the walk over an initialiser carries its place")]
    fn overlay_named_repeat(
        &mut self,
        count: i128,
        value: Option<&'a tree::Expr>,
        elem: TypeId,
        pou: Option<usize>,
        bytes: &mut [u8],
        (next, end, size): (&mut u32, u32, u32),
        late: &mut Vec<(u32, TypeId, &'a tree::Expr)>,
        span: Span,
    ) -> bool {
        if count < 0 || count * i128::from(size) > i128::from(end - *next) {
            let most = (end - *next) / size;
            self.report(Code::BadInitializer, span, format!("there is room for {most} more elements, found {count}"));
            return false;
        }
        for _ in 0..count {
            if let Some(expr) = value {
                match self.known(expr, pou, Some(elem)).0 {
                    Known::Value(value) => self.store_value(&value, elem, &mut bytes[*next as usize..]),
                    Known::Dynamic => late.push((*next, elem, expr)),
                    Known::Error => return false,
                }
            }
            *next += size;
        }
        true
    }

    #[allow(clippy::too_many_arguments, reason = "the walk over an initialiser carries its place")]
    fn overlay_struct(
        &mut self,
        members: &'a [(tree::Name, Init)],
        ty: TypeId,
        pou: Option<usize>,
        bytes: &mut [u8],
        at: u32,
        late: &mut Vec<(u32, TypeId, &'a tree::Expr)>,
        span: Span,
    ) {
        let Type::Struct(structure) = self.types.get(ty).clone() else {
            let name = self.types.name(ty);
            self.report(Code::BadInitializer, span, format!("expected a value of type `{name}`, found a structure"));
            return;
        };
        for (name, init) in members {
            let Some(field) = structure.fields.iter().find(|f| key(&f.name) == key(&name.text)) else {
                self.report(Code::UnknownMember, name.span, format!("`{}` has no member `{}`", structure.name, name.text));
                continue;
            };
            if structure.kind == StructKind::Block && field.section == takt_abi::Section::InOut {
                self.report(Code::BadInitializer, name.span, format!("`{}` is a VAR_IN_OUT and gets its variable at each call", name.text));
                continue;
            }
            self.overlay(init, field.ty, pou, bytes, at + field.offset, late, name.span);
        }
    }

    /// Writes a constant of the type of its place.
    pub(crate) fn store_value(&mut self, value: &Value, ty: TypeId, bytes: &mut [u8]) {
        match (self.types.get(ty), value) {
            (Type::Elem(e) | Type::Subrange { base: e, .. }, v) => store(v, *e, bytes),
            (Type::Enum(e), v) => store(v, e.base, bytes),
            (Type::Pointer(_) | Type::Reference(_), Value::Int(v)) => bytes[..8].copy_from_slice(&(*v as u64).to_le_bytes()),
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
        let Some(first) = late.first() else { return };
        let id = self.reserve("(initial values)", first.expr.span);
        let mut lowering = Lowering::new(self, id, "(initial values)", None, first.expr.span);
        for Late { offset, ty, expr, pou } in late {
            lowering.enter(pou);
            lowering.set_initial(Base::Image, offset, ty, expr);
        }
        let body = lowering.finish();
        self.program.bodies[id.0 as usize] = body;
        self.program.init_body = Some(id);
    }
}
