//! The axis stage against a perfect drive: it is where it was told to be, one cycle later.

use super::*;
use crate::bus::BusSize;
use takt_ir::{Place, TypeId};

const DT: f64 = 1e-3;

struct Rig {
    stage: Stage,
    io: ProcessImage,
    image: Vec<u8>,
    cycle: u64,
    drives: Vec<Drive>,
    faulted: bool,
    silent: bool,
}

/// A drive that obeys at once.
#[derive(Clone, Copy, Default)]
struct Drive {
    status: u16,
    position: i64,
    /// The drive does not leave its fault.
    hopeless: bool,
    /// Cycles of homing left.
    homing: u32,
    homing_fails: bool,
    lag: i32,
    last_control: u16,
}

impl Drive {
    fn exchange(&mut self, out: &DriveOut, input: &mut DriveIn) {
        let c = out.control_word;
        let homing_start = out.mode == 6 && c & 0x10 != 0 && self.last_control & 0x10 == 0;
        self.status = match self.status & 0x6F {
            0x08 if c & 0x80 != 0 && self.last_control & 0x80 == 0 && !self.hopeless => 0x40,
            0x08 => 0x08,
            0x27 if c & 0x06 == 0x02 => 0x07,
            0x07 if c & 0x06 == 0x02 => 0x07,
            _ if c & 0x0F == 0x0F => 0x27,
            _ if c & 0x0F == 0x07 => 0x23,
            _ if c & 0x07 == 0x06 => 0x21,
            _ => 0x40,
        };
        if homing_start {
            self.homing = 20;
        }
        let mut status = self.status;
        if out.mode == 6 && self.last_control & 0x10 != 0 {
            self.homing = self.homing.saturating_sub(1);
            if self.homing == 0 {
                status |= if self.homing_fails { 1 << 13 } else { 1 << 12 | 1 << 10 };
                self.position = 0;
            }
        }
        if self.status == 0x27 && out.mode == 8 {
            self.position = out.position;
        }
        self.last_control = c;
        let velocity = ((self.position - input.position) as f64 / DT) as i32;
        *input = DriveIn {
            online: true,
            status_word: status,
            mode_display: out.mode,
            position: self.position,
            velocity,
            following_error: self.lag,
            ..*input
        };
    }
}

fn config(number: u32) -> AxisConfig {
    let mut config = AxisConfig::new("X", Place { offset: 64 + number * 1024, ty: TypeId(0) }, number as usize);
    config.increments_per_unit = 1e4;
    config.limits =
        crate::AxisLimits { negative: -10.0, positive: 10.0, velocity: 100.0, acceleration: 1000.0, deceleration: 2000.0, jerk: 1e5 };
    config
}

impl Rig {
    fn new(configs: Vec<AxisConfig>) -> Self {
        let n = configs.len();
        let mut rig = Self {
            stage: Stage::new(configs, DT),
            io: ProcessImage::new(BusSize { drives: n, ..BusSize::default() }),
            image: vec![0; 64 + 1024 * n],
            cycle: 0,
            drives: vec![Drive { status: 0x40, ..Drive::default() }; n],
            faulted: false,
            silent: false,
        };
        for i in 0..n {
            AxisRef::default().store(&mut rig.image[64 + 1024 * i..]);
        }
        rig.stage.attach(&mut rig.image);
        rig
    }
    /// An axis in standstill.
    fn on(config: AxisConfig) -> Self {
        let mut rig = Self::new(vec![config]);
        rig.run(6, |r, _| (r.bRegulatorOn, r.bDriveStart) = (Bool::TRUE, Bool::TRUE));
        assert_eq!(rig.axis(0).nAxisState, AxisState::standstill);
        rig
    }
    fn axis(&self, i: usize) -> AxisRef {
        AxisRef::load(&self.image[64 + 1024 * i..])
    }
    /// One bus cycle; `act` plays the programs.
    fn cycle(&mut self, mut act: impl FnMut(&mut AxisRef, usize)) {
        self.cycle += 1;
        self.stage.inputs(&mut self.image, &self.io, self.cycle);
        for i in 0..self.drives.len() {
            let mut r = self.axis(i);
            act(&mut r, i);
            r.store(&mut self.image[64 + 1024 * i..]);
        }
        self.stage.outputs(&mut self.image, &mut self.io, self.faulted);
        if !self.silent {
            for ((drive, out), input) in self.drives.iter_mut().zip(&self.io.drives_out).zip(&mut self.io.drives_in) {
                drive.exchange(out, input);
            }
        }
        self.stage.bus_answered(!self.silent);
    }
    fn run(&mut self, n: usize, mut act: impl FnMut(&mut AxisRef, usize)) {
        for _ in 0..n {
            self.cycle(&mut act);
        }
    }
    fn sent(&self, i: usize) -> f64 {
        self.io.drives_out[i].position as f64 / 1e4
    }
    /// Idle cycles until nothing more changes, at most 500; the largest change of position in one.
    fn settle(&mut self, i: usize) -> f64 {
        let mut last = self.sent(i);
        let mut most: f64 = 0.0;
        for _ in 0..500 {
            self.cycle(|_, _| {});
            most = most.max((self.sent(i) - last).abs());
            last = self.sent(i);
        }
        most
    }
}

/// What a block does each cycle.
fn follow(r: &mut AxisRef, by: f64) {
    r.nAxisState = AxisState::synchronized_motion;
    r.nCommandedBy = 99;
    r.nCommandCycle = r.nBusCycle;
    r.fSetPosition += by;
    r.fSetVelocity = by / DT;
}

fn error(r: &AxisRef) -> Option<SmcError> {
    (r.nAxisState == AxisState::errorstop && r.bError.get()).then_some(SmcError(r.dwErrorID.0 as i16))
}

#[test]
fn power_leads_to_standstill_and_off_again_without_error() {
    let mut rig = Rig::on(config(0));
    assert!(rig.axis(0).bRegulatorRealState.get() && rig.axis(0).bDriveStartRealState.get() && rig.axis(0).bCommunication.get());
    assert_eq!((rig.axis(0).fSWMaxVelocity, rig.axis(0).fSWLimitPositive, rig.axis(0).fTaskCycle), (100.0, 10.0, DT));
    rig.run(3, |r, _| follow(r, 0.01));
    rig.cycle(|r, _| r.bRegulatorOn = Bool::FALSE);
    assert_eq!((rig.axis(0).nAxisState, rig.axis(0).nCommandedBy), (AxisState::power_off, 0));
    rig.run(3, |_, _| {});
    assert!(!rig.axis(0).bRegulatorRealState.get() && error(&rig.axis(0)).is_none() && rig.stage.at_rest());
}

#[test]
fn set_values_are_scaled_offset_and_inverted() {
    let mut rig = Rig::on(AxisConfig { invert: true, ..config(0) });
    rig.cycle(|r, _| follow(r, 0.05));
    let out = rig.io.drives_out[0];
    assert_eq!((out.position, out.velocity_offset, out.mode), (-500, -500_000, 8));
    rig.cycle(|r, _| follow(r, 0.0));
    assert_eq!(rig.axis(0).fActPosition, 0.05);
    // MC_SetPosition: the axis is somewhere else now, and does not move.
    rig.cycle(|r, _| {
        follow(r, 1.0);
        r.fSetVelocity = 0.0;
        r.fOffset -= 1.0;
    });
    assert_eq!((rig.io.drives_out[0].position, error(&rig.axis(0))), (-500, None));
    rig.cycle(|r, _| follow(r, 0.0));
    assert!((rig.axis(0).fActPosition - 1.05).abs() < 1e-12);
}

#[test]
fn what_must_not_be_sent_stops_the_axis_on_its_own_ramp() {
    for (wrong, expected) in [
        (|r: &mut AxisRef| r.fSetPosition += 0.2, SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED),
        (|r| r.fSetPosition = f64::NAN, SmcError::SMC_INVALID_POSITION),
        (|r| r.fSetPosition = f64::INFINITY, SmcError::SMC_INVALID_POSITION),
        (|r| r.fSetVelocity = f64::NAN, SmcError::SMC_INVALID_POSITION),
        (|r| r.nCommandCycle -= 1, SmcError::SMC_FB_WASNT_CALLED_DURING_MOTION),
        (|r| r.fOffset = 1e6, SmcError::SMC_VD_MAX_VELOCITY_EXCEEDED),
    ] as [(fn(&mut AxisRef), _); 6]
    {
        let mut rig = Rig::on(config(0));
        rig.run(20, |r, _| follow(r, 0.05));
        let before = rig.sent(0);
        rig.cycle(|r, _| {
            follow(r, 0.05);
            wrong(r);
        });
        assert_eq!(error(&rig.axis(0)), Some(expected));
        assert_eq!(rig.axis(0).nCommandedBy, 0);
        let step = rig.sent(0) - before;
        assert!(step > 0.04 && step < 0.05, "{expected:?}: the first cycle of braking moves {step}");
        assert!(rig.settle(0) < 0.05);
        // v²/2d = 50² / 4000
        assert!((rig.sent(0) - before - 0.625).abs() < 1e-3, "{}", rig.sent(0) - before);
    }
}

#[test]
fn software_limits_hold_outwards_only_and_only_for_an_axis_that_is_homed() {
    let out_by = |homed: bool| {
        let encoder = if homed { Encoder::Absolute } else { Encoder::Incremental };
        let mut rig = Rig::on(AxisConfig { encoder, ..config(0) });
        rig.run(210, |r, _| {
            if r.nAxisState != AxisState::errorstop {
                follow(r, 0.05)
            }
        });
        rig
    };
    assert_eq!(error(&out_by(false).axis(0)), None);
    let mut rig = out_by(true);
    assert_eq!(error(&rig.axis(0)), Some(SmcError::SMC_DI_SWLIMITS_EXCEEDED));
    rig.settle(0);
    assert!(rig.sent(0) > 10.0 && rig.sent(0) < 10.7);
    rig.run(5, |r, _| {
        if r.byReset == 0 {
            r.byReset = 1
        }
    });
    assert_eq!((rig.axis(0).byReset, rig.axis(0).nAxisState, rig.axis(0).bError.get()), (3, AxisState::standstill, false));
    rig.run(10, |r, _| follow(r, -0.05));
    assert_eq!(error(&rig.axis(0)), None, "the way back is free");
}

#[test]
fn lag_warns_then_trips_and_lets_go_of_the_obstacle() {
    let mut rig = Rig::on(AxisConfig { lag: Some(crate::axis::Lag { warn: 0.1, trip: 0.3 }), ..config(0) });
    rig.drives[0].lag = 2000;
    rig.run(2, |r, _| follow(r, 0.01));
    assert!(rig.stage.status().next().unwrap().lag_warning && error(&rig.axis(0)).is_none());
    rig.drives[0].lag = -3001;
    rig.run(2, |r, _| {
        if r.nAxisState != AxisState::errorstop {
            follow(r, 0.01)
        }
    });
    assert_eq!(error(&rig.axis(0)), Some(SmcError::SMC_DI_POSITIONLAGERROR));
}

#[test]
fn quick_stop_goes_through_stopping_to_power_off_and_back() {
    let mut rig = Rig::on(config(0));
    rig.run(20, |r, _| follow(r, 0.05));
    rig.cycle(|r, _| r.bDriveStart = Bool::FALSE);
    assert_eq!((rig.axis(0).nAxisState, rig.axis(0).nCommandedBy), (AxisState::stopping, 0));
    rig.run(5, |_, _| {});
    assert_eq!((rig.axis(0).nAxisState, rig.axis(0).bRegulatorRealState.get(), error(&rig.axis(0))), (AxisState::power_off, true, None));
    rig.run(4, |r, _| r.bDriveStart = Bool::TRUE);
    assert_eq!(rig.axis(0).nAxisState, AxisState::standstill);
}

#[test]
fn a_drive_fault_is_shown_and_reset_by_an_edge_of_bit_7() {
    let mut rig = Rig::on(config(0));
    (rig.drives[0].status, rig.drives[0].hopeless) = (0x08, true);
    rig.io.drives_in[0].error_code = 0x3220;
    rig.run(3, |_, _| {});
    assert_eq!(error(&rig.axis(0)), Some(SmcError::SMC_DI_VOLTAGE_DISABLED));
    assert_eq!(rig.axis(0).uiDriveInterfaceError, 0x3220);
    let reset = |rig: &mut Rig| {
        rig.run(1, |r, _| r.byReset = 1);
        rig.run(1100, |_, _| {});
        rig.axis(0).byReset
    };
    assert_eq!((reset(&mut rig), rig.axis(0).nAxisState), (4, AxisState::errorstop));
    rig.drives[0].hopeless = false;
    assert_eq!((reset(&mut rig), rig.axis(0).nAxisState), (3, AxisState::standstill), "power was still asked for");
}

#[test]
fn power_that_is_lost_in_operation_is_an_error() {
    let mut rig = Rig::on(config(0));
    rig.drives[0].status = 0x40;
    rig.io.drives_in[0].status_word = 0x40;
    rig.cycle(|_, _| {});
    assert_eq!(error(&rig.axis(0)), Some(SmcError::SMC_DI_VOLTAGE_DISABLED));
}

#[test]
fn a_silent_bus_is_an_error_and_cannot_be_reset_away() {
    let mut rig = Rig::on(config(0));
    rig.silent = true;
    rig.run(3, |r, _| follow(r, 0.0));
    assert!(error(&rig.axis(0)).is_none(), "two lost frames are borne");
    rig.run(2, |_, _| {});
    assert_eq!(error(&rig.axis(0)), Some(SmcError::SMC_DI_GENERAL_COMMUNICATION_ERROR));
    assert_eq!(rig.axis(0).wCommunicationState.0, 0);
    rig.run(3, |r, _| {
        if r.byReset == 0 {
            r.byReset = 1
        }
    });
    assert_eq!(rig.axis(0).byReset, 4);
}

#[test]
fn homing_sets_the_position_at_the_reference() {
    let mut c = AxisConfig { encoder: Encoder::Incremental, ..config(0) };
    c.home.offset = 2.0;
    let mut rig = Rig::on(c);
    assert!(!rig.axis(0).bHomed.get());
    rig.run(1, |r, _| (r.byHoming, r.nAxisState, r.fHomePosition) = (1, AxisState::homing, 5.0));
    assert_eq!((rig.axis(0).byHoming, rig.io.drives_out[0].mode), (2, 6));
    rig.run(30, |_, _| {});
    let r = rig.axis(0);
    assert_eq!((r.byHoming, r.nAxisState, r.bHomed.get(), r.fSetPosition), (3, AxisState::standstill, true, 7.0));
    rig.run(5, |_, _| {});
    assert_eq!((rig.axis(0).fActPosition, rig.sent(0), rig.io.drives_out[0].mode, error(&rig.axis(0))), (7.0, 0.0, 8, None));
    // A warm restart keeps the reference.
    let mut fresh = vec![0; rig.image.len()];
    AxisRef::default().store(&mut fresh[64..]);
    rig.stage.attach(&mut fresh);
    assert!((AxisRef::load(&fresh[64..]).fOffset + 7.0).abs() < 1e-12 && AxisRef::load(&fresh[64..]).bHomed.get());
}

#[test]
fn homing_that_fails_or_is_taken_away_ends() {
    let start = || {
        let mut rig = Rig::on(config(0));
        rig.run(1, |r, _| (r.byHoming, r.nAxisState) = (1, AxisState::homing));
        rig
    };
    let mut rig = start();
    rig.drives[0].homing_fails = true;
    rig.run(30, |_, _| {});
    assert_eq!((rig.axis(0).byHoming, error(&rig.axis(0))), (4, Some(SmcError::SMC_DI_HOMING_ERROR)));
    let mut rig = start();
    rig.run(5, |_, _| {});
    rig.cycle(|r, _| r.bRegulatorOn = Bool::FALSE);
    assert_eq!((rig.axis(0).byHoming, rig.axis(0).nAxisState), (4, AxisState::power_off));
    let mut rig = start();
    rig.run(5, |_, _| {});
    rig.cycle(|r, _| {
        follow(r, 0.0);
        r.nAxisState = AxisState::stopping;
    });
    assert_eq!((rig.io.drives_out[0].mode, rig.axis(0).nAxisState, error(&rig.axis(0))), (8, AxisState::stopping, None));
}

#[test]
fn a_modulo_axis_goes_on_through_its_period() {
    let mut c = config(0);
    c.modulo = 1.0;
    let mut rig = Rig::on(c);
    rig.run(50, |r, _| {
        follow(r, 0.05);
        r.fSetPosition = r.fSetPosition.rem_euclid(1.0);
    });
    assert_eq!(error(&rig.axis(0)), None);
    assert!((rig.sent(0) - 2.5).abs() < 1e-9 && (0.0..1.0).contains(&rig.axis(0).fActPosition));
}

#[test]
fn after_a_fault_all_axes_stop_together_on_their_line_and_lose_power() {
    let mut rig = Rig::new(vec![config(0), config(1), config(2)]);
    let by = [0.08, -0.02, 0.0];
    rig.run(6, |r, _| (r.bRegulatorOn, r.bDriveStart) = (Bool::TRUE, Bool::TRUE));
    rig.run(20, |r, i| follow(r, by[i]));
    let before: Vec<f64> = (0..3).map(|i| rig.sent(i)).collect();
    rig.faulted = true;
    let mut last = before.clone();
    for _ in 0..100 {
        rig.cycle(|_, _| {});
        let now: Vec<f64> = (0..3).map(|i| rig.sent(i)).collect();
        assert!((now[0] - last[0]).abs() <= 0.08 + 1e-9);
        assert!(((now[0] - before[0]) * by[1] - (now[1] - before[1]) * by[0]).abs() < 1e-4 * 0.1, "one line");
        last = now;
    }
    assert!((last[0] - before[0] - 80.0 * 80.0 / 4000.0).abs() < 1e-3 && last[2] == before[2]);
    assert!(rig.stage.at_rest());
}

#[test]
fn nonsense_in_the_whole_axis_never_panics() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u8
    };
    let mut rig = Rig::new(vec![config(0), AxisConfig { modulo: 7.0, ..config(1) }]);
    let size = size_of::<AxisRef>();
    for round in 0..20_000 {
        let mut noise = || match random() % 8 {
            0 => 0xFF,
            1 => 0x7F,
            2 => 0xF0,
            _ => random(),
        };
        for i in 0..2 {
            let at = 64 + 1024 * i + (usize::from(noise()) * 256 + usize::from(noise())) % size;
            rig.image[at] = noise();
            if round % 16 == 0 {
                (rig.image[64 + 1024 * i], rig.image[65 + 1024 * i]) = (noise() % 8, 0);
            }
        }
        let out = rig.io.drives_out.clone();
        rig.cycle(|_, _| {});
        for (i, (a, b)) in out.iter().zip(&rig.io.drives_out).enumerate() {
            let jump = (b.position - a.position).abs() as f64 / 1e4;
            let following = a.control_word & 0xF == 0xF && b.control_word & 0xF == 0xF && a.mode == 8 && b.mode == 8 && round > 1;
            assert!(!following || jump <= 100.0 * 1.001 * DT + 2e-4, "axis {i} jumps by {jump} in round {round}");
        }
        rig.faulted = round % 1000 > 900;
        if round % 1000 == 0 {
            rig.stage.attach(&mut rig.image);
        }
    }
}
