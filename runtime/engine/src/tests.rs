//! Scans as a caller sees them: order of tasks, preemption, faults, forces, wires. Each case runs in both executors.

use crate::*;
use std::cell::Cell;
use std::sync::Arc;
use takt_abi::{Fault, Time};
use takt_ir::{BodyId, Native, Place, Program, TypeId, parse_program};

/// Layout of the test programs: marks left by tasks, and how many.
const COUNT: u32 = 16;
const PROGRESS: u32 = 24;
const FLAG: u32 = 32;
const OTHER: u32 = 40;
const MARKS: u32 = 64;

const HEAD: &str = "
image 4096
type BOOL
type DINT
type LREAL
";

/// A body that leaves a mark: the number, or the progress of the long body.
fn mark(name: &str, what: &str) -> String {
    format!(
        "
body \"{name}\" () frame 0 @1
  local i64, i64, addr:1, i64
b0:
  {what}
  v1 = load.i32 image+{COUNT}
  v2 = index image+{MARKS} [v1 in 0..999 by 1] @1
  store.u8 v2+0, v0
  v3 = const 1
  v1 = add v1, v3
  store.i32 image+{COUNT}, v1
  return
"
    )
}

/// A body that counts PROGRESS up to a number, with a poll each time.
fn long(name: &str, turns: i64) -> String {
    format!(
        "
body \"{name}\" () frame 0 @1
  local i64, i64, i64, i64
b0:
  v0 = const 0
  v1 = const 1
  v2 = const {turns}
  jump b1
b1:
  v0 = add v0, v1
  store.i32 image+{PROGRESS}, v0
  poll 1 @2
  v3 = lt v0, v2
  branch v3, b1, b2
b2:
  return
"
    )
}

fn program(text: &str) -> Arc<Program> {
    let text = format!("{HEAD}{text}");
    Arc::new(parse_program(&text, &natives).unwrap_or_else(|e| panic!("{e}\n{text}")))
}

fn place(offset: u32, ty: u32) -> Place {
    Place { offset, ty: TypeId(ty) }
}
fn bit(offset: u32) -> Place {
    place(offset, 0)
}
fn number(engine: &Engine, offset: u32) -> i32 {
    i32::from_le_bytes(engine.read(place(offset, 1)).try_into().unwrap())
}
fn marks(engine: &Engine) -> Vec<u8> {
    engine.image()[MARKS as usize..][..number(engine, COUNT) as usize].to_vec()
}

/// Runs `check` for a fresh engine in each executor.
fn both(text: &str, options: impl Fn() -> Options, check: impl Fn(Engine)) {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let options = Options { executor, ..options() };
        check(load(program(text), options, Box::new(NoBus)).unwrap());
    }
}

fn steps(engine: &mut Engine, n: usize) {
    for _ in 0..n {
        engine.step(engine.next_release());
    }
}

fn two_tasks(fast: &str, slow: &str) -> String {
    format!(
        "task \"Fast\" cyclic 1000000 priority 0 entry 0 stack 2048 256\ntask \"Slow\" cyclic 3000000 priority 5 entry 1 stack 2304 256\n{fast}{slow}"
    )
}

#[test]
fn tasks_run_at_their_times_by_priority() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &mark("B", "v0 = const 2"));
    both(&text, Options::default, |mut engine| {
        assert_eq!((engine.bus_task(), engine.bus_period()), (0, Time(1_000_000)));
        steps(&mut engine, 7);
        assert_eq!(marks(&engine), [1, 2, 1, 1, 1, 2, 1, 1, 1, 2]);
        assert_eq!((engine.now(), engine.cycles(), engine.statistics(1).cycles), (Time(6_000_000), 7, 3));
        assert_eq!(engine.next_release(), Time(7_000_000));
    });
}

#[test]
fn the_bus_task_may_be_named_and_a_wrong_name_is_refused() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &mark("B", "v0 = const 2"));
    let named = |name: &str| load(program(&text), Options { bus_task: Some(name.into()), ..Options::default() }, Box::new(NoBus));
    assert_eq!(named("slow").unwrap().bus_task(), 1);
    let error = named("Quick").unwrap_err();
    assert_eq!(error.to_string(), "there is no task `Quick`; there are: Fast, Slow");
}

#[test]
fn releases_that_were_missed_are_counted_and_skipped() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &mark("B", "v0 = const 2"));
    both(&text, Options::default, |mut engine| {
        engine.step(Time(0));
        engine.step(Time(4_200_000));
        assert_eq!((engine.statistics(0).overruns, engine.statistics(1).overruns), (3, 0));
        assert_eq!(marks(&engine), [1, 2, 1, 2]);
        assert_eq!(engine.next_release(), Time(5_000_000));
    });
}

#[test]
fn a_preemption_happens_at_the_poll_that_was_asked_for() {
    let text = two_tasks(&mark("A", &format!("v0 = load.i32 image+{PROGRESS}")), &long("B", 200));
    let preempt = [(1, 17), (1, 100), (1, 100), (2, 3)].map(|(cycle, at_fuel)| Preemption { cycle, task: 1, at_fuel });
    let options = || Options { preempt: preempt.to_vec(), ..Options::default() };
    both(&text, options, |mut engine| {
        engine.step(Time(0));
        assert_eq!(marks(&engine), [0, 17, 100, 100]);
        assert_eq!((engine.now(), engine.statistics(1).preempted, engine.statistics(0).cycles), (Time(3_000_000), 3, 4));
        assert_eq!(engine.statistics(1).fuel_max, 200);
        steps(&mut engine, 1);
        assert_eq!(marks(&engine), [0, 17, 100, 100, 3], "the slow scan at 3 ms is interrupted at 4 ms");
    });
}

#[test]
fn an_endless_loop_ends_at_the_same_turn_in_both_executors() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &long("B", i64::MAX));
    both(
        &text,
        || Options { fuel_limit: 100_000, ..Options::default() },
        |mut engine| {
            steps(&mut engine, 5);
            assert_eq!(number(&engine, PROGRESS), 100_001);
            let record = engine.fault().unwrap();
            assert_eq!((record.fault, record.task.as_str(), record.cycle, record.place.line), (Fault::Watchdog, "Slow", 1, 2));
            assert_eq!(marks(&engine), [1], "no task starts another scan");
            assert_eq!(engine.cycles(), 5, "the bus goes on");
        },
    );
}

#[test]
fn a_scan_can_be_stopped_from_outside() {
    thread_local!(static STOP: Cell<Option<StopHandle>> = const { Cell::new(None) });
    let clock = || {
        let handle = STOP.take();
        handle.inspect(StopHandle::stop);
        Time(0)
    };
    let text = two_tasks(&mark("A", "v0 = const 1"), &long("B", i64::MAX));
    both(
        &text,
        || Options { clock: Clock::Real(clock), ..Options::default() },
        |mut engine| {
            STOP.set(Some(engine.stop_handle()));
            engine.step(Time(0));
            assert_eq!(engine.fault().unwrap().fault, Fault::Stopped);
            engine.reset(Reset::Warm).unwrap();
            assert!(engine.fault().is_none());
        },
    );
}

thread_local!(static CLOCK: Cell<i64> = const { Cell::new(0) });
fn ticking() -> Time {
    CLOCK.set(CLOCK.get() + 10_000);
    Time(CLOCK.get())
}

#[test]
fn preemptions_under_a_real_clock_are_recorded_and_can_be_repeated() {
    let text = two_tasks(&mark("A", &format!("v0 = load.u8 image+{}", PROGRESS + 1)), &long("B", 100_000));
    let real = |executor| {
        CLOCK.set(0);
        let options = Options { executor, clock: Clock::Real(ticking), ..Options::default() };
        let mut engine = load(program(&text), options, Box::new(NoBus)).unwrap();
        engine.step(Time(0));
        assert!(engine.preemptions().len() > 1, "{:?}", engine.preemptions());
        (engine.preemptions().to_vec(), marks(&engine))
    };
    let (recorded, seen) = real(ExecutorKind::Interpreter);
    assert_eq!(real(ExecutorKind::Jit), (recorded.clone(), seen.clone()));
    both(
        &text,
        || Options { preempt: recorded.clone(), ..Options::default() },
        |mut engine| {
            engine.step(Time(0));
            assert_eq!(marks(&engine), seen[..marks(&engine).len()]);
            assert_eq!(marks(&engine).len(), recorded.len() + 1);
        },
    );
}

#[test]
fn the_watchdog_counts_time_on_a_machine() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &long("B", 1_000_000));
    let options =
        || Options { clock: Clock::Real(ticking), limits: Limits { watchdog: Time(500_000), ..Limits::default() }, ..Options::default() };
    both(&text, options, |mut engine| {
        CLOCK.set(0);
        engine.step(Time(0));
        assert_eq!(engine.fault().unwrap().fault, Fault::Watchdog);
    });
}

#[test]
fn an_event_task_runs_once_per_rising_edge() {
    let text = format!(
        "task \"Cyclic\" cyclic 1000000 priority 1 entry 0 stack 2048 256\ntask \"Event\" event {FLAG} priority 0 entry 1 stack 2304 256\n{}{}",
        mark("A", "v0 = const 1"),
        mark("B", "v0 = const 2")
    );
    both(&text, Options::default, |mut engine| {
        let mut seen = Vec::new();
        for level in [0, 1, 1, 0, 1] {
            engine.write(bit(FLAG), &[level]).unwrap();
            let before = marks(&engine).len();
            steps(&mut engine, 1);
            seen.push(marks(&engine)[before..].to_vec());
        }
        assert_eq!(seen, [vec![1], vec![2, 1], vec![1], vec![1], vec![2, 1]]);
    });
}

/// FLAG := NOT FLAG; OTHER := FLAG before.
fn toggle() -> String {
    format!(
        "task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256
body \"A\" () frame 0 @1
  local i64, i64
b0:
  v0 = load.bool image+{FLAG}
  store.bool image+{OTHER}, v0
  v1 = const 1
  v0 = xor v0, v1
  store.bool image+{FLAG}, v0
  return
"
    )
}

#[test]
fn a_force_holds_before_and_after_the_programs() {
    both(&toggle(), Options::default, |mut engine| {
        engine.force(bit(FLAG), &[1]).unwrap();
        for _ in 0..3 {
            steps(&mut engine, 1);
            assert_eq!((engine.read(bit(OTHER)), engine.read(bit(FLAG))), (&[1][..], &[1][..]));
        }
        assert_eq!(engine.forces().map(|f| (f.place, f.bytes, f.before)).collect::<Vec<_>>(), [(bit(FLAG), &[1][..], &[0][..])]);
        let release = Command::Release { place: bit(FLAG), restore: false };
        assert_eq!((engine.command(&release), engine.command(&release)), (Ok(()), Err(AccessError::NotForced.into())));
        steps(&mut engine, 1);
        assert_eq!(engine.read(bit(FLAG)), [0]);
        assert_eq!(engine.write(bit(FLAG), &[1, 2]), Err(AccessError::Size { expected: 1, found: 2 }.into()));
        assert_eq!(engine.force(bit(4096), &[1]), Err(AccessError::Outside.into()));
        assert_eq!(engine.force(place(0, 77), &[1]), Err(AccessError::Outside.into()));
        assert_eq!(engine.read(place(4093, 1)), []);
    });
}

/// One terminal of each kind; shows what was sent.
struct Terminals {
    seen: std::rc::Rc<std::cell::RefCell<ProcessImage>>,
}
impl IoDriver for Terminals {
    fn size(&self) -> BusSize {
        BusSize { drives: 1, bits_in: 1, bits_out: 1, analog_in: 1, analog_out: 1 }
    }
    fn exchange(&mut self, now: Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        assert!(now != Time(50_000_000), "a driver with a defect");
        io.bits_in[0] = io.bits_out[0];
        io.analog_in[0] = 2.0 * io.analog_out[0];
        self.seen.borrow_mut().clone_from(io);
        Ok(())
    }
}

fn wire(name: &str, place: Place, channel: Channel, safe: Option<Signal>) -> Wire {
    Wire { name: name.into(), place, channel, safe }
}

fn divide() -> String {
    format!(
        "site 0 3 5 0
site 0 7 1 0
site 0 9 2 1
file \"main.st\"
task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256
body \"MAIN\" () frame 16 @0
  local i64, i64
b0:
  v0 = load.bool image+{OTHER}
  v1 = call 1(v0) @1
  return
body \"SHARE\" (i64) -> i64 frame 0 @2
  local i64
b0:
  v1 = div v0, v0 @2
  return v1
"
    )
}

#[test]
fn a_fault_names_its_place_and_puts_outputs_to_their_safe_values() {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let seen = std::rc::Rc::new(std::cell::RefCell::new(ProcessImage::default()));
        let wires = vec![
            wire("Q", bit(OTHER), Channel::BitOut(0), Some(Signal::Bit(false))),
            wire("AQ", place(48, 2), Channel::AnalogOut(0), Some(Signal::Analog(1.5))),
            wire("I", bit(FLAG), Channel::BitIn(0), None),
            wire("AI", place(56, 2), Channel::AnalogIn(0), None),
        ];
        let mut engine =
            load(program(&divide()), Options { executor, wires, ..Options::default() }, Box::new(Terminals { seen: seen.clone() }))
                .unwrap();
        engine.force(bit(OTHER), &[1]).unwrap();
        engine.write(place(48, 2), &4.0f64.to_le_bytes()).unwrap();
        steps(&mut engine, 2);
        assert!(engine.fault().is_none());
        assert_eq!((seen.borrow().bits_out[0], seen.borrow().analog_out[0]), (1, 4.0));
        assert_eq!((engine.read(bit(FLAG)), engine.read(place(56, 2))), (&[1][..], &8.0f64.to_le_bytes()[..]));
        engine.force(bit(OTHER), &[0]).unwrap();
        steps(&mut engine, 1);
        let record = engine.fault().unwrap();
        assert_eq!(
            record.to_string(),
            "integer division by zero at main.st:9:2 in SHARE, task Main, scan 3\n  called from main.st:7:1 in MAIN"
        );
        assert_eq!((seen.borrow().bits_out[0], seen.borrow().analog_out[0]), (0, 1.5));
        assert!(engine.at_rest());
        engine.reset(Reset::Warm).unwrap();
        engine.force(bit(OTHER), &[1]).unwrap();
        steps(&mut engine, 1);
        assert!(engine.fault().is_none() && engine.cycles() == 4);
    }
}

#[test]
fn a_driver_that_panics_is_a_bus_fault() {
    let mut engine = load(program(&toggle()), Options::default(), Box::new(Terminals { seen: Default::default() })).unwrap();
    steps(&mut engine, 50);
    assert_eq!(engine.io_faults(), (None, 0));
    steps(&mut engine, 1);
    assert_eq!(engine.io_faults(), (Some(IoFault::Panic), 1));
    steps(&mut engine, 1);
    assert_eq!(engine.io_faults(), (None, 1));
}

#[test]
fn wrong_wires_are_refused_by_name() {
    let refused = |wires: Vec<Wire>| {
        load(program(&toggle()), Options { wires, ..Options::default() }, Box::new(Terminals { seen: Default::default() }))
            .unwrap_err()
            .to_string()
    };
    let one = |place, channel, safe| refused(vec![wire("X", place, channel, safe)]);
    assert_eq!(one(bit(FLAG), Channel::BitIn(1), None), "wire `X`: there is no channel 1: the bus has 1 of its kind");
    assert_eq!(one(place(48, 2), Channel::BitIn(0), None), "wire `X`: the variable is `LREAL`, the channel takes a BOOL");
    assert_eq!(one(bit(FLAG), Channel::AnalogOut(0), None), "wire `X`: the variable is `BOOL`, the channel takes a REAL or LREAL");
    assert_eq!(one(bit(4096), Channel::BitIn(0), None), "wire `X`: the variable lies outside the program's memory");
    assert_eq!(one(bit(FLAG), Channel::BitOut(0), Some(Signal::Analog(1.0))), "wire `X`: the safe value does not go with the channel");
    let twice = vec![wire("X", bit(FLAG), Channel::BitOut(0), None), wire("Y", bit(OTHER), Channel::BitOut(0), None)];
    assert_eq!(refused(twice), "wire `Y`: it collides with `X`");
    let axis = AxisConfig::new("GVL.A", place(64, 1), 0);
    let error = load(program(&toggle()), Options { axes: vec![axis], ..Options::default() }, Box::new(NoBus)).unwrap_err();
    assert_eq!(error.to_string(), "axis `GVL.A`: the variable is `DINT`, expected `AXIS_REF_SM3`");
}

#[test]
fn a_condition_leaves_no_trace() {
    let text = format!(
        "{}
body \"condition\" () -> i64 frame 16 @1
  local i64, i64
b0:
  call 0() @1
  v0 = load.bool image+{OTHER}
  v1 = const 1
  v0 = xor v0, v1
  store.i64 frame+0, v0
  return v0
{}",
        toggle(),
        long("endless", i64::MAX)
    );
    both(&text, Options::default, |mut engine| {
        steps(&mut engine, 1);
        let before = engine.image().to_vec();
        assert_eq!(engine.evaluate(BodyId(1)), Ok(0), "FLAG is TRUE, so OTHER becomes TRUE and the result FALSE");
        assert_eq!(engine.image(), before);
        assert_eq!(engine.evaluate(BodyId(2)), Err(Fault::Watchdog));
        assert_eq!(engine.image(), before);
        assert!(engine.fault().is_none());
    });
}

takt_abi::native_fn! {
    /// Has a defect.
    pub fn DEFECT as Defect(cx, A: i64) -> i64 { let _ = cx; assert!(A == 0, "defect"); Ok(A) }
}

fn natives(name: &str) -> Option<Native> {
    (name == "DEFECT").then_some(Native { name: "DEFECT", call: Defect::DESC.call })
}

#[test]
fn a_panic_in_a_native_function_is_a_fault() {
    let text = "native DEFECT
task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256
body \"A\" () frame 0 @1
  local i64
b0:
  v0 = const 1
  v0 = native DEFECT(v0) @4
  return
";
    both(text, Options::default, |mut engine| {
        steps(&mut engine, 2);
        let record = engine.fault().unwrap();
        assert_eq!((record.fault, record.place.line), (Fault::Panic, 4));
    });
}

#[test]
fn a_fault_in_the_initial_values_is_told_at_loading() {
    let text = format!("start 0\n{}", divide());
    let error = load(program(&text), Options::default(), Box::new(NoBus)).unwrap_err();
    assert!(matches!(&error, LoadError::Initial(r) if r.fault == Fault::DivisionByZero && r.task.is_empty()), "{error}");
}

mod addresses;
mod commands;
mod limits;
mod retain;
