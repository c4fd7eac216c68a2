//! The axis stage: actual values and real states before the programs, checks and drive words after them.
//!
//! Positions are kept in the *drive's frame*: increments / scale, in technical units; the axis' own position is that minus its offset. What was sent last
//! ([`Axis::target`]) is the reference of all checks, so that nothing in the image can make the drive jump: a set value that would exceed the velocity
//! limit is not sent, the axis brakes from what was sent last instead.
//!
//! **State changes made here** (all others belong to blocks): power_off ↔ standstill with the drive's real state; any → errorstop on an error;
//! any → stopping → power_off on a quick stop; homing → standstill; errorstop → standstill or power_off when MC_Reset asks for it.

use super::cia402::{self, DriveState, Goal};
use super::ramp::{Ramp, common_duration};
use super::{AxisConfig, Encoder, FeedForward};
use crate::bus::{DriveIn, DriveOut, ProcessImage};
use crate::pack::Pack;
use takt_abi::{AxisRef, AxisState, Bool, Dword, Plain, SmcError, Word};

/// Exchanges without an answer after which a drive counts as gone.
const SILENT_CYCLES: u32 = 3;
/// Time a drive has to leave its fault after a reset, s.
const RESET_TIME: f64 = 1.0;
/// Cycles after which the homing bits of the statusword belong to the homing that was started last.
const HOMING_SETTLE: u32 = 8;
/// Part of the speed limit (and of a unit) that rounding may exceed.
const SPEED_TOLERANCE: f64 = 1e-3;
/// Rounding of positions at the software limits, units.
const LIMIT_TOLERANCE: f64 = 1e-6;
/// Positions beyond are nonsense.
const FAR: f64 = 1e12;

/// What people are shown of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisStatus {
    /// Actual position, technical units.
    pub position: f64,
    /// Actual velocity, technical units/s.
    pub velocity: f64,
    /// Following error, technical units.
    pub lag: f64,
    /// The following error is above `lag.warn`.
    pub lag_warning: bool,
    /// What the drive is in.
    pub drive: DriveState,
    /// The axis knows where it is.
    pub homed: bool,
    /// Stands still, drive off.
    pub at_rest: bool,
}

/// How far homing is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Homing {
    Idle,
    /// Waits for the drive to show mode 6.
    Entering,
    /// The drive moves by itself, for so many cycles.
    Running(u32),
    /// Waits for the drive to show mode 8 again.
    Leaving,
}

/// How far a reset is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reset {
    Idle,
    /// Bit 7 is low, so that the next word has the edge.
    Arming,
    /// Bit 7 is high; seconds so far.
    Waiting(f64),
}

/// One axis at run time.
struct Axis {
    config: AxisConfig,
    /// Increments per unit, with the sign of `invert`.
    scale: f64,
    offset: f64,
    homed: bool,
    silent: u32,
    was_online: bool,
    drive: DriveState,
    /// The drive was in control in the cycle before.
    was_enabled: bool,
    /// Actual values in the drive's frame.
    actual: f64,
    velocity: f64,
    acceleration: f64,
    lag: f64,
    /// Last position sent (drive's frame, units), and its change per second.
    target: f64,
    speed: f64,
    ramp: Option<Ramp>,
    homing: Homing,
    reset: Reset,
    /// The stop under way was commanded by bDriveStart.
    quick_stop: bool,
}

impl Pack for Homing {
    fn pack(&self, out: &mut Vec<u8>) {
        let (kind, cycles) = match *self {
            Self::Idle => (0u8, 0),
            Self::Entering => (1, 0),
            Self::Running(cycles) => (2, cycles),
            Self::Leaving => (3, 0),
        };
        (kind, cycles).pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some(match <(u8, u32)>::unpack(from)? {
            (0, _) => Self::Idle,
            (1, _) => Self::Entering,
            (2, cycles) => Self::Running(cycles),
            (3, _) => Self::Leaving,
            _ => return None,
        })
    }
}

impl Pack for Reset {
    fn pack(&self, out: &mut Vec<u8>) {
        let (kind, seconds) = match *self {
            Self::Idle => (0u8, 0.0),
            Self::Arming => (1, 0.0),
            Self::Waiting(seconds) => (2, seconds),
        };
        (kind, seconds).pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some(match <(u8, f64)>::unpack(from)? {
            (0, _) => Self::Idle,
            (1, _) => Self::Arming,
            (2, seconds) => Self::Waiting(seconds),
            _ => return None,
        })
    }
}

impl Axis {
    /// What changes while it runs.
    fn save(&self, out: &mut Vec<u8>) {
        // A new field is either configuration or written here and read below.
        let Self {
            config: _,
            scale: _,
            offset,
            homed,
            silent,
            was_online,
            drive,
            was_enabled,
            actual,
            velocity,
            acceleration,
            lag,
            target,
            speed,
            ramp,
            homing,
            reset,
            quick_stop,
        } = self;
        [offset, actual, velocity, acceleration, lag, target, speed].into_iter().for_each(|v| v.pack(out));
        [homed, was_online, was_enabled, quick_stop].into_iter().for_each(|v| v.pack(out));
        silent.pack(out);
        drive.pack(out);
        ramp.pack(out);
        homing.pack(out);
        reset.pack(out);
    }
    fn restored(&self, from: &mut &[u8]) -> Option<Self> {
        let mut v = [0.0; 7];
        for value in &mut v {
            *value = f64::unpack(from)?;
        }
        let mut b = [false; 4];
        for value in &mut b {
            *value = bool::unpack(from)?;
        }
        let [offset, actual, velocity, acceleration, lag, target, speed] = v;
        let [homed, was_online, was_enabled, quick_stop] = b;
        Some(Self {
            config: self.config.clone(),
            scale: self.scale,
            offset,
            homed,
            silent: Pack::unpack(from)?,
            was_online,
            drive: Pack::unpack(from)?,
            was_enabled,
            actual,
            velocity,
            acceleration,
            lag,
            target,
            speed,
            ramp: Pack::unpack(from)?,
            homing: Pack::unpack(from)?,
            reset: Pack::unpack(from)?,
            quick_stop,
        })
    }
}

/// All axes.
pub(crate) struct Stage {
    axes: Vec<Axis>,
    /// Bus period, s.
    dt: f64,
    cycle: u64,
    answered: bool,
    /// The application has been stopped and the axes brake together.
    braking: bool,
}

impl Stage {
    pub fn new(configs: Vec<AxisConfig>, dt: f64) -> Self {
        Self { axes: configs.into_iter().map(Axis::new).collect(), dt, cycle: 0, answered: false, braking: false }
    }

    /// Writes configuration and what the axes know of themselves into a fresh image.
    pub fn attach(&mut self, image: &mut [u8]) {
        self.braking = false;
        for (number, axis) in self.axes.iter_mut().enumerate() {
            let mut r = axis.load(image);
            axis.attach(&mut r, number, self.dt);
            axis.store(&r, image);
        }
    }

    /// Whether the last exchange brought anything.
    pub fn bus_answered(&mut self, answered: bool) {
        self.answered = answered;
    }

    /// Actual values and real states, before the programs of bus cycle `cycle`.
    pub fn inputs(&mut self, image: &mut [u8], io: &ProcessImage, cycle: u64) {
        self.cycle = cycle;
        for axis in &mut self.axes {
            let mut r = axis.load(image);
            axis.measure(&io.drives_in[axis.config.drive], self.answered, self.dt);
            axis.supervise(&mut r);
            axis.advance_homing(&mut r, &io.drives_in[axis.config.drive]);
            axis.show(&mut r, &io.drives_in[axis.config.drive], cycle, self.dt);
            axis.store(&r, image);
        }
    }

    /// Set values to drive words, after the programs.
    pub fn outputs(&mut self, image: &mut [u8], io: &mut ProcessImage, faulted: bool) {
        if faulted {
            return self.brake(image, io);
        }
        for axis in &mut self.axes {
            let mut r = axis.load(image);
            io.drives_out[axis.config.drive] = axis.command(&mut r, self.cycle, self.dt);
            axis.store(&r, image);
        }
    }

    /// Brings all axes to rest together, then takes their power.
    fn brake(&mut self, image: &mut [u8], io: &mut ProcessImage) {
        if !self.braking {
            self.braking = true;
            let moving = self.axes.iter().filter(|a| a.follows());
            let duration = common_duration(moving.map(|a| (a.speed, a.config.limits.deceleration)));
            for axis in self.axes.iter_mut().filter(|a| a.follows()) {
                axis.ramp = Some(Ramp::new(axis.target, axis.speed, duration));
            }
        }
        let braking = self.axes.iter().any(|a| a.follows() && a.ramp.as_ref().is_some_and(|r| !r.done()));
        for axis in &mut self.axes {
            let mut r = axis.load(image);
            io.drives_out[axis.config.drive] = axis.brake(&mut r, braking, self.dt);
            axis.store(&r, image);
        }
    }

    /// What changes while it runs, for a checkpoint.
    pub fn save(&self, out: &mut Vec<u8>) {
        let Self { axes, dt: _, cycle, answered, braking } = self;
        axes.iter().for_each(|axis| axis.save(out));
        (*cycle, (*answered, *braking)).pack(out);
    }

    /// The stage with the same configuration and the saved state; `None` when the bytes are not one.
    pub fn restored(&self, from: &mut &[u8]) -> Option<Self> {
        let axes = self.axes.iter().map(|axis| axis.restored(from)).collect::<Option<_>>()?;
        let (cycle, (answered, braking)) = Pack::unpack(from)?;
        Some(Self { axes, dt: self.dt, cycle, answered, braking })
    }

    pub fn at_rest(&self) -> bool {
        self.axes.iter().all(Axis::at_rest)
    }

    pub fn status(&self) -> impl ExactSizeIterator<Item = AxisStatus> {
        self.axes.iter().map(|a| AxisStatus {
            position: a.position(),
            velocity: a.velocity,
            lag: a.lag,
            lag_warning: a.config.lag.is_some_and(|l| a.lag.abs() > l.warn),
            drive: a.drive,
            homed: a.homed,
            at_rest: a.at_rest(),
        })
    }
}

fn bool(value: bool) -> Bool {
    value.into()
}

/// The axis follows a block's set values in this state.
fn in_motion(state: AxisState) -> bool {
    matches!(state, AxisState::discrete_motion | AxisState::continuous_motion | AxisState::synchronized_motion | AxisState::stopping)
}

/// What a drive's error code (603F) is called on the axis.
fn drive_error(code: u16) -> SmcError {
    match code {
        0x8611 => SmcError::SMC_DI_POSITIONLAGERROR,
        0x8612 => SmcError::SMC_DI_HWLIMITS_EXCEEDED,
        0x8613 => SmcError::SMC_DI_HOMING_ERROR,
        0x3100..=0x32FF => SmcError::SMC_DI_VOLTAGE_DISABLED,
        0x8100..=0x81FF => SmcError::SMC_DI_GENERAL_COMMUNICATION_ERROR,
        0x7300..=0x73FF => SmcError::SMC_DI_IRREGULAR_ACTPOSITION,
        _ => SmcError::SMC_DI_AXIS_ERROR,
    }
}

impl Axis {
    fn new(config: AxisConfig) -> Self {
        let scale = if config.invert { -config.increments_per_unit } else { config.increments_per_unit };
        let absolute = config.encoder == Encoder::Absolute;
        Self {
            scale,
            offset: if absolute { -config.home.offset } else { 0.0 },
            homed: absolute,
            config,
            silent: 0,
            was_online: false,
            drive: DriveState::NotReady,
            was_enabled: false,
            actual: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
            lag: 0.0,
            target: 0.0,
            speed: 0.0,
            ramp: None,
            homing: Homing::Idle,
            reset: Reset::Idle,
            quick_stop: false,
        }
    }

    fn load(&self, image: &[u8]) -> AxisRef {
        AxisRef::load(&image[self.config.place.offset as usize..])
    }

    fn store(&self, r: &AxisRef, image: &mut [u8]) {
        r.store(&mut image[self.config.place.offset as usize..]);
    }

    fn attach(&mut self, r: &mut AxisRef, number: usize, dt: f64) {
        (self.ramp, self.homing, self.reset, self.quick_stop) = (None, Homing::Idle, Reset::Idle, false);
        r.wDriveId = Word(number as u16);
        r.fTaskCycle = dt;
        r.fOffset = self.offset;
        r.fScalefactor = self.config.increments_per_unit;
        r.iMovementType = i16::from(self.config.modulo == 0.0);
        r.fPositionPeriod = self.config.modulo;
        self.show_limits(r);
    }

    fn show_limits(&self, r: &mut AxisRef) {
        let l = &self.config.limits;
        (r.fSWMaxVelocity, r.fSWMaxAcceleration, r.fSWMaxDeceleration, r.fSWMaxJerk) = (l.velocity, l.acceleration, l.deceleration, l.jerk);
        (r.fSWLimitNegative, r.fSWLimitPositive, r.fSWLimitDeceleration) = (l.negative, l.positive, l.deceleration);
        r.bSWLimitEnable = bool(self.limited());
        r.bHomed = bool(self.homed);
    }

    /// Software limits hold: they mean something only on a finite axis that knows where it is.
    fn limited(&self) -> bool {
        self.homed && self.config.modulo == 0.0
    }

    fn online(&self) -> bool {
        self.was_online && self.silent < SILENT_CYCLES
    }

    fn position(&self) -> f64 {
        self.wrapped(self.actual - self.offset)
    }

    fn wrapped(&self, position: f64) -> f64 {
        let period = self.config.modulo;
        if period > 0.0 { position.rem_euclid(period) } else { position }
    }

    /// The drive follows what is sent.
    fn follows(&self) -> bool {
        self.drive == DriveState::OperationEnabled && self.homing == Homing::Idle
    }

    fn moves(&self) -> bool {
        self.velocity.abs() > self.config.limits.velocity * 1e-3
    }

    fn at_rest(&self) -> bool {
        !self.drive.in_control() && !self.moves()
    }

    /// From increments to units.
    fn measure(&mut self, d: &DriveIn, answered: bool, dt: f64) {
        if !(answered && d.online) {
            self.silent = self.silent.saturating_add(1);
            return;
        }
        (self.silent, self.was_online) = (0, true);
        self.was_enabled = self.drive.in_control();
        self.drive = DriveState::of(d.status_word);
        let velocity = f64::from(d.velocity) / self.scale;
        self.acceleration = (velocity - self.velocity) / dt;
        (self.actual, self.velocity) = (d.position as f64 / self.scale, velocity);
        self.lag = f64::from(d.following_error) / self.scale;
    }

    /// State changes that the drive's real state brings.
    fn supervise(&mut self, r: &mut AxisRef) {
        let state = r.nAxisState;
        if state == AxisState::errorstop || !self.was_online {
            return;
        }
        if !self.online() {
            return self.fail(r, SmcError::SMC_DI_GENERAL_COMMUNICATION_ERROR);
        }
        if self.drive.is_fault() {
            return; // `show` knows the error code.
        }
        let commanded = r.bRegulatorOn.get() && r.bDriveStart.get();
        let enabled = self.drive == DriveState::OperationEnabled;
        match state {
            AxisState::power_off if enabled && commanded => (r.nAxisState, r.nCommandedBy) = (AxisState::standstill, 0),
            AxisState::power_off => {}
            AxisState::stopping if self.quick_stop && !enabled && !self.moves() => {
                self.quick_stop = false;
                r.nAxisState = AxisState::power_off;
            }
            AxisState::stopping if self.quick_stop => {}
            _ if enabled || !commanded => {}
            _ if self.was_enabled => self.fail(r, SmcError::SMC_DI_VOLTAGE_DISABLED),
            _ => self.fail(r, SmcError::SMC_AXIS_IS_NOT_OPERATIONAL),
        }
    }

    /// The axis goes to errorstop; the first error counts. Braking begins with the next set value that would be sent.
    fn fail(&mut self, r: &mut AxisRef, error: SmcError) {
        if r.nAxisState == AxisState::errorstop && r.bError.get() {
            return;
        }
        r.nAxisState = AxisState::errorstop;
        r.bError = Bool::TRUE;
        r.bErrorAckn = Bool::FALSE;
        r.dwErrorID = Dword(error.0 as u32);
        r.nCommandedBy = 0;
        self.quick_stop = false;
        self.abort_homing(r);
    }

    fn abort_homing(&mut self, r: &mut AxisRef) {
        if self.homing != Homing::Idle {
            self.homing = Homing::Idle;
            self.hold_actual();
            r.byHoming = 4;
        }
    }

    /// The next set value continues from where the axis is.
    fn hold_actual(&mut self) {
        (self.target, self.speed, self.ramp) = (self.actual, self.velocity, None);
    }

    /// Actual values and states into the image.
    fn show(&mut self, r: &mut AxisRef, d: &DriveIn, cycle: u64, dt: f64) {
        if self.online() && self.drive.is_fault() && r.nAxisState != AxisState::errorstop {
            self.fail(r, drive_error(d.error_code));
        }
        self.take_offset(r);
        r.bCommunication = bool(self.online());
        r.wCommunicationState = Word(if self.online() { 100 } else { 0 });
        r.uiDriveInterfaceError = d.error_code;
        r.bRegulatorRealState = bool(self.online() && self.drive.in_control());
        r.bDriveStartRealState = bool(self.online() && self.drive == DriveState::OperationEnabled);
        (r.fActPosition, r.fActVelocity, r.fActAcceleration) = (self.position(), self.velocity, self.acceleration);
        r.fActTorque = f64::from(d.torque) * 0.001;
        r.fActCurrent = r.fActTorque;
        r.fLagError = self.lag;
        r.nBusCycle = cycle;
        r.fTaskCycle = dt;
        self.show_limits(r);
        if r.nAxisState == AxisState::power_off || r.nAxisState == AxisState::homing && self.homing != Homing::Idle {
            self.set_follows_actual(r);
        }
    }

    /// MC_SetPosition moves the zero through the image.
    fn take_offset(&mut self, r: &mut AxisRef) {
        if r.fOffset.is_finite() && r.fOffset.abs() < FAR {
            self.offset = r.fOffset;
        } else {
            r.fOffset = self.offset;
        }
    }

    fn set_follows_actual(&self, r: &mut AxisRef) {
        r.fSetPosition = self.position();
        r.fSetVelocity = if r.nAxisState == AxisState::homing { self.velocity } else { 0.0 };
        r.fSetAcceleration = 0.0;
    }

    /// What the drive is told after the programs.
    fn command(&mut self, r: &mut AxisRef, cycle: u64, dt: f64) -> DriveOut {
        self.take_offset(r);
        let goal = match (r.bRegulatorOn.get(), r.bDriveStart.get()) {
            (false, _) => Goal::Off,
            (true, false) => Goal::QuickStop,
            (true, true) => Goal::Enabled,
        };
        self.obey_power(r, goal);
        let mut control = cia402::control(self.drive, goal);
        control |= self.handle_reset(r, dt);
        let (mode, homing_bit) = self.handle_homing(r, goal);
        if self.homing == Homing::Idle && self.drive == DriveState::OperationEnabled && r.nAxisState != AxisState::power_off {
            self.handle_motion(r, cycle, dt);
        } else {
            self.hold_actual();
            if self.drive != DriveState::QuickStopActive {
                self.speed = 0.0;
            }
            self.set_follows_actual(r);
        }
        self.words(control | homing_bit, mode, r.fSetVelocity)
    }

    fn words(&self, control_word: u16, mode: i8, set_velocity: f64) -> DriveOut {
        let limit = self.config.limits.velocity * (1.0 + SPEED_TOLERANCE);
        let ahead = match self.config.feed_forward {
            FeedForward::Velocity if set_velocity.is_finite() => set_velocity.clamp(-limit, limit),
            _ => 0.0,
        };
        DriveOut {
            control_word,
            mode,
            position: (self.target * self.scale).round() as i64,
            velocity: (self.speed * self.scale).round() as i32,
            velocity_offset: (ahead * self.scale).round() as i32,
        }
    }

    /// Power and quick stop as commanded.
    fn obey_power(&mut self, r: &mut AxisRef, goal: Goal) {
        if matches!(r.nAxisState, AxisState::power_off | AxisState::errorstop) {
            return;
        }
        match goal {
            Goal::Off => {
                self.quick_stop = false;
                self.abort_homing(r);
                (r.nAxisState, r.nCommandedBy) = (AxisState::power_off, 0);
            }
            Goal::QuickStop if !self.quick_stop || r.nAxisState != AxisState::stopping => {
                self.quick_stop = true;
                self.abort_homing(r);
                (r.nAxisState, r.nCommandedBy) = (AxisState::stopping, 0);
            }
            _ => {}
        }
    }

    /// MC_Reset's handshake; the bit for the controlword.
    fn handle_reset(&mut self, r: &mut AxisRef, dt: f64) -> u16 {
        if r.byReset == 1 {
            (r.byReset, self.reset) = (2, Reset::Arming);
            return 0;
        }
        if r.byReset != 2 {
            self.reset = Reset::Idle;
            return 0;
        }
        match self.reset {
            Reset::Idle | Reset::Arming if !self.drive.is_fault() => self.finish_reset(r),
            Reset::Idle | Reset::Arming => self.reset = Reset::Waiting(0.0),
            Reset::Waiting(_) if !self.drive.is_fault() => self.finish_reset(r),
            Reset::Waiting(t) if t < RESET_TIME => self.reset = Reset::Waiting(t + dt),
            Reset::Waiting(_) => (r.byReset, self.reset) = (4, Reset::Idle),
        }
        if self.reset == Reset::Idle || self.reset == Reset::Arming { 0 } else { cia402::FAULT_RESET }
    }

    /// The error is over, once the axis stands.
    fn finish_reset(&mut self, r: &mut AxisRef) {
        if !self.online() {
            (r.byReset, self.reset) = (4, Reset::Idle);
            return;
        }
        if self.ramp.as_ref().is_some_and(|ramp| !ramp.done()) {
            return;
        }
        (r.byReset, self.reset) = (3, Reset::Idle);
        (r.bError, r.bErrorAckn, r.dwErrorID) = (Bool::FALSE, Bool::TRUE, Dword(0));
        if r.nAxisState == AxisState::errorstop {
            let enabled = self.drive == DriveState::OperationEnabled && r.bRegulatorOn.get() && r.bDriveStart.get();
            r.nAxisState = if enabled { AxisState::standstill } else { AxisState::power_off };
            r.nCommandedBy = 0;
            r.fSetPosition = self.wrapped(self.target - self.offset);
            (r.fSetVelocity, r.fSetAcceleration) = (0.0, 0.0);
            self.ramp = None;
        }
    }

    /// MC_Home's handshake; mode and the bit for the controlword.
    fn handle_homing(&mut self, r: &mut AxisRef, goal: Goal) -> (i8, u16) {
        if r.byHoming == 1 {
            let ready = self.drive == DriveState::OperationEnabled
                && goal == Goal::Enabled
                && matches!(r.nAxisState, AxisState::standstill | AxisState::homing);
            if ready {
                (r.byHoming, r.nAxisState, self.homing) = (2, AxisState::homing, Homing::Entering);
            } else {
                r.byHoming = 4;
            }
        }
        if self.homing != Homing::Idle && r.nAxisState != AxisState::homing {
            self.homing = Homing::Idle;
            self.hold_actual();
            r.byHoming = 0;
        }
        match self.homing {
            Homing::Idle => (cia402::MODE_POSITION, 0),
            Homing::Entering => (cia402::MODE_HOMING, 0),
            Homing::Running(_) => (cia402::MODE_HOMING, cia402::HOMING_START),
            Homing::Leaving => (cia402::MODE_POSITION, 0),
        }
    }

    /// What the drive tells of its homing.
    fn advance_homing(&mut self, r: &mut AxisRef, d: &DriveIn) {
        let status = d.status_word;
        match self.homing {
            Homing::Entering if d.mode_display == cia402::MODE_HOMING => self.homing = Homing::Running(0),
            Homing::Running(n) if n < HOMING_SETTLE => self.homing = Homing::Running(n + 1),
            Homing::Running(_) if status & cia402::HOMING_ERROR != 0 => self.fail(r, SmcError::SMC_DI_HOMING_ERROR),
            Homing::Running(_) if status & cia402::HOMING_ATTAINED != 0 && status & cia402::TARGET_REACHED != 0 => {
                self.homing = Homing::Leaving
            }
            Homing::Leaving if d.mode_display == cia402::MODE_POSITION => self.finish_homing(r),
            _ => {}
        }
    }

    /// The drive counts from its reference now; the axis is there where MC_Home said.
    fn finish_homing(&mut self, r: &mut AxisRef) {
        let place = r.fHomePosition + self.config.home.offset;
        if !place.is_finite() || place.abs() > FAR {
            return self.fail(r, SmcError::SMC_INVALID_POSITION);
        }
        (self.homing, self.homed, self.offset) = (Homing::Idle, true, -place);
        self.hold_actual();
        self.speed = 0.0;
        r.fOffset = self.offset;
        (r.byHoming, r.nAxisState, r.nCommandedBy) = (3, AxisState::standstill, 0);
        self.set_follows_actual(r);
    }

    /// Set values of a block, or the axis stage's own while it brakes.
    fn handle_motion(&mut self, r: &mut AxisRef, cycle: u64, dt: f64) {
        if r.nAxisState != AxisState::errorstop && !self.quick_stop {
            self.ramp = None;
            match self.check(r, cycle, dt) {
                Ok(target) => {
                    self.speed = (target - self.target) / dt;
                    self.target = target;
                    return;
                }
                Err(error) => {
                    self.fail(r, error);
                    if error == SmcError::SMC_DI_POSITIONLAGERROR {
                        self.hold_actual();
                    }
                }
            }
        }
        let duration = self.speed.abs() / self.config.limits.deceleration;
        let (target, speed) = (self.target, self.speed);
        let ramp = self.ramp.get_or_insert_with(|| Ramp::new(target, speed, duration));
        let (position, velocity, acceleration) = ramp.advance(dt);
        let done = ramp.done();
        (self.target, self.speed) = (position, velocity);
        self.show_own_motion(r, velocity, acceleration);
        if done && self.quick_stop && r.bDriveStart.get() {
            self.quick_stop = false;
            (r.nAxisState, r.nCommandedBy) = (AxisState::standstill, 0);
        }
    }

    fn show_own_motion(&self, r: &mut AxisRef, velocity: f64, acceleration: f64) {
        r.fSetPosition = self.wrapped(self.target - self.offset);
        (r.fSetVelocity, r.fSetAcceleration) = (velocity, acceleration);
    }

    /// The position to send, in the drive's frame, or why it is not sent.
    fn check(&self, r: &AxisRef, cycle: u64, dt: f64) -> Result<f64, SmcError> {
        let (set, velocity) = (r.fSetPosition, r.fSetVelocity);
        if !set.is_finite() || !velocity.is_finite() || set.abs() > FAR {
            return Err(SmcError::SMC_INVALID_POSITION);
        }
        let resting = r.nAxisState == AxisState::stopping && self.speed == 0.0;
        if in_motion(r.nAxisState) && r.nCommandCycle != cycle && !resting {
            return Err(SmcError::SMC_FB_WASNT_CALLED_DURING_MOTION);
        }
        let target = self.unrolled(set) + self.offset;
        let limits = &self.config.limits;
        let step = target - self.target;
        if step.abs() > limits.velocity * (1.0 + SPEED_TOLERANCE) * dt + 1e-9 {
            return Err(SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED);
        }
        let out = set > limits.positive + LIMIT_TOLERANCE && step > 0.0 || set < limits.negative - LIMIT_TOLERANCE && step < 0.0;
        if self.limited() && out {
            return Err(SmcError::SMC_DI_SWLIMITS_EXCEEDED);
        }
        match self.config.lag {
            Some(lag) if self.lag.abs() > lag.trip => Err(SmcError::SMC_DI_POSITIONLAGERROR),
            _ => Ok(target),
        }
    }

    /// A modulo axis goes to the turn that is nearest to what was sent last.
    fn unrolled(&self, set: f64) -> f64 {
        let period = self.config.modulo;
        if period == 0.0 {
            return set;
        }
        let last = self.target - self.offset;
        set + ((last - set) / period).round() * period
    }

    /// One cycle after a fault of the application.
    fn brake(&mut self, r: &mut AxisRef, braking: bool, dt: f64) -> DriveOut {
        if self.drive.in_control() || r.nAxisState != AxisState::power_off {
            (r.nAxisState, r.nCommandedBy) = (AxisState::errorstop, 0);
        }
        if self.homing != Homing::Idle {
            self.abort_homing(r);
        }
        let goal = match (self.follows(), self.ramp.is_some()) {
            (true, true) if braking => Goal::Enabled,
            (true, false) if self.moves() => Goal::QuickStop,
            (false, _) if self.drive == DriveState::QuickStopActive && self.moves() => Goal::QuickStop,
            _ => Goal::Off,
        };
        match (&mut self.ramp, self.drive == DriveState::OperationEnabled) {
            (Some(ramp), true) => {
                let (position, velocity, acceleration) = ramp.advance(dt);
                (self.target, self.speed) = (position, velocity);
                self.show_own_motion(r, velocity, acceleration);
            }
            _ => {
                self.hold_actual();
                self.speed = 0.0;
                self.set_follows_actual(r);
            }
        }
        self.words(cia402::control(self.drive, goal), cia402::MODE_POSITION, r.fSetVelocity)
    }
}

#[cfg(test)]
mod tests;
