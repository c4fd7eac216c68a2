//! Retained variables as a machine keeps them: killed at random instants, moved to another program, exported and imported.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use takt::retain::{Generation, slot};

const MANIFEST: &str = "[project]\nname = \"Killed\"\n[retain]\ninterval = \"1ms\"\n";

/// Two tasks change values that belong together; a snapshot in the middle of a scan would tell them apart.
const PROGRAM: &str = "CONFIGURATION c RESOURCE r ON cpu
TASK fast(INTERVAL := T#1ms, PRIORITY := 0);
TASK slow(INTERVAL := T#2ms, PRIORITY := 5);
PROGRAM f WITH fast : quick;
PROGRAM s WITH slow : lazy;
END_RESOURCE END_CONFIGURATION
VAR_GLOBAL RETAIN first : ULINT; bulk : ARRAY [1..2000] OF ULINT; last : ULINT; ticks : ULINT; again : ULINT; END_VAR
PROGRAM quick
ticks := ticks + 1;
again := again + 1;
END_PROGRAM
PROGRAM lazy
VAR i : INT; END_VAR
first := first + 1;
FOR i := 1 TO 2000 DO bulk[i] := first; END_FOR
last := last + 1;
END_PROGRAM
";

fn folder(name: &str, manifest: &str, program: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("takt-kept-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("src")).unwrap();
    std::fs::write(folder.join("takt.toml"), manifest).unwrap();
    std::fs::write(folder.join("src/GVL.st"), program).unwrap();
    folder
}

fn takt(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.args(arguments).current_dir(folder).env("LC_ALL", "C");
    command
}

fn output(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let Output { status, stdout, stderr } = takt(folder, arguments).output().unwrap();
    (status.code().unwrap_or(-1), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[track_caller]
fn check(folder: &Path, arguments: &[&str], code: i32, out: &str, err: &str) {
    let (found, stdout, stderr) = output(folder, arguments);
    assert_eq!(found, code, "{arguments:?}\n{stdout}\n{stderr}");
    assert!(stdout.contains(out), "{arguments:?} wrote {stdout}");
    assert!(stderr.contains(err), "{arguments:?} said {stderr}");
}

fn newest(folder: &Path) -> Option<Generation> {
    let loaded = slot::load(&folder.join(".takt")).unwrap_or_else(|error| panic!("{error}"));
    loaded.newest.map(|(generation, _)| generation)
}

/// Whether a generation behind that number was begun; the files may be half written just now.
fn is_newer(folder: &Path, number: u64) -> bool {
    let files = slot::FILES.iter().filter_map(|name| std::fs::read(folder.join(".takt").join(name)).ok());
    let numbers = files.filter_map(|bytes| Some(u64::from_le_bytes(bytes.get(24..32)?.try_into().ok()?)));
    numbers.max().is_some_and(|found| found > number)
}

fn number(generation: &Generation, path: &str) -> u64 {
    let place = generation.description.places.iter().position(|p| p.path.ends_with(path)).unwrap();
    u64::from_le_bytes(generation.value(place)[..8].try_into().unwrap())
}

/// Kills runs at instants from a sequence; each goes on from whole values, and none goes back behind the last but one.
fn killed(name: &str, times: u32) {
    let folder = folder(name, MANIFEST, PROGRAM);
    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    let mut before = (0, 0, 0);
    let mut wrote = 0;
    for time in 0..times {
        let started = Instant::now();
        let mut run: Child = takt(&folder, &["run", "."]).stdout(Stdio::null()).stderr(Stdio::null()).stdin(Stdio::null()).spawn().unwrap();
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        // By turns at any instant, perhaps before the program runs, and while it writes.
        let instant = Duration::from_micros(random >> 33 & 0x3_ffff);
        if time % 2 == 0 {
            std::thread::sleep(instant.saturating_sub(started.elapsed()));
        } else {
            while !is_newer(&folder, before.0) && started.elapsed() < Duration::from_secs(60) {
                std::thread::yield_now();
            }
            std::thread::sleep(instant / 8);
        }
        run.kill().unwrap();
        run.wait().unwrap();
        let Some(generation) = newest(&folder) else { continue };
        let value = |path: &str| number(&generation, path);
        assert_eq!(value("first"), value("last"), "time {time}: torn between the ends of a scan");
        assert_eq!(value("ticks"), value("again"), "time {time}");
        let place = generation.description.places.iter().position(|p| p.path.ends_with("bulk")).unwrap();
        assert!(generation.value(place).chunks(8).all(|c| c == value("first").to_le_bytes()), "time {time}: torn inside");
        let now = (generation.number, value("first"), value("ticks"));
        assert!(now.0 >= before.0 && now.1 >= before.1 && now.2 >= before.2, "time {time}: {before:?} became {now:?}");
        wrote += u32::from(now.0 > before.0);
        before = now;
    }
    assert!(wrote > times / 4, "{wrote} of {times} runs lived long enough to write");
    eprintln!("{times} kills, {wrote} runs wrote, {} generations, {} scans of the fast task kept", before.0, before.2);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_machine_that_is_killed_goes_on_from_whole_values() {
    killed("killed", 24);
}

#[test]
#[ignore = "minutes; cargo test -p takt --test retain -- --ignored"]
fn a_machine_that_is_killed_a_thousand_times_goes_on_from_whole_values() {
    killed("thousand", 1000);
}

const COUNT: &str = "VAR_GLOBAL RETAIN n : INT; END_VAR VAR_GLOBAL PERSISTENT p : DINT; END_VAR
PROGRAM main VAR plain : INT; END_VAR n := n + 1; p := p + 1; plain := plain + 1; END_PROGRAM";

#[test]
fn starts_are_warm_cold_and_origin() {
    let folder = folder("starts", "", COUNT);
    let run = |more: &[&str]| {
        let arguments = ["run", ".", "--state", "kept", "--cycles", "3", "--print", "n", "--print", "p", "--print", "main.plain"];
        let (code, stdout, stderr) = output(&folder, &[&arguments, more].concat());
        assert_eq!(code, 0, "{stderr}");
        stdout.replace('\n', " ")
    };
    assert_eq!(run(&[]), "n = 3 p = 3 main.plain = 3 ");
    assert_eq!(run(&[]), "n = 6 p = 6 main.plain = 3 ");
    assert_eq!(run(&["--engine", "interp"]), "n = 9 p = 9 main.plain = 3 ");
    assert_eq!(run(&["--cold"]), "n = 3 p = 12 main.plain = 3 ");
    assert_eq!(run(&["--origin"]), "n = 3 p = 3 main.plain = 3 ");
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "1", "--cold", "--origin"], 2, "", "cannot be used with");
    check(&folder, &["run", ".", "--cycles", "3", "--print", "n"], 0, "n = 3\n", "");
    assert!(!folder.join(".takt").exists(), "in virtual time there is no state unless it is asked for");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_fault_leaves_the_last_whole_values() {
    let program = "VAR_GLOBAL RETAIN a, b : INT; END_VAR PROGRAM main VAR x : INT := 5; END_VAR a := a + 1; x := 10 / (x - 1); b := b + 1; x := 6 - a; END_PROGRAM";
    let folder = folder("fault", "[retain]\ninterval = \"1ms\"\n", program);
    check(&folder, &["run", ".", "--state", ".takt", "--cycles", "9"], 1, "", "division by zero");
    let generation = newest(&folder).unwrap();
    let value = |i: usize| i16::from_le_bytes(generation.value(i).try_into().unwrap());
    assert_eq!(value(0), value(1), "not the half-changed ones of the scan that faulted");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn values_are_shown_exported_corrected_and_imported() {
    let folder = folder("json", "", COUNT);
    check(&folder, &["retain", "show", ".", "--state", "kept"], 2, "", "no retained values");
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "300"], 0, "", "");
    check(&folder, &["retain", "show", ".", "--state", "kept"], 0, "GVL.n : INT := 300; // RETAIN\n", "");
    check(&folder, &["retain", "export", ".", "values.json", "--state", "kept"], 0, "", "");
    let text = std::fs::read_to_string(folder.join("values.json")).unwrap();
    std::fs::write(folder.join("src/GVL.st"), COUNT.replace("n : INT", "n : SINT")).unwrap();
    let run = ["run", ".", "--state", "kept", "--cycles", "1", "--print", "n", "--print", "p"];
    check(&folder, &run, 2, "", "GVL.n: 300 is no value of `SINT`");
    check(&folder, &["retain", "show", ".", "--state", "kept"], 0, "GVL.n : INT := 300", "");
    let import = ["retain", "import", ".", "values.json", "--state", "kept"];
    check(&folder, &import, 2, "", "GVL.n: it is `SINT` in this program, the file says `INT`");
    let with = |from: &str, to: &str| std::fs::write(folder.join("values.json"), text.replace(from, to)).unwrap();
    with("\"INT\",\n      \"value\": \"300\"", "\"SINT\",\n      \"value\": \"300\"");
    check(&folder, &import, 2, "", "GVL.n: `300` is outside the range of `SINT`");
    with("GVL.n", "GVL.gone");
    check(
        &folder,
        &import,
        2,
        "",
        "GVL.n: the stored value does not go with the program (300 is no value of `SINT`), and the file has none",
    );
    check(&folder, &["retain", "show", ".", "--state", "kept"], 0, "GVL.n : INT := 300", "");
    with("\"INT\",\n      \"value\": \"300\"", "\"SINT\",\n      \"value\": \"-7\"");
    check(&folder, &import, 0, "", "2 values imported");
    check(&folder, &run, 0, "n = -6\np = 301\n", "");
    for (bad, message) in [
        ("{", "EOF"),
        ("{\"schema\":1,\"project\":\"\",\"saved\":\"\",\"generation\":0,\"values\":[{}]}", "missing field"),
        ("[]", "invalid"),
    ] {
        std::fs::write(folder.join("values.json"), bad).unwrap();
        check(&folder, &import, 2, "", message);
    }
    with("\"schema\": 1", "\"schema\": 2");
    check(&folder, &import, 2, "", "its form has version 2");
    check(&folder, &["retain", "import", "."], 2, "", "needs the file");
    check(&folder, &run, 0, "n = -5\np = 302\n", "");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_is_gone_is_put_aside_and_can_come_back() {
    let folder = folder("aside", "", COUNT);
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "5"], 0, "", "");
    std::fs::write(folder.join("src/GVL.st"), COUNT.replace("RETAIN n", "RETAIN m").replace("n := n", "m := m")).unwrap();
    check(
        &folder,
        &["run", ".", "--state", "kept", "--cycles", "1", "--print", "m"],
        0,
        "m = 1\n",
        "start with their initial values: GVL.m",
    );
    let aside =
        std::fs::read_dir(folder.join("kept")).unwrap().map(|e| e.unwrap().path()).find(|p| p.extension().is_some_and(|e| e == "json"));
    let text = std::fs::read_to_string(aside.expect("a file with what is gone")).unwrap();
    assert!(text.contains("\"GVL.n\"") && text.contains("\"value\": \"5\""), "{text}");
    std::fs::write(folder.join("back.json"), text.replace("GVL.n", "GVL.m")).unwrap();
    check(&folder, &["retain", "import", ".", "back.json", "--state", "kept"], 0, "", "2 values imported");
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "1", "--print", "m"], 0, "m = 6\n", "");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn damaged_files_stop_the_start_and_stay() {
    let folder = folder("damaged", "", COUNT);
    let run = ["run", ".", "--state", "kept", "--cycles", "5", "--print", "n"];
    check(&folder, &run, 0, "n = 5\n", "");
    check(&folder, &run, 0, "n = 10\n", "");
    let generation = |file: &str| slot::read(&std::fs::read(folder.join("kept").join(file)).unwrap()).unwrap().number;
    let (zero, one) = (generation("retain.0"), generation("retain.1"));
    let newest = folder.join(if zero > one { "kept/retain.0" } else { "kept/retain.1" });
    let whole = std::fs::read(&newest).unwrap();
    std::fs::write(&newest, &whole[..whole.len() - 1]).unwrap();
    let (code, stdout, stderr) = output(&folder, &run);
    assert!(code == 0 && stdout.starts_with("n = ") && stderr.contains("was cut off"), "{stdout}{stderr}");
    for name in ["retain.0", "retain.1"] {
        std::fs::write(folder.join("kept").join(name), "garbage").unwrap();
    }
    check(&folder, &run, 2, "", "it is no file with retained values");
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "5", "--cold"], 2, "", "move these files away");
    assert_eq!(std::fs::read_to_string(folder.join("kept/retain.0")).unwrap(), "garbage");
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "5", "--origin"], 0, "", "");
    assert_eq!(std::fs::read_to_string(folder.join("kept/retain.0.unreadable")).unwrap(), "garbage");
    check(&folder, &run, 0, "n = 10\n", "");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn two_runs_never_share_a_folder() {
    let folder = folder("two", "", COUNT);
    let mut first = takt(&folder, &["run", ".", "--state", "kept"]).stderr(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while !folder.join("kept/retain.0").exists() && started.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "1"], 2, "", "belongs to a run that is under way (process");
    check(&folder, &["retain", "show", ".", "--state", "kept"], 0, "GVL.n : INT", "");
    let (code, _, stderr) = output(&folder, &["retain", "import", ".", "takt.toml", "--state", "kept"]);
    assert!(code == 2, "{stderr}");
    first.kill().unwrap();
    first.wait().unwrap();
    check(&folder, &["run", ".", "--state", "kept", "--cycles", "1"], 0, "", "");
    std::fs::remove_dir_all(folder).unwrap();
}
