//! How much a file may ask of the machine. Readers also reserve nothing on a header's word: every count is held against
//! the bytes that are there.

use lodsmith_core::memory;

use crate::error::ReadError;

/// Limits against hostile files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes of a file, and of what a compressed file unpacks to.
    pub bytes: u64,
    /// Pixels of all images of a file together, decoded.
    pub pixels: u64,
    /// Bytes of memory that reading may take: the file, what it unpacks to, and what is made of it, together. What a step
    /// takes is computed from sizes and counts before it begins, and is right within a third for ordinary files.
    /// [`machine::memory`](crate::machine::memory) says what there is.
    pub memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        // Guessed: room for a billion triangles as text, and for sixty textures of 4096 by 4096. A library does not know how
        // much of the machine is its own, so the memory is the caller's to say; the command says it.
        Self { bytes: 256 << 30, pixels: 1 << 30, memory: 256 << 30 }
    }
}

impl Limits {
    /// Bytes that anything read as a whole may have: it lies in memory.
    pub(crate) fn most_bytes(&self) -> u64 {
        self.bytes.min(self.memory)
    }

    /// Refuses a step that takes more memory than there may be.
    pub(crate) fn check_memory(&self, step: impl Into<String>, need: u64) -> Result<(), ReadError> {
        Ok(memory::check(step, need, self.memory)?)
    }
}

/// An empty vector with room for so many. That there is room has been computed before, so this fails only where others took
/// it meanwhile.
pub(crate) fn with_room<T>(count: usize) -> Result<Vec<T>, ReadError> {
    let mut room = Vec::new();
    match room.try_reserve_exact(count) {
        Ok(()) => Ok(room),
        Err(_) => Err(out_of_memory()),
    }
}

/// The system has no more memory to give.
pub(crate) fn out_of_memory() -> ReadError {
    let text = "there is not enough free memory";
    std::io::Error::new(std::io::ErrorKind::OutOfMemory, text).into()
}
