//! Durations as people write them: `500ms`, `1m30s`, `2.5s`.

use takt_abi::Time;

/// Units by name, in nanoseconds.
const UNITS: [(&str, f64); 6] = [("h", 3.6e12), ("m", 6e10), ("s", 1e9), ("ms", 1e6), ("us", 1e3), ("ns", 1.0)];

/// A duration that is not one.
pub const DURATION_HELP: &str = "write a number and a unit, like \"500ms\", \"10s\" or \"1m30s\"; units are h, m, s, ms, us, ns";

/// Reads a duration: numbers with units, one after the other. At most 292 years; never negative.
pub fn parse_duration(text: &str) -> Option<Time> {
    let mut rest = text.trim();
    let mut nanoseconds = 0.0;
    if rest.is_empty() {
        return None;
    }
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.' && c != '_').filter(|n| *n > 0)?;
        let number: f64 = rest[..digits].replace('_', "").parse().ok()?;
        rest = &rest[digits..];
        let letters = rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len());
        let (_, unit) = UNITS.iter().find(|(name, _)| rest[..letters].eq_ignore_ascii_case(name))?;
        nanoseconds += number * unit;
        rest = &rest[letters..];
    }
    (nanoseconds < 9.2e18).then_some(Time(nanoseconds.round() as i64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_units_one_after_the_other() {
        assert_eq!(parse_duration("500ms"), Some(Time::from_millis(500)));
        assert_eq!(parse_duration("1m30s"), Some(Time::from_millis(90_000)));
        assert_eq!(parse_duration("2.5s"), Some(Time::from_millis(2500)));
        assert_eq!(parse_duration("250us"), Some(Time(250_000)));
    }

    #[test]
    fn refuses_what_has_no_unit_or_no_number() {
        for text in ["", "10", "s", "-1s", "1x", "1..2s", "1e300s", "999999999999h", "ß"] {
            assert_eq!(parse_duration(text), None, "{text}");
        }
    }
}
