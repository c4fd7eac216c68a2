use super::super::layout::{Style, Unit, Written};
use super::super::xml;
use super::*;
use takt_syntax::{FileId, Source};

fn written(text: &str, style: Style) -> Written {
    let mut writer = Writer::new(style, Source { name: "p.xml".into(), text: text.into() });
    write(&xml::parse(text).unwrap(), "p", &mut writer);
    writer.finish("p")
}

fn project(inside: &str) -> String {
    format!("<project xmlns=\"http://www.plcopen.org/xml/tc6_0201\">\n{inside}\n</project>")
}

/// The unit that people get of that name.
#[track_caller]
fn check(inside: &str, name: &str, expected: &str) {
    let units = written(&project(inside), Style::Clean).units;
    let unit = units.iter().find(|unit| unit.name == name);
    assert_eq!(unit, Some(&Unit { name: name.into(), text: expected.into() }), "{units:?}");
}

#[test]
fn the_object_orientation_of_a_real_export_parses() {
    for file in ["Drive.xml", "FB_Drive.TcPOU", "I_Drive.TcIO"] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import/oop").join(file);
        let sources = super::super::read(&[path]).unwrap();
        let text = &sources.list[0].text;
        let (tree, found) = takt_syntax::parse(FileId(0), text);
        assert!(found.is_empty() && sources.findings.is_empty(), "{file}: {found:?}\n{text}");
        assert!(!tree.units.is_empty(), "{file}");
    }
}

#[test]
fn members_of_an_export_are_members_of_their_block() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import/oop/Drive.xml");
    let sources = super::super::read(&[path]).unwrap();
    let (tree, _) = takt_syntax::parse(FileId(0), &sources.list[0].text);
    let Some(takt_syntax::tree::Unit::Pou(drive)) = tree.units.first() else { panic!("{:?}", tree.units) };
    let methods: Vec<_> = drive.methods.iter().map(|method| method.name.text.as_str()).collect();
    assert_eq!((methods, drive.properties.len(), drive.implements.len()), (vec!["Start", "Stop"], 1, 2));
    assert!(drive.properties[0].get.is_some() && drive.properties[0].set.is_some());
    let start = drive.methods[0].name.span;
    let (file, range) = sources.origins[&0].place(start.start as usize..start.end as usize);
    let line = file.text[..range.start].matches('\n').count() + 1;
    assert!(file.text.lines().nth(line - 1).unwrap().contains("<Method name=\"Start\""), "line {line}");
}

#[test]
fn what_is_drawn_is_refused_by_name_and_the_rest_comes_through() {
    let unit = |name: &str, body: &str| format!("<pou name=\"{name}\" pouType=\"functionBlock\"><interface/>\n<body>{body}</body></pou>");
    let bodies = [("a", "<LD/>"), ("b", "<ST><p>;</p></ST>"), ("c", "<SFC/>"), ("d", "<IL/>"), ("e", "<FBD/>")];
    let text = project(&bodies.map(|(name, body)| unit(name, body)).join("\n"));
    let written = written(&text, Style::Places);
    let said: Vec<_> = written.findings.iter().map(|finding| finding.message.as_str()).collect();
    let expected = [
        "the body of `a` is written in ladder diagram (LD), not in ST",
        "the body of `c` is written in sequential function chart (SFC), not in ST",
        "the body of `d` is written in instruction list (IL), not in ST",
        "the body of `e` is written in function block diagram (FBD), not in ST",
    ];
    assert_eq!(said, expected);
    let span = written.findings[0].span;
    assert_eq!(&text[written.origin.place(span.start as usize..span.end as usize).1], "<LD/>");
    let (tree, found) = takt_syntax::parse(FileId(0), &written.units[0].text);
    assert_eq!((tree.units.len(), found.len()), (5, 0));
}

#[test]
fn every_type_is_written() {
    let ty = |xml: &str| types::of(&xml::parse(&format!("<type>{xml}</type>")).unwrap()).0;
    assert_eq!(
        ty("<array><dimension lower='1' upper='3'/><dimension lower='0' upper='N'/><baseType><lreal/></baseType></array>"),
        "ARRAY[1..3, 0..N] OF LREAL"
    );
    assert_eq!(
        (ty("<string length='5'/>"), ty("<wstring/>"), ty("<derived name='Lib.T'/>")),
        ("STRING(5)".into(), "WSTRING".into(), "Lib.T".into())
    );
    assert_eq!(ty("<pointer><baseType><BYTE/></baseType></pointer>"), "POINTER TO BYTE");
    assert_eq!(ty("<subrangeSigned><range lower='-5' upper='5'/><baseType><INT/></baseType></subrangeSigned>"), "INT(-5..5)");
    assert_eq!(ty("<enum><values><value name='a'/><value name='b' value='7'/></values></enum>"), "(a, b := 7)");
    assert_eq!((ty(""), ty("<unheard/>")), ("ANY".into(), "UNHEARD".into()));
}

#[test]
fn lists_keep_which_variable_is_constant() {
    let variable = |name: &str| format!("<variable name='{name}'><type><INT/></type></variable>");
    let (a, b) = (variable("a"), variable("b"));
    let mixed = format!(
        "<data name='http://x/mixedattrsvarlist'><MixedAttrsVarList><globalVars name='G'>{a}</globalVars><globalVars name='G' constant='true'>{b}</globalVars></MixedAttrsVarList></data>"
    );
    let list = format!("<globalVars name='G'>{a}{b}<addData>{mixed}</addData></globalVars>");
    check(&list, "G", "VAR_GLOBAL\n    a : INT;\nEND_VAR\nVAR_GLOBAL CONSTANT\n    b : INT;\nEND_VAR\n");
}

#[test]
fn units_without_anything_in_them_are_units() {
    check("<pou name='p' pouType='program'/>", "p", "PROGRAM p\nEND_PROGRAM\n");
    check("<dataType name='t'><baseType><INT/></baseType></dataType>", "t", "TYPE t : INT;\nEND_TYPE\n");
    let odd = written(&project("<pou name='p' pouType='chart'/><pou/><task/><configuration/>"), Style::Places);
    assert_eq!(odd.findings.len(), 1);
}

#[test]
fn tasks_of_events_and_loose_programs_are_understood() {
    let event = "<resource name='r'><task name='t' interval='PT0S' priority='2'><pouInstance name='p' typeName=''/><addData><data name='x/tasksettings'><TaskSettings KindOfTask='Event' Event='GVL.go'/></data></addData></task></resource>";
    let expected = "CONFIGURATION r\n    TASK t(SINGLE := GVL.go, PRIORITY := 2);\n    PROGRAM p WITH t : p;\nEND_CONFIGURATION\n";
    check(event, "r", expected);
    let loose = written(&project("<resource name='r'><pouInstance name='p' typeName='q'/></resource>"), Style::Places);
    assert_eq!(loose.findings[0].message, "the program instance `p` belongs to no task");
    let soon = written(&project("<task name='t' interval='soon' priority='high'/>"), Style::Places);
    assert_eq!(soon.findings.len(), 2);
}
