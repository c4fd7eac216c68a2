//! Direct addresses: `%IX0.3`, `%QW4`, `%MD0` as bytes and bits of the three areas.
//!
//! The areas lie in the image like all variables, little endian. How the number of an address counts is the project's choice ([`Areas::word`]): in units of
//! its own width (`%IW3` is bytes 6 and 7, `%IX2.11` bit 11 of word 2), or in bytes (`%IW3` is bytes 3 and 4, `%IX2.3` bit 3 of byte 2).

use crate::types::{Type, TypeId};
use takt_abi::Elem;

/// Bytes that an area may have.
pub const LARGEST_AREA: u32 = 1 << 20;

/// One of the areas that addresses lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Area {
    /// `%I`.
    Input,
    /// `%Q`.
    Output,
    /// `%M`.
    Memory,
}

impl Area {
    /// All, in the order of [`Areas::ranges`].
    pub const ALL: [Self; 3] = [Self::Input, Self::Output, Self::Memory];

    /// `I`, `Q` or `M`.
    pub fn letter(self) -> char {
        ['I', 'Q', 'M'][self as usize]
    }
    fn of(letter: char) -> Option<Self> {
        Self::ALL.into_iter().find(|area| area.letter().eq_ignore_ascii_case(&letter))
    }
}

/// Where the areas of a program lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Areas {
    /// Numbers count in units of the address' own width (bits: in words) rather than in bytes.
    pub word: bool,
    /// Offset into the image and bytes of inputs, outputs and memory; without bytes where nothing uses the area.
    pub ranges: [(u32, u32); 3],
}

impl Areas {
    /// Where the bytes of an address lie in the image, if the area reaches so far.
    pub fn offset(&self, address: Address) -> Option<u32> {
        let (start, len) = self.ranges[address.area as usize];
        (u64::from(address.byte) + u64::from(address.size) <= len.into()).then(|| start + address.byte)
    }
}

/// What an address means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// Where.
    pub area: Area,
    /// First byte in its area.
    pub byte: u32,
    /// Number of the bit in that byte, if the address is that of a bit.
    pub bit: Option<u8>,
    /// Bytes; 1 for a bit.
    pub size: u32,
}

/// Why a text is no address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AddressError {
    /// Not of the form `%IX0.0`, `%QB4`, `%MW2`.
    Malformed,
    /// `%IX3`: the number of the bit is missing.
    NoBit,
    /// A bit that the byte, word or longer unit does not have.
    Bit {
        /// The number of the bit.
        number: u32,
        /// The highest there is.
        highest: u32,
    },
    /// Beyond [`LARGEST_AREA`].
    TooLarge,
}

impl std::fmt::Display for AddressError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Malformed => write!(f, "expected an address such as `%IX0.0`, `%QB4` or `%MW2`"),
            Self::NoBit => write!(f, "the number of the bit is missing, as in `%IX0.3`"),
            Self::Bit { number, highest } => write!(f, "there is no bit {number}: bits are numbered 0 to {highest} here"),
            Self::TooLarge => write!(f, "an area has at the most {LARGEST_AREA} bytes"),
        }
    }
}
impl std::error::Error for AddressError {}

/// The area of a placeholder such as `%I*` or `%QX*`.
pub fn placeholder(text: &str) -> Option<Area> {
    let rest = text.strip_prefix('%')?.strip_suffix('*')?;
    let mut letters = rest.chars();
    Area::of(letters.next()?)
}

/// Reads an address. `word` as in [`Areas::word`].
pub fn parse_address(text: &str, word: bool) -> Result<Address, AddressError> {
    let mut rest = text.trim().strip_prefix('%').ok_or(AddressError::Malformed)?.chars();
    let area = rest.next().and_then(Area::of).ok_or(AddressError::Malformed)?;
    let unit = rest.as_str().chars().next().and_then(unit);
    if unit.is_some() {
        rest.next();
    }
    let unit = unit.unwrap_or(0);
    let mut numbers = rest.as_str().split('.').map(number);
    let position = numbers.next().unwrap_or(Err(AddressError::Malformed))?;
    let bit = numbers.next().transpose()?;
    if numbers.next().is_some() {
        return Err(AddressError::Malformed);
    }
    if unit == 0 && bit.is_none() {
        return Err(AddressError::NoBit);
    }
    // Bits are counted in words or in bytes.
    let size = if unit > 0 { unit } else { 1 + u32::from(word) };
    let mut byte = u64::from(position) * u64::from(if word { size } else { 1 });
    let mut address = Address { area, byte: 0, bit: None, size };
    if let Some(number) = bit {
        let highest = 8 * size - 1;
        if number > highest {
            return Err(AddressError::Bit { number, highest });
        }
        byte += u64::from(number / 8);
        (address.bit, address.size) = (Some((number % 8) as u8), 1);
    }
    address.byte = u32::try_from(byte).ok().filter(|b| *b <= LARGEST_AREA - address.size).ok_or(AddressError::TooLarge)?;
    Ok(address)
}

/// Bytes that a letter behind the area stands for; 0 for a bit.
fn unit(letter: char) -> Option<u32> {
    Some(match letter.to_ascii_uppercase() {
        'X' => 0,
        'B' => 1,
        'W' => 2,
        'D' => 4,
        'L' => 8,
        _ => return None,
    })
}

fn number(digits: &str) -> Result<u32, AddressError> {
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return Err(AddressError::Malformed);
    }
    digits.parse().map_err(|_| AddressError::TooLarge)
}

impl Address {
    /// The type that what lies there has where nothing declares it.
    pub fn ty(&self) -> Type {
        match (self.bit, self.size) {
            (Some(bit), _) => Type::Bit(bit),
            (None, 1) => Type::Elem(Elem::Byte),
            (None, 2) => Type::Elem(Elem::Word),
            (None, 4) => Type::Elem(Elem::Dword),
            (None, _) => Type::Elem(Elem::Lword),
        }
    }
}

/// A variable that was declared at a placeholder (`AT %I*`) and that VAR_CONFIG gives an address. It is a variable like others; around the scans of the bus
/// task its value is copied from its address (`%I`), to it (`%Q`), or wherever it has changed (`%M`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mapped {
    /// The area of its address.
    pub area: Area,
    /// Type of the variable.
    pub ty: TypeId,
    /// Offset of the variable.
    pub offset: u32,
    /// Offset of the address.
    pub address: u32,
    /// The bit there, of a BOOL.
    pub bit: Option<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, word: (u32, Option<u8>), byte: (u32, Option<u8>)) {
        for (counts, expected) in [(true, word), (false, byte)] {
            let found = parse_address(text, counts).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!((found.byte, found.bit), expected, "{text}");
        }
    }

    #[test]
    fn numbers_count_in_units_or_in_bytes() {
        check("%IW3", (6, None), (3, None));
        check("%QB4", (4, None), (4, None));
        check("%md1", (4, None), (1, None));
        check("%ML2", (16, None), (2, None));
        check("%IX2.3", (4, Some(3)), (2, Some(3)));
        check("%I2.3", (4, Some(3)), (2, Some(3)));
        check("%IW2.11", (5, Some(3)), (3, Some(3)));
        assert_eq!(parse_address("%IX2.11", true).map(|a| (a.byte, a.bit)), Ok((5, Some(3))));
    }

    #[test]
    fn what_is_no_address_says_why() {
        let refused = |text: &str| parse_address(text, false).expect_err(text);
        assert_eq!(refused("%IX2.11"), AddressError::Bit { number: 11, highest: 7 });
        assert_eq!(refused("%IX2"), AddressError::NoBit);
        assert_eq!(refused("%IW1048575"), AddressError::TooLarge);
        assert_eq!(refused("%IB99999999999"), AddressError::TooLarge);
        for text in ["", "%", "%I", "%K3", "IX0.0", "%IX0.", "%IX.0", "%IW1.2.3", "%IXa.0", "%I*", "%ä1"] {
            assert_eq!(refused(text), AddressError::Malformed, "{text}");
        }
        assert_eq!((placeholder("%I*"), placeholder("%QX*"), placeholder("%MW0")), (Some(Area::Input), Some(Area::Output), None));
    }
}
