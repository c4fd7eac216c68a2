//! Building a body: locals, blocks, frame.

use takt_ir::{Base, Block, BlockId, Body, Const, Inst, Local, Op, SiteId, Term, Ty};

/// A body under construction. Instructions go to the current block; what follows an end goes to a block that nothing reaches and is dropped.
#[derive(Debug)]
pub(crate) struct Builder {
    pub(crate) name: String,
    pub(crate) params: u32,
    pub(crate) result: Option<Ty>,
    locals: Vec<Ty>,
    blocks: Vec<(Vec<Inst>, Option<Term>, Option<BlockId>)>,
    /// Where faults of the blocks that are made from now on lead.
    handler: Option<BlockId>,
    at: usize,
    frame: u32,
    frame_high: u32,
    entry_site: SiteId,
}

impl Builder {
    /// A body that only returns.
    pub(crate) fn empty(name: &str, entry_site: SiteId) -> Body {
        Self::new(name, entry_site).finish()
    }
    pub(crate) fn new(name: &str, entry_site: SiteId) -> Self {
        Self {
            name: name.into(),
            params: 0,
            result: None,
            locals: Vec::new(),
            blocks: vec![(Vec::new(), None, None)],
            handler: None,
            at: 0,
            frame: 0,
            frame_high: 0,
            entry_site,
        }
    }
    pub(crate) fn local(&mut self, ty: Ty) -> Local {
        self.locals.push(ty);
        Local(self.locals.len() as u32 - 1)
    }
    pub(crate) fn param(&mut self, ty: Ty) -> Local {
        debug_assert_eq!(self.params as usize, self.locals.len(), "parameters come first");
        self.params += 1;
        self.local(ty)
    }
    pub(crate) fn ty(&self, local: Local) -> Ty {
        self.locals[local.0 as usize]
    }
    pub(crate) fn push(&mut self, inst: Inst) {
        if self.blocks[self.at].1.is_some() {
            let dead = self.block();
            self.at = dead.0 as usize;
        }
        self.blocks[self.at].0.push(inst);
    }
    pub(crate) fn block(&mut self) -> BlockId {
        self.blocks.push((Vec::new(), None, self.handler));
        BlockId(self.blocks.len() as u32 - 1)
    }
    /// Faults of the blocks that are made from now on lead to `handler`; what it was before.
    pub(crate) fn guard(&mut self, handler: Option<BlockId>) -> Option<BlockId> {
        std::mem::replace(&mut self.handler, handler)
    }
    pub(crate) fn go_to(&mut self, block: BlockId) {
        self.at = block.0 as usize;
    }
    /// Ends the current block, if it has not ended.
    pub(crate) fn end(&mut self, term: Term) {
        let end = &mut self.blocks[self.at].1;
        if end.is_none() {
            *end = Some(term);
        }
    }
    /// Ends the current block with a jump and goes on there.
    pub(crate) fn continue_in(&mut self, block: BlockId) {
        self.end(Term::Jump(block));
        self.go_to(block);
    }
    pub(crate) fn int(&mut self, value: i64) -> Local {
        self.constant(Const::I64(value))
    }
    pub(crate) fn constant(&mut self, value: Const) -> Local {
        let dst = self.local(match value {
            Const::I64(_) => Ty::I64,
            Const::F32(_) => Ty::F32,
            Const::F64(_) => Ty::F64,
        });
        self.push(Inst::Const { dst, value });
        dst
    }
    pub(crate) fn op(&mut self, op: Op, args: &[Local], site: SiteId) -> Local {
        let dst = self.local(op.result());
        self.push(Inst::Op { op, dst, args: args.to_vec(), site });
        dst
    }
    pub(crate) fn address(&mut self, base: Base, offset: u32, extent: u32) -> Local {
        if let (Base::Local(local), 0) = (base, offset)
            && self.ty(local) == Ty::Addr(extent)
        {
            return local;
        }
        let dst = self.local(Ty::Addr(extent));
        self.push(Inst::Address { dst, base, offset });
        dst
    }
    /// A place in the frame.
    pub(crate) fn slot(&mut self, size: u32, align: u32) -> u32 {
        let align = align.max(1);
        let at = self.frame.checked_next_multiple_of(align).unwrap_or(u32::MAX - u32::MAX % align);
        self.frame = at.saturating_add(size);
        self.frame_high = self.frame_high.max(self.frame);
        at
    }
    /// What [`Builder::release`] goes back to.
    pub(crate) fn mark(&self) -> u32 {
        self.frame
    }
    /// Frees the slots made since the mark, for later statements.
    pub(crate) fn release(&mut self, mark: u32) {
        self.frame = mark;
    }
    /// The body, without what cannot be reached.
    pub(crate) fn finish(mut self) -> Body {
        let mut order = vec![0usize];
        let mut number = vec![u32::MAX; self.blocks.len()];
        number[0] = 0;
        let mut next = 0;
        while next < order.len() {
            let term = self.blocks[order[next]].1.get_or_insert(Term::Return(None)).clone();
            next += 1;
            for target in targets(&term).into_iter().chain(self.blocks[order[next - 1]].2) {
                if number[target.0 as usize] == u32::MAX {
                    number[target.0 as usize] = order.len() as u32;
                    order.push(target.0 as usize);
                }
            }
        }
        let blocks = order.iter().map(|i| {
            let (insts, term, handler) = std::mem::take(&mut self.blocks[*i]);
            let handler = handler.map(|block| BlockId(number[block.0 as usize]));
            Block { insts, term: renumber(term.expect("ended above"), &number), handler }
        });
        Body {
            blocks: blocks.collect(),
            name: self.name,
            params: self.params,
            locals: self.locals,
            result: self.result,
            frame_size: self.frame_high.min(u32::MAX - 15).next_multiple_of(16),
            recursive: false,
            entry_site: self.entry_site,
        }
    }
}

fn targets(term: &Term) -> Vec<BlockId> {
    match term {
        Term::Jump(to) => vec![*to],
        Term::Branch { then, other, .. } => vec![*then, *other],
        Term::Switch { cases, default, .. } => cases.iter().map(|(_, to)| *to).chain([*default]).collect(),
        Term::Return(_) | Term::Fault(..) | Term::Rethrow(_) => Vec::new(),
    }
}

fn renumber(term: Term, number: &[u32]) -> Term {
    let new = |b: BlockId| BlockId(number[b.0 as usize]);
    match term {
        Term::Jump(to) => Term::Jump(new(to)),
        Term::Branch { cond, then, other } => Term::Branch { cond, then: new(then), other: new(other) },
        Term::Switch { value, cases, default } => {
            Term::Switch { value, cases: cases.into_iter().map(|(v, b)| (v, new(b))).collect(), default: new(default) }
        }
        end => end,
    }
}
