//! Damaged files of every format: a result or an error, without panics, in a short time.

use std::time::{Duration, Instant};

use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, write_to};

/// A random generator that gives the same numbers on every machine.
struct Xorshift(u64);

impl Xorshift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

/// Cases per file. A minute of fuzzing finds more; this part of it runs for every change.
const CASES: usize = 3000;

/// Returns a grid with a seam and, optionally, all attributes.
fn grid(has_attributes: bool) -> TriMesh {
    let n = 5u32;
    let at = |i: u32| [(i % n) as f32 * 0.25, (i / n) as f32 * 0.3, ((i * 7) % 5) as f32 * 0.1];
    let mut faces = Vec::new();
    for j in 0..n - 1 {
        for i in 0..n - 1 {
            let a = j * n + i;
            faces.extend([[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]);
        }
    }
    let positions = Positions::F32((0..n * n).map(at).collect());
    if !has_attributes {
        return TriMesh::new(positions, faces.iter().map(|t| t.map(VertexId)).collect()).unwrap();
    }
    // The vertices of the first row have two wedges.
    let map: Vec<VertexId> = (0..n * n).chain(0..n).map(VertexId).collect();
    faces[0] = faces[0].map(|v| if v < n { v + n * n } else { v });
    let mut mesh =
        TriMesh::with_wedges(positions, map, faces.iter().map(|t| t.map(WedgeId)).collect()).unwrap();
    let count = mesh.wedge_count();
    mesh.set_normals(Some(vec![[0.0, 0.0, 1.0]; count])).unwrap();
    mesh.set_uvs(Some((0..count).map(|i| [i as f32 * 0.03, 0.5]).collect())).unwrap();
    mesh.set_colors(Some((0..count).map(|i| [i as f32 / 64.0, 0.5, 0.25, 1.0]).collect())).unwrap();
    mesh
}

fn damage(bytes: &mut Vec<u8>, random: &mut Xorshift) {
    const NUMBERS: [&str; 14] = [
        "0",
        "-1",
        "4294967295",
        "4294967296",
        "-2147483649",
        "99999999999999999999",
        "1e400",
        "nan",
        "-inf",
        "1e-400",
        "3.1+e2",
        "",
        "x",
        "1/2/3/4",
    ];
    for _ in 0..=random.below(3) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        match random.below(7) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes[at] = random.next() as u8,
            3 => {
                // Replaces a number of a text; in binary files, bytes that look like one.
                let is_digit = |b: &u8| b.is_ascii_digit() || b"+-.e".contains(b);
                let Some(start) = bytes[at..].iter().position(is_digit).map(|n| at + n) else { continue };
                let end = bytes[start..].iter().position(|b| !is_digit(b)).map_or(bytes.len(), |n| start + n);
                bytes.splice(start..end, NUMBERS[random.below(NUMBERS.len())].bytes());
            }
            4 => {
                // Four bytes become a large or small count.
                let word = [u32::MAX, 0, 1 << 31, 1 << 24, 255, 0x7fc0_0000][random.below(6)].to_le_bytes();
                for (byte, new) in bytes[at..].iter_mut().zip(word) {
                    *byte = new;
                }
            }
            5 => {
                let end = (at + random.below(40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            _ => {
                let end = (at + random.below(40)).min(bytes.len());
                bytes.drain(at..end);
            }
        }
    }
}

#[test]
fn damaged_files_get_an_answer() {
    for format in Format::WRITTEN {
        for ascii in [false, true] {
            for has_attributes in [false, true] {
                let mut options = WriteOptions::default();
                options.ascii = ascii;
                let mut whole = Vec::new();
                write_to(&grid(has_attributes), format, &options, &mut whole).unwrap();
                if whole.is_empty() {
                    // There is no writer for this format yet.
                    continue;
                }
                assert!(
                    read_bytes(&whole, &ReadOptions::default()).is_ok(),
                    "{format:?} {ascii} {has_attributes}"
                );
                let mut random = Xorshift(0x9e37_79b9_7f4a_7c15 ^ whole.len() as u64);
                let mut forced = ReadOptions::default();
                forced.format = Some(format);
                for case in 0..CASES / 4 {
                    let mut bytes = whole.clone();
                    damage(&mut bytes, &mut random);
                    let start = Instant::now();
                    let by_content = read_bytes(&bytes, &ReadOptions::default());
                    let by_name = read_bytes(&bytes, &forced);
                    if matches!(format, Format::Glb | Format::Gltf)
                        && let Ok(scene) = Scene::read(&bytes, &forced)
                    {
                        let same: Vec<_> =
                            scene.meshes().iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
                        let _ = scene.model();
                        let _ = scene.write(&same, format, &|_| None, &mut Vec::new());
                    }
                    for loaded in [by_content, by_name].into_iter().flatten() {
                        assert!(loaded.mesh.face_count() > 0);
                        assert!(loaded.mesh.face_count() <= bytes.len());
                    }
                    // Guessed: thousands of times the usual time for these few kilobytes, for a busy machine.
                    assert!(start.elapsed() < Duration::from_secs(2), "{format:?}, case {case}");
                }
            }
        }
    }
}

#[test]
fn every_front_of_a_file_gets_an_answer() {
    for format in Format::WRITTEN {
        let mut whole = Vec::new();
        write_to(&grid(true), format, &WriteOptions::default(), &mut whole).unwrap();
        let mut forced = ReadOptions::default();
        forced.format = Some(format);
        for end in 0..whole.len() {
            let _ = read_bytes(&whole[..end], &ReadOptions::default());
            let _ = read_bytes(&whole[..end], &forced);
        }
    }
}
