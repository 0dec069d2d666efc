//! Final least-squares fit: vertices move along their normals to where the triangles lie closest to the
//! original. Without it, a mesh whose vertices all lie on a curved surface is biased to one side of it.

use glam::DVec3;
use lodsmith_core::VertexId;
use lodsmith_core::geometry::triangle::weights_at;
use lodsmith_core::spatial::Hint;

use super::half_edges::{HalfEdges, LineKind};
use super::reference::{ReferenceSurface, tree};
use super::relax::may_move;
use crate::collapse::order::NONE;

/// Maximum number of samples per face, approximately. (As in the fit of the engine.)
const SAMPLES_PER_FACE: usize = 16;
/// Damping, as a share of the trace, so that vertices with few samples hardly move. (A guess.)
const DAMPING: f64 = 0.05;
/// Gauss-Seidel sweeps. (A guess.)
const SWEEPS: usize = 4;
/// Least cosine between the normals of a sample and of its face. (As in the fit of the engine.)
const MIN_FACING_COS: f64 = 0.3;

/// Normal equations of a face, summed over its samples: b are barycentric coordinates, r heights.
#[derive(Clone, Copy, Default)]
struct HeightEquations {
    bb: [[f64; 3]; 3],
    rb: [f64; 3],
}

/// Fits the vertices of a compact mesh that lie on no line.
pub(super) fn fit_vertices(mesh: &mut HalfEdges, on: &[LineKind], reference: &ReferenceSurface<'_>) {
    let faces: Vec<[VertexId; 3]> = (0..mesh.from.len() / 3).map(|f| mesh.corners(f)).collect();
    if faces.is_empty() {
        return;
    }
    let normals: Vec<DVec3> = (0..faces.len()).map(|f| mesh.normal(f).normalize_or_zero()).collect();
    let loads = sampled(mesh, &faces, &normals, reference);
    let mut directions = vec![DVec3::ZERO; mesh.points.len()];
    for (f, t) in faces.iter().enumerate() {
        t.iter().for_each(|v| directions[v.index()] += mesh.normal(f));
    }
    directions.iter_mut().for_each(|w| *w = w.normalize_or_zero());
    let free: Vec<VertexId> = (0..mesh.points.len())
        .filter(|&v| !mesh.pinned[v] && on[v] == LineKind::None)
        .map(VertexId::new)
        .collect();
    let mut lifts = vec![0f64; mesh.points.len()];
    for _ in 0..SWEEPS {
        for &v in &free {
            let (mut wanted, mut weight) = (0.0, 0.0);
            for h in mesh.around(v) {
                let (f, k) = (h.face().index(), h.corner());
                let load = &loads[f];
                let slope = |w: VertexId| normals[f].dot(directions[w.index()]);
                let own = slope(v);
                let others: f64 = (0..3)
                    .filter(|&j| j != k)
                    .map(|j| load.bb[k][j] * slope(faces[f][j]) * lifts[faces[f][j].index()])
                    .sum();
                wanted += own * (load.rb[k] - others);
                weight +=
                    own * own * load.bb[k][k] + DAMPING * (load.bb[0][0] + load.bb[1][1] + load.bb[2][2]);
            }
            if weight > 0.0 {
                lifts[v.index()] = wanted / weight;
            }
        }
    }
    for v in free {
        for share in [1.0, 0.5] {
            let to = mesh.at(v) + directions[v.index()] * (share * lifts[v.index()]);
            if may_move(mesh, v, to) {
                mesh.points[v.index()] = to;
                mesh.kept[v.index()] = NONE;
                break;
            }
        }
    }
}

fn sampled(
    mesh: &HalfEdges,
    faces: &[[VertexId; 3]],
    normals: &[DVec3],
    reference: &ReferenceSurface<'_>,
) -> Vec<HeightEquations> {
    let tree = tree(&mesh.points, faces);
    let mut loads = vec![HeightEquations::default(); faces.len()];
    let prepared = reference.prepared;
    let stride = (prepared.faces.len() / (SAMPLES_PER_FACE / 4 * faces.len())).max(1);
    let mut hint = Hint::default();
    for t in prepared.faces.iter().step_by(stride) {
        let [a, b, c] = t.map(|v| prepared.points[v.index()]);
        let normal = (b - a).cross(c - a);
        let area = normal.length();
        if area == 0.0 {
            continue;
        }
        // Quadrature exact for quadratics: 3/4 of the area at the centre, 1/12 at each corner.
        let centre = (a + b + c) / 3.0;
        for (p, share) in [(centre, 9.0), (a, 1.0), (b, 1.0), (c, 1.0)] {
            let Some(hit) = tree.closest_from(p.to_array(), &mut hint) else { continue };
            let f = hit.face.index();
            if normals[f].dot(normal) < MIN_FACING_COS * area {
                continue;
            }
            let at = DVec3::from(hit.point);
            let w = weights_at(at, faces[f].map(|v| mesh.at(v)));
            let (height, weight) = (normals[f].dot(p - at), share * area);
            for i in 0..3 {
                loads[f].rb[i] += weight * height * w[i];
                for j in 0..3 {
                    loads[f].bb[i][j] += weight * w[i] * w[j];
                }
            }
        }
    }
    loads
}
