//! Cameras and standard views.

use glam::{DMat4, DVec3};
use lodsmith_core::Bounds;

/// A camera: right-handed, looking along -z, y up in its own coordinates. Lengths are in model units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the camera.
    pub eye: DVec3,
    /// The point that it looks at, and orbits around.
    pub target: DVec3,
    /// Up direction; not parallel to the view.
    pub up: DVec3,
    /// Projection.
    pub lens: Lens,
}

/// Kind of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Perspective projection.
    Perspective {
        /// Vertical angle of view.
        fov_y_rad: f64,
    },
    /// Parallel projection.
    Parallel {
        /// Height of the view volume.
        height: f64,
    },
}

/// Named views. The model's up is +y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StandardView {
    /// From the front right, above.
    #[default]
    Iso,
    /// Along -z.
    Front,
    /// Along +z.
    Back,
    /// Along +x.
    Left,
    /// Along -x.
    Right,
    /// Along -y.
    Top,
    /// Along +y.
    Bottom,
}

/// Default vertical angle of view: 35 degrees, as of a portrait lens; wider ones distort near parts.
const FOV_Y_RAD: f64 = 0.611;

impl StandardView {
    /// All views.
    pub const ALL: [Self; 7] =
        [Self::Iso, Self::Front, Self::Back, Self::Left, Self::Right, Self::Top, Self::Bottom];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Iso => "iso",
            Self::Front => "front",
            Self::Back => "back",
            Self::Left => "left",
            Self::Right => "right",
            Self::Top => "top",
            Self::Bottom => "bottom",
        }
    }

    /// Returns the directions from the target to the eye, and up; both of unit length.
    pub fn directions(self) -> (DVec3, DVec3) {
        match self {
            Self::Iso => (DVec3::new(0.55, 0.42, 0.72).normalize_or(DVec3::Z), DVec3::Y),
            Self::Front => (DVec3::Z, DVec3::Y),
            Self::Back => (DVec3::NEG_Z, DVec3::Y),
            Self::Left => (DVec3::NEG_X, DVec3::Y),
            Self::Right => (DVec3::X, DVec3::Y),
            Self::Top => (DVec3::Y, DVec3::NEG_Z),
            Self::Bottom => (DVec3::NEG_Y, DVec3::Z),
        }
    }
}

impl Camera {
    /// Makes a camera whose view fits a box into a picture of `aspect` (width over height), however the box
    /// is rotated.
    pub fn fitting(bounds: &Bounds, view: StandardView, aspect: f64) -> Self {
        let (to_eye, up) = view.directions();
        let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
        let target = 0.5 * min + 0.5 * max;
        let lens = Lens::Perspective { fov_y_rad: FOV_Y_RAD };
        Self { eye: target + to_eye, target, up, lens }.framing(bounds, aspect)
    }

    /// Moves the camera, with the same direction and lens, so that the bounding sphere of a box fills a
    /// picture of `aspect`.
    pub fn framing(self, bounds: &Bounds, aspect: f64) -> Self {
        let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
        let target = 0.5 * min + 0.5 * max;
        // Halved first: the box may be as large as a double allows. A single point gets some space too.
        let radius = length(0.5 * max - 0.5 * min).max(1e-12 * length(target)).max(1e-290);
        let narrow = aspect.min(1.0);
        let to_eye = unit(self.eye - self.target).unwrap_or(DVec3::Z);
        match self.lens {
            Lens::Perspective { fov_y_rad } => {
                let half = (narrow * (0.5 * fov_y_rad).tan()).atan();
                Self { eye: target + to_eye * (radius / half.sin()), target, ..self }
            }
            Lens::Parallel { .. } => {
                let lens = Lens::Parallel { height: 2.0 * radius / narrow };
                Self { eye: target + to_eye * (2.0 * radius), target, lens, ..self }
            }
        }
    }

    /// Returns the right, up and back directions of the camera: orthonormal.
    pub fn axes(&self) -> [DVec3; 3] {
        let back = unit(self.eye - self.target).unwrap_or(DVec3::Z);
        let up = self.up_square();
        [up.cross(back), up, back]
    }

    /// Returns the transform from model to camera coordinates.
    pub fn view_from_world(&self) -> DMat4 {
        let up = self.up_square();
        glam::dcamera::rh::view::look_at_mat4(self.eye, self.target, up)
    }

    /// Returns the up direction perpendicular to the view, of unit length, whatever `up` is.
    pub fn up_square(&self) -> DVec3 {
        let along = unit(self.target - self.eye).unwrap_or(DVec3::NEG_Z);
        let square = |up: DVec3| unit(up).and_then(|up| (up - along * along.dot(up)).try_normalize());
        square(self.up).or_else(|| square(DVec3::Y)).or_else(|| square(DVec3::Z)).unwrap_or(DVec3::Y)
    }

    /// Returns the distance from the eye to the target.
    pub fn distance(&self) -> f64 {
        length(self.eye - self.target)
    }

    /// Returns the length in the model that one pixel covers at a distance from the eye, in a picture of
    /// height `height_px`.
    pub fn length_per_pixel(&self, distance: f64, height_px: f64) -> f64 {
        let height = match self.lens {
            Lens::Perspective { fov_y_rad } => 2.0 * distance * (0.5 * fov_y_rad).tan(),
            Lens::Parallel { height } => height,
        };
        height / height_px.max(1.0)
    }
}

/// Returns the length of a vector without overflow or underflow: the square of 1e200 overflows a double.
pub(crate) fn length(v: DVec3) -> f64 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { largest * (v / largest).length() } else { largest }
}

/// Normalizes a vector without overflow or underflow.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).try_normalize() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_fits_from_everywhere() {
        let bounds = Bounds { min: [-1.0, 2.0, 3.0], max: [5.0, 4.0, 3.5] };
        for view in StandardView::ALL {
            for aspect in [0.5, 1.0, 2.0] {
                let camera = Camera::fitting(&bounds, view, aspect);
                let Lens::Perspective { fov_y_rad } = camera.lens else { panic!("{:?}", camera.lens) };
                let slope = (0.5 * fov_y_rad).tan();
                for corner in 0..8 {
                    let pick = |k: usize| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] };
                    let p = camera.view_from_world().transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
                    assert!(p.z < 0.0, "{view:?}: {p} is behind the eye");
                    assert!(p.y.abs() <= -p.z * slope * 1.0001, "{view:?} {aspect}: {p} is above or below");
                    assert!(p.x.abs() <= -p.z * slope * aspect * 1.0001, "{view:?} {aspect}: {p} is beside");
                }
            }
        }
    }
}
