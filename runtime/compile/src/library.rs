//! Native descriptors become types and names.

use crate::scope::{Item, key};
use crate::unit::Compiler;
use std::rc::Rc;
use std::sync::Arc;
use takt_abi::{FieldDesc, FieldType, Section, StructDesc};
use takt_ir::{Enumeration, Field, StructKind, Structure, Type, TypeId};

impl Compiler<'_> {
    pub(crate) fn register_libraries(&mut self) {
        for library in self.libraries {
            self.add_native(library.name, Item::Library);
            for desc in library.enums {
                let ty = self.native_type(&FieldType::Enum(desc));
                self.add_native(desc.name, Item::Ready(ty));
                let bare = if desc.qualified_only { &[] } else { desc.members };
                for (member, value) in bare {
                    self.add_native(member, Item::Enumerator(ty, *value));
                }
            }
            for desc in library.structs {
                let ty = self.native_type(&FieldType::Struct(desc));
                self.add_native(desc.name, Item::Ready(ty));
            }
            for desc in library.blocks {
                let ty = self.native_struct(desc.name, desc.fields, StructKind::Block, desc.size, desc.align, desc.init);
                self.native_blocks.insert(ty, desc);
                for name in std::iter::once(&desc.name).chain(desc.aliases) {
                    self.add_native(name, Item::NativeBlock(ty));
                }
            }
            for desc in library.functions {
                self.add_native(desc.name, Item::NativeFunction(desc));
            }
            for (alias, name) in library.aliases {
                if let Some(item) = self.library_names.get(&key(name)).copied() {
                    self.add_native(alias, item);
                }
            }
        }
    }

    /// What `library.name` means: a name that the library has only there (`MEM.MemMove`), else one of all libraries.
    pub(crate) fn library_member(&self, library: &str, name: &str) -> Option<Item> {
        let own = self.library_names.get(&key(&format!("{library}.{name}")));
        own.or_else(|| self.library_names.get(&key(name))).copied()
    }

    fn add_native(&mut self, name: &str, item: Item) {
        self.library_names.entry(key(name)).or_insert(item);
    }

    /// The type of a native field.
    pub(crate) fn native_type(&mut self, field: &FieldType) -> TypeId {
        match field {
            FieldType::Elem(e) => self.types.intern(Type::Elem(*e)),
            FieldType::String(n) => self.types.intern(Type::String(*n)),
            FieldType::WString(n) => self.types.intern(Type::WString(*n)),
            FieldType::Array { elem, low, high } => {
                let elem = self.native_type(elem);
                self.types.intern(Type::Array { elem, dims: vec![(*low, *high)] })
            }
            FieldType::OpenArray(elem) => {
                let elem = self.native_type(elem);
                self.types.intern(Type::OpenArray { elem, dims: 1 })
            }
            FieldType::Pointer(to) => {
                let to = self.native_type(to);
                self.types.intern(Type::Pointer(to))
            }
            FieldType::Enum(desc) => self.types.intern(Type::Enum(Arc::new(Enumeration {
                name: desc.name.into(),
                base: desc.base,
                members: desc.members.iter().map(|(n, v)| ((*n).into(), *v)).collect(),
            }))),
            FieldType::Struct(desc) => self.native_structure(desc),
        }
    }

    fn native_structure(&mut self, desc: &'static StructDesc) -> TypeId {
        if let Some(Item::Ready(ty)) = self.library_names.get(&key(desc.name)) {
            return *ty;
        }
        let ty = self.native_struct(desc.name, desc.fields, StructKind::Struct, desc.size, desc.align, desc.init);
        self.add_native(desc.name, Item::Ready(ty));
        ty
    }

    fn native_struct(
        &mut self,
        name: &str,
        fields: &[FieldDesc],
        kind: StructKind,
        size: usize,
        align: usize,
        init: fn(&mut [u8]),
    ) -> TypeId {
        let fields = fields.iter().map(|f| Field {
            name: f.name.into(),
            ty: self.native_type(&f.ty),
            offset: f.offset as u32,
            section: if kind == StructKind::Struct { Section::State } else { f.section },
            doc: f.doc.trim().into(),
        });
        let fields = fields.collect();
        let ty =
            self.types.push(Type::Struct(Arc::new(Structure { name: name.into(), kind, fields, size: size as u32, align: align as u32 })));
        let mut bytes = vec![0; size];
        init(&mut bytes);
        if let Some(last) = bytes.iter().rposition(|b| *b != 0) {
            bytes.truncate(last + 1);
            self.type_init.insert(ty, Rc::new(bytes));
        }
        ty
    }
}
