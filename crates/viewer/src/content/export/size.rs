//! Estimated size of an exported file.

use lodsmith_core::model::Pose;
use lodsmith_core::{Model, Positions, Semantic, TriMesh};
use lodsmith_io::{Format, ModelSource};

use crate::content::{Lighter, Original};
use crate::numbers::significant;

/// Formats a number of bytes, such as `3.2 MB`.
pub fn byte_text(bytes: f64) -> String {
    let (unit, name) = if bytes < 1e6 { (1e3, "kB") } else { (1e6, "MB") };
    format!("{} {name}", significant(bytes / unit, 2))
}

/// Estimates the size of the shown mesh in a file of this format, without images that are separate files.
///
/// For a glTF scene that stays one, everything but its geometry is taken to have the size that it has in the
/// original file.
pub fn estimated_bytes(
    original: &Original,
    lighter: Option<&Lighter>,
    format: Format,
    is_ascii: bool,
) -> f64 {
    let model = lighter.map_or(original.model(), |l| &l.model);
    let is_scene = matches!(format, Format::Gltf | Format::Glb);
    if is_scene && matches!(original.file.source, ModelSource::Scene(_)) {
        let stored = std::fs::metadata(&original.path).map_or(0, |m| m.len()) as f64;
        let other = (stored - scene_bytes(original.model(), original.file.format)).max(0.0);
        let text = if format == Format::Gltf { 4.0 / 3.0 } else { 1.0 };
        return scene_bytes(model, format) + other * text;
    }
    if is_scene {
        return scene_bytes(model, format) + 1000.0;
    }
    // The instances of a scene are joined.
    let instances = model.instances(&Pose::default());
    let meshes = instances.iter().map(|i| &*model.meshes[i.mesh].mesh);
    meshes.map(|mesh| mesh_bytes(mesh, format, is_ascii)).sum::<f64>() + 200.0
}

/// Size of the geometry of all meshes as glTF buffers; in text they are in base 64.
fn scene_bytes(model: &Model, format: Format) -> f64 {
    let all: f64 = model.meshes.iter().map(|m| buffer_bytes(&m.mesh)).sum();
    if format == Format::Gltf { all * 4.0 / 3.0 } else { all }
}

fn buffer_bytes(mesh: &TriMesh) -> f64 {
    let wedges = mesh.wedge_count() as f64;
    let index = if mesh.wedge_count() <= 65_535 { 2.0 } else { 4.0 };
    wedges * wedge_bytes(mesh) + 3.0 * index * mesh.face_count() as f64
}

/// Bytes of a wedge in binary formats.
fn wedge_bytes(mesh: &TriMesh) -> f64 {
    let has = |there: bool, bytes: f64| if there { bytes } else { 0.0 };
    let further: usize = mesh.further_attributes().iter().map(|a| 4 * a.width).sum();
    12.0 + has(mesh.normals().is_some(), 12.0)
        + has(mesh.uvs().is_some(), 8.0)
        + has(mesh.colors().is_some(), 4.0)
        + further as f64
}

fn mesh_bytes(mesh: &TriMesh, format: Format, is_ascii: bool) -> f64 {
    let [faces, vertices, wedges] =
        [mesh.face_count(), mesh.vertex_count(), mesh.wedge_count()].map(|n| n as f64);
    let has_double = matches!(mesh.positions(), Positions::F64(_));
    // A coordinate as text, with a blank, and an index.
    let number = if has_double { 18.0 } else { 11.0 };
    let index = wedges.max(10.0).log10().ceil() + 1.0;
    let [normals, uvs, colors] = [mesh.normals().is_some(), mesh.uvs().is_some(), mesh.colors().is_some()]
        .map(u8::from)
        .map(f64::from);
    match format {
        Format::Stl if is_ascii => faces * (80.0 + 12.0 * number),
        Format::Stl => 50.0 * faces,
        Format::Ply if is_ascii => {
            wedges * (number * (3.0 + 3.0 * normals + 2.0 * uvs) + 16.0 * colors)
                + faces * (3.0 * index + 2.0)
        }
        Format::Ply => {
            // Joints, tangents and the like have no place in the file.
            let all = mesh.further_attributes().iter();
            let lost = all.filter(|a| !matches!(a.semantic, Semantic::Custom(_) | Semantic::Discrete { .. }));
            let lost = 4.0 * lost.map(|a| a.width).sum::<usize>() as f64;
            wedges * (wedge_bytes(mesh) - lost + if has_double { 12.0 } else { 0.0 }) + 13.0 * faces
        }
        Format::Off => vertices * 3.0 * number + faces * (3.0 * index + 2.0),
        _ => {
            let corner = index * (1.0 + normals + uvs);
            let seams = wedges * (normals * (3.0 * number + 3.0) + uvs * (2.0 * number + 3.0));
            vertices * (3.0 * number + 2.0 + 18.0 * colors) + seams + faces * (3.0 * corner + 2.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_io::AssetScope;

    use super::*;
    use crate::content::export::Export;

    #[test]
    fn an_estimate_is_close_to_the_file() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["finial.ply", "arm.glb"] {
            let path =
                std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata")).join(name);
            let original = Original::read(&path, AssetScope::Folder).unwrap();
            // 3MF is compressed: its size depends on the numbers.
            for format in Format::WRITTEN.into_iter().filter(|f| *f != Format::ThreeMf) {
                for ascii in [false, true] {
                    let path = folder.path().join(format!("out.{}", format.name()));
                    let textures = lodsmith_io::Textures::None;
                    let export = Export { path: path.clone(), format, ascii, textures, levels: Vec::new() };
                    export.write_shown(&original, None, &mut lodsmith::NoControl).unwrap();
                    let size = std::fs::metadata(&path).unwrap().len() as f64;
                    let ratio = estimated_bytes(&original, None, format, ascii) / size;
                    assert!((0.6..1.6).contains(&ratio), "{name} {format:?} {ascii}: {ratio} of {size}");
                }
            }
        }
    }
}
