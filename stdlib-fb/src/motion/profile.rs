//! Motion of one axis from any state to a position or velocity, with limited velocity, acceleration, deceleration and jerk.
//!
//! [`Profile::to_position`] and [`Profile::to_velocity`] plan pieces of constant jerk in closed form, but for one bisection over the cruising
//! velocity; [`Profile::at`] evaluates them. A profile is plain data, fit for a block's state. Nothing allocates, everything is deterministic.
//!
//! **Promises**, when the start itself is within the limits and not bound to leave them (an acceleration that cannot be brought to 0 in time overshoots
//! the velocity, whatever one does): |v| <= velocity; |a| <= acceleration while |v| rises and <= deceleration while it falls; |da/dt| <= jerk; the end
//! is exact. From rest to rest the time is the shortest. A start outside the limits is brought into them first, within the jerk limit.
//!
//! **Lacks** time-optimality for starts with acceleration and for reversals when acceleration and deceleration differ (it stops for an instant).

use takt_abi::st_struct;

/// Pieces of a profile: two ramps of up to six and a cruise between, and the second ramp never reverses.
const PIECES: usize = 13;

/// Limits of a motion, positive, per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Velocity.
    pub velocity: f64,
    /// Acceleration while |v| rises.
    pub acceleration: f64,
    /// Acceleration while |v| falls.
    pub deceleration: f64,
    /// Jerk.
    pub jerk: f64,
}

impl Limits {
    /// Whether all are positive and finite.
    pub fn are_usable(&self) -> bool {
        [self.velocity, self.acceleration, self.deceleration, self.jerk].iter().all(|x| x.is_finite() && *x > 0.0)
    }
}

/// Position, velocity and acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Position.
    pub p: f64,
    /// Velocity.
    pub v: f64,
    /// Acceleration.
    pub a: f64,
}

impl Motion {
    fn is_finite(&self) -> bool {
        self.p.is_finite() && self.v.is_finite() && self.a.is_finite()
    }
    /// After `t` with constant jerk.
    fn after(self, jerk: f64, t: f64) -> Self {
        Self {
            p: self.p + t * (self.v + t * (self.a / 2.0 + t * jerk / 6.0)),
            v: self.v + t * (self.a + t * jerk / 2.0),
            a: self.a + t * jerk,
        }
    }
    /// The velocity when the acceleration is brought to 0 at once.
    fn natural_velocity(&self, jerk: f64) -> f64 {
        self.v + self.a * self.a.abs() / (2.0 * jerk)
    }
}

st_struct! {
    /// A planned motion of one axis: pieces of constant jerk.
    pub struct TAKT_PROFILE as Profile {
        start_p: f64,
        start_v: f64,
        start_a: f64,
        /// Position at the end of the last piece.
        end_p: f64,
        /// Velocity there, kept on afterwards.
        end_v: f64,
        /// The piece of constant velocity, counted from 0, if there is one.
        cruise: u64 = u64::MAX,
        /// Its velocity: set there, so that rounding does not grow over a long cruise.
        cruise_v: f64,
        /// Durations of the pieces, s.
        times: [f64; PIECES],
        /// Their jerks.
        jerks: [f64; PIECES],
    }
}

impl Profile {
    /// A motion to `target`, arriving with velocity 0 and acceleration 0. `None` if a number is not finite, a limit not positive, or the numbers too far
    /// apart to be planned.
    pub fn to_position(start: Motion, target: f64, limits: Limits) -> Option<Self> {
        Self::to_position_at(start, target, 0.0, limits)
    }

    /// As [`Profile::to_position`], but passing `target` with velocity `end_v` (and acceleration 0), where the way is long enough for that.
    pub fn to_position_at(start: Motion, target: f64, end_v: f64, limits: Limits) -> Option<Self> {
        if !start.is_finite() || !target.is_finite() || !end_v.is_finite() || !limits.are_usable() {
            return None;
        }
        let way = target - start.p;
        let from = Motion { p: 0.0, ..start };
        let via = |peak: f64| {
            let mut pieces = Pieces::from(from);
            pieces.ramp(peak, limits);
            pieces.ramp(end_v, limits);
            pieces
        };
        let peak = cruise(way, from, end_v, limits, |peak| via(peak).now.p);
        let mut pieces = Pieces::from(from);
        pieces.ramp(peak, limits);
        let rest = way - via(peak).now.p;
        if rest * peak > 0.0 {
            pieces.hold(rest / peak);
        }
        pieces.ramp(end_v, limits);
        pieces.profile(start, target, end_v)
    }

    /// A motion to the velocity `target`, which is then kept. `limits.velocity` does not matter.
    pub fn to_velocity(start: Motion, target: f64, limits: Limits) -> Option<Self> {
        if !start.is_finite() || !target.is_finite() || !limits.are_usable() {
            return None;
        }
        let mut pieces = Pieces::from(Motion { p: 0.0, ..start });
        pieces.ramp(target, limits);
        let end = start.p + pieces.now.p;
        pieces.profile(start, end, target)
    }

    /// The time until the end state, s.
    pub fn duration(&self) -> f64 {
        self.times.iter().sum()
    }

    /// Position, velocity and acceleration at `t` s after the start. After the end: exactly the end state, moving on with its velocity.
    pub fn at(&self, t: f64) -> Motion {
        let beyond = t - self.duration();
        if beyond >= 0.0 {
            return Motion { p: self.end_p + self.end_v * beyond, v: self.end_v, a: 0.0 };
        }
        let mut now = Motion { p: 0.0, v: self.start_v, a: self.start_a };
        let mut left = t.max(0.0);
        for (i, (time, jerk)) in self.times.iter().zip(&self.jerks).enumerate() {
            if i as u64 == self.cruise {
                (now.v, now.a) = (self.cruise_v, 0.0);
            }
            if left < *time {
                let there = now.after(*jerk, left);
                return Motion { p: self.start_p + there.p, ..there };
            }
            now = now.after(*jerk, *time);
            left -= time;
        }
        Motion { p: self.end_p, v: self.end_v, a: 0.0 }
    }
}

/// The cruising velocity with which `way` is covered, or the limit if there is way left to cruise. `reach(peak)` is the way covered with no cruise.
fn cruise(way: f64, from: Motion, end_v: f64, limits: Limits, reach: impl Fn(f64) -> f64) -> f64 {
    let direct = reach(end_v);
    let sign = if way >= direct { 1.0 } else { -1.0 };
    let limit = sign * limits.velocity;
    let short = |peak: f64| sign * (way - reach(peak)) >= 0.0;
    if short(limit) {
        return limit;
    }
    // Between `near`, which falls short of the target, and `far`, which passes it.
    let (mut near, mut far) = (end_v.clamp(-limits.velocity, limits.velocity), limit);
    let natural = from.natural_velocity(limits.jerk);
    if (natural - near) * sign > 0.0 && natural.abs() < limits.velocity && short(natural) {
        near = natural;
    }
    let enough = 1e-14 * way.abs();
    for _ in 0..200 {
        let middle = near + (far - near) / 2.0;
        if middle == near || middle == far {
            break;
        }
        let rest = sign * (way - reach(middle));
        if rest >= 0.0 {
            near = middle;
            if rest <= enough {
                break;
            }
        } else {
            far = middle;
        }
    }
    near
}

/// Pieces as they are strung together.
#[derive(Debug, Clone, Copy)]
struct Pieces {
    now: Motion,
    count: usize,
    cruise: u64,
    cruise_v: f64,
    times: [f64; PIECES],
    jerks: [f64; PIECES],
}

impl Pieces {
    fn from(now: Motion) -> Self {
        Self { now, count: 0, cruise: u64::MAX, cruise_v: 0.0, times: [0.0; PIECES], jerks: [0.0; PIECES] }
    }
    fn piece(&mut self, jerk: f64, time: f64) {
        if time > 0.0 && self.count < PIECES {
            (self.times[self.count], self.jerks[self.count]) = (time, jerk);
            self.count += 1;
            self.now = self.now.after(jerk, time);
        }
    }
    /// Moves on with the velocity reached.
    fn hold(&mut self, time: f64) {
        (self.cruise, self.cruise_v) = (self.count as u64, self.now.v);
        self.piece(0.0, time);
    }
    /// Changes to the velocity `target` with acceleration 0, stopping for an instant where the direction changes: the limits differ on either side.
    fn ramp(&mut self, target: f64, limits: Limits) {
        let natural = self.now.natural_velocity(limits.jerk);
        if natural * target < 0.0 {
            self.ramp_on_one_side(0.0, natural, limits);
            self.ramp_on_one_side(target, target, limits);
        } else {
            self.ramp_on_one_side(target, if target == 0.0 { natural } else { target }, limits);
        }
        (self.now.v, self.now.a) = (target, 0.0);
    }
    /// Changes to the velocity `target`; `side` has the sign of the velocities on the way.
    fn ramp_on_one_side(&mut self, target: f64, side: f64, limits: Limits) {
        let jerk = limits.jerk;
        let sign = if target >= self.now.natural_velocity(jerk) { 1.0 } else { -1.0 };
        let bound = match sign * side >= 0.0 {
            _ if self.now.v * side < 0.0 => limits.acceleration.min(limits.deceleration),
            true => limits.acceleration,
            false => limits.deceleration,
        };
        let (gain, a0) = (sign * (target - self.now.v), sign * self.now.a);
        let square = (jerk * gain + a0 * a0 / 2.0).max(0.0);
        let peak = square.sqrt().min(bound);
        self.piece(sign * jerk * (peak - a0).signum(), (peak - a0).abs() / jerk);
        if peak > 0.0 && square > bound * bound {
            // What the two pieces of jerk do not gain.
            let before = (a0 + peak) / 2.0 * (peak - a0).abs() / jerk;
            self.piece(0.0, (gain - before - peak * peak / (2.0 * jerk)) / peak);
        }
        self.piece(-sign * jerk, peak / jerk);
        (self.now.v, self.now.a) = (target, 0.0);
    }
    fn profile(self, start: Motion, end_p: f64, end_v: f64) -> Option<Profile> {
        let Self { cruise, cruise_v, times, jerks, .. } = self;
        let profile = Profile { start_p: start.p, start_v: start.v, start_a: start.a, end_p, end_v, cruise, cruise_v, times, jerks };
        (profile.duration().is_finite() && end_p.is_finite()).then_some(profile)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::oracle::{Random, load, numbers};

    fn limits(random: &mut Random) -> Limits {
        Limits {
            velocity: random.within(1.0, 500.0),
            acceleration: random.within(10.0, 5000.0),
            deceleration: random.within(10.0, 5000.0),
            jerk: random.within(100.0, 100_000.0),
        }
    }
    /// A state that is within the limits and can stay there.
    fn state(random: &mut Random, l: Limits) -> Motion {
        loop {
            let m = Motion {
                p: random.within(-500.0, 500.0),
                v: random.within(-l.velocity, l.velocity),
                a: random.within(-1.0, 1.0) * l.acceleration.min(l.deceleration),
            };
            if m.natural_velocity(l.jerk).abs() <= l.velocity {
                return m;
            }
        }
    }
    /// Limits by finite differences of what is sampled, and continuity.
    fn assert_limits(profile: &Profile, l: Limits, steps: u32) {
        let dt = (profile.duration() / f64::from(steps)).max(1e-6);
        let mut before = profile.at(0.0);
        let slack = 1.0 + 1e-6;
        for i in 1..=steps + 3 {
            let now = profile.at(dt * f64::from(i));
            let (v, a, j) = ((now.p - before.p) / dt, (now.v - before.v) / dt, (now.a - before.a) / dt);
            let noise = 1e-10 / dt;
            assert!(v.abs() <= l.velocity * slack + noise && now.v.abs() <= l.velocity * slack, "{v} {now:?} {l:?} {profile:?}");
            let bound = match before.v * now.v > 0.0 {
                false => l.acceleration.max(l.deceleration),
                true if now.v.abs() > before.v.abs() => l.acceleration,
                true => l.deceleration,
            };
            assert!(a.abs() <= bound * slack + noise, "{a} {bound} {now:?}");
            assert!(j.abs() <= l.jerk * slack + noise * 1e3, "{j} {now:?}");
            before = now;
        }
    }

    #[test]
    fn any_state_reaches_any_position_within_the_limits() {
        let mut random = Random(21);
        for n in 0..6000 {
            let l = limits(&mut random);
            let start = if n % 3 == 0 { Motion { p: random.within(-500.0, 500.0), ..Motion::default() } } else { state(&mut random, l) };
            let near = if n % 2 == 0 { 1000.0 } else { 1.0 };
            let target = start.p + random.within(-near, near);
            let profile = Profile::to_position(start, target, l).expect("plannable");
            assert_limits(&profile, l, 300);
            let duration = profile.duration();
            assert_eq!(profile.at(duration + 1e-9), Motion { p: target, v: 0.0, a: 0.0 });
            let end = profile.at(duration * (1.0 - 1e-12));
            assert!((end.p - target).abs() < 1e-9 && end.v.abs() < 1e-6 * l.velocity, "{end:?} {target} {start:?} {l:?} {profile:?}");
        }
    }

    #[test]
    fn any_state_reaches_any_velocity_within_the_limits() {
        let mut random = Random(22);
        for _ in 0..6000 {
            let l = limits(&mut random);
            let start = state(&mut random, l);
            let target = random.within(-l.velocity, l.velocity);
            let profile = Profile::to_velocity(start, target, l).expect("plannable");
            assert_limits(&profile, l, 300);
            let duration = profile.duration();
            let (end, later) = (profile.at(duration), profile.at(duration + 2.0));
            assert_eq!((end.v, end.a), (target, 0.0));
            assert!((later.p - end.p - 2.0 * target).abs() < 1e-9);
        }
    }

    #[test]
    fn a_motion_can_be_changed_at_any_time() {
        let mut random = Random(23);
        for _ in 0..800 {
            let l = limits(&mut random);
            let mut now = Motion::default();
            for _ in 0..8 {
                let target = random.within(-300.0, 300.0);
                let profile = Profile::to_position(now, target, l).expect("plannable");
                assert_limits(&profile, l, 200);
                now = profile.at(profile.duration() * random.within(0.0, 1.1));
                if random.whole(0, 3) == 0 {
                    let stop = Profile::to_velocity(now, 0.0, l).expect("plannable");
                    assert_limits(&stop, l, 100);
                    now = stop.at(stop.duration() * random.within(0.0, 1.1));
                }
            }
        }
    }

    #[test]
    fn starts_outside_the_limits_come_into_them_and_end_exactly() {
        let mut random = Random(24);
        for _ in 0..3000 {
            let l = limits(&mut random);
            let start = Motion { p: 0.0, v: random.within(-3.0, 3.0) * l.velocity, a: random.within(-3.0, 3.0) * l.acceleration };
            let target = random.within(-1000.0, 1000.0);
            let profile = Profile::to_position(start, target, l).expect("plannable");
            let end = profile.at(profile.duration() * (1.0 - 1e-12));
            let mut before = profile.at(0.0);
            let mut farthest = 1.0;
            let dt = profile.duration() / 500.0;
            for i in 1..=500 {
                let now = profile.at(dt * f64::from(i));
                assert!((now.a - before.a).abs() <= l.jerk * dt * (1.0 + 1e-6) + 1e-6);
                before = now;
                farthest = now.p.abs().max(farthest);
            }
            assert!((end.p - target).abs() < 1e-9 * farthest, "{end:?} {target} {start:?} {l:?}");
        }
    }

    #[test]
    fn the_seven_pieces_of_the_reference_are_found() {
        for case in load("scurve.json")["cases"].as_array().expect("cases") {
            let x = |k: &str| case[k].as_f64().expect("a number");
            if case["feasible"] == false {
                continue;
            }
            let l = Limits { velocity: x("vm"), acceleration: x("amax"), deceleration: x("amax"), jerk: x("jmax") };
            let start = Motion { v: x("vs"), ..Motion::default() };
            let profile = Profile::to_position_at(start, x("L"), x("ve"), l).expect("plannable");
            assert!((profile.duration() - x("T")).abs() < 1e-6 * x("T"), "{} {case}", profile.duration());
            let [t, s, v] = ["t", "s", "v"].map(|k| numbers(&case[k]));
            for i in 0..t.len() {
                let now = profile.at(t[i]);
                assert!((now.p - s[i]).abs() < 1e-6 * x("L") && (now.v - v[i]).abs() < 1e-6 * x("vm"), "{i} {now:?} {case}");
            }
        }
    }

    #[test]
    fn nonsense_is_not_planned() {
        let l = Limits { velocity: 10.0, acceleration: 10.0, deceleration: 10.0, jerk: 10.0 };
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(Profile::to_position(Motion::default(), bad, l).is_none());
            assert!(Profile::to_position(Motion { v: bad, ..Motion::default() }, 1.0, l).is_none());
            assert!(Profile::to_velocity(Motion { a: bad, ..Motion::default() }, 1.0, l).is_none());
            assert!(Profile::to_position(Motion::default(), 1.0, Limits { jerk: bad, ..l }).is_none());
        }
        assert!(Profile::to_position(Motion::default(), 1.0, Limits { velocity: 0.0, ..l }).is_none());
        assert!(Profile::to_position(Motion { p: -f64::MAX, ..Motion::default() }, f64::MAX, l).is_none());
        let standing = Profile::to_position(Motion { p: 5.0, ..Motion::default() }, 5.0, l).expect("plannable");
        assert_eq!((standing.duration(), standing.at(0.0).p), (0.0, 5.0));
    }
}
