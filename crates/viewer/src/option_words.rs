//! Simplification options as command-line words, for copying and for sessions.

use lodsmith::{
    BorderPolicy, Bound, Fit, Length, Measure, Method, Placement, Preset, SimplifyOptions, Stop,
    TopologyPolicy,
};
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

/// Normals of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// Interpolated from the input.
    #[default]
    Keep,
    /// Recomputed from the faces.
    Recompute,
    /// None.
    None,
}

impl Normals {
    /// All values, in the order of lists.
    pub const ALL: [Self; 3] = [Self::Keep, Self::Recompute, Self::None];

    /// Returns the name of the value.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Recompute => "recompute",
            Self::None => "none",
        }
    }
}

/// Returns values with their names, in the order of lists.
pub fn named<T: Copy, const N: usize>(values: [T; N], name: fn(T) -> &'static str) -> [(T, &'static str); N] {
    values.map(|value| (value, name(value)))
}

fn choice<T: Copy, const N: usize>(
    values: [T; N],
    name: fn(T) -> &'static str,
    option: &str,
    word: &str,
) -> Result<T, String> {
    let known = values.into_iter().find(|value| name(*value) == word);
    known.ok_or_else(|| format!("{option}: invalid value {word}"))
}

/// Formats a length as it is typed: `0.5` in units, `0.1%` of the diagonal.
pub fn length_text(length: Length) -> String {
    match length {
        Length::Units(x) => x.to_string(),
        // Fractions such as 0.07 % read back exactly as typed; for some, such as 0.0007, no percentage is
        // bit-exact.
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

/// Parses a typed length.
pub fn length_of(text: &str) -> Option<Length> {
    let text = text.trim();
    let (number, of): (_, fn(f64) -> Length) = match text.strip_suffix('%') {
        Some(number) => (number.trim_end(), |x| Length::OfDiagonal(x / 100.0)),
        None => (text, Length::Units),
    };
    number.parse().ok().filter(|x: &f64| x.is_finite() && *x >= 0.0).map(of)
}

impl Simplification {
    /// Returns the options of a preset, with this target.
    pub fn of_preset(preset: Preset, stop: Stop) -> Self {
        Self { preset, options: SimplifyOptions::preset(preset, stop), normals: Normals::default() }
    }

    /// Returns true if the options have a target, so that a run changes the mesh.
    pub fn has_target(&self) -> bool {
        let stop = &self.options.stop;
        stop.faces.is_some()
            || stop.vertices.is_some()
            || stop.ratio.is_some_and(|r| r < 1.0)
            || stop.error.is_some()
            || self.options.method_options.ends_without_stop(self.options.method)
    }

    /// Returns the words of `lodsmith simplify` for all options that differ from the defaults.
    pub fn words(&self) -> Vec<String> {
        let mut words = Vec::new();
        let o = &self.options;
        let base = SimplifyOptions::preset(self.preset, o.stop);
        let mut say = |option: &str, value: Option<String>| {
            if let Some(value) = value {
                words.push(option.to_owned());
                words.push(value);
            }
        };
        say("--faces", o.stop.faces.map(|n| n.to_string()));
        say("--vertices", o.stop.vertices.map(|n| n.to_string()));
        say("--ratio", o.stop.ratio.map(|r| r.to_string()));
        say("--error", o.stop.error.map(length_text));
        let differs = |is: bool, word: &str| is.then(|| word.to_owned());
        say("--preset", differs(self.preset != Preset::default(), self.preset.name()));
        say("--method", differs(o.method != base.method, o.method.name()));
        say("--fit", differs(o.fit != base.fit, o.fit.name()));
        say("--placement", differs(o.placement != base.placement, o.placement.name()));
        say("--border", differs(o.border != base.border, o.border.name()));
        say("--sharp", o.sharp_deg.map(|x| x.to_string()));
        say("--topology", differs(o.topology != base.topology, o.topology.name()));
        say("--bound", differs(o.bound != base.bound, o.bound.name()));
        let weights = |o: &SimplifyOptions| {
            let w = o.weights;
            [w.normal, w.uv, w.color, w.morph, w.skin, w.other, w.border]
        };
        for ((name, now), before) in WEIGHTS.iter().zip(weights(o)).zip(weights(&base)) {
            say("--weight", (now != before).then(|| format!("{name}={now}")));
        }
        // 0 turns off the length of the preset.
        let length = |now: Option<Length>, before: Option<Length>| {
            (now != before).then(|| now.map_or_else(|| "0".to_owned(), length_text))
        };
        say("--weld", length(o.weld, base.weld));
        say("--prune", length(o.prune, base.prune));
        let number = |x: Option<f64>| x.map(|x| x.to_string());
        let count = |n: Option<usize>| n.map(|n| n.to_string());
        let m = &o.method_options;
        say("--pairs", length(m.pairs, None));
        say("--cell", length(m.cell, None));
        say("--edge-length", length(m.edge_length, None));
        say("--angle", number(m.angle_deg));
        say("--flat", length(m.flat, None));
        say("--iterations", count(m.iterations));
        say("--voxel", length(m.voxel, None));
        say("--subdivisions", count(m.subdivisions));
        let g = &o.guards;
        say("--max-normal", number(g.max_normal_deg));
        say("--min-quality", number(g.min_quality));
        say("--max-valence", count(g.max_valence));
        say("--max-edge", length(g.max_edge, None));
        say("--normals", differs(self.normals != Normals::default(), self.normals.name()));
        say("--seed", (o.seed != base.seed).then(|| o.seed.to_string()));
        let flags = [
            (m.two_stage, "--two-stage"),
            (m.adaptive, "--adaptive"),
            (o.measure == Measure::Always, "--measure"),
            (o.escalate, "--escalate"),
            (o.per_mesh, "--per-mesh"),
        ];
        words.extend(flags.into_iter().filter(|f| f.0).map(|f| f.1.to_owned()));
        words
    }

    /// Parses command-line words.
    ///
    /// # Errors
    /// The unknown word, or the invalid value.
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut preset = Preset::default();
        let mut pairs = Vec::new();
        let mut rest = words.iter();
        while let Some(option) = rest.next() {
            if FLAGS.contains(&option.as_str()) {
                pairs.push((option.as_str(), ""));
                continue;
            }
            let value = rest.next().ok_or_else(|| format!("{option} needs a value"))?;
            if option == "--preset" {
                preset = choice(Preset::ALL, Preset::name, option, value)?;
            } else {
                pairs.push((option.as_str(), value.as_str()));
            }
        }
        let mut done = Self::of_preset(preset, Stop::default());
        for (option, value) in pairs {
            done.set(option, value)?;
        }
        Ok(done)
    }

    fn set(&mut self, option: &str, value: &str) -> Result<(), String> {
        let o = &mut self.options;
        let wrong = || format!("{option}: invalid value {value}");
        let length = || length_of(value).map(Some).ok_or_else(wrong);
        let number = || value.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(wrong);
        let count = || value.parse::<usize>().map(Some).map_err(|_| wrong());
        match option {
            "--faces" => o.stop.faces = count()?,
            "--vertices" => o.stop.vertices = count()?,
            "--ratio" => o.stop.ratio = Some(number()?),
            "--error" => o.stop.error = length()?,
            "--method" => o.method = choice(Method::ALL, Method::name, option, value)?,
            "--fit" => o.fit = choice(Fit::ALL, Fit::name, option, value)?,
            "--placement" => o.placement = choice(Placement::ALL, Placement::name, option, value)?,
            "--border" => o.border = choice(BorderPolicy::ALL, BorderPolicy::name, option, value)?,
            "--sharp" => o.sharp_deg = Some(number()?),
            "--topology" => o.topology = choice(TopologyPolicy::ALL, TopologyPolicy::name, option, value)?,
            "--bound" => o.bound = choice(Bound::ALL, Bound::name, option, value)?,
            "--weight" => {
                let (name, weight) = value.split_once('=').ok_or_else(wrong)?;
                let weight: f64 = weight.parse().map_err(|_| wrong())?;
                let w = &mut o.weights;
                let (colors, moves) = ([&mut w.normal, &mut w.uv, &mut w.color], [&mut w.morph, &mut w.skin]);
                let places = colors.into_iter().chain(moves).chain([&mut w.other, &mut w.border]);
                let place = WEIGHTS.iter().zip(places).find(|(n, _)| **n == name).ok_or_else(wrong)?;
                *place.1 = weight;
            }
            "--weld" => {
                o.weld = length()?.filter(|l| !matches!(l, Length::Units(0.0) | Length::OfDiagonal(0.0)))
            }
            "--prune" => o.prune = length()?,
            "--pairs" => o.method_options.pairs = length()?,
            "--cell" => o.method_options.cell = length()?,
            "--edge-length" => o.method_options.edge_length = length()?,
            "--angle" => o.method_options.angle_deg = Some(number()?),
            "--flat" => o.method_options.flat = length()?,
            "--iterations" => o.method_options.iterations = count()?,
            "--voxel" => o.method_options.voxel = length()?,
            "--subdivisions" => o.method_options.subdivisions = count()?,
            "--max-normal" => o.guards.max_normal_deg = Some(number()?),
            "--min-quality" => o.guards.min_quality = Some(number()?),
            "--max-valence" => o.guards.max_valence = count()?,
            "--max-edge" => o.guards.max_edge = length()?,
            "--normals" => self.normals = choice(Normals::ALL, Normals::name, option, value)?,
            "--seed" => o.seed = value.parse().map_err(|_| wrong())?,
            "--two-stage" => o.method_options.two_stage = true,
            "--adaptive" => o.method_options.adaptive = true,
            "--measure" => o.measure = Measure::Always,
            "--escalate" => o.escalate = true,
            "--per-mesh" => o.per_mesh = true,
            _ => return Err(format!("{option}: unknown option")),
        }
        Ok(())
    }
}

/// Names that `--weight` takes.
pub const WEIGHTS: [&str; 7] = ["normal", "uv", "color", "morph", "skin", "other", "border"];

/// Options that take no value.
const FLAGS: [&str; 5] = ["--two-stage", "--adaptive", "--measure", "--escalate", "--per-mesh"];

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
    use super::*;

    #[test]
    fn words_come_back_as_the_options_that_they_were() {
        let mut all = Simplification::of_preset(Preset::Visual, Stop::ratio(0.07));
        let o = &mut all.options;
        o.method = Method::Remesh;
        (o.fit, o.placement, o.bound) = (Fit::Off, Placement::Endpoint, Bound::OneSided);
        (o.border, o.topology) = (BorderPolicy::Lock, TopologyPolicy::Free);
        (o.weights.uv, o.weights.normal, o.weights.border) = (3.5, 1.0, 0.0);
        o.sharp_deg = Some(27.5);
        (o.weld, o.prune) = (Some(Length::Units(0.25)), Some(Length::OfDiagonal(0.07)));
        let length = Some(Length::OfDiagonal(0.001));
        let m = &mut o.method_options;
        (m.pairs, m.cell, m.edge_length, m.flat, m.voxel) = (length, length, length, length, length);
        (m.angle_deg, m.iterations, m.subdivisions) = (Some(12.5), Some(3), Some(4));
        (m.two_stage, m.adaptive) = (true, true);
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
        let mut switched_off = Simplification::of_preset(Preset::Scan, Stop::faces(9));
        switched_off.options.weld = None;
        assert_eq!(Simplification::parse(&switched_off.words()), Ok(switched_off));
        assert!(Simplification::default().words().is_empty());
    }

    #[test]
    fn what_is_no_word_is_named() {
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
    fn quotes_stand_where_a_shell_wants_them() {
        assert_eq!(quoted("a/b.glb"), "a/b.glb");
        assert_eq!(quoted("my file"), "'my file'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
