//! Dynamic face storage with the incident faces of each vertex.

use glam::DVec3;
use lodsmith_core::{FaceId, RegionId, VertexId};

use super::seams::Seams;
use crate::collapse::Goal;
use crate::collapse::order::NONE;
use crate::methods::task::PreparedInput;

/// Spare slots for new faces in the list of each vertex. (Guessed; a full list is moved.)
const SPARE_SLOTS: u32 = 4;

/// A removed face.
const REMOVED_FACE: [VertexId; 3] = [NONE; 3];

/// Lists longer than this keep removed faces until they are traversed: searching for each face would take too
/// long.
pub(super) const HUB_FACES: usize = 256;

/// An incident face of a vertex, and the other two vertices of that face.
#[derive(Clone, Copy, Debug)]
pub(super) struct IncidentFace {
    pub(super) next: VertexId,
    pub(super) last: VertexId,
    pub(super) face: FaceId,
}

const NO_CORNER: IncidentFace = IncidentFace { next: NONE, last: NONE, face: FaceId(0) };

/// The incident faces of each vertex are contiguous, since they are traversed most often. Face indices are
/// never reused.
pub(super) struct FaceStore<'a> {
    pub(super) points: &'a [DVec3],
    faces: Vec<[VertexId; 3]>,
    /// Seams of attributes that are kept.
    pub(super) seams: Seams,
    /// The input face that each face replaces, if there are regions or seams.
    stands_for: Option<Vec<u32>>,
    regions: Option<&'a [RegionId]>,
    lists: Vec<List>,
    corners: Vec<IncidentFace>,
    pub(super) face_count: usize,
    pub(super) vertex_count: usize,
}

/// Position of a vertex's list, and the number of faces still in it.
#[derive(Clone, Copy, Default)]
struct List {
    start: u32,
    len: u32,
    room: u32,
    live: u32,
}

impl<'a> FaceStore<'a> {
    pub(super) fn new(prepared: &'a PreparedInput, seams: Seams) -> Self {
        let faces = prepared.faces.clone();
        let mut lists = vec![List::default(); prepared.points.len()];
        for v in faces.iter().flatten() {
            lists[v.index()].live += 1;
        }
        let mut start = 0;
        for list in &mut lists {
            (list.start, list.room) = (start, list.live + SPARE_SLOTS);
            start += list.room;
        }
        let mut corners = vec![NO_CORNER; start as usize];
        for (f, &[a, b, c]) in faces.iter().enumerate() {
            for (v, next, last) in [(a, b, c), (b, c, a), (c, a, b)] {
                let list = &mut lists[v.index()];
                corners[(list.start + list.len) as usize] = IncidentFace { next, last, face: FaceId::new(f) };
                list.len += 1;
            }
        }
        let regions = prepared.regions.as_deref();
        Self {
            points: &prepared.points,
            stands_for: (regions.is_some() || !seams.is_empty()).then(|| (0..faces.len() as u32).collect()),
            seams,
            regions,
            face_count: faces.len(),
            vertex_count: lists.iter().filter(|l| l.live > 0).count(),
            faces,
            lists,
            corners,
        }
    }

    /// True if the goal is met.
    pub(super) fn meets(&self, goal: &Goal) -> bool {
        goal.faces.is_some_and(|n| self.face_count <= n)
            || goal.vertices.is_some_and(|n| self.vertex_count <= n)
    }

    pub(super) fn point(&self, v: VertexId) -> DVec3 {
        self.points[v.index()]
    }
    pub(super) fn face(&self, f: FaceId) -> [VertexId; 3] {
        self.faces[f.index()]
    }
    /// The remaining faces.
    pub(super) fn faces(&self) -> impl Iterator<Item = (FaceId, [VertexId; 3])> {
        self.faces.iter().enumerate().filter(|x| *x.1 != REMOVED_FACE).map(|(f, t)| (FaceId::new(f), *t))
    }
    /// Number of faces at a vertex.
    pub(super) fn degree(&self, v: VertexId) -> usize {
        self.lists[v.index()].live as usize
    }
    pub(super) fn region(&self, f: FaceId) -> Option<RegionId> {
        Some(self.regions?[self.stands_for.as_ref()?[f.index()] as usize])
    }
    /// Returns the input face that a face replaces, if recorded.
    pub(super) fn stands_for(&self, f: FaceId) -> Option<usize> {
        Some(self.stands_for.as_ref()?[f.index()] as usize)
    }

    /// Returns the incident faces of a vertex whose list is tidy.
    #[inline]
    pub(super) fn corners_at(&self, v: VertexId) -> &[IncidentFace] {
        let list = &self.lists[v.index()];
        &self.corners[list.start as usize..(list.start + list.len) as usize]
    }

    /// Drops removed faces from the list of a vertex.
    #[inline]
    pub(super) fn tidy(&mut self, v: VertexId) {
        let list = &mut self.lists[v.index()];
        if list.len == list.live {
            return;
        }
        let at = &mut self.corners[list.start as usize..(list.start + list.len) as usize];
        let mut kept = 0;
        for i in 0..at.len() {
            if self.faces[at[i].face.index()] != REMOVED_FACE {
                at[kept] = at[i];
                kept += 1;
            }
        }
        list.len = kept as u32;
    }

    pub(super) fn remove(&mut self, f: FaceId) {
        let t = std::mem::replace(&mut self.faces[f.index()], REMOVED_FACE);
        for v in t {
            let list = &mut self.lists[v.index()];
            list.live -= 1;
            self.vertex_count -= usize::from(list.live == 0);
            if list.len as usize <= HUB_FACES {
                let at = &mut self.corners[list.start as usize..(list.start + list.len) as usize];
                let i = at.iter().position(|c| c.face == f).expect("a face is in the lists of its vertices");
                at[i] = at[at.len() - 1];
                list.len -= 1;
            }
        }
        self.face_count -= 1;
    }

    /// Adds a face that replaces another.
    pub(super) fn add(&mut self, t: [VertexId; 3], instead_of: FaceId) {
        let f = FaceId::new(self.faces.len());
        self.faces.push(t);
        if let Some(all) = &mut self.stands_for {
            all.push(all[instead_of.index()]);
        }
        let [a, b, c] = t;
        for (v, next, last) in [(a, b, c), (b, c, a), (c, a, b)] {
            if self.lists[v.index()].len == self.lists[v.index()].room {
                self.make_room(v);
            }
            let list = &mut self.lists[v.index()];
            self.vertex_count += usize::from(list.live == 0);
            self.corners[(list.start + list.len) as usize] = IncidentFace { next, last, face: f };
            list.len += 1;
            list.live += 1;
        }
        self.face_count += 1;
    }

    fn make_room(&mut self, v: VertexId) {
        self.tidy(v);
        let list = &mut self.lists[v.index()];
        // At least a quarter must be free, otherwise it would fill up again too soon.
        if list.len * 4 <= list.room * 3 {
            return;
        }
        let from = list.start as usize;
        (list.start, list.room) = (self.corners.len() as u32, 2 * list.len + SPARE_SLOTS);
        self.corners.extend_from_within(from..from + list.len as usize);
        self.corners.resize((list.start + list.room) as usize, NO_CORNER);
    }
}
