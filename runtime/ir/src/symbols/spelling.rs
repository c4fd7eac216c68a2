//! What was meant by a misspelt name.

/// The candidate closest to a name, if it is close enough to be meant: a third of its letters wrong at the most, neighbours swapped count once.
/// Case does not matter; of equals, the first.
pub(crate) fn closest<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let limit = (name.chars().count() / 3).max(1);
    let ranked = candidates.map(|c| (distance(name, c), c)).filter(|(d, _)| *d <= limit && *d > 0);
    ranked.min_by_key(|(d, _)| *d).map(|(_, c)| c)
}

/// Letters to insert, drop, change or swap with their neighbour (optimal string alignment).
fn distance(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|s| s.chars().flat_map(char::to_lowercase).collect::<Vec<_>>());
    let width = b.len() + 1;
    let mut table: Vec<usize> = vec![0; (a.len() + 1) * width];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            table[i * width + j] = if i == 0 || j == 0 {
                i + j
            } else {
                let at = |di: usize, dj: usize| table[(i - di) * width + j - dj];
                let change = at(1, 1) + usize::from(a[i - 1] != b[j - 1]);
                let best = change.min(at(0, 1) + 1).min(at(1, 0) + 1);
                let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                if swapped { best.min(at(2, 2) + 1) } else { best }
            };
        }
    }
    table[a.len() * width + b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_single_mistakes() {
        for (a, b, d) in [("abc", "ABC", 0), ("abc", "abd", 1), ("abc", "acb", 1), ("abc", "abcd", 1), ("abc", "", 3), ("", "", 0)] {
            assert_eq!(distance(a, b), d, "{a} {b}");
        }
        assert_eq!(closest("Statrt", ["Stop", "Start", "State"].into_iter()), Some("Start"));
        assert_eq!(closest("xyz", ["Stop"].into_iter()), None);
    }
}
