//! The triangles around a vertex: corners, the ring of one vertex, and queries about its neighbours.

use std::collections::HashMap;

use lodsmith_core::VertexId;
use wide::u32x8;

/// Number of faces of a ring up to which a neighbour is found by walking the ring. In larger rings
/// neighbours are sorted or hashed, so that a vertex of n faces costs O(n log n), not O(n²). (Guessed; the
/// results do not depend on it.)
pub(super) const SHORT_RING: usize = 64;

/// A corner of a triangle: four times its index, and 0, 1 or 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct Corner(u32);

impl Corner {
    #[inline(always)]
    pub(crate) const fn new(face: usize, k: usize) -> Self {
        Self((face * 4 + k) as u32)
    }
    #[inline(always)]
    pub(crate) fn face(self) -> usize {
        (self.0 >> 2) as usize
    }
    #[inline(always)]
    pub(crate) fn k(self) -> usize {
        (self.0 & 3) as usize
    }
}

/// A corner relative to its vertex: the other two vertices of the triangle, in order.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spoke {
    pub(crate) corner: Corner,
    pub(crate) a: VertexId,
    pub(crate) b: VertexId,
}

impl Spoke {
    #[inline(always)]
    pub(crate) fn has(&self, w: VertexId) -> bool {
        (self.a == w) | (self.b == w)
    }
}

/// The live corners of a vertex, in a grow-only scratch buffer that is filled for one vertex after another.
/// It is padded to a multiple of four with copies of the last entry.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ring {
    room: Vec<Spoke>,
    count: usize,
}

impl Ring {
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Returns room for `count` entries and three of padding.
    #[inline(always)]
    pub(super) fn room(&mut self, count: usize) -> &mut [Spoke] {
        if self.room.len() < count + 3 {
            self.grow(count + 3);
        }
        &mut self.room[..count + 3]
    }

    /// Sets the count and pads with copies of the last entry.
    #[inline(always)]
    pub(super) fn end(&mut self, count: usize) {
        self.count = count;
        if let Some(last) = count.checked_sub(1)
            && let Some([last, rest @ ..]) = self.room.get_mut(last..count + 3)
        {
            rest.fill(*last);
        }
    }

    /// Returns the entries four by four, padded with copies of the last one.
    #[inline(always)]
    pub(super) fn fours(&self) -> &[[Spoke; 4]] {
        let (fours, _) = self.room.as_chunks();
        &fours[..self.count.div_ceil(4)]
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self, count: usize) {
        self.room.resize(2 * count, Spoke::default());
    }

    /// Takes the spokes of a ring that do not lead to `u`.
    #[inline(always)]
    pub(crate) fn take_without(&mut self, u: VertexId, ring: &Self) {
        let slots = self.room(ring.count);
        let mut n = 0;
        for &spoke in ring {
            // (Branchless: each is written, some are kept; a branch on `has(u)` would be unpredictable.)
            slots[n] = spoke;
            n += usize::from(!spoke.has(u));
        }
        self.end(n);
    }
}

impl std::ops::Deref for Ring {
    type Target = [Spoke];
    #[inline(always)]
    fn deref(&self) -> &[Spoke] {
        &self.room[..self.count]
    }
}

impl<'a> IntoIterator for &'a Ring {
    type Item = &'a Spoke;
    type IntoIter = std::slice::Iter<'a, Spoke>;
    #[inline(always)]
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

/// True if each neighbour that comes first in a triangle does so just once, and is second in just one
/// other.
#[inline(always)]
pub(crate) fn is_closed_fan(ring: impl ExactSizeIterator<Item = (VertexId, VertexId)> + Clone) -> bool {
    // Side by side for SIMD; most vertices have about six neighbours. Unused lanes hold a number that no
    // vertex has, as first and as second.
    const LANES: usize = 8;
    let n = ring.len();
    if n > SHORT_RING {
        let [mut firsts, mut seconds]: [Vec<VertexId>; 2] =
            [ring.clone().map(|r| r.0).collect(), ring.map(|r| r.1).collect()];
        firsts.sort_unstable();
        seconds.sort_unstable();
        return firsts == seconds && firsts.windows(2).all(|w| w[0] != w[1]);
    }
    if n > LANES {
        let once = |w: VertexId| {
            ring.clone().filter(|r| r.0 == w).count() == 1 && ring.clone().filter(|r| r.1 == w).count() == 1
        };
        return ring.clone().all(|r| once(r.0));
    }
    let (mut a, mut b) = ([u32::MAX; LANES], [u32::MAX; LANES]);
    for (i, r) in ring.enumerate() {
        (a[i % LANES], b[i % LANES]) = (r.0.0, r.1.0);
    }
    // How often each first neighbour is second, and each second one first: if both occur once, the first ones
    // differ too. (Branchless: masks are minus one where they match.)
    let (first, second) = (u32x8::from(a), u32x8::from(b));
    let times = |of: u32x8, among: [u32; LANES]| {
        among.into_iter().fold(u32x8::ZERO, |sum, w| sum - of.simd_eq(u32x8::splat(w)))
    };
    let once = times(first, b).simd_eq(u32x8::ONE) & times(second, a).simd_eq(u32x8::ONE);
    let used = (1u32 << n) - 1;
    n > 0 && once.to_bitmask() & used == used
}

/// Returns the distinct neighbours in a ring, in the order of their first face.
pub(crate) fn distinct(ring: &[Spoke]) -> impl Iterator<Item = VertexId> + '_ {
    // For a long ring, the index of the first face of each neighbour.
    let mut first_of = HashMap::new();
    if ring.len() > SHORT_RING {
        for (i, w) in ring.iter().enumerate().flat_map(|(i, r)| [(i, r.a), (i, r.b)]) {
            first_of.entry(w).or_insert(i);
        }
    }
    let seen = move |i: usize, w: VertexId| match first_of.get(&w) {
        Some(&first) => first < i,
        None => ring[..i].iter().any(|r| r.has(w)),
    };
    ring.iter()
        .enumerate()
        .flat_map(|(i, r)| [(i, r.a), (i, r.b)])
        .filter(move |x| !seen(x.0, x.1))
        .map(|x| x.1)
}

/// Returns the number of triangles of the ring that contain `w`: the faces of the edge to it.
#[inline(always)]
pub(crate) fn faces_at(ring: &[Spoke], w: VertexId) -> usize {
    ring.iter().filter(|r| r.has(w)).count()
}
