//! Depth, nonsense and long files: nothing makes the parser fall over or say one thing twice.

use super::*;

/// Runs on a small stack, as of a thread.
fn on_small_stack(run: impl FnOnce() + Send + 'static) {
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(run);
    assert!(thread.expect("a thread starts").join().is_ok());
}

#[track_caller]
fn too_deep(text: String) {
    let (file, diagnostics) = parse(FILE, &text);
    let head: String = text.chars().take(60).collect();
    assert_eq!(diagnostics.iter().map(|d| d.code.text()).collect::<Vec<_>>(), ["E0106"], "{head}");
    drop(file);
}

#[test]
fn depth_is_bounded_and_said_once() {
    on_small_stack(|| {
        const N: usize = 100_000;
        let body = |text: String| format!("PROGRAM p\n{text}\nEND_PROGRAM");
        too_deep(body(format!("a := {}1{};", "(".repeat(N), ")".repeat(N))));
        too_deep(body(format!("a := {}1;", "(".repeat(N))));
        too_deep(body(format!("a := {}1;", "-".repeat(N))));
        too_deep(body(format!("a := {}b;", "NOT ".repeat(N))));
        too_deep(body(format!("a := b{};", ".c".repeat(N))));
        too_deep(body(format!("a := b{};", "^".repeat(N))));
        too_deep(body(format!("a := b{};", "[1]".repeat(N))));
        too_deep(body(format!("a := {}1{};", "b[".repeat(N), "]".repeat(N))));
        too_deep(body(format!("a := {}1{};", "f(".repeat(N), ")".repeat(N))));
        too_deep(body(format!("{}{}", "IF a THEN ".repeat(N), "END_IF ".repeat(N))));
        too_deep(body(format!("{}{} b := 1;", "FOR i := 1 TO 2 DO CASE x OF 1: ".repeat(N / 2), "END_CASE END_FOR ".repeat(N / 2))));
        too_deep(format!("PROGRAM p VAR a : {}INT; END_VAR END_PROGRAM", "POINTER TO ".repeat(N)));
        too_deep(format!("PROGRAM p VAR a : {}INT; END_VAR END_PROGRAM", "ARRAY [0..1] OF ".repeat(N)));
        too_deep(format!("PROGRAM p VAR a : INT := {}1{}; END_VAR END_PROGRAM", "[".repeat(N), "]".repeat(N)));
        too_deep(format!("PROGRAM p VAR a : INT := {}1{}; END_VAR END_PROGRAM", "(x := ".repeat(N), ")".repeat(N)));
    });
}

#[test]
fn rows_of_operators_have_no_bound() {
    on_small_stack(|| {
        const N: usize = 100_000;
        for row in [" + 1", " - 1.0 * b", " AND NOT (c OR d)", " OR b AND c", " = 1", " ** 2", " + (1 + 2)"] {
            let text = format!("PROGRAM p a := 1{}; END_PROGRAM", row.repeat(N));
            let file = clean(&text);
            assert_eq!(file.clone(), file);
        }
        let nested = "(".repeat(30) + "1" + &format!("{})", " + 1".repeat(300)).repeat(30);
        clean(&format!("PROGRAM p a := {nested}; END_PROGRAM"));
    });
}

#[test]
fn a_long_row_is_applied_from_the_left() {
    let row: Vec<String> = (0..300).map(|i| format!("a{i}")).collect();
    let expected = row.iter().skip(1).fold(row[0].clone(), |left, right| format!("({left} Sub {right})"));
    check_expr(&row.join(" - "), &expected);
    let expected = row.iter().skip(1).fold(row[0].clone(), |left, right| format!("({left} Sub ({right} Mul 2))"));
    check_expr(&(row.join(" * 2 - ") + " * 2").replacen("a0 * 2", "a0", 1), &expected);
    check_expr(
        &format!("({}) - b", row.join(" - ")),
        &format!("({} Sub b)", row.iter().skip(1).fold(row[0].clone(), |l, r| format!("({l} Sub {r})"))),
    );
}

#[test]
fn deep_nests_within_the_bound_are_read() {
    on_small_stack(|| {
        let text = format!(
            "PROGRAM p\n{}a := {}1{};{}\nEND_PROGRAM",
            "IF a THEN ".repeat(90),
            "(".repeat(90),
            ")".repeat(90),
            "END_IF ".repeat(90)
        );
        clean(&text);
        clean(&format!("PROGRAM p a := 1{}; END_PROGRAM", " OR b".repeat(190)));
        let chain = "a AND (b OR c XOR d AND e = f < g + h * i ** (-j[k(".repeat(30);
        parse(FILE, &format!("PROGRAM p a := {chain}; END_PROGRAM"));
    });
}

/// Pieces from which nonsense is made: every word of the language and some ill-made ones.
const SOUP: &str = "IF THEN ELSIF ELSE END_IF CASE OF END_CASE FOR TO BY DO END_FOR WHILE END_WHILE REPEAT UNTIL END_REPEAT EXIT RETURN JMP __TRY __CATCH \
    __FINALLY __ENDTRY AND OR XOR NOT MOD AND_THEN TRUE FALSE FUNCTION END_FUNCTION FUNCTION_BLOCK END_FUNCTION_BLOCK PROGRAM END_PROGRAM TYPE END_TYPE \
    STRUCT END_STRUCT UNION END_UNION VAR VAR_INPUT VAR_GLOBAL VAR_CONFIG VAR_ACCESS END_VAR ARRAY AT CONFIGURATION END_CONFIGURATION RESOURCE \
    END_RESOURCE TASK WITH ON INTERFACE END_INTERFACE METHOD END_METHOD PROPERTY END_PROPERTY GET END_GET SET END_SET ACTION END_ACTION CLASS END_CLASS \
    NAMESPACE END_NAMESPACE USING EXTENDS IMPLEMENTS THIS SUPER POINTER REFERENCE REF_TO CONSTANT RETAIN PUBLIC ABSTRACT CONTINUE STRING WSTRING INT \
    a b c x.y f( g[ 5 1.5 16#FF 2#102 T#5s T# D#2024-02-30 'str' 'open \"w\" INT#5 BOOL# E#red %IX0.0 %I* %X3 % := => ?= S= R= REF= = <> < <= > >= + - * ** \
    / & ^ . .. , ; ; ; : ( ) ( ) [ ] # == != && || ! += -> ++ { } {attribute (* *) /* */ // ； “ é 温 @ $ \\ ENDIF ELSEIF 1a 0x1F";

#[test]
fn no_nonsense_makes_it_panic_or_hang() {
    let words: Vec<&str> = SOUP.split_whitespace().collect();
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let mut text = String::new();
    for case in 0..100_000 {
        text.clear();
        text.push_str(["PROGRAM p ", "", "TYPE t : ", "PROGRAM p VAR ", "FUNCTION_BLOCK f "][case % 5]);
        for _ in 0..random(30) {
            text.push_str(words[random(words.len())]);
            text.push_str([" ", " ", " ", "\n", ""][random(5)]);
        }
        let (_, diagnostics) = parse(FILE, &text);
        for span in diagnostics.iter().flat_map(|d| d.notes.iter().map(|note| note.span).chain([d.span])) {
            assert!(text.get(span.start as usize..span.end as usize).is_some(), "{span:?} in {text}");
        }
    }
}

#[test]
fn programs_with_many_mistakes_end() {
    let tokens = lexer::lex(FILE, MACHINE).tokens;
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    for _ in 0..2000 {
        let mut pieces: Vec<&str> = tokens.iter().map(|token| &MACHINE[token.start as usize..token.end as usize]).collect();
        for _ in 0..1 + random(12) {
            let (one, other) = (random(pieces.len()), random(pieces.len()));
            match random(3) {
                0 => drop(pieces.remove(one)),
                1 => pieces.swap(one, other),
                _ => pieces.insert(one, pieces[other]),
            }
        }
        let text: String = pieces.iter().flat_map(|piece| [*piece, [" ", "\n"][random(2)]]).collect();
        parse(FILE, &text);
    }
    parse(FILE, "PROGRAM p CASE a OF NOT => 1: b(); END_CASE END_PROGRAM");
}

#[test]
fn any_bytes_are_survived() {
    let mut state = 88_172_645_463_325_252_u64;
    for _ in 0..2000 {
        let bytes: Vec<u8> = (0..200)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                state as u8
            })
            .collect();
        parse(FILE, &String::from_utf8_lossy(&bytes));
    }
}

/// Seconds are not measured here; that the work is linear shows in tests that end.
#[test]
fn long_files_of_mistakes_end() {
    const N: usize = 50_000;
    for (piece, head) in [
        ("a := 5;\n", "PROGRAM p VAR\n"),
        ("a : INT\n", "PROGRAM p VAR\n"),
        ("IF a b\n c d\n", "PROGRAM p\n"),
        ("END_IF ", "PROGRAM p\n"),
        ("{ ", ""),
        ("{attribute ", ""),
        ("@ ", ""),
        ("' ", ""),
        ("// c\n", ""),
        ("a,", "PROGRAM p VAR "),
        ("a + ", "PROGRAM p "),
        ("a.b", "PROGRAM p "),
        ("CASE a OF 1:", "PROGRAM p "),
        ("f(\n", "PROGRAM p "),
        ("a := (\n", "PROGRAM p "),
        ("METHOD m\n", "FUNCTION_BLOCK p "),
        ("VAR ", "PROGRAM p "),
        ("TASK t ", "CONFIGURATION c "),
        ("ELSEIF ", "PROGRAM p "),
        ("TYPE < ", "TYPE t : "),
        ("END_ACTION BOOL IMPLEMENTS S= ", "PROGRAM p VAR "),
        ("VAR_GENERIC b JMP ", "PROGRAM p "),
        ("PERSISTENT / ELSE * ", "PROGRAM p "),
        ("“ PRIVATE MOD > INTERFACE ", ""),
        ("NAMESPACE a ", ""),
        ("USING a; FUNCTION f END_FUNCTION ", ""),
        ("{IF defined(x)} ", ""),
        ("{IF defined(x)} {ELSE} {END_IF} ", "PROGRAM p "),
        ("{error 'e'} ", ""),
        ("{warning disable W0301} ", ""),
        ("{define x} ", "PROGRAM p "),
        ("CASE a OF x ", "PROGRAM p "),
        ("FOR (", "PROGRAM p "),
        ("f<", "PROGRAM p VAR a : "),
        ("END IF ", "PROGRAM p "),
        ("METHOD f.m END_METHOD ", "FUNCTION_BLOCK f END_FUNCTION_BLOCK "),
        ("METHOD m ", "INTERFACE i "),
        ("\0", "PROGRAM p "),
        ("\u{fffd}", ""),
    ] {
        let (_, diagnostics) = parse(FILE, &format!("{head}{}", piece.repeat(N)));
        assert!(diagnostics.len() <= 3 * MAX_DIAGNOSTICS, "{piece}");
    }
}

#[test]
fn heads_of_cases_without_end_do_not_exhaust_the_stack() {
    on_small_stack(|| {
        for piece in ["CASE a OF x ", "x THEN ", "x DO ", "NAMESPACE a ", "REPEAT ", "f<", "FOR ("] {
            parse(FILE, &format!("PROGRAM p {}", piece.repeat(20_000)));
            parse(FILE, &piece.repeat(20_000));
        }
    });
}

#[test]
fn a_text_beyond_the_bound_is_refused_at_once() {
    let text = " ".repeat(MAX_TEXT + 1);
    check(&text, &["1:1 E0108 a source file of more than 32 MiB is not supported"]);
    assert_eq!(parse_expression(FILE, &text).1.len(), 1);
    check(&"// nothing\n".repeat(1_000_000), &[]);
    clean(&format!("PROGRAM p\n{}END_PROGRAM", "a := b + 1;\n".repeat(200_000)));
}

/// A program that uses most of the language.
const MACHINE: &str = include_str!("machine.st");

#[test]
fn a_token_left_out_or_doubled_is_no_cascade() {
    clean(MACHINE);
    let tokens = lexer::lex(FILE, MACHINE).tokens;
    let edges = &tokens[..tokens.len() - 1];
    let mut left_out = [0_usize; 6];
    let mut replaced = [0_usize; 6];
    for token in edges {
        let (start, end) = (token.start as usize, token.end as usize);
        for insert in ["", " x ", " ) ", " ; ", " := ", " END_IF "] {
            let text = format!("{}{insert}{}", &MACHINE[..start], &MACHINE[end..]);
            let counts = if insert.is_empty() { &mut left_out } else { &mut replaced };
            counts[parse(FILE, &text).1.len().min(5)] += 1;
        }
    }
    // A word in the place of another one is two mistakes to a reader: one is missing and one is too many.
    let share = |counts: &[usize; 6], most: usize| counts[..=most].iter().sum::<usize>() * 100 / edges.len();
    assert!(share(&left_out, 1) >= 95 && share(&left_out, 2) >= 98, "{left_out:?}");
    assert!(share(&replaced, 2) >= 5 * 85, "{replaced:?}");
}
