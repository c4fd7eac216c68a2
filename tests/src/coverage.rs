//! What generated programs have reached, as a table with a column per executor.
//!
//! [`marked`] gives every block of a program a byte behind its memory that is set at the block's end. After a run the bytes tell which blocks ran to
//! their end in that executor, and so which instructions were executed: a faulting one was not, its fault is counted by itself.

use std::collections::BTreeMap;
use takt_abi::Fault;
use takt_ir::{Base, Body, Const, Inst, Local, Mem, Op, Program, Term, Ty, ops};

/// Times a row was reached: by the interpreter, by machine code.
pub type Counts = [u64; 2];

/// Rows by name.
#[derive(Debug, Clone, Default)]
pub struct Table(BTreeMap<String, Counts>);

impl Table {
    /// Counts a row for an executor (0: interpreter, 1: machine code).
    pub fn add(&mut self, row: String, executor: usize) {
        self.0.entry(row).or_default()[executor] += 1;
    }
    /// Adds another table.
    pub fn merge(&mut self, other: Self) {
        for (row, counts) in other.0 {
            let sum = self.0.entry(row).or_default();
            sum[0] += counts[0];
            sum[1] += counts[1];
        }
    }
    /// Counts a fault.
    pub fn fault(&mut self, fault: Option<Fault>, executor: usize) {
        self.add(format!("fault {}", fault.map_or("none", Fault::name)), executor);
    }
    /// Counts what the marked blocks of an image say.
    pub fn run(&mut self, marked: &Marked, image: &[u8], executor: usize) {
        for (i, rows) in marked.rows.iter().enumerate() {
            if image[marked.first as usize + i] != 0 {
                for row in rows {
                    self.add(row.clone(), executor);
                }
            }
        }
    }
    /// The rows of [`expected`] that an executor has never reached.
    pub fn missing(&self) -> Vec<String> {
        let zero = |row: &String| self.0.get(row).is_none_or(|counts| counts.contains(&0));
        expected().into_iter().filter(zero).collect()
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{:32} {:>12} {:>12}", "reached", "interpreter", "machine")?;
        for (row, [a, b]) in &self.0 {
            writeln!(f, "{row:32} {a:>12} {b:>12}")?;
        }
        Ok(())
    }
}

/// A program whose blocks leave marks.
#[derive(Debug)]
pub struct Marked {
    /// The program.
    pub program: Program,
    /// Offset of the first mark.
    pub first: u32,
    /// What each block executes, in the order of the marks.
    pub rows: Vec<Vec<String>>,
}

/// Gives each block a mark at its end.
pub fn marked(program: &Program) -> Marked {
    let mut program = program.clone();
    let first = program.image_size;
    let mut rows = Vec::new();
    for body in &mut program.bodies {
        let one = Local(body.locals.len() as u32);
        body.locals.push(Ty::I64);
        let found: Vec<_> = body.blocks.iter().map(|block| rows_of(body, &block.insts, &block.term)).collect();
        for (block, found) in body.blocks.iter_mut().zip(found) {
            block.insts.push(Inst::Const { dst: one, value: Const::I64(1) });
            block.insts.push(Inst::Store { src: one, mem: Mem::U8, base: Base::Image, offset: first + rows.len() as u32 });
            rows.push(found);
        }
    }
    program.image_size = (first + rows.len() as u32).next_multiple_of(16);
    Marked { program, first, rows }
}

fn base(base: Base) -> &'static str {
    match base {
        Base::Image => "image",
        Base::Frame => "frame",
        Base::Local(_) => "address",
    }
}

fn class(ty: Ty) -> &'static str {
    match ty {
        Ty::I64 => "i64",
        Ty::F32 => "f32",
        Ty::F64 => "f64",
        Ty::Addr(_) => "address",
    }
}

/// The rows that straight code reaches.
fn rows_of(body: &Body, insts: &[Inst], term: &Term) -> Vec<String> {
    let result = |dst: &Option<Local>| dst.map_or("nothing", |l| class(body.locals[l.0 as usize]));
    // Operands that come straight from memory tell the operator's type in the program.
    let mut lies: BTreeMap<Local, Mem> = BTreeMap::new();
    let mut rows = Vec::new();
    for inst in insts {
        let row = match inst {
            Inst::Const { value: Const::I64(_), .. } => "const i64".into(),
            Inst::Const { value: Const::F32(_), .. } => "const f32".into(),
            Inst::Const { value: Const::F64(_), .. } => "const f64".into(),
            Inst::Op { op, args, .. } => {
                if let Some(mem) = args.iter().find_map(|a| lies.get(a)).filter(|_| typed().contains(op)) {
                    rows.push(format!("op {} of {mem:?}", op.text()));
                }
                format!("op {}", op.text())
            }
            Inst::Copy { dst, .. } => format!("copy {}", class(body.locals[dst.0 as usize])),
            Inst::Load { dst, mem, base: b, .. } => {
                lies.insert(*dst, *mem);
                format!("load {mem:?} from {}", base(*b))
            }
            Inst::Store { mem, base: b, .. } => format!("store {mem:?} to {}", base(*b)),
            Inst::Address { base: b, .. } => format!("address of {}", base(*b)),
            Inst::Index { base: b, .. } => format!("index into {}", base(*b)),
            Inst::Check { .. } => "check".into(),
            Inst::Deref { .. } => "deref".into(),
            Inst::Pointer { base: b, .. } => format!("pointer to {}", base(*b)),
            Inst::Move { dst, src, .. } => format!("move {} to {}", base(*src), base(*dst)),
            Inst::Data { dst, .. } => format!("data to {}", base(*dst)),
            Inst::Call { dst, .. } => format!("call gives {}", result(dst)),
            Inst::Native { dst, .. } => format!("native gives {}", result(dst)),
            Inst::Poll { .. } => "poll".into(),
            Inst::Virtual { dst, .. } => format!("virtual call gives {}", result(dst)),
            Inst::IsA { .. } => "is a".into(),
            Inst::Place { .. } => "place".into(),
            Inst::Guard { .. } => "guard".into(),
            Inst::Catch { .. } => "catch".into(),
        };
        rows.push(row);
    }
    rows.push(match term {
        Term::Jump(_) => "jump".into(),
        Term::Branch { .. } => "branch".into(),
        Term::Switch { .. } => "switch".into(),
        Term::Return(None) => "return".into(),
        Term::Return(Some(l)) => format!("return {}", class(body.locals[l.0 as usize])),
        Term::Fault(..) => "fault term".into(),
        Term::Rethrow(_) => "rethrow".into(),
    });
    rows
}

/// Integer operators, whose type in the program is one of eight.
fn typed() -> &'static [Op] {
    &[
        Op::Add,
        Op::Sub,
        Op::Mul,
        Op::Neg,
        Op::Div,
        Op::Rem,
        Op::Abs,
        Op::Expt,
        Op::And,
        Op::Or,
        Op::Xor,
        Op::Not,
        Op::Shl,
        Op::Rol,
        Op::Ror,
        Op::Eq,
        Op::Ne,
        Op::Lt,
        Op::Le,
        Op::Gt,
        Op::Ge,
    ]
}

/// What no ST program reaches, and why.
pub const UNREACHABLE: &[(&str, &str)] = &[
    ("op rem.f32", "MOD takes no REAL"),
    ("op rem.f64", "MOD takes no LREAL"),
    ("op trunc.f32", "TRUNC gives an integer"),
    ("op trunc.f64", "TRUNC gives an integer"),
    ("native gives f32", "no function of the library gives a REAL: texts become LREAL first"),
];

/// All rows that must be reached.
pub fn expected() -> Vec<String> {
    const MEMS: [Mem; 10] = [Mem::Bool, Mem::I8, Mem::U8, Mem::I16, Mem::U16, Mem::I32, Mem::U32, Mem::I64, Mem::F32, Mem::F64];
    const BASES: [&str; 3] = ["image", "frame", "address"];
    let mut rows: Vec<String> = ops().iter().map(|op| format!("op {}", op.text())).collect();
    for mem in MEMS {
        for base in BASES {
            rows.push(format!("load {mem:?} from {base}"));
            rows.push(format!("store {mem:?} to {base}"));
        }
        if mem.ty() == Ty::I64 && mem != Mem::Bool {
            rows.extend(typed().iter().map(|op| format!("op {} of {mem:?}", op.text())));
        }
    }
    for from in BASES {
        rows.push(format!("index into {from}"));
        rows.push(format!("address of {from}"));
        rows.push(format!("pointer to {from}"));
        rows.push(format!("data to {from}"));
        rows.extend(BASES.iter().map(|to| format!("move {from} to {to}")));
    }
    for ty in ["i64", "f32", "f64"] {
        rows.extend(["const", "copy", "call gives", "native gives", "return"].map(|what| format!("{what} {ty}")));
    }
    rows.extend(
        ["call gives nothing", "native gives nothing", "return", "check", "deref", "poll", "jump", "branch", "switch"].map(String::from),
    );
    rows.extend(
        ["none", "index", "division-by-zero", "null-pointer", "wild-pointer", "stack-overflow", "watchdog", "no-instance", "wrong-delete"]
            .map(|f| format!("fault {f}")),
    );
    rows.extend(
        ["virtual call gives i64", "virtual call gives f64", "virtual call gives nothing", "is a", "guard", "catch"].map(String::from),
    );
    rows.retain(|row| UNREACHABLE.iter().all(|(name, _)| name != row));
    rows
}
