//! Every operator on edge values and random ones: machine code must agree with [`Op::eval`] bit for bit (any NaN is the canonical one when stored).

use crate::bench::{Start, Writer, check, program, single};
use crate::generator::Random;
use takt_ir::{Base, Inst, Mem, Op, Ty, ops};

const INTS: [i64; 24] =
    [0, 1, -1, 2, -2, 3, 7, 8, 10, 16, 31, 32, 63, 64, 65, 127, 128, 255, 256, -128, 65_535, i32::MIN as i64, i64::MIN, i64::MAX];

fn floats() -> Vec<f64> {
    let mut all = vec![0.0, 0.5, 1.0, 1.5, 2.5, 0.499_999_999_999_999_94, 1e-310, 5e-324, 1e308, 3.4e38, 1e300, 0.1, 123_456.789];
    all.extend([9_223_372_036_854_775_807.0, 9_223_372_036_854_774_784.0, 4_503_599_627_370_497.5, 4_503_599_627_370_495.5, 8_388_607.5]);
    all.extend([f64::INFINITY, f64::NAN]);
    let negative: Vec<f64> = all.iter().map(|x| -x).collect();
    all.extend(negative);
    all
}

fn word(random: &mut Random, ty: Ty, third: bool) -> u64 {
    let edges = floats();
    let float = edges[random.below(edges.len())];
    match (ty, random.below(4)) {
        (Ty::F64, 0) => random.next(),
        (Ty::F64, 1) => ((random.next() as i64 >> 32) as f64 / 1024.0).to_bits(),
        (Ty::F64, _) => float.to_bits(),
        (Ty::F32, 0) => random.next() >> 32,
        (Ty::F32, 1) => u64::from(((random.next() as i64 >> 40) as f32 / 64.0).to_bits()),
        (Ty::F32, _) => u64::from((float as f32).to_bits()),
        (_, _) if third => [8, 16, 32, 64][random.below(4)],
        (_, 0) => random.next(),
        (_, 1) => (random.next() >> 32) % 70,
        (_, _) => INTS[random.below(INTS.len())] as u64,
    }
}

fn mem(ty: Ty) -> Mem {
    match ty {
        Ty::F32 => Mem::F32,
        Ty::F64 => Mem::F64,
        _ => Mem::I64,
    }
}

/// Many applications of one operator, results side by side in the image: operands are constants, or values the compiler does not see.
fn applications(op: Op, random: &mut Random, hidden: bool) {
    let mut cases = Vec::new();
    let mut image = vec![0; 1024];
    let p = single(|w| {
        for slot in 0..24u32 {
            let mut words: Vec<u64> = op.args().iter().enumerate().map(|(i, ty)| word(random, *ty, i == 2)).collect();
            if op.faults() && words[1] == 0 {
                words[1] = 1;
            }
            let args = operands(w, op, &words, hidden, slot, &mut image);
            let dst = w.local(op.result());
            let site = w.site();
            w.push(Inst::Op { op, dst, args, site });
            w.store(dst, mem(op.result()), 768 + 8 * slot);
            cases.push(words);
        }
    });
    let found = check(&takt_ir::Program { init: image, ..p }, Start::default());
    for (slot, words) in cases.iter().enumerate() {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&found.image[768 + 8 * slot..][..8]);
        let mut given = [0; 3];
        given[..words.len()].copy_from_slice(words);
        assert_eq!(u64::from_le_bytes(bytes), canonical(op.result(), op.eval(given)), "{op:?} {words:x?}");
    }
}

fn operands(w: &mut Writer, op: Op, words: &[u64], hidden: bool, slot: u32, image: &mut [u8]) -> Vec<takt_ir::Local> {
    let mut args = Vec::new();
    for (i, (ty, word)) in op.args().iter().zip(words).enumerate() {
        let offset = 32 + 24 * slot + 8 * i as u32;
        image[offset as usize..][..8].copy_from_slice(&word.to_le_bytes());
        let constant = !hidden || (i == 2 && slot.is_multiple_of(2));
        args.push(if constant { w.constant(*ty, *word) } else { w.load(mem(*ty), offset) });
    }
    args
}

fn canonical(ty: Ty, word: u64) -> u64 {
    match ty {
        Ty::F32 if f32::from_bits(word as u32).is_nan() => 0x7FC0_0000,
        Ty::F64 if f64::from_bits(word).is_nan() => 0x7FF8_0000_0000_0000,
        _ => word,
    }
}

#[test]
fn operators_on_unknown_values_agree_with_their_meaning() {
    let mut random = Random::new(1);
    for op in ops() {
        for _ in 0..8 {
            applications(*op, &mut random, true);
        }
    }
}

#[test]
fn operators_on_constants_agree_with_their_meaning() {
    let mut random = Random::new(2);
    for op in ops() {
        for _ in 0..4 {
            applications(*op, &mut random, false);
        }
    }
}

#[test]
fn rounding_is_half_away_from_zero() {
    let mut random = Random::new(3);
    let mut words: Vec<f64> = floats();
    words.extend((0..2000).map(|_| f64::from_bits(random.next())));
    words.extend((0..2000).map(|_| (random.next() as i64 >> 40) as f64 / 2.0));
    for chunk in words.chunks(60) {
        let mut image = vec![0; 1024];
        for (i, x) in chunk.iter().enumerate() {
            image[32 + 8 * i..][..8].copy_from_slice(&x.to_le_bytes());
        }
        let p = single(|w| {
            for i in 0..chunk.len() as u32 {
                let (x, dst, site) = (w.load(Mem::F64, 32 + 8 * i), w.local(Ty::I64), w.site());
                w.push(Inst::Op { op: Op::RoundF64, dst, args: vec![x], site });
                w.push(Inst::Store { src: dst, mem: Mem::I64, base: Base::Image, offset: 512 + 8 * i });
            }
        });
        check(&takt_ir::Program { init: image, ..p }, Start::default());
    }
}

#[test]
fn results_of_bodies_are_words() {
    for (ty, word) in [(Ty::I64, -5i64 as u64), (Ty::F32, u64::from(1.5f32.to_bits())), (Ty::F64, (-2.25f64).to_bits())] {
        let mut w = Writer::new(&[], Some(ty), 0);
        let value = w.constant(ty, word);
        w.end(takt_ir::Term::Return(Some(value)));
        let found = check(&program(vec![w.body], Vec::new(), w.sites), Start::default());
        assert_eq!(found.result, word);
    }
}
