//! Counts of defects that a method can introduce.

use lodsmith::core::mesh::defects::clean_surface;
use lodsmith::core::topology::{EdgeKind, Topology};
use lodsmith::core::{FaceId, Surface, TriMesh};

/// Smallest angle between the normals of neighbouring faces that count as back to back, in degrees. (Guessed: a
/// sharp edge of 30 degrees does not count.)
const BACK_TO_BACK_DEG: f64 = 150.0;

/// Counts after merging vertices at equal positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Validity {
    /// Edges with three faces or more.
    pub(crate) non_manifold_edges: usize,
    /// Edges with one face.
    pub(crate) border_edges: usize,
    /// Edges whose faces are wound in opposite directions.
    pub(crate) misoriented_edges: usize,
    /// Edges whose two faces lie back to back, as at a flipped face.
    pub(crate) folds: usize,
    /// Faces that use a position twice, and duplicate faces.
    pub(crate) bad_faces: usize,
    /// Connected components.
    pub(crate) components: usize,
}

impl Validity {
    /// Computes the counts. Cost: nearly O(n).
    pub(crate) fn of(mesh: &TriMesh) -> Self {
        let surface = mesh.surface();
        let cleaned = clean_surface(&surface, None);
        let bad_faces = cleaned.dropped_face_count();
        let clean = Surface::with_triangles(surface.positions(), cleaned.triangles)
            .expect("cleaning does not renumber vertices");
        let topology = Topology::unwelded(&clean);
        let counts = topology.counts();
        Self {
            non_manifold_edges: counts.non_manifold_edge_count,
            border_edges: counts.border_edge_count,
            misoriented_edges: counts.misoriented_edge_count,
            folds: folds(&clean, &topology),
            bad_faces,
            components: counts.component_count,
        }
    }

    /// Returns the counts that should not rise, by name, in the order of reports.
    pub(crate) fn counts(&self) -> [(&'static str, usize); 5] {
        [
            ("non_manifold_edges", self.non_manifold_edges),
            ("border_edges", self.border_edges),
            ("misoriented_edges", self.misoriented_edges),
            ("folds", self.folds),
            ("bad_faces", self.bad_faces),
        ]
    }

    /// Returns the increase of each count over that of the input, 0 if it did not rise.
    pub(crate) fn risen_from(&self, input: &Self) -> impl Iterator<Item = (&'static str, usize)> {
        let pairs = self.counts().into_iter().zip(input.counts());
        pairs.map(|((name, now), (_, was))| (name, now.saturating_sub(was)))
    }
}

fn folds(surface: &Surface<'_>, topology: &Topology) -> usize {
    let max_cos = BACK_TO_BACK_DEG.to_radians().cos();
    let normal = |f: FaceId| {
        let [a, b, c] = surface.triangles()[f.index()].map(|v| surface.positions().get(v));
        let to = |p: [f64; 3]| [0, 1, 2].map(|k| p[k] - a[k]);
        let (u, v) = (to(b), to(c));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = n[0].hypot(n[1]).hypot(n[2]);
        // A face without area has no normal.
        (length.is_normal()).then(|| n.map(|x| x / length))
    };
    let is_fold = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] < max_cos;
    let inner = topology.edges().filter(|&h| topology.kind(h) == Some(EdgeKind::Inner));
    let faces = inner.filter_map(|h| Some((normal(h.face())?, normal(topology.twin(h)?.face())?)));
    faces.filter(|&(a, b)| is_fold(a, b)).count()
}

#[cfg(test)]
mod tests {
    use lodsmith::core::{Positions, VertexId, shapes};

    use super::*;

    #[test]
    fn clean_shapes_have_no_defects() {
        for mesh in [shapes::icosphere(2), shapes::cube(3), shapes::torus(24, 12)] {
            let found = Validity::of(&mesh);
            assert_eq!(found, Validity { components: 1, ..Validity::default() });
        }
        let parts = Validity::of(&shapes::tetrahedra(3));
        assert_eq!((parts.components, parts.folds), (3, 0));
    }

    #[test]
    fn a_flipped_face_makes_folds() {
        // The apex of a flat star is pulled across the rim: faces 0 and 1 are flipped.
        //
        //   3---2
        //   | 4 |    and 4 moves down, beyond 0-1
        //   0---1
        let positions = |y: f32| {
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, y, 0.0f32]]
        };
        let face = |a, b, c| [VertexId(a), VertexId(b), VertexId(c)];
        let faces = vec![face(0, 1, 4), face(1, 2, 4), face(2, 3, 4), face(3, 0, 4)];
        let folds =
            |y| Validity::of(&TriMesh::new(Positions::F32(positions(y)), faces.clone()).unwrap()).folds;
        assert_eq!(folds(0.5), 0);
        assert_eq!(folds(-0.5), 2);
    }

    #[test]
    fn only_counts_that_rise_are_reported() {
        let input = Validity { border_edges: 3, folds: 2, ..Validity::default() };
        let result = Validity { border_edges: 1, folds: 5, ..Validity::default() };
        let risen: Vec<_> = result.risen_from(&input).filter(|r| r.1 > 0).collect();
        assert_eq!(risen, [("folds", 3)]);
    }
}
