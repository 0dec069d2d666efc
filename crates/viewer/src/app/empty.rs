//! The window without a file, and the overlay while a file is dragged over it.

use eframe::egui::{self, Ui};

use crate::document::Document;
use crate::numbers::significant;
use crate::panel::keys::Action;
use crate::panel::{self, UiRequest, WindowState};
use crate::theme;

/// Draws the start page: how to open a file, and recent files.
pub(super) fn start_page(
    ui: &mut Ui,
    document: &Document,
    facts: &WindowState,
    requests: &mut Vec<UiRequest>,
) {
    let p = theme::palette(ui);
    let room = ui.available_rect_before_wrap();
    ui.painter().rect_filled(room, 0.0, p.window);
    let size = egui::vec2(420.0, 320.0).min(room.size());
    let place = egui::Rect::from_center_size(room.center(), size);
    ui.scope_builder(egui::UiBuilder::new().max_rect(place), |ui| {
        ui.vertical_centered(|ui| {
            if let Some(path) = document.opening() {
                ui.add_space(size.y * 0.4);
                // No spinner: its frames would take processor time from the reader.
                ui.label(theme::weak(ui, format!("Opening {}", panel::files::name(path))));
                if let Some((secs, stage, done)) = document.opening_progress() {
                    let size = std::fs::metadata(path).map_or(0.0, |m| m.len() as f64 / 1e6);
                    let size = significant(size, 2);
                    let text = match done {
                        Some(done) => format!("{stage} {size} MB: {} %, {} s", (100.0 * done).floor(), secs.round()),
                        None => format!("{stage} {size} MB, {} s", secs.round()),
                    };
                    ui.label(theme::weak(ui, text));
                }
                if ui.button("Stop").clicked() {
                    requests.push(UiRequest::Action(Action::Cancel));
                }
                return;
            }
            ui.add_space(24.0);
            ui.label(egui::RichText::new("Drop a model here").size(26.0).strong());
            ui.add_space(4.0);
            ui.label(theme::weak(ui, "OBJ, OFF, PLY, STL, glTF, GLB or LPM; also gzip-compressed"));
            ui.add_space(16.0);
            ui.horizontal(|ui| {
                let width = 2.0 * 150.0 + 8.0;
                ui.add_space((ui.available_width() - width) / 2.0);
                let big = egui::vec2(150.0, 34.0);
                let text = egui::RichText::new("Open…").color(p.on_accent).strong();
                if ui.add(egui::Button::new(text).fill(p.accent).min_size(big)).clicked() {
                    requests.push(UiRequest::Action(Action::Open));
                }
                if ui.add(egui::Button::new("Open sample").min_size(big)).clicked() {
                    requests.push(UiRequest::OpenSample);
                }
            });
            ui.add_space(16.0);
            let steps =
                "Then drag the slider below: the simplified mesh appears beside the original. H shows all keys.";
            ui.label(theme::weak(ui, steps));
            if !facts.recent.is_empty() {
                ui.add_space(16.0);
                ui.label(theme::weak(ui, "RECENT").small());
                for file in facts.recent.iter().take(5) {
                    let link = egui::Button::new(panel::files::name(file)).frame(false);
                    if ui.add(link).on_hover_text(file.display().to_string()).clicked() {
                        requests.push(UiRequest::OpenFile(file.clone()));
                    }
                }
            }
        });
    });
}

/// Draws the hint for the first minute over the pictures; returns true if it was closed.
pub(super) fn first_hint(ctx: &egui::Context) -> bool {
    let area = egui::Area::new(egui::Id::unique("first hint")).order(egui::Order::Middle);
    let shown = area.anchor(egui::Align2::CENTER_BOTTOM, egui::vec2(0.0, -120.0)).show(ctx, |ui| {
        egui::Frame::popup(ui.style()).inner_margin(12.0).show(ui, |ui| {
            ui.set_max_width(420.0);
            ui.label(egui::RichText::new("Drag the slider below: fewer triangles to the left").strong());
            ui.label(theme::weak(
                ui,
                "Drag a picture to orbit, scroll to zoom, double-click to look at a point.",
            ));
            ui.label(theme::weak(ui, "Ctrl+S exports the result, H shows all keys."));
            ui.button("Got it").clicked()
        })
    });
    shown.inner.inner
}

/// Draws a hint while a file is dragged over the window.
pub(super) fn drop_hint(ctx: &egui::Context) {
    if ctx.input(|i| i.raw.hovered_files.is_empty()) {
        return;
    }
    let screen = ctx.content_rect();
    let layer = egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("drop"));
    let painter = ctx.layer_painter(layer);
    painter.rect_filled(screen, 0.0, egui::Color32::from_black_alpha(160));
    let font = egui::FontId::proportional(28.0);
    painter.text(screen.center(), egui::Align2::CENTER_CENTER, "Drop to open", font, egui::Color32::WHITE);
}
