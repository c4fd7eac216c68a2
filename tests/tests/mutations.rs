//! Broken programs: every mutation of a real source is refused or compiles, and what compiles verifies. Nothing panics, nothing hangs.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use takt_tests::{bench, case};

/// Mutated programs per run; `TAKT_MUTATIONS` asks for more.
const COUNT: usize = 3000;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    }
}

fn sources(folder: &Path, found: &mut Vec<String>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "st") {
            let text = std::fs::read_to_string(&path).expect("UTF-8");
            let cases = case::cases(&text);
            if cases.is_empty() { found.push(text) } else { found.extend(cases.into_iter().map(|c| c.source)) }
        }
    }
}

/// Words and signs with the space before them.
fn pieces(text: &str) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut start = 0;
    let mut word = false;
    for (at, c) in text.char_indices() {
        let now = c.is_alphanumeric() || c == '_' || c == '#';
        if at > start && !(word && now) {
            pieces.push(&text[start..at]);
            start = at;
        }
        word = now;
    }
    pieces.push(&text[start..]);
    pieces
}

const INTRUDERS: &[&str] = &[
    "^",
    ".",
    "[",
    "]",
    "(",
    ")",
    ":=",
    "=>",
    ";",
    "16#FFFFFFFFFFFFFFFF",
    "-9223372036854775808",
    "1e308",
    "'a",
    "\"",
    "(*",
    "{",
    "END_IF",
    "END_VAR",
    "PROGRAM p",
    "VAR",
    "ADR",
    "SIZEOF",
    "ARRAY[0..99999999] OF",
    "POINTER TO",
    "REFERENCE TO",
    "STRING(0)",
    "T#1d",
    "MOD 0",
    "/ 0",
    "a",
    "main",
    "REF=",
    "..",
    "%IX0.0",
    "THIS^",
    "SUPER^",
    "FOR",
    "CASE",
    "JMP x;",
    "x:",
    "NOT",
    "**",
    "TRUE",
    "é",
    "变量",
];

fn mutate(text: &str, random: &mut Random) -> String {
    let mut parts: Vec<&str> = pieces(text);
    for _ in 0..1 + random.below(4) {
        let at = random.below(parts.len());
        match random.below(5) {
            0 => drop(parts.remove(at)),
            1 => parts.insert(at, INTRUDERS[random.below(INTRUDERS.len())]),
            2 => {
                let other = random.below(parts.len());
                parts.swap(at, other);
            }
            3 => parts.insert(at, parts[random.below(parts.len())]),
            _ => parts[at] = INTRUDERS[random.below(INTRUDERS.len())],
        }
        if parts.is_empty() {
            break;
        }
    }
    parts.concat()
}

#[test]
fn no_mutation_of_a_program_panics_hangs_or_passes_unverified() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut texts = Vec::new();
    for folder in ["tests/suite", "stdlib-fb/st", "programs"] {
        sources(&root.join(folder), &mut texts);
    }
    let count = std::env::var("TAKT_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(COUNT);
    let mut compiled = 0;
    for seed in 0..count {
        let mut random = Random(seed as u64);
        let text = mutate(&texts[random.below(texts.len())], &mut random);
        let start = Instant::now();
        let result = std::panic::catch_unwind(|| bench::compile_with(&text, &takt_compile::Options { lint: true, ..Default::default() }));
        let Ok(output) = result else { panic!("seed {seed} panics:\n{text}") };
        assert!(start.elapsed() < Duration::from_secs(20), "seed {seed} takes too long:\n{text}");
        if let Some(program) = output.program {
            compiled += 1;
            if let Err(e) = takt_ir::verify(&program) {
                panic!("seed {seed} compiles to what the verifier refuses: {e}\n{text}");
            }
        }
    }
    assert!(compiled > count / 50, "only {compiled} of {count} mutations compiled: the test has lost its edge");
}
