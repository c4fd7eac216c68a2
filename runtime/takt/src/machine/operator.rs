//! The operator's script: one step after the other, between scans.

use super::Watch;
use super::bus::Bus;
use takt_abi::{Fault, Time};
use takt_engine::{Command, Engine};

/// A step whose names are resolved.
#[derive(Debug, Clone, Default)]
pub(crate) struct BoundStep {
    /// Wait once the condition holds.
    pub(crate) after: Time,
    /// What is written.
    pub(crate) set: Vec<Command>,
    /// Writes back what was there before, in the opposite order; filled when the step acts.
    pub(crate) back: Vec<Command>,
    /// Write back after this time.
    pub(crate) pulse: Option<Time>,
    /// Inputs of the simulated bus.
    pub(crate) inputs: Vec<(String, f64)>,
}

/// What the current step is about.
#[derive(Debug, Clone, Default)]
enum Phase {
    /// Its condition does not hold yet.
    #[default]
    Waiting,
    /// It acts at this time.
    Delayed(Time),
    /// The variables go back at this time.
    Pulsing(Time),
}

/// Who plays the operator.
#[derive(Debug, Default)]
pub(crate) struct Operator {
    steps: Vec<(BoundStep, Option<Watch>)>,
    current: usize,
    phase: Phase,
    failed: Option<Fault>,
}

impl Operator {
    pub(crate) fn new(steps: Vec<BoundStep>, waits: Vec<Option<Watch>>) -> Self {
        Self { steps: steps.into_iter().zip(waits).collect(), ..Self::default() }
    }

    /// The condition that the current step waits for.
    pub(crate) fn waiting_for(&self) -> Option<&str> {
        let (_, watch) = self.steps.get(self.current)?;
        watch.as_ref().map(|watch| watch.text.as_str())
    }

    /// The condition that could not be evaluated.
    pub(crate) fn failed(&self) -> Option<(&str, Fault)> {
        self.failed.map(|fault| (self.waiting_for().unwrap_or("?"), fault))
    }

    /// Does what is to be done before the scan at `now`. A step takes at least one scan.
    pub(crate) fn act(&mut self, engine: &mut Engine, bus: &mut Bus, now: Time) {
        let Some((step, watch)) = self.steps.get_mut(self.current) else { return };
        if self.failed.is_some() {
            return;
        }
        if matches!(self.phase, Phase::Waiting) {
            match watch.as_ref().map_or(Ok(1), |watch| engine.evaluate(watch.body)) {
                Ok(0) => return,
                Ok(_) => self.phase = Phase::Delayed(Time(now.0 + step.after.0)),
                Err(fault) => {
                    self.failed = Some(fault);
                    return;
                }
            }
        }
        match &self.phase {
            Phase::Delayed(time) if now >= *time => {
                apply(step, engine, bus);
                self.phase = match step.pulse {
                    Some(pulse) => Phase::Pulsing(Time(now.0 + pulse.0)),
                    None => self.next(),
                };
            }
            Phase::Pulsing(time) if now >= *time => {
                for command in step.back.iter().rev() {
                    // The place was resolved and its size does not change.
                    let _ = engine.command(command);
                }
                self.phase = self.next();
            }
            _ => {}
        }
    }

    fn next(&mut self) -> Phase {
        self.current += 1;
        Phase::Waiting
    }
}

/// Writes what a step writes, and remembers what was there before.
fn apply(step: &mut BoundStep, engine: &mut Engine, bus: &mut Bus) {
    for (command, back) in step.set.iter().zip(&mut step.back) {
        if let Command::Write { place, bytes } = back {
            bytes.copy_from_slice(engine.read(*place));
        }
        // The place was resolved and the bytes have its size.
        let _ = engine.command(command);
    }
    for (name, value) in &step.inputs {
        bus.set_input(name, *value);
    }
}
