//! Functions of the harness that only tests need.

use std::path::{Path, PathBuf};

use eframe::egui::{self, Key, Modifiers, Pos2, Role};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::ViewOptions;

use super::harness::AppHarness;

impl AppHarness {
    /// Opens a window that keeps its memory in a file.
    pub(super) fn remembering(model: PathBuf, memory: PathBuf, folder: tempfile::TempDir) -> Option<Self> {
        let options = ViewOptions { inputs: vec![model], memory: Some(memory), ..ViewOptions::default() };
        Self::of(false, options, folder)
    }

    pub(super) fn open(name: &str) -> Option<Self> {
        Self::with(false, Some(name))
    }

    pub(super) fn click(&mut self, label: &str) {
        self.harness.get_by_role_and_label(Role::Button, label).click();
        self.settle();
    }
    /// Types into a field, replacing its text; the caller presses Enter.
    pub(super) fn write(&mut self, field: &str, text: impl ToString) {
        let of_text = self.harness.query_by_role_and_label(Role::TextInput, field);
        of_text.unwrap_or_else(|| self.harness.get_by_label(field)).focus();
        self.harness.run_steps(2);
        self.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        self.harness.event(egui::Event::Text(text.to_string()));
        self.harness.run_steps(2);
    }
    /// Drags with modifiers held.
    pub(super) fn drag_with(&mut self, modifiers: Modifiers, from: Pos2, to: Pos2) {
        let button = |pos, pressed| egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers,
        };
        self.harness.event(egui::Event::ModifiersChanged(modifiers));
        self.harness.event(egui::Event::PointerMoved(from));
        self.harness.event(button(from, true));
        self.harness.run_steps(2);
        for i in 1..=4 {
            let at = from + (to - from) * (i as f32 / 4.0);
            self.harness.event(egui::Event::PointerMoved(at));
            self.harness.run_steps(1);
        }
        self.harness.event(button(to, false));
        self.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
        self.harness.run_steps(1);
        self.settle();
    }
    pub(super) fn faces(&self) -> Option<usize> {
        self.app().document().lighter().map(|l| l.content.faces)
    }
    /// Renders the window; asserts that it has more than one colour.
    pub(super) fn picture(&mut self, name: &str) -> image::RgbaImage {
        self.smooth();
        let picture = self.harness.render().unwrap();
        let first = *picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|p| *p != first), "{name} is empty");
        if let Some(folder) = std::env::var_os("LODSMITH_PICTURES") {
            picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
        }
        picture
    }

    /// Returns the pixels of a picture area within the window.
    pub(super) fn pixels(&mut self, label: &str) -> Vec<[u8; 4]> {
        self.smooth();
        let rect = self.harness.get_by_label(label).rect();
        let picture = self.harness.render().unwrap();
        let mut pixels = Vec::new();
        for y in rect.top() as u32 + 60..rect.bottom() as u32 - 60 {
            for x in rect.left() as u32 + 20..rect.right() as u32 - 20 {
                pixels.push(picture.get_pixel(x, y).0);
            }
        }
        pixels
    }
}
