//! Calls: every body on a cycle counts its depth, so that no program can nest calls without limit, and a bound of the native stack can be told.

use super::{Defect, VerifyError};
use crate::inst::{Body, BodyId};
use crate::program::Program;

pub(super) fn check(program: &Program) -> Result<(), VerifyError> {
    let calls: Vec<Vec<usize>> = program.bodies.iter().map(|body| callees(program, body)).collect();
    let ends = ends(&calls);
    let unmarked = (0..calls.len()).filter(|body| !ends[*body] && !program.bodies[*body].recursive);
    for body in unmarked {
        if reaches_itself(body, &calls) {
            return Err(VerifyError { body: Some(BodyId(body as u32)), ..Defect::Recursion.into() });
        }
    }
    Ok(())
}

fn callees(program: &Program, body: &Body) -> Vec<usize> {
    let mut callees = program.callees(body);
    callees.sort_unstable();
    callees.dedup();
    callees
}

/// Bodies from which no call leads to a cycle: those without calls, then those that call only such, and so on.
fn ends(calls: &[Vec<usize>]) -> Vec<bool> {
    let mut callers = vec![vec![]; calls.len()];
    for (body, callees) in calls.iter().enumerate() {
        callees.iter().for_each(|callee| callers[*callee].push(body));
    }
    let mut open: Vec<usize> = calls.iter().map(Vec::len).collect();
    let mut ends = vec![false; calls.len()];
    let mut waiting: Vec<usize> = (0..calls.len()).filter(|body| open[*body] == 0).collect();
    while let Some(body) = waiting.pop() {
        ends[body] = true;
        for &caller in &callers[body] {
            open[caller] -= 1;
            if open[caller] == 0 {
                waiting.push(caller);
            }
        }
    }
    ends
}

fn reaches_itself(start: usize, calls: &[Vec<usize>]) -> bool {
    let mut seen = vec![false; calls.len()];
    let mut waiting = calls[start].clone();
    while let Some(body) = waiting.pop() {
        if body == start {
            return true;
        }
        if !std::mem::replace(&mut seen[body], true) {
            waiting.extend(&calls[body]);
        }
    }
    false
}
