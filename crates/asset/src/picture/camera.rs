//! Cameras of pictures.

use lodsmith_core::Bounds;
use lodsmith_render::{Camera, DVec3, Lens, StandardView, Subject};

use crate::error::{AssetError, usage};

/// Margin on each side of the subject, as a fraction of the image.
pub(super) const MARGIN: f64 = 0.06;

/// The box of a model without faces.
pub(super) const NO_BOUNDS: Bounds = Bounds { min: [0.0; 3], max: [1.0; 3] };

/// Direction and lens of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Viewpoint {
    /// Direction from which the camera looks.
    pub view: StandardView,
    /// Angle around the model from the front to the right, in degrees, instead of `view`.
    pub azimuth_deg: Option<f64>,
    /// Angle above the horizon, in degrees, instead of `view`.
    pub elevation_deg: Option<f64>,
    /// Vertical field of view, in degrees.
    pub fov_deg: Option<f64>,
    /// Use a parallel projection.
    pub parallel: bool,
}

impl Viewpoint {
    pub(super) fn check(&self) -> Result<(), AssetError> {
        if self.parallel && self.fov_deg.is_some() {
            return Err(usage("--fov needs a perspective projection: leave out --parallel"));
        }
        Ok(())
    }

    /// Returns a camera at a distance that shows the whole bounding box.
    pub(super) fn camera(&self, bounds: &Bounds, aspect: f64) -> Camera {
        let mut camera = Camera::fitting(bounds, self.view, aspect);
        if self.azimuth_deg.is_some() || self.elevation_deg.is_some() {
            // Angles that are not set are those of the default view.
            let default = StandardView::Iso.directions().0;
            let azimuth = self.azimuth_deg.map_or(default.x.atan2(default.z), f64::to_radians);
            let elevation = self.elevation_deg.map_or(default.y.asin(), f64::to_radians);
            let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.sin_cos(), elevation.sin_cos());
            let to_eye = [sin_a * cos_e, sin_e, cos_a * cos_e];
            let up = [-sin_a * sin_e, cos_e, -cos_a * sin_e];
            let distance = camera.distance();
            camera.eye = camera.target + distance * DVec3::from(to_eye);
            camera.up = up.into();
        }
        if let Some(fov) = self.fov_deg {
            camera.lens = Lens::Perspective { fov_y_rad: fov.to_radians() };
        }
        if self.parallel {
            camera.lens = Lens::Parallel { height: 1.0 };
        }
        camera.framing(bounds, aspect)
    }
}

/// Returns the ratio of width and height.
pub(super) fn aspect([width, height]: [usize; 2]) -> f64 {
    width as f64 / height as f64
}

/// Returns the default camera for a subject and an image of this size.
pub fn camera(subject: &Subject, size: [usize; 2]) -> Camera {
    let (bounds, aspect) = (subject.bounds().unwrap_or(NO_BOUNDS), aspect(size));
    subject.framed(Camera::fitting(&bounds, StandardView::Iso, aspect), aspect, MARGIN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_agree_with_the_standard_views() {
        let bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
        let near = |azimuth_deg, elevation_deg, view| {
            let viewpoint = Viewpoint { azimuth_deg, elevation_deg, ..Viewpoint::default() };
            let (a, b) = (viewpoint.camera(&bounds, 1.0), Camera::fitting(&bounds, view, 1.0));
            (a.eye - b.eye).length() < 1e-9 && (a.up_square() - b.up_square()).length() < 1e-9
        };
        assert!(near(Some(0.0), Some(0.0), StandardView::Front));
        assert!(near(Some(90.0), Some(0.0), StandardView::Right));
        assert!(near(Some(0.0), Some(90.0), StandardView::Top));
        assert!(near(Some(0.0), Some(-90.0), StandardView::Bottom));
        assert!(near(None, None, StandardView::Iso));
    }
}
