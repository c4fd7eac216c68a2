//! The image: where globals, programs, statics and stacks lie, and its first bytes.

use crate::initial::{LARGEST_INITIAL, Late, Target};
use crate::scope::{PouKind, Storage, key};
use crate::unit::Compiler;
use takt_abi::Section;
use takt_ir::{Global, ResourceInstance, StructKind, Type, TypeId};
use takt_syntax::tree::VarKind;
use takt_syntax::{Code, Span};

/// Bytes that an application may have, stacks included.
const LARGEST_IMAGE: u64 = 3 << 30;

impl<'a> Compiler<'a> {
    /// Takes the next bytes of the image.
    pub(crate) fn take(&mut self, size: u32, align: u32, at: Span) -> u32 {
        let start = self.next.next_multiple_of(align.max(1).into());
        let end = start + u64::from(size);
        if end > LARGEST_IMAGE {
            if self.next <= LARGEST_IMAGE {
                self.report(Code::TooLarge, at, "the program's variables need more than 3 GiB");
            }
            self.next = LARGEST_IMAGE + 1;
            return takt_ir::NULL_ZONE;
        }
        self.next = end;
        start as u32
    }

    /// Gives every global, static and program its place and its initial bytes.
    pub(crate) fn lay_out(&mut self) {
        self.lay_out_areas();
        let mut order: Vec<usize> = (0..self.globals.len()).collect();
        let list = |i: &usize| self.globals[*i].list.map(|l| (self.lists[l].slot, key(&self.lists[l].name)));
        order.sort_by_cached_key(list);
        order.retain(|i| !self.is_of_library(self.globals[*i].decl.name.span));
        for i in order {
            self.lay_out_global(i);
        }
        for i in 0..self.pous.len() {
            self.lay_out_pou(i);
        }
    }

    fn lay_out_global(&mut self, i: usize) {
        let Some(var) = self.globals[i].var.clone() else { return };
        self.home = self.globals[i].home;
        if self.fill_fixed(&var, None) {
            return;
        }
        let (size, align) = self.types.layout(var.ty);
        let offset = self.take(size, align.max(if size >= 16 { 16 } else { 1 }), var.span);
        if let Some(v) = &mut self.globals[i].var {
            v.storage = Storage::Image(offset);
        }
        self.push_global(i, var.ty, offset);
        self.fill_variable(&var, offset, None);
        self.note_instances(var.ty, offset);
        let path = self.global_path(i);
        self.write_instance_paths(var.ty, offset, &path);
    }

    /// The globals of a library that are no constants have their places at their first use.
    pub(crate) fn lay_out_library_global(&mut self, i: usize) {
        let Some(var) = &self.globals[i].var else { return };
        if self.is_of_library(var.span) && var.value.is_none() && matches!(var.storage, Storage::Nowhere) {
            let home = self.home;
            self.lay_out_global(i);
            self.home = home;
        }
    }

    /// The name of a global with that of its list.
    pub(crate) fn global_path(&self, i: usize) -> String {
        let name = &self.globals[i].decl.name.text;
        match self.globals[i].list {
            Some(list) => format!("{}.{name}", self.lists[list].name),
            None => name.clone(),
        }
    }

    /// Makes a global known by its name.
    pub(crate) fn push_global(&mut self, i: usize, ty: TypeId, offset: u32) {
        let Some(var) = self.globals[i].var.clone() else { return };
        let name = self.global_path(i);
        let bare = self.globals[i].list.is_none_or(|l| !self.lists[l].qualified_only)
            && matches!(self.names.get(&self.entered(&var.name)), Some(crate::scope::Item::Global(n)) if *n == i);
        self.program.globals.push(Global { name, bare, ty, offset, constant: var.constant, doc: var.decl.doc.clone().unwrap_or_default() });
    }

    pub(crate) fn fill_variable(&mut self, var: &crate::scope::Variable<'a>, offset: u32, pou: Option<usize>) {
        let (mut bytes, mut late) = (Vec::new(), Vec::new());
        self.fill(var.decl, var.ty, 0, &mut Target { pou, bytes: &mut bytes, late: &mut late });
        if let (Type::Bit(_), Some(byte)) = (self.types.get(var.ty), self.program.init.get(offset as usize)) {
            bytes.resize(1, 0);
            bytes[0] |= byte;
        }
        self.write(offset, &bytes);
        let home = self.home;
        self.late.extend(late.into_iter().map(|late| (pou, home, Late { offset: offset + late.offset, ..late })));
    }

    /// Writes initial bytes; zeros at the end of the image cost nothing. What is far behind is set by the start body.
    fn write(&mut self, offset: u32, bytes: &[u8]) {
        let Some(used) = bytes.iter().rposition(|b| *b != 0) else { return };
        let end = offset as usize + used + 1;
        if end as u64 > LARGEST_INITIAL {
            return self.far.push((offset, bytes[..=used].to_vec()));
        }
        if self.program.init.len() < end {
            self.program.init.resize(end, 0);
        }
        self.program.init[offset as usize..end].copy_from_slice(&bytes[..=used]);
    }

    fn lay_out_pou(&mut self, i: usize) {
        self.home = self.pous[i].home;
        for v in 0..self.pous[i].vars.len() {
            let var = self.pous[i].vars[v].clone();
            if self.fill_fixed(&var, Some(i)) || var.kind != VarKind::Stat || var.value.is_some() {
                continue;
            }
            let (size, align) = self.types.layout(var.ty);
            let offset = self.take(size, align, var.span);
            self.pous[i].vars[v].storage = Storage::Image(offset);
            self.fill_variable(&var, offset, Some(i));
            self.note_instances(var.ty, offset);
            let path = format!("{}.{}", self.pous[i].tree.name.text, var.name);
            self.write_instance_paths(var.ty, offset, &path);
        }
        if self.pous[i].tree.kind == PouKind::Program {
            self.lay_out_program(i);
        }
    }

    fn lay_out_program(&mut self, i: usize) {
        let tree = self.pous[i].tree;
        let ty = self.pou_type(i);
        let (size, align) = self.types.layout(ty);
        let offset = self.take(size, align.max(16), tree.name.span);
        self.pous[i].instance = offset;
        if let Some(bytes) = self.type_bytes(ty) {
            self.write(offset, &bytes);
        }
        let late = self.type_late.get(&ty).cloned().unwrap_or_default();
        let home = self.pous[i].home;
        self.late.extend(late.iter().map(|late| (Some(i), home, Late { offset: offset + late.offset, ..*late })));
        let doc = tree.doc.unwrap_or_default().into();
        self.program.globals.push(Global { name: tree.name.text.clone(), bare: true, ty, offset, constant: false, doc });
        self.note_instances(ty, offset);
        self.write_instance_paths(ty, offset, &tree.name.text);
    }

    /// Notes the instances with resources and those of classes inside of a variable.
    fn note_instances(&mut self, ty: TypeId, offset: u32) {
        self.resources_in(ty, offset);
        self.instances_in(ty, offset, &mut |c, class, offset, count| {
            c.program.instances.push(takt_ir::Instances { offset, class, count });
        });
    }

    /// Finds the instances of classes inside of a variable: class, offset of the first, number.
    pub(crate) fn instances_in(&mut self, ty: TypeId, offset: u32, found: &mut dyn FnMut(&mut Self, u32, u32, u32)) {
        let class = |c: &Self, ty: TypeId| c.pou_of_type.get(&ty).map_or(0, |pou| c.pous[*pou].class);
        match self.types.get(ty).clone() {
            Type::Array { elem, .. } if self.has_classes(elem) => {
                let stride = self.types.size(elem).max(1);
                let count = self.types.size(ty) / stride;
                let simple = class(self, elem);
                if simple != 0 {
                    found(self, simple, offset, count);
                }
                if simple == 0 || self.has_class_members(elem) {
                    for n in 0..count {
                        self.instances_inside(elem, offset + n * stride, found);
                    }
                }
            }
            Type::Struct(_) => {
                let own = class(self, ty);
                if own != 0 {
                    found(self, own, offset, 1);
                }
                self.instances_inside(ty, offset, found);
            }
            _ => {}
        }
    }

    fn instances_inside(&mut self, ty: TypeId, offset: u32, found: &mut dyn FnMut(&mut Self, u32, u32, u32)) {
        let Type::Struct(s) = self.types.get(ty).clone() else { return self.instances_in(ty, offset, found) };
        for field in s.fields.iter().filter(|f| s.kind != StructKind::Union && f.section != Section::InOut) {
            self.instances_in(field.ty, offset + field.offset, found);
        }
    }

    pub(crate) fn has_classes(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.has_classes(*elem),
            Type::Struct(_) => self.pou_of_type.get(&ty).is_some_and(|pou| self.pous[*pou].class != 0) || self.has_class_members(ty),
            _ => false,
        }
    }

    fn has_class_members(&self, ty: TypeId) -> bool {
        let Type::Struct(s) = self.types.get(ty) else { return false };
        s.kind != StructKind::Union && s.fields.iter().any(|f| f.section != Section::InOut && self.has_classes(f.ty))
    }

    fn resources_in(&mut self, ty: TypeId, offset: u32) {
        if let Some(make) = self.native_blocks.get(&ty).and_then(|desc| desc.resource) {
            self.program.resources.push(ResourceInstance { offset, ty, make });
            return;
        }
        match self.types.get(ty).clone() {
            Type::Array { elem, .. } if self.may_own(elem) => {
                let stride = self.types.size(elem).max(1);
                let count = self.types.size(ty) / stride;
                for n in 0..count {
                    self.resources_in(elem, offset + n * stride);
                }
            }
            Type::Struct(s) if s.kind != StructKind::Union => {
                for field in s.fields.iter().filter(|f| f.section != Section::InOut) {
                    self.resources_in(field.ty, offset + field.offset);
                }
            }
            _ => {}
        }
    }

    pub(crate) fn may_own(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.may_own(*elem),
            Type::Struct(s) => {
                self.native_blocks.get(&ty).is_some_and(|d| d.resource.is_some())
                    || s.fields.iter().any(|f| f.section != Section::InOut && self.may_own(f.ty))
            }
            _ => false,
        }
    }
}
