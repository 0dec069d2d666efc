//! Removal of small components, the first step of a run.

use lodsmith_core::mesh::weld;
use lodsmith_core::{Bounds, DisjointSets, Surface, VertexId};

/// Numbers of elements removed because their components were small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pruned {
    /// Components removed.
    pub parts: usize,
    /// Triangles in them.
    pub faces: usize,
    /// True if all were too small, so that the largest was kept.
    pub largest_kept: bool,
}

/// Faces in components that are too small.
pub(crate) struct SmallComponents {
    pub(crate) pruned: Pruned,
    /// By face.
    pub(crate) is_small: Vec<bool>,
    /// One face of each removed component.
    pub(crate) first_faces: Vec<usize>,
}

/// A component: its bounding box and contents.
#[derive(Clone, Copy)]
struct ComponentExtent {
    bounds: Bounds,
    first_face: usize,
    faces: usize,
    is_locked: bool,
}

/// Returns the diagonal of the bounding box of the finite vertices of all faces.
pub(crate) fn diagonal(surface: &Surface<'_>) -> f64 {
    let positions = surface.positions();
    let corners = surface.triangles().iter().flatten().map(|&v| positions.get(v));
    Bounds::of(corners).map_or(0.0, |b| b.diagonal())
}

/// Finds the components whose bounding box has a diagonal below `size`. Faces are connected across vertices
/// at equal positions, or within `near`; degenerate and non-finite faces belong to none. A component with a
/// locked vertex is not small.
///
/// Cost: O(n).
pub(crate) fn small_parts(
    surface: &Surface<'_>,
    size: f64,
    near: Option<f64>,
    locked: Option<&[bool]>,
) -> SmallComponents {
    let positions = surface.positions();
    let weld = near.map_or_else(|| weld::weld(positions), |d| weld::weld_within(positions, d));
    let triangles = surface.triangles();
    let welded = |t: &[VertexId; 3]| {
        let [a, b, c] = t.map(|v| weld.of(v));
        let is_finite = t.iter().all(|&v| positions.get(v).iter().all(|x| x.is_finite()));
        (is_finite && a != b && b != c && c != a).then_some([a, b, c])
    };
    let mut sets = DisjointSets::new(positions.len());
    for [a, b, c] in triangles.iter().filter_map(welded) {
        sets.join(a.0, b.0);
        sets.join(a.0, c.0);
    }
    let mut part_of = vec![None; positions.len()];
    let mut parts: Vec<ComponentExtent> = Vec::new();
    let mut of_face = vec![None; triangles.len()];
    for (f, t) in triangles.iter().enumerate() {
        let Some(ends) = welded(t) else { continue };
        let part = *part_of[sets.find(ends[0].0) as usize].get_or_insert_with(|| {
            parts.push(ComponentExtent { bounds: Bounds::EMPTY, first_face: f, faces: 0, is_locked: false });
            parts.len() - 1
        });
        of_face[f] = Some(part);
        let own = &mut parts[part];
        own.faces += 1;
        own.is_locked |= locked.is_some_and(|l| t.iter().any(|v| l[v.index()]));
        own.bounds = t.iter().map(|&v| positions.get(v)).fold(own.bounds, Bounds::with);
    }
    let diagonals: Vec<f64> = parts.iter().map(|p| p.bounds.diagonal()).collect();
    let is_removable = |(part, diagonal): (&ComponentExtent, &f64)| *diagonal < size && !part.is_locked;
    let mut removed: Vec<bool> = parts.iter().zip(&diagonals).map(is_removable).collect();
    let largest_kept = !removed.is_empty() && removed.iter().all(|r| *r);
    if largest_kept {
        // Of equally large ones, the first.
        let largest = (0..parts.len()).rev().max_by(|&i, &j| diagonals[i].total_cmp(&diagonals[j]));
        largest.into_iter().for_each(|i| removed[i] = false);
    }
    let small = || parts.iter().zip(&removed).filter(|p| *p.1).map(|p| p.0);
    SmallComponents {
        pruned: Pruned { parts: small().count(), faces: small().map(|p| p.faces).sum(), largest_kept },
        first_faces: small().map(|p| p.first_face).collect(),
        is_small: of_face.into_iter().map(|p| p.is_some_and(|p| removed[p])).collect(),
    }
}

/// Returns the triangles, with the faces of small components made degenerate so that later steps drop them,
/// and the number of vertices that only they use. Faces keep their indices.
pub(crate) fn without_small(surface: &Surface<'_>, is_small: &[bool]) -> (Vec<[VertexId; 3]>, usize) {
    let triangles = surface.triangles();
    let positions = surface.positions();
    let is_finite = |v: VertexId| positions.get(v).iter().all(|x| x.is_finite());
    let mut used = vec![0u8; positions.len()];
    for (t, &small) in triangles.iter().zip(is_small) {
        for v in t {
            used[v.index()] |= if small { 1 } else { 2 };
        }
    }
    let unused = (0..used.len()).filter(|&i| used[i] == 1 && is_finite(VertexId(i as u32))).count();
    let kept = triangles.iter().zip(is_small).find(|t| !t.1).map_or(VertexId(0), |t| t.0[0]);
    let triangles = triangles.iter().zip(is_small).map(|(t, &small)| if small { [kept; 3] } else { *t });
    (triangles.collect(), unused)
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Positions, TriMesh, shapes};

    use super::*;

    #[test]
    fn parts_are_measured_by_their_bounding_boxes() {
        let mesh = shapes::two_far_parts();
        let surface = mesh.surface();
        let all = small_parts(&surface, 1e-12, None, None);
        assert_eq!(all.pruned, Pruned::default());
        // Larger than everything: the largest is kept.
        let none = small_parts(&surface, 1e9, None, None);
        assert!(none.pruned.largest_kept && none.pruned.parts == 1 && none.first_faces.len() == 1);
        assert!(none.pruned.faces > 0 && none.pruned.faces < mesh.face_count());
        assert_eq!(none.is_small.iter().filter(|s| **s).count(), none.pruned.faces);
    }

    #[test]
    fn parts_are_measured_up_to_the_largest_coordinates() {
        let far = 1.7e308;
        let large = [[-far, -far, 0.0], [far, -far, 0.0], [0.0, far, 0.0]];
        let small = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let positions = Positions::F64([large, small].concat());
        let mesh = TriMesh::new(positions, vec![[0, 1, 2].map(VertexId), [3, 4, 5].map(VertexId)]).unwrap();
        let size = 0.01 * diagonal(&mesh.surface());
        assert!(size.is_finite());
        assert_eq!(small_parts(&mesh.surface(), size, None, None).is_small, [false, true]);
    }
}
