//! Values as bytes, for checkpoints: little endian, without names, in one fixed order. What is read back is checked; nothing is trusted.

use crate::axis::cia402::DriveState;
use crate::bus::{DriveIn, DriveOut, IoFault, ProcessImage};
use crate::fault::RawFault;
use takt_abi::{Fault, Time};

/// A value that can be written and read back.
pub(crate) trait Pack: Sized {
    /// Appends it.
    fn pack(&self, out: &mut Vec<u8>);
    /// Takes it from the front; `None` if it is not there.
    fn unpack(from: &mut &[u8]) -> Option<Self>;
}

macro_rules! pack_numbers {
    ($($ty:ty),*) => {$(
        impl Pack for $ty {
            fn pack(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn unpack(from: &mut &[u8]) -> Option<Self> {
                let (head, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(Self::from_le_bytes(*head))
            }
        }
    )*};
}
pack_numbers!(u8, i8, u16, i16, u32, i32, u64, i64, f64);

/// A structure as its fields, in this order.
macro_rules! pack_fields {
    ($ty:ty { $($field:ident),* $(,)? }) => {
        impl $crate::pack::Pack for $ty {
            fn pack(&self, out: &mut Vec<u8>) {
                let Self { $($field),* } = self;
                $($crate::pack::Pack::pack($field, out);)*
            }
            fn unpack(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: $crate::pack::Pack::unpack(from)?),* })
            }
        }
    };
}
pub(crate) use pack_fields;

impl Pack for bool {
    fn pack(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        match u8::unpack(from)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Pack for usize {
    fn pack(&self, out: &mut Vec<u8>) {
        (*self as u64).pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        u64::unpack(from)?.try_into().ok()
    }
}

impl Pack for Time {
    fn pack(&self, out: &mut Vec<u8>) {
        self.0.pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some(Self(i64::unpack(from)?))
    }
}

impl<T: Pack> Pack for Option<T> {
    fn pack(&self, out: &mut Vec<u8>) {
        self.is_some().pack(out);
        if let Some(value) = self {
            value.pack(out);
        }
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some(if bool::unpack(from)? { Some(T::unpack(from)?) } else { None })
    }
}

impl<T: Pack> Pack for Vec<T> {
    fn pack(&self, out: &mut Vec<u8>) {
        self.len().pack(out);
        self.iter().for_each(|value| value.pack(out));
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        // An element has one byte at least, so a wrong length ends here and not in an allocation.
        let len = usize::unpack(from).filter(|len| *len <= from.len())?;
        (0..len).map(|_| T::unpack(from)).collect()
    }
}

impl<A: Pack, B: Pack> Pack for (A, B) {
    fn pack(&self, out: &mut Vec<u8>) {
        self.0.pack(out);
        self.1.pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some((A::unpack(from)?, B::unpack(from)?))
    }
}

impl Pack for Fault {
    fn pack(&self, out: &mut Vec<u8>) {
        self.code().pack(out);
        self.facts().iter().for_each(|fact| fact.pack(out));
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        let code = u32::unpack(from)?;
        let facts = [i64::unpack(from)?, i64::unpack(from)?, i64::unpack(from)?];
        Fault::from_raw(code, facts).filter(|fault| fault.code() == code)
    }
}

impl Pack for RawFault {
    fn pack(&self, out: &mut Vec<u8>) {
        let Self { fault, site, trace, trace_len, task, time, cycle } = self;
        fault.pack(out);
        site.pack(out);
        trace_len.pack(out);
        trace[..*trace_len].iter().for_each(|site| site.pack(out));
        (*task, (*time, *cycle)).pack(out);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        let (fault, site) = (Fault::unpack(from)?, u32::unpack(from)?);
        let trace_len = usize::unpack(from).filter(|len| *len <= takt_abi::TRACE_DEPTH)?;
        let mut trace = [0; takt_abi::TRACE_DEPTH];
        for entry in &mut trace[..trace_len] {
            *entry = u32::unpack(from)?;
        }
        let (task, (time, cycle)) = Pack::unpack(from)?;
        Some(Self { fault, site, trace, trace_len, task, time, cycle })
    }
}

impl Pack for IoFault {
    fn pack(&self, out: &mut Vec<u8>) {
        match *self {
            Self::Late { by } => {
                out.push(0);
                by.pack(out);
            }
            Self::Station { address, expected, found } => {
                out.push(1);
                [address, expected, found].iter().for_each(|word| word.pack(out));
            }
            Self::Lost => out.push(2),
            Self::Panic => out.push(3),
        }
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        Some(match u8::unpack(from)? {
            0 => Self::Late { by: Time::unpack(from)? },
            1 => Self::Station { address: u16::unpack(from)?, expected: u16::unpack(from)?, found: u16::unpack(from)? },
            2 => Self::Lost,
            3 => Self::Panic,
            _ => return None,
        })
    }
}

impl Pack for DriveState {
    fn pack(&self, out: &mut Vec<u8>) {
        out.push(*self as u8);
    }
    fn unpack(from: &mut &[u8]) -> Option<Self> {
        let number = u8::unpack(from)?;
        Self::ALL.into_iter().find(|state| *state as u8 == number)
    }
}

pack_fields!(DriveIn { online, status_word, mode_display, position, velocity, torque, error_code, following_error, digital_inputs });
pack_fields!(DriveOut { control_word, mode, position, velocity, velocity_offset });
pack_fields!(ProcessImage { drives_in, drives_out, bits_in, bits_out, analog_in, analog_out });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_and_what_is_cut_or_too_long_is_refused() {
        let value: Vec<(Option<IoFault>, (f64, bool))> = vec![
            (None, (1.5, true)),
            (Some(IoFault::Station { address: 1, expected: 2, found: 3 }), (f64::NAN, false)),
            (Some(IoFault::Late { by: Time(7) }), (-0.0, true)),
        ];
        let mut bytes = Vec::new();
        value.pack(&mut bytes);
        let back: Vec<(Option<IoFault>, (f64, bool))> = Pack::unpack(&mut bytes.as_slice()).expect("whole");
        assert_eq!(format!("{back:?}"), format!("{value:?}"));
        for cut in 0..bytes.len() {
            assert!(Vec::<(Option<IoFault>, (f64, bool))>::unpack(&mut &bytes[..cut]).is_none(), "{cut}");
        }
        bytes[..8].copy_from_slice(&(1u64 << 60).to_le_bytes());
        assert!(Vec::<u8>::unpack(&mut bytes.as_slice()).is_none());
    }
}
