//! MC_Home and MC_SetPosition: where an axis is.

use crate::motion::axis::{modulo, take_over, wrapped};
use crate::motion::power::{FAILED, NOTHING, REQUESTED, SUCCEEDED};
use takt_abi::{AxisRef, AxisState, Bool, SmcError, function_block};

function_block! {
    /// Lets the drive find its reference. The position there is `Position` (plus the offset of the axis' configuration). State: homing, then standstill.
    ///
    /// How the drive searches (method, speeds) is configuration of the axis. There is no time limit here: a program that cannot wait calls MC_Stop, which ends
    /// the homing with `CommandAborted`.
    ///
    /// Errors: SMC_FB_CALLED_FROM_WRONG_TASK, SMC_REGULATOR_OR_START_NOT_SET (no power), SMC_H_AXIS_IN_ERRORSTOP, SMC_H_AXIS_WASNT_STANDSTILL,
    /// SMC_INVALID_POSITION (not finite), SMC_DI_HOMING_ERROR (the drive found no reference), SMC_AXIS_ERROR_DURING_MOTION.
    pub block MC_Home as Home {
        input {
            /// Rising edge: start.
            Execute: Bool,
            /// Position at the reference, technical units.
            Position: f64,
        }
        output {
            /// The axis knows where it is.
            Done: Bool,
            /// Searching.
            Busy: Bool,
            /// Another command has taken over.
            CommandAborted: Bool,
            /// Refused or failed.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state {
            /// `Execute` at the last call.
            last: Bool,
        }
    }
    fn cycle(fb, cx) {
        let rising = fb.Execute.get() && !fb.last.get();
        fb.last = fb.Execute;
        if !fb.Busy.get() && (rising || !fb.Execute.get()) {
            (fb.Done, fb.CommandAborted, fb.Error, fb.ErrorID) = (Bool::FALSE, Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        }
        if !fb.Busy.get() && !rising {
            return Ok(());
        }
        let mut axis = cx.get(fb.Axis)?;
        let ours = axis.nCommandedBy == cx.this || axis.nCommandedBy == 0;
        let outcome = if fb.Busy.get() {
            match axis.nAxisState {
                _ if !cx.in_bus_task() => Search::Failed(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
                _ if ours && axis.byHoming == SUCCEEDED => Search::Done,
                _ if ours && axis.byHoming == FAILED => Search::Failed(SmcError::SMC_DI_HOMING_ERROR),
                AxisState::errorstop => Search::Failed(SmcError::SMC_AXIS_ERROR_DURING_MOTION),
                AxisState::power_off => Search::Failed(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
                AxisState::homing if ours && axis.byHoming != NOTHING => Search::UnderWay,
                _ => Search::Aborted,
            }
        } else {
            match axis.nAxisState {
                _ if !cx.in_bus_task() => Search::Failed(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
                AxisState::power_off => Search::Failed(SmcError::SMC_REGULATOR_OR_START_NOT_SET),
                AxisState::errorstop => Search::Failed(SmcError::SMC_H_AXIS_IN_ERRORSTOP),
                AxisState::standstill if !fb.Position.is_finite() => Search::Failed(SmcError::SMC_INVALID_POSITION),
                AxisState::standstill => {
                    take_over(&mut axis, cx, AxisState::homing);
                    (axis.byHoming, axis.fHomePosition) = (REQUESTED, fb.Position);
                    Search::UnderWay
                }
                _ => Search::Failed(SmcError::SMC_H_AXIS_WASNT_STANDSTILL),
            }
        };
        let was_busy = fb.Busy.get();
        fb.Busy = (outcome == Search::UnderWay).into();
        match outcome {
            Search::UnderWay => axis.nCommandCycle = axis.nBusCycle,
            Search::Done => fb.Done = Bool::TRUE,
            Search::Aborted => fb.CommandAborted = Bool::TRUE,
            Search::Failed(error) => (fb.Error, fb.ErrorID) = (Bool::TRUE, error),
        }
        if was_busy && ours && outcome != Search::UnderWay && cx.in_bus_task() {
            (axis.byHoming, axis.nCommandedBy) = (NOTHING, 0);
        }
        cx.set(fb.Axis, &axis)
    }
}

/// How a homing stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    UnderWay,
    Done,
    Aborted,
    Failed(SmcError),
}

function_block! {
    /// Says where a standing axis is, without moving it: at `Position`, or with `Mode` TRUE by `Position` farther than it thinks.
    ///
    /// Set and actual position and `fOffset` of the axis change together. Errors: SMC_FB_CALLED_FROM_WRONG_TASK, SMC_INVALID_POSITION (not finite),
    /// SMC_AXIS_NOT_READY_FOR_MOTION (the axis is neither in standstill nor in power_off: a set position that jumps would be followed).
    pub block MC_SetPosition as SetPosition {
        input {
            /// Rising edge: set.
            Execute: Bool,
            /// Position, or distance, technical units.
            Position: f64,
            /// TRUE: `Position` is a distance.
            Mode: Bool,
        }
        output {
            /// The position has been set.
            Done: Bool,
            /// Never TRUE: the block is done at once.
            Busy: Bool,
            /// Refused.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state {
            /// `Execute` at the last call.
            last: Bool,
        }
    }
    fn cycle(fb, cx) {
        let rising = fb.Execute.get() && !fb.last.get();
        fb.last = fb.Execute;
        if rising || !fb.Execute.get() {
            (fb.Done, fb.Error, fb.ErrorID) = (Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        }
        if !rising {
            return Ok(());
        }
        let mut axis = cx.get(fb.Axis)?;
        let target = if fb.Mode.get() { axis.fSetPosition + fb.Position } else { fb.Position };
        let by = wrapped(&axis, target) - axis.fSetPosition;
        let at_rest = axis.nAxisState == AxisState::standstill || axis.nAxisState == AxisState::power_off;
        fb.ErrorID = match at_rest {
            _ if !cx.in_bus_task() => SmcError::SMC_FB_CALLED_FROM_WRONG_TASK,
            false => SmcError::SMC_AXIS_NOT_READY_FOR_MOTION,
            true if !by.is_finite() => SmcError::SMC_INVALID_POSITION,
            true => SmcError::SMC_NO_ERROR,
        };
        fb.Error = (fb.ErrorID != SmcError::SMC_NO_ERROR).into();
        fb.Done = (!fb.Error.get()).into();
        if fb.Done.get() {
            axis.fOffset -= by;
            axis.fSetPosition += by;
            axis.fActPosition += by;
            if modulo(&axis).is_some() {
                axis.fActPosition = wrapped(&axis, axis.fActPosition);
            }
            cx.set(fb.Axis, &axis)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};
    use crate::motion::stop::Stop;

    fn home() -> Home {
        Home { Axis: AXIS, Execute: Bool::TRUE, Position: 7.5, ..Home::default() }
    }

    #[test]
    fn homing_is_the_drives_and_ends_in_standstill() {
        let mut rig = AxisBench::new();
        let mut home = home();
        rig.call(1, |cx| home.cycle(cx));
        assert_eq!(rig.axis().nAxisState, AxisState::homing);
        for _ in 0..5 {
            assert!(home.Busy.get() && !home.Done.get());
            rig.next();
            rig.call(1, |cx| home.cycle(cx));
        }
        while home.Busy.get() {
            rig.next();
            rig.call(1, |cx| home.cycle(cx));
        }
        let axis = rig.axis();
        assert!(home.Done.get() && axis.bHomed.get() && axis.fSetPosition == 7.5 && axis.byHoming == NOTHING && axis.nCommandedBy == 0);
        assert_eq!(axis.nAxisState, AxisState::standstill);
        rig.call(1, |cx| home.cycle(cx));
        assert!(home.Done.get());
        home.Execute = Bool::FALSE;
        rig.call(1, |cx| home.cycle(cx));
        assert!(!home.Done.get());
    }

    #[test]
    fn a_reference_that_is_not_found_is_an_error() {
        let mut rig = AxisBench::new();
        rig.hopeless = true;
        let mut home = home();
        rig.call(1, |cx| home.cycle(cx));
        home.Execute = Bool::FALSE;
        while home.Busy.get() {
            rig.next();
            rig.call(1, |cx| home.cycle(cx));
        }
        assert!(home.Error.get() && home.ErrorID == SmcError::SMC_DI_HOMING_ERROR);
        rig.call(1, |cx| home.cycle(cx));
        assert!(!home.Error.get(), "shown for one call");
    }

    #[test]
    fn homing_starts_from_standstill_only_and_mc_stop_ends_it() {
        let mut rig = AxisBench::off();
        let mut first = home();
        rig.call(1, |cx| first.cycle(cx));
        assert_eq!(first.ErrorID, SmcError::SMC_REGULATOR_OR_START_NOT_SET);
        let mut rig = AxisBench::new();
        let mut first = home();
        rig.call(1, |cx| first.cycle(cx));
        let mut second = home();
        rig.call(2, |cx| second.cycle(cx));
        assert_eq!(second.ErrorID, SmcError::SMC_H_AXIS_WASNT_STANDSTILL);
        rig.next();
        rig.call(1, |cx| first.cycle(cx));
        let mut stop = Stop { Axis: AXIS, Execute: Bool::TRUE, Deceleration: 100.0, ..Stop::default() };
        rig.call(3, |cx| stop.cycle(cx));
        rig.call(1, |cx| first.cycle(cx));
        assert!(first.CommandAborted.get() && !first.Busy.get() && rig.axis().byHoming == NOTHING);
        stop.Execute = Bool::FALSE;
        rig.next();
        rig.call(3, |cx| stop.cycle(cx));
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
        let mut bad = Home { Position: f64::NAN, ..home() };
        rig.call(4, |cx| bad.cycle(cx));
        assert_eq!(bad.ErrorID, SmcError::SMC_INVALID_POSITION);
    }

    #[test]
    fn a_position_can_be_set_while_the_axis_stands() {
        let mut rig = AxisBench::new();
        let mut set = SetPosition { Axis: AXIS, Execute: Bool::TRUE, Position: 12.0, ..SetPosition::default() };
        rig.call(1, |cx| set.cycle(cx));
        let axis = rig.axis();
        assert!(set.Done.get() && axis.fSetPosition == 12.0 && axis.fActPosition == 12.0 && axis.fOffset == -12.0);
        set.Execute = Bool::FALSE;
        rig.call(1, |cx| set.cycle(cx));
        (set.Execute, set.Mode) = (Bool::TRUE, Bool::TRUE);
        rig.call(1, |cx| set.cycle(cx));
        assert_eq!((rig.axis().fSetPosition, rig.axis().fOffset), (24.0, -24.0));
        rig.change(|a| a.nAxisState = AxisState::discrete_motion);
        set.last = Bool::FALSE;
        rig.call(1, |cx| set.cycle(cx));
        assert_eq!(set.ErrorID, SmcError::SMC_AXIS_NOT_READY_FOR_MOTION);
    }
}
