//! Attributes of wedges through collapses: in the cost, and blended to where they lie closest.
//!
//! Over a triangle a value is linear. What a collapse does to it is the integral of (g·x + s − s')² over the present
//! star, with the gradient g taken from the present triangles: memoryless, as the positions are, in the form of
//! [Hoppe 1999]. Of each wedge only its area and its sum of area · g are kept; the sum of area · g gᵀ joins the star
//! tensor of its vertex. The best value of the merged wedge is a quotient, and what is left is a form in the position.
//!
//! Which wedges become one is said by the triangles on the edge: the two wedges that such a triangle has at the ends go
//! together. A wedge that no such triangle has stays by itself, on its own side of the seam.

use glam::Vec3;
use lodsmith_core::{RegionId, VertexId, WedgeId};
use wide::f32x4;

use super::Engine;
use super::kind::faces_at;
use super::order::NONE;
use super::store::{Corner, Ring, Spoke, Store};
use crate::metric::{Form, Metric};
use crate::report::Refusal;
use crate::tensor::Tensor;

/// Weight of the line of a seam edge against the planes of faces: a seam that leaves its line shows what lies beyond the
/// chart. (Guessed, a fifth of a border's.)
pub(crate) const SEAM: f32 = 2.0;
/// Doubled area under which a triangle's gradients are not believed, a share of its longest edge squared.
const FLAT: f32 = 1e-3;

/// Live attributes of a run.
#[derive(Clone, Debug)]
pub(crate) struct Attributes {
    /// Values of a wedge.
    pub(crate) width: usize,
    /// What the square of each value's error counts in the cost, per area, in the unit frame.
    pub(crate) weights: Vec<f32>,
    /// Unit vectors among the values: where each begins.
    pub(crate) directions: Vec<usize>,
    /// `width` values for each wedge.
    pub(crate) values: Vec<f32>,
    /// Joints that pull a wedge, with their weights; empty where there is no skin.
    pub(crate) pulls: Vec<Pulls>,
    /// Doubled area of the present triangles of each wedge.
    areas: Vec<f32>,
    /// Doubled area times gradient, summed over them, for each value.
    slopes: Vec<Vec3>,
}

/// Joints and weights, the strongest first.
pub(crate) type Pulls = Vec<(u32, f32)>;

/// Which lines no longer refuse, because nothing else was left to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Looseness {
    /// All hold.
    None,
    /// Seams give way.
    Seams,
    /// The borders of regions too: a material may lose its last face.
    Regions,
}

impl Looseness {
    /// The next step, if there is one.
    pub(crate) fn looser(self) -> Option<Self> {
        match self {
            Self::None => Some(Self::Seams),
            Self::Seams => Some(Self::Regions),
            Self::Regions => None,
        }
    }
}

/// A wedge at one of the ends of an edge.
#[derive(Clone, Copy, Debug)]
struct Member {
    wedge: WedgeId,
    at_v: bool,
    /// The index of the member that gives the group its number, and its values if it is at a locked end.
    group: u32,
}

/// Doubled area of a triangle and the gradients of its barycentric coordinates.
#[derive(Clone, Copy)]
struct Gradients {
    area: f32,
    of: [Vec3; 3],
}

impl Gradients {
    #[inline(always)]
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        let edges = [c - b, a - c, b - a];
        let n = edges[2].cross(-edges[1]);
        let longest = edges.iter().fold(0f32, |l, e| l.max(e.length_squared()));
        let length = n.length();
        let scale = 1.0 / (length.max(FLAT * longest) * length.max(1e-30)).max(1e-30);
        Self { area: length, of: edges.map(|e| n.cross(e) * scale) }
    }
    #[inline(always)]
    fn slope(&self, s: [f32; 3]) -> Vec3 {
        self.of[0] * s[0] + self.of[1] * s[1] + self.of[2] * s[2]
    }
}

impl Attributes {
    /// Attributes of `count` wedges, none of which counts in the cost yet.
    pub(crate) fn new(
        count: usize,
        width: usize,
        directions: Vec<usize>,
        values: Vec<f32>,
        pulls: Vec<Pulls>,
    ) -> Self {
        let (areas, slopes) = (vec![0.0; count], vec![Vec3::ZERO; count * width]);
        Self { width, weights: vec![0.0; width], directions, values, pulls, areas, slopes }
    }
    /// Whether no wedge carries anything.
    pub(crate) fn is_empty(&self) -> bool {
        self.width == 0 && self.pulls.is_empty()
    }
    pub(crate) fn of(&self, w: WedgeId) -> &[f32] {
        &self.values[w.index() * self.width..][..self.width]
    }
    /// Root mean square over the surface of the gradient of one of some values.
    pub(crate) fn mean_gradient(
        &self,
        range: std::ops::Range<usize>,
        faces: &[[VertexId; 3]],
        wedges: &[[WedgeId; 3]],
        points: &[Vec3],
    ) -> f64 {
        let (mut sum, mut area) = (0f64, 0f64);
        for (t, w) in faces.iter().zip(wedges) {
            let g = Gradients::new(t.map(|v| points[v.index()]));
            area += f64::from(g.area);
            for i in range.clone() {
                sum += f64::from(g.area * g.slope(w.map(|w| self.of(w)[i])).length_squared());
            }
        }
        (sum / (area * range.len() as f64).max(f64::MIN_POSITIVE)).sqrt()
    }
    fn slopes_of(&self, w: WedgeId) -> &[Vec3] {
        &self.slopes[w.index() * self.width..][..self.width]
    }

    /// Adds a triangle to the sums of its wedges at some corners, or takes it away (`sign` −1). Says what that adds to the
    /// tensors of their vertices.
    #[inline(always)]
    fn account<const N: usize>(
        &mut self,
        g: &Gradients,
        wedges: [WedgeId; 3],
        sign: f32,
        corners: [usize; N],
    ) -> Tensor {
        let area = g.area * sign;
        let mut sum = Tensor::default();
        let at = wedges.map(|w| w.index() * self.width);
        for i in 0..self.width {
            let slope = g.slope(at.map(|at| self.values[at + i]));
            sum.add(&Tensor::outer(slope, self.weights[i] * area));
            for k in corners {
                self.slopes[at[k] + i] += slope * area;
            }
        }
        for k in corners {
            self.areas[wedges[k].index()] += area;
        }
        sum
    }

    /// Adds to the form of an edge what its wedges say; `d` leads from the kept to the removed end.
    fn add_to(&self, members: &[Member], d: Vec3, form: &mut Form) {
        for first in members.iter().filter(|m| is_first(members, m)) {
            let mut others = members.iter().filter(|m| m.group == first.group && !is_first(members, m));
            match (others.next(), others.next()) {
                (None, _) => self.add_single_to(first, d, form),
                (Some(other), None) if !first.at_v && other.at_v => {
                    self.add_pair_to(first.wedge, other.wedge, d, form);
                }
                _ => self.add_group_to(members, first, d, form),
            }
        }
    }

    /// A wedge that is left to itself: its values may change, but not what their gradients say along the step.
    #[inline(always)]
    fn add_single_to(&self, m: &Member, d: Vec3, form: &mut Form) {
        let per_area = 1.0 / self.areas[m.wedge.index()].max(1e-30);
        for (&weight, &slope) in self.weights.iter().zip(self.slopes_of(m.wedge)) {
            let along = if m.at_v { slope.dot(d) } else { 0.0 };
            let scale = weight * per_area;
            form.a.add(&Tensor::outer(slope, -scale));
            form.h -= slope * (along * scale);
            form.c -= along * along * scale;
        }
    }

    /// Several wedges of either end that become one.
    fn add_group_to(&self, members: &[Member], first: &Member, d: Vec3, form: &mut Form) {
        let of_group = || members.iter().filter(move |m| m.group == first.group);
        let base = self.of(first.wedge);
        let area: f32 = of_group().map(|m| self.areas[m.wedge.index()]).sum();
        let per_area = 1.0 / area.max(1e-30);
        for (i, &weight) in self.weights.iter().enumerate() {
            let (mut b, mut l, mut c0, mut c) = (Vec3::ZERO, Vec3::ZERO, 0f32, 0f32);
            for m in of_group() {
                let (slope, area) = (self.slopes_of(m.wedge)[i], self.areas[m.wedge.index()]);
                let off = self.of(m.wedge)[i] - base[i];
                b += slope;
                l += slope * off;
                c += area * off * off;
                c0 += area * off;
                if m.at_v {
                    let along = slope.dot(d);
                    c -= 2.0 * off * along;
                    c0 -= along;
                }
            }
            form.a.add(&Tensor::outer(b, -weight * per_area));
            form.h += (b * (c0 * per_area) - l) * weight;
            form.c += (c - c0 * c0 * per_area) * weight;
        }
    }

    /// The same for one wedge at each end, as on all edges that touch no seam.
    #[inline(always)]
    fn add_pair_to(&self, u: WedgeId, v: WedgeId, d: Vec3, form: &mut Form) {
        let (area_u, area_v) = (self.areas[u.index()], self.areas[v.index()]);
        let per_area = 1.0 / (area_u + area_v).max(1e-30);
        let ends = self.of(u).iter().zip(self.of(v));
        let slopes = self.slopes_of(u).iter().zip(self.slopes_of(v));
        for ((&weight, (&s, &t)), (&slope_u, &slope_v)) in self.weights.iter().zip(ends).zip(slopes) {
            let off = t - s;
            let along = slope_v.dot(d);
            let b = slope_u + slope_v;
            let c0 = area_v * off - along;
            form.a.add(&Tensor::outer(b, -weight * per_area));
            form.h += (b * (c0 * per_area) - slope_v * off) * weight;
            form.c += (off * (area_v * off - 2.0 * along) - c0 * c0 * per_area) * weight;
        }
    }

    /// The best values of a group whose vertex goes to the kept end + `y`.
    fn best(&self, members: &[Member], group: u32, d: Vec3, y: Vec3, out: &mut [f32]) {
        let of_group = || members.iter().filter(move |m| m.group == group);
        let Some(first) = of_group().next() else { return };
        let area: f32 = of_group().map(|m| self.areas[m.wedge.index()]).sum();
        let base = self.of(first.wedge);
        // From the first wedge's values, so that what is constant stays so.
        out.fill(0.0);
        for m in of_group() {
            let (own, at) = (self.areas[m.wedge.index()], if m.at_v { y - d } else { y });
            let values = self.of(m.wedge).iter().zip(base).zip(self.slopes_of(m.wedge));
            for (sum, ((&s, &base), slope)) in out.iter_mut().zip(values) {
                *sum += own * (s - base) + slope.dot(at);
            }
        }
        let per_area = if area > 1e-30 { 1.0 / area } else { 0.0 };
        for (x, &base) in out.iter_mut().zip(base) {
            *x = base + *x * per_area;
        }
    }

    fn blended_pulls(&self, members: &[Member], group: u32, t: f32) -> Pulls {
        let mut sum: Pulls = Vec::new();
        let count = |at_v| members.iter().filter(|m| m.group == group && m.at_v == at_v).count();
        let counts = [count(false), count(true)];
        for m in members.iter().filter(|m| m.group == group) {
            // A group with wedges of one end only takes all from it.
            let share = match (counts, m.at_v) {
                ([_, 0], _) | ([0, _], _) => 1.0,
                (_, true) => t,
                (_, false) => 1.0 - t,
            } / counts[usize::from(m.at_v)] as f32;
            for &(joint, weight) in &self.pulls[m.wedge.index()] {
                match sum.iter_mut().find(|p| p.0 == joint) {
                    Some(p) => p.1 += weight * share,
                    None => sum.push((joint, weight * share)),
                }
            }
        }
        sum.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        sum.truncate(MOST_PULLS);
        sum
    }
}

/// Joints kept at a wedge while the mesh is worked on. (More than any format has.)
const MOST_PULLS: usize = 16;

impl<M: Metric> Store<M> {
    /// Wedge of a corner.
    #[inline(always)]
    fn wedge_at(&self, wedges: &[[WedgeId; 3]], corner: Corner) -> WedgeId {
        wedges[corner.face()][corner.k()]
    }

    /// Whether regions differ on the two sides of the edge from the centre of a star to `w`.
    fn is_region_edge(&self, ring: &[Spoke], w: VertexId) -> bool {
        let Some(regions) = &self.regions else { return false };
        let mut sides = ring.iter().filter(|r| r.has(w)).map(|r| regions[r.corner.face()]);
        let first = sides.next();
        sides.any(|side| Some(side) != first)
    }

    /// Whether faces of several regions meet in a star.
    fn meets_regions(&self, ring: &[Spoke]) -> bool {
        let Some(regions) = &self.regions else { return false };
        let of = |r: &Spoke| regions[r.corner.face()];
        ring.iter().any(|r| of(r) != of(&ring[0]))
    }

    /// Whether wedges or regions differ on the two sides of the edge from the centre of a star to `w`.
    pub(crate) fn is_seam_edge(&self, ring: &[Spoke], w: VertexId) -> bool {
        let Some(wedges) = &self.wedges else { return false };
        let mut first: Option<(WedgeId, WedgeId, Option<RegionId>)> = None;
        for r in ring.iter().filter(|r| r.has(w)) {
            let (f, k) = (r.corner.face(), r.corner.k());
            let other = if r.a == w { (k + 1) % 3 } else { (k + 2) % 3 };
            let side = (wedges[f][k], wedges[f][other], self.regions.as_ref().map(|x| x[f]));
            match first {
                None => first = Some(side),
                Some(s) if s != side => return true,
                Some(_) => {}
            }
        }
        false
    }
}

impl<M: Metric> Engine<M> {
    /// Weight of the line along the edge from the centre of a star to `w`; 0 for an edge inside.
    #[inline]
    pub(crate) fn line_weight(&self, ring: &[Spoke], w: VertexId, seams: bool) -> f32 {
        if faces_at(ring, w) != 2 {
            return self.rules.border_weight;
        }
        if seams && self.store.is_seam_edge(ring, w) { SEAM } else { 0.0 }
    }

    /// Sums of all wedges, and what attributes add to the tensors.
    pub(crate) fn weigh_attributes(&mut self) {
        let (Some(attributes), Some(wedges)) = (&mut self.attributes, &self.store.wedges) else { return };
        for (t, w) in self.store.t.iter().zip(wedges) {
            let g = Gradients::new(t.map(|v| self.store.v[v.index()].p));
            let sum = attributes.account(&g, *w, 1.0, [0, 1, 2]);
            for v in t {
                M::tensor(&mut self.store.v[v.index()].q).add(&sum);
            }
        }
    }

    /// Adds the attributes' part to the form of an edge.
    pub(crate) fn add_attributes(&self, u: VertexId, v: VertexId, d: Vec3, form: &mut Form) {
        let Some(attributes) = self.attributes.as_ref().filter(|_| M::MEMORYLESS) else { return };
        let mut members = [Member { wedge: WedgeId(0), at_v: false, group: 0 }; MOST_MEMBERS];
        let n = self.gather(u, v, &mut members);
        attributes.add_to(&members[..n], d, form);
    }

    /// The wedge of a vertex that has one.
    #[inline(always)]
    fn only_wedge(&self, u: VertexId) -> WedgeId {
        let alive = |c: &&Corner| self.store.t[c.face()][0] != NONE;
        match (&self.store.wedges, self.store.listed(u).iter().find(alive)) {
            (Some(wedges), Some(&corner)) => self.store.wedge_at(wedges, corner),
            _ => WedgeId(0),
        }
    }

    /// Adds the attributes' part to the forms of up to four edges whose ends have one wedge each, side by side.
    #[inline(never)]
    pub(crate) fn add_attributes_to_four(
        &self,
        u: VertexId,
        ends: &[VertexId],
        d: &[f32x4; 3],
        a: &mut [f32x4; 6],
        h: &mut [f32x4; 3],
        c: &mut f32x4,
    ) {
        let Some(attributes) = &self.attributes else { return };
        let width = attributes.width;
        let own = self.only_wedge(u);
        let lane = |i: usize| self.only_wedge(ends[i.min(ends.len() - 1)]);
        let others = [lane(0), lane(1), lane(2), lane(3)];
        let area = f32x4::new(others.map(|w| attributes.areas[w.index()]));
        let per_area = f32x4::ONE / (area + attributes.areas[own.index()]).fast_max(f32x4::splat(1e-30));
        let (values, slopes) = (attributes.of(own), attributes.slopes_of(own));
        let (their_values, their_slopes) =
            (others.map(|w| attributes.of(w)), others.map(|w| attributes.slopes_of(w)));
        for i in 0..width {
            let weight = attributes.weights[i];
            let off = f32x4::new(their_values.map(|v| v[i])) - f32x4::splat(values[i]);
            let theirs = their_slopes.map(|s| s[i]);
            let slope: [f32x4; 3] = [
                f32x4::new(theirs.map(|s| s.x)),
                f32x4::new(theirs.map(|s| s.y)),
                f32x4::new(theirs.map(|s| s.z)),
            ];
            let along = slope[0] * d[0] + slope[1] * d[1] + slope[2] * d[2];
            let b = [slope[0] + slopes[i].x, slope[1] + slopes[i].y, slope[2] + slopes[i].z];
            let c0 = area * off - along;
            let scale = per_area * weight;
            let scaled = b.map(|b| b * scale);
            for (sum, (j, k)) in a.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
                *sum -= scaled[j] * b[k];
            }
            for k in 0..3 {
                h[k] += scaled[k] * c0 - slope[k] * off * weight;
            }
            *c += off * (area * off - along * 2.0) * weight - c0 * c0 * scale;
        }
    }

    /// The wedges at both ends of an edge, in groups that become one. Returns how many; wedges beyond the room are left
    /// out, so that a vertex of very many charts cannot stall a run.
    fn gather(&self, u: VertexId, v: VertexId, members: &mut [Member; MOST_MEMBERS]) -> usize {
        let Some(wedges) = &self.store.wedges else { return 0 };
        let is_seam = |w: VertexId| self.store.v[w.index()].kind.is_seam();
        let is_locked = |w: VertexId| self.store.v[w.index()].kind.is_locked();
        if !is_seam(u) && !is_seam(v) {
            // One wedge at each end.
            let group = u32::from(is_locked(v));
            for (m, (end, at_v)) in members.iter_mut().zip([(u, false), (v, true)]) {
                *m = Member { wedge: self.only_wedge(end), at_v, group };
            }
            return 2;
        }
        let mut n = 0;
        for (end, at_v) in [(u, false), (v, true)] {
            let one = !self.store.v[end.index()].kind.is_seam();
            for &corner in self.store.listed(end) {
                if self.store.t[corner.face()][0] == NONE {
                    continue;
                }
                let wedge = self.store.wedge_at(wedges, corner);
                let known = members[..n].iter().any(|m| m.at_v == at_v && m.wedge == wedge);
                if !known && n < MOST_MEMBERS {
                    members[n] = Member { wedge, at_v, group: n as u32 };
                    n += 1;
                }
                if one {
                    break;
                }
            }
        }
        for &corner in self.store.listed(u) {
            let t = &self.store.t[corner.face()];
            if t[0] == NONE {
                continue;
            }
            let Some(j) = t.iter().position(|&x| x == v) else { continue };
            let (a, b) = (self.store.wedge_at(wedges, corner), wedges[corner.face()][j]);
            let group_of = |members: &[Member], wedge, at_v| {
                members.iter().find(|m| m.wedge == wedge && m.at_v == at_v).map(|m| m.group)
            };
            let (ga, gb) = (group_of(&members[..n], a, false), group_of(&members[..n], b, true));
            if let (Some(ga), Some(gb)) = (ga, gb) {
                let (low, high) = (ga.min(gb), ga.max(gb));
                members[..n].iter_mut().filter(|m| m.group == high).for_each(|m| m.group = low);
            }
        }
        if is_locked(v) {
            for i in 0..n {
                let group = members[i].group;
                if members[i].at_v && !members[group as usize].at_v {
                    members[..n].iter_mut().filter(|m| m.group == group).for_each(|m| m.group = i as u32);
                }
            }
        }
        n
    }

    /// Whether each wedge of an end that is locked stays by itself through the merger of `u` and `v`, with no new one
    /// beside it.
    pub(crate) fn keeps_wedges(&self, u: VertexId, v: VertexId) -> bool {
        if self.attributes.is_none() {
            return true;
        }
        let mut members = [Member { wedge: WedgeId(0), at_v: false, group: 0 }; MOST_MEMBERS];
        let n = self.gather(u, v, &mut members);
        let locked_v = self.store.v[v.index()].kind.is_locked();
        let of_locked = |g: u32| members[..n].iter().filter(|m| m.group == g && m.at_v == locked_v).count();
        n < MOST_MEMBERS && members[..n].iter().all(|m| of_locked(m.group) == 1)
    }

    /// What the attributes lose by merging `v` into `u` at `u` + `y`, from the present triangles: squares of small numbers,
    /// not small differences of squares.
    pub(crate) fn attribute_cost(
        &self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        ru: &Ring,
        rv: &Ring,
        best: &mut Vec<f32>,
    ) -> f32 {
        let (Some(attributes), Some(wedges)) = (&self.attributes, &self.store.wedges) else { return 0.0 };
        if attributes.weights.iter().all(|&w| w == 0.0) {
            return 0.0;
        }
        let mut members = [Member { wedge: WedgeId(0), at_v: false, group: 0 }; MOST_MEMBERS];
        let n = self.gather(u, v, &mut members);
        let members = &members[..n];
        let (x, z) = (self.store.p(u), self.store.p(v));
        let d = z - x;
        let width = attributes.width;
        let is_locked = self.is_either_locked(u, v);
        best.resize(n * width, 0.0);
        for m in members.iter().filter(|m| is_first(members, m)) {
            let best = &mut best[m.group as usize * width..][..width];
            if is_locked {
                best.copy_from_slice(attributes.of(m.wedge));
            } else {
                attributes.best(members, m.group, d, y, best);
            }
        }
        let mut cost = 0f32;
        for (ring, at_v, from, step) in [(ru, false, x, y), (rv, true, z, y - d)] {
            for r in ring {
                let (f, k) = (r.corner.face(), r.corner.k());
                let w = wedges[f];
                let Some(m) = members.iter().find(|m| m.at_v == at_v && m.wedge == w[k]) else { continue };
                let g = Gradients::new(corners(from, self.store.p(r.a), self.store.p(r.b), k));
                // What the gradients give along the step, corner by corner.
                let along = g.of.map(|g| g.dot(step));
                let [a, b, c] = w.map(|w| attributes.of(w));
                let best = &best[m.group as usize * width..][..width];
                let own = [a, b, c][k];
                let mut sum = 0f32;
                for i in 0..width {
                    let error = along[0] * a[i] + along[1] * b[i] + along[2] * c[i] + own[i] - best[i];
                    sum += attributes.weights[i] * error * error;
                }
                cost += g.area * sum;
            }
        }
        cost
    }

    /// What attributes add to the tensor of a vertex.
    pub(crate) fn attribute_tensor(&self, u: VertexId, ring: &Ring) -> Tensor {
        let mut tensor = Tensor::default();
        let (Some(attributes), Some(wedges)) = (&self.attributes, &self.store.wedges) else { return tensor };
        for r in ring {
            let (f, k) = (r.corner.face(), r.corner.k());
            let g = Gradients::new(corners(self.store.p(u), self.store.p(r.a), self.store.p(r.b), k));
            for (i, &weight) in attributes.weights.iter().enumerate() {
                let s = wedges[f].map(|w| attributes.values[w.index() * attributes.width + i]);
                tensor.add(&Tensor::outer(g.slope(s), weight * g.area));
            }
        }
        tensor
    }

    /// Whether seams and regions allow the collapse: two vertices on the borders of regions merge along one only, and no
    /// face goes that has lines on all sides. (Two vertices on other seams may merge across: their lines say at what
    /// cost. Refusing that too cost CesiumMan its limbs at 10 %, for nothing else was left.)
    pub(crate) fn ask_seams(&self, u: VertexId, v: VertexId, ru: &Ring, rv: &Ring) -> Result<(), Refusal> {
        let (ku, kv) = (self.store.v[u.index()].kind, self.store.v[v.index()].kind);
        if self.looseness == Looseness::Regions
            || !(ku.is_seam() || kv.is_seam())
            || !(ku.has_lines() && kv.has_lines())
        {
            return Ok(());
        }
        let is_line = |ring: &Ring, w| match self.looseness {
            Looseness::None => self.line_weight(ring, w, true) > 0.0,
            _ => faces_at(ring, w) != 2 || self.store.is_region_edge(ring, w),
        };
        if !is_line(ru, v) {
            let both = self.store.meets_regions(ru) && self.store.meets_regions(rv);
            return if both { Err(Refusal::Seam) } else { Ok(()) };
        }
        for r in ru.iter().filter(|r| r.has(v)) {
            let apex = if r.a == v { r.b } else { r.a };
            if is_line(ru, apex) && is_line(rv, apex) {
                return Err(Refusal::Seam);
            }
        }
        Ok(())
    }

    /// Merges wedges with their vertices, before the triangles change; the merged vertex goes to the kept end + `y`, the
    /// place `at`. Says what the new triangles add to its tensor.
    pub(crate) fn merge_wedges(
        &mut self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        at: Vec3,
        ru: &Ring,
        rv: &Ring,
    ) -> Tensor {
        let mut own = Tensor::default();
        if self.attributes.is_none() {
            return own;
        }
        let mut members = [Member { wedge: WedgeId(0), at_v: false, group: 0 }; MOST_MEMBERS];
        let n = self.gather(u, v, &mut members);
        let members = &members[..n];
        let is_locked = self.is_either_locked(u, v);
        let (Some(attributes), Some(wedges)) = (&mut self.attributes, &mut self.store.wedges) else {
            return own;
        };
        let (x, z) = (self.store.v[u.index()].p, self.store.v[v.index()].p);
        let d = z - x;
        // What the old triangles gave goes.
        for (ring, from, twin) in [(ru, x, None), (rv, z, Some(u))] {
            for r in ring.iter().filter(|r| twin.is_none_or(|t| !r.has(t))) {
                let (f, k) = (r.corner.face(), r.corner.k());
                let g = Gradients::new(corners(
                    from,
                    self.store.v[r.a.index()].p,
                    self.store.v[r.b.index()].p,
                    k,
                ));
                let sum = attributes.account(&g, wedges[f], -1.0, [(k + 1) % 3, (k + 2) % 3]);
                for o in [r.a, r.b] {
                    M::tensor(&mut self.store.v[o.index()].q).add(&sum);
                }
            }
        }
        // New values; the first of a group gives its number.
        let t = (y.dot(d) / d.length_squared().max(1e-37)).clamp(0.0, 1.0);
        let width = attributes.width;
        let mut values = std::mem::take(&mut self.best);
        values.resize(width, 0.0);
        for first in members.iter().filter(|m| is_first(members, m)) {
            let group = first.group;
            if is_locked {
                values[..width].copy_from_slice(attributes.of(first.wedge));
            } else {
                attributes.best(members, group, d, y, &mut values[..width]);
            }
            for &at in &attributes.directions {
                let n = Vec3::from_slice(&values[at..at + 3]);
                let length = n.length();
                if length > 1e-6 {
                    values[at..at + 3].copy_from_slice(&(n / length).to_array());
                }
            }
            if !attributes.pulls.is_empty() {
                let pulls = attributes.blended_pulls(members, group, t);
                attributes.pulls[first.wedge.index()] = pulls;
            }
            let w = first.wedge.index();
            attributes.values[w * width..][..width].copy_from_slice(&values[..width]);
            attributes.areas[w] = 0.0;
            attributes.slopes[w * width..][..width].fill(Vec3::ZERO);
        }
        self.best = values;
        // The corners of both ends take them.
        for (ring, at_v) in [(ru, false), (rv, true)] {
            for r in ring {
                let w = &mut wedges[r.corner.face()][r.corner.k()];
                if let Some(m) = members.iter().find(|m| m.wedge == *w && m.at_v == at_v) {
                    *w = members[m.group as usize].wedge;
                }
            }
        }
        // What the new triangles give.
        for (ring, other) in [(ru, v), (rv, u)] {
            for r in ring.iter().filter(|r| !r.has(other)) {
                let (f, k) = (r.corner.face(), r.corner.k());
                let g =
                    Gradients::new(corners(at, self.store.v[r.a.index()].p, self.store.v[r.b.index()].p, k));
                let sum = attributes.account(&g, wedges[f], 1.0, [0, 1, 2]);
                for o in [r.a, r.b] {
                    M::tensor(&mut self.store.v[o.index()].q).add(&sum);
                }
                own.add(&sum);
            }
        }
        own
    }
}

/// Wedges at the ends of one edge that are looked at.
const MOST_MEMBERS: usize = 24;

/// Whether a member gives its group the number.
fn is_first(members: &[Member], m: &Member) -> bool {
    members.get(m.group as usize).is_some_and(|x| x.wedge == m.wedge && x.at_v == m.at_v)
}

/// The corners of a triangle in their order, where the centre of the star is corner `k`.
#[inline(always)]
fn corners(centre: Vec3, a: Vec3, b: Vec3, k: usize) -> [Vec3; 3] {
    let mut p = [centre; 3];
    (p[(k + 1) % 3], p[(k + 2) % 3]) = (a, b);
    p
}
