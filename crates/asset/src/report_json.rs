//! JSON reports: the report of a run, and parts that the reports of several jobs share.

use lodsmith::options::by_name::{NamedOption, OPTIONS, OptionGroup, OptionValue, length_text};
use lodsmith::{CleanReport, Length, Levels, MeshCounts, Report, SimplifyOptions, Stop};
use lodsmith_core::measure::{Comparison, TwoWay};
use lodsmith_io::{Format, Sizes};
use serde_json::{Value, json};

use crate::destination::Destination;
use crate::farthest;
use crate::job::StageClock;
use crate::proposals;
use crate::sizes::{self, WriteOutcome};

/// Returns the report of a run.
pub fn run(report: &Report, options: &SimplifyOptions) -> Value {
    let r = report;
    let mut all = json!({
        "input": { "faces": r.input_faces, "vertices": r.input_vertices },
        "output": { "faces": r.faces, "vertices": r.vertices },
        "method": options.method.name(),
        "target": target(&options.stop),
        "reached": r.reached,
        "stopped_by": r.stopped_by.name(),
        "error": error_json(r),
        "refusals": refusals(r),
        "collapses": r.collapses,
        "parts_removed": r.parts_removed,
        "necks_cut": r.necks_cut,
        "pairs_contracted": r.pairs_contracted,
        "two_sided_pairs": r.two_sided_pairs,
        "unpaired_sheets": r.unpaired_sheets,
        "pruned": { "parts": r.pruned.parts, "faces": r.pruned.faces },
        "locked": { "vertices": r.locked_vertices, "faces": r.locked_faces },
        "seams_relaxed": r.seams_relaxed,
        "sharp_relaxed": r.sharp_relaxed,
        "fitted": r.fitted,
        "dropped": r.dropped,
        "proposals": proposals::to_json(r, options),
        "escalated": proposals::steps_json(r),
        "cleanup": by_name(cleanup(r)),
    });
    if let Some(c) = &r.clustered {
        all["clustered"] = json!({
            "cell": c.cell, "faces": c.faces, "vertices": c.vertices, "non_manifold_edges": c.non_manifold_edges,
        });
    }
    all
}

/// Returns the description of a file in reports: `counts` are its numbers of faces and vertices.
pub(crate) fn file(path: Value, format: Option<Format>, counts: [usize; 2], sizes: Option<Sizes>) -> Value {
    json!({
        "path": path, "format": format.map(Format::name), "faces": counts[0], "vertices": counts[1],
        "sizes": sizes::to_json(sizes),
    })
}

/// Returns the description of an output in reports; null without an output.
pub(crate) fn output(to: Option<&Destination>, counts: [usize; 2], written: &WriteOutcome) -> Value {
    let path = to.map(|to| to.sink.to_string());
    let mut output = file(path.into(), to.map(|to| to.format), counts, written.sizes);
    if let Some(packed) = &written.packed {
        output["packing"] = sizes::packed_json(packed);
    }
    output
}

/// Removes a property of an object and returns it; the other properties keep their order.
pub(crate) fn take(all: &mut Value, key: &str) -> Value {
    all.as_object_mut().and_then(|all| all.shift_remove(key)).unwrap_or_default()
}

/// Adds the properties of an object to another, replacing properties with the same name.
pub fn extend(all: &mut Value, more: Value) {
    if let (Value::Object(all), Value::Object(more)) = (all, more) {
        all.extend(more);
    }
}

/// Returns the error of a run as JSON.
pub fn error_json(report: &Report) -> Value {
    let e = &report.error;
    let mut measured = e.measured.as_ref().map(measured_json);
    if let (Some(measured), Some(part)) = (&mut measured, e.farthest_part) {
        measured["farthest"]["mesh"] = part.into();
    }
    json!({
        "estimate": e.estimate, "bound": e.bound, "measured": measured, "incomplete": e.is_incomplete,
        "unit": "model", "diagonal": e.diagonal,
    })
}

/// Returns the counts of a mesh by its name.
pub fn mesh_json((name, m): &(String, MeshCounts)) -> Value {
    json!({
        "name": name, "instances": m.instances, "reached": m.reached,
        "input": { "faces": m.input_faces, "vertices": m.input_vertices },
        "output": { "faces": m.faces, "vertices": m.vertices },
    })
}

/// Returns the counts of a repair.
pub fn cleaned(r: &CleanReport) -> Value {
    let (done, left) = clean_counts(r);
    json!({
        "input": { "faces": r.input_faces, "vertices": r.input_vertices },
        "output": { "faces": r.faces, "vertices": r.vertices },
        "done": by_name(done), "left": by_name(left),
    })
}

/// Returns a comparison.
pub fn comparison(c: &Comparison) -> Value {
    let relative = |x: &TwoWay| if c.diagonal > 0.0 { x.symmetric / c.diagonal } else { 0.0 };
    let mut all = measured_json(c);
    let more = json!({
        "p99": both_ways(&c.p99),
        "relative_to_diagonal": {
            "hausdorff": relative(&c.hausdorff), "mean": relative(&c.mean), "rms": relative(&c.rms),
        },
        "diagonal": c.diagonal,
        "normal_deviation_deg": { "mean": c.normal_mean_deg, "p95": c.normal_p95_deg },
        "samples": c.samples, "seed": c.seed,
    });
    extend(&mut all, more);
    all
}

/// Returns the measured distances as JSON, and where the largest is.
pub fn measured_json(m: &Comparison) -> Value {
    json!({
        "hausdorff": both_ways(&m.hausdorff), "mean": both_ways(&m.mean), "rms": both_ways(&m.rms),
        "farthest": m.farthest.as_ref().map(farthest::to_json),
    })
}

/// Returns a distance for each direction and for both together.
pub fn both_ways(x: &TwoWay) -> Value {
    json!({ "forward": x.forward, "backward": x.backward, "symmetric": x.symmetric })
}

/// Returns counts or seconds by name.
pub(crate) fn by_name<T: Into<Value>>(all: impl IntoIterator<Item = (&'static str, T)>) -> Value {
    Value::Object(all.into_iter().map(|(name, x)| (name.to_owned(), x.into())).collect())
}

/// Rounds seconds to the microsecond.
pub fn micros(secs: f64) -> f64 {
    (secs * 1e6).round() / 1e6
}

/// Returns the seconds of each stage.
pub fn seconds(clock: &StageClock) -> Value {
    by_name(clock.stages.iter().map(|(name, s)| (*name, micros(*s))))
}

/// Returns the refusals with their counts.
pub(crate) fn refusals(report: &Report) -> Value {
    by_name(report.refusals.iter().map(|(refusal, n)| (refusal.name(), *n)))
}

/// Returns the repairs before a run, with counts.
pub fn cleanup(report: &Report) -> [(&'static str, usize); 5] {
    let c = &report.cleanup;
    [
        ("welded_vertices", c.welded_vertices),
        ("degenerate_faces", c.degenerate_faces),
        ("duplicate_faces", c.duplicate_faces),
        ("non_finite_faces", c.non_finite_faces),
        ("unused_vertices", c.unused_vertices),
    ]
}

/// A count with its name in reports.
pub type Count = (&'static str, usize);

/// Returns the counts of a repair by name: first the repairs, then the remaining defects.
pub fn clean_counts(r: &CleanReport) -> ([Count; 12], [Count; 6]) {
    let done = [
        ("welded_vertices", r.welded_vertices),
        ("non_finite_faces", r.non_finite_faces),
        ("degenerate_faces", r.degenerate_faces),
        ("duplicate_faces", r.duplicate_faces),
        ("back_faces", r.back_faces),
        ("pruned_parts", r.pruned.parts),
        ("pruned_faces", r.pruned.faces),
        ("flipped_faces", r.flipped_faces),
        ("zero_area_faces", r.zero_area_faces),
        ("parted_vertices", r.parted_vertices),
        ("sewn_edges", r.sewn_edges),
        ("unused_vertices", r.unused_vertices),
    ];
    let left = [
        ("border_edges", r.remaining.border_edges),
        ("non_manifold_edges", r.remaining.non_manifold_edges),
        ("non_manifold_vertices", r.remaining.non_manifold_vertices),
        ("misoriented_edges", r.remaining.misoriented_edges),
        ("opposite_faces", r.remaining.opposite_faces),
        ("zero_area_faces", r.remaining.zero_area_faces),
    ];
    (done, left)
}

/// Returns the targets of a run by name.
pub fn target(stop: &Stop) -> Value {
    let options = SimplifyOptions::new(*stop);
    let value = |option: &NamedOption| {
        let value = match option.get(&options)? {
            OptionValue::Whole(n) => n.into(),
            OptionValue::Number(x) => x.into(),
            OptionValue::Length(length) => length_json(length),
            other => other.text().into(),
        };
        Some((option.name, value))
    };
    by_name(OPTIONS.iter().filter(|option| option.group == OptionGroup::Target).filter_map(value))
}

/// Returns the requested levels.
pub fn levels_target(levels: &Levels) -> Value {
    match levels {
        Levels::Ratios(ratios) => json!({ "levels": ratios }),
        Levels::Faces(faces) => json!({ "faces": faces }),
        Levels::Steps { count, factor } => json!({ "count": count, "factor": factor }),
        Levels::Errors(errors) => {
            json!({ "errors": errors.iter().copied().map(length_json).collect::<Vec<_>>() })
        }
        _ => Value::Null,
    }
}

/// Returns a length: a number in the units of the file, or a share of the diagonal as text.
fn length_json(length: Length) -> Value {
    match length {
        Length::Units(x) => x.into(),
        share => length_text(share).into(),
    }
}
