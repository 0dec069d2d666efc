//! Perceived difference of two pictures of the same view.
//!
//! The pictures show two meshes from the same camera, on a transparent background: pixels that neither covers
//! are excluded, so the results do not depend on the empty space around the meshes. Opaque pictures are
//! covered everywhere. Transparent parts are blended over mid-grey.

mod flip;
mod planes;
mod size;
mod ssim;
mod views;

use lodsmith_core::Image;

pub use flip::{PIXELS_PER_DEGREE, flip};
pub use size::SizeError;
pub use views::cameras;

use planes::{grey_level, linear_of};
use size::check_sizes;

/// Differences of a picture from its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ImageError {
    /// Mean FLIP over the pixels that either picture covers: 0 for no visible difference, 1 for the largest.
    pub flip: f64,
    /// Mean structural similarity of brightness over the same pixels: 1 for equal pictures.
    pub ssim: f64,
    /// Mean squared difference of the three channels over the same pixels, with a range of 0 to 1; see
    /// [`ImageError::psnr_db`].
    pub mean_square: f64,
    /// Area covered in only one of the pictures, as a fraction of the area that the reference covers.
    pub silhouette: f64,
}

impl ImageError {
    /// Returns the mean of each measure over several views. `None` for no views.
    pub fn mean(views: &[Self]) -> Option<Self> {
        let count = views.len() as f64;
        let mean = |figure: fn(&Self) -> f64| views.iter().map(figure).sum::<f64>() / count;
        (!views.is_empty()).then(|| Self {
            flip: mean(|v| v.flip),
            ssim: mean(|v| v.ssim),
            mean_square: mean(|v| v.mean_square),
            silhouette: mean(|v| v.silhouette),
        })
    }

    /// Returns the worst of each measure over several views, which may be of different views. `None` for no
    /// views.
    pub fn worst(views: &[Self]) -> Option<Self> {
        views.iter().copied().reduce(|a, b| Self {
            flip: a.flip.max(b.flip),
            ssim: a.ssim.min(b.ssim),
            mean_square: a.mean_square.max(b.mean_square),
            silhouette: a.silhouette.max(b.silhouette),
        })
    }

    /// Peak signal-to-noise ratio in decibels; `None` for equal pictures, whose ratio is infinite.
    pub fn psnr_db(&self) -> Option<f64> {
        (self.mean_square > 0.0).then(|| -10.0 * self.mean_square.log10())
    }
}

/// Compares two pictures of the same view.
///
/// If neither covers anything, there is no difference. Uses the caller's rayon pool; any number of threads
/// gives the same results. Cost: O(pixels).
///
/// # Errors
/// [`SizeError`] if their sizes differ, or they are empty.
///
/// Source: [Andersson et al. 2020] for FLIP, [Wang et al. 2004] for SSIM.
pub fn image_error(reference: &Image, candidate: &Image) -> Result<ImageError, SizeError> {
    check_sizes(reference, candidate)?;
    let pairs = || reference.pixels().iter().zip(candidate.pixels());
    let covered: Vec<bool> = pairs().map(|(a, b)| a[3] > 0 || b[3] > 0).collect();
    let count = covered.iter().filter(|c| **c).count();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let sum: f64 = values.zip(&covered).filter(|(_, c)| **c).map(|(x, _)| x).sum();
        if count > 0 { Some(sum / count as f64) } else { None }
    };
    let lights = [linear_of(reference), linear_of(candidate)];
    let differences = flip::of_lights(&lights[0], &lights[1], PIXELS_PER_DEGREE);
    let flip = mean(&mut differences.values.iter().map(|&x| f64::from(x)));

    let [a, b] = lights.map(|light| light.map(|plane| plane.map(planes::encoded)));
    let similarity = ssim::map(&grey_level(&a), &grey_level(&b));
    let ssim = mean(&mut similarity.values.iter().map(|&x| f64::from(x)));
    let square =
        |i: usize| (0..3).map(|k| f64::from(a[k].values[i] - b[k].values[i]).powi(2)).sum::<f64>() / 3.0;
    let mean_square = mean(&mut (0..covered.len()).map(square));

    let alpha = |p: &[u8; 4]| u64::from(p[3]);
    let whole: u64 = reference.pixels().iter().map(alpha).sum();
    let beside: u64 = pairs().map(|(a, b)| alpha(a).abs_diff(alpha(b))).sum();
    let silhouette = match (whole, beside) {
        (_, 0) => 0.0,
        // The reference is fully transparent: all of the candidate is outside it.
        (0, _) => 1.0,
        _ => beside as f64 / whole as f64,
    };
    let (flip, ssim) = (flip.unwrap_or(0.0), ssim.unwrap_or(1.0));
    Ok(ImageError { flip, ssim, mean_square: mean_square.unwrap_or(0.0), silhouette })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lit sphere on a transparent background, with a radius of `part` of the picture.
    fn ball(part: f64, noise: u8) -> Image {
        const SIZE: usize = 96;
        let mut pixels = Vec::new();
        let mut state = 1u32;
        for y in 0..SIZE {
            for x in 0..SIZE {
                let at = |k: usize| (k as f64 + 0.5) / SIZE as f64 * 2.0 - 1.0;
                let r = (at(x).hypot(at(y))) / part;
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let light = 200.0 * (1.0 - r * r).max(0.0).sqrt() + 20.0;
                let shown =
                    (light as u8).saturating_add(((state >> 24) as u16 * u16::from(noise) / 255) as u8);
                pixels.push(if r < 1.0 { [shown, shown, shown / 2, 255] } else { [0; 4] });
            }
        }
        Image::new(SIZE, SIZE, pixels)
    }

    #[test]
    fn equal_pictures_have_no_error() {
        let same = image_error(&ball(0.8, 0), &ball(0.8, 0)).unwrap();
        assert_eq!((same.flip, same.mean_square, same.silhouette), (0.0, 0.0, 0.0));
        assert!((same.ssim - 1.0).abs() < 1e-6 && same.psnr_db().is_none());
        let nothing = Image::filled(4, 3, [9, 9, 9, 0]);
        let none = image_error(&nothing, &nothing).unwrap();
        assert_eq!((none.flip, none.ssim, none.silhouette), (0.0, 1.0, 0.0));
    }

    #[test]
    fn more_noise_is_more_error() {
        let reference = ball(0.8, 0);
        let errors: Vec<_> =
            [0, 8, 32, 128].map(|n| image_error(&reference, &ball(0.8, n)).unwrap()).to_vec();
        for pair in errors.windows(2) {
            assert!(pair[0].flip < pair[1].flip && pair[0].ssim > pair[1].ssim, "{pair:?}");
            assert!(pair[0].mean_square < pair[1].mean_square && pair[1].silhouette == 0.0);
        }
        let (mean, worst) = (ImageError::mean(&errors).unwrap(), ImageError::worst(&errors).unwrap());
        assert!(mean.flip < worst.flip && worst.ssim == errors[3].ssim);
        assert!(ImageError::mean(&[]).is_none() && ImageError::worst(&[]).is_none());
    }

    #[test]
    fn pixels_of_one_picture_count_by_their_area() {
        // Areas scale with the squared radius: 0.64 and 0.36.
        let smaller = image_error(&ball(0.8, 0), &ball(0.6, 0)).unwrap();
        assert!((smaller.silhouette - 0.28 / 0.64).abs() < 0.01, "{smaller:?}");
        let nothing = Image::filled(96, 96, [0; 4]);
        assert_eq!(image_error(&ball(0.8, 0), &nothing).unwrap().silhouette, 1.0);
        assert_eq!(image_error(&nothing, &ball(0.8, 0)).unwrap().silhouette, 1.0);
    }

    #[test]
    fn empty_space_around_a_model_does_not_matter() {
        let framed = |image: &Image, room: usize| {
            let side = image.width() + 2 * room;
            let mut wide = Image::filled(side, side, [0; 4]);
            for y in 0..image.height() {
                for x in 0..image.width() {
                    wide.pixels_mut()[(y + room) * side + x + room] = image.at(x, y);
                }
            }
            wide
        };
        let (a, b) = (ball(0.7, 0), ball(0.6, 60));
        let near = image_error(&a, &b).unwrap();
        let far = image_error(&framed(&a, 40), &framed(&b, 40)).unwrap();
        assert!(
            (near.flip - far.flip).abs() < 1e-3 && (near.ssim - far.ssim).abs() < 1e-3,
            "{near:?} {far:?}"
        );
        assert_eq!(near.silhouette, far.silhouette);
    }

    #[test]
    fn one_level_of_difference_has_48_decibels() {
        let grey = |x: u8| Image::filled(20, 20, [x, x, x, 255]);
        let error = image_error(&grey(100), &grey(101)).unwrap();
        assert!((error.psnr_db().unwrap() - 20.0 * 255f64.log10()).abs() < 1e-2, "{error:?}");
        let sizes = image_error(&grey(1), &Image::filled(3, 20, [0; 4])).unwrap_err();
        assert_eq!(sizes.to_string(), "pictures of 20x20 and 3x20 pixels cannot be compared");
        assert!(image_error(&Image::filled(0, 0, [0; 4]), &Image::filled(0, 0, [0; 4])).is_err());
    }
}
