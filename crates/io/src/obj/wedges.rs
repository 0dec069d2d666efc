//! Construction of wedges from corners with separate indices of position, texture coordinates and normal.

use std::collections::HashMap;

/// A missing index.
pub(super) const NONE: u32 = u32::MAX;

/// The wedges of a mesh.
#[derive(Debug, Default)]
pub(super) struct Wedges {
    /// The position of each wedge; `None` if wedge i is position i.
    pub(super) vertex_of: Option<Vec<u32>>,
    /// Texture coordinates and normal of each wedge, [`NONE`] if it has none.
    pub(super) attributes: Vec<[u32; 2]>,
}

/// The texture coordinate or normal indices of triangle corners.
#[derive(Clone, Copy, Debug)]
pub(super) enum Indices<'a> {
    /// No indices.
    Absent,
    /// The indices of the positions.
    Same,
    /// Separate indices, one triple per triangle.
    Own(&'a [[u32; 3]]),
}

impl Indices<'_> {
    #[inline]
    fn of(self, face: usize, positions: [u32; 3]) -> [u32; 3] {
        match self {
            Self::Absent => [NONE; 3],
            Self::Same => positions,
            Self::Own(all) => all[face],
        }
    }
}

/// Gives corners with the same three indices the same wedge, and replaces the position indices in `triangles`
/// by wedges.
///
/// If no position has two wedges, wedges get the numbers of the positions; else they are numbered in the
/// order of appearance. Every index of `triangles` must be below `vertex_count`. Cost: O(corners); the wedges
/// of a position form a short linked list, those beyond its maximum length are in a hash table.
pub(super) fn number_wedges(
    triangles: &mut [[u32; 3]],
    uvs: Indices<'_>,
    normals: Indices<'_>,
    vertex_count: usize,
) -> Wedges {
    // Guessed: a list of this length is still faster than the hash table.
    const MAX_LIST_LENGTH: usize = 24;
    let mut first = vec![NONE; vertex_count];
    let mut wedges: Vec<Wedge> = Vec::with_capacity(vertex_count);
    let mut beyond: HashMap<[u32; 3], u32> = HashMap::new();
    let mut is_split = false;
    let add = |wedges: &mut Vec<Wedge>, vertex: u32, attributes: [u32; 2]| {
        wedges.push(Wedge { vertex, attributes, next: NONE });
        wedges.len() as u32 - 1
    };
    for (face, triangle) in triangles.iter_mut().enumerate() {
        let (uv, normal) = (uvs.of(face, *triangle), normals.of(face, *triangle));
        for (k, corner) in triangle.iter_mut().enumerate() {
            let (vertex, wanted) = (*corner, [uv[k], normal[k]]);
            let mut at = first[vertex as usize];
            if at == NONE {
                at = add(&mut wedges, vertex, wanted);
                first[vertex as usize] = at;
            }
            let mut steps = 0;
            while wedges[at as usize].attributes != wanted {
                is_split = true;
                let next = wedges[at as usize].next;
                if next != NONE {
                    at = next;
                    steps += 1;
                } else if steps < MAX_LIST_LENGTH {
                    let new = add(&mut wedges, vertex, wanted);
                    wedges[at as usize].next = new;
                    at = new;
                } else {
                    at = *beyond
                        .entry([vertex, wanted[0], wanted[1]])
                        .or_insert_with(|| add(&mut wedges, vertex, wanted));
                }
            }
            *corner = at;
        }
    }
    if is_split {
        let vertex_of = Some(wedges.iter().map(|w| w.vertex).collect());
        return Wedges { vertex_of, attributes: wedges.iter().map(|w| w.attributes).collect() };
    }
    let attributes =
        first.iter().map(|&w| wedges.get(w as usize).map_or([NONE; 2], |w| w.attributes)).collect();
    for corner in triangles.iter_mut().flatten() {
        *corner = wedges[*corner as usize].vertex;
    }
    Wedges { vertex_of: None, attributes }
}

/// A wedge during construction.
struct Wedge {
    vertex: u32,
    attributes: [u32; 2],
    /// The next wedge of the same vertex.
    next: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_corners_share_a_wedge() {
        let mut triangles = [[0, 1, 2], [0, 2, 3]];
        let uvs = [[5, 6, 7], [5, 8, 9]];
        let wedges = number_wedges(&mut triangles, Indices::Own(&uvs), Indices::Absent, 4);
        assert_eq!(triangles, [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(wedges.vertex_of.unwrap(), [0, 1, 2, 2, 3]);
        assert_eq!(wedges.attributes.iter().map(|a| a[0]).collect::<Vec<_>>(), [5, 6, 7, 8, 9]);
    }

    #[test]
    fn without_seams_wedges_are_the_positions() {
        let mut triangles = [[3, 1, 2], [3, 2, 0]];
        let normals = [[9, 7, 8], [9, 8, 6]];
        let wedges = number_wedges(&mut triangles, Indices::Absent, Indices::Own(&normals), 5);
        assert_eq!(triangles, [[3, 1, 2], [3, 2, 0]]);
        assert!(wedges.vertex_of.is_none());
        assert_eq!(wedges.attributes.iter().map(|a| a[1]).collect::<Vec<_>>(), [6, 7, 8, 9, NONE]);
    }

    #[test]
    fn a_position_with_very_many_wedges_does_not_take_quadratic_time() {
        let count = 200_000;
        let mut triangles = vec![[0, 1, 2]; count];
        let uvs: Vec<_> = (0..count as u32).map(|i| [i / 2, 0, 0]).collect();
        let wedges = number_wedges(&mut triangles, Indices::Own(&uvs), Indices::Absent, 3);
        assert_eq!(wedges.vertex_of.unwrap().len(), count / 2 + 2);
        assert_eq!(triangles[0], triangles[1]);
        assert_eq!(triangles[count - 2], triangles[count - 1]);
    }
}
