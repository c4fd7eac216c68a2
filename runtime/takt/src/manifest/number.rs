//! Arithmetic in the manifest: `"1048576 * 50 / 360"`.

/// The value of an expression of numbers with `+ - * / ( )`; an error says what was expected and at which byte.
pub(super) fn evaluate(text: &str) -> Result<f64, (usize, &'static str)> {
    let mut expression = Expression { text, at: 0, depth: 0 };
    let value = expression.sum()?;
    match expression.peek() {
        None => Ok(value),
        Some(_) => Err((expression.at, "an operator")),
    }
}

/// Brackets nested deeper than this are refused.
const DEPTH: u32 = 32;

struct Expression<'a> {
    text: &'a str,
    at: usize,
    depth: u32,
}

impl Expression<'_> {
    fn peek(&mut self) -> Option<u8> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text.as_bytes().get(self.at).copied()
    }
    fn sum(&mut self) -> Result<f64, (usize, &'static str)> {
        let mut value = self.product()?;
        while let Some(sign @ (b'+' | b'-')) = self.peek() {
            self.at += 1;
            let right = self.product()?;
            value = if sign == b'+' { value + right } else { value - right };
        }
        Ok(value)
    }
    fn product(&mut self) -> Result<f64, (usize, &'static str)> {
        let mut value = self.factor()?;
        while let Some(sign @ (b'*' | b'/')) = self.peek() {
            self.at += 1;
            let right = self.factor()?;
            value = if sign == b'*' { value * right } else { value / right };
        }
        Ok(value)
    }
    fn factor(&mut self) -> Result<f64, (usize, &'static str)> {
        match self.peek() {
            Some(b'(') if self.depth < DEPTH => {
                self.at += 1;
                self.depth += 1;
                let value = self.sum()?;
                self.depth -= 1;
                if self.peek() != Some(b')') {
                    return Err((self.at, "`)`"));
                }
                self.at += 1;
                Ok(value)
            }
            Some(b'(') => Err((self.at, "fewer brackets")),
            Some(b'-') if self.depth < DEPTH => {
                self.at += 1;
                self.depth += 1;
                let value = self.factor()?;
                self.depth -= 1;
                Ok(-value)
            }
            _ => self.number(),
        }
    }
    fn number(&mut self) -> Result<f64, (usize, &'static str)> {
        let bytes = self.text.as_bytes();
        let start = self.at;
        let mut end = start;
        while let Some(byte) = bytes.get(end) {
            let after_exponent = end > start && matches!(bytes[end - 1], b'e' | b'E');
            let more =
                byte.is_ascii_digit() || matches!(byte, b'.' | b'_' | b'e' | b'E') || (after_exponent && matches!(byte, b'+' | b'-'));
            if !more {
                break;
            }
            end += 1;
        }
        let digits = self.text[start..end].replace('_', "");
        let value: f64 = digits.parse().map_err(|_| (start, "a number"))?;
        self.at = end;
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::evaluate;

    #[test]
    fn follows_the_rules_of_school() {
        assert_eq!(evaluate("1048576 * 50 / 360"), Ok(1_048_576.0 * 50.0 / 360.0));
        assert_eq!(evaluate("2 + 3 * (4 - 1)"), Ok(11.0));
        assert_eq!(evaluate("-2e3 / -1_000"), Ok(2.0));
        assert_eq!(evaluate("8388608 / 5.0"), Ok(8_388_608.0 / 5.0));
    }

    #[test]
    fn says_where_it_stops() {
        assert_eq!(evaluate("2 *"), Err((3, "a number")));
        assert_eq!(evaluate("(2"), Err((2, "`)`")));
        assert_eq!(evaluate("2 3"), Err((2, "an operator")));
        assert_eq!(evaluate("十"), Err((0, "a number")));
        assert!(evaluate(&"(".repeat(100)).is_err());
        assert!(evaluate(&"-".repeat(100_000)).is_err());
    }
}
