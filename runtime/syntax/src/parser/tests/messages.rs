//! One mistake, one message that says what to write.

use super::*;

#[test]
fn a_keyword_in_place_of_a_name_is_one_mistake() {
    check_body("x := IF;\ny := 1;", &["1:6 E0105 expected an expression, found the keyword `IF`"]);
    check_body("if := 3;\ny := 1;", &["1:1 E0105 expected the name of a variable, found the keyword `if`"]);
    check_body(
        "For := 3;\ny := 1 + Case * 2;",
        &[
            "1:1 E0105 expected the name of a variable, found the keyword `For`",
            "2:10 E0105 expected an expression, found the keyword `Case`",
        ],
    );
    check(
        "PROGRAM p VAR\nif : INT;\na : INT; type AT %IX0.0 : BOOL;\nb : INT; END_VAR END_PROGRAM",
        &[
            "2:1 E0105 expected the name of a variable, found the keyword `if`",
            "3:10 E0105 expected the name of a variable, found the keyword `type`",
        ],
    );
}

#[test]
fn ends_in_two_words_are_understood() {
    check(
        "PROGRAM p VAR a : INT; END VAR IF a THEN b(); END IF; a := 1; End Program",
        &[
            "1:24 E0105 `END VAR` is written `END_VAR`",
            "1:47 E0105 `END IF` is written `END_IF`",
            "1:63 E0105 `End Program` is written `END_PROGRAM`",
        ],
    );
    check_body("a();\nBEGIN\na := 1;\nEND", &["2:1 E0105 `BEGIN` is no word of ST", "4:1 E0105 `END` is no word of ST"]);
    clean("PROGRAM p VAR end, begin : INT; END_VAR end := begin; END_PROGRAM");
}

#[test]
fn signs_of_other_languages_are_named() {
    check_body(
        "x <<= 1; x := y << 2; x := y >> 2; x := a | b; x := ~a; x =: 1;",
        &[
            "1:3 E0105 `<<=` is not an ST operator",
            "1:17 E0105 `<<` is not an ST operator",
            "1:30 E0105 `>>` is not an ST operator",
            "1:43 E0105 `|` is not an ST operator",
            "1:53 E0105 `~` is not an ST operator",
            "1:59 E0105 `=:` is not an ST operator",
        ],
    );
    check_body("FOR (i = 0; i < 5; i++) DO a(); END_FOR\nb := 1;", &["1:5 E0105 expected the control variable of `FOR`, found `(`"]);
    check_body("WHILE a { b(); } END_WHILE", &["1:9 E0105 braces do not make a block in ST"]);
    check("FUNCTION f(a : INT) : INT\nEND_FUNCTION", &["1:11 E0105 expected the end of the line or `:` and a type, found `(`"]);
    check_body("CASE a OF 1: b(); ELSE: c(); END_CASE", &["1:23 E0105 expected a statement, found `:`"]);
}

#[test]
fn what_is_no_st_at_all_is_one_message() {
    check("\n<?xml version=\"1.0\"?>\n<TcPlcObject>PROGRAM p</TcPlcObject>", &["2:1 E0108 expected Structured Text, found XML"]);
    check("def f(x):\n    return x + 1\n", &["1:1 E0105 expected a program unit such as PROGRAM or TYPE, found `def`"]);
    check("FUNCTION_BLOCK f\nMETHOD\nEND_METHOD\nEND_FUNCTION_BLOCK", &["3:1 E0105 expected the name of the method, found `END_METHOD`"]);
}
