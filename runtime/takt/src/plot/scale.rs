//! From values to pixels, with ticks at round numbers.

/// A linear scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// `low` lies at pixel `from`, `high` at `to`.
    pub(super) fn new(low: f64, high: f64, from: f64, to: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Self { low, high, from, to }
    }
    pub(super) fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }
    /// Round numbers inside, about `count` of them, with their labels.
    pub(super) fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        ticks(self.low, self.high, count)
    }
}

/// Round numbers from `low` to `high`, about `count` of them: 1, 2 or 5 times a power of ten apart.
pub(super) fn ticks(low: f64, high: f64, count: f64) -> Vec<(f64, String)> {
    let rough = (high - low) / count.max(1.0);
    if !rough.is_finite() || rough <= 0.0 {
        return Vec::new();
    }
    let (mut step, mut digits) = (1e9, 0usize);
    'search: for power in -6..10i32 {
        for factor in [1.0, 2.0, 5.0] {
            let candidate = factor * power_of_ten(power);
            if candidate >= rough {
                (step, digits) = (candidate, (-power).max(0) as usize);
                break 'search;
            }
        }
    }
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last.min(first + 100)).map(|i| (i as f64 * step, format!("{:.digits$}", i as f64 * step))).collect()
}

fn power_of_ten(power: i32) -> f64 {
    (0..power.unsigned_abs()).fold(1.0, |value, _| if power < 0 { value / 10.0 } else { value * 10.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let labels = |low, high, n| ticks(low, high, n).into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 20.0, 5.0), ["0", "5", "10", "15", "20"]);
        assert_eq!(labels(0.0, 0.9, 4.0), ["0.0", "0.5"]);
        assert_eq!(labels(-76.0, 83.0, 4.0), ["-50", "0", "50"]);
        assert!(labels(0.0, f64::NAN, 4.0).is_empty() && labels(1.0, 1.0, 4.0).is_empty());
    }
}
