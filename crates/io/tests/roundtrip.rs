//! Round trips of the text formats, which carry every attribute or warn about dropped ones.

use lodsmith_core::{Positions, TriMesh, VertexId, WedgeId};
use lodsmith_io::{
    Format, Loaded, ReadOptions, Warning, WriteOptions, read_bytes, read_path, write_path, write_to,
};
use proptest::prelude::*;

/// The formats tested here, by the same rules.
const FORMATS: [Format; 2] = [Format::Obj, Format::Off];

fn there_and_back(mesh: &TriMesh, format: Format) -> (Loaded, Vec<Warning>) {
    let mut bytes = Vec::new();
    let warnings = write_to(mesh, format, &WriteOptions::default(), &mut bytes).unwrap().warnings;
    let loaded = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.format, format);
    (loaded, warnings)
}

/// The values at each corner of each face.
type Corner = ([u64; 3], Option<[u32; 3]>, Option<[u32; 2]>, Option<[u32; 4]>);

fn corners(mesh: &TriMesh) -> Vec<Corner> {
    let corner = |w: &WedgeId| {
        (
            mesh.positions().view().get(mesh.vertex_of(*w)).map(f64::to_bits),
            mesh.normals().map(|b| b[w.index()].map(f32::to_bits)),
            mesh.uvs().map(|b| b[w.index()].map(f32::to_bits)),
            mesh.colors().map(|b| b[w.index()].map(f32::to_bits)),
        )
    };
    mesh.triangles().iter().flatten().map(corner).collect()
}

fn square() -> TriMesh {
    let positions = vec![[0.1, 0.0, 0.0], [1.0, 0.3, 1e-9], [1.0, 1.0, -2.5e20], [0.0, 1.0, 1.0 / 3.0]];
    let faces = [[0, 1, 2], [0, 2, 3]].map(|t| t.map(VertexId)).to_vec();
    TriMesh::new(Positions::F32(positions), faces).unwrap()
}

fn with_attributes(mut mesh: TriMesh) -> TriMesh {
    let count = mesh.wedge_count();
    mesh.set_normals(Some(
        (0..count).map(|i| if i % 2 == 0 { [0.0, 0.6, 0.8] } else { [1.0, 0.0, 0.0] }).collect(),
    ))
    .unwrap();
    mesh.set_uvs(Some((0..count).map(|i| [i as f32 / 7.0, 0.3]).collect())).unwrap();
    mesh.set_colors(Some((0..count).map(|i| [(i % 4) as f32 / 4.0, 0.5, 0.1, 1.0]).collect())).unwrap();
    mesh
}

#[test]
fn a_mesh_without_seams_comes_back_as_it_was() {
    for format in FORMATS {
        for mesh in [square(), with_attributes(square())] {
            let (loaded, warnings) = there_and_back(&mesh, format);
            assert_eq!(*loaded.mesh, mesh, "{format:?}");
            assert!(
                warnings.is_empty() && loaded.warnings.is_empty(),
                "{format:?} {warnings:?} {:?}",
                loaded.warnings
            );
        }
    }
}

#[test]
fn double_precision_survives() {
    let positions = vec![[500000.123456, 4_649_776.22, 0.1], [500001.0, 4_649_777.0, 0.2], [1e300, 1.0, 2.0]];
    let mesh = TriMesh::new(Positions::F64(positions), vec![[0, 1, 2].map(VertexId)]).unwrap();
    for format in FORMATS {
        assert_eq!(*there_and_back(&mesh, format).0.mesh, mesh, "{format:?}");
    }
}

#[test]
fn seams_keep_the_values_at_every_corner() {
    let map = [0, 1, 2, 2, 3, 0].map(VertexId).to_vec();
    let faces = [[0, 1, 2], [5, 3, 4]].map(|t| t.map(WedgeId)).to_vec();
    let mesh = TriMesh::with_wedges(square().positions().clone(), map, faces).unwrap();
    let mut mesh = with_attributes(mesh);
    // Colours of OBJ belong to vertices.
    mesh.set_colors(None).unwrap();
    for format in FORMATS {
        let (loaded, warnings) = there_and_back(&mesh, format);
        assert_eq!(corners(&loaded.mesh), corners(&mesh), "{format:?}");
        assert!(warnings.iter().all(|w| !w.data_lost));
    }
    assert_eq!(there_and_back(&mesh, Format::Obj).0.mesh.vertex_count(), 4);
}

#[test]
fn dropped_content_is_reported() {
    let map = [0, 1, 2, 2].map(VertexId).to_vec();
    let faces = [[0, 1, 2], [0, 1, 3]].map(|t| t.map(WedgeId)).to_vec();
    let mut mesh = TriMesh::with_wedges(square().positions().clone(), map, faces).unwrap();
    mesh.set_colors(Some(vec![[1.0; 4], [1.0; 4], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.5]])).unwrap();
    let (_, warnings) = there_and_back(&mesh, Format::Obj);
    let texts: Vec<_> = warnings.iter().map(|w| (w.text.as_str(), w.data_lost)).collect();
    assert_eq!(
        texts,
        [
            ("OBJ cannot carry the alpha of colours: dropped", true),
            ("OBJ has one colour per vertex: those of 1 wedges that differ are dropped", true),
        ]
    );
    let (loaded, warnings) = there_and_back(&mesh, Format::Off);
    assert_eq!(corners(&loaded.mesh), corners(&mesh));
    assert!(warnings.iter().all(|w| !w.data_lost), "{warnings:?}");
}

#[test]
fn colors_of_bytes_stay_bytes() {
    let mut mesh = square();
    let byte = |b: u8| f32::from(b) / 255.0;
    mesh.set_colors(Some((0..4u8).map(|i| [byte(i), byte(255), byte(7 * i), byte(128)]).collect())).unwrap();
    let (loaded, _) = there_and_back(&mesh, Format::Off);
    assert_eq!(*loaded.mesh, mesh);
}

#[test]
fn files_are_packed_replaced_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = with_attributes(square());
    let entries = || std::fs::read_dir(folder.path()).unwrap().count();
    for (i, name) in
        ["a.obj", "name with spaces – ünïcödé 名.off", "b.OBJ.gz", "c.off.gz"].into_iter().enumerate()
    {
        let path = folder.path().join(name);
        for _ in 0..2 {
            write_path(&mesh, &path, &WriteOptions::default()).unwrap();
            assert_eq!(*read_path(&path, &ReadOptions::default()).unwrap().mesh, mesh, "{name}");
        }
        assert_eq!(std::fs::read(&path).unwrap().starts_with(&[0x1f, 0x8b]), name.ends_with(".gz"));
        assert_eq!(entries(), i + 1);
    }
    for (name, wanted) in [
        ("", "cannot write: it is a folder"),
        ("none/a.obj", "cannot write: there is no folder"),
        ("a.xyz", "the extension does not belong to a known format"),
    ] {
        let path = folder.path().join(name);
        let options = if name.is_empty() { "obj" } else { "" };
        let mut with_format = WriteOptions::default();
        with_format.format = Format::from_name(options);
        let error = write_path(&mesh, &path, &with_format).unwrap_err().to_string();
        assert!(error.contains(wanted) && error.starts_with(&*path.to_string_lossy()), "{error}");
    }
    assert_eq!(entries(), 4);
}

#[cfg(unix)]
#[test]
fn permissions_are_kept_or_default() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let mode = |p: &std::path::Path| std::fs::metadata(p).unwrap().permissions().mode() & 0o777;
    let (plain, ours) = (folder.path().join("plain"), folder.path().join("a.obj"));
    std::fs::write(&plain, "").unwrap();
    write_path(&square(), &ours, &WriteOptions::default()).unwrap();
    assert_eq!(mode(&ours), mode(&plain));
    std::fs::set_permissions(&ours, std::fs::Permissions::from_mode(0o640)).unwrap();
    let link = folder.path().join("link.obj");
    std::os::unix::fs::symlink(&ours, &link).unwrap();
    write_path(&square(), &link, &WriteOptions::default()).unwrap();
    assert_eq!(mode(&ours), 0o640);
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
}

#[test]
fn a_failing_stream_is_an_error() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("full"))
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    for format in FORMATS {
        let error = write_to(&square(), format, &WriteOptions::default(), &mut Full).unwrap_err();
        assert_eq!(error.to_string(), "output stream: cannot write: full");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Any finite numbers come back bit for bit, whatever precision the reader chooses.
    #[test]
    fn any_positions_survive(
        points in prop::collection::vec(prop::array::uniform3(prop::num::f32::NORMAL | prop::num::f32::ZERO), 3..20),
        picks in prop::collection::vec(prop::array::uniform3(0usize..1000), 1..30),
    ) {
        let faces = picks.iter().map(|t| t.map(|i| VertexId::new(i % points.len()))).collect();
        let mesh = TriMesh::new(Positions::F32(points), faces).unwrap();
        for format in FORMATS {
            let (loaded, _) = there_and_back(&mesh, format);
            prop_assert_eq!(&*loaded.mesh, &mesh);
        }
    }
}
