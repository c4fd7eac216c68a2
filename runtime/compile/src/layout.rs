//! Layouts: where the members of structures and instances lie, and what they hold at the start.

use crate::initial::Target;
use crate::scope::{PouKind, Storage, key};
use crate::types::LARGEST;
use crate::unit::Compiler;
use rustc_hash::FxHashSet as HashSet;
use std::rc::Rc;
use std::sync::Arc;
use takt_abi::Section;
use takt_ir::{Field, StructKind, Structure, Type, TypeId};
use takt_syntax::tree::{self, TypeExpr, TypeExprKind, VarKind};
use takt_syntax::{Code, Span};

impl<'a> Compiler<'a> {
    /// What a STRUCT extends.
    pub(crate) fn base_structure(&mut self, own: TypeId, name: &'a tree::Name) -> Option<TypeId> {
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
    pub(crate) fn pack_mode(&self, pragmas: &[tree::Pragma]) -> Option<u32> {
        let value = pragmas.iter().find(|p| p.name == "pack_mode")?.value.as_deref()?;
        value.trim().parse().ok().filter(|bytes: &u32| bytes.is_power_of_two())
    }

    pub(crate) fn structure(
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
        let (mut size, align) = layout.end();
        let too_large = self.too_large(size, decls.first().map(|d| d.name.span));
        if too_large {
            size = folded(&mut fields);
        }
        let offsets: Vec<_> = fields.iter().map(|f| (f.offset, f.ty)).collect();
        self.types.set(id, Type::Struct(Arc::new(Structure { name: name.into(), kind, fields, size, align })));
        let (mut bytes, mut late) = (Vec::new(), Vec::new());
        if let Some(base) = base {
            late.extend(self.type_late.get(&base).iter().flat_map(|late| late.iter()).copied());
            self.inherit_bytes(base, &mut bytes);
        }
        let own = if too_large { &[] } else { &offsets[offsets.len() - decls.len()..] };
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

    fn inherit_bytes(&self, base: TypeId, bytes: &mut Vec<u8>) {
        bytes.extend(self.type_init.get(&base).iter().flat_map(|template| template.iter()));
    }

    fn keep_initial(&mut self, id: TypeId, mut bytes: Vec<u8>, late: Vec<crate::initial::Late<'a>>) {
        if let Some(last) = bytes.iter().rposition(|b| *b != 0) {
            bytes.truncate(last + 1);
            bytes.shrink_to_fit();
            self.type_init.insert(id, Rc::new(bytes));
        }
        if !late.is_empty() {
            self.type_late.insert(id, Rc::new(late));
        }
    }

    /// Whether a structure is too large; reports it.
    fn too_large(&mut self, size: u32, span: Option<Span>) -> bool {
        let too_large = u64::from(size) > LARGEST;
        if let (true, Some(span)) = (too_large, span) {
            self.report(Code::TooLarge, span, "this structure does not fit the memory of an application (2 GiB)");
        }
        too_large
    }

    pub(crate) fn lay_out_instance(&mut self, index: usize) {
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
        let (mut size, align) = layout.end();
        if self.too_large(size, Some(tree.name.span)) {
            size = folded(&mut fields);
            filled.clear();
        }
        let kind = if tree.kind == PouKind::Program { StructKind::Program } else { StructKind::Block };
        self.types.set(id, Type::Struct(Arc::new(Structure { name: tree.name.text.clone(), kind, fields, size, align })));
        let (mut bytes, mut late) = (Vec::new(), Vec::new());
        if let Some(base) = base {
            self.inherit_bytes(base, &mut bytes);
        }
        for (decl, ty, offset) in filled {
            self.fill(decl, ty, offset, &mut Target { pou: Some(index), bytes: &mut bytes, late: &mut late });
        }
        self.keep_initial(id, bytes, late);
    }

    /// The block or program that a method or action belongs to.
    pub(crate) fn owner_of(&self, index: usize) -> Option<usize> {
        match self.pous[index].owner {
            Some(crate::scope::Owner::Pou(owner)) => Some(owner),
            _ => None,
        }
    }

    /// VAR_INST of the methods: they lie in the instance.
    pub(crate) fn kept_variables(&mut self, index: usize) -> Vec<(String, &'a tree::VarDecl, TypeId)> {
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
}

/// A structure that is too large shrinks to a byte, so that what contains it is not too large as well; its size then.
fn folded(fields: &mut [Field]) -> u32 {
    fields.iter_mut().for_each(|field| field.offset = 0);
    1
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
    pub(crate) fn add(&mut self, size: u32, align: u32) -> u32 {
        self.bits = 0;
        self.align = self.align.max(align);
        let at = self.size.next_multiple_of(align.max(1).into());
        self.size = at + u64::from(size);
        at.min(u32::MAX.into()) as u32
    }
    /// The next bit: consecutive ones share bytes.
    pub(crate) fn add_bit(&mut self) -> (u32, u8) {
        if self.bits == 0 {
            self.add(1, 1);
            self.bits = 8;
        }
        self.bits -= 1;
        ((self.size - 1).min(u32::MAX.into()) as u32, 7 - self.bits)
    }
    /// As [`Layout::add`], but not at the start if a class must not begin there.
    pub(crate) fn add_behind(&mut self, size: u32, align: u32, class: bool) -> u32 {
        if class && self.size == 0 && u64::from(align) >= takt_abi::GRANULE {
            self.size = takt_abi::GRANULE;
        }
        self.add(size, align)
    }
    pub(crate) fn overlay(&mut self, size: u32, align: u32) -> u32 {
        self.align = self.align.max(align);
        self.size = self.size.max(size.into());
        0
    }
    /// Size and alignment; nothing is smaller than a byte.
    pub(crate) fn end(&self) -> (u32, u32) {
        let align = self.align.max(1);
        (self.size.next_multiple_of(align.into()).clamp(1, u32::MAX.into()) as u32, align)
    }
}

/// The name of a VAR_INST among the members of its block.
pub(crate) fn kept_key(method: &str, name: &str) -> String {
    key(&format!("{method}.{name}"))
}

/// Whether BIT is written.
pub(crate) fn is_bit(ty: &TypeExpr) -> bool {
    matches!(&ty.kind, TypeExprKind::Named(parts) if matches!(&parts[..], [name] if name.text.eq_ignore_ascii_case("BIT")))
}
