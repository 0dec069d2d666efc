//! How much a file may ask of the machine. Readers also reserve nothing on a header's word: every count is held against
//! the bytes that are there.

/// Limits against hostile files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes of a file, and of what a compressed file unpacks to.
    pub bytes: u64,
    /// Pixels of all images of a file together, decoded.
    pub pixels: u64,
}

impl Default for Limits {
    fn default() -> Self {
        // Guessed: room for a billion triangles as text, and for sixty textures of 4096 by 4096.
        Self { bytes: 256 << 30, pixels: 1 << 30 }
    }
}
