//! The path in space, drawn axonometrically over a floor with ticks.

use super::chart::{Panel, legend};
use super::scale::ticks;
use super::svg::{Anchor, Svg};
use super::{Data, Sample};

/// Direction of view: azimuth -60°, elevation 35°, so that x runs to the right and y to the back.
const RIGHT: [f64; 3] = [0.866_025_403_784_438_6, 0.5, 0.0];
const UP: [f64; 3] = [-0.286_788_218_175_523, 0.496_731_764_607_165_5, 0.819_152_044_288_991_8];

/// What is drawn upon the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Layer {
    /// Direction of motion.
    Arrows,
    /// Tool axes and dots.
    Tools,
}

/// Space on the panel.
struct View {
    low: [f64; 3],
    high: [f64; 3],
    scale: f64,
    shift: (f64, f64),
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    dot(d, d).sqrt()
}

fn finite(sample: &&Sample) -> bool {
    sample.tcp.iter().all(|value| value.is_finite() && value.abs() < 1e9)
}

impl View {
    fn new(samples: &[Sample], panel: Panel, tool: f64) -> Option<Self> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for sample in samples.iter().filter(finite) {
            for i in 0..3 {
                low[i] = low[i].min(sample.tcp[i]);
                high[i] = high[i].max(sample.tcp[i]);
            }
        }
        if low[0] > high[0] {
            return None;
        }
        let size = (0..3).map(|i| high[i] - low[i]).fold(1.0, f64::max);
        for i in 0..3 {
            low[i] -= size * 0.06;
            high[i] += size * if i == 2 { 0.06 + tool } else { 0.06 };
        }
        let corners: Vec<[f64; 3]> = (0..8).map(|c| std::array::from_fn(|i| if c >> i & 1 == 0 { low[i] } else { high[i] })).collect();
        let range = |axis: [f64; 3]| {
            corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |r, c| (r.0.min(dot(*c, axis)), r.1.max(dot(*c, axis))))
        };
        let (x, y) = (range(RIGHT), range(UP));
        let (left, top, width, height) = (panel.x + 30.0, panel.y + 50.0, panel.width - 60.0, panel.height - 90.0);
        let scale = (width / (x.1 - x.0)).min(height / (y.1 - y.0));
        let shift = (left + width / 2.0 - scale * (x.0 + x.1) / 2.0, top + height / 2.0 + scale * (y.0 + y.1) / 2.0);
        Some(Self { low, high, scale, shift })
    }
    fn at(&self, p: [f64; 3]) -> (f64, f64) {
        (self.shift.0 + self.scale * dot(p, RIGHT), self.shift.1 - self.scale * dot(p, UP))
    }
    fn floor(&self, svg: &mut Svg) {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.low, self.high);
        let corners = [[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0]].map(|corner| self.at(corner));
        svg.polygon(&corners, "floor");
        let count = |low: f64, high: f64| ((high - low) * self.scale / 50.0).max(3.0);
        for (x, label) in ticks(x0, x1, count(x0, x1)) {
            svg.line(self.at([x, y0, z0]), self.at([x, y1, z0]), "grid");
            let (sx, sy) = self.at([x, y0, z0]);
            svg.text((sx - 2.0, sy + 16.0), Anchor::Middle, "tick", &label);
        }
        for (y, label) in ticks(y0, y1, count(y0, y1)) {
            svg.line(self.at([x0, y, z0]), self.at([x1, y, z0]), "grid");
            let (sx, sy) = self.at([x1, y, z0]);
            svg.text((sx + 6.0, sy + 10.0), Anchor::Start, "tick", &label);
        }
        svg.line(self.at([x0, y0, z0]), self.at([x0, y0, z1]), "axis");
        for (z, label) in ticks(z0, z1, ((z1 - z0) * self.scale / 40.0).max(1.5)) {
            let (sx, sy) = self.at([x0, y0, z]);
            svg.line((sx - 4.0, sy), (sx, sy), "axis");
            svg.text((sx - 8.0, sy + 4.0), Anchor::End, "tick", &label);
        }
        let middle = |p: [f64; 3], dx: f64, dy: f64| (self.at(p).0 + dx, self.at(p).1 + dy);
        svg.text(middle([(x0 + x1) / 2.0, y0, z0], -14.0, 36.0), Anchor::Middle, "label", "X / mm");
        svg.text(middle([x1, (y0 + y1) / 2.0, z0], 34.0, 24.0), Anchor::Start, "label", "Y / mm");
        svg.text(middle([x0, y0, z1], -4.0, -8.0), Anchor::Middle, "label", "Z / mm");
    }
}

/// Draws the path in a panel; false if there is nothing to draw.
pub(super) fn draw(svg: &mut Svg, panel: Panel, data: &Data, layer: Layer) -> bool {
    let Some(view) = View::new(&data.samples, panel, if layer == Layer::Tools { 0.1 } else { 0.0 }) else { return false };
    view.floor(svg);
    let span = data.dots.first().zip(data.dots.last()).map(|(first, last)| (first.time, last.time));
    let dispensing = |sample: &Sample| span.is_some_and(|(first, last)| (first..=last).contains(&sample.time));
    let samples: Vec<&Sample> = data.samples.iter().filter(finite).collect();
    let runs = samples.chunk_by(|a, b| dispensing(a) == dispensing(b));
    let lines: Vec<(bool, Vec<(f64, f64)>)> =
        runs.map(|run| (dispensing(run[0]), run.iter().map(|sample| view.at(sample.tcp)).collect())).collect();
    if layer == Layer::Tools {
        tools(svg, &view, &samples, span);
    }
    for (on, points) in lines {
        svg.polyline(points, if on { "path" } else { "move" });
    }
    match layer {
        Layer::Arrows => {
            arrows(svg, &view, &samples);
            origin(svg, &view);
            legend(svg, panel, &[("path", "dispensing"), ("move", "positioning")]);
        }
        Layer::Tools => {
            for sample in data.dots.iter().filter(finite) {
                svg.circle(view.at(sample.tcp), 1.6, "dot");
            }
            legend(svg, panel, &[("tool", "tool axis"), ("dot", "dot")]);
        }
    }
    true
}

/// The axis of the tool in the part's frame: (-cos t1 sin t2, sin t1 sin t2, cos t2).
fn axis(sample: &Sample) -> [f64; 3] {
    let [t1, t2] = sample.tool.map(f64::to_radians);
    let (s2, c2) = (libm::sin(t2), libm::cos(t2));
    [-libm::cos(t1) * s2, libm::sin(t1) * s2, c2]
}

fn tools(svg: &mut Svg, view: &View, samples: &[&Sample], span: Option<(f64, f64)>) {
    let shown: Vec<_> = samples.iter().filter(|s| span.is_none_or(|(first, last)| (first..=last).contains(&s.time))).collect();
    let length = 34.0 / view.scale;
    let mut left = 0.0;
    for pair in shown.windows(2) {
        left -= distance(pair[0].tcp, pair[1].tcp) * view.scale;
        if left <= 0.0 && pair[1].tool.iter().all(|angle| angle.is_finite()) {
            left = 9.0;
            let (p, k) = (pair[1].tcp, axis(pair[1]));
            svg.line(view.at(p), view.at(std::array::from_fn(|i| p[i] + length * k[i])), "tool");
        }
    }
}

/// Triangles that point where the motion goes.
fn arrows(svg: &mut Svg, view: &View, samples: &[&Sample]) {
    let mut left = 50.0;
    for pair in samples.windows(2) {
        let (a, b) = (view.at(pair[0].tcp), view.at(pair[1].tcp));
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let step = (dx * dx + dy * dy).sqrt();
        left -= step;
        if left > 0.0 || step < 1e-6 {
            continue;
        }
        left = 110.0;
        let (ux, uy) = (dx / step, dy / step);
        svg.polygon(&[(b.0 + 7.0 * ux, b.1 + 7.0 * uy), (b.0 - 4.0 * uy, b.1 + 4.0 * ux), (b.0 + 4.0 * uy, b.1 - 4.0 * ux)], "arrow");
    }
}

/// The frame of the part.
fn origin(svg: &mut Svg, view: &View) {
    let size = 26.0 / view.scale;
    for (i, (class, name)) in [("x", "X"), ("y", "Y"), ("z", "Z")].into_iter().enumerate() {
        let mut end = [0.0; 3];
        end[i] = size;
        let tip = view.at(end);
        svg.line(view.at([0.0; 3]), tip, class);
        svg.text((tip.0 + 3.0, tip.1 - 3.0), Anchor::Start, "tick", name);
    }
}
