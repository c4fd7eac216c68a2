//! Functions, blocks and the main program.

use super::Generator;
use super::shape::{Class, Shape, Signature, Variable, named};

/// Blocks of the library, as a caller sees them.
pub fn standard_blocks() -> Vec<Signature> {
    type Fields = &'static [(&'static str, &'static str)];
    let all: &[(&str, Fields, Fields)] = &[
        ("TON", &[("IN", "BOOL"), ("PT", "TIME")], &[("Q", "BOOL"), ("ET", "TIME")]),
        ("TOF", &[("IN", "BOOL"), ("PT", "TIME")], &[("Q", "BOOL"), ("ET", "TIME")]),
        ("TP", &[("IN", "BOOL"), ("PT", "TIME")], &[("Q", "BOOL"), ("ET", "TIME")]),
        ("R_TRIG", &[("CLK", "BOOL")], &[("Q", "BOOL")]),
        ("F_TRIG", &[("CLK", "BOOL")], &[("Q", "BOOL")]),
    ];
    let list = |names: &[(&str, &str)]| names.iter().map(|(n, t)| (n.to_string(), Shape::Scalar(named(t)))).collect::<Vec<_>>();
    all.iter()
        .map(|(name, inputs, outputs)| Signature {
            name: name.to_string(),
            inputs: list(inputs),
            outputs: list(outputs),
            ..Signature::default()
        })
        .collect()
}

impl Generator {
    /// A VAR section with initial values here and there.
    pub(super) fn declare(&mut self, section: &str, variables: &[Variable]) {
        if variables.is_empty() {
            return;
        }
        self.line(section);
        for variable in variables {
            let simple = variable.shape.scalar().filter(|_| !section.ends_with("IN_OUT"));
            let init = match simple {
                Some(s) if self.random.chance(50) => format!(" := {}", self.literal(s)),
                _ => String::new(),
            };
            self.line(&format!("  {} : {}{init};", variable.path, self.spell(&variable.shape)));
        }
        self.line("END_VAR");
    }

    fn variables(&mut self, prefix: &str, count: usize) -> Vec<Variable> {
        (0..count).map(|i| Variable::new(format!("{prefix}{i}"), self.data_or_seen())).collect()
    }

    /// Any type of data, often one that is there already, so that there is something to copy, pass and point to.
    fn data_or_seen(&mut self) -> Shape {
        let data = |s: &Shape| matches!(s, Shape::Structure(_) | Shape::Array(..));
        let seen = if self.random.chance(35) { self.reach(&data, false) } else { None };
        seen.map_or_else(|| self.data(2), |(_, shape)| shape)
    }

    fn leaves(&mut self, prefix: &str, count: usize) -> Vec<Variable> {
        (0..count).map(|i| Variable::new(format!("{prefix}{i}"), self.leaf())).collect()
    }

    /// Variables of the unit itself: data, pointers, references, counters.
    fn locals(&mut self, section: &str, count: usize) -> Vec<Variable> {
        let mut locals = self.variables("v", count);
        let mark = self.scope.len();
        self.scope.extend(locals.clone());
        let targets: Vec<Shape> = (0..self.random.below(3)).map(|_| self.target()).collect();
        self.scope.truncate(mark);
        for (i, to) in targets.into_iter().enumerate() {
            locals.push(Variable::new(format!("p{i}"), Shape::Pointer(Box::new(to))));
        }
        self.declare(section, &locals);
        locals
    }

    /// Elementary variables, so that operators find operands of many types.
    pub(super) fn elementaries(&mut self, section: &str, count: usize) {
        let all: Vec<Variable> = (0..count).map(|i| Variable::new(format!("n{i}"), self.elementary())).collect();
        self.declare(section, &all);
        self.scope.extend(all);
    }

    /// A pointer to a local variable of a function, which therefore lies in memory.
    fn pointer_to_local(&mut self) -> Option<String> {
        let local = self.scope.iter().find(|v| v.path == "n0")?.clone();
        let pointer = Shape::Pointer(Box::new(local.shape.clone()));
        self.line("VAR");
        self.line(&format!("  q : {};", self.spell(&pointer)));
        self.line("END_VAR");
        self.scope.push(Variable::new("q^", local.shape));
        Some("q := ADR(n0);".into())
    }

    /// A type that some variable here has, so that a pointer to it finds a target.
    fn target(&mut self) -> Shape {
        let data = |s: &Shape| s.is_leaf() && !matches!(s, Shape::Pointer(_)) || matches!(s, Shape::Structure(_) | Shape::Array(..));
        self.reach(&data, true).map_or(Shape::Scalar(named("INT")), |(_, s)| s)
    }

    pub(super) fn declare_counters(&mut self, section: &str) {
        let kinds = ["DINT", "INT", "SINT", "LINT", "UINT", "DINT"];
        let counters: Vec<Variable> = (0..3)
            .map(|i| Variable::fixed(format!("c{i}"), Shape::Scalar(named(kinds[self.random.below(if i == 0 { 6 } else { 4 })]))))
            .collect();
        self.line(section);
        for counter in &counters {
            self.line(&format!("  {} : {};", counter.path, self.spell(&counter.shape)));
        }
        self.line("END_VAR");
        self.counters = counters.iter().map(|c| c.path.clone()).collect();
        self.scope.extend(counters);
    }

    /// References, bound before anything else happens.
    fn references(&mut self, section: &str) -> Vec<String> {
        let mut bound = Vec::new();
        for i in 0..self.random.below(2) {
            let data = |s: &Shape| s.scalar().is_some() || matches!(s, Shape::Structure(_) | Shape::Array(..));
            let Some((path, shape)) = self.reach(&data, true) else { continue };
            self.line(section);
            self.line(&format!("  y{i} : {};", self.spell(&Shape::Reference(Box::new(shape.clone())))));
            self.line("END_VAR");
            bound.push(format!("y{i} REF= {path};"));
            self.scope.push(Variable::new(format!("y{i}"), shape));
        }
        bound
    }

    pub(super) fn open_scope(&mut self) {
        self.scope = self.globals.clone();
        self.loops = 0;
    }

    /// Statements of a unit whose variables are in scope.
    pub(super) fn body_of_unit(&mut self, bound: &[String], budget: usize) {
        self.budget = budget;
        self.indent = 1;
        for line in bound {
            // A reference that is not bound refers to nothing.
            if !self.wild || self.random.chance(95) {
                self.line(line);
            }
        }
        self.indent = 0;
        let count = budget / 3 + 1;
        self.statements(count, 3);
    }

    /// A function of any result, which may call those before it.
    pub(super) fn function(&mut self, name: &str) {
        self.open_scope();
        let result = match self.random.below(6) {
            0 if !self.structures.is_empty() => Shape::Structure(self.random.below(self.structures.len())),
            1 => Shape::Text(20),
            _ => self.elementary(),
        };
        let inputs = {
            let n = 1 + self.random.below(3);
            self.leaves("i", n)
        };
        let in_outs = {
            let n = self.random.below(2);
            self.variables("x", n)
        };
        let outputs = {
            let n = self.random.below(3);
            self.leaves("o", n)
        };
        self.line(&format!("FUNCTION {name} : {}", self.spell(&result)));
        self.declare("VAR_INPUT", &inputs);
        self.declare("VAR_IN_OUT", &in_outs);
        self.declare("VAR_OUTPUT", &outputs);
        self.scope.extend(inputs.iter().chain(&in_outs).chain(&outputs).cloned());
        let count = self.random.below(4);
        let locals = self.locals("VAR", count);
        self.scope.extend(locals);
        self.elementaries("VAR", 4);
        self.declare_counters("VAR");
        let mut bound = self.references("VAR");
        let pointer = if self.random.chance(60) { self.pointer_to_local() } else { None };
        self.scope.push(Variable::new(name, result.clone()));
        bound.extend(pointer);
        self.body_of_unit(&bound, 10);
        if result.is_leaf() {
            let value = self.value(&result, 2);
            self.line(&format!("  {name} := {value};"));
        }
        self.line("END_FUNCTION");
        let list = |all: Vec<Variable>| all.into_iter().map(|v| (v.path, v.shape)).collect();
        let signature = Signature {
            name: name.into(),
            inputs: list(inputs),
            in_outs: list(in_outs),
            outputs: list(outputs),
            result: Some(result),
            ..Signature::default()
        };
        self.functions.push(signature);
    }

    /// A function that calls itself as deep as its first input says.
    pub(super) fn recursive_function(&mut self) {
        self.open_scope();
        let s = named(self.random.pick(&["DINT", "LINT", "LREAL", "REAL", "INT"]));
        self.line(&format!("FUNCTION down : {}", s.name));
        self.line("VAR_INPUT level : INT; END_VAR");
        let inputs = self.leaves("i", 1);
        self.declare("VAR_INPUT", &inputs);
        self.scope.push(Variable::fixed("level", Shape::Scalar(named("INT"))));
        self.scope.extend(inputs.clone());
        let locals = self.locals("VAR", 2);
        self.scope.extend(locals);
        self.declare_counters("VAR");
        self.body_of_unit(&[], 3);
        let (stop, base) = (if self.wild && self.random.chance(20) { -100 } else { 0 }, self.value(&Shape::Scalar(s), 1));
        let argument = self.value(&inputs[0].shape, 1);
        self.line(&format!("  IF level > {stop} THEN"));
        self.line(&format!("    down := down(level := level - 1, i0 := {argument}) + 1;"));
        self.line("  ELSE");
        self.line(&format!("    down := {base};"));
        self.line("  END_IF");
        self.line("END_FUNCTION");
        let mut all = vec![("level".to_string(), Shape::Scalar(named("INT")))];
        all.extend(inputs.into_iter().map(|v| (v.path, v.shape)));
        self.functions.push(Signature {
            name: "down".into(),
            inputs: all,
            result: Some(Shape::Scalar(s)),
            recursive: true,
            ..Signature::default()
        });
    }

    /// A function over an array of any length.
    pub(super) fn open_array_function(&mut self) {
        self.open_scope();
        let arrays = |s: &Shape| matches!(s, Shape::Array(e, dims) if dims.len() == 1 && e.is(Class::Int));
        let elem = match self.reach(&arrays, true) {
            Some((_, Shape::Array(elem, _))) => elem,
            _ => Box::new(Shape::Scalar(named("INT"))),
        };
        let open = Shape::Open(elem);
        self.line("FUNCTION over : DINT");
        self.declare("VAR_IN_OUT", &[Variable::new("a", open.clone())]);
        self.line("VAR_INPUT k : DINT; END_VAR");
        self.scope.push(Variable::new("a", open.clone()));
        self.scope.push(Variable::new("k", Shape::Scalar(named("DINT"))));
        self.declare_counters("VAR");
        self.line("  FOR c2 := LOWER_BOUND(a, 1) TO UPPER_BOUND(a, 1) DO");
        self.line("    a[c2] := a[c2] + k;");
        self.line("    over := over + a[c2] + c2;");
        self.line("  END_FOR");
        if self.wild {
            let index = self.int(0);
            self.line(&format!("  a[{index}] := 1;"));
        }
        self.counters.retain(|c| c != "c2");
        self.body_of_unit(&[], 4);
        self.line("END_FUNCTION");
        self.functions.push(Signature {
            name: "over".into(),
            inputs: vec![("k".into(), Shape::Scalar(named("DINT")))],
            in_outs: vec![("a".into(), open)],
            result: None,
            ..Signature::default()
        });
    }

    /// A block, which may hold instances of those before it.
    pub(super) fn block(&mut self, name: &str) {
        self.open_scope();
        let inputs = {
            let n = 1 + self.random.below(3);
            self.variables("i", n)
        };
        let outputs = {
            let n = 1 + self.random.below(2);
            self.variables("o", n)
        };
        let in_outs = {
            let n = self.random.below(2);
            self.leaves("x", n)
        };
        self.line(&format!("FUNCTION_BLOCK {name}"));
        self.declare("VAR_INPUT", &inputs);
        self.declare("VAR_OUTPUT", &outputs);
        self.declare("VAR_IN_OUT", &in_outs);
        self.scope.extend(inputs.iter().chain(&outputs).cloned());
        let fields = self.locals("VAR", 3);
        let mut through_this = fields.iter().find(|v| v.shape.is_leaf()).cloned();
        self.scope.extend(fields);
        let action = self.random.chance(30).then(|| "act".to_string());
        let instances = self.instances(2);
        self.declare("VAR", &instances);
        self.scope.extend(instances);
        self.elementaries("VAR", 5);
        self.declare_counters("VAR_TEMP");
        let outside = self.scope.clone();
        let bound = self.references("VAR_TEMP");
        self.scope.extend(in_outs.iter().cloned());
        if let Some(field) = through_this.take().filter(|_| self.random.chance(50)) {
            self.scope.push(Variable::new(format!("THIS^.{}", field.path), field.shape));
        }
        self.body_of_unit(&bound, 8);
        if let Some(action) = &action {
            // The action is called from outside, where neither counters nor VAR_IN_OUT are set.
            self.scope = outside.into_iter().filter(|v| v.writable).collect();
            self.counters.clear();
            self.line(&format!("ACTION {action}:"));
            self.body_of_unit(&[], 3);
            self.line("END_ACTION");
        }
        self.line("END_FUNCTION_BLOCK");
        let list = |all: Vec<Variable>| all.into_iter().map(|v| (v.path, v.shape)).collect();
        self.blocks.push(Signature {
            name: name.into(),
            inputs: list(inputs),
            in_outs: list(in_outs),
            outputs: list(outputs),
            action,
            ..Signature::default()
        });
    }

    /// Instances of blocks, some in arrays.
    fn instances(&mut self, most: usize) -> Vec<Variable> {
        let mut instances = Vec::new();
        for i in 0..self.random.below(most + 1) {
            let own = self.blocks.len() - 1;
            let which = if self.random.chance(60) { own } else { self.random.below(self.blocks.len()) };
            let block = Shape::Block(which);
            let shape = if self.random.chance(30) { Shape::Array(Box::new(block), vec![(0, self.random.below(3) as i64)]) } else { block };
            instances.push(Variable::new(format!("b{i}"), shape));
        }
        instances
    }

    /// The program that is run.
    pub(super) fn main(&mut self) {
        self.open_scope();
        self.line("PROGRAM main");
        let count = 4 + self.random.below(5);
        let locals = self.locals("VAR", count);
        self.scope.extend(locals);
        let instances = self.instances(4);
        self.declare("VAR", &instances);
        self.scope.extend(instances);
        self.object_variables();
        self.elementaries("VAR", 14);
        self.declare_counters("VAR");
        let bound = self.references("VAR");
        self.body_of_unit(&bound, 40);
        self.line("END_PROGRAM");
    }
}
