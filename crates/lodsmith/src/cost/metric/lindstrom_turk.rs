//! Lindstrom-Turk metric: preserves volume and borders, from the current surface alone. [Lindstrom-Turk
//! 1998] [Lindstrom-Turk 1999]
//!
//! The position of the merged vertex is fixed by three linear equations, taken in this order as long as
//! each plane is more than a degree away from those before it: the volume is preserved; the area bounded by
//! a border is preserved; the sum of the squared volumes swept by faces and the squared areas swept by
//! border edges is least; the new edges are short. The cost is half that sum. It has the dimension of a
//! squared volume, and is divided by the mean area of the input here.
//!
//! The engine first evaluates tensors of n nᵀ weighted by area, which are roughly a lower bound of the
//! cost, and calls this module for edges that look cheap enough.

use glam::{DMat3, DVec3, Vec3};

use super::neighbourhood::BORDER_AREA_WEIGHT;
use super::{AllowedPlace, CostSource, Dimension, EdgeNeighbourhood, EdgePart, NeighbourhoodMetric};
use crate::cost::TIE;

pub(crate) const LINDSTROM_TURK: NeighbourhoodMetric = NeighbourhoodMetric {
    cost_source: CostSource::FormThenStars,
    evaluate,
    // One more factor of area than in the memoryless tensors.
    cost_factor_exponent: 1.4,
    // (0.32 to 0.49: positions between the removed faces halve the distances.)
    squared_rms_factor: 0.42,
    // Squared volumes, divided by an area.
    dimension: Dimension { length: 6, face: 1 },
    part_cost_per_face_pair: |rate, part, mean| rate * part.face / mean,
};

/// Sine of the least angle between the planes, one degree. [Lindstrom-Turk 1998]
const MIN_ANGLE_SINE: f64 = 0.017_452_406_437_283_51;
/// Share of the trace below which a gradient is rounding noise: positions have single precision.
const GRADIENT_NOISE_SHARE: f64 = 1e-10;
/// Share of the length of all normals below which their sum is rounding noise.
const MIN_NORMAL_SUM_SHARE: f64 = 1e-6;

/// Returns cost and displacement.
fn evaluate(around: &EdgeNeighbourhood, mean: f32) -> Option<(f32, Vec3)> {
    let loss = Loss::new(around);
    let step = match around.place {
        AllowedPlace::Anywhere => loss.best_place(around),
        AllowedPlace::Middle => around.d * 0.5,
        AllowedPlace::Kept => DVec3::ZERO,
        AllowedPlace::Removed => around.d,
        AllowedPlace::Ends if loss.at(around.d) < loss.at(DVec3::ZERO) => around.d,
        AllowedPlace::Ends => DVec3::ZERO,
    };
    let off = step - around.d;
    let tie = f64::from(TIE) * 0.5 * loss.trace() * (step.length_squared() + off.length_squared());
    Some((((loss.at(step) + tie) / f64::from(mean)) as f32, step.as_vec3()))
}

/// The sum of squares y·A·y − 2 h·y + c, 36 times the sum of squared volumes, and the volume constraint.
struct Loss {
    a: DMat3,
    h: DVec3,
    c: f64,
    /// The volume is preserved where volume · y equals this number.
    volume: (DVec3, f64),
}

impl Loss {
    fn new(around: &EdgeNeighbourhood) -> Self {
        let d = around.d;
        // (xx, yy, zz) and (xy, xz, yz), by component: no column is computed twice.
        let (mut squares, mut products) = (DVec3::ZERO, DVec3::ZERO);
        let (mut h, mut c) = (DVec3::ZERO, 0.0);
        let (mut sum, mut level) = (DVec3::ZERO, 0.0);
        for wall in &around.triangles {
            let n = (wall.b - wall.a).cross(around.end(wall.at) - wall.a);
            squares += n * n;
            products += DVec3::new(n.x * n.y, n.x * n.z, n.y * n.z);
            sum += n;
            if wall.at == EdgePart::Removed {
                let k = n.dot(d);
                h += n * k;
                c += k * k;
                level += k;
            }
        }
        for line in &around.lines {
            let from = around.end(line.at);
            let e = line.to - from;
            let weight = BORDER_AREA_WEIGHT * line.weight * d.length_squared();
            let add = (DVec3::splat(e.length_squared()) - e * e) * weight;
            let mixed = DVec3::new(e.x * e.y, e.x * e.z, e.y * e.z) * -weight;
            squares += add;
            products += mixed;
            if line.at == EdgePart::Removed {
                let to_line = matrix(add, mixed) * d;
                h += to_line;
                c += d.dot(to_line);
            }
        }
        Self { a: matrix(squares, products), h, c, volume: (sum, level) }
    }

    fn trace(&self) -> f64 {
        self.a.x_axis.x + self.a.y_axis.y + self.a.z_axis.z
    }

    fn at(&self, y: DVec3) -> f64 {
        (y.dot(self.a * y) - 2.0 * self.h.dot(y) + self.c).max(0.0)
    }

    fn best_place(&self, around: &EdgeNeighbourhood) -> DVec3 {
        let mut pins = Pins::default();
        pins.pin(self.volume.0, self.volume.1, MIN_NORMAL_SUM_SHARE * self.trace().sqrt());
        if !around.lines.is_empty() {
            pin_border(&mut pins, around);
        }
        let least = GRADIENT_NOISE_SHARE * self.trace();
        for q in pins.rest().into_iter().flatten() {
            pins.pin(self.a * q, q.dot(self.h), least);
        }
        if pins.count < 3 {
            let centre = middle_of_rim(around);
            for q in pins.rest().into_iter().flatten() {
                pins.pin(q, q.dot(centre), 0.0);
            }
        }
        pins.place()
    }
}

/// Pins the position to preserve the area vector bounded by the border. It changes by half of e × (y − p)
/// for each of the border edges e at p. The components across the sum of e can be preserved; the component
/// along it is the same for all y.
fn pin_border(pins: &mut Pins, around: &EdgeNeighbourhood) {
    let (mut along, mut moment, mut size_sq) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for line in around.lines.iter().filter(|l| l.sense != 0.0) {
        let from = around.end(line.at);
        let e = (line.to - from) * line.sense;
        along += e;
        moment += e.cross(from);
        size_sq += e.length_squared();
    }
    let length_sq = along.length_squared();
    if length_sq <= 1e-12 * size_sq {
        return;
    }
    let nearest = moment.cross(along) / length_sq;
    let out = moment - along * (moment.dot(along) / length_sq);
    // Across the border within its plane; for a straight one, any direction across.
    let across = out.cross(along);
    let least = 1e-6 * size_sq * along.length();
    let first = if across.length() > least { across } else { along.any_orthogonal_vector() };
    pins.pin(first, first.dot(nearest), 0.0);
    let second = along.cross(first);
    pins.pin(second, second.dot(nearest), 0.0);
}

/// Returns the point with the least sum of squared distances to the rim of the star, where each face counts
/// its two edges.
fn middle_of_rim(around: &EdgeNeighbourhood) -> DVec3 {
    let rim = around.triangles.iter().filter(|w| w.at != EdgePart::Both);
    let (sum, count) = rim.fold((DVec3::ZERO, 0.0), |(sum, n), w| (sum + w.a + w.b, n + 2.0));
    if count > 0.0 { sum / count } else { around.d * 0.5 }
}

fn matrix(squares: DVec3, products: DVec3) -> DMat3 {
    let (s, p) = (squares, products);
    DMat3::from_cols(DVec3::new(s.x, p.x, p.y), DVec3::new(p.x, s.y, p.z), DVec3::new(p.y, p.z, s.z))
}

/// Planes that fix a position, orthogonalized.
#[derive(Default)]
struct Pins {
    axes: [DVec3; 3],
    at: [f64; 3],
    count: usize,
}

impl Pins {
    /// Adds the plane n·y = level, unless there are three already, n is no longer than `least`, or the
    /// plane is within a degree of the span of the others.
    fn pin(&mut self, n: DVec3, level: f64, least: f64) {
        let length = n.length();
        if self.count == 3 || length <= least || length == 0.0 {
            return;
        }
        let (mut rest, mut level) = (n / length, level / length);
        for k in 0..self.count {
            let along = rest.dot(self.axes[k]);
            rest -= self.axes[k] * along;
            level -= self.at[k] * along;
        }
        let left = rest.length();
        if left > MIN_ANGLE_SINE {
            (self.axes[self.count], self.at[self.count]) = (rest / left, level / left);
            self.count += 1;
        }
    }

    /// Returns the directions that are still free.
    fn rest(&self) -> [Option<DVec3>; 3] {
        match self.count {
            0 => [Some(DVec3::X), Some(DVec3::Y), Some(DVec3::Z)],
            1 => {
                let (a, b) = self.axes[0].any_orthonormal_pair();
                [Some(a), Some(b), None]
            }
            2 => [Some(self.axes[0].cross(self.axes[1])), None, None],
            _ => [None; 3],
        }
    }

    fn place(&self) -> DVec3 {
        (0..self.count).map(|k| self.axes[k] * self.at[k]).sum()
    }
}
