//! Reads an OBJ with untrusted material libraries and images in the same folder: a mesh or an error, never a panic; and
//! writing it again creates no file outside the target folder.
#![no_main]

use std::fs;
use std::sync::Arc;

use lodsmith_io::{Format, WriteOptions, read_path, write_path};

/// Separator between the files.
const SEPARATOR: &[u8] = b"\n====\n";
/// The files in order; the last one gets the rest.
const FILES: [&str; 4] = ["a.obj", "a.mtl", "a.png", "b.mtl"];
const SECRET: &str = "what nobody else may read";

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("the folder is created");
    for name in ["in", "out"] {
        fs::create_dir(folder.path().join(name)).expect("the folder is created");
    }
    fs::write(folder.path().join("secret"), SECRET).expect("the file is written");
    let mut rest = bytes;
    for name in FILES {
        let end = rest.windows(SEPARATOR.len()).position(|w| w == SEPARATOR);
        let (file, after) = end.map_or((rest, &[][..]), |at| (&rest[..at], &rest[at + SEPARATOR.len()..]));
        fs::write(folder.path().join("in").join(name), file).expect("the file is written");
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
            .expect("the folder exists")
            .map(|entry| entry.expect("the folder can be listed").file_name())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names(folder.path()), ["in", "out", "secret"], "a file was created outside the folders");
    for name in names(&out) {
        let file = fs::read(out.join(&name)).unwrap_or_default();
        let contains_secret = file.windows(SECRET.len()).any(|w| w == SECRET.as_bytes());
        assert!(
            !contains_secret || bytes.windows(SECRET.len()).any(|w| w == SECRET.as_bytes()),
            "{name:?} contains the secret"
        );
    }
});
