//! Cuts of a surface at its necks, if the topology may change.
//!
//! ```text
//!      side 1   u          Three edges u-v, v-w, w-u go around a tube, with no face between them. A
//!        .-----/|\-----.   collapse of u-v would pinch the tube. Instead it is cut along the three edges and
//!       (     w-+-      )  closed on both sides with a triangle; the collapse then removes both triangles.
//!        '-----\|/-----'   This leaves two ends that touch: u, w on one side and two new vertices at the same
//!               v   side 2 positions on the other. Each edge keeps two faces.
//! ```
//!
//! This removes a handle, or splits a part into two, which may then be removed one by one.

use glam::Vec3;
use lodsmith_core::VertexId;

use super::candidate::merged_position;
use super::ring::{Corner, Ring, distinct};
use super::star::Star;
use super::{Engine, LiveMesh, Scratch, Tally};
use crate::cost::metric::{Form, Metric};
use crate::fit::MoveGuards;
use crate::options::{Placement, SimplifyOptions, TopologyPolicy};
use crate::report::Refusal;

/// Displacement of touching vertices, as a share of the distance to the middle of their star: large enough
/// for single precision, and invisible. (Guessed.)
const SEPARATION_SHARE: f32 = 1.0 / 512.0;

/// True if a run with these options may cut, at least when nothing else is left. (Vertices that cannot move
/// would leave the sides of a cut in contact, which only free topology allows.)
pub(crate) fn may_cut(options: &SimplifyOptions) -> bool {
    match options.topology {
        TopologyPolicy::Preserve => false,
        TopologyPolicy::Relaxed => options.placement != Placement::Endpoint,
        TopologyPolicy::Free => true,
    }
}

/// Collapses refused by the link condition, as a share of all collapses, from which a run that cuts necks
/// is tried too. (Measured: at most .02 on scans at 50, 10 and 1 %; .6 and 1.4 on parts with many small
/// holes at 10 %, where cuts gain a quarter and more.)
const MIN_REFUSED_SHARE: f64 = 0.5;
/// That share in the collapses after sweeps became unproductive. (Measured: 6 to 12 on cycloidal at 6 %, which is 1.6
/// times as close with cuts, though .34 to .44 of all collapses were refused; hardly above 3 elsewhere.)
const MIN_LATE_REFUSED_SHARE: f64 = 5.0;
/// Number of faces around a vertex above which it is not searched for necks: the search is quadratic in it
/// for each common neighbour. (Guessed: in ordinary meshes hardly any vertex has a third of it.)
const MAX_NECK_FACES: usize = 96;
/// Minimum number of input faces per part for necks to be considered: small parts have no handles, but the
/// link condition refuses their last collapses too. (Guessed.)
const MIN_FACES_PER_PART: usize = 100;

impl<M: Metric> Engine<M> {
    /// True if necks block many collapses in a run that could not cut them.
    pub(crate) fn has_blocking_necks(&self) -> bool {
        let refused = self.tally.refusals[Refusal::LinkCondition as usize];
        let late_share = || self.tally.refused_since(Refusal::LinkCondition);
        !self.mesh.constraints.cuts_necks
            && (refused as f64 > MIN_REFUSED_SHARE * self.tally.collapses as f64
                || self.tally.is_unproductive && late_share() > MIN_LATE_REFUSED_SHARE)
            && self.tally.first_faces >= MIN_FACES_PER_PART * self.mesh.part_count()
    }
}

/// The faces on the two sides of a neck, by the vertex that they belong to, without those on the collapsed
/// edge.
pub(crate) struct Neck {
    w: VertexId,
    of_u: [Vec<Corner>; 2],
    of_v: [Vec<Corner>; 2],
    of_w: [Vec<Corner>; 2],
}

impl Neck {
    /// Returns `None` if a vertex has faces outside its single fan, where the surface touches itself: they
    /// would be left behind.
    fn new(w: VertexId, u: VertexId, v: VertexId, [ru, rv, rw]: [&Ring; 3]) -> Option<Self> {
        let neck = Self {
            w,
            of_u: [arc(ru, v, w, v)?, arc(ru, w, v, v)?],
            of_v: [arc(rv, w, u, u)?, arc(rv, u, w, u)?],
            of_w: [arc(rw, u, v, w)?, arc(rw, v, u, w)?],
        };
        let is_all = |sides: &[Vec<Corner>; 2], ring: &Ring, shared: usize| {
            sides[0].len() + sides[1].len() + shared == ring.len()
        };
        // The two faces on the collapsed edge belong to neither side.
        (is_all(&neck.of_u, ru, 2) && is_all(&neck.of_v, rv, 2) && is_all(&neck.of_w, rw, 0)).then_some(neck)
    }

    /// True if both sides are sound after the cut: enough faces, no duplicates, and no other common
    /// neighbour of the ends on one side.
    fn is_sound(&self, common: &[VertexId], ru: &Ring, rv: &Ring) -> bool {
        let is_at = |corners: &[Corner], ring: &Ring, w: VertexId| {
            ring.iter().any(|r| r.has(w) && corners.contains(&r.corner))
        };
        let edges = |corners: &[Corner], ring: &Ring| -> Vec<[VertexId; 2]> {
            let of = ring.iter().filter(|r| corners.contains(&r.corner));
            of.map(|r| [r.a.min(r.b), r.a.max(r.b)]).collect()
        };
        (0..2).all(|i| {
            let (of_u, of_v) = (&self.of_u[i], &self.of_v[i]);
            let is_shared = |w: VertexId| w != self.w && is_at(of_u, ru, w) && is_at(of_v, rv, w);
            let rims = (edges(of_u, ru), edges(of_v, rv));
            of_u.len() + of_v.len() >= 3
                && self.of_w[i].len() >= 3
                && !common.iter().any(|&w| is_shared(w))
                // Two faces on the same three vertices would lie back to back.
                && !rims.0.iter().any(|e| rims.1.contains(e))
        })
    }
}

/// Returns the corners of a closed fan from the neighbour `from` to `to`, without faces that contain `not`.
fn arc(ring: &Ring, from: VertexId, to: VertexId, not: VertexId) -> Option<Vec<Corner>> {
    let (mut at, mut corners) = (from, Vec::new());
    for _ in 0..ring.len() {
        let spoke = ring.iter().find(|r| r.a == at)?;
        if !spoke.has(not) {
            corners.push(spoke.corner);
        }
        at = spoke.b;
        if at == to {
            return Some(corners);
        }
    }
    None
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the neck that blocks the collapse of u-v, if the surface may be cut there: all fans closed,
    /// and at least three faces left at each end of each side.
    #[inline(never)]
    pub(crate) fn neck(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
        tally: &mut Tally,
    ) -> Option<Neck> {
        let has_few = |ring: &Ring| ring.len() <= MAX_NECK_FACES;
        if !self.constraints.cuts_necks || !has_few(ru) || !has_few(rv) {
            return None;
        }
        let is_plain = |mesh: &Self, w: VertexId| {
            let kind = mesh.store.v[w.index()].kind;
            kind.is_regular() && !kind.is_seam() && kind.is_free()
        };
        if !is_plain(self, u) || !is_plain(self, v) || ru.iter().filter(|r| r.has(v)).count() != 2 {
            return None;
        }
        let is_apex = |w: VertexId| ru.iter().any(|r| r.has(v) && r.has(w));
        let common: Vec<VertexId> =
            distinct(ru).filter(|&w| w != v && !is_apex(w) && rv.iter().any(|r| r.has(w))).collect();
        let mut rw = Ring::default();
        for &w in &common {
            if !is_plain(self, w) {
                continue;
            }
            self.store.ring(w, &mut rw);
            if !has_few(&rw) {
                continue;
            }
            tally.faces_visited +=
                [ru, rv, &rw].map(|ring| (ring.len() * ring.len()) as u64).iter().sum::<u64>();
            let neck = Neck::new(w, u, v, [ru, rv, &rw]);
            if let Some(neck) = neck.filter(|n| n.is_sound(&common, ru, rv)) {
                return Some(neck);
            }
        }
        None
    }

    /// Collapses u-v and cuts the surface at the neck; the merged vertices move to the kept end + `y`. The
    /// wings are in the scratch. On the second side `v` stays alive.
    #[expect(clippy::too_many_arguments, reason = "those of a collapse, apart")]
    pub(super) fn cut(
        &mut self,
        u: VertexId,
        v: VertexId,
        y: Vec3,
        neck: &Neck,
        [ru, rv]: [&Ring; 2],
        scratch: &mut Scratch,
        tally: &mut Tally,
    ) {
        let w = neck.w;
        let (x, z) = (self.store.v[u.index()], self.store.v[v.index()]);
        let at = merged_position(x.p, z.p, y);
        self.merge_wedges(u, v, y, at, ru, &scratch.wings, &mut scratch.merge);
        if self.cost.metric.is_memoryless() {
            self.swap_planes(&scratch.wings);
        } else {
            let form: Form = self.cost.metric.form(&x.q, &z.q, z.p - x.p);
            let q = self.cost.metric.merged(&form, y);
            (self.store.v[u.index()].q, self.store.v[v.index()].q) = (q, q);
        }
        // Which end keeps its position, bit for bit.
        let is_place_of_u = at == x.p && !x.kind.is_moved();
        let is_place_of_v = !is_place_of_u && at == z.p && !z.kind.is_moved();
        if is_place_of_u {
            self.store.set_place(z.origin, x.origin);
        } else if is_place_of_v {
            self.store.set_place(x.origin, z.origin);
        }
        let is_moved = !(is_place_of_u || is_place_of_v);
        for end in [u, v] {
            let end = &mut self.store.v[end.index()];
            (end.p, end.kind) = (at, end.kind.moved(is_moved));
        }
        for spoke in rv.iter().filter(|r| r.has(u)) {
            self.store.remove_face(spoke.corner.face());
        }
        let other_w = self.store.duplicate_vertex(w);
        self.copy_cost_factor(self.store.v[w.index()].origin);
        self.merge_cost_factors(x.origin, z.origin);
        self.merge_cost_factors(z.origin, x.origin);
        let sides = |all: &[Vec<Corner>; 2], i: usize| all[i].clone();
        for i in 0..2 {
            let mut merged = sides(&neck.of_u, i);
            merged.extend(sides(&neck.of_v, i));
            self.store.set_corners([u, v][i], &merged);
            self.store.set_corners([w, other_w][i], &neck.of_w[i]);
        }
        self.split_samples([u, v]);
        self.split_samples([w, other_w]);
        let mut ring = Ring::default();
        for end in [u, v, w, other_w] {
            self.split_wedge(end, &mut ring);
        }
        for end in [u, v, w, other_w] {
            self.refresh(end, &mut ring);
            self.store.bound[end.index()] = super::bound::UNKNOWN;
        }
        tally.collapses += 1;
        tally.necks_cut += 1;
    }

    /// Separates vertices at the same position: moves each a little into its own star, as far as the guards
    /// allow. The store is compact.
    pub(crate) fn separate_touching(&mut self) {
        let place = |x: VertexId| self.store.p(x).to_array().map(|x| (x + 0.0).to_bits());
        let mut order: Vec<VertexId> = (0..self.store.v.len() as u32).map(VertexId).collect();
        order.sort_unstable_by_key(|&x| (place(x), x));
        let touching: Vec<VertexId> = order
            .chunk_by(|&a, &b| place(a) == place(b))
            .filter(|group| group.len() > 1)
            .flatten()
            .copied()
            .filter(|x| self.store.v[x.index()].kind.is_free())
            .collect();
        let guards = MoveGuards::new(&self.constraints.rules, &self.store);
        let mut ring = Ring::default();
        for x in touching {
            self.store.ring(x, &mut ring);
            let p = self.store.p(x);
            let around: Vec3 = ring.iter().map(|r| self.store.p(r.a) + self.store.p(r.b) - 2.0 * p).sum();
            let aside = p + around * (SEPARATION_SHARE / (2 * ring.len()).max(1) as f32);
            let place = match &guards {
                None => Some(aside),
                Some(guards) => guards.farthest(&self.store, x, aside, |_| true),
            };
            if let Some(place) = place {
                let own = &mut self.store.v[x.index()];
                (own.p, own.kind) = (place, own.kind.moved(true));
            }
        }
    }
}

impl<M: Metric> Engine<M> {
    /// Records a cut that was just made.
    #[inline(never)]
    pub(super) fn log_cut(&mut self, u: VertexId, v: VertexId, neck: &Neck, rings: [&Ring; 2], cost: f32) {
        let other_w = VertexId::new(self.mesh.store.v.len() - 1);
        let beside = neck.of_w.iter().flatten().map(|c| c.face());
        let faces = rings.into_iter().flatten().map(|r| r.corner.face()).chain(beside);
        self.log_change(faces, &[u, v, neck.w, other_w], cost);
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Distributes the samples of the first of two vertices at one position to both.
    fn split_samples(&mut self, ends: [VertexId; 2]) {
        let Some(mut late) = self.sampled.take() else { return };
        let mut ring = Ring::default();
        let stars = ends.map(|end| {
            self.store.ring(end, &mut ring);
            let mut star = Star::default();
            star.set(self.store.p(end), ring.iter().map(|r| [r.a, r.b].map(|w| (w, self.store.p(w)))));
            star
        });
        late.split(ends.map(|end| self.store.v[end.index()].origin), &stars);
        self.sampled = Some(late);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::candidate::CollapseOutcome;
    use crate::collapse::test_support::{checked, cost_at, engine_of, try_at, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::test_support::tube;

    /// Returns an engine of a tube that may be cut, and half the vector from vertex `k` of a ring to the
    /// next.
    fn engine(rings: u32, k: u32) -> (Engine<Memoryless>, Vec3) {
        let small = tube(rings);
        let half = (small.points[k as usize + 1] - small.points[k as usize]) * 0.5;
        let mut engine = engine_of(Memoryless, &small, &without_lines());
        engine.mesh.constraints.cuts_necks = true;
        (engine, half)
    }

    #[test]
    fn a_tube_is_cut_in_two_closed_parts() {
        // Three rings, two tips, 18 faces. The middle ring is the neck.
        let (mut engine, half) = engine(3, 3);
        assert_eq!(engine.mesh.part_count(), 1);
        assert!(matches!(try_at(&mut engine, [3, 4], half, f32::MAX), CollapseOutcome::Done));
        let (store, tally) = (&engine.mesh.store, &engine.tally);
        // The third vertex of the ring exists twice, and the merged vertex once for each part.
        assert_eq!((store.live_faces, store.live_vertices), (16, 12));
        assert_eq!((tally.collapses, tally.necks_cut), (1, 1));
        let at = |w: u32| store.p(VertexId(w));
        assert_eq!((at(3), at(5)), (at(4), at(11)));
        assert_eq!(store.place_of(store.v[11].origin), VertexId(5));
        assert_eq!(checked(&engine), Ok(()));
        engine.mesh.store.compact();
        assert_eq!(engine.mesh.part_count(), 2);
        // Each edge has two faces: three edges for two faces.
        let mut edges: Vec<[VertexId; 2]> = engine
            .mesh
            .store
            .t
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(|[u, v]| [u.min(v), u.max(v)]))
            .collect();
        edges.sort_unstable();
        assert!(edges.chunk_by(|a, b| a == b).all(|same| same.len() == 2));
    }

    #[test]
    fn a_neck_needs_three_faces_on_both_sides_and_vertices_that_may_move() {
        // With a single ring, each side is a tip.
        let (mut short, half) = engine(1, 0);
        assert_eq!(cost_at(&mut short, [0, 1], half), Err(Refusal::LinkCondition));
        let (mut locked, half) = engine(3, 3);
        locked.mesh.store.v[5].kind = locked.mesh.store.v[5].kind.locked(true);
        assert_eq!(cost_at(&mut locked, [3, 4], half), Err(Refusal::LinkCondition));
        let (mut uncut, half) = engine(3, 3);
        assert!(cost_at(&mut uncut, [3, 4], half).is_ok());
        uncut.mesh.constraints.cuts_necks = false;
        assert_eq!(cost_at(&mut uncut, [3, 4], half), Err(Refusal::LinkCondition));
    }

    #[test]
    fn necks_block_if_refusals_are_many_and_parts_are_large() {
        let (mut engine, _) = engine(20, 0);
        engine.mesh.constraints.cuts_necks = false;
        assert_eq!(engine.tally.first_faces, 120);
        (engine.tally.collapses, engine.tally.refusals[Refusal::LinkCondition as usize]) = (10, 6);
        assert!(engine.has_blocking_necks());
        engine.tally.refusals[Refusal::LinkCondition as usize] = 5;
        assert!(!engine.has_blocking_necks(), "half of the collapses is not more than half");
        (engine.tally.is_unproductive, engine.tally.while_productive.0) = (true, 10);
        assert!(!engine.has_blocking_necks(), "five of one late collapse");
        engine.tally.collapses = 21;
        engine.tally.while_productive.0 = 20;
        engine.tally.refusals[Refusal::LinkCondition as usize] = 9;
        assert!(engine.has_blocking_necks(), "nine of one late collapse");
        engine.tally.first_faces = 99;
        assert!(!engine.has_blocking_necks(), "a part of fewer than a hundred faces");
    }

    #[test]
    fn topology_and_placement_decide_whether_cuts_are_allowed() {
        let may = |topology, placement| {
            let mut options = SimplifyOptions::default();
            (options.topology, options.placement) = (topology, placement);
            may_cut(&options)
        };
        assert!(
            may(TopologyPolicy::Relaxed, Placement::Optimal)
                && may(TopologyPolicy::Free, Placement::Endpoint)
        );
        assert!(
            !may(TopologyPolicy::Relaxed, Placement::Endpoint)
                && !may(TopologyPolicy::Preserve, Placement::Optimal)
        );
    }
}
