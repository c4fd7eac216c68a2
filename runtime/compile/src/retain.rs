//! RETAIN and PERSISTENT: which variables outlive a restart, and what code at the start does with them.
//!
//! A variable is retained as it is declared. A block with a retained variable of its own is retained whole, wherever an instance of it lies; of what
//! contains it, only that instance is. A PERSISTENT variable of a block that is retained whole is listed apart, because it outlives a cold start too.

use crate::address::indices;
use crate::expression::{Kind, Lowering, Operand};
use crate::scope::{Owner, PouKind, Storage};
use crate::unit::Compiler;
use std::collections::HashMap;
use takt_abi::Section;
use takt_ir::{Area, Base, Inst, Mem, Op, RetainKind, Retained, StructKind, Term, Type, TypeId};
use takt_syntax::tree::{Unit, VarBlock, VarKind};
use takt_syntax::{Code, Span};

/// What a section says of its variables.
pub(crate) fn kind_of(block: &VarBlock) -> Option<RetainKind> {
    match (block.constant, block.persistent, block.retain) {
        (true, ..) | (_, false, false) => None,
        (_, true, _) => Some(RetainKind::Persistent),
        _ => Some(RetainKind::Retain),
    }
}

/// A walk through the variables of a program.
#[derive(Default)]
struct Walk {
    found: Vec<Retained>,
    path: String,
    /// Whether something in variables of a type is retained by itself.
    holds: HashMap<TypeId, bool>,
}

impl<'a> Compiler<'a> {
    /// Lists what outlives a restart, once everything has its place.
    pub(crate) fn list_retained(&mut self) {
        self.retained_blocks();
        let mut walk = Walk::default();
        self.retained_globals(&mut walk);
        for pou in 0..self.pous.len() {
            self.retained_variables(pou, &mut walk);
        }
        for kind in [RetainKind::Retain, RetainKind::Persistent] {
            let places = walk.found.iter().filter(|r| r.kind == kind);
            let mut ranges: Vec<(u32, u32)> = places.map(|r| (r.offset, r.offset.saturating_add(self.types.size(r.ty)))).collect();
            ranges.sort_unstable();
            ranges.dedup_by(|next, last| {
                let inside = next.0 <= last.1;
                last.1 = if inside { last.1.max(next.1) } else { last.1 };
                inside
            });
            self.kept_ranges[kind as usize] = ranges;
        }
        self.program.retained = walk.found;
        if !self.program.retained.is_empty() {
            let span = Span { file: takt_syntax::FileId(0), start: 0, end: 0 };
            self.program.restart = self.take(takt_ir::retain::RESTART_BYTES, 1, span);
        }
    }

    /// What the own variables of blocks and of their bases ask for, those of methods included.
    fn retained_blocks(&mut self) {
        let mut own = vec![(false, false); self.pous.len()];
        for (i, pou) in self.pous.iter().enumerate() {
            let (of, wanted): (usize, &[VarKind]) = match (pou.tree.kind, pou.owner) {
                (PouKind::FunctionBlock, _) => (i, &[VarKind::Var, VarKind::Input, VarKind::Output]),
                (PouKind::Method, Some(Owner::Pou(owner))) => (owner, &[VarKind::Inst]),
                _ => continue,
            };
            for kind in pou.tree.vars.iter().filter(|b| wanted.contains(&b.kind) && !b.vars.is_empty()).filter_map(kind_of) {
                own[of].0 |= kind == RetainKind::Retain;
                own[of].1 |= kind == RetainKind::Persistent;
            }
        }
        let all = |pou: usize| self.bases(pou).fold((false, false), |all, b| (all.0 | own[b].0, all.1 | own[b].1));
        let kinds = (0..self.pous.len()).map(|pou| match all(pou) {
            (true, _) => Some(RetainKind::Retain),
            (false, true) => Some(RetainKind::Persistent),
            (false, false) => None,
        });
        self.block_kinds = kinds.collect();
    }

    fn retained_globals(&mut self, walk: &mut Walk) {
        for i in 0..self.globals.len() {
            let Some(var) = self.globals[i].var.clone() else { continue };
            walk.path = self.global_path(i);
            self.retained_place(var.decl, &var.storage, var.ty, (self.globals[i].retain, None), walk);
        }
    }

    /// The variables of a program, and what lives as long as it elsewhere: VAR_STAT.
    fn retained_variables(&mut self, pou: usize, walk: &mut Walk) {
        let tree = self.pous[pou].tree;
        let outer = (tree.kind == PouKind::Program && self.is_retained_program(pou)).then_some(RetainKind::Retain);
        if let Some(kind) = outer {
            let (ty, path) = (self.pou_type(pou), tree.name.text.clone());
            walk.found.push(Retained { path, ty, offset: self.pous[pou].instance, kind });
        }
        let name = self.pou_name(pou);
        for block in tree.vars {
            let kind = kind_of(block);
            let lives = match (tree.kind, block.kind) {
                (_, VarKind::Stat) => true,
                (PouKind::Program, VarKind::Var | VarKind::Input | VarKind::Output) => true,
                (PouKind::FunctionBlock, VarKind::Var | VarKind::Input | VarKind::Output) => continue,
                (PouKind::Method, VarKind::Inst) | (_, VarKind::External) => continue,
                _ => false,
            };
            if let (false, Some(kind), Some(first)) = (lives, kind, block.vars.first()) {
                let what = kind.text();
                self.without_effect(first.name.span, format!("{what} has no effect here: these variables live for one call"));
            }
            for decl in block.vars.iter().filter(|_| lives) {
                let Some(var) = self.pous[pou].vars.iter().find(|v| v.span == decl.name.span).cloned() else { continue };
                let (storage, outer) = match var.storage {
                    Storage::This(offset) => (Storage::Image(self.pous[pou].instance.saturating_add(offset)), outer),
                    other => (other, None),
                };
                walk.path = format!("{name}.{}", decl.name.text);
                self.retained_place(decl, &storage, var.ty, (kind, outer), walk);
            }
        }
    }

    fn without_effect(&mut self, span: Span, message: String) {
        if (span.file.0 as usize) < self.user_files {
            self.report(Code::NoEffect, span, message);
        }
    }

    fn retained_place(
        &mut self,
        decl: &'a takt_syntax::tree::VarDecl,
        storage: &Storage,
        ty: TypeId,
        (kind, outer): (Option<RetainKind>, Option<RetainKind>),
        walk: &mut Walk,
    ) {
        let (offset, ty) = match *storage {
            Storage::Image(offset) => (offset, ty),
            Storage::Bit(offset, bit) => (offset, self.types.intern(Type::Bit(bit))),
            _ => return,
        };
        if let (Some(kind), Some(address)) = (kind, self.fixed_address(decl).filter(|a| a.area != Area::Memory)) {
            let (what, area) = (kind.text(), address.area.letter());
            return self.without_effect(decl.name.span, format!("{what} has no effect on what lies at %{area}: the bus decides its value"));
        }
        if kind.is_some() && self.holds_pointers(ty) && (decl.name.span.file.0 as usize) < self.user_files {
            let name = &decl.name.text;
            self.report(Code::NotKept, decl.name.span, format!("what points elsewhere in `{name}` is not kept over a restart")).help =
                Some("pointers, references and interfaces get their initial values; keep an index or a name instead".into());
        }
        self.walk_retained(ty, offset, (kind, outer), walk);
    }

    fn holds_pointers(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => true,
            Type::Array { elem, .. } => self.holds_pointers(*elem),
            Type::Struct(s) if matches!(s.kind, StructKind::Struct | StructKind::Union) => {
                s.fields.iter().any(|f| self.holds_pointers(f.ty))
            }
            _ => false,
        }
    }

    /// PROGRAM RETAIN in a CONFIGURATION.
    fn is_retained_program(&self, pou: usize) -> bool {
        let units = self.trees.iter().take(self.user_files).flat_map(|tree| &tree.units);
        let mut programs = units.filter_map(|u| if let Unit::Configuration(c) = u { Some(&c.programs) } else { None }).flatten();
        let name = &self.pous[pou].tree.name.text;
        programs.any(|p| p.retain && crate::scope::same(&p.ty.text, name))
    }

    /// How instances of a block are retained as a whole.
    pub(crate) fn block_kind(&self, pou: usize) -> Option<RetainKind> {
        self.block_kinds.get(pou).copied().flatten()
    }

    fn own_kind(&self, ty: TypeId) -> Option<RetainKind> {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.own_kind(*elem),
            Type::Struct(_) => self.block_kind(*self.pou_of_type.get(&ty)?),
            _ => None,
        }
    }

    /// Adds a variable if it is kept longer than what it is part of, then what in it is kept longer still.
    fn walk_retained(&mut self, ty: TypeId, offset: u32, (kind, outer): (Option<RetainKind>, Option<RetainKind>), walk: &mut Walk) {
        let wanted = kind.max(self.own_kind(ty)).max(outer);
        if let Some(kind) = wanted.filter(|_| wanted > outer) {
            walk.found.push(Retained { path: walk.path.clone(), ty, offset, kind });
        }
        if wanted == Some(RetainKind::Persistent) || !self.holds_retained(ty, walk) {
            return;
        }
        let len = walk.path.len();
        match self.types.get(ty).clone() {
            Type::Array { elem, dims } => {
                let stride = self.types.size(elem).max(1);
                for n in 0..self.types.size(ty) / stride {
                    walk.path.push_str(&indices(&dims, n));
                    self.walk_retained(elem, offset + n * stride, (None, wanted), walk);
                    walk.path.truncate(len);
                }
            }
            Type::Struct(s) if s.kind != StructKind::Union => {
                let block = self.pou_of_type.get(&ty).copied();
                for field in s.fields.iter().filter(|f| f.section != Section::InOut) {
                    walk.path.push('.');
                    walk.path.push_str(&field.name);
                    let kind = block.and_then(|pou| self.member_kind(pou, &field.name));
                    self.walk_retained(field.ty, offset + field.offset, (kind, wanted), walk);
                    walk.path.truncate(len);
                }
            }
            _ => {}
        }
    }

    /// What the section of a block's variable says.
    fn member_kind(&self, pou: usize, name: &str) -> Option<RetainKind> {
        let blocks = self.bases(pou).flat_map(|b| self.pous[b].tree.vars);
        let of = |block: &&VarBlock| block.vars.iter().any(|decl| crate::scope::same(&decl.name.text, name));
        blocks.into_iter().find(of).and_then(kind_of)
    }

    fn holds_retained(&self, ty: TypeId, walk: &mut Walk) -> bool {
        if let Some(known) = walk.holds.get(&ty) {
            return *known;
        }
        let holds = match self.types.get(ty) {
            Type::Array { elem, .. } => self.holds_retained(*elem, walk),
            Type::Struct(s) if s.kind != StructKind::Union => {
                self.pou_of_type.get(&ty).is_some_and(|pou| self.block_kind(*pou).is_some())
                    || s.fields.iter().any(|f| f.section != Section::InOut && self.holds_retained(f.ty, walk))
            }
            _ => false,
        };
        walk.holds.insert(ty, holds);
        holds
    }

    /// How long the retained variable is kept that a place of the image is part of.
    pub(crate) fn retained_at(&self, offset: u32) -> Option<RetainKind> {
        let inside = |kind: &RetainKind| {
            let ranges = &self.kept_ranges[*kind as usize];
            let behind = ranges.partition_point(|(start, _)| *start <= offset);
            behind.checked_sub(1).is_some_and(|i| offset < ranges[i].1)
        };
        [RetainKind::Persistent, RetainKind::Retain].into_iter().find(inside)
    }
}

impl<'a> Lowering<'_, 'a> {
    /// The argument `bInitRetains` of FB_Init: FALSE where retained values were put back.
    pub(crate) fn init_retains(&mut self, ty: TypeId, span: Span) -> Operand {
        let restart = self.c.program.restart;
        if restart == 0 {
            return self.constant(crate::constant::Value::Int(1), ty, span);
        }
        let site = self.site(span);
        let (switch, inside, one, zero) = (self.switch(0), self.switch(1), self.b.int(1), self.b.int(0));
        let warm = self.b.op(Op::Eq, &[switch, one], site);
        let kept = self.b.op(Op::Or, &[warm, inside], site);
        let initial = self.b.op(Op::Eq, &[kept, zero], site);
        Operand { ty, kind: Kind::Temp(initial), span, flex: false, exact: true, fixed: None, dynamic: false }
    }

    fn switch(&mut self, byte: u32) -> takt_ir::Local {
        let dst = self.b.local(takt_ir::Ty::I64);
        self.b.push(Inst::Load { dst, mem: Mem::U8, base: Base::Image, offset: self.c.program.restart + byte });
        dst
    }

    /// Does something at the start in a retained place: what was put back there is not initialised again.
    pub(crate) fn in_retained(&mut self, kind: Option<RetainKind>, span: Span, work: impl FnOnce(&mut Self)) {
        let Some(kind) = kind.filter(|_| self.c.program.restart != 0) else { return work(self) };
        let (offset, site) = (self.c.program.restart + 1, self.site(span));
        let (before, switch) = (self.switch(1), self.switch(0));
        let put_back = match kind {
            RetainKind::Retain => {
                let one = self.b.int(1);
                self.b.op(Op::Eq, &[switch, one], site)
            }
            RetainKind::Persistent => {
                let zero = self.b.int(0);
                self.b.op(Op::Ne, &[switch, zero], site)
            }
        };
        let inside = self.b.op(Op::Or, &[before, put_back], site);
        self.b.push(Inst::Store { src: inside, mem: Mem::U8, base: Base::Image, offset });
        work(self);
        self.b.push(Inst::Store { src: before, mem: Mem::U8, base: Base::Image, offset });
    }

    /// Does something at the start unless the place's value was put back.
    pub(crate) fn unless_kept(&mut self, work: impl FnOnce(&mut Self)) {
        if self.c.program.restart == 0 {
            return work(self);
        }
        let cond = self.switch(1);
        let (then, other) = (self.b.block(), self.b.block());
        self.b.end(Term::Branch { cond, then: other, other: then });
        self.b.go_to(then);
        work(self);
        self.b.continue_in(other);
    }

    /// Whether a place points elsewhere, so that it is initialised at every start.
    pub(crate) fn points(&self, ty: TypeId) -> bool {
        matches!(self.c.types.get(ty), Type::Pointer(_) | Type::Reference(_) | Type::Interface(_))
    }
}
