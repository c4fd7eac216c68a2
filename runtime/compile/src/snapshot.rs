//! `{attribute 'task_snapshot'}`: variables of which a task that does not write them sees a copy. Before VAR_GLOBAL it goes for the whole list, before a
//! variable of a list or of a PROGRAM for that one.

use crate::scope::{PouKind, Storage};
use crate::unit::Compiler;
use takt_ir::TypeId;
use takt_syntax::Code;
use takt_syntax::tree::Pragma;

/// Whether a declaration asks for it.
pub(crate) fn is_marked(pragmas: &[Pragma]) -> bool {
    pragmas.iter().any(|p| p.name == "task_snapshot")
}

impl Compiler<'_> {
    /// The variables that are marked: type and offset. Tells where the mark means nothing.
    pub(crate) fn marked(&mut self) -> Vec<(TypeId, u32)> {
        let (mut found, mut idle) = (Vec::new(), Vec::new());
        for (global, var) in self.globals.iter().filter(|g| g.latched).filter_map(|g| Some((g, g.var.as_ref()?))) {
            match var.storage {
                Storage::Image(offset) if !global.constant && self.fixed_address(var.decl).is_none() => found.push((var.ty, offset)),
                _ if global.constant => {}
                _ => idle.push((var.span, "what lies at an address is one for all tasks")),
            }
        }
        for pou in self.pous.iter().filter(|pou| !pou.library) {
            for var in pou.vars.iter().filter(|var| is_marked(&var.decl.pragmas)) {
                match var.storage {
                    Storage::This(offset) if pou.tree.kind == PouKind::Program => found.push((var.ty, pou.instance.saturating_add(offset))),
                    _ => idle.push((var.span, "it goes with VAR_GLOBAL and variables of a PROGRAM")),
                }
            }
        }
        for (span, why) in idle {
            self.report(Code::NoEffect, span, format!("`task_snapshot` has no effect here: {why}"));
        }
        found
    }
}
