//! Actions of keys, menus and buttons.

use std::path::{Path, PathBuf};

use eframe::egui::{self, Theme};
use glam::DQuat;
use lodsmith_render::Shading;

use super::App;
use super::dialog::Purpose;
use super::page::in_background;
use crate::command::{Command, SimplifyTarget};
use crate::compare::Side;
use crate::panel::keys::{Action, playback_after};
use crate::panel::look::SHADINGS;
use crate::panel::{self, Panel, export};
use crate::settings::{Layout, Pose, Sides, Turn};
use crate::view::orbit::Orbit;
use crate::view::viewport::KEY_TURN_RAD;

/// Fraction of the faces that remains after one key press.
const KEY_FACTOR: f64 = 0.9;

impl App {
    /// Scales the target by a factor.
    pub(super) fn scale_target(&mut self, factor: f64) {
        let Some(whole) = self.document.original_size() else { return };
        let shown = self.document.lighter().map_or(whole.faces, |l| l.content.faces);
        let target = whole.scaled(self.document.settings(), shown, factor);
        self.document.run(Command::Target(target));
    }

    pub(super) fn act(&mut self, ctx: &egui::Context, action: Action) {
        if self.act_on_stage(ctx, action) {
            return;
        }
        let settings = self.document.settings();
        let mut look = settings.look.clone();
        let looks = &mut look.look;
        match action {
            Action::Open => return self.choose(ctx, Purpose::Open, None),
            Action::OpenSession => return self.choose(ctx, Purpose::OpenSession, None),
            Action::SaveSession => return self.choose_session_to_save(ctx),
            Action::Export => return self.open_export_form(),
            Action::Reload => return self.document.reload(),
            Action::Close => return self.document.run(Command::CloseFile(settings.shown)),
            Action::Quit => return ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::Undo => return self.document.undo(),
            Action::Redo => return self.document.redo(),
            Action::CopyCommand => {
                ctx.copy_text(panel::report::command_line(
                    settings,
                    self.document.baked().map(|b| &b.settings),
                ));
                return self.document.log.note("command line copied to the clipboard");
            }
            Action::Benchmark | Action::Panel(Panel::Benchmark | Panel::Bake) if self.page.is_some() => {
                return self.document.log.note("benchmarks and baking are not available in a browser");
            }
            Action::Benchmark => {
                self.shown.insert(Panel::Benchmark);
                return self.document.benchmark();
            }
            Action::Cancel => return self.document.cancel(),
            Action::Restore => return self.document.run(Command::Target(SimplifyTarget::Original)),
            Action::Fewer => return self.scale_target(KEY_FACTOR),
            Action::More => return self.scale_target(1.0 / KEY_FACTOR),
            Action::Play => {
                self.document.play(!self.document.is_playing());
                return ctx.request_repaint();
            }
            Action::GoToStart
            | Action::StepTime(_)
            | Action::Speed(_)
            | Action::Repeat
            | Action::NextClip => return self.change_playback(action),
            Action::AutoLod => {
                let mut auto = settings.auto_lod;
                auto.is_on = !auto.is_on;
                return self.document.run(Command::AutoLod(auto));
            }
            Action::NextSides => return self.show_next_sides(),
            Action::Link => return self.link_cameras(),
            Action::Frame => return self.pictures.frame(&self.document),
            Action::View(view) => return self.pictures.look_from(&self.document, view),
            Action::SaveCamera(slot) => return self.save_camera(slot),
            Action::RestoreCamera(slot) => return self.restore_camera(slot),
            Action::Orbit(right, up) => {
                let turn = [right, up].map(|n| f64::from(n) * KEY_TURN_RAD);
                return self.pictures.each_orbit(|o| o.turn(turn[0], turn[1]));
            }
            Action::TurnModel(right, up) => return self.turn_model([right, up].map(f64::from)),
            Action::ResetRotation => return self.document.run(Command::Turn(Turn::default())),
            Action::Panels => return self.panels_hidden = !self.panels_hidden,
            Action::Panel(panel) => return self.toggle_panel(panel),
            Action::Theme => return self.toggle_theme(ctx),
            Action::Screenshot => return self.screenshot(ctx),
            Action::Help => return self.is_help = !self.is_help,
            Action::NextFlaw => return self.show_next_flaw(),
            Action::Wireframe => looks.wireframe = !looks.wireframe,
            Action::Shade(n) => {
                let (shading, _) = SHADINGS[n.min(SHADINGS.len() - 1)];
                // The heat map's key also turns it off.
                let is_again = shading == Shading::Heat && looks.shading == Shading::Heat;
                looks.shading = if is_again { Shading::Smooth } else { shading };
            }
            Action::Borders => looks.borders = !looks.borders,
            Action::Defects => looks.defects = !looks.defects,
            Action::Cull => looks.cull_back = !looks.cull_back,
            Action::Ground => look.ground = !look.ground,
            Action::NextEnvironment => look.around = look.around.next(),
            Action::Stage | Action::Walk | Action::Copies(_) => return,
        }
        self.document.run(Command::Look(look));
    }

    /// Goes to the next border or defect: of the result, or of the original if there is no result. If neither
    /// is shown, both are shown first.
    fn show_next_flaw(&mut self) {
        let mut look = self.document.settings().look.clone();
        if !(look.look.borders || look.look.defects) {
            (look.look.borders, look.look.defects) = (true, true);
            self.document.run(Command::Look(look));
            self.facts.flaw = None;
            return;
        }
        let [original, result] = self.document.flaws();
        let of_side = if self.document.lighter().is_some() { result } else { original };
        let Some(flaws) = of_side.cloned() else { return };
        let places: Vec<_> = flaws.shown_places(look.look.borders, look.look.defects).collect();
        let next = self.facts.flaw.map_or(0, |n| n + 1);
        let number = if next < places.len() { next } else { 0 };
        match places.get(number) {
            Some(place) => {
                self.facts.flaw = Some(number);
                self.pictures.look_at(&self.document, place);
            }
            None => self.document.log.note("there are no borders or defects to go to"),
        }
    }

    fn choose_session_to_save(&mut self, ctx: &egui::Context) {
        if let Some(file) = self.document.settings().file() {
            let start = file.with_extension("lodsmith.json");
            self.choose(ctx, Purpose::SaveSession, Some(start));
        }
    }

    fn open_export_form(&mut self) {
        if let Some(original) = self.document.original() {
            self.export =
                Some(export::ExportForm::new(&original.content.path, self.document.baked().is_some()));
        }
    }

    fn change_playback(&mut self, action: Action) {
        if matches!(action, Action::StepTime(_)) {
            self.document.play(false);
        }
        let (model, length) =
            (self.document.original().map(|o| o.content.model()), self.document.timeline_secs());
        let playback = self.document.settings().playback;
        if let Some(playback) = model.and_then(|m| playback_after(playback, m, length, action)) {
            self.document.run(Command::Playback(playback));
        }
    }

    fn show_next_sides(&mut self) {
        let layout = self.document.settings().layout;
        let at = Sides::ALL.iter().position(|s| s.0 == layout.sides).unwrap_or(0);
        let sides = Sides::ALL[(at + 1) % Sides::ALL.len()].0;
        self.document.run(Command::Layout(Layout { sides, ..layout }));
    }

    /// Links or unlinks the cameras of both sides.
    fn link_cameras(&mut self) {
        let layout = self.document.settings().layout;
        let linked = !layout.linked;
        if linked {
            let orbit = self.pictures.orbit(Side::Original);
            self.pictures.set_orbit(Side::Original, orbit, true);
        }
        self.document.run(Command::Layout(Layout { linked, ..layout }));
    }

    fn save_camera(&mut self, slot: usize) {
        let pose = Pose::of(&self.pictures.orbit(Side::Original).camera());
        self.document.log.note(format!("camera {} saved", slot + 1));
        self.document.run(Command::KeepCamera(slot, Some(pose)));
    }

    fn restore_camera(&mut self, slot: usize) {
        match self.document.settings().cameras[slot] {
            Some(pose) => self.pictures.each_orbit(|o| *o = Orbit::of(&pose.camera())),
            None => self.document.log.note(format!("camera {} has not been saved", slot + 1)),
        }
    }

    /// Rotates the model by key presses to the right and upward.
    fn turn_model(&mut self, [right, up]: [f64; 2]) {
        let camera = self.pictures.orbit(Side::Original).camera();
        let across = (camera.target - camera.eye).cross(camera.up).normalize_or(glam::DVec3::X);
        let by = DQuat::from_axis_angle(glam::DVec3::Y, right * KEY_TURN_RAD)
            * DQuat::from_axis_angle(across, -up * KEY_TURN_RAD);
        let turn = (by * self.document.settings().turn.rotation()).normalize();
        self.document.run(Command::Turn(Turn(turn.to_array())));
    }

    fn toggle_panel(&mut self, panel: Panel) {
        self.has_own_timeline &= panel != Panel::Timeline;
        if !self.shown.remove(&panel) || self.panels_hidden {
            self.shown.insert(panel);
        }
        self.panels_hidden = false;
    }

    fn toggle_theme(&mut self, ctx: &egui::Context) {
        self.prefs.is_light = ctx.theme() == Theme::Dark;
        ctx.set_theme(if self.prefs.is_light { Theme::Light } else { Theme::Dark });
        self.save_prefs();
    }

    /// Saves a screenshot of the window beside the model, under the next free number.
    pub(super) fn screenshot(&mut self, ctx: &egui::Context) {
        let folder = self.start_of_dialogs();
        let file = self.document.settings().file();
        let stem =
            file.and_then(Path::file_stem).map_or("lodsmith".into(), |s| s.to_string_lossy().into_owned());
        let sender = self.pictures_saved.0.clone();
        let waker = ctx.clone();
        let save = move |image: std::sync::Arc<egui::ColorImage>| {
            in_background(waker, move || _ = sender.send(save_picture(&image, &folder, &stem)));
        };
        ctx.send_viewport_cmd(egui::ViewportCommand::Screenshot(egui::ScreenshotCallback::new(save)));
        ctx.request_repaint();
    }
}

fn save_picture(image: &egui::ColorImage, folder: &Path, stem: &str) -> Result<PathBuf, String> {
    let [width, height] = image.size.map(|x| u32::try_from(x).unwrap_or(u32::MAX));
    let bytes: Vec<u8> = image.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).collect();
    let picture = image::RgbImage::from_raw(width, height, bytes).ok_or("the image is incomplete")?;
    let mut encoded = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut encoded, image::ImageFormat::Png).map_err(|e| e.to_string())?;
    let free = (1..10_000).map(|n| folder.join(format!("{stem}_{n:03}.png"))).find(|p| !p.exists());
    let path = free.ok_or_else(|| format!("{} contains too many screenshots", folder.display()))?;
    crate::settings::session::write(&path, encoded.get_ref())
        .map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(path)
}
