//! Facts about the parser as a whole: what is read, what is said of mistakes, and that nothing makes it fall over.

mod conditions;
mod dialect;
mod messages;
mod replay;
mod robustness;

use super::*;
use crate::LineIndex;
use crate::tree::{
    Arg, ArgKind, Expr, ExprKind, Init, InitItem, LiteralValue, Pou, Stmt, StmtKind, TypeExpr, TypeExprKind, TypeKind, Unit, VarKind,
};

const FILE: FileId = FileId(0);

fn shown(text: &str, diagnostics: &[Diagnostic]) -> Vec<String> {
    let index = LineIndex::new(text);
    diagnostics
        .iter()
        .map(|d| {
            let (line, column) = index.position(text, d.span.start);
            format!("{line}:{column} {} {}", d.code.text(), d.message)
        })
        .collect()
}

/// The messages about a file.
#[track_caller]
fn check(text: &str, expected: &[&str]) {
    let (_, diagnostics) = parse(FILE, text);
    assert_eq!(shown(text, &diagnostics), expected, "{text}");
}

/// The messages about statements, which begin in line 1, column 1.
#[track_caller]
fn check_body(body: &str, expected: &[&str]) {
    let text = format!("{body}\nEND_PROGRAM");
    let (_, diagnostics) = parse(FILE, &format!("PROGRAM p {text}"));
    let shift = "PROGRAM p ".len() as u32;
    let index = LineIndex::new(&text);
    let found: Vec<_> = diagnostics
        .iter()
        .map(|d| {
            let (line, column) = index.position(&text, d.span.start - shift);
            format!("{line}:{column} {} {}", d.code.text(), d.message)
        })
        .collect();
    assert_eq!(found, expected, "{body}");
}

#[track_caller]
fn clean(text: &str) -> tree::File {
    let (file, diagnostics) = parse(FILE, text);
    assert_eq!(shown(text, &diagnostics), [""; 0], "{text}");
    file
}

#[track_caller]
fn pou(text: &str) -> Pou {
    match clean(text).units.swap_remove(0) {
        Unit::Pou(pou) => pou,
        other => panic!("{other:?}"),
    }
}

/// An expression with all its brackets.
fn brief(expr: &Expr) -> String {
    let list = |exprs: &[Expr]| exprs.iter().map(brief).collect::<Vec<_>>().join(", ");
    match &expr.kind {
        ExprKind::Literal(literal) => match &literal.value {
            LiteralValue::Int(value) => value.to_string(),
            LiteralValue::Bool(value) => value.to_string(),
            other => format!("{other:?}"),
        },
        ExprKind::Name(name) => name.clone(),
        ExprKind::Global(name) => format!(".{}", name.text),
        ExprKind::Member(base, name) => format!("{}.{}", brief(base), name.text),
        ExprKind::Part(base, part) => format!("{}.{part:?}", brief(base)),
        ExprKind::Index(base, indices) => format!("{}[{}]", brief(base), list(indices)),
        ExprKind::Deref(base) => format!("{}^", brief(base)),
        ExprKind::Call(base, args) => format!("{}({})", brief(base), args.iter().map(brief_arg).collect::<Vec<_>>().join(", ")),
        ExprKind::Unary(op, operand) => format!("({op:?} {})", brief(operand)),
        ExprKind::Binary(op, left, right) => format!("({} {op:?} {})", brief(left), brief(right)),
        ExprKind::Chain(first, links) => {
            links.iter().fold(brief(first), |left, link| format!("({left} {:?} {})", link.op, brief(&link.right)))
        }
        ExprKind::This => "THIS".to_owned(),
        ExprKind::Super => "SUPER".to_owned(),
        ExprKind::Direct(direct) => direct.text.clone(),
        ExprKind::Typed(ty, member) => format!("{}#{}", ty.text, member.text),
        ExprKind::Assign(place, value) => format!("({} := {})", brief(place), brief(value)),
        ExprKind::Error => "?".to_owned(),
    }
}

fn brief_arg(arg: &Arg) -> String {
    let value = arg.value.as_ref().map_or(String::new(), brief);
    match (&arg.name, arg.kind) {
        (Some(name), ArgKind::In) => format!("{} := {value}", name.text),
        (Some(name), ArgKind::Out) => format!("{} => {value}", name.text),
        (Some(name), ArgKind::NotOut) => format!("NOT {} => {value}", name.text),
        (Some(name), ArgKind::Ref) => format!("{} REF= {value}", name.text),
        (None, _) => value,
    }
}

#[track_caller]
fn check_expr(text: &str, expected: &str) {
    let (expr, diagnostics) = parse_expression(FILE, text);
    assert_eq!(shown(text, &diagnostics), [""; 0], "{text}");
    assert_eq!(brief(&expr), expected, "{text}");
    assert_eq!((expr.span.start as usize, expr.span.end as usize), (0, text.len()), "{text}");
}

/// Statements in one line each.
fn brief_body(body: &[Stmt]) -> String {
    body.iter().map(brief_stmt).collect::<Vec<_>>().join(" ")
}

fn brief_stmt(stmt: &Stmt) -> String {
    let block = |body: &[Stmt]| format!("{{{}}}", brief_body(body));
    let maybe = |body: &Option<Vec<Stmt>>| body.as_ref().map_or(String::new(), |body| format!(" else{}", block(body)));
    match &stmt.kind {
        StmtKind::Assign { targets, value } => {
            let places: Vec<_> = targets.iter().map(|(place, op)| format!("{} {op:?}", brief(place))).collect();
            format!("{} {};", places.join(" "), brief(value))
        }
        StmtKind::Expr(expr) => format!("{};", brief(expr)),
        StmtKind::If { arms, otherwise } => {
            let arms: Vec<_> = arms.iter().map(|(cond, body)| format!("if {} {}", brief(cond), block(body))).collect();
            arms.join(" ") + &maybe(otherwise)
        }
        StmtKind::Case { value, arms, otherwise } => {
            let label = |label: &tree::CaseLabel| match label {
                tree::CaseLabel::Value(value) => brief(value),
                tree::CaseLabel::Range(low, high) => format!("{}..{}", brief(low), brief(high)),
            };
            let arms: Vec<_> = arms
                .iter()
                .map(|(labels, body)| format!("{}{}", labels.iter().map(label).collect::<Vec<_>>().join(","), block(body)))
                .collect();
            format!("case {} {}{}", brief(value), arms.join(" "), maybe(otherwise))
        }
        StmtKind::For { var, from, to, by, body } => {
            let by = by.as_ref().map_or(String::new(), |by| format!(" by {}", brief(by)));
            format!("for {} {} {}{by} {}", brief(var), brief(from), brief(to), block(body))
        }
        StmtKind::While { cond, body } => format!("while {} {}", brief(cond), block(body)),
        StmtKind::Repeat { body, until } => format!("repeat {} until {}", block(body), brief(until)),
        StmtKind::Jump(name) => format!("jump {};", name.text),
        StmtKind::Label(name) => format!("{}:", name.text),
        StmtKind::Try { body, catch, finally } => {
            let catch = catch
                .as_ref()
                .map_or(String::new(), |(name, body)| format!(" catch {} {}", name.as_ref().map_or("", |name| &name.text), block(body)));
            format!("try {}{catch}{}", block(body), maybe(finally))
        }
        other => format!("{other:?};"),
    }
}

#[track_caller]
fn check_stmts(body: &str, expected: &str) {
    let pou = pou(&format!("PROGRAM p\n{body}\nEND_PROGRAM"));
    assert_eq!(brief_body(&pou.body), expected, "{body}");
}

fn brief_type(ty: &TypeExpr) -> String {
    match &ty.kind {
        TypeExprKind::Named(path) => path.iter().map(|name| name.text.as_str()).collect::<Vec<_>>().join("."),
        TypeExprKind::String(length) => format!("STRING({})", length.as_ref().map_or(String::new(), |e| brief(e))),
        TypeExprKind::WString(length) => format!("WSTRING({})", length.as_ref().map_or(String::new(), |e| brief(e))),
        TypeExprKind::Array { dims, elem } => {
            let dim =
                |dim: &Option<(Expr, Expr)>| dim.as_ref().map_or("*".to_owned(), |(low, high)| format!("{}..{}", brief(low), brief(high)));
            format!("[{}]{}", dims.iter().map(dim).collect::<Vec<_>>().join(","), brief_type(elem))
        }
        TypeExprKind::Pointer(to) => format!("ptr {}", brief_type(to)),
        TypeExprKind::Reference(to) => format!("ref {}", brief_type(to)),
        TypeExprKind::RefTo(to) => format!("ref_to {}", brief_type(to)),
        TypeExprKind::Subrange { base, low, high } => format!("{}({}..{})", base.text, brief(low), brief(high)),
        TypeExprKind::Enum(body) => brief_enum(body),
        TypeExprKind::Struct(fields) => format!("struct {}", fields.len()),
        TypeExprKind::Generic { path, values } => {
            let path: Vec<_> = path.iter().map(|name| name.text.as_str()).collect();
            format!("{}<{}>", path.join("."), values.iter().map(brief).collect::<Vec<_>>().join(","))
        }
        TypeExprKind::Error => "?".to_owned(),
    }
}

fn brief_enum(body: &tree::EnumBody) -> String {
    let member = |(name, value): &(Name, Option<Expr>)| match value {
        Some(value) => format!("{}={}", name.text, brief(value)),
        None => name.text.clone(),
    };
    let base = body.base.as_ref().map_or("", |base| &base.text);
    let init = body.init.as_ref().map_or(String::new(), brief);
    format!("enum({}){base}:{init}", body.members.iter().map(member).collect::<Vec<_>>().join(","))
}

fn brief_init(init: &Init) -> String {
    match init {
        Init::Expr(expr) => brief(expr),
        Init::Array(items, _) => {
            let item = |item: &InitItem| match item {
                InitItem::One(init) => brief_init(init),
                InitItem::Repeat(count, inits) => {
                    format!("{}x({})", brief(count), inits.iter().map(brief_init).collect::<Vec<_>>().join(","))
                }
            };
            format!("[{}]", items.iter().map(item).collect::<Vec<_>>().join(","))
        }
        Init::Struct(fields, _) => {
            format!("({})", fields.iter().map(|(name, init)| format!("{}={}", name.text, brief_init(init))).collect::<Vec<_>>().join(","))
        }
    }
}

#[track_caller]
fn check_var(text: &str, expected: &str) {
    let pou = pou(&format!("PROGRAM p\nVAR\n{text}\nEND_VAR\nEND_PROGRAM"));
    let var = |var: &tree::VarDecl| {
        let at = var.at.as_ref().map_or(String::new(), |at| format!(" at {}", at.text));
        let init = var.init.as_ref().map_or(String::new(), |init| format!(" := {}", brief_init(init)));
        let args = if var.fb_init.is_empty() {
            String::new()
        } else {
            format!("({})", var.fb_init.iter().map(brief_arg).collect::<Vec<_>>().join(", "))
        };
        format!("{}{at}: {}{args}{init}", var.name.text, brief_type(&var.ty))
    };
    assert_eq!(pou.vars[0].vars.iter().map(var).collect::<Vec<_>>().join("; "), expected, "{text}");
}

#[test]
fn operators_bind_as_the_standard_says() {
    check_expr("a + b * c", "(a Add (b Mul c))");
    check_expr("a - b - c", "((a Sub b) Sub c)");
    check_expr("-a ** 2", "((Neg a) Power 2)");
    check_expr("2 ** -a", "(2 Power (Neg a))");
    check_expr("a ** b ** c", "((a Power b) Power c)");
    check_expr("NOT a = b", "((Not a) Eq b)");
    check_expr("a = b < c", "(a Eq (b Lt c))");
    check_expr("a OR b XOR c AND d & e", "(a Or (b Xor ((c And d) And e)))");
    check_expr("a OR_ELSE b AND_THEN c", "(a OrElse (b AndThen c))");
    check_expr("a MOD b / c", "((a Mod b) Div c)");
    check_expr("a <> b >= c", "(a Ne (b Ge c))");
    check_expr("- - NOT a", "(Neg (Neg (Not a)))");
    check_expr("(a + b) * c", "((a Add b) Mul c)");
    check_expr("a++b", "(a Add (Plus b))");
}

#[test]
fn places_and_calls() {
    check_expr("a.b^.c[i, j].3", "a.b^.c[i, j].Bit(3)");
    check_expr("w.%X3", "w.Bit(3)");
    check_expr("w.%B1", "w.Byte(1)");
    check_expr("%ix0.0", "%IX0.0");
    check_expr("%QB4 + %MW10", "(%QB4 Add %MW10)");
    check_expr("ADR(x)^", "ADR(x)^");
    check_expr("THIS^.a", "THIS^.a");
    check_expr("SUPER^.run(1)", "SUPER^.run(1)");
    check_expr("f()", "f()");
    check_expr("f(a, b + 1).c", "f(a, (b Add 1)).c");
    check_expr("t(IN := a, PT := , Q => , NOT ET => b, r REF= c)", "t(IN := a, Q => , NOT ET => b, r REF= c)");
    check_expr(".g + E#red", "(.g Add E#red)");
    check_expr("颜色#红", "颜色#红");
    check_expr("AND(a, b)", "AND(a, b)");
    check_expr("(a := f()) > 0", "((a := f()) Gt 0)");
    check_expr("fb.Type", "fb.Type");
    check_expr("a[b[1]][2]", "a[b[1]][2]");
    check_expr("S=1", "(S Eq 1)");
    check_expr("f(R = 1)", "f((R Eq 1))");
}

#[test]
fn edition_three_words_are_names_elsewhere() {
    check_expr("get + set * on / final - method.action", "((get Add ((set Mul on) Div final)) Sub method.action)");
    check_stmts(
        "method := 1; action(set := 2); class.x := 3; task := with;",
        "method Assign 1; action(set := 2); class.x Assign 3; task Assign with;",
    );
    check_var("retain, Constant : INT; get : BOOL; method : INT;", "retain: INT; Constant: INT; get: BOOL; method: INT");
    assert_eq!(pou("FUNCTION_BLOCK Final EXTENDS Base END_FUNCTION_BLOCK").name.text, "Final");
}

#[test]
fn statements_of_every_kind() {
    check_stmts("a := b := c; x S= y; x R= y; r REF= v; p ?= q;", "a Assign b Assign c; x Set y; x Reset y; r Ref v; p Try q;");
    check_stmts("IF a THEN b := 1; ELSIF c THEN ; ELSE d(); END_IF e := 2;", "if a {b Assign 1;} if c {Empty;} else{d();} e Assign 2;");
    check_stmts("IF a THEN END_IF; IF b THEN END_IF", "if a {} if b {}");
    check_stmts(
        "CASE x OF 1, 3..5: a := 1; E.red: b := 2; c: ; E#x, -1: d(); ELSE e := 1; END_CASE;",
        "case x 1,3..5{a Assign 1;} E.red{b Assign 2;} c{Empty;} E#x,(Neg 1){d();} else{e Assign 1;}",
    );
    check_stmts("CASE x OF 1: CASE y OF 2: a(); END_CASE 3: b[1].c := 2; END_CASE", "case x 1{case y 2{a();}} 3{b[1].c Assign 2;}");
    check_stmts("FOR i := 0 TO 10 BY 2 DO a[i] := 0; CONTINUE; END_FOR", "for i 0 10 by 2 {a[i] Assign 0; Continue;}");
    check_stmts("FOR s.i := n DO_ TO 1 DO EXIT; END_FOR;".replace(" DO_", "").as_str(), "for s.i n 1 {Exit;}");
    check_stmts("WHILE a < 1 DO a := 2; END_WHILE; REPEAT b(); UNTIL c END_REPEAT", "while (a Lt 1) {a Assign 2;} repeat {b();} until c");
    check_stmts("REPEAT b(); UNTIL c; END_REPEAT; RETURN; JMP l; l: a := 1;", "repeat {b();} until c Return; jump l; l: a Assign 1;");
    check_stmts("__TRY a(); __CATCH(e) b(); __FINALLY c(); __ENDTRY;", "try {a();} catch e {b();} else{c();}");
    check_stmts(
        "SUPER^(); THIS^.x := 1; .g := 2; %QX0.0 := TRUE; ADR(x)^ := 1;",
        "SUPER^(); THIS^.x Assign 1; .g Assign 2; %QX0.0 Assign true; ADR(x)^ Assign 1;",
    );
    check_stmts("a:=b+\n  c(\n  d := 1,\n  e := 2\n);", "a Assign (b Add c(d := 1, e := 2));");
}

#[test]
fn declarations_of_every_kind() {
    check_var("a, b : INT := 5;", "a: INT := 5; b: INT := 5");
    check_var("x AT %I* : BOOL; y AT %qx1.2 : BOOL;", "x at %I*: BOOL; y at %QX1.2: BOOL");
    check_var("s : STRING; t : STRING(20) := 'x'; u : WSTRING[8];", "s: STRING(); t: STRING(20) := String([120]); u: WSTRING(8)");
    check_var("m : ARRAY [0..2, a..b+1] OF ARRAY[*] OF LREAL;", "m: [0..2,a..(b Add 1)][*]LREAL");
    check_var("p : POINTER TO POINTER TO INT; r : REFERENCE TO S; q : REF_TO T;", "p: ptr ptr INT; r: ref S; q: ref_to T");
    check_var("n : INT(0..100) := 3; k : MyInt(-1..1);", "n: INT(0..100) := 3; k: MyInt((Neg 1)..1)");
    check_var("f : FB(x := 1, y := 2); g : Lib.FB(1, 2); h : FB := (x := 1);", "f: FB(x := 1, y := 2); g: Lib.FB(1, 2); h: FB := (x=1)");
    check_var("e : (red, green := 5); i : INT(a := 1, b);", "e: enum(red,green=5):; i: enum(a=1,b)INT:");
    check_var("a : ARRAY [0..4] OF INT := [1, 2, 3(0)];", "a: [0..4]INT := [1,2,3x(0)]");
    check_var("a : T := [2([1, 2]), 3((x := 1, y := [4])), N([0]), 2()];", "a: T := [2x([1,2]),3x((x=1,y=[4])),Nx([0]),2x()]");
    check_var("s : S := (a := 1, b := (c := 2), d := [1]); z : S := STRUCT(a := 1);", "s: S := (a=1,b=(c=2),d=[1]); z: S := (a=1)");
    check_var("t : STRUCT a, b : INT; END_STRUCT;", "t: struct 2");
    check_var("r : REFERENCE TO INT REF= x;", "r: ref INT := x");
    check_var("温度 : LREAL := (1.0 + 2);", "温度: LREAL := (Real(1.0) Add 2)");
}

#[test]
fn sections_keep_their_qualifiers() {
    let pou = pou(
        "FUNCTION_BLOCK f\nVAR_INPUT CONSTANT a : INT; END_VAR VAR RETAIN PERSISTENT b : INT; END_VAR VAR_OUTPUT END_VAR VAR_IN_OUT END_VAR \
         VAR_TEMP END_VAR VAR_STAT END_VAR VAR_EXTERNAL END_VAR VAR_INST END_VAR END_FUNCTION_BLOCK",
    );
    let kinds: Vec<_> = pou.vars.iter().map(|block| block.kind).collect();
    use VarKind::*;
    assert_eq!(kinds, [Input, Var, Output, InOut, Temp, Stat, External, Inst]);
    assert!(pou.vars[0].constant && !pou.vars[0].retain && pou.vars[1].retain && pou.vars[1].persistent);
}

#[test]
fn types_of_every_kind() {
    let file = clean(
        "TYPE Color : (red, green := 3) BYTE := green; Base : STRUCT a : INT; b : REAL := 1.0; END_STRUCT;\n\
         Derived EXTENDS Base : STRUCT c : BOOL; END_STRUCT\nU : UNION i : INT; w : WORD; END_UNION; A : ARRAY [0..1] OF INT := [1, 2]; N : INT(0..5);\nEND_TYPE",
    );
    let found: Vec<_> = file
        .units
        .iter()
        .map(|unit| match unit {
            Unit::Type(decl) => match &decl.kind {
                TypeKind::Struct { extends, fields } => {
                    format!("{} {:?} {}", decl.name.text, extends.as_ref().map(|n| n.text.as_str()), fields.len())
                }
                TypeKind::Union { fields } => format!("{} union {}", decl.name.text, fields.len()),
                TypeKind::Enum(body) => format!("{} {}", decl.name.text, brief_enum(body)),
                TypeKind::Alias { ty, init } => format!("{} {} {:?}", decl.name.text, brief_type(ty), init.as_ref().map(brief_init)),
            },
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(
        found,
        [
            "Color enum(red,green=3)BYTE:green",
            "Base None 2",
            "Derived Some(\"Base\") 1",
            "U union 2",
            "A [0..1]INT Some(\"[1,2]\")",
            "N INT(0..5) None"
        ]
    );
}

#[test]
fn members_stand_inside_and_behind_their_block() {
    let text = "FUNCTION_BLOCK PUBLIC ABSTRACT Motor EXTENDS Lib.Base IMPLEMENTS IRun, IStop\nVAR speed : REAL; END_VAR\n\
        METHOD PRIVATE FINAL start : BOOL VAR_INPUT v : REAL; END_VAR speed := v; start := TRUE; END_METHOD\n\
        PROPERTY Speed : REAL GET Speed := speed; END_GET SET VAR x : INT; END_VAR speed := Speed; END_SET END_PROPERTY\n\
        ACTION stop: speed := 0; END_ACTION\nspeed := speed + 1;\nEND_FUNCTION_BLOCK\nACTION more speed := 2; END_ACTION\nMETHOD last END_METHOD";
    let pou = pou(text);
    assert!(pou.modifiers.is_abstract);
    assert_eq!(pou.extends.map(|name| name.text), Some("Lib.Base".to_owned()));
    assert_eq!(pou.implements.iter().map(|name| name.text.as_str()).collect::<Vec<_>>(), ["IRun", "IStop"]);
    assert_eq!(pou.methods.iter().map(|m| m.name.text.as_str()).collect::<Vec<_>>(), ["start", "last"]);
    assert_eq!(pou.methods[0].modifiers.access, tree::Access::Private);
    assert_eq!(pou.actions.iter().map(|a| a.name.text.as_str()).collect::<Vec<_>>(), ["stop", "more"]);
    assert!(pou.properties[0].get.as_ref().is_some_and(|get| get.1.len() == 1));
    assert!(pou.properties[0].set.as_ref().is_some_and(|set| set.0.len() == 2 && set.1.len() == 1));
    assert_eq!(brief_body(&pou.body), "speed Assign (speed Add 1);");
    assert_eq!(&text[pou.end.start as usize..pou.end.end as usize], "END_FUNCTION_BLOCK");
    assert_eq!(pou.span.end, pou.end.end);
}

#[test]
fn interfaces_and_functions() {
    let file = clean(
        "INTERFACE IRun EXTENDS IBase, IMore METHOD run : BOOL VAR_INPUT a : INT; END_VAR END_METHOD PROPERTY p : INT GET END_GET SET END_SET END_PROPERTY \
         PROPERTY q : INT GET END_PROPERTY END_INTERFACE\nFUNCTION f : ARRAY [0..1] OF INT\nVAR_INPUT a : INT; END_VAR\nf[0] := a;\nEND_FUNCTION\nFUNCTION g END_FUNCTION\nCLASS c END_CLASS",
    );
    let Unit::Interface(interface) = &file.units[0] else { panic!() };
    assert_eq!((interface.extends.len(), interface.methods.len(), interface.properties.len()), (2, 1, 2));
    assert!(interface.properties[0].set.is_some() && interface.properties[1].set.is_none());
    let Unit::Pou(function) = &file.units[1] else { panic!() };
    assert_eq!(function.result.as_ref().map(brief_type).as_deref(), Some("[0..1]INT"));
    assert_eq!(file.units.len(), 4);
}

#[test]
fn configurations() {
    let file = clean(
        "CONFIGURATION plant\nVAR_GLOBAL a : INT; END_VAR\nRESOURCE cpu ON PLC.Linux\nVAR_GLOBAL b : INT; END_VAR\n{attribute 'isolated'}\n\
         TASK fast(INTERVAL := T#1ms, PRIORITY := 0);\nTASK slow(INTERVAL := T#10ms, PRIORITY := 5);\nPROGRAM p1 WITH fast : Main;\nPROGRAM p2 : Lib.Other;\n\
         END_RESOURCE\nVAR_CONFIG cpu.p1.x AT %IX0.0 : BOOL; END_VAR\nEND_CONFIGURATION",
    );
    let Unit::Configuration(configuration) = &file.units[0] else { panic!() };
    assert_eq!(configuration.globals.len(), 3);
    assert_eq!(configuration.globals[2].vars[0].name.text, "cpu.p1.x");
    assert_eq!(
        configuration.tasks.iter().map(|t| (t.name.text.as_str(), t.args.len(), t.pragmas.len())).collect::<Vec<_>>(),
        [("fast", 2, 1), ("slow", 2, 0)]
    );
    assert_eq!(configuration.programs[0].task.as_ref().map(|name| name.text.as_str()), Some("fast"));
    assert_eq!(configuration.programs[1].ty.text, "Lib.Other");
    assert_eq!(configuration.resources.len(), 1);
}

#[test]
fn comments_and_pragmas_describe_what_they_stand_by() {
    let text = "// A file.\n\n// Drives the\n// motor.\n{attribute 'no_assign'}\nPROGRAM p // not of a\nVAR\n    a : INT; // of a\n    (* of b\n     * and more *)\n    {attribute 'x' := 'y'}\n    b, c : INT;\n\n    // lost\n\n    d : INT;\n    /* of e */ e : INT; f : INT; // of f\nEND_VAR\nEND_PROGRAM";
    let pou = pou(text);
    assert_eq!(pou.doc.as_deref(), Some("Drives the\nmotor."));
    assert_eq!(pou.pragmas.len(), 1);
    let docs: Vec<_> = pou.vars[0].vars.iter().map(|var| (var.name.text.as_str(), var.doc.as_deref(), var.pragmas.len())).collect();
    let both = Some("of b\nand more");
    assert_eq!(
        docs,
        [("a", Some("of a"), 0), ("b", both, 1), ("c", both, 1), ("d", None, 0), ("e", Some("of e"), 0), ("f", Some("of f"), 0)]
    );
    let file =
        clean("(** Colors *)\n{attribute 'qualified_only'}\nTYPE C : (a); END_TYPE\n{attribute 'gvl_name' := 'G'}\nVAR_GLOBAL END_VAR");
    let Unit::Type(decl) = &file.units[0] else { panic!() };
    assert_eq!((decl.doc.as_deref(), decl.pragmas[0].name.as_str()), (Some("Colors"), "qualified_only"));
    let Unit::Globals(globals) = &file.units[1] else { panic!() };
    assert_eq!(globals.pragmas[0].value.as_deref(), Some("G"));
}

#[test]
fn a_missing_semicolon_is_said_once_behind_the_last_word() {
    check_body("a := 1\nb := 2;\nc := 3", &["1:7 E0105 expected `;`, found `b`", "3:7 E0105 expected `;`, found `END_PROGRAM`"]);
    check_body("a := 1 b := 2;", &["1:7 E0105 expected `;`, found `b`"]);
    check_body("f(a)\nIF x THEN y() END_IF", &["1:5 E0105 expected `;`, found `IF`", "2:14 E0105 expected `;`, found `END_IF`"]);
    check_body("a := b c;\nd := 1;", &["1:8 E0105 expected an operator or `;`, found `c`"]);
    check_body("RETURN\na := 1;", &["1:7 E0105 expected `;`, found `a`"]);
    check(
        "PROGRAM p\nVAR\n  a : INT\n  b : INT;\n  c : INT := 5\nEND_VAR\nEND_PROGRAM",
        &["3:10 E0105 expected `;`, found `b`", "5:15 E0105 expected `;`, found `END_VAR`"],
    );
}

#[test]
fn as_many_messages_as_mistakes() {
    check_body(
        "a := ;\nb := 2 +;\nc := (1;\nd := f(1, ;\ne 5;\nf := 1;\ng[1 := 2;\nh. := 1;",
        &[
            "1:5 E0105 expected an expression, found `;`",
            "2:9 E0105 expected an expression, found `;`",
            "3:8 E0105 expected `)`, found `;`",
            "4:10 E0105 expected an expression, found `;`",
            "5:3 E0105 expected `;`, found `5`",
            "7:4 E0105 expected `]`, found `:=`",
            "8:4 E0105 expected the name of a member behind `.`, found `:=`",
        ],
    );
    check_body(
        "a := b +\nc := 1;\nd := f(1,\n  2\ne := 3;\ng := ;",
        &[
            "1:9 E0105 expected an operand behind `+`, found `c`",
            "4:4 E0105 expected `)`, found `e`",
            "6:5 E0105 expected an expression, found `;`",
        ],
    );
    check_body(
        "a :=\nb := 1;\nc := x.\nd := 2;",
        &["1:5 E0105 expected a value behind `:=`, found `b`", "3:8 E0105 expected the name of a member behind `.`, found `d`"],
    );
    check_body("a := 1);\nb := 2;", &["1:7 E0105 expected `;`, found `)`"]);
    check_body(
        "a := 16#FG + 5ms;",
        &["1:6 E0104 `16#FG` has a digit that its base does not have", "1:14 E0104 `5ms` is neither a number nor a name"],
    );
}

#[test]
fn slips_of_other_languages_are_understood() {
    check_body("a = 5;\nb := 1;", &["1:3 E0105 expected `:=`, found `=`"]);
    check_body("a == 5;", &["1:3 E0105 `==` is not an ST operator"]);
    check_body(
        "IF a == 5 && b != 3 || !c THEN END_IF",
        &[
            "1:6 E0105 `==` is not an ST operator",
            "1:11 E0105 `&&` is not an ST operator",
            "1:16 E0105 `!=` is not an ST operator",
            "1:21 E0105 `||` is not an ST operator",
            "1:24 E0105 `!` is not an ST operator",
        ],
    );
    check_body("IF a := 5 THEN b := 1; END_IF", &["1:6 E0105 expected a comparison, found `:=`"]);
    check_body(
        "a += 1; b++; c := d % 2;",
        &["1:3 E0105 `+=` is not an ST operator", "1:10 E0105 `++` is not an ST operator", "1:21 E0105 `%` is not an ST operator"],
    );
    check_body("IF a THEN {\nb := 1;\n}\nEND_IF", &["1:11 E0105 braces do not make a block in ST"]);
    check_body(
        "a : = 5;\nb : INT;\nc : INT := 5;",
        &[
            "1:3 E0105 expected `:=`, found `: =`",
            "2:3 E0105 a declaration stands among the statements: found `:` behind `b`",
            "3:3 E0105 a declaration stands among the statements: found `:` behind `c`",
        ],
    );
    check_body(
        "IF a THEN b(); ELSEIF (c) THEN d(); ENDIF;",
        &["1:16 E0105 `ELSEIF` is written `ELSIF` in ST", "1:37 E0105 `ENDIF` is written `END_IF` in ST"],
    );
    check_body("RETURN a;\nb := 1;", &["1:8 E0105 expected `;` behind `RETURN`, found `a`"]);
    check_body("a := 5；\nb ：= 6;", &["1:7 E0101 `；` is a full-width sign", "2:3 E0101 `：=` is a full-width sign"]);
    check_body("a := “text”;", &["1:6 E0101 `“` is a typographic quote"]);
    check_body("s := 'abc\";\nb := 1;", &["1:6 E0103 this string is not closed on its line"]);
    check_body("p->x := 1;", &["1:2 E0105 `->` is not an ST operator"]);
    check(
        "PROGRAM p\nVAR\nINT a;\nb : INT = 5;\nc := 5;\nd;\ne : ;\nf INT;\nEND_VAR\nEND_PROGRAM",
        &[
            "3:5 E0105 expected `:` and a type, found `a`",
            "4:9 E0105 expected `:=`, found `=`",
            "5:3 E0105 expected `:` and a type, found `:=`",
            "6:2 E0105 expected `:` and a type, found `;`",
            "7:4 E0105 expected a type, found `;`",
            "8:3 E0105 expected `:` and a type, found `INT`",
        ],
    );
    check(
        "PROGRAM p VAR a : ARRAY [10] OF INT; b : ARRAY (0..1) OF INT; c : ARRAY [0..1] INT; END_VAR END_PROGRAM",
        &[
            "1:28 E0105 expected `..` and the upper bound, found `]`",
            "1:48 E0105 expected `[`, found `(`",
            "1:79 E0105 expected `OF`, found `INT`",
        ],
    );
}

#[test]
fn missing_words_of_heads_are_taken_as_read() {
    check_body("IF a > 5\n  b := 1;\nEND_IF", &["1:9 E0105 expected `THEN`, found `b`"]);
    check_body("IF a > 5 b := 1; END_IF", &["1:9 E0105 expected `THEN`, found `b`"]);
    check_body(
        "WHILE a\n  b();\nEND_WHILE\nFOR i := 1 TO 5\n  c();\nEND_FOR",
        &["1:8 E0105 expected `DO`, found `b`", "4:16 E0105 expected `DO`, found `c`"],
    );
    check_body("CASE a\n 1: b();\nEND_CASE", &["1:7 E0105 expected `OF`, found `1`"]);
    check_body("IF a DO b(); END_IF", &["1:6 E0105 expected `THEN`, found `DO`"]);
    check_body("IF (a THEN b(); END_IF", &["1:6 E0105 expected `)`, found `THEN`"]);
    check_body("IF a) THEN b(); END_IF", &["1:5 E0105 expected an operator or `THEN`, found `)`"]);
    check_body("IF a THEN;\nIF THEN c := 1; END_IF\nEND_IF", &["2:4 E0105 expected an expression, found `THEN`"]);
    check_body("FOR i = 1 TO 5 DO a(); END_FOR", &["1:7 E0105 expected `:=`, found `=`"]);
    check_body(
        "FOR i := 1 5 DO a(); END_FOR\nb := ;",
        &["1:12 E0105 expected `TO`, found `5`", "2:5 E0105 expected an expression, found `;`"],
    );
    check_body(
        "IF a +* b AND\n c\nTHEN d := ; END_IF",
        &["1:7 E0105 expected an expression, found `*`", "3:10 E0105 expected an expression, found `;`"],
    );
    check_body("CASE a OF 1 b(); 2: c(); END_CASE", &["1:12 E0105 expected `:`, found `b`"]);
    check_body("CASE a OF b := 1; 2: c(); END_CASE", &["1:11 E0105 expected a label such as `1:` or `END_CASE`, found `b`"]);
    check_body("REPEAT a(); END_REPEAT", &["1:12 E0105 expected `UNTIL`, found `END_REPEAT`"]);
}

#[test]
fn a_missing_end_names_its_beginning() {
    let text = "PROGRAM p\nIF a THEN\n  b();\nEND_PROGRAM\nPROGRAM q\nc := ;\nEND_PROGRAM";
    let (_, diagnostics) = parse(FILE, text);
    assert_eq!(
        shown(text, &diagnostics),
        ["4:1 E0107 expected `END_IF`, found `END_PROGRAM`", "6:5 E0105 expected an expression, found `;`"]
    );
    assert_eq!(diagnostics[0].notes[0].message, "this `IF` in line 2 is not closed");
    assert_eq!(diagnostics[0].notes[0].span.start, 10);
    let (_, diagnostics) = parse(FILE, "PROGRAM p IF a THEN ELSE IF b THEN END_IF END_PROGRAM");
    assert_eq!(diagnostics.len(), 1);
    check_body(
        "FOR i := 1 TO 2 DO IF a THEN b(); END_FOR c := ;",
        &["1:35 E0107 expected `END_IF`, found `END_FOR`", "1:47 E0105 expected an expression, found `;`"],
    );
    check_body("IF a THEN b(); END_FOR; c := 1;", &["1:16 E0107 expected `END_IF`, found `END_FOR`"]);
    check_body("IF a THEN FOR i := 1 TO 2 DO b(); ELSE c(); END_IF", &["1:35 E0107 expected `END_FOR`, found `ELSE`"]);
    check_body(
        "a(); END_IF; b(); ELSE c();",
        &["1:6 E0105 `END_IF` belongs to no open block", "1:19 E0105 `ELSE` belongs to no open block"],
    );
    check("PROGRAM p\nVAR\n a : INT;\na := 5;\nEND_PROGRAM", &["4:1 E0107 expected `END_VAR`, found `a`"]);
    check("PROGRAM p\nVAR\n a : INT;\nVAR_INPUT b : INT; END_VAR\nEND_PROGRAM", &["4:1 E0107 expected `END_VAR`, found `VAR_INPUT`"]);
    check("PROGRAM p\na();\nPROGRAM q END_PROGRAM", &["3:1 E0107 expected `END_PROGRAM`, found `PROGRAM`"]);
    check("PROGRAM p\na();\n", &["2:5 E0107 expected `END_PROGRAM`, found the end of the file"]);
    check("PROGRAM p\na();\nEND_FUNCTION\nPROGRAM q END_PROGRAM", &["3:1 E0107 expected `END_PROGRAM`, found `END_FUNCTION`"]);
    check("TYPE S : STRUCT a : INT;\nEND_TYPE PROGRAM q END_PROGRAM", &["2:1 E0107 expected `END_STRUCT`, found `END_TYPE`"]);
    check("FUNCTION_BLOCK f METHOD m a(); END_FUNCTION_BLOCK", &["1:32 E0107 expected `END_METHOD`, found `END_FUNCTION_BLOCK`"]);
    check("PROGRAM p a(); (* open\nEND_PROGRAM", &["1:16 E0102 this comment is not closed by `*)`"]);
}

#[test]
fn the_top_of_a_file_holds_units_only() {
    check("a := 1;\nb := 2;\nPROGRAM p END_PROGRAM", &["1:1 E0105 expected a program unit such as PROGRAM or TYPE, found `a`"]);
    check("VAR a : INT; END_VAR\na := 1;", &["1:1 E0105 expected a program unit, found `VAR`"]);
    check("END_PROGRAM\nPROGRAM p END_PROGRAM", &["1:1 E0105 `END_PROGRAM` belongs to no open unit"]);
    check("METHOD m END_METHOD PROGRAM p END_PROGRAM", &["1:1 E0105 `METHOD` belongs to no program unit"]);
    check("PROGRAM\nVAR END_VAR END_PROGRAM", &["2:1 E0105 expected the name of the unit, found `VAR`"]);
    check(
        "CONFIGURATION c\nTASK t(INTERVAL := T#1ms, PRIORITY := );\nPROGRAM p WITH t Main;\nfoo\nEND_CONFIGURATION",
        &[
            "2:39 E0105 expected an expression, found `)`",
            "3:18 E0105 expected `:`, found `Main`",
            "4:1 E0105 expected `RESOURCE`, `TASK`, `PROGRAM` or `VAR_GLOBAL`, found `foo`",
        ],
    );
    check_body("a();\nVAR x : INT; END_VAR\nb();", &["2:1 E0105 `VAR` stands behind statements"]);
    check("", &[]);
    check("\u{feff}PROGRAM p END_PROGRAM", &[]);
}

#[test]
fn one_expression_is_the_whole_text() {
    let found = |text: &str| shown(text, &parse_expression(FILE, text).1);
    assert_eq!(found("a + b c"), ["1:7 E0105 expected the end of the expression, found `c`"]);
    assert_eq!(found(""), ["1:1 E0105 expected an expression, found the end of the file"]);
    assert_eq!(found("a;"), ["1:2 E0105 expected the end of the expression, found `;`"]);
}

#[test]
fn pages_and_codes_agree() {
    for code in crate::codes() {
        let page = code.page();
        let head = format!("# {}: {}\n", code.text(), code.meaning());
        assert!(page.starts_with(&head), "{head}");
        let example = |mark: &str| {
            page.split_once(&format!("{mark}\n\n```st\n")).and_then(|(_, rest)| rest.split_once("\n```")).map(|(example, _)| example)
        };
        let (wrong, right) = (example("Wrong:").expect(&head), example("Right:").expect(&head));
        clean(right);
        let found: Vec<_> = parse(FILE, wrong).1.iter().map(|d| d.code).collect();
        let is_syntax = code.text()[1..].starts_with("01");
        assert_eq!(found, if is_syntax { vec![*code] } else { Vec::new() }, "{head}");
    }
    let folder = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/codes")).expect("the folder of pages");
    assert_eq!(folder.count(), crate::codes().len());
    assert!(crate::explain("e0301").is_some_and(|page| page.starts_with("# E0301")));
    assert!(crate::explain("E9999").is_none());
}
