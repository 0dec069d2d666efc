//! What is held of every reader.

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Limits, ReadOptions, WriteOptions, read_bytes, write_to};

/// Reads the bytes as a format. Whatever is read is a mesh by its own constructors; it must be no larger than bytes can
/// make it, and go through the writer and the reader again with as many faces.
pub fn check(bytes: &[u8], format: Format) {
    let mut options = ReadOptions::default();
    options.format = Some(format);
    let mut limits = Limits::default();
    // What a compressed stranger may unpack to.
    limits.bytes = 16 << 20;
    limits.pixels = 1 << 20;
    options.limits = limits;
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
    if !matches!(format, Format::Gltf | Format::Glb) && !bytes.starts_with(&[0x1f, 0x8b]) {
        assert!(
            loaded.mesh.face_count() <= most,
            "{} faces of {} bytes",
            loaded.mesh.face_count(),
            bytes.len()
        );
    }
    if loaded.mesh.face_count() == 0 || loaded.mesh.face_count() > 100_000 {
        return;
    }
    let mut out = Vec::new();
    write_to(&loaded.mesh, Format::Ply, &WriteOptions::default(), &mut out).expect("memory takes all bytes");
    let mut again = ReadOptions::default();
    again.format = Some(Format::Ply);
    let back = read_bytes(&out, &again).expect("what we write, we read");
    assert_eq!(back.mesh.face_count(), loaded.mesh.face_count());
}
