//! A clicked point of the surface, with the value of the heat map there.

use std::sync::Arc;

use eframe::egui::{self, Color32, Rect, Response, Sense, Stroke, Ui, Vec2};
use glam::DVec3;

use super::{ComparisonView, Probe, Side};
use crate::document::Document;
use crate::panel::error;
use crate::settings::HeatOf;
use crate::theme::palette;
use crate::view::orbit::turn_matrix;
use crate::view::viewport::{self, SurfaceHit};

/// Radius of the marker in points.
const MARKER_RADIUS: f32 = 5.0;

impl ComparisonView {
    /// Reads the value of the heat map at a clicked point; a click beside the model removes the marker.
    pub(super) fn probe_at(&mut self, document: &Document, side: Side, response: &Response, rect: Rect) {
        self.probe = self.probed(document, side, response, rect);
    }

    fn probed(&self, document: &Document, side: Side, response: &Response, rect: Rect) -> Option<Probe> {
        let (distances, pointer) = (document.distances()?, response.interact_pointer_pos()?);
        let original = &document.original()?.content;
        if !document.levels().is_empty() {
            return None;
        }
        let lighter = &document.lighter()?.content;
        let model = if side == Side::Result { &lighter.model } else { original.model() };
        let camera = self.orbit(side).camera();
        let along = viewport::ray(&camera, pointer - rect.center(), rect.height());
        let turn = document.rotation();
        let world = turn_matrix(&original.bounds, turn);
        let hit = viewport::pick_surface(model, &self.pose, world, camera.eye, along)?;
        let mesh = &model.meshes[hit.mesh].mesh;
        let wedges = mesh.triangles()[hit.face];
        let exact = || {
            let to = match side {
                Side::Result => original.prepared(hit.mesh),
                Side::Original => lighter.prepared(hit.mesh),
            };
            let corner = |k: usize| DVec3::from(mesh.positions().view().get(mesh.vertex_of(wedges[k])));
            let place: DVec3 = (0..3).map(|k| corner(k) * hit.weights[k]).sum();
            let nearest = to?.tree().closest(place.into())?;
            Some(nearest.distance * original.scales()[hit.mesh])
        };
        let blended = || {
            let all = if side == Side::Result { &distances.of_result } else { &distances.of_original };
            let at = |k: usize| match distances.quantity {
                HeatOf::Distance => mesh.vertex_of(wedges[k]).index(),
                HeatOf::Normals | HeatOf::Uvs | HeatOf::Colors => wedges[k].index(),
            };
            (0..3).map(|k| f64::from(all[hit.mesh][at(k)]) * hit.weights[k]).sum()
        };
        let value = match distances.quantity {
            HeatOf::Distance => exact().unwrap_or_else(blended),
            HeatOf::Normals | HeatOf::Uvs | HeatOf::Colors => blended(),
        };
        let SurfaceHit { place, .. } = hit;
        Some(Probe { side, place, value, of: distances.clone(), pose: self.pose.clone(), turn })
    }

    /// Draws the marker of the clicked point in a picture, and its value on the side that was clicked.
    pub(super) fn draw_probe(&self, ui: &Ui, document: &Document, side: Side, rect: Rect, seen: Rect) {
        let Some(probe) = &self.probe else { return };
        let is_present = document.distances().is_some_and(|d| Arc::ptr_eq(d, &probe.of))
            && probe.pose == self.pose
            && probe.turn == document.rotation();
        let at = viewport::on_screen(&self.orbit(side).camera(), probe.place, rect);
        let Some(at) = at.filter(|at| is_present && seen.contains(*at)) else { return };
        let painter = ui.painter_at(seen);
        painter.circle_stroke(at, MARKER_RADIUS, Stroke::new(3.5, Color32::BLACK));
        painter.circle_stroke(at, MARKER_RADIUS, Stroke::new(1.5, Color32::WHITE));
        if side != probe.side {
            return;
        }
        let p = palette(ui);
        let diagonal = document.original().map_or(0.0, |o| o.content.bounds.diagonal());
        let text = error::value_text(probe.of.quantity, probe.value, diagonal);
        let galley = painter.layout_no_wrap(text.clone(), egui::FontId::monospace(12.0), p.text);
        let size = galley.size() + Vec2::new(16.0, 8.0);
        let mut chip = Rect::from_min_size(at + Vec2::new(12.0, -size.y - 4.0), size);
        // Within the picture.
        let beyond =
            Vec2::new((chip.right() - seen.right() + 4.0).max(0.0), (seen.top() + 4.0 - chip.top()).max(0.0));
        chip = chip.translate(Vec2::new(-beyond.x, beyond.y));
        painter.rect_filled(chip, 4.0, p.panel.gamma_multiply(0.95));
        painter.galley(chip.min + Vec2::new(8.0, 4.0), galley, p.text);
        let response = ui.interact(chip, ui.scope_id().with("probe"), Sense::hover());
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::Role::Label, true, format!("Error here: {text}"))
        });
    }
}
