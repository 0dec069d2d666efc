//! What files say about colours and normals, made what a mesh wants.

/// Makes normals unit length; those that are nearly so stay as they are, those without a direction become zero.
pub(crate) fn unit_normals(normals: &mut [[f32; 3]]) {
    for normal in normals {
        let [x, y, z] = normal.map(f64::from);
        let length_sq = x * x + y * y + z * z;
        // Files print a few digits; to touch those would change a mesh that is only read and written again.
        if (length_sq - 1.0).abs() <= 1e-2 || length_sq == 0.0 {
            continue;
        }
        let length = length_sq.sqrt();
        *normal = if length.is_finite() { [x, y, z].map(|c| (c / length) as f32) } else { [0.0; 3] };
    }
}

/// Brings colours that count to 255 down to 0..1; whether they did. A negative alpha stands for none, and becomes 1.
///
/// The formats do not say which of the two it is; a value above 1 does.
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

/// The alpha of a colour without one, until [`unit_colors`] has seen it.
pub(crate) const NO_ALPHA: f32 = -1.0;

/// The colour of a vertex without one, until [`unit_colors`] has made it white.
pub(crate) const NO_COLOR: [f32; 4] = [0.0, 0.0, 0.0, -2.0];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_become_unit_length() {
        let mut normals = [[0.0, 0.0, 2.0], [0.0; 3], [0.6, 0.8001, 0.0], [f32::NAN, 0.0, 1.0]];
        unit_normals(&mut normals);
        assert_eq!(normals, [[0.0, 0.0, 1.0], [0.0; 3], [0.6, 0.8001, 0.0], [0.0; 3]]);
    }

    #[test]
    fn colors_count_to_one() {
        let mut colors = [[255.0, 0.0, 51.0, NO_ALPHA], [0.0, 0.0, 0.0, 255.0], NO_COLOR];
        assert!(unit_colors(&mut colors));
        assert_eq!(colors, [[1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
        let mut colors = [[1.0, 0.5, 0.0, NO_ALPHA]];
        assert!(!unit_colors(&mut colors));
        assert_eq!(colors, [[1.0, 0.5, 0.0, 1.0]]);
    }
}
