//! Both sides of a result that was reduced as one.

use std::collections::{HashMap, HashSet};

use lodsmith_core::{Attribute, MeshError, Positions, Semantic, TriMesh, VertexId, WedgeId};

use super::plan::{BackValues, tangent_sign};
use super::single::{SingleSided, unit};
use crate::constraints::HeldWedges;

/// A result with both sides.
pub(super) struct BothSides {
    pub(super) mesh: TriMesh,
    pub(super) held: HeldWedges,
    /// For each vertex of the result, its vertex in the single-sided result.
    pub(super) vertices: Vec<VertexId>,
}

impl SingleSided {
    /// Adds the backs to a result: after all fronts, in the same order, with opposite windings. Cost: O(n).
    pub(super) fn both_sides(
        &self,
        input: &TriMesh,
        single: &TriMesh,
        held: &HeldWedges,
    ) -> Result<BothSides, MeshError> {
        let regions = single.regions().unwrap_or_default();
        let kind = |f: usize| self.table[regions[f].index()];
        let vertex_count = single.vertex_count();
        let mut triangles: Vec<[WedgeId; 3]> = single.triangles().to_vec();
        let mut vertex_of: Vec<VertexId> =
            (0..single.wedge_count()).map(WedgeId::new).map(|w| single.vertex_of(w)).collect();
        let mut vertices: Vec<VertexId> = (0..vertex_count).map(VertexId::new).collect();
        // Wedges of backs, by the wedge of the front and whether the back has vertices of its own.
        let mut back_of: HashMap<(WedgeId, bool), WedgeId> = HashMap::new();
        let mut own_vertex: HashMap<VertexId, VertexId> = HashMap::new();
        let mut back_wedges: Vec<WedgeId> = Vec::new();
        let shares_values = self.plan.is_same();
        let mut own_regions: Vec<_> = (0..regions.len()).map(|f| kind(f).front.unwrap_or_default()).collect();
        let mut back_faces: Vec<usize> = Vec::new();
        // Where fronts ended up on each other, a back exists already.
        let key = |corners: [VertexId; 3]| {
            let least = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
            [0, 1, 2].map(|k| corners[(least + k) % 3])
        };
        let places = |t: &[WedgeId; 3]| t.map(|w| single.vertex_of(w));
        let mut known: HashSet<[VertexId; 3]> = single.triangles().iter().map(|t| key(places(t))).collect();
        for (f, t) in single.triangles().iter().enumerate() {
            let Some(back) = kind(f).back else { continue };
            let [a, b, c] = places(t);
            if !known.insert(key([a, c, b])) {
                continue;
            }
            let corners = t.map(|w| {
                if shares_values && !back.has_own_vertices {
                    return w;
                }
                *back_of.entry((w, back.has_own_vertices)).or_insert_with(|| {
                    let v = single.vertex_of(w);
                    vertex_of.push(if back.has_own_vertices {
                        *own_vertex.entry(v).or_insert_with(|| {
                            vertices.push(v);
                            VertexId::new(vertices.len() - 1)
                        })
                    } else {
                        v
                    });
                    back_wedges.push(w);
                    WedgeId::new(vertex_of.len() - 1)
                })
            });
            triangles.push([corners[0], corners[2], corners[1]]);
            own_regions.push(back.region.unwrap_or_default());
            back_faces.push(f);
        }
        let positions = match single.positions() {
            Positions::F32(p) => Positions::F32(vertices.iter().map(|v| p[v.index()]).collect()),
            Positions::F64(p) => Positions::F64(vertices.iter().map(|v| p[v.index()]).collect()),
        };
        let mut mesh = TriMesh::with_wedges(positions, vertex_of, triangles)?;
        mesh.set_regions(input.regions().map(|_| own_regions))?;
        self.set_attributes(&mut mesh, input, single, &back_wedges)?;
        let held = self.held(single.face_count(), held, &back_faces);
        held.restore(&mut mesh, input);
        Ok(BothSides { mesh, held, vertices })
    }

    /// Sets the attributes of all wedges: first the wedges of the single-sided result, then the wedges of the
    /// backs, each of which belongs to one of these.
    fn set_attributes(
        &self,
        mesh: &mut TriMesh,
        input: &TriMesh,
        single: &TriMesh,
        backs: &[WedgeId],
    ) -> Result<(), MeshError> {
        let plan = &self.plan;
        let find = |semantic: &Semantic| single.further_attributes().iter().find(|a| a.semantic == *semantic);
        let own = |values: &BackValues| match values {
            BackValues::Own(semantic) => find(semantic),
            _ => None,
        };
        if let (Some(fronts), Some(values)) = (single.normals(), &plan.normals) {
            let own = own(values);
            let back = |w: &WedgeId| {
                let front = fronts[w.index()];
                match own {
                    Some(a) => unit([a.of(*w)[0], a.of(*w)[1], a.of(*w)[2]]).unwrap_or(front.map(|x| -x)),
                    None if *values == BackValues::Same => front,
                    None => front.map(|x| -x),
                }
            };
            mesh.set_normals(Some(fronts.iter().copied().chain(backs.iter().map(back)).collect()))?;
        }
        if let (Some(fronts), Some(values)) = (single.uvs(), &plan.uvs) {
            let own = own(values);
            let back = |w: &WedgeId| own.map_or(fronts[w.index()], |a| [a.of(*w)[0], a.of(*w)[1]]);
            mesh.set_uvs(Some(fronts.iter().copied().chain(backs.iter().map(back)).collect()))?;
        }
        if let (Some(fronts), Some(values)) = (single.colors(), &plan.colors) {
            let own = own(values);
            let back = |w: &WedgeId| own.map_or(fronts[w.index()], |a| [0, 1, 2, 3].map(|k| a.of(*w)[k]));
            mesh.set_colors(Some(fronts.iter().copied().chain(backs.iter().map(back)).collect()))?;
        }
        for (a, values) in input.further_attributes().iter().zip(&plan.further) {
            // (Attributes that a run drops are missing here.)
            let Some(front) =
                single.further_attributes().iter().find(|b| (&b.semantic, b.width) == (&a.semantic, a.width))
            else {
                continue;
            };
            let is_tangent = a.semantic == Semantic::Tangent && a.width == 4;
            let sign = if is_tangent { find(&tangent_sign()) } else { None };
            let mut all = front.values.clone();
            for w in backs {
                let at = all.len();
                match (own(values), sign) {
                    (Some(own), Some(sign)) => {
                        let direction = unit([own.of(*w)[0], own.of(*w)[1], own.of(*w)[2]]);
                        all.extend(direction.unwrap_or([1.0, 0.0, 0.0]));
                        all.extend_from_slice(sign.of(*w));
                    }
                    (Some(own), None) => all.extend_from_slice(own.of(*w)),
                    (None, _) => all.extend_from_slice(front.of(*w)),
                }
                if *values == BackValues::Opposite {
                    let turned = if is_tangent { at + 3..at + 4 } else { at..at + a.width };
                    all[turned].iter_mut().for_each(|x| *x = -*x);
                }
            }
            mesh.add_attribute(Attribute { values: all, ..a.clone() })?;
        }
        Ok(())
    }

    /// Returns the locked wedges of the input at the corners of both sides.
    fn held(&self, fronts: usize, held: &HeldWedges, back_faces: &[usize]) -> HeldWedges {
        if held.is_empty() {
            return HeldWedges::default();
        }
        let side = |f: usize, k: usize, side: usize| held.at(f, k).and_then(|w| self.wedges[w.index()][side]);
        let front = (0..fronts).map(|f| [0, 1, 2].map(|k| side(f, k, 0)));
        let back = back_faces.iter().map(|&f| [0, 2, 1].map(|k| side(f, k, 1)));
        HeldWedges::new(front.chain(back))
    }
}
