//! What every block on an axis does the same way: may it start, is it still in command, how set values are written.
//!
//! The contract with the engine's axis stage is [`takt_abi::AxisRef`]: a block that commands an axis has written its instance into `nCommandedBy` and
//! writes set values and `nCommandCycle` in every bus cycle; the stage carries them to the drive, checks them and makes the states that depend on
//! the drive (power_off, errorstop, the end of homing). A block that finds another instance in `nCommandedBy` has been aborted.

use crate::motion::profile::{Limits, Motion};
use takt_abi::{AxisRef, AxisState, Cx, SmcError};

/// How far a command may exceed a limit of the axis by rounding, as a factor.
pub const ROUNDING: f64 = 1.0 + 1e-9;

/// Why the axis cannot take a motion command now, if it cannot.
pub fn refusal(axis: &AxisRef, cx: &Cx<'_>) -> Option<SmcError> {
    let moving = [AxisState::discrete_motion, AxisState::continuous_motion, AxisState::synchronized_motion];
    match axis.nAxisState {
        _ if !cx.in_bus_task() => Some(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
        AxisState::power_off => Some(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        state if state != AxisState::standstill && !moving.contains(&state) => Some(SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
        _ if !axis.bDriveStartRealState.get() => Some(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        _ => None,
    }
}

/// How a block that has commanded the axis until now finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// Still in command.
    Ours,
    /// Another command has taken the axis over.
    Aborted,
    /// The axis can no longer be commanded.
    Lost(SmcError),
}

/// Whether `cx.this` still commands the axis.
pub fn hold(axis: &AxisRef, cx: &Cx<'_>) -> Hold {
    match axis.nAxisState {
        _ if !cx.in_bus_task() => Hold::Lost(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
        AxisState::errorstop => Hold::Lost(SmcError::SMC_AXIS_ERROR_DURING_MOTION),
        AxisState::power_off => Hold::Lost(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        _ if axis.nCommandedBy != cx.this => Hold::Aborted,
        AxisState::homing => Hold::Ours,
        _ if !axis.bDriveStartRealState.get() => Hold::Lost(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        _ => Hold::Ours,
    }
}

/// Takes the axis over.
pub fn take_over(axis: &mut AxisRef, cx: &Cx<'_>, state: AxisState) {
    axis.nCommandedBy = cx.this;
    axis.iOwner = axis.iOwner.wrapping_add(1);
    axis.nAxisState = state;
}

/// Ends the command: the axis stands still and belongs to nobody.
pub fn release(axis: &mut AxisRef) {
    axis.nCommandedBy = 0;
    axis.nAxisState = AxisState::standstill;
    (axis.fSetVelocity, axis.fSetAcceleration) = (0.0, 0.0);
}

/// Writes the set values of this bus cycle.
pub fn write_set_values(axis: &mut AxisRef, motion: Motion) {
    axis.fSetPosition = wrapped(axis, motion.p);
    axis.fSetVelocity = motion.v;
    axis.fSetAcceleration = motion.a;
    axis.nCommandCycle = axis.nBusCycle;
}

/// The motion from which a command starts: the set values, at rest when the axis stands still.
pub fn set_motion(axis: &AxisRef) -> Motion {
    if axis.nAxisState == AxisState::standstill {
        return Motion { p: axis.fSetPosition, ..Motion::default() };
    }
    let bound = axis.fSWMaxAcceleration.max(axis.fSWMaxDeceleration).abs();
    let a = axis.fSetAcceleration.max(-bound).min(bound);
    Motion { p: axis.fSetPosition, v: axis.fSetVelocity, a }
}

/// The period of a modulo axis; `None` on a finite one.
pub fn modulo(axis: &AxisRef) -> Option<f64> {
    (axis.iMovementType == 0 && axis.fPositionPeriod.is_finite() && axis.fPositionPeriod > 0.0).then_some(axis.fPositionPeriod)
}

/// A position within the period of a modulo axis.
pub fn wrapped(axis: &AxisRef, position: f64) -> f64 {
    match modulo(axis) {
        // A remainder just below 0 is rounded up to the whole period.
        Some(period) if position.rem_euclid(period) >= period => 0.0,
        Some(period) => position.rem_euclid(period),
        None => position,
    }
}

/// The software limits of a finite axis that has them enabled.
pub fn travel(axis: &AxisRef) -> Option<(f64, f64)> {
    (axis.bSWLimitEnable.get() && modulo(axis).is_none()).then_some((axis.fSWLimitNegative, axis.fSWLimitPositive))
}

/// A command's dynamics as limits, if they are positive, finite and within those of the axis. A jerk of 0 means the axis' own; a larger one is cut to it.
pub fn dynamics(axis: &AxisRef, velocity: f64, acceleration: f64, deceleration: f64, jerk: f64) -> Option<Limits> {
    let within = |x: f64, limit: f64| x > 0.0 && x <= limit * ROUNDING;
    let good = within(velocity, axis.fSWMaxVelocity)
        && within(acceleration, axis.fSWMaxAcceleration)
        && within(deceleration, axis.fSWMaxDeceleration)
        && jerk >= 0.0
        && axis.fSWMaxJerk > 0.0;
    let jerk = if jerk > 0.0 { jerk.min(axis.fSWMaxJerk) } else { axis.fSWMaxJerk };
    let limits = Limits { velocity, acceleration, deceleration, jerk };
    (good && limits.are_usable()).then_some(limits)
}

/// Dynamics of a stop: cut to the limits of the axis, for a stop is not to fail because it was asked for too eagerly.
pub fn stopping_dynamics(axis: &AxisRef, deceleration: f64, jerk: f64) -> Option<Limits> {
    let deceleration = deceleration.min(axis.fSWMaxDeceleration);
    let velocity = axis.fSWMaxVelocity;
    let acceleration = axis.fSWMaxAcceleration.min(deceleration);
    dynamics(axis, velocity, acceleration, deceleration, jerk)
}
