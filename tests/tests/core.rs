//! Faults on the shop floor: the process lives, outputs are safe, each record is right to the line, and a core file explains each.

use std::path::PathBuf;
use takt::machine::{Machine, Setup};
use takt::project::Project;
use takt::recording::file::Chunks;
use takt::recording::postmortem;
use takt::sources::Sources;
use takt_abi::Fault;
use takt_engine::{Command, ExecutorKind, IoDriver, IoFault, ProcessImage, Reset};
use takt_syntax::Source;

fn scratch(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("cores").join(name);
    drop(std::fs::remove_dir_all(&folder));
    folder
}

const MANIFEST: &str = "[project]\nname = \"faults\"\n[bus]\nkind = \"sim\"\n[sim]\ninputs = { go = true }\noutputs = [\"lamp\"]\n\
    [io]\n\"PLC_PRG.lamp\" = { channel = \"sim/lamp\", safe = false }\n\"PLC_PRG.go\" = \"sim/go\"\n";

fn project(text: String) -> Project {
    let sources = Sources { list: vec![Source { name: "faults.st".into(), text }], ..Sources::default() };
    let manifest = takt::manifest::read("takt.toml", MANIFEST).unwrap_or_else(|error| panic!("{error}"));
    let manifest_file = Some(("takt.toml".into(), MANIFEST.to_string()));
    Project { name: "faults".into(), root: std::env::temp_dir(), manifest, manifest_file, sources }
}

/// A way to fault: what is declared, the statement, and the name of the fault.
const KINDS: [(&str, &str, &str); 8] = [
    ("", "list[n * 2 + 50] := 1;", "index"),
    ("zero : INT;", "n := n / zero;", "division-by-zero"),
    ("p : POINTER TO INT;", "p^ := n;", "null-pointer"),
    ("p : POINTER TO INT;", "p := ADR(n) + 100000000; p^ := n;", "wild-pointer"),
    ("", "n := Deep(n);", "stack-overflow"),
    ("", "WHILE TRUE DO n := n + 1; END_WHILE", "watchdog"),
    ("p : POINTER TO INT;", "p := ADR(n); __DELETE(p);", "wrong-delete"),
    ("worker : POINTER TO Base;", "worker := ADR(n); worker^.Act();", "no-instance"),
];

/// Statements, one a line, each behind its own condition; and for each its line and the name of its fault.
fn program(count: usize) -> (String, Vec<(u32, &'static str)>) {
    let mut text = String::from(
        "FUNCTION Deep : INT\nVAR_INPUT n : INT; END_VAR\nDeep := Deep(n + 1) + 1;\nEND_FUNCTION\n\
         FUNCTION_BLOCK Base\nMETHOD Act : INT\nAct := 1;\nEND_METHOD\nEND_FUNCTION_BLOCK\n\
         FUNCTION_BLOCK Work EXTENDS Base\nMETHOD Act : INT\nAct := 2;\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
    );
    let mut expected = Vec::new();
    let mut calls = String::new();
    for i in 0..count {
        let (declared, statement, name) = KINDS[i % KINDS.len()];
        text.push_str(&format!("FUNCTION_BLOCK Bad{i}\nVAR_INPUT n : INT; END_VAR\nVAR list : ARRAY[0..9] OF INT; {declared} END_VAR\n{statement}\nEND_FUNCTION_BLOCK\n"));
        let line = text.matches('\n').count() as u32 - 1;
        expected.push((if name == "stack-overflow" { 1 } else { line }, name));
        calls.push_str(&format!("IF which = {i} THEN bad{i}(n := 7); END_IF\n"));
    }
    let instances: String = (0..count).map(|i| format!("bad{i} : Bad{i}; ")).collect();
    text.push_str(&format!(
        "PROGRAM PLC_PRG\nVAR lamp, go : BOOL; which : INT := -1; {instances} END_VAR\nlamp := TRUE;\n{calls}END_PROGRAM\n"
    ));
    (text, expected)
}

fn faults(executor: ExecutorKind, folder: PathBuf, count: usize) {
    let (text, expected) = program(count);
    let project = project(text);
    let mut machine = Machine::new(&project, Setup { executor, ..Setup::default() }).unwrap_or_else(|error| panic!("{error}"));
    machine.record(&project, None, Some(folder.clone())).expect("the recorder starts");
    for (i, (line, name)) in expected.iter().enumerate() {
        for _ in 0..3 {
            machine.step();
        }
        assert_eq!(machine.bus().control.bit("lamp"), Some(true), "{i}");
        machine.set("PLC_PRG.which", &i.to_string()).expect("a variable");
        machine.step();
        let record = machine.fault().unwrap_or_else(|| panic!("{i}: expected {name}")).clone();
        assert_eq!((record.fault.name(), record.place.file.as_str(), record.place.line), (*name, "faults.st", *line), "{i}: {record}");
        // Within the bus cycle of the fault.
        assert_eq!(machine.bus().control.bit("lamp"), Some(false), "{i}");
        for _ in 0..2 {
            machine.step();
        }
        // Faults on a shop floor are further apart than the writing of a file takes.
        std::thread::sleep(std::time::Duration::from_millis(30));
        machine.engine().command(&Command::Reset(Reset::Warm)).unwrap_or_else(|error| panic!("{i}: {error}"));
    }
    let summary = machine.finish_recording().expect("it was recorded");
    assert_eq!((summary.cores.len(), summary.failed), (count, Vec::new()));
    // The newest are kept.
    let kept: Vec<_> = summary.cores.iter().filter(|path| path.exists()).collect();
    assert_eq!(kept.len(), 20);
    for (path, number) in kept.iter().rev().zip((0..count).rev()).take(1) {
        let core = postmortem::open(path, None).unwrap_or_else(|error| panic!("{error}"));
        let (line, name) = expected[number];
        let record = core.again.as_ref().expect("it is reached again");
        assert_eq!((record.fault.name(), record.place.line), (name, line), "{}", path.display());
        let caller = core.calls.iter().find(|call| call.body.starts_with("Bad")).expect("the block");
        assert_eq!(caller.instance, Some(format!("PLC_PRG.bad{number}")));
        assert!(caller.members.iter().any(|member| member.name == "list" && member.value.starts_with('[')));
        assert!(core.inputs.contains(&("go".into(), "TRUE".into())), "{:?}", core.inputs);
    }
}

#[test]
fn faults_of_every_kind_in_the_interpreter() {
    faults(ExecutorKind::Interpreter, scratch("interpreter"), 24);
}

#[test]
fn a_hundred_faults_in_machine_code() {
    faults(ExecutorKind::Jit, scratch("jit"), 104);
}

/// A core file of a small program, and its project.
fn small(folder: &str) -> PathBuf {
    let text = "FUNCTION_BLOCK Inner\nVAR_INPUT k : INT; END_VAR\nMETHOD Check : BOOL\nVAR_INPUT what : LREAL; END_VAR\nVAR half : LREAL; \
        note : STRING := 'abc'; END_VAR\nhalf := what / 2;\nCheck := half > 10 / k;\nEND_METHOD\nCheck(what := k * 3);\nEND_FUNCTION_BLOCK\n\
        PROGRAM PLC_PRG\nVAR lamp, go : BOOL; inner : ARRAY[2..3] OF Inner; k : INT := 3; END_VAR\nk := k - 1;\ninner[3](k := k);\nEND_PROGRAM\n";
    let project = project(text.into());
    let mut machine = Machine::new(&project, Setup::default()).unwrap_or_else(|error| panic!("{error}"));
    machine.record(&project, None, Some(scratch(folder))).expect("the recorder starts");
    while machine.fault().is_none() {
        machine.step();
    }
    machine.finish_recording().expect("it was recorded").cores.pop().expect("a core file")
}

#[test]
fn every_local_of_every_call_is_shown() {
    let mut core = postmortem::open(&small("locals"), None).unwrap_or_else(|error| panic!("{error}"));
    let paths: Vec<_> = core.calls.iter().map(|call| (call.body.as_str(), call.instance.as_deref(), call.place.1)).collect();
    assert_eq!(paths, [("Inner.Check", Some("PLC_PRG.inner[3]"), 7), ("Inner", Some("PLC_PRG.inner[3]"), 9), ("PLC_PRG", None, 14)]);
    let locals: Vec<_> = core.calls[0].locals.iter().map(|local| (local.name.as_str(), local.value.as_str())).collect();
    assert_eq!(locals, [("what", "0.0"), ("half", "0.0"), ("note", "'abc'"), ("Check", "FALSE")]);
    assert_eq!(core.calls[0].source.trim(), "Check := half > 10 / k;");
    assert_eq!(core.machine().literal("PLC_PRG.k").expect("a variable"), "0");
    assert_eq!(core.recorded["code"], "division-by-zero");
}

#[test]
fn a_core_file_that_is_cut_or_damaged_is_refused() {
    let path = small("damage");
    let bytes = std::fs::read(&path).expect("it was written");
    let broken = path.with_file_name("broken.core");
    let open = |bytes: &[u8]| {
        std::fs::write(&broken, bytes).expect("a file for tests");
        postmortem::open(&broken, None)
    };
    let mut seed = 5u64;
    for cut in (0..bytes.len()).step_by(29) {
        match open(&bytes[..cut]) {
            Ok(core) => assert!(cut > 100, "{:?}", core.recorded),
            Err(error) => assert!(error.to_string().contains("broken.core"), "{error}"),
        }
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let mut wrong = bytes.clone();
        wrong[(seed >> 33) as usize % bytes.len()] ^= 1 << (seed >> 61);
        // A changed length may look like a cut; all else is seen.
        if let Err(error) = open(&wrong) {
            assert!(error.to_string().contains("broken.core"), "{error}");
        }
    }
    assert!(Chunks::open(&path).is_ok());
}

/// A driver with a defect.
struct Panics(Box<dyn IoDriver>, u32);

impl IoDriver for Panics {
    fn size(&self) -> takt_engine::BusSize {
        self.0.size()
    }
    fn exchange(&mut self, now: takt_abi::Time, io: &mut ProcessImage) -> Result<(), IoFault> {
        self.1 += 1;
        assert!(self.1 != 5, "a defect of the driver");
        self.0.exchange(now, io)
    }
}

#[test]
fn a_driver_that_panics_is_a_fault_of_the_bus_and_replays_as_one() {
    let (text, _) = program(1);
    let project = project(text);
    let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("panic.rec");
    let mut machine = Machine::wrapped(&project, Setup::default(), |driver, host| (Box::new(Panics(driver, 0)), host))
        .unwrap_or_else(|error| panic!("{error}"));
    machine.record(&project, Some(file.clone()), None).expect("the recorder starts");
    for _ in 0..10 {
        machine.step();
    }
    assert_eq!(machine.engine().io_faults().1, 1);
    let hash = takt::recording::header::state_hash(machine.engine());
    machine.finish_recording();
    let mut player = takt::recording::player::Player::open(&file, &project, Setup::default()).unwrap_or_else(|error| panic!("{error}"));
    while player.step().unwrap_or_else(|error| panic!("{error}")) {}
    assert_eq!((player.machine().engine().io_faults().1, takt::recording::header::state_hash(player.machine().engine())), (1, hash));
    assert!(!matches!(player.machine().fault().map(|record| record.fault), Some(Fault::Panic)));
}
