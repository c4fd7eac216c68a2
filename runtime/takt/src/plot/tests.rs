//! The picture of a circle with dots; and of nothing.

use super::*;

fn circle() -> Data {
    let mut data = Data { frequency_limit: Some(50.0), has: Has { tcp: true, tool: true, speed: true, dots: true }, ..Data::default() };
    for i in 0..10_000 {
        let time = f64::from(i) * 1e-3;
        let ramp = (time * 10.0).min((10.0 - time) * 10.0).min(1.0);
        let (sin, cos) = (libm::sin(time * 0.6), libm::cos(time * 0.6));
        let tool = [time * 30.0, -20.0];
        let sample = Sample { time, tcp: [50.0 * cos, 50.0 * sin, 5.0], speed: 20.0 * ramp, tool, valve: 0.0 };
        if i % 83 == 0 {
            data.dots.push(sample);
        }
        data.samples.push(sample);
    }
    data
}

#[test]
fn a_run_has_four_pictures() {
    let svg = draw(&circle());
    for text in
        ["Path of the tool centre point", "Tool axes and dots", "121 dots", "v / (mm/s)", "f / Hz", "at most 50 Hz", "t / s", "Z / mm"]
    {
        assert!(svg.contains(text), "{text}");
    }
    assert!(svg.matches("class=\"dot\"").count() > 120 && svg.matches("class=\"tool\"").count() > 20);
    assert!(svg.len() < 200_000, "{} bytes", svg.len());
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "only numbers");
    assert_eq!(svg, draw(&circle()), "the same data give the same bytes");
}

#[test]
fn a_run_without_data_is_drawn_too() {
    let svg = draw(&Data::default());
    assert_eq!(svg.matches("names no variable").count(), 4);
    let nan = Sample { time: 0.0, tcp: [f64::NAN; 3], speed: f64::INFINITY, tool: [f64::NAN; 2], valve: 0.0 };
    let has = Has { tcp: true, tool: true, speed: true, dots: true };
    let svg = draw(&Data { samples: vec![nan; 3], dots: vec![nan; 3], frequency_limit: None, has });
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}
