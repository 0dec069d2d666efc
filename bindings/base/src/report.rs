//! Reports as JSON, with the keys that the command has.

use lodsmith::{Change, CleanReport, Length, Report};
use lodsmith_core::measure::{Comparison, TwoWay};
use serde_json::{Map, Value, json};

/// Returns a figure for each direction and for both.
fn both_ways(x: &TwoWay) -> Value {
    json!({ "forward": x.forward, "backward": x.backward, "symmetric": x.symmetric })
}

/// Returns a comparison.
pub fn comparison(c: &Comparison) -> Value {
    json!({
        "hausdorff": both_ways(&c.hausdorff), "mean": both_ways(&c.mean), "rms": both_ways(&c.rms),
        "p99": both_ways(&c.p99), "normal_mean_deg": c.normal_mean_deg, "normal_p95_deg": c.normal_p95_deg,
        "diagonal": c.diagonal, "samples": c.samples, "seed": c.seed,
    })
}

/// Returns a change of an option: its keyword, and the value or direction that it would need.
fn change(change: Change) -> Value {
    let (option, to) = match change {
        Change::Border(to) => ("border", to.name().into()),
        Change::Topology(to) => ("topology", to.name().into()),
        Change::Placement(to) => ("placement", to.name().into()),
        Change::MaxNormal => ("max_normal", "higher".into()),
        Change::MinQuality => ("min_quality", "lower".into()),
        Change::MaxValence => ("max_valence", "higher".into()),
        Change::MaxEdge => ("max_edge", "higher".into()),
        Change::Locked => ("locked", "less".into()),
        Change::Pairs(Length::Units(x)) => ("pairs", json!(x)),
        Change::Pairs(Length::OfDiagonal(x)) => ("pairs", json!(format!("{}%", 100.0 * x))),
    };
    json!({ "option": option, "to": to })
}

/// Returns the report of a run.
pub fn report(r: &Report) -> Value {
    let e = &r.error;
    let c = &r.cleanup;
    let measured = e.measured.as_ref().map(|m| {
        json!({ "hausdorff": both_ways(&m.hausdorff), "mean": both_ways(&m.mean), "rms": both_ways(&m.rms) })
    });
    let refusals: Map<_, _> =
        r.refusals.iter().map(|(why, n)| (why.name().to_owned(), Value::from(*n))).collect();
    let mut all = json!({
        "input": { "faces": r.input_faces, "vertices": r.input_vertices },
        "output": { "faces": r.faces, "vertices": r.vertices },
        "reached": r.reached,
        "stopped_by": r.stopped_by.name(),
        "error": { "estimate": e.estimate, "bound": e.bound, "measured": measured, "unit": "model", "diagonal": e.diagonal },
        "refusals": refusals,
        "collapses": r.collapses,
        "parts_removed": r.parts_removed,
        "necks_cut": r.necks_cut,
        "pairs_contracted": r.pairs_contracted,
        "two_sided_pairs": r.two_sided_pairs,
        "pruned": { "parts": r.pruned.parts, "faces": r.pruned.faces },
        "locked": { "vertices": r.locked_vertices, "faces": r.locked_faces },
        "seams_relaxed": r.seams_relaxed,
        "sharp_relaxed": r.sharp_relaxed,
        "missing_values": r.missing_values,
        "fitted": r.fitted,
        "dropped": r.dropped,
        "proposals": r.proposals.iter().map(|p| {
            json!({ "changes": p.changes.iter().map(|c| change(*c)).collect::<Vec<_>>(), "gain": p.gain })
        }).collect::<Vec<_>>(),
        "escalated": r.escalated.iter().map(|step| {
            json!({ "change": change(step.change), "before": step.before, "after": step.after })
        }).collect::<Vec<_>>(),
        "cleanup": {
            "welded_vertices": c.welded_vertices, "degenerate_faces": c.degenerate_faces,
            "duplicate_faces": c.duplicate_faces, "non_finite_faces": c.non_finite_faces,
            "unused_vertices": c.unused_vertices,
        },
    });
    if let Some(c) = &r.clustered {
        all["clustered"] = json!({
            "cell": c.cell, "faces": c.faces, "vertices": c.vertices, "non_manifold_edges": c.non_manifold_edges,
        });
    }
    all
}

/// Returns the report of a clean-up.
pub fn cleaned(r: &CleanReport) -> Value {
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
