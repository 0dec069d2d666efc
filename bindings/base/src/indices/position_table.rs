//! Vertices by position.

/// A table of the first vertex at each position.
pub(crate) struct Places {
    /// Vertices, found by open addressing; [`FREE`] where there is none.
    slots: Vec<u32>,
    /// True if several vertices have one position.
    pub(crate) has_twins: bool,
}

const FREE: u32 = u32::MAX;

impl Places {
    /// Enters all vertices. Cost: O(V).
    pub(crate) fn new(positions: &[[f32; 3]]) -> Self {
        let count = (positions.len() + positions.len() / 2 + 1).next_power_of_two();
        let mut places = Self { slots: vec![FREE; count], has_twins: false };
        for (i, &p) in (0u32..).zip(positions) {
            match places.slot(p, positions) {
                Ok(_) => places.has_twins = true,
                Err(slot) => places.slots[slot] = i,
            }
        }
        places
    }

    /// Returns the first vertex at a position.
    pub(crate) fn first(&self, p: [f32; 3], positions: &[[f32; 3]]) -> Option<u32> {
        self.slot(p, positions).ok().map(|slot| self.slots[slot])
    }

    /// Returns the slot of a position, or else the free one where it belongs.
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

/// The bits of a position; zeros of either sign are one.
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
        assert!(!Places::new(&positions).has_twins);
        positions.push([0.0, 0.0, 0.5]);
        let places = Places::new(&positions);
        assert!(places.has_twins, "a zero of the other sign is at the same place");
        assert!((0..1000).all(|i| places.first(positions[i as usize], &positions) == Some(i)));
        assert_eq!(places.first([-0.0, 0.0, 0.5], &positions), Some(0));
        assert_eq!(places.first([0.0, 0.1, 0.5], &positions), None);
        assert_eq!(Places::new(&[]).first([0.0; 3], &[]), None);
    }
}
