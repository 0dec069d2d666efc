//! Checks of every reader and writer.

use std::io::{Cursor, Write};

use lodsmith_core::{TriMesh, VertexId};
use lodsmith_io::gltf::{Compression, Packing, Scene, SceneFormat};
use lodsmith_io::{
    Format, Limits, ReadOptions, WriteOptions, read_bytes, read_scene_bytes, write_scene_to, write_to,
};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Returns the options for reading untrusted bytes.
pub fn options(format: Format) -> ReadOptions {
    let mut options = ReadOptions::default();
    options.format = Some(format);
    let mut limits = Limits::default();
    // The limit on unpacked data.
    limits.bytes = 16 << 20;
    limits.pixels = 1 << 20;
    options.limits = limits;
    options
}

/// Returns the options for reading a 3MF file of our own writer.
fn trusted_options() -> ReadOptions {
    let mut options = ReadOptions::default();
    options.format = Some(Format::ThreeMf);
    options
}

/// Returns a 3MF file with these bytes as its model, uncompressed; the bytes themselves, if they are an archive.
pub fn as_three_mf(bytes: &[u8]) -> Vec<u8> {
    if bytes.starts_with(b"PK") {
        return bytes.to_vec();
    }
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    zip.start_file("3D/3dmodel.model", options).expect("writing to memory succeeds");
    zip.write_all(bytes).expect("writing to memory succeeds");
    zip.finish().expect("writing to memory succeeds").into_inner()
}

/// Reads the bytes as a format. The constructors check that the result is a valid mesh. In addition, its size must be
/// plausible for the bytes, and writing it in this format and in PLY and reading it again must give the same number of
/// faces. Only those with positions that the format cannot hold as finite numbers are left out.
pub fn check(bytes: &[u8], format: Format) {
    let options = options(format);
    // A face takes at least four bytes, or one byte in a strip. A scene may instantiate one mesh many times.
    let max_faces = bytes.len().saturating_mul(2);
    if let Ok(Some(scene)) = read_scene_bytes(bytes, &options) {
        let _ = scene.model();
        // A scene with any meshes can be written and read again.
        let same: Vec<_> = scene.meshes().iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
        let mut out = Vec::new();
        let written = if format == Format::Gltf { format } else { Format::Glb };
        scene.write(&same, written, &|_| None, &mut out).expect("writing to memory succeeds");
        let back = Scene::read(&out, &ReadOptions::default()).expect("written files can be read");
        for (before, after) in scene.meshes().iter().zip(back.meshes()) {
            assert_eq!(before.mesh.face_count(), after.mesh.face_count());
        }
        // 3MF has no faces with the same vertex twice and no non-finite numbers.
        let mut out = Vec::new();
        if write_scene_to(&scene, &[], Format::ThreeMf, &|_| None, &mut out).is_ok() {
            let back = read_scene_bytes(&out, &trusted_options()).expect("written 3MF files can be read");
            let faces = |scene: &Scene| scene.meshes().iter().map(|m| m.mesh.face_count()).sum::<usize>();
            assert!(back.is_some_and(|back| faces(&back) <= faces(&scene)));
        }
        for compression in Compression::ALL {
            let to = SceneFormat::new(format, Packing::new(compression, true));
            let mut out = Vec::new();
            // An accessor that no mesh uses may be damaged.
            if scene.write(&[], to, &|_| None, &mut out).is_err() {
                continue;
            }
            let back = Scene::read(&out, &ReadOptions::default()).expect("compressed files can be read");
            for (before, after) in scene.meshes().iter().zip(back.meshes()) {
                assert_eq!(before.mesh.face_count(), after.mesh.face_count());
            }
        }
    }
    let Ok(loaded) = read_bytes(bytes, &options) else { return };
    let faces = loaded.mesh.face_count();
    if !format.is_scene() && !bytes.starts_with(&[0x1f, 0x8b]) {
        assert!(faces <= max_faces, "{faces} faces of {} bytes", bytes.len());
    }
    if faces == 0 || faces > 100_000 {
        return;
    }
    for format in [Format::Ply, format] {
        let mut out = Vec::new();
        // A format may be unable to hold the mesh.
        let faces = finite_faces(&loaded.mesh, format);
        if write_to(&loaded.mesh, format, &WriteOptions::default(), &mut out).is_err() {
            assert!(format != Format::Ply || faces == 0, "PLY can hold every finite mesh");
            continue;
        }
        let mut again = ReadOptions::default();
        again.format = Some(format);
        let back = read_bytes(&out, &again).expect("written files can be read");
        assert_eq!(back.mesh.face_count(), faces, "through {format:?}");
    }
}

/// Counts the faces whose positions are all finite numbers in a format.
pub fn finite_faces(mesh: &TriMesh, format: Format) -> usize {
    let is_single = format.is_scene() || format == Format::Stl;
    let positions = mesh.positions().view();
    let holds = |x: f64| x.is_finite() && (!is_single || (x as f32).is_finite());
    let is_finite = |&v: &VertexId| positions.get(v).into_iter().all(holds);
    mesh.surface().triangles().iter().filter(|corners| corners.iter().all(is_finite)).count()
}
