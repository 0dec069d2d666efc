//! Palette quantisation of pictures: a third of the file size, without visible difference.

use std::collections::BTreeMap;

type Rgb = [u8; 3];

/// Colours of one palette entry, and the number of pixels with each.
type Bin = Vec<(Rgb, usize)>;

/// Returns a palette of at most `max` colours, and the index of each pixel.
///
/// Uses median cut: splits the bin with the largest spread at the median of its pixels.
///
/// # Panics
/// If `max` is not from 1 to 256.
pub(super) fn indexed(pixels: &[Rgb], max: usize) -> (Vec<Rgb>, Vec<u8>) {
    assert!((1..=256).contains(&max), "an index is a byte");
    let mut counts: BTreeMap<Rgb, usize> = BTreeMap::new();
    for p in pixels {
        *counts.entry(*p).or_default() += 1;
    }
    let mut bins: Vec<Bin> = vec![counts.into_iter().collect()];
    while bins.len() < max {
        let widest = (0..bins.len()).filter(|&i| bins[i].len() > 1).max_by(|&a, &b| {
            let [a, b] = [a, b].map(|i| spread(&bins[i]).1);
            a.total_cmp(&b)
        });
        let Some(widest) = widest else { break };
        let second = cut(&mut bins[widest]);
        bins.push(second);
    }
    let indices: BTreeMap<Rgb, u8> =
        bins.iter().enumerate().flat_map(|(i, bin)| bin.iter().map(move |c| (c.0, i as u8))).collect();
    (bins.iter().map(mean).collect(), pixels.iter().map(|p| indices[p]).collect())
}

/// Returns the channel with the largest spread in a bin, and the sum of squares along it.
fn spread(bin: &Bin) -> (usize, f64) {
    let centre = mean(bin);
    let along = |k: usize| -> f64 {
        bin.iter().map(|(c, n)| *n as f64 * (f64::from(c[k]) - f64::from(centre[k])).powi(2)).sum()
    };
    let all = [0, 1, 2].map(along);
    let k = (0..3).max_by(|&a, &b| all[a].total_cmp(&all[b])).unwrap_or(0);
    (k, all[k])
}

/// Removes and returns the upper half of a bin with at least two colours.
fn cut(bin: &mut Bin) -> Bin {
    let (k, _) = spread(bin);
    bin.sort_by_key(|(c, _)| (c[k], *c));
    let half = bin.iter().map(|c| c.1).sum::<usize>() / 2;
    let mut below = 0;
    let at = bin.iter().position(|c| {
        below += c.1;
        below > half
    });
    // Both halves get at least one colour.
    bin.split_off(at.unwrap_or(1).clamp(1, bin.len() - 1))
}

fn mean(bin: &Bin) -> Rgb {
    let all: usize = bin.iter().map(|c| c.1).sum::<usize>().max(1);
    [0, 1, 2].map(|k| {
        let sum: usize = bin.iter().map(|(c, n)| n * usize::from(c[k])).sum();
        ((sum + all / 2) / all) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_exact() {
        let pixels = [[9, 9, 9], [200, 0, 3], [9, 9, 9], [0, 0, 255]];
        let (palette, index) = indexed(&pixels, 16);
        assert_eq!(palette.len(), 3);
        let back: Vec<Rgb> = index.iter().map(|&i| palette[usize::from(i)]).collect();
        assert_eq!(back, pixels);
    }

    #[test]
    fn many_colours_are_approximated() {
        let pixels: Vec<Rgb> = (0..=255u8).flat_map(|i| [[i, i / 2, 255 - i], [i, i, i]]).collect();
        let (palette, index) = indexed(&pixels, 64);
        assert_eq!(palette.len(), 64);
        let difference = |(p, i): (&Rgb, &u8)| {
            let q = palette[usize::from(*i)];
            (0..3).map(|k| p[k].abs_diff(q[k])).max()
        };
        assert!(pixels.iter().zip(&index).all(|x| difference(x) <= Some(8)));
    }
}
