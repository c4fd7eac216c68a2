//! Types, variables and layouts, resolved on demand.

use crate::constant::{Value, cut, range};
use crate::initial::Target;
use crate::scope::{Item, Progress, Storage, Variable, key};
use crate::unit::Compiler;
use std::rc::Rc;
use takt_abi::{Elem, Section};
use takt_ir::{Enumeration, Field, StructKind, Structure, Type, TypeId};
use takt_syntax::tree::{self, PouKind, TypeExpr, TypeExprKind, TypeKind, VarKind};
use takt_syntax::{Code, Span};

/// Bytes that one variable may have.
const LARGEST: u64 = 1 << 31;

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
            TypeExprKind::Enum(body) => self.enum_type(&format!("(enumeration at {})", t.span.start), body, pou),
            TypeExprKind::Struct(fields) => {
                let id = self.types.push(Type::Error);
                self.structure(id, "(structure)", fields, StructKind::Struct)
            }
            TypeExprKind::Error => self.error_type(),
        }
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

    fn named_type(&mut self, parts: &'a [tree::Name], span: Span, direct: bool) -> TypeId {
        let Some(last) = parts.last() else { return self.error_type() };
        let item = match parts {
            [name] => {
                if let Some(e) = elementary(&name.text) {
                    return self.elem(e);
                }
                self.global_name(&name.text)
            }
            [library, name] if matches!(self.global_name(&library.text), Some(Item::Library)) => {
                self.library_member(&library.text, &name.text)
            }
            _ => None,
        };
        self.item_type(item, last, span, direct)
    }

    fn item_type(&mut self, item: Option<Item>, name: &tree::Name, span: Span, direct: bool) -> TypeId {
        match item {
            Some(Item::Type(i)) => self.declared_type(i, direct, span),
            Some(Item::Ready(ty) | Item::NativeBlock(ty)) => ty,
            Some(Item::Pou(i)) if self.pous[i].tree.kind != PouKind::Function => {
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
                self.report(Code::Circular, at, format!("`{}` contains itself", tree.name.text)).help =
                    Some("use POINTER TO or REFERENCE TO to break the cycle".into());
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
        self.declared[index].state = Progress::Running;
        let ty = self.define(index, tree);
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
                if let Some(base) = extends {
                    self.report(Code::NotSupported, base.span, "STRUCT EXTENDS is not supported yet");
                }
                let id = self.declared[index].ty.expect("given before");
                self.structure(id, name, fields, StructKind::Struct)
            }
            TypeKind::Union { fields } => {
                let id = self.declared[index].ty.expect("given before");
                self.structure(id, name, fields, StructKind::Union)
            }
            TypeKind::Enum(body) => self.enum_type(name, body, None),
            TypeKind::Alias { ty, .. } => self.type_expr(ty, None, true),
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
        let mut next = 0i128;
        let mut members: Vec<(String, i64)> = Vec::new();
        for (member, value) in &body.members {
            if let Some(expr) = value {
                next = self.enum_value(expr, pou, &members).unwrap_or(next);
            }
            if members.iter().any(|(n, _)| key(n) == key(&member.text)) {
                self.report(Code::DuplicateName, member.span, format!("`{}` is declared twice in this enumeration", member.text));
            }
            let (low, high) = range(base);
            if !(low..=high).contains(&next) {
                self.report(
                    Code::OutOfRange,
                    member.span,
                    format!("the value {next} of `{}` does not fit the base type `{}`", member.text, takt_ir::elem_name(base)),
                );
            }
            members.push((member.text.clone(), cut(next, base) as i64));
            next += 1;
        }
        let init = match &body.init {
            Some(expr) => self.enum_value(expr, pou, &members),
            None => members.first().map(|(_, v)| i128::from(*v)),
        };
        let ty = self.types.intern(Type::Enum(Box::new(Enumeration { name: name.into(), base, members })));
        if let Some(init) = init.filter(|v| *v != 0) {
            let mut bytes = vec![0; takt_ir::elem_size(base) as usize];
            crate::constant::store(&Value::Int(init), base, &mut bytes);
            self.type_init.insert(ty, Rc::new(bytes));
        }
        ty
    }

    /// The value of an enumerator, which may name those before it.
    fn enum_value(&mut self, expr: &'a tree::Expr, pou: Option<usize>, members: &[(String, i64)]) -> Option<i128> {
        if let tree::ExprKind::Name(name) = &expr.kind
            && let Some((_, value)) = members.iter().find(|(n, _)| key(n) == key(name))
        {
            return Some((*value).into());
        }
        self.constant_int(expr, pou)
    }

    fn structure(&mut self, id: TypeId, name: &str, decls: &'a [tree::VarDecl], kind: StructKind) -> TypeId {
        let mut layout = Layout::default();
        let mut fields: Vec<Field> = Vec::new();
        for decl in decls {
            let ty = self.variable_type(decl, None);
            if fields.iter().any(|f| key(&f.name) == key(&decl.name.text)) {
                self.report(Code::DuplicateName, decl.name.span, format!("`{}` is declared twice in `{name}`", decl.name.text));
            }
            let (size, align) = self.types.layout(ty);
            let offset = if kind == StructKind::Union { layout.overlay(size, align) } else { layout.add(size, align) };
            fields.push(Field {
                name: decl.name.text.clone(),
                ty,
                offset,
                section: Section::State,
                doc: decl.doc.clone().unwrap_or_default(),
            });
        }
        let (size, align) = layout.end();
        self.too_large(size, decls.first().map(|d| d.name.span));
        let offsets: Vec<_> = fields.iter().map(|f| (f.offset, f.ty)).collect();
        self.types.set(id, Type::Struct(Box::new(Structure { name: name.into(), kind, fields, size, align })));
        let mut bytes = vec![0; size as usize];
        let mut late = Vec::new();
        for (decl, (offset, ty)) in decls.iter().zip(offsets) {
            self.fill(decl, ty, offset, &mut Target { pou: None, bytes: &mut bytes, late: &mut late });
        }
        self.refuse_late(&late);
        if bytes.iter().any(|b| *b != 0) {
            self.type_init.insert(id, Rc::new(bytes));
        }
        id
    }

    fn too_large(&mut self, size: u32, span: Option<Span>) {
        if let (true, Some(span)) = (u64::from(size) > LARGEST, span) {
            self.report(Code::TooLarge, span, "this structure does not fit the memory of an application (2 GiB)");
        }
    }

    /// A variable's type; `ARRAY[*]` is only for VAR_IN_OUT.
    fn variable_type(&mut self, decl: &'a tree::VarDecl, pou: Option<usize>) -> TypeId {
        let ty = self.type_expr(&decl.ty, pou, true);
        if let Type::OpenArray { .. } = self.types.get(ty) {
            self.report(Code::TypeMismatch, decl.ty.span, "ARRAY[*] is only possible as VAR_IN_OUT");
            return self.error_type();
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
                let name = self.pous[index].tree.name.text.clone();
                if self.pous[index].tree.kind != PouKind::Function {
                    self.report(Code::Circular, at, format!("`{name}` contains itself")).help =
                        Some("use POINTER TO or REFERENCE TO to break the cycle".into());
                }
                return;
            }
            Progress::Untouched => self.pous[index].state = Progress::Running,
        }
        let tree = self.pous[index].tree;
        self.pous[index].result = tree.result.as_ref().map(|t| self.type_expr(t, Some(index), true));
        for block in &tree.vars {
            for decl in &block.vars {
                self.declare_variable(index, block, decl);
            }
        }
        if tree.kind != PouKind::Function {
            self.lay_out_instance(index);
        }
        self.pous[index].state = Progress::Done;
    }

    fn declare_variable(&mut self, index: usize, block: &'a tree::VarBlock, decl: &'a tree::VarDecl) {
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
        let ty =
            if block.kind == VarKind::InOut { self.type_expr(&decl.ty, Some(index), true) } else { self.variable_type(decl, Some(index)) };
        if let Some(at) = &decl.at {
            self.report(Code::NotSupported, at.span, "a direct address is only supported in VAR_GLOBAL");
        }
        if !decl.fb_init.is_empty() {
            self.report(Code::NotSupported, decl.name.span, "arguments of FB_Init are not supported yet");
        }
        let value = if block.constant && decl.init.is_some() { self.constant_of(decl, ty, Some(index)) } else { None };
        let position = self.pous[index].vars.len();
        let variable = Variable {
            name: decl.name.text.clone(),
            kind: block.kind,
            ty,
            constant: block.constant,
            init: decl.init.as_ref(),
            storage: Storage::Nowhere,
            value,
            decl,
            span: decl.name.span,
        };
        self.pous[index].vars.push(variable);
        if let Some(first) = self.pous[index].index.insert(key(&decl.name.text), position) {
            let first = self.pous[index].vars[first].span;
            self.report(Code::DuplicateName, decl.name.span, format!("`{}` is declared twice", decl.name.text))
                .notes
                .push(takt_syntax::Note { span: first, message: "first declared here".into() });
        }
    }

    fn lay_out_instance(&mut self, index: usize) {
        let id = self.pou_type(index);
        let tree = self.pous[index].tree;
        let mut layout = Layout::default();
        let mut fields = Vec::new();
        let mut filled = Vec::new();
        for i in 0..self.pous[index].vars.len() {
            let v = self.pous[index].vars[i].clone();
            if matches!(v.kind, VarKind::Temp | VarKind::Stat) || v.value.is_some() {
                continue;
            }
            let (size, align) = match (v.kind, self.types.get(v.ty)) {
                (VarKind::InOut, Type::OpenArray { dims, .. }) => (8 + 16 * dims, 8),
                (VarKind::InOut, _) => (8, 8),
                _ => self.types.layout(v.ty),
            };
            let offset = layout.add(size, align);
            let section = match v.kind {
                VarKind::Input => Section::Input,
                VarKind::Output => Section::Output,
                VarKind::InOut => Section::InOut,
                _ => Section::State,
            };
            fields.push(Field { name: v.name.clone(), ty: v.ty, offset, section, doc: v.decl.doc.clone().unwrap_or_default() });
            self.pous[index].vars[i].storage = Storage::This(offset);
            if v.kind != VarKind::InOut {
                filled.push((v.decl, v.ty, offset));
            }
        }
        let (size, align) = layout.end();
        self.too_large(size, Some(tree.name.span));
        let kind = if tree.kind == PouKind::Program { StructKind::Program } else { StructKind::Block };
        self.types.set(id, Type::Struct(Box::new(Structure { name: tree.name.text.clone(), kind, fields, size, align })));
        let mut bytes = vec![0; size as usize];
        let mut late = Vec::new();
        for (decl, ty, offset) in filled {
            self.fill(decl, ty, offset, &mut Target { pou: Some(index), bytes: &mut bytes, late: &mut late });
        }
        if tree.kind == PouKind::Program {
            self.pous[index].late = late;
        } else {
            self.refuse_late(&late);
        }
        if bytes.iter().any(|b| *b != 0) {
            self.type_init.insert(id, Rc::new(bytes));
        }
    }

    fn refuse_late(&mut self, late: &[(u32, TypeId, &'a tree::Expr)]) {
        for (_, _, expr) in late {
            self.report(Code::NotConstant, expr.span, "the initial value of a member must be a constant").help =
                Some("assign it in the first scan instead".into());
        }
    }

    /// Resolves type and (of a constant) value of a global.
    pub(crate) fn resolve_global(&mut self, index: usize) {
        let decl = self.globals[index].decl;
        match self.globals[index].state {
            Progress::Done => return,
            Progress::Running => {
                self.report(Code::Circular, decl.name.span, format!("`{}` depends on itself", decl.name.text));
                return;
            }
            Progress::Untouched => self.globals[index].state = Progress::Running,
        }
        let ty = self.variable_type(decl, None);
        let constant = self.globals[index].constant;
        let value = if constant && decl.init.is_some() { self.constant_of(decl, ty, None) } else { None };
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

    /// The nearest known name, as help.
    pub(crate) fn suggest(&self, name: &str, types_only: bool) -> Option<String> {
        let wanted = key(name);
        let usable = |item: &Item| !types_only || matches!(item, Item::Type(_) | Item::Ready(_) | Item::NativeBlock(_) | Item::Pou(_));
        let elementary = ELEMENTARY.iter().map(|(n, _)| *n).chain(["STRING", "WSTRING"]).filter(|_| types_only).map(String::from);
        let known = self.names.iter().chain(&self.library_names).filter(|(_, i)| usable(i)).map(|(n, _)| n.clone());
        nearest(&wanted, known.chain(elementary)).map(|n| format!("did you mean `{n}`?"))
    }
}

/// The candidate with the smallest edit distance, if it is near; ties by name.
pub(crate) fn nearest(wanted: &str, known: impl Iterator<Item = String>) -> Option<String> {
    let length = wanted.chars().count();
    let limit = (1 + length / 4).min(length.saturating_sub(1));
    known.filter_map(|n| Some((distance(wanted, &n, limit)?, n))).min().map(|(_, n)| n)
}

fn distance(a: &str, b: &str, limit: usize) -> Option<usize> {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > limit {
        return None;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    Some(row[b.len()]).filter(|d| *d <= limit)
}

/// Offsets as `repr(C)` gives them.
#[derive(Debug, Default)]
struct Layout {
    size: u64,
    align: u32,
}

impl Layout {
    fn add(&mut self, size: u32, align: u32) -> u32 {
        self.align = self.align.max(align);
        let at = self.size.next_multiple_of(align.max(1).into());
        self.size = at + u64::from(size);
        at.min(u32::MAX.into()) as u32
    }
    fn overlay(&mut self, size: u32, align: u32) -> u32 {
        self.align = self.align.max(align);
        self.size = self.size.max(size.into());
        0
    }
    /// Size and alignment; nothing is smaller than a byte.
    fn end(&self) -> (u32, u32) {
        let align = self.align.max(1);
        (self.size.next_multiple_of(align.into()).clamp(1, u32::MAX.into()) as u32, align)
    }
}

pub(crate) fn is_integer(e: Elem) -> bool {
    use Elem::*;
    matches!(e, Byte | Word | Dword | Lword | Sint | Int | Dint | Lint | Usint | Uint | Udint | Ulint)
}

const ELEMENTARY: &[(&str, Elem)] = &[
    ("BOOL", Elem::Bool),
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
