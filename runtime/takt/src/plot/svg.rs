//! SVG text, with everything escaped and numbers rounded to hundredths of a pixel.

use std::fmt::Write;

/// A picture being written.
#[derive(Debug, Default)]
pub(super) struct Svg {
    body: String,
}

/// Where a text is anchored.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A number without needless digits.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Svg {
    fn push(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(text);
    }
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), class: &str) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(number);
        self.push(format_args!("<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>\n"));
    }
    pub(super) fn circle(&mut self, at: (f64, f64), radius: f64, class: &str) {
        let [x, y, r] = [at.0, at.1, radius].map(number);
        self.push(format_args!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>\n"));
    }
    pub(super) fn text(&mut self, at: (f64, f64), anchor: Anchor, class: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let [x, y] = [at.0, at.1].map(number);
        self.push(format_args!("<text class=\"{class}\" text-anchor=\"{anchor}\" x=\"{x}\" y=\"{y}\">{}</text>\n", escaped(text)));
    }
    /// A text that runs upwards.
    pub(super) fn upright(&mut self, at: (f64, f64), class: &str, text: &str) {
        let [x, y] = [at.0, at.1].map(number);
        self.push(format_args!(
            "<text class=\"{class}\" text-anchor=\"middle\" transform=\"translate({x} {y}) rotate(-90)\">{}</text>\n",
            escaped(text)
        ));
    }
    /// A line through points; neighbours nearer than a third of a pixel are left out.
    pub(super) fn polyline(&mut self, points: impl IntoIterator<Item = (f64, f64)>, class: &str) {
        let mut last: Option<(f64, f64)> = None;
        let mut skipped = None;
        let mut path = String::new();
        for point in points {
            let near = last.is_some_and(|l| (l.0 - point.0).abs().max((l.1 - point.1).abs()) < 0.33);
            skipped = near.then_some(point);
            if !near {
                let _ = write!(path, "{} {} ", number(point.0), number(point.1));
                last = Some(point);
            }
        }
        if let Some(point) = skipped {
            let _ = write!(path, "{} {}", number(point.0), number(point.1));
        }
        if !path.is_empty() {
            self.push(format_args!("<polyline class=\"{class}\" points=\"{}\"/>\n", path.trim_end()));
        }
    }
    pub(super) fn polygon(&mut self, points: &[(f64, f64)], class: &str) {
        let points: Vec<_> = points.iter().map(|(x, y)| format!("{} {}", number(*x), number(*y))).collect();
        self.push(format_args!("<polygon class=\"{class}\" points=\"{}\"/>\n", points.join(" ")));
    }
    /// The whole file.
    pub(super) fn finish(self, size: (f64, f64), style: &str, title: &str) -> String {
        let [w, h] = [size.0, size.1].map(number);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\">\n<title>{}</title>\n<style>{style}</style>\n{}</svg>\n",
            escaped(title),
            self.body
        )
    }
}
