//! A cursor over lines of words and numbers, which counts lines.

use std::borrow::Cow;

use crate::error::ReadError;
use crate::excerpt::excerpt_of_bytes;
use crate::numbers::{Decimal, parse_decimal, parse_integer, parse_non_number};

/// A cursor in a text.
#[derive(Clone, Debug)]
pub(crate) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The current line, counted from 1.
    line: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }
    /// The current line, counted from 1.
    pub(crate) fn line(&self) -> usize {
        self.line
    }
    /// Creates an error about this line.
    #[cold]
    pub(crate) fn error(&self, problem: impl Into<String>) -> ReadError {
        ReadError::line(self.line, problem)
    }
    /// Returns all remaining bytes, beginning with the rest of this line.
    #[inline]
    pub(crate) fn remaining(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }
    /// Returns the next byte; a line end at the end of the file.
    #[inline]
    pub(crate) fn peek(&self) -> u8 {
        self.bytes.get(self.at).copied().unwrap_or(b'\n')
    }
    /// Skips this many bytes, none of them a line end.
    #[inline]
    pub(crate) fn skip_bytes(&mut self, count: usize) {
        self.at += count;
    }
    /// Returns true at the end of the file.
    #[inline]
    pub(crate) fn at_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// Skips blanks, and line ends after a backslash.
    #[inline]
    pub(crate) fn skip_blanks(&mut self) {
        loop {
            match self.peek() {
                b' ' | b'\t' | b'\r' => self.at += 1,
                b'\\' => {
                    if !self.skip_continuation() {
                        return;
                    }
                }
                _ => return,
            }
        }
    }

    #[cold]
    fn skip_continuation(&mut self) -> bool {
        let length = match self.remaining() {
            [b'\\', b'\n', ..] => 2,
            [b'\\', b'\r', b'\n', ..] => 3,
            _ => return false,
        };
        self.at += length;
        self.line += 1;
        true
    }

    /// Skips blanks; returns true if the line ends there or a comment begins.
    #[inline]
    pub(crate) fn at_line_end(&mut self) -> bool {
        self.skip_blanks();
        matches!(self.peek(), b'\n' | b'#')
    }

    /// Moves to the start of the next line.
    #[inline]
    pub(crate) fn next_line(&mut self) {
        if self.peek() == b'\n' {
            self.at = self.bytes.len().min(self.at + 1);
        } else {
            self.at = memchr::memchr(b'\n', self.remaining()).map_or(self.bytes.len(), |n| self.at + n + 1);
        }
        self.line += 1;
    }

    /// Moves to the start of the next line that does not continue this one.
    pub(crate) fn next_logical_line(&mut self) {
        loop {
            let start = self.at;
            self.next_line();
            let line = self.bytes[start..self.at].strip_suffix(b"\n").unwrap_or_default();
            if !line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\") {
                return;
            }
        }
    }

    /// Returns the next word, up to a blank or line end.
    pub(crate) fn word(&self) -> &'a [u8] {
        let ahead = self.remaining();
        &ahead[..ahead.iter().position(|b| b" \t\r\n".contains(b)).unwrap_or(ahead.len())]
    }

    /// Returns the rest of this line and of its continuation lines, without blanks around it.
    pub(crate) fn rest_with_continuations(&self) -> Cow<'a, [u8]> {
        let mut end = self.clone();
        end.next_logical_line();
        let line = self.bytes[self.at..end.at].trim_ascii();
        if !line.contains(&b'\n') {
            return Cow::Borrowed(line);
        }
        let without_end = |line: &'a [u8]| {
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            line.strip_suffix(b"\\").unwrap_or(line)
        };
        let parts: Vec<&[u8]> = line.split(|&b| b == b'\n').map(without_end).collect();
        Cow::Owned(parts.join(&b' '))
    }

    /// Reads a number; the caller has skipped the blanks before it.
    ///
    /// # Errors
    /// If there is none, or other characters follow it directly.
    #[inline]
    pub(crate) fn decimal(&mut self) -> Result<Decimal, ReadError> {
        match parse_decimal(self.remaining()) {
            Some((number, length)) if is_blank(self.bytes.get(self.at + length)) => {
                self.at += length;
                Ok(number)
            }
            other => self.unusual_decimal(other),
        }
    }

    /// Reads a number that a comment or a continuation follows directly, or the spelling of what is no number
    /// (`-nan(ind)`, `1.#QNAN`).
    #[cold]
    fn unusual_decimal(&mut self, decimal: Option<(Decimal, usize)>) -> Result<Decimal, ReadError> {
        let word = self.word();
        if let Some(value) = parse_non_number(word) {
            self.at += word.len();
            return Ok(Decimal::non_number(value));
        }
        match decimal {
            Some((number, length)) if is_end_of_word(self.bytes.get(self.at + length)) => {
                self.at += length;
                Ok(number)
            }
            _ => Err(self.expected_error("number")),
        }
    }

    /// Reads an integer; the caller checks what follows.
    ///
    /// # Errors
    /// If there is none.
    #[inline]
    pub(crate) fn whole(&mut self) -> Result<i64, ReadError> {
        match parse_integer(self.remaining()) {
            Some((number, length)) => {
                self.at += length;
                Ok(number)
            }
            None => Err(self.expected_error("whole number")),
        }
    }

    /// Returns true if a word ends here.
    #[inline]
    pub(crate) fn at_word_end(&self) -> bool {
        is_end_of_word(self.bytes.get(self.at))
    }

    /// Creates the error that the next word is not what was expected.
    #[cold]
    pub(crate) fn expected_error(&self, wanted: &str) -> ReadError {
        if matches!(self.peek(), b'\n' | b'#') {
            return self.error(format!("the line ends where a {wanted} was expected"));
        }
        self.error(format!("`{}` is not a {wanted}", excerpt_of_bytes(self.word())))
    }
}

#[inline]
fn is_blank(byte: Option<&u8>) -> bool {
    matches!(byte, None | Some(b' ' | b'\t' | b'\r' | b'\n'))
}

#[inline]
fn is_end_of_word(byte: Option<&u8>) -> bool {
    is_blank(byte) || matches!(byte, Some(b'#' | b'\\'))
}

/// Converts text to the form that the text readers expect: UTF-8 without a byte order mark, lines that end in
/// `\n`.
pub(crate) fn utf8_of(bytes: &[u8]) -> Cow<'_, [u8]> {
    let utf16 = |unit: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|b| unit([b[0], b[1]]));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(text.collect::<String>().into_bytes())
    };
    let text = match bytes {
        [0xff, 0xfe, ..] => utf16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf16(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, ..] => Cow::Borrowed(&bytes[3..]),
        _ => Cow::Borrowed(bytes),
    };
    // Old Macintosh files end their lines in a lone `\r`.
    if memchr::memchr(b'\n', &text).is_none() && memchr::memchr(b'\r', &text).is_some() {
        return text.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect();
    }
    text
}

/// Returns true if the line that ends after these bytes is complete; a backslash at its end continues it.
pub(crate) fn ends_line(before: &[u8]) -> bool {
    !matches!(before, [.., b'\\'] | [.., b'\\', b'\r'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf16_and_old_line_ends_become_plain_text() {
        let text = "v 1 2 3\nf 1 1 1\n";
        let little: Vec<u8> =
            [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
        let big: Vec<u8> =
            [0xfe, 0xff].into_iter().chain(text.encode_utf16().flat_map(u16::to_be_bytes)).collect();
        assert_eq!(&*utf8_of(&little), text.as_bytes());
        assert_eq!(&*utf8_of(&big), text.as_bytes());
        assert_eq!(&*utf8_of(format!("\u{feff}{text}").as_bytes()), text.as_bytes());
        assert_eq!(&*utf8_of(text.replace('\n', "\r").as_bytes()), text.as_bytes());
    }

    #[test]
    fn lines_are_counted_across_continuations() {
        let mut lines = Lines::new(b"1 \\\n 2\\\r\n3 # c\n4");
        for (line, number) in [(1, 1.0), (2, 2.0), (3, 3.0)] {
            lines.skip_blanks();
            assert_eq!((lines.line(), lines.decimal().unwrap().value), (line, number));
        }
        assert!(lines.at_line_end());
        lines.next_line();
        assert_eq!((lines.line(), lines.whole().unwrap()), (4, 4));
        assert!(lines.at_line_end() && lines.at_end());
        lines.next_line();
        assert!(lines.at_end());
    }

    #[test]
    fn a_line_may_continue_in_the_next() {
        let rest = |text: &'static str| Lines::new(text.as_bytes()).rest_with_continuations();
        assert_eq!(&*rest("g a \r\nb"), b"g a");
        assert_eq!(&*rest("g a\\\nb\\\r\n c\nd"), b"g a b  c");
        assert_eq!(&*rest("g a\\"), b"g a\\");
    }

    #[test]
    fn errors_show_the_word_and_its_line() {
        let mut lines = Lines::new(b"x\n3.1+e2 ");
        lines.next_line();
        assert_eq!(lines.decimal().unwrap_err().to_string(), "line 2: `3.1+e2` is not a number");
        let lines = Lines::new(b"\n");
        assert_eq!(
            lines.expected_error("number").to_string(),
            "line 1: the line ends where a number was expected"
        );
    }
}
