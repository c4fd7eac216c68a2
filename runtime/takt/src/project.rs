//! A project: a manifest and its sources, read from disk; or source files alone.

use crate::manifest::{self, Located, Manifest, ManifestError, ManifestErrors};
use crate::sources::{self, SourceError, Sources};
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Name of the manifest in a project folder.
pub const MANIFEST: &str = "takt.toml";

/// A project, ready to be compiled.
#[derive(Debug, Clone, Default)]
pub struct Project {
    /// For people.
    pub name: String,
    /// The folder that `nc/` and `data/` are in.
    pub root: PathBuf,
    /// What the manifest says; empty without one.
    pub manifest: Manifest,
    /// Name and text of the manifest, if there is one.
    pub manifest_file: Option<(String, String)>,
    /// The sources.
    pub sources: Sources,
}

/// Why a project cannot be read.
#[derive(Debug)]
pub enum ProjectError {
    /// The manifest has mistakes.
    Manifest(ManifestErrors),
    /// The manifest cannot be read.
    Unreadable(PathBuf, std::io::Error),
    /// Two of the paths have a manifest.
    TwoManifests(PathBuf, PathBuf),
    /// A source cannot be read.
    Source(SourceError),
}

impl fmt::Display for ProjectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Manifest(errors) => write!(f, "{errors}"),
            Self::Unreadable(path, error) => write!(f, "{} cannot be read: {error}", path.display()),
            Self::TwoManifests(a, b) => write!(f, "{} and {} are two projects; run one at a time", a.display(), b.display()),
            Self::Source(error) => write!(f, "{error}"),
        }
    }
}
impl std::error::Error for ProjectError {}

/// Reads a project folder or a source file.
pub fn load(path: impl AsRef<Path>) -> Result<Project, ProjectError> {
    load_all(&[path.as_ref().to_path_buf()])
}

/// Reads project folders, folders and files that are one program. At most one of them has a manifest.
pub fn load_all(paths: &[PathBuf]) -> Result<Project, ProjectError> {
    let mut project = Project::default();
    let mut manifest_path: Option<PathBuf> = None;
    let mut source_paths = Vec::new();
    for path in paths {
        let Some(found) = manifest_of(path) else {
            source_paths.push(path.clone());
            continue;
        };
        if let Some(first) = manifest_path.replace(found.clone()) {
            return Err(ProjectError::TwoManifests(first, found));
        }
        read_manifest(&mut project, &found)?;
        let folder = found.parent().unwrap_or(Path::new("")).to_path_buf();
        source_paths.extend(source_folders(&project, &folder)?);
        project.root = folder;
    }
    if manifest_path.is_none() {
        let first = paths.first().map(PathBuf::as_path).unwrap_or(Path::new(""));
        project.root = if first.is_dir() { first.into() } else { first.parent().unwrap_or(Path::new("")).into() };
    }
    if project.root.as_os_str().is_empty() {
        project.root = PathBuf::from(".");
    }
    project.name = project.manifest.name.clone().unwrap_or_else(|| name_of(paths, &project.root));
    project.sources = sources::read(&source_paths).map_err(ProjectError::Source)?;
    Ok(project)
}

fn manifest_of(path: &Path) -> Option<PathBuf> {
    if path.file_name().is_some_and(|name| name == MANIFEST) {
        return Some(path.into());
    }
    Some(path.join(MANIFEST)).filter(|manifest| manifest.is_file())
}

/// The stem of the only file, else the name of the folder.
fn name_of(paths: &[PathBuf], root: &Path) -> String {
    match paths {
        [file] if file.is_file() && file.file_name().is_some_and(|name| name != MANIFEST) => {
            file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
        }
        _ => folder_name(root),
    }
}

fn folder_name(folder: &Path) -> String {
    let full = folder.canonicalize().unwrap_or_else(|_| folder.into());
    full.file_name().map_or_else(|| "takt".into(), |name| name.to_string_lossy().into_owned())
}

fn read_manifest(project: &mut Project, path: &Path) -> Result<(), ProjectError> {
    let bytes = std::fs::read(path).map_err(|error| ProjectError::Unreadable(path.into(), error))?;
    let name = path.to_string_lossy().into_owned();
    let (text, _) = sources::decode(bytes).map_err(|wrong| {
        let span = wrong.before.len()..wrong.before.len();
        let error = ManifestError { span, message: wrong.message, help: "save it as UTF-8".into() };
        ProjectError::Manifest(ManifestErrors { file: name.clone(), text: wrong.before, errors: vec![error] })
    })?;
    project.manifest = manifest::read(&name, &text).map_err(ProjectError::Manifest)?;
    project.manifest_file = Some((name, text));
    Ok(())
}

fn source_folders(project: &Project, folder: &Path) -> Result<Vec<PathBuf>, ProjectError> {
    if project.manifest.sources.is_empty() {
        return Ok(vec![folder.join("src")]);
    }
    let mut errors = Vec::new();
    for source in &project.manifest.sources {
        if let Some(message) = refused(source, folder) {
            errors.push(ManifestError { span: source.span.clone(), message, help: "name a folder or a source file of the project".into() });
        }
    }
    if errors.is_empty() {
        return Ok(project.manifest.sources.iter().map(|source| folder.join(&source.value)).collect());
    }
    Err(ProjectError::Manifest(project.errors(errors)))
}

fn refused(source: &Located<String>, folder: &Path) -> Option<String> {
    let path = Path::new(&source.value);
    if !path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Some(format!("source \"{}\" leaves the project's folder", source.value));
    }
    (!folder.join(path).exists()).then(|| format!("source \"{}\" does not exist", source.value))
}

impl Project {
    /// Mistakes found in the manifest after it was read.
    pub fn errors(&self, mut errors: Vec<ManifestError>) -> ManifestErrors {
        errors.sort_by_key(|error| error.span.start);
        let (file, text) = self.manifest_file.clone().unwrap_or_default();
        ManifestErrors { file, text, errors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
        let root = std::env::temp_dir().join(format!("takt-project-{name}-{}", std::process::id()));
        for (file, text) in files {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn a_folder_with_a_manifest_is_a_project() {
        let root = folder("good", &[("takt.toml", "[project]\nname = \"Dispenser\"\n"), ("src/GVL.st", "x"), ("nc/a.cnc", "")]);
        let project = load(&root).unwrap();
        assert_eq!((project.name.as_str(), project.root.clone(), project.sources.list.len()), ("Dispenser", root.clone(), 1));
        assert!(load(root.join("takt.toml")).is_ok());
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn a_source_outside_the_folder_is_refused_with_its_place() {
        let root = folder("outside", &[("takt.toml", "[project]\nsources = [\"../x\", \"none\"]\n")]);
        let text = load(&root).unwrap_err().to_string();
        assert!(
            text.contains("takt.toml:2:12: source \"../x\" leaves") && text.contains(":2:20: source \"none\" does not exist"),
            "{text}"
        );
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn source_files_alone_are_a_program() {
        let root = folder("files", &[("a.st", "x"), ("b.st", "y")]);
        let project = load_all(&[root.join("b.st"), root.join("a.st")]).unwrap();
        assert_eq!((project.root.clone(), project.sources.list.len(), project.manifest_file.is_none()), (root.clone(), 2, true));
        std::fs::remove_dir_all(root).unwrap();
    }
}
