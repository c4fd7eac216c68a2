//! Any bytes are parsed without a panic, and messages point into the text.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let (_, diagnostics) = takt_syntax::parse(takt_syntax::FileId(0), &text);
    for span in diagnostics.iter().flat_map(|d| d.notes.iter().map(|note| note.span).chain([d.span])) {
        assert!(text.get(span.start as usize..span.end as usize).is_some(), "{span:?}");
    }
});
