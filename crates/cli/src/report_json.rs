//! Parts of JSON reports that several commands have.

use lodsmith::core::measure::{Comparison, TwoWay};
use lodsmith::{MeshCounts, Report};
use serde_json::{Value, json};

/// Returns the error of a run as JSON.
pub(crate) fn error_json(report: &Report) -> Value {
    let e = &report.error;
    json!({
        "estimate": e.estimate, "bound": e.bound, "measured": e.measured.as_ref().map(measured_json),
        "unit": "model", "diagonal": e.diagonal,
    })
}

/// Returns the counts of a mesh by its name.
pub(crate) fn mesh_json((name, m): &(String, MeshCounts)) -> Value {
    json!({
        "name": name, "instances": m.instances, "reached": m.reached,
        "input": { "faces": m.input_faces, "vertices": m.input_vertices },
        "output": { "faces": m.faces, "vertices": m.vertices },
    })
}

/// Returns the measured distances as JSON.
pub(crate) fn measured_json(m: &Comparison) -> Value {
    json!({ "hausdorff": both_ways(&m.hausdorff), "mean": both_ways(&m.mean), "rms": both_ways(&m.rms) })
}

/// Returns a figure for each direction and for both.
pub(crate) fn both_ways(x: &TwoWay) -> Value {
    json!({ "forward": x.forward, "backward": x.backward, "symmetric": x.symmetric })
}
