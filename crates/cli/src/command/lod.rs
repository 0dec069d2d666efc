//! Text that `lodsmith lod` prints.

use lodsmith_asset::{LodOutcome, farthest};

use crate::numbers::{counted, grouped, seconds, short};
use crate::output::Output;
use crate::sizes;

/// Prints the outcome.
pub(super) fn show(out: &Output, path: &str, done: &LodOutcome) {
    lines(done, path).iter().for_each(|line| out.line(line));
    for (k, level) in done.levels.iter().enumerate() {
        if let Some(text) = farthest::text_of_run(&level.report, &level.meshes) {
            out.detail(&format!("  {}: largest distance {text}", k + 1));
        }
    }
    for (k, file) in done.written.iter().enumerate() {
        if let Some(line) = sizes::line(done.sizes_before, file.sizes) {
            out.detail(&if done.written.len() > 1 { format!("  {k}:{line}") } else { line });
        }
        if let Some(packed) = &file.packed {
            out.detail(&sizes::packed_line(packed));
        }
    }
    let times: Vec<String> =
        done.clock.stages.iter().map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
    out.detail(&format!("  {}, {}", times.join(", "), counted(done.threads, "thread", "threads")));
}

/// Returns a summary line, and a line for each level.
fn lines(done: &LodOutcome, path: &str) -> Vec<String> {
    let mut lines = vec![format!(
        "{path}: {}, {}, {}",
        counted(done.counts[0], "face", "faces"),
        counted(done.levels.len(), "level", "levels"),
        seconds(done.clock.total())
    )];
    for (k, level) in done.levels.iter().enumerate() {
        let r = &level.report;
        let percent = 100.0 * r.faces as f64 / done.counts[0].max(1) as f64;
        let share = |d: f64| short(if done.diagonal > 0.0 { 100.0 * d / done.diagonal } else { 0.0 });
        let error = match &r.error.measured {
            None => format!("rms {} %", share(r.error.estimate)),
            Some(m) => format!("rms {} %, max {} %", share(m.rms.symmetric), share(m.hausdorff.symmetric)),
        };
        let from = level.distance.map_or_else(
            || "not measured".to_owned(),
            |distance| format!("for distances from {}", short(distance)),
        );
        lines.push(format!(
            "  {}: {} faces ({percent:.1} %), {error} of the diagonal, {from}",
            k + 1,
            grouped(r.faces)
        ));
    }
    lines
}
