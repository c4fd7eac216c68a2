//! A servo drive with CiA 402 state machine (IEC 61800-7-201), modes 8, 9 and 6, limits, errors, and its axis.
//!
//! Inside, everything is in technical units in the direction of the axis, from the machine's zero; `invert` and scaling act at the bus only. The encoder's
//! zero is the machine's for an absolute encoder, the place at power-up for an incremental one, and the reference after homing.

use super::OpenError;
use super::homing::{Homing, METHODS, Method, Sight};
use super::plant::{Plant, toward};
use takt_engine::{DriveIn, DriveOut, DriveState, Encoder, Home};

/// Error codes (603F).
const UNDERVOLTAGE: u16 = 0x3220;
const FOLLOWING_ERROR: u16 = 0x8611;
const LIMIT_SWITCH: u16 = 0x8612;
/// Following error in a drive that does not watch it, after which homing counts as stalled; units per unit/s of speed.
const STALL_TIME: f64 = 0.2;

/// A switch of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Switch {
    /// Negative limit switch.
    Negative = 0,
    /// Positive limit switch.
    Positive = 1,
    /// Home switch.
    Home = 2,
}

/// Where switches act, technical units; `None`: there is none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Switches {
    /// Active at and below.
    pub negative: Option<f64>,
    /// Active at and above.
    pub positive: Option<f64>,
    /// Edge of the home cam.
    pub home: Option<f64>,
}

impl Switches {
    fn edge(&self, switch: Switch) -> Option<f64> {
        match switch {
            Switch::Negative => self.negative,
            Switch::Positive => self.positive,
            Switch::Home => self.home,
        }
    }
}

/// Index pulses of the encoder.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Index {
    /// Where one is, technical units.
    pub position: f64,
    /// From one to the next; 0: there is only one.
    pub spacing: f64,
}

impl Index {
    /// The first pulse on the way from `from` to `to`, ends included, in a direction.
    pub(super) fn crossed(&self, from: f64, to: f64, direction: f64) -> Option<f64> {
        let (low, high) = if from < to { (from, to) } else { (to, from) };
        let first = if self.spacing == 0.0 {
            self.position
        } else if direction < 0.0 {
            self.position + ((high - self.position) / self.spacing).floor() * self.spacing
        } else {
            self.position + ((low - self.position) / self.spacing).ceil() * self.spacing
        };
        (low <= first && first <= high && (to - from) * direction >= 0.0).then_some(first)
    }
}

/// A drive and its axis. Technical units (mm, degrees) and seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveConfig {
    /// For messages and [`super::SimControl::drive`].
    pub name: String,
    /// Increments per technical unit, > 0.
    pub increments_per_unit: f64,
    /// The drive counts against the axis.
    pub invert: bool,
    /// Where the axis stands at power-up.
    pub start: f64,
    /// Encoder.
    pub encoder: Encoder,
    /// The drive goes no faster.
    pub velocity: f64,
    /// Of its own motions (homing) and as torque 100 %.
    pub acceleration: f64,
    /// Of quick stop (6085) and of the brake without power.
    pub deceleration: f64,
    /// Following error that is a fault (6065); 0: not watched.
    pub lag: f64,
    /// Mechanical ends; `None`: it turns for ever.
    pub travel: Option<(f64, f64)>,
    /// Switches.
    pub switches: Switches,
    /// Index pulses.
    pub index: Index,
    /// Homing: method, fast, slow (the offset belongs to the engine).
    pub home: Home,
    /// Bandwidth of the position loop, Hz.
    pub bandwidth: f64,
    /// Its damping; 1 = no overshoot.
    pub damping: f64,
}

impl DriveConfig {
    /// An axis of 1000 units to either side, 1000 increments per unit, 1000 units/s, stiff.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.into(),
            increments_per_unit: 1000.0,
            invert: false,
            start: 0.0,
            encoder: Encoder::Absolute,
            velocity: 1000.0,
            acceleration: 10_000.0,
            deceleration: 10_000.0,
            lag: 0.0,
            travel: Some((-1000.0, 1000.0)),
            switches: Switches::default(),
            index: Index::default(),
            home: Home::default(),
            bandwidth: 40.0,
            damping: 0.9,
        }
    }

    fn check(&self) -> Result<Method, OpenError> {
        let positive = |v: f64| v.is_finite() && v > 0.0 && v <= 1e12;
        let finite = |v: f64| v.is_finite() && v.abs() <= 1e12;
        let (low, high) = self.travel.unwrap_or((-1e12, 1e12));
        let rules = [
            ("increments-per-unit", self.increments_per_unit, positive(self.increments_per_unit), "more than 0"),
            ("velocity", self.velocity, positive(self.velocity), "more than 0"),
            ("acceleration", self.acceleration, positive(self.acceleration), "more than 0"),
            ("deceleration", self.deceleration, positive(self.deceleration), "more than 0"),
            ("lag", self.lag, finite(self.lag) && self.lag >= 0.0, "0 or more"),
            ("travel", low, finite(low) && finite(high) && low < high, "a lower end below the upper one"),
            ("start", self.start, self.start >= low && self.start <= high, "inside the travel"),
            ("home.fast", self.home.fast, positive(self.home.fast), "more than 0"),
            ("home.slow", self.home.slow, positive(self.home.slow), "more than 0"),
            ("index", self.index.position, finite(self.index.position) && self.index.spacing >= 0.0, "a number, spacing 0 or more"),
            ("bandwidth", self.bandwidth, self.bandwidth >= 0.1 && self.bandwidth <= 1000.0, "0.1 to 1000 Hz"),
            ("damping", self.damping, self.damping >= 0.05 && self.damping <= 10.0, "0.05 to 10"),
        ];
        if let Some((key, value, _, expected)) = rules.into_iter().find(|r| !r.2) {
            return Err(OpenError::Range { of: self.name.clone(), key, value, expected });
        }
        let number = self.home.method;
        let method = Method::of(number)
            .filter(|_| METHODS.contains(&number))
            .ok_or_else(|| OpenError::Method { of: self.name.clone(), method: number })?;
        match method.switch {
            Some(switch) if self.switches.edge(switch).is_none() => {
                let needs = ["a negative limit switch", "a positive limit switch", "a home switch"][switch as usize];
                Err(OpenError::NoSwitch { of: self.name.clone(), method: number, needs })
            }
            _ => Ok(method),
        }
    }
}

/// A drive at run time.
#[derive(Clone)]
pub(super) struct Drive {
    config: DriveConfig,
    dt: f64,
    /// Increments per unit with the sign of `invert`.
    scale: f64,
    plant: Plant,
    /// What the position loop follows, and its speed.
    reference: f64,
    rate: f64,
    /// Encoder zero.
    origin: f64,
    state: DriveState,
    mode: i8,
    control: u16,
    error: u16,
    homing: Homing,
    power: bool,
    online: bool,
    blocked: bool,
    limited: bool,
    stuck: [Option<bool>; 3],
    stuck_reference: bool,
    acceleration: f64,
}

impl Drive {
    pub fn new(config: &DriveConfig, dt: f64) -> Result<Self, OpenError> {
        let method = config.check()?;
        Ok(Self {
            dt,
            scale: if config.invert { -config.increments_per_unit } else { config.increments_per_unit },
            plant: Plant::new(config.start, config.bandwidth, config.damping, dt),
            reference: config.start,
            rate: 0.0,
            origin: if config.encoder == Encoder::Absolute { 0.0 } else { config.start },
            state: DriveState::NotReady,
            mode: 0,
            control: 0,
            error: 0,
            homing: Homing::new(method, config.home.fast, config.home.slow),
            power: true,
            online: true,
            blocked: false,
            limited: false,
            stuck: [None; 3],
            stuck_reference: false,
            acceleration: 0.0,
            config: config.clone(),
        })
    }

    pub fn name(&self) -> &str {
        &self.config.name
    }
    pub fn mechanics(&self) -> (f64, f64) {
        (self.plant.x, self.plant.v)
    }
    pub fn set_online(&mut self, online: bool) {
        self.online = online;
    }
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }
    pub fn stick(&mut self, switch: Switch, value: Option<bool>) {
        self.stuck[switch as usize] = value;
    }
    pub fn stick_reference(&mut self, stuck: bool) {
        match self.homing.method().switch {
            Some(switch) => self.stick(switch, stuck.then_some(false)),
            None => self.stuck_reference = stuck,
        }
    }
    pub fn fail(&mut self, code: u16) {
        self.error = code;
        self.state = if self.state.in_control() { DriveState::FaultReaction } else { DriveState::Fault };
        self.homing.abort();
    }
    pub fn set_power(&mut self, power: bool) {
        self.power = power;
        if !power {
            self.fail(UNDERVOLTAGE);
            self.state = DriveState::Fault;
        }
    }
    pub fn drag(&mut self, by: f64) -> bool {
        let free = !self.state.in_control() && self.state != DriveState::FaultReaction && by.is_finite();
        if free {
            self.plant.x += by;
            self.hold_ends();
        }
        free
    }

    /// One bus period.
    pub fn advance(&mut self, out: &DriveOut) {
        if self.online {
            let reset = out.control_word & !self.control & 0x80 != 0;
            let was_enabled = self.state == DriveState::OperationEnabled;
            self.state = next_state(self.state, out.control_word, reset && self.power);
            if self.state != DriveState::Fault && self.state != DriveState::FaultReaction {
                self.error = 0;
            }
            if self.state == DriveState::OperationEnabled && !was_enabled {
                (self.reference, self.rate) = (self.plant.x, self.plant.v);
            }
            self.select_mode(out);
            self.control = out.control_word;
        }
        let (before, speed) = (self.plant.x, self.plant.v);
        match self.state {
            DriveState::OperationEnabled => self.operate(out),
            DriveState::QuickStopActive | DriveState::FaultReaction => self.generate(0.0, self.config.deceleration),
            _ => {
                self.plant.coast(self.config.deceleration);
                (self.reference, self.rate) = (self.plant.x, self.plant.v);
            }
        }
        if self.blocked {
            self.plant.stop_at(before);
        }
        self.hold_ends();
        self.acceleration = (self.plant.v - speed) / self.dt;
        self.home(before);
        self.watch();
    }

    fn select_mode(&mut self, out: &DriveOut) {
        if !matches!(out.mode, 6 | 8 | 9) {
            return;
        }
        let start = |control: u16| control & 0x10 != 0;
        let enabled = self.state == DriveState::OperationEnabled;
        if out.mode == 6 && self.mode == 6 && enabled && start(out.control_word) && !start(self.control) {
            self.homing.start(&self.switches());
            if self.homing.running() && self.homing.in_place() {
                self.origin = self.plant.x;
            }
        }
        if out.mode != 6 || !enabled || !start(out.control_word) {
            self.homing.abort();
        }
        self.mode = out.mode;
    }

    /// Set-points, or the drive's own motion.
    fn operate(&mut self, out: &DriveOut) {
        let halt = out.control_word & 0x100 != 0;
        match self.mode {
            8 if !halt => {
                let target = out.position as f64 / self.scale + self.origin;
                let most = self.config.velocity * self.dt;
                let next = toward(self.reference, target, most);
                self.limited = next != target;
                let ahead = (f64::from(out.velocity_offset) / self.scale).clamp(-self.config.velocity, self.config.velocity);
                self.follow(next, ahead);
            }
            9 if !halt => {
                self.generate((f64::from(out.velocity) / self.scale).clamp(-self.config.velocity, self.config.velocity), f64::INFINITY)
            }
            6 if !halt => self.generate(self.homing.goal().clamp(-self.config.velocity, self.config.velocity), self.config.acceleration),
            _ => self.generate(0.0, self.config.deceleration),
        }
    }

    fn follow(&mut self, next: f64, feed_forward: f64) {
        self.plant.follow(self.reference, next, feed_forward);
        self.rate = (next - self.reference) / self.dt;
        self.reference = next;
    }

    /// The drive's own ramp towards a speed.
    fn generate(&mut self, goal: f64, acceleration: f64) {
        let rate = toward(self.rate, goal, acceleration * self.dt);
        let mean = 0.5 * (self.rate + rate);
        self.follow(self.reference + mean * self.dt, mean);
        self.rate = rate;
    }

    fn hold_ends(&mut self) {
        if let Some((low, high)) = self.config.travel {
            let x = self.plant.x;
            if x < low || x > high {
                self.plant.stop_at(x.clamp(low, high));
            }
        }
    }

    fn switches(&self) -> [bool; 3] {
        let x = self.plant.x;
        let s = &self.config.switches;
        let home_below = self.homing.method().direction < 0.0;
        let real = [
            s.negative.is_some_and(|e| x <= e),
            s.positive.is_some_and(|e| x >= e),
            s.home.is_some_and(|e| if home_below { x <= e } else { x >= e }),
        ];
        std::array::from_fn(|i| self.stuck[i].unwrap_or(real[i]))
    }

    fn home(&mut self, before: f64) {
        if !self.homing.running() {
            return;
        }
        let now = self.plant.x;
        let edge = self.homing.method().switch.and_then(|s| self.config.switches.edge(s));
        let lag = self.reference - now;
        let stalled = if lag.abs() > self.stall_lag() { lag.signum() } else { 0.0 };
        let sight = Sight {
            from: before,
            to: now,
            switches: self.switches(),
            edge: edge.filter(|e| (before.min(now)..=before.max(now)).contains(e)),
            stalled,
            standing: self.rate == 0.0,
        };
        let index = (!self.stuck_reference).then_some(self.config.index);
        if let Some(reference) = self.homing.advance(&sight, index) {
            self.origin = reference;
        }
        if self.homing.failed() {
            (self.reference, self.rate) = (now, self.plant.v);
        }
    }

    fn stall_lag(&self) -> f64 {
        let own = self.config.home.fast * STALL_TIME;
        if self.config.lag > 0.0 { own.min(0.9 * self.config.lag) } else { own }
    }

    /// Speeds up to this one come from the rounding of set-points.
    fn standing(&self) -> f64 {
        2.0 / (self.config.increments_per_unit * self.dt)
    }

    /// Errors the drive finds by itself.
    fn watch(&mut self) {
        match self.state {
            DriveState::OperationEnabled => {
                let [negative, positive, _] = self.switches();
                if self.config.lag > 0.0 && (self.reference - self.plant.x).abs() > self.config.lag {
                    self.fail(FOLLOWING_ERROR);
                } else if self.mode != 6 && (negative && self.rate < -self.standing() || positive && self.rate > self.standing()) {
                    self.fail(LIMIT_SWITCH);
                }
            }
            DriveState::FaultReaction if self.rate == 0.0 => self.state = DriveState::Fault,
            _ => {}
        }
    }

    /// What the bus brings.
    pub fn report(&self) -> DriveIn {
        let [negative, positive, home] = self.switches();
        DriveIn {
            online: self.online,
            status_word: self.status_word(),
            mode_display: self.mode,
            position: ((self.plant.x - self.origin) * self.scale).round() as i64,
            velocity: (self.plant.v * self.scale).round() as i32,
            torque: (1000.0 * self.acceleration / self.config.acceleration).clamp(-3000.0, 3000.0) as i16,
            error_code: self.error,
            following_error: ((self.reference - self.plant.x) * self.scale).round() as i32,
            digital_inputs: u32::from(negative) | u32::from(positive) << 1 | u32::from(home) << 2,
        }
    }

    fn status_word(&self) -> u16 {
        let state = match self.state {
            DriveState::NotReady => 0x00,
            DriveState::SwitchOnDisabled => 0x40,
            DriveState::ReadyToSwitchOn => 0x21,
            DriveState::SwitchedOn => 0x23,
            DriveState::OperationEnabled => 0x27,
            DriveState::QuickStopActive => 0x07,
            DriveState::FaultReaction => 0x0F,
            DriveState::Fault => 0x08,
        };
        let mode = match self.mode {
            6 => {
                let reached = !self.homing.running() && self.rate == 0.0;
                u16::from(reached) << 10 | u16::from(self.homing.attained()) << 12 | u16::from(self.homing.failed()) << 13
            }
            8 | 9 => u16::from(self.state == DriveState::OperationEnabled) << 12,
            _ => 0,
        };
        state | mode | u16::from(self.power) << 4 | 1 << 9 | u16::from(self.limited) << 11
    }
}

/// The state machine (IEC 61800-7-201, transitions 1 to 16); `reset` is the rising edge of bit 7.
fn next_state(state: DriveState, control: u16, reset: bool) -> DriveState {
    use DriveState as S;
    let disable_voltage = control & 0x02 == 0;
    let quick_stop = control & 0x06 == 0x02;
    let shutdown = control & 0x07 == 0x06;
    let switch_on = control & 0x0F == 0x07;
    let enable = control & 0x0F == 0x0F;
    match state {
        S::NotReady => S::SwitchOnDisabled,
        S::SwitchOnDisabled if shutdown => S::ReadyToSwitchOn,
        S::ReadyToSwitchOn | S::SwitchedOn if disable_voltage || quick_stop => S::SwitchOnDisabled,
        S::ReadyToSwitchOn if switch_on || enable => S::SwitchedOn,
        S::SwitchedOn | S::OperationEnabled if shutdown => S::ReadyToSwitchOn,
        S::SwitchedOn if enable => S::OperationEnabled,
        S::OperationEnabled | S::QuickStopActive if disable_voltage => S::SwitchOnDisabled,
        S::OperationEnabled if switch_on => S::SwitchedOn,
        S::OperationEnabled if quick_stop => S::QuickStopActive,
        S::QuickStopActive if enable => S::OperationEnabled,
        S::Fault if reset => S::SwitchOnDisabled,
        _ => state,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_machine_has_the_transitions_of_the_standard_and_no_others() {
        use DriveState as S;
        let all = [
            S::NotReady,
            S::SwitchOnDisabled,
            S::ReadyToSwitchOn,
            S::SwitchedOn,
            S::OperationEnabled,
            S::QuickStopActive,
            S::FaultReaction,
            S::Fault,
        ];
        // Rows: disable voltage, shutdown, switch on, enable, quick stop; columns as `all`.
        let table = [
            (
                0x00,
                [
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::FaultReaction,
                    S::Fault,
                ],
            ),
            (
                0x06,
                [
                    S::SwitchOnDisabled,
                    S::ReadyToSwitchOn,
                    S::ReadyToSwitchOn,
                    S::ReadyToSwitchOn,
                    S::ReadyToSwitchOn,
                    S::QuickStopActive,
                    S::FaultReaction,
                    S::Fault,
                ],
            ),
            (
                0x07,
                [
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchedOn,
                    S::SwitchedOn,
                    S::SwitchedOn,
                    S::QuickStopActive,
                    S::FaultReaction,
                    S::Fault,
                ],
            ),
            (
                0x0F,
                [
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchedOn,
                    S::OperationEnabled,
                    S::OperationEnabled,
                    S::OperationEnabled,
                    S::FaultReaction,
                    S::Fault,
                ],
            ),
            (
                0x02,
                [
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::SwitchOnDisabled,
                    S::QuickStopActive,
                    S::QuickStopActive,
                    S::FaultReaction,
                    S::Fault,
                ],
            ),
        ];
        for (control, expected) in table {
            for (from, to) in all.into_iter().zip(expected) {
                assert_eq!(next_state(from, control, false), to, "{from:?} with {control:#04x}");
            }
        }
        assert_eq!(next_state(S::Fault, 0x80, true), S::SwitchOnDisabled);
        assert_eq!(next_state(S::FaultReaction, 0x80, true), S::FaultReaction);
    }

    #[test]
    fn a_pulse_is_found_in_either_direction() {
        let every = Index { position: 0.5, spacing: 2.0 };
        assert_eq!(every.crossed(5.0, 4.0, -1.0), Some(4.5));
        assert_eq!(every.crossed(2.0, 9.0, 1.0), Some(2.5));
        assert_eq!(every.crossed(9.0, 2.0, -1.0), Some(8.5));
        assert_eq!(every.crossed(3.0, 4.0, 1.0), None);
        let single = Index { position: 0.0, spacing: 0.0 };
        assert_eq!((single.crossed(0.1, -0.1, -1.0), single.crossed(5.0, 4.0, -1.0)), (Some(0.0), None));
    }
}
