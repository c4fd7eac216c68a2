//! Types, variables and layouts, resolved on demand.

use crate::constant::{Value, cut, range};
use crate::layout::{is_bit, kept_key};
use crate::limits::DECLARATION;
use crate::scope::{Item, PouKind, Progress, Storage, Variable, key};
use crate::unit::Compiler;
use rustc_hash::FxHashMap as HashMap;
use std::collections::hash_map::Entry;
use std::rc::Rc;
use std::sync::Arc;
use takt_abi::Elem;
use takt_ir::{Enumeration, StructKind, Type, TypeId};
use takt_syntax::tree::{self, TypeExpr, TypeExprKind, TypeKind, VarKind};
use takt_syntax::{Code, Span};

/// Bytes that one variable may have.
pub(crate) const LARGEST: u64 = 1 << 31;

impl<'a> Compiler<'a> {
    pub(crate) fn error_type(&mut self) -> TypeId {
        self.types.intern(Type::Error)
    }
    pub(crate) fn elem(&mut self, e: Elem) -> TypeId {
        self.types.intern(Type::Elem(e))
    }

    /// Resolves everything that is declared, so that every mistake is found.
    pub(crate) fn resolve_all(&mut self) {
        for i in 0..self.declared.len() {
            let span = self.declared[i].tree.name.span;
            self.declared_type(i, true, span);
        }
        for i in 0..self.pous.len() {
            let span = self.pous[i].tree.name.span;
            self.resolve_pou(i, span);
        }
        for i in 0..self.globals.len() {
            self.resolve_global(i);
        }
    }

    /// The type that is written. With `direct` false (behind a pointer) it need not be complete.
    pub(crate) fn type_expr(&mut self, t: &'a TypeExpr, pou: Option<usize>, direct: bool) -> TypeId {
        match &t.kind {
            TypeExprKind::Named(parts) => self.named_type(parts, t.span, direct),
            TypeExprKind::String(n) => {
                let n = self.string_length(n.as_deref(), pou);
                self.types.intern(Type::String(n))
            }
            TypeExprKind::WString(n) => {
                let n = self.string_length(n.as_deref(), pou);
                self.types.intern(Type::WString(n))
            }
            TypeExprKind::Array { dims, elem } => self.array_type(dims, elem, pou, t.span),
            TypeExprKind::Pointer(to) | TypeExprKind::RefTo(to) | TypeExprKind::Reference(to) if is_bit(to) => {
                self.no_bits(to.span, "a POINTER or REFERENCE leads to no BIT", "BOOL")
            }
            TypeExprKind::Pointer(to) | TypeExprKind::RefTo(to) => {
                let to = self.type_expr(to, pou, false);
                self.types.intern(Type::Pointer(to))
            }
            TypeExprKind::Reference(to) => {
                let to = self.type_expr(to, pou, false);
                self.types.intern(Type::Reference(to))
            }
            TypeExprKind::Subrange { base, low, high } => {
                let low = self.constant_int(low, pou);
                let high = self.constant_int(high, pou);
                match (elementary(&base.text), low, high) {
                    (Some(base), Some(low), Some(high)) => self.types.intern(Type::Subrange { base, low, high }),
                    (None, ..) => {
                        self.report(Code::UnknownType, base.span, format!("`{}` is not an integer type that can have a range", base.text));
                        self.error_type()
                    }
                    _ => self.error_type(),
                }
            }
            TypeExprKind::Enum(body) => {
                let ty = self.enum_type(&format!("(enumeration at {})", t.span.start), body, pou);
                self.declare_enumerators(ty, pou);
                ty
            }
            TypeExprKind::Struct(fields) => {
                let id = self.types.push(Type::Error);
                self.structure(id, "(structure)", fields, StructKind::Struct, None, None)
            }
            TypeExprKind::Generic { .. } => {
                self.report(Code::NotSupported, t.span, "a block with VAR_GENERIC constants is not supported yet");
                self.error_type()
            }
            TypeExprKind::Error => self.error_type(),
        }
    }

    fn no_bits(&mut self, span: Span, message: &str, instead: &str) -> TypeId {
        self.report(Code::TypeMismatch, span, message).help = Some(format!("use {instead}"));
        self.error_type()
    }

    fn string_length(&mut self, n: Option<&'a tree::Expr>, pou: Option<usize>) -> u32 {
        let Some(expr) = n else { return 80 };
        match self.constant_int(expr, pou) {
            Some(n) if (1..=65_535).contains(&n) => n as u32,
            Some(n) => {
                self.report(Code::OutOfRange, expr.span, format!("a string has 1 to 65535 characters, found {n}"));
                80
            }
            None => 80,
        }
    }

    fn array_type(&mut self, dims: &'a [Option<(tree::Expr, tree::Expr)>], elem: &'a TypeExpr, pou: Option<usize>, span: Span) -> TypeId {
        if is_bit(elem) {
            return self.no_bits(elem.span, "an ARRAY has no elements of type BIT", "BOOL, or BYTE and its bits");
        }
        let elem = self.type_expr(elem, pou, true);
        if dims.iter().any(Option::is_none) {
            return self.types.intern(Type::OpenArray { elem, dims: dims.len() as u32 });
        }
        let mut bounds = Vec::new();
        for (low, high) in dims.iter().flatten() {
            let (Some(l), Some(h)) = (self.constant_int(low, pou), self.constant_int(high, pou)) else { return self.error_type() };
            let small = |v: i128| i64::try_from(v).is_ok_and(|v| v.unsigned_abs() < 1 << 40);
            if l > h || !small(l) || !small(h) {
                self.report(Code::OutOfRange, low.span.to(high.span), format!("array bounds {l}..{h} are not a range from low to high"));
                return self.error_type();
            }
            bounds.push((l as i64, h as i64));
        }
        let count = bounds.iter().map(|(l, h)| (h - l + 1) as u64).fold(1u64, u64::saturating_mul);
        if count.saturating_mul(self.types.size(elem).into()) > LARGEST {
            self.report(
                Code::TooLarge,
                span,
                format!("this array has {count} elements and does not fit the memory of an application (2 GiB)"),
            );
            return self.error_type();
        }
        self.types.intern(Type::Array { elem, dims: bounds })
    }

    pub(crate) fn named_type(&mut self, parts: &'a [tree::Name], span: Span, direct: bool) -> TypeId {
        let Some(last) = parts.last() else { return self.error_type() };
        let item = match parts {
            [name] => {
                if let Some(e) = elementary(&name.text) {
                    return self.elem(e);
                }
                if crate::any::is_generic(&name.text) && self.global_name(&name.text).is_none() {
                    return self.any_type(span);
                }
                self.global_name(&name.text)
            }
            _ => self.path_item(parts.iter().map(|name| name.text.as_str())),
        };
        self.item_type(item, last, span, direct)
    }

    fn item_type(&mut self, item: Option<Item>, name: &tree::Name, span: Span, direct: bool) -> TypeId {
        match item {
            Some(Item::Type(i)) => self.declared_type(i, direct, span),
            Some(Item::Ready(ty) | Item::NativeBlock(ty)) => ty,
            Some(Item::Interface(i)) => self.interfaces[i].ty,
            Some(Item::Pou(i)) if matches!(self.pous[i].tree.kind, PouKind::FunctionBlock | PouKind::Program) => {
                if direct {
                    let inside_itself = self.pous[i].state == Progress::Running;
                    self.resolve_pou(i, span);
                    if inside_itself {
                        return self.error_type();
                    }
                }
                self.pou_type(i)
            }
            Some(_) => {
                self.report(Code::UnknownType, name.span, format!("`{}` is not a type", name.text));
                self.error_type()
            }
            None => {
                let help = self.suggest(&name.text, true);
                let diagnostic = self.report(Code::UnknownType, name.span, format!("type `{}` is not declared", name.text));
                diagnostic.help = help;
                self.error_type()
            }
        }
    }

    fn declared_type(&mut self, index: usize, direct: bool, at: Span) -> TypeId {
        let tree = self.declared[index].tree;
        match (self.declared[index].state, self.declared[index].ty) {
            (Progress::Done, Some(ty)) => return ty,
            (Progress::Running, ty) => {
                if let (Some(ty), false) = (ty, direct) {
                    return ty;
                }
                self.contains_itself(&tree.name, at);
                return self.error_type();
            }
            (_, Some(ty)) if !direct => return ty,
            _ => {}
        }
        let is_struct = matches!(tree.kind, TypeKind::Struct { .. } | TypeKind::Union { .. });
        if is_struct && self.declared[index].ty.is_none() {
            let id = self.types.push(Type::Error);
            self.declared[index].ty = Some(id);
            if !direct {
                return id;
            }
        }
        if !self.deeper(DECLARATION, at) {
            return self.error_type();
        }
        self.declared[index].state = Progress::Running;
        let home = std::mem::replace(&mut self.home, self.declared[index].home);
        let own = self.is_of_library(tree.name.span);
        let library = std::mem::replace(&mut self.in_library, own);
        self.inside.push((&tree.name, at));
        let ty = self.define(index, tree);
        self.inside.pop();
        (self.home, self.in_library) = (home, library);
        self.back(DECLARATION);
        self.declared[index].ty = Some(ty);
        self.declared[index].state = Progress::Done;
        ty
    }

    /// A declared type, complete.
    pub(crate) fn resolve_declared(&mut self, index: usize, at: Span) -> TypeId {
        self.declared_type(index, true, at)
    }

    fn define(&mut self, index: usize, tree: &'a tree::TypeDecl) -> TypeId {
        let name = &tree.name.text;
        match &tree.kind {
            TypeKind::Struct { extends, fields } => {
                let id = self.declared[index].ty.expect("given before");
                let base = extends.as_ref().and_then(|base| self.base_structure(id, base));
                self.structure(id, name, fields, StructKind::Struct, base, self.pack_mode(&tree.pragmas))
            }
            TypeKind::Union { fields } => {
                let id = self.declared[index].ty.expect("given before");
                self.structure(id, name, fields, StructKind::Union, None, self.pack_mode(&tree.pragmas))
            }
            TypeKind::Enum(body) => {
                let ty = self.enum_type(name, body, None);
                if tree.pragmas.iter().any(|p| p.name == "strict") {
                    self.strict_enums.insert(ty);
                }
                if tree.pragmas.iter().any(|p| p.name == "to_string") {
                    self.spelled_enums.insert(ty);
                }
                ty
            }
            TypeKind::Alias { ty, .. } => self.type_expr(ty, None, true),
        }
    }

    /// The members of an enumeration that is declared in place are seen where it stands.
    fn declare_enumerators(&mut self, ty: TypeId, pou: Option<usize>) {
        let Type::Enum(e) = self.types.get(ty) else { return };
        for (name, value) in e.members.clone() {
            match pou {
                Some(pou) => drop(self.pous[pou].enumerators.insert(key(&name), (ty, value))),
                None => self.add_bare(false, &name, Item::Enumerator(ty, value)),
            }
        }
    }

    fn enum_type(&mut self, name: &str, body: &'a tree::EnumBody, pou: Option<usize>) -> TypeId {
        let base = match &body.base {
            None => Elem::Int,
            Some(base) => elementary(&base.text).filter(|e| is_integer(*e)).unwrap_or_else(|| {
                self.report(Code::UnknownType, base.span, format!("`{}` is not an integer type", base.text));
                Elem::Int
            }),
        };
        let mut values: HashMap<String, i64> = HashMap::default();
        let mut next = 0i128;
        let mut members: Vec<(String, i64)> = Vec::new();
        for (member, value) in &body.members {
            if let Some(expr) = value {
                next = self.enum_value(expr, pou, &values).unwrap_or(next);
            }
            let value = cut(next, base) as i64;
            if let Entry::Vacant(new) = values.entry(key(&member.text)) {
                new.insert(value);
            } else {
                let first = body.members.iter().find(|(n, _)| key(&n.text) == key(&member.text)).map(|(n, _)| n.span);
                self.declared_twice(member, Some(name).filter(|n| !n.starts_with('(')), first);
            }
            let (low, high) = range(base);
            if !(low..=high).contains(&next) {
                self.report(
                    Code::OutOfRange,
                    member.span,
                    format!("the value {next} of `{}` does not fit the base type `{}`", member.text, takt_ir::elem_name(base)),
                );
            }
            members.push((member.text.clone(), value));
            next += 1;
        }
        let init = match &body.init {
            Some(expr) => self.enum_value(expr, pou, &values),
            None => members.first().map(|(_, v)| i128::from(*v)),
        };
        let ty = self.types.intern(Type::Enum(Arc::new(Enumeration { name: name.into(), base, members })));
        if let Some(init) = init.filter(|v| *v != 0) {
            let mut bytes = vec![0; takt_ir::elem_size(base) as usize];
            crate::constant::store(&Value::Int(init), base, &mut bytes);
            self.type_init.insert(ty, Rc::new(bytes));
        }
        ty
    }

    /// The value of an enumerator, which may name those before it.
    fn enum_value(&mut self, expr: &'a tree::Expr, pou: Option<usize>, before: &HashMap<String, i64>) -> Option<i128> {
        if let tree::ExprKind::Name(name) = &expr.kind
            && let Some(value) = before.get(&key(name))
        {
            return Some((*value).into());
        }
        self.constant_int(expr, pou)
    }

    /// A variable's type; `ARRAY[*]` is only for VAR_IN_OUT.
    pub(crate) fn variable_type(&mut self, decl: &'a tree::VarDecl, pou: Option<usize>) -> TypeId {
        let ty = self.type_expr(&decl.ty, pou, true);
        if let Type::OpenArray { .. } = self.types.get(ty) {
            self.report(Code::TypeMismatch, decl.ty.span, "ARRAY[*] is only possible as VAR_IN_OUT");
            return self.error_type();
        }
        self.check_arguments_of_init(decl, ty);
        if let Some(name) = self.abstract_block(ty) {
            self.report(Code::Abstract, decl.ty.span, format!("`{name}` is ABSTRACT and has no instances")).help =
                Some(format!("declare a block that extends it, or `REFERENCE TO {name}`"));
        }
        ty
    }

    /// Type id of a block or program; complete once [`Compiler::resolve_pou`] has run.
    pub(crate) fn pou_type(&mut self, index: usize) -> TypeId {
        if let Some(ty) = self.pous[index].ty {
            return ty;
        }
        let ty = self.types.push(Type::Error);
        self.pous[index].ty = Some(ty);
        self.pou_of_type.insert(ty, index);
        ty
    }

    /// Resolves variables, signature and layout of a unit.
    pub(crate) fn resolve_pou(&mut self, index: usize, at: Span) {
        match self.pous[index].state {
            Progress::Done => return,
            Progress::Running => {
                if matches!(self.pous[index].tree.kind, PouKind::FunctionBlock | PouKind::Program) {
                    self.contains_itself(self.pous[index].tree.name, at);
                }
                return;
            }
            Progress::Untouched => {}
        }
        if !self.deeper(DECLARATION, at) {
            return;
        }
        self.pous[index].state = Progress::Running;
        let home = std::mem::replace(&mut self.home, self.pous[index].home);
        let library = std::mem::replace(&mut self.in_library, self.pous[index].library);
        let tree = self.pous[index].tree;
        for other in [self.pous[index].base, self.owner_of(index)].into_iter().flatten() {
            if self.pous[other].state == Progress::Untouched || self.pous[index].base == Some(other) {
                self.resolve_pou(other, at);
            }
        }
        self.inside.push((tree.name, at));
        self.pous[index].result = tree.result.map(|t| self.type_expr(t, Some(index), true));
        for block in tree.vars {
            for decl in &block.vars {
                if !block.constant || self.begin_constant(index, decl) {
                    self.declare_variable(index, block, decl);
                }
            }
        }
        if matches!(tree.kind, PouKind::FunctionBlock | PouKind::Program) {
            self.lay_out_instance(index);
        }
        self.inside.pop();
        (self.home, self.in_library) = (home, library);
        self.back(DECLARATION);
        self.pous[index].state = Progress::Done;
    }

    pub(crate) fn declare_variable(&mut self, index: usize, block: &'a tree::VarBlock, decl: &'a tree::VarDecl) {
        if block.kind == VarKind::External {
            if self.global_name(&decl.name.text).is_none() {
                self.report(
                    Code::UnknownName,
                    decl.name.span,
                    format!("there is no global variable `{}` for this VAR_EXTERNAL", decl.name.text),
                );
            }
            return;
        }
        if let Some(first) = self.pous[index].index.get(&key(&decl.name.text)) {
            let first = self.pous[index].vars[*first].span;
            return self.declared_twice(&decl.name, None, Some(first));
        }
        let ty =
            if block.kind == VarKind::InOut { self.type_expr(&decl.ty, Some(index), true) } else { self.variable_type(decl, Some(index)) };
        let instance = matches!(self.pous[index].tree.kind, PouKind::FunctionBlock | PouKind::Program).then(|| self.pou_type(index));
        self.note_address(decl, ty, block.constant, crate::address::Section::Unit(block.kind, instance));
        let value = if block.constant && decl.init.is_some() { self.constant_of(decl, ty, Some(index)) } else { None };
        let position = self.pous[index].vars.len();
        let storage = match (block.kind, self.owner_of(index)) {
            (VarKind::Inst, Some(owner)) => {
                let kept = self.pous[owner].kept.get(&kept_key(&self.pous[index].tree.name.text, &decl.name.text));
                kept.map_or(Storage::Nowhere, |(_, offset)| Storage::This(*offset))
            }
            _ => Storage::Nowhere,
        };
        let variable = Variable {
            name: decl.name.text.clone(),
            kind: block.kind,
            ty,
            constant: block.constant,
            init: decl.init.as_ref(),
            storage,
            value,
            decl,
            span: decl.name.span,
        };
        self.pous[index].vars.push(variable);
        self.pous[index].index.insert(key(&decl.name.text), position);
    }

    /// Resolves type and (of a constant) value of a global.
    pub(crate) fn resolve_global(&mut self, index: usize) {
        let decl = self.globals[index].decl;
        match self.globals[index].state {
            Progress::Done => return,
            Progress::Running => {
                self.depends_on_itself(&decl.name);
                return;
            }
            Progress::Untouched => {}
        }
        if !self.deeper(DECLARATION, decl.name.span) {
            return;
        }
        self.globals[index].state = Progress::Running;
        let home = std::mem::replace(&mut self.home, self.globals[index].home);
        let own = self.is_of_library(decl.name.span);
        let library = std::mem::replace(&mut self.in_library, own);
        self.inside.push((&decl.name, decl.name.span));
        let ty = self.variable_type(decl, None);
        let constant = self.globals[index].constant;
        self.note_address(decl, ty, constant, crate::address::Section::Global(index));
        let value = if constant && decl.init.is_some() { self.constant_of(decl, ty, None) } else { None };
        self.inside.pop();
        (self.home, self.in_library) = (home, library);
        self.back(DECLARATION);
        self.globals[index].var = Some(Variable {
            name: decl.name.text.clone(),
            kind: self.globals[index].kind,
            ty,
            constant,
            init: decl.init.as_ref(),
            storage: Storage::Nowhere,
            value,
            decl,
            span: decl.name.span,
        });
        self.globals[index].state = Progress::Done;
    }
}

pub(crate) fn is_integer(e: Elem) -> bool {
    use Elem::*;
    matches!(e, Byte | Word | Dword | Lword | Sint | Int | Dint | Lint | Usint | Uint | Udint | Ulint)
}

pub(crate) const ELEMENTARY: &[(&str, Elem)] = &[
    ("BOOL", Elem::Bool),
    ("BIT", Elem::Bool),
    ("BYTE", Elem::Byte),
    ("WORD", Elem::Word),
    ("DWORD", Elem::Dword),
    ("LWORD", Elem::Lword),
    ("SINT", Elem::Sint),
    ("INT", Elem::Int),
    ("DINT", Elem::Dint),
    ("LINT", Elem::Lint),
    ("USINT", Elem::Usint),
    ("UINT", Elem::Uint),
    ("UDINT", Elem::Udint),
    ("ULINT", Elem::Ulint),
    ("REAL", Elem::Real),
    ("LREAL", Elem::Lreal),
    ("TIME", Elem::Time),
    ("LTIME", Elem::Ltime),
    ("DATE", Elem::Date),
    ("LDATE", Elem::Ldate),
    ("TOD", Elem::Tod),
    ("TIME_OF_DAY", Elem::Tod),
    ("LTOD", Elem::Ltod),
    ("LTIME_OF_DAY", Elem::Ltod),
    ("DT", Elem::Dt),
    ("DATE_AND_TIME", Elem::Dt),
    ("LDT", Elem::Ldt),
    ("LDATE_AND_TIME", Elem::Ldt),
    ("CHAR", Elem::Char),
    ("WCHAR", Elem::Wchar),
    ("__XWORD", Elem::Lword),
    ("__UXINT", Elem::Ulint),
    ("__XINT", Elem::Lint),
];

/// The elementary type of that name.
pub(crate) fn elementary(name: &str) -> Option<Elem> {
    let name = key(name);
    ELEMENTARY.iter().find(|(n, _)| *n == name).map(|(_, e)| *e)
}
