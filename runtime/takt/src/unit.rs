//! The systemd unit of a machine: text only. `takt service` puts it where it belongs.

use std::path::Path;

/// First line of a unit that `takt service` has written; it never touches another one.
pub const MARK: &str = "# Made by `takt service install`; `takt service uninstall` takes it away.";

/// What a unit says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit<'a> {
    /// For people.
    pub description: &'a str,
    /// The program `takt`, absolute.
    pub program: &'a Path,
    /// The project folder or file, absolute.
    pub project: &'a Path,
    /// Working directory, absolute.
    pub folder: &'a Path,
    /// State folder, absolute, if it is not the project's own.
    pub state: Option<&'a Path>,
    /// Who it runs as.
    pub user: &'a str,
}

/// Why a unit cannot be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnitError {
    /// A path that a unit cannot hold.
    Path(String),
    /// A name that no unit can have.
    Name(String),
    /// A name that no user can have.
    User(String),
}

impl std::fmt::Display for UnitError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Path(path) => write!(f, "the path {path:?} has a control character or is not UTF-8; move the project to another one"),
            Self::Name(name) => {
                write!(
                    f,
                    "{name:?} is no name of a service: expected letters, digits and - _ . : (200 at the most); give one with `--name`"
                )
            }
            Self::User(user) => write!(f, "{user:?} is no name of a user: expected letters, digits, - and _ (32 at the most)"),
        }
    }
}
impl std::error::Error for UnitError {}

/// A word of a unit file: quoted, with what systemd would expand taken literally.
fn word(path: &Path, command: bool) -> Result<String, UnitError> {
    let text = path.to_str().filter(|text| !text.chars().any(char::is_control));
    let text = text.ok_or_else(|| UnitError::Path(path.display().to_string()))?;
    let literal = text.replace('\\', "\\\\").replace('"', "\\\"").replace('%', "%%");
    Ok(format!("\"{}\"", if command { literal.replace('$', "$$") } else { literal }))
}

/// A path as the whole value of a setting, which is not unquoted.
fn value(path: &Path) -> Result<String, UnitError> {
    word(path, false)?;
    Ok(path.to_string_lossy().replace('%', "%%"))
}

/// Whether a service can have that name.
pub fn check_name(name: &str) -> Result<(), UnitError> {
    let good = |c: char| c.is_ascii_alphanumeric() || "-_.:".contains(c);
    let starts = name.starts_with(|c: char| c.is_ascii_alphanumeric());
    if starts && name.len() <= 200 && name.chars().all(good) { Ok(()) } else { Err(UnitError::Name(name.into())) }
}

/// Whether a user can have that name.
pub fn check_user(user: &str) -> Result<(), UnitError> {
    let starts = user.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let good = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if starts && user.len() <= 32 && user.chars().all(good) { Ok(()) } else { Err(UnitError::User(user.into())) }
}

/// The name of the service of a project: `takt-` and the project's name, with what a name cannot hold left out.
pub fn name_of(project: &str) -> String {
    let good: String = project.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' }).take(100).collect();
    format!("takt-{}", good.trim_matches('-'))
}

impl Unit<'_> {
    /// The file.
    pub fn text(&self) -> Result<String, UnitError> {
        check_user(self.user)?;
        let Self { user, .. } = self;
        let description: String = self.description.chars().filter(|c| !c.is_control()).collect::<String>().replace('%', "%%");
        let state = self.state.map_or(Ok(String::new()), |state| word(state, true).map(|state| format!(" --state {state}")))?;
        Ok(format!(
            "{MARK}
[Unit]
Description=Takt: {description}
After=local-fs.target network.target
StartLimitIntervalSec=60
StartLimitBurst=3

[Service]
Type=exec
User={user}
WorkingDirectory={folder}
# Processors are kept awake through this file; `+` does it with the rights of the system.
ExecStartPre=+-/bin/chown {user} /dev/cpu_dma_latency
ExecStart={program} run {project} --speed real{state}
# Axes are brought to rest first.
KillSignal=SIGTERM
TimeoutStopSec=15
# A crash starts the machine's program again, three times a minute at the most. A fault of the program (1) and wrong usage (2) wait for a person.
Restart=on-failure
RestartSec=1
RestartPreventExitStatus=1 2
AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK CAP_NET_RAW
CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK CAP_NET_RAW
NoNewPrivileges=yes
LimitRTPRIO=98
LimitMEMLOCK=infinity
OOMScoreAdjust=-900

[Install]
WantedBy=multi-user.target
",
            folder = value(self.folder)?,
            program = word(self.program, true)?,
            project = word(self.project, true)?,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit<'a>(project: &'a str) -> Unit<'a> {
        Unit {
            description: "five-axis\ndispenser 100 %",
            program: Path::new("/usr/local/bin/takt"),
            project: Path::new(project),
            folder: Path::new("/srv/100% ready"),
            state: None,
            user: "plant",
        }
    }

    #[test]
    fn a_unit_has_the_rights_the_folder_and_the_limits() {
        let text = unit("/srv/my \"dispenser\" $HOME %h").text().unwrap();
        for line in [
            MARK,
            "Description=Takt: five-axisdispenser 100 %%",
            "User=plant",
            "WorkingDirectory=/srv/100%% ready",
            r#"ExecStart="/usr/local/bin/takt" run "/srv/my \"dispenser\" $$HOME %%h" --speed real"#,
            "Restart=on-failure",
            "RestartPreventExitStatus=1 2",
            "StartLimitBurst=3",
            "AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK CAP_NET_RAW",
            "LimitMEMLOCK=infinity",
            "LimitRTPRIO=98",
            "WantedBy=multi-user.target",
        ] {
            assert!(text.lines().any(|l| l == line), "{line}\n{text}");
        }
        let elsewhere = Unit { state: Some(Path::new("/var/lib/takt")), ..unit("/p") };
        assert!(elsewhere.text().unwrap().contains("\"/p\" --speed real --state \"/var/lib/takt\"\n"));
    }

    #[test]
    fn what_a_unit_cannot_hold_is_refused() {
        assert!(matches!(unit("/srv/a\nExecStartPre=/bin/rm").text(), Err(UnitError::Path(_))));
        assert_eq!(Unit { user: "root\nUser=x", ..unit("/p") }.text(), Err(UnitError::User("root\nUser=x".into())));
        for name in ["", "-a", "a b", "a/b", "../x", "ü"] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
        assert!(check_name(&name_of("Zelle 3 / links")).is_ok() && check_name("takt-five-axis-dispenser").is_ok());
        assert_eq!(name_of("点胶机"), "takt-");
        assert!(["", "1x", "a b"].iter().all(|user| check_user(user).is_err()) && check_user("_takt").is_ok());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn systemd_accepts_the_unit_where_there_is_one() {
        use std::process::Command;
        let folder = std::env::temp_dir().join(format!("takt-unit-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("takt-test.service");
        let program = std::env::current_exe().unwrap();
        let unit = Unit { program: &program, project: &folder, folder: &folder, user: "root", ..unit("/p") };
        std::fs::write(&file, unit.text().unwrap()).unwrap();
        match Command::new("systemd-analyze").arg("verify").arg("--man=no").arg(&file).output() {
            Ok(output) => {
                let said = String::from_utf8_lossy(&output.stderr);
                assert!(!said.contains("takt-test"), "{said}");
            }
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::NotFound),
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
