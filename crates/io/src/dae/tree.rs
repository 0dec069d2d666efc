//! The XML of a file as a tree, from the events of `quick-xml`.
//!
//! Time and memory are proportional to the text.

use std::borrow::Cow;
use std::ops::Range;

use quick_xml::events::attributes::Attributes;
use quick_xml::events::{BytesStart, Event};

use crate::error::ReadError;
use crate::excerpt::excerpt;
use crate::limits::Limits;
use crate::xml::{line_of, parse_events};

/// An XML document.
pub(super) struct XmlTree<'a> {
    text: &'a str,
    /// In the order of the text: the descendants of an element follow it.
    elements: Vec<XmlElement<'a>>,
    /// Names with their prefixes, and values.
    attributes: Vec<(&'a str, Cow<'a, str>)>,
}

struct XmlElement<'a> {
    /// Without a prefix.
    tag: &'a str,
    attributes: Range<usize>,
    /// All text directly in it; a blank is between what comments or elements separate.
    text: Cow<'a, str>,
    /// The first byte of its tag.
    at: usize,
    /// The index of the element after its descendants.
    end: usize,
}

/// An element of a tree.
#[derive(Clone, Copy)]
pub(super) struct DaeElement<'a> {
    tree: &'a XmlTree<'a>,
    index: usize,
}

/// Of elements of one tree.
impl PartialEq for DaeElement<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index
    }
}

impl<'a> DaeElement<'a> {
    fn data(self) -> &'a XmlElement<'a> {
        &self.tree.elements[self.index]
    }

    /// Returns its tag without a prefix.
    pub(super) fn tag(self) -> &'a str {
        self.data().tag
    }

    /// Returns an attribute; its name has no prefix.
    pub(super) fn attribute(self, name: &str) -> Option<&'a str> {
        let attributes = &self.tree.attributes[self.data().attributes.clone()];
        attributes.iter().find(|(key, _)| *key == name).map(|(_, value)| &**value)
    }

    /// Returns the text directly in it; a blank is between what comments or elements separate.
    pub(super) fn text(self) -> &'a str {
        &self.data().text
    }

    /// Returns its children in order.
    pub(super) fn children(self) -> impl Iterator<Item = Self> {
        let (tree, end) = (self.tree, self.data().end);
        let from = move |index: usize| (index < end).then_some(Self { tree, index });
        std::iter::successors(from(self.index + 1), move |child| from(child.data().end))
    }

    /// Returns itself and all elements below it.
    pub(super) fn descendants(self) -> impl Iterator<Item = Self> {
        let tree = self.tree;
        (self.index..self.data().end).map(move |index| Self { tree, index })
    }

    /// Returns the line on which it begins, from 1.
    pub(super) fn line(self) -> usize {
        line_of(self.tree.text.as_bytes(), self.data().at)
    }
}

impl<'a> XmlTree<'a> {
    /// Parses a text.
    pub(super) fn parse(text: &'a str, limits: Limits) -> Result<Self, ReadError> {
        let count = |byte: u8| memchr::memchr_iter(byte, text.as_bytes()).count();
        let of_elements = count(b'<').saturating_mul(size_of::<XmlElement<'_>>());
        let of_attributes = count(b'=').saturating_mul(size_of::<(&str, Cow<'_, str>)>());
        // A list that grows is there twice, at half of its final size and at up to twice of it.
        let lists = (of_elements as u64).saturating_add(of_attributes as u64).saturating_mul(3);
        limits.check_memory("reading COLLADA", lists.saturating_add(text.len() as u64 * 2))?;
        let tree = Self { text, elements: Vec::new(), attributes: Vec::new() };
        let mut builder = TreeBuilder { tree, open: Vec::new(), is_separated: false };
        let take = |event: &Event<'_>, end| {
            builder.take(event, end).map_err(|problem| format!("the XML is damaged: {problem}"))
        };
        parse_events(text.as_bytes(), take).map_err(|(line, problem)| ReadError::line(line, problem))?;
        if let Some(&index) = builder.open.last() {
            let open = DaeElement { tree: &builder.tree, index };
            let problem = format!("the XML is damaged: <{}> has no end", excerpt(open.tag()));
            return Err(ReadError::line(open.line(), problem));
        }
        if builder.tree.elements.is_empty() {
            return Err(ReadError::line(1, "the XML is damaged: it has no element"));
        }
        Ok(builder.tree)
    }

    /// Returns the element that holds all others.
    pub(super) fn root(&'a self) -> DaeElement<'a> {
        DaeElement { tree: self, index: 0 }
    }
}

struct TreeBuilder<'a> {
    tree: XmlTree<'a>,
    /// The elements that have not ended.
    open: Vec<usize>,
    /// True if a comment or an element is between the text so far and what follows.
    is_separated: bool,
}

impl<'a> TreeBuilder<'a> {
    /// Takes an event, which ends at a byte of the text.
    fn take(&mut self, event: &Event<'_>, end: usize) -> Result<(), String> {
        let text = self.tree.text;
        match event {
            Event::Start(e) => {
                self.begin(e, end - 1 - e.len())?;
                self.open.push(self.tree.elements.len() - 1);
            }
            Event::Empty(e) => self.begin(e, end - 2 - e.len())?,
            Event::End(_) => {
                let count = self.tree.elements.len();
                if let Some(ended) = self.open.pop() {
                    self.tree.elements[ended].end = count;
                }
                self.is_separated = true;
            }
            Event::Text(e) => self.add_text(Cow::Borrowed(&text[end - e.len()..end]))?,
            Event::CData(e) => self.add_text(Cow::Borrowed(&text[end - 3 - e.len()..end - 3]))?,
            // The reader returns `&lt;` and other entities separately from the text around them.
            Event::GeneralRef(name) => {
                let name = name.decode().map_err(|e| e.to_string())?;
                let text = quick_xml::escape::unescape(&format!("&{name};"))
                    .map_err(|e| e.to_string())?
                    .into_owned();
                self.add_text(Cow::Owned(text))?;
            }
            _ => self.is_separated = true,
        }
        Ok(())
    }

    /// Begins an element whose tag is at a byte of the text.
    fn begin(&mut self, event: &BytesStart<'_>, at: usize) -> Result<(), String> {
        if self.open.is_empty() && !self.tree.elements.is_empty() {
            return Err("it has several outermost elements".to_owned());
        }
        let content = &self.tree.text[at..at + event.len()];
        let name = &content[..event.name().as_ref().len()];
        let first = self.tree.attributes.len();
        for attribute in Attributes::new(content, name.len()).with_checks(false) {
            let problem = |e: &dyn std::fmt::Display| format!("an attribute of <{}>: {e}", excerpt(name));
            let attribute = attribute.map_err(|e| problem(&e))?;
            let Cow::Borrowed(value) = attribute.value else { continue };
            let (key, value) = (str::from_utf8(attribute.key.0), str::from_utf8(value));
            let (key, value) = (key.map_err(|e| problem(&e))?, value.map_err(|e| problem(&e))?);
            self.tree.attributes.push((key, quick_xml::escape::unescape(value).map_err(|e| problem(&e))?));
        }
        let index = self.tree.elements.len();
        self.tree.elements.push(XmlElement {
            tag: name.rsplit_once(':').map_or(name, |(_, tag)| tag),
            attributes: first..self.tree.attributes.len(),
            text: Cow::Borrowed(""),
            at,
            end: index + 1,
        });
        self.is_separated = true;
        Ok(())
    }

    fn add_text(&mut self, more: Cow<'a, str>) -> Result<(), String> {
        let is_blank = more.trim_ascii().is_empty();
        let Some(open) = self.open.last() else {
            return if is_blank { Ok(()) } else { Err("text is outside of all elements".to_owned()) };
        };
        let text = &mut self.tree.elements[*open].text;
        if text.is_empty() {
            if !is_blank {
                *text = more;
            }
        } else if !(is_blank && self.is_separated) {
            let text = text.to_mut();
            if self.is_separated {
                text.push(' ');
            }
            text.push_str(&more);
        }
        self.is_separated = false;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<XmlTree<'_>, ReadError> {
        XmlTree::parse(text, Limits::default())
    }

    #[test]
    fn elements_have_their_children_attributes_and_text() {
        let tree = parse(
            "<?xml version=\"1.0\"?>\n<a:top xmlns:a=\"u\" id='x &amp; y'>\n<one>1<!-- -->2</one>\n<a:two n=\"&#65;\" a:n=\"b\"/>\
             <three>p &lt; <![CDATA[<q>]]> r&#x41;</three>\n</a:top>\n",
        )
        .unwrap();
        let top = tree.root();
        let tags: Vec<_> = top.children().map(DaeElement::tag).collect();
        assert_eq!((top.tag(), top.attribute("id"), top.text()), ("top", Some("x & y"), ""));
        assert_eq!((tags, top.descendants().count()), (vec!["one", "two", "three"], 4));
        let [one, two, three] = [0, 1, 2].map(|i| top.children().nth(i).unwrap());
        assert_eq!((one.text(), two.attribute("n"), two.attribute("m")), ("1 2", Some("A"), None));
        assert_eq!((three.text(), one.line(), three.line()), ("p < <q> rA", 3, 4));
    }

    #[test]
    fn damaged_text_is_an_error_with_its_line() {
        for (text, line, problem) in [
            ("", 1, "no element"),
            ("<a>\n<b>\n</a>", 3, "damaged"),
            ("<a>\n<b>\n", 2, "<b> has no end"),
            ("<a/>\n<b/>", 2, "several outermost elements"),
            ("<a/>\nword", 2, "text is outside"),
            ("<a>\n&none;</a>", 2, "none"),
            ("<a>\n<b c=\"&none;\"/></a>", 2, "none"),
            ("<a>\n<b c=1/></a>", 2, "attribute"),
            ("<!DOCTYPE a [<!ENTITY b \"c\">]>\n<a>&b;</a>", 1, "document type"),
            ("<a>\n<b", 2, "damaged"),
        ] {
            let error = parse(text).err().unwrap_or_else(|| panic!("{text} is read"));
            let said = error.to_string();
            assert!(said.contains(&format!("line {line}:")) && said.contains(problem), "{text}: {said}");
        }
    }

    /// Trees that resolve namespaces and compare attributes take hours for these.
    #[test]
    fn nested_namespaces_and_many_attributes_are_read() {
        let depth = 50_000;
        let open: String = (0..depth).map(|i| format!("<a xmlns:a{i}=\"u{i}\">")).collect();
        let nested = open + &"</a>".repeat(depth);
        let tree = parse(&nested).unwrap();
        assert_eq!(tree.root().descendants().count(), depth);
        let attributes: String = (0..depth).map(|i| format!(" b{i}=\"{i}\"")).collect();
        let wide = format!("<a{attributes}/>");
        assert_eq!(parse(&wide).unwrap().root().attribute("b49999"), Some("49999"));
    }
}
