//! Braking to rest by the axis stage itself, after an error or fault.
//!
//! The velocity falls linearly to 0 in a common time for all axes that stop together, so that the direction of the motion holds.

/// A stop under way: velocity falls linearly from `velocity` to 0 in `duration`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    start: f64,
    velocity: f64,
    duration: f64,
    elapsed: f64,
}

crate::pack::pack_fields!(Ramp { start, velocity, duration, elapsed });

impl Ramp {
    /// From a position (units) and velocity (units/s) to rest in `duration` s.
    pub fn new(start: f64, velocity: f64, duration: f64) -> Self {
        Self { start, velocity, duration: duration.max(0.0), elapsed: 0.0 }
    }
    /// One cycle of `dt` s on: position, velocity, acceleration.
    pub fn advance(&mut self, dt: f64) -> (f64, f64, f64) {
        self.elapsed += dt;
        if self.elapsed >= self.duration {
            return (self.start + 0.5 * self.velocity * self.duration, 0.0, 0.0);
        }
        let (v, d, t) = (self.velocity, self.duration, self.elapsed);
        (self.start + v * t - 0.5 * v / d * t * t, v * (1.0 - t / d), -v / d)
    }
    /// At rest.
    pub fn done(&self) -> bool {
        self.elapsed >= self.duration
    }
}

/// The time in which all axes can stop together: the largest of |v| / d. Pairs of velocity and deceleration.
pub fn common_duration(axes: impl Iterator<Item = (f64, f64)>) -> f64 {
    axes.map(|(v, d)| v.abs() / d).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_that_stop_together_keep_their_direction() {
        let axes = [(300.0, 2000.0), (-20.0, 1000.0), (0.0, 500.0)];
        let duration = common_duration(axes.into_iter());
        assert_eq!(duration, 0.15);
        let mut ramps = axes.map(|(v, _)| Ramp::new(1.0, v, duration));
        let mut last = [1.0; 3];
        while !ramps[0].done() {
            for ((ramp, last), (v, d)) in ramps.iter_mut().zip(&mut last).zip(axes) {
                let (p, now, a) = ramp.advance(1e-3);
                assert!((p - *last).abs() <= v.abs() * 1e-3 + 1e-12 && a.abs() <= d + 1e-9);
                assert!((now * 300.0 - v * ramps_share(now, v) * 300.0).abs() < 1e-9);
                *last = p;
            }
            assert!((((last[1] - 1.0) * 300.0) - (last[0] - 1.0) * -20.0).abs() < 1e-9, "one straight line");
        }
        assert!((last[0] - (1.0 + 300.0 * 0.15 / 2.0)).abs() < 1e-12 && last[2] == 1.0);
    }

    fn ramps_share(now: f64, v: f64) -> f64 {
        if v == 0.0 { 0.0 } else { now / v }
    }
}
