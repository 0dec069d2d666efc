//! Conversion of a mesh's attributes to one row of values for each wedge, and back.

mod labels;
pub(crate) mod normals;
pub(crate) mod ranges;
pub(crate) mod recolor;
mod recorded;
pub(crate) mod sides;
mod skin;
pub(crate) mod textures;

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::{Attribute, Morphed, Positions, Semantic, TriMesh, VertexId, WedgeId};

use crate::SimplifyError;
use crate::collapse::attributes::{Attributes, JointWeights};
use crate::collapse::order::NONE;
use crate::options::AttributeWeights;
use labels::Labels;
use ranges::{UNLIMITED_RANGE, ranges, within};
pub(crate) use recorded::RowPlaces;
use skin::{joint_weights, middles, skin_sets};

/// Weight of an error of 1 in a normal, or of the full range in a colour, as a fraction of the edge length of
/// the result. (Where an edge deviates from a curve by h, the normal turns by 4 h over the edge's length: a
/// quarter would weigh both equally. Guessed below that, so that shape counts more.)
const NORMAL_WEIGHT: f64 = 0.1;
const COLOR_WEIGHT: f64 = 0.1;
/// Weight of texture coordinates: a shift of the texture along the surface counts as this fraction of its
/// length. (Guessed.)
const UV_WEIGHT: f64 = 0.5;

/// Weight of a change of skin: the distance by which a wedge's mean joint position moves counts as this
/// fraction of itself. (Measured at half the faces: Fox, running, has FLIP .1434 with 0, .1392 with .1, .1516
/// with .2, .1546 with .5; CesiumMan, walking, .0648, .0413, .0345 and .0237. Its distance at rest rises by
/// 17 % with .1 and by half with .5.)
const SKIN_WEIGHT: f64 = 0.1;

/// Larger values are divided by a power of two while they are processed, so that no product of them overflows
/// single precision.
const MAX_ROW_VALUE: f32 = 1e12;
/// Largest weight of a value, times the largest of its kind. (Keeps determinants within single precision;
/// beyond it, no other attribute affects the cost anyway.)
const MAX_WEIGHTED_VALUE: f64 = 1e6;

/// The layout of the rows of a mesh, and the row of each wedge.
#[derive(Clone)]
pub(crate) struct Rows {
    layout: Vec<Column>,
    /// Sets of four joints each.
    skin_sets: Vec<u8>,
    labels: Labels,
    /// The row of each wedge of the mesh; equal wedges of one vertex share a row.
    pub(crate) wedge_rows: Vec<WedgeId>,
    /// True if all wedges of a vertex have the same joints: the result keeps that, or it would tear when it
    /// moves.
    has_joints_per_vertex: bool,
}

/// The surface of the attributes, in the unit frame.
pub(crate) struct WeightContext<'a> {
    pub(crate) faces: &'a [[VertexId; 3]],
    pub(crate) wedges: &'a [[WedgeId; 3]],
    pub(crate) points: &'a [Vec3],
    pub(crate) frame: UnitFrame,
    /// Approximate edge length of the result.
    pub(crate) edge: f64,
}

/// Place of an attribute in a row; an attribute with the same value at all wedges has no place.
#[derive(Clone)]
struct Column {
    source: ColumnSource,
    offset: usize,
    width: usize,
    constant: Option<Vec<f32>>,
    /// The largest of its values, as stored in rows.
    largest: f32,
    /// Divisor of the values in rows.
    divisor: f32,
    /// Range of each value in the mesh.
    ranges: Vec<[f32; 2]>,
    /// True if it displaces vertices, and all wedges of a vertex equally: the result keeps that, or it would
    /// tear.
    moves_whole: bool,
}

/// Attribute of a column.
#[derive(Clone)]
enum ColumnSource {
    Normals,
    Uvs,
    Colors,
    /// The mean joint position of a wedge, used in the cost only: the result does not have it.
    Middle,
    Further(Semantic),
}

/// Returns the columns of a mesh's attributes, and the width of a row.
fn columns(mesh: &TriMesh, skin_sets: &[u8], middles: &[[f32; 3]]) -> (Vec<Column>, usize) {
    let mut layout = Vec::new();
    let mut width = 0;
    let mut add = |of: ColumnSource, n: usize| {
        let mut column = Column {
            source: of,
            offset: width,
            width: n,
            constant: None,
            largest: 0.0,
            divisor: 1.0,
            ranges: Vec::new(),
            moves_whole: false,
        };
        let all = column.all(mesh, middles);
        column.constant = column.constant_of(all, mesh.wedge_count());
        column.bound(all);
        width += if column.constant.is_some() { 0 } else { n };
        layout.push(column);
    };
    if mesh.normals().is_some() {
        add(ColumnSource::Normals, 3);
    }
    if mesh.uvs().is_some() {
        add(ColumnSource::Uvs, 2);
    }
    if mesh.colors().is_some() {
        add(ColumnSource::Colors, 4);
    }
    for a in mesh.further_attributes() {
        if !matches!(a.semantic, Semantic::Joints(_) | Semantic::Weights(_) | Semantic::Discrete { .. }) {
            add(ColumnSource::Further(a.semantic.clone()), a.width);
        }
    }
    if !skin_sets.is_empty() {
        add(ColumnSource::Middle, 3);
    }
    (layout, width)
}

impl Rows {
    /// Returns the rows of a mesh whose wedges belong to the vertices `place`, and the engine's form of them;
    /// `None` without attributes and regions.
    pub(crate) fn new(mesh: &TriMesh, place: impl Fn(WedgeId) -> VertexId) -> Option<(Self, Attributes)> {
        if !mesh.has_attributes() && mesh.regions().is_none() {
            return None;
        }
        let skin_sets = skin_sets(mesh);
        let middles = middles(mesh, &skin_sets);
        let (mut layout, width) = columns(mesh, &skin_sets, &middles);
        let joint_weights_of = |w: WedgeId| joint_weights(mesh, &skin_sets, w);
        let (labels, label_of) = Labels::new(mesh);

        // Sort wedges by vertex, then by value: equal wedges share one row; rows are in the order of the
        // vertices.
        let order = by_place(mesh.wedge_count(), place);
        let mut given = vec![0f32; width * order.len()];
        for c in layout.iter().filter(|c| c.constant.is_none()) {
            c.read_all(c.all(mesh, &middles), &order, width, &mut given);
        }
        let mut values: Vec<f32> = Vec::with_capacity(given.len());
        let mut all_joint_weights: Vec<JointWeights> = Vec::new();
        let mut all_labels: Vec<u32> = Vec::new();
        let mut wedge_rows = vec![WedgeId(0); mesh.wedge_count()];
        let (mut count, mut first) = (0usize, 0usize);
        for (i, &(vertex, w)) in order.iter().enumerate() {
            if i == 0 || order[i - 1].0 != vertex {
                first = count;
            }
            let row = &given[i * width..][..width];
            let own_joint_weights = joint_weights_of(w);
            let own_label = label_of.get(w.index());
            let same = |&r: &usize| {
                let known = &values[r * width..][..width];
                known.iter().zip(row).all(|(a, b)| a.to_bits() == b.to_bits())
                    && (skin_sets.is_empty() || all_joint_weights[r] == own_joint_weights)
                    && all_labels.get(r) == own_label
            };
            // For a vertex with very many wedges only the last rows are compared.
            let known = (first.max(count.saturating_sub(64))..count).find(same);
            wedge_rows[w.index()] = WedgeId(known.unwrap_or(count) as u32);
            if known.is_none() {
                values.extend_from_slice(row);
                if !skin_sets.is_empty() {
                    all_joint_weights.push(own_joint_weights);
                }
                all_labels.extend(own_label);
                count += 1;
            }
        }
        // Wedges of one vertex are contiguous.
        let differ = |what: &dyn Fn(usize, usize) -> bool| {
            order.windows(2).any(|pair| {
                let [(v, a), (u, b)] = [pair[0], pair[1]].map(|(v, w)| (v, wedge_rows[w.index()].index()));
                v == u && a != b && what(a, b)
            })
        };
        let has_joints_per_vertex =
            !differ(&|a, b| !skin_sets.is_empty() && all_joint_weights[a] != all_joint_weights[b]);
        for c in layout.iter_mut().filter(|c| c.constant.is_none() && c.is_movement()) {
            let of = |row: usize| &values[row * width + c.offset..][..c.width];
            c.moves_whole = !differ(&|a, b| of(a) != of(b));
        }
        let directions =
            layout.iter().filter(|c| c.is_direction() && c.constant.is_none()).map(|c| c.offset).collect();
        let textures =
            layout.iter().filter(|c| c.is_texture() && c.constant.is_none()).map(|c| c.offset).collect();
        let mut attributes = Attributes::new(count, width, directions, textures, &values, all_joint_weights);
        attributes.labels = all_labels;
        Some((Self { layout, skin_sets, labels, wedge_rows, has_joints_per_vertex }, attributes))
    }

    /// Returns the number of values in a row.
    pub(crate) fn width(&self) -> usize {
        self.layout.iter().filter(|c| c.constant.is_none()).map(|c| c.width).sum()
    }
    /// Returns for each value of a row whether it belongs to a normal or tangent.
    pub(crate) fn shading(&self) -> Vec<bool> {
        self.of_each(|c| c.is_shading())
    }
    /// Returns the offset of normals in a row, if it has any.
    pub(crate) fn normals_at(&self) -> Option<usize> {
        self.layout
            .iter()
            .find(|c| matches!(c.source, ColumnSource::Normals) && c.constant.is_none())
            .map(|c| c.offset)
    }
    /// Returns the largest value of each column, for each value of a row.
    pub(crate) fn largest(&self) -> Vec<f32> {
        self.of_each(|c| c.largest)
    }
    fn of_each<T: Copy>(&self, what: impl Fn(&Column) -> T) -> Vec<T> {
        let columns = self.layout.iter().filter(|c| c.constant.is_none());
        columns.flat_map(|c| std::iter::repeat_n(what(c), c.width)).collect()
    }

    /// Sets the weight of each value in the cost.
    pub(crate) fn set_weights(
        &self,
        attributes: &mut Attributes,
        weights: &AttributeWeights,
        on: &WeightContext<'_>,
    ) {
        let WeightContext { frame, edge, .. } = *on;
        let gradients = attributes.mean_square_gradients(on.faces, on.wedges, on.points);
        for c in self.layout.iter().filter(|c| c.constant.is_none()) {
            let range = c.offset..c.offset + c.width;
            // Root mean square of the gradient of a value.
            let gradient = (gradients[range.clone()].iter().sum::<f64>() / c.width as f64).sqrt().max(1e-12);
            let divisor = f64::from(c.divisor);
            let weight = match &c.source {
                ColumnSource::Normals => weights.normal * NORMAL_WEIGHT * edge,
                ColumnSource::Colors => weights.color * COLOR_WEIGHT * edge * divisor,
                ColumnSource::Uvs | ColumnSource::Further(Semantic::Uv(_)) => {
                    weights.uv * UV_WEIGHT / gradient
                }
                ColumnSource::Middle => weights.skin * SKIN_WEIGHT * frame.unit_length(1.0) * divisor,
                ColumnSource::Further(Semantic::Color(_)) => weights.color * COLOR_WEIGHT * edge * divisor,
                ColumnSource::Further(Semantic::Morph { of: Morphed::Position, .. }) => {
                    weights.morph * frame.unit_length(1.0) * divisor
                }
                ColumnSource::Further(Semantic::Morph { of: Morphed::Normal, .. }) => {
                    weights.normal * NORMAL_WEIGHT * edge * divisor
                }
                ColumnSource::Further(Semantic::Custom(_)) => weights.other * UV_WEIGHT / gradient,
                ColumnSource::Further(_) => 0.0,
            };
            let weight = weight.min(MAX_WEIGHTED_VALUE / f64::from(c.largest).max(1e-12));
            attributes.weights_mut()[range].fill((weight * weight) as f32);
        }
    }

    /// Returns the mesh of these faces, with the attributes of their wedges.
    pub(crate) fn mesh(
        &self,
        attributes: Option<&Attributes>,
        positions: Positions,
        faces: &[[VertexId; 3]],
        wedges: &[[WedgeId; 3]],
    ) -> Result<TriMesh, lodsmith_core::MeshError> {
        let (mut mesh, pairs) = with_wedges(positions, faces, wedges)?;
        for c in &self.layout {
            let parts = || {
                pairs.iter().map(|p| match (&c.constant, attributes) {
                    (Some(constant), _) => &constant[..],
                    (None, Some(attributes)) => &attributes.of(p.1)[c.offset..c.offset + c.width],
                    (None, None) => &[][..],
                })
            };
            match &c.source {
                ColumnSource::Normals => mesh.set_normals(Some(parts().map(unit).collect()))?,
                ColumnSource::Uvs => {
                    mesh.set_uvs(Some(parts().map(|r| [0, 1].map(|k| c.to_mesh_units(k, r[k]))).collect()))?
                }
                ColumnSource::Colors => {
                    let color = |r: &[f32]| [0, 1, 2, 3].map(|k| c.to_mesh_units(k, r[k]));
                    mesh.set_colors(Some(parts().map(color).collect()))?;
                }
                ColumnSource::Middle => {}
                ColumnSource::Further(semantic) => {
                    let each = parts().flat_map(|r| r.iter().enumerate());
                    let mut values: Vec<f32> = each.map(|(k, x)| c.to_mesh_units(k, *x)).collect();
                    if *semantic == Semantic::Tangent && c.width == 4 {
                        for t in values.as_chunks_mut::<4>().0 {
                            let [x, y, z] = unit(&t[..3]);
                            *t = [x, y, z, if t[3] < 0.0 { -1.0 } else { 1.0 }];
                        }
                    }
                    if c.moves_whole {
                        average_per_vertex(&pairs, c.width, &mut values);
                    }
                    mesh.add_attribute(Attribute { semantic: semantic.clone(), width: c.width, values })?;
                }
            }
        }
        for (semantic, width, at) in self.labels.kinds() {
            let label = |p: &(VertexId, WedgeId)| {
                let own = attributes.and_then(|a| a.labels.get(p.1.index()));
                self.labels.of(own.copied().unwrap_or(0))
            };
            let values = pairs.iter().flat_map(|p| &label(p)[at..at + width]).copied().collect();
            mesh.add_attribute(Attribute { semantic: semantic.clone(), width, values })?;
        }
        let joint_weights = match attributes {
            Some(attributes) if !self.skin_sets.is_empty() => self.joint_weights_of(attributes, &pairs),
            _ => Vec::new(),
        };
        for (i, &set) in self.skin_sets.iter().enumerate().filter(|_| attributes.is_some()) {
            let max_joints = 4 * self.skin_sets.len();
            let (mut joints, mut weights) = (Vec::new(), Vec::new());
            for joint_weights in &joint_weights {
                let kept = &joint_weights[..joint_weights.len().min(max_joints)];
                let sum: f32 = kept.iter().map(|p| p.1).sum();
                for k in 4 * i..4 * i + 4 {
                    let (joint, weight) = kept.get(k).copied().unwrap_or((0, 0.0));
                    joints.push(joint as f32);
                    weights.push(if sum > 0.0 { weight / sum } else { 0.0 });
                }
            }
            mesh.add_attribute(Attribute { semantic: Semantic::Joints(set), width: 4, values: joints })?;
            mesh.add_attribute(Attribute { semantic: Semantic::Weights(set), width: 4, values: weights })?;
        }
        Ok(mesh)
    }

    /// Returns the joints and weights of each pair: its own, or the mean over all pairs of its vertex.
    fn joint_weights_of<'a>(
        &self,
        attributes: &'a Attributes,
        pairs: &[(VertexId, WedgeId)],
    ) -> Vec<Cow<'a, [(u32, f32)]>> {
        let own = |p: &(VertexId, WedgeId)| &attributes.joint_weights[p.1.index()];
        let mut all: Vec<Cow<'a, [(u32, f32)]>> = pairs.iter().map(|p| Cow::Borrowed(&own(p)[..])).collect();
        if !self.has_joints_per_vertex {
            return all;
        }
        let mut at = 0;
        for vertex in pairs.chunk_by(|a, b| a.0 == b.0) {
            if vertex.iter().any(|p| own(p) != own(&vertex[0])) {
                let mut sums: BTreeMap<u32, f32> = BTreeMap::new();
                for joint_weights in vertex.iter().map(own) {
                    let sum: f32 = joint_weights.iter().map(|p| p.1).sum();
                    let share = |weight: f32| if sum > 0.0 { weight / sum } else { 0.0 };
                    joint_weights.iter().for_each(|p| *sums.entry(p.0).or_default() += share(p.1));
                }
                let mut joined: JointWeights = sums.into_iter().filter(|p| p.1 > 0.0).collect();
                joined.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
                all[at..at + vertex.len()].fill(Cow::Owned(joined));
            }
            at += vertex.len();
        }
        all
    }
}

/// Replaces the values of all pairs of a vertex by their mean, unless they are equal.
fn average_per_vertex(pairs: &[(VertexId, WedgeId)], width: usize, values: &mut [f32]) {
    let mut rest = values;
    for vertex in pairs.chunk_by(|a, b| a.0 == b.0) {
        let (own, after) = rest.split_at_mut(vertex.len() * width);
        rest = after;
        let first = own[..width].to_vec();
        if own.chunks_exact(width).all(|row| row == first) {
            continue;
        }
        let mean = |k: usize| {
            let sum: f64 = own.iter().skip(k).step_by(width).map(|x| f64::from(*x)).sum();
            (sum / vertex.len() as f64) as f32
        };
        let mean: Vec<f32> = (0..width).map(mean).collect();
        own.chunks_exact_mut(width).for_each(|row| row.copy_from_slice(&mean));
    }
}

/// Builds the result with its wedges numbered in the order of the faces, and attributes from the input.
pub(crate) fn with_input_attributes(
    mesh: &TriMesh,
    positions: Positions,
    faces: &[[VertexId; 3]],
    wedges: &[[WedgeId; 3]],
) -> Result<TriMesh, SimplifyError> {
    let (mut result, pairs) = with_wedges(positions, faces, wedges)?;
    result.set_normals(mesh.normals().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    result.set_uvs(mesh.uvs().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    result.set_colors(mesh.colors().map(|n| pairs.iter().map(|p| n[p.1.index()]).collect()))?;
    for a in mesh.further_attributes() {
        let values = pairs.iter().flat_map(|p| a.of(p.1)).copied().collect();
        result.add_attribute(Attribute { semantic: a.semantic.clone(), width: a.width, values })?;
    }
    Ok(result)
}

/// Returns a mesh whose wedges are the distinct pairs of vertex and given wedge, in order, and those pairs.
pub(crate) fn with_wedges(
    positions: Positions,
    faces: &[[VertexId; 3]],
    wedges: &[[WedgeId; 3]],
) -> Result<(TriMesh, Vec<(VertexId, WedgeId)>), lodsmith_core::MeshError> {
    let corners = || faces.as_flattened().iter().copied().zip(wedges.as_flattened().iter().copied());
    let count = wedges.as_flattened().iter().map(|w| w.index() + 1).max().unwrap_or(0);
    let mut last = vec![NONE; count];
    let mut pairs: Vec<(VertexId, WedgeId)> = Vec::new();
    for (v, w) in corners() {
        if std::mem::replace(&mut last[w.index()], v) != v {
            pairs.push((v, w));
        }
    }
    let mut pairs = in_order(&pairs, positions.len());
    pairs.dedup();
    let mut at = vec![0; count];
    for (i, p) in pairs.iter().enumerate() {
        at[p.1.index()] = i;
    }
    // Nearly always a wedge belongs to one vertex.
    let number = |v: VertexId, w: WedgeId| match at[w.index()] {
        i if pairs[i] == (v, w) => WedgeId(i as u32),
        _ => pairs.binary_search(&(v, w)).map_or(WedgeId(0), |i| WedgeId(i as u32)),
    };
    let triangles: Vec<_> =
        faces.iter().zip(wedges).map(|(t, w)| [0, 1, 2].map(|k| number(t[k], w[k]))).collect();
    let plain = pairs.len() == positions.len() && pairs.iter().enumerate().all(|(i, p)| p.0.index() == i);
    let mesh = if plain {
        TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?
    } else {
        TriMesh::with_wedges(positions, pairs.iter().map(|p| p.0).collect(), triangles)?
    };
    Ok((mesh, pairs))
}

/// Sorts pairs of a vertex and a wedge: a counting sort by vertex, because a vertex has few wedges.
fn in_order(pairs: &[(VertexId, WedgeId)], vertices: usize) -> Vec<(VertexId, WedgeId)> {
    let mut at = vec![0u32; vertices + 1];
    for (v, _) in pairs {
        at[v.index() + 1] += 1;
    }
    for i in 0..vertices {
        at[i + 1] += at[i];
    }
    let mut sorted = vec![(NONE, WedgeId(0)); pairs.len()];
    for &pair in pairs {
        let at = &mut at[pair.0.index()];
        sorted[*at as usize] = pair;
        *at += 1;
    }
    // Now each entry is the end of its vertex's range.
    let mut begin = 0;
    for &end in &at[..vertices] {
        let own = &mut sorted[begin as usize..end as usize];
        if own.len() > 1 {
            own.sort_unstable();
        }
        begin = end;
    }
    sorted
}

/// Returns the wedges below `count` sorted by vertex, each with its vertex; those without a vertex are left
/// out.
fn by_place(count: usize, place: impl Fn(WedgeId) -> VertexId) -> Vec<(VertexId, WedgeId)> {
    let places: Vec<VertexId> = (0..count as u32).map(|w| place(WedgeId(w))).collect();
    let vertices = places.iter().filter(|&&v| v != NONE).map(|v| v.index() + 1).max().unwrap_or(0);
    // Wedges without a vertex are counted after the others.
    let slot = |v: VertexId| v.index().min(vertices);
    let mut at = vec![0u32; vertices + 2];
    for &v in &places {
        at[slot(v) + 1] += 1;
    }
    for i in 0..vertices {
        at[i + 1] += at[i];
    }
    let with_vertex = at[vertices] as usize;
    let mut order = vec![(NONE, WedgeId(0)); with_vertex];
    for (w, &v) in places.iter().enumerate().filter(|x| *x.1 != NONE) {
        let at = &mut at[v.index()];
        order[*at as usize] = (v, WedgeId(w as u32));
        *at += 1;
    }
    order
}

impl Column {
    /// Returns the values that all wedges have in common.
    fn constant_of(&self, all: &[f32], wedges: usize) -> Option<Vec<f32>> {
        let (mut first, mut other) = (vec![0.0; self.width], vec![0.0; self.width]);
        self.read(all, WedgeId(0), &mut first);
        let same = (1..wedges as u32).all(|w| {
            self.read(all, WedgeId(w), &mut other);
            first == other
        });
        (wedges > 0 && same).then_some(first)
    }
    /// Returns the values of a mesh, wedge after wedge; empty if it has none. `middles` has the mean joint
    /// position of each wedge.
    fn all<'a>(&self, mesh: &'a TriMesh, middles: &'a [[f32; 3]]) -> &'a [f32] {
        match &self.source {
            ColumnSource::Normals => mesh.normals().map_or(&[], <[_]>::as_flattened),
            ColumnSource::Uvs => mesh.uvs().map_or(&[], <[_]>::as_flattened),
            ColumnSource::Colors => mesh.colors().map_or(&[], <[_]>::as_flattened),
            ColumnSource::Middle => middles.as_flattened(),
            ColumnSource::Further(semantic) => {
                let own = mesh.further_attributes().iter().find(|a| self.is_of(a, semantic));
                own.map_or(&[], |a| &a.values)
            }
        }
    }
    fn is_of(&self, a: &Attribute, semantic: &Semantic) -> bool {
        a.semantic == *semantic && a.width == self.width
    }
    fn is_texture(&self) -> bool {
        matches!(self.source, ColumnSource::Uvs | ColumnSource::Further(Semantic::Uv(_))) && self.width == 2
    }
    fn is_direction(&self) -> bool {
        matches!(self.source, ColumnSource::Normals | ColumnSource::Further(Semantic::Tangent))
            && self.width >= 3
    }
    /// Returns true if it displaces vertices.
    fn is_movement(&self) -> bool {
        matches!(&self.source, ColumnSource::Further(Semantic::Morph { of: Morphed::Position, .. }))
    }
    fn is_shading(&self) -> bool {
        let morphed = [Morphed::Normal, Morphed::Tangent];
        self.is_direction()
            || matches!(&self.source, ColumnSource::Further(Semantic::Morph { of, .. }) if morphed.contains(of))
    }
    /// Reads the values of wedges, in this order, into rows of `width` values each.
    fn read_all(&self, all: &[f32], order: &[(VertexId, WedgeId)], width: usize, rows: &mut [f32]) {
        match self.width {
            2 => self.read_all_of::<2>(all, order, width, rows),
            3 => self.read_all_of::<3>(all, order, width, rows),
            _ => self.read_all_of::<0>(all, order, width, rows),
        }
    }
    /// Reads values like [`Self::read_all`], with a constant width for unrolled loops; 0 is any width.
    #[inline(always)]
    fn read_all_of<const N: usize>(
        &self,
        all: &[f32],
        order: &[(VertexId, WedgeId)],
        width: usize,
        rows: &mut [f32],
    ) {
        let n = if N == 0 { self.width } else { N };
        for (&(_, w), row) in order.iter().zip(rows.chunks_exact_mut(width)) {
            self.read_of(n, all, w, &mut row[self.offset..self.offset + n]);
        }
    }
    /// Reads the values of a wedge among [all](Self::all).
    fn read(&self, all: &[f32], w: WedgeId, out: &mut [f32]) {
        self.read_of(self.width, all, w, out);
    }
    #[inline(always)]
    fn read_of(&self, width: usize, all: &[f32], w: WedgeId, out: &mut [f32]) {
        if let Some(own) = all.get(w.index() * width..(w.index() + 1) * width) {
            // NaN and infinity cannot be blended.
            out.iter_mut().zip(own).for_each(|(to, x)| *to = if x.is_finite() { *x } else { 0.0 });
        }
        if self.is_direction() {
            if out[..3].iter().any(|x| x.abs() > MAX_ROW_VALUE) {
                let n = DVec3::from_slice(&[0, 1, 2].map(|k| f64::from(out[k])));
                out[..3].copy_from_slice(&(n / n.length()).as_vec3().to_array());
            }
        } else if self.divisor != 1.0 {
            out.iter_mut().for_each(|x| *x /= self.divisor);
        }
    }
    /// Finds the ranges and the largest of the values, and the divisor that limits them.
    fn bound(&mut self, all: &[f32]) {
        self.ranges = match self.is_direction() {
            true => vec![UNLIMITED_RANGE; self.width],
            false => ranges(all, self.width),
        };
        if self.constant.is_some() || self.is_direction() {
            self.largest = 1.0;
            return;
        }
        let finite = all.iter().map(|x| if x.is_finite() { x.abs() } else { 0.0 });
        self.largest = finite.fold(0.0, f32::max);
        while self.largest > MAX_ROW_VALUE {
            (self.largest, self.divisor) = (self.largest / 2.0, self.divisor * 2.0);
        }
    }
    /// Returns value `k` in the units of the mesh, clamped to its range there. All values that a run blends,
    /// fits or moves with a vertex pass through here.
    fn to_mesh_units(&self, k: usize, x: f32) -> f32 {
        within(x * self.divisor, self.ranges[k])
    }
}

fn unit(v: &[f32]) -> [f32; 3] {
    let n = Vec3::from_slice(&v[..3]);
    let length = n.length();
    if length > 1e-20 { (n / length).to_array() } else { n.to_array() }
}
