//! MC_Jog: an axis by hand.

use crate::motion::command::{Command, Goal, Order};
use crate::motion::stop::order as rest;
use takt_abi::{AxisRef, Bool, BufferMode, Plain, SmcError, function_block};

function_block! {
    /// Moves an axis while a button is pressed: forwards, backwards, and to rest when neither or both inputs are TRUE.
    ///
    /// Velocity, acceleration, deceleration and jerk are taken when a button is pressed, as by MC_MoveAbsolute. A homed axis with software limits brakes so
    /// that it comes to rest at the limit; that is no error, `Busy` is then FALSE until the button is released. State: continuous_motion, discrete_motion
    /// while it comes to rest.
    ///
    /// Errors, until both inputs are FALSE: those of MC_MoveVelocity. `CommandAborted`: another command has taken over; release the buttons.
    pub block MC_Jog as Jog {
        input {
            /// Move forwards.
            JogForward: Bool,
            /// Move backwards.
            JogBackward: Bool,
            /// Velocity, units/s.
            Velocity: f64,
            /// Acceleration, units/s².
            Acceleration: f64,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
        }
        output {
            /// Moving.
            Busy: Bool,
            /// Another command has taken over.
            CommandAborted: Bool,
            /// Refused or failed.
            Error: Bool,
            /// Why.
            ErrorId: SmcError,
        }
        inout { Axis: AxisRef }
        state {
            command: Command = <Command as Plain>::INIT,
            /// The way of the command under way: -1, 0, 1.
            way: i8,
        }
    }
    fn cycle(fb, cx) {
        let way = fb.JogForward.get() as i8 - fb.JogBackward.get() as i8;
        let pressed = fb.JogForward.get() || fb.JogBackward.get();
        let turned = way != fb.way;
        fb.way = way;
        let moving = fb.command.busy().get();
        let order = if way == 0 {
            rest(Goal::Halt, fb.command.deceleration, fb.command.jerk, BufferMode::Aborting)
        } else {
            Order {
                goal: Goal::Velocity(f64::from(way) * fb.Velocity),
                velocity: fb.Velocity,
                acceleration: fb.Acceleration,
                deceleration: fb.Deceleration,
                jerk: fb.Jerk,
                buffer: BufferMode::Aborting,
            }
        };
        // A new way is a new rising edge; coming to rest is one only for a motion of ours.
        if turned && (way != 0 || moving) {
            fb.command.last = Bool::FALSE;
        }
        let execute = if turned { way != 0 || moving } else { pressed };
        fb.command.call(fb.Axis, execute.into(), order, cx)?;
        let c = &fb.command;
        let at_limit = c.id == SmcError::SMC_DI_SWLIMITS_EXCEEDED;
        (fb.Busy, fb.CommandAborted) = (c.busy(), c.aborted);
        fb.Error = (c.error.get() && !at_limit).into();
        fb.ErrorId = if at_limit { SmcError::SMC_NO_ERROR } else { c.id };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};
    use crate::motion::oracle::Random;
    use takt_abi::AxisState;

    fn jog() -> Jog {
        Jog { Axis: AXIS, Velocity: 40.0, Acceleration: 500.0, Deceleration: 900.0, Jerk: 9000.0, ..Jog::default() }
    }
    fn run(rig: &mut AxisBench, fb: &mut Jog, cycles: u32) {
        for _ in 0..cycles {
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
        }
    }

    #[test]
    fn the_axis_moves_while_a_button_is_pressed_and_comes_to_rest() {
        let mut rig = AxisBench::new();
        rig.watch(40.0, 900.0, 9000.0);
        let mut fb = jog();
        run(&mut rig, &mut fb, 10);
        assert!(!fb.Busy.get() && rig.axis().nAxisState == AxisState::standstill);
        fb.JogForward = Bool::TRUE;
        run(&mut rig, &mut fb, 400);
        assert!(fb.Busy.get() && rig.axis().fSetVelocity == 40.0);
        fb.JogForward = Bool::FALSE;
        run(&mut rig, &mut fb, 1);
        assert!(fb.Busy.get());
        run(&mut rig, &mut fb, 300);
        assert!(!fb.Busy.get() && rig.axis().nAxisState == AxisState::standstill && rig.axis().fSetPosition > 10.0);
        (fb.JogForward, fb.JogBackward) = (Bool::TRUE, Bool::TRUE);
        run(&mut rig, &mut fb, 100);
        assert!(!fb.Busy.get(), "both buttons are none");
    }

    #[test]
    fn any_play_of_buttons_stays_within_the_limits() {
        let mut random = Random(41);
        let mut rig = AxisBench::new();
        rig.watch(40.0, 900.0, 9000.0);
        let mut fb = jog();
        for _ in 0..500 {
            (fb.JogForward, fb.JogBackward) = (Bool(random.whole(0, 1) as u8), Bool(random.whole(0, 1) as u8));
            let cycles = random.whole(1, 200) as u32;
            run(&mut rig, &mut fb, cycles);
            assert!(!fb.Error.get() && !fb.CommandAborted.get());
        }
        (fb.JogForward, fb.JogBackward) = (Bool::FALSE, Bool::FALSE);
        run(&mut rig, &mut fb, 500);
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
    }

    #[test]
    fn at_a_limit_it_rests_and_only_the_way_back_is_open() {
        let mut rig = AxisBench::new();
        rig.change(|a| (a.bSWLimitEnable, a.fSWLimitNegative, a.fSWLimitPositive, a.bHomed) = (Bool::TRUE, -5.0, 5.0, Bool::TRUE));
        rig.watch(40.0, 900.0, 9000.0);
        let mut fb = Jog { JogForward: Bool::TRUE, ..jog() };
        run(&mut rig, &mut fb, 2000);
        assert!(!fb.Busy.get() && !fb.Error.get() && rig.axis().fSetPosition == 5.0);
        fb.JogForward = Bool::FALSE;
        run(&mut rig, &mut fb, 2);
        fb.JogForward = Bool::TRUE;
        run(&mut rig, &mut fb, 50);
        assert_eq!(rig.axis().fSetPosition, 5.0);
        (fb.JogForward, fb.JogBackward) = (Bool::FALSE, Bool::TRUE);
        run(&mut rig, &mut fb, 2000);
        assert_eq!(rig.axis().fSetPosition, -5.0);
    }

    #[test]
    fn an_error_lasts_until_the_buttons_are_released() {
        let mut rig = AxisBench::new();
        let mut fb = Jog { JogForward: Bool::TRUE, Velocity: 1e9, ..jog() };
        run(&mut rig, &mut fb, 3);
        assert!(fb.Error.get() && fb.ErrorId == SmcError::SMC_MV_INVALID_ACCDEC_VALUES && !fb.Busy.get());
        fb.JogForward = Bool::FALSE;
        run(&mut rig, &mut fb, 1);
        assert!(!fb.Error.get());
    }
}
