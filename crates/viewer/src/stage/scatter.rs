//! Random placement of copies, reproducible from its settings.

use std::collections::HashMap;

use lodsmith_core::sampling::Random;
use serde::{Deserialize, Serialize};

use super::{MAX_COPIES, Placement};

/// Settings for scattering copies. Apart from copies that are kept, the result depends on nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Scatter {
    /// Number of copies.
    pub count: usize,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Radius of the footprint circle of a copy of scale 1.
    pub footprint: f64,
    /// Spacing between two copies, in footprints.
    pub gap: f64,
    /// Side of the square area; 0 computes one with spare room.
    pub side: f64,
    /// Minimum and maximum scale.
    pub scale: [f64; 2],
    /// True if each copy gets a random rotation.
    pub is_turned: bool,
    /// True if existing copies are kept.
    pub keeps: bool,
}

impl Default for Scatter {
    fn default() -> Self {
        Self {
            count: 100,
            seed: 1,
            footprint: 1.0,
            gap: 0.2,
            side: 0.0,
            scale: [0.8, 1.2],
            is_turned: true,
            keeps: false,
        }
    }
}

/// Fraction of the square covered by circles when its size is computed from their number. Random placement
/// finds room up to 0.54.
const TARGET_COVERAGE: f64 = 0.3;
/// Maximum number of random positions tried for one circle.
const MAX_TRIES: usize = 200;

impl Scatter {
    /// Returns the side of the square.
    pub fn side(&self) -> f64 {
        if self.side > 0.0 && self.side.is_finite() {
            return self.side;
        }
        let radius = self.radius(self.max_scale());
        radius * (std::f64::consts::PI * self.count.max(1) as f64 / TARGET_COVERAGE).sqrt()
    }

    /// Returns the copies after scattering, given the existing ones.
    ///
    /// New copies do not overlap if possible: circles are placed at random, and if one finds no room in 200
    /// tries, all are placed in the cells of a square grid, provided that no copies are kept and the cells
    /// are large enough. Otherwise a circle goes where the distance to the others is largest.
    /// Cost: O(count · tries).
    pub fn placements(&self, standing: &[Placement]) -> Vec<Placement> {
        let kept: &[Placement] = if self.keeps { standing } else { &[] };
        let count = self.count.min(MAX_COPIES.saturating_sub(kept.len()));
        let mut chance = Random::new(self.seed);
        let (mut copies, has_room) = self.random_placements(count, kept, &mut chance);
        if !has_room
            && kept.is_empty()
            && let Some(in_cells) = self.grid_placements(count, &mut Random::new(self.seed))
        {
            copies = in_cells;
        }
        kept.iter().copied().chain(copies).collect()
    }

    /// Returns the number of overlapping pairs of copies.
    pub fn overlaps(&self, copies: &[Placement]) -> usize {
        let mut near = CircleGrid::new(self.radius_without_gap(max_scale_of(copies)));
        let mut count = 0;
        for copy in copies {
            let radius = self.radius_without_gap(copy.scale);
            let touches = |d: f64, other: f64| d < (radius + other) * (1.0 - 1e-9);
            count += near.around(copy.x, copy.z, radius).filter(|(d, other)| touches(*d, *other)).count();
            near.add(copy.x, copy.z, radius);
        }
        count
    }

    fn random_placements(
        &self,
        count: usize,
        kept: &[Placement],
        chance: &mut Random,
    ) -> (Vec<Placement>, bool) {
        let side = self.side();
        let mut near = CircleGrid::new(self.radius(self.max_scale().max(max_scale_of(kept))));
        for copy in kept {
            near.add(copy.x, copy.z, self.radius(copy.scale));
        }
        // If the total area of the circles exceeds the square, skip the search for free positions.
        let least = self.radius(self.scales()[0]);
        let throws =
            if count as f64 * least * least * std::f64::consts::PI > side * side { 0 } else { MAX_TRIES };
        let mut has_room = throws > 0;
        let mut copies = Vec::with_capacity(count);
        for _ in 0..count {
            let (turn_deg, scale) = self.turn_and_scale(chance);
            let radius = self.radius(scale);
            let [x, z] = [chance.unit(), chance.unit()].map(|u| (u - 0.5) * side);
            let mut best = (f64::NEG_INFINITY, x, z);
            for _ in 0..throws {
                let [x, z] = [chance.unit(), chance.unit()].map(|u| (u - 0.5) * side);
                let room = near.around(x, z, radius).map(|(d, other)| d - other - radius);
                let room = room.fold(f64::INFINITY, f64::min);
                if room > best.0 {
                    best = (room, x, z);
                }
                if room >= 0.0 {
                    break;
                }
            }
            has_room &= best.0 >= 0.0;
            let (_, x, z) = best;
            near.add(x, z, radius);
            copies.push(Placement { x, z, turn_deg, scale });
        }
        (copies, has_room)
    }

    /// Places one copy in each cell of a grid, at a random position inside the cell; empty cells are chosen
    /// at random.
    fn grid_placements(&self, count: usize, chance: &mut Random) -> Option<Vec<Placement>> {
        let side = self.side();
        let across = (count as f64).sqrt().ceil().max(1.0) as usize;
        let cell = side / across as f64;
        // Grid circles stay inside the square; only randomly placed ones may reach over its edge, by up to
        // their radius.
        if cell < 2.0 * self.radius(self.max_scale()) {
            return None;
        }
        let mut cells: Vec<usize> = (0..across * across).collect();
        for i in (1..cells.len()).rev() {
            cells.swap(i, ((chance.unit() * (i + 1) as f64) as usize).min(i));
        }
        cells.truncate(count);
        let copies = cells.into_iter().map(|at| {
            let (turn_deg, scale) = self.turn_and_scale(chance);
            let free = cell - 2.0 * self.radius(scale);
            let along = |k: usize, u: f64| (k as f64 + 0.5) * cell - 0.5 * side + (u - 0.5) * free;
            let (x, z) = (along(at % across, chance.unit()), along(at / across, chance.unit()));
            Placement { x, z, turn_deg, scale }
        });
        Some(copies.collect())
    }

    fn turn_and_scale(&self, chance: &mut Random) -> (f64, f64) {
        let (turn, size) = (chance.unit(), chance.unit());
        let [least, most] = self.scales();
        (if self.is_turned { 360.0 * turn } else { 0.0 }, least + (most - least) * size)
    }
    fn scales(&self) -> [f64; 2] {
        let [a, b] = self.scale.map(|s| if s.is_finite() { s.clamp(0.01, 100.0) } else { 1.0 });
        [a.min(b), a.max(b)]
    }
    fn max_scale(&self) -> f64 {
        self.scales()[1]
    }
    fn radius_without_gap(&self, scale: f64) -> f64 {
        let footprint = if self.footprint > 0.0 && self.footprint.is_finite() { self.footprint } else { 1.0 };
        footprint * scale
    }
    fn radius(&self, scale: f64) -> f64 {
        self.radius_without_gap(scale) * (1.0 + 0.5 * self.gap.clamp(0.0, 100.0))
    }
}

fn max_scale_of(copies: &[Placement]) -> f64 {
    copies.iter().map(|c| c.scale).fold(1e-9, f64::max)
}

/// Circles in a uniform grid, for neighbour queries.
struct CircleGrid {
    cell: f64,
    circles: HashMap<[i64; 2], Vec<[f64; 3]>>,
}

impl CircleGrid {
    /// Creates an empty grid; `radius` is the maximum radius of the circles.
    fn new(radius: f64) -> Self {
        Self { cell: 2.0 * radius, circles: HashMap::new() }
    }

    fn key(&self, x: f64, z: f64) -> [i64; 2] {
        [x, z].map(|v| (v / self.cell).floor() as i64)
    }

    fn add(&mut self, x: f64, z: f64, radius: f64) {
        self.circles.entry(self.key(x, z)).or_default().push([x, z, radius]);
    }

    /// Returns distances and radii of all circles that may touch a circle at this position.
    fn around(&self, x: f64, z: f64, radius: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let reach = radius + 0.5 * self.cell;
        let ([x0, z0], [x1, z1]) = (self.key(x - reach, z - reach), self.key(x + reach, z + reach));
        let keys = (x0..=x1).flat_map(move |a| (z0..=z1).map(move |b| [a, b]));
        keys.filter_map(|key| self.circles.get(&key))
            .flatten()
            .map(move |&[cx, cz, radius]| ((cx - x).hypot(cz - z), radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_settings_give_the_same_copies() {
        let scatter = Scatter { count: 300, ..Scatter::default() };
        let one = scatter.placements(&[]);
        assert_eq!(one, scatter.placements(&[]));
        assert_ne!(one, Scatter { seed: 2, ..scatter }.placements(&[]));
        assert_eq!(one.len(), 300);
        assert!(one.iter().all(|c| c.scale >= 0.8 && c.scale <= 1.2 && c.turn_deg < 360.0));
    }

    #[test]
    fn nothing_overlaps_where_there_is_room() {
        for (count, seed) in [(1, 1), (10, 2), (500, 3), (5000, 4)] {
            let scatter = Scatter { count, seed, footprint: 0.37, ..Scatter::default() };
            let copies = scatter.placements(&[]);
            assert_eq!(scatter.overlaps(&copies), 0, "{count}");
            let half = 0.5 * scatter.side();
            assert!(copies.iter().all(|c| c.x.abs() <= half && c.z.abs() <= half));
        }
    }

    #[test]
    fn a_square_that_is_nearly_full_is_filled_without_overlap() {
        // 100 circles of radius 1 in a square of side 20.5: random placement would not find room.
        let scatter = Scatter { count: 100, gap: 0.0, side: 20.5, scale: [1.0; 2], ..Scatter::default() };
        assert!(!scatter.random_placements(100, &[], &mut Random::new(1)).1);
        assert_eq!(scatter.overlaps(&scatter.placements(&[])), 0);
        // Without enough room, all copies are still placed.
        let tight = Scatter { side: 10.0, ..scatter };
        let copies = tight.placements(&[]);
        assert_eq!(copies.len(), 100);
        assert!(tight.overlaps(&copies) > 0);
    }

    #[test]
    fn existing_copies_are_kept_and_not_overlapped() {
        let standing = [Placement::at(0.0, 0.0), Placement { scale: 4.0, ..Placement::at(8.0, 1.0) }];
        let scatter = Scatter { count: 50, keeps: true, ..Scatter::default() };
        let copies = scatter.placements(&standing);
        assert_eq!(copies.len(), 52);
        assert_eq!(copies[..2], standing);
        assert_eq!(scatter.overlaps(&copies), 0);
    }

    #[test]
    fn extreme_settings_scatter_too() {
        let strange = Scatter {
            footprint: f64::NAN,
            gap: -1.0,
            side: f64::NEG_INFINITY,
            scale: [f64::NAN, -3.0],
            ..Scatter::default()
        };
        assert!(strange.placements(&[]).iter().all(|c| c.checked().is_some()));
        let many = Scatter { count: usize::MAX, ..Scatter::default() };
        assert_eq!(many.placements(&[Placement::at(0.0, 0.0); 3]).len(), MAX_COPIES);
    }
}
