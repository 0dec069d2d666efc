//! Sizes of files before and after, and results of compression.

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::PackReport;
use lodsmith_io::vertex_cache::CacheUse;
use lodsmith_io::{Loaded, ReadOptions, Regions, Sizes, Warning};
use serde_json::{Value, json};

use crate::paths::{Sink, Source};

/// The outcome of writing one file.
#[derive(Debug, Default)]
pub struct WriteOutcome {
    /// Warnings about data that the format cannot store, and other notes.
    pub warnings: Vec<Warning>,
    /// Results of compression; `None` without it.
    pub packed: Option<PackReport>,
    /// Sizes of the output; `None` if they are not known.
    pub sizes: Option<Sizes>,
}

impl WriteOutcome {
    /// Returns the outcome of writing to a sink; `of_mesh` are the sizes of the written mesh. Sizes of a glTF file are
    /// read from the file.
    pub(crate) fn new(
        written: lodsmith_io::gltf::Written,
        sink: Option<&Sink>,
        of_mesh: Option<Sizes>,
    ) -> Self {
        let of_file = match sink {
            Some(Sink::Path(path)) => lodsmith_io::sizes_of_path(path, &Default::default()),
            _ => None,
        };
        Self { warnings: written.warnings, packed: written.packed, sizes: merged(of_file, of_mesh) }
    }
}

/// Returns the sizes from the structure of a file, or else from its mesh.
fn merged(of_file: Option<Sizes>, of_mesh: Option<Sizes>) -> Option<Sizes> {
    match (of_file, of_mesh) {
        (Some(file), Some(mut mesh)) if file.draw_calls == 0 => {
            mesh.file_bytes = file.file_bytes;
            Some(mesh)
        }
        (file, mesh) => file.or(mesh),
    }
}

/// Returns the sizes of an input; `read` are the sizes of the model that was read from it. Sizes of a glTF file are
/// read from the file, for the images beside it.
pub fn of_input(source: &Source, reading: &ReadOptions, read: Option<Sizes>) -> Option<Sizes> {
    let of_file = match source {
        Source::Path(path) => lodsmith_io::sizes_of_path(path, reading),
        Source::Stream => None,
    };
    merged(of_file, read)
}

/// Returns the sizes of a mesh that was read.
pub fn of_loaded(loaded: &Loaded) -> Option<Sizes> {
    Some(of_mesh(&loaded.mesh, &loaded.regions, true))
}

/// Returns the sizes of a mesh, with or without its materials.
pub fn of_mesh(mesh: &TriMesh, regions: &Regions, has_materials: bool) -> Sizes {
    let none = Regions::default();
    Sizes::of_mesh(mesh, if has_materials { regions } else { &none })
}

/// Returns sizes as JSON; null if they are not known.
pub fn to_json(sizes: Option<Sizes>) -> Value {
    sizes.map_or(Value::Null, |s| {
        json!({
            "triangles": s.triangles, "draw_calls": s.draw_calls, "texture_bytes": s.texture_bytes,
            "file_bytes": s.file_bytes,
        })
    })
}

/// Returns the efficiency of GPU caches as JSON.
pub fn cache_json(cache: &CacheUse) -> Value {
    json!({ "acmr": cache.acmr(), "atvr": cache.atvr(), "overfetch": cache.overfetch() })
}

/// Returns the results of compression as JSON.
pub fn packed_json(packed: &PackReport) -> Value {
    let errors = packed.errors.map(|e| {
        json!({
            "position": e.position, "position_share": e.position_share, "normal_deg": e.normal,
            "tangent_deg": e.tangent, "uv": e.uv, "color": e.color, "weight": e.weight,
            "rotation_deg": e.rotation, "translation": e.translation, "scale": e.scale,
        })
    });
    json!({
        "stream_bytes": packed.stream_bytes, "packed_bytes": packed.packed_bytes, "errors": errors,
        "cache": { "before": cache_json(&packed.cache_before), "after": cache_json(&packed.cache) },
    })
}
