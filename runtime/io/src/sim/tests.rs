//! The segment as a master sees it: controlwords in, statuswords out, and the mechanics beside.

use super::*;
use takt_engine::{DriveOut, DriveState, Encoder, Home};

const MS: i64 = 1_000_000;

struct Master {
    bus: Box<dyn IoDriver>,
    io: ProcessImage,
    control: SimControl,
    now: Time,
}

impl Master {
    fn new(config: SimConfig) -> Self {
        let (bus, control) = open(&config).unwrap();
        let io = ProcessImage::new(bus.size());
        let mut master = Self { bus, io, control, now: Time(0) };
        master.run(1);
        master
    }
    fn with(drive: DriveConfig) -> Self {
        Self::new(SimConfig { drives: vec![drive], ..SimConfig::default() })
    }
    /// A drive in operation, mode 8, standing.
    fn on(drive: DriveConfig) -> Self {
        let mut m = Self::with(drive);
        for word in [0x06, 0x07, 0x0F] {
            m.tell(word, 8);
        }
        assert_eq!(m.state(), DriveState::OperationEnabled);
        m
    }
    fn run(&mut self, n: usize) {
        for _ in 0..n {
            self.bus.exchange(self.now, &mut self.io).unwrap();
            self.now.0 += MS;
        }
    }
    fn out(&mut self) -> &mut DriveOut {
        &mut self.io.drives_out[0]
    }
    /// A controlword, with the target where the axis is.
    fn tell(&mut self, word: u16, mode: i8) {
        let position = self.io.drives_in[0].position;
        let out = self.out();
        (out.control_word, out.mode, out.position) = (word, mode, position);
        self.run(1);
    }
    fn state(&self) -> DriveState {
        DriveState::of(self.io.drives_in[0].status_word)
    }
    fn status(&self, bit: u32) -> bool {
        self.io.drives_in[0].status_word & 1 << bit != 0
    }
    /// Follows a target that moves by so many increments per cycle.
    fn follow(&mut self, by: i64, n: usize) {
        for _ in 0..n {
            self.out().position += by;
            self.run(1);
        }
    }
    fn position(&self) -> f64 {
        self.control.mechanics(0).unwrap().0
    }
    /// Homing to its end, at most 100 s: attained, failed.
    fn home(&mut self) -> (bool, bool) {
        self.tell(0x0F, 6);
        self.tell(0x1F, 6);
        for _ in 0..100_000 {
            self.run(1);
            if self.status(13) || self.status(12) && self.status(10) {
                break;
            }
        }
        (self.status(12), self.status(13))
    }
}

fn drive() -> DriveConfig {
    DriveConfig {
        travel: Some((-110.0, 110.0)),
        switches: Switches { negative: Some(-100.0), positive: Some(100.0), home: Some(20.0) },
        home: Home { method: 17, fast: 50.0, slow: 2.0, offset: 0.0 },
        index: Index { position: 1.0, spacing: 5.0 },
        velocity: 500.0,
        acceleration: 5000.0,
        deceleration: 5000.0,
        ..DriveConfig::new("D1")
    }
}

fn with_method(method: i8) -> DriveConfig {
    let mut d = drive();
    d.home.method = method;
    d
}

#[test]
fn each_homing_method_ends_at_its_reference() {
    // Method, start, reference.
    for (method, start, reference) in [
        (1, 30.0, -99.0),
        (2, 30.0, 96.0),
        (17, 30.0, -100.0),
        (17, -105.0, -100.0),
        (18, -30.0, 100.0),
        (21, 60.0, 20.0),
        (21, -50.0, 20.0),
        (23, -60.0, 20.0),
        (23, 60.0, 20.0),
        (33, 3.0, 1.0),
        (33, 1.0, 1.0),
        (34, 3.0, 6.0),
        (35, 3.25, 3.25),
        (37, -7.5, -7.5),
    ] {
        for invert in [false, true] {
            for encoder in [Encoder::Absolute, Encoder::Incremental] {
                let mut m = Master::on(DriveConfig { start, invert, encoder, ..with_method(method) });
                assert_eq!(m.home(), (true, false), "method {method} from {start}");
                let sign = if invert { -1.0 } else { 1.0 };
                let counted = m.io.drives_in[0].position as f64 * sign / 1000.0;
                assert!(
                    (m.position() - reference - counted).abs() < 1e-3,
                    "method {method} from {start}: at {} the drive counts {counted}",
                    m.position()
                );
                assert!((m.position() - reference).abs() < 0.1);
                m.tell(0x0F, 8);
                m.follow((-10.0 * sign * reference.signum()) as i64, 10);
                assert_eq!(m.state(), DriveState::OperationEnabled);
            }
        }
    }
}

#[test]
fn homing_gives_up_when_the_reference_never_comes() {
    for method in [1, 2, 17, 18, 21, 23, 33, 34] {
        let mut m = Master::on(with_method(method));
        m.control.stick_home_switch(0, true).unwrap();
        assert_eq!(m.home(), (false, true), "method {method}");
        m.run(200);
        assert!(m.control.mechanics(0).unwrap().1.abs() < 1e-6);
        m.control.stick_home_switch(0, false).unwrap();
        m.tell(0x0F, 8);
        let back = if m.position() < 0.0 { 50 } else { -50 };
        m.follow(back, 300);
        assert_eq!(m.home(), (true, false), "method {method} once the switch works again");
    }
}

#[test]
fn homing_is_refused_when_both_limit_switches_are_stuck_on() {
    let mut m = Master::on(with_method(21));
    m.control.stick(0, Switch::Negative, Some(true)).unwrap();
    m.control.stick(0, Switch::Positive, Some(true)).unwrap();
    let before = m.position();
    assert_eq!((m.home(), m.position()), ((false, true), before));
    let mut m = Master::on(with_method(17));
    m.control.stick(0, Switch::Negative, Some(true)).unwrap();
    assert_eq!(m.home(), (false, true), "a switch that stays on is never left");
}

#[test]
fn homing_ends_when_the_start_bit_falls() {
    let mut m = Master::on(with_method(17));
    m.tell(0x0F, 6);
    m.tell(0x1F, 6);
    m.run(200);
    assert!(m.control.mechanics(0).unwrap().1 < -10.0);
    m.tell(0x0F, 6);
    m.run(200);
    assert!(m.control.mechanics(0).unwrap().1.abs() < 1e-6 && !m.status(12) && !m.status(13));
}

#[test]
fn velocity_feed_forward_removes_the_following_error() {
    for (ahead, expected) in [(0, 0.9 * 2.0 * 100.0 / (std::f64::consts::TAU * 40.0)), (100_000, 0.0)] {
        let mut m = Master::on(drive());
        m.out().velocity_offset = ahead;
        m.follow(100, 300);
        let lag = f64::from(m.io.drives_in[0].following_error) / 1000.0;
        assert!((lag - expected).abs() < 2e-3, "{lag} instead of {expected}");
        assert!((f64::from(m.io.drives_in[0].velocity) / 1000.0 - 100.0).abs() < 0.01);
    }
}

#[test]
fn quick_stop_brakes_at_its_rate_and_holds() {
    let mut m = Master::on(drive());
    m.follow(100, 300);
    let from = m.position();
    m.tell(0x0B, 8);
    assert_eq!(m.state(), DriveState::QuickStopActive);
    m.run(200);
    assert_eq!(m.state(), DriveState::QuickStopActive);
    // v²/2d, and what the axis lagged behind.
    let lag = 0.9 * 2.0 * 100.0 / (std::f64::consts::TAU * 40.0);
    assert!((m.position() - from - 1.0 - lag).abs() < 0.15, "{}", m.position() - from);
    m.tell(0x0F, 8);
    assert_eq!(m.state(), DriveState::OperationEnabled);
}

#[test]
fn speed_is_limited_and_a_blocked_axis_trips() {
    let mut m = Master::on(DriveConfig { lag: 2.0, travel: None, ..drive() });
    m.out().position = 90_000;
    m.run(100);
    let speed = m.control.mechanics(0).unwrap().1;
    assert!(speed <= 501.0 || m.state() == DriveState::Fault, "{speed}");
    let mut m = Master::on(DriveConfig { lag: 2.0, ..drive() });
    m.control.block(0, true).unwrap();
    m.follow(50, 60);
    assert_eq!((m.state(), m.io.drives_in[0].error_code), (DriveState::Fault, 0x8611));
}

#[test]
fn a_fault_is_reset_by_a_rising_edge_only() {
    let mut m = Master::on(drive());
    m.control.fail_drive(0, 0x4310).unwrap();
    m.tell(0x80, 8);
    m.run(50);
    assert_eq!((m.state(), m.io.drives_in[0].error_code), (DriveState::Fault, 0x4310), "the edge came before the fault was complete");
    m.tell(0x00, 8);
    m.tell(0x80, 8);
    assert_eq!((m.state(), m.io.drives_in[0].error_code), (DriveState::SwitchOnDisabled, 0));
}

#[test]
fn without_supply_a_drive_coasts_to_rest_and_cannot_be_reset() {
    let mut m = Master::on(drive());
    m.follow(100, 300);
    m.control.lose_power(0).unwrap();
    m.run(100);
    assert_eq!((m.state(), m.io.drives_in[0].error_code, m.control.mechanics(0).unwrap().1), (DriveState::Fault, 0x3220, 0.0));
    let reset = |m: &mut Master| {
        m.tell(0x00, 8);
        m.tell(0x80, 8);
        m.state()
    };
    assert_eq!(reset(&mut m), DriveState::Fault);
    m.control.restore_power(0).unwrap();
    assert_eq!(reset(&mut m), DriveState::SwitchOnDisabled);
    assert_eq!(m.control.drag(0, 3.0), Ok(true));
    let mut m = Master::on(drive());
    assert_eq!(m.control.drag(0, 3.0), Ok(false));
    m.control.set_online(0, false).unwrap();
    m.run(1);
    assert!(!m.io.drives_in[0].online);
}

#[test]
fn limit_switches_stop_the_way_out_and_free_the_way_back() {
    let mut m = Master::on(DriveConfig { start: 95.0, ..drive() });
    m.follow(100, 80);
    assert_eq!((m.state(), m.io.drives_in[0].error_code), (DriveState::Fault, 0x8612));
    assert!(m.position() < 105.0 && m.io.drives_in[0].digital_inputs & 2 != 0);
    for word in [0x00, 0x80, 0x06, 0x07, 0x0F] {
        m.tell(word, 8);
    }
    m.follow(-100, 80);
    assert_eq!(m.state(), DriveState::OperationEnabled);
    assert!(m.position() < 100.0);
}

#[test]
fn the_axis_stops_at_its_mechanical_end() {
    let mut m = Master::on(DriveConfig { switches: Switches::default(), start: 105.0, home: Home::default(), ..drive() });
    m.follow(100, 200);
    assert_eq!(m.control.mechanics(0), Ok((110.0, 0.0)));
}

#[test]
fn mode_9_follows_a_velocity() {
    let mut m = Master::on(drive());
    m.tell(0x0F, 9);
    m.out().velocity = -20_000;
    m.run(300);
    assert!((m.control.mechanics(0).unwrap().1 + 20.0).abs() < 0.01);
    m.out().control_word = 0x10F;
    m.run(300);
    assert!(m.control.mechanics(0).unwrap().1.abs() < 1e-6);
}

fn terminals() -> SimConfig {
    SimConfig {
        inputs: vec![("estop".into(), true), ("air".into(), true)],
        analog: vec![("temperature".into(), 23.5)],
        outputs: vec!["lamp".into()],
        analog_outputs: vec!["regulator".into()],
        valve: Some(ValveConfig { open_delay: Time(2 * MS), close_delay: Time(3 * MS), pressure: 4.0, air: Some("air".into()) }),
        ..SimConfig::default()
    }
}

#[test]
fn terminals_are_found_by_name_and_set_from_outside() {
    let mut m = Master::new(terminals());
    let names: Vec<_> = m.control.channels().into_iter().map(|(n, _)| n).collect();
    assert_eq!(names, ["estop", "air", "valve-open", "lamp", "valve", "temperature", "pressure", "regulator"]);
    assert_eq!(
        (m.control.channel("lamp"), m.control.channel("temperature"), m.control.channel("x")),
        (Some(Channel::BitOut(0)), Some(Channel::AnalogIn(0)), None)
    );
    m.run(1);
    assert_eq!((m.io.bits_in[0], m.io.analog_in[0]), (1, 23.5));
    m.control.set_input("estop", false).unwrap();
    m.control.set_analog("temperature", 99.0).unwrap();
    assert_eq!(m.control.set_input("button", true), Err(Unknown));
    (m.io.bits_out[0], m.io.analog_out[0]) = (1, 2.5);
    m.run(1);
    assert_eq!((m.io.bits_in[0], m.io.analog_in[0]), (0, 99.0));
    assert_eq!((m.control.bit("lamp"), m.control.analog("regulator")), (Some(true), Some(2.5)));
}

#[test]
fn the_valve_opens_and_closes_late_and_loses_short_commands() {
    let mut m = Master::new(terminals());
    let mut seen = Vec::new();
    for command in [1, 1, 1, 1, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0] {
        m.io.bits_out[1] = command;
        m.run(1);
        seen.push(m.io.bits_in[2]);
    }
    assert_eq!(seen, [0, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(m.control.valve_openings(), 1);
}

#[test]
fn pressure_decays_without_air() {
    let mut m = Master::new(terminals());
    m.run(100);
    assert!((m.io.analog_in[1] - 4.0).abs() < 1e-6);
    m.control.set_input("air", false).unwrap();
    m.run(500);
    assert!((m.io.analog_in[1] - 4.0 * libm::exp(-1.0)).abs() < 0.02);
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let refused = |config: SimConfig| open(&config).err().map(|e| e.to_string()).unwrap();
    let drive_with = |change: fn(&mut DriveConfig)| {
        let mut d = drive();
        change(&mut d);
        refused(SimConfig { drives: vec![d], ..SimConfig::default() })
    };
    assert_eq!(drive_with(|d| d.start = 500.0), "`D1`: `start` is 500, expected inside the travel");
    assert_eq!(drive_with(|d| d.bandwidth = f64::NAN), "`D1`: `bandwidth` is NaN, expected 0.1 to 1000 Hz");
    assert!(drive_with(|d| d.home.method = 3).contains("method 3 is not simulated"));
    assert_eq!(drive_with(|d| d.switches.negative = None), "`D1`: homing method 17 needs a negative limit switch");
    let mut twice = terminals();
    twice.outputs.push("pressure".into());
    assert_eq!(refused(twice), "two channels are called `pressure`");
    let mut airless = terminals();
    airless.inputs.pop();
    assert_eq!(refused(airless), "the valve's air `air` is no digital input of the simulation");
    assert_eq!(refused(SimConfig { period: Time(0), ..SimConfig::default() }), "the bus period must be more than 0");
}

#[test]
fn the_same_commands_give_the_same_machine() {
    let run = || {
        let mut m = Master::on(drive());
        (0..2000)
            .map(|k| {
                m.follow(if k % 7 < 4 { 90 } else { -110 }, 1);
                m.position().to_bits()
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}
