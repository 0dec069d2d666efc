//! Units of the target, and its positions on a logarithmic slider.

use lodsmith::Length;
use lodsmith::options::by_name;

use crate::command::SimplifyTarget;
use crate::numbers::{count_of, grouped, significant};
use crate::settings::Settings;

/// Unit of the slider.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Triangles.
    #[default]
    Faces,
    /// Vertices.
    Vertices,
    /// Percent of the triangles.
    Percent,
    /// Deviation, in percent of the diagonal.
    Error,
}

impl Unit {
    /// All units with their names.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Faces, "Faces"),
        (Self::Vertices, "Vertices"),
        (Self::Percent, "Percent"),
        (Self::Error, "Error"),
    ];

    /// Returns the unit of the target in the settings.
    pub fn of(settings: &Settings) -> Option<Self> {
        let stop = &settings.simplify.options.stop;
        let all = [
            (stop.faces.is_some(), Self::Faces),
            (stop.vertices.is_some(), Self::Vertices),
            (stop.ratio.is_some(), Self::Percent),
            (stop.error.is_some(), Self::Error),
        ];
        all.into_iter().find(|x| x.0).map(|x| x.1)
    }
}

/// Size of the original.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OriginalSize {
    /// Number of triangles.
    pub faces: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Diagonal of its bounding box.
    pub diagonal: f64,
}

/// Size of the shown result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResultSize {
    /// Number of triangles.
    pub faces: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Largest distance from the original, if it was measured, as a fraction of the diagonal.
    pub largest: Option<f64>,
}

/// Smallest number of triangles of the slider: a tetrahedron.
pub const MIN_FACES: f64 = 4.0;

/// Smallest and largest error of the slider, as fractions of the diagonal.
pub const ERROR_RANGE: [f64; 2] = [1e-5, 0.1];

impl OriginalSize {
    /// Returns the target at a position of the slider, from 0 (fewest faces) to 1 (all).
    pub fn target(&self, unit: Unit, at: f64) -> SimplifyTarget {
        if at >= 1.0 {
            return SimplifyTarget::Original;
        }
        let at = at.max(0.0);
        let between = |all: usize| {
            let all = (all as f64).max(MIN_FACES);
            MIN_FACES * (all / MIN_FACES).powf(at)
        };
        match unit {
            Unit::Faces => SimplifyTarget::Faces(between(self.faces).round() as usize),
            Unit::Vertices => SimplifyTarget::Vertices(between(self.vertices).round() as usize),
            Unit::Percent => {
                // More than three digits are hard to read.
                let ratio = between(self.faces) / (self.faces as f64).max(MIN_FACES);
                SimplifyTarget::Ratio(rounded(ratio).clamp(1e-9, 1.0))
            }
            Unit::Error => {
                SimplifyTarget::Error(rounded(ERROR_RANGE[1] * (ERROR_RANGE[0] / ERROR_RANGE[1]).powf(at)))
            }
        }
    }

    /// Returns the position of a number of triangles.
    pub fn slider_position_of_faces(&self, faces: f64) -> f64 {
        slider_position(faces, self.faces as f64)
    }

    /// Returns the position of the target in the settings, on a slider in this unit; `None` if it is unknown. A
    /// target in another unit is at the position of its result.
    pub fn slider_position(
        &self,
        settings: &Settings,
        result: Option<&ResultSize>,
        unit: Unit,
    ) -> Option<f64> {
        let stop = &settings.simplify.options.stop;
        if !settings.simplify.has_target() {
            return Some(1.0);
        }
        if unit == Unit::Error {
            let share = self.error_share(settings).or_else(|| result?.largest)?;
            return Some(
                ((share / ERROR_RANGE[1]).ln() / (ERROR_RANGE[0] / ERROR_RANGE[1]).ln()).clamp(0.0, 1.0),
            );
        }
        if let Some(n) = stop.faces {
            Some(slider_position(n as f64, self.faces as f64))
        } else if let Some(n) = stop.vertices {
            Some(slider_position(n as f64, self.vertices as f64))
        } else if let Some(r) = stop.ratio {
            Some(slider_position(r * self.faces as f64, self.faces as f64))
        } else {
            Some(slider_position(result?.faces as f64, self.faces as f64))
        }
    }

    /// Returns the error in the settings as a fraction of the diagonal.
    fn error_share(&self, settings: &Settings) -> Option<f64> {
        let error = settings.simplify.options.stop.error?;
        Some(error.in_units(self.diagonal) / self.diagonal.max(1e-300))
    }

    /// Returns the target times a factor.
    pub fn scaled(&self, settings: &Settings, shown: usize, factor: f64) -> SimplifyTarget {
        let stop = &settings.simplify.options.stop;
        if let Some(share) = self.error_share(settings) {
            return SimplifyTarget::Error(rounded((share / factor).clamp(1e-9, 1.0)));
        }
        let times = |n: f64, all: usize| {
            let wanted = (n * factor).max(MIN_FACES);
            // A change by less than one would be rounded away.
            let wanted = if factor < 1.0 { wanted.min(n - 1.0).max(MIN_FACES) } else { wanted.max(n + 1.0) };
            (wanted < all as f64).then(|| wanted.round() as usize)
        };
        if let Some(n) = stop.vertices {
            return times(n as f64, self.vertices).map_or(SimplifyTarget::Original, SimplifyTarget::Vertices);
        }
        if let Some(r) = stop.ratio {
            let ratio = r * factor;
            return if ratio < 1.0 {
                SimplifyTarget::Ratio(rounded(ratio.max(1e-9)))
            } else {
                SimplifyTarget::Original
            };
        }
        let from = stop.faces.map_or(shown as f64, |n| n as f64);
        times(from, self.faces).map_or(SimplifyTarget::Original, SimplifyTarget::Faces)
    }

    /// Parses a typed target. In every unit `10%` is a share and `20k` a count. A plain number is in the unit; but a
    /// count below 1 is taken as a fraction, and a percentage above 100 as a number of triangles.
    pub fn typed(&self, unit: Unit, text: &str) -> Option<SimplifyTarget> {
        let text = text.trim();
        let (number, is_share) = match text.strip_suffix('%') {
            Some(number) => (number.trim(), true),
            None => (text, false),
        };
        let counted = if is_share { None } else { count_of(number).filter(|&n| n > 0) };
        let plain = number.parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
        let or_original = |is_less: bool, target| if is_less { target } else { SimplifyTarget::Original };
        let ratio = |r: f64| or_original(r < 1.0, SimplifyTarget::Ratio(r));
        match (unit, plain, counted) {
            (Unit::Error, Some(p), _) if is_share || p <= 100.0 => {
                Some(SimplifyTarget::Error(times_ten(p, -2)))
            }
            (Unit::Percent, Some(p), _) if p <= 100.0 => Some(ratio(times_ten(p, -2))),
            (_, Some(p), _) if is_share => Some(ratio(times_ten(p, -2))),
            (Unit::Faces | Unit::Vertices, Some(r), _) if r < 1.0 => Some(ratio(r)),
            (Unit::Vertices, _, Some(n)) => Some(or_original(n < self.vertices, SimplifyTarget::Vertices(n))),
            (_, _, Some(n)) => Some(or_original(n < self.faces, SimplifyTarget::Faces(n))),
            _ => None,
        }
    }
}

fn slider_position(n: f64, all: f64) -> f64 {
    let all = all.max(MIN_FACES);
    if all <= MIN_FACES {
        return 1.0;
    }
    ((n.max(MIN_FACES) / MIN_FACES).ln() / (all / MIN_FACES).ln()).clamp(0.0, 1.0)
}

/// Rounds to three significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

/// Multiplies by a power of ten without rounding: the decimal digits stay.
fn times_ten(x: f64, power: i32) -> f64 {
    format!("{x}e{power}").parse().unwrap_or(x)
}

/// Formats the target of the settings in a unit; `None` if it is unknown. A target in another unit is shown as the
/// value of its result.
pub fn text_of(
    settings: &Settings,
    whole: &OriginalSize,
    result: Option<&ResultSize>,
    unit: Unit,
) -> Option<String> {
    let stop = &settings.simplify.options.stop;
    let has_target = settings.simplify.has_target();
    let faces = || match (stop.faces, stop.ratio) {
        _ if !has_target => Some(whole.faces),
        (Some(n), _) => Some(n),
        (None, Some(ratio)) => Some((ratio * whole.faces as f64).round() as usize),
        (None, None) => Some(result?.faces),
    };
    match unit {
        Unit::Faces => faces().map(grouped),
        Unit::Vertices if !has_target => Some(grouped(whole.vertices)),
        Unit::Vertices => stop.vertices.or(result.map(|r| r.vertices)).map(grouped),
        Unit::Percent => match stop.ratio {
            // The same digits as on the command line.
            Some(ratio) => Some(format!("{}%", times_ten(ratio, 2))),
            None => {
                faces().map(|n| format!("{}%", significant(100.0 * n as f64 / whole.faces.max(1) as f64, 3)))
            }
        },
        Unit::Error => match stop.error {
            Some(error @ Length::OfDiagonal(_)) => Some(by_name::length_text(error)),
            _ if !has_target => Some("0%".to_owned()),
            _ => {
                let share = whole.error_share(settings).or_else(|| result?.largest)?;
                Some(format!("{}%", significant(100.0 * share, 3)))
            }
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Command;

    const WHOLE: OriginalSize = OriginalSize { faces: 100_000, vertices: 50_000, diagonal: 2.0 };

    const RESULT: ResultSize = ResultSize { faces: 4000, vertices: 2002, largest: Some(0.0123) };

    #[test]
    fn slider_position_and_target_convert_to_each_other() {
        for (unit, _) in Unit::ALL {
            for at in [0.0, 0.3, 0.7, 0.95, 1.0] {
                let mut settings = Settings::default();
                Command::Target(WHOLE.target(unit, at)).apply(&mut settings);
                let got = WHOLE.slider_position(&settings, None, unit).unwrap();
                assert!((got - at).abs() < 0.02, "{unit:?} {at}: {got}");
            }
        }
    }

    #[test]
    fn a_target_has_a_text_in_every_unit() {
        let mut settings = Settings::default();
        let text = |settings: &Settings, result: Option<&ResultSize>| {
            Unit::ALL.map(|(unit, _)| text_of(settings, &WHOLE, result, unit).unwrap_or_default())
        };
        assert_eq!(text(&settings, None), ["100,000", "50,000", "100%", "0%"]);
        Command::Target(SimplifyTarget::Faces(4001)).apply(&mut settings);
        assert_eq!(text(&settings, Some(&RESULT)), ["4,001", "2,002", "4.00%", "1.23%"]);
        // The largest distance is not known, and no other value replaces it.
        assert_eq!(text(&settings, None), ["4,001", "", "4.00%", ""]);
        assert_eq!(WHOLE.slider_position(&settings, None, Unit::Error), None);
        Command::Target(SimplifyTarget::Error(0.0125)).apply(&mut settings);
        assert_eq!(text(&settings, Some(&RESULT)), ["4,000", "2,002", "4.00%", "1.25%"]);
    }

    #[test]
    fn the_digits_of_a_command_are_those_shown() {
        let whole = OriginalSize { faces: 61_034, ..WHOLE };
        let shown = |target: SimplifyTarget, unit: Unit| {
            let mut settings = Settings::default();
            Command::Target(target).apply(&mut settings);
            let words = settings.simplify.words();
            let at = words.iter().position(|w| w == "--ratio" || w == "--error").unwrap();
            (text_of(&settings, &whole, None, unit).unwrap(), words[at + 1].clone())
        };
        for typed in ["6.55", "33.3333", "7", "0.29"] {
            let target = whole.typed(Unit::Percent, typed).unwrap();
            let (text, word) = shown(target, Unit::Percent);
            assert_eq!(text, format!("{typed}%"));
            assert_eq!(word, times_ten(typed.parse().unwrap(), -2).to_string());
            let (text, word) = shown(whole.typed(Unit::Error, typed).unwrap(), Unit::Error);
            assert_eq!([text, word], [(); 2].map(|()| format!("{typed}%")));
        }
        for at in [0.21, 0.5, 0.77] {
            let mut settings = Settings::default();
            Command::Target(whole.target(Unit::Percent, at)).apply(&mut settings);
            let target = whole.scaled(&settings, 0, 0.9);
            let (text, word) = shown(target, Unit::Percent);
            assert_eq!(text, format!("{}%", times_ten(word.parse().unwrap(), 2)));
            assert!(word.len() <= 12, "{word}");
        }
    }

    #[test]
    fn shares_fractions_and_counts_are_understood_in_every_unit() {
        let meant = |text: &str| Unit::ALL.map(|(unit, _)| WHOLE.typed(unit, text).unwrap());
        let (ratio, faces, error) = (SimplifyTarget::Ratio, SimplifyTarget::Faces, SimplifyTarget::Error);
        let vertices = SimplifyTarget::Vertices;
        assert_eq!(meant("10%"), [ratio(0.1), ratio(0.1), ratio(0.1), error(0.1)]);
        assert_eq!(meant("0.1"), [ratio(0.1), ratio(0.1), ratio(0.001), error(0.001)]);
        assert_eq!(meant("20k"), [faces(20_000), vertices(20_000), faces(20_000), faces(20_000)]);
        assert_eq!(meant("4,000"), [faces(4000), vertices(4000), faces(4000), faces(4000)]);
        assert_eq!(meant("100%")[..3], [SimplifyTarget::Original; 3]);
    }

    #[test]
    fn a_typed_target_is_set() {
        assert_eq!(WHOLE.typed(Unit::Faces, "6,945"), Some(SimplifyTarget::Faces(6945)));
        assert_eq!(WHOLE.typed(Unit::Faces, "1M"), Some(SimplifyTarget::Original));
        assert_eq!(WHOLE.typed(Unit::Percent, "10 %"), Some(SimplifyTarget::Ratio(0.1)));
        assert_eq!(WHOLE.typed(Unit::Error, "0.5"), Some(SimplifyTarget::Error(0.005)));
        for (unit, _) in Unit::ALL {
            for bad in ["", "x", "0", "-3", "nan"] {
                assert_eq!(WHOLE.typed(unit, bad), None, "{unit:?} {bad}");
            }
        }
    }

    #[test]
    fn steps_come_somewhere_and_end() {
        let mut settings = Settings::default();
        for _ in 0..2000 {
            let next = WHOLE.scaled(&settings, WHOLE.faces, 0.97);
            Command::Target(next).apply(&mut settings);
        }
        assert_eq!(settings.simplify.options.stop.faces, Some(4));
        for _ in 0..2000 {
            let next = WHOLE.scaled(&settings, 4, 1.03);
            Command::Target(next).apply(&mut settings);
            if next == SimplifyTarget::Original {
                return;
            }
        }
        unreachable!("it must come back to the original");
    }
}
