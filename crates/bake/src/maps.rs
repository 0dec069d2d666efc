//! Baked maps as values of texels.

use lodsmith_core::Image;

use crate::options::MapKind;

/// A finished map.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BakedMap {
    /// Its kind.
    pub kind: MapKind,
    /// Its texels.
    pub texels: Texels,
    /// The value of white. For heights a distance in units of the model (black is its negative); for curvature one over
    /// these units; for emitted light the intensity, if it is above 1.
    pub range: Option<f64>,
}

/// The texels of a map, row after row from the top.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Texels {
    /// Eight bits per channel.
    Rgba8(Image),
    /// One channel of sixteen bits.
    Gray16 {
        /// Number of texels in a row.
        width: usize,
        /// Number of rows.
        height: usize,
        /// All texels.
        values: Vec<u16>,
    },
}

impl BakedMap {
    /// Returns the map as a PNG.
    ///
    /// # Errors
    /// If the map is too large for PNG.
    pub fn to_png(&self) -> Result<Vec<u8>, lodsmith_render::file::PictureError> {
        match &self.texels {
            Texels::Rgba8(image) => lodsmith_render::encode(image, lodsmith_render::PictureFormat::Png),
            Texels::Gray16 { width, height, values } => {
                lodsmith_render::encode_gray16(*width, *height, values)
            }
        }
    }
}

/// Fills the texels that were not baked: near a chart with the values of the chart, farther away with ever coarser
/// means, so that mipmaps keep the colours of the charts up to their edges.
///
/// `is_known` marks the texels that have values. Cost: O(texels).
pub(crate) fn fill(values: &mut [[f32; 4]], is_known: &[bool], width: usize, height: usize, blank: [f32; 4]) {
    if is_known.iter().all(|k| *k) {
        return;
    }
    if !is_known.contains(&true) {
        values.fill(blank);
        return;
    }
    // Down: means of the known texels of each square of two by two.
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut means = vec![[0f32; 4]; half_width * half_height];
    let mut has_mean = vec![false; half_width * half_height];
    for y in 0..half_height {
        for x in 0..half_width {
            let (mut sum, mut count) = ([0f32; 4], 0f32);
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y) = (2 * x + i, 2 * y + j);
                if x < width && y < height && is_known[y * width + x] {
                    let v = values[y * width + x];
                    (0..4).for_each(|k| sum[k] += v[k]);
                    count += 1.0;
                }
            }
            if count > 0.0 {
                means[y * half_width + x] = sum.map(|s| s / count);
                has_mean[y * half_width + x] = true;
            }
        }
    }
    if half_width * half_height > 1 {
        fill(&mut means, &has_mean, half_width, half_height, blank);
    }
    // And up.
    for y in 0..height {
        for x in 0..width {
            if !is_known[y * width + x] {
                values[y * width + x] = means[y / 2 * half_width + x / 2];
            }
        }
    }
}

/// Gives texels next to known ones their mean, `rings` times. `is_known` is updated. The order of the texels does not
/// matter. Cost: O(texels · rings).
pub(crate) fn dilate(
    values: &mut [[f32; 4]],
    is_known: &mut [bool],
    width: usize,
    height: usize,
    rings: usize,
) {
    let mut front: Vec<usize> = (0..values.len()).filter(|&i| !is_known[i]).collect();
    for _ in 0..rings {
        let mut added = Vec::new();
        front.retain(|&i| {
            let (x, y) = (i % width, i / width);
            let (mut sum, mut weight) = ([0f32; 4], 0f32);
            for dy in -1i64..=1 {
                for dx in -1i64..=1 {
                    let (nx, ny) = (x as i64 + dx, y as i64 + dy);
                    if !(0..width as i64).contains(&nx) || !(0..height as i64).contains(&ny) {
                        continue;
                    }
                    let n = ny as usize * width + nx as usize;
                    if is_known[n] {
                        let w = if dx == 0 || dy == 0 { 1.0 } else { 0.5 };
                        (0..4).for_each(|k| sum[k] += values[n][k] * w);
                        weight += w;
                    }
                }
            }
            if weight > 0.0 {
                added.push((i, sum.map(|s| s / weight)));
            }
            weight == 0.0
        });
        for (i, value) in added {
            (values[i], is_known[i]) = (value, true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_texels_take_the_colour_of_the_nearest_chart() {
        let (width, height) = (16, 16);
        let mut values = vec![[0f32; 4]; width * height];
        let mut is_known = vec![false; width * height];
        for y in 0..height {
            (values[y * width], is_known[y * width]) = ([1.0; 4], true);
            (values[y * width + 15], is_known[y * width + 15]) = ([3.0; 4], true);
        }
        dilate(&mut values, &mut is_known, width, height, 4);
        fill(&mut values, &is_known, width, height, [9.0; 4]);
        for y in 0..height {
            assert!((0..5).all(|x| values[y * width + x] == [1.0; 4]));
            assert!((11..16).all(|x| values[y * width + x] == [3.0; 4]));
            assert!((5..11).all(|x| (1.0..=3.0).contains(&values[y * width + x][0])));
        }
        fill(&mut values, &vec![false; 256], width, height, [9.0; 4]);
        assert_eq!(values[3], [9.0; 4]);
    }
}
