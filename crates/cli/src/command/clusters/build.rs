//! `lodsmith clusters build`: a mesh into a file of clusters.

use std::io::Write;
use std::path::Path;

use lodsmith::ClusterLodReport;
use lodsmith::core::ClusterLod;
use lodsmith_io::cluster_lod::{write_path, write_to};
use lodsmith_io::{Format, Regions, Warning};
use serde_json::{Map, Value, json};

use super::{fill, largest, levels};
use crate::args::BuildArgs;
use crate::command::{show_warnings, texts};
use crate::exit::{self, Status};
use crate::file::{self, Sink};
use crate::in_order;
use crate::numbers::{counted, grouped, micros, seconds, significant};
use crate::output::Output;
use crate::progress::Progress;
use crate::watch::{Clock, Watch, not_interrupted};

struct Done {
    format: Format,
    lod: ClusterLod,
    report: ClusterLodReport,
    warnings: Vec<Warning>,
    clock: Clock,
}

/// Reads, builds, writes, and says what came of it.
pub(super) fn run(args: &BuildArgs) -> anyhow::Result<Status> {
    file::refuse_folder(&args.output, "")?;
    let is_taken = args.output == Sink::Stdout;
    if is_taken && args.ending.json {
        return Err(exit::usage("standard output takes the clusters or the JSON, not both"));
    }
    let out = Output::new(&args.run, args.ending.json, is_taken);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let done = in_order::pool(args.run.threads())?.install(|| build(args, &path, &progress));
    progress.finish();
    let done = done.map_err(|e| e.context(path.clone()))?;
    out.object(&done.to_json(&path, args));
    for line in done.table(&path, args) {
        out.line(&line);
    }
    let is_lossy = show_warnings(&out, &path, &done.warnings, args.ending.strict);
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}

fn build(args: &BuildArgs, path: &str, progress: &Progress) -> anyhow::Result<Done> {
    let bar = progress.file(path);
    let mut clock = Clock::new();
    clock.enter("read");
    bar.read();
    let mut loaded = file::read(&args.input, args.from)?;
    let mut options = args.options();
    if !loaded.regions.is_empty() {
        options.region_classes = Some(loaded.regions.classes().into());
    }
    let mut watch = Watch::new(&mut clock, &bar, None);
    let built = not_interrupted(lodsmith::cluster_lod(&loaded.mesh, &options, &mut watch))?;
    watch.write();
    let lod = &built.lod;
    let regions = &loaded.regions;
    let (to_stream, to_path) =
        (|out: &mut dyn Write| write_to(lod, regions, out), |path: &Path| write_path(lod, regions, path));
    file::write_other(&args.output, args.force, to_stream, to_path)?;
    clock.end();
    loaded.warnings.extend(told(&built.report, &loaded.regions));
    Ok(Done { format: loaded.format, lod: built.lod, report: built.report, warnings: loaded.warnings, clock })
}

/// What the user should know.
fn told(report: &ClusterLodReport, regions: &Regions) -> Vec<Warning> {
    let mut all = Vec::new();
    if !report.dropped.is_empty() {
        let text = format!("{} have no counterpart: dropped", report.dropped.join(" and "));
        all.push(Warning::lost(text));
    }
    if regions.materials().len() > 0 {
        let text = "of materials the clusters keep the names; clusters cut --materials takes the rest from the input";
        all.push(Warning::note(text));
    }
    let c = &report.cleanup;
    let left_out = c.degenerate_faces + c.duplicate_faces + c.non_finite_faces;
    if left_out > 0 {
        let faces = counted(left_out, "face", "faces");
        all.push(Warning::note(format!("{faces} left out: no place, no extent, or there already")));
    }
    if report.broken_groups > 0 {
        let groups = counted(report.broken_groups, "group", "groups");
        all.push(Warning::note(format!("{groups} left as they were, for their borders would have changed")));
    }
    all
}

impl Done {
    fn table(&self, path: &str, args: &BuildArgs) -> Vec<String> {
        let counts = self.lod.level_counts();
        let clusters = self.lod.clusters().len();
        let coarsest: usize = counts.iter().map(|c| c.coarsest_clusters).sum();
        let faces: usize = counts.iter().map(|c| c.faces).sum();
        let fill = 100.0 * fill(faces, clusters, args.triangles);
        vec![format!(
            "{path} → {}: {} in {} of {}, down to {}, {} % full, error up to {}, {}",
            args.output,
            counted(self.report.input_faces, "face", "faces"),
            counted(clusters, "cluster", "clusters"),
            counted(counts.len(), "level", "levels"),
            grouped(coarsest),
            significant(fill, 3),
            significant(self.lod.coarsest_error(), 3),
            seconds(self.clock.total())
        )]
    }

    fn to_json(&self, path: &str, args: &BuildArgs) -> Value {
        let (r, c) = (&self.report, &self.report.cleanup);
        let secs: Map<_, _> =
            self.clock.stages.iter().map(|(name, s)| ((*name).to_owned(), micros(*s).into())).collect();
        json!({
            "input": {
                "path": path, "format": self.format.name(), "faces": r.input_faces, "vertices": r.input_vertices,
            },
            "output": {
                "path": args.output.to_string(),
                "faces": self.lod.mesh().face_count(),
                "vertices": self.lod.mesh().vertex_count(),
            },
            "clusters": self.lod.clusters().len(),
            "groups": self.lod.groups().len(),
            "triangles_per_cluster": { "wanted": args.triangles, "largest": largest(&self.lod) },
            "coarsest_error": self.lod.coarsest_error(),
            "levels": levels(&self.lod),
            "rounds": r.rounds,
            "stuck_groups": r.stuck_groups,
            "broken_groups": r.broken_groups,
            "cleanup": {
                "welded_vertices": c.welded_vertices,
                "degenerate_faces": c.degenerate_faces,
                "duplicate_faces": c.duplicate_faces,
                "non_finite_faces": c.non_finite_faces,
                "unused_vertices": c.unused_vertices,
            },
            "warnings": texts(&self.warnings),
            "seconds": secs,
        })
    }
}
