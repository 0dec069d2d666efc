//! Numbers of the PLY body, as text or binary.

use super::header::{Element, PropertyType, Scalar};
use crate::error::ReadError;
use crate::excerpt::excerpt;
use crate::numbers::parse_non_number;

/// A reason why a number could not be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    /// End of file.
    End,
    /// Text that is not a number: its range of bytes.
    Word(usize, usize),
    /// A number with a fraction where an index or a count is expected.
    Fraction(f64),
    /// A list length that is negative or too large for the remaining bytes.
    Length(i64, usize),
    /// A vertex index out of range.
    Index(i64, usize),
}

/// A stream of numbers in the body.
pub(super) trait NumberSource {
    const BINARY: bool;

    fn number(&mut self, kind: Scalar) -> Result<f64, Fault>;
    fn integer(&mut self, kind: Scalar) -> Result<i64, Fault>;
    fn remaining(&self) -> usize;
    fn advance(&mut self, bytes: usize);
    fn bytes(&self) -> (&[u8], usize);

    /// Returns all positions at once, if the three properties from `first` on and the layout of the records
    /// allow it; does not advance.
    fn f32_positions(&self, element: &Element, first: usize) -> Option<Vec<[f32; 3]>>;
    /// Returns all faces at once, if each is a triangle; does not advance.
    fn triangles(&self, element: &Element, at: usize) -> Option<Vec<[u32; 3]>>;

    /// Reads the length of a list and checks it against the rest of the file.
    fn list_length(&mut self, count: Scalar, item: Scalar) -> Result<usize, Fault> {
        let n = self.integer(count)?;
        let least = if Self::BINARY { item.size() } else { 2 };
        let room = (self.remaining() + 1) / least;
        usize::try_from(n).ok().filter(|&n| n <= room).ok_or(Fault::Length(n, self.remaining()))
    }
    fn skip_one(&mut self, kind: Scalar) -> Result<(), Fault> {
        self.number(kind).map(|_| ())
    }
    fn skip_list(&mut self, count: Scalar, item: Scalar) -> Result<(), Fault> {
        let n = self.list_length(count, item)?;
        (0..n).try_for_each(|_| self.skip_one(item))
    }

    fn error(&self, fault: Fault, what: &str, record: usize, property: &str) -> ReadError {
        let element = format!("{what} {record}");
        let (bytes, _) = self.bytes();
        match fault {
            Fault::End => {
                ReadError::element(element, format!("the file ends within {property}: it is cut off"))
            }
            Fault::Word(from, to) => {
                let line = 1 + count_lines(&bytes[..from]);
                let word = excerpt(&String::from_utf8_lossy(&bytes[from..to.min(from + 200)]));
                ReadError::line(line, format!("`{word}` is not a number ({property} of {element})"))
            }
            Fault::Fraction(x) => {
                ReadError::element(element, format!("{property} is {x}, but must be a whole number"))
            }
            Fault::Length(n, left) => ReadError::element(
                element,
                format!(
                    "{property} claims {n} entries, but {left} bytes are left: the file is cut off, or the number is wrong"
                ),
            ),
            Fault::Index(i, count) => {
                ReadError::element(element, format!("uses vertex {i}, but the mesh has {count}"))
            }
        }
    }
}

fn count_lines(bytes: &[u8]) -> usize {
    let ends = bytes.iter().filter(|&&b| b == b'\n').count();
    // Old files end lines in a lone carriage return.
    if ends > 0 { ends } else { bytes.iter().filter(|&&b| b == b'\r').count() }
}

fn whole(x: f64) -> Result<i64, Fault> {
    // Above 2^53 a double is not a valid index of anything that fits in memory.
    if x.fract() == 0.0 && x.abs() <= 9e15 { Ok(x as i64) } else { Err(Fault::Fraction(x)) }
}

/// Binary numbers.
pub(super) struct Binary<'a, const BIG: bool> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut b: [u8; N] = *self.bytes[self.at..].first_chunk().ok_or(Fault::End)?;
        self.at += N;
        if BIG {
            b.reverse();
        }
        Ok(b)
    }

    /// Returns four bytes at an offset in a record.
    #[inline]
    fn four(record: &[u8], at: usize) -> [u8; 4] {
        let mut b = [record[at], record[at + 1], record[at + 2], record[at + 3]];
        if BIG {
            b.reverse();
        }
        b
    }

    fn block(&self, count: usize, size: usize) -> Option<&[u8]> {
        self.bytes[self.at..].get(..count.checked_mul(size)?)
    }
}

impl<const BIG: bool> NumberSource for Binary<'_, BIG> {
    const BINARY: bool = true;

    #[inline]
    fn number(&mut self, kind: Scalar) -> Result<f64, Fault> {
        Ok(match kind {
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
            _ => self.integer(kind)? as f64,
        })
    }

    #[inline]
    fn integer(&mut self, kind: Scalar) -> Result<i64, Fault> {
        Ok(match kind {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 | Scalar::F64 => whole(self.number(kind)?)?,
        })
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }
    fn advance(&mut self, bytes: usize) {
        self.at += bytes;
    }
    fn bytes(&self) -> (&[u8], usize) {
        (self.bytes, self.at)
    }

    fn skip_one(&mut self, kind: Scalar) -> Result<(), Fault> {
        if self.remaining() < kind.size() {
            return Err(Fault::End);
        }
        self.at += kind.size();
        Ok(())
    }
    fn skip_list(&mut self, count: Scalar, item: Scalar) -> Result<(), Fault> {
        let bytes = self.list_length(count, item)? * item.size();
        if self.remaining() < bytes {
            return Err(Fault::End);
        }
        self.at += bytes;
        Ok(())
    }

    fn f32_positions(&self, element: &Element, first: usize) -> Option<Vec<[f32; 3]>> {
        let size = element.fixed_size()?;
        let three = element.properties.get(first..first + 3)?;
        if !three.iter().all(|p| p.kind == PropertyType::One(Scalar::F32)) {
            return None;
        }
        let at = element.properties[..first].iter().fold(0, |sum, p| match p.kind {
            PropertyType::One(s) => sum + s.size(),
            PropertyType::List { .. } => sum,
        });
        let block = self.block(element.count, size)?;
        let position = |r: &[u8]| {
            let r = &r[at..at + 12];
            [0, 4, 8].map(|k| f32::from_le_bytes(Self::four(r, k)))
        };
        Some(block.chunks_exact(size).map(position).collect())
    }

    fn triangles(&self, element: &Element, at: usize) -> Option<Vec<[u32; 3]>> {
        let (size, place) = triangle_record(element)?;
        debug_assert!(
            matches!(element.properties[at].kind, PropertyType::List { .. }),
            "the only list holds the indices"
        );
        let block = self.block(element.count, size)?;
        if block.get(place) != Some(&3) {
            return None;
        }
        let mut all = true;
        let triangle = |r: &[u8]| {
            let r = &r[place..place + 13];
            all &= r[0] == 3;
            [1, 5, 9].map(|k| u32::from_le_bytes(Self::four(r, k)))
        };
        let triangles = block.chunks_exact(size).map(triangle).collect();
        all.then_some(triangles)
    }
}

/// Returns the size of a face record and the offset of its list, if its only list has a one-byte count and
/// three 32-bit indices.
pub(super) fn triangle_record(element: &Element) -> Option<(usize, usize)> {
    let (mut size, mut place) = (0, None);
    for p in &element.properties {
        match p.kind {
            PropertyType::One(s) => size += s.size(),
            PropertyType::List { count: Scalar::U8, item: Scalar::I32 | Scalar::U32 } if place.is_none() => {
                place = Some(size);
                size += 13;
            }
            PropertyType::List { .. } => return None,
        }
    }
    place.map(|place| (size, place))
}

/// Text numbers, separated by blanks; line breaks do not matter.
pub(super) struct Text<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Text<'a> {
    #[inline]
    fn word(&mut self) -> Result<&'a [u8], Fault> {
        let rest = &self.bytes[self.at..];
        let from = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or(Fault::End)?;
        let rest = &rest[from..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += from + length;
        Ok(&rest[..length])
    }
}

impl NumberSource for Text<'_> {
    const BINARY: bool = false;

    fn number(&mut self, _: Scalar) -> Result<f64, Fault> {
        let word = self.word()?;
        parse_number(word).ok_or(Fault::Word(self.at - word.len(), self.at))
    }

    #[inline]
    fn integer(&mut self, _: Scalar) -> Result<i64, Fault> {
        let word = self.word()?;
        // Up to nine digits cannot overflow.
        if word.len() <= 9 && word.iter().all(u8::is_ascii_digit) {
            return Ok(word.iter().fold(0, |n, d| n * 10 + i64::from(d - b'0')));
        }
        let x = parse_number(word).ok_or(Fault::Word(self.at - word.len(), self.at))?;
        whole(x)
    }

    fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }
    fn advance(&mut self, bytes: usize) {
        self.at += bytes;
    }
    fn bytes(&self) -> (&[u8], usize) {
        (self.bytes, self.at)
    }
    fn f32_positions(&self, _: &Element, _: usize) -> Option<Vec<[f32; 3]>> {
        None
    }
    fn triangles(&self, _: &Element, _: usize) -> Option<Vec<[u32; 3]>> {
        None
    }
}

/// Parses a number as C prints it, including the spellings of what is no number.
fn parse_number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok().and_then(|text| text.parse().ok()).or_else(|| parse_non_number(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_every_spelling() {
        for (text, wanted) in
            [("1", 1.0), ("-2.5e-3", -2.5e-3), ("+.5", 0.5), ("1E+2", 100.0), ("-inf", f64::NEG_INFINITY)]
        {
            assert_eq!(parse_number(text.as_bytes()), Some(wanted), "{text}");
        }
        assert!(parse_number(b"-nan(ind)").unwrap().is_nan());
        assert!(parse_number(b"-1.#IND").unwrap().is_nan());
        assert_eq!(parse_number(b"1,5"), None);
        assert_eq!(parse_number(b"--1"), None);
    }
}
