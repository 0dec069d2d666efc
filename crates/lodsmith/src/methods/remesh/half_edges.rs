//! Half-edge mesh with the three operations of remeshing: split, collapse and flip.
//!
//! ```text
//!            a                 half-edge h leads from corner h of face h / 3 to the next corner;
//!          /   \               its twin leads back along the same edge, in the neighbouring face;
//!        /p     n\             without one the edge is open.
//!      /     h     \
//!     u ----------> v          out[u] is a half-edge that leaves u: the one with no face to its right where u lies on a
//!      \     t     /           border, so that a walk around from there meets all faces of u.
//!        \       /
//!            b
//! ```
//!
//! The faces of each vertex form one fan. Where the input has several, or an edge with three faces, it is
//! cut: the copies of the vertex keep its position, and are merged again at the end.

use glam::DVec3;
use lodsmith_core::{HalfEdgeId, RegionId, VertexId};

use crate::collapse::order::NONE;

/// No half-edge: the twin of a border half-edge.
pub(super) const OPEN: HalfEdgeId = HalfEdgeId(u32::MAX);

/// The kind of line that an edge belongs to, most restrictive last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LineKind {
    /// None: an edge of the smooth surface.
    #[default]
    None,
    /// A sharp edge.
    Crease,
    /// An edge between two regions.
    Seam,
    /// An open border.
    Border,
    /// An edge that stays as it is.
    Fixed,
}

impl LineKind {
    pub(super) const CURVES: [Self; 3] = [Self::Crease, Self::Seam, Self::Border];
}

#[derive(Clone, Debug, Default)]
pub(super) struct HalfEdges {
    pub(super) points: Vec<DVec3>,
    /// The vertex that each half-edge leaves, or [`NONE`] if the face was removed.
    pub(super) from: Vec<VertexId>,
    pub(super) twin: Vec<HalfEdgeId>,
    pub(super) line: Vec<LineKind>,
    pub(super) out: Vec<HalfEdgeId>,
    /// The region of each face, if there are several.
    pub(super) regions: Option<Vec<RegionId>>,
    /// The source vertex that each vertex still equals bit by bit.
    pub(super) kept: Vec<VertexId>,
    /// True for vertices that may neither move nor be removed.
    pub(super) pinned: Vec<bool>,
    /// The source vertex whose copy this vertex is, if that was cut into several, else [`NONE`]. No edges are
    /// created between copies.
    pub(super) copy_of: Vec<VertexId>,
    pub(super) face_count: usize,
    pub(super) vertex_count: usize,
}

impl HalfEdges {
    /// Builds the mesh from points and faces. Of duplicate faces with the same winding, one is kept.
    pub(super) fn new(
        points: &[DVec3],
        faces: &[[VertexId; 3]],
        regions: Option<&[RegionId]>,
        locked: Option<&[bool]>,
    ) -> Self {
        let mut keys: Vec<([VertexId; 3], usize)> =
            faces.iter().map(|t| rotated_to_lowest(*t)).zip(0..).collect();
        keys.sort_unstable();
        keys.dedup_by_key(|x| x.0);
        let mut taken: Vec<usize> = keys.into_iter().map(|x| x.1).collect();
        taken.sort_unstable();
        let mut mesh = Self {
            from: taken.iter().flat_map(|&f| faces[f]).collect(),
            regions: regions.map(|r| taken.iter().map(|&f| r[f]).collect()),
            face_count: taken.len(),
            ..Self::default()
        };
        let count = mesh.from.len();
        (mesh.twin, mesh.line) = (vec![OPEN; count], vec![LineKind::None; count]);
        mesh.link(points.len());
        mesh.cut(points, locked);
        mesh
    }

    fn link(&mut self, vertices: usize) {
        let mut start = vec![0u32; vertices + 1];
        let least = |m: &Self, h: HalfEdgeId| m.from(h).min(m.to(h));
        for h in self.half_edges() {
            start[least(self, h).index() + 1] += 1;
        }
        for v in 0..vertices {
            start[v + 1] += start[v];
        }
        let (mut at, mut sorted) = (start.clone(), vec![OPEN; self.from.len()]);
        for h in self.half_edges() {
            let slot = &mut at[least(self, h).index()];
            sorted[*slot as usize] = h;
            *slot += 1;
        }
        // The other end of each half-edge, and the half-edge.
        let mut here: Vec<(u32, u32)> = Vec::new();
        for w in start.windows(2) {
            here.clear();
            here.extend(
                sorted[w[0] as usize..w[1] as usize].iter().map(|&h| (self.from(h).max(self.to(h)).0, h.0)),
            );
            here.sort_unstable();
            for edge in here.chunk_by(|a, b| a.0 == b.0) {
                let half_edge = |x: &(u32, u32)| HalfEdgeId(x.1);
                match edge {
                    [h] => self.line[half_edge(h).index()] = LineKind::Border,
                    [h, t] if self.from(half_edge(h)) != self.from(half_edge(t)) => {
                        let [h, t] = [h, t].map(half_edge);
                        (self.twin[h.index()], self.twin[t.index()]) = (t, h);
                        let between = |r: &Vec<RegionId>| r[h.face().index()] != r[t.face().index()];
                        if self.regions.as_ref().is_some_and(between) {
                            self.set_line(h, LineKind::Seam);
                        }
                    }
                    _ => edge.iter().for_each(|x| self.line[half_edge(x).index()] = LineKind::Fixed),
                }
            }
        }
    }

    /// Gives each fan a vertex of its own.
    fn cut(&mut self, points: &[DVec3], locked: Option<&[bool]>) {
        let mut done = vec![false; self.from.len()];
        let mut fans = vec![0u8; points.len()];
        let old = self.from.clone();
        for h in (0..old.len()).map(HalfEdgeId::new) {
            if done[h.index()] {
                continue;
            }
            let origin = old[h.index()];
            let v = VertexId::new(self.points.len());
            let first = self.first_around(h);
            let mut g = first;
            loop {
                done[g.index()] = true;
                self.from[g.index()] = v;
                g = self.twin[g.prev().index()];
                if g == OPEN || g == first {
                    break;
                }
            }
            self.points.push(points[origin.index()]);
            self.out.push(first);
            self.kept.push(origin);
            self.pinned.push(locked.is_some_and(|l| l[origin.index()]));
            fans[origin.index()] = fans[origin.index()].saturating_add(1);
        }
        self.copy_of = self.kept.iter().map(|v| if fans[v.index()] > 1 { *v } else { NONE }).collect();
        for (pinned, copy_of) in self.pinned.iter_mut().zip(&self.copy_of) {
            *pinned |= *copy_of != NONE;
        }
        for h in self.half_edges() {
            if self.line[h.index()] == LineKind::Fixed {
                let (u, v) = (self.from(h), self.to(h));
                (self.pinned[u.index()], self.pinned[v.index()]) = (true, true);
            }
        }
        let is_locked = |m: &Self, v: VertexId| locked.is_some_and(|l| l[m.kept[v.index()].index()]);
        for h in self.half_edges() {
            if is_locked(self, self.from(h)) && is_locked(self, self.to(h)) {
                self.set_line(h, LineKind::Fixed);
            }
        }
        self.vertex_count = self.points.len();
    }

    /// All half-edges, including those of removed faces.
    pub(super) fn half_edges(&self) -> impl Iterator<Item = HalfEdgeId> + use<> {
        (0..self.from.len()).map(HalfEdgeId::new)
    }
    /// True if the face of a half-edge was not removed.
    #[inline]
    pub(super) fn is_alive(&self, h: HalfEdgeId) -> bool {
        self.from[h.index()] != NONE
    }
    #[inline]
    pub(super) fn from(&self, h: HalfEdgeId) -> VertexId {
        self.from[h.index()]
    }
    #[inline]
    pub(super) fn to(&self, h: HalfEdgeId) -> VertexId {
        self.from[h.next().index()]
    }
    #[inline]
    pub(super) fn twin(&self, h: HalfEdgeId) -> HalfEdgeId {
        self.twin[h.index()]
    }
    #[inline]
    pub(super) fn at(&self, v: VertexId) -> DVec3 {
        self.points[v.index()]
    }
    #[inline]
    pub(super) fn corners(&self, face: usize) -> [VertexId; 3] {
        [self.from[3 * face], self.from[3 * face + 1], self.from[3 * face + 2]]
    }
    /// True for the one half-edge that represents its edge: the lower of the two.
    #[inline]
    pub(super) fn is_first(&self, h: HalfEdgeId) -> bool {
        self.is_alive(h) && (self.twin(h) == OPEN || h < self.twin(h))
    }
    pub(super) fn length_sq(&self, h: HalfEdgeId) -> f64 {
        self.at(self.from(h)).distance_squared(self.at(self.to(h)))
    }
    pub(super) fn set_line(&mut self, h: HalfEdgeId, line: LineKind) {
        self.line[h.index()] = line;
        if self.twin(h) != OPEN {
            let t = self.twin(h);
            self.line[t.index()] = line;
        }
    }
    /// The normal of a face, with twice its area as length.
    #[inline]
    pub(super) fn normal(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.corners(face).map(|v| self.at(v));
        (b - a).cross(c - a)
    }

    /// The half-edges that leave a vertex, in order around it.
    #[inline]
    pub(super) fn around(&self, v: VertexId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        let first = self.out[v.index()];
        std::iter::successors((first != OPEN).then_some(first), move |h| {
            let next = self.twin(h.prev());
            (next != OPEN && next != first).then_some(next)
        })
    }
    /// True if a vertex lies on an open edge.
    #[inline]
    pub(super) fn is_open(&self, v: VertexId) -> bool {
        self.twin(self.out[v.index()]) == OPEN
    }
    /// Collects the one-ring of a vertex, in order.
    #[inline]
    pub(super) fn ring(&self, v: VertexId, ring: &mut Vec<VertexId>) {
        ring.clear();
        let mut last = OPEN;
        for h in self.around(v) {
            ring.push(self.to(h));
            last = h;
        }
        if last != OPEN && self.is_open(v) {
            ring.push(self.from(last.prev()));
        }
    }
    /// Collects the line edges at a vertex, each as a half-edge that leaves it or, at the end of a border,
    /// arrives at it.
    pub(super) fn lines_at(&self, v: VertexId, lines: &mut Vec<(HalfEdgeId, VertexId)>) {
        lines.clear();
        let mut last = OPEN;
        for h in self.around(v) {
            if self.line[h.index()] != LineKind::None {
                lines.push((h, self.to(h)));
            }
            last = h;
        }
        if last != OPEN && self.is_open(v) {
            lines.push((last.prev(), self.from(last.prev())));
        }
    }

    /// Returns the first half-edge of the fan that `h` belongs to.
    fn first_around(&self, h: HalfEdgeId) -> HalfEdgeId {
        let mut g = h;
        while self.twin(g) != OPEN {
            g = self.twin(g).next();
            if g == h {
                break;
            }
        }
        g
    }
    fn set_out(&mut self, v: VertexId, h: HalfEdgeId) {
        self.out[v.index()] = self.first_around(h);
    }
    fn pair(&mut self, h: HalfEdgeId, t: HalfEdgeId, line: LineKind) {
        for (a, b) in [(h, t), (t, h)] {
            if a != OPEN {
                (self.twin[a.index()], self.line[a.index()]) = (b, line);
            }
        }
    }
    fn add_face(&mut self, corners: [VertexId; 3], beside: HalfEdgeId) -> HalfEdgeId {
        let h = HalfEdgeId::new(self.from.len());
        self.from.extend(corners);
        self.twin.extend([OPEN; 3]);
        self.line.extend([LineKind::None; 3]);
        if let Some(r) = &mut self.regions {
            r.push(r[beside.face().index()]);
        }
        self.face_count += 1;
        h
    }

    /// Splits an edge at a point. Returns the new vertex.
    pub(super) fn split(&mut self, h: HalfEdgeId, at: DVec3) -> VertexId {
        let (t, line) = (self.twin(h), self.line[h.index()]);
        let (u, v, a) = (self.from(h), self.to(h), self.from(h.prev()));
        let m = VertexId::new(self.points.len());
        self.points.push(at);
        self.out.push(OPEN);
        self.kept.push(NONE);
        self.pinned.push(false);
        self.copy_of.push(NONE);
        self.vertex_count += 1;

        let n = h.next();
        let (beyond, beyond_line) = (self.twin(n), self.line[n.index()]);
        let g = self.add_face([m, v, a], h);
        self.from[n.index()] = m;
        self.pair(g.next(), beyond, beyond_line);
        self.pair(n, g.prev(), LineKind::None);
        if t == OPEN {
            self.pair(h, OPEN, line);
            self.pair(g, OPEN, line);
        } else {
            let (n, b) = (t.next(), self.from(t.prev()));
            let (beyond, beyond_line) = (self.twin(n), self.line[n.index()]);
            let k = self.add_face([m, u, b], t);
            self.from[n.index()] = m;
            self.pair(k.next(), beyond, beyond_line);
            self.pair(n, k.prev(), LineKind::None);
            self.pair(h, k, line);
            self.pair(g, t, line);
            self.set_out(b, k.prev());
        }
        self.set_out(m, g);
        self.set_out(u, h);
        self.set_out(v, g.next());
        self.set_out(a, g.prev());
        m
    }

    /// True if the topology allows the collapse: no edge gets more than two faces.
    pub(super) fn may_collapse(&self, h: HalfEdgeId, rings: &mut [Vec<VertexId>; 2]) -> bool {
        let t = self.twin(h);
        let (u, v) = (self.from(h), self.to(h));
        if t != OPEN && (self.is_open(u) && self.is_open(v) || self.from(h.prev()) == self.from(t.prev())) {
            return false;
        }
        for x in [h, t] {
            if x == OPEN {
                continue;
            }
            let a = self.from(x.prev());
            // An ear, or a vertex of valence 3, would be left with too few faces.
            let beside = [self.twin(x.next()), self.twin(x.prev())];
            if beside[0] == OPEN && beside[1] == OPEN {
                return false;
            }
            if !self.is_open(a) && self.around(a).take(4).count() < 4 {
                return false;
            }
            // Two lines would merge.
            if self.line[x.next().index()] != LineKind::None && self.line[x.prev().index()] != LineKind::None
            {
                return false;
            }
        }
        self.ring(u, &mut rings[0]);
        self.ring(v, &mut rings[1]);
        let common = rings[0].iter().filter(|w| rings[1].contains(w)).count();
        if common != if t == OPEN { 1 } else { 2 } {
            return false;
        }
        let fresh = |w: &&VertexId| **w != v && !rings[1].contains(w);
        !rings[0].iter().filter(fresh).any(|&w| self.would_touch(v, w)) && !self.closes_a_copy(v, rings)
    }

    /// True if a new edge between two vertices would be non-manifold once copies are merged again.
    pub(super) fn would_touch(&self, a: VertexId, b: VertexId) -> bool {
        let (of_a, of_b) = (self.copy_of[a.index()], self.copy_of[b.index()]);
        let meets = |x: VertexId, place: VertexId| {
            let mut near = self.around(x).flat_map(|h| [self.to(h), self.from(h.prev())]);
            near.any(|w| self.copy_of[w.index()] == place)
        };
        match (of_a, of_b) {
            (NONE, NONE) => false,
            (place, NONE) => meets(b, place),
            (NONE, place) => meets(a, place),
            _ => true,
        }
    }

    /// True if there would be a face whose corners are all copies.
    fn closes_a_copy(&self, v: VertexId, rings: &[Vec<VertexId>; 2]) -> bool {
        let is_copy = |w: &VertexId| self.copy_of[w.index()] != NONE;
        is_copy(&v) && rings[0].iter().filter(|w| **w != v && is_copy(w)).count() > 1
    }

    /// Collapses an edge: its first vertex is merged into its second, which keeps its position.
    pub(super) fn collapse(&mut self, h: HalfEdgeId) {
        let (u, v) = (self.from(h), self.to(h));
        let mut g = self.out[u.index()];
        let first = g;
        loop {
            self.from[g.index()] = v;
            g = self.twin(g.prev());
            if g == OPEN || g == first {
                break;
            }
        }
        let sides = [h, self.twin(h)];
        for x in sides.into_iter().filter(|x| *x != OPEN) {
            let (n, p) = (x.next(), x.prev());
            let a = self.from(p);
            let (tn, tp) = (self.twin(n), self.twin(p));
            let line = self.line[n.index()].max(self.line[p.index()]);
            self.pair(tn, tp, line);
            for y in [x, n, p] {
                self.from[y.index()] = NONE;
            }
            self.face_count -= 1;
            // One of them arrives at `a`, the other leaves it, or does not exist. The same holds on the other
            // side with the ends of the edge swapped.
            let leaves_a = if tn != OPEN { tn } else { tp.next() };
            self.out[a.index()] = leaves_a;
            self.out[v.index()] = if tp != OPEN { tp } else { tn.next() };
        }
        for x in sides.into_iter().filter(|x| *x != OPEN) {
            let (n, p) = (x.next(), x.prev());
            // A remaining neighbour of the removed face.
            let live = if self.twin(n) != OPEN { self.twin(n) } else { self.twin(p) };
            for w in [self.from(live), self.to(live)] {
                let out = self.out[w.index()];
                self.set_out(w, out);
            }
        }
        self.out[u.index()] = OPEN;
        self.vertex_count -= 1;
    }

    /// Replaces an edge by the other diagonal of its two faces, which must not be an edge already.
    pub(super) fn flip(&mut self, h: HalfEdgeId) {
        let t = self.twin(h);
        let (n, p, tn, tp) = (h.next(), h.prev(), t.next(), t.prev());
        let (u, v, a, b) = (self.from(h), self.from(t), self.from(p), self.from(tp));
        let side = |m: &Self, x: HalfEdgeId| (m.twin(x), m.line[x.index()]);
        let (va, au, ub, bv) = (side(self, n), side(self, p), side(self, tn), side(self, tp));
        for (x, w) in [(h, b), (n, a), (p, u), (t, a), (tn, b), (tp, v)] {
            self.from[x.index()] = w;
        }
        for (x, (beyond, line)) in [(n, au), (p, ub), (tn, bv), (tp, va)] {
            self.pair(x, beyond, line);
        }
        for (w, x) in [(u, p), (v, tp), (a, n), (b, tn)] {
            self.set_out(w, x);
        }
    }

    /// Removes dead elements. Returns the old index of each vertex.
    pub(super) fn compact(&mut self) -> Vec<VertexId> {
        let mut number = vec![NONE; self.points.len()];
        let mut old = Vec::with_capacity(self.vertex_count);
        for (v, out) in self.out.iter().enumerate() {
            if *out != OPEN {
                number[v] = VertexId::new(old.len());
                old.push(VertexId::new(v));
            }
        }
        let mut face_number = vec![u32::MAX; self.from.len() / 3];
        let mut count = 0u32;
        for (f, n) in face_number.iter_mut().enumerate() {
            if self.from[3 * f] != NONE {
                *n = count;
                count += 1;
            }
        }
        let new_half_edge = |h: HalfEdgeId| match h {
            OPEN => OPEN,
            h => HalfEdgeId(face_number[h.face().index()] * 3 + h.corner() as u32),
        };
        for f in 0..face_number.len() {
            let to = face_number[f] as usize;
            if face_number[f] == u32::MAX {
                continue;
            }
            for k in 0..3 {
                self.from[3 * to + k] = number[self.from[3 * f + k].index()];
                self.twin[3 * to + k] = new_half_edge(self.twin[3 * f + k]);
                self.line[3 * to + k] = self.line[3 * f + k];
            }
            if let Some(r) = &mut self.regions {
                r[to] = r[f];
            }
        }
        let faces = count as usize;
        self.from.truncate(3 * faces);
        self.twin.truncate(3 * faces);
        self.line.truncate(3 * faces);
        if let Some(r) = &mut self.regions {
            r.truncate(faces);
        }
        self.points = gather(&self.points, &old);
        self.out = old.iter().map(|v| new_half_edge(self.out[v.index()])).collect();
        self.kept = gather(&self.kept, &old);
        self.pinned = gather(&self.pinned, &old);
        self.copy_of = gather(&self.copy_of, &old);
        old
    }

    /// Checks every table.
    ///
    /// # Panics
    /// If two tables contradict each other.
    #[cfg(test)]
    pub(super) fn check(&self) {
        let mut faces = 0;
        for h in self.half_edges().filter(|h| self.is_alive(*h)) {
            faces += usize::from(h.corner() == 0);
            assert_ne!(self.from(h), self.to(h));
            let t = self.twin(h);
            if t != OPEN {
                assert_eq!(self.twin(t), h);
                assert_eq!((self.from(t), self.to(t)), (self.to(h), self.from(h)), "{h} and {t}");
                assert_eq!(self.line[t.index()], self.line[h.index()]);
            } else {
                assert!(self.line[h.index()] >= LineKind::Border);
            }
            assert!(self.around(self.from(h)).any(|g| g == h), "{h} is not around its vertex");
        }
        assert_eq!(faces, self.face_count);
        assert_eq!(self.out.iter().filter(|h| **h != OPEN).count(), self.vertex_count);
        for (v, &h) in self.out.iter().enumerate().filter(|x| *x.1 != OPEN) {
            assert_eq!(self.from(h).index(), v);
            assert!(self.twin(h) == OPEN || self.around(VertexId::new(v)).all(|g| self.twin(g) != OPEN));
        }
    }
}

/// Gathers the values of some vertices.
pub(super) fn gather<T: Copy>(all: &[T], of: &[VertexId]) -> Vec<T> {
    of.iter().map(|v| all[v.index()]).collect()
}

/// Rotates a face so that its lowest vertex comes first.
fn rotated_to_lowest([a, b, c]: [VertexId; 3]) -> [VertexId; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    fn of(mesh: &lodsmith_core::TriMesh) -> HalfEdges {
        let points: Vec<DVec3> = mesh.positions().view().iter().map(DVec3::from).collect();
        HalfEdges::new(&points, mesh.surface().triangles(), None, None)
    }

    #[test]
    fn tables_are_consistent_on_every_shape() {
        for (name, mesh) in shapes::all() {
            let m = of(&mesh);
            m.check();
            assert!(m.face_count > 0, "{name}");
        }
    }

    #[test]
    fn changes_in_any_order_keep_the_tables_and_the_euler_number() {
        for (name, mesh) in shapes::all() {
            let mut m = of(&mesh);
            let euler = |m: &HalfEdges| {
                let edges = m.half_edges().filter(|h| m.is_first(*h)).count();
                m.vertex_count as i64 - edges as i64 + m.face_count as i64
            };
            let before = euler(&m);
            let mut rings = [Vec::new(), Vec::new()];
            let mut ring = Vec::new();
            let mut state = 7u64;
            for _ in 0..400 {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let h = HalfEdgeId::new((state >> 33) as usize % m.from.len());
                if !m.is_alive(h) {
                    continue;
                }
                match state >> 20 & 3 {
                    0 => {
                        let middle = 0.5 * (m.at(m.from(h)) + m.at(m.to(h)));
                        m.split(h, middle);
                    }
                    1 if m.twin(h) != OPEN && m.line[h.index()] == LineKind::None => {
                        let (a, b) = (m.from(h.prev()), m.from(m.twin(h).prev()));
                        m.ring(a, &mut ring);
                        let is_low = |v: VertexId| m.around(v).count() <= 3;
                        let low = is_low(m.from(h)) || is_low(m.to(h));
                        if a != b && !low && !ring.contains(&b) {
                            m.flip(h);
                        }
                    }
                    _ if m.may_collapse(h, &mut rings) => m.collapse(h),
                    _ => {}
                }
            }
            m.check();
            assert_eq!(euler(&m), before, "{name}");
            m.compact();
            m.check();
            assert_eq!(euler(&m), before, "{name}");
        }
    }
}
