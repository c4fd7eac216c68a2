//! The parameters of a machine that does not run: in the retained values of its state folder.

use super::super::run;
use super::{Exit, Where, refuse};
use crate::commands::{Format, check, log};
use crate::journal::{Entry, Event, Journal};
use crate::machine::{Machine, Setup, variable};
use crate::parameters::{self, Parameter};
use crate::project::{self, Project};
use crate::retain::layout::Description;
use crate::retain::slot::{self, Store};
use crate::retain::{Loaded, Source, pack, writer};
use crate::state::State;
use std::collections::BTreeMap;
use takt_engine::{ExecutorKind, Reset, RetainLayout};
use takt_ir::format_value;

/// A program with its retained values, that is not run.
pub(super) struct Stored {
    project: Project,
    /// Nobody else changes it meanwhile.
    state: State,
    loaded: Loaded,
    machine: Machine,
    list: Vec<Parameter>,
}

impl Stored {
    pub(super) fn open(machine: &Where) -> Result<Self, Exit> {
        let project = project::load(&machine.path).map_err(|error| check::refuse(&error, Format::Text))?;
        let state = State::open(log::folder(machine)?).map_err(|error| refuse(&error))?;
        let loaded = slot::load(state.path()).map_err(|error| refuse(&error))?;
        let generation = loaded.newest.as_ref().map(|(generation, _)| generation.clone());
        let source = Source { generation, kind: Reset::Warm, lenient: false };
        let setup = Setup { executor: ExecutorKind::Interpreter, retained: Some(source), ..Setup::default() };
        let machine = Machine::new(&project, setup).map_err(|error| run::refuse(&error))?;
        let list = parameters::list(machine.program()).map_err(|error| refuse(&error))?;
        Ok(Self { project, state, loaded, machine, list })
    }

    pub(super) fn project(&self) -> String {
        self.project.name.clone()
    }

    fn literal(&self, parameter: &Parameter) -> String {
        format_value(&self.machine.program().types, parameter.place.ty, self.machine.bytes(parameter.place))
    }

    pub(super) fn values(&self) -> Result<BTreeMap<String, String>, String> {
        Ok(self.list.iter().map(|parameter| (parameter.path.clone(), self.literal(parameter))).collect())
    }

    /// All or none.
    pub(super) fn set(&mut self, values: &[(String, String)], name: &str, reason: &str) -> Result<(), String> {
        let program = self.machine.program().clone();
        let (mut good, mut mistakes) = (Vec::new(), Vec::new());
        for (path, value) in values {
            match variable::assignment(&program, path, value) {
                Ok((place, bytes)) => good.push((path, place, bytes)),
                Err(error) => mistakes.push(format!("{path}: {error}")),
            }
        }
        if !mistakes.is_empty() {
            return Err(mistakes.join("\n  "));
        }
        let mut lines = Vec::new();
        for (path, place, bytes) in good {
            let parameter = Parameter { path: path.clone(), place };
            let old = self.literal(&parameter);
            self.machine.engine().write(place, &bytes).map_err(|error| format!("{path}: {error}"))?;
            let entry = Entry::new(Event::Write).by(name, "takt param", reason);
            lines.push(entry.variable(path).values(Some(old), Some(self.literal(&parameter))));
        }
        let mut data = Vec::new();
        pack(&program, &RetainLayout::new(&program), &self.machine.engine().retained(), &mut data);
        let folder = self.state.path();
        let wrong = |error: std::io::Error| format!("{}: {error}", folder.display());
        let (journal, _) = Journal::open(folder, Vec::new()).map_err(wrong)?;
        let mut store = Store::new(folder, &Description::of(&self.project.name, &program), &self.loaded);
        store.write(&data, writer::now()).map_err(wrong)?;
        lines.into_iter().for_each(|line| journal.post(line));
        Ok(())
    }
}
