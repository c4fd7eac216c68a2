//! What a program says to people, and which task it runs in: ADSLOGSTR and its like of Tc2_System.
//!
//! A message waits in a bounded ring until the tool takes it, so a scan writes to no file and no terminal.

use super::{Line, Text};
use takt_abi::{Cx, Dword, FnDesc, Message, MessageLevel, Str, native_fn};

/// All of them.
pub const FUNCTIONS: &[&FnDesc] = &[LogText::DESC, LogNumber::DESC, LogReal::DESC, Task::DESC];

/// Bits of `msgCtrlMask`.
const WARNING: u32 = 2;
const ERROR: u32 = 4;

/// The text with `argument` in the place of the first of `places`; `%%` is a `%`.
fn filled(format: &[u8], places: &[u8], argument: &[u8]) -> Text {
    let mut line = Line::new();
    let mut rest = format;
    let mut waiting = true;
    while let Some(at) = rest.iter().position(|byte| *byte == b'%') {
        line.push(&rest[..at]);
        let sign = rest.get(at + 1).copied();
        match sign {
            Some(b'%') => line.push(b"%"),
            Some(sign) if waiting && places.contains(&sign) => {
                line.push(argument);
                waiting = false;
            }
            _ => {
                line.push(b"%");
                rest = &rest[at + 1..];
                continue;
            }
        }
        rest = &rest[at + 2..];
    }
    line.push(rest);
    Str(line.bytes)
}

fn say(cx: &mut Cx<'_>, mask: Dword, text: Text) -> i32 {
    let level = match mask.0 {
        mask if mask & ERROR != 0 => MessageLevel::Error,
        mask if mask & WARNING != 0 => MessageLevel::Warning,
        _ => MessageLevel::Info,
    };
    cx.env.messages.push(Message { time: cx.now, level, text });
    0
}

native_fn! {
    /// Says a text to people, with `strArg` for `%s` (Tc2_System); always 0.
    pub fn ADSLOGSTR as LogText(cx, msgCtrlMask: Dword, msgFmtStr: Text, strArg: Text) -> i32 {
        Ok(say(cx, msgCtrlMask, filled(msgFmtStr.bytes(), b"s", strArg.bytes())))
    }
}
native_fn! {
    /// Says a text to people, with `dintArg` for `%d` (Tc2_System); always 0.
    pub fn ADSLOGDINT as LogNumber(cx, msgCtrlMask: Dword, msgFmtStr: Text, dintArg: i32) -> i32 {
        let argument = super::written(format_args!("{dintArg}"));
        Ok(say(cx, msgCtrlMask, filled(msgFmtStr.bytes(), b"di", argument.bytes())))
    }
}
native_fn! {
    /// Says a text to people, with `lrealArg` for `%f` (Tc2_System); always 0.
    pub fn ADSLOGLREAL as LogReal(cx, msgCtrlMask: Dword, msgFmtStr: Text, lrealArg: f64) -> i32 {
        let argument = super::written(format_args!("{lrealArg:.6}"));
        Ok(say(cx, msgCtrlMask, filled(msgFmtStr.bytes(), b"feg", argument.bytes())))
    }
}
native_fn! {
    /// The number of the running task, from 1 on; what GETCURTASKINDEXEX tells.
    pub fn CurrentTask as Task(cx) -> i32 { Ok(i32::try_from(cx.env.task).unwrap_or(i32::MAX).saturating_add(1)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_argument_takes_the_first_place_of_its_kind() {
        let text = |format: &str| filled(format.as_bytes(), b"s", b"x").to_text().into_owned();
        assert_eq!(text("a %s b"), "a x b");
        assert_eq!(text("%s%s"), "x%s");
        assert_eq!(text("100 %% of %d%"), "100 % of %d%");
        assert_eq!(text(""), "");
    }
}
