//! Connected parts: their sizes and labels, and the parts that a run tracks.

use glam::Vec3;
use lodsmith_core::{DisjointSets, VertexId};

use super::order::NONE;
use crate::chunks;
use crate::cost::metric::PartSize;
use crate::pieces::{PIECE_LEN, own_faces};

/// A connected part of the mesh.
#[derive(Clone, Copy)]
pub(super) struct Component {
    pub(super) faces: usize,
    pub(super) area: f32,
    /// Weight of its absence; infinite if one of its vertices or its border is locked.
    pub(super) cost_factor: f32,
    pub(super) min: Vec3,
    pub(super) max: Vec3,
}

impl Component {
    pub(super) const EMPTY: Self = Self {
        faces: 0,
        area: 0.0,
        cost_factor: 0.0,
        min: Vec3::splat(f32::INFINITY),
        max: Vec3::splat(f32::NEG_INFINITY),
    };

    /// Returns the cost of its absence, in the unit of a collapse: its area (`area` is doubled) times the
    /// square of half its size, as if the rest were that far away.
    pub(super) fn cost(&self) -> f32 {
        self.area * 0.25 * (self.max - self.min).length_squared()
    }

    /// Returns the cost times the importance; infinite if the part must stay.
    pub(super) fn weighted_cost(&self) -> f32 {
        if self.cost_factor < f32::INFINITY { self.cost_factor * self.cost() } else { f32::INFINITY }
    }

    pub(super) fn size(&self, faces: usize) -> PartSize {
        let size_sq = (self.max - self.min).length_squared();
        PartSize { cost_factor: self.cost_factor, face: self.area / faces as f32, size_sq }
    }
}

/// The parts of the input, for a run in which they may be removed in order of cost.
#[derive(Clone)]
pub(crate) struct Parts {
    /// Part of each vertex, by number in the ordered input.
    pub(super) part_of: Vec<u32>,
    pub(super) of_input: Vec<Component>,
    pub(super) cost: Vec<f32>,
    pub(super) weighted_cost: Vec<f32>,
    /// Number of cut necks and of contracted pairs when the parts were found.
    pub(super) changes: [usize; 2],
}

/// The parts of the input, and which of them are details for a goal. Areas are doubled.
#[derive(Clone)]
pub(crate) struct Details {
    /// Part of each vertex, by number in the ordered input; `u32::MAX` for none.
    pub(super) part_of: Vec<u32>,
    pub(super) area: Vec<f32>,
    /// Current area.
    pub(super) left: Vec<f32>,
    /// True if it lies on a larger part of another colour.
    pub(super) stands_out: Vec<bool>,
    pub(super) is_detail: Vec<bool>,
}

/// Computes parts without their weights; `label` is the part of each point.
pub(super) fn measure_parts(
    label: &[u32],
    at: impl Fn(VertexId) -> Vec3,
    faces: &[[VertexId; 3]],
) -> Vec<Component> {
    let mut parts = vec![Component::EMPTY; label.iter().copied().max().map_or(0, |m| m as usize + 1)];
    for (i, &l) in label.iter().enumerate() {
        let (p, part) = (at(VertexId(i as u32)), &mut parts[l as usize]);
        (part.min, part.max) = (part.min.min(p), part.max.max(p));
    }
    for t in faces.iter().filter(|t| t[0] != NONE) {
        let [a, b, c] = t.map(&at);
        let part = &mut parts[label[t[0].index()] as usize];
        part.faces += 1;
        part.area += (b - a).cross(c - a).length();
    }
    parts
}

/// Returns the part of each of `count` vertices; parts are numbered in the order of their first vertex.
/// Dead faces do not count.
pub(crate) fn labels(count: usize, faces: &[[VertexId; 3]]) -> Vec<u32> {
    let mut sets = DisjointSets::new(count);
    for &[a, b, c] in faces.iter().filter(|t| t[0] != NONE) {
        sets.join(a.0, b.0);
        sets.join(a.0, c.0);
    }
    numbered(sets.into_representatives())
}

/// Does the same for faces that are sorted by their lowest vertex, on several threads.
pub(crate) fn labels_of_ordered(count: usize, faces: &[[VertexId; 3]]) -> Vec<u32> {
    // Parts within each piece, and the faces that connect them.
    let own_faces = own_faces(faces, count);
    let pieces = chunks::each(own_faces.len(), |piece| {
        let start = piece * PIECE_LEN;
        let mut sets = DisjointSets::new(PIECE_LEN.min(count - start));
        let mut connecting = Vec::new();
        for t in &faces[own_faces[piece].clone()] {
            let [a, b, c] = t.map(|v| v.index() - start);
            if a.max(b).max(c) < PIECE_LEN {
                sets.join(a as u32, b as u32);
                sets.join(a as u32, c as u32);
            } else {
                connecting.push(*t);
            }
        }
        let mut parts = sets.into_representatives();
        parts.iter_mut().for_each(|v| *v += start as u32);
        (parts, connecting)
    });
    let (parts, connecting): (Vec<_>, Vec<_>) = pieces.into_iter().unzip();
    let parts = parts.concat();
    let mut sets = DisjointSets::new(count);
    for t in connecting.into_iter().flatten() {
        let [a, b, c] = t.map(|v| parts[v.index()]);
        sets.join(a, b);
        sets.join(a, c);
    }
    let of_part = sets.into_representatives();
    numbered(parts.into_iter().map(|part| of_part[part as usize]).collect())
}

/// Numbers the parts, given by their representatives: the first vertex of each.
fn numbered(mut label: Vec<u32>) -> Vec<u32> {
    let mut parts = 0;
    for i in 0..label.len() {
        let representative = label[i] as usize;
        label[i] = if representative == i { parts } else { label[representative] };
        parts += u32::from(representative == i);
    }
    label
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{PositionsView, Surface, shapes};

    use super::*;
    use crate::collapse::order::order;
    use crate::test_support::{SmallMesh, tetrahedron};

    fn two() -> SmallMesh {
        tetrahedron().and(&tetrahedron().scaled(0.5), Vec3::X * 4.0)
    }

    #[test]
    fn parts_are_numbered_by_their_first_vertex() {
        let mut faces = two().triangles();
        // (Two vertices without a face are parts of their own.)
        assert_eq!(labels(10, &faces), [0, 0, 0, 0, 1, 1, 1, 1, 2, 3]);
        // Parts whose faces come later in the list keep their numbers.
        faces.reverse();
        assert_eq!(labels(8, &faces), [0, 0, 0, 0, 1, 1, 1, 1]);
        // A face between them makes one part, unless it is dead.
        faces.push([VertexId(7), VertexId(2), VertexId(3)]);
        assert_eq!(labels(8, &faces), [0; 8]);
        faces[8][0] = NONE;
        assert_eq!(labels(8, &faces), [0, 0, 0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn the_cost_of_a_part_is_its_area_times_the_square_of_half_its_size() {
        let (small, mut faces) = (two(), two().triangles());
        faces[3][0] = NONE;
        let label = labels(8, &two().triangles());
        let parts = measure_parts(&label, |w| small.points[w.index()], &faces);
        assert_eq!(parts.iter().map(|p| p.faces).collect::<Vec<_>>(), [3, 4]);
        // The three faces with right angles have the doubled area 1 each, the slanted face √3.
        let area = 3.0 + 3f32.sqrt();
        assert!((parts[0].area - 3.0).abs() < 1e-5 && (parts[1].area - area / 4.0).abs() < 1e-5);
        assert_eq!((parts[1].min, parts[1].max), (Vec3::X * 4.0, Vec3::new(4.5, 0.5, 0.5)));
        // The squared diagonal is 3 in the first box and 3/4 in the second.
        assert!((parts[0].cost() - 3.0 * 0.25 * 3.0).abs() < 1e-5);
        assert!((parts[1].cost() - area / 4.0 * 0.25 * 0.75).abs() < 1e-5);
        let weighted = |cost_factor: f32| Component { cost_factor, ..parts[0] }.weighted_cost();
        assert!((weighted(2.0) - 2.0 * parts[0].cost()).abs() < 1e-5);
        assert_eq!(weighted(f32::INFINITY), f32::INFINITY);
        let size = parts[0].size(2);
        assert!((size.face - 1.5).abs() < 1e-5 && (size.size_sq - 3.0).abs() < 1e-5);
    }

    #[test]
    fn parts_of_an_ordered_input_are_the_same_in_pieces() {
        // Two connected parts and many small ones, each in several pieces.
        let large = shapes::noisy_sphere(6, 0.05, 3);
        let mut p: Vec<[f64; 3]> = large.positions().view().iter().collect();
        let mut faces: Vec<[VertexId; 3]> = large.surface().triangles().to_vec();
        let count = p.len();
        p.extend_from_within(..);
        p[count..].iter_mut().for_each(|p| p[0] += 0.3);
        let own: Vec<_> = faces.iter().map(|t| t.map(|v| VertexId::new(v.index() + count))).collect();
        faces.extend(own);
        for (i, at) in (0..2000).map(|i| (i, VertexId::new(p.len() + 3 * i))).collect::<Vec<_>>() {
            let x = f64::from(i as u32) * 0.001 - 1.0;
            p.extend([[x, 1.5, 0.0], [x, 1.6, 0.0], [x, 1.5, 0.1]]);
            faces.push([0, 1, 2].map(|k| VertexId::new(at.index() + k)));
        }
        let surface = Surface::with_triangles(PositionsView::F64(&p), faces).unwrap();
        let ordered = order(&surface);
        let found = labels_of_ordered(ordered.point_count, &ordered.faces);
        assert!(ordered.point_count > 5 * PIECE_LEN);
        assert_eq!(found, labels(ordered.point_count, &ordered.faces));
        assert_eq!(found.iter().max(), Some(&2001));
    }
}
