//! Snapshots of retained variables, and what a restart puts back.

use super::*;
use takt_ir::retain::Span;

/// The slow task counts PROGRESS up to 200 in one scan; the fast one owns the bus.
fn retaining() -> String {
    let tables = format!("retained \"p\" type 1 at {PROGRESS} retain\nretained \"q\" type 1 at 1024 persistent\n");
    two_tasks(&mark("A", "v0 = const 1"), &long("B", 200)) + &tables
}

fn kept(text: &str, options: Options) -> (Engine, SnapshotReader) {
    let mut engine = load(program(text), options, Box::new(NoBus)).unwrap();
    let reader = engine.snapshots().expect("it was asked for");
    assert!(engine.snapshots().is_none(), "it can be taken once");
    (engine, reader)
}

#[test]
fn a_snapshot_is_taken_where_no_task_is_in_the_middle_of_a_scan() {
    let preempt: Vec<_> = (1..200).map(|at_fuel| Preemption { cycle: 1, task: 1, at_fuel }).collect();
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let options = Options { executor, preempt: preempt.clone(), retain_interval: Some(Time(0)), ..Options::default() };
        let (mut engine, mut reader) = kept(&retaining(), options);
        engine.step(Time(0));
        assert_eq!(engine.statistics(1).preempted, 199, "the bus task ran many times inside of the slow scan");
        let snapshot = reader.newest().expect("one behind the step");
        assert_eq!((snapshot.number, &snapshot.bytes[..4]), (0, &200i32.to_le_bytes()[..]));
    }
}

#[test]
fn the_interval_is_kept_and_full_buffers_are_no_obstacle() {
    let options = Options { retain_interval: Some(Time(2_000_000)), ..Options::default() };
    let (mut engine, mut reader) = kept(&retaining(), options);
    steps(&mut engine, 4);
    let second = reader.newest().expect("taken at 0 and 2 ms");
    assert_eq!((second.time, second.number), (Time(2_000_000), 1));
    assert!(reader.newest().is_none());
    steps(&mut engine, 20);
    let before = reader.newest().expect("two more, then all buffers are out or waiting");
    assert_eq!(before.number, 3);
    reader.give_back(second);
    reader.give_back(before);
    steps(&mut engine, 1);
    assert_eq!(reader.newest().expect("the next step tries again").number, 4);
}

#[test]
fn a_fault_leaves_the_last_whole_state() {
    let text = retaining().replace("b2:\n  return", "b2:\n  fault null-pointer @1");
    let options = Options { retain_interval: Some(Time(0)), ..Options::default() };
    let (mut engine, mut reader) = kept(&text, options);
    steps(&mut engine, 3);
    assert!(engine.fault().is_some());
    assert!(reader.newest().is_none(), "the first step ended in the fault");
    assert_eq!(number(&engine, PROGRESS), 200);
}

#[test]
fn each_kind_of_restart_keeps_what_it_promises() {
    for (kind, expected) in [(Reset::Warm, (200, 7)), (Reset::Cold, (0, 7)), (Reset::Origin, (0, 0))] {
        both(&retaining(), Options::default, |mut engine| {
            steps(&mut engine, 1);
            engine.write(place(1024, 1), &7i32.to_le_bytes()).unwrap();
            engine.reset(kind).unwrap();
            assert_eq!((number(&engine, PROGRESS), number(&engine, 1024), number(&engine, COUNT)), (expected.0, expected.1, 0), "{kind:?}");
        });
    }
}

#[test]
fn only_bytes_of_retained_variables_are_put_back() {
    let good = Span { offset: PROGRESS, len: 4, mask: 255 };
    let text = retaining();
    let restored = |parts: Vec<Span>, data: Vec<u8>| {
        let restore = Restore { kind: Reset::Warm, parts, data, complete: true };
        load(program(&text), Options { restore: Some(restore), ..Options::default() }, Box::new(NoBus))
    };
    let engine = restored(vec![good], vec![5, 0, 0, 0]).unwrap();
    assert_eq!(number(&engine, PROGRESS), 5);
    for span in [
        Span { offset: PROGRESS - 1, ..good },
        Span { offset: PROGRESS + 1, ..good },
        Span { offset: 0, ..good },
        Span { offset: u32::MAX, ..good },
        Span { len: u32::MAX, ..good },
        Span { offset: 1028, ..good },
    ] {
        let found = restored(vec![good, span], vec![0; 8]);
        assert!(matches!(found, Err(LoadError::Restore { part: 1 })), "{span:?}");
    }
    assert!(matches!(restored(vec![good], vec![0; 3]), Err(LoadError::Restore { part: 1 })), "bytes are missing");
}

#[test]
fn the_layout_joins_neighbours_and_knows_each_place() {
    let tables = "retained \"a\" type 1 at 1024 retain\nretained \"b\" type 1 at 64 retain\nretained \"c\" type 2 at 1032 retain\n\
                  retained \"d\" type 0 at 1033 persistent\n";
    let program = program(&(two_tasks(&mark("A", "v0 = const 1"), &long("B", 2)) + tables));
    let layout = RetainLayout::new(&program);
    assert_eq!((layout.len(), layout.is_empty()), (4 + 16, false));
    assert_eq!((0..4).map(|i| layout.place(i)).collect::<Vec<_>>(), [4, 0, 12, 13]);
    let image: Vec<u8> = (0..4096).map(|i| (i % 251) as u8).collect();
    let mut bytes = vec![0; layout.len()];
    layout.copy(&image, &mut bytes);
    assert_eq!((&bytes[..4], &bytes[4..]), (&image[64..68], &image[1024..1040]));
}
