//! MC_Power and MC_Reset: the axis' power and its errors.

use std::mem::offset_of;
use takt_abi::{AxisRef, AxisState, Bool, Dword, Plain, SmcError, function_block};

function_block! {
    /// Switches an axis on and off, in every cycle. Inputs act only while `Enable` is TRUE: power off is `Enable` TRUE with `bRegulatorOn` FALSE;
    /// `Enable` FALSE leaves the axis as it is.
    ///
    /// `bDriveStart` FALSE is the drive's quick stop. The axis goes to standstill when the drive is in operation, to power_off when it is switched off, and to
    /// errorstop when power is lost in operation. `Error` while the axis is in errorstop (`ErrorID` is the axis' error), or
    /// SMC_FB_CALLED_FROM_WRONG_TASK.
    pub block MC_Power as Power {
        input {
            /// The inputs act.
            Enable: Bool,
            /// Closed-loop control on.
            bRegulatorOn: Bool,
            /// Motion allowed; FALSE: quick stop.
            bDriveStart: Bool,
        }
        output {
            /// The axis is in control and follows set values.
            Status: Bool,
            /// The drive is in control.
            bRegulatorRealState: Bool,
            /// The drive follows set values.
            bDriveStartRealState: Bool,
            /// The block is acting.
            Busy: Bool,
            /// The axis is in errorstop.
            Error: Bool,
            /// Its error.
            ErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state {}
    }
    fn cycle(fb, cx) {
        let in_place = cx.in_bus_task();
        // Called in every cycle: reads and writes only the fields it needs.
        let axis = cx.bytes_mut(fb.Axis.0, size_of::<AxisRef>())?;
        if fb.Enable.get() && in_place {
            fb.bRegulatorOn.store(&mut axis[offset_of!(AxisRef, bRegulatorOn)..]);
            fb.bDriveStart.store(&mut axis[offset_of!(AxisRef, bDriveStart)..]);
        }
        fb.bRegulatorRealState = Bool::load(&axis[offset_of!(AxisRef, bRegulatorRealState)..]);
        fb.bDriveStartRealState = Bool::load(&axis[offset_of!(AxisRef, bDriveStartRealState)..]);
        let state = AxisState::load(&axis[offset_of!(AxisRef, nAxisState)..]);
        let id = Dword::load(&axis[offset_of!(AxisRef, dwErrorID)..]).0;
        let failed = state == AxisState::errorstop;
        let on = fb.bRegulatorRealState.get() && fb.bDriveStartRealState.get() && state != AxisState::power_off;
        fb.Status = (on && !failed).into();
        fb.ErrorID = match in_place {
            false => SmcError::SMC_FB_CALLED_FROM_WRONG_TASK,
            true if failed && id == 0 => SmcError::SMC_DI_AXIS_ERROR,
            true if failed => SmcError(i16::try_from(id).unwrap_or(SmcError::SMC_DI_AXIS_ERROR.0)),
            true => SmcError::SMC_NO_ERROR,
        };
        fb.Error = (fb.ErrorID != SmcError::SMC_NO_ERROR).into();
        fb.Busy = (fb.Enable.get() && !fb.Error.get()).into();
        Ok(())
    }
}

/// The numbers of the handshakes `byHoming` and `byReset` of the axis.
pub(super) const NOTHING: u8 = 0;
pub(super) const REQUESTED: u8 = 1;
pub(super) const SUCCEEDED: u8 = 3;
pub(super) const FAILED: u8 = 4;

function_block! {
    /// Takes an axis out of errorstop, to standstill or power_off, and resets its drive's error.
    ///
    /// Errors: SMC_FB_CALLED_FROM_WRONG_TASK, SMC_R_NO_ERROR_TO_RESET (the axis is not in errorstop), SMC_R_ERROR_NOT_RESETTABLE (the cause is still
    /// there).
    pub block MC_Reset as Reset {
        input {
            /// Rising edge: reset.
            Execute: Bool,
        }
        output {
            /// The axis is out of errorstop.
            Done: Bool,
            /// The drive is resetting.
            Busy: Bool,
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
            (fb.Done, fb.Error, fb.ErrorID) = (Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        }
        if !fb.Busy.get() && !rising {
            return Ok(());
        }
        let mut axis = cx.get(fb.Axis)?;
        let refused = match axis.nAxisState {
            _ if !cx.in_bus_task() => Some(SmcError::SMC_FB_CALLED_FROM_WRONG_TASK),
            _ if fb.Busy.get() && axis.byReset == FAILED => Some(SmcError::SMC_R_ERROR_NOT_RESETTABLE),
            state if !fb.Busy.get() && state != AxisState::errorstop && !axis.bError.get() => Some(SmcError::SMC_R_NO_ERROR_TO_RESET),
            _ => None,
        };
        if fb.Busy.get() && axis.byReset == FAILED {
            axis.byReset = NOTHING;
        }
        match refused {
            Some(error) => (fb.Busy, fb.Error, fb.ErrorID) = (Bool::FALSE, Bool::TRUE, error),
            None if !fb.Busy.get() => {
                // Whatever was commanded before the error is over.
                axis.byReset = REQUESTED;
                axis.nCommandedBy = 0;
                fb.Busy = Bool::TRUE;
            }
            None if axis.byReset == SUCCEEDED || axis.byReset == NOTHING => {
                axis.byReset = NOTHING;
                (fb.Busy, fb.Done) = (Bool::FALSE, Bool::TRUE);
            }
            None => {}
        }
        cx.set(fb.Axis, &axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};

    #[test]
    fn power_acts_while_enabled_and_shows_the_drive() {
        let mut rig = AxisBench::off();
        let mut power = Power { Axis: AXIS, ..Power::default() };
        let on = (Bool::TRUE, Bool::TRUE);
        (power.bRegulatorOn, power.bDriveStart) = on;
        rig.call(1, |cx| power.cycle(cx));
        rig.next();
        assert!(!rig.axis().bRegulatorOn.get() && !power.Status.get(), "nothing without Enable");
        power.Enable = Bool::TRUE;
        rig.call(1, |cx| power.cycle(cx));
        assert!(!power.Status.get() && power.Busy.get());
        rig.next();
        rig.call(1, |cx| power.cycle(cx));
        assert!(power.Status.get() && power.bRegulatorRealState.get() && power.bDriveStartRealState.get());
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
        (power.Enable, power.bRegulatorOn) = (Bool::FALSE, Bool::FALSE);
        rig.call(1, |cx| power.cycle(cx));
        rig.next();
        assert_eq!(rig.axis().nAxisState, AxisState::standstill, "Enable FALSE freezes");
        power.Enable = Bool::TRUE;
        rig.call(1, |cx| power.cycle(cx));
        rig.next();
        rig.call(1, |cx| power.cycle(cx));
        assert!(!power.Status.get() && !power.Error.get());
        assert_eq!(rig.axis().nAxisState, AxisState::power_off);
    }

    #[test]
    fn reset_is_for_an_axis_in_errorstop() {
        let mut rig = AxisBench::new();
        let mut reset = Reset { Axis: AXIS, Execute: Bool::TRUE, ..Reset::default() };
        rig.call(1, |cx| reset.cycle(cx));
        assert!(reset.Error.get() && reset.ErrorID == SmcError::SMC_R_NO_ERROR_TO_RESET);
        rig.change(|a| (a.nAxisState, a.bError, a.dwErrorID.0) = (AxisState::errorstop, Bool::TRUE, 16));
        let mut power = Power { Axis: AXIS, Enable: Bool::TRUE, bRegulatorOn: Bool::TRUE, bDriveStart: Bool::TRUE, ..Power::default() };
        rig.call(2, |cx| power.cycle(cx));
        assert!(power.Error.get() && power.ErrorID == SmcError::SMC_DI_POSITIONLAGERROR && !power.Busy.get());
        reset.Execute = Bool::FALSE;
        rig.call(1, |cx| reset.cycle(cx));
        assert!(!reset.Error.get());
        reset.Execute = Bool::TRUE;
        rig.call(1, |cx| reset.cycle(cx));
        assert!(reset.Busy.get() && !reset.Done.get());
        rig.next();
        rig.call(1, |cx| reset.cycle(cx));
        assert!(reset.Done.get() && !reset.Busy.get() && rig.axis().byReset == NOTHING);
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
    }

    #[test]
    fn an_error_that_stays_cannot_be_reset() {
        let mut rig = AxisBench::new();
        rig.change(|a| a.nAxisState = AxisState::errorstop);
        rig.hopeless = true;
        let mut reset = Reset { Axis: AXIS, Execute: Bool::TRUE, ..Reset::default() };
        rig.call(1, |cx| reset.cycle(cx));
        rig.next();
        rig.call(1, |cx| reset.cycle(cx));
        assert!(reset.Error.get() && reset.ErrorID == SmcError::SMC_R_ERROR_NOT_RESETTABLE);
    }
}
