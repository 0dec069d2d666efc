//! The difference view: one picture of how differently both sides look.

use std::sync::Arc;

use eframe::egui::{self, ColorImage, Rect, TextureOptions, Ui};

use super::ComparisonView;
use crate::content::difference::{DifferenceSettings, DifferenceView};
use crate::document::Document;
use crate::job::JobKind;
use crate::numbers::significant;
use crate::panel::{UiRequest, error};
use crate::settings::Pose;
use crate::theme::palette;
use crate::view::drawing::{self, COARSE_SCALE};
use crate::view::orbit::turn_matrix;
use crate::view::viewport;

impl ComparisonView {
    /// Draws the last difference picture, and requests one of the present view. The picture of another camera stays
    /// until the next one is complete.
    pub(super) fn draw_difference(
        &mut self,
        ui: &Ui,
        document: &Document,
        rect: Rect,
        requests: &mut Vec<UiRequest>,
    ) {
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, palette(ui).window);
        let Some(view) = self.difference_view(ui, document, rect) else {
            let text = "No result to compare yet; drag the slider below";
            let font = egui::TextStyle::Body.resolve(ui.style());
            painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, palette(ui).weak);
            return;
        };
        let last = document.difference();
        let is_present = last.is_some_and(|picture| picture.of == view);
        let map = view.seen.look.look.color_map;
        if !is_present {
            requests.push(UiRequest::Difference(Box::new(view)));
        }
        let Some(last) = last else {
            viewport::caption(ui, rect, "Difference", "comparing…", false);
            return;
        };
        if self.difference.as_ref().is_none_or(|shown| !Arc::ptr_eq(&shown.0, last)) {
            let pixels = last.drawn.picture.pixels().as_flattened();
            let image = ColorImage::from_rgba_unmultiplied(last.of.seen.size, pixels);
            let texture = ui.ctx().load_texture("difference", image, TextureOptions::LINEAR);
            self.difference = Some((last.clone(), texture));
        }
        if let Some((_, texture)) = &self.difference {
            drawing::paint(&painter, rect, texture.id());
        }
        let mut text = format!("mean FLIP {}", significant(last.drawn.mean, 3));
        let pointer = ui.ctx().pointer_hover_pos().filter(|p| rect.contains(*p));
        let here = pointer.map(|p| [(p.x - rect.left()) / rect.width(), (p.y - rect.top()) / rect.height()]);
        match here.and_then(|at| last.at(at)) {
            _ if !is_present && document.is_busy(JobKind::Difference) => text += "  ·  updating…",
            _ if !is_present => text += "  ·  of another view",
            Some(here) => text += &format!("  ·  here {}", significant(f64::from(here), 2)),
            None => {}
        }
        viewport::caption(ui, rect, "Difference", &text, false);
        error::scale(ui, rect, map, ["0 (equal)".to_owned(), "FLIP 1".to_owned()]);
    }

    /// Returns what the difference picture should show; `None` without a result.
    fn difference_view(&self, ui: &Ui, document: &Document, rect: Rect) -> Option<DifferenceView> {
        let original = document.original()?.content.clone();
        let lighter = self.result(document).0?.content.clone();
        let settings = document.settings();
        let is_moving = drawing::rests_in(ui.ctx(), self.moved).is_some();
        let scale = if is_moving { COARSE_SCALE } else { 1.0 };
        let pixels = |points: f32| (points * ui.pixels_per_point() * scale).round().max(1.0) as usize;
        let mut look = settings.look.clone();
        // A difference picture shows neither.
        (look.look.heat_range, look.look.heat_brush) = (None, None);
        let seen = DifferenceSettings {
            pose: self.pose.clone(),
            world_from_model: turn_matrix(&original.bounds, document.rotation()),
            camera: Pose::of(&self.orbits[0].camera()),
            size: [pixels(rect.width()), pixels(rect.height())],
            scale,
            look,
        };
        Some(DifferenceView { original, lighter, seen })
    }
}
