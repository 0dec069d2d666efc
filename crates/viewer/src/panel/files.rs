//! Files panel: open files and recent ones.

use eframe::egui::{self, Ui};

use super::{PanelContext, UiRequest, widgets};
use crate::command::Command;
use crate::keys::Action;
use crate::theme::weak;

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    ui.horizontal(|ui| {
        let open = ui.button("Open…").on_hover_text(format!("Open files ({})", Action::Open.key()));
        if open.clicked() {
            scope.action(Action::Open);
        }
        let has_file = scope.document.original().is_some();
        let tip = format!("Export the shown mesh ({})", Action::Export.key());
        if ui.add_enabled(has_file, egui::Button::new("Export…")).on_hover_text(tip).clicked() {
            scope.action(Action::Export);
        }
        let tip = format!("Reload the file ({})", Action::Reload.key());
        if ui.add_enabled(has_file, egui::Button::new("Reload")).on_hover_text(tip).clicked() {
            scope.action(Action::Reload);
        }
    });
    let settings = scope.document.settings();
    widgets::heading(ui, "Open");
    if settings.files.is_empty() {
        widgets::empty_note(ui, "No file open");
    }
    for (i, file) in settings.files.clone().into_iter().enumerate() {
        let name = name(&file);
        let tip = file.display().to_string();
        if ui.selectable_label(i == settings.shown, name).on_hover_text(tip).clicked() && i != settings.shown
        {
            scope.command(Command::Show(i));
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
