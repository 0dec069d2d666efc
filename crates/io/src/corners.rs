//! Meshes whose corners refer to values of several kinds by separate indices, as in COLLADA and FBX.

use crate::attributes::linear_of_srgb;
use crate::gltf::MeshParts;

/// Maximum number of sets of texture coordinates.
pub(crate) const MAX_UV_SETS: usize = 4;
/// Kinds of values of a corner: positions, normals, colours, then the sets of texture coordinates.
pub(crate) const KINDS: usize = 3 + MAX_UV_SETS;
pub(crate) const POSITION: usize = 0;
pub(crate) const NORMAL: usize = 1;
pub(crate) const COLOR: usize = 2;
pub(crate) const FIRST_UV: usize = 3;
/// The index of a corner without a value.
pub(crate) const NONE: u32 = u32::MAX;

/// Indices of a corner, by kind, into the values of that kind.
pub(crate) type Corner = [u32; KINDS];

/// A mesh of corners. `M` identifies the material of a primitive.
#[derive(Default)]
pub(crate) struct CornerMesh<M> {
    pub(crate) name: String,
    /// Values of each kind, four numbers each. Texture coordinates start at the lower left of the image; colours are sRGB.
    pub(crate) values: [Vec<[f32; 4]>; KINDS],
    /// Material and triangles.
    pub(crate) primitives: Vec<(M, Vec<[Corner; 3]>)>,
}

/// A mesh with one vertex for each distinct corner.
pub(crate) struct SplitMesh {
    pub(crate) parts: MeshParts,
    /// The position of each vertex, by its index.
    #[cfg_attr(not(feature = "fbx"), expect(dead_code, reason = "only FBX has values for each position"))]
    pub(crate) position_of: Vec<u32>,
    /// True if only some corners had normals, which were dropped.
    pub(crate) lost_normals: bool,
}

impl<M> CornerMesh<M> {
    pub(crate) fn is_empty(&self) -> bool {
        self.primitives.iter().all(|(_, triangles)| triangles.is_empty())
    }

    /// Returns the mesh with a vertex for each distinct corner, in the order of their positions.
    pub(crate) fn split(&self, material: impl Fn(&M) -> Option<usize>) -> SplitMesh {
        let corners = self.primitives.iter().flat_map(|(_, t)| t.as_flattened());
        let mut keys: Vec<Corner> = corners.copied().collect();
        keys.sort_unstable();
        keys.dedup();
        let has = |kind: usize| keys.iter().any(|key| key[kind] != NONE);
        let value = |kind: usize, key: &Corner| self.values[kind].get(key[kind] as usize).copied();
        let point = |kind: usize, key: &Corner| value(kind, key).map_or([0.0; 3], |[x, y, z, _]| [x, y, z]);
        let uv = |kind: usize, key: &Corner| value(kind, key).map_or([0.0; 2], |[u, v, ..]| [u, 1.0 - v]);
        let lost_normals = has(NORMAL) && keys.iter().any(|key| key[NORMAL] == NONE);
        // Keys are sorted by position; positions without a corner have no vertex.
        let mut source_vertices: Vec<u32> = Vec::with_capacity(keys.len());
        for (at, key) in keys.iter().enumerate() {
            let last = source_vertices.last().copied();
            let is_same = at > 0 && keys[at - 1][POSITION] == key[POSITION];
            source_vertices.push(last.map_or(0, |v| if is_same { v } else { v + 1 }));
        }
        let is_split = source_vertices.last().is_some_and(|&v| (v as usize) < keys.len() - 1);
        let number = |corner: &Corner| keys.binary_search(corner).unwrap_or(0) as u32;
        let group = |(name, triangles): &(M, Vec<[Corner; 3]>)| {
            let numbers = |t: &[Corner; 3]| [number(&t[0]), number(&t[1]), number(&t[2])];
            (material(name), triangles.iter().map(numbers).collect())
        };
        let all = |kind: usize| keys.iter().map(|key| point(kind, key)).collect();
        let parts = MeshParts {
            name: self.name.clone(),
            positions: all(POSITION),
            normals: (has(NORMAL) && !lost_normals).then(|| all(NORMAL)),
            // Later sets keep their numbers where an earlier one is missing.
            uvs: (FIRST_UV..(FIRST_UV..KINDS).rfind(|&kind| has(kind)).map_or(FIRST_UV, |last| last + 1))
                .map(|kind| keys.iter().map(|key| uv(kind, key)).collect())
                .collect(),
            colors: has(COLOR).then(|| keys.iter().map(|key| linear(value(COLOR, key))).collect()),
            source_vertices: is_split.then_some(source_vertices),
            primitives: self.primitives.iter().map(group).collect(),
            ..MeshParts::default()
        };
        let position_of = keys.iter().map(|key| key[POSITION]).collect();
        SplitMesh { parts, position_of, lost_normals }
    }
}

/// Returns a linear colour; white for none.
fn linear(value: Option<[f32; 4]>) -> [f32; 4] {
    let clamped = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 1.0 };
    value.map_or([1.0; 4], |color| {
        let [r, g, b, a] = color.map(clamped);
        [linear_of_srgb(r), linear_of_srgb(g), linear_of_srgb(b), a]
    })
}
