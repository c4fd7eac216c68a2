//! The control socket of a machine that runs, from outside: the protocol as docs/control.md has it, clients that vanish, clients that are hostile.
#![cfg(unix)]

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = "
VAR_GLOBAL
  Speed : LREAL := 1.5;
  Level : INT(0..100) := 5;
  Name : STRING := 'abc';
  Go : BOOL;
  Delay : TIME := T#1s;
  Crash : BOOL;
  A, B : DINT;
  Many : ARRAY[0..999] OF LREAL;
END_VAR
VAR_GLOBAL CONSTANT Limit : INT := 7; END_VAR
TYPE RECIPE : STRUCT Speed : LREAL := 2.5; END_STRUCT END_TYPE
VAR_GLOBAL PERSISTENT Recipe : RECIPE; END_VAR
PROGRAM PLC_PRG
VAR n : DINT; z : INT; END_VAR
n := n + 1;
A := n; B := n;
Many[n MOD 1000] := n;
IF Crash THEN Crash := FALSE; z := 1 / z; END_IF
END_PROGRAM
CONFIGURATION c
RESOURCE r ON x
TASK Fast(INTERVAL := T#1ms, PRIORITY := 0);
PROGRAM p WITH Fast : PLC_PRG;
END_RESOURCE
END_CONFIGURATION
";

/// A machine that runs in a process of its own.
struct Machine {
    folder: PathBuf,
    child: Option<Child>,
}

impl Machine {
    fn start(test: &str) -> Self {
        Self::start_with(test, &[])
    }
    fn start_with(test: &str, more: &[&str]) -> Self {
        let folder = std::env::temp_dir().join(format!("takt-control-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("src")).unwrap();
        std::fs::write(folder.join("takt.toml"), "[project]\nname = \"pump\"\n").unwrap();
        std::fs::write(folder.join("src/GVL.st"), PROGRAM).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command.args(["run", ".", "--speed", "real"]).args(more).current_dir(&folder).env("LC_ALL", "C");
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut machine = Self { folder, child: Some(child) };
        let start = Instant::now();
        while UnixStream::connect(machine.socket()).is_err() {
            assert!(start.elapsed() < Duration::from_secs(60), "no socket: {:?}", machine.child.as_mut().unwrap().try_wait());
            std::thread::sleep(Duration::from_millis(20));
        }
        machine
    }
    fn socket(&self) -> PathBuf {
        self.folder.join(".takt/control.sock")
    }
    fn connect(&self) -> Client {
        let mut client = Client::new(UnixStream::connect(self.socket()).unwrap());
        client.good(json!({ "request": "hello", "version": 1 }));
        client
    }
    fn armed(&self) -> Client {
        let mut client = self.connect();
        client.good(json!({ "request": "arm", "name": "anna", "reason": "a test" }));
        client
    }
    fn takt(&self, arguments: &[&str]) -> (i32, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command.args(arguments).current_dir(&self.folder).env("LC_ALL", "C").env_remove("TAKT_REASON").env_remove("TAKT_AS");
        let Output { status, stdout, stderr } = command.output().unwrap();
        (status.code().unwrap_or(-1), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
    }
    /// Lines of the journal about an event.
    fn journal(&self, event: &str) -> Vec<Value> {
        let (code, out, err) = self.takt(&["log", "-n", "0", "--json"]);
        assert_eq!(code, 0, "{err}");
        let lines = out.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        lines.filter(|line| line["event"] == event).collect()
    }
    /// Waits until something holds.
    #[track_caller]
    fn wait(&self, what: &str, mut holds: impl FnMut() -> bool) {
        let start = Instant::now();
        while !holds() {
            assert!(start.elapsed() < Duration::from_secs(20), "{what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    /// Ends the run and returns its exit code and what it said.
    fn stop(&mut self) -> (i32, String) {
        self.armed().good(json!({ "request": "stop" }));
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        (output.status.code().unwrap_or(-1), String::from_utf8(output.stderr).unwrap())
    }
    /// Bytes of memory of the process.
    fn memory(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.child.as_ref().unwrap().id())).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
        line.trim().trim_end_matches("kB").trim().parse::<u64>().unwrap() << 10
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

struct Client {
    reader: BufReader<UnixStream>,
    next: u64,
}

impl Client {
    fn new(stream: UnixStream) -> Self {
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.set_write_timeout(Some(Duration::from_secs(20))).unwrap();
        Self { reader: BufReader::new(stream), next: 0 }
    }
    fn send(&mut self, line: &[u8]) -> std::io::Result<()> {
        self.reader.get_mut().write_all(line)?;
        self.reader.get_mut().write_all(b"\n")
    }
    /// The next line; `None` when the machine has ended the connection.
    fn line(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => None,
            Ok(_) => Some(serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"))),
            Err(error) if matches!(error.kind(), std::io::ErrorKind::ConnectionReset | std::io::ErrorKind::BrokenPipe) => None,
            Err(error) => panic!("{error}"),
        }
    }
    fn ask(&mut self, mut request: Value) -> Value {
        self.next += 1;
        request["id"] = self.next.into();
        self.send(request.to_string().as_bytes()).unwrap();
        loop {
            let answer = self.line().expect("an answer");
            if answer["id"] == self.next {
                return answer;
            }
        }
    }
    #[track_caller]
    fn good(&mut self, request: Value) -> Value {
        let answer = self.ask(request.clone());
        assert!(answer.get("error").is_none(), "{request}: {answer}");
        answer["result"].clone()
    }
    #[track_caller]
    fn refused(&mut self, request: Value, code: &str, part: &str) {
        let answer = self.ask(request.clone());
        let error = &answer["error"];
        assert!(error["code"] == code && error["message"].as_str().is_some_and(|text| text.contains(part)), "{request}: {answer}");
    }
    fn read(&mut self, variable: &str) -> Value {
        self.good(json!({ "request": "read", "variables": [variable] }))["values"][variable].clone()
    }
}

fn force(variable: &str, value: Value) -> Value {
    json!({ "request": "force", "variables": [{ "variable": variable, "value": value }] })
}

#[test]
fn the_page_is_true() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/control.md")).unwrap();
    let mut machine = Machine::start("page");
    let mut client = Client::new(UnixStream::connect(machine.socket()).unwrap());
    let blocks: Vec<&str> = page.split("```json\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let lines: Vec<Value> = blocks.iter().flat_map(|block| block.lines()).map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.len() >= 40 && lines.len().is_multiple_of(2), "{}", lines.len());
    for pair in lines.chunks(2) {
        client.send(pair[0].to_string().as_bytes()).unwrap();
        let answer = loop {
            let line = client.line().expect("an answer");
            if line.get("subscription").is_none() {
                break line;
            }
        };
        let keys = |value: &Value| value.as_object().map(|object| object.keys().cloned().collect::<Vec<_>>());
        assert_eq!((&answer["id"], keys(&answer)), (&pair[1]["id"], keys(&pair[1])), "{} gave {answer}", pair[0]);
        assert_eq!(keys(&answer["result"]), keys(&pair[1]["result"]), "{} gave {answer}", pair[0]);
        for same in ["error", "values", "parameters", "done", "forces", "before", "held", "released"] {
            let part = |value: &Value| if same == "error" { value[same].clone() } else { value["result"][same].clone() };
            assert_eq!(part(&answer), part(&pair[1]), "{} gave {answer}", pair[0]);
        }
    }
    drop(client);
    let (code, said) = machine.stop();
    assert_eq!(code, 0, "{said}");
    assert!(!machine.socket().exists(), "the socket goes with the run");
}

#[test]
fn what_is_asked_for_together_is_of_one_scan() {
    let machine = Machine::start("snapshot");
    let mut client = machine.connect();
    // Pipelined: all requests are sent before the first answer is read.
    for id in 0..60 {
        client.send(json!({ "id": id, "request": "read", "variables": ["A", "PLC_PRG.n", "B"] }).to_string().as_bytes()).unwrap();
    }
    for id in 0..60 {
        let answer = client.line().unwrap();
        let values = &answer["result"]["values"];
        assert!(answer["id"] == id && values["A"] == values["B"] && values["A"] == values["PLC_PRG.n"], "{answer}");
    }
    client.good(json!({ "request": "subscribe", "variables": ["A", "B"], "scans": 1 }));
    let mut before = 0;
    for _ in 0..500 {
        let line = client.line().unwrap();
        let (cycle, a) = (line["cycle"].as_u64().unwrap(), line["values"]["A"].as_u64().unwrap());
        assert!(
            line["values"]["B"] == a && a == cycle && (before == 0 || cycle == before + 1 || line["missed"].as_u64() >= Some(1)),
            "{line}"
        );
        before = cycle;
    }
}

#[test]
fn only_an_armed_client_changes_things_and_every_change_is_in_the_journal() {
    let mut machine = Machine::start("audit");
    let mut client = machine.connect();
    for request in ["write", "force"] {
        client.refused(json!({ "request": request, "variables": [{ "variable": "Level", "value": 7 }] }), "not-armed", "only looks");
    }
    for request in ["pause", "continue", "step", "halt", "reset", "stop", "release-all", "reset-statistics"] {
        client.refused(json!({ "request": request }), "not-armed", "only looks");
    }
    client.refused(json!({ "request": "arm", "name": " ", "reason": "x" }), "out-of-range", "name");
    assert_eq!(client.read("Level"), 5);
    let mut client = machine.armed();
    let write = |variable: &str, value: Value| json!({ "request": "write", "variables": [{ "variable": variable, "value": value }] });
    client.good(write("Level", json!(50)));
    client.good(write("Name", json!("it's $5 \"x\"")));
    assert_eq!((client.read("Level"), client.read("Name")), (json!(50), json!("it's $5 \"x\"")));
    client.refused(write("Level", json!(101)), "bad-value", "0..100");
    client.refused(write("Levle", json!(1)), "unknown-variable", "did you mean `Level`");
    client.refused(write("Limit", json!(1)), "not-writable", "constant");
    client.refused(write("Many", json!(1)), "not-writable", "elementary");
    client.refused(write("Go", json!([])), "bad-value", "no value");
    client.refused(json!({ "request": "release", "variables": ["Go"] }), "refused", "not forced");
    // All or nothing.
    let both = json!([{ "variable": "Level", "value": 1 }, { "variable": "Speed", "value": "fast" }]);
    client.refused(json!({ "request": "write", "variables": both }), "bad-value", "Speed");
    assert_eq!(client.read("Level"), 50);
    client.good(force("Speed", json!(9.5)));
    client.good(json!({ "request": "release", "variables": ["Speed"], "restore": true }));
    client.good(json!({ "request": "reset", "kind": "origin" }));
    drop(client);
    let (code, _) = machine.stop();
    assert_eq!(code, 0);
    let line = &machine.journal("write")[0];
    assert_eq!(
        (&line["variable"], &line["old"], &line["new"], &line["who"], &line["reason"]),
        (&json!("Level"), &json!("5"), &json!("50"), &json!("anna"), &json!("a test"))
    );
    assert!(
        line["from"].as_str().is_some_and(|from| from.contains("user") && from.contains(&format!("process {}", std::process::id()))),
        "{line}"
    );
    assert_eq!(machine.journal("write").len(), 2, "what was refused is not there");
    let released = &machine.journal("release")[0];
    assert_eq!((&released["old"], &released["new"]), (&json!("9.5"), &json!("1.5")));
    for (event, count) in [("force", 1), ("reset", 1), ("arm", 2), ("disarm", 2), ("start", 1), ("stop", 1), ("control", 1)] {
        assert_eq!(machine.journal(event).len(), count, "{event}");
    }
}

#[test]
fn what_a_client_holds_goes_with_it() {
    let machine = Machine::start("lease");
    let mut watcher = machine.connect();
    let mut client = machine.armed();
    let mut held = force("Go", json!(true));
    held["lease_ms"] = 60_000.into();
    client.good(held.clone());
    client.good(json!({ "request": "write", "variables": [{ "variable": "Level", "value": 99 }], "lease_ms": 60_000 }));
    client.good(force("Speed", json!(7.0)));
    assert_eq!((watcher.read("Go"), watcher.read("Level")), (json!(true), json!(99)));
    machine.armed().refused(held.clone(), "held", "another client");
    drop(client);
    machine.wait("the lease ends with its client", || watcher.read("Go") == false && watcher.read("Level") == 5);
    assert_eq!(watcher.read("Speed"), 7.0, "a force without a lease stays");
    // A lease that is not renewed.
    let mut client = machine.armed();
    held["lease_ms"] = 200.into();
    client.good(held);
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(client.good(json!({ "request": "renew" }))["held"], 1);
    }
    assert_eq!(watcher.read("Go"), true, "renewed for half a second");
    machine.wait("the lease runs out", || watcher.read("Go") == false);
    // A process that is killed.
    let mut holder = Command::new(env!("CARGO_BIN_EXE_takt"));
    holder.args(["ctl", "force", "Go=TRUE", "--hold", "--reason", "a test", "--as", "bob"]).current_dir(&machine.folder);
    let mut holder = holder.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    machine.wait("the tool forces", || watcher.read("Go") == true);
    std::thread::sleep(Duration::from_millis(2000));
    assert_eq!(watcher.read("Go"), true, "the tool renews its lease");
    let forces = watcher.good(json!({ "request": "forces" }))["forces"].clone();
    assert!(
        forces.as_array().unwrap().iter().any(|force| force["variable"] == "Go" && force["by"] == "bob" && force["lease_ms"].is_u64()),
        "{forces}"
    );
    holder.kill().unwrap();
    holder.wait().unwrap();
    machine.wait("a killed client lets go", || watcher.read("Go") == false);
    assert!(machine.journal("release").iter().any(|line| line["reason"].as_str().is_some_and(|why| why.contains("client has gone"))));
}

#[test]
fn a_machine_that_faulted_waits_for_a_reset_and_one_that_is_paused_stands_still() {
    let mut machine = Machine::start("run");
    let mut client = machine.armed();
    client.good(json!({ "request": "pause" }));
    let paused = client.good(json!({ "request": "status" }));
    std::thread::sleep(Duration::from_millis(100));
    let later = client.good(json!({ "request": "status" }));
    assert_eq!((&paused["state"], &paused["cycle"]), (&json!("paused"), &later["cycle"]));
    client.good(json!({ "request": "step", "scans": 5 }));
    machine.wait("five scans", || client.good(json!({ "request": "status" }))["state"] == "paused");
    let stepped = client.good(json!({ "request": "status" }));
    assert_eq!(stepped["cycle"].as_u64(), later["cycle"].as_u64().map(|cycle| cycle + 5));
    assert!(stepped["time_ns"].as_i64().unwrap() - later["time_ns"].as_i64().unwrap() < 20_000_000, "machine time stood still");
    client.refused(json!({ "request": "step", "scans": 0 }), "out-of-range", "0 scans");
    client.good(json!({ "request": "continue" }));
    machine.wait("it goes on", || {
        client.good(json!({ "request": "status" }))["cycle"].as_u64() > stepped["cycle"].as_u64().map(|cycle| cycle + 50)
    });
    assert_eq!(machine.takt(&["ctl", "status"]).0, 0);
    for _ in 0..3 {
        client.good(json!({ "request": "write", "variables": [{ "variable": "Crash", "value": true }] }));
        machine.wait("the fault", || client.good(json!({ "request": "status" }))["state"] == "faulted");
        let fault = client.good(json!({ "request": "status" }))["fault"].clone();
        assert!(fault["code"] == "division-by-zero" && fault["line"] == 20, "{fault}");
        let (code, out, _) = machine.takt(&["ctl", "status"]);
        assert!(code == 1 && out.contains("GVL.st:20"), "{out}");
        client.good(json!({ "request": "reset" }));
        assert_eq!(client.good(json!({ "request": "status" }))["state"], "running");
    }
    client.good(json!({ "request": "halt" }));
    assert_eq!(client.good(json!({ "request": "status" }))["fault"]["code"], "stopped");
    client.good(json!({ "request": "reset", "kind": "cold" }));
    let (code, said) = machine.stop();
    assert!(code == 0 && said.contains("takt ctl reset"), "{said}");
    assert_eq!(machine.journal("fault").len(), 3);
}

#[test]
fn the_tool_talks_to_people_and_tools() {
    let machine = Machine::start("tool");
    let ctl = |arguments: &[&str]| machine.takt(&[&["ctl"], arguments].concat());
    let (code, out, _) = ctl(&["read", "Speed", "Name", "Delay"]);
    assert_eq!((code, out.as_str()), (0, "Speed = 1.5\nName = abc\nDelay = T#1s\n"));
    let (code, out, _) = ctl(&["read", "Level", "--json"]);
    assert_eq!((code, &serde_json::from_str::<Value>(&out).unwrap()["values"]), (0, &json!({ "Level": 5 })));
    let (code, _, err) = ctl(&["read", "Levl"]);
    assert!(code == 2 && err.contains("did you mean `Level`"), "{err}");
    let (code, _, err) = ctl(&["write", "Level=6"]);
    assert!(code == 2 && err.contains("--reason"), "{err}");
    assert_eq!(ctl(&["write", "Level=6", "--reason", "x"]).0, 0);
    assert_eq!(ctl(&["force", "Name='a$'b'", "--reason", "x", "--as", "eve"]).0, 0);
    let (code, out, _) = ctl(&["status"]);
    assert!(code == 0 && out.contains("1 forced") && out.contains("Name") && out.contains("a'b") && out.contains("eve"), "{out}");
    assert!(ctl(&["release", "--all", "--restore", "--reason", "x"]).1.contains("0 forced"));
    assert_eq!(ctl(&["read", "Name"]).1, "Name = abc\n");
    let (code, out, _) = ctl(&["watch", "A", "B", "--period", "20ms", "--count", "3", "--json"]);
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(code == 0 && lines.len() == 3 && lines.iter().all(|line| line["values"]["A"] == line["values"]["B"]), "{out}");
    assert_eq!(ctl(&["explode"]).0, 2);
    let (code, _, err) = machine.takt(&["ctl", "--socket", "none.sock", "status"]);
    assert!(code == 2 && err.contains("no machine answers at none.sock"), "{err}");
    let (code, _, err) = machine.takt(&["log", "--state", "nowhere"]);
    assert!(code == 2 && err.contains("journal.jsonl"), "{err}");
    let (code, out, _) = machine.takt(&["log"]);
    assert!(code == 0 && out.contains("Level 5 → 6") && out.contains("“x”"), "{out}");
}

/// Reads, subscriptions to every scan, forces and writes: all of it is done between scans without memory being asked for or mapped.
#[test]
fn what_clients_do_costs_the_scans_no_memory() {
    let mut machine = Machine::start_with("quiet", &["--stats", "stats.json"]);
    let mut client = machine.armed();
    let all: Vec<String> = (0..1000).map(|i| format!("Many[{i}]")).collect();
    client.good(json!({ "request": "subscribe", "variables": all, "period_ms": 10 }));
    client.good(json!({ "request": "subscribe", "variables": ["A", "B", "Name"], "scans": 1 }));
    for i in 0..100 {
        client.good(json!({ "request": "read", "variables": ["Many", "A"] }));
        client.good(json!({ "request": "status" }));
        client.good(json!({ "request": "write", "variables": [{ "variable": "Level", "value": i % 100 }] }));
        client.good(force(&format!("Many[{i}]"), json!(i)));
    }
    client.good(json!({ "request": "release-all", "restore": true }));
    drop(client);
    assert_eq!(machine.stop().0, 0);
    let stats: Value = serde_json::from_str(&std::fs::read_to_string(machine.folder.join("stats.json")).unwrap()).unwrap();
    let thread = &stats["thread"];
    assert_eq!((&thread["allocations"], &thread["major_faults"]), (&json!(0), &json!(0)), "{thread}");
}

#[test]
fn hostile_clients_are_cut_off_and_the_machine_runs_on() {
    let mut machine = Machine::start("hostile");
    let mut good = machine.connect();
    let start = good.good(json!({ "request": "tasks" }))["cycle"].as_u64().unwrap();
    // A line without end: it is cut off long before it is a gigabyte.
    let mut client = machine.connect();
    let block = [b'x'; 1 << 16];
    let mut sent = 0u64;
    while sent < 1 << 30 && client.reader.get_mut().write_all(&block).is_ok() {
        sent += block.len() as u64;
    }
    assert!(sent < 16 << 20, "{sent} bytes were taken");
    // What is no request is answered, and the connection lives.
    let mut client = machine.connect();
    for bad in [&b"\xFF\xFE\x00"[..], b"{", b"null", b"{\"id\":1}", b"{\"id\":[],\"request\":\"status\"}", "[".repeat(100_000).as_bytes()] {
        client.send(bad).unwrap();
        assert!(client.line().unwrap()["error"]["message"].is_string());
    }
    let mut deep = String::from("{\"id\":1,\"request\":\"write\",\"variables\":");
    deep.push_str(&"[".repeat(90_000));
    client.send(deep.as_bytes()).unwrap();
    assert_eq!(client.line().unwrap()["error"]["code"], "malformed");
    client.refused(json!({ "request": "read", "variables": vec!["A"; 4097] }), "out-of-range", "4097");
    client.refused(json!({ "request": "read", "variables": vec!["Many"; 9] }), "too-large", "72000 bytes");
    client.refused(json!({ "request": "read", "variables": ["A".repeat(100_000)] }), "unknown-variable", "there is no");
    client.refused(json!({ "request": "subscribe", "variables": ["A"], "period_ms": 1 }), "out-of-range", "1 ms");
    client.refused(json!({ "request": "subscribe", "variables": ["A"] }), "bad-request", "needs one of");
    for _ in 0..16 {
        client.good(json!({ "request": "subscribe", "variables": ["A"], "period_ms": 60_000 }));
    }
    client.refused(json!({ "request": "subscribe", "variables": ["A"], "period_ms": 60_000 }), "too-many", "16");
    // A wrong first word, and half a request.
    let mut client = Client::new(UnixStream::connect(machine.socket()).unwrap());
    client.refused(json!({ "request": "status" }), "hello-first", "hello");
    client.refused(json!({ "request": "hello", "version": 99 }), "wrong-version", "99");
    client.reader.get_mut().write_all(b"{\"id\":7,\"request\":\"hel").unwrap();
    drop(client);
    // Subscriptions to scans are bounded, and end with their client.
    for _ in 0..3 {
        let mut client = machine.connect();
        machine.wait("room for subscriptions to scans", || {
            client.ask(json!({ "request": "subscribe", "variables": ["Many"], "scans": 1 })).get("error").is_none()
        });
        (0..7).for_each(|_| _ = client.good(json!({ "request": "subscribe", "variables": ["Many"], "scans": 1 })));
        client.refused(json!({ "request": "subscribe", "variables": ["A"], "scans": 1 }), "too-many", "8");
    }
    assert_eq!(machine.journal("write").len() + machine.journal("force").len(), 0);
    let status = good.good(json!({ "request": "status" }));
    assert!(status["state"] == "running" && status["cycle"].as_u64().unwrap() > start, "{status}");
    assert_eq!(machine.stop().0, 0);
}

#[test]
fn a_client_that_never_reads_is_cut_off_and_memory_stays_flat() {
    let machine = Machine::start("silent");
    let mut good = machine.connect();
    good.good(json!({ "request": "status" }));
    let before = machine.memory();
    let request = json!({ "id": 1, "request": "read", "variables": (0..8).map(|_| "Many").collect::<Vec<_>>() });
    for _ in 0..3 {
        let mut silent = machine.connect();
        silent.reader.get_ref().set_write_timeout(Some(Duration::from_millis(500))).unwrap();
        // Until the machine listens to it no more.
        let sent = (0..100_000).take_while(|_| silent.send(request.to_string().as_bytes()).is_ok()).count();
        assert!(sent < 100_000, "{sent}");
        good.good(json!({ "request": "status" }));
    }
    let after = machine.memory();
    assert!(after < before + (64 << 20), "{before} bytes became {after}");
}

#[test]
fn a_thousand_connections_leave_room_for_nobody_else_and_go_again() {
    let machine = Machine::start("crowd");
    let mut good = machine.connect();
    let mut crowd = Vec::new();
    let mut refused = 0;
    for _ in 0..1000 {
        if let Ok(stream) = UnixStream::connect(machine.socket()) {
            crowd.push(stream);
        }
    }
    for stream in &mut crowd {
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        let mut text = [0; 512];
        if stream.read(&mut text).is_ok_and(|read| String::from_utf8_lossy(&text[..read]).contains("too-many-clients")) {
            refused += 1;
        }
    }
    assert!(refused >= 900, "{refused} of {}", crowd.len());
    assert_eq!(good.good(json!({ "request": "status" }))["state"], "running");
    drop(crowd);
    machine.wait("room again", || {
        let mut client = Client::new(UnixStream::connect(machine.socket()).unwrap());
        client.ask(json!({ "request": "hello", "version": 1 })).get("result").is_some()
    });
}

#[test]
fn parameters_are_set_saved_and_compared_whether_the_machine_runs_or_not() {
    let mut machine = Machine::start("param");
    let param = |machine: &Machine, arguments: &[&str]| machine.takt(&[&["param"], arguments].concat());
    assert_eq!(param(&machine, &["get", "Recipe.Speed"]).1, "GVL.Recipe.Speed = 2.5\n");
    let (code, _, err) = param(&machine, &["set", "Recipe.Speed=3.5"]);
    assert!(code == 2 && err.contains("--reason"), "{err}");
    let (code, out, err) = param(&machine, &["set", "Recipe.Speed=3.5", "--reason", "x"]);
    assert_eq!((code, out.as_str()), (0, "GVL.Recipe.Speed: 2.5 → 3.5\n"), "{err}");
    assert_eq!(machine.connect().read("GVL.Recipe.Speed"), 3.5);
    assert_eq!(param(&machine, &["export", "a.toml"]).0, 0);
    assert_eq!((param(&machine, &["diff", "a.toml"]).0, machine.stop().0), (0, 0));
    // Now in what the machine keeps.
    assert_eq!(param(&machine, &["get", "GVL.Recipe.Speed"]).1, "GVL.Recipe.Speed = 3.5\n");
    let file = std::fs::read_to_string(machine.folder.join("a.toml")).unwrap();
    for (wrong, part) in [
        (file.replace("3.5", "fast"), "fast"),
        (file.replace("Speed", "Sped"), "no parameter"),
        (file.replace("schema = 1", "schema = 2"), "version 2"),
        ("[".repeat(10_000), "b.toml"),
    ] {
        std::fs::write(machine.folder.join("b.toml"), wrong).unwrap();
        let (code, _, err) = param(&machine, &["import", "b.toml", "--reason", "x"]);
        assert!(code == 2 && err.contains(part), "{err}");
    }
    std::fs::write(machine.folder.join("a.toml"), file.replace("3.5", "7.25")).unwrap();
    let (code, out, _) = param(&machine, &["diff", "a.toml"]);
    assert!(code == 1 && out.contains("3.5 | 7.25"), "{out}");
    assert_eq!(param(&machine, &["import", "a.toml", "--reason", "x"]).0, 0);
    assert_eq!(param(&machine, &["get"]).1, "GVL.Recipe.Speed = 7.25\n");
    let written = machine.journal("write");
    assert!(written.len() == 2 && written[1]["from"] == "takt param" && written[1]["new"] == "7.25", "{written:?}");
}
