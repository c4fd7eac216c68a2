//! Bodies: parameters, local variables, statements.

use crate::expression::{Kind, Lowering};
use crate::initial::Target;
use crate::place::{Place, mem};
use crate::scope::{PouKind, Storage, Variable, key};
use crate::unit::Compiler;
use rustc_hash::FxHashSet as HashSet;
use takt_ir::{Base, Body, BodyId, Inst, Local, Ty, Type, TypeId};
use takt_syntax::tree::{ArgKind, Expr, ExprKind, Stmt, StmtKind, VarKind};
use takt_syntax::{Code, FileId, Source, Span};

/// Bytes that a variable has at the most that each call makes anew.
const LARGEST_IN_FRAME: u32 = 64 << 20;

/// How a variable of a function is passed, in the order of the IR's parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Passing {
    /// A local of this type.
    Value(Ty),
    /// An address of so many bytes.
    Address(u32),
    /// `ARRAY[*]`: pointer, then low and high per dimension.
    Open(u32),
}

impl Passing {
    /// Types of the locals that it takes.
    pub(crate) fn locals(&self) -> Vec<Ty> {
        match self {
            Self::Value(ty) => vec![*ty],
            Self::Address(size) => vec![Ty::Addr(*size)],
            Self::Open(dims) => vec![Ty::I64; 1 + 2 * *dims as usize],
        }
    }
}

impl<'a> Compiler<'a> {
    /// The class of local that a scalar type takes; `None` for what lies in memory only.
    pub(crate) fn register(&self, ty: TypeId) -> Option<Ty> {
        match self.types.get(ty) {
            Type::Elem(e) | Type::Subrange { base: e, .. } => Some(mem(*e).ty()),
            Type::Enum(_) | Type::Pointer(_) | Type::Reference(_) | Type::Interface(_) | Type::Error => Some(Ty::I64),
            _ => None,
        }
    }

    /// How a variable of a function is passed; `None` for what is not a parameter.
    pub(crate) fn passing(&self, v: &Variable<'a>) -> Option<Passing> {
        match (v.kind, self.types.get(v.ty)) {
            (VarKind::InOut, Type::OpenArray { dims, .. }) => Some(Passing::Open(*dims)),
            (VarKind::InOut | VarKind::Output, _) => Some(Passing::Address(self.types.size(v.ty))),
            (VarKind::Input, _) => Some(match self.register(v.ty) {
                Some(ty) => Passing::Value(ty),
                None => Passing::Address(self.types.size(v.ty)),
            }),
            _ => None,
        }
    }

    pub(crate) fn lower_body(&mut self, id: BodyId, pou: usize) -> Body {
        let (tree, name) = (self.pous[pou].tree, self.pou_name(pou));
        let mut lowering = Lowering::new(self, id, &name, Some(pou), tree.name.span);
        lowering.open_unit(tree.body);
        lowering.statements(tree.body);
        lowering.check_labels();
        lowering.return_();
        let variables = lowering.variables(pou);
        let body = lowering.finish();
        self.program.variables.insert(id, variables);
        body
    }

    /// A BOOL expression in global scope.
    pub(crate) fn lower_condition(&mut self, file: FileId, source: &'a Source) -> BodyId {
        let span = Span { file, start: 0, end: source.text.len() as u32 };
        let (tree, found) = takt_syntax::parse_expression(file, &source.text);
        let failed = !found.is_empty();
        self.diagnostics.extend(found);
        let id = self.reserve(&source.name, span);
        if failed {
            return id;
        }
        // Conditions are few and live as long as the program.
        let tree: &'a Expr = Box::leak(Box::new(tree));
        let mut lowering = Lowering::new(self, id, &source.name, None, span);
        lowering.b.result = Some(Ty::I64);
        let operand = lowering.expr(tree);
        let operand = lowering.condition_operand(operand);
        let value = lowering.value(&operand);
        lowering.b.end(takt_ir::Term::Return(Some(value)));
        let body = lowering.finish();
        self.program.bodies[id.0 as usize] = body;
        id
    }
}

impl<'a> Lowering<'_, 'a> {
    /// Parameters, result and local variables of the unit.
    fn open_unit(&mut self, statements: &'a [Stmt]) {
        let Some(pou) = self.pou else { return };
        self.open_instance();
        match self.c.pous[pou].tree.kind {
            PouKind::Function | PouKind::Method => self.open_function(pou, statements),
            PouKind::FunctionBlock | PouKind::Program => {
                self.open_in_outs(pou);
                self.open_locals(0, statements);
            }
            // An action has the temporary variables of its block anew.
            PouKind::Action => self.open_locals(1, statements),
        }
    }

    /// Where the variables of a call are, for people who look at a fault.
    fn variables(&mut self, pou: usize) -> takt_ir::Variables {
        use takt_ir::Home;
        let home = |storage: &Storage| match storage {
            Storage::Frame(offset) => Some(Home::Frame(*offset)),
            Storage::Register(local) => Some(Home::Local(*local)),
            Storage::Behind(local) => Some(Home::Behind(*local)),
            _ => None,
        };
        let storage = self.own_storage().clone();
        let vars = self.c.pous[pou].vars.iter().zip(&storage);
        let mut list: Vec<_> = vars.filter_map(|(v, storage)| Some((v.name.clone(), v.ty, home(storage)?))).collect();
        if let Some((ty, storage)) = &self.result {
            list.extend(home(storage).map(|home| (self.c.pous[pou].tree.name.text.clone(), *ty, home)));
        }
        takt_ir::Variables { instance: self.this.is_some(), list }
    }

    /// The instance that a body of a block runs on.
    pub(crate) fn open_instance(&mut self) {
        let Some(class) = self.block().filter(|c| self.c.pous[*c].tree.kind == PouKind::FunctionBlock) else { return };
        let ty = self.c.pou_type(class);
        let size = self.c.types.size(ty);
        self.this = Some(self.b.param(Ty::Addr(size)));
    }

    fn open_function(&mut self, pou: usize, statements: &'a [Stmt]) {
        let vars = self.c.pous[pou].vars.clone();
        let taken = self.taken(statements);
        let mut copies = Vec::new();
        for (i, v) in vars.iter().enumerate() {
            let Some(passing) = self.c.passing(v) else { continue };
            let storage = match passing {
                Passing::Value(ty) => {
                    let param = self.b.param(ty);
                    if taken.contains(&key(&v.name)) {
                        copies.push((i, param));
                    }
                    Storage::Register(param)
                }
                Passing::Address(size) => {
                    let param = self.b.param(Ty::Addr(size));
                    if v.kind == VarKind::Input {
                        copies.push((i, param));
                    }
                    Storage::Behind(param)
                }
                Passing::Open(dims) => {
                    let pointer = self.b.param(Ty::I64);
                    let bounds = (0..dims).map(|_| (self.b.param(Ty::I64), self.b.param(Ty::I64))).collect();
                    Storage::Open(pointer, bounds)
                }
            };
            self.own_storage()[i] = storage;
        }
        let result = self.c.pous[pou].result;
        let place = result.filter(|ty| self.c.register(*ty).is_none()).map(|ty| self.b.param(Ty::Addr(self.c.types.size(ty))));
        for (i, param) in copies {
            self.copy_parameter(&vars[i], i, param);
        }
        for (i, v) in vars.iter().enumerate().filter(|(_, v)| v.kind == VarKind::Output) {
            let storage = self.own_storage()[i].clone();
            self.initialise_variable(v, &storage);
        }
        self.open_result(pou, result, place, &taken);
        self.open_locals_with(0, &taken);
    }

    fn copy_parameter(&mut self, v: &Variable<'a>, i: usize, param: Local) {
        let (size, align) = self.c.types.layout(v.ty);
        let slot = self.b.slot(size, align);
        self.put_instances(v.ty, slot, 1);
        self.own_storage()[i] = Storage::Frame(slot);
        match self.b.ty(param) {
            Ty::Addr(_) => {
                self.b.push(Inst::Move { dst: Base::Frame, dst_offset: slot, src: Base::Local(param), src_offset: 0, len: size })
            }
            _ => self.store(&Place::Memory { base: Base::Frame, offset: slot }, v.ty, param, true, v.span),
        }
    }

    fn open_result(&mut self, pou: usize, result: Option<TypeId>, place: Option<Local>, taken: &HashSet<String>) {
        let Some(ty) = result else { return };
        let span = self.c.pous[pou].tree.name.span;
        let storage = match place {
            Some(address) => Storage::Behind(address),
            None => {
                let class = self.c.register(ty).unwrap_or(Ty::I64);
                self.b.result = Some(class);
                if taken.contains(&key(&self.c.pous[pou].tree.name.text)) {
                    let (size, align) = self.c.types.layout(ty);
                    Storage::Frame(self.b.slot(size, align))
                } else {
                    Storage::Register(self.b.local(class))
                }
            }
        };
        self.default_value(ty, &storage, span);
        self.result = Some((ty, storage));
    }

    /// VAR_IN_OUT of a block: the offsets in the instance become checked addresses.
    fn open_in_outs(&mut self, pou: usize) {
        for i in 0..self.c.pous[pou].vars.len() {
            let v = &self.c.pous[pou].vars[i];
            if v.kind != VarKind::InOut {
                continue;
            }
            let (ty, span) = (v.ty, v.span);
            let storage = self.storage_of(0, i);
            let opened = match self.follow_in_out(&storage, ty, span).kind {
                Kind::Place(Place::Memory { base: Base::Local(address), .. }) => Storage::Behind(address),
                Kind::Place(Place::Open { pointer, bounds }) => Storage::Open(pointer, bounds),
                _ => Storage::Nowhere,
            };
            self.own_storage()[i] = opened;
        }
    }

    fn open_locals(&mut self, level: usize, statements: &'a [Stmt]) {
        let taken = self.taken(statements);
        self.open_locals_with(level, &taken);
    }

    /// Variables that live for one call: in registers where nobody asks for their address.
    fn open_locals_with(&mut self, level: usize, taken: &HashSet<String>) {
        let pou = self.levels[level].pou;
        let function = matches!(self.c.pous[pou].tree.kind, PouKind::Function | PouKind::Method);
        for i in 0..self.c.pous[pou].vars.len() {
            let v = self.c.pous[pou].vars[i].clone();
            let kept = v.kind == VarKind::Inst && v.storage != Storage::Nowhere;
            let local = v.kind == VarKind::Temp || function && !kept && matches!(v.kind, VarKind::Var | VarKind::Inst);
            if !local || v.value.is_some() {
                continue;
            }
            let storage = match self.c.register(v.ty) {
                Some(class) if !taken.contains(&key(&v.name)) => Storage::Register(self.b.local(class)),
                _ => {
                    let (size, align) = self.c.types.layout(v.ty);
                    Storage::Frame(self.b.slot(size, align))
                }
            };
            self.level_storage(level)[i] = storage.clone();
            self.initialise_variable(&v, &storage);
        }
    }

    /// Gives a local variable its initial value.
    fn initialise_variable(&mut self, v: &Variable<'a>, storage: &Storage) {
        let pou = self.pou;
        if self.c.register(v.ty).is_some() {
            match v.init {
                Some(takt_syntax::tree::Init::Expr(e)) => {
                    let target = self.stored(storage, v.ty, v.span);
                    let Kind::Place(place) = target.kind else { return };
                    if let Type::Reference(_) = self.c.types.get(v.ty) {
                        if let Place::Register(local) = place {
                            self.bind_initial(local, e);
                        }
                        return;
                    }
                    let value = self.expr(e);
                    if !value.is_error() {
                        self.assign_place(&place, v.ty, value, v.span);
                    }
                }
                Some(_) => {
                    self.report(Code::BadInitializer, v.span, "a list cannot initialise a scalar");
                }
                None => self.default_value(v.ty, storage, v.span),
            }
            return;
        }
        let (mut bytes, mut late) = (Vec::new(), Vec::new());
        self.c.fill(v.decl, v.ty, 0, &mut Target { pou, bytes: &mut bytes, late: &mut late });
        let size = self.frame_bytes(v.ty, v.span);
        let operand = self.stored(storage, v.ty, v.span);
        let Kind::Place(Place::Memory { base, offset }) = operand.kind else { return };
        self.put_bytes(base, offset, &bytes, size);
        if base == Base::Frame {
            self.put_instances(v.ty, offset, 1);
        }
        for late in late {
            self.set_late(base, offset, late);
        }
    }

    /// Bytes of a variable that each call makes anew.
    fn frame_bytes(&mut self, ty: TypeId, span: Span) -> u32 {
        let size = self.c.types.size(ty);
        if size <= LARGEST_IN_FRAME {
            return size;
        }
        let help = "declare it in VAR_STAT, in a block or globally";
        self.report(Code::TooLarge, span, "a variable that each call makes anew takes more than 64 MiB").help = Some(help.into());
        0
    }

    /// Sets a variable to its first bytes, and the rest of its `size` to 0.
    fn put_bytes(&mut self, base: Base, offset: u32, bytes: &[u8], size: u32) {
        let bytes = &bytes[..bytes.len().min(size as usize)];
        let len = bytes.len() as u32;
        if len > 0 {
            let data = self.pool(bytes);
            self.b.push(Inst::Data { dst: base, offset, data, len });
        }
        if len < size {
            let data = self.zeros(size - len);
            self.b.push(Inst::Data { dst: base, offset: offset.saturating_add(len), data, len: size - len });
        }
    }

    /// The value a type gives its variables.
    fn default_value(&mut self, ty: TypeId, storage: &Storage, span: Span) {
        let bytes = self.c.type_bytes(ty);
        let operand = self.stored(storage, ty, span);
        let Kind::Place(place) = operand.kind else { return };
        match (self.c.register(ty), &place) {
            (Some(class), _) => {
                let value = match class {
                    Ty::F32 => takt_ir::Const::F32(0),
                    Ty::F64 => takt_ir::Const::F64(0),
                    _ => {
                        let value = i128::from(bytes.map_or(0, |b| signed(&b)));
                        takt_ir::Const::I64(self.scalar(ty).map_or(value, |e| crate::constant::cut(value, e)) as i64)
                    }
                };
                let value = self.b.constant(value);
                self.store(&place, ty, value, true, span);
            }
            (None, Place::Memory { base, offset }) => {
                let size = self.frame_bytes(ty, span);
                self.put_bytes(*base, *offset, bytes.as_ref().map_or(&[], |b| b), size);
            }
            _ => {}
        }
    }

    /// Names of variables whose address is asked for: by ADR, REF=, or as a VAR_IN_OUT.
    fn taken(&self, statements: &'a [Stmt]) -> HashSet<String> {
        let mut taken = HashSet::default();
        for v in self.levels.iter().take(2).flat_map(|l| &self.c.pous[l.pou].vars) {
            if let Some(takt_syntax::tree::Init::Expr(e)) = v.init {
                if let Type::Reference(_) = self.c.types.get(v.ty) {
                    take_name(e, &mut taken);
                }
                self.taken_expr(e, &mut taken);
            }
        }
        for s in statements {
            self.taken_statement(s, &mut taken);
        }
        taken
    }

    fn taken_statement(&self, s: &'a Stmt, taken: &mut HashSet<String>) {
        let all = |list: &'a [Stmt], taken: &mut HashSet<String>| list.iter().for_each(|s| self.taken_statement(s, taken));
        match &s.kind {
            StmtKind::Assign { targets, value } => {
                if targets.iter().any(|(_, op)| *op == takt_syntax::tree::AssignOp::Ref) {
                    take_name(value, taken);
                }
                targets.iter().for_each(|(t, _)| self.taken_expr(t, taken));
                self.taken_expr(value, taken);
            }
            StmtKind::Expr(e) => self.taken_expr(e, taken),
            StmtKind::If { arms, otherwise } => {
                for (cond, body) in arms {
                    self.taken_expr(cond, taken);
                    all(body, taken);
                }
                all(otherwise.as_deref().unwrap_or_default(), taken);
            }
            StmtKind::Case { value, arms, otherwise } => {
                self.taken_expr(value, taken);
                arms.iter().for_each(|(_, body)| all(body, taken));
                all(otherwise.as_deref().unwrap_or_default(), taken);
            }
            StmtKind::For { from, to, by, body, .. } => {
                [Some(&**from), Some(&**to), by.as_ref()].into_iter().flatten().for_each(|e| self.taken_expr(e, taken));
                all(body, taken);
            }
            StmtKind::While { cond, body } | StmtKind::Repeat { body, until: cond } => {
                self.taken_expr(cond, taken);
                all(body, taken);
            }
            StmtKind::Try { body, catch, finally } => {
                all(body, taken);
                all(catch.as_ref().map(|c| c.1.as_slice()).unwrap_or_default(), taken);
                all(finally.as_deref().unwrap_or_default(), taken);
            }
            _ => {}
        }
    }

    fn taken_expr(&self, e: &'a Expr, taken: &mut HashSet<String>) {
        match &e.kind {
            ExprKind::Member(a, _) | ExprKind::Part(a, _) | ExprKind::Deref(a) | ExprKind::Unary(_, a) => self.taken_expr(a, taken),
            ExprKind::Index(a, indices) => {
                self.taken_expr(a, taken);
                indices.iter().for_each(|i| self.taken_expr(i, taken));
            }
            ExprKind::Binary(_, a, b) | ExprKind::Assign(a, b) => {
                self.taken_expr(a, taken);
                self.taken_expr(b, taken);
            }
            ExprKind::Chain(first, links) => {
                self.taken_expr(first, taken);
                links.iter().for_each(|link| self.taken_expr(&link.right, taken));
            }
            ExprKind::Call(callee, args) => {
                self.taken_expr(callee, taken);
                let by_reference = self.takes_addresses(callee);
                for arg in args {
                    if by_reference
                        && arg.kind == ArgKind::In
                        && let Some(value) = &arg.value
                    {
                        take_name(value, taken);
                    }
                    arg.value.iter().for_each(|v| self.taken_expr(v, taken));
                }
            }
            _ => {}
        }
    }

    /// Whether a call may ask for the address of an argument. Unknown callees may.
    fn takes_addresses(&self, callee: &Expr) -> bool {
        let ExprKind::Name(name) = &callee.kind else { return true };
        let local = self.local(&key(name)).is_some() || self.block().is_some();
        match self.c.global_name(name) {
            _ if local => true,
            Some(crate::scope::Item::Pou(i)) => self.c.pous[i].tree.vars.iter().any(|b| {
                b.kind == VarKind::InOut || b.vars.iter().any(|v| matches!(v.ty.kind, takt_syntax::tree::TypeExprKind::Reference(_)))
            }),
            Some(crate::scope::Item::NativeFunction(_)) => false,
            Some(_) => true,
            None => matches!(key(name).as_str(), "ADR" | "BITADR" | "REF" | "LOWER_BOUND" | "UPPER_BOUND"),
        }
    }
}

fn take_name(e: &Expr, taken: &mut HashSet<String>) {
    if let ExprKind::Name(name) = &e.kind {
        taken.insert(key(name));
    }
}

/// Little-endian bytes as a number, sign-extended (an enumeration's or subrange's initial value).
fn signed(bytes: &[u8]) -> i64 {
    let mut word = [0; 8];
    let n = bytes.len().min(8);
    word[..n].copy_from_slice(&bytes[..n]);
    let shift = 64 - 8 * n as u32;
    if shift >= 64 { 0 } else { i64::from_le_bytes(word) << shift >> shift }
}
