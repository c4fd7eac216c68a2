//! Places: variables, and what is reached from them through fields and indices.

use super::Generator;
use super::shape::{Class, Scalar, Shape, Variable, named};

impl Generator {
    /// A place of a type that fits, reached through fields and indices; `None` if chance finds none.
    pub(super) fn reach(&mut self, fits: &dyn Fn(&Shape) -> bool, writes: bool) -> Option<(String, Shape)> {
        for _ in 0..24 {
            let variable = self.variable()?;
            if writes && !variable.writable {
                continue;
            }
            let (mut path, mut shape) = (variable.path, variable.shape);
            for _ in 0..6 {
                if fits(&shape) {
                    return Some((path, shape));
                }
                match self.inside(&path, &shape, writes) {
                    Some(deeper) => (path, shape) = deeper,
                    None => break,
                }
            }
        }
        None
    }

    /// One of the variables that can be named here.
    fn variable(&mut self) -> Option<Variable> {
        let at = self.random.below(self.scope.len());
        self.scope.get(at).cloned()
    }

    fn inside(&mut self, path: &str, shape: &Shape, writes: bool) -> Option<(String, Shape)> {
        match shape {
            Shape::Structure(i) => {
                let fields = &self.structures[*i].fields;
                let (name, shape) = fields[self.random.below(fields.len())].clone();
                Some((format!("{path}.{name}"), shape))
            }
            Shape::Block(i) => {
                let block = &self.blocks[*i];
                let outputs = block.outputs.iter().filter(|_| !writes);
                let seen: Vec<_> = block.inputs.iter().chain(outputs).cloned().collect();
                let (name, shape) = seen.get(self.random.below(seen.len()))?.clone();
                Some((format!("{path}.{name}"), shape))
            }
            Shape::Array(elem, dims) => {
                let indices: Vec<_> = dims.iter().map(|d| self.index(*d)).collect();
                Some((format!("{path}[{}]", indices.join(", ")), (**elem).clone()))
            }
            Shape::Open(elem) => {
                let offset = if self.wild && self.random.chance(20) { self.int(0) } else { "0".into() };
                Some((format!("{path}[LOWER_BOUND({path}, 1) + {offset}]"), (**elem).clone()))
            }
            Shape::Text(n) if self.random.chance(20) => {
                let index = self.index((0, i64::from(*n)));
                Some((format!("{path}[{index}]"), Shape::Scalar(named("BYTE"))))
            }
            Shape::Wide(n) if self.random.chance(20) => {
                let index = self.index((0, i64::from(*n)));
                Some((format!("{path}[{index}]"), Shape::Scalar(named("WORD"))))
            }
            _ => None,
        }
    }

    /// An index into these bounds; in a wild program it may lie outside.
    pub(super) fn index(&mut self, (low, high): (i64, i64)) -> String {
        let counter = self.plain(&|s| s.is(Class::Int) && s.scalar().is_some_and(|s| s.bits <= 32));
        let length = high - low + 1;
        match counter {
            Some(counter) if self.wild && self.random.chance(15) => format!("{counter} + {}", self.random.below(9) as i64 - 2),
            Some(counter) if self.random.chance(70) => {
                let guarded = format!("ABS({counter}) MOD {length}");
                if low == 0 { guarded } else { format!("{guarded} + ({low})") }
            }
            _ => (low + self.random.below(length as usize) as i64).to_string(),
        }
    }

    /// A variable that is itself of such a type.
    pub(super) fn plain(&mut self, fits: &dyn Fn(&Shape) -> bool) -> Option<String> {
        let found: Vec<&Variable> = self.scope.iter().filter(|v| fits(&v.shape)).collect();
        found.get(self.random.below(found.len())).map(|v| v.path.clone())
    }

    /// A place of exactly this elementary type.
    pub(super) fn place(&mut self, s: &'static Scalar) -> Option<String> {
        self.reach(&|shape| *shape == Shape::Scalar(s), false).map(|(path, _)| path)
    }

    /// A place of this class.
    pub(super) fn place_of(&mut self, class: Class) -> Option<(String, &'static Scalar)> {
        let (path, shape) = self.reach(&|shape| shape.is(class), false)?;
        Some((path, shape.scalar()?))
    }
}
