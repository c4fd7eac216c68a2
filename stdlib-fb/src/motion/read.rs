//! MC_ReadStatus and MC_ReadActualPosition: an axis as outputs. They may be called in any task.

use takt_abi::{AxisRef, AxisState, Bool, Plain, SmcError, function_block};

function_block! {
    /// The state of an axis as BOOLs, while `Enable` is TRUE.
    pub block MC_ReadStatus as ReadStatus {
        input {
            /// Read in every call.
            Enable: Bool,
        }
        output {
            /// The outputs below are those of the axis.
            Valid: Bool,
            /// As `Enable`.
            Busy: Bool,
            /// Never TRUE.
            Error: Bool,
            /// Always SMC_NO_ERROR.
            ErrorID: SmcError,
            Disabled: Bool,
            Errorstop: Bool,
            Stopping: Bool,
            StandStill: Bool,
            DiscreteMotion: Bool,
            ContinuousMotion: Bool,
            SynchronizedMotion: Bool,
            Homing: Bool,
            /// Moving, and the set velocity does not change.
            ConstantVelocity: Bool,
            /// The set speed rises.
            Accelerating: Bool,
            /// The set speed falls.
            Decelerating: Bool,
            /// The axis has an error.
            FBErrorOccured: Bool,
        }
        inout { Axis: AxisRef }
        state {}
    }
    fn cycle(fb, cx) {
        let on = fb.Enable.get();
        (fb.Valid, fb.Busy) = (fb.Enable, fb.Enable);
        let axis = if on { cx.get(fb.Axis)? } else { AxisRef::default() };
        let is = |state: AxisState| Bool::from(on && axis.nAxisState == state);
        (fb.Disabled, fb.Errorstop, fb.Stopping) = (is(AxisState::power_off), is(AxisState::errorstop), is(AxisState::stopping));
        (fb.StandStill, fb.Homing) = (is(AxisState::standstill), is(AxisState::homing));
        fb.DiscreteMotion = is(AxisState::discrete_motion);
        fb.ContinuousMotion = is(AxisState::continuous_motion);
        fb.SynchronizedMotion = is(AxisState::synchronized_motion);
        let (v, a) = (axis.fSetVelocity, axis.fSetAcceleration);
        fb.ConstantVelocity = (on && v != 0.0 && a == 0.0).into();
        fb.Accelerating = (on && (v * a > 0.0 || (v == 0.0 && a != 0.0))).into();
        fb.Decelerating = (on && v * a < 0.0).into();
        fb.FBErrorOccured = (on && axis.bError.get()).into();
        Ok(())
    }
}

function_block! {
    /// The actual position of an axis, while `Enable` is TRUE.
    pub block MC_ReadActualPosition as ReadActualPosition {
        input {
            /// Read in every call.
            Enable: Bool,
        }
        output {
            /// `Position` is the actual position.
            Valid: Bool,
            /// As `Enable`.
            Busy: Bool,
            /// Never TRUE.
            Error: Bool,
            /// Always SMC_NO_ERROR.
            ErrorID: SmcError,
            /// Actual position, technical units.
            Position: f64,
        }
        inout { Axis: AxisRef }
        state {}
    }
    fn cycle(fb, cx) {
        (fb.Valid, fb.Busy) = (fb.Enable, fb.Enable);
        if fb.Enable.get() {
            let axis = cx.bytes(fb.Axis.0, size_of::<AxisRef>())?;
            fb.Position = f64::load(&axis[std::mem::offset_of!(AxisRef, fActPosition)..]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};

    #[test]
    fn status_and_position_are_those_of_the_axis_while_enabled() {
        let mut rig = AxisBench::new();
        rig.change(|a| (a.fActPosition, a.fSetVelocity, a.fSetAcceleration, a.nAxisState) = (3.0, 2.0, -1.0, AxisState::discrete_motion));
        let mut status = ReadStatus { Axis: AXIS, ..ReadStatus::default() };
        let mut position = ReadActualPosition { Axis: AXIS, ..ReadActualPosition::default() };
        rig.call(1, |cx| status.cycle(cx));
        assert!(!status.Valid.get() && !status.DiscreteMotion.get() && !status.Disabled.get());
        (status.Enable, position.Enable) = (Bool::TRUE, Bool::TRUE);
        rig.call(1, |cx| status.cycle(cx));
        rig.call(2, |cx| position.cycle(cx));
        assert!(status.Valid.get() && status.DiscreteMotion.get() && status.Decelerating.get() && !status.StandStill.get());
        assert!(position.Valid.get() && position.Position == 3.0);
    }
}
