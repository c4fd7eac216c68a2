//! The path that was meant: the reference points of the phone job in full precision, as a smooth curve.

use serde_json::Value;
use std::fs;

/// The five runs of the job as polylines with tangents.
pub struct Truth {
    runs: Vec<Vec<[f64; 3]>>,
}

impl Truth {
    /// From the reference data.
    pub fn load() -> Self {
        let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/data/phone_truth.json")).expect("reference data");
        let value: Value = serde_json::from_str(&text).expect("reference data");
        let mut runs: Vec<Vec<[f64; 3]>> = Vec::new();
        let (mut run, mut last) = (String::new(), None);
        for point in value["points"].as_array().expect("points") {
            let p = [0, 1, 2].map(|i| point["p"][i].as_f64().expect("a number"));
            let name = point["seg"].as_str().expect("a name");
            if name != run && name != "start" {
                runs.push(last.into_iter().collect());
                run = name.into();
            }
            if let Some(points) = runs.last_mut() {
                points.push(p);
            }
            last = Some(p);
        }
        Self { runs }
    }

    /// Distance of a point from the path, mm.
    pub fn distance(&self, p: [f64; 3]) -> f64 {
        self.runs.iter().map(|run| distance_from(run, p)).fold(f64::INFINITY, f64::min)
    }
}

fn distance_from(run: &[[f64; 3]], p: [f64; 3]) -> f64 {
    let nearest = (0..run.len()).min_by(|a, b| square(run[*a], p).total_cmp(&square(run[*b], p))).unwrap_or(0);
    let near = if run.len() == 2 { 0..1 } else { nearest.saturating_sub(2)..(nearest + 2).min(run.len() - 1) };
    near.map(|i| distance_from_piece(run, i, p)).fold(f64::INFINITY, f64::min)
}

/// Distance from the cubic between points `i` and `i + 1` with central slopes (uniform points; error below 0.1 um for 0.5 mm on 12 mm radius).
fn distance_from_piece(run: &[[f64; 3]], i: usize, p: [f64; 3]) -> f64 {
    let (a, b) = (run[i], run[i + 1]);
    let slope = |k: usize| -> [f64; 3] {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(run.len() - 1));
        std::array::from_fn(|c| (run[to][c] - run[from][c]) / (to - from) as f64)
    };
    let (va, vb) = (slope(i), slope(i + 1));
    let at = |u: f64| -> [f64; 3] {
        std::array::from_fn(|c| {
            let d = b[c] - a[c];
            a[c] + u * (va[c] + u * (3.0 * d - 2.0 * va[c] - vb[c] + u * (va[c] + vb[c] - 2.0 * d)))
        })
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let (one, two) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if square(at(one), p) < square(at(two), p) { high = two } else { low = one }
    }
    square(at(0.5 * (low + high)), p).sqrt()
}

fn square(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum()
}
