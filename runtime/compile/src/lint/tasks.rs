//! Variables that tasks share: written by two, or seen half changed.
//!
//! Read off the IR, where each access of a global has an offset. What a body does behind the addresses it is given is found once per body
//! ([`Effects::params`]) and holds for all its calls. Accesses through pointers are unknown and silent.

use crate::scope::{PouKind, Storage};
use crate::unit::Compiler;
use rustc_hash::FxHashMap as HashMap;
use std::collections::BTreeSet;
use takt_ir::{Base, Body, CallGraph, Inst, Local, Program, StructKind, Ty, Type, TypeId};
use takt_syntax::{Code, Note, Span};

/// Bytes that are never torn.
const WORD: u32 = 8;

/// Bytes of the image: first, and behind the last.
type Range = (u32, u32);

/// What a body does with memory.
#[derive(Debug, Default, Clone, PartialEq)]
struct Effects {
    reads: BTreeSet<Range>,
    writes: BTreeSet<Range>,
    /// Parameters behind which it reads and writes.
    params: HashMap<u32, (bool, bool)>,
    /// What pointers, references and VAR_IN_OUT are made to.
    pointed: BTreeSet<Range>,
    /// Parameters to what is behind which they are made.
    pointed_params: BTreeSet<u32>,
}

/// Where a local of a body points.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    Image(Range),
    Param(u32),
}

/// A variable that several tasks can name.
struct Shared {
    name: String,
    range: Range,
    span: Span,
    /// Elementary, or a block: nothing that two tasks fill together, as they do when they hand values over.
    single: bool,
}

/// What a task does, and with which unit.
struct Share {
    task: usize,
    unit: usize,
    reads: BTreeSet<Range>,
    writes: BTreeSet<Range>,
}

impl Compiler<'_> {
    /// Reports what tasks share badly.
    pub(super) fn lint_tasks(&mut self) {
        if self.program.tasks.len() < 2 {
            return;
        }
        let effects = all_effects(&self.program);
        let unit_of: HashMap<usize, usize> = self.pous.iter().enumerate().filter_map(|(i, p)| Some((p.body?.0 as usize, i))).collect();
        let graph = CallGraph::new(&self.program);
        let reached: Vec<Vec<usize>> =
            self.program.tasks.iter().map(|task| reached(&self.program, &graph, task.entry.0 as usize)).collect();
        for variable in self.shared() {
            let mut shares: Vec<Share> = Vec::new();
            for (task, bodies) in reached.iter().enumerate() {
                for body in bodies {
                    let Some(unit) = unit_of.get(body).copied() else { continue };
                    let (reads, writes) = (inside(&effects[*body].reads, variable.range), inside(&effects[*body].writes, variable.range));
                    if !reads.is_empty() || !writes.is_empty() {
                        shares.push(Share { task, unit, reads, writes });
                    }
                }
            }
            if !variable.single || !self.two_writers(&variable, &shares) {
                self.half_changed(&variable, &shares);
            }
        }
    }

    /// Globals, and variables of programs.
    fn shared(&self) -> Vec<Shared> {
        let mut found = Vec::new();
        for (global, var) in self.globals.iter().filter_map(|g| Some((g, g.var.as_ref()?))) {
            if let (Storage::Image(start), true) = (&var.storage, (var.span.file.0 as usize) < self.user_files && !global.constant) {
                let range = (*start, start.saturating_add(self.types.size(var.ty)));
                found.push(Shared { name: var.name.clone(), range, span: var.span, single: self.is_single(var.ty) });
            }
        }
        for pou in self.pous.iter().filter(|pou| pou.tree.kind == PouKind::Program && !pou.library) {
            for var in &pou.vars {
                let Storage::This(offset) = var.storage else { continue };
                let start = pou.instance.saturating_add(offset);
                let range = (start, start.saturating_add(self.types.size(var.ty)));
                let name = format!("{}.{}", pou.tree.name.text, var.name);
                found.push(Shared { name, range, span: var.span, single: self.is_single(var.ty) });
            }
        }
        found
    }

    fn is_single(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Struct(s) => s.kind == StructKind::Block,
            Type::Array { .. } | Type::OpenArray { .. } => false,
            _ => true,
        }
    }

    /// Finds the variables with `{attribute 'task_snapshot'}` and the tasks that write them, or may do so through a pointer that they make.
    pub(crate) fn find_latched(&mut self) {
        let marked = self.marked();
        if marked.is_empty() || self.program.tasks.len() < 2 {
            return;
        }
        let effects = all_effects(&self.program);
        let graph = CallGraph::new(&self.program);
        let reached: Vec<Vec<usize>> =
            self.program.tasks.iter().map(|task| reached(&self.program, &graph, task.entry.0 as usize)).collect();
        for (ty, offset) in marked {
            let range = (offset, offset.saturating_add(self.types.size(ty)));
            let writes = |body: &usize| {
                let effects = &effects[*body];
                !inside(&effects.writes, range).is_empty() || !inside(&effects.pointed, range).is_empty()
            };
            let writers = reached.iter().enumerate().filter(|(_, bodies)| bodies.iter().any(writes)).map(|(task, _)| task as u32);
            let writers = writers.collect();
            self.program.latched.push(takt_ir::Latched { ty, offset, writers });
        }
    }

    fn two_writers(&mut self, variable: &Shared, shares: &[Share]) -> bool {
        let clash = shares.iter().enumerate().find_map(|(i, a)| {
            let b = shares[i + 1..].iter().find(|b| b.task != a.task && overlap(&a.writes, &b.writes).next().is_some())?;
            Some((a, b))
        });
        let Some((a, b)) = clash else { return false };
        let message = format!("`{}` is written in the tasks {} and {}", variable.name, self.task_name(a.task), self.task_name(b.task));
        let notes = vec![self.share_note(a, "written"), self.share_note(b, "written")];
        let diagnostic = self.report(Code::TwoWriters, variable.span, message);
        diagnostic.notes = notes;
        diagnostic.help = Some("let one task write it; give the other a variable of its own for what it asks for".into());
        true
    }

    fn half_changed(&mut self, variable: &Shared, shares: &[Share]) {
        let copied = |share: &Share| {
            let latched = self.program.latched.iter().find(|l| l.offset == variable.range.0);
            latched.is_some_and(|l| !l.writers.contains(&(share.task as u32)))
        };
        let priority = |share: &Share| self.program.tasks[share.task].priority;
        let torn = shares.iter().find_map(|writer| {
            let reader = shares.iter().filter(|reader| !copied(reader)).find(|reader| {
                let common: BTreeSet<Range> = overlap(&writer.writes, &reader.reads).collect();
                priority(reader) != priority(writer) && (common.len() > 1 || common.iter().any(|(start, end)| end - start > WORD))
            })?;
            Some((writer, reader))
        });
        let Some((writer, reader)) = torn else { return };
        let (writing, reading) = (self.task_name(writer.task), self.task_name(reader.task));
        let message = format!("`{}` is written in the task {writing} and read in {reading}, which may see it half changed", variable.name);
        let notes = vec![self.share_note(writer, "written"), self.share_note(reader, "read")];
        let diagnostic = self.report(Code::SharedData, variable.span, message);
        diagnostic.notes = notes;
        diagnostic.help =
            Some("put {attribute 'task_snapshot'} before it, so that the reader sees a copy; or give both tasks the same priority".into());
    }

    fn task_name(&self, task: usize) -> String {
        format!("`{}`", self.program.tasks[task].name)
    }

    fn share_note(&self, share: &Share, verb: &str) -> Note {
        let message = format!("{verb} in `{}`, in the task {}", self.pou_name(share.unit), self.task_name(share.task));
        Note { span: self.pous[share.unit].tree.name.span, message }
    }
}

/// The bodies that run in a task.
fn reached(program: &Program, graph: &CallGraph, entry: usize) -> Vec<usize> {
    let (mut seen, mut open, mut found) = (vec![false; graph.nodes()], vec![entry], Vec::new());
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut seen[node], true) {
            // Behind the bodies stand the methods that are found by class.
            found.extend(Some(node).filter(|node| *node < program.bodies.len()));
            open.extend(graph.calls(node));
        }
    }
    found.sort_unstable();
    found
}

/// The effects of the bodies that tasks reach; what is called comes first, so that only cycles of calls need a second pass.
fn all_effects(program: &Program) -> Vec<Effects> {
    let mut effects = vec![Effects::default(); program.bodies.len()];
    let order = callees_first(program);
    let cyclic = order.iter().any(|body| program.bodies[*body].recursive);
    loop {
        let mut changed = false;
        for i in &order {
            let body = &program.bodies[*i];
            let walk = Walk { body, all: &effects, targets: vec![None; body.locals.len()], found: Effects::default() };
            let found = walk.run();
            changed |= cyclic && (&found.params, &found.pointed_params) != (&effects[*i].params, &effects[*i].pointed_params);
            effects[*i] = found;
        }
        if !changed {
            return effects;
        }
    }
}

/// The bodies that tasks reach, each behind those it calls (but for cycles).
fn callees_first(program: &Program) -> Vec<usize> {
    let graph = CallGraph::new(program);
    let mut seen = vec![false; graph.nodes()];
    let mut order = Vec::new();
    for task in &program.tasks {
        let mut open = vec![(task.entry.0 as usize, false)];
        while let Some((node, done)) = open.pop() {
            if done {
                // Behind the bodies stand the methods that are found by class.
                order.extend(Some(node).filter(|node| *node < program.bodies.len()));
            } else if !std::mem::replace(&mut seen[node], true) {
                open.push((node, true));
                open.extend(graph.calls(node).iter().filter(|callee| !seen[**callee]).map(|callee| (*callee, false)));
            }
        }
    }
    order
}

struct Walk<'p> {
    body: &'p Body,
    all: &'p [Effects],
    /// Per local, where it points.
    targets: Vec<Option<Target>>,
    found: Effects,
}

impl Walk<'_> {
    fn run(mut self) -> Effects {
        for param in 0..self.body.params {
            if let Some(Ty::Addr(_)) = self.body.locals.get(param as usize) {
                self.set(Local(param), Some(Target::Param(param)));
            }
        }
        let body = self.body;
        body.blocks.iter().flat_map(|block| &block.insts).for_each(|inst| self.step(inst));
        self.found
    }

    fn step(&mut self, inst: &Inst) {
        match inst {
            Inst::Load { dst, mem, base, offset } => {
                self.access(*base, *offset, mem.size(), true, false);
                self.set(*dst, None);
            }
            Inst::Store { mem, base, offset, .. } => self.access(*base, *offset, mem.size(), false, true),
            Inst::Data { dst, offset, len, .. } => self.access(*dst, *offset, *len, false, true),
            Inst::Move { dst, dst_offset, src, src_offset, len } => {
                self.access(*src, *src_offset, *len, true, false);
                self.access(*dst, *dst_offset, *len, false, true);
            }
            Inst::Address { dst, base, offset } | Inst::Pointer { dst, base, offset } => {
                let len = self.extent(*dst);
                if let Inst::Pointer { .. } = inst {
                    self.lend(self.target(*base, *offset, len));
                }
                self.point(*dst, *base, *offset, len);
            }
            Inst::Index { dst, base, offset, low, high, stride, .. } => {
                let count = high.saturating_sub(*low).saturating_add(1).clamp(0, u32::MAX.into()) as u32;
                self.point(*dst, *base, *offset, stride.saturating_mul(count));
            }
            Inst::Call { body, args, .. } => self.call(body.0 as usize, args),
            Inst::Native { args, .. } => args.iter().for_each(|arg| self.touch(*arg, (true, true))),
            Inst::Virtual { this, args, .. } => std::iter::once(this).chain(args).for_each(|arg| self.touch(*arg, (true, true))),
            Inst::Copy { dst, src } => self.set(*dst, self.get(*src)),
            Inst::Const { dst, .. } | Inst::Op { dst, .. } | Inst::Deref { dst, .. } => self.set(*dst, None),
            _ => {}
        }
    }

    fn get(&self, local: Local) -> Option<Target> {
        self.targets.get(local.0 as usize).copied().flatten()
    }

    fn set(&mut self, local: Local, target: Option<Target>) {
        if let Some(known) = self.targets.get_mut(local.0 as usize) {
            *known = target;
        }
    }

    fn extent(&self, local: Local) -> u32 {
        match self.body.locals.get(local.0 as usize) {
            Some(Ty::Addr(extent)) => *extent,
            _ => 1,
        }
    }

    fn target(&self, base: Base, offset: u32, len: u32) -> Option<Target> {
        match base {
            Base::Image => Some(Target::Image((offset, offset.saturating_add(len)))),
            Base::Frame => None,
            Base::Local(local) => match self.get(local)? {
                // An element may be any: all of the array is meant.
                Target::Image((start, end)) if end - start > self.extent(local) => Some(Target::Image((start, end))),
                Target::Image((start, _)) => {
                    let start = start.saturating_add(offset);
                    Some(Target::Image((start, start.saturating_add(len))))
                }
                param => Some(param),
            },
        }
    }

    fn point(&mut self, dst: Local, base: Base, offset: u32, len: u32) {
        self.set(dst, self.target(base, offset, len));
    }

    fn access(&mut self, base: Base, offset: u32, len: u32, reads: bool, writes: bool) {
        if let Some(target) = self.target(base, offset, len) {
            self.note(target, (reads, writes));
        }
    }

    fn touch(&mut self, arg: Local, how: (bool, bool)) {
        if let Some(target) = self.get(arg) {
            self.note(target, how);
        }
    }

    fn call(&mut self, body: usize, args: &[Local]) {
        for (param, arg) in args.iter().enumerate() {
            if self.all.get(body).is_some_and(|effects| effects.pointed_params.contains(&(param as u32))) {
                self.lend(self.get(*arg));
            }
            let how = self.all.get(body).and_then(|effects| effects.params.get(&(param as u32))).copied();
            how.into_iter().for_each(|how| self.touch(*arg, how));
        }
    }

    /// Somebody may write it later, wherever the pointer goes.
    fn lend(&mut self, target: Option<Target>) {
        match target {
            Some(Target::Image(range)) => drop(self.found.pointed.insert(range)),
            Some(Target::Param(param)) => drop(self.found.pointed_params.insert(param)),
            None => {}
        }
    }

    fn note(&mut self, target: Target, (reads, writes): (bool, bool)) {
        match target {
            Target::Image(range) => {
                reads.then(|| self.found.reads.insert(range));
                writes.then(|| self.found.writes.insert(range));
            }
            Target::Param(param) => {
                let known = self.found.params.entry(param).or_default();
                *known = (known.0 || reads, known.1 || writes);
            }
        }
    }
}

/// The parts of ranges that lie inside of a variable.
fn inside(ranges: &BTreeSet<Range>, (start, end): Range) -> BTreeSet<Range> {
    ranges.iter().filter_map(|(s, e)| Some(((*s).max(start), (*e).min(end))).filter(|(s, e)| s < e)).collect()
}

fn overlap<'r>(a: &'r BTreeSet<Range>, b: &'r BTreeSet<Range>) -> impl Iterator<Item = Range> + 'r {
    a.iter().flat_map(|a| b.iter().map(|b| (a.0.max(b.0), a.1.min(b.1)))).filter(|(start, end)| start < end)
}
