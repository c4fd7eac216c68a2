use super::super::xml;
use super::*;

const FILE: &str = "<a>\n  <d><![CDATA[PROGRAM p\nVAR x : INT; END_VAR]]></d>\n  <b>x := 1 &lt; 2; // last</b>\n</a>";

fn write(text: &str, style: Style) -> Written {
    let mut writer = Writer::new(style, Source { name: "f.xml".into(), text: text.into() });
    let root = xml::parse(text).unwrap();
    writer.unit("p");
    root.children().for_each(|child| writer.copy_lines(&child.pieces()));
    writer.put_line("END_PROGRAM", root.close.clone());
    writer.finish("f")
}

/// What a part of the made text stands for.
#[track_caller]
fn check(written: &Written, part: &str, source: &str) {
    let at = written.units[0].text.find(part).expect(part);
    let (file, range) = written.origin.place(at..at + part.len());
    assert_eq!(&file.text[range], source);
}

#[test]
fn lines_and_columns_are_those_of_the_file() {
    let written = write(FILE, Style::Places);
    let expected = format!("\n{0}PROGRAM p\nVAR x : INT; END_VAR\n{1}x := 1 < 2; // last\nEND_PROGRAM", " ".repeat(14), " ".repeat(5));
    assert_eq!(written.units[0].text, expected);
    check(&written, "PROGRAM p", "PROGRAM p");
    check(&written, "INT", "INT");
    check(&written, "1 < 2", "1 &lt; 2");
    check(&written, "2; //", "2; //");
    check(&written, "END_PROGRAM", "</a>");
}

#[test]
fn a_file_in_one_line_keeps_its_places() {
    let text = FILE.replace('\n', " ");
    let written = write(&text, Style::Places);
    assert!(written.units[0].text.contains("// last\nEND_PROGRAM"), "the comment ends: {:?}", written.units[0].text);
    check(&written, "2; // last", "2; // last");
    check(&written, "END_PROGRAM", "</a>");
    let lines = written.origin.lines(&written.units[0].text);
    let line = written.units[0].text.lines().position(|line| line.contains("2;")).unwrap() as u32 + 1;
    let column = written.units[0].text.lines().nth(line as usize - 1).unwrap().find("2;").unwrap() as u32 + 1;
    assert_eq!(lines.place(line, column), Some(("f.xml", 1, text.find("2;").unwrap() as u32 + 1)));
    assert_eq!(lines.place(99, 1), None);
}

#[test]
fn people_get_text_without_gaps() {
    let written = write(FILE, Style::Clean);
    let expected = "PROGRAM p\nVAR x : INT; END_VAR\nx := 1 < 2; // last\nEND_PROGRAM\n";
    assert_eq!(written.units, [Unit { name: "p".into(), text: expected.into() }]);
}

#[test]
fn findings_have_a_place_and_an_end() {
    let mut writer = Writer::new(Style::Places, Source { name: "f.xml".into(), text: "<a>\n<LD/></a>".into() });
    (0..500).for_each(|_| writer.refuse(Code::OtherLanguage, 4..9, "a *) body".into(), "write it"));
    let written = writer.finish("f");
    assert_eq!((written.findings.len(), written.left.len()), (100, 100));
    assert!(written.findings[99].message.ends_with("not listed"));
    let span = written.findings[0].span;
    assert_eq!(written.origin.place(span.start as usize..span.end as usize).1, 4..9);
    assert_eq!((written.left[0].line, written.left[0].column), (2, 1));
    assert!(takt_syntax::parse(FileId(0), &written.units[0].text).1.is_empty());
}

#[test]
fn one_endless_line_is_written_in_one_pass() {
    let text = format!("<a>{}</a>", "<v>x : INT;</v>".repeat(100_000));
    let written = write(&text, Style::Places);
    assert_eq!(written.units[0].text.matches("INT").count(), 100_000);
}

#[test]
fn one_endless_line_of_declarations_is_written_in_one_pass() {
    let variables = "<variable name=\"x\"><type><INT/></type></variable>".repeat(100_000);
    let text = format!("<project><globalVars name='g'>{variables}</globalVars></project>");
    let mut writer = Writer::new(Style::Places, Source { name: "f.xml".into(), text: text.clone() });
    super::super::plcopen::write(&xml::parse(&text).unwrap(), "f", &mut writer);
    assert_eq!(writer.finish("f").units[0].text.matches("x : INT;").count(), 100_000);
}
