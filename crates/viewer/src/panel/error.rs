//! Error panel: distances between result and original, histogram, legend.

use eframe::egui::{self, Color32, Rect, Sense, Ui, Vec2, pos2};
use lodsmith_render::{ColorMap, Look, Shading};

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::content::Distances;
use crate::keys::Action;
use crate::numbers::{seconds, significant};
use crate::theme::{palette, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let settings = document.settings();
    let mut is_heat = settings.look.look.shading == Shading::Heat;
    if widgets::switch(
        ui,
        "Heat map",
        Some(Action::Shade(6)),
        "Colour both sides by their distance",
        &mut is_heat,
    ) {
        let mut look = settings.look.clone();
        look.look.shading = if is_heat { Shading::Heat } else { Shading::Smooth };
        scope.command(Command::Look(look));
    }
    let Some(original) = document.original() else {
        widgets::empty_note(ui, "Open a file first");
        return;
    };
    if document.lighter().is_none() {
        widgets::empty_note(ui, "No result yet; drag the slider below");
        return;
    }
    let Some(distances) = document.distances() else {
        ui.horizontal(|ui| {
            ui.label(weak(ui, "Measuring…"));
        });
        return;
    };
    let diagonal = original.content.bounds.diagonal();
    let both = |d: f64| {
        let share = if diagonal > 0.0 { 100.0 * d / diagonal } else { 0.0 };
        [significant(d, 3), format!("{} %", significant(share, 3))]
    };
    widgets::table_row(ui, "Vertex distance", &["units".into(), "diagonal".into()], true);
    for (name, d) in [("Maximum", distances.largest), ("RMS", distances.rms), ("Mean", distances.mean)] {
        widgets::table_row(ui, name, &both(d), false);
    }
    widgets::heading(ui, "Histogram");
    histogram(ui, distances, &settings.look.look);
    range(ui, scope, distances);
    ui.label(
        weak(ui, format!("Measured in both directions at all vertices in {}", seconds(distances.seconds)))
            .small(),
    );
}

/// Draws a histogram of the distances in the colours of the map. Heights are logarithmic.
fn histogram(ui: &mut Ui, distances: &Distances, look: &Look) {
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 88.0), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Histogram of distances"));
    let p = palette(ui);
    let painter = ui.painter();
    painter.rect_filled(rect, 3.0, p.sunken);
    let bars = rect.shrink2(Vec2::new(6.0, 6.0));
    let count = distances.histogram.len().max(1) as f32;
    let height = |n: u32| (f64::from(n) + 1.0).ln() as f32;
    let highest = distances.histogram.iter().copied().map(height).fold(1e-6, f32::max);
    let [low, high] = color_range(look, distances.largest);
    for (i, &n) in distances.histogram.iter().enumerate() {
        let at = (i as f32 + 0.5) / count * distances.largest as f32;
        let color = of_map(look.color_map, (at - low) / (high - low).max(1e-30));
        let x = bars.left() + bars.width() * i as f32 / count;
        let top = bars.bottom() - bars.height() * height(n) / highest;
        let bar = Rect::from_min_max(pos2(x, top), pos2(x + bars.width() / count - 1.0, bars.bottom()));
        painter.rect_filled(bar, 0.0, color);
    }
    if let Some(pointer) = response.hover_pos() {
        let i = ((pointer.x - bars.left()) / bars.width() * count).clamp(0.0, count - 1.0) as usize;
        let step = distances.largest / f64::from(count);
        let n = distances.histogram.get(i).copied().unwrap_or(0);
        let [from, to] = [i as f64, i as f64 + 1.0].map(|k| significant(k * step, 3));
        response.on_hover_text(format!("{from} to {to}: {n} vertices"));
    }
    let [zero, most] = ["0".to_owned(), significant(distances.largest, 3)];
    ui.horizontal(|ui| {
        ui.label(weak(ui, zero).small());
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(weak(ui, most).small())
        });
    });
}

/// Draws the field for the upper end of the colour range.
fn range(ui: &mut Ui, scope: &mut PanelContext<'_>, distances: &Distances) {
    let mut look = scope.document.settings().look.clone();
    let largest = distances.largest as f32;
    widgets::field(ui, "Range maximum", "Distance shown in the last colour; Auto uses the largest", |ui| {
        let mut high = color_range(&look.look, distances.largest)[1];
        let drag = egui::DragValue::new(&mut high).range(largest * 1e-4..=largest * 10.0);
        if ui.add(drag.speed(largest * 0.005).custom_formatter(|x, _| significant(x, 3))).changed() {
            look.look.heat_range = Some([0.0, high]);
        }
        let is_set = look.look.heat_range.is_some();
        if ui.add_enabled(is_set, egui::Button::new("Auto")).clicked() {
            look.look.heat_range = None;
        }
    });
    if look != scope.document.settings().look {
        scope.command(Command::Look(look));
    }
}

/// Returns the range of the colour map.
pub fn color_range(look: &Look, largest: f64) -> [f32; 2] {
    look.heat_range.unwrap_or([0.0, largest as f32])
}

fn of_map(map: ColorMap, t: f32) -> Color32 {
    let [r, g, b] = map.color(t).map(|c| (c * 255.0).round() as u8);
    Color32::from_rgb(r, g, b)
}

/// Draws the legend of the colour map over a picture.
pub fn legend(ui: &Ui, picture: Rect, look: &Look, distances: Option<&Distances>, diagonal: f64) {
    let p = palette(ui);
    let size = Vec2::new(192.0, 46.0);
    let rect = Rect::from_min_size(picture.right_bottom() - size - Vec2::splat(12.0), size);
    if picture.width() < size.x + 24.0 || picture.height() < 120.0 {
        return;
    }
    let painter = ui.painter_at(picture);
    painter.rect_filled(rect, 5.0, p.panel.gamma_multiply(0.92));
    let font = egui::TextStyle::Small.resolve(ui.style());
    let Some(distances) = distances else {
        let text = "Measuring…";
        painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, p.weak);
        return;
    };
    let bar = Rect::from_min_size(rect.min + Vec2::new(10.0, 10.0), Vec2::new(size.x - 20.0, 10.0));
    let steps = 64;
    for i in 0..steps {
        let x = bar.left() + bar.width() * i as f32 / steps as f32;
        let part =
            Rect::from_min_max(pos2(x, bar.top()), pos2(x + bar.width() / steps as f32 + 0.5, bar.bottom()));
        painter.rect_filled(part, 0.0, of_map(look.color_map, (i as f32 + 0.5) / steps as f32));
    }
    let [low, high] = color_range(look, distances.largest);
    let share = |x: f32| if diagonal > 0.0 { 100.0 * f64::from(x) / diagonal } else { 0.0 };
    let below = bar.bottom() + 4.0;
    let text = |at, align, text: String| painter.text(at, align, text, font.clone(), p.text);
    text(pos2(bar.left(), below), egui::Align2::LEFT_TOP, significant(f64::from(low), 2));
    let most = format!("{} ({} %)", significant(f64::from(high), 2), significant(share(high), 2));
    text(pos2(bar.right(), below), egui::Align2::RIGHT_TOP, most);
}
