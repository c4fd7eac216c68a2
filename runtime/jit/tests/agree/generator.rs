//! Random programs that the verifier accepts: every instruction, every operator, every terminator; wild indices and pointers, divisors of 0, deep
//! recursion and endless loops among them.

use crate::bench::{IMAGE, Writer, program};
use takt_abi::Fault;
use takt_ir::{
    Base, BlockId, BodyId, Class, Dispatch, Family, Inst, Instances, Local, Mem, NULL_ZONE, Native, NativeId, Op, Program, Term, Ty, ops,
};

/// A small generator of random numbers (splitmix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }
    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

takt_abi::native_fn! {
    /// A number of all words; takes fuel.
    pub fn MIX as Mix(cx, A: i64, B: f64, C: f32) -> f64 { *cx.fuel -= 3; Ok(A as f64 * 0.5 + B - f64::from(C)) }
}
takt_abi::native_fn! {
    /// Half.
    pub fn HALF as Half(cx, A: f32) -> f32 { let _ = cx; Ok(A * 0.5) }
}
takt_abi::native_fn! {
    /// Refuses multiples of 5.
    pub fn REFUSE as Refuse(cx, A: i64) -> i64 { let _ = cx; if A % 5 == 0 { Err(Fault::Block { error: A as u32 }) } else { Ok(A.wrapping_add(1)) } }
}
takt_abi::native_fn! {
    /// Writes at an offset.
    pub fn POKE as Poke(cx, A: u64, B: i64) -> i64 { cx.store(A, &B)?; Ok(A as i64) }
}
takt_abi::native_fn! {
    /// The bits of a REAL, as they arrive.
    pub fn BITS as Bits(cx, A: f64) -> i64 { let _ = cx; Ok(A.to_bits() as i64) }
}

/// The native functions, with the types of their words (an address for the offset) and of their results.
pub fn natives() -> Vec<(Native, Vec<Ty>, Ty)> {
    let of = |desc: &takt_abi::FnDesc| Native { name: desc.name, call: desc.call };
    vec![
        (of(Mix::DESC), vec![Ty::I64, Ty::F64, Ty::F32], Ty::F64),
        (of(Half::DESC), vec![Ty::F32], Ty::F32),
        (of(Refuse::DESC), vec![Ty::I64], Ty::I64),
        (of(Poke::DESC), vec![Ty::Addr(8), Ty::I64], Ty::I64),
        (of(Bits::DESC), vec![Ty::F64], Ty::I64),
    ]
}

const MEMS: [Mem; 10] = [Mem::Bool, Mem::I8, Mem::U8, Mem::I16, Mem::U16, Mem::I32, Mem::U32, Mem::I64, Mem::F32, Mem::F64];
const EDGES: [i64; 22] =
    [0, 1, -1, 2, 3, 5, 7, 8, 15, 16, 31, 32, 63, 64, 127, 255, 256, -128, 65_535, i64::MIN, i64::MAX, i32::MIN as i64];
/// Bytes of variables that programs use.
const VARIABLES: u32 = 1024;

/// What others may call: parameters and result.
#[derive(Debug, Clone)]
struct Shape {
    params: Vec<Ty>,
    result: Option<Ty>,
    frame_size: u32,
    recursive: bool,
}

/// A program that depends on the seed only.
pub fn random_program(seed: u64) -> Program {
    let mut random = Random::new(seed.wrapping_mul(0x1234_5678_9ABC_DEF1));
    let count = 1 + random.below(5);
    let cycle = random.one_in(2);
    let shapes: Vec<Shape> = (0..count).map(|i| shape(&mut random, i, cycle)).collect();
    let (mut bodies, mut sites) = (Vec::new(), 0);
    for i in 0..count {
        let budget = 6 + random.below(40);
        let mut generator = Generator::new(&mut random, &shapes, i, sites, budget);
        generator.start();
        generator.statements(0);
        generator.finish();
        sites = generator.w.sites;
        bodies.push(generator.w.body);
    }
    with_classes(program(bodies, natives().into_iter().map(|(native, ..)| native).collect(), sites), &shapes)
}

/// Offsets of instances, of class 1, 2 and 3.
const INSTANCES: [u32; 4] = [128, 144, 256, 512];

/// A body is a method if its first parameter is an address; class 2 has none of those of an odd number, class 1 none of those that take more than it has.
fn is_method(shape: &Shape) -> bool {
    matches!(shape.params.first(), Some(Ty::Addr(_)))
}

fn with_classes(program: Program, shapes: &[Shape]) -> Program {
    let class = |size: u32| Class { name: format!("Class{size}"), size };
    let methods = shapes.iter().enumerate().filter(|(_, shape)| is_method(shape)).map(|(i, shape)| {
        let small = shape.params[0] == Ty::Addr(8);
        let body = Some(BodyId(i as u32));
        let targets = vec![body.filter(|_| small), body.filter(|_| i % 2 == 0), body];
        Dispatch { name: format!("M{i}"), params: shape.params[1..].to_vec(), result: shape.result, low: 1, targets }
    });
    let run = |offset, class, count| Instances { offset, class, count };
    Program {
        dispatch: methods.collect(),
        classes: vec![class(16), class(48), class(64)],
        instances: vec![run(INSTANCES[0], 1, 2), run(INSTANCES[2], 2, 1), run(INSTANCES[3], 3, 1)],
        families: vec![Family { name: "F".into(), low: 1, members: vec![true, false, true] }],
        ..program
    }
}

fn shape(random: &mut Random, i: usize, cycle: bool) -> Shape {
    let types = [Ty::I64, Ty::I64, Ty::F32, Ty::F64, Ty::Addr(8), Ty::Addr(40)];
    let params = if i == 0 { Vec::new() } else { (0..random.below(9)).map(|_| random.pick(&types)).collect() };
    let result = random.pick(&[None, Some(Ty::I64), Some(Ty::F32), Some(Ty::F64)]);
    Shape { params, result, frame_size: random.pick(&[0, 16, 64, 256]), recursive: i > 0 && cycle }
}

struct Generator<'a> {
    random: &'a mut Random,
    shapes: &'a [Shape],
    index: usize,
    w: Writer,
    /// Values by type: I64, F32, F64.
    values: [Vec<Local>; 3],
    addresses: Vec<Local>,
    budget: usize,
}

fn slot(ty: Ty) -> usize {
    match ty {
        Ty::F32 => 1,
        Ty::F64 => 2,
        _ => 0,
    }
}

impl<'a> Generator<'a> {
    fn new(random: &'a mut Random, shapes: &'a [Shape], index: usize, sites: u32, budget: usize) -> Self {
        let shape = &shapes[index];
        let mut w = Writer::new(&shape.params, shape.result, sites);
        (w.body.frame_size, w.body.recursive) = (shape.frame_size, shape.recursive);
        Self { random, shapes, index, w, values: Default::default(), addresses: Vec::new(), budget }
    }
    fn start(&mut self) {
        for (i, ty) in self.shapes[self.index].params.iter().enumerate() {
            match ty {
                Ty::Addr(_) => self.addresses.push(Local(i as u32)),
                ty => self.values[slot(*ty)].push(Local(i as u32)),
            }
        }
        for ty in [Ty::I64, Ty::I64, Ty::I64, Ty::F32, Ty::F64, Ty::F64] {
            let local = self.w.local(ty);
            self.values[slot(ty)].push(local);
        }
    }
    fn finish(&mut self) {
        for kind in 0..self.values.len() {
            for local in self.values[kind].clone() {
                self.observe(local);
            }
        }
        let term = self.return_();
        self.w.end(term);
    }
    fn return_(&mut self) -> Term {
        Term::Return(self.w.body.result.map(|ty| self.value(ty)))
    }

    fn value(&mut self, ty: Ty) -> Local {
        if self.random.one_in(4) {
            let word = self.word(ty);
            return self.w.constant(ty, word);
        }
        let known = &self.values[slot(ty)];
        known[self.random.below(known.len())]
    }
    fn word(&mut self, ty: Ty) -> u64 {
        let edges = [0.0, -0.0, 0.5, -1.5, 2.5, f64::NAN, -f64::NAN, f64::INFINITY, 1e308, 9.3e18, -1e10];
        match ty {
            Ty::F32 => u64::from((self.random.pick(&edges) as f32).to_bits()),
            Ty::F64 => self.random.pick(&edges).to_bits(),
            _ if self.random.one_in(8) => self.random.next(),
            _ => self.random.pick(&EDGES) as u64,
        }
    }
    /// A local that takes a value: often one that exists, so that values flow around loops.
    fn target(&mut self, ty: Ty) -> Local {
        if self.random.one_in(2) {
            let local = self.w.local(ty);
            self.values[slot(ty)].push(local);
            return local;
        }
        let known = &self.values[slot(ty)];
        known[self.random.below(known.len())]
    }
    /// A place with room for `size` bytes.
    fn place(&mut self, size: u32) -> (Base, u32) {
        let frame = self.w.body.frame_size;
        let extents: Vec<(Local, u32)> = self
            .addresses
            .iter()
            .filter_map(|a| if let Ty::Addr(e) = self.w.body.locals[a.0 as usize] { Some((*a, e)) } else { None })
            .collect();
        let fitting: Vec<(Local, u32)> = extents.into_iter().filter(|(_, e)| *e >= size).collect();
        match self.random.below(4) {
            0 if frame >= size => (Base::Frame, self.random.below((frame - size + 1) as usize) as u32),
            1 | 2 if !fitting.is_empty() => {
                let (local, extent) = fitting[self.random.below(fitting.len())];
                (Base::Local(local), self.random.below((extent - size + 1) as usize) as u32)
            }
            _ if self.random.one_in(6) => (Base::Image, NULL_ZONE),
            _ => {
                let first = NULL_ZONE + self.random.below((VARIABLES - NULL_ZONE - size + 1) as usize) as u32;
                (Base::Image, if self.random.one_in(2) { (first & !7).max(NULL_ZONE) } else { first })
            }
        }
    }

    /// Straight code and nested constructs until the budget is used up.
    fn statements(&mut self, depth: usize) {
        let scope = self.addresses.len();
        let room = 2 + self.random.below(8);
        for _ in 0..room {
            if self.budget == 0 {
                break;
            }
            self.budget -= 1;
            match self.random.below(12) {
                0 if depth < 3 => self.branch(depth),
                1 if depth < 3 => self.repeat(depth),
                2 if depth < 3 => self.switch(depth),
                3 => self.call(),
                4 => self.native(),
                5 => self.address(),
                6 => self.copy_bytes(),
                7 => self.memory(),
                9 if depth < 3 && self.random.one_in(3) => self.protect(depth),
                10 if self.random.one_in(4) => self.instances(),
                8 if depth > 0 && self.random.one_in(8) => {
                    self.stop();
                    let next = self.w.block();
                    self.w.open(next);
                }
                _ => self.instruction(),
            }
        }
        self.addresses.truncate(scope);
    }
    fn stop(&mut self) {
        let faults = [Fault::WrongDelete, Fault::Index { value: 1, low: 2, high: 3 }, Fault::Block { error: 77 }];
        let term = if self.random.one_in(2) {
            let site = self.w.site();
            Term::Fault(self.random.pick(&faults), site)
        } else {
            self.return_()
        };
        self.w.end(term);
    }

    fn instruction(&mut self) {
        match self.random.below(8) {
            0 => {
                let (cost, site) = (1 + self.random.below(4) as u32, self.w.site());
                self.w.push(Inst::Poll { cost, site });
            }
            1 => {
                let ty = self.random.pick(&[Ty::I64, Ty::F32, Ty::F64]);
                let src = self.value(ty);
                let dst = self.target(ty);
                self.w.push(Inst::Copy { dst, src });
            }
            _ => self.operator(),
        }
    }
    fn operator(&mut self) {
        let op = self.random.pick(ops());
        let mut args: Vec<Local> = op.args().iter().map(|ty| self.value(*ty)).collect();
        if matches!(op, Op::ShrS | Op::Rol | Op::Ror) && !self.random.one_in(8) {
            let width = self.random.pick(&[8, 16, 32, 64]);
            args[2] = self.w.int(width);
        }
        if op == Op::ShrS && self.random.one_in(2) {
            let (bits, distance) = (self.random.next(), 7 + self.random.below(57));
            (args[0], args[1]) = (self.w.int(bits as i64), self.w.int(distance as i64));
        }
        if op == Op::Div && self.random.one_in(4) {
            args = vec![self.w.int(i64::MIN), self.w.int(-1)];
            let hidden = self.w.load(Mem::I64, VARIABLES);
            let (zero, divisor, site) = (self.w.local(Ty::I64), self.w.local(Ty::I64), self.w.site());
            self.w.push(Inst::Op { op: Op::Xor, dst: zero, args: vec![hidden, hidden], site });
            self.w.push(Inst::Op { op: Op::Or, dst: divisor, args: vec![zero, args[1]], site });
            args[1] = divisor;
        }
        if op.faults() && !self.random.one_in(3) {
            let (one, divisor, site) = (self.w.int(1), self.w.local(Ty::I64), self.w.site());
            self.w.push(Inst::Op { op: Op::Or, dst: divisor, args: vec![args[1], one], site });
            args[1] = divisor;
        }
        let (dst, site) = (self.target(op.result()), self.w.site());
        self.w.push(Inst::Op { op, dst, args, site });
        if !self.random.one_in(3) {
            self.observe(dst);
        }
    }
    /// Makes a value visible.
    fn observe(&mut self, src: Local) {
        let mem = match self.w.body.locals[src.0 as usize] {
            Ty::F32 => Mem::F32,
            Ty::F64 => Mem::F64,
            _ => Mem::I64,
        };
        let offset = VARIABLES + 8 * self.random.below(128) as u32;
        self.w.push(Inst::Store { src, mem, base: Base::Image, offset });
    }
    fn memory(&mut self) {
        for _ in 0..2 {
            let mem = self.random.pick(&MEMS);
            let (base, offset) = self.place(mem.size());
            if self.random.one_in(2) {
                let dst = self.target(mem.ty());
                self.w.push(Inst::Load { dst, mem, base, offset });
                if self.random.one_in(2) {
                    self.observe(dst);
                }
            } else {
                let src = self.value(mem.ty());
                self.w.push(Inst::Store { src, mem, base, offset });
            }
        }
    }
    fn copy_bytes(&mut self) {
        let len = self.random.pick(&[0u32, 1, 3, 7, 8, 13, 31, 40, 64, 65, 200]);
        let (dst, dst_offset) = self.place(len);
        if self.random.one_in(3) {
            let data = self.random.below((256 - len) as usize) as u32;
            self.w.push(Inst::Data { dst, offset: dst_offset, data, len });
            return;
        }
        let (src, src_offset) = if self.random.one_in(2) && dst == Base::Image && dst_offset + len + 9 < VARIABLES {
            (dst, dst_offset + self.random.below(9) as u32)
        } else {
            self.place(len)
        };
        self.w.push(Inst::Move { dst, dst_offset, src, src_offset, len });
    }

    /// An index that fits most times.
    fn index(&mut self, low: i64, high: i64) -> Local {
        if self.random.one_in(8) {
            return self.value(Ty::I64);
        }
        if self.random.one_in(6) {
            let edge = self.random.pick(&[low, high, low - 1, high + 1]);
            return self.w.int(edge);
        }
        let (value, count, shift) = (self.value(Ty::I64), self.w.int(high - low + 1), self.w.int(low));
        let (rest, index) = (self.w.local(Ty::I64), self.w.local(Ty::I64));
        let site = self.w.site();
        self.w.push(Inst::Op { op: Op::RemU, dst: rest, args: vec![value, count], site });
        self.w.push(Inst::Op { op: Op::Add, dst: index, args: vec![rest, shift], site });
        index
    }
    fn address(&mut self) {
        let extent = self.random.pick(&[1u32, 4, 8, 8, 16, 40]);
        let dst = self.w.local(Ty::Addr(extent));
        match self.random.below(4) {
            0 => {
                let (base, offset) = self.place(extent);
                self.w.push(Inst::Address { dst, base, offset });
            }
            1 => {
                let (low, count) = (self.random.pick(&[0i64, 1, -3, 100]), 1 + self.random.below(9) as i64);
                let stride = extent + self.random.pick(&[0u32, 0, 0, 4]);
                let (base, offset) = self.place((count as u32 - 1) * stride + extent);
                let (index, site) = (self.index(low, low + count - 1), self.w.site());
                self.w.push(Inst::Index { dst, base, offset, index, low, high: low + count - 1, stride, site });
            }
            2 => {
                let [low, high] = [self.value(Ty::I64), self.value(Ty::I64)];
                let (index, site) = (self.value(Ty::I64), self.w.site());
                if self.random.one_in(3) {
                    self.w.push(Inst::Check { index, low, high, site });
                } else {
                    let (low, high) = (self.w.int(-4), self.w.int(4));
                    let index = self.index(-4, 4);
                    self.w.push(Inst::Check { index, low, high, site });
                }
                let (base, offset) = self.place(extent);
                self.w.push(Inst::Address { dst, base, offset });
            }
            _ => {
                let pointer = self.pointer(extent);
                let site = self.w.site();
                self.w.push(Inst::Deref { dst, pointer, site });
            }
        }
        self.addresses.push(dst);
    }
    /// A pointer that is good most times.
    fn pointer(&mut self, extent: u32) -> Local {
        match self.random.below(12) {
            0 => self.value(Ty::I64),
            1 => self.w.int(0),
            2 => {
                let near = self.random.pick(&[1, 15, 16, i64::from(IMAGE - extent), i64::from(IMAGE - extent) + 1, i64::from(IMAGE), -1]);
                self.w.int(near)
            }
            _ => {
                let dst = self.w.local(Ty::I64);
                let (base, offset) = self.place(extent);
                self.w.push(Inst::Pointer { dst, base, offset });
                dst
            }
        }
    }

    fn condition(&mut self) -> Local {
        if self.random.one_in(4) {
            return self.value(Ty::I64);
        }
        let conditions: Vec<Op> =
            ops().iter().copied().filter(|op| (Op::Eq..=Op::GeU).contains(op) || op.text().starts_with("lt.f")).collect();
        let op = self.random.pick(&conditions);
        let args: Vec<Local> = op.args().iter().map(|ty| self.value(*ty)).collect();
        let (dst, site) = (self.w.local(Ty::I64), self.w.site());
        self.w.push(Inst::Op { op, dst, args, site });
        dst
    }
    fn branch(&mut self, depth: usize) {
        let cond = self.condition();
        let [then, other, next] = [self.w.block(), self.w.block(), self.w.block()];
        self.w.end(Term::Branch { cond, then, other });
        self.arms(&[then, other], next, depth);
    }
    fn arms(&mut self, arms: &[BlockId], next: BlockId, depth: usize) {
        for arm in arms {
            self.w.open(*arm);
            self.statements(depth + 1);
            self.w.end(Term::Jump(next));
        }
        self.w.open(next);
    }
    fn switch(&mut self, depth: usize) {
        let value = if self.random.one_in(3) { self.value(Ty::I64) } else { self.index(-2, 12) };
        let count = self.random.pick(&[1usize, 2, 4, 9, 80]);
        let arms: Vec<BlockId> = (0..count.min(4)).map(|_| self.w.block()).collect();
        let [default, next] = [self.w.block(), self.w.block()];
        let stride = self.random.pick(&[1i64, 1, 3]);
        let mut cases: Vec<(i64, BlockId)> = (0..count).map(|i| (i as i64 * stride - 2, arms[i % arms.len()])).collect();
        if self.random.one_in(2) {
            cases.reverse();
        }
        if self.random.one_in(3) {
            cases.push((self.random.pick(&[i64::MIN, i64::MAX]), arms[0]));
        }
        self.w.end(Term::Switch { value, cases, default });
        let all: Vec<BlockId> = arms.into_iter().chain([default]).collect();
        self.arms(&all, next, depth);
    }
    /// A loop with a poll: counted, or as long as a condition says.
    fn repeat(&mut self, depth: usize) {
        let counter = self.w.int(0);
        let [head, body, next] = [self.w.block(), self.w.block(), self.w.block()];
        self.w.end(Term::Jump(head));
        self.w.open(head);
        let cond = if self.random.one_in(6) {
            self.condition()
        } else {
            let (limit, dst, site) = (self.random.below(9) as i64, self.w.local(Ty::I64), self.w.site());
            let limit = self.w.int(limit);
            self.w.push(Inst::Op { op: Op::Lt, dst, args: vec![counter, limit], site });
            dst
        };
        self.w.end(Term::Branch { cond, then: body, other: next });
        self.w.open(body);
        self.statements(depth + 1);
        let (one, cost, site) = (self.w.int(1), 1 + self.random.below(3) as u32, self.w.site());
        self.w.push(Inst::Op { op: Op::Add, dst: counter, args: vec![counter, one], site });
        self.w.push(Inst::Poll { cost, site });
        self.w.end(Term::Jump(head));
        self.w.open(next);
    }

    /// Statements whose faults are caught.
    fn protect(&mut self, depth: usize) {
        let kept = self.w.local(Ty::I64);
        self.w.push(Inst::Guard { dst: kept });
        let [handler, next] = [self.w.block(), self.w.block()];
        let outer = self.w.handler.replace(handler);
        let inside = self.w.block();
        self.w.end(Term::Jump(inside));
        self.w.open(inside);
        self.statements(depth + 1);
        self.w.end(Term::Jump(next));
        self.w.handler = outer;
        self.w.open(handler);
        let code = self.target(Ty::I64);
        self.w.push(Inst::Catch { dst: code, depth: kept });
        self.observe(code);
        self.statements(depth + 1);
        let term = if self.random.one_in(3) { Term::Rethrow(code) } else { Term::Jump(next) };
        self.w.end(term);
        self.w.open(next);
    }
    /// The offset of an instance most times.
    fn instance(&mut self) -> Local {
        match self.random.below(8) {
            0 => self.value(Ty::I64),
            1 => {
                let wrong = self.random.pick(&[0, 1, 129, 136, 160, 272, i64::from(IMAGE), i64::from(IMAGE) - 16, -16]);
                self.w.int(wrong)
            }
            2 if self.w.body.frame_size > 0 => {
                let dst = self.w.local(Ty::I64);
                self.w.push(Inst::Pointer { dst, base: Base::Frame, offset: 0 });
                dst
            }
            _ => {
                let offset = self.random.pick(&INSTANCES);
                self.w.int(offset.into())
            }
        }
    }
    /// Instances in the frame, and questions about instances.
    fn instances(&mut self) {
        if self.w.body.frame_size >= 64 && self.random.one_in(2) {
            let (class, count) = self.random.pick(&[(1, 2), (2, 1), (3, 1)]);
            return self.w.push(Inst::Place { offset: 0, class, count });
        }
        let (pointer, dst) = (self.instance(), self.target(Ty::I64));
        self.w.push(Inst::IsA { dst, pointer, family: 0 });
        self.observe(dst);
    }

    fn argument(&mut self, ty: Ty) -> Local {
        let Ty::Addr(extent) = ty else { return self.value(ty) };
        let dst = self.w.local(Ty::Addr(extent + self.random.pick(&[0u32, 0, 8])));
        let Ty::Addr(wide) = self.w.body.locals[dst.0 as usize] else { return dst };
        let (base, offset) = self.place(wide);
        self.w.push(Inst::Address { dst, base, offset });
        dst
    }
    fn call(&mut self) {
        let me = &self.shapes[self.index];
        let callable: Vec<usize> =
            (0..self.shapes.len()).filter(|i| *i > self.index || (me.recursive && self.shapes[*i].recursive)).collect();
        if callable.is_empty() {
            return self.operator();
        }
        let i = self.random.pick(&callable);
        let shape = self.shapes[i].clone();
        if is_method(&shape) && self.random.one_in(2) {
            let method = self.shapes[..i].iter().filter(|shape| is_method(shape)).count() as u32;
            let this = self.instance();
            let args: Vec<Local> = shape.params[1..].iter().map(|ty| self.argument(*ty)).collect();
            let dst = shape.result.map(|ty| self.target(ty));
            let site = self.w.site();
            return self.w.push(Inst::Virtual { method, this, args, dst, site });
        }
        let args: Vec<Local> = shape.params.iter().map(|ty| self.argument(*ty)).collect();
        let dst = shape.result.filter(|_| !self.random.one_in(5)).map(|ty| self.target(ty));
        let site = self.w.site();
        self.w.push(Inst::Call { body: BodyId(i as u32), args, dst, site });
    }
    fn native(&mut self) {
        let all = natives();
        let i = self.random.below(all.len());
        let (_, params, result) = &all[i];
        let args: Vec<Local> = params.iter().map(|ty| self.argument(*ty)).collect();
        let dst = if self.random.one_in(5) { None } else { Some(self.target(*result)) };
        let site = self.w.site();
        self.w.push(Inst::Native { native: NativeId(i as u32), args, dst, site });
    }
}
