//! The pages of `takt explain` keep their word: the wrong example has the message, the right one has none.

use takt_compile::Options;
use takt_syntax::{Code, codes};
use takt_tests::bench;

/// Codes of files and programs in other languages, which no text of Structured Text has.
const OF_FILES: [Code; 2] = [Code::BadFile, Code::OtherLanguage];

fn example<'p>(page: &'p str, mark: &str) -> &'p str {
    let (_, rest) = page.split_once(&format!("{mark}\n\n```st\n")).expect("the mark of an example");
    rest.split_once("```").expect("the end of an example").0
}

/// The codes of a compilation; that there is no program to run is only said of whole programs.
fn found(source: &str, code: Code) -> Vec<&'static str> {
    let output = bench::compile_with(source, &Options { lint: true, ..Options::default() });
    let whole = code == Code::NoProgram;
    output.diagnostics.iter().filter(|d| whole || d.code != Code::NoProgram).map(|d| d.code.text()).collect()
}

#[test]
fn the_wrong_example_has_the_message_and_the_right_one_has_none() {
    let mut wrong = Vec::new();
    for code in codes().iter().copied().filter(|code| !OF_FILES.contains(code)) {
        let (bad, good) = (found(example(code.page(), "Wrong:"), code), found(example(code.page(), "Right:"), code));
        if !bad.contains(&code.text()) || !good.is_empty() {
            wrong.push(format!("{}: wrong {bad:?}, right {good:?}", code.text()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
