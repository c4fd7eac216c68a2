//! Bits and areas: what is written, forced, wired and mapped leaves the neighbours alone.

use super::*;

/// A BOOL type 0, the bit 3 type 3; a body that inverts FLAG into OTHER.
fn invert(more: &str) -> String {
    format!(
        "type bit 3
{more}
task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256
body \"MAIN\" () frame 0 @0
  local i64, i64, i64
b0:
  v0 = load.bool image+{FLAG}
  v1 = const 0
  v2 = eq v0, v1
  store.bool image+{OTHER}, v2
  return
"
    )
}

const BIT: u32 = 3;

#[test]
fn a_bit_is_written_forced_and_wired_alone() {
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let seen = std::rc::Rc::new(std::cell::RefCell::new(ProcessImage::default()));
        let (output, input) = (place(48, BIT), place(49, BIT));
        let wires = vec![wire("Q", output, Channel::BitOut(0), Some(Signal::Bit(false))), wire("I", input, Channel::BitIn(0), None)];
        let options = Options { executor, wires, ..Options::default() };
        let mut engine = load(program(&invert("")), options, Box::new(Terminals { seen: seen.clone() })).unwrap();
        engine.write(place(48, 0), &[0xF0]).unwrap();
        engine.write(place(49, 0), &[0xF0]).unwrap();
        engine.write(output, &[0xFF]).unwrap();
        steps(&mut engine, 2);
        assert_eq!((engine.image()[48], engine.image()[49], seen.borrow().bits_out[0]), (0xF8, 0xF8, 1));
        engine.force(output, &[0]).unwrap();
        engine.write(place(48, 0), &[0x0F]).unwrap();
        steps(&mut engine, 2);
        assert_eq!((engine.image()[48], engine.image()[49], seen.borrow().bits_out[0]), (0x07, 0xF0, 0));
        engine.force(output, &[0x08]).unwrap();
        engine.halt();
        steps(&mut engine, 1);
        assert_eq!(seen.borrow().bits_out[0], 0, "the safe value");
    }
}

#[test]
fn mapped_variables_follow_their_addresses_and_forces_hold_against_them() {
    let mapped = format!(
        "area I at 48 size 1\narea Q at 50 size 2\narea M at 52 size 4
mapped I type 0 at {FLAG} to 48 bit 3
mapped Q type 0 at {OTHER} to 51 bit 7
mapped M type 1 at 56 to 52"
    );
    both(&invert(&mapped), Options::default, |mut engine| {
        steps(&mut engine, 1);
        assert_eq!((engine.image()[FLAG as usize], engine.image()[51]), (0, 0x80));
        engine.write(place(48, 0), &[0x08]).unwrap();
        engine.write(place(51, 0), &[0xFF]).unwrap();
        engine.write(place(52, 1), &7i32.to_le_bytes()).unwrap();
        steps(&mut engine, 1);
        assert_eq!((engine.image()[FLAG as usize], engine.image()[51], number(&engine, 56)), (1, 0x7F, 7));
        engine.force(place(51, 0), &[0xAA]).unwrap();
        engine.force(place(48, 0), &[0x00]).unwrap();
        steps(&mut engine, 1);
        assert_eq!((engine.image()[FLAG as usize], engine.image()[51]), (0, 0xAA));
        engine.force(place(56, 1), &9i32.to_le_bytes()).unwrap();
        steps(&mut engine, 1);
        assert_eq!(number(&engine, 52), 9, "what was forced differs from what was taken");
    });
}
