//! What goes in comes out, and nothing that is damaged does harm.

use super::*;

const SIZE: BusSize = BusSize { drives: 3, bits_in: 5, bits_out: 2, analog_in: 2, analog_out: 0 };

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }
    fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }
}

fn inputs(random: &mut Random, io: &mut ProcessImage) {
    for drive in &mut io.drives_in {
        match random.below(4) {
            0 => {
                let any = random.next();
                *drive = DriveIn {
                    online: any & 1 != 0,
                    status_word: any as u16,
                    mode_display: (any >> 9) as i8,
                    position: random.next() as i64,
                    velocity: any as i32,
                    torque: (any >> 20) as i16,
                    error_code: (any >> 30) as u16,
                    following_error: (any >> 32) as i32,
                    digital_inputs: (any >> 16) as u32,
                };
            }
            1 => drive.position = drive.position.wrapping_add(17),
            _ => {}
        }
    }
    if random.below(3) == 0 {
        io.bits_in[random.below(5) as usize] ^= 1;
        io.analog_in[random.below(2) as usize] = f64::from_bits(random.next());
    }
}

fn command(random: &mut Random) -> Command {
    let place = Place { offset: random.next() as u32, ty: TypeId(random.below(100) as u32) };
    let bytes = vec![random.next() as u8; random.below(20) as usize].into_boxed_slice();
    match random.below(7) {
        0 => Command::Write { place, bytes },
        1 => Command::Force { place, bytes },
        2 => Command::Release { place, restore: random.below(2) == 0 },
        3 => Command::ReleaseAll { restore: true },
        4 => Command::Reset(Reset::Cold),
        5 => Command::ResetTask(random.below(3) as u32),
        _ => Command::Halt,
    }
}

/// A stretch of items, encoded, with the inputs of each exchange.
fn stretch(seed: u64) -> (Vec<u8>, Vec<(Item, Option<ProcessImage>)>) {
    let mut random = Random(seed);
    let (mut encoder, mut out, mut items) = (Encoder::new(SIZE), Vec::new(), Vec::new());
    let (mut io, mut now) = (ProcessImage::new(SIZE), 0);
    encoder.mark(&mut out);
    items.push((Item::Mark, None));
    for _ in 0..200 {
        let item = match random.below(12) {
            0 => Item::Mark,
            1..=3 => {
                now += [1_000_000, 1_000_000, 1_234_567][random.below(3) as usize];
                Item::Step(Time(now))
            }
            4 => Item::Event(Event::Scan { task: random.below(3) as usize, now: Time(now + random.below(900) as i64), depth: 0, at: 0 }),
            5 => Item::Event(Event::Scan { task: 1, now: Time(now), depth: 2, at: random.next() }),
            6 => Item::Event(Event::Cut { depth: 1, at: random.below(1 << 20), fault: Fault::Watchdog }),
            7 => Item::Event(Event::Stop { depth: 1, entry: true, fault: Fault::Index { value: -5, low: 0, high: i64::MAX } }),
            8 => Item::Command(command(&mut random)),
            9 => match random.below(3) {
                0 => Item::Take(random.next(), Err(HostError::Os(-7))),
                1 => Item::Refused(random.below(99), HostError::Busy),
                _ => Item::Take(3, Ok(Chunk { data: vec![9; random.below(300) as usize], file_size: random.next() })),
            },
            10 => Item::Exchange(Err(IoFault::Station { address: 1, expected: 3, found: random.below(9) as u16 })),
            _ => Item::Exchange(Ok(())),
        };
        let mut seen = None;
        match &item {
            Item::Mark => encoder.mark(&mut out),
            Item::Step(now) => encoder.step(&mut out, *now),
            Item::Event(event) => encoder.event(&mut out, event),
            Item::Exchange(result) => {
                inputs(&mut random, &mut io);
                encoder.exchange(&mut out, *result, &io);
                seen = Some(io.clone());
            }
            Item::Command(command) => encoder.command(&mut out, command),
            Item::Take(call, result) => encoder.take(&mut out, *call, result),
            Item::Refused(call, error) => encoder.refused(&mut out, *call, *error),
        }
        items.push((item, seen));
    }
    (out, items)
}

fn bits(io: &ProcessImage) -> (Vec<DriveIn>, Vec<u8>, Vec<u64>) {
    (io.drives_in.clone(), io.bits_in.clone(), io.analog_in.iter().map(|v| v.to_bits()).collect())
}

#[test]
fn everything_comes_back() {
    for seed in 0..200 {
        let (bytes, items) = stretch(seed);
        let (mut decoder, mut at) = (Decoder::new(SIZE), 0);
        for (item, io) in items {
            let found = decoder.next(&bytes, &mut at).unwrap().expect("there is more");
            assert_eq!(found, item, "seed {seed}");
            if let Some(io) = io {
                assert_eq!(bits(decoder.io()), bits(&io), "seed {seed}");
            }
        }
        assert_eq!(decoder.next(&bytes, &mut at), Ok(None));
    }
}

#[test]
fn a_machine_at_rest_costs_a_few_bytes_a_step() {
    let (mut encoder, mut out) = (Encoder::new(SIZE), Vec::new());
    let mut io = ProcessImage::new(SIZE);
    for step in 0..1000 {
        io.drives_in[0].position += 250;
        encoder.step(&mut out, Time(step * 1_000_000));
        encoder.event(&mut out, &Event::Scan { task: 0, now: Time(step * 1_000_000), depth: 0, at: 0 });
        encoder.exchange(&mut out, Ok(()), &io);
    }
    assert!(out.len() < 8000, "{}", out.len());
}

#[test]
fn what_is_cut_ends_with_its_place() {
    let (bytes, _) = stretch(5);
    for cut in 0..bytes.len() {
        let (mut decoder, mut at) = (Decoder::new(SIZE), 0);
        while let Ok(Some(_)) = decoder.next(&bytes[..cut], &mut at) {}
        assert!(at <= cut);
    }
}

#[test]
fn random_damage_is_refused_or_means_something() {
    let mut random = Random(11);
    for seed in 0..400 {
        let (mut bytes, _) = stretch(seed);
        for _ in 0..1 + random.below(8) {
            let at = random.below(bytes.len() as u64) as usize;
            bytes[at] = random.next() as u8;
        }
        let (mut decoder, mut at) = (Decoder::new(SIZE), 0);
        while let Ok(Some(_)) = decoder.next(&bytes, &mut at) {}
    }
    let huge = [TAKE, 1, 0, 1, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F];
    assert_eq!(Decoder::new(SIZE).next(&huge, &mut 0), Err(Damaged { at: huge.len(), expected: "data of a file" }));
}
