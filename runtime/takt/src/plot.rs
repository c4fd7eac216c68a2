//! A run as a picture: path with tool axes and dots, speed over time, valve frequency against speed (figures 9, 10, 13, 14 of the dispenser's document).
//!
//! A [`Recording`] takes one sample per scan; its memory is bounded: a long run keeps every second, fourth, … sample, but every dot up to a bound.
//! [`draw`] makes one SVG without scripts. The same data give the same bytes.

mod chart;
mod figures;
mod path;
mod scale;
mod svg;

use crate::machine::PlotPlaces;
use crate::realtime::samples::Look;

/// Samples kept at the most.
const SAMPLES: usize = 400_000;
/// Dots kept at the most.
const DOTS: usize = 100_000;

/// What is known of one scan. What the manifest does not name is NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Machine time, s.
    pub time: f64,
    /// Tool centre point, mm.
    pub tcp: [f64; 3],
    /// Its speed, mm/s.
    pub speed: f64,
    /// Table angles theta1, theta2, degrees.
    pub tool: [f64; 2],
    /// The valve's command.
    pub valve: f64,
}

/// Everything that is drawn.
#[derive(Debug, Clone, Default)]
pub struct Data {
    /// In order of time.
    pub samples: Vec<Sample>,
    /// Samples at which a dot was placed, in order of time.
    pub dots: Vec<Sample>,
    /// Highest frequency of the valve, Hz.
    pub frequency_limit: Option<f64>,
    /// Which pictures there is data for: path, tool axes, speed, dots.
    pub has: Has,
}

/// Which variables are recorded.
#[derive(Debug, Clone, Copy, Default)]
pub struct Has {
    /// Positions.
    pub tcp: bool,
    /// Tool axes.
    pub tool: bool,
    /// Speed.
    pub speed: bool,
    /// Dots.
    pub dots: bool,
}

/// A run being recorded.
#[derive(Debug)]
pub struct Recording {
    places: PlotPlaces,
    data: Data,
    stride: u64,
    scans: u64,
    count: f64,
}

impl Recording {
    /// Of these variables.
    pub fn new(places: &PlotPlaces) -> Self {
        let has =
            Has { tcp: places.tcp.is_some(), tool: places.tool.is_some(), speed: places.speed.is_some(), dots: places.dots.is_some() };
        let data = Data { frequency_limit: places.frequency_limit, has, ..Data::default() };
        Self { places: places.clone(), data, stride: 1, scans: 0, count: f64::NAN }
    }

    /// The variables that a sample needs.
    pub fn places(&self) -> impl Iterator<Item = takt_ir::Place> {
        let of = &self.places;
        of.tcp.into_iter().flatten().chain(of.tool.into_iter().flatten()).chain(of.speed).chain(of.dots).chain(of.valve)
    }

    /// Takes a sample.
    pub fn add(&mut self, machine: &impl Look) {
        let at = |place: Option<takt_ir::Place>| place.map_or(f64::NAN, |place| machine.number(place));
        let sample = Sample {
            time: machine.time().seconds(),
            tcp: self.places.tcp.map_or([f64::NAN; 3], |places| places.map(|place| machine.number(place))),
            speed: at(self.places.speed),
            tool: self.places.tool.map_or([f64::NAN; 2], |places| places.map(|place| machine.number(place))),
            valve: at(self.places.valve),
        };
        let count = at(self.places.dots);
        if count > self.count && self.data.dots.len() < DOTS {
            self.data.dots.push(sample);
        }
        self.count = count;
        if self.scans.is_multiple_of(self.stride) {
            self.data.samples.push(sample);
        }
        self.scans += 1;
        if self.data.samples.len() == SAMPLES {
            let mut keep = false;
            self.data.samples.retain(|_| {
                keep = !keep;
                keep
            });
            self.stride *= 2;
        }
    }

    /// The picture.
    pub fn draw(&self) -> String {
        draw(&self.data)
    }
}

/// Draws what there is data for.
pub fn draw(data: &Data) -> String {
    figures::draw(data)
}

#[cfg(test)]
mod tests;
