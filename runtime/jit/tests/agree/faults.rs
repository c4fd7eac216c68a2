//! Every fault with its facts, site and call stack, said outright and not only by comparison.

use crate::bench::{Outcome, Start, Writer, check, compiled, program, single};
use crate::generator::natives;
use takt_abi::Fault;
use takt_ir::{Base, Body, BodyId, Inst, Local, NativeId, Op, Program, SiteId, Term, Ty};

fn fault(found: &Outcome) -> (Fault, u32, Vec<u32>) {
    (found.fault.expect("a fault"), found.site, found.trace.clone())
}

/// The fault of a program of one body, which has its declaration at site 0 and the instruction at site 1.
fn fault_of(write: impl FnOnce(&mut Writer)) -> Fault {
    let (fault, site, trace) = fault(&check(&single(write), Start::default()));
    assert_eq!((site, trace), (1, vec![]));
    fault
}

#[test]
fn an_index_outside_its_bounds_names_them() {
    for value in [-4, 6, i64::MIN, i64::MAX] {
        let found = fault_of(|w| {
            let (index, dst, site) = (w.int(value), w.local(Ty::Addr(4)), w.site());
            w.push(Inst::Index { dst, base: Base::Image, offset: 64, index, low: -3, high: 5, stride: 4, site });
        });
        assert_eq!(found, Fault::Index { value, low: -3, high: 5 });
    }
}

#[test]
fn bounds_over_all_integers_let_every_index_pass() {
    let p = single(|w| {
        let (index, dst, site) = (w.int(i64::MIN), w.local(Ty::Addr(4)), w.site());
        w.push(Inst::Index { dst, base: Base::Image, offset: 64, index, low: i64::MIN, high: i64::MAX, stride: 0, site });
    });
    assert_eq!(check(&p, Start::default()).code, 0);
}

#[test]
fn open_arrays_are_checked_against_their_own_bounds() {
    for (index, low, high, good) in [(3, 3, 3, true), (4, 3, 3, false), (2, 3, 9, false), (0, 5, -5, false)] {
        let p = single(|w| {
            let (index, low, high, site) = (w.int(index), w.int(low), w.int(high), w.site());
            w.push(Inst::Check { index, low, high, site });
        });
        let found = check(&p, Start::default()).fault;
        assert_eq!(found, if good { None } else { Some(Fault::Index { value: index, low, high }) });
    }
}

#[test]
fn integer_division_by_zero_is_a_fault() {
    for op in [Op::Div, Op::DivU] {
        let found = fault_of(|w| {
            let (a, b, dst, site) = (w.int(7), w.int(0), w.local(Ty::I64), w.site());
            w.push(Inst::Op { op, dst, args: vec![a, b], site });
        });
        assert_eq!(found, Fault::DivisionByZero);
    }
}

#[test]
fn pointers_reach_the_image_and_nothing_else() {
    let deref = |pointer: i64, extent: u32| {
        let p = single(|w| {
            let (pointer, dst, site) = (w.int(pointer), w.local(Ty::Addr(extent)), w.site());
            w.push(Inst::Deref { dst, pointer, site });
        });
        check(&p, Start::default()).fault
    };
    assert_eq!(deref(0, 8), Some(Fault::NullPointer));
    for good in [(16, 8), (4088, 8), (4096, 0), (16, 4080)] {
        assert_eq!(deref(good.0, good.1), None, "{good:?}");
    }
    for (pointer, extent) in [(1, 1), (15, 1), (4089, 8), (4097, 0), (-1, 8), (i64::MIN, 8), (i64::MAX, 1), (17, 4080)] {
        assert_eq!(deref(pointer, extent), Some(Fault::WildPointer { offset: pointer as u64, size: extent.into() }));
    }
}

#[test]
fn a_stated_fault_keeps_its_facts() {
    let stated = Fault::Block { error: 4711 };
    let found = fault_of(|w| {
        let site = w.site();
        w.end(Term::Fault(stated, site));
    });
    assert_eq!(found, stated);
}

#[test]
fn a_native_block_fails_at_its_call() {
    let mut w = Writer::new(&[], None, 0);
    let (a, site) = (w.int(10), w.site());
    w.push(Inst::Native { native: NativeId(2), args: vec![a], dst: None, site });
    let p = program(vec![w.body], natives().into_iter().map(|(native, ..)| native).collect(), w.sites);
    assert_eq!(fault(&check(&p, Start::default())), (Fault::Block { error: 10 }, 1, vec![]));
}

/// Body i calls body i + 1; the last one divides by zero.
fn chain(length: u32) -> Program {
    let mut sites = 0;
    let mut bodies: Vec<Body> = Vec::new();
    for i in 0..length {
        let mut w = Writer::new(&[], None, sites);
        let site = w.site();
        if i + 1 < length {
            w.push(Inst::Call { body: BodyId(i + 1), args: vec![], dst: None, site });
        } else {
            let (a, b, dst) = (w.int(1), w.int(0), w.local(Ty::I64));
            w.push(Inst::Op { op: Op::Div, dst, args: vec![a, b], site });
        }
        sites = w.sites;
        bodies.push(w.body);
    }
    program(bodies, Vec::new(), sites)
}

#[test]
fn the_call_stack_runs_from_the_fault_outwards() {
    assert_eq!(fault(&check(&chain(4), Start::default())), (Fault::DivisionByZero, 7, vec![5, 3, 1]));
}

#[test]
fn a_long_call_stack_is_cut_at_its_outer_end() {
    let found = check(&chain(100), Start::default());
    assert_eq!((found.site, found.trace.len(), found.trace[0], found.trace[63]), (199, 64, 197, 71));
}

/// A body that calls itself without end.
fn endless_recursion(frame_size: u32) -> Program {
    let mut main = Writer::new(&[], None, 0);
    let site = main.site();
    main.push(Inst::Call { body: BodyId(1), args: vec![], dst: None, site });
    let mut own = Writer::new(&[], None, main.sites);
    (own.body.recursive, own.body.frame_size) = (true, frame_size);
    let values: Vec<Local> = (0..40).map(|i| own.load(takt_ir::Mem::I64, 64 + 8 * i)).collect();
    let site = own.site();
    own.push(Inst::Call { body: BodyId(1), args: vec![], dst: None, site });
    for (i, value) in values.into_iter().enumerate() {
        own.store(value, takt_ir::Mem::I64, 512 + 8 * i as u32);
    }
    let sites = own.sites;
    program(vec![main.body, own.body], Vec::new(), sites)
}

#[test]
fn recursion_ends_at_the_depth_limit() {
    let found = check(&endless_recursion(0), Start::default());
    assert_eq!(fault(&found).0, Fault::StackOverflow { depth: 20 });
    assert_eq!((found.site, found.trace[0], found.trace.last(), found.fuel), (2, 3, Some(&1), 1000 - 20));
}

#[test]
fn recursion_ends_with_the_stack_region() {
    let found = check(&endless_recursion(256), Start::default());
    assert_eq!((fault(&found).0, found.depth), (Fault::StackOverflow { depth: 4 }, 4));
}

#[test]
fn recursion_ends_with_the_fuel() {
    let found = check(&endless_recursion(0), Start { fuel: 5, slices: 0, depth_limit: 100, ..Start::default() });
    assert_eq!((fault(&found).0, found.site, found.fuel), (Fault::Watchdog, 2, -1));
}

#[test]
fn the_native_stack_bound_holds_in_the_deepest_recursion() {
    let program = endless_recursion(0);
    let code = takt_jit::compile(&program).expect("good");
    let limit = 20_000;
    let bound = code.native_stack_bound(limit);
    let run = move || compiled(&program, &code, Start { fuel: 1 << 40, depth_limit: limit, ..Start::default() }).fault;
    let found = std::thread::Builder::new().stack_size(bound).spawn(run).expect("a thread").join().expect("no crash");
    assert_eq!(found, Some(Fault::StackOverflow { depth: limit }));
    assert!(bound < 20_000 * 1024 + takt_jit::NATIVE_STACK * 2);
}

/// Counts at offset 64 for ever, three units a turn.
fn endless_loop() -> Program {
    single(|w| {
        let head = w.block();
        w.end(Term::Jump(head));
        w.open(head);
        let (a, one) = (w.load(takt_ir::Mem::I64, 64), w.int(1));
        let (b, site) = (w.local(Ty::I64), w.site());
        w.push(Inst::Op { op: Op::Add, dst: b, args: vec![a, one], site });
        w.store(b, takt_ir::Mem::I64, 64);
        w.push(Inst::Poll { cost: 3, site });
        w.end(Term::Jump(head));
    })
}

#[test]
fn an_endless_loop_ends_at_the_same_turn() {
    let p = Program { init: vec![], ..endless_loop() };
    let found = check(&p, Start { fuel: 100, slices: 2, ..Start::default() });
    assert_eq!((fault(&found).0, found.site, found.fuel), (Fault::Watchdog, 1, -3));
    // 100 units and two slices of 100: 100 turns are paid, the 101st is not.
    assert_eq!((found.image[64], found.image[16]), (101, 3));
}

#[test]
fn the_flag_stops_a_loop_at_the_next_poll() {
    let p = Program { init: vec![], ..endless_loop() };
    let found = check(&p, Start { flag: 4, ..Start::default() });
    assert_eq!((fault(&found).0, found.image[64]), (Fault::Stopped, 4));
}

#[test]
fn a_program_that_the_verifier_refuses_is_not_compiled() {
    let p = single(|w| w.push(Inst::Copy { dst: Local(7), src: Local(8) }));
    assert!(matches!(takt_jit::compile(&p), Err(takt_jit::JitError::Verify(_))));
}

#[test]
fn an_image_of_another_size_is_refused() {
    let good = endless_loop();
    let code = takt_jit::compile(&good).expect("good");
    let other = Program { image_size: 8192, ..good };
    assert_eq!(compiled(&other, &code, Start::default()).fault, Some(Fault::Panic));
}

#[test]
fn a_fault_in_a_result_position_is_no_result() {
    let mut w = Writer::new(&[], Some(Ty::F64), 0);
    let site = w.site();
    w.end(Term::Fault(Fault::WrongDelete, site));
    let found = check(&program(vec![w.body], Vec::new(), w.sites), Start::default());
    assert_eq!((found.fault, found.result, found.site), (Some(Fault::WrongDelete), 0, SiteId(1).0));
}
