//! The XML tree, and access to its elements.

use std::collections::HashMap;

use roxmltree::{Document, Node, ParsingOptions};

use crate::error::ReadError;
use crate::excerpt::{excerpt, excerpt_of_bytes};
use crate::limits::Limits;
use crate::numbers::parse_decimal;

/// An element.
pub(super) type DaeElement<'a> = Node<'a, 'a>;

/// Bytes of memory of a node of the tree, with its attributes. (Measured: 72, and 48 for each attribute.)
const BYTES_PER_NODE: u64 = 256;

/// Returns the bytes as text, which they must be.
pub(super) fn text_of(bytes: &[u8]) -> Result<&str, ReadError> {
    str::from_utf8(bytes).map_err(|e| {
        ReadError::byte(e.valid_up_to(), "the text is not UTF-8: save the file with that encoding")
    })
}

/// Parses a text. There may be no document type, so no entity but the five of XML is ever expanded.
pub(super) fn parse(text: &str, limits: Limits) -> Result<Document<'_>, ReadError> {
    // An element has at least four bytes.
    let nodes = memchr::memchr_iter(b'<', text.as_bytes()).count() as u64 * 2;
    let need = (text.len() as u64).saturating_mul(4).saturating_add(nodes.saturating_mul(BYTES_PER_NODE));
    limits.check_memory("reading COLLADA", need)?;
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| {
        let line = e.pos().row as usize;
        let problem = match e {
            roxmltree::Error::DtdDetected => {
                "the XML has a document type declaration, which is not supported: remove that line".to_owned()
            }
            e => format!("the XML is damaged: {e}"),
        };
        ReadError::line(line, problem)
    })
}

/// Elements by their ids.
pub(super) struct Ids<'a>(HashMap<&'a str, DaeElement<'a>>);

impl<'a> Ids<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        let mut ids = HashMap::new();
        for element in document.descendants().filter(Node::is_element) {
            if let Some(id) = element.attribute("id") {
                ids.entry(id).or_insert(element);
            }
        }
        Self(ids)
    }

    /// Returns the element with the id of a reference (`#id`).
    pub(super) fn find(&self, reference: &str) -> Option<DaeElement<'a>> {
        self.0.get(reference.strip_prefix('#')?).copied()
    }

    /// Returns the element with an id.
    pub(super) fn get(&self, id: &str) -> Option<DaeElement<'a>> {
        self.0.get(id).copied()
    }

    /// Returns the element that an attribute of an element refers to, if it has this tag.
    pub(super) fn target(
        &self,
        from: DaeElement<'a>,
        attribute: &str,
        tag: &str,
    ) -> Result<DaeElement<'a>, ReadError> {
        let reference = from.attribute(attribute).unwrap_or_default();
        let found = self.find(reference).filter(|e| e.tag_name().name() == tag);
        found.ok_or_else(|| {
            let problem = if reference.is_empty() || reference.starts_with('#') {
                format!("there is no {tag} `{}`", excerpt(reference))
            } else {
                format!("the {tag} `{}` is in another file, which is not read", excerpt(reference))
            };
            error(from, problem)
        })
    }
}

/// Creates an error about an element.
pub(super) fn error(element: DaeElement<'_>, problem: impl Into<String>) -> ReadError {
    let line = element.document().text_pos_at(element.range().start).row;
    let id = element.attribute("id").map(|id| format!(" `{}`", excerpt(id))).unwrap_or_default();
    ReadError::element(format!("line {line}, <{}>{id}", excerpt(element.tag_name().name())), problem)
}

/// Returns the children with a tag.
pub(super) fn children<'a>(element: DaeElement<'a>, tag: &'a str) -> impl Iterator<Item = DaeElement<'a>> {
    element.children().filter(move |c| c.is_element() && c.tag_name().name() == tag)
}

/// Returns the first child with a tag.
pub(super) fn child<'a>(element: DaeElement<'a>, tag: &'a str) -> Option<DaeElement<'a>> {
    children(element, tag).next()
}

/// Follows a path of first children.
pub(super) fn descend<'a>(element: DaeElement<'a>, path: &[&'a str]) -> Option<DaeElement<'a>> {
    path.iter().try_fold(element, |at, tag| child(at, tag))
}

/// Returns the text of an element.
pub(super) fn text<'a>(element: DaeElement<'a>) -> &'a str {
    element.text().unwrap_or_default()
}

/// Returns the numbers in the text of an element.
pub(super) fn numbers(element: DaeElement<'_>) -> Result<Vec<f64>, ReadError> {
    let mut numbers = Vec::new();
    // Comments split a text into several.
    for piece in element.children().filter(Node::is_text) {
        for word in piece.text().unwrap_or_default().split_ascii_whitespace() {
            match parse_decimal(word.as_bytes()) {
                Some((number, length)) if length == word.len() => numbers.push(number.value),
                _ => {
                    return Err(error(
                        element,
                        format!("`{}` is not a number", excerpt_of_bytes(word.as_bytes())),
                    ));
                }
            }
        }
    }
    Ok(numbers)
}

/// Returns the whole numbers in the text of an element.
pub(super) fn whole_numbers(element: DaeElement<'_>) -> Result<Vec<u32>, ReadError> {
    let mut numbers = Vec::new();
    for piece in element.children().filter(Node::is_text) {
        for word in piece.text().unwrap_or_default().split_ascii_whitespace() {
            let problem = || error(element, format!("`{}` is not a whole number from 0", excerpt(word)));
            numbers.push(word.parse().map_err(|_| problem())?);
        }
    }
    Ok(numbers)
}
