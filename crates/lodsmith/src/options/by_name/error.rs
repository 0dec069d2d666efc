//! The error for an option that was rejected.

use crate::SimplifyError;

/// Reason why an option was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// The option does not take the value.
    #[error("{option}: {why}")]
    Value {
        /// Name of the option.
        option: &'static str,
        /// The permitted values, and the given value.
        why: String,
    },
    /// The method does not have the option ([`SimplifyError::NotOfMethod`]), or another option excludes it
    /// ([`SimplifyError::NotTogether`]).
    #[error(transparent)]
    Combination(SimplifyError),
}

fn similar(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; a similar one is {}", name.replace('-', "_")))
}
