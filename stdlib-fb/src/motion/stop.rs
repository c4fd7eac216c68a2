//! MC_Stop and MC_Halt: to rest along the axis, jerk-limited.

use crate::motion::command::{Command, Goal, Order};
use takt_abi::{AxisRef, Bool, BufferMode, Plain, SmcError, function_block};

function_block! {
    /// Brings an axis to rest and keeps every other command away while `Execute` is TRUE. State: stopping, left to standstill when the axis stands
    /// still and `Execute` is FALSE.
    ///
    /// `Deceleration` must be positive; larger values than the axis' limits are cut to them, a `Jerk` of 0 means the axis' own. A homing under way is
    /// ended too. Errors: SMC_FB_CALLED_FROM_WRONG_TASK, SMC_REGULATOR_OR_START_NOT_SET (no power), SMC_MS_AXIS_IN_ERRORSTOP,
    /// SMC_AXIS_NOT_READY_FOR_MOTION (another MC_Stop is stopping the axis), SMC_MS_INVALID_ACCDEC_VALUES, SMC_AXIS_ERROR_DURING_MOTION,
    /// SMC_FB_ACTIVE_AXIS_DISABLED (the drive's quick stop has taken the axis away).
    pub block MC_Stop as Stop {
        input {
            /// Rising edge: stop. While TRUE, the axis takes no command.
            Execute: Bool,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
        }
        output {
            /// The axis stands still.
            Done: Bool,
            /// Braking.
            Busy: Bool,
            /// Refused or failed.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state { command: Command = <Command as Plain>::INIT }
    }
    fn cycle(fb, cx) {
        fb.command.call(fb.Axis, fb.Execute, order(Goal::Stop, fb.Deceleration, fb.Jerk, BufferMode::Aborting), cx)?;
        let c = &fb.command;
        (fb.Done, fb.Busy, fb.Error, fb.ErrorID) = (c.done, c.busy(), c.error, c.id);
        if c.aborted.get() {
            (fb.Error, fb.ErrorID) = (Bool::TRUE, SmcError::SMC_FB_ACTIVE_AXIS_DISABLED);
        }
        Ok(())
    }
}

function_block! {
    /// Brings an axis to rest; another command may take over before it stands. State: discrete_motion, then standstill. Inputs as MC_Stop, errors as
    /// MC_Stop and MC_MoveAbsolute.
    pub block MC_Halt as Halt {
        input {
            /// Rising edge: halt.
            Execute: Bool,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
            /// When to start.
            BufferMode: BufferMode = BufferMode::Aborting,
        }
        output {
            /// The axis stands still.
            Done: Bool,
            /// Braking.
            Busy: Bool,
            /// Braking.
            Active: Bool,
            /// Another command has taken over.
            CommandAborted: Bool,
            /// Refused or failed.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state { command: Command = <Command as Plain>::INIT }
    }
    fn cycle(fb, cx) {
        fb.command.call(fb.Axis, fb.Execute, order(Goal::Halt, fb.Deceleration, fb.Jerk, fb.BufferMode), cx)?;
        let c = &fb.command;
        (fb.Done, fb.Busy, fb.Active) = (c.done, c.busy(), c.active);
        (fb.CommandAborted, fb.Error, fb.ErrorID) = (c.aborted, c.error, c.id);
        Ok(())
    }
}

/// To rest; nothing but deceleration and jerk matters.
pub(super) fn order(goal: Goal, deceleration: f64, jerk: f64, buffer: BufferMode) -> Order {
    Order { goal, velocity: 0.0, acceleration: 0.0, deceleration, jerk, buffer }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};
    use crate::motion::moves::MoveVelocity;
    use takt_abi::AxisState;

    fn running() -> (AxisBench, MoveVelocity) {
        let mut rig = AxisBench::new();
        rig.watch(50.0, 1000.0, 20_000.0);
        let mut fb = MoveVelocity {
            Axis: AXIS,
            Execute: Bool::TRUE,
            Velocity: 50.0,
            Acceleration: 1000.0,
            Deceleration: 1000.0,
            Jerk: 20_000.0,
            ..MoveVelocity::default()
        };
        for _ in 0..60 {
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
        }
        (rig, fb)
    }
    fn stop() -> Stop {
        Stop { Axis: AXIS, Execute: Bool::TRUE, Deceleration: 1000.0, Jerk: 20_000.0, ..Stop::default() }
    }

    #[test]
    fn stop_keeps_the_axis_until_execute_falls() {
        let (mut rig, mut moving) = running();
        let (mut fb, mut second) = (stop(), stop());
        rig.call(2, |cx| fb.cycle(cx));
        rig.call(1, |cx| moving.cycle(cx));
        assert!(fb.Busy.get() && moving.CommandAborted.get() && rig.axis().nAxisState == AxisState::stopping);
        rig.call(3, |cx| second.cycle(cx));
        assert!(second.Error.get() && second.ErrorID == SmcError::SMC_AXIS_NOT_READY_FOR_MOTION);
        while !fb.Done.get() {
            assert!(fb.Busy.get());
            rig.next();
            rig.call(2, |cx| fb.cycle(cx));
        }
        for _ in 0..5 {
            rig.next();
            rig.call(2, |cx| fb.cycle(cx));
            assert!(fb.Done.get() && !fb.Busy.get() && rig.axis().nAxisState == AxisState::stopping && rig.axis().fSetVelocity == 0.0);
            (moving.Execute, moving.command.last) = (Bool::TRUE, Bool::FALSE);
            rig.call(1, |cx| moving.cycle(cx));
            assert_eq!(moving.ErrorID, SmcError::SMC_AXIS_NOT_READY_FOR_MOTION);
        }
        fb.Execute = Bool::FALSE;
        rig.next();
        rig.call(2, |cx| fb.cycle(cx));
        assert!(!fb.Done.get() && rig.axis().nAxisState == AxisState::standstill && rig.axis().nCommandedBy == 0);
    }

    #[test]
    fn a_short_pulse_stops_the_axis_too() {
        let (mut rig, _) = running();
        let mut fb = stop();
        rig.call(2, |cx| fb.cycle(cx));
        fb.Execute = Bool::FALSE;
        while fb.Busy.get() {
            rig.next();
            rig.call(2, |cx| fb.cycle(cx));
        }
        assert!(fb.Done.get() && rig.axis().nAxisState == AxisState::standstill);
        rig.next();
        rig.call(2, |cx| fb.cycle(cx));
        assert!(!fb.Done.get());
    }

    #[test]
    fn stop_needs_power_and_a_deceleration_but_not_a_modest_one() {
        let error = |fb: &mut Stop, rig: &mut AxisBench| {
            rig.call(2, |cx| fb.cycle(cx));
            fb.ErrorID
        };
        assert_eq!(error(&mut stop(), &mut AxisBench::off()), SmcError::SMC_REGULATOR_OR_START_NOT_SET);
        let (mut rig, _) = running();
        let none = &mut Stop { Deceleration: 0.0, ..stop() };
        assert_eq!(error(none, &mut rig), SmcError::SMC_MS_INVALID_ACCDEC_VALUES);
        let eager = &mut Stop { Deceleration: 1e300, Jerk: 1e300, ..stop() };
        assert_eq!(error(eager, &mut rig), SmcError::SMC_NO_ERROR);
        rig.change(|a| a.nAxisState = AxisState::errorstop);
        assert_eq!(error(&mut stop(), &mut rig), SmcError::SMC_MS_AXIS_IN_ERRORSTOP);
    }

    #[test]
    fn a_stop_that_loses_the_axis_to_a_quick_stop_is_an_error() {
        let (mut rig, _) = running();
        let mut fb = stop();
        rig.call(2, |cx| fb.cycle(cx));
        rig.next();
        rig.change(|a| (a.nCommandedBy, a.bDriveStartRealState) = (0, Bool::FALSE));
        rig.call(2, |cx| fb.cycle(cx));
        assert!(fb.Error.get() && fb.ErrorID == SmcError::SMC_FB_ACTIVE_AXIS_DISABLED && !fb.Busy.get() && !fb.Done.get());
    }

    #[test]
    fn halt_can_be_taken_over() {
        let (mut rig, mut moving) = running();
        let mut fb = Halt { Axis: AXIS, Execute: Bool::TRUE, Deceleration: 1000.0, Jerk: 20_000.0, ..Halt::default() };
        for _ in 0..20 {
            rig.call(2, |cx| fb.cycle(cx));
            rig.call(1, |cx| moving.cycle(cx));
            rig.next();
        }
        assert!(fb.Busy.get() && fb.Active.get() && moving.CommandAborted.get());
        moving.command.last = Bool::FALSE;
        rig.call(2, |cx| fb.cycle(cx));
        rig.call(1, |cx| moving.cycle(cx));
        rig.next();
        rig.call(2, |cx| fb.cycle(cx));
        rig.call(1, |cx| moving.cycle(cx));
        assert!(fb.CommandAborted.get() && moving.Busy.get());
        rig.next();
        (fb.command.last, fb.Execute) = (Bool::FALSE, Bool::TRUE);
        while !fb.Done.get() {
            rig.call(1, |cx| moving.cycle(cx));
            rig.call(2, |cx| fb.cycle(cx));
            rig.next();
        }
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
    }
}
