//! Times of a task, in buckets that are there from the start.
//!
//! A bucket is a sixteenth of a power of two wide, so a percentile is right to 6 %; the maximum and the mean are exact. Recording allocates nothing.

/// Buckets for each power of two, and its power.
const PARTS: u64 = 16;
const POWER: u32 = 4;
const BUCKETS: usize = 38 * PARTS as usize;

/// Times in nanoseconds.
#[derive(Debug, Clone)]
pub struct Histogram {
    buckets: [u64; BUCKETS],
    count: u64,
    sum: u128,
    max: u64,
    min: u64,
    last: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { buckets: [0; BUCKETS], count: 0, sum: 0, max: 0, min: u64::MAX, last: 0 }
    }
}

fn bucket(ns: u64) -> usize {
    if ns < PARTS {
        return ns as usize;
    }
    let power = ns.ilog2();
    let part = ns >> (power - POWER) & (PARTS - 1);
    ((u64::from(power - POWER + 1) * PARTS + part) as usize).min(BUCKETS - 1)
}

/// First value behind the bucket.
fn end(bucket: usize) -> u64 {
    let bucket = bucket as u64;
    if bucket < PARTS {
        return bucket + 1;
    }
    let (shift, part) = (bucket / PARTS - 1, bucket % PARTS);
    (PARTS + part + 1) << shift
}

impl Histogram {
    /// Adds one time.
    pub fn add(&mut self, ns: u64) {
        self.buckets[bucket(ns)] += 1;
        self.count += 1;
        self.sum += u128::from(ns);
        self.max = self.max.max(ns);
        self.min = self.min.min(ns);
        self.last = ns;
    }
    /// How many.
    pub fn count(&self) -> u64 {
        self.count
    }
    /// The mean, ns; 0 if there is none.
    pub fn mean(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum as f64 / self.count as f64 }
    }
    /// The longest, ns.
    pub fn max(&self) -> u64 {
        self.max
    }
    /// The shortest, ns; 0 if there is none.
    pub fn min(&self) -> u64 {
        if self.count == 0 { 0 } else { self.min }
    }
    /// The last, ns; 0 if there is none.
    pub fn last(&self) -> u64 {
        self.last
    }
    /// The time that a share `q` (0..1) of all did not exceed, ns; never more than the maximum.
    pub fn percentile(&self, q: f64) -> u64 {
        let rank = ((self.count as f64 * q).ceil() as u64).clamp(1, self.count.max(1));
        let mut seen = 0;
        for (i, n) in self.buckets.iter().enumerate() {
            seen += n;
            if seen >= rank {
                return (end(i) - 1).min(self.max);
            }
        }
        self.max
    }
}

/// What is known of a task's scans.
#[derive(Debug, Clone, Default)]
pub struct TaskStatistics {
    /// Scans started since the program was loaded; [`crate::Engine::reset_statistics`] leaves it, because it numbers the scans.
    pub cycles: u64,
    /// Releases that were missed because the task or a higher one was still running.
    pub overruns: u64,
    /// Scans that a higher task interrupted.
    pub preempted: u64,
    /// Most fuel that one scan took.
    pub fuel_max: u64,
    /// Execution times of the scans, without those of tasks that interrupted; the bus task's with axis stage and exchange. Empty without a stopwatch.
    pub scan_ns: Histogram,
    /// From release to start of the scans. Empty in virtual time.
    pub jitter_ns: Histogram,
}

impl TaskStatistics {
    /// Starts anew, but for the number of the scan.
    pub(crate) fn reset(&mut self) {
        *self = Self { cycles: self.cycles, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_join_without_a_gap() {
        for b in 0..BUCKETS - 1 {
            assert_eq!((bucket(end(b) - 1), bucket(end(b))), (b, b + 1), "bucket {b}");
        }
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
    }

    #[test]
    fn percentiles_are_right_to_a_sixteenth_octave() {
        let mut h = Histogram::default();
        for ns in 1..=10_000 {
            h.add(ns);
        }
        let near = |q: f64, expected: f64| assert!((h.percentile(q) as f64 / expected - 1.0).abs() < 0.07, "{q}: {}", h.percentile(q));
        near(0.5, 5000.0);
        near(0.99, 9900.0);
        assert_eq!((h.max(), h.percentile(1.0), h.mean()), (10_000, 10_000, 5000.5));
        assert_eq!((h.min(), h.last(), Histogram::default().min()), (1, 10_000, 0));
        assert_eq!(Histogram::default().percentile(0.5), 0);
    }
}
