//! Mapping between picture and ground, and picking of copies.

use eframe::egui::{Pos2, Rect, Vec2};
use glam::DVec3;
use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Model};
use lodsmith_render::{Camera, Lens};

use super::{ModelBase, Placement};
use crate::view::viewport::{pick, ray};

/// Returns the point where the ray through a screen position meets the ground; `None` above the horizon.
pub fn on_ground(camera: &Camera, rect: Rect, at: Pos2) -> Option<DVec3> {
    on_plane(camera, rect, at, 0.0)
}

/// Returns the point where the ray through a screen position meets a horizontal plane at the given height.
pub fn on_plane(camera: &Camera, rect: Rect, at: Pos2, height: f64) -> Option<DVec3> {
    let along = ray(camera, at - rect.center(), rect.height());
    let t = (height - camera.eye.y) / along.y;
    let place = camera.eye + along * t;
    (t > 0.0 && place.is_finite()).then_some(DVec3::new(place.x, height, place.z))
}

/// Projects a point of the stage to the screen; `None` behind the eye.
pub fn project(camera: &Camera, rect: Rect, place: DVec3) -> Option<Pos2> {
    let to = place - camera.eye;
    let [right, up, back] = camera.axes().map(|a| a.dot(to));
    let depth = match camera.lens {
        Lens::Perspective { .. } => -back,
        Lens::Parallel { .. } => camera.distance(),
    };
    let unit = camera.length_per_pixel(depth, f64::from(rect.height()));
    let off = Vec2::new((right / unit) as f32, (-up / unit) as f32);
    (depth > 0.0 && off.x.is_finite() && off.y.is_finite()).then(|| rect.center() + off)
}

/// Returns a circle on the ground as a polyline on the screen; empty if some of it lies behind the eye.
pub fn circle(camera: &Camera, rect: Rect, centre: DVec3, radius: f64) -> Vec<Pos2> {
    const CORNERS: i32 = 40;
    let corner = |k: i32| {
        let (sin, cos) = (f64::from(k) / f64::from(CORNERS) * std::f64::consts::TAU).sin_cos();
        project(camera, rect, centre + DVec3::new(radius * sin, 0.0, radius * cos))
    };
    (0..CORNERS).map(corner).collect::<Option<Vec<_>>>().unwrap_or_default()
}

/// Returns the frontmost copy under a screen position. `model_of` returns the model drawn for a copy; copies
/// without one are not hit. Geometry that an animation moves out of the bounding box at rest is not hit
/// there.
///
/// Cost: O(n log n) for n copies, plus the triangles of those whose boxes are hit in front of the result.
pub fn copy_under<'a>(
    copies: &[Placement],
    base: &ModelBase,
    pose: &Pose,
    camera: &Camera,
    rect: Rect,
    at: Pos2,
    model_of: impl Fn(usize) -> Option<&'a Model>,
) -> Option<usize> {
    let along = ray(camera, at - rect.center(), rect.height());
    let half = DVec3::new(0.5 * base.size.x, base.size.y, 0.5 * base.size.z);
    let own_box = Bounds { min: [-half.x, 0.0, -half.z], max: half.to_array() };
    let mut near: Vec<(f64, usize)> = copies
        .iter()
        .enumerate()
        .filter_map(|(number, copy)| {
            let copy_from_stage = ModelBase::stage_from_copy(copy).inverse();
            let eye = copy_from_stage.transform_point3(camera.eye);
            enters(&own_box, eye, copy_from_stage.transform_vector3(along)).map(|t| (t, number))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut first: Option<(f64, usize)> = None;
    for (enters, number) in near {
        if first.is_some_and(|(t, _)| t < enters) {
            break;
        }
        let Some(model) = model_of(number) else { continue };
        if let Some(place) = pick(model, pose, base.stage_from(&copies[number]), camera.eye, along) {
            let t = place.distance(camera.eye);
            if first.is_none_or(|(best, _)| t < best) {
                first = Some((t, number));
            }
        }
    }
    first.map(|(_, number)| number)
}

/// Returns the ray parameter at which a box is entered, 0 if the ray starts inside; `None` if it misses.
fn enters(bounds: &Bounds, from: DVec3, along: DVec3) -> Option<f64> {
    let (mut first, mut last) = (0f64, f64::INFINITY);
    for k in 0..3 {
        let (from, along) = (from[k], along[k]);
        if along == 0.0 {
            if from < bounds.min[k] || from > bounds.max[k] {
                return None;
            }
            continue;
        }
        let [a, b] = [bounds.min[k], bounds.max[k]].map(|x| (x - from) / along);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    (first <= last).then_some(first)
}

#[cfg(test)]
mod tests {
    use eframe::egui::pos2;
    use glam::DQuat;
    use lodsmith_core::shapes;
    use lodsmith_render::StandardView;

    use super::*;

    fn seen() -> (Camera, Rect) {
        let bounds = Bounds { min: [-4.0, 0.0, -4.0], max: [4.0, 2.0, 4.0] };
        (
            Camera::fitting(&bounds, StandardView::Iso, 1.5),
            Rect::from_min_max(pos2(100.0, 50.0), pos2(1000.0, 650.0)),
        )
    }

    #[test]
    fn a_point_of_the_ground_is_picked_where_it_is_drawn() {
        let (camera, rect) = seen();
        for place in [DVec3::ZERO, DVec3::new(3.0, 0.0, -2.0), DVec3::new(-1.5, 0.0, 2.5)] {
            let at = project(&camera, rect, place).unwrap();
            let back = on_ground(&camera, rect, at).unwrap();
            assert!(back.distance(place) < 1e-3, "{place} {back}");
        }
        // Positions above the horizon have no ground point; points behind the eye are not projected.
        let flat = Camera { eye: DVec3::Y, target: DVec3::new(0.0, 1.0, -1.0), ..camera };
        assert_eq!(on_ground(&flat, rect, rect.center_top()), None);
        assert!(on_ground(&flat, rect, rect.center_bottom()).is_some());
        assert_eq!(project(&flat, rect, DVec3::Z * 5.0), None);
        assert!(circle(&flat, rect, DVec3::Z * 5.0, 1.0).is_empty());
    }

    #[test]
    fn the_frontmost_copy_under_the_pointer_is_picked() {
        let (camera, rect) = seen();
        let model = Model::of_mesh(shapes::icosphere(3));
        let base = ModelBase::new(&Bounds { min: [-1.0; 3], max: [1.0; 3] }, DQuat::IDENTITY);
        let behind = -(camera.eye - camera.target).normalize_or_zero() * 2.5;
        let copies = [
            Placement::at(behind.x, behind.z),
            Placement { scale: 0.5, ..Placement::at(0.0, 0.0) },
            Placement::at(3.0, -3.0),
        ];
        let under = |place: DVec3| {
            let at = project(&camera, rect, place).unwrap();
            copy_under(&copies, &base, &Pose::default(), &camera, rect, at, |_| Some(&model))
        };
        assert_eq!(under(DVec3::new(0.0, 0.5, 0.0)), Some(1));
        assert_eq!(under(DVec3::new(behind.x, 1.8, behind.z)), Some(0));
        assert_eq!(under(DVec3::new(3.0, 1.0, -3.0)), Some(2));
        // Inside the bounding box, outside the sphere.
        assert_eq!(under(DVec3::new(0.0, 0.0, 4.0)), None);
        let at = project(&camera, rect, DVec3::new(0.0, 0.5, 0.0)).unwrap();
        let hidden =
            copy_under(&copies, &base, &Pose::default(), &camera, rect, at, |k| (k != 1).then_some(&model));
        assert_ne!(hidden, Some(1), "what is not drawn is not met");
    }
}
