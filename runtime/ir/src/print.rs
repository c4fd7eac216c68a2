//! The text form of a program, written: what people read when they look at compiled code, and what [`crate::parse_program`] reads back.
//!
//! Everything of a program is there but the makers of resources, which stand as comments. The form, by example:
//!
//! ```text
//! image 256
//! file "main.st"
//! site 0 3 5 0                         ; file, line, column, body
//! data "00ff"                          ; constant bytes
//! init 64 at 16 "0100"                 ; number of initial bytes, and those that are not 0
//! native STR_ASSIGN
//! class "Axis" size 32                 ; numbered from 1
//! instances 1 at 64 count 2
//! method "I_Axis.Enable" (i64) -> i64 from 1 [3, none]
//! family "I_Axis" from 1 [1, 0]
//! heap 128 64
//! type INT                             ; numbered from 0
//! global "GVL.x" type 0 at 16 bare
//! area Q word at 32 size 2             ; direct addresses, counted in units
//! mapped Q type 1 at 16 to 32 bit 3    ; VAR_CONFIG: the variable, its address
//! retained "GVL.x" type 0 at 16 persistent ; or: retain
//! restart 8                            ; the switch of the start code
//! latched type 1 at 16 writers [0]     ; a copy per task
//! task "Main" cyclic 1000000 priority 0 entry 0 stack 128 64
//! start 0                              ; runs before the first scan
//! body "PLC_PRG" (i64, addr:8) -> i64 frame 32 recursive @0
//!   local i64, f64, addr:2             ; numbered behind the parameters
//! b0:
//!   v2 = const 5
//!   v3 = const.f64 1.5
//!   v2 = div v0, v2 @0
//!   v2 = load.i16 image+64
//!   store.f64 frame+8, v3
//!   v4 = address v1+6
//!   v4 = index image+64 [v2 in 0..9 by 2] @0
//!   check v2 in v0..v2 @0
//!   v4 = deref v2 @0
//!   v2 = pointer v4+0
//!   move image+64, frame+0, 16
//!   data image+64, 0, 2                ; to, first byte of the data, bytes
//!   v2 = call 0(v2, v1) @0
//!   native STR_ASSIGN(v2, v4) @0
//!   v2 = virtual 0 v2(v3, v4) @0       ; method, instance, parameters behind it
//!   v2 = isa v2 0                      ; is it of that family?
//!   place frame+16 class 1 count 2     ; instances in the frame
//!   v2 = guard
//!   v2 = catch v2
//!   poll 1 @0
//!   branch v2, b1, b2
//! b1 catch b2:                         ; a fault leads to b2
//!   switch v2 [1: b1, -5: b2] else b0
//! b2:
//!   return v2                          ; or: rethrow v2
//! ```

use crate::address::{Area, Areas, Mapped};
use crate::inst::{Base, Body, Const, Inst, Local, Mem, Term, Ty};
use crate::program::{Program, Trigger};
use crate::retain::{Latched, Retained};
use std::fmt::{self, Write};
use takt_abi::Fault;

pub(crate) mod types;

/// The program as text that [`crate::parse_program`] reads.
pub fn print_program(program: &Program) -> String {
    let mut out = String::new();
    let printer = Printer { program };
    printer.tables(&mut out).and_then(|()| printer.bodies(&mut out)).expect("writing to a String cannot fail");
    out
}

/// Bytes of a line of hexadecimal digits.
const LINE: usize = 32;

struct Printer<'a> {
    program: &'a Program,
}

impl Printer<'_> {
    fn tables(&self, out: &mut String) -> fmt::Result {
        let program = self.program;
        writeln!(out, "image {}", program.image_size)?;
        for file in &program.files {
            writeln!(out, "file {}", Quoted(file))?;
        }
        for site in &program.sites {
            writeln!(out, "site {} {} {} {}", site.file, site.line, site.column, site.body.0)?;
        }
        for line in program.data.chunks(LINE) {
            writeln!(out, "data {}", Hex(line))?;
        }
        if !program.init.is_empty() {
            writeln!(out, "init {}", program.init.len())?;
        }
        for (i, line) in program.init.chunks(LINE).enumerate() {
            if let Some(last) = line.iter().rposition(|b| *b != 0) {
                writeln!(out, "  at {} {}", i * LINE, Hex(&line[..=last]))?;
            }
        }
        for native in &program.natives {
            writeln!(out, "native {}", native.name)?;
        }
        self.classes(out)?;
        types::print(&program.types, out)?;
        for global in &program.globals {
            write!(out, "global {} type {} at {}", Quoted(&global.name), global.ty.0, global.offset)?;
            out.push_str(if global.bare { " bare" } else { "" });
            out.push_str(if global.constant { " constant" } else { "" });
            writeln!(out, "{}", Doc(&global.doc))?;
        }
        self.addresses(out)?;
        self.kept(out)?;
        for task in &program.tasks {
            write!(out, "task {} ", Quoted(&task.name))?;
            match task.trigger {
                Trigger::Cyclic(period) => write!(out, "cyclic {period}")?,
                Trigger::Event(offset, None) => write!(out, "event {offset}")?,
                Trigger::Event(offset, Some(bit)) => write!(out, "event {offset} bit {bit}")?,
                Trigger::Freewheeling => write!(out, "freewheeling")?,
            }
            write!(out, " priority {} entry {} stack {} {}", task.priority, task.entry.0, task.stack.0, task.stack.1)?;
            writeln!(out, "{}", if task.isolated { " isolated" } else { "" })?;
        }
        if let Some(body) = program.init_body {
            writeln!(out, "start {}", body.0)?;
        }
        program.resources.iter().try_for_each(|resource| writeln!(out, "; resource of the instance at {}", resource.offset))
    }

    fn classes(&self, out: &mut String) -> fmt::Result {
        let program = self.program;
        for class in &program.classes {
            writeln!(out, "class {} size {}", Quoted(&class.name), class.size)?;
        }
        for run in &program.instances {
            writeln!(out, "instances {} at {} count {}", run.class, run.offset, run.count)?;
        }
        for method in &program.dispatch {
            write!(out, "method {} ({})", Quoted(&method.name), List(&method.params))?;
            if let Some(ty) = method.result {
                write!(out, " -> {ty}")?;
            }
            let targets: Vec<String> = method.targets.iter().map(|t| t.map_or_else(|| "none".into(), |b| b.0.to_string())).collect();
            writeln!(out, " from {} [{}]", method.low, targets.join(", "))?;
        }
        for family in &program.families {
            let members: Vec<&str> = family.members.iter().map(|m| if *m { "1" } else { "0" }).collect();
            writeln!(out, "family {} from {} [{}]", Quoted(&family.name), family.low, members.join(", "))?;
        }
        if program.heap != (0, 0) {
            writeln!(out, "heap {} {}", program.heap.0, program.heap.1)?;
        }
        Ok(())
    }

    fn addresses(&self, out: &mut String) -> fmt::Result {
        let Areas { word, ranges } = self.program.areas;
        for (area, (start, len)) in Area::ALL.into_iter().zip(ranges).filter(|(_, (_, len))| *len > 0) {
            writeln!(out, "area {}{} at {start} size {len}", area.letter(), if word { " word" } else { "" })?;
        }
        for Mapped { area, ty, offset, address, bit } in &self.program.mapped {
            write!(out, "mapped {} type {} at {offset} to {address}", area.letter(), ty.0)?;
            bit.map_or(Ok(()), |bit| write!(out, " bit {bit}"))?;
            out.push('\n');
        }
        Ok(())
    }

    fn kept(&self, out: &mut String) -> fmt::Result {
        for Retained { path, ty, offset, kind } in &self.program.retained {
            writeln!(out, "retained {} type {} at {offset} {}", Quoted(path), ty.0, kind.text().to_lowercase())?;
        }
        if self.program.restart != 0 {
            writeln!(out, "restart {}", self.program.restart)?;
        }
        for Latched { ty, offset, writers } in &self.program.latched {
            let writers: Vec<String> = writers.iter().map(u32::to_string).collect();
            writeln!(out, "latched type {} at {offset} writers [{}]", ty.0, writers.join(", "))?;
        }
        Ok(())
    }

    fn bodies(&self, out: &mut String) -> fmt::Result {
        for (id, body) in self.program.bodies.iter().enumerate() {
            writeln!(out, "\n; {id}")?;
            self.body(body, out)?;
        }
        Ok(())
    }
    fn body(&self, body: &Body, out: &mut String) -> fmt::Result {
        let (params, locals) = body.locals.split_at((body.params as usize).min(body.locals.len()));
        write!(out, "body {} ({})", Quoted(&body.name), List(params))?;
        if let Some(ty) = body.result {
            write!(out, " -> {ty}")?;
        }
        if body.frame_size > 0 {
            write!(out, " frame {}", body.frame_size)?;
        }
        writeln!(out, "{} @{}", if body.recursive { " recursive" } else { "" }, body.entry_site.0)?;
        if !locals.is_empty() {
            writeln!(out, "  local {}", List(locals))?;
        }
        for (number, block) in body.blocks.iter().enumerate() {
            write!(out, "b{number}")?;
            if let Some(handler) = block.handler {
                write!(out, " catch b{}", handler.0)?;
            }
            writeln!(out, ":")?;
            for inst in &block.insts {
                self.inst(inst, out)?;
            }
            term(&block.term, out)?;
        }
        Ok(())
    }

    fn inst(&self, inst: &Inst, out: &mut String) -> fmt::Result {
        out.push_str("  ");
        match inst {
            Inst::Const { dst, value } => writeln!(out, "{dst} = {value}"),
            Inst::Op { op, dst, args, site } => writeln!(out, "{dst} = {} {} @{}", op.text(), List(args), site.0),
            Inst::Copy { dst, src } => writeln!(out, "{dst} = copy {src}"),
            Inst::Load { dst, mem, base, offset } => writeln!(out, "{dst} = load.{mem} {base}+{offset}"),
            Inst::Store { src, mem, base, offset } => writeln!(out, "store.{mem} {base}+{offset}, {src}"),
            Inst::Address { dst, base, offset } => writeln!(out, "{dst} = address {base}+{offset}"),
            Inst::Index { dst, base, offset, index, low, high, stride, site } => {
                writeln!(out, "{dst} = index {base}+{offset} [{index} in {low}..{high} by {stride}] @{}", site.0)
            }
            Inst::Check { index, low, high, site } => writeln!(out, "check {index} in {low}..{high} @{}", site.0),
            Inst::Deref { dst, pointer, site } => writeln!(out, "{dst} = deref {pointer} @{}", site.0),
            Inst::Pointer { dst, base, offset } => writeln!(out, "{dst} = pointer {base}+{offset}"),
            Inst::Move { dst, dst_offset, src, src_offset, len } => writeln!(out, "move {dst}+{dst_offset}, {src}+{src_offset}, {len}"),
            Inst::Data { dst, offset, data, len } => writeln!(out, "data {dst}+{offset}, {data}, {len}"),
            Inst::Call { body, args, dst, site } => {
                result(*dst, out)?;
                writeln!(out, "call {}({}) @{}", body.0, List(args), site.0)
            }
            Inst::Native { native, args, dst, site } => {
                result(*dst, out)?;
                let name = self.native_name(native.0 as usize);
                writeln!(out, "native {name}({}) @{}", List(args), site.0)
            }
            Inst::Virtual { method, this, args, dst, site } => {
                result(*dst, out)?;
                writeln!(out, "virtual {method} {this}({}) @{}", List(args), site.0)
            }
            Inst::IsA { dst, pointer, family } => writeln!(out, "{dst} = isa {pointer} {family}"),
            Inst::Place { offset, class, count } => writeln!(out, "place frame+{offset} class {class} count {count}"),
            Inst::Guard { dst } => writeln!(out, "{dst} = guard"),
            Inst::Catch { dst, depth } => writeln!(out, "{dst} = catch {depth}"),
            Inst::Poll { cost, site } => writeln!(out, "poll {cost} @{}", site.0),
        }
    }
    /// The name, or the number if the name is not enough.
    fn native_name(&self, number: usize) -> String {
        let natives = &self.program.natives;
        match natives.get(number) {
            Some(native) if natives.iter().filter(|n| n.name == native.name).count() == 1 => native.name.into(),
            _ => number.to_string(),
        }
    }
}

fn result(dst: Option<Local>, out: &mut String) -> fmt::Result {
    dst.map_or(Ok(()), |dst| write!(out, "{dst} = "))
}

fn term(term: &Term, out: &mut String) -> fmt::Result {
    out.push_str("  ");
    match term {
        Term::Jump(target) => writeln!(out, "jump b{}", target.0),
        Term::Branch { cond, then, other } => writeln!(out, "branch {cond}, b{}, b{}", then.0, other.0),
        Term::Switch { value, cases, default } => {
            let cases: Vec<String> = cases.iter().map(|(label, target)| format!("{label}: b{}", target.0)).collect();
            writeln!(out, "switch {value} [{}] else b{}", cases.join(", "), default.0)
        }
        Term::Return(Some(local)) => writeln!(out, "return {local}"),
        Term::Return(None) => writeln!(out, "return"),
        Term::Rethrow(code) => writeln!(out, "rethrow {code}"),
        Term::Fault(fault, site) => {
            let facts = match fault {
                Fault::Index { value, low, high } => format!(" {value} {low} {high}"),
                Fault::WildPointer { offset, size } => format!(" {offset} {size}"),
                Fault::StackOverflow { depth } => format!(" {depth}"),
                Fault::Block { error } => format!(" {error}"),
                Fault::NoInstance { offset } => format!(" {offset}"),
                Fault::Overruns { count } => format!(" {count}"),
                _ => String::new(),
            };
            writeln!(out, "fault {}{facts} @{}", fault.name(), site.0)
        }
    }
}

impl fmt::Display for Local {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "v{}", self.0)
    }
}
impl fmt::Display for Ty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::I64 => f.write_str("i64"),
            Self::F32 => f.write_str("f32"),
            Self::F64 => f.write_str("f64"),
            Self::Addr(extent) => write!(f, "addr:{extent}"),
        }
    }
}
impl fmt::Display for Mem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bool => "bool",
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        })
    }
}
impl fmt::Display for Base {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image => f.write_str("image"),
            Self::Frame => f.write_str("frame"),
            Self::Local(local) => local.fmt(f),
        }
    }
}
impl fmt::Display for Const {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::I64(value) => write!(f, "const {value}"),
            Self::F32(bits) if f32::from_bits(bits).is_finite() => write!(f, "const.f32 {:?}", f32::from_bits(bits)),
            Self::F32(bits) => write!(f, "const.f32 {bits:#x}"),
            Self::F64(bits) if f64::from_bits(bits).is_finite() => write!(f, "const.f64 {:?}", f64::from_bits(bits)),
            Self::F64(bits) => write!(f, "const.f64 {bits:#x}"),
        }
    }
}

/// Comma-separated.
struct List<'a, T>(&'a [T]);
impl<T: fmt::Display> fmt::Display for List<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, item) in self.0.iter().enumerate() {
            write!(f, "{}{item}", if i > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}

/// Hexadecimal digits in quotes.
struct Hex<'a>(&'a [u8]);
impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_char('"')?;
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))?;
        f.write_char('"')
    }
}

/// Text in quotes; `\"`, `\\` and `\n` are the escapes.
struct Quoted<'a>(&'a str);
impl fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_char('"')?;
        for c in self.0.chars() {
            match c {
                '"' => f.write_str("\\\"")?,
                '\\' => f.write_str("\\\\")?,
                '\n' => f.write_str("\\n")?,
                _ => f.write_char(c)?,
            }
        }
        f.write_char('"')
    }
}

/// ` doc "…"`, or nothing.
struct Doc<'a>(&'a str);
impl fmt::Display for Doc<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, " doc {}", Quoted(self.0)) }
    }
}
