//! Sizing field: target edge lengths that shrink with curvature, within limits and with bounded gradation.

use glam::{DMat3, DVec3};
use lodsmith_core::VertexId;
use lodsmith_core::spatial::Bvh;

use super::half_edges::{HalfEdges, LineKind, OPEN};
use super::reference::tree;

/// Rounds of neighbour averaging before the curvature is computed, which remove the noise of single edges. (A
/// guess.)
const SMOOTHINGS: usize = 2;
/// Limits of the target length, relative to the edge length of an even mesh. (A guess.)
const LENGTH_RANGE: [f64; 2] = [0.2, 4.0];
/// Growth of the target length per unit of distance. (A guess.)
const GRADATION: f64 = 0.5;
/// Iterations that reconcile limits and gradation with the face count. (A guess.)
const ROUNDS: usize = 4;

/// Target edge lengths over a surface.
pub(super) struct SizingField {
    pub(super) tree: Bvh,
    pub(super) points: Vec<DVec3>,
    pub(super) faces: Vec<[VertexId; 3]>,
    pub(super) sizes: Vec<f64>,
}

impl SizingField {
    /// Computes lengths that give as many faces as edges of length `even` everywhere, but distributed by
    /// curvature.
    pub(super) fn new(mesh: &HalfEdges, even: f64) -> Self {
        let faces: Vec<[VertexId; 3]> = (0..mesh.from.len() / 3).map(|f| mesh.corners(f)).collect();
        let bends = curvatures(mesh);
        // A chord of length l deviates from a curve by about k l² / 8.
        let ideal: Vec<f64> = bends.iter().map(|k| 1.0 / k.max(1e-9).sqrt()).collect();
        let areas: Vec<f64> = vertex_areas(mesh);
        let whole: f64 = areas.iter().sum();
        let mut sizes = ideal.clone();
        let mut scale = 1.0;
        for _ in 0..ROUNDS {
            for (size, ideal) in sizes.iter_mut().zip(&ideal) {
                *size = (ideal * scale).clamp(LENGTH_RANGE[0] * even, LENGTH_RANGE[1] * even);
            }
            limit_gradation(mesh, &mut sizes);
            // The number of faces of the even mesh.
            let needs: f64 = areas.iter().zip(&sizes).map(|(a, s)| a / (s * s)).sum();
            scale *= (needs * even * even / whole.max(f64::MIN_POSITIVE)).sqrt();
        }
        Self { tree: tree(&mesh.points, &faces), points: mesh.points.clone(), faces, sizes }
    }
}

fn vertex_areas(mesh: &HalfEdges) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.points.len()];
    for f in 0..mesh.from.len() / 3 {
        let share = mesh.normal(f).length() / 6.0;
        mesh.corners(f).iter().for_each(|v| areas[v.index()] += share);
    }
    areas
}

/// Computes the curvature at each vertex: the root of the sum of both principal curvatures squared, from the
/// dihedral angles of the edges around. Creases do not count, since they are kept.
fn curvatures(mesh: &HalfEdges) -> Vec<f64> {
    let mut bends = vec![DMat3::ZERO; mesh.points.len()];
    for h in mesh.half_edges().filter(|&h| mesh.is_first(h)) {
        let t = mesh.twin(h);
        if t == OPEN || mesh.line[h.index()] == LineKind::Crease {
            continue;
        }
        let (n, m) = (mesh.normal(h.face().index()), mesh.normal(t.face().index()));
        let edge = mesh.at(mesh.to(h)) - mesh.at(mesh.from(h));
        let length = edge.length();
        if length == 0.0 {
            continue;
        }
        let direction = edge / length;
        let angle = libm::atan2(n.cross(m).dot(direction), n.dot(m));
        let outer =
            DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z)
                * (0.5 * angle * length);
        for v in [mesh.from(h), mesh.to(h)] {
            bends[v.index()] += outer;
        }
    }
    let mut areas = vertex_areas(mesh);
    let mut ring = Vec::new();
    for _ in 0..SMOOTHINGS {
        let (old_bends, old_areas) = (bends.clone(), areas.clone());
        for v in (0..mesh.points.len()).map(VertexId::new) {
            mesh.ring(v, &mut ring);
            for w in &ring {
                bends[v.index()] += old_bends[w.index()];
                areas[v.index()] += old_areas[w.index()];
            }
        }
        // Each summation multiplies the sums by about the valence.
        bends.iter_mut().zip(&mut areas).for_each(|(b, a)| (*b, *a) = (*b * 0.15, *a * 0.15));
    }
    let norm = |b: &DMat3| b.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    bends.iter().zip(&areas).map(|(b, a)| if *a > 0.0 { norm(b) / a } else { 0.0 }).collect()
}

/// Maximum number of sweeps that limit each length by the lengths of its neighbours.
const MAX_SWEEPS: usize = 20;

fn limit_gradation(mesh: &HalfEdges, sizes: &mut [f64]) {
    for sweep in 0..MAX_SWEEPS {
        let mut changed = false;
        let count = mesh.from.len();
        for i in 0..count {
            let h = lodsmith_core::HalfEdgeId::new(if sweep % 2 == 0 { i } else { count - 1 - i });
            let (a, b) = (mesh.from(h), mesh.to(h));
            let reach = GRADATION * mesh.length_sq(h).sqrt();
            for (a, b) in [(a, b), (b, a)] {
                let max_size = sizes[a.index()] + reach;
                if sizes[b.index()] > max_size * (1.0 + 1e-9) {
                    sizes[b.index()] = max_size;
                    changed = true;
                }
            }
        }
        if !changed {
            return;
        }
    }
}
