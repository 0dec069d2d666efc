//! JSON reports that only this package has.

use lodsmith::CleanReport;
use lodsmith::core::measure::Comparison;
use lodsmith_asset::report_json::both_ways;
use serde_json::{Value, json};

/// Returns a comparison as JSON.
pub(crate) fn comparison(c: &Comparison) -> Value {
    json!({
        "hausdorff": both_ways(&c.hausdorff), "mean": both_ways(&c.mean), "rms": both_ways(&c.rms),
        "p99": both_ways(&c.p99), "normal_mean_deg": c.normal_mean_deg, "normal_p95_deg": c.normal_p95_deg,
        "diagonal": c.diagonal, "samples": c.samples, "seed": c.seed,
    })
}

/// Returns the report of a clean-up.
pub(crate) fn cleaned(r: &CleanReport) -> Value {
    let left = &r.remaining;
    json!({
        "input": { "faces": r.input_faces, "vertices": r.input_vertices },
        "output": { "faces": r.faces, "vertices": r.vertices },
        "welded_vertices": r.welded_vertices,
        "non_finite_faces": r.non_finite_faces,
        "degenerate_faces": r.degenerate_faces,
        "duplicate_faces": r.duplicate_faces,
        "back_faces": r.back_faces,
        "pruned": { "parts": r.pruned.parts, "faces": r.pruned.faces },
        "flipped_faces": r.flipped_faces,
        "zero_area_faces": r.zero_area_faces,
        "parted_vertices": r.parted_vertices,
        "sewn_edges": r.sewn_edges,
        "unused_vertices": r.unused_vertices,
        "remaining": {
            "border_edges": left.border_edges, "non_manifold_edges": left.non_manifold_edges,
            "non_manifold_vertices": left.non_manifold_vertices, "misoriented_edges": left.misoriented_edges,
            "opposite_faces": left.opposite_faces, "zero_area_faces": left.zero_area_faces,
        },
    })
}
