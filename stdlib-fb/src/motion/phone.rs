//! For tests: the phone job from its G-code through kinematics, time law and spline, in both modes, against the figures it must reach.

use crate::motion::kin5::{Joints, Links, Pose, Turns, forward, radians, rotation};
use crate::motion::oracle::{load, numbers};
use crate::motion::path_law::{PathLaw, PathLimits};
use crate::motion::spline::{Progress, Spline};

const LINKS: Links = Links { a: -5.0, b: 255.0, l1: 120.0 };
const LIMITS: PathLimits = PathLimits { velocity: 20.0, acceleration: 200.0, jerk: 4000.0 };

/// The dispensing run: x, y, z (mm), B, C (degrees) of every G-code point between M08 and M09.
fn dispensing_run() -> Vec<[f64; 5]> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/phone.cnc");
    let text = std::fs::read_to_string(path).expect("the job is there");
    let word = |line: &str, letter: char| {
        let text = line.split_whitespace().find_map(|w| w.strip_prefix(letter)).expect("the word is there");
        text.parse::<f64>().expect("a number")
    };
    let lines: Vec<&str> = text.lines().collect();
    let place = |what: &str| lines.iter().position(|l| l.ends_with(what)).expect("the M function is there");
    let (on, off) = (place("M08"), place("M09"));
    let travel = lines[on - 1..off].iter().filter(|l| l.contains("G01"));
    travel.map(|l| ['X', 'Y', 'Z', 'B', 'C'].map(|c| word(l, c))).collect()
}

fn pose(point: [f64; 5]) -> Pose {
    Pose { p: [point[0], point[1], point[2]], r: rotation(0.0, radians(point[3]), radians(point[4])) }
}

fn spline(knots: impl Iterator<Item = (f64, f64)>, slopes: (f64, f64)) -> Spline {
    let mut s = Spline::default();
    s.clear(slopes.0);
    knots.for_each(|(t, p)| s.push(t, p));
    while s.work(1000, Some(slopes.1)).expect("good knots") == Progress::More {}
    s
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}

/// The true path, as a spline through its points at full precision: how far a point is from it.
struct TruePath([Spline; 3], f64);

impl TruePath {
    fn new() -> Self {
        let file = load("phone_truth.json");
        let points: Vec<_> = file["points"].as_array().expect("points").iter().filter(|p| p["s"].is_number()).collect();
        let s = |i: usize| points[i]["s"].as_f64().expect("s");
        let at = |i: usize, axis: usize| numbers(&points[i]["p"])[axis];
        let last = points.len() - 1;
        let axis = |n: usize| {
            let slope = |i: usize| (at(i + 1, n) - at(i, n)) / (s(i + 1) - s(i));
            spline((0..=last).map(|i| (s(i), at(i, n))), (slope(0), slope(last - 1)))
        };
        Self([axis(0), axis(1), axis(2)], s(last))
    }
    /// The distance of `p` from the path near the arc length `s`.
    fn deviation(&mut self, p: [f64; 3], s: f64) -> f64 {
        let mut s = s;
        for _ in 0..8 {
            let (here, way): (Vec<_>, Vec<_>) = self.0.iter_mut().map(|c| c.sample(s.clamp(0.0, self.1))).map(|x| (x.p, x.v)).unzip();
            s += (0..3).map(|i| (p[i] - here[i]) * way[i]).sum::<f64>();
        }
        let here: Vec<_> = self.0.iter_mut().map(|c| c.sample(s.clamp(0.0, self.1)).p).collect();
        distance(p, [here[0], here[1], here[2]])
    }
}

/// Ripple of the speed in the constant zone and greatest deviation (mm), of set-points every millisecond.
fn judge(law: &PathLaw, mut tip: impl FnMut(f64) -> [f64; 3]) -> (f64, f64) {
    let mut path = TruePath::new();
    let (duration, dt) = (law.duration(), 1e-3);
    let (mut ripple, mut deviation) = (0.0_f64, 0.0_f64);
    let mut before = tip(0.0);
    for i in 1..=(duration / dt) as u32 {
        let t = f64::from(i) * dt;
        let now = tip(t);
        if t > 0.2 && t < duration - 0.2 {
            ripple = ripple.max((distance(before, now) / dt / 20.0 - 1.0).abs());
        }
        deviation = deviation.max(path.deviation(now, law.at(t).0));
        before = now;
    }
    (ripple, deviation)
}

#[test]
fn both_modes_reach_the_figures_of_the_phone_job() {
    let points = dispensing_run();
    let mut length = vec![0.0];
    for pair in points.windows(2) {
        length.push(length[length.len() - 1] + distance(pose(pair[0]).p, pose(pair[1]).p));
    }
    let law = PathLaw::new(length[length.len() - 1], LIMITS).expect("good limits");
    let times: Vec<f64> = length.iter().map(|s| law.time_at(*s)).collect();

    let mut turns = Turns::default();
    let joints: Vec<Joints> = points.iter().map(|p| turns.inverse(LINKS, &pose(*p)).expect("reachable")).collect();
    let axis = |value: fn(&Joints) -> f64| spline(times.iter().copied().zip(joints.iter().map(value)), (0.0, 0.0));
    let mut axes = [axis(|q| q.theta1), axis(|q| q.theta2), axis(|q| q.d[0]), axis(|q| q.d[1]), axis(|q| q.d[2])];
    let (ripple, deviation) = judge(&law, |t| {
        let [theta1, theta2, d1, d2, d3] = std::array::from_fn(|i| axes[i].sample(t).p);
        forward(LINKS, Joints { theta1, theta2, d: [d1, d2, d3] }).p
    });
    assert!(ripple <= 0.006 && deviation <= 2e-3, "joints over time: {ripple} {deviation}");

    let last = points.len() - 1;
    let mut part: [Spline; 5] = std::array::from_fn(|n| {
        let slope = |i: usize| (points[i + 1][n] - points[i][n]) / (length[i + 1] - length[i]);
        spline((0..=last).map(|i| (length[i], points[i][n])), (slope(0), slope(last - 1)))
    });
    let mut turns = Turns::default();
    let (ripple, deviation) = judge(&law, |t| {
        let s = law.at(t).0;
        let there = pose(std::array::from_fn(|i| part[i].sample(s).p));
        forward(LINKS, turns.inverse(LINKS, &there).expect("reachable")).p
    });
    assert!(ripple <= 0.0005 && deviation <= 1.5e-3, "part space: {ripple} {deviation}");
}
