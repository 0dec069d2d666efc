//! Open borders and defects of a model: lines to draw, counts, and places to look at.

use std::collections::HashMap;
use std::sync::PoisonError;

use glam::{DMat4, DVec3};
use lodsmith_core::disjoint_sets::DisjointSets;
use lodsmith_core::model::Pose;
use lodsmith_core::{Model, TriMesh, VertexId, WedgeId};
use serde::{Deserialize, Serialize};

use crate::gpu::Marks;
use crate::gpu::shown::Drawing;

/// Open borders and defects of a model.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Flaws {
    /// Lines of each mesh.
    pub marks: Vec<Marks>,
    /// Number of border edges, non-manifold edges, duplicate faces and faces without area.
    pub counts: [usize; 4],
    /// Connected groups of marked edges, those with most edges first.
    pub places: Vec<FlawPlace>,
}

/// A connected group of marked edges, in coordinates of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlawPlace {
    /// True for an open border, false for a defect.
    pub is_border: bool,
    /// Number of edges.
    pub edges: usize,
    /// Centre of its bounding box.
    pub centre: DVec3,
    /// Half the diagonal of its bounding box.
    pub radius: f64,
    /// Average direction that the surface faces there; may be zero.
    pub facing: DVec3,
}

/// Names of the counts.
pub const COUNT_NAMES: [&str; 4] = ["Border edges", "Non-manifold", "Duplicate faces", "Zero-area faces"];

/// Number of places that are kept. Guessed.
const MAX_PLACES: usize = 10_000;

impl Flaws {
    /// Finds borders and defects of each mesh.
    ///
    /// Cost: O(n).
    pub fn of(model: &Model) -> Self {
        let mut all = Self::default();
        for mesh in &model.meshes {
            let marks = Marks::find(&mesh.mesh);
            let found = marks.kind_counts();
            all.counts = [0, 1, 2, 3].map(|k| all.counts[k] + found[k]);
            all.marks.push(marks);
        }
        for instance in model.instances(&Pose::default()) {
            let mesh = &model.meshes[instance.mesh].mesh;
            let marks = &all.marks[instance.mesh];
            all.places.extend(places(mesh, marks, &instance.world_from_mesh));
        }
        all.places.sort_by_key(|place| std::cmp::Reverse(place.edges));
        all.places.truncate(MAX_PLACES);
        all
    }

    /// Writes the lines into the buffers of their model.
    pub(crate) fn show_in(&self, drawing: &Drawing) {
        let mut drawing = drawing.lock().unwrap_or_else(PoisonError::into_inner);
        self.marks.iter().enumerate().for_each(|(mesh, marks)| drawing.set_marks(mesh, marks));
    }

    /// Returns the places of borders, of defects, or of both.
    pub fn shown_places(&self, borders: bool, defects: bool) -> impl Iterator<Item = &FlawPlace> {
        self.places.iter().filter(move |p| if p.is_border { borders } else { defects })
    }
}

/// Returns the connected groups of marked edges of a mesh.
fn places(mesh: &TriMesh, marks: &Marks, world_from_mesh: &DMat4) -> Vec<FlawPlace> {
    let positions = mesh.positions().view();
    let place = |v: VertexId| world_from_mesh.transform_point3(positions.get(v).into());
    let mut found: Vec<FlawPlace> = Vec::new();
    for is_border in [true, false] {
        let mut number_of: HashMap<VertexId, usize> = HashMap::new();
        let mut vertices: Vec<VertexId> = Vec::new();
        let edges: Vec<[usize; 2]> = marks
            .edges_of(is_border)
            .map(|ends| {
                ends.map(|w| {
                    let v = mesh.vertex_of(w);
                    *number_of.entry(v).or_insert_with(|| {
                        vertices.push(v);
                        vertices.len() - 1
                    })
                })
            })
            .collect();
        let mut sets = DisjointSets::new(vertices.len());
        for [a, b] in &edges {
            sets.join(*a as u32, *b as u32);
        }
        // Groups in the order of their first edge.
        let mut groups: Vec<(FlawPlace, DVec3, DVec3)> = Vec::new();
        let mut group_of = vec![usize::MAX; vertices.len()];
        for [a, b] in edges {
            let root = sets.find(a as u32) as usize;
            if group_of[root] == usize::MAX {
                group_of[root] = groups.len();
                let (centre, facing) = (DVec3::ZERO, DVec3::ZERO);
                let none = FlawPlace { is_border, edges: 0, centre, radius: 0.0, facing };
                groups.push((none, DVec3::INFINITY, DVec3::NEG_INFINITY));
            }
            let (group, min, max) = &mut groups[group_of[root]];
            group.edges += 1;
            for p in [a, b].map(|n| place(vertices[n])).into_iter().filter(|p| p.is_finite()) {
                (*min, *max) = (min.min(p), max.max(p));
            }
        }
        for t in mesh.triangles() {
            let corners = t.map(|w: WedgeId| mesh.vertex_of(w));
            let Some(number) = corners.iter().find_map(|v| number_of.get(v)) else { continue };
            let [a, b, c] = corners.map(place);
            let vector = (b - a).cross(c - a);
            if vector.is_finite() {
                groups[group_of[sets.find(*number as u32) as usize]].0.facing += vector;
            }
        }
        found.extend(groups.into_iter().filter(|g| g.1.is_finite()).map(|(group, min, max)| FlawPlace {
            centre: 0.5 * (min + max),
            radius: 0.5 * (max - min).length(),
            facing: group.facing.normalize_or_zero(),
            ..group
        }));
    }
    found
}

#[cfg(test)]
mod tests {
    use lodsmith_core::Positions;

    use super::*;

    /// Two separate squares, one of them with a face twice.
    fn squares() -> TriMesh {
        let square = |x: f32| [[x, 0., 0.], [x + 1., 0., 0.], [x + 1., 1., 0.], [x, 1., 0.]];
        let positions = [square(0.0), square(5.0)].concat();
        let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 5, 6]];
        let faces = faces.map(|t| t.map(|v: usize| VertexId::new(v))).to_vec();
        TriMesh::new(Positions::F32(positions), faces).unwrap()
    }

    #[test]
    fn borders_and_defects_are_counted_and_found() {
        let flaws = Flaws::of(&Model::of_mesh(squares()));
        assert_eq!(flaws.counts[2], 1, "{:?}", flaws.counts);
        let borders: Vec<_> = flaws.shown_places(true, false).collect();
        assert!(borders.iter().any(|p| p.centre.distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-9), "{borders:?}");
        let defects: Vec<_> = flaws.shown_places(false, true).collect();
        assert_eq!(defects.len(), 1);
        assert!(defects[0].centre.x > 5.0 && defects[0].facing.distance(DVec3::Z) < 1e-9, "{defects:?}");
        assert_eq!(flaws.shown_places(true, true).count(), flaws.places.len());
    }

    #[test]
    fn a_closed_surface_has_none() {
        let flaws = Flaws::of(&Model::of_mesh(lodsmith_core::shapes::icosphere(2)));
        assert_eq!(flaws.counts, [0; 4]);
        assert!(flaws.places.is_empty());
    }
}
