//! Parsers of option values, with their permitted ranges.

use std::ops::RangeInclusive;

use lodsmith::Length;
use lodsmith::options::by_name::length_of_text;
use lodsmith_bake::BakeOptions;

use crate::constraints::Importance;

/// Smallest memory limit in bytes: the program and its threads need up to half of it without any model.
pub const MIN_MEMORY: u64 = 32 << 20;

/// Default fraction of the triangles of the previous level that each level keeps.
pub const LEVEL_FACTOR: f64 = 0.5;

/// Parses a length: a number in the units of the file, or a share of the diagonal in per cent.
pub fn length(text: &str) -> Result<Length, String> {
    length_of_text(text).ok_or_else(|| {
        "a length is a number in the units of the file, or a share of the diagonal such as 0.1%".to_owned()
    })
}

/// Parses a length that is not zero.
pub fn some_length(text: &str) -> Result<Length, String> {
    match length(text)? {
        Length::Units(0.0) | Length::OfDiagonal(0.0) => Err("it must be above 0".to_owned()),
        length => Ok(length),
    }
}

/// Parses a fraction, as `0.1` or as `10%`: above 0, up to 1.
pub fn ratio(text: &str) -> Result<f64, String> {
    fraction(text, |x| x > 0.0 && x <= 1.0, "it must be above 0 and at most 1 (100%)")
}

/// Parses a finite number above 0.
pub fn above_zero(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "it must be above 0")
}

/// Parses a fraction, as `0.1` or as `10%`: above 0 and below 1.
pub fn below_one(text: &str) -> Result<f64, String> {
    fraction(text, |x| x > 0.0 && x < 1.0, "it must be above 0 and below 1 (100%)")
}

/// Parses a field of view: above 0 and below 180 degrees.
pub fn view_deg(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0 && x < 180.0, "it must be above 0 and below 180 degrees")
}

/// Parses a time in seconds; longer than a year counts as a year.
pub fn seconds(text: &str) -> Result<f64, String> {
    above_zero(text).map(|s| s.min(365.0 * 86400.0))
}

/// Parses a number of bytes: `2G`, `1.5GiB`, `512M`, `536870912`. Units are powers of 1024.
pub fn memory(text: &str) -> Result<u64, String> {
    let expected =
        || "a size is a number of bytes, or a number with K, M, G or T, such as 512M or 2G".to_owned();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let power = match unit.trim_start().to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kb" | "ki" | "kib" => 1,
        "m" | "mb" | "mi" | "mib" => 2,
        "g" | "gb" | "gi" | "gib" => 3,
        "t" | "tb" | "ti" | "tib" => 4,
        _ => return Err(expected()),
    };
    let bytes = number.parse::<f64>().map_err(|_| expected())? * 1024f64.powi(power);
    let least = MIN_MEMORY;
    if bytes < least as f64 { Err(format!("it must be at least {}M", least >> 20)) } else { Ok(bytes as u64) }
}

/// Parses a count of at least one.
pub fn count(text: &str) -> Result<usize, String> {
    at_least(text, 1)
}

/// Parses a number of threads.
pub fn threads(text: &str) -> Result<usize, String> {
    within(text, 1..=usize::from(u16::MAX))
}

/// Parses the width and height of baked maps, in texels.
pub fn texture_size(text: &str) -> Result<usize, String> {
    within(text, BakeOptions::SIZES)
}

/// Parses a number of rays per texel.
pub fn rays(text: &str) -> Result<usize, String> {
    within(text, BakeOptions::RAYS)
}

/// Parses an attribute of importance and its strength.
pub fn importance(text: &str) -> Result<Importance, String> {
    let (name, strength) = match text.rsplit_once('=') {
        None => (text, Importance::DEFAULT_STRENGTH),
        Some((name, given)) => {
            let expected = "the strength must be from 0.001 to 1000";
            (
                name,
                number(given, |x| (1e-3..=1e3).contains(&x), expected).map_err(|_| expected.to_owned())?
                    as f32,
            )
        }
    };
    if name.is_empty() {
        return Err("the name of an attribute is missing".to_owned());
    }
    Ok(Importance { name: name.to_owned(), strength })
}

/// Parses a finite number in a range that `expected` describes.
pub fn number(text: &str, is_good: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Err(_) => Err("it is not a number".to_owned()),
        Ok(x) if x.is_finite() && is_good(x) => Ok(x),
        Ok(_) => Err(expected.to_owned()),
    }
}

fn fraction(text: &str, is_good: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.strip_suffix('%') {
        Some(percent) => number(percent.trim_end(), |x| is_good(x / 100.0), expected).map(|x| x / 100.0),
        None => number(text, is_good, expected),
    }
}

/// Parses a whole number of at least `least`.
pub fn at_least(text: &str, least: usize) -> Result<usize, String> {
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
        assert_eq!(length("0.5"), Ok(Length::Units(0.5)));
        assert_eq!(length("25%"), Ok(Length::OfDiagonal(0.25)));
        for bad in ["", "%", "x", "-1", "nan", "inf", "1%%"] {
            assert!(length(bad).is_err(), "{bad}");
        }
        assert!(some_length("0%").is_err());
    }

    #[test]
    fn importance_has_a_strength() {
        let of = |name: &str, strength| Ok(Importance { name: name.to_owned(), strength });
        assert_eq!(importance("quality"), of("quality", Importance::DEFAULT_STRENGTH));
        assert_eq!(importance("color.r=9.5"), of("color.r", 9.5));
        for bad in ["", "=2", "a=", "a=b", "a=0", "a=-1", "a=nan", "a=1e9"] {
            assert!(importance(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn memory_is_in_bytes_or_in_units() {
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
    fn ranges_are_enforced() {
        assert!(ratio("1").is_ok() && ratio("0").is_err() && ratio("1.1").is_err() && ratio("nan").is_err());
        assert!(count("1").is_ok() && count("0").is_err() && count("-1").is_err() && count("1.5").is_err());
        assert!(view_deg("180").is_err());
        assert!(above_zero("inf").is_err() && seconds("1e300").is_ok());
    }
}
