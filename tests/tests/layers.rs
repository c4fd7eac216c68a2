//! The layers: which crate may import which. A new edge is a design decision; it changes this table and ARCHITECTURE.md in a commit of its own.

use std::collections::BTreeSet;
use std::path::Path;

const ALL: &[&str] = &["abi", "syntax", "ir", "compile", "jit", "engine", "io", "takt", "stdlib-fb"];

/// Folder, and what it may import.
const LAYERS: &[(&str, &[&str])] = &[
    ("runtime/abi", &[]),
    ("runtime/syntax", &[]),
    ("runtime/ir", &["abi"]),
    ("stdlib-fb", &["abi"]),
    ("runtime/compile", &["abi", "syntax", "ir"]),
    ("runtime/jit", &["abi", "ir"]),
    ("runtime/engine", &["abi", "ir", "jit"]),
    ("runtime/io", &["abi", "engine"]),
    ("runtime/takt", ALL),
    ("tests", ALL),
];

fn manifest(folder: &str) -> toml::Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.parse().unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Crates of this workspace that a manifest imports, by their short names.
fn imports(manifest: &toml::Table) -> BTreeSet<String> {
    let sections = ["dependencies", "build-dependencies"].into_iter().filter_map(|s| manifest.get(s)?.as_table());
    let names = sections.flat_map(|t| t.keys());
    names.filter_map(|n| if n == "takt" { Some("takt".into()) } else { n.strip_prefix("takt-").map(String::from) }).collect()
}

#[test]
fn no_crate_imports_more_than_its_layer_may() {
    for (folder, allowed) in LAYERS {
        let found = imports(&manifest(folder));
        let more: Vec<_> = found.iter().filter(|n| !allowed.contains(&n.as_str())).collect();
        assert!(more.is_empty(), "{folder} imports {more:?}; the table allows {allowed:?}");
    }
}

#[test]
fn every_member_of_the_workspace_has_a_layer() {
    let root = manifest(".");
    let members = root["workspace"]["members"].as_array().expect("members").iter().filter_map(|m| m.as_str());
    for member in members {
        assert!(LAYERS.iter().any(|(folder, _)| *folder == member), "{member} is not in the table");
    }
}

#[test]
fn only_jit_knows_cranelift() {
    for (folder, _) in LAYERS.iter().filter(|(f, _)| *f != "runtime/jit") {
        let text = toml::to_string(&manifest(folder)).expect("a table");
        assert!(!text.contains("cranelift"), "{folder} names cranelift");
    }
}
