//! The kernel and what it allows.

use super::{Files, Finding, Topic};
use crate::language::Word;

const CAP_SYS_NICE: u32 = 23;
const CAP_IPC_LOCK: u32 = 14;

pub(super) fn kernel(files: &Files) -> Finding {
    let Some(version) = files.text("/proc/version") else { return Finding::unknown(Topic::Kernel, "/proc/version") };
    let release = files.text("/proc/sys/kernel/osrelease");
    let release = release.or_else(|| version.split_whitespace().nth(2).map(String::from)).unwrap_or_default();
    let preempts = files.text("/sys/kernel/realtime").is_some_and(|text| text == "1") || version.contains("PREEMPT_RT");
    if preempts {
        Finding::ok(Topic::Kernel, format!("{release} PREEMPT_RT"))
    } else {
        Finding::advice(Topic::Kernel, release, Word::HelpKernel)
    }
}

fn has(files: &Files, capability: u32) -> bool {
    let set = files.field("/proc/self/status", "CapEff").and_then(|set| u64::from_str_radix(&set, 16).ok());
    set.is_some_and(|set| set >> capability & 1 == 1)
}

/// The soft limit of that name.
fn limit(files: &Files, name: &str) -> Option<String> {
    let text = files.text("/proc/self/limits")?;
    text.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next().map(String::from))
}

pub(super) fn priority(files: &Files, wanted: u8) -> Finding {
    if has(files, CAP_SYS_NICE) {
        return Finding::ok(Topic::Priority, "CAP_SYS_NICE");
    }
    let Some(most) = limit(files, "Max realtime priority") else { return Finding::unknown(Topic::Priority, "/proc/self/limits") };
    let enough = most == "unlimited" || most.parse::<u32>().is_ok_and(|most| most >= u32::from(wanted));
    if enough {
        Finding::ok(Topic::Priority, format!("rtprio {most}"))
    } else {
        Finding::missing(Topic::Priority, format!("rtprio {most} < {wanted}"), Word::HelpPriority)
    }
}

pub(super) fn memory(files: &Files) -> Finding {
    if has(files, CAP_IPC_LOCK) {
        return Finding::ok(Topic::Memory, "CAP_IPC_LOCK");
    }
    match limit(files, "Max locked memory") {
        None => Finding::unknown(Topic::Memory, "/proc/self/limits"),
        Some(most) if most == "unlimited" => Finding::ok(Topic::Memory, "memlock unlimited"),
        Some(most) => Finding::missing(Topic::Memory, format!("memlock {most}"), Word::HelpMemory),
    }
}

/// Up to Linux 6.11 a limit for all real-time threads of a processor; since then time that ordinary ones are granted (`fair_server`, in debugfs).
pub(super) fn throttling(files: &Files) -> Finding {
    let name = "/proc/sys/kernel/sched_rt_runtime_us";
    let Some(runtime) = files.text(name).and_then(|text| text.parse::<i64>().ok()) else {
        return Finding::unknown(Topic::Throttling, name);
    };
    let period = files.text("/proc/sys/kernel/sched_rt_period_us").and_then(|text| text.parse::<i64>().ok()).unwrap_or(1_000_000);
    let server = files.text("/sys/kernel/debug/sched/fair_server/cpu0/runtime").and_then(|text| text.parse::<u64>().ok());
    let granted = server.map_or_else(String::new, |ns| format!(", fair_server {} µs", ns / 1000));
    let found = format!("{runtime} µs / {period} µs{granted}");
    if runtime < 0 && server.is_none_or(|ns| ns == 0) {
        Finding::ok(Topic::Throttling, found)
    } else {
        Finding::advice(Topic::Throttling, found, Word::HelpThrottling)
    }
}

pub(super) fn swap(files: &Files) -> Finding {
    let Some(text) = files.text("/proc/swaps") else { return Finding::unknown(Topic::Swap, "/proc/swaps") };
    let used: Vec<_> = text.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if used.is_empty() { Finding::ok(Topic::Swap, "-") } else { Finding::advice(Topic::Swap, used.join(", "), Word::HelpSwap) }
}
