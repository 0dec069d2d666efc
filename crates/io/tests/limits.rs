//! Resource limits of readers.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use lodsmith_io::{ReadError, ReadOptions, read_bytes, read_path};

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

/// Repeats a gzip member of 64 MiB of blanks: a megabyte that unpacks to 1.5 GB.
fn bomb(parts: usize) -> Vec<u8> {
    packed(&vec![b' '; 64 << 20]).repeat(parts)
}

#[test]
fn a_packed_file_that_unpacks_to_hundreds_of_times_its_size_is_refused() {
    let bytes = bomb(24);
    assert!(bytes.len() < 2 << 20);
    let error = read_bytes(&bytes, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Ratio { limit, .. } if limit < 300 << 20), "{error}");
    // A single member of 64 MiB is harmless: the only error is that it holds no mesh.
    let error = read_bytes(&bomb(1), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Unknown(_)), "{error}");
    // The memory limit applies as well.
    let mut options = ReadOptions::default();
    options.limits.memory = 20 << 20;
    let error = read_bytes(&bomb(1), &options).unwrap_err();
    assert!(matches!(error, ReadError::Memory(_)), "{error}");
}

/// Returns a triangle whose `extras` repeat a unit `count` times.
fn with_extras(unit: &str, count: usize) -> String {
    let extras = format!("{unit},").repeat(count);
    let corners = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{corners}"}}],
        "extras":[{extras}0]}}"#
    )
}

#[test]
fn json_that_becomes_a_hundred_times_its_size_is_refused() {
    let text = with_extras("[[[[0]]]]", 1_000_000);
    let error = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Ratio { times: 48, .. }), "{error}");
    let text = with_extras("7", 1_000_000);
    assert_eq!(read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap().mesh.face_count(), 1);
    let mut options = ReadOptions::default();
    options.limits.memory = 64 << 20;
    let error = read_bytes(text.as_bytes(), &options).unwrap_err();
    assert!(matches!(error, ReadError::Memory(_)), "{error}");
}

#[test]
fn a_mesh_that_would_not_fit_beside_its_file_is_refused() {
    let facets = 100_000;
    let mut stl = vec![0; 84 + 50 * facets];
    stl[80..84].copy_from_slice(&(facets as u32).to_le_bytes());
    let mut options = ReadOptions::default();
    options.limits.memory = 6 << 20;
    let error = read_bytes(&stl, &options).unwrap_err().to_string();
    assert!(error.starts_with("reading STL would take about 7.25 MiB"), "{error}");
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 100000\nproperty uchar x\nproperty uchar y\n\
               property uchar z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n";
    let ply = [ply.as_bytes(), &[0; 300_000]].concat();
    options.limits.memory = 1 << 20;
    let error = read_bytes(&ply, &options).unwrap_err().to_string();
    assert!(error.starts_with("reading PLY would take about 1.43 MiB"), "{error}");
}
