//! File dialogs: those of the system, or one in the window if the system has none.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};

use eframe::egui::text::{CCursor, CCursorRange};
use eframe::egui::{self, Ui};
use lodsmith_io::Format;

use crate::panel::widgets;
use crate::theme::{palette, weak};

/// Purpose of a file dialog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Open models.
    Open,
    /// Open a session.
    OpenSession,
    /// Save a session.
    SaveSession,
    /// Export a model.
    ExportFile,
    /// Choose a folder for levels.
    ExportFolder,
    /// Open a matcap image.
    Matcap,
    /// Open an environment image.
    Environment,
    /// Open a shader.
    Shader,
    /// Open a layout of the stage.
    OpenLayout,
    /// Save a layout.
    SaveLayout,
    /// Export a stage.
    ExportStage,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open model",
            Self::OpenSession => "Open session",
            Self::SaveSession => "Save session",
            Self::ExportFile => "Export",
            Self::ExportFolder => "Folder for all levels",
            Self::Matcap => "Matcap image",
            Self::Environment => "Environment image",
            Self::Shader => "Shader",
            Self::OpenLayout => "Open layout",
            Self::SaveLayout => "Save layout",
            Self::ExportStage => "Export stage",
        }
    }

    pub(crate) fn endings(self) -> Vec<&'static str> {
        let with_gz = |formats: &[Format]| formats.iter().map(|f| f.name()).chain(["gz"]).collect();
        match self {
            Self::Open => with_gz(&Format::ALL),
            Self::ExportFile => with_gz(&Format::WRITTEN),
            Self::OpenSession | Self::SaveSession | Self::OpenLayout | Self::SaveLayout => vec!["json"],
            Self::ExportStage => vec!["glb", "gltf"],
            Self::ExportFolder => Vec::new(),
            Self::Matcap => vec!["png", "jpg", "jpeg", "webp"],
            Self::Environment => vec!["hdr", "png", "jpg", "jpeg", "webp"],
            Self::Shader => vec!["wgsl"],
        }
    }

    pub(crate) fn is_saving(self) -> bool {
        matches!(self, Self::SaveSession | Self::ExportFile | Self::SaveLayout | Self::ExportStage)
    }
}

/// An open dialog.
pub(crate) struct Dialog {
    /// Purpose of the dialog.
    pub(crate) purpose: Purpose,
    kind: DialogBackend,
}

enum DialogBackend {
    System(Receiver<Vec<PathBuf>>),
    Window(FileChooser),
}

/// State of a dialog.
pub(crate) enum DialogState {
    /// Nothing was chosen yet.
    Open,
    /// It was cancelled.
    Closed,
    /// These files were chosen.
    Chosen(Vec<PathBuf>),
}

impl Dialog {
    /// Opens one. `start` is a folder, or a suggested file.
    pub(crate) fn new(
        purpose: Purpose,
        start: &Path,
        use_system: bool,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let kind = if use_system && has_system_dialogs() {
            DialogBackend::System(system(purpose, start, wake))
        } else {
            DialogBackend::Window(FileChooser::new(start))
        };
        Self { purpose, kind }
    }

    /// Draws the dialog if it is not one of the system, and returns its state.
    pub(crate) fn show(&mut self, ctx: &egui::Context) -> DialogState {
        match &mut self.kind {
            DialogBackend::System(receiver) => match receiver.try_recv() {
                Ok(files) if files.is_empty() => DialogState::Closed,
                Ok(files) => DialogState::Chosen(files),
                Err(std::sync::mpsc::TryRecvError::Empty) => DialogState::Open,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => DialogState::Closed,
            },
            DialogBackend::Window(chooser) => {
                let purpose = self.purpose;
                let modal = widgets::modal(ctx, "chooser").show(ctx, |ui| chooser.show(ui, purpose));
                match modal.inner {
                    DialogState::Open if modal.should_close() => DialogState::Closed,
                    answer => answer,
                }
            }
        }
    }
}

/// Returns true if the system is likely to have dialogs: on Linux a session bus for the portal, or zenity.
fn has_system_dialogs() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    let has_bus = std::env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some_and(|v| !v.is_empty());
    let paths = std::env::var_os("PATH").unwrap_or_default();
    has_bus || std::env::split_paths(&paths).any(|folder| folder.join("zenity").is_file())
}

/// A page chooses files itself.
#[cfg(target_arch = "wasm32")]
fn system(_: Purpose, _: &Path, _: impl Fn() + Send + 'static) -> Receiver<Vec<PathBuf>> {
    channel().1
}

#[cfg(not(target_arch = "wasm32"))]
fn system(purpose: Purpose, start: &Path, wake: impl Fn() + Send + 'static) -> Receiver<Vec<PathBuf>> {
    let mut dialog = rfd::AsyncFileDialog::new().set_title(purpose.title());
    let folder = if start.is_dir() { Some(start) } else { start.parent() };
    if let Some(folder) = folder.filter(|f| f.is_dir()) {
        dialog = dialog.set_directory(folder);
    }
    let endings = purpose.endings();
    if !endings.is_empty() {
        dialog = dialog.add_filter("files", &endings);
    }
    if let Some(name) = start.file_name().filter(|_| purpose.is_saving()) {
        dialog = dialog.set_file_name(name.to_string_lossy());
    }
    let (sender, receiver) = channel();
    // Some systems require the dialog to be created on the main thread; only the wait is on another thread.
    let wait = move |chosen: Vec<PathBuf>| {
        let _ = sender.send(chosen);
        wake();
    };
    let paths = |handles: Vec<rfd::FileHandle>| handles.iter().map(|h| h.path().to_owned()).collect();
    match purpose {
        Purpose::Open => {
            let chosen = dialog.pick_files();
            std::thread::spawn(move || wait(pollster::block_on(chosen).map(paths).unwrap_or_default()));
        }
        Purpose::ExportFolder => {
            let chosen = dialog.pick_folder();
            std::thread::spawn(move || {
                wait(pollster::block_on(chosen).map(|h| paths(vec![h])).unwrap_or_default())
            });
        }
        _ if purpose.is_saving() => {
            let chosen = dialog.save_file();
            std::thread::spawn(move || {
                wait(pollster::block_on(chosen).map(|h| paths(vec![h])).unwrap_or_default())
            });
        }
        _ => {
            let chosen = dialog.pick_file();
            std::thread::spawn(move || {
                wait(pollster::block_on(chosen).map(|h| paths(vec![h])).unwrap_or_default())
            });
        }
    }
    receiver
}

/// File dialog in the window: a path field and a list of the folder.
struct FileChooser {
    text: String,
    folder: PathBuf,
    entries: Vec<(PathBuf, bool)>,
    error: Option<String>,
    is_new: bool,
}

/// Maximum number of listed entries of a folder. Guessed.
const MAX_LISTED_ENTRIES: usize = 2000;

impl FileChooser {
    fn new(start: &Path) -> Self {
        let start = std::path::absolute(start).unwrap_or_else(|_| start.to_owned());
        let folder = if start.is_dir() {
            start.clone()
        } else {
            start.parent().map(Path::to_owned).unwrap_or_default()
        };
        let text = start.display().to_string();
        let mut new = Self { text, folder: PathBuf::new(), entries: Vec::new(), error: None, is_new: true };
        new.enter(folder);
        new
    }

    fn enter(&mut self, folder: PathBuf) {
        let read = std::fs::read_dir(&folder);
        self.error = read.as_ref().err().map(|e| format!("{}: {e}", folder.display()));
        let mut entries: Vec<(PathBuf, bool)> = read
            .into_iter()
            .flatten()
            .filter_map(Result::ok)
            .filter(|e| !e.file_name().to_string_lossy().starts_with('.'))
            .take(MAX_LISTED_ENTRIES)
            .map(|e| (e.path(), e.path().is_dir()))
            .collect();
        entries
            .sort_by_key(|(path, is_folder)| (!is_folder, path.file_name().map(|n| n.to_ascii_lowercase())));
        (self.entries, self.folder) = (entries, folder);
    }

    fn show(&mut self, ui: &mut Ui, purpose: Purpose) -> DialogState {
        let screen = ui.ctx().content_rect();
        ui.set_width((screen.width() - 80.0).clamp(280.0, 620.0));
        ui.label(egui::RichText::new(purpose.title()).heading());
        ui.add_space(4.0);
        let edit = egui::TextEdit::singleline(&mut self.text)
            .desired_width(f32::INFINITY)
            .hint_text("File path")
            .font(egui::TextStyle::Monospace);
        let response = ui.add(edit);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::TextInput, true, "Path"));
        if std::mem::take(&mut self.is_new) {
            response.request_focus();
            // The whole text is selected, so that typing replaces it.
            let all = CCursorRange::two(CCursor::default(), CCursor::new(self.text.chars().count()));
            let mut state = egui::TextEdit::load_state(ui.ctx(), response.id).unwrap_or_default();
            state.cursor.set_char_range(Some(all));
            state.store(ui.ctx(), response.id);
        }
        let is_entered = response.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        let mut chosen = self.list(ui, purpose, (screen.height() - 280.0).clamp(80.0, 360.0));
        if let Some(error) = &self.error {
            ui.label(egui::RichText::new(error).color(palette(ui).error));
        }
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            let word = if purpose.is_saving() { "Save" } else { "Open" };
            let word = if purpose == Purpose::ExportFolder { "Use this folder" } else { word };
            if widgets::primary(ui, word).clicked() || is_entered {
                // A bare name is in the listed folder.
                chosen = Some(self.folder.join(self.text.trim()));
            }
            if ui.button("Cancel").clicked() {
                return DialogState::Closed;
            }
            match chosen {
                Some(path) if path.is_dir() && purpose != Purpose::ExportFolder => {
                    self.text = path.display().to_string();
                    self.enter(path);
                    DialogState::Open
                }
                Some(path) if !purpose.is_saving() && purpose != Purpose::ExportFolder && !path.exists() => {
                    self.error = Some(format!("{}: no such file", path.display()));
                    DialogState::Open
                }
                Some(path) => DialogState::Chosen(vec![path]),
                None => DialogState::Open,
            }
        })
        .inner
    }

    /// Draws the list of the folder; returns the file that was double-clicked.
    fn list(&mut self, ui: &mut Ui, purpose: Purpose, height: f32) -> Option<PathBuf> {
        let mut chosen = None;
        let mut enter = None;
        let endings = purpose.endings();
        egui::Frame::NONE.fill(palette(ui).sunken).corner_radius(5.0).inner_margin(8.0).show(ui, |ui| {
            egui::ScrollArea::vertical().max_height(height).auto_shrink([false, false]).show(ui, |ui| {
                if let Some(parent) = self.folder.parent()
                    && ui.selectable_label(false, "..  (up)").clicked()
                {
                    enter = Some(parent.to_owned());
                }
                for (path, is_folder) in &self.entries {
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    let ending = path
                        .extension()
                        .map(|e| e.to_string_lossy().to_ascii_lowercase())
                        .unwrap_or_default();
                    let fits = *is_folder || endings.iter().any(|e| *e == ending);
                    if !fits {
                        continue;
                    }
                    let text = if *is_folder { format!("{name}/") } else { name.to_string() };
                    let is_chosen = self.folder.join(self.text.trim()) == *path;
                    let response = ui.selectable_label(is_chosen, text);
                    if response.clicked() {
                        self.text = path.display().to_string();
                        if *is_folder {
                            enter = Some(path.clone());
                        }
                    }
                    if response.double_clicked() && !is_folder {
                        chosen = Some(path.clone());
                    }
                }
                if self.entries.is_empty() {
                    ui.label(weak(ui, "No files"));
                }
            });
        });
        if let Some(folder) = enter {
            self.text = folder.display().to_string();
            self.enter(folder);
        }
        chosen
    }
}
