//! The star of a vertex in cyclic order, and the class of the vertex.

use glam::DVec3;
use lodsmith_core::{FaceId, VertexId};

use super::store::FaceStore;
use crate::report::Refusal;

/// Vertices with more faces are kept until they have fewer: the tables of a star have 64 bits, and a hub with
/// thousands of faces is not visited each time one of these changes.
pub(super) const MAX_STAR_FACES: usize = 63;

/// Class of a vertex. [Schroeder et al. 1992] Complex vertices, where the surface is not a disc, are rejected
/// beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Inside a surface without a crease, or where creases meet or end: a corner costs its distance from the
    /// mean plane.
    Inside,
    /// On a crease through these two ring vertices.
    Edge(usize, usize),
    /// On a border through the first and the last ring vertex.
    Border,
}

/// Face `i` lies between `ring[i]` and the next one; on a border the ring has one more vertex than faces.
#[derive(Default)]
pub(super) struct OrderedStar {
    pub(super) ring: Vec<VertexId>,
    pub(super) faces: Vec<FaceId>,
    /// Normal of each face, with twice its area as length.
    pub(super) areas: Vec<DVec3>,
    pub(super) is_closed: bool,
    next: Vec<(VertexId, VertexId, FaceId)>,
}

impl OrderedStar {
    /// Collects the star of a vertex.
    pub(super) fn gather(&mut self, store: &mut FaceStore<'_>, v: VertexId) -> Result<(), Refusal> {
        self.next.clear();
        if store.degree(v) > MAX_STAR_FACES {
            return Err(Refusal::Valence);
        }
        store.tidy(v);
        self.next.extend(store.corners_at(v).iter().map(|c| (c.next, c.last, c.face)));
        let is_target = |x: VertexId| self.next.iter().any(|e| e.1 == x);
        let open = self.next.iter().position(|e| !is_target(e.0));
        self.is_closed = open.is_none();
        self.ring.clear();
        self.faces.clear();
        self.areas.clear();
        // A closed ring starts at the same face, whatever the order of the list.
        let first = (0..self.next.len()).min_by_key(|&i| self.next[i].0).ok_or(Refusal::NonManifold)?;
        self.next.swap(0, open.unwrap_or(first));
        let p = store.point(v);
        for i in 0..self.next.len() {
            let (from, to, f) = self.next[i];
            self.ring.push(from);
            self.faces.push(f);
            self.areas.push((store.point(from) - p).cross(store.point(to) - p));
            if let Some(k) = (i + 1..self.next.len()).find(|&k| self.next[k].0 == to) {
                self.next.swap(i + 1, k);
            } else if i + 1 < self.next.len() {
                return Err(Refusal::NonManifold);
            }
        }
        let last = self.next[self.next.len() - 1].1;
        if self.is_closed != (last == self.ring[0]) {
            return Err(Refusal::NonManifold);
        }
        if !self.is_closed {
            self.ring.push(last);
        }
        let repeats = |i: usize| self.ring[..i].contains(&self.ring[i]);
        if (1..self.ring.len()).any(repeats) { Err(Refusal::NonManifold) } else { Ok(()) }
    }

    /// Classifies the vertex `v`. Creases are edges whose normals differ by more than an angle with this cosine;
    /// borders of regions and seams are creases that must be kept.
    pub(super) fn class(
        &self,
        store: &FaceStore<'_>,
        v: VertexId,
        crease_cos: f64,
    ) -> Result<Class, Refusal> {
        let count = self.faces.len();
        let inner = usize::from(!self.is_closed)..count;
        let before = |i: usize| (i + count - 1) % count;
        let mut borders = inner.clone().filter(|&i| {
            let [a, b] = [before(i), i].map(|i| store.region(self.faces[i]));
            a != b || store.seams.has(v, self.ring[i])
        });
        match [borders.next(), borders.next(), borders.next()] {
            [None, ..] => {}
            [Some(a), Some(b), None] if self.is_closed => {
                // A region with a single face between them would vanish.
                return if b - a == 1 || before(a) == b { Err(Refusal::Seam) } else { Ok(Class::Edge(a, b)) };
            }
            _ => return Err(Refusal::Seam),
        }
        if !self.is_closed {
            return Ok(Class::Border);
        }
        let mut creases = inner.filter(|&i| {
            let [a, b] = [self.areas[before(i)], self.areas[i]];
            a.dot(b) < crease_cos * (a.length_squared() * b.length_squared()).sqrt()
        });
        Ok(match [creases.next(), creases.next(), creases.next()] {
            [Some(a), Some(b), None] if b - a > 1 && before(a) != b => Class::Edge(a, b),
            _ => Class::Inside,
        })
    }
}
