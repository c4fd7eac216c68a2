//! The computer: processors, clock, network cards, disk.

use super::{Files, Finding, Topic};
use crate::language::Word;
use std::path::Path;

const CPUS: &str = "/sys/devices/system/cpu";
/// Clock sources that are read without leaving the processor.
const FAST_CLOCKS: [&str; 4] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];
/// Drivers of cards without a bus to the processor that delays frames.
const SLOW_DRIVERS: [(&str, Word); 4] = [
    ("virtio_net", Word::HelpNetworkVirtual),
    ("vmxnet3", Word::HelpNetworkVirtual),
    ("cdc_ether", Word::HelpNetworkUsb),
    ("ax88179_178a", Word::HelpNetworkUsb),
];

/// Numbers of a list like `0-3,8`.
fn numbers(list: &str) -> Vec<u32> {
    let range = |part: &str| {
        let (low, high) = part.split_once('-').unwrap_or((part, part));
        let (low, high) = (low.trim().parse::<u32>().ok()?, high.trim().parse::<u32>().ok()?);
        (low <= high && high < 1 << 14).then_some(low..=high)
    };
    list.split(',').filter_map(range).flatten().collect()
}

pub(super) fn governor(files: &Files) -> Finding {
    let names = files.names(CPUS);
    let cpus = names.iter().filter(|name| name.strip_prefix("cpu").is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit())));
    let mut found: Vec<_> = cpus.filter_map(|cpu| files.text(&format!("{CPUS}/{cpu}/cpufreq/scaling_governor"))).collect();
    found.sort();
    found.dedup();
    match &found[..] {
        [] => Finding::ok(Topic::Governor, "-"),
        [one] if one == "performance" => Finding::ok(Topic::Governor, one.clone()),
        _ => Finding::advice(Topic::Governor, found.join(", "), Word::HelpGovernor),
    }
}

pub(super) fn isolation(files: &Files) -> Finding {
    let online = files.text(&format!("{CPUS}/online")).map(|list| numbers(&list).len());
    let isolated = files.text(&format!("{CPUS}/isolated")).unwrap_or_default();
    let nohz = files.text(&format!("{CPUS}/nohz_full")).filter(|list| list != "(null)").unwrap_or_default();
    match (online, numbers(&isolated).is_empty(), numbers(&nohz).is_empty()) {
        (None, ..) => Finding::unknown(Topic::Isolation, "/sys/devices/system/cpu/online"),
        (Some(1), ..) => Finding::advice(Topic::Isolation, "1 CPU", Word::HelpOneProcessor),
        (Some(_), false, false) => Finding::ok(Topic::Isolation, format!("isolcpus={isolated} nohz_full={nohz}")),
        (Some(_), false, true) => Finding::advice(Topic::Isolation, format!("isolcpus={isolated} nohz_full="), Word::HelpNohz),
        (Some(count), true, _) => Finding::advice(Topic::Isolation, format!("{count} CPU, isolcpus="), Word::HelpIsolation),
    }
}

pub(super) fn clock(files: &Files) -> Finding {
    let name = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    match files.text(name) {
        None => Finding::unknown(Topic::Clock, name),
        Some(source) if FAST_CLOCKS.contains(&source.as_str()) => Finding::ok(Topic::Clock, source),
        Some(source) => Finding::advice(Topic::Clock, source, Word::HelpClock),
    }
}

pub(super) fn sleep(files: &Files) -> Finding {
    let states = format!("{CPUS}/cpu0/cpuidle");
    let latency = |state: &String| files.text(&format!("{states}/{state}/latency"))?.parse::<u64>().ok();
    let deepest = files.names(&states).iter().filter_map(latency).max().unwrap_or(0);
    let found = format!("{deepest} µs");
    if deepest <= 2 {
        return Finding::ok(Topic::Sleep, found);
    }
    // Opening it for writing changes nothing before something is written.
    match std::fs::OpenOptions::new().write(true).open(files.path("/dev/cpu_dma_latency")) {
        Ok(_) => Finding::ok(Topic::Sleep, format!("{found}, /dev/cpu_dma_latency")),
        Err(_) => Finding::missing(Topic::Sleep, found, Word::HelpSleep),
    }
}

pub(super) fn threads(files: &Files) -> Finding {
    match files.text(&format!("{CPUS}/smt/active")).as_deref() {
        Some("1") => Finding::advice(Topic::Threads, "smt", Word::HelpThreads),
        _ => Finding::ok(Topic::Threads, "-"),
    }
}

pub(super) fn virtual_machine(files: &Files) -> Finding {
    let Some(text) = files.text("/proc/cpuinfo") else { return Finding::unknown(Topic::Virtual, "/proc/cpuinfo") };
    let flagged =
        text.lines().filter(|line| line.starts_with("flags")).any(|line| line.split_whitespace().any(|flag| flag == "hypervisor"));
    let product = files.text("/sys/class/dmi/id/product_name").unwrap_or_default();
    let named = ["KVM", "VMware", "VirtualBox", "QEMU", "Virtual Machine"].iter().any(|name| product.contains(name));
    if flagged || named {
        Finding::advice(Topic::Virtual, if product.is_empty() { "hypervisor".into() } else { product }, Word::HelpVirtual)
    } else {
        Finding::ok(Topic::Virtual, "-")
    }
}

/// One finding per card that is a device; a computer without one has none to offer.
pub(super) fn network(files: &Files) -> Vec<Finding> {
    let folder = "/sys/class/net";
    let card = |name: &String| {
        let device = files.text(&format!("{folder}/{name}/device/uevent"))?;
        let driver = device.lines().find_map(|line| line.strip_prefix("DRIVER=")).unwrap_or("?").to_string();
        let state = files.text(&format!("{folder}/{name}/operstate")).unwrap_or_else(|| "?".into());
        let found = format!("{name} ({driver}, {state})");
        Some(match SLOW_DRIVERS.iter().find(|(slow, _)| *slow == driver) {
            Some((_, help)) => Finding::advice(Topic::Network, found, *help),
            None => Finding::ok(Topic::Network, found),
        })
    };
    let cards: Vec<_> = files.names(folder).iter().filter_map(card).collect();
    if cards.is_empty() { vec![Finding::advice(Topic::Network, "-", Word::HelpNetwork)] } else { cards }
}

/// The processor that the manifest names.
pub(super) fn processor(files: &Files, cpu: u16) -> Finding {
    let list = |name: &str| numbers(&files.text(&format!("{CPUS}/{name}")).unwrap_or_default());
    let (online, isolated) = (list("online"), list("isolated"));
    if !online.contains(&cpu.into()) {
        return Finding::missing(Topic::Processor, format!("cpu = {cpu}"), Word::HelpNoProcessor);
    }
    if isolated.contains(&cpu.into()) {
        Finding::ok(Topic::Processor, format!("cpu = {cpu}"))
    } else {
        Finding::advice(Topic::Processor, format!("cpu = {cpu}"), Word::HelpNotIsolated)
    }
}

/// The file system that the state folder lies on.
pub(super) fn disk(files: &Files, state: &Path) -> Finding {
    let Some(mounts) = files.text("/proc/mounts") else { return Finding::unknown(Topic::Disk, "/proc/mounts") };
    let mount = |line: &str| {
        let mut words = line.split(' ');
        let (device, folder, kind) = (words.next()?, words.next()?.replace("\\040", " "), words.next()?);
        state.starts_with(&folder).then(|| (Path::new(&folder).components().count(), device.to_string(), kind.to_string()))
    };
    let Some((_, device, kind)) = mounts.lines().filter_map(mount).max_by_key(|(depth, ..)| *depth) else {
        return Finding::unknown(Topic::Disk, "/proc/mounts");
    };
    let found = format!("{} ({device}, {kind})", state.display());
    let lasting = !matches!(kind.as_str(), "tmpfs" | "ramfs" | "overlay");
    let far = kind.starts_with("nfs") || kind == "cifs" || kind.starts_with("fuse");
    let disk = device.trim_start_matches("/dev/").trim_end_matches(|c: char| c.is_ascii_digit());
    let turns = files.text(&format!("/sys/block/{disk}/queue/rotational")).is_some_and(|text| text == "1");
    match (lasting, far, turns) {
        (false, ..) => Finding::missing(Topic::Disk, found, Word::HelpDiskNotLasting),
        (_, true, _) => Finding::advice(Topic::Disk, found, Word::HelpDiskFar),
        (_, _, true) => Finding::advice(Topic::Disk, found, Word::HelpDiskTurns),
        _ => Finding::ok(Topic::Disk, found),
    }
}

#[cfg(test)]
mod tests {
    use super::numbers;

    #[test]
    fn lists_of_processors_are_read() {
        assert_eq!(numbers("0-2,5"), [0, 1, 2, 5]);
        for nothing in ["", "x", "3-1", "0-4000000000", "-"] {
            assert_eq!(numbers(nothing), [0u32; 0], "{nothing}");
        }
    }
}
