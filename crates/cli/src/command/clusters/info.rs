//! `lodsmith clusters info`: what is in a file of clusters.

use lodsmith::core::{ClusterLod, Semantic};
use lodsmith_io::cluster_lod::StoredClusterLod;
use serde_json::{Value, json};

use super::{fill, largest, levels, read};
use crate::args::LevelsArgs;
use crate::exit::Status;
use crate::in_order;
use crate::numbers::{counted, grouped, significant};
use crate::output::Output;

/// Reads, and says what is there.
pub(super) fn run(args: &LevelsArgs) -> anyhow::Result<Status> {
    let out = Output::new(&args.run, args.json, false);
    let path = args.input.to_string();
    let stored = in_order::pool(args.run.threads())?.install(|| read(&args.input));
    let stored = stored.map_err(|e| e.context(path.clone()))?;
    out.object(&to_json(&path, &stored));
    for line in table(&path, &stored.lod) {
        out.line(&line);
    }
    out.finish(Status::Done)
}

fn attributes(lod: &ClusterLod) -> Vec<String> {
    let mesh = lod.mesh();
    let first = [
        ("normals", mesh.normals().is_some()),
        ("uvs", mesh.uvs().is_some()),
        ("colors", mesh.colors().is_some()),
    ];
    let mut all: Vec<String> = first.into_iter().filter(|x| x.1).map(|x| x.0.to_owned()).collect();
    let name = |s: &Semantic| s.name().unwrap_or(s.title()).to_owned();
    all.extend(mesh.further_attributes().iter().map(|a| name(&a.semantic)));
    all.dedup();
    all
}

fn to_json(path: &str, stored: &StoredClusterLod) -> Value {
    let (lod, regions) = (&stored.lod, &stored.regions);
    let materials: Vec<_> = regions.materials().map(|m| String::from_utf8_lossy(m)).collect();
    json!({
        "path": path,
        "clusters": lod.clusters().len(),
        "groups": lod.groups().len(),
        "faces": lod.mesh().face_count(),
        "vertices": lod.mesh().vertex_count(),
        "largest_cluster": largest(lod),
        "coarsest_error": lod.coarsest_error(),
        "attributes": attributes(lod),
        "materials": materials,
        "levels": levels(lod),
    })
}

fn table(path: &str, lod: &ClusterLod) -> Vec<String> {
    let counts = lod.level_counts();
    let largest = largest(lod);
    let of = |n: usize, one, many| counted(n, one, many);
    let mut lines = vec![format!(
        "{path}: {} in {}, {}, error up to {}",
        of(lod.clusters().len(), "cluster", "clusters"),
        of(lod.groups().len(), "group", "groups"),
        of(counts.len(), "level", "levels"),
        significant(lod.coarsest_error(), 3)
    )];
    lines.push("  level   clusters      faces  fill %  largest error".to_owned());
    for (level, c) in counts.iter().enumerate() {
        lines.push(format!(
            "  {level:>5}{:>11}{:>11}{:>8}  {}",
            grouped(c.clusters),
            grouped(c.faces),
            significant(100.0 * fill(c.faces, c.clusters, largest), 3),
            significant(c.largest_error, 3)
        ));
    }
    lines
}
