//! ForwardTransformation and InverseTransformation: the five-axis dispenser's kinematics as blocks, in degrees and mm.
//!
//! The mathematics is [`crate::motion::kin5`]'s; here are only units, defaults and errors. On an error the outputs keep their last good values.

use crate::motion::kin5::{Joints, Links, Pose, Turns, Unreachable, degrees, forward, radians, rotation};
use takt_abi::{Bool, SmcError, function_block, st_struct};

st_struct! {
    /// Link lengths of the five-axis dispenser, mm, as in the DH table of its paper. The defaults are the default machine's.
    pub struct FIVE_AXIS_GEOMETRY as FiveAxisGeometry {
        /// Rotary table's origin below the part's.
        L1: f64 = 120.0,
        L2: f64 = 45.0,
        L3: f64 = 60.0,
        L4: f64 = 30.0,
        /// Tool transform: Trans(L5, 0, -L6).
        L5: f64 = 25.0,
        L6: f64 = 150.0,
    }
}

impl FiveAxisGeometry {
    /// What can be observed of the lengths.
    pub fn links(&self) -> Links {
        Links { a: self.L5 - self.L4, b: self.L2 + self.L3 + self.L6, l1: self.L1 }
    }
}

function_block! {
    /// Position and orientation of the tool centre point in the part, from the five axes.
    ///
    /// `A`, `B`, `C` are the XYZ fixed angles gamma, beta, alpha: `A = 0`, `B = -Theta2`, `C = -Theta1`.
    /// Error: SMC_TRAFO_INVALID_INPUT (an input is not finite); the outputs then keep their values.
    pub block ForwardTransformation as ForwardTransformation {
        input {
            /// Link lengths, mm.
            Geometry: FiveAxisGeometry = <FiveAxisGeometry as takt_abi::Plain>::INIT,
            /// Rotary table, degrees.
            Theta1: f64,
            /// Tilting table, degrees.
            Theta2: f64,
            /// First linear axis, mm.
            D1: f64,
            /// Second linear axis, mm.
            D2: f64,
            /// Third linear axis, mm.
            D3: f64,
        }
        output {
            /// Tool centre point, mm.
            X: f64,
            Y: f64,
            Z: f64,
            /// Orientation, degrees.
            A: f64,
            B: f64,
            C: f64,
            /// The inputs were refused.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        state {}
    }
    fn cycle(fb, _cx) {
        let q = Joints { theta1: radians(fb.Theta1), theta2: radians(fb.Theta2), d: [fb.D1, fb.D2, fb.D3] };
        let p = forward(fb.Geometry.links(), q).p;
        let good = p.iter().all(|x| x.is_finite()) && fb.Theta1.is_finite() && fb.Theta2.is_finite();
        if good {
            [fb.X, fb.Y, fb.Z] = p;
            [fb.A, fb.B, fb.C] = [0.0, 0.0 - fb.Theta2, 0.0 - fb.Theta1];
        }
        fb.Error = (!good).into();
        fb.ErrorID = if good { SmcError::SMC_NO_ERROR } else { SmcError::SMC_TRAFO_INVALID_INPUT };
        Ok(())
    }
}

function_block! {
    /// The five axes, from position and orientation of the tool centre point in the part.
    ///
    /// `A`, `B`, `C` are the XYZ fixed angles gamma, beta, alpha (`R = Rz(C) Ry(B) Rx(A)`); in G-code for this machine A = 0. The machine has two rotary
    /// axes, so the whole orientation can be taken only where r32 = 0; with `bAxisOnly` only the direction of the tool axis matters, and every one can be.
    ///
    /// The block remembers the last angles: `Theta1` and `Theta2` go to the nearest turn and so may exceed 360 degrees. With `bAxisOnly` there are
    /// two ways, (Theta1, Theta2) and (Theta1 + 180, -Theta2): the sign of Theta2 is kept, but within half a degree of the vertical the nearer way is
    /// taken, so that a path may go straight through; with a vertical tool axis `Theta1` is held. `bReset` forgets the last angles before calculating:
    /// angles are then within ±180 degrees.
    ///
    /// Errors: SMC_TRAFO_INVALID_INPUT (an input is not finite), SMC_TRAFO_ORIENTATION_UNREACHABLE (r32 is not 0, for instance A is not 0). The outputs
    /// then keep their values, and nothing is remembered. Limits of travel are not looked at here.
    pub block InverseTransformation as InverseTransformation {
        input {
            /// Link lengths, mm.
            Geometry: FiveAxisGeometry = <FiveAxisGeometry as takt_abi::Plain>::INIT,
            /// Tool centre point, mm.
            X: f64,
            Y: f64,
            Z: f64,
            /// Orientation, degrees.
            A: f64,
            B: f64,
            C: f64,
            /// Only the direction of the tool axis matters.
            bAxisOnly: Bool,
            /// Forget the last angles.
            bReset: Bool,
        }
        output {
            /// Rotary table, degrees.
            Theta1: f64,
            /// Tilting table, degrees.
            Theta2: f64,
            /// First linear axis, mm.
            D1: f64,
            /// Second linear axis, mm.
            D2: f64,
            /// Third linear axis, mm.
            D3: f64,
            /// The pose was refused.
            Error: Bool,
            /// Why.
            ErrorID: SmcError,
        }
        state {
            /// There was a pose before.
            known: Bool,
            /// Its angles, rad.
            last1: f64,
            last2: f64,
        }
    }
    fn cycle(fb, _cx) {
        let known = fb.known.get() && !fb.bReset.get() && fb.last1.is_finite() && fb.last2.is_finite();
        let mut turns = Turns { last: known.then_some((fb.last1, fb.last2)) };
        let pose = Pose { p: [fb.X, fb.Y, fb.Z], r: rotation(radians(fb.A), radians(fb.B), radians(fb.C)) };
        let links = fb.Geometry.links();
        let found = if fb.bAxisOnly.get() { turns.inverse_of_axis(links, &pose) } else { turns.inverse(links, &pose) };
        fb.ErrorID = match found {
            Ok(q) => {
                (fb.Theta1, fb.Theta2) = (degrees(q.theta1), degrees(q.theta2));
                [fb.D1, fb.D2, fb.D3] = q.d;
                SmcError::SMC_NO_ERROR
            }
            Err(Unreachable::NotFinite) => SmcError::SMC_TRAFO_INVALID_INPUT,
            Err(Unreachable::Orientation) => SmcError::SMC_TRAFO_ORIENTATION_UNREACHABLE,
        };
        fb.Error = found.is_err().into();
        fb.known = turns.last.is_some().into();
        if let Some((t1, t2)) = turns.last {
            (fb.last1, fb.last2) = (t1, t2);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::Bench;
    use crate::motion::oracle::{Random, load, numbers};

    fn inverse(fb: &mut InverseTransformation, pose: [f64; 6]) -> Result<[f64; 5], SmcError> {
        [fb.X, fb.Y, fb.Z, fb.A, fb.B, fb.C] = pose;
        Bench::new(64).call(16, |cx| fb.cycle(cx)).expect("no fault");
        if fb.Error.get() { Err(fb.ErrorID) } else { Ok([fb.Theta1, fb.Theta2, fb.D1, fb.D2, fb.D3]) }
    }
    fn forward_block(q: [f64; 5]) -> Result<[f64; 6], SmcError> {
        let mut fb = ForwardTransformation { Theta1: q[0], Theta2: q[1], D1: q[2], D2: q[3], D3: q[4], ..Default::default() };
        Bench::new(64).call(16, |cx| fb.cycle(cx)).expect("no fault");
        if fb.Error.get() { Err(fb.ErrorID) } else { Ok([fb.X, fb.Y, fb.Z, fb.A, fb.B, fb.C]) }
    }

    #[test]
    fn the_phone_job_needs_the_joint_values_of_the_reference() {
        let mut fb = InverseTransformation::default();
        for point in load("phone_truth.json")["points"].as_array().expect("points") {
            let p = numbers(&point["p"]);
            let (b, c) = (point["B"].as_f64().expect("B"), point["C"].as_f64().expect("C"));
            let q = numbers(&point["q"]);
            let got = inverse(&mut fb, [p[0], p[1], p[2], 0.0, degrees(b), degrees(c)]).expect("reachable");
            let expected = [degrees(q[0]), degrees(q[1]), q[2], q[3], q[4]];
            for i in 0..5 {
                assert!((got[i] - expected[i]).abs() < 1e-8, "{got:?} {expected:?}");
            }
        }
    }

    #[test]
    fn forward_and_inverse_are_each_others_inverse_in_degrees() {
        let mut random = Random(3);
        let mut fb = InverseTransformation { bReset: Bool::TRUE, ..Default::default() };
        for _ in 0..2000 {
            let q = [
                random.within(-180.0, 180.0),
                random.within(-179.0, 179.0),
                random.within(-300.0, 300.0),
                random.within(-300.0, 300.0),
                random.within(-300.0, 300.0),
            ];
            let back = inverse(&mut fb, forward_block(q).expect("finite")).expect("reachable");
            for i in 0..5 {
                assert!((back[i] - q[i]).abs() < 1e-9, "{back:?} {q:?}");
            }
        }
    }

    #[test]
    fn a_tilt_about_x_is_refused_and_the_outputs_stay() {
        let mut fb = InverseTransformation::default();
        let good = inverse(&mut fb, [1.0, 2.0, 3.0, 0.0, 20.0, 300.0]).expect("reachable");
        assert!((good[0] - 60.0).abs() < 1e-9 && (good[1] + 20.0).abs() < 1e-9);
        assert_eq!(inverse(&mut fb, [1.0, 2.0, 3.0, 5.0, 20.0, 300.0]), Err(SmcError::SMC_TRAFO_ORIENTATION_UNREACHABLE));
        assert_eq!(inverse(&mut fb, [f64::NAN, 2.0, 3.0, 0.0, 20.0, 300.0]), Err(SmcError::SMC_TRAFO_INVALID_INPUT));
        assert_eq!(inverse(&mut fb, [1.0, 2.0, 3.0, 0.0, f64::INFINITY, 300.0]), Err(SmcError::SMC_TRAFO_INVALID_INPUT));
        assert_eq!([fb.Theta1, fb.Theta2, fb.D1, fb.D2, fb.D3], good);
        fb.bAxisOnly = Bool::TRUE;
        assert!(inverse(&mut fb, [1.0, 2.0, 3.0, 5.0, 20.0, 300.0]).is_ok());
        assert_eq!(forward_block([0.0, f64::NAN, 0.0, 0.0, 0.0]), Err(SmcError::SMC_TRAFO_INVALID_INPUT));
        assert_eq!(forward_block([0.0, 0.0, 0.0, f64::INFINITY, 0.0]), Err(SmcError::SMC_TRAFO_INVALID_INPUT));
    }

    #[test]
    fn reset_forgets_the_turns() {
        let mut fb = InverseTransformation::default();
        for turn in 0..10 {
            inverse(&mut fb, [10.0, 0.0, 0.0, 0.0, 10.0, f64::from(turn) * 90.0]).expect("reachable");
        }
        assert!((fb.Theta1 + 810.0).abs() < 1e-9);
        fb.bReset = Bool::TRUE;
        inverse(&mut fb, [10.0, 0.0, 0.0, 0.0, 10.0, 810.0]).expect("reachable");
        assert!((fb.Theta1 + 90.0).abs() < 1e-9);
    }
}
