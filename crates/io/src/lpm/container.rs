//! Chunks: a length, four letters, bytes, and a checksum over letters and bytes.

use std::io::{self, Read, Write};

/// First bytes of a file: they tell what it is, and show whether something took it for text.
pub(crate) const MAGIC: [u8; 8] = [0x89, b'L', b'P', b'M', b'\r', b'\n', 0x1a, b'\n'];

pub(super) const HEAD: [u8; 4] = *b"HEAD";
pub(super) const MATERIALS: [u8; 4] = *b"mtls";
pub(super) const BASE: [u8; 4] = *b"BASE";
pub(super) const SPLITS: [u8; 4] = *b"SPLT";
pub(super) const CHECKPOINT: [u8; 4] = *b"CHKP";
pub(super) const ORIGINAL: [u8; 4] = *b"ORIG";
pub(super) const DONE: [u8; 4] = *b"DONE";

/// Bytes of a chunk beside its content.
pub(super) const AROUND: u64 = 12;

/// Writes a chunk; returns how many bytes that makes.
pub(super) fn write_chunk(out: &mut dyn Write, kind: [u8; 4], bytes: &[u8]) -> io::Result<u64> {
    let length = u32::try_from(bytes.len())
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "a chunk of LPM holds up to 4 GiB"))?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&kind)?;
    out.write_all(bytes)?;
    out.write_all(&checksum(kind, bytes).to_le_bytes())?;
    Ok(u64::from(length) + AROUND)
}

fn checksum(kind: [u8; 4], bytes: &[u8]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(&kind);
    sum.update(bytes);
    sum.finalize()
}

/// What comes next.
#[derive(Debug)]
pub(super) enum Next {
    Chunk {
        kind: [u8; 4],
        bytes: Vec<u8>,
    },
    /// The bytes end, where one chunk does or within one.
    End,
    /// The checksum says that the bytes are not those that were written.
    Damaged,
    /// So many bytes are more than are allowed.
    TooLarge,
}

/// Chunks out of a stream.
#[derive(Debug)]
pub(super) struct Chunks<R> {
    from: R,
    /// Bytes read so far.
    pub(super) at: u64,
    most: u64,
}

impl<R: Read> Chunks<R> {
    pub(super) fn new(from: R, most: u64) -> Self {
        Self { from, at: 0, most }
    }
    /// Whether the first bytes are those of the format.
    pub(super) fn magic(&mut self) -> io::Result<bool> {
        Ok(self.take(MAGIC.len() as u64)? == MAGIC)
    }
    fn take(&mut self, count: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        // Grows by what comes, not by what is announced.
        self.from.by_ref().take(count).read_to_end(&mut bytes)?;
        self.at += bytes.len() as u64;
        Ok(bytes)
    }
    pub(super) fn next(&mut self) -> io::Result<Next> {
        let front = self.take(8)?;
        let Some(([a, b, c, d], kind)) = front.split_first_chunk() else {
            return Ok(Next::End);
        };
        let (length, Ok(kind)) = (u32::from_le_bytes([*a, *b, *c, *d]), kind.try_into()) else {
            return Ok(Next::End);
        };
        if self.at.saturating_add(u64::from(length)) > self.most {
            return Ok(Next::TooLarge);
        }
        let bytes = self.take(u64::from(length))?;
        let sum = self.take(4)?;
        if bytes.len() < length as usize || sum.len() < 4 {
            return Ok(Next::End);
        }
        match sum == checksum(kind, &bytes).to_le_bytes() {
            true => Ok(Next::Chunk { kind, bytes }),
            false => Ok(Next::Damaged),
        }
    }
}
