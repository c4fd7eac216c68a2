//! The coordinate system of a program: G53 resets it, G54 sets it, G55 changes it, G56 moves it so that the place of the tool gets other coordinates.
//!
//! Program → machine: `p' = R S p + t` for X, Y, Z, with R a rotation, S scales along the axes and t a shift; every other axis is shifted only. With an
//! orientation convention A, B, C are angles: they turn with R and keep to the turn nearest the last one.

use super::types::{OriConvention, PosInfo, Vector3};
use takt_abi::{Bool, st_struct};

st_struct! {
    /// The coordinate system of a program.
    pub struct SMC_NC_FRAME as Frame {
        /// It differs from that of the machine.
        bActive: Bool,
        /// Direction of X in the machine.
        vX: Vector3 = Vector3::new([1.0, 0.0, 0.0]),
        /// Direction of Y.
        vY: Vector3 = Vector3::new([0.0, 1.0, 0.0]),
        /// Direction of Z.
        vZ: Vector3 = Vector3::new([0.0, 0.0, 1.0]),
        /// Scales along X, Y, Z.
        vScale: Vector3 = Vector3::new([1.0, 1.0, 1.0]),
        /// Shift of each axis: mm and degrees.
        piShift: PosInfo
    }
}

/// A rotation: its columns are where the axes go.
pub type Matrix = [[f64; 3]; 3];

/// `m v`.
pub fn turn(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2])
}

fn turn_back(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    [turn(a, b[0]), turn(a, b[1]), turn(a, b[2])]
}

fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Sine and cosine of an angle in degrees; exact at quarter turns.
fn sin_cos(degrees: f64) -> (f64, f64) {
    let quarter = (degrees / 90.0).round();
    let rest = (degrees - 90.0 * quarter).to_radians();
    let (s, c) = (libm::sin(rest), libm::cos(rest));
    match quarter.rem_euclid(4.0) as u8 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// A rotation about axis 0 (X), 1 (Y) or 2 (Z) by degrees.
fn about(axis: usize, degrees: f64) -> Matrix {
    let (s, c) = sin_cos(degrees);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut m = [[0.0; 3]; 3];
    m[axis][axis] = 1.0;
    (m[u][u], m[u][v], m[v][u], m[v][v]) = (c, s, -s, c);
    m
}

/// The rotation of three angles; `None` for additional axes.
pub fn rotation(convention: OriConvention, [a, b, c]: [f64; 3]) -> Option<Matrix> {
    let order = order(convention)?;
    Some(product(&product(&about(order[0], a), &about(order[1], b)), &about(order[2], c)))
}

fn order(convention: OriConvention) -> Option<[usize; 3]> {
    match convention {
        OriConvention::ZYZ => Some([2, 1, 2]),
        OriConvention::ZYX => Some([2, 1, 0]),
        OriConvention::XYZ => Some([0, 1, 2]),
        _ => None,
    }
}

/// The three angles of a rotation, degrees, of the two solutions and all turns those nearest `near`.
pub fn angles(convention: OriConvention, m: &Matrix, near: [f64; 3]) -> [f64; 3] {
    let deg = |y: f64, x: f64| libm::atan2(y, x).to_degrees();
    // Entry (row i, column j) of the matrix is m[j][i].
    let first = match convention {
        OriConvention::ZYZ => [deg(m[2][1], m[2][0]), deg(libm::hypot(m[2][0], m[2][1]), m[2][2]), deg(m[1][2], -m[0][2])],
        OriConvention::ZYX => [deg(m[0][1], m[0][0]), deg(-m[0][2], libm::hypot(m[0][0], m[0][1])), deg(m[1][2], m[2][2])],
        OriConvention::XYZ => [deg(-m[2][1], m[2][2]), deg(m[2][0], libm::hypot(m[2][1], m[2][2])), deg(-m[1][0], m[0][0])],
        _ => return near,
    };
    let zyz = convention == OriConvention::ZYZ;
    let (s, c) = sin_cos(first[1]);
    if (if zyz { s } else { c }).abs() < 1e-9 {
        return singular(convention, m, near, first[1]);
    }
    let second = [first[0] + 180.0, if zyz { -first[1] } else { 180.0 - first[1] }, first[2] + 180.0];
    let [p, q] = [first, second].map(|s| std::array::from_fn::<f64, 3, _>(|i| s[i] + 360.0 * ((near[i] - s[i]) / 360.0).round()));
    let distance = |s: &[f64; 3]| (0..3).map(|i| (s[i] - near[i]).abs()).sum::<f64>();
    if distance(&q) < distance(&p) { q } else { p }
}

/// First and last axis coincide: the first angle stays, the last takes the rest.
fn singular(convention: OriConvention, m: &Matrix, near: [f64; 3], middle: f64) -> [f64; 3] {
    let middle = middle + 360.0 * ((near[1] - middle) / 360.0).round();
    let Some(order) = order(convention) else { return near };
    let head = product(&about(order[0], near[0]), &about(order[1], middle));
    let rest = product(&transposed(&head), m);
    let (u, v) = ((order[2] + 1) % 3, (order[2] + 2) % 3);
    let last = libm::atan2(rest[u][v], rest[u][u]).to_degrees();
    [near[0], middle, last + 360.0 * ((near[2] - last) / 360.0).round()]
}

/// What a G54 or G55 says.
#[derive(Debug, Clone, Copy)]
pub struct Shift {
    /// Shift of each axis in the order of [`super::types::AXIS_WORDS`].
    pub axes: [f64; 11],
    /// Scales along X, Y, Z; none is 0.
    pub scale: [f64; 3],
}

impl Frame {
    fn matrix(&self) -> Matrix {
        [self.vX.array(), self.vY.array(), self.vZ.array()]
    }
    fn set_matrix(&mut self, m: &Matrix) {
        [self.vX, self.vY, self.vZ] = m.map(Vector3::new);
    }

    /// From program to machine coordinates. `near` is the last machine position (for the turns of angles).
    pub fn to_machine(&self, convention: OriConvention, p: &PosInfo, near: &PosInfo) -> PosInfo {
        if !self.bActive.get() {
            return *p;
        }
        let (program, shift, scale, m) = (p.axes(), self.piShift.axes(), self.vScale.array(), self.matrix());
        let moved = turn(&m, std::array::from_fn(|i| program[i] * scale[i]));
        let mut out: [f64; 11] = std::array::from_fn(|i| if i < 3 { moved[i] + shift[i] } else { program[i] + shift[i] });
        if let Some(tool) = rotation(convention, [program[3], program[4], program[5]]) {
            out[3..6].copy_from_slice(&angles(convention, &product(&m, &tool), [near.dA, near.dB, near.dC]));
        }
        p.with_axes(out)
    }

    /// From machine to program coordinates.
    pub fn to_program(&self, convention: OriConvention, p: &PosInfo, near: &PosInfo) -> PosInfo {
        if !self.bActive.get() {
            return *p;
        }
        let (machine, shift, scale, m) = (p.axes(), self.piShift.axes(), self.vScale.array(), self.matrix());
        let moved = turn_back(&m, std::array::from_fn(|i| machine[i] - shift[i]));
        let mut out: [f64; 11] = std::array::from_fn(|i| if i < 3 { moved[i] / scale[i] } else { machine[i] - shift[i] });
        if let Some(tool) = rotation(convention, [machine[3], machine[4], machine[5]]) {
            out[3..6].copy_from_slice(&angles(convention, &product(&transposed(&m), &tool), [near.dA, near.dB, near.dC]));
        }
        p.with_axes(out)
    }

    /// G54: sets the system in machine coordinates.
    pub fn set(&mut self, convention: OriConvention, shift: &Shift) {
        *self = Self::default();
        self.change(convention, shift);
    }

    /// G55: changes the system in its own coordinates.
    pub fn change(&mut self, convention: OriConvention, shift: &Shift) {
        let (m, scale, old) = (self.matrix(), self.vScale.array(), self.piShift.axes());
        let moved = turn(&m, std::array::from_fn(|i| shift.axes[i] * scale[i]));
        let turned = rotation(convention, [shift.axes[3], shift.axes[4], shift.axes[5]]);
        let angles_shift = |i: usize| turned.is_some() && (3..6).contains(&i);
        let new = std::array::from_fn(|i| match i {
            0..3 => old[i] + moved[i],
            i if angles_shift(i) => 0.0,
            i => old[i] + shift.axes[i],
        });
        self.piShift = self.piShift.with_axes(new);
        self.vScale = Vector3::new(std::array::from_fn(|i| scale[i] * shift.scale[i]));
        if let Some(turned) = turned {
            self.set_matrix(&product(&m, &turned));
        }
        self.bActive = Bool::TRUE;
    }

    /// G56: shifts the system so that the machine position `machine` has the program coordinates `program`.
    pub fn refer(&mut self, convention: OriConvention, program: &PosInfo, machine: &PosInfo) {
        self.bActive = Bool::TRUE;
        let angles_turn = rotation(convention, [0.0; 3]).is_some();
        let (reached, wanted, old) = (self.to_machine(convention, program, machine).axes(), machine.axes(), self.piShift.axes());
        let new = std::array::from_fn(|i| if angles_turn && (3..6).contains(&i) { 0.0 } else { old[i] + wanted[i] - reached[i] });
        self.piShift = self.piShift.with_axes(new);
    }

    /// The axes u, v and the normal of a plane in machine coordinates, and whether the sense of turning stays; `None` when the scales in it differ.
    pub fn plane(&self, axes: [usize; 2]) -> Option<([[f64; 3]; 3], bool)> {
        let (m, scale) = (self.matrix(), self.vScale.array());
        let [u, v] = axes;
        let normal = 3 - u - v;
        let equal = (scale[u].abs() - scale[v].abs()).abs() <= 1e-12 * scale[u].abs();
        equal.then(|| ([m[u], m[v], m[normal]], scale[u] * scale[v] > 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [OriConvention; 4] = [OriConvention::ADDAXES, OriConvention::ZYZ, OriConvention::ZYX, OriConvention::XYZ];

    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn position(seed: &mut u64) -> PosInfo {
        PosInfo::default().with_axes(std::array::from_fn(|_| random(seed) * 100.0))
    }

    fn shift(seed: &mut u64) -> Shift {
        Shift { axes: std::array::from_fn(|_| random(seed) * 200.0), scale: std::array::from_fn(|_| 0.5 + random(seed).abs()) }
    }

    #[test]
    fn angles_are_those_of_their_rotation() {
        let mut seed = 3;
        for i in 0..5000 {
            let mut abc: [f64; 3] = std::array::from_fn(|_| random(&mut seed) * 400.0);
            if i % 5 == 0 {
                abc[1] = [0.0, 90.0, 180.0, -90.0, 270.0][i / 5 % 5];
            }
            for convention in &ALL[1..] {
                let m = rotation(*convention, abc).expect("a rotation");
                let back = angles(*convention, &m, abc);
                for k in 0..3 {
                    assert!((back[k] - abc[k]).abs() < 1e-5, "{convention:?} {abc:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn to_machine_and_back_is_where_it_was() {
        let mut seed = 5;
        for _ in 0..2000 {
            for convention in ALL {
                let mut frame = Frame::default();
                frame.set(convention, &shift(&mut seed));
                frame.change(convention, &shift(&mut seed));
                let p = position(&mut seed);
                let machine = frame.to_machine(convention, &p, &p);
                let back = frame.to_program(convention, &machine, &p).axes();
                for (x, y) in back.iter().zip(p.axes()) {
                    assert!((x - y).abs() < 1e-6, "{convention:?} {back:?} {p:?}");
                }
            }
        }
    }

    #[test]
    fn shift_turn_and_scale_do_what_they_say() {
        let mut frame = Frame::default();
        let mut s = Shift { axes: [0.0; 11], scale: [2.0, 1.0, 1.0] };
        (s.axes[0], s.axes[3]) = (10.0, 90.0);
        frame.set(OriConvention::ZYX, &s);
        let p = PosInfo { dX: 1.0, ..PosInfo::default() };
        let m = frame.to_machine(OriConvention::ZYX, &p, &p);
        assert_eq!((m.dX, m.dY, m.dA), (10.0, 2.0, 90.0), "turned by A about Z, scaled before");
        frame.set(OriConvention::ADDAXES, &s);
        let m = frame.to_machine(OriConvention::ADDAXES, &p, &p);
        assert_eq!((m.dX, m.dY, m.dA), (12.0, 0.0, 90.0), "A is an axis of its own");
        let wanted = PosInfo { dX: -5.0, ..PosInfo::default() };
        frame.refer(OriConvention::ADDAXES, &wanted, &m);
        assert_eq!(frame.to_program(OriConvention::ADDAXES, &m, &p).dX, -5.0);
    }
}
