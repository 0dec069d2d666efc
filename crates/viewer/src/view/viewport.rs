//! Mouse control of orbit cameras, and picking.

use std::f64::consts::TAU;

use eframe::egui::{self, PointerButton, Rect, Response, Vec2};
use glam::{DMat4, DVec3};
use lodsmith_core::model::{Deformed, Instance, Pose as ModelPose};
use lodsmith_core::{Model, PositionsView, TriMesh, WedgeId};
use lodsmith_render::{Camera, Framing, StandardView};
use rayon::prelude::*;

use crate::theme::palette;
use crate::view::orbit::Orbit;

/// Rotation per point of mouse movement: half a turn over 600 points.
const TURN_PER_POINT: f64 = std::f64::consts::PI / 600.0;
/// Rotation per key press.
pub const KEY_TURN_RAD: f64 = TAU / 24.0;

impl Orbit {
    /// Pans by a number of points, in a picture of this height in points.
    pub fn pan(&mut self, by: Vec2, height: f32) {
        let camera = self.camera();
        let step = camera.length_per_pixel(self.distance, f64::from(height));
        let right = (self.target - camera.eye).cross(camera.up).normalize_or(DVec3::X);
        self.target += (camera.up * f64::from(by.y) - right * f64::from(by.x)) * step;
    }

    /// Zooms in by a factor; the point under `off`, in points from the centre, stays in place.
    pub fn zoom(&mut self, factor: f64, off: Vec2, height: f32) {
        let factor = factor.clamp(0.02, 50.0);
        self.pan(off * (1.0 - 1.0 / factor as f32) * -1.0, height);
        self.distance /= factor;
    }

    /// Applies mouse input over a picture. Returns true if the camera changed.
    pub fn interact(&mut self, response: &Response, rect: Rect) -> bool {
        let before = *self;
        let input = response
            .ctx
            .input(|i| (i.modifiers, i.smooth_scroll_delta().y, i.zoom_delta(), i.pointer.hover_pos()));
        let (modifiers, scroll, pinch, pointer) = input;
        let drag = response.drag_delta();
        let is_panning = response.dragged_by(PointerButton::Middle)
            || response.dragged_by(PointerButton::Secondary)
            || (response.dragged_by(PointerButton::Primary) && modifiers.shift && !modifiers.command);
        if is_panning {
            self.pan(drag, rect.height());
        } else if response.dragged_by(PointerButton::Primary) && !modifiers.alt && !modifiers.command {
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

/// Returns the standard view with this index.
pub fn standard_view(number: usize) -> StandardView {
    StandardView::ALL[number.min(StandardView::ALL.len() - 1)]
}

/// Part of a picture that stays free on each side of a framed model.
const MARGIN: f64 = 0.06;

/// Returns the camera, moved so that a model fills a picture of this aspect ratio.
///
/// Cost: O(triangles), on all threads.
pub fn framed(
    model: &Model,
    pose: &ModelPose,
    world_from_model: DMat4,
    bounds: &lodsmith_core::Bounds,
    camera: Camera,
    aspect: f64,
) -> Camera {
    let start = Framing::new(camera, bounds, aspect, MARGIN);
    let (world_from_nodes, mut deformed) = (model.world_from_nodes(pose), Deformed::default());
    let each = |instance: Instance| {
        let is_deformed = model.deform(&instance, pose, &world_from_nodes, &mut deformed);
        let placed = if is_deformed { deformed.world_from_mesh } else { instance.world_from_mesh };
        let world_from_mesh = world_from_model * placed;
        let mesh = &model.meshes[instance.mesh].mesh;
        let positions = mesh.positions().view();
        let place = |w: WedgeId| {
            let p = match is_deformed {
                true => DVec3::from(deformed.positions[w.index()].map(f64::from)),
                false => DVec3::from(positions.get(mesh.vertex_of(w))),
            };
            world_from_mesh.transform_point3(p)
        };
        let some = |faces: &[[WedgeId; 3]]| faces.iter().flatten().fold(start, |all, &w| all.with(place(w)));
        mesh.triangles().par_chunks(1 << 14).map(some).reduce(|| start, Framing::merged)
    };
    model.instances(pose).into_iter().map(each).fold(start, Framing::merged).camera()
}

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// The point in world coordinates.
    pub place: DVec3,
    /// Index of its mesh.
    pub mesh: usize,
    /// Index of its face.
    pub face: usize,
    /// Barycentric weights of the corners of the face.
    pub weights: [f64; 3],
}

/// Returns the first hit of a ray on a model, in world coordinates.
///
/// Cost: O(triangles), on all threads; 4 M take some 20 ms.
pub fn pick(
    model: &Model,
    pose: &ModelPose,
    world_from_model: DMat4,
    eye: DVec3,
    along: DVec3,
) -> Option<DVec3> {
    pick_surface(model, pose, world_from_model, eye, along).map(|hit| hit.place)
}

/// Returns the first hit of a ray on a model, with its face. Cost: as [`pick`].
pub fn pick_surface(
    model: &Model,
    pose: &ModelPose,
    world_from_model: DMat4,
    eye: DVec3,
    along: DVec3,
) -> Option<SurfaceHit> {
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
        let places = deformed.positions.as_slice();
        let (face, t, weights) = if is_deformed {
            nearest(mesh, from, ray, |w| DVec3::from(places[w.index()].map(f64::from)))?
        } else {
            nearest(mesh, from, ray, |w| match mesh.positions().view() {
                PositionsView::F32(p) => DVec3::from(p[mesh.vertex_of(w).index()].map(f64::from)),
                PositionsView::F64(p) => DVec3::from(p[mesh.vertex_of(w).index()]),
            })?
        };
        Some((t, SurfaceHit { place: eye + along * t, mesh: instance.mesh, face, weights }))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|hit| hit.1)
}

/// Returns the face, the ray parameter and the weights of the first hit on a mesh with these corner positions.
fn nearest(
    mesh: &TriMesh,
    from: DVec3,
    ray: DVec3,
    at: impl Fn(WedgeId) -> DVec3 + Sync,
) -> Option<(usize, f64, [f64; 3])> {
    let hit = |(face, t): (usize, &[WedgeId; 3])| {
        let (t, weights) = first_hit(from, ray, t.map(&at))?;
        Some((face, t, weights))
    };
    mesh.triangles().par_iter().enumerate().filter_map(hit).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Returns the ray parameter and the weights of a hit on a triangle, from either side. [Möller-Trumbore 1997]
fn first_hit(from: DVec3, ray: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, [f64; 3])> {
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
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, [1.0 - u - v, u, v]))
}

/// Projects a point into a picture; `None` if it is behind the eye.
pub fn on_screen(camera: &Camera, point: DVec3, rect: Rect) -> Option<egui::Pos2> {
    let seen = camera.view_from_world().transform_point3(point);
    let step = camera.length_per_pixel(-seen.z, f64::from(rect.height()));
    let off = Vec2::new((seen.x / step) as f32, (-seen.y / step) as f32);
    (seen.z < 0.0 && off.is_finite()).then(|| rect.center() + off)
}

/// Returns the direction from the eye through a point of the picture, `off` points from its centre.
pub fn ray(camera: &Camera, off: Vec2, height: f32) -> DVec3 {
    let step = camera.length_per_pixel(camera.distance(), f64::from(height));
    let forward = camera.target - camera.eye;
    let up = camera.up_square();
    let right = forward.cross(up).normalize_or(DVec3::X);
    (forward + (right * f64::from(off.x) - up * f64::from(off.y)) * step).normalize_or(DVec3::NEG_Z)
}

/// Returns the aspect ratio, width over height.
pub fn aspect(rect: Rect) -> f64 {
    f64::from(rect.width().max(1.0)) / f64::from(rect.height().max(1.0))
}

/// Makes a picture area interactive, with a name for tests and screen readers.
pub fn picture_area(ui: &mut egui::Ui, rect: Rect, name: &'static str) -> Response {
    let response = ui.interact(rect, ui.scope_id().with(name), egui::Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, name));
    response
}

/// Draws a title and a text at the upper left corner of a picture, or at the upper right one.
pub(crate) fn caption(ui: &egui::Ui, picture: Rect, title: &str, text: &str, is_right: bool) {
    let p = palette(ui);
    let painter = ui.painter_at(picture);
    let title = painter.layout_no_wrap(title.to_owned(), egui::FontId::proportional(13.0), p.text);
    let text = painter.layout_no_wrap(text.to_owned(), egui::FontId::monospace(12.0), p.weak);
    let text = if title.size().x + text.size().x + 54.0 <= picture.width() {
        text
    } else {
        painter.layout_no_wrap(String::new(), egui::FontId::monospace(12.0), p.weak)
    };
    let size = Vec2::new(title.size().x + text.size().x + 34.0, 26.0);
    let left = if is_right { picture.right() - size.x - 10.0 } else { picture.left() + 10.0 };
    let chip = Rect::from_min_size(egui::pos2(left, picture.top() + 10.0), size);
    painter.rect_filled(chip, 5.0, p.panel.gamma_multiply(0.92));
    let middle = |galley: &egui::Galley| chip.center().y - galley.size().y / 2.0;
    let text_at = egui::pos2(chip.right() - text.size().x - 12.0, middle(&text));
    painter.galley(egui::pos2(chip.left() + 12.0, middle(&title)), title, p.text);
    painter.galley(text_at, text, p.weak);
}

/// Draws a progress line at the lower edge of a picture that is drawn in parts.
pub(crate) fn drawing_line(ui: &egui::Ui, rect: Rect, share: f64) {
    let y = rect.bottom() - 1.5;
    let to = rect.left() + rect.width() * share.clamp(0.0, 1.0) as f32;
    ui.painter_at(rect).hline(rect.left()..=to, y, egui::Stroke::new(3.0, palette(ui).accent));
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use lodsmith_core::model::Transform;
    use lodsmith_core::{Bounds, shapes};

    use super::*;

    fn cube() -> Bounds {
        Bounds { min: [-1.0; 3], max: [1.0; 3] }
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
    fn a_point_is_seen_where_its_ray_begins() {
        let rect = Rect::from_min_size(egui::pos2(30.0, 10.0), Vec2::new(400.0, 300.0));
        let camera = Orbit::fitting(&cube(), StandardView::Iso, 1.0).camera();
        let at = egui::pos2(310.0, 60.0);
        let along = ray(&camera, at - rect.center(), rect.height());
        let seen = on_screen(&camera, camera.eye + along * 3.0, rect).unwrap();
        assert!(seen.distance(at) < 0.01, "{seen}");
        assert_eq!(on_screen(&camera, camera.eye - along, rect), None);
    }

    #[test]
    fn a_ray_meets_the_near_side() {
        let model = Model::of_mesh(shapes::icosphere(3));
        let rest = ModelPose::default();
        let hit = pick(&model, &rest, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        assert!((hit.z - 1.0).abs() < 0.05 && hit.x == 0.0, "{hit}");
        assert_eq!(pick(&model, &rest, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::Z), None);
        let hit = pick_surface(&model, &rest, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        let mesh = &model.meshes[0].mesh;
        let corners =
            mesh.triangles()[hit.face].map(|w| DVec3::from(mesh.positions().view().get(mesh.vertex_of(w))));
        let blended: DVec3 = corners.iter().zip(hit.weights).map(|(c, w)| *c * w).sum();
        assert!(blended.distance(hit.place) < 1e-6, "the weights are those of the point");
        // The pose of an animation is taken into account.
        let (translation, rotation, scale) = (DVec3::Z * 2.0, DQuat::IDENTITY, DVec3::ONE);
        let transforms = vec![Transform::Parts { translation, rotation, scale }];
        let moved = ModelPose { transforms, ..rest };
        let hit = pick(&model, &moved, DMat4::IDENTITY, DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        assert!((hit.z - 3.0).abs() < 0.05, "{hit}");
    }
}
