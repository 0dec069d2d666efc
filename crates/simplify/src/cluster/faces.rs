//! The faces that are left: those with corners in three clusters, each once.

use std::ops::Range;

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

/// Clusters in a row, shared out; no result depends on how. Each share knows which faces have a corner in it.
pub(super) struct Shares {
    pub(super) count: usize,
    shift: u32,
    /// For each piece of the faces and each share, runs of faces: where there is more than one share.
    runs: Vec<Vec<Vec<Range<u32>>>>,
}

/// Shares for each thread, and how long one is at least: it is a multiple of that.
const SHARES: usize = 8;
const LEAST_SHARE: usize = 1 << 8;

impl Shares {
    fn new(clusters: usize, faces: usize) -> Self {
        let shares = match pieces::threads(faces) {
            1 => 1,
            threads => SHARES * threads,
        };
        let len = clusters.div_ceil(shares).max(LEAST_SHARE).next_power_of_two();
        Self { count: clusters.div_ceil(len).max(1), shift: len.trailing_zeros(), runs: Vec::new() }
    }
    /// The clusters of a share.
    pub(super) fn range(&self, share: usize, clusters: usize) -> Range<usize> {
        (share << self.shift).min(clusters)..((share + 1) << self.shift).min(clusters)
    }
    /// Calls `look` with the faces that have a corner in a share, in their order.
    pub(super) fn runs(&self, share: usize, faces: usize, mut look: impl FnMut(Range<usize>)) {
        if self.count == 1 {
            return look(0..faces);
        }
        for run in self.runs.iter().flat_map(|of| &of[share]) {
            look(run.start as usize..run.end as usize);
        }
    }
}

/// The faces between different clusters, by their least one and then by their order in the model. Of several between the
/// same three the first stays, unless it goes the other way round. Cost: O(F).
pub(super) fn between(faces: &[[VertexId; 3]], cluster_of: &[u32], clusters: usize) -> (Vec<Face>, Shares) {
    let mut shares = Shares::new(clusters, faces.len());
    let (count, shift) = (shares.count, shares.shift);
    let (lists, runs): (Vec<_>, Vec<_>) = pieces::map(faces.len(), |range| {
        let mut runs: Vec<Vec<Range<u32>>> = vec![Vec::new(); if count > 1 { count } else { 0 }];
        // The share that faces have been in, and since which.
        let (mut here, mut since, end) = (0, range.start as u32, range.end as u32);
        // Which of them are left no processor could guess.
        let mut left = [0u32; pieces::PIECE];
        let mut found = 0;
        for (i, t) in (range.start as u32..).zip(&faces[range]) {
            let [a, b, c] = t.map(|v| cluster_of[v.index()]);
            left[found] = i;
            found += usize::from((a != b) & (b != c) & (c != a));
            if count > 1 {
                let [a, b, c] = [a, b, c].map(|x| (x >> shift) as usize);
                match a == b && b == c {
                    true if a == here => {}
                    true => {
                        lengthen(&mut runs[here], since..i);
                        (here, since) = (a, i);
                    }
                    false => {
                        lengthen(&mut runs[here], since..i);
                        lengthen(&mut runs[a], i..i + 1);
                        if b != a {
                            lengthen(&mut runs[b], i..i + 1);
                        }
                        if c != a && c != b {
                            lengthen(&mut runs[c], i..i + 1);
                        }
                        since = i + 1;
                    }
                }
            }
        }
        if count > 1 {
            lengthen(&mut runs[here], since..end);
        }
        let left = left[..found].iter().map(|&from| {
            let [a, b, c] = faces[from as usize].map(|v| cluster_of[v.index()]);
            let corners = match a.min(b).min(c) {
                least if least == a => [a, b, c],
                least if least == b => [b, c, a],
                _ => [c, a, b],
            };
            Face { corners, from }
        });
        (by_share(left.collect(), &shares), runs)
    })
    .into_iter()
    .unzip();
    shares.runs = runs;
    let parts = pieces::each(count, |k| {
        let of_share = || lists.iter().flat_map(|(list, ends)| &list[ends[k]..ends[k + 1]]);
        let range = shares.range(k, clusters);
        distinct(of_share, range.start, range.len())
    });
    let kept = match <[Vec<Face>; 1]>::try_from(parts) {
        Ok([only]) => only,
        Err(parts) => parts.concat(),
    };
    (kept, shares)
}

/// Faces by the share of their least cluster, otherwise in their order; and where each share begins and the last ends.
fn by_share(faces: Vec<Face>, shares: &Shares) -> (Vec<Face>, Vec<usize>) {
    let of = |f: &Face| if shares.count > 1 { f.corners[0] as usize >> shares.shift } else { 0 };
    let mut at = vec![0; shares.count + 1];
    faces.iter().for_each(|f| at[of(f) + 1] += 1);
    (1..at.len()).for_each(|k| at[k] += at[k - 1]);
    if at.contains(&faces.len()) && at.iter().all(|n| *n == 0 || *n == faces.len()) {
        return (faces, at);
    }
    let mut sorted = faces.clone();
    let mut next = at.clone();
    for f in faces {
        let slot = &mut next[of(&f)];
        sorted[*slot] = f;
        *slot += 1;
    }
    (sorted, at)
}

/// Adds faces to runs of such.
#[inline(always)]
fn lengthen(runs: &mut Vec<Range<u32>>, faces: Range<u32>) {
    match runs.last_mut() {
        Some(last) if last.end == faces.start => last.end = faces.end,
        _ if faces.is_empty() => {}
        _ => runs.push(faces),
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
    // Of the three edges of a face two are at its least cluster, and at hand there; the third waits at the lesser of its
    // ends, which comes later: the last one there, and for each the one before it.
    const NONE: u32 = u32::MAX;
    let mut waiting = vec![NONE; clusters];
    let mut before = vec![NONE; faces.len()];
    let (mut found, mut start) = (0, 0);
    let mut own: Vec<u32> = Vec::new();
    for least in 0..clusters {
        let here = faces[start..].iter().take_while(|f| f.corners[0] as usize == least).count();
        own.clear();
        for (i, f) in faces.iter().enumerate().skip(start).take(here) {
            let [_, b, c] = f.corners;
            own.extend([b, c]);
            before[i] = std::mem::replace(&mut waiting[b.min(c) as usize], i as u32);
        }
        start += here;
        let mut next = waiting[least];
        while next != NONE {
            let [_, b, c] = faces[next as usize].corners;
            own.push(b.max(c));
            next = before[next as usize];
        }
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
