//! Makes a program that shows a finding smaller: lines are left out while it still shows one of that kind.

use crate::agreement::{Finding, examine};
use crate::generate::Generated;

/// Attempts before the program is taken as it is.
const ATTEMPTS: usize = 4000;

/// The smallest program found that shows a finding of the same kind.
pub fn shrink(generated: &Generated, finding: &Finding) -> (Generated, Finding) {
    let mut best = (generated.clone(), finding.clone());
    let mut attempts = 0;
    let mut length = best.0.source.lines().count() / 2;
    while length > 0 && attempts < ATTEMPTS {
        let mut at = 0;
        let mut shorter = false;
        while at < best.0.source.lines().count() && attempts < ATTEMPTS {
            attempts += 1;
            match without(&best, at, length) {
                Some(found) => {
                    best = found;
                    shorter = true;
                }
                None => at += 1.max(length / 2),
            }
        }
        if !shorter {
            length = if length > 8 { length / 2 } else { length - 1 };
        }
    }
    best
}

/// The program without some lines, if it shows a like finding.
fn without((program, finding): &(Generated, Finding), at: usize, length: usize) -> Option<(Generated, Finding)> {
    let kept = program.source.lines().enumerate().filter(|(i, _)| !(at..at + length).contains(i));
    let source: String = kept.flat_map(|(_, line)| [line, "\n"]).collect();
    let smaller = Generated { source, ..program.clone() };
    match examine(&smaller) {
        // A refused program is only like another one if it is refused with the same words.
        Err(Finding::Rejected(text)) => {
            let Finding::Rejected(wanted) = finding else { return None };
            let words = |t: &str| t.lines().nth(1).and_then(|l| l.split_once(": ")).map(|(_, words)| words.to_string());
            let alike = words(&text) == words(wanted) && text.lines().count() <= wanted.lines().count();
            alike.then_some((smaller, Finding::Rejected(text)))
        }
        Err(found) if found.is_like(finding) => Some((smaller, found)),
        _ => None,
    }
}
