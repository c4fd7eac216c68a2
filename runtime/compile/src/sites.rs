//! Places for faults: spans become file, line and column once per site.

use rustc_hash::FxHashMap;
use takt_ir::{BodyId, Site, SiteId};
use takt_syntax::{Source, Span};

/// The growing table of a program's sites.
#[derive(Debug, Default)]
pub(crate) struct Sites {
    pub(crate) all: Vec<Site>,
    /// Sites of the body that is being lowered.
    known: FxHashMap<(u32, u32), SiteId>,
    body: Option<BodyId>,
    lines: Vec<Vec<u32>>,
    /// Where the last site stands: file and line. The next one is seldom far away.
    last: (u32, usize),
}

impl Sites {
    pub(crate) fn new(files: &[Source]) -> Self {
        let lines = files.iter().map(|f| {
            std::iter::once(0).chain(f.text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i as u32 + 1)).collect()
        });
        Self { lines: lines.collect(), ..Self::default() }
    }
    /// The site of the first character of `span`. A body that is left and taken up again may have two sites for one place.
    pub(crate) fn at(&mut self, files: &[Source], span: Span, body: BodyId) -> SiteId {
        if self.body.replace(body) != Some(body) {
            self.known.clear();
        }
        let key = (span.file.0, span.start);
        if let Some(id) = self.known.get(&key) {
            return *id;
        }
        let line = self.line(span);
        let text = &files[span.file.0 as usize].text;
        let start = self.lines[span.file.0 as usize][line];
        let column = text.get(start as usize..span.start as usize).map_or(0, |s| s.chars().count());
        let id = SiteId(self.all.len() as u32);
        self.all.push(Site { file: span.file.0, line: line as u32 + 1, column: column as u32 + 1, body });
        self.known.insert(key, id);
        id
    }
    /// Index of the line that the span starts in.
    fn line(&mut self, span: Span) -> usize {
        let lines = &self.lines[span.file.0 as usize];
        let (file, last) = self.last;
        let near = if file == span.file.0 { last..(last + 64).min(lines.len()) } else { 0..0 };
        let among = match (lines.get(near.start), lines.get(near.end)) {
            (Some(from), Some(to)) if *from <= span.start && span.start < *to => near,
            _ => 0..lines.len(),
        };
        let first = among.start;
        let line = (first + lines[among].partition_point(|start| *start <= span.start)).max(1) - 1;
        self.last = (span.file.0, line);
        line
    }
}
