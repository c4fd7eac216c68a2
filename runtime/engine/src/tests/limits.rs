//! Limits of tasks under a real clock: watchdog, sensitivity, overruns, alarms, events and freewheeling tasks.

use super::*;
use std::cell::RefCell;
use std::ptr::NonNull;
use std::rc::Rc;
use std::sync::atomic::AtomicU32;

fn real(limits: Limits) -> Options {
    CLOCK.set(0);
    Options { clock: Clock::Real(ticking), limits, ..Options::default() }
}

fn watched(ns: i64, sensitivity: u32) -> Limits {
    Limits { watchdog: Time(ns), sensitivity, ..Limits::default() }
}

/// One task that starts at 0, as its own clock ticks.
fn one(body: &str) -> String {
    format!("task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256\n{body}")
}

fn fault(engine: &Engine) -> Option<(Fault, &str, u64)> {
    engine.fault().map(|record| (record.fault, record.task.as_str(), record.cycle))
}

#[test]
fn a_single_scan_may_take_the_watchdog_times_its_sensitivity() {
    // Each look at the clock takes 10 µs; a poll looks every 256 turns, three times.
    let text = one(&long("A", i64::MAX));
    both(
        &text,
        || real(watched(500_000, 1)),
        |mut engine| {
            engine.step(Time(0));
            let turns = number(&engine, PROGRESS);
            assert_eq!(fault(&engine), Some((Fault::Watchdog, "Main", 1)));
            let mut patient = load(program(&text), real(watched(500_000, 4)), Box::new(NoBus)).unwrap();
            patient.step(Time(0));
            assert_eq!(fault(&patient), Some((Fault::Watchdog, "Main", 1)));
            let ratio = f64::from(number(&patient, PROGRESS)) / f64::from(turns);
            assert!((3.5..4.5).contains(&ratio), "{ratio}");
        },
    );
}

#[test]
fn so_many_slow_scans_in_a_row_are_the_watchdog_too() {
    // 5000 turns: 20 polls, more than 400 µs and less than 900 µs.
    let text = one(&long("A", 5000));
    both(
        &text,
        || real(watched(300_000, 3)),
        |mut engine| {
            for n in 1..=3 {
                assert_eq!(fault(&engine), None, "before scan {n}");
                engine.step(engine.next_release());
            }
            assert_eq!(fault(&engine), Some((Fault::Watchdog, "Main", 3)));
            assert_eq!(number(&engine, PROGRESS), 5000, "the scan itself went to its end");
            engine.reset(Reset::Warm).unwrap();
            engine.step(engine.next_release());
            assert_eq!(fault(&engine), None, "a reset starts the count anew");
        },
    );
}

#[test]
fn a_watchdog_replaces_the_limit_of_fuel_on_a_machine() {
    let text = one(&long("A", 300_000));
    let options = |watchdog| Options { fuel_limit: 100_000, ..real(watched(watchdog, 1)) };
    both(
        &text,
        || options(1_000_000_000),
        |mut engine| {
            engine.step(Time(0));
            assert_eq!(fault(&engine), None);
            let mut without = load(program(&text), options(0), Box::new(NoBus)).unwrap();
            without.step(Time(0));
            assert_eq!(fault(&without), Some((Fault::Watchdog, "Main", 1)));
        },
    );
}

#[test]
fn releases_missed_in_a_row_stop_the_application_where_that_is_asked_for() {
    let text = one(&mark("A", "v0 = const 1"));
    both(
        &text,
        || real(Limits { max_overruns: 3, ..Limits::default() }),
        |mut engine| {
            let mut now = 0;
            let mut step = |engine: &mut Engine, late: i64| {
                now += late;
                CLOCK.set(CLOCK.get().max(now));
                engine.step(Time(now));
            };
            step(&mut engine, 0);
            for late in [2_500_000, 2_500_000, 1_000_000, 2_500_000, 2_500_000] {
                step(&mut engine, late);
            }
            assert_eq!(fault(&engine), None, "a scan in time ends the row");
            step(&mut engine, 2_500_000);
            assert_eq!(fault(&engine), Some((Fault::Overruns { count: 3 }, "Main", 7)));
            assert_eq!(marks(&engine).len(), 6, "the scan that is too late does not run");
            let statistics = engine.statistics(0);
            assert!(statistics.overruns >= 6, "{}", statistics.overruns);
            assert!(statistics.jitter_ns.max() >= 1_500_000 && statistics.jitter_ns.count() == 7);
        },
    );
}

#[test]
fn limits_of_an_unknown_task_are_refused_by_name() {
    let text = one(&mark("A", "v0 = const 1"));
    let options = Options { task_limits: vec![("MAIN".into(), watched(1, 1)), ("Mian".into(), watched(1, 1))], ..Options::default() };
    let error = load(program(&text), options, Box::new(NoBus)).unwrap_err();
    assert_eq!(error.to_string(), "there is no task `Mian`; there are: Main");
}

/// What was asked of the alarm.
#[derive(Default)]
struct Asked {
    at: Vec<Time>,
    armed: bool,
}
struct Ring(Rc<RefCell<Asked>>);
impl Alarm for Ring {
    #[allow(unsafe_code, reason = "the flag of a test")]
    unsafe fn arm(&mut self, at: Time, flag: NonNull<AtomicU32>) {
        let mut asked = self.0.borrow_mut();
        asked.at.push(at);
        asked.armed = true;
        // SAFETY: the engine's promise. It rings at once, which is sooner than asked for.
        unsafe { flag.as_ref() }.store(1, std::sync::atomic::Ordering::Relaxed);
    }
    fn disarm(&mut self) {
        self.0.borrow_mut().armed = false;
    }
}

#[test]
fn an_alarm_is_asked_for_the_next_higher_release_and_the_watchdog() {
    let text = two_tasks(&mark("A", &format!("v0 = load.u8 image+{PROGRESS}")), &long("B", 100));
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let asked = Rc::new(RefCell::new(Asked::default()));
        let task_limits = vec![("Fast".into(), watched(900_000, 1))];
        let options = Options { executor, task_limits, alarm: Some(Box::new(Ring(asked.clone()))), ..real(Limits::default()) };
        let mut engine = load(program(&text), options, Box::new(NoBus)).unwrap();
        engine.step(Time(0));
        // The fast task has nobody above it: its watchdog. The slow one: the release of the fast one at 1 ms, and each turn polls.
        let asked = asked.borrow();
        assert!(asked.at[0] > Time(900_000) && asked.at[0] < Time(1_000_000), "{:?}", asked.at);
        assert!(asked.at.contains(&Time(1_000_000)), "{:?}", asked.at);
        assert!(asked.at.len() > 90 && !asked.armed, "{} {}", asked.at.len(), asked.armed);
        assert!(engine.preemptions().len() > 1, "{:?}", engine.preemptions());
        assert!(marks(&engine)[1] < 100, "the fast task ran within the slow one: {:?}", marks(&engine));
    }
}

#[test]
fn an_event_interrupts_at_a_poll() {
    // The long body sets PROGRESS, whose lowest byte is the event's variable: it rises in the first turn.
    let text = format!(
        "task \"Slow\" cyclic 3000000 priority 5 entry 0 stack 2048 256\ntask \"Event\" event {PROGRESS} priority 0 entry 1 stack 2304 256\n{}{}",
        long("A", 600),
        mark("B", &format!("v0 = load.i32 image+{PROGRESS}"))
    );
    both(
        &text,
        || real(Limits::default()),
        |mut engine| {
            engine.step(Time(0));
            assert_eq!((engine.statistics(0).preempted, engine.statistics(1).cycles), (1, 1));
            // At the poll behind 256 units: 257 as a byte.
            assert_eq!(marks(&engine), [1]);
        },
    );
}

#[test]
fn a_freewheeling_task_leaves_half_of_the_time_to_lower_ones() {
    let text = format!(
        "task \"Free\" freewheeling priority 0 entry 0 stack 2048 256\ntask \"Low\" cyclic 1000000 priority 5 entry 1 stack 2304 256\n{}{}",
        long("A", 100_000),
        mark("B", "v0 = const 2")
    );
    both(
        &text,
        || real(Limits::default()),
        |mut engine| {
            for _ in 0..5 {
                engine.step(engine.next_release().max(ticking()));
            }
            let free = engine.statistics(0);
            assert_eq!(free.overruns, 0, "nobody waits for it");
            assert!(marks(&engine).len() as u64 >= free.cycles, "{:?} {}", marks(&engine), free.cycles);
        },
    );
}

#[test]
fn statistics_start_anew_and_the_scans_keep_their_numbers() {
    let text = two_tasks(&mark("A", "v0 = const 1"), &long("B", 2000));
    both(
        &text,
        || real(Limits::default()),
        |mut engine| {
            engine.step(Time(0));
            assert!(engine.statistics(1).jitter_ns.count() > 0 && engine.statistics(1).fuel_max > 0);
            let cycles = engine.cycles();
            engine.reset_statistics();
            let statistics = engine.statistics(1);
            assert_eq!((statistics.jitter_ns.count(), statistics.fuel_max, statistics.preempted), (0, 0, 0));
            assert_eq!(engine.cycles(), cycles);
        },
    );
}

#[test]
fn an_observer_sees_each_scan_those_within_others_too() {
    type Seen = Vec<(usize, i32, Option<u64>)>;
    struct Look(Rc<RefCell<Seen>>);
    impl Observer for Look {
        fn scanned(&mut self, scan: &mut Scanned<'_>) {
            let progress = i32::from_le_bytes(scan.read(place(PROGRESS, 1)).try_into().unwrap());
            let condition = scan.evaluate(BodyId(2)).map(Result::unwrap);
            assert_eq!(scan.read(place(4095, 1)), []);
            self.0.borrow_mut().push((scan.task(), progress, condition));
        }
    }
    let condition = format!(
        "body \"C\" () -> i64 frame 0 @1\n  local i64, i64\nb0:\n  v0 = load.i32 image+{PROGRESS}\n  v1 = const 50\n  v0 = lt v1, v0\n  return v0\n"
    );
    let text = format!("{}{condition}", two_tasks(&mark("A", "v0 = const 1"), &long("B", 100)));
    let options = || Options { preempt: vec![Preemption { cycle: 1, task: 1, at_fuel: 40 }], ..Options::default() };
    both(&text, options, |mut engine| {
        let seen = Rc::new(RefCell::new(Seen::new()));
        assert!(engine.observe(Some(Box::new(Look(seen.clone())))).is_none());
        engine.step(Time(0));
        assert_eq!(*seen.borrow(), [(0, 0, Some(0)), (0, 40, Some(0)), (1, 100, Some(1))]);
        engine.observe(None);
        engine.step(engine.next_release());
        assert_eq!(seen.borrow().len(), 3);
    });
}
