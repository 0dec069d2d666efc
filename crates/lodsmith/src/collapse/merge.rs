//! Merging of wedges in collapses: which wedges are merged, the cost of that, and the change itself.
//!
//! The triangles on the edge determine which wedges are merged: the two wedges that such a triangle has at
//! the ends. A wedge in no such triangle stays separate, on its own side of the seam.

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};
use wide::f32x4;

use super::LiveMesh;
use super::attributes::{
    Attributes, FourSlopes, Head, Member, Merge, NO_WEDGE, Slopes, Sum, representatives,
};
use super::ring::{Ring, Spoke};
use super::store::Store;
use super::vertex::{self, Vertex};
use super::wings::{FourWings, Wings};
use crate::cost::lanes::{self, dot, splat};
use crate::cost::metric::{CostSource, Form, Metric};
use crate::cost::tensor::Tensor;

/// Calls a function that is generic over the number of lanes: a constant for one or two, 0 for any other
/// number.
macro_rules! of_lanes {
    ($lanes:expr, $n:ident => $call:expr) => {
        match $lanes {
            1 => {
                const $n: usize = 1;
                $call
            }
            2 => {
                const $n: usize = 2;
                $call
            }
            _ => {
                const $n: usize = 0;
                $call
            }
        }
    };
}

impl<M: Metric> LiveMesh<M> {
    /// Builds the chains of wedges of all vertices.
    pub(super) fn chain_wedges(&mut self) {
        if let Some(data) = &mut self.values.wedge_data {
            data.find_split(&self.store);
        }
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &self.store.wedges) else {
            return;
        };
        attributes.heads.fill(Head::default());
        self.store.first_wedge = vec![NO_WEDGE; self.store.v.len()];
        for (v, w) in self.store.t.as_flattened().iter().zip(wedges.as_flattened()) {
            let head = &mut attributes.heads[w.index()];
            if head.faces == 0 {
                head.next = std::mem::replace(&mut self.store.first_wedge[v.index()], *w);
            }
            head.faces += 1;
        }
    }

    /// True if no edge of a star can be a seam, by a quick test that covers most stars.
    pub(super) fn is_far_from_seams(&self, ring: &[Spoke], u: VertexId) -> bool {
        self.is_among_single_wedges(u, ring.iter().flat_map(|r| [r.a, r.b]))
            && !self.store.meets_regions(ring)
            && !self.store.meets_creases(ring)
    }

    /// True if no edge of a star can be a seam, for a mesh without regions and sharp edges.
    #[inline(always)]
    pub(super) fn is_inside_one_chart(&self, u: VertexId, around: impl Iterator<Item = VertexId>) -> bool {
        self.store.regions.is_none() && self.store.creases.is_none() && self.is_among_single_wedges(u, around)
    }

    /// True if a vertex and its neighbours have one wedge each.
    #[inline(always)]
    fn is_among_single_wedges(&self, u: VertexId, mut around: impl Iterator<Item = VertexId>) -> bool {
        if let Some(is_split) = self.split_vertices() {
            let is_whole = |w: VertexId| !is_split[self.store.v[w.index()].origin.index()];
            return is_whole(u) && around.all(is_whole);
        }
        let Some(attributes) = &self.values.attributes else { return false };
        let is_alone = |w: VertexId| attributes.is_only_wedge(self.store.first_wedge[w.index()]);
        is_alone(u) && around.all(is_alone)
    }

    /// Computes the sums of all wedges, and adds the attribute tensors to the tensors of the vertices.
    pub(super) fn init_attribute_sums(&mut self) {
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &self.store.wedges) else {
            return;
        };
        for (t, w) in self.store.t.chunks(4).zip(wedges.chunks(4)) {
            let corner = |k: usize| {
                let of = |i: usize| t[i.min(t.len() - 1)][k];
                vertex::four(&self.store.v, [of(0), of(1), of(2), of(3)])
            };
            let slopes = FourSlopes::of([&corner(0), &corner(1), &corner(2)]);
            for (i, (t, w)) in t.iter().zip(w).enumerate() {
                let sum = attributes.add_triangle(&slopes.one(i), *w);
                for v in t {
                    M::tensor(&mut self.store.v[v.index()].q).add(&sum);
                }
            }
        }
    }

    /// Returns the attribute tensor of a vertex.
    pub(super) fn attribute_tensor(&self, u: VertexId, ring: &[Spoke]) -> Tensor {
        let mut tensor = Tensor::default();
        let (Some(attributes), Some(wedges)) = (&self.values.attributes, &self.store.wedges) else {
            return tensor;
        };
        for r in ring {
            let s = Slopes::new([self.store.p(u), self.store.p(r.a), self.store.p(r.b)]);
            let corners = from_corner(wedges[r.corner.face()], r.corner.k());
            tensor.add(&attributes.tensor(attributes.lanes(), &s, corners.map(|w| attributes.values(w))));
        }
        tensor
    }

    /// Returns the attributes if they count in the forms of edges.
    #[inline(always)]
    fn counted_attributes(&self) -> Option<&Attributes> {
        self.values
            .attributes
            .as_ref()
            .filter(|a| a.lanes() > 0 && matches!(self.cost.metric.cost_source(), CostSource::Engine))
    }

    /// True if each of these has only one wedge.
    #[inline(always)]
    pub(super) fn have_single_wedges(&self, u: VertexId, others: &[VertexId]) -> bool {
        let Some(attributes) = &self.values.attributes else { return true };
        let is_alone = |w: VertexId| attributes.is_only_wedge(self.store.first_wedge[w.index()]);
        is_alone(u) && others.iter().all(|&w| is_alone(w))
    }

    /// Updates the cached tensors of the wedges of a vertex, and of some of its neighbours, if they are
    /// needed. Returns true if each of them has only one wedge.
    #[inline(always)]
    pub(super) fn cache_wedge_reductions(&mut self, u: VertexId, others: &[VertexId]) -> bool {
        let are_lone = self.values.attributes.is_none() || self.have_single_wedges(u, others);
        if are_lone || self.counted_attributes().is_none() {
            return are_lone;
        }
        if let Some(attributes) = &mut self.values.attributes {
            attributes.cache_reductions(self.store.first_wedge[u.index()]);
            others.iter().for_each(|w| attributes.cache_reductions(self.store.first_wedge[w.index()]));
        }
        false
    }

    /// Returns the tensor of a vertex, reduced by the best values of its wedges, each taken alone.
    #[inline(always)]
    pub(super) fn reduced_tensor(&self, u: VertexId) -> Tensor {
        let tensor = *M::tensor_of(&self.store.v[u.index()].q);
        match (self.counted_attributes(), self.store.first_wedge.get(u.index())) {
            (Some(attributes), Some(&first)) if first != NO_WEDGE => {
                tensor.less(&attributes.reduction_of_vertex(first))
            }
            _ => tensor,
        }
    }

    /// Adds the cost of merging wedges to the form of an edge; `ru` is the ring of its kept end.
    pub(super) fn add_attributes(
        &self,
        u: VertexId,
        v: VertexId,
        d: Vec3,
        ru: &[Spoke],
        members: &mut Vec<Member>,
        form: &mut Form,
    ) {
        if let Some(attributes) = self.counted_attributes() {
            let lanes = attributes.lanes();
            let mut sum = Sum::ZERO;
            of_lanes!(lanes, N => self.add_wedges::<N>(attributes, [u, v], d, ru, members, &mut sum));
            sum.add_to(form);
        }
    }

    #[inline(always)]
    fn add_wedges<const N: usize>(
        &self,
        attributes: &Attributes,
        [u, v]: [VertexId; 2],
        d: Vec3,
        ru: &[Spoke],
        members: &mut Vec<Member>,
        sum: &mut Sum,
    ) {
        let Some(wedges) = &self.store.wedges else { return };
        let (mut pairs, mut count) = ([[NO_WEDGE; 2]; 2], 0);
        for r in ru.iter().filter(|r| r.has(v)) {
            let pair = ends_of(wedges[r.corner.face()], r.corner.k(), r.a == v);
            if count > 0 && pairs[0] == pair {
                continue;
            }
            if count > 0 && (count > 1 || pairs[0][0] == pair[0] || pairs[0][1] == pair[1]) {
                self.gather(attributes, u, v, ru, false, members);
                attributes.add_to(members, d, sum);
                return;
            }
            pairs[count] = pair;
            count += 1;
        }
        for pair in &pairs[..count] {
            attributes.add_pair_to(attributes.lanes_of::<N>(), *pair, d, sum);
        }
    }

    /// Adds the attribute cost to the forms of up to four edges from one vertex, side by side.
    #[inline(always)]
    pub(super) fn add_attributes_to_four(
        &self,
        edges: (VertexId, &[VertexId], bool),
        d: &[f32x4; 3],
        form: (&mut [f32x4; 6], &mut [f32x4; 3], &mut f32x4),
        ru: &[Spoke],
        members: &mut Vec<Member>,
    ) {
        if let Some(attributes) = self.counted_attributes() {
            let lanes = attributes.lanes();
            of_lanes!(lanes, N => self.add_to_four::<N>(attributes, edges, d, form, ru, members));
        }
    }

    #[inline(always)]
    fn add_to_four<const N: usize>(
        &self,
        attributes: &Attributes,
        (u, ends, are_lone): (VertexId, &[VertexId], bool),
        d: &[f32x4; 3],
        form: (&mut [f32x4; 6], &mut [f32x4; 3], &mut f32x4),
        ru: &[Spoke],
        members: &mut Vec<Member>,
    ) {
        let lanes = attributes.lanes_of::<N>();
        if are_lone {
            let lane = |i: usize| self.store.first_wedge[ends[i.min(ends.len() - 1)].index()];
            let others = [lane(0), lane(1), lane(2), lane(3)];
            attributes.add_four_to(lanes, self.store.first_wedge[u.index()], others, d, form);
            return;
        }
        let mut sums = [Sum::ZERO, Sum::ZERO, Sum::ZERO, Sum::ZERO];
        let [x, y, z] = *d;
        let (x, y, z) = (x.to_array(), y.to_array(), z.to_array());
        for (i, (sum, &w)) in sums.iter_mut().zip(ends).enumerate() {
            let d = Vec3::new(x[i], y[i], z[i]);
            self.add_wedges::<N>(attributes, [u, w], d, ru, members, sum);
        }
        Sum::add_four_to(&sums, form);
    }

    /// Collects the wedges at both ends of an edge, in groups that are merged; wedges on the edge come first,
    /// then the others if requested.
    fn gather(
        &self,
        attributes: &Attributes,
        u: VertexId,
        v: VertexId,
        ru: &[Spoke],
        others: bool,
        members: &mut Vec<Member>,
    ) {
        members.clear();
        let Some(wedges) = &self.store.wedges else { return };
        let (first_u, first_v) = (self.store.first_wedge[u.index()], self.store.first_wedge[v.index()]);
        if attributes.is_only_wedge(first_u) && attributes.is_only_wedge(first_v) {
            let group = usize::from(self.store.v[v.index()].kind.is_locked());
            members.push(Member { wedge: first_u, at_v: false, group });
            members.push(Member { wedge: first_v, at_v: true, group });
            return;
        }
        for r in ru {
            if !r.has(v) {
                continue;
            }
            let [own, far] = ends_of(wedges[r.corner.face()], r.corner.k(), r.a == v);
            let [i, j] = [(own, false), (far, true)].map(|(wedge, at_v)| add(members, wedge, at_v));
            let (low, high) =
                (members[i].group.min(members[j].group), members[i].group.max(members[j].group));
            members.iter_mut().filter(|m| m.group == high).for_each(|m| m.group = low);
        }
        for (first, at_v) in [(first_u, false), (first_v, true)].into_iter().filter(|_| others) {
            for wedge in attributes.chain(first) {
                add(members, wedge, at_v);
            }
        }
        if self.store.v[v.index()].kind.is_locked() {
            for i in 0..members.len() {
                let group = members[i].group;
                if members[i].at_v && !members[group].at_v {
                    members.iter_mut().filter(|m| m.group == group).for_each(|m| m.group = i);
                }
            }
        }
    }

    /// True if, when `u` and `v` are merged, no two wedges of a locked end are in the same group.
    pub(super) fn keeps_wedges(&self, u: VertexId, v: VertexId, ru: &[Spoke]) -> bool {
        let Some(attributes) = &self.values.attributes else { return true };
        let mut members = Vec::new();
        self.gather(attributes, u, v, ru, true, &mut members);
        let locked_v = self.store.v[v.index()].kind.is_locked();
        let of_locked = |g: usize| members.iter().filter(|m| m.group == g && m.at_v == locked_v).count();
        members.iter().all(|m| of_locked(m.group) == 1)
    }

    /// Finds the wedges of `u` and `v` that are merged, and their best values at `u` + `y`.
    pub(super) fn prepare_merge(&self, u: VertexId, v: VertexId, y: Vec3, ru: &[Spoke], merge: &mut Merge) {
        merge.slopes.clear();
        if let Some(attributes) = &self.values.attributes {
            self.gather(attributes, u, v, ru, true, &mut merge.members);
            let (members, lanes) = (&merge.members, attributes.lanes());
            let d = self.store.p(v) - self.store.p(u);
            let room = members.len() * lanes;
            if merge.best.len() < room {
                merge.best.resize(room, f32x4::ZERO);
            }
            if self.is_either_locked(u, v) {
                for (group, first) in representatives(members) {
                    merge.best[group * lanes..][..lanes].copy_from_slice(attributes.values(first.wedge));
                }
            } else {
                of_lanes!(lanes, N => attributes.best::<N>(members, d, y, &mut merge.best));
            }
        }
    }

    /// Returns the attribute cost of the prepared merger, from the triangles of the wings, of which the
    /// first `at_u` belong to the kept end: squares of small numbers, not small differences of squares.
    pub(super) fn attribute_cost(
        &self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        at_u: usize,
        wings: &Wings,
        merge: &mut Merge,
    ) -> f32 {
        let (Some(attributes), Some(wedges)) = (&self.values.attributes, &self.store.wedges) else {
            return 0.0;
        };
        if !attributes.counts() {
            return 0.0;
        }
        let lanes = attributes.lanes();
        of_lanes!(lanes, N => Self::cost_of_wings::<N>(
            (attributes, &self.store, wedges),
            wings,
            [self.store.p(u), self.store.p(v)],
            y,
            at_u,
            merge
        ))
    }

    #[inline(always)]
    fn cost_of_wings<const N: usize>(
        (attributes, store, wedges): (&Attributes, &Store<M::Memory>, &[[WedgeId; 3]]),
        wings: &Wings,
        [x, z]: [Vec3; 2],
        y: Vec3,
        at_u: usize,
        merge: &mut Merge,
    ) -> f32 {
        let Merge { members, best, slopes, .. } = merge;
        let lanes = attributes.lanes_of::<N>();
        let only = only_group(members);
        let (from, step) = ([splat(x), splat(z)], [splat(y), splat(y - (z - x))]);
        let mut cost = f32x4::ZERO;
        for (k, four) in wings.fours().iter().enumerate() {
            let end = usize::from(4 * k >= at_u);
            let (a, b) = (four.spokes.map(|s| s.a), four.spokes.map(|s| s.b));
            let s = FourSlopes::new([&from[end], &store.four(a), &store.four(b)], &four.normal, four.length);
            slopes.push(s);
            let at = [dot(&s.a, &step[end]).to_array(), dot(&s.b, &step[end]).to_array()];
            let area = s.area.to_array();
            for i in 0..four.count.min(4) {
                let corner = four.spokes[i].corner;
                let corners = from_corner(wedges[corner.face()], corner.k());
                let Some(group) = only.or_else(|| group_of(members, corners[0], end == 1)) else { continue };
                let error =
                    attributes.error(lanes, corners, at.map(|at| at[i]), &best[group * lanes..]) * area[i];
                // A triangle at both ends counts twice, as in the evaluation.
                cost += if four.stays & (1 << i) == 0 { error + error } else { error };
            }
        }
        cost.reduce_add()
    }

    /// Replaces wedges at the corners of `v` by identical ones of `u`, before the two vertices are merged.
    #[inline(never)]
    pub(super) fn share_wedges(&mut self, u: VertexId, v: VertexId, ring: &mut Ring) {
        self.store.ring(v, ring);
        let is_locked = self.is_either_locked(u, v);
        let (Some(attributes), Some(wedges)) = (&self.values.attributes, &mut self.store.wedges) else {
            return;
        };
        if is_locked {
            return;
        }
        let first = self.store.first_wedge[u.index()];
        for r in ring.iter() {
            let wedge = &mut wedges[r.corner.face()][r.corner.k()];
            *wedge = attributes.chain(first).find(|w| attributes.is_same(*w, *wedge)).unwrap_or(*wedge);
        }
    }

    /// Rebuilds the chain of the wedges of a vertex, and their sums, from its star.
    #[inline(never)]
    pub(super) fn chain_wedges_of(&mut self, u: VertexId, ring: &[Spoke]) {
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &self.store.wedges) else {
            return;
        };
        let mut all: Vec<WedgeId> = ring.iter().map(|r| wedges[r.corner.face()][r.corner.k()]).collect();
        all.sort_unstable();
        all.dedup();
        let mut first = NO_WEDGE;
        for w in all.into_iter().rev() {
            attributes.clear_sums(w, first);
            first = w;
        }
        self.store.first_wedge[u.index()] = first;
        for r in ring {
            let s = Slopes::new([u, r.a, r.b].map(|w| self.store.v[w.index()].p));
            attributes.add_triangle_to_first(&s, from_corner(wedges[r.corner.face()], r.corner.k()));
        }
    }

    /// Gives a vertex whose triangles have one wedge, shared with another vertex, its own wedge with the
    /// same values.
    pub(super) fn split_wedge(&mut self, u: VertexId, ring: &mut Ring) {
        self.store.ring(u, ring);
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &mut self.store.wedges) else {
            return;
        };
        let Some(first) = ring.first().map(|r| wedges[r.corner.face()][r.corner.k()]) else { return };
        let own = attributes.copy_of(first);
        for r in ring.iter() {
            wedges[r.corner.face()][r.corner.k()] = own;
            let s = Slopes::new([u, r.a, r.b].map(|w| self.store.v[w.index()].p));
            attributes.add_triangle_to_first(&s, from_corner(wedges[r.corner.face()], r.corner.k()));
        }
        self.store.first_wedge[u.index()] = own;
    }

    /// Merges the wedges as prepared, before the triangles change; the merged vertex moves to the kept end
    /// + `y`, the position `at`. Returns the attribute tensor of the new triangles.
    #[expect(clippy::too_many_arguments, reason = "the data of a collapse, and buffers")]
    pub(super) fn merge_wedges(
        &mut self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        at: Vec3,
        ru: &Ring,
        wings: &Wings,
        merge: &mut Merge,
    ) -> Tensor {
        let lanes = self.values.attributes.as_ref().map_or(0, Attributes::lanes);
        of_lanes!(lanes, N => self.merge_wedges_of::<N>([u, v], y, at, ru.len(), wings, merge))
    }

    #[inline(always)]
    fn merge_wedges_of<const N: usize>(
        &mut self,
        [u, v]: [VertexId; 2],
        y: Vec3,
        at: Vec3,
        at_u: usize,
        wings: &Wings,
        merge: &mut Merge,
    ) -> Tensor {
        let is_locked = self.is_either_locked(u, v);
        let (Some(attributes), Some(wedges)) = (&mut self.values.attributes, &mut self.store.wedges) else {
            return Tensor::default();
        };
        let lanes = attributes.lanes_of::<N>();
        let mut added = [f32x4::ZERO; 6];
        attributes.begin_merge(lanes, is_locked, merge);
        let Merge { members, best, own, heads, slopes } = merge;
        let only = only_group(members);
        let (x, z) = (self.store.v[u.index()].p, self.store.v[v.index()].p);
        let (from, to) = ([splat(x), splat(z)], splat(at));
        let mut tables = attributes.tables();
        let (wedges, vertices) = (&mut wedges[..], &mut self.store.v[..]);
        let (own, best, heads) = (&mut own[..], &best[..], &mut heads[..]);
        for (k, four) in wings.fours().iter().enumerate() {
            let end = usize::from(4 * k >= at_u);
            let (a, b) = (four.spokes.map(|s| s.a), four.spokes.map(|s| s.b));
            let (pa, pb) = (vertex::four(vertices, a), vertex::four(vertices, b));
            let old = match slopes.get(k) {
                Some(known) => *known,
                None => FourSlopes::new([&from[end], &pa, &pb], &four.normal, four.length),
            };
            let length = dot(&four.after, &four.after).sqrt();
            let new = FourSlopes::new([&to, &pa, &pb], &four.after, length);
            let (old, new) = (old.rows(), new.rows());
            let mut changes = [[f32x4::ZERO; 4]; 6];
            for i in 0..four.count.min(4) {
                let Spoke { corner, a: to_a, b: to_b } = four.spokes[i];
                let (face, k) = (corner.face(), corner.k());
                let [o, a, b] = from_corner(wedges[face], k);
                let Some(group) = only.or_else(|| group_of(members, o, end == 1)) else { continue };
                let stays = four.stays & (1 << i) != 0;
                let values = &best[group * lanes..][..lanes];
                let new = stays.then(|| (&new[i], values));
                let sums = &mut own[group * 3 * lanes..][..3 * lanes];
                let change = tables.replace(lanes, (&old[i], o), new, [a, b], sums, &mut added);
                for k in 0..6 {
                    changes[k][i] = change[k];
                }
                match new {
                    Some((s, _)) => {
                        heads[group].area += s.area();
                        heads[group].faces += 1;
                        wedges[face][k] = members[group].wedge;
                    }
                    None => {
                        let (apex, wedge) = if to_a == v { (to_b, b) } else { (to_a, a) };
                        if tables.heads[wedge.index()].faces == 0 {
                            tables.unlink(&mut self.store.first_wedge[apex.index()], wedge);
                        }
                    }
                }
            }
            add_changes::<M>(vertices, four, changes);
        }
        let t = (y.dot(z - x) / (z - x).length_squared().max(1e-37)).clamp(0.0, 1.0);
        self.store.first_wedge[u.index()] = attributes.end_merge(lanes, is_locked, t, merge);
        Tensor(added.map(f32x4::reduce_add))
    }
}

/// Adds changes of tensors, in four lanes, to the two outer vertices of each of four triangles.
#[inline(always)]
fn add_changes<M: Metric>(
    vertices: &mut [Vertex<M::Memory>],
    four: &FourWings,
    [a, b, c, d, e, f]: [[f32x4; 4]; 6],
) {
    let changes = lanes::tensors([
        lanes::sums(a),
        lanes::sums(b),
        lanes::sums(c),
        lanes::sums(d),
        lanes::sums(e),
        lanes::sums(f),
    ]);
    for (spoke, change) in four.spokes.iter().zip(&changes).take(four.count) {
        for w in [spoke.a, spoke.b] {
            M::tensor(&mut vertices[w.index()].q).add(change);
        }
    }
}

/// Returns the group of all members, if each end has one wedge.
#[inline(always)]
fn only_group(members: &[Member]) -> Option<usize> {
    match members {
        [a, b] if a.group == b.group => Some(a.group),
        _ => None,
    }
}

/// Returns the wedges of a triangle, starting at corner `k`. (By a table: a branch on k would be
/// unpredictable.)
#[inline(always)]
fn from_corner(wedges: [WedgeId; 3], k: usize) -> [WedgeId; 3] {
    const ORDER: [[usize; 3]; 4] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 1, 2]];
    ORDER[k & 3].map(|i| wedges[i])
}

/// Returns the wedges of a triangle at its corner `k` and at the next one if `next`, else at the previous
/// one.
#[inline(always)]
fn ends_of(wedges: [WedgeId; 3], k: usize, next: bool) -> [WedgeId; 2] {
    let [own, after, before] = from_corner(wedges, k);
    [own, if next { after } else { before }]
}

#[inline(always)]
fn group_of(members: &[Member], wedge: WedgeId, at_v: bool) -> Option<usize> {
    members.iter().find(|m| m.wedge == wedge && m.at_v == at_v).map(|m| m.group)
}

/// Returns the index of a wedge among the members; adds it as a new group if it is not there.
fn add(members: &mut Vec<Member>, wedge: WedgeId, at_v: bool) -> usize {
    let known = members.iter().position(|m| m.wedge == wedge && m.at_v == at_v);
    known.unwrap_or_else(|| {
        members.push(Member { wedge, at_v, group: members.len() });
        members.len() - 1
    })
}

#[cfg(test)]
mod tests;
