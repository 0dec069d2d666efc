//! Check of every invariant of the store. Nothing here panics: a fault is described in one sentence.

use lodsmith_core::VertexId;

use super::{NONE, Store};
use crate::collapse::invariants::need;
use crate::cost::metric::VertexMemory;

impl<Q: VertexMemory> Store<Q> {
    /// Returns an error that names the first broken invariant, if any.
    ///
    /// The store must be ready for sweeps: its corner lists are filled, and it is not finished. Removed
    /// vertices stay until the next compaction.
    ///
    /// Cost: O(n log n).
    pub(crate) fn check(&self) -> Result<(), String> {
        self.check_lengths()?;
        let faces_at = self.check_faces()?;
        self.check_vertices(&faces_at)?;
        self.check_lists(&faces_at)?;
        self.check_rooms()?;
        self.check_origins()?;
        self.check_mergers()
    }

    /// Iterates over the live vertices.
    pub(in crate::collapse) fn living(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.v.len()).map(VertexId::new).filter(|u| !self.v[u.index()].kind.is_gone())
    }

    fn check_lengths(&self) -> Result<(), String> {
        let (vertices, faces) = (self.v.len(), self.t.len());
        let of_faces = [
            ("wedges", self.wedges.as_ref().map(Vec::len)),
            ("regions", self.regions.as_ref().map(Vec::len)),
            ("names", self.names.as_ref().map(Vec::len)),
        ];
        for (name, count) in of_faces {
            let count = count.unwrap_or(faces);
            need(count == faces, || format!("{faces} faces have {count} {name}"))?;
        }
        let bounds = self.bound.len();
        need(bounds == vertices, || format!("{vertices} vertices have {bounds} bounds"))?;
        let first = self.first_wedge.len();
        need(first == 0 || first == vertices, || format!("{vertices} vertices have {first} first wedges"))
    }

    /// Checks that live faces have three different live corners. Returns the number of faces of each
    /// vertex.
    fn check_faces(&self) -> Result<Vec<u32>, String> {
        let mut faces_at = vec![0u32; self.v.len()];
        let mut live = 0;
        for (f, t) in self.t.iter().enumerate().filter(|t| t.1[0] != NONE) {
            live += 1;
            for w in t {
                let x = self.v.get(w.index());
                need(x.is_some_and(|x| !x.kind.is_gone()), || {
                    format!("face {f} {t:?} has the corner {w}, which is not live")
                })?;
                faces_at[w.index()] += 1;
            }
            let [a, b, c] = *t;
            need(a != b && b != c && c != a, || format!("face {f} {t:?} has a corner twice"))?;
        }
        let recorded = self.live_faces;
        need(live == recorded, || format!("{live} faces are live, the count is {recorded}"))?;
        let most = self.faces_at_compaction;
        need(live <= most, || format!("{live} faces are live, more than the {most} at the last compaction"))?;
        Ok(faces_at)
    }

    /// Checks that live vertices have faces, finite positions and valid bounds, and that removed ones are
    /// never visited.
    fn check_vertices(&self, faces_at: &[u32]) -> Result<(), String> {
        let mut live = 0;
        for (i, (x, &bound)) in self.v.iter().zip(&self.bound).enumerate() {
            if x.kind.is_gone() {
                need(bound == f32::INFINITY, || format!("vertex {i} is removed but has the bound {bound}"))?;
                continue;
            }
            live += 1;
            need(faces_at[i] > 0, || format!("vertex {i} is live without a face"))?;
            need(bound >= 0.0, || format!("vertex {i} has the bound {bound}"))?;
            need(x.p.is_finite(), || format!("vertex {i} is at {}", x.p))?;
        }
        let recorded = self.live_vertices;
        need(live == recorded, || format!("{live} vertices are live, the count is {recorded}"))
    }

    /// Checks that the list of each vertex contains the corners of its live faces, each once, and nothing
    /// else.
    fn check_lists(&self, faces_at: &[u32]) -> Result<(), String> {
        let mut listed = vec![0u8; self.t.len()];
        let end = self.corners.len();
        for u in self.living() {
            let x = &self.v[u.index()];
            let (head, room, count) = (x.head as usize, x.room as usize, x.count as usize);
            need(count <= room && head + room <= end, || {
                format!(
                    "vertex {u} has a list of {count} in a room of {room} from {head} on, of {end} corners"
                )
            })?;
            for &corner in &self.corners[head..head + count] {
                let (f, k) = (corner.face(), corner.k());
                let Some(&t) = self.t.get(f).filter(|_| k < 3) else {
                    return Err(format!("vertex {u} lists the corner {k} of face {f}, which does not exist"));
                };
                let is_new = listed[f] & 1 << k == 0;
                need(is_new, || format!("the corner {k} of face {f} is listed twice, last at {u}"))?;
                listed[f] |= 1 << k;
                need(t[0] != NONE, || format!("vertex {u} lists face {f}, which is removed"))?;
                need(t[k] == u, || {
                    format!("vertex {u} lists the corner {k} of face {f}, which is of {}", t[k])
                })?;
            }
            let wanted = faces_at[u.index()];
            need(count == wanted as usize, || {
                format!("vertex {u} has {wanted} live faces and lists {count}")
            })?;
        }
        Ok(())
    }

    /// Checks that no two lists overlap.
    fn check_rooms(&self) -> Result<(), String> {
        let room = |u: VertexId| (self.v[u.index()].head, self.v[u.index()].room, u);
        let mut rooms: Vec<(u32, u32, VertexId)> = self.living().map(room).collect();
        rooms.sort_unstable();
        for pair in rooms.windows(2) {
            let [(head, room, u), (next, _, v)] = [pair[0], pair[1]];
            need(head + room <= next, || {
                format!("vertex {u} has the room from {head} to {}, and {v} from {next} on", head + room)
            })?;
        }
        Ok(())
    }

    /// Checks that each live vertex has its own number, of the ordered input or a later one, and that this
    /// number was not merged into another.
    fn check_origins(&self) -> Result<(), String> {
        let count = self.merged_into.len();
        let mut of = vec![NONE; count];
        for u in self.living() {
            let origin = self.v[u.index()].origin;
            let Some(of) = of.get_mut(origin.index()) else {
                return Err(format!("vertex {u} has the number {origin} of {count}"));
            };
            let other = std::mem::replace(of, u);
            need(other == NONE, || format!("vertices {other} and {u} have the number {origin}"))?;
            let root = self.merged_into[origin.index()];
            need(root == origin, || {
                format!("vertex {u} is live and has the number {origin}, which was merged into {root}")
            })?;
        }
        for (&origin, &place) in &self.places {
            need(origin.index() < count && place.index() < count, || {
                format!("number {origin} is at the place of {place}; there are {count}")
            })?;
        }
        Ok(())
    }

    /// Checks that chains of mergers end.
    fn check_mergers(&self) -> Result<(), String> {
        let count = self.merged_into.len();
        // For each number, the last walk that visited it.
        let mut seen = vec![u32::MAX; count];
        for first in 0..count {
            let mut at = first;
            while seen[at] == u32::MAX {
                seen[at] = first as u32;
                let next = self.merged_into[at];
                need(next.index() < count, || format!("number {at} was merged into {next} of {count}"))?;
                if next.index() == at {
                    break;
                }
                need(seen[next.index()] != first as u32, || {
                    format!("number {first} was merged into itself, through {at} and {next}")
                })?;
                at = next.index();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::collapse::ring::{Corner, Ring};
    use crate::cost::tensor::Tensor;

    /// A tetrahedron and a square of two faces, one vertex of which was merged into another.
    fn sound() -> Store<Tensor> {
        let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [3, 2, 1], [4, 5, 6], [4, 6, 7], [4, 7, 8]];
        let faces = faces.map(|t| t.map(VertexId)).to_vec();
        let mut store = Store::new(&[Vec3::ZERO; 9], faces, None, None);
        store.link();
        // 8 is merged into 7, with their face.
        store.remove_face(6);
        store.merged_into[8] = VertexId(7);
        store.v[8].kind = store.v[8].kind.gone();
        store.bound[8] = f32::INFINITY;
        store.live_vertices -= 1;
        store
    }

    #[test]
    fn each_broken_invariant_is_reported() {
        assert_eq!(sound().check(), Ok(()));
        type Breaks = fn(&mut Store<Tensor>);
        let cases: [(Breaks, &str); 21] = [
            (|s| s.bound.truncate(8), "9 vertices have 8 bounds"),
            (|s| s.regions = Some(Vec::new()), "7 faces have 0 regions"),
            (|s| s.first_wedge = vec![lodsmith_core::WedgeId(0)], "9 vertices have 1 first wedges"),
            (|s| s.t[4][2] = VertexId(8), "has the corner 8, which is not live"),
            (|s| s.t[4][2] = VertexId(9), "has the corner 9, which is not live"),
            (|s| s.t[4][2] = VertexId(5), "has a corner twice"),
            (|s| s.live_faces += 1, "6 faces are live, the count is 7"),
            (|s| s.faces_at_compaction = 5, "more than the 5 at the last compaction"),
            (|s| s.live_vertices += 1, "8 vertices are live, the count is 9"),
            (|s| s.bound[8] = 0.0, "vertex 8 is removed but has the bound 0"),
            (|s| s.bound[3] = f32::NAN, "vertex 3 has the bound NaN"),
            (|s| s.v[3].p.x = f32::NAN, "vertex 3 is at"),
            (|s| s.v[3].count += 1, "has a list of 4 in a room of 3"),
            (|s| s.v[3].count -= 1, "vertex 3 has 3 live faces and lists 2"),
            (|s| (s.t[3][0], s.live_faces) = (NONE, 5), "lists face 3, which is removed"),
            (|s| s.v[8].kind = s.v[7].kind, "vertex 8 is live without a face"),
            (|s| s.v[3].head = s.v[0].head, "is listed twice, last at 3"),
            (|s| s.corners[0] = Corner::new(3, 1), "lists the corner 1 of face 3, which is of 2"),
            (|s| s.v[0].room += 1, "vertex 0 has the room from 0 to 4, and 1 from 3 on"),
            (|s| s.v[1].origin = VertexId(0), "vertices 0 and 1 have the number 0"),
            (|s| (s.merged_into[2], s.merged_into[8]) = (VertexId(8), VertexId(2)), "merged into"),
        ];
        for (breaks, wanted) in cases {
            let mut store = sound();
            breaks(&mut store);
            let why = store.check().expect_err(wanted);
            assert!(why.contains(wanted), "{why}; not: {wanted}");
        }
    }

    #[test]
    fn cycles_of_mergers_are_reported() {
        let mut store = sound();
        store.merged_into.extend([VertexId(10), VertexId(9)]);
        let why = store.check().expect_err("9 and 10 form a cycle");
        assert!(why.contains("number 9 was merged into itself"), "{why}");
    }

    #[test]
    fn removing_a_face_keeps_the_lists_in_order() {
        let mut store = sound();
        let faces = |store: &Store<Tensor>, u| -> Vec<usize> {
            store.listed(VertexId(u)).iter().map(|c| c.face()).collect()
        };
        assert_eq!([0, 1, 2, 3, 7].map(|u| faces(&store, u).len()), [3, 3, 3, 3, 1]);
        assert_eq!(faces(&store, 0), [0, 1, 2]);
        store.remove_face(1);
        assert_eq!([0, 2, 3].map(|u| faces(&store, u)), [vec![0, 2], vec![0, 3], vec![2, 3]]);
        assert_eq!(store.check(), Ok(()));
        let mut ring = Ring::default();
        store.ring(VertexId(3), &mut ring);
        assert_eq!(ring.iter().map(|r| (r.a.0, r.b.0)).collect::<Vec<_>>(), [(1, 0), (2, 1)]);
    }
}
