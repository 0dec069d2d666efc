//! Ranges of attribute values: a result never leaves the range of its source.

use lodsmith_core::Semantic;

/// Returns true if the values of an attribute stay within their ranges one by one. Directions have length 1
/// instead; joints and their weights have an order of their own, and the weights sum to 1.
pub(crate) fn has_ranges(semantic: &Semantic) -> bool {
    !matches!(semantic, Semantic::Tangent | Semantic::Joints(_) | Semantic::Weights(_))
}

/// Returns the minimum and maximum over all wedges of the first value, the second value and so on, `width` in
/// all. NaN and infinity count as 0, as in a run.
pub(crate) fn ranges(values: &[f32], width: usize) -> Vec<[f32; 2]> {
    let mut all = vec![[f32::INFINITY, f32::NEG_INFINITY]; width];
    for row in values.chunks_exact(width.max(1)) {
        for ([low, high], &x) in all.iter_mut().zip(row) {
            // Both zeros become +0: which of them counts as the smaller depends on the processor.
            let x = if x.is_finite() { x + 0.0 } else { 0.0 };
            (*low, *high) = (low.min(x), high.max(x));
        }
    }
    // Without wedges there is no range to keep.
    all.iter_mut().filter(|r| r[0] > r[1]).for_each(|r| *r = UNLIMITED_RANGE);
    all
}

/// The range of a value that is not limited.
pub(crate) const UNLIMITED_RANGE: [f32; 2] = [-f32::MAX, f32::MAX];

/// Clamps a value to a range.
#[inline(always)]
pub(crate) fn within(x: f32, [low, high]: [f32; 2]) -> f32 {
    x.clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_has_a_range_of_its_own() {
        let values = [0.5, -3.0, 0.25, f32::NAN, 1.0, -1.0];
        assert_eq!(ranges(&values, 2), [[0.25, 1.0], [-3.0, 0.0]]);
        assert_eq!(ranges(&[], 1), [UNLIMITED_RANGE]);
        for zeros in [[0.0, -0.0], [-0.0, 0.0], [-0.0, -0.0]] {
            assert_eq!(ranges(&zeros, 1)[0].map(f32::to_bits), [0, 0], "{zeros:?}");
        }
        assert_eq!([-1.0, 0.3, 7.0].map(|x| within(x, [0.25, 1.0])), [0.25, 0.3, 1.0]);
    }
}
