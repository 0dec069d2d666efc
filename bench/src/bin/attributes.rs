//! Comparison with meshoptimizer on meshes with attributes: time, and errors of shape, normals, texture coordinates and
//! colours.

#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context as _;
use lodsmith::core::TriMesh;
use lodsmith::core::measure::{self, CompareOptions};
use lodsmith::core::mesh::weld;
use lodsmith::{SimplifyOptions, Stop};
use lodsmith_bench::VertexBuffers;
use lodsmith_io::{ReadOptions, read_path};
use meshopt::{SimplifyOptions as MeshoptOptions, VertexDataAdapter};

fn main() -> anyhow::Result<()> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    anyhow::ensure!(
        !paths.is_empty(),
        "attributes FILE...: meshes with normals, texture coordinates or colours"
    );
    println!(
        "| model | faces | target | lodsmith s | meshopt s | rms | normals | uvs | uvs 95 % | colours |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    );
    for path in &paths {
        let loaded = read_path(path, &ReadOptions::default()).with_context(|| path.display().to_string())?;
        // Both simplifiers get the same welded mesh.
        let mut mesh = weld::weld_mesh(&loaded.mesh, None).mesh;
        // meshoptimizer does not support materials.
        mesh.set_regions(None)?;
        for percent in [50, 25, 10] {
            let target = (mesh.face_count() * percent / 100).max(4);
            let (own, own_time) = best_of(5, || {
                let options = SimplifyOptions::new(Stop::faces(target));
                Ok(lodsmith::simplify(&mesh, &options)?.mesh)
            })?;
            let (other, other_time) = best_of(5, || rival(&mesh, target))?;
            let errors = |m: &TriMesh| -> anyhow::Result<_> {
                let options = CompareOptions::default();
                let shape = measure::compare(&mesh.surface(), &m.surface(), &options)?;
                Ok((shape, measure::compare_attributes(&mesh, m, &options)?))
            };
            let (a, b) = (errors(&own)?, errors(&other)?);
            let pair = |x: Option<f64>, y: Option<f64>| match (x, y) {
                (Some(x), Some(y)) => format!("{x:.3e} {y:.3e} {:.2}", x / y.max(1e-12)),
                _ => String::new(),
            };
            println!(
                "| {} | {} | {percent} % {} {} | {own_time:.4} | {other_time:.4} {:.2} | {} | {} | {} | {} | {} |",
                path.file_stem().unwrap_or_default().to_string_lossy(),
                mesh.face_count(),
                own.face_count(),
                other.face_count(),
                own_time / other_time,
                pair(Some(a.0.rms.symmetric), Some(b.0.rms.symmetric)),
                pair(a.1.normals_deg.map(|e| e.mean.symmetric), b.1.normals_deg.map(|e| e.mean.symmetric)),
                pair(a.1.uvs.map(|e| e.mean.symmetric), b.1.uvs.map(|e| e.mean.symmetric)),
                pair(a.1.uvs.map(|e| e.p95.symmetric), b.1.uvs.map(|e| e.p95.symmetric)),
                pair(a.1.colors.map(|e| e.mean.symmetric), b.1.colors.map(|e| e.mean.symmetric)),
            );
        }
    }
    Ok(())
}

/// Returns the last result and the minimum time in seconds.
fn best_of(times: usize, run: impl Fn() -> anyhow::Result<TriMesh>) -> anyhow::Result<(TriMesh, f64)> {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..times {
        let started = Instant::now();
        result = Some(run()?);
        best = best.min(started.elapsed().as_secs_f64());
    }
    Ok((result.context("no run")?, best))
}

/// Runs meshoptimizer's simplification with attributes; its vertices are Lodsmith's wedges.
fn rival(mesh: &TriMesh, target: usize) -> anyhow::Result<TriMesh> {
    let mut buffers = VertexBuffers::new(mesh);
    let VertexBuffers { positions, indices, values, weights, .. } = &mut buffers;
    let adapter = VertexDataAdapter::new(bytemuck::cast_slice(positions), 12, 0)?;
    let locks = vec![false; positions.len()];
    *indices = meshopt::simplify_with_attributes_and_locks(
        indices,
        &adapter,
        values,
        weights,
        weights.len() * 4,
        &locks,
        target * 3,
        f32::MAX,
        MeshoptOptions::None,
        None,
    );
    buffers.mesh()
}
