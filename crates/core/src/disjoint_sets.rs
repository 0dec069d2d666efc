//! Disjoint sets (union-find).

/// Disjoint sets of the numbers below a count. The lowest member represents its set.
#[derive(Clone, Debug)]
pub struct DisjointSets {
    /// A lower member of the same set; the number itself if it is the lowest.
    lower: Vec<u32>,
}

impl DisjointSets {
    /// Creates `count` sets of one member each.
    pub fn new(count: usize) -> Self {
        Self { lower: (0..count as u32).collect() }
    }

    /// Returns the representative of a set by one of its members.
    ///
    /// # Panics
    /// If there is no such member.
    #[inline]
    pub fn find(&mut self, mut member: u32) -> u32 {
        while self.lower[member as usize] != member {
            // Path halving.
            let next = self.lower[self.lower[member as usize] as usize];
            self.lower[member as usize] = next;
            member = next;
        }
        member
    }

    /// Joins the sets of two members; true if they were separate.
    ///
    /// # Panics
    /// If there is no such member.
    #[inline]
    pub fn join(&mut self, a: u32, b: u32) -> bool {
        // (Neighbours on a surface are mostly in one set already.)
        if self.lower[a as usize] == self.lower[b as usize] {
            return false;
        }
        let (a, b) = (self.find(a), self.find(b));
        self.lower[a.max(b) as usize] = a.min(b);
        a != b
    }

    /// Returns the representative of each member.
    pub fn into_representatives(mut self) -> Vec<u32> {
        // In ascending order: the representatives of lower members are already known.
        for member in 0..self.lower.len() {
            self.lower[member] = self.lower[self.lower[member] as usize];
        }
        self.lower
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_member_represents_its_set() {
        let mut sets = DisjointSets::new(9);
        for (a, b) in [(8, 7), (7, 6), (2, 4), (4, 8), (3, 5)] {
            assert!(sets.join(a, b));
        }
        assert!(!sets.join(6, 2));
        let found: Vec<u32> = (0..9).map(|i| sets.find(i)).collect();
        assert_eq!(found, [0, 1, 2, 3, 2, 3, 2, 2, 2]);
        assert_eq!(sets.into_representatives(), found);
    }

    #[test]
    fn long_chains_have_one_representative() {
        let mut sets = DisjointSets::new(1000);
        for i in (1..1000).rev() {
            sets.join(i, i - 1);
        }
        assert_eq!(sets.clone().into_representatives(), [0; 1000]);
        assert_eq!(sets.find(999), 0);
    }
}
