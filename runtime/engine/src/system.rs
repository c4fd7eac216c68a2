//! What a program is told of its tasks and of itself: the variables of the types PlcTaskSystemInfo and PlcAppSystemInfo that the library declares.

use crate::schedule::TaskState;
use takt_abi::{AppInfo, Plain, Str, TaskInfo, Time};
use takt_ir::{Program, Type};

/// Where they lie in the image.
#[derive(Debug, Default)]
pub(crate) struct SystemInfo {
    /// Offset of the first task's, and how many there are.
    tasks: Option<(usize, usize)>,
    app: Option<usize>,
    /// What is told of each task, ready to be written.
    known: Vec<TaskInfo>,
}

impl SystemInfo {
    pub fn new(program: &Program, tasks: &[TaskState]) -> Self {
        let is = |ty: takt_ir::TypeId, name: &str, size: usize| matches!(program.types.get(ty), Type::Struct(s) if s.name == name && s.size as usize == size);
        let mut info = Self::default();
        for global in &program.globals {
            let at = global.offset as usize;
            match program.types.get(global.ty) {
                Type::Array { elem, .. } if is(*elem, TaskInfo::DESC.name, size_of::<TaskInfo>()) => {
                    info.tasks = Some((at, program.types.size(global.ty) as usize / size_of::<TaskInfo>()));
                }
                Type::Struct(_) if is(global.ty, AppInfo::DESC.name, size_of::<AppInfo>()) => info.app = Some(at),
                _ => {}
            }
        }
        if info.tasks.is_some() {
            let known = |(task, state): (&takt_ir::Task, &TaskState)| TaskInfo {
                CycleTime: u32::try_from(state.period.0 / 100).unwrap_or(u32::MAX),
                Priority: u16::try_from(state.priority).unwrap_or(u16::MAX),
                TaskName: Str::new(&task.name),
                ..TaskInfo::INIT
            };
            info.known = program.tasks.iter().zip(tasks).map(known).collect();
        }
        info
    }

    /// Before the initial values.
    pub fn start(&self, program: &Program, image: &mut [u8]) {
        (0..self.known.len()).for_each(|index| self.write(index, self.known[index], image));
        if let Some(target) = self.app.and_then(|at| image.get_mut(at..at + size_of::<AppInfo>())) {
            let name = Str::new(&program.name);
            let count = u32::try_from(program.tasks.len()).unwrap_or(u32::MAX);
            AppInfo { TaskCnt: count, AppName: name, ProjectName: name, ..AppInfo::INIT }.store(target);
        }
    }

    /// At the start of a scan; `late`: releases have passed meanwhile.
    pub fn scan(&self, index: usize, now: Time, cycles: u64, late: bool, image: &mut [u8]) {
        let Some(known) = self.known.get(index) else { return };
        let info = TaskInfo {
            CycleCount: cycles as u32,
            DcTaskTime: now.0,
            FirstCycle: (cycles == 1).into(),
            CycleTimeExceeded: late.into(),
            ..*known
        };
        self.write(index, info, image);
    }

    fn write(&self, index: usize, info: TaskInfo, image: &mut [u8]) {
        let Some((first, _)) = self.tasks.filter(|(_, count)| index < *count) else { return };
        let at = first + index * size_of::<TaskInfo>();
        if let Some(target) = image.get_mut(at..at + size_of::<TaskInfo>()) {
            info.store(target);
        }
    }
}
