//! Ambient occlusion by rays.

use std::f32::consts::TAU;

use glam::{DVec3, Vec3};

use crate::occluders::Occluders;

/// Number of sets of directions; each texel uses one of them, rotated.
const SETS: usize = 64;
/// The start of a ray is lifted off the surface by this fraction of the diagonal. (Guessed: some sixteen rounding
/// errors of the tree, which has single precision, and far below any detail.)
const LIFT: f64 = 1e-6;

/// Directions of rays.
pub(crate) struct Rays {
    /// Cosine-weighted directions around the z axis, set after set.
    directions: Vec<Vec3>,
    count: usize,
    seed: u64,
    length: f64,
    lift: f64,
}

impl Rays {
    /// Makes directions with `count` rays for each sample; faces beyond `distance` do not occlude.
    pub(crate) fn new(count: usize, distance: Option<f64>, seed: u64, diagonal: f64) -> Self {
        let mut directions = Vec::with_capacity(SETS * count);
        for set in 0..SETS {
            for i in 0..count {
                // Stratified in height, by the golden ratio around the axis; each set is shifted at random.
                let shift = unit(mixed(seed ^ (set as u64) << 32 | 1));
                let turn = unit(mixed(seed ^ (set as u64) << 32 | 2));
                let height = ((i as f32 + shift) / count as f32).min(0.999_999);
                let around = (i as f32 * 0.618_034 + turn).fract() * TAU;
                let radius = height.sqrt();
                let (s, c) = libm::sincosf(around);
                directions.push(Vec3::new(radius * c, radius * s, (1.0 - height).sqrt()));
            }
        }
        let length = distance.unwrap_or(2.0 * diagonal).min(2.0 * diagonal);
        Self { directions, count, seed, length, lift: LIFT * diagonal }
    }

    /// Returns the share of the rays from a point that are not blocked. `key` selects the directions; `flat` is the
    /// normal of the face, below which no ray begins.
    pub(crate) fn open_share(
        &self,
        occluders: &Occluders,
        place: &Place,
        key: u64,
        latest: &mut Latest,
    ) -> f32 {
        let Place { point, normal, flat } = *place;
        let hash = mixed(self.seed ^ key);
        let set = hash as usize % SETS;
        let (s, c) = libm::sincosf(unit(mixed(hash)) * TAU);
        let (x, y) = normal.any_orthonormal_pair();
        let origin = point + flat * self.lift;
        let flat = flat.as_vec3();
        let mut open = 0;
        for d in &self.directions[set * self.count..][..self.count] {
            let turned = Vec3::new(d.x * c - d.y * s, d.x * s + d.y * c, d.z);
            let mut direction = x * turned.x + y * turned.y + normal * turned.z;
            let below = direction.dot(flat);
            if below < 0.0 {
                // With a smooth normal a ray may point below its face: it is mirrored to above.
                direction -= flat * (2.0 * below);
            }
            let ray = occluders.ray(origin, direction, self.length);
            open += u32::from(!occluders.is_blocked(&ray, latest.of(direction)));
        }
        open as f32 / self.count as f32
    }
}

/// A point whose occlusion is computed.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) point: DVec3,
    /// The direction around which rays are spread.
    pub(crate) normal: Vec3,
    /// The normal of the face.
    pub(crate) flat: DVec3,
}

/// The leaf of the tree that blocked the latest ray of each direction; the next such ray tries it first.
pub(crate) struct Latest([u32; Self::CELLS * Self::CELLS * Self::CELLS]);

impl Latest {
    /// Cells along each axis of the directions.
    const CELLS: usize = 8;

    pub(crate) fn new() -> Self {
        Self([u32::MAX; Self::CELLS * Self::CELLS * Self::CELLS])
    }
    fn of(&mut self, direction: Vec3) -> &mut u32 {
        let cell = |x: f32| (((x + 1.0) * (Self::CELLS as f32 / 2.0)) as usize).min(Self::CELLS - 1);
        let [x, y, z] = direction.to_array().map(cell);
        &mut self.0[(x * Self::CELLS + y) * Self::CELLS + z]
    }
}

/// Source: [Steele 2014].
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

fn unit(x: u64) -> f32 {
    (x >> 40) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn a_sphere_is_unoccluded_and_a_floor_below_a_lid_is_occluded() {
        let ball = shapes::icosphere(4);
        let at = |v| DVec3::from(ball.positions().view().get(v));
        let corners: Vec<[DVec3; 3]> = ball.surface().triangles().iter().map(|t| t.map(at)).collect();
        let tree = Occluders::new(&corners, &ball.positions().view().bounds().unwrap());
        let rays = Rays::new(64, None, 0, 3.5);
        let share = |rays: &Rays, point: DVec3, flat: DVec3| {
            let place = Place { point, normal: flat.as_vec3(), flat };
            rays.open_share(&tree, &place, 7, &mut Latest::new())
        };
        let at = |point: DVec3, flat: DVec3| share(&rays, point, flat);
        assert_eq!(at(DVec3::Z * 1.001, DVec3::Z), 1.0);
        // A point under the ball at a distance of two radii: the ball covers sin² of 30° of the cosine-weighted sky.
        let below = at(DVec3::Z * -2.0, DVec3::Z);
        assert!((below - 0.75).abs() < 0.04, "{below}");
        // From within, everything is covered, unless the walls are too far away.
        assert_eq!(at(DVec3::ZERO, DVec3::X), 0.0);
        let short = Rays::new(64, Some(0.5), 0, 3.5);
        assert_eq!(share(&short, DVec3::ZERO, DVec3::X), 1.0);
    }
}
