//! Whether an edge can go without pinching the surface. [Dey 1999]
//!
//! In a complex of triangles the edge u-v may be contracted when Lk(u) ∩ Lk(v) = Lk(uv): the ends share no neighbour but
//! the apexes of their common triangles, and no edge is opposite to both ends. Edges with a number of faces other than
//! two (borders, non-manifold curves) count as joined to one more vertex, so two feature vertices may only be merged
//! along a feature edge.

use lodsmith_core::VertexId;
use wide::u32x4;

use super::kind::faces_at;
use super::store::{Ring, Store};
use crate::metric::Memory;
use crate::report::Refusal;

impl<Q: Memory> Store<Q> {
    /// Asks the link condition for the edge u-v with the rings of both; says how many triangles hang on it.
    #[inline(always)]
    pub(crate) fn link_condition(
        &mut self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<usize, Refusal> {
        let (ku, kv) = (self.v[u.index()].kind, self.v[v.index()].kind);
        if !(ku.is_regular() && kv.is_regular()) {
            return self.link_condition_irregular(u, v, ru, rv);
        }
        // Inside closed fans every neighbour comes first in just one triangle, and second in just one.
        let (1..=2, [first, rest @ ..]) = (ru.fours().len(), rv.fours()) else {
            return self.link_condition_marked(u, v, ru, rv);
        };
        let second = match rest {
            [] => first,
            [second] => second,
            _ => return self.link_condition_marked(u, v, ru, rv),
        };
        let around_v: [u32x4; 2] = [first, second].map(|four| u32x4::new(four.each_ref().map(|r| r.a.0)));
        let (mut common, mut is_joined) = ([u32x4::ZERO; 2], false);
        for r in ru {
            let w = u32x4::splat(r.a.0);
            common = [common[0] | around_v[0].simd_eq(w), common[1] | around_v[1].simd_eq(w)];
            is_joined |= r.a == v;
        }
        // A bit for each of the neighbours of v that is one of u as well.
        let common = (common[0].to_bitmask() | common[1].to_bitmask() << 4) & ((1 << rv.len()) - 1);
        let other = common & common.wrapping_sub(1);
        if !is_joined || other == 0 || other & (other - 1) != 0 {
            return Err(Refusal::LinkCondition);
        }
        let [one, other] = [common, other].map(|bits| &rv[bits.trailing_zeros() as usize]);
        if (one.b == other.a || other.b == one.a) && is_opposite_to_both(u, v, ru, rv) {
            return Err(Refusal::LinkCondition);
        }
        Ok(2)
    }

    /// The same for closed fans of any size.
    #[inline(never)]
    fn link_condition_marked(
        &mut self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<usize, Refusal> {
        let stamp = self.next_stamp();
        let (mut shared, mut common, mut opposite) = (0, 0, false);
        for r in ru {
            self.v[r.a.index()].mark = stamp;
            shared += usize::from(r.has(v));
        }
        for r in rv {
            let is_common = (r.a != u) & (self.v[r.a.index()].mark == stamp);
            common += usize::from(is_common);
            opposite |= is_common & (r.b != u) & (self.v[r.b.index()].mark == stamp);
        }
        let pinched = common != shared || shared == 0 || opposite && is_opposite_to_both(u, v, ru, rv);
        if pinched { Err(Refusal::LinkCondition) } else { Ok(shared) }
    }

    #[inline(never)]
    fn link_condition_irregular(
        &mut self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
    ) -> Result<usize, Refusal> {
        let (ku, kv) = (self.v[u.index()].kind, self.v[v.index()].kind);
        // One stamp for the neighbours of u, the next for those that are counted already.
        let stamp = self.next_stamp();
        for w in ru.iter().flat_map(|r| [r.a, r.b]) {
            self.v[w.index()].mark = stamp;
        }
        let mut common = 0;
        for w in rv.iter().flat_map(|r| [r.a, r.b]) {
            let mark = &mut self.v[w.index()].mark;
            if *mark == stamp && w != u {
                *mark = stamp + 1;
                common += 1;
            }
        }
        // (Every apex is a common neighbour, so all are marked as counted by now.)
        let (mut shared, mut apexes) = (0, 0);
        for r in ru.iter().filter(|r| r.has(v)) {
            shared += 1;
            let mark = &mut self.v[if r.a == v { r.b } else { r.a }.index()].mark;
            apexes += usize::from(*mark == stamp + 1);
            *mark = stamp;
        }
        let by_u = |w: VertexId| self.v[w.index()].mark >= stamp;
        let opposite = rv.iter().any(|r| !r.has(u) && by_u(r.a) && by_u(r.b));
        if shared == 0 || common != apexes || opposite && is_opposite_to_both(u, v, ru, rv) {
            return Err(Refusal::LinkCondition);
        }
        if ku.is_feature() && kv.is_feature() && shared == 2 {
            return Err(Refusal::LinkCondition);
        }
        // The two edges to an apex become one: with no face it would hang on nothing, and it may be a border only where
        // one of the two was.
        for w in ru.iter().filter(|r| r.has(v)).map(|r| if r.a == v { r.b } else { r.a }) {
            let both = ru.iter().filter(|r| r.has(v) && r.has(w)).count();
            let (at_u, at_v) = (faces_at(ru, w), faces_at(rv, w));
            let left = (at_u + at_v).saturating_sub(2 * both);
            if left == 0 || left == 1 && at_u != 1 && at_v != 1 {
                return Err(Refusal::LinkCondition);
            }
        }
        Ok(shared)
    }
}

/// Whether an edge is opposite to both ends: its two triangles would become one twice.
fn is_opposite_to_both(u: VertexId, v: VertexId, ru: &Ring, rv: &Ring) -> bool {
    let off_u = || ru.iter().filter(|r| !r.has(v));
    rv.iter().filter(|r| !r.has(u)).any(|z| off_u().any(|x| x.has(z.a) && x.has(z.b)))
}
