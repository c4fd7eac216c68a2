//! Types, variables and layouts, resolved on demand.

use crate::constant::{Value, cut, range};
use crate::initial::Target;
use crate::limits::DECLARATION;
use crate::scope::{Item, PouKind, Progress, Storage, Variable, key};
use crate::unit::Compiler;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;
use takt_abi::{Elem, Section};
use takt_ir::{Enumeration, Field, StructKind, Structure, Type, TypeId};
use takt_syntax::tree::{self, TypeExpr, TypeExprKind, TypeKind, VarKind};
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

    fn named_type(&mut self, parts: &'a [tree::Name], span: Span, direct: bool) -> TypeId {
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
        self.inside.push((&tree.name, at));
        let ty = self.define(index, tree);
        self.inside.pop();
        self.home = home;
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
        let mut values: HashMap<String, i64> = HashMap::new();
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

    /// What a STRUCT extends.
    fn base_structure(&mut self, own: TypeId, name: &'a tree::Name) -> Option<TypeId> {
        let base = self.named_type(std::slice::from_ref(name), name.span, true);
        match self.types.get(base) {
            Type::Struct(s) if s.kind == StructKind::Struct => {
                self.struct_bases.insert(own, base);
                Some(base)
            }
            Type::Error => None,
            _ => {
                self.report(Code::UnknownType, name.span, format!("a STRUCT extends a STRUCT, `{}` is none", name.text));
                None
            }
        }
    }

    /// Whether a STRUCT extends another, directly or through others.
    pub(crate) fn struct_extends(&self, ty: TypeId, base: TypeId) -> bool {
        std::iter::successors(self.struct_bases.get(&ty), |ty| self.struct_bases.get(ty)).any(|b| *b == base)
    }

    /// The name of the ABSTRACT block that variables of a type would be or contain.
    pub(crate) fn abstract_block(&self, ty: TypeId) -> Option<String> {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.abstract_block(*elem),
            Type::Struct(_) => {
                let tree = self.pous[*self.pou_of_type.get(&ty)?].tree;
                (tree.modifiers.is_abstract && tree.kind == PouKind::FunctionBlock).then(|| tree.name.text.clone())
            }
            _ => None,
        }
    }

    /// `{attribute 'pack_mode' := '1'}`: the largest alignment of a member.
    fn pack_mode(&self, pragmas: &[tree::Pragma]) -> Option<u32> {
        let value = pragmas.iter().find(|p| p.name == "pack_mode")?.value.as_deref()?;
        value.trim().parse().ok().filter(|bytes: &u32| bytes.is_power_of_two())
    }

    fn structure(
        &mut self,
        id: TypeId,
        name: &str,
        decls: &'a [tree::VarDecl],
        kind: StructKind,
        base: Option<TypeId>,
        pack: Option<u32>,
    ) -> TypeId {
        let (mut layout, mut fields) = self.inherited(base);
        let mut names: HashSet<String> = fields.iter().map(|f| key(&f.name)).collect();
        for decl in decls {
            let declared = self.variable_type(decl, None);
            self.note_address(decl, declared, false, crate::address::Section::Structure(id));
            if !names.insert(key(&decl.name.text)) {
                let first = decls.iter().find(|d| key(&d.name.text) == key(&decl.name.text) && d.name.span != decl.name.span);
                self.declared_twice(&decl.name, Some(name), first.map(|d| d.name.span));
            }
            let packed = is_bit(&decl.ty) && decl.at.is_none();
            let (size, align) = self.types.layout(declared);
            // Instances of classes are found at multiples of their granule only.
            let align = pack.filter(|_| u64::from(align) < takt_abi::GRANULE).map_or(align, |pack| align.min(pack));
            let (offset, ty) = match kind {
                StructKind::Union if packed => (layout.overlay(1, 1), self.types.intern(Type::Bit(0))),
                StructKind::Union => (layout.overlay(size, align), declared),
                _ if packed => {
                    let (offset, bit) = layout.add_bit();
                    (offset, self.types.intern(Type::Bit(bit)))
                }
                _ => (layout.add(size, align), declared),
            };
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
        self.types.set(id, Type::Struct(Arc::new(Structure { name: name.into(), kind, fields, size, align })));
        let mut bytes = vec![0; size as usize];
        let mut late = Vec::new();
        if let Some(base) = base {
            late.extend(self.type_late.get(&base).iter().flat_map(|late| late.iter()).copied());
            self.inherit_bytes(base, &mut bytes);
        }
        let own = &offsets[offsets.len() - decls.len()..];
        for (decl, (offset, ty)) in decls.iter().zip(own) {
            self.fill(decl, *ty, *offset, &mut Target { pou: None, bytes: &mut bytes, late: &mut late });
        }
        self.keep_initial(id, bytes, late);
        id
    }

    /// Members and room that a type has from the one it extends.
    fn inherited(&self, base: Option<TypeId>) -> (Layout, Vec<Field>) {
        match base.map(|base| self.types.get(base)) {
            Some(Type::Struct(s)) => (Layout { size: s.size.into(), align: s.align, bits: 0 }, s.fields.clone()),
            _ => Default::default(),
        }
    }

    fn inherit_bytes(&self, base: TypeId, bytes: &mut [u8]) {
        if let Some(template) = self.type_init.get(&base) {
            bytes[..template.len()].copy_from_slice(template);
        }
    }

    fn keep_initial(&mut self, id: TypeId, bytes: Vec<u8>, late: Vec<crate::initial::Late<'a>>) {
        if bytes.iter().any(|b| *b != 0) {
            self.type_init.insert(id, Rc::new(bytes));
        }
        if !late.is_empty() {
            self.type_late.insert(id, Rc::new(late));
        }
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
        self.home = home;
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

    fn lay_out_instance(&mut self, index: usize) {
        let id = self.pou_type(index);
        let tree = self.pous[index].tree;
        let base = self.pous[index].base.map(|base| self.pou_type(base));
        let (mut layout, mut fields) = self.inherited(base);
        let class = self.pous[index].class != 0;
        let mut filled = Vec::new();
        for i in 0..self.pous[index].vars.len() {
            let v = self.pous[index].vars[i].clone();
            if matches!(v.kind, VarKind::Temp | VarKind::Stat) || v.value.is_some() || self.fixed_address(v.decl).is_some() {
                continue;
            }
            let (size, align) = match (v.kind, self.types.get(v.ty)) {
                (VarKind::InOut, Type::OpenArray { dims, .. }) => (8 + 16 * dims, 8),
                (VarKind::InOut, _) => (8, 8),
                _ => self.types.layout(v.ty),
            };
            // An instance of another class must not begin where this one does.
            let offset = layout.add_behind(size, align, class);
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
        for (name, decl, ty) in self.kept_variables(index) {
            let (size, align) = self.types.layout(ty);
            let offset = layout.add_behind(size, align, class);
            self.pous[index].kept.insert(key(&name), (ty, offset));
            fields.push(Field { name, ty, offset, section: Section::State, doc: decl.doc.clone().unwrap_or_default() });
            filled.push((decl, ty, offset));
        }
        if class {
            layout.align = layout.align.max(takt_abi::GRANULE as u32);
            layout.size = layout.size.max(1);
        }
        let (size, align) = layout.end();
        self.too_large(size, Some(tree.name.span));
        let kind = if tree.kind == PouKind::Program { StructKind::Program } else { StructKind::Block };
        self.types.set(id, Type::Struct(Arc::new(Structure { name: tree.name.text.clone(), kind, fields, size, align })));
        let mut bytes = vec![0; size as usize];
        let mut late = Vec::new();
        if let Some(base) = base {
            self.inherit_bytes(base, &mut bytes);
        }
        for (decl, ty, offset) in filled {
            self.fill(decl, ty, offset, &mut Target { pou: Some(index), bytes: &mut bytes, late: &mut late });
        }
        self.keep_initial(id, bytes, late);
    }

    /// The block or program that a method or action belongs to.
    fn owner_of(&self, index: usize) -> Option<usize> {
        match self.pous[index].owner {
            Some(crate::scope::Owner::Pou(owner)) => Some(owner),
            _ => None,
        }
    }

    /// VAR_INST of the methods: they lie in the instance.
    fn kept_variables(&mut self, index: usize) -> Vec<(String, &'a tree::VarDecl, TypeId)> {
        let mut kept = Vec::new();
        for unit in (0..self.pous.len()).skip(index + 1) {
            if self.owner_of(unit) != Some(index) {
                break;
            }
            let tree = self.pous[unit].tree;
            for decl in tree.vars.iter().filter(|b| b.kind == VarKind::Inst).flat_map(|b| &b.vars) {
                let ty = self.variable_type(decl, Some(index));
                kept.push((kept_key(&tree.name.text, &decl.name.text), decl, ty));
            }
        }
        kept
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
        self.inside.push((&decl.name, decl.name.span));
        let ty = self.variable_type(decl, None);
        let constant = self.globals[index].constant;
        self.note_address(decl, ty, constant, crate::address::Section::Global(index));
        let value = if constant && decl.init.is_some() { self.constant_of(decl, ty, None) } else { None };
        self.inside.pop();
        self.home = home;
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

    /// The nearest known name, as help.
    pub(crate) fn suggest(&mut self, name: &str, types_only: bool) -> Option<String> {
        if !self.may_compare(self.names.len() + self.library_names.len()) {
            return None;
        }
        let wanted = key(name);
        let usable = |item: &Item| {
            !types_only || matches!(item, Item::Type(_) | Item::Ready(_) | Item::NativeBlock(_) | Item::Pou(_) | Item::Interface(_))
        };
        let elementary = ELEMENTARY.iter().map(|(n, _)| *n).chain(["STRING", "WSTRING"]).filter(|_| types_only);
        let known = self.names.iter().chain(&self.library_names).filter(|(_, i)| usable(i)).map(|(n, _)| n.as_str());
        nearest(&wanted, known.chain(elementary)).map(|n| format!("did you mean `{}`?", self.spelling(n)))
    }

    /// A name as it is declared.
    fn spelling<'n>(&'n self, name: &'n str) -> &'n str {
        let declared = match self.names.get(name).or_else(|| self.library_names.get(name)) {
            Some(Item::Pou(i)) => &self.pous[*i].tree.name.text,
            Some(Item::Type(i)) => &self.declared[*i].tree.name.text,
            Some(Item::Interface(i)) => &self.interfaces[*i].tree.name.text,
            Some(Item::Global(i)) => &self.globals[*i].decl.name.text,
            Some(Item::List(i)) => &self.lists[*i].name,
            _ => name,
        };
        // An alias is what was asked for, not what it stands for.
        if key(declared) == name { declared } else { name }
    }
}

/// The candidate with the smallest edit distance, if it is near; ties by name.
pub(crate) fn nearest<N: AsRef<str> + Ord>(wanted: &str, known: impl Iterator<Item = N>) -> Option<N> {
    let wanted: Vec<char> = wanted.chars().collect();
    let limit = (1 + wanted.len() / 4).min(wanted.len().saturating_sub(1));
    known.filter_map(|n| Some((distance(&wanted, n.as_ref(), limit)?, n))).min().map(|(_, n)| n)
}

fn distance(a: &[char], b: &str, limit: usize) -> Option<usize> {
    // A letter has one to four bytes.
    if b.len() + limit < a.len() || b.len() > (a.len() + limit) * 4 {
        return None;
    }
    let b: Vec<char> = b.chars().collect();
    if a.len().abs_diff(b.len()) > limit {
        return None;
    }
    let mut before: Vec<usize> = Vec::new();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut next = vec![i + 1];
        for (j, y) in b.iter().enumerate() {
            let replaced = row[j] + usize::from(x != y);
            let mut least = replaced.min(row[j + 1] + 1).min(next[j] + 1);
            // Two letters in the other order are one slip.
            if i > 0 && j > 0 && *x == b[j - 1] && a[i - 1] == *y {
                least = least.min(before[j - 1] + 1);
            }
            next.push(least);
        }
        before = std::mem::replace(&mut row, next);
    }
    row.last().copied().filter(|d| *d <= limit)
}

/// Offsets as `repr(C)` gives them.
#[derive(Debug, Default)]
struct Layout {
    size: u64,
    align: u32,
    /// Bits that are free in the last byte.
    bits: u8,
}

impl Layout {
    fn add(&mut self, size: u32, align: u32) -> u32 {
        self.bits = 0;
        self.align = self.align.max(align);
        let at = self.size.next_multiple_of(align.max(1).into());
        self.size = at + u64::from(size);
        at.min(u32::MAX.into()) as u32
    }
    /// The next bit: consecutive ones share bytes.
    fn add_bit(&mut self) -> (u32, u8) {
        if self.bits == 0 {
            self.add(1, 1);
            self.bits = 8;
        }
        self.bits -= 1;
        ((self.size - 1).min(u32::MAX.into()) as u32, 7 - self.bits)
    }
    /// As [`Layout::add`], but not at the start if a class must not begin there.
    fn add_behind(&mut self, size: u32, align: u32, class: bool) -> u32 {
        if class && self.size == 0 && u64::from(align) >= takt_abi::GRANULE {
            self.size = takt_abi::GRANULE;
        }
        self.add(size, align)
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

/// The name of a VAR_INST among the members of its block.
fn kept_key(method: &str, name: &str) -> String {
    key(&format!("{method}.{name}"))
}

/// Whether BIT is written.
fn is_bit(ty: &TypeExpr) -> bool {
    matches!(&ty.kind, TypeExprKind::Named(parts) if matches!(&parts[..], [name] if name.text.eq_ignore_ascii_case("BIT")))
}

pub(crate) fn is_integer(e: Elem) -> bool {
    use Elem::*;
    matches!(e, Byte | Word | Dword | Lword | Sint | Int | Dint | Lint | Usint | Uint | Udint | Ulint)
}

const ELEMENTARY: &[(&str, Elem)] = &[
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
