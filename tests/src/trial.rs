//! A body run without an engine: in the interpreter, in machine code, in machine code with a deliberate mistake.
//!
//! All that can be seen of a run is in its [`Outcome`], fuel and polls included, which an engine keeps for itself. Initial values are set by the
//! interpreter in every run, so that a run with a mistake starts where the right one does.

use crate::generate::Random;
use std::cell::RefCell;
use std::sync::atomic::AtomicU32;
use takt_abi::{Context, Env, Fault, NoHost, Time};
use takt_ir::{BodyId, Interpreter, Program};
use takt_jit::Code;

/// What a run starts with.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Scans.
    pub scans: u32,
    /// Fuel of each scan.
    pub fuel: i64,
    /// Slow polls that let the scan go on.
    pub slow_polls: u32,
    /// 1: every poll is a slow one.
    pub flag: u32,
    /// Depth of calls.
    pub depth_limit: u32,
    /// Bytes of the stack region that may be used, if it has so many.
    pub stack: u32,
}

impl Start {
    /// One of many ways to start, the same for the same seed: much fuel or little, every poll slow, a low limit of depth, a small stack.
    pub fn of(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x5EED);
        let fuel = random.pick(&[5000, 5000, 5000, 300, 40, 7]);
        let slow_polls = random.below(4) as u32 * random.below(60) as u32;
        let flag = u32::from(random.chance(10));
        let depth_limit = random.pick(&[60, 60, 60, 60, 6, 3, 1]);
        let stack = random.pick(&[1 << 20, 1 << 20, 1 << 20, 1 << 20, 1 << 20, 4096, 1024, 320]);
        Self { scans: 2, fuel, slow_polls, flag, depth_limit, stack }
    }
}

/// All that can be seen of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The fault that ended it.
    pub fault: Option<Fault>,
    /// Where: a site, or `u32::MAX`.
    pub site: u32,
    /// Callers' sites, from the fault outwards.
    pub trace: Vec<u32>,
    /// What is left of the fuel after each scan.
    pub fuel: Vec<i64>,
    /// Depth after each scan.
    pub depth: Vec<u32>,
    /// Sites of the slow polls.
    pub polls: Vec<u32>,
    /// The memory.
    pub image: Vec<u8>,
}

struct Polls {
    left: u32,
    sites: Vec<u32>,
}

thread_local! {
    static POLLS: RefCell<Polls> = const { RefCell::new(Polls { left: 0, sites: Vec::new() }) };
}

/// The slow poll. It need not look into the context: what it knows is this thread's.
extern "C" fn poll(_ctx: *mut Context, site: u32) -> u32 {
    POLLS.with_borrow_mut(|polls| {
        polls.sites.push(site);
        match polls.left.checked_sub(1) {
            Some(left) => {
                polls.left = left;
                0
            }
            None => Fault::Watchdog.code(),
        }
    })
}

/// Runs the first task's body in the interpreter.
pub fn interpreted(program: &Program, start: Start) -> Outcome {
    let mut interpreter = Interpreter::new(program);
    run(program, start, |body, frame, ctx| interpreter.run(program, body, frame, ctx))
}

/// Runs the first task's body in machine code.
pub fn compiled(program: &Program, code: &Code, start: Start) -> Outcome {
    run(program, start, |body, frame, ctx| code.run(body, frame, ctx))
}

fn run(program: &Program, start: Start, mut executor: impl FnMut(BodyId, u64, &mut Context) -> u32) -> Outcome {
    let mut image = vec![0; program.image_size as usize];
    image[..program.init.len()].copy_from_slice(&program.init);
    let period = Time(10_000_000);
    let mut env = Env::new(period, Box::new(NoHost));
    (env.classes, env.heap) = (program.instances(), program.heap());
    let task = &program.tasks[0];
    let (entry, (frame, size)) = (task.entry, task.stack);
    let mut ctx = Context::new(image.as_mut_ptr(), program.image_size.into(), &mut env, poll);
    (ctx.depth_limit, ctx.stack_end) = (start.depth_limit, u64::from(frame) + u64::from(size.min(start.stack)));
    let (mut fuel, mut depth) = (Vec::new(), Vec::new());
    let mut code = 0;
    POLLS.replace(Polls { left: start.slow_polls, sites: Vec::new() });
    if let Some(body) = program.init_body {
        ctx.fuel = start.fuel;
        code = Interpreter::new(program).run(program, body, frame.into(), &mut ctx);
    }
    ctx.flag = AtomicU32::new(start.flag);
    for _ in 0..start.scans {
        if code != 0 {
            break;
        }
        (ctx.fuel, ctx.depth) = (start.fuel, 0);
        code = executor(entry, frame.into(), &mut ctx);
        fuel.push(ctx.fuel);
        depth.push(ctx.depth);
    }
    let fault = Fault::from_raw(code, if ctx.fault_code == code { ctx.fault_facts } else { [0; 3] });
    let (site, trace) = (ctx.fault_site, ctx.trace[..ctx.trace_len as usize].to_vec());
    let polls = POLLS.with_borrow_mut(|polls| std::mem::take(&mut polls.sites));
    Outcome { fault, site, trace, fuel, depth, polls, image }
}
