//! Bodies: typed locals, blocks, few instruction shapes over the operator table.

use crate::op::Op;
use takt_abi::Fault;

/// Type of a local. Integers of every width are computed in 64 bits (sign- or zero-extended when loaded, cut when stored); BOOL is 0 or 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ty {
    /// Integer, BOOL, enumeration, time, pointer (an offset into the image).
    I64,
    /// REAL.
    F32,
    /// LREAL.
    F64,
    /// A checked address: at least this many bytes from it lie inside the image. Made only by [`Inst::Address`], [`Inst::Index`], [`Inst::Deref`] and parameters.
    Addr(u32),
}

/// A local of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Local(pub u32);
/// A block of a body; 0 is the entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BlockId(pub u32);
/// A body of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId(pub u32);
/// A native function of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NativeId(pub u32);
/// A place in the source (index into [`crate::Program::sites`]); where faults and calls are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SiteId(pub u32);

/// How a value lies in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mem {
    /// One byte; loads as 1 when it is not 0.
    Bool,
    /// Signed, loads sign-extended.
    I8,
    /// Unsigned, loads zero-extended.
    U8,
    /// Signed.
    I16,
    /// Unsigned.
    U16,
    /// Signed.
    I32,
    /// Unsigned.
    U32,
    /// All 64 bits.
    I64,
    /// REAL; a store makes any NaN the canonical one (16#7FC00000).
    F32,
    /// LREAL; a store makes any NaN the canonical one (16#7FF8000000000000).
    F64,
}

impl Mem {
    /// Bytes.
    pub fn size(self) -> u32 {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::F64 => 8,
        }
    }
    /// Type of the local that is loaded or stored.
    pub fn ty(self) -> Ty {
        match self {
            Self::F32 => Ty::F32,
            Self::F64 => Ty::F64,
            _ => Ty::I64,
        }
    }
}

/// Where an access starts; an offset is added to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Base {
    /// The image.
    Image,
    /// The body's frame in the stack region.
    Frame,
    /// A local of type [`Ty::Addr`].
    Local(Local),
}

/// A constant. Floats by their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Const {
    /// Integer.
    I64(i64),
    /// REAL.
    F32(u32),
    /// LREAL.
    F64(u64),
}

/// An instruction.
#[derive(Debug, Clone, PartialEq)]
pub enum Inst {
    /// `dst = value`.
    Const {
        /// Result.
        dst: Local,
        /// Value.
        value: Const,
    },
    /// `dst = op(args)`. If [`Op::faults`] (a divisor of 0), the fault is at `site`.
    Op {
        /// Operator.
        op: Op,
        /// Result.
        dst: Local,
        /// As many as the operator takes.
        args: Vec<Local>,
        /// Place.
        site: SiteId,
    },
    /// `dst = src`, of the same type (addresses may lose extent).
    Copy {
        /// Result.
        dst: Local,
        /// Value.
        src: Local,
    },
    /// `dst = mem[base + offset]`.
    Load {
        /// Result.
        dst: Local,
        /// How it lies there.
        mem: Mem,
        /// Start.
        base: Base,
        /// Bytes behind it.
        offset: u32,
    },
    /// `mem[base + offset] = src`.
    Store {
        /// Value.
        src: Local,
        /// How it lies there.
        mem: Mem,
        /// Start.
        base: Base,
        /// Bytes behind it.
        offset: u32,
    },
    /// `dst = address of base + offset`.
    Address {
        /// Result, [`Ty::Addr`].
        dst: Local,
        /// Start.
        base: Base,
        /// Bytes behind it.
        offset: u32,
    },
    /// `dst = address of base + offset + (index - low) * stride`; fault `Index` unless low ≤ index ≤ high.
    Index {
        /// Result, [`Ty::Addr`].
        dst: Local,
        /// Start.
        base: Base,
        /// Bytes behind it.
        offset: u32,
        /// Index, I64.
        index: Local,
        /// Lower bound.
        low: i64,
        /// Upper bound.
        high: i64,
        /// Bytes per element.
        stride: u32,
        /// Place.
        site: SiteId,
    },
    /// Fault `Index` unless low ≤ index ≤ high (bounds of `ARRAY[*]` are locals).
    Check {
        /// Index.
        index: Local,
        /// Lower bound.
        low: Local,
        /// Upper bound.
        high: Local,
        /// Place.
        site: SiteId,
    },
    /// `dst = pointer`, checked: fault `NullPointer` if it is 0, `WildPointer` unless it lies behind the null zone and all bytes of dst's extent inside the image.
    Deref {
        /// Result, [`Ty::Addr`].
        dst: Local,
        /// Offset into the image, I64.
        pointer: Local,
        /// Place.
        site: SiteId,
    },
    /// `dst = offset into the image of base + offset` (ADR).
    Pointer {
        /// Result, I64.
        dst: Local,
        /// Start.
        base: Base,
        /// Bytes behind it.
        offset: u32,
    },
    /// Copies `len` bytes; the ranges may overlap.
    Move {
        /// Target.
        dst: Base,
        /// Bytes behind it.
        dst_offset: u32,
        /// Source.
        src: Base,
        /// Bytes behind it.
        src_offset: u32,
        /// Bytes.
        len: u32,
    },
    /// Copies `len` constant bytes from [`crate::Program::data`].
    Data {
        /// Target.
        dst: Base,
        /// Bytes behind it.
        offset: u32,
        /// First byte in the pool.
        data: u32,
        /// Bytes.
        len: u32,
    },
    /// Calls a body.
    Call {
        /// Which.
        body: BodyId,
        /// Its parameters.
        args: Vec<Local>,
        /// Result.
        dst: Option<Local>,
        /// Place.
        site: SiteId,
    },
    /// Calls a native function: I64 and addresses (as offsets) and float bits go as words; one word more is passed than `args` (see [`takt_abi::FnDesc`]).
    Native {
        /// Which.
        native: NativeId,
        /// Words.
        args: Vec<Local>,
        /// Result, from word 0.
        dst: Option<Local>,
        /// Place.
        site: SiteId,
    },
    /// Calls the body that [`crate::Program::dispatch`] has for the class of the instance at `this`: fault `NullPointer` if that is 0, `NoInstance` if no
    /// instance of a class that has the method begins there.
    Virtual {
        /// Number of the method.
        method: u32,
        /// Offset of the instance, I64.
        this: Local,
        /// Parameters behind the instance.
        args: Vec<Local>,
        /// Result.
        dst: Option<Local>,
        /// Place.
        site: SiteId,
    },
    /// `dst = 1` if an instance of a class of [`crate::Program::families`] begins at `pointer`, else 0.
    IsA {
        /// Result, I64.
        dst: Local,
        /// Offset, I64.
        pointer: Local,
        /// Number of the family.
        family: u32,
    },
    /// From now on instances of this class stand in the frame (until something else does).
    Place {
        /// Offset in the frame of the first, a multiple of [`takt_abi::GRANULE`].
        offset: u32,
        /// Class.
        class: u32,
        /// How many, one behind the other.
        count: u32,
    },
    /// Keeps the depth of calls for [`Inst::Catch`].
    Guard {
        /// Result, I64.
        dst: Local,
    },
    /// First instruction of a handler: takes the fault that led here, and sets the depth of calls back.
    Catch {
        /// The number of the fault ([`Fault::code`]), I64.
        dst: Local,
        /// What [`Inst::Guard`] kept, I64.
        depth: Local,
    },
    /// Takes fuel; when it is used up or the flag is set, the engine decides (fault, preemption).
    Poll {
        /// Units.
        cost: u32,
        /// Place.
        site: SiteId,
    },
}

/// End of a block.
#[derive(Debug, Clone, PartialEq)]
pub enum Term {
    /// Go on there.
    Jump(BlockId),
    /// Go on by a condition (I64, not 0 is TRUE).
    Branch {
        /// Condition.
        cond: Local,
        /// If not 0.
        then: BlockId,
        /// If 0.
        other: BlockId,
    },
    /// Go on by a value; labels are distinct.
    Switch {
        /// Value, I64.
        value: Local,
        /// Labels.
        cases: Vec<(i64, BlockId)>,
        /// If none fits.
        default: BlockId,
    },
    /// Return to the caller.
    Return(Option<Local>),
    /// Stop with a fault.
    Fault(Fault, SiteId),
    /// Stop with the fault that [`Inst::Catch`] took, of which this is the number, as if it had not been caught.
    Rethrow(Local),
}

/// Straight code.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Instructions.
    pub insts: Vec<Inst>,
    /// End.
    pub term: Term,
    /// Where a fault in this block (or in what it calls) leads, if it is one that a program may handle ([`Fault::catchable`]). Addresses that were
    /// written in this block are not known there.
    pub handler: Option<BlockId>,
}

/// A compiled function, block body, program or initialisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// As people know it: `PLC_PRG`, `TON`, `GVL (initial values)`.
    pub name: String,
    /// The first `params` locals are the parameters.
    pub params: u32,
    /// Types of all locals. A local that is read before it is written is 0 (for an address: forbidden by the verifier).
    pub locals: Vec<Ty>,
    /// Result.
    pub result: Option<Ty>,
    /// Blocks; 0 is the entry.
    pub blocks: Vec<Block>,
    /// Bytes of the frame in the stack region (multiple of 16). A frame starts where the caller's ends; its bytes are what was there before.
    pub frame_size: u32,
    /// Part of a cycle of calls: each entry counts depth against the limit and takes one unit of fuel (as `Poll{1, entry_site}`), after the frame has been checked.
    pub recursive: bool,
    /// The body's declaration.
    pub entry_site: SiteId,
}
