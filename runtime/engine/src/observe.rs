//! Somebody who looks at the program after each scan, those included that ran inside a lower task.

use crate::core::Core;
use crate::engine::{CONDITION_FUEL, changes_image};
use crate::executor::Executor;
use crate::memory::execute;
use takt_abi::{Fault, Time};
use takt_ir::{BodyId, Place};

/// Looks at a program after each scan. It runs within the step: it must neither allocate nor wait.
pub trait Observer {
    /// A scan is over.
    fn scanned(&mut self, scan: &mut Scanned<'_>);
}

/// A program after a scan.
pub struct Scanned<'c> {
    core: &'c mut Core,
    task: usize,
    now: Time,
}

impl std::fmt::Debug for Scanned<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Scanned").field("task", &self.task).field("now", &self.now).finish_non_exhaustive()
    }
}

impl Scanned<'_> {
    /// The task (index into [`takt_ir::Program::tasks`]).
    pub fn task(&self) -> usize {
        self.task
    }
    /// When the scan started.
    pub fn now(&self) -> Time {
        self.now
    }
    /// The bytes of a variable; empty if the place is not of this program.
    pub fn read(&self, place: Place) -> &[u8] {
        let types = &self.core.program.types;
        if place.ty.0 as usize >= types.all().len() {
            return &[];
        }
        let start = place.offset as usize;
        self.core.image.bytes().get(start..start + types.size(place.ty) as usize).unwrap_or(&[])
    }
    /// The value of a condition, as [`crate::Engine::evaluate`] has it; `None` if evaluating it might change the program, which is mid-scan perhaps.
    pub fn evaluate(&mut self, body: BodyId) -> Option<Result<u64, Fault>> {
        if changes_image(&self.core.program, body) {
            return None;
        }
        let core = &mut *self.core;
        let (start, size) = core.spare_stack();
        core.spare.get_mut().prepare(CONDITION_FUEL, u64::from(start) + u64::from(size));
        let fault = execute(core, |core, _| &mut core.spare, 0, &Executor::Interpreter, body, start.into());
        let result = core.spare.get().interpreter.result();
        Some(fault.map_or(Ok(result), Err))
    }
}

impl Core {
    /// Stack of a task that has no scan under way: where conditions are evaluated.
    fn spare_stack(&self) -> (u32, u32) {
        let idle = self.tasks.iter().find(|task| !task.running);
        idle.map_or((0, 0), |task| task.stack)
    }

    /// Lets the observer look.
    pub fn observe(&mut self, task: usize, now: Time) {
        let Some(mut observer) = self.observer.take() else { return };
        observer.scanned(&mut Scanned { core: self, task, now });
        self.observer = Some(observer);
    }
}
