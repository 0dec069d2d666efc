//! Round trips of every shape in every format.

use lodsmith_core::shapes;
use lodsmith_core::{Positions, TriMesh, VertexId};
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, write_to};

/// All file variants; the flag selects text.
fn kinds() -> impl Iterator<Item = (Format, bool)> {
    Format::WRITTEN.into_iter().flat_map(|format| [(format, false), (format, true)])
}

fn again(mesh: &TriMesh, (format, ascii): (Format, bool)) -> TriMesh {
    let mut options = WriteOptions::default();
    options.ascii = ascii;
    let mut bytes = Vec::new();
    write_to(mesh, format, &options, &mut bytes).unwrap();
    let loaded = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.format, format);
    loaded.into_mesh()
}

/// Returns the bits of the corners of all faces.
fn corners(mesh: &TriMesh) -> Vec<[[u64; 3]; 3]> {
    let view = mesh.positions().view();
    // STL merges corners of equal position, and turns -0 into 0.
    let bits = |v: VertexId| view.get(v).map(|x| (x + 0.0).to_bits());
    mesh.surface().triangles().iter().map(|t| t.map(bits)).collect()
}

/// Returns the shape scaled by a third, so that single precision does not hold its coordinates.
fn in_double_precision(mesh: &TriMesh) -> TriMesh {
    let positions = mesh.positions().view().iter().map(|p| p.map(|x| x / 3.0)).collect();
    TriMesh::new(Positions::F64(positions), mesh.surface().triangles().to_vec()).unwrap()
}

#[test]
fn every_shape_comes_back_bit_by_bit() {
    for (name, mesh) in shapes::all() {
        for kind in kinds() {
            let got = again(&mesh, kind);
            assert_eq!(corners(&got), corners(&mesh), "{name} {kind:?}");
            if kind.0 != Format::Stl {
                assert_eq!(got.positions(), mesh.positions(), "{name} {kind:?}");
                assert_eq!(got.triangles(), mesh.triangles(), "{name} {kind:?}");
            }
        }
    }
}

#[test]
fn double_precision_comes_back_where_the_format_has_it() {
    for (name, mesh) in shapes::all() {
        let mesh = in_double_precision(&mesh);
        for kind in kinds() {
            let got = again(&mesh, kind);
            if matches!(kind.0, Format::Obj | Format::Off | Format::Ply) {
                assert_eq!(got, mesh, "{name} {kind:?}");
                continue;
            }
            // The others round, with a warning; see `attributes::rounding_warning`.
            assert_eq!(got.face_count(), mesh.face_count(), "{name} {kind:?}");
            let diagonal = mesh.positions().view().bounds().unwrap().diagonal();
            for (a, b) in corners(&got).as_flattened().iter().zip(corners(&mesh).as_flattened()) {
                let far =
                    (0..3).map(|k| (f64::from_bits(a[k]) - f64::from_bits(b[k])).abs()).fold(0.0, f64::max);
                assert!(far <= 1e-6 * diagonal, "{name} {kind:?}: {far}");
            }
        }
    }
}
