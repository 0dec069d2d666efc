//! Units of the target, and its positions on a logarithmic slider.

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

    /// Returns the position of the target in the settings.
    pub fn slider_position(&self, settings: &Settings) -> f64 {
        let stop = &settings.simplify.options.stop;
        if let Some(n) = stop.faces {
            slider_position(n as f64, self.faces as f64)
        } else if let Some(n) = stop.vertices {
            slider_position(n as f64, self.vertices as f64)
        } else if let Some(r) = stop.ratio {
            slider_position(r * self.faces as f64, self.faces as f64)
        } else if let Some(error) = stop.error {
            let share = error.in_units(self.diagonal) / self.diagonal.max(1e-300);
            ((share / ERROR_RANGE[1]).ln() / (ERROR_RANGE[0] / ERROR_RANGE[1]).ln()).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Returns the target times a factor.
    pub fn scaled(&self, settings: &Settings, shown: usize, factor: f64) -> SimplifyTarget {
        let stop = &settings.simplify.options.stop;
        if let Some(error) = stop.error {
            let share = error.in_units(self.diagonal) / self.diagonal.max(1e-300);
            return SimplifyTarget::Error((share / factor).clamp(1e-9, 1.0));
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
                SimplifyTarget::Ratio(ratio.max(1e-9))
            } else {
                SimplifyTarget::Original
            };
        }
        let from = stop.faces.map_or(shown as f64, |n| n as f64);
        times(from, self.faces).map_or(SimplifyTarget::Original, SimplifyTarget::Faces)
    }

    /// Parses a typed target.
    pub fn typed(&self, unit: Unit, text: &str) -> Option<SimplifyTarget> {
        let number =
            || text.trim().trim_end_matches('%').trim().parse::<f64>().ok().filter(|x| x.is_finite());
        match unit {
            Unit::Faces => count_of(text).filter(|&n| n > 0).map(|n| match n < self.faces {
                true => SimplifyTarget::Faces(n),
                false => SimplifyTarget::Original,
            }),
            Unit::Vertices => count_of(text).filter(|&n| n > 0).map(|n| match n < self.vertices {
                true => SimplifyTarget::Vertices(n),
                false => SimplifyTarget::Original,
            }),
            Unit::Percent => number().filter(|&p| p > 0.0).map(|p| match p < 100.0 {
                true => SimplifyTarget::Ratio(p / 100.0),
                false => SimplifyTarget::Original,
            }),
            Unit::Error => number().filter(|&p| p > 0.0).map(|p| SimplifyTarget::Error(p / 100.0)),
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

/// Formats the target of the settings.
pub fn text_of(settings: &Settings, whole: &OriginalSize, unit: Unit) -> String {
    let stop = &settings.simplify.options.stop;
    match unit {
        Unit::Faces => grouped(stop.faces.unwrap_or(whole.faces)),
        Unit::Vertices => grouped(stop.vertices.unwrap_or(whole.vertices)),
        Unit::Percent => format!("{}%", significant(100.0 * stop.ratio.unwrap_or(1.0), 3)),
        Unit::Error => {
            let share = stop.error.map_or(0.0, |e| e.in_units(whole.diagonal) / whole.diagonal.max(1e-300));
            format!("{}%", significant(100.0 * share, 3))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Command;

    const WHOLE: OriginalSize = OriginalSize { faces: 100_000, vertices: 50_000, diagonal: 2.0 };

    #[test]
    fn a_place_is_that_of_its_target() {
        for (unit, _) in Unit::ALL {
            for at in [0.0, 0.3, 0.7, 0.95, 1.0] {
                let mut settings = Settings::default();
                Command::Target(WHOLE.target(unit, at)).apply(&mut settings);
                let got = WHOLE.slider_position(&settings);
                assert!((got - at).abs() < 0.02, "{unit:?} {at}: {got}");
            }
        }
    }

    #[test]
    fn what_is_typed_is_meant() {
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
