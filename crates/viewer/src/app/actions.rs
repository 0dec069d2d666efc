//! Actions of keys, menus and buttons.

use std::path::{Path, PathBuf};

use eframe::egui::{self, Theme};
use glam::DQuat;
use lodsmith_render::Shading;

use super::App;
use crate::command::{Command, SimplifyTarget};
use crate::compare::Side;
use crate::dialog::Purpose;
use crate::keys::{Action, playback_after};
use crate::orbit::Orbit;
use crate::panel::look::SHADINGS;
use crate::panel::{self, Panel, export};
use crate::settings::{Layout, Pose, Sides, Turn};
use crate::target_scale::Unit;
use crate::viewport::KEY_TURN_RAD;

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
        let layout = settings.layout;
        let looks = &mut look.look;
        match action {
            Action::Open => return self.choose(ctx, Purpose::Open, None),
            Action::OpenSession => return self.choose(ctx, Purpose::OpenSession, None),
            Action::SaveSession => {
                if let Some(file) = settings.file() {
                    let start = file.with_extension("lodsmith.json");
                    self.choose(ctx, Purpose::SaveSession, Some(start));
                }
                return;
            }
            Action::Export => {
                if let Some(original) = self.document.original() {
                    self.export =
                        Some(export::ExportForm::new(&original.content.path, original.content.file.format));
                }
                return;
            }
            Action::Reload => return self.document.reload(),
            Action::Close => {
                self.document.run(Command::Close);
                ctx.send_viewport_cmd(egui::ViewportCommand::Title("Lodsmith".to_owned()));
                return;
            }
            Action::Quit => return ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::Undo => return self.document.undo(),
            Action::Redo => return self.document.redo(),
            Action::CopyCommand => {
                ctx.copy_text(panel::report::command_line(settings));
                return self.document.log.note("command line copied to the clipboard");
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
            | Action::NextClip => {
                if matches!(action, Action::StepTime(_)) {
                    self.document.play(false);
                }
                let (model, length) =
                    (self.document.original().map(|o| o.content.model()), self.document.timeline_secs());
                let playback = self.document.settings().playback;
                let then = model.and_then(|m| playback_after(playback, m, length, action));
                return then.into_iter().for_each(|p| self.document.run(Command::Playback(p)));
            }
            Action::AutoLod => {
                let mut auto = settings.auto_lod;
                auto.is_on = !auto.is_on;
                return self.document.run(Command::AutoLod(auto));
            }
            Action::NextSides => {
                let at = Sides::ALL.iter().position(|s| s.0 == layout.sides).unwrap_or(0);
                let sides = Sides::ALL[(at + 1) % Sides::ALL.len()].0;
                return self.document.run(Command::Layout(Layout { sides, ..layout }));
            }
            Action::Link => {
                let linked = !layout.linked;
                if linked {
                    let orbit = self.pictures.orbit(Side::Original);
                    self.pictures.set_orbit(Side::Original, orbit, true);
                }
                return self.document.run(Command::Layout(Layout { linked, ..layout }));
            }
            Action::Frame => return self.pictures.frame(&self.document),
            Action::View(view) => return self.pictures.look_from(&self.document, view),
            Action::SaveCamera(slot) => {
                let pose = Pose::of(&self.pictures.orbit(Side::Original).camera());
                self.document.log.note(format!("camera {} saved", slot + 1));
                return self.document.run(Command::KeepCamera(slot, Some(pose)));
            }
            Action::RestoreCamera(slot) => {
                match settings.cameras[slot] {
                    Some(pose) => self.pictures.each_orbit(|o| *o = Orbit::of(&pose.camera())),
                    None => self.document.log.note(format!("camera {} has not been saved", slot + 1)),
                }
                return;
            }
            Action::Orbit(right, up) => {
                let turn = [right, up].map(|n| f64::from(n) * KEY_TURN_RAD);
                return self.pictures.each_orbit(|o| o.turn(turn[0], turn[1]));
            }
            Action::TurnModel(right, up) => {
                let camera = self.pictures.orbit(Side::Original).camera();
                let across = (camera.target - camera.eye).cross(camera.up).normalize_or(glam::DVec3::X);
                let by = DQuat::from_axis_angle(glam::DVec3::Y, f64::from(right) * KEY_TURN_RAD)
                    * DQuat::from_axis_angle(across, -f64::from(up) * KEY_TURN_RAD);
                let turn = (by * settings.turn.rotation()).normalize();
                return self.document.run(Command::Turn(Turn(turn.to_array())));
            }
            Action::ResetRotation => return self.document.run(Command::Turn(Turn::default())),
            Action::Panels => return self.panels_hidden = !self.panels_hidden,
            Action::Panel(panel) => {
                self.has_own_timeline &= panel != Panel::Timeline;
                if !self.shown.remove(&panel) || self.panels_hidden {
                    self.shown.insert(panel);
                }
                return self.panels_hidden = false;
            }
            Action::Theme => {
                self.prefs.is_light = ctx.theme() == Theme::Dark;
                ctx.set_theme(if self.prefs.is_light { Theme::Light } else { Theme::Dark });
                return self.save_prefs();
            }
            Action::Screenshot => return self.screenshot(ctx),
            Action::Help => return self.is_help = !self.is_help,
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

    /// Saves a screenshot of the window beside the model, under the next free number.
    pub(super) fn screenshot(&mut self, ctx: &egui::Context) {
        let folder = self.start_of_dialogs();
        let file = self.document.settings().file();
        let stem =
            file.and_then(Path::file_stem).map_or("lodsmith".into(), |s| s.to_string_lossy().into_owned());
        let sender = self.pictures_saved.0.clone();
        let waker = ctx.clone();
        let save = move |image: std::sync::Arc<egui::ColorImage>| {
            std::thread::spawn(move || {
                let _ = sender.send(save_picture(&image, &folder, &stem));
                waker.request_repaint();
            });
        };
        ctx.send_viewport_cmd(egui::ViewportCommand::Screenshot(egui::ScreenshotCallback::new(save)));
        ctx.request_repaint();
    }

    /// Keeps the same target, in another unit.
    pub(super) fn change_unit(&mut self, unit: Unit) {
        let (Some(whole), Some(lighter)) = (self.document.original_size(), self.document.lighter()) else {
            return;
        };
        let l = &lighter.content;
        let target = match unit {
            Unit::Faces => SimplifyTarget::Faces(l.faces),
            Unit::Vertices => SimplifyTarget::Vertices(l.vertices),
            Unit::Percent => whole.target(unit, whole.slider_position_of_faces(l.faces as f64)),
            Unit::Error => {
                let d = l.measured().map_or(l.error(), |m| m.hausdorff.symmetric);
                SimplifyTarget::Error((d / whole.diagonal.max(1e-300)).clamp(1e-6, 0.1))
            }
        };
        self.document.run(Command::Target(target));
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
    crate::session::write(&path, encoded.get_ref()).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(path)
}
