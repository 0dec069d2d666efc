//! Limits on the resources that a file may use. Besides, readers never allocate by a header's count alone:
//! every count is checked against the bytes in the file.

use lodsmith_core::memory;

use crate::error::ReadError;

/// Maximum bytes that a packed byte may unpack to, and that any file may unpack to. Deflate reaches a ratio of 1032 at
/// most; meshes, text or binary, reach 3 to 20 (a flat grid of equal squares as text 60), so a ratio above 200 means
/// pure repetition; up to 64 MiB that is allowed, since it is harmless.
const MAX_UNPACK_RATIO: u64 = 200;
const MIN_UNPACK_LIMIT: u64 = 64 << 20;

/// Limits against hostile files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Maximum bytes of a file, and of the data that a compressed file unpacks to.
    pub bytes: u64,
    /// Maximum number of pixels in all images of a file, decoded.
    pub pixels: u64,
    /// Maximum memory for reading, in bytes: the file, its unpacked data and the result, together. The need
    /// of a step is estimated from sizes and counts before it begins, and is right within a third for
    /// ordinary files. [`machine::memory_limit`](crate::machine::memory_limit) returns the memory of the machine.
    pub memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        // Guessed: enough for a billion triangles as text, and for sixty textures of 4096 by 4096. A library
        // cannot know its share of the machine, so the caller sets the memory limit, as the command does.
        Self { bytes: 256 << 30, pixels: 1 << 30, memory: 256 << 30 }
    }
}

impl Limits {
    /// Returns the maximum size of anything that is held in memory as a whole.
    pub(crate) fn max_bytes(&self) -> u64 {
        self.bytes.min(self.memory)
    }

    /// Returns the maximum unpacked size of packed bytes, by the limits and by their own number.
    pub(crate) fn max_unpacked_bytes(&self, packed: usize) -> u64 {
        self.max_bytes().min((packed as u64).saturating_mul(MAX_UNPACK_RATIO).max(MIN_UNPACK_LIMIT))
    }

    /// Returns an error if a step needs more memory than allowed.
    pub(crate) fn check_memory(&self, step: impl Into<String>, need: u64) -> Result<(), ReadError> {
        Ok(memory::check(step, need, self.memory)?)
    }
}

/// Returns an empty vector with this capacity. The memory has been checked before, so this fails only if
/// other processes have taken it since.
pub(crate) fn try_with_capacity<T>(count: usize) -> Result<Vec<T>, ReadError> {
    let mut room = Vec::new();
    match room.try_reserve_exact(count) {
        Ok(()) => Ok(room),
        Err(_) => Err(out_of_memory()),
    }
}

/// Returns the error that the system is out of memory.
pub(crate) fn out_of_memory() -> ReadError {
    let text = "there is not enough free memory";
    std::io::Error::new(std::io::ErrorKind::OutOfMemory, text).into()
}
