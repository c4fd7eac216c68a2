//! A source as bytes, for checkpoints: everything that decides what comes next, the request under way included.

use super::{Awaited, NcSource, Phase, Settings};
use crate::cnc::trouble::Kind;
use takt_abi::{CHUNK, Plain, SmcError, Str, Ticket};

/// Says which layout follows.
const MARK: u64 = 0x4e43_536f_7572_0002;

struct Writer<'a>(&'a mut Vec<u8>);

impl Writer<'_> {
    fn word(&mut self, value: u64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    fn bytes(&mut self, bytes: &[u8]) {
        self.word(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
    }
    fn settings(&mut self, settings: &Settings) {
        settings.feed.iter().chain(&settings.rapid).for_each(|v| self.word(v.to_bits()));
        self.word(settings.parentheses.into());
    }
}

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn word(&mut self) -> Option<u64> {
        let (head, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*head))
    }
    fn bytes(&mut self, most: usize) -> Option<&'a [u8]> {
        let length = usize::try_from(self.word()?).ok().filter(|n| *n <= most)?;
        let (head, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(head)
    }
    fn buffer(&mut self) -> Option<Vec<u8>> {
        let bytes = self.bytes(CHUNK)?;
        let mut buffer = Vec::with_capacity(CHUNK);
        buffer.extend_from_slice(bytes);
        Some(buffer)
    }
    fn path(&mut self) -> Option<Str<256>> {
        Some(Str::load(self.bytes(256).filter(|b| b.len() == 256)?))
    }
    fn settings(&mut self) -> Option<Settings> {
        let mut settings = Settings::default();
        for value in settings.feed.iter_mut().chain(&mut settings.rapid) {
            *value = f64::from_bits(self.word()?);
        }
        settings.parentheses = self.word()? != 0;
        Some(settings)
    }
}

/// What can be wrong with a file as a whole; what is wrong with its words is found behind the source.
fn kind_to_words(kind: Kind) -> (u64, i32) {
    match kind {
        Kind::NoName => (1, 0),
        Kind::NotFound => (2, 0),
        Kind::Outside => (3, 0),
        Kind::NotReadable(code) => (4, code),
        Kind::Empty => (5, 0),
        Kind::NotText => (6, 0),
        Kind::LineTooLong => (7, 0),
        Kind::Changed => (8, 0),
        other => (0, other.error().0.into()),
    }
}

fn kind_of_words(kind: u64, detail: i32) -> Option<Kind> {
    Some(match kind {
        0 => Kind::Known(SmcError(i16::try_from(detail).ok()?)),
        1 => Kind::NoName,
        2 => Kind::NotFound,
        3 => Kind::Outside,
        4 => Kind::NotReadable(detail),
        5 => Kind::Empty,
        6 => Kind::NotText,
        7 => Kind::LineTooLong,
        8 => Kind::Changed,
        _ => return None,
    })
}

/// The content of a source, appended.
pub fn save(source: &NcSource, out: &mut Vec<u8>) {
    let mut w = Writer(out);
    w.word(MARK);
    w.bytes(&source.path.0);
    w.settings(&source.settings);
    let (phase, error, line, column) = match source.phase {
        Phase::Idle => (0, 0, 0, 0),
        Phase::Reading => (1, 0, 0, 0),
        Phase::Read => (2, 0, 0, 0),
        Phase::Failed(t) => (3, kind_to_words(t.kind).0, t.line, t.column),
    };
    let detail = if let Phase::Failed(t) = source.phase { kind_to_words(t.kind).1 as u32 } else { 0 };
    [phase, error, detail.into(), line.into(), column.into()].into_iter().for_each(|v| w.word(v));
    w.word(source.queued.is_some().into());
    if let Some((path, settings)) = &source.queued {
        w.bytes(&path.0);
        w.settings(settings);
    }
    w.bytes(&source.front);
    [source.at, source.watched].into_iter().for_each(|v| w.word(v as u64));
    w.word(source.back.is_some().into());
    if let Some(back) = &source.back {
        w.bytes(back);
    }
    w.word(source.awaited.map_or(0, |a| 1 + u64::from(a.stale)));
    w.word(source.awaited.map_or(0, |a| a.ticket.0));
    w.bytes(&source.carry);
    [source.handed.into(), source.line.into(), source.received].into_iter().for_each(|v| w.word(v));
    w.word(source.file_size.map_or(u64::MAX, |s| s));
}

/// The source of a saved content.
pub fn restore(bytes: &[u8]) -> Option<NcSource> {
    let mut r = Reader(bytes);
    if r.word()? != MARK {
        return None;
    }
    let mut s = NcSource { path: r.path()?, settings: r.settings()?, ..NcSource::default() };
    let (phase, error, detail) = (r.word()?, r.word()?, r.word()? as u32 as i32);
    let (line, column) = (r.word()? as u32, r.word()? as u32);
    s.phase = match phase {
        0 => Phase::Idle,
        1 => Phase::Reading,
        2 => Phase::Read,
        3 => Phase::Failed(kind_of_words(error, detail)?.at(line, column)),
        _ => return None,
    };
    if r.word()? != 0 {
        s.queued = Some((r.path()?, r.settings()?));
    }
    s.front = r.buffer()?;
    s.at = usize::try_from(r.word()?).ok().filter(|at| *at <= s.front.len())?;
    s.watched = usize::try_from(r.word()?).ok().filter(|at| *at <= s.front.len())?;
    if r.word()? != 0 {
        s.back = Some(r.buffer()?);
    }
    let (awaited, ticket) = (r.word()?, r.word()?);
    s.awaited = (awaited != 0).then_some(Awaited { ticket: Ticket(ticket), stale: awaited == 2 });
    s.carry.extend_from_slice(r.bytes(super::LINE_MAX + 1)?);
    s.handed = r.word()? != 0;
    s.line = r.word()? as u32;
    s.received = r.word()?;
    s.file_size = Some(r.word()?).filter(|size| *size != u64::MAX);
    r.0.is_empty().then_some(s)
}
