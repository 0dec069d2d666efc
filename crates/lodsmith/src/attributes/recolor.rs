//! Repair of texture coordinates that moved to another colour, from the input.
//!
//! In a palette texture a whole part uses one small cell of the image. Blended and extrapolated texture
//! coordinates leave it, and a face shows the neighbouring cells: patches and stripes of unrelated colours.
//! The colour of a face is compared with the colour of the input under it, at a few points; where they
//! differ, the face takes texture coordinates of the input from the points that give the smallest difference
//! in colour.
//!
//! Textures that vary within single faces anyway (photographs, drawings) are not repaired.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4};
use lodsmith_core::geometry::triangle::{double_area_normal, weights_at};
use lodsmith_core::spatial::Bvh;
use lodsmith_core::{Attribute, FaceId, MeshError, Positions, RegionId, TriMesh, VertexId, WedgeId};

use crate::attributes::textures::{Texture, Textures};
use crate::chunks::each;
use crate::constraints::HeldWedges;
use crate::input::Input;

/// Barycentric sample points of a face: the centre, near the corners, in between, near the edges.
const SAMPLE_POINTS: [[f32; 3]; 10] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.96, 0.02, 0.02],
    [0.02, 0.96, 0.02],
    [0.02, 0.02, 0.96],
    [0.64, 0.18, 0.18],
    [0.18, 0.64, 0.18],
    [0.18, 0.18, 0.64],
    [0.48, 0.48, 0.04],
    [0.04, 0.48, 0.48],
    [0.48, 0.04, 0.48],
];
/// Difference in one channel, of 255, above which two colours count as different. (Guessed: neighbours in
/// palettes differ by more, shades of one colour within a face by less.)
const COLOR_THRESHOLD: i32 = 40;
/// An image is no palette if more than this share of the textured input area is in faces that show several
/// colours. (Measured: .00 to .16 on seven assets with palettes or large patches of one colour, .47 to 1 on
/// painted ones.)
const MAX_MIXED_SHARE: f64 = 0.25;
/// Texture coordinates are replaced if less than this fraction of the squared difference remains. (Guessed:
/// coordinates consistent with their neighbours should stay unless there is a good reason.)
const IMPROVEMENT_RATIO: [i64; 2] = [3, 4];
/// Cosine below which a face of the input faces away from a face of the result: it belongs to another sheet.
const MIN_FACING_COS: f64 = -0.2;
/// Faces that a thread processes at a time. (Guessed: a lookup takes microseconds.)
const CHUNK_FACES: usize = 256;

type Color = [u8; 4];

/// The component of each vertex of the input and of the result; `None` if its position is unknown.
pub(crate) struct OwnParts {
    pub(crate) of_input: Vec<Option<u32>>,
    pub(crate) of_result: Vec<Option<u32>>,
}

/// Repairs the colours of a result, if the mesh has textures.
pub(crate) fn recolored(
    mesh: TriMesh,
    input: &Input<'_>,
    held: &HeldWedges,
    parts: Option<&OwnParts>,
) -> Result<TriMesh, MeshError> {
    match (input.data.textures, input.mesh) {
        (Some(textures), Some(source)) => repair(mesh, source, textures, held, parts),
        _ => Ok(mesh),
    }
}

/// Replaces texture coordinates of the result so that their colours match the source as far as possible. Held
/// corners are kept. Cost: O(faces of the source) to detect palettes; if there is one, a lookup per face of
/// the result and ten per face that differs, distributed over the caller's thread pool.
fn repair(
    mesh: TriMesh,
    source: &TriMesh,
    textures: &Textures,
    held: &HeldWedges,
    parts: Option<&OwnParts>,
) -> Result<TriMesh, MeshError> {
    let (Some(uvs), Some(source_uvs)) = (mesh.uvs(), source.uvs()) else { return Ok(mesh) };
    let palettes = palettes(source, source_uvs, textures);
    if palettes.iter().all(Option::is_none) {
        return Ok(mesh);
    }
    let original = ColorSource { tree: Bvh::new(&source.surface()), mesh: source, uvs: source_uvs, parts };
    let corners_of = |f: usize| mesh.triangles()[f].map(|w| uvs[w.index()]);
    let better_of = |f: usize| {
        let region = mesh.regions().map(|r| r[f]);
        let texture = palettes.get(region.unwrap_or_default().index())?.as_ref()?;
        Some((f, original.recolored(&mesh, f, region, corners_of(f), texture)?))
    };
    let found: Vec<Vec<_>> = each(mesh.face_count().div_ceil(CHUNK_FACES), |i| {
        let chunk = i * CHUNK_FACES..((i + 1) * CHUNK_FACES).min(mesh.face_count());
        chunk.filter_map(better_of).collect()
    });
    let mut changes: HashMap<(usize, usize), [f32; 2]> = HashMap::new();
    for (f, better) in found.into_iter().flatten() {
        let corners = corners_of(f);
        for k in (0..3).filter(|&k| better[k] != corners[k] && held.at(f, k).is_none()) {
            changes.insert((f, k), better[k]);
        }
    }
    if changes.is_empty() { Ok(mesh) } else { with_uvs(&mesh, &changes) }
}

/// Returns the textures of the regions that are palettes: almost all of their faces show a single colour.
fn palettes<'a>(source: &TriMesh, uvs: &[[f32; 2]], textures: &'a Textures) -> Vec<Option<&'a Texture>> {
    let count = source.regions().map_or(1, |r| r.iter().map(|r| r.index() + 1).max().unwrap_or(0));
    let of: Vec<_> = (0..count).map(|r| textures.of(Some(RegionId::new(r)))).collect();
    // Area of all faces, and of those with several colours.
    let mut areas = vec![[0f64; 2]; count];
    let view = source.positions().view();
    for (f, t) in source.triangles().iter().enumerate() {
        let region = source.regions().map_or(0, |r| r[f].index());
        let Some(texture) = of[region] else { continue };
        let area = double_area_normal(t.map(|w| DVec3::from(view.get(source.vertex_of(w))))).length();
        if area.is_finite() {
            let several = shows_several(texture, t.map(|w| uvs[w.index()]));
            areas[region][0] += area;
            areas[region][1] += if several { area } else { 0.0 };
        }
    }
    let is_palette = |[all, several]: [f64; 2]| all > 0.0 && several <= MAX_MIXED_SHARE * all;
    of.into_iter().zip(areas).map(|(texture, areas)| texture.filter(|_| is_palette(areas))).collect()
}

/// Returns the mean colour of each component, as far as its faces have textures. Cost: O(n).
pub(crate) fn mean_colors(
    mesh: &TriMesh,
    textures: &Textures,
    part_of_face: impl Fn(usize) -> Option<usize>,
    parts: usize,
) -> Vec<Option<Vec3>> {
    let mut sums = vec![Vec4::ZERO; parts];
    let (Some(uvs), view) = (mesh.uvs(), mesh.positions().view()) else { return vec![None; parts] };
    for (f, t) in mesh.triangles().iter().enumerate() {
        let texture = textures.of(mesh.regions().map(|r| r[f]));
        let color = texture
            .and_then(|texture| texture.color(interpolate(t.map(|w| uvs[w.index()]), SAMPLE_POINTS[0])));
        let sum = part_of_face(f).and_then(|part| sums.get_mut(part));
        if let (Some([r, g, b, _]), Some(sum)) = (color, sum) {
            let area =
                double_area_normal(t.map(|w| DVec3::from(view.get(mesh.vertex_of(w))))).length() as f32;
            *sum += Vec3::from([r, g, b].map(f32::from)).extend(1.0) * area;
        }
    }
    let mean = |sum: Vec4| Some(sum.truncate() / sum.w).filter(|mean| mean.is_finite());
    sums.into_iter().map(mean).collect()
}

fn shows_several(texture: &Texture, corners: [[f32; 2]; 3]) -> bool {
    let first = texture.color(interpolate(corners, SAMPLE_POINTS[0]));
    SAMPLE_POINTS[1..].iter().any(|b| match (first, texture.color(interpolate(corners, *b))) {
        (Some(a), Some(b)) => are_apart(a, b),
        _ => false,
    })
}

fn interpolate(corners: [[f32; 2]; 3], b: [f32; 3]) -> [f32; 2] {
    let at = corners.map(Vec2::from);
    (at[0] * b[0] + at[1] * b[1] + at[2] * b[2]).to_array()
}

fn are_apart(a: Color, b: Color) -> bool {
    (0..3).any(|i| (i32::from(a[i]) - i32::from(b[i])).abs() > COLOR_THRESHOLD)
}

fn squared_difference(a: Color, b: Color) -> i64 {
    (0..3).map(|i| (i64::from(a[i]) - i64::from(b[i])).pow(2)).sum()
}

/// The input, for queries of its texture coordinates.
struct ColorSource<'a> {
    tree: Bvh,
    mesh: &'a TriMesh,
    uvs: &'a [[f32; 2]],
    parts: Option<&'a OwnParts>,
}

impl ColorSource<'_> {
    /// Returns the texture coordinates of the input nearest to a position, on a face with similar orientation
    /// and the same region and component.
    fn nearest_uv(
        &self,
        place: DVec3,
        normal: DVec3,
        region: Option<RegionId>,
        part: Option<u32>,
    ) -> Option<[f32; 2]> {
        // No face has a similar orientation to a face without a normal.
        if normal == DVec3::ZERO || normal.is_nan() {
            return None;
        }
        let view = self.mesh.positions().view();
        let corners = |f: FaceId| {
            self.mesh.triangles()[f.index()].map(|w| DVec3::from(view.get(self.mesh.vertex_of(w))))
        };
        let is_ours = |f: FaceId| self.mesh.regions().map(|r| r[f.index()]) == region;
        let faces_us = |f: FaceId| {
            let own = double_area_normal(corners(f));
            own.dot(normal) > MIN_FACING_COS * own.length() * normal.length()
        };
        let is_of_part = |f: FaceId| {
            let first = self.mesh.vertex_of(self.mesh.triangles()[f.index()][0]);
            part.is_none() || self.parts.is_none_or(|parts| parts.of_input[first.index()] == part)
        };
        let hit = self.tree.closest_of(place.to_array(), |f| is_ours(f) && is_of_part(f) && faces_us(f))?;
        let weights = weights_at(DVec3::from(hit.point), corners(hit.face)).map(|x| x as f32);
        let uvs = self.mesh.triangles()[hit.face.index()].map(|w| self.uvs[w.index()]);
        let at = interpolate(uvs, weights);
        at.iter().all(|x| x.is_finite()).then_some(at)
    }

    /// Returns better texture coordinates for the corners of a face of the result, if there are any.
    fn recolored(
        &self,
        mesh: &TriMesh,
        f: usize,
        region: Option<RegionId>,
        corners: [[f32; 2]; 3],
        texture: &Texture,
    ) -> Option<[[f32; 2]; 3]> {
        let view = mesh.positions().view();
        let places = mesh.triangles()[f].map(|w| DVec3::from(view.get(mesh.vertex_of(w))));
        let normal = double_area_normal(places);
        let first = mesh.vertex_of(mesh.triangles()[f][0]);
        let part = self.parts.and_then(|parts| parts.of_result[first.index()]);
        let color_at = |b: [f32; 3]| {
            let [x, y, z] = b.map(f64::from);
            let place = places[0] * x + places[1] * y + places[2] * z;
            let uv = self.nearest_uv(place, normal, region, part)?;
            Some((uv, texture.color(uv)?))
        };
        // Most faces show a single colour, which is correct.
        let middle = color_at(SAMPLE_POINTS[0])?;
        let own = texture.color(interpolate(corners, SAMPLE_POINTS[0]))?;
        if !are_apart(own, middle.1) && !shows_several(texture, corners) {
            return None;
        }
        let mut seen = [middle; SAMPLE_POINTS.len()];
        for (seen, b) in seen.iter_mut().zip(SAMPLE_POINTS).skip(1) {
            *seen = color_at(b)?;
        }
        let difference = |corners: [[f32; 2]; 3]| -> Option<i64> {
            let each = |(b, (_, there)): (&[f32; 3], &([f32; 2], Color))| {
                Some(squared_difference(texture.color(interpolate(corners, *b))?, *there))
            };
            SAMPLE_POINTS.iter().zip(&seen).map(each).sum()
        };
        let given = difference(corners)?;
        let mut best = (given, corners);
        for (at, color) in seen {
            // For each corner, the nearest sample of about this colour, or only this sample.
            let nearest = [0, 1, 2].map(|k| {
                let like = (0..SAMPLE_POINTS.len()).filter(|&i| !are_apart(seen[i].1, color));
                like.max_by(|&i, &j| SAMPLE_POINTS[i][k].total_cmp(&SAMPLE_POINTS[j][k]).then(j.cmp(&i)))
                    .map_or(at, |i| seen[i].0)
            });
            for candidate in [nearest, [at; 3]] {
                if let Some(left) = difference(candidate).filter(|left| *left < best.0) {
                    best = (left, candidate);
                }
            }
        }
        (best.0 * IMPROVEMENT_RATIO[1] < given * IMPROVEMENT_RATIO[0]).then_some(best.1)
    }
}

/// Returns the mesh with other texture coordinates at some corners, given by face and corner index.
fn with_uvs(mesh: &TriMesh, changes: &HashMap<(usize, usize), [f32; 2]>) -> Result<TriMesh, MeshError> {
    let uvs = mesh.uvs().unwrap_or_default();
    // Each corner by its vertex, its wedge and the bits of its texture coordinates: equal ones share a wedge.
    let key = |f: usize, k: usize| {
        let w = mesh.triangles()[f][k];
        let uv = changes.get(&(f, k)).copied().unwrap_or(uvs[w.index()]);
        (mesh.vertex_of(w), w, uv.map(f32::to_bits))
    };
    let corners = || (0..mesh.face_count()).flat_map(|f| [(f, 0), (f, 1), (f, 2)]);
    let mut keys: Vec<(VertexId, WedgeId, [u32; 2])> = corners().map(|(f, k)| key(f, k)).collect();
    keys.sort_unstable();
    keys.dedup();
    let number = |f: usize, k: usize| WedgeId::new(keys.binary_search(&key(f, k)).unwrap_or_default());
    let triangles = (0..mesh.face_count()).map(|f| [0, 1, 2].map(|k| number(f, k))).collect();
    let positions: Positions = mesh.positions().clone();
    let mut new = TriMesh::with_wedges(positions, keys.iter().map(|x| x.0).collect(), triangles)?;
    let old = || keys.iter().map(|x| x.1.index());
    new.set_regions(mesh.regions().map(<[_]>::to_vec))?;
    new.set_normals(mesh.normals().map(|n| old().map(|w| n[w]).collect()))?;
    new.set_uvs(Some(keys.iter().map(|x| x.2.map(f32::from_bits)).collect()))?;
    new.set_colors(mesh.colors().map(|c| old().map(|w| c[w]).collect()))?;
    for a in mesh.further_attributes() {
        let values = keys.iter().flat_map(|x| a.of(x.1)).copied().collect();
        new.add_attribute(Attribute { values, ..a.clone() })?;
    }
    Ok(new)
}
