//! Direct addresses as keys of `[io]`, and how their numbers count.

use super::*;

const ADDRESSES: &str = "VAR_GLOBAL
    lamp AT %QX0.3 : BOOL;
    level AT %ID1 : REAL;
END_VAR
FUNCTION_BLOCK Pump
VAR key AT %I* : BOOL; motor AT %Q* : BOOL; END_VAR
motor := key;
END_FUNCTION_BLOCK
PROGRAM PLC_PRG
VAR pump : Pump; word : WORD; END_VAR
pump();
lamp := %IX0.1 AND level > 2.0;
%QW3 := 16#1234;
word := %QW3;
END_PROGRAM
";
const WIRED: &str = "[project]
addressing = \"word\"
[io]
\"%IX0.1\" = \"sim/start\"
\"%QX0.3\" = { channel = \"sim/lamp\", safe = false }
\"%QX9.0\" = \"sim/spare\"
\"GVL.level\" = \"sim/oil\"
\"PLC_PRG.pump.key\" = \"sim/start\"
\"PLC_PRG.pump.motor\" = \"sim/motor\"
[sim]
inputs = { start = true }
analog = { oil = 2.5 }
outputs = [\"lamp\", \"motor\", \"spare\"]
[simulation]
timeout = \"1s\"
done = \"%QX0.3 AND PLC_PRG.word = 16#1234\"
[report]
lines = [ { label = \"Lamp\", value = \"lamp\" }, { label = \"Word\", value = \"%QW3\" } ]
";

fn wired(manifest: &str) -> Project {
    let source = Source { name: "GVL.st".into(), text: ADDRESSES.into() };
    Project { sources: Sources { list: vec![source], ..Sources::default() }, ..project(manifest, "") }
}

fn run(manifest: &str) -> Machine {
    let mut machine = Machine::new(&wired(manifest), Setup::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(machine.run(Time(i64::MAX), |_| {}), Some(End::Done));
    machine
}

#[test]
fn addresses_are_wired_shown_and_set_as_they_are_written() {
    let mut machine = run(WIRED);
    assert_eq!((machine.bus().control.bit("lamp"), machine.bus().control.bit("motor")), (Some(true), Some(true)));
    assert_eq!(machine.bus().control.bit("spare"), Some(false));
    assert_eq!(machine.literal("GVL.lamp"), Ok("TRUE".into()));
    assert_eq!(machine.literal("%QB6"), Ok("16#34".into()));
    assert_eq!(machine.literal("%id1"), Ok("16#40200000".into()));
    machine.set("%QX0.4", "TRUE").unwrap();
    machine.set("lamp", "FALSE").unwrap();
    assert_eq!(machine.literal("%QB0"), Ok("16#10".into()));
    assert_eq!(machine.number("lamp"), Ok(0.0));
    assert!(machine.set("%QB99", "1").unwrap_err().to_string().contains("the program has nothing at `%QB99`"));
}

#[test]
fn numbers_of_addresses_count_in_bytes_if_the_project_says_so() {
    let machine = run(&WIRED.replace("\"word\"", "\"byte\""));
    assert_eq!(machine.literal("%QB3"), Ok("16#34".into()));
    assert_eq!(machine.literal("%ID1"), Ok("16#40200000".into()));
    assert_eq!(machine.literal("%IB1"), Ok("16#0".into()));
}

#[test]
fn without_a_word_on_it_files_of_twincat_count_in_bytes() {
    let mut sources = wired(WIRED).sources;
    assert!(!sources.are_twincat());
    sources.list[0].name = "plc/GVL.TcGVL".into();
    assert!(sources.are_twincat());
}

#[test]
fn a_wired_address_that_is_none_has_its_place() {
    let refused = |old: &str, new: &str| Machine::new(&wired(&WIRED.replace(old, new)), Setup::default()).expect_err("refused").to_string();
    let error = refused("%QX9.0", "%QX9.16");
    assert!(error.contains("takt.toml:6:1: `%QX9.16` is not an address: there is no bit 16: bits are numbered 0 to 15 here"), "{error}");
    let error = refused("%QX9.0", "%QW9");
    assert!(error.contains("the variable is `WORD`, the channel takes a BOOL"), "{error}");
    let error = crate::manifest::read("takt.toml", "[project]\naddressing = \"words\"\n").expect_err("refused").to_string();
    assert!(error.contains("takt.toml:2:14: `addressing` in [project] must be \"word\" or \"byte\""), "{error}");
}
