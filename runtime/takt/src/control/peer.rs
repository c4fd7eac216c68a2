//! Who is at the other end of a socket, as the system says: nothing that a client could invent.

/// A client's process.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Peer {
    /// User.
    pub user: Option<u32>,
    /// Process.
    pub process: Option<i32>,
}

impl Peer {
    /// Asks the system.
    #[cfg(target_os = "linux")]
    pub fn of(socket: &std::os::unix::net::UnixStream) -> Self {
        match rustix::net::sockopt::socket_peercred(socket) {
            Ok(peer) => Self { user: Some(peer.uid.as_raw()), process: Some(peer.pid.as_raw_nonzero().get()) },
            Err(_) => Self::default(),
        }
    }

    /// Other systems do not say.
    #[cfg(all(unix, not(target_os = "linux")))]
    pub fn of(_: &std::os::unix::net::UnixStream) -> Self {
        Self::default()
    }

    /// The name of the user, if the system's list of users has it.
    pub fn user_name(&self) -> Option<String> {
        let wanted = self.user?.to_string();
        let list = std::fs::read_to_string("/etc/passwd").ok()?;
        let name = |line: &str| {
            let mut fields = line.split(':');
            let (name, user) = (fields.next()?, fields.nth(1)?);
            (user == wanted).then(|| name.to_owned())
        };
        list.lines().find_map(name)
    }
}

impl std::fmt::Display for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.user, self.user_name()) {
            (Some(user), Some(name)) => write!(f, "user {name} ({user})")?,
            (Some(user), None) => write!(f, "user {user}")?,
            (None, _) => write!(f, "user unknown")?,
        }
        self.process.map_or(Ok(()), |process| write!(f, ", process {process}"))
    }
}
