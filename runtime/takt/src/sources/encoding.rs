//! Bytes to text: a byte order mark, what XML says of itself, UTF-8, GBK, Latin-1, in this order.
//!
//! Line ends stay as they are. What was not UTF-8 is told, because the guess may be wrong; what is no text in any of these is refused with the place
//! of the first wrong byte.

use encoding_rs::{GBK, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// How a file was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8.
    Utf8,
    /// GBK, as CODESYS writes on a Chinese Windows.
    Gbk,
    /// Latin-1 (Windows-1252).
    Latin1,
    /// UTF-16, the low byte first.
    Utf16Le,
    /// UTF-16, the high byte first.
    Utf16Be,
    /// What an XML file names in its first line.
    Declared(&'static encoding_rs::Encoding),
}

impl Encoding {
    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Utf8 => "UTF-8",
            Self::Gbk => "GBK",
            Self::Latin1 => "Latin-1",
            Self::Utf16Le => "UTF-16 LE",
            Self::Utf16Be => "UTF-16 BE",
            Self::Declared(encoding) => encoding.name(),
        }
    }
}

/// Why bytes are no text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NotText {
    /// The text up to the wrong byte.
    pub before: String,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: &'static str,
}

/// Text of a source file and how it was read.
pub fn decode(bytes: Vec<u8>) -> Result<(String, Encoding), NotText> {
    let (text, encoding) = match marked(&bytes) {
        Some((Encoding::Utf8, mark)) => (utf8(&bytes[mark..])?, Encoding::Utf8),
        Some((encoding, mark)) => (utf16(&bytes[mark..], encoding)?, encoding),
        None => unmarked(bytes)?,
    };
    match text.find(|c: char| c < ' ' && !matches!(c, '\t'..='\r' | '\x1A')) {
        Some(at) => Err(NotText {
            message: format!("expected text, found the control character 0x{:02X}", text.as_bytes()[at]),
            before: text[..at].into(),
            help: "this is no source file; if it is an archive, export the project as PLCopen XML",
        }),
        None => Ok((text, encoding)),
    }
}

/// The encoding by a byte order mark, or by the zero bytes of UTF-16 without one, and the length of the mark.
fn marked(bytes: &[u8]) -> Option<(Encoding, usize)> {
    match bytes {
        [0xEF, 0xBB, 0xBF, ..] => Some((Encoding::Utf8, 3)),
        [0xFF, 0xFE, ..] => Some((Encoding::Utf16Le, 2)),
        [0xFE, 0xFF, ..] => Some((Encoding::Utf16Be, 2)),
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => Some((Encoding::Utf16Le, 0)),
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => Some((Encoding::Utf16Be, 0)),
        _ => None,
    }
}

fn utf8(bytes: &[u8]) -> Result<String, NotText> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.into()),
        Err(error) => Err(bad_byte(bytes, error.valid_up_to())),
    }
}

fn bad_byte(bytes: &[u8], at: usize) -> NotText {
    NotText {
        before: String::from_utf8_lossy(&bytes[..at]).into_owned(),
        message: format!("expected UTF-8, found the byte 0x{:02X}, which does not belong here", bytes.get(at).copied().unwrap_or(0)),
        help: "the file is damaged, or parts of it were saved in another encoding; save it as UTF-8",
    }
}

fn utf16(bytes: &[u8], encoding: Encoding) -> Result<String, NotText> {
    let decoder = if encoding == Encoding::Utf16Be { UTF_16BE } else { UTF_16LE };
    let (text, is_damaged) = decoder.decode_without_bom_handling(bytes);
    if !is_damaged {
        return Ok(text.into_owned());
    }
    let before = text.split('\u{FFFD}').next().unwrap_or("").to_string();
    let help = "the file is damaged; save it as UTF-8";
    Err(NotText { before, message: format!("this is not {}: half of a character stands here", encoding.name()), help })
}

fn unmarked(bytes: Vec<u8>) -> Result<(String, Encoding), NotText> {
    let declared = declared(&bytes);
    let bytes = match String::from_utf8(bytes) {
        // A file that says it is something else is UTF-8 all the same if it holds nothing but ASCII.
        Ok(text) if declared.is_none_or(|encoding| encoding == UTF_8) || text.is_ascii() => return Ok((text, Encoding::Utf8)),
        Ok(text) => text.into_bytes(),
        Err(error) => error.into_bytes(),
    };
    if let Some(encoding) = declared {
        if encoding == UTF_8 {
            return utf8(&bytes).map(|text| (text, Encoding::Utf8));
        }
        let text = encoding.decode_without_bom_handling_and_without_replacement(&bytes);
        return match text {
            Some(text) => Ok((text.into_owned(), Encoding::Declared(encoding))),
            None => Err(not_as_declared(&bytes, encoding)),
        };
    }
    if let Some(at) = damage(&bytes) {
        return Err(bad_byte(&bytes, at));
    }
    if is_gbk(&bytes) {
        return Ok((GBK.decode_without_bom_handling(&bytes).0.into_owned(), Encoding::Gbk));
    }
    Ok((WINDOWS_1252.decode_without_bom_handling(&bytes).0.into_owned(), Encoding::Latin1))
}

fn not_as_declared(bytes: &[u8], encoding: &'static encoding_rs::Encoding) -> NotText {
    let text = encoding.decode_without_bom_handling(bytes).0;
    NotText {
        before: text.split('\u{FFFD}').next().unwrap_or("").to_string(),
        message: format!("the file says that it is {}, but a byte here is not", encoding.name()),
        help: "export the file again, or save it as UTF-8 with encoding=\"utf-8\" in its first line",
    }
}

/// The encoding that an XML file names in its first line.
fn declared(bytes: &[u8]) -> Option<&'static encoding_rs::Encoding> {
    let head = &bytes[..bytes.len().min(200)];
    let head = head.strip_prefix(b"<?xml")?;
    let head = std::str::from_utf8(&head[..head.windows(2).position(|pair| pair == b"?>")?]).ok()?;
    let (_, value) = head.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next()?;
    // UTF-16 was seen by its zero bytes; a file without them that says so was converted by somebody who left the line as it was.
    let label = value[1..].split(quote).next()?;
    encoding_rs::Encoding::for_label(label.as_bytes()).filter(|encoding| *encoding != UTF_16LE && *encoding != UTF_16BE)
}

/// The first wrong byte of a text that is UTF-8 but for a few.
fn damage(bytes: &[u8]) -> Option<usize> {
    let (mut good, mut wrong, mut first) = (0_usize, 0_usize, None);
    let mut at = 0;
    for chunk in bytes.utf8_chunks() {
        good += chunk.valid().chars().filter(|c| !c.is_ascii()).count();
        if !chunk.invalid().is_empty() {
            first.get_or_insert(at + chunk.valid().len());
            wrong += 1;
        }
        at += chunk.valid().len() + chunk.invalid().len();
    }
    first.filter(|_| good > 3 * wrong)
}

/// Whether bytes are GBK: every lead byte has its trail byte, and most pairs are signs or the 3755 common characters of GB 2312, which two accented
/// letters side by side in a Latin-1 text hardly ever make.
fn is_gbk(bytes: &[u8]) -> bool {
    let (mut pairs, mut common, mut i) = (0u32, 0u32, 0);
    while i < bytes.len() {
        let lead = bytes[i];
        if lead < 0x80 {
            i += 1;
            continue;
        }
        let Some(&trail) = bytes.get(i + 1) else { return false };
        if !(0x81..=0xFE).contains(&lead) || !(0x40..=0xFE).contains(&trail) || trail == 0x7F {
            return false;
        }
        pairs += 1;
        common += u32::from(matches!(lead, 0xA1..=0xA9 | 0xB0..=0xD7) && trail >= 0xA1);
        i += 2;
    }
    common * 2 > pairs && GBK.decode_without_bom_handling_and_without_replacement(bytes).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(bytes: &[u8], text: &str, encoding: Encoding) {
        assert_eq!(decode(bytes.to_vec()), Ok((text.to_string(), encoding)));
    }

    #[track_caller]
    fn refused(bytes: &[u8], before: &str, message: &str) {
        let error = decode(bytes.to_vec()).unwrap_err();
        assert_eq!(error.before, before);
        assert!(error.message.contains(message), "{error:?}");
    }

    #[test]
    fn reads_utf8_gbk_and_latin1() {
        check("(* 点胶 *) a := 1;\r\n".as_bytes(), "(* 点胶 *) a := 1;\r\n", Encoding::Utf8);
        check(b"\xEF\xBB\xBFx := 1;", "x := 1;", Encoding::Utf8);
        check(b"// \xB5\xE3\xBD\xBA\xB7\xA7", "// 点胶阀", Encoding::Gbk);
        check(b"// Gr\xF6\xDFe \xB0C", "// Größe °C", Encoding::Latin1);
        check(b"// K\xFChlung ein", "// Kühlung ein", Encoding::Latin1);
        check(b"// Gr\xF6\xDFe", "// Größe", Encoding::Latin1);
    }

    #[test]
    fn reads_utf16_with_and_without_its_mark() {
        let wide = |text: &str, bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
        let text = "// 点 ä\r\nx := 1;";
        check(&wide(&format!("\u{FEFF}{text}"), u16::to_le_bytes), text, Encoding::Utf16Le);
        check(&wide(&format!("\u{FEFF}{text}"), u16::to_be_bytes), text, Encoding::Utf16Be);
        check(&wide(text, u16::to_le_bytes), text, Encoding::Utf16Le);
        refused(b"\xFF\xFEa\0\n\0b\0\x00\xD8", "a\nb", "not UTF-16 LE");
    }

    #[test]
    fn xml_says_what_it_is() {
        check(b"<?xml version='1.0' encoding='ISO-8859-1'?><a>\xFC</a>", "<?xml version='1.0' encoding='ISO-8859-1'?><a>ü</a>", {
            Encoding::Declared(WINDOWS_1252)
        });
        let gb = b"<?xml version=\"1.0\" encoding=\"gb2312\"?>\xB5\xE3";
        check(gb, "<?xml version=\"1.0\" encoding=\"gb2312\"?>点", Encoding::Declared(GBK));
        refused(b"<?xml version='1.0' encoding='utf-8'?>\n<a>\xFC</a>", "<?xml version='1.0' encoding='utf-8'?>\n<a>", "0xFC");
    }

    #[test]
    fn what_is_no_text_is_refused_at_its_first_wrong_byte() {
        refused(
            "x := 1; // 点胶阀打开\n".as_bytes().iter().chain(b"ab\xFFc").copied().collect::<Vec<_>>().as_slice(),
            "x := 1; // 点胶阀打开\nab",
            "0xFF",
        );
        refused(b"\xEF\xBB\xBFa\n\xE7", "a\n", "0xE7");
        refused(b"abc\0def", "abc", "0x00");
    }
}
