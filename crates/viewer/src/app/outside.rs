//! The question whether a session may read files outside its folder.

use std::path::PathBuf;

use eframe::egui::{self, RichText};

use crate::panel::{files, widgets};
use crate::settings::session::Session;
use crate::theme::{number, weak};

/// A session that refers to files outside its folder.
pub(super) struct OutsideFiles {
    pub(super) session: Session,
    pub(super) path: PathBuf,
    pub(super) files: Vec<PathBuf>,
}

/// The answer to the question.
pub(super) enum OutsideAnswer {
    /// None yet.
    Open,
    /// The session is not opened.
    Refused,
    /// The session may read these files.
    Allowed,
}

impl OutsideFiles {
    /// Shows the question, and returns its answer.
    pub(super) fn show(&self, ctx: &egui::Context) -> OutsideAnswer {
        let modal = widgets::modal(ctx, "outside files").show(ctx, |ui| {
            ui.set_width((ctx.content_rect().width() - 80.0).clamp(240.0, 560.0));
            let title = format!("Open files outside the folder of {}?", files::name(&self.path));
            ui.label(RichText::new(title).heading());
            ui.label(weak(ui, "The session refers to these files. Open them if you trust whoever made it."));
            ui.add_space(8.0);
            egui::ScrollArea::vertical().max_height(ctx.content_rect().height() * 0.5).show(ui, |ui| {
                for file in &self.files {
                    let text = number(file.display().to_string());
                    ui.add(egui::Label::new(text).wrap());
                }
            });
            ui.add_space(12.0);
            ui.horizontal(|ui| {
                let is_allowed = widgets::primary(ui, "Open anyway").clicked();
                let is_refused = ui.button("Cancel").clicked();
                match (is_allowed, is_refused) {
                    (true, _) => OutsideAnswer::Allowed,
                    (false, true) => OutsideAnswer::Refused,
                    (false, false) => OutsideAnswer::Open,
                }
            })
            .inner
        });
        match modal.inner {
            OutsideAnswer::Open if modal.should_close() => OutsideAnswer::Refused,
            answer => answer,
        }
    }
}
