//! Sections: a tag, a length, bytes and a checksum.

use std::io::{self, Write};

use crate::error::ReadError;

/// The name of a section. One that begins with a small letter may be passed over by who does not know it.
pub(super) type Tag = [u8; 4];

/// Writes a section.
pub(super) fn write(tag: Tag, bytes: &[u8], out: &mut dyn Write) -> io::Result<()> {
    out.write_all(&tag)?;
    out.write_all(&(bytes.len() as u64).to_le_bytes())?;
    out.write_all(bytes)?;
    out.write_all(&checksum(tag, bytes).to_le_bytes())
}

fn checksum(tag: Tag, bytes: &[u8]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(&tag);
    sum.update(bytes);
    sum.finalize()
}

/// One section of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section<'a> {
    pub(super) tag: Tag,
    pub(super) bytes: &'a [u8],
    /// Where its bytes begin in the file.
    pub(super) at: usize,
}

/// Cuts a file into its sections, whose checksums are right, from byte `at` on.
pub(super) fn all(file: &[u8], mut at: usize) -> Result<Vec<Section<'_>>, ReadError> {
    let mut sections = Vec::new();
    loop {
        let Some((tag, length)) = head(&file[at..]) else {
            return Err(ReadError::byte(at, "the file ends before its last section"));
        };
        let begin = at + 12;
        let end = usize::try_from(length).ok().and_then(|n| begin.checked_add(n));
        let Some(end) = end.filter(|end| end.checked_add(4).is_some_and(|e| e <= file.len())) else {
            let text = format!("section {} wants {length} bytes, more than are left", name(tag));
            return Err(ReadError::byte(at, text));
        };
        let bytes = &file[begin..end];
        let found = u32::from_le_bytes([file[end], file[end + 1], file[end + 2], file[end + 3]]);
        if found != checksum(tag, bytes) {
            let text = format!("section {} is damaged: its checksum is not that of its bytes", name(tag));
            return Err(ReadError::byte(begin, text));
        }
        at = end + 4;
        sections.push(Section { tag, bytes, at: begin });
        if tag == *b"DONE" {
            break;
        }
    }
    if at != file.len() {
        return Err(ReadError::byte(at, "there are bytes behind the last section"));
    }
    Ok(sections)
}

fn head(file: &[u8]) -> Option<(Tag, u64)> {
    let tag = file.get(..4)?.try_into().ok()?;
    Some((tag, u64::from_le_bytes(file.get(4..12)?.try_into().ok()?)))
}

/// A tag for people.
pub(super) fn name(tag: Tag) -> String {
    tag.escape_ascii().to_string()
}

impl<'a> Section<'a> {
    /// Something is wrong with it.
    pub(super) fn wrong(&self, problem: impl std::fmt::Display) -> ReadError {
        ReadError::byte(self.at, format!("section {}: {problem}", name(self.tag)))
    }

    /// Its bytes in entries of `size`.
    pub(super) fn entries(&self, size: usize) -> Result<std::slice::ChunksExact<'a, u8>, ReadError> {
        match self.bytes.len() % size {
            0 => Ok(self.bytes.chunks_exact(size)),
            _ => Err(self.wrong(format!("its length is no multiple of {size}"))),
        }
    }

    /// Numbers of single precision, `N` to an entry.
    pub(super) fn singles<const N: usize>(&self) -> Result<Vec<[f32; N]>, ReadError> {
        let entry = |e: &[u8]| std::array::from_fn(|k| f32::from_le_bytes(four(&e[4 * k..])));
        Ok(self.entries(4 * N)?.map(entry).collect())
    }

    /// Whole numbers.
    pub(super) fn numbers(&self) -> Result<impl ExactSizeIterator<Item = u32> + use<'a>, ReadError> {
        Ok(self.entries(4)?.map(|e| u32::from_le_bytes(four(e))))
    }
}

pub(super) fn four(bytes: &[u8]) -> [u8; 4] {
    [bytes[0], bytes[1], bytes[2], bytes[3]]
}

pub(super) fn double(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(std::array::from_fn(|i| bytes[i]))
}
