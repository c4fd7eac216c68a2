//! `[axis.NAME]`: scaling, limits, homing and watch of one servo axis, each value with its range.

use super::Located;
use super::reader::Table;

/// Ranges of motion, technical units (mm or degrees) and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Software end switches; `None` on a modulo axis without them.
    pub travel: Option<(f64, f64)>,
    /// Per second.
    pub velocity: f64,
    /// Per s².
    pub acceleration: f64,
    /// Per s².
    pub deceleration: f64,
    /// Per s³.
    pub jerk: f64,
}

/// Following error, technical units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// A warning from here.
    pub warn: f64,
    /// An error from here.
    pub trip: f64,
}

/// How an axis finds its zero (CiA 402).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Home {
    /// Homing method, object 6098.
    pub method: i8,
    /// Speed towards the switch, units per second.
    pub fast: f64,
    /// Speed towards the edge, units per second.
    pub slow: f64,
    /// Position of the zero behind the reference, units.
    pub offset: f64,
}

/// Where the switches of an axis act, technical units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Switches {
    /// Negative limit switch.
    pub negative: Option<f64>,
    /// Positive limit switch.
    pub positive: Option<f64>,
    /// Home switch.
    pub home: Option<f64>,
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name of the global AXIS_REF_SM3.
    pub name: Located<String>,
    /// Drive increments per mm or degree, > 0.
    pub increments_per_unit: f64,
    /// Counts the other way.
    pub invert: bool,
    /// Period, 0 for a finite axis.
    pub modulo: f64,
    /// Ranges of motion.
    pub limits: Limits,
    /// Following error, if it is watched.
    pub lag: Option<Lag>,
    /// Knows where it is after power-up.
    pub absolute: bool,
    /// Homing.
    pub home: Home,
    /// Target velocity goes to the drive.
    pub feed_forward: bool,
}

/// Homing methods that drives know here (CiA 402, object 6098).
const METHODS: [i8; 10] = [1, 2, 17, 18, 21, 23, 33, 34, 35, 37];
const POSITION: std::ops::RangeInclusive<f64> = -1e7..=1e7;
const VELOCITY: std::ops::RangeInclusive<f64> = 1e-6..=1e6;
const ACCELERATION: std::ops::RangeInclusive<f64> = 1e-6..=1e9;
const JERK: std::ops::RangeInclusive<f64> = 1e-6..=1e12;

pub(super) fn read(name: Located<String>, table: &mut Table<'_, '_>) -> Option<Axis> {
    if let Some(bus) = table.string("bus").filter(|bus| bus.value != "sim") {
        table.error(
            bus.span,
            format!("`bus` in [axis.{}] must be \"sim\", found \"{}\"", name.value, bus.value),
            "this version moves simulated drives only",
        );
    }
    table.require("increments-per-unit");
    let increments_per_unit = table.arithmetic("increments-per-unit", 1e-6..=1e12);
    let invert = table.boolean("invert").unwrap_or(false);
    let modulo = table.number("modulo", 0.0..=1e7).unwrap_or(0.0);
    table.require("limits");
    let limits = table.section("limits", |inner| read_limits(inner, modulo > 0.0)).flatten();
    let lag = table.section("lag", read_lag).flatten();
    let absolute = table.choice("encoder", &[("absolute", true), ("incremental", false)]).unwrap_or(true);
    let home = table.section("home", read_home).unwrap_or(Home { method: 37, fast: 1.0, slow: 1.0, offset: 0.0 });
    let feed_forward = table.choice("feed-forward", &[("velocity", true), ("none", false)]).unwrap_or(true);
    table.number("backlash", 0.0..=0.0);
    Some(Axis { name, increments_per_unit: increments_per_unit?, invert, modulo, limits: limits?, lag, absolute, home, feed_forward })
}

fn read_limits(table: &mut Table<'_, '_>, modulo: bool) -> Option<Limits> {
    if !modulo {
        table.require("negative");
        table.require("positive");
    }
    let travel = table.number("negative", POSITION).zip(table.number("positive", POSITION));
    if let Some((negative, positive)) = travel.filter(|(negative, positive)| negative >= positive) {
        let span = table.span();
        table.error(
            span,
            format!("`negative` must be below `positive`, found {negative} and {positive}"),
            "they are the software end switches",
        );
    }
    let velocity = table.required_number("velocity", VELOCITY);
    let acceleration = table.required_number("acceleration", ACCELERATION);
    let deceleration = table.number("deceleration", ACCELERATION).or(acceleration);
    let jerk = table.number("jerk", JERK).or(acceleration.map(|a| a * 20.0));
    Some(Limits { travel, velocity: velocity?, acceleration: acceleration?, deceleration: deceleration?, jerk: jerk? })
}

fn read_lag(table: &mut Table<'_, '_>) -> Option<Lag> {
    let warn = table.required_number("warn", 1e-9..=1e7);
    let trip = table.required_number("trip", 1e-9..=1e7);
    let (warn, trip) = warn.zip(trip)?;
    if warn > trip {
        let span = table.span();
        table.error(span, format!("`warn` must not be above `trip`, found {warn} and {trip}"), "the warning comes first");
    }
    Some(Lag { warn, trip })
}

fn read_home(table: &mut Table<'_, '_>) -> Home {
    let method = table.number("method", -128.0..=127.0).unwrap_or(37.0);
    if !METHODS.iter().any(|known| f64::from(*known) == method) {
        let span = table.span();
        table.error(span, format!("no homing method {method}"), format!("known (CiA 402, object 6098): {METHODS:?}"));
    }
    let fast = table.number("fast", VELOCITY).unwrap_or(1.0);
    let slow = table.number("slow", VELOCITY).unwrap_or(fast);
    if slow > fast {
        let span = table.span();
        table.error(
            span,
            format!("`slow` must not be above `fast`, found {slow} and {fast}"),
            "`fast` looks for the switch, `slow` for its edge",
        );
    }
    Home { method: method as i8, fast, slow, offset: table.number("offset", POSITION).unwrap_or(0.0) }
}
