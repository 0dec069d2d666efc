//! Flat shading: parts whose corners have the normals of their faces. Every edge is a seam of normals there,
//! so the seams that matter, such as seams of colours, are lost among them. A run leaves these normals out,
//! and the result gets the normals of its own faces.
//!
//! During the run the normals are zero, which blending and fitting keep.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use lodsmith_core::disjoint_sets::DisjointSets;
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::sorted::{indices_by_key, key_of};
use lodsmith_core::{Attribute, MeshError, TriMesh, VertexId, WedgeId};

use crate::constraints::HeldWedges;
use crate::input::Input;
use crate::options::{Placement, SimplifyOptions};

/// A part is flat if this share of its corners, by number and by area, has the normals of their faces. Only
/// corners at which the surface bends count. (Guessed: a hundredth is left for triangles that an exporter has
/// repaired.)
const FLAT_SHARE: f64 = 0.99;
/// Smallest distance between the normal of a face and the mean normal at its corner, both of length one, at
/// which the surface counts as bent there: half a degree, above the rounding of normals with one byte per
/// coordinate.
const MIN_BEND: f32 = 0.01;
/// A corner is flat if its normal differs from its face's normal by less than this share of the bend. (At 1
/// it has the mean normal.)
const FLAT_BEND_SHARE: f32 = 0.25;
/// Cosine of the largest angle between faces that share a normal at a vertex: half a degree. (Guessed: it cannot be
/// seen, and saves vertices on flat sides.)
const ALIKE_COS: f32 = 0.999_96;

/// A mesh without the normals of its flat parts.
pub(crate) struct FlatShading {
    /// The mesh; the normals of its flat parts are zero.
    pub(crate) mesh: TriMesh,
    /// True for the regions that have faces of flat parts; without regions all faces are in region 0.
    has_flat: Vec<bool>,
}

impl FlatShading {
    /// Finds the flat parts of an input; `None` if there are none, or if the result may only have attributes
    /// of the input. Cost: O(n).
    pub(crate) fn of(input: &Input<'_>, options: &SimplifyOptions) -> Option<Self> {
        if options.placement == Placement::Endpoint || options.quick.is_some() {
            return None;
        }
        let mesh = input.mesh?;
        let parts = FlatParts::of(mesh)?;
        let mut normals = mesh.normals()?.to_vec();
        let regions = mesh.regions();
        let mut has_flat = Vec::new();
        for (f, t) in mesh.triangles().iter().enumerate().filter(|(_, t)| parts.has(mesh, t)) {
            let region = regions.map_or(0, |r| r[f].index());
            if has_flat.len() <= region {
                has_flat.resize(region + 1, false);
            }
            has_flat[region] = true;
            t.iter().for_each(|w| normals[w.index()] = [0.0; 3]);
        }
        let mut mesh = mesh.clone();
        mesh.set_normals(Some(normals)).ok()?;
        Some(Self { mesh, has_flat })
    }

    /// Gives the faces of flat parts of a result their own normals. Corners of locked vertices, which are
    /// listed in `held`, keep the normals of the `input`. Faces and vertices keep their numbers. Cost: O(n).
    pub(crate) fn with_normals(
        &self,
        mesh: &TriMesh,
        held: &HeldWedges,
        input: &TriMesh,
    ) -> Result<TriMesh, MeshError> {
        let Some(normals) = mesh.normals() else { return Ok(mesh.clone()) };
        let view = mesh.positions().view();
        let faces: Vec<DVec3> = mesh
            .triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|w| DVec3::from(view.get(mesh.vertex_of(w))));
                (b - a).cross(c - a)
            })
            .collect();
        let is_flat = |f: usize, w: WedgeId| {
            let region = mesh.regions().map_or(0, |r| r[f].index());
            normals[w.index()] == [0.0; 3] && self.has_flat.get(region) == Some(&true)
        };
        let mut corners: Vec<(VertexId, usize, usize)> = Vec::new();
        for (f, t) in mesh.triangles().iter().enumerate() {
            let flat = t.iter().enumerate().filter(|(_, w)| is_flat(f, **w));
            corners.extend(flat.map(|(k, w)| (mesh.vertex_of(*w), f, k)));
        }
        // At a vertex, the largest of several faces with similar normals gives all of them its normal.
        let by_area = indices_by_key(corners.iter().map(|c| !key_of(faces[c.1].length_squared())));
        let by_vertex = indices_by_key(by_area.iter().map(|&i| u64::from(corners[i].0.0)));
        let corners: Vec<_> = by_vertex.into_iter().map(|i| corners[by_area[i]]).collect();
        let mut own: Vec<[Option<Vec3>; 3]> = vec![[None; 3]; mesh.face_count()];
        let given = input.normals().unwrap_or_default();
        for vertex in corners.chunk_by(|a, b| a.0 == b.0) {
            let mut known: Vec<Vec3> = Vec::new();
            for &(_, f, k) in vertex {
                let normal = faces[f].normalize_or_zero().as_vec3();
                let kept = held.at(f, k).and_then(|w| given.get(w.index()));
                own[f][k] = Some(match (kept, known.iter().find(|n| n.dot(normal) > ALIKE_COS)) {
                    (Some(kept), _) => Vec3::from(*kept),
                    (None, Some(known)) => *known,
                    (None, None) => {
                        // (A fan would take quadratic time otherwise.)
                        if known.len() < MAX_NORMALS {
                            known.push(normal);
                        }
                        normal
                    }
                });
            }
        }
        split(mesh, &own)
    }
}

/// Number of normals of a vertex that further faces may share. (Guessed: more than any vertex has, except the
/// centre of a fan.)
const MAX_NORMALS: usize = 32;

/// Returns the mesh with other normals at some corners; corners of one wedge with different normals become wedges of
/// their own.
fn split(mesh: &TriMesh, own: &[[Option<Vec3>; 3]]) -> Result<TriMesh, MeshError> {
    let normals = mesh.normals().unwrap_or_default();
    let mut numbers: BTreeMap<(WedgeId, [u32; 3]), WedgeId> = BTreeMap::new();
    let mut source: Vec<(WedgeId, [f32; 3])> = Vec::new();
    let mut triangles = Vec::with_capacity(mesh.face_count());
    for (t, own) in mesh.triangles().iter().zip(own) {
        triangles.push([0, 1, 2].map(|k| {
            let normal = own[k].map_or(normals[t[k].index()], |n| n.to_array());
            *numbers.entry((t[k], normal.map(f32::to_bits))).or_insert_with(|| {
                source.push((t[k], normal));
                WedgeId::new(source.len() - 1)
            })
        }));
    }
    let vertex_of = source.iter().map(|(w, _)| mesh.vertex_of(*w)).collect();
    let mut new = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles)?;
    let old = || source.iter().map(|(w, _)| w.index());
    new.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    new.set_normals(Some(source.iter().map(|(_, n)| *n).collect()))?;
    new.set_uvs(mesh.uvs().map(|t| old().map(|w| t[w]).collect()))?;
    new.set_colors(mesh.colors().map(|c| old().map(|w| c[w]).collect()))?;
    for a in mesh.further_attributes() {
        let values = source.iter().flat_map(|(w, _)| a.of(*w)).copied().collect();
        new.add_attribute(Attribute { values, ..a.clone() })?;
    }
    Ok(new)
}

/// The connected parts of a mesh that are shaded flat.
struct FlatParts {
    /// The part of each vertex: its first vertex.
    part: Vec<u32>,
    is_flat: Vec<bool>,
}

/// Faces of a part.
#[derive(Clone, Copy, Default)]
struct PartShading {
    faces: usize,
    /// Faces with the same normal at their corners.
    alike: usize,
    /// Number and area of the corners at which the surface bends, and of the flat ones among them.
    bent: [f64; 2],
    flat: [f64; 2],
}

impl PartShading {
    fn may_be_flat(&self) -> bool {
        self.alike as f64 >= FLAT_SHARE * self.faces as f64
    }
    fn is_flat(&self) -> bool {
        self.bent[0] > 0.0 && (0..2).all(|i| self.flat[i] >= FLAT_SHARE * self.bent[i])
    }
}

impl FlatParts {
    /// Returns `None` if no part is flat.
    fn of(mesh: &TriMesh) -> Option<Self> {
        let normals = mesh.normals()?;
        let is_alike = |t: &[WedgeId; 3]| {
            let [a, b, c] = t.map(|w| Vec3::from(normals[w.index()]));
            let is_near = |b: Vec3| a.dot(b) > ALIKE_COS * a.length() * b.length();
            is_near(b) && is_near(c)
        };
        // On a smooth surface hardly any face has the same normal at all its corners.
        if !mesh.triangles().iter().any(is_alike) {
            return None;
        }
        let surface = mesh.surface();
        let same = weld(surface.positions());
        let mut sets = DisjointSets::new(mesh.vertex_count());
        for t in surface.triangles() {
            let [a, b, c] = t.map(|v| same.of(v).0);
            sets.join(a, b);
            sets.join(a, c);
        }
        let roots = sets.into_representatives();
        let part: Vec<u32> =
            (0..mesh.vertex_count()).map(|v| roots[same.of(VertexId::new(v)).index()]).collect();
        let mut shading = vec![PartShading::default(); mesh.vertex_count()];
        let of_face = |t: &[WedgeId; 3]| part[mesh.vertex_of(t[0]).index()] as usize;
        for t in mesh.triangles() {
            let own = &mut shading[of_face(t)];
            own.faces += 1;
            own.alike += usize::from(is_alike(t));
        }
        if !shading.iter().any(|own| own.faces > 0 && own.may_be_flat()) {
            return None;
        }
        let smooth = vertex_normals(&surface, |v| same.of(v));
        let view = surface.positions();
        for t in mesh.triangles() {
            let own = &mut shading[of_face(t)];
            if !own.may_be_flat() {
                continue;
            }
            let [a, b, c] = t.map(|w| DVec3::from(view.get(mesh.vertex_of(w))));
            let doubled = (b - a).cross(c - a);
            let (area, face) = (doubled.length(), doubled.normalize_or_zero().as_vec3());
            for w in t {
                let bend = face.distance(Vec3::from(smooth[mesh.vertex_of(*w).index()]));
                if area == 0.0 || bend.is_nan() || bend <= MIN_BEND {
                    continue;
                }
                let normal = Vec3::from(normals[w.index()]).normalize_or_zero();
                let is_flat = f64::from(u8::from(normal.distance(face) <= FLAT_BEND_SHARE * bend));
                for (i, weight) in [1.0, area].into_iter().enumerate() {
                    own.bent[i] += weight;
                    own.flat[i] += weight * is_flat;
                }
            }
        }
        let is_flat: Vec<bool> = shading.iter().map(|own| own.may_be_flat() && own.is_flat()).collect();
        is_flat.contains(&true).then_some(Self { part, is_flat })
    }

    fn has(&self, mesh: &TriMesh, t: &[WedgeId; 3]) -> bool {
        self.is_flat[self.part[mesh.vertex_of(t[0]).index()] as usize]
    }
}
