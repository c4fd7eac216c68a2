//! XML with places: a tree whose names, attributes and texts know where in the file they stand.
//!
//! Promises: bounded time and memory (depth, elements and attributes are counted), nothing is fetched, no entity is expanded but the five of the
//! standard and numbered characters. A DTD is refused. Lacks: namespaces (prefixes are dropped, as the formats read here never need them).

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::borrow::Cow;
use std::ops::Range;

/// Elements inside of each other.
const DEPTH: usize = 200;
/// Elements of a file.
const ELEMENTS: usize = 1_000_000;
/// Attributes of an element.
const ATTRIBUTES: usize = 64;
/// Pieces of text of a file: runs, CDATA sections and references.
const PIECES: usize = 4_000_000;

/// Why a text is not XML that is read here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct XmlError {
    /// Bytes of the file.
    pub at: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: &'static str,
}

/// A run of text: as it stands in the file, or what a reference like `&lt;` stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Piece<'a> {
    /// The text.
    pub text: Cow<'a, str>,
    /// Where it stands, spelled in the manner of XML.
    pub at: Range<usize>,
}

/// An attribute.
#[derive(Debug, Clone)]
pub(super) struct Attribute<'a> {
    /// With its prefix.
    name: &'a str,
    /// Its value.
    pub value: Cow<'a, str>,
    /// Where the value stands, without its quotes.
    pub at: Range<usize>,
}

/// What stands in an element.
#[derive(Debug, Clone)]
pub(super) enum Content<'a> {
    /// An element.
    Element(Element<'a>),
    /// Text.
    Text(Piece<'a>),
}

/// An element.
#[derive(Debug, Clone)]
pub(super) struct Element<'a> {
    /// Name without prefix.
    pub name: &'a str,
    /// Its opening tag.
    pub open: Range<usize>,
    /// Its closing tag; the opening one where that closes itself.
    pub close: Range<usize>,
    attributes: Vec<Attribute<'a>>,
    content: Vec<Content<'a>>,
}

impl<'a> Element<'a> {
    /// The elements directly inside.
    pub fn children(&self) -> impl Iterator<Item = &Element<'a>> {
        self.content.iter().filter_map(|content| match content {
            Content::Element(element) => Some(element),
            Content::Text(_) => None,
        })
    }
    /// The first element of that name directly inside.
    pub fn child(&self, name: &str) -> Option<&Element<'a>> {
        self.children().find(|element| element.name == name)
    }
    /// Follows names from the outside in.
    pub fn descend(&self, names: &[&str]) -> Option<&Element<'a>> {
        names.iter().try_fold(self, |element, name| element.child(name))
    }
    /// An attribute; its name in any case, as files of different tools spell it.
    pub fn attribute(&self, name: &str) -> Option<&Attribute<'a>> {
        self.attributes.iter().find(|attribute| local(attribute.name).eq_ignore_ascii_case(name))
    }
    /// An attribute's value.
    pub fn value(&self, name: &str) -> Option<&str> {
        self.attribute(name).map(|attribute| attribute.value.as_ref())
    }
    /// Everything that is text, also inside of inner elements; a paragraph begins a line.
    pub fn pieces(&self) -> Vec<Piece<'a>> {
        let mut pieces = Vec::new();
        self.collect(&mut pieces);
        pieces
    }
    /// The text in one piece, without the blanks around it.
    pub fn text(&self) -> String {
        self.pieces().iter().map(|piece| piece.text.as_ref()).collect::<String>().trim().to_string()
    }
    /// Where the text stands; the opening tag if there is none.
    pub fn text_place(&self) -> Range<usize> {
        let pieces = self.pieces();
        let mut solid = pieces.iter().filter(|piece| !piece.text.trim().is_empty());
        let Some(first) = solid.next() else { return self.open.clone() };
        let blanks = first.text.len() - first.text.trim_start().len();
        let last = solid.next_back().unwrap_or(first);
        let end = if last.at.len() == last.text.len() { last.at.start + last.text.trim_end().len() } else { last.at.end };
        (first.at.start + blanks).min(end)..end
    }
    fn collect(&self, pieces: &mut Vec<Piece<'a>>) {
        let has_paragraphs = self.children().any(|child| is_paragraph(child.name));
        for content in &self.content {
            match content {
                Content::Text(piece) if has_paragraphs && piece.text.trim().is_empty() => {}
                Content::Text(piece) => pieces.push(piece.clone()),
                Content::Element(element) => {
                    if is_paragraph(element.name) && !pieces.is_empty() {
                        pieces.push(Piece { text: Cow::Borrowed("\n"), at: element.open.clone() });
                    }
                    element.collect(pieces);
                }
            }
        }
    }
}

fn is_paragraph(name: &str) -> bool {
    matches!(name, "p" | "br" | "div")
}

/// Reads a text. What is returned is the outermost element.
pub(super) fn parse(text: &str) -> Result<Element<'_>, XmlError> {
    Builder { text, open: Vec::new(), root: None, elements: 0, pieces: 0 }.document()
}

struct Builder<'a> {
    text: &'a str,
    open: Vec<Element<'a>>,
    root: Option<Element<'a>>,
    elements: usize,
    pieces: usize,
}

fn error<T>(at: Range<usize>, message: impl Into<String>, help: &'static str) -> Result<T, XmlError> {
    Err(XmlError { at, message: message.into(), help })
}

const REPAIR: &str = "export the file again; it is damaged or was edited by hand";
const TOO_MUCH: &str = "no export of a project looks like this; split the project if it does";

impl<'a> Builder<'a> {
    fn document(mut self) -> Result<Element<'a>, XmlError> {
        let mut reader = Reader::from_str(self.text);
        loop {
            let start = reader.buffer_position() as usize;
            let event = match reader.read_event() {
                Ok(event) => event,
                Err(problem) => return self.not_well_formed(&problem, reader.error_position() as usize),
            };
            let at = start..reader.buffer_position() as usize;
            if matches!(event, Event::Eof) {
                break;
            }
            self.event(event, at)?;
        }
        if let Some(open) = self.open.pop() {
            return error(open.open, format!("<{}> is not closed", open.name), REPAIR);
        }
        let end = self.text.len();
        self.root.map_or_else(|| error(end..end, "expected an XML element, found the end of the file", REPAIR), Ok)
    }

    fn not_well_formed(&self, problem: &quick_xml::Error, at: usize) -> Result<Element<'a>, XmlError> {
        let at = at.min(self.text.len());
        let end = self.text[at..].char_indices().nth(1).map_or(self.text.len(), |(length, _)| at + length);
        error(at..end, format!("this is not well-formed XML: {problem}"), REPAIR)
    }

    fn event(&mut self, event: Event<'a>, at: Range<usize>) -> Result<(), XmlError> {
        match event {
            Event::Start(tag) => self.start(&tag, at),
            Event::Empty(tag) => {
                self.start(&tag, at.clone())?;
                self.end(at)
            }
            Event::End(_) => self.end(at),
            Event::Text(_) => self.piece(Cow::Borrowed(&self.text[at.clone()]), at),
            Event::CData(_) => {
                let inner = at.start + "<![CDATA[".len()..at.end - "]]>".len();
                self.piece(Cow::Borrowed(&self.text[inner.clone()]), inner)
            }
            Event::GeneralRef(reference) => {
                let text = character(&reference, &at)?;
                self.piece(Cow::Owned(text.to_string()), at)
            }
            Event::DocType(_) => {
                let help = "remove the DOCTYPE; TwinCAT and CODESYS write none";
                let start = at.start + self.text[at.clone()].find('<').unwrap_or(0);
                error(start..at.end, "a document type definition (DTD) is refused: it can name other files and grow without bound", help)
            }
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::Eof => Ok(()),
        }
    }

    fn start(&mut self, tag: &BytesStart<'a>, at: Range<usize>) -> Result<(), XmlError> {
        self.elements += 1;
        if self.open.len() >= DEPTH {
            return error(at, format!("elements are nested more than {DEPTH} deep"), TOO_MUCH);
        }
        if self.elements > ELEMENTS {
            return error(at, format!("the file has more than {ELEMENTS} elements"), TOO_MUCH);
        }
        if self.open.is_empty() && self.root.is_some() {
            return error(at, "a second outermost element; XML has one", REPAIR);
        }
        let name_at = at.start + 1..at.start + 1 + tag.name().as_ref().len();
        let name = local(&self.text[name_at.clone()]);
        let attributes = self.attributes(name_at.end..at.end)?;
        self.open.push(Element { name, close: at.clone(), open: at, attributes, content: Vec::new() });
        Ok(())
    }

    /// Attributes of a tag, behind its name.
    fn attributes(&self, at: Range<usize>) -> Result<Vec<Attribute<'a>>, XmlError> {
        let mut list: Vec<Attribute<'a>> = Vec::new();
        let mut here = at.start;
        loop {
            let rest = &self.text[here..at.end];
            here += rest.len() - rest.trim_start().len();
            let rest = rest.trim_start();
            if rest.is_empty() || rest.starts_with(['/', '>']) {
                return Ok(list);
            }
            let (attribute, end) = self.attribute(here..at.end)?;
            if list.iter().any(|known| known.name == attribute.name) {
                return error(here..end, format!("the attribute `{}` is given twice", attribute.name), REPAIR);
            }
            if list.len() >= ATTRIBUTES {
                return error(here..end, format!("an element has more than {ATTRIBUTES} attributes"), TOO_MUCH);
            }
            list.push(attribute);
            here = end;
        }
    }

    /// `name="value"`, and where it ends.
    fn attribute(&self, at: Range<usize>) -> Result<(Attribute<'a>, usize), XmlError> {
        let rest = &self.text[at.clone()];
        let wrong = || error(at.start..at.start + rest.chars().next().map_or(0, char::len_utf8), "expected name=\"value\"", REPAIR);
        let Some((name, behind)) = rest.split_once('=') else { return wrong() };
        let quoted = behind.trim_start();
        let Some(quote) = quoted.chars().next().filter(|c| matches!(c, '"' | '\'')) else { return wrong() };
        let start = at.start + rest.len() - quoted.len() + 1;
        let Some(length) = self.text[start..at.end].find(quote) else { return wrong() };
        let name = name.trim_end();
        if name.is_empty() || name.contains(|c: char| c.is_whitespace() || matches!(c, '"' | '\'' | '<' | '>')) {
            return wrong();
        }
        let place = start..start + length;
        let value = quick_xml::escape::unescape(&self.text[place.clone()]);
        let Ok(value) = value else {
            return error(place, "an entity that XML does not know", "only &lt; &gt; &amp; &quot; &apos; and numbers like &#10; are known");
        };
        Ok((Attribute { name, value, at: place }, start + length + 1))
    }

    fn end(&mut self, at: Range<usize>) -> Result<(), XmlError> {
        let Some(mut element) = self.open.pop() else { return error(at, "a closing tag without its opening one", REPAIR) };
        element.close = at;
        match self.open.last_mut() {
            Some(outer) => outer.content.push(Content::Element(element)),
            None => self.root = Some(element),
        }
        Ok(())
    }

    fn piece(&mut self, text: Cow<'a, str>, at: Range<usize>) -> Result<(), XmlError> {
        self.pieces += 1;
        if self.pieces > PIECES {
            return error(at, format!("the file has more than {PIECES} pieces of text"), TOO_MUCH);
        }
        match self.open.last_mut() {
            Some(element) => element.content.push(Content::Text(Piece { text, at })),
            None if text.trim().is_empty() => {}
            None => {
                let start = at.start + text.len() - text.trim_start().len();
                let end = start + text.trim_start().chars().next().map_or(0, char::len_utf8);
                return error(start..end.min(at.end).max(start), "expected `<`, found text outside of any element", REPAIR);
            }
        }
        Ok(())
    }
}

/// A name without its prefix.
fn local(name: &str) -> &str {
    name.rsplit_once(':').map_or(name, |(_, local)| local)
}

fn character(reference: &quick_xml::events::BytesRef<'_>, at: &Range<usize>) -> Result<char, XmlError> {
    let known = match reference.as_ref() {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => reference.resolve_char_ref().ok().flatten(),
    };
    let help = "only &lt; &gt; &amp; &quot; &apos; and numbers like &#10; are known; nothing is fetched or expanded";
    known.map_or_else(|| error(at.clone(), format!("the entity `&{};` is not known", reference.as_ref()), help), Ok)
}

#[cfg(test)]
mod tests;
