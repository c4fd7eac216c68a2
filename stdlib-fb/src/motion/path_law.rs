//! The time law of a path from rest to rest: the S-curve of seven pieces (jerk, acceleration, jerk, cruise and the mirror image).
//!
//! A path of any shape has one length; the law says where on it to be at which time, so that speed, acceleration and jerk along it stay within limits
//! and the time is the shortest. The spline through knots at these times does not ring, as it does when each segment simply gets length / speed.
//! Closed form throughout; a law is a value, made anew at each call.

use libm::cbrt;
use takt_abi::native_fn;

/// Speed, acceleration and jerk along a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLimits {
    /// mm/s.
    pub velocity: f64,
    /// mm/s².
    pub acceleration: f64,
    /// mm/s³.
    pub jerk: f64,
}

/// The time law of one path. Accelerates for `2 tj + ta`, cruises for `tc`, brakes in the mirror image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLaw {
    length: f64,
    jerk: f64,
    tj: f64,
    ta: f64,
    tc: f64,
}

impl PathLaw {
    /// The law for a length (mm, 0 or more); `None` unless the length is finite and not negative and the limits are finite and positive.
    pub fn new(length: f64, limits: PathLimits) -> Option<Self> {
        let PathLimits { velocity, acceleration, jerk } = limits;
        let usable = [velocity, acceleration, jerk].iter().all(|x| x.is_finite() && *x > 0.0);
        if !usable || !length.is_finite() || length < 0.0 {
            return None;
        }
        // Up to this speed the acceleration limit is not reached.
        let corner = acceleration * acceleration / jerk;
        let ramp_length = |v: f64| v * if v > corner { v / acceleration + acceleration / jerk } else { 2.0 * (v / jerk).sqrt() };
        let peak = if length >= ramp_length(velocity) {
            velocity
        } else if length <= ramp_length(corner) {
            cbrt(length * length * jerk / 4.0)
        } else {
            let half = corner / 2.0;
            acceleration * length / (half + (half * half + acceleration * length).sqrt())
        };
        let tj = if peak > corner { acceleration / jerk } else { (peak / jerk).sqrt() };
        let ta = if peak > corner { peak / acceleration - tj } else { 0.0 };
        let tc = if peak > 0.0 { (length / peak - (2.0 * tj + ta)).max(0.0) } else { 0.0 };
        let law = Self { length, jerk, tj, ta, tc };
        law.duration().is_finite().then_some(law)
    }

    fn ramp(&self) -> f64 {
        2.0 * self.tj + self.ta
    }
    /// The time the path takes, s.
    pub fn duration(&self) -> f64 {
        2.0 * self.ramp() + self.tc
    }
    /// The highest speed reached, mm/s.
    pub fn peak_velocity(&self) -> f64 {
        self.jerk * self.tj * (self.tj + self.ta)
    }

    /// Place (mm), speed and acceleration at `t` s after the start; held before the start and after the end.
    pub fn at(&self, t: f64) -> (f64, f64, f64) {
        let duration = self.duration();
        if t.is_nan() || t <= 0.0 {
            return (0.0, 0.0, 0.0);
        }
        if t >= duration {
            return (self.length, 0.0, 0.0);
        }
        if t <= duration / 2.0 {
            return self.first_half(t);
        }
        let (s, v, a) = self.first_half(duration - t);
        (self.length - s, v, -a)
    }

    fn first_half(&self, t: f64) -> (f64, f64, f64) {
        let Self { jerk: j, tj, ta, .. } = *self;
        let a = j * tj;
        let v1 = 0.5 * j * tj * tj;
        if t < tj {
            (j * t * t * t / 6.0, 0.5 * j * t * t, j * t)
        } else if t < tj + ta {
            let x = t - tj;
            (v1 * tj / 3.0 + x * (v1 + x * a / 2.0), v1 + a * x, a)
        } else if t < self.ramp() {
            // The last jerk, seen from its end.
            let (x, v) = (self.ramp() - t, self.peak_velocity());
            (v * self.ramp() / 2.0 - x * (v - j * x * x / 6.0), v - 0.5 * j * x * x, j * x)
        } else {
            let v = self.peak_velocity();
            (v * self.ramp() / 2.0 + v * (t - self.ramp()), v, 0.0)
        }
    }

    /// The time at which the place `s` (mm) is passed, s.
    pub fn time_at(&self, s: f64) -> f64 {
        if s.is_nan() || s <= 0.0 {
            return 0.0;
        }
        if s >= self.length {
            return self.duration();
        }
        if s <= self.length / 2.0 { self.first_half_time(s) } else { self.duration() - self.first_half_time(self.length - s) }
    }

    fn first_half_time(&self, s: f64) -> f64 {
        let Self { jerk: j, tj, ta, .. } = *self;
        let (a, v1, v) = (j * tj, 0.5 * j * tj * tj, self.peak_velocity());
        let (s1, ramp) = (v1 * tj / 3.0, self.ramp());
        let s2 = s1 + ta * (v1 + ta * a / 2.0);
        if s <= s1 {
            cbrt(6.0 * s / j)
        } else if s <= s2 {
            let d = s - s1;
            tj + 2.0 * d / (v1 + (v1 * v1 + 2.0 * a * d).sqrt())
        } else if s < v * ramp / 2.0 {
            self.second_jerk_time(v * ramp / 2.0 - s)
        } else {
            ramp + (s - v * ramp / 2.0) / v
        }
    }

    /// The time in the second jerk piece at which `d` is left to its end: the root of `v x - j x³ / 6 = d` for `x` in `0..tj`, where the left
    /// side rises and bends down, so that Newton's steps from 0 rise to the root and never pass it.
    fn second_jerk_time(&self, d: f64) -> f64 {
        let v = self.peak_velocity();
        let mut x = 0.0;
        for _ in 0..60 {
            let next: f64 = x + (d - x * (v - self.jerk * x * x / 6.0)) / (v - 0.5 * self.jerk * x * x);
            let next = next.min(self.tj);
            if next <= x {
                break;
            }
            x = next;
        }
        self.ramp() - x
    }
}

fn law(length: f64, velocity: f64, acceleration: f64, jerk: f64) -> Option<PathLaw> {
    PathLaw::new(length, PathLimits { velocity, acceleration, jerk })
}

native_fn! {
    /// Shortest time (s) from rest to rest over a path of `Length` (mm) with at most `Velocity`, `Acceleration` and `Jerk` along it.
    ///
    /// NaN if a limit is not positive and finite or the length is negative or not finite; the blocks that receive it then refuse it.
    pub fn SCurveTime as SCurveTime(_cx, Length: f64, Velocity: f64, Acceleration: f64, Jerk: f64) -> f64 {
        Ok(law(Length, Velocity, Acceleration, Jerk).map_or(f64::NAN, |l| l.duration()))
    }
}
native_fn! {
    /// Place (mm from the start) on the path of `SCurveTime` at `Time` s after its start; 0 before, `Length` after it. NaN as there.
    pub fn SCurvePos as SCurvePos(_cx, Time: f64, Length: f64, Velocity: f64, Acceleration: f64, Jerk: f64) -> f64 {
        Ok(law(Length, Velocity, Acceleration, Jerk).map_or(f64::NAN, |l| l.at(Time).0))
    }
}
native_fn! {
    /// Speed (mm/s) along the path of `SCurveTime` at `Time` s after its start. NaN as there.
    pub fn SCurveVel as SCurveVel(_cx, Time: f64, Length: f64, Velocity: f64, Acceleration: f64, Jerk: f64) -> f64 {
        Ok(law(Length, Velocity, Acceleration, Jerk).map_or(f64::NAN, |l| l.at(Time).1))
    }
}
native_fn! {
    /// Acceleration (mm/s²) along the path of `SCurveTime` at `Time` s after its start. NaN as there.
    pub fn SCurveAcc as SCurveAcc(_cx, Time: f64, Length: f64, Velocity: f64, Acceleration: f64, Jerk: f64) -> f64 {
        Ok(law(Length, Velocity, Acceleration, Jerk).map_or(f64::NAN, |l| l.at(Time).2))
    }
}
native_fn! {
    /// Time (s) at which the path of `SCurveTime` passes the place `Position` (mm from its start): the inverse of `SCurvePos`. NaN as there.
    pub fn SCurveTimeAt as SCurveTimeAt(_cx, Position: f64, Length: f64, Velocity: f64, Acceleration: f64, Jerk: f64) -> f64 {
        Ok(law(Length, Velocity, Acceleration, Jerk).map_or(f64::NAN, |l| l.time_at(Position)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::oracle::{Random, load, numbers};

    #[test]
    fn the_runs_of_the_phone_job_take_their_time() {
        let meta = load("phone_truth.json")["meta"].clone();
        let mut total = 0.0;
        for run in meta["runs"].as_object().expect("runs").values() {
            let length = run["length_mm"].as_f64().expect("length");
            let law = law(length, 20.0, 200.0, 4000.0).expect("good limits");
            assert!((law.duration() - run["T_s"].as_f64().expect("T_s")).abs() < 1e-9);
            assert!((law.peak_velocity() - 20.0).abs() < 1e-12);
            total += law.duration();
        }
        assert!((total - meta["total_time_s"].as_f64().expect("total")).abs() < 1e-9);
    }

    #[test]
    fn rest_to_rest_cases_of_the_reference_agree() {
        let mut seen = 0;
        for case in load("scurve.json")["cases"].as_array().expect("cases") {
            let x = |k: &str| case[k].as_f64().expect("a number");
            if case["feasible"] == false || x("vs") != 0.0 || x("ve") != 0.0 {
                continue;
            }
            let law = law(x("L"), x("vm"), x("amax"), x("jmax")).expect("good limits");
            assert!((law.duration() - x("T")).abs() < 1e-9 * x("T"));
            let [t, s, v, a] = ["t", "s", "v", "a"].map(|k| numbers(&case[k]));
            for i in 0..t.len() {
                let (sx, vx, ax) = law.at(t[i]);
                let scales = [x("L"), x("vm"), x("amax")];
                assert!((sx - s[i]).abs() < 1e-9 * scales[0] && (vx - v[i]).abs() < 1e-8 * scales[1], "{i} {sx} {vx} {case}");
                let edge = i == 0 || i == t.len() - 1 || (0..7).any(|n| near_edge(&case["durations"], n, t[i]));
                assert!(edge || (ax - a[i]).abs() < 1e-6 * scales[2], "{i} {ax} {case}");
            }
            seen += 1;
        }
        assert!(seen > 5);
    }
    fn near_edge(durations: &serde_json::Value, n: usize, t: f64) -> bool {
        (numbers(durations)[..=n].iter().sum::<f64>() - t).abs() < 1e-6
    }

    #[test]
    fn limits_hold_and_time_at_is_the_inverse_for_random_paths() {
        let mut random = Random(11);
        for _ in 0..3000 {
            let scale = |r: &mut Random, low: f64, high: f64| libm::pow(10.0, r.within(low, high));
            let (length, v, a, j) =
                (scale(&mut random, -3.0, 3.0), scale(&mut random, 0.0, 3.0), scale(&mut random, 1.0, 4.0), scale(&mut random, 2.0, 6.0));
            let law = law(length, v, a, j).expect("good limits");
            let duration = law.duration();
            let mut before = (0.0, 0.0, 0.0);
            for i in 0..=200 {
                let t = duration * f64::from(i) / 200.0;
                let now = law.at(t);
                let dt = duration / 200.0;
                assert!(now.0 >= before.0 && now.1 >= -1e-12 && now.1 <= v * (1.0 + 1e-12) && now.2.abs() <= a * (1.0 + 1e-12));
                assert!((now.0 - before.0) / dt <= v * (1.0 + 1e-9) && ((now.1 - before.1) / dt).abs() <= a * (1.0 + 1e-9));
                assert!(((now.2 - before.2) / dt).abs() <= j * (1.0 + 1e-6) || i == 200);
                before = now;
                let s = length * f64::from(i) / 200.0;
                assert!((law.at(law.time_at(s)).0 - s).abs() <= 1e-12 * length, "{s} {law:?}");
            }
            assert_eq!(law.at(duration), (length, 0.0, 0.0));
        }
    }

    #[test]
    fn nonsense_has_no_law() {
        for (l, v, a, j) in [(-1.0, 1.0, 1.0, 1.0), (1.0, 0.0, 1.0, 1.0), (1.0, 1.0, f64::NAN, 1.0), (f64::INFINITY, 1.0, 1.0, 1.0)] {
            assert_eq!(law(l, v, a, j), None);
        }
        assert_eq!(law(1e308, 1e-308, 1.0, 1.0), None);
        let standing = law(0.0, 1.0, 1.0, 1.0).expect("a law");
        assert_eq!((standing.duration(), standing.at(0.5), standing.time_at(1.0)), (0.0, (0.0, 0.0, 0.0), 0.0));
    }
}
