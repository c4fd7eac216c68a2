//! The command line (DESIGN §9): one file per command.

mod backup;
mod check;
mod core;
mod ctl;
mod doctor;
mod explain;
mod import;
mod keep;
mod live;
mod log;
mod outputs;
mod param;
mod replay;
mod retain;
mod run;
mod said;
mod service;
mod summary;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use takt_abi::Time;

/// How a command ended; the exit code of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Good.
    Good = 0,
    /// Findings, a failed test or a fault.
    Findings = 1,
    /// Wrong usage, missing file, bad manifest.
    Usage = 2,
}

/// Takt: an IEC 61131-3 Structured Text runtime for machines that move.
#[derive(Debug, Parser)]
#[command(name = "takt", version, long_about = None)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs a program or a project.
    Run(Box<RunArgs>),
    /// Shows what happened when a program faulted, from a core file.
    Core(CoreArgs),
    /// Runs a recording again, bit for bit.
    Replay(ReplayArgs),
    /// Finds the mistakes in a program or a project.
    Check(CheckArgs),
    /// Makes a project of TwinCAT's files, PLCopen XML or ST.
    Import(ImportArgs),
    /// Looks at a machine that runs, and changes what it does.
    Ctl(ctl::CtlArgs),
    /// Shows the journal: what happened on a machine, and who did it.
    Log(LogArgs),
    /// Examines the computer: what it offers a machine, what is missing, how to get it.
    Doctor(DoctorArgs),
    /// Lets a project start with the computer, as a systemd service.
    Service(ServiceArgs),
    /// Shows, sets, saves and compares the parameters of a machine: its PERSISTENT variables.
    Param(param::ParamArgs),
    /// Saves a project with what its machine keeps between runs.
    Backup(BackupArgs),
    /// Brings a backup back.
    Restore(RestoreArgs),
    /// Shows, exports or imports the retained values of a machine that is not running.
    Retain {
        #[command(subcommand)]
        command: RetainCommand,
    },
    /// Explains a code like E0301.
    Explain(ExplainArgs),
}

/// What `takt run` is told.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// A project folder (with takt.toml) or source files; several are one program.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Ends after so many scans of the fastest task.
    #[arg(long, value_name = "N")]
    pub cycles: Option<u64>,
    /// Ends after so much machine time: 500ms, 10s, 1m30s.
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    pub duration: Option<Time>,
    /// Ends when an ST condition becomes TRUE.
    #[arg(long, value_name = "EXPR")]
    pub until: Option<String>,
    /// real, max, or a factor of real time. Default: real, but max with --cycles, --for, --until and for a demonstration.
    #[arg(long, value_name = "SPEED", value_parser = speed)]
    pub speed: Option<Speed>,
    /// What runs the program.
    #[arg(long, value_name = "ENGINE", default_value = "jit")]
    pub engine: EngineKind,
    /// Writes a variable once, before the first scan.
    #[arg(long, value_name = "VAR=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    /// Shows a variable after the last scan.
    #[arg(long, value_name = "VAR")]
    pub print: Vec<String>,
    /// Writes the recorded variables to a CSV file, one line per scan.
    #[arg(long, value_name = "FILE", requires = "record")]
    pub trace: Option<PathBuf>,
    /// Variables of the trace.
    #[arg(long, value_name = "VAR,…", value_delimiter = ',', requires = "trace")]
    pub record: Vec<String>,
    /// Where the machine keeps its state. Default: .takt in the project's folder, in real time only.
    #[arg(long, value_name = "DIR")]
    pub state: Option<PathBuf>,
    /// Serves `takt ctl` at this socket. Default: in the state folder, in real time only.
    #[arg(long, value_name = "SOCKET")]
    pub control: Option<PathBuf>,
    /// Starts RETAIN variables with their initial values; PERSISTENT ones keep theirs.
    #[arg(long, conflicts_with = "origin")]
    pub cold: bool,
    /// Starts all variables with their initial values.
    #[arg(long)]
    pub origin: bool,
    /// Writes the statistics of the tasks at the end.
    #[arg(long, value_name = "FILE.json|csv")]
    pub stats: Option<PathBuf>,
    /// Records everything that decides the run besides the program, for `takt replay`.
    #[arg(long, value_name = "FILE")]
    pub record_inputs: Option<PathBuf>,
    /// One JSON object on standard output.
    #[arg(long)]
    pub json: bool,
    /// Draws the run: path, tool axes, speed, valve.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
struct CoreArgs {
    /// A core file, or a folder of them to be listed (.takt/cores of a project).
    file: PathBuf,
    /// Shows a variable as it was at the fault, and nothing else.
    #[arg(long, value_name = "VAR")]
    print: Vec<String>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// What `takt replay` is told.
#[derive(Debug, Clone, Args)]
struct ReplayArgs {
    /// What `takt run --record-inputs` wrote.
    file: PathBuf,
    /// The program it was recorded with. Default: the project in this folder.
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Ends at this scan of the fastest task.
    #[arg(long, value_name = "CYCLE")]
    to: Option<u64>,
    /// Ends when an ST condition becomes TRUE.
    #[arg(long, value_name = "EXPR")]
    until: Option<String>,
    /// Then goes back by so many scans.
    #[arg(long, value_name = "N")]
    back: Option<u64>,
    /// Shows a variable at the end.
    #[arg(long, value_name = "VAR")]
    print: Vec<String>,
    /// Writes variables to a CSV file, one line per scan.
    #[arg(long, value_name = "FILE", requires = "record")]
    trace: Option<PathBuf>,
    /// Variables of the trace.
    #[arg(long, value_name = "VAR,…", value_delimiter = ',', requires = "trace")]
    record: Vec<String>,
    /// What runs the program.
    #[arg(long, value_name = "ENGINE", default_value = "jit")]
    engine: EngineKind,
    /// Shows a hash of all variables and resources at every Nth scan.
    #[arg(long, value_name = "N")]
    hash: Option<u64>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Args)]
struct CheckArgs {
    /// A project folder (with takt.toml) or source files; several are one program.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// How findings are shown.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    format: Format,
}

#[derive(Debug, Clone, Args)]
struct ImportArgs {
    /// A folder with a .plcproj, or files: .TcPOU, .TcDUT, .TcGVL, .TcIO, .TcTTO, .plcproj, PLCopen .xml, .st.
    #[arg(required = true, value_name = "SRC")]
    paths: Vec<PathBuf>,
    /// The folder of the new project; it must not exist.
    #[arg(long, value_name = "FOLDER")]
    to: PathBuf,
    /// Name of the project. Default: the name of the folder.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Subcommand)]
enum RetainCommand {
    /// Shows the stored values.
    Show(RetainArgs),
    /// Writes the stored values as JSON to a file, or to standard output.
    Export(RetainArgs),
    /// Stores the values of such a file for the next start: all of them, or none if one does not fit.
    Import(RetainArgs),
}

#[derive(Debug, Clone, Args)]
struct RetainArgs {
    /// A project folder (with takt.toml) or a source file.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The file with the values.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// Where the machine keeps its state. Default: .takt in the project's folder.
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
}

/// Which machine is meant.
#[derive(Debug, Clone, Args)]
struct Where {
    /// The project's folder, or its source file. Default: the folder one is in.
    #[arg(value_name = "PATH", default_value = ".")]
    path: PathBuf,
    /// The state folder, if the run has one of its own.
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
struct BackupArgs {
    /// The project's folder.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The state folder, if the run has one of its own.
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
    /// The file: .tar.gz.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Writes over a file that is there.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Args)]
struct RestoreArgs {
    /// The file: .tar.gz.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The folder: a new or empty one.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Writes over what is there.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Args)]
struct LogArgs {
    #[command(flatten)]
    machine: Where,
    /// Goes on with what is written while it looks.
    #[arg(short, long)]
    follow: bool,
    /// How many lines; 0 for all that are kept.
    #[arg(short = 'n', long, value_name = "N", default_value_t = 100)]
    lines: usize,
    /// The lines as they are: one JSON object each.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Args)]
struct DoctorArgs {
    /// A project folder: its [realtime] and its state folder are looked at too.
    #[arg(value_name = "PATH")]
    path: Option<PathBuf>,
    /// The state folder, if it is not the project's own.
    #[arg(long, value_name = "DIR", requires = "path")]
    state: Option<PathBuf>,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
    /// Examines the files of a computer below this folder: proc, sys, dev.
    #[arg(long, value_name = "DIR", default_value = "/", hide = true)]
    root: PathBuf,
}

/// What is to be done with a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ServiceAction {
    /// Writes the unit and lets it start with the computer.
    Install,
    /// Stops it and takes the unit away.
    Uninstall,
    /// Says whether it runs.
    Status,
    /// Prints the unit.
    Show,
}

#[derive(Debug, Clone, Args)]
struct ServiceArgs {
    /// What is to be done.
    #[arg(value_name = "ACTION")]
    action: ServiceAction,
    /// A project folder (with takt.toml) or a source file.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// Who it runs as. Default: who asks.
    #[arg(long, value_name = "NAME")]
    user: Option<String>,
    /// Name of the service. Default: takt- and the name of the project.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// The state folder, if it is not the project's own.
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
    /// Says what would be done.
    #[arg(long)]
    dry_run: bool,
    /// The computer's files lie below this folder.
    #[arg(long, value_name = "DIR", default_value = "/", hide = true)]
    root: PathBuf,
}

impl ServiceArgs {
    fn is_this_computer(&self) -> bool {
        self.root == std::path::Path::new("/")
    }
}

#[derive(Debug, Clone, Args)]
struct ExplainArgs {
    /// E0301, W0301, …; without one all codes are listed.
    code: Option<String>,
}

/// What runs a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EngineKind {
    /// Machine code.
    Jit,
    /// Machine code without the newer instructions of the processor.
    Portable,
    /// The reference interpreter.
    Interp,
}

impl From<EngineKind> for takt_engine::ExecutorKind {
    fn from(kind: EngineKind) -> Self {
        match kind {
            EngineKind::Jit => Self::Jit,
            EngineKind::Portable => Self::Portable,
            EngineKind::Interp => Self::Interpreter,
        }
    }
}

/// How findings are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people, on standard error.
    Text,
    /// One object per line, on standard output.
    Json,
}

/// How fast machine time passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// As fast as the processor can.
    Max,
    /// So many times real time.
    Factor(f64),
}

fn speed(text: &str) -> Result<Speed, String> {
    match text {
        "max" => Ok(Speed::Max),
        "real" => Ok(Speed::Factor(1.0)),
        _ => match text.parse() {
            Ok(factor) if (0.001..=1000.0).contains(&factor) => Ok(Speed::Factor(factor)),
            _ => Err("expected real, max, or a factor from 0.001 to 1000".into()),
        },
    }
}

fn duration(text: &str) -> Result<Time, String> {
    crate::manifest::parse_duration(text).ok_or_else(|| "expected a number and a unit, like 500ms, 10s or 1m30s".into())
}

fn assignment(text: &str) -> Result<(String, String), String> {
    let (variable, value) = text.split_once('=').ok_or("expected VAR=VALUE, like GVL.Speed=12.5")?;
    Ok((variable.trim().trim_end_matches(':').trim_end().into(), value.trim().into()))
}

/// Runs a command.
pub fn execute(cli: Cli) -> Exit {
    match cli.command {
        Command::Run(args) => run::execute(&args),
        Command::Core(args) => core::execute(&args),
        Command::Replay(args) => replay::execute(&args),
        Command::Check(args) => check::execute(&args.paths, args.format),
        Command::Import(args) => import::execute(&args),
        Command::Ctl(args) => ctl::execute(&args),
        Command::Log(args) => log::execute(&args),
        Command::Doctor(args) => doctor::execute(&args),
        Command::Service(args) => service::execute(&args),
        Command::Param(args) => param::execute(&args),
        Command::Backup(args) => backup::save(&args),
        Command::Restore(args) => backup::restore(&args),
        Command::Retain { command } => retain::execute(&command),
        Command::Explain(args) => explain::execute(args.code.as_deref()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(arguments: &[&str]) -> Result<RunArgs, clap::Error> {
        let cli = Cli::try_parse_from(["takt", "run"].iter().chain(arguments))?;
        match cli.command {
            Command::Run(args) => Ok(*args),
            other => panic!("not a run: {other:?}"),
        }
    }

    #[test]
    fn the_contract_of_run_is_understood() {
        let args =
            run(&["p", "--cycles", "10", "--for", "1m30s", "--until", "a > 1", "--set", "G.x := 3", "--set", "s='a=b'", "--print", "G.x"])
                .unwrap();
        assert_eq!((args.cycles, args.duration), (Some(10), Some(Time::from_millis(90_000))));
        assert_eq!(args.set, [("G.x".to_string(), "3".to_string()), ("s".to_string(), "'a=b'".to_string())]);
        assert_eq!(args.engine, EngineKind::Jit);
        let args = run(&["p", "q", "--speed", "2.5", "--trace", "t.csv", "--record", "a,b", "--json", "--engine", "interp"]).unwrap();
        assert_eq!((args.speed, args.record.len(), args.paths.len()), (Some(Speed::Factor(2.5)), 2, 2));
    }

    #[test]
    fn wrong_usage_is_refused_with_code_2() {
        let wrong: [&[&str]; 8] = [
            &[],
            &["p", "--cycles", "-1"],
            &["p", "--for", "10"],
            &["p", "--speed", "fast"],
            &["p", "--speed", "0"],
            &["p", "--set", "x"],
            &["p", "--trace", "t.csv"],
            &["p", "--engine", "vm"],
        ];
        for arguments in wrong {
            assert_eq!(run(arguments).expect_err("wrong").exit_code(), 2, "{arguments:?}");
        }
    }
}
