//! Files that once failed here, or that are known to fail elsewhere; one function each.

use std::time::{Duration, Instant};

use lodsmith_core::Positions;
use lodsmith_io::{Format, ReadOptions, read_bytes};

#[test]
fn a_vertex_with_many_normals_takes_no_square_time() {
    let mut text = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    for i in 0..100_000 {
        text += &format!("vn 0 {} 1\n", f64::from(i) * 1e-5);
    }
    for i in 1..=100_000 {
        text += &format!("f 1//{i} 2//1 3//1\n");
    }
    let start = Instant::now();
    let mesh = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap().mesh;
    assert_eq!(mesh.wedge_count(), 100_002);
    // Quadratic time would be ten thousand million steps.
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[test]
fn files_of_several_sections_are_read_as_one() {
    // Above the size from which files are cut, with some continued lines and the last error near the end.
    let mut text = String::new();
    let count = 400_000;
    for i in 0..count {
        text += &format!("v {i} \\\n {}.5 0\nvn 0 0 1\n", i % 1000);
    }
    for i in 1..=count - 2 {
        text += &format!("f {0}//{0} {1}//{1} {2}//{2}\n", i, i + 1, i + 2);
    }
    assert!(text.len() > 16 << 20);
    let read = |text: &str, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| read_bytes(text.as_bytes(), &ReadOptions::default()))
    };
    let one = read(&text, 1).unwrap();
    assert_eq!(one.mesh.face_count(), count - 2);
    assert!(one.mesh.vertex_map().is_none());
    let Positions::F32(p) = one.mesh.positions() else { panic!("these are no doubles") };
    assert_eq!(p[123_456], [123_456.0, 456.5, 0.0]);
    for threads in [2, 3] {
        assert_eq!(read(&text, threads).unwrap().mesh, one.mesh);
    }
    let line = 3 * count + (count - 2) + 2;
    for (wrong, wanted) in [
        ("f 1 2 0", format!("line {line}: the face refers to vertex 0, but OBJ counts from 1")),
        ("f 1 2 400001", format!("line {line}: the face refers to vertex 400001, but the file has 400000")),
        ("v 1 2 x", format!("line {line}: `x` is not a number")),
    ] {
        let text = format!("{text}\n{wrong}\n");
        for threads in [1, 3] {
            assert_eq!(read(&text, threads).unwrap_err().to_string(), wanted);
        }
    }
    let more = read(&format!("{text}\nf -1 -2 -3 -4\n"), 3).unwrap();
    assert_eq!((more.mesh.face_count(), more.contents.polygons), (count, count - 1));
    let strange = read(&format!("{text}\nhello\n"), 3).unwrap();
    assert!(strange.warnings[0].text.contains(&format!("line {line} begins with")), "{:?}", strange.warnings);
    // Which corners refer to nothing is known only once all sections are read.
    let missing = read(&format!("{text}\nf 1/1 2/1 3/1\n"), 3).unwrap();
    let said = format!("line {line}: the face refers to texture coordinate 1, but the file has 0");
    assert!(missing.warnings[0].text.starts_with(&said), "{:?}", missing.warnings);
}

#[test]
fn utf16_files_are_text_too() {
    let text = "# made elsewhere\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n";
    let bytes: Vec<u8> =
        [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let got = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!((got.format, got.mesh.face_count()), (Format::Obj, 1));
}

#[test]
fn a_face_before_its_vertices_is_read() {
    let got =
        read_bytes(b"f 1 2 3 4\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n", &ReadOptions::default()).unwrap();
    assert_eq!(got.mesh.face_count(), 2);
}
