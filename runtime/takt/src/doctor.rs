//! `takt doctor`: what a computer offers a machine that moves, what is missing, and how to get it.
//!
//! Everything is read from files below a root folder (`/proc`, `/sys`, `/etc`, `/dev`), so that a computer can be examined from its files alone.

mod machine;
mod system;

use crate::language::{Language, Word};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    Ok,
    /// It works, and could work better.
    Advice,
    /// Without it scans come late.
    Missing,
}

impl Level {
    /// In JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Advice => "advice",
            Self::Missing => "missing",
        }
    }
}

/// What was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topic {
    /// PREEMPT_RT.
    Kernel,
    /// CAP_SYS_NICE, RLIMIT_RTPRIO.
    Priority,
    /// CAP_IPC_LOCK, RLIMIT_MEMLOCK.
    Memory,
    /// Time that real-time threads may take.
    Throttling,
    /// CPU frequency.
    Governor,
    /// isolcpus, nohz_full.
    Isolation,
    /// What the monotonic clock reads.
    Clock,
    /// Sleep states.
    Sleep,
    /// Hyper-threading.
    Threads,
    /// Swap.
    Swap,
    /// Virtual machine.
    Virtual,
    /// Network cards.
    Network,
    /// Disk of the state folder.
    Disk,
    /// `cpu` in the manifest.
    Processor,
}

impl Topic {
    /// In JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kernel => "kernel",
            Self::Priority => "priority",
            Self::Memory => "memory",
            Self::Throttling => "throttling",
            Self::Governor => "governor",
            Self::Isolation => "isolation",
            Self::Clock => "clock",
            Self::Sleep => "sleep-states",
            Self::Threads => "hyper-threading",
            Self::Swap => "swap",
            Self::Virtual => "virtual-machine",
            Self::Network => "network",
            Self::Disk => "disk",
            Self::Processor => "processor",
        }
    }
    fn word(self) -> Word {
        match self {
            Self::Kernel => Word::TopicKernel,
            Self::Priority => Word::TopicPriority,
            Self::Memory => Word::TopicMemory,
            Self::Throttling => Word::TopicThrottling,
            Self::Governor => Word::TopicGovernor,
            Self::Isolation => Word::TopicIsolation,
            Self::Clock => Word::TopicClock,
            Self::Sleep => Word::TopicSleep,
            Self::Threads => Word::TopicThreads,
            Self::Swap => Word::TopicSwap,
            Self::Virtual => Word::TopicVirtual,
            Self::Network => Word::TopicNetwork,
            Self::Disk => Word::TopicDisk,
            Self::Processor => Word::TopicProcessor,
        }
    }
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What.
    pub topic: Topic,
    /// How much it matters.
    pub level: Level,
    /// What the computer says, in its own words.
    pub found: String,
    /// What to do; nothing where all is well.
    pub help: Option<Word>,
}

impl Finding {
    fn ok(topic: Topic, found: impl Into<String>) -> Self {
        Self { topic, level: Level::Ok, found: found.into(), help: None }
    }
    fn advice(topic: Topic, found: impl Into<String>, help: Word) -> Self {
        Self { topic, level: Level::Advice, found: found.into(), help: Some(help) }
    }
    fn missing(topic: Topic, found: impl Into<String>, help: Word) -> Self {
        Self { topic, level: Level::Missing, found: found.into(), help: Some(help) }
    }
    /// Something could not be read.
    fn unknown(topic: Topic, file: &str) -> Self {
        Self::advice(topic, format!("? ({file})"), Word::HelpUnknown)
    }
    /// For people.
    pub fn line(&self, language: Language) -> String {
        let mark = match self.level {
            Level::Ok => "\x1b[32m✓\x1b[0m",
            Level::Advice => "\x1b[33m!\x1b[0m",
            Level::Missing => "\x1b[31m✗\x1b[0m",
        };
        let help = self.help.map_or_else(String::new, |help| format!("\n      {}", help.text(language)));
        format!("  {mark} {}: {}{help}", self.topic.word().text(language), self.found)
    }
}

/// Files of the computer.
#[derive(Debug, Clone)]
pub(crate) struct Files {
    root: PathBuf,
}

impl Files {
    fn path(&self, name: &str) -> PathBuf {
        self.root.join(name.trim_start_matches('/'))
    }
    /// A text file without the white space at its ends.
    fn text(&self, name: &str) -> Option<String> {
        let bytes = std::fs::read(self.path(name)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_string())
    }
    /// Names in a folder, sorted.
    fn names(&self, name: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(name)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
    /// The number after `name:` in a file of such lines.
    fn field(&self, file: &str, name: &str) -> Option<String> {
        let text = self.text(file)?;
        let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        value.map(|value| value.trim().to_string())
    }
}

/// What is examined beside the computer: the machine's wishes.
#[derive(Debug, Clone, Default)]
pub struct Wishes {
    /// Priority of the resource thread.
    pub priority: u8,
    /// Its processor.
    pub cpu: Option<u16>,
    /// The state folder, absolute.
    pub state: Option<PathBuf>,
}

/// Examines the computer whose files lie below `root`.
pub fn examine(root: &Path, wishes: &Wishes) -> Vec<Finding> {
    let files = Files { root: root.into() };
    let mut findings = vec![
        system::kernel(&files),
        system::priority(&files, wishes.priority),
        system::memory(&files),
        system::throttling(&files),
        machine::governor(&files),
        machine::isolation(&files),
        machine::clock(&files),
        machine::sleep(&files),
        machine::threads(&files),
        system::swap(&files),
        machine::virtual_machine(&files),
    ];
    findings.extend(machine::network(&files));
    findings.extend(wishes.cpu.map(|cpu| machine::processor(&files, cpu)));
    findings.extend(wishes.state.as_ref().map(|state| machine::disk(&files, state)));
    findings
}

/// All findings as one object.
pub fn to_json(findings: &[Finding], language: Language) -> Value {
    let finding = |finding: &Finding| {
        json!({
            "topic": finding.topic.name(), "level": finding.level.name(), "found": finding.found,
            "help": finding.help.map(|help| help.text(language)),
        })
    };
    let worst = findings.iter().map(|finding| finding.level).max().unwrap_or(Level::Ok);
    json!({ "schema": 1, "level": worst.name(), "findings": findings.iter().map(finding).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests;
