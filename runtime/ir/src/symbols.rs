//! Variables by name: a path as people write it becomes a [`Place`] in the image.
//!
//! A path starts at a global (with its list's name, or bare where the program allows that) or a program instance and goes on through members and
//! array elements. Case does not matter. What a VAR_IN_OUT, pointer or reference leads to changes while the program runs: it is not followed.

use crate::address::{AddressError, parse_address};
use crate::program::{Global, Program};
use crate::types::{Type, TypeId, Types};
use takt_abi::Section;

mod spelling;

pub(crate) use spelling::closest;

/// A named place in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Place {
    /// Offset into the image.
    pub offset: u32,
    /// Type.
    pub ty: TypeId,
}

/// Why a path names nothing. `within` is the part before, as the program spells it (empty at the start).
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SymbolError {
    /// Not of the form `name.name[1, 2].name`.
    Malformed {
        /// The path.
        path: String,
        /// In characters, from 1.
        column: u32,
    },
    /// A part of the path is unknown.
    Unknown {
        /// The part as written.
        part: String,
        /// What was resolved before it: `GVL.Theta1`.
        within: String,
        /// The closest existing name.
        suggestion: Option<String>,
    },
    /// A bare name that several lists have.
    Ambiguous {
        /// The name as written.
        part: String,
        /// Full names.
        candidates: Vec<String>,
    },
    /// An index outside its bounds.
    Index {
        /// The array.
        within: String,
        /// The index.
        value: i64,
        /// Lower bound.
        low: i64,
        /// Upper bound.
        high: i64,
    },
    /// Too many or too few indices.
    Dimensions {
        /// The array.
        within: String,
        /// Dimensions of the array.
        expected: usize,
        /// Indices in the path.
        found: usize,
    },
    /// Indices on what is no array.
    NotArray {
        /// The place.
        within: String,
        /// Its type.
        ty: String,
    },
    /// A member of what has none.
    NotStructure {
        /// The place.
        within: String,
        /// Its type.
        ty: String,
    },
    /// Not a direct address, or none that anything in the program lies at.
    Address {
        /// The path.
        path: String,
        /// What is wrong with it; `None`: nothing lies there.
        error: Option<AddressError>,
    },
    /// A VAR_IN_OUT, pointer or reference would have to be followed.
    Indirect {
        /// The place.
        within: String,
    },
}

impl std::fmt::Display for SymbolError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Malformed { path, column } => {
                write!(f, "`{path}` is not a variable's path (at character {column}); write `GVL.Axis[2].Position`")
            }
            Self::Unknown { part, within, suggestion } => {
                write!(f, "there is no `{part}`")?;
                if !within.is_empty() {
                    write!(f, " in `{within}`")?;
                }
                suggestion.as_ref().map_or(Ok(()), |name| write!(f, "; did you mean `{name}`?"))
            }
            Self::Ambiguous { part, candidates } => write!(f, "`{part}` is ambiguous: {}", candidates.join(", ")),
            Self::Index { within, value, low, high } => write!(f, "index {value} of `{within}` is outside {low}..{high}"),
            Self::Dimensions { within, expected, found } => write!(f, "`{within}` takes {expected} indices, found {found}"),
            Self::NotArray { within, ty } => write!(f, "`{within}` is `{ty}` and takes no index"),
            Self::NotStructure { within, ty } => write!(f, "`{within}` is `{ty}` and has no members"),
            Self::Address { path, error: Some(error) } => write!(f, "`{path}` is not an address: {error}"),
            Self::Address { path, error: None } => write!(f, "the program has nothing at `{path}`"),
            Self::Indirect { within } => write!(f, "`{within}` refers to another variable; name that one"),
        }
    }
}
impl std::error::Error for SymbolError {}

/// The place that a path names: `GVL.Theta1.fActPosition`, `PLC_PRG.a[3].b`, `%IX0.3`.
pub fn resolve(program: &Program, path: &str) -> Result<Place, SymbolError> {
    if path.trim_start().starts_with('%') {
        return direct(program, path.trim());
    }
    let steps = split(path)?;
    let (global, used) = start(program, &steps)?;
    let mut walk = Walk { types: &program.types, name: global.name.clone(), ty: global.ty, offset: global.offset.into() };
    for step in &steps[used..] {
        match step {
            Step::Name(name) => walk.member(name)?,
            Step::Indices(indices) => walk.element(indices)?,
        }
    }
    Ok(Place { offset: u32::try_from(walk.offset).unwrap_or(u32::MAX), ty: walk.ty })
}

/// What lies at a direct address: `%IX0.3` is a bit, `%QW2` a WORD.
fn direct(program: &Program, path: &str) -> Result<Place, SymbolError> {
    let wrong = |error| SymbolError::Address { path: path.into(), error };
    let address = parse_address(path, program.areas.word).map_err(|error| wrong(Some(error)))?;
    let place = program.areas.offset(address).zip(program.types.find(&address.ty()));
    place.map(|(offset, ty)| Place { offset, ty }).ok_or_else(|| wrong(None))
}

/// A part of a path.
#[derive(Debug, PartialEq)]
enum Step<'a> {
    Name(&'a str),
    Indices(Vec<i64>),
}

fn split(path: &str) -> Result<Vec<Step<'_>>, SymbolError> {
    let at = |rest: &str| SymbolError::Malformed { path: path.into(), column: path[..path.len() - rest.len()].chars().count() as u32 + 1 };
    let mut steps = vec![];
    let mut rest = path.trim_end();
    loop {
        let name = rest.trim_start();
        let len = name.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(name.len());
        if len == 0 {
            return Err(at(name));
        }
        steps.push(Step::Name(&name[..len]));
        rest = name[len..].trim_start();
        while let Some(list) = rest.strip_prefix('[') {
            let end = list.find(']').ok_or_else(|| at(rest))?;
            let indices = list[..end].split(',').map(|i| crate::literal::integer(i.trim()).and_then(|v| i64::try_from(v).ok()));
            steps.push(Step::Indices(indices.collect::<Option<_>>().ok_or_else(|| at(list))?));
            rest = list[end + 1..].trim_start();
        }
        match rest.strip_prefix('.') {
            Some(next) => rest = next,
            None if rest.is_empty() => return Ok(steps),
            None => return Err(at(rest)),
        }
    }
}

/// The global at the start of a path, and how many steps its name takes.
fn start<'a>(program: &'a Program, steps: &[Step<'_>]) -> Result<(&'a Global, usize), SymbolError> {
    let names: Vec<&str> = steps.iter().map_while(|s| if let Step::Name(name) = s { Some(*name) } else { None }).collect();
    let full = |g: &&Global| {
        let parts = g.name.split('.').count();
        parts <= names.len() && g.name.split('.').zip(&names).all(|(a, b)| same(a, b))
    };
    if let Some(global) = program.globals.iter().filter(full).max_by_key(|g| g.name.split('.').count()) {
        return Ok((global, global.name.split('.').count()));
    }
    let bare: Vec<&Global> = program.globals.iter().filter(|g| g.bare && same(last(&g.name), names[0])).collect();
    match bare[..] {
        [global] => Ok((global, 1)),
        [] => Err(unknown_start(program, &names)),
        _ => Err(SymbolError::Ambiguous { part: names[0].into(), candidates: bare.iter().map(|g| g.name.clone()).collect() }),
    }
}

fn unknown_start(program: &Program, names: &[&str]) -> SymbolError {
    let list = |g: &'_ Global| g.name.rsplit_once('.').map(|(list, _)| list.to_owned());
    let within = program.globals.iter().filter_map(list).find(|l| same(l, names[0]));
    if let (Some(within), Some(part)) = (within, names.get(1)) {
        let in_list = program.globals.iter().filter(|g| list(g).as_deref() == Some(&within)).map(|g| last(&g.name));
        let suggestion = closest(part, in_list).map(Into::into);
        return SymbolError::Unknown { part: (*part).into(), within, suggestion };
    }
    let bare = program.globals.iter().filter(|g| g.bare).map(|g| last(&g.name));
    let firsts = program.globals.iter().filter_map(|g| g.name.split('.').next());
    let whole = program.globals.iter().find(|g| same(last(&g.name), names[0]) || list(g).is_some_and(|l| same(&l, names[0])));
    let suggestion = whole.map(|g| g.name.as_str()).or_else(|| closest(names[0], bare.chain(firsts))).map(Into::into);
    SymbolError::Unknown { part: names[0].into(), within: String::new(), suggestion }
}

fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

/// Whether two names are the same in ST.
pub(crate) fn same(a: &str, b: &str) -> bool {
    a.chars().flat_map(char::to_uppercase).eq(b.chars().flat_map(char::to_uppercase))
}

/// What has been resolved so far.
struct Walk<'a> {
    types: &'a Types,
    name: String,
    ty: TypeId,
    offset: u64,
}

impl Walk<'_> {
    fn member(&mut self, name: &str) -> Result<(), SymbolError> {
        let structure = match self.types.get(self.ty) {
            Type::Struct(structure) => structure,
            Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) => return Err(SymbolError::Indirect { within: self.name.clone() }),
            _ => return Err(SymbolError::NotStructure { within: self.name.clone(), ty: self.types.name(self.ty) }),
        };
        let Some(field) = structure.fields.iter().find(|f| same(&f.name, name)) else {
            let suggestion = closest(name, structure.fields.iter().map(|f| f.name.as_str())).map(Into::into);
            return Err(SymbolError::Unknown { part: name.into(), within: self.name.clone(), suggestion });
        };
        self.name = format!("{}.{}", self.name, field.name);
        if field.section == Section::InOut {
            return Err(SymbolError::Indirect { within: self.name.clone() });
        }
        self.ty = field.ty;
        self.offset += u64::from(field.offset);
        Ok(())
    }
    fn element(&mut self, indices: &[i64]) -> Result<(), SymbolError> {
        let within = || self.name.clone();
        let (elem, dims) = match self.types.get(self.ty) {
            Type::Array { elem, dims } => (*elem, dims),
            Type::Pointer(_) | Type::Reference(_) | Type::OpenArray { .. } => return Err(SymbolError::Indirect { within: within() }),
            _ => return Err(SymbolError::NotArray { within: within(), ty: self.types.name(self.ty) }),
        };
        if dims.len() != indices.len() {
            return Err(SymbolError::Dimensions { within: within(), expected: dims.len(), found: indices.len() });
        }
        let mut number = 0i128;
        for (&value, &(low, high)) in indices.iter().zip(dims) {
            if !(low..=high).contains(&value) {
                return Err(SymbolError::Index { within: within(), value, low, high });
            }
            number = number * (i128::from(high) - i128::from(low) + 1) + (i128::from(value) - i128::from(low));
        }
        let shown: Vec<_> = indices.iter().map(ToString::to_string).collect();
        self.name = format!("{}[{}]", self.name, shown.join(", "));
        self.offset += number as u64 * u64::from(self.types.size(elem));
        self.ty = elem;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Field, StructKind, Structure};
    use std::sync::Arc;
    use takt_abi::Elem;

    fn program() -> Program {
        let mut program = Program { image_size: 4096, ..Program::default() };
        program.areas.ranges[2] = (2048, 8);
        program.areas.word = true;
        let types = &mut program.types;
        types.intern(Type::Elem(Elem::Word));
        let [int, lreal] = [Elem::Int, Elem::Lreal].map(|e| types.intern(Type::Elem(e)));
        let field = |name: &str, ty, offset, section| Field { name: name.into(), ty, offset, section, doc: String::new() };
        let mut structure = |name: &str, fields, size| {
            types.intern(Type::Struct(Arc::new(Structure { name: name.into(), kind: StructKind::Block, fields, size, align: 8 })))
        };
        let axis = structure(
            "AXIS",
            vec![
                field("fActPosition", lreal, 8, Section::Output),
                field("fSetPosition", lreal, 16, Section::Output),
                field("Ref", int, 24, Section::InOut),
            ],
            32,
        );
        let axes = types.intern(Type::Array { elem: axis, dims: vec![(-1, 1), (1, 4)] });
        let pointer = types.intern(Type::Pointer(axis));
        let global = |name: &str, bare, ty, offset| Global { name: name.into(), bare, ty, offset, constant: false, doc: String::new() };
        program.globals = vec![
            global("GVL.Theta1", true, axis, 64),
            global("GVL.Axes", true, axes, 128),
            global("GVL.Same", true, int, 1024),
            global("Other.Same", true, int, 1026),
            global("Other.Hidden", false, int, 1028),
            global("GVL.Ptr", true, pointer, 1032),
            global("PLC_PRG", false, axis, 1040),
        ];
        program
    }

    #[track_caller]
    fn check(path: &str, expected: u32) {
        assert_eq!(resolve(&program(), path).map(|p| p.offset), Ok(expected), "{path}");
    }
    #[track_caller]
    fn refused(path: &str, expected: &str) {
        assert_eq!(resolve(&program(), path).expect_err("is refused").to_string(), expected, "{path}");
    }

    #[test]
    fn a_path_leads_through_lists_members_and_elements() {
        check("GVL.Theta1.fActPosition", 72);
        check("gvl.theta1.FACTPOSITION", 72);
        check("Theta1.fSetPosition", 80);
        check(" PLC_PRG . fActPosition ", 1048);
        check("GVL.Axes[-1, 1]", 128);
        check("Axes[1,4].fActPosition", 128 + 11 * 32 + 8);
        check("Axes[0,2].fActPosition", 128 + 5 * 32 + 8);
        check("GVL.Axes[16#1,4]", 128 + 11 * 32);
        check("Other.Same", 1026);
        check("GVL.Ptr", 1032);
        check("%MW2", 2052);
    }

    #[test]
    fn a_wrong_path_says_which_part_and_what_was_meant() {
        refused("GVL.Thteta1.fActPosition", "there is no `Thteta1` in `GVL`; did you mean `Theta1`?");
        refused("GVL.Theta1.fActPostion", "there is no `fActPostion` in `GVL.Theta1`; did you mean `fActPosition`?");
        refused("Theta", "there is no `Theta`; did you mean `Theta1`?");
        refused("PLC_PGR.x", "there is no `PLC_PGR`; did you mean `PLC_PRG`?");
        refused("zzzzzz", "there is no `zzzzzz`");
        refused("GVL", "there is no `GVL`; did you mean `GVL.Theta1`?");
        refused("Hidden", "there is no `Hidden`; did you mean `Other.Hidden`?");
        refused("Same", "`Same` is ambiguous: GVL.Same, Other.Same");
        refused("Axes[0,5]", "index 5 of `GVL.Axes` is outside 1..4");
        refused("Axes[0]", "`GVL.Axes` takes 2 indices, found 1");
        refused("Theta1[0]", "`GVL.Theta1` is `AXIS` and takes no index");
        refused("GVL.Same.x", "`GVL.Same` is `INT` and has no members");
        refused("GVL.Theta1.Ref", "`GVL.Theta1.Ref` refers to another variable; name that one");
        refused("%IB0", "the program has nothing at `%IB0`");
        refused("%MX0", "`%MX0` is not an address: the number of the bit is missing, as in `%IX0.3`");
        refused("GVL.Ptr.fActPosition", "`GVL.Ptr` refers to another variable; name that one");
    }

    #[test]
    fn a_malformed_path_says_where() {
        for (path, column) in [
            ("", 1),
            ("a..b", 3),
            ("a.", 3),
            ("Axes[1", 5),
            ("Axes[x]", 6),
            ("a b", 3),
            ("Axes[1]x", 8),
            ("°", 1),
            ("Axes[99999999999999999999]", 6),
        ] {
            assert_eq!(resolve(&program(), path), Err(SymbolError::Malformed { path: path.into(), column }), "{path}");
        }
    }
}
