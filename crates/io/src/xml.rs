//! XML as a stream of events, for the readers of 3MF and COLLADA.
//!
//! A document type is an error, so no entity but the five of XML is ever expanded.

use quick_xml::Reader;
use quick_xml::events::Event;

/// The problem of an event.
pub(crate) type Problem = String;

/// Passes each event of a text to `take`, with the byte after it. Returns the line, from 1, and the problem of the first
/// event that is damaged, a document type, or refused by `take`.
pub(crate) fn parse_events(
    text: &[u8],
    mut take: impl FnMut(&Event<'_>, usize) -> Result<(), Problem>,
) -> Result<(), (usize, Problem)> {
    let mut reader = Reader::from_reader(text);
    loop {
        let at = reader.buffer_position() as usize;
        let result = match reader.read_event() {
            Ok(Event::Eof) => return Ok(()),
            Ok(Event::DocType(_)) => {
                Err("it has a document type declaration, which is not supported: remove that line".to_owned())
            }
            Ok(event) => take(&event, reader.buffer_position() as usize),
            Err(e) => Err(format!("the XML is damaged: {e}")),
        };
        if let Err(problem) = result {
            return Err((line_of(text, at), problem));
        }
    }
}

/// Returns the line, from 1, of the first byte from this one on that is not blank.
pub(crate) fn line_of(text: &[u8], at: usize) -> usize {
    let at = at.min(text.len());
    let blanks = text[at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    memchr::memchr_iter(b'\n', &text[..at + blanks]).count() + 1
}
