//! Faults: how a scan fails.

/// Why a scan stopped. Place (site) and call stack are kept beside it by the executor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// An array index outside its bounds.
    Index {
        /// The index.
        value: i64,
        /// Lower bound.
        low: i64,
        /// Upper bound.
        high: i64,
    },
    /// Integer division by zero.
    DivisionByZero,
    /// A NULL pointer, reference or unset VAR_IN_OUT was used.
    NullPointer,
    /// A pointer outside the image was used.
    WildPointer {
        /// The offset.
        offset: u64,
        /// Bytes that were to be reached.
        size: u64,
    },
    /// Calls nested too deeply, or the stack region is used up.
    StackOverflow {
        /// Depth reached.
        depth: u32,
    },
    /// The scan did not end in its fuel or time.
    Watchdog,
    /// A block refused to go on.
    Block {
        /// Its error number (SMC_ERROR where it has one).
        error: u32,
    },
    /// A defect of Takt: a native block panicked.
    Panic,
    /// `__DELETE` of what `__NEW` did not make.
    WrongDelete,
    /// The run was stopped from outside.
    Stopped,
    /// A task started behind a missed release too many times in a row.
    Overruns {
        /// How many times.
        count: u32,
    },
    /// A method was called through a pointer, reference or interface that does not lead to an instance that has it.
    NoInstance {
        /// The offset.
        offset: u64,
    },
}

impl Fault {
    /// The stable number, never 0.
    pub const fn code(self) -> u32 {
        match self {
            Self::Index { .. } => 1,
            Self::DivisionByZero => 2,
            Self::NullPointer => 3,
            Self::WildPointer { .. } => 4,
            Self::StackOverflow { .. } => 5,
            Self::Watchdog => 6,
            Self::Block { .. } => 7,
            Self::Panic => 8,
            Self::WrongDelete => 9,
            Self::Stopped => 10,
            Self::NoInstance { .. } => 11,
            Self::Overruns { .. } => 12,
        }
    }
    /// Whether a program may handle it with `__TRY`: what its own data led to, not what stops it from outside.
    pub fn catchable(code: u32) -> bool {
        Self::from_raw(code, [0; 3]).is_some_and(|fault| match fault {
            Self::Index { .. } | Self::DivisionByZero | Self::NullPointer | Self::WildPointer { .. } => true,
            Self::Block { .. } | Self::WrongDelete | Self::NoInstance { .. } => true,
            Self::StackOverflow { .. } | Self::Watchdog | Self::Overruns { .. } | Self::Panic | Self::Stopped => false,
        })
    }
    /// The facts as three words, for [`crate::Context`].
    pub fn facts(self) -> [i64; 3] {
        match self {
            Self::Index { value, low, high } => [value, low, high],
            Self::WildPointer { offset, size } => [offset as i64, size as i64, 0],
            Self::StackOverflow { depth } => [depth.into(), 0, 0],
            Self::Block { error } => [error.into(), 0, 0],
            Self::NoInstance { offset } => [offset as i64, 0, 0],
            Self::Overruns { count } => [count.into(), 0, 0],
            _ => [0; 3],
        }
    }
    /// The fault with that number and those facts; `None` for 0. An unknown number is a defect ([`Fault::Panic`]).
    pub fn from_raw(code: u32, facts: [i64; 3]) -> Option<Self> {
        Some(match code {
            0 => return None,
            1 => Self::Index { value: facts[0], low: facts[1], high: facts[2] },
            2 => Self::DivisionByZero,
            3 => Self::NullPointer,
            4 => Self::WildPointer { offset: facts[0] as u64, size: facts[1] as u64 },
            5 => Self::StackOverflow { depth: facts[0] as u32 },
            6 => Self::Watchdog,
            7 => Self::Block { error: facts[0] as u32 },
            9 => Self::WrongDelete,
            10 => Self::Stopped,
            11 => Self::NoInstance { offset: facts[0] as u64 },
            12 => Self::Overruns { count: facts[0] as u32 },
            _ => Self::Panic,
        })
    }
    /// The name in JSON and test cases: `index`, `division-by-zero`, …
    pub fn name(self) -> &'static str {
        match self {
            Self::Index { .. } => "index",
            Self::DivisionByZero => "division-by-zero",
            Self::NullPointer => "null-pointer",
            Self::WildPointer { .. } => "wild-pointer",
            Self::StackOverflow { .. } => "stack-overflow",
            Self::Watchdog => "watchdog",
            Self::Block { .. } => "block",
            Self::Panic => "internal-panic",
            Self::WrongDelete => "wrong-delete",
            Self::Stopped => "stopped",
            Self::NoInstance { .. } => "no-instance",
            Self::Overruns { .. } => "overruns",
        }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Index { value, low, high } => write!(f, "index {value} is outside {low}..{high}"),
            Self::DivisionByZero => write!(f, "integer division by zero"),
            Self::NullPointer => write!(f, "a NULL pointer, reference or unassigned VAR_IN_OUT was used"),
            Self::WildPointer { offset, size } => write!(f, "pointer 16#{offset:X} with {size} bytes is outside the program's memory"),
            Self::StackOverflow { depth } => write!(f, "calls are nested too deeply (depth {depth})"),
            Self::Watchdog => write!(f, "the scan did not end in its time (an endless loop?)"),
            Self::Block { error } => write!(f, "the block stopped the program with error {error}"),
            Self::Panic => write!(f, "internal defect of Takt in a block; please report it"),
            Self::WrongDelete => write!(f, "__DELETE of memory that __NEW did not give"),
            Self::Stopped => write!(f, "stopped on request"),
            Self::Overruns { count } => {
                write!(f, "the task missed its release {count} times in a row: its scans, or those of higher tasks, take too long")
            }
            Self::NoInstance { offset } => write!(f, "16#{offset:X} is no instance of a block that can be called here"),
        }
    }
}
impl std::error::Error for Fault {}
