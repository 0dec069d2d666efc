//! Files panel: open files and recent ones.

use eframe::egui::{self, Ui};

use super::{PanelContext, UiRequest, widgets};
use crate::command::Command;
use crate::panel::keys::Action;
use crate::theme::{palette, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    ui.horizontal(|ui| {
        let has_file = scope.document.original().is_some();
        scope.button(ui, Action::Open, "Open…", "Open files", true);
        scope.button(ui, Action::Export, "Export…", "Export the shown mesh", has_file);
        scope.button(ui, Action::Reload, "Reload", "Reload the file", has_file);
    });
    let settings = scope.document.settings();
    widgets::heading(ui, "Open");
    if settings.files.is_empty() {
        widgets::empty_note(ui, "No file open");
    }
    for (i, file) in settings.files.clone().into_iter().enumerate() {
        let fault = scope.document.fault_of(&file).map(str::to_owned);
        ui.horizontal(|ui| {
            let mut text = egui::RichText::new(name(&file));
            let mut tip = file.display().to_string();
            if let Some(fault) = &fault {
                text =
                    egui::RichText::new(format!("{} (cannot be read)", name(&file))).color(palette(ui).error);
                tip = fault.clone();
            }
            if ui.selectable_label(i == settings.shown, text).on_hover_text(tip).clicked()
                && i != settings.shown
            {
                scope.command(Command::Show(i));
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let close = egui::Button::new("×").frame(false).small();
                if ui.add(close).on_hover_text(format!("Close {}", name(&file))).clicked() {
                    scope.command(Command::CloseFile(i));
                }
            });
        });
        if let Some(fault) = fault {
            ui.add(egui::Label::new(weak(ui, fault).small()).wrap());
        }
    }
    let recent: Vec<_> =
        scope.facts.recent.iter().filter(|f| !settings.files.contains(f)).take(8).cloned().collect();
    if !recent.is_empty() {
        widgets::heading(ui, "Recent");
    }
    for file in recent {
        let link = egui::Button::new(name(&file)).frame(false);
        if ui.add(link).on_hover_text(file.display().to_string()).clicked() {
            scope.requests.push(UiRequest::OpenFile(file));
        }
    }
    if let Some(path) = &scope.document.changed {
        ui.label(weak(ui, format!("{} changed on disk", name(path))));
    }
}

/// Returns the file name of a path.
pub fn name(path: &std::path::Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
