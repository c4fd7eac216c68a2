//! Places for faults: spans become file, line and column once per site.

use std::collections::HashMap;
use takt_ir::{BodyId, Site, SiteId};
use takt_syntax::{Source, Span};

/// The growing table of a program's sites.
#[derive(Debug, Default)]
pub(crate) struct Sites {
    pub(crate) all: Vec<Site>,
    known: HashMap<(u32, u32, BodyId), SiteId>,
    lines: Vec<Vec<u32>>,
}

impl Sites {
    pub(crate) fn new(files: &[Source]) -> Self {
        let lines = files.iter().map(|f| {
            std::iter::once(0).chain(f.text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i as u32 + 1)).collect()
        });
        Self { lines: lines.collect(), ..Self::default() }
    }
    /// The site of the first character of `span`.
    pub(crate) fn at(&mut self, files: &[Source], span: Span, body: BodyId) -> SiteId {
        let key = (span.file.0, span.start, body);
        if let Some(id) = self.known.get(&key) {
            return *id;
        }
        let lines = &self.lines[span.file.0 as usize];
        let line = lines.partition_point(|start| *start <= span.start).max(1) - 1;
        let text = &files[span.file.0 as usize].text;
        let column = text.get(lines[line] as usize..span.start as usize).map_or(0, |s| s.chars().count());
        let id = SiteId(self.all.len() as u32);
        self.all.push(Site { file: span.file.0, line: line as u32 + 1, column: column as u32 + 1, body });
        self.known.insert(key, id);
        id
    }
}
