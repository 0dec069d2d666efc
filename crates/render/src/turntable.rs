//! Cameras that orbit a model.

use glam::{DQuat, DVec3};
use lodsmith_core::{Bounds, Positions, TriMesh, VertexId};

use crate::camera::{Camera, length};
use crate::subject::Subject;

/// Number of slices by height that the outline of a model is measured in. (Guessed: the picture is framed to a
/// hundredth of the height.)
const SLICES: usize = 128;
/// Number of corners of each ring of the outline.
const RING_CORNERS: usize = 48;

impl Camera {
    /// Returns the camera rotated around a vertical axis, to the right as seen from the camera.
    pub fn turned_around(self, axis: DVec3, angle_rad: f64) -> Self {
        let turn = DQuat::from_rotation_y(angle_rad);
        let moved = |p: DVec3| axis + turn * (p - axis);
        Self { eye: moved(self.eye), target: moved(self.target), up: turn * self.up, ..self }
    }
}

impl Subject {
    /// Returns the centre of the bounding box, whose vertical is the axis of a turntable; the origin if there
    /// is nothing.
    pub fn centre(&self) -> DVec3 {
        self.bounds().map_or(DVec3::ZERO, |b| 0.5 * DVec3::from(b.min) + 0.5 * DVec3::from(b.max))
    }

    /// Returns a camera like [`Subject::framed`] that keeps all of the subject in the picture as it orbits
    /// [`Subject::centre`] by [`Camera::turned_around`].
    ///
    /// Cost: O(n).
    pub fn framed_all_round(&self, camera: Camera, aspect: f64, margin: f64) -> Camera {
        match self.swept().and_then(|mesh| Self::of_mesh(mesh).ok()) {
            Some(swept) => swept.framed(camera, aspect, margin),
            None => camera,
        }
    }

    /// Returns points around everything that the subject sweeps as it turns: rings at the edges of slices.
    fn swept(&self) -> Option<TriMesh> {
        let Bounds { min, max } = self.bounds()?;
        let centre = self.centre();
        let height = max[1] - min[1];
        let mut radii = vec![None::<f64>; SLICES];
        self.for_each_corner(|p| {
            if p.is_finite() {
                let slice =
                    ((p.y - min[1]) / height * SLICES as f64).clamp(0.0, SLICES as f64 - 1.0) as usize;
                let radius = length((p - centre).with_y(0.0));
                radii[slice] = Some(radii[slice].map_or(radius, |r| r.max(radius)));
            }
        });
        // The ring is outside the circle.
        let widened = (std::f64::consts::PI / RING_CORNERS as f64).cos().recip();
        let mut rings = Vec::new();
        for (slice, radius) in radii.into_iter().enumerate().filter_map(|(i, r)| Some((i, r?))) {
            for edge in [slice, slice + 1] {
                let y = min[1] + height * edge as f64 / SLICES as f64;
                rings.extend((0..RING_CORNERS).map(|k| {
                    let angle = k as f64 / RING_CORNERS as f64 * std::f64::consts::TAU;
                    [centre.x + radius * widened * angle.cos(), y, centre.z + radius * widened * angle.sin()]
                }));
            }
        }
        let faces =
            (0..rings.len().saturating_sub(2)).map(|i| [i, i + 1, i + 2].map(VertexId::new)).collect();
        TriMesh::new(Positions::F64(rings), faces).ok()
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::{Model, shapes};

    use super::*;
    use crate::{StandardView, View, render};

    #[test]
    fn a_turn_keeps_distance_and_height_and_closes() {
        let bounds = Bounds { min: [1.0, 0.0, 0.0], max: [3.0, 1.0, 5.0] };
        let camera = Camera::fitting(&bounds, StandardView::Iso, 1.0);
        let axis = DVec3::new(2.0, 0.5, 2.5);
        let quarter = camera.turned_around(axis, std::f64::consts::FRAC_PI_2);
        assert!((quarter.distance() - camera.distance()).abs() < 1e-9);
        assert!((quarter.eye.y - camera.eye.y).abs() < 1e-9 && quarter.eye.distance(camera.eye) > 1.0);
        let front = Camera::fitting(&bounds, StandardView::Front, 1.0);
        let right = front.turned_around(axis, std::f64::consts::FRAC_PI_2);
        assert!(
            (right.eye - right.target).normalize_or_zero().distance(DVec3::X) < 1e-9,
            "the right side comes next"
        );
        let whole = camera.turned_around(axis, std::f64::consts::TAU);
        assert!(whole.eye.distance(camera.eye) < 1e-9);
    }

    /// A long box beside the origin touches the margin from one side, and is cut off from none.
    #[test]
    fn a_model_fits_from_every_side() {
        let mut mesh = shapes::cube(3);
        mesh.map_positions(|p| [4.0 * p[0] + 7.0, 0.5 * p[1], p[2]]);
        let subject = Subject::new(&Model::of_mesh(mesh)).unwrap();
        let bounds = subject.bounds().unwrap();
        for view in [StandardView::Iso, StandardView::Front, StandardView::Top] {
            let camera = Camera::fitting(&bounds, view, 1.5);
            let camera = subject.framed_all_round(camera, 1.5, 0.05);
            let mut widest = 0;
            for k in 0..12 {
                let angle = f64::from(k) * std::f64::consts::TAU / 12.0;
                let mut view = View::new(camera.turned_around(subject.centre(), angle), 120, 80);
                view.background = crate::Background::Transparent;
                let picture = render(&subject, &view).unwrap();
                let covered = |x: usize| (0..80).any(|y| picture.at(x, y)[3] > 0);
                assert!(!covered(0) && !covered(119), "{k}");
                assert!((0..120).all(|x| picture.at(x, 0)[3] == 0 && picture.at(x, 79)[3] == 0), "{k}");
                widest = widest.max((0..120).filter(|x| covered(*x)).count());
            }
            assert!(widest > 55, "{view:?}: the model is only {widest} of 120 pixels wide");
        }
    }

    #[test]
    fn nothing_to_see_changes_nothing() {
        let nothing = Subject::new(&Model::default()).unwrap();
        let camera = Camera::fitting(&Bounds { min: [0.0; 3], max: [1.0; 3] }, StandardView::Iso, 1.0);
        assert_eq!(nothing.framed_all_round(camera, 1.0, 0.1), camera);
    }
}
