//! Reads untrusted bytes as 3MF, or as the model part of a 3MF: a mesh or an error, never a panic, and the mesh can be
//! written.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = lodsmith_fuzz::reading::as_three_mf(bytes);
    lodsmith_fuzz::reading::check(&file, lodsmith_io::Format::ThreeMf);
});
