//! Calls: every cycle goes through a body that counts its depth, so that no program can nest calls without limit.

use super::{Defect, VerifyError};
use crate::inst::{BodyId, Inst};
use crate::program::Program;

pub(super) fn check(program: &Program) -> Result<(), VerifyError> {
    let callees: Vec<Vec<u32>> = program.bodies.iter().map(|b| callees(b, program)).collect();
    // 0: not seen, 1: on the way, 2: done.
    let mut seen = vec![0u8; program.bodies.len()];
    for start in 0..program.bodies.len() {
        if seen[start] == 0 && !program.bodies[start].recursive {
            walk(start, &callees, &mut seen)?;
        }
    }
    Ok(())
}

/// Bodies that it calls, without those that count their depth.
fn callees(body: &crate::inst::Body, program: &Program) -> Vec<u32> {
    let calls = body.blocks.iter().flat_map(|b| &b.insts).filter_map(|i| if let Inst::Call { body, .. } = i { Some(body.0) } else { None });
    let mut callees: Vec<u32> = calls.filter(|id| !program.bodies[*id as usize].recursive).collect();
    callees.sort_unstable();
    callees.dedup();
    callees
}

/// Depth first, with its own stack: body and the next of its callees.
fn walk(start: usize, callees: &[Vec<u32>], seen: &mut [u8]) -> Result<(), VerifyError> {
    let mut path = vec![(start, 0)];
    seen[start] = 1;
    while let Some((body, next)) = path.last_mut() {
        let id = *body;
        let Some(&callee) = callees[id].get(*next) else {
            seen[id] = 2;
            path.pop();
            continue;
        };
        *next += 1;
        match seen[callee as usize] {
            0 => {
                seen[callee as usize] = 1;
                path.push((callee as usize, 0));
            }
            1 => return Err(VerifyError { body: Some(BodyId(callee)), ..Defect::Recursion.into() }),
            _ => {}
        }
    }
    Ok(())
}
