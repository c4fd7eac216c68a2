//! Programs of unusual shape: each ends with success or clear messages, within the stack of an ordinary thread.

use std::fmt::Write;
use takt_compile::Output;
use takt_syntax::{Diagnostic, Severity};

/// Stack that compiling may use, bytes: half of what the tool's main thread has.
const STACK: usize = 8 << 20;

/// Compiles in a thread with little stack.
fn compile(text: String) -> Output {
    let work = move || {
        let start = std::time::Instant::now();
        let output = takt_tests::bench::compile(&text);
        eprintln!("compiled {} KiB in {:.2} s, {} message(s)", text.len() >> 10, start.elapsed().as_secs_f64(), output.diagnostics.len());
        output
    };
    std::thread::Builder::new().stack_size(STACK).spawn(work).expect("a thread").join().expect("no panic")
}

/// What `count` times gives.
fn times(count: usize, mut line: impl FnMut(usize) -> String) -> String {
    (0..count).fold(String::new(), |mut all, n| {
        let _ = writeln!(all, "{}", line(n));
        all
    })
}

fn errors(output: &Output) -> Vec<&Diagnostic> {
    output.diagnostics.iter().filter(|d| d.severity() == Severity::Error).collect()
}

/// The program is good: it verifies.
fn accepted(text: String) {
    let output = compile(text);
    let first = errors(&output).first().map(|d| format!("{}: {}", d.code.text(), d.message));
    assert_eq!(first, None);
    let program = output.program.expect("no error, so a program");
    takt_ir::verify(&program).expect("the verifier accepts it");
}

/// The program is refused with this code first.
fn refused(text: String, code: &str) -> Output {
    let output = compile(text);
    assert_eq!(errors(&output).first().map(|d| d.code.text()), Some(code), "{:?}", errors(&output).first());
    output
}

const MAIN: &str = "PROGRAM PLC_PRG\nVAR x : INT; END_VAR\nx := x + 1;\nEND_PROGRAM\n";

#[test]
fn a_hundred_thousand_brackets_are_refused() {
    let text = format!("PROGRAM PLC_PRG\nVAR x : INT; END_VAR\nx := {}1{};\nEND_PROGRAM\n", "(".repeat(100_000), ")".repeat(100_000));
    refused(text, "E0106");
}

#[test]
fn a_hundred_thousand_mistakes_are_reported() {
    let globals = times(20_000, |n| format!("    variable{n} : INT;"));
    let lines = times(100_000, |n| format!("    varaible{n} := 1;"));
    let text = format!("VAR_GLOBAL\n{globals}END_VAR\nPROGRAM PLC_PRG\n{lines}END_PROGRAM\n");
    let output = refused(text, "E0201");
    let unknown = errors(&output).iter().filter(|d| d.code.text() == "E0201").count();
    assert_eq!(unknown, 100_000, "{:?}", errors(&output).iter().find(|d| d.code.text() != "E0201"));
}

#[test]
fn a_hundred_thousand_globals_are_no_problem() {
    let globals = times(100_000, |n| format!("    g{n} : INT := {};", n % 1000));
    let text = format!("VAR_GLOBAL\n{globals}END_VAR\nPROGRAM PLC_PRG\ng1 := g99999;\nEND_PROGRAM\n");
    accepted(text);
}

#[test]
fn ten_thousand_global_lists_are_no_problem() {
    accepted(times(10_000, |n| format!("{{attribute 'gvl_name' := 'List{n}'}}\nVAR_GLOBAL\n a{n} : INT;\nEND_VAR")) + MAIN);
}

#[test]
fn ten_thousand_namespaces_are_no_problem() {
    let spaces = times(10_000, |n| format!("NAMESPACE N{n}\nFUNCTION F : INT\nF := {n};\nEND_FUNCTION\nEND_NAMESPACE"));
    let calls = times(2_000, |n| format!("x := N{n}.F();"));
    accepted(format!("{spaces}PROGRAM PLC_PRG\nVAR x : DINT; END_VAR\n{calls}END_PROGRAM\n"));
}

#[test]
fn ten_thousand_enumerators_are_no_problem() {
    let members: Vec<String> = (0..10_000).map(|n| format!("    m{n}")).collect();
    let uses = times(2_000, |n| format!("x := m{n};"));
    accepted(format!("TYPE E : (\n{}\n); END_TYPE\nPROGRAM PLC_PRG\nVAR x : E; END_VAR\n{uses}END_PROGRAM\n", members.join(",\n")));
}

#[test]
fn ten_thousand_members_are_no_problem() {
    let fields = times(10_000, |n| format!("    f{n} : INT := 1;"));
    let uses = times(2_000, |n| format!("s.f{n} := s.f9999;"));
    accepted(format!("TYPE S : STRUCT\n{fields}END_STRUCT END_TYPE\nPROGRAM PLC_PRG\nVAR s : S; END_VAR\n{uses}END_PROGRAM\n"));
}

#[test]
fn ten_thousand_inputs_are_no_problem() {
    let inputs = times(10_000, |n| format!("    i{n} : INT;"));
    let calls = times(500, |n| format!("b(i{n} := 1, i9999 := 2);"));
    accepted(format!(
        "FUNCTION_BLOCK B\nVAR_INPUT\n{inputs}END_VAR\nEND_FUNCTION_BLOCK\nPROGRAM PLC_PRG\nVAR b : B; END_VAR\n{calls}END_PROGRAM\n"
    ));
}

#[test]
fn ten_thousand_methods_are_no_problem() {
    let methods = times(10_000, |n| format!("METHOD M{n} : INT\nM{n} := {};\nEND_METHOD", n % 1000));
    let calls = times(2_000, |n| format!("x := b.M{n}();"));
    let block = format!("FUNCTION_BLOCK B\n{methods}END_FUNCTION_BLOCK\n");
    accepted(format!("{block}PROGRAM PLC_PRG\nVAR b : B; x : INT; END_VAR\n{calls}END_PROGRAM\n"));
}

#[test]
fn ten_thousand_cases_are_no_problem() {
    let arms = times(10_000, |n| format!("    {n}: x := {n};"));
    accepted(format!("PROGRAM PLC_PRG\nVAR x : DINT; END_VAR\nCASE x OF\n{arms}END_CASE\nEND_PROGRAM\n"));
}

#[test]
fn a_gigabyte_of_zeros_costs_the_compiler_nothing() {
    let text =
        "VAR_GLOBAL a : ARRAY [0..1000000000] OF BYTE; b : INT := 7; c : ARRAY [0..1000000000] OF BYTE := [1000000001(0)]; END_VAR\n";
    let output = compile(format!("{text}{MAIN}"));
    let program = output.program.expect("no error, so a program");
    assert!(program.init.len() < 1 << 20, "{} bytes", program.init.len());
    assert!(program.init_body.is_some(), "what lies behind is set by the start body");
}

#[test]
fn an_array_of_a_million_blocks_is_no_problem() {
    let blocks =
        "FUNCTION_BLOCK A\nVAR x : INT := 7; t : TON; END_VAR\nEND_FUNCTION_BLOCK\nFUNCTION_BLOCK B EXTENDS A\nEND_FUNCTION_BLOCK\n";
    let variables = "a : ARRAY[1..1000000] OF A; b : ARRAY[1..1000000] OF B; t : ARRAY[1..1000000] OF TON;";
    accepted(format!("{blocks}PROGRAM PLC_PRG\nVAR {variables} END_VAR\na[5](); b[7](); t[9]();\nEND_PROGRAM\n"));
}

#[test]
fn a_thousand_blocks_with_a_thousand_interfaces_are_no_problem() {
    let interfaces = times(1000, |n| format!("INTERFACE I{n}\nMETHOD M{n} : INT\nEND_METHOD\nEND_INTERFACE"));
    let all: Vec<String> = (0..1000).map(|n| format!("I{n}")).collect();
    let methods = times(1000, |n| format!("METHOD M{n} : INT\nEND_METHOD"));
    let base = format!("FUNCTION_BLOCK B\n{methods}END_FUNCTION_BLOCK\n");
    let blocks = times(1000, |n| format!("FUNCTION_BLOCK B{n} EXTENDS B IMPLEMENTS {}\nEND_FUNCTION_BLOCK", all.join(", ")));
    let variables = times(1000, |n| format!("i{n} : I{n}; b{n} : B{n};"));
    let calls = times(1000, |n| format!("i{n} := b{n}; x := i{n}.M{n}();"));
    accepted(format!("{interfaces}{base}{blocks}PROGRAM PLC_PRG\nVAR x : INT;\n{variables}END_VAR\n{calls}END_PROGRAM\n"));
}

#[test]
fn interfaces_that_extend_each_other_in_diamonds_are_no_problem() {
    let diamonds = times(60, |n| {
        format!("INTERFACE A{m} EXTENDS A{n}, B{n}\nEND_INTERFACE\nINTERFACE B{m} EXTENDS B{n}, A{n}\nEND_INTERFACE", m = n + 1)
    });
    let ends = "INTERFACE A0\nEND_INTERFACE\nINTERFACE B0\nEND_INTERFACE\nINTERFACE Other\nEND_INTERFACE\n";
    let block = "FUNCTION_BLOCK F IMPLEMENTS A60, B60\nEND_FUNCTION_BLOCK\n";
    let main = "PROGRAM PLC_PRG\nVAR f : F; a : A0; o : Other; END_VAR\na := f; __QUERYINTERFACE(a, o);\nEND_PROGRAM\n";
    accepted(format!("{ends}{diamonds}{block}{main}"));
}

#[test]
fn ten_thousand_blocks_that_extend_each_other_are_refused() {
    let chain = times(10_000, |n| format!("FUNCTION_BLOCK B{n} EXTENDS B{}\nVAR v{n} : INT; END_VAR\nEND_FUNCTION_BLOCK", n + 1));
    refused(format!("{chain}FUNCTION_BLOCK B10000\nEND_FUNCTION_BLOCK\n{MAIN}"), "E0106");
}

#[test]
fn ten_thousand_interfaces_that_extend_each_other_are_refused() {
    let chain = times(10_000, |n| format!("INTERFACE I{n} EXTENDS I{}\nEND_INTERFACE", n + 1));
    refused(format!("{chain}INTERFACE I10000\nEND_INTERFACE\n{MAIN}"), "E0106");
}

#[test]
fn ten_thousand_structures_that_contain_each_other_are_refused() {
    let chain = times(10_000, |n| format!("TYPE S{n} : STRUCT s : S{}; END_STRUCT END_TYPE", n + 1));
    refused(format!("{chain}TYPE S10000 : STRUCT s : INT; END_STRUCT END_TYPE\n{MAIN}"), "E0106");
}

#[test]
fn ten_thousand_blocks_that_contain_each_other_are_refused() {
    let chain = times(10_000, |n| format!("FUNCTION_BLOCK B{n}\nVAR b : B{}; END_VAR\nEND_FUNCTION_BLOCK", n + 1));
    refused(format!("{chain}FUNCTION_BLOCK B10000\nEND_FUNCTION_BLOCK\n{MAIN}"), "E0106");
}

#[test]
fn a_hundred_thousand_constants_that_need_the_next_are_refused() {
    let chain = times(100_000, |n| format!("    c{n} : INT := c{};", n + 1));
    refused(format!("VAR_GLOBAL CONSTANT\n{chain}    c100000 : INT := 1;\nEND_VAR\n{MAIN}"), "E0106");
}

#[test]
fn constants_that_need_the_next_within_deep_brackets_are_refused() {
    let (open, close) = ("-(".repeat(90), ")".repeat(90));
    let chain = times(200, |n| format!("    c{n} : LINT := {open}c{}{close};", n + 1));
    refused(format!("VAR_GLOBAL CONSTANT\n{chain}    c200 : LINT := 1;\nEND_VAR\n{MAIN}"), "E0106");
}

#[test]
fn a_hundred_thousand_constants_that_need_the_one_before_are_no_problem() {
    let chain = times(100_000, |n| format!("    c{} : INT := c{n};", n + 1));
    accepted(format!("VAR_GLOBAL CONSTANT\n    c0 : INT := 1;\n{chain}END_VAR\n{MAIN}"));
}

#[test]
fn ten_thousand_functions_that_call_the_next_are_no_problem() {
    let chain = times(10_000, |n| format!("FUNCTION F{n} : INT\nF{n} := F{}();\nEND_FUNCTION", n + 1));
    accepted(format!("{chain}FUNCTION F10000 : INT\nEND_FUNCTION\nPROGRAM PLC_PRG\nVAR x : INT; END_VAR\nx := F0();\nEND_PROGRAM\n"));
}

#[test]
fn ten_thousand_functions_above_a_cycle_are_no_problem() {
    let chain = times(10_000, |n| format!("FUNCTION F{n} : INT\nF{n} := F{}();\nEND_FUNCTION", n + 1));
    let end = "FUNCTION F10000 : INT\nVAR_INPUT n : INT; END_VAR\nIF n > 0 THEN F10000 := F10000(n - 1); END_IF\nEND_FUNCTION\n";
    let chain = chain.replace("F10000()", "F10000(3)");
    accepted(format!("{chain}{end}PROGRAM PLC_PRG\nVAR x : INT; END_VAR\nx := F0();\nEND_PROGRAM\n"));
}

#[test]
fn what_contains_itself_in_a_large_circle_is_refused() {
    let circle = times(100, |n| format!("TYPE S{n} : STRUCT s : S{}; END_STRUCT END_TYPE", (n + 1) % 100));
    refused(format!("{circle}{MAIN}"), "E0205");
    let circle = times(100, |n| format!("FUNCTION_BLOCK B{n} EXTENDS B{}\nEND_FUNCTION_BLOCK", (n + 1) % 100));
    refused(format!("{circle}{MAIN}"), "E0205");
}

#[test]
fn a_hundred_thousand_names_that_exist_are_refused() {
    let twice = times(100_000, |_| "    x : INT;".into());
    let output = refused(format!("PROGRAM PLC_PRG\nVAR\n{twice}END_VAR\nEND_PROGRAM\n"), "E0202");
    assert_eq!(errors(&output).len(), 99_999);
}
