//! Merging of the primitives of all placed meshes into one mesh.

use std::collections::BTreeMap;

use lodsmith_core::mesh::weld::{Weld, weld_mesh_by};
use lodsmith_core::model::TextureRef;
use lodsmith_core::{Attribute, MeshError, Positions, Semantic, TriMesh, VertexId};
use serde_json::Value;

use super::accessors::{Accessor, Component};
use super::affine::Affine;
use super::buffers::Buffers;
use super::container::{entry, list, number, whole};
use super::materials::Run;
use super::mesh::TYPE_NAMES;
use super::placements::{PlacedNodes, Placement, check_placed};
use super::places::{NodePlaces, Places};
use super::primitive::Primitive;
use super::skins::SkinAtRest;
use super::texture_transform::{self, UvTransform};
use crate::error::{ReadError, Warning};
use crate::limits::Limits;

/// A mesh farther from the origin than this many times its size loses half of the 24 bits of a float there.
const FAR_RATIO: f64 = 4096.0;

/// Result of merging all placed meshes.
pub(super) struct Gathered {
    pub(super) mesh: TriMesh,
    /// Materials of its faces, as runs.
    pub(super) runs: Vec<Run>,
    pub(super) warnings: Vec<Warning>,
    /// First vertex of each group of primitives, and its accessor of positions.
    pub(super) bases: Vec<(usize, usize)>,
}

/// Joins vertices with the same source vertex, for position accessors that have source vertices; their
/// attributes stay separate as wedges.
pub(super) fn with_source_vertices(
    mesh: &TriMesh,
    bases: &[(usize, usize)],
    source_vertices: &BTreeMap<usize, Vec<u32>>,
) -> TriMesh {
    let mut representative: Vec<VertexId> = (0..mesh.vertex_count()).map(VertexId::new).collect();
    for (base, accessor) in bases {
        let Some(sources) = source_vertices.get(accessor) else { continue };
        let mut first = vec![None; sources.iter().max().map_or(0, |&m| m as usize + 1)];
        for (k, &source) in sources.iter().enumerate() {
            representative[base + k] = *first[source as usize].get_or_insert(VertexId::new(base + k));
        }
    }
    weld_mesh_by(mesh, &Weld::from_representatives(representative)).mesh
}

/// Merges all placed meshes into one, each as often as it is placed in the scene. Hidden meshes are left out.
pub(super) fn gather(
    json: &Value,
    buffers: &Buffers<'_>,
    nodes: &PlacedNodes,
    file_bytes: usize,
    limits: Limits,
) -> Result<Gathered, ReadError> {
    let mut notes = MergeNotes::default();
    let bytes = file_bytes.max(buffers.total());
    let shown: Vec<&Placement> = nodes.placements.iter().filter(|p| !p.is_hidden).collect();
    let mut places = Places::new(json, buffers, nodes, bytes);
    let of_nodes: Vec<NodePlaces> = shown.iter().map(|p| places.of(p)).collect::<Result<_, _>>()?;
    let meshes = plan(json, buffers, shown.iter().copied().zip(&of_nodes), &mut notes)?;
    let placed = || {
        let groups = |p: &Placement| meshes.get(p.mesh)?.as_ref();
        shown.iter().zip(&of_nodes).filter_map(move |(p, of_node)| Some((of_node, groups(p)?)))
    };

    // All sizes are known before anything is reserved.
    let (mut vertices, mut faces) = (0u64, 0u64);
    for (of_node, groups) in placed() {
        let copies = of_node.count() as u64;
        for g in groups {
            vertices = vertices.saturating_add(copies.saturating_mul(g.vertices as u64));
            let more = |sum: u64, p: &Primitive| sum.saturating_add(p.max_faces() as u64);
            let each = g.primitives.iter().fold(0, more);
            faces = faces.saturating_add(copies.saturating_mul(each));
        }
    }
    check_placed(faces, vertices, bytes)?;
    let has = |f: fn(&VertexGroup) -> bool| placed().any(|(_, groups)| groups.iter().any(f));
    let each = |is: bool, bytes: u64| if is { bytes } else { 0 };
    let vertex = 12
        + each(has(|g| g.normals.is_some()), 12)
        + each(has(|g| g.uvs.is_some()), 8)
        + each(has(|g| g.colors.is_some()), 16);
    // The indices of a primitive are in memory beside its triangles until they are checked.
    let need = vertices.saturating_mul(vertex).saturating_add(faces.saturating_mul(24));
    let held = file_bytes.max(buffers.opened_bytes()) as u64;
    limits.check_memory("reading glTF", held.saturating_add(need))?;
    let mut out = MergedMesh::new([
        has(|g| g.normals.is_some()),
        has(|g| g.uvs.is_some()),
        has(|g| g.colors.is_some()),
    ]);
    let mut bases = Vec::new();
    for (of_node, groups) in placed() {
        let is_skinned = groups.iter().any(|g| !g.joints.is_empty());
        let skin = of_node.skin().filter(|_| is_skinned);
        for place in of_node.rigid() {
            for group in groups {
                bases.push((out.positions.len(), group.positions));
                out.add(json, buffers, group, (&place, skin), &mut notes)?;
            }
        }
    }
    if out.triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: vertices as usize });
    }
    let mut mesh = TriMesh::new(out.positions, bytemuck::allocation::cast_vec(out.triangles))?;
    mesh.set_normals(out.normals)?;
    mesh.set_uvs(out.uvs)?;
    mesh.set_colors(out.colors)?;
    Ok(Gathered { mesh, runs: out.runs, warnings: notes.warnings(), bases })
}

/// Irregularities that were found, for one warning each.
#[derive(Default)]
struct MergeNotes {
    points_or_lines: usize,
    without_positions: usize,
    ragged: usize,
    normals_made: bool,
}

impl MergeNotes {
    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.points_or_lines > 0 {
            let n = self.points_or_lines;
            warnings.push(Warning::lost(format!("{n} primitives are points or lines: dropped")));
        }
        if self.without_positions > 0 {
            let n = self.without_positions;
            warnings.push(Warning::lost(format!("{n} primitives have no positions: dropped")));
        }
        if self.ragged > 0 {
            let n = self.ragged;
            warnings
                .push(Warning::note(format!("{n} primitives end with one or two indices too many: ignored")));
        }
        if self.normals_made {
            warnings.push(Warning::note(
                "parts without normals got normals computed from their faces, since other parts have normals",
            ));
        }
        warnings
    }
}

/// Primitives of a mesh that share their vertices.
struct VertexGroup {
    /// Name of the first primitive, for messages.
    name: String,
    positions: usize,
    normals: Option<usize>,
    uvs: Option<usize>,
    colors: Option<usize>,
    /// Accessors of joints and of weights, if a skin places the mesh.
    joints: Vec<(usize, usize)>,
    /// The transform of the textures of its primitives.
    uv_transform: UvTransform,
    /// Number of vertices.
    vertices: usize,
    primitives: Vec<Primitive>,
}

/// Groups the primitives of every placed mesh and checks their accessors. Nothing is decoded.
fn plan<'p>(
    json: &Value,
    buffers: &Buffers<'_>,
    placed: impl Iterator<Item = (&'p Placement, &'p NodePlaces)> + Clone,
    notes: &mut MergeNotes,
) -> Result<Vec<Option<Vec<VertexGroup>>>, ReadError> {
    let meshes = list(json, "meshes");
    let mut is_skinned = vec![false; meshes.len()];
    placed.clone().for_each(|(p, of_node)| is_skinned[p.mesh] |= of_node.skin().is_some());
    let mut plans: Vec<Option<Vec<VertexGroup>>> = meshes.iter().map(|_| None).collect();
    for (placement, _) in placed {
        let plan = &mut plans[placement.mesh];
        if plan.is_some() {
            continue;
        }
        let (mesh, mesh_name) = entry(json, "meshes", placement.mesh, "a node")?;
        let mut groups: Vec<VertexGroup> = Vec::new();
        let mut known = std::collections::HashMap::new();
        for (i, primitive) in list(mesh, "primitives").iter().enumerate() {
            let name = format!("{mesh_name}.primitives[{i}]");
            if !Primitive::has_faces(primitive, &name)? {
                notes.points_or_lines += 1;
                continue;
            }
            let attributes = &primitive["attributes"];
            let attribute = |what: &str| whole(attributes, what, &name);
            let Some(positions) = attribute("POSITION")? else {
                notes.without_positions += 1;
                continue;
            };
            let joints = if is_skinned[placement.mesh] { joint_sets(attributes, &name)? } else { Vec::new() };
            let key =
                (positions, attribute("NORMAL")?, attribute("TEXCOORD_0")?, attribute("COLOR_0")?, joints);
            let material = number(&primitive["material"]).and_then(|m| list(json, "materials").get(m));
            let uv_transform = material.map_or(TextureRef::PLAIN, texture_transform::of_material);
            // Textures that place the same coordinates differently need vertices of their own.
            let by_texture = (key.clone(), uv_transform.map(|row| row.map(f32::to_bits)));
            let group = match known.get(&by_texture) {
                Some(&at) => at,
                None => {
                    known.insert(by_texture, groups.len());
                    groups.push(VertexGroup { uv_transform, ..group(json, buffers, key, &name)? });
                    groups.len() - 1
                }
            };
            let group = &mut groups[group];
            group.primitives.push(Primitive::new(json, buffers, primitive, name, group.vertices)?);
        }
        *plan = Some(groups);
    }
    Ok(plans)
}

/// Accessors of positions, normals, texture coordinates, colours, and joints with their weights.
type Key = (usize, Option<usize>, Option<usize>, Option<usize>, Vec<(usize, usize)>);

/// Returns the accessors of joints and weights of a primitive, from the first set to the last that has both.
fn joint_sets(attributes: &Value, name: &str) -> Result<Vec<(usize, usize)>, ReadError> {
    let mut sets = Vec::new();
    // (Meshes of a scene have no more sets.)
    for i in 0..=u8::MAX {
        let of = |what: &str| whole(attributes, &format!("{what}_{i}"), name);
        let (Some(joints), Some(weights)) = (of("JOINTS")?, of("WEIGHTS")?) else { break };
        sets.push((joints, weights));
    }
    Ok(sets)
}

/// Returns a group without primitives; checks that its attributes exist and have the right width and one
/// entry per vertex.
fn group(
    json: &Value,
    buffers: &Buffers<'_>,
    (positions, normals, uvs, colors, joints): Key,
    name: &str,
) -> Result<VertexGroup, ReadError> {
    let accessor = Accessor::new(json, buffers, positions, name)?;
    let vertices = accessor.count;
    let of_skin = joints.iter().flat_map(|&(j, w)| [("JOINTS", Some(j), 4..=4), ("WEIGHTS", Some(w), 4..=4)]);
    for (what, index, widths) in [
        ("POSITION", Some(positions), 3..=3),
        ("NORMAL", normals, 3..=3),
        ("TEXCOORD_0", uvs, 2..=2),
        ("COLOR_0", colors, 3..=4),
    ]
    .into_iter()
    .chain(of_skin)
    {
        let Some(index) = index else { continue };
        let a = Accessor::new(json, buffers, index, name)?;
        if !widths.contains(&a.width) {
            let (wanted, got) = (TYPE_NAMES[*widths.start()], TYPE_NAMES[a.width]);
            let problem = format!("{what} of {name} is of type {got}, expected {wanted}");
            return Err(ReadError::element(a.name, problem));
        }
        if a.kind == Component::U32 {
            return Err(ReadError::element(a.name, format!("{what} of {name} must not be 32-bit integers")));
        }
        if a.count != vertices {
            let (count, got) = (vertices, a.count);
            return Err(ReadError::element(
                a.name,
                format!("{what} of {name} has {got} entries for {count} vertices"),
            ));
        }
    }
    Ok(VertexGroup {
        name: name.to_owned(),
        positions,
        normals,
        uvs,
        colors,
        joints,
        uv_transform: TextureRef::PLAIN,
        vertices,
        primitives: Vec::new(),
    })
}

/// Returns vertices as a mesh without faces, with the joints that move them.
fn skinned_vertices(
    json: &Value,
    buffers: &Buffers<'_>,
    group: &VertexGroup,
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
) -> Result<TriMesh, ReadError> {
    let count = positions.len();
    let mut mesh = TriMesh::new(Positions::F32(positions), Vec::new())?;
    mesh.set_normals(normals)?;
    let four =
        |index: usize, normalized| Accessor::new(json, buffers, index, &group.name)?.floats::<4>(normalized);
    let mut add = |semantic: Semantic, values: Vec<[f32; 4]>| {
        mesh.add_attribute(Attribute { semantic, width: 4, values: values.into_flattened() })
    };
    for (i, &(joints, weights)) in (0..=u8::MAX).zip(&group.joints) {
        add(Semantic::Joints(i), four(joints, false)?)?;
        add(Semantic::Weights(i), four(weights, true)?)?;
    }
    if group.joints.is_empty() {
        // Other primitives of the mesh have joints, so these vertices follow the first one.
        add(Semantic::Joints(0), vec![[0.0; 4]; count])?;
        add(Semantic::Weights(0), vec![[0.0; 4]; count])?;
    }
    Ok(mesh)
}

/// The merged mesh under construction.
struct MergedMesh {
    positions: Positions,
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    colors: Option<Vec<[f32; 4]>>,
    triangles: Vec<[u32; 3]>,
    runs: Vec<Run>,
}

impl MergedMesh {
    fn new([normals, uvs, colors]: [bool; 3]) -> Self {
        Self {
            positions: Positions::F32(Vec::new()),
            normals: normals.then(Vec::new),
            uvs: uvs.then(Vec::new),
            colors: colors.then(Vec::new),
            triangles: Vec::new(),
            runs: Vec::new(),
        }
    }

    /// Adds a group, transformed by its placement or, if it has a skin, by the joints.
    fn add(
        &mut self,
        json: &Value,
        buffers: &Buffers<'_>,
        group: &VertexGroup,
        (place, skin): (&Affine, Option<&SkinAtRest>),
        notes: &mut MergeNotes,
    ) -> Result<(), ReadError> {
        let floats3 = |index: usize| Accessor::new(json, buffers, index, &group.name)?.floats::<3>(false);
        let base = self.positions.len();
        let mut local = floats3(group.positions)?;
        let first_face = self.triangles.len();
        let (mut place, mut skinned) = (place, None);
        if let Some(skin) = skin {
            let normals = group.normals.map(floats3).transpose()?;
            let vertices = skinned_vertices(json, buffers, group, local, normals)?;
            let (positions, normals) = skin.deformed(&vertices);
            (local, place) = (positions, &Affine::IDENTITY);
            skinned = Some((normals, skin.is_mirrored(&vertices)));
        }
        let mirrored = skinned.as_ref().map_or(place.determinant() < 0.0, |skinned| skinned.1);
        for primitive in &group.primitives {
            self.add_triangles(json, buffers, primitive, (base, local.len()), mirrored, notes)?;
        }

        if let Some(normals) = &mut self.normals {
            let mut more = match (group.normals, skinned) {
                (Some(_), Some((normals, _))) => normals,
                (Some(index), None) => floats3(index)?,
                (None, _) => {
                    notes.normals_made = true;
                    smooth_normals(&local, base, &self.triangles[first_face..], mirrored)
                }
            };
            let matrix = place.normal_matrix();
            let plain = *place == Affine::IDENTITY;
            more.iter_mut().for_each(|n| *n = transform_normal(*n, &matrix, plain));
            append(normals, more);
        }
        if let Some(uvs) = &mut self.uvs {
            let mut more = match group.uvs {
                Some(index) => Accessor::new(json, buffers, index, &group.name)?.floats::<2>(false)?,
                None => vec![[0.0, 1.0]; local.len()],
            };
            // In glTF, texture coordinates start at the upper left corner of the image.
            more.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
            texture_transform::apply(&group.uv_transform, &mut more);
            append(uvs, more);
        }
        if let Some(colors) = &mut self.colors {
            let more = match group.colors {
                Some(index) => {
                    let accessor = Accessor::new(json, buffers, index, &group.name)?;
                    // Integer colours mean 0..1 even if the file does not declare them normalized.
                    let mut more = accessor.floats::<4>(true)?;
                    if accessor.width == 3 {
                        more.iter_mut().for_each(|c| c[3] = 1.0);
                    }
                    more
                }
                None => vec![[1.0; 4]; local.len()],
            };
            append(colors, more);
        }
        self.add_positions(local, place);
        Ok(())
    }

    fn add_positions(&mut self, mut local: Vec<[f32; 3]>, place: &Affine) {
        let plain = *place == Affine::IDENTITY;
        if !plain && matches!(self.positions, Positions::F32(_)) && loses_half(&local, place) {
            let narrow = std::mem::replace(&mut self.positions, Positions::F64(Vec::new()));
            if let (Positions::F32(old), Positions::F64(new)) = (narrow, &mut self.positions) {
                new.extend(old.into_iter().map(|p| p.map(f64::from)));
            }
        }
        match &mut self.positions {
            Positions::F32(all) => {
                if !plain {
                    local.iter_mut().for_each(|p| *p = place.point(p.map(f64::from)).map(|x| x as f32));
                }
                append(all, local);
            }
            Positions::F64(all) => all.extend(local.into_iter().map(|p| place.point(p.map(f64::from)))),
        }
    }

    /// Adds the triangles of a primitive; `base` and `count` are its first vertex and its number of vertices.
    fn add_triangles(
        &mut self,
        json: &Value,
        buffers: &Buffers<'_>,
        primitive: &Primitive,
        (base, count): (usize, usize),
        mirrored: bool,
        notes: &mut MergeNotes,
    ) -> Result<(), ReadError> {
        let beyond = base.saturating_add(count);
        if beyond >= u32::MAX as usize {
            return Err(MeshError::TooLarge { what: "vertices", count: beyond }.into());
        }
        let shift = base as u32;
        let (mut more, is_ragged) = primitive.triangles(json, buffers, count)?;
        notes.ragged += usize::from(is_ragged);
        if shift > 0 {
            more.as_flattened_mut().iter_mut().for_each(|c| *c += shift);
        }
        let first = self.triangles.len();
        append(&mut self.triangles, more);
        if mirrored {
            self.triangles[first..].iter_mut().for_each(|t| t.swap(1, 2));
        }
        let (end, material) = (self.triangles.len(), primitive.material);
        if end > first {
            self.runs.push(Run { end, material });
        }
        Ok(())
    }
}

/// Appends a vector; an empty target takes it over without copying.
fn append<T>(all: &mut Vec<T>, more: Vec<T>) {
    if all.is_empty() {
        *all = more;
    } else {
        all.extend(more);
    }
}

/// Returns true if floats lose half of their bits for a mesh at this place.
fn loses_half(local: &[[f32; 3]], place: &Affine) -> bool {
    let far = place.translation().iter().fold(0f64, |m, x| m.max(x.abs()));
    if far == 0.0 {
        return false;
    }
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in local {
        let p = place.point(p.map(f64::from));
        for k in 0..3 {
            min[k] = min[k].min(p[k]);
            max[k] = max[k].max(p[k]);
        }
    }
    let extent = (0..3).fold(0f64, |m, k| m.max(max[k] - min[k]));
    // A mesh of one point has no digits to lose.
    extent > 0.0 && extent.is_finite() && far > FAR_RATIO * extent
}

/// Transforms a normal and normalizes it; it stays unchanged if the result has no length.
fn transform_normal(n: [f32; 3], matrix: &[[f64; 3]; 3], plain: bool) -> [f32; 3] {
    let wide = n.map(f64::from);
    let length_sq = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
    if plain && (length_sq(wide) - 1.0).abs() <= 2e-3 {
        return n;
    }
    let m = if plain { wide } else { matrix.map(|r| r[0] * wide[0] + r[1] * wide[1] + r[2] * wide[2]) };
    // Scaled first, to avoid underflow: the cofactors in the matrix of a small mesh are smaller still.
    let largest = m.iter().fold(0f64, |a, x| a.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return n;
    }
    let m = m.map(|x| x / largest);
    let length = length_sq(m).sqrt();
    m.map(|x| (x / length) as f32)
}

/// Computes vertex normals: the sum of face normals, weighted by area.
fn smooth_normals(local: &[[f32; 3]], base: usize, triangles: &[[u32; 3]], mirrored: bool) -> Vec<[f32; 3]> {
    let mut sums = vec![[0f64; 3]; local.len()];
    let sign = if mirrored { -1.0 } else { 1.0 };
    for t in triangles {
        let t = t.map(|i| i as usize - base);
        let [a, b, c] = t.map(|i| local[i].map(f64::from));
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for i in t {
            (0..3).for_each(|k| sums[i][k] += sign * n[k]);
        }
    }
    let unit = |s: [f64; 3]| {
        let length = s.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length > 0.0 { s.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
    };
    sums.into_iter().map(unit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_turns_faces_and_keeps_normals_outside() {
        // Counter-clockwise seen from +z, before and after the mirror along x.
        let place = Affine([[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        assert!(place.determinant() < 0.0);
        assert_eq!(transform_normal([0.0, 0.0, 1.0], &place.normal_matrix(), false), [0.0, 0.0, 1.0]);
        assert_eq!(transform_normal([1.0, 0.0, 0.0], &place.normal_matrix(), false), [-1.0, 0.0, 0.0]);
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(smooth_normals(&corners, 0, &[[0, 2, 1]], true)[0], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn half_the_digits() {
        let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let at = |x: f64| Affine([[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        assert!(!loses_half(&corners, &at(4000.0)));
        assert!(loses_half(&corners, &at(-5000.0)));
        assert!(!loses_half(&corners[..1], &at(1e9)));
    }
}
