//! For tests: an image and an engine's side for blocks, and the smallest axis stage.

use takt_abi::{AxisRef, AxisState, Bool, Cx, Env, Fault, InOut, NoHost, OpenArray, Plain, Time};

/// An image and what stands beside it.
pub struct Bench {
    /// The image.
    pub image: Vec<u8>,
    /// The engine's side; the running task owns the bus, its period is 1 ms.
    pub env: Env,
}

impl Bench {
    /// An image of so many bytes.
    pub fn new(size: usize) -> Self {
        let env = Env::new(Time::from_millis(1), Box::new(NoHost));
        Self { image: vec![0; size], env }
    }
    /// Calls a body as the instance at `this`.
    pub fn call(&mut self, this: u64, body: impl FnOnce(&mut Cx<'_>) -> Result<(), Fault>) -> Result<(), Fault> {
        let mut fuel = 1_000_000;
        body(&mut Cx::new(&mut self.image, &mut self.env, &mut fuel, this))
    }
    /// Writes a value.
    pub fn put<T: Plain>(&mut self, offset: u64, value: T) {
        value.store(&mut self.image[offset as usize..]);
    }
    /// Reads a value.
    pub fn get<T: Plain>(&self, offset: u64) -> T {
        T::load(&self.image[offset as usize..])
    }
}

/// `ARRAY[*]` at an offset, with indices from 0.
pub fn open<T: Plain>(offset: u64, len: usize) -> OpenArray<T> {
    let mut raw = [0; 24];
    offset.store(&mut raw);
    (len as i64 - 1).store(&mut raw[16..]);
    OpenArray::load(&raw)
}

/// Where the axis of [`AxisBench`] lies.
const PLACE: u64 = 4096;
/// The axis as VAR_IN_OUT.
pub const AXIS: InOut<AxisRef> = InOut(PLACE, std::marker::PhantomData);

/// One axis whose drive does at once what it is told: actual is set, one cycle later.
pub struct AxisBench {
    bench: Bench,
    /// Homing and reset fail.
    pub hopeless: bool,
    /// Cycles of homing still to come.
    searching: u32,
    /// Velocity, acceleration and jerk that the set values must keep, by finite differences.
    limits: Option<[f64; 3]>,
    /// Set position, velocity and acceleration of the last cycle.
    before: Option<(f64, f64, f64)>,
}

impl AxisBench {
    /// An axis without power, with limits 10 000 /s, 100 000 /s², 10 000 000 /s³.
    pub fn off() -> Self {
        let mut bench = Bench::new(PLACE as usize + size_of::<AxisRef>());
        let axis = AxisRef { fSWMaxVelocity: 1e4, nBusCycle: 1, ..AxisRef::default() };
        bench.put(PLACE, axis);
        Self { bench, hopeless: false, searching: 0, limits: None, before: None }
    }
    /// The same in standstill at 0.
    pub fn new() -> Self {
        let mut rig = Self::off();
        rig.change(|a| {
            (a.bRegulatorOn, a.bDriveStart, a.bRegulatorRealState, a.bDriveStartRealState) =
                (Bool::TRUE, Bool::TRUE, Bool::TRUE, Bool::TRUE);
            a.nAxisState = AxisState::standstill;
        });
        rig
    }
    /// The axis.
    pub fn axis(&self) -> AxisRef {
        self.bench.get(PLACE)
    }
    /// Changes the axis.
    pub fn change(&mut self, how: impl FnOnce(&mut AxisRef)) {
        let mut axis = self.axis();
        how(&mut axis);
        self.bench.put(PLACE, axis);
    }
    /// Calls a body as the instance with that number.
    pub fn call(&mut self, number: u64, body: impl FnOnce(&mut Cx<'_>) -> Result<(), Fault>) {
        self.bench.call(number * 64, body).expect("no fault");
    }
    /// Lets the running task be another than the bus task.
    pub fn leave_bus_task(&mut self) {
        self.bench.env.task = 1;
    }
    /// From now on the set values must keep these limits.
    pub fn watch(&mut self, velocity: f64, acceleration: f64, jerk: f64) {
        (self.limits, self.before) = (Some([velocity, acceleration, jerk]), None);
    }
    /// The end of this bus cycle and the start of the next.
    pub fn next(&mut self) {
        let mut axis = self.axis();
        self.check(&axis);
        let powered = axis.bRegulatorOn.get();
        (axis.bRegulatorRealState, axis.bDriveStartRealState) = (axis.bRegulatorOn, (powered && axis.bDriveStart.get()).into());
        axis.nAxisState = match axis.nAxisState {
            _ if !powered => AxisState::power_off,
            AxisState::power_off if axis.bDriveStart.get() => AxisState::standstill,
            state => state,
        };
        self.handshakes(&mut axis);
        let moving = axis.nCommandedBy != 0 && axis.nAxisState != AxisState::errorstop;
        assert!(!moving || axis.nCommandCycle == axis.nBusCycle, "a block commands the axis and was not called");
        (axis.fActPosition, axis.fActVelocity) = (axis.fSetPosition, axis.fSetVelocity);
        axis.nBusCycle += 1;
        self.bench.put(PLACE, axis);
    }
    fn handshakes(&mut self, axis: &mut AxisRef) {
        if axis.byReset == 1 {
            axis.byReset = if self.hopeless { 4 } else { 3 };
            if !self.hopeless {
                (axis.nAxisState, axis.bError, axis.dwErrorID.0) = (AxisState::standstill, Bool::FALSE, 0);
            }
        }
        match axis.byHoming {
            1 => (axis.byHoming, self.searching) = (2, 10),
            2 if self.searching > 0 => self.searching -= 1,
            2 if self.hopeless => (axis.byHoming, axis.nAxisState) = (4, AxisState::errorstop),
            2 => {
                (axis.byHoming, axis.nAxisState, axis.bHomed) = (3, AxisState::standstill, Bool::TRUE);
                axis.fSetPosition = axis.fHomePosition;
            }
            _ => {}
        }
    }
    fn check(&mut self, axis: &AxisRef) {
        let Some([velocity, acceleration, jerk]) = self.limits else { return };
        let p = axis.fSetPosition;
        let Some((p0, v0, a0)) = self.before else {
            self.before = Some((p, axis.fSetVelocity, axis.fSetAcceleration));
            return;
        };
        let mut step = p - p0;
        if axis.iMovementType == 0 {
            step -= axis.fPositionPeriod * (step / axis.fPositionPeriod).round();
        }
        let v = step * 1e3;
        let a = (axis.fSetVelocity - v0) * 1e3;
        let j = (axis.fSetAcceleration - a0) * 1e3;
        let slack = 1.0 + 1e-6;
        assert!(v.abs() <= velocity * slack && axis.fSetVelocity.abs() <= velocity * slack, "velocity {v}, {}", axis.fSetVelocity);
        assert!(a.abs() <= acceleration * slack && axis.fSetAcceleration.abs() <= acceleration * slack, "acceleration {a}");
        assert!(j.abs() <= jerk * slack, "jerk {j}");
        assert!(
            (v - (v0 + axis.fSetVelocity) / 2.0).abs() <= jerk * 1e-6 + 1e-6,
            "position and velocity do not fit: {v} {v0} {}",
            axis.fSetVelocity
        );
        self.before = Some((p, axis.fSetVelocity, axis.fSetAcceleration));
    }
}
