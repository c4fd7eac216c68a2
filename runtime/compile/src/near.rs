//! Names that may have been meant.

use crate::scope::{Item, key};
use crate::types::ELEMENTARY;
use crate::unit::Compiler;

impl Compiler<'_> {
    /// The nearest known name, as help.
    pub(crate) fn suggest(&mut self, name: &str, types_only: bool) -> Option<String> {
        if !self.may_compare(self.names.len() + self.library_names.len()) {
            return None;
        }
        let wanted = key(name);
        let usable = |item: &Item| {
            !types_only || matches!(item, Item::Type(_) | Item::Ready(_) | Item::NativeBlock(_) | Item::Pou(_) | Item::Interface(_))
        };
        let elementary = ELEMENTARY.iter().map(|(n, _)| *n).chain(["STRING", "WSTRING"]).filter(|_| types_only);
        let known = self.names.iter().chain(&self.library_names).filter(|(_, i)| usable(i)).map(|(n, _)| n.as_str());
        nearest(&wanted, known.chain(elementary)).map(|n| format!("did you mean `{}`?", self.spelling(n)))
    }

    /// A name as it is declared.
    pub(crate) fn spelling<'n>(&'n self, name: &'n str) -> &'n str {
        let declared = match self.names.get(name).or_else(|| self.library_names.get(name)) {
            Some(Item::Pou(i)) => &self.pous[*i].tree.name.text,
            Some(Item::Type(i)) => &self.declared[*i].tree.name.text,
            Some(Item::Interface(i)) => &self.interfaces[*i].tree.name.text,
            Some(Item::Global(i)) => &self.globals[*i].decl.name.text,
            Some(Item::List(i)) => &self.lists[*i].name,
            _ => name,
        };
        // An alias is what was asked for, not what it stands for.
        if key(declared) == name { declared } else { name }
    }
}

/// The candidate with the smallest edit distance, if it is near; ties by name.
pub(crate) fn nearest<N: AsRef<str> + Ord>(wanted: &str, known: impl Iterator<Item = N>) -> Option<N> {
    let wanted: Vec<char> = wanted.chars().collect();
    let limit = (1 + wanted.len() / 4).min(wanted.len().saturating_sub(1));
    known.filter_map(|n| Some((distance(&wanted, n.as_ref(), limit)?, n))).min().map(|(_, n)| n)
}

fn distance(a: &[char], b: &str, limit: usize) -> Option<usize> {
    // A letter has one to four bytes.
    if b.len() + limit < a.len() || b.len() > (a.len() + limit) * 4 {
        return None;
    }
    let b: Vec<char> = b.chars().collect();
    if a.len().abs_diff(b.len()) > limit {
        return None;
    }
    let mut before: Vec<usize> = Vec::new();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut next = vec![i + 1];
        for (j, y) in b.iter().enumerate() {
            let replaced = row[j] + usize::from(x != y);
            let mut least = replaced.min(row[j + 1] + 1).min(next[j] + 1);
            // Two letters in the other order are one slip.
            if i > 0 && j > 0 && *x == b[j - 1] && a[i - 1] == *y {
                least = least.min(before[j - 1] + 1);
            }
            next.push(least);
        }
        before = std::mem::replace(&mut row, next);
    }
    row.last().copied().filter(|d| *d <= limit)
}
