//! Options by their names on the command line.
//!
//! The command, the viewer and the bindings use one table for names, kinds, ranges, help texts and defaults, and to
//! read and set values.
//!
//! ```
//! use lodsmith::options::by_name::{OptionValue, find, from_names};
//!
//! let options = from_names(&[("ratio", "10%".into()), ("max_normal", OptionValue::Number(30.0))])?;
//! assert_eq!(options.stop.ratio, Some(0.1));
//! let ratio = find("ratio").and_then(|option| option.get(&options));
//! assert_eq!(ratio, Some(OptionValue::Number(0.1)));
//! let misspelt = from_names(&[("rato", OptionValue::Number(0.1))]);
//! assert_eq!(misspelt.unwrap_err().to_string(), "there is no option rato; a similar one is ratio");
//! # Ok::<(), lodsmith::options::by_name::OptionError>(())
//! ```

use super::SimplifyOptions;

mod entry;
mod error;
mod table;
mod value;

pub use entry::{NamedOption, OptionGroup, OptionKind, Range};
pub use error::OptionError;
pub use table::OPTIONS;
pub use value::{LengthRange, OptionValue, length_of_text, length_text};

/// Returns the option with this name; underscores count as dashes.
pub fn find(name: &str) -> Option<&'static NamedOption> {
    let is_same = |known: &str| {
        known.len() == name.len()
            && known.bytes().zip(name.bytes()).all(|(a, b)| a == b || a == b'-' && b == b'_')
    };
    OPTIONS.iter().find(|o| is_same(o.name))
}

fn known(name: &str) -> Result<&'static NamedOption, OptionError> {
    let nearest = || nearest(name, OPTIONS.iter().map(|o| o.name));
    find(name).ok_or_else(|| OptionError::Unknown { name: name.to_owned(), nearest: nearest() })
}

/// Sets an option by name, as [`NamedOption::set`] does.
///
/// # Errors
/// [`OptionError::Unknown`] for a name that is not an option; those of [`NamedOption::set`].
pub fn set(options: &mut SimplifyOptions, name: &str, value: &OptionValue<'_>) -> Result<(), OptionError> {
    known(name)?.set(options, value)
}

/// Returns options with these values. The preset is applied first and the method second, whatever their positions in
/// the list.
///
/// # Errors
/// [`OptionError`] for an unknown name, a value of another kind or out of range, an option that the method does not
/// have, or two options that exclude each other.
pub fn from_names(given: &[(&str, OptionValue<'_>)]) -> Result<SimplifyOptions, OptionError> {
    let mut all = Vec::with_capacity(given.len());
    for (name, value) in given {
        all.push((known(name)?, value));
    }
    all.sort_by_key(|(option, _)| match option.name {
        "preset" => 0,
        "method" => 1,
        _ => 2,
    });
    let mut options = SimplifyOptions::default();
    for (option, value) in all {
        option.set(&mut options, value)?;
    }
    Ok(options)
}

/// Returns the options that differ between `options` and `others`, with their values in `options` (`None` if they are
/// off there), except the preset.
pub fn differences<'o>(
    options: &'o SimplifyOptions,
    others: &'o SimplifyOptions,
) -> impl Iterator<Item = (&'static NamedOption, Option<OptionValue<'static>>)> + 'o {
    let differs =
        |option: &&NamedOption| option.name != "preset" && option.get(options) != option.get(others);
    OPTIONS.iter().filter(differs).map(|option| (option, option.get(options)))
}

/// Sets the default of an option, or turns it off if it is off by default; all others stay. `preset` and `method` stay
/// too.
pub fn reset(option: &NamedOption, options: &mut SimplifyOptions) {
    let base = SimplifyOptions {
        method: options.method.kind().into(),
        shape_normals: options.shape_normals,
        ..SimplifyOptions::default()
    };
    let mut new = base.clone();
    for (other, value) in differences(options, &base).filter(|(other, _)| other.name != option.name) {
        // Values that options have together do not exclude each other.
        let _ = (other.set)(&mut new, &value.unwrap_or(OptionValue::Flag(false)));
    }
    *options = new;
}

/// Returns the name that is most similar to a misspelt name; `None` if no name is similar.
pub fn nearest<'n>(misspelt: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let misspelt = misspelt.to_ascii_lowercase().replace('_', "-");
    let rated = names.into_iter().map(|name| (edits(&misspelt, &name.replace('_', "-")), name));
    // If more than a third of the letters differ, it is another word. (Guessed.)
    let max_edits = misspelt.chars().count().div_ceil(3);
    rated.filter(|(edits, _)| *edits <= max_edits).min_by_key(|(edits, _)| *edits).map(|(_, name)| name)
}

/// Returns the edit distance: the number of letters to insert, delete or replace to turn one word into the other.
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
    use crate::SimplifyError;
    use crate::options::{BorderPolicy, Method, MethodKind, Preset, Stop};

    /// Returns options with a value of one option other than the default, and with a method that has the option.
    fn changed(option: &NamedOption) -> SimplifyOptions {
        let value = match option.kind {
            OptionKind::Count(_) | OptionKind::Seed => OptionValue::Whole(7),
            OptionKind::Ratio | OptionKind::Length(_) | OptionKind::Degrees(_) | OptionKind::Number(_) => {
                OptionValue::Number(0.5)
            }
            OptionKind::Word(words) => words[words.len() - 1].into(),
            OptionKind::Flag => OptionValue::Flag(true),
            OptionKind::Weights(names) => OptionValue::Weights(vec![(names[1].into(), 2.0)]),
        };
        let mut given = vec![(option.name, value)];
        given.extend(option.methods.first().map(|method| ("method", method.name().into())));
        from_names(&given).expect("a value of the kind")
    }

    #[test]
    fn every_default_is_accepted_and_changes_nothing() {
        for option in OPTIONS {
            let Some(text) = option.default_text() else { continue };
            let options = from_names(&[(option.name, text.as_str().into())]).expect("a default");
            assert_eq!(options, SimplifyOptions::default(), "{}", option.name);
        }
    }

    #[test]
    fn values_can_be_read_back_and_converted_to_text() {
        for option in OPTIONS {
            let options = changed(option);
            let method = option.methods.first().copied().unwrap_or_default();
            let base = SimplifyOptions { method: method.into(), ..SimplifyOptions::default() };
            assert_ne!(options, base, "{}", option.name);
            if option.name == "preset" {
                continue;
            }
            let all: Vec<_> = differences(&options, &base).map(|(option, _)| option.name).collect();
            assert_eq!(all, [option.name]);
            let text = option.get(&options).expect("it is set").text();
            let mut again = base.clone();
            option.set(&mut again, &text.as_str().into()).expect("a text of the option");
            assert_eq!(again, options, "{}: {text}", option.name);
            if option.name != "method" {
                (again.seed, again.shape_normals) = (8, true);
                reset(option, &mut again);
                let seed = if option.name == "seed" { base.seed } else { 8 };
                assert_eq!(again, SimplifyOptions { seed, shape_normals: true, ..base }, "{}", option.name);
            }
        }
    }

    #[test]
    fn options_of_single_methods_are_refused_by_the_others() {
        for option in OPTIONS {
            if option.methods.is_empty() {
                continue;
            }
            let value = option.get(&changed(option)).expect("it is set");
            for method in MethodKind::ALL {
                let got = from_names(&[(option.name, value.clone()), ("method", method.name().into())]);
                let refused = Err(OptionError::Combination(SimplifyError::NotOfMethod {
                    option: option.name,
                    takers: option.methods,
                    method,
                }));
                assert!(
                    if option.methods.contains(&method) { got.is_ok() } else { got == refused },
                    "{got:?}"
                );
            }
        }
    }

    #[test]
    fn options_of_a_remesh_exclude_each_other_in_any_order() {
        let value = |name: &str| match name {
            "adaptive" => OptionValue::Flag(true),
            _ => OptionValue::Whole(3),
        };
        for [a, b] in [
            ["voxel", "edge-length"],
            ["voxel", "subdivisions"],
            ["voxel", "adaptive"],
            ["voxel", "iterations"],
            ["voxel", "angle"],
            ["subdivisions", "adaptive"],
        ] {
            for [first, second] in [[a, b], [b, a]] {
                let given = [("method", "remesh".into()), (first, value(first)), (second, value(second))];
                assert_eq!(
                    from_names(&given),
                    Err(OptionError::Combination(SimplifyError::NotTogether {
                        first: find(first).expect("an option").name,
                        second: find(second).expect("an option").name,
                    }))
                );
            }
        }
    }

    #[test]
    fn a_preset_comes_first() {
        let given = [("border", "keep".into()), ("preset", "cad".into())];
        let options = from_names(&given).expect("valid options");
        let mut expected = SimplifyOptions::preset(Preset::Cad, Stop::default());
        expected.border = BorderPolicy::Keep;
        assert_eq!(options, expected);
        let scan =
            from_names(&[("weld", OptionValue::Whole(0)), ("preset", "scan".into())]).expect("valid options");
        assert_eq!(scan.weld, None);
        let method = from_names(&[("iterations", OptionValue::Whole(2)), ("method", "unsubdivide".into())]);
        assert_eq!(method.expect("valid options").method, Method::Unsubdivide { levels: Some(2) });
    }

    #[test]
    fn errors_name_the_wrong_option_or_value() {
        let error = |name, value| from_names(&[(name, value)]).expect_err("wrong").to_string();
        assert_eq!(
            error("max_norml", OptionValue::Number(3.0)),
            "there is no option max_norml; a similar one is max_normal"
        );
        assert_eq!(error("zzz", OptionValue::Number(3.0)), "there is no option zzz");
        assert_eq!(
            error("cell", OptionValue::Number(3.0)),
            "cell is not an option of method memoryless, but of cluster"
        );
        for (name, value) in [
            ("faces", OptionValue::Number(0.5)),
            ("faces", OptionValue::Whole(0)),
            ("faces", OptionValue::Flag(true)),
            ("ratio", "ten".into()),
            ("error", OptionValue::Number(-1.0)),
            ("error", "1%%".into()),
            ("method", "memory".into()),
            ("method", OptionValue::Number(1.0)),
            ("escalate", "maybe".into()),
            ("weight", OptionValue::Weights(vec![("uvs".into(), 1.0)])),
            ("weight", OptionValue::Weights(vec![("uv".into(), f64::NAN)])),
            ("sharp", OptionValue::Number(f64::INFINITY)),
            ("sharp", OptionValue::Number(180.0)),
            ("max_normal", OptionValue::Number(0.0)),
            ("max_edge", OptionValue::Number(0.0)),
            ("min_quality", OptionValue::Number(1.5)),
            ("max_valence", OptionValue::Whole(2)),
            ("seed", OptionValue::Number(-1.0)),
        ] {
            let text = error(name, value);
            assert!(text.starts_with(&format!("{}: ", name.replace('_', "-"))), "{text}");
        }
    }
}
