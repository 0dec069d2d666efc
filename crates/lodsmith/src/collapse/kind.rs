//! Classification of vertices by their edges (inside, on a border, on a non-manifold curve), and the
//! freedom to move that follows.

use lodsmith_core::VertexId;

use super::ring::{SHORT_RING, Spoke, distinct, faces_at, is_closed_fan};
use crate::options::BorderPolicy;

/// Kind of a vertex as flags; without flags the vertex is inside a closed, oriented fan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Kind(u32);

impl Kind {
    /// Some neighbour is not exactly once first and once second in the triangles around the vertex.
    const IRREGULAR: u32 = 1;
    /// On two border edges, otherwise regular.
    const BORDER: u32 = 2;
    /// On an edge of three or more faces, or where borders meet.
    const COMPLEX: u32 = 4;
    /// Moves only along its own line of feature edges.
    const RAIL: u32 = 8;
    /// Does not move.
    const FIXED: u32 = 16;
    /// It is no longer at the position of an input vertex.
    const MOVED: u32 = 32;
    /// Merged into another.
    const GONE: u32 = 64;
    /// On an edge whose sides differ in wedges or regions.
    const SEAM: u32 = 128;
    /// Locked by the caller.
    const LOCKED: u32 = 256;

    /// Returns the kind of a vertex with this star.
    pub(crate) fn of(ring: &[Spoke], border: BorderPolicy) -> Self {
        if is_closed_fan(ring.iter().map(|r| (r.a, r.b))) {
            return Self::default();
        }
        let mut bits = Self::IRREGULAR;
        let (mut open, mut many) = (0, 0);
        let mut count = |faces: usize| {
            open += usize::from(faces == 1);
            many += usize::from(faces > 2);
        };
        if ring.len() <= SHORT_RING {
            distinct(ring).for_each(|w| count(faces_at(ring, w)));
        } else {
            let mut ends: Vec<VertexId> = ring.iter().flat_map(|r| [r.a, r.b]).collect();
            ends.sort_unstable();
            ends.chunk_by(|a, b| a == b).for_each(|same| count(same.len()));
        }
        match (open, many) {
            (0, 0) => {} // only wound differently
            (2, 0) => {
                bits |= Self::BORDER;
                bits |= match border {
                    BorderPolicy::Slide => Self::RAIL,
                    BorderPolicy::Lock => Self::FIXED,
                    BorderPolicy::Keep | BorderPolicy::Free => 0,
                };
            }
            // The line tensors keep them in place.
            (0, 2) => bits |= Self::COMPLEX,
            _ => bits |= Self::COMPLEX | Self::FIXED,
        }
        Self(bits)
    }

    /// True if every neighbour comes first in just one triangle.
    #[inline(always)]
    pub(crate) fn is_regular(self) -> bool {
        self.0 & Self::IRREGULAR == 0
    }
    /// True if it has an edge with a number of faces other than two.
    #[inline(always)]
    pub(crate) fn is_feature(self) -> bool {
        self.0 & (Self::BORDER | Self::COMPLEX) != 0
    }
    #[inline(always)]
    pub(crate) fn is_seam(self) -> bool {
        self.0 & Self::SEAM != 0
    }
    /// True if it has an edge that carries a line: a feature or a seam.
    #[inline(always)]
    pub(crate) fn has_lines(self) -> bool {
        self.0 & (Self::BORDER | Self::COMPLEX | Self::SEAM) != 0
    }
    #[inline(always)]
    pub(crate) fn is_border(self) -> bool {
        self.0 & Self::BORDER != 0
    }
    #[inline(always)]
    pub(crate) fn is_complex(self) -> bool {
        self.0 & Self::COMPLEX != 0
    }
    #[inline(always)]
    pub(crate) fn is_rail(self) -> bool {
        self.0 & Self::RAIL != 0
    }
    #[inline(always)]
    pub(crate) fn is_fixed(self) -> bool {
        self.0 & (Self::FIXED | Self::LOCKED) != 0
    }
    #[inline(always)]
    pub(crate) fn is_locked(self) -> bool {
        self.0 & Self::LOCKED != 0
    }
    /// True if it may move anywhere.
    #[inline(always)]
    pub(crate) fn is_free(self) -> bool {
        self.0 & (Self::FIXED | Self::RAIL | Self::LOCKED) == 0
    }
    #[inline(always)]
    pub(crate) fn is_moved(self) -> bool {
        self.0 & Self::MOVED != 0
    }
    #[inline(always)]
    pub(crate) fn is_gone(self) -> bool {
        self.0 & Self::GONE != 0
    }
    #[inline(always)]
    pub(crate) fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    #[inline(always)]
    pub(crate) fn moved(self, moved: bool) -> Self {
        Self(if moved { self.0 | Self::MOVED } else { self.0 & !Self::MOVED })
    }
    #[inline(always)]
    pub(crate) fn on_seam(self, seam: bool) -> Self {
        Self(if seam { self.0 | Self::SEAM } else { self.0 & !Self::SEAM })
    }
    #[inline(always)]
    pub(crate) fn locked(self, locked: bool) -> Self {
        Self(if locked { self.0 | Self::LOCKED } else { self.0 & !Self::LOCKED })
    }
    /// Returns the kind with the flags of another that may be stale: irregular and on a seam.
    pub(crate) fn with_stale(self, other: Self) -> Self {
        Self(self.0 | other.0 & (Self::IRREGULAR | Self::SEAM))
    }
    #[inline(always)]
    pub(crate) fn gone(self) -> Self {
        Self(self.0 | Self::GONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::ring::Corner;

    fn ring(pairs: &[[u32; 2]]) -> Vec<Spoke> {
        let spoke = |p: &[u32; 2]| Spoke { corner: Corner::default(), a: VertexId(p[0]), b: VertexId(p[1]) };
        pairs.iter().map(spoke).collect()
    }

    #[test]
    fn a_closed_fan_is_regular() {
        let kind = Kind::of(&ring(&[[1, 2], [2, 3], [3, 1]]), BorderPolicy::Lock);
        assert_eq!(kind, Kind::default());
    }

    #[test]
    fn repeated_neighbours_are_not_regular() {
        // Two sheets on top of each other, and fans in which only the first or only the second corners
        // differ.
        for twice in
            [&[[1, 2], [2, 1], [1, 2], [2, 1]][..], &[[1, 3], [2, 3], [3, 3]], &[[3, 1], [3, 2], [3, 3]]]
        {
            assert!(!Kind::of(&ring(twice), BorderPolicy::Lock).is_regular(), "{twice:?}");
        }
    }

    #[test]
    fn large_fans_are_closed_too() {
        let wheel = |n: u32| (0..n).map(|i| [i, (i + 1) % n]).collect::<Vec<_>>();
        for n in [3, 8, 9, 40] {
            assert!(Kind::of(&ring(&wheel(n)), BorderPolicy::Lock).is_regular(), "{n} triangles");
            assert!(
                !Kind::of(&ring(&wheel(n)[1..]), BorderPolicy::Lock).is_regular(),
                "{n} triangles but one"
            );
        }
    }

    #[test]
    fn an_open_fan_lies_on_a_border() {
        //  2---1
        //   \ / \
        //    u---0      border edges u-0 and u-2
        let open = ring(&[[0, 1], [1, 2]]);
        let kind = Kind::of(&open, BorderPolicy::Keep);
        assert!(kind.is_border() && kind.is_free() && !kind.is_regular());
        assert!(Kind::of(&open, BorderPolicy::Slide).is_rail());
        assert!(Kind::of(&open, BorderPolicy::Lock).is_fixed());
    }

    #[test]
    fn a_fan_with_mixed_winding_is_no_feature() {
        let kind = Kind::of(&ring(&[[1, 2], [3, 2], [3, 1]]), BorderPolicy::Keep);
        assert!(!kind.is_feature() && !kind.is_regular() && kind.is_free());
    }

    #[test]
    fn a_vertex_where_two_borders_meet_is_fixed() {
        assert!(Kind::of(&ring(&[[0, 1], [2, 3]]), BorderPolicy::Keep).is_fixed());
        // Three pages of a book: the spine continues to 8 and 9.
        let book = ring(&[[8, 1], [1, 9], [8, 2], [2, 9], [8, 3], [3, 9]]);
        let kind = Kind::of(&book, BorderPolicy::Keep);
        assert!(kind.is_complex() && kind.is_free());
    }

    #[test]
    fn long_rings_give_the_same_kinds_as_short_ones() {
        for n in [3, SHORT_RING - 1, SHORT_RING, SHORT_RING + 1, 3 * SHORT_RING] {
            let wheel: Vec<[u32; 2]> = (0..n as u32).map(|i| [7 * i, 7 * ((i + 1) % n as u32)]).collect();
            // An additional face at neighbour 7.
            let book = [&wheel[..], &[[7, 9999]]].concat();
            let cases = [
                (&wheel[..], [false; 3]),
                (&wheel[1..], [true, false, false]),
                (&book[..], [false, true, true]),
            ];
            for (pairs, wanted) in cases {
                let ring = ring(pairs);
                let kind = Kind::of(&ring, BorderPolicy::Keep);
                assert_eq!(
                    [kind.is_border(), kind.is_complex(), kind.is_fixed()],
                    wanted,
                    "{} of {n}",
                    ring.len()
                );
                assert_eq!(kind.is_regular(), wanted == [false; 3]);
                let mut each: Vec<VertexId> = Vec::new();
                for w in ring.iter().flat_map(|r| [r.a, r.b]) {
                    if !each.contains(&w) {
                        each.push(w);
                    }
                }
                assert_eq!(distinct(&ring).collect::<Vec<_>>(), each);
            }
        }
    }
}
