//! What programs say to people: from ADSLOGSTR to whoever takes the messages between scans.

use std::sync::Arc;
use takt_abi::{MessageLevel, Time};
use takt_engine::{Engine, ExecutorKind, NoBus, Options};

fn started(source: &str, executor: ExecutorKind) -> Engine {
    let output = takt_tests::bench::compile(source);
    let program = output.program.unwrap_or_else(|| panic!("does not compile: {:?}", output.diagnostics));
    takt_engine::load(Arc::new(program), Options { executor, ..Options::default() }, Box::new(NoBus)).expect("loads")
}

fn taken(engine: &mut Engine) -> Vec<(i64, MessageLevel, String)> {
    let next = || engine.take_message().map(|m| (m.time.0 / 1_000_000, m.level, m.text.to_text().into_owned()));
    std::iter::from_fn(next).collect()
}

#[test]
fn messages_come_with_their_time_and_level_and_those_too_many_are_counted() {
    let source = "PROGRAM main VAR n, i : DINT; END_VAR
n := n + 1;
ADSLOGSTR(ADSLOG_MSGTYPE_HINT, 'scan', '');
ADSLOGDINT(ADSLOG_MSGTYPE_WARN OR ADSLOG_MSGTYPE_LOG, 'n = %d', n);
IF n = 2 THEN
    FOR i := 1 TO 300 DO ADSLOGLREAL(ADSLOG_MSGTYPE_ERROR, '%f', i); END_FOR
END_IF
END_PROGRAM";
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut engine = started(source, executor);
        engine.step(Time(0));
        let first = [(0, MessageLevel::Info, "scan".to_string()), (0, MessageLevel::Warning, "n = 1".to_string())];
        assert_eq!((taken(&mut engine), engine.lost_messages()), (first.to_vec(), 0));
        engine.step(Time::from_millis(10));
        let second = taken(&mut engine);
        assert_eq!((second.len(), engine.lost_messages(), engine.lost_messages()), (256, 46, 0));
        assert_eq!(second[255], (10, MessageLevel::Error, "254.000000".to_string()));
        assert_eq!(taken(&mut engine), []);
    }
}

#[test]
fn what_a_program_is_told_of_its_tasks_follows_their_scans() {
    let source = "PROGRAM fast VAR f : DINT; END_VAR f := GETCURTASKINDEXEX(); END_PROGRAM
PROGRAM slow VAR s, other : UDINT; first, late : BOOL; own : DINT; name : STRING; END_VAR
own := GETCURTASKINDEXEX();
s := _TaskInfo[own].CycleCount;
first := _TaskInfo[own].FirstCycle;
late := late OR _TaskInfo[own].CycleTimeExceeded;
name := _TaskInfo[own].TaskName;
other := _TaskInfo[1].CycleCount;
END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC
TASK quick(INTERVAL := T#5ms, PRIORITY := 0); TASK calm(INTERVAL := T#10ms, PRIORITY := 3);
PROGRAM a WITH quick : fast; PROGRAM b WITH calm : slow;
END_RESOURCE END_CONFIGURATION";
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut engine = started(source, executor);
        let value = |engine: &Engine, path: &str| {
            let place = takt_ir::resolve(engine.program(), path).expect("a variable");
            takt_ir::format_value(&engine.program().types, place.ty, engine.read(place))
        };
        let all =
            |engine: &Engine| ["slow.s", "slow.first", "slow.late", "slow.own", "slow.name", "slow.other"].map(|path| value(engine, path));
        engine.step(Time(0));
        assert_eq!(all(&engine), ["1", "TRUE", "FALSE", "2", "'calm'", "1"]);
        engine.step(Time::from_millis(5));
        engine.step(Time::from_millis(10));
        assert_eq!(all(&engine), ["2", "FALSE", "FALSE", "2", "'calm'", "3"]);
        engine.step(Time::from_millis(50));
        assert_eq!(all(&engine)[..3], ["3", "FALSE", "TRUE"]);
    }
}
