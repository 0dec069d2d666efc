//! An entry of the table of options.

use super::value::OptionValue;
use crate::options::SimplifyOptions;

/// One option of simplification.
#[derive(Clone, Copy, Debug)]
pub struct NamedOption {
    /// Name as on the command line, without the leading dashes: `max-normal`.
    pub name: &'static str,
    /// The values that it takes.
    pub kind: OptionKind,
    /// One sentence on the effect.
    pub help: &'static str,
    pub(super) default: fn(&SimplifyOptions) -> Option<String>,
    pub(super) set: fn(&mut SimplifyOptions, &OptionValue<'_>) -> Result<(), String>,
}

/// The values that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionKind {
    /// A whole number, 1 or more unless the engine asks for more.
    Count,
    /// A fraction above 0 and up to 1, or a text such as `10%`.
    Ratio,
    /// A length in the units of the mesh, or a text such as `0.1%` for a share of the diagonal.
    Length,
    /// An angle in degrees.
    Degrees,
    /// One of these words.
    Word(&'static [&'static str]),
    /// On or off.
    Flag,
    /// A number.
    Number,
    /// Factors by name of attribute.
    Weights,
    /// A whole number, 0 or more.
    Seed,
}

impl NamedOption {
    /// Returns the default as text, as on the command line; `None` if the option is off by default.
    pub fn default_text(&self) -> Option<String> {
        (self.default)(&SimplifyOptions::default())
    }
}
