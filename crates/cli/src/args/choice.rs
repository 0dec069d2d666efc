//! Parsers of option values whose names the libraries define.

use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Returns a parser of the names of these values.
pub(super) fn choice<T: Copy + Send + Sync + 'static, const N: usize>(
    values: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(values.map(name)).map(move |given| {
        let found = values.into_iter().find(|value| name(*value) == given);
        found.expect("only names of the values are possible")
    })
}
