//! The five-axis dispenser end to end: the figures of its job, pauses, bad input, faults of drives and inputs.

#[path = "dispenser/rig.rs"]
mod rig;
#[path = "dispenser/truth.rs"]
mod truth;

use rig::{AXES, Bench, Row, distance, dots};
use truth::Truth;

/// Seconds that the spline needs to settle behind a ramp of the time law.
const SETTLE: f64 = 0.05;
const SPEED: f64 = 20.0;
const PITCH: f64 = 20.0 / 12.0;

/// Largest deviation of the tip's speed from the set speed, %, where the law's speed is constant.
fn ripple(rows: &[Row]) -> f64 {
    let constant = rows.windows(3).filter(|w| w.iter().all(|r| r.constant > SETTLE && r.override_ == 1.0));
    constant.map(|w| distance(w[2].tcp, w[1].tcp) * 1000.0).fold(0.0, |worst: f64, speed| worst.max((speed / SPEED - 1.0).abs() * 100.0))
}

fn deviation_um(rows: &[Row]) -> f64 {
    let truth = Truth::load();
    rows.iter().map(|row| truth.distance(row.tcp)).fold(0.0, f64::max) * 1000.0
}

fn check_dots(rows: &[Row]) {
    let dots = dots(rows);
    assert!((257..=259).contains(&dots.len()), "{} dots", dots.len());
    for pair in dots.windows(2) {
        let spacing = distance(pair[0], pair[1]);
        assert!((spacing - PITCH).abs() <= 0.03, "dots {spacing} mm apart");
    }
}

/// Velocity and acceleration of every axis by finite differences of the set positions, every cycle.
fn check_axis_limits(bench: &Bench, rows: &[Row]) {
    for (i, name) in AXES.iter().enumerate() {
        let limit = |what: &str| bench.number(&format!("GVL.{name}.fSWMax{what}"));
        let (velocity, acceleration) = (limit("Velocity"), limit("Acceleration"));
        for w in rows.windows(3) {
            let [a, b, c] = [0, 1, 2].map(|k| w[k].axes[i]);
            let (v, acc) = ((c - b) * 1e3, (c - 2.0 * b + a) * 1e6);
            assert!(v.abs() <= velocity && acc.abs() <= acceleration, "{name}: {v} per s, {acc} per s² at {} mm", w[2].path);
        }
    }
}

#[test]
fn phone_in_joint_mode_reaches_its_figures() {
    let mut bench = Bench::ready("joint");
    let rows = bench.job();
    let (ripple, deviation, time) = (ripple(&rows), deviation_um(&rows), bench.number("GVL.JobTime"));
    println!("joint: ripple {ripple:.4} %, deviation {deviation:.3} um, {time:.4} s, {} dots", dots(&rows).len());
    assert!(ripple <= 0.6 && deviation <= 2.0);
    assert!((time - 32.0).abs() <= 0.05 && (rows.len() as f64 * 1e-3 - 32.0).abs() <= 0.05, "{time} s");
    check_dots(&rows);
    check_axis_limits(&bench, &rows);
    assert_eq!(bench.text("GVL.ErrorText"), "");
    assert_eq!(bench.machine.bus().control.valve_openings(), dots(&rows).len() as u64);
}

#[test]
fn phone_in_part_space_reaches_its_figures() {
    let mut bench = Bench::ready("part");
    bench.set("GVL.PartSpaceMode", "TRUE");
    let rows = bench.job();
    let (ripple, deviation, time) = (ripple(&rows), deviation_um(&rows), bench.number("GVL.JobTime"));
    println!("part space: ripple {ripple:.4} %, deviation {deviation:.3} um, {time:.4} s, {} dots", dots(&rows).len());
    assert!(ripple <= 0.05 && deviation <= 1.5);
    assert!((time - 32.0).abs() <= 0.05, "{time} s");
    check_dots(&rows);
    check_axis_limits(&bench, &rows);
}

#[test]
fn a_job_paused_at_100_places_has_the_same_dots() {
    let mut bench = Bench::ready("pause");
    let undisturbed = dots(&bench.job());
    bench.start();
    let mut rows = vec![bench.row()];
    let mut random = 0x9E37_79B9_7F4A_7C15_u64;
    let mut pauses = 0;
    while bench.state() != "Done" {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let wait = (random >> 33) % 320;
        for (command, state, hold) in [("", "", wait), ("Pause", "Paused", 7), ("Resume", "Running", 0)] {
            bench.set("GVL.Cmd.Pause", if command == "Pause" { "TRUE" } else { "FALSE" });
            bench.set("GVL.Cmd.Resume", if command == "Resume" { "TRUE" } else { "FALSE" });
            let mut left = hold;
            while bench.state() != "Done" && ((!state.is_empty() && bench.state() != state) || left > 0) {
                left = left.saturating_sub(u64::from(state.is_empty() || bench.state() == state));
                bench.step();
                rows.push(bench.row());
            }
        }
        pauses += 1;
    }
    assert!(pauses >= 100, "{pauses} pauses");
    let paused = dots(&rows);
    assert_eq!(paused.len(), undisturbed.len());
    for (a, b) in paused.iter().zip(&undisturbed) {
        assert!(distance(*a, *b) <= 0.03, "a dot is {} mm from its place", distance(*a, *b));
    }
    check_axis_limits(&bench, &rows);
    assert!((bench.number("GVL.JobTime") - 32.0).abs() <= 0.05);
}

/// The machine refuses a job, says why, stays shut, and goes on with a good one.
fn check_refused(bench: &mut Bench, file: &str, expected: &str) {
    bench.set("GVL.NcFile", &format!("'{file}'"));
    bench.press("Load");
    let mut left = 3000;
    while bench.text("GVL.ErrorText").is_empty() && left > 0 {
        bench.step();
        left -= 1;
    }
    let text = bench.text("GVL.ErrorText");
    println!("{file}: {text}");
    assert!(text.contains(expected), "{file}: expected `{expected}` in `{text}` ({})", bench.state());
    assert!(!bench.row().valve && !bench.machine.boolean("GVL.Out.Valve").expect("an output"));
    bench.press("Reset");
    assert_eq!((bench.text("GVL.ErrorText").as_str(), bench.state()), ("", "Ready"));
}

#[test]
fn bad_files_are_refused_with_their_place_and_the_machine_goes_on() {
    let mut bench = Bench::ready("bad-files");
    let head = "G90\nG00 X0 Y0 Z30 A0 B0 C0\n";
    let cases: [(&str, &str, &str); 20] = [
        ("empty.cnc", "", "empty"),
        ("word.cnc", "G01 X10 T3 F20\n", "word.cnc:3:"),
        ("missing.cnc", "G01 X F20\n", "missing.cnc:3:"),
        ("nan.cnc", "G01 XNaN F20\n", "nan.cnc:3:"),
        ("huge.cnc", "G01 X1e308 F20\n", "huge.cnc:3:"),
        ("digits.cnc", "G01 X99999999999999999999 F20\n", "digits.cnc:3:"),
        ("arc.cnc", "G02 X10 Y0 I3 J0 F20\n", "arc.cnc:3:"),
        ("feed.cnc", "G01 X10 F0\n", "feed.cnc:3:"),
        ("fast.cnc", "G01 X10 F900\n", "MaxSpeed"),
        ("tilt.cnc", "G01 X10 A5 F20\n", "A must be 0"),
        ("far.cnc", "G01 X900 F20\n", "far.cnc:3: D1"),
        ("high.cnc", "G01 Z200 F20\n", "high.cnc:3: D3"),
        ("round.cnc", "G01 X10 C500 F20\n", "Theta1"),
        ("m.cnc", "M55\n", "M55"),
        ("twice.cnc", "G00 G01 X10 F20\n", "twice.cnc:3:"),
        ("jump.cnc", "G92 X100\nG01 X105 F20\n", "jump.cnc:4: the path jumps"),
        ("alone.cnc", "M30\n", "no path"),
        ("where.cnc", "", "X, Y and Z"),
        ("nothing.cnc", "", "no move"),
        ("dwell.cnc", "G04 T-1\n", "dwell.cnc:3:"),
    ];
    for (name, body, expected) in cases {
        let text = match name {
            "empty.cnc" => String::new(),
            "where.cnc" => "G01 X10 F20\n".into(),
            "nothing.cnc" => "( nothing )\nM30\n".into(),
            _ => format!("{head}{body}M30\n"),
        };
        bench.file(name, text);
        check_refused(&mut bench, name, expected);
    }
    bench.file("binary.cnc", [0u8, 1, 2, 3, 255, 0, 17]);
    check_refused(&mut bench, "binary.cnc", "binary.cnc");
    bench.file("line.cnc", vec![b'X'; 3_000_000]);
    check_refused(&mut bench, "line.cnc", "line.cnc");
    check_refused(&mut bench, "absent.cnc", "absent.cnc");
    check_refused(&mut bench, "../takt.toml", "takt.toml");
    check_refused(&mut bench, "/etc/passwd", "passwd");
    check_refused(&mut bench, "", "");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/etc/passwd", bench.folder().join("nc/link.cnc")).expect("the folder is ours");
        check_refused(&mut bench, "link.cnc", "link.cnc");
    }
    bench.set("GVL.NcFile", "'phone.cnc'");
    bench.press("Load");
    bench.wait_for("Loaded", 5.0);
}

/// Lets a job run for `seconds`, does something to the machine, and expects it to stop shut with an alarm.
fn check_fault(bench: &mut Bench, seconds: f64, harm: impl Fn(&mut Bench), state: &str, expected: &str) {
    bench.set("GVL.NcFile", "'phone.cnc'");
    bench.start();
    bench.run(seconds);
    let before = bench.row();
    harm(bench);
    bench.step();
    let mut left = 2000;
    while bench.state() != state && left > 0 {
        bench.step();
        left -= 1;
    }
    let text = bench.text("GVL.ErrorText");
    println!("{expected}: {text}");
    assert!(bench.state() == state && text.contains(expected), "expected `{expected}` in `{text}` ({})", bench.state());
    bench.run(2.0);
    let after = bench.row();
    assert!(!after.valve && after.dots <= before.dots + 1, "the valve is not shut");
    bench.run(0.5);
    assert_eq!(after.tcp, bench.row().tcp, "the machine moves");
    assert_eq!(bench.state(), state, "it does not start by itself");
}

fn recover(bench: &mut Bench) {
    bench.press("Reset");
    bench.run(1.2);
    assert_eq!(bench.text("GVL.ErrorText"), "");
    if bench.state() == "Off" {
        bench.press("ControlOn");
        bench.run(2.0);
    }
    if bench.state() == "Standby" {
        bench.press("HomeAll");
    }
    bench.wait_for("Ready", 60.0);
}

#[test]
fn faults_on_the_path_stop_the_machine_shut_and_it_goes_on_after_reset() {
    let mut bench = Bench::ready("faults");
    check_fault(&mut bench, 9.0, |b| assert!(b.machine.bus().set_input("air", 0.0)), "Faulted", "air");
    assert!(bench.machine.bus().set_input("air", 1.0));
    recover(&mut bench);
    check_fault(&mut bench, 10.1, |b| assert!(b.machine.bus().set_input("door", 0.0)), "Faulted", "door");
    assert!(bench.machine.bus().set_input("door", 1.0));
    recover(&mut bench);
    check_fault(&mut bench, 12.3, |b| b.machine.bus().control.lose_power(3).expect("a drive"), "Faulted", "D2");
    bench.machine.bus().control.restore_power(3).expect("a drive");
    recover(&mut bench);
    check_fault(&mut bench, 11.0, |b| b.machine.bus().control.fail_drive(0, 0x7305).expect("a drive"), "Faulted", "Theta1");
    recover(&mut bench);
    check_fault(&mut bench, 8.0, |b| assert!(b.machine.bus().set_input("estop", 0.0)), "EmergencyStop", "emergency stop");
    bench.press("Reset");
    assert_eq!(bench.state(), "EmergencyStop", "not while the button is pressed");
    assert!(bench.machine.bus().set_input("estop", 1.0));
    bench.run(1.0);
    assert_eq!(bench.state(), "EmergencyStop", "not by itself");
    recover(&mut bench);
    bench.start();
    bench.run(6.0);
    bench.press("Stop");
    bench.wait_for("Ready", 2.0);
    let rows = bench.job();
    check_dots(&rows);
}

#[test]
fn the_emergency_stop_shuts_the_valve_in_the_same_scan() {
    let mut bench = Bench::ready("estop");
    bench.start();
    while !bench.row().valve {
        bench.step();
    }
    assert!(bench.machine.bus().set_input("estop", 0.0));
    bench.step();
    // the input travels for one exchange at the most
    bench.step();
    assert!(!bench.row().valve && !bench.machine.boolean("GVL.Out.Valve").expect("an output"));
}

#[test]
fn a_machine_that_is_not_homed_or_whose_switches_stick_says_so() {
    let mut bench = Bench::new("home");
    bench.run(0.1);
    bench.press("Load");
    assert!(bench.text("GVL.ErrorText").contains("ControlOn"), "{}", bench.text("GVL.ErrorText"));
    bench.press("Reset");
    bench.press("ControlOn");
    bench.wait_for("Standby", 5.0);
    bench.press("Start");
    assert!(bench.text("GVL.ErrorText").contains("HomeAll first"), "{}", bench.text("GVL.ErrorText"));
    bench.press("Reset");
    for axis in [0, 1] {
        bench.machine.bus().control.stick_home_switch(axis, true).expect("a drive");
    }
    bench.press("HomeAll");
    bench.wait_for("Faulted", 120.0);
    assert!(bench.text("GVL.ErrorText").contains("Theta2"), "{}", bench.text("GVL.ErrorText"));
    for axis in [0, 1] {
        bench.machine.bus().control.stick_home_switch(axis, false).expect("a drive");
    }
    recover(&mut bench);
    bench.set("GVL.Par.Jerk", "-1.0");
    bench.press("Load");
    assert!(bench.text("GVL.ErrorText").contains("Jerk"), "{}", bench.text("GVL.ErrorText"));
}

#[test]
fn what_cannot_be_reached_behind_the_horizon_of_load_stops_the_machine_on_the_path_before_it() {
    for (mode, bad, expected) in
        [("FALSE", "G01 Z500\n", "D3"), ("TRUE", "G01 X30 A5\n", "A must be 0"), ("FALSE", "G01 X1e308\n", "late.cnc:3003:")]
    {
        let mut bench = Bench::ready("late");
        let mut text = String::from("G90\nG00 X0 Y0 Z30 A0 B0 C0\nM08\n");
        for i in 0..2999 {
            text.push_str(&format!("G01 X{:.3} F20\n", f64::from(i + 1) * 0.02));
        }
        bench.file("late.cnc", text + bad + "G01 X0\nM30\n");
        bench.set("GVL.NcFile", "'late.cnc'");
        bench.set("GVL.PartSpaceMode", mode);
        bench.start();
        let mut rows = Vec::new();
        while bench.state() == "Running" {
            bench.step();
            rows.push(bench.row());
        }
        while bench.number("GVL.Sts.Running") != 0.0 {
            bench.step();
            rows.push(bench.row());
        }
        let text = bench.text("GVL.ErrorText");
        assert!(bench.state() == "Faulted" && text.contains(expected) && text.starts_with("late.cnc:3003"), "{text}");
        assert!(rows.iter().all(|r| r.tcp[2] < 30.001 && r.tcp[0] < 60.0), "it has gone on");
        check_axis_limits(&bench, &rows);
        bench.run(0.1);
        assert!(!bench.row().valve);
        recover(&mut bench);
    }
}

#[test]
fn a_million_lines_start_at_once() {
    let mut bench = Bench::ready("long");
    let mut text = String::from("G90\nG00 X0 Y0 Z30 A0 B0 C0\nF60\n");
    for i in 0..1_000_000 {
        let (x, y) = (f64::from(i % 800) * 0.05, f64::from(i / 800) * 0.05);
        let x = if i / 800 % 2 == 0 { x } else { 40.0 - x };
        text.push_str(&format!("G01 X{x:.3} Y{y:.3}\n"));
    }
    bench.file("long.cnc", text);
    bench.set("GVL.NcFile", "'long.cnc'");
    let before = bench.machine.elapsed();
    bench.press("Load");
    bench.wait_for("Loaded", 1.0);
    let loaded = bench.machine.elapsed().seconds() - before.seconds();
    println!("loaded after {loaded} s");
    assert!(loaded <= 0.3, "{loaded} s");
    bench.press("Start");
    bench.wait_for("Running", 30.0);
    bench.run(20.0);
    assert_eq!(bench.state(), "Running", "{}", bench.text("GVL.ErrorText"));
    assert!(bench.number("GVL.Follow.PathLength") > 700.0, "{} mm", bench.number("GVL.Follow.PathLength"));
    bench.press("Stop");
    bench.wait_for("Ready", 5.0);
}

#[test]
fn arcs_rapids_dwells_and_marks_take_effect_at_their_place() {
    for mode in ["FALSE", "TRUE"] {
        let mut bench = Bench::ready("words");
        // a half circle of 20 mm about X30 Y0, a line with M08 in its middle, a dwell, a rapid back, a turn on the spot
        bench.file(
            "words.cnc",
            "G90 G98 G17\nG00 X10 Y0 Z30 A0 B0 C0\nG02 X50 Y0 I30 J0 F40\nG01 X50 Y-10\nM08\nG01 X50 Y-50\nM09\nG04 T0.5\nG00 X10 Y0\nG01 C40 B10 F30\nM30\n",
        );
        bench.set("GVL.NcFile", "'words.cnc'");
        bench.set("GVL.PartSpaceMode", mode);
        let rows = bench.job();
        check_axis_limits(&bench, &rows);
        let arc: Vec<_> = rows.iter().filter(|r| r.tcp[1] > 0.1 && r.path < 62.0).collect();
        assert!(arc.len() > 1000);
        for row in arc {
            let radius = distance(row.tcp, [30.0, 0.0, 30.0]);
            assert!((radius - 20.0).abs() < 0.002, "{radius} mm from the centre");
        }
        let start = rows.iter().position(|r| r.dots == 1).expect("dots");
        assert!(distance(rows[start].tcp, [50.0, -10.0, 30.0]) <= 0.041, "{:?}", rows[start].tcp);
        assert!((rows[start].speed - 40.0).abs() < 0.3, "M08 stops nothing: {} mm/s", rows[start].speed);
        assert_eq!(dots(&rows).len(), 25, "40 mm of dots");
        let rest = rows.iter().filter(|r| distance(r.tcp, [50.0, -50.0, 30.0]) < 1e-6).count();
        assert!((500..530).contains(&rest), "{rest} ms at the dwell");
        let last = rows.last().expect("rows");
        assert!(distance(last.tcp, [10.0, 0.0, 30.0]) < 1e-6 && (last.axes[0] + 40.0).abs() < 1e-6 && (last.axes[1] + 10.0).abs() < 1e-6);
    }
}

#[test]
fn the_valve_never_fires_faster_than_it_can() {
    let mut bench = Bench::ready("fast");
    bench.file("fast.cnc", "G00 X0 Y0 Z30 A0 B0 C0\nM08\nG01 Y60 F95\nM09\nM30\n");
    bench.set("GVL.NcFile", "'fast.cnc'");
    bench.set("GVL.Par.DotPitch", "1.0");
    let rows = bench.job();
    let times: Vec<usize> = rows.windows(2).enumerate().filter(|(_, w)| w[1].dots > w[0].dots).map(|(i, _)| i).collect();
    assert!(times.len() > 25 && times.windows(2).all(|w| w[1] - w[0] >= 20), "{times:?}");
}

#[test]
fn a_job_that_begins_at_the_origin_dispenses_its_first_move() {
    let mut bench = Bench::ready("origin");
    bench.file("origin.cnc", "G0 X0 Y0 Z0\nM08\nG1 X10 F20\nG1 Y10\nM09\nM30\n");
    bench.set("GVL.NcFile", "'origin.cnc'");
    let rows = bench.job();
    assert_eq!(dots(&rows).len(), 13);
    assert!((bench.number("GVL.JobTime") - 1.3).abs() < 0.01);
}

#[test]
fn what_an_operator_types_while_the_job_runs_is_held_to_its_range() {
    let mut bench = Bench::ready("typed");
    bench.start();
    bench.run(6.0);
    bench.set("GVL.Par.DotPitch", "0.0");
    bench.set("GVL.Par.Override", "0.0");
    bench.set("GVL.Par.L3", "90.0");
    let (before, place) = (bench.number("GVL.DotCount"), bench.number("GVL.Sts.PathLength"));
    bench.run(10.0);
    assert!(bench.number("GVL.Sts.PathLength") > place, "the machine stands still");
    assert!(bench.number("GVL.DotCount") - before < 10.0 * 20.0 / 0.1);
    assert_eq!((bench.state(), bench.text("GVL.ErrorText").as_str()), ("Running", ""));
}

#[test]
fn an_axis_that_would_be_too_fast_slows_its_run_down() {
    let mut bench = Bench::ready("slow");
    bench.file("slow.cnc", "G00 X0 Y0 Z30 A0 B0 C0\nG01 X3 Y3 C170 F50\nM30\n");
    bench.set("GVL.NcFile", "'slow.cnc'");
    let rows = bench.job();
    check_axis_limits(&bench, &rows);
    assert!(bench.number("GVL.Sts.SlowedBy") < 1.0);
}

#[test]
fn buttons_move_axes_and_stop_them_in_every_state() {
    let mut bench = Bench::new("buttons");
    bench.run(0.1);
    bench.press("ControlOn");
    bench.wait_for("Standby", 5.0);
    bench.press("HomeAll");
    bench.run(1.0);
    bench.press("Stop");
    bench.wait_for("Standby", 2.0);
    bench.press("HomeAll");
    bench.wait_for("Ready", 120.0);
    let before = bench.row().axes[2];
    bench.set("GVL.Cmd.JogPlus[3]", "TRUE");
    bench.run(0.5);
    assert_eq!(bench.state(), "Jogging");
    bench.set("GVL.Cmd.JogPlus[3]", "FALSE");
    bench.wait_for("Ready", 2.0);
    assert!(bench.row().axes[2] > before + 5.0);
    bench.press("Load");
    bench.wait_for("Loaded", 2.0);
    bench.press("Start");
    bench.wait_for("Approaching", 1.0);
    bench.press("Stop");
    bench.wait_for("Ready", 5.0);
    bench.start();
    bench.run(5.0);
    bench.press("Pause");
    bench.wait_for("Paused", 1.0);
    let still = bench.row().tcp;
    bench.run(1.0);
    assert_eq!(still, bench.row().tcp);
    bench.press("Stop");
    bench.wait_for("Ready", 1.0);
    bench.press("ControlOff");
    bench.wait_for("Off", 1.0);
    bench.run(1.0);
    bench.press("ControlOn");
    bench.wait_for("Ready", 5.0);
    assert_eq!(bench.text("GVL.ErrorText"), "");
}
