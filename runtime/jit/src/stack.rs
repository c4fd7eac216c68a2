//! How much native stack compiled code can use at the most.
//!
//! A chain of calls holds each body outside cycles at most once, and bodies of cycles at most as often as the depth limit allows: each of their
//! entries is counted.

use takt_ir::{CallGraph, Program};

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

/// The longest path through the graph of calls, where bodies of cycles weigh nothing.
fn longest_chain(program: &Program, frames: &[usize]) -> usize {
    let graph = CallGraph::new(program);
    let mut below = vec![0; graph.nodes()];
    for component in graph.components().iter() {
        let weight = |node: &usize| program.bodies.get(*node).filter(|body| !body.recursive).map_or(0, |_| frames[*node]);
        // Callees come first: what is called and not in the component is known.
        let deepest = component.iter().flat_map(|node| graph.calls(*node)).map(|callee| below[*callee]).max().unwrap_or(0);
        let own: usize = component.iter().map(weight).sum();
        component.iter().for_each(|node| below[*node] = deepest + own);
    }
    below.into_iter().max().unwrap_or(0)
}
