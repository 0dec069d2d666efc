//! Reads an OBJ with untrusted libraries and images in files beside it: a mesh or an error, never a panic,
//! and writing it again creates no file outside the target folder.
#![no_main]

use std::fs;
use std::sync::Arc;

use lodsmith_io::{Format, WriteOptions, read_path, write_path};

/// Separator between the files.
const BETWEEN: &[u8] = b"\n====\n";
/// The files in order; the last one gets the rest.
const FILES: [&str; 4] = ["a.obj", "a.mtl", "a.png", "b.mtl"];
const SECRET: &str = "what nobody else may read";

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    for name in ["in", "out"] {
        fs::create_dir(folder.path().join(name)).expect("there is room for a folder");
    }
    fs::write(folder.path().join("secret"), SECRET).expect("there is room for a file");
    let mut rest = bytes;
    for name in FILES {
        let end = rest.windows(BETWEEN.len()).position(|w| w == BETWEEN);
        let (file, after) = end.map_or((rest, &[][..]), |at| (&rest[..at], &rest[at + BETWEEN.len()..]));
        fs::write(folder.path().join("in").join(name), file).expect("there is room for a file");
        rest = after;
    }
    let options = lodsmith_fuzz::reading::options(Format::Obj);
    let Ok(loaded) = read_path(&folder.path().join("in/a.obj"), &options) else { return };
    let out = folder.path().join("out");
    for name in ["a.obj", "a.glb"] {
        let mut options = WriteOptions::default();
        options.regions = Some(Arc::new(loaded.regions.clone()));
        let _ = write_path(&loaded.mesh, &out.join(name), &options);
    }
    let names = |folder: &std::path::Path| {
        let mut names: Vec<_> = fs::read_dir(folder)
            .expect("it is there")
            .map(|entry| entry.expect("it can be listed").file_name())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names(folder.path()), ["in", "out", "secret"], "something lies beside the folders");
    for name in names(&out) {
        let file = fs::read(out.join(&name)).unwrap_or_default();
        let holds = file.windows(SECRET.len()).any(|w| w == SECRET.as_bytes());
        assert!(
            !holds || bytes.windows(SECRET.len()).any(|w| w == SECRET.as_bytes()),
            "{name:?} holds the secret"
        );
    }
});
