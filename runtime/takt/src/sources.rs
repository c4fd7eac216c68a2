//! Sources from disk: folders walked in sorted order, any of three encodings made UTF-8.
//!
//! A file is UTF-8 (with or without byte order mark), else GBK, else Latin-1; line ends stay as they are. What was not UTF-8 is told, because the
//! guess may be wrong.

use encoding_rs::{GBK, WINDOWS_1252};
use std::fmt;
use std::path::{Path, PathBuf};
use takt_syntax::Source;

/// A source file larger than this is refused: it is none.
const LARGEST: u64 = 64 << 20;

/// How a file was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8.
    Utf8,
    /// GBK, as CODESYS writes on a Chinese Windows.
    Gbk,
    /// Latin-1 (Windows-1252).
    Latin1,
}

impl Encoding {
    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Utf8 => "UTF-8",
            Self::Gbk => "GBK",
            Self::Latin1 => "Latin-1",
        }
    }
}

/// Sources and how those were read that are not UTF-8.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    /// In the order of the paths, folders sorted.
    pub list: Vec<Source>,
    /// Names of files that were not UTF-8.
    pub converted: Vec<(String, Encoding)>,
}

/// Why sources could not be read.
#[derive(Debug)]
pub enum SourceError {
    /// No such file or folder.
    Missing(PathBuf),
    /// The system refused.
    Unreadable(PathBuf, std::io::Error),
    /// Larger than any source.
    TooLarge(PathBuf),
    /// Neither a folder nor an `.st` file.
    NotSource(PathBuf),
    /// A folder without any `.st` file.
    Empty(PathBuf),
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(path) => write!(f, "{} does not exist", path.display()),
            Self::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            Self::TooLarge(path) => write!(f, "{} is larger than 64 MiB: not a source file", path.display()),
            Self::NotSource(path) => write!(f, "{} is not a project folder, and its name does not end in .st", path.display()),
            Self::Empty(path) => write!(f, "{} holds no .st file", path.display()),
        }
    }
}
impl std::error::Error for SourceError {}

/// Reads files and folders, in this order. Names are the paths as given, so that messages can be clicked.
pub fn read(paths: &[PathBuf]) -> Result<Sources, SourceError> {
    let mut files = Vec::new();
    for path in paths {
        let before = files.len();
        let meta = std::fs::metadata(path).map_err(|error| unreadable(path, error))?;
        if meta.is_dir() {
            walk(path, 0, &mut files)?;
            if files.len() == before {
                return Err(SourceError::Empty(path.clone()));
            }
        } else if is_source(path) {
            files.push(path.clone());
        } else {
            return Err(SourceError::NotSource(path.clone()));
        }
    }
    let mut sources = Sources::default();
    for file in files {
        let name = file.to_string_lossy().into_owned();
        if sources.list.iter().any(|known| known.name == name) {
            continue;
        }
        let (text, encoding) = decode(read_bytes(&file)?);
        if encoding != Encoding::Utf8 {
            sources.converted.push((name.clone(), encoding));
        }
        sources.list.push(Source { name, text });
    }
    Ok(sources)
}

/// Folders nested deeper than this are not walked (a link that leads back to its own folder ends here).
const DEPTH: u32 = 16;

fn walk(folder: &Path, depth: u32, files: &mut Vec<PathBuf>) -> Result<(), SourceError> {
    let entries = std::fs::read_dir(folder).map_err(|error| unreadable(folder, error))?;
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(|error| unreadable(folder, error))?.path());
    }
    paths.sort();
    for path in paths {
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if path.is_dir() && !hidden && depth < DEPTH {
            walk(&path, depth + 1, files)?;
        } else if path.is_file() && !hidden && is_source(&path) {
            files.push(path);
        }
    }
    Ok(())
}

fn is_source(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("st"))
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, SourceError> {
    let meta = std::fs::metadata(path).map_err(|error| unreadable(path, error))?;
    if meta.len() > LARGEST {
        return Err(SourceError::TooLarge(path.into()));
    }
    std::fs::read(path).map_err(|error| unreadable(path, error))
}

fn unreadable(path: &Path, error: std::io::Error) -> SourceError {
    match error.kind() {
        std::io::ErrorKind::NotFound => SourceError::Missing(path.into()),
        _ => SourceError::Unreadable(path.into(), error),
    }
}

/// Text of a source file and how it was read.
pub fn decode(bytes: Vec<u8>) -> (String, Encoding) {
    match String::from_utf8(bytes) {
        Ok(text) => (text.strip_prefix('\u{FEFF}').map(str::to_string).unwrap_or(text), Encoding::Utf8),
        Err(error) => {
            let bytes = error.into_bytes();
            if is_gbk(&bytes) {
                return (GBK.decode_without_bom_handling(&bytes).0.into_owned(), Encoding::Gbk);
            }
            (WINDOWS_1252.decode_without_bom_handling(&bytes).0.into_owned(), Encoding::Latin1)
        }
    }
}

/// Whether bytes are GBK: every lead byte has its trail byte, and most pairs are common characters (GB 2312 rows), as no Latin-1 text has them.
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
        common += u32::from(matches!(lead, 0xA1..=0xA9 | 0xB0..=0xF7) && trail >= 0xA1);
        i += 2;
    }
    common * 2 > pairs && GBK.decode_without_bom_handling_and_without_replacement(bytes).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(bytes: &[u8], text: &str, encoding: Encoding) {
        assert_eq!(decode(bytes.to_vec()), (text.to_string(), encoding));
    }

    #[test]
    fn reads_three_encodings() {
        check("(* 点胶 *) a := 1;\r\n".as_bytes(), "(* 点胶 *) a := 1;\r\n", Encoding::Utf8);
        check(b"\xEF\xBB\xBFx := 1;", "x := 1;", Encoding::Utf8);
        check(b"// \xB5\xE3\xBD\xBA\xB7\xA7", "// 点胶阀", Encoding::Gbk);
        check(b"// Gr\xF6\xDFe \xB0C", "// Größe °C", Encoding::Latin1);
        check(b"// K\xFChlung ein", "// Kühlung ein", Encoding::Latin1);
    }

    #[test]
    fn walks_folders_in_sorted_order() {
        let folder = std::env::temp_dir().join(format!("takt-sources-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("b")).unwrap();
        for name in ["z.st", "a.ST", "b/m.st", "b/readme.txt", ".hidden.st"] {
            std::fs::write(folder.join(name), "x").unwrap();
        }
        let sources = read(std::slice::from_ref(&folder)).unwrap();
        let names: Vec<_> = sources.list.iter().map(|s| s.name.trim_start_matches(folder.to_str().unwrap()).to_string()).collect();
        assert_eq!(names, ["/a.ST", "/b/m.st", "/z.st"]);
        assert!(matches!(read(&[folder.join("none")]), Err(SourceError::Missing(_))));
        assert!(matches!(read(&[folder.join("b/readme.txt")]), Err(SourceError::NotSource(_))));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
