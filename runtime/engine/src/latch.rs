//! `{attribute 'task_snapshot'}`: what a task that does not write a variable sees of it during a scan.
//!
//! The image holds the value of whoever runs. Where a reader starts in the middle of a writer's scan, it gets the value from before that scan; where a
//! writer runs in the middle of a reader's scan, the reader keeps what it had. Values change places only where one task interrupts another, so a scan
//! that nobody interrupts pays one copy per variable that it writes. Code does not know of it, so both executors agree.
//!
//! A task that writes such a variable through a pointer alone, which the compiler cannot see, writes into its own view.

use takt_ir::Program;

/// A variable of which tasks see a copy. Bytes of all values are allocated when the program is loaded.
struct Variable {
    start: usize,
    /// Per task, whether it writes the variable.
    writes: Vec<bool>,
    /// The value of the variable while the image holds a reader's.
    live: Vec<u8>,
    /// The value before the scan of the first writer that is under way.
    before: Vec<u8>,
    /// Per task what it sees, while another task runs inside its scan.
    seen: Vec<Vec<u8>>,
    /// Per task, whether what it sees is not the variable's value.
    apart: Vec<bool>,
}

/// All of them.
#[derive(Default)]
pub(crate) struct Latches {
    variables: Vec<Variable>,
    /// Tasks whose scans are under way, the innermost last.
    running: Vec<usize>,
}

impl Latches {
    /// `written_by_bus` says whether the engine itself writes a stretch of the image in scans of the task `bus`: inputs, axes.
    pub fn new(program: &Program, bus: usize, written_by_bus: impl Fn(u32, u32) -> bool) -> Self {
        let tasks = program.tasks.len();
        let variable = |latched: &takt_ir::Latched| {
            let len = program.types.size(latched.ty);
            let writes = |task: usize| latched.writers.contains(&(task as u32)) || task == bus && written_by_bus(latched.offset, len);
            let bytes = vec![0; len as usize];
            Variable {
                start: latched.offset as usize,
                writes: (0..tasks).map(writes).collect(),
                live: bytes.clone(),
                before: bytes.clone(),
                seen: vec![bytes; tasks],
                apart: vec![false; tasks],
            }
        };
        Self { variables: program.latched.iter().map(variable).collect(), running: Vec::with_capacity(tasks) }
    }

    /// A scan of a task starts, inside of the innermost one under way if there is one.
    pub fn enter(&mut self, task: usize, image: &mut [u8]) {
        let outer = self.running.last().copied();
        for v in &mut self.variables {
            let place = &mut image[v.start..v.start + v.live.len()];
            if let Some(outer) = outer.filter(|outer| !v.writes[*outer]) {
                v.seen[outer].copy_from_slice(place);
                if v.apart[outer] {
                    place.copy_from_slice(&v.live);
                }
            }
            let writing = self.running.iter().any(|task| v.writes[*task]);
            if v.writes[task] {
                if !writing {
                    v.before.copy_from_slice(place);
                }
                continue;
            }
            v.apart[task] = writing;
            if writing {
                v.live.copy_from_slice(place);
                place.copy_from_slice(&v.before);
            }
        }
        self.running.push(task);
    }

    /// The innermost scan ends.
    pub fn leave(&mut self, image: &mut [u8]) {
        let Some(task) = self.running.pop() else { return };
        let outer = self.running.last().copied();
        for v in &mut self.variables {
            let place = &mut image[v.start..v.start + v.live.len()];
            if !v.writes[task] && v.apart[task] {
                place.copy_from_slice(&v.live);
            }
            if let Some(outer) = outer.filter(|outer| !v.writes[*outer]) {
                v.live.copy_from_slice(place);
                place.copy_from_slice(&v.seen[outer]);
                v.apart[outer] = true;
            }
        }
    }
}
