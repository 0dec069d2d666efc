//! Excerpts of files for messages: short enough for a terminal line, with control characters escaped.

/// Returns an excerpt of a word or a name.
pub(crate) fn excerpt(text: &str) -> String {
    // Guessed: long enough to be found, short enough to be read.
    const MAX_CHARS: usize = 60;
    let mut shown = String::new();
    for c in text.chars().take(MAX_CHARS) {
        if c.is_control() {
            shown.extend(c.escape_debug());
        } else {
            shown.push(c);
        }
    }
    if text.chars().nth(MAX_CHARS).is_some() {
        shown.push('…');
    }
    shown
}

/// Returns an excerpt of a word in any encoding.
pub(crate) fn excerpt_of_bytes(word: &[u8]) -> String {
    // A character has at most four bytes.
    excerpt(&String::from_utf8_lossy(&word[..word.len().min(300)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excerpts_are_short_and_harmless() {
        assert_eq!(excerpt_of_bytes("ü\u{1b}[2J \"a\"".as_bytes()), "ü\\u{1b}[2J \"a\"");
        assert_eq!(excerpt(&"x".repeat(61)), format!("{}…", "x".repeat(60)));
        assert_eq!(excerpt_of_bytes(&[0xff; 1000]).chars().count(), 61);
    }
}
