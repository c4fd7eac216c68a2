//! Kinematics of the five-axis dispenser: rotary table on a tilting table, three linear axes.
//!
//! Frames: {0} is the part, fixed on the rotary table; the chain runs part → rotary table (theta1) → tilt (theta2) → d1, d2, d3 → valve, so the
//! inverse *is* tool-centre-point control. Lengths in mm, angles in radians. Orientation: `R = Rz(alpha) Ry(beta) Rx(gamma)`, and the machine
//! reaches `R = Rz(-theta1) Ry(-theta2)`, that is every rotation with `r32 = 0`.
//!
//! Source: Xu, Han, "Design of control system for five-axis dispensing machine based on CODESYS", table 1 and equations (1)-(5), with the tool
//! transform `Trans(L5, 0, -L6)`. Nothing here remembers: which turn and which of two solutions to take is decided by [`Turns`], which the caller
//! keeps.

use libm::{atan2, cos, hypot, sin};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// |r32| up to which an orientation counts as reachable.
const ORIENTATION_TOLERANCE: f64 = 1e-9;
/// |k_xy| up to which the tool axis counts as vertical: theta1 is free there.
const VERTICAL: f64 = 1e-9;
/// Tilt, as a sine, below which the two solutions for one tool axis are near each other, so that a path may pass from one to the other.
const POLE_ZONE: f64 = 0.01;

/// The three observable combinations of the link lengths, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Links {
    /// L5 - L4.
    pub a: f64,
    /// L2 + L3 + L6.
    pub b: f64,
    /// L1.
    pub l1: f64,
}

/// Joint values.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Joints {
    /// Rotary table, rad.
    pub theta1: f64,
    /// Tilting table, rad.
    pub theta2: f64,
    /// Linear axes, mm.
    pub d: [f64; 3],
}

/// Position of the tool centre point in the part (mm) and orientation as a rotation matrix, rows first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// x, y, z, mm.
    pub p: [f64; 3],
    /// Columns are the tool's axes; the third is the tool axis.
    pub r: [[f64; 3]; 3],
}

/// Why a pose cannot be taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unreachable {
    /// Something is not finite.
    NotFinite,
    /// r32 is not 0: the machine has no third rotary axis.
    Orientation,
}

/// Tool centre point for joint values; equation (2).
pub fn forward(links: Links, q: Joints) -> Pose {
    let (s1, c1, s2, c2) = (sin(q.theta1), cos(q.theta1), sin(q.theta2), cos(q.theta2));
    let along = links.a - q.d[0];
    let up = links.b - q.d[2];
    let radial = along * c2 + up * s2;
    Pose {
        p: [radial * c1 - q.d[1] * s1, -radial * s1 - q.d[1] * c1, along * s2 - up * c2 - links.l1],
        r: [[c1 * c2, s1, -c1 * s2], [-s1 * c2, c1, s1 * s2], [s2, 0.0, c2]],
    }
}

/// The rotation of the XYZ fixed angles gamma, beta, alpha (rad): `Rz(alpha) Ry(beta) Rx(gamma)`.
pub fn rotation(gamma: f64, beta: f64, alpha: f64) -> [[f64; 3]; 3] {
    let (sg, cg, sb, cb, sa, ca) = (sin(gamma), cos(gamma), sin(beta), cos(beta), sin(alpha), cos(alpha));
    [
        [ca * cb, ca * sb * sg - sa * cg, ca * sb * cg + sa * sg],
        [sa * cb, sa * sb * sg + ca * cg, sa * sb * cg - ca * sg],
        [-sb, cb * sg, cb * cg],
    ]
}

/// The linear axes for given angles; equation (5), always solvable.
pub fn linear_axes(links: Links, p: [f64; 3], theta1: f64, theta2: f64) -> [f64; 3] {
    let (s1, c1, s2, c2) = (sin(theta1), cos(theta1), sin(theta2), cos(theta2));
    let radial = links.a * c2 + links.b * s2;
    let n = [radial * c1 - p[0], -radial * s1 - p[1], links.a * s2 - links.b * c2 - links.l1 - p[2]];
    let m = n[0] * c1 - n[1] * s1;
    [m * c2 + n[2] * s2, n[0] * s1 + n[1] * c1, m * s2 - n[2] * c2]
}

/// The angle nearest to `near` that equals `angle` up to whole turns.
pub fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

/// The angles taken last, so that a path neither jumps by a turn nor from one solution to the other.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Turns {
    /// theta1 and theta2 of the last pose, rad; `None` before the first.
    pub last: Option<(f64, f64)>,
}

impl Turns {
    /// Joint values for a full orientation: unique up to whole turns, of which the nearest to the last angles are taken (at first: within ±pi).
    pub fn inverse(&mut self, links: Links, pose: &Pose) -> Result<Joints, Unreachable> {
        if !is_finite(pose) {
            return Err(Unreachable::NotFinite);
        }
        if pose.r[2][1].abs() > ORIENTATION_TOLERANCE {
            return Err(Unreachable::Orientation);
        }
        let angles = (atan2(pose.r[0][1], pose.r[1][1]), atan2(pose.r[2][0], pose.r[2][2]));
        let angles = match self.last {
            Some((t1, t2)) => (nearest_turn(angles.0, t1), nearest_turn(angles.1, t2)),
            None => angles,
        };
        self.take(links, pose.p, angles)
    }

    /// Joint values for which only the tool axis is that of `pose`: always possible, in two ways, `(theta1, theta2)` and `(theta1 + pi, -theta2)`.
    ///
    /// The way of the last call is kept (the sign of theta2's sine), with the nearest turn. Within about half a degree of the vertical, where a path may pass
    /// through the pole, the nearer of the two is taken, so that it goes straight through. With the axis vertical theta1 is free: the last is held.
    /// The first call takes the way that the programmed orientation itself means, else theta2 >= 0.
    pub fn inverse_of_axis(&mut self, links: Links, pose: &Pose) -> Result<Joints, Unreachable> {
        if !is_finite(pose) {
            return Err(Unreachable::NotFinite);
        }
        let k = [pose.r[0][2], pose.r[1][2], pose.r[2][2]];
        let across = hypot(k[0], k[1]);
        let angles = if across <= VERTICAL {
            self.vertical(pose, k[2])
        } else {
            let positive = (atan2(k[1], -k[0]), atan2(across, k[2]));
            let negative = (positive.0 + PI, -positive.1);
            self.choose(pose, positive, negative)
        };
        self.take(links, pose.p, angles)
    }

    fn vertical(&self, pose: &Pose, kz: f64) -> (f64, f64) {
        let theta2 = if kz > 0.0 { 0.0 } else { PI };
        match self.last {
            Some((t1, t2)) => (t1, nearest_turn(theta2, t2)),
            None if pose.r[2][1].abs() <= ORIENTATION_TOLERANCE => (atan2(pose.r[0][1], pose.r[1][1]), theta2),
            None => (0.0, theta2),
        }
    }

    fn choose(&self, pose: &Pose, positive: (f64, f64), negative: (f64, f64)) -> (f64, f64) {
        let Some((t1, t2)) = self.last else {
            let meant = pose.r[2][1].abs() <= ORIENTATION_TOLERANCE && pose.r[2][0] < 0.0;
            let (a, b) = if meant { negative } else { positive };
            return (nearest_turn(a, 0.0), b);
        };
        let turned = |(a, b): (f64, f64)| (nearest_turn(a, t1), nearest_turn(b, t2));
        let (positive, negative) = (turned(positive), turned(negative));
        let last_sine = sin(t2);
        if last_sine.abs() > POLE_ZONE {
            return if last_sine > 0.0 { positive } else { negative };
        }
        let way = |(a, b): (f64, f64)| (a - t1).abs() + (b - t2).abs();
        if way(negative) < way(positive) { negative } else { positive }
    }

    fn take(&mut self, links: Links, p: [f64; 3], (theta1, theta2): (f64, f64)) -> Result<Joints, Unreachable> {
        let q = Joints { theta1, theta2, d: linear_axes(links, p, theta1, theta2) };
        if !(theta1.is_finite() && theta2.is_finite() && q.d.iter().all(|d| d.is_finite())) {
            return Err(Unreachable::NotFinite);
        }
        self.last = Some((theta1, theta2));
        Ok(q)
    }
}

fn is_finite(pose: &Pose) -> bool {
    pose.p.iter().chain(pose.r.iter().flatten()).all(|x| x.is_finite())
}

/// Degrees to radians; multiples of 90° to the nearest double.
pub fn radians(degrees: f64) -> f64 {
    degrees / 90.0 * FRAC_PI_2
}

/// Radians to degrees.
pub fn degrees(radians: f64) -> f64 {
    radians / FRAC_PI_2 * 90.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::oracle::{Random, load, numbers};
    use serde_json::Value;

    const LINKS: Links = Links { a: -5.0, b: 255.0, l1: 120.0 };

    fn joints(v: &Value) -> Joints {
        let q = numbers(v);
        Joints { theta1: q[0], theta2: q[1], d: [q[2], q[3], q[4]] }
    }
    fn angle_error(a: f64, b: f64) -> f64 {
        (a - nearest_turn(b, a)).abs()
    }
    fn assert_same(a: Joints, b: Joints, what: &Value) {
        assert!(angle_error(a.theta1, b.theta1) < 1e-9 && angle_error(a.theta2, b.theta2) < 1e-9, "{a:?} {b:?} {what}");
        for i in 0..3 {
            assert!((a.d[i] - b.d[i]).abs() < 1e-9, "{a:?} {b:?} {what}");
        }
    }
    fn assert_pose(links: Links, q: Joints, pose: &Pose, axis_only: bool) {
        let there = forward(links, q);
        for i in 0..3 {
            assert!((there.p[i] - pose.p[i]).abs() < 1e-9, "{there:?} {pose:?}");
            for j in if axis_only { 2..3 } else { 0..3 } {
                assert!((there.r[i][j] - pose.r[i][j]).abs() < 1e-9, "{there:?} {pose:?}");
            }
        }
    }

    #[test]
    fn forward_and_inverse_match_the_reference_cases() {
        let file = load("kin5.json");
        for case in file["cases"].as_array().expect("cases") {
            let p: [f64; 3] = numbers(&case["p"]).try_into().expect("three");
            let abc = numbers(&case["abc"]);
            let pose = Pose { p, r: rotation(abc[0], abc[1], abc[2]) };
            let mut turns = Turns::default();
            if case["reachable"] == false {
                assert_eq!(turns.inverse(LINKS, &pose), Err(Unreachable::Orientation));
                let q = turns.inverse_of_axis(LINKS, &pose).expect("every axis is reachable");
                assert_pose(LINKS, q, &pose, true);
                continue;
            }
            let q = joints(&case["q"]);
            assert_pose(LINKS, q, &pose, false);
            assert_same(turns.inverse(LINKS, &pose).expect("reachable"), q, case);
            for branch in case["axis_solutions"].as_array().into_iter().flatten() {
                let expected = joints(branch);
                let mut turns = Turns { last: Some((expected.theta1, expected.theta2)) };
                assert_same(turns.inverse_of_axis(LINKS, &pose).expect("reachable"), expected, case);
            }
        }
    }

    #[test]
    fn inverse_undoes_forward_for_any_machine_and_pose() {
        let mut random = Random(7);
        for _ in 0..20_000 {
            let links = Links { a: random.within(-200.0, 200.0), b: random.within(-400.0, 400.0), l1: random.within(-300.0, 300.0) };
            let q = Joints {
                theta1: random.within(-20.0, 20.0),
                theta2: random.within(-PI, PI),
                d: std::array::from_fn(|_| random.within(-500.0, 500.0)),
            };
            let pose = forward(links, q);
            let found = Turns { last: Some((q.theta1 + random.within(-3.0, 3.0), q.theta2)) }.inverse(links, &pose).expect("reachable");
            assert_same(found, q, &Value::Null);
            assert!((found.theta1 - q.theta1).abs() < 1e-9, "the nearest turn");
            let axis = Turns { last: Some((q.theta1 + 0.3, q.theta2)) }.inverse_of_axis(links, &pose).expect("reachable");
            assert_pose(links, axis, &pose, true);
        }
    }

    #[test]
    fn theta1_is_held_while_the_axis_is_vertical_and_a_path_goes_straight_through_the_pole() {
        let mut turns = Turns::default();
        let mut last: Option<f64> = None;
        for i in -100..=100 {
            let pose = Pose { p: [1.0, 2.0, 3.0], r: rotation(0.0, radians(f64::from(i) * 0.1), radians(40.0)) };
            let q = turns.inverse_of_axis(LINKS, &pose).expect("reachable");
            assert!((q.theta1 - radians(-40.0)).abs() < 1e-9 && (q.theta2 - radians(f64::from(i) * -0.1)).abs() < 1e-9, "{i} {q:?}");
            assert!(last.is_none_or(|l| (l - q.theta2).abs() < radians(0.11)));
            last = Some(q.theta2);
        }
        let turned = Pose { p: [1.0, 2.0, 3.0], r: rotation(0.0, 0.0, 1.0) };
        let before = turns.last.expect("a pose").0;
        assert_eq!(turns.inverse_of_axis(LINKS, &turned).expect("reachable").theta1, before);
        let upside_down = Pose { p: [1.0, 2.0, 3.0], r: rotation(PI, 0.0, 0.3) };
        assert_eq!(turns.inverse_of_axis(LINKS, &upside_down).expect("reachable").theta1, before);
    }

    #[test]
    fn theta1_turns_on_over_many_revolutions() {
        let mut turns = Turns::default();
        for i in 0..2000 {
            let pose = Pose { p: [10.0, 0.0, 0.0], r: rotation(0.0, 0.4, radians(f64::from(i) * 7.0)) };
            let full = turns.inverse(LINKS, &pose).expect("reachable");
            assert!((full.theta1 + radians(f64::from(i) * 7.0)).abs() < 1e-9);
            let axis = turns.inverse_of_axis(LINKS, &pose).expect("reachable");
            assert_same(axis, full, &Value::Null);
            assert!((axis.theta1 - full.theta1).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_not_finite_is_refused_and_forgotten() {
        let mut turns = Turns::default();
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY] {
            let pose = Pose { p: [bad, 0.0, 0.0], r: rotation(0.0, 0.0, 0.0) };
            assert_eq!(turns.inverse(LINKS, &pose), Err(Unreachable::NotFinite));
            let pose = Pose { p: [0.0; 3], r: rotation(0.0, bad, 0.0) };
            assert_eq!(turns.inverse(LINKS, &pose), Err(Unreachable::NotFinite));
            assert_eq!(turns.inverse_of_axis(LINKS, &pose), Err(Unreachable::NotFinite));
        }
        let far = Pose { p: [f64::MAX, f64::MAX, f64::MAX], r: rotation(0.0, 0.7, 0.7) };
        let odd = Links { a: f64::MAX, b: f64::MAX, l1: f64::MAX };
        assert_eq!(turns.inverse(odd, &far), Err(Unreachable::NotFinite));
        assert_eq!(turns.last, None);
    }
}
