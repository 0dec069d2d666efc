//! How far a lighter group lies from the original: its own vertices and middles of faces from there, and places of the
//! original from it.

use lodsmith_core::spatial::bvh::{Bvh, Hint};
use lodsmith_core::{FaceId, TriMesh, VertexId};

/// Places of the original that a cluster remembers: half of them those that lay farthest off. (Guessed: all vertices of a
/// cluster of the original.)
const SAMPLES: usize = 64;

/// The original surface.
pub(super) struct Original {
    tree: Bvh,
}

/// The distance of a lighter group, and the places of the original for each of its faces' clusters.
pub(super) struct Deviation {
    pub(super) error: f64,
    pub(super) samples: Vec<Vec<[f64; 3]>>,
}

impl Original {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        Self { tree: Bvh::new(&mesh.surface()) }
    }

    /// Places on some faces of the original.
    pub(super) fn samples(&self, mesh: &TriMesh, faces: &[FaceId]) -> Vec<[f64; 3]> {
        let corners = faces.iter().flat_map(|f| mesh.triangles()[f.index()]);
        let mut vertices: Vec<VertexId> = corners.map(|w| mesh.vertex_of(w)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let every = vertices.len().div_ceil(SAMPLES).max(1);
        vertices.iter().step_by(every).map(|&v| mesh.positions().view().get(v)).collect()
    }

    /// Measures a mesh that stands for the places `samples`; `pieces` are its clusters, in the order of its faces.
    pub(super) fn deviation(&self, mesh: &TriMesh, pieces: &[Vec<u32>], samples: &[[f64; 3]]) -> Deviation {
        let surface = mesh.surface();
        let positions = surface.positions();
        let mut hint = Hint::default();
        let middles = surface.triangles().iter().map(|t| {
            let p = t.map(|v| positions.get(v));
            [0, 1, 2].map(|k| p[0][k] / 3.0 + p[1][k] / 3.0 + p[2][k] / 3.0)
        });
        let mut error = 0f64;
        for p in middles.chain(positions.iter()) {
            error = error.max(self.tree.closest_from(p, &mut hint).map_or(0.0, |hit| hit.distance));
        }
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
        Deviation { error, samples: kept.into_iter().map(thinned).collect() }
    }
}

/// Half of what may stay are those farthest off, the others every so many of the rest.
fn thinned(mut samples: Vec<(f64, [f64; 3])>) -> Vec<[f64; 3]> {
    if samples.len() > SAMPLES {
        // Stable: equal distances stay in their order.
        samples.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rest = samples.split_off(SAMPLES / 2);
        let every = rest.len().div_ceil(SAMPLES - SAMPLES / 2);
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
            (0..1000).map(|i| (f64::from(i % 500), [f64::from(i), 0.0, 0.0])).collect();
        let kept = thinned(all);
        assert!(kept.len() <= SAMPLES);
        assert_eq!(&kept[..2], &[[499.0, 0.0, 0.0], [999.0, 0.0, 0.0]]);
        assert!(kept.iter().any(|p| p[0] % 500.0 < 50.0));
    }
}
