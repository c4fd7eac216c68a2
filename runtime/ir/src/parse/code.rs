//! Bodies of the text form, read.

use super::ParseError;
use super::cursor::{Cursor, number_behind};
use crate::inst::{Base, Block, BlockId, Body, BodyId, Const, Inst, Local, Mem, NativeId, SiteId, Term, Ty};
use crate::op::ops;
use crate::program::Program;
use takt_abi::Fault;

pub(super) fn parse(cursor: &mut Cursor<'_>, program: &Program) -> Result<Body, ParseError> {
    let name = cursor.text()?;
    cursor.expect("(")?;
    let mut locals = cursor.list(")", ty)?;
    let params = locals.len() as u32;
    let result = if cursor.accept("->") { Some(ty(cursor)?) } else { None };
    let frame_size = if cursor.accept("frame") { cursor.number()? } else { 0 };
    let recursive = cursor.accept("recursive");
    let entry_site = site(cursor)?;
    if cursor.accept("local") {
        locals.push(ty(cursor)?);
        while cursor.accept(",") {
            locals.push(ty(cursor)?);
        }
    }
    let mut blocks = vec![];
    while number_behind(cursor.peek(), 'b').is_some() {
        let number = cursor.numbered('b')?;
        if number as usize != blocks.len() {
            return Err(cursor.wrong_last(&format!("expected block `b{}`", blocks.len())));
        }
        let handler = if cursor.accept("catch") { Some(target(cursor)?) } else { None };
        cursor.expect(":")?;
        blocks.push(Block { handler, ..block(cursor, program)? });
    }
    Ok(Body { name, params, locals, result, blocks, frame_size, recursive, entry_site })
}

pub(super) fn ty(cursor: &mut Cursor<'_>) -> Result<Ty, ParseError> {
    Ok(match cursor.word()? {
        "i64" => Ty::I64,
        "f32" => Ty::F32,
        "f64" => Ty::F64,
        "addr" => {
            cursor.expect(":")?;
            Ty::Addr(cursor.number()?)
        }
        other => return Err(cursor.wrong_last(&format!("expected `i64`, `f32`, `f64` or `addr`, found `{other}`"))),
    })
}

/// `@3`; site 0 if there is none.
fn site(cursor: &mut Cursor<'_>) -> Result<SiteId, ParseError> {
    if cursor.accept("@") { cursor.number().map(SiteId) } else { Ok(SiteId(0)) }
}
fn local(cursor: &mut Cursor<'_>) -> Result<Local, ParseError> {
    cursor.numbered('v').map(Local)
}
fn target(cursor: &mut Cursor<'_>) -> Result<BlockId, ParseError> {
    cursor.numbered('b').map(BlockId)
}
/// `image+16`, `frame+0`, `v3+8`.
fn place(cursor: &mut Cursor<'_>) -> Result<(Base, u32), ParseError> {
    let base = match cursor.peek() {
        "image" | "frame" => {
            if cursor.word()? == "image" {
                Base::Image
            } else {
                Base::Frame
            }
        }
        _ => Base::Local(local(cursor)?),
    };
    cursor.expect("+")?;
    Ok((base, cursor.number()?))
}

fn block(cursor: &mut Cursor<'_>, program: &Program) -> Result<Block, ParseError> {
    let mut insts = vec![];
    loop {
        if cursor.peek_second() == "=" {
            let dst = local(cursor)?;
            cursor.expect("=")?;
            insts.push(assignment(cursor, program, dst)?);
        } else if let Some(term) = term(cursor)? {
            return Ok(Block { insts, term, handler: None });
        } else {
            insts.push(statement(cursor, program)?);
        }
    }
}

/// What stands behind `v3 =`.
fn assignment(cursor: &mut Cursor<'_>, program: &Program, dst: Local) -> Result<Inst, ParseError> {
    let word = cursor.word()?;
    Ok(match word {
        "const" => Inst::Const { dst, value: Const::I64(cursor.number()?) },
        "const.f32" => Inst::Const { dst, value: Const::F32(bits(cursor, f32::to_bits)?) },
        "const.f64" => Inst::Const { dst, value: Const::F64(bits(cursor, f64::to_bits)?) },
        "copy" => Inst::Copy { dst, src: local(cursor)? },
        "address" => {
            let (base, offset) = place(cursor)?;
            Inst::Address { dst, base, offset }
        }
        "pointer" => {
            let (base, offset) = place(cursor)?;
            Inst::Pointer { dst, base, offset }
        }
        "index" => index(cursor, dst)?,
        "deref" => Inst::Deref { dst, pointer: local(cursor)?, site: site(cursor)? },
        "call" => call(cursor, Some(dst))?,
        "native" => native(cursor, program, Some(dst))?,
        "virtual" => virtual_call(cursor, Some(dst))?,
        "isa" => Inst::IsA { dst, pointer: local(cursor)?, family: cursor.number()? },
        "guard" => Inst::Guard { dst },
        "catch" => Inst::Catch { dst, depth: local(cursor)? },
        _ => match word.strip_prefix("load.") {
            Some(name) => {
                let mem = mem(cursor, name)?;
                let (base, offset) = place(cursor)?;
                Inst::Load { dst, mem, base, offset }
            }
            None => operator(cursor, word, dst)?,
        },
    })
}

/// A float as decimal number, or its bits as `0x7fc00000`.
fn bits<F: std::str::FromStr, B: TryFrom<u64>>(cursor: &mut Cursor<'_>, of: fn(F) -> B) -> Result<B, ParseError> {
    match cursor.peek().strip_prefix("0x") {
        Some(digits) => {
            let value = u64::from_str_radix(digits, 16).ok().and_then(|v| v.try_into().ok());
            cursor.word()?;
            value.ok_or_else(|| cursor.wrong_last("expected the bits of a float"))
        }
        None => cursor.number().map(of),
    }
}

fn operator(cursor: &mut Cursor<'_>, word: &str, dst: Local) -> Result<Inst, ParseError> {
    let op = ops().iter().find(|op| op.text() == word).ok_or_else(|| cursor.wrong_last(&format!("there is no operator `{word}`")))?;
    let mut args = vec![local(cursor)?];
    while cursor.accept(",") {
        args.push(local(cursor)?);
    }
    Ok(Inst::Op { op: *op, dst, args, site: site(cursor)? })
}

fn index(cursor: &mut Cursor<'_>, dst: Local) -> Result<Inst, ParseError> {
    let (base, offset) = place(cursor)?;
    cursor.expect("[")?;
    let index = local(cursor)?;
    cursor.expect("in")?;
    let (low, high) = cursor.range(|t| t.parse().ok())?;
    cursor.expect("by")?;
    let stride = cursor.number()?;
    cursor.expect("]")?;
    Ok(Inst::Index { dst, base, offset, index, low, high, stride, site: site(cursor)? })
}

fn statement(cursor: &mut Cursor<'_>, program: &Program) -> Result<Inst, ParseError> {
    let word = cursor.word()?;
    Ok(match word {
        "check" => {
            let index = local(cursor)?;
            cursor.expect("in")?;
            let (low, high) = cursor.range(|t| number_behind(t, 'v').map(Local))?;
            Inst::Check { index, low, high, site: site(cursor)? }
        }
        "move" => {
            let (dst, dst_offset) = place(cursor)?;
            cursor.expect(",")?;
            let (src, src_offset) = place(cursor)?;
            cursor.expect(",")?;
            Inst::Move { dst, dst_offset, src, src_offset, len: cursor.number()? }
        }
        "data" => {
            let (dst, offset) = place(cursor)?;
            cursor.expect(",")?;
            let data = cursor.number()?;
            cursor.expect(",")?;
            Inst::Data { dst, offset, data, len: cursor.number()? }
        }
        "call" => call(cursor, None)?,
        "native" => native(cursor, program, None)?,
        "virtual" => virtual_call(cursor, None)?,
        "place" => {
            let (_, offset) = place(cursor)?;
            cursor.expect("class")?;
            let class = cursor.number()?;
            cursor.expect("count")?;
            Inst::Place { offset, class, count: cursor.number()? }
        }
        "poll" => Inst::Poll { cost: cursor.number()?, site: site(cursor)? },
        _ => match word.strip_prefix("store.") {
            Some(name) => {
                let mem = mem(cursor, name)?;
                let (base, offset) = place(cursor)?;
                cursor.expect(",")?;
                Inst::Store { src: local(cursor)?, mem, base, offset }
            }
            None => return Err(cursor.wrong_last(&format!("expected an instruction, found `{word}`"))),
        },
    })
}

fn call(cursor: &mut Cursor<'_>, dst: Option<Local>) -> Result<Inst, ParseError> {
    let body = BodyId(cursor.number()?);
    cursor.expect("(")?;
    Ok(Inst::Call { body, args: cursor.list(")", local)?, dst, site: site(cursor)? })
}

fn virtual_call(cursor: &mut Cursor<'_>, dst: Option<Local>) -> Result<Inst, ParseError> {
    let (method, this) = (cursor.number()?, local(cursor)?);
    cursor.expect("(")?;
    Ok(Inst::Virtual { method, this, args: cursor.list(")", local)?, dst, site: site(cursor)? })
}

fn native(cursor: &mut Cursor<'_>, program: &Program, dst: Option<Local>) -> Result<Inst, ParseError> {
    let name = cursor.word()?;
    let by_name = program.natives.iter().position(|n| n.name == name).map(|i| i as u32);
    let number = by_name.or_else(|| name.parse().ok());
    let native = NativeId(number.ok_or_else(|| cursor.wrong_last(&format!("`{name}` has not been declared with `native`")))?);
    cursor.expect("(")?;
    Ok(Inst::Native { native, args: cursor.list(")", local)?, dst, site: site(cursor)? })
}

fn mem(cursor: &Cursor<'_>, name: &str) -> Result<Mem, ParseError> {
    let all = [Mem::Bool, Mem::I8, Mem::U8, Mem::I16, Mem::U16, Mem::I32, Mem::U32, Mem::I64, Mem::F32, Mem::F64];
    let found = all.into_iter().find(|m| m.to_string() == name);
    found.ok_or_else(|| cursor.wrong_last(&format!("there is no memory type `{name}`")))
}

/// The end of the block, if it stands here.
fn term(cursor: &mut Cursor<'_>) -> Result<Option<Term>, ParseError> {
    let word = cursor.peek();
    if !["jump", "branch", "switch", "return", "fault", "rethrow"].contains(&word) {
        return Ok(None);
    }
    cursor.expect(word)?;
    Ok(Some(match word {
        "jump" => Term::Jump(target(cursor)?),
        "branch" => {
            let cond = local(cursor)?;
            cursor.expect(",")?;
            let then = target(cursor)?;
            cursor.expect(",")?;
            Term::Branch { cond, then, other: target(cursor)? }
        }
        "switch" => {
            let value = local(cursor)?;
            cursor.expect("[")?;
            let cases = cursor.list("]", case)?;
            cursor.expect("else")?;
            Term::Switch { value, cases, default: target(cursor)? }
        }
        "return" if number_behind(cursor.peek(), 'v').is_some() => Term::Return(Some(local(cursor)?)),
        "return" => Term::Return(None),
        "rethrow" => Term::Rethrow(local(cursor)?),
        _ => Term::Fault(fault(cursor)?, site(cursor)?),
    }))
}
fn case(cursor: &mut Cursor<'_>) -> Result<(i64, BlockId), ParseError> {
    let label = cursor.number()?;
    cursor.expect(":")?;
    Ok((label, target(cursor)?))
}

fn fault(cursor: &mut Cursor<'_>) -> Result<Fault, ParseError> {
    Ok(match cursor.word()? {
        "index" => Fault::Index { value: cursor.number()?, low: cursor.number()?, high: cursor.number()? },
        "wild-pointer" => Fault::WildPointer { offset: cursor.number()?, size: cursor.number()? },
        "stack-overflow" => Fault::StackOverflow { depth: cursor.number()? },
        "block" => Fault::Block { error: cursor.number()? },
        "no-instance" => Fault::NoInstance { offset: cursor.number()? },
        "overruns" => Fault::Overruns { count: cursor.number()? },
        other => {
            let plain = [Fault::DivisionByZero, Fault::NullPointer, Fault::Watchdog, Fault::Panic, Fault::WrongDelete, Fault::Stopped];
            let found = plain.into_iter().find(|fault| fault.name() == other);
            found.ok_or_else(|| cursor.wrong_last(&format!("there is no fault `{other}`")))?
        }
    })
}
