//! Calls: every body on a cycle counts its depth, so that no program can nest calls without limit, and a bound of the native stack can be told.

use super::{Defect, VerifyError};
use crate::calls::CallGraph;
use crate::inst::BodyId;
use crate::program::Program;

pub(super) fn check(program: &Program) -> Result<(), VerifyError> {
    let graph = CallGraph::new(program);
    let components = graph.components();
    let cycles = components.iter().filter(|component| graph.is_cycle(component));
    let unmarked = |node: &usize| program.bodies.get(*node).is_some_and(|body| !body.recursive);
    match cycles.flatten().copied().filter(unmarked).min() {
        Some(body) => Err(VerifyError { body: Some(BodyId(body as u32)), ..Defect::Recursion.into() }),
        None => Ok(()),
    }
}
