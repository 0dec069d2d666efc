//! The mesh that is being collapsed: vertices, triangles, and a list of corners for each vertex.

mod check;

use std::collections::BTreeMap;

use bytemuck::allocation::cast_vec;
use glam::Vec3;
use lodsmith_core::{RegionId, VertexId, WedgeId};
use prefetch_index::prefetch_index;
use wide::{f32x4, i32x4};

use super::kind::Kind;
use super::marks::Marks;
use super::order::{NONE, TIME_OVER_MEMORY_MAX_FACES};
use super::ring::{Corner, Ring, Spoke};
use super::vertex::{self, Facing, Normals, PackedPosition, Vertex};
use crate::cost::lanes::Four;
use crate::cost::metric::VertexMemory;

/// Ends of consecutive corner lists.
pub(super) struct Ends(Vec<u32>);

#[derive(Clone)]
pub(crate) struct Store<Q: VertexMemory> {
    pub(crate) v: Vec<Vertex<Q>>,
    /// Least cost, when last evaluated, of the edges that a vertex owns: those to later vertices.
    pub(crate) bound: Vec<f32>,
    /// Three vertices for each triangle; the first is [`NONE`] if it was removed.
    pub(crate) t: Vec<[VertexId; 3]>,
    /// Wedge of each corner, if the run has attributes.
    pub(crate) wedges: Option<Vec<[WedgeId; 3]>>,
    /// First wedge of each vertex's chain, if the cost counts attributes; else empty.
    pub(crate) first_wedge: Vec<WedgeId>,
    /// Region of each face, if there are several.
    pub(crate) regions: Option<Vec<RegionId>>,
    /// Sharp edges of each face, if the options make them features
    /// ([`sharp_edges`](super::creases::sharp_edges)).
    pub(crate) creases: Option<Vec<u8>>,
    /// Number of each face in the record, if there is one.
    pub(crate) names: Option<Vec<u32>>,
    /// Class of each region; a region beyond the list is its own class.
    pub(crate) classes: Vec<RegionId>,
    corners: Vec<Corner>,
    pub(crate) live_faces: usize,
    pub(crate) live_vertices: usize,
    /// For each vertex of the ordered input, the vertex that it was merged into, or itself.
    pub(crate) merged_into: Vec<VertexId>,
    /// For vertices created by cuts, the vertex of the ordered input whose position they have.
    places: BTreeMap<VertexId, VertexId>,
    /// Number of times that vertices were renumbered.
    pub(super) generation: u32,
    faces_at_compaction: usize,
}

/// A store is compacted when fewer than this percentage of its triangles are live. (Measured: 50 to 75 % are
/// equally fast.)
const COMPACT_PERCENT: usize = 60;
/// It is only worthwhile if at least this percentage of the triangles is still to be removed. (It costs about
/// as much as removing a tenth of them.)
const MIN_REMAINING_PERCENT: usize = 25;
/// Spare room for lists that outgrow their own, as a percentage of all corners; when it is used up the store
/// is compacted.
const SLACK_PERCENT: usize = 30;
/// Number of vertices below which releasing memory is not worth the time.
const SHRINK_MIN_VERTICES: usize = 1 << 16;
/// The vertices are not copied to release memory if more than this percentage of it is used.
const COPY_MAX_USED_PERCENT: usize = 80;

/// The corners after and before each corner, as tables: a branch on it would be unpredictable.
const NEXT: [usize; 4] = [1, 2, 0, 0];
const PREV: [usize; 4] = [2, 0, 1, 0];
/// Prefetch distances, in visits: for a vertex, its list, its triangles and the vertices around it.
/// (Guessed.)
const PREFETCH_VISITS_AHEAD: [usize; 4] = [12, 9, 6, 3];

impl<Q: VertexMemory> Store<Q> {
    /// Creates a store whose corner lists are still to be filled.
    pub(crate) fn new(
        points: &[Vec3],
        faces: Vec<[VertexId; 3]>,
        wedges: Option<Vec<[WedgeId; 3]>>,
        regions: Option<Vec<RegionId>>,
    ) -> Self {
        let vertex = |(i, &p): (usize, &Vec3)| Vertex {
            place: PackedPosition { p, unused: 0 },
            q: Q::default(),
            origin: VertexId(i as u32),
            head: 0,
            count: 0,
            room: 0,
            kind: Kind::default(),
            facing: Facing::default(),
        };
        let v: Vec<_> = points.iter().enumerate().map(vertex).collect();
        Self {
            bound: vec![super::bound::UNKNOWN; v.len()],
            live_faces: faces.len(),
            live_vertices: v.len(),
            merged_into: (0..v.len() as u32).map(VertexId).collect(),
            corners: Vec::new(),
            places: BTreeMap::new(),
            faces_at_compaction: faces.len(),
            v,
            t: faces,
            wedges,
            first_wedge: Vec::new(),
            regions,
            creases: None,
            names: None,
            classes: Vec::new(),
            generation: 0,
        }
    }

    /// Creates the store of a block from its vertices, their bounds and its faces; the corner lists are still to be
    /// filled.
    pub(super) fn of_vertices(v: Vec<Vertex<Q>>, bound: Vec<f32>, t: Vec<[VertexId; 3]>) -> Self {
        let mut store = Self::new(&[], t, None, None);
        store.live_vertices = v.iter().filter(|x| !x.kind.is_gone()).count();
        store.merged_into = (0..v.len() as u32).map(VertexId).collect();
        (store.v, store.bound) = (v, bound);
        store
    }

    /// Releases all elements; numbers in the ordered input stay.
    pub(super) fn release_elements(&mut self) {
        (self.v, self.bound, self.t, self.corners) = Default::default();
        (self.wedges, self.first_wedge, self.regions, self.creases, self.names) = Default::default();
    }

    /// Puts in vertices, bounds and faces of other numbers, all live; the corner lists are still to be filled.
    pub(super) fn put_elements(&mut self, v: Vec<Vertex<Q>>, bound: Vec<f32>, t: Vec<[VertexId; 3]>) {
        (self.v, self.bound, self.t) = (v, bound, t);
        (self.live_faces, self.live_vertices) = (self.t.len(), self.v.len());
        self.faces_at_compaction = self.live_faces;
        self.generation += 1;
    }

    /// Makes room for corner lists; numbers stay.
    #[cold]
    pub(super) fn repack(&mut self) {
        // (Of a vertex that is gone too, because lists are prefetched.)
        for x in self.v.iter_mut().filter(|x| x.kind.is_gone()) {
            x.list(0, 0);
        }
        let count = self.v.iter().map(|x| x.count as usize).sum();
        let old = std::mem::take(&mut self.corners);
        let corners = reserve_corners(&mut self.corners, count);
        let mut head = 0;
        for x in &mut self.v {
            let list = &old[x.head as usize..(x.head + x.count) as usize];
            corners[head as usize..][..list.len()].copy_from_slice(list);
            head += x.list(head, x.count);
        }
    }

    /// Rebuilds the corner lists.
    pub(crate) fn link(&mut self) {
        // Counted in a separate table, which is an eighth of the size of the vertices.
        let mut at = vec![0u32; self.v.len()];
        for w in self.t.as_flattened() {
            at[w.index()] += 1;
        }
        let mut head = 0;
        for (x, at) in self.v.iter_mut().zip(&mut at) {
            head += x.list(head, std::mem::replace(at, head));
        }
        self.fill(at);
    }

    /// Rebuilds the corner lists when the corners of each vertex are counted already; sets the facings of
    /// the vertices from their normals. (In one pass: each walk through the vertices of a large mesh is
    /// slow.)
    pub(super) fn link_counted(&mut self, normals: Normals) -> Ends {
        let mut at = Vec::with_capacity(self.v.len());
        let mut head = 0;
        for (few, normals) in self.v.chunks_mut(4).zip(normals.fours()) {
            for (x, facing) in few.iter_mut().zip(Facing::of_four(normals)) {
                x.facing = facing;
                at.push(head);
                head += x.list(head, x.count);
            }
        }
        // Freed before the lists are allocated, so that both need not be in memory at once.
        drop(normals);
        self.fill(at)
    }

    /// Fills corner lists that start at these offsets. Returns their ends.
    fn fill(&mut self, mut at: Vec<u32>) -> Ends {
        let corners = reserve_corners(&mut self.corners, 3 * self.t.len());
        for (i, t) in self.t.iter().enumerate() {
            for k in 0..3 {
                let slot = &mut at[t[k].index()];
                corners[*slot as usize] = Corner::new(i, k);
                *slot += 1;
            }
        }
        Ends(at)
    }

    /// Returns true for each vertex inside a closed fan ([`is_closed_fan`](super::ring::is_closed_fan)).
    /// Requires lists just filled, up to these ends, and no bounds yet.
    pub(super) fn closed_fans(&mut self, ends: Ends) -> Vec<bool> {
        // For each vertex, the last centre (numbered from 1) at which it was first in a triangle and not
        // yet matched as second. (Reuses the memory of the bounds, all of which are still unknown.)
        let mut first_of: Vec<u32> = cast_vec(std::mem::take(&mut self.bound));
        first_of.fill(0);
        let mut seconds = Vec::new();
        let (corners, t) = (&self.corners[..], &self.t[..]);
        let (mut head, mut mark) = (0, 0);
        let is_closed = |end: u32| {
            let list = &corners[head..end as usize];
            (head, mark) = (end as usize, mark + 1);
            if seconds.len() < list.len() {
                seconds.resize(2 * list.len(), VertexId(0));
            }
            let seconds = &mut seconds[..list.len()];
            for i in 0..list.len() {
                let (t, k) = (&t[list[i].face()], list[i].k());
                first_of[t[NEXT[k]].index()] = mark;
                seconds[i] = t[PREV[k]];
            }
            // There are as many second ones as first ones, and each second is matched to a first once, so all
            // of them differ.
            let mut unlike = u32::from(list.is_empty());
            for second in &*seconds {
                unlike |= std::mem::take(&mut first_of[second.index()]) ^ mark;
            }
            unlike == 0
        };
        let closed = ends.0.into_iter().map(is_closed).collect();
        self.bound = cast_vec(first_of);
        self.bound.fill(super::bound::UNKNOWN);
        closed
    }

    /// Resets the quadrics and corner counts of all vertices.
    pub(super) fn reset_quadrics(&mut self) {
        for x in &mut self.v {
            (x.q, x.count) = (Q::default(), 0);
        }
    }

    /// True if so many elements are dead that compaction is worthwhile, with `needed` collapses left to do.
    pub(crate) fn wants_compaction(&self, needed: Option<usize>) -> bool {
        self.live_faces * 100 < self.faces_at_compaction * COMPACT_PERCENT
            && needed.is_none_or(|n| 2 * n * 100 > self.live_faces * MIN_REMAINING_PERCENT)
    }

    /// Removes dead elements, if there are any.
    pub(super) fn compact_if_needed(&mut self) {
        if self.live_faces < self.t.len() || self.live_vertices < self.v.len() {
            self.compact();
        }
    }

    /// Removes dead elements and renumbers; the order is preserved.
    pub(crate) fn compact(&mut self) {
        retain_living(&mut self.wedges, &self.t);
        retain_living(&mut self.regions, &self.t);
        retain_living(&mut self.creases, &self.t);
        retain_living(&mut self.names, &self.t);
        if self.t.len() > TIME_OVER_MEMORY_MAX_FACES {
            // Freed while the lists below exist. (A new allocation is smaller, but takes time.)
            self.corners = Vec::new();
        }
        // For each vertex the number of its corners; then the position in its list, and its new number.
        let mut lists = vec![[0u32; 2]; self.v.len()];
        self.t.retain(|t| {
            let lives = t[0] != NONE;
            if lives {
                for w in t {
                    lists[w.index()][0] += 1;
                }
            }
            lives
        });
        let (mut n, mut head) = (0, 0);
        for (i, list) in lists.iter_mut().enumerate() {
            let count = list[0];
            if count > 0 {
                *list = [head, n as u32];
                (self.v[n], self.bound[n]) = (self.v[i], self.bound[i]);
                head += self.v[n].list(head, count);
                if let Some(&first) = self.first_wedge.get(i) {
                    self.first_wedge[n] = first;
                }
                n += 1;
            }
        }
        self.v.truncate(n);
        self.bound.truncate(n);
        self.first_wedge.truncate(n);
        let corners = reserve_corners(&mut self.corners, 3 * self.t.len());
        for (i, t) in self.t.iter_mut().enumerate() {
            for k in 0..3 {
                let [slot, name] = &mut lists[t[k].index()];
                corners[*slot as usize] = Corner::new(i, k);
                *slot += 1;
                t[k] = VertexId(*name);
            }
        }
        (self.live_faces, self.live_vertices) = (self.t.len(), n);
        self.faces_at_compaction = self.live_faces;
        self.generation += 1;
    }

    /// Compacts for the last time and releases memory, because the fit needs memory of its own. The vertices
    /// come last, because releasing their memory copies them.
    pub(crate) fn finish(&mut self) {
        self.compact();
        if self.v.capacity() < SHRINK_MIN_VERTICES {
            return;
        }
        self.bound = Vec::new();
        self.corners.shrink_to_fit();
        self.t.shrink_to_fit();
        if self.v.len() * 100 < self.v.capacity() * COPY_MAX_USED_PERCENT {
            self.v.shrink_to_fit();
        }
    }

    /// Gives a copy as much spare room for lists as its original has, so that compaction happens at the same
    /// time.
    pub(crate) fn make_room_of(&mut self, original: &Self) {
        self.corners.reserve_exact(original.corners.capacity() - original.corners.len());
    }

    /// Enables more sweeps after [`Store::finish`]: every vertex is visited again.
    pub(crate) fn reopen(&mut self) {
        self.bound = vec![super::bound::UNKNOWN; self.v.len()];
        self.link();
    }

    /// True if the arena of corner lists has no room left for a star of the usual size.
    pub(crate) fn is_full(&self) -> bool {
        self.corners.capacity() - self.corners.len() < 64
    }

    #[inline(always)]
    pub(crate) fn p(&self, u: VertexId) -> Vec3 {
        self.v[u.index()].p
    }

    /// The positions of four vertices side by side.
    #[inline(always)]
    pub(crate) fn four(&self, vertices: [VertexId; 4]) -> Four {
        vertex::four(&self.v, vertices)
    }

    /// Returns the facings of the input at the corners of four faces, summed for each face, side by side.
    #[inline(always)]
    pub(crate) fn four_facings(&self, t: [[VertexId; 3]; 4]) -> Four {
        let corner =
            |k: usize| i32x4::new(t.map(|t| i32::from_le_bytes(self.v[t[k].index()].facing.bytes())));
        let corners = [corner(0), corner(1), corner(2)];
        // (Sign-extends one byte of each.)
        [24, 16, 8].map(|up: u32| {
            let [a, b, c] = corners.map(|x| (x << up) >> 24u32);
            f32x4::from_i32x4(a + b + c)
        })
    }

    /// Prefetches the data of the visits after `at`: each stage uses what the previous stage loaded a few
    /// visits earlier.
    #[inline(always)]
    pub(crate) fn prefetch(&self, visits: &[VertexId], at: usize) {
        // At the first visit, the whole distance is prefetched at once.
        let first = |ahead: usize| if at == 0 { 1 } else { ahead };
        let visit = |k: usize| visits.get(at + k).copied();
        for u in (first(PREFETCH_VISITS_AHEAD[0])..=PREFETCH_VISITS_AHEAD[0]).filter_map(visit) {
            prefetch_index(&self.v, u.index());
        }
        for u in (first(PREFETCH_VISITS_AHEAD[1])..=PREFETCH_VISITS_AHEAD[1]).filter_map(visit) {
            prefetch_index(&self.corners, self.v[u.index()].head as usize);
        }
        for u in (first(PREFETCH_VISITS_AHEAD[2])..=PREFETCH_VISITS_AHEAD[2]).filter_map(visit) {
            for corner in self.listed(u) {
                prefetch_index(&self.t, corner.face());
            }
        }
        for u in (first(PREFETCH_VISITS_AHEAD[3])..=PREFETCH_VISITS_AHEAD[3]).filter_map(visit) {
            for corner in self.listed(u) {
                prefetch_index(&self.v, self.t[corner.face()][NEXT[corner.k()]].index());
            }
        }
    }

    /// Fills a ring with the corners of `u`, in the order of the list.
    #[inline(always)]
    pub(crate) fn ring(&self, u: VertexId, out: &mut Ring) {
        let list = self.listed(u);
        let slots = &mut out.room(list.len())[..list.len()];
        let t = &self.t[..];
        for (slot, &corner) in slots.iter_mut().zip(list) {
            let (t, k) = (&t[corner.face()], corner.k());
            *slot = Spoke { corner, a: t[NEXT[k]], b: t[PREV[k]] };
        }
        out.end(list.len());
    }

    /// Returns the corners of `u`, all of live triangles.
    #[inline(always)]
    pub(crate) fn listed(&self, u: VertexId) -> &[Corner] {
        let x = &self.v[u.index()];
        &self.corners[x.head as usize..(x.head + x.count) as usize]
    }

    /// Returns the other two vertices of each listed triangle of `u`, in order.
    #[inline(always)]
    pub(crate) fn others(
        &self,
        u: VertexId,
    ) -> impl ExactSizeIterator<Item = (VertexId, VertexId)> + Clone + '_ {
        self.listed(u).iter().map(|&corner| self.others_at(corner))
    }

    /// Returns the two vertices after the vertex at a corner, in order.
    #[inline(always)]
    pub(crate) fn others_at(&self, corner: Corner) -> (VertexId, VertexId) {
        let (t, k) = (&self.t[corner.face()], corner.k());
        (t[NEXT[k]], t[PREV[k]])
    }

    /// Gives `u` a list of `count` corners, in the room of `u` or `v` if it suffices; the caller fills it.
    #[inline(always)]
    pub(crate) fn relist(&mut self, u: VertexId, v: VertexId, count: usize) -> &mut [Corner] {
        let (x, z) = (&self.v[u.index()], &self.v[v.index()]);
        let n = count as u32;
        let (head, room) = if n <= x.room {
            (x.head, x.room)
        } else if n <= z.room {
            (z.head, z.room)
        } else {
            let head = self.corners.len();
            self.corners.resize(head + count, Corner::default());
            (head as u32, n)
        };
        let x = &mut self.v[u.index()];
        (x.head, x.room, x.count) = (head, room, n);
        &mut self.corners[head as usize..head as usize + count]
    }

    /// Assigns exactly these corners to `u`.
    pub(crate) fn set_corners(&mut self, u: VertexId, corners: &[Corner]) {
        for corner in corners {
            self.t[corner.face()][corner.k()] = u;
        }
        self.relist(u, u, corners.len()).copy_from_slice(corners);
    }

    /// Adds a vertex at the position of another, without triangles yet.
    pub(crate) fn duplicate_vertex(&mut self, u: VertexId) -> VertexId {
        let x = self.v[u.index()];
        let (twin, origin) = (VertexId(self.v.len() as u32), VertexId(self.merged_into.len() as u32));
        self.v.push(Vertex { origin, head: 0, count: 0, room: 0, ..x });
        self.bound.push(super::bound::UNKNOWN);
        self.first_wedge.extend(self.first_wedge.get(u.index()).copied());
        self.merged_into.push(origin);
        self.set_place(origin, x.origin);
        self.live_vertices += 1;
        twin
    }

    /// Records that a vertex is at the position of another one of the input.
    pub(crate) fn set_place(&mut self, origin: VertexId, other: VertexId) {
        let place = self.place_of(other);
        self.places.insert(origin, place);
    }

    /// Returns the vertex of the ordered input that has the position of the vertex with this number, unless
    /// that was moved.
    pub(crate) fn place_of(&self, origin: VertexId) -> VertexId {
        self.places.get(&origin).copied().unwrap_or(origin)
    }

    /// Removes a triangle, from the lists of its vertices too.
    pub(crate) fn remove_face(&mut self, face: usize) {
        for w in self.t[face] {
            self.unlist(w, face);
        }
        self.t[face][0] = NONE;
        self.live_faces -= 1;
    }

    /// Removes a triangle from the list of a vertex; the others keep their order.
    #[inline(always)]
    pub(super) fn unlist(&mut self, w: VertexId, face: usize) {
        let x = &mut self.v[w.index()];
        let list = &mut self.corners[x.head as usize..(x.head + x.count) as usize];
        if let Some(i) = list.iter().position(|corner| corner.face() == face) {
            list.copy_within(i + 1.., i);
            x.count -= 1;
        }
    }

    /// Lists the neighbours of `u` that come after it, each once.
    pub(super) fn list_owned(&self, u: VertexId, ring: &Ring, owned: &mut Vec<VertexId>, marks: &mut Marks) {
        marks.clear(2 * ring.len());
        owned.clear();
        for w in ring.iter().flat_map(|r| [r.a, r.b]).filter(|&w| w > u) {
            if marks.set(w, 0).is_none() {
                owned.push(w);
            }
        }
    }

    /// Returns the final vertex of every vertex of the ordered input, or [`NONE`] if its part was removed;
    /// only after a compaction.
    pub(crate) fn homes(&self) -> Vec<VertexId> {
        self.homes_from(self.merged_into.clone())
    }

    /// Returns the same as [`Self::homes`], but reuses the memory of `merged_into`, which is lost.
    pub(crate) fn take_homes(&mut self) -> Vec<VertexId> {
        let merged_into = std::mem::take(&mut self.merged_into);
        self.homes_from(merged_into)
    }

    fn homes_from(&self, merged_into: Vec<VertexId>) -> Vec<VertexId> {
        let mut home = roots(merged_into);
        let mut at = vec![NONE; home.len()];
        for (i, x) in self.v.iter().enumerate() {
            at[x.origin.index()] = VertexId(i as u32);
        }
        for h in &mut home {
            *h = at[h.index()];
        }
        home
    }
}

/// Returns room for `count` corners to be filled, and reserves spare room for lists that outgrow their own.
fn reserve_corners(corners: &mut Vec<Corner>, count: usize) -> &mut [Corner] {
    let want = count + count * SLACK_PERCENT / 100 + 64;
    if corners.capacity() < want {
        // (The old buffer is freed first, so that both need not be in memory at once.)
        *corners = Vec::new();
        corners.reserve_exact(want);
    }
    corners.resize(count, Corner::default());
    corners
}

/// Removes the items of dead triangles.
fn retain_living<T>(of_faces: &mut Option<Vec<T>>, t: &[[VertexId; 3]]) {
    if let Some(of_faces) = of_faces {
        let mut i = 0;
        of_faces.retain(|_| {
            i += 1;
            t[i - 1][0] != NONE
        });
    }
}

/// Returns the root of each element, where `into[i]` is the element that i was merged into (a root:
/// itself).
fn roots(mut into: Vec<VertexId>) -> Vec<VertexId> {
    // Each round at least halves all path lengths. (A loop over each path would be an unpredictable
    // branch.)
    loop {
        let mut changed = 0;
        for i in 0..into.len() {
            let next = into[into[i].index()];
            changed |= next.0 ^ into[i].0;
            into[i] = next;
        }
        if changed == 0 {
            return into;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::ring::is_closed_fan;
    use crate::cost::tensor::Tensor;

    #[test]
    fn closed_fans_are_found() {
        // A tetrahedron, another that is open below (1, 2 and 3), one with a face of the wrong winding, a
        // wheel of twenty spokes, two tetrahedra that meet in one vertex, and a vertex without a face.
        let tetrahedron = |[a, b, c, d]: [u32; 4]| vec![[a, b, c], [a, c, d], [a, d, b], [d, c, b]];
        let mut faces = tetrahedron([0, 1, 2, 3]);
        faces.extend(&tetrahedron([4, 5, 6, 7])[..3]);
        faces.extend(tetrahedron([8, 9, 10, 11]));
        faces[10].swap(0, 1);
        faces.extend((0..20).map(|i| [12, 13 + i, 13 + (i + 1) % 20]));
        faces.extend([tetrahedron([33, 34, 35, 36]), tetrahedron([33, 37, 38, 39])].concat());
        let faces = faces.into_iter().map(|t| t.map(VertexId)).collect();
        let mut store = Store::<Tensor>::new(&[Vec3::ZERO; 41], faces, None, None);
        for w in store.t.concat() {
            store.v[w.index()].count_corner();
        }
        let ends = store.link_counted(Normals::zero(41));
        let is_closed = store.closed_fans(ends);
        for u in (0..41).map(VertexId) {
            assert_eq!(is_closed[u.index()], is_closed_fan(store.others(u)), "{u}");
        }
        assert_eq!(is_closed.iter().filter(|x| **x).count(), 4 + 1 + 1 + 1 + 6 + 1);
    }

    #[test]
    fn roots_follow_chains() {
        let into = [0, 0, 1, 2, 4].map(VertexId);
        assert_eq!(roots(into.to_vec()), [0, 0, 0, 0, 4].map(VertexId));
    }
}
