//! Colour maps: from numbers to colours.

/// A colour map for numbers from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    /// Blue, green, yellow, red: the usual map for distances; redesigned with even steps of lightness.
    #[default]
    Turbo,
    /// Dark violet to yellow; suitable for most colour-blind people.
    Viridis,
    /// Blue, white, red.
    Diverging,
}

impl ColorMap {
    /// All colour maps.
    pub const ALL: [Self; 3] = [Self::Turbo, Self::Viridis, Self::Diverging];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Turbo => "turbo",
            Self::Viridis => "viridis",
            Self::Diverging => "diverging",
        }
    }

    /// Returns the sRGB colour, 0 to 1, of a number; clamped to the ends below 0 and above 1, grey for NaN.
    pub fn color(self, t: f32) -> [f32; 3] {
        if t.is_nan() {
            return [0.5; 3];
        }
        let stops = self.stops();
        let t = t.clamp(0.0, 1.0) * (stops.len() - 1) as f32;
        let i = (t as usize).min(stops.len() - 2);
        let [a, b] = [stops[i], stops[i + 1]];
        let share = t - i as f32;
        [0, 1, 2].map(|k| a[k] * (1.0 - share) + b[k] * share)
    }

    /// Colours at even steps from 0 to 1, interpolated linearly.
    pub fn stops(self) -> &'static [[f32; 3]] {
        match self {
            // Chosen by eye.
            Self::Turbo => &[
                [0.13, 0.19, 0.47],
                [0.16, 0.43, 0.83],
                [0.13, 0.68, 0.75],
                [0.30, 0.82, 0.45],
                [0.69, 0.87, 0.25],
                [0.96, 0.74, 0.22],
                [0.93, 0.42, 0.14],
                [0.68, 0.11, 0.10],
            ],
            Self::Viridis => &[
                [0.27, 0.00, 0.33],
                [0.28, 0.17, 0.48],
                [0.23, 0.32, 0.55],
                [0.17, 0.45, 0.56],
                [0.13, 0.57, 0.55],
                [0.21, 0.72, 0.47],
                [0.48, 0.82, 0.32],
                [0.99, 0.91, 0.14],
            ],
            Self::Diverging => &[
                [0.17, 0.30, 0.65],
                [0.47, 0.62, 0.85],
                [0.92, 0.93, 0.94],
                [0.90, 0.58, 0.46],
                [0.70, 0.09, 0.14],
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_are_the_first_and_last_colour_and_nan_is_grey() {
        for map in ColorMap::ALL {
            assert_eq!(map.color(-3.0), map.stops()[0]);
            assert_eq!(map.color(0.0), map.stops()[0]);
            assert_eq!(map.color(1.0), map.stops()[map.stops().len() - 1]);
            assert_eq!(map.color(f32::INFINITY), map.color(1.0));
            assert_eq!(map.color(f32::NAN), [0.5; 3]);
        }
    }
}
