//! A stable sort by buckets: each piece of a list is split into buckets, then each bucket is put together from all
//! pieces. Both steps work on several pieces or buckets at a time, and write only where the processor's caches reach.

use bytemuck::Zeroable;
use bytemuck::allocation::zeroed_vec;

use crate::chunks;

/// The items of one piece by bucket, in their order within a bucket, and the end of each bucket.
struct SplitPiece<T> {
    items: Vec<T>,
    ends: Vec<u32>,
}

/// Items in buckets.
pub(super) struct Buckets<T> {
    pieces: Vec<SplitPiece<T>>,
    count: usize,
}

impl<T: Copy + Zeroable + Send + Sync> Buckets<T> {
    /// Splits the pieces of a list into `count` buckets.
    pub(super) fn new(pieces: Vec<Vec<T>>, count: usize, bucket: impl Fn(&T) -> usize + Sync) -> Self {
        let pieces = chunks::over(pieces, |_, items| SplitPiece::new(items, count, &bucket));
        Self { pieces, count }
    }

    /// Makes a list from the buckets in their order; `fill` gets the number of a bucket, its items as parts of the list,
    /// and where as many items of the new list go.
    pub(super) fn joined<U: Zeroable + Send>(
        &self,
        fill: impl Fn(usize, &[&[T]], &mut [U]) + Sync,
    ) -> Vec<U> {
        let parts = |k: usize| self.pieces.iter().map(move |piece| piece.bucket(k));
        let lengths: Vec<usize> = (0..self.count).map(|k| parts(k).map(<[T]>::len).sum()).collect();
        let mut joined = zeroed_vec(lengths.iter().sum());
        let places = chunks::cut(&mut joined, lengths.into_iter());
        chunks::over(places, |k, place| {
            if !place.is_empty() {
                fill(k, &parts(k).collect::<Vec<_>>(), place);
            }
        });
        joined
    }
}

impl<T: Copy + Zeroable> SplitPiece<T> {
    fn new(items: Vec<T>, count: usize, bucket: impl Fn(&T) -> usize) -> Self {
        if count == 1 {
            let ends = vec![items.len() as u32];
            return Self { items, ends };
        }
        let mut ends = vec![0u32; count];
        items.iter().for_each(|item| ends[bucket(item)] += 1);
        to_offsets(&mut ends);
        let mut by_bucket: Vec<T> = zeroed_vec(items.len());
        for item in &items {
            let end = &mut ends[bucket(item)];
            by_bucket[*end as usize] = *item;
            *end += 1;
        }
        Self { items: by_bucket, ends }
    }

    fn bucket(&self, k: usize) -> &[T] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.items[start as usize..self.ends[k] as usize]
    }
}

/// Replaces counts by offsets (exclusive prefix sum).
pub(super) fn to_offsets(counts: &mut [u32]) {
    let mut sum = 0;
    for count in counts {
        sum += std::mem::replace(count, sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_keep_their_order_within_a_bucket() {
        let all: Vec<u32> = (0..1000u32).map(|i| i.wrapping_mul(0x9e37_79b9) >> 8).collect();
        let mut sorted = all.clone();
        sorted.sort_by_key(|x| x % 7);
        for length in [1, 10, 333, 1000] {
            let pieces = all.chunks(length).map(<[u32]>::to_vec).collect();
            let buckets = Buckets::new(pieces, 7, |x| *x as usize % 7);
            let joined = buckets.joined(|k, parts, place: &mut [u32]| {
                assert!(parts.iter().copied().flatten().all(|x| *x as usize % 7 == k));
                place.copy_from_slice(&parts.concat());
            });
            assert_eq!(joined, sorted);
        }
    }
}
