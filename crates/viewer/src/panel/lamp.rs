//! The first light: a ball on which it is dragged, colour, distance and cone.

use eframe::egui::{self, Sense, Ui, Vec2};
use glam::Vec3;

use super::widgets;
use crate::settings::{Appearance, Lamp, Rig};
use crate::theme::palette;

/// Radius of the ball, in points.
const BALL_RADIUS: f32 = 34.0;

/// Draws the controls of the first light.
pub(super) fn show(ui: &mut Ui, look: &mut Appearance) {
    let before = look.lamp();
    let mut lamp = before;
    let tip =
        "Drag the light on the ball, or in a picture with Ctrl and Shift held; a ring is behind the model";
    widgets::field(ui, "Direction", tip, |ui| {
        ball(ui, &mut lamp);
        ui.vertical(|ui| {
            let angle = |value: &mut f32, end: f32, name: &str, ui: &mut Ui| {
                let drag = egui::DragValue::new(value).range(-end..=end).suffix("°").max_decimals(0);
                let response = ui.add(drag).on_hover_text(name);
                let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(name));
            };
            angle(&mut lamp.azimuth_deg, 180.0, "Light azimuth", ui);
            angle(&mut lamp.elevation_deg, 90.0, "Light elevation", ui);
        });
    });
    widgets::field(ui, "Light colour", "", |ui| {
        widgets::color(ui, &mut lamp.color);
        let is_changed = look.lamp.is_some();
        if ui.add_enabled(is_changed, egui::Button::new("Reset")).on_hover_text("Reset the light").clicked() {
            lamp = look.rig.lamp();
        }
    });
    if matches!(look.rig, Rig::Point | Rig::Spot) {
        let mut distance = f64::from(lamp.distance);
        widgets::slider(ui, "Distance", "From the centre, in radii of the model", &mut distance, 0.5..=10.0);
        lamp.distance = distance as f32;
    }
    if look.rig == Rig::Spot {
        let mut cone = f64::from(lamp.cone_deg);
        widgets::slider(ui, "Cone", "Angle of the cone in degrees", &mut cone, 5.0..=150.0);
        lamp.cone_deg = cone as f32;
    }
    if lamp != before {
        look.lamp = (lamp != look.rig.lamp()).then_some(lamp);
    }
}

/// Draws the ball. Dragging on it moves the light; beyond its edge the light goes behind the model.
fn ball(ui: &mut Ui, lamp: &mut Lamp) {
    let (rect, response) =
        ui.allocate_exact_size(Vec2::splat(2.0 * BALL_RADIUS + 8.0), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Light direction"));
    let p = palette(ui);
    let painter = ui.painter();
    painter.circle(rect.center(), BALL_RADIUS, p.sunken, egui::Stroke::new(1.0, p.line));
    let pointer = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked());
    if let Some(pointer) = pointer {
        let off = (pointer - rect.center()) / BALL_RADIUS;
        let length = off.length();
        // Up to the edge the front half, then the back half, mirrored at the edge.
        let (reach, sign) = if length <= 1.0 { (length, 1.0) } else { ((2.0 - length).max(0.0), -1.0) };
        let side = if length > 0.0 { off / length * reach } else { off };
        let depth = sign * (1.0 - reach * reach).max(0.0).sqrt();
        *lamp = lamp.towards(Vec3::new(side.x, -side.y, depth));
    }
    let d = lamp.direction();
    let at = rect.center() + BALL_RADIUS * Vec2::new(d.x, -d.y);
    let [r, g, b] = lamp.color.map(|c| (c * 255.0) as u8);
    let color = egui::Color32::from_rgb(r, g, b);
    if d.z >= 0.0 {
        painter.circle(at, 6.0, color, egui::Stroke::new(1.5, p.accent));
    } else {
        painter.circle_stroke(at, 5.0, egui::Stroke::new(2.0, p.accent));
    }
}
