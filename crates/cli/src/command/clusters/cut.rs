//! `lodsmith clusters cut`: one surface out of a file of clusters.

use std::time::Instant;

use lodsmith::Length;
use lodsmith::core::{ClusterId, ClusterLod};
use lodsmith_io::{Regions, Warning};
use serde_json::json;

use super::read;
use crate::args::CutArgs;
use crate::command::{show_warnings, texts};
use crate::exit::{self, Status};
use crate::file::{self, Sink};
use crate::in_order;
use crate::numbers::{counted, grouped, micros, seconds, significant};
use crate::orient::orient;
use crate::output::Output;
use crate::progress::Progress;

struct Done {
    clusters: usize,
    faces: usize,
    vertices: usize,
    of_faces: usize,
    error: f64,
    warnings: Vec<Warning>,
}

/// Reads, cuts, writes.
pub(super) fn run(args: &CutArgs) -> anyhow::Result<Status> {
    let format = file::format_of(&args.output, args.writing.to)?;
    file::refuse_folder(&args.output, "")?;
    file::at_most_one_stdin([Some(&args.input), args.materials.as_ref()].into_iter().flatten())?;
    let is_taken = args.output == Sink::Stdout;
    if is_taken && args.ending.json {
        return Err(exit::usage("standard output takes the mesh or the JSON, not both"));
    }
    let out = Output::new(&args.run, args.ending.json, is_taken);
    let progress = Progress::new(1, args.run.quiet);
    let path = args.input.to_string();
    let begin = Instant::now();
    let done = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file(&path);
        bar.read();
        let stored = read(&args.input)?;
        let (lod, mut regions) = (stored.lod, stored.regions);
        let mut warnings = Vec::new();
        if let Some(source) = &args.materials {
            regions = with_materials(file::read(source, None)?.regions, &regions).ok_or_else(|| {
                exit::usage(format!(
                    "--materials {source}: its materials and groups are not those of the clusters"
                ))
            })?;
        } else if regions.materials().len() > 0 {
            let text =
                "materials are names only: --materials takes colours and textures from the original file";
            warnings.push(Warning::note(text));
        }
        let chosen = choose(&lod, args);
        let error = chosen.iter().map(|&id| lod.own(id).error).fold(0.0, f64::max);
        let mut surface = lod.mesh_of(&chosen);
        let original = lod.clusters().iter().filter(|c| c.from.is_none());
        let of_faces = original.map(|c| c.face_count).sum();
        drop(lod);
        bar.write();
        orient(&mut surface, &args.writing);
        let options = file::options(&args.writing, format, regions);
        warnings.extend(file::write(&surface, &args.output, format, &options, args.writing.force)?);
        let (faces, vertices) = (surface.face_count(), surface.vertex_count());
        Ok(Done { clusters: chosen.len(), faces, vertices, of_faces, error, warnings })
    });
    progress.finish();
    let done = done.map_err(|e: anyhow::Error| e.context(path.clone()))?;
    let secs = begin.elapsed().as_secs_f64();
    out.object(&json!({
        "input": { "path": path, "faces": done.of_faces },
        "output": {
            "path": args.output.to_string(), "format": format.name(),
            "faces": done.faces, "vertices": done.vertices,
        },
        "clusters": done.clusters,
        "error": done.error,
        "warnings": texts(&done.warnings),
        "seconds": micros(secs),
    }));
    out.line(&format!(
        "{path} → {}: {} of {} in {}, error {}, {}",
        args.output,
        grouped(done.faces),
        counted(done.of_faces, "face", "faces"),
        counted(done.clusters, "cluster", "clusters"),
        significant(done.error, 3),
        seconds(secs)
    ));
    let is_lossy = show_warnings(&out, &path, &done.warnings, args.ending.strict);
    out.finish(if is_lossy { Status::Strict } else { Status::Done })
}

/// The regions of the original, if they have the names of those of the clusters.
fn with_materials(original: Regions, own: &Regions) -> Option<Regions> {
    original.iter().eq(own.iter()).then_some(original)
}

fn choose(lod: &ClusterLod, args: &CutArgs) -> Vec<ClusterId> {
    let finest = || lod.mesh_of(&lod.cut_where(|_| false));
    let diagonal = || finest().positions().view().bounds().map_or(0.0, |b| b.diagonal());
    match &args.error {
        Some(error) => lod.cut(match error.length {
            Length::Units(x) => x,
            share => share.in_units(diagonal()),
        }),
        None => {
            let eye = args.eye(diagonal()).expect("an error or an eye is asked for");
            lod.cut_for_view(&eye, args.pixels)
        }
    }
}
