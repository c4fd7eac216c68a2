//! The table of mistakes: each says its line, what is wrong and what to do.

use super::*;
use takt_abi::Time;

const AXIS: &str =
    "[axis.A]\nincrements-per-unit = \"1000 * 2\"\nlimits = { negative = -1.0, positive = 1.0, velocity = 1.0, acceleration = 2.0 }\n";

#[track_caller]
fn check(text: &str, line: usize, expected: &str) {
    let errors = read("takt.toml", text).expect_err("the manifest is wrong").to_string();
    let prefix = format!("takt.toml:{line}:");
    assert!(errors.lines().any(|l| l.starts_with(&prefix) && l.contains(expected)), "expected line {line} with `{expected}` in:\n{errors}");
}

#[test]
fn an_empty_manifest_is_a_project() {
    assert_eq!(read("takt.toml", ""), Ok(Manifest::default()));
}

#[test]
fn an_axis_has_defaults() {
    let manifest = read("takt.toml", AXIS).unwrap();
    let axis = &manifest.axes[0];
    assert_eq!((axis.increments_per_unit, axis.limits.deceleration, axis.limits.jerk, axis.absolute), (2000.0, 2.0, 40.0, true));
}

#[test]
fn axes_keep_the_order_of_the_text() {
    let text = format!("{}{}", AXIS.replace("axis.A", "axis.Z"), AXIS.replace("axis.A", "axis.B"));
    let names: Vec<_> = read("takt.toml", &text).unwrap().axes.into_iter().map(|axis| axis.name.value).collect();
    assert_eq!(names, ["Z", "B"]);
}

#[test]
fn defines_are_names_with_texts() {
    let manifest = read("takt.toml", "[defines]\nSIM = \"\"\nTARGET = \"cell 3\"\n").unwrap();
    let mut defines = manifest.defines;
    defines.sort();
    assert_eq!(defines, [("SIM".to_owned(), String::new()), ("TARGET".to_owned(), "cell 3".to_owned())]);
    check("[defines]\n\"a b\" = \"1\"\n", 2, "`a b` in [defines] must be a name");
    check("[defines]\nA = 1\n", 2, "`A`");
}

#[test]
fn every_mistake_has_its_line_and_a_way_out() {
    check("[projet]\n", 1, "unknown key `projet` in the manifest (did you mean `project`?)");
    check("[project]\nsouces = [\"src\"]\n", 2, "unknown key `souces` in [project] (did you mean `sources`?)");
    check("[project]\nstrict = \"yes\"\n", 2, "`strict` in [project] must be true or false, found the text \"yes\"");
    check("[project]\narithmetic = \"ice\"\n", 2, "must be \"codesys\" or \"iec\", found \"ice\" (did you mean \"iec\"?)");
    check("[project]\nsources = \"src\"\n", 2, "must be a list of texts");
    check("[axis.A]\n", 1, "[axis.A] has no `increments-per-unit`");
    check("[axis.A]\nincrements-per-unit = \"2 *\"\n", 2, "expected a number here");
    check("[axis.A]\nincrements-per-unit = 0\n", 2, "must be from");
    check("[axis.A]\nincrements-per-unit = nan\n", 2, "must be from");
    check(&format!("{AXIS}bus = \"ethercat/3\"\n"), 4, "simulated drives only");
    check(&AXIS.replace("velocity = 1.0", "velocity = -1"), 3, "`velocity` in [axis.A.limits] must be from 0.000001 to 1000000, found -1");
    check(&AXIS.replace("velocity = 1.0, ", ""), 3, "[axis.A.limits] has no `velocity`");
    check(&AXIS.replace("positive = 1.0", "positive = -2.0"), 3, "`negative` must be below `positive`, found -1 and -2");
    check(&format!("{AXIS}lag = {{ warn = 2.0, trip = 1.0 }}\n"), 4, "`warn` must not be above `trip`");
    check(&format!("{AXIS}home = {{ method = 5 }}\n"), 4, "no homing method 5");
    check(&format!("{AXIS}backlash = 0.1\n"), 4, "must be from 0 to 0");
    check("[simulation]\ntimeout = 120\n", 2, "must be a duration, found the number 120");
    check("[simulation]\n[[simulation.operator]]\nafter = \"1 parsec\"\n", 3, "must be a duration");
    check("[simulation]\n[[simulation.operator]]\npulse = \"1s\"\n", 2, "a `pulse` without `set`");
    check("[plot]\ntcp = [\"a\"]\n", 1, "must have 3 variables, found 1");
    check("[bus]\nkind = \"profinet\"\n", 2, "must be \"sim\"");
    check("[io]\na = 3\n", 2, "`a` in [io] must be a text");
    check("[io]\na = { chanel = \"sim/x\" }\n", 2, "did you mean `channel`?");
    check("a = \n[x\n", 1, "");
}

#[test]
fn all_mistakes_are_found_at_once() {
    let errors = read("takt.toml", "[project]\nstrict = 1\nnaem = 2\n[bus]\nkind = 3\n").expect_err("three mistakes");
    assert_eq!(errors.errors.len(), 3);
}

#[test]
fn columns_count_characters() {
    let errors = read("takt.toml", "project = { name = \"点胶机\", x = 1 }\n").expect_err("a mistake");
    assert!(errors.to_string().starts_with("takt.toml:1:27:"), "{errors}");
}

#[test]
fn a_step_of_the_operator_is_read() {
    let text = "[simulation]\ndone = \"GVL.Done\"\ntimeout = \"2m\"\n[[simulation.operator]]\nwhen = \"a > 1\"\nset = { \"GVL.On\" = true, \"x\" = \"T#1s\", y = 0x1F }\npulse = \"100ms\"\ninput = { estop = false }\n";
    let simulation = read("takt.toml", text).unwrap().simulation.unwrap();
    assert_eq!(simulation.timeout, Some(takt_abi::Time::from_millis(120_000)));
    let values: Vec<_> = simulation.operator[0].set.iter().map(|s| (s.variable.value.as_str(), s.value.value.as_str())).collect();
    assert_eq!(values, [("GVL.On", "TRUE"), ("x", "T#1s"), ("y", "16#1F")]);
    assert_eq!(simulation.operator[0].inputs[0].value, 0.0);
}

#[test]
fn the_resource_thread_and_the_limits_of_tasks_are_read() {
    let manifest = read("takt.toml", "[realtime]\npriority = 0\ncpu = 3\nspin = \"50us\"\nlock-memory = false\n[task.Motion]\nwatchdog = \"5ms\"\nsensitivity = 2\nmax-overruns = 10\n[task.Slow]").unwrap();
    let realtime = manifest.realtime;
    assert_eq!((realtime.priority, realtime.cpu, realtime.spin, realtime.lock_memory), (0, Some(3), Time(50_000), false));
    assert!(realtime.stay_awake);
    let [motion, slow] = &manifest.tasks[..] else { panic!("{:?}", manifest.tasks) };
    assert_eq!((motion.watchdog, motion.sensitivity, motion.max_overruns), (Some(Time::from_millis(5)), Some(2), Some(10)));
    assert_eq!((slow.name.value.as_str(), slow.watchdog), ("Slow", None));
}

#[test]
fn nonsense_about_time_is_refused_with_its_place() {
    let text = "[realtime]\npriority = 99\ncpu = 1.5\nspin = \"2ms\"\nspn = 1\n[task.Motion]\nwatchdog = 5\n";
    let errors = read("takt.toml", text).unwrap_err().to_string();
    for part in ["2:12", "from 0 to 98, found 99", "whole number, found 1.5", "`spin`", "at most 1ms", "`spn`", "7:12", "a duration"] {
        assert!(errors.contains(part), "{part}: {errors}");
    }
}
