//! A stream of words of the language is parsed without a panic: each byte chooses one, so that programs come about sooner than from letters. In
//! `words.txt` a `~` is a space.

#![no_main]

use libfuzzer_sys::fuzz_target;

const WORDS: &str = include_str!("../words.txt");

fuzz_target!(|bytes: &[u8]| {
    let words: Vec<&str> = WORDS.split_whitespace().collect();
    let mut text = String::new();
    for &byte in bytes {
        text.push_str(&words[usize::from(byte) % words.len()].replace('~', " "));
        text.push(if byte % 7 == 3 { '\n' } else { ' ' });
    }
    takt_syntax::parse(takt_syntax::FileId(0), &text);
});
