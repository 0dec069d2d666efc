//! Where one looks from, and how the mouse changes that.

use std::f64::consts::{FRAC_PI_2, TAU};

use eframe::egui::{self, PointerButton, Rect, Response, Vec2};
use glam::{DMat4, DQuat, DVec3};
use lodsmith_core::model::{Deformed, Pose as ModelPose};
use lodsmith_core::{Bounds, Model, PositionsView, TriMesh, WedgeId};
use lodsmith_render::{Camera, Lens, StandardView};
use rayon::prelude::*;

/// A camera on a ball round a place: it never rolls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What it looks at.
    pub target: DVec3,
    /// Round the upright axis; 0 looks along -z.
    pub yaw_rad: f64,
    /// How high; a quarter turn looks straight down.
    pub pitch_rad: f64,
    /// How far.
    pub distance: f64,
    /// Angle from the lower to the upper edge.
    pub fov_y_rad: f64,
}

/// Turn for a point of movement: half a turn over 600 points.
const TURN_PER_POINT: f64 = std::f64::consts::PI / 600.0;
/// Turn by a key.
pub const KEY_TURN_RAD: f64 = TAU / 24.0;

impl Orbit {
    /// One from whose view a box just fits.
    pub fn fitting(bounds: &Bounds, view: StandardView, aspect: f64) -> Self {
        Self::of(&Camera::fitting(bounds, view, aspect))
    }

    /// The one that looks as this camera does; what it rolled is lost.
    pub fn of(camera: &Camera) -> Self {
        let away = camera.eye - camera.target;
        let distance = away.length().max(1e-30);
        let to_eye = away / distance;
        let pitch_rad = to_eye.y.clamp(-1.0, 1.0).asin();
        // Straight from above the yaw is that of the upper edge.
        let flat = if to_eye.y.abs() > 0.99999 { -camera.up_square() * to_eye.y.signum() } else { to_eye };
        let yaw_rad = flat.x.atan2(flat.z);
        let fov_y_rad = match camera.lens {
            Lens::Perspective { fov_y_rad } => fov_y_rad,
            Lens::Parallel { height } => 2.0 * (0.5 * height / distance).atan(),
        };
        Self { target: camera.target, yaw_rad, pitch_rad, distance, fov_y_rad }
    }

    /// As a camera.
    pub fn camera(&self) -> Camera {
        let ((sin_yaw, cos_yaw), (sin_pitch, cos_pitch)) = (self.yaw_rad.sin_cos(), self.pitch_rad.sin_cos());
        let to_eye = DVec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
        // Square to the view everywhere, at the poles too.
        let up = DVec3::new(-sin_pitch * sin_yaw, cos_pitch, -sin_pitch * cos_yaw);
        let lens = Lens::Perspective { fov_y_rad: self.fov_y_rad };
        Camera { eye: self.target + to_eye * self.distance, target: self.target, up, lens }
    }

    /// Turns round what it looks at.
    pub fn turn(&mut self, right_rad: f64, up_rad: f64) {
        self.yaw_rad = (self.yaw_rad + right_rad).rem_euclid(TAU);
        self.pitch_rad = (self.pitch_rad + up_rad).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Moves sideways by points of a picture so many points high.
    pub fn pan(&mut self, by: Vec2, height: f32) {
        let camera = self.camera();
        let step = camera.length_per_pixel(self.distance, f64::from(height));
        let right = (self.target - camera.eye).cross(camera.up).normalize_or(DVec3::X);
        self.target += (camera.up * f64::from(by.y) - right * f64::from(by.x)) * step;
    }

    /// Comes nearer by a factor; what is `off` points from the middle stays there.
    pub fn zoom(&mut self, factor: f64, off: Vec2, height: f32) {
        let factor = factor.clamp(0.02, 50.0);
        self.pan(off * (1.0 - 1.0 / factor as f32) * -1.0, height);
        self.distance /= factor;
    }

    /// The same direction, and all of the box in sight.
    pub fn frame(&mut self, bounds: &Bounds, aspect: f64) {
        *self = Self::of(&self.camera().framing(bounds, aspect));
    }

    /// What the mouse does over a picture. Whether anything changed.
    pub fn interact(&mut self, response: &Response, rect: Rect) -> bool {
        let before = *self;
        let input = response
            .ctx
            .input(|i| (i.modifiers, i.smooth_scroll_delta().y, i.zoom_delta(), i.pointer.hover_pos()));
        let (modifiers, scroll, pinch, pointer) = input;
        let drag = response.drag_delta();
        let is_panning = response.dragged_by(PointerButton::Middle)
            || response.dragged_by(PointerButton::Secondary)
            || (response.dragged_by(PointerButton::Primary) && modifiers.shift);
        if is_panning {
            self.pan(drag, rect.height());
        } else if response.dragged_by(PointerButton::Primary) && !modifiers.alt {
            let turn = |points: f32| f64::from(points) * TURN_PER_POINT;
            self.turn(-turn(drag.x), turn(drag.y));
        }
        if let Some(pointer) = pointer.filter(|_| response.contains_pointer()) {
            let factor = f64::from(pinch) * f64::from(scroll * 0.0022).exp();
            if (factor - 1.0).abs() > 1e-6 {
                self.zoom(factor, pointer - rect.center(), rect.height());
            }
        }
        *self != before
    }
}

/// The view with this number among the standard ones.
pub fn standard(number: usize) -> StandardView {
    StandardView::ALL[number.min(StandardView::ALL.len() - 1)]
}

/// The box round a model that was turned about the middle of its own box.
pub fn turned_bounds(bounds: &Bounds, turn: DQuat) -> Bounds {
    moved_bounds(bounds, &turn_matrix(bounds, turn))
}

/// The box round a box that was moved.
pub fn moved_bounds(bounds: &Bounds, matrix: &DMat4) -> Bounds {
    if *matrix == DMat4::IDENTITY {
        return *bounds;
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8 {
        let pick = |k: usize| if corner >> k & 1 == 0 { bounds.min[k] } else { bounds.max[k] };
        let p = matrix.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        (min, max) = (min.min(p), max.max(p));
    }
    Bounds { min: min.to_array(), max: max.to_array() }
}

/// A turn about the middle of a box.
pub fn turn_matrix(bounds: &Bounds, turn: DQuat) -> DMat4 {
    if turn == DQuat::IDENTITY {
        return DMat4::IDENTITY;
    }
    let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
    let middle = 0.5 * (min + max);
    DMat4::from_translation(middle) * DMat4::from_quat(turn) * DMat4::from_translation(-middle)
}

/// The place on a model that lies first along a ray, in the coordinates of the world.
///
/// Cost: O(triangles), on all threads; 4 M take some 20 ms.
pub fn pick(
    model: &Model,
    pose: &ModelPose,
    world_from_model: DMat4,
    eye: DVec3,
    along: DVec3,
) -> Option<DVec3> {
    let (world_from_nodes, mut deformed) = (model.world_from_nodes(pose), Deformed::default());
    let hits = model.instances(pose).into_iter().filter_map(|instance| {
        let is_deformed = model.deform(&instance, pose, &world_from_nodes, &mut deformed);
        let placed = if is_deformed { deformed.world_from_mesh } else { instance.world_from_mesh };
        let mesh_from_world = (world_from_model * placed).inverse();
        if !mesh_from_world.is_finite() {
            return None;
        }
        let from = mesh_from_world.transform_point3(eye);
        let ray = mesh_from_world.transform_vector3(along);
        let mesh = &model.meshes[instance.mesh].mesh;
        if is_deformed {
            let places = deformed.positions.as_slice();
            return nearest(mesh, from, ray, |w| DVec3::from(places[w.index()].map(f64::from)));
        }
        nearest(mesh, from, ray, |w| match mesh.positions().view() {
            PositionsView::F32(p) => DVec3::from(p[mesh.vertex_of(w).index()].map(f64::from)),
            PositionsView::F64(p) => DVec3::from(p[mesh.vertex_of(w).index()]),
        })
    });
    hits.min_by(f64::total_cmp).map(|t| eye + along * t)
}

/// How far along a ray a mesh is hit first, whose corners are there.
fn nearest(mesh: &TriMesh, from: DVec3, ray: DVec3, at: impl Fn(WedgeId) -> DVec3 + Sync) -> Option<f64> {
    let hit = |t: &[WedgeId; 3]| first_hit(from, ray, t.map(&at));
    mesh.triangles().par_iter().filter_map(hit).min_by(f64::total_cmp)
}

/// How far along a ray a triangle is hit, from whichever side. [Möller-Trumbore 1997]
fn first_hit(from: DVec3, ray: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (e, f) = (b - a, c - a);
    let p = ray.cross(f);
    let det = e.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = from - a;
    let u = s.dot(p) / det;
    let q = s.cross(e);
    let v = ray.dot(q) / det;
    let t = f.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

/// The direction from the eye through a place of the picture, `off` points from its middle.
pub fn ray(camera: &Camera, off: Vec2, height: f32) -> DVec3 {
    let step = camera.length_per_pixel(camera.distance(), f64::from(height));
    let forward = camera.target - camera.eye;
    let up = camera.up_square();
    let right = forward.cross(up).normalize_or(DVec3::X);
    (forward + (right * f64::from(off.x) - up * f64::from(off.y)) * step).normalize_or(DVec3::NEG_Z)
}

/// Width over height.
pub fn aspect(rect: Rect) -> f64 {
    f64::from(rect.width().max(1.0)) / f64::from(rect.height().max(1.0))
}

/// A picture's place, drawn with a name that tests and screen readers find.
pub fn place(ui: &mut egui::Ui, rect: Rect, name: &'static str) -> Response {
    let response = ui.interact(rect, ui.scope_id().with(name), egui::Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, name));
    response
}

#[cfg(test)]
mod tests {
    use lodsmith_core::model::Transform;
    use lodsmith_core::shapes;

    use super::*;

    fn cube() -> Bounds {
        Bounds { min: [-1.0; 3], max: [1.0; 3] }
    }

    #[test]
    fn an_orbit_looks_as_the_camera_that_it_was_made_of() {
        for view in StandardView::ALL {
            let camera = Camera::fitting(&cube(), view, 1.5);
            let back = Orbit::of(&camera).camera();
            assert!(back.eye.distance(camera.eye) < 1e-9, "{view:?}");
            assert!(back.up_square().distance(camera.up_square()) < 1e-9, "{view:?}");
        }
    }

    #[test]
    fn zooming_keeps_what_is_under_the_pointer() {
        let mut orbit = Orbit::fitting(&cube(), StandardView::Iso, 1.0);
        let off = Vec2::new(120.0, -40.0);
        let below = |orbit: &Orbit| {
            let camera = orbit.camera();
            let forward = (camera.target - camera.eye).normalize_or_zero();
            let along = ray(&camera, off, 600.0);
            camera.eye + along * (orbit.distance / along.dot(forward))
        };
        let before = below(&orbit);
        orbit.zoom(2.0, off, 600.0);
        assert!(below(&orbit).distance(before) < 1e-6);
    }

    #[test]
    fn the_pitch_ends_at_the_poles() {
        let mut orbit = Orbit::fitting(&cube(), StandardView::Front, 1.0);
        orbit.turn(0.0, 10.0);
        assert_eq!(orbit.pitch_rad, FRAC_PI_2);
        assert!(orbit.camera().up_square().is_finite());
    }

    #[test]
    fn a_ray_meets_the_near_side() {
        let model = Model::of_mesh(shapes::icosphere(3));
        let rest = ModelPose::default();
        let hit = pick(&model, &rest, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        assert!((hit.z - 1.0).abs() < 0.05 && hit.x == 0.0, "{hit}");
        assert_eq!(pick(&model, &rest, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::Z), None);
        // Where an animation has taken it.
        let (translation, rotation, scale) = (DVec3::Z * 2.0, DQuat::IDENTITY, DVec3::ONE);
        let transforms = vec![Transform::Parts { translation, rotation, scale }];
        let moved = ModelPose { transforms, ..rest };
        let hit = pick(&model, &moved, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        assert!((hit.z - 3.0).abs() < 0.05, "{hit}");
    }
}
