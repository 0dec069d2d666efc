//! Duplicate faces.

use lodsmith_core::VertexId;

/// Returns for each face true unless an earlier one has the same vertices with the same winding. Faces are
/// sorted by their lowest vertex. Cost: O(n log n).
pub(super) fn first_of_each(faces: &[[VertexId; 3]]) -> Vec<bool> {
    let least = |t: &[VertexId; 3]| t[0].min(t[1]).min(t[2]);
    let mut keep = vec![true; faces.len()];
    let mut others = Vec::new();
    let mut start = 0;
    for run in faces.chunk_by(|a, b| least(a) == least(b)) {
        others.clear();
        others.extend(run.iter().enumerate().map(|(i, &[a, b, c])| {
            let rest = match least(&[a, b, c]) {
                x if x == a => [b, c],
                x if x == b => [c, a],
                _ => [a, b],
            };
            (rest, start + i)
        }));
        others.sort_unstable();
        for pair in others.windows(2).filter(|w| w[0].0 == w[1].0) {
            keep[pair[1].1] = false;
        }
        start += run.len();
    }
    keep
}

/// Removes the items for which `keep` is false.
pub(super) fn retain<T: Copy>(all: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    all.retain(|_| keep.next().is_some_and(|k| *k));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equal_faces_stays_whichever_corner_it_starts_with() {
        let face = |t: [u32; 3]| t.map(VertexId);
        let faces = [[0, 1, 2], [2, 0, 1], [0, 2, 1], [1, 2, 0], [2, 3, 1]].map(face);
        assert_eq!(first_of_each(&faces), [true, false, true, false, true]);
    }
}
