//! MC_MoveAbsolute, MC_MoveRelative, MC_MoveVelocity: jerk-limited moves of one axis, from whatever motion it is in.

use crate::motion::command::{Command, Goal, Order};
use takt_abi::{AxisRef, Bool, BufferMode, Direction, Plain, SmcError, function_block};

function_block! {
    /// Moves an axis to a position, from whatever motion it is in, and rests there.
    ///
    /// Velocity, acceleration, deceleration and jerk stay within the inputs, which must be positive and within the axis' limits; a `Jerk` of 0 means the
    /// axis' own limit, a larger one is cut to it. On a modulo axis `Direction` says which way; on a finite axis it has no effect. `BufferMode` Aborting
    /// takes over at once, Buffered waits until the axis stands still; the others are refused. State: discrete_motion, then standstill.
    ///
    /// Errors: SMC_FB_CALLED_FROM_WRONG_TASK, SMC_REGULATOR_OR_START_NOT_SET (no power), SMC_AXIS_NOT_READY_FOR_MOTION (errorstop, stopping, homing),
    /// SMC_MA_INVALID_VELACC_VALUES, SMC_MA_INVALID_DIRECTION, SMC_INVALID_POSITION (not finite), SMC_DI_SWLIMITS_EXCEEDED (the position is outside the
    /// enabled software limits), SMC_BUFFER_MODE_NOT_SUPPORTED, SMC_AXIS_ERROR_DURING_MOTION, SMC_AXIS_REF_CHANGED_DURING_OPERATION. An axis that
    /// this block was moving is braked after an error in its inputs.
    pub block MC_MoveAbsolute as MoveAbsolute {
        input {
            /// Rising edge: start.
            Execute: Bool,
            /// Target, technical units.
            Position: f64,
            /// Largest velocity, units/s.
            Velocity: f64,
            /// Acceleration, units/s².
            Acceleration: f64,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
            /// Way round on a modulo axis.
            Direction: Direction = Direction::shortest,
            /// When to start.
            BufferMode: BufferMode = BufferMode::Aborting,
        }
        output {
            /// The position has been reached.
            Done: Bool,
            /// Waiting or moving.
            Busy: Bool,
            /// Moving.
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
        let order = Order {
            goal: Goal::Absolute(fb.Position, fb.Direction),
            velocity: fb.Velocity,
            acceleration: fb.Acceleration,
            deceleration: fb.Deceleration,
            jerk: fb.Jerk,
            buffer: fb.BufferMode,
        };
        fb.command.call(fb.Axis, fb.Execute, order, cx)?;
        let c = &fb.command;
        (fb.Done, fb.Busy, fb.Active) = (c.done, c.busy(), c.active);
        (fb.CommandAborted, fb.Error, fb.ErrorID) = (c.aborted, c.error, c.id);
        Ok(())
    }
}

function_block! {
    /// Moves an axis by a distance from the set position at its start, and rests there. Everything else as MC_MoveAbsolute.
    pub block MC_MoveRelative as MoveRelative {
        input {
            /// Rising edge: start.
            Execute: Bool,
            /// Distance, technical units.
            Distance: f64,
            /// Largest velocity, units/s.
            Velocity: f64,
            /// Acceleration, units/s².
            Acceleration: f64,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
            /// When to start.
            BufferMode: BufferMode = BufferMode::Aborting,
        }
        output {
            /// The distance has been covered.
            Done: Bool,
            /// Waiting or moving.
            Busy: Bool,
            /// Moving.
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
        let order = Order {
            goal: Goal::Relative(fb.Distance),
            velocity: fb.Velocity,
            acceleration: fb.Acceleration,
            deceleration: fb.Deceleration,
            jerk: fb.Jerk,
            buffer: fb.BufferMode,
        };
        fb.command.call(fb.Axis, fb.Execute, order, cx)?;
        let c = &fb.command;
        (fb.Done, fb.Busy, fb.Active) = (c.done, c.busy(), c.active);
        (fb.CommandAborted, fb.Error, fb.ErrorID) = (c.aborted, c.error, c.id);
        Ok(())
    }
}

function_block! {
    /// Moves an axis with a velocity, on and on, until another command takes over. State: continuous_motion.
    ///
    /// The direction is the sign of `Velocity` times `Direction`: positive, negative or current (as it moves now; standing: positive). A homed
    /// axis with software limits brakes so that it comes to rest at the limit, and the block ends with SMC_DI_SWLIMITS_EXCEEDED.
    ///
    /// Errors besides those of MC_MoveAbsolute: SMC_MV_INVALID_ACCDEC_VALUES (a value is not within the axis' limits),
    /// SMC_MV_DIRECTION_NOT_APPLICABLE (shortest, fastest).
    pub block MC_MoveVelocity as MoveVelocity {
        input {
            /// Rising edge: start.
            Execute: Bool,
            /// Velocity, units/s.
            Velocity: f64,
            /// Acceleration, units/s².
            Acceleration: f64,
            /// Deceleration, units/s².
            Deceleration: f64,
            /// Jerk, units/s³; 0: the axis' limit.
            Jerk: f64,
            /// Which way.
            Direction: Direction = Direction::current,
            /// When to start.
            BufferMode: BufferMode = BufferMode::Aborting,
        }
        output {
            /// The axis moves with the velocity.
            InVelocity: Bool,
            /// Waiting or moving.
            Busy: Bool,
            /// Moving.
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
        let rising = fb.Execute.get() && !fb.command.last.get();
        let sign = match fb.Direction {
            Direction::positive => 1.0,
            Direction::negative => -1.0,
            Direction::current if rising && cx.get(fb.Axis)?.fSetVelocity < 0.0 => -1.0,
            Direction::current => 1.0,
            _ => f64::NAN,
        };
        let order = Order {
            goal: Goal::Velocity(sign * fb.Velocity),
            velocity: fb.Velocity,
            acceleration: fb.Acceleration,
            deceleration: fb.Deceleration,
            jerk: fb.Jerk,
            buffer: fb.BufferMode,
        };
        fb.command.call(fb.Axis, fb.Execute, order, cx)?;
        let c = &fb.command;
        (fb.InVelocity, fb.Busy, fb.Active) = (c.in_velocity, c.busy(), c.active);
        (fb.CommandAborted, fb.Error, fb.ErrorID) = (c.aborted, c.error, c.id);
        if rising && sign.is_nan() && fb.ErrorID == SmcError::SMC_MV_INVALID_ACCDEC_VALUES {
            fb.command.id = SmcError::SMC_MV_DIRECTION_NOT_APPLICABLE;
            fb.ErrorID = SmcError::SMC_MV_DIRECTION_NOT_APPLICABLE;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{AXIS, AxisBench};
    use crate::motion::oracle::Random;
    use takt_abi::AxisState;

    fn to(position: f64) -> MoveAbsolute {
        let (velocity, acceleration) = (100.0, 1000.0);
        MoveAbsolute {
            Axis: AXIS,
            Execute: Bool::TRUE,
            Position: position,
            Velocity: velocity,
            Acceleration: acceleration,
            Deceleration: 800.0,
            Jerk: 20_000.0,
            ..MoveAbsolute::default()
        }
    }
    fn at_speed(velocity: f64) -> MoveVelocity {
        MoveVelocity {
            Axis: AXIS,
            Execute: Bool::TRUE,
            Velocity: velocity,
            Acceleration: 1000.0,
            Deceleration: 800.0,
            Jerk: 20_000.0,
            ..MoveVelocity::default()
        }
    }
    fn exclusive(fb: &MoveAbsolute) -> bool {
        [fb.Done, fb.Busy, fb.CommandAborted, fb.Error].iter().filter(|b| b.get()).count() <= 1
    }

    #[test]
    fn the_axis_arrives_exactly_and_the_outputs_follow_the_conventions() {
        let mut rig = AxisBench::new();
        rig.watch(100.0, 1000.0, 20_000.0);
        let mut fb = to(37.123);
        let mut cycles = 0;
        loop {
            rig.call(1, |cx| fb.cycle(cx));
            assert!(exclusive(&fb));
            rig.next();
            if !fb.Busy.get() {
                break;
            }
            assert!(fb.Active.get() && rig.axis().nAxisState == AxisState::discrete_motion && rig.axis().iOwner == 1);
            cycles += 1;
        }
        assert!(fb.Done.get() && !fb.Active.get() && (400..700).contains(&cycles), "{cycles}");
        let axis = rig.axis();
        assert_eq!((axis.fSetPosition, axis.fSetVelocity, axis.nAxisState, axis.nCommandedBy), (37.123, 0.0, AxisState::standstill, 0));
        rig.call(1, |cx| fb.cycle(cx));
        assert!(fb.Done.get());
        fb.Execute = Bool::FALSE;
        rig.call(1, |cx| fb.cycle(cx));
        assert!(!fb.Done.get());
    }

    #[test]
    fn execute_that_fell_early_leaves_the_motion_and_shows_done_once() {
        let mut rig = AxisBench::new();
        let mut fb = to(5.0);
        rig.call(1, |cx| fb.cycle(cx));
        fb.Execute = Bool::FALSE;
        while fb.Busy.get() {
            rig.next();
            rig.call(1, |cx| fb.cycle(cx));
        }
        assert!(fb.Done.get() && rig.axis().fSetPosition == 5.0);
        rig.next();
        rig.call(1, |cx| fb.cycle(cx));
        assert!(!fb.Done.get());
    }

    #[test]
    fn commands_take_over_from_each_other_without_a_jump() {
        let mut random = Random(31);
        let mut rig = AxisBench::new();
        rig.watch(100.0, 1000.0, 20_000.0);
        let mut blocks = [to(0.0), to(0.0), to(0.0)];
        let mut active = 0;
        for _ in 0..200 {
            let next = random.whole(0, 2) as usize;
            blocks[next].Position = random.within(-50.0, 50.0);
            (blocks[next].Execute, blocks[next].command.last) = (Bool::TRUE, Bool::FALSE);
            for _ in 0..random.whole(2, 300) {
                for (i, fb) in blocks.iter_mut().enumerate() {
                    rig.call(i as u64 + 1, |cx| fb.cycle(cx));
                    assert!(exclusive(fb) && !fb.Error.get());
                }
                rig.next();
            }
            if next != active {
                assert!(!blocks[active].Busy.get());
            }
            active = next;
        }
        while blocks[active].Busy.get() {
            rig.call(active as u64 + 1, |cx| blocks[active].cycle(cx));
            rig.next();
        }
        assert_eq!(rig.axis().fSetPosition, blocks[active].Position);
    }

    #[test]
    fn a_buffered_command_waits_for_standstill() {
        let mut rig = AxisBench::new();
        rig.watch(100.0, 1000.0, 20_000.0);
        let (mut first, mut second) = (to(10.0), MoveAbsolute { BufferMode: BufferMode::Buffered, ..to(-5.0) });
        rig.call(1, |cx| first.cycle(cx));
        rig.call(2, |cx| second.cycle(cx));
        rig.next();
        while !first.Done.get() {
            assert!(second.Busy.get() && !second.Active.get());
            rig.call(1, |cx| first.cycle(cx));
            rig.call(2, |cx| second.cycle(cx));
            rig.next();
        }
        while second.Busy.get() {
            rig.call(1, |cx| first.cycle(cx));
            rig.call(2, |cx| second.cycle(cx));
            rig.next();
        }
        assert!(second.Done.get() && first.Done.get() && rig.axis().fSetPosition == -5.0);
    }

    #[test]
    fn relative_moves_add_up() {
        let mut rig = AxisBench::new();
        for i in 1..=3 {
            let mut fb = MoveRelative {
                Axis: AXIS,
                Execute: Bool::TRUE,
                Distance: -2.5,
                Velocity: 50.0,
                Acceleration: 500.0,
                Deceleration: 500.0,
                ..MoveRelative::default()
            };
            rig.call(i, |cx| fb.cycle(cx));
            while fb.Busy.get() {
                rig.next();
                rig.call(i, |cx| fb.cycle(cx));
            }
            rig.next();
        }
        assert_eq!(rig.axis().fSetPosition, -7.5);
    }

    #[test]
    fn wrong_inputs_and_states_are_refused_and_nothing_moves() {
        let refused = |change: &dyn Fn(&mut MoveAbsolute, &mut AxisBench)| {
            let mut rig = AxisBench::new();
            let mut fb = to(10.0);
            change(&mut fb, &mut rig);
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.Error.get() && !fb.Busy.get() && rig.axis().nCommandedBy == 0 && rig.axis().fSetPosition == 0.0);
            fb.ErrorID
        };
        let values = SmcError::SMC_MA_INVALID_VELACC_VALUES;
        assert_eq!(refused(&|fb, _| fb.Velocity = 0.0), values);
        assert_eq!(refused(&|fb, _| fb.Velocity = 10_001.0), values);
        assert_eq!(refused(&|fb, _| fb.Velocity = f64::NAN), values);
        assert_eq!(refused(&|fb, _| fb.Acceleration = -1.0), values);
        assert_eq!(refused(&|fb, _| fb.Deceleration = f64::INFINITY), values);
        assert_eq!(refused(&|fb, _| fb.Jerk = f64::NAN), values);
        assert_eq!(refused(&|fb, _| fb.Position = f64::NAN), SmcError::SMC_INVALID_POSITION);
        assert_eq!(refused(&|fb, _| fb.BufferMode = BufferMode::BlendingNext), SmcError::SMC_BUFFER_MODE_NOT_SUPPORTED);
        assert_eq!(refused(&|_, rig| rig.leave_bus_task()), SmcError::SMC_FB_CALLED_FROM_WRONG_TASK);
        let limit =
            |rig: &mut AxisBench| rig.change(|a| (a.bSWLimitEnable, a.fSWLimitNegative, a.fSWLimitPositive) = (Bool::TRUE, -5.0, 9.0));
        assert_eq!(refused(&|_, rig| limit(rig)), SmcError::SMC_DI_SWLIMITS_EXCEEDED);
        for (state, error) in [
            (AxisState::power_off, SmcError::SMC_REGULATOR_OR_START_NOT_SET),
            (AxisState::errorstop, SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
            (AxisState::stopping, SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
            (AxisState::homing, SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
            (AxisState(99), SmcError::SMC_AXIS_NOT_READY_FOR_MOTION),
        ] {
            assert_eq!(refused(&|_, rig| rig.change(|a| a.nAxisState = state)), error);
        }
    }

    #[test]
    fn an_axis_error_and_lost_power_end_the_command() {
        for (state, error) in [
            (AxisState::errorstop, SmcError::SMC_AXIS_ERROR_DURING_MOTION),
            (AxisState::power_off, SmcError::SMC_REGULATOR_OR_START_NOT_SET),
        ] {
            let mut rig = AxisBench::new();
            let mut fb = to(10.0);
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
            rig.change(|a| (a.nAxisState, a.nCommandedBy) = (state, 0));
            rig.call(1, |cx| fb.cycle(cx));
            assert!(fb.Error.get() && !fb.Busy.get() && fb.ErrorID == error);
        }
    }

    #[test]
    fn a_bad_order_to_a_moving_block_brakes_the_axis() {
        let mut rig = AxisBench::new();
        let mut fb = to(50.0);
        for _ in 0..200 {
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
        }
        rig.watch(100.0, 1e5, 1e7);
        fb.Velocity = -1.0;
        fb.Execute = Bool::FALSE;
        rig.call(1, |cx| fb.cycle(cx));
        rig.next();
        fb.Execute = Bool::TRUE;
        rig.call(1, |cx| fb.cycle(cx));
        assert!(fb.Error.get() && !fb.Busy.get());
        for _ in 0..500 {
            rig.next();
            rig.call(1, |cx| fb.cycle(cx));
        }
        assert!(fb.Error.get() && rig.axis().nAxisState == AxisState::standstill && rig.axis().fSetVelocity == 0.0);
    }

    #[test]
    fn a_modulo_axis_goes_round_as_told() {
        for (direction, way) in [
            (Direction::shortest, -20.0),
            (Direction::positive, 340.0),
            (Direction::negative, -20.0),
            (Direction::current, 340.0),
            (Direction::fastest, -20.0),
        ] {
            let mut rig = AxisBench::new();
            rig.change(|a| (a.iMovementType, a.fPositionPeriod, a.fSetPosition) = (0, 360.0, 10.0));
            rig.watch(100.0, 1000.0, 20_000.0);
            let mut fb = MoveAbsolute { Direction: direction, ..to(350.0) };
            let mut turned = 0.0;
            let mut before = 10.0;
            rig.call(1, |cx| fb.cycle(cx));
            loop {
                let now = rig.axis().fSetPosition;
                assert!((0.0..360.0).contains(&now));
                turned += (now - before) - 360.0 * ((now - before) / 360.0).round();
                before = now;
                rig.next();
                if !fb.Busy.get() {
                    break;
                }
                rig.call(1, |cx| fb.cycle(cx));
            }
            assert!((turned - way).abs() < 1e-9 && (rig.axis().fSetPosition - 350.0).abs() < 1e-9, "{turned} {direction:?}");
        }
    }

    #[test]
    fn velocity_is_reached_and_kept_until_another_command() {
        let mut rig = AxisBench::new();
        rig.watch(100.0, 1000.0, 20_000.0);
        let mut fb = MoveVelocity { Direction: Direction::negative, ..at_speed(60.0) };
        for i in 0..1000 {
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
            assert!(fb.Busy.get() && (i == 109 || fb.InVelocity.get() == (i > 109)), "{i}");
        }
        assert!(rig.axis().fSetVelocity == -60.0 && rig.axis().nAxisState == AxisState::continuous_motion);
        let mut back = to(0.0);
        while !back.Done.get() {
            rig.call(2, |cx| back.cycle(cx));
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
        }
        assert!(fb.CommandAborted.get() && !fb.Busy.get() && !fb.InVelocity.get() && rig.axis().fSetPosition == 0.0);
        let mut wrong = MoveVelocity { Direction: Direction::shortest, ..at_speed(60.0) };
        rig.call(3, |cx| wrong.cycle(cx));
        assert_eq!(wrong.ErrorID, SmcError::SMC_MV_DIRECTION_NOT_APPLICABLE);
    }

    #[test]
    fn a_homed_axis_stops_at_its_software_limit() {
        let mut rig = AxisBench::new();
        rig.change(|a| (a.bSWLimitEnable, a.fSWLimitNegative, a.fSWLimitPositive, a.bHomed) = (Bool::TRUE, -5.0, 30.0, Bool::TRUE));
        rig.watch(100.0, 1000.0, 20_000.0);
        let mut fb = at_speed(60.0);
        let mut fast = false;
        rig.call(1, |cx| fb.cycle(cx));
        while fb.Busy.get() {
            rig.next();
            rig.call(1, |cx| fb.cycle(cx));
            fast |= fb.InVelocity.get();
        }
        assert!(fast && fb.ErrorID == SmcError::SMC_DI_SWLIMITS_EXCEEDED && rig.axis().fSetPosition == 30.0);
        assert_eq!(rig.axis().nAxisState, AxisState::standstill);
    }

    #[test]
    fn another_axis_in_the_middle_of_a_move_is_an_error_and_the_first_is_braked() {
        let mut rig = AxisBench::new();
        let mut fb = to(50.0);
        for _ in 0..200 {
            rig.call(1, |cx| fb.cycle(cx));
            rig.next();
        }
        fb.Axis = takt_abi::InOut::load(&16u64.to_le_bytes());
        rig.call(1, |cx| fb.cycle(cx));
        assert!(fb.Error.get() && fb.ErrorID == SmcError::SMC_AXIS_REF_CHANGED_DURING_OPERATION);
        for _ in 0..500 {
            rig.next();
            rig.call(1, |cx| fb.cycle(cx));
        }
        assert!(rig.axis().nAxisState == AxisState::standstill && rig.axis().fSetPosition < 50.0);
    }
}
