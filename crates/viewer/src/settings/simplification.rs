//! Simplification options as command-line words, for copying and for sessions.

use std::borrow::Cow;

use lodsmith::options::by_name::{self, OptionGroup, OptionKind, OptionValue};
use lodsmith::{Preset, SimplifyOptions, Stop};
use lodsmith_asset::Normals;
#[cfg(feature = "window")]
use lodsmith_asset::Recipe;
use serde::{Deserialize, Serialize};

/// Options that the method panel and the target slider set. The defaults are those of the engine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct Simplification {
    /// Preset that the options were derived from.
    pub preset: Preset,
    /// All options, including the target.
    pub options: SimplifyOptions,
    /// Normals of the result.
    pub normals: Normals,
}

impl Simplification {
    /// Returns the options of a preset, with this target.
    pub fn of_preset(preset: Preset, stop: Stop) -> Self {
        Self { preset, options: SimplifyOptions::preset(preset, stop), normals: Normals::default() }
    }

    /// Returns the recipe for a file.
    #[cfg(feature = "window")]
    pub(crate) fn recipe(&self) -> Recipe {
        Recipe { options: self.options.clone(), normals: self.normals, ..Recipe::default() }
    }

    /// Returns true if the options have a target, so that a run changes the mesh.
    pub fn has_target(&self) -> bool {
        let stop = &self.options.stop;
        stop.faces.is_some()
            || stop.vertices.is_some()
            || stop.ratio.is_some_and(|r| r < 1.0)
            || stop.error.is_some()
            || self.options.method.ends_without_stop()
    }

    /// Returns the words of `lodsmith simplify` for all options that differ from the defaults: the target, the
    /// preset, and the options that differ from the preset.
    pub fn words(&self) -> Vec<String> {
        let base = SimplifyOptions::preset(self.preset, Stop::default());
        let (targets, others): (Vec<_>, Vec<_>) = by_name::differences(&self.options, &base)
            .partition(|(option, _)| option.group == OptionGroup::Target);
        let mut words = Vec::new();
        let mut add = |name: &str, value: &str| words.extend([format!("--{name}"), value.to_owned()]);
        for (option, value) in targets {
            add(option.name, &value.map_or_else(String::new, |value| value.text()));
        }
        if self.preset != Preset::default() {
            add("preset", self.preset.name());
        }
        if self.normals != Normals::default() {
            add(NORMALS, self.normals.name());
        }
        for (option, value) in others {
            let before = option.get(&base);
            match (option.kind, value) {
                (OptionKind::Flag, _) => words.push(format!("--{}", option.name)),
                (_, Some(OptionValue::Weights(all))) => {
                    let known = |one: &(Cow<'_, str>, f64)| match &before {
                        Some(OptionValue::Weights(before)) => before.contains(one),
                        _ => false,
                    };
                    for (name, factor) in all.iter().filter(|one| !known(one)) {
                        words.extend([format!("--{}", option.name), format!("{name}={factor}")]);
                    }
                }
                (_, Some(value)) => words.extend([format!("--{}", option.name), value.text()]),
                // 0 turns off the length of a preset.
                (_, None) => words.extend([format!("--{}", option.name), "0".to_owned()]),
            }
        }
        words
    }

    /// Parses command-line words.
    ///
    /// # Errors
    /// The unknown word, or the invalid value.
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut done = Self::default();
        let mut given: Vec<(&str, OptionValue<'_>)> = Vec::new();
        let mut rest = words.iter();
        while let Some(word) = rest.next() {
            let name = word.strip_prefix("--").unwrap_or_default();
            if by_name::find(name).is_some_and(|option| option.kind == OptionKind::Flag) {
                given.push((name, OptionValue::Flag(true)));
                continue;
            }
            let value = rest.next().ok_or_else(|| format!("{word} needs a value"))?;
            if name == NORMALS {
                let known = Normals::ALL.into_iter().find(|normals| normals.name() == value);
                done.normals = known.ok_or_else(|| format!("{word}: invalid value {value}"))?;
                continue;
            }
            let option = by_name::find(name).ok_or_else(|| format!("{word}: unknown option"))?;
            if option.name == "preset" {
                let known = Preset::ALL.into_iter().find(|preset| preset.name() == value);
                done.preset = known.unwrap_or_default();
            }
            given.push((option.name, value.as_str().into()));
        }
        done.options = by_name::from_names(&given).map_err(|error| format!("--{error}"))?;
        Ok(done)
    }
}

/// Name of the option for [`Normals`], which belongs to jobs on files and is not in the table.
const NORMALS: &str = "normals";

impl From<Simplification> for Vec<String> {
    fn from(of: Simplification) -> Self {
        of.words()
    }
}

impl TryFrom<Vec<String>> for Simplification {
    type Error = String;

    fn try_from(words: Vec<String>) -> Result<Self, String> {
        Self::parse(&words)
    }
}

/// Quotes a word for a shell if needed.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=:+,%@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use lodsmith::{
        BorderPolicy, Bound, Fit, Length, Measure, Method, MethodKind, Placement, Remesh, RemeshPattern,
        TopologyPolicy,
    };

    use super::*;

    #[test]
    fn words_come_back_as_the_options_that_they_were() {
        let mut all = Simplification::of_preset(Preset::Visual, Stop::ratio(0.07));
        let o = &mut all.options;
        let length = Some(Length::OfDiagonal(0.001));
        o.method = Method::Remesh(Remesh::OnSurface {
            edge_length: length,
            crease_deg: Some(12.5),
            rounds: Some(3),
            pattern: RemeshPattern::SemiRegular { subdivisions: 4 },
        });
        (o.fit, o.placement, o.bound) = (Fit::Off, Placement::Endpoint, Bound::OneSided);
        (o.border, o.topology) = (BorderPolicy::Lock, TopologyPolicy::Free);
        (o.weights.uv, o.weights.normal, o.weights.border) = (3.5, 1.0, 0.0);
        o.sharp_deg = Some(27.5);
        (o.weld, o.prune) = (Some(Length::Units(0.25)), Some(Length::OfDiagonal(0.07)));
        let g = &mut o.guards;
        (g.max_normal_deg, g.min_quality, g.max_valence, g.max_edge) =
            (Some(30.0), Some(0.1), Some(9), length);
        (o.measure, o.escalate, o.per_mesh, o.seed) = (Measure::Always, true, true, 7);
        o.stop = Stop { faces: Some(12), vertices: Some(8), error: length, ..o.stop };
        all.normals = Normals::Recompute;
        assert_eq!(Simplification::parse(&all.words()), Ok(all));
        for preset in Preset::ALL {
            let one = Simplification::of_preset(preset, Stop::faces(9));
            assert_eq!(Simplification::parse(&one.words()), Ok(one));
        }
        for kind in MethodKind::ALL {
            let mut one = Simplification::of_preset(Preset::Auto, Stop::faces(9));
            one.options.method = kind.into();
            assert_eq!(Simplification::parse(&one.words()), Ok(one));
        }
        let mut switched_off = Simplification::of_preset(Preset::Scan, Stop::faces(9));
        switched_off.options.weld = None;
        assert_eq!(Simplification::parse(&switched_off.words()), Ok(switched_off));
        assert!(Simplification::default().words().is_empty());
    }

    #[test]
    fn unknown_words_are_named() {
        let parse = |text: &str| {
            let words: Vec<_> = text.split(' ').map(str::to_owned).collect();
            Simplification::parse(&words).unwrap_err()
        };
        assert!(parse("--colour red").contains("--colour"));
        assert!(parse("--faces many").contains("many"));
        assert!(parse("--method best").contains("best"));
        assert!(parse("--border").contains("--border"));
    }

    #[test]
    fn words_are_quoted_where_a_shell_needs_it() {
        assert_eq!(quoted("a/b.glb"), "a/b.glb");
        assert_eq!(quoted("my file"), "'my file'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
