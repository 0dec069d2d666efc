//! The camera that shows points as large as a picture allows.

use glam::DVec3;
use lodsmith_core::Bounds;

use crate::camera::{Camera, Lens};

/// Collects points, and moves a camera so that they fill a picture.
///
/// Points can be collected in any order and on several threads: the result is the same.
#[derive(Clone, Copy, Debug)]
pub struct Framing {
    camera: Camera,
    aspect: f64,
    room: f64,
    /// Unit of length: the distance of the camera.
    unit: f64,
    /// Half the height of the view volume: per unit of depth, or absolute for a parallel projection.
    height: f64,
    slopes: [f64; 2],
    axes: [DVec3; 3],
    /// Distance by which each side of the picture must move outwards: right, left, up, down; then the nearest
    /// depth.
    sides: [f64; 5],
}

const NO_SIDES: [f64; 5] = [f64::NEG_INFINITY; 5];

impl Framing {
    /// Starts with no points. Direction and lens are taken from `camera`; `aspect` is width over height, `margin` stays
    /// free on each side, as a fraction of the picture. `bounds` is a box around all points.
    pub fn new(camera: Camera, bounds: &Bounds, aspect: f64, margin: f64) -> Self {
        let camera = camera.framing(bounds, aspect);
        let room = 1.0 - 2.0 * margin.clamp(0.0, 0.45);
        let unit = camera.distance();
        let height = match camera.lens {
            Lens::Perspective { fov_y_rad } => (0.5 * fov_y_rad).tan(),
            Lens::Parallel { height } => 0.5 * height / unit,
        };
        let slopes = match camera.lens {
            Lens::Perspective { .. } => [height * aspect * room, height * room],
            Lens::Parallel { .. } => [0.0; 2],
        };
        Self { camera, aspect, room, unit, height, slopes, axes: camera.axes(), sides: NO_SIDES }
    }

    /// Adds a point; one that is not finite is ignored.
    #[must_use]
    pub fn with(self, p: DVec3) -> Self {
        // The target is subtracted first, and everything divided, to avoid overflow.
        let p = (p - self.camera.target) / self.unit;
        if !p.is_finite() {
            return self;
        }
        let [right, up, back] = self.axes;
        let (x, y, z) = (p.dot(right), p.dot(up), p.dot(back));
        let [sx, sy] = [self.slopes[0] * z, self.slopes[1] * z];
        self.outside([x + sx, -x + sx, y + sy, -y + sy, z])
    }

    /// Adds the points of another framing that was started in the same way.
    #[must_use]
    pub fn merged(self, other: Self) -> Self {
        self.outside(other.sides)
    }

    fn outside(self, sides: [f64; 5]) -> Self {
        Self { sides: [0, 1, 2, 3, 4].map(|k| self.sides[k].max(sides[k])), ..self }
    }

    /// Returns the camera; without points, a camera that shows the bounding sphere of the box.
    pub fn camera(&self) -> Camera {
        let (camera, unit, room) = (self.camera, self.unit, self.room);
        if !self.sides.iter().all(|s| s.is_finite()) {
            return camera;
        }
        let [right, up, back] = self.axes;
        let [right_side, left, upper, lower, nearest] = self.sides;
        let (across, along) = (0.5 * (right_side - left), 0.5 * (upper - lower));
        let aside = (right * across + up * along) * unit;
        match camera.lens {
            Lens::Perspective { .. } => {
                let widths = [right_side + left, upper + lower];
                let away = [0, 1].map(|k| 0.5 * (widths[k] / self.slopes[k]));
                // Not closer than the nearest point, however thin the subject is.
                let away = away[0].max(away[1]).max(nearest + 0.05);
                let target = camera.target + aside;
                Camera { eye: target + back * (away * unit), target, ..camera }
            }
            Lens::Parallel { .. } => {
                let wanted = ((right_side + left) / self.aspect).max(upper + lower) / room * unit;
                let usual = 2.0 * self.height * unit;
                let lens = Lens::Parallel { height: if wanted > 0.0 { wanted } else { usual } };
                Camera { eye: camera.eye + aside, target: camera.target + aside, lens, ..camera }
            }
        }
    }
}
