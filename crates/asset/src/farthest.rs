//! The place of the largest measured distance, as JSON and as text.

use lodsmith::{MeshCounts, Report};
use lodsmith_core::measure::{Comparison, FarthestPoint};
use lodsmith_core::numbers::{point, significant};
use serde_json::{Value, json};

/// Returns the place of the largest distance as JSON.
pub(crate) fn to_json(farthest: &FarthestPoint) -> Value {
    json!({ "direction": farthest.direction(), "point": farthest.point, "nearest": farthest.nearest })
}

/// Returns the largest distance of a comparison and its place as text, such as `0.012 at 1.0000, 2.5000, 0 of the input`;
/// `None` without a place. `names` are those of the reference and of the candidate.
pub fn text(measured: &Comparison, names: [&str; 2]) -> Option<String> {
    let farthest = measured.farthest?;
    let distance = significant(measured.hausdorff.symmetric, 3);
    let at = point(farthest.point, measured.diagonal);
    Some(format!("{distance} at {at} of the {}", names[usize::from(!farthest.is_forward)]))
}

/// Returns the text for a run: see [`text`]; with the name of the mesh, if there are several.
pub fn text_of_run(report: &Report, meshes: &[(String, MeshCounts)]) -> Option<String> {
    let text = text(report.error.measured.as_ref()?, ["input", "result"])?;
    let mesh = report.error.farthest_part.and_then(|part| meshes.get(part));
    Some(match mesh {
        Some((name, _)) if meshes.len() > 1 => format!("{text}, in {name}"),
        _ => text,
    })
}
