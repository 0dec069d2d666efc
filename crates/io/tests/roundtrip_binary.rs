//! Round trips of PLY, STL, glTF and GLB.

use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use lodsmith_io::{Format, Loaded, ReadError, ReadOptions, WriteOptions, gltf, ply, stl};
use proptest::prelude::*;

/// All file variants; the flag selects text.
const KINDS: [(Format, bool); 6] = [
    (Format::Ply, false),
    (Format::Ply, true),
    (Format::Stl, false),
    (Format::Stl, true),
    (Format::Glb, false),
    (Format::Gltf, false),
];

/// The variants that hold vertices and attributes.
fn indexed() -> impl Iterator<Item = (Format, bool)> {
    KINDS.into_iter().filter(|(format, _)| *format != Format::Stl)
}

fn written(mesh: &TriMesh, (format, ascii): (Format, bool)) -> (Vec<u8>, Vec<String>) {
    let mut options = WriteOptions::default();
    options.format = Some(format);
    options.ascii = ascii;
    let mut bytes = Vec::new();
    let warnings = match format {
        Format::Ply => ply::write(mesh, &options, &mut bytes),
        Format::Stl => stl::write(mesh, &options, &mut bytes),
        _ => gltf::write(mesh, &options, &mut bytes).map(|written| written.warnings),
    };
    (bytes, warnings.unwrap().into_iter().map(|w| w.text).collect())
}

fn read(bytes: &[u8], format: Format) -> Result<Loaded, ReadError> {
    let options = ReadOptions::default();
    match format {
        Format::Ply => ply::read(bytes, &options),
        Format::Stl => stl::read(bytes, &options),
        _ => gltf::read(bytes, &options),
    }
}

fn again(mesh: &TriMesh, kind: (Format, bool)) -> TriMesh {
    let loaded = read(&written(mesh, kind).0, kind.0).unwrap();
    assert_eq!(loaded.format, kind.0);
    loaded.into_mesh()
}

/// ```text
/// 3---2   two faces; along 0-2 lies a seam of texture coordinates
/// | / |
/// 0---1
/// ```
fn seam() -> TriMesh {
    let corners = vec![[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 1.0, 0.0], [0.0, 1.0, 1e-7]];
    let vertex_of = [0, 1, 2, 0, 2, 3].map(VertexId).to_vec();
    let triangles = vec![[0, 1, 2].map(WedgeId), [3, 4, 5].map(WedgeId)];
    let mut mesh = TriMesh::with_wedges(Positions::F32(corners), vertex_of, triangles).unwrap();
    let uvs = vec![[0.0, 0.25], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5], [0.0, 1.0], [0.25, 0.75]];
    mesh.set_uvs(Some(uvs)).unwrap();
    mesh.set_normals(Some(vec![[0.0, 0.0, 1.0]; 6])).unwrap();
    mesh
}

fn colors(as_bytes: bool) -> Vec<[f32; 4]> {
    let k = |i: u8| if as_bytes { f32::from(i) / 255.0 } else { 0.123_456 + f32::from(i) / 512.0 };
    (0..6).map(|i| [k(i), k(255 - i), k(7), k(3)]).collect()
}

/// Returns one triangle of this size at map coordinates.
fn far(size: f64) -> TriMesh {
    let p = [500_000.123_456_789, 5_000_000.25, 7.0];
    let corners = vec![p, [p[0] + size, p[1], p[2]], [p[0], p[1] + size, p[2]]];
    TriMesh::new(Positions::F64(corners), vec![[0, 1, 2].map(VertexId)]).unwrap()
}

#[test]
fn wedges_become_vertices_and_keep_their_attributes() {
    for as_bytes in [true, false] {
        let mut mesh = seam();
        mesh.set_colors(Some(colors(as_bytes))).unwrap();
        for kind in indexed() {
            let got = again(&mesh, kind);
            assert_eq!((got.vertex_count(), got.wedge_count()), (6, 6), "{kind:?}");
            assert_eq!(got.triangles(), mesh.triangles());
            assert_eq!((got.uvs(), got.normals(), got.colors()), (mesh.uvs(), mesh.normals(), mesh.colors()));
            for w in (0..6).map(WedgeId) {
                let at = |m: &TriMesh| m.positions().view().get(m.vertex_of(w));
                assert_eq!(at(&got), at(&mesh), "{kind:?}");
            }
        }
    }
}

#[test]
fn wedges_without_attributes_are_not_split() {
    let mut mesh = seam();
    mesh.set_uvs(None).unwrap();
    mesh.set_normals(None).unwrap();
    for kind in indexed() {
        let got = again(&mesh, kind);
        assert_eq!(
            (got.vertex_count(), got.surface().triangles()),
            (4, mesh.surface().triangles()),
            "{kind:?}"
        );
        assert_eq!(got.positions(), mesh.positions());
    }
}

#[test]
fn ply_colours_are_bytes_where_that_loses_nothing() {
    let mut mesh = seam();
    let text = |mesh: &TriMesh| String::from_utf8(written(mesh, (Format::Ply, true)).0).unwrap();
    mesh.set_colors(Some(vec![[1.0, 0.0, 128.0 / 255.0, 1.0]; 6])).unwrap();
    let got = text(&mesh);
    assert!(
        got.contains("property uchar blue\n") && !got.contains("alpha") && got.contains(" 255 0 128\n"),
        "{got}"
    );
    mesh.set_colors(Some(vec![[0.3, 0.0, 0.5, 1.0]; 6])).unwrap();
    assert!(text(&mesh).contains("property float red\n"));
}

#[test]
fn double_precision_survives_in_ply_and_is_rounded_with_a_warning_in_stl() {
    let mesh = far(1.0);
    for ascii in [false, true] {
        assert_eq!(again(&mesh, (Format::Ply, ascii)).positions(), mesh.positions());
        let (_, warnings) = written(&mesh, (Format::Stl, ascii));
        assert_eq!(
            warnings,
            ["STL stores positions in single precision: they are rounded, which moves some by 2.5e-1"]
        );
    }
}

#[test]
fn gltf_keeps_the_precision_of_far_positions_in_its_node() {
    let mesh = far(100.0);
    for format in [Format::Glb, Format::Gltf] {
        let (bytes, warnings) = written(&mesh, (format, false));
        let said =
            "glTF stores positions in single precision, relative to the centre of the mesh: they are rounded";
        assert_eq!(warnings, [said]);
        let got = read(&bytes, format).unwrap().mesh;
        assert!(matches!(got.positions(), Positions::F64(_)));
        for (a, b) in got.positions().view().iter().zip(mesh.positions().view().iter()) {
            // Half a unit in the last place of 64.
            assert!((0..3).all(|k| (a[k] - b[k]).abs() <= 4e-6), "{a:?} {b:?}");
        }
    }
}

#[test]
fn stl_warns_of_what_it_cannot_carry() {
    let mut mesh = seam();
    mesh.set_colors(Some(colors(true))).unwrap();
    let (bytes, warnings) = written(&mesh, (Format::Stl, false));
    let lost = ["normals of vertices", "texture coordinates", "colours"];
    assert_eq!(warnings, lost.map(|what| format!("STL cannot carry {what}: dropped")));
    assert_eq!(bytes.len(), 84 + 2 * 50);
    assert!(!bytes.starts_with(b"solid"));
}

#[test]
fn a_mesh_without_faces_is_written_and_then_refused() {
    let mesh = TriMesh::new(Positions::F32(vec![[0.0; 3]]), vec![]).unwrap();
    for kind in KINDS {
        let got = read(&written(&mesh, kind).0, kind.0).unwrap_err();
        assert!(got.to_string().starts_with("no faces in the file"), "{kind:?}: {got}");
    }
}

#[test]
fn the_same_mesh_gives_the_same_bytes() {
    for kind in KINDS {
        assert_eq!(written(&seam(), kind), written(&seam(), kind));
    }
}

#[test]
fn stl_strips_of_a_grid_are_welded_in_order_of_appearance() {
    let n = 40u32;
    let points = (0..n * n).map(|i| [(i % n) as f32, (i / n) as f32, 0.0]).collect();
    let quads = (0..(n - 1) * (n - 1)).map(|q| q / (n - 1) * n + q % (n - 1));
    let faces = quads.flat_map(|a| [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]).map(|t| t.map(VertexId));
    let mesh = TriMesh::new(Positions::F32(points), faces.collect()).unwrap();
    for ascii in [false, true] {
        let got = again(&mesh, (Format::Stl, ascii));
        assert_eq!((got.vertex_count(), got.face_count()), ((n * n) as usize, mesh.face_count()));
        assert_eq!(got.triangles()[0], [0, 1, 2].map(WedgeId));
    }
}

/// Generates finite positions of any size, and faces over them.
fn any_mesh() -> impl Strategy<Value = TriMesh> {
    let number = prop::num::f32::NORMAL | prop::num::f32::ZERO | prop::num::f32::SUBNORMAL;
    let points = prop::collection::vec(prop::array::uniform3(number), 3..20);
    let faces = prop::collection::vec(prop::array::uniform3(0u32..1000), 1..30);
    (points, faces).prop_map(|(points, faces)| {
        let count = points.len() as u32;
        let faces = faces.into_iter().map(|f| f.map(|i| VertexId(i % count))).collect();
        TriMesh::new(Positions::F32(points), faces).unwrap()
    })
}

proptest! {
    #[test]
    fn indexed_formats_give_the_mesh_back(mesh in any_mesh()) {
        for kind in indexed() {
            prop_assert_eq!(&again(&mesh, kind), &mesh);
        }
    }

    #[test]
    fn stl_gives_the_corners_back(mesh in any_mesh()) {
        let corners = |m: &TriMesh| -> Vec<[[f64; 3]; 3]> {
            m.triangles().iter().map(|t| t.map(|w| m.positions().view().get(m.vertex_of(w)))).collect()
        };
        for ascii in [false, true] {
            // -0 and 0 are equal in both.
            prop_assert_eq!(corners(&again(&mesh, (Format::Stl, ascii))), corners(&mesh));
        }
    }

    #[test]
    fn damaged_files_do_not_panic(
        mesh in any_mesh(),
        cut in 0.0..1.0f64,
        flips in prop::collection::vec((0.0..1.0f64, 0u8..=255), 0..4),
    ) {
        for kind in KINDS {
            let (mut bytes, _) = written(&mesh, kind);
            let size = bytes.len() as f64;
            for (at, value) in &flips {
                bytes[(at * size) as usize] = *value;
            }
            let _ = read(&bytes, kind.0);
            let _ = read(&bytes[..(cut * size) as usize], kind.0);
        }
    }
}
