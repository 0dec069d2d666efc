//! Re-triangulation of a region: a constrained Delaunay triangulation of its outline.

use glam::{DVec2, DVec3};
use lodsmith_core::VertexId;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::regions::height;

/// Triangles lower than this, in the unit frame, have no area beyond rounding.
const MIN_HEIGHT: f64 = 1e-15;
/// Cosine of the angle to the plane of their region beyond which triangles are spikes. (Guessed.)
const MIN_NORMAL_COS: f64 = 0.5;

/// Outline of a region and the requirements on its triangulation.
pub(super) struct Outline<'a> {
    pub(super) points: &'a [DVec3],
    /// Unit normal of the region.
    pub(super) normal: DVec3,
    /// Edges with the region on their left; edges with the region on both sides occur in both directions.
    pub(super) edges: &'a [[VertexId; 2]],
    /// Inner vertices to keep.
    pub(super) inside: &'a [VertexId],
    /// Required number of triangles.
    pub(super) face_count: usize,
    /// Height up to which steep triangles are allowed.
    pub(super) noise: f64,
}

/// A vertex projected onto the plane.
struct PlanarVertex {
    at: Point2<f64>,
    vertex: usize,
}

impl HasPosition for PlanarVertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Scratch buffers of the triangulation.
#[derive(Default)]
pub(super) struct RegionFiller {
    /// Index plus one of each vertex within the outline; zero for others.
    local: Vec<u32>,
    vertices: Vec<VertexId>,
}

impl RegionFiller {
    /// Triangulates an outline, or returns `None` if it is not simple in its plane: edges cross or run
    /// through a corner, or the inside is not as required. Deterministic. Cost: about O(n log n).
    pub(super) fn fill(&mut self, outline: &Outline<'_>) -> Option<Vec<[VertexId; 3]>> {
        self.local.resize(outline.points.len(), 0);
        self.vertices.clear();
        for &v in outline.edges.iter().flatten().chain(outline.inside) {
            if self.local[v.index()] == 0 {
                self.vertices.push(v);
                self.local[v.index()] = self.vertices.len() as u32;
            }
        }
        let faces = self.triangulate(outline);
        for v in &self.vertices {
            self.local[v.index()] = 0;
        }
        faces.filter(|faces| is_sound(outline, faces))
    }

    fn triangulate(&self, outline: &Outline<'_>) -> Option<Vec<[VertexId; 3]>> {
        let (u, v) = outline.normal.any_orthonormal_pair();
        // Smaller values are rounding, and too small for exact predicates.
        let clear = |x: f64| if x.abs() < 1e-40 { 0.0 } else { x };
        let at = |p: DVec3| DVec2::new(clear(u.dot(p)), clear(v.dot(p)));
        let corners: Vec<PlanarVertex> = self
            .vertices
            .iter()
            .enumerate()
            .map(|(i, &v)| {
                let p = at(outline.points[v.index()]);
                PlanarVertex { at: Point2::new(p.x, p.y), vertex: i }
            })
            .collect();
        let count = corners.len();
        let mut cdt = ConstrainedDelaunayTriangulation::<PlanarVertex>::bulk_load(corners).ok()?;
        if cdt.num_vertices() != count {
            return None;
        }
        let mut handles = vec![FixedVertexHandle::from_index(0); count];
        for v in cdt.vertices() {
            handles[v.data().vertex] = v.fix();
        }
        let of = |v: VertexId| handles[self.local[v.index()] as usize - 1];
        for [a, b] in outline.edges {
            let (a, b) = (of(*a), of(*b));
            if !cdt.exists_constraint(a, b) {
                // The edge must not be split by a corner in between.
                let added = cdt.try_add_constraint(a, b);
                if added.len() != 1 {
                    return None;
                }
            }
        }
        // Triangles to the left of the outline are inside, and so are those connected to them across
        // unconstrained edges.
        let mut is_inside = vec![false; cdt.num_all_faces()];
        let mut open = Vec::new();
        for [a, b] in outline.edges {
            let edge = cdt.get_edge_from_neighbors(of(*a), of(*b))?;
            let face = edge.face().as_inner()?;
            if !std::mem::replace(&mut is_inside[face.fix().index()], true) {
                open.push(face.fix());
            }
        }
        let mut faces = Vec::with_capacity(outline.face_count);
        while let Some(face) = open.pop() {
            let face = cdt.face(face);
            let [a, b, c] = face.vertices().map(|v| self.vertices[v.data().vertex]);
            faces.push([a, b, c]);
            for edge in face.adjacent_edges() {
                if edge.is_constraint_edge() {
                    continue;
                }
                let next = edge.rev().face().as_inner()?;
                if !std::mem::replace(&mut is_inside[next.fix().index()], true) {
                    open.push(next.fix());
                }
            }
        }
        Some(faces)
    }
}

/// True if there are as many triangles as required, they cover the outline, and none is a spike or without
/// area.
fn is_sound(outline: &Outline<'_>, faces: &[[VertexId; 3]]) -> bool {
    let Some(&[first, _]) = outline.edges.first() else { return false };
    let from = outline.points[first.index()];
    let at = |v: VertexId| outline.points[v.index()] - from;
    let around: f64 = outline.edges.iter().map(|[a, b]| at(*a).cross(at(*b)).dot(outline.normal)).sum();
    let mut sum = 0.0;
    let are_sound = faces.iter().all(|t| {
        let [a, b, c] = t.map(at);
        let area = (b - a).cross(c - a);
        let along = area.dot(outline.normal);
        sum += along;
        let height = height([a, b, c]);
        height > MIN_HEIGHT && (along >= MIN_NORMAL_COS * area.length() || height <= 2.0 * outline.noise)
    });
    // Both sums are equal apart from rounding.
    are_sound && faces.len() == outline.face_count && (sum - around).abs() <= 1e-6 * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(
        points: &[[f64; 2]],
        loops: &[&[u32]],
        inside: &[u32],
        count: usize,
    ) -> Option<Vec<[VertexId; 3]>> {
        // A tilted plane, so that nothing is axis-aligned.
        let (u, v) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        let points: Vec<DVec3> = points.iter().map(|p| u * p[0] + v * p[1]).collect();
        let edges: Vec<[VertexId; 2]> = loops
            .iter()
            .flat_map(|l| (0..l.len()).map(|i| [VertexId(l[i]), VertexId(l[(i + 1) % l.len()])]))
            .collect();
        let inside: Vec<VertexId> = inside.iter().map(|&i| VertexId(i)).collect();
        let normal = u.cross(v);
        let outline = Outline {
            points: &points,
            normal,
            edges: &edges,
            inside: &inside,
            face_count: count,
            noise: 1e-9,
        };
        RegionFiller::default().fill(&outline)
    }

    const SQUARES: [[f64; 2]; 8] =
        [[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]];

    #[test]
    fn a_square_with_a_hole() {
        // 3-------2
        // | 7---6 |   the hole runs clockwise
        // | |   | |
        // | 4---5 |
        // 0-------1
        assert!(filled(&SQUARES, &[&[0, 1, 2, 3], &[4, 7, 6, 5]], &[], 8).is_some());
        // Invalid if the hole is an island instead, or with another number of triangles.
        assert!(filled(&SQUARES, &[&[0, 1, 2, 3], &[4, 5, 6, 7]], &[], 8).is_none());
        assert!(filled(&SQUARES, &[&[0, 1, 2, 3], &[4, 7, 6, 5]], &[], 6).is_none());
        // An inner vertex adds two triangles.
        assert!(filled(&SQUARES, &[&[0, 1, 2, 3]], &[4], 4).is_some());
    }

    #[test]
    fn outlines_that_cross_or_touch_are_refused() {
        assert!(filled(&SQUARES, &[&[0, 2, 1, 3]], &[], 2).is_none());
        // A corner in the middle of an edge.
        let points = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.0], [0.0, 2.0]];
        assert!(filled(&points, &[&[0, 1, 2, 3, 4]], &[], 3).is_none());
        // Two coincident vertices.
        let points = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [2.0, 2.0], [0.0, 2.0]];
        assert!(filled(&points, &[&[0, 1, 2, 3, 4]], &[], 3).is_none());
    }

    #[test]
    fn a_slit_has_the_region_on_both_sides() {
        // 3---------2
        // |  4---5  |
        // 0---------1
        let points = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [1.0, 1.0], [2.0, 1.0]];
        assert!(filled(&points, &[&[0, 1, 2, 3], &[4, 5]], &[], 6).is_some());
    }
}
