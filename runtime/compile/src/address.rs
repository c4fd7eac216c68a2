//! Variables and expressions at direct addresses: `x AT %QX0.3 : BOOL`, `%IW4`.
//!
//! The areas of inputs, outputs and memory lie in the image, as long as the highest address in use. A variable at an address is not part of the instance of
//! its block or program; a BOOL at the address of a bit is that bit. What stands at a placeholder (`AT %I*`) is an ordinary variable; see [`mapping`].

mod mapping;
mod overlap;

pub(crate) use mapping::indices;

use crate::constant::Value;
use crate::expression::{Kind, Lowering, Operand, Thing};
use crate::place::Place;
use crate::scope::{PouKind, Storage, Variable};
use crate::unit::Compiler;
use rustc_hash::FxHashMap as HashMap;
use takt_abi::Elem;
use takt_ir::{Address, Area, Base, Global, Type, TypeId};
use takt_syntax::tree::{Direct, Expr, VarDecl, VarKind};
use takt_syntax::{Code, Span};

/// Alignment of an area.
const ALIGN: u32 = 16;

/// What is known of direct addresses.
#[derive(Debug, Default)]
pub(crate) struct Addresses<'a> {
    /// Entries of VAR_CONFIG.
    pub(crate) configured: Vec<&'a VarDecl>,
    /// Where variables lie that have an address, by the places of their names.
    fixed: HashMap<Span, Address>,
    /// Members `AT %I*` of blocks, programs and structures.
    waiting: HashMap<TypeId, Vec<mapping::Waiting>>,
    /// Global variables `AT %I*`, by number.
    waiting_globals: Vec<(usize, mapping::Waiting)>,
    /// Entries of VAR_CONFIG with type and address.
    entries: Vec<(&'a VarDecl, TypeId, Address)>,
    /// The areas lie in the image.
    ready: bool,
}

/// What a variable is declared in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Section {
    /// VAR_GLOBAL.
    Global(usize),
    /// A unit with its type, if it has instances.
    Unit(VarKind, Option<TypeId>),
    /// STRUCT or UNION.
    Structure(TypeId),
}

impl<'a> Compiler<'a> {
    /// Checks and notes where a variable is declared to lie.
    pub(crate) fn note_address(&mut self, decl: &VarDecl, ty: TypeId, constant: bool, section: Section) {
        let Some(at) = &decl.at else { return };
        if let Some(area) = takt_ir::placeholder(&at.text) {
            return self.note_placeholder(decl, area, section);
        }
        let help = match section {
            _ if constant => Some("a constant has no address: declare it without AT"),
            Section::Global(_) | Section::Unit(VarKind::Var | VarKind::Stat, Some(_)) => None,
            Section::Structure(_) => Some("declare a variable of the type AT an address"),
            Section::Unit(..) => Some("declare it in VAR_GLOBAL, or in VAR of a PROGRAM or FUNCTION_BLOCK"),
        };
        if let Some(help) = help {
            self.report(Code::BadAddress, at.span, "a variable that is declared here cannot lie at an address").help = Some(help.into());
            return;
        }
        let Some(address) = self.address(at) else { return };
        if self.goes_with(address, ty, at) {
            self.addresses.fixed.insert(decl.name.span, address);
        }
    }

    /// Where a variable lies that is declared at an address.
    pub(crate) fn fixed_address(&self, decl: &VarDecl) -> Option<Address> {
        self.addresses.fixed.get(&decl.name.span).copied()
    }

    /// What an address means; reports what is none.
    fn address(&mut self, at: &Direct) -> Option<Address> {
        let word = !self.options.byte_addresses;
        match takt_ir::parse_address(&at.text, word) {
            Ok(address) => Some(address),
            Err(error) => {
                let hint = match error {
                    takt_ir::AddressError::Bit { .. } if !word => Some("`addressing = \"byte\"` of takt.toml counts bits in bytes"),
                    _ => None,
                };
                self.report(Code::BadAddress, at.span, format!("`{}` is not an address: {error}", at.text)).help = hint.map(Into::into);
                None
            }
        }
    }

    /// Whether variables of a type may lie at an address; reports those that may not.
    fn goes_with(&mut self, address: Address, ty: TypeId, at: &Direct) -> bool {
        let name = self.types.name(ty);
        let (message, help) = match self.types.get(ty) {
            Type::Error => return false,
            Type::Elem(Elem::Bool) => return true,
            _ if address.bit.is_some() => (
                format!("`{}` is a bit, expected `BOOL`, found `{name}`", at.text),
                format!("name its first byte: `%{}B{}`", address.area.letter(), address.byte),
            ),
            _ if self.has_instances(ty) => {
                let help = "declare the inputs and outputs of the block at addresses, inside of it or beside it";
                (format!("`{name}` has or is a block and cannot lie at an address"), help.into())
            }
            _ if u64::from(address.byte) + u64::from(self.types.size(ty)) > takt_ir::LARGEST_AREA.into() => {
                (format!("`{name}` does not fit: an area has at the most {} bytes", takt_ir::LARGEST_AREA), String::new())
            }
            _ => return true,
        };
        self.report(Code::BadAddress, at.span, message).help = Some(help).filter(|help| !help.is_empty());
        false
    }

    fn has_instances(&self, ty: TypeId) -> bool {
        match self.types.get(ty) {
            Type::Array { elem, .. } => self.has_instances(*elem),
            Type::Struct(s) => {
                s.kind != takt_ir::StructKind::Union && s.kind != takt_ir::StructKind::Struct
                    || s.fields.iter().any(|field| self.has_instances(field.ty))
            }
            _ => false,
        }
    }

    /// Gives the areas their places in the image and variables at addresses theirs.
    pub(crate) fn lay_out_areas(&mut self) {
        let fixed = self.fixed_variables();
        self.read_entries();
        let mut ends = [0u32; 3];
        let mut reach = |address: Address, size: u32| {
            let end = &mut ends[address.area as usize];
            *end = (*end).max((address.byte + size).min(takt_ir::LARGEST_AREA));
        };
        for (address, size) in self.mentioned() {
            reach(address, size);
        }
        for (var, _) in &fixed {
            if let Some(address) = self.fixed_address(var.decl) {
                reach(address, if address.bit.is_some() { 1 } else { self.types.size(var.ty) });
            }
        }
        for (_, ty, address) in &self.addresses.entries {
            reach(*address, if address.bit.is_some() { 1 } else { self.types.size(*ty) });
        }
        self.program.areas.word = !self.options.byte_addresses;
        for (i, len) in ends.into_iter().enumerate().filter(|(_, len)| *len > 0) {
            let start = self.take(len, ALIGN, Span { file: takt_syntax::FileId(0), start: 0, end: 0 });
            self.program.areas.ranges[i] = (start, len);
        }
        if ends != [0; 3] {
            // What tools read and write at addresses has one of these types.
            let bits = (0..8).map(Type::Bit);
            let units = [Elem::Byte, Elem::Word, Elem::Dword, Elem::Lword].map(Type::Elem);
            for ty in bits.chain(units) {
                self.types.intern(ty);
            }
        }
        self.addresses.ready = true;
        self.warn_of_overlaps(&fixed);
        for (var, owner) in fixed {
            self.lay_out_fixed(&var, owner);
        }
    }

    /// Variables at addresses and what they belong to.
    fn fixed_variables(&self) -> Vec<(Variable<'a>, Owner)> {
        let globals = self.globals.iter().enumerate().filter_map(|(i, g)| Some((g.var.clone()?, Owner::Global(i))));
        let units = self.pous.iter().enumerate();
        let vars = units.flat_map(|(pou, unit)| unit.vars.iter().enumerate().map(move |(i, var)| (var.clone(), Owner::Unit(pou, i))));
        globals.chain(vars).filter(|(var, _)| self.addresses.fixed.contains_key(&var.decl.name.span)).collect()
    }

    /// The addresses in expressions, in conditions and in the wiring of the project.
    fn mentioned(&self) -> Vec<(Address, u32)> {
        let word = !self.options.byte_addresses;
        let directs = self.trees.iter().flat_map(|tree| &tree.addresses).map(|direct| direct.text.as_str());
        let texts = self.options.conditions.iter().map(|source| source.text.as_ref());
        let texts = texts.chain(self.options.wired.iter().map(String::as_str));
        let inside = texts.flat_map(|text: &str| text.match_indices('%').map(|(at, _)| address_at(&text[at..])));
        directs.chain(inside).filter_map(|text| takt_ir::parse_address(text, word).ok()).map(|a| (a, a.size)).collect()
    }

    fn lay_out_fixed(&mut self, var: &Variable<'a>, owner: Owner) {
        let Some(address) = self.fixed_address(var.decl) else { return };
        let Some(offset) = self.program.areas.offset(Address { size: 1, ..address }) else { return };
        let (storage, ty) = match address.bit {
            Some(bit) => (Storage::Bit(offset, bit), self.types.intern(Type::Bit(bit))),
            None => (Storage::Image(offset), var.ty),
        };
        match owner {
            Owner::Global(i) => {
                if let Some(var) = &mut self.globals[i].var {
                    var.storage = storage;
                }
                self.home = self.globals[i].home;
                self.push_global(i, ty, offset);
            }
            Owner::Unit(pou, i) => {
                self.pous[pou].vars[i].storage = storage;
                let (name, doc) = (format!("{}.{}", self.pou_name(pou), var.name), var.decl.doc.clone().unwrap_or_default());
                self.program.globals.push(Global { name, bare: false, ty, offset, constant: false, doc });
            }
        }
    }

    /// Gives a variable its initial value if it lies at an address; false if it does not.
    pub(crate) fn fill_fixed(&mut self, var: &Variable<'a>, unit: Option<usize>) -> bool {
        match (self.fixed_address(var.decl), &var.storage) {
            (Some(_), Storage::Image(offset)) => self.fill_variable(var, *offset, unit),
            (Some(_), Storage::Bit(offset, bit)) => {
                let ty = self.types.intern(Type::Bit(*bit));
                self.fill_variable(&Variable { ty, ..var.clone() }, *offset, unit);
            }
            (Some(_), _) => {}
            (None, _) => return false,
        }
        true
    }
}

/// What a variable at an address belongs to.
#[derive(Debug, Clone, Copy)]
enum Owner {
    Global(usize),
    Unit(usize, usize),
}

/// The address at the start of a text.
fn address_at(text: &str) -> &str {
    let rest = text.get(1..).unwrap_or_default();
    let len = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '.').unwrap_or(rest.len());
    text[..1 + len].trim_end_matches('.')
}

impl<'a> Lowering<'_, 'a> {
    /// What lies at a direct address.
    pub(crate) fn direct(&mut self, direct: &Direct) -> Thing {
        if takt_ir::placeholder(&direct.text).is_some() {
            self.report(Code::BadAddress, direct.span, format!("`{}` leaves the address open", direct.text)).help =
                Some("in an expression an address is complete: `%IX0.0`".into());
            return Thing::Error;
        }
        let Some(address) = self.c.address(direct) else { return Thing::Error };
        let offset = if self.c.addresses.ready { self.c.program.areas.offset(address) } else { Some(takt_ir::NULL_ZONE) };
        let Some(offset) = offset else {
            self.report(Code::BadAddress, direct.span, format!("the program has nothing at `{}`", direct.text));
            return Thing::Error;
        };
        let ty = self.c.types.intern(address.ty());
        let (place, ty) = self.bit_place(Place::Memory { base: Base::Image, offset }, ty);
        let mut operand = self.at(place, ty, direct.span);
        if address.area == Area::Input {
            operand.fixed = Some("an input");
        }
        Thing::Value(operand)
    }

    /// The bit of a byte that a place of type [`Type::Bit`] is, as BOOL; other places as they are.
    pub(crate) fn bit_place(&mut self, place: Place, ty: TypeId) -> (Place, TypeId) {
        let Type::Bit(bit) = *self.c.types.get(ty) else { return (place, ty) };
        let byte = self.c.elem(Elem::Byte);
        let bits = Place::Bits { whole: Box::new(place), ty: byte, shift: bit.into(), width: 1 };
        (bits, self.bool_type())
    }

    /// A variable of a program or block that lies at an address, seen from outside.
    pub(crate) fn fixed_member(&mut self, unit: usize, wanted: &str, span: Span) -> Option<Operand> {
        let var = self.c.bases(unit).find_map(|b| self.c.pous[b].index.get(wanted).map(|i| &self.c.pous[b].vars[*i]))?;
        self.c.fixed_address(var.decl)?;
        let (storage, ty) = (var.storage.clone(), var.ty);
        let inside = self.block().is_some_and(|block| self.c.is_a(block, crate::scope::Owner::Pou(unit)));
        if self.c.pous[unit].tree.kind != PouKind::Program && !inside {
            self.report(Code::NotAccessible, span, "a VAR of a block cannot be used from outside").help =
                Some("name its address, or declare it in VAR_GLOBAL".into());
            return Some(self.error(span));
        }
        Some(self.stored(&storage, ty, span))
    }

    /// `BITADR(x)`: the number of the first bit in its area; the highest hexadecimal digit tells the area (4 memory, 8 inputs, C outputs).
    pub(crate) fn bit_address(&mut self, args: &'a [takt_syntax::tree::Arg], span: Span) -> Operand {
        let [takt_syntax::tree::Arg { value: Some(value), .. }] = args else {
            self.check_arguments(args);
            self.report(Code::BadArgument, span, "`BITADR` takes one variable");
            return self.error(span);
        };
        let operand = self.expr(value);
        if operand.is_error() {
            return operand;
        }
        let ty = self.c.elem(Elem::Dword);
        if !self.c.addresses.ready {
            let later = self.b.int(0);
            return self.exact(later, ty, span);
        }
        let bit = match &operand.kind {
            Kind::Place(place) => bit_of(place),
            _ => None,
        };
        match bit.and_then(|bit| self.area_bit(bit)) {
            Some(word) => self.constant(Value::Int(word.into()), ty, span),
            None => {
                self.no_bit_address(value, span);
                self.error(span)
            }
        }
    }

    fn no_bit_address(&mut self, value: &Expr, span: Span) {
        let message = "`BITADR` needs a variable at an address whose place is known before the program runs";
        let diagnostic = self.report(Code::BadArgument, if value.span.end > value.span.start { value.span } else { span }, message);
        diagnostic.help = Some("declare it AT an address: `x AT %MX0.0 : BOOL;`".into());
    }

    fn area_bit(&self, bit: u64) -> Option<u32> {
        let areas = Area::ALL.into_iter().zip(self.c.program.areas.ranges);
        areas.into_iter().find_map(|(area, (start, len))| {
            let inside = bit.checked_sub(u64::from(start) * 8).filter(|inside| *inside < u64::from(len) * 8)?;
            let segment: u32 = match area {
                Area::Memory => 0x4000_0000,
                Area::Input => 0x8000_0000,
                Area::Output => 0xC000_0000,
            };
            Some(segment + inside as u32)
        })
    }
}

/// The number of a place's first bit in the image, if it is known.
fn bit_of(place: &Place) -> Option<u64> {
    match place {
        Place::Memory { base: Base::Image, offset } => Some(u64::from(*offset) * 8),
        Place::Bits { whole, shift, .. } => Some(bit_of(whole)? + u64::from(*shift)),
        _ => None,
    }
}
