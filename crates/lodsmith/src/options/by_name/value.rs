//! Values of options, as text and as numbers.

use std::borrow::Cow;
use std::fmt;

use crate::options::Length;

/// A value of an option, as given by a caller or as read from options.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum OptionValue<'a> {
    /// On or off.
    Flag(bool),
    /// A whole number.
    Whole(u64),
    /// A number.
    Number(f64),
    /// A length.
    Length(Length),
    /// A word, or a number as text.
    Text(Cow<'a, str>),
    /// Factors by name.
    Weights(Vec<(Cow<'a, str>, f64)>),
}

impl<'a> From<&'a str> for OptionValue<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(Cow::Borrowed(text))
    }
}

impl fmt::Display for OptionValue<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(x) => write!(f, "{x}"),
            Self::Whole(x) => write!(f, "{x}"),
            Self::Number(x) => write!(f, "{x}"),
            Self::Length(x) => f.write_str(&length_text(*x)),
            Self::Text(x) => write!(f, "{x:?}"),
            Self::Weights(all) => f.debug_map().entries(all.iter().map(|(name, w)| (name, w))).finish(),
        }
    }
}

/// Formats a length as on the command line: `0.5` in units, `0.1%` of the diagonal.
pub fn length_text(length: Length) -> String {
    match length {
        Length::Units(x) => x.to_string(),
        // Percentages such as 0.07 % are formatted as they were typed; for some fractions, such as 0.0007, no
        // percentage is bit-exact.
        Length::OfDiagonal(x) => {
            let percent = 100.0 * x;
            let short = format!("{percent:.12}");
            let short = short.trim_end_matches('0').trim_end_matches('.');
            match short.parse::<f64>() {
                Ok(back) if (back / 100.0 - x).abs() <= f64::EPSILON * x => format!("{short}%"),
                _ => format!("{percent}%"),
            }
        }
    }
}

/// The lengths that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthRange {
    /// Above 0.
    Positive,
    /// 0 or more.
    FromZero,
    /// Above 0; or 0, which turns the option off, even if a preset sets it.
    ZeroIsOff,
}

impl LengthRange {
    /// True if a length is in the range.
    pub fn contains(self, length: Length) -> bool {
        let (Length::Units(x) | Length::OfDiagonal(x)) = length;
        x.is_finite() && (x > 0.0 || x == 0.0 && self != Self::Positive)
    }
}

/// Parses a length as on the command line; `None` if it is not a finite length of 0 or more.
pub fn length_of_text(text: &str) -> Option<Length> {
    OptionValue::from(text).length().filter(|length| LengthRange::FromZero.contains(*length))
}

impl OptionValue<'_> {
    /// Returns the value as on the command line; for weights, `name=factor` joined by commas.
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone().into_owned(),
            Self::Weights(all) => {
                all.iter().map(|(name, factor)| format!("{name}={factor}")).collect::<Vec<_>>().join(",")
            }
            other => other.to_string(),
        }
    }

    /// Returns the value as a finite number.
    pub(super) fn number(&self) -> Option<f64> {
        let number = match self {
            Self::Whole(x) => Some(*x as f64),
            Self::Number(x) => Some(*x),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        };
        number.filter(|x| x.is_finite())
    }

    /// Returns the value as a whole number.
    pub(super) fn whole(&self) -> Option<u64> {
        match self {
            Self::Whole(x) => Some(*x),
            // Up to 2^53 every whole number is a double.
            Self::Number(x) if x.fract() == 0.0 && (0.0..9e15).contains(x) => Some(*x as u64),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// Returns the value as a count of elements.
    pub(super) fn count(&self) -> Option<usize> {
        self.whole().map(|x| usize::try_from(x).unwrap_or(usize::MAX))
    }

    /// Returns the value as a fraction; a text may be in per cent.
    pub(super) fn ratio(&self) -> Option<f64> {
        match self {
            Self::Text(text) => match text.trim().strip_suffix('%') {
                Some(percent) => percent.trim_end().parse().ok().map(|x: f64| x / 100.0),
                None => self.number(),
            },
            _ => self.number(),
        }
    }

    /// Returns the value as a length; a text may be a fraction of the diagonal in per cent.
    pub(super) fn length(&self) -> Option<Length> {
        match self {
            Self::Length(length) => Some(*length),
            Self::Text(text) => match text.trim().strip_suffix('%') {
                Some(percent) => percent.trim_end().parse().ok().map(|x: f64| Length::OfDiagonal(x / 100.0)),
                None => self.number().map(Length::Units),
            },
            _ => self.number().map(Length::Units),
        }
    }

    /// Returns the value as a length; `None` if it is 0.
    pub(super) fn length_or_off(&self) -> Option<Length> {
        self.length().filter(|l| !matches!(l, Length::Units(0.0) | Length::OfDiagonal(0.0)))
    }

    /// Returns the value as a flag.
    pub(super) fn flag(&self) -> Option<bool> {
        match self {
            Self::Flag(x) => Some(*x),
            Self::Text(text) => text.parse().ok(),
            _ => None,
        }
    }

    /// True for a flag that is on.
    pub(super) fn is_on(&self) -> bool {
        self.flag() == Some(true)
    }

    /// Returns the value with this name.
    pub(super) fn word<T: Copy>(&self, all: &[T], name: fn(T) -> &'static str) -> Option<T> {
        match self {
            Self::Text(text) => all.iter().copied().find(|x| name(*x) == *text),
            _ => None,
        }
    }

    /// Returns the factors by name; a text is `name=factor`, joined by commas.
    pub(super) fn weights(&self) -> Option<Vec<(&str, f64)>> {
        let factor = |pair: &'_ str| -> Option<(usize, f64)> {
            let (name, x) = pair.split_once('=')?;
            Some((name.len(), x.trim().parse().ok()?))
        };
        match self {
            Self::Weights(all) => Some(all.iter().map(|(name, x)| (&**name, *x)).collect()),
            Self::Text(text) => {
                text.split(',').map(|pair| factor(pair).map(|(end, x)| (pair[..end].trim(), x))).collect()
            }
            _ => None,
        }
    }
}
