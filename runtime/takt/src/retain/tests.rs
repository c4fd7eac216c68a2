//! Torn writes, hostile files, other versions of the program.

use super::layout::{Description, TypeText};
use super::slot::{Defect, FILES, HEAD, Store, head, load, read, writes};
use super::*;
use crate::machine::{BuildError, Machine, Setup};
use crate::project::Project;
use crate::sources::Sources;
use std::path::PathBuf;
use takt_syntax::Source as Text;

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("takt-retain-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn machine(program: &str, retained: Source) -> Result<Machine, BuildError> {
    let text = Text { name: "main.st".into(), text: program.into() };
    let sources = Sources { list: vec![text], ..Sources::default() };
    let project = Project { name: "test".into(), root: std::env::temp_dir(), sources, ..Project::default() };
    Machine::new(&project, Setup { retained: Some(retained), ..Setup::default() })
}

fn fresh() -> Source {
    Source { generation: None, kind: Reset::Warm, lenient: false }
}

/// What a program has stored after some scans.
fn stored(program: &str, scans: usize) -> Generation {
    let mut machine = machine(program, fresh()).unwrap_or_else(|error| panic!("{error}"));
    for _ in 0..scans {
        machine.step();
    }
    let program = machine.program().clone();
    let mut data = Vec::new();
    pack(&program, &RetainLayout::new(&program), &machine.engine().retained(), &mut data);
    let description = describe("test", &program).to_bytes();
    let head = head(1, 1_700_000_000, &description, &data);
    read(&[&head[..], &description, &data].concat()).unwrap_or_else(|defect| panic!("{defect}"))
}

fn from(generation: &Generation, kind: Reset) -> Source {
    Source { generation: Some(generation.clone()), kind, lenient: false }
}

fn list(vars: &str) -> String {
    format!("VAR_GLOBAL RETAIN {vars} END_VAR\nPROGRAM main\nEND_PROGRAM")
}

/// Three generations of values: the last one is about to be written into the file of the first.
fn torn(described: bool, third: &Description) {
    let path = folder(if described { "torn" } else { "torn-new" });
    let description = Description { project: "p".into(), places: vec![], types: vec![] };
    let place = layout::Described { path: "GVL.x".into(), persistent: false, ty: 0 };
    let description = Description { places: vec![place], types: vec![TypeText::String(29)], ..description };
    let mut store = Store::new(&path, &description, &Loaded::default());
    let values = |n: u8| vec![n; 30];
    store.write(&values(1), 1).unwrap();
    store.write(&values(2), 2).unwrap();
    assert_eq!(load(&path).unwrap().newest.map(|(g, file)| (g.number, file)), Some((2, 1)));
    let before = std::fs::read(path.join(FILES[0])).unwrap();
    let text = third.to_bytes();
    let data = vec![3; Description::from_bytes(&text).unwrap().1.len];
    let head = head(3, 3, &text, &data);
    let writes = writes(&head, &text, &data, described);
    let total: usize = writes.iter().map(|(_, bytes)| bytes.len()).sum();
    // In order, cut off at every byte; and each write alone, as a disk that sorts them may leave it.
    let orders: Vec<Vec<usize>> =
        (0..writes.len()).map(|i| vec![i]).chain([(0..writes.len()).collect(), (0..writes.len()).rev().collect()]).collect();
    let (mut old, mut new) = (0, 0);
    for order in orders {
        for cut in 0..=total {
            let mut file = before.clone();
            let mut left = cut;
            for i in &order {
                let (at, bytes) = writes[*i];
                let len = bytes.len().min(left);
                left -= len;
                let end = at as usize + len;
                file.resize(file.len().max(end), 0);
                file[at as usize..end].copy_from_slice(&bytes[..len]);
            }
            std::fs::write(path.join(FILES[0]), &file).unwrap();
            let loaded = load(&path).unwrap_or_else(|error| panic!("cut at {cut}: {error}"));
            let (generation, _) = loaded.newest.expect("one of the files is whole");
            match generation.number {
                2 => assert_eq!(generation.data, values(2)),
                3 => assert_eq!(generation.data, data),
                other => panic!("cut at {cut}: generation {other}"),
            }
            *(if generation.number == 2 { &mut old } else { &mut new }) += 1;
        }
    }
    assert!(old > total && new > 0, "{old} {new} of {total}");
    std::fs::remove_dir_all(path).unwrap();
}

#[test]
fn a_write_torn_at_every_byte_leaves_the_last_or_the_last_but_one() {
    let place = |name: &str, ty| layout::Described { path: name.into(), persistent: false, ty };
    let same = Description { project: "p".into(), places: vec![place("GVL.x", 0)], types: vec![TypeText::String(29)] };
    torn(true, &same);
    torn(false, &same);
    let types = vec![TypeText::Elem("LREAL".into()), TypeText::Array(0, vec![(1, 4)])];
    torn(false, &Description { project: "a longer name".into(), places: vec![place("GVL.x", 1), place("GVL.y", 0)], types });
}

#[test]
fn a_bit_that_has_flipped_anywhere_is_noticed() {
    let generation = stored(&list("a : LREAL := 1.5; s : STRING(10) := 'text';"), 1);
    let text = generation.description.to_bytes();
    let bytes = [&head(7, 9, &text, &generation.data)[..], &text, &generation.data].concat();
    assert_eq!(read(&bytes).map(|g| (g.number, g.saved)), Ok((7, 9)));
    for bit in 0..bytes.len() * 8 {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&flipped).is_err(), "bit {bit}");
    }
    for len in 0..bytes.len() {
        assert!(read(&bytes[..len]).is_err(), "{len} bytes");
    }
}

/// A file whose checksums are right, whatever it says.
fn crafted(version: u32, lengths: [u64; 2], description: &[u8], data: &[u8]) -> Vec<u8> {
    let mut head = head(1, 1, description, data);
    head[8..12].copy_from_slice(&version.to_le_bytes());
    head[32..40].copy_from_slice(&lengths[0].to_le_bytes());
    head[40..48].copy_from_slice(&lengths[1].to_le_bytes());
    head[20..24].fill(0);
    let sum = crc32fast::hash(&head);
    head[20..24].copy_from_slice(&sum.to_le_bytes());
    [&head[..], description, data].concat()
}

#[test]
fn hostile_files_are_refused_by_name() {
    let description = br#"{"project":"p","places":[],"types":[]}"#;
    let len = description.len() as u64;
    assert!(read(&crafted(1, [len, 0], description, b"")).is_ok());
    assert_eq!(read(&crafted(2, [len, 0], description, b"")).err(), Some(Defect::Version(2)));
    for long in [1 << 63, u64::MAX, 1 << 40] {
        assert_eq!(read(&crafted(1, [long, 0], description, b"")).err(), Some(Defect::Length(long)));
        assert_eq!(read(&crafted(1, [len, long], description, b"")).err(), Some(Defect::Length(long)));
    }
    assert!(matches!(read(&crafted(1, [len, 1 << 20], description, b"")), Err(Defect::Short { .. })));
    assert_eq!(read(b"not a file with values at all, but as long as a head would be, and longer").err(), Some(Defect::Foreign));
    assert_eq!(read(b"TAKT").err(), Some(Defect::Short { expected: HEAD as u64, found: 4 }));
    let big = i64::MAX;
    let descriptions = [
        "{}".to_string(),
        "[".repeat(10_000),
        r#"{"project":"p","places":[{"path":"x","persistent":false,"ty":9}],"types":[]}"#.into(),
        r#"{"project":"p","places":[],"types":[{"array":[0,[[1,2]]]}]}"#.into(),
        r#"{"project":"p","places":[],"types":[{"elem":"INTEGER"}]}"#.into(),
        r#"{"project":"p","places":[],"types":[{"string":4294967295}]}"#.into(),
        r#"{"project":"p","places":[],"types":[{"bit":8}]}"#.into(),
        format!(r#"{{"project":"p","places":[],"types":[{{"elem":"INT"}},{{"array":[0,[[-{big},{big}]]]}}]}}"#),
        r#"{"project":"p","places":[],"types":[{"elem":"INT"},{"array":[0,[[5,1]]]}]}"#.into(),
        r#"{"project":"p","places":[],"types":[{"elem":"INT"},{"struct":["S",3,[["a",0,2]]]}]}"#.into(),
        r#"{"project":"p","places":[{"path":"x","persistent":false,"ty":0}],"types":[{"elem":"INT"}]}"#.into(),
    ];
    for text in descriptions {
        let found = read(&crafted(1, [text.len() as u64, 0], text.as_bytes(), b""));
        assert!(matches!(found, Err(Defect::Description(_))), "{text:.80}: {:?}", found.err());
    }
    let mut deep = String::from(r#"{"elem":"INT"}"#);
    (0..500).for_each(|n| deep += &format!(r#",{{"array":[{n},[[1,1]]]}}"#));
    let deep = format!(r#"{{"project":"p","places":[],"types":[{deep}]}}"#);
    assert!(matches!(read(&crafted(1, [deep.len() as u64, 0], deep.as_bytes(), b"")), Err(Defect::Description(_))));
}

#[test]
fn a_folder_with_nothing_whole_is_refused_and_left_alone() {
    let path = folder("damaged");
    assert!(load(&path).unwrap().newest.is_none(), "an empty folder is a machine that never ran");
    std::fs::write(path.join(FILES[0]), "garbage").unwrap();
    let text = load(&path).unwrap_err().to_string();
    assert!(text.contains("retain.0: it is no file with retained values") && text.contains("move these files away"), "{text}");
    let description = br#"{"project":"p","places":[],"types":[]}"#;
    let good = crafted(1, [description.len() as u64, 0], description, b"");
    std::fs::write(path.join(FILES[1]), &good).unwrap();
    let loaded = load(&path).unwrap();
    assert_eq!((loaded.newest.map(|(g, file)| (g.number, file)), loaded.torn.map(|(_, d)| d)), (Some((1, 1)), Some(Defect::Foreign)));
    std::fs::write(path.join(FILES[0]), crafted(2, [0, 0], b"", b"")).unwrap();
    let text = load(&path).unwrap_err().to_string();
    assert!(text.contains("its format has version 2, this Takt reads version 1"), "a newer Takt wrote it: {text}");
    std::fs::remove_dir_all(path).unwrap();
}

/// Runs `new` from what `old` has stored after a scan.
#[track_caller]
fn taken_over(old: &str, new: &str) -> Machine {
    machine(new, from(&stored(old, 1), Reset::Warm)).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn changed(old: &str, new: &str, expected: &[(&str, &str)]) -> Migration {
    let machine = taken_over(&list(old), &list(new));
    for (path, literal) in expected {
        assert_eq!(machine.literal(path).as_deref(), Ok(*literal), "{path}");
    }
    machine.migration().unwrap().clone()
}

#[track_caller]
fn refused(old: &str, new: &str, expected: &str) {
    match machine(&list(new), from(&stored(&list(old), 1), Reset::Warm)) {
        Err(BuildError::Retain(refused)) => {
            let text = BuildError::Retain(refused).to_string();
            assert!(text.contains(expected) && text.contains("takt run --cold"), "{text}");
        }
        Err(other) => panic!("{other}"),
        Ok(machine) => panic!("{old} became {new}: {:?}", machine.migration().map(|m| &m.converted)),
    }
}

#[test]
fn what_is_the_same_is_silent() {
    let vars = "a : ARRAY [1..3] OF INT := [1, 2, 3]; s : STRING(9) := 'x'; t : TON;";
    let migration = changed(vars, vars, &[("a", "[1, 2, 3]"), ("s", "'x'")]);
    assert!(migration.is_silent() && migration.restore.complete);
}

#[test]
fn new_variables_start_with_their_initial_values_and_old_ones_are_told() {
    let old = "a : INT := 1; gone : INT := 5;";
    let migration = changed(old, "b : INT := 7; A : INT := 9; c : INT := b + 1;", &[("a", "1"), ("b", "7"), ("c", "8")]);
    assert_eq!((migration.added.join(" "), migration.removed, migration.restore.complete), ("main.b main.c".into(), vec![1], false));
}

#[test]
fn numbers_texts_and_times_are_converted_where_nothing_is_lost() {
    let old = "i : INT := -5; u : UINT := 60000; r : REAL := 0.1; l : LREAL := 2.5; s : STRING(20) := 'twelve bytes'; t : TIME := T#1m; b : BYTE := 16#80;";
    let new = "i : LINT; u : DINT; r : LREAL; l : REAL; s : STRING(12); t : LTIME; b : USINT;";
    let migration = changed(
        old,
        new,
        &[
            ("i", "-5"),
            ("u", "60000"),
            ("r", "0.10000000149011612"),
            ("l", "2.5"),
            ("s", "'twelve bytes'"),
            ("t", "LTIME#1m"),
            ("b", "128"),
        ],
    );
    assert_eq!(migration.converted.len(), 7);
    changed("x : LREAL := 3.0;", "x : INT;", &[("x", "3")]);
    changed("x : INT := 7;", "x : INT(0..10);", &[("x", "7")]);
    refused("x : INT := -5;", "x : UINT;", "main.x: -5 is no value of `UINT`");
    refused("x : DINT := 70000;", "x : INT;", "main.x: 70000 is no value of `INT`");
    refused("x : INT := 17;", "x : INT(0..10);", "main.x: 17 is no value of `INT(0..10)`");
    refused("x : LREAL := 0.1;", "x : REAL;", "main.x: 0.1 is no value of `REAL`");
    refused("x : LREAL := 2.5;", "x : INT;", "main.x: 2.5 is no value of `INT`");
    refused("x : LINT := 9007199254740993;", "x : LREAL;", "main.x: 9007199254740993 is no value of `LREAL`");
    refused("x : STRING(20) := 'twelve bytes';", "x : STRING(11);", "main.x: 'twelve bytes' is no value of `STRING(11)`");
    refused("x : LTIME := LTIME#1us;", "x : TIME;", "main.x: LTIME#1us is no value of `TIME`");
    refused("x : TIME := T#5s;", "x : DINT;", "main.x: a `TIME` does not become a `DINT`");
    refused("x : BOOL := TRUE;", "x : INT;", "main.x: a `BOOL` does not become a `INT`");
    refused("x : ARRAY [1..2] OF INT := [1, 300];", "x : ARRAY [1..2] OF USINT;", "main.x[2]: 300 is no value of `USINT`");
}

#[test]
fn arrays_go_by_their_bounds() {
    let migration = changed("a : ARRAY [1..3] OF INT := [1, 2, 3];", "a : ARRAY [2..5] OF INT := [4(9)];", &[("a", "[2, 3, 9, 9]")]);
    assert_eq!((migration.added, migration.dropped), (vec!["main.a[…] (2)".to_string()], vec!["main.a[…] (1)".to_string()]));
    changed("a : ARRAY [0..1, 0..1] OF INT := [1, 2, 3, 4];", "a : ARRAY [0..1, -1..1] OF DINT := [6(7)];", &[("a", "[7, 1, 2, 7, 3, 4]")]);
    refused("a : ARRAY [1..4] OF INT;", "a : ARRAY [1..2, 1..2] OF INT;", "does not become");
}

#[test]
fn structures_and_enumerations_go_by_names() {
    let with = |types: &str, vars: &str| format!("TYPE {types} END_TYPE\n{}", list(vars));
    let old = with(
        "S : STRUCT a : INT := 1; gone : REAL; b : STRING(3) := 'x'; END_STRUCT E : (off, slow := 5, fast);",
        "one : S; e1 : E := E.fast; e2 : E;",
    );
    let new = with(
        "S : STRUCT B : STRING(5); new : INT := 4; A : DINT; END_STRUCT E : (fast, off, other);",
        "one : S; e1 : E; e2 : E := E.other;",
    );
    let machine = taken_over(&old, &new);
    for (path, literal) in [("one", "(B := 'x', new := 4, A := 1)"), ("e1", "E.fast"), ("e2", "E.off")] {
        assert_eq!(machine.literal(path).as_deref(), Ok(literal));
    }
    let migration = machine.migration().unwrap();
    assert_eq!((migration.added.join(" "), migration.dropped.join(" ")), ("main.one.new".into(), "main.one.gone".into()));
    let gone = with("E : (fast, off);", "e1 : E;");
    let slow = with("E : (off, slow := 5, fast);", "e1 : E := E.slow;");
    let error = super::tests::machine(&gone, from(&stored(&slow, 1), Reset::Warm)).unwrap_err().to_string();
    assert!(error.contains("main.e1: E.slow is no value of `E`"), "{error}");
}

#[test]
fn a_larger_or_smaller_part_of_a_program_may_be_retained() {
    let configuration = |retain: &str, vars: &str| {
        format!(
            "CONFIGURATION c RESOURCE r ON cpu TASK t(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM {retain} p WITH t : main; END_RESOURCE END_CONFIGURATION\nPROGRAM main {vars} n := n + 1; END_PROGRAM"
        )
    };
    let whole = configuration("RETAIN", "VAR n : INT := 10; m : INT := 3; END_VAR");
    let part = configuration("", "VAR RETAIN n : INT := 1; END_VAR VAR m : INT := 1; END_VAR");
    let smaller = taken_over(&whole, &part);
    assert_eq!((smaller.number("main.n"), smaller.number("main.m")), (Ok(11.0), Ok(1.0)));
    assert_eq!(smaller.migration().unwrap().removed, [0], "all of it is put aside");
    let larger = taken_over(&part, &whole);
    assert_eq!((larger.number("main.n"), larger.number("main.m")), (Ok(2.0), Ok(3.0)));
    assert_eq!(larger.migration().unwrap().added, ["main.m"]);
}

#[test]
fn a_cold_start_asks_only_what_is_persistent() {
    let program = |ty: &str| {
        format!("VAR_GLOBAL RETAIN r : {ty} := 5; END_VAR VAR_GLOBAL PERSISTENT p : INT := 1; END_VAR PROGRAM main p := p + 1; END_PROGRAM")
    };
    let generation = stored(&program("DINT"), 3);
    assert!(machine(&program("BOOL := TRUE; x : INT"), from(&generation, Reset::Warm)).is_err());
    let cold = machine(&program("BOOL := TRUE; x : INT"), from(&generation, Reset::Cold)).unwrap();
    assert_eq!((cold.number("p"), cold.number("x")), (Ok(4.0), Ok(5.0)));
    assert!(cold.migration().unwrap().is_silent());
    let origin = machine(&program("DINT"), from(&generation, Reset::Origin)).unwrap();
    assert_eq!(origin.number("p"), Ok(1.0));
}

#[test]
fn a_block_that_owns_a_file_and_pointers_start_anew() {
    let program = "PROGRAM main VAR RETAIN r : ReadNCFile; x : INT; p : POINTER TO INT; q : INT; END_VAR
        x := x + 1; q := q + 1; p := ADR(x); END_PROGRAM";
    let mut again = taken_over(program, program);
    assert_eq!((again.number("main.x"), again.number("main.q"), again.number("main.p")), (Ok(1.0), Ok(1.0), Ok(0.0)));
    again.step();
    assert!(again.fault().is_none() && again.migration().unwrap().is_silent());
}
