//! Cuts of cluster levels of detail: measured distance to the mesh, compared with the recorded error.
//!
//! ```text
//! cluster_lod FILE...
//! ```
//! Distances are two-way maxima, measured (`compare`, with a million samples), in percent of the diagonal.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use lodsmith::{ClusterLodOptions, NoControl, cluster_lod};
use lodsmith_core::TriMesh;
use lodsmith_core::measure::{CompareOptions, Prepared, compare_prepared};

/// Requested errors, in percent of the diagonal.
const REQUESTED_ERRORS: [f64; 7] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
/// Samples on each mesh.
const SAMPLES: usize = 1_000_000;

fn main() -> Result<()> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    ensure!(!files.is_empty(), "usage: cluster_lod FILE...");
    for file in files {
        let mesh = lodsmith_io::read_path(Path::new(&file), &lodsmith_io::ReadOptions::default())
            .with_context(|| format!("reading {file}"))?
            .mesh;
        let name = Path::new(&file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        report(&name, &mesh)?;
    }
    Ok(())
}

fn report(name: &str, mesh: &TriMesh) -> Result<()> {
    let start = Instant::now();
    let lod = cluster_lod(mesh, &ClusterLodOptions::default(), &mut NoControl)?.lod;
    let secs = start.elapsed().as_secs_f64();
    println!(
        "\n## {name}: {} faces, {} clusters, made in {secs:.2} s",
        mesh.face_count(),
        lod.clusters().len()
    );
    println!("| requested | faces | recorded | from the cut | from the mesh | measured/recorded |");
    println!("|---|---|---|---|---|---|");
    let reference = Prepared::new(&mesh.surface())?;
    let diagonal = mesh.positions().view().bounds().map_or(1.0, |b| b.diagonal());
    let mut options = CompareOptions::default();
    options.samples = SAMPLES;
    let mut last = 0;
    for requested in REQUESTED_ERRORS {
        let cut = lod.cut(requested / 100.0 * diagonal);
        let recorded =
            100.0 * cut.iter().map(|&id| lod.cluster_bound(id).error).fold(0.0, f64::max) / diagonal;
        let simplified = lod.mesh_of(&cut);
        if simplified.face_count() == last || recorded == 0.0 {
            continue;
        }
        last = simplified.face_count();
        let distances =
            compare_prepared(&reference, &Prepared::new(&simplified.surface())?, &options).hausdorff;
        let [from_cut, from_mesh] = [distances.backward, distances.forward].map(|d| 100.0 * d / diagonal);
        let ratio = from_cut.max(from_mesh) / recorded;
        println!("| {requested} | {last} | {recorded:.4} | {from_cut:.4} | {from_mesh:.4} | {ratio:.3} |");
    }
    Ok(())
}
