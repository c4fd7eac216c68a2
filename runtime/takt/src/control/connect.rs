//! The client's side of the socket: what `takt ctl` uses.

use super::VERSION;
use serde_json::{Value, json};
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// Bytes of an answer that are taken.
const LONGEST: u64 = 16 << 20;

/// Why a machine does not answer as one wants.
#[derive(Debug)]
pub enum ClientError {
    /// Nobody serves the socket.
    NoMachine(PathBuf, std::io::Error),
    /// The connection broke.
    Broken(std::io::Error),
    /// The machine's answer is none.
    Nonsense(String),
    /// The machine refused: code, message, what was expected.
    Refused {
        /// For tools.
        code: String,
        /// For people.
        message: String,
        /// What would have been right.
        expected: String,
    },
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMachine(path, error) => {
                write!(f, "no machine answers at {}: {error}; start it with `takt run PATH --speed real`", path.display())
            }
            Self::Broken(error) => write!(f, "the connection to the machine broke: {error}"),
            Self::Nonsense(what) => write!(f, "the machine's answer is not understood: {what}"),
            Self::Refused { message, expected, .. } if expected.is_empty() => write!(f, "{message}"),
            Self::Refused { message, expected, .. } => write!(f, "{message}; expected: {expected}"),
        }
    }
}
impl std::error::Error for ClientError {}

/// A connection to a machine.
#[derive(Debug)]
pub struct Client {
    reader: BufReader<UnixStream>,
    next: u64,
    /// What the machine said of itself.
    pub about: Value,
}

impl Client {
    /// Connects and says hello.
    pub fn connect(path: &Path) -> Result<Self, ClientError> {
        let stream = super::socket::connect(path).map_err(|error| ClientError::NoMachine(path.into(), error))?;
        stream.set_read_timeout(Some(PATIENCE)).map_err(ClientError::Broken)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(ClientError::Broken)?;
        let mut client = Self { reader: BufReader::new(stream), next: 0, about: Value::Null };
        client.about = client.ask("hello", json!({ "version": VERSION, "client": "takt ctl" }))?;
        Ok(client)
    }

    /// Asks for something and waits for the answer; values of subscriptions that come between are passed over.
    pub fn ask(&mut self, request: &str, mut arguments: Value) -> Result<Value, ClientError> {
        self.next += 1;
        arguments["id"] = self.next.into();
        arguments["request"] = request.into();
        let line = format!("{arguments}\n");
        // A machine that refuses to read on still says why.
        let written = self.reader.get_mut().write_all(line.as_bytes());
        loop {
            let mut answer = match (self.line(), &written) {
                (Err(ClientError::Broken(_)), Err(error)) => {
                    return Err(ClientError::Broken(std::io::Error::new(error.kind(), error.to_string())));
                }
                (line, _) => line?,
            };
            let about_it = answer["id"] == self.next || answer["id"].is_null() && answer.get("subscription").is_none();
            if !about_it {
                continue;
            }
            if let Some(error) = answer.get("error") {
                let text = |name: &str| error[name].as_str().unwrap_or_default().to_string();
                return Err(ClientError::Refused { code: text("code"), message: text("message"), expected: text("expected") });
            }
            return Ok(answer["result"].take());
        }
    }

    /// The next line from the machine.
    pub fn line(&mut self) -> Result<Value, ClientError> {
        let mut line = Vec::new();
        let mut limited = std::io::Read::take(&mut self.reader, LONGEST);
        let read = limited.read_until(b'\n', &mut line).map_err(ClientError::Broken)?;
        if read == 0 || line.last() != Some(&b'\n') {
            return Err(ClientError::Broken(std::io::ErrorKind::UnexpectedEof.into()));
        }
        serde_json::from_slice(&line).map_err(|error| ClientError::Nonsense(error.to_string()))
    }

    /// How long the next line may take; for ever if `None`.
    pub fn patience(&mut self, time: Option<Duration>) -> Result<(), ClientError> {
        self.reader.get_ref().set_read_timeout(time).map_err(ClientError::Broken)
    }
}
