//! Threshold of the next sweep: a quantile of the bounds, from a histogram.

/// Bound of a vertex that has not been visited yet: below every threshold.
pub(super) const UNKNOWN: f32 = 0.0;
/// Number of bounds up to which they are kept as a list: a table takes longer to build and to walk.
/// (Measured.)
const LIST_MAX_BOUNDS: usize = 2048;
/// Number of bins that are summed at once.
const BINS_PER_GROUP: usize = 32;
const INFINITE_BIN: u16 = bin(f32::INFINITY);

/// A histogram of non-negative floats by exponent and four bits of mantissa.
#[derive(Clone)]
pub(crate) struct Histogram {
    bins: Bins,
    known: usize,
}

#[derive(Clone)]
enum Bins {
    Table(Box<[u32; 4096]>),
    /// The bin of each float.
    List(Vec<u16>),
}

const fn bin(x: f32) -> u16 {
    (x.to_bits() >> 19) as u16 & 4095
}

/// Returns an empty table, allocated on the heap.
fn no_counts() -> Box<[u32; 4096]> {
    vec![0; 4096].into_boxed_slice().try_into().expect("the length is 4096")
}

impl Histogram {
    /// Counts the finite bounds.
    pub(crate) fn of(bounds: &[f32]) -> Self {
        if bounds.len() <= LIST_MAX_BOUNDS {
            let list: Vec<u16> = bounds.iter().map(|&x| bin(x)).filter(|&k| k != INFINITE_BIN).collect();
            return Self { known: list.len(), bins: Bins::List(list) };
        }
        // Neighbours often fall into one bin: two tables are used in turn, so that a count does not depend on
        // the previous one.
        let (mut bins, mut others) = (no_counts(), no_counts());
        let (pairs, rest) = bounds.as_chunks::<2>();
        for &[x, y] in pairs {
            bins[usize::from(bin(x))] += 1;
            others[usize::from(bin(y))] += 1;
        }
        rest.iter().for_each(|&x| bins[usize::from(bin(x))] += 1);
        for (n, other) in bins.iter_mut().zip(others.iter()) {
            *n += other;
        }
        let infinite = std::mem::take(&mut bins[usize::from(INFINITE_BIN)]);
        Self { known: bounds.len() - infinite as usize, bins: Bins::Table(bins) }
    }
    /// Counts more bounds, if they are finite.
    pub(crate) fn add(&mut self, bounds: impl Iterator<Item = f32>) {
        for bound in bounds.filter(|x| x.is_finite()) {
            match &mut self.bins {
                Bins::Table(bins) => bins[usize::from(bin(bound))] += 1,
                Bins::List(list) => list.push(bin(bound)),
            }
            self.known += 1;
        }
    }
    /// Leaves out the bounds of vertices that have not been visited. Returns their number.
    pub(super) fn leave_out_unknown(&mut self) -> usize {
        let unknown = usize::from(bin(UNKNOWN));
        let count = match &mut self.bins {
            Bins::Table(bins) => std::mem::take(&mut bins[unknown]) as usize,
            Bins::List(list) => list.extract_if(.., |k| usize::from(*k) == unknown).count(),
        };
        self.known -= count;
        count
    }
    /// Returns the sum of several histograms.
    pub(super) fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let (mut sum, mut known) = (no_counts(), 0);
        for one in all {
            match &one.bins {
                Bins::Table(bins) => sum.iter_mut().zip(bins.iter()).for_each(|(n, other)| *n += other),
                Bins::List(list) => list.iter().for_each(|&k| sum[usize::from(k)] += 1),
            }
            known += one.known;
        }
        Self { bins: Bins::Table(sum), known }
    }
    /// Returns the number of finite bounds.
    pub(crate) fn known(&self) -> usize {
        self.known
    }
    /// Returns a threshold such that at least `want` of the bounds are below it.
    pub(crate) fn threshold(&self, want: usize) -> f32 {
        let above = match &self.bins {
            Bins::Table(bins) => {
                let (mut sum, mut k) = (0, 0);
                // (Most bins lie below all bounds.)
                while let Some(few) = bins.get(k..k + BINS_PER_GROUP) {
                    let all = sum + few.iter().sum::<u32>() as usize;
                    if all >= want {
                        break;
                    }
                    (sum, k) = (all, k + BINS_PER_GROUP);
                }
                while sum < want && k < bins.len() {
                    sum += bins[k] as usize;
                    k += 1;
                }
                k as u32
            }
            Bins::List(_) if want == 0 => 0,
            Bins::List(list) if want > list.len() => 4096,
            Bins::List(list) => {
                let mut list = list.clone();
                u32::from(*list.select_nth_unstable(want - 1).1) + 1
            }
        };
        f32::from_bits(above << 19).min(f32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_above_the_requested_number_of_bounds() {
        let bounds: Vec<f32> = (1..=1000).map(|i| i as f32).chain([f32::INFINITY]).collect();
        let histogram = Histogram::of(&bounds);
        assert_eq!(histogram.known(), 1000);
        let tau = histogram.threshold(700);
        let below = bounds.iter().filter(|&&x| x <= tau).count();
        assert!((700..760).contains(&below), "{below}");
    }

    #[test]
    fn lists_and_tables_give_the_same_threshold() {
        let few: Vec<f32> =
            (0..LIST_MAX_BOUNDS).map(|i| if i % 7 == 0 { f32::INFINITY } else { (i * i) as f32 }).collect();
        let list = Histogram::of(&few);
        // The same bounds, and infinite ones that do not count.
        let many: Vec<f32> = few.iter().copied().chain([f32::INFINITY; 2]).collect();
        let table = Histogram::of(&many);
        assert!(matches!((&list.bins, &table.bins), (Bins::List(_), Bins::Table(_))));
        assert_eq!(list.known(), table.known());
        for want in [0, 1, 2, 500, list.known() - 1, list.known(), list.known() + 1] {
            assert_eq!(list.threshold(want).to_bits(), table.threshold(want).to_bits(), "{want}");
        }
    }
}
