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
    /// Deviation, in units of the file.
    Distance,
}

impl Unit {
    /// All units with their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Faces, "Faces"),
        (Self::Vertices, "Vertices"),
        (Self::Percent, "Percent"),
        (Self::Error, "Error"),
        (Self::Distance, "Distance"),
    ];

    /// Returns an explanation.
    pub fn tip(self) -> &'static str {
        match self {
            Self::Faces => "Number of triangles",
            Self::Vertices => "Number of vertices",
            Self::Percent => "Percent of the triangles",
            Self::Error => "Largest distance from the original, in percent of the diagonal",
            Self::Distance => "Largest distance from the original, in units of the file",
        }
    }

    /// Returns true if targets are distances.
    pub fn is_error(self) -> bool {
        matches!(self, Self::Error | Self::Distance)
    }

    /// Returns the unit of the target in the settings.
    pub fn of(settings: &Settings) -> Option<Self> {
        let stop = &settings.simplify.options.stop;
        let all = [
            (stop.faces.is_some(), Self::Faces),
            (stop.vertices.is_some(), Self::Vertices),
            (stop.ratio.is_some(), Self::Percent),
            (matches!(stop.error, Some(Length::OfDiagonal(_))), Self::Error),
            (matches!(stop.error, Some(Length::Units(_))), Self::Distance),
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
const MIN_FACES: f64 = 4.0;

/// Smallest and largest error of the slider, as fractions of the diagonal.
const ERROR_RANGE: [f64; 2] = [1e-5, 0.1];

/// Tick marks of counts, as fractions of the triangles.
const COUNT_TICKS: [(f64, &str); 9] = [
    (1.0, "100 %"),
    (0.5, "50"),
    (0.25, "25"),
    (0.1, "10"),
    (0.05, "5"),
    (0.01, "1"),
    (0.001, "0.1"),
    (0.0001, "0.01"),
    (0.00001, "0.001"),
];

/// Part of the slider that an arrow key moves it by.
const KEY_STEP: f64 = 0.02;

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
            Unit::Error => SimplifyTarget::Error(rounded(error_at(at))),
            Unit::Distance => SimplifyTarget::Distance(rounded(error_at(at) * self.diagonal)),
        }
    }

    /// Returns the target some key presses to the right of the present one; `None` if it is unknown or at the end.
    pub fn stepped(
        &self,
        settings: &Settings,
        result: Option<&ResultSize>,
        unit: Unit,
        steps: i32,
    ) -> Option<SimplifyTarget> {
        let from = self.slider_position(settings, result, unit)?;
        let step = KEY_STEP * f64::from(steps);
        let target = |n: i32| self.target(unit, from + step * f64::from(n));
        // Small counts are rounded: several steps may give the same.
        let most = (1.0 / KEY_STEP) as i32;
        (1..=most).map(target).find(|target| target.stop() != settings.simplify.options.stop)
    }

    /// Returns the tick marks of the slider, from the right: positions and texts.
    pub fn ticks(&self, unit: Unit) -> Vec<(f64, String)> {
        match unit {
            Unit::Error => [0.001, 0.01, 0.1, 1.0, 10.0]
                .map(|percent| (position_of_error(percent / 100.0), format!("{percent} %")))
                .to_vec(),
            Unit::Distance if self.diagonal > 0.0 => {
                let [least, most] = ERROR_RANGE.map(|share| share * self.diagonal);
                // The powers of ten within the range, with a margin for rounding.
                let from = (least.log10() - 1e-9).ceil();
                let powers =
                    (0..6).map(|i| 10f64.powf(from + f64::from(i))).filter(|x| *x <= most * 1.000_001);
                powers.map(|x| (position_of_error(x / self.diagonal), significant(x, 1))).collect()
            }
            Unit::Distance => Vec::new(),
            Unit::Faces | Unit::Vertices | Unit::Percent => COUNT_TICKS
                .iter()
                .filter(|tick| tick.0 * self.faces as f64 >= MIN_FACES)
                .map(|tick| (self.slider_position_of_faces(tick.0 * self.faces as f64), tick.1.to_owned()))
                .collect(),
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
        if unit.is_error() {
            return self.error_share(settings).or_else(|| result?.largest).map(position_of_error);
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
            let share = (share / factor).clamp(1e-9, 1.0);
            return match stop.error {
                Some(Length::Units(_)) => SimplifyTarget::Distance(rounded(share * self.diagonal)),
                _ => SimplifyTarget::Error(rounded(share)),
            };
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

    /// Parses a typed target. In every unit `20k` is a count, and `10%` a share: of the diagonal if the unit is an
    /// error, else of the triangles. A plain number is in the unit; but a count below 1 is taken as a fraction, and a
    /// percentage above 100 as a number of triangles.
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
            (Unit::Distance, Some(d), _) if !is_share => Some(SimplifyTarget::Distance(d)),
            (Unit::Error | Unit::Distance, Some(p), _) if is_share || p <= 100.0 => {
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

/// Returns the error at a position, as a fraction of the diagonal.
fn error_at(position: f64) -> f64 {
    ERROR_RANGE[1] * (ERROR_RANGE[0] / ERROR_RANGE[1]).powf(position)
}

/// Returns the position of an error, which is a fraction of the diagonal.
fn position_of_error(share: f64) -> f64 {
    ((share / ERROR_RANGE[1]).ln() / (ERROR_RANGE[0] / ERROR_RANGE[1]).ln()).clamp(0.0, 1.0)
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
        Unit::Error | Unit::Distance => match (unit, stop.error) {
            (Unit::Error, Some(error @ Length::OfDiagonal(_)))
            | (Unit::Distance, Some(error @ Length::Units(_))) => Some(by_name::length_text(error)),
            _ => {
                let unknown = || result?.largest;
                let none = (!has_target).then_some(0.0);
                let share = none.or_else(|| whole.error_share(settings)).or_else(unknown)?;
                Some(match unit {
                    Unit::Error => format!("{}%", significant(100.0 * share, 3)),
                    _ => significant(share * whole.diagonal, 3),
                })
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
        assert_eq!(text(&settings, None), ["100,000", "50,000", "100%", "0%", "0"]);
        Command::Target(SimplifyTarget::Faces(4001)).apply(&mut settings);
        assert_eq!(text(&settings, Some(&RESULT)), ["4,001", "2,002", "4.00%", "1.23%", "0.0246"]);
        // The largest distance is not known, and no other value replaces it.
        assert_eq!(text(&settings, None), ["4,001", "", "4.00%", "", ""]);
        assert_eq!(WHOLE.slider_position(&settings, None, Unit::Error), None);
        Command::Target(SimplifyTarget::Error(0.0125)).apply(&mut settings);
        assert_eq!(text(&settings, Some(&RESULT)), ["4,000", "2,002", "4.00%", "1.25%", "0.0250"]);
        Command::Target(SimplifyTarget::Distance(0.025)).apply(&mut settings);
        assert_eq!(text(&settings, Some(&RESULT)), ["4,000", "2,002", "4.00%", "1.25%", "0.025"]);
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
        let (vertices, distance) = (SimplifyTarget::Vertices, SimplifyTarget::Distance);
        assert_eq!(meant("10%"), [ratio(0.1), ratio(0.1), ratio(0.1), error(0.1), error(0.1)]);
        assert_eq!(meant("0.1"), [ratio(0.1), ratio(0.1), ratio(0.001), error(0.001), distance(0.1)]);
        assert_eq!(
            meant("20k"),
            [faces(20_000), vertices(20_000), faces(20_000), faces(20_000), faces(20_000)]
        );
        assert_eq!(meant("4,000"), [faces(4000), vertices(4000), faces(4000), faces(4000), faces(4000)]);
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
    fn a_target_keeps_its_unit() {
        for (unit, _) in Unit::ALL {
            let mut settings = Settings::default();
            Command::Target(WHOLE.target(unit, 0.5)).apply(&mut settings);
            assert_eq!(Unit::of(&settings), Some(unit));
            for steps in [1, -2] {
                let next = WHOLE.stepped(&settings, None, unit, steps).unwrap();
                Command::Target(next).apply(&mut settings);
                assert_eq!(Unit::of(&settings), Some(unit), "{unit:?}");
            }
            Command::Target(WHOLE.scaled(&settings, 0, 0.9)).apply(&mut settings);
            assert_eq!(Unit::of(&settings), Some(unit), "{unit:?}");
        }
    }

    #[test]
    fn arrow_keys_go_from_end_to_end() {
        // With few triangles, most steps of the slider would give the same count.
        for whole in [WHOLE, OriginalSize { faces: 8, vertices: 6, ..WHOLE }] {
            for (unit, _) in Unit::ALL {
                let mut settings = Settings::default();
                let mut go = |steps: i32| {
                    let mut count = 0;
                    while let Some(next) = whole.stepped(&settings, None, unit, steps) {
                        Command::Target(next).apply(&mut settings);
                        count += 1;
                        assert!(count < 100, "{unit:?}");
                    }
                    (count, whole.slider_position(&settings, None, unit))
                };
                let (down, left) = go(-1);
                assert!(left.unwrap() < 0.01 && down > 2, "{unit:?}: {down} steps to {left:?}");
                let (up, right) = go(1);
                assert_eq!((up > 2, right), (true, Some(1.0)), "{unit:?}");
                assert!(!settings.simplify.has_target());
            }
        }
    }

    #[test]
    fn ticks_are_on_the_scale() {
        let texts = |unit| WHOLE.ticks(unit).into_iter().map(|tick| tick.1).collect::<Vec<_>>();
        assert_eq!(texts(Unit::Error), ["0.001 %", "0.01 %", "0.1 %", "1 %", "10 %"]);
        // From 0.00002 to 0.2.
        assert_eq!(texts(Unit::Distance), ["0.0001", "0.001", "0.01", "0.1"]);
        assert!(OriginalSize { diagonal: 0.0, ..WHOLE }.ticks(Unit::Distance).is_empty());
        for (unit, text, target) in [
            (Unit::Error, "1 %", SimplifyTarget::Error(0.01)),
            (Unit::Distance, "0.01", SimplifyTarget::Distance(0.01)),
            (Unit::Faces, "10", SimplifyTarget::Faces(10_000)),
        ] {
            let tick = WHOLE.ticks(unit).into_iter().find(|tick| tick.1 == text).unwrap();
            assert_eq!(WHOLE.target(unit, tick.0), target);
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
