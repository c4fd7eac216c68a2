//! Axes: how an `AXIS_REF_SM3` is tied to a drive, and the checks of its configuration.
//!
//! The axis stage runs twice in a bus cycle. *Inputs* turn drive words into actual values and real states, *outputs* check the set values and turn them
//! into drive words ([`stage`]). Set values come from the image, so nothing in them is trusted: what is checked and scaled is kept on the engine's side,
//! and what the image says of limits and scaling is only shown to the program.

pub(crate) mod cia402;
pub(crate) mod ramp;
pub(crate) mod stage;

use takt_abi::AxisRef;
use takt_ir::{Place, Program, Type};

/// Limits of an axis, technical units (mm or degrees) and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    /// Lower end of travel. Of no effect on a modulo axis.
    pub negative: f64,
    /// Upper end of travel.
    pub positive: f64,
    /// Largest speed.
    pub velocity: f64,
    /// Largest acceleration.
    pub acceleration: f64,
    /// Largest deceleration; the axis stage brakes with it after an error.
    pub deceleration: f64,
    /// Largest jerk.
    pub jerk: f64,
}

impl Default for AxisLimits {
    fn default() -> Self {
        Self { negative: -1e6, positive: 1e6, velocity: 1e3, acceleration: 1e4, deceleration: 1e4, jerk: 1e6 }
    }
}

/// Following error, technical units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// From here on it is shown ([`crate::AxisStatus::lag_warning`]).
    pub warn: f64,
    /// From here on it is an error that stops the axis.
    pub trip: f64,
}

/// What the encoder knows at power-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoder {
    /// Where the axis is.
    #[default]
    Absolute,
    /// Nothing; the axis must be homed.
    Incremental,
}

/// What travels to the drive besides the position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FeedForward {
    /// Nothing.
    None,
    /// The set velocity (60B1).
    #[default]
    Velocity,
}

/// How the drive finds its reference (CiA 402, 6098 ff.).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Home {
    /// Method.
    pub method: i8,
    /// Speed towards the switch, technical units/s.
    pub fast: f64,
    /// Speed away from the switch or towards the index pulse.
    pub slow: f64,
    /// Added to MC_Home's Position: where the axis is when it stands at the reference. With an absolute encoder: where it is at the encoder's zero.
    pub offset: f64,
}

impl Default for Home {
    fn default() -> Self {
        Self { method: 37, fast: 1.0, slow: 1.0, offset: 0.0 }
    }
}

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisConfig {
    /// Path of the variable, for messages.
    pub name: String,
    /// The AXIS_REF_SM3.
    pub place: Place,
    /// Index into the bus' drives.
    pub drive: usize,
    /// Increments per technical unit, > 0.
    pub increments_per_unit: f64,
    /// The drive counts against the axis.
    pub invert: bool,
    /// Period of a modulo axis, technical units; 0: finite axis.
    pub modulo: f64,
    /// Limits.
    pub limits: AxisLimits,
    /// Following error; `None`: not watched.
    pub lag: Option<Lag>,
    /// Encoder.
    pub encoder: Encoder,
    /// Homing.
    pub home: Home,
    /// Feed-forward.
    pub feed_forward: FeedForward,
    /// Backlash, technical units; only 0 in this version.
    pub backlash: f64,
}

/// What is wrong with an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum AxisProblem {
    /// A value outside its range.
    Range {
        /// Key of the manifest.
        key: &'static str,
        /// What it is.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// The variable has another type.
    Type {
        /// Which.
        found: String,
    },
    /// The bus has no such drive.
    NoDrive {
        /// Index asked for.
        drive: usize,
        /// How many there are.
        drives: usize,
    },
    /// The drive or the variable belongs to another axis already.
    Taken {
        /// Which.
        by: String,
    },
}

impl std::fmt::Display for AxisProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Range { key, value, expected } => write!(f, "`{key}` is {value}, expected {expected}"),
            Self::Type { found } => write!(f, "the variable is `{found}`, expected `AXIS_REF_SM3`"),
            Self::NoDrive { drive, drives } => write!(f, "there is no drive {drive}: the bus has {drives}"),
            Self::Taken { by } => write!(f, "its drive or variable belongs to axis `{by}` already"),
        }
    }
}

impl AxisConfig {
    /// An axis with the default limits, one increment per unit, an absolute encoder.
    pub fn new(name: &str, place: Place, drive: usize) -> Self {
        Self {
            name: name.into(),
            place,
            drive,
            increments_per_unit: 1.0,
            invert: false,
            modulo: 0.0,
            limits: AxisLimits::default(),
            lag: None,
            encoder: Encoder::default(),
            home: Home::default(),
            feed_forward: FeedForward::default(),
            backlash: 0.0,
        }
    }

    /// Checks each value against its range, and type and drive against program and bus.
    pub(crate) fn check(&self, program: &Program, drives: usize) -> Result<(), AxisProblem> {
        let l = &self.limits;
        let positive = |v: f64| v.is_finite() && v > 0.0 && v <= 1e12;
        let moderate = |v: f64| v.is_finite() && v.abs() <= 1e12;
        let rules: [(&'static str, f64, bool, &'static str); 12] = [
            ("increments-per-unit", self.increments_per_unit, positive(self.increments_per_unit), "more than 0"),
            ("modulo", self.modulo, self.modulo == 0.0 || positive(self.modulo), "0 or more"),
            (
                "limits.negative",
                l.negative,
                moderate(l.negative) && (l.negative < l.positive || self.modulo > 0.0),
                "less than `limits.positive`",
            ),
            ("limits.positive", l.positive, moderate(l.positive), "a number"),
            ("limits.velocity", l.velocity, positive(l.velocity), "more than 0"),
            ("limits.acceleration", l.acceleration, positive(l.acceleration), "more than 0"),
            ("limits.deceleration", l.deceleration, positive(l.deceleration), "more than 0"),
            ("limits.jerk", l.jerk, positive(l.jerk), "more than 0"),
            ("home.fast", self.home.fast, positive(self.home.fast), "more than 0"),
            ("home.slow", self.home.slow, positive(self.home.slow), "more than 0"),
            ("home.offset", self.home.offset, moderate(self.home.offset), "a number"),
            ("backlash", self.backlash, self.backlash == 0.0, "0 (compensation is not in this version)"),
        ];
        for (key, value, good, expected) in rules {
            if !good {
                return Err(AxisProblem::Range { key, value, expected });
            }
        }
        if let Some(lag) = self.lag {
            if !positive(lag.trip) {
                return Err(AxisProblem::Range { key: "lag.trip", value: lag.trip, expected: "more than 0" });
            }
            if !(lag.warn > 0.0 && lag.warn <= lag.trip) {
                return Err(AxisProblem::Range { key: "lag.warn", value: lag.warn, expected: "more than 0, not more than `lag.trip`" });
            }
        }
        let types = &program.types;
        let is_axis = matches!(types.all().get(self.place.ty.0 as usize), Some(Type::Struct(s)) if s.name.eq_ignore_ascii_case("AXIS_REF_SM3") && s.size as usize == size_of::<AxisRef>());
        if !is_axis || u64::from(self.place.offset) + size_of::<AxisRef>() as u64 > u64::from(program.image_size) {
            return Err(AxisProblem::Type {
                found: types.all().get(self.place.ty.0 as usize).map_or_else(|| "?".into(), |_| types.name(self.place.ty)),
            });
        }
        if self.drive >= drives {
            return Err(AxisProblem::NoDrive { drive: self.drive, drives });
        }
        Ok(())
    }
}
