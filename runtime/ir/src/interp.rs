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
    /// Where the last run ended with a fault.
    stopped: Option<Call>,
    result: u64,
    /// Accesses refused that the verifier should have excluded. Not 0: a defect of the verifier.
    pub(crate) escapes: u32,
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
        Self {
            words: Vec::with_capacity(locals.min(1 << 16)),
            calls: Vec::with_capacity(program.bodies.len().min(1 << 10)),
            ..Self::default()
        }
    }

    /// As [`run_body`].
    pub fn run(&mut self, program: &Program, body: BodyId, frame: u64, ctx: &mut Context) -> u32 {
        self.words.clear();
        self.calls.clear();
        (self.result, self.stopped) = (0, None);
        let mut run = Run { program, body: &program.bodies[body.0 as usize], id: body, base: 0, frame, own: self, ctx };
        let ended = run.all();
        let (body, base, frame) = (run.id, run.base, run.frame);
        match ended {
            Ok(()) => 0,
            Err(code) => {
                let site = SiteId(ctx.fault_site);
                self.stopped = Some(Call { body, block: BlockId(0), next: 0, base, frame, dst: None, site });
                for call in self.calls.iter().rev() {
                    ctx.push_trace(call.site.0);
                }
                code
            }
        }
    }

    /// The calls under way when the last run ended with a fault, the innermost first: body, where it was, its locals as words, and where its
    /// frame starts.
    pub fn stopped(&self) -> impl Iterator<Item = (BodyId, SiteId, &[u64], u64)> {
        let calls = self.stopped.iter().chain(self.stopped.iter().flat_map(|_| self.calls.iter().rev()));
        calls.scan(self.words.len(), |end, call| {
            let words = self.words.get(call.base..*end).unwrap_or_default();
            *end = call.base;
            Some((call.body, call.site, words, call.frame))
        })
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
    fn all(&mut self) -> Result<(), u32> {
        self.enter(None, &[])?;
        let mut at = (BlockId(0), 0);
        loop {
            match self.turn(at) {
                Ok(Some(next)) => at = next,
                Ok(None) => return Ok(()),
                Err(code) => at = (self.handler(code, at.0).ok_or(code)?, 0),
            }
        }
    }

    /// One instruction or end of a block; where it goes on, `None` at the end of the run.
    #[inline(always)]
    fn turn(&mut self, (block, next): (BlockId, usize)) -> Result<Option<(BlockId, usize)>, u32> {
        let body = self.body;
        let code = &body.blocks[block.0 as usize];
        match code.insts.get(next) {
            Some(Inst::Call { body, args, dst, site }) => {
                self.leave((block, next), *dst, *site);
                self.call(*body, None, args)?;
                Ok(Some((BlockId(0), 0)))
            }
            Some(Inst::Virtual { method, this, args, dst, site }) => {
                let body = self.dispatch(*method, self.get(*this), *site)?;
                self.leave((block, next), *dst, *site);
                self.call(body, Some(*this), args)?;
                Ok(Some((BlockId(0), 0)))
            }
            Some(inst) => {
                self.step(inst)?;
                Ok(Some((block, next + 1)))
            }
            None => Ok(match self.end(&code.term)? {
                Some(target) => Some((target, 0)),
                None => self.own.calls.pop().map(|caller| self.resume(caller)),
            }),
        }
    }

    /// Where a fault in that block leads: the handler of the block, or of the nearest caller that has one, in whose body we are then.
    fn handler(&mut self, code: u32, block: BlockId) -> Option<BlockId> {
        if !Fault::catchable(code) {
            return None;
        }
        if let Some(handler) = self.body.blocks[block.0 as usize].handler {
            return Some(handler);
        }
        let of = |call: &Call| self.program.bodies[call.body.0 as usize].blocks[call.block.0 as usize].handler;
        let depth = self.own.calls.iter().rposition(|call| of(call).is_some())?;
        let caller = self.own.calls[depth];
        let handler = of(&caller);
        self.own.calls.truncate(depth);
        self.resume(Call { dst: None, ..caller });
        self.own.words.truncate(self.base + self.body.locals.len());
        handler
    }

    /// Notes where the caller goes on.
    #[inline(always)]
    fn leave(&mut self, (block, next): (BlockId, usize), dst: Option<Local>, site: SiteId) {
        self.own.calls.push(Call { body: self.id, block, next: next + 1, base: self.base, frame: self.frame, dst, site });
    }

    /// The body that a method has for the instance.
    fn dispatch(&mut self, method: u32, this: u64, site: SiteId) -> Result<BodyId, u32> {
        if this == 0 {
            return Err(self.fail(Fault::NullPointer, site));
        }
        let class = memory::class_at(self.ctx, this);
        let target = self.program.dispatch[method as usize].target(class);
        target.ok_or_else(|| self.fail(Fault::NoInstance { offset: this }, site))
    }

    #[inline(always)]
    fn get(&self, local: Local) -> u64 {
        self.own.words[self.base + local.0 as usize]
    }
    #[inline(always)]
    fn set(&mut self, local: Local, word: u64) {
        self.own.words[self.base + local.0 as usize] = word;
    }
    fn fail(&mut self, fault: Fault, site: SiteId) -> u32 {
        self.ctx.fail(fault, site.0)
    }
    /// The offset of an access.
    #[inline(always)]
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
        result.map_err(|fault| {
            self.own.escapes += 1;
            self.fail(fault, self.body.entry_site)
        })
    }

    /// Makes the words of the body that starts to run and checks frame, depth and fuel.
    fn enter(&mut self, this: Option<Local>, args: &[Local]) -> Result<(), u32> {
        let caller = self.own.calls.last().map_or(0, |c| c.base);
        self.base = self.own.words.len();
        self.own.words.resize(self.base + self.body.locals.len(), 0);
        for (i, arg) in this.iter().chain(args).enumerate() {
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
    fn call(&mut self, id: BodyId, this: Option<Local>, args: &[Local]) -> Result<(), u32> {
        self.frame = self.frame.wrapping_add(self.body.frame_size.into());
        self.id = id;
        self.body = &self.program.bodies[id.0 as usize];
        self.enter(this, args)
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
            Term::Rethrow(code) => return Err(self.ctx.again(self.get(*code))),
        }))
    }

    #[inline(always)]
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
            Inst::IsA { dst, pointer, family } => {
                let class = memory::class_at(self.ctx, self.get(*pointer));
                self.set(*dst, self.program.families[*family as usize].has(class).into());
            }
            Inst::Place { offset, class, count } => {
                let stride = self.program.class(*class).map_or(takt_abi::GRANULE, |class| class.size.into());
                memory::place(self.ctx, self.frame.wrapping_add((*offset).into()), *class, stride, (*count).into());
            }
            Inst::Guard { dst } => self.set(*dst, self.ctx.depth.into()),
            Inst::Catch { dst, depth } => {
                self.set(*dst, self.ctx.fault_code.into());
                (self.ctx.fault_code, self.ctx.trace_len, self.ctx.depth) = (0, 0, self.get(*depth) as u32);
            }
            Inst::Call { .. } | Inst::Virtual { .. } => {}
        }
        Ok(())
    }

    #[inline]
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
    #[inline]
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

#[cfg(test)]
mod tests {
    use crate::testing::{Outcome, program, run, run_with, sample};
    use takt_abi::Fault;

    /// Runs one body without parameters; `code` is what stands behind `body "main"`.
    #[track_caller]
    fn main(code: &str) -> Outcome {
        run(&program(&format!("image 256\nbody \"main\" {code}")))
    }
    /// The result of a body.
    #[track_caller]
    fn result(locals: &str, code: &str) -> i64 {
        let outcome = main(&format!("() -> i64 frame 32 @0 local {locals} b0: {code}"));
        assert_eq!(outcome.fault, None);
        outcome.result as i64
    }
    #[track_caller]
    fn fault(locals: &str, code: &str) -> (Fault, u32) {
        let outcome = main(&format!("() frame 32 @0 local {locals} b0: {code} return"));
        (outcome.fault.expect("a fault"), outcome.site)
    }

    #[test]
    fn the_sample_runs_to_its_end() {
        let outcome = run(&sample());
        assert_eq!((outcome.fault, outcome.escapes, outcome.depth), (None, 0, 0));
        assert_eq!(outcome.image[70..72], 0i16.to_le_bytes());
        assert_eq!(&outcome.image[144..150], b"hallo\0");
        assert_eq!(&outcome.image[160..166], b"hallo\0");
        assert_eq!(outcome.image[200], 5);
        // Six turns, and Count(1) enters Down twice.
        assert_eq!(outcome.fuel, 1000 - 6 - 2);
    }

    #[test]
    fn loads_extend_and_stores_cut() {
        for (mem, expected) in
            [("bool", 1), ("i8", -2), ("u8", 254), ("i16", -2), ("u16", 65534), ("i32", -2), ("u32", 4_294_967_294), ("i64", -2)]
        {
            let code = format!("v0 = const -2 store.{mem} frame+8, v0 v0 = load.{mem} frame+8 return v0");
            assert_eq!(result("i64", &code), expected, "{mem}");
        }
        assert_eq!(result("i64", "v0 = const -1 store.u8 frame+3, v0 v0 = load.u32 frame+0 return v0"), 0xFF00_0000);
    }

    #[test]
    fn a_store_makes_nan_canonical_and_a_copy_does_not() {
        let nan32 = "v0 = const.f32 0xffc12345 store.f32 image+16, v0 v1 = load.u32 image+16 return v1";
        assert_eq!(result("f32, i64", nan32), 0x7FC0_0000);
        let nan64 = "v0 = const.f64 0xfff8000000000001 v2 = copy v0 store.f64 image+16, v2 v1 = load.i64 image+16 return v1";
        assert_eq!(result("f64, i64, f64", nan64), 0x7FF8_0000_0000_0000);
        let moved = "v0 = const -1 store.i64 image+16, v0 move image+24, image+16, 8 v0 = load.i64 image+24 return v0";
        assert_eq!(result("i64", moved), -1);
    }

    #[test]
    fn a_local_that_was_not_written_is_zero_at_every_entry() {
        let text = "image 256 body \"main\" () -> i64 @0 local i64 b0: v0 = call 1() v0 = call 1() return v0
            body \"f\" () -> i64 @0 local i64, i64 b0: v1 = const 1 v0 = add v0, v1 return v0";
        assert_eq!(run(&program(text)).result, 1);
    }

    #[test]
    fn moves_may_overlap() {
        let code =
            "v0 = const 16#".replace("16#", "513") + " store.u16 frame+0, v0 move frame+1, frame+0, 2 v0 = load.u32 frame+0 return v0";
        assert_eq!(result("i64", &code), 0x02_01_01);
    }

    #[test]
    fn an_index_outside_its_bounds_is_a_fault_with_its_facts() {
        for value in [-3, 5, i64::MIN, i64::MAX] {
            let code = format!("v0 = const {value} v1 = index image+16 [v0 in -2..4 by 8] @7");
            assert_eq!(fault("i64, addr:8", &code), (Fault::Index { value, low: -2, high: 4 }, 7));
        }
        let bounds = format!("{}..{}", i64::MIN, i64::MAX);
        let whole = format!("v0 = const {} v1 = index image+16 [v0 in {bounds} by 0] v0 = pointer v1+0 return v0", i64::MAX);
        assert_eq!(result("i64, addr:8", &whole), 16);
        assert_eq!(result("i64, addr:8", "v0 = const 4 v1 = index image+24 [v0 in -2..4 by 8] v0 = pointer v1+8 return v0"), 24 + 48 + 8);
        let check = "v0 = const 5 v1 = const 1 v2 = const 4 check v0 in v1..v2 @3";
        assert_eq!(fault("i64, i64, i64", check), (Fault::Index { value: 5, low: 1, high: 4 }, 3));
    }

    #[test]
    fn a_pointer_is_checked_at_both_ends() {
        let deref = |pointer: i64| format!("v0 = const {pointer} v1 = deref v0 @4");
        assert_eq!(fault("i64, addr:8", &deref(0)), (Fault::NullPointer, 4));
        for pointer in [1, 15, 249, 256, -1, i64::MAX] {
            assert_eq!(fault("i64, addr:8", &deref(pointer)), (Fault::WildPointer { offset: pointer as u64, size: 8 }, 4));
        }
        for pointer in [16, 248] {
            assert_eq!(result("i64, addr:8", &format!("{} v0 = pointer v1+0 return v0", deref(pointer))), pointer);
        }
    }

    #[test]
    fn division_by_zero_is_a_fault_and_modulo_zero_is_zero() {
        assert_eq!(fault("i64, i64", "v0 = const 1 v0 = div v0, v1 @2"), (Fault::DivisionByZero, 2));
        assert_eq!(fault("i64, i64", "v0 = const 1 v0 = div.u v0, v1 @2"), (Fault::DivisionByZero, 2));
        assert_eq!(result("i64, i64", "v0 = const 7 v0 = rem v0, v1 return v0"), 0);
        assert_eq!(result("i64, i64", "v0 = const -9223372036854775808 v1 = const -1 v0 = div v0, v1 return v0"), i64::MIN);
    }

    #[test]
    fn a_fault_tells_the_calls_from_inside_outwards() {
        let text = "image 256
            body \"main\" () @0 b0: call 1() @1 return
            body \"f\" () @2 b0: call 2() @3 return
            body \"g\" () @4 b0: fault block 77 @5";
        let outcome = run(&program(text));
        assert_eq!((outcome.fault, outcome.site, outcome.trace), (Some(Fault::Block { error: 77 }), 5, vec![3, 1]));
    }

    #[test]
    fn recursion_ends_at_the_depth_limit() {
        let text = "image 256 body \"main\" () @0 b0: call 1() @1 return body \"f\" () recursive @2 b0: call 1() @3 return";
        let outcome = run(&program(text));
        let trace: Vec<u32> = vec![3; 20].into_iter().chain([1]).collect();
        assert_eq!((outcome.fault, outcome.site, outcome.trace), (Some(Fault::StackOverflow { depth: 20 }), 2, trace));
        assert_eq!((outcome.depth, outcome.fuel), (20, 1000 - 20));
    }

    #[test]
    fn a_frame_that_leaves_the_stack_region_is_refused_before_depth_and_fuel() {
        let text = "image 256 task \"T\" freewheeling priority 0 entry 0 stack 128 48
            body \"main\" () frame 16 @0 b0: call 1() @1 return
            body \"f\" () frame 16 recursive @2 b0: call 1() @3 return";
        let outcome = run(&program(text));
        assert_eq!((outcome.fault, outcome.site), (Some(Fault::StackOverflow { depth: 2 }), 2));
        assert_eq!((outcome.trace, outcome.fuel), (vec![3, 3, 1], 998));
    }

    #[test]
    fn frames_lie_one_behind_the_other() {
        let text = "image 256
            body \"main\" () frame 16 @0 local i64 b0: v0 = const 1 store.i64 frame+0, v0 call 1() call 1() return
            body \"f\" () @0 b0: call 2() return
            body \"g\" () frame 16 @0 local i64 b0: v0 = const 2 store.i64 frame+8, v0 return";
        let outcome = run(&program(text));
        assert_eq!(outcome.image[192..].chunks(8).map(|c| c[0]).collect::<Vec<_>>(), [1, 0, 0, 2, 0, 0, 0, 0]);
    }

    #[test]
    fn an_endless_loop_ends_with_its_fuel_or_at_the_flag() {
        let endless = program("image 256 body \"main\" () @0 b0: call 1() @1 return body \"f\" () @2 b0: poll 3 @3 jump b0");
        let outcome = run(&endless);
        assert_eq!((outcome.fault, outcome.site, outcome.trace, outcome.fuel), (Some(Fault::Watchdog), 3, vec![1], -2));
        let outcome = run_with(&endless, 0, 1000, 1);
        assert_eq!((outcome.fault, outcome.fuel), (Some(Fault::Watchdog), 997));
    }

    #[test]
    fn a_native_fault_gets_the_site_of_its_call() {
        let text = "image 256 native STR_COMPARE
            body \"main\" () @0 b0: call 1() @1 return
            body \"f\" () @2 local i64, i64 b0: v0 = const 250 v1 = const 20 native STR_COMPARE(v0, v1, v0, v1) @3 return";
        let outcome = run(&program(text));
        assert_eq!((outcome.fault, outcome.site, outcome.trace), (Some(Fault::WildPointer { offset: 250, size: 20 }), 3, vec![1]));
    }

    #[test]
    fn what_the_verifier_let_through_is_still_refused() {
        let mut escaped = program("image 256 body \"main\" () @6 local i64 b0: v0 = load.i64 image+16 return");
        escaped.bodies[0].blocks[0].insts[0] =
            crate::Inst::Load { dst: crate::Local(0), mem: crate::Mem::I64, base: crate::Base::Image, offset: 250 };
        let outcome = run(&escaped);
        assert_eq!((outcome.fault, outcome.site, outcome.escapes), (Some(Fault::WildPointer { offset: 250, size: 8 }), 6, 1));
    }
}
