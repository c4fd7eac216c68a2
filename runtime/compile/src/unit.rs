//! The compiler's state and the order of its work.

use crate::emit::Builder;
use crate::scope::{Declared, GlobalVar, Interface, Item, List, Owner, Pou, PouKind};
use crate::sites::Sites;
use crate::{Input, Options};
use rustc_hash::FxHashMap as HashMap;
use takt_ir::{BodyId, Native, NativeId, Program, TypeId, Types};
use takt_syntax::{Code, Diagnostic, FileId, Source, Span, tree};

/// What a queued body is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Job {
    /// The statements of a unit.
    Pou(usize),
    /// What instances of a block hold at the start.
    Start(usize),
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
    pub(crate) addresses: crate::address::Addresses<'a>,
    /// Where a user's name was declared, for messages.
    pub(crate) declared_at: HashMap<String, Span>,
    pub(crate) pous: Vec<Pou<'a>>,
    pub(crate) declared: Vec<Declared<'a>>,
    pub(crate) globals: Vec<GlobalVar<'a>>,
    pub(crate) lists: Vec<List>,
    pub(crate) list_names: HashMap<String, usize>,
    pub(crate) interfaces: Vec<Interface<'a>>,
    pub(crate) interface_of_type: HashMap<TypeId, usize>,
    /// EXTENDS of blocks and IMPLEMENTS as written, until they are linked.
    pub(crate) extends: Vec<(Owner, &'a tree::Name)>,
    pub(crate) implements: Vec<(usize, &'a tree::Name)>,
    /// Blocks by number of their class, from 1.
    pub(crate) classes: Vec<usize>,
    /// Methods that are found by class, in order of [`Program::dispatch`].
    pub(crate) methods: crate::class::Methods,
    /// Types that are asked for at run time, in order of [`Program::families`].
    pub(crate) families: Vec<Owner>,
    /// What variables of a type hold at the start and what is not bytes.
    pub(crate) type_late: HashMap<TypeId, std::rc::Rc<Vec<crate::initial::Late<'a>>>>,
    /// Full names of the namespaces.
    pub(crate) namespaces: Vec<String>,
    /// The namespaces around what is being looked at, if there are any.
    pub(crate) home: Option<&'a tree::Home>,
    /// What is being resolved, and where each is named by the one before.
    pub(crate) inside: Vec<(&'a tree::Name, Span)>,
    /// What is looked at belongs to a library, whose own names come before the program's.
    pub(crate) in_library: bool,
    /// Names that were reported as unknown, per unit: numbers of their messages.
    pub(crate) unknown: HashMap<(Option<usize>, String), usize>,
    /// The program uses `__NEW`.
    pub(crate) heap: bool,
    pub(crate) native_blocks: HashMap<TypeId, &'static takt_abi::BlockDesc>,
    /// Initial bytes of struct-like types with an initial value of their own.
    pub(crate) type_init: HashMap<TypeId, std::rc::Rc<Vec<u8>>>,
    /// Initial values of aliases and enumerations.
    pub(crate) pou_of_type: HashMap<TypeId, usize>,
    /// Enumerations with `{attribute 'strict'}`.
    pub(crate) strict_enums: rustc_hash::FxHashSet<TypeId>,
    /// Enumerations with `{attribute 'to_string'}`.
    pub(crate) spelled_enums: rustc_hash::FxHashSet<TypeId>,
    /// STRUCT EXTENDS.
    pub(crate) struct_bases: HashMap<TypeId, TypeId>,
    pub(crate) program: Program,
    pub(crate) natives: HashMap<&'static str, NativeId>,
    pub(crate) sites: Sites,
    pub(crate) queue: Vec<(BodyId, Job)>,
    /// How deep declarations and expressions that need each other are nested, see [`Compiler::deeper`].
    pub(crate) depth: u32,
    /// Names that may still be compared in search of what was meant.
    pub(crate) comparisons: usize,
    /// How instances of blocks are retained as a whole, per unit.
    pub(crate) block_kinds: Vec<Option<takt_ir::RetainKind>>,
    /// Bytes of the image that are retained, and persistent, in order.
    pub(crate) kept_ranges: [Vec<(u32, u32)>; 2],
    /// Next free byte of the image.
    pub(crate) next: u64,
    /// Statements that set what cannot be bytes, with the unit whose names they use.
    /// Where the longest run of zeros lies in the program's data, and its bytes.
    pub(crate) zeros: (u32, u32),
    /// Initial bytes too far behind to be kept with the others.
    pub(crate) far: Vec<(u32, Vec<u8>)>,
    pub(crate) late: Vec<(Option<usize>, Option<&'a tree::Home>, crate::initial::Late<'a>)>,
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
            names: HashMap::default(),
            library_names: HashMap::default(),
            addresses: Default::default(),
            declared_at: HashMap::default(),
            pous: Vec::new(),
            declared: Vec::new(),
            globals: Vec::new(),
            lists: Vec::new(),
            list_names: HashMap::default(),
            interfaces: Vec::new(),
            interface_of_type: HashMap::default(),
            extends: Vec::new(),
            implements: Vec::new(),
            classes: Vec::new(),
            methods: Default::default(),
            families: Vec::new(),
            type_late: HashMap::default(),
            namespaces: Vec::new(),
            home: None,
            inside: Vec::new(),
            in_library: false,
            unknown: HashMap::default(),
            heap: false,
            native_blocks: HashMap::default(),
            type_init: HashMap::default(),
            pou_of_type: HashMap::default(),
            strict_enums: Default::default(),
            spelled_enums: Default::default(),
            struct_bases: HashMap::default(),
            program: Program::default(),
            natives: HashMap::default(),
            sites: Sites::new(files),
            queue: Vec::new(),
            depth: 0,
            comparisons: crate::limits::COMPARISONS,
            block_kinds: Vec::new(),
            kept_ranges: Default::default(),
            next: takt_ir::NULL_ZONE.into(),
            zeros: (0, 0),
            far: Vec::new(),
            late: Vec::new(),
        }
    }

    /// Does all the work; the program is good only if no error was reported.
    pub(crate) fn run(&mut self) -> (Program, Vec<BodyId>) {
        self.program.name = self.project_name();
        self.program.files = self.files.iter().map(|f| f.name.clone()).collect();
        self.register_libraries();
        self.collect();
        self.check_using();
        self.link();
        self.resolve_all();
        self.check_classes();
        self.lay_out();
        self.list_retained();
        let tasks = self.tasks();
        self.lower_all();
        let conditions = self.lower_conditions();
        self.initialise();
        self.drain();
        self.finish_classes();
        self.mark_recursion();
        self.finish_image(tasks);
        self.find_latched();
        self.lint();
        let mut program = std::mem::take(&mut self.program);
        program.sites = std::mem::take(&mut self.sites.all);
        program.types = std::mem::take(&mut self.types);
        self.map(&mut program);
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
        let name = self.pou_name(pou);
        let id = self.reserve(&name, self.pous[pou].tree.name.span);
        self.pous[pou].body = Some(id);
        self.queue.push((id, Job::Pou(pou)));
        id
    }

    /// The name of a unit in messages: `FB_Axis.Enable`.
    pub(crate) fn pou_name(&self, pou: usize) -> String {
        let name = &self.pous[pou].tree.name.text;
        match self.pous[pou].owner {
            Some(Owner::Pou(owner)) => format!("{}.{name}", self.pous[owner].tree.name.text),
            Some(Owner::Interface(owner)) => format!("{}.{name}", self.interfaces[owner].tree.name.text),
            None => name.clone(),
        }
    }

    /// The body that sets what instances of a block hold at the start; queued at the first request.
    pub(crate) fn start_of(&mut self, pou: usize) -> BodyId {
        if let Some(body) = self.pous[pou].start {
            return body;
        }
        let name = format!("{} (initial values)", self.pous[pou].tree.name.text);
        let id = self.reserve(&name, self.pous[pou].tree.name.span);
        self.pous[pou].start = Some(id);
        self.queue.push((id, Job::Start(pou)));
        id
    }

    fn lower_all(&mut self) {
        for pou in 0..self.pous.len() {
            let bodiless = matches!(self.pous[pou].owner, Some(Owner::Interface(_))) || self.pous[pou].tree.modifiers.is_abstract;
            if !self.pous[pou].library && (!bodiless || self.pous[pou].tree.kind == PouKind::FunctionBlock) {
                self.body_of(pou);
            }
        }
        self.drain();
    }

    /// Lowers queued bodies until there is none left.
    pub(crate) fn drain(&mut self) {
        while let Some((id, job)) = self.queue.pop() {
            let (Job::Pou(unit) | Job::Start(unit)) = job;
            (self.home, self.in_library) = (self.pous[unit].home, self.pous[unit].library);
            let body = match job {
                Job::Pou(pou) => self.lower_body(id, pou),
                Job::Start(pou) => self.lower_start(id, pou),
            };
            self.program.bodies[id.0 as usize] = body;
        }
        self.in_library = false;
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
