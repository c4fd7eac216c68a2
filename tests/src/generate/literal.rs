//! Literals of every type, with the values at which mistakes hide.

use super::Generator;
use super::shape::{Class, Scalar, named};

const REALS: &[&str] = &[
    "0.0",
    "1.0",
    "-1.0",
    "0.5",
    "2.5",
    "-2.5",
    "3.14159",
    "1.0E10",
    "-1.0E-10",
    "123456.789",
    "1.0E38",
    "16777217.0",
    "9.3E18",
    "-9.3E18",
];
const LREALS: &[&str] = &["1.0E300", "-1.0E300", "1.0E-300", "4.9E-324", "9007199254740993.0", "1.8E19"];
const DATES: &[&str] = &["1970-01-01", "2000-02-29", "2024-12-31", "2038-01-19"];
const CLOCKS: &[&str] = &["00:00:00", "12:34:56", "23:59:59", "06:00:00.5"];
const WORDS: &[&str] = &["", "a", "Takt", "0", "-12", "3.5", "TRUE", "hello world", "9999999999999999999999", "T#5s", "$N$$"];

impl Generator {
    /// Lowest and highest value of an integer type.
    fn limits(s: &Scalar) -> (i128, i128) {
        if s.signed { (-(1i128 << (s.bits - 1)), (1i128 << (s.bits - 1)) - 1) } else { (0, (1i128 << s.bits) - 1) }
    }

    /// A value of an integer type, often at an edge.
    pub(super) fn integer(&mut self, s: &Scalar) -> i128 {
        let (low, high) = Self::limits(s);
        let word = i128::from(self.random.word() as i64);
        let value = match self.random.below(10) {
            0 => low,
            1 => high,
            2 => high - 1,
            3 => -1,
            4 => word.rem_euclid(high - low + 1) + low,
            5 => 1i128 << self.random.below(s.bits as usize),
            _ => word.rem_euclid(12),
        };
        if (low..=high).contains(&value) { value } else { 1 }
    }

    /// A typed literal of an elementary type.
    pub(super) fn literal(&mut self, s: &'static Scalar) -> String {
        match s.class {
            Class::Bool => self.random.pick(&["TRUE", "FALSE", "BOOL#1"]).into(),
            Class::Int => {
                let value = self.integer(s);
                match self.random.below(4) {
                    0 if value >= 0 => format!("{}#16#{value:X}", s.name),
                    _ => format!("{}#{value}", s.name),
                }
            }
            Class::Real => {
                let wide = s.bits == 64 && self.random.chance(30);
                let value = self.random.pick(if wide { LREALS } else { REALS });
                format!("{}#{value}", s.name)
            }
            Class::Duration if s.bits == 32 => {
                let ms = self.integer(named("UDINT"));
                format!("T#{ms}ms")
            }
            Class::Duration => {
                let ns = self.integer(named("LINT")).max(i64::MIN as i128 + 1);
                if ns < 0 { format!("(-LTIME#{}ns)", -ns) } else { format!("LTIME#{ns}ns") }
            }
            Class::Moment => self.moment_literal(s.name),
            Class::Char => format!("{}#{}", s.name, if s.bits == 8 { self.random.pick(&["'a'", "'Z'", "'0'"]) } else { "\"w\"" }),
        }
    }

    fn moment_literal(&mut self, name: &str) -> String {
        let (date, clock) = (self.random.pick(DATES), self.random.pick(CLOCKS));
        match name {
            "DATE" => format!("D#{date}"),
            "LDATE" => format!("LDATE#{date}"),
            "TOD" => format!("TOD#{clock}"),
            "LTOD" => format!("LTOD#{clock}"),
            "DT" => format!("DT#{date}-{clock}"),
            _ => format!("LDT#{date}-{clock}"),
        }
    }

    /// A literal without a type that fits every integer type.
    pub(super) fn small(&mut self) -> String {
        self.random.below(101).to_string()
    }

    /// A literal of type STRING.
    pub(super) fn quoted(&mut self) -> String {
        format!("'{}'", self.random.pick(WORDS))
    }

    /// A literal of type WSTRING.
    pub(super) fn double_quoted(&mut self) -> String {
        format!("\"{}\"", self.random.pick(WORDS))
    }

    /// An integer literal that is not 0.
    pub(super) fn divisor_literal(&mut self, s: &'static Scalar) -> String {
        match self.integer(s) {
            0 => format!("{}#3", s.name),
            value => format!("{}#{value}", s.name),
        }
    }
}
