//! Correspondence of the two surfaces: parts, equal faces, and the cage.
//!
//! The correspondence of the vertices determines which parts of the detailed surface each part of the lighter surface
//! was made from. A sample never takes its values from any other part, unless that part has no counterpart at all (a
//! rivet that was removed). The cage has the directions of averaged normals, which have no gaps at sharp edges, and
//! reaches just far enough at each vertex to contain the detailed surface around it.

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::geometry::triangle::{double_area_normal, weights_at};
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{Correspondence, FaceId, Topology, TriMesh, VertexId, WedgeId, correspondence};
use rayon::prelude::*;

use crate::error::BakeError;
use crate::flat::Flat;
use crate::source::Source;

/// Direction and reach of the cage at a corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cage {
    /// Outwards, of unit length.
    pub(crate) direction: DVec3,
    pub(crate) outwards: f64,
    pub(crate) inwards: f64,
}

/// A face of the detailed surface that contains all corners of a face of the lighter surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SameFace {
    pub(crate) face: usize,
    /// Barycentric weights of each corner on that face.
    pub(crate) weights: [[f64; 3]; 3],
}

/// The connections between the two surfaces.
pub(crate) struct Link {
    /// The part of each face of the detailed surface.
    part_of: Vec<u32>,
    /// The part of each face of the lighter surface.
    light_part_of: Vec<u32>,
    /// For each part of the lighter surface, the parts of the detailed surface that it was made from,
    /// ascending.
    origins: Vec<Vec<u32>>,
    /// True for parts of the detailed surface that nothing was made from.
    is_orphan: Vec<bool>,
    pub(crate) same_faces: Vec<Option<SameFace>>,
    /// The cage at the corners of each face of the lighter surface.
    pub(crate) cages: Vec<[Cage; 3]>,
}

impl Link {
    /// Connects two surfaces. Texture coordinates and regions distinguish sides if both surfaces have the same ones.
    pub(crate) fn new(source: &Source<'_>, light: &Flat, is_same_model: bool) -> Result<Self, BakeError> {
        let strip = |mesh: &TriMesh| {
            let mut mesh = mesh.clone();
            if !is_same_model {
                mesh.set_uvs(None).expect("removing cannot fail");
                mesh.set_regions(None).expect("removing cannot fail");
            }
            mesh
        };
        let (detailed, lighter) = (strip(&source.flat.mesh), strip(&light.mesh));
        let known =
            correspondence(&detailed, &lighter).map_err(|_| BakeError::Empty { which: "detailed" })?;
        let part_of = parts(&source.flat);
        let light_part_of = parts(light);
        let origins = origins(&known, light, &part_of, &light_part_of);
        let count = part_of.iter().max().map_or(0, |m| *m as usize + 1);
        let mut is_orphan = vec![true; count];
        origins.iter().flatten().for_each(|&p| is_orphan[p as usize] = false);
        let same_faces = same_faces(&known, source, light);
        let mut link = Self { part_of, light_part_of, origins, is_orphan, same_faces, cages: Vec::new() };
        link.cages = link.cages(&known, source, light);
        Ok(link)
    }

    /// True if a face of the lighter surface may take values from a face of the detailed one.
    #[inline]
    pub(crate) fn may_take(&self, light_face: usize, face: usize) -> bool {
        let part = self.part_of[face];
        self.is_orphan[part as usize]
            || self.origins[self.light_part_of[light_face] as usize].binary_search(&part).is_ok()
    }

    fn cages(&self, known: &Correspondence<'_>, source: &Source<'_>, light: &Flat) -> Vec<[Cage; 3]> {
        let surface = light.mesh.surface();
        let welded = weld(surface.positions());
        let normals = vertex_normals(&surface, |v| welded.of(v));
        let directions: Vec<[DVec3; 3]> = (0..light.mesh.face_count())
            .map(|f| {
                let flat = double_area_normal(light.corners(f)).normalize_or_zero();
                surface.triangles()[f].map(|v| {
                    let mean = DVec3::from(normals[v.index()].map(f64::from));
                    // On thin sheets the mean of both sides may point along the sheet, or into it.
                    if flat != DVec3::ZERO && mean.dot(flat) < MIN_CAGE_COS { flat } else { mean }
                })
            })
            .collect();
        let diagonal = source.tree.bounds().map_or(1.0, |b| b.diagonal());
        let (min_reach, max_reach) = (MIN_REACH * diagonal, MAX_REACH * diagonal);
        let mut reach = vec![[min_reach; 2]; light.mesh.vertex_count()];
        let mut widen = |v: VertexId, height: f64| {
            let at = &mut reach[welded.of(v).index()][usize::from(height < 0.0)];
            *at = at.max(height.abs() * REACH_SLACK).min(max_reach);
        };
        // From the lighter surface: its own vertices.
        let view = source.flat.mesh.positions().view();
        for w in (0..light.mesh.wedge_count()).map(WedgeId::new) {
            let Some(blend) = known.blend(w) else { continue };
            let place = |w: WedgeId| DVec3::from(view.get(source.flat.mesh.vertex_of(w)));
            let there: DVec3 = blend.iter().map(|(w, weight)| place(*w) * f64::from(*weight)).sum();
            let v = light.mesh.vertex_of(w);
            let here = DVec3::from(surface.positions().get(v));
            let height = (there - here).length();
            // The sign is unknown: both sides are widened.
            widen(v, height);
            widen(v, -height);
        }
        // And from the detailed surface.
        for (face, height) in self.heights(source, light, &directions).into_iter().flatten() {
            surface.triangles()[face as usize].iter().for_each(|v| widen(*v, height));
        }
        let cage = |f: usize, k: usize| {
            let [outwards, inwards] = reach[welded.of(surface.triangles()[f][k]).index()];
            Cage { direction: directions[f][k], outwards, inwards }
        };
        (0..light.mesh.face_count()).map(|f| [0, 1, 2].map(|k| cage(f, k))).collect()
    }

    /// Returns, for the centre and the vertices of each face of the detailed surface, the nearest face of the lighter
    /// surface that may take values from it, with the distance along the cage direction there.
    fn heights(
        &self,
        source: &Source<'_>,
        light: &Flat,
        directions: &[[DVec3; 3]],
    ) -> Vec<Option<(u32, f64)>> {
        let tree = Bvh::new(&light.mesh.surface());
        let mut is_seen = vec![false; source.flat.mesh.vertex_count()];
        let mut points: Vec<(u32, DVec3)> = Vec::new();
        for (f, wedges) in source.flat.mesh.triangles().iter().enumerate() {
            let corners = source.flat.corners(f);
            points.push((f as u32, corners.iter().sum::<DVec3>() / 3.0));
            for (w, p) in wedges.iter().zip(corners) {
                if !std::mem::replace(&mut is_seen[source.flat.mesh.vertex_of(*w).index()], true) {
                    points.push((f as u32, p));
                }
            }
        }
        let of_chunk = |chunk: &[(u32, DVec3)]| {
            let mut hint = Hint::default();
            let height = |&(face, p): &(u32, DVec3)| {
                let hit = tree.closest_from(p.to_array(), &mut hint)?;
                let (f, corners) = (hit.face.index(), light.corners(hit.face.index()));
                let normal = source.face_normal(face as usize);
                let weights = weights_at(DVec3::from(hit.point), corners);
                let direction = (0..3).map(|k| directions[f][k] * weights[k]).sum::<DVec3>();
                let fits = self.may_take(f, face as usize) && normal.dot(direction) > 0.0;
                let height = (p - DVec3::from(hit.point)).dot(direction.normalize_or_zero());
                fits.then_some((f as u32, height.signum() * hit.distance))
            };
            chunk.iter().map(height).collect::<Vec<_>>()
        };
        points.par_chunks(CHUNK_LENGTH).map(of_chunk).collect::<Vec<_>>().concat()
    }
}

/// Items per task.
const CHUNK_LENGTH: usize = 4096;
/// The direction of the cage is at least this cosine from the normal of the face: 84°. (Guessed.)
const MIN_CAGE_COS: f64 = 0.1;
/// Smallest and largest reach of the cage, as fractions of the diagonal. (Guessed: a lighter mesh that is farther away
/// is another model.)
const MIN_REACH: f64 = 5e-4;
const MAX_REACH: f64 = 0.1;
/// Factor on the reach: the cage interpolates, and heights are measured at vertices and centres only. (Guessed.)
const REACH_SLACK: f64 = 1.5;

/// Returns the connected part of each face; faces without area belong to the first part.
fn parts(flat: &Flat) -> Vec<u32> {
    let components = Topology::new(&flat.mesh.surface()).components();
    (0..flat.mesh.face_count()).map(|f| components.of_face(FaceId::new(f)).unwrap_or(0) as u32).collect()
}

/// A part is an origin of another if at least this share of the vertices comes from it. (Guessed: a few vertices of a
/// part that touches another may seem to come from the other.)
const MIN_ORIGIN_SHARE: f64 = 0.05;

/// Returns for each part of the lighter surface the parts of the detailed surface that it was made from.
fn origins(
    known: &Correspondence<'_>,
    light: &Flat,
    part_of: &[u32],
    light_part_of: &[u32],
) -> Vec<Vec<u32>> {
    let mut wedge_part = HashMap::new();
    for (f, wedges) in known.original().triangles().iter().enumerate() {
        wedges.iter().for_each(|w| {
            wedge_part.entry(*w).or_insert(part_of[f]);
        });
    }
    let part_count = |parts: &[u32]| parts.iter().max().map_or(0, |m| *m as usize + 1);
    let mut votes: Vec<HashMap<u32, usize>> = vec![HashMap::new(); part_count(light_part_of)];
    // The part of the lighter surface with most votes for a part of the detailed one.
    let mut best_light_part: Vec<(usize, u32)> = vec![(0, u32::MAX); part_count(part_of)];
    for (f, wedges) in light.mesh.triangles().iter().enumerate() {
        for w in wedges {
            let Some(blend) = known.blend(*w) else { continue };
            let heaviest = blend.iter().fold(blend[0], |a, b| if b.1 > a.1 { *b } else { a });
            let Some(&part) = wedge_part.get(&heaviest.0) else { continue };
            let count = votes[light_part_of[f] as usize].entry(part).or_default();
            *count += 1;
            let best = &mut best_light_part[part as usize];
            if *count > best.0 {
                *best = (*count, light_part_of[f]);
            }
        }
    }
    let of_part = |(light_part, votes): (usize, &HashMap<u32, usize>)| {
        let least = votes.values().sum::<usize>() as f64 * MIN_ORIGIN_SHARE;
        let is_origin = |part: u32, count: usize| {
            count as f64 >= least || best_light_part[part as usize].1 == light_part as u32
        };
        let mut all: Vec<u32> = votes.iter().filter(|(p, n)| is_origin(**p, **n)).map(|(p, _)| *p).collect();
        all.sort_unstable();
        all
    };
    votes.iter().enumerate().map(of_part).collect()
}

/// Finds the faces of the lighter surface whose corners all lie on one face of the detailed surface.
fn same_faces(known: &Correspondence<'_>, source: &Source<'_>, light: &Flat) -> Vec<Option<SameFace>> {
    let detailed = &source.flat.mesh;
    let corners = |t: [WedgeId; 3]| {
        let mut t = t.map(|w| detailed.vertex_of(w).0);
        t.sort_unstable();
        t
    };
    let mut by_corners = HashMap::new();
    for (f, t) in detailed.triangles().iter().enumerate() {
        by_corners.entry(corners(*t)).or_insert(f);
    }
    let find = |wedges: &[WedgeId; 3]| {
        let blends = [known.blend(wedges[0])?, known.blend(wedges[1])?, known.blend(wedges[2])?];
        let inner = blends.iter().find(|b| b[1].1 > 0.0 || b[0].0 != b[1].0);
        let face = match inner {
            Some(b) => *by_corners.get(&corners(b.map(|x| x.0)))?,
            None => *by_corners.get(&corners(blends.map(|b| b[0].0)))?,
        };
        let own = detailed.triangles()[face].map(|w| detailed.vertex_of(w));
        let mut weights = [[0.0; 3]; 3];
        for (all, blend) in weights.iter_mut().zip(&blends) {
            for (w, weight) in blend.iter().filter(|x| x.1 > 0.0) {
                let k = own.iter().position(|v| *v == detailed.vertex_of(*w))?;
                all[k] += f64::from(*weight);
            }
        }
        Some(SameFace { face, weights })
    };
    light.mesh.triangles().iter().map(find).collect()
}
