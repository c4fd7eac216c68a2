//! How late a 1 ms task starts beside a slow one that computes all the time, and how late the watchdog cuts an endless loop.
//!
//! `cargo run --release -p takt-tests --example preemption [SECONDS]` (5 per case without an argument). `beside nothing` is what the computer adds by itself;
//! what the others have on top of it is the way from the release to the next poll. Figures of a busy computer say little.

use std::fmt::Write;
use takt::clock::{self, Pace};
use takt::machine::{Machine, NATIVE_STACK, Setup};
use takt::project::Project;
use takt::realtime::{Held, Settings};
use takt::sources::Sources;
use takt_abi::Time;
use takt_engine::{Clock, ExecutorKind};
use takt_syntax::Source;

/// A machine with a fast task that counts and a slow one with this body.
fn machine(variables: &str, body: &str, executor: ExecutorKind, watchdog: &str) -> Machine {
    let text = format!(
        "PROGRAM Fast VAR n : UDINT; END_VAR n := n + 1; END_PROGRAM
PROGRAM Slow VAR i, turns : DINT; {variables} END_VAR
{body}
END_PROGRAM
CONFIGURATION C RESOURCE R ON CPU
TASK Fast(INTERVAL := T#1ms, PRIORITY := 0);
TASK Slow(INTERVAL := T#20ms, PRIORITY := 9);
PROGRAM a WITH Fast : Fast; PROGRAM b WITH Slow : Slow;
END_RESOURCE END_CONFIGURATION"
    );
    let list = vec![Source { name: "main.st".into(), text }];
    let manifest = takt::manifest::read("takt.toml", &format!("[task.Slow]\nwatchdog = \"{watchdog}\"\n")).expect("a manifest");
    let project = Project { root: std::env::temp_dir(), sources: Sources { list, ..Sources::default() }, manifest, ..Project::default() };
    let setup = Setup {
        executor,
        clock: Clock::Real(clock::machine_time),
        stopwatch: Some(clock::nanoseconds),
        alarm: true,
        native_stack: Some(NATIVE_STACK),
        ..Setup::default()
    };
    Machine::new(&project, setup).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs for so long, or to a fault.
fn run(machine: &mut Machine, time: Time) {
    let held = Held::hold(Settings::default(), machine.engine().native_stack());
    let pace = Pace::start(Some(1.0));
    while machine.elapsed() < time && machine.fault().is_none() {
        let now = pace.wait_fully(machine.engine().next_release());
        machine.step_at(now);
    }
    drop(held);
}

/// So many calls one behind the other, without a loop around them.
fn calls(count: usize, call: &str) -> String {
    (0..count).fold(String::new(), |mut text, _| {
        let _ = writeln!(text, "{call}");
        text
    })
}

fn main() {
    let seconds = std::env::args().nth(1).map_or(Ok(5), |text| text.parse()).expect("a number of seconds");
    let thread = std::thread::Builder::new().stack_size(NATIVE_STACK + (16 << 20));
    thread.spawn(move || measure(seconds)).expect("a thread").join().expect("its end");
}

fn measure(seconds: i64) {
    let inverse = "t(X := i, Y := 1.0, Z := -60.0, B := 10.0, C := i);";
    let forward = "f(Theta1 := i, Theta2 := 10.0, D1 := 1.0, D2 := 2.0, D3 := 400.0);";
    let blocks = format!("FOR i := 1 TO 100 DO\n{}END_FOR", calls(200, &format!("{inverse} {forward}")));
    let vars = "t : InverseTransformation; f : ForwardTransformation; r : LREAL; s : STRING(200); a : ARRAY[0..999] OF LREAL;";
    let cases: [(&str, String); 6] = [
        ("nothing", String::new()),
        ("ST, a tight loop", "FOR i := 1 TO 8000000 DO turns := turns + 1; END_FOR".into()),
        ("ST, sines", "FOR i := 1 TO 500000 DO r := r + SIN(r + i); END_FOR".into()),
        ("ST, arrays", "FOR i := 1 TO 4000000 DO a[i MOD 1000] := a[(i + 7) MOD 1000] + 1.0; END_FOR".into()),
        ("texts", "FOR i := 1 TO 50000 DO s := CONCAT(LEFT(s, 100), DINT_TO_STRING(i)); END_FOR".into()),
        ("blocks, 400 calls without a loop, 100 times", blocks),
    ];
    println!(
        "1 ms task, from its release to its start, µs             p50      p99      max   overruns   slow task, mean ms   interrupted"
    );
    let mut alone = None;
    for executor in [ExecutorKind::Jit, ExecutorKind::Interpreter] {
        for (name, body) in &cases {
            let mut machine = machine(vars, body, executor, "10s");
            run(&mut machine, Time::from_millis(seconds * 1000));
            let us = |ns: u64| ns as f64 * 1e-3;
            let (fast, slow) = (machine.engine().statistics(0).clone(), machine.engine().statistics(1).clone());
            let jitter = &fast.jitter_ns;
            let p99 = us(jitter.percentile(0.99));
            let extra = p99 - *alone.get_or_insert(p99);
            println!(
                "{:50} {:8.1} {:8.1} {:8.1} {:10} {:20.2} {:13}   p99 {extra:+.1} {}",
                format!("{executor:?} beside {name}"),
                us(jitter.percentile(0.5)),
                p99,
                us(jitter.max()),
                fast.overruns,
                slow.scan_ns.mean() * 1e-6,
                slow.preempted,
                machine.fault().map_or_else(String::new, |fault| fault.fault.to_string()),
            );
        }
    }
    println!("\nwatchdog of 50 ms: what an endless loop took beyond it, ms");
    for executor in [ExecutorKind::Jit, ExecutorKind::Interpreter] {
        let endless = [
            ("ST", "WHILE i >= 0 DO turns := turns + 1; END_WHILE".to_string()),
            ("ST, sines", "WHILE i >= 0 DO r := r + SIN(r); END_WHILE".to_string()),
            ("blocks", format!("WHILE i >= 0 DO {} END_WHILE", calls(400, inverse))),
        ];
        for (name, body) in &endless {
            let mut machine = machine(vars, body, executor, "50ms");
            run(&mut machine, Time::from_millis(1000));
            let took = machine.engine().statistics(1).scan_ns.max() as f64 * 1e-6;
            let fault = machine.fault().map_or_else(|| "none".to_string(), |fault| fault.fault.to_string());
            println!("{:50} {:8.3}   {fault}", format!("{executor:?} {name}"), took - 50.0);
        }
    }
}
