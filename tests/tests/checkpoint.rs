//! Checkpoints: a run that goes back to one goes on as it went on before, in both executors; and in the other executor too.

use std::hash::Hasher;
use std::sync::Arc;
use takt::machine::{Machine, Setup};
use takt_abi::Time;
use takt_engine::{Engine, ExecutorKind, NoBus, Options};

/// A number for all that a run is compared by.
fn hash(engine: &Engine) -> u64 {
    let mut hasher = std::hash::DefaultHasher::new();
    engine.state(&mut |bytes| hasher.write(bytes));
    hasher.finish()
}

fn dispenser(executor: ExecutorKind) -> Machine {
    let project =
        takt::project::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../programs/five-axis-dispenser")).expect("the project can be read");
    let mut machine = Machine::new(&project, Setup { executor, ..Setup::default() }).unwrap_or_else(|error| panic!("{error}"));
    machine.dismiss_operator();
    machine
}

/// Goes on with somebody at the panel, who does the same each time.
fn go_on(machine: &mut Machine, from: u64, scans: u64) -> Vec<u64> {
    let press = |machine: &mut Machine, button: &str, down: bool| {
        machine.set(&format!("GVL.Cmd.{button}"), if down { "TRUE" } else { "FALSE" }).expect("a name of the contract");
    };
    let script = [(100, "ControlOn"), (1_500, "HomeAll"), (14_000, "Load"), (14_500, "Start"), (21_000, "Pause"), (22_000, "Start")];
    let mut hashes = Vec::new();
    for scan in from..from + scans {
        for (at, button) in script {
            if scan == at || scan == at + 20 {
                press(machine, button, scan == at);
            }
        }
        machine.step();
        if scan % 100 == 0 {
            hashes.push(hash(machine.engine()));
        }
    }
    hashes
}

#[test]
fn the_dispenser_goes_on_from_a_checkpoint_as_it_did() {
    let mut machine = dispenser(ExecutorKind::Jit);
    let mut other = dispenser(ExecutorKind::Interpreter);
    let mut seen = std::collections::BTreeSet::new();
    let mut scan = 0;
    // Off, homing, reading the file with a request under way, on the path, paused, on again.
    for pause in [50, 2_000, 12_100, 6, 1, 1, 1, 400, 2_500, 4_200, 1_500] {
        go_on(&mut machine, scan, pause);
        scan += pause;
        let before = machine.engine().checkpoint();
        let first = go_on(&mut machine, scan, 1_000);
        let after = hash(machine.engine());
        machine.engine().restore(&before).expect("its own checkpoint");
        let second = go_on(&mut machine, scan, 1_000);
        assert_eq!((first, after), (second, hash(machine.engine())), "from scan {scan}");
        // Without what is behind the bus: the other executor is at least the same at this place.
        let parts = takt_engine::Checkpoint::from_parts(before.image().to_vec(), before.state().to_vec());
        other.engine().restore(&parts).expect("a checkpoint of the same program");
        machine.engine().restore(&before).expect("its own checkpoint");
        assert_eq!(hash(machine.engine()), hash(other.engine()), "from scan {scan}");
        seen.insert(machine.literal("GVL.Sts.State").expect("a name of the contract"));
    }
    assert!(seen.len() >= 5, "the machine went through few states: {seen:?}");
    assert!(seen.contains("MachineState.Running"), "{seen:?}");
}

#[test]
fn what_a_drive_and_a_wire_do_goes_back_too() {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut machine = dispenser(executor);
        go_on(&mut machine, 0, 2_500);
        let place = machine.place("GVL.Par.ToolLength").or_else(|_| machine.place("GVL.TcpSpeed")).expect("a name");
        let bytes = vec![0; machine.bytes(place).len()];
        machine.engine().force(place, &bytes).expect("a variable");
        let before = machine.engine().checkpoint();
        let hit = |machine: &mut Machine| {
            go_on(machine, 2_500, 100);
            machine.bus().control.fail_drive(1, 0x3220).expect("a drive");
            machine.engine().command(&takt_engine::Command::Release { place, restore: true }).expect("forced");
            let hashes = go_on(machine, 2_600, 500);
            (hashes, machine.bus().control.mechanics(0), machine.engine().force_count())
        };
        let first = hit(&mut machine);
        machine.engine().restore(&before).expect("its own checkpoint");
        assert_eq!(machine.engine().force_count(), 1);
        assert_eq!(first, hit(&mut machine));
        assert_ne!(first.1, Err(takt_io::sim::Unknown));
    }
}

#[test]
fn generated_programs_go_on_from_a_checkpoint_as_they_did() {
    let mut compared = 0;
    for seed in 0..60 {
        let generated = takt_tests::generate::generate(seed);
        let Ok(program) = takt_tests::agreement::compile(&generated.source, generated.iec_arithmetic) else { continue };
        let program = Arc::new(program);
        for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
            let options = Options { executor, fuel_limit: 20_000, depth_limit: 100, ..Options::default() };
            let Ok(mut engine) = takt_engine::load(program.clone(), options, Box::new(NoBus)) else { continue };
            engine.step(Time(0));
            let before = engine.checkpoint();
            let go_on = |engine: &mut Engine| {
                (1..4).for_each(|scan| engine.step(Time(scan * 10_000_000)));
                (hash(engine), engine.fault().cloned())
            };
            let first = go_on(&mut engine);
            engine.restore(&before).expect("its own checkpoint");
            assert_eq!(first, go_on(&mut engine), "seed {seed}");
            compared += 1;
        }
    }
    assert!(compared > 60, "{compared}");
}

#[test]
fn a_checkpoint_that_is_cut_or_changed_is_refused_whole() {
    let text = "
        FUNCTION_BLOCK A
        VAR n : DINT; END_VAR
        METHOD Add : DINT
          n := n + 1; Add := n;
        END_METHOD
        END_FUNCTION_BLOCK
        FUNCTION_BLOCK B EXTENDS A
        METHOD Add : DINT
          n := n + 2; Add := n;
        END_METHOD
        END_FUNCTION_BLOCK
        PROGRAM p
        VAR a : A; b : B; r : POINTER TO A; heap : ARRAY[1..4] OF POINTER TO B; i : INT; t : TON; END_VAR
        i := i + 1;
        IF i <= 4 THEN heap[i] := __NEW(B); END_IF
        IF i = 6 THEN __DELETE(heap[2]); END_IF
        r := ADR(b);
        r^.Add(); a.Add();
        t(IN := TRUE, PT := T#1s);
        END_PROGRAM";
    let output = takt_compile::compile(takt_compile::Input {
        sources: &[takt_syntax::Source { name: "p.st".into(), text: text.into() }],
        libraries: &[&takt_stdlib_fb::LIBRARY],
        options: &takt_compile::Options::default(),
    });
    let program = Arc::new(output.program.unwrap_or_else(|| panic!("{:?}", output.diagnostics)));
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut engine = takt_tests::bench::load(&program, executor).expect("it loads");
        (0..5).for_each(|scan| engine.step(Time(scan * 10_000_000)));
        let good = engine.checkpoint();
        let before = hash(&engine);
        let (image, state) = (good.image().to_vec(), good.state().to_vec());
        for cut in 0..state.len() {
            let wrong = takt_engine::Checkpoint::from_parts(image.clone(), state[..cut].to_vec());
            assert!(engine.restore(&wrong).is_err(), "cut at {cut}");
        }
        assert!(engine.restore(&takt_engine::Checkpoint::from_parts(image[1..].to_vec(), state.clone())).is_err());
        assert_eq!(before, hash(&engine), "nothing is loaded halfway");
        let mut seed = 7u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize
        };
        for _ in 0..2_000 {
            let (mut image, mut state) = (image.clone(), state.clone());
            for _ in 0..random() % 4 + 1 {
                let at = random() % state.len();
                state[at] = random() as u8;
                let at = random() % image.len();
                image[at] = random() as u8;
            }
            // Refused, or a state that the program can run in.
            if engine.restore(&takt_engine::Checkpoint::from_parts(image, state)).is_ok() {
                let now = engine.now();
                (1..3).for_each(|scan| engine.step(Time(now.0.saturating_add(scan * 10_000_000))));
            }
        }
        engine.restore(&good).expect("the good one still fits");
        assert_eq!(before, hash(&engine));
    }
}
