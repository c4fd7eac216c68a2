//! FB_FormatString of Tc2_Utilities: arguments by address, put into a text as its format says.
//!
//! `%[flags][width][.precision]type`: flags `-` (to the left), `+` and blank (sign), `0` (filled with zeros), `#` (prefix of the base); width and precision are
//! numbers, or `*` for an argument. Nothing in the arguments is trusted: addresses are checked, an unknown type is an error.

use super::Line;
use takt_abi::{Cx, Dword, Fault, FnDesc, Plain, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[Format::DESC];

/// Bytes of a T_Arg: eType, cbLen, pData.
const ARGUMENT: u64 = 16;
/// The widest field and the highest precision.
const WIDEST: usize = 255;

/// Why a format is refused: the codes of TwinCAT, to which the number of the argument is added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
enum Trouble {
    Percent = 0x10,
    Width = 0x40,
    Precision = 0x80,
    Type = 0x800,
    Different = 0x1000,
    TooMany = 0x4000,
    TooLong = 0x8000,
    Pointer = 0x1_0000,
}

/// A format that was refused, or a fault of an address.
enum Stop {
    Refused(Trouble),
    Fault(Fault),
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// The value of an argument.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    Signed(i64, u32),
    Unsigned(u64, u32),
    Real(f64, u64, u32),
    Text(u64, u64),
    Bool(bool),
}

/// What stands between `%` and the type.
#[derive(Debug, Clone, Copy, Default)]
struct Spec {
    left: bool,
    plus: bool,
    blank: bool,
    zeros: bool,
    prefix: bool,
    width: usize,
    precision: Option<usize>,
}

/// The arguments, taken one after the other.
struct Arguments {
    at: u64,
    left: u32,
    taken: u32,
}

impl Arguments {
    fn next(&mut self, cx: &Cx<'_>) -> Result<Value, Stop> {
        self.taken += 1;
        if self.left == 0 {
            return Err(Stop::Refused(Trouble::TooMany));
        }
        let at = self.at;
        (self.at, self.left) = (at + ARGUMENT, self.left - 1);
        let (kind, length, data) = (cx.load::<i16>(at)?, cx.load::<u32>(at + 4)?, cx.load::<u64>(at + 8)?);
        if data == 0 {
            return Err(Stop::Refused(if kind == 0 { Trouble::TooMany } else { Trouble::Pointer }));
        }
        let signed = |size: u32, value: i64| Ok(Value::Signed(value, size * 8));
        let unsigned = |size: u32, value: u64| Ok(Value::Unsigned(value, size * 8));
        match kind {
            1 | 9 => unsigned(1, cx.load::<u8>(data)?.into()),
            2 | 10 => unsigned(2, cx.load::<u16>(data)?.into()),
            3 | 11 => unsigned(4, cx.load::<u32>(data)?.into()),
            15 | 16 | 19 | 21 => unsigned(8, cx.load::<u64>(data)?),
            4 => {
                let bits = cx.load::<u32>(data)?;
                Ok(Value::Real(f32::from_bits(bits).into(), bits.into(), 32))
            }
            5 => {
                let bits = cx.load::<u64>(data)?;
                Ok(Value::Real(f64::from_bits(bits), bits, 64))
            }
            6 => signed(1, cx.load::<i8>(data)?.into()),
            7 => signed(2, cx.load::<i16>(data)?.into()),
            8 => signed(4, cx.load::<i32>(data)?.into()),
            17 | 18 | 20 => signed(8, cx.load::<i64>(data)?),
            12 => Ok(Value::Text(data, length.into())),
            13 => Ok(Value::Bool(cx.load::<u8>(data)? != 0)),
            _ => Err(Stop::Refused(Trouble::Type)),
        }
    }

    /// `*`: an argument that is a number.
    fn number(&mut self, cx: &Cx<'_>, trouble: Trouble) -> Result<i64, Stop> {
        match self.next(cx)? {
            Value::Signed(value, _) => Ok(value),
            Value::Unsigned(value, _) => i64::try_from(value).map_err(|_| Stop::Refused(trouble)),
            _ => Err(Stop::Refused(trouble)),
        }
    }
}

/// Where the text goes.
struct Target {
    at: u64,
    left: u64,
}

impl Target {
    fn put(&mut self, cx: &mut Cx<'_>, bytes: &[u8]) -> Result<(), Stop> {
        let fits = bytes.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
        if fits > 0 {
            cx.bytes_mut(self.at, fits)?.copy_from_slice(&bytes[..fits]);
        }
        (self.at, self.left) = (self.at + fits as u64, self.left - fits as u64);
        if fits < bytes.len() { Err(Stop::Refused(Trouble::TooLong)) } else { Ok(()) }
    }
    fn fill(&mut self, cx: &mut Cx<'_>, byte: u8, count: usize) -> Result<(), Stop> {
        (0..count).try_for_each(|_| self.put(cx, &[byte]))
    }
}

/// The character of the format at `at`.
fn sign(cx: &mut Cx<'_>, at: u64) -> Result<u8, Stop> {
    *cx.fuel = cx.fuel.saturating_sub(1);
    Ok(cx.load::<u8>(at)?)
}

/// A number of the format.
fn digits(cx: &mut Cx<'_>, at: &mut u64, trouble: Trouble) -> Result<Option<usize>, Stop> {
    let mut number = None;
    loop {
        let byte = sign(cx, *at)?;
        if !byte.is_ascii_digit() {
            return Ok(number);
        }
        let value = number.unwrap_or(0) * 10 + usize::from(byte - b'0');
        if value > WIDEST {
            return Err(Stop::Refused(trouble));
        }
        number = Some(value);
        *at += 1;
    }
}

/// What stands between `%` and the type, which is left to be read.
fn spec(cx: &mut Cx<'_>, at: &mut u64, arguments: &mut Arguments) -> Result<Spec, Stop> {
    let mut spec = Spec::default();
    loop {
        match sign(cx, *at)? {
            b'-' => spec.left = true,
            b'+' => spec.plus = true,
            b' ' => spec.blank = true,
            b'0' => spec.zeros = true,
            b'#' => spec.prefix = true,
            _ => break,
        }
        *at += 1;
    }
    if sign(cx, *at)? == b'*' {
        *at += 1;
        let width = arguments.number(cx, Trouble::Width)?;
        spec.left |= width < 0;
        spec.width = usize::try_from(width.unsigned_abs()).ok().filter(|w| *w <= WIDEST).ok_or(Stop::Refused(Trouble::Width))?;
    } else {
        spec.width = digits(cx, at, Trouble::Width)?.unwrap_or(0);
    }
    if sign(cx, *at)? == b'.' {
        *at += 1;
        if sign(cx, *at)? == b'*' {
            *at += 1;
            let precision = arguments.number(cx, Trouble::Precision)?;
            spec.precision = Some(usize::try_from(precision).ok().filter(|p| *p <= WIDEST).ok_or(Stop::Refused(Trouble::Precision))?);
        } else {
            spec.precision = Some(digits(cx, at, Trouble::Precision)?.unwrap_or(0));
        }
    }
    Ok(spec)
}

/// A number without its sign, and its sign.
fn number(spec: &Spec, kind: u8, value: Value) -> Result<(Line, &'static [u8]), Stop> {
    use std::fmt::Write;
    let mut line = Line::new();
    let width_mask = |size: u32| if size >= 64 { u64::MAX } else { (1 << size) - 1 };
    let (negative, magnitude, bits) = match value {
        Value::Signed(value, size) => (value < 0, value.unsigned_abs(), value as u64 & width_mask(size)),
        Value::Unsigned(value, _) => (false, value, value),
        Value::Real(value, bits, _) => (value.is_sign_negative(), 0, bits),
        Value::Bool(value) => (false, value.into(), value.into()),
        Value::Text(..) => return Err(Stop::Refused(Trouble::Different)),
    };
    let real = if let Value::Real(value, ..) = value { Some(value) } else { None };
    let lead: &[u8] = match (negative, spec.plus, spec.blank) {
        (true, ..) => b"-",
        (_, true, _) => b"+",
        (_, _, true) => b" ",
        _ => b"",
    };
    let precision = spec.precision.unwrap_or(6);
    // A line cuts, it does not fail.
    let _ = match (kind, real) {
        (b'f' | b'F' | b'e' | b'E', Some(value)) if value.is_nan() => line.write_str("#QNAN"),
        (b'f' | b'F' | b'e' | b'E', Some(value)) if value.is_infinite() => line.write_str("#INF"),
        (b'f' | b'F', Some(value)) => write!(line, "{:.precision$}", value.abs()),
        (b'e' | b'E', Some(value)) => exponential(&mut line, value.abs(), precision, kind),
        (b'd' | b'D', None) => write!(line, "{magnitude}"),
        (b'u' | b'U', None) => write!(line, "{bits}"),
        (b'b' | b'B', _) => write!(line, "{bits:b}"),
        (b'o' | b'O', _) => write!(line, "{bits:o}"),
        (b'x', _) => write!(line, "{bits:x}"),
        (b'X', _) => write!(line, "{bits:X}"),
        _ => return Err(Stop::Refused(Trouble::Different)),
    };
    let lead = if matches!(kind, b'd' | b'D' | b'f' | b'F' | b'e' | b'E') { lead } else { b"" };
    Ok((line, lead))
}

/// `1.5e+003`.
fn exponential(line: &mut Line, value: f64, precision: usize, kind: u8) -> std::fmt::Result {
    use std::fmt::Write;
    let mut raw = Line::new();
    write!(raw, "{value:.precision$e}")?;
    let text = std::str::from_utf8(raw.bytes()).unwrap_or("");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    write!(line, "{mantissa}{}{sign}{:03}", char::from(kind), exponent.abs())
}

/// One place of the format.
fn place(cx: &mut Cx<'_>, spec: &Spec, kind: u8, value: Value, target: &mut Target) -> Result<(), Stop> {
    if matches!(kind, b's' | b'S' | b'c' | b'C') {
        return text(cx, spec, kind, value, target);
    }
    let is_real = matches!(kind, b'f' | b'F' | b'e' | b'E');
    let (digits, lead) = number(spec, kind, value)?;
    let prefix: &[u8] = match (spec.prefix, kind) {
        (true, b'b' | b'B') => b"2#",
        (true, b'o' | b'O') => b"8#",
        (true, b'x' | b'X') => b"16#",
        _ => b"",
    };
    let least = if is_real { 0 } else { spec.precision.unwrap_or(0) };
    let mut zeros = least.saturating_sub(digits.bytes().len());
    let used = lead.len() + prefix.len() + zeros + digits.bytes().len();
    let mut blanks = spec.width.saturating_sub(used);
    if spec.zeros && !spec.left {
        zeros += std::mem::take(&mut blanks);
    }
    if !spec.left {
        target.fill(cx, b' ', blanks)?;
    }
    target.put(cx, lead)?;
    target.put(cx, prefix)?;
    target.fill(cx, b'0', zeros)?;
    target.put(cx, digits.bytes())?;
    if spec.left { target.fill(cx, b' ', blanks) } else { Ok(()) }
}

/// `%s` and `%c`.
fn text(cx: &mut Cx<'_>, spec: &Spec, kind: u8, value: Value, target: &mut Target) -> Result<(), Stop> {
    let most = spec.precision.unwrap_or(usize::MAX);
    let (mut at, length) = match (kind, value) {
        (b's' | b'S', Value::Text(at, size)) => {
            let mut length = 0;
            while length < most && (length as u64) < size && sign(cx, at + length as u64)? != 0 {
                length += 1;
            }
            (at, length)
        }
        (b's' | b'S', Value::Bool(value)) => {
            let word: &[u8] = if value { b"TRUE" } else { b"FALSE" };
            return padded(cx, spec, &word[..word.len().min(most)], target);
        }
        (b'c' | b'C', Value::Unsigned(code, 8)) => return padded(cx, spec, &[code as u8], target),
        _ => return Err(Stop::Refused(Trouble::Different)),
    };
    let blanks = spec.width.saturating_sub(length);
    if !spec.left {
        target.fill(cx, b' ', blanks)?;
    }
    for _ in 0..length {
        let byte = [sign(cx, at)?];
        target.put(cx, &byte)?;
        at += 1;
    }
    if spec.left { target.fill(cx, b' ', blanks) } else { Ok(()) }
}

fn padded(cx: &mut Cx<'_>, spec: &Spec, text: &[u8], target: &mut Target) -> Result<(), Stop> {
    let blanks = spec.width.saturating_sub(text.len());
    if !spec.left {
        target.fill(cx, b' ', blanks)?;
    }
    target.put(cx, text)?;
    if spec.left { target.fill(cx, b' ', blanks) } else { Ok(()) }
}

/// The whole format.
fn format(cx: &mut Cx<'_>, mut at: u64, arguments: &mut Arguments, target: &mut Target) -> Result<(), Stop> {
    loop {
        let byte = sign(cx, at)?;
        at += 1;
        match byte {
            0 => return Ok(()),
            b'%' => {}
            _ => {
                target.put(cx, &[byte])?;
                continue;
            }
        }
        if sign(cx, at)? == b'%' {
            at += 1;
            target.put(cx, b"%")?;
            continue;
        }
        let spec = spec(cx, &mut at, arguments)?;
        let kind = sign(cx, at)?;
        if kind == 0 {
            return Err(Stop::Refused(Trouble::Percent));
        }
        at += 1;
        if !b"bBoOuUcCfFdDsSxXeE".contains(&kind) {
            return Err(Stop::Refused(Trouble::Type));
        }
        let value = arguments.next(cx)?;
        place(cx, &spec, kind, value, target)?;
    }
}

native_fn! {
    /// What FB_FormatString is made of: the text at `pFormat` with the T_Arg from `pArguments` on goes to `pOut`; 0, or TwinCAT's code of what is wrong.
    pub fn FormatArguments as Format(cx, pFormat: u64, pArguments: u64, nArguments: u32, pOut: u64, nOut: u32) -> Dword {
        if nOut == 0 {
            return Ok(Dword(Trouble::TooLong as u32));
        }
        let mut arguments = Arguments { at: pArguments, left: nArguments, taken: 0 };
        let mut target = Target { at: pOut, left: u64::from(nOut) - 1 };
        let ended = format(cx, pFormat, &mut arguments, &mut target);
        0_u8.store(cx.bytes_mut(target.at, 1)?);
        match ended {
            Ok(()) => Ok(Dword(0)),
            Err(Stop::Refused(trouble)) => Ok(Dword(trouble as u32 + arguments.taken.min(15))),
            Err(Stop::Fault(fault)) => Err(fault),
        }
    }
}
