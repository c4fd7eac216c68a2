//! `{attribute 'instance-path'}`: a STRING of a block that holds where the instance stands, as `Project.MAIN.valve[2]`.

use crate::unit::Compiler;
use takt_abi::Section;
use takt_ir::{StructKind, Type, TypeId};
use takt_syntax::tree::VarDecl;

/// What the path begins with if the project has no name.
pub(crate) const APPLICATION: &str = "Application";

impl Compiler<'_> {
    /// Name of the project.
    pub(crate) fn project_name(&self) -> String {
        if self.options.name.is_empty() { APPLICATION.into() } else { self.options.name.clone() }
    }

    /// Writes the paths of the instances inside of a variable.
    pub(crate) fn write_instance_paths(&mut self, ty: TypeId, offset: u32, name: &str) {
        if self.wants_path(ty) {
            let path = format!("{}.{name}", self.project_name());
            self.paths_in(ty, offset, &path);
        }
    }

    /// The members that are to hold the path of the instance: offset and length.
    fn path_members(&self, ty: TypeId) -> Vec<(u32, u32)> {
        let (Some(unit), Type::Struct(structure)) = (self.pou_of_type.get(&ty), self.types.get(ty)) else { return Vec::new() };
        let is_marked = |decl: &VarDecl| decl.pragmas.iter().any(|pragma| pragma.name == "instance-path");
        let marked = self.bases(*unit).flat_map(|base| &self.pous[base].vars).filter(|var| is_marked(var.decl));
        let field = |name: &str| structure.fields.iter().find(|field| crate::scope::same(&field.name, name));
        marked
            .filter_map(|var| match self.types.get(var.ty) {
                Type::String(length) => Some((field(&var.name)?.offset, *length)),
                _ => None,
            })
            .collect()
    }

    fn wants_path(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.wants_path(*elem),
            Type::Struct(structure) => {
                structure.kind != StructKind::Union
                    && (!self.path_members(ty).is_empty()
                        || structure.fields.iter().any(|field| field.section != Section::InOut && self.wants_path(field.ty)))
            }
            _ => false,
        }
    }

    fn paths_in(&mut self, ty: TypeId, offset: u32, path: &str) {
        match self.types.get(ty).clone() {
            Type::Array { elem, dims } if self.wants_path(elem) => {
                let stride = self.types.size(elem).max(1);
                for n in 0..self.types.size(ty) / stride {
                    self.paths_in(elem, offset + n * stride, &format!("{path}[{}]", index(&dims, n)));
                }
            }
            Type::Struct(structure) if structure.kind != StructKind::Union => {
                for (member, length) in self.path_members(ty) {
                    self.write_text(offset + member, length, path);
                }
                for field in structure.fields.iter().filter(|field| field.section != Section::InOut) {
                    if self.wants_path(field.ty) {
                        self.paths_in(field.ty, offset + field.offset, &format!("{path}.{}", field.name));
                    }
                }
            }
            _ => {}
        }
    }

    /// A text as initial bytes of a STRING of that length.
    fn write_text(&mut self, offset: u32, length: u32, text: &str) {
        let mut end = text.len().min(length as usize);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let (start, size) = (offset as usize, length as usize + 1);
        let init = &mut self.program.init;
        init.resize(init.len().max(start + size), 0);
        init[start..start + size].fill(0);
        init[start..start + end].copy_from_slice(&text.as_bytes()[..end]);
    }
}

/// The indices of the n-th element of an array.
fn index(dims: &[(i64, i64)], mut n: u32) -> String {
    let mut indices = Vec::new();
    for (low, high) in dims.iter().rev() {
        let count = u32::try_from(high - low + 1).unwrap_or(1).max(1);
        indices.push((low + i64::from(n % count)).to_string());
        n /= count;
    }
    indices.reverse();
    indices.join(",")
}
