//! A frame with two axes: ticks, grid, titles.

use super::scale::Scale;
use super::svg::{Anchor, Svg};

/// A rectangle of the picture, pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Panel {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// A frame that is drawn; its scales.
pub(super) struct Chart {
    pub(super) x: Scale,
    pub(super) y: Scale,
}

/// What stands at an axis.
pub(super) struct Axis<'a> {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) title: &'a str,
}

impl Panel {
    /// The heading of a panel and a line under it.
    pub(super) fn heading(&self, svg: &mut Svg, title: &str, note: &str) {
        svg.text((self.x, self.y + 16.0), Anchor::Start, "title", title);
        svg.text((self.x, self.y + 34.0), Anchor::Start, "note", note);
    }
}

/// Draws the frame of a chart in a panel, below its heading.
pub(super) fn frame(svg: &mut Svg, panel: Panel, x: &Axis<'_>, y: &Axis<'_>) -> Chart {
    let (left, right) = (panel.x + 58.0, panel.x + panel.width - 12.0);
    let (top, bottom) = (panel.y + 52.0, panel.y + panel.height - 46.0);
    let chart = Chart { x: Scale::new(x.low, x.high, left, right), y: Scale::new(y.low, y.high, bottom, top) };
    for (value, label) in chart.x.ticks((right - left) / 80.0) {
        let at = chart.x.at(value);
        svg.line((at, top), (at, bottom), "grid");
        svg.text((at, bottom + 17.0), Anchor::Middle, "tick", &label);
    }
    for (value, label) in chart.y.ticks((bottom - top) / 45.0) {
        let at = chart.y.at(value);
        svg.line((left, at), (right, at), "grid");
        svg.text((left - 8.0, at + 4.0), Anchor::End, "tick", &label);
    }
    svg.line((left, bottom), (right, bottom), "axis");
    svg.line((left, top), (left, bottom), "axis");
    svg.text(((left + right) / 2.0, bottom + 38.0), Anchor::Middle, "label", x.title);
    svg.upright((panel.x + 14.0, (top + bottom) / 2.0), "label", y.title);
    chart
}

/// Entries of a legend: the class of their mark and their text, in a row from the right.
pub(super) fn legend(svg: &mut Svg, panel: Panel, entries: &[(&str, &str)]) {
    let mut x = panel.x + panel.width - 12.0;
    for (class, text) in entries.iter().rev() {
        svg.text((x, panel.y + 34.0), Anchor::End, "note", text);
        x -= 6.4 * text.chars().count() as f64 + 10.0;
        match *class {
            "dot" | "point" => svg.circle((x - 4.0, panel.y + 30.0), 3.0, class),
            _ => svg.line((x - 14.0, panel.y + 30.0), (x, panel.y + 30.0), class),
        }
        x -= 30.0;
    }
}
