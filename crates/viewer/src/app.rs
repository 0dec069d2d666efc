//! The application window: layout, keys, and routing of the panels' requests to the document.

mod actions;
mod dialog;
#[cfg(not(target_arch = "wasm32"))]
pub mod display;
mod empty;
pub mod options;
mod outside;
mod page;
mod stage;
#[cfg(not(target_arch = "wasm32"))]
pub mod window;

use std::collections::{HashSet, VecDeque};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use eframe::egui::{self, Key, Modifiers, Theme, Ui};
use lodsmith::Stop;
use lodsmith_render::Shading;
use web_time::{Duration, Instant};

use crate::command::Command;
use crate::compare::{ComparisonView, Side};
use crate::document::Document;
use crate::document::target_scale::Unit;
use crate::gpu::{Context, Gpu, GpuError};
use crate::page::BrowserPage;
use crate::panel::keys::{self, Action};
use crate::panel::{self, Dock, Panel, PanelContext, UiRequest, WindowState, export, widgets};
use crate::settings::session::{Session, ViewerPrefs};
use crate::settings::up_axis::UpAxis;
use crate::settings::{EnvironmentChoice, Pose};
use crate::stage::file::LayoutFile;
use crate::theme;
use crate::view::orbit::Orbit;
use dialog::{Dialog, DialogState, Purpose};
use empty::{drop_hint, first_hint, start_page};
use options::ViewOptions;
use outside::{OutsideAnswer, OutsideFiles};

/// The application window.
pub struct App {
    document: Document,
    pictures: ComparisonView,
    facts: WindowState,
    prefs: ViewerPrefs,
    /// Path of the settings file; `None` saves nothing.
    memory_path: Option<PathBuf>,
    shown: HashSet<Panel>,
    panels_hidden: bool,
    is_help: bool,
    dialog: Option<Dialog>,
    /// The question before a session reads files outside its folder.
    outside_files: Option<OutsideFiles>,
    export: Option<export::ExportForm>,
    use_system_dialogs: bool,
    /// File on which the cameras were last framed.
    framed: Option<PathBuf>,
    /// Axis that pointed up when the cameras were last framed.
    framed_up: UpAxis,
    /// Cameras of a session that is being opened.
    pending_cameras: Option<[Pose; 2]>,
    pictures_saved: (Sender<Saved>, Receiver<Saved>),
    /// CPU times of the last frames in seconds, newest last.
    frame_times: VecDeque<f64>,
    was_typing: bool,
    sample: Option<tempfile::TempDir>,
    /// Window clock at the last animation step; `None` while the animation is paused.
    last_play_time: Option<f64>,
    /// True if an animated file opened the timeline; the timeline then closes with that file.
    has_own_timeline: bool,
    /// True while a file is read on a software adapter: then progress is drawn at [`LOADING_FRAME`] only.
    spares_frames: Arc<AtomicBool>,
    /// Unit of the last target.
    unit_of_target: Option<Unit>,
    /// Last target while the pointer or a key was down, and the time at which it was set.
    held: Option<(Stop, Instant)>,
    /// The page around the window.
    page: Option<Rc<dyn BrowserPage>>,
    /// Purpose of the files that the user is choosing on the page.
    choosing: Option<Purpose>,
}

/// Path of a saved screenshot, or an error message.
type Saved = Result<PathBuf, String>;

/// Fraction of the faces that remains after M was held for one second.
const HELD_FACTOR_PER_SECOND: f64 = 0.45;
/// Maximum time between two frames that counts as holding M: the program may have been paused.
const MAX_HELD_SECS: f32 = 0.5;
/// Number of frames whose times are kept.
const TIMED_FRAMES: usize = 60;
/// Delay after which an unchanged slider that is still held starts a run.
const SLIDER_REST: Duration = Duration::from_millis(300);
/// Time between frames that only show the progress of loading: on a software adapter, a frame takes the threads that
/// load the file. (Five a second.)
const LOADING_FRAME: Duration = Duration::from_millis(200);
/// The sample model: the repository's own, in the public domain.
const SAMPLE: &[u8] = include_bytes!("../assets/finial.ply");

impl App {
    /// Creates the window and opens the files of the options.
    ///
    /// # Errors
    /// [`GpuError`] if drawing is not possible.
    pub fn new(cc: &eframe::CreationContext<'_>, options: &ViewOptions) -> Result<Self, GpuError> {
        let gpu = cc.wgpu_render_state.as_ref().map(Gpu::new);
        theme::install(&cc.egui_ctx);
        let memory_path =
            options.remember.then(|| options.memory.clone().or_else(ViewerPrefs::path)).flatten();
        let memory = memory_path.as_deref().map(ViewerPrefs::load).unwrap_or_default();
        let is_light = options.is_light.unwrap_or(memory.is_light);
        cc.egui_ctx.set_theme(if is_light { Theme::Light } else { Theme::Dark });
        let ctx = cc.egui_ctx.clone();
        let context = gpu.as_ref().map(|g| g.context().clone());
        let spares_frames = Arc::new(AtomicBool::new(false));
        let spares = spares_frames.clone();
        let wake = move || match spares.load(Ordering::Relaxed) {
            true => ctx.request_repaint_after(LOADING_FRAME),
            false => ctx.request_repaint(),
        };
        let facts = WindowState {
            adapter: gpu.as_ref().map(Gpu::adapter_name).unwrap_or_default(),
            recent: memory.recent.clone(),
            ..WindowState::default()
        };
        let mut app = Self {
            document: Document::new(context, wake),
            pictures: ComparisonView::new(gpu),
            facts,
            prefs: memory,
            memory_path,
            shown: Panel::ALL.into_iter().filter(|p| p.is_shown_by_default()).collect(),
            panels_hidden: false,
            is_help: false,
            dialog: None,
            outside_files: None,
            export: None,
            use_system_dialogs: options.use_system_dialogs,
            framed: None,
            framed_up: UpAxis::Auto,
            pending_cameras: None,
            pictures_saved: channel(),
            frame_times: VecDeque::new(),
            was_typing: false,
            sample: None,
            last_play_time: None,
            has_own_timeline: false,
            spares_frames,
            unit_of_target: None,
            held: None,
            page: None,
            choosing: None,
        };
        app.document.assets = options.assets.clone();
        app.open(options.inputs.clone());
        Ok(app)
    }

    /// Returns the document.
    pub fn document(&self) -> &Document {
        &self.document
    }
    /// Returns the document for changes, for tests that wait.
    pub fn document_mut(&mut self) -> &mut Document {
        &mut self.document
    }
    /// Returns true if a panel is shown.
    pub fn is_shown(&self, panel: Panel) -> bool {
        !self.panels_hidden && self.shown.contains(&panel)
    }
    /// Number of triangles still to be drawn in pictures that are drawn in parts.
    pub fn triangles_left(&self) -> u64 {
        self.pictures.triangles_left
    }
    /// Returns true until the antialiased picture of a scene at rest is complete.
    pub fn is_smoothing(&self) -> bool {
        self.pictures.is_smoothing
    }
    /// Returns the name of the graphics adapter.
    pub fn adapter(&self) -> &str {
        &self.facts.adapter
    }
    /// Returns the command that makes the shown result.
    pub fn command_line(&self) -> String {
        panel::report::command_line(self.document.settings(), self.document.baked().map(|b| &b.settings))
    }
    /// Returns the cameras of both sides.
    pub fn orbits(&self) -> [Orbit; 2] {
        [Side::Original, Side::Result].map(|s| self.pictures.orbit(s))
    }

    /// Opens files; if one of them is a session, opens only that.
    fn open(&mut self, files: Vec<PathBuf>) {
        let is_session = |f: &&PathBuf| f.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        if let Some(layout) = files.iter().find(|f| is_session(f) && LayoutFile::is_layout(f)).cloned() {
            self.open_layout(&layout);
        } else if let Some(session) = files.iter().find(is_session).cloned() {
            self.open_session(&session);
        } else if !files.is_empty() {
            // The working directory may change, and a bare file name has no folder.
            let absolute = |file: PathBuf| std::path::absolute(&file).unwrap_or(file);
            self.document.run(Command::Open(files.into_iter().map(absolute).collect()));
        }
    }

    /// Opens a session; asks before files outside its folder are read.
    fn open_session(&mut self, path: &Path) {
        match Session::read(path, &self.document.assets) {
            Ok((session, files)) if files.is_empty() => self.take_session(session),
            Ok((session, files)) => {
                self.outside_files = Some(OutsideFiles { session, path: path.to_owned(), files });
            }
            Err(e) => self.fail(e.to_string()),
        }
    }

    fn take_session(&mut self, session: Session) {
        self.pending_cameras = session.cameras;
        self.pictures.stage.set_pending_pose(session.stage_camera);
        self.framed = None;
        self.document.run(Command::Session(Box::new(session.settings)));
    }

    /// Shows the question whether a session may read files outside its folder.
    fn ask_for_outside_files(&mut self, ctx: &egui::Context) {
        let Some(asked) = self.outside_files.take() else { return };
        match asked.show(ctx) {
            OutsideAnswer::Open => self.outside_files = Some(asked),
            OutsideAnswer::Refused => {}
            // Its models may still refer only to files in their own folders.
            OutsideAnswer::Allowed => self.take_session(asked.session),
        }
    }

    fn fail(&mut self, why: String) {
        self.document.log.bad(why.clone());
        self.document.problem = Some(why);
    }

    /// Opens the sample model, written to a temporary directory that lives as long as the window.
    fn open_sample(&mut self) {
        if self.open_sample_on_page("finial.ply", SAMPLE) {
            return;
        }
        let folder = match &self.sample {
            Some(folder) => Ok(folder.path().to_owned()),
            None => tempfile::Builder::new().prefix("lodsmith-sample-").tempdir().map(|folder| {
                let path = folder.path().to_owned();
                self.sample = Some(folder);
                path
            }),
        };
        let path = folder.and_then(|folder| {
            let path = folder.join("finial.ply");
            std::fs::write(&path, SAMPLE).map(|()| path)
        });
        match path {
            Ok(path) => self.open(vec![path]),
            Err(e) => self.fail(format!("cannot write the sample: {e}")),
        }
    }

    /// Frames a newly opened file.
    fn frame_new_file(&mut self, ctx: &egui::Context) {
        let Some(path) = self.document.original().map(|o| o.content.path.clone()) else {
            if self.framed.take().is_some() {
                ctx.send_viewport_cmd(egui::ViewportCommand::Title("Lodsmith".to_owned()));
            }
            return;
        };
        if self.framed.as_ref() == Some(&path) {
            return self.follow_up_axis(&path);
        }
        self.frame_times.clear();
        self.facts.flaw = None;
        self.restore_up(&path);
        match self.pending_cameras.take() {
            Some(cameras) => {
                for (side, pose) in [Side::Original, Side::Result].into_iter().zip(cameras) {
                    self.pictures.set_orbit(side, Orbit::of(&pose.camera()), false);
                }
            }
            None => self.pictures.look_from_next_frame(0),
        }
        let name = panel::files::name(&path);
        ctx.send_viewport_cmd(egui::ViewportCommand::Title(format!("{name} – Lodsmith")));
        let is_sample = self.sample.as_ref().is_some_and(|s| path.starts_with(s.path()));
        if !is_sample {
            self.prefs.add_recent(&path);
            self.facts.recent.clone_from(&self.prefs.recent);
            self.save_prefs();
        }
        let has_clips = self.document.original().is_some_and(|o| !o.content.model().animations.is_empty());
        if has_clips && self.shown.insert(Panel::Timeline) {
            self.has_own_timeline = true;
        } else if !has_clips && self.has_own_timeline {
            self.shown.remove(&Panel::Timeline);
            self.has_own_timeline = false;
        }
        self.framed_up = self.document.up();
        self.framed = Some(path);
    }

    /// Applies the axis that was chosen for a file in an earlier run, unless a session has one.
    fn restore_up(&mut self, path: &Path) {
        if self.document.settings().up == UpAxis::Auto
            && let Some(up) = self.prefs.up_of(path)
        {
            self.document.restore_up(up);
        }
    }

    /// Frames the model again and remembers the axis, if another axis points up.
    fn follow_up_axis(&mut self, path: &Path) {
        if self.framed_up != self.document.up() {
            self.framed_up = self.document.up();
            self.pictures.look_from_next_frame(0);
            self.prefs.set_up(path, self.document.settings().up);
            self.save_prefs();
        }
    }

    /// Advances the animation by the elapsed time and passes the pose to the pictures.
    fn play(&mut self, ctx: &egui::Context) {
        self.last_play_time = if self.document.is_playing() {
            let now = ctx.input(|i| i.time);
            self.document.advance_playback(self.last_play_time.map_or(0.0, |last| now - last));
            ctx.request_repaint();
            Some(now)
        } else {
            None
        };
        self.pictures.set_pose(self.document.pose());
    }

    fn save_prefs(&self) {
        if let Some(path) = &self.memory_path {
            self.prefs.save(path);
        }
    }

    fn start_of_dialogs(&self) -> PathBuf {
        let absolute = |file: &Path| std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let of_file = self.document.settings().file().map(absolute);
        let file = of_file.or_else(|| self.prefs.recent.first().cloned());
        let folder = file.and_then(|f| f.parent().map(Path::to_owned));
        folder.or_else(|| std::env::current_dir().ok()).unwrap_or_default()
    }

    fn choose(&mut self, ctx: &egui::Context, purpose: Purpose, start: Option<PathBuf>) {
        let start = start.unwrap_or_else(|| self.start_of_dialogs());
        if self.choose_on_page(purpose, &start) {
            return;
        }
        let ctx = ctx.clone();
        self.dialog =
            Some(Dialog::new(purpose, &start, self.use_system_dialogs, move || ctx.request_repaint()));
    }

    fn chosen(&mut self, purpose: Purpose, files: Vec<PathBuf>) {
        let Some(first) = files.first().cloned() else { return };
        match purpose {
            Purpose::Open => self.open(files),
            Purpose::OpenSession => self.open_session(&first),
            Purpose::SaveSession => {
                let poses = self.orbits().map(|o| Pose::of(&o.camera()));
                let path = if first.extension().is_none() { first.with_extension("json") } else { first };
                let session = Session::new(self.document.settings().clone(), poses);
                match session.with_stage_camera(self.pictures.stage.pose()).save(&path) {
                    Ok(()) => self.document.log.good(format!("session saved as {}", path.display())),
                    Err(e) => self.fail(e.to_string()),
                }
            }
            Purpose::OpenLayout | Purpose::SaveLayout | Purpose::ExportStage => {
                self.stage_file(purpose, first)
            }
            Purpose::ExportFile | Purpose::ExportFolder => {
                if let Some(form) = &mut self.export {
                    form.chosen(&first);
                }
            }
            Purpose::Matcap | Purpose::Shader | Purpose::Environment => {
                let mut look = self.document.settings().look.clone();
                if purpose == Purpose::Matcap {
                    look.matcap = Some(first);
                    look.look.shading = Shading::Matcap;
                } else if purpose == Purpose::Environment {
                    look.around = EnvironmentChoice::File(first);
                } else {
                    look.shader = Some(first);
                }
                self.document.run(Command::Look(look));
            }
        }
    }

    fn keys(&mut self, ctx: &egui::Context) {
        let dropped: Vec<PathBuf> =
            ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
        match self.page {
            None => self.open(dropped),
            Some(_) => self.take_files_of_page(),
        }
        let is_modal = self.is_asking();
        if self.is_help && ctx.input_mut(|i| i.consume_key(Modifiers::NONE, Key::H)) {
            self.is_help = false;
        }
        // Tab moves the focus between fields, unless no field had it.
        let was_typing = std::mem::replace(&mut self.was_typing, ctx.egui_wants_keyboard_input());
        if !was_typing
            && !is_modal
            && !self.is_help
            && ctx.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Tab))
        {
            ctx.memory_mut(|m| {
                if let Some(id) = m.focused() {
                    m.surrender_focus(id);
                }
                m.move_focus(egui::FocusDirection::None);
            });
            self.was_typing = false;
            self.act(ctx, Action::Panels);
        }
        if is_modal || self.is_help || ctx.egui_wants_keyboard_input() {
            self.pictures.is_flickering = false;
            return;
        }
        // An open menu or list takes Esc.
        if egui::Popup::is_any_open(ctx) && ctx.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
            egui::Popup::close_all(ctx);
        }
        self.pictures.stage.walk_by_keys(ctx, &self.document);
        let actions = ctx.input_mut(keys::pressed);
        for action in actions {
            self.document.seal();
            self.act(ctx, action);
            self.document.seal();
        }
        let (plain, is_held, is_space, secs) = ctx.input(|i| {
            (!i.modifiers.any(), i.key_down(Key::M), i.key_down(Key::Space), i.unstable_dt.min(MAX_HELD_SECS))
        });
        if plain && is_held {
            self.scale_target(HELD_FACTOR_PER_SECOND.powf(f64::from(secs)));
            ctx.request_repaint();
        }
        self.pictures.is_flickering = plain && is_space;
    }

    /// Returns true while a dialog waits for an answer.
    fn is_asking(&self) -> bool {
        self.dialog.is_some() || self.export.is_some() || self.outside_files.is_some()
    }

    /// Tells the document which results the panels need.
    fn request_results(&mut self) {
        let is_heat = self.document.settings().look.look.shading == Shading::Heat;
        let look = &self.document.settings().look.look;
        let shows_flaws = look.borders || look.defects;
        self.document.set_wanted_flaws(shows_flaws);
        self.document.set_wanted_results(is_heat || self.is_shown(Panel::Error), self.is_shown(Panel::Info));
    }

    fn panels(&mut self, ui: &mut Ui) {
        // A new target sets the unit of the slider; the user may then choose another one.
        let of_target = Unit::of(self.document.settings());
        if std::mem::replace(&mut self.unit_of_target, of_target) != of_target {
            self.facts.unit = of_target.unwrap_or(self.facts.unit);
        }
        let docks = [Dock::Left, Dock::Right, Dock::Bottom, Dock::Middle].map(|dock| {
            let is_in = |p: &Panel| p.dock() == dock && self.is_shown(*p);
            Panel::ALL.into_iter().filter(is_in).collect::<Vec<_>>()
        });
        let shown = self.shown.clone();
        let mut scope = PanelContext { document: &self.document, facts: &self.facts, requests: Vec::new() };
        let p = theme::palette(ui);
        let bar = egui::Frame::NONE.fill(p.panel).inner_margin(egui::Margin::symmetric(12, 6));
        if !self.panels_hidden {
            let top = egui::Panel::top("top").frame(bar).resizable(false);
            top.show(ui, |ui| panel::top::show(ui, &mut scope, &|p| shown.contains(&p)));
        }
        let [left, right, bottom, middle] = docks;
        let mut closed = Vec::new();
        let strip = egui::Frame::NONE.fill(p.panel).inner_margin(egui::Margin {
            left: 12,
            right: 12,
            top: 10,
            bottom: 4,
        });
        if !bottom.is_empty() {
            let dock = egui::Panel::bottom("log").frame(egui::Frame::NONE.fill(p.panel)).resizable(true);
            dock.default_size(160.0).size_range(80.0..=400.0).show(ui, |ui| {
                for &panel in &bottom {
                    if widgets::section(ui, panel, |ui| body(ui, panel, &mut scope)) {
                        closed.push(panel);
                    }
                }
            });
        }
        let width = ui.ctx().content_rect().width();
        for (name, panels) in [("left", left), ("right", right)] {
            if panels.is_empty() {
                continue;
            }
            let frame = egui::Frame::NONE.fill(p.panel);
            let dock = if name == "left" { egui::Panel::left(name) } else { egui::Panel::right(name) };
            dock.frame(frame).resizable(false).exact_size(theme::dock_width(width)).show(ui, |ui| {
                egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                    ui.spacing_mut().item_spacing.y = theme::SPACING;
                    for &panel in &panels {
                        if widgets::section(ui, panel, |ui| body(ui, panel, &mut scope)) {
                            closed.push(panel);
                        }
                    }
                });
            });
        }
        let chosen = egui::Panel::bottom("target")
            .frame(strip)
            .resizable(false)
            .show(ui, |ui| panel::target::show(ui, &mut scope))
            .inner;
        for &panel in &middle {
            let dock = egui::Panel::bottom(panel.title()).frame(egui::Frame::NONE.fill(p.panel));
            dock.resizable(false).show(ui, |ui| {
                if widgets::section(ui, panel, |ui| body(ui, panel, &mut scope)) {
                    closed.push(panel);
                }
            });
        }
        let requests = scope.requests;
        self.facts.unit = chosen;
        for panel in closed {
            self.shown.remove(&panel);
        }
        self.handle_requests(ui.ctx(), requests);
    }

    fn handle_requests(&mut self, ctx: &egui::Context, requests: Vec<UiRequest>) {
        for request in requests {
            match request {
                UiRequest::Command(command) => self.document.run(command),
                UiRequest::Action(action) => self.act(ctx, action),
                UiRequest::OpenFile(path) => self.open(vec![path]),
                UiRequest::OpenSample => self.open_sample(),
                UiRequest::ChooseMatcap => self.choose(ctx, Purpose::Matcap, None),
                UiRequest::ChooseEnvironment => self.choose(ctx, Purpose::Environment, None),
                UiRequest::ChooseShader => self.choose(ctx, Purpose::Shader, None),
                UiRequest::Copy(text) => ctx.copy_text(text),
                UiRequest::Scatter(scatter) => self.scatter(scatter),
                UiRequest::ScatterForm(form) => self.pictures.stage.form = Some(form),
                UiRequest::Bake(true) => {
                    self.document.bake();
                    // Only this shading shows maps.
                    let mut look = self.document.settings().look.clone();
                    if look.look.shading != Shading::Textured {
                        look.look.shading = Shading::Textured;
                        self.document.run(Command::Look(look));
                    }
                }
                UiRequest::Bake(false) => self.document.remove_maps(),
                UiRequest::Difference(view) => self.document.want_difference(*view),
                UiRequest::KeyframeSelection(selection) => self.pictures.stage.keyframes = selection,
            }
        }
    }

    fn main_view(&mut self, ui: &mut Ui) {
        let mut requests = Vec::new();
        let detail = egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
            self.notices(ui, &mut requests);
            if self.document.original().is_some() {
                self.pictures.show(ui, &self.document, &mut requests)
            } else {
                start_page(ui, &self.document, &self.facts, &mut requests);
                None
            }
        });
        self.first_hint(ui.ctx());
        if let Some(factor) = detail.inner {
            self.scale_target(factor);
        }
        self.handle_requests(ui.ctx(), requests);
    }

    /// Shows the hint for the first minute, until it is closed or a result was made; it never comes back.
    fn first_hint(&mut self, ctx: &egui::Context) {
        let is_due = self.memory_path.is_some() && !self.prefs.knows_hint;
        if !is_due || self.document.original().is_none() {
            return;
        }
        let is_modal = self.is_asking() || self.is_help;
        if self.document.lighter().is_some() || (!is_modal && first_hint(ctx)) {
            self.prefs.knows_hint = true;
            self.save_prefs();
        }
    }

    /// Bar above the pictures: errors, and files changed on disk.
    fn notices(&mut self, ui: &mut Ui, requests: &mut Vec<UiRequest>) {
        let p = theme::palette(ui);
        let bar = |ui: &mut Ui, color, add: &mut dyn FnMut(&mut Ui)| {
            let frame = egui::Frame::NONE.fill(p.raised).inner_margin(egui::Margin::symmetric(12, 6));
            frame.stroke(egui::Stroke::new(1.0, color)).show(ui, |ui| {
                ui.set_width(ui.available_width());
                ui.horizontal(|ui| add(ui));
            });
        };
        let mut is_over = false;
        if let Some(problem) = self.document.problem.clone() {
            bar(ui, p.error, &mut |ui| {
                is_over = ui.button("Dismiss").clicked();
                let text = egui::RichText::new(problem.clone()).color(p.error);
                ui.add(egui::Label::new(text).wrap().selectable(true));
            });
        }
        if is_over {
            self.document.problem = None;
        }
        let mut is_seen = false;
        if let Some(path) = self.document.changed.clone() {
            bar(ui, p.warning, &mut |ui| {
                if widgets::primary(ui, "Reload").clicked() {
                    requests.push(UiRequest::Action(Action::Reload));
                }
                is_seen = ui.button("Keep").clicked();
                ui.label(format!("{} changed on disk", panel::files::name(&path)));
            });
        }
        if is_seen {
            self.document.changed = None;
        }
    }

    /// Replaces the preview level by an exact result once nothing is held, or the held slider rests.
    fn refine_at_rest(&mut self, ctx: &egui::Context) {
        if !ctx.input(|i| i.pointer.any_down() || i.key_down(Key::M)) {
            return self.document.seal();
        }
        let stop = self.document.settings().simplify.options.stop;
        match self.held {
            Some((before, since)) if before == stop => match SLIDER_REST.checked_sub(since.elapsed()) {
                Some(left) => ctx.request_repaint_after(left + Duration::from_millis(5)),
                None => self.document.start_exact_run(),
            },
            _ => {
                self.held = Some((stop, Instant::now()));
                // Panels are drawn before their requests are carried out.
                ctx.request_repaint();
            }
        }
    }

    /// Updates the elapsed time while a file is read, with few frames, so that the reader has the processor.
    fn follow_loading(&mut self, ctx: &egui::Context) {
        let is_loading = self.document.opening().is_some();
        let is_software = self.document.context().is_some_and(Context::is_software);
        self.spares_frames.store(is_loading && is_software, Ordering::Relaxed);
        if is_loading {
            ctx.request_repaint_after(LOADING_FRAME);
        }
    }

    /// Records the CPU time of a frame.
    fn note_frame_time(&mut self, secs: f64) {
        self.frame_times.push_back(secs);
        if self.frame_times.len() > TIMED_FRAMES {
            self.frame_times.pop_front();
        }
        let mut sorted: Vec<f64> = self.frame_times.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        self.facts.frame_secs = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        self.facts.longest_frame_secs = sorted.last().copied().unwrap_or(0.0);
    }

    fn dialogs(&mut self, ctx: &egui::Context) {
        self.ask_for_outside_files(ctx);
        if self.is_help && panel::help::show(ctx) {
            self.is_help = false;
        }
        if let Some(mut dialog) = self.dialog.take() {
            match dialog.show(ctx) {
                DialogState::Open => self.dialog = Some(dialog),
                DialogState::Closed => {}
                DialogState::Chosen(files) => self.chosen(dialog.purpose, files),
            }
        } else if let Some(mut form) = self.export.take() {
            match form.show(ctx, &self.document) {
                export::ExportDialogState::Open => self.export = Some(form),
                export::ExportDialogState::Closed => {}
                export::ExportDialogState::Write(export) => {
                    let error = self.pictures.allowed_error(&self.document);
                    self.document.export(export, error);
                }
                export::ExportDialogState::Choose(is_folder, start) => {
                    self.export = Some(form);
                    let purpose = if is_folder { Purpose::ExportFolder } else { Purpose::ExportFile };
                    self.choose(ctx, purpose, Some(start));
                }
            }
        }
    }
}

impl eframe::App for App {
    #[cfg(target_arch = "wasm32")]
    fn as_any_mut(&mut self) -> Option<&mut dyn std::any::Any> {
        Some(self)
    }

    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let begin = Instant::now();
        let ctx = ui.ctx().clone();
        self.document.poll();
        while let Ok(saved) = self.pictures_saved.1.try_recv() {
            match saved {
                Ok(path) => {
                    self.hand_over(&path);
                    self.document.log.good(format!("screenshot saved as {}", path.display()));
                }
                Err(why) => self.fail(format!("cannot save the screenshot: {why}")),
            }
        }
        self.frame_new_file(&ctx);
        self.keys(&ctx);
        self.play(&ctx);
        self.request_results();
        let have_changed = std::mem::take(&mut self.document.own_files_changed);
        self.facts.shader_error = self.pictures.follow_files(&self.document, have_changed);
        self.facts.triangles_drawn = self.pictures.triangles;
        self.facts.stage = self.pictures.stage.status();
        let lighter = self.document.lighter();
        self.facts.error_px = lighter.and_then(|l| self.pictures.pixels(&self.document, l.content.error()));
        self.panels(ui);
        self.main_view(ui);
        self.dialogs(&ctx);
        drop_hint(&ctx);
        self.refine_at_rest(&ctx);
        self.follow_loading(&ctx);
        let own = begin.elapsed().as_secs_f64();
        self.note_frame_time(frame.info().cpu_usage.map_or(own, f64::from));
    }
}

fn body(ui: &mut Ui, panel: Panel, scope: &mut PanelContext<'_>) {
    match panel {
        Panel::Files => panel::files::show(ui, scope),
        Panel::Method => panel::method::show(ui, scope),
        Panel::Report => panel::report::show(ui, scope),
        Panel::Bake => panel::bake::show(ui, scope),
        Panel::Info => panel::info::show(ui, scope),
        Panel::Look => panel::look::show(ui, scope),
        Panel::Error => panel::error::show(ui, scope),
        Panel::Log => panel::log::show(ui, scope),
        Panel::Stage => panel::stage::show(ui, scope),
        Panel::Timeline => panel::timeline::show(ui, scope),
        Panel::Benchmark => panel::benchmark::show(ui, scope),
    }
}
