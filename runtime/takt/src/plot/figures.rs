//! The four pictures and their places.

use super::chart::{Axis, Panel, frame, legend};
use super::path::{self, Layer};
use super::svg::{Anchor, Svg, number};
use super::{Data, Sample};

const STYLE: &str = "\
svg{background:#fff;font-family:'Helvetica Neue',Arial,'Noto Sans','Noto Sans CJK SC',sans-serif}\
line,polyline{fill:none;stroke-linecap:round;stroke-linejoin:round}\
.title{font-size:15px;font-weight:600;fill:#16202c}.note,.label{font-size:12px;fill:#4b5a6a}.tick{font-size:11px;fill:#6a7886}\
.grid{stroke:#e6ebf0;stroke-width:1}.axis{stroke:#8a97a5;stroke-width:1}.floor{fill:#f7f9fb;stroke:#d5dce3}\
.path{stroke:#1565c0;stroke-width:1.8}.move{stroke:#9aa7b4;stroke-width:1;stroke-dasharray:4 3}.tool{stroke:#f08c3a;stroke-width:1}\
.dot{fill:#0b7a53}.point{fill:#1565c0;fill-opacity:.55}.arrow{fill:#1565c0}.speed{stroke:#1565c0;stroke-width:1.4}\
.fit{stroke:#f08c3a;stroke-width:1.4;stroke-dasharray:6 4}.limit{stroke:#c62828;stroke-width:1.4;stroke-dasharray:2 3}\
.x{stroke:#c62828;stroke-width:2}.y{stroke:#2e7d32;stroke-width:2}.z{stroke:#283593;stroke-width:2}";

const SIZE: (f64, f64) = (1240.0, 900.0);

pub(super) fn draw(data: &Data) -> String {
    let mut svg = Svg::default();
    let panel = |column: f64, row: f64| Panel { x: 24.0 + column * 612.0, y: 16.0 + row * 440.0, width: 580.0, height: 424.0 };
    let length = format!("{} samples, {} mm of path", data.samples.len(), number(length(&data.samples)));
    space(&mut svg, panel(0.0, 0.0), data, data.has.tcp, Layer::Arrows, ("Path of the tool centre point", &length));
    let dots = format!("{} dots", data.dots.len());
    space(&mut svg, panel(1.0, 0.0), data, data.has.tcp && data.has.tool, Layer::Tools, ("Tool axes and dots", &dots));
    speed(&mut svg, panel(0.0, 1.0), data);
    frequency(&mut svg, panel(1.0, 1.0), data);
    svg.finish(SIZE, STYLE, "A run of the machine: path, tool axes, speed, valve")
}

fn nothing(svg: &mut Svg, panel: Panel, why: &str) {
    svg.text((panel.x + panel.width / 2.0, panel.y + panel.height / 2.0), Anchor::Middle, "note", why);
}

fn space(svg: &mut Svg, panel: Panel, data: &Data, known: bool, layer: Layer, heading: (&str, &str)) {
    panel.heading(svg, heading.0, heading.1);
    if !known {
        nothing(svg, panel, "the manifest names no variables for it");
    } else if !path::draw(svg, panel, data, layer) {
        nothing(svg, panel, "nothing was recorded");
    }
}

fn length(samples: &[Sample]) -> f64 {
    let step = |pair: &[Sample]| {
        let d: f64 = (0..3).map(|i| (pair[1].tcp[i] - pair[0].tcp[i]) * (pair[1].tcp[i] - pair[0].tcp[i])).sum();
        if d.is_finite() { d.sqrt() } else { 0.0 }
    };
    samples.windows(2).map(step).sum()
}

fn speed(svg: &mut Svg, panel: Panel, data: &Data) {
    let known: Vec<&Sample> = data.samples.iter().filter(|sample| sample.speed.is_finite()).collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else {
        panel.heading(svg, "Speed of the tool centre point", "");
        return nothing(svg, panel, if data.has.speed { "nothing was recorded" } else { "the manifest names no variable for it" });
    };
    let top = known.iter().map(|sample| sample.speed).fold(0.0, f64::max);
    let span = last.time - first.time;
    panel.heading(svg, "Speed of the tool centre point", &format!("at most {} mm/s, {} s", number(top), number(span)));
    let x = Axis { low: 0.0, high: span.max(1e-3), title: "t / s" };
    let y = Axis { low: 0.0, high: (top * 1.1).max(1e-3), title: "v / (mm/s)" };
    let chart = frame(svg, panel, &x, &y);
    legend(svg, panel, &[("speed", "TCP speed")]);
    svg.polyline(envelope(&known, first.time, |time| chart.x.at(time)).into_iter().map(|(x, v)| (x, chart.y.at(v))), "speed");
}

/// First, lowest, highest and last value of each half pixel, so that no peak is lost.
fn envelope(samples: &[&Sample], start: f64, x: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let column = |sample: &Sample| (x(sample.time - start) * 2.0).floor();
    let mut points = Vec::new();
    for run in samples.chunk_by(|a, b| column(a) == column(b)) {
        let at = x(run[0].time - start);
        let mut add = |sample: Option<&&Sample>| points.extend(sample.map(|sample| (at, sample.speed)));
        add(run.first());
        if run.len() > 2 {
            add(run.iter().min_by(|a, b| a.speed.total_cmp(&b.speed)));
            add(run.iter().max_by(|a, b| a.speed.total_cmp(&b.speed)));
        }
        add(run.last());
    }
    points
}

/// Dots further apart than this in time are not one stroke of the valve after the other, s.
const STROKE: f64 = 1.0;

/// Speed and frequency between each dot and the next.
fn strokes(data: &Data) -> Vec<(f64, f64)> {
    let mut strokes = Vec::new();
    let mut rest = data.samples.as_slice();
    for pair in data.dots.windows(2) {
        let (from, to) = (pair[0].time, pair[1].time);
        rest = &rest[rest.partition_point(|sample| sample.time < from)..];
        let between = &rest[..rest.partition_point(|sample| sample.time < to)];
        let speed = between.iter().map(|sample| sample.speed).sum::<f64>() / between.len() as f64;
        if to > from && to - from <= STROKE && speed.is_finite() {
            strokes.push((speed, 1.0 / (to - from)));
        }
    }
    strokes
}

fn frequency(svg: &mut Svg, panel: Panel, data: &Data) {
    let strokes = strokes(data);
    let title = "Valve frequency against speed";
    if strokes.is_empty() {
        panel.heading(svg, title, "");
        return nothing(
            svg,
            panel,
            if data.has.dots && data.has.speed { "no dots were recorded" } else { "the manifest names no variables for it" },
        );
    }
    let (vv, vf) = strokes.iter().fold((0.0, 0.0), |sum, (v, f)| (sum.0 + v * v, sum.1 + v * f));
    let slope = if vv > 0.0 { vf / vv } else { 0.0 };
    let limit = data.frequency_limit.map_or_else(String::new, |limit| format!(", at most {} Hz", number(limit)));
    panel.heading(svg, title, &format!("f = v / {} mm{limit}", number(1.0 / slope.max(1e-9))));
    let top = |pick: fn(&(f64, f64)) -> f64| strokes.iter().map(pick).fold(0.0, f64::max);
    let (fastest, highest) = (top(|s| s.0), top(|s| s.1));
    let cap = data.frequency_limit.filter(|limit| slope > 0.0 && *limit >= highest).map(|limit| (limit / slope, limit));
    let corner = cap.unwrap_or((fastest, fastest * slope));
    let x = Axis { low: 0.0, high: corner.0.max(fastest) * 1.2, title: "v / (mm/s)" };
    let y = Axis { low: 0.0, high: corner.1.max(highest) * 1.15, title: "f / Hz" };
    let chart = frame(svg, panel, &x, &y);
    svg.line((chart.x.at(0.0), chart.y.at(0.0)), (chart.x.at(corner.0), chart.y.at(corner.1)), "fit");
    if let Some((v, limit)) = cap {
        svg.line((chart.x.at(v), chart.y.at(limit)), (chart.x.at(x.high), chart.y.at(limit)), "limit");
    }
    for (v, f) in &strokes {
        svg.circle((chart.x.at(*v), chart.y.at(*f)), 2.6, "point");
    }
    let entries = [("point", "one stroke"), ("fit", "f ~ v"), ("limit", "limit")];
    legend(svg, panel, if cap.is_some() { &entries } else { &entries[..2] });
}
