//! Source of each wedge of a simplified mesh on its original, for transferring any per-wedge data.
//!
//! The method does not depend on how the result was made (collapses, a fit, clusters, a new mesh): it looks
//! at the two surfaces only. The source is not simply the nearest point. Where sheets touch or a seam runs, a
//! wedge belongs to one side. The side is decided by the properties below; all but the last can be outweighed
//! by a distance:
//!
//! ```text
//! property that decides the side        outweighed by a distance of (in reaches of the wedge)
//! region, direction of its faces        1
//! texture coordinates                   1
//! normals                               1/10
//! position of its faces                 nothing: decides between equally near places
//! ```

use glam::DVec3;

use crate::geometry::triangle::{self, double_area_normal, weights_at};
use crate::ids::{FaceId, RegionId, WedgeId};
use crate::measure::{MeasureError, chunks};
use crate::mesh::{MeshError, TriMesh};
use crate::spatial::{Bvh, Hint};

/// The source of a wedge. Ids refer to the original.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Source {
    /// At exactly this wedge of the original, on the same side of every seam.
    Wedge(WedgeId),
    /// Nearest to a point of this face.
    Face {
        /// The face.
        face: FaceId,
        /// Barycentric weights of its corners; none negative, sum 1.
        weights: [f32; 3],
    },
    /// The position is not finite, or too far away to be measured.
    Nowhere,
}

/// The sources of all wedges of a mesh: the result of [`correspondence`].
#[derive(Clone, Debug, PartialEq)]
pub struct Correspondence<'a> {
    original: &'a TriMesh,
    sources: Vec<Source>,
}

/// Finds the source of each wedge of `result` on `original`.
///
/// The original is the mesh as it was given to the run, before any welding or repair, and the ids are its
/// own. A wedge whose position is bit for bit equal to that of a vertex of the original gets a wedge of that
/// vertex; others get the nearest point of the surface, on the side of sheets and seams that the wedge's
/// regions, texture coordinates and normals decide, if both meshes have them. Other attributes do not decide
/// sides; a wedge of a mesh without the original's seams gets one of the sides. Faces of the original with a
/// non-finite corner are not used. Deterministic at any number of threads. Cost: O(n log n) for n faces of
/// the original, then O(log n) for each wedge; 0.6 s for 588,000 faces and 147,000 wedges on two cores
/// (measured).
///
/// ```
/// use lodsmith_core::{TriMesh, correspondence, mesh::compact, shapes};
///
/// let sphere = shapes::icosphere(4);
/// // Whatever made it: here every vertex moves, and half of the faces are left out.
/// let faces = sphere.surface().triangles().iter().step_by(2).copied().collect();
/// let mut part = TriMesh::new(sphere.positions().clone(), faces)?;
/// part.map_positions(|p| p.map(|x| 1.001 * x));
/// let part = compact::compact(&part).mesh;
///
/// // A temperature at each vertex of the sphere, which the mesh itself knows nothing about.
/// let temperature: Vec<f32> = sphere.positions().view().iter().map(|p| 20.0 + p[2] as f32).collect();
/// let carried = correspondence(&sphere, &part)?.transfer(&temperature, 1)?;
/// for (p, t) in part.positions().view().iter().zip(carried) {
///     assert!((t - (20.0 + p[2] as f32)).abs() < 0.01);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`MeasureError::Empty`] if the original has no face with finite corners.
pub fn correspondence<'a>(
    original: &'a TriMesh,
    result: &TriMesh,
) -> Result<Correspondence<'a>, MeasureError> {
    let tree = Bvh::new(&original.surface());
    if tree.is_empty() {
        return Err(MeasureError::Empty { which: "original" });
    }
    let sides = wedge_sides(result, &tree);
    let search = SourceSearch { original, result, tree };
    let parts = chunks::map(result.wedge_count(), |range| {
        let mut hint = Hint::default();
        let of = |w: usize| search.source(WedgeId::new(w), &sides[w], &mut hint);
        range.map(of).collect::<Vec<_>>()
    });
    Ok(Correspondence { original, sources: parts.concat() })
}

impl<'a> Correspondence<'a> {
    /// The mesh that the sources are on.
    pub fn original(&self) -> &'a TriMesh {
        self.original
    }
    /// The source of each wedge of the result.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }
    /// Consumes the correspondence and returns the source of each wedge of the result.
    pub fn into_sources(self) -> Vec<Source> {
        self.sources
    }
    /// Returns the wedges of the original that a wedge of the result is blended from, with their weights;
    /// `None` if it has no source.
    ///
    /// # Panics
    /// If there is no such wedge.
    pub fn blend(&self, wedge: WedgeId) -> Option<[(WedgeId, f32); 3]> {
        match self.sources[wedge.index()] {
            Source::Wedge(w) => Some([(w, 1.0), (w, 0.0), (w, 0.0)]),
            Source::Face { face, weights } => {
                let wedges = self.original.triangles()[face.index()];
                Some([0, 1, 2].map(|k| (wedges[k], weights[k])))
            }
            Source::Nowhere => None,
        }
    }
    /// Transfers values by blending: `width` values for each wedge of the original give `width` for each
    /// wedge of the result. Wedges without a source get NaN. Directions have to be normalized afterwards.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there are not `width` values for each wedge of the original.
    pub fn transfer(&self, values: &[f32], width: usize) -> Result<Vec<f32>, MeshError> {
        let wanted = width * self.original.wedge_count();
        if values.len() != wanted {
            return Err(MeshError::WrongLength { name: "values to transfer", got: values.len(), wanted });
        }
        let mut carried = Vec::with_capacity(width * self.sources.len());
        for w in 0..self.sources.len() {
            let blend = self.blend(WedgeId::new(w));
            carried.extend((0..width).map(|k| {
                blend.map_or(f32::NAN, |blend| {
                    // Skip zero weights: their values may be NaN.
                    let parts = blend.iter().filter(|part| part.1 > 0.0);
                    parts.map(|&(w, weight)| values[w.index() * width + k] * weight).sum()
                })
            }));
        }
        Ok(carried)
    }
    /// Transfers values that cannot be blended, such as names or joint numbers: each wedge of the result
    /// takes the value of the wedge with the largest weight; `None` if it has no source.
    ///
    /// # Errors
    /// [`MeshError::WrongLength`] if there is not one value for each wedge of the original.
    pub fn transfer_discrete<T: Clone>(&self, values: &[T]) -> Result<Vec<Option<T>>, MeshError> {
        let wanted = self.original.wedge_count();
        if values.len() != wanted {
            return Err(MeshError::WrongLength { name: "values to transfer", got: values.len(), wanted });
        }
        let heaviest = |blend: [(WedgeId, f32); 3]| {
            let [a, b, c] = blend;
            let ab = if b.1 > a.1 { b } else { a };
            if c.1 > ab.1 { c.0 } else { ab.0 }
        };
        let of = |w| Some(values[heaviest(self.blend(WedgeId::new(w))?).index()].clone());
        Ok((0..self.sources.len()).map(of).collect())
    }
}

/// Properties that decide on which side of sheets and seams a wedge of the result lies. Lengths in the frame
/// of the original's tree.
#[derive(Clone, Copy, Debug, Default)]
struct WedgeSide {
    /// The sum of the normals of its faces.
    normal: DVec3,
    /// The mean of the centres of its faces, relative to its position.
    inward: DVec3,
    /// The mean distance to those centres, and the mean distance between the texture coordinates here and
    /// there.
    reach: f64,
    uv_reach: f64,
    region: Option<RegionId>,
    faces: u32,
}

fn wedge_sides(result: &TriMesh, tree: &Bvh) -> Vec<WedgeSide> {
    let positions = result.positions().view();
    let mut sides = vec![WedgeSide::default(); result.wedge_count()];
    for (f, wedges) in result.triangles().iter().enumerate() {
        let corners = wedges.map(|w| tree.frame().unit_from_user(positions.get(result.vertex_of(w))));
        let normal = double_area_normal(corners);
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let uvs = result.uvs().map(|t| wedges.map(|w| t[w.index()].map(f64::from)));
        for k in 0..3 {
            let side = &mut sides[wedges[k].index()];
            side.normal += normal;
            side.inward += centre - corners[k];
            side.reach += centre.distance(corners[k]);
            if let Some([a, b, c]) = uvs {
                let own = [a, b, c][k];
                let off = [0, 1].map(|i| (a[i] + b[i] + c[i]) / 3.0 - own[i]);
                side.uv_reach += libm::hypot(off[0], off[1]);
            }
            side.region = side.region.or(result.regions().map(|r| r[f]));
            side.faces += 1;
        }
    }
    for side in sides.iter_mut().filter(|s| s.faces > 0) {
        let share = 1.0 / f64::from(side.faces);
        side.inward *= share;
        side.reach *= share;
        side.uv_reach *= share;
    }
    sides
}

/// Penalties for a source on the wrong side, added to its squared distance, in squared reaches of the wedge.
/// (Guessed. A fit moves vertices by less than a tenth of an edge, mostly; noisy normals must not draw a
/// source away.)
const OTHER_SHEET_PENALTY: f64 = 1.0;
const OTHER_CHART_PENALTY: f64 = 1.0;
const OTHER_NORMAL_PENALTY: f64 = 0.01;
/// Texture coordinates count as equal if they differ by less than this share of their change over a reach; if
/// they differ by the whole change, they belong to another chart; between the two the penalty grows linearly.
/// (Coordinates that a run has blended are off by up to a third of a reach at the ends of seams, as measured
/// on a model of 5,856 faces at 20 %.)
const SAME_CHART_TOLERANCE: f64 = 0.5;
/// Cosine of 25°: normals that differ by more belong to another side of a crease. (Guessed.)
const SAME_NORMAL_COS: f64 = 0.906;
/// Positions whose squared distances, in squared reaches, differ by less are equally near.
const EQUAL_DISTANCE_SQ: f64 = 1e-12;
/// Length of the step from the wedge towards its own faces that decides between equally near faces, as a
/// share of the reach.
const INWARD_STEP: f64 = 0.05;

struct SourceSearch<'a> {
    original: &'a TriMesh,
    result: &'a TriMesh,
    tree: Bvh,
}

/// A candidate: its squared distance plus penalties, and a misfit that decides among equals.
#[derive(Clone, Copy)]
struct Candidate {
    slot: u32,
    cost: f64,
    misfit: f64,
}

impl SourceSearch<'_> {
    fn source(&self, wedge: WedgeId, side: &WedgeSide, hint: &mut Hint) -> Source {
        let place = self.result.positions().view().get(self.result.vertex_of(wedge));
        let p = self.tree.frame().unit_from_user(place);
        // Also `None` if the position is not finite.
        let Some(nearest) = self.tree.closest_slot(p, f64::INFINITY, hint) else { return Source::Nowhere };
        let kept = self.corner_at(nearest.slot, place).is_some();
        // At a kept vertex all distances are 0: only the faces at that vertex are compared.
        let equal = EQUAL_DISTANCE_SQ * side.reach * side.reach + f64::MIN_POSITIVE;
        let mut best = self.rate_candidate(nearest.slot, wedge, side, p);
        let bound = if kept { equal } else { best.cost + equal };
        self.tree.visit(p, bound, |slot| {
            let is_known = slot == best.slot || kept && self.corner_at(slot, place).is_none();
            if is_known || triangle::nearest(p, self.tree.slot_corners(slot)).distance_sq > best.cost + equal
            {
                return None;
            }
            let candidate = self.rate_candidate(slot, wedge, side, p);
            let is_better = if (candidate.cost - best.cost).abs() <= equal {
                let faces = [candidate, best].map(|c| self.tree.slot_face(c.slot));
                candidate.misfit < best.misfit || candidate.misfit == best.misfit && faces[0] < faces[1]
            } else {
                candidate.cost < best.cost
            };
            if !is_better {
                return None;
            }
            best = candidate;
            (!kept).then_some(best.cost + equal)
        });
        match self.corner_at(best.slot, place) {
            Some(w) => Source::Wedge(w),
            None => Source::Face {
                face: self.tree.slot_face(best.slot),
                weights: self.weights(best.slot, p).map(|x| x as f32),
            },
        }
    }

    /// Returns the wedge of a face whose position is exactly `place`.
    fn corner_at(&self, slot: u32, place: [f64; 3]) -> Option<WedgeId> {
        let wedges = self.original.triangles()[self.tree.slot_face(slot).index()];
        let view = self.original.positions().view();
        wedges.into_iter().find(|w| view.get(self.original.vertex_of(*w)) == place)
    }

    /// Returns the barycentric weights of the point of a face nearest to `p`.
    fn weights(&self, slot: u32, p: DVec3) -> [f64; 3] {
        let corners = self.tree.slot_corners(slot);
        let weights = weights_at(triangle::nearest(p, corners).point, corners);
        let sum: f64 = weights.iter().sum();
        weights.map(|x| x / sum)
    }

    fn rate_candidate(&self, slot: u32, wedge: WedgeId, side: &WedgeSide, p: DVec3) -> Candidate {
        let corners = self.tree.slot_corners(slot);
        let nearest = triangle::nearest(p, corners);
        let face = self.tree.slot_face(slot).index();
        let wedges = self.original.triangles()[face];
        let (w, unit_sq) = (wedge.index(), side.reach * side.reach);
        let (mut cost, mut misfit) = (nearest.distance_sq, 0.0);

        let normal = double_area_normal(corners);
        let is_back = side.normal.dot(normal) < 0.0;
        let regions = side.region.zip(self.original.regions().map(|r| r[face]));
        if is_back || regions.is_some_and(|(a, b)| a != b) {
            cost += OTHER_SHEET_PENALTY * unit_sq;
        }
        if normal == DVec3::ZERO {
            // A face without area determines the side poorly.
            misfit += 1.0;
        }
        let mut known = None;
        let mut weights = || *known.get_or_insert_with(|| self.weights(slot, p));
        if let (Some(own), Some(all)) = (self.result.uvs(), self.original.uvs()) {
            let there = blended(all, wedges, weights());
            let off = [0, 1].map(|k| there[k] - f64::from(own[w][k]));
            // In reaches; at least the rounding error of texture coordinates in single precision.
            let off = libm::hypot(off[0], off[1]) / side.uv_reach.max(1e-5);
            // NaN counts as another chart.
            let share = (off - SAME_CHART_TOLERANCE) / (1.0 - SAME_CHART_TOLERANCE);
            cost += OTHER_CHART_PENALTY * unit_sq * if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) };
        }
        if let (Some(own), Some(all)) = (self.result.normals(), self.original.normals()) {
            let (a, b) = (DVec3::from(own[w].map(f64::from)), DVec3::from(blended(all, wedges, weights())));
            let length = a.length() * b.length();
            if length > 0.0 && a.dot(b) < SAME_NORMAL_COS * length {
                cost += OTHER_NORMAL_PENALTY * unit_sq;
            }
        }
        // After a step towards the wedge's own faces, faces on the same side are nearer than those across an
        // edge.
        let step = p + side.inward * INWARD_STEP;
        let beside =
            triangle::nearest(step, corners).point.distance(nearest.point + side.inward * INWARD_STEP);
        if side.reach > 0.0 {
            misfit += beside / (INWARD_STEP * side.reach);
        }
        Candidate { slot, cost, misfit }
    }
}

fn blended<const N: usize>(all: &[[f32; N]], wedges: [WedgeId; 3], weights: [f64; 3]) -> [f64; N] {
    std::array::from_fn(|k| {
        wedges.iter().zip(weights).map(|(w, weight)| f64::from(all[w.index()][k]) * weight).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Positions;
    use crate::{VertexId, shapes};

    /// Two squares of two triangles, with separate vertices; the second lies above the first by `gap`.
    fn sheets(gap: f64, is_turned: bool) -> TriMesh {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let at = |z: f64| square.map(|[x, y]| [x, y, z]);
        let positions = [at(0.0), at(gap)].concat();
        let mut triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        if is_turned {
            triangles[2..].iter_mut().for_each(|t| t.swap(1, 2));
        }
        let triangles = triangles.into_iter().map(|t: [u32; 3]| t.map(VertexId)).collect();
        TriMesh::new(Positions::F64(positions), triangles).unwrap()
    }

    fn triangle(corners: [[f64; 3]; 3]) -> TriMesh {
        TriMesh::new(Positions::F64(corners.to_vec()), vec![[0, 1, 2].map(VertexId)]).unwrap()
    }

    #[test]
    fn a_mesh_comes_from_itself() {
        for (name, mesh) in shapes::all() {
            let Ok(found) = correspondence(&mesh, &mesh) else {
                assert!(mesh.face_count() == 0, "{name}");
                continue;
            };
            let mut is_used = vec![false; mesh.wedge_count()];
            mesh.triangles().iter().flatten().for_each(|w| is_used[w.index()] = true);
            let view = mesh.positions().view();
            for (w, source) in found.sources().iter().enumerate().filter(|x| is_used[x.0]) {
                let Source::Wedge(from) = *source else { panic!("{name}: {w} is not kept: {source:?}") };
                let places = [WedgeId::new(w), from].map(|w| view.get(mesh.vertex_of(w)));
                assert_eq!(places[0], places[1], "{name}");
            }
        }
    }

    #[test]
    fn a_sheet_that_faces_the_same_way_wins_over_a_nearer_one() {
        let mesh = sheets(0.02, true);
        let (low, high) = ([[0.2, 0.2], [0.8, 0.3], [0.7, 0.7]], 0.018);
        let at = |[x, y]: [f64; 2]| [x, y, high];
        let up = triangle(low.map(at));
        let is_of = |sources: &[Source], faces: [u32; 2]| {
            sources
                .iter()
                .all(|s| matches!(s, Source::Face { face, .. } if faces[0] <= face.0 && face.0 <= faces[1]))
        };
        assert!(is_of(correspondence(&mesh, &up).unwrap().sources(), [0, 1]));
        let down = triangle([low[0], low[2], low[1]].map(at));
        assert!(is_of(correspondence(&mesh, &down).unwrap().sources(), [2, 3]));
        // Both face up: the nearer one.
        assert!(is_of(correspondence(&sheets(0.02, false), &up).unwrap().sources(), [2, 3]));
    }

    #[test]
    fn regions_and_texture_coordinates_distinguish_sheets() {
        let at = |[x, y]: [f64; 2]| [x, y, 0.018];
        let mut mesh = sheets(0.02, false);
        let mut part = triangle([[0.2, 0.2], [0.8, 0.3], [0.7, 0.7]].map(at));
        let faces = |mesh: &TriMesh, part: &TriMesh| -> Vec<u32> {
            let of = |s: &Source| match s {
                Source::Face { face, .. } => face.0,
                _ => panic!("{s:?}"),
            };
            correspondence(mesh, part).unwrap().sources().iter().map(of).collect()
        };
        assert!(faces(&mesh, &part).iter().all(|&f| f >= 2));
        let uv = |p: [f64; 3], shift: f32| [p[0] as f32 + shift, p[1] as f32];
        let view = mesh.positions().view();
        let uvs = view.iter().map(|p| uv(p, if p[2] > 0.01 { 4.0 } else { 0.0 })).collect();
        mesh.set_uvs(Some(uvs)).unwrap();
        let own = part.positions().view().iter().map(|p| uv(p, 0.0)).collect();
        part.set_uvs(Some(own)).unwrap();
        assert!(faces(&mesh, &part).iter().all(|&f| f < 2));
        mesh.set_uvs(None).unwrap();
        part.set_uvs(None).unwrap();
        mesh.set_regions(Some([1, 1, 2, 2].map(RegionId).to_vec())).unwrap();
        part.set_regions(Some(vec![RegionId(1)])).unwrap();
        assert!(faces(&mesh, &part).iter().all(|&f| f < 2));
    }

    #[test]
    fn on_a_seam_without_any_attribute_the_side_is_that_of_the_faces() {
        // Vertices 1 and 2 have two wedges each:
        //
        //   2|4 ── 5        0: wedges 0 1 2
        //    | \ 1 |        1: wedges 3 5 4
        //    | 0 \ |
        //    0 ── 1|3
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let vertex_of = [0, 1, 2, 1, 2, 3].map(VertexId).to_vec();
        let triangles = vec![[0, 1, 2].map(WedgeId), [3, 5, 4].map(WedgeId)];
        let mesh = TriMesh::with_wedges(Positions::F64(positions.clone()), vertex_of, triangles).unwrap();
        for (corners, wanted) in [([0, 1, 2], [0, 1, 2]), ([3, 2, 1], [5, 4, 3])] {
            let part = triangle(corners.map(|v: usize| positions[v]));
            let sources = correspondence(&mesh, &part).unwrap().into_sources();
            assert_eq!(sources, wanted.map(|w| Source::Wedge(WedgeId(w))));
        }
    }

    #[test]
    fn non_finite_positions_have_no_source_and_no_face_is_an_error() {
        let mesh = sheets(0.5, false);
        let invalid = triangle([[f64::NAN, 0.0, 0.0], [1e200, 0.0, 0.0], [0.25, 0.5, 0.1]]);
        let found = correspondence(&mesh, &invalid).unwrap();
        assert_eq!(found.sources()[..2], [Source::Nowhere; 2]);
        let heights: Vec<f32> = mesh.positions().view().iter().map(|p| p[0] as f32 + 1.0).collect();
        let carried = found.transfer(&heights, 1).unwrap();
        assert!(carried[0].is_nan() && carried[1].is_nan() && (carried[2] - 1.25).abs() < 1e-6);
        let wrong = MeshError::WrongLength { name: "values to transfer", got: 8, wanted: 16 };
        assert_eq!(found.transfer(&heights, 2), Err(wrong));
        assert_eq!(
            found.transfer_discrete(&['a'; 3]).unwrap_err().to_string(),
            "values to transfer: 3 entries, expected 8"
        );
        let names: Vec<usize> = (0..8).collect();
        let whole = found.transfer_discrete(&names).unwrap();
        assert!(whole[0].is_none() && whole[2].is_some());
        let broken = triangle([[f64::NAN; 3], [0.0; 3], [1.0; 3]]);
        assert_eq!(correspondence(&broken, &mesh), Err(MeasureError::Empty { which: "original" }));
    }

    #[test]
    fn weights_are_barycentric_also_on_soups() {
        let mesh = shapes::soup(400, 5);
        let other = shapes::soup(100, 9);
        let found = correspondence(&mesh, &other).unwrap();
        for source in found.sources() {
            match source {
                Source::Face { weights, .. } => {
                    assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{weights:?}");
                    assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{weights:?}");
                }
                Source::Wedge(_) => {}
                Source::Nowhere => panic!("soups are finite"),
            }
        }
        assert_eq!(found, correspondence(&mesh, &other).unwrap());
    }
}
