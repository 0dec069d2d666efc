//! Link condition: whether an edge can be collapsed without pinching the surface. [Dey 1999]
//!
//! In a complex of triangles the edge u-v may be contracted when Lk(u) ∩ Lk(v) = Lk(uv): the ends share no
//! neighbours except the apexes of their common triangles, and no edge is opposite to both ends. Edges with a
//! number of faces other than two (borders, non-manifold curves) count as joined to one more vertex, so two
//! feature vertices may only be merged along a feature edge. This test is less strict in one case: if both
//! edges to an apex are features, the paper keeps the face between the two lines; here they may be merged,
//! unless that leaves no face at all, or creates a border.

use lodsmith_core::VertexId;
use wide::u32x4;

use super::marks::Marks;
use super::order::NONE;
use super::ring::{Ring, faces_at};
use super::store::Store;
use crate::cost::metric::VertexMemory;
use crate::report::Refusal;

impl<Q: VertexMemory> Store<Q> {
    /// Tests the link condition for the edge u-v with the rings of both; returns the number of triangles on
    /// the edge.
    #[inline(always)]
    pub(super) fn link_condition(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
        marks: &mut Marks,
    ) -> Result<usize, Refusal> {
        let (ku, kv) = (self.v[u.index()].kind, self.v[v.index()].kind);
        if !(ku.is_regular() && kv.is_regular()) {
            return self.link_condition_irregular(u, v, ru, rv, marks);
        }
        // Inside closed fans every neighbour comes first in just one triangle, and second in just one.
        let (1..=2, [first, rest @ ..]) = (ru.fours().len(), rv.fours()) else {
            return link_condition_marked(u, v, ru, rv, marks);
        };
        let second = match rest {
            [] => first,
            [second] => second,
            _ => return link_condition_marked(u, v, ru, rv, marks),
        };
        let around_v: [u32x4; 2] = [first, second].map(|four| u32x4::new(four.each_ref().map(|r| r.a.0)));
        let (mut common, mut apex) = ([u32x4::ZERO; 2], NONE);
        for r in ru {
            let w = u32x4::splat(r.a.0);
            common = [common[0] | around_v[0].simd_eq(w), common[1] | around_v[1].simd_eq(w)];
            apex = if r.b == v { r.a } else { apex };
        }
        // One bit for each neighbour of v that is also a neighbour of u.
        let common = (common[0].to_bitmask() | common[1].to_bitmask() << 4) & ((1 << rv.len()) - 1);
        let other = common & common.wrapping_sub(1);
        if apex == NONE || other == 0 || other & (other - 1) != 0 {
            return Err(Refusal::LinkCondition);
        }
        let [one, other] = [common, other].map(|bits| &rv[bits.trailing_zeros() as usize]);
        // Two triangles back to back have the same apex: then only one of the two neighbours is an apex.
        if (if one.a == apex { one } else { other }).b == u {
            return Err(Refusal::LinkCondition);
        }
        if (one.b == other.a || other.b == one.a) && is_opposite_to_both(u, v, ru, rv) {
            return Err(Refusal::LinkCondition);
        }
        Ok(2)
    }

    #[inline(never)]
    fn link_condition_irregular(
        &self,
        u: VertexId,
        v: VertexId,
        ru: &Ring,
        rv: &Ring,
        marks: &mut Marks,
    ) -> Result<usize, Refusal> {
        /// Marks of a neighbour of u, of a common neighbour that was counted, and of an apex.
        const OF_U: u32 = 0;
        const COUNTED: u32 = 1;
        const APEX: u32 = 2;
        let (ku, kv) = (self.v[u.index()].kind, self.v[v.index()].kind);
        marks.clear(2 * ru.len());
        for w in ru.iter().flat_map(|r| [r.a, r.b]) {
            marks.set(w, OF_U);
        }
        let mut common = 0;
        for w in rv.iter().flat_map(|r| [r.a, r.b]) {
            if w != u && marks.get(w) == Some(OF_U) {
                marks.set(w, COUNTED);
                common += 1;
            }
        }
        // (Every apex is a common neighbour, so all are marked as counted by now.)
        let (mut shared, mut apexes) = (0, 0);
        for r in ru.iter().filter(|r| r.has(v)) {
            shared += 1;
            let apex = if r.a == v { r.b } else { r.a };
            apexes += usize::from(marks.set(apex, APEX) == Some(COUNTED));
        }
        let by_u = |w: VertexId| marks.get(w).is_some();
        let opposite = rv.iter().any(|r| !r.has(u) && by_u(r.a) && by_u(r.b));
        if shared == 0 || common != apexes || opposite && is_opposite_to_both(u, v, ru, rv) {
            return Err(Refusal::LinkCondition);
        }
        if ku.is_feature() && kv.is_feature() && shared == 2 {
            return Err(Refusal::LinkCondition);
        }
        // The two edges to an apex become one: it must have a face, and may be a border only if one of the
        // two was one.
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

/// Link condition for closed fans of any size.
#[inline(never)]
fn link_condition_marked(
    u: VertexId,
    v: VertexId,
    ru: &Ring,
    rv: &Ring,
    marks: &mut Marks,
) -> Result<usize, Refusal> {
    marks.clear(ru.len());
    let (mut shared, mut common, mut opposite) = (0, 0, false);
    let mut apexes = [NONE; 2];
    for r in ru {
        marks.set(r.a, 0);
        shared += usize::from(r.has(v));
        if r.a == v {
            apexes[0] = r.b;
        } else if r.b == v {
            apexes[1] = r.a;
        }
    }
    for r in rv {
        let is_common = r.a != u && marks.get(r.a).is_some();
        common += usize::from(is_common);
        opposite |= is_common && r.b != u && marks.get(r.b).is_some();
    }
    // (Two triangles back to back have one apex.)
    let pinched = common != shared || apexes[0] == apexes[1] || opposite && is_opposite_to_both(u, v, ru, rv);
    if pinched { Err(Refusal::LinkCondition) } else { Ok(shared) }
}

/// True if an edge is opposite to both ends: its two triangles would become duplicates.
fn is_opposite_to_both(u: VertexId, v: VertexId, ru: &Ring, rv: &Ring) -> bool {
    let off_u = || ru.iter().filter(|r| !r.has(v));
    rv.iter().filter(|r| !r.has(u)).any(|z| off_u().any(|x| x.has(z.a) && x.has(z.b)))
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use glam::Vec3;
    use lodsmith_core::arbitrary::{Coordinates, perturbed_shape, soup};
    use lodsmith_core::shapes;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::collapse::kind::Kind;
    use crate::cost::tensor::Tensor;
    use crate::options::BorderPolicy;

    /// Creates a store of these faces, without degenerate and duplicate ones, and classifies its vertices.
    fn store(faces: impl IntoIterator<Item = [u32; 3]>) -> Store<Tensor> {
        let (mut seen, mut sound) = (BTreeSet::new(), Vec::new());
        for [a, b, c] in faces {
            // Starts at the lowest corner, so that equal winding gives equal arrays.
            let t = [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or_default();
            if a != b && b != c && c != a && seen.insert(t) {
                sound.push([a, b, c].map(VertexId));
            }
        }
        let count = sound.as_flattened().iter().map(|w| w.index() + 1).max().unwrap_or(0);
        let mut store = Store::new(&vec![Vec3::ZERO; count], sound, None, None);
        store.link();
        let mut ring = Ring::default();
        for u in (0..count).map(VertexId::new) {
            store.ring(u, &mut ring);
            store.v[u.index()].kind = Kind::of(&ring, BorderPolicy::Keep);
        }
        store
    }

    fn edges(store: &Store<Tensor>) -> BTreeSet<[VertexId; 2]> {
        store
            .t
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(|[u, v]| [u.min(v), u.max(v)]))
            .collect()
    }

    /// A simplex: its vertices in order.
    type Simplex = BTreeSet<u32>;
    /// The vertex that all feature edges are joined to.
    const OMEGA: u32 = u32::MAX;

    /// The complex of a mesh and, with [`OMEGA`], the cone over its edges that do not have two faces:
    /// exactly as in the paper.
    struct Complex {
        all: BTreeSet<Simplex>,
        features: BTreeSet<Simplex>,
    }

    impl Complex {
        fn new(store: &Store<Tensor>) -> Self {
            let mut faces_at: BTreeMap<Simplex, usize> = BTreeMap::new();
            let mut all = BTreeSet::new();
            let mut add = |simplex: Simplex| {
                // Adds the simplex with all its faces.
                let vertices: Vec<u32> = simplex.into_iter().collect();
                for bits in 1u32..1 << vertices.len() {
                    all.insert(
                        (0..vertices.len()).filter(|i| bits & 1 << i != 0).map(|i| vertices[i]).collect(),
                    );
                }
            };
            for &[a, b, c] in &store.t {
                for [u, v] in [[a, b], [b, c], [c, a]] {
                    *faces_at.entry([u.0, v.0].into()).or_default() += 1;
                }
                add([a.0, b.0, c.0].into());
            }
            let features: BTreeSet<Simplex> =
                faces_at.into_iter().filter(|e| e.1 != 2).map(|e| e.0).collect();
            for edge in &features {
                add(edge.iter().copied().chain([OMEGA]).collect());
            }
            Self { all, features }
        }

        /// Returns the link of a simplex: simplices disjoint from it that form a simplex of the complex
        /// together with it.
        fn link(&self, of: &Simplex) -> BTreeSet<Simplex> {
            let beside = |s: &&Simplex| s.is_superset(of) && s.len() > of.len();
            self.all.iter().filter(beside).map(|s| s - of).collect()
        }

        /// Returns Lk(u) ∩ Lk(v) without Lk(uv).
        fn too_much(&self, u: VertexId, v: VertexId) -> Vec<Simplex> {
            let (of_u, of_v) = (self.link(&[u.0].into()), self.link(&[v.0].into()));
            let of_edge = self.link(&[u.0, v.0].into());
            assert!(of_edge.is_subset(&of_u) && of_edge.is_subset(&of_v));
            of_u.intersection(&of_v).filter(|s| !of_edge.contains(*s)).cloned().collect()
        }
    }

    fn rings(store: &Store<Tensor>, [u, v]: [VertexId; 2]) -> [Ring; 2] {
        [u, v].map(|w| {
            let mut ring = Ring::default();
            store.ring(w, &mut ring);
            ring
        })
    }

    /// Compares the specialized tests for closed fans with the general test, and with the paper. Returns the
    /// numbers of edges that may and may not be collapsed.
    fn closed_fans_agree(faces: impl IntoIterator<Item = [u32; 3]>) -> Result<[usize; 2], String> {
        let store = store(faces);
        let (complex, mut counts) = (Complex::new(&store), [0; 2]);
        for [u, v] in edges(&store) {
            if ![u, v].iter().all(|w| store.v[w.index()].kind.is_regular()) {
                continue;
            }
            let [ru, rv] = rings(&store, [u, v]);
            // Of two faces back to back, which the paper counts as one, nothing would be left.
            let apexes: Vec<VertexId> =
                ru.iter().filter(|r| r.has(v)).map(|r| if r.a == v { r.b } else { r.a }).collect();
            let is_sound = complex.too_much(u, v).is_empty() && apexes[0] != apexes[1];
            let wanted = if is_sound { Ok(2) } else { Err(Refusal::LinkCondition) };
            let mut marks = Marks::default();
            let results = [
                store.link_condition(u, v, &ru, &rv, &mut marks),
                store.link_condition(v, u, &rv, &ru, &mut marks),
                link_condition_marked(u, v, &ru, &rv, &mut marks),
                store.link_condition_irregular(u, v, &ru, &rv, &mut marks),
            ];
            if results != [wanted; 4] {
                return Err(format!(
                    "{u}-{v} with {} and {} faces: {wanted:?}, not {results:?}",
                    ru.len(),
                    rv.len()
                ));
            }
            counts[usize::from(wanted.is_err())] += 1;
        }
        Ok(counts)
    }

    fn raw(faces: &[[lodsmith_core::WedgeId; 3]]) -> Vec<[u32; 3]> {
        faces.iter().map(|t| t.map(|w| w.0)).collect()
    }

    /// Flips the edge between two faces of consistent winding: fans stay closed, and necks are created.
    fn flip(faces: &mut [[u32; 3]], edge: usize) {
        let (f, k) = (edge / 3 % faces.len(), edge % 3);
        let [a, b, c] = [0, 1, 2].map(|i| faces[f][(k + i) % 3]);
        let other = |t: &[u32; 3]| (0..3).find(|&i| t[i] == b && t[(i + 1) % 3] == a).map(|i| t[(i + 2) % 3]);
        let found = faces.iter().enumerate().find_map(|(g, t)| other(t).map(|d| (g, d)));
        if let Some((g, d)) = found.filter(|x| x.1 != c) {
            (faces[f], faces[g]) = ([c, a, d], [c, d, b]);
        }
    }

    #[test]
    fn shapes_have_edges_of_both_kinds_on_closed_fans() {
        // A wheel of many spokes over another: rings of more than eight.
        let wheels = (0..20u32).flat_map(|i| [[20, i, (i + 1) % 20], [21, (i + 1) % 20, i]]);
        assert_eq!(closed_fans_agree(wheels), Ok([60, 0]));
        // By the paper, no edge may be collapsed of a torus of three by three, nor of a tetrahedron.
        assert_eq!(closed_fans_agree(raw(shapes::torus(3, 3).triangles())), Ok([0, 27]));
        assert_eq!(closed_fans_agree(raw(shapes::tetrahedron().triangles())), Ok([0, 6]));
    }

    #[test]
    fn faces_back_to_back_have_a_single_apex() {
        // 0-1 has the faces 0 1 2 and 0 2 1, and both ends are adjacent to 3. Each star is two closed fans.
        let [back_to_back, of_0] = [[[0, 1, 2], [0, 2, 1]], [[0, 3, 4], [0, 4, 3]]];
        let small = [back_to_back, of_0].concat().into_iter().chain([[1, 5, 6], [1, 6, 3], [1, 3, 5]]);
        let many = (0..9u32).map(|i| [1, 10 + i, 10 + (i + 1) % 9]).chain([[1, 3, 7], [1, 7, 3]]);
        assert_eq!(closed_fans_agree(small).map(|counts| counts[1] > 0), Ok(true));
        let large = back_to_back.into_iter().chain(of_0).chain(many);
        assert_eq!(closed_fans_agree(large).map(|counts| counts[1] > 0), Ok(true));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(96) })]

        #[test]
        fn all_tests_agree_on_closed_fans(
            shape in 0..4usize,
            flips in vec(any::<u16>(), 0..60),
        ) {
            let meshes = [shapes::icosphere(1), shapes::torus(5, 4), shapes::torus(9, 3), shapes::tetrahedra(2)];
            let mut faces = raw(meshes[shape].triangles());
            for edge in flips {
                flip(&mut faces, usize::from(edge));
            }
            let found = closed_fans_agree(faces);
            prop_assert!(found.is_ok(), "{found:?}");
        }

        #[test]
        fn any_mesh_gives_the_same_result_as_the_paper(
            mesh in prop_oneof![
                3 => soup(12, Coordinates::Tame),
                2 => soup(40, Coordinates::Tame),
                1 => perturbed_shape(0.0).prop_filter("small", |m| m.face_count() < 80),
            ],
        ) {
            let faces: Vec<[u32; 3]> =
                mesh.triangles().iter().map(|t| t.map(|w| mesh.vertex_of(w).0)).collect();
            let found = closed_fans_agree(faces.iter().copied());
            prop_assert!(found.is_ok(), "{found:?}");
            let store = store(faces);
            let complex = Complex::new(&store);
            for [u, v] in edges(&store) {
                let [ru, rv] = rings(&store, [u, v]);
                let mut marks = Marks::default();
                let result = store.link_condition(u, v, &ru, &rv, &mut marks);
                let reversed = store.link_condition(v, u, &rv, &ru, &mut marks);
                prop_assert_eq!(result, reversed, "{}-{}, in either direction", u, v);
                let found = complex.too_much(u, v);
                let is_feature = |a: VertexId, b: u32| complex.features.contains(&[a.0, b].into());
                // If both edges to a common neighbour are features, the paper keeps the face between them.
                // Here it may be removed, unless that creates a border, or leaves nothing.
                let merges_lines = |s: &Simplex| {
                    let line = s.iter().find(|w| **w != OMEGA).filter(|_| s.len() == 2 && s.contains(&OMEGA));
                    line.is_some_and(|&w| is_feature(u, w) && is_feature(v, w) && faces_at(&ru, v) > 0)
                };
                let (lines, others): (Vec<&Simplex>, Vec<&Simplex>) = found.iter().partition(|s| merges_lines(s));
                if !others.is_empty() {
                    prop_assert_eq!(result, Err(Refusal::LinkCondition), "{}-{} share {:?}", u, v, others);
                    continue;
                }
                // The remaining faces of an edge to an apex.
                let mut is_hollow = false;
                for w in ru.iter().filter(|r| r.has(v)).map(|r| if r.a == v { r.b } else { r.a }) {
                    let gone = ru.iter().filter(|r| r.has(v) && r.has(w)).count();
                    let (at_u, at_v) = (faces_at(&ru, w), faces_at(&rv, w));
                    let left = at_u + at_v - 2 * gone;
                    is_hollow |= left == 0 || left == 1 && at_u != 1 && at_v != 1;
                }
                // Without such lines, an edge to an apex is hollow only with two faces on the same three
                // vertices.
                let is_doubled = || {
                    let same = |s: &&crate::collapse::ring::Spoke| ru.iter().filter(|r| r.has(s.a) && r.has(s.b)).count();
                    ru.iter().filter(|r| r.has(v)).any(|r| same(&r) > 1)
                };
                prop_assert!(!is_hollow || !lines.is_empty() || is_doubled(), "{u}-{v} is hollow");
                let wanted = if is_hollow { Err(Refusal::LinkCondition) } else { Ok(faces_at(&ru, v)) };
                prop_assert_eq!(result, wanted, "{}-{}, lines {:?}", u, v, lines);
            }
        }
    }
}
