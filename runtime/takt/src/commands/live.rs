//! The live line: what the manifest wants shown, on one line of the terminal, ten times a second.

use crate::clock;
use crate::language::{self, Word};
use crate::machine::Shown;
use crate::realtime::samples::Look;
use crate::values;
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Nanoseconds between two lines.
const PERIOD: u64 = 100_000_000;

/// The line, if standard error is a terminal.
pub(super) struct Live {
    items: Vec<Shown>,
    on: bool,
    next: u64,
    shown: bool,
    looks: u32,
    forces: Arc<AtomicUsize>,
}

impl Live {
    pub(super) fn new(wanted: bool, items: &[Shown]) -> Self {
        Self {
            items: items.to_vec(),
            on: wanted && std::io::stderr().is_terminal(),
            next: 0,
            shown: false,
            looks: 0,
            forces: Arc::default(),
        }
    }

    /// Where it finds how many variables are forced.
    pub(super) fn show_forces(&mut self, forces: Arc<AtomicUsize>) {
        self.forces = forces;
    }

    /// Whether there is a terminal.
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    /// The variables that it shows.
    pub(super) fn places(&self) -> impl Iterator<Item = takt_ir::Place> {
        self.items.iter().map(|shown| shown.place)
    }

    /// Draws the line anew when it is time. The clock is asked every 16th scan only.
    pub(super) fn show(&mut self, machine: &impl Look) {
        self.looks = self.looks.wrapping_add(1);
        if !self.on || self.looks % 16 != 1 {
            return;
        }
        let now = clock::nanoseconds();
        if now < self.next {
            return;
        }
        self.next = now + PERIOD;
        self.shown = true;
        let colour = anstream::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        let (dim, plain) = if colour { ("\x1b[2m", "\x1b[0m") } else { ("", "") };
        let forces = match self.forces.load(Ordering::Relaxed) {
            0 => String::new(),
            count => format!("[{count} {}] ", Word::Forced.text(language::of_environment())),
        };
        let text = format!("{forces}{}", line(&self.items, machine, width().saturating_sub(forces.chars().count())));
        // A terminal that cannot be written to is no reason to stop a machine.
        let _ = write!(std::io::stderr(), "\r\x1b[K{dim}{:>9.3} s{plain}  {text}", machine.time().seconds());
        let _ = std::io::stderr().flush();
    }

    /// Takes the line away.
    pub(super) fn clear(&mut self) {
        if std::mem::take(&mut self.shown) {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

/// Characters that fit behind the time.
fn width() -> usize {
    let columns = crate::platform::columns().unwrap_or(100);
    columns.saturating_sub(15).max(20)
}

fn line(items: &[Shown], machine: &impl Look, width: usize) -> String {
    let types = machine.types();
    let items = items.iter().map(|shown| {
        let value = values::for_people(types, shown.place, machine.look(shown.place), shown.item.digits, shown.item.scale);
        [shown.item.label.as_str(), &value, shown.item.unit.as_str()]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join(" ")
    });
    let text = items.collect::<Vec<_>>().join("   ");
    text.chars().filter(|c| !c.is_control()).take(width).collect()
}
