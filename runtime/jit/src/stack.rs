//! How much native stack compiled code can use at the most.
//!
//! A chain of calls holds each body outside cycles at most once, and bodies of cycles at most as often as the depth limit allows: each of their
//! entries is counted.

use takt_ir::Program;

/// What is added for native functions, polls and the way in, bytes.
pub const NATIVE_STACK: usize = 256 * 1024;

/// Frames of the compiled bodies and who calls whom.
#[derive(Debug)]
pub(crate) struct StackUse {
    /// Bytes of the deepest chain of bodies outside cycles.
    chain: usize,
    /// Bytes of the largest frame in a cycle.
    recursive: usize,
}

impl StackUse {
    /// From the frame sizes of the compiled bodies.
    pub(crate) fn new(program: &Program, frames: &[usize]) -> Self {
        let recursive = program.bodies.iter().zip(frames).filter(|(b, _)| b.recursive).map(|(_, f)| *f).max().unwrap_or(0);
        Self { chain: longest_chain(program, frames), recursive }
    }
    /// Bytes at the most.
    pub(crate) fn bound(&self, depth_limit: u32) -> usize {
        self.recursive.saturating_mul(depth_limit as usize + 1).saturating_add(self.chain).saturating_add(NATIVE_STACK)
    }
}

/// The longest path through the graph of calls, where bodies of cycles weigh nothing: relaxed until nothing changes. The number of rounds is bounded
/// for a graph whose cycles were not all marked.
fn longest_chain(program: &Program, frames: &[usize]) -> usize {
    let calls: Vec<Vec<usize>> = program.bodies.iter().map(|body| program.callees(body)).collect();
    let mut below = vec![0; frames.len()];
    for _ in 0..=frames.len() {
        let mut changed = false;
        for body in (0..frames.len()).chain((0..frames.len()).rev()) {
            let weight = if program.bodies[body].recursive { 0 } else { frames[body] };
            let deepest = calls[body].iter().map(|callee| below[*callee]).max().unwrap_or(0) + weight;
            changed |= deepest > below[body];
            below[body] = below[body].max(deepest);
        }
        if !changed {
            break;
        }
    }
    below.into_iter().max().unwrap_or(0)
}
