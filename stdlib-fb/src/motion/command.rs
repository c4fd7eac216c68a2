//! The life of a motion command: Execute edge, waiting, moving, the end, and what the outputs show meanwhile.
//!
//! Blocks hand their inputs to [`Command::call`] as an [`Order`] and copy the outputs back. Conventions (PLCopen Motion Control part 1, 2.4.1): inputs
//! are taken on the rising edge; Busy, Done, CommandAborted and Error exclude each other; a falling Execute does not stop the motion; when Execute is
//! already FALSE at the end, the output shows for one call.

use crate::motion::axis::{
    Hold, dynamics, hold, modulo, refusal, release, set_motion, stopping_dynamics, take_over, travel, wrapped, write_set_values,
};
use crate::motion::profile::{Limits, Motion, Profile};
use takt_abi::{AxisRef, AxisState, Bool, BufferMode, Cx, Direction, Fault, InOut, SmcError, st_struct};

/// Where a command goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// To a position.
    Absolute(f64, Direction),
    /// By a distance from where it starts.
    Relative(f64),
    /// On and on with a velocity, of which the sign counts.
    Velocity(f64),
    /// To rest; others may take over meanwhile.
    Halt,
    /// To rest; nobody else may take over until Execute is FALSE.
    Stop,
}

/// What a block wants, as its inputs say now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// Where to.
    pub goal: Goal,
    /// Velocity, not negative.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Deceleration.
    pub deceleration: f64,
    /// Jerk; 0: the axis' own.
    pub jerk: f64,
    /// When it starts.
    pub buffer: BufferMode,
}

st_struct! {
    /// What a motion block remembers between calls, and its outputs.
    pub struct TAKT_COMMAND as Command {
        /// The motion under way.
        profile: Profile,
        /// Bus cycles since its start.
        cycles: u64,
        /// The axis it runs on, as an offset.
        axis: u64,
        /// Execute at the last call.
        last: Bool,
        /// 0 idle, 1 waiting for the axis, 2 moving, 3 at rest and blocking, 4 braking after an error.
        phase: u8,
        done: Bool,
        active: Bool,
        aborted: Bool,
        error: Bool,
        id: SmcError,
        /// The velocity asked for has been reached.
        in_velocity: Bool,
        /// The order taken on the rising edge: 0 absolute, 1 relative, 2 velocity, 3 halt, 4 stop.
        goal: u8,
        place: f64,
        direction: i16,
        velocity: f64,
        acceleration: f64,
        deceleration: f64,
        jerk: f64,
    }
}

const IDLE: u8 = 0;
const WAITING: u8 = 1;
const MOVING: u8 = 2;
const BLOCKING: u8 = 3;
const BRAKING: u8 = 4;

impl Command {
    /// Whether the block is busy.
    pub fn busy(&self) -> Bool {
        (self.phase == WAITING || self.phase == MOVING).into()
    }

    /// One call of a block.
    pub fn call(&mut self, place: InOut<AxisRef>, execute: Bool, order: Order, cx: &mut Cx<'_>) -> Result<(), Fault> {
        let rising = execute.get() && !self.last.get();
        self.last = execute;
        if self.phase != WAITING && self.phase != MOVING && !execute.get() && !rising {
            (self.done, self.aborted, self.error, self.id) = (Bool::FALSE, Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        }
        if self.phase == IDLE && !rising {
            return Ok(());
        }
        // The axis that was given first stays the one that is moved until the end.
        let changed = self.phase != IDLE && self.axis != place.0;
        let place = if changed { at(self.axis) } else { place };
        let mut axis = cx.get(place)?;
        if changed {
            self.give_up(&mut axis, cx, SmcError::SMC_AXIS_REF_CHANGED_DURING_OPERATION);
        } else if rising {
            self.axis = place.0;
            self.accept(&mut axis, order, cx);
        }
        self.go_on(&mut axis, execute, cx);
        cx.set(place, &axis)
    }

    /// Takes the order of a rising edge.
    fn accept(&mut self, axis: &mut AxisRef, order: Order, cx: &Cx<'_>) {
        (self.done, self.aborted, self.error, self.id) = (Bool::FALSE, Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        self.in_velocity = Bool::FALSE;
        let buffered = order.buffer == BufferMode::Buffered;
        let refused = match refusal(axis, cx) {
            Some(error) if order.goal != Goal::Stop => Some(error),
            _ if order.goal == Goal::Stop => stop_refusal(axis, cx).or_else(|| plan(axis, order, set_motion(axis)).err()),
            _ if !buffered && order.buffer != BufferMode::Aborting => Some(SmcError::SMC_BUFFER_MODE_NOT_SUPPORTED),
            _ => plan(axis, order, set_motion(axis)).err(),
        };
        if let Some(error) = refused {
            self.give_up(axis, cx, error);
            return;
        }
        self.keep(order);
        let free = axis.nAxisState == AxisState::standstill && axis.nCommandedBy == 0;
        if buffered && !free && axis.nCommandedBy != cx.this {
            self.phase = WAITING;
        } else {
            self.start(axis, cx);
        }
    }

    /// Takes the axis over and plans. The set values of this cycle count as the start if a block has written them already, else as those of the last.
    fn start(&mut self, axis: &mut AxisRef, cx: &Cx<'_>) {
        match plan(axis, self.order(), set_motion(axis)) {
            Ok(profile) => {
                let goal = self.goal;
                self.begin(axis, cx, profile, state_of(goal));
            }
            Err(error) => self.give_up(axis, cx, error),
        }
    }

    /// Starts a planned motion.
    fn begin(&mut self, axis: &mut AxisRef, cx: &Cx<'_>, profile: Profile, state: AxisState) {
        let written = axis.nCommandCycle == axis.nBusCycle;
        (self.profile, self.phase) = (profile, MOVING);
        self.cycles = if written { u64::MAX } else { 0 };
        take_over(axis, cx, state);
        axis.byHoming = 0;
    }

    /// The cycle's share of waiting, moving, blocking or braking.
    fn go_on(&mut self, axis: &mut AxisRef, execute: Bool, cx: &Cx<'_>) {
        if self.phase == WAITING {
            match refusal(axis, cx) {
                Some(error) => self.fail(error),
                None if axis.nAxisState == AxisState::standstill && axis.nCommandedBy == 0 => self.start(axis, cx),
                None => {}
            }
        }
        if self.phase == MOVING || self.phase == BRAKING || self.phase == BLOCKING {
            match hold(axis, cx) {
                Hold::Ours => self.advance(axis, execute, cx),
                _ if self.phase == BRAKING => self.phase = IDLE,
                Hold::Aborted => self.end(|c| c.aborted = Bool::TRUE),
                Hold::Lost(error) => {
                    if axis.nCommandedBy == cx.this
                        && error == SmcError::SMC_REGULATOR_OR_START_NOT_SET
                        && axis.nAxisState != AxisState::power_off
                    {
                        release(axis);
                    }
                    self.fail(error);
                }
            }
        }
        self.active = (self.phase == MOVING).into();
    }

    fn advance(&mut self, axis: &mut AxisRef, execute: Bool, cx: &Cx<'_>) {
        self.cycles = self.cycles.wrapping_add(1);
        let t = self.cycles as f64 * cx.period.seconds();
        let now = self.profile.at(t);
        write_set_values(axis, now);
        let over = t >= self.profile.duration();
        self.in_velocity = (self.goal == VELOCITY && now.a == 0.0 && (now.v - self.place).abs() <= 1e-9 * self.place.abs().max(1.0)).into();
        if !over || self.profile.end_v != 0.0 || (self.goal == VELOCITY && self.place == 0.0 && self.phase == MOVING) {
            return;
        }
        match (self.phase, self.goal) {
            (MOVING | BLOCKING, STOP) => {
                // Done shows while Execute is TRUE, or for the one call in which the axis comes to rest.
                let shown = execute.get() || self.phase == MOVING;
                self.done = (shown && !self.error.get()).into();
                self.phase = BLOCKING;
                if !execute.get() {
                    self.phase = IDLE;
                    release(axis);
                }
            }
            (MOVING, VELOCITY) => {
                release(axis);
                self.fail(SmcError::SMC_DI_SWLIMITS_EXCEEDED);
            }
            (MOVING, _) => {
                release(axis);
                self.end(|c| c.done = Bool::TRUE);
            }
            _ => {
                release(axis);
                self.phase = IDLE;
            }
        }
    }

    fn end(&mut self, how: impl FnOnce(&mut Self)) {
        self.phase = IDLE;
        self.in_velocity = Bool::FALSE;
        how(self);
    }

    fn fail(&mut self, error: SmcError) {
        self.end(|c| (c.error, c.id) = (Bool::TRUE, error));
    }

    /// Ends with an error; if the axis is moving at this block's command, it is braked first.
    fn give_up(&mut self, axis: &mut AxisRef, cx: &Cx<'_>, error: SmcError) {
        let ours = self.phase != IDLE && self.phase != WAITING && hold(axis, cx) == Hold::Ours;
        let blocking = self.phase == BLOCKING || (self.phase == MOVING && self.goal == STOP);
        self.fail(error);
        if !ours || blocking {
            // A stop that is under way goes on.
            self.phase = if ours { BLOCKING } else { IDLE };
            return;
        }
        let brake = stopping_dynamics(axis, axis.fSWMaxDeceleration, 0.0).and_then(|l| Profile::to_velocity(set_motion(axis), 0.0, l));
        match brake {
            Some(profile) => {
                let state = axis.nAxisState;
                self.begin(axis, cx, profile, state);
                self.phase = BRAKING;
            }
            None => {
                axis.nAxisState = AxisState::errorstop;
                axis.bError = Bool::TRUE;
                axis.dwErrorID.0 = error.0 as u32;
            }
        }
    }

    fn keep(&mut self, order: Order) {
        (self.goal, self.place, self.direction) = match order.goal {
            Goal::Absolute(place, direction) => (0, place, direction.0),
            Goal::Relative(distance) => (1, distance, 0),
            Goal::Velocity(velocity) => (VELOCITY, velocity, 0),
            Goal::Halt => (3, 0.0, 0),
            Goal::Stop => (STOP, 0.0, 0),
        };
        (self.velocity, self.acceleration, self.deceleration, self.jerk) =
            (order.velocity, order.acceleration, order.deceleration, order.jerk);
    }

    fn order(&self) -> Order {
        let goal = match self.goal {
            0 => Goal::Absolute(self.place, Direction(self.direction)),
            1 => Goal::Relative(self.place),
            VELOCITY => Goal::Velocity(self.place),
            3 => Goal::Halt,
            _ => Goal::Stop,
        };
        Order {
            goal,
            velocity: self.velocity,
            acceleration: self.acceleration,
            deceleration: self.deceleration,
            jerk: self.jerk,
            buffer: BufferMode::Aborting,
        }
    }
}

const VELOCITY: u8 = 2;
const STOP: u8 = 4;

fn state_of(goal: u8) -> AxisState {
    match goal {
        VELOCITY => AxisState::continuous_motion,
        STOP => AxisState::stopping,
        _ => AxisState::discrete_motion,
    }
}

/// An in-out to an offset.
fn at(offset: u64) -> InOut<AxisRef> {
    takt_abi::Plain::load(&offset.to_le_bytes())
}

/// Why MC_Stop cannot stop the axis, if it cannot.
fn stop_refusal(axis: &AxisRef, cx: &Cx<'_>) -> Option<SmcError> {
    match axis.nAxisState {
        _ if !cx.in_bus_task() => Some(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
        AxisState::power_off => Some(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        AxisState::errorstop => Some(SmcError::SMC_MS_AXIS_IN_ERRORSTOP),
        AxisState::stopping if axis.nCommandedBy != cx.this => Some(SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
        _ => None,
    }
}

/// Plans an order from a state of the axis.
fn plan(axis: &AxisRef, order: Order, start: Motion) -> Result<Profile, SmcError> {
    let Order { velocity, acceleration, deceleration, jerk, .. } = order;
    let limits = |error| dynamics(axis, velocity, acceleration, deceleration, jerk).ok_or(error);
    match order.goal {
        Goal::Absolute(place, direction) => {
            if !place.is_finite() {
                return Err(SmcError::SMC_INVALID_POSITION);
            }
            to_place(axis, start, place, direction, limits(SmcError::SMC_MA_INVALID_VELACC_VALUES)?)
        }
        Goal::Relative(distance) => {
            let target = start.p + distance;
            if !target.is_finite() {
                return Err(SmcError::SMC_INVALID_POSITION);
            }
            within_travel(axis, target)?;
            let limits = limits(SmcError::SMC_MA_INVALID_VELACC_VALUES)?;
            Profile::to_position(start, target, limits).ok_or(SmcError::SMC_MA_INVALID_VELACC_VALUES)
        }
        Goal::Velocity(target) => to_velocity(axis, start, target, order),
        Goal::Halt | Goal::Stop => {
            let limits = stopping_dynamics(axis, deceleration, jerk).ok_or(SmcError::SMC_MS_INVALID_ACCDEC_VALUES)?;
            Profile::to_velocity(start, 0.0, limits).ok_or(SmcError::SMC_MS_INVALID_ACCDEC_VALUES)
        }
    }
}

fn within_travel(axis: &AxisRef, target: f64) -> Result<(), SmcError> {
    match travel(axis) {
        Some((low, high)) if !(target >= low && target <= high) => Err(SmcError::SMC_DI_SWLIMITS_EXCEEDED),
        _ => Ok(()),
    }
}

fn to_place(axis: &AxisRef, start: Motion, place: f64, direction: Direction, limits: Limits) -> Result<Profile, SmcError> {
    let failed = SmcError::SMC_MA_INVALID_VELACC_VALUES;
    let Some(period) = modulo(axis) else {
        within_travel(axis, place)?;
        return Profile::to_position(start, place, limits).ok_or(failed);
    };
    let onwards = wrapped(axis, place - start.p);
    let rest = Profile::to_velocity(start, 0.0, limits).ok_or(failed)?.end_p - start.p;
    // So many whole turns more that the axis can stop there without turning back.
    let forwards = onwards + period * ((rest - onwards) / period).ceil().max(0.0);
    let backwards = onwards - period - period * ((onwards - period - rest) / period).ceil().max(0.0);
    let backwards = if onwards == 0.0 && rest >= 0.0 { 0.0 } else { backwards };
    let go = |way: f64| Profile::to_position(start, start.p + way, limits).ok_or(failed);
    match direction {
        Direction::positive => go(forwards),
        Direction::negative => go(backwards),
        Direction::current => go(if start.v < 0.0 { backwards } else { forwards }),
        Direction::shortest => go(if onwards > period / 2.0 { onwards - period } else { onwards }),
        Direction::fastest => {
            let (a, b) = (go(onwards)?, go(onwards - period)?);
            Ok(if b.duration() < a.duration() { b } else { a })
        }
        _ => Err(SmcError::SMC_MA_INVALID_DIRECTION),
    }
}

/// To a velocity; where travel is limited and the axis knows where it is, at the most to the limit.
fn to_velocity(axis: &AxisRef, start: Motion, target: f64, order: Order) -> Result<Profile, SmcError> {
    let failed = SmcError::SMC_MV_INVALID_ACCDEC_VALUES;
    let speed = if target == 0.0 { axis.fSWMaxVelocity } else { target.abs() };
    let limits = dynamics(axis, speed, order.acceleration, order.deceleration, order.jerk).ok_or(failed)?;
    let planned = match travel(axis) {
        Some((low, high)) if axis.bHomed.get() && target != 0.0 => {
            let end = if target > 0.0 { high } else { low };
            if (end - start.p) * target <= 0.0 {
                return Err(SmcError::SMC_DI_SWLIMITS_EXCEEDED);
            }
            Profile::to_position(start, end, limits)
        }
        _ => Profile::to_velocity(start, target, limits),
    };
    planned.ok_or(failed)
}
