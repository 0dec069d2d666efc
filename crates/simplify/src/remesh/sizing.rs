//! How long edges should be where: shorter the more the surface bends, within limits, and never changing fast.

use glam::{DMat3, DVec3};
use lodsmith_core::VertexId;
use lodsmith_core::spatial::Bvh;

use super::guide::tree;
use super::half_edges::{HalfEdges, Line, OPEN};

/// Rounds of averaging over neighbours before curvature is read off: noise of one edge cancels. (A guess.)
const SMOOTHINGS: usize = 2;
/// Edges are at most so many times longer or shorter than those of an even mesh. (A guess.)
const SPREAD: [f64; 2] = [0.2, 4.0];
/// How fast the length may grow, per unit of way. (A guess.)
const GRADATION: f64 = 0.5;
/// Times that limits and gradation are brought together with the count. (A guess.)
const ROUNDS: usize = 4;

/// Wanted edge lengths over a surface.
pub(super) struct Field {
    pub(super) tree: Bvh,
    pub(super) points: Vec<DVec3>,
    pub(super) faces: Vec<[VertexId; 3]>,
    pub(super) sizes: Vec<f64>,
}

impl Field {
    /// Lengths for a mesh that would take edges of `even` everywhere: as many faces, but where they are needed.
    pub(super) fn new(mesh: &HalfEdges, even: f64) -> Self {
        let faces: Vec<[VertexId; 3]> = (0..mesh.from.len() / 3).map(|f| mesh.corners(f)).collect();
        let bends = curvatures(mesh);
        // A chord of length l stands off a curve by about k l² / 8.
        let wish: Vec<f64> = bends.iter().map(|k| 1.0 / k.max(1e-9).sqrt()).collect();
        let areas: Vec<f64> = vertex_areas(mesh);
        let whole: f64 = areas.iter().sum();
        let mut sizes = wish.clone();
        let mut scale = 1.0;
        for _ in 0..ROUNDS {
            for (size, wish) in sizes.iter_mut().zip(&wish) {
                *size = (wish * scale).clamp(SPREAD[0] * even, SPREAD[1] * even);
            }
            level(mesh, &mut sizes);
            // As many faces as the even mesh has.
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

/// How much the surface bends at each vertex: the root of the sum of both principal curvatures squared, from the
/// bends of the edges around. Lines do not count: they are kept as they are.
fn curvatures(mesh: &HalfEdges) -> Vec<f64> {
    let mut bends = vec![DMat3::ZERO; mesh.points.len()];
    for h in mesh.half_edges().filter(|&h| mesh.is_first(h)) {
        let t = mesh.twin(h);
        if t == OPEN || mesh.line[h.index()] == Line::Crease {
            continue;
        }
        let (n, m) = (mesh.normal(h.face().index()), mesh.normal(t.face().index()));
        let edge = mesh.at(mesh.to(h)) - mesh.at(mesh.from(h));
        let length = edge.length();
        if length == 0.0 {
            continue;
        }
        let way = edge / length;
        let angle = n.cross(m).dot(way).atan2(n.dot(m));
        let outer = DMat3::from_cols(way * way.x, way * way.y, way * way.z) * (0.5 * angle * length);
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
        // Sums of sums grow by the valence each time.
        bends.iter_mut().zip(&mut areas).for_each(|(b, a)| (*b, *a) = (*b * 0.15, *a * 0.15));
    }
    let norm = |b: &DMat3| b.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    bends.iter().zip(&areas).map(|(b, a)| if *a > 0.0 { norm(b) / a } else { 0.0 }).collect()
}

/// Sweeps until no length is larger than a neighbour's allows, at most so often.
const MOST_SWEEPS: usize = 20;

fn level(mesh: &HalfEdges, sizes: &mut [f64]) {
    for sweep in 0..MOST_SWEEPS {
        let mut changed = false;
        let count = mesh.from.len();
        for i in 0..count {
            let h = lodsmith_core::HalfEdgeId::new(if sweep % 2 == 0 { i } else { count - 1 - i });
            let (a, b) = (mesh.from(h), mesh.to(h));
            let reach = GRADATION * mesh.length_sq(h).sqrt();
            for (a, b) in [(a, b), (b, a)] {
                let most = sizes[a.index()] + reach;
                if sizes[b.index()] > most * (1.0 + 1e-9) {
                    sizes[b.index()] = most;
                    changed = true;
                }
            }
        }
        if !changed {
            return;
        }
    }
}
