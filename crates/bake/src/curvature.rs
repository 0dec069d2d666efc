//! Mean curvature at the vertices of the detailed surface.

use glam::DVec3;
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;

use crate::flat::Flat;
use crate::source::SourcePoint;

/// Curvatures, scaled so that most lie between -1 (concave) and 1.
pub(crate) struct Curvature {
    of_vertex: Vec<f32>,
    /// The curvature that is stored as 1, in one over the units of the model.
    pub(crate) range: f64,
}

/// Share of the vertices whose curvature lies within the range.
const WITHIN: f64 = 0.95;

impl Curvature {
    /// Estimates the curvature by how much the normal turns along the edges, the mean over the edges of a vertex.
    /// Cost: O(n log n).
    pub(crate) fn new(flat: &Flat) -> Self {
        let surface = flat.mesh.surface();
        let welded = weld(surface.positions());
        let normals = vertex_normals(&surface, |v| welded.of(v));
        let place = |v: usize| DVec3::from(surface.positions().get(lodsmith_core::VertexId::new(v)));
        let mut sums = vec![[0f64; 2]; surface.positions().len()];
        for t in surface.triangles() {
            for k in 0..3 {
                let [a, b] = [t[k], t[(k + 1) % 3]].map(|v| welded.of(v).index());
                let along = place(b) - place(a);
                let turn = DVec3::from(normals[b].map(f64::from)) - DVec3::from(normals[a].map(f64::from));
                let length_sq = along.length_squared();
                if length_sq > 0.0 && length_sq.is_finite() {
                    for v in [a, b] {
                        sums[v][0] += turn.dot(along) / length_sq;
                        sums[v][1] += 1.0;
                    }
                }
            }
        }
        let raw: Vec<f64> = sums.iter().map(|[sum, n]| if *n > 0.0 { sum / n } else { 0.0 }).collect();
        let mut sizes: Vec<f64> = raw.iter().map(|x| x.abs()).filter(|x| x.is_finite() && *x > 0.0).collect();
        let rank = (sizes.len() as f64 * WITHIN) as usize;
        let range = match sizes.len() {
            0 => 1.0,
            n => *sizes.select_nth_unstable_by(rank.min(n - 1), f64::total_cmp).1,
        };
        let scaled = |v: usize| {
            let own = raw[welded.of(lodsmith_core::VertexId::new(v)).index()];
            (own / range).clamp(-1.0, 1.0) as f32
        };
        Self { of_vertex: (0..raw.len()).map(scaled).collect(), range }
    }

    pub(crate) fn at(&self, flat: &Flat, at: &SourcePoint) -> f32 {
        let wedges = flat.mesh.triangles()[at.face];
        (0..3).map(|k| self.of_vertex[flat.mesh.vertex_of(wedges[k]).index()] * at.weights[k] as f32).sum()
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Model, shapes};

    use super::*;
    use crate::flat::Taken;

    #[test]
    fn the_curvature_of_a_ball_is_one_over_its_radius() {
        let mut ball = shapes::icosphere(5);
        ball.map_positions(|p| p.map(|x| 4.0 * x));
        let flat = Flat::new(&Model::of_mesh(ball), Taken::All);
        let found = Curvature::new(&flat);
        assert!((found.range - 0.25).abs() < 0.01, "{}", found.range);
        let at = SourcePoint { face: 7, weights: [0.2, 0.3, 0.5], height: 0.0 };
        assert!(found.at(&flat, &at) > 0.95);
    }
}
