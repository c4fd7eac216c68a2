//! Random programs: thousands in the usual test run, as many as asked for by `TAKT_CASES`.

use crate::bench::{Start, check};
use crate::generator::{Random, random_program};
use std::collections::BTreeMap;

fn cases() -> u64 {
    std::env::var("TAKT_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(2000)
}

/// What the run of a seed starts with.
pub fn start(seed: u64) -> Start {
    let mut random = Random::new(seed ^ 0x5EED);
    let flag = if random.below(4) == 0 { 1 + random.below(4) as u32 } else { 0 };
    Start { fuel: random.below(600) as i64, slices: random.below(3) as u64, flag, depth_limit: 1 + random.below(16) as u32 }
}

#[test]
fn random_programs_end_alike() {
    let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
    for seed in 0..cases() {
        let program = random_program(seed);
        let found = check(&program, start(seed));
        *seen.entry(found.fault.map_or("none", |fault| fault.name())).or_default() += 1;
    }
    println!("{seen:?}");
    if cases() >= 2000 {
        for name in ["none", "index", "division-by-zero", "null-pointer", "wild-pointer", "stack-overflow", "watchdog", "block", "stopped"]
        {
            assert!(seen.get(name).is_some_and(|n| *n >= 5), "{name} is rare: {seen:?}");
        }
    }
}
