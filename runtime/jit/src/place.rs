//! Where a function starts within a cache line, chosen so that its small loops cross as few lines as possible.
//!
//! Processors fetch and decode tiny loops up to one and a half times slower when they straddle a line, and the code generator aligns functions only.
//! The start is moved by steps of 16 bytes, which keeps constants in the code aligned; the bytes in front are instructions that do nothing.

/// Bytes of a cache line, and the alignment of every function.
pub(crate) const LINE: u32 = 64;
const STEP: u32 = 16;
/// Loops longer than this do not care.
const SMALL: u32 = 256;

/// By how many bytes to move a function with these edges between blocks (from and to, as offsets into the code; a loop is an edge backwards from the
/// block `from`, which ends at the next of `starts`).
pub(crate) fn shift(starts: &[u32], edges: &[(u32, u32)], size: u32) -> u32 {
    let end_of = |from: u32| starts.iter().copied().filter(|start| *start > from).min().unwrap_or(size);
    let loops: Vec<(u32, u32)> = edges.iter().filter(|(from, to)| to <= from).map(|(from, to)| (*to, end_of(*from))).collect();
    let cost = |shift: u32| -> u32 {
        let crossed = |(start, end): &(u32, u32)| {
            let length = end - start;
            let lines = (end - 1 + shift) / LINE - (start + shift) / LINE;
            // Short loops turn more often.
            if length <= SMALL && length > 0 { (lines - (length - 1) / LINE) * (SMALL / length.max(1)) } else { 0 }
        };
        loops.iter().map(crossed).sum()
    };
    (0..LINE / STEP).map(|k| k * STEP).min_by_key(|shift| (cost(*shift), *shift)).unwrap_or(0)
}

/// `count` bytes of instructions that do nothing, as few as possible; `None` for processors whose encoding is not known here.
pub(crate) fn padding(count: u32) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(count as usize);
    if cfg!(target_arch = "x86_64") {
        // nop word [rax + rax + 0], 8 bytes.
        let nop = [0x0F, 0x1F, 0x84, 0, 0, 0, 0, 0];
        (0..count / 8).for_each(|_| bytes.extend(nop));
    } else if cfg!(target_arch = "aarch64") {
        (0..count / 4).for_each(|_| bytes.extend(0xD503_201F_u32.to_le_bytes()));
    }
    Some(bytes).filter(|bytes| bytes.len() == count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_loop_is_moved_into_one_line() {
        // 31 bytes from 50: crosses at 64; from 66 it does not.
        assert_eq!(shift(&[0, 50, 81], &[(50, 50), (50, 81)], 90), 16);
    }
    #[test]
    fn a_function_without_loops_stays() {
        assert_eq!(shift(&[0, 50, 81], &[(0, 50), (50, 81)], 90), 0);
    }
    #[test]
    fn padding_has_the_length_asked_for() {
        for count in [0, 16, 32, 48] {
            assert!(padding(count).is_none_or(|bytes| bytes.len() == count as usize));
        }
    }
}
