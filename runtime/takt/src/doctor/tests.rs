//! Two computers as trees of files: a control cabinet's and a laptop with a virtual machine.

use super::*;

fn tree(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/doctor").join(name)
}

fn wishes(state: &str) -> Wishes {
    Wishes { priority: 80, cpu: Some(3), state: Some(state.into()) }
}

fn of(findings: &[Finding], topic: Topic) -> (Level, &str) {
    let found = findings.iter().find(|finding| finding.topic == topic).unwrap_or_else(|| panic!("{topic:?}"));
    (found.level, found.found.as_str())
}

#[test]
fn a_computer_made_for_it_lacks_nothing() {
    let findings = examine(&tree("station"), &wishes("/home/plant/.takt"));
    let bad: Vec<_> = findings.iter().filter(|finding| finding.level != Level::Ok).collect();
    assert!(bad.is_empty(), "{bad:?}");
    assert_eq!(of(&findings, Topic::Network), (Level::Ok, "enp1s0 (igb, up)"));
    assert_eq!(of(&findings, Topic::Kernel), (Level::Ok, "6.12.9-rt12 PREEMPT_RT"));
    assert_eq!(of(&findings, Topic::Isolation), (Level::Ok, "isolcpus=3 nohz_full=3"));
    assert!(findings.iter().all(|finding| finding.help.is_none()));
}

#[test]
fn what_a_laptop_lacks_is_named_with_what_to_do() {
    use Level::{Advice, Missing};
    let findings = examine(&tree("laptop"), &wishes("/home/me/.takt"));
    let expected = [
        (Topic::Kernel, Advice, "6.8.0-45-generic"),
        (Topic::Priority, Missing, "rtprio 0 < 80"),
        (Topic::Memory, Missing, "memlock 8388608"),
        (Topic::Throttling, Advice, "500000 µs / 1000000 µs"),
        (Topic::Governor, Advice, "performance, powersave"),
        (Topic::Isolation, Advice, "8 CPU, isolcpus="),
        (Topic::Clock, Advice, "hpet"),
        (Topic::Sleep, Missing, "350 µs"),
        (Topic::Threads, Advice, "smt"),
        (Topic::Swap, Advice, "/swap.img"),
        (Topic::Virtual, Advice, "VMware Virtual Platform"),
        (Topic::Network, Advice, "eth0 (vmxnet3, up)"),
        (Topic::Processor, Advice, "cpu = 3"),
        (Topic::Disk, Missing, "/home/me/.takt (overlay, overlay)"),
    ];
    for (topic, level, found) in expected {
        assert_eq!(of(&findings, topic), (level, found), "{topic:?}");
    }
    assert_eq!(findings.len(), expected.len());
    assert!(findings.iter().all(|finding| finding.help.is_some()));
    let json = to_json(&findings, Language::English);
    assert_eq!((&json["schema"], &json["level"], &json["findings"][1]["topic"]), (&json!(1), &json!("missing"), &json!("priority")));
    assert!(json["findings"][1]["help"].as_str().is_some_and(|help| help.contains("setcap cap_sys_nice")));
}

#[test]
fn disks_are_told_apart_by_the_longest_mount() {
    let files = Files { root: tree("station") };
    for (state, level) in
        [("/run/takt", Level::Missing), ("/data/takt", Level::Advice), ("/plant/takt", Level::Advice), ("/database", Level::Ok)]
    {
        assert_eq!(machine::disk(&files, Path::new(state)).level, level, "{state}");
    }
}

#[test]
fn a_missing_processor_is_told() {
    let findings = examine(&tree("station"), &Wishes { cpu: Some(9), ..Wishes::default() });
    assert_eq!(of(&findings, Topic::Processor), (Level::Missing, "cpu = 9"));
}

#[test]
fn a_folder_without_any_of_the_files_is_examined_too() {
    let findings = examine(Path::new("/nonexistent"), &wishes("/x"));
    assert!(findings.len() > 10 && findings.iter().all(|finding| !finding.line(Language::Chinese).is_empty()));
}
