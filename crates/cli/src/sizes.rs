//! Sizes of files before and after, and what packing did, for reports.

use lodsmith::core::TriMesh;
use lodsmith_io::gltf::PackReport;
use lodsmith_io::vertex_cache::CacheUse;
use lodsmith_io::{Loaded, Regions, Sizes, Warning};
use serde_json::{Value, json};

use crate::args::Reading;
use crate::numbers::grouped;
use crate::paths::{Sink, Source};

/// The outcome of writing one file.
#[derive(Default)]
pub(crate) struct WriteOutcome {
    pub(crate) warnings: Vec<Warning>,
    /// `None` without packing.
    pub(crate) packed: Option<PackReport>,
    /// `None` if they are not known.
    pub(crate) sizes: Option<Sizes>,
}

impl WriteOutcome {
    /// Returns the outcome for what was written to a sink; `of_mesh` are sizes of it by its mesh.
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

/// Returns the sizes of a file by its structure, else by its mesh.
fn merged(of_file: Option<Sizes>, of_mesh: Option<Sizes>) -> Option<Sizes> {
    match (of_file, of_mesh) {
        (Some(file), Some(mut mesh)) if file.draw_calls == 0 => {
            mesh.file_bytes = file.file_bytes;
            Some(mesh)
        }
        (file, mesh) => file.or(mesh),
    }
}

/// Returns the sizes of an input; `read` are those of what was read from it.
pub(crate) fn of_input(source: &Source, reading: &Reading, read: Option<Sizes>) -> Option<Sizes> {
    let of_file = match source {
        Source::Path(path) => lodsmith_io::sizes_of_path(path, &reading.options()),
        Source::Stdin => None,
    };
    merged(of_file, read)
}

/// Returns the sizes of a mesh that was read.
pub(crate) fn of_loaded(loaded: &Loaded) -> Option<Sizes> {
    Some(of_mesh(&loaded.mesh, &loaded.regions, true))
}

/// Returns the sizes of a mesh with its materials, or without any.
pub(crate) fn of_mesh(mesh: &TriMesh, regions: &Regions, has_materials: bool) -> Sizes {
    let none = Regions::default();
    Sizes::of_mesh(mesh, if has_materials { regions } else { &none })
}

/// Returns sizes as JSON; null if they are not known.
pub(crate) fn to_json(sizes: Option<Sizes>) -> Value {
    sizes.map_or(Value::Null, |s| {
        json!({
            "triangles": s.triangles, "draw_calls": s.draw_calls, "texture_bytes": s.texture_bytes,
            "file_bytes": s.file_bytes,
        })
    })
}

/// Returns how well an order suits the caches of a GPU as JSON.
pub(crate) fn cache_json(cache: &CacheUse) -> Value {
    json!({ "acmr": cache.acmr(), "atvr": cache.atvr(), "overfetch": cache.overfetch() })
}

/// Returns what packing did as JSON.
pub(crate) fn packed_json(packed: &PackReport) -> Value {
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

/// Returns the line about sizes before and after; `None` if neither is known.
pub(crate) fn line(before: Option<Sizes>, after: Option<Sizes>) -> Option<String> {
    if before.is_none() && after.is_none() {
        return None;
    }
    let change = |of: &dyn Fn(&Sizes) -> Option<String>| {
        let one = |sizes: Option<Sizes>| sizes.as_ref().and_then(of);
        match (one(before), one(after)) {
            (Some(a), Some(b)) => format!("{a} → {b}"),
            (Some(a), None) => a,
            (None, Some(b)) => format!("? → {b}"),
            (None, None) => "?".to_owned(),
        }
    };
    let count = |n: u64| Some(grouped(usize::try_from(n).unwrap_or(usize::MAX)));
    Some(format!(
        "  triangles {}, draw calls {}, textures {}, file {}",
        change(&|s| count(s.triangles)),
        change(&|s| count(s.draw_calls)),
        change(&|s| Some(bytes(s.texture_bytes))),
        change(&|s| s.file_bytes.map(bytes)),
    ))
}

/// Returns the line about what packing did.
pub(crate) fn packed_line(packed: &PackReport) -> String {
    let (a, b) = (&packed.cache_before, &packed.cache);
    let streams = match packed.packed_bytes {
        0 => String::new(),
        n => format!("streams {} → {}, ", bytes(packed.stream_bytes), bytes(n)),
    };
    format!(
        "  {streams}vertex cache: ACMR {:.3} → {:.3}, ATVR {:.2} → {:.2}, overfetch {:.2} → {:.2}",
        a.acmr(),
        b.acmr(),
        a.atvr(),
        b.atvr(),
        a.overfetch(),
        b.overfetch()
    )
}

/// Formats a number of bytes, in powers of 1000.
pub(crate) fn bytes(n: u64) -> String {
    let units = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    match units.into_iter().find(|(unit, _)| n as f64 >= *unit) {
        Some((unit, name)) => {
            let x = n as f64 / unit;
            if x < 9.95 { format!("{x:.1} {name}") } else { format!("{x:.0} {name}") }
        }
        None => format!("{n} B"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_two_digits() {
        assert_eq!(
            [0, 999, 1_000, 9_949, 9_951, 123_456_789].map(bytes),
            ["0 B", "999 B", "1.0 kB", "9.9 kB", "10 kB", "123 MB"].map(String::from)
        );
    }

    #[test]
    fn what_is_not_known_is_a_question_mark() {
        assert_eq!(line(None, None), None);
        let mut sizes = Sizes::default();
        (sizes.triangles, sizes.draw_calls) = (12, 1);
        assert_eq!(
            line(None, Some(sizes)).unwrap(),
            "  triangles ? → 12, draw calls ? → 1, textures ? → 0 B, file ?"
        );
    }
}
