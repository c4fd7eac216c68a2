//! What the tests of this crate share: an engine in miniature, and a program that uses everything.

use crate::interp::Interpreter;
use crate::parse::parse_program;
use crate::program::{Native, Program};
use crate::text;
use crate::verify::verify;
use takt_abi::{Context, Env, Fault, NoHost, Time};

/// Finds the natives of this crate.
pub(crate) fn natives(name: &str) -> Option<Native> {
    let found = text::NATIVES.iter().find(|f| f.name == name)?;
    Some(Native { name: found.name, call: found.call })
}

#[track_caller]
pub(crate) fn program(text: &str) -> Program {
    let program = parse_program(text, &natives).unwrap_or_else(|e| panic!("{e}"));
    verify(&program).unwrap_or_else(|e| panic!("{e}"));
    program
}

/// How a run ended.
pub(crate) struct Outcome {
    pub(crate) image: Vec<u8>,
    pub(crate) fault: Option<Fault>,
    pub(crate) site: u32,
    pub(crate) trace: Vec<u32>,
    pub(crate) fuel: i64,
    pub(crate) depth: u32,
    pub(crate) result: u64,
    pub(crate) escapes: u32,
}

/// The poll of an engine whose fuel is used up.
#[allow(unsafe_code, reason = "plays the engine")]
unsafe extern "C" fn watchdog(ctx: *mut Context, site: u32) -> u32 {
    // SAFETY: the executor hands over its live context.
    unsafe { (*ctx).fail(Fault::Watchdog, site) }
}

/// Runs body 0 on a fresh image with the stack region of the first task (without one: the last quarter), 1000 units of fuel and 20 levels.
pub(crate) fn run(program: &Program) -> Outcome {
    run_with(program, 0, 1000, 0)
}

pub(crate) fn run_with(program: &Program, body: u32, fuel: i64, flag: u32) -> Outcome {
    let mut image = program.init.clone();
    image.resize(program.image_size as usize, 0);
    let mut env = Env::new(Time(1), Box::new(NoHost));
    (env.classes, env.heap) = (program.instances(), program.heap());
    let quarter = program.image_size / 4;
    let (start, len) = program.tasks.first().map_or((program.image_size - quarter, quarter), |t| t.stack);
    let mut ctx = Context::new(image.as_mut_ptr(), image.len() as u64, &mut env, watchdog);
    (ctx.flag, ctx.fuel, ctx.depth_limit, ctx.fault_site) = (flag.into(), fuel, 20, 0);
    ctx.stack_end = u64::from(start) + u64::from(len);
    let mut interpreter = Interpreter::new(program);
    let code = interpreter.run(program, crate::BodyId(body), start.into(), &mut ctx);
    assert_eq!(code, ctx.fault_code);
    Outcome {
        fault: ctx.fault(),
        site: ctx.fault_site,
        trace: ctx.trace[..ctx.trace_len as usize].to_vec(),
        fuel: ctx.fuel,
        depth: ctx.depth,
        result: interpreter.result(),
        escapes: interpreter.escapes,
        image,
    }
}

/// Every section, every kind of instruction and end, two bodies that call each other and one that calls itself.
pub(crate) const SAMPLE: &str = r#"
image 512
file "main.st"
file "b \"quoted\"\n.st"
site 0 1 1 0
site 0 2 5 0
site 0 3 5 0
site 1 4 5 1
site 0 5 5 2
data "68616c6c6f00"
init 80 at 64 "0a00feff"
native STR_ASSIGN
native STR_COMPARE
class "Base" size 16
class "Derived" size 32
instances 2 at 224 count 1
method "Base.M" (i64) -> i64 from 1 [3, 4]
family "Derived" from 2 [1]
heap 32 16
type INT
type struct "Point" size 16 align 8 { state "x" 0 at 0, inout "y" 0 at 8 doc "mm" }
type array 1 [0..1, -1..1]
type enum "WAY" INT { "forth" = 1, "back" = -2 }
type string 80
type pointer 1
type subrange DINT -5..5
type open 0 2
type reference 3
type wstring 7
type LREAL
type interface "I_Base"
type bit 3
type BOOL
global "GVL.x" type 0 at 64 bare
global "GVL.p" type 2 at 96 constant doc "where it is"
global "lamp" type 12 at 240
area Q word at 240 size 2
mapped Q type 13 at 65 to 241 bit 3
retained "GVL.x" type 0 at 64 retain
retained "lamp" type 12 at 240 persistent
restart 250
latched type 1 at 96 writers [0, 1]
task "Main" cyclic 1000000 priority 0 entry 0 stack 256 128
task "Slow" event 64 bit 3 priority 1 entry 0 stack 384 128
start 0
body "PLC_PRG" () frame 32 @0
  local i64, f64, f32, addr:2, i64, addr:8, i64, i64
b0 catch b3:
  v0 = const 3
  v1 = const.f64 1.5
  v2 = const.f32 -0.25
  v1 = sqrt.f64 v1 @0
  v4 = load.i16 image+66
  v4 = div v4, v0 @1
  store.f64 frame+8, v1
  store.f32 frame+0, v2
  v3 = index image+64 [v0 in 0..7 by 2] @1
  store.i16 v3+0, v4
  v5 = address frame+8
  v1 = load.f64 v5+0
  check v0 in v4..v0 @2
  v6 = pointer v5+0
  v5 = deref v6 @2
  v3 = copy v5
  move image+128, v5+0, 8
  data image+144, 0, 6
  v6 = const 160
  v7 = const 20
  v4 = const 144
  v0 = native STR_ASSIGN(v6, v7, v4, v7) @1
  store.bool image+200, v0
  v0 = const 0
  jump b1
b1:
  poll 1 @2
  v4 = call 1(v0, v5) @2
  store.i64 image+208, v4
  v4 = const 1
  v0 = add v0, v4 @1
  v4 = const 6
  v4 = lt v0, v4 @1
  branch v4, b1, b2
b2:
  native STR_COMPARE(v6, v7, v6, v7) @2
  place frame+16 class 1 count 1
  v6 = const 224
  v7 = virtual 0 v6(v4) @1
  v7 = isa v6 0
  v6 = guard
  return
b3:
  v4 = catch v6
  branch v4, b4, b5
b4:
  rethrow v4
b5:
  return
body "Count" (i64, addr:8) -> i64 frame 16 @3
  local i64
b0:
  v2 = load.i32 v1+4
  switch v0 [1: b1, -5: b1, 4: b2] else b3
b1:
  v2 = call 2(v0) @3
  return v2
b2:
  store.u32 v1+0, v0
  store.i8 frame+15, v2
  return v0
b3:
  return v2
body "Down" (i64) -> i64 recursive @4
  local i64
b0:
  branch v0, b1, b2
b1:
  v1 = const 1
  v1 = sub v0, v1 @4
  v1 = call 2(v1) @4
  return v1
b2:
  return v0
body "Base.M" (addr:16, i64) -> i64 @3
b0:
  return v1
body "Derived.M" (addr:32, i64) -> i64 @4
b0:
  store.i64 v0+24, v1
  return v1
"#;

#[track_caller]
pub(crate) fn sample() -> Program {
    program(SAMPLE)
}

/// Pseudo-random numbers (xorshift64*).
pub(crate) struct Random(pub(crate) u64);
impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}
