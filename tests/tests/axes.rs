//! Axes from end to end: motion blocks in ST, the axis stage, simulated drives. And what a bus cycle costs.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::time::Instant;
use takt_abi::{AxisRef, AxisState, Fault, Plain, SmcError};
use takt_engine::{AxisConfig, AxisLimits, DriveState, Encoder, Engine, ExecutorKind, Home, Options};
use takt_io::sim::{self, DriveConfig, SimConfig, SimControl, Switches};
use takt_ir::{Program, resolve};

/// Counts the allocations of each thread.
struct Counting;
thread_local!(static ALLOCATIONS: Cell<u64> = const { Cell::new(0) });

#[allow(unsafe_code, reason = "an allocator that counts; a test cannot see allocations otherwise")]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SOURCE: &str = "
VAR_GLOBAL
    A1, A2, A3, A4, A5 : AXIS_REF_SM3;
    U : ARRAY[1..5] OF Unit;
    On, Start, Home, Move, Reset, Halt : BOOL;
    Target : LREAL;
    Index : INT := 1;
    Field : ARRAY[0..3] OF INT;
END_VAR

FUNCTION_BLOCK Unit
VAR_INPUT Factor : LREAL; END_VAR
VAR_IN_OUT Axis : AXIS_REF_SM3; END_VAR
VAR
    Power : MC_Power;
    Homing : MC_Home;
    Going : MC_MoveAbsolute;
    Clearing : MC_Reset;
    Halting : MC_Stop;
END_VAR
Power(Axis := Axis, Enable := TRUE, bRegulatorOn := On, bDriveStart := Start);
Clearing(Axis := Axis, Execute := Reset);
Homing(Axis := Axis, Execute := Home, Position := 5.0);
Going(Axis := Axis, Execute := Move, Position := 5.0 + Target * Factor, Velocity := 100.0 * Factor, Acceleration := 1000.0 * Factor,
    Deceleration := 1000.0 * Factor, Jerk := 20000.0 * Factor);
Halting(Axis := Axis, Execute := Halt, Deceleration := 2000.0, Jerk := 100000.0);
END_FUNCTION_BLOCK

PROGRAM Main
U[1](Axis := A1, Factor := 1.0);
U[2](Axis := A2, Factor := 0.9);
U[3](Axis := A3, Factor := 0.5);
U[4](Axis := A4, Factor := 0.25);
U[5](Axis := A5, Factor := 0.1);
Field[Index] := 1;
END_PROGRAM

CONFIGURATION Plant
    RESOURCE Cpu ON Linux
        TASK Bus(INTERVAL := T#1ms, PRIORITY := 0);
        PROGRAM P WITH Bus : Main;
    END_RESOURCE
END_CONFIGURATION
";

struct Machine {
    engine: Engine,
    control: SimControl,
}

fn program() -> Arc<Program> {
    let output = takt_tests::bench::compile(SOURCE);
    let messages: Vec<_> = output.diagnostics.iter().map(|d| d.message.clone()).collect();
    Arc::new(output.program.unwrap_or_else(|| panic!("{messages:?}")))
}

impl Machine {
    fn new(executor: ExecutorKind, stopwatch: Option<fn() -> u64>) -> Self {
        let program = program();
        let limits =
            AxisLimits { negative: -100.0, positive: 100.0, velocity: 200.0, acceleration: 2000.0, deceleration: 2000.0, jerk: 1e5 };
        let home = Home { method: 17, fast: 100.0, slow: 5.0, offset: 0.0 };
        let axis = |i: usize| {
            let place = resolve(&program, &format!("A{}", i + 1)).expect("declared");
            AxisConfig {
                limits,
                home,
                increments_per_unit: 1e4,
                invert: i == 1,
                encoder: Encoder::Incremental,
                ..AxisConfig::new(&format!("A{}", i + 1), place, i)
            }
        };
        let drive = |i: usize| DriveConfig {
            increments_per_unit: 1e4,
            invert: i == 1,
            start: 3.0 + i as f64,
            encoder: Encoder::Incremental,
            velocity: 250.0,
            acceleration: 2000.0,
            deceleration: 4000.0,
            lag: 5.0,
            travel: Some((-60.0, 110.0)),
            switches: Switches { negative: Some(-50.0), positive: Some(105.0), home: None },
            home,
            ..DriveConfig::new(&format!("A{}", i + 1))
        };
        let config = SimConfig { drives: (0..5).map(drive).collect(), ..SimConfig::default() };
        let (driver, control) = sim::open(&config).expect("a good segment");
        let options = Options { executor, axes: (0..5).map(axis).collect(), stopwatch, ..Options::default() };
        Self { engine: takt_engine::load(program, options, driver).expect("a good program"), control }
    }
    fn set(&mut self, name: &str, bytes: &[u8]) {
        let place = resolve(self.engine.program(), name).expect("declared");
        self.engine.write(place, bytes).expect("inside");
    }
    fn run(&mut self, n: usize) {
        for _ in 0..n {
            let at = self.engine.next_release();
            self.engine.step(at);
        }
    }
    fn axis(&self, i: usize) -> AxisRef {
        let place = resolve(self.engine.program(), &format!("A{i}")).expect("declared");
        AxisRef::load(self.engine.read(place))
    }
    fn states(&self) -> Vec<AxisState> {
        (1..=5).map(|i| self.axis(i).nAxisState).collect()
    }
    /// Switched on and homed: each axis is 5 at its reference -50 of the mechanics.
    fn homed(executor: ExecutorKind) -> Self {
        let mut m = Self::new(executor, None);
        m.set("On", &[1]);
        m.set("Start", &[1]);
        m.run(10);
        assert_eq!(m.states(), [AxisState::standstill; 5]);
        m.set("Home", &[1]);
        m.run(4000);
        assert_eq!(m.states(), [AxisState::standstill; 5]);
        m.set("Home", &[0]);
        m
    }
    fn start_move(&mut self, target: f64) {
        self.set("Target", &target.to_le_bytes());
        self.set("Move", &[0]);
        self.run(1);
        self.set("Move", &[1]);
    }
    /// Where the mechanics really are, on the axis' own scale.
    fn really(&self, i: usize) -> f64 {
        self.control.mechanics(i - 1).expect("a drive").0 + 55.0
    }
}

const FACTORS: [f64; 5] = [1.0, 0.9, 0.5, 0.25, 0.1];

#[test]
fn axes_home_and_move_to_where_they_are_told() {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut m = Machine::homed(executor);
        for target in [60.0, 2.0, 33.3] {
            m.start_move(target);
            m.run(2000);
            for (i, factor) in (1..=5).zip(FACTORS) {
                let axis = m.axis(i);
                assert!(axis.bHomed.get() && (axis.fActPosition - 5.0 - target * factor).abs() < 2e-4, "A{i}: {}", axis.fActPosition);
                assert!((m.really(i) - 5.0 - target * factor).abs() < 2e-4, "A{i} is really at {}", m.really(i));
                assert_eq!(axis.nAxisState, AxisState::standstill);
            }
        }
        assert!(m.engine.fault().is_none());
    }
}

#[test]
fn both_executors_move_the_same_machine_to_the_last_bit() {
    let image = |executor| {
        let mut m = Machine::homed(executor);
        m.start_move(60.0);
        m.run(300);
        m.engine.image().to_vec()
    };
    let (a, b) = (image(ExecutorKind::Interpreter), image(ExecutorKind::Jit));
    let stack = program().tasks[0].stack.0 as usize;
    assert!(a[..stack] == b[..stack]);
}

#[test]
fn quick_stop_and_power_off_stop_all_axes_without_an_error() {
    let mut m = Machine::homed(ExecutorKind::Jit);
    m.start_move(60.0);
    m.run(300);
    m.set("Start", &[0]);
    m.run(100);
    assert!((0..5).all(|i| m.control.mechanics(i).expect("a drive").1.abs() < 1e-3));
    assert_eq!(m.states(), [AxisState::power_off; 5]);
    m.set("On", &[0]);
    m.run(10);
    assert!(m.engine.at_rest() && (1..=5).all(|i| !m.axis(i).bError.get()));
    m.set("On", &[1]);
    m.set("Start", &[1]);
    m.run(10);
    m.start_move(60.0);
    m.run(2000);
    assert!((m.axis(1).fActPosition - 65.0).abs() < 2e-4);
}

#[test]
fn a_drive_that_loses_its_supply_is_reset_and_goes_on() {
    let mut m = Machine::homed(ExecutorKind::Jit);
    m.start_move(60.0);
    m.run(300);
    m.control.lose_power(1).expect("a drive");
    m.run(200);
    let axis = m.axis(2);
    assert_eq!(
        (axis.nAxisState, axis.dwErrorID.0, axis.uiDriveInterfaceError),
        (AxisState::errorstop, SmcError::SMC_DI_VOLTAGE_DISABLED.0 as u32, 0x3220)
    );
    assert_eq!(m.axis(1).nAxisState, AxisState::discrete_motion, "what the others do is the program's business");
    m.set("Reset", &[1]);
    m.run(1500);
    assert_eq!(m.axis(2).nAxisState, AxisState::errorstop, "the supply is still away");
    m.control.restore_power(1).expect("a drive");
    m.set("Reset", &[0]);
    m.run(1);
    m.set("Reset", &[1]);
    m.run(20);
    assert_eq!(m.axis(2).nAxisState, AxisState::standstill);
    m.start_move(20.0);
    m.run(2000);
    assert!((m.really(2) - 23.0).abs() < 2e-4);
}

#[test]
fn a_blocked_axis_trips_and_homing_without_a_switch_fails() {
    let mut m = Machine::homed(ExecutorKind::Jit);
    m.control.block(0, true).expect("a drive");
    m.start_move(60.0);
    m.run(500);
    assert_eq!((m.axis(1).nAxisState, m.axis(1).dwErrorID.0), (AxisState::errorstop, SmcError::SMC_DI_POSITIONLAGERROR.0 as u32));
    let mut m = Machine::new(ExecutorKind::Jit, None);
    m.control.stick_home_switch(3, true).expect("a drive");
    m.set("On", &[1]);
    m.set("Start", &[1]);
    m.run(10);
    m.set("Home", &[1]);
    m.run(4000);
    assert_eq!((m.axis(4).nAxisState, m.axis(4).dwErrorID.0), (AxisState::errorstop, SmcError::SMC_DI_HOMING_ERROR.0 as u32));
    assert_eq!(m.axis(3).nAxisState, AxisState::standstill);
}

#[test]
fn a_fault_of_the_program_stops_five_moving_axes_on_their_line() {
    let mut m = Machine::homed(ExecutorKind::Jit);
    m.start_move(60.0);
    m.run(300);
    let places = |m: &Machine| (1..=5).map(|i| m.axis(i).fSetPosition).collect::<Vec<_>>();
    m.set("Index", &9i16.to_le_bytes());
    let before = places(&m);
    m.run(1);
    assert_eq!(m.engine.fault().expect("a fault").fault, Fault::Index { value: 9, low: 0, high: 3 });
    for _ in 0..200 {
        m.run(1);
        let gone: Vec<f64> = places(&m).iter().zip(&before).map(|(a, b)| a - b).collect();
        assert!(gone.iter().zip(FACTORS).all(|(g, f)| (g - gone[0] * f).abs() < 0.02), "{gone:?}");
        if m.engine.at_rest() {
            break;
        }
    }
    assert!(
        m.engine.at_rest() && m.engine.axes().all(|a| a.drive == DriveState::SwitchOnDisabled || a.drive == DriveState::ReadyToSwitchOn)
    );
    m.engine.reset(takt_engine::Reset::Warm).expect("starts again");
    m.run(10);
    assert_eq!(m.states(), [AxisState::power_off; 5]);
    assert!(m.axis(1).bHomed.get() && (m.axis(1).fActPosition - m.really(1)).abs() < 2e-4, "the reference outlives the fault");
}

#[test]
fn a_step_allocates_nothing() {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let mut m = Machine::homed(executor);
        m.start_move(60.0);
        let before = ALLOCATIONS.with(Cell::get);
        m.run(3000);
        assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
    }
}

/// Not a gate: shows what a bus cycle of five axes costs with the simulation, and how much of it are the blocks.
#[test]
fn a_bus_cycle_of_five_axes_is_measured() {
    let mut m = Machine::homed(ExecutorKind::Jit);
    for moving in [false, true] {
        if moving {
            m.start_move(60.0);
        }
        let start = Instant::now();
        m.run(1000);
        let whole = start.elapsed().as_secs_f64() * 1e3;
        println!("five axes, moving: {moving}: {whole:.2} µs per bus cycle");
    }
}
