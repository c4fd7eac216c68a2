//! Random expressions. Each is in brackets, has the type that is asked for (or one that converts to it with a warning at the most), and is never a
//! constant where a constant could be refused: as a divisor, an index or the value of a subrange.

use super::Generator;
use super::shape::{Class, SCALARS, Scalar, Shape, named};

const REAL_FUNCTIONS: &[&str] = &["SQRT", "LN", "LOG", "EXP", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "FLOOR", "CEIL"];
const COMPARISONS: &[&str] = &["=", "<>", "<", "<=", ">", ">="];
const COMPARISON_FUNCTIONS: &[&str] = &["EQ", "NE", "LT", "LE", "GT", "GE"];

impl Generator {
    /// A value for a place of this type. The type is one that an assignment fills.
    pub(super) fn value(&mut self, shape: &Shape, depth: usize) -> String {
        match shape {
            Shape::Scalar(s) => self.scalar_value(s, depth),
            Shape::Text(_) => self.text(depth),
            Shape::Wide(_) => self.wide(),
            Shape::Enumeration(i) => self.enumerator(*i),
            Shape::Range(i) => self.in_range(*i),
            Shape::Pointer(to) => self.pointer(to),
            _ => "0".into(),
        }
    }

    fn scalar_value(&mut self, s: &'static Scalar, depth: usize) -> String {
        if self.random.chance(12)
            && let Some(call) = self.function_call(&Shape::Scalar(s), depth)
        {
            return call;
        }
        if self.random.chance(15) {
            return self.place(s).unwrap_or_else(|| self.literal(s));
        }
        match s.class {
            Class::Bool => self.boolean(depth),
            Class::Int => self.int(depth),
            Class::Real => self.real(s, depth),
            Class::Duration => self.duration(s, depth),
            Class::Moment => self.moment(s, depth),
            Class::Char => self.character(s),
        }
    }

    fn enumerator(&mut self, i: usize) -> String {
        let place = self.reach(&|s| *s == Shape::Enumeration(i), false);
        match place {
            Some((path, _)) if self.random.chance(40) => path,
            _ => {
                let e = &self.enumerations[i];
                format!("{}.{}", e.name, e.members[self.random.below(e.members.len())])
            }
        }
    }

    fn in_range(&mut self, i: usize) -> String {
        let range = self.ranges[i].clone();
        match self.place(range.base) {
            Some(path) if self.random.chance(60) => format!("LIMIT({}, {path}, {})", range.low, range.high),
            _ => (range.low + self.random.below((range.high - range.low + 1) as usize) as i64).to_string(),
        }
    }

    /// A pointer to this type; in a wild program it may be forged.
    pub(super) fn pointer(&mut self, to: &Shape) -> String {
        let forged = self.wild && self.random.chance(35);
        let target = self.reach(&|s| s == to, true);
        match target {
            _ if forged => {
                let word = named(self.random.pick(&["LWORD", "ULINT", "LINT"]));
                self.place(word).filter(|_| self.random.chance(50)).unwrap_or_else(|| self.literal(word))
            }
            Some((path, _)) if self.wild && self.random.chance(20) => format!("ADR({path}) + {}", self.random.below(64)),
            Some((path, _)) => format!("ADR({path})"),
            None => "0".into(),
        }
    }

    /// An integer expression; its type is left to chance.
    pub(super) fn int(&mut self, depth: usize) -> String {
        let s =
            named(self.random.pick(&[
                "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "BYTE", "WORD", "DWORD", "LWORD", "INT", "DINT",
            ]));
        let place = match self.random.below(4) {
            0 => self.place(s).map(|p| (p, s)),
            _ => self.place_of(Class::Int),
        };
        let Some((path, of)) = place else { return self.literal(s) };
        if depth == 0 {
            return if self.random.chance(20) { self.literal(s) } else { path };
        }
        let d = depth - 1;
        match self.random.below(32) {
            0..=7 => self.arithmetic(path, of, d),
            8..=9 => format!("({path} {} {})", self.random.pick(&["+", "-", "*", "AND", "OR", "XOR", "MOD"]), self.small()),
            10 => format!("(-{path})"),
            11 => format!("(NOT {path})"),
            12 => format!("ABS({})", self.int(d)),
            13 => format!("{}({}, {path})", self.random.pick(&["MIN", "MAX"]), self.int(d)),
            14 => format!("LIMIT({}, {path}, {})", self.int(d), self.int(d)),
            15 => format!("SEL({}, {path}, {})", self.boolean(d), self.int(d)),
            16 => format!("MUX({}, {path}, {}, {})", self.int(0), self.int(d), self.int(d)),
            17 | 18 => self.shift(&path, d),
            19 => self.conversion(s, d),
            20 => self.power(&path, d),
            21 => self.part(&path, of),
            22 => self.int_of_real(d),
            23 => format!("({path} + {})", self.text_measure()),
            24 => format!("FIND({}, {})", self.text(0), self.text(0)),
            25 => self.of_pointers().unwrap_or(path),
            26 => format!("STRING_TO_{}({})", s.name, self.text(d)),
            27 => self.ratio().unwrap_or(path),
            28 => format!("{}({path}, {})", self.random.pick(&["ADD", "SUB", "MUL", "MOD"]), self.int(d)),
            29 => self.shifted_literal(&path, d),
            30 => format!("DIV({path}, {})", self.divisor(of)),
            _ => path,
        }
    }

    /// A number that a string has; SIZEOF is a literal, which a narrow type may not hold by itself.
    fn text_measure(&mut self) -> String {
        let text = self.plain(&|s| matches!(s, Shape::Text(_)));
        match text {
            Some(path) => format!("{}({path})", self.random.pick(&["LEN", "SIZEOF"])),
            None => format!("LEN({})", self.quoted()),
        }
    }

    fn arithmetic(&mut self, path: String, of: &'static Scalar, d: usize) -> String {
        let op = self.random.pick(&["+", "-", "*", "/", "/", "MOD", "AND", "OR", "XOR"]);
        let other = match op {
            "/" => self.divisor(of),
            _ => self.int(d),
        };
        if op != "/" && self.random.chance(40) { format!("({other} {op} {path})") } else { format!("({path} {op} {other})") }
    }

    /// A divisor: never 0 in a tame program.
    pub(super) fn divisor(&mut self, of: &'static Scalar) -> String {
        let place = if self.random.chance(60) { self.place_of(Class::Int) } else { None };
        match place {
            Some((path, _)) if self.wild && self.random.chance(40) => path,
            Some((path, _)) => format!("SEL({path} = 0, {path}, {})", self.random.below(9) + 1),
            None => self.divisor_literal(of),
        }
    }

    fn shift(&mut self, path: &str, d: usize) -> String {
        let name = self.random.pick(&["SHL", "SHR", "ROL", "ROR"]);
        let count = match self.random.below(4) {
            0 => self.int(d),
            1 => self.literal(named("LINT")),
            _ => self.random.pick(&["0", "1", "7", "8", "15", "16", "31", "32", "33", "63", "64", "70", "-1"]).into(),
        };
        format!("{name}({path}, {count})")
    }

    /// A literal shifted by a variable, alone or beside another.
    fn shifted_literal(&mut self, path: &str, d: usize) -> String {
        let literal = self.random.pick(&["0", "1", "255", "16#FFFF", "16#1_0000_0000"]);
        let name = self.random.pick(&["SHL", "SHR", "ROL", "ROR"]);
        let op = self.random.pick(&["AND", "OR", "XOR", "+", "-", "*"]);
        match self.random.below(3) {
            0 => format!("{name}({literal}, {path})"),
            1 => format!("({path} {op} {name}({literal}, {}))", self.int(d)),
            _ => format!("({name}({literal}, {path}) {op} {})", self.int(d)),
        }
    }

    /// `X_TO_Y` from an integer, or `TO_Y` from anything scalar.
    fn conversion(&mut self, to: &'static Scalar, d: usize) -> String {
        let from = &SCALARS[self.random.below(SCALARS.len())];
        let value = self.scalar_value(from, d);
        let place = self.place(from);
        match (place, self.random.below(3)) {
            (Some(path), 0) => format!("{}_TO_{}({path})", from.name, to.name),
            (_, 1) => format!("TO_{}({value})", to.name),
            _ => format!("{}_TO_{}({value})", from.name, to.name),
        }
    }

    fn power(&mut self, path: &str, d: usize) -> String {
        if self.random.chance(50) { format!("TO_LINT(EXPT({path}, {}))", self.int(d)) } else { format!("({path} ** {})", self.int(d)) }
    }

    /// A part of an integer variable.
    fn part(&mut self, path: &str, of: &Scalar) -> String {
        let widths: Vec<(&str, u32)> = [("B", 8), ("W", 16), ("D", 32)].into_iter().filter(|(_, w)| *w < of.bits).collect();
        match widths.get(self.random.below(widths.len())) {
            Some((letter, width)) => format!("{path}.%{letter}{}", self.random.below((of.bits / width) as usize)),
            None => path.into(),
        }
    }

    fn int_of_real(&mut self, d: usize) -> String {
        let real = named(self.random.pick(&["REAL", "LREAL"]));
        let value = self.place(real).filter(|_| d == 0).unwrap_or_else(|| self.real(real, d));
        let to = named(self.random.pick(&["INT", "DINT", "LINT", "ULINT", "BYTE"])).name;
        match self.random.below(4) {
            0 => format!("TRUNC({value})"),
            1 => format!("ROUND({value})"),
            2 => format!("TO_{to}({value})"),
            _ => format!("{}_TO_{to}({value})", real.name),
        }
    }

    fn of_pointers(&mut self) -> Option<String> {
        let a = self.plain(&|s| matches!(s, Shape::Pointer(_)))?;
        let b = self.plain(&|s| matches!(s, Shape::Pointer(_)))?;
        Some(format!("({a} - {b})"))
    }

    /// A duration divided by a duration.
    fn ratio(&mut self) -> Option<String> {
        let (a, s) = self.place_of(Class::Duration)?;
        let zero = if s.bits == 32 { "T#0ms" } else { "LTIME#0ns" };
        let b = self.place(s)?;
        Some(if self.wild {
            format!("({a} / {b})")
        } else {
            format!("({a} / SEL({b} = {zero}, {b}, {}3{}))", &zero[..zero.len() - 3], &zero[zero.len() - 2..])
        })
    }

    /// An expression of REAL or LREAL.
    pub(super) fn real(&mut self, s: &'static Scalar, depth: usize) -> String {
        let place = self.place(s);
        let path = place.unwrap_or_else(|| self.literal(s));
        if depth == 0 {
            return if self.random.chance(25) { self.literal(s) } else { path };
        }
        let d = depth - 1;
        match self.random.below(20) {
            0..=5 => format!("({path} {} {})", self.random.pick(&["+", "-", "*", "/"]), self.real(s, d)),
            6 => format!("(-{path})"),
            7..=10 => format!("{}({})", self.random.pick(REAL_FUNCTIONS), self.real(s, d)),
            11 => format!("ATAN2({path}, {})", self.real(s, d)),
            12 => format!("({path} ** {})", self.real(s, d)),
            _ if self.random.chance(4) => format!("EXPT({path}, {})", if self.random.chance(50) { self.real(s, d) } else { self.int(d) }),
            _ if self.random.chance(4) => format!("MUX({}, {path}, {}, {})", self.int(0), self.real(s, 0), self.int(d)),
            13 => format!("ABS({})", self.real(s, d)),
            14 => format!("{}({path}, {})", self.random.pick(&["MIN", "MAX"]), self.real(s, d)),
            15 => format!("SEL({}, {path}, {})", self.boolean(d), self.real(s, d)),
            16 if self.random.chance(40) => format!("STRING_TO_{}({})", s.name, self.text(d)),
            16 => self.conversion(s, d),
            17 => {
                let word = named(self.random.pick(&["ULINT", "LWORD"]));
                let value = self.place(word).unwrap_or_else(|| self.int(0));
                let not = self.random.pick(&["", "NOT "]);
                format!("TO_{}({not}{value})", s.name)
            }
            18 => format!("LIMIT({}, {path}, {})", self.real(s, 0), self.real(s, 0)),
            19 => format!("({path} {} {})", self.random.pick(&["+", "-", "*", "/"]), self.int(d)),
            _ => path,
        }
    }

    /// A BOOL expression.
    pub(super) fn boolean(&mut self, depth: usize) -> String {
        let bool_type = named("BOOL");
        let path = self.place(bool_type).unwrap_or_else(|| self.literal(bool_type));
        if depth == 0 {
            return path;
        }
        let d = depth - 1;
        match self.random.below(16) {
            0..=4 => self.comparison(d),
            5..=7 => {
                let op = self.random.pick(&["AND", "OR", "XOR", "AND_THEN", "OR_ELSE", "AND_THEN", "=", "<>", "<", "<=", ">", ">="]);
                let right = if self.random.chance(10) { self.random.pick(&["0", "1"]).into() } else { self.boolean(d) };
                format!("({} {op} {right})", self.boolean(d))
            }
            8 => format!("(NOT {})", self.boolean(d)),
            9 => format!("SEL({path}, {}, {})", self.boolean(d), self.boolean(d)),
            10 | 11 => match self.place_of(Class::Int) {
                Some((path, s)) => format!("{path}.{}", self.random.below(s.bits as usize)),
                None => path,
            },
            12 => self.conversion(bool_type, d),
            _ => path,
        }
    }

    fn comparison(&mut self, d: usize) -> String {
        let sign = self.random.below(6);
        let (a, b) = self.two(d);
        if self.random.chance(15) {
            format!("{}({a}, {b})", COMPARISON_FUNCTIONS[sign])
        } else {
            format!("({a} {} {b})", COMPARISONS[sign])
        }
    }

    /// Two values that can be compared.
    fn two(&mut self, d: usize) -> (String, String) {
        match self.random.below(12) {
            0..=4 => (self.int(d), if self.random.chance(30) { self.small() } else { self.int(d) }),
            5 | 6 => {
                let s = named(self.random.pick(&["REAL", "LREAL"]));
                (self.real(s, d), self.real(s, d))
            }
            7 => {
                let s = named(self.random.pick(&["TIME", "LTIME"]));
                (self.duration(s, d), self.duration(s, d))
            }
            8 => {
                let s = named(self.random.pick(&["DATE", "TOD", "DT", "LDATE", "LTOD", "LDT"]));
                (self.moment(s, 0), self.moment(s, d))
            }
            9 => (self.text(d), self.text(0)),
            10 => (self.wide(), self.wide()),
            _ => {
                let s = named(self.random.pick(&["CHAR", "WCHAR"]));
                (self.character(s), self.character(s))
            }
        }
    }

    /// An expression of TIME or LTIME.
    fn duration(&mut self, s: &'static Scalar, depth: usize) -> String {
        let path = self.place(s).unwrap_or_else(|| self.literal(s));
        if depth == 0 {
            return path;
        }
        let d = depth - 1;
        match self.random.below(13) {
            0 => self.literal(s),
            1..=3 => format!("({path} {} {})", self.random.pick(&["+", "-"]), self.duration(s, d)),
            4 => format!("({path} * {})", self.int(d)),
            5 => format!("({path} / {})", self.divisor(named("INT"))),
            6 => format!("({path} {} {})", self.random.pick(&["*", "/"]), self.real(named("LREAL"), d)),
            7 => format!("{}({path}, {})", self.random.pick(&["MIN", "MAX"]), self.duration(s, d)),
            8 => if s.bits == 32 { "TIME()" } else { "LTIME()" }.into(),
            9 => self.conversion(s, d),
            10 => {
                let dates = if s.bits == 32 { ["DT", "DATE", "TOD"] } else { ["LDT", "LDATE", "LTOD"] };
                let date = named(self.random.pick(&dates));
                format!("({} - {})", self.moment(date, 0), self.moment(date, d))
            }
            11 => self.chosen_duration(s, path, d),
            _ => format!("({path} MOD {})", self.duration(s, 0)),
        }
    }

    fn chosen_duration(&mut self, s: &'static Scalar, path: String, d: usize) -> String {
        match self.random.below(5) {
            0 => format!("(-{path})"),
            1 => format!("SEL({}, {path}, {})", self.boolean(d), self.duration(s, d)),
            2 => format!("LIMIT({}, {path}, {})", self.duration(s, 0), self.duration(s, d)),
            3 => format!("MUX({}, {path}, {})", self.int(0), self.duration(s, d)),
            _ => format!("({} * {path})", if self.random.chance(50) { self.int(d) } else { self.real(named("REAL"), d) }),
        }
    }

    /// An expression of a date type.
    fn moment(&mut self, s: &'static Scalar, depth: usize) -> String {
        let path = self.place(s).unwrap_or_else(|| self.literal(s));
        let duration = named(if s.bits == 32 || self.random.chance(30) { "TIME" } else { "LTIME" });
        match self.random.below(8) {
            6 if depth > 0 => format!("{}({path}, {})", self.random.pick(&["MIN", "MAX"]), self.moment(s, depth - 1)),
            7 if depth > 0 => format!("SEL({}, {path}, {})", self.boolean(depth - 1), self.moment(s, 0)),
            0 => self.literal(s),
            1 | 2 if depth > 0 => format!("({path} {} {})", self.random.pick(&["+", "-"]), self.duration(duration, depth - 1)),
            3 if depth > 0 => self.conversion(s, depth - 1),
            _ => path,
        }
    }

    fn character(&mut self, s: &'static Scalar) -> String {
        match self.place(s) {
            Some(path) if self.random.chance(60) => path,
            _ if self.random.chance(30) => format!("TO_{}({})", s.name, self.int(0)),
            _ => self.literal(s),
        }
    }

    /// A STRING expression.
    pub(super) fn text(&mut self, depth: usize) -> String {
        let place = self.reach(&|s| matches!(s, Shape::Text(_)), false).map(|(path, _)| path);
        let path = place.unwrap_or_else(|| self.quoted());
        if depth == 0 {
            return if self.random.chance(30) { self.quoted() } else { path };
        }
        let d = depth - 1;
        match self.random.below(13) {
            0 => self.quoted(),
            1 => format!("CONCAT({}, {})", self.text(d), self.text(d)),
            2 => format!("{}({}, {})", self.random.pick(&["LEFT", "RIGHT"]), self.text(d), self.int(0)),
            3 => format!("MID({path}, {}, {})", self.int(0), self.int(0)),
            4 => format!("INSERT({path}, {}, {})", self.text(d), self.int(0)),
            5 => format!("DELETE({path}, {}, {})", self.int(0), self.int(0)),
            6 => format!("REPLACE({path}, {}, {}, {})", self.text(d), self.int(0), self.int(0)),
            7 => format!("SEL({}, {path}, {})", self.boolean(d), self.text(d)),
            8 => format!("MUX({}, {path}, {})", self.int(0), self.text(0)),
            9 | 10 => {
                let s = named(self.random.pick(&["BOOL", "INT", "LINT", "ULINT", "REAL", "LREAL", "TIME", "LTIME", "DATE", "TOD", "DT"]));
                format!("TO_STRING({})", self.scalar_value(s, d))
            }
            _ => path,
        }
    }

    fn wide(&mut self) -> String {
        let place = self.reach(&|s| matches!(s, Shape::Wide(_)), false).map(|(path, _)| path);
        place.filter(|_| self.random.chance(60)).unwrap_or_else(|| self.double_quoted())
    }
}
