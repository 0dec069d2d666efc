//! Values of options as bindings have them, and their conversion.

use std::fmt;

use crate::options::Length;

/// A value as a caller gave it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum OptionValue<'a> {
    /// On or off.
    Flag(bool),
    /// A whole number.
    Whole(u64),
    /// A number.
    Number(f64),
    /// A word, or a number as text.
    Text(&'a str),
    /// Factors by name.
    Weights(Vec<(&'a str, f64)>),
}

impl fmt::Display for OptionValue<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(x) => write!(f, "{x}"),
            Self::Whole(x) => write!(f, "{x}"),
            Self::Number(x) => write!(f, "{x}"),
            Self::Text(x) => write!(f, "{x:?}"),
            Self::Weights(all) => f.debug_map().entries(all.iter().map(|(name, w)| (name, w))).finish(),
        }
    }
}

impl OptionValue<'_> {
    fn rejected<T>(&self, wanted: impl fmt::Display) -> Result<T, String> {
        Err(format!("{wanted} is expected, not {self}"))
    }

    /// Returns the finite number of a value, whatever its range.
    pub(super) fn number(&self) -> Result<f64, String> {
        let number = match self {
            Self::Whole(x) => Some(*x as f64),
            Self::Number(x) => Some(*x),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        };
        number.filter(|x| x.is_finite()).map_or_else(|| self.rejected("a number"), Ok)
    }

    /// Returns a whole number of at least `least`.
    pub(super) fn whole(&self, least: u64) -> Result<u64, String> {
        let whole = match self {
            Self::Whole(x) => Some(*x),
            // Up to 2^53 every whole number is a double.
            Self::Number(x) if x.fract() == 0.0 && (0.0..9e15).contains(x) => Some(*x as u64),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        };
        let wanted = format_args!("a whole number of at least {least}");
        whole.filter(|x| *x >= least).map_or_else(|| self.rejected(wanted), Ok)
    }

    /// Returns a number of elements, at least `least`.
    pub(super) fn count(&self, least: u64) -> Result<usize, String> {
        self.whole(least).map(|x| usize::try_from(x).unwrap_or(usize::MAX))
    }

    /// Returns a fraction; a text may be in per cent.
    pub(super) fn ratio(&self) -> Result<f64, String> {
        let ratio = match self {
            Self::Text(text) => match text.trim().strip_suffix('%') {
                Some(percent) => percent.trim_end().parse().ok().map(|x: f64| x / 100.0),
                None => text.trim().parse().ok(),
            },
            _ => self.number().ok(),
        };
        let wanted = "a fraction above 0 and up to 1 (100%)";
        ratio.filter(|x| *x > 0.0 && *x <= 1.0).map_or_else(|| self.rejected(wanted), Ok)
    }

    /// Returns a length of 0 or more; a text may be a share of the diagonal in per cent.
    pub(super) fn length(&self) -> Result<Length, String> {
        let share = match self {
            Self::Text(text) => text.trim().strip_suffix('%'),
            _ => None,
        };
        let number = match share {
            Some(percent) => percent.trim_end().parse().ok(),
            None => self.number().ok(),
        };
        match number.filter(|x: &f64| x.is_finite() && *x >= 0.0) {
            Some(x) if share.is_some() => Ok(Length::OfDiagonal(x / 100.0)),
            Some(x) => Ok(Length::Units(x)),
            None => self.rejected(
                "a length of 0 or more in the units of the mesh, or a share of the diagonal such as \"0.1%\",",
            ),
        }
    }

    /// Returns true or false.
    pub(super) fn flag(&self) -> Result<bool, String> {
        match self {
            Self::Flag(x) => Ok(*x),
            Self::Text("true") => Ok(true),
            Self::Text("false") => Ok(false),
            _ => self.rejected("true or false"),
        }
    }

    /// Returns the value with this name.
    pub(super) fn word<T: Copy>(&self, all: &[T], name: fn(T) -> &'static str) -> Result<T, String> {
        let found = match self {
            Self::Text(text) => all.iter().find(|x| name(**x) == *text),
            _ => None,
        };
        let names = || all.iter().map(|x| name(*x)).collect::<Vec<_>>().join(", ");
        found.copied().map_or_else(|| self.rejected(format!("one of {}", names())), Ok)
    }

    /// Returns the factors by name.
    pub(super) fn weights(&self) -> Result<Vec<(&str, f64)>, String> {
        match self {
            Self::Weights(all) => Ok(all.clone()),
            _ => self.rejected("a factor for each name of attribute"),
        }
    }
}
