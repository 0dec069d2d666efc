//! Export dialog.

use std::path::{Path, PathBuf};

use eframe::egui::{self, RichText, Ui};
use lodsmith_io::{Format, Textures};

use super::widgets;
use crate::content::export::{Export, byte_text, default_file, estimated_bytes};
use crate::document::Document;
use crate::numbers::grouped;
use crate::theme::{palette, weak};

/// Contents of the export dialog.
#[derive(Clone, Debug)]
pub struct ExportForm {
    path: String,
    folder: String,
    format: Format,
    is_ascii: bool,
    textures: Textures,
    is_all_levels: bool,
    levels: String,
}

/// State of the export dialog.
pub enum ExportDialogState {
    /// Still open.
    Open,
    /// Cancelled.
    Closed,
    /// A file (false) or folder (true) is to be chosen.
    Choose(bool, PathBuf),
    /// Write this export.
    Write(Export),
}

const FORMATS: [(Format, &str); 7] = [
    (Format::Glb, "GLB (single-file glTF)"),
    (Format::Gltf, "glTF (text)"),
    (Format::Obj, "OBJ with materials"),
    (Format::Ply, "PLY"),
    (Format::Stl, "STL"),
    (Format::ThreeMf, "3MF"),
    (Format::Off, "OFF"),
];

const TEXTURES: [(Textures, &str); 3] =
    [(Textures::Copy, "copy"), (Textures::Link, "link"), (Textures::None, "none")];

impl ExportForm {
    /// Fills in the defaults: the format of the file, in its folder; GLB if maps were baked and the format does not
    /// hold them.
    pub fn new(original: &Path, has_maps: bool) -> Self {
        let stem = original.file_stem().map_or("model".into(), |s| s.to_string_lossy());
        let (path, format) = default_file(original, has_maps);
        Self {
            path: path.display().to_string(),
            folder: original.with_file_name(format!("{stem}_lods")).display().to_string(),
            format,
            is_ascii: false,
            textures: Textures::default(),
            is_all_levels: false,
            levels: "50, 25, 10, 5".to_owned(),
        }
    }

    /// Sets the chosen file or folder.
    pub fn chosen(&mut self, path: &Path) {
        if self.is_all_levels {
            self.folder = path.display().to_string();
        } else {
            self.path = path.display().to_string();
            self.follow_ending();
        }
    }

    /// Sets the format to that of the file extension, if it names one.
    fn follow_ending(&mut self) {
        let ending = Path::new(&self.path).extension().map(|e| e.to_string_lossy().into_owned());
        if let Some(format) =
            ending.and_then(|e| Format::from_name(&e)).filter(|f| Format::WRITTEN.contains(f))
        {
            self.format = format;
        }
    }

    /// Parses the levels, typed in percent; `None` if they are not valid.
    fn ratios(&self) -> Option<Vec<f64>> {
        let parts = self.levels.split([',', ';', ' ']).filter(|p| !p.trim().is_empty());
        let ratio =
            |p: &str| p.trim().trim_end_matches('%').parse::<f64>().ok().filter(|x| *x > 0.0 && *x <= 100.0);
        let mut all: Vec<f64> = parts.map(|p| ratio(p).map(|x| x / 100.0)).collect::<Option<_>>()?;
        // The original is written anyway.
        all.retain(|ratio| *ratio < 1.0);
        (!all.is_empty()).then_some(all)
    }

    /// Shows the dialog and returns its state.
    pub fn show(&mut self, ctx: &egui::Context, document: &Document) -> ExportDialogState {
        let modal = widgets::modal(ctx, "export").show(ctx, |ui| self.form(ui, document));
        match modal.inner {
            ExportDialogState::Open if modal.should_close() => ExportDialogState::Closed,
            answer => answer,
        }
    }

    /// Returns the approximate size of the export in bytes.
    fn estimate(&self, document: &Document) -> Option<f64> {
        let original = &document.original()?.content;
        let lighter = document.lighter().map(|l| &*l.content);
        let shown = estimated_bytes(original, lighter, self.format, self.is_ascii);
        if !self.is_all_levels {
            return Some(shown);
        }
        // The size of a level is proportional to its triangles.
        let whole = estimated_bytes(original, None, self.format, self.is_ascii);
        Some(whole * (1.0 + self.ratios()?.iter().sum::<f64>()))
    }

    fn form(&mut self, ui: &mut Ui, document: &Document) -> ExportDialogState {
        ui.set_width((ui.ctx().content_rect().width() - 80.0).clamp(280.0, 520.0));
        ui.label(RichText::new("Export").heading());
        ui.add_space(4.0);
        let faces = document
            .lighter()
            .map(|l| l.content.faces)
            .or_else(|| document.original().map(|o| o.content.faces))
            .unwrap_or(0);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            let shown = format!("Shown mesh ({} faces)", grouped(faces));
            if widgets::segment(ui, &shown, !self.is_all_levels, "Write one file") {
                self.is_all_levels = false;
            }
            if widgets::segment(
                ui,
                "All levels",
                self.is_all_levels,
                "Write the original and each level into a folder",
            ) {
                self.is_all_levels = true;
            }
        });
        ui.add_space(4.0);
        let before = self.format;
        widgets::choose(ui, "Format", "", &FORMATS, &mut self.format);
        if self.format != before {
            let path = Path::new(&self.path).with_extension(self.format.name());
            self.path = path.display().to_string();
        }
        if matches!(self.format, Format::Ply | Format::Stl) {
            widgets::switch(
                ui,
                "ASCII",
                None,
                "Text instead of binary: larger, but readable",
                &mut self.is_ascii,
            );
        }
        if self.format == Format::Obj {
            let tip = "Copy materials and textures beside the output, link to them, or omit them";
            widgets::choose(ui, "Textures", tip, &TEXTURES, &mut self.textures);
        }
        let mut answer = ExportDialogState::Open;
        if self.is_all_levels {
            let tip = "Percentages of the triangles, one file each; the original is level 0";
            widgets::field(ui, "Levels (%)", tip, |ui| {
                let is_good = self.ratios().is_some();
                let mut edit =
                    egui::TextEdit::singleline(&mut self.levels).desired_width(ui.available_width() - 8.0);
                if !is_good {
                    edit = edit.text_color(palette(ui).error);
                }
                ui.add(edit);
            });
        }
        let name = if self.is_all_levels { "Folder" } else { "File" };
        widgets::field(ui, name, "", |ui| {
            let text = if self.is_all_levels { &mut self.folder } else { &mut self.path };
            let width = ui.available_width() - 96.0;
            let edit = egui::TextEdit::singleline(text).desired_width(width).font(egui::TextStyle::Monospace);
            let response = ui.add(edit);
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Export path"));
            if ui.button("Browse…").clicked() {
                answer = ExportDialogState::Choose(self.is_all_levels, PathBuf::from(&*text));
            }
            if response.changed() && !self.is_all_levels {
                self.follow_ending();
            }
        });
        let target = PathBuf::from(if self.is_all_levels { self.folder.trim() } else { self.path.trim() });
        if let Some(size) = self.estimate(document) {
            ui.label(weak(ui, format!("About {}", byte_text(size))));
        }
        if !self.is_all_levels && target.is_file() {
            ui.label(weak(ui, "This file exists and will be replaced"));
        }
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            let is_good = !target.as_os_str().is_empty() && (!self.is_all_levels || self.ratios().is_some());
            let write = ui.add_enabled_ui(is_good, |ui| widgets::primary(ui, "Write")).inner;
            let enter = ui.input(|i| i.key_pressed(egui::Key::Enter)) && is_good;
            if write.clicked() || enter {
                let levels = if self.is_all_levels { self.ratios().unwrap_or_default() } else { Vec::new() };
                let (format, textures) = (self.format, self.textures);
                answer = ExportDialogState::Write(Export {
                    path: target,
                    format,
                    ascii: self.is_ascii,
                    textures,
                    levels,
                });
            }
            if ui.button("Cancel").clicked() {
                answer = ExportDialogState::Closed;
            }
        });
        answer
    }
}
