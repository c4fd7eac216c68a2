//! PVT: position, velocity and acceleration from arrays of positions and times, by a spline that may be longer than any array.
//!
//! The block copies knots into a resource of fixed size ([`crate::motion::spline::CAPACITY`]) that its instance owns since the program was loaded: at
//! most `COPIES` per call, and then solves at most `STEPS` rows per call, so that a call stays within its 20 µs. A copied instance owns nothing and
//! refuses to work.

use crate::motion::spline::{KnotError, OVERLAP, Progress, Sample, Spline};
use takt_abi::{Bool, Cx, Fault, OpenArray, Resource, SmcError, function_block};

/// Knots copied per call.
const COPIES: usize = 512;
/// Rows of the equations solved per call.
const STEPS: usize = 1000;
/// How far a repeated knot may be from the one it repeats, relative to its size (absolute below 1).
const REPEATED: f64 = 1e-9;

/// The spline of one PVT instance.
#[derive(Default)]
pub struct PvtSpline(Spline);

impl Resource for PvtSpline {
    fn save(&self) -> Vec<u8> {
        self.0.save()
    }
    fn save_into(&self, out: &mut Vec<u8>) {
        self.0.save_into(out);
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        self.0.restore(bytes)
    }
    fn as_any(&mut self) -> &mut dyn std::any::Any {
        self
    }
}

function_block! {
    /// A smooth curve through positions at times: cubic spline with continuous velocity and acceleration (position, velocity, time).
    ///
    /// **At once.** The rising edge of `bExecute` takes the first `nCount` elements of `Positions` and `Times` (from their lower bounds) and plans; while
    /// `bBusy` is TRUE the arrays must stay as they are. Up to 500 knots it is done in that call; ten thousand take 40 calls. Then `bReady` is TRUE
    /// and every call gives `fPosition`, `fVelocity` and `fAcceleration` at `fTime`, whether `bExecute` is still TRUE or not. `fTime` may run forwards,
    /// stand still, run backwards and jump. Before the first knot and after the last the position is held with velocity 0. `bDone` is TRUE while `fTime`
    /// has reached the last knot. `Times` may be any rising quantity, for instance arc length; velocity and acceleration are then derivatives by it.
    ///
    /// **In windows**, for paths longer than an array:
    ///
    /// 1. First window: rising edge with `bAppend` FALSE and `bEndOfData` FALSE. (`bEndOfData` is TRUE unless it is set: the arrays are the whole path.)
    /// 2. Each further window: rising edge with `bAppend` TRUE. Its first 64 knots repeat the last 64 given so far (all of them, if there were fewer): same
    ///    times, same positions. `nFree` tells how many knots beside the repeated ones there is room for. `bReady` stays TRUE while `bBusy` plans the window.
    /// 3. Last window: the same with `bEndOfData` TRUE; `fEndVelocity` holds at its last knot. It may consist of the 64 repeated knots alone.
    ///
    /// A velocity is final (to 1e-9) when 32 knots after it are known: `fTimeFinal` is the time up to which nothing that comes can change the curve, and a
    /// program keeps `fTime` at or below it (when the next window is late: slows down before it). Between `fTimeFinal` and the last known knot the curve
    /// is smooth but will still change a little; behind the last known knot of an unfinished path the position is held and `bReady` is FALSE.
    ///
    /// Room is for 16384 knots; up to 1024 knots before `fTime` are kept for running backwards, older ones make room for new ones.
    ///
    /// **Errors** (`bError` until `bExecute` is FALSE, at least one call; a refused window leaves the path as it was, a refused start leaves none):
    /// PVT_TOO_FEW_POINTS (fewer than 2, or nothing beside the repeated ones, or an array is shorter than `nCount`), PVT_TIMES_NOT_RISING,
    /// PVT_INVALID_VALUES (not finite, or a window does not repeat the knots before it), PVT_NO_ROOM (more knots than `nFree`; a copied instance),
    /// PVT_NOT_READY (a window was given while another is being planned).
    pub block PVT as Pvt resource PvtSpline {
        input {
            /// Rising edge: take the arrays.
            bExecute: Bool,
            /// Number of knots in the arrays.
            nCount: u32,
            /// Velocity at the first knot of the path.
            fStartVelocity: f64,
            /// Velocity at the last knot of the path.
            fEndVelocity: f64,
            /// Where to evaluate, s.
            fTime: f64,
            /// The arrays are the next window of the path.
            bAppend: Bool,
            /// The arrays end the path.
            bEndOfData: Bool = Bool::TRUE,
        }
        output {
            /// The outputs below are those at `fTime`.
            bReady: Bool,
            /// Knots are being planned.
            bBusy: Bool,
            /// `fTime` has reached the end of the path.
            bDone: Bool,
            /// The arrays or `fTime` were refused.
            bError: Bool,
            /// Why.
            ErrorID: SmcError,
            /// Position at `fTime`.
            fPosition: f64,
            /// Velocity at `fTime`, per second.
            fVelocity: f64,
            /// Acceleration at `fTime`, per second squared.
            fAcceleration: f64,
            /// Knots that may still come.
            nFree: u32,
            /// Time up to which the curve is final.
            fTimeFinal: f64,
            /// Time of the last knot that is planned.
            fTimeLast: f64,
        }
        open {
            /// Positions of the knots.
            Positions: f64,
            /// Times of the knots, rising, s.
            Times: f64,
        }
        state {
            /// `bExecute` at the last call.
            last: Bool,
            /// A window is being planned.
            planning: Bool,
            /// Knots of the window: all, and those copied so far.
            count: u32,
            copied: u32,
            /// It ends the path.
            ends: Bool,
            /// Slope at the path's end.
            end_slope: f64,
            /// Why the last window was refused.
            refused: SmcError,
        }
    }
    fn cycle(fb, cx) {
        let rising = fb.bExecute.get() && !fb.last.get();
        fb.last = fb.bExecute;
        if rising || !fb.bExecute.get() {
            fb.refused = SmcError::SMC_NO_ERROR;
        }
        let Some((handle, mut resource)) = cx.own().and_then(|h| Some((h, cx.env.resources.take(h)?))) else {
            fb.refuse_everything(SmcError::PVT_NO_ROOM);
            return Ok(());
        };
        let result = match resource.as_any().downcast_mut::<PvtSpline>() {
            Some(PvtSpline(spline)) => fb.run(spline, rising, cx),
            None => Err(Fault::Panic),
        };
        cx.env.resources.put(handle, resource);
        result
    }
}

impl Pvt {
    fn run(&mut self, spline: &mut Spline, rising: bool, cx: &mut Cx<'_>) -> Result<(), Fault> {
        if rising && let Err(error) = self.accept(spline, cx)? {
            self.refused = error;
        }
        if self.planning.get()
            && let Err(error) = self.plan(spline, cx)?
        {
            (self.planning, self.refused) = (Bool::FALSE, error);
            spline.withdraw();
        }
        self.show(spline);
        Ok(())
    }

    /// Takes the order of a rising edge.
    fn accept(&mut self, spline: &mut Spline, cx: &Cx<'_>) -> Result<Result<(), SmcError>, Fault> {
        let append = self.bAppend.get() && spline.count() > 0;
        if append && self.planning.get() {
            return Ok(Err(SmcError::PVT_NOT_READY));
        }
        if !append {
            spline.clear(self.fStartVelocity);
            self.planning = Bool::FALSE;
        }
        let count = self.nCount as usize;
        let repeated = spline.count().min(OVERLAP) as usize;
        let enough = if append { count > repeated || (count == repeated && self.bEndOfData.get()) } else { count >= 2 };
        if !enough || count > self.Positions.len() || count > self.Times.len() {
            return Ok(Err(SmcError::PVT_TOO_FEW_POINTS));
        }
        if !(self.fStartVelocity.is_finite() && self.fEndVelocity.is_finite()) {
            return Ok(Err(SmcError::PVT_INVALID_VALUES));
        }
        let first = spline.count() - repeated as u64;
        for (i, (t, p)) in self.knots(cx, 0, repeated)?.enumerate() {
            if !spline.knot(first + i as u64).is_some_and(|k| repeats(k.t, t) && repeats(k.p, p)) {
                return Ok(Err(SmcError::PVT_INVALID_VALUES));
            }
        }
        if !spline.reserve(count - repeated) {
            return Ok(Err(SmcError::PVT_NO_ROOM));
        }
        (self.planning, self.count, self.copied) = (Bool::TRUE, self.nCount, repeated as u32);
        (self.ends, self.end_slope) = (self.bEndOfData, self.fEndVelocity);
        Ok(Ok(()))
    }

    /// This call's share of copying and solving.
    fn plan(&mut self, spline: &mut Spline, cx: &mut Cx<'_>) -> Result<Result<(), SmcError>, Fault> {
        let left = self.count.saturating_sub(self.copied) as usize;
        if left > 0 {
            let now = left.min(COPIES);
            *cx.fuel -= now as i64;
            for (t, p) in self.knots(cx, self.copied as usize, now)? {
                spline.push(t, p);
            }
            self.copied += now as u32;
        }
        if self.copied < self.count {
            return Ok(Ok(()));
        }
        *cx.fuel -= STEPS as i64 / 4;
        Ok(match spline.work(STEPS, self.ends.get().then_some(self.end_slope)) {
            Ok(Progress::More) => Ok(()),
            Ok(Progress::Ready) => {
                self.planning = Bool::FALSE;
                Ok(())
            }
            Err(KnotError::NotRising) => Err(SmcError::PVT_TIMES_NOT_RISING),
            Err(KnotError::NotFinite) => Err(SmcError::PVT_INVALID_VALUES),
        })
    }

    /// Times and positions of `count` knots of the caller's arrays.
    fn knots<'c>(&self, cx: &'c Cx<'_>, from: usize, count: usize) -> Result<impl Iterator<Item = (f64, f64)> + use<'c>, Fault> {
        Ok(elements(cx, self.Times, from, count)?.zip(elements(cx, self.Positions, from, count)?))
    }

    /// Evaluates and writes the outputs.
    fn show(&mut self, spline: &mut Spline) {
        let ready = spline.is_ready();
        let (_, end) = spline.span();
        let in_time = self.fTime.is_finite();
        if ready && in_time {
            Sample { p: self.fPosition, v: self.fVelocity, a: self.fAcceleration } = spline.sample(self.fTime);
        } else {
            (self.fVelocity, self.fAcceleration) = (0.0, 0.0);
        }
        let error = if in_time { self.refused } else { SmcError::PVT_INVALID_VALUES };
        self.bReady = (ready && in_time && (spline.is_ended() || self.fTime <= end)).into();
        self.bDone = (ready && in_time && spline.is_ended() && self.fTime >= end && !self.planning.get()).into();
        self.bBusy = self.planning;
        self.bError = (error != SmcError::SMC_NO_ERROR).into();
        self.ErrorID = error;
        self.nFree = spline.free() as u32;
        self.fTimeFinal = spline.final_until();
        self.fTimeLast = end;
    }

    fn refuse_everything(&mut self, error: SmcError) {
        (self.bReady, self.bBusy, self.bDone, self.bError) = (Bool::FALSE, Bool::FALSE, Bool::FALSE, Bool::TRUE);
        (self.ErrorID, self.fVelocity, self.fAcceleration, self.nFree) = (error, 0.0, 0.0, 0);
    }
}

fn repeats(known: f64, given: f64) -> bool {
    (known - given).abs() <= REPEATED * known.abs().max(1.0)
}

/// `count` elements of an array of the caller.
fn elements<'c>(cx: &'c Cx<'_>, array: OpenArray<f64>, from: usize, count: usize) -> Result<impl Iterator<Item = f64> + use<'c>, Fault> {
    if array.offset == 0 {
        return Err(Fault::NullPointer);
    }
    if from + count > array.len() {
        return Err(Fault::Index { value: array.low.saturating_add_unsigned((from + count) as u64), low: array.low, high: array.high });
    }
    let offset = array.offset.saturating_add((from * size_of::<f64>()) as u64);
    let bytes = cx.bytes(offset, count * size_of::<f64>())?;
    Ok(bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bench::{Bench, open};
    use crate::motion::oracle::{load, numbers};

    /// Image: the instance at 16, times at 4096, positions behind them.
    struct Rig {
        bench: Bench,
        fb: Pvt,
    }
    const THIS: u64 = 16;
    const TIMES: u64 = 4096;
    const ROOM: usize = 20_000;

    impl Rig {
        fn new() -> Self {
            let mut bench = Bench::new(TIMES as usize + 2 * 8 * ROOM);
            bench.env.resources.add(THIS, Box::<PvtSpline>::default());
            let (times, positions) = (open(TIMES, ROOM), open(TIMES + 8 * ROOM as u64, ROOM));
            Self { bench, fb: Pvt { Times: times, Positions: positions, ..Pvt::default() } }
        }
        fn call(&mut self) {
            self.bench.call(THIS, |cx| self.fb.cycle(cx)).expect("no fault");
        }
        fn edge(&mut self, t: &[f64], p: &[f64]) {
            self.fb.bExecute = Bool::FALSE;
            self.call();
            for i in 0..t.len() {
                self.bench.put(TIMES + 8 * i as u64, t[i]);
                self.bench.put(TIMES + 8 * (ROOM + i) as u64, p[i]);
            }
            self.fb.nCount = t.len() as u32;
            self.fb.bExecute = Bool::TRUE;
            self.call();
        }
        fn wait(&mut self) {
            while self.fb.bBusy.get() {
                self.call();
            }
        }
        fn at(&mut self, t: f64) -> (f64, f64, f64) {
            self.fb.fTime = t;
            self.call();
            (self.fb.fPosition, self.fb.fVelocity, self.fb.fAcceleration)
        }
    }
    fn path(n: usize) -> (Vec<f64>, Vec<f64>) {
        (0..n).map(|i| (0.02 * i as f64 + 0.005 * libm::sin(i as f64), 10.0 * libm::sin(i as f64 * 0.03))).unzip()
    }

    #[test]
    fn it_gives_the_reference_values() {
        for case in load("pvt.json")["cases"].as_array().expect("cases") {
            let [t, p, x, pos] = ["t", "p", "x", "pos"].map(|k| numbers(&case[k]));
            let mut rig = Rig::new();
            (rig.fb.fStartVelocity, rig.fb.fEndVelocity) = (case["v0"].as_f64().expect("v0"), case["vn"].as_f64().expect("vn"));
            rig.edge(&t, &p);
            assert!(rig.fb.bReady.get() && !rig.fb.bBusy.get() && !rig.fb.bError.get());
            let scale = pos.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (x, pos) in x.iter().zip(pos) {
                assert!((rig.at(*x).0 - pos).abs() <= 1e-9 * scale);
            }
            assert!(!rig.fb.bDone.get() || rig.fb.fTime >= t[t.len() - 1]);
            rig.at(t[t.len() - 1] + 1.0);
            assert!(rig.fb.bDone.get() && rig.fb.bReady.get() && rig.fb.fPosition == p[p.len() - 1] && rig.fb.fVelocity == 0.0);
        }
    }

    #[test]
    fn windows_join_without_a_seam() {
        let (t, p) = path(3000);
        let mut once = Rig::new();
        once.edge(&t, &p);
        once.wait();
        let mut grown = Rig::new();
        grown.fb.bEndOfData = Bool::FALSE;
        grown.edge(&t[..700], &p[..700]);
        grown.wait();
        assert!(grown.fb.bReady.get() && !grown.fb.bDone.get() && grown.fb.fTimeFinal == t[699 - 32]);
        let (mut given, mut now) = (700, 0.0);
        loop {
            while now <= grown.fb.fTimeFinal {
                let (a, b) = (grown.at(now), once.at(now));
                assert!((a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-7, "{now}");
                now += 0.004;
            }
            if given == 3000 {
                break;
            }
            let next = (given + 900).min(3000);
            (grown.fb.bAppend, grown.fb.bEndOfData) = (Bool::TRUE, (next == 3000).into());
            grown.edge(&t[given - 64..next], &p[given - 64..next]);
            assert!(grown.fb.bReady.get() && grown.fb.bBusy.get() && !grown.fb.bError.get());
            grown.wait();
            given = next;
        }
        grown.at(t[2999]);
        assert!(grown.fb.bDone.get());
    }

    #[test]
    fn an_unfinished_path_is_held_behind_its_last_knot() {
        let (t, p) = path(200);
        let mut rig = Rig::new();
        rig.fb.bEndOfData = Bool::FALSE;
        rig.edge(&t, &p);
        rig.wait();
        assert_eq!(rig.at(t[199] + 0.1), (p[199], 0.0, 0.0));
        assert!(!rig.fb.bReady.get() && !rig.fb.bDone.get());
        (rig.fb.bAppend, rig.fb.bEndOfData) = (Bool::TRUE, Bool::TRUE);
        rig.edge(&t[136..], &p[136..]);
        rig.wait();
        assert!(rig.fb.bReady.get() && rig.fb.bDone.get() && !rig.fb.bError.get(), "the repeated knots alone may end the path");
    }

    #[test]
    fn a_large_path_is_planned_in_steps() {
        let (t, p) = path(16_384);
        let mut rig = Rig::new();
        rig.edge(&t, &p);
        let mut calls = 1;
        while rig.fb.bBusy.get() {
            assert!(!rig.fb.bReady.get());
            rig.call();
            calls += 1;
        }
        assert!(rig.fb.bReady.get() && calls > 30 && rig.fb.nFree == 0);
        assert!((rig.at(100.0).0 - 10.0 * libm::sin(100.0 / 0.02 * 0.03)).abs() < 0.5);
        rig.at(t[16_000]);
        assert_eq!(rig.fb.nFree, 16_000 - 1024);
    }

    #[test]
    fn what_is_wrong_is_refused_with_its_number() {
        let (t, p) = path(100);
        let refused = |t: &[f64], p: &[f64]| {
            let mut rig = Rig::new();
            rig.edge(t, p);
            rig.wait();
            assert!(rig.fb.bError.get() && !rig.fb.bReady.get());
            let id = rig.fb.ErrorID;
            rig.fb.bExecute = Bool::FALSE;
            rig.call();
            assert!(!rig.fb.bError.get(), "the error goes with bExecute");
            id
        };
        let with = |i: usize, x: f64| {
            let mut t = t.clone();
            t[i] = x;
            t
        };
        assert_eq!(refused(&t[..1], &p[..1]), SmcError::PVT_TOO_FEW_POINTS);
        assert_eq!(refused(&[], &[]), SmcError::PVT_TOO_FEW_POINTS);
        assert_eq!(refused(&with(50, t[49]), &p), SmcError::PVT_TIMES_NOT_RISING);
        assert_eq!(refused(&with(99, f64::INFINITY), &p), SmcError::PVT_INVALID_VALUES);
        assert_eq!(refused(&t, &with(99, f64::NAN)), SmcError::PVT_INVALID_VALUES);
        let (long_t, long_p) = path(16_385);
        assert_eq!(refused(&long_t, &long_p), SmcError::PVT_NO_ROOM);
    }

    #[test]
    fn a_window_that_does_not_repeat_is_refused_and_the_path_stays() {
        let (t, p) = path(400);
        let mut rig = Rig::new();
        rig.fb.bEndOfData = Bool::FALSE;
        rig.edge(&t[..200], &p[..200]);
        let before = rig.at(t[100]);
        rig.fb.bAppend = Bool::TRUE;
        rig.edge(&t[137..300], &p[137..300]);
        assert!(rig.fb.bError.get() && rig.fb.bReady.get());
        assert_eq!(rig.fb.ErrorID, SmcError::PVT_INVALID_VALUES);
        assert_eq!(rig.at(t[100]), before);
        rig.fb.fTime = f64::NAN;
        rig.call();
        assert!(rig.fb.bError.get() && !rig.fb.bReady.get());
    }

    #[test]
    fn a_copied_instance_and_a_wild_array_do_no_harm() {
        let mut rig = Rig::new();
        let mut copy = rig.fb;
        rig.bench.call(64, |cx| copy.cycle(cx)).expect("no fault");
        assert!(copy.bError.get() && copy.ErrorID == SmcError::PVT_NO_ROOM);
        rig.fb.Times = open(0, 10);
        (rig.fb.nCount, rig.fb.bExecute) = (5, Bool::TRUE);
        let fault = rig.bench.call(THIS, |cx| rig.fb.cycle(cx));
        assert_eq!(fault, Err(Fault::NullPointer));
        rig.fb.Times = open(u64::MAX - 8, 10);
        rig.fb.last = Bool::FALSE;
        let fault = rig.bench.call(THIS, |cx| rig.fb.cycle(cx));
        assert!(matches!(fault, Err(Fault::WildPointer { .. })));
        rig.fb.last = Bool::TRUE;
        rig.call();
    }
}
