//! The READMEs are true: every command in them runs, every ST snippet compiles.

use std::path::{Path, PathBuf};
use std::process::Command;

const READMES: &[&str] = &["README.md", "README.zh.md"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The fenced blocks of a language.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let open = format!("```{language}");
    let mut found = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim() == open {
            found.push(lines.by_ref().take_while(|l| l.trim() != "```").map(|l| format!("{l}\n")).collect());
        }
    }
    found
}

fn readme(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A folder for this test process, with the README's snippet saved under the name it gives it.
fn folder(name: &str, text: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("takt-{}-{}", name.replace('.', "-"), std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let snippet = blocks(text, "iecst").into_iter().next().expect("a snippet");
    std::fs::write(folder.join("blink.st"), snippet).expect("a file");
    folder
}

/// The command of a README's line; what it writes goes to `folder`, and what would run at the machine's own pace runs for a second.
fn command(line: &str, folder: &Path) -> Option<Command> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (arguments, place) = match words.as_slice() {
        ["cargo", "test", "--workspace"] => return None, // this very run
        ["cargo", "run", "--release", "--", rest @ ..] => (rest, root()),
        ["takt", rest @ ..] => (rest, folder.to_path_buf()),
        _ => panic!("`{line}` is a command this test does not know"),
    };
    let plot = words.iter().position(|w| *w == "--plot").map(|at| words[at + 1]);
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.current_dir(place);
    for argument in arguments {
        match plot == Some(*argument) {
            true => command.arg(folder.join(argument)),
            false => command.arg(argument),
        };
    }
    if words.contains(&"real") {
        command.args(["--for", "1s"]);
    }
    Some(command)
}

#[test]
fn every_command_runs() {
    for name in READMES {
        let text = readme(name);
        let folder = folder(name, &text);
        let mut count = 0;
        for line in blocks(&text, "sh").iter().flat_map(|b| b.lines()) {
            let Some(mut command) = command(line, &folder) else { continue };
            let output = command.output().unwrap_or_else(|e| panic!("{line}: {e}"));
            assert!(output.status.success(), "{name}: `{line}` ended with {}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
            count += 1;
        }
        assert!(count >= 4, "{name}: expected at least 4 commands, found {count}");
        std::fs::remove_dir_all(folder).expect("the temporary folder goes");
    }
}

#[test]
fn every_snippet_compiles() {
    for name in READMES {
        let text = readme(name);
        let folder = folder(&format!("snippet-{name}"), &text);
        for (i, snippet) in blocks(&text, "iecst").iter().enumerate() {
            let file = folder.join(format!("snippet{i}.st"));
            std::fs::write(&file, snippet).expect("a file");
            let output = Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(&file).output().expect("takt runs");
            assert!(output.status.success(), "{name}: snippet {i}\n{}", String::from_utf8_lossy(&output.stderr));
        }
        std::fs::remove_dir_all(folder).expect("the temporary folder goes");
    }
}
