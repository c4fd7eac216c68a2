//! Files of programs from end to end: blocks in ST, the file service, a folder on the disk.

use std::path::PathBuf;
use std::sync::Arc;
use takt_abi::Time;
use takt_engine::{Engine, ExecutorKind, NoBus, Options};
use takt_ir::Program;

/// A project's folder that goes with the test.
struct Project(PathBuf);

impl Project {
    fn new(name: &str) -> Self {
        let root = std::env::temp_dir().join(format!("takt-files-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        std::fs::create_dir_all(&root).expect("a folder for the test");
        Self(root)
    }
    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join("data").join(name)).expect("the file is there")
    }
}
impl Drop for Project {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn compiled(source: &str) -> Arc<Program> {
    let output = takt_tests::bench::compile(source);
    let errors: Vec<_> = output.diagnostics.iter().map(|d| format!("{}: {}", d.code.text(), d.message)).collect();
    Arc::new(output.program.unwrap_or_else(|| panic!("does not compile: {errors:?}")))
}

fn started(program: &Arc<Program>, project: &Project, executor: ExecutorKind) -> Engine {
    let host = takt::host::open(project.0.clone()).expect("the file service starts");
    let options = Options { executor, host: Box::new(host), ..Options::default() };
    takt_engine::load(program.clone(), options, Box::new(NoBus)).expect("loads")
}

fn value(engine: &Engine, program: &Program, path: &str) -> String {
    let place = takt_ir::resolve(program, path).expect("a variable");
    takt_ir::format_value(&program.types, place.ty, engine.read(place))
}

/// Runs the program for so many scans in both executors, each in a project that `prepare` made; the values of the variables.
fn run(name: &str, source: &str, scans: i64, paths: &[&str], prepare: impl Fn(&Project)) -> (Vec<String>, Project) {
    let program = compiled(source);
    let mut results = Vec::new();
    let mut last = None;
    for executor in [ExecutorKind::Interpreter, ExecutorKind::Jit] {
        let project = Project::new(&format!("{name}-{executor:?}"));
        prepare(&project);
        let mut engine = started(&program, &project, executor);
        for scan in 0..scans {
            engine.step(Time::from_millis(10 * scan));
            assert_eq!(engine.fault().map(|f| f.fault), None, "scan {scan}");
        }
        results.push(paths.iter().map(|p| value(&engine, &program, p)).collect::<Vec<_>>());
        last = Some(project);
    }
    assert_eq!(results[0], results[1], "both executors agree");
    (results.remove(0), last.expect("ran"))
}

const STEPS: &str = "
PROGRAM main
VAR
    state : INT; h : CAA.HANDLE; err : FILE.ERROR;
    op : FILE.Open; cl : FILE.Close; wr : FILE.Write; rd : FILE.Read; sp : FILE.SetPos; gp : FILE.GetPos; eo : FILE.EOF; sz : FILE.GetSize;
    fl : FILE.Flush; text : STRING := 'hello world'; back : STRING; pos : UDINT; size : CAA.SIZE; atEnd : BOOL;
END_VAR
CASE state OF
0: op(xExecute := TRUE, sFileName := 'log.txt', eFileMode := FILE.MODE.MRDWR);
   IF op.xDone THEN h := op.hFile; op(xExecute := FALSE); state := 1; ELSIF op.xError THEN err := op.eError; state := 99; END_IF
1: wr(xExecute := TRUE, hFile := h, pBuffer := ADR(text), szSize := LEN(text));
   IF wr.xDone THEN wr(xExecute := FALSE); state := 2; ELSIF wr.xError THEN err := wr.eError; state := 99; END_IF
2: gp(xExecute := TRUE, hFile := h); pos := gp.udiPos;
   sp(xExecute := TRUE, hFile := h, udiPos := 6); state := 3;
3: rd(xExecute := TRUE, hFile := h, pBuffer := ADR(back), szBuffer := SIZEOF(back));
   IF rd.xDone THEN size := rd.szSize; rd(xExecute := FALSE); state := 4; ELSIF rd.xError THEN err := rd.eError; state := 99; END_IF
4: eo(xExecute := TRUE, hFile := h);
   IF eo.xDone THEN atEnd := eo.xEOF; state := 5; ELSIF eo.xError THEN err := eo.eError; state := 99; END_IF
5: fl(xExecute := TRUE, hFile := h);
   IF fl.xDone THEN state := 6; ELSIF fl.xError THEN err := fl.eError; state := 99; END_IF
6: cl(xExecute := TRUE, hFile := h); IF cl.xDone THEN state := 7; END_IF
7: sz(xExecute := TRUE, sFileName := 'log.txt'); IF sz.xDone THEN state := 8; END_IF
8: rd(xExecute := TRUE, hFile := h, pBuffer := ADR(back), szBuffer := 1);
   IF rd.xError THEN err := rd.eError; state := 9; END_IF
END_CASE
END_PROGRAM";

#[test]
fn a_program_writes_a_file_and_reads_it_back() {
    let paths = ["main.state", "main.back", "main.size", "main.pos", "main.atEnd", "main.sz.szSize", "main.err"];
    let (values, project) = run("steps", STEPS, 40, &paths, |_| {});
    assert_eq!(values, ["9", "'world'", "5", "11", "TRUE", "11", "FILE_ERROR.HANDLE_INVALID"]);
    assert_eq!(project.text("log.txt"), "hello world");
}

#[test]
fn a_program_appends_to_a_log() {
    let source = "
PROGRAM main
VAR op : FILE.Open; wr : FILE.Write; n : INT; line : STRING; END_VAR
op(xExecute := TRUE, sFileName := 'log.txt', eFileMode := FILE.MODE.MAPPD);
IF op.xDone AND n < 3 THEN
    IF NOT wr.xBusy THEN line := CONCAT('line ', INT_TO_STRING(n), '$N'); END_IF
    wr(xExecute := NOT wr.xDone, hFile := op.hFile, pBuffer := ADR(line), szSize := LEN(line));
    IF wr.xDone THEN n := n + 1; END_IF
END_IF
END_PROGRAM";
    let (values, project) = run("append", source, 40, &["main.n", "main.op.eError"], |project| {
        std::fs::create_dir_all(project.0.join("data")).expect("data");
        std::fs::write(project.0.join("data/log.txt"), "old\n").expect("a log");
    });
    assert_eq!(values, ["3", "FILE_ERROR.NO_ERROR"]);
    assert_eq!(project.text("log.txt"), "old\nline 0\nline 1\nline 2\n");
}

#[test]
fn a_program_makes_a_folder_for_its_files() {
    let source = "
PROGRAM main
VAR dir, again : FILE.DirCreate; op : FILE.Open; wr : FILE.Write; text : STRING := 'x'; exists : BOOL; END_VAR
dir(xExecute := TRUE, sDirName := 'logs/2026', xParent := TRUE);
again(xExecute := dir.xDone, sDirName := 'logs');
op(xExecute := dir.xDone, sFileName := 'logs/2026/a.txt', eFileMode := FILE.MODE.MWRITE);
wr(xExecute := op.xDone, hFile := op.hFile, pBuffer := ADR(text), szSize := 1);
exists := again.eError = FILE.ERROR.EXIST;
END_PROGRAM";
    let (values, project) = run("folder", source, 20, &["main.dir.xDone", "main.exists", "main.wr.xDone"], |_| {});
    assert_eq!(values, ["TRUE"; 3]);
    assert_eq!(project.text("logs/2026/a.txt"), "x");
}

#[test]
fn a_program_lists_a_folder() {
    let source = "
PROGRAM main
VAR
    op : FILE.DirOpen; ls : FILE.DirList; cl : FILE.DirClose; entry : FILE.FILE_DIR_ENTRY;
    names : STRING; bytes : ULINT; folders : INT; over, closed : BOOL;
END_VAR
op(xExecute := TRUE, sDirName := './');
IF op.xDone AND NOT over THEN
    ls(xExecute := NOT (ls.xDone OR ls.xError), hDir := op.hDir);
    IF ls.xDone THEN
        entry := ls.deDirEntry;
        names := CONCAT(names, entry.sEntry, ' ');
        bytes := bytes + entry.szSize;
        IF entry.xDirectory THEN folders := folders + 1; END_IF
    END_IF
    over := ls.xError AND ls.eError = FILE.ERROR.NO_MORE_ENTRIES;
END_IF
cl(xExecute := over, hDir := op.hDir);
IF cl.xDone AND NOT closed THEN
    ls(xExecute := FALSE);
    ls(xExecute := TRUE, hDir := op.hDir);
    closed := ls.eError = FILE.ERROR.HANDLE_INVALID;
END_IF
END_PROGRAM";
    let paths = ["main.names", "main.bytes", "main.folders", "main.over", "main.closed"];
    let (values, _) = run("list", source, 30, &paths, |project| {
        std::fs::create_dir_all(project.0.join("data/logs")).expect("data");
        std::fs::write(project.0.join("data/b.txt"), "12345").expect("a file");
        std::fs::write(project.0.join("data/a.txt"), "12").expect("a file");
    });
    assert_eq!(values, ["'a.txt b.txt logs '", "7", "1", "TRUE", "TRUE"]);
}

#[test]
fn more_than_a_chunk_goes_to_a_file_and_back() {
    let source = "
PROGRAM main
VAR
    a, b : ARRAY[0..149999] OF DINT; i, order : DINT; ready : BOOL; scans : INT;
    op : FILE.Open; wr : FILE.Write; sp : FILE.SetPos; rd : FILE.Read;
END_VAR
IF NOT ready THEN
    FOR i := 0 TO 149999 DO a[i] := i * 7; END_FOR
    ready := TRUE;
END_IF
op(xExecute := TRUE, sFileName := 'big.bin', eFileMode := FILE.MODE.MRDWR);
IF op.xDone THEN
    wr(xExecute := TRUE, hFile := op.hFile, pBuffer := ADR(a), szSize := SIZEOF(a));
    IF wr.xDone THEN
        sp(xExecute := TRUE, hFile := op.hFile, udiPos := 0);
        rd(xExecute := TRUE, hFile := op.hFile, pBuffer := ADR(b), szBuffer := SIZEOF(b));
    END_IF
END_IF
order := MEMCMP(ADR(a), ADR(b), SIZEOF(a));
IF NOT rd.xDone THEN scans := scans + 1; END_IF
END_PROGRAM";
    let (values, _) = run("big", source, 30, &["main.order", "main.rd.szSize", "main.scans"], |_| {});
    assert_eq!(values, ["0", "600000", "7"]);
}

#[test]
fn paths_that_leave_the_folder_and_wrong_uses_end_in_their_errors() {
    let source = "
PROGRAM main
VAR
    up, away, link, none, made, mode, twice, empty : FILE.Open; wr : FILE.Write; rd : FILE.Read; de : FILE.Delete; re, over : FILE.Rename; x : DINT;
    denied, gone, param, exist, bad : BOOL;
END_VAR
up(xExecute := TRUE, sFileName := '../secret', eFileMode := FILE.MODE.MWRITE);
away(xExecute := TRUE, sFileName := '/etc/passwd', eFileMode := FILE.MODE.MREAD);
link(xExecute := TRUE, sFileName := 'out', eFileMode := FILE.MODE.MWRITE);
none(xExecute := TRUE, sFileName := 'none', eFileMode := FILE.MODE.MREAD);
mode(xExecute := TRUE, sFileName := 'a', eFileMode := 77);
empty(xExecute := TRUE, sFileName := '', eFileMode := FILE.MODE.MREAD);
made(xExecute := TRUE, sFileName := 'made', eFileMode := FILE.MODE.MWRITE);
IF made.xDone THEN
    rd(xExecute := TRUE, hFile := made.hFile, pBuffer := ADR(x), szBuffer := 4);
    re(xExecute := TRUE, sFileNameOld := 'made', sFileNameNew := 'old');
    over(xExecute := re.xError, sFileNameOld := 'made', sFileNameNew := 'fresh');
END_IF
wr(xExecute := TRUE, hFile := 16#1234, pBuffer := ADR(x), szSize := 4);
de(xExecute := TRUE, sFileName := '../secret');
denied := up.eError = FILE.ERROR.FILE_OPERATION_DENIED AND away.eError = FILE.ERROR.FILE_OPERATION_DENIED
    AND link.eError = FILE.ERROR.FILE_OPERATION_DENIED AND de.eError = FILE.ERROR.FILE_OPERATION_DENIED;
gone := none.eError = FILE.ERROR.NOT_EXIST;
param := mode.eError = FILE.ERROR.WRONG_PARAMETER AND rd.eError = FILE.ERROR.WRONG_PARAMETER AND empty.eError = FILE.ERROR.WRONG_PARAMETER;
exist := re.eError = FILE.ERROR.EXIST AND over.xDone;
bad := wr.eError = FILE.ERROR.HANDLE_INVALID AND wr.xError;
END_PROGRAM";
    let (values, project) = run("errors", source, 20, &["main.denied", "main.gone", "main.param", "main.exist", "main.bad"], |project| {
        std::fs::create_dir_all(project.0.join("data")).expect("data");
        std::fs::write(project.0.join("data/old"), "o").expect("a file");
        std::fs::write(project.0.join("secret"), "s").expect("a file");
        #[cfg(unix)]
        std::os::unix::fs::symlink("../secret", project.0.join("data/out")).expect("a link");
    });
    assert_eq!(values, ["TRUE"; 5]);
    assert_eq!(std::fs::read_to_string(project.0.join("secret")).expect("still there"), "s");
    assert_eq!(project.text("old"), "o");
}

#[test]
fn a_transfer_from_memory_that_is_not_the_programs_is_a_fault() {
    let source = "
PROGRAM main
VAR op : FILE.Open; wr : FILE.Write; END_VAR
op(xExecute := TRUE, sFileName := 'a', eFileMode := FILE.MODE.MWRITE);
IF op.xDone THEN wr(xExecute := TRUE, hFile := op.hFile, pBuffer := 16#FFFFFFFFFF, szSize := 4); END_IF
END_PROGRAM";
    let program = compiled(source);
    let project = Project::new("wild");
    let mut engine = started(&program, &project, ExecutorKind::Jit);
    for scan in 0..5 {
        engine.step(Time::from_millis(10 * scan));
    }
    assert_eq!(engine.fault().map(|f| f.fault.name()), Some("wild-pointer"));
}

#[test]
fn an_aborted_transfer_says_so_and_the_next_one_works() {
    let source = "
PROGRAM main
VAR op : FILE.Open; wr : FILE.Write; n : INT; aborted : BOOL; code : FILE.ERROR; x : DINT := 16#41424344; END_VAR
op(xExecute := TRUE, sFileName := 'a', eFileMode := FILE.MODE.MWRITE);
IF op.xDone THEN
    n := n + 1;
    IF n = 4 THEN x := 16#45464748; END_IF
    wr(xExecute := n <> 4, xAbort := n = 2, hFile := op.hFile, pBuffer := ADR(x), szSize := SEL(wr.xBusy, 4, 8));
    IF n = 2 THEN aborted := wr.xAborted AND NOT wr.xError; code := wr.eError; END_IF
END_IF
END_PROGRAM";
    let (values, project) = run("abort", source, 20, &["main.aborted", "main.code", "main.wr.xDone"], |_| {});
    assert_eq!(values, ["TRUE", "FILE_ERROR.ABORT", "TRUE"]);
    assert_eq!(project.text("a"), "HGFE");
}

const LINES: &str = "
PROGRAM main
VAR
    state : INT; h, bad : UINT; err, missing, outside : UDINT; op : FB_FileOpen; cl : FB_FileClose; put : FB_FilePuts; get : FB_FileGets; wr : FB_FileWrite;
    sk : FB_FileSeek; tl : FB_FileTell; ef : FB_EOF; rn : FB_FileRename; rm : FB_FileDelete; dir : FB_CreateDir;
    one, two, three : STRING; told, back : DINT; bytes : ARRAY[0..2] OF BYTE := [16#41, 16#42, 10]; ended : BOOL; lines : INT;
END_VAR
CASE state OF
0: dir(sPathName := 'logs', bExecute := TRUE); IF NOT dir.bBusy THEN state := 1; END_IF
1: op(sPathName := 'logs/a.txt', nMode := FOPEN_MODEWRITE OR FOPEN_MODEPLUS OR FOPEN_MODETEXT, bExecute := TRUE);
   IF NOT op.bBusy THEN h := op.hFile; err := op.nErrId; op(bExecute := FALSE); state := 2; END_IF
2: put(hFile := h, sLine := 'first$Nsecond$N', bExecute := TRUE); IF NOT put.bBusy THEN put(bExecute := FALSE); state := 3; END_IF
3: wr(hFile := h, pWriteBuff := ADR(bytes), cbWriteLen := 3, bExecute := TRUE); IF NOT wr.bBusy THEN state := 4; END_IF
4: tl(hFile := h, bExecute := TRUE); told := tl.nSeekPos; tl(bExecute := FALSE);
   sk(hFile := h, nSeekPos := -3, eOrigin := E_SeekOrigin.SEEK_END, bExecute := TRUE);
   IF NOT sk.bBusy THEN sk(bExecute := FALSE); tl(hFile := h, bExecute := TRUE); back := tl.nSeekPos; state := 5; END_IF
5: get(hFile := h, bExecute := TRUE); IF NOT get.bBusy THEN three := get.sLine; get(bExecute := FALSE); state := 6; END_IF
6: ef(hFile := h, bExecute := TRUE); IF NOT ef.bBusy THEN ended := ef.bEOF; ef(bExecute := FALSE); sk(hFile := h, nSeekPos := 0, eOrigin := E_SeekOrigin.SEEK_SET, bExecute := TRUE); state := 7; END_IF
7: get(hFile := h, bExecute := TRUE);
   IF NOT get.bBusy THEN IF lines = 0 THEN one := get.sLine; ELSIF lines = 1 THEN two := get.sLine; END_IF get(bExecute := FALSE); IF get.bEOF THEN state := 8; ELSE lines := lines + 1; END_IF END_IF
8: cl(hFile := h, bExecute := TRUE); cl(bExecute := FALSE); put(hFile := h, bExecute := TRUE); bad := UDINT_TO_UINT(put.nErrId); state := 9;
9: rn(sOldName := 'logs/a.txt', sNewName := 'logs/b.txt', bExecute := TRUE); IF NOT rn.bBusy THEN state := 10; END_IF
10: rm(sPathName := 'logs/a.txt', bExecute := TRUE); IF NOT rm.bBusy THEN missing := rm.nErrId; rm(bExecute := FALSE); state := 11; END_IF
11: op(sPathName := 'C:/x.txt', nMode := FOPEN_MODEREAD, bExecute := TRUE); IF NOT op.bBusy THEN outside := op.nErrId; state := 12; END_IF
END_CASE
END_PROGRAM";

#[test]
fn the_blocks_of_twincat_work_on_the_same_files() {
    let paths = [
        "main.state",
        "main.err",
        "main.told",
        "main.back",
        "main.one",
        "main.two",
        "main.three",
        "main.ended",
        "main.lines",
        "main.bad",
        "main.missing",
    ];
    let (values, project) = run("twincat", LINES, 60, &paths, |_| {});
    assert_eq!(values, ["12", "0", "16", "13", "'first$N'", "'second$N'", "'AB$N'", "TRUE", "3", "1803", "1804"]);
    assert_eq!(project.text("logs/b.txt"), "first\nsecond\nAB\n");
    let (values, _) = run("twincat-outside", LINES, 60, &["main.outside"], |_| {});
    assert_ne!(values, ["0"], "an absolute path is refused");
}
