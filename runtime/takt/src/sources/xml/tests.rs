use super::*;

fn place(text: &str, at: usize) -> (usize, usize) {
    let place = crate::manifest::Place::of(text, at);
    (place.line, place.column)
}

/// The text is refused there, and the message says so.
#[track_caller]
fn refused(text: &str, at: (usize, usize), message: &str) {
    let error = parse(text).expect_err("refused");
    assert!(error.message.contains(message), "{error:?}");
    assert_eq!(place(text, error.at.start), at, "{error:?}");
    assert!(error.at.start <= error.at.end && text.get(error.at.clone()).is_some(), "{error:?}");
    assert!(!error.help.is_empty());
}

#[test]
fn texts_and_values_know_their_places() {
    let text = "<?xml version=\"1.0\"?>\n<!-- a --><x:a xmlns:x='u' n = \"1 &lt; 2\">s &lt;= <![CDATA[t < 3]]><b/>&#65;</x:a>\n";
    let root = parse(text).unwrap();
    assert_eq!((root.name, root.value("N"), root.children().count()), ("a", Some("1 < 2"), 1));
    assert_eq!(&text[root.attribute("n").unwrap().at.clone()], "1 &lt; 2");
    let pieces: Vec<_> = root.pieces().into_iter().map(|piece| (piece.text.into_owned(), text[piece.at].to_string())).collect();
    let expected = [("s ", "s "), ("<", "&lt;"), ("= ", "= "), ("t < 3", "t < 3"), ("A", "&#65;")];
    assert_eq!(pieces, expected.map(|(text, source)| (text.to_string(), source.to_string())));
    assert_eq!(
        (root.text().as_str(), &text[root.text_place()], &text[root.close.clone()]),
        ("s <= t < 3A", "s &lt;= <![CDATA[t < 3]]><b/>&#65;", "</x:a>")
    );
}

#[test]
fn paragraphs_begin_lines() {
    let text = "<ST>\n  <p>a;</p>\n  <p>b;</p>\n</ST>";
    let joined: String = parse(text).unwrap().pieces().iter().map(|piece| piece.text.as_ref()).collect();
    assert_eq!(joined, "a;\nb;");
}

#[test]
fn what_is_not_well_formed_is_refused_with_its_place() {
    refused("", (1, 1), "expected an XML element");
    refused("VAR_GLOBAL\nEND_VAR", (1, 1), "text outside of any element");
    refused("<a>\n  <b>\n</a>", (3, 1), "not well-formed");
    refused("<a>\n <b>", (2, 2), "<b> is not closed");
    refused("<a>\n</a></a>", (2, 5), "not well-formed");
    refused("<a/>\n<b/>", (2, 1), "second outermost");
    refused("<a b=1/>", (1, 4), "name=\"value\"");
    refused("<a b='1' b='2'/>", (1, 10), "given twice");
    refused("<a>x & y</a>", (1, 6), "not well-formed");
    refused("<a>x &nbsp; y</a>", (1, 6), "`&nbsp;` is not known");
    refused("<a b='&x;'/>", (1, 7), "an entity that XML does not know");
    refused("<a>\n<![CDATA[ b </a>", (2, 1), "not well-formed");
    refused("<a", (1, 1), "not well-formed");
    refused("点<a/>", (1, 1), "text outside");
}

#[test]
fn a_document_type_is_refused_before_it_can_do_harm() {
    let mut laughs = "<?xml version=\"1.0\"?>\n<!DOCTYPE a [\n<!ENTITY l0 \"ha\">\n".to_string();
    for i in 1..30 {
        laughs += &format!("<!ENTITY l{i} \"&l{};&l{};\">\n", i - 1, i - 1);
    }
    laughs += "]>\n<a>&l29;</a>";
    refused(&laughs, (2, 1), "DTD");
    refused("<!DOCTYPE a SYSTEM \"file:///etc/passwd\"><a/>", (1, 1), "DTD");
    refused("<a>\n&xxe;</a>", (2, 1), "`&xxe;` is not known");
}

#[test]
fn size_is_bounded() {
    refused(&"<a>".repeat(100_000), (1, 601), "nested more than 200 deep");
    refused(&format!("<a>{}</a>", "<b/>".repeat(1_000_001)), (1, 4_000_000), "more than 1000000 elements");
    let attributes: String = (0..65).map(|i| format!(" a{i}=''")).collect();
    refused(&format!("<a{attributes}/>"), (1, 442), "more than 64 attributes");
    assert!(parse(&format!("<a>{}</a>", "x := 1; ".repeat(100_000))).is_ok());
}
