//! The reference interpreter: what a program does, said as plainly as possible. The oracle of the machine code.
//!
//! It keeps its own stack of calls, so that no program can use up the native one, and checks every access to the image again, whatever the verifier
//! found. Locals are 64-bit words; an address is an offset into the image.
//!
//! **Order at the entry of a body:** the frame is checked against the end of the stack region (only if the body has one), then the depth against its
//! limit and one unit of fuel (only in a recursive cycle). All three are at the body's declaration. [`Fault::StackOverflow`] reports the depth
//! before the refused entry.

use crate::inst::{Base, BlockId, Body, BodyId, Const, Inst, Local, Mem, NativeId, SiteId, Term, Ty};
use crate::memory::{self, NATIVE_WORDS};
use crate::op::Op;
use crate::program::{NULL_ZONE, Program};
use takt_abi::{Context, Fault};

/// Runs a body on the image of `ctx`: 0, or the code of the fault that ended it, with its facts, site and call stack in `ctx`.
///
/// `frame` is the offset at which the body's frame starts (the task's stack region). `ctx.image` must point to `ctx.image_size` live bytes, `ctx.env` to a
/// live environment. After a fault `ctx.depth` is what it was where the fault happened; the engine sets it back.
pub fn run_body(program: &Program, body: BodyId, frame: u64, ctx: &mut Context) -> u32 {
    Interpreter::new(program).run(program, body, frame, ctx)
}

/// An interpreter with its memory, which is kept from run to run.
#[derive(Debug, Default)]
pub struct Interpreter {
    words: Vec<u64>,
    calls: Vec<Call>,
    result: u64,
}

/// A caller, while its callee runs.
#[derive(Debug, Clone, Copy)]
struct Call {
    body: BodyId,
    block: BlockId,
    /// Where it goes on.
    next: usize,
    /// First of its words.
    base: usize,
    frame: u64,
    dst: Option<Local>,
    site: SiteId,
}

impl Interpreter {
    /// An interpreter with room for the program's usual calls; deeper ones grow it.
    pub fn new(program: &Program) -> Self {
        let locals: usize = program.bodies.iter().map(|b| b.locals.len()).sum();
        Self { words: Vec::with_capacity(locals.min(1 << 16)), calls: Vec::with_capacity(program.bodies.len().min(1 << 10)), result: 0 }
    }

    /// As [`run_body`].
    pub fn run(&mut self, program: &Program, body: BodyId, frame: u64, ctx: &mut Context) -> u32 {
        self.words.clear();
        self.calls.clear();
        self.result = 0;
        let run = Run { program, body: &program.bodies[body.0 as usize], id: body, base: 0, frame, own: self, ctx };
        match run.all() {
            Ok(()) => 0,
            Err(code) => {
                for call in self.calls.iter().rev() {
                    ctx.push_trace(call.site.0);
                }
                code
            }
        }
    }

    /// What the last run returned, as a word (see [`crate::Word`]); 0 without a result or after a fault.
    pub fn result(&self) -> u64 {
        self.result
    }
}

/// A run under way: the body that is running, its words and frame. Errors are codes of faults that are already in the context.
struct Run<'a> {
    program: &'a Program,
    body: &'a Body,
    id: BodyId,
    base: usize,
    frame: u64,
    own: &'a mut Interpreter,
    ctx: &'a mut Context,
}

impl<'a> Run<'a> {
    fn all(mut self) -> Result<(), u32> {
        self.enter(&[])?;
        let (mut block, mut next) = (BlockId(0), 0);
        loop {
            let code = &self.body.blocks[block.0 as usize];
            match code.insts.get(next) {
                Some(Inst::Call { body, args, dst, site }) => {
                    let (id, base, frame) = (self.id, self.base, self.frame);
                    self.own.calls.push(Call { body: id, block, next: next + 1, base, frame, dst: *dst, site: *site });
                    self.call(*body, args)?;
                    (block, next) = (BlockId(0), 0);
                }
                Some(inst) => {
                    self.step(inst)?;
                    next += 1;
                }
                None => match self.end(&code.term)? {
                    Some(target) => (block, next) = (target, 0),
                    None => match self.own.calls.pop() {
                        Some(caller) => (block, next) = self.resume(caller),
                        None => return Ok(()),
                    },
                },
            }
        }
    }

    fn get(&self, local: Local) -> u64 {
        self.own.words[self.base + local.0 as usize]
    }
    fn set(&mut self, local: Local, word: u64) {
        self.own.words[self.base + local.0 as usize] = word;
    }
    fn fail(&mut self, fault: Fault, site: SiteId) -> u32 {
        self.ctx.fail(fault, site.0)
    }
    /// The offset of an access.
    fn place(&self, base: Base, offset: u32) -> u64 {
        let start = match base {
            Base::Image => 0,
            Base::Frame => self.frame,
            Base::Local(local) => self.get(local),
        };
        start.wrapping_add(offset.into())
    }
    /// What the verifier should have excluded has no site of its own: it is reported at the declaration.
    fn checked<T>(&mut self, result: Result<T, Fault>) -> Result<T, u32> {
        result.map_err(|fault| self.fail(fault, self.body.entry_site))
    }

    /// Makes the words of the body that starts to run and checks frame, depth and fuel.
    fn enter(&mut self, args: &[Local]) -> Result<(), u32> {
        let caller = self.own.calls.last().map_or(0, |c| c.base);
        self.base = self.own.words.len();
        self.own.words.resize(self.base + self.body.locals.len(), 0);
        for (i, arg) in args.iter().enumerate() {
            self.own.words[self.base + i] = self.own.words[caller + arg.0 as usize];
        }
        let (size, site) = (self.body.frame_size, self.body.entry_site);
        let overflow = Fault::StackOverflow { depth: self.ctx.depth };
        if size > 0 && self.frame.checked_add(size.into()).is_none_or(|end| end > self.ctx.stack_end) {
            return Err(self.fail(overflow, site));
        }
        if self.body.recursive {
            if self.ctx.depth >= self.ctx.depth_limit {
                return Err(self.fail(overflow, site));
            }
            self.ctx.depth += 1;
            self.poll(1, site)?;
        }
        Ok(())
    }
    fn call(&mut self, id: BodyId, args: &[Local]) -> Result<(), u32> {
        self.frame = self.frame.wrapping_add(self.body.frame_size.into());
        self.id = id;
        self.body = &self.program.bodies[id.0 as usize];
        self.enter(args)
    }
    /// Back in the caller, which gets its result.
    fn resume(&mut self, caller: Call) -> (BlockId, usize) {
        self.own.words.truncate(self.base);
        (self.id, self.base, self.frame) = (caller.body, caller.base, caller.frame);
        self.body = &self.program.bodies[caller.body.0 as usize];
        if let Some(dst) = caller.dst {
            let result = self.own.result;
            self.set(dst, result);
        }
        (caller.block, caller.next)
    }

    /// The next block, or `None` at a return.
    fn end(&mut self, term: &Term) -> Result<Option<BlockId>, u32> {
        Ok(Some(match term {
            Term::Jump(target) => *target,
            Term::Branch { cond, then, other } => {
                if self.get(*cond) != 0 {
                    *then
                } else {
                    *other
                }
            }
            Term::Switch { value, cases, default } => {
                let value = self.get(*value) as i64;
                cases.iter().find(|(label, _)| *label == value).map_or(*default, |(_, target)| *target)
            }
            Term::Return(result) => {
                self.own.result = result.map_or(0, |local| self.get(local));
                self.ctx.depth = self.ctx.depth.wrapping_sub(self.body.recursive.into());
                return Ok(None);
            }
            Term::Fault(fault, site) => return Err(self.fail(*fault, *site)),
        }))
    }

    fn step(&mut self, inst: &Inst) -> Result<(), u32> {
        match inst {
            Inst::Const { dst, value } => self.set(
                *dst,
                match *value {
                    Const::I64(v) => v as u64,
                    Const::F32(bits) => bits.into(),
                    Const::F64(bits) => bits,
                },
            ),
            Inst::Op { op, dst, args, site } => self.op(*op, *dst, args, *site)?,
            Inst::Copy { dst, src } => self.set(*dst, self.get(*src)),
            Inst::Load { dst, mem, base, offset } => {
                let word = memory::load(self.ctx, *mem, self.place(*base, *offset));
                let word = self.checked(word)?;
                self.set(*dst, word);
            }
            Inst::Store { src, mem, base, offset } => {
                let (place, word) = (self.place(*base, *offset), self.get(*src));
                let done = memory::store(self.ctx, *mem, place, word);
                self.checked(done)?;
            }
            Inst::Address { dst, base, offset } | Inst::Pointer { dst, base, offset } => self.set(*dst, self.place(*base, *offset)),
            Inst::Index { dst, base, offset, index, low, high, stride, site } => {
                let index = self.bounded(self.get(*index) as i64, *low, *high, *site)?;
                let behind = (index.wrapping_sub(*low) as u64).wrapping_mul((*stride).into());
                self.set(*dst, self.place(*base, *offset).wrapping_add(behind));
            }
            Inst::Check { index, low, high, site } => {
                let [index, low, high] = [*index, *low, *high].map(|local| self.get(local) as i64);
                self.bounded(index, low, high, *site)?;
            }
            Inst::Deref { dst, pointer, site } => self.deref(*dst, *pointer, *site)?,
            Inst::Move { dst, dst_offset, src, src_offset, len } => {
                let (dst, src) = (self.place(*dst, *dst_offset), self.place(*src, *src_offset));
                let done = memory::copy(self.ctx, dst, src, (*len).into());
                self.checked(done)?;
            }
            Inst::Data { dst, offset, data, len } => {
                let from = &self.program.data[*data as usize..][..*len as usize];
                let done = memory::write(self.ctx, self.place(*dst, *offset), from);
                self.checked(done)?;
            }
            Inst::Native { native, args, dst, site } => self.native(*native, args, *dst, *site)?,
            Inst::Poll { cost, site } => self.poll(*cost, *site)?,
            Inst::Call { .. } => {}
        }
        Ok(())
    }

    fn op(&mut self, op: Op, dst: Local, args: &[Local], site: SiteId) -> Result<(), u32> {
        let mut words = [0; 3];
        for (word, arg) in words.iter_mut().zip(args) {
            *word = self.get(*arg);
        }
        if op.faults() && words[1] == 0 {
            return Err(self.fail(Fault::DivisionByZero, site));
        }
        self.set(dst, op.eval(words));
        Ok(())
    }
    fn bounded(&mut self, value: i64, low: i64, high: i64, site: SiteId) -> Result<i64, u32> {
        if (low..=high).contains(&value) { Ok(value) } else { Err(self.fail(Fault::Index { value, low, high }, site)) }
    }
    fn deref(&mut self, dst: Local, pointer: Local, site: SiteId) -> Result<(), u32> {
        let Ty::Addr(extent) = self.body.locals[dst.0 as usize] else { return Err(self.fail(Fault::Panic, site)) };
        let (offset, size) = (self.get(pointer), u64::from(extent));
        if offset == 0 {
            return Err(self.fail(Fault::NullPointer, site));
        }
        let inside = offset.checked_add(size).is_some_and(|end| end <= self.ctx.image_size);
        if offset < NULL_ZONE.into() || !inside {
            return Err(self.fail(Fault::WildPointer { offset, size }, site));
        }
        self.set(dst, offset);
        Ok(())
    }
    fn native(&mut self, native: NativeId, args: &[Local], dst: Option<Local>, site: SiteId) -> Result<(), u32> {
        let mut words = [0; NATIVE_WORDS];
        for (word, arg) in words[..NATIVE_WORDS - 1].iter_mut().zip(args) {
            // The processor's NaNs have bits of their own; a native function must not see them.
            *word = match self.body.locals[arg.0 as usize] {
                Ty::F32 => memory::canonical(Mem::F32, self.get(*arg)),
                Ty::F64 => memory::canonical(Mem::F64, self.get(*arg)),
                Ty::I64 | Ty::Addr(_) => self.get(*arg),
            };
        }
        let call = self.program.natives[native.0 as usize].call;
        let code = memory::call_native(self.ctx, call, &mut words);
        if code != 0 {
            return Err(self.stopped(code, site));
        }
        if let Some(dst) = dst {
            let narrow = self.body.locals[dst.0 as usize] == Ty::F32;
            self.set(dst, if narrow { words[0] & 0xFFFF_FFFF } else { words[0] });
        }
        Ok(())
    }
    fn poll(&mut self, cost: u32, site: SiteId) -> Result<(), u32> {
        self.ctx.fuel = self.ctx.fuel.wrapping_sub(cost.into());
        if self.ctx.fuel >= 0 && self.ctx.flag.load(std::sync::atomic::Ordering::Relaxed) == 0 {
            return Ok(());
        }
        match memory::call_poll(self.ctx, site.0) {
            0 => Ok(()),
            code => Err(self.stopped(code, site)),
        }
    }
    /// A fault that a native block or the engine has recorded: what is missing is where.
    fn stopped(&mut self, code: u32, site: SiteId) -> u32 {
        self.ctx.fault_site = site.0;
        self.ctx.trace_len = 0;
        code
    }
}
