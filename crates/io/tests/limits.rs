//! What a file may ask of the machine.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use lodsmith_io::{ReadOptions, read_bytes, read_path};

fn at_most(bytes: u64) -> ReadOptions {
    let mut options = ReadOptions::default();
    options.limits.bytes = bytes;
    options
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut gz = GzEncoder::new(Vec::new(), Compression::default());
    gz.write_all(bytes).unwrap();
    gz.finish().unwrap()
}

const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn files_above_the_limit_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, MESH).unwrap();
    assert!(read_path(&path, &at_most(MESH.len() as u64)).is_ok());
    let error = read_path(&path, &at_most(31)).unwrap_err().to_string();
    assert_eq!(error, format!("{}: the file is 32, above the limit of 31", path.display()));
    assert!(read_bytes(MESH.as_bytes(), &at_most(31)).is_err());
}

#[test]
fn a_packed_file_may_not_unpack_to_more() {
    let bomb = packed(&[MESH.as_bytes(), &vec![b' '; 20 << 20]].concat());
    assert!(bomb.len() < 100_000);
    let error = read_bytes(&bomb, &at_most(1 << 20)).unwrap_err().to_string();
    assert_eq!(error, "the unpacked file is 1048577, above the limit of 1048576");
    assert!(read_bytes(&bomb, &at_most(64 << 20)).is_ok());
}

#[test]
fn a_packed_file_that_is_cut_or_damaged_says_so() {
    let whole = packed(MESH.as_bytes());
    assert_eq!(read_bytes(&whole, &ReadOptions::default()).unwrap().mesh.face_count(), 1);
    let error = read_bytes(&whole[..whole.len() - 9], &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.starts_with("the gzip data end too early"), "{error}");
    let mut damaged = whole.clone();
    let checksum = damaged.len() - 6;
    damaged[checksum] ^= 1;
    let error = read_bytes(&damaged, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.starts_with("the gzip data are damaged"), "{error}");
}

#[test]
fn several_packed_parts_are_one_file() {
    let (front, back) = MESH.as_bytes().split_at(10);
    let parts = [packed(front), packed(back)].concat();
    assert_eq!(read_bytes(&parts, &ReadOptions::default()).unwrap().mesh.face_count(), 1);
}
