//! Cases as they stand in `tests/suite`: a program and what must be true of it.
//!
//! `--- name check ---`: every line `// ^ CODE text` says that the line above it has a message with that code at the caret's column, whose text,
//! with the help in brackets behind it, contains `text` (`// <- CODE text`: at column 1); there must be no other message. `--- name lint ---` is the same with warnings of likely mistakes. `--- name run ---`: lines `//|` are a waveform, one column per scan: `X = 1 2` drives, `X : 1 2`
//! expects (`_` does not), `every 10ms` is the step, `fault NAME at LINE:COL` expects the run to end so, `stack BODY:LINE …` its callers.
//! `preempt 1 at 17 in 2` interrupts the second scan of task 1 (in declared order, from 0) where it has used 17 units of fuel;
//! `reset warm before 3` restarts the program before the third scan (warm, cold, origin).
//! `--- name ir ---`: a program in the text form of the IR, for what ST cannot reach; the waveform stands behind `;|`, and `refused TEXT` says that the
//! verifier must not let it pass.

/// A case.
#[derive(Debug, Clone)]
pub struct Case {
    /// The fact it states.
    pub name: String,
    /// `check`, `lint`, `run` or `ir`.
    pub kind: String,
    /// The program (comments of the bench included: they are comments in ST too).
    pub source: String,
    /// Line of the first source line in its file, from 1.
    pub line: usize,
}

/// Splits a suite file into its cases.
pub fn cases(text: &str) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if let Some(head) = line.strip_prefix("--- ").and_then(|l| l.strip_suffix(" ---")) {
            let (name, kind) = head.rsplit_once(' ').unwrap_or((head, ""));
            cases.push(Case { name: name.into(), kind: kind.into(), source: String::new(), line: number + 2 });
        } else if let Some(case) = cases.last_mut() {
            case.source.push_str(line);
            case.source.push('\n');
        }
    }
    cases
}

/// An expected message: line and column in the case, code, part of the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expected {
    /// From 1, within the case.
    pub line: usize,
    /// In characters, from 1.
    pub column: usize,
    /// `E0301`.
    pub code: String,
    /// Part of the message.
    pub text: String,
}

/// The caret lines of a `check` case.
pub fn expectations(source: &str) -> Vec<Expected> {
    let mut found = Vec::new();
    let mut code_line = 0;
    for (i, line) in source.lines().enumerate() {
        if let Some(message) = line.strip_prefix("// <- ") {
            let (code, text) = message.split_once(' ').unwrap_or((message, ""));
            found.push(Expected { line: code_line, column: 1, code: code.into(), text: text.trim().into() });
            continue;
        }
        let caret = line.trim_start().starts_with("//").then(|| line.find('^')).flatten();
        let Some(at) = caret.filter(|at| line[..*at].trim_start().trim_start_matches('/').trim().is_empty()) else {
            code_line = i + 1;
            continue;
        };
        let (code, text) = line[at + 1..].trim().split_once(' ').unwrap_or((line[at + 1..].trim(), ""));
        found.push(Expected { line: code_line, column: line[..at].chars().count() + 1, code: code.into(), text: text.trim().into() });
    }
    found
}

/// One row of a waveform.
#[derive(Debug, Clone)]
pub struct Row {
    /// Path of the variable.
    pub path: String,
    /// Driven before the scan, or expected after it.
    pub drives: bool,
    /// One value per scan; `_` leaves it open.
    pub values: Vec<String>,
}

/// What a `run` case says.
#[derive(Debug, Clone, Default)]
pub struct Waveform {
    /// Step in nanoseconds.
    pub every: i64,
    /// Rows in order.
    pub rows: Vec<Row>,
    /// `index at 5:3`.
    pub fault: Option<String>,
    /// `main:7 outer:3`.
    pub stack: Option<String>,
    /// Preemptions: task, fuel, scan of the task.
    pub preempt: Vec<(usize, u64, u64)>,
    /// Restarts: `reset warm before 3` is (3, "warm").
    pub resets: Vec<(usize, String)>,
    /// Part of the verifier's message.
    pub refused: Option<String>,
}

/// Reads the `//|` lines.
pub fn waveform(source: &str) -> Result<Waveform, String> {
    let mut wave = Waveform { every: 10_000_000, ..Waveform::default() };
    for line in source.lines().filter_map(|l| l.trim().strip_prefix("//|").or_else(|| l.trim().strip_prefix(";|"))) {
        let line = line.trim();
        if let Some(step) = line.strip_prefix("every ") {
            let ms: f64 = step.trim().strip_suffix("ms").and_then(|n| n.parse().ok()).ok_or(format!("`{step}` is not a time in ms"))?;
            wave.every = (ms * 1e6) as i64;
        } else if let Some(fault) = line.strip_prefix("fault ") {
            wave.fault = Some(fault.trim().into());
        } else if let Some(reason) = line.strip_prefix("refused ") {
            wave.refused = Some(reason.trim().into());
        } else if let Some(rest) = line.strip_prefix("preempt ") {
            let numbers: Vec<u64> = rest.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            let [task, fuel, cycle] = numbers[..] else { return Err(format!("`{line}` is not of the form `preempt 1 at 17 in 2`")) };
            wave.preempt.push((task as usize, fuel, cycle));
        } else if let Some(reset) = line.strip_prefix("reset ") {
            let (kind, scan) = reset.split_once(" before ").ok_or(format!("`{line}` is not of the form `reset warm before 3`"))?;
            wave.resets.push((scan.trim().parse().map_err(|_| format!("`{scan}` is no number of a scan"))?, kind.trim().into()));
        } else if let Some(stack) = line.strip_prefix("stack ") {
            wave.stack = Some(stack.trim().into());
        } else {
            wave.rows.push(row(line)?);
        }
    }
    Ok(wave)
}

fn row(line: &str) -> Result<Row, String> {
    let sign = [" = ", " : "].into_iter().filter_map(|s| Some((line.find(s)?, s))).min();
    let (at, sign) = sign.ok_or(format!("`{line}` is neither `X = …` nor `X : …`"))?;
    Ok(Row { path: line[..at].trim().into(), drives: sign == " = ", values: words(&line[at + 3..]) })
}

/// Splits at spaces outside of quotes and brackets.
fn words(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted, mut depth) = (Vec::new(), String::new(), false, 0i32);
    for c in text.chars() {
        match c {
            '\'' => quoted = !quoted,
            '(' | '[' if !quoted => depth += 1,
            ')' | ']' if !quoted => depth -= 1,
            ' ' if !quoted && depth == 0 => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
                continue;
            }
            _ => {}
        }
        word.push(c);
    }
    words.extend((!word.is_empty()).then_some(word));
    words
}
