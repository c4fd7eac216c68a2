//! Recordings: a run with an operator who presses anything, with preemptions, lost frames and faults, is the same run again, in both executors.

use std::collections::BTreeMap;
use std::path::PathBuf;
use takt::machine::{Machine, Setup};
use takt::project::Project;
use takt::recording::file::Chunks;
use takt::recording::header::state_hash;
use takt::recording::player::{PlayError, Player};
use takt_engine::{Command, ExecutorKind, Preemption, Reset};
use takt_io::{Losses, Lossy};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }
    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }
}

fn dispenser() -> Project {
    takt::project::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../programs/five-axis-dispenser")).expect("the project can be read")
}

fn scratch(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("replay");
    std::fs::create_dir_all(&folder).expect("a folder for tests");
    folder.join(name)
}

/// Points at which the slower tasks are interrupted.
fn preemptions(random: &mut Random, cycles: u64) -> Vec<Preemption> {
    let one = |random: &mut Random, cycle| Preemption { cycle, task: 1, at_fuel: random.below(60) };
    (1..cycles / 10)
        .flat_map(|cycle| (0..1 + random.below(2)).map(move |_| cycle))
        .collect::<Vec<_>>()
        .into_iter()
        .map(|cycle| one(random, cycle))
        .collect()
}

const BUTTONS: [&str; 10] = ["ControlOn", "HomeAll", "Load", "Start", "Pause", "Resume", "Stop", "Reset", "ControlOff", "JogPlus[2]"];

/// The button that leads on to a job.
fn button(state: &str) -> &'static str {
    match state.rsplit('.').next().unwrap_or_default() {
        "Off" => "ControlOn",
        "Standby" => "HomeAll",
        "Ready" | "Done" => "Load",
        "Loaded" => "Start",
        "Paused" => "Resume",
        "Faulted" | "EmergencyStop" => "Reset",
        _ => "ControlOn",
    }
}

/// What was done to the machine, counted.
#[derive(Debug, Default, PartialEq, Eq)]
struct Done {
    commands: u64,
    faults: u64,
    resets: u64,
}

/// Somebody who does anything, but lets the machine work now and then.
fn operate(machine: &mut Machine, random: &mut Random, done: &mut Done, scan: u64) {
    if machine.fault().is_some() && random.below(300) == 0 {
        let kind = [Reset::Warm, Reset::Cold, Reset::Origin][random.below(3) as usize];
        machine.engine().command(&Command::Reset(kind)).expect("the program starts");
        done.resets += 1;
    }
    if scan.is_multiple_of(700) {
        let state = machine.literal("GVL.Sts.State").expect("a name of the contract");
        let button = if random.below(10) > 0 { button(&state) } else { BUTTONS[random.below(10) as usize] };
        done.commands += u64::from(machine.set(&format!("GVL.Cmd.{button}"), "TRUE").is_ok());
    }
    if scan % 700 == 30 {
        for button in BUTTONS {
            done.commands += u64::from(machine.set(&format!("GVL.Cmd.{button}"), "FALSE").is_ok());
        }
    }
    if scan.is_multiple_of(2500) {
        ["door", "air"].iter().for_each(|name| machine.bus().control.set_input(name, true).expect("an input"));
    }
    match random.below(15_000) {
        0 => {
            let drive = random.below(5) as usize;
            machine.bus().control.fail_drive(drive, 0x3220).expect("a drive");
        }
        1 => machine.bus().control.set_input("door", random.below(2) == 0).expect("an input"),
        2 => machine.bus().control.set_input("air", random.below(3) > 0).expect("an input"),
        3..=6 => {
            let place = machine.place("GVL.TcpSpeed").expect("a name of the contract");
            let command = if random.below(2) == 0 {
                Command::Force { place, bytes: random.next().to_le_bytes().into() }
            } else {
                Command::Release { place, restore: random.below(2) == 0 }
            };
            done.commands += u64::from(machine.engine().command(&command).is_ok());
        }
        _ => {}
    }
    if scan % 17_000 == 16_500 {
        machine.engine().halt();
        done.faults += 1;
    }
}

/// Runs and records; the hash at every 1000th scan.
fn record(file: &std::path::Path, scans: u64, seed: u64) -> (BTreeMap<u64, u64>, Done, u64) {
    let project = dispenser();
    let mut random = Random(seed);
    let setup = Setup { preempt: preemptions(&mut random, scans), ..Setup::default() };
    let losses = Losses { seed, per_million: 300, length: 2 };
    let mut machine = Machine::wrapped(&project, setup, |driver, host| (Box::new(Lossy::new(driver, losses)), host))
        .unwrap_or_else(|error| panic!("{error}"));
    machine.dismiss_operator();
    machine.record(&project, Some(file.into()), None).expect("the recorder starts");
    let (mut hashes, mut done) = (BTreeMap::new(), Done::default());
    let mut scan = 0;
    while scan < scans {
        operate(&mut machine, &mut random, &mut done, scan);
        if machine.step() {
            scan += 1;
            if machine.cycles().is_multiple_of(1000) {
                hashes.insert(machine.cycles(), state_hash(machine.engine()));
            }
        }
    }
    let preempted = (0..machine.program().tasks.len()).map(|task| machine.engine().statistics(task).preempted).sum();
    let summary = machine.finish_recording().expect("it was recorded");
    assert_eq!(summary.incomplete, None);
    println!("{} bytes for {scans} scans: {:.1} kB/s", summary.bytes, summary.bytes as f64 / (scans as f64 * 1e-3) / 1e3);
    (hashes, done, preempted)
}

fn replay(file: &std::path::Path, executor: ExecutorKind, most: u64) -> BTreeMap<u64, u64> {
    let mut player = Player::open(file, &dispenser(), Setup { executor, ..Setup::default() }).unwrap_or_else(|error| panic!("{error}"));
    let mut hashes = BTreeMap::new();
    let mut before = player.machine().cycles();
    while player.machine().cycles() < most && player.step().unwrap_or_else(|error| panic!("{error}")) {
        let cycle = player.machine().cycles();
        if cycle != before && cycle.is_multiple_of(1000) {
            hashes.insert(cycle, state_hash(player.machine().engine()));
        }
        before = cycle;
    }
    if most == u64::MAX {
        assert!(player.check_end().unwrap_or_else(|error| panic!("{error}")), "the recording was ended");
    }
    hashes
}

fn same_run_again(scans: u64, interpreted: u64) {
    let file = scratch(&format!("random-{scans}.rec"));
    let started = std::time::Instant::now();
    let (hashes, done, preempted) = record(&file, scans, 42);
    println!("recorded in {:.2} s: {done:?}, {preempted} preemptions", started.elapsed().as_secs_f64());
    assert!(hashes.len() as u64 >= scans / 1000 - 1, "{hashes:?}");
    assert!(done.commands > 5 && done.faults > 0 && done.resets > 0 && preempted > scans / 200, "{done:?} {preempted}");
    let started = std::time::Instant::now();
    assert_eq!(replay(&file, ExecutorKind::Jit, u64::MAX), hashes);
    let speed = scans as f64 * 1e-3 / started.elapsed().as_secs_f64();
    assert_eq!(replay(&file, ExecutorKind::Portable, u64::MAX), hashes, "without the newer instructions of the processor");
    println!("replayed {speed:.1} times as fast as real time");
    let first: BTreeMap<_, _> = hashes.into_iter().filter(|(cycle, _)| *cycle <= interpreted).collect();
    assert_eq!(replay(&file, ExecutorKind::Interpreter, interpreted), first);
}

#[test]
fn a_run_with_anything_in_it_is_the_same_run_again() {
    same_run_again(20_000, 4_000);
}

/// The figure of the roadmap: `cargo test --release -p takt-tests --test replay -- --ignored --nocapture`.
#[test]
#[ignore = "ten minutes of machine time"]
fn ten_minutes_are_the_same_ten_minutes_again() {
    same_run_again(600_000, 60_000);
}

#[test]
fn it_goes_back_as_well_as_forth() {
    let file = scratch("back.rec");
    let (hashes, ..) = record(&file, 9_000, 5);
    let mut player = Player::open(&file, &dispenser(), Setup::default()).unwrap_or_else(|error| panic!("{error}"));
    while player.step().unwrap_or_else(|error| panic!("{error}")) {}
    for cycle in [7000, 3000, 8000, 1000, 5000] {
        player.back_to(cycle).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((player.machine().cycles(), state_hash(player.machine().engine())), (cycle, hashes[&cycle]));
        while player.machine().cycles() < 8500 && player.step().unwrap_or_else(|error| panic!("{error}")) {}
    }
}

#[test]
fn another_program_is_refused_with_what_differs() {
    let file = scratch("other.rec");
    record(&file, 50, 1);
    let mut project = dispenser();
    project.sources.list[0].text.push_str("\n// changed\n");
    let name = project.sources.list[0].name.rsplit('/').next().expect("a name").to_string();
    let error = Player::open(&file, &project, Setup::default()).expect_err("it is another program").to_string();
    assert!(error.contains(&name) && error.contains("has changed"), "{error}");
    let mut project = dispenser();
    let (_, text) = project.manifest_file.as_mut().expect("it has one");
    *text = text.replace("per-unit = \"1048576 / 10\"", "per-unit = \"1048576 / 12\"");
    let error = Player::open(&file, &project, Setup::default()).expect_err("it is another machine").to_string();
    assert!(error.contains("`axis` has changed"), "{error}");
}

/// Plays as much as can be played.
fn play(bytes: &[u8], project: &Project, name: &str) -> Result<(u64, bool), PlayError> {
    let file = scratch(name);
    std::fs::write(&file, bytes).expect("a file for tests");
    let mut chunks = Chunks::open(&file)?;
    for place in chunks.list.clone() {
        chunks.read(place)?;
    }
    let mut player = Player::of(chunks, project, Setup { executor: ExecutorKind::Interpreter, ..Setup::default() })?;
    while player.step()? {}
    let complete = player.check_end()?;
    Ok((player.machine().cycles(), complete))
}

/// A small program with a recording of it.
fn small() -> (Project, Vec<u8>) {
    let text = "PROGRAM p VAR x : INT; END_VAR x := x + 1; END_PROGRAM";
    let source = takt_syntax::Source { name: "p.st".into(), text: text.into() };
    let sources = takt::sources::Sources { list: vec![source], ..Default::default() };
    let project = Project { root: std::env::temp_dir(), sources, ..Project::default() };
    let file = scratch("small.rec");
    let mut machine = Machine::new(&project, Setup::default()).unwrap_or_else(|error| panic!("{error}"));
    machine.record(&project, Some(file.clone()), None).expect("the recorder starts");
    for step in 0..40 {
        machine.step();
        if step % 10 == 0 {
            machine.set("p.x", "5").expect("a variable");
        }
    }
    machine.finish_recording();
    let bytes = std::fs::read(file).expect("it was written");
    (project, bytes)
}

#[test]
fn a_file_that_is_cut_or_damaged_is_refused_with_its_place() {
    let (project, bytes) = small();
    assert_eq!(play(&bytes, &project, "whole.rec").expect("it is whole"), (40, true));
    let (mut refused, mut shorter) = (0, 0);
    for cut in (0..bytes.len()).step_by(13).chain(bytes.len() - 100..bytes.len()) {
        match play(&bytes[..cut], &project, "cut.rec") {
            Ok((cycles, complete)) => shorter += u64::from(cycles <= 40 && !complete),
            Err(error) => {
                refused += 1;
                let text = error.to_string();
                assert!(text.contains("cut.rec"), "{text}");
            }
        }
    }
    assert!(refused > 20 && shorter > 10 && refused + shorter >= bytes.len() as u64 / 13, "{refused} {shorter}");
    let mut random = Random(3);
    for _ in 0..60 {
        let mut wrong = bytes.clone();
        for _ in 0..1 + random.below(3) {
            let at = random.below(wrong.len() as u64) as usize;
            wrong[at] ^= 1 << random.below(8);
        }
        // A length that leads behind the end of the file looks like a cut.
        match play(&wrong, &project, "damaged.rec") {
            Ok((_, complete)) => assert!(!complete || wrong == bytes, "a checksum did not see it"),
            Err(error) => assert!(error.to_string().contains("damaged.rec"), "{error}"),
        }
    }
    let mut other = bytes.clone();
    other[7] = 9;
    assert!(play(&other, &project, "version.rec").expect_err("another version").to_string().contains("version 9"));
    let text = play(b"PK\x03\x04 something else", &project, "foreign.rec").expect_err("no recording").to_string();
    assert!(text.contains("neither a recording"), "{text}");
    let mut huge = bytes;
    huge[16..20].copy_from_slice(&u32::MAX.to_le_bytes());
    let text = play(&huge, &project, "huge.rec").expect_err("a lie").to_string();
    assert!(text.contains("damaged at byte 8"), "{text}");
}

#[test]
fn what_was_recorded_is_on_the_disk_when_the_process_dies() {
    let (project, bytes) = small();
    // Without its end, as `kill -9` leaves it.
    let end = bytes.windows(4).rposition(|word| word == 6u32.to_le_bytes()).expect("the last chunk");
    assert_eq!(play(&bytes[..end], &project, "killed.rec").expect("it can be played"), (40, false));
}
