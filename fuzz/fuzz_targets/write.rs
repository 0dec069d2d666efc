//! Round trips of a small soup with attributes through every format: the faces keep their number and positions.
#![no_main]

use lodsmith_core::Positions;
use lodsmith_fuzz::reading::finite_faces;
use lodsmith_fuzz::soup::{self, Bytes};
use lodsmith_io::gltf::{Compression, Packing};
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, write_to};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let mesh = soup::mesh(&mut bytes);
    let mut options = WriteOptions::default();
    options.ascii = bytes.next() % 2 == 0;
    let choice = usize::from(bytes.next());
    options.packing = Packing::new(Compression::ALL[choice % 3], choice / 3 % 2 == 1);
    let is_single = matches!(mesh.positions(), Positions::F32(_));
    let has_degenerate = mesh.surface().triangles().iter().any(|[a, b, c]| a == b || b == c || c == a);
    for format in
        [Format::Obj, Format::Off, Format::Ply, Format::Stl, Format::Gltf, Format::Glb, Format::ThreeMf]
    {
        let mut out = Vec::new();
        let is_finite = finite_faces(&mesh, format) == mesh.face_count();
        let is_glb = matches!(format, Format::Gltf | Format::Glb);
        // A format may be unable to hold the mesh.
        if write_to(&mesh, format, &options, &mut out).is_err() {
            continue;
        }
        let mut again = ReadOptions::default();
        again.format = Some(format);
        let back = match read_bytes(&out, &again) {
            Ok(back) => back.into_mesh(),
            Err(_) if mesh.face_count() == 0 || !is_finite => continue,
            // 3MF has no triangles with the same vertex twice.
            Err(_) if format == Format::ThreeMf && has_degenerate => continue,
            Err(e) => panic!("a written {format:?} file cannot be read: {e}"),
        };
        // (Faces with positions that are not finite in the format are left out.)
        if !is_finite {
            continue;
        }
        if format == Format::ThreeMf && has_degenerate {
            assert!(back.face_count() < mesh.face_count());
            continue;
        }
        assert_eq!(back.face_count(), mesh.face_count(), "faces through {format:?}");
        // Compression may reorder faces.
        if is_glb && options.packing.is_needed() {
            continue;
        }
        if !is_single {
            continue;
        }
        // Vertices may be merged or reordered: corner positions stay.
        let corners = |mesh: &lodsmith_core::TriMesh| -> Vec<[u64; 3]> {
            let positions = mesh.positions().view();
            let all = mesh.surface().triangles().iter().flatten().map(|&v| positions.get(v)).collect::<Vec<_>>();
            all.into_iter().map(|p| p.map(|x| (x + 0.0).to_bits())).collect()
        };
        assert!(corners(&back) == corners(&mesh), "corners through {format:?}");
    }
});
