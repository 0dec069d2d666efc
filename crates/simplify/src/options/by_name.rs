//! The options by their names on the command line, for bindings: name, kind, default and setter of each.
//!
//! ```
//! use lodsmith::options::by_name::{OptionValue, from_names};
//!
//! let options = from_names(&[("ratio", OptionValue::Text("10%")), ("max_normal", OptionValue::Number(30.0))])?;
//! assert_eq!(options.stop.ratio, Some(0.1));
//! let misspelt = from_names(&[("rato", OptionValue::Number(0.1))]);
//! assert_eq!(misspelt.unwrap_err().to_string(), "there is no option rato; a similar one is ratio");
//! # Ok::<(), lodsmith::options::by_name::OptionError>(())
//! ```

use super::SimplifyOptions;

mod entry;
mod table;
mod value;

pub use entry::{NamedOption, OptionKind};
pub use table::OPTIONS;
pub use value::OptionValue;

/// Reason why an option was rejected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// There is no such option.
    #[error("there is no option {name}{}", similar(.nearest))]
    Unknown {
        /// The name given.
        name: String,
        /// The most similar name of an option, if any is similar.
        nearest: Option<&'static str>,
    },
    /// The value does not suit the option.
    #[error("{option}: {why}")]
    Value {
        /// Name of the option.
        option: &'static str,
        /// The values that it takes, and the one given.
        why: String,
    },
}

fn similar(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; a similar one is {}", name.replace('-', "_")))
}

/// Returns the option with this name; underscores count as dashes.
pub fn find(name: &str) -> Option<&'static NamedOption> {
    let is_same = |known: &str| {
        known.len() == name.len()
            && known.bytes().zip(name.bytes()).all(|(a, b)| a == b || a == b'-' && b == b'_')
    };
    OPTIONS.iter().find(|o| is_same(o.name))
}

/// Returns options with these values. The preset is applied first, wherever it is in the list.
///
/// Ranges of numbers are checked by the run, as for all options.
///
/// # Errors
/// [`OptionError`] for a name that is not an option, or a value that is not of its kind.
pub fn from_names(given: &[(&str, OptionValue<'_>)]) -> Result<SimplifyOptions, OptionError> {
    let mut options = SimplifyOptions::default();
    let is_preset = |name: &str| name == "preset";
    let presets = given.iter().filter(|(name, _)| is_preset(name));
    for (name, value) in presets.chain(given.iter().filter(|(name, _)| !is_preset(name))) {
        let Some(option) = find(name) else {
            let nearest = nearest(name, OPTIONS.iter().map(|o| o.name));
            return Err(OptionError::Unknown { name: (*name).to_owned(), nearest });
        };
        (option.set)(&mut options, value).map_err(|why| OptionError::Value { option: option.name, why })?;
    }
    Ok(options)
}

/// Returns the name that is most similar to a misspelt one, if any is.
pub fn nearest<'n>(misspelt: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let wanted = misspelt.to_ascii_lowercase().replace('_', "-");
    let rated = names.into_iter().map(|name| (edits(&wanted, &name.replace('_', "-")), name));
    // More than a third of the letters changed is another word. (Guessed.)
    let most = wanted.chars().count().div_ceil(3);
    rated.filter(|(edits, _)| *edits <= most).min_by_key(|(edits, _)| *edits).map(|(_, name)| name)
}

/// Returns the number of letters to insert, delete or replace to turn one word into the other.
fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{BorderPolicy, Preset, Stop};

    #[test]
    fn every_default_is_accepted_and_changes_nothing() {
        for option in OPTIONS {
            let Some(text) = option.default_text() else { continue };
            let options = from_names(&[(option.name, OptionValue::Text(&text))]).expect("a default");
            assert_eq!(options, SimplifyOptions::default(), "{}", option.name);
        }
    }

    #[test]
    fn every_option_has_an_effect() {
        for option in OPTIONS {
            let value = match option.kind {
                OptionKind::Count | OptionKind::Seed => OptionValue::Whole(7),
                OptionKind::Ratio | OptionKind::Length | OptionKind::Degrees | OptionKind::Number => {
                    OptionValue::Number(0.5)
                }
                OptionKind::Word(words) => OptionValue::Text(words[words.len() - 1]),
                OptionKind::Flag => OptionValue::Flag(true),
                OptionKind::Weights => OptionValue::Weights(vec![("uv", 2.0)]),
            };
            let options = from_names(&[(option.name, value)]).expect("a value of the kind");
            assert_ne!(options, SimplifyOptions::default(), "{}", option.name);
        }
    }

    #[test]
    fn a_preset_comes_first() {
        let words = [("border", OptionValue::Text("keep")), ("preset", OptionValue::Text("cad"))];
        let options = from_names(&words).expect("two words");
        let mut wanted = SimplifyOptions::preset(Preset::Cad, Stop::default());
        wanted.border = BorderPolicy::Keep;
        assert_eq!(options, wanted);
    }

    #[test]
    fn wrong_names_and_values_are_named() {
        let error = |name, value| from_names(&[(name, value)]).expect_err("wrong").to_string();
        assert_eq!(
            error("max_norml", OptionValue::Number(3.0)),
            "there is no option max_norml; a similar one is max_normal"
        );
        assert_eq!(error("zzz", OptionValue::Number(3.0)), "there is no option zzz");
        for (name, value) in [
            ("faces", OptionValue::Number(0.5)),
            ("faces", OptionValue::Whole(0)),
            ("faces", OptionValue::Flag(true)),
            ("ratio", OptionValue::Text("ten")),
            ("error", OptionValue::Number(-1.0)),
            ("error", OptionValue::Text("1%%")),
            ("method", OptionValue::Text("memory")),
            ("method", OptionValue::Number(1.0)),
            ("escalate", OptionValue::Text("maybe")),
            ("weight", OptionValue::Weights(vec![("uvs", 1.0)])),
            ("weight", OptionValue::Weights(vec![("uv", f64::NAN)])),
            ("sharp", OptionValue::Number(f64::INFINITY)),
            ("seed", OptionValue::Number(-1.0)),
        ] {
            let text = error(name, value);
            assert!(text.starts_with(&format!("{name}: ")), "{text}");
        }
    }
}
