//! Sorting by integer keys: one piece of machine code serves many lists, which keeps WebAssembly modules small.

/// Returns an integer that sorts as the number does in the order of [`f64::total_cmp`].
pub fn key_of(x: f64) -> u64 {
    let bits = x.to_bits();
    // Negative numbers get smaller as their bits grow.
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

/// Returns the indices of keys in the order of the keys; indices of equal keys ascend. Cost: O(n log n), 24 bytes per
/// key.
///
/// # Panics
/// If there are 2³² keys or more.
pub fn indices_by_key(keys: impl IntoIterator<Item = u64>) -> Vec<usize> {
    let index = |i: usize| u32::try_from(i).expect("fewer than 2^32 keys");
    let mut all: Vec<(u64, u32)> = keys.into_iter().enumerate().map(|(i, key)| (key, index(i))).collect();
    sort_pairs(&mut all);
    all.into_iter().map(|(_, i)| i as usize).collect()
}

/// Sorts pairs of numbers. (Not inlined, so that the code exists once.)
#[inline(never)]
pub fn sort_pairs(all: &mut [(u64, u32)]) {
    all.sort_unstable();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_sort_as_numbers_do() {
        let nan = f64::NAN.abs();
        let mut all = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            nan,
            -nan,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MIN_POSITIVE,
            -5e-324,
            1e300,
        ];
        all.sort_by(f64::total_cmp);
        assert!(all.windows(2).all(|two| key_of(two[0]) < key_of(two[1])));
    }

    #[test]
    fn equal_keys_stay_in_order() {
        assert_eq!(indices_by_key([5, 1, 5, 0, 1]), [3, 1, 4, 0, 2]);
        assert!(indices_by_key([]).is_empty());
    }
}
