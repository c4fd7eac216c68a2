//! The mechanics of one axis under position control: a second-order system, solved exactly for each bus period.
//!
//! With bandwidth w (rad/s) and damping z: x'' = w² (r - x) + 2 z w (f - x'), r the reference (a straight line within the period), f the velocity
//! feed-forward. Without feed-forward the axis lags behind a steady reference by 2 z v / w, with it by nothing.

/// The axis: position and velocity, technical units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plant {
    pub x: f64,
    pub v: f64,
    w2: f64,
    zw2: f64,
    /// Exact solution over one period for (e, e'), e = x - r.
    phi: [[f64; 2]; 2],
    dt: f64,
}

impl Plant {
    /// At rest at `x`; bandwidth in Hz.
    pub fn new(x: f64, bandwidth: f64, damping: f64, dt: f64) -> Self {
        let w = std::f64::consts::TAU * bandwidth;
        Self { x, v: 0.0, w2: w * w, zw2: 2.0 * damping * w, phi: transition(w, damping, dt), dt }
    }
    /// One period: the reference goes from `from` to `to`.
    pub fn follow(&mut self, from: f64, to: f64, feed_forward: f64) {
        let rate = (to - from) / self.dt;
        // A wrong feed-forward is a constant force: it moves the rest position of e.
        let rest = self.zw2 * (feed_forward - rate) / self.w2;
        let (e, de) = (self.x - from - rest, self.v - rate);
        let [[a, b], [c, d]] = self.phi;
        self.x = a * e + b * de + to + rest;
        self.v = c * e + d * de + rate;
    }
    /// One period without control: friction brakes.
    pub fn coast(&mut self, deceleration: f64) {
        let next = toward(self.v, 0.0, deceleration * self.dt);
        self.x += 0.5 * (self.v + next) * self.dt;
        self.v = next;
    }
    /// Against a mechanical stop.
    pub fn stop_at(&mut self, x: f64) {
        (self.x, self.v) = (x, 0.0);
    }
}

/// `value`, moved to `goal` by at most `step`.
pub(super) fn toward(value: f64, goal: f64, step: f64) -> f64 {
    if (goal - value).abs() <= step { goal } else { value + step.copysign(goal - value) }
}

/// exp(A t) of e'' = -w² e - 2 z w e'.
fn transition(w: f64, z: f64, t: f64) -> [[f64; 2]; 2] {
    let decay = libm::exp(-z * w * t);
    // s = sin(wd t)/wd and c = cos(wd t), with the limits for critical and strong damping.
    let d2 = w * w * (1.0 - z * z);
    let (c, s) = if d2 > 1e-9 * w * w {
        let wd = d2.sqrt();
        (libm::cos(wd * t), libm::sin(wd * t) / wd)
    } else if d2 < -1e-9 * w * w {
        let wd = (-d2).sqrt();
        (libm::cosh(wd * t), libm::sinh(wd * t) / wd)
    } else {
        (1.0, t)
    };
    [[decay * (c + z * w * s), decay * s], [-decay * w * w * s, decay * (c - z * w * s)]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady_lag(feed_forward: bool, z: f64) -> f64 {
        let mut p = Plant::new(0.0, 40.0, z, 1e-3);
        for k in 0..2000 {
            let r = f64::from(k) * 0.02;
            p.follow(r, r + 0.02, if feed_forward { 20.0 } else { 0.0 });
        }
        40.0 - p.x
    }

    #[test]
    fn feed_forward_removes_the_following_error() {
        for z in [0.5, 0.9, 1.0, 2.0] {
            let expected = 2.0 * z * 20.0 / (std::f64::consts::TAU * 40.0);
            assert!((steady_lag(false, z) - expected).abs() < 1e-9, "damping {z}");
            assert!(steady_lag(true, z).abs() < 1e-9);
        }
    }

    #[test]
    fn one_long_period_is_many_short_ones() {
        let (mut long, mut short) = (Plant::new(1.0, 30.0, 0.7, 4e-3), Plant::new(1.0, 30.0, 0.7, 1e-3));
        for _ in 0..50 {
            long.follow(0.0, 0.0, 0.0);
            (0..4).for_each(|_| short.follow(0.0, 0.0, 0.0));
            assert!((long.x - short.x).abs() < 1e-12);
        }
    }
}
