//! Corners that name position, texture coordinates and normal apart, into wedges.

use std::collections::HashMap;

/// An index that is not there.
pub(super) const NONE: u32 = u32::MAX;

/// Wedges for corners.
#[derive(Debug, Default)]
pub(super) struct Wedges {
    /// The position of each wedge; `None` where wedge i is position i.
    pub(super) vertex_of: Option<Vec<u32>>,
    /// Texture coordinates and normal of each wedge, [`NONE`] where it has none.
    pub(super) attributes: Vec<[u32; 2]>,
}

/// Gives corners with the same three indices the same wedge, and writes the wedges into `triangles`, which holds the
/// positions before. `uvs` and `normals` have as many triangles, or none at all.
///
/// Where no position has two wedges, wedges get the numbers of the positions; else they are numbered as they appear.
/// Every index of `triangles` is below `vertex_count`.
/// Cost: O(corners); the wedges of a position form a short list, long ones go on in a hash table.
pub(super) fn number_wedges(
    triangles: &mut [[u32; 3]],
    uvs: &[[u32; 3]],
    normals: &[[u32; 3]],
    vertex_count: usize,
) -> Wedges {
    // Guessed: a list of this length is still faster than the table.
    const LONG: usize = 24;
    let mut first = vec![NONE; vertex_count];
    let mut next: Vec<u32> = Vec::with_capacity(vertex_count);
    let mut vertex_of: Vec<u32> = Vec::with_capacity(vertex_count);
    let mut attributes: Vec<[u32; 2]> = Vec::with_capacity(vertex_count);
    let mut beyond: HashMap<[u32; 3], u32> = HashMap::new();
    let mut is_split = false;
    for (face, triangle) in triangles.iter_mut().enumerate() {
        let pick = |buffer: &[[u32; 3]], k: usize| buffer.get(face).map_or(NONE, |t| t[k]);
        for (k, corner) in triangle.iter_mut().enumerate() {
            let vertex = *corner;
            let wanted = [pick(uvs, k), pick(normals, k)];
            let add = |next: &mut Vec<u32>, vertex_of: &mut Vec<u32>, attributes: &mut Vec<[u32; 2]>| {
                let wedge = vertex_of.len() as u32;
                next.push(NONE);
                vertex_of.push(vertex);
                attributes.push(wanted);
                wedge
            };
            let mut wedge = first[vertex as usize];
            if wedge == NONE {
                wedge = add(&mut next, &mut vertex_of, &mut attributes);
                first[vertex as usize] = wedge;
            }
            let mut steps = 0;
            while attributes[wedge as usize] != wanted {
                is_split = true;
                let after = next[wedge as usize];
                if after != NONE {
                    wedge = after;
                    steps += 1;
                } else if steps < LONG {
                    let new = add(&mut next, &mut vertex_of, &mut attributes);
                    next[wedge as usize] = new;
                    wedge = new;
                } else {
                    wedge = *beyond
                        .entry([vertex, wanted[0], wanted[1]])
                        .or_insert_with(|| add(&mut next, &mut vertex_of, &mut attributes));
                }
            }
            *corner = wedge;
        }
    }
    if is_split {
        return Wedges { vertex_of: Some(vertex_of), attributes };
    }
    let attributes =
        first.iter().map(|&w| attributes.get(w as usize).copied().unwrap_or([NONE; 2])).collect();
    for wedge in triangles.iter_mut().flatten() {
        *wedge = vertex_of[*wedge as usize];
    }
    Wedges { vertex_of: None, attributes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_alike_share_a_wedge() {
        let mut triangles = [[0, 1, 2], [0, 2, 3]];
        let uvs = [[5, 6, 7], [5, 8, 9]];
        let wedges = number_wedges(&mut triangles, &uvs, &[], 4);
        assert_eq!(triangles, [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(wedges.vertex_of.unwrap(), [0, 1, 2, 2, 3]);
        assert_eq!(wedges.attributes.iter().map(|a| a[0]).collect::<Vec<_>>(), [5, 6, 7, 8, 9]);
    }

    #[test]
    fn without_seams_wedges_are_the_positions() {
        let mut triangles = [[3, 1, 2], [3, 2, 0]];
        let normals = [[9, 7, 8], [9, 8, 6]];
        let wedges = number_wedges(&mut triangles, &[], &normals, 5);
        assert_eq!(triangles, [[3, 1, 2], [3, 2, 0]]);
        assert!(wedges.vertex_of.is_none());
        assert_eq!(wedges.attributes.iter().map(|a| a[1]).collect::<Vec<_>>(), [6, 7, 8, 9, NONE]);
    }

    #[test]
    fn a_position_with_very_many_wedges_takes_no_square_time() {
        let count = 200_000;
        let mut triangles = vec![[0, 1, 2]; count];
        let uvs: Vec<_> = (0..count as u32).map(|i| [i / 2, 0, 0]).collect();
        let wedges = number_wedges(&mut triangles, &uvs, &[], 3);
        assert_eq!(wedges.vertex_of.unwrap().len(), count / 2 + 2);
        assert_eq!(triangles[0], triangles[1]);
        assert_eq!(triangles[count - 2], triangles[count - 1]);
    }
}
