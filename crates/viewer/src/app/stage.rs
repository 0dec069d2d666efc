//! Actions of keys, menus and dialogs on the stage.

mod keyframes;

use std::path::{Path, PathBuf};

use eframe::egui;

use super::App;
use super::dialog::Purpose;
use crate::command::Command;
use crate::panel::keys::{Action, CopiesAction};
use crate::panel::{Panel, UiRequest};
use crate::settings::Pose;
use crate::stage::file::LayoutFile;
use crate::stage::picture::StageView;
use crate::stage::scatter::Scatter;
use crate::stage::{Placement, StageChange};
use crate::view::orbit::Orbit;
use crate::view::viewport::KEY_TURN_RAD;

/// Rotation of a copy per key press.
const TURN_STEP_DEG: f64 = 15.0;
/// Scale factor of a copy per key press.
const SCALE_STEP: f64 = 1.1;

impl App {
    /// Returns the view of the stage, which is not part of the document.
    pub fn stage_view(&self) -> &StageView {
        &self.pictures.stage
    }

    fn change_stage(&mut self, change: StageChange) {
        self.document.run(Command::Stage(change));
    }

    /// Carries out an action if it is one of the stage; returns true if so.
    pub(super) fn act_on_stage(&mut self, ctx: &egui::Context, action: Action) -> bool {
        if action == Action::Stage {
            self.toggle_stage();
            return true;
        }
        let Some(stage) = self.document.stage() else { return false };
        let view = stage.view;
        if let Action::Copies(action) = action
            && self.act_on_keyframes(ctx, action)
        {
            return true;
        }
        let pictures = &mut self.pictures;
        match action {
            Action::Walk => {
                let is_walking = pictures.stage.status().is_walking;
                pictures.stage.set_walking(&self.document, !is_walking);
            }
            Action::Frame => pictures.stage.frame(&self.document),
            Action::View(view) => pictures.stage.look_from(&self.document, view),
            Action::Orbit(right, up) => {
                let [right, up] = [right, up].map(|n| f64::from(n) * KEY_TURN_RAD);
                pictures.stage.change_orbit(|o| o.turn(right, up));
            }
            Action::SaveCamera(slot) => {
                let pose = Pose::of(&pictures.stage.orbit().camera());
                self.document.log.note(format!("camera {} saved", slot + 1));
                self.document.run(Command::KeepCamera(slot, Some(pose)));
            }
            Action::RestoreCamera(slot) => match self.document.settings().cameras[slot] {
                Some(pose) => pictures.stage.change_orbit(|o| *o = Orbit::of(&pose.camera())),
                None => self.document.log.note(format!("camera {} has not been saved", slot + 1)),
            },
            Action::Copies(CopiesAction::Colors) => {
                let has_level_colors = !view.has_level_colors;
                self.change_stage(StageChange::View(crate::stage::StageDisplay { has_level_colors, ..view }));
            }
            Action::Copies(action) => self.act_on_copies(ctx, action),
            _ => return false,
        }
        true
    }

    fn toggle_stage(&mut self) {
        if self.document.original().is_none() {
            return self.document.log.note("open a file first: the stage shows copies of it");
        }
        let is_on = !self.document.settings().stage.is_on;
        if is_on {
            self.shown.insert(Panel::Stage);
        }
        self.change_stage(StageChange::Show(is_on));
    }

    fn act_on_copies(&mut self, ctx: &egui::Context, action: CopiesAction) {
        let stage = self.document.settings().stage.clone();
        let view = &mut self.pictures.stage;
        let selected = view.selected(&self.document);
        match action {
            CopiesAction::Place => {
                let is_placing = !view.status().is_placing;
                view.set_placing(is_placing);
            }
            CopiesAction::Scatter => {
                let scatter = Scatter { seed: stage.scatter.seed.wrapping_add(1), ..stage.scatter };
                self.scatter(scatter);
            }
            CopiesAction::All => view.select(0..stage.copies.len()),
            CopiesAction::Delete if selected.is_empty() => {}
            CopiesAction::Delete => {
                view.select([]);
                self.change_stage(StageChange::Delete(selected.iter().map(|s| s.0).collect()));
            }
            CopiesAction::Duplicate => {
                let Some(base) = self.document.stage_base().filter(|_| !selected.is_empty()) else { return };
                let aside = 2.0 * base.footprint();
                view.select(stage.copies.len()..stage.copies.len() + selected.len());
                let numbers = selected.iter().map(|s| s.0).collect();
                self.change_stage(StageChange::Duplicate { numbers, aside });
            }
            CopiesAction::Turn(steps) => self.change_selected(|c| Placement {
                turn_deg: c.turn_deg + f64::from(steps) * TURN_STEP_DEG,
                ..*c
            }),
            CopiesAction::Scale(steps) => {
                self.change_selected(|c| Placement {
                    scale: c.scale * SCALE_STEP.powi(i32::from(steps)),
                    ..*c
                });
            }
            CopiesAction::SaveLayout => {
                self.choose(ctx, Purpose::SaveLayout, self.sibling_path("stage.json"))
            }
            CopiesAction::OpenLayout => self.choose(ctx, Purpose::OpenLayout, None),
            _ => self.choose(ctx, Purpose::ExportStage, self.sibling_path("stage.glb")),
        }
    }

    fn change_selected(&mut self, of: impl Fn(&Placement) -> Placement) {
        if let Some(UiRequest::Command(command)) = self.pictures.stage.change_selected(&self.document, of) {
            self.document.run(command);
        }
    }

    /// Scatters copies and warns if not all fit.
    pub(super) fn scatter(&mut self, scatter: Scatter) {
        let Some(base) = self.document.stage_base() else { return };
        let scatter = Scatter { footprint: base.footprint(), ..scatter };
        self.pictures.stage.select([]);
        self.pictures.stage.set_placing(false);
        self.pictures.stage.form = None;
        let before = self.document.settings().stage.copies.clone();
        self.change_stage(StageChange::Scatter(scatter));
        let copies = &self.document.settings().stage.copies;
        let kept = if scatter.keeps { before.len() } else { 0 };
        let (came, overlaps) = (copies.len() - kept.min(copies.len()), scatter.overlaps(copies));
        if came < scatter.count {
            self.document
                .log
                .warn(format!("a stage can hold {} copies; {came} were placed", crate::stage::MAX_COPIES));
        }
        if overlaps > 0 {
            let text = "pairs of copies overlap: the area is too small";
            self.document.log.warn(format!("{overlaps} {text}"));
        }
        self.pictures.stage.frame(&self.document);
    }

    fn sibling_path(&self, ending: &str) -> Option<PathBuf> {
        let file = self.document.settings().file()?;
        let stem = file.file_stem()?.to_string_lossy();
        Some(file.with_file_name(format!("{stem}_{ending}")))
    }

    /// Reads or writes a file of the stage that was chosen in a dialog.
    pub(super) fn stage_file(&mut self, purpose: Purpose, path: PathBuf) {
        match purpose {
            Purpose::OpenLayout => self.open_layout(&path),
            Purpose::SaveLayout => {
                let path = if path.extension().is_none() { path.with_extension("json") } else { path };
                let model = self.document.settings().file().map(Path::to_owned).unwrap_or_default();
                match LayoutFile::new(&model, &self.document.settings().stage).save(&path) {
                    Ok(()) => self.document.log.good(format!("layout saved as {}", path.display())),
                    Err(e) => self.fail(e.to_string()),
                }
            }
            _ => {
                let path = if path.extension().is_none() { path.with_extension("glb") } else { path };
                self.document.export_stage(path, self.pictures.stage.orbit().fov_y_rad);
            }
        }
    }

    /// Opens a layout file and replaces the copies on the stage.
    pub(super) fn open_layout(&mut self, path: &Path) {
        if self.document.original().is_none() {
            return self.fail(format!("{}: open a model before its layout", path.display()));
        }
        match LayoutFile::open(path) {
            Ok((copies, motion, lost)) => {
                if lost > 0 {
                    let text = "copies omitted: invalid position or scale, or more than a stage can hold";
                    self.document.log.warn(format!("{}: {lost} {text}", path.display()));
                }
                self.pictures.stage.select([]);
                self.pictures.stage.set_placing(false);
                self.change_stage(StageChange::Replace(copies, motion));
                if !self.document.settings().stage.is_on {
                    self.toggle_stage();
                }
                self.pictures.stage.frame(&self.document);
            }
            Err(e) => self.fail(e.to_string()),
        }
    }
}
