//! Runs a program in both executors and compares all that can be seen.

use takt_abi::{Context, Env, Fault, NoHost, Time};
use takt_ir::{
    Base, Block, Body, BodyId, Const, Inst, Interpreter, Local, Mem, NULL_ZONE, Native, Program, Site, SiteId, Task, Term, Trigger, Ty,
};
use takt_jit::{Code, Defect, compile_with};

/// Bytes of the image; the third quarter is the stack region.
pub const IMAGE: u32 = 4096;
/// Where frames start.
pub const STACK: u32 = 2048;
/// A counter that each slow poll raises, as a task that preempts would.
pub const POLLS: u32 = NULL_ZONE;

/// All that can be seen of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    pub code: u32,
    pub result: u64,
    pub fault: Option<Fault>,
    pub site: u32,
    pub trace: Vec<u32>,
    pub fuel: i64,
    pub depth: u32,
    pub image: Vec<u8>,
}

/// What a run starts with.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    pub fuel: i64,
    /// Further slices of fuel, 100 each.
    pub slices: u64,
    pub flag: u32,
    pub depth_limit: u32,
}

impl Default for Start {
    fn default() -> Self {
        Self { fuel: 1000, slices: 2, flag: 0, depth_limit: 20 }
    }
}

#[allow(unsafe_code, reason = "a poll as the engine has it")]
unsafe extern "C" fn poll(ctx: *mut Context, site: u32) -> u32 {
    // SAFETY: the executors pass the live context, whose image and environment are live.
    let (ctx, env, counter) = unsafe { (&mut *ctx, &mut *(*ctx).env, &mut *(*ctx).image.add(POLLS as usize)) };
    *counter = counter.wrapping_add(1);
    let flag = ctx.flag.get_mut();
    if *flag > 1 {
        *flag -= 1;
        return 0;
    }
    if *flag == 1 {
        return ctx.fail(Fault::Stopped, site);
    }
    if env.cycle == 0 {
        return ctx.fail(Fault::Watchdog, site);
    }
    env.cycle -= 1;
    ctx.fuel += 100;
    0
}

fn run(program: &Program, start: Start, executor: impl FnOnce(&mut Context) -> (u32, u64)) -> Outcome {
    let mut image = vec![0; program.image_size as usize];
    image[..program.init.len()].copy_from_slice(&program.init);
    let mut env = Env::new(Time(1_000_000), Box::new(NoHost));
    (env.cycle, env.classes, env.heap) = (start.slices, program.instances(), program.heap());
    let mut ctx = Context::new(image.as_mut_ptr(), program.image_size.into(), &mut env, poll);
    (ctx.flag, ctx.fuel, ctx.depth_limit, ctx.fault_site) = (start.flag.into(), start.fuel, start.depth_limit, 0);
    ctx.stack_end = u64::from(program.tasks[0].stack.0 + program.tasks[0].stack.1);
    let (code, result) = executor(&mut ctx);
    // A result is a word in a register: which NaN it is says nothing.
    let result = match program.bodies[program.tasks[0].entry.0 as usize].result {
        Some(Ty::F32) if f32::from_bits(result as u32).is_nan() => 0x7FC0_0000,
        Some(Ty::F64) if f64::from_bits(result).is_nan() => 0x7FF8_0000_0000_0000,
        _ => result,
    };
    let (fault, site, trace) = (ctx.fault(), ctx.fault_site, ctx.trace[..ctx.trace_len as usize].to_vec());
    Outcome { code, result, fault, site, trace, fuel: ctx.fuel, depth: ctx.depth, image }
}

/// The first task's body in the interpreter.
pub fn interpreted(program: &Program, start: Start) -> Outcome {
    let (body, frame) = (program.tasks[0].entry, program.tasks[0].stack.0);
    run(program, start, |ctx| {
        let mut interpreter = Interpreter::new(program);
        let code = interpreter.run(program, body, frame.into(), ctx);
        (code, if code == 0 { interpreter.result() } else { 0 })
    })
}

/// The first task's body in machine code.
pub fn compiled(program: &Program, code: &Code, start: Start) -> Outcome {
    let (body, frame) = (program.tasks[0].entry, program.tasks[0].stack.0);
    run(program, start, |ctx| match code.call(body, frame.into(), ctx) {
        Ok(result) => (0, result),
        Err(code) => (code, 0),
    })
}

/// Whether a defect of the code generator is seen.
pub fn differs(program: &Program, start: Start, defect: Defect) -> bool {
    let code = compile_with(program, defect).expect("the program is good");
    compiled(program, &code, start) != interpreted(program, start)
}

/// The outcome, which must be the same in both executors.
pub fn check(program: &Program, start: Start) -> Outcome {
    let code = takt_jit::compile(program).expect("the program is good");
    let (expected, found) = (interpreted(program, start), compiled(program, &code, start));
    assert!(expected == found, "{}", difference(program, &expected, &found));
    found
}

/// What differs, and the program, short enough to be read.
fn difference(program: &Program, expected: &Outcome, found: &Outcome) -> String {
    use std::fmt::Write;
    let short = |outcome: &Outcome| format!("{:?}", Outcome { image: Vec::new(), ..outcome.clone() });
    let mut text = format!("interpreter {}\nmachine     {}\n", short(expected), short(found));
    for (at, (a, b)) in expected.image.iter().zip(&found.image).enumerate().filter(|(_, (a, b))| a != b).take(16) {
        let _ = writeln!(text, "  image[{at}]: {a:#x} {b:#x}");
    }
    for (i, body) in program.bodies.iter().enumerate() {
        let _ =
            writeln!(text, "body {i} frame {} recursive {} params {} -> {:?}", body.frame_size, body.recursive, body.params, body.result);
        let _ = writeln!(text, "  {:?}", body.locals);
        for (k, block) in body.blocks.iter().enumerate() {
            let _ = writeln!(text, " {k}:");
            for inst in &block.insts {
                let _ = writeln!(text, "   {inst:?}");
            }
            let _ = writeln!(text, "   {:?}", block.term);
        }
    }
    text
}

/// Writes a body block by block.
pub struct Writer {
    pub body: Body,
    pub sites: u32,
    current: usize,
    /// Handler of the blocks that are made from now on.
    pub handler: Option<takt_ir::BlockId>,
}

impl Writer {
    /// A body with these parameters.
    pub fn new(params: &[Ty], result: Option<Ty>, sites: u32) -> Self {
        let blocks = vec![Block { insts: Vec::new(), term: Term::Return(None), handler: None }];
        let params_len = params.len() as u32;
        let entry_site = SiteId(sites);
        let body = Body {
            name: "body".into(),
            params: params_len,
            locals: params.to_vec(),
            result,
            blocks,
            frame_size: 0,
            recursive: false,
            entry_site,
        };
        Self { body, sites: sites + 1, current: 0, handler: None }
    }
    pub fn local(&mut self, ty: Ty) -> Local {
        self.body.locals.push(ty);
        Local(self.body.locals.len() as u32 - 1)
    }
    pub fn site(&mut self) -> SiteId {
        self.sites += 1;
        SiteId(self.sites - 1)
    }
    pub fn push(&mut self, inst: Inst) {
        self.body.blocks[self.current].insts.push(inst);
    }
    /// A new block, not yet current.
    pub fn block(&mut self) -> takt_ir::BlockId {
        self.body.blocks.push(Block { insts: Vec::new(), term: Term::Return(None), handler: self.handler });
        takt_ir::BlockId(self.body.blocks.len() as u32 - 1)
    }
    /// Ends the current block.
    pub fn end(&mut self, term: Term) {
        self.body.blocks[self.current].term = term;
    }
    pub fn open(&mut self, block: takt_ir::BlockId) {
        self.current = block.0 as usize;
    }
    pub fn int(&mut self, value: i64) -> Local {
        let dst = self.local(Ty::I64);
        self.push(Inst::Const { dst, value: Const::I64(value) });
        dst
    }
    pub fn constant(&mut self, ty: Ty, word: u64) -> Local {
        let dst = self.local(ty);
        let value = match ty {
            Ty::F32 => Const::F32(word as u32),
            Ty::F64 => Const::F64(word),
            _ => Const::I64(word as i64),
        };
        self.push(Inst::Const { dst, value });
        dst
    }
    pub fn load(&mut self, mem: Mem, offset: u32) -> Local {
        let dst = self.local(mem.ty());
        self.push(Inst::Load { dst, mem, base: Base::Image, offset });
        dst
    }
    pub fn store(&mut self, src: Local, mem: Mem, offset: u32) {
        self.push(Inst::Store { src, mem, base: Base::Image, offset });
    }
}

/// A program of these bodies; the first one is the task.
pub fn program(bodies: Vec<Body>, natives: Vec<Native>, sites: u32) -> Program {
    let init = (0..1024u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let task = Task {
        name: "main".into(),
        trigger: Trigger::Cyclic(1_000_000),
        priority: 0,
        entry: BodyId(0),
        stack: (STACK, 1024),
        isolated: false,
    };
    Program {
        bodies,
        natives,
        data: (0..=255).collect(),
        sites: (0..sites).map(|line| Site { file: 0, line: line + 1, column: 1, body: BodyId(0) }).collect(),
        files: vec!["test.st".into()],
        image_size: IMAGE,
        init,
        tasks: vec![task],
        ..Program::default()
    }
}

/// A program of one body that is written by `write`.
pub fn single(write: impl FnOnce(&mut Writer)) -> Program {
    let mut writer = Writer::new(&[], None, 0);
    write(&mut writer);
    program(vec![writer.body], Vec::new(), writer.sites)
}
