//! What `takt run` does with the state folder: takes it, starts from the retained values in it, and keeps them.

use super::outputs::warning;
use super::run::usage;
use super::{Exit, RunArgs};
use crate::console;
use crate::journal::{Entry, Event};
use crate::language::{self, Word};
use crate::machine::Machine;
use crate::project::Project;
use crate::retain::migrate::listed;
use crate::retain::writer::Writer;
use crate::retain::{Loaded, Source, slot};
use crate::state::{self, State, StateError};
use takt_engine::Reset;

/// The state folder of a run, and what was found in it.
pub(super) struct Keep {
    state: Option<State>,
    /// Why there is none although the run is in real time.
    missing: Option<StateError>,
    loaded: Loaded,
    kind: Reset,
}

impl Keep {
    /// Takes the folder. What cannot be written is no obstacle to a program that retains nothing.
    pub(super) fn open(args: &RunArgs, project: &Project, real: bool) -> Result<Self, Exit> {
        let kind = match (args.cold, args.origin) {
            (_, true) => Reset::Origin,
            (true, _) => Reset::Cold,
            _ => Reset::Warm,
        };
        let (state, missing) = match state::of_run(project, args.state.as_deref(), real) {
            Ok(state) => (state, None),
            Err(error @ StateError::Unusable { .. }) if args.state.is_none() => (None, Some(error)),
            Err(error) => return Err(usage(&error.to_string())),
        };
        let loaded = match &state {
            Some(state) if kind != Reset::Origin => slot::load(state.path()).map_err(|error| usage(&error.to_string()))?,
            // What cannot be read must not be taken for the newest one later.
            Some(state) => match slot::load(state.path()) {
                Ok(loaded) => loaded,
                Err(_) => slot::set_aside(state.path()).map_err(|error| usage(&format!("{}: {error}", state.path().display())))?,
            },
            None => Loaded::default(),
        };
        if let Some((path, defect)) = &loaded.torn {
            let word = Word::RetainTorn.text(language::of_environment());
            console::tell(format_args!("{}: {word} ({}: {defect})", warning(), path.display()));
        }
        Ok(Self { state, missing, loaded, kind })
    }

    /// The folder, if there is one.
    pub(super) fn state(&self) -> Option<&State> {
        self.state.as_ref()
    }

    /// What the machine starts from.
    pub(super) fn source(&self) -> Option<Source> {
        self.state.as_ref()?;
        let generation = self.loaded.newest.as_ref().map(|(generation, _)| generation.clone());
        Some(Source { generation, kind: self.kind, lenient: false })
    }

    /// Tells what came of the values, and starts to keep them.
    pub(super) fn start(&self, project: &Project, machine: &mut Machine) -> Result<Option<Writer>, Exit> {
        let retains = !machine.program().retained.is_empty();
        if let Some(error) = &self.missing {
            if retains {
                return Err(usage(&error.to_string()));
            }
            console::tell(format_args!("{}: {error}", warning()));
        }
        let Some(state) = &self.state else { return Ok(None) };
        self.tell(state, machine).map_err(|error| usage(&error))?;
        let program = machine.program().clone();
        let Some(reader) = machine.engine().snapshots() else { return Ok(None) };
        let tell = |error: &std::io::Error| {
            console::tell(format_args!("{}: {}: {error}", warning(), Word::RetainFailed.text(language::of_environment())));
        };
        let writer = Writer::start(state.path(), &project.name, program, &self.loaded, reader, tell);
        writer.map(Some).map_err(|error| usage(&error.to_string()))
    }

    /// For the journal: which values the machine started from.
    pub(super) fn loaded(&self, machine: &Machine) -> Option<Entry> {
        let (migration, (generation, _)) = (machine.migration()?, self.loaded.newest.as_ref()?);
        let kind = match self.kind {
            Reset::Warm => "warm",
            Reset::Cold => "cold",
            Reset::Origin => "origin",
        };
        let (number, added, gone) = (generation.number, migration.added.len(), migration.removed.len() + migration.dropped.len());
        let message = format!("{kind} start from retained values, generation {number}, {added} new, {gone} put aside");
        Some(Entry::new(Event::Load).variable(&generation.description.project).message(message))
    }

    fn tell(&self, state: &State, machine: &Machine) -> Result<(), String> {
        let (Some(migration), Some((generation, _))) = (machine.migration(), &self.loaded.newest) else { return Ok(()) };
        let language = language::of_environment();
        for (word, paths) in [(Word::RetainAdded, &migration.added), (Word::RetainConverted, &migration.converted)] {
            if !paths.is_empty() {
                console::tell(format_args!("{}: {}", word.text(language), listed(paths)));
            }
        }
        if migration.removed.is_empty() && migration.dropped.is_empty() {
            return Ok(());
        }
        // All values of the generation, in the form that an import reads.
        let path = state.file(&format!("retain-aside-{}.json", generation.number));
        let text = super::retain::to_json(generation);
        std::fs::write(&path, text).map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
        let gone: Vec<String> = migration.removed.iter().map(|i| generation.description.places[*i].path.clone()).collect();
        for (word, paths) in [(Word::RetainRemoved, &gone), (Word::RetainDropped, &migration.dropped)] {
            if !paths.is_empty() {
                console::tell(format_args!("{} {}: {}", word.text(language), path.display(), listed(paths)));
            }
        }
        Ok(())
    }
}

/// Ends keeping with the last whole state.
pub(super) fn finish(writer: Option<Writer>, machine: &mut Machine) {
    let Some(writer) = writer else { return };
    if let Err(error) = writer.finish(machine.engine().last_retained()) {
        console::tell(format_args!("{}: {}: {error}", warning(), Word::RetainFailed.text(language::of_environment())));
    }
}
