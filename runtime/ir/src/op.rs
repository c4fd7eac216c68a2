//! The table of operators. Name, types and meaning of each stand here once: the interpreter calls the meaning, the JIT calls it for the hard ones and
//! is compared with it for the others, printer and verifier read the types.

use crate::inst::Ty;

/// A value that fits a register: how it travels as a 64-bit word.
pub trait Word: Copy {
    /// Its local type.
    const TY: Ty;
    /// From the word.
    fn from_word(word: u64) -> Self;
    /// To the word.
    fn to_word(self) -> u64;
}
impl Word for i64 {
    const TY: Ty = Ty::I64;
    fn from_word(word: u64) -> Self {
        word as i64
    }
    fn to_word(self) -> u64 {
        self as u64
    }
}
impl Word for f32 {
    const TY: Ty = Ty::F32;
    fn from_word(word: u64) -> Self {
        f32::from_bits(word as u32)
    }
    fn to_word(self) -> u64 {
        self.to_bits().into()
    }
}
impl Word for f64 {
    const TY: Ty = Ty::F64;
    fn from_word(word: u64) -> Self {
        f64::from_bits(word)
    }
    fn to_word(self) -> u64 {
        self.to_bits()
    }
}

macro_rules! ops {
    ($($name:ident $text:literal ($($arg:ident : $ty:ty),*) -> $ret:ty = $meaning:expr;)*) => {
        /// An operator.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the table gives each its meaning")]
        pub enum Op { $($name,)* }

        /// All operators.
        pub fn ops() -> &'static [Op] { &[$(Op::$name,)*] }

        impl Op {
            /// Name in the text form.
            pub fn text(self) -> &'static str { match self { $(Self::$name => $text,)* } }
            /// Types of the operands.
            pub fn args(self) -> &'static [Ty] { match self { $(Self::$name => &[$(<$ty as Word>::TY,)*],)* } }
            /// Type of the result.
            pub fn result(self) -> Ty { match self { $(Self::$name => <$ret as Word>::TY,)* } }
            /// The meaning, on words. Operands beyond those given are 0.
            #[inline]
            pub fn eval(self, words: [u64; 3]) -> u64 {
                match self { $(Self::$name => {
                    let mut next = words.into_iter();
                    $(let $arg = <$ty as Word>::from_word(next.next().unwrap_or(0));)*
                    let _ = next;
                    let result: $ret = $meaning;
                    result.to_word()
                })* }
            }
            /// The meaning as a C function with the operands' types, for machine code to call.
            pub fn address(self) -> *const u8 {
                match self { $(Self::$name => {
                    extern "C" fn meaning($($arg: $ty),*) -> $ret { $meaning }
                    meaning as *const u8
                })* }
            }
        }
    };
}

ops! {
    // Integers, 64 bits, wrapping.
    Add "add" (a: i64, b: i64) -> i64 = a.wrapping_add(b);
    Sub "sub" (a: i64, b: i64) -> i64 = a.wrapping_sub(b);
    Mul "mul" (a: i64, b: i64) -> i64 = a.wrapping_mul(b);
    Neg "neg" (a: i64) -> i64 = a.wrapping_neg();
    Div "div" (a: i64, b: i64) -> i64 = if b == 0 { 0 } else { a.wrapping_div(b) };
    DivU "div.u" (a: i64, b: i64) -> i64 = if b == 0 { 0 } else { (a as u64 / b as u64) as i64 };
    Rem "rem" (a: i64, b: i64) -> i64 = if b == 0 { 0 } else { a.wrapping_rem(b) };
    RemU "rem.u" (a: i64, b: i64) -> i64 = if b == 0 { 0 } else { (a as u64 % b as u64) as i64 };
    Abs "abs" (a: i64) -> i64 = a.wrapping_abs();
    Expt "expt" (a: i64, b: i64) -> i64 = if b < 0 { if a == 1 { 1 } else if a == -1 { if b & 1 == 0 { 1 } else { -1 } } else { 0 } } else { power(a, b) };
    // Bits.
    And "and" (a: i64, b: i64) -> i64 = a & b;
    Or "or" (a: i64, b: i64) -> i64 = a | b;
    Xor "xor" (a: i64, b: i64) -> i64 = a ^ b;
    Not "not" (a: i64) -> i64 = !a;
    Shl "shl" (a: i64, n: i64) -> i64 = if (n as u64) < 64 { a << n } else { 0 };
    ShrU "shr.u" (a: i64, n: i64) -> i64 = if (n as u64) < 64 { (a as u64 >> n) as i64 } else { 0 };
    ShrS "shr.s" (a: i64, n: i64, width: i64) -> i64 = if (n as u64) < width as u64 && (n as u64) < 64 { a >> n } else { 0 };
    Rol "rol" (a: i64, n: i64, width: i64) -> i64 = rotate(a, n, width);
    Ror "ror" (a: i64, n: i64, width: i64) -> i64 = rotate(a, n.wrapping_neg(), width);
    // Cuts to a width.
    SExt8 "sext8" (a: i64) -> i64 = a as i8 as i64;
    SExt16 "sext16" (a: i64) -> i64 = a as i16 as i64;
    SExt32 "sext32" (a: i64) -> i64 = a as i32 as i64;
    ZExt8 "zext8" (a: i64) -> i64 = a as u8 as i64;
    ZExt16 "zext16" (a: i64) -> i64 = a as u16 as i64;
    ZExt32 "zext32" (a: i64) -> i64 = a as u32 as i64;
    // Comparisons: 0 or 1.
    Eq "eq" (a: i64, b: i64) -> i64 = (a == b) as i64;
    Ne "ne" (a: i64, b: i64) -> i64 = (a != b) as i64;
    Lt "lt" (a: i64, b: i64) -> i64 = (a < b) as i64;
    Le "le" (a: i64, b: i64) -> i64 = (a <= b) as i64;
    Gt "gt" (a: i64, b: i64) -> i64 = (a > b) as i64;
    Ge "ge" (a: i64, b: i64) -> i64 = (a >= b) as i64;
    LtU "lt.u" (a: i64, b: i64) -> i64 = ((a as u64) < b as u64) as i64;
    LeU "le.u" (a: i64, b: i64) -> i64 = (a as u64 <= b as u64) as i64;
    GtU "gt.u" (a: i64, b: i64) -> i64 = (a as u64 > b as u64) as i64;
    GeU "ge.u" (a: i64, b: i64) -> i64 = (a as u64 >= b as u64) as i64;
    // Choice.
    Select "select" (c: i64, a: i64, b: i64) -> i64 = if c != 0 { a } else { b };
    SelectF32 "select.f32" (c: i64, a: f32, b: f32) -> f32 = if c != 0 { a } else { b };
    SelectF64 "select.f64" (c: i64, a: f64, b: f64) -> f64 = if c != 0 { a } else { b };
    // LREAL.
    AddF64 "add.f64" (a: f64, b: f64) -> f64 = a + b;
    SubF64 "sub.f64" (a: f64, b: f64) -> f64 = a - b;
    MulF64 "mul.f64" (a: f64, b: f64) -> f64 = a * b;
    DivF64 "div.f64" (a: f64, b: f64) -> f64 = a / b;
    NegF64 "neg.f64" (a: f64) -> f64 = -a;
    AbsF64 "abs.f64" (a: f64) -> f64 = a.abs();
    SqrtF64 "sqrt.f64" (a: f64) -> f64 = a.sqrt();
    FloorF64 "floor.f64" (a: f64) -> f64 = a.floor();
    CeilF64 "ceil.f64" (a: f64) -> f64 = a.ceil();
    TruncF64 "trunc.f64" (a: f64) -> f64 = a.trunc();
    RemF64 "rem.f64" (a: f64, b: f64) -> f64 = libm::fmod(a, b);
    SinF64 "sin.f64" (a: f64) -> f64 = libm::sin(a);
    CosF64 "cos.f64" (a: f64) -> f64 = libm::cos(a);
    TanF64 "tan.f64" (a: f64) -> f64 = libm::tan(a);
    AsinF64 "asin.f64" (a: f64) -> f64 = libm::asin(a);
    AcosF64 "acos.f64" (a: f64) -> f64 = libm::acos(a);
    AtanF64 "atan.f64" (a: f64) -> f64 = libm::atan(a);
    Atan2F64 "atan2.f64" (a: f64, b: f64) -> f64 = libm::atan2(a, b);
    ExpF64 "exp.f64" (a: f64) -> f64 = libm::exp(a);
    LnF64 "ln.f64" (a: f64) -> f64 = libm::log(a);
    LogF64 "log.f64" (a: f64) -> f64 = libm::log10(a);
    PowF64 "pow.f64" (a: f64, b: f64) -> f64 = libm::pow(a, b);
    EqF64 "eq.f64" (a: f64, b: f64) -> i64 = (a == b) as i64;
    NeF64 "ne.f64" (a: f64, b: f64) -> i64 = (a != b) as i64;
    LtF64 "lt.f64" (a: f64, b: f64) -> i64 = (a < b) as i64;
    LeF64 "le.f64" (a: f64, b: f64) -> i64 = (a <= b) as i64;
    GtF64 "gt.f64" (a: f64, b: f64) -> i64 = (a > b) as i64;
    GeF64 "ge.f64" (a: f64, b: f64) -> i64 = (a >= b) as i64;
    // REAL.
    AddF32 "add.f32" (a: f32, b: f32) -> f32 = a + b;
    SubF32 "sub.f32" (a: f32, b: f32) -> f32 = a - b;
    MulF32 "mul.f32" (a: f32, b: f32) -> f32 = a * b;
    DivF32 "div.f32" (a: f32, b: f32) -> f32 = a / b;
    NegF32 "neg.f32" (a: f32) -> f32 = -a;
    AbsF32 "abs.f32" (a: f32) -> f32 = a.abs();
    SqrtF32 "sqrt.f32" (a: f32) -> f32 = a.sqrt();
    FloorF32 "floor.f32" (a: f32) -> f32 = a.floor();
    CeilF32 "ceil.f32" (a: f32) -> f32 = a.ceil();
    TruncF32 "trunc.f32" (a: f32) -> f32 = a.trunc();
    RemF32 "rem.f32" (a: f32, b: f32) -> f32 = libm::fmodf(a, b);
    SinF32 "sin.f32" (a: f32) -> f32 = libm::sinf(a);
    CosF32 "cos.f32" (a: f32) -> f32 = libm::cosf(a);
    TanF32 "tan.f32" (a: f32) -> f32 = libm::tanf(a);
    AsinF32 "asin.f32" (a: f32) -> f32 = libm::asinf(a);
    AcosF32 "acos.f32" (a: f32) -> f32 = libm::acosf(a);
    AtanF32 "atan.f32" (a: f32) -> f32 = libm::atanf(a);
    Atan2F32 "atan2.f32" (a: f32, b: f32) -> f32 = libm::atan2f(a, b);
    ExpF32 "exp.f32" (a: f32) -> f32 = libm::expf(a);
    LnF32 "ln.f32" (a: f32) -> f32 = libm::logf(a);
    LogF32 "log.f32" (a: f32) -> f32 = libm::log10f(a);
    PowF32 "pow.f32" (a: f32, b: f32) -> f32 = libm::powf(a, b);
    EqF32 "eq.f32" (a: f32, b: f32) -> i64 = (a == b) as i64;
    NeF32 "ne.f32" (a: f32, b: f32) -> i64 = (a != b) as i64;
    LtF32 "lt.f32" (a: f32, b: f32) -> i64 = (a < b) as i64;
    LeF32 "le.f32" (a: f32, b: f32) -> i64 = (a <= b) as i64;
    GtF32 "gt.f32" (a: f32, b: f32) -> i64 = (a > b) as i64;
    GeF32 "ge.f32" (a: f32, b: f32) -> i64 = (a >= b) as i64;
    // Conversions. To integer: half away from zero, saturating in 64 bits, NaN is 0.
    I64ToF64 "i64.f64" (a: i64) -> f64 = a as f64;
    U64ToF64 "u64.f64" (a: i64) -> f64 = a as u64 as f64;
    I64ToF32 "i64.f32" (a: i64) -> f32 = a as f32;
    U64ToF32 "u64.f32" (a: i64) -> f32 = a as u64 as f32;
    F32ToF64 "f32.f64" (a: f32) -> f64 = f64::from(a);
    F64ToF32 "f64.f32" (a: f64) -> f32 = a as f32;
    RoundF64 "f64.i64" (a: f64) -> i64 = a.round() as i64;
    RoundF32 "f32.i64" (a: f32) -> i64 = a.round() as i64;
    CutF64 "f64.trunc" (a: f64) -> i64 = a as i64;
    CutF32 "f32.trunc" (a: f32) -> i64 = a as i64;
}

impl Op {
    /// Whether a second operand of 0 is a fault (`DivisionByZero`). `x MOD 0 = 0` is none.
    pub fn faults(self) -> bool {
        matches!(self, Self::Div | Self::DivU)
    }
}

fn power(base: i64, exponent: i64) -> i64 {
    let (mut result, mut base, mut exponent) = (1i64, base, exponent as u64);
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = result.wrapping_mul(base);
        }
        base = base.wrapping_mul(base);
        exponent >>= 1;
    }
    result
}

/// Rotates the low `width` bits (8, 16, 32, 64) left; the result is zero-extended.
fn rotate(a: i64, n: i64, width: i64) -> i64 {
    match width {
        8 => (a as u8).rotate_left(n.rem_euclid(8) as u32).into(),
        16 => (a as u16).rotate_left(n.rem_euclid(16) as u32).into(),
        32 => (a as u32).rotate_left(n.rem_euclid(32) as u32).into(),
        _ => (a as u64).rotate_left(n.rem_euclid(64) as u32) as i64,
    }
}
