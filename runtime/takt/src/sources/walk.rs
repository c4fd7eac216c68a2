//! Which files are meant: folders are walked in sorted order, a TwinCAT project names its own.

use super::SourceError;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What a file is, by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// ST.
    Text,
    /// A unit, type, list or interface of TwinCAT.
    TwinCat,
    /// A task of TwinCAT.
    Task,
    /// TwinCAT's list of files.
    Project,
    /// PLCopen XML, perhaps.
    Xml,
}

/// A file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found {
    /// As given, so that messages can be clicked.
    pub path: PathBuf,
    /// The folder it lies in, from the one that was named.
    pub folder: PathBuf,
    /// What it is.
    pub kind: Kind,
}

/// Folders nested deeper than this are not walked.
const DEPTH: u32 = 32;
/// Files of a program.
const FILES: usize = 50_000;

/// What a file is; `None` for what is no source.
pub(super) fn kind_of(path: &Path) -> Option<Kind> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match extension.as_str() {
        "st" | "iecst" => Kind::Text,
        "tcpou" | "tcdut" | "tcgvl" | "tcio" | "tctleo" => Kind::TwinCat,
        "tctto" => Kind::Task,
        "plcproj" => Kind::Project,
        "xml" => Kind::Xml,
        _ => return None,
    })
}

/// What to do about files that hold sources, but packed or in a form of their own.
pub(super) fn packed(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match extension.as_str() {
        "project" | "projectarchive" | "library" | "compiled-library" | "export" | "pro" | "exp" => {
            "open it in CODESYS, choose Project, Export PLCopenXML…, and name the .xml file"
        }
        "tnzip" | "tpzip" | "tszip" => "unpack it (it is a ZIP archive) or open it in TwinCAT XAE, and name the folder with the .plcproj",
        "sln" | "tsproj" | "tspproj" => "name the .plcproj of the PLC or the folder that it lies in",
        _ => return None,
    })
}

/// What to do about a file that begins like an archive.
pub(super) fn packed_bytes(bytes: &[u8]) -> Option<&'static str> {
    let magics: [&[u8]; 6] = [b"PK\x03\x04", b"\x1F\x8B", b"7z\xBC\xAF", b"Rar!", b"BZh", b"\x28\xB5\x2F\xFD"];
    let is_packed = magics.iter().any(|magic| bytes.starts_with(magic));
    is_packed.then_some("unpack it, or export the project as PLCopen XML or as single files, and name those")
}

/// The files that paths mean, each once. A folder with a `.plcproj` means that.
pub(super) fn files(paths: &[PathBuf]) -> Result<Vec<Found>, SourceError> {
    let mut found = Vec::new();
    for path in paths {
        let meta = std::fs::metadata(path).map_err(|error| SourceError::of(path, error))?;
        if !meta.is_dir() {
            found.push(Found { path: path.clone(), folder: PathBuf::new(), kind: named(path)? });
            continue;
        }
        let mut walk = Walk { seen: HashSet::new(), files: Vec::new(), packed: None };
        walk.folder(path, Path::new(""), 0)?;
        found.extend(chosen(path, walk)?);
    }
    let mut seen = HashSet::new();
    found.retain(|file| seen.insert(file.path.canonicalize().unwrap_or_else(|_| file.path.clone())));
    Ok(found)
}

/// A file that was named must be a source.
fn named(path: &Path) -> Result<Kind, SourceError> {
    match (kind_of(path), packed(path)) {
        (Some(kind), _) => Ok(kind),
        (None, Some(help)) => Err(SourceError::Packed(path.into(), help)),
        (None, None) => Err(SourceError::NotSource(path.into())),
    }
}

/// What counts of a folder.
fn chosen(path: &Path, walk: Walk) -> Result<Vec<Found>, SourceError> {
    let mut projects = walk.files.iter().filter(|file| file.kind == Kind::Project);
    match (projects.next(), projects.next()) {
        (Some(first), Some(second)) => Err(SourceError::TwoProjects(first.path.clone(), second.path.clone())),
        (Some(project), None) => Ok(vec![project.clone()]),
        (None, _) if walk.files.is_empty() => Err(match walk.packed {
            Some((path, help)) => SourceError::Packed(path, help),
            None => SourceError::Empty(path.into()),
        }),
        (None, _) => Ok(walk.files),
    }
}

struct Walk {
    seen: HashSet<PathBuf>,
    files: Vec<Found>,
    /// An archive, told where nothing else is found.
    packed: Option<(PathBuf, &'static str)>,
}

impl Walk {
    fn folder(&mut self, folder: &Path, relative: &Path, depth: u32) -> Result<(), SourceError> {
        // A link that leads back to a folder is not walked twice.
        if depth > DEPTH || !self.seen.insert(folder.canonicalize().unwrap_or_else(|_| folder.into())) {
            return Ok(());
        }
        let entries = std::fs::read_dir(folder).map_err(|error| SourceError::of(folder, error))?;
        let mut paths = Vec::new();
        for entry in entries {
            paths.push(entry.map_err(|error| SourceError::of(folder, error))?.path());
        }
        paths.sort();
        for path in paths {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with('.') {
                continue;
            }
            if path.is_dir() {
                self.folder(&path, &relative.join(&name), depth + 1)?;
            } else if let Some(kind) = kind_of(&path).filter(|kind| path.is_file() && (*kind != Kind::Xml || is_plcopen(&path))) {
                if self.files.len() >= FILES {
                    return Err(SourceError::TooMany(folder.into(), FILES));
                }
                self.files.push(Found { path, folder: relative.into(), kind });
            } else if let Some(help) = packed(&path) {
                self.packed.get_or_insert((path, help));
            }
        }
        Ok(())
    }
}

/// Whether an XML file that lies in a folder is a program: other tools keep theirs beside it.
fn is_plcopen(path: &Path) -> bool {
    use std::io::Read;
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(4096).read_to_end(&mut head));
    // UTF-16 has a zero between the letters.
    head.retain(|byte| *byte != 0);
    read.is_ok() && String::from_utf8_lossy(&head).contains("plcopen.org/xml/tc6")
}
