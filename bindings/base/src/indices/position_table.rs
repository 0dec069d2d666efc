//! Vertices by position.

/// A table of the first vertex at each position.
pub(crate) struct PositionTable {
    /// Vertices by open addressing; [`FREE`] in empty slots.
    slots: Vec<u32>,
    /// True if several vertices have the same position.
    pub(crate) has_duplicates: bool,
}

const FREE: u32 = u32::MAX;

impl PositionTable {
    /// Makes the table of all vertices. Cost: O(V).
    pub(crate) fn new(positions: &[[f32; 3]]) -> Self {
        let count = (positions.len() + positions.len() / 2 + 1).next_power_of_two();
        let mut table = Self { slots: vec![FREE; count], has_duplicates: false };
        for (i, &p) in (0u32..).zip(positions) {
            match table.slot(p, positions) {
                Ok(_) => table.has_duplicates = true,
                Err(slot) => table.slots[slot] = i,
            }
        }
        table
    }

    /// Returns the first vertex at a position.
    pub(crate) fn first(&self, p: [f32; 3], positions: &[[f32; 3]]) -> Option<u32> {
        self.slot(p, positions).ok().map(|slot| self.slots[slot])
    }

    /// Returns the slot of a position, or the free slot for it as an error.
    #[inline(always)]
    fn slot(&self, p: [f32; 3], positions: &[[f32; 3]]) -> Result<usize, usize> {
        let mask = self.slots.len() - 1;
        let p = key(p);
        let hash = p
            .iter()
            .fold(0u64, |h, &x| (h ^ u64::from(x)).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29));
        let mut at = (hash ^ hash >> 32) as usize & mask;
        loop {
            match self.slots[at] {
                FREE => return Err(at),
                i if key(positions[i as usize]) == p => return Ok(at),
                _ => at = (at + 1) & mask,
            }
        }
    }
}

/// Returns the bits of a position, with -0 as 0.
#[inline(always)]
fn key(p: [f32; 3]) -> [u32; 3] {
    p.map(|x| (x + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_are_found() {
        let mut positions: Vec<[f32; 3]> = (0..1000).map(|i| [i as f32, -(i as f32), 0.5]).collect();
        assert!(!PositionTable::new(&positions).has_duplicates);
        positions.push([0.0, 0.0, 0.5]);
        let table = PositionTable::new(&positions);
        assert!(table.has_duplicates, "0 and -0 are the same position");
        assert!((0..1000).all(|i| table.first(positions[i as usize], &positions) == Some(i)));
        assert_eq!(table.first([-0.0, 0.0, 0.5], &positions), Some(0));
        assert_eq!(table.first([0.0, 0.1, 0.5], &positions), None);
        assert_eq!(PositionTable::new(&[]).first([0.0; 3], &[]), None);
    }
}
