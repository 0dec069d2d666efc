//! Headless harness of the app, with simulated input. The example `pictures` uses it too.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, Modifiers, Pos2};
use egui_kittest::Harness;
use lodsmith_core::shapes;
use lodsmith_viewer::ViewOptions;
use lodsmith_viewer::app::App;
use lodsmith_viewer::gpu::Context;
use lodsmith_viewer::panel::keys::Action;

use crate::adapter::context;

const TIMEOUT: Duration = Duration::from_secs(120);

/// A headless window, and a folder with two models.
pub(super) struct AppHarness {
    pub(super) harness: Harness<'static, App>,
    pub(super) folder: tempfile::TempDir,
}

impl AppHarness {
    /// Opens a file of the folder by name, or another file by path.
    pub(super) fn with(is_light: bool, name: Option<impl AsRef<Path>>) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let meshes = [("sphere.ply", shapes::icosphere(5)), ("torus.obj", shapes::torus(64, 32))];
        for (name, mesh) in meshes {
            lodsmith_io::write_path(&mesh, &folder.path().join(name), &Default::default()).unwrap();
        }
        let of = |n: &Path| if n.is_file() { n.to_owned() } else { folder.path().join(n) };
        let inputs = name.map(|n| of(n.as_ref())).into_iter().collect();
        Self::within(is_light, inputs, folder)
    }

    /// Opens a window with these files; the folder is kept as long as the window.
    pub(super) fn within(is_light: bool, inputs: Vec<PathBuf>, folder: tempfile::TempDir) -> Option<Self> {
        let options = ViewOptions { inputs, remember: false, ..ViewOptions::default() };
        Self::of(is_light, options, folder)
    }

    pub(super) fn of(is_light: bool, mut options: ViewOptions, folder: tempfile::TempDir) -> Option<Self> {
        context()?;
        options.use_system_dialogs = false;
        options.is_light = Some(is_light);
        let harness = Harness::builder()
            .with_size(egui::vec2(1440.0, 900.0))
            // A double click requires two clicks within a third of a second.
            .with_step_dt(0.05)
            .with_theme(if is_light { egui::Theme::Light } else { egui::Theme::Dark })
            .wgpu_setup(Context::setup())
            .build_eframe(move |cc| App::new(cc, &options).unwrap());
        let mut window = Self { harness, folder };
        window.settle();
        Some(window)
    }

    /// Runs until all jobs are done and their results are shown.
    pub(super) fn settle(&mut self) {
        let end = Instant::now() + TIMEOUT;
        loop {
            self.harness.run_steps(2);
            let document = self.harness.state_mut().document_mut();
            if document.settle(Duration::from_millis(50)) {
                self.harness.run_steps(3);
                if self.harness.state().document().is_idle() {
                    return;
                }
            }
            assert!(Instant::now() < end, "work never ends");
        }
    }

    /// Waits until pictures at rest are smooth.
    pub(super) fn smooth(&mut self) {
        let end = Instant::now() + TIMEOUT;
        self.harness.run_steps(2);
        // While a button is held, pictures stay as they are.
        let is_held = self.harness.ctx.input(|i| i.pointer.any_down());
        while self.harness.state().is_smoothing() && !is_held || self.harness.state().triangles_left() > 0 {
            assert!(Instant::now() < end, "pictures are never smooth");
            std::thread::sleep(Duration::from_millis(20));
            self.harness.run_steps(1);
        }
        self.harness.run_steps(1);
    }

    pub(super) fn app(&self) -> &App {
        self.harness.state()
    }
    pub(super) fn press(&mut self, key: Key) {
        self.harness.key_press(key);
        self.settle();
    }
    pub(super) fn press_with(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.settle();
    }
    /// Presses the key of an action.
    pub(super) fn act(&mut self, action: Action) {
        let shortcut = action.binding().unwrap().shortcut;
        self.press_with(shortcut.modifiers, shortcut.logical_key);
    }
    /// Clicks at a point.
    pub(super) fn point(&mut self, at: Pos2) {
        self.harness.drag_at(at);
        self.harness.run_steps(1);
        self.harness.drop_at(at);
        // A second click too soon would count as a double click.
        self.harness.run_steps(10);
        self.settle();
    }
    pub(super) fn drag(&mut self, from: Pos2, to: Pos2) {
        self.harness.drag_at(from);
        self.harness.run_steps(2);
        for i in 1..=4 {
            self.harness.hover_at(from + (to - from) * (i as f32 / 4.0));
            self.harness.run_steps(1);
        }
        self.harness.drop_at(to);
        self.settle();
    }
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
