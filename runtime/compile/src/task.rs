//! Tasks: from CONFIGURATION, or the one that is meant without it.

use crate::constant::Value;
use crate::expression::{Kind, Lowering};
use crate::initial::Known;
use crate::place::Place;
use crate::scope::{Item, PouKind, key, same};
use crate::unit::Compiler;
use takt_ir::{Base, BodyId, Task, Term, Trigger};
use takt_syntax::tree::{self, Unit};
use takt_syntax::{Code, FileId, Span};

/// Bytes of stack region per task.
const STACK: u32 = 1 << 20;

/// Bytes of the heap unless the project says otherwise.
const HEAP: u32 = 1 << 20;

/// Period of the task that is meant without a CONFIGURATION: 10 ms.
const DEFAULT_PERIOD: i64 = 10_000_000;

/// A task before its stack is laid out.
pub(crate) struct Planned {
    name: String,
    trigger: Trigger,
    priority: u32,
    entry: BodyId,
    /// `{attribute 'isolated'}`.
    isolated: bool,
    span: Span,
}

impl<'a> Compiler<'a> {
    /// The tasks and the bodies that call their programs.
    pub(crate) fn tasks(&mut self) -> Vec<Planned> {
        let trees = self.trees;
        let configurations: Vec<&'a tree::Configuration> = trees
            .iter()
            .take(self.user_files)
            .flat_map(|t| &t.units)
            .filter_map(|u| match u {
                Unit::Configuration(c) => Some(c),
                _ => None,
            })
            .collect();
        if let Some(second) = configurations.get(1) {
            self.report(Code::BadTask, second.name.span, "a program has one CONFIGURATION")
                .notes
                .push(takt_syntax::Note { span: configurations[0].name.span, message: "the first is here".into() });
        }
        match configurations.first() {
            Some(configuration) => self.configured_tasks(configuration),
            None => self.default_task(),
        }
    }

    fn default_task(&mut self) -> Vec<Planned> {
        let programs: Vec<usize> =
            (0..self.pous.len()).filter(|i| !self.pous[*i].library && self.pous[*i].tree.kind == PouKind::Program).collect();
        let named = |name: &str| programs.iter().copied().find(|i| key(&self.pous[*i].tree.name.text) == name);
        let chosen = named("PLC_PRG").or_else(|| named("MAIN")).or(if let [only] = programs[..] { Some(only) } else { None });
        let Some(program) = chosen else {
            let span = Span { file: FileId(0), start: 0, end: 0 };
            if self.user_files > 0 && self.diagnostics.is_empty() {
                let found = programs.len();
                self.report(
                    Code::NoProgram,
                    span,
                    format!("expected a CONFIGURATION, or a PROGRAM named PLC_PRG or MAIN, or exactly one PROGRAM; found {found}"),
                )
                .help = Some("name the program to run `PLC_PRG`".into());
            }
            return Vec::new();
        };
        let span = self.pous[program].tree.name.span;
        let entry = self.entry("MainTask", &[(program, &[])], span);
        vec![Planned { name: "MainTask".into(), trigger: Trigger::Cyclic(DEFAULT_PERIOD), priority: 1, entry, isolated: false, span }]
    }

    fn configured_tasks(&mut self, configuration: &'a tree::Configuration) -> Vec<Planned> {
        let mut tasks: Vec<Planned> = Vec::new();
        for task in &configuration.tasks {
            if tasks.iter().any(|t| same(&t.name, &task.name.text)) {
                self.report(Code::DuplicateName, task.name.span, format!("the task `{}` is declared twice", task.name.text));
                continue;
            }
            let programs = self.programs_of(configuration, &task.name);
            let (trigger, priority) = self.task_arguments(task);
            let entry = self.entry(&task.name.text, &programs, task.name.span);
            let isolated = task.pragmas.iter().any(|pragma| pragma.name == "isolated");
            tasks.push(Planned { name: task.name.text.clone(), trigger, priority, entry, isolated, span: task.name.span });
        }
        for program in &configuration.programs {
            let known = program.task.as_ref().is_some_and(|t| configuration.tasks.iter().any(|d| same(&d.name.text, &t.text)));
            if !known {
                let (span, message) = match &program.task {
                    Some(task) => (task.span, format!("the task `{}` is not declared", task.text)),
                    None => (
                        program.name.span,
                        format!("`{}` belongs to no task; write `PROGRAM {} WITH task : …`", program.name.text, program.name.text),
                    ),
                };
                self.report(Code::BadTask, span, message);
            }
        }
        if tasks.is_empty() {
            self.report(Code::NoProgram, configuration.name.span, "this CONFIGURATION has no task");
        }
        tasks
    }

    /// The programs of a task with their connections.
    fn programs_of(&mut self, configuration: &'a tree::Configuration, task: &tree::Name) -> Vec<(usize, &'a [tree::Arg])> {
        let mut programs = Vec::new();
        for program in configuration.programs.iter().filter(|p| p.task.as_ref().is_some_and(|t| same(&t.text, &task.text))) {
            match self.global_name(&program.ty.text) {
                Some(Item::Pou(i)) if self.pous[i].tree.kind == PouKind::Program => {
                    programs.push((i, program.connections.as_slice()));
                    self.second_name(&program.name, i);
                }
                _ => {
                    let help = self.suggest(&program.ty.text, true);
                    self.report(Code::UnknownType, program.ty.span, format!("`{}` is not a PROGRAM", program.ty.text)).help = help;
                }
            }
        }
        programs
    }

    /// The instance name of a CONFIGURATION is a second name for the program.
    fn second_name(&mut self, name: &tree::Name, pou: usize) {
        if self.global_name(&name.text).is_some() {
            return;
        }
        self.names.insert(key(&name.text), Item::Pou(pou));
        let ty = self.pou_type(pou);
        let offset = self.pous[pou].instance;
        let doc = self.pous[pou].tree.doc.unwrap_or_default().into();
        self.program.globals.push(takt_ir::Global { name: name.text.clone(), bare: true, ty, offset, constant: false, doc });
    }

    fn task_arguments(&mut self, task: &'a tree::TaskDecl) -> (Trigger, u32) {
        let mut trigger = None;
        let mut priority = 1;
        for (name, value) in &task.args {
            match key(&name.text).as_str() {
                "INTERVAL" => match self.interval(value) {
                    Some(0) => trigger = Some(Trigger::Freewheeling),
                    Some(ns) => trigger = Some(Trigger::Cyclic(ns)),
                    None => {}
                },
                "PRIORITY" => match self.constant_int(value, None) {
                    Some(p) if (0..=255).contains(&p) => priority = p as u32,
                    Some(p) => {
                        self.report(Code::BadTask, value.span, format!("a priority is 0 (highest) to 255, found {p}"));
                    }
                    None => {}
                },
                "SINGLE" => trigger = self.event(value).or(trigger),
                _ => {
                    self.report(Code::BadTask, name.span, format!("expected INTERVAL, PRIORITY or SINGLE, found `{}`", name.text));
                }
            }
        }
        (trigger.unwrap_or(Trigger::Freewheeling), priority)
    }

    /// A constant TIME or LTIME in nanoseconds.
    fn interval(&mut self, value: &'a tree::Expr) -> Option<i64> {
        let ltime = self.elem(takt_abi::Elem::Ltime);
        match self.known(value, None, Some(ltime)).0 {
            Known::Value(Value::Int(ns)) if (0..=86_400_000_000_000).contains(&ns) => Some(ns as i64),
            Known::Value(_) => {
                self.report(Code::BadTask, value.span, "an interval is between 0 and a day");
                None
            }
            Known::Dynamic => {
                self.report(Code::NotConstant, value.span, "an interval must be constant");
                None
            }
            Known::Error => None,
        }
    }

    /// The BOOL variable whose rising edge starts the task.
    fn event(&mut self, value: &'a tree::Expr) -> Option<Trigger> {
        let mut scratch = crate::expression::Lowering::scratch(self, None);
        let operand = scratch.expr(value);
        let bool_type = scratch.bool_type();
        match operand.kind {
            Kind::Place(Place::Memory { base: Base::Image, offset }) if operand.ty == bool_type => Some(Trigger::Event(offset, None)),
            Kind::Place(Place::Bits { whole, shift, width: 1, .. }) if let Place::Memory { base: Base::Image, offset } = *whole => {
                Some(Trigger::Event(offset + shift / 8, Some((shift % 8) as u8)))
            }
            Kind::Error => None,
            _ => {
                self.report(Code::BadTask, value.span, "SINGLE needs a global BOOL variable");
                None
            }
        }
    }

    /// The body that calls the programs of a task.
    fn entry(&mut self, name: &str, programs: &[(usize, &'a [tree::Arg])], span: Span) -> BodyId {
        let id = self.reserve(name, span);
        let mut lowering = Lowering::new(self, id, name, None, span);
        for (program, connections) in programs {
            let ty = lowering.c.pou_type(*program);
            let offset = lowering.c.pous[*program].instance.max(takt_ir::NULL_ZONE);
            let tree = lowering.c.pous[*program].tree;
            let at = tree.name.span;
            if connections.is_empty() && tree.vars.iter().any(|v| v.kind == tree::VarKind::InOut && !v.vars.is_empty()) {
                lowering.report(Code::BadTask, at, "a PROGRAM that a task calls has no VAR_IN_OUT").help =
                    Some("connect it in the CONFIGURATION: `PROGRAM p WITH task : name(x := GVL.x);`".into());
                continue;
            }
            let instance = lowering.at(Place::Memory { base: Base::Image, offset }, ty, at);
            lowering.call_instance(instance, connections, span);
        }
        lowering.b.end(Term::Return(None));
        let body = lowering.finish();
        self.program.bodies[id.0 as usize] = body;
        id
    }

    /// Puts the stacks behind the variables and closes the image.
    pub(crate) fn finish_image(&mut self, tasks: Vec<Planned>) {
        for Planned { name, trigger, priority, entry, isolated, span } in tasks {
            let start = self.take(STACK, 16, span);
            self.program.tasks.push(Task { name, trigger, priority, entry, stack: (start, STACK), isolated });
        }
        if self.heap {
            let wanted = if self.options.heap == 0 { HEAP } else { self.options.heap };
            let len = wanted.max(16).checked_next_power_of_two().unwrap_or(1 << 31);
            let span = Span { file: FileId(0), start: 0, end: 0 };
            self.program.heap = (self.take(len, 16, span), len);
        }
        self.program.image_size = self.next.next_multiple_of(16) as u32;
        self.program.resources.sort_by_key(|r| r.offset);
    }
}
