//! Random statements, one per line. Loops end by themselves in a tame program; in a wild one some do not.

use super::Generator;
use super::shape::{Class, Shape, Variable, named};

impl Generator {
    /// A list of statements one level deeper.
    pub(super) fn statements(&mut self, count: usize, depth: usize) {
        self.indent += 1;
        for _ in 0..count {
            self.statement(depth);
        }
        self.indent -= 1;
    }

    fn statement(&mut self, depth: usize) {
        if self.budget == 0 {
            return self.assignment();
        }
        self.budget -= 1;
        match self.random.below(40) {
            0..=3 if depth > 0 => self.if_statement(depth - 1),
            4 | 5 if depth > 0 => self.case_statement(depth - 1),
            6..=8 if depth > 0 => self.for_statement(depth - 1),
            9 if depth > 0 => self.while_statement(depth - 1),
            10 if depth > 0 => self.repeat_statement(depth - 1),
            11 | 12 if depth > 0 => self.pointer_statement(depth - 1),
            13 if self.loops > 0 => self.leave(),
            14 | 15 => self.copy(),
            16..=18 => self.call_block(),
            19 | 20 => self.call_function(),
            21 => self.set_or_reset(),
            22 => self.chain(),
            23 => self.bit(),
            24 if depth > 0 => self.jump(),
            25 if self.random.chance(30) => {
                let cond = self.boolean(1);
                self.line(&format!("IF {cond} THEN RETURN; END_IF"));
            }
            26 => self.open_array_call(),
            27 | 28 if self.wild => self.pointer_statement(0),
            29 if depth > 0 => self.try_statement(depth - 1),
            30..=33 if self.object_statement() => {}
            _ => self.assignment(),
        }
    }

    fn assignment(&mut self) {
        let depth = self.random.pick(&[1, 1, 2, 2, 3]);
        if let Some((path, shape)) = self.reach(&Shape::is_leaf, true) {
            let value = self.value(&shape, depth);
            self.line(&format!("{path} := {value};"));
        }
    }

    fn if_statement(&mut self, depth: usize) {
        let cond = self.boolean(2);
        self.line(&format!("IF {cond} THEN"));
        self.some(depth);
        if self.random.chance(30) {
            let cond = self.boolean(1);
            self.line(&format!("ELSIF {cond} THEN"));
            self.some(depth);
        }
        if self.random.chance(50) {
            self.line("ELSE");
            self.some(depth);
        }
        self.line("END_IF");
    }

    pub(super) fn some(&mut self, depth: usize) {
        let count = 1 + self.random.below(3);
        self.statements(count, depth);
    }

    fn case_statement(&mut self, depth: usize) {
        let selector = if self.random.chance(50) { format!("({} MOD 12)", self.int(1)) } else { self.int(1) };
        self.line(&format!("CASE {selector} OF"));
        let mut next = self.random.below(4) as i64 - 2;
        for _ in 0..1 + self.random.below(4) {
            let mut labels = Vec::new();
            for _ in 0..1 + self.random.below(2) {
                // Labels that the selector's type may lack would be refused: only 0..127 is in all.
                let low = next.max(0);
                let high = low + self.random.pick(&[0, 0, 0, 2, 70]);
                if high > 120 {
                    break;
                }
                labels.push(if low == high { low.to_string() } else { format!("{low}..{high}") });
                next = high + 1 + self.random.below(2) as i64;
            }
            if labels.is_empty() {
                break;
            }
            self.line(&format!("{}:", labels.join(", ")));
            self.some(depth);
        }
        if next <= 0 {
            self.line("0: ;");
        }
        if self.random.chance(50) {
            self.line("ELSE");
            self.some(depth);
        }
        self.line("END_CASE");
    }

    /// A variable that no statement but the loop's own writes.
    fn counter(&mut self) -> Option<String> {
        self.counters.pop()
    }

    fn for_statement(&mut self, depth: usize) {
        let Some(counter) = self.counter() else { return self.assignment() };
        let signed = self.scope.iter().any(|v| v.path == counter && v.shape.scalar().is_some_and(|s| s.signed));
        let (from, to) = (self.random.below(6) as i64 - if signed { 2 } else { 0 }, self.random.below(8) as i64);
        let head = match self.random.below(8) {
            0 => format!("{to} TO {from} BY -1"),
            1 => format!("{from} TO {to} BY {}", 1 + self.random.below(3)),
            2 if self.wild => {
                let step = self.divisor(named("DINT"));
                format!("{} TO {} BY {step}", self.int(0), self.int(0))
            }
            3 => format!("{from} TO ABS({}) MOD 9", self.int(0)),
            4 => format!("{from} TO {to} BY SEL({}, 1, 2)", self.boolean(1)),
            5 => format!("ABS({}) MOD 5 TO {to}", self.int(0)),
            _ => format!("{from} TO {to}"),
        };
        self.line(&format!("FOR {counter} := {head} DO"));
        self.body(depth);
        self.line("END_FOR");
        self.counters.push(counter);
    }

    fn body(&mut self, depth: usize) {
        self.loops += 1;
        self.some(depth);
        self.loops -= 1;
    }

    fn while_statement(&mut self, depth: usize) {
        let Some(counter) = self.counter() else { return self.assignment() };
        let limit = self.random.below(7);
        let cond = self.boolean(1);
        self.line(&format!("{counter} := 0;"));
        if self.wild && self.random.chance(30) {
            self.line(&format!("WHILE {cond} DO"));
        } else {
            self.line(&format!("WHILE {cond} AND_THEN {counter} < {limit} DO"));
        }
        self.line(&format!("  {counter} := {counter} + 1;"));
        self.body(depth);
        self.line("END_WHILE");
        self.counters.push(counter);
    }

    fn repeat_statement(&mut self, depth: usize) {
        let Some(counter) = self.counter() else { return self.assignment() };
        self.line(&format!("{counter} := 0;"));
        self.line("REPEAT");
        self.line(&format!("  {counter} := {counter} + 1;"));
        self.body(depth);
        let (cond, limit) = (self.boolean(1), self.random.below(6));
        let ends = if self.wild && self.random.chance(30) { String::new() } else { format!(" OR {counter} > {limit}") };
        self.line(&format!("UNTIL {cond}{ends} END_REPEAT"));
        self.counters.push(counter);
    }

    fn leave(&mut self) {
        let cond = self.boolean(1);
        let word = self.random.pick(&["EXIT", "CONTINUE"]);
        self.line(&format!("IF {cond} THEN {word}; END_IF"));
    }

    /// Statements in which a pointer may be followed.
    fn pointer_statement(&mut self, depth: usize) {
        let Some((path, shape)) = self.reach(&|s| matches!(s, Shape::Pointer(_)), true) else { return self.assignment() };
        let Shape::Pointer(to) = &shape else { return };
        let target = self.pointer(to);
        if self.random.chance(60) {
            self.line(&format!("{path} := {target};"));
        }
        let guarded = !self.wild || self.random.chance(50);
        self.line(&if guarded { format!("IF {path} <> 0 THEN") } else { "IF TRUE THEN".into() });
        // The pointer is held by another name, so that no statement inside moves it away from its guard.
        let mark = self.scope.len();
        self.scope.push(Variable::new(format!("{path}^"), (**to).clone()));
        if to.is_leaf() && self.random.chance(50) {
            let value = self.value(to, 1);
            self.line(&format!("  {path}^ := {value};"));
        }
        if self.wild
            && !to.is_leaf()
            && self.random.chance(50)
            && let Some((whole, _)) = self.reach(&|s| s == &**to, true)
        {
            // A copy onto itself, some bytes further.
            let further = 1 + self.random.below(9);
            self.line(&format!("  {path} := ADR({whole}) + {further};"));
            self.line(&format!("  {path}^ := {whole};"));
        }
        if self.wild && self.random.chance(30) && to.is_leaf() {
            let (index, value) = (self.int(0), self.value(to, 0));
            self.line(&format!("  {path}[{index}] := {value};"));
        }
        self.some(depth);
        self.scope.truncate(mark);
        self.line("END_IF");
    }

    /// One structure, array, string or block instance to another.
    fn copy(&mut self) {
        let large = |s: &Shape| matches!(s, Shape::Structure(_) | Shape::Array(..) | Shape::Text(_) | Shape::Pointer(_) | Shape::Wide(_));
        let Some((to, shape)) = self.reach(&large, true) else { return self.assignment() };
        let result = self.function_call(&shape, 1).filter(|_| self.random.chance(40));
        let from = result.or_else(|| self.reach(&|s| *s == shape, false).map(|(path, _)| path));
        let Some(from) = from else { return };
        let choice = matches!(shape, Shape::Structure(_)) && self.random.chance(20);
        match self.reach(&|s| *s == shape, false).filter(|_| choice) {
            Some((other, _)) => {
                let cond = self.boolean(1);
                self.line(&format!("{to} := SEL({cond}, {from}, {other});"));
            }
            None => self.line(&format!("{to} := {from};")),
        }
    }

    fn set_or_reset(&mut self) {
        let place = self.reach(&|s| s.is(Class::Bool), true);
        let (cond, sign) = (self.boolean(1), self.random.pick(&["S=", "R="]));
        if let Some((path, _)) = place {
            self.line(&format!("{path} {sign} {cond};"));
        }
    }

    fn chain(&mut self) {
        let fits = |s: &Shape| s.is(Class::Int);
        let (a, b) = (self.reach(&fits, true), self.reach(&fits, true));
        let value = self.int(2);
        if let (Some((a, _)), Some((b, _))) = (a, b) {
            self.line(&format!("{a} := {b} := {value};"));
        }
    }

    /// Bits and parts of an integer variable.
    fn bit(&mut self) {
        let Some((path, shape)) = self.reach(&|s| s.is(Class::Int), true) else { return };
        let bits = shape.scalar().map_or(8, |s| s.bits);
        if bits > 8 && self.random.chance(40) {
            let (value, part) = (self.value(&Shape::Scalar(named("BYTE")), 1), self.random.below((bits / 8) as usize));
            self.line(&format!("{path}.%B{part} := {value};"));
        } else {
            let (value, bit) = (self.boolean(1), self.random.below(bits as usize));
            self.line(&format!("{path}.{bit} := {value};"));
        }
    }

    /// A jump forwards. It stands in an IF of its own: directly in a CASE its label would be one of the CASE.
    fn jump(&mut self) {
        self.labels += 1;
        let label = format!("on{}", self.labels);
        let cond = self.boolean(1);
        self.line("IF TRUE THEN");
        self.line(&format!("  IF {cond} THEN JMP {label}; END_IF"));
        self.some(0);
        self.line(&format!("  {label}:"));
        self.line("END_IF");
    }

    /// `name := value` for the parameters, or the values alone where the order is known; `None` if a VAR_IN_OUT finds no variable.
    pub(super) fn arguments(
        &mut self,
        inputs: &[(String, Shape)],
        in_outs: &[(String, Shape)],
        depth: usize,
        all: bool,
    ) -> Option<Vec<String>> {
        let mut arguments = Vec::new();
        for (name, shape) in inputs {
            if all || self.random.chance(70) {
                arguments.push(format!("{name} := {}", self.any_value(shape, depth)?));
            }
        }
        for (name, shape) in in_outs {
            let (path, _) = self.reach(&|s| s == shape, true)?;
            arguments.push(format!("{name} := {path}"));
        }
        Some(arguments)
    }

    /// A value of any type: an expression where there is one, else a place.
    fn any_value(&mut self, shape: &Shape, depth: usize) -> Option<String> {
        if shape.is_leaf() { Some(self.value(shape, depth)) } else { self.reach(&|s| s == shape, false).map(|(path, _)| path) }
    }

    fn output_arguments(&mut self, outputs: &[(String, Shape)], arguments: &mut Vec<String>) {
        for (name, shape) in outputs {
            if self.random.chance(50)
                && let Some((path, _)) = self.reach(&|s| s == shape, true)
            {
                arguments.push(format!("{name} => {path}"));
            }
        }
    }

    fn call_block(&mut self) {
        let Some((path, shape)) = self.reach(&|s| matches!(s, Shape::Block(_)), true) else { return self.assignment() };
        let Shape::Block(i) = shape else { return };
        let block = self.blocks[i].clone();
        if let Some(action) = &block.action
            && block.in_outs.is_empty()
            && self.random.chance(20)
        {
            return self.line(&format!("{path}.{action}();"));
        }
        let Some(mut arguments) = self.arguments(&block.inputs, &block.in_outs, 1, false) else { return };
        self.output_arguments(&block.outputs, &mut arguments);
        self.line(&format!("{path}({});", arguments.join(", ")));
    }

    /// A call of a function with such a result, as an expression.
    pub(super) fn function_call(&mut self, result: &Shape, depth: usize) -> Option<String> {
        let fits: Vec<usize> = (0..self.functions.len()).filter(|i| self.functions[*i].result.as_ref() == Some(result)).collect();
        let i = *fits.get(self.random.below(fits.len()))?;
        self.call(i, depth.min(1), false)
    }

    fn call_function(&mut self) {
        if self.functions.is_empty() {
            return self.assignment();
        }
        let i = self.random.below(self.functions.len());
        let Some(call) = self.call(i, 1, true) else { return self.assignment() };
        let result = self.functions[i].result.clone();
        let target = result.and_then(|r| self.reach(&|s| *s == r, true));
        match target {
            Some((path, _)) if self.random.chance(80) => self.line(&format!("{path} := {call};")),
            _ => self.line(&format!("{call};")),
        }
    }

    fn call(&mut self, i: usize, depth: usize, outputs: bool) -> Option<String> {
        let function = self.functions[i].clone();
        if function.in_outs.iter().any(|(_, s)| matches!(s, Shape::Open(_))) {
            return None;
        }
        // A call of calls of calls would take for ever: the arguments are plain.
        let functions = std::mem::take(&mut self.functions);
        let arguments = self.arguments(&function.inputs, &function.in_outs, depth, true);
        self.functions = functions;
        let mut arguments = arguments?;
        if function.recursive
            && let Some(first) = arguments.first_mut()
        {
            let deep = self.wild && self.random.chance(30);
            let level = if deep { "30000".into() } else { self.random.below(6).to_string() };
            *first = format!("level := {level}");
        }
        if outputs {
            self.output_arguments(&function.outputs, &mut arguments);
        }
        Some(format!("{}({})", function.name, arguments.join(", ")))
    }

    /// A call of the function over `ARRAY[*]`, with an array of any length.
    fn open_array_call(&mut self) {
        let open = self.functions.iter().find_map(|f| match f.in_outs.first() {
            Some((name, Shape::Open(elem))) => Some((f.name.clone(), name.clone(), (**elem).clone())),
            _ => None,
        });
        let Some((function, parameter, elem)) = open else { return self.assignment() };
        let fits =
            |s: &Shape| matches!(s, Shape::Array(e, dims) if **e == elem && dims.len() == 1) || *s == Shape::Open(Box::new(elem.clone()));
        let (array, target) = (self.reach(&fits, true), self.reach(&|s| s.is(Class::Int), true));
        let k = self.int(1);
        if let (Some((array, _)), Some((target, _))) = (array, target) {
            self.line(&format!("{target} := {function}({parameter} := {array}, k := {k});"));
        }
    }
}
