//! Parsers of option values of pictures, with their permitted ranges.

use lodsmith_render::{Background, Light, LightKind, MAX_SIDE_PX};

use crate::values::{above_zero, at_least, number};

/// Parses a finite number that is not negative.
pub fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "it must not be below 0")
}

/// Parses any finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    number(text, |_| true, "it must be finite")
}

/// Parses an angle above the horizon, in degrees.
pub fn elevation_deg(text: &str) -> Result<f64, String> {
    number(text, |x| (-90.0..=90.0).contains(&x), "it must be from -90 to 90 degrees")
}

/// Parses a field of view of a camera, in degrees.
pub fn fov_deg(text: &str) -> Result<f64, String> {
    number(text, |x| (1.0..=170.0).contains(&x), "it must be from 1 to 170 degrees")
}

/// Parses a width and height in pixels: `1200x800`.
pub fn size(text: &str) -> Result<[usize; 2], String> {
    let expected = || format!("a size is WxH in pixels, such as 1200x800, up to {MAX_SIDE_PX} a side");
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(expected)?;
    let side = |text: &str| text.parse().ok().filter(|n| (1..=MAX_SIDE_PX).contains(n)).ok_or_else(expected);
    Ok([side(width)?, side(height)?])
}

/// Parses a colour as `#rrggbb`, in sRGB from 0 to 1.
pub fn color(text: &str) -> Result<[f32; 3], String> {
    let expected = || "a colour is #rrggbb, such as #cc9e66".to_owned();
    let digits = text
        .strip_prefix('#')
        .filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()))
        .ok_or_else(expected)?;
    let byte = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).map_err(|_| expected());
    Ok([byte(0)?, byte(1)?, byte(2)?].map(|b| f32::from(b) / 255.0))
}

/// Parses two numbers, the lower one first: `0,0.5`.
pub fn range(text: &str) -> Result<[f32; 2], String> {
    let expected = || "a range is LOW,HIGH, such as 0,0.5".to_owned();
    let (low, high) = text.split_once(',').ok_or_else(expected)?;
    let end = |text: &str| text.trim().parse::<f32>().ok().filter(|x| x.is_finite()).ok_or_else(expected);
    let (low, high) = (end(low)?, end(high)?);
    if low < high { Ok([low, high]) } else { Err(expected()) }
}

/// Parses the number of frames of a turntable: at least two, and at most an hour at 30 frames per second.
pub fn frames(text: &str) -> Result<usize, String> {
    at_least(text, 2).and_then(|n| if n <= 108_000 { Ok(n) } else { Err("at most 108000".to_owned()) })
}

/// Parses a number of frames per second.
pub fn fps(text: &str) -> Result<u16, String> {
    at_least(text, 1).and_then(|n| u16::try_from(n).map_err(|_| "at most 65535".to_owned()))
}

/// Parses a background: a word, a colour, or two of them from top to bottom.
pub fn background(text: &str) -> Result<Background, String> {
    match text {
        "transparent" => Ok(Background::Transparent),
        "gradient" => Ok(Background::default()),
        "surroundings" => Ok(Background::Environment { blurred: false }),
        "blurred" => Ok(Background::Environment { blurred: true }),
        _ => match text.split_once(',') {
            Some((upper, lower)) => Ok(Background::Gradient(color(upper)?, color(lower)?)),
            None => color(text).map(Background::Color),
        }
        .map_err(|e: String| format!("transparent, gradient, surroundings, blurred, or {e}")),
    }
}

/// Parses a light: `sun:X,Y,Z`, `point:X,Y,Z` or `spot:X,Y,Z`, with its strength at the end if it is not 1: `=0.5`.
pub fn light(text: &str) -> Result<Light, String> {
    let expected = || "a light is sun:X,Y,Z, point:X,Y,Z or spot:X,Y,Z, with =STRENGTH if not 1".to_owned();
    let (position, strength) = match text.split_once('=') {
        Some((position, strength)) => (position, above_zero(strength).map_err(|_| expected())? as f32),
        None => (text, 1.0),
    };
    let (kind, numbers) = position.split_once(':').ok_or_else(expected)?;
    let numbers: Vec<f32> =
        numbers.split(',').map(|n| n.trim().parse().map_err(|_| expected())).collect::<Result<_, _>>()?;
    let &[x, y, z] = numbers.as_slice() else { return Err(expected()) };
    let at = [x, y, z];
    if at.iter().any(|n| !n.is_finite()) || at == [0.0; 3] {
        return Err(expected());
    }
    let kind = match kind {
        "sun" => LightKind::Directional { to_light: at.into() },
        "point" => LightKind::Point { at: at.into() },
        // Half of a cone of 50 degrees, which contains the model from a distance of a little over two radii.
        // (Chosen by eye.)
        "spot" => LightKind::Spot { at: at.into(), toward: [0.0; 3].into(), half_angle_rad: 0.436 },
        _ => return Err(expected()),
    };
    // The light of point and spot lights falls off with the square of the distance, in radii: the given strength
    // applies at one radius from the centre.
    let strength = match kind {
        LightKind::Point { at } | LightKind::Spot { at, .. } => {
            strength * (at.length() - 1.0).max(0.5).powi(2)
        }
        LightKind::Directional { .. } => strength,
    };
    Ok(Light { kind, color: [strength; 3], in_world: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_colours_and_ranges_are_parsed() {
        assert_eq!(size("1200x800"), Ok([1200, 800]));
        assert_eq!(color("#cc9e66"), Ok([0.8, 158.0 / 255.0, 0.4]));
        assert_eq!(range("0, 0.5"), Ok([0.0, 0.5]));
        for bad in ["", "12", "0x5", "5x0", "x", "20000x20000", "-1x5"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        for bad in ["", "1", "1,0", "nan,1", "0,0", "0,inf"] {
            assert!(range(bad).is_err(), "{bad}");
        }
        for bad in ["", "cc9e66", "#ccc", "#ääää", "#+f+f+f", "#-1-1-1", "#cc9e6g"] {
            assert!(color(bad).is_err(), "{bad}");
        }
        assert!(elevation_deg("91").is_err() && fov_deg("0").is_err());
    }

    #[test]
    fn backgrounds_and_lights_are_parsed() {
        assert_eq!(background("#ff0000"), Ok(Background::Color([1.0, 0.0, 0.0])));
        assert_eq!(background("#000000,#ffffff"), Ok(Background::Gradient([0.0; 3], [1.0; 3])));
        assert_eq!(background("transparent"), Ok(Background::Transparent));
        assert_eq!(background("blurred"), Ok(Background::Environment { blurred: true }));
        for bad in ["red", "#ff00", "#gg0000", "#000000,", ""] {
            assert!(background(bad).is_err(), "{bad}");
        }
        let sun = light("sun:1,-2,0.5=0.7").unwrap();
        assert_eq!(
            (sun.kind, sun.color),
            (LightKind::Directional { to_light: [1.0, -2.0, 0.5].into() }, [0.7; 3])
        );
        for bad in
            ["sun", "sun:1,2", "moon:1,2,3", "sun:0,0,0", "point:1,2,nan", "spot:1,2,3=0", "sun:1,2,3=x"]
        {
            assert!(light(bad).is_err(), "{bad}");
        }
    }
}
