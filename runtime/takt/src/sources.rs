//! Sources from disk, as they are: ST, TwinCAT's files and projects, PLCopen XML.
//!
//! What is not ST becomes ST when it is read, and every stretch of it remembers its place, so that messages name the file that people edit. Promises:
//! bounded time and memory for any file; a file is read once, however often it is named; what cannot be read is said with its place. Lacks: archives
//! and CODESYS' own project files, which are refused with what to do instead.

mod encoding;
mod layout;
mod origin;
mod plcopen;
mod plcproj;
mod tasks;
mod twincat;
mod walk;
mod words;
mod xml;

pub use encoding::{Encoding, NotText, decode};
pub use layout::Left;
pub use origin::{Lines, Origin};

use layout::{Style, Writer, Written};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_syntax::{Code, Diagnostic, FileId, Source};
use walk::{Found, Kind};

/// A source file larger than this is refused: it is none.
pub const LARGEST: u64 = 64 << 20;

/// Sources, and what there is to say about how they were read.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    /// In the order of the paths, folders sorted.
    pub list: Vec<Source>,
    /// Names of files that were not UTF-8.
    pub converted: Vec<(String, Encoding)>,
    /// Where texts come from that were made from other files, by their index.
    pub origins: BTreeMap<usize, Arc<Origin>>,
    /// What TwinCAT's projects among them are called, so that their units may be named with it.
    pub namespaces: Vec<String>,
    /// What could not be read. Spans are in the texts of the list.
    pub findings: Vec<Diagnostic>,
}

impl Sources {
    /// Whether any of the files is one of TwinCAT, where the numbers of direct addresses count bytes.
    pub fn are_twincat(&self) -> bool {
        let form = |source: &Source| Path::new(&source.name).extension().map(|form| form.to_string_lossy().to_lowercase());
        self.list.iter().filter_map(form).any(|form| form == "plcproj" || form.starts_with("tc"))
    }
}

/// Sources for people, as `takt import` writes them.
#[derive(Debug, Clone, Default)]
pub struct Export {
    /// Folder, name without extension, and ST, one unit each; the names of a folder differ in any case of their letters.
    pub units: Vec<(PathBuf, String, String)>,
    /// What could not be carried over, in the order of the files.
    pub left: Vec<Left>,
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
    /// More files than any program has.
    TooMany(PathBuf, usize),
    /// Neither a folder nor a source file.
    NotSource(PathBuf),
    /// An archive or a project in a form of its own, and what to do.
    Packed(PathBuf, &'static str),
    /// A folder without any source file.
    Empty(PathBuf),
    /// Two TwinCAT projects in a folder.
    TwoProjects(PathBuf, PathBuf),
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(path) => write!(f, "{} does not exist", path.display()),
            Self::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            Self::TooLarge(path) => write!(f, "{} is larger than {} MiB: not a source file", path.display(), LARGEST >> 20),
            Self::TooMany(path, limit) => write!(f, "{} holds more than {limit} source files; name a folder inside of it", path.display()),
            Self::NotSource(path) => {
                let kinds = ".st, .iecst, .TcPOU, .TcDUT, .TcGVL, .TcIO, .TcTTO, .plcproj or .xml";
                write!(f, "{} is not a project folder, and its name does not end in {kinds}", path.display())
            }
            Self::Packed(path, help) => write!(f, "{} cannot be read as it is; {help}", path.display()),
            Self::Empty(path) => write!(f, "{} holds no source file (.st, TwinCAT's or PLCopen XML)", path.display()),
            Self::TwoProjects(a, b) => {
                write!(f, "{} and {} are two PLC projects; name the .plcproj that is meant", a.display(), b.display())
            }
        }
    }
}
impl std::error::Error for SourceError {}

impl SourceError {
    fn of(path: &Path, error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::Missing(path.into()),
            _ => Self::Unreadable(path.into(), error),
        }
    }
}

/// Reads files and folders, in this order. Names are the paths as given, so that messages can be clicked.
pub fn read(paths: &[PathBuf]) -> Result<Sources, SourceError> {
    let mut reading = Reading::new(Style::Places);
    reading.all(paths)?;
    Ok(reading.sources())
}

/// Reads files and folders for people: one text per unit.
pub fn export(paths: &[PathBuf]) -> Result<(Sources, Export), SourceError> {
    let checked = read(paths)?;
    let mut reading = Reading::new(Style::Clean);
    reading.all(paths)?;
    Ok((checked, reading.export()))
}

/// A file and what was made of it.
struct Read {
    name: String,
    folder: PathBuf,
    written: Written,
    is_verbatim: bool,
}

/// Files being read.
struct Reading {
    style: Style,
    files: Vec<Read>,
    tasks: Vec<Source>,
    task_folder: PathBuf,
    namespaces: Vec<String>,
    converted: Vec<(String, Encoding)>,
}

impl Reading {
    fn new(style: Style) -> Self {
        Self { style, files: Vec::new(), tasks: Vec::new(), task_folder: PathBuf::new(), namespaces: Vec::new(), converted: Vec::new() }
    }

    fn all(&mut self, paths: &[PathBuf]) -> Result<(), SourceError> {
        for found in walk::files(paths)? {
            self.file(&found)?;
        }
        self.tasks();
        Ok(())
    }

    fn file(&mut self, found: &Found) -> Result<(), SourceError> {
        let name = found.path.to_string_lossy().into_owned();
        let bytes = read_bytes(&found.path)?;
        let text = match decode(bytes) {
            Ok((text, encoding)) => {
                if !matches!(encoding, Encoding::Utf8) {
                    self.converted.push((name.clone(), encoding));
                }
                text
            }
            Err(wrong) => {
                self.keep(name.clone(), found, not_text(self.style, name, wrong), false);
                return Ok(());
            }
        };
        let source = Source { name: name.clone(), text };
        match found.kind {
            Kind::Text => self.verbatim(source, found),
            Kind::Task => {
                if self.tasks.is_empty() {
                    self.task_folder.clone_from(&found.folder);
                }
                self.tasks.push(source);
            }
            Kind::TwinCat => {
                let stem = stem(&found.path);
                let written = write_xml(self.style, source, &stem, |root, writer| twincat::write(root, &stem, writer));
                self.keep(name, found, written, false);
            }
            Kind::Xml => {
                let stem = stem(&found.path);
                let written = write_xml(self.style, source, &stem, |root, writer| plcopen::write(root, &stem, writer));
                self.keep(name, found, written, false);
            }
            Kind::Project => self.project(source, found)?,
        }
        Ok(())
    }

    fn keep(&mut self, name: String, found: &Found, written: Written, is_verbatim: bool) {
        self.files.push(Read { name, folder: found.folder.clone(), written, is_verbatim });
    }

    /// ST needs no writing.
    fn verbatim(&mut self, source: Source, found: &Found) {
        let unit = layout::Unit { name: stem(&found.path), text: source.text };
        let written = Written { units: vec![unit], origin: Origin::default(), findings: Vec::new(), left: Vec::new() };
        self.keep(source.name, found, written, true);
    }

    /// The files that a TwinCAT project names.
    fn project(&mut self, source: Source, found: &Found) -> Result<(), SourceError> {
        let folder = found.path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut files = Vec::new();
        let name = source.name.clone();
        let namespaces = &mut self.namespaces;
        let written = write_xml(self.style, source, &stem(&found.path), |root, writer| {
            namespaces.extend(plcproj::names(root));
            for item in plcproj::items(root, writer) {
                let kind = walk::kind_of(&item.path).filter(|kind| !matches!(kind, Kind::Project));
                match (kind, plcproj::resolve(&folder, &item.path)) {
                    (None, _) => writer.left(&item.at, &item.path.to_string_lossy(), "it holds no program"),
                    (Some(_), None) => {
                        let message = format!("`{}` is part of the project, but there is no such file", item.path.display());
                        writer.refuse(Code::BadFile, item.at, message, "restore the file, or exclude it from the build");
                    }
                    (Some(kind), Some(path)) => {
                        files.push(Found { path, folder: inside(item.path.parent().unwrap_or(Path::new(""))), kind });
                    }
                }
            }
        });
        if self.style == Style::Clean || !written.findings.is_empty() {
            self.keep(name, found, written, false);
        }
        files.iter().try_for_each(|file| self.file(file))
    }

    /// All tasks of TwinCAT are one CONFIGURATION.
    fn tasks(&mut self) {
        let sources = std::mem::take(&mut self.tasks);
        let Some(first) = sources.first() else { return };
        let name = first.name.clone();
        let mut writer = Writer::new(self.style, first.clone());
        let mut plans = Vec::new();
        for (i, source) in sources.iter().enumerate() {
            let file = if i == 0 { 0 } else { writer.add_file(source.clone()) };
            writer.select(file);
            match xml::parse(&source.text) {
                Ok(root) => plans.extend(tasks::of_twincat(&root, file, &mut writer)),
                Err(error) => writer.refuse(Code::BadFile, error.at, error.message, error.help),
            }
        }
        tasks::write("Tasks", &plans, &mut writer);
        let written = writer.finish("Tasks");
        let folder = std::mem::take(&mut self.task_folder);
        self.files.push(Read { name, folder, written, is_verbatim: false });
    }

    fn sources(self) -> Sources {
        let mut sources = Sources { converted: self.converted, namespaces: self.namespaces, ..Sources::default() };
        for (index, file) in self.files.into_iter().enumerate() {
            let text = file.written.units.into_iter().next().map_or_else(String::new, |unit| unit.text);
            sources.list.push(Source { name: file.name, text });
            if !file.is_verbatim {
                sources.origins.insert(index, Arc::new(file.written.origin));
            }
            sources.findings.extend(file.written.findings.into_iter().map(|finding| in_file(finding, index)));
        }
        sources
    }

    fn export(self) -> Export {
        let mut export = Export { converted: self.converted, ..Export::default() };
        let mut taken = std::collections::HashSet::new();
        for file in self.files {
            export.left.extend(file.written.left);
            for unit in file.written.units.into_iter().filter(|unit| !unit.text.trim().is_empty()) {
                let mut name = file_name(&unit.name);
                let mut number = 2;
                while !taken.insert((file.folder.clone(), name.to_lowercase())) {
                    name = format!("{}_{number}", file_name(&unit.name));
                    number += 1;
                }
                export.units.push((file.folder.clone(), name, unit.text));
            }
        }
        export
    }
}

fn in_file(mut finding: Diagnostic, index: usize) -> Diagnostic {
    finding.span.file = FileId(index as u32);
    finding
}

/// A path without what leads out of its folder.
fn inside(path: &Path) -> PathBuf {
    path.components().filter(|part| matches!(part, std::path::Component::Normal(_))).collect()
}

/// A name that every system takes for a file.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || matches!(c, '_' | '-' | ' ') { c } else { '_' }).take(100).collect()
}

/// The name without folder and extension.
fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Writes what an XML file holds; where it is none, a message.
fn write_xml(style: Style, source: Source, stem: &str, write: impl FnOnce(&xml::Element<'_>, &mut Writer)) -> Written {
    let mut writer = Writer::new(style, source.clone());
    match xml::parse(&source.text) {
        Ok(root) => write(&root, &mut writer),
        Err(error) => writer.refuse(Code::BadFile, error.at, error.message, error.help),
    }
    writer.finish(stem)
}

/// A file that is no text: a message at its first wrong byte.
fn not_text(style: Style, name: String, wrong: NotText) -> Written {
    let end = wrong.before.len();
    let mut writer = Writer::new(style, Source { name, text: wrong.before });
    writer.refuse(Code::BadFile, end..end, wrong.message, wrong.help);
    writer.finish("")
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, SourceError> {
    use std::io::Read;
    let file = std::fs::File::open(path).map_err(|error| SourceError::of(path, error))?;
    if file.metadata().is_ok_and(|meta| meta.len() > LARGEST) {
        return Err(SourceError::TooLarge(path.into()));
    }
    let mut bytes = Vec::new();
    // A pipe or a device has no length: what is read is counted.
    file.take(LARGEST + 1).read_to_end(&mut bytes).map_err(|error| SourceError::of(path, error))?;
    if bytes.len() as u64 > LARGEST {
        return Err(SourceError::TooLarge(path.into()));
    }
    match walk::packed_bytes(&bytes) {
        Some(help) => Err(SourceError::Packed(path.into(), help)),
        None => Ok(bytes),
    }
}

#[cfg(test)]
mod tests;
