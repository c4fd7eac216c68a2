//! Any text is compiled without a panic.

#![no_main]

use libfuzzer_sys::fuzz_target;
use takt_compile::{Input, Options, compile};
use takt_syntax::Source;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let sources = [Source { name: "fuzz.st".into(), text }];
    compile(Input { sources: &sources, libraries: &[&takt_stdlib_fb::LIBRARY], options: &Options { lint: true, ..Options::default() } });
});
