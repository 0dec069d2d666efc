//! The current mesh of reader and writer: the context in which splits are coded.

use lodsmith_core::splits::Counts;

const NONE: u32 = u32::MAX;

/// Maximum number of wedges, and of corners, of a vertex whose split is coded by its ring; others are coded
/// by index.
pub(super) const MAX_RING: usize = 64;

/// Members of owners, in doubly linked lists.
#[derive(Clone, Debug, Default)]
struct Lists {
    first: Vec<u32>,
    /// The previous and the next member.
    neighbours: Vec<[u32; 2]>,
}

impl Lists {
    fn add(&mut self, owner: u32, member: u32) {
        let second = std::mem::replace(&mut self.first[owner as usize], member);
        if second != NONE {
            self.neighbours[second as usize][0] = member;
        }
        self.neighbours[member as usize] = [NONE, second];
    }
    fn remove(&mut self, owner: u32, member: u32) {
        let [before, behind] = self.neighbours[member as usize];
        match before {
            NONE => self.first[owner as usize] = behind,
            _ => self.neighbours[before as usize][1] = behind,
        }
        if behind != NONE {
            self.neighbours[behind as usize][0] = before;
        }
    }
    fn of(&self, owner: u32) -> impl Iterator<Item = u32> + '_ {
        let some = |m: u32| (m != NONE).then_some(m);
        std::iter::successors(some(self.first[owner as usize]), move |m| {
            some(self.neighbours[*m as usize][1])
        })
    }
}

/// The mesh at a level, elements in the order of their creation.
#[derive(Clone, Debug, Default)]
pub(super) struct LevelMesh {
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) regions: Vec<u32>,
    /// The vertex of each wedge.
    pub(super) vertex_of: Vec<u32>,
    pub(super) places: Vec<[i64; 3]>,
    pub(super) rows: Vec<i32>,
    /// Corners of wedges, wedges of vertices.
    corners: Lists,
    wedges: Lists,
}

/// Changes of a mesh by a split. New elements are in the order of their indices; so are changed ones, each
/// once.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SplitChanges {
    pub(super) faces: Vec<[u32; 3]>,
    /// One for each face.
    pub(super) regions: Vec<u32>,
    /// The vertex of each new wedge.
    pub(super) vertex_of: Vec<u32>,
    pub(super) rows: Vec<i32>,
    pub(super) places: Vec<[i64; 3]>,
    pub(super) corners: Vec<(u32, u32)>,
    pub(super) owners: Vec<(u32, u32)>,
    pub(super) changed: Vec<u32>,
    pub(super) changed_rows: Vec<i32>,
    pub(super) moved: Vec<(u32, [i64; 3])>,
}

impl SplitChanges {
    pub(super) fn clear(&mut self) {
        self.faces.clear();
        self.regions.clear();
        self.vertex_of.clear();
        self.rows.clear();
        self.places.clear();
        self.corners.clear();
        self.owners.clear();
        self.changed.clear();
        self.changed_rows.clear();
        self.moved.clear();
    }
}

/// A corner of a vertex, and its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct RingCorner {
    pub(super) corner: u32,
    pub(super) wedge: u32,
    /// The wedges of the next and the previous corner of its face.
    pub(super) next: u32,
    pub(super) last: u32,
}

impl LevelMesh {
    pub(super) fn counts(&self) -> Counts {
        Counts {
            faces: self.faces.len() as u32,
            wedges: self.vertex_of.len() as u32,
            vertices: self.places.len() as u32,
        }
    }
    pub(super) fn corner(&self, corner: u32) -> u32 {
        self.faces[corner as usize / 3][corner as usize % 3]
    }
    /// Returns the corners of a vertex, and its wedges, both ascending; none if it has too many of them.
    pub(super) fn ring(&self, vertex: u32) -> (Vec<RingCorner>, Vec<u32>) {
        let mut wedges: Vec<u32> = self.wedges.of(vertex).take(MAX_RING + 1).collect();
        let corners = wedges.iter().flat_map(|&w| self.corners.of(w)).take(MAX_RING + 1);
        let mut corners: Vec<RingCorner> = corners
            .map(|corner| {
                let (face, k) = (self.faces[corner as usize / 3], corner as usize % 3);
                RingCorner { corner, wedge: face[k], next: face[(k + 1) % 3], last: face[(k + 2) % 3] }
            })
            .collect();
        if wedges.len().max(corners.len()) > MAX_RING {
            return Default::default();
        }
        wedges.sort_unstable();
        corners.sort_unstable_by_key(|c| c.corner);
        (corners, wedges)
    }

    /// Applies a split, whose indices must all exist.
    pub(super) fn apply(&mut self, step: &SplitChanges) {
        for &vertex in &step.vertex_of {
            self.vertex_of.push(vertex);
        }
        self.rows.extend_from_slice(&step.rows);
        self.places.extend_from_slice(&step.places);
        self.corners.first.resize(self.vertex_of.len(), NONE);
        self.wedges.first.resize(self.places.len(), NONE);
        self.wedges.neighbours.resize(self.vertex_of.len(), [NONE; 2]);
        for w in self.vertex_of.len() - step.vertex_of.len()..self.vertex_of.len() {
            self.wedges.add(self.vertex_of[w], w as u32);
        }
        for &(w, vertex) in &step.owners {
            self.wedges.remove(self.vertex_of[w as usize], w);
            self.wedges.add(vertex, w);
            self.vertex_of[w as usize] = vertex;
        }
        for &(c, w) in &step.corners {
            let own = &mut self.faces[c as usize / 3][c as usize % 3];
            self.corners.remove(*own, c);
            self.corners.add(w, c);
            *own = w;
        }
        for face in &step.faces {
            let first = self.faces.len() as u32 * 3;
            self.faces.push(*face);
            self.corners.neighbours.resize(self.faces.len() * 3, [NONE; 2]);
            for (c, &w) in (first..).zip(face) {
                self.corners.add(w, c);
            }
        }
        self.regions.extend_from_slice(&step.regions);
        let channels = self.rows.len() / self.vertex_of.len().max(1);
        for (i, &w) in step.changed.iter().enumerate() {
            self.rows[w as usize * channels..][..channels]
                .copy_from_slice(&step.changed_rows[i * channels..][..channels]);
        }
        for &(v, place) in &step.moved {
            self.places[v as usize] = place;
        }
    }
}
