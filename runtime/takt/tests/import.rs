//! Projects of TwinCAT and CODESYS as they are: checked, run and imported by the command, places and all.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A copy of the test projects that a test may change.
fn copy(test: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("takt-import-{test}-{}", std::process::id()));
    copy_folder(&root().join("tests/data/import"), &folder);
    folder
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        match path.is_dir() {
            true => copy_folder(&path, &target),
            false => drop(fs::copy(&path, &target).unwrap()),
        }
    }
}

fn takt(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let Output { status, stdout, stderr } =
        Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).current_dir(folder).env("LC_ALL", "C").output().unwrap();
    (status.code().unwrap(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[track_caller]
fn check(folder: &Path, arguments: &[&str], code: i32, out: &str, err: &str) {
    let (found, stdout, stderr) = takt(folder, arguments);
    assert_eq!(found, code, "{arguments:?}\n{stdout}\n{stderr}");
    assert!(stdout.contains(out) && (!out.is_empty() || stdout.is_empty()), "{arguments:?} wrote {stdout:?}");
    assert!(stderr.contains(err), "{arguments:?} said {stderr:?}");
}

/// Code, file, line and column of every finding.
fn findings(folder: &Path, paths: &[&str]) -> Vec<(String, String, u64, u64)> {
    let arguments: Vec<&str> = ["check", "--format", "json"].iter().chain(paths).copied().collect();
    let (_, stdout, stderr) = takt(folder, &arguments);
    let place = |line: &str| {
        let json: Value = serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}\n{stderr}"));
        let text = |key: &str| json[key].as_str().unwrap().to_string();
        (text("code"), text("file"), json["line"].as_u64().unwrap(), json["column"].as_u64().unwrap())
    };
    stdout.lines().map(place).collect()
}

/// Replaces a text of a file.
fn edit(folder: &Path, file: &str, from: &str, to: &str) {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    assert!(text.contains(from), "{from}");
    fs::write(folder.join(file), text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_twincat_project_is_checked_and_run_as_it_is() {
    let folder = copy("twincat");
    check(&folder, &["check", "twincat"], 0, "", "no findings");
    let arguments =
        ["run", "twincat/Sorter.plcproj", "--cycles", "20", "--json", "--print", "MAIN.fbBelt.nStarts", "--print", "GVL_Sorter.nHeavy"];
    let (code, stdout, stderr) = takt(&folder, &arguments);
    assert_eq!(code, 0, "{stderr}");
    let json: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(json["time_ns"], 100_000_000, "the task's cycle time is 5 ms");
    assert_eq!((&json["values"]["MAIN.fbBelt.nStarts"], &json["values"]["GVL_Sorter.nHeavy"]), (&1.into(), &2.into()));
    let single =
        ["run", "twincat/POUs/MAIN.TcPOU", "twincat/POUs/F_Weigh.TcPOU", "twincat/POUs/FB_Belt.TcPOU", "twincat/DUTs", "twincat/GVLs"];
    let arguments: Vec<&str> = single.iter().chain(&["--cycles", "3", "--print", "MAIN.nScans"]).copied().collect();
    check(&folder, &arguments, 0, "MAIN.nScans = 3\n", "");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn units_of_a_library_given_along_may_be_named_with_it() {
    let folder = copy("library");
    let user =
        "FUNCTION IsHeavy : BOOL\nVAR\n    state : Sorter.E_BeltState;\nEND_VAR\n    IsHeavy := Sorter.F_Weigh(50.0);\nEND_FUNCTION\n";
    fs::write(folder.join("User.st"), user).unwrap();
    edit(&folder, "twincat/POUs/MAIN.TcPOU", "F_Weigh(", "(IsHeavy() = Sorter.F_Weigh(50.0)) AND Sorter.F_Weigh(");
    let arguments = ["run", "User.st", "twincat/Sorter.plcproj", "--cycles", "20", "--print", "GVL_Sorter.nHeavy"];
    check(&folder, &arguments, 0, "GVL_Sorter.nHeavy = 2\n", "");
    edit(&folder, "User.st", "Sorter.F_Weigh(", "Sorter.F_Wiegh(");
    let found = findings(&folder, &["User.st", "twincat/Sorter.plcproj"]);
    assert_eq!(found, [("E0204".to_string(), "User.st".to_string(), 5, 23)]);
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn mistakes_and_faults_stand_where_people_edit() {
    let folder = copy("places");
    check(&folder, &["run", "twincat", "--cycles", "200"], 1, "", "division by zero at twincat/POUs/MAIN.TcPOU:28:14 in MAIN");
    check(&folder, &["run", "codesys/Mixer.xml", "--cycles", "300"], 1, "", "division by zero at codesys/Mixer.xml:332:");
    edit(&folder, "twincat/POUs/FB_Belt.TcPOU", "A_Start();\r\n", "A_Strat();\r\n");
    edit(&folder, "twincat/POUs/FB_Belt.TcPOU", "nStarts := nStarts + 1;", "nStarts := 'one';");
    edit(&folder, "twincat/PlcTask.TcTTO", "<Name>MAIN<", "<Name>MIAN<");
    let belt = "twincat/POUs/FB_Belt.TcPOU";
    let expected = [("E0201", belt, 23, 4), ("E0301", belt, 38, 33), ("E0203", "twincat/PlcTask.TcTTO", 8, 13)];
    let found = findings(&folder, &["twincat"]);
    assert_eq!(found, expected.map(|(code, file, line, column)| (code.to_string(), file.to_string(), line, column)));
    edit(&folder, "codesys/Mixer.xml", "IF level &lt;= 0.0 THEN", "IF level &lt;= missing THEN");
    edit(&folder, "codesys/Mixer.xml", "\tlevel : REAL;", "\tlevel : REEL;");
    let found: Vec<_> = findings(&folder, &["codesys/Mixer.xml"]).into_iter().map(|(code, _, line, column)| (code, line, column)).collect();
    let line = |part: &str| {
        let text = fs::read_to_string(folder.join("codesys/Mixer.xml")).unwrap();
        let line = text.lines().position(|line| line.contains(part)).unwrap();
        (line as u64 + 1, text.lines().nth(line).unwrap().find(part).unwrap() as u64 + 1)
    };
    let ((level, column), (other, other_column)) = (line("REEL"), line("missing"));
    assert_eq!(found, [("E0203".into(), level, column), ("E0201".into(), other, other_column)]);
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn plcopen_xml_is_checked_and_run_as_it_is() {
    let folder = copy("plcopen");
    check(&folder, &["check", "codesys/Mixer.xml"], 0, "", "no findings");
    check(&folder, &["run", "codesys/Mixer.xml", "--cycles", "60", "--print", "GVL_Mixer.batches"], 0, "GVL_Mixer.batches = 2\n", "");
    check(&folder, &["run", "codesys/Mixer.xml", "--cycles", "1", "--print", "GVL_Mixer.recipe.name"], 0, "'water & soap'", "");
    check(&folder, &["run", "codesys/Blinker.xml", "--cycles", "20", "--print", "Blink.result"], 0, "Blink.result = 35\n", "");
    check(&folder, &["run", "codesys/Blinker.xml", "--cycles", "9", "--print", "instance0.first.label"], 0, "'a < b'", "");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_import_checks_and_runs_as_its_source_did() {
    let folder = copy("round");
    for (source, cycles, variable, findings) in [
        ("twincat", "20", "GVL_Sorter.nLight", "no findings"),
        ("codesys/Mixer.xml", "60", "GVL_Mixer.batches", "no findings"),
        ("codesys/Blinker.xml", "20", "Blink.scans", "`first` is never used"),
    ] {
        check(&folder, &["import", source, "--to", "new", "--name", "A \"b\""], 0, "", "files written to new");
        check(&folder, &["check", "new"], 0, "", findings);
        let run = |path: &str| takt(&folder, &["run", path, "--cycles", cycles, "--print", variable]).1;
        assert_eq!(run("new"), run(source));
        check(&folder, &["import", source, "--to", "new"], 2, "", "already exists");
        assert_eq!(fs::read_to_string(folder.join("new/takt.toml")).unwrap().lines().nth(1).unwrap(), "name = 'A \"b\"'");
        fs::remove_dir_all(folder.join("new")).unwrap();
    }
    check(&folder, &["import", "oop", "--to", "new"], 0, "", "files written");
    let imported = findings(&folder, &["new"]).into_iter().map(|finding| finding.0).collect::<Vec<_>>();
    let original = findings(&folder, &["oop"]).into_iter().map(|finding| finding.0).collect::<Vec<_>>();
    assert_eq!((imported.len(), imported.iter().collect::<std::collections::BTreeSet<_>>()), (original.len(), original.iter().collect()));
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_is_left_behind_is_listed_with_its_place() {
    let folder = copy("left");
    edit(&folder, "twincat/POUs/FB_Belt.TcPOU", "      <ST><![CDATA[fbJam", "      <NWL/><ST><![CDATA[fbJam");
    let (code, stdout, _) = takt(&folder, &["import", "twincat", "--to", "new", "--json"]);
    let json: Value = serde_json::from_str(&stdout).unwrap();
    let left: Vec<_> =
        json["left"].as_array().unwrap().iter().map(|left| (left["what"].as_str().unwrap(), left["line"].as_u64().unwrap())).collect();
    let expected = [
        ("POUs/Old/FB_Unfinished.TcPOU", 34),
        ("VISUs/Overview.TcVIS", 38),
        ("the library Tc2_Standard", 54),
        ("the body of `FB_Belt` is written in ladder diagram, function block diagram or instruction list, not in ST", 19),
        ("the call of `VisuElems.Visu_Prg`", 8),
    ];
    assert_eq!((code, json["schema"].as_u64(), left), (1, Some(1), expected.to_vec()));
    assert!(json["files"].as_array().unwrap().contains(&"src/POUs/FB_Belt.st".into()));
    assert!(fs::read_to_string(folder.join("new/src/POUs/FB_Belt.st")).unwrap().contains("(* the body of `FB_Belt` is written in"));
    assert_eq!(findings(&folder, &["twincat"])[0].0, "E0502");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_damaged_file_is_refused_and_nothing_is_written() {
    let folder = copy("damaged");
    edit(&folder, "twincat/GVLs/GVL_Sorter.TcGVL", "</Declaration>", "</Declarations>");
    let found = findings(&folder, &["twincat"]);
    assert_eq!(
        found,
        [("E0501".to_string(), "twincat/GVLs/GVL_Sorter.TcGVL".to_string(), 14, 4)],
        "what depends on the file is not said again"
    );
    check(&folder, &["run", "twincat", "--cycles", "1"], 1, "", "E0501");
    check(&folder, &["import", "twincat", "--to", "new"], 1, "", "GVL_Sorter.TcGVL:14:4");
    assert!(!folder.join("new").exists());
    check(&folder, &["check", "twincat/Nothing.TcPOU"], 2, "", "does not exist");
    fs::write(folder.join("a.project"), "x").unwrap();
    check(&folder, &["check", "a.project"], 2, "", "Export PLCopenXML");
    check(&folder, &["import", "a.project", "--to", "new"], 2, "", "Export PLCopenXML");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn every_command_of_the_page_runs() {
    let folder = copy("page");
    let page = fs::read_to_string(root().join("docs/import.md")).unwrap();
    let mut lines = page.lines();
    let mut count = 0;
    while let Some(line) = lines.next() {
        if line != "```sh" {
            continue;
        }
        for line in lines.by_ref().take_while(|line| *line != "```") {
            let words: Vec<&str> = line.split_whitespace().collect();
            assert_eq!(words[0], "takt", "`{line}` is a command this test does not know");
            let (code, _, stderr) = takt(&folder, &words[1..]);
            assert_eq!(code, 0, "{line}\n{stderr}");
            count += 1;
        }
    }
    assert!(count >= 4, "{count} commands");
    fs::remove_dir_all(folder).unwrap();
}
