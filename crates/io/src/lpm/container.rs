//! Chunks: a length, a kind of four letters, content, and a checksum over kind and content.

use std::io::{self, Read, Write};

/// First bytes of a file: they identify the format, and reveal a conversion as text.
pub(crate) const MAGIC: [u8; 8] = [0x89, b'L', b'P', b'M', b'\r', b'\n', 0x1a, b'\n'];

pub(super) const HEAD: [u8; 4] = *b"HEAD";
pub(super) const MATERIALS: [u8; 4] = *b"mtls";
pub(super) const BASE: [u8; 4] = *b"BASE";
pub(super) const SPLITS: [u8; 4] = *b"SPLT";
pub(super) const CHECKPOINT: [u8; 4] = *b"CHKP";
pub(super) const ORIGINAL: [u8; 4] = *b"ORIG";
pub(super) const DONE: [u8; 4] = *b"DONE";

/// Bytes of a chunk in addition to its content.
pub(super) const CHUNK_OVERHEAD: u64 = 12;

/// Writes a chunk; returns the number of bytes written.
pub(super) fn write_chunk(out: &mut dyn Write, kind: [u8; 4], bytes: &[u8]) -> io::Result<u64> {
    let length = u32::try_from(bytes.len())
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "a chunk of LPM holds up to 4 GiB"))?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&kind)?;
    out.write_all(bytes)?;
    out.write_all(&checksum(kind, bytes).to_le_bytes())?;
    Ok(u64::from(length) + CHUNK_OVERHEAD)
}

fn checksum(kind: [u8; 4], bytes: &[u8]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(&kind);
    sum.update(bytes);
    sum.finalize()
}

/// Result of reading the next chunk.
#[derive(Debug)]
pub(super) enum NextChunk {
    Chunk {
        kind: [u8; 4],
        bytes: Vec<u8>,
    },
    /// The bytes end, at the end of a chunk or within one.
    End,
    /// The checksum does not match.
    Damaged,
    /// The chunk exceeds the size limit.
    TooLarge,
}

/// Reader of chunks from a stream.
#[derive(Debug)]
pub(super) struct ChunkReader<R> {
    from: R,
    /// Bytes read so far.
    pub(super) at: u64,
    max_bytes: u64,
}

impl<R: Read> ChunkReader<R> {
    pub(super) fn new(from: R, max_bytes: u64) -> Self {
        Self { from, at: 0, max_bytes }
    }
    /// Reads the first bytes; returns true if they match the format.
    pub(super) fn magic(&mut self) -> io::Result<bool> {
        Ok(self.take(MAGIC.len() as u64)? == MAGIC)
    }
    fn take(&mut self, count: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        // Grows with the bytes that arrive, not with the announced length.
        self.from.by_ref().take(count).read_to_end(&mut bytes)?;
        self.at += bytes.len() as u64;
        Ok(bytes)
    }
    pub(super) fn next(&mut self) -> io::Result<NextChunk> {
        let front = self.take(8)?;
        let Some(([a, b, c, d], kind)) = front.split_first_chunk() else {
            return Ok(NextChunk::End);
        };
        let (length, Ok(kind)) = (u32::from_le_bytes([*a, *b, *c, *d]), kind.try_into()) else {
            return Ok(NextChunk::End);
        };
        if self.at.saturating_add(u64::from(length)) > self.max_bytes {
            return Ok(NextChunk::TooLarge);
        }
        let bytes = self.take(u64::from(length))?;
        let sum = self.take(4)?;
        if bytes.len() < length as usize || sum.len() < 4 {
            return Ok(NextChunk::End);
        }
        match sum == checksum(kind, &bytes).to_le_bytes() {
            true => Ok(NextChunk::Chunk { kind, bytes }),
            false => Ok(NextChunk::Damaged),
        }
    }
}
