//! Tracks of the timeline, and the mapping between time and horizontal position.

use eframe::egui::Rangef;

use crate::stage::motion::Mover;

/// Width of the names before the lanes.
pub(super) const NAME_WIDTH: f32 = 128.0;

/// Space for half a knob beyond both ends.
pub(super) const MARGIN: f32 = 8.0;

/// Smallest distance between two ticks of the ruler, in points.
const MIN_TICK_DISTANCE: f64 = 64.0;

/// Mapping between time and horizontal position, for the ruler and all lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeScale {
    /// Horizontal range on the screen.
    pub x_range: Rangef,
    /// Length in seconds.
    pub length: f64,
}

impl TimeScale {
    /// Returns the position of a time.
    pub(super) fn x_of(&self, seconds: f64) -> f32 {
        let share = if self.length > 0.0 { (seconds / self.length).clamp(0.0, 1.0) } else { 0.0 };
        self.x_range.min + self.x_range.span() * share as f32
    }

    /// Returns the time at a position, clamped to the ruler.
    pub(super) fn seconds_at(&self, x: f32) -> f64 {
        let share = f64::from((x - self.x_range.min) / self.x_range.span().max(1.0)).clamp(0.0, 1.0);
        share * self.length
    }

    /// Returns the seconds between two ticks: 1, 2 or 5 times a power of ten.
    pub(super) fn step(&self) -> f64 {
        let least = MIN_TICK_DISTANCE * self.length / f64::from(self.x_range.span().max(1.0));
        let power = 10f64.powf(least.max(1e-6).log10().floor());
        [1.0, 2.0, 5.0].map(|n| n * power).into_iter().find(|s| *s >= least).unwrap_or(10.0 * power)
    }
}

/// An animated object: a lane under the ruler.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TimelineTrack {
    /// Name of the object.
    pub name: String,
    /// Times of its keyframes in seconds, ascending.
    pub keys: Vec<f64>,
    /// Mover on the stage; `None` for a clip of the file, whose keyframes cannot be edited.
    pub mover: Option<Mover>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_position_on_the_ruler_convert_to_each_other() {
        let scale = TimeScale { x_range: Rangef::new(100.0, 500.0), length: 2.0 };
        for seconds in [0.0, 0.3, 1.0, 2.0] {
            assert!((scale.seconds_at(scale.x_of(seconds)) - seconds).abs() < 1e-6);
        }
        assert_eq!([scale.seconds_at(0.0), scale.seconds_at(900.0)], [0.0, 2.0]);
        let nothing = TimeScale { length: 0.0, ..scale };
        assert_eq!((nothing.x_of(1.0), nothing.seconds_at(300.0)), (100.0, 0.0));
    }

    #[test]
    fn ticks_are_apart_and_at_round_numbers() {
        for (length, points, wanted) in
            [(2.0, 400.0, 0.5), (2.0, 1300.0, 0.1), (70.0, 640.0, 10.0), (0.04, 128.0, 0.02)]
        {
            let scale = TimeScale { x_range: Rangef::new(0.0, points), length };
            assert!((scale.step() - wanted).abs() < 1e-9, "{length} {points}: {}", scale.step());
        }
    }
}
