//! Comparison with meshoptimizer on meshes with attributes: time, and errors of shape, normals, texture
//! coordinates and colours.

#![allow(clippy::print_stdout, reason = "a program speaks on standard output")]

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context as _;
use lodsmith::core::measure::{self, CompareOptions};
use lodsmith::core::mesh::weld;
use lodsmith::core::{Positions, TriMesh, VertexId};
use lodsmith::{NoControl, SimplifyOptions, Stop};
use lodsmith_io::{ReadOptions, read_path};
use meshopt::{SimplifyOptions as MeshoptOptions, VertexDataAdapter};

/// Attribute weights that meshoptimizer's documentation proposes for normals and colours; those of texture
/// coordinates follow from their scale.
const NORMAL_WEIGHT: f32 = 0.5;
const COLOR_WEIGHT: f32 = 1.0;

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
                Ok(lodsmith::simplify(&mesh, &options, &mut NoControl)?.mesh)
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
        let begin = Instant::now();
        result = Some(run()?);
        best = best.min(begin.elapsed().as_secs_f64());
    }
    Ok((result.context("no run")?, best))
}

/// Runs meshoptimizer's attribute-aware simplification; its vertices are our wedges.
fn rival(mesh: &TriMesh, target: usize) -> anyhow::Result<TriMesh> {
    let positions: Vec<[f32; 3]> = (0..mesh.wedge_count() as u32)
        .map(|w| mesh.positions().view().get(mesh.vertex_of(lodsmith::core::WedgeId(w))).map(|x| x as f32))
        .collect();
    let indices: &[u32] = bytemuck::cast_slice(mesh.triangles());
    let (mut values, mut weights) = (Vec::new(), Vec::new());
    if mesh.normals().is_some() {
        weights.extend([NORMAL_WEIGHT; 3]);
    }
    if let Some(uvs) = mesh.uvs() {
        let doubled = |t: &[lodsmith::core::WedgeId; 3]| {
            let [a, b, c] = t.map(|w| uvs[w.index()]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        let area = mesh.triangles().iter().map(doubled).sum::<f32>() / 2.0 / mesh.face_count() as f32;
        // The weight that meshoptimizer's documentation proposes: 1 / sqrt(mean area in texture space),
        // bounded for tiny areas.
        weights.extend([1.0 / area.max(1e-8).sqrt() * 0.01; 2]);
    }
    if mesh.colors().is_some() {
        weights.extend([COLOR_WEIGHT; 3]);
    }
    for w in 0..mesh.wedge_count() {
        values.extend(mesh.normals().iter().flat_map(|n| n[w]));
        values.extend(mesh.uvs().iter().flat_map(|t| t[w]));
        values.extend(mesh.colors().iter().flat_map(|c| [c[w][0], c[w][1], c[w][2]]));
    }
    let adapter = VertexDataAdapter::new(bytemuck::cast_slice(&positions), 12, 0)?;
    let locks = vec![false; positions.len()];
    let kept = meshopt::simplify_with_attributes_and_locks(
        indices,
        &adapter,
        &values,
        &weights,
        weights.len() * 4,
        &locks,
        target * 3,
        f32::MAX,
        MeshoptOptions::None,
        None,
    );
    let triangles = kept.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(VertexId)).collect();
    let mut result = TriMesh::new(Positions::F32(positions), triangles)?;
    result.set_normals(mesh.normals().map(<[_]>::to_vec))?;
    result.set_uvs(mesh.uvs().map(<[_]>::to_vec))?;
    result.set_colors(mesh.colors().map(<[_]>::to_vec))?;
    Ok(result)
}
