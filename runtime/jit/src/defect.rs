//! Deliberate mistakes in the lowering, for the test bench: a suite is good when it finds each of them.
//!
//! Every mistake is a branch at one place of the lowering, and none can harm the host: where a check is dropped, the address is clamped into the image
//! instead. Production code is compiled with [`Defect::None`].

macro_rules! defects {
    ($($(#[doc = $doc:literal])* $name:ident,)*) => {
        /// A deliberate mistake of the code generator.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
        pub enum Defect {
            /// Correct code.
            #[default]
            None,
            $($(#[doc = $doc])* $name,)*
        }
        impl Defect {
            /// All mistakes, without [`Defect::None`].
            pub fn all() -> &'static [Self] { &[$(Self::$name,)*] }
        }
    };
}

defects! {
    /// `Index` never faults (the index is clamped).
    IndexUnchecked,
    /// `Index` lets the first index behind the upper bound pass.
    IndexLoose,
    /// `Index` refuses the upper bound itself.
    IndexTight,
    /// `Check` never faults.
    CheckDropped,
    /// Lower and upper bound are swapped in the facts of `Index`.
    FactsSwapped,
    /// `Deref` of NULL reaches the null zone.
    NullUnchecked,
    /// `Deref` of a wild pointer reaches the first variable.
    WildUnchecked,
    /// `Deref` lets the null zone pass.
    NullZoneOpen,
    /// 16-bit stores are skipped.
    StoreSkipped,
    /// 32-bit stores write two bytes.
    StoreNarrow,
    /// Signed 16-bit loads are zero-extended.
    SignLost,
    /// Unsigned 8-bit loads are sign-extended.
    SignGained,
    /// BOOL loads keep their byte.
    BoolRaw,
    /// LREAL stores keep the bits of a NaN.
    NanKept,
    /// REAL stores keep the bits of a NaN.
    NanKeptF32,
    /// `Move` copies one byte less.
    MoveShort,
    /// `Move` copies forwards byte for byte, whatever the overlap.
    MoveForward,
    /// `Data` copies one byte less.
    DataShort,
    /// The operands of `sub` are swapped.
    SubSwapped,
    /// `lt` compares unsigned.
    LessUnsigned,
    /// `ne.f64` is FALSE for NaN.
    NotEqualOrdered,
    /// Shifts take the distance modulo 64.
    ShiftMasked,
    /// `shr.s` ignores the width.
    ShiftWidthIgnored,
    /// Rotations are always by 64 bits.
    RotateWide,
    /// `sext32` is zero-extended.
    CutUnsigned,
    /// `select` takes the other operand.
    SelectSwapped,
    /// `f64.i64` rounds half to even.
    RoundEven,
    /// `u64.f64` converts signed.
    UnsignedAsSigned,
    /// Division by zero yields 0.
    DivisionUnchecked,
    /// `MIN / -1` yields 0.
    DivisionOfMin,
    /// `x MOD 0` yields x.
    RemainderOfZero,
    /// Divisions by zero are reported at the body's declaration.
    SiteWrong,
    /// Callers do not add themselves to the trace.
    TraceLost,
    /// The result of a call is not assigned.
    ResultLost,
    /// The result of a native function is not assigned.
    NativeResultLost,
    /// The first two arguments of a call are swapped if their types agree.
    ArgumentsSwapped,
    /// A callee's frame lies over its caller's.
    FrameShared,
    /// The stack region is only checked against the image.
    FrameUnchecked,
    /// One call more than the depth limit is let in.
    DepthLate,
    /// Depth is not given back at a return.
    DepthKept,
    /// Entries of recursive bodies take no fuel.
    EntryFree,
    /// Every poll costs one unit.
    CostIgnored,
    /// The slow path of a poll is taken 64 units late.
    PollLate,
    /// Polls do not look at the flag.
    FlagIgnored,
    /// The last label of a `switch` goes to the default.
    SwitchDefault,
    /// Branches look at the low byte of their condition only.
    BranchByte,
    /// A fault passes its handler.
    HandlerIgnored,
    /// The depth of calls stays what it was where the fault happened.
    DepthLeft,
    /// A handler finds 0 instead of the number of the fault.
    CodeLost,
    /// Everything is of every family.
    FamilyAlways,
    /// Locals that were never written hold 1.
    LocalsDirty,
}
