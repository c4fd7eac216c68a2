//! The text form of a program, read. The form is told in `print.rs`.
//!
//! What is read need not be a valid program: that is [`crate::verify`]'s to say. For test cases that are written by hand, sites may be left out (`@0` is
//! meant), and without any `site` and `file` a table is made: site *n* is line *n* of a file `ir`.

use crate::address::{Area, Mapped};
use crate::inst::{BodyId, Inst, SiteId, Term};
use crate::program::{Class, Dispatch, Family, Global, Instances, Native, Program, Site, Task, Trigger};
use crate::retain::{Latched, RetainKind, Retained};
use crate::types::TypeId;
use cursor::Cursor;

mod code;
mod cursor;
mod types;

/// A mistake in the text form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParseError {
    /// From 1.
    pub line: u32,
    /// In characters, from 1.
    pub column: u32,
    /// What was expected and found.
    pub message: String,
}

impl std::fmt::Display for ParseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.message)
    }
}
impl std::error::Error for ParseError {}

/// Reads the text form; `natives` finds native functions by name.
pub fn parse_program(text: &str, natives: &dyn Fn(&str) -> Option<Native>) -> Result<Program, ParseError> {
    let mut cursor = Cursor::new(text)?;
    let mut program = Program::default();
    while !cursor.at_end() {
        item(&mut cursor, &mut program, natives)?;
    }
    if program.sites.is_empty() && program.files.is_empty() {
        make_sites(&mut program);
    }
    Ok(program)
}

/// Initial bytes beyond which a text is refused.
const LARGEST: usize = 1 << 28;

fn item(cursor: &mut Cursor<'_>, program: &mut Program, natives: &dyn Fn(&str) -> Option<Native>) -> Result<(), ParseError> {
    match cursor.word()? {
        "image" => program.image_size = cursor.number()?,
        "file" => program.files.push(cursor.text()?),
        "site" => {
            let [file, line, column] = [cursor.number()?, cursor.number()?, cursor.number()?];
            program.sites.push(Site { file, line, column, body: BodyId(cursor.number()?) });
        }
        "data" => program.data.extend(cursor.hex()?),
        "init" => init(cursor, program)?,
        "native" => {
            let name = cursor.word()?;
            program.natives.push(natives(name).ok_or_else(|| cursor.wrong_last(&format!("there is no native function `{name}`")))?);
        }
        "type" => {
            let ty = types::parse(cursor)?;
            let next = program.types.all().len() as u32;
            if program.types.intern(ty.clone()) != TypeId(next) {
                program.types.push(ty);
            }
        }
        "global" => program.globals.push(global(cursor)?),
        "area" => area(cursor, program)?,
        "mapped" => program.mapped.push(mapped(cursor)?),
        "retained" => program.retained.push(retained(cursor)?),
        "restart" => program.restart = cursor.number()?,
        "latched" => {
            let (ty, offset) = typed_at(cursor)?;
            cursor.expect("writers")?;
            cursor.expect("[")?;
            program.latched.push(Latched { ty, offset, writers: cursor.list("]", |c| c.number())? });
        }
        "task" => program.tasks.push(task(cursor)?),
        "class" => {
            let name = cursor.text()?;
            cursor.expect("size")?;
            program.classes.push(Class { name, size: cursor.number()? });
        }
        "instances" => {
            let class = cursor.number()?;
            cursor.expect("at")?;
            let offset = cursor.number()?;
            cursor.expect("count")?;
            program.instances.push(Instances { offset, class, count: cursor.number()? });
        }
        "method" => program.dispatch.push(dispatch(cursor)?),
        "family" => {
            let (name, low) = (cursor.text()?, from(cursor)?);
            program.families.push(Family { name, low, members: cursor.list("]", |c| c.number::<u8>().map(|n| n != 0))? });
        }
        "heap" => program.heap = (cursor.number()?, cursor.number()?),
        "start" => program.init_body = Some(BodyId(cursor.number()?)),
        "body" => {
            let body = code::parse(cursor, program)?;
            program.bodies.push(body);
        }
        other => return Err(cursor.wrong_last(&format!("expected `image`, `body` or another section, found `{other}`"))),
    }
    Ok(())
}

fn init(cursor: &mut Cursor<'_>, program: &mut Program) -> Result<(), ParseError> {
    let len: usize = cursor.number()?;
    if len > LARGEST {
        return Err(cursor.wrong_last("too many initial bytes"));
    }
    program.init.resize(len, 0);
    while cursor.accept("at") {
        let offset: usize = cursor.number()?;
        let bytes = cursor.hex()?;
        let place = offset.checked_add(bytes.len()).and_then(|end| program.init.get_mut(offset..end));
        place.ok_or_else(|| cursor.wrong_last("bytes behind the initial ones"))?.copy_from_slice(&bytes);
    }
    Ok(())
}

fn global(cursor: &mut Cursor<'_>) -> Result<Global, ParseError> {
    let name = cursor.text()?;
    cursor.expect("type")?;
    let ty = TypeId(cursor.number()?);
    cursor.expect("at")?;
    let offset = cursor.number()?;
    let (bare, constant) = (cursor.accept("bare"), cursor.accept("constant"));
    Ok(Global { name, bare, ty, offset, constant, doc: cursor.doc()? })
}

/// The letter of an area.
fn letter(cursor: &mut Cursor<'_>) -> Result<Area, ParseError> {
    let word = cursor.word()?;
    let found = Area::ALL.into_iter().find(|area| area.letter().to_string() == word);
    found.ok_or_else(|| cursor.wrong_last(&format!("expected `I`, `Q` or `M`, found `{word}`")))
}

fn area(cursor: &mut Cursor<'_>, program: &mut Program) -> Result<(), ParseError> {
    let area = letter(cursor)?;
    program.areas.word |= cursor.accept("word");
    cursor.expect("at")?;
    let start = cursor.number()?;
    cursor.expect("size")?;
    program.areas.ranges[area as usize] = (start, cursor.number()?);
    Ok(())
}

fn mapped(cursor: &mut Cursor<'_>) -> Result<Mapped, ParseError> {
    let area = letter(cursor)?;
    cursor.expect("type")?;
    let ty = TypeId(cursor.number()?);
    cursor.expect("at")?;
    let offset = cursor.number()?;
    cursor.expect("to")?;
    let address = cursor.number()?;
    let bit = if cursor.accept("bit") { Some(cursor.number()?) } else { None };
    Ok(Mapped { area, ty, offset, address, bit })
}

/// `type 1 at 16`.
fn typed_at(cursor: &mut Cursor<'_>) -> Result<(TypeId, u32), ParseError> {
    cursor.expect("type")?;
    let ty = TypeId(cursor.number()?);
    cursor.expect("at")?;
    Ok((ty, cursor.number()?))
}

fn retained(cursor: &mut Cursor<'_>) -> Result<Retained, ParseError> {
    let path = cursor.text()?;
    let (ty, offset) = typed_at(cursor)?;
    let kind = match cursor.word()? {
        "retain" => RetainKind::Retain,
        "persistent" => RetainKind::Persistent,
        other => return Err(cursor.wrong_last(&format!("expected `retain` or `persistent`, found `{other}`"))),
    };
    Ok(Retained { path, ty, offset, kind })
}

/// `from 1 [`.
fn from(cursor: &mut Cursor<'_>) -> Result<u32, ParseError> {
    cursor.expect("from")?;
    let low = cursor.number()?;
    cursor.expect("[")?;
    Ok(low)
}

fn dispatch(cursor: &mut Cursor<'_>) -> Result<Dispatch, ParseError> {
    let name = cursor.text()?;
    cursor.expect("(")?;
    let params = cursor.list(")", code::ty)?;
    let result = if cursor.accept("->") { Some(code::ty(cursor)?) } else { None };
    let low = from(cursor)?;
    let target = |c: &mut Cursor<'_>| if c.accept("none") { Ok(None) } else { c.number().map(|n| Some(BodyId(n))) };
    Ok(Dispatch { name, params, result, low, targets: cursor.list("]", target)? })
}

fn task(cursor: &mut Cursor<'_>) -> Result<Task, ParseError> {
    let name = cursor.text()?;
    let trigger = match cursor.word()? {
        "cyclic" => Trigger::Cyclic(cursor.number()?),
        "event" => {
            let offset = cursor.number()?;
            Trigger::Event(offset, if cursor.accept("bit") { Some(cursor.number()?) } else { None })
        }
        "freewheeling" => Trigger::Freewheeling,
        other => return Err(cursor.wrong_last(&format!("expected `cyclic`, `event` or `freewheeling`, found `{other}`"))),
    };
    cursor.expect("priority")?;
    let priority = cursor.number()?;
    cursor.expect("entry")?;
    let entry = BodyId(cursor.number()?);
    cursor.expect("stack")?;
    let stack = (cursor.number()?, cursor.number()?);
    Ok(Task { name, trigger, priority, entry, stack, isolated: cursor.accept("isolated") })
}

/// The table of sites of a text that has none: as many as are used, at the most so many that a mistyped number does no harm.
fn make_sites(program: &mut Program) {
    let mut last = 0;
    for body in &program.bodies {
        let used = body.blocks.iter().flat_map(|b| b.insts.iter().filter_map(inst_site).chain(term_site(&b.term)));
        last = used.chain([body.entry_site]).map(|SiteId(n)| n).filter(|n| *n < 1 << 16).fold(last, u32::max);
    }
    if program.bodies.is_empty() {
        return;
    }
    program.files.push("ir".into());
    program.sites = (0..=last).map(|line| Site { file: 0, line, column: 1, body: BodyId(0) }).collect();
}

fn inst_site(inst: &Inst) -> Option<SiteId> {
    match inst {
        Inst::Op { site, .. }
        | Inst::Index { site, .. }
        | Inst::Check { site, .. }
        | Inst::Deref { site, .. }
        | Inst::Call { site, .. }
        | Inst::Virtual { site, .. }
        | Inst::Native { site, .. }
        | Inst::Poll { site, .. } => Some(*site),
        _ => None,
    }
}
fn term_site(term: &Term) -> Option<SiteId> {
    if let Term::Fault(_, site) = term { Some(*site) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::print::print_program;
    use crate::testing::{SAMPLE, natives, sample};

    #[test]
    fn a_printed_program_reads_back_the_same() {
        let first = sample();
        let text = print_program(&first);
        let second = parse_program(&text, &natives).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(print_program(&second), text);
        assert_eq!((&first.bodies, &first.sites, &first.files, &first.data), (&second.bodies, &second.sites, &second.files, &second.data));
        assert_eq!((&first.init, &first.tasks, &first.globals), (&second.init, &second.tasks, &second.globals));
        assert_eq!((first.areas, &first.mapped), (second.areas, &second.mapped));
        assert_eq!((&first.retained, first.restart, &first.latched), (&second.retained, second.restart, &second.latched));
        assert_eq!(first.types, second.types);
        assert_eq!((first.init_body, first.image_size), (second.init_body, second.image_size));
    }

    #[test]
    fn what_is_written_by_hand_is_printed_alike() {
        let words = |text: &str| {
            let lines: Vec<&str> = text.lines().map(|l| l.split(';').next().unwrap_or(l)).collect();
            lines.join(" ").split_whitespace().map(String::from).collect::<Vec<_>>()
        };
        assert_eq!(words(&print_program(&sample())), words(SAMPLE));
    }

    #[test]
    fn every_operator_and_every_float_reads_back() {
        let mut text = String::from("image 16 body \"all\" () @0 local i64, f32, f64 b0:\n");
        for op in crate::ops() {
            text += &format!("v0 = {} {} @0\n", op.text(), vec!["v0"; op.args().len()].join(", "));
        }
        for value in ["0.0", "-0.0", "1e300", "5e-324", "0x7ff8000000000001", "0xfff0000000000000"] {
            text += &format!("v2 = const.f64 {value}\n");
        }
        for value in ["0.1", "0x7fc00001", "3.4028235e38"] {
            text += &format!("v1 = const.f32 {value}\n");
        }
        let program = parse_program(&(text + "return"), &natives).unwrap_or_else(|e| panic!("{e}"));
        let again = parse_program(&print_program(&program), &natives).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(program.bodies, again.bodies);
        assert_eq!(program.bodies[0].blocks[0].insts.len(), crate::ops().len() + 9);
    }

    #[test]
    fn a_mistake_says_where_and_what_was_expected() {
        let check = |text: &str, expected: &str| {
            assert_eq!(parse_program(text, &natives).expect_err("is refused").to_string(), expected, "{text}");
        };
        check("image x", "1:7: expected a number, found `x`");
        check("image 16\n  bod", "2:3: expected `image`, `body` or another section, found `bod`");
        check("body \"f\" () @0 b0: v1 = ad v0", "1:25: there is no operator `ad`");
        check("body \"f\" () @0 b0: v1 = load.i9 image+0", "1:25: there is no memory type `i9`");
        check("body \"f\" () @0 b1: return", "1:16: expected block `b0`");
        check("body \"f\" () @0 b0: poll 1", "1:26: expected a word, found `the end`");
        check("body \"f\" () @0 b0: v0 = const 99999999999999999999", "1:31: expected a number, found `99999999999999999999`");
        check("native NOPE", "1:8: there is no native function `NOPE`");
        check("data \"0g\"", "1:6: expected pairs of hexadecimal digits");
        check("data \"00", "1:6: the text has no closing `\"`");
        check("init 4 at 2 \"000000\"", "1:13: bytes behind the initial ones");
        check("body \"f\" () @0 b0: fault nonsense", "1:26: there is no fault `nonsense`");
        check("type enum \"X\" STRNG", "1:15: expected an elementary type, found `STRNG`");
    }

    #[test]
    fn a_text_without_sites_gets_a_table() {
        let program = parse_program("image 16 body \"f\" () b0: poll 1 @3 return", &natives).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((program.sites.len(), program.sites[3].line), (4, 3));
    }
}
