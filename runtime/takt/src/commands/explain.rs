//! `takt explain`: what a code means.

use super::Exit;
use crate::console;
use crate::spelling::nearest;
use takt_syntax::codes;

pub(super) fn execute(code: Option<&str>) -> Exit {
    let Some(code) = code else {
        for code in codes() {
            console::result(format_args!("{}  {}", code.text(), code.meaning()));
        }
        return Exit::Good;
    };
    match codes().iter().find(|known| known.text().eq_ignore_ascii_case(code)) {
        Some(known) => {
            match takt_syntax::explain(known.text()) {
                Some(page) => console::result(page.trim_end()),
                None => console::result(format_args!("{}: {}", known.text(), known.meaning())),
            }
            Exit::Good
        }
        None => {
            let near = nearest(code, codes().iter().map(|known| known.text()));
            let help = near.map_or_else(|| "`takt explain` lists them all".to_string(), |near| format!("did you mean {near}?"));
            console::tell(format_args!("there is no code `{code}`; {help}"));
            Exit::Usage
        }
    }
}
