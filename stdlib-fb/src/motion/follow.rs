//! FollowPosition and FollowPositionVelocity: an axis does what a program says, cycle by cycle.

use crate::motion::axis::{Hold, ROUNDING, hold, modulo, refusal, release, take_over, write_set_values};
use crate::motion::profile::Motion;
use takt_abi::{AxisRef, AxisState, Bool, Cx, Fault, InOut, SmcError, function_block, st_struct};

st_struct! {
    /// What a block that follows remembers, and its outputs.
    pub struct TAKT_FOLLOWER as Follower {
        /// bExecute at the last call.
        last: Bool,
        busy: Bool,
        aborted: Bool,
        error: Bool,
        id: SmcError,
        /// The axis that follows, as an offset.
        axis: u64,
    }
}

impl Follower {
    /// One call. `velocity`: the set velocity, if the program gives it.
    fn call(&mut self, place: InOut<AxisRef>, execute: Bool, position: f64, velocity: Option<f64>, cx: &mut Cx<'_>) -> Result<(), Fault> {
        let rising = execute.get() && !self.last.get();
        self.last = execute;
        if !self.busy.get() && (rising || !execute.get()) {
            (self.aborted, self.error, self.id) = (Bool::FALSE, Bool::FALSE, SmcError::SMC_NO_ERROR);
        }
        if !self.busy.get() && !rising {
            return Ok(());
        }
        let mut axis = cx.get(place)?;
        let refused = if self.busy.get() {
            match hold(&axis, cx) {
                _ if self.axis != place.0 => Some(SmcError::SMC_AXIS_REF_CHANGED_DURING_OPERATION),
                Hold::Ours => None,
                Hold::Aborted => {
                    (self.busy, self.aborted) = (Bool::FALSE, Bool::TRUE);
                    return Ok(());
                }
                Hold::Lost(error) => Some(error),
            }
        } else {
            refusal(&axis, cx)
        };
        if let Some(error) = refused {
            // The drive brakes by itself (quick stop): nobody commands the axis.
            let braked = self.busy.get() && error == SmcError::SMC_REGULATOR_OR_START_NOT_SET && axis.nAxisState != AxisState::power_off;
            self.fail(error);
            if braked {
                release(&mut axis);
                cx.set(place, &axis)?;
            }
            return Ok(());
        }
        if !self.busy.get() {
            take_over(&mut axis, cx, AxisState::synchronized_motion);
            (self.busy, self.axis) = (Bool::TRUE, place.0);
            axis.byHoming = 0;
        }
        self.follow(&mut axis, execute, position, velocity, cx);
        cx.set(place, &axis)
    }

    fn follow(&mut self, axis: &mut AxisRef, execute: Bool, position: f64, velocity: Option<f64>, cx: &Cx<'_>) {
        let seconds = cx.period.seconds();
        let step = modulo(axis).map_or(position - axis.fSetPosition, |period| nearest(position - axis.fSetPosition, period));
        let speed = step / seconds;
        let v = velocity.unwrap_or(speed);
        let bound = axis.fSWMaxVelocity * ROUNDING;
        let error = if !position.is_finite() {
            SmcError::SMC_INVALID_POSITION
        } else if !(speed.abs() <= bound && v.abs() <= bound) {
            SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED
        } else {
            if !execute.get() && step == 0.0 {
                write_set_values(axis, Motion { p: position, ..Motion::default() });
                release(axis);
                self.busy = Bool::FALSE;
                return;
            }
            let a = (v - axis.fSetVelocity) / seconds;
            write_set_values(axis, Motion { p: position, v, a });
            return;
        };
        axis.nAxisState = AxisState::errorstop;
        axis.bError = Bool::TRUE;
        axis.dwErrorID.0 = error.0 as u32;
        axis.nCommandedBy = 0;
        self.fail(error);
    }

    fn fail(&mut self, error: SmcError) {
        (self.busy, self.error, self.id) = (Bool::FALSE, Bool::TRUE, error);
    }
}

/// The shortest way for a difference on a modulo axis.
fn nearest(difference: f64, period: f64) -> f64 {
    difference - period * (difference / period).round()
}

function_block! {
    /// Makes an axis follow `fSetPosition`, which the program calculates in every cycle. State: synchronized_motion.
    ///
    /// The rising edge of `bExecute` takes the axis over; from then on every call writes the set position, and set velocity and acceleration by
    /// differences. The path is the program's: nothing is smoothed. When `bExecute` is FALSE the axis goes on following until the set position stands
    /// still for a cycle, then it is in standstill and `bBusy` FALSE; or another command takes over (`bCommandAborted`), from the motion it is in.
    ///
    /// `bFixedCoordinateSystem` is there for CODESYS programs; MC_SetPosition is refused while an axis follows, so that both values mean the same.
    ///
    /// Errors: SMC_VD_MAX_VELOCITY_EXCEEDED (a step, the first one from where the axis stands among them, is faster than the axis may move) and
    /// SMC_INVALID_POSITION (not finite) put the axis into errorstop, the set position stays. SMC_FB_CALLED_FROM_WRONG_TASK,
    /// SMC_REGULATOR_OR_START_NOT_SET, SMC_AXIS_NOT_READY_FOR_MOTION, SMC_AXIS_ERROR_DURING_MOTION, SMC_AXIS_REF_CHANGED_DURING_OPERATION as
    /// MC_MoveAbsolute. Software limits, acceleration and lag are watched by the axis itself.
    pub block FollowPosition as FollowPosition aliases ["SMC_FollowPosition"] {
        input {
            /// Rising edge: take the axis over.
            bExecute: Bool,
            /// Set position of this cycle, technical units.
            fSetPosition: f64,
            /// Of no effect here.
            bFixedCoordinateSystem: Bool = Bool::TRUE,
        }
        output {
            /// The axis follows.
            bBusy: Bool,
            /// Another command has taken over.
            bCommandAborted: Bool,
            /// Refused or failed.
            bError: Bool,
            /// Why.
            iErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state { follower: Follower = <Follower as takt_abi::Plain>::INIT }
    }
    fn cycle(fb, cx) {
        fb.follower.call(fb.Axis, fb.bExecute, fb.fSetPosition, None, cx)?;
        let f = &fb.follower;
        (fb.bBusy, fb.bCommandAborted, fb.bError, fb.iErrorID) = (f.busy, f.aborted, f.error, f.id);
        Ok(())
    }
}

function_block! {
    /// Makes an axis follow `fSetPosition` with `fSetVelocity` as set velocity (feed-forward), which the program calculates in every cycle.
    /// Everything else as FollowPosition.
    pub block FollowPositionVelocity as FollowPositionVelocity aliases ["SMC_FollowPositionVelocity"] {
        input {
            /// Rising edge: take the axis over.
            bExecute: Bool,
            /// Set position of this cycle, technical units.
            fSetPosition: f64,
            /// Set velocity of this cycle, units/s.
            fSetVelocity: f64,
            /// Of no effect here.
            bFixedCoordinateSystem: Bool = Bool::TRUE,
        }
        output {
            /// The axis follows.
            bBusy: Bool,
            /// Another command has taken over.
            bCommandAborted: Bool,
            /// Refused or failed.
            bError: Bool,
            /// Why.
            iErrorID: SmcError,
        }
        inout { Axis: AxisRef }
        state { follower: Follower = <Follower as takt_abi::Plain>::INIT }
    }
    fn cycle(fb, cx) {
        fb.follower.call(fb.Axis, fb.bExecute, fb.fSetPosition, Some(fb.fSetVelocity), cx)?;
        let f = &fb.follower;
        (fb.bBusy, fb.bCommandAborted, fb.bError, fb.iErrorID) = (f.busy, f.aborted, f.error, f.id);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};
    use crate::motion::stop::Halt;

    fn follower() -> FollowPosition {
        FollowPosition { Axis: AXIS, bExecute: Bool::TRUE, ..FollowPosition::default() }
    }
    /// A gentle path.
    fn place(i: u32) -> f64 {
        10.0 - 10.0 * libm::cos(f64::from(i) * 0.002)
    }

    #[test]
    fn the_axis_is_where_the_program_says_in_every_cycle() {
        let mut rig = AxisBench::new();
        let mut fb = follower();
        for i in 0..2000 {
            fb.fSetPosition = place(i);
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.bBusy.get() && rig.axis().fSetPosition == place(i) && rig.axis().nAxisState == AxisState::synchronized_motion);
            if i > 0 {
                assert!((rig.axis().fSetVelocity - (place(i) - place(i - 1)) * 1000.0).abs() < 1e-6);
            }
            rig.next();
        }
        fb.bExecute = Bool::FALSE;
        for i in 2000..2010 {
            fb.fSetPosition = place(i);
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.bBusy.get(), "a falling bExecute does not stop the motion");
            rig.next();
        }
        rig.call(1, |cx| fb.cycle(cx));
        assert!(!fb.bBusy.get() && rig.axis().nAxisState == AxisState::standstill && rig.axis().nCommandedBy == 0);
    }

    #[test]
    fn a_jump_and_a_number_that_is_none_put_the_axis_into_errorstop() {
        for (jump, error) in [
            (10.5, SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED),
            (f64::NAN, SmcError::SMC_INVALID_POSITION),
            (-1e308, SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED),
        ] {
            let mut rig = AxisBench::new();
            let mut fb = follower();
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
            fb.fSetPosition = jump;
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.bError.get() && !fb.bBusy.get() && fb.iErrorID == error);
            let axis = rig.axis();
            assert!(axis.nAxisState == AxisState::errorstop && axis.dwErrorID.0 == error.0 as u32 && axis.fSetPosition == 0.0);
        }
    }

    #[test]
    fn a_modulo_axis_follows_over_its_end() {
        let mut rig = AxisBench::new();
        rig.change(|a| (a.iMovementType, a.fPositionPeriod) = (0, 360.0));
        let mut fb = follower();
        for i in 0..2000 {
            fb.fSetPosition = f64::from(i) * -0.1;
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.bBusy.get() && (0.0..360.0).contains(&rig.axis().fSetPosition));
            assert!(i == 0 || (rig.axis().fSetVelocity + 100.0).abs() < 1e-6);
            rig.next();
        }
    }

    #[test]
    fn another_command_takes_over_from_the_motion_it_is_in() {
        let mut rig = AxisBench::new();
        let mut fb = FollowPositionVelocity { Axis: AXIS, bExecute: Bool::TRUE, ..FollowPositionVelocity::default() };
        let mut halt = Halt { Axis: AXIS, Deceleration: 500.0, Jerk: 5000.0, ..Halt::default() };
        for i in 0..500 {
            (fb.fSetPosition, fb.fSetVelocity) = (place(i), 20.0 * libm::sin(f64::from(i) * 0.002));
            rig.call(1, |cx| fb.cycle(cx));
            rig.call(2, |cx| halt.cycle(cx));
            rig.next();
        }
        halt.Execute = Bool::TRUE;
        rig.call(1, |cx| fb.cycle(cx));
        rig.call(2, |cx| halt.cycle(cx));
        rig.next();
        rig.call(1, |cx| fb.cycle(cx));
        assert!(fb.bCommandAborted.get() && !fb.bBusy.get());
        rig.watch(1000.0, 500.0 * 1.01, 6000.0);
        while !halt.Done.get() {
            rig.call(2, |cx| halt.cycle(cx));
            rig.next();
        }
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
    }
}
