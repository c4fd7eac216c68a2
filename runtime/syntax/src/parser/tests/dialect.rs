//! The dialect as programs use it, as data: `dialect.st` holds what is read; what is refused by name stands here.

use super::*;

/// Names and texts.
fn cases() -> impl Iterator<Item = (&'static str, &'static str)> {
    include_str!("dialect.st").split("\n--- ").skip(1).filter_map(|case| case.split_once(" ---\n"))
}

#[test]
fn every_shape_is_read() {
    assert!(cases().count() > 70);
    for (name, text) in cases() {
        let (_, diagnostics) = parse(FILE, text);
        assert_eq!(shown(text, &diagnostics), [""; 0], "{name}");
    }
}

#[test]
fn line_ends_and_white_space_mean_nothing() {
    for (name, text) in cases() {
        let tree = |text: &str| format!("{:?}", parse(FILE, text).0.units.len());
        let plain = tree(text);
        for other in
            [text.replace('\n', "\r\n"), text.replace(' ', "\t"), text.replace('\n', "\n\u{c}\u{b}"), format!("\u{feff}{text}\u{1a}")]
        {
            let (_, diagnostics) = parse(FILE, &other);
            let at_end = |d: &&Diagnostic| d.span.start as usize >= other.trim_end().len() - 1;
            let found: Vec<_> = diagnostics.iter().filter(|d| !at_end(d)).cloned().collect();
            assert_eq!(shown(&other, &found), [""; 0], "{name}");
            assert_eq!(tree(&other), plain, "{name}");
        }
    }
}

#[test]
fn what_has_no_meaning_here_is_refused_by_name() {
    let body = |body: &str| format!("PROGRAM p VAR x : INT; END_VAR\n{body}\nEND_PROGRAM\nPROGRAM q END_PROGRAM");
    for (text, language) in [
        ("LD x\nADD 1\nST x", "IL"),
        ("CAL fb(a := 1)\nJMPC next", "IL"),
        ("_FBD_BODY\n_NETWORKS : 1\n_NETWORK", "FBD"),
        ("_LD_BODY\n_NETWORKS : 2", "LD"),
        ("INITIAL_STEP one : a(N); END_STEP\nTRANSITION FROM one TO two := x; END_TRANSITION", "SFC"),
    ] {
        check(&body(text), &[&format!("2:1 E0108 a body in {language} is not supported")]);
    }
    check("FUNCTION_BLOCK f\nTRANSITION t := x; END_TRANSITION\nEND_FUNCTION_BLOCK", &["2:1 E0108 a body in SFC is not supported"]);
    check("TYPE s : STRUCT OVERLAP a : INT; END_STRUCT END_TYPE", &["1:17 E0108 `OVERLAP` is not supported"]);
    check("FUNCTION_BLOCK f EXTENDS b<5> END_FUNCTION_BLOCK", &["1:27 E0108 values for a generic base block are not supported"]);
    check(
        "PROGRAM p VAR_INPUT a : BOOL R_EDGE; b : INT f_edge; END_VAR END_PROGRAM",
        &["1:30 E0108 `R_EDGE` is not supported", "1:46 E0108 `f_edge` is not supported"],
    );
    check("PROGRAM p {sheep 5} END_PROGRAM", &["1:11 W0101 the pragma `{sheep 5}` is not known and has no effect"]);
}

#[test]
fn namespaces_are_where_units_stand() {
    let file = clean(
        "USING top;\nNAMESPACE a.b\nUSING c.d, e;\nTYPE t : INT; END_TYPE\nNAMESPACE INTERNAL c\nFUNCTION_BLOCK f USING g; VAR END_VAR END_FUNCTION_BLOCK\n\
         END_NAMESPACE\nINTERFACE i END_INTERFACE\nEND_NAMESPACE;\nVAR_GLOBAL x : INT; END_VAR",
    );
    let list = |names: &[Name]| names.iter().map(|name| name.text.as_str()).collect::<Vec<_>>().join(",");
    let homes: Vec<_> = file
        .units
        .iter()
        .map(|unit| match unit {
            Unit::Pou(pou) => &pou.home,
            Unit::Type(decl) => &decl.home,
            Unit::Globals(globals) => &globals.home,
            Unit::Interface(interface) => &interface.home,
            Unit::Configuration(configuration) => &configuration.home,
        })
        .map(|home| format!("{} {} {}", list(&home.namespace), list(&home.using), home.is_internal))
        .collect();
    assert_eq!(homes, ["a,b top,c.d,e false", "a,b,c top,c.d,e,g true", "a,b top,c.d,e false", " top false"]);
    check("NAMESPACE a\nFUNCTION f\nEND_NAMESPACE\nPROGRAM p END_PROGRAM", &["3:1 E0107 expected `END_FUNCTION`, found `END_NAMESPACE`"]);
    check("NAMESPACE a\nPROGRAM p END_PROGRAM", &["2:22 E0107 expected `END_NAMESPACE`, found the end of the file"]);
    check("END_NAMESPACE PROGRAM p END_PROGRAM", &["1:1 E0105 `END_NAMESPACE` belongs to no open NAMESPACE"]);
}

#[test]
fn members_find_the_unit_they_name() {
    let file = clean(
        "FUNCTION_BLOCK a END_FUNCTION_BLOCK FUNCTION_BLOCK b END_FUNCTION_BLOCK\nMETHOD A.m END_METHOD\nACTION b.n END_ACTION METHOD o END_METHOD",
    );
    let counts: Vec<_> = file
        .units
        .iter()
        .map(|unit| match unit {
            Unit::Pou(pou) => (pou.methods.len(), pou.actions.len()),
            _ => (9, 9),
        })
        .collect();
    assert_eq!(counts, [(1, 0), (1, 1)]);
    check(
        "FUNCTION_BLOCK a\nEND_FUNCTION_BLOCK\nMETHOD c.m END_METHOD",
        &["3:8 E0105 expected the name of a unit of this file before `.`, found `c`"],
    );
    check("FUNCTION_BLOCK a\nMETHOD c.m END_METHOD\nEND_FUNCTION_BLOCK", &["2:8 E0105 expected a member of `a`, found one of `c`"]);
}

#[test]
fn accessors_have_an_access_of_their_own() {
    let pou = pou(
        "FUNCTION_BLOCK f PROPERTY PROTECTED p : INT PRIVATE GET p := 1; END_GET SET INTERNAL\n x := p; END_SET END_PROPERTY PROPERTY INTERNAL q : INT GET END_GET END_PROPERTY END_FUNCTION_BLOCK",
    );
    use tree::Access::{Internal, Private};
    let access: Vec<_> = pou.properties.iter().map(|p| (p.get_access, p.set_access)).collect();
    assert_eq!(access, [(Private, Internal), (Internal, Internal)]);
}

#[test]
fn configurations_keep_what_the_standard_allows() {
    let (file, _) = parse(
        FILE,
        "CONFIGURATION k RESOURCE r ON cpu TASK t(SINGLE := go, PRIORITY := 1);\nPROGRAM RETAIN p WITH t : main(fb WITH slow, x := g, y => h);\nEND_RESOURCE\n\
         VAR_ACCESS a : r.p.x[1] : INT READ_WRITE; b : r.%MW5 : INT; END_VAR\nVAR_CONFIG r.p.lamps[1].on AT %QX0.0 : BOOL; END_VAR END_CONFIGURATION",
    );
    let Unit::Configuration(configuration) = &file.units[0] else { panic!() };
    let program = &configuration.programs[0];
    assert!(program.retain && program.blocks[0].1.text == "slow");
    assert_eq!(program.connections.iter().map(brief_arg).collect::<Vec<_>>(), ["x := g", "y => h"]);
    let access: Vec<_> = configuration.access.iter().map(|a| (a.name.text.as_str(), brief(&a.path), a.is_writable)).collect();
    assert_eq!(access, [("a", "r.p.x[1]".to_owned(), true), ("b", "%MW5".to_owned(), false)]);
    assert_eq!(configuration.globals[0].vars[0].name.text, "r.p.lamps[1].on");
}

#[test]
fn lists_without_brackets_are_lists() {
    check_var("a : ARRAY [0..3] OF INT := 1, 2(5), N, -4;", "a: [0..3]INT := [1,2x(5),N,(Neg 4)]");
    check_var("a : ARRAY [0..3] OF INT := 4(0); b : S := (x := 1, 2, y := 3);", "a: [0..3]INT := [4x(0)]; b: S := (x=[1,2],y=3)");
    check_var("f : ARRAY [0..1] OF FB[(1), (a := 2)];", "f: [0..1]FB");
    check_var("f : FB<5, 2 * N>(1) := (x := 1);", "f: FB<5,(2 Mul N)>(1) := (x=1)");
    check("PROGRAM p VAR a : INT := 1, b : INT; END_VAR END_PROGRAM", &["1:27 E0105 expected `;`, found `,`"]);
}
