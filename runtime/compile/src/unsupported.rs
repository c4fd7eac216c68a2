//! What the parser reads and the compiler gives no meaning yet: named and refused, or, where a program runs without it, warned of.

use takt_syntax::tree::{self, Unit, VarBlock, VarKind};
use takt_syntax::{Code, Diagnostic, Span};

/// What is to be said of a file.
pub(crate) fn find(file: &tree::File) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for unit in &file.units {
        match unit {
            Unit::Pou(pou) => {
                let methods = pou.methods.iter().flat_map(|method| &method.vars);
                pou.vars.iter().chain(methods).for_each(|block| section(block, &mut found));
            }
            Unit::Type(_) | Unit::Interface(_) => {}
            Unit::Globals(globals) => section(&globals.vars, &mut found),
            Unit::Configuration(configuration) => {
                configuration.globals.iter().for_each(|block| section(block, &mut found));
                configuration.programs.iter().for_each(|program| connections(program, &mut found));
            }
        }
    }
    found
}

fn refuse(found: &mut Vec<Diagnostic>, span: Span, message: &str) {
    found.push(Diagnostic::new(Code::NotSupported, span, message));
}

fn section(block: &VarBlock, found: &mut Vec<Diagnostic>) {
    if block.kind == VarKind::Generic {
        refuse(found, block.span, "VAR_GENERIC is not supported yet");
    }
}

fn connections(program: &tree::ProgramDecl, found: &mut Vec<Diagnostic>) {
    if let Some((block, _)) = program.blocks.first() {
        let diagnostic = Diagnostic::new(Code::NotSupported, block.span, "a block in a task of its own is not supported yet");
        found.push(diagnostic.help("call it in a program of that task"));
    }
}
