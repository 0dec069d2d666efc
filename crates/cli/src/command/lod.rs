//! `lodsmith lod`: reads, makes a chain of levels, writes them, and reports the result.

use lodsmith_asset::plan::Assignment;
use lodsmith_asset::warnings::warnings_of;
use lodsmith_asset::{LevelOutputs, LodOutcome, lod, report_json};

use super::batch;
use crate::args::LodArgs;
use crate::numbers::{counted, grouped, seconds, short};
use crate::output::Output;
use crate::sizes;
use crate::status::Status;
use crate::warnings::{show_not_reached, show_warnings};

/// Makes the levels of one input.
pub(super) fn run(args: &LodArgs) -> anyhow::Result<Status> {
    let (recipe, reading) = (args.recipe()?, args.reading.options());
    let outputs =
        LevelOutputs::new(&args.wanted(), args.name.as_deref(), args.naming, recipe.baking.as_ref())?;
    let file = Assignment { source: outputs.source.clone(), output: outputs.first.clone() };
    batch::run_assigned(
        std::slice::from_ref(&file),
        args.ending.json,
        &args.run,
        |_, job| Ok(lod(&outputs, &reading, &recipe, job)?),
        |out, path, done, _| {
            let target = report_json::levels_target(&recipe.options.levels);
            out.object(&done.to_json(path, &target, &recipe, &outputs));
            show(out, path, done, args.ending.strict)
        },
    )
}

/// Prints the outcome. Returns the exit status.
fn show(out: &Output, path: &str, done: &LodOutcome, strict: bool) -> Status {
    for line in lines(done, path) {
        out.line(&line);
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
    let mut is_fault = show_warnings(out, path, &done.warnings, strict);
    for (k, level) in done.levels.iter().enumerate() {
        let name = format!("{path}: level {}", k + 1);
        is_fault |= show_warnings(out, &name, &warnings_of(&level.report), strict);
        if let Some(why) = &level.not_reached {
            is_fault |= show_not_reached(out, &name, why, strict);
        }
    }
    if is_fault { Status::Strict } else { Status::Done }
}

/// Returns a line for the whole and one for each level.
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
        lines.push(format!(
            "  {}: {} faces ({percent:.1} %), {error} of the diagonal, from a distance of {}",
            k + 1,
            grouped(r.faces),
            short(level.distance)
        ));
    }
    lines
}
