//! Log panel.

use eframe::egui::{self, Ui};

use super::{PanelContext, widgets};
use crate::theme::{number, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let entries = scope.document.log.entries();
    if entries.is_empty() {
        widgets::empty_note(ui, "No messages yet");
    }
    egui::ScrollArea::vertical().stick_to_bottom(true).auto_shrink([false, false]).show(ui, |ui| {
        for entry in entries {
            ui.horizontal_top(|ui| {
                let secs = entry.at.as_secs();
                ui.label(
                    number(weak(ui, format!("{:02}:{:02}", secs / 60, secs % 60)).text())
                        .color(crate::theme::palette(ui).weak),
                );
                widgets::log_line(ui, entry.level, &entry.text);
            });
        }
    });
}
