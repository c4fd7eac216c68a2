//! Classes: an instance lies inside the image wherever the table says that one begins, and the body of a method takes an instance of its class.

use super::{Defect, ensure, in_image};
use crate::inst::{BodyId, Ty};
use crate::program::{Dispatch, Program};
use takt_abi::GRANULE;

pub(super) fn check(program: &Program) -> Result<(), Defect> {
    for (i, class) in program.classes.iter().enumerate() {
        let fine = class.size > 0 && u64::from(class.size).is_multiple_of(GRANULE) && class.size < program.image_size;
        ensure(fine, Defect::Class(i as u32 + 1))?;
    }
    for run in &program.instances {
        let class = program.class(run.class).ok_or(Defect::Class(run.class))?;
        let bytes = u64::from(class.size) * u64::from(run.count);
        let inside = u32::try_from(bytes).is_ok_and(|bytes| in_image(program, run.offset, bytes));
        ensure(inside && u64::from(run.offset).is_multiple_of(GRANULE), Defect::Class(run.class))?;
    }
    for (i, method) in program.dispatch.iter().enumerate() {
        for (class, target) in method.targets.iter().enumerate().filter_map(|(at, t)| Some((u64::from(method.low) + at as u64, (*t)?))) {
            let size = u32::try_from(class).ok().and_then(|class| program.class(class)).map(|class| class.size);
            ensure(size.is_some_and(|size| takes(program, method, target, size)), Defect::Method(i as u32))?;
        }
    }
    heap(program)
}

/// Whether a body takes an instance of `size` bytes and the parameters of the method.
fn takes(program: &Program, method: &Dispatch, body: BodyId, size: u32) -> bool {
    let Some(body) = program.bodies.get(body.0 as usize) else { return false };
    let params = body.locals.get(..body.params as usize).unwrap_or_default();
    match params {
        [Ty::Addr(extent), rest @ ..] => *extent <= size && rest == method.params && body.result == method.result,
        _ => false,
    }
}

fn heap(program: &Program) -> Result<(), Defect> {
    let (start, len) = program.heap;
    if len == 0 {
        return Ok(());
    }
    let apart = program
        .tasks
        .iter()
        .map(|t| t.stack)
        .all(|(at, size)| u64::from(start) + u64::from(len) <= u64::from(at) || u64::from(at) + u64::from(size) <= u64::from(start));
    let fine = u64::from(start).is_multiple_of(GRANULE) && len >= 16 && len.is_power_of_two() && in_image(program, start, len);
    ensure(fine && apart, Defect::Heap)
}
