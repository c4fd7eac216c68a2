//! `{attribute 'isolated'}`: a fault of such a task stops it alone, and it goes on when it is told to. In both executors.

use std::sync::Arc;
use takt_abi::Fault;
use takt_engine::{Command, CommandError, Engine, ExecutorKind, LoadError, NoBus, Options, Preemption, Reset};
use takt_ir::resolve;

const SOURCE: &str = "VAR_GLOBAL fast, slow, divisor : DINT; wait : BOOL; END_VAR
PROGRAM control
fast := fast + 1;
END_PROGRAM
PROGRAM logging VAR i : DINT; END_VAR
FOR i := 1 TO 10 DO ; END_FOR
WHILE wait DO ; END_WHILE
IF divisor = 0 THEN
    slow := slow / divisor;
END_IF
slow := slow + divisor;
END_PROGRAM
CONFIGURATION plant
TASK main(INTERVAL := T#1ms, PRIORITY := 0);
{attribute 'isolated'}
TASK log(INTERVAL := T#10ms, PRIORITY := 9);
PROGRAM a WITH main : control;
PROGRAM b WITH log : logging;
END_CONFIGURATION";

fn load(source: &str, options: Options) -> Result<Engine, LoadError> {
    let output = takt_tests::bench::compile(source);
    let program = output.program.unwrap_or_else(|| panic!("does not compile: {:?}", output.diagnostics));
    takt_engine::load(Arc::new(program), options, Box::new(NoBus))
}

fn started(source: &str, options: Options) -> Engine {
    load(source, options).unwrap_or_else(|error| panic!("{error}"))
}

fn value(engine: &Engine, path: &str) -> i32 {
    let place = resolve(engine.program(), path).expect("a variable");
    i32::from_le_bytes(engine.read(place).try_into().expect("a DINT"))
}

fn write(engine: &mut Engine, path: &str, bytes: &[u8]) {
    let place = resolve(engine.program(), path).expect("a variable");
    engine.write(place, bytes).expect("can be written");
}

fn run(engine: &mut Engine, milliseconds: usize) {
    for _ in 0..milliseconds {
        engine.step(engine.next_release());
    }
}

fn both(test: impl Fn(ExecutorKind)) {
    [ExecutorKind::Interpreter, ExecutorKind::Jit].into_iter().for_each(test);
}

#[test]
fn a_fault_stops_the_task_alone_and_the_others_go_on() {
    both(|executor| {
        let mut engine = started(SOURCE, Options { executor, ..Options::default() });
        run(&mut engine, 100);
        assert!(engine.fault().is_none());
        let record = engine.task_fault(1).expect("it has divided by 0");
        assert_eq!((record.fault, record.place.line, record.task.as_str(), record.cycle), (Fault::DivisionByZero, 9, "log", 1));
        assert!(engine.task_fault(0).is_none() && engine.task_fault(7).is_none());
        assert_eq!((value(&engine, "fast"), value(&engine, "slow")), (100, 0));
        assert_eq!((engine.statistics(1).cycles, engine.statistics(1).overruns), (1, 0));
    });
}

#[test]
fn it_goes_on_when_it_is_told_to_with_the_variables_as_they_are() {
    both(|executor| {
        let mut engine = started(SOURCE, Options { executor, ..Options::default() });
        assert_eq!(engine.command(&Command::ResetTask(1)), Err(CommandError::NotStopped));
        run(&mut engine, 25);
        write(&mut engine, "divisor", &5i32.to_le_bytes());
        assert_eq!(engine.command(&Command::ResetTask(0)), Err(CommandError::NotStopped));
        assert_eq!(engine.command(&Command::ResetTask(1 << 20)), Err(CommandError::NotStopped));
        assert_eq!(engine.command(&Command::ResetTask(1)), Ok(()));
        assert!(engine.task_fault(1).is_none());
        run(&mut engine, 20);
        assert_eq!((value(&engine, "fast"), value(&engine, "slow")), (45, 10));
        write(&mut engine, "divisor", &0i32.to_le_bytes());
        run(&mut engine, 20);
        assert!(engine.task_fault(1).is_some(), "and may fault again");
        engine.reset(Reset::Warm).expect("starts anew");
        assert!(engine.task_fault(1).is_none(), "a reset of the program is one of its tasks");
    });
}

#[test]
fn an_endless_loop_and_a_fault_within_a_preemption_stop_it_alone() {
    both(|executor| {
        let preempt = vec![Preemption { cycle: 1, task: 1, at_fuel: 5 }];
        let mut engine = started(SOURCE, Options { executor, preempt, fuel_limit: 10_000, ..Options::default() });
        write(&mut engine, "wait", &[1]);
        run(&mut engine, 50);
        assert_eq!(engine.statistics(1).preempted, 1);
        assert_eq!(engine.task_fault(1).map(|record| record.fault), Some(Fault::Watchdog));
        assert!(engine.fault().is_none() && value(&engine, "fast") >= 49);
    });
}

#[test]
fn a_fault_of_the_task_that_interrupts_it_stops_the_application() {
    both(|executor| {
        let source = SOURCE.replace("fast := fast + 1;", "fast := fast + 1; IF fast = 2 THEN fast := fast / divisor; END_IF");
        let preempt = vec![Preemption { cycle: 1, task: 1, at_fuel: 5 }];
        let mut engine = started(&source, Options { executor, preempt, ..Options::default() });
        run(&mut engine, 3);
        assert_eq!(engine.fault().map(|record| record.task.as_str()), Some("main"));
        assert!(engine.task_fault(1).is_none(), "what it interrupted has no fault of its own");
    });
}

#[test]
fn a_checkpoint_knows_which_tasks_have_stopped() {
    both(|executor| {
        let mut engine = started(SOURCE, Options { executor, ..Options::default() });
        run(&mut engine, 15);
        let checkpoint = engine.checkpoint();
        write(&mut engine, "divisor", &5i32.to_le_bytes());
        engine.command(&Command::ResetTask(1)).expect("it is stopped");
        run(&mut engine, 30);
        assert!(value(&engine, "slow") > 0);
        engine.restore(&checkpoint).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(engine.task_fault(1).map(|record| record.place.line), Some(9));
        run(&mut engine, 30);
        assert_eq!((value(&engine, "fast"), value(&engine, "slow")), (45, 0));
        let mut other = started(&SOURCE.replace("{attribute 'isolated'}", ""), Options { executor, ..Options::default() });
        assert!(other.restore(&checkpoint).is_err(), "a task that is not isolated cannot have stopped alone");
    });
}

#[test]
fn the_task_that_owns_the_bus_cannot_be_isolated() {
    let source = SOURCE.replace("TASK main", "{attribute 'isolated'}\nTASK main");
    let error = load(&source, Options::default()).expect_err("is refused");
    assert_eq!(error, LoadError::IsolatedBus { name: "main".into() });
    assert!(error.to_string().contains("`main`"));
}

#[test]
fn the_page_shows_such_a_task() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/realtime.md")).expect("the page");
    let snippet = page.split("```iecst\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a program");
    both(|executor| {
        let mut engine = started(snippet, Options { executor, ..Options::default() });
        run(&mut engine, 150);
        assert_eq!(engine.task_fault(1).map(|record| (record.fault, record.cycle)), Some((Fault::DivisionByZero, 1)));
        assert!(engine.fault().is_none() && value(&engine, "Control.scans") == 150);
    });
}
