//! Entries of the table of options.

use super::error::OptionError;
use super::value::{LengthRange, OptionValue};
use crate::SimplifyError;
use crate::options::{MethodKind, Preset, SimplifyOptions, Stop};

/// An option of simplification: its name, the values that it takes, and functions that read and set it.
#[derive(Clone, Copy, Debug)]
pub struct NamedOption {
    /// Name on the command line, words joined by dashes: `max-normal`.
    pub name: &'static str,
    /// The values that it takes.
    pub kind: OptionKind,
    /// Section in lists of options, such as the help of the command.
    pub group: OptionGroup,
    /// Placeholder of the value in help texts, in capitals; empty for flags.
    pub value_name: &'static str,
    /// Help text: one sentence in the imperative, without a full stop.
    pub help: &'static str,
    /// The methods that have the option; empty for options that most methods share.
    pub methods: &'static [MethodKind],
    pub(super) get: Get,
    pub(super) set: Set,
}

pub(super) type Get = fn(&SimplifyOptions) -> Option<OptionValue<'static>>;
/// Sets a value of the kind, for a method that has the option, or returns the option that excludes it.
pub(super) type Set = fn(&mut SimplifyOptions, &OptionValue<'_>) -> Result<(), &'static str>;

/// Section in lists of options, such as the help of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OptionGroup {
    /// Targets, which end a run.
    Target,
    /// Options of most methods.
    Simplification,
    /// Options of single methods.
    OfMethod,
    /// Limits on the shape of the result.
    Guards,
    /// Measurement and proof of the deviation.
    Deviation,
}

/// The values that an option takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OptionKind {
    /// A whole number of at least this.
    Count(u64),
    /// A fraction above 0 and up to 1, or a text such as `10%`.
    Ratio,
    /// A length in the units of the mesh, or a text such as `0.1%` for a fraction of the diagonal.
    Length(LengthRange),
    /// An angle in degrees.
    Degrees(Range),
    /// A number.
    Number(Range),
    /// One of these words.
    Word(&'static [&'static str]),
    /// On or off.
    Flag,
    /// Factors of 0 or more, by the name of an attribute: one of these.
    Weights(&'static [&'static str]),
    /// A whole number, 0 or more.
    Seed,
}

/// A range of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest number.
    pub least: f64,
    /// Largest number.
    pub most: f64,
    /// True if the smallest number is in the range.
    pub has_least: bool,
    /// True if the largest number is in the range.
    pub has_most: bool,
    /// The range in words: "above 0 and at most 180 degrees".
    pub text: &'static str,
}

impl Range {
    /// True if a number is in the range.
    pub fn contains(&self, x: f64) -> bool {
        (x > self.least || self.has_least && x == self.least)
            && (x < self.most || self.has_most && x == self.most)
    }
}

impl OptionKind {
    /// Returns the name of the kind, for generated code in other languages.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Count(_) => "count",
            Self::Ratio => "ratio",
            Self::Length(_) => "length",
            Self::Degrees(_) => "degrees",
            Self::Number(_) => "number",
            Self::Word(_) => "word",
            Self::Flag => "flag",
            Self::Weights(_) => "weights",
            Self::Seed => "seed",
        }
    }

    /// Returns the permitted words; empty for other kinds.
    pub const fn words(&self) -> &'static [&'static str] {
        match self {
            Self::Word(words) => words,
            _ => &[],
        }
    }
}

impl OptionKind {
    /// Returns a description of the permitted values: "a whole number of at least 3".
    pub fn expected(&self) -> String {
        match self {
            Self::Count(least) => format!("a whole number of at least {least}"),
            Self::Seed => "a whole number of at least 0".to_owned(),
            Self::Ratio => "a fraction above 0 and up to 1 (100%)".to_owned(),
            Self::Length(range) => format!(
                "a length {} in the units of the mesh, or a share of the diagonal such as 0.1%,",
                if *range == LengthRange::Positive { "above 0" } else { "of 0 or more" }
            ),
            Self::Degrees(range) | Self::Number(range) => format!("a number {}", range.text),
            Self::Word(words) => format!("one of {}", words.join(", ")),
            Self::Flag => "true or false".to_owned(),
            Self::Weights(names) => {
                format!("a factor of 0 or more for each name, as in name=2 (names are {}),", names.join(", "))
            }
        }
    }

    /// Converts a value to the type of its kind: numbers and lengths are parsed from text.
    ///
    /// # Errors
    /// A text with the permitted values and the given value, if it is of another kind or out of range.
    pub fn parse(&self, value: &OptionValue<'_>) -> Result<OptionValue<'static>, String> {
        let parsed = match self {
            Self::Count(least) => value.whole().filter(|n| n >= least).map(OptionValue::Whole),
            Self::Seed => value.whole().map(OptionValue::Whole),
            Self::Ratio => value.ratio().filter(|x| *x > 0.0 && *x <= 1.0).map(OptionValue::Number),
            Self::Length(range) => value.length().filter(|l| range.contains(*l)).map(OptionValue::Length),
            Self::Degrees(range) | Self::Number(range) => {
                value.number().filter(|x| range.contains(*x)).map(OptionValue::Number)
            }
            Self::Word(words) => value.word(words, |word| word).map(|word| OptionValue::Text(word.into())),
            Self::Flag => value.flag().map(OptionValue::Flag),
            Self::Weights(names) => {
                let one = |(name, x): (&str, f64)| {
                    let known = names.iter().find(|known| **known == name)?;
                    (x.is_finite() && x >= 0.0).then_some(((*known).into(), x))
                };
                value.weights().and_then(|all| all.into_iter().map(one).collect()).map(OptionValue::Weights)
            }
        };
        parsed.ok_or_else(|| format!("{} is expected, not {value}", self.expected()))
    }
}

impl NamedOption {
    /// Returns the value in `options`; `None` if the option is off.
    pub fn get(&self, options: &SimplifyOptions) -> Option<OptionValue<'static>> {
        (self.get)(options)
    }

    /// Sets a value. Setting `method` or `preset` resets the options that depend on it.
    ///
    /// # Errors
    /// [`OptionError::Value`] for a value of another kind or out of range; [`OptionError::Combination`] if the current
    /// method does not have the option, or if another option excludes it.
    pub fn set(&self, options: &mut SimplifyOptions, value: &OptionValue<'_>) -> Result<(), OptionError> {
        let option = self.name;
        let value = self.kind.parse(value).map_err(|why| OptionError::Value { option, why })?;
        let method = options.method.kind();
        if !self.methods.is_empty() && !self.methods.contains(&method) {
            let is_off = value == OptionValue::Flag(false);
            return if is_off {
                Ok(())
            } else {
                Err(OptionError::Combination(SimplifyError::NotOfMethod {
                    option,
                    takers: self.methods,
                    method,
                }))
            };
        }
        let together = |first| SimplifyError::NotTogether { first, second: option };
        (self.set)(options, &value).map_err(|first| OptionError::Combination(together(first)))
    }

    /// Returns the default as text, as on the command line; `None` if the option is off by default.
    pub fn default_text(&self) -> Option<String> {
        match self.kind {
            OptionKind::Flag | OptionKind::Weights(_) => None,
            _ => self.get(&SimplifyOptions::default()).map(|value| value.text()),
        }
    }

    /// True if a preset sets it to something else than the default.
    pub fn is_of_presets(&self) -> bool {
        let of = |preset| self.get(&SimplifyOptions::preset(preset, Stop::default()));
        let default = self.get(&SimplifyOptions::default());
        Preset::ALL.into_iter().any(|preset| of(preset) != default)
    }
}
