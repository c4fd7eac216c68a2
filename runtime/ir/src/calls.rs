//! Who calls whom.

use crate::inst::{Body, Inst};
use crate::program::Program;

/// The graph of calls: a node for each body, in order, and behind them one for each method that is found by class, which leads to all its bodies. So a
/// call by class is one edge, however many classes there are.
#[derive(Debug)]
pub struct CallGraph {
    /// Where the edges of a node begin; those of the last end at the last entry.
    starts: Vec<usize>,
    edges: Vec<usize>,
}

impl CallGraph {
    /// The calls of a program. What does not exist is left out.
    pub fn new(program: &Program) -> Self {
        let (bodies, nodes) = (program.bodies.len(), program.bodies.len() + program.dispatch.len());
        let calls = program.bodies.iter().map(|body| callees(body, bodies));
        let rows = program.dispatch.iter().map(|row| row.targets.iter().flatten().map(|body| body.0 as usize).collect());
        Self::of(calls.chain(rows), nodes)
    }

    /// A graph from the edges of each node.
    fn of(lists: impl Iterator<Item = Vec<usize>>, nodes: usize) -> Self {
        let (mut starts, mut edges) = (vec![0], Vec::new());
        for mut list in lists {
            list.sort_unstable();
            list.dedup();
            edges.extend(list.into_iter().filter(|to| *to < nodes));
            starts.push(edges.len());
        }
        Self { starts, edges }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// Where the calls of a node lead, each once.
    pub fn calls(&self, node: usize) -> &[usize] {
        &self.edges[self.starts[node]..self.starts[node + 1]]
    }

    /// The sets of nodes that can reach each other, those that are called before those that call (Tarjan's algorithm, without recursion).
    pub fn components(&self) -> Components {
        let mut search = Search::new(self.nodes());
        (0..self.nodes()).for_each(|root| search.visit(self, root));
        search.found
    }

    /// Whether the nodes of a component are on a cycle of calls.
    pub fn is_cycle(&self, component: &[usize]) -> bool {
        component.len() > 1 || component.iter().any(|node| self.calls(*node).contains(node))
    }
}

/// The callees of a body as nodes.
fn callees(body: &Body, bodies: usize) -> Vec<usize> {
    let insts = body.blocks.iter().flat_map(|block| &block.insts);
    let node = |inst: &Inst| match inst {
        Inst::Call { body, .. } => Some(body.0 as usize),
        Inst::Virtual { method, .. } => Some(bodies + *method as usize),
        _ => None,
    };
    insts.filter_map(node).collect()
}

/// The strongly connected components of a [`CallGraph`].
#[derive(Debug, Default)]
pub struct Components {
    members: Vec<usize>,
    ends: Vec<usize>,
}

impl Components {
    /// The nodes of each, callees first.
    pub fn iter(&self) -> impl Iterator<Item = &[usize]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| &self.members[start..*end])
    }
}

const UNSEEN: usize = usize::MAX;

/// The state of Tarjan's algorithm.
struct Search {
    index: Vec<usize>,
    low: Vec<usize>,
    on_stack: Vec<bool>,
    stack: Vec<usize>,
    counter: usize,
    found: Components,
}

impl Search {
    fn new(nodes: usize) -> Self {
        let (index, low, on_stack) = (vec![UNSEEN; nodes], vec![0; nodes], vec![false; nodes]);
        Self { index, low, on_stack, stack: Vec::new(), counter: 0, found: Components::default() }
    }

    fn visit(&mut self, graph: &CallGraph, root: usize) {
        if self.index[root] != UNSEEN {
            return;
        }
        self.enter(root);
        let mut work = vec![(root, 0)];
        while let Some((node, edge)) = work.last_mut() {
            let node = *node;
            if let Some(next) = graph.calls(node).get(*edge).copied() {
                *edge += 1;
                if self.index[next] == UNSEEN {
                    self.enter(next);
                    work.push((next, 0));
                } else if self.on_stack[next] {
                    self.low[node] = self.low[node].min(self.index[next]);
                }
                continue;
            }
            work.pop();
            self.leave(node);
            if let Some((caller, _)) = work.last() {
                self.low[*caller] = self.low[*caller].min(self.low[node]);
            }
        }
    }

    fn enter(&mut self, node: usize) {
        (self.index[node], self.low[node]) = (self.counter, self.counter);
        self.counter += 1;
        self.stack.push(node);
        self.on_stack[node] = true;
    }

    fn leave(&mut self, node: usize) {
        if self.low[node] != self.index[node] {
            return;
        }
        while let Some(member) = self.stack.pop() {
            self.on_stack[member] = false;
            self.found.members.push(member);
            if member == node {
                break;
            }
        }
        self.found.ends.push(self.found.members.len());
    }
}

#[cfg(test)]
mod tests {
    use super::CallGraph;

    #[test]
    fn cycles_are_components_and_callees_come_first() {
        let calls: [&[usize]; 5] = [&[1, 1], &[2], &[3, 0], &[3], &[0, 9]];
        let graph = CallGraph::of(calls.iter().map(|list| list.to_vec()), calls.len());
        let mut found: Vec<(Vec<usize>, bool)> = graph.components().iter().map(|c| (c.to_vec(), graph.is_cycle(c))).collect();
        found.iter_mut().for_each(|(component, _)| component.sort_unstable());
        assert_eq!(found, [(vec![3], true), (vec![0, 1, 2], true), (vec![4], false)]);
    }
}
