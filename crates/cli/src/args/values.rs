//! Parsers of argument values, with their permitted ranges.

pub(crate) use lodsmith_asset::values::{above_zero, count};
use lodsmith_asset::values::{at_least, number};

/// Parses a finite number that is not negative.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "it must not be below 0")
}

/// Parses any finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    number(text, |_| true, "it must be finite")
}

/// Parses an angle above the horizon, in degrees.
pub(crate) fn elevation_deg(text: &str) -> Result<f64, String> {
    number(text, |x| (-90.0..=90.0).contains(&x), "it must be from -90 to 90 degrees")
}

/// Parses a field of view of a camera, in degrees.
pub(crate) fn fov_deg(text: &str) -> Result<f64, String> {
    number(text, |x| (1.0..=170.0).contains(&x), "it must be from 1 to 170 degrees")
}

/// Parses a width and height in pixels: `1200x800`.
pub(crate) fn size(text: &str) -> Result<[usize; 2], String> {
    let most = lodsmith_render::MAX_SIDE_PX;
    let wanted = || format!("a size is WxH in pixels, such as 1200x800, up to {most} a side");
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(wanted)?;
    let side = |text: &str| text.parse::<usize>().ok().filter(|n| (1..=most).contains(n)).ok_or_else(wanted);
    Ok([side(width)?, side(height)?])
}

/// Parses a colour as `#rrggbb`, in sRGB from 0 to 1.
pub(crate) fn color(text: &str) -> Result<[f32; 3], String> {
    let wanted = || "a colour is #rrggbb, such as #cc9e66".to_owned();
    let digits = text
        .strip_prefix('#')
        .filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()))
        .ok_or_else(wanted)?;
    let byte = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).map_err(|_| wanted());
    Ok([byte(0)?, byte(1)?, byte(2)?].map(|b| f32::from(b) / 255.0))
}

/// Parses two numbers, the lower one first: `0,0.5`.
pub(crate) fn range(text: &str) -> Result<[f32; 2], String> {
    let wanted = || "a range is LOW,HIGH, such as 0,0.5".to_owned();
    let (low, high) = text.split_once(',').ok_or_else(wanted)?;
    let side = |text: &str| text.trim().parse::<f32>().ok().filter(|x| x.is_finite()).ok_or_else(wanted);
    let (low, high) = (side(low)?, side(high)?);
    if low < high { Ok([low, high]) } else { Err(wanted()) }
}

/// Parses the number of frames of a turn: one is no turn, and an hour at 30 frames per second is enough.
pub(crate) fn frames(text: &str) -> Result<usize, String> {
    at_least(text, 2).and_then(|n| if n <= 108_000 { Ok(n) } else { Err("at most 108000".to_owned()) })
}

/// Parses a number of frames per second.
pub(crate) fn fps(text: &str) -> Result<u16, String> {
    at_least(text, 1).and_then(|n| u16::try_from(n).map_err(|_| "at most 65535".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_given_by_numbers() {
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
}
