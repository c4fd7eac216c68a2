//! Random ST programs: the same seed is the same program, on every machine.
//!
//! Each program has types, global variables, functions (one calls itself, one takes `ARRAY[*]`), blocks within blocks, and a main program. It compiles
//! without errors. A *tame* program guards its indices, divisors, pointers and loops, so that it runs its scans to their end; a *wild* one (three of ten)
//! forges indices and pointers, divides by what may be 0, calls itself without end and loops without end.
//!
//! **What is absent:** tasks and configurations, files, motion and G-code blocks; they have tests of their own.

mod expression;
mod literal;
mod object;
mod place;
mod random;
mod shape;
mod statement;
mod unit;

pub use random::Random;
use shape::{Enumeration, Range, Shape, Signature, Structure, Variable, named};

/// A program.
#[derive(Debug, Clone)]
pub struct Generated {
    /// What it was made from.
    pub seed: u64,
    /// ST text.
    pub source: String,
    /// Integers are cut at each operator.
    pub iec_arithmetic: bool,
}

/// The program of a seed.
pub fn generate(seed: u64) -> Generated {
    let mut random = Random::new(seed);
    let iec_arithmetic = random.chance(12);
    let wild = random.chance(30);
    let mut generator = Generator { random, wild, ..Generator::default() };
    generator.program();
    Generated { seed, source: generator.text, iec_arithmetic }
}

/// A program that is being written.
#[derive(Debug)]
struct Generator {
    random: Random,
    wild: bool,
    text: String,
    indent: usize,
    enumerations: Vec<Enumeration>,
    ranges: Vec<Range>,
    structures: Vec<Structure>,
    blocks: Vec<Signature>,
    functions: Vec<Signature>,
    globals: Vec<Variable>,
    /// An interface and the blocks that implement it.
    objects: Option<object::Objects>,
    /// What can be named here.
    scope: Vec<Variable>,
    /// Loop counters that no loop around this place uses.
    counters: Vec<String>,
    /// Loops around this place.
    loops: usize,
    labels: usize,
    /// Statements that may still be written in this unit.
    budget: usize,
}

impl Default for Generator {
    fn default() -> Self {
        Self {
            random: Random::new(0),
            wild: false,
            text: String::new(),
            indent: 0,
            enumerations: Vec::new(),
            ranges: Vec::new(),
            structures: Vec::new(),
            blocks: unit::standard_blocks(),
            functions: Vec::new(),
            globals: Vec::new(),
            objects: None,
            scope: Vec::new(),
            counters: Vec::new(),
            loops: 0,
            labels: 0,
            budget: 0,
        }
    }
}

impl Generator {
    fn line(&mut self, text: &str) {
        for _ in 0..self.indent {
            self.text.push_str("  ");
        }
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn program(&mut self) {
        self.types();
        self.global_variables();
        for i in 0..1 + self.random.below(3) {
            self.function(&format!("f{i}"));
        }
        if self.random.chance(50) {
            self.recursive_function();
        }
        if self.random.chance(30) {
            self.open_array_function();
        }
        for i in 0..self.random.below(3) {
            self.block(&format!("fb{i}"));
        }
        if self.random.chance(50) {
            self.hierarchy();
        }
        self.main();
    }

    fn types(&mut self) {
        self.line("TYPE");
        for i in 0..self.random.below(3) {
            self.enumeration(i);
        }
        if self.random.chance(40) {
            let base = named(self.random.pick(&["SINT", "INT", "UINT", "DINT", "BYTE"]));
            let (low, high) = (self.random.below(5) as i64, 6 + self.random.below(100) as i64);
            self.line(&format!("  r0 : {} ({low}..{high});", base.name));
            self.ranges.push(Range { name: "r0".into(), base, low, high });
        }
        for i in 0..1 + self.random.below(3) {
            self.structure(i);
        }
        self.line("END_TYPE");
    }

    fn enumeration(&mut self, i: usize) {
        let members: Vec<String> = (0..2 + self.random.below(4)).map(|m| format!("e{i}_{m}")).collect();
        let list: Vec<String> =
            members.iter().enumerate().map(|(m, name)| if m == 1 { format!("{name} := {}", 5 + i) } else { name.clone() }).collect();
        let base = self.random.pick(&["", "", " USINT", " DINT", " LINT"]);
        self.line(&format!("  en{i} : ({}){base};", list.join(", ")));
        self.enumerations.push(Enumeration { name: format!("en{i}"), members });
    }

    fn structure(&mut self, i: usize) {
        let union = self.random.chance(25);
        let word = if union { "UNION" } else { "STRUCT" };
        let name = format!("st{i}");
        self.line(&format!("  {name} : {word}"));
        let mut fields = Vec::new();
        for f in 0..1 + self.random.below(5) {
            let shape = match (union, self.data(1)) {
                (true, Shape::Text(_) | Shape::Wide(_) | Shape::Enumeration(_) | Shape::Range(_)) => self.elementary(),
                (_, shape) => shape,
            };
            self.line(&format!("    m{f} : {};", self.spell(&shape)));
            fields.push((format!("m{f}"), shape));
        }
        self.line(&format!("  END_{word}"));
        self.structures.push(Structure { name, fields });
    }

    fn global_variables(&mut self) {
        let mut variables = Vec::new();
        for i in 0..3 + self.random.below(4) {
            let shape = if i == 0 { self.array(2) } else { self.data(2) };
            variables.push(Variable::new(format!("g{i}"), shape));
        }
        self.declare("VAR_GLOBAL", &variables);
        self.globals = variables;
    }
}

#[cfg(test)]
mod tests {
    use super::generate;

    #[test]
    fn a_seed_is_a_program() {
        assert_eq!(generate(7).source, generate(7).source);
        assert_ne!(generate(7).source, generate(8).source);
    }
}
