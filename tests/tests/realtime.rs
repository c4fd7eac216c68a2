//! The machine on the wall clock: what its thread must not do is counted, not timed.

use clap::Parser;
use serde_json::Value;
use std::path::PathBuf;
use takt::commands::{self, Cli};
use takt::realtime::guard::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs the tool on a thread with its stack, as the process does.
fn takt(arguments: &[&str]) -> commands::Exit {
    let cli = Cli::try_parse_from(["takt"].iter().chain(arguments)).unwrap();
    let thread = std::thread::Builder::new().stack_size(takt::machine::NATIVE_STACK + (16 << 20));
    thread.spawn(move || commands::execute(cli)).unwrap().join().unwrap()
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("takt-realtime-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs a project in real time with a trace; what the statistics say.
fn statistics(name: &str, path: &str, seconds: &str, record: &str) -> Value {
    let folder = folder(name);
    let [stats, trace, state] = ["stats.json", "trace.csv", "state"].map(|file| folder.join(file).to_str().unwrap().to_string());
    takt(&[
        "run", path, "--speed", "real", "--for", seconds, "--state", &state, "--trace", &trace, "--record", record, "--stats", &stats,
        "--json",
    ]);
    let found: Value = serde_json::from_str(&std::fs::read_to_string(&stats).unwrap()).unwrap();
    let rows = std::fs::read_to_string(&trace).unwrap().lines().count() as u64 - 1;
    let seen = rows + found["thread"]["samples_lost"].as_u64().unwrap();
    let cycles = found["tasks"][0]["cycles"].as_u64().unwrap();
    // After a fault the bus goes on alone, without scans.
    let stopped = found["tasks"][0]["state"] == "stopped";
    assert!(seen == cycles || stopped && seen < cycles, "one row per scan of the fastest task: {seen}, {cycles}");
    std::fs::remove_dir_all(folder).unwrap();
    found
}

/// Power on, homing, decoding: all tasks of the dispenser, its operator, its file requests.
#[test]
fn the_resource_thread_allocates_nothing_and_maps_no_page_after_start() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../programs/five-axis-dispenser");
    let found = statistics("dispenser", path, "6s", "GVL.Theta1.fActPosition,GVL.Sts.State");
    let thread = &found["thread"];
    assert!(found["tasks"][1]["cycles"].as_u64().unwrap() > 100, "{found}");
    assert_eq!(thread["allocations"], 0, "{thread}");
    if cfg!(target_os = "linux") {
        assert_eq!((&thread["minor_faults"], &thread["major_faults"]), (&Value::from(0), &Value::from(0)), "{thread}");
    }
}

/// The slow task never ends its loop before the watchdog does; the fast one goes on until then.
#[test]
fn an_endless_loop_is_cut_by_the_watchdog() {
    let folder = folder("endless");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    std::fs::write(folder.join("takt.toml"), "[task.Slow]\nwatchdog = \"50ms\"\n").unwrap();
    let program = "PROGRAM Fast VAR n : INT; END_VAR n := n + 1; END_PROGRAM
PROGRAM Slow VAR n, bad : INT; END_VAR
n := n + 1;
WHILE n > 3 DO bad := bad + 1; END_WHILE
END_PROGRAM
CONFIGURATION C RESOURCE R ON CPU
TASK Fast(INTERVAL := T#1ms, PRIORITY := 0);
TASK Slow(INTERVAL := T#10ms, PRIORITY := 5);
PROGRAM a WITH Fast : Fast; PROGRAM b WITH Slow : Slow;
END_RESOURCE END_CONFIGURATION";
    std::fs::write(folder.join("src/main.st"), program).unwrap();
    let found = statistics("endless-run", folder.to_str().unwrap(), "1s", "Fast.n");
    let slow = &found["tasks"][1];
    assert_eq!((&slow["state"], &slow["cycles"]), (&Value::from("fault"), &Value::from(4)), "{found}");
    assert!(slow["scan_ns"]["max"].as_u64().unwrap() >= 50_000_000, "its own time counts: {slow}");
    assert_eq!(found["tasks"][0]["state"], "stopped");
    std::fs::remove_dir_all(folder).unwrap();
}
