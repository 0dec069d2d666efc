//! Text that `lodsmith simplify` prints.

use lodsmith_asset::report_json::cleanup;
use lodsmith_asset::warnings::refusals;
use lodsmith_asset::{Outcome, farthest};

use crate::numbers::{counted, grouped, seconds, short};
use crate::output::Output;
use crate::sizes;

/// Prints the outcome of one input.
pub(super) fn show(out: &Output, path: &str, done: &Outcome) {
    out.line(&line(done, path));
    sizes::line(done.sizes_before, done.written.sizes).iter().for_each(|line| out.detail(line));
    details(done).iter().for_each(|line| out.detail(line));
}

/// Returns the summary line.
fn line(done: &Outcome, path: &str) -> String {
    let r = &done.report;
    let percent = 100.0 * r.faces as f64 / r.input_faces.max(1) as f64;
    let share = |d: f64| short(if r.error.diagonal > 0.0 { 100.0 * d / r.error.diagonal } else { 0.0 });
    let error = match &r.error.measured {
        None => format!("rms {} %", share(r.error.estimate)),
        Some(m) => format!("rms {} %, max {} %", share(m.rms.symmetric), share(m.hausdorff.symmetric)),
    };
    let error = match r.error.bound {
        Some(bound) => format!("{error} (proven: {} %)", share(bound)),
        None => error,
    };
    format!(
        "{path}: {} → {} faces ({percent:.1} %), {error} of the diagonal, {}",
        grouped(r.input_faces),
        grouped(r.faces),
        seconds(done.clock.total())
    )
}

/// Returns the details for `-v`.
fn details(done: &Outcome) -> Vec<String> {
    let r = &done.report;
    let times: Vec<String> =
        done.clock.stages.iter().map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
    let mut lines = vec![format!("  {}, {}", times.join(", "), counted(done.threads, "thread", "threads"))];
    lines.extend(done.written.packed.as_ref().map(sizes::packed_line));
    lines.extend(farthest::text_of_run(r, &done.meshes).map(|text| format!("  largest distance {text}")));
    let (stopped_by, refusals) = (r.stopped_by.name().replace('_', " "), refusals(r));
    lines.push(match &*refusals {
        "" => format!("  stopped by {stopped_by}"),
        _ => format!("  stopped by {stopped_by}; refused: {refusals}"),
    });
    let repaired: Vec<String> = cleanup(r)
        .into_iter()
        .filter(|(_, n)| *n > 0)
        .map(|(name, n)| format!("{name} {}", grouped(n)))
        .collect();
    if !repaired.is_empty() {
        lines.push(format!("  repaired before the run: {}", repaired.join(", ").replace('_', " ")));
    }
    if r.locked_vertices > 0 {
        let faces = counted(r.locked_faces, "face", "faces");
        lines.push(format!("  locked: {}, {faces}", counted(r.locked_vertices, "vertex", "vertices")));
    }
    if r.parts_removed > 0 {
        lines.push(format!("  {} removed", counted(r.parts_removed, "part", "parts")));
    }
    if r.necks_cut > 0 {
        lines.push(format!("  {} cut", counted(r.necks_cut, "neck", "necks")));
    }
    if r.two_sided_pairs > 0 {
        let pairs = counted(r.two_sided_pairs, "pair", "pairs");
        lines.push(format!("  {pairs} of faces back to back simplified as one side and written as both"));
    }
    if r.pairs_contracted > 0 {
        lines.push(format!("  {} contracted", counted(r.pairs_contracted, "pair", "pairs")));
    }
    if let Some(c) = r.clustered.filter(|c| c.cell > 0.0) {
        let faces = counted(c.faces, "face", "faces");
        let edges = counted(c.non_manifold_edges, "edge", "edges");
        lines.push(format!("  {faces} by cells of {}; {edges} with more than two faces", short(c.cell)));
    }
    if r.pruned.parts > 0 {
        let parts = counted(r.pruned.parts, "small part", "small parts");
        lines.push(format!("  {parts} pruned first, with {}", counted(r.pruned.faces, "face", "faces")));
    }
    if done.meshes.len() > 1 {
        lines.extend(done.meshes.iter().map(|(name, m)| {
            let instances = counted(m.instances, "instance", "instances");
            format!("  {name}: {} → {} faces, {instances}", grouped(m.input_faces), grouped(m.faces))
        }));
    }
    lines
}
