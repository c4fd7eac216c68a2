//! Constants of a unit that are used before the place where they are declared: `VAR a : ARRAY[0..N] OF INT; END_VAR VAR CONSTANT N : INT := 9; END_VAR`.

use crate::expression::Lowering;
use crate::scope::{Progress, key};
use crate::unit::Compiler;
use takt_syntax::tree::{VarBlock, VarDecl, VarKind};
use takt_syntax::{Code, Span};

impl<'a> Compiler<'a> {
    /// Whether a constant is still to be declared; from now on it is not.
    pub(crate) fn begin_constant(&mut self, unit: usize, decl: &VarDecl) -> bool {
        self.pous[unit].begun.insert(decl.name.span.start)
    }

    /// The constant of this name, if the unit is being resolved and has not come to it.
    fn constant_ahead(&self, unit: usize, wanted: &str) -> Option<(&'a VarBlock, &'a VarDecl)> {
        let unit = &self.pous[unit];
        if unit.state != Progress::Running || unit.index.contains_key(wanted) {
            return None;
        }
        let constants = unit.tree.vars.iter().filter(|block| block.constant && block.kind == VarKind::Var);
        let is_wanted = |name: &str| if name.is_ascii() { name.eq_ignore_ascii_case(wanted) } else { key(name) == wanted };
        constants.flat_map(|block| block.vars.iter().map(move |decl| (block, decl))).find(|(_, decl)| is_wanted(&decl.name.text))
    }
}

impl Lowering<'_, '_> {
    /// Declares the constant of this name, if it stands further down. Whether it cannot be: it depends on itself.
    pub(crate) fn declare_ahead(&mut self, wanted: &str, span: Span) -> bool {
        let units: Vec<usize> = self.levels.iter().map(|level| level.pou).collect();
        let Some((unit, (block, decl))) = units.into_iter().find_map(|unit| Some((unit, self.c.constant_ahead(unit, wanted)?))) else {
            return false;
        };
        if !self.c.begin_constant(unit, decl) {
            self.report(Code::Circular, span, format!("`{}` depends on itself", decl.name.text));
            return true;
        }
        self.c.declare_variable(unit, block, decl);
        false
    }
}
