//! Arcs: from the words of G2 and G3 to centre, radius and angles.
//!
//! Everything happens in a plane with two axes u and v; w is the normal. Angles are degrees from u towards v; a sweep is + clockwise.

use super::trouble::Kind;

/// The shape of an arc in its plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Centre, mm.
    pub centre: [f64; 2],
    /// Radius, mm.
    pub radius: f64,
    /// Angle of the start, degrees, in (-180, 180].
    pub start: f64,
    /// Sweep, degrees, + clockwise; never 0.
    pub sweep: f64,
}

/// Where an arc's centre is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Round {
    /// At this place.
    Centre([f64; 2]),
    /// At this distance, on the side of the shorter arc (positive) or the longer one (negative).
    Radius(f64),
}

/// The arc from `a` to `b`. Equal ends with a centre are a full circle.
pub fn arc(a: [f64; 2], b: [f64; 2], round: Round, clockwise: bool) -> Result<Arc, Kind> {
    let centre = match round {
        Round::Centre(c) => c,
        Round::Radius(r) => centre_by_radius(a, b, r, clockwise)?,
    };
    let ra = libm::hypot(a[0] - centre[0], a[1] - centre[1]);
    let rb = libm::hypot(b[0] - centre[0], b[1] - centre[1]);
    if ra < 1e-6 {
        return Err(Kind::ArcNoRadius);
    }
    if (ra - rb).abs() > mismatch(ra) {
        return Err(Kind::ArcOpen(ra, rb));
    }
    let at = |p: [f64; 2]| libm::atan2(p[1] - centre[1], p[0] - centre[0]).to_degrees();
    let start = at(a);
    let sweep =
        if libm::hypot(b[0] - a[0], b[1] - a[1]) < 1e-9 { 360.0 } else { turn(if clockwise { start - at(b) } else { at(b) - start }) };
    Ok(Arc { centre, radius: (ra + rb) / 2.0, start, sweep: if clockwise { sweep } else { -sweep } })
}

/// How far the two radii may differ, mm: 0.01, for small arcs 1 %, but never less than what files with three decimals bring.
fn mismatch(radius: f64) -> f64 {
    (radius / 100.0).clamp(0.0015, 0.01)
}

/// An angle in (0, 360].
fn turn(angle: f64) -> f64 {
    let rest = angle - 360.0 * (angle / 360.0).floor();
    if rest > 0.0 { rest } else { 360.0 }
}

fn centre_by_radius(a: [f64; 2], b: [f64; 2], r: f64, clockwise: bool) -> Result<[f64; 2], Kind> {
    let chord = [b[0] - a[0], b[1] - a[1]];
    let half = libm::hypot(chord[0], chord[1]) / 2.0;
    if half < 1e-9 {
        return Err(Kind::ArcFullByRadius);
    }
    if r.abs() < half - mismatch(half) {
        return Err(Kind::ArcRadius(r, half));
    }
    let height = (r * r - half * half).max(0.0).sqrt();
    let left = if clockwise == (r >= 0.0) { -1.0 } else { 1.0 };
    let scale = left * height / (2.0 * half);
    Ok([(a[0] + b[0]) / 2.0 - chord[1] * scale, (a[1] + b[1]) / 2.0 + chord[0] * scale])
}

impl Arc {
    /// Length of the way with a rise along the normal, mm.
    pub fn length(&self, rise: f64) -> f64 {
        libm::hypot(self.radius * self.sweep.abs().to_radians(), rise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(round: Round, clockwise: bool, b: [f64; 2], centre: [f64; 2], sweep: f64) {
        let arc = arc([10.0, 0.0], b, round, clockwise).expect("an arc");
        let near = |x: f64, y: f64| (x - y).abs() < 1e-9;
        assert!(near(arc.centre[0], centre[0]) && near(arc.centre[1], centre[1]) && near(arc.sweep, sweep), "{arc:?}");
    }

    #[test]
    fn centre_and_radius_give_the_same_arcs() {
        check(Round::Centre([0.0, 0.0]), false, [0.0, 10.0], [0.0, 0.0], -90.0);
        check(Round::Radius(10.0), false, [0.0, 10.0], [0.0, 0.0], -90.0);
        check(Round::Centre([0.0, 0.0]), true, [0.0, 10.0], [0.0, 0.0], 270.0);
        check(Round::Radius(-10.0), true, [0.0, 10.0], [0.0, 0.0], 270.0);
        check(Round::Radius(10.0), true, [0.0, 10.0], [10.0, 10.0], 90.0);
        check(Round::Radius(10.0), false, [-10.0, 0.0], [0.0, 0.0], -180.0);
        check(Round::Centre([0.0, 0.0]), true, [10.0, 0.0], [0.0, 0.0], 360.0);
    }

    #[test]
    fn what_does_not_close_is_refused() {
        let open = |b, round| arc([10.0, 0.0], b, round, true).expect_err("no arc");
        assert!(matches!(open([0.0, 10.02], Round::Centre([0.0, 0.0])), Kind::ArcOpen(..)));
        assert!(matches!(open([-10.0, 0.0], Round::Radius(9.9)), Kind::ArcRadius(..)));
        assert_eq!(open([10.0, 0.0], Round::Radius(10.0)), Kind::ArcFullByRadius);
        assert_eq!(open([0.0, 10.0], Round::Centre([10.0, 0.0])), Kind::ArcNoRadius);
        assert!(arc([10.0, 0.0], [0.0, 10.004], Round::Centre([0.0, 0.0]), true).is_ok(), "three decimals are no error");
    }

    #[test]
    fn arcs_agree_with_the_reference_cases() {
        let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/arc_ellipse.json")).expect("reference");
        let data: serde_json::Value = serde_json::from_str(&text).expect("json");
        let pair = |v: &serde_json::Value| [v[0].as_f64().expect("x"), v[1].as_f64().expect("y")];
        let mut tested = 0;
        for case in data["arcs"].as_array().expect("arcs") {
            let (start, end, centre) = (pair(&case["start"]), pair(&case["end"]), pair(&case["centre"]));
            let width = case["anglewidth_deg"].as_f64().expect("width");
            if width.abs() > 360.0 {
                continue;
            }
            tested += 1;
            let arc = arc(start, end, Round::Centre(centre), width < 0.0).expect("an arc");
            let radius = case["radius"].as_f64().expect("radius");
            assert!((arc.radius - radius.abs()).abs() < 1e-8, "{case}");
            assert!((arc.sweep + width).abs() < 1e-7, "{} {width}", arc.sweep);
            assert!((arc.length(0.0) - case["length"].as_f64().expect("length")).abs() < 1e-8, "{case}");
            let turns = (arc.start - case["startangle_deg"].as_f64().expect("angle")) / 360.0;
            assert!((turns - turns.round()).abs() < 1e-10, "{turns}");
            let last = (arc.start - arc.sweep).to_radians();
            let reached = [arc.centre[0] + arc.radius * libm::cos(last), arc.centre[1] + arc.radius * libm::sin(last)];
            assert!((reached[0] - end[0]).abs() < 1e-8 && (reached[1] - end[1]).abs() < 1e-8, "{reached:?} {end:?}");
        }
        assert!(tested >= 35, "{tested}");
    }
}
