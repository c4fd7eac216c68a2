//! Which bodies take part in a cycle of calls: they count depth and take fuel.

use crate::unit::Compiler;
use takt_ir::CallGraph;

impl Compiler<'_> {
    /// Marks every body that can reach itself.
    pub(crate) fn mark_recursion(&mut self) {
        let graph = CallGraph::new(&self.program);
        for component in graph.components().iter().filter(|component| graph.is_cycle(component)) {
            for node in component {
                // Behind the bodies stand the methods that are found by class.
                if let Some(body) = self.program.bodies.get_mut(*node) {
                    body.recursive = true;
                }
            }
        }
    }
}
