//! Text of XML that is written.

/// Returns a text for XML, with characters that it cannot hold replaced.
pub(super) fn escaped(text: &str) -> String {
    let is_space = |c: char| matches!(c, '\t' | '\n' | '\r');
    let is_bad = |c: char| (c.is_control() && !is_space(c)) || matches!(c, '\u{fffe}' | '\u{ffff}');
    let plain: String = text.chars().map(|c| if is_bad(c) { '_' } else { c }).collect();
    let text = quick_xml::escape::escape(&plain);
    // Readers make blanks of them in attributes.
    text.replace('\t', "&#9;").replace('\n', "&#10;").replace('\r', "&#13;")
}
