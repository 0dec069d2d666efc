//! Parsers of argument values, with their permitted ranges.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use lodsmith::Length;
use lodsmith_bake::BakeOptions;
use lodsmith_io::Format;

/// A length as typed: `0.5` in the units of the file, `0.1%` of the diagonal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TypedLength {
    /// Length for the engine.
    pub(crate) length: Length,
    typed: String,
}

impl TypedLength {
    /// Returns the value for reports: a bare number as a number, a share as it was typed.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        match self.length {
            Length::Units(x) => x.into(),
            Length::OfDiagonal(_) => self.typed.clone().into(),
        }
    }

    /// Returns true for a length of zero.
    pub(crate) fn is_zero(&self) -> bool {
        matches!(self.length, Length::Units(0.0) | Length::OfDiagonal(0.0))
    }
}

impl fmt::Display for TypedLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.typed)
    }
}

impl FromStr for TypedLength {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted =
            || "a length is a number in the units of the file, or a share of the diagonal such as 0.1%";
        let (number, is_share) = match text.strip_suffix('%') {
            Some(number) => (number.trim_end(), true),
            None => (text, false),
        };
        let x: f64 = number.parse().map_err(|_| wanted())?;
        if !x.is_finite() || x < 0.0 {
            return Err(wanted().to_owned());
        }
        let length = if is_share { Length::OfDiagonal(x / 100.0) } else { Length::Units(x) };
        Ok(Self { length, typed: text.to_owned() })
    }
}

/// Parses a length that is not zero.
pub(crate) fn some_length(text: &str) -> Result<TypedLength, String> {
    text.parse()
        .and_then(|l: TypedLength| if l.is_zero() { Err("it must be above 0".to_owned()) } else { Ok(l) })
}

/// Returns a parser of format names.
pub(crate) fn format() -> impl TypedValueParser<Value = Format> {
    PossibleValuesParser::new(Format::ALL.map(Format::name))
        .map(|name| Format::from_name(&name).expect("the words are the names of formats"))
}

/// Returns a parser of the names of formats that meshes can be written in.
pub(crate) fn written_format() -> impl TypedValueParser<Value = Format> {
    PossibleValuesParser::new(Format::WRITTEN.map(Format::name))
        .map(|name| Format::from_name(&name).expect("the words are the names of formats"))
}

/// Parses a fraction, as `0.1` or as `10%`: above 0, up to 1.
pub(crate) fn ratio(text: &str) -> Result<f64, String> {
    fraction(text, |x| x > 0.0 && x <= 1.0, "it must be above 0 and not above 1 (100%)")
}

/// Parses a finite number above 0.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "it must be above 0")
}

/// Parses a finite number that is not negative.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "it must not be below 0")
}

/// Parses a fraction, as `0.1` or as `10%`: above 0 and below 1.
pub(crate) fn below_one(text: &str) -> Result<f64, String> {
    fraction(text, |x| x > 0.0 && x < 1.0, "it must be above 0 and below 1 (100%)")
}

/// Parses a field of view: above 0 and below 180 degrees.
pub(crate) fn view_deg(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0 && x < 180.0, "it must be above 0 and below 180 degrees")
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

/// Parses a time in seconds; longer than a year counts as a year.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    above_zero(text).map(|s| s.min(365.0 * 86400.0))
}

/// Parses a number of bytes: `2G`, `1.5GiB`, `512M`, `536870912`. Units are powers of 1024.
pub(crate) fn memory(text: &str) -> Result<u64, String> {
    let wanted = || "a size is a number of bytes, or one with K, M, G or T, such as 512M or 2G".to_owned();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let power = match unit.trim_start().to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kb" | "ki" | "kib" => 1,
        "m" | "mb" | "mi" | "mib" => 2,
        "g" | "gb" | "gi" | "gib" => 3,
        "t" | "tb" | "ti" | "tib" => 4,
        _ => return Err(wanted()),
    };
    let bytes = number.parse::<f64>().map_err(|_| wanted())? * 1024f64.powi(power);
    let least = crate::memory::MIN_LIMIT;
    if bytes < least as f64 { Err(format!("it must be at least {}M", least >> 20)) } else { Ok(bytes as u64) }
}

/// Parses a count of at least one.
pub(crate) fn count(text: &str) -> Result<usize, String> {
    at_least(text, 1)
}

/// Parses the width and height of baked maps, in texels.
pub(crate) fn texture_size(text: &str) -> Result<usize, String> {
    within(text, BakeOptions::SIZES)
}

/// Parses a number of rays per texel.
pub(crate) fn rays(text: &str) -> Result<usize, String> {
    within(text, BakeOptions::RAYS)
}

/// Parses the number of frames of a turn: one is no turn, and an hour at 30 frames per second is enough.
pub(crate) fn frames(text: &str) -> Result<usize, String> {
    at_least(text, 2).and_then(|n| if n <= 108_000 { Ok(n) } else { Err("at most 108000".to_owned()) })
}

/// Parses a number of frames per second.
pub(crate) fn fps(text: &str) -> Result<u16, String> {
    at_least(text, 1).and_then(|n| u16::try_from(n).map_err(|_| "at most 65535".to_owned()))
}

pub(super) fn number(text: &str, is_good: impl Fn(f64) -> bool, wanted: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Err(_) => Err("it is not a number".to_owned()),
        Ok(x) if x.is_finite() && is_good(x) => Ok(x),
        Ok(_) => Err(wanted.to_owned()),
    }
}

fn fraction(text: &str, is_good: impl Fn(f64) -> bool, wanted: &str) -> Result<f64, String> {
    match text.strip_suffix('%') {
        Some(percent) => number(percent.trim_end(), |x| is_good(x / 100.0), wanted).map(|x| x / 100.0),
        None => number(text, is_good, wanted),
    }
}

fn at_least(text: &str, least: usize) -> Result<usize, String> {
    match text.parse::<usize>() {
        Err(_) => Err("it is not a whole number".to_owned()),
        Ok(n) if n >= least => Ok(n),
        Ok(_) => Err(format!("it must be at least {least}")),
    }
}

fn within(text: &str, range: RangeInclusive<usize>) -> Result<usize, String> {
    match text.parse::<usize>() {
        Err(_) => Err("it is not a whole number".to_owned()),
        Ok(n) if range.contains(&n) => Ok(n),
        Ok(_) => Err(format!("it must be from {} to {}", range.start(), range.end())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_units_or_a_share() {
        assert_eq!("0.5".parse::<TypedLength>().unwrap().length, Length::Units(0.5));
        assert_eq!("25%".parse::<TypedLength>().unwrap().length, Length::OfDiagonal(0.25));
        for bad in ["", "%", "x", "-1", "nan", "inf", "1%%"] {
            assert!(bad.parse::<TypedLength>().is_err(), "{bad}");
        }
        assert!(some_length("0%").is_err());
    }

    #[test]
    fn pictures_are_told_by_numbers() {
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
    fn memory_is_told_in_bytes_or_by_units() {
        for (text, bytes) in [
            ("2G", 2 << 30),
            ("2GiB", 2 << 30),
            ("2Gi", 2 << 30),
            ("2gb", 2 << 30),
            ("1.5G", 3 << 29),
            ("512M", 512 << 20),
            ("65536k", 64 << 20),
            ("1T", 1 << 40),
            ("67108864", 64 << 20),
        ] {
            assert_eq!(memory(text), Ok(bytes), "{text}");
        }
        for bad in ["", "G", "2X", "2 G B", "-2G", "1e9", "nan", "1M", "0", "2Gi2", "2gbbb", "2Gii", "2iB"] {
            assert!(memory(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn ranges_are_kept() {
        assert!(ratio("1").is_ok() && ratio("0").is_err() && ratio("1.1").is_err() && ratio("nan").is_err());
        assert!(count("1").is_ok() && count("0").is_err() && count("-1").is_err() && count("1.5").is_err());
        assert!(view_deg("180").is_err());
        assert!(above_zero("inf").is_err() && seconds("1e300").is_ok());
    }
}
