//! Normalisation of colours and normals from files, and the warning for positions rounded to single
//! precision.

use lodsmith_core::{Positions, TriMesh};

use crate::error::Warning;

/// Returns the warning for a single-precision format that moves double positions; `from` is the origin of
/// positions in the file.
///
/// It is a note as long as no coordinate moves by more than a millionth of the mesh's diagonal, else a loss.
pub(crate) fn rounding_warning(mesh: &TriMesh, format: &str, from: Option<[f64; 3]>) -> Option<Warning> {
    // Guessed: far below the error of a simplified mesh, and some 16 times the rounding of a mesh around the origin.
    const MAX_RELATIVE_MOVE: f64 = 1e-6;
    let Positions::F64(positions) = mesh.positions() else { return None };
    let origin = from.unwrap_or([0.0; 3]);
    let moved = |p: &[f64; 3]| {
        let by = |k: usize| (f64::from((p[k] - origin[k]) as f32) + origin[k] - p[k]).abs();
        // Non-finite coordinates do not count as moved.
        [0, 1, 2].map(|k| if p[k].is_finite() { by(k) } else { 0.0 }).into_iter().fold(0.0, f64::max)
    };
    let most = positions.iter().map(moved).fold(0.0, f64::max);
    if most == 0.0 {
        return None;
    }
    let measured = if from.is_some() { ", relative to the centre of the mesh" } else { "" };
    let text = format!("{format} stores positions in single precision{measured}: they are rounded");
    let diagonal = mesh.positions().view().bounds().map_or(0.0, |b| b.diagonal());
    if most <= MAX_RELATIVE_MOVE * diagonal {
        return Some(Warning::note(text));
    }
    Some(Warning::lost(format!("{text}, which moves some by {most:.1e}")))
}

/// Normalises normals to unit length; nearly unit normals stay unchanged, normals without a direction become
/// zero.
pub(crate) fn unit_normals(normals: &mut [[f32; 3]]) {
    for normal in normals {
        let [x, y, z] = normal.map(f64::from);
        let length_sq = x * x + y * y + z * z;
        // Files print a few digits; changing such normals would alter a mesh that is only read and written.
        if (length_sq - 1.0).abs() <= 1e-2 || length_sq == 0.0 {
            continue;
        }
        let length = length_sq.sqrt();
        *normal = if length.is_finite() { [x, y, z].map(|c| (c / length) as f32) } else { [0.0; 3] };
    }
}

/// Scales colours from 0..255 down to 0..1 and returns true if it did. A negative alpha means no alpha, and
/// becomes 1.
///
/// The formats do not declare the range; a value above 1 reveals it.
pub(crate) fn unit_colors(colors: &mut [[f32; 4]]) -> bool {
    let counts = colors.iter().flatten().any(|&c| c > 1.0);
    let scale = if counts { 255.0 } else { 1.0 };
    for color in colors {
        if color[3] == NO_COLOR[3] {
            *color = [1.0; 4];
            continue;
        }
        let has_alpha = color[3] >= 0.0;
        *color = color.map(|c| c / scale);
        if !has_alpha {
            color[3] = 1.0;
        }
    }
    counts
}

/// Converts colours from sRGB, as in meshes, to linear, as in glTF. Alpha stays as it is.
pub(crate) fn linear_colors(colors: &[[f32; 4]]) -> Vec<[f32; 4]> {
    colors.iter().map(|&[r, g, b, a]| [linear_of_srgb(r), linear_of_srgb(g), linear_of_srgb(b), a]).collect()
}

/// Converts colours from linear to sRGB. Alpha stays as it is.
pub(crate) fn srgb_colors(colors: &[[f32; 4]]) -> Vec<[f32; 4]> {
    colors.iter().map(|&[r, g, b, a]| [srgb_of_linear(r), srgb_of_linear(g), srgb_of_linear(b), a]).collect()
}

/// Tolerances of the two conversions, relative: above the rounding of single precision in both. Every byte of sRGB and
/// every linear value of 8 or 16 bits survives the round trip with these tolerances, found by trying all of them; with
/// half or twice of either, some do not.
const LINEAR_TOLERANCE: f64 = 3e-7;
const SRGB_TOLERANCE: f64 = 1.5e-7;

/// Converts a colour value from sRGB to linear, snapped to a 16-bit value if it equals one up to rounding.
pub(crate) fn linear_of_srgb(x: f32) -> f32 {
    let x = f64::from(x);
    let y = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
    snapped(y, 65535.0, LINEAR_TOLERANCE)
}

/// Converts a colour value from linear to sRGB, snapped to a byte if it equals one up to rounding.
pub(crate) fn srgb_of_linear(x: f32) -> f32 {
    let x = f64::from(x);
    let y = if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    snapped(y, 255.0, SRGB_TOLERANCE)
}

/// Returns a value, or the multiple of a step that is closer than the tolerance.
fn snapped(value: f64, steps: f64, tolerance: f64) -> f32 {
    let near = (value * steps).round() / steps;
    if (value - near).abs() <= tolerance * value.abs() { near as f32 } else { value as f32 }
}

/// The alpha of a colour without one, until [`unit_colors`] replaces it.
pub(crate) const NO_ALPHA: f32 = -1.0;

/// The colour of a vertex without one, until [`unit_colors`] makes it white.
pub(crate) const NO_COLOR: [f32; 4] = [0.0, 0.0, 0.0, -2.0];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_a_loss_if_it_is_large() {
        let at = |x: f64| {
            let corners = vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
            TriMesh::new(Positions::F64(corners), vec![[0, 1, 2].map(lodsmith_core::VertexId)]).unwrap()
        };
        let lost = |x: f64, from| rounding_warning(&at(x), "X", from).map(|w| w.data_lost);
        assert_eq!(lost(0.5, None), None);
        assert_eq!(lost(0.1, None), Some(false));
        assert_eq!(lost(1000.1, None), Some(true));
        assert_eq!(lost(1000.1, Some([1000.0, 0.0, 0.0])), Some(false));
        assert_eq!(lost(1e300, None), Some(true));
        let text = rounding_warning(&at(1000.1), "X", None).unwrap().text;
        assert_eq!(
            text,
            "X stores positions in single precision: they are rounded, which moves some by 2.4e-5"
        );
    }

    #[test]
    fn normals_become_unit_length() {
        let mut normals = [[0.0, 0.0, 2.0], [0.0; 3], [0.6, 0.8001, 0.0], [f32::NAN, 0.0, 1.0]];
        unit_normals(&mut normals);
        assert_eq!(normals, [[0.0, 0.0, 1.0], [0.0; 3], [0.6, 0.8001, 0.0], [0.0; 3]]);
    }

    #[test]
    fn colors_survive_both_conversions() {
        for byte in 0..=255u8 {
            let x = f32::from(byte) / 255.0;
            assert_eq!(srgb_of_linear(linear_of_srgb(x)), x, "{byte}");
        }
        for number in 0..=u16::MAX {
            let x = f32::from(number) / 65535.0;
            assert_eq!(linear_of_srgb(srgb_of_linear(x)), x, "{number}");
        }
        assert!((srgb_of_linear(0.5) - 0.735_357).abs() < 1e-6);
        assert_eq!(linear_colors(&[[1.0, 0.0, 0.5, 0.5]])[0][3], 0.5);
        // Brighter than white, and darker than black.
        for x in [2.5, -0.25] {
            assert!((linear_of_srgb(srgb_of_linear(x)) - x).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn colors_are_scaled_to_one() {
        let mut colors = [[255.0, 0.0, 51.0, NO_ALPHA], [0.0, 0.0, 0.0, 255.0], NO_COLOR];
        assert!(unit_colors(&mut colors));
        assert_eq!(colors, [[1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
        let mut colors = [[1.0, 0.5, 0.0, NO_ALPHA]];
        assert!(!unit_colors(&mut colors));
        assert_eq!(colors, [[1.0, 0.5, 0.0, 1.0]]);
    }
}
