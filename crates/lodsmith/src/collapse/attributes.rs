//! Attributes of wedges: their cost in a collapse, as a quadratic form in the position of the merged
//! vertex.
//!
//! Over a triangle a value is linear. The attribute cost of a collapse is the integral of (g·x + s − s')²
//! over the current star, with the gradient g taken from the current triangles: memoryless, like the
//! positions, in the form of [Hoppe 1999]. For each wedge only its area and its sum of area · g are stored;
//! the sum of area · g gᵀ is added to the star tensor of its vertex. The best value of the merged wedge is
//! a quotient, and the remaining cost is a form in the position.
//!
//! Values are stored four side by side, for SIMD.

mod check;
mod cost;
mod merge;
mod moved;
mod saved;
mod slopes;
mod sum;

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};
use wide::f32x4;

use crate::cost::lanes;
use crate::cost::tensor::Tensor;
pub(crate) use merge::Member;
pub(super) use merge::{Merge, representatives};
pub(super) use saved::SavedWedges;
pub(super) use slopes::{FourSlopes, Slopes};
pub(super) use sum::Sum;

/// Marks the absence of a wedge.
pub(super) const NO_WEDGE: WedgeId = WedgeId(u32::MAX);
/// Live attributes of a run.
#[derive(Clone, Debug)]
pub(crate) struct Attributes {
    /// Vectors of four lanes that hold the values of a wedge; lanes without a value are zero.
    lanes: usize,
    /// Weight of the squared error of each value in the cost, per area, in the unit frame.
    weights: Vec<f32x4>,
    /// Offsets of the unit vectors among the values.
    pub(crate) directions: Vec<usize>,
    /// Offsets of the pairs of texture coordinates among the values.
    pub(crate) textures: Vec<usize>,
    /// Joints of each wedge, with their weights; empty without a skin.
    pub(crate) joint_weights: Vec<JointWeights>,
    /// Label of each wedge: identifies its values of discrete attributes; empty if all wedges have the same
    /// label.
    pub(crate) labels: Vec<u32>,
    pub(super) heads: Vec<Head>,
    /// Cached result of [`Self::reduction`] for each wedge; valid if its head says so.
    reductions: Vec<Tensor>,
    /// Original wedges of the copied ones, which come last.
    copied: Vec<WedgeId>,
    /// For each wedge its values, then their gradient sums along x, y and z: doubled area times gradient,
    /// summed over the current triangles; four times `lanes` vectors.
    rows: Vec<f32x4>,
}

/// Joints and weights, the strongest first.
pub(crate) type JointWeights = Vec<(u32, f32)>;

/// Data of a wedge apart from its row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Doubled area of its current triangles.
    pub(super) area: f32,
    /// Number of its current triangles.
    pub(super) faces: u32,
    /// The next wedge of its vertex, or [`NO_WEDGE`].
    pub(super) next: WedgeId,
    /// True if its first or last face, in the order around its vertex, is bounded by a hard seam.
    pub(super) hard: [bool; 2],
    /// True if the cached tensor in `alone` is valid.
    pub(super) has_reduction: bool,
}

impl Default for Head {
    fn default() -> Self {
        Self { area: 0.0, faces: 0, next: NO_WEDGE, hard: [false; 2], has_reduction: false }
    }
}

impl Attributes {
    /// Creates the attributes of `count` wedges from rows of `width` values, none of which counts in the
    /// cost yet.
    pub(crate) fn new(
        count: usize,
        width: usize,
        directions: Vec<usize>,
        textures: Vec<usize>,
        values: &[f32],
        joint_weights: Vec<JointWeights>,
    ) -> Self {
        let lanes = width.div_ceil(4);
        let mut rows = vec![f32x4::ZERO; count * 4 * lanes];
        if lanes > 0 {
            for (row, values) in rows.chunks_exact_mut(4 * lanes).zip(values.chunks_exact(width)) {
                bytemuck::cast_slice_mut::<f32x4, f32>(row)[..width].copy_from_slice(values);
            }
        }
        let heads = vec![Head::default(); count];
        Self {
            lanes,
            weights: vec![f32x4::ZERO; lanes],
            directions,
            textures,
            joint_weights,
            labels: Vec::new(),
            heads,
            reductions: vec![Tensor::default(); count],
            copied: Vec::new(),
            rows,
        }
    }
    /// True if the wedges carry no data.
    pub(crate) fn is_empty(&self) -> bool {
        self.lanes == 0 && self.joint_weights.is_empty() && self.labels.is_empty()
    }
    /// True if any value counts in the cost.
    pub(super) fn counts(&self) -> bool {
        self.weights.iter().any(|w| w.to_array() != [0.0; 4])
    }
    /// Returns the values of a wedge, padded with zeros.
    pub(crate) fn of(&self, w: WedgeId) -> &[f32] {
        bytemuck::cast_slice(self.values(w))
    }
    /// Returns the values of a wedge, mutable, padded with zeros.
    pub(crate) fn values_mut(&mut self, w: WedgeId) -> &mut [f32] {
        let at = w.index() * 4 * self.lanes;
        bytemuck::cast_slice_mut(&mut self.rows[at..at + self.lanes])
    }
    /// Returns the weights of squared errors of the values, mutable; weights beyond the width of a row do not
    /// matter.
    pub(crate) fn weights_mut(&mut self) -> &mut [f32] {
        bytemuck::cast_slice_mut(&mut self.weights)
    }
    /// Returns the number of vectors of four in the values of a wedge.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> usize {
        self.lanes
    }
    /// Returns `N`, or [`Self::lanes`] if that is 0: a constant lets loops be unrolled.
    #[inline(always)]
    pub(super) fn lanes_of<const N: usize>(&self) -> usize {
        if N == 0 { self.lanes } else { N }
    }
    /// Returns the weights of the squared errors of four values.
    #[inline(always)]
    pub(crate) fn weight(&self, lane: usize) -> f32x4 {
        self.weights[lane]
    }
    /// Returns the number of wedges, including removed ones.
    pub(crate) fn count(&self) -> usize {
        self.heads.len()
    }
    /// Returns the values of all wedges.
    pub(crate) fn all_values(&self) -> Vec<f32x4> {
        (0..self.count() as u32).flat_map(|w| self.values(WedgeId(w))).copied().collect()
    }
    /// Changes the values of a wedge, and extrapolates them along their gradients as its vertex moves;
    /// directions stay unit vectors.
    pub(crate) fn shift(&mut self, w: WedgeId, by: &[f32x4], moved: Vec3) {
        let (n, at) = (self.lanes, w.index() * 4 * self.lanes);
        let moved = moved / self.heads[w.index()].area.max(1e-30);
        for (i, by) in by.iter().enumerate() {
            let gain = [1, 2, 3].map(|part| self.rows[at + part * n + i]);
            self.rows[at + i] += *by + dot(&gain, moved);
        }
        normalize(&self.directions, &mut self.rows[at..][..n]);
    }
    #[inline(always)]
    fn row(&self, w: WedgeId) -> &[f32x4] {
        self.row_of(self.lanes, w)
    }
    /// Returns the row of a wedge for a known number of lanes.
    #[inline(always)]
    fn row_of(&self, lanes: usize, w: WedgeId) -> &[f32x4] {
        &self.rows[w.index() * 4 * lanes..][..4 * lanes]
    }
    #[inline(always)]
    pub(crate) fn values(&self, w: WedgeId) -> &[f32x4] {
        self.values_of(self.lanes, w)
    }
    /// Returns the values of a wedge for a known number of lanes.
    #[inline(always)]
    pub(crate) fn values_of(&self, lanes: usize, w: WedgeId) -> &[f32x4] {
        &self.rows[w.index() * 4 * lanes..][..lanes]
    }
    /// Returns the row of a wedge: values, and gradient sums along x, y and z.
    #[inline(always)]
    fn parts(&self, w: WedgeId) -> [&[f32x4]; 4] {
        let (values, rest) = self.row(w).split_at(self.lanes);
        let (x, rest) = rest.split_at(self.lanes);
        let (y, z) = rest.split_at(self.lanes);
        [values, x, y, z]
    }
    /// True if a wedge is the only one of its vertex.
    #[inline(always)]
    pub(super) fn is_only_wedge(&self, w: WedgeId) -> bool {
        self.heads.get(w.index()).is_some_and(|h| h.next == NO_WEDGE)
    }
    /// Returns the squared distance of two wedges in the texture.
    pub(super) fn uv_distance_sq(&self, a: WedgeId, b: WedgeId) -> f32 {
        let (a, b) = (self.of(a), self.of(b));
        let apart = |&i: &usize| (a[i] - b[i]).powi(2) + (a[i + 1] - b[i + 1]).powi(2);
        self.textures.iter().map(apart).fold(0.0, f32::max)
    }
    /// Returns the squared length of the longest side of a face in the texture.
    pub(super) fn uv_extent_sq(&self, [a, b, c]: [WedgeId; 3]) -> f32 {
        self.uv_distance_sq(a, b).max(self.uv_distance_sq(b, c)).max(self.uv_distance_sq(c, a))
    }
    /// Iterates over a wedge and the wedges after it at its vertex.
    pub(super) fn chain(&self, first: WedgeId) -> impl Iterator<Item = WedgeId> + '_ {
        let known = move |w: WedgeId| (w != NO_WEDGE).then_some(w);
        std::iter::successors(known(first), move |w| known(self.heads[w.index()].next))
    }

    /// Adds a copy of a wedge with the same values, without triangles yet.
    pub(crate) fn copy_of(&mut self, w: WedgeId) -> WedgeId {
        let (copy, n) = (WedgeId(self.heads.len() as u32), 4 * self.lanes);
        let original = self.original(w);
        self.rows.extend_from_within(w.index() * n..(w.index() + 1) * n);
        let at = copy.index() * n;
        self.rows[at + self.lanes..].fill(f32x4::ZERO);
        if !self.joint_weights.is_empty() {
            self.joint_weights.push(self.joint_weights[w.index()].clone());
        }
        if let Some(&label) = self.labels.get(w.index()) {
            self.labels.push(label);
        }
        self.heads.push(Head { hard: self.heads[w.index()].hard, ..Head::default() });
        self.reductions.push(Tensor::default());
        self.copied.push(original);
        copy
    }
    /// True if two wedges have the same data, bit for bit.
    pub(super) fn is_same(&self, a: WedgeId, b: WedgeId) -> bool {
        let bits = |w: WedgeId| self.of(w).iter().map(|x| x.to_bits());
        let joint_weights = |w: WedgeId| self.joint_weights.get(w.index());
        let label = |w: WedgeId| self.labels.get(w.index());
        bits(a).eq(bits(b)) && joint_weights(a) == joint_weights(b) && label(a) == label(b)
    }

    /// Clears the sums of a wedge; `next` follows it at its vertex.
    pub(super) fn clear_sums(&mut self, w: WedgeId, next: WedgeId) {
        let (n, at) = (self.lanes, w.index() * 4 * self.lanes);
        self.rows[at + n..at + 4 * n].fill(f32x4::ZERO);
        let head = &mut self.heads[w.index()];
        *head = Head { next, hard: head.hard, ..Head::default() };
    }

    /// Returns a wedge itself if it is from the input, else the wedge of the input that it was copied from.
    pub(crate) fn original(&self, w: WedgeId) -> WedgeId {
        let given = self.heads.len() - self.copied.len();
        w.index().checked_sub(given).map_or(w, |i| self.copied[i])
    }

    /// Returns the mean square over the surface of the gradient of each value. Of many triangles every n-th
    /// is sampled.
    pub(crate) fn mean_square_gradients(
        &self,
        faces: &[[VertexId; 3]],
        wedges: &[[WedgeId; 3]],
        points: &[Vec3],
    ) -> Vec<f64> {
        /// Minimum number of sampled triangles of large meshes. (Guessed.)
        const MIN_GRADIENT_SAMPLES: usize = 8192;
        let mut sums = vec![[0f64; 4]; self.lanes];
        let mut area = 0f64;
        let step = (faces.len() / MIN_GRADIENT_SAMPLES).max(1);
        let looks: Vec<usize> = (0..faces.len()).step_by(step).collect();
        for few in looks.chunks(4) {
            let four = [0, 1, 2, 3].map(|i: usize| faces[few[i.min(few.len() - 1)]]);
            let corners = [0, 1, 2].map(|k| lanes::four(four.map(|t| points[t[k].index()])));
            let slopes = FourSlopes::of(corners.each_ref());
            for (i, &face) in few.iter().enumerate() {
                let s = slopes.one(i);
                area += f64::from(s.area);
                let [o, a, b] = wedges[face];
                let (o, a, b) = (self.values(o), self.values(a), self.values(b));
                for (i, sums) in sums.iter_mut().enumerate() {
                    let (a, b) = (a[i] - o[i], b[i] - o[i]);
                    let gradient = [a * s.a.x + b * s.b.x, a * s.a.y + b * s.b.y, a * s.a.z + b * s.b.z];
                    let square = (lanes::dot(&gradient, &gradient) * s.area).to_array();
                    for k in 0..4 {
                        sums[k] += f64::from(square[k]);
                    }
                }
            }
        }
        sums.as_flattened().iter().map(|x| x / area.max(f64::MIN_POSITIVE)).collect()
    }

    /// Returns the contribution of a triangle to the tensor of each of its corners, from their values; the
    /// first is the corner that `s` is relative to.
    #[inline(always)]
    pub(super) fn tensor(&self, lanes: usize, s: &Slopes, [o, a, b]: [&[f32x4]; 3]) -> Tensor {
        let (mut aa, mut ab, mut bb) = (f32x4::ZERO, f32x4::ZERO, f32x4::ZERO);
        for i in 0..lanes {
            let weight = self.weights[i];
            let (a, b) = (a[i] - o[i], b[i] - o[i]);
            let (wa, wb) = (a * weight, b * weight);
            (aa, ab, bb) = (aa + wa * a, ab + wa * b, bb + wb * b);
        }
        s.tensor(aa.reduce_add(), ab.reduce_add(), bb.reduce_add())
    }

    /// Adds a triangle to the sums of its three wedges, whose faces are counted already. Returns its
    /// contribution to the tensors of its vertices.
    pub(super) fn add_triangle(&mut self, s: &Slopes, wedges: [WedgeId; 3]) -> Tensor {
        match self.lanes {
            1 => self.add_triangle_lanes::<1>(s, wedges),
            2 => self.add_triangle_lanes::<2>(s, wedges),
            _ => self.add_triangle_lanes::<0>(s, wedges),
        }
    }

    #[inline(always)]
    fn add_triangle_lanes<const N: usize>(&mut self, s: &Slopes, wedges: [WedgeId; 3]) -> Tensor {
        let n = self.lanes_of::<N>();
        let [o, a, b] = wedges;
        let tensor = self.tensor(n, s, [self.row_of(n, o), self.row_of(n, a), self.row_of(n, b)]);
        for i in 0..n {
            let (o, a, b) = (self.row_of(n, o)[i], self.row_of(n, a)[i], self.row_of(n, b)[i]);
            let (a, b) = ((a - o) * s.area, (b - o) * s.area);
            for w in wedges {
                let row = &mut self.rows[w.index() * 4 * n..][..4 * n];
                for k in 0..3 {
                    row[(k + 1) * n + i] += a * s.a[k] + b * s.b[k];
                }
            }
        }
        for w in wedges {
            let head = &mut self.heads[w.index()];
            (head.area, head.has_reduction) = (head.area + s.area, false);
        }
        tensor
    }

    /// Recomputes the sums of the wedges of these triangles.
    pub(crate) fn recompute_sums(&mut self, triangles: &[([Vec3; 3], [WedgeId; 3])]) {
        for w in triangles.iter().flat_map(|t| t.1) {
            self.clear_sums(w, NO_WEDGE);
        }
        for (points, wedges) in triangles {
            self.add_triangle(&Slopes::new(*points), *wedges);
        }
    }

    /// Adds a triangle to the sums and the count of the wedge at the corner that `s` is relative to.
    pub(super) fn add_triangle_to_first(&mut self, s: &Slopes, wedges: [WedgeId; 3]) {
        let n = self.lanes;
        let [at_o, at_a, at_b] = wedges.map(|w| w.index() * 4 * n);
        for i in 0..n {
            let o = self.rows[at_o + i];
            let (a, b) = ((self.rows[at_a + i] - o) * s.area, (self.rows[at_b + i] - o) * s.area);
            for k in 0..3 {
                self.rows[at_o + (k + 1) * n + i] += a * s.a[k] + b * s.b[k];
            }
        }
        let head = &mut self.heads[wedges[0].index()];
        (head.area, head.faces, head.has_reduction) = (head.area + s.area, head.faces + 1, false);
    }

    /// Sets the values, sums and head of a wedge.
    pub(super) fn set(&mut self, w: WedgeId, values: &[f32x4], sums: &[f32x4], head: Head) {
        let n = self.lanes;
        let row = &mut self.rows[w.index() * 4 * n..][..4 * n];
        row[..n].copy_from_slice(values);
        row[n..].copy_from_slice(sums);
        self.heads[w.index()] = head;
    }

    /// Normalizes the directions among some values.
    pub(super) fn normalize(&self, values: &mut [f32x4]) {
        normalize(&self.directions, values);
    }
}

fn normalize(directions: &[usize], values: &mut [f32x4]) {
    let values: &mut [f32] = bytemuck::cast_slice_mut(values);
    for &at in directions {
        let n = Vec3::from_slice(&values[at..at + 3]);
        let length = n.length();
        if length > 1e-6 {
            values[at..at + 3].copy_from_slice(&(n / length).to_array());
        }
    }
}

#[inline(always)]
fn dot(v: &[f32x4; 3], d: Vec3) -> f32x4 {
    v[0] * d.x + v[1] * d.y + v[2] * d.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_copies_refer_to_the_wedge_of_the_input() {
        let mut attributes = Attributes::new(3, 1, Vec::new(), Vec::new(), &[0.0, 1.0, 2.0], Vec::new());
        let copy = attributes.copy_of(WedgeId(2));
        let again = attributes.copy_of(copy);
        let last = attributes.copy_of(again);
        assert_eq!([copy, again, last].map(|w| attributes.original(w)), [WedgeId(2); 3]);
        assert_eq!(attributes.of(last)[0], 2.0);
    }
}
