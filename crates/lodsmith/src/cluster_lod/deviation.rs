//! Deviation of a simplified group from the original: sampled adaptively on its faces, with finer samples
//! where larger distances are possible, and at samples of the original.

use lodsmith_core::spatial::bvh::{Bvh, Hint};
use lodsmith_core::{FaceId, TriMesh, VertexId};

/// Maximum number of samples of the original that a cluster keeps: half of them the farthest ones. (All
/// vertices and face centres for two rounds. With 64, measured distances were up to twice the reported ones.)
const MAX_SAMPLES: usize = 1024;
/// Assumed excess of the distance inside a face: over its corners, as a share of the longest side (`SIDE_SHARE`);
/// over its corners and edge midpoints, as a share of their range (`RANGE_SHARE`). (Measured: with .2 and no second
/// check nothing more is found on four models, in four times the time.)
const SIDE_SHARE: f64 = 0.15;
const RANGE_SHARE: f64 = 1.0;
/// Maximum depth of the subdivision of a face into four.
const MAX_DEPTH: usize = 4;
/// Safety factor for the distance between samples. (Measured: see docs/cluster-lod.md.)
const MARGIN: f64 = 1.08;

/// The original surface.
pub(super) struct OriginalSurface {
    tree: Bvh,
}

/// Distance of a simplified group, and the samples of the original for each of its clusters.
pub(super) struct GroupDeviation {
    pub(super) error: f64,
    pub(super) samples: Vec<Vec<[f64; 3]>>,
}

impl OriginalSurface {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        Self { tree: Bvh::new(&mesh.surface()) }
    }

    /// Returns samples on some faces of the original: vertices and face centres.
    pub(super) fn samples(&self, mesh: &TriMesh, faces: &[FaceId]) -> Vec<[f64; 3]> {
        let corners = faces.iter().flat_map(|f| mesh.triangles()[f.index()]);
        let mut vertices: Vec<VertexId> = corners.map(|w| mesh.vertex_of(w)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |v: VertexId| mesh.positions().view().get(v);
        let mut all: Vec<[f64; 3]> = vertices.iter().map(|&v| place(v)).collect();
        for f in faces {
            let [a, b, c] = mesh.triangles()[f.index()].map(|w| place(mesh.vertex_of(w)));
            all.push([0, 1, 2].map(|k| a[k] / 3.0 + b[k] / 3.0 + c[k] / 3.0));
        }
        let every = all.len().div_ceil(MAX_SAMPLES).max(1);
        all.into_iter().step_by(every).collect()
    }

    /// Measures a mesh that replaces the surface at `samples`; `pieces` are its clusters, in the order of its
    /// faces.
    pub(super) fn deviation(
        &self,
        mesh: &TriMesh,
        pieces: &[Vec<u32>],
        samples: &[[f64; 3]],
    ) -> GroupDeviation {
        let surface = mesh.surface();
        let positions = surface.positions();
        let mut error = 0f64;
        let mut cluster_of = Vec::with_capacity(mesh.face_count());
        for (i, piece) in pieces.iter().enumerate() {
            cluster_of.resize(cluster_of.len() + piece.len(), i);
        }
        let tree = Bvh::new(&surface);
        let mut hint = Hint::default();
        let mut kept: Vec<Vec<(f64, [f64; 3])>> = vec![Vec::new(); pieces.len()];
        for &p in samples {
            let Some(hit) = tree.closest_from(p, &mut hint) else { continue };
            error = error.max(hit.distance);
            kept[cluster_of[hit.face.index()]].push((hit.distance, p));
        }
        let mut hint = Hint::default();
        let mut distance = |p| self.tree.closest_from(p, &mut hint).map_or(0.0, |hit| hit.distance);
        let of_vertex: Vec<f64> = positions.iter().map(&mut distance).collect();
        error = of_vertex.iter().fold(error, |largest, &d| largest.max(d));
        for t in surface.triangles() {
            let corners = t.map(|v| (positions.get(v), of_vertex[v.index()]));
            refine(corners, MAX_DEPTH, &mut error, &mut distance);
        }
        GroupDeviation { error: error * MARGIN, samples: kept.into_iter().map(thinned).collect() }
    }
}

fn side(p: [f64; 3], q: [f64; 3]) -> f64 {
    (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
}

/// Measures at the edge midpoints of a triangle, whose corners are given with their distances, and subdivides
/// it into four as long as some distance may exceed `error`.
fn refine(
    corners: [([f64; 3], f64); 3],
    depth: usize,
    error: &mut f64,
    distance: &mut impl FnMut([f64; 3]) -> f64,
) {
    let [a, b, c] = corners;
    let longest = side(a.0, b.0).max(side(b.0, c.0)).max(side(c.0, a.0));
    let highest = a.1.max(b.1).max(c.1);
    if depth == 0 || highest + SIDE_SHARE * longest <= *error {
        return;
    }
    let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
        let middle = [0, 1, 2].map(|k| 0.5 * p.0[k] + 0.5 * q.0[k]);
        let off = distance(middle);
        *error = error.max(off);
        (middle, off)
    });
    let all = [a, b, c, ab, bc, ca].map(|p| p.1);
    let (smallest, largest) = all.iter().fold((f64::INFINITY, 0f64), |(x, y), &d| (x.min(d), y.max(d)));
    if largest + RANGE_SHARE * (largest - smallest) <= *error {
        return;
    }
    for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
        refine(part, depth - 1, error, distance);
    }
}

/// Thins samples out: half of those kept are the farthest, the others an even selection of the rest.
fn thinned(mut samples: Vec<(f64, [f64; 3])>) -> Vec<[f64; 3]> {
    if samples.len() > MAX_SAMPLES {
        // The sort is stable: equal distances keep their order.
        samples.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rest = samples.split_off(MAX_SAMPLES / 2);
        let every = rest.len().div_ceil(MAX_SAMPLES - MAX_SAMPLES / 2);
        samples.extend(rest.into_iter().step_by(every));
    }
    samples.into_iter().map(|s| s.1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farthest_samples_stay() {
        let all: Vec<(f64, [f64; 3])> =
            (0..5000).map(|i| (f64::from(i % 2500), [f64::from(i), 0.0, 0.0])).collect();
        let kept = thinned(all);
        assert!(kept.len() <= MAX_SAMPLES);
        assert_eq!(&kept[..2], &[[2499.0, 0.0, 0.0], [4999.0, 0.0, 0.0]]);
        assert!(kept.iter().any(|p| p[0] % 2500.0 < 50.0));
    }
}
