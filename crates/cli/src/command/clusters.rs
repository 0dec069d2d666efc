//! `lodsmith clusters`: levels of clusters made, cut and looked into.

mod build;
mod cut;
mod info;

use std::io::Read as _;

use lodsmith::core::ClusterLod;
use lodsmith_io::cluster_lod::{self, StoredClusterLod};
use lodsmith_io::{Limits, ReadError};
use serde_json::{Value, json};

use crate::args::ClustersCommand;
use crate::exit::Status;
use crate::file::{self, Source};

/// Does what was typed.
pub(super) fn run(command: &ClustersCommand) -> anyhow::Result<Status> {
    match command {
        ClustersCommand::Build(args) => build::run(args),
        ClustersCommand::Cut(args) => cut::run(args),
        ClustersCommand::Info(args) => info::run(args),
    }
}

/// Reads a file of clusters. The error does not name the source.
fn read(source: &Source) -> anyhow::Result<StoredClusterLod> {
    let stored = match source {
        Source::Path(path) => cluster_lod::read_path(path, Limits::default()),
        Source::Stdin => {
            let mut bytes = Vec::new();
            std::io::stdin()
                .lock()
                .read_to_end(&mut bytes)
                .map_err(ReadError::from)
                .and_then(|_| cluster_lod::read_bytes(&bytes, Limits::default()))
        }
    };
    stored.map_err(file::unnamed)
}

/// The largest number of triangles that a cluster has.
fn largest(lod: &ClusterLod) -> usize {
    lod.clusters().iter().map(|c| c.face_count).max().unwrap_or(0)
}

/// How full clusters are, against the fullest one.
fn fill(faces: usize, clusters: usize, largest: usize) -> f64 {
    faces as f64 / (clusters * largest).max(1) as f64
}

/// What both reports say of levels.
fn levels(lod: &ClusterLod) -> Value {
    let largest = largest(lod);
    let level = |(level, c): (usize, lodsmith::core::clusters::LevelCounts)| {
        json!({
            "level": level,
            "clusters": c.clusters,
            "coarsest_clusters": c.coarsest_clusters,
            "faces": c.faces,
            "vertices_per_cluster": c.wedges as f64 / c.clusters.max(1) as f64,
            "fill": fill(c.faces, c.clusters, largest),
            "error": { "least": c.least_error, "largest": c.largest_error },
        })
    };
    lod.level_counts().into_iter().enumerate().map(level).collect()
}
