//! One body: types and numbers of operands, and the extent of every access.

use super::{Defect, VerifyError, ensure, flow};
use crate::inst::{Base, Block, BlockId, Body, BodyId, Const, Inst, Local, SiteId, Term, Ty};
use crate::memory::NATIVE_WORDS;
use crate::program::{NULL_ZONE, Program};

pub(super) fn check(program: &Program, id: BodyId) -> Result<(), VerifyError> {
    let body = &program.bodies[id.0 as usize];
    let checker = Checker { program, body };
    let in_body = |error: VerifyError| VerifyError { body: Some(id), ..error };
    checker.head().map_err(|defect| in_body(defect.into()))?;
    for (number, block) in body.blocks.iter().enumerate() {
        let place = |inst, defect| VerifyError { body: Some(id), block: Some(BlockId(number as u32)), inst: Some(inst), defect };
        for (i, inst) in block.insts.iter().enumerate() {
            checker.inst(inst).map_err(|defect| place(i, defect))?;
            let begins = i == 0 && body.blocks.iter().any(|b| b.handler == Some(BlockId(number as u32)));
            ensure(begins || !matches!(inst, Inst::Catch { .. }), Defect::Handler).map_err(|defect| place(i, defect))?;
        }
        checker.handler(block).map_err(|defect| place(block.insts.len(), defect))?;
        checker.term(block).map_err(|defect| place(block.insts.len(), defect))?;
    }
    flow::check(body).map_err(in_body)
}

struct Checker<'a> {
    program: &'a Program,
    body: &'a Body,
}

impl Checker<'_> {
    fn head(&self) -> Result<(), Defect> {
        ensure(self.body.params as usize <= self.body.locals.len(), Defect::Parameters)?;
        ensure(self.body.frame_size.is_multiple_of(16), Defect::Size(self.body.frame_size))?;
        ensure(!self.body.blocks.is_empty(), Defect::Block(0))?;
        ensure(!matches!(self.body.result, Some(Ty::Addr(_))), Defect::Address)?;
        self.site(self.body.entry_site)
    }

    fn inst(&self, inst: &Inst) -> Result<(), Defect> {
        match inst {
            Inst::Const { dst, value } => self.needs(*dst, value.ty()),
            Inst::Op { op, dst, args, site } => {
                self.needs(*dst, op.result())?;
                ensure(args.len() == op.args().len(), Defect::Arity { expected: op.args().len(), found: args.len() })?;
                args.iter().zip(op.args()).try_for_each(|(arg, ty)| self.needs(*arg, *ty))?;
                self.site(*site)
            }
            Inst::Copy { dst, src } => fits(self.ty(*dst)?, self.ty(*src)?),
            Inst::Load { dst, mem, base, offset } => {
                self.needs(*dst, mem.ty())?;
                self.access(*base, *offset, mem.size())
            }
            Inst::Store { src, mem, base, offset } => {
                self.needs(*src, mem.ty())?;
                self.access(*base, *offset, mem.size())
            }
            Inst::Address { dst, base, offset } => self.access(*base, *offset, self.extent(*dst)?),
            Inst::Pointer { dst, base, offset } => {
                self.needs(*dst, Ty::I64)?;
                self.access(*base, *offset, 0)
            }
            Inst::Index { .. } => self.index(inst),
            Inst::Check { index, low, high, site } => {
                [index, low, high].into_iter().try_for_each(|local| self.needs(*local, Ty::I64))?;
                self.site(*site)
            }
            Inst::Deref { dst, pointer, site } => {
                self.extent(*dst)?;
                self.needs(*pointer, Ty::I64)?;
                self.site(*site)
            }
            Inst::Move { dst, dst_offset, src, src_offset, len } => {
                self.access(*dst, *dst_offset, *len)?;
                self.access(*src, *src_offset, *len)
            }
            Inst::Data { dst, offset, data, len } => {
                let end = u64::from(*data) + u64::from(*len);
                ensure(end <= self.program.data.len() as u64, Defect::Data { from: *data, len: *len })?;
                self.access(*dst, *offset, *len)
            }
            Inst::Call { .. } | Inst::Native { .. } | Inst::Virtual { .. } => self.call(inst),
            Inst::IsA { dst, pointer, family } => {
                ensure((*family as usize) < self.program.families.len(), Defect::Family(*family))?;
                self.needs(*dst, Ty::I64)?;
                self.needs(*pointer, Ty::I64)
            }
            Inst::Place { offset, class, count } => {
                let size = self.program.class(*class).ok_or(Defect::Class(*class))?.size;
                let bytes = u32::try_from(u64::from(size) * u64::from(*count)).map_err(|_| Defect::Class(*class))?;
                ensure(offset.is_multiple_of(takt_abi::GRANULE as u32), Defect::Class(*class))?;
                self.access(Base::Frame, *offset, bytes)
            }
            Inst::Guard { dst } => self.needs(*dst, Ty::I64),
            Inst::Catch { dst, depth } => self.needs(*dst, Ty::I64).and_then(|()| self.needs(*depth, Ty::I64)),
            Inst::Poll { site, .. } => self.site(*site),
        }
    }

    fn index(&self, inst: &Inst) -> Result<(), Defect> {
        let Inst::Index { dst, base, offset, index, low, high, stride, site } = inst else { return Ok(()) };
        self.needs(*index, Ty::I64)?;
        ensure(low <= high, Defect::Bounds { low: *low, high: *high })?;
        let reach = (i128::from(*high) - i128::from(*low)) * i128::from(*stride) + i128::from(self.extent(*dst)?);
        self.reach(*base, *offset, reach)?;
        self.site(*site)
    }

    fn call(&self, inst: &Inst) -> Result<(), Defect> {
        match inst {
            Inst::Call { body, args, dst, site } => {
                let callee = self.program.bodies.get(body.0 as usize).ok_or(Defect::Body(body.0))?;
                ensure(args.len() == callee.params as usize, Defect::Arity { expected: callee.params as usize, found: args.len() })?;
                for (arg, param) in args.iter().zip(&callee.locals) {
                    fits(*param, self.ty(*arg)?)?;
                }
                if let Some(dst) = dst {
                    self.needs(*dst, callee.result.ok_or(Defect::Result)?)?;
                }
                self.site(*site)
            }
            Inst::Virtual { method, this, args, dst, site } => {
                let callee = self.program.dispatch.get(*method as usize).ok_or(Defect::Method(*method))?;
                self.needs(*this, Ty::I64)?;
                ensure(args.len() == callee.params.len(), Defect::Arity { expected: callee.params.len(), found: args.len() })?;
                args.iter().zip(&callee.params).try_for_each(|(arg, param)| fits(*param, self.ty(*arg)?))?;
                if let Some(dst) = dst {
                    self.needs(*dst, callee.result.ok_or(Defect::Result)?)?;
                }
                self.site(*site)
            }
            Inst::Native { native, args, dst, site } => {
                ensure((native.0 as usize) < self.program.natives.len(), Defect::Native(native.0))?;
                ensure(args.len() < NATIVE_WORDS, Defect::Arity { expected: NATIVE_WORDS - 1, found: args.len() })?;
                args.iter().try_for_each(|arg| self.ty(*arg).map(drop))?;
                if let Some(dst) = dst {
                    ensure(!matches!(self.ty(*dst)?, Ty::Addr(_)), Defect::Address)?;
                }
                self.site(*site)
            }
            _ => Ok(()),
        }
    }

    /// A handler takes the fault that led to it.
    fn handler(&self, block: &Block) -> Result<(), Defect> {
        let Some(handler) = block.handler else { return Ok(()) };
        self.block(handler)?;
        ensure(matches!(self.body.blocks[handler.0 as usize].insts.first(), Some(Inst::Catch { .. })), Defect::Handler)
    }

    fn term(&self, block: &Block) -> Result<(), Defect> {
        match &block.term {
            Term::Jump(target) => self.block(*target),
            Term::Branch { cond, then, other } => {
                self.needs(*cond, Ty::I64)?;
                self.block(*then)?;
                self.block(*other)
            }
            Term::Switch { value, cases, default } => {
                self.needs(*value, Ty::I64)?;
                cases.iter().map(|(_, target)| target).chain([default]).try_for_each(|target| self.block(*target))?;
                let mut labels: Vec<i64> = cases.iter().map(|(label, _)| *label).collect();
                labels.sort_unstable();
                labels.windows(2).try_for_each(|pair| ensure(pair[0] != pair[1], Defect::Label(pair[0])))
            }
            Term::Return(result) => match (result, self.body.result) {
                (None, None) => Ok(()),
                (Some(local), Some(ty)) => self.needs(*local, ty),
                _ => Err(Defect::Result),
            },
            Term::Fault(_, site) => self.site(*site),
            Term::Rethrow(code) => self.needs(*code, Ty::I64),
        }
    }

    fn ty(&self, local: Local) -> Result<Ty, Defect> {
        self.body.locals.get(local.0 as usize).copied().ok_or(Defect::Local(local.0))
    }
    fn needs(&self, local: Local, expected: Ty) -> Result<(), Defect> {
        fits(expected, self.ty(local)?)
    }
    fn extent(&self, local: Local) -> Result<u32, Defect> {
        if let Ty::Addr(extent) = self.ty(local)? { Ok(extent) } else { Err(Defect::NoAddress) }
    }
    fn block(&self, target: BlockId) -> Result<(), Defect> {
        ensure((target.0 as usize) < self.body.blocks.len(), Defect::Block(target.0))
    }
    fn site(&self, site: SiteId) -> Result<(), Defect> {
        ensure((site.0 as usize) < self.program.sites.len(), Defect::Site(site.0))
    }
    fn access(&self, base: Base, offset: u32, len: u32) -> Result<(), Defect> {
        self.reach(base, offset, len.into())
    }
    /// Whether `len` bytes from `offset` lie in the base; in the image they begin behind the null zone.
    fn reach(&self, base: Base, offset: u32, len: i128) -> Result<(), Defect> {
        let size = match base {
            Base::Image => self.program.image_size,
            Base::Frame => self.body.frame_size,
            Base::Local(local) => self.extent(local)?,
        };
        let end = i128::from(offset) + len;
        let fine = end <= size.into() && (base != Base::Image || offset >= NULL_ZONE);
        ensure(fine, Defect::Extent { from: offset.into(), to: u64::try_from(end).unwrap_or(u64::MAX), size: size.into() })
    }
}

/// Whether a value of type `found` may be taken as `expected`: equal, or an address with at least that extent.
fn fits(expected: Ty, found: Ty) -> Result<(), Defect> {
    let fine = match (expected, found) {
        (Ty::Addr(need), Ty::Addr(have)) => need <= have,
        _ => expected == found,
    };
    ensure(fine, Defect::Mismatch { expected, found })
}

impl Const {
    /// Type of the local that takes it.
    fn ty(self) -> Ty {
        match self {
            Self::I64(_) => Ty::I64,
            Self::F32(_) => Ty::F32,
            Self::F64(_) => Ty::F64,
        }
    }
}
