//! Tree to checked program to IR.
//!
//! Order: every file is parsed; names are collected; types, constants and signatures are resolved on demand (so that declarations may stand in any
//! order and cycles are found); the image is laid out; bodies are checked and lowered in one walk. Problems are collected, never thrown, and what
//! depends on an error is silent.
//!
//! **The compiler knows no block by name.** It is handed libraries; what it knows itself are the operators and the overloaded functions of
//! IEC 61131-3 (`ABS`, `LIMIT`, `INT_TO_REAL`, …).

mod address;
mod ahead;
mod any;
mod body;
mod call;
mod checks;
mod class;
mod constant;
mod construct;
mod convert;
mod declare;
mod emit;
mod enable;
mod expression;
mod heap;
mod image;
mod initial;
mod instance_path;
mod intrinsic;
mod layout;
mod library;
mod limits;
mod lint;
mod literal;
mod member;
mod mistake;
mod name;
mod namespace;
mod near;
mod object;
mod operator;
mod place;
mod protect;
mod recursion;
mod retain;
mod scope;
mod sites;
mod snapshot;
mod statement;
mod string;
mod task;
mod types;
mod unit;
mod unsupported;

use takt_syntax::{Diagnostic, FileId, Source};

/// What is compiled.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// The user's files, in order; [`FileId`] is the index.
    pub sources: &'a [Source],
    /// Libraries; an earlier one hides a later one's names.
    pub libraries: &'a [&'a takt_abi::Library],
    /// Choices.
    pub options: &'a Options,
}

/// Choices of a project.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Name of the project, with which the paths of instances begin; if it is empty, `Application`.
    pub name: String,
    /// Names of libraries that are compiled along with the program, by which their units may be called: `TcUnit` in `TcUnit.FB_TestSuite`.
    pub namespaces: Vec<String>,
    /// Cut integers at each operator instead of when stored, passed or converted.
    pub iec_arithmetic: bool,
    /// Implicit conversions that may lose information are errors.
    pub strict: bool,
    /// Likely mistakes in programs that run all the same are warned of.
    pub lint: bool,
    /// Bytes of the heap of `__NEW` (rounded up to a power of two); 0 means 1 MiB. A program that does not use it has none.
    pub heap: u32,
    /// Numbers of direct addresses count in bytes (`%IW3` is bytes 3 and 4) rather than in units of their own width.
    pub byte_addresses: bool,
    /// What the project wires to its bus: direct addresses, which then exist, and paths of variables, which then need no other address.
    pub wired: Vec<String>,
    /// BOOL expressions in global scope (`--until`, conditions of the manifest). Their [`FileId`]s follow those of the sources.
    pub conditions: Vec<Source>,
    /// What `{IF defined(NAME)}` and `hasvalue(NAME, 'text')` ask for, with values that may be empty.
    pub defines: Vec<(String, String)>,
}

/// What came of it.
#[derive(Debug)]
pub struct Output {
    /// `None` if there are errors.
    pub program: Option<takt_ir::Program>,
    /// Everything there is to say, in order of file and place.
    pub diagnostics: Vec<Diagnostic>,
    /// A body with result I64 (0 or 1) per condition.
    pub conditions: Vec<takt_ir::BodyId>,
    /// All texts by [`FileId`]: user's, conditions', libraries'.
    pub files: Vec<Source>,
}

/// Compiles a program.
pub fn compile(input: Input<'_>) -> Output {
    let mut files: Vec<Source> = input.sources.to_vec();
    files.extend(input.options.conditions.iter().cloned());
    for library in input.libraries {
        files
            .extend(library.sources.iter().map(|(name, text)| Source { name: format!("<{}>/{name}", library.name), text: (*text).into() }));
    }
    let (user, conditions) = (input.sources.len(), input.options.conditions.len());
    let mut diagnostics = Vec::new();
    let mut trees: Vec<takt_syntax::tree::File> = Vec::new();
    let pragmas = pragma_conditions(&input, &files);
    for (i, file) in files.iter().enumerate() {
        let id = FileId(i as u32);
        if (user..user + conditions).contains(&i) {
            trees.push(takt_syntax::tree::File::default());
            continue;
        }
        let (tree, found) = takt_syntax::parse_under(id, &file.text, &pragmas);
        diagnostics.extend(found);
        diagnostics.extend(unsupported::find(&tree));
        trees.push(tree);
    }
    let mut unit = unit::Compiler::new(&input, &files, &trees, diagnostics);
    let (program, conditions) = unit.run();
    let mut diagnostics = unit.finish();
    diagnostics.retain(|d| !trees.get(d.span.file.0 as usize).is_some_and(|tree| tree.suppresses(d)));
    diagnostics.sort_by_key(|d| (d.span.file, d.span.start, d.span.end, d.code));
    // What is looked at twice is reported once; a guess at what was meant may be missing the second time.
    diagnostics.dedup_by(|again, first| (again.span, again.code, &again.message) == (first.span, first.code, &first.message));
    let failed = diagnostics.iter().any(|d| d.severity() == takt_syntax::Severity::Error);
    Output { program: (!failed).then_some(program), diagnostics, conditions, files }
}

/// What the conditional pragmas of all files may ask for.
fn pragma_conditions(input: &Input<'_>, files: &[Source]) -> takt_syntax::Conditions {
    let mut conditions = takt_syntax::Conditions::of(files.iter(), &input.options.defines);
    for library in input.libraries {
        library.blocks.iter().for_each(|block| conditions.add_pou(block.name));
        library.functions.iter().for_each(|function| conditions.add_pou(function.name));
        library.structs.iter().for_each(|structure| conditions.add_type(structure.name));
        library.enums.iter().for_each(|enumeration| conditions.add_type(enumeration.name));
        library.aliases.iter().for_each(|(alias, _)| conditions.add_type(alias));
    }
    conditions
}
