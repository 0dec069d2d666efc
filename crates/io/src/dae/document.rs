//! The text of a file, and access to its elements.

use std::borrow::Cow;
use std::collections::HashMap;

use super::tree::DaeElement;
use crate::error::{ReadError, Warning};
use crate::excerpt::{excerpt, excerpt_of_bytes};
use crate::numbers::{parse_decimal, parse_non_number};

/// Returns the bytes as text, in the encoding that the XML declares; UTF-8 if it declares none.
///
/// Of encodings other than UTF-8 and Latin-1 only ASCII is read, which is all but names: each of their other bytes
/// becomes one character, so that names stay distinct, with a warning.
pub(super) fn text_of(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<Warning>), ReadError> {
    let encoding = match str::from_utf8(bytes) {
        Ok(text) => return Ok((Cow::Borrowed(text), None)),
        Err(e) => declared_encoding(bytes).ok_or_else(|| {
            ReadError::byte(e.valid_up_to(), "the text is not UTF-8: save the file with that encoding")
        })?,
    };
    let text = bytes.iter().map(|&byte| windows_1252(byte)).collect();
    let is_known = ["iso-8859-1", "iso8859-1", "iso_8859-1", "latin1", "windows-1252", "cp1252", "us-ascii"]
        .iter()
        .any(|name| encoding.eq_ignore_ascii_case(name));
    let warning = (!is_known).then(|| {
        Warning::lost(format!(
            "the encoding `{}` is not known: letters of names beyond ASCII are wrong; save the file as UTF-8",
            excerpt(encoding)
        ))
    });
    Ok((Cow::Owned(text), warning))
}

/// Returns the encoding that an XML declaration names, if it is not UTF-8.
fn declared_encoding(bytes: &[u8]) -> Option<&str> {
    // A declaration is the first thing in a file, and short.
    let end = memchr::memmem::find(&bytes[..bytes.len().min(256)], b"?>")?;
    let declaration = str::from_utf8(&bytes[..end]).ok()?.strip_prefix("<?xml")?;
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let name = value[1..].split_once(quote)?.0.trim();
    (!name.eq_ignore_ascii_case("utf-8") && !name.eq_ignore_ascii_case("utf8")).then_some(name)
}

/// Returns the character of a byte in Windows-1252, which browsers read for Latin-1 too. Its five bytes without a
/// character are control characters, as in Latin-1.
fn windows_1252(byte: u8) -> char {
    const FROM_0X80: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
        '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
    ];
    match byte {
        0x80..=0x9f => FROM_0X80[usize::from(byte - 0x80)],
        other => char::from(other),
    }
}

/// Elements by their ids, and the references to elements that are missing.
pub(super) struct Ids<'a> {
    elements: HashMap<&'a str, DaeElement<'a>>,
    /// By the tag of what is missing: the first error, and the number of references.
    dangling: Vec<(&'static str, ReadError, usize)>,
}

impl<'a> Ids<'a> {
    pub(super) fn new(root: DaeElement<'a>) -> Self {
        let mut elements = HashMap::new();
        for element in root.descendants() {
            if let Some(id) = element.attribute("id") {
                elements.entry(id).or_insert(element);
            }
        }
        Self { elements, dangling: Vec::new() }
    }

    /// Returns the element with the id of a reference (`#id`).
    pub(super) fn find(&self, reference: &str) -> Option<DaeElement<'a>> {
        self.elements.get(reference.strip_prefix('#')?).copied()
    }

    /// Returns the element with an id.
    pub(super) fn get(&self, id: &str) -> Option<DaeElement<'a>> {
        self.elements.get(id).copied()
    }

    /// Returns the element that an attribute of an element refers to, if it has this tag; if it is missing, that is
    /// noted, and the caller goes on without it.
    pub(super) fn target_or_note(
        &mut self,
        from: DaeElement<'a>,
        attribute: &str,
        tag: &'static str,
    ) -> Option<DaeElement<'a>> {
        let reference = from.attribute(attribute).unwrap_or_default();
        let found = self.find(reference).filter(|e| e.tag() == tag);
        if found.is_none() {
            if let Some((_, _, count)) = self.dangling.iter_mut().find(|(of, ..)| *of == tag) {
                *count += 1;
            } else {
                let problem = if reference.is_empty() || reference.starts_with('#') {
                    format!("there is no {tag} `{}`", excerpt(reference))
                } else {
                    format!("the {tag} `{}` is in another file, which is not read", excerpt(reference))
                };
                self.dangling.push((tag, error(from, problem), 1));
            }
        }
        found
    }

    /// Returns a warning for each kind of element that is missing, with the first reference to one. If nothing else is
    /// in the file, the first is an error.
    pub(super) fn dangling(&mut self, is_empty: bool) -> Result<Vec<Warning>, ReadError> {
        let mut all = std::mem::take(&mut self.dangling);
        if is_empty && !all.is_empty() {
            return Err(all.swap_remove(0).1);
        }
        let warning = |(tag, error, count): (&str, ReadError, usize)| {
            let more = match count {
                1 => String::new(),
                _ => format!(" ({count} such references in all)"),
            };
            let lost = match tag {
                "material" => "its faces get no material",
                "effect" => "the material is plain",
                "visual_scene" => "the first scene is read",
                _ => "left out",
            };
            Warning::lost(format!("{error}{more}: {lost}"))
        };
        Ok(all.into_iter().map(warning).collect())
    }
}

/// Creates an error about an element.
pub(super) fn error(element: DaeElement<'_>, problem: impl Into<String>) -> ReadError {
    let line = element.line();
    let id = element.attribute("id").map(|id| format!(" `{}`", excerpt(id))).unwrap_or_default();
    ReadError::element(format!("line {line}, <{}>{id}", excerpt(element.tag())), problem)
}

/// Returns the children with a tag.
pub(super) fn children<'a>(element: DaeElement<'a>, tag: &'a str) -> impl Iterator<Item = DaeElement<'a>> {
    element.children().filter(move |c| c.tag() == tag)
}

/// Returns the first child with a tag.
pub(super) fn child<'a>(element: DaeElement<'a>, tag: &'a str) -> Option<DaeElement<'a>> {
    children(element, tag).next()
}

/// Follows a path of first children.
pub(super) fn descend<'a>(element: DaeElement<'a>, path: &[&'a str]) -> Option<DaeElement<'a>> {
    path.iter().try_fold(element, |at, tag| child(at, tag))
}

/// Returns the numbers in the text of an element.
pub(super) fn numbers(element: DaeElement<'_>) -> Result<Vec<f64>, ReadError> {
    let mut numbers = Vec::new();
    for word in element.text().split_ascii_whitespace() {
        match parse_decimal(word.as_bytes()) {
            Some((number, length)) if length == word.len() => numbers.push(number.value),
            _ => numbers.push(parse_non_number(word.as_bytes()).ok_or_else(|| {
                error(element, format!("`{}` is not a number", excerpt_of_bytes(word.as_bytes())))
            })?),
        }
    }
    Ok(numbers)
}

/// Returns the whole numbers in the text of an element.
pub(super) fn whole_numbers(element: DaeElement<'_>) -> Result<Vec<u32>, ReadError> {
    let mut numbers = Vec::new();
    for word in element.text().split_ascii_whitespace() {
        let problem = || error(element, format!("`{}` is not a whole number from 0", excerpt(word)));
        numbers.push(word.parse().map_err(|_| problem())?);
    }
    Ok(numbers)
}
