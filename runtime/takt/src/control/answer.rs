//! Answers as a client gets them.

use super::job::{Mode, Status};
use crate::machine::VariableError;
use crate::{statistics, values};
use serde_json::{Map, Value, json};
use takt_ir::{Program, SymbolError, TypeId};

/// Why a request was refused.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Problem {
    /// For tools.
    pub code: &'static str,
    /// For people.
    pub message: String,
    /// What would have been right.
    pub expected: String,
}

impl Problem {
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), expected: String::new() }
    }
    pub fn expected(self, text: impl Into<String>) -> Self {
        Self { expected: text.into(), ..self }
    }
    /// Of a variable.
    pub fn variable(error: &VariableError, path: &str) -> Self {
        let (code, expected) = match error {
            VariableError::Name(SymbolError::Unknown { suggestion: Some(name), .. }) => ("unknown-variable", name.clone()),
            VariableError::Name(_) => ("unknown-variable", "the path of a variable, like GVL.Axis[2].Position".into()),
            VariableError::Value(_) => ("bad-value", "a value of the variable's type".into()),
            VariableError::Kind { .. } | VariableError::Access { .. } => {
                ("not-writable", "an elementary variable that is no constant".into())
            }
        };
        let text = error.to_string();
        let message = if text.contains(path) { text } else { format!("{path}: {text}") };
        Self { code, message, expected }
    }
}

/// A line with a result.
pub(super) fn good(id: &Value, result: Value) -> String {
    json!({ "id": id, "result": result }).to_string()
}

/// A line that says why not.
pub(super) fn bad(id: &Value, problem: &Problem) -> String {
    let mut error = json!({ "code": problem.code, "message": problem.message });
    if !problem.expected.is_empty() {
        error["expected"] = problem.expected.clone().into();
    }
    json!({ "id": id, "error": error }).to_string()
}

/// A variable that is to be shown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Named {
    pub name: String,
    pub ty: TypeId,
    pub len: usize,
}

/// Values by their names.
pub(super) fn values(program: &Program, names: &[Named], bytes: &[u8]) -> Value {
    let mut rest = bytes;
    let mut map = Map::new();
    for named in names {
        let Some((own, behind)) = rest.split_at_checked(named.len) else { break };
        map.insert(named.name.clone(), values::to_json(&program.types, named.ty, own));
        rest = behind;
    }
    Value::Object(map)
}

/// How a machine runs.
pub(super) fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Running => "running",
        Mode::Paused => "paused",
        Mode::Stepping(_) => "stepping",
    }
}

/// The tasks of a program and what is known of their scans.
pub(super) fn tasks(program: &Program, status: &Status) -> Value {
    let tasks = program.tasks.iter().zip(&status.tasks).zip(&status.stopped);
    let line = |((task, of), own): ((&takt_ir::Task, &takt_engine::TaskStatistics), &Option<std::sync::Arc<takt_engine::FaultRecord>>)| {
        statistics::task_to_json(task, status.fault.as_deref(), own.as_deref(), of)
    };
    tasks.map(line).collect()
}

/// What stopped the program; null if nothing did.
pub(super) fn fault(status: &Status) -> Value {
    let Some(record) = &status.fault else { return Value::Null };
    let frame = |frame: &takt_engine::Frame| json!({ "file": frame.file, "line": frame.line, "column": frame.column, "body": frame.body });
    json!({
        "code": record.fault.name(), "message": record.fault.to_string(), "file": record.place.file, "line": record.place.line,
        "task": record.task, "time_ns": record.time.0, "cycle": record.cycle,
        "stack": std::iter::once(&record.place).chain(&record.stack).map(frame).collect::<Vec<_>>(),
    })
}

/// A JSON value as a literal of ST.
pub(super) fn literal(program: &Program, ty: TypeId, value: &Value) -> Option<String> {
    let quoted = |text: &str, quote: char| {
        let mut out = String::from(quote);
        for c in text.chars() {
            if c == '$' || c == quote {
                out.push('$');
            }
            out.push(c);
        }
        out.push(quote);
        out
    };
    Some(match (program.types.get(ty), value) {
        (_, Value::Bool(truth)) => truth.to_string(),
        (_, Value::Number(number)) => number.to_string(),
        (takt_ir::Type::String(_), Value::String(text)) => quoted(text, '\''),
        (takt_ir::Type::WString(_), Value::String(text)) => quoted(text, '"'),
        (_, Value::String(text)) => text.clone(),
        _ => return None,
    })
}
