//! `takt ctl`: looks at a machine that runs, and changes what it does, through its control socket.

mod show;

use super::{Exit, Where, log};
use crate::console;
use crate::control::{
    self,
    connect::{Client, ClientError},
};
use crate::language::{self, Word};
use clap::{Args, Subcommand, ValueEnum};
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;
use takt_abi::Time;

/// A lease of `--hold`, and how often it is renewed.
const LEASE_MS: u64 = 1500;
const RENEWAL: Duration = Duration::from_millis(400);

/// What `takt ctl` is told.
#[derive(Debug, Clone, Args)]
pub(super) struct CtlArgs {
    #[command(flatten)]
    machine: Where,
    /// The socket itself, if it is elsewhere.
    #[arg(long, value_name = "SOCKET", global = true)]
    socket: Option<PathBuf>,
    /// One JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Who changes something, for the journal. Default: $TAKT_AS, else the user.
    #[arg(long = "as", value_name = "NAME", global = true)]
    name: Option<String>,
    /// Why, for the journal; needed to change something. Default: $TAKT_REASON.
    #[arg(long, value_name = "TEXT", global = true)]
    reason: Option<String>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Clone, Subcommand)]
enum Verb {
    /// State, fault, tasks and forces.
    Status,
    /// The tasks and their statistics.
    Tasks,
    /// The forced variables: values, who and why.
    Forces,
    /// Values of variables, all of the same scan.
    Read {
        #[arg(required = true, value_name = "VAR")]
        variables: Vec<String>,
    },
    /// Writes variables once, all between the same two scans.
    Write(Changed),
    /// Holds variables at values, until they are released.
    Force(Changed),
    /// Lets forced variables go.
    Release {
        #[arg(value_name = "VAR", required_unless_present = "all")]
        variables: Vec<String>,
        /// All of them.
        #[arg(long, conflicts_with = "variables")]
        all: bool,
        /// Puts back what they were before they were forced.
        #[arg(long)]
        restore: bool,
    },
    /// Shows values again and again.
    Watch {
        #[arg(required = true, value_name = "VAR")]
        variables: Vec<String>,
        /// How often.
        #[arg(long, value_name = "TIME", default_value = "200ms", value_parser = super::duration, conflicts_with = "scans")]
        period: Time,
        /// After every so many scans instead.
        #[arg(long, value_name = "N")]
        scans: Option<u64>,
        /// Ends after so many lines.
        #[arg(long, value_name = "N")]
        count: Option<u64>,
    },
    /// Clears a fault and starts the program anew.
    Reset {
        #[arg(value_name = "KIND", default_value = "warm")]
        kind: ResetKind,
    },
    /// Lets an isolated task go on that a fault has stopped alone.
    ResetTask {
        #[arg(value_name = "TASK")]
        task: String,
    },
    /// Starts the statistics of the tasks anew.
    ResetStatistics,
    /// Stands still between two scans.
    Pause,
    /// Goes on after a pause.
    Continue,
    /// So many scans, then stands still again.
    Step {
        #[arg(value_name = "N", default_value_t = 1)]
        scans: u64,
    },
    /// Stops the program, as a fault does; the machine waits for a reset.
    Halt,
    /// Ends the run.
    Stop,
}

#[derive(Debug, Clone, Args)]
struct Changed {
    #[arg(required = true, value_name = "VAR=VALUE", value_parser = super::assignment)]
    variables: Vec<(String, String)>,
    /// Only as long as this command runs (Ctrl-C ends it); then everything is as before.
    #[arg(long)]
    hold: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ResetKind {
    /// Retained and persistent variables keep their values.
    Warm,
    /// Persistent variables keep their values.
    Cold,
    /// No variable does.
    Origin,
}

impl Verb {
    /// The request, what goes with it, and whether it changes something.
    fn request(&self) -> (&'static str, Value, bool) {
        match self {
            Self::Status => ("status", json!({}), false),
            Self::Tasks => ("tasks", json!({}), false),
            Self::Forces => ("forces", json!({}), false),
            Self::Read { variables } => ("read", json!({ "variables": variables }), false),
            Self::Write(changed) => ("write", changed.arguments(), true),
            Self::Force(changed) => ("force", changed.arguments(), true),
            Self::Release { all: true, restore, .. } => ("release-all", json!({ "restore": restore }), true),
            Self::Release { variables, restore, .. } => ("release", json!({ "variables": variables, "restore": restore }), true),
            Self::Watch { variables, period, scans, .. } => {
                let rhythm = scans.map_or_else(|| json!({ "period_ms": period.0 / 1_000_000 }), |scans| json!({ "scans": scans }));
                let mut arguments = rhythm;
                arguments["variables"] = json!(variables);
                ("subscribe", arguments, false)
            }
            Self::Reset { kind } => ("reset", json!({ "kind": format!("{kind:?}").to_lowercase() }), true),
            Self::ResetTask { task } => ("reset-task", json!({ "task": task }), true),
            Self::ResetStatistics => ("reset-statistics", json!({}), true),
            Self::Pause => ("pause", json!({}), true),
            Self::Continue => ("continue", json!({}), true),
            Self::Step { scans } => ("step", json!({ "scans": scans }), true),
            Self::Halt => ("halt", json!({}), true),
            Self::Stop => ("stop", json!({}), true),
        }
    }
}

impl Changed {
    fn arguments(&self) -> Value {
        let list: Vec<Value> = self.variables.iter().map(|(name, value)| json!({ "variable": name, "literal": value })).collect();
        let mut arguments = json!({ "variables": list });
        if self.hold {
            arguments["lease_ms"] = LEASE_MS.into();
        }
        arguments
    }
}

pub(super) fn execute(args: &CtlArgs) -> Exit {
    match talk(args) {
        Ok(exit) | Err(exit) => exit,
    }
}

fn refuse(error: &ClientError) -> Exit {
    console::tell(format_args!("{}: {error}", Word::Error.text(language::of_environment())));
    match error {
        ClientError::Broken(_) | ClientError::Nonsense(_) => Exit::Findings,
        ClientError::NoMachine(..) | ClientError::Refused { .. } => Exit::Usage,
    }
}

/// Connects to the machine that is meant.
pub(super) fn connect(machine: &Where, socket: Option<&PathBuf>) -> Result<Client, Exit> {
    let path = match socket {
        Some(path) => path.clone(),
        None => log::folder(machine)?.join(control::NAME),
    };
    Client::connect(&path).map_err(|error| refuse(&error))
}

/// Who changes something and why, or what is missing.
pub(super) fn who(name: Option<&String>, reason: Option<&String>) -> Result<(String, String), Exit> {
    let from = |given: Option<&String>, variables: &[&str]| {
        let set = |name: &&str| std::env::var(name).ok().filter(|value| !value.trim().is_empty());
        given.cloned().or_else(|| variables.iter().find_map(set))
    };
    let language = language::of_environment();
    let Some(reason) = from(reason, &["TAKT_REASON"]) else {
        console::tell(format_args!("{}: {}", Word::Error.text(language), Word::ReasonNeeded.text(language)));
        return Err(Exit::Usage);
    };
    Ok((from(name, &["TAKT_AS", "USER", "LOGNAME"]).unwrap_or_else(|| "unknown".into()), reason))
}

/// Arms a connection.
pub(super) fn arm(client: &mut Client, name: Option<&String>, reason: Option<&String>) -> Result<(), Exit> {
    let (name, reason) = who(name, reason)?;
    client.ask("arm", json!({ "name": name, "reason": reason })).map_err(|error| refuse(&error)).map(|_| ())
}

fn talk(args: &CtlArgs) -> Result<Exit, Exit> {
    let (request, arguments, changes) = args.verb.request();
    let mut client = connect(&args.machine, args.socket.as_ref())?;
    if changes {
        arm(&mut client, args.name.as_ref(), args.reason.as_ref())?;
    }
    let result = client.ask(request, arguments).map_err(|error| refuse(&error))?;
    if let Verb::Watch { variables, count, .. } = &args.verb {
        return watch(&mut client, variables, *count, args.json);
    }
    if args.json {
        console::result(&result);
    } else {
        show::result(&args.verb, &client.about, &result);
    }
    if let Verb::Write(Changed { hold: true, .. }) | Verb::Force(Changed { hold: true, .. }) = &args.verb {
        console::tell(Word::HeldUntil.text(language::of_environment()));
        // Ctrl-C ends this process, and with it the connection; the machine sees that and lets go.
        loop {
            std::thread::sleep(RENEWAL);
            client.ask("renew", json!({})).map_err(|error| refuse(&error))?;
        }
    }
    let faulted = matches!(args.verb, Verb::Status) && !result["fault"].is_null();
    Ok(if faulted { Exit::Findings } else { Exit::Good })
}

/// Shows values as they come, until the machine or the reader goes away.
fn watch(client: &mut Client, variables: &[String], count: Option<u64>, json: bool) -> Result<Exit, Exit> {
    client.patience(None).map_err(|error| refuse(&error))?;
    let mut shown = 0;
    while count.is_none_or(|count| shown < count) {
        let line = match client.line() {
            Ok(line) => line,
            Err(error) => return Err(refuse(&error)),
        };
        let mut out = anstream::stdout().lock();
        let written = if json { writeln!(out, "{line}") } else { writeln!(out, "{}", show::values(&line, variables)) };
        if written.and_then(|()| out.flush()).is_err() {
            break;
        }
        shown += 1;
    }
    Ok(Exit::Good)
}
