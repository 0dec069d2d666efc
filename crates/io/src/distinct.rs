//! Numbering of equal triples of words: corners that share a position, or a vertex and its coordinates.

use std::hash::{BuildHasher, RandomState};

/// A set of triples, numbered by first appearance. A hash table with open addressing; the triples are
/// contiguous.
pub(crate) struct TripleSet {
    keys: Vec<[u32; 3]>,
    /// Number of a triple, or [`FREE`]; the length is a power of two, at least twice that of `keys`.
    slots: Vec<u32>,
    /// Differs from run to run, so that no file can be crafted whose corners all collide in the table. The
    /// numbers do not depend on it.
    seed: u64,
}

const FREE: u32 = u32::MAX;

impl TripleSet {
    /// Creates an empty set with a table for this many triples; it grows as needed.
    pub(crate) fn with_capacity(count: usize) -> Self {
        let slots = vec![FREE; (count.max(16) * 2).next_power_of_two()];
        Self { keys: Vec::with_capacity(count), slots, seed: RandomState::new().hash_one(0u8) }
    }

    /// Returns the number of a triple; a new triple gets the next number.
    ///
    /// # Panics
    /// At 2^32 - 1 different triples; callers have fewer corners than that.
    #[inline]
    pub(crate) fn id_of(&mut self, key: [u32; 3]) -> u32 {
        let mut at = self.slot_of(key);
        let mask = self.slots.len() - 1;
        loop {
            match self.slots[at] {
                FREE => break,
                id if self.keys[id as usize] == key => return id,
                _ => at = (at + 1) & mask,
            }
        }
        let id = u32::try_from(self.keys.len()).ok().filter(|&id| id != FREE);
        let id = id.expect("callers have fewer than 2^32 - 1 corners");
        self.slots[at] = id;
        self.keys.push(key);
        if self.keys.len() * 2 > self.slots.len() {
            self.grow();
        }
        id
    }

    /// Returns the triples, in the order of their numbers.
    pub(crate) fn into_keys(self) -> Vec<[u32; 3]> {
        self.keys
    }

    #[inline]
    fn slot_of(&self, [a, b, c]: [u32; 3]) -> usize {
        // Two rounds of multiply and fold; the constants are odd and have no pattern (digits of the golden ratio and of
        // the square root of 2).
        let fold = |x: u64, k: u64| {
            let wide = u128::from(x) * u128::from(k);
            (wide as u64) ^ (wide >> 64) as u64
        };
        let x = fold((u64::from(a) | u64::from(b) << 32) ^ self.seed, 0x9e37_79b9_7f4a_7c15);
        let x = fold(x ^ u64::from(c), 0x6a09_e667_f3bc_c909 ^ self.seed.rotate_left(31) | 1);
        x as usize & (self.slots.len() - 1)
    }

    #[cold]
    fn grow(&mut self) {
        self.slots = vec![FREE; self.slots.len() * 2];
        let mask = self.slots.len() - 1;
        for id in 0..self.keys.len() {
            let mut at = self.slot_of(self.keys[id]);
            while self.slots[at] != FREE {
                at = (at + 1) & mask;
            }
            self.slots[at] = id as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_first_appearance_through_growth() {
        let mut set = TripleSet::with_capacity(0);
        let key = |i: u32| [i / 7, i % 7, i.wrapping_mul(0x1000)];
        for round in 0..2 {
            for i in 0..10_000 {
                assert_eq!(set.id_of(key(i)), i, "round {round}");
            }
        }
        assert_eq!(set.into_keys().len(), 10_000);
    }
}
