//! Pieces of consecutive vertices, with the faces at them.
//!
//! Faces are sorted by their lowest vertex. Sums at vertices can then be computed piece by piece, on several threads, from
//! the same numbers in the same order as in one walk over all faces.

use std::ops::Range;

use lodsmith_core::VertexId;

use crate::chunks;

/// Number of vertices of a piece. (Their data fit into the second cache.)
pub(crate) const PIECE_LEN: usize = 1 << 13;

/// Returns for each piece the faces whose lowest vertex is in it.
pub(crate) fn own_faces(faces: &[[VertexId; 3]], vertices: usize) -> Vec<Range<usize>> {
    let lowest = |t: &[VertexId; 3]| t[0].min(t[1]).min(t[2]).index() / PIECE_LEN;
    let start = |k: usize| faces.partition_point(|t| lowest(t) < k);
    (0..vertices.div_ceil(PIECE_LEN)).map(|k| start(k)..start(k + 1)).collect()
}

/// The faces at the vertices of each piece.
pub(crate) struct Pieces {
    /// Faces whose lowest vertex is in each piece.
    own: Vec<Range<usize>>,
    /// Other faces at vertices of each piece, in order; all of them come before.
    others: Vec<Vec<u32>>,
}

impl Pieces {
    /// Finds the faces of each piece. Cost: one walk over the faces.
    pub(crate) fn of(faces: &[[VertexId; 3]], vertices: usize) -> Self {
        let piece = |v: VertexId| v.index() / PIECE_LEN;
        let own = own_faces(faces, vertices);
        let reaching = chunks::each(own.len(), |k| {
            let mut found: Vec<(usize, u32)> = Vec::new();
            for i in own[k].clone() {
                let [a, b, c] = faces[i].map(piece);
                if a != b || b != c {
                    let mut add = |at: usize| found.push((at, i as u32));
                    // (Each piece once.)
                    if a != k {
                        add(a);
                    }
                    if b != k && b != a {
                        add(b);
                    }
                    if c != k && c != a && c != b {
                        add(c);
                    }
                }
            }
            found
        });
        let mut others = vec![Vec::new(); own.len()];
        for (k, face) in reaching.into_iter().flatten() {
            others[k].push(face);
        }
        Self { own, others }
    }

    /// Visits the faces at the vertices of a piece, in order.
    #[inline(always)]
    pub(crate) fn each_face(&self, piece: usize, mut visit: impl FnMut(usize)) {
        self.others[piece].iter().for_each(|&i| visit(i as usize));
        self.own[piece].clone().for_each(visit);
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Surface, shapes};

    use super::*;
    use crate::collapse::order::order;

    #[test]
    fn each_piece_has_the_faces_at_its_vertices_in_order() {
        let mesh = shapes::noisy_sphere(7, 0.05, 3);
        let surface: Surface<'_> = mesh.surface();
        let ordered = order(&surface);
        let pieces = Pieces::of(&ordered.faces, ordered.point_count);
        let count = ordered.point_count.div_ceil(PIECE_LEN);
        assert!(count > 3, "several pieces");
        let mut shared = 0;
        for k in 0..count {
            let own = k * PIECE_LEN..(k + 1) * PIECE_LEN;
            let here = |i: &usize| ordered.faces[*i].iter().any(|w| own.contains(&w.index()));
            let wanted: Vec<usize> = (0..ordered.faces.len()).filter(here).collect();
            let mut found = Vec::new();
            pieces.each_face(k, |i| found.push(i));
            assert_eq!(found, wanted);
            shared += pieces.others[k].len();
        }
        assert!(shared > 100, "faces of several pieces");
    }
}
