//! Conditional pragmas and the other directives.

use super::*;
use crate::{Conditions, Source, parse_under};

/// Whether a condition holds at the end of a program that declares a few things.
#[track_caller]
fn asks(condition: &str, expected: bool) {
    let text = format!(
        "{{attribute 'pou_mark' := '1'}}\nFUNCTION_BLOCK PUBLIC Motor EXTENDS Base\nVAR_INPUT {{attribute 'var_mark'}} rpm : ARRAY [0..1] OF  INT; END_VAR\n\
         METHOD PUBLIC start : BOOL VAR_INPUT hurry : REAL; END_VAR END_METHOD\nEND_FUNCTION_BLOCK\n\
         FUNCTION_BLOCK Base VAR_OUTPUT old : BOOL; END_VAR END_FUNCTION_BLOCK\n\
         TYPE Point : STRUCT x, y : LREAL; inner : STRUCT z : INT; END_STRUCT; END_STRUCT;\n Alias : INT; Color : (red, green); END_TYPE\n\
         VAR_GLOBAL CONSTANT LIMIT : INT := 5; END_VAR\n{{define LEVEL '3'}}{{define Ready}}\n\
         PROGRAM p\nVAR CONSTANT c : INT := 7; END_VAR VAR m : Motor; pt : Point; s : STRING(80); END_VAR\n\
         {{IF {condition}}} yes(); {{ELSE}} no(); {{END_IF}}\nEND_PROGRAM\n\
         CONFIGURATION k RESOURCE cpu ON pc TASK fast(PRIORITY := 1); PROGRAM q WITH fast : p; END_RESOURCE END_CONFIGURATION"
    );
    let file = clean(&text);
    let body = file.units.iter().find_map(|unit| match unit {
        Unit::Pou(pou) if pou.name.text == "p" => Some(brief_body(&pou.body)),
        _ => None,
    });
    assert_eq!(body.as_deref(), Some(if expected { "yes();" } else { "no();" }), "{condition}");
}

#[test]
fn conditions_ask_for_what_is_declared() {
    for (condition, expected) in [
        ("defined(LEVEL)", true),
        ("defined (level)", true),
        ("defined(other)", false),
        ("NOT defined(other)", true),
        ("not not defined(other)", false),
        ("defined(LEVEL) AND defined(other) OR defined(Ready)", true),
        ("defined(LEVEL) AND (defined(other) OR defined(none))", false),
        ("defined(IsLittleEndian)", true),
        ("defined(IsSimulationMode)", false),
        ("hasvalue(RegisterSize, '64')", true),
        ("hasvalue(LEVEL, '3')", true),
        ("hasvalue(LEVEL, '4')", false),
        ("hasvalue(other, '3')", false),
        ("project_defined(LEVEL)", false),
        ("defined(pou: Motor)", true),
        ("defined(pou: motor.start)", true),
        ("defined(pou: Point)", false),
        ("defined(type: Point)", true),
        ("defined(type: color)", true),
        ("defined(type: LTIME)", true),
        ("defined(type: Motor)", false),
        ("defined(variable: m)", true),
        ("defined(variable: m.rpm)", true),
        ("defined(variable: m.old)", true),
        ("defined(variable: m.hurry)", false),
        ("defined(variable: pt.y)", true),
        ("defined(variable: pt.z)", false),
        ("defined(variable: LIMIT)", true),
        ("defined(variable: p.pt.x)", true),
        ("defined(variable: nobody)", false),
        ("defined(task: fast)", true),
        ("defined(task: slow)", false),
        ("defined(resource: cpu)", true),
        ("hastype(variable: m.rpm, array[0..1] of int)", true),
        ("hastype(variable: s, STRING(80))", true),
        ("hastype(variable: s, STRING)", false),
        ("hastype(variable: nobody, INT)", false),
        ("hasattribute(pou: Motor, 'pou_mark')", true),
        ("hasattribute(pou: Base, 'pou_mark')", false),
        ("hasattribute(variable: m.rpm, 'var_mark')", true),
        ("hasattribute(variable: m.old, 'var_mark')", false),
        ("hasconstantvalue(c, 7)", true),
        ("hasconstantvalue(variable: LIMIT, 6)", false),
    ] {
        asks(condition, expected);
    }
}

#[test]
fn what_is_excluded_is_not_looked_at() {
    let text =
        "PROGRAM p\n{IF defined(a)}\n{IF defined(b)} x := ; {ELSE} := := 'open\n{END_IF}{error 'no'} {END_IF} {warning 'yes'} END_PROGRAM";
    check(text, &["4:31 W0102 yes"]);
    let text = "// one\n\n{IF defined(a)}\n// two\nPROGRAM p\n{ELSE}\n// three\n{attribute 'x'}\nPROGRAM q\n{END_IF}\nVAR // of a\n a : INT; END_VAR\nEND_PROGRAM";
    let unit = pou(text);
    assert_eq!((unit.name.text.as_str(), unit.doc.as_deref(), unit.pragmas.len()), ("q", Some("three"), 1));
}

#[test]
fn a_define_ends_with_its_unit() {
    let unit = |name: &str, define: &str| format!("FUNCTION {name}\n{define} {{IF defined(X)}} a(); {{END_IF}} END_FUNCTION\n");
    let text = unit("f", "{define X}") + &unit("g", "") + "{define X 'v'}\n" + &unit("h", "{undefine X}") + &unit("i", "");
    let lengths: Vec<_> = clean(&text)
        .units
        .iter()
        .map(|unit| match unit {
            Unit::Pou(pou) => pou.body.len(),
            _ => 9,
        })
        .collect();
    assert_eq!(lengths, [1, 0, 0, 1]);
}

#[test]
fn conditions_see_the_project() {
    let source = |name: &str, text: &str| Source { name: name.to_owned(), text: text.to_owned() };
    let sources = [
        source("src/GVL.st", "{attribute 'qualified_only'}\nVAR_GLOBAL far : INT; END_VAR\nFUNCTION Help END_FUNCTION"),
        source(
            "src/main.st",
            "{IF defined(variable: GVL.far) AND NOT defined(variable: far) AND defined(pou: Help) AND project_defined(D)}\nPROGRAM p END_PROGRAM\n{END_IF}",
        ),
    ];
    let conditions = Conditions::of(sources.iter(), &[("D".to_owned(), String::new())]);
    assert_eq!(parse_under(FILE, &sources[1].text, &conditions).0.units.len(), 1);
    assert_eq!(parse(FILE, &sources[1].text).0.units.len(), 0);
    let mut conditions = Conditions::default();
    conditions.add_pou("TON");
    assert_eq!(parse_under(FILE, "{IF defined(pou: TON)} PROGRAM p END_PROGRAM {END_IF}", &conditions).0.units.len(), 1);
}

#[test]
fn mistakes_in_pragmas_are_named() {
    check("{IF SIM} {END_IF}", &["1:1 E0110 expected `defined(…)`, `hasvalue(…)`, `hastype(…)` or `hasattribute(…)`, found `SIM`"]);
    check(
        "{IF} {END_IF}",
        &["1:1 E0110 expected `defined(…)`, `hasvalue(…)`, `hastype(…)` or `hasattribute(…)`, found the end of the pragma"],
    );
    check("{IF defined(a} {END_IF}", &["1:1 E0110 expected `)`, found the end of the pragma"]);
    check("{IF defined(a) b} {END_IF}", &["1:1 E0110 expected `AND`, `OR` or `}`, found `b`"]);
    check("{IF defined(thing: a)} {END_IF}", &["1:1 E0110 expected `variable:`, `type:`, `pou:`, `task:` or `resource:`, found `THING:`"]);
    check("{IF hasvalue(a, b)} {END_IF}", &["1:1 E0110 expected a text in `'`, found `b`"]);
    check("{IF hasconstantvalue(a, 5, >)} {END_IF}", &["1:1 E0110 a comparison other than `=` is not supported in `hasconstantvalue`"]);
    check("{IF defined(a)} PROGRAM", &["1:1 E0110 this `{IF}` is not closed by `{END_IF}`"]);
    check(
        "{ELSE} {END_IF} {ELSIF defined(a)}",
        &[
            "1:1 E0110 `{ELSE}` belongs to no open `{IF}`",
            "1:8 E0110 `{END_IF}` belongs to no open `{IF}`",
            "1:17 E0110 `{ELSIF}` belongs to no open `{IF}`",
        ],
    );
    check("{IF defined(a)} {ELSE} {ELSE} {END_IF}", &["1:24 E0110 `{ELSE}` behind the `{ELSE}` of the same `{IF}`"]);
    check(
        "{define} {undefine 1-2}",
        &["1:1 E0110 expected a name behind `define`, found ``", "1:10 E0110 expected a name behind `undefine`, found `1-2`"],
    );
    check(
        "{warning disable W0301, W9999, E0301, C0195} {warning restore W0301}",
        &["1:1 E0110 there is no warning `W9999`", "1:1 E0110 `E0301` is an error and cannot be disabled"],
    );
    check("{error 'stop'} {warning \"mind\"} {info 'x'} {text 'y'} {region 'z'} {endregion}", &["1:1 E0109 stop", "1:16 W0102 mind"]);
    check(
        "{warning disable W0101} {strange} {warning restore W0101} {strange 2}",
        &["1:59 W0101 the pragma `{strange 2}` is not known and has no effect"],
    );
    let deep = format!("{{IF {}defined(a){}}} {{END_IF}}", "(".repeat(10_000), ")".repeat(10_000));
    check(&deep, &["1:1 E0110 nested more than 50 levels deep"]);
    clean(&format!("{}{}", "{IF defined(a)}\n".repeat(20_000), "{END_IF}\n".repeat(20_000)));
}
