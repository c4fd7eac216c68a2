//! Plain values: what may lie in the image.
//!
//! A type is [`Plain`] when every bit pattern of its bytes is a value. An ST pointer, UNION or force may have written anything, so nothing here may
//! be a Rust `bool`, enum or reference. Loading and storing go byte by byte through safe code; the optimiser makes them single moves.

use crate::desc::{Elem, FieldType};

/// A value that can be loaded from and stored into image bytes; every bit pattern is valid. Little endian, natural alignment, `repr(C)`.
pub trait Plain: Copy + 'static {
    /// The ST type.
    const TYPE: FieldType;
    /// The value a variable of this type has before any initialiser.
    const INIT: Self;
    /// Reads from the first `size_of::<Self>()` bytes.
    fn load(bytes: &[u8]) -> Self;
    /// Writes the fields (never the padding) to the first `size_of::<Self>()` bytes.
    fn store(&self, bytes: &mut [u8]);
}

macro_rules! number {
    ($($rust:ty => $elem:ident),* $(,)?) => {$(
        impl Plain for $rust {
            const TYPE: FieldType = FieldType::Elem(Elem::$elem);
            const INIT: Self = 0 as $rust;
            #[inline(always)]
            fn load(bytes: &[u8]) -> Self {
                let mut raw = [0; size_of::<$rust>()];
                raw.copy_from_slice(&bytes[..size_of::<$rust>()]);
                <$rust>::from_le_bytes(raw)
            }
            #[inline(always)]
            fn store(&self, bytes: &mut [u8]) {
                bytes[..size_of::<$rust>()].copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
number! { i8 => Sint, u8 => Usint, i16 => Int, u16 => Uint, i32 => Dint, u32 => Udint, i64 => Lint, u64 => Ulint, f32 => Real, f64 => Lreal }

macro_rules! wrapper {
    ($($(#[$doc:meta])* $name:ident($raw:ty) => $elem:ident;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[repr(transparent)]
        pub struct $name(pub $raw);
        impl Plain for $name {
            const TYPE: FieldType = FieldType::Elem(Elem::$elem);
            const INIT: Self = Self(0);
            #[inline(always)]
            fn load(bytes: &[u8]) -> Self { Self(<$raw>::load(bytes)) }
            #[inline(always)]
            fn store(&self, bytes: &mut [u8]) { self.0.store(bytes) }
        }
    )*};
}
wrapper! {
    /// BYTE.
    Byte(u8) => Byte;
    /// WORD.
    Word(u16) => Word;
    /// DWORD.
    Dword(u32) => Dword;
    /// LWORD.
    Lword(u64) => Lword;
    /// TIME: milliseconds in 32 bits, wrapping.
    StTime(u32) => Time;
    /// DATE: seconds since 1970 in 32 bits.
    StDate(u32) => Date;
    /// TIME_OF_DAY: milliseconds since midnight in 32 bits.
    StTimeOfDay(u32) => Tod;
    /// DATE_AND_TIME: seconds since 1970 in 32 bits.
    StDateTime(u32) => Dt;
    /// LTIME: nanoseconds in 64 bits.
    StLtime(i64) => Ltime;
    /// LDATE: nanoseconds since 1970 in 64 bits.
    StLdate(u64) => Ldate;
    /// LTIME_OF_DAY: nanoseconds since midnight in 64 bits.
    StLtimeOfDay(u64) => Ltod;
    /// LDATE_AND_TIME: nanoseconds since 1970 in 64 bits.
    StLdateTime(u64) => Ldt;
    /// CHAR.
    StChar(u8) => Char;
    /// WCHAR.
    StWchar(u16) => Wchar;
}

/// BOOL: TRUE when the byte is not 0.
#[derive(Debug, Clone, Copy, Default)]
#[repr(transparent)]
pub struct Bool(pub u8);

impl Bool {
    /// TRUE.
    pub const TRUE: Self = Self(1);
    /// FALSE.
    pub const FALSE: Self = Self(0);
    /// The truth value.
    #[inline(always)]
    pub fn get(self) -> bool {
        self.0 != 0
    }
}
impl From<bool> for Bool {
    #[inline(always)]
    fn from(value: bool) -> Self {
        Self(value as u8)
    }
}
impl PartialEq for Bool {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}
impl Plain for Bool {
    const TYPE: FieldType = FieldType::Elem(Elem::Bool);
    const INIT: Self = Self(0);
    #[inline(always)]
    fn load(bytes: &[u8]) -> Self {
        Self(bytes[0])
    }
    #[inline(always)]
    fn store(&self, bytes: &mut [u8]) {
        bytes[0] = self.0;
    }
}

/// STRING(N-1): `N` bytes, NUL-terminated. `Str<256>` is STRING(255).
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct Str<const N: usize>(pub [u8; N]);

impl<const N: usize> Str<N> {
    /// The empty string.
    pub const EMPTY: Self = Self([0; N]);
    /// The text before the first NUL (at most `N - 1` bytes).
    pub fn bytes(&self) -> &[u8] {
        let end = self.0[..N - 1].iter().position(|b| *b == 0).unwrap_or(N - 1);
        &self.0[..end]
    }
    /// The text, with invalid UTF-8 replaced.
    pub fn to_text(&self) -> std::borrow::Cow<'_, str> {
        String::from_utf8_lossy(self.bytes())
    }
    /// The text if it is UTF-8.
    pub fn as_str(&self) -> Option<&str> {
        std::str::from_utf8(self.bytes()).ok()
    }
    /// As much of `text` as fits, cut at a character's start.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N - 1);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut raw = [0; N];
        raw[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(raw)
    }
}
impl<const N: usize> Plain for Str<N> {
    const TYPE: FieldType = FieldType::String(N as u32 - 1);
    const INIT: Self = Self([0; N]);
    #[inline]
    fn load(bytes: &[u8]) -> Self {
        let mut raw = [0; N];
        raw.copy_from_slice(&bytes[..N]);
        Self(raw)
    }
    #[inline]
    fn store(&self, bytes: &mut [u8]) {
        bytes[..N].copy_from_slice(&self.0);
    }
}
impl<const N: usize> std::fmt::Debug for Str<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.to_text())
    }
}

/// WSTRING(N-1): `N` units of 16 bits, NUL-terminated. `WStr<256>` is WSTRING(255).
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct WStr<const N: usize>(pub [u16; N]);

impl<const N: usize> WStr<N> {
    /// The empty string.
    pub const EMPTY: Self = Self([0; N]);
    /// The units before the first NUL (at most `N - 1`).
    pub fn units(&self) -> &[u16] {
        let end = self.0[..N - 1].iter().position(|u| *u == 0).unwrap_or(N - 1);
        &self.0[..end]
    }
}
impl<const N: usize> Plain for WStr<N> {
    const TYPE: FieldType = FieldType::WString(N as u32 - 1);
    const INIT: Self = Self([0; N]);
    fn load(bytes: &[u8]) -> Self {
        Self(std::array::from_fn(|i| u16::load(&bytes[2 * i..])))
    }
    fn store(&self, bytes: &mut [u8]) {
        for (i, unit) in self.0.iter().enumerate() {
            unit.store(&mut bytes[2 * i..]);
        }
    }
}
impl<const N: usize> std::fmt::Debug for WStr<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", String::from_utf16_lossy(self.units()))
    }
}

/// ARRAY[0..N-1] OF T.
impl<T: Plain, const N: usize> Plain for [T; N] {
    const TYPE: FieldType = FieldType::Array { elem: &T::TYPE, low: 0, high: N as i64 - 1 };
    const INIT: Self = [T::INIT; N];
    fn load(bytes: &[u8]) -> Self {
        std::array::from_fn(|i| T::load(&bytes[i * size_of::<T>()..]))
    }
    fn store(&self, bytes: &mut [u8]) {
        for (i, item) in self.iter().enumerate() {
            item.store(&mut bytes[i * size_of::<T>()..]);
        }
    }
}

/// POINTER TO T: an offset into the image, 0 is NULL. Checked at each use by [`crate::Cx`].
#[repr(transparent)]
pub struct Ptr<T>(pub u64, pub std::marker::PhantomData<fn() -> T>);

impl<T> Ptr<T> {
    /// NULL.
    pub const NULL: Self = Self(0, std::marker::PhantomData);
    /// A pointer to an offset.
    pub const fn at(offset: u64) -> Self {
        Self(offset, std::marker::PhantomData)
    }
}
impl<T> Clone for Ptr<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Ptr<T> {}
impl<T: Plain> Plain for Ptr<T> {
    const TYPE: FieldType = FieldType::Pointer(&T::TYPE);
    const INIT: Self = Self::NULL;
    #[inline(always)]
    fn load(bytes: &[u8]) -> Self {
        Self::at(u64::load(bytes))
    }
    #[inline(always)]
    fn store(&self, bytes: &mut [u8]) {
        self.0.store(bytes);
    }
}

/// A block's VAR_IN_OUT: the offset of the caller's variable, checked again at each use.
#[repr(transparent)]
pub struct InOut<T>(pub u64, pub std::marker::PhantomData<fn() -> T>);

impl<T> Clone for InOut<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for InOut<T> {}
impl<T: Plain> Plain for InOut<T> {
    /// The type of the variable that is passed, not of the offset.
    const TYPE: FieldType = T::TYPE;
    const INIT: Self = Self(0, std::marker::PhantomData);
    #[inline(always)]
    fn load(bytes: &[u8]) -> Self {
        Self(u64::load(bytes), std::marker::PhantomData)
    }
    #[inline(always)]
    fn store(&self, bytes: &mut [u8]) {
        self.0.store(bytes);
    }
}

/// A block's VAR_IN_OUT of type `ARRAY[*]` OF T: offset of the first element and bounds, written by the caller, checked again at each use.
#[repr(C)]
pub struct OpenArray<T> {
    /// Offset of the element with index `low`.
    pub offset: u64,
    /// LOWER_BOUND.
    pub low: i64,
    /// UPPER_BOUND.
    pub high: i64,
    item: std::marker::PhantomData<fn() -> T>,
}
impl<T> Clone for OpenArray<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for OpenArray<T> {}
impl<T> OpenArray<T> {
    /// The number of elements the caller's array has (0 when the bounds are nonsense).
    pub fn len(&self) -> usize {
        self.high.checked_sub(self.low).and_then(|n| n.checked_add(1)).and_then(|n| usize::try_from(n).ok()).unwrap_or(0)
    }
    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
impl<T: Plain> Plain for OpenArray<T> {
    const TYPE: FieldType = FieldType::OpenArray(&T::TYPE);
    const INIT: Self = Self { offset: 0, low: 0, high: -1, item: std::marker::PhantomData };
    fn load(bytes: &[u8]) -> Self {
        Self { offset: u64::load(bytes), low: i64::load(&bytes[8..]), high: i64::load(&bytes[16..]), item: std::marker::PhantomData }
    }
    fn store(&self, bytes: &mut [u8]) {
        self.offset.store(bytes);
        self.low.store(&mut bytes[8..]);
        self.high.store(&mut bytes[16..]);
    }
}
