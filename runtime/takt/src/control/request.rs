//! Requests as they come from a client.

use super::answer::Problem;
use super::limits;
use serde::Deserialize;
use serde_json::Value;

/// A variable and what it shall be.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Assignment {
    pub variable: String,
    /// JSON, as a read gives it.
    pub value: Option<Value>,
    /// Or a literal of ST.
    pub literal: Option<String>,
}

/// How a program is started anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Kind {
    /// Retained variables keep their values.
    #[default]
    Warm,
    /// Persistent ones do.
    Cold,
    /// None do.
    Origin,
}

fn one() -> u64 {
    1
}

/// What a client asks for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "request", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Request {
    Hello {
        version: u32,
        #[serde(default)]
        client: String,
    },
    Arm {
        name: String,
        reason: String,
    },
    Disarm {},
    Status {},
    Tasks {},
    Forces {},
    Parameters {},
    Read {
        variables: Vec<String>,
    },
    Write {
        variables: Vec<Assignment>,
        lease_ms: Option<u64>,
    },
    Force {
        variables: Vec<Assignment>,
        lease_ms: Option<u64>,
    },
    Renew {},
    Release {
        variables: Vec<String>,
        #[serde(default)]
        restore: bool,
    },
    ReleaseAll {
        #[serde(default)]
        restore: bool,
    },
    Subscribe {
        variables: Vec<String>,
        period_ms: Option<u64>,
        scans: Option<u64>,
    },
    Unsubscribe {
        subscription: u64,
    },
    Reset {
        #[serde(default)]
        kind: Kind,
    },
    ResetTask {
        task: String,
    },
    ResetStatistics {},
    Halt {},
    Pause {},
    Continue {},
    Step {
        #[serde(default = "one")]
        scans: u64,
    },
    Stop {},
}

impl Request {
    /// Whether only an armed client may ask for it.
    pub(super) fn changes(&self) -> bool {
        use Request::*;
        matches!(
            self,
            Write { .. }
                | Force { .. }
                | Release { .. }
                | ReleaseAll { .. }
                | Reset { .. }
                | ResetTask { .. }
                | ResetStatistics {}
                | Halt {}
                | Pause {}
                | Continue {}
                | Step { .. }
                | Stop {}
        )
    }
}

/// A line of a client: its id, if it has a good one, and what it asks for.
pub(super) fn parse(line: &[u8]) -> (Value, Result<Request, Problem>) {
    let example = r#"{"id":1,"request":"status"}"#;
    let text = match std::str::from_utf8(line) {
        Ok(text) => text,
        Err(error) => {
            let message = format!("the request is not UTF-8 at byte {}", error.valid_up_to() + 1);
            return (Value::Null, Err(Problem::new("malformed", message).expected(example)));
        }
    };
    let mut object = match serde_json::from_str(text) {
        Ok(Value::Object(object)) => object,
        Ok(_) => return (Value::Null, Err(Problem::new("malformed", "the request is no object").expected(example))),
        Err(error) => return (Value::Null, Err(Problem::new("malformed", format!("the request is no JSON: {error}")).expected(example))),
    };
    let id = object.remove("id").unwrap_or(Value::Null);
    let good = match &id {
        Value::Number(_) => true,
        Value::String(text) => text.chars().count() <= limits::NAME,
        _ => false,
    };
    if !good {
        return (Value::Null, Err(Problem::new("malformed", "the request has no id").expected("a number or a short text, like \"id\":1")));
    }
    let request = serde_json::from_value(Value::Object(object));
    (id, request.map_err(|error| Problem::new("bad-request", error.to_string()).expected("a request as in docs/control.md")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn refused(line: &[u8], code: &str, part: &str) {
        let problem = parse(line).1.expect_err("is refused");
        assert!(problem.code == code && problem.message.contains(part), "{problem:?}");
    }

    #[test]
    fn requests_are_understood() {
        let (id, request) = parse(br#"{"id":"a","request":"write","variables":[{"variable":"G.x","value":5}],"lease_ms":500}"#);
        assert_eq!(id, "a");
        assert!(request.unwrap().changes());
        assert_eq!(parse(br#"{"request":"step","id":7}"#).1.unwrap(), Request::Step { scans: 1 });
        assert_eq!(parse(br#"{"request":"reset","id":7,"kind":"cold"}"#).1.unwrap(), Request::Reset { kind: Kind::Cold });
    }

    #[test]
    fn what_is_no_request_is_refused_with_what_was_expected() {
        refused(b"\xFF{}", "malformed", "not UTF-8 at byte 1");
        refused(b"hello", "malformed", "no JSON");
        refused(b"[]", "malformed", "no object");
        refused(br#"{"request":"status"}"#, "malformed", "no id");
        refused(br#"{"id":{},"request":"status"}"#, "malformed", "no id");
        refused(br#"{"id":1}"#, "bad-request", "request");
        refused(br#"{"id":1,"request":"explode"}"#, "bad-request", "unknown variant `explode`, expected one of `hello`");
        refused(br#"{"id":1,"request":"read","variable":"G.x"}"#, "bad-request", "variable");
        refused(br#"{"id":1,"request":"step","scans":-1}"#, "bad-request", "-1");
        refused("[".repeat(200_000).as_bytes(), "malformed", "recursion limit");
        refused(format!("{{\"id\":1,\"request\":{}", "{\"a\":".repeat(100_000)).as_bytes(), "malformed", "recursion limit");
    }
}
