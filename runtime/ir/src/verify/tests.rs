//! Each rule of the verifier by a program that breaks it, and thousands of broken programs that must not get out of their image.

use super::*;
use crate::inst::{Block, Body, Inst, Term};
use crate::parse::parse_program;
use crate::testing::{Random, SAMPLE, natives, run_with, sample};

fn read(text: &str) -> Program {
    parse_program(text, &natives).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A program of 256 bytes with `tables`, and the body `main` of which `code` is what stands behind its locals.
#[track_caller]
fn check(tables: &str, locals: &str, code: &str, expected: Result<(), Defect>) {
    let text =
        format!("image 256 data \"00010203\" native STR_ASSIGN {tables} body \"main\" () frame 32 @0 local {locals} b0: {code} return");
    assert_eq!(verify(&read(&text)).map_err(|e| e.defect), expected, "{tables} {code}");
}
#[track_caller]
fn code(locals: &str, code: &str, expected: Defect) {
    check("", locals, code, Err(expected));
}
#[track_caller]
fn fine(locals: &str, code: &str) {
    check("", locals, code, Ok(()));
}
#[track_caller]
fn tables(tables: &str, expected: Defect) {
    check(tables, "i64", "", Err(expected));
}
fn leaves(from: u64, to: u64, size: u64) -> Defect {
    Defect::Extent { from, to, size }
}
fn mismatch(expected: Ty, found: Ty) -> Defect {
    Defect::Mismatch { expected, found }
}

#[test]
fn what_is_kept_or_copied_stays_in_the_image() {
    let task = "type INT type array 0 [0..99] task \"T\" cyclic 1 priority 0 entry 0 stack 128 64";
    tables("retained \"x\" type 0 at 16 retain", Defect::Type(0));
    for (line, expected) in [
        ("retained \"x\" type 1 at 57 retain", Defect::Retained(0)),
        ("retained \"x\" type 0 at 255 persistent", Defect::Retained(0)),
        ("restart 15", Defect::Retained(0)),
        ("restart 255", Defect::Retained(0)),
        ("latched type 1 at 57 writers []", Defect::Latched(0)),
        ("latched type 0 at 190 writers [0]", Defect::Latched(0)),
        ("latched type 0 at 64 writers [0, 7]", Defect::Latched(0)),
    ] {
        tables(&format!("{task} {line}"), expected);
    }
    check(&format!("{task} retained \"x\" type 1 at 56 retain restart 254 latched type 0 at 126 writers [0]"), "i64", "", Ok(()));
}

#[test]
fn the_sample_is_accepted() {
    assert_eq!(verify(&sample()), Ok(()));
}

#[test]
fn operands_have_the_types_and_numbers_of_their_operator() {
    code("i64", "v0 = copy v1", Defect::Local(1));
    code("i64, f64", "v0 = copy v1", mismatch(Ty::I64, Ty::F64));
    code("i64", "v0 = const.f32 1", mismatch(Ty::F32, Ty::I64));
    code("i64, f64", "v0 = add v0, v1", mismatch(Ty::I64, Ty::F64));
    code("i64, f64", "v1 = add v0, v0", mismatch(Ty::I64, Ty::F64));
    code("i64", "v0 = add v0", Defect::Arity { expected: 2, found: 1 });
    code("i64", "v0 = neg v0, v0", Defect::Arity { expected: 1, found: 2 });
    code("f32", "v0 = load.f64 image+16", mismatch(Ty::F64, Ty::F32));
    code("f32", "store.i32 image+16, v0", mismatch(Ty::I64, Ty::F32));
    code("f32, addr:1", "v1 = deref v0", mismatch(Ty::I64, Ty::F32));
    code("i64", "v0 = deref v0", Defect::NoAddress);
    code("i64", "v0 = address frame+0", Defect::NoAddress);
    code("addr:1", "v0 = load.i8 image+16", mismatch(Ty::I64, Ty::Addr(1)));
    code("i64", "v0 = add v0, v0 @99999", Defect::Site(99_999));
}

#[test]
fn an_access_stays_in_its_base() {
    fine("i64", "v0 = load.i64 image+248 v0 = load.u8 image+16 v0 = load.i64 frame+24");
    code("i64", "v0 = load.i64 image+249", leaves(249, 257, 256));
    code("i64", "v0 = load.u8 image+15", leaves(15, 16, 256));
    code("i64", "v0 = load.i64 frame+25", leaves(25, 33, 32));
    code("i64", "store.i8 image+4294967295, v0", leaves(4_294_967_295, 4_294_967_296, 256));
    code("i64", "v0 = load.u8 v0+0", Defect::NoAddress);
    fine("i64, addr:4", "v1 = address frame+28 v0 = load.i32 v1+0");
    code("i64, addr:4", "v1 = address frame+29", leaves(29, 33, 32));
    code("i64, addr:4", "v1 = address frame+0 v0 = load.i32 v1+1", leaves(1, 5, 4));
    code("addr:4, addr:8", "v0 = address image+16 v1 = copy v0", mismatch(Ty::Addr(8), Ty::Addr(4)));
    fine("addr:8, addr:4", "v0 = address image+16 v1 = copy v0 v1 = address v0+4");
    code("addr:8, addr:4", "v0 = address image+16 v1 = address v0+5", leaves(5, 9, 8));
    fine("i64", "v0 = pointer frame+32");
    code("i64", "v0 = pointer frame+33", leaves(33, 33, 32));
    fine("i64", "move image+16, frame+0, 32 data frame+28, 0, 4");
    code("i64", "move image+16, frame+1, 32", leaves(1, 33, 32));
    code("i64", "move image+240, frame+0, 32", leaves(240, 272, 256));
    code("i64", "data frame+29, 0, 4", leaves(29, 33, 32));
    code("i64", "data frame+0, 1, 4", Defect::Data { from: 1, len: 4 });
}

#[test]
fn an_index_reaches_no_further_than_its_base() {
    fine("i64, addr:8", "v1 = index frame+0 [v0 in 5..8 by 8]");
    code("i64, addr:8", "v1 = index frame+1 [v0 in 5..8 by 8]", leaves(1, 33, 32));
    code("i64, addr:8", "v1 = index frame+0 [v0 in 5..9 by 8]", leaves(0, 40, 32));
    code("i64, addr:8", "v1 = index frame+0 [v0 in 9..8 by 8]", Defect::Bounds { low: 9, high: 8 });
    code("i64, addr:8", "v1 = index image+8 [v0 in 0..1 by 8]", leaves(8, 24, 256));
    let whole = format!("v1 = index frame+0 [v0 in {}..{} by 4294967295]", i64::MIN, i64::MAX);
    code("i64, addr:8", &whole, leaves(0, u64::MAX, 32));
    code("i64, i64", "v1 = index frame+0 [v0 in 0..0 by 8]", Defect::NoAddress);
    code("f64, addr:8", "v1 = index frame+0 [v0 in 0..0 by 8]", mismatch(Ty::I64, Ty::F64));
}

#[test]
fn an_address_is_written_before_it_is_read_on_every_way() {
    code("i64, addr:8", "v0 = load.i64 v1+0", Defect::Unassigned(1));
    code("i64, addr:8", "v1 = copy v1", Defect::Unassigned(1));
    let diamond = |left: &str, right: &str| format!("branch v0, b1, b2 b1: {left} jump b3 b2: {right} jump b3 b3: v0 = load.i64 v1+0");
    fine("i64, addr:8", &diamond("v1 = address frame+0", "v1 = address image+16"));
    code("i64, addr:8", &diamond("v1 = address frame+0", ""), Defect::Unassigned(1));
    code("i64, addr:8", &diamond("", "v1 = address frame+0"), Defect::Unassigned(1));
    let turn = |before: &str| format!("{before} jump b1 b1: v0 = load.i64 v1+0 v1 = address frame+0 poll 1 branch v0, b1, b2 b2:");
    fine("i64, addr:8", &turn("v1 = address frame+8"));
    code("i64, addr:8", &turn(""), Defect::Unassigned(1));
    fine("i64, addr:8", "return b1: v0 = load.i64 v1+0");
    let many: Vec<String> = (1..100).map(|_| "addr:8".into()).collect();
    code(&format!("i64, {}", many.join(", ")), "v98 = address frame+0 v0 = load.i64 v98+0 v0 = load.i64 v99+0", Defect::Unassigned(99));
}

#[test]
fn calls_and_ends_fit() {
    let callee = |code: &str| {
        read(&format!(
            "image 256 body \"main\" () @0 local i64, f64, addr:4 b0: v2 = address image+16 {code} return body \"f\" (i64, addr:8) -> f64 @0 b0: jump b0"
        ))
    };
    let refused = |code: &str, defect| assert_eq!(verify(&callee(code)).map_err(|e| e.defect), Err(defect), "{code}");
    refused("call 2()", Defect::Body(2));
    refused("call 1(v0)", Defect::Arity { expected: 2, found: 1 });
    refused("call 1(v0, v2)", mismatch(Ty::Addr(8), Ty::Addr(4)));
    refused("v0 = call 0()", Defect::Result);
    refused("jump b7 b1:", Defect::Block(7));
    refused("branch v1, b0, b0 b1:", mismatch(Ty::I64, Ty::F64));
    refused("switch v0 [1: b0, 2: b0, 1: b0] else b0 b1:", Defect::Label(1));
    refused("return v0 b1:", Defect::Result);
    code("addr:1", "v0 = native STR_ASSIGN()", Defect::Address);
    code("i64", "native 3()", Defect::Native(3));
    let args = vec!["v0"; 64].join(", ");
    code("i64", &format!("native STR_ASSIGN({args})"), Defect::Arity { expected: 63, found: 64 });
}

#[test]
fn every_body_on_a_cycle_of_calls_counts_its_depth() {
    let cycle = |b: &str, c: &str| {
        let body = |name: &str, mark: &str, callee: u32| format!("body \"{name}\" () {mark} @0 b0: call {callee}() return ");
        read(&format!("image 16 {}{}{}", body("a", "", 1), body("b", b, 2), body("c", c, 1)))
    };
    let unmarked = |program: Program| verify(&program).map_err(|e| (e.defect, e.body.map(|b| b.0)));
    assert_eq!(unmarked(cycle("", "")), Err((Defect::Recursion, Some(1))));
    assert_eq!(unmarked(cycle("recursive", "")), Err((Defect::Recursion, Some(2))));
    assert_eq!(unmarked(cycle("recursive", "recursive")), Ok(()));
    assert_eq!(unmarked(read("image 16 body \"a\" () @0 b0: call 0() return")), Err((Defect::Recursion, Some(0))));
}

#[test]
fn tables_stay_in_the_image_and_tasks_apart() {
    tables("image 100", Defect::Size(100));
    tables("image 0", Defect::Size(0));
    tables("init 257", Defect::Init);
    tables("file \"f\" site 0 1 1 0 site 1 1 1 0", Defect::Site(1));
    tables("file \"f\" site 0 1 1 7", Defect::Site(0));
    tables("start 1", Defect::Body(1));
    tables("task \"t\" cyclic 1 priority 0 entry 1 stack 0 0", Defect::Body(1));
    tables("task \"t\" cyclic 0 priority 0 entry 0 stack 0 0", Defect::Trigger(0));
    tables("task \"t\" event 256 priority 0 entry 0 stack 0 0", Defect::Trigger(0));
    tables("task \"t\" cyclic 1 priority 0 entry 0 stack 128 129", Defect::Stack(0));
    tables("task \"t\" cyclic 1 priority 0 entry 0 stack 0 16", Defect::Stack(0));
    let two = "task \"t\" cyclic 1 priority 0 entry 0 stack 128 64 task \"u\" cyclic 1 priority 0 entry 0 stack";
    tables(&format!("{two} 191 16"), Defect::Stack(1));
    tables(&format!("{two} 100 29"), Defect::Stack(1));
    check(&format!("{two} 192 64"), "i64", "", Ok(()));
    tables("type LREAL global \"x\" type 0 at 249", Defect::Global(0));
    tables("type LREAL global \"x\" type 1 at 16", Defect::Type(1));
    tables("type pointer 9", Defect::Type(9));
    tables("type array 0 [0..1]", Defect::Type(0));
    tables("type struct \"S\" size 8 align 8 { state \"x\" 0 at 0 }", Defect::Type(0));
    tables("type LREAL type struct \"S\" size 8 align 8 { state \"x\" 0 at 1 }", Defect::Type(1));
    tables("type LREAL type array 0 [0..4294967295]", Defect::Type(1));
    tables(&format!("type LREAL type array 0 [{}..{}]", i64::MIN, i64::MAX), Defect::Type(1));
}

#[test]
fn an_entry_takes_no_parameters_and_a_body_makes_sense() {
    let refused = |text: &str, defect| assert_eq!(verify(&read(text)).map_err(|e| e.defect), Err(defect), "{text}");
    refused("image 16 start 0 body \"f\" (i64) @0 b0: return", Defect::Entry);
    refused("image 16 body \"f\" () frame 8 @0 b0: return", Defect::Size(8));
    refused("image 16 body \"f\" () @0", Defect::Block(0));
    refused("image 16 body \"f\" (addr:1) -> addr:1 @0 b0: return v0", Defect::Address);
    let mut program = read("image 16 body \"f\" () @0 b0: return");
    program.bodies[0].params = 1;
    assert_eq!(verify(&program).map_err(|e| e.defect), Err(Defect::Parameters));
}

#[test]
fn an_error_says_where() {
    let program = read("image 16 body \"f\" () @0 local i64 b0: jump b1 b1: v0 = const 1 v0 = load.i8 image+16 return");
    let error = verify(&program).expect_err("is refused");
    assert_eq!(error.to_string(), "body 0: block 1: instruction 1: bytes 16..17 leave the 16 bytes of their base");
}

/// The sample with one to three of its words changed: numbers to others, words to other words.
fn mutate(words: &[&str], random: &mut Random) -> String {
    const NUMBERS: [i64; 12] = [0, 1, -1, 2, 7, 8, 16, 255, 512, 4_294_967_295, i64::MAX, i64::MIN];
    let mut words: Vec<String> = words.iter().map(|w| (*w).into()).collect();
    for _ in 0..=random.below(3) {
        let mut at = random.below(words.len());
        while !words[at].contains(|c: char| c.is_ascii_digit()) && random.below(8) > 0 {
            at = random.below(words.len());
        }
        let digits = words[at].find(|c: char| c.is_ascii_digit());
        words[at] = match digits {
            Some(start) if random.below(16) > 0 => {
                let end = words[at][start..].find(|c: char| !c.is_ascii_digit()).map_or(words[at].len(), |n| start + n);
                let old: i64 = words[at][start..end].parse().unwrap_or(0);
                let new = match random.below(3) {
                    0 => old.wrapping_add(random.below(5) as i64 - 2),
                    1 => NUMBERS[random.below(NUMBERS.len())],
                    _ => random.below(64) as i64,
                };
                format!("{}{new}{}", &words[at][..start], &words[at][end..])
            }
            _ => words[random.below(words.len())].clone(),
        };
    }
    words.join(" ")
}

/// Whether every loop of a body takes fuel, so that a run ends.
fn polls(body: &Body) -> bool {
    let pays = |block: &Block| block.insts.iter().any(|i| matches!(i, Inst::Poll { cost: 1.., .. }));
    let mut left: Vec<usize> = (0..body.blocks.len()).filter(|b| !pays(&body.blocks[*b])).collect();
    // Blocks that lead to no block that is left lie on no loop.
    loop {
        let before = left.len();
        let caught = |block: usize| body.blocks[block].handler.is_some_and(|t| left.contains(&(t.0 as usize)));
        let leads = |block: &usize| match &body.blocks[*block].term {
            _ if caught(*block) => true,
            Term::Jump(t) => left.contains(&(t.0 as usize)),
            Term::Branch { then, other, .. } => left.contains(&(then.0 as usize)) || left.contains(&(other.0 as usize)),
            Term::Switch { cases, default, .. } => cases.iter().map(|(_, t)| t).chain([default]).any(|t| left.contains(&(t.0 as usize))),
            Term::Return(_) | Term::Fault(..) | Term::Rethrow(_) => false,
        };
        let next: Vec<usize> = left.iter().copied().filter(leads).collect();
        left = next;
        if left.len() == before {
            return left.is_empty();
        }
    }
}

#[test]
fn a_broken_program_is_refused_or_stays_in_its_image() {
    let clean: Vec<&str> = SAMPLE.lines().map(|l| l.split(';').next().unwrap_or(l)).collect();
    let words: Vec<&str> = clean.iter().flat_map(|l| l.split_inclusive([' ', ',', '(', '+'])).collect();
    let mut random = Random(0x7A6B_5C4D_3E2F_1A0B);
    let (mut refused, mut ran, mut faults) = (0, 0, 0);
    for _ in 0..20_000 {
        let text = mutate(&words, &mut random);
        let Ok(program) = parse_program(&text, &natives) else { continue };
        if verify(&program).is_err() {
            refused += 1;
            continue;
        }
        if program.image_size > 1 << 20 || !program.bodies.iter().all(polls) {
            continue;
        }
        for body in (0..program.bodies.len()).filter(|b| program.bodies[*b].params == 0) {
            let outcome = run_with(&program, body as u32, 200, 0);
            assert_eq!(outcome.escapes, 0, "{text}");
            ran += 1;
            faults += usize::from(outcome.fault.is_some());
        }
    }
    assert!(refused > 2000 && ran > 2000 && faults > 100, "{refused} refused, {ran} ran, {faults} faults");
}
