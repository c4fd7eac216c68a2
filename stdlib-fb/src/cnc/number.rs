//! Numbers of G-code: decimal, exact, fast.
//!
//! [`read`] gives exactly what `str::parse::<f64>` gives. Up to 15 digits the value is one division of two exact doubles, so it is rounded once;
//! longer numbers go the slow way.

use super::trouble::Kind;

/// No value in a G-code file may be larger, in any unit.
pub const LARGEST: f64 = 1e9;

const TENS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Reads a number at `at` and returns it with the index behind it.
pub fn read(line: &[u8], at: usize) -> Result<(f64, usize), Kind> {
    let negative = matches!(line.get(at), Some(b'-'));
    let digits_at = at + usize::from(matches!(line.get(at), Some(b'-' | b'+')));
    let (mut mantissa, mut i) = digits(line, digits_at, 0);
    let (mut seen, mut fraction) = (i - digits_at, 0);
    if line.get(i) == Some(&b'.') {
        let start = i + 1;
        (mantissa, i) = digits(line, start, mantissa);
        fraction = i - start;
        seen += fraction;
    }
    if seen == 0 {
        return Err(not_a_number(&line[at..]));
    }
    let value = if seen <= 15 { mantissa as f64 / TENS[fraction] } else { slow(&line[digits_at..i])? };
    if matches!(line.get(i), Some(b'e' | b'E')) && exponent_follows(line, i + 1) {
        return Err(if exponent(line, i + 1, value) { Kind::OutOfRange } else { Kind::Exponent });
    }
    if value > LARGEST {
        return Err(Kind::OutOfRange);
    }
    if line.get(i) == Some(&b'.') {
        return Err(Kind::NumberInvalid);
    }
    Ok((if negative { -value } else { value }, i))
}

/// Goes on with `mantissa` over the digits at `i`; it wraps where there are too many.
#[inline]
fn digits(line: &[u8], mut i: usize, mut mantissa: u64) -> (u64, usize) {
    while let Some(d) = digit(line, i) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(d);
        i += 1;
    }
    (mantissa, i)
}

#[inline]
fn digit(line: &[u8], i: usize) -> Option<u64> {
    let d = line.get(i)?.wrapping_sub(b'0');
    (d < 10).then_some(d.into())
}

fn slow(digits: &[u8]) -> Result<f64, Kind> {
    std::str::from_utf8(digits).ok().and_then(|text| text.parse().ok()).ok_or(Kind::NumberInvalid)
}

fn not_a_number(rest: &[u8]) -> Kind {
    let head = |n: usize| rest.get(..n).unwrap_or(&[]);
    let rest_signed = rest.strip_prefix(b"-").or(rest.strip_prefix(b"+"));
    let signed = |n: usize| rest_signed.and_then(|r| r.get(..n)).unwrap_or(&[]);
    let named = |text: &[u8]| text.eq_ignore_ascii_case(b"nan") || text.eq_ignore_ascii_case(b"inf");
    if named(head(3)) || named(signed(3)) || rest_signed.is_some() { Kind::NumberInvalid } else { Kind::NumberMissing }
}

fn exponent_follows(line: &[u8], i: usize) -> bool {
    let i = i + usize::from(matches!(line.get(i), Some(b'-' | b'+')));
    digit(line, i).is_some()
}

/// Whether the exponent at `i` makes `value` too large.
fn exponent(line: &[u8], i: usize, value: f64) -> bool {
    if matches!(line.get(i), Some(b'-')) || value == 0.0 {
        return false;
    }
    let mut i = i + usize::from(line.get(i) == Some(&b'+'));
    let mut power = 0u64;
    while let Some(d) = digit(line, i) {
        power = power.saturating_mul(10).saturating_add(d);
        i += 1;
    }
    let steps = usize::try_from(power).unwrap_or(usize::MAX).min(15);
    power > 30 || value * TENS[steps] > LARGEST
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: f64) {
        let (value, end) = read(text.as_bytes(), 0).unwrap_or_else(|e| panic!("{text}: {e:?}"));
        assert_eq!((value.to_bits(), end), (expected.to_bits(), text.len()), "{text}");
    }

    #[test]
    fn numbers_are_exactly_those_of_the_standard_library() {
        for text in ["0", "-0", "1", "+1", "-12.500", ".5", "5.", "0.1", "83.251", "123456789.123456", "0.000000000000001", "00012.30"] {
            check(text, text.parse().expect("a number"));
        }
        let long =
            ["0.1000000000000000055511151231257827", "999999999.99999999999999999", "16.4250000000000007105427357601001858711242675781250"];
        for text in long {
            check(text, text.parse().expect("a number"));
        }
        let mut seed = 1u64;
        for _ in 0..200_000 {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let value = (seed >> 11) as f64 / 1e9 - 4e6;
            for text in [format!("{value}"), format!("{value:.3}"), format!("{value:.5}")] {
                check(&text, text.parse().expect("a number"));
            }
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for (text, kind) in [
            ("", Kind::NumberMissing),
            ("Y", Kind::NumberMissing),
            ("NaN", Kind::NumberInvalid),
            ("-inf", Kind::NumberInvalid),
            ("-", Kind::NumberInvalid),
            (".", Kind::NumberMissing),
            ("1.2.3", Kind::NumberInvalid),
            ("1e308", Kind::OutOfRange),
            ("1E+12", Kind::OutOfRange),
            ("1e99999999999999999999", Kind::OutOfRange),
            ("1e2", Kind::Exponent),
            ("1000000001", Kind::OutOfRange),
            ("99999999999999999999999999999999", Kind::OutOfRange),
        ] {
            assert_eq!(read(text.as_bytes(), 0), Err(kind), "{text}");
        }
        assert_eq!(read(b"10 E5", 0), Ok((10.0, 2)));
        assert_eq!(read(b"10Y5", 0), Ok((10.0, 2)));
    }
}
