//! `takt service`: the machine's program starts with the computer.

use super::{Exit, Format, ServiceAction, ServiceArgs, check};
use crate::console;
use crate::language::{self, Word};
use crate::project::{self, Project};
use crate::unit::{self, MARK, Unit};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where units are.
const UNITS: &str = "etc/systemd/system";

pub(super) fn execute(args: &ServiceArgs) -> Exit {
    let result = match args.action {
        ServiceAction::Show => show(args),
        ServiceAction::Install => install(args),
        ServiceAction::Uninstall => uninstall(args),
        ServiceAction::Status => status(args),
    };
    match result {
        Ok(exit) | Err(exit) => exit,
    }
}

fn refuse(message: impl std::fmt::Display) -> Exit {
    console::tell(format_args!("{}: {message}", Word::Error.text(language::of_environment())));
    Exit::Usage
}

fn load(args: &ServiceArgs) -> Result<Project, Exit> {
    project::load(&args.path).map_err(|error| check::refuse(&error, Format::Text))
}

fn name(args: &ServiceArgs, project: &Project) -> Result<String, Exit> {
    let name = args.name.clone().unwrap_or_else(|| unit::name_of(&project.name));
    unit::check_name(&name).map_err(refuse)?;
    Ok(name)
}

fn absolute(path: &Path) -> Result<PathBuf, Exit> {
    path.canonicalize().map_err(|error| refuse(format_args!("{}: {error}", path.display())))
}

fn text(args: &ServiceArgs, project: &Project) -> Result<String, Exit> {
    let user = args.user.clone().or_else(|| std::env::var("SUDO_USER").ok().filter(|user| !user.is_empty()));
    let user = user.or_else(|| std::env::var("USER").ok()).unwrap_or_else(|| "root".into());
    let program = std::env::current_exe().map_err(|error| refuse(format_args!("the path of takt: {error}")))?;
    let state = args.state.as_deref().map(std::path::absolute).transpose().map_err(refuse)?;
    let unit = Unit {
        description: &project.name,
        program: &program,
        project: &absolute(&args.path)?,
        folder: &absolute(&project.root)?,
        state: state.as_deref(),
        user: &user,
    };
    check_account(args, &user)?;
    unit.text().map_err(refuse)
}

/// The user must exist, or the service never starts.
fn check_account(args: &ServiceArgs, user: &str) -> Result<(), Exit> {
    unit::check_user(user).map_err(refuse)?;
    // A computer with accounts elsewhere (LDAP) knows users that the file does not: then `id` does.
    let passwd = std::fs::read_to_string(args.root.join("etc/passwd")).unwrap_or_default();
    let known = passwd.lines().any(|line| line.split(':').next() == Some(user));
    let asked = || Command::new("id").arg("--").arg(user).output().is_ok_and(|output| output.status.success());
    if known || asked() {
        return Ok(());
    }
    Err(refuse(format_args!("there is no user `{user}`; make it with `sudo useradd --system {user}`, or name another one with `--user`")))
}

fn show(args: &ServiceArgs) -> Result<Exit, Exit> {
    let project = load(args)?;
    console::result(text(args, &project)?.trim_end());
    Ok(Exit::Good)
}

fn install(args: &ServiceArgs) -> Result<Exit, Exit> {
    let project = load(args)?;
    let compiled = crate::program::compile(&project, &[]);
    if compiled.program.is_none() {
        check::tell(&compiled);
        let (errors, warnings) = compiled.counts();
        check::summarise(errors, warnings);
        return Err(Exit::Findings);
    }
    let (name, text) = (name(args, &project)?, text(args, &project)?);
    let file = args.root.join(UNITS).join(format!("{name}.service"));
    check_ours(&file)?;
    if args.dry_run {
        console::result(format_args!("# {}", file.display()));
        console::result(text.trim_end());
        console::result(format_args!("# systemctl daemon-reload\n# systemctl enable {name}"));
        return Ok(Exit::Good);
    }
    write(&file, &text)
        .map_err(|error| refuse(format_args!("{}: {error}; {}", file.display(), Word::NeedsRoot.text(language::of_environment()))))?;
    if args.is_this_computer() {
        systemctl(&["daemon-reload"])?;
        systemctl(&["enable", &name])?;
    }
    let language = language::of_environment();
    console::tell(format_args!("{}: {}", Word::ServiceInstalled.text(language), file.display()));
    console::tell(format_args!("  systemctl start {name}\n  systemctl status {name}\n  journalctl -u {name} -f"));
    Ok(Exit::Good)
}

/// Under a name of its own first, so that a power cut leaves the old unit or the new one.
fn write(file: &Path, text: &str) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let new = file.with_extension("service.new");
    let mut out = std::fs::File::create(&new)?;
    out.write_all(text.as_bytes())?;
    out.sync_all()?;
    std::fs::rename(&new, file)?;
    std::fs::File::open(folder)?.sync_all()
}

/// A unit of that name that somebody else has written is left alone.
fn check_ours(file: &Path) -> Result<bool, Exit> {
    match std::fs::read_to_string(file) {
        Ok(text) if text.starts_with(MARK) => Ok(true),
        Ok(_) => {
            Err(refuse(format_args!("{} was not made by `takt service`; give the service another name with `--name`", file.display())))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(refuse(format_args!("{}: {error}", file.display()))),
    }
}

fn uninstall(args: &ServiceArgs) -> Result<Exit, Exit> {
    let name = name(args, &load(args)?)?;
    let file = args.root.join(UNITS).join(format!("{name}.service"));
    if !check_ours(&file)? {
        return Err(refuse(format_args!("there is no service `{name}`: {} does not exist", file.display())));
    }
    if args.dry_run {
        console::result(format_args!("# systemctl disable --now {name}\n# rm {}\n# systemctl daemon-reload", file.display()));
        return Ok(Exit::Good);
    }
    if args.is_this_computer() {
        systemctl(&["disable", "--now", &name])?;
    }
    std::fs::remove_file(&file)
        .map_err(|error| refuse(format_args!("{}: {error}; {}", file.display(), Word::NeedsRoot.text(language::of_environment()))))?;
    if args.is_this_computer() {
        systemctl(&["daemon-reload"])?;
    }
    console::tell(format_args!("{}: {}", Word::ServiceUninstalled.text(language::of_environment()), file.display()));
    Ok(Exit::Good)
}

fn status(args: &ServiceArgs) -> Result<Exit, Exit> {
    let name = name(args, &load(args)?)?;
    let file = args.root.join(UNITS).join(format!("{name}.service"));
    if !check_ours(&file)? {
        console::result(format_args!("{name}: {}", Word::NotInstalled.text(language::of_environment())));
        return Ok(Exit::Findings);
    }
    let ask = |question: &str| {
        let output = Command::new("systemctl").arg(question).arg(&name).output();
        output.map_or_else(|_| "?".to_string(), |output| String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    let (active, enabled) = if args.is_this_computer() { (ask("is-active"), ask("is-enabled")) } else { ("?".into(), "?".into()) };
    console::result(format_args!("{name}: {active}, {enabled} ({})", file.display()));
    Ok(if active == "active" { Exit::Good } else { Exit::Findings })
}

fn systemctl(arguments: &[&str]) -> Result<(), Exit> {
    let said = match Command::new("systemctl").args(arguments).output() {
        Ok(output) if output.status.success() => return Ok(()),
        Ok(output) => String::from_utf8_lossy(&output.stderr).trim().to_string(),
        Err(error) => error.to_string(),
    };
    Err(refuse(format_args!("systemctl {}: {said}", arguments.join(" "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(root: &Path, action: ServiceAction) -> ServiceArgs {
        ServiceArgs {
            action,
            path: root.join("cell"),
            user: Some("plant".into()),
            name: None,
            state: None,
            dry_run: false,
            root: root.into(),
        }
    }

    #[test]
    fn a_service_is_installed_shown_and_taken_away_and_others_are_left_alone() {
        let root = std::env::temp_dir().join(format!("takt-service-{}", std::process::id()));
        std::fs::create_dir_all(root.join(UNITS)).unwrap();
        std::fs::create_dir_all(root.join("cell/src")).unwrap();
        std::fs::write(root.join("etc/passwd"), "root:x:0:0::/:/bin/sh\nplant:x:100:100::/:/bin/sh\n").unwrap();
        std::fs::write(root.join("cell/takt.toml"), "[project]\nname = \"Cell 3\"\n").unwrap();
        let program = |text: &str| std::fs::write(root.join("cell/src/main.st"), text).unwrap();
        let file = root.join(UNITS).join("takt-Cell-3.service");

        program("PROGRAM p x := 1; END_PROGRAM");
        assert_eq!(execute(&args(&root, ServiceAction::Install)), Exit::Findings, "a program with errors is no boot application");
        assert!(!file.exists());
        program("PROGRAM p VAR x : INT; END_VAR x := 1; END_PROGRAM");
        assert_eq!(execute(&ServiceArgs { dry_run: true, ..args(&root, ServiceAction::Install) }), Exit::Good);
        assert!(!file.exists(), "a dry run changes nothing");
        assert_eq!(execute(&ServiceArgs { user: Some("nobody-of-that-name".into()), ..args(&root, ServiceAction::Install) }), Exit::Usage);
        assert_eq!(execute(&args(&root, ServiceAction::Status)), Exit::Findings);
        for _ in 0..2 {
            assert_eq!(execute(&args(&root, ServiceAction::Install)), Exit::Good);
        }
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with(MARK) && text.contains("User=plant\n") && text.contains("/cell\" --speed real"), "{text}");
        assert_eq!(execute(&args(&root, ServiceAction::Show)), Exit::Good);
        assert_eq!(execute(&args(&root, ServiceAction::Uninstall)), Exit::Good);
        assert_eq!((file.exists(), execute(&args(&root, ServiceAction::Uninstall))), (false, Exit::Usage));

        std::fs::write(&file, "[Service]\nExecStart=/bin/true\n").unwrap();
        assert_eq!(execute(&args(&root, ServiceAction::Install)), Exit::Usage);
        assert_eq!(execute(&args(&root, ServiceAction::Uninstall)), Exit::Usage);
        assert!(file.exists());
        std::fs::remove_dir_all(root).unwrap();
    }
}
