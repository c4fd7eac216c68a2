//! What a command may reach, and what it leaves behind when it is refused or taken back.

use super::*;

const NAMES: &str = "
type string 3
type bit 2
type pointer 1
type array 1 [0..3]
heap 1024 1024
global \"G.fixed\" type 1 at 200 bare constant
global \"G.free\" type 1 at 208 bare
";
const DINT: u32 = 1;
const TEXT: u32 = 3;
const BIT: u32 = 4;

fn engine() -> Engine {
    let text = format!("{NAMES}task \"Main\" cyclic 1000000 priority 0 entry 0 stack 2048 256\n{}", mark("A", "v0 = const 1"));
    load(program(&text), Options::default(), Box::new(NoBus)).unwrap()
}

fn release(offset: u32, ty: u32, restore: bool) -> Command {
    Command::Release { place: place(offset, ty), restore }
}

#[test]
fn only_elementary_variables_that_last_are_written() {
    let mut engine = engine();
    let mut refused = |offset: u32, ty: u32, len: usize, error: AccessError| {
        let (place, before) = (place(offset, ty), engine.image().to_vec());
        assert_eq!(engine.write(place, &vec![7; len]), Err(error.into()), "{offset} {ty}");
        assert_eq!(engine.force(place, &vec![7; len]), Err(error.into()), "{offset} {ty}");
        assert!(engine.image() == before && engine.force_count() == 0);
    };
    refused(208, 5, 8, AccessError::NotElementary);
    refused(208, 6, 16, AccessError::NotElementary);
    refused(208, 99, 4, AccessError::Outside);
    refused(8, DINT, 4, AccessError::Outside);
    refused(4093, DINT, 4, AccessError::Outside);
    refused(u32::MAX, DINT, 4, AccessError::Outside);
    refused(200, DINT, 4, AccessError::Constant);
    refused(197, DINT, 4, AccessError::Constant);
    refused(203, 0, 1, AccessError::Constant);
    refused(1021, DINT, 4, AccessError::NotLasting);
    refused(2047, 0, 1, AccessError::NotLasting);
    refused(2045, DINT, 4, AccessError::NotLasting);
    refused(2303, 0, 1, AccessError::NotLasting);
    refused(208, TEXT, 3, AccessError::Size { expected: 4, found: 3 });
    engine.write(place(208, DINT), &[1, 2, 3, 4]).unwrap();
    engine.write(place(204, 0), &[9]).unwrap();
    engine.write(place(2304, 0), &[9]).unwrap();
    assert_eq!(&engine.image()[200..212], [0, 0, 0, 0, 9, 0, 0, 0, 1, 2, 3, 4]);
}

#[test]
fn a_release_keeps_or_restores() {
    let mut engine = engine();
    let value = |engine: &Engine| engine.image()[208..212].to_vec();
    engine.write(place(208, DINT), &[1, 1, 1, 1]).unwrap();
    engine.force(place(208, DINT), &[2; 4]).unwrap();
    engine.force(place(208, DINT), &[3; 4]).unwrap();
    assert_eq!((engine.force_count(), engine.force_at(0).map(|f| f.before.to_vec())), (1, Some(vec![1; 4])), "the first value counts");
    assert_eq!(engine.command(&release(208, 0, true)), Err(AccessError::NotForced.into()), "of another type");
    engine.command(&release(208, DINT, true)).unwrap();
    assert_eq!((value(&engine), engine.force_count()), (vec![1; 4], 0));
    engine.force(place(208, DINT), &[4; 4]).unwrap();
    engine.command(&release(208, DINT, false)).unwrap();
    assert_eq!(value(&engine), [4; 4]);
}

#[test]
fn forces_on_the_same_bytes_are_taken_back_in_the_order_they_were_made() {
    let mut engine = engine();
    engine.write(place(208, DINT), &[0xF0, 1, 1, 1]).unwrap();
    engine.force(place(208, BIT), &[4]).unwrap();
    engine.force(place(208, DINT), &[2; 4]).unwrap();
    engine.force(place(212, TEXT), b"abc\0").unwrap();
    steps(&mut engine, 2);
    assert_eq!(&engine.image()[208..216], b"\x02\x02\x02\x02abc\0");
    engine.command(&Command::ReleaseAll { restore: true }).unwrap();
    assert_eq!(&engine.image()[208..216], b"\xF0\x01\x01\x01\0\0\0\0");
    assert_eq!(engine.force_count(), 0);
}

#[test]
fn a_force_on_a_bit_leaves_its_neighbours_alone() {
    let mut engine = engine();
    engine.force(place(208, BIT), &[0xFF]).unwrap();
    assert_eq!(engine.image()[208], 4);
    engine.write(place(208, 0), &[0x41]).unwrap();
    steps(&mut engine, 1);
    assert_eq!(engine.image()[208], 0x45);
    engine.command(&release(208, BIT, true)).unwrap();
    assert_eq!(engine.image()[208], 0x41);
}

#[test]
fn there_is_room_for_so_many_forces_and_no_more() {
    let mut engine = engine();
    let count = (208..1024).chain(2304..4096).map(|offset| engine.force(place(offset, 0), &[1])).filter(Result::is_ok).count();
    assert_eq!((count, engine.force_count()), (1024, 1024));
    let refused = engine.force(place(4000, 0), &[1]).unwrap_err().to_string();
    assert_eq!(refused, "there is room for 1024 forces with 65536 bytes together; release some");
    assert_eq!(engine.image()[4000], 0);
    engine.command(&release(300, 0, true)).unwrap();
    engine.force(place(4000, 0), &[1]).unwrap();
    assert_eq!(engine.force_at(1023).map(|f| f.place.offset), Some(4000));
}

#[test]
fn a_halt_and_a_reset_are_commands() {
    let mut engine = engine();
    steps(&mut engine, 1);
    engine.command(&Command::Halt).unwrap();
    assert_eq!(engine.fault().map(|record| record.fault), Some(Fault::Stopped));
    engine.command(&Command::Reset(Reset::Warm)).unwrap();
    steps(&mut engine, 1);
    assert!(engine.fault().is_none());
}
