//! The library and its page: every name that a program may use without declaring it is in `docs/library.md`, and everything in ST is documented.

use std::path::Path;
use takt_stdlib_fb::LIBRARY;

/// Names that the library's ST sources declare, each with the comment above it.
fn declared() -> Vec<(String, String)> {
    let mut names = Vec::new();
    for (_, text) in LIBRARY.sources {
        let mut comment = String::new();
        for line in text.lines() {
            let line = line.trim_end();
            let declares = ["FUNCTION_BLOCK ", "FUNCTION ", "TYPE "].iter().find_map(|word| line.strip_prefix(word));
            if let Some(rest) = declares {
                let name = rest.split([' ', ':']).next().unwrap_or_default();
                names.push((name.to_string(), comment.clone()));
            }
            match line.strip_prefix("//") {
                Some(text) => comment.push_str(text),
                None => comment.clear(),
            }
        }
    }
    names
}

/// All names, canonical ones and others.
fn names() -> Vec<String> {
    let blocks = LIBRARY.blocks.iter().flat_map(|b| std::iter::once(b.name).chain(b.aliases.iter().copied()));
    let types = LIBRARY.structs.iter().map(|s| s.name).chain(LIBRARY.enums.iter().map(|e| e.name));
    let native = blocks.chain(types).chain(LIBRARY.functions.iter().map(|f| f.name)).chain(LIBRARY.aliases.iter().map(|(alias, _)| *alias));
    native.map(String::from).chain(declared().into_iter().map(|(name, _)| name)).collect()
}

#[test]
fn every_name_of_the_library_is_on_its_page() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/library.md");
    let page = std::fs::read_to_string(&page).unwrap_or_else(|e| panic!("{}: {e}", page.display()));
    let missing: Vec<_> = names().into_iter().filter(|name| !page.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "docs/library.md does not say what these are: {missing:?}");
}

#[test]
fn everything_in_st_is_documented_and_declared_once() {
    let mut seen = std::collections::BTreeSet::new();
    for (name, comment) in declared() {
        assert!(!comment.trim().is_empty(), "{name} has no comment above it");
        assert!(seen.insert(name.to_uppercase()), "{name} is declared twice");
    }
}

#[test]
fn what_the_library_declares_compiles_without_a_word() {
    let mut all = Vec::new();
    for (name, _) in declared() {
        let source = format!("PROGRAM main VAR x : {name}; END_VAR\nx(); {name}();\nEND_PROGRAM");
        let output = takt_tests::bench::compile(&source);
        let own = output.diagnostics.iter().filter(|d| output.files[d.span.file.0 as usize].name != "case.st");
        all.extend(own.map(|d| format!("{name}: {} {}", d.code.text(), d.message)));
    }
    assert!(all.is_empty(), "{all:#?}");
}

const TYPES: &[&str] = &[
    "BOOL", "BYTE", "WORD", "DWORD", "LWORD", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "REAL", "LREAL", "TIME",
    "LTIME", "DATE", "LDATE", "TOD", "LTOD", "DT", "LDT", "CHAR", "WCHAR", "STRING", "WSTRING",
];

#[test]
fn every_type_converts_to_every_other_by_both_names() {
    let mut source = String::from("PROGRAM main VAR\n");
    for ty in TYPES {
        source += &format!("v_{ty} : {ty}; w_{ty} : {ty};\n");
    }
    source += "END_VAR\n";
    for from in TYPES {
        for to in TYPES {
            source += &format!("w_{to} := {from}_TO_{to}(v_{from}); w_{to} := TO_{to}(v_{from});\n");
        }
    }
    source += "END_PROGRAM\n";
    let output = takt_tests::bench::compile(&source);
    let said: Vec<_> = output.diagnostics.iter().map(|d| d.message.clone()).collect();
    assert!(said.is_empty(), "{said:?}");
    let program = std::sync::Arc::new(output.program.expect("no errors"));
    for executor in [takt_engine::ExecutorKind::Interpreter, takt_engine::ExecutorKind::Jit] {
        let mut engine = takt_tests::bench::load(&program, executor).expect("loads");
        engine.step(takt_abi::Time(0));
        assert_eq!(engine.fault().map(|f| f.fault), None);
    }
}

#[test]
fn what_is_written_as_text_reads_back_as_the_same_value() {
    let values = [
        ("LINT", "-9223372036854775808"),
        ("ULINT", "18446744073709551615"),
        ("BYTE", "255"),
        ("REAL", "1.5"),
        ("REAL", "1.0E20"),
        ("LREAL", "-1.0E-300"),
        ("LREAL", "123456789.125"),
        ("TIME", "T#49d17h2m47s295ms"),
        ("LTIME", "LTIME#1d2h3m4s5ms6us7ns"),
        ("DATE", "D#2106-02-07"),
        ("LDATE", "LDATE#2024-02-29"),
        ("TOD", "TOD#23:59:59.999"),
        ("LTOD", "LTOD#23:59:59.999999999"),
        ("DT", "DT#2024-02-29-13:05:09"),
        ("LDT", "LDT#2024-02-29-13:05:09.000000001"),
        ("BOOL", "TRUE"),
    ];
    let mut source = String::from("PROGRAM main VAR failed : STRING; ");
    for (i, (ty, value)) in values.iter().enumerate() {
        source += &format!("a{i}, b{i}, c{i} : {ty} := {value};\n");
    }
    source += "END_VAR\n";
    for (i, (ty, _)) in values.iter().enumerate() {
        source += &format!("b{i} := STRING_TO_{ty}({ty}_TO_STRING(a{i})); c{i} := WSTRING_TO_{ty}({ty}_TO_WSTRING(a{i}));\n");
        source += &format!("IF b{i} <> a{i} OR c{i} <> a{i} THEN failed := {ty}_TO_STRING(a{i}); END_IF\n");
    }
    source += "END_PROGRAM\n";
    let output = takt_tests::bench::compile(&source);
    let said: Vec<_> = output.diagnostics.iter().map(|d| d.message.clone()).collect();
    let program = std::sync::Arc::new(output.program.unwrap_or_else(|| panic!("{said:?}")));
    let mut engine = takt_tests::bench::load(&program, takt_engine::ExecutorKind::Jit).expect("loads");
    engine.step(takt_abi::Time(0));
    let place = takt_ir::resolve(&program, "main.failed").expect("a variable");
    assert_eq!(takt_ir::format_value(&program.types, place.ty, engine.read(place)), "''");
}
