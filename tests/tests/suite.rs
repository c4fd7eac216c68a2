//! All cases under `tests/suite`, each a test of its own.

use libtest_mimic::{Arguments, Trial};
use std::path::{Path, PathBuf};
use takt_tests::{bench, case};

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = std::fs::read_dir(folder).expect("the suite's folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|e| e == "st") {
            found.push(path);
        }
    }
}

fn main() {
    let arguments = Arguments::from_args();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("suite");
    let mut paths = Vec::new();
    files(&root, &mut paths);
    let mut trials = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).expect("a suite file in UTF-8");
        let file = path.strip_prefix(&root).expect("below the suite").with_extension("").display().to_string();
        for case in case::cases(&text) {
            let name = format!("{file}/{}", case.name);
            trials.push(Trial::test(name, move || bench::run_case(&case).map_err(Into::into)));
        }
    }
    libtest_mimic::run(&arguments, trials).exit();
}
