//! The compiler's state and the order of its work.

use crate::emit::Builder;
use crate::scope::{Declared, GlobalVar, Item, List, Pou};
use crate::sites::Sites;
use crate::{Input, Options};
use std::collections::HashMap;
use takt_ir::{BodyId, Native, NativeId, Program, TypeId, Types};
use takt_syntax::{Code, Diagnostic, FileId, Source, Span, tree};

/// What a queued body is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Job {
    Pou(usize),
    Action(usize, usize),
}

/// Everything that is known while a program is compiled.
pub(crate) struct Compiler<'a> {
    pub(crate) libraries: &'a [&'a takt_abi::Library],
    pub(crate) options: &'a Options,
    pub(crate) files: &'a [Source],
    pub(crate) trees: &'a [tree::File],
    pub(crate) user_files: usize,
    pub(crate) diagnostics: Vec<Diagnostic>,
    pub(crate) types: Types,
    /// User's names.
    pub(crate) names: HashMap<String, Item>,
    /// Libraries' names.
    pub(crate) library_names: HashMap<String, Item>,
    /// Where a user's name was declared, for messages.
    pub(crate) declared_at: HashMap<String, Span>,
    pub(crate) pous: Vec<Pou<'a>>,
    pub(crate) declared: Vec<Declared<'a>>,
    pub(crate) globals: Vec<GlobalVar<'a>>,
    pub(crate) lists: Vec<List>,
    pub(crate) native_blocks: HashMap<TypeId, &'static takt_abi::BlockDesc>,
    /// Initial bytes of struct-like types with an initial value of their own.
    pub(crate) type_init: HashMap<TypeId, std::rc::Rc<Vec<u8>>>,
    /// Initial values of aliases and enumerations.
    pub(crate) pou_of_type: HashMap<TypeId, usize>,
    pub(crate) program: Program,
    pub(crate) natives: HashMap<&'static str, NativeId>,
    pub(crate) sites: Sites,
    pub(crate) queue: Vec<(BodyId, Job)>,
    /// Next free byte of the image.
    pub(crate) next: u64,
    /// Statements that set what cannot be bytes: (variable's place, initialiser).
    pub(crate) late: Vec<crate::initial::Late<'a>>,
}

impl<'a> Compiler<'a> {
    pub(crate) fn new(input: &Input<'a>, files: &'a [Source], trees: &'a [tree::File], diagnostics: Vec<Diagnostic>) -> Self {
        Self {
            libraries: input.libraries,
            options: input.options,
            files,
            trees,
            user_files: input.sources.len(),
            diagnostics,
            types: Types::default(),
            names: HashMap::new(),
            library_names: HashMap::new(),
            declared_at: HashMap::new(),
            pous: Vec::new(),
            declared: Vec::new(),
            globals: Vec::new(),
            lists: Vec::new(),
            native_blocks: HashMap::new(),
            type_init: HashMap::new(),
            pou_of_type: HashMap::new(),
            program: Program::default(),
            natives: HashMap::new(),
            sites: Sites::new(files),
            queue: Vec::new(),
            next: takt_ir::NULL_ZONE.into(),
            late: Vec::new(),
        }
    }

    /// Does all the work; the program is good only if no error was reported.
    pub(crate) fn run(&mut self) -> (Program, Vec<BodyId>) {
        self.program.files = self.files.iter().map(|f| f.name.clone()).collect();
        self.register_libraries();
        self.collect();
        self.resolve_all();
        self.lay_out();
        let tasks = self.tasks();
        self.lower_all();
        let conditions = self.lower_conditions();
        self.initialise();
        self.drain();
        self.mark_recursion();
        self.finish_image(tasks);
        let mut program = std::mem::take(&mut self.program);
        program.sites = std::mem::take(&mut self.sites.all);
        program.types = std::mem::take(&mut self.types);
        (program, conditions)
    }

    /// What is to be said.
    pub(crate) fn finish(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// Reports an error or warning.
    pub(crate) fn report(&mut self, code: Code, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.diagnostics.push(Diagnostic::new(code, span, message));
        self.diagnostics.last_mut().expect("just pushed")
    }

    /// A native function's number.
    pub(crate) fn native(&mut self, name: &'static str, call: takt_abi::NativeFn) -> NativeId {
        let natives = &mut self.program.natives;
        *self.natives.entry(name).or_insert_with(|| {
            natives.push(Native { name, call });
            NativeId(natives.len() as u32 - 1)
        })
    }

    /// A new body, to be filled later.
    pub(crate) fn reserve(&mut self, name: &str, at: Span) -> BodyId {
        let id = BodyId(self.program.bodies.len() as u32);
        let site = self.sites.at(self.files, at, id);
        self.program.bodies.push(Builder::empty(name, site));
        id
    }

    /// The body of a unit; queued at the first request.
    pub(crate) fn body_of(&mut self, pou: usize) -> BodyId {
        if let Some(body) = self.pous[pou].body {
            return body;
        }
        let tree = self.pous[pou].tree;
        let id = self.reserve(&tree.name.text, tree.name.span);
        self.pous[pou].body = Some(id);
        self.queue.push((id, Job::Pou(pou)));
        id
    }

    /// The body of an action; queued at the first request.
    pub(crate) fn action_of(&mut self, pou: usize, action: usize) -> BodyId {
        if let Some(body) = self.pous[pou].actions[action].1 {
            return body;
        }
        let tree = self.pous[pou].tree;
        let name = format!("{}.{}", tree.name.text, tree.actions[action].name.text);
        let id = self.reserve(&name, tree.actions[action].name.span);
        self.pous[pou].actions[action].1 = Some(id);
        self.queue.push((id, Job::Action(pou, action)));
        id
    }

    fn lower_all(&mut self) {
        for pou in 0..self.pous.len() {
            if !self.pous[pou].library {
                self.body_of(pou);
                for action in 0..self.pous[pou].actions.len() {
                    self.action_of(pou, action);
                }
            }
        }
        self.drain();
    }

    /// Lowers queued bodies until there is none left.
    pub(crate) fn drain(&mut self) {
        while let Some((id, job)) = self.queue.pop() {
            let body = self.lower_body(id, job);
            self.program.bodies[id.0 as usize] = body;
        }
    }

    fn lower_conditions(&mut self) -> Vec<BodyId> {
        let conditions = &self.options.conditions;
        let mut bodies = Vec::new();
        for (i, source) in conditions.iter().enumerate() {
            let file = FileId((self.user_files + i) as u32);
            bodies.push(self.lower_condition(file, source));
        }
        self.drain();
        bodies
    }
}
