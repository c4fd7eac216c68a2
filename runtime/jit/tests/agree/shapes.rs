//! Properties of compiled programs that random ones do not reach: size, threads, large images, memory.

use crate::bench::{Start, Writer, check, compiled, interpreted, program, single};
use takt_ir::{Base, BodyId, Inst, Mem, Op, Program, Term, Ty};

/// Many bodies, each a long sum that the first one collects.
fn large(bodies: u32, length: u32) -> Program {
    let mut all = Vec::new();
    let mut main = Writer::new(&[], Some(Ty::I64), 0);
    let mut sum = main.int(0);
    let mut sites = 10_000;
    for i in 1..=bodies {
        let (part, next, site) = (main.local(Ty::I64), main.local(Ty::I64), main.site());
        let argument = main.int(i.into());
        main.push(Inst::Call { body: BodyId(i), args: vec![argument], dst: Some(part), site });
        main.push(Inst::Op { op: Op::Add, dst: next, args: vec![sum, part], site });
        sum = next;
        let mut w = Writer::new(&[Ty::I64], Some(Ty::I64), sites);
        let mut value = takt_ir::Local(0);
        for k in 0..length {
            let (load, dst, site) = (w.load(Mem::U16, 16 + (k * 6 + i) % 1000), w.local(Ty::I64), w.site());
            w.push(Inst::Op { op: Op::Add, dst, args: vec![value, load], site });
            value = dst;
        }
        w.end(Term::Return(Some(value)));
        sites = w.sites;
        all.push(w.body);
    }
    main.end(Term::Return(Some(sum)));
    all.insert(0, main.body);
    program(all, Vec::new(), sites)
}

#[test]
fn large_programs_are_compiled_by_several_threads() {
    let found = check(&large(60, 200), Start::default());
    assert_ne!(found.result, 0);
}

#[test]
fn code_is_sent_to_another_thread_and_freed_there() {
    let p = large(3, 10);
    let expected = interpreted(&p, Start::default());
    for _ in 0..50 {
        let code = takt_jit::compile(&p).expect("good");
        assert!(code.code_size() > 100);
        let found = std::thread::scope(|scope| scope.spawn(|| compiled(&p, &code, Start::default())).join().expect("no crash"));
        assert!(found == expected);
    }
}

#[test]
fn offsets_beyond_two_gigabytes_are_reached() {
    const FAR: u32 = 0x9000_0000;
    let mut p = single(|w| {
        let value = w.int(0x1234_5678);
        w.store(value, Mem::I64, FAR);
        w.push(Inst::Move { dst: Base::Image, dst_offset: 64, src: Base::Image, src_offset: FAR, len: 4 });
        let (address, index, site) = (w.local(Ty::Addr(8)), w.int(1), w.site());
        w.push(Inst::Index { dst: address, base: Base::Image, offset: 0x8000_0000, index, low: 0, high: 1, stride: 0x1000_0000, site });
        let far = w.local(Ty::I64);
        w.push(Inst::Load { dst: far, mem: Mem::U16, base: Base::Local(address), offset: 0 });
        w.store(far, Mem::I64, 72);
    });
    p.image_size = FAR + 0x1000;
    let code = takt_jit::compile(&p).expect("good");
    let found = compiled(&p, &code, Start::default());
    assert_eq!(
        (found.code, &found.image[64..76]),
        (0, &[0x78, 0x56, 0x34, 0x12, found.image[68], found.image[69], found.image[70], found.image[71], 0x78, 0x56, 0, 0][..])
    );
}

#[test]
fn a_body_without_end_of_its_entry_block_may_be_its_own_target() {
    // Block 0 as the head of a loop.
    let p = single(|w| {
        let done = w.block();
        let (a, one, b, site) = (w.load(Mem::U8, 64), w.int(1), w.local(Ty::I64), w.site());
        w.push(Inst::Op { op: Op::Add, dst: b, args: vec![a, one], site });
        w.store(b, Mem::U8, 64);
        w.push(Inst::Poll { cost: 1, site });
        w.end(Term::Branch { cond: a, then: takt_ir::BlockId(0), other: done });
        w.open(done);
    });
    assert_eq!(check(&p, Start::default()).code, 0);
}
