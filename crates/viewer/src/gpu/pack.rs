//! Conversion of a mesh to GPU buffers: positions with normals, attribute rows, and indices sorted by region.

use std::borrow::Cow;

use glam::{DVec3, Vec2, Vec3};
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::mesh::creases::split_at_creases;
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::mesh::weld::weld;
use lodsmith_core::{Attribute, Morphed, RegionId, Semantic, TriMesh, VertexId, WedgeId};
use rayon::prelude::*;

/// Layout of a wedge's attribute row: offsets in words, `NONE` for attributes that the mesh does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AttributeLayout {
    pub(super) stride: u32,
    pub(super) uv: [u32; 2],
    pub(super) color: u32,
    pub(super) tangent: u32,
    pub(super) joints: u32,
    /// Number of sets of four joints (two words) and four weights (four words), stored consecutively from
    /// `joints`.
    pub(super) joint_sets: u32,
}

pub(super) const NO_OFFSET: u32 = u32::MAX;
/// Words taken by four joints and their weights.
const JOINT_SET_WORDS: u32 = 6;

impl AttributeLayout {
    pub(super) fn of(mesh: &TriMesh) -> Self {
        let mut stride = 0;
        let mut take = |there: bool, words: u32| {
            let at = stride;
            stride += if there { words } else { 0 };
            if there { at } else { NO_OFFSET }
        };
        let uv =
            [take(mesh.uvs().is_some(), 2), take(further_attribute(mesh, &Semantic::Uv(1)).is_some(), 2)];
        let color = take(mesh.colors().is_some(), 1);
        let tangent = take(further_attribute(mesh, &Semantic::Tangent).is_some(), 2);
        let joint_sets = (0..=u8::MAX).take_while(|&set| joint_set(mesh, set).is_some()).count() as u32;
        let joints = take(joint_sets > 0, JOINT_SET_WORDS * joint_sets);
        Self { stride, uv, color, tangent, joints, joint_sets }
    }
}

fn further_attribute<'a>(mesh: &'a TriMesh, semantic: &Semantic) -> Option<&'a Attribute> {
    mesh.further_attributes().iter().find(|a| a.semantic == *semantic)
}

fn joint_set(mesh: &TriMesh, set: u8) -> Option<[&Attribute; 2]> {
    let joints = further_attribute(mesh, &Semantic::Joints(set)).filter(|a| a.width == 4)?;
    let weights = further_attribute(mesh, &Semantic::Weights(set)).filter(|a| a.width == 4)?;
    Some([joints, weights])
}

/// Position of a wedge in the unit frame, and its octahedral normal of two 16-bit numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Corner {
    pub(super) position: [f32; 3],
    pub(super) normal: u32,
}

/// Returns the unit frame of a mesh.
pub(super) fn frame_of(mesh: &TriMesh) -> UnitFrame {
    let nowhere = lodsmith_core::Bounds { min: [0.0; 3], max: [0.0; 3] };
    UnitFrame::of(&mesh.positions().view().bounds().unwrap_or(nowhere))
}

/// A mesh as it is drawn.
pub(super) struct ShadedMesh<'a> {
    pub(super) mesh: Cow<'a, TriMesh>,
    /// The normal of each wedge.
    pub(super) normals: Cow<'a, [[f32; 3]]>,
    /// The originals of the wedges behind those of the mesh.
    pub(super) copies: Vec<WedgeId>,
}

/// Returns a mesh with normals for all wedges: its own, or else normals computed from its faces, which break at edges
/// above an angle in degrees. Quick ones are those of [`quick_normals`] where none break.
pub(super) fn shaded(mesh: &TriMesh, crease_deg: Option<f64>, is_quick: bool) -> ShadedMesh<'_> {
    if let Some(angle) = crease_deg.filter(|_| mesh.normals().is_none())
        && let Ok(split) = split_at_creases(mesh, angle)
    {
        return ShadedMesh {
            mesh: Cow::Owned(split.mesh),
            normals: split.normals.into(),
            copies: split.copies,
        };
    }
    let normals = if is_quick { quick_normals(mesh) } else { normals(mesh) };
    ShadedMesh { mesh: Cow::Borrowed(mesh), normals, copies: Vec::new() }
}

/// Returns normals for all wedges: the mesh's own, or else vertex normals computed from the faces.
pub(super) fn normals(mesh: &TriMesh) -> Cow<'_, [[f32; 3]]> {
    if let Some(normals) = mesh.normals() {
        return normals.into();
    }
    let surface = mesh.surface();
    let joined = weld(surface.positions());
    let of_vertex = vertex_normals(&surface, |v| joined.of(v));
    match mesh.vertex_map() {
        None => of_vertex.into(),
        Some(map) => map.iter().map(|v| of_vertex[v.index()]).collect(),
    }
}

/// Minimum number of faces or wedges per parallel task.
const MIN_ITEMS_PER_TASK: usize = 1 << 14;

/// Returns the same normals as [`normals`] for a mesh whose vertices are already welded, in single precision
/// and in parallel: for geometry that is shown only briefly.
pub(super) fn quick_normals(mesh: &TriMesh) -> Cow<'_, [[f32; 3]]> {
    if let Some(normals) = mesh.normals() {
        return normals.into();
    }
    let positions = mesh.positions().view();
    let middle =
        positions.bounds().map_or(DVec3::ZERO, |b| DVec3::from(b.min) * 0.5 + DVec3::from(b.max) * 0.5);
    let places: Vec<Vec3> = (0..positions.len())
        .into_par_iter()
        .with_min_len(MIN_ITEMS_PER_TASK)
        .map(|v| (DVec3::from(positions.get(VertexId::new(v))) - middle).as_vec3())
        .collect();
    let turns = |t: &[WedgeId; 3]| {
        let [a, b, c] = t.map(|w| places[mesh.vertex_of(w).index()]);
        let sides = [b - a, c - b, a - c].map(Vec3::normalize_or_zero);
        let normal = sides[0].cross(sides[1]).normalize_or_zero();
        [0, 1, 2].map(|k| normal * acos_approx(-sides[k].dot(sides[(k + 2) % 3])))
    };
    let of_corners: Vec<[Vec3; 3]> =
        mesh.triangles().par_iter().with_min_len(MIN_ITEMS_PER_TASK).map(turns).collect();
    let mut sums = vec![Vec3::ZERO; places.len()];
    for (&w, turn) in mesh.triangles().iter().flatten().zip(of_corners.iter().flatten()) {
        sums[mesh.vertex_of(w).index()] += *turn;
    }
    let unit = |w: usize| sums[mesh.vertex_of(WedgeId::new(w)).index()].normalize_or(Vec3::Z).to_array();
    (0..mesh.wedge_count())
        .into_par_iter()
        .with_min_len(MIN_ITEMS_PER_TASK)
        .map(unit)
        .collect::<Vec<_>>()
        .into()
}

/// Arc cosine, to within 7e-5. Source: [Abramowitz-Stegun 1964], 4.4.45.
fn acos_approx(cosine: f32) -> f32 {
    let x = cosine.abs().min(1.0);
    let angle = (1.0 - x).sqrt() * (1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261_0 - 0.018_729_3 * x)));
    if cosine < 0.0 { std::f32::consts::PI - angle } else { angle }
}

/// Returns positions and normals of the given wedges.
pub(super) fn corners(
    mesh: &TriMesh,
    frame: &UnitFrame,
    normals: &[[f32; 3]],
    wedges: impl IndexedParallelIterator<Item = WedgeId>,
) -> Vec<Corner> {
    let positions = mesh.positions().view();
    wedges
        .with_min_len(MIN_ITEMS_PER_TASK)
        .map(|w| {
            let position = frame.unit_from_user(positions.get(mesh.vertex_of(w))).as_vec3().to_array();
            Corner { position, normal: octahedral(Vec3::from(normals[w.index()])) }
        })
        .collect()
}

/// Returns the attribute rows of the given wedges.
pub(super) fn rows(
    mesh: &TriMesh,
    row: &AttributeLayout,
    wedges: impl ExactSizeIterator<Item = WedgeId>,
) -> Vec<u32> {
    let mut words = Vec::with_capacity(wedges.len() * row.stride as usize);
    if row.stride == 0 {
        return words;
    }
    let uv1 = further_attribute(mesh, &Semantic::Uv(1));
    let tangent = further_attribute(mesh, &Semantic::Tangent);
    let sets: Vec<_> = (0..row.joint_sets as u8).filter_map(|set| joint_set(mesh, set)).collect();
    for w in wedges {
        if let Some(uvs) = mesh.uvs() {
            words.extend(uvs[w.index()].map(f32::to_bits));
        }
        if let Some(uv1) = uv1 {
            words.extend(uv1.of(w).iter().map(|x| x.to_bits()));
        }
        if let Some(colors) = mesh.colors() {
            words.push(u32::from_le_bytes(
                colors[w.index()].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8),
            ));
        }
        if let Some(tangent) = tangent {
            let t = tangent.of(w);
            words.push(octahedral(Vec3::new(t[0], t[1], t[2])));
            words.push(t[3].to_bits());
        }
        // Weights are normalised to a sum of 1; if they sum to zero, the first joint gets all the weight.
        let sum: f32 = sets.iter().flat_map(|[_, weights]| weights.of(w)).sum();
        for (set, [joints, weights]) in sets.iter().enumerate() {
            if sum > 0.0 && sum.is_finite() {
                let j = joints.of(w);
                words.extend([0, 2].map(|k| j[k] as u32 & 0xffff | (j[k + 1] as u32) << 16));
                words.extend(weights.of(w).iter().map(|x| (x / sum).to_bits()));
            } else {
                let first = if set == 0 { 1f32 } else { 0.0 };
                words.extend([0, 0, first.to_bits(), 0, 0, 0]);
            }
        }
    }
    words
}

/// Returns the number of morph targets of a mesh.
pub(super) fn morph_target_count(mesh: &TriMesh) -> u32 {
    let target = |a: &Attribute| match a.semantic {
        Semantic::Morph { target, .. } => Some(u32::from(target) + 1),
        _ => None,
    };
    mesh.further_attributes().iter().filter_map(target).max().unwrap_or(0)
}

/// Returns morph target offsets: for each target and wedge six numbers, three for the position in the unit
/// frame and three for the normal.
pub(super) fn morphs(
    mesh: &TriMesh,
    frame: &UnitFrame,
    wedges: impl ExactSizeIterator<Item = WedgeId> + Clone,
) -> Vec<f32> {
    let mut values = Vec::new();
    for target in 0..morph_target_count(mesh) {
        let of = |of| {
            let semantic = Semantic::Morph { target: target as u16, of };
            further_attribute(mesh, &semantic).filter(|a| a.width == 3)
        };
        let [place, normal] = [of(Morphed::Position), of(Morphed::Normal)];
        for w in wedges.clone() {
            let unit = |x: &f32| frame.unit_length(f64::from(*x)) as f32;
            match place {
                Some(a) => values.extend(a.of(w).iter().map(unit)),
                None => values.extend([0.0; 3]),
            }
            match normal {
                Some(a) => values.extend(a.of(w)),
                None => values.extend([0.0; 3]),
            }
        }
    }
    values
}

/// Face range of each region.
pub(super) type Regions = Vec<(RegionId, std::ops::Range<usize>)>;

/// Returns the faces sorted by region, and the face range of each region. The sort is stable.
pub(super) fn by_region(mesh: &TriMesh) -> (Vec<[WedgeId; 3]>, Regions) {
    let triangles = mesh.triangles();
    let Some(regions) = mesh.regions() else {
        return (triangles.to_vec(), vec![(RegionId(0), 0..triangles.len())]);
    };
    let count = regions.iter().map(|r| r.index() + 1).max().unwrap_or(0);
    let mut start = vec![0; count + 1];
    for r in regions {
        start[r.index() + 1] += 1;
    }
    for r in 0..count {
        start[r + 1] += start[r];
    }
    let parts = (0..count).filter(|&r| start[r] < start[r + 1]);
    let parts = parts.map(|r| (RegionId::new(r), start[r]..start[r + 1])).collect();
    let mut sorted = triangles.to_vec();
    for (face, r) in triangles.iter().zip(regions) {
        sorted[start[r.index()]] = *face;
        start[r.index()] += 1;
    }
    (sorted, parts)
}

/// Returns the radius of the bounding sphere of all corners around the origin.
pub(super) fn radius(corners: &[Corner]) -> f32 {
    let finite = corners.iter().map(|c| Vec3::from(c.position).length_squared()).filter(|d| d.is_finite());
    finite.fold(0.0, f32::max).sqrt()
}

/// Returns the octahedral encoding of a direction: two signed 16-bit numbers.
///
/// Source: [Cigolle et al. 2014].
pub(super) fn octahedral(n: Vec3) -> u32 {
    let sum = n.abs().element_sum();
    let n = if sum > 0.0 && sum.is_finite() { n / sum } else { Vec3::Z };
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    let folded = Vec2::new((1.0 - n.y.abs()) * sign(n.x), (1.0 - n.x.abs()) * sign(n.y));
    let p = if n.z < 0.0 { folded } else { Vec2::new(n.x, n.y) };
    let pack = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    pack(p.x) | pack(p.y) << 16
}

/// Returns the matrix from the unit frame to the user's units.
pub(super) fn user_from_unit(frame: &UnitFrame) -> glam::DMat4 {
    let centre = DVec3::from(frame.user_from_unit(DVec3::ZERO));
    glam::DMat4::from_translation(centre) * glam::DMat4::from_scale(DVec3::splat(frame.user_length(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lodsmith_core::shapes;

    #[test]
    fn quick_normals_are_those_of_the_shape() {
        for mesh in [shapes::cube(3), shapes::blob(3, 4), shapes::cylinder(20, 3)] {
            let (one, two) = (normals(&mesh), quick_normals(&mesh));
            for (a, b) in one.iter().zip(two.iter()) {
                assert!(Vec3::from(*a).angle_between(Vec3::from(*b)) < 2e-3, "{a:?} {b:?}");
            }
        }
    }
}
