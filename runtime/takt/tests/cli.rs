//! The command line as scripts see it (DESIGN §9): exit codes, what goes to which stream, JSON.

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A folder with one program that counts, one that is wrong, one that divides by zero, and a manifest that is wrong.
fn folder(test: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("takt-cli-{test}-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("bad/src")).unwrap();
    std::fs::write(
        folder.join("good.st"),
        "PROGRAM p VAR x : INT; r : LREAL; t : TIME := T#5s; END_VAR x := x + 1; r := 2.0 * r; t := t + T#0s; END_PROGRAM",
    )
    .unwrap();
    std::fs::write(folder.join("wrong.st"), "PROGRAM p VAR x : INT; END_VAR\nx := 'text';\ny := 1;\nEND_PROGRAM").unwrap();
    std::fs::write(folder.join("fault.st"), "PROGRAM p VAR x, y : INT; END_VAR\nx := x / y;\nEND_PROGRAM").unwrap();
    std::fs::write(folder.join("bad/takt.toml"), "[project]\nstrct = true\n").unwrap();
    folder
}

fn takt(folder: &PathBuf, arguments: &[&str]) -> (i32, String, String) {
    let Output { status, stdout, stderr } =
        Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).current_dir(folder).env("LC_ALL", "C").output().unwrap();
    (status.code().unwrap(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[track_caller]
fn check(folder: &PathBuf, arguments: &[&str], code: i32, out: &str, err: &str) {
    let (found, stdout, stderr) = takt(folder, arguments);
    assert_eq!(found, code, "{arguments:?}\n{stdout}\n{stderr}");
    assert!(stdout.contains(out) && (!out.is_empty() || stdout.is_empty()), "{arguments:?} wrote {stdout:?}");
    assert!(stderr.contains(err), "{arguments:?} said {stderr:?}");
    assert!(!stderr.contains('\x1b') && !stdout.contains('\x1b'), "no colours outside a terminal");
}

#[test]
fn exit_codes_and_streams_keep_the_contract() {
    let folder = folder("codes");
    check(&folder, &["run", "good.st", "--cycles", "3", "--print", "p.x"], 0, "p.x = 3\n", "Scans");
    check(&folder, &["run", "good.st", "--until", "p.x >= 5", "--print", "p.x"], 0, "p.x = 5\n", "");
    check(&folder, &["run", "good.st", "--for", "100ms", "--set", "p.x=10", "--print", "p.x"], 0, "p.x = 20\n", "");
    check(&folder, &["check", "good.st"], 0, "", "no findings");
    check(&folder, &["run", "wrong.st", "--cycles", "1"], 1, "", "wrong.st:2");
    check(&folder, &["run", "fault.st", "--cycles", "1"], 1, "", "integer division by zero at fault.st:2");
    check(&folder, &["check", "wrong.st"], 1, "", "2 errors");
    check(&folder, &["run", "none.st", "--cycles", "1"], 2, "", "none.st does not exist");
    check(&folder, &["run", "bad", "--cycles", "1"], 2, "", "did you mean `strict`?");
    check(&folder, &["run", "good.st", "--cycles", "1", "--print", "p.xx"], 2, "", "did you mean `x`?");
    check(&folder, &["run", "good.st", "--until", "p.xx"], 2, "", "E0204");
    check(&folder, &["run", "good.st", "--set", "p.x=70000", "--cycles", "1"], 2, "", "outside the range");
    check(&folder, &["run", "good.st", "--cycles", "1", "--plot", "a.svg"], 2, "", "[plot]");
    check(&folder, &["rum"], 2, "", "run");
    check(&folder, &["explain", "E0301"], 0, "E0301", "");
    check(&folder, &["explain", "E301"], 2, "", "did you mean E0301?");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn json_is_one_object_and_the_trace_a_table() {
    let folder = folder("json");
    let arguments =
        ["run", "good.st", "--cycles", "2", "--json", "--print", "p.x", "--print", "p.t", "--trace", "t.csv", "--record", "p.x,p.r"];
    let (code, stdout, _) = takt(&folder, &arguments);
    let json: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(
        (code, &json["schema"], &json["cycles"], &json["time_ns"], &json["fault"]),
        (0, &1.into(), &2.into(), &20_000_000.into(), &Value::Null)
    );
    assert_eq!((&json["values"]["p.x"], &json["values"]["p.t"]), (&2.into(), &"T#5s".into()));
    assert!(["mean", "p50", "p99", "max"].iter().all(|key| json["scan_ns"][*key].is_number()));
    assert_eq!(std::fs::read_to_string(folder.join("t.csv")).unwrap(), "time_s,p.x,p.r\n0,1,0.0\n0.01,2,0.0\n");
    let (code, stdout, _) = takt(&folder, &["run", "fault.st", "--cycles", "2", "--json"]);
    let fault = &serde_json::from_str::<Value>(&stdout).unwrap()["fault"];
    assert_eq!((code, &fault["code"], &fault["file"], &fault["line"]), (1, &"division-by-zero".into(), &"fault.st".into(), &2.into()));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn findings_are_one_json_object_per_line() {
    let folder = folder("findings");
    let (code, stdout, _) = takt(&folder, &["check", "wrong.st", "--format", "json"]);
    let findings: Vec<Value> = stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let places: Vec<_> =
        findings.iter().map(|f| (f["code"].as_str().unwrap(), f["line"].as_u64().unwrap(), f["column"].as_u64().unwrap())).collect();
    assert_eq!((code, places), (1, vec![("E0301", 2, 6), ("E0201", 3, 1)]));
    std::fs::remove_dir_all(folder).unwrap();
}
