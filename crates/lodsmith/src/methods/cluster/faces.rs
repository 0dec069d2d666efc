//! Faces of the clustered mesh: those with corners in three clusters, without duplicates.

use std::ops::Range;

use lodsmith_core::VertexId;

use crate::chunks;

/// Three clusters, the lowest first, and the first face of the model that connects them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClusterFace {
    pub(super) corners: [u32; 3],
    pub(super) from: u32,
}

/// Buckets of faces with the same lowest cluster are sorted above this size, and compared in pairs up to it.
const SORT_ABOVE: usize = 24;

/// Division of the clusters into contiguous shares; no result depends on it. Records which faces have a
/// corner in each share.
pub(super) struct Shares {
    pub(super) count: usize,
    /// Shares per block of clusters, times 2^32.
    each: u64,
    /// Base-2 logarithm of the number of bits per face, one for each share.
    bits: u32,
    /// Bit set of the shares that each face has a corner in; empty if there is only one share.
    touched: Vec<u64>,
}

/// Shares per thread, so that late threads still find work, and the maximum number of shares. (Guessed: to
/// find a share's faces, all marks are scanned once more.)
const SHARES_PER_THREAD: usize = 2;
const MAX_SHARES: usize = 32;
/// Shares start at multiples of this number of clusters.
pub(super) const BLOCK: usize = 1 << 6;

impl Shares {
    fn new(clusters: usize, faces: usize) -> Self {
        let blocks = clusters.div_ceil(BLOCK).max(1);
        let count = match chunks::threads(faces) {
            1 => 1,
            threads => (SHARES_PER_THREAD * threads).min(MAX_SHARES).min(blocks),
        };
        let bits = count.next_power_of_two().trailing_zeros();
        let words = if count > 1 { faces.div_ceil(64 >> bits) } else { 0 };
        Self { count, each: ((count as u64) << 32) / blocks as u64, bits, touched: vec![0; words] }
    }
    /// Returns the share of a cluster.
    #[inline(always)]
    pub(super) fn of(&self, cluster: u32) -> usize {
        ((u64::from(cluster) / BLOCK as u64 * self.each) >> 32) as usize
    }
    /// Returns the clusters of a share, out of `clusters`.
    pub(super) fn range(&self, share: usize, clusters: usize) -> Range<usize> {
        let start = |k: usize| match k < self.count {
            true => ((k as u64) << 32).div_ceil(self.each) as usize * BLOCK,
            false => clusters,
        };
        start(share)..start(share + 1)
    }
    /// Calls `look` with the faces that have a corner in a share, if there are several shares: in order, `N`
    /// at a time, and fewer at the end.
    pub(super) fn touching<const N: usize>(&self, share: usize, mut visit: impl FnMut(&[u32])) {
        let each = 64u32 >> self.bits;
        // Bit of the first share for every face of a word.
        let ones = u64::MAX / (u64::MAX >> (64 - (1u32 << self.bits)));
        // Double-sized to hold the faces of one more word. Written without the unpredictable branch on
        // whether a face is in the share.
        let mut found = [[0u32; N]; 2];
        let mut count = 0;
        for (first, word) in (0..).step_by(each as usize).zip(&self.touched) {
            let mut word = word >> share & ones;
            if word == 0 {
                continue;
            }
            let list = found.as_flattened_mut();
            if word == ones {
                list[count..count + each as usize]
                    .iter_mut()
                    .zip(first..)
                    .for_each(|(slot, face)| *slot = face);
                count += each as usize;
            } else {
                for face in first..first + each {
                    list[count] = face;
                    count += (word & 1) as usize;
                    word >>= 1u32 << self.bits;
                }
            }
            if count >= N {
                visit(&found[0]);
                found[0] = found[1];
                count -= N;
            }
        }
        visit(&found[0][..count]);
    }
}

/// Returns the faces between different clusters, sorted by their lowest cluster and then by their order in
/// the model, one list per share. Of several faces between the same three clusters the first of each
/// orientation is kept. Cost: O(F).
pub(super) fn faces_between(
    faces: &[[VertexId; 3]],
    cluster_of: &[u32],
    clusters: usize,
) -> (Vec<Vec<ClusterFace>>, Shares) {
    let mut shares = Shares::new(clusters, faces.len());
    let len = chunks::len(faces.len());
    let lists = match shares.count {
        1 => chunks::map(faces.len(), |range| kept_faces(faces, range, cluster_of, &shares, &mut [])),
        _ => {
            let mut touched = std::mem::take(&mut shares.touched);
            let lists = chunks::shared(&mut touched, len / (64 >> shares.bits), |k, touched| {
                let range = k * len..((k + 1) * len).min(faces.len());
                kept_faces(faces, range, cluster_of, &shares, touched)
            });
            shares.touched = touched;
            lists
        }
    };
    let kept = chunks::each(shares.count, |k| {
        let of_share = || lists.iter().flat_map(|list| &list.faces[list.at[k]..list.at[k + 1]]);
        let range = shares.range(k, clusters);
        distinct(of_share, range.start, range.len())
    });
    (kept, shares)
}

/// Faces sorted by the share of their lowest cluster, otherwise in order; and the start of each share, with
/// the end of the last.
struct SharedFaces {
    faces: Vec<ClusterFace>,
    at: Vec<usize>,
}

/// Number of faces filtered before the kept ones are built.
const FILTER_FACES: usize = 1 << 11;

/// Filters the kept faces of a range, and records the shares that each face touches.
fn kept_faces(
    faces: &[[VertexId; 3]],
    range: Range<usize>,
    cluster_of: &[u32],
    shares: &Shares,
    touched: &mut [u64],
) -> SharedFaces {
    let clusters = |t: &[VertexId; 3]| t.map(|v| cluster_of[v.index()]);
    let is_left = |[a, b, c]: [u32; 3]| usize::from((a != b) & (b != c) & (c != a));
    // Appended without the unpredictable branch on whether a face is kept.
    let mut left = [0u32; FILTER_FACES];
    let mut kept = Vec::new();
    let (each, width) = (64 >> shares.bits, 1u32 << shares.bits);
    let mut words = touched.chunks_mut(FILTER_FACES / each);
    for first in range.clone().step_by(FILTER_FACES) {
        let some = first..(first + FILTER_FACES).min(range.end);
        let mut found = 0;
        if let Some(words) = words.next() {
            for ((word, some), first) in
                words.iter_mut().zip(faces[some].chunks(each)).zip((first as u32..).step_by(each))
            {
                let mut all = 0;
                for (from, t) in (first..).zip(some) {
                    let [a, b, c] = clusters(t);
                    left[found % FILTER_FACES] = from;
                    found += is_left([a, b, c]);
                    let touches = 1u64 << shares.of(a) | 1 << shares.of(b) | 1 << shares.of(c);
                    all = all >> width | touches << (64 - width);
                }
                *word = all >> ((each - some.len()) << shares.bits);
            }
        } else {
            for (from, t) in (first as u32..).zip(&faces[some]) {
                left[found % FILTER_FACES] = from;
                found += is_left(clusters(t));
            }
        }
        kept.extend(left[..found].iter().map(|&from| {
            let [a, b, c] = clusters(&faces[from as usize]);
            let corners = match a.min(b).min(c) {
                least if least == a => [a, b, c],
                least if least == b => [b, c, a],
                _ => [c, a, b],
            };
            ClusterFace { corners, from }
        }));
    }
    by_share(kept, shares)
}

/// Sorts faces by share.
fn by_share(faces: Vec<ClusterFace>, shares: &Shares) -> SharedFaces {
    if shares.count == 1 {
        return SharedFaces { at: vec![0, faces.len()], faces };
    }
    let mut at = vec![0; shares.count + 1];
    faces.iter().for_each(|f| at[shares.of(f.corners[0]) + 1] += 1);
    (1..at.len()).for_each(|k| at[k] += at[k - 1]);
    let mut sorted = faces.clone();
    let mut next = at.clone();
    for face in faces {
        let slot = &mut next[shares.of(face.corners[0])];
        sorted[*slot] = face;
        *slot += 1;
    }
    SharedFaces { faces: sorted, at }
}

/// Removes duplicates among faces whose lowest clusters are `first` and the `count` - 1 after it.
fn distinct<'a, I: Iterator<Item = &'a ClusterFace>>(
    faces: impl Fn() -> I,
    first: usize,
    count: usize,
) -> Vec<ClusterFace> {
    let mut at = vec![0u32; count + 1];
    let bucket = |f: &ClusterFace| f.corners[0] as usize - first;
    faces().for_each(|f| at[bucket(f) + 1] += 1);
    for i in 0..count {
        at[i + 1] += at[i];
    }
    let mut sorted = vec![ClusterFace { corners: [0; 3], from: 0 }; at[count] as usize];
    for f in faces() {
        let slot = &mut at[bucket(f)];
        sorted[*slot as usize] = *f;
        *slot += 1;
    }
    // Now `at` holds the end of each bucket.
    let (mut start, mut len) = (0, 0);
    for &end in &at[..count] {
        let end = end as usize;
        if end - start > SORT_ABOVE {
            sorted[start..end].sort_unstable();
        }
        let kept = len;
        for i in start..end {
            let f = sorted[i];
            let before = if end - start > SORT_ABOVE {
                &sorted[len.max(kept + 1) - 1..len]
            } else {
                &sorted[kept..len]
            };
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

/// Counts the edges with more than two of these faces, which are sorted by their lowest clusters. Cost: O(F).
pub(super) fn non_manifold_edges(parts: &[Vec<ClusterFace>], clusters: usize) -> usize {
    // Two of the three edges of a face are at its lowest cluster and are counted there; the third is queued
    // at the lower of its ends, which comes later: a linked list per cluster, of the higher end and the
    // previous entry.
    const NONE: u32 = u32::MAX;
    let mut waiting = vec![NONE; clusters];
    let mut before: Vec<[u32; 2]> = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    // For each cluster, the last lowest cluster that it had an edge with, and the number of those edges,
    // saturated at 3.
    let mut counts = vec![0u64; clusters];
    let mut found = 0;
    let mut bump = |least: u64, other: u32| {
        let count = &mut counts[other as usize];
        let now = if *count >> 2 == least { *count + u64::from(*count & 3 < 3) } else { least << 2 | 1 };
        found += usize::from(now & 3 == 3 && now != *count);
        *count = now;
    };
    let mut faces = parts.iter().flatten().peekable();
    for least in 0..clusters as u32 {
        // Offset by 1, so that the initial 0 does not stand for cluster 0.
        let key = u64::from(least) + 1;
        while let Some(f) = faces.next_if(|f| f.corners[0] == least) {
            let [_, b, c] = f.corners;
            bump(key, b);
            bump(key, c);
            let last = std::mem::replace(&mut waiting[b.min(c) as usize], before.len() as u32);
            before.push([b.max(c), last]);
        }
        let mut next = waiting[least as usize];
        while next != NONE {
            let [other, then] = before[next as usize];
            bump(key, other);
            next = then;
        }
    }
    found
}
