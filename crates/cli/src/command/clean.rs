//! Text that `lodsmith clean` prints.

use lodsmith_asset::CleanOutcome;
use lodsmith_asset::report_json::clean_counts;

use crate::numbers::{grouped, seconds};
use crate::output::Output;
use crate::sizes;

/// Prints the outcome of one input.
pub(super) fn show(out: &Output, path: &str, done: &CleanOutcome) {
    table(done, path).iter().for_each(|line| out.line(line));
    let details = sizes::line(done.sizes_before, done.written.sizes).into_iter();
    for line in details.chain(done.written.packed.as_ref().map(sizes::packed_line)) {
        out.detail(&line);
    }
    for (name, r) in done.meshes.iter().filter(|_| done.meshes.len() > 1) {
        out.detail(&format!("  mesh {name}: {} → {} faces", grouped(r.input_faces), grouped(r.faces)));
    }
}

/// Returns a summary line, and a line for each step that changed something.
fn table(outcome: &CleanOutcome, path: &str) -> Vec<String> {
    let r = &outcome.report;
    let mut lines = vec![format!(
        "{path}: {} → {} faces, {} → {} vertices, {}",
        grouped(r.input_faces),
        grouped(r.faces),
        grouped(r.input_vertices),
        grouped(r.vertices),
        seconds(outcome.clock.total())
    )];
    let (done, left) = clean_counts(r);
    let mut rows = |title: &str, counts: &[(&str, usize)]| {
        let texts: Vec<String> = counts
            .iter()
            .filter(|c| c.1 > 0)
            .map(|(name, n)| format!("{} {}", grouped(*n), name.replace('_', " ")))
            .collect();
        if !texts.is_empty() {
            lines.push(format!("  {title:<6}{}", texts.join(", ")));
        }
    };
    rows("done", &done);
    rows("left", &left);
    lines
}
