//! A line of the journal.

use serde::{Deserialize, Serialize};
use std::time::SystemTime;
use takt_abi::Time;
use takt_engine::{FaultRecord, IoFault};

/// What a line is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// A run begins.
    Start,
    /// A run is over.
    Stop,
    /// The program stopped with a fault.
    Fault,
    /// A task missed releases.
    Overrun,
    /// The bus did not answer.
    IoFault,
    /// The bus answers again.
    IoGood,
    /// Something that deserves attention.
    Warning,
    /// A program, retained variables or parameters were loaded.
    Load,
    /// A variable was written from outside.
    Write,
    /// A variable was forced.
    Force,
    /// A force was taken away.
    Release,
    /// The program was started anew.
    Reset,
    /// The program was stopped, paused, stepped or continued from outside.
    Control,
    /// A client was allowed to change things.
    Arm,
    /// A client may change nothing any more.
    Disarm,
    /// Lines that could not be written.
    Lost,
    /// Nothing follows; never written.
    #[serde(skip)]
    End,
    /// An event of a later version.
    #[serde(other)]
    Unknown,
}

impl Event {
    /// The word in the line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Stop => "stop",
            Self::Fault => "fault",
            Self::Overrun => "overrun",
            Self::IoFault => "io-fault",
            Self::IoGood => "io-good",
            Self::Warning => "warning",
            Self::Load => "load",
            Self::Write => "write",
            Self::Force => "force",
            Self::Release => "release",
            Self::Reset => "reset",
            Self::Control => "control",
            Self::Arm => "arm",
            Self::Disarm => "disarm",
            Self::Lost => "lost",
            Self::End => "end",
            Self::Unknown => "unknown",
        }
    }

    /// Whether the line goes to the disk at once.
    pub(super) fn is_grave(self) -> bool {
        matches!(self, Self::Fault | Self::Stop | Self::Start)
    }
}

/// A line of the journal. What does not apply is left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Wall time, UTC, RFC 3339.
    #[serde(default)]
    pub time: String,
    /// What it is about.
    pub event: Event,
    /// Machine time, ns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_ns: Option<i64>,
    /// Who did it: the name given when arming, else the user of the system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub who: Option<String>,
    /// From where: user and process behind a socket, or the command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Why, in the words of who did it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The variable or task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variable: Option<String>,
    /// Its value before, a literal of ST.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub old: Option<String>,
    /// Its value now.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub new: Option<String>,
    /// For people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// Characters of a text that the journal keeps.
const LONGEST: usize = 2000;

/// A text without characters that would move a terminal's cursor, and not too long.
pub(crate) fn clean(text: &str) -> String {
    let plain = text.chars().map(|c| if c.is_control() || is_direction(c) { '\u{FFFD}' } else { c });
    plain.take(LONGEST).collect()
}

/// Characters that turn text around.
fn is_direction(c: char) -> bool {
    matches!(c, '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

impl Entry {
    /// A line with nothing but its event.
    pub fn new(event: Event) -> Self {
        Self {
            time: String::new(),
            event,
            time_ns: None,
            who: None,
            from: None,
            reason: None,
            variable: None,
            old: None,
            new: None,
            message: None,
        }
    }
    /// With a text for people, which may have several lines.
    pub fn message(self, text: impl Into<String>) -> Self {
        let lines: Vec<_> = text.into().lines().map(|line| clean(line.trim())).collect();
        Self { message: Some(lines.join(" | ")), ..self }
    }
    /// With its variable or task.
    pub fn variable(self, name: impl Into<String>) -> Self {
        Self { variable: Some(clean(&name.into())), ..self }
    }
    /// With machine time.
    pub fn at(self, time: Time) -> Self {
        Self { time_ns: Some(time.0), ..self }
    }
    /// With who did it, from where and why.
    pub fn by(self, who: &str, from: &str, reason: &str) -> Self {
        let some = |text: &str| Some(clean(text)).filter(|text| !text.is_empty());
        Self { who: some(who), from: some(from), reason: some(reason), ..self }
    }
    /// With the values before and after.
    pub fn values(self, old: Option<String>, new: Option<String>) -> Self {
        Self { old: old.map(|text| clean(&text)), new: new.map(|text| clean(&text)), ..self }
    }
    pub(super) fn timed(self, time: SystemTime) -> Self {
        Self { time: humantime::format_rfc3339_millis(time).to_string(), ..self }
    }
    pub(super) fn lost(count: u64) -> Self {
        Self::new(Event::Lost).message(format!("{count} lines could not be written"))
    }
}

/// What the thread that runs the scans has to say.
#[derive(Debug, Clone)]
pub enum Notice {
    /// A fault; it is posted once, and its record was made then.
    Fault(Box<FaultRecord>),
    /// A task missed releases.
    Overrun {
        /// Index of the task.
        task: usize,
        /// How many since the last notice.
        count: u64,
        /// Machine time.
        time: Time,
    },
    /// The bus did not answer.
    IoFault {
        /// Why.
        fault: IoFault,
        /// How many exchanges failed since the last notice.
        count: u64,
        /// Machine time.
        time: Time,
    },
    /// The bus answers again.
    IoGood {
        /// Machine time.
        time: Time,
    },
}

impl Notice {
    pub(super) fn entry(&self, tasks: &[String]) -> Entry {
        match self {
            Self::Fault(record) => Entry::new(Event::Fault).at(record.time).message(record.to_string()),
            Self::Overrun { task, count, time } => {
                let name = tasks.get(*task).map_or("?", String::as_str);
                Entry::new(Event::Overrun).at(*time).variable(name).message(format!("{count} releases missed"))
            }
            Self::IoFault { fault, count, time } => {
                Entry::new(Event::IoFault).at(*time).message(format!("{count} exchanges failed, the last one: {fault}"))
            }
            Self::IoGood { time } => Entry::new(Event::IoGood).at(*time),
        }
    }
}
