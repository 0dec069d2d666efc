//! What is held of every reader, and of every writer behind it.

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Limits, ReadOptions, WriteOptions, read_bytes, write_to};

/// How strangers' bytes are read here.
pub fn options(format: Format) -> ReadOptions {
    let mut options = ReadOptions::default();
    options.format = Some(format);
    let mut limits = Limits::default();
    // What a compressed stranger may unpack to.
    limits.bytes = 16 << 20;
    limits.pixels = 1 << 20;
    options.limits = limits;
    options
}

/// Reads the bytes as a format. Whatever is read is a mesh by its own constructors; it must be no larger than bytes can
/// make it, and go through the writer of this format and that of PLY, and the reader again, with as many faces.
pub fn check(bytes: &[u8], format: Format) {
    let options = options(format);
    // Four bytes name a face at the least, in a strip one byte does. A glTF scene may place one mesh many times.
    let most = bytes.len().saturating_mul(2);
    if matches!(format, Format::Gltf | Format::Glb)
        && let Ok(scene) = Scene::read(bytes, &options)
    {
        let _ = scene.model();
        // Whatever becomes of its meshes, a scene that is read is written and read again.
        let same: Vec<_> = scene.meshes().iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
        let mut out = Vec::new();
        scene.write(&same, format, &|_| None, &mut out).expect("memory takes all bytes");
        let back = Scene::read(&out, &ReadOptions::default()).expect("what we write, we read");
        for (before, after) in scene.meshes().iter().zip(back.meshes()) {
            assert_eq!(before.mesh.face_count(), after.mesh.face_count());
        }
    }
    let Ok(loaded) = read_bytes(bytes, &options) else { return };
    let faces = loaded.mesh.face_count();
    if !matches!(format, Format::Gltf | Format::Glb) && !bytes.starts_with(&[0x1f, 0x8b]) {
        assert!(faces <= most, "{faces} faces of {} bytes", bytes.len());
    }
    if faces == 0 || faces > 100_000 {
        return;
    }
    for format in [Format::Ply, format] {
        let mut out = Vec::new();
        // A format may say that it cannot hold the mesh.
        if write_to(&loaded.mesh, format, &WriteOptions::default(), &mut out).is_err() {
            assert!(format != Format::Ply, "PLY holds every mesh");
            continue;
        }
        let mut again = ReadOptions::default();
        again.format = Some(format);
        let back = read_bytes(&out, &again).expect("what we write, we read");
        assert_eq!(back.mesh.face_count(), faces, "through {format:?}");
    }
}
