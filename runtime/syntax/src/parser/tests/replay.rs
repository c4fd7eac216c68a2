//! The seeds of the fuzzer, as they are and changed in a fixed manner: a short run of it for every build.

use super::*;

const SEEDS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/seeds/parse_text");

fn seeds() -> Vec<Vec<u8>> {
    let folder = std::fs::read_dir(SEEDS).expect("the folder of seeds");
    let mut paths: Vec<_> = folder.map(|entry| entry.expect("a seed").path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).expect("a seed")).collect()
}

fn survives(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let (file, diagnostics) = parse(FILE, &text);
    for span in diagnostics.iter().flat_map(|d| d.notes.iter().map(|note| note.span).chain([d.span])) {
        assert!(text.get(span.start as usize..span.end as usize).is_some(), "{span:?} in {text}");
    }
    drop(file);
}

struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound.max(1) as u64) as usize
    }

    /// A piece of a text, up to 40 bytes long.
    fn piece<'a>(&mut self, text: &'a [u8]) -> &'a [u8] {
        let from = self.below(text.len());
        &text[from..(from + self.below(40)).min(text.len())]
    }
}

#[test]
fn seeds_and_what_comes_of_them_are_survived() {
    let seeds = seeds();
    assert!(seeds.len() >= 10);
    seeds.iter().for_each(|seed| survives(seed));
    let mut random = Random(0x1234_5678_9ABC_DEF1);
    for _ in 0..10_000 {
        let mut text = seeds[random.below(seeds.len())].clone();
        for _ in 0..1 + random.below(6) {
            let at = random.below(text.len() + 1);
            let other = &seeds[random.below(seeds.len())];
            match random.below(4) {
                0 => text.truncate(at),
                1 => drop(text.drain(at..(at + random.below(20)).min(text.len()))),
                2 => drop(text.splice(at..at, random.piece(other).to_vec())),
                _ => text.insert(at, random.below(256) as u8),
            }
        }
        survives(&text);
    }
}
