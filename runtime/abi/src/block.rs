//! The macros that declare native types, blocks and functions, and the thunks that compiled code calls.

use crate::context::{Context, Cx};
use crate::fault::Fault;
use crate::plain::Plain;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs the body of a native block: copies the fields out of the image, runs, copies them back; a panic becomes a fault. Called by [`crate::function_block!`].
///
/// # Safety
/// As [`crate::NativeFn`]; nobody else touches the image, `ctx` or its `env` meanwhile.
#[allow(unsafe_code, reason = "the boundary to machine code")]
pub unsafe fn run_block<B: Plain>(ctx: *mut Context, args: *mut u64, body: fn(&mut B, &mut Cx<'_>) -> Result<(), Fault>) -> u32 {
    // SAFETY: the caller passes at least one argument.
    let this = unsafe { *args };
    // SAFETY: the caller's promise.
    unsafe {
        run_function(ctx, this, |cx| {
            let mut block = B::load(cx.bytes(this, size_of::<B>())?);
            let result = body(&mut block, cx);
            block.store(cx.bytes_mut(this, size_of::<B>())?);
            result
        })
    }
}

/// Runs `body` over the image of `ctx`; a panic becomes a fault.
///
/// # Safety
/// As [`crate::NativeFn`]; nobody else touches the image, `ctx` or its `env` meanwhile.
#[allow(unsafe_code, reason = "the boundary to machine code")]
pub unsafe fn run_function(ctx: *mut Context, this: u64, body: impl FnOnce(&mut Cx<'_>) -> Result<(), Fault>) -> u32 {
    // SAFETY: `ctx` is live and this thread's alone while a block runs.
    let ctx = unsafe { &mut *ctx };
    // SAFETY: image and image_size describe one allocation that machine code does not touch before we return.
    let mem = unsafe { std::slice::from_raw_parts_mut(ctx.image, ctx.image_size as usize) };
    // SAFETY: the engine set `env` to a live Env that only the running scan uses.
    let env = unsafe { &mut *ctx.env };
    let mut cx = Cx::new(mem, env, &mut ctx.fuel, this);
    let result = catch_unwind(AssertUnwindSafe(|| body(&mut cx))).unwrap_or(Err(Fault::Panic));
    match result {
        Ok(()) => 0,
        Err(fault) => {
            ctx.fault_code = fault.code();
            ctx.fault_facts = fault.facts();
            fault.code()
        }
    }
}

/// How a parameter or result of a native function travels in its word.
pub trait Arg: Sized {
    /// From the word.
    fn take(cx: &Cx<'_>, word: u64) -> Result<Self, Fault>;
    /// To the word; `place` is the word behind the last parameter (an offset, for results that do not fit a word).
    fn give(self, cx: &mut Cx<'_>, place: u64) -> Result<u64, Fault>;
}

macro_rules! word_arg {
    ($($ty:ty),*) => {$(
        impl Arg for $ty {
            fn take(_: &Cx<'_>, word: u64) -> Result<Self, Fault> { Ok(word as $ty) }
            fn give(self, _: &mut Cx<'_>, _: u64) -> Result<u64, Fault> { Ok(self as i64 as u64) }
        }
    )*};
}
word_arg!(i8, u8, i16, u16, i32, u32, i64, u64);

macro_rules! wrapped_arg {
    ($($ty:ident),*) => {$(
        impl Arg for crate::$ty {
            fn take(cx: &Cx<'_>, word: u64) -> Result<Self, Fault> { Ok(Self(Arg::take(cx, word)?)) }
            fn give(self, cx: &mut Cx<'_>, place: u64) -> Result<u64, Fault> { self.0.give(cx, place) }
        }
    )*};
}
wrapped_arg!(
    Byte,
    Word,
    Dword,
    Lword,
    StTime,
    StDate,
    StTimeOfDay,
    StDateTime,
    StLtime,
    StLdate,
    StLtimeOfDay,
    StLdateTime,
    StChar,
    StWchar
);

impl Arg for f64 {
    fn take(_: &Cx<'_>, word: u64) -> Result<Self, Fault> {
        Ok(f64::from_bits(word))
    }
    fn give(self, _: &mut Cx<'_>, _: u64) -> Result<u64, Fault> {
        Ok(self.to_bits())
    }
}
impl Arg for f32 {
    fn take(_: &Cx<'_>, word: u64) -> Result<Self, Fault> {
        Ok(f32::from_bits(word as u32))
    }
    fn give(self, _: &mut Cx<'_>, _: u64) -> Result<u64, Fault> {
        Ok(self.to_bits().into())
    }
}
impl Arg for crate::Bool {
    fn take(_: &Cx<'_>, word: u64) -> Result<Self, Fault> {
        Ok((word != 0).into())
    }
    fn give(self, _: &mut Cx<'_>, _: u64) -> Result<u64, Fault> {
        Ok(self.get().into())
    }
}
impl<T> Arg for crate::Ptr<T> {
    fn take(_: &Cx<'_>, word: u64) -> Result<Self, Fault> {
        Ok(Self::at(word))
    }
    fn give(self, _: &mut Cx<'_>, _: u64) -> Result<u64, Fault> {
        Ok(self.0)
    }
}
macro_rules! text_arg {
    ($($ty:ident),*) => {$(
        impl<const N: usize> Arg for crate::$ty<N> {
            fn take(cx: &Cx<'_>, word: u64) -> Result<Self, Fault> { cx.load(word) }
            fn give(self, cx: &mut Cx<'_>, place: u64) -> Result<u64, Fault> {
                cx.store(place, &self)?;
                Ok(0)
            }
        }
    )*};
}
text_arg!(Str, WStr);

/// Declares a STRUCT: the Rust type (`repr(C)`, [`Plain`]) and `Self::DESC`.
///
/// ```
/// takt_abi::st_struct! {
///     /// A point, mm.
///     pub struct SMC_VECTOR3D as Vector3 { dX: f64, dY: f64 = 1.0, dZ: f64 }
/// }
/// assert_eq!(Vector3::DESC.size, 24);
/// ```
#[macro_export]
macro_rules! st_struct {
    ($(#[doc = $doc:literal])* pub struct $st:ident as $rust:ident {
        $($(#[doc = $fdoc:literal])* $field:ident : $ty:ty $(= $init:expr)?),* $(,)?
    }) => {
        $crate::st_fields! { [$($doc)*] $rust { $([$($fdoc)*] $field: $ty $(= $init)?;)* } }
        impl $rust {
            /// The descriptor that the compiler reads.
            pub const DESC: &'static $crate::StructDesc = &$crate::StructDesc {
                name: stringify!($st),
                doc: concat!($($doc, "\n",)*),
                size: size_of::<Self>(),
                align: align_of::<Self>(),
                fields: &[$($crate::FieldDesc {
                    name: stringify!($field),
                    doc: concat!($($fdoc, "\n",)*),
                    section: $crate::Section::State,
                    ty: <$ty as $crate::Plain>::TYPE,
                    offset: std::mem::offset_of!($rust, $field),
                },)*],
                init: |bytes| $crate::Plain::store(&<Self as $crate::Plain>::INIT, bytes),
            };
        }
        $crate::st_plain! { $rust, $crate::FieldType::Struct($rust::DESC), $($field: $ty $(= $init)?;)* }
    };
}

/// The Rust struct of [`st_struct!`] and [`function_block!`].
#[doc(hidden)]
#[macro_export]
macro_rules! st_fields {
    ([$($doc:literal)*] $rust:ident { $([$($fdoc:literal)*] $field:ident : $ty:ty $(= $init:expr)?;)* }) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy)]
        #[repr(C)]
        #[allow(non_snake_case, missing_docs, reason = "ST names keep ST spelling")]
        pub struct $rust { $($(#[doc = $fdoc])* pub $field: $ty,)* }
        impl std::fmt::Debug for $rust {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(stringify!($rust))
            }
        }
        impl Default for $rust {
            fn default() -> Self { <Self as $crate::Plain>::INIT }
        }
    };
}

/// [`Plain`] for the struct of [`st_struct!`] and [`function_block!`].
#[doc(hidden)]
#[macro_export]
macro_rules! st_plain {
    ($rust:ident, $type:expr, $($field:ident : $ty:ty $(= $init:expr)?;)*) => {
        impl $crate::Plain for $rust {
            const TYPE: $crate::FieldType = $type;
            const INIT: Self = Self { $($field: $crate::st_init!($ty $(, $init)?),)* };
            #[inline]
            fn load(bytes: &[u8]) -> Self {
                let bytes = &bytes[..size_of::<Self>()];
                Self { $($field: <$ty as $crate::Plain>::load(&bytes[std::mem::offset_of!($rust, $field)..]),)* }
            }
            #[inline]
            fn store(&self, bytes: &mut [u8]) {
                let bytes = &mut bytes[..size_of::<Self>()];
                $($crate::Plain::store(&self.$field, &mut bytes[std::mem::offset_of!($rust, $field)..]);)*
                let _ = bytes;
            }
        }
    };
}

/// Whether the members of a [`st_enum!`] need its name.
#[doc(hidden)]
#[macro_export]
macro_rules! st_qualified {
    () => {
        false
    };
    (qualified_only) => {
        true
    };
}

/// The initial value of a field.
#[doc(hidden)]
#[macro_export]
macro_rules! st_init {
    ($ty:ty) => {
        <$ty as $crate::Plain>::INIT
    };
    ($ty:ty, $init:expr) => {
        $init
    };
}

/// Declares an enumeration: a newtype over its base (any bit pattern is valid) with a constant per member, and `Self::DESC`. With `qualified_only`
/// behind its base its members resolve only as `TYPE.member`.
///
/// ```
/// takt_abi::st_enum! {
///     /// Where to.
///     pub enum DIRECTION as Way(i16, Int) { forth = 1, back = 2 }
/// }
/// assert_eq!(Way::back.0, 2);
/// ```
#[macro_export]
macro_rules! st_enum {
    ($(#[doc = $doc:literal])* pub enum $st:ident as $rust:ident($base:ty, $elem:ident $(, $only:ident)?) { $($(#[doc = $mdoc:literal])* $member:ident = $value:expr),* $(,)? }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[repr(transparent)]
        pub struct $rust(pub $base);
        #[allow(non_upper_case_globals, missing_docs, reason = "ST names keep ST spelling")]
        impl $rust {
            $($(#[doc = $mdoc])* pub const $member: Self = Self($value);)*
            /// The descriptor that the compiler reads.
            pub const DESC: &'static $crate::EnumDesc = &$crate::EnumDesc {
                name: stringify!($st),
                doc: concat!($($doc, "\n",)*),
                base: $crate::Elem::$elem,
                members: &[$((stringify!($member), $value as i64),)*],
                qualified_only: $crate::st_qualified!($($only)?),
            };
        }
        impl $crate::Plain for $rust {
            const TYPE: $crate::FieldType = $crate::FieldType::Enum(Self::DESC);
            const INIT: Self = Self(0);
            fn load(bytes: &[u8]) -> Self { Self(<$base as $crate::Plain>::load(bytes)) }
            fn store(&self, bytes: &mut [u8]) { $crate::Plain::store(&self.0, bytes) }
        }
        impl $crate::Arg for $rust {
            fn take(cx: &$crate::Cx<'_>, word: u64) -> Result<Self, $crate::Fault> { Ok(Self($crate::Arg::take(cx, word)?)) }
            fn give(self, cx: &mut $crate::Cx<'_>, place: u64) -> Result<u64, $crate::Fault> { $crate::Arg::give(self.0, cx, place) }
        }
    };
}

/// Declares a function block: fields, documentation, descriptor and body in one place.
///
/// Sections stand in the order `input output inout state`; `aliases` and `resource` are optional. In the body, `self` is the name given to the block
/// (a `&mut` copy of its fields), `cx` the [`Cx`]; it returns `Result<(), Fault>`.
///
/// ```
/// use takt_abi::{Bool, InOut};
/// takt_abi::function_block! {
///     /// Counts while `IN` is TRUE.
///     pub block TALLY as Tally aliases ["MY_TALLY"] {
///         input { IN: Bool, STEP: i32 = 1 }
///         output { CV: i32 }
///         inout { Total: i32 }
///         state {}
///     }
///     fn cycle(fb, cx) {
///         if fb.IN.get() {
///             fb.CV = fb.CV.wrapping_add(fb.STEP);
///             let total = cx.get(fb.Total)?;
///             cx.set(fb.Total, &total.wrapping_add(fb.STEP))?;
///         }
///         Ok(())
///     }
/// }
/// assert_eq!(Tally::DESC.fields.len(), 4);
/// ```
#[macro_export]
macro_rules! function_block {
    ($(#[doc = $doc:literal])* pub block $st:ident as $rust:ident $(aliases [$($alias:literal),* $(,)?])? $(resource $res:ty)? {
        input { $($(#[doc = $idoc:literal])* $in:ident : $ity:ty $(= $iinit:expr)?),* $(,)? }
        output { $($(#[doc = $odoc:literal])* $out:ident : $oty:ty $(= $oinit:expr)?),* $(,)? }
        $(inout { $($(#[doc = $ndoc:literal])* $io:ident : $nty:ty),* $(,)? })?
        $(open { $($(#[doc = $adoc:literal])* $arr:ident : $aty:ty),* $(,)? })?
        state { $($(#[doc = $sdoc:literal])* $var:ident : $sty:ty $(= $sinit:expr)?),* $(,)? }
    }
    fn cycle($me:ident, $cx:ident) $body:block) => {
        $crate::st_fields! { [$($doc)*] $rust {
            $([$($idoc)*] $in: $ity $(= $iinit)?;)*
            $([$($odoc)*] $out: $oty $(= $oinit)?;)*
            $($([$($ndoc)*] $io: $crate::InOut<$nty>;)*)?
            $($([$($adoc)*] $arr: $crate::OpenArray<$aty>;)*)?
            $([$($sdoc)*] $var: $sty $(= $sinit)?;)*
        } }
        $crate::st_plain! { $rust, $crate::FieldType::Elem($crate::Elem::Byte),
            $($in: $ity $(= $iinit)?;)*
            $($out: $oty $(= $oinit)?;)*
            $($($io: $crate::InOut<$nty>;)*)?
            $($($arr: $crate::OpenArray<$aty>;)*)?
            $($var: $sty $(= $sinit)?;)*
        }
        impl $rust {
            /// The descriptor that the compiler reads.
            pub const DESC: &'static $crate::BlockDesc = &$crate::BlockDesc {
                name: stringify!($st),
                aliases: &[$($($alias),*)?],
                doc: concat!($($doc, "\n",)*),
                size: size_of::<Self>(),
                align: align_of::<Self>(),
                fields: &[
                    $($crate::st_field!($rust, $in, $ity, Input, $($idoc)*),)*
                    $($crate::st_field!($rust, $out, $oty, Output, $($odoc)*),)*
                    $($($crate::st_field!($rust, $io, $nty, InOut, $($ndoc)*),)*)?
                    $($($crate::st_field!($rust, $arr, $crate::OpenArray<$aty>, InOut, $($adoc)*),)*)?
                    $($crate::st_field!($rust, $var, $sty, State, $($sdoc)*),)*
                ],
                init: |bytes| $crate::Plain::store(&<Self as $crate::Plain>::INIT, bytes),
                cycle: Some(Self::thunk),
                resource: $crate::st_resource!($($res)?),
            };
            /// Runs one cycle on a copy of the fields.
            pub fn cycle(&mut self, $cx: &mut $crate::Cx<'_>) -> Result<(), $crate::Fault> {
                let $me = self;
                $body
            }
            #[allow(unsafe_code, reason = "called by machine code")]
            unsafe extern "C" fn thunk(ctx: *mut $crate::Context, args: *mut u64) -> u32 {
                // SAFETY: the promise of `NativeFn`.
                unsafe { $crate::run_block::<Self>(ctx, args, Self::cycle) }
            }
        }
    };
}

/// One [`crate::FieldDesc`] of [`function_block!`].
#[doc(hidden)]
#[macro_export]
macro_rules! st_field {
    ($rust:ident, $field:ident, $ty:ty, $section:ident, $($doc:literal)*) => {
        $crate::FieldDesc {
            name: stringify!($field),
            doc: concat!($($doc, "\n",)*),
            section: $crate::Section::$section,
            ty: <$ty as $crate::Plain>::TYPE,
            offset: std::mem::offset_of!($rust, $field),
        }
    };
}

/// The resource maker of [`function_block!`].
#[doc(hidden)]
#[macro_export]
macro_rules! st_resource {
    () => {
        None
    };
    ($res:ty) => {
        Some(|| Box::new(<$res as Default>::default()))
    };
}

/// Declares a function in Rust and its descriptor (a constant with the Rust name in capitals is not made: `RUST::DESC` of a unit struct is).
///
/// ```
/// takt_abi::native_fn! {
///     /// Twice `X`.
///     pub fn TWICE as Twice(cx, X: f64) -> f64 { let _ = cx; Ok(2.0 * X) }
/// }
/// assert_eq!(Twice::DESC.params.len(), 1);
/// ```
#[macro_export]
macro_rules! native_fn {
    ($(#[doc = $doc:literal])* pub fn $st:ident as $rust:ident($cx:ident $(, $param:ident : $ty:ty)* $(,)?) -> $ret:ty $body:block) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $rust;
        impl $rust {
            /// The descriptor that the compiler reads.
            pub const DESC: &'static $crate::FnDesc = &$crate::FnDesc {
                name: stringify!($st),
                doc: concat!($($doc, "\n",)*),
                params: &[$($crate::ParamDesc { name: stringify!($param), ty: <$ty as $crate::Plain>::TYPE },)*],
                result: <$ret as $crate::Plain>::TYPE,
                call: Self::thunk,
            };
            /// The body.
            #[allow(non_snake_case, reason = "ST names keep ST spelling")]
            pub fn call($cx: &mut $crate::Cx<'_> $(, $param: $ty)*) -> Result<$ret, $crate::Fault> $body
            #[allow(unsafe_code, unused_assignments, unused_mut, unused_variables, reason = "called by machine code; functions may have no parameter")]
            unsafe extern "C" fn thunk(ctx: *mut $crate::Context, args: *mut u64) -> u32 {
                const COUNT: usize = 0 $(+ { let _ = stringify!($param); 1 })*;
                // SAFETY: the caller passes COUNT words and one more for the result.
                let words: &mut [u64] = unsafe { std::slice::from_raw_parts_mut(args, COUNT + 1) };
                let body = |cx: &mut $crate::Cx<'_>| {
                    let place = words[COUNT];
                    let mut next = 0;
                    let result = Self::call(cx $(, { let word = words[next]; next += 1; <$ty as $crate::Arg>::take(cx, word)? })*)?;
                    words[0] = $crate::Arg::give(result, cx, place)?;
                    Ok(())
                };
                // SAFETY: the promise of `NativeFn`.
                unsafe { $crate::run_function(ctx, 0, body) }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use crate::*;

    function_block! {
        /// Adds and tells.
        pub block TALLY as Tally {
            input { IN: Bool, STEP: i32 = 3 }
            output { CV: i32 }
            inout { Total: i32 }
            state { boom: Bool }
        }
        fn cycle(fb, cx) {
            assert!(!fb.boom.get(), "boom");
            if fb.IN.get() {
                fb.CV = fb.CV.wrapping_add(fb.STEP);
                let total = cx.get(fb.Total)?;
                cx.set(fb.Total, &total.wrapping_add(fb.STEP))?;
            }
            Ok(())
        }
    }

    fn env() -> Env {
        Env::new(Time(1), Box::new(NoHost))
    }

    #[allow(unsafe_code, reason = "plays the engine")]
    unsafe extern "C" fn no_poll(_: *mut Context, _: u32) -> u32 {
        0
    }

    #[allow(unsafe_code, reason = "plays compiled code")]
    fn call(image: &mut [u8], this: u64) -> Option<Fault> {
        let mut env = env();
        let mut ctx = Context::new(image.as_mut_ptr(), image.len() as u64, &mut env, no_poll);
        ctx.fuel = 100;
        let mut args = [this];
        let cycle = Tally::DESC.cycle.expect("has a body");
        // SAFETY: context, image and arguments are alive and ours.
        let status = unsafe { cycle(&mut ctx, args.as_mut_ptr()) };
        assert_eq!(status, ctx.fault_code);
        ctx.fault()
    }

    #[test]
    fn a_block_works_on_a_copy_and_its_in_out_is_checked() {
        let mut image = vec![0; 128];
        (Tally::DESC.init)(&mut image[16..]);
        let mut fb = Tally::load(&image[16..]);
        fb.IN = Bool(7);
        fb.store(&mut image[16..]);
        assert_eq!(call(&mut image, 16), Some(Fault::NullPointer));
        fb.Total = InOut::load(&124u64.to_le_bytes());
        fb.store(&mut image[16..]);
        assert_eq!(call(&mut image, 16), None);
        assert_eq!((Tally::load(&image[16..]).CV, i32::load(&image[124..])), (3, 3));
        fb.Total = InOut::load(&125u64.to_le_bytes());
        fb.store(&mut image[16..]);
        assert_eq!(call(&mut image, 16), Some(Fault::WildPointer { offset: 125, size: 4 }));
        assert!(matches!(call(&mut image, 120), Some(Fault::WildPointer { .. })));
    }

    #[test]
    fn a_panic_in_a_block_is_a_fault() {
        let mut image = vec![0; 128];
        let fb = Tally { boom: Bool::TRUE, ..Tally::default() };
        fb.store(&mut image[16..]);
        assert_eq!(call(&mut image, 16), Some(Fault::Panic));
    }
}
