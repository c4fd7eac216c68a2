//! The pass over a file's tokens that takes out what is excluded and obeys the other directives.

use super::Conditions;
use super::condition::{Fault, holds};
use super::facts::{Facts, Scanner, View, key};
use crate::lexer::{Lexed, MAX_DIAGNOSTICS, PlacedPragma, Token, shorten, unquote};
use crate::tree::{Pragma, Suppressed};
use crate::{Code, Diagnostic, FileId, Span, codes};
use std::collections::HashMap;
use std::ops::Range;

/// Obeys the directives of a file. What is suppressed comes back, as the compiler has warnings of its own.
pub(crate) fn apply(lexed: &mut Lexed, file: FileId, text: &str, conditions: &Conditions) -> Vec<Suppressed> {
    let mut pass = Pass::new(file, text, "", conditions);
    pass.run(lexed);
    pass.cut(lexed);
    lexed.diagnostics.append(&mut pass.diagnostics);
    lexed.diagnostics.sort_by_key(|diagnostic| diagnostic.span.start);
    pass.suppressed.extend(pass.silenced.drain(..).map(|(code, start)| Suppressed { code, start, end: u32::MAX }));
    pass.suppressed
}

/// What a file declares.
pub(super) fn scan(lexed: &mut Lexed, text: &str, list: &str, conditions: &Conditions) -> Facts {
    let mut pass = Pass::new(FileId(0), text, list, conditions);
    pass.run(lexed);
    pass.scanner.facts
}

/// An `{IF}` that waits for its `{END_IF}`.
struct Frame {
    span: Span,
    /// What stands around it is compiled.
    is_outer_active: bool,
    /// One of its branches was compiled.
    is_taken: bool,
    is_active: bool,
    has_else: bool,
}

/// Excluded tokens and text.
struct Cut {
    tokens: Range<u32>,
    text: Range<u32>,
}

struct Pass<'a> {
    file: FileId,
    conditions: &'a Conditions,
    defines: HashMap<String, String>,
    /// The defines outside of the present unit.
    outer_defines: Option<HashMap<String, String>>,
    scanner: Scanner<'a>,
    frames: Vec<Frame>,
    cuts: Vec<Cut>,
    diagnostics: Vec<Diagnostic>,
    suppressed: Vec<Suppressed>,
    /// Codes that are disabled, and since where.
    silenced: Vec<(Code, u32)>,
}

impl<'a> Pass<'a> {
    fn new(file: FileId, text: &'a str, list: &str, conditions: &'a Conditions) -> Self {
        Self {
            file,
            conditions,
            defines: conditions.defines.clone(),
            outer_defines: None,
            scanner: Scanner::new(text, list),
            frames: Vec::new(),
            cuts: Vec::new(),
            diagnostics: Vec::new(),
            suppressed: Vec::new(),
            silenced: Vec::new(),
        }
    }

    fn tell(&mut self, diagnostic: Diagnostic) {
        if self.diagnostics.len() < MAX_DIAGNOSTICS {
            self.diagnostics.push(diagnostic);
        }
    }

    fn is_active(&self) -> bool {
        self.frames.last().is_none_or(|frame| frame.is_active)
    }

    fn run(&mut self, lexed: &Lexed) {
        let mut at = 0;
        for placed in &lexed.pragmas {
            self.tokens(&lexed.tokens[at..placed.before as usize]);
            at = placed.before as usize;
            if placed.is_attribute {
                if self.is_active() {
                    self.scanner.pending.push((placed.pragma.name.clone(), placed.pragma.value.clone()));
                }
            } else if placed.is_directive() {
                self.directive(placed);
            }
        }
        self.tokens(&lexed.tokens[at..]);
        let end = lexed.tokens.last().map_or(0, |token| token.start);
        if !self.is_active() {
            self.end_cut(lexed.tokens.len() as u32 - 1, end);
        }
        for frame in std::mem::take(&mut self.frames) {
            let message = "this `{IF}` is not closed by `{END_IF}`";
            self.tell(Diagnostic::new(Code::BadPragma, frame.span, message));
        }
    }

    fn tokens(&mut self, tokens: &[Token]) {
        if !self.is_active() {
            return;
        }
        for &token in tokens {
            let was_inside = self.scanner.unit.is_some();
            self.scanner.take(token);
            let is_inside = self.scanner.unit.is_some();
            if is_inside && !was_inside {
                self.outer_defines = Some(self.defines.clone());
            } else if was_inside
                && !is_inside
                && let Some(defines) = self.outer_defines.take()
            {
                self.defines = defines;
            }
        }
    }

    fn directive(&mut self, placed: &PlacedPragma) {
        let pragma = &placed.pragma;
        let rest = pragma.value.as_deref().unwrap_or("");
        let was_active = self.is_active();
        match pragma.name.as_str() {
            "if" => self.begin_if(pragma.span, rest),
            "elsif" => self.branch(pragma, Some(rest)),
            "else" => self.branch(pragma, None),
            "end_if" => self.end_if(pragma),
            _ if was_active => self.plain_directive(pragma, rest),
            _ => {}
        }
        match (was_active, self.is_active()) {
            (true, false) => {
                let (token, place) = (placed.before, pragma.span.end);
                self.cuts.push(Cut { tokens: token..u32::MAX, text: place..u32::MAX });
            }
            (false, true) => self.end_cut(placed.before, pragma.span.start),
            _ => {}
        }
    }

    fn end_cut(&mut self, token: u32, place: u32) {
        if let Some(cut) = self.cuts.last_mut() {
            cut.tokens.end = token;
            cut.text.end = place;
        }
    }

    fn begin_if(&mut self, span: Span, condition: &str) {
        let is_outer_active = self.is_active();
        let is_active = is_outer_active && self.evaluate(span, condition);
        self.frames.push(Frame { span, is_outer_active, is_taken: is_active, is_active, has_else: false });
    }

    /// `{ELSIF condition}` or `{ELSE}`.
    fn branch(&mut self, pragma: &Pragma, condition: Option<&str>) {
        let Some(mut frame) = self.frames.pop() else { return self.homeless(pragma) };
        if frame.has_else {
            let message = format!("`{{{}}}` behind the `{{ELSE}}` of the same `{{IF}}`", pragma.name.to_uppercase());
            self.tell(Diagnostic::new(Code::BadPragma, pragma.span, message));
        }
        let is_open = frame.is_outer_active && !frame.is_taken;
        frame.is_active = is_open && condition.is_none_or(|condition| self.evaluate(pragma.span, condition));
        frame.is_taken |= frame.is_active;
        frame.has_else |= condition.is_none();
        self.frames.push(frame);
    }

    fn end_if(&mut self, pragma: &Pragma) {
        if self.frames.pop().is_none() {
            self.homeless(pragma);
        }
    }

    fn homeless(&mut self, pragma: &Pragma) {
        let message = format!("`{{{}}}` belongs to no open `{{IF}}`", pragma.name.to_uppercase());
        self.tell(Diagnostic::new(Code::BadPragma, pragma.span, message));
    }

    fn evaluate(&mut self, span: Span, condition: &str) -> bool {
        let view = View {
            own: &self.scanner.facts,
            all: &self.conditions.facts,
            unit: self.scanner.unit.as_deref(),
            method: self.scanner.method.as_deref(),
        };
        match holds(condition, &self.defines, &self.conditions.defines, &view) {
            Ok(value) => value,
            Err(Fault { message, help }) => {
                let mut diagnostic = Diagnostic::new(Code::BadPragma, span, message);
                diagnostic.help = help.map(str::to_owned);
                self.tell(diagnostic);
                false
            }
        }
    }

    /// A directive that opens and closes nothing.
    fn plain_directive(&mut self, pragma: &Pragma, rest: &str) {
        match pragma.name.as_str() {
            "define" => {
                let (name, value) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                if self.names_something(pragma, name) {
                    self.defines.insert(key(name), unquote(value).to_owned());
                }
            }
            "undefine" if self.names_something(pragma, rest) => {
                self.defines.remove(&key(rest));
            }
            "error" => self.tell(Diagnostic::new(Code::ErrorPragma, pragma.span, unquote(rest))),
            "warning" => {
                let (word, list) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                match word.to_ascii_lowercase().as_str() {
                    "disable" | "restore" => self.silence(pragma, word.eq_ignore_ascii_case("disable"), list),
                    _ => self.tell(Diagnostic::new(Code::WarningPragma, pragma.span, unquote(rest))),
                }
            }
            _ => {}
        }
    }

    fn names_something(&mut self, pragma: &Pragma, name: &str) -> bool {
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if !is_name {
            let message = format!("expected a name behind `{}`, found `{}`", pragma.name, shorten(name));
            self.tell(Diagnostic::new(Code::BadPragma, pragma.span, message).help("write for example `{define SIMULATION}`"));
        }
        is_name
    }

    /// `{warning disable W0301}`. Codes of CODESYS (`C0195`) are not ours and need no answer.
    fn silence(&mut self, pragma: &Pragma, is_off: bool, list: &str) {
        for word in list.split([',', ' ', '\t']).filter(|word| !word.is_empty()) {
            let known = codes().iter().copied().find(|code| code.text().eq_ignore_ascii_case(word));
            let is_ours = word.starts_with(['W', 'E', 'w', 'e']);
            match known {
                Some(code) if code.text().starts_with('W') => {
                    let open = self.silenced.iter().position(|(silenced, _)| *silenced == code);
                    match (open, is_off) {
                        (None, true) => self.silenced.push((code, pragma.span.start)),
                        (Some(index), false) => {
                            let (code, start) = self.silenced.swap_remove(index);
                            self.suppressed.push(Suppressed { code, start, end: pragma.span.end });
                        }
                        _ => {}
                    }
                }
                Some(_) => {
                    let message = format!("`{}` is an error and cannot be disabled", shorten(word));
                    self.tell(Diagnostic::new(Code::BadPragma, pragma.span, message));
                }
                None if is_ours => {
                    let message = format!("there is no warning `{}`", shorten(word));
                    self.tell(Diagnostic::new(Code::BadPragma, pragma.span, message));
                }
                None => {}
            }
        }
    }

    /// Takes out what is excluded, with all that was said of it, and the directives themselves.
    fn cut(&self, lexed: &mut Lexed) {
        let file = self.file;
        let is_excluded = |place: u32| {
            let index = self.cuts.partition_point(|cut| cut.text.end <= place);
            self.cuts.get(index).is_some_and(|cut| cut.text.contains(&place))
        };
        let mut removed = 0;
        let ends: Vec<(u32, u32)> = self
            .cuts
            .iter()
            .map(|cut| {
                removed += cut.tokens.end - cut.tokens.start;
                (cut.tokens.end, removed)
            })
            .collect();
        let moved = |index: u32| {
            let cut = ends.partition_point(|(end, _)| *end <= index);
            index - cut.checked_sub(1).map_or(0, |cut| ends[cut].1)
        };
        lexed.pragmas.retain(|placed| !placed.is_directive() && !is_excluded(placed.pragma.span.start));
        lexed.comments.retain(|comment| !is_excluded(comment.start));
        lexed.diagnostics.retain(|diagnostic| diagnostic.span.file != file || !is_excluded(diagnostic.span.start));
        lexed.pragmas.iter_mut().for_each(|placed| placed.before = moved(placed.before));
        lexed.comments.iter_mut().for_each(|comment| comment.before = moved(comment.before));
        let mut tokens = Vec::with_capacity(lexed.tokens.len());
        let mut from = 0;
        for cut in &self.cuts {
            tokens.extend_from_slice(&lexed.tokens[from..cut.tokens.start as usize]);
            from = cut.tokens.end as usize;
        }
        tokens.extend_from_slice(&lexed.tokens[from..]);
        lexed.tokens = tokens;
    }
}
