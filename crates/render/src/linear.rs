//! Conversion between linear light and sRGB.

use std::sync::LazyLock;

use glam::Vec3;

/// Table size: half a grey level at the dark end, where the curve is steep.
const ENCODE_STEPS: usize = 4096;

static TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| decoded(i as f32 / 255.0)));
static TO_BYTE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..ENCODE_STEPS).map(|i| (encoded(i as f32 / (ENCODE_STEPS - 1) as f32) * 255.0).round() as u8).collect()
});

/// Returns the linear light of an sRGB value from 0 to 1.
pub fn decoded(s: f32) -> f32 {
    if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
}

fn encoded(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Returns the linear light of a stored byte.
#[inline]
pub fn of_byte(byte: u8) -> f32 {
    TO_LINEAR[usize::from(byte)]
}

/// The table of [`of_byte`], for loops.
#[inline]
pub(crate) fn bytes() -> &'static [f32; 256] {
    &TO_LINEAR
}

/// Returns the linear light of an sRGB colour.
pub(crate) fn of_srgb(color: [f32; 3]) -> Vec3 {
    Vec3::from(color.map(|s| decoded(s.clamp(0.0, 1.0))))
}

/// Table from linear light to bytes; too bright is white.
#[derive(Clone, Copy)]
pub struct Encoder(&'static [u8]);

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Encoder {
    /// Returns the table.
    pub fn new() -> Self {
        Self(&TO_BYTE)
    }
    /// Returns the sRGB byte nearest to a linear light.
    #[inline(always)]
    pub fn byte(self, light: f32) -> u8 {
        // NaN becomes 0 here.
        self.0[((light * (ENCODE_STEPS - 1) as f32 + 0.5) as usize).min(ENCODE_STEPS - 1)]
    }
    #[inline(always)]
    pub(crate) fn bytes(self, light: Vec3) -> [u8; 3] {
        [self.byte(light.x), self.byte(light.y), self.byte(light.z)]
    }
}

/// Composites a premultiplied colour over another.
#[inline(always)]
pub(crate) fn over(upper: [f32; 4], lower: &mut [f32; 4]) {
    let through = 1.0 - upper[3];
    *lower = [0, 1, 2, 3].map(|k| upper[k] + lower[k] * through);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_comes_back() {
        let encoder = Encoder::new();
        for byte in 0..=255 {
            assert!(encoder.byte(of_byte(byte)).abs_diff(byte) <= 1, "{byte}");
        }
        assert_eq!([-1.0, 0.0, 1.0, 7.0, f32::NAN].map(|x| encoder.byte(x)), [0, 0, 255, 255, 0]);
    }
}
