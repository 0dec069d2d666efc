//! Where one looks from, and through which lens.

use glam::{DMat4, DVec3};
use lodsmith_core::Bounds;

/// A camera: right-handed, looking along -z, y up in its own coordinates. Lengths are those of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at, and turns round.
    pub target: DVec3,
    /// Which way is up; not along the view.
    pub up: DVec3,
    /// Through which lens.
    pub lens: Lens,
}

/// How far lies become small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// What is far is small.
    Perspective {
        /// Angle from the lower to the upper edge.
        fov_y_rad: f64,
    },
    /// What is far is as large as what is near.
    Parallel {
        /// Length from the lower to the upper edge.
        height: f64,
    },
}

/// Views that have a name. The model's up is +y.
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

/// Angle of view where none is asked for: 35 degrees, as of a portrait lens; wider ones bend what is near.
const FOV_Y_RAD: f64 = 0.611;

impl StandardView {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Iso, Self::Front, Self::Back, Self::Left, Self::Right, Self::Top, Self::Bottom];

    /// Its name as one types it.
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

    /// From the target to the eye, and which way is up; unit length both.
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
    /// A camera from whose view a box just fits into a picture of `aspect` (width over height), whichever way it is turned.
    pub fn fitting(bounds: &Bounds, view: StandardView, aspect: f64) -> Self {
        let (to_eye, up) = view.directions();
        let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
        let target = 0.5 * min + 0.5 * max;
        let lens = Lens::Perspective { fov_y_rad: FOV_Y_RAD };
        Self { eye: target + to_eye, target, up, lens }.framing(bounds, aspect)
    }

    /// The same direction and lens, moved so that a ball round the box fills a picture of `aspect`.
    pub fn framing(self, bounds: &Bounds, aspect: f64) -> Self {
        let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
        let target = 0.5 * min + 0.5 * max;
        // Halves first: the box may be as large as numbers go. A point has room round it too.
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

    /// The directions to the right, up and back, as the camera stands: unit length, square to each other.
    pub fn axes(&self) -> [DVec3; 3] {
        let back = unit(self.eye - self.target).unwrap_or(DVec3::Z);
        let up = self.up_square();
        [up.cross(back), up, back]
    }

    /// From the coordinates of the model to those of the camera.
    pub fn view_from_world(&self) -> DMat4 {
        let up = self.up_square();
        glam::dcamera::rh::view::look_at_mat4(self.eye, self.target, up)
    }

    /// Up as seen in the picture: square to the view, unit length, whatever `up` says.
    pub fn up_square(&self) -> DVec3 {
        let along = unit(self.target - self.eye).unwrap_or(DVec3::NEG_Z);
        let square = |up: DVec3| unit(up).and_then(|up| (up - along * along.dot(up)).try_normalize());
        square(self.up).or_else(|| square(DVec3::Y)).or_else(|| square(DVec3::Z)).unwrap_or(DVec3::Y)
    }

    /// Distance from the eye to the target.
    pub fn distance(&self) -> f64 {
        length(self.eye - self.target)
    }

    /// Length in the model that one pixel of a picture of this height covers, at a distance from the eye.
    pub fn length_per_pixel(&self, distance: f64, height_px: f64) -> f64 {
        let height = match self.lens {
            Lens::Perspective { fov_y_rad } => 2.0 * distance * (0.5 * fov_y_rad).tan(),
            Lens::Parallel { height } => height,
        };
        height / height_px.max(1.0)
    }
}

/// Length, however large or small the numbers are: the square of 1e200 is not a number that a double holds.
pub(crate) fn length(v: DVec3) -> f64 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { largest * (v / largest).length() } else { largest }
}

/// A direction of unit length, however large or small the numbers are.
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
