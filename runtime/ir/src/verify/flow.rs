//! Addresses are written before they are read, on every way through a body.
//!
//! A forward analysis: an address is known at the start of a block if it is known at the end of every block that leads there.

use super::{Defect, VerifyError};
use crate::inst::{Base, Block, BlockId, Body, Inst, Local, Term, Ty};

pub(super) fn check(body: &Body) -> Result<(), VerifyError> {
    let mut count = 0;
    let slots: Vec<Option<usize>> = body.locals.iter().map(|ty| number(*ty, &mut count)).collect();
    if count == 0 {
        return Ok(());
    }
    let none = Known { slots: &slots, set: vec![0; count.div_ceil(64)] };
    for (id, (start, block)) in starts(body, &none).into_iter().zip(&body.blocks).enumerate() {
        let mut known = Known { slots: &slots, set: start };
        for (i, inst) in block.insts.iter().enumerate() {
            let place = |defect: Defect| VerifyError { body: None, block: Some(BlockId(id as u32)), inst: Some(i), defect };
            known.read(inst).map_err(place)?;
            known.write(inst);
        }
        // No end of a block reads an address: conditions, values and results are numbers.
    }
    Ok(())
}

fn number(ty: Ty, count: &mut usize) -> Option<usize> {
    matches!(ty, Ty::Addr(_)).then(|| {
        *count += 1;
        *count - 1
    })
}

/// What is known at the start of each block; everything in blocks that nothing leads to.
fn starts(body: &Body, none: &Known<'_>) -> Vec<Vec<u64>> {
    let mut starts = vec![vec![u64::MAX; none.set.len()]; body.blocks.len()];
    let mut entry = none.clone();
    (0..body.params).for_each(|i| entry.add(Local(i)));
    starts[0] = entry.set;
    let mut reached = vec![false; body.blocks.len()];
    reached[0] = true;
    let mut waiting = vec![0];
    while let Some(id) = waiting.pop() {
        let mut known = Known { slots: none.slots, set: starts[id].clone() };
        // A fault may strike before the first address is written.
        let handler = body.blocks[id].handler.map(|handler| (handler, known.set.clone()));
        body.blocks[id].insts.iter().for_each(|inst| known.write(inst));
        let next = successors(&body.blocks[id]).into_iter().map(|next| (next, known.set.clone()));
        for (BlockId(next), known) in next.chain(handler) {
            let next = next as usize;
            let mut changed = !std::mem::replace(&mut reached[next], true);
            for (at_start, at_end) in starts[next].iter_mut().zip(&known) {
                changed |= *at_start & !at_end != 0;
                *at_start &= at_end;
            }
            if changed {
                waiting.push(next);
            }
        }
    }
    starts
}

fn successors(block: &Block) -> Vec<BlockId> {
    match &block.term {
        Term::Jump(target) => vec![*target],
        Term::Branch { then, other, .. } => vec![*then, *other],
        Term::Switch { cases, default, .. } => cases.iter().map(|(_, target)| *target).chain([*default]).collect(),
        Term::Return(_) | Term::Fault(..) | Term::Rethrow(_) => vec![],
    }
}

/// The addresses that have been written: a bit for each local of type [`Ty::Addr`].
#[derive(Clone)]
struct Known<'a> {
    slots: &'a [Option<usize>],
    set: Vec<u64>,
}

impl Known<'_> {
    fn add(&mut self, local: Local) {
        if let Some(slot) = self.slots[local.0 as usize] {
            self.set[slot / 64] |= 1 << (slot % 64);
        }
    }
    fn need(&self, local: Local) -> Result<(), Defect> {
        match self.slots[local.0 as usize] {
            Some(slot) if self.set[slot / 64] & 1 << (slot % 64) == 0 => Err(Defect::Unassigned(local.0)),
            _ => Ok(()),
        }
    }
    fn need_base(&self, base: Base) -> Result<(), Defect> {
        if let Base::Local(local) = base { self.need(local) } else { Ok(()) }
    }
    fn read(&self, inst: &Inst) -> Result<(), Defect> {
        match inst {
            Inst::Copy { src, .. } => self.need(*src),
            Inst::Load { base, .. }
            | Inst::Store { base, .. }
            | Inst::Address { base, .. }
            | Inst::Index { base, .. }
            | Inst::Pointer { base, .. }
            | Inst::Data { dst: base, .. } => self.need_base(*base),
            Inst::Move { dst, src, .. } => self.need_base(*dst).and_then(|()| self.need_base(*src)),
            Inst::Call { args, .. } | Inst::Native { args, .. } | Inst::Virtual { args, .. } => {
                args.iter().try_for_each(|arg| self.need(*arg))
            }
            Inst::Const { .. }
            | Inst::Op { .. }
            | Inst::Check { .. }
            | Inst::Deref { .. }
            | Inst::IsA { .. }
            | Inst::Place { .. }
            | Inst::Guard { .. }
            | Inst::Catch { .. }
            | Inst::Poll { .. } => Ok(()),
        }
    }
    fn write(&mut self, inst: &Inst) {
        if let Inst::Copy { dst, .. } | Inst::Address { dst, .. } | Inst::Index { dst, .. } | Inst::Deref { dst, .. } = inst {
            self.add(*dst);
        }
    }
}
