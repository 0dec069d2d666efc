//! Atomic writing of files: whole or not at all.

#[cfg(target_arch = "wasm32")]
mod in_memory;
#[cfg(not(target_arch = "wasm32"))]
mod on_disk;

#[cfg(target_arch = "wasm32")]
pub use in_memory::write_file;
#[cfg(target_arch = "wasm32")]
pub(crate) use in_memory::write_new_file;
#[cfg(not(target_arch = "wasm32"))]
pub use on_disk::write_file;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use on_disk::write_new_file;

/// Size of write buffers in bytes. Guessed.
pub(crate) const BUFFER: usize = 1 << 17;
