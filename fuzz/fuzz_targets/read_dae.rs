//! Reads untrusted bytes as COLLADA: a mesh or an error, never a panic, and the mesh can be written.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lodsmith_fuzz::reading::check(bytes, lodsmith_io::Format::Dae));
