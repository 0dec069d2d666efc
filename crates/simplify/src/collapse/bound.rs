//! The threshold of the next sweep: a quantile of the bounds, by a histogram.

/// A histogram of non-negative floats by exponent and four bits of mantissa.
#[derive(Clone)]
pub(crate) struct Histogram {
    bins: Box<[u32; 4096]>,
    known: usize,
}

/// An empty table, made where it stays.
fn no_counts() -> Box<[u32; 4096]> {
    vec![0; 4096].into_boxed_slice().try_into().expect("as many as asked for")
}

impl Histogram {
    /// Counts the finite bounds.
    pub(crate) fn of(bounds: &[f32]) -> Self {
        // Neighbours often fall into one bin: two tables by turns, so that one count need not wait for the last.
        let (mut bins, mut others) = (no_counts(), no_counts());
        let bin = |x: f32| (x.to_bits() >> 19) as usize & 4095;
        let (pairs, rest) = bounds.as_chunks::<2>();
        for &[x, y] in pairs {
            bins[bin(x)] += 1;
            others[bin(y)] += 1;
        }
        rest.iter().for_each(|&x| bins[bin(x)] += 1);
        for (n, other) in bins.iter_mut().zip(others.iter()) {
            *n += other;
        }
        let infinite = std::mem::take(&mut bins[bin(f32::INFINITY)]);
        Self { bins, known: bounds.len() - infinite as usize }
    }
    /// Counts more bounds, where they are finite.
    pub(crate) fn add(&mut self, bounds: impl Iterator<Item = f32>) {
        for bound in bounds.filter(|x| x.is_finite()) {
            self.bins[(bound.to_bits() >> 19) as usize & 4095] += 1;
            self.known += 1;
        }
    }
    /// How many bounds are finite.
    pub(crate) fn known(&self) -> usize {
        self.known
    }
    /// A threshold that at least `want` of the bounds stay below.
    pub(crate) fn threshold(&self, want: usize) -> f32 {
        let (mut sum, mut k) = (0, 0);
        while sum < want && k < self.bins.len() {
            sum += self.bins[k] as usize;
            k += 1;
        }
        f32::from_bits((k as u32) << 19).min(f32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_takes_the_share_asked() {
        let bounds: Vec<f32> = (1..=1000).map(|i| i as f32).chain([f32::INFINITY]).collect();
        let histogram = Histogram::of(&bounds);
        assert_eq!(histogram.known(), 1000);
        let tau = histogram.threshold(700);
        let below = bounds.iter().filter(|&&x| x <= tau).count();
        assert!((700..760).contains(&below), "{below}");
    }
}
