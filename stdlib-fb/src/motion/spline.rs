//! The cubic spline of the PVT block: knots (t, p), slopes such that the second derivative is continuous, ends with given slopes.
//!
//! Knots arrive in order and may go on arriving while the spline is already followed. The tridiagonal equations are eliminated forwards as knots
//! come; only the backward half depends on what is still to come, and what a knot ahead changes fades by at least one half per knot between (usually
//! to 27 %). So a slope that has [`FADE`] knots after it is final to better than 1e-9 of the slopes' size, whatever follows.
//!
//! Source: Xu, Han (the five-axis dispenser's paper), equations (6)-(11), with `b_j = h_{j-1} / (h_{j-1} + h_j) = 1 - a_j` (the printed `b_j` does
//! not give a continuous second derivative), and the right-hand side of (11) completed by `a_1 v_0` and `b_{n-1} v_n`.
//!
//! Memory is taken once, when the spline is made; nothing here allocates afterwards. Old knots are given up only when room is asked for.

/// Knots a spline holds at the most.
pub const CAPACITY: usize = 16_384;
/// Knots behind the place last evaluated that are kept, so that the abscissa may run backwards (pause, resume).
pub const HISTORY: u64 = 1024;
/// Knots behind a slope after which it is final.
pub const FADE: u64 = 32;
/// Knots by which the windows of a long path overlap.
pub const OVERLAP: u64 = 64;

const MASK: u64 = CAPACITY as u64 - 1;

/// A knot and what the equations say about it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Knot {
    /// Abscissa: time, s, or any other rising quantity.
    pub t: f64,
    /// Value.
    pub p: f64,
    /// Slope, once solved.
    pub v: f64,
    /// Forward elimination: `v_j = rest - lead * v_{j+1}`.
    lead: f64,
    rest: f64,
}

/// Value, slope and second derivative at a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Value.
    pub p: f64,
    /// First derivative.
    pub v: f64,
    /// Second derivative.
    pub a: f64,
}

/// Why a knot is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnotError {
    /// Its abscissa is not above that of the one before.
    NotRising,
    /// It is not finite, or so near or far that a slope is not.
    NotFinite,
}

/// A spline that grows at its end and is forgotten at its start.
#[derive(Debug, Clone)]
pub struct Spline {
    /// `CAPACITY` places; knot `i` stands in place `i & MASK`.
    ring: Box<[Knot]>,
    /// Number of the first knot that is kept.
    first: u64,
    /// Number behind the last knot that stands in the ring.
    filled: u64,
    /// Number behind the last knot whose row is eliminated.
    eliminated: u64,
    /// Number behind the last knot that has a slope: knots before may be evaluated.
    solved: u64,
    /// Slope at the first knot.
    start_slope: f64,
    /// Where the backward pass stands: knots from here on have their new slopes. `u64::MAX`: it is not under way.
    back: u64,
    /// The last knot is the end of the path.
    ended: bool,
    /// The segment evaluated last starts at this knot.
    segment: u64,
}

impl Default for Spline {
    fn default() -> Self {
        let ring = vec![Knot::default(); CAPACITY].into_boxed_slice();
        Self { ring, first: 0, filled: 0, eliminated: 0, solved: 0, start_slope: 0.0, back: u64::MAX, ended: false, segment: 0 }
    }
}

/// How far a step of [`Spline::work`] came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Call again.
    More,
    /// All knots have slopes.
    Ready,
}

impl Spline {
    /// Forgets everything; the next knots begin a path with this slope at its first knot.
    pub fn clear(&mut self, start_slope: f64) {
        (self.first, self.filled, self.eliminated, self.solved, self.segment) = (0, 0, 0, 0, 0);
        (self.start_slope, self.back, self.ended) = (start_slope, u64::MAX, false);
    }
    /// Knots since the path began, those already forgotten among them.
    pub fn count(&self) -> u64 {
        self.filled
    }
    /// Knots that can still be added.
    pub fn free(&self) -> usize {
        let keep = self.segment.saturating_sub(HISTORY).max(self.first);
        CAPACITY - (self.filled - keep) as usize
    }
    /// The `i`-th knot since the path began, if it is kept.
    pub fn knot(&self, i: u64) -> Option<&Knot> {
        (self.first..self.filled).contains(&i).then(|| self.at(i))
    }
    fn at(&self, i: u64) -> &Knot {
        &self.ring[(i & MASK) as usize]
    }
    fn at_mut(&mut self, i: u64) -> &mut Knot {
        &mut self.ring[(i & MASK) as usize]
    }

    /// Makes room for `knots` more, giving up the oldest where it must; false, and nothing is given up, when that is more than [`Spline::free`].
    pub fn reserve(&mut self, knots: usize) -> bool {
        let fits = knots <= self.free();
        if fits {
            self.first = self.first.max((self.filled + knots as u64).saturating_sub(CAPACITY as u64));
        }
        fits
    }

    /// Adds a knot; it counts after [`Spline::work`]. Without room ([`Spline::reserve`]) it is lost.
    pub fn push(&mut self, t: f64, p: f64) {
        if self.filled - self.first == CAPACITY as u64 {
            return;
        }
        *self.at_mut(self.filled) = Knot { t, p, ..Knot::default() };
        self.filled += 1;
        self.ended = false;
    }

    /// Takes back what was added after the last [`Progress::Ready`].
    pub fn withdraw(&mut self) {
        self.filled = self.solved;
        self.eliminated = self.eliminated.min(self.solved.saturating_sub(1));
        self.back = u64::MAX;
    }

    /// Goes on solving, with at most `steps` knots of work. `end_slope`: the slope at the last knot if the path ends there; `None` while more will come
    /// (the last slopes are then estimates). After an error, [`Spline::withdraw`].
    pub fn work(&mut self, steps: usize, end_slope: Option<f64>) -> Result<Progress, KnotError> {
        let mut left = steps;
        while left > 0 && self.eliminated + 1 < self.filled {
            self.eliminate()?;
            left -= 1;
        }
        if self.eliminated + 1 < self.filled {
            return Ok(Progress::More);
        }
        if self.back == u64::MAX {
            self.start_back(end_slope)?;
        }
        // Slopes that the new knots no longer change stay: older ones than OVERLAP before the first new knot.
        let stop = self.solved.saturating_sub(OVERLAP).max(self.first);
        while left > 0 && self.back > stop {
            self.back -= 1;
            let next = self.at(self.back + 1).v;
            let knot = self.at_mut(self.back);
            knot.v = knot.rest - knot.lead * next;
            left -= 1;
        }
        if self.back > stop {
            return Ok(Progress::More);
        }
        (self.solved, self.back, self.ended) = (self.filled, u64::MAX, end_slope.is_some());
        Ok(Progress::Ready)
    }

    /// Eliminates the row of the next knot, which has a neighbour on its right.
    fn eliminate(&mut self) -> Result<(), KnotError> {
        let j = self.eliminated;
        let (here, next) = (*self.at(j), *self.at(j + 1));
        let h = step(&here, &next)?;
        let (lead, rest) = if j == 0 {
            (0.0, self.start_slope)
        } else {
            let before = *self.at(j - 1);
            let h_before = step(&before, &here)?;
            let a = h / (h_before + h);
            let b = 1.0 - a;
            let c = 3.0 * (a * ((here.p - before.p) / h_before) + b * ((next.p - here.p) / h));
            let pivot = 2.0 - a * before.lead;
            (b / pivot, (c - a * before.rest) / pivot)
        };
        if !rest.is_finite() {
            return Err(KnotError::NotFinite);
        }
        let knot = self.at_mut(j);
        (knot.lead, knot.rest) = (lead, rest);
        self.eliminated += 1;
        Ok(())
    }

    /// Gives the last knot its slope.
    fn start_back(&mut self, end_slope: Option<f64>) -> Result<(), KnotError> {
        let last = self.filled.checked_sub(1).ok_or(KnotError::NotFinite)?;
        let v = end_slope.unwrap_or_else(|| self.guess(last));
        if !(v.is_finite() && self.at(last).t.is_finite() && self.at(last).p.is_finite()) {
            return Err(KnotError::NotFinite);
        }
        self.at_mut(last).v = v;
        self.back = last;
        Ok(())
    }

    /// The slope at the last knot of the parabola through the last three.
    fn guess(&self, last: u64) -> f64 {
        if last < self.first + 2 {
            return self.start_slope;
        }
        let (k0, k1, k2) = (self.at(last - 2), self.at(last - 1), self.at(last));
        let (h0, h1) = (k1.t - k0.t, k2.t - k1.t);
        let (d0, d1) = ((k1.p - k0.p) / h0, (k2.p - k1.p) / h1);
        d1 + (d1 - d0) * h1 / (h0 + h1)
    }

    /// Whether the spline can be evaluated.
    pub fn is_ready(&self) -> bool {
        self.solved > self.first
    }
    /// Whether the last knot is the end of the path.
    pub fn is_ended(&self) -> bool {
        self.ended
    }
    /// The abscissae of the first and last knot that can be evaluated; zeros when there is none.
    pub fn span(&self) -> (f64, f64) {
        if self.is_ready() { (self.at(self.first).t, self.at(self.solved - 1).t) } else { (0.0, 0.0) }
    }
    /// The abscissa up to which no knot that is still to come changes anything (by more than 1e-9).
    pub fn final_until(&self) -> f64 {
        if !self.is_ready() {
            return 0.0;
        }
        let last = self.solved - 1;
        let i = if self.ended { last } else { last.saturating_sub(FADE).max(self.first) };
        self.at(i).t
    }

    /// Evaluates at `t`; before the first and behind the last knot the value is held. Amortised O(1) while `t` moves a little, O(log n) else.
    pub fn sample(&mut self, t: f64) -> Sample {
        if !self.is_ready() {
            return Sample::default();
        }
        let (start, end) = self.span();
        if t <= start || t >= end {
            let edge = if t <= start { self.first } else { self.solved - 1 };
            self.segment = edge.min(self.solved.saturating_sub(2)).max(self.first);
            return if t == start || t == end { self.at_knot(edge) } else { Sample { p: self.at(edge).p, ..Sample::default() } };
        }
        self.segment = self.find(t);
        hermite(self.at(self.segment), self.at(self.segment + 1), t)
    }

    fn at_knot(&self, i: u64) -> Sample {
        let knot = self.at(i);
        if i + 1 < self.solved {
            hermite(knot, self.at(i + 1), knot.t)
        } else if i > self.first {
            Sample { p: knot.p, v: knot.v, ..hermite(self.at(i - 1), knot, knot.t) }
        } else {
            Sample { p: knot.p, v: knot.v, a: 0.0 }
        }
    }

    /// The segment that holds `t`, which lies between the first and the last solved knot.
    fn find(&self, t: f64) -> u64 {
        let mut i = self.segment.clamp(self.first, self.solved - 2);
        for _ in 0..4 {
            if t < self.at(i).t {
                i -= 1;
            } else if t >= self.at(i + 1).t {
                i += 1;
            } else {
                return i;
            }
        }
        let (mut low, mut high) = (self.first, self.solved - 1);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if t < self.at(middle).t {
                high = middle;
            } else {
                low = middle;
            }
        }
        low
    }

    /// Everything, as bytes.
    pub fn save(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.save_into(&mut bytes);
        bytes
    }

    /// The same, appended.
    pub fn save_into(&self, out: &mut Vec<u8>) {
        let ended = u64::from(self.ended);
        let head = [self.first, self.filled, self.eliminated, self.solved, self.back, ended, self.segment, self.start_slope.to_bits()];
        head.iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
        for i in self.first..self.filled {
            let k = self.at(i);
            [k.t, k.p, k.v, k.lead, k.rest].iter().for_each(|value| out.extend_from_slice(&value.to_bits().to_le_bytes()));
        }
    }

    /// Takes what [`Spline::save`] wrote; false, and as new, when it is not that.
    pub fn restore(&mut self, bytes: &[u8]) -> bool {
        self.clear(0.0);
        let words: Vec<u64> = bytes.chunks_exact(8).map(|c| u64::from_le_bytes(c.try_into().unwrap_or_default())).collect();
        let Some((&[first, filled, eliminated, solved, back, ended, segment, slope], knots)) = words.split_first_chunk::<8>() else {
            return false;
        };
        let orderly = first <= solved && solved <= filled && eliminated <= filled && first <= segment && segment <= filled && ended <= 1;
        let going_back = back == u64::MAX || (first..filled).contains(&back);
        if !orderly
            || !going_back
            || filled - first > CAPACITY as u64
            || knots.len() as u64 != (filled - first) * 5
            || !bytes.len().is_multiple_of(8)
        {
            return false;
        }
        (self.first, self.filled, self.eliminated, self.solved, self.back) = (first, filled, eliminated, solved, back);
        (self.ended, self.segment, self.start_slope) = (ended == 1, segment, f64::from_bits(slope));
        for (i, k) in (first..filled).zip(knots.chunks_exact(5)) {
            let [t, p, v, lead, rest] = std::array::from_fn(|n| f64::from_bits(k[n]));
            *self.at_mut(i) = Knot { t, p, v, lead, rest };
        }
        true
    }
}

/// The step between two knots.
fn step(before: &Knot, here: &Knot) -> Result<f64, KnotError> {
    if !(before.t.is_finite() && here.t.is_finite() && before.p.is_finite() && here.p.is_finite()) {
        return Err(KnotError::NotFinite);
    }
    let h = here.t - before.t;
    if h > 0.0 { Ok(h) } else { Err(KnotError::NotRising) }
}

/// Cubic Hermite interpolation, equation (8), in powers of the distance from the left knot.
fn hermite(left: &Knot, right: &Knot, t: f64) -> Sample {
    let h = right.t - left.t;
    let x = t - left.t;
    let chord = (right.p - left.p) / h;
    let c2 = (3.0 * chord - 2.0 * left.v - right.v) / h;
    let c3 = (left.v + right.v - 2.0 * chord) / (h * h);
    Sample { p: left.p + x * (left.v + x * (c2 + x * c3)), v: left.v + x * (2.0 * c2 + x * 3.0 * c3), a: 2.0 * c2 + x * 6.0 * c3 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::oracle::{Random, load, numbers};

    fn whole(t: &[f64], p: &[f64], v0: f64, vn: f64) -> Spline {
        let mut s = Spline::default();
        s.clear(v0);
        t.iter().zip(p).for_each(|(t, p)| s.push(*t, *p));
        while s.work(1000, Some(vn)).expect("good knots") == Progress::More {}
        s
    }
    fn path(n: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut random = Random(seed);
        let (mut time, mut place) = (3.0, 0.0);
        let knots = (0..n).map(|_| {
            time += random.within(0.005, 0.05);
            place += random.within(-0.5, 1.0);
            (time, place)
        });
        knots.unzip()
    }
    fn close(a: f64, b: f64, scale: f64) -> bool {
        (a - b).abs() <= 1e-9 * scale.max(1.0)
    }

    #[test]
    fn it_matches_the_reference_splines() {
        for case in load("pvt.json")["cases"].as_array().expect("cases") {
            let [t, p, v, x] = ["t", "p", "v", "x"].map(|k| numbers(&case[k]));
            let mut s = whole(&t, &p, case["v0"].as_f64().expect("v0"), case["vn"].as_f64().expect("vn"));
            let scale = |k: &str| numbers(&case[k]).iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (i, v) in v.iter().enumerate() {
                assert!(close(s.at(i as u64).v, *v, scale("v")));
            }
            let [pos, vel, acc] = ["pos", "vel", "acc"].map(|k| numbers(&case[k]));
            for i in 0..x.len() {
                let got = s.sample(x[i]);
                assert!(
                    close(got.p, pos[i], scale("pos")) && close(got.v, vel[i], scale("vel")) && close(got.a, acc[i], scale("acc")),
                    "{got:?}"
                );
            }
        }
    }

    #[test]
    fn windows_give_the_spline_of_the_whole_path() {
        for seed in 0..20 {
            let (t, p) = path(5000, seed);
            let mut once = whole(&t, &p, 0.3, -0.2);
            let mut random = Random(seed + 100);
            let mut grown = Spline::default();
            grown.clear(0.3);
            let (mut given, mut now) = (0, t[0]);
            while given < t.len() {
                let n = (random.whole(1, 400) as usize).max(if given == 0 { 3 } else { 1 }).min(t.len() - given);
                (given..given + n).for_each(|i| grown.push(t[i], p[i]));
                given += n;
                let end = (given == t.len()).then_some(-0.2);
                while grown.work(random.whole(1, 90) as usize, end).expect("good knots") == Progress::More {
                    let until = grown.final_until();
                    assert!(now > until || near(&mut grown, &mut once, now));
                }
                while now < grown.final_until() {
                    assert!(near(&mut grown, &mut once, now), "{now}");
                    now += 0.004;
                }
            }
            assert!(grown.is_ended() && near(&mut grown, &mut once, t[4999]));
        }
    }
    fn near(a: &mut Spline, b: &mut Spline, t: f64) -> bool {
        let (a, b) = (a.sample(t), b.sample(t));
        (a.p - b.p).abs() < 1e-9 && (a.v - b.v).abs() < 1e-7
    }

    #[test]
    fn the_second_derivative_is_continuous_and_outside_the_value_is_held() {
        let (t, p) = path(300, 5);
        let mut s = whole(&t, &p, 0.0, 0.0);
        for t in &t[1..299] {
            let (left, right) = (s.sample(t - 1e-9), s.sample(t + 1e-9));
            assert!((left.a - right.a).abs() < 1e-3 * left.a.abs().max(1.0), "{left:?} {right:?}");
        }
        assert_eq!(s.sample(t[0] - 5.0), Sample { p: p[0], v: 0.0, a: 0.0 });
        assert_eq!(s.sample(t[299] + 5.0), Sample { p: p[299], v: 0.0, a: 0.0 });
        assert_eq!(s.sample(t[299]).p, p[299]);
    }

    #[test]
    fn time_may_run_backwards_and_jump() {
        let (t, p) = path(3000, 6);
        let mut s = whole(&t, &p, 0.0, 0.0);
        let forth: Vec<_> = (0..9000).map(|i| s.sample(3.0 + f64::from(i) * 0.01)).collect();
        for i in (0..9000).rev() {
            assert_eq!(s.sample(3.0 + f64::from(i) * 0.01), forth[i as usize]);
        }
        let mut random = Random(1);
        for _ in 0..9000 {
            let i = random.whole(0, 8999) as i32;
            assert_eq!(s.sample(3.0 + f64::from(i) * 0.01), forth[i as usize]);
        }
    }

    #[test]
    fn a_long_path_streams_through_and_history_is_kept() {
        let mut s = Spline::default();
        s.clear(0.0);
        let mut given = 0u64;
        let place = |i: u64| libm::sin(i as f64 * 0.05);
        let mut now = 0.0;
        while now < 99_000.0 {
            let room = s.free().min(500) as u64;
            assert!(room > 0 && s.reserve(room as usize));
            (given..given + room).for_each(|i| s.push(i as f64, place(i)));
            given += room;
            while s.work(256, None).expect("good knots") == Progress::More {}
            while now < s.final_until() {
                assert!((s.sample(now).p - libm::sin(now * 0.05)).abs() < 1e-6);
                now += 7.3;
            }
            let back = (now - 1000.0).max(7.3);
            assert!((s.sample(back).p - libm::sin(back * 0.05)).abs() < 1e-6);
            s.sample(now);
        }
    }

    #[test]
    fn bad_knots_are_refused_and_can_be_withdrawn() {
        let (t, p) = path(500, 9);
        let mut s = whole(&t, &p, 0.0, 0.0);
        let before = s.sample(t[400]);
        for (bad_t, bad_p, error) in [
            (t[499], 1.0, KnotError::NotRising),
            (f64::NAN, 1.0, KnotError::NotFinite),
            (1e308, f64::INFINITY, KnotError::NotFinite),
            (t[499] + f64::MIN_POSITIVE, 1.0, KnotError::NotRising),
        ] {
            s.push(t[499] + 0.0, p[499]);
            s.withdraw();
            s.push(bad_t, bad_p);
            s.push(bad_t + 1.0, bad_p);
            assert_eq!(s.work(10_000, Some(0.0)), Err(error));
            s.withdraw();
            assert_eq!(s.count(), 500);
            assert_eq!(s.sample(t[400]), before);
        }
        s.push(t[499] + 0.1, p[499]);
        assert_eq!(s.work(10_000, Some(0.0)), Ok(Progress::Ready));
    }

    #[test]
    fn what_is_saved_can_be_restored_and_nonsense_cannot() {
        let (t, p) = path(500, 10);
        let mut s = whole(&t, &p, 0.0, 0.0);
        let bytes = s.save();
        let mut copy = Spline::default();
        assert!(copy.restore(&bytes));
        assert_eq!(copy.sample(t[77] + 0.001), s.sample(t[77] + 0.001));
        assert!(!copy.restore(&bytes[..bytes.len() - 1]) && !copy.restore(&[]) && !copy.restore(&[255; 64]));
        assert!(!copy.is_ready());
    }
}
