//! The faces that are left: those with corners in three clusters, each once.

use lodsmith_core::VertexId;

use super::pieces;

/// Three clusters, the least one first, and the first face of the model that joins them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Face {
    pub(super) corners: [u32; 3],
    pub(super) from: u32,
}

/// More faces than these that share their least cluster are sorted instead of compared in pairs.
const MANY: usize = 24;

/// The faces between different clusters, by their least one and then by their order in the model. Of several between the
/// same three the first stays, unless it goes the other way round. Cost: O(F).
pub(super) fn between(faces: &[[VertexId; 3]], cluster_of: &[u32], clusters: usize) -> Vec<Face> {
    let (shift, shares) = pieces::split(clusters, pieces::shares(faces.len()));
    let lists: Vec<Vec<Vec<Face>>> = pieces::map(faces.len(), |range| {
        let mut lists = vec![Vec::new(); shares];
        let first = range.start;
        for (i, t) in faces[range].iter().enumerate() {
            let [a, b, c] = t.map(|v| cluster_of[v.index()]);
            if a != b && b != c && c != a {
                let corners = match a.min(b).min(c) {
                    least if least == a => [a, b, c],
                    least if least == b => [b, c, a],
                    _ => [c, a, b],
                };
                let list: &mut Vec<Face> = match shares {
                    1 => &mut lists[0],
                    _ => &mut lists[corners[0] as usize >> shift],
                };
                list.push(Face { corners, from: (first + i) as u32 });
            }
        }
        lists
    });
    let parts = pieces::each(shares, |k| {
        let of_share = || lists.iter().flat_map(|list| &list[k]);
        let first = k << shift;
        distinct(of_share, first, (1 << shift).min(clusters - first))
    });
    match <[Vec<Face>; 1]>::try_from(parts) {
        Ok([only]) => only,
        Err(parts) => parts.concat(),
    }
}

/// The distinct ones among faces whose least clusters are `first` and the `count` - 1 after it.
fn distinct<'a, I: Iterator<Item = &'a Face>>(
    faces: impl Fn() -> I,
    first: usize,
    count: usize,
) -> Vec<Face> {
    let mut at = vec![0u32; count + 1];
    let bucket = |f: &Face| f.corners[0] as usize - first;
    faces().for_each(|f| at[bucket(f) + 1] += 1);
    for i in 0..count {
        at[i + 1] += at[i];
    }
    let mut sorted = vec![Face { corners: [0; 3], from: 0 }; at[count] as usize];
    for f in faces() {
        let slot = &mut at[bucket(f)];
        sorted[*slot as usize] = *f;
        *slot += 1;
    }
    // Now `at` is where each bucket ends.
    let (mut start, mut len) = (0, 0);
    for &end in &at[..count] {
        let end = end as usize;
        if end - start > MANY {
            sorted[start..end].sort_unstable();
        }
        let kept = len;
        for i in start..end {
            let f = sorted[i];
            let before =
                if end - start > MANY { &sorted[len.max(kept + 1) - 1..len] } else { &sorted[kept..len] };
            if before.iter().all(|g| g.corners != f.corners) {
                sorted[len] = f;
                len += 1;
            }
        }
        start = end;
    }
    sorted.truncate(len);
    sorted
}

/// How many edges have more than two of these faces, which stand in the order of their least clusters. Cost: O(F).
pub(super) fn non_manifold_edges(faces: &[Face], clusters: usize) -> usize {
    // Of the three edges of a face two are at its least cluster, and at hand there; the third is dealt out.
    let third = |f: &Face| {
        let [_, b, c] = f.corners;
        [b.min(c), b.max(c)]
    };
    let mut at = vec![0u32; clusters + 1];
    for [low, _] in faces.iter().map(third) {
        at[low as usize + 1] += 1;
    }
    for i in 0..clusters {
        at[i + 1] += at[i];
    }
    let mut ends = vec![0u32; faces.len()];
    for [low, high] in faces.iter().map(third) {
        let slot = &mut at[low as usize];
        ends[*slot as usize] = high;
        *slot += 1;
    }
    // Now `at` is where each list ends.
    let (mut found, mut start, mut left) = (0, 0, faces);
    let mut own: Vec<u32> = Vec::new();
    for (least, &end) in at[..clusters].iter().enumerate() {
        let here = left.iter().take_while(|f| f.corners[0] as usize == least).count();
        own.clear();
        own.extend(left[..here].iter().flat_map(|f| [f.corners[1], f.corners[2]]));
        own.extend(&ends[start..end as usize]);
        (start, left) = (end as usize, &left[here..]);
        if own.len() > MANY {
            own.sort_unstable();
            found += own.chunk_by(|a, b| a == b).filter(|same| same.len() > 2).count();
        } else {
            // Each is counted where it stands for the third time.
            found += (2..own.len())
                .filter(|&i| own[..i].iter().filter(|&&other| other == own[i]).count() == 2)
                .count();
        }
    }
    found
}
