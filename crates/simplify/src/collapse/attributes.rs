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
mod slopes;
mod sum;

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};
use wide::f32x4;

use crate::lanes;
use crate::tensor::Tensor;
pub(super) use slopes::{FourSlopes, Slopes, SlopesRow};
pub(super) use sum::Sum;
use sum::add_outer;

/// Marks the absence of a wedge.
pub(super) const NO_WEDGE: WedgeId = WedgeId(u32::MAX);
/// Maximum number of wedges of a vertex that an evaluation visits, so that a vertex of very many charts
/// cannot stall a run.
const MAX_WEDGES_EVALUATED: usize = 24;
/// Maximum number of joints per wedge during a run. (More than any format has.)
const MAX_JOINTS: usize = 16;

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
    /// Label of each wedge: identifies its values of discrete attributes; empty if all wedges have the
    /// same.
    pub(crate) labels: Vec<u32>,
    pub(super) heads: Vec<Head>,
    /// Cached result of [`Self::spread`] for each wedge, if its head says so.
    reductions: Vec<Tensor>,
    /// Source wedges of the copied ones, which are the last.
    copied: Vec<WedgeId>,
    /// For each wedge its values, then their gradient sums along x, y and z: doubled area times gradient,
    /// summed over the current triangles; four times `lanes` vectors.
    rows: Vec<f32x4>,
}

/// State of some wedges, to be restored.
#[derive(Clone, Debug)]
pub(super) struct SavedWedges {
    wedges: Vec<WedgeId>,
    heads: Vec<Head>,
    reductions: Vec<Tensor>,
    rows: Vec<f32x4>,
    joint_weights: Vec<JointWeights>,
    labels: Vec<u32>,
    /// Number of all wedges, and of those that were copied from others.
    count: [usize; 2],
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
    /// True if its first or last face, in the order round its vertex, is bounded by a hard seam.
    pub(super) hard: [bool; 2],
    /// True if the cached tensor in `alone` is valid.
    pub(super) has_reduction: bool,
}

impl Default for Head {
    fn default() -> Self {
        Self { area: 0.0, faces: 0, next: NO_WEDGE, hard: [false; 2], has_reduction: false }
    }
}

/// A wedge at one of the ends of an edge. The wedges of a group are merged; one of them, the group's
/// representative, keeps its index, and its values if it is at a locked end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    pub(super) wedge: WedgeId,
    pub(super) at_v: bool,
    pub(super) group: usize,
}

/// The wedges of the evaluated edge, their best values, and the future sums of the merged ones.
#[derive(Clone, Default)]
pub(super) struct Merge {
    pub(super) members: Vec<Member>,
    pub(super) best: Vec<f32x4>,
    pub(super) own: Vec<f32x4>,
    pub(super) heads: Vec<Head>,
    /// Slopes of the current wings, if the cost of the merger was computed.
    pub(super) slopes: Vec<FourSlopes>,
}

/// Returns the representative of each group, with its index.
pub(super) fn representatives(members: &[Member]) -> impl Iterator<Item = (usize, &Member)> {
    members.iter().enumerate().filter(|(i, m)| m.group == *i)
}

fn of_group(members: &[Member], group: usize) -> impl Iterator<Item = &Member> {
    members.iter().filter(move |m| m.group == group)
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
        pulls: Vec<JointWeights>,
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
            joint_weights: pulls,
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
    /// Returns the values of a wedge for writing, padded with zeros.
    pub(crate) fn values_mut(&mut self, w: WedgeId) -> &mut [f32] {
        let at = w.index() * 4 * self.lanes;
        bytemuck::cast_slice_mut(&mut self.rows[at..at + self.lanes])
    }
    /// Returns the weights of squared errors of the values for writing; those beyond the width of a row do
    /// not matter.
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
    /// Iterates over a wedge and those that follow it at its vertex.
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
    /// Saves the state of these wedges; each may be listed several times.
    pub(super) fn save_wedges(&self, wedges: impl Iterator<Item = WedgeId>) -> SavedWedges {
        let mut is_new = vec![true; self.count()];
        let wedges: Vec<WedgeId> =
            wedges.filter(|w| std::mem::replace(&mut is_new[w.index()], false)).collect();
        let of = || wedges.iter().map(|w| w.index());
        SavedWedges {
            heads: of().map(|w| self.heads[w]).collect(),
            reductions: of().map(|w| self.reductions[w]).collect(),
            rows: wedges.iter().flat_map(|&w| self.row(w)).copied().collect(),
            joint_weights: of().filter_map(|w| self.joint_weights.get(w)).cloned().collect(),
            labels: of().filter_map(|w| self.labels.get(w)).copied().collect(),
            count: [self.count(), self.copied.len()],
            wedges,
        }
    }
    /// Restores saved wedges and removes those copied since.
    pub(super) fn restore_wedges(&mut self, kept: &SavedWedges) {
        let (n, [count, copied]) = (4 * self.lanes, kept.count);
        self.heads.truncate(count);
        self.reductions.truncate(count);
        self.rows.truncate(count * n);
        self.joint_weights.truncate(count);
        self.labels.truncate(count);
        self.copied.truncate(copied);
        for (i, w) in kept.wedges.iter().map(|w| w.index()).enumerate() {
            self.heads[w] = kept.heads[i];
            self.reductions[w] = kept.reductions[i];
            self.rows[w * n..][..n].copy_from_slice(&kept.rows[i * n..][..n]);
            if let Some(pulls) = kept.joint_weights.get(i) {
                self.joint_weights[w].clone_from(pulls);
            }
            if let Some(&label) = kept.labels.get(i) {
                self.labels[w] = label;
            }
        }
    }
    /// True if two wedges have the same data, to the bit.
    pub(super) fn is_same(&self, a: WedgeId, b: WedgeId) -> bool {
        let bits = |w: WedgeId| self.of(w).iter().map(|x| x.to_bits());
        let pulls = |w: WedgeId| self.joint_weights.get(w.index());
        let label = |w: WedgeId| self.labels.get(w.index());
        bits(a).eq(bits(b)) && pulls(a) == pulls(b) && label(a) == label(b)
    }

    /// Clears the sums of a wedge; `next` follows it at its vertex.
    pub(super) fn clear_sums(&mut self, w: WedgeId, next: WedgeId) {
        let (n, at) = (self.lanes, w.index() * 4 * self.lanes);
        self.rows[at + n..at + 4 * n].fill(f32x4::ZERO);
        let head = &mut self.heads[w.index()];
        *head = Head { next, hard: head.hard, ..Head::default() };
    }

    /// Returns the wedge of the input that a wedge is, or was copied from.
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
    /// first is the one that `s` is relative to.
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

    /// Returns the weighted squared errors of a triangle, in four lanes, at the point where the barycentric
    /// coordinates of its two other corners are `at` and the values are to be `best`. `lanes` is a
    /// parameter so that loops are unrolled.
    #[inline(always)]
    pub(super) fn error(
        &self,
        lanes: usize,
        corners: [WedgeId; 3],
        [la, lb]: [f32; 2],
        best: &[f32x4],
    ) -> f32x4 {
        let [o, a, b] = corners;
        let (o, a, b) = (self.row_of(lanes, o), self.row_of(lanes, a), self.row_of(lanes, b));
        let (weights, best) = (&self.weights[..lanes], &best[..lanes]);
        let mut sum = f32x4::ZERO;
        for i in 0..lanes {
            let error = (o[i] - best[i]) + (a[i] - o[i]) * la + (b[i] - o[i]) * lb;
            sum += error * error * weights[i];
        }
        sum
    }

    /// Borrows the tables that a merger changes, as slices, which stay in registers.
    #[inline(always)]
    pub(super) fn tables(&mut self) -> Tables<'_> {
        Tables { weights: &self.weights, heads: &mut self.heads, rows: &mut self.rows }
    }

    /// Sets the values, sums and head of a wedge.
    pub(super) fn set(&mut self, w: WedgeId, values: &[f32x4], sums: &[f32x4], head: Head) {
        let n = self.lanes;
        let row = &mut self.rows[w.index() * 4 * n..][..4 * n];
        row[..n].copy_from_slice(values);
        row[n..].copy_from_slice(sums);
        self.heads[w.index()] = head;
    }

    /// Updates the cached tensors of wedges, from one on along its chain.
    #[inline(always)]
    pub(super) fn cache_reductions(&mut self, mut w: WedgeId) {
        for _ in 0..MAX_WEDGES_EVALUATED {
            let Some(&Head { has_reduction: known, next, .. }) = self.heads.get(w.index()) else { return };
            if !known {
                self.reductions[w.index()] = self.reduction(w);
                self.heads[w.index()].has_reduction = true;
            }
            w = next;
        }
    }

    /// Invalidates all cached tensors of wedges: their weights have changed.
    pub(super) fn invalidate_reductions(&mut self) {
        self.heads.iter_mut().for_each(|h| h.has_reduction = false);
    }

    /// Returns the reduction of a vertex' tensor by the best values of its wedges, each taken alone.
    #[inline(always)]
    pub(super) fn reduction_of_vertex(&self, first: WedgeId) -> Tensor {
        let known = |w: WedgeId| match self.heads[w.index()].has_reduction {
            true => self.reductions[w.index()],
            false => self.reduction(w),
        };
        let (mut sum, mut next) = (known(first), self.heads[first.index()].next);
        for _ in 1..MAX_WEDGES_EVALUATED {
            let Some(head) = self.heads.get(next.index()) else { break };
            sum.add(&known(next));
            next = head.next;
        }
        sum
    }

    /// Returns the weighted squares of the mean gradients of a wedge, times its area: the reduction of the
    /// cost by its best value at another position.
    fn reduction(&self, w: WedgeId) -> Tensor {
        let per_area = 1.0 / self.heads[w.index()].area.max(1e-30);
        let [_, x, y, z] = self.parts(w);
        let mut sum = [f32x4::ZERO; 6];
        for (i, &weight) in self.weights.iter().enumerate() {
            let slope = [x[i], y[i], z[i]];
            add_outer(&mut sum, &slope.map(|s| s * (weight * per_area)), &slope);
        }
        Tensor(sum.map(f32x4::reduce_add))
    }

    /// Adds the cost of merging each group into one wedge; `d` leads from the kept to the removed end.
    pub(super) fn add_to(&self, members: &[Member], d: Vec3, sum: &mut Sum) {
        for (group, first) in representatives(members) {
            let mut others = members.iter().enumerate().filter(|(i, m)| m.group == group && *i != group);
            match (others.next(), others.next()) {
                (None, _) => {}
                (Some((_, other)), None) if !first.at_v && other.at_v => {
                    self.add_pair_to(self.lanes, [first.wedge, other.wedge], d, sum);
                }
                _ => self.add_group_to(members, group, d, sum),
            }
        }
    }

    /// Adds the cost of a group with several wedges of either end: the spread of their best values about
    /// their mean.
    fn add_group_to(&self, members: &[Member], group: usize, d: Vec3, sum: &mut Sum) {
        let base = self.values(members[group].wedge);
        let area = |m: &Member| self.heads[m.wedge.index()].area.max(1e-30);
        let all: f32 = of_group(members, group).map(area).sum();
        for (i, &weight) in self.weights.iter().enumerate() {
            // The best value of one wedge: the value at the kept end, and its slope.
            let line = |m: &Member| {
                let ([values, x, y, z], per_area) = (self.parts(m.wedge), 1.0 / area(m));
                let slope = [x[i], y[i], z[i]].map(|s| s * per_area);
                let back = if m.at_v { dot(&slope, d) } else { f32x4::ZERO };
                (values[i] - base[i] - back, slope)
            };
            let (mut value, mut slope) = (f32x4::ZERO, [f32x4::ZERO; 3]);
            for m in of_group(members, group) {
                let (share, (own, slopes)) = (area(m) / all, line(m));
                value += own * share;
                (0..3).for_each(|k| slope[k] += slopes[k] * share);
            }
            for m in of_group(members, group) {
                let (own, slopes) = line(m);
                let off = [0, 1, 2].map(|k| slope[k] - slopes[k]);
                sum.add_square(&off, own - value, weight * area(m));
            }
        }
    }

    /// Adds the cost of a group with one wedge at each end, as on all edges that touch no seam. `lanes` is
    /// a parameter so that loops are unrolled.
    #[inline(always)]
    pub(super) fn add_pair_to(&self, lanes: usize, [u, v]: [WedgeId; 2], d: Vec3, sum: &mut Sum) {
        let [area_u, area_v] = [u, v].map(|w| self.heads[w.index()].area.max(1e-30));
        let (per_u, per_v) = (1.0 / area_u, 1.0 / area_v);
        let both = area_u * (area_v / (area_u + area_v));
        let (own, other) = (self.row_of(lanes, u), self.row_of(lanes, v));
        for i in 0..lanes {
            let (j, k, l) = (lanes + i, 2 * lanes + i, 3 * lanes + i);
            let slope = [other[j] * per_v, other[k] * per_v, other[l] * per_v];
            let off = [own[j] * per_u - slope[0], own[k] * per_u - slope[1], own[l] * per_u - slope[2]];
            sum.add_square(&off, other[i] - own[i] - dot(&slope, d), self.weights[i] * both);
        }
    }

    /// Adds the attribute cost to the forms of up to four edges side by side, with one wedge at each end:
    /// `own` at the common end, `others` at the far ones. `lanes` is a parameter so that loops are
    /// unrolled.
    #[inline(always)]
    pub(super) fn add_four_to(
        &self,
        lanes: usize,
        own: WedgeId,
        others: [WedgeId; 4],
        d: &[f32x4; 3],
        (a, h, c): (&mut [f32x4; 6], &mut [f32x4; 3], &mut f32x4),
    ) {
        let area = f32x4::new(others.map(|w| self.heads[w.index()].area));
        let per_area = f32x4::ONE / (area + self.heads[own.index()].area).fast_max(f32x4::splat(1e-30));
        let [p, q, r, s] = others;
        let (p, q) = (self.row_of(lanes, p), self.row_of(lanes, q));
        let (r, s) = (self.row_of(lanes, r), self.row_of(lanes, s));
        let own = self.row_of(lanes, own);
        for lane in 0..lanes {
            let (i, j, k, l) = (lane, lanes + lane, 2 * lanes + lane, 3 * lanes + lane);
            let values = f32x4::transpose([p[i], q[i], r[i], s[i]]);
            let x = f32x4::transpose([p[j], q[j], r[j], s[j]]);
            let y = f32x4::transpose([p[k], q[k], r[k], s[k]]);
            let z = f32x4::transpose([p[l], q[l], r[l], s[l]]);
            let (s, ux, uy, uz) =
                (own[i].to_array(), own[j].to_array(), own[k].to_array(), own[l].to_array());
            for (i, weight) in self.weights[lane].to_array().into_iter().enumerate() {
                if weight == 0.0 {
                    continue;
                }
                let off = values[i] - f32x4::splat(s[i]);
                let slope = [x[i], y[i], z[i]];
                let along = slope[0] * d[0] + slope[1] * d[1] + slope[2] * d[2];
                let b = [slope[0] + ux[i], slope[1] + uy[i], slope[2] + uz[i]];
                let c0 = area * off - along;
                let scale = per_area * weight;
                let scaled = b.map(|b| b * scale);
                add_outer(a, &scaled.map(|x| -x), &b);
                for k in 0..3 {
                    h[k] += scaled[k] * c0 - slope[k] * off * weight;
                }
                *c += off * (area * off - along * 2.0) * weight - c0 * c0 * scale;
            }
        }
    }

    /// Computes the best values of each group, at the offset of its representative, if the vertex moves to
    /// the kept end + `y`.
    #[inline(always)]
    pub(super) fn best<const N: usize>(&self, members: &[Member], d: Vec3, y: Vec3, out: &mut [f32x4]) {
        let lanes = self.lanes_of::<N>();
        for (group, first) in representatives(members) {
            let out = &mut out[group * lanes..][..lanes];
            out.fill(f32x4::ZERO);
            let base = self.row_of(lanes, first.wedge);
            let mut area = 0.0;
            for m in of_group(members, group) {
                let own = self.heads[m.wedge.index()].area;
                let at = if m.at_v { y - d } else { y };
                let row = self.row_of(lanes, m.wedge);
                area += own;
                for (i, sum) in out.iter_mut().enumerate() {
                    // Relative to the first wedge's values, so that constant values stay exact.
                    *sum += (row[i] - base[i]) * own;
                    *sum += dot(&[row[lanes + i], row[2 * lanes + i], row[3 * lanes + i]], at);
                }
            }
            let per_area = if area > 1e-30 { 1.0 / area } else { 0.0 };
            out.iter_mut().zip(base).for_each(|(best, base)| *best = *base + *best * per_area);
        }
    }

    /// Normalizes the directions among some values.
    pub(super) fn normalize(&self, values: &mut [f32x4]) {
        normalize(&self.directions, values);
    }

    /// Returns the label of the merged wedge of a group, `t` of the way from the kept end to the other:
    /// that of a wedge at the nearer end, and among several there of the one with the largest area.
    pub(super) fn nearest_label(&self, members: &[Member], group: usize, t: f32) -> u32 {
        let area = |m: &Member| self.heads[m.wedge.index()].area;
        let mut nearest: Option<&Member> = None;
        for m in of_group(members, group) {
            let is_nearer = |known: &Member| match m.at_v == known.at_v {
                true => area(m) > area(known),
                false => m.at_v == (t > 0.5),
            };
            if nearest.is_none_or(is_nearer) {
                nearest = Some(m);
            }
        }
        nearest.map_or(0, |m| self.labels[m.wedge.index()])
    }

    pub(super) fn blended_joint_weights(&self, members: &[Member], group: usize, t: f32) -> JointWeights {
        let mut sum: JointWeights = Vec::new();
        let count = |at_v| of_group(members, group).filter(|m| m.at_v == at_v).count();
        let counts = [count(false), count(true)];
        for m in of_group(members, group) {
            // A group with wedges of only one end takes all from it.
            let share = match (counts, m.at_v) {
                ([_, 0], _) | ([0, _], _) => 1.0,
                (_, true) => t,
                (_, false) => 1.0 - t,
            } / counts[usize::from(m.at_v)] as f32;
            for &(joint, weight) in &self.joint_weights[m.wedge.index()] {
                match sum.iter_mut().find(|p| p.0 == joint) {
                    Some(p) => p.1 += weight * share,
                    None => sum.push((joint, weight * share)),
                }
            }
        }
        sum.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        sum.truncate(MAX_JOINTS);
        sum
    }
}

/// Mutable view of the data of all wedges.
pub(super) struct Tables<'a> {
    weights: &'a [f32x4],
    pub(super) heads: &'a mut [Head],
    rows: &'a mut [f32x4],
}

impl Tables<'_> {
    /// Removes a wedge from the chain that begins with `first`.
    pub(super) fn unlink(&mut self, first: &mut WedgeId, wedge: WedgeId) {
        let next = self.heads[wedge.index()].next;
        if *first == wedge {
            *first = next;
            return;
        }
        let mut before = *first;
        while let Some(head) = self.heads.get_mut(before.index()) {
            if head.next == wedge {
                head.next = next;
                return;
            }
            before = head.next;
        }
    }

    /// Subtracts the contribution of a triangle, with wedge `o` at its first corner and slopes `old`, from
    /// the sums of its two other wedges. If the triangle stays, adds it again with the `new` slopes and
    /// values of the moved corner. Its contribution to the merged wedge's own sums is added to `own`, that
    /// to the tensor of its vertex to `added`. Returns the change of the tensors of the two other vertices,
    /// in four lanes. `lanes` is a parameter so that loops are unrolled.
    #[inline(always)]
    pub(super) fn replace(
        &mut self,
        lanes: usize,
        (old, o): (&SlopesRow, WedgeId),
        new: Option<(&SlopesRow, &[f32x4])>,
        [a, b]: [WedgeId; 2],
        own: &mut [f32x4],
        added: &mut [f32x4; 6],
    ) -> [f32x4; 6] {
        let (at_a, at_b) = (a.index() * 4 * lanes, b.index() * 4 * lanes);
        let own = &mut own[..3 * lanes];
        let mut sums = [f32x4::ZERO; 6];
        for i in 0..lanes {
            let weight = self.weights[i];
            let o = self.rows[o.index() * 4 * lanes + i];
            let (a, b) = (self.rows[at_a + i], self.rows[at_b + i]);
            let mut gain = [f32x4::ZERO; 3];
            if let Some((s, values)) = new {
                gain = s.gain((a - values[i]) * s.area(), (b - values[i]) * s.area());
                let square = lanes::outer(&gain, weight * s.per_area());
                for k in 0..6 {
                    sums[k] += square[k];
                    added[k] += square[k];
                }
                for k in 0..3 {
                    own[k * lanes + i] += gain[k];
                }
            }
            let loss = old.gain((a - o) * old.area(), (b - o) * old.area());
            let square = lanes::outer(&loss, weight * old.per_area());
            for k in 0..6 {
                sums[k] -= square[k];
            }
            for at in [at_a, at_b] {
                let row = &mut self.rows[at..][..4 * lanes];
                for k in 0..3 {
                    row[(k + 1) * lanes + i] += gain[k] - loss[k];
                }
            }
        }
        let area = new.map_or(0.0, |x| x.0.area()) - old.area();
        for w in [a, b] {
            let head = &mut self.heads[w.index()];
            (head.area, head.has_reduction) = (head.area + area, false);
            head.faces -= u32::from(new.is_none());
        }
        sums
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
    fn copies_of_copies_name_the_wedge_of_the_input() {
        let mut attributes = Attributes::new(3, 1, Vec::new(), Vec::new(), &[0.0, 1.0, 2.0], Vec::new());
        let copy = attributes.copy_of(WedgeId(2));
        let again = attributes.copy_of(copy);
        let last = attributes.copy_of(again);
        assert_eq!([copy, again, last].map(|w| attributes.original(w)), [WedgeId(2); 3]);
        assert_eq!(attributes.of(last)[0], 2.0);
    }
}
