//! A small machine from its manifest: it runs to its end, and every name that does not exist has its place.

use super::*;
use crate::sources::Sources;
use takt_abi::Fault;
use takt_syntax::Source;

const GVL: &str = "VAR_GLOBAL\nX : AXIS_REF_SM3;\nGo, Stop, Done, Lamp : BOOL;\nTarget : LREAL := 10.0;\nPressure : LREAL;\nEND_VAR\nVAR_GLOBAL CONSTANT\nFixed : INT := 3;\nEND_VAR\n";
const PROGRAM: &str = "PROGRAM PLC_PRG
VAR power : MC_Power; move : MC_MoveAbsolute; count : INT; END_VAR
power(Axis := X, Enable := TRUE, bRegulatorOn := TRUE, bDriveStart := TRUE);
IF Go THEN count := count + 1; END_IF
move(Axis := X, Execute := Go OR move.Busy, Position := Target, Velocity := 50.0, Acceleration := 500.0, Deceleration := 500.0, Jerk := 50000.0);
Done := Done OR move.Done;
Lamp := Stop;
END_PROGRAM
CONFIGURATION c RESOURCE r ON cpu TASK t(INTERVAL := T#2ms, PRIORITY := 0); PROGRAM p WITH t : PLC_PRG; END_RESOURCE END_CONFIGURATION
";
const MANIFEST: &str = "[axis.X]
increments-per-unit = 1000
limits = { negative = -100.0, positive = 100.0, velocity = 100.0, acceleration = 1000.0 }
[io]
\"GVL.Stop\" = \"sim/stop\"
\"GVL.Lamp\" = \"sim/lamp\"
\"GVL.Pressure\" = \"sim/oil\"
[sim]
inputs = { stop = false }
analog = { oil = 2.5 }
outputs = [\"lamp\"]
[simulation]
done = \"Done AND Lamp\"
timeout = \"10s\"
[[simulation.operator]]
when = \"PLC_PRG.power.Status\"
after = \"20ms\"
set = { \"GVL.Go\" = true }
pulse = \"10ms\"
[[simulation.operator]]
input = { stop = true }
[report]
lines = [ { label = \"Position\", value = \"GVL.X.fActPosition\" } ]
";

fn project(manifest: &str, program: &str) -> Project {
    let source = |name: &str, text: &str| Source { name: name.into(), text: text.into() };
    Project {
        name: "test".into(),
        root: std::env::temp_dir(),
        manifest: crate::manifest::read("takt.toml", manifest).unwrap(),
        manifest_file: Some(("takt.toml".into(), manifest.into())),
        sources: Sources { list: vec![source("GVL.st", GVL), source("main.st", program)], ..Sources::default() },
    }
}

fn machine(manifest: &str) -> Machine {
    Machine::new(&project(manifest, PROGRAM), Setup::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn check(old: &str, new: &str, expected: &str) {
    assert!(MANIFEST.contains(old), "{old}");
    let error = Machine::new(&project(&MANIFEST.replace(old, new), PROGRAM), Setup::default()).expect_err("refused").to_string();
    assert!(error.contains(expected), "expected `{expected}` in:\n{error}");
}

#[test]
fn a_demonstration_runs_to_its_end() {
    let mut machine = machine(MANIFEST);
    assert_eq!(machine.run(Time(i64::MAX), |_| {}), Some(End::Done));
    assert!((machine.number("GVL.X.fActPosition").unwrap() - 10.0).abs() < 0.1);
    assert_eq!(machine.number("GVL.Pressure"), Ok(2.5));
    assert_eq!(machine.bus().control.bit("lamp"), Some(true));
    assert_eq!(machine.number("PLC_PRG.count"), Ok(5.0), "the pulse of 10 ms is five scans of 2 ms");
    assert_eq!(machine.boolean("GVL.Go"), Ok(false));
    assert_eq!(machine.elapsed(), Time(machine.cycles() as i64 * 2_000_000));
}

#[test]
fn two_runs_are_the_same_run() {
    let [mut a, mut b] = [machine(MANIFEST), machine(MANIFEST)];
    for machine in [&mut a, &mut b] {
        machine.run(Time(i64::MAX), |_| {});
    }
    assert!(a.engine().image() == b.engine().image());
}

#[test]
fn a_demonstration_that_hangs_says_what_it_waits_for() {
    let mut machine = machine(&MANIFEST.replace("PLC_PRG.power.Status", "PLC_PRG.count > 5"));
    assert_eq!(machine.run(Time(i64::MAX), |_| {}), Some(End::TimedOut { waiting_for: "PLC_PRG.count > 5".into() }));
    assert_eq!(machine.elapsed(), Time::from_millis(10_000));
}

#[test]
fn variables_are_set_and_read_by_name() {
    let mut machine = machine(MANIFEST);
    machine.set("GVL.Target", "-2.5").unwrap();
    assert_eq!(machine.literal("gvl.target"), Ok("-2.5".into()));
    assert_eq!(
        machine.set("GVL.Fixed", "4"),
        Err(VariableError::Access { path: "GVL.Fixed".into(), error: takt_engine::AccessError::Constant })
    );
    assert!(machine.set("GVL.Targt", "1").unwrap_err().to_string().contains("did you mean `Target`?"));
    assert!(machine.set("GVL.Go", "7").is_err());
    assert!(machine.string("GVL.Go").is_err());
}

#[test]
fn every_name_that_does_not_exist_has_its_place() {
    check("[axis.X]", "[axis.Y]", "takt.toml:1:7: there is no global axis `Y`");
    check("\"sim/lamp\"", "\"sim/lmp\"", "takt.toml:6:14: the bus has no channel \"sim/lmp\" (did you mean \"sim/lamp\"?)");
    check("\"GVL.Stop\" =", "\"GVL.Stp\" =", "takt.toml:5:1: there is no `Stp` in `GVL`; did you mean `Stop`?");
    check("\"GVL.Pressure\" =", "\"GVL.Go\" =", "takt.toml:7:1:");
    check("\"GVL.Go\" = true", "\"GVL.Go\" = 12", "takt.toml:18:");
    check("\"GVL.Go\" = true", "\"GVL.Fixed\" = 12", "`GVL.Fixed`: a constant cannot be written");
    check("{ stop = true }", "{ stp = true }", "the simulated bus has no input `stp` (did you mean `stop`?)");
    check("fActPosition", "fActPostion", "did you mean `fActPosition`?");
    check("outputs = [\"lamp\"]", "outputs = [\"lamp\", \"oil\"]", "two channels are called `oil`");
    check("[sim]", "[sim.axis.Y]\nstart = 1.0\n[sim]", "takt.toml:8:11: [sim.axis.Y] has no [axis.Y]");
    check(
        "velocity = 100.0, acceleration = 1000.0 }",
        "velocity = 100.0, acceleration = 1000.0 }\nhome = { method = 21 }",
        "takt.toml:1:7: the simulated bus: `X`",
    );
    check("Done AND Lamp", "Done AND Lmap", "takt.toml:13:18: E0201");
}

#[test]
fn an_axis_without_a_table_is_refused() {
    let manifest = "[sim]\ninputs = {}\n";
    let error = Machine::new(&project(manifest, PROGRAM), Setup::default()).expect_err("refused").to_string();
    assert!(error.contains("the global axis `GVL.X` has no table"), "{error}");
}

#[test]
fn a_fault_ends_the_run_and_names_its_line() {
    let program = PROGRAM.replace("count := count + 1;", "count := count / (count - count);");
    let mut machine = Machine::new(&project(MANIFEST, &program), Setup::default()).unwrap();
    assert_eq!(machine.run(Time(i64::MAX), |_| {}), Some(End::Fault));
    let fault = machine.fault().expect("a fault");
    assert_eq!((fault.fault, fault.place.file.as_str(), fault.place.line, fault.task.as_str()), (Fault::DivisionByZero, "main.st", 4, "t"));
}

mod addresses;
