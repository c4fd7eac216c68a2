//! Parameters: what is set once for a machine and outlives everything but an origin reset, that is, its PERSISTENT variables, one by one.
//!
//! Which member of what is a parameter is said in ST (`VAR_GLOBAL PERSISTENT`), so nothing about it is written twice; RETAIN variables are state (counters,
//! positions), and no parameters.

use crate::control::limits;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use takt_abi::Section;
use takt_ir::{Place, Program, RetainKind, Type, TypeId};

/// A parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// Its path.
    pub path: String,
    /// Where it lies.
    pub place: Place,
}

/// All parameters of a program, in the order of their declarations; or which variable has more elements than are handled.
pub fn list(program: &Program) -> Result<Vec<Parameter>, String> {
    let mut walk = Walk { program, found: Vec::new() };
    for retained in program.retained.iter().filter(|retained| retained.kind == RetainKind::Persistent) {
        let whole = walk.visit(&mut retained.path.clone(), retained.ty, retained.offset.into());
        whole.ok_or_else(|| format!("with `{}` the program has more than {} parameters", retained.path, limits::VARIABLES))?;
    }
    Ok(walk.found)
}

struct Walk<'p> {
    program: &'p Program,
    found: Vec<Parameter>,
}

impl Walk<'_> {
    fn visit(&mut self, path: &mut String, ty: TypeId, offset: u64) -> Option<()> {
        let (len, types) = (path.len(), &self.program.types);
        match types.get(ty) {
            Type::Array { elem, dims } => {
                let size = u64::from(types.size(*elem)).max(1);
                for number in 0..u64::from(types.size(ty)) / size {
                    path.push_str(&indices(dims, number));
                    self.visit(path, *elem, offset + number * size)?;
                    path.truncate(len);
                }
            }
            Type::Struct(structure) => {
                for field in structure.fields.iter().filter(|field| field.section != Section::InOut) {
                    path.push('.');
                    path.push_str(&field.name);
                    self.visit(path, field.ty, offset + u64::from(field.offset))?;
                    path.truncate(len);
                }
            }
            _ => {
                let place = Place { offset: u32::try_from(offset).ok()?, ty };
                if takt_engine::writable(self.program, place).is_ok() {
                    self.found.push(Parameter { path: path.clone(), place });
                }
            }
        }
        (self.found.len() <= limits::VARIABLES).then_some(())
    }
}

/// The indices of the element with that number, as they are written.
fn indices(dims: &[(i64, i64)], number: u64) -> String {
    let mut rest = number;
    let mut parts = Vec::new();
    for (low, high) in dims.iter().rev() {
        let len = high.abs_diff(*low) + 1;
        parts.push((low + (rest % len) as i64).to_string());
        rest /= len;
    }
    parts.reverse();
    format!("[{}]", parts.join(", "))
}

/// A file of parameters: TOML or JSON, as its name says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// Version of the form.
    pub schema: u32,
    /// Name of the project.
    #[serde(default)]
    pub project: String,
    /// Literals of ST by the paths of the variables.
    pub parameters: BTreeMap<String, String>,
}

/// Bytes of a file at the most.
const LONGEST: u64 = 16 << 20;
/// Version of the form.
pub const SCHEMA: u32 = 1;

/// Whether a file is TOML; else it is JSON.
fn is_toml(path: &std::path::Path) -> Result<bool, String> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("toml") => Ok(true),
        Some("json") => Ok(false),
        _ => Err(format!("{}: a file of parameters is a .toml or a .json", path.display())),
    }
}

impl File {
    /// The text of a file.
    pub fn text(&self, path: &std::path::Path) -> Result<String, String> {
        let text = if is_toml(path)? {
            toml::to_string(self).map_err(|error| error.to_string())
        } else {
            serde_json::to_string_pretty(self).map(|text| text + "\n").map_err(|error| error.to_string())
        };
        text.map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Reads a file.
    pub fn read(path: &std::path::Path) -> Result<Self, String> {
        use std::io::Read;
        let toml = is_toml(path)?;
        let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let mut text = String::new();
        let file = std::fs::File::open(path).map_err(|error| wrong(&error))?;
        file.take(LONGEST + 1).read_to_string(&mut text).map_err(|error| wrong(&error))?;
        if text.len() as u64 > LONGEST {
            return Err(wrong(&format!("it has more than {LONGEST} bytes")));
        }
        let file: Self = if toml {
            toml::from_str(&text).map_err(|error| wrong(&error))?
        } else {
            serde_json::from_str(&text).map_err(|error| wrong(&error))?
        };
        match file.schema {
            SCHEMA => Ok(file),
            other => Err(wrong(&format!("its form has version {other}, this Takt reads version {SCHEMA}"))),
        }
    }
}
