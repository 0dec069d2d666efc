//! Viewport of the stage, with its mouse and keyboard control.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::PoisonError;

use eframe::egui::{
    self, Color32, Key, Modifiers, PointerButton, Pos2, Rect, Response, Sense, Stroke, Ui, Vec2, pos2,
};
use glam::DVec3;
use lodsmith_core::model::Pose as ModelPose;
use lodsmith_render::Shading;
use web_time::{Duration, Instant};

use super::levels::{LevelSelector, Viewpoint, switch_distance};
use super::motion::{CameraPlacement, Track};
use super::scatter::Scatter;
use super::status::{KeyframeSelection, LevelStatus, StageStatus};
use super::{Copies, ModelBase, Placement, StageChange, ground, walk};
use crate::command::Command;
use crate::document::{Document, StageLevel};
use crate::gpu::{Frame, Gpu, PlacedModel, RenderTarget, TINTS};
use crate::numbers::{grouped, significant};
use crate::panel::UiRequest;
use crate::panel::keys::Action;
use crate::settings::Pose;
use crate::theme::{Palette, palette};
use crate::view::drawing::{self, CAMERA_REST, COARSE_SCALE, MAX_FULL_SIZE_TRIANGLES, Smoothing};
use crate::view::orbit::Orbit;
use crate::view::user_files::UserFiles;
use crate::view::viewport;

/// View state of the stage, which is not part of the document.
pub struct StageView {
    orbit: Orbit,
    is_walking: bool,
    is_placing: bool,
    selected: BTreeSet<usize>,
    chooser: LevelSelector,
    status: StageStatus,
    target: Option<RenderTarget>,
    smoothing: Smoothing,
    /// True until the antialiased picture of a scene at rest is complete.
    pub is_smoothing: bool,
    drag: Option<CopyDrag>,
    last_moved: Option<Instant>,
    /// File for which the camera was last set up.
    framed_file: Option<PathBuf>,
    /// Camera of a restored session, until it is applied.
    pending_pose: Option<Pose>,
    aspect: f64,
    /// Scatter settings of the panel, until they are applied.
    pub form: Option<Scatter>,
    eye_height: f64,
    /// Time shown last.
    moment: f64,
    /// Time and keyframes from which the camera was last set.
    applied_keyframes: Option<(f64, Track<CameraPlacement>)>,
    /// Selected and dragged keyframes.
    pub keyframes: KeyframeSelection,
}

/// Scene of a frame and its screen rectangle.
struct StageScene<'a> {
    document: &'a Document,
    /// Copies as placed at the current time.
    copies: Copies,
    base: ModelBase,
    levels: Vec<StageLevel<'a>>,
    pose: &'a ModelPose,
    rect: Rect,
}

/// Copies being dragged.
struct CopyDrag {
    from: DVec3,
    copies: Vec<(usize, Placement)>,
}

/// Rotation of a copy per point of mouse movement, and the movement that scales a copy by a factor of e.
const TURN_DEG_PER_POINT: f64 = 0.5;
const SCALE_POINTS: f64 = 200.0;
/// Camera rotation in radians per point of mouse movement.
const LOOK_PER_POINT: f64 = 0.004;
/// Camera rotation by keys, in radians per second.
const LOOK_PER_SECOND: f64 = 1.6;
/// Speed factor when walking with Shift.
const RUN_FACTOR: f64 = 4.0;
/// Triangle budget while the camera moves: a software renderer draws these in about a fifth of a second.
const MOVING_BUDGET: u64 = 100_000;

impl Default for StageView {
    fn default() -> Self {
        let bounds = lodsmith_core::Bounds { min: [-1.0, 0.0, -1.0], max: [1.0; 3] };
        Self {
            orbit: Orbit::fitting(&bounds, viewport::standard_view(0), 1.0),
            is_walking: false,
            is_placing: false,
            selected: BTreeSet::new(),
            chooser: LevelSelector::default(),
            status: StageStatus::default(),
            target: None,
            smoothing: Smoothing::default(),
            is_smoothing: false,
            drag: None,
            last_moved: None,
            framed_file: None,
            pending_pose: None,
            aspect: 1.0,
            form: None,
            eye_height: 0.0,
            moment: 0.0,
            applied_keyframes: None,
            keyframes: KeyframeSelection::default(),
        }
    }
}

impl StageView {
    /// Returns the state for panels.
    pub fn status(&self) -> StageStatus {
        let (is_placing, is_walking) = (self.is_placing, self.is_walking);
        let selected = self.selected.iter().copied().collect();
        let keyframes = self.keyframes.clone();
        StageStatus { selected, is_placing, is_walking, form: self.form, keyframes, ..self.status.clone() }
    }
    /// Returns the number of triangles of the last frame.
    pub fn triangles(&self) -> u64 {
        self.status.chosen.triangles
    }
    /// Returns the camera; `None` before the stage was shown.
    pub fn pose(&self) -> Option<Pose> {
        self.framed_file.is_some().then(|| Pose::of(&self.orbit.camera()))
    }
    /// Returns the camera orbit.
    pub fn orbit(&self) -> Orbit {
        self.orbit
    }
    /// Changes the camera orbit.
    pub fn change_orbit(&mut self, change: impl FnOnce(&mut Orbit)) {
        change(&mut self.orbit);
        self.last_moved = Some(Instant::now());
    }
    /// Sets the camera to use once the file is loaded.
    pub fn set_pending_pose(&mut self, pose: Option<Pose>) {
        self.pending_pose = pose;
        self.framed_file = None;
    }
    /// Sets whether a click places a copy or selects one.
    pub fn set_placing(&mut self, is_placing: bool) {
        self.is_placing = is_placing;
        self.is_walking &= !is_placing;
    }
    /// Selects exactly these copies.
    pub fn select(&mut self, numbers: impl IntoIterator<Item = usize>) {
        self.selected = numbers.into_iter().collect();
        self.keyframes = KeyframeSelection::default();
    }
    /// Returns the selected copies as placed at the current time, with their numbers.
    pub fn selected(&self, document: &Document) -> Vec<(usize, Placement)> {
        let copies = document.current_placements();
        self.selected.iter().filter_map(|&n| Some((n, *copies.get(n)?))).collect()
    }

    /// Frames all copies or, without copies, an area of ground three model diagonals wide.
    pub fn frame(&mut self, document: &Document) {
        let Some(bounds) = copies_bounds(document) else { return };
        self.is_walking = false;
        self.change_orbit(|_| {});
        self.orbit.frame(&bounds, self.aspect);
    }

    /// Switches to a standard view.
    pub fn look_from(&mut self, document: &Document, view: usize) {
        let Some(bounds) = copies_bounds(document) else { return };
        self.is_walking = false;
        self.change_orbit(|_| {});
        self.orbit = Orbit::fitting(&bounds, viewport::standard_view(view), self.aspect);
    }

    /// Starts or ends walk mode; ending it frames all copies.
    pub fn set_walking(&mut self, document: &Document, is_walking: bool) {
        let (Some(stage), Some(base)) = (document.stage(), document.stage_base()) else { return };
        self.is_walking = is_walking;
        if is_walking {
            self.is_placing = false;
            let bounds = copies_bounds(document).map_or(1.0, |b| b.max[0].max(b.max[2]));
            let height = stage.view.eye_height * eye_reference_height(&base);
            self.eye_height = height;
            self.change_orbit(|o| walk::start_walking(o, height, bounds + base.length(), base.length()));
        } else {
            self.frame(document);
        }
    }

    /// Applies the keys held in walk mode. They are consumed from the input, so that they have no other
    /// effect.
    pub fn walk_by_keys(&mut self, ctx: &egui::Context, document: &Document) {
        let (Some(stage), Some(base)) = (document.stage(), document.stage_base()) else { return };
        if !self.is_walking {
            return;
        }
        const KEYS: [Key; 10] = [
            Key::W,
            Key::A,
            Key::S,
            Key::D,
            Key::Q,
            Key::E,
            Key::ArrowUp,
            Key::ArrowDown,
            Key::ArrowLeft,
            Key::ArrowRight,
        ];
        let (held, hurries, secs, is_over) = ctx.input_mut(|i| {
            let m = i.modifiers;
            let is_plain = !(m.command || m.ctrl || m.alt);
            let held = KEYS.map(|key| is_plain && i.key_down(key));
            if is_plain {
                for key in KEYS {
                    while i.consume_key(Modifiers::NONE, key) {}
                }
            }
            (held, m.shift, f64::from(i.stable_dt.min(0.1)), i.consume_key(Modifiers::NONE, Key::Escape))
        });
        if is_over {
            return self.set_walking(document, false);
        }
        if !held.contains(&true) {
            return;
        }
        let axis = |plus: bool, minus: bool| f64::from(i8::from(plus) - i8::from(minus));
        let [w, a, s, d, q, e, up, down, left, right] = held;
        let length = stage.view.speed * base.length() * secs * if hurries { RUN_FACTOR } else { 1.0 };
        let by = DVec3::new(axis(d, a), axis(e, q), axis(w || up, s || down)) * length;
        let turn = axis(right, left) * LOOK_PER_SECOND * secs;
        self.change_orbit(|o| {
            walk::step(o, by);
            walk::look(o, turn, 0.0);
        });
        ctx.request_repaint();
    }

    /// Shows the stage in the remaining space. Pushes the requests made with the mouse.
    pub(crate) fn show(
        &mut self,
        ui: &mut Ui,
        document: &Document,
        gpu: Option<&mut Gpu>,
        own: &UserFiles,
        pose: &ModelPose,
        requests: &mut Vec<UiRequest>,
    ) {
        let rect = ui.available_rect_before_wrap();
        ui.allocate_rect(rect, Sense::hover());
        let (Some(stage), Some(base), Some(original)) =
            (document.stage(), document.stage_base(), document.original())
        else {
            return;
        };
        self.aspect = viewport::aspect(rect);
        self.frame_new_file(document, &original.content.path);
        let copies = document.current_placements();
        self.selected.retain(|n| *n < copies.len());
        self.follow_camera_keyframes(document);
        let response = viewport::picture_area(ui, rect, "Picture of the stage");
        let height = stage.view.eye_height * eye_reference_height(&base);
        if self.is_walking && self.eye_height != height {
            self.eye_height = height;
            self.change_orbit(|o| walk::set_height(o, height));
        }
        let shown = StageScene { document, copies, base, levels: document.stage_levels(), pose, rect };
        self.handle_mouse(&response, &shown, requests);

        let begin = Instant::now();
        let height_px = f64::from(rect.height() * ui.pixels_per_point());
        let eye = Viewpoint { camera: self.orbit.camera(), aspect: self.aspect, height_px };
        let numbers: Vec<_> = shown.levels.iter().map(|l| l.level).collect();
        let is_moving = self.last_moved.is_some_and(|at| at.elapsed() < CAMERA_REST);
        let is_hurried = is_moving && gpu.as_ref().is_some_and(|gpu| gpu.is_software());
        let budget = if is_hurried { stage.view.budget.min(MOVING_BUDGET) } else { stage.view.budget };
        let view = super::StageDisplay { budget, ..stage.view };
        let chosen = self.chooser.choose(&shown.copies, &base, &numbers, &eye, &view);
        let counts = chosen.counts(numbers.len());
        let of_level = |(level, copies): (&super::levels::LodLevel, usize)| LevelStatus {
            faces: level.faces,
            distance: switch_distance(level, &eye, chosen.pixels),
            copies,
        };
        self.status.levels = numbers.iter().zip(counts).map(of_level).collect();
        self.status.chosen = chosen;
        let painter = ui.painter_at(rect);
        let below = painter.add(egui::Shape::Noop);
        let mut spent = begin.elapsed();
        if let Some(gpu) = gpu {
            spent += self.draw(ui, gpu, own, &shown);
        }
        if !self.target.as_ref().is_some_and(RenderTarget::has_picture) {
            painter.set(below, egui::Shape::rect_filled(rect, 0.0, palette(ui).window));
        }
        self.status.secs = spent.as_secs_f64();
        self.status.longest_secs = self.status.longest_secs.max(self.status.secs);
        self.draw_rings(ui, &response, &shown);
        self.draw_captions(ui, rect, document);
    }

    fn frame_new_file(&mut self, document: &Document, path: &PathBuf) {
        if self.framed_file.as_ref() == Some(path) {
            return;
        }
        self.framed_file = Some(path.clone());
        self.selected.clear();
        self.chooser.forget();
        self.status = StageStatus::default();
        self.is_placing = document.settings().stage.copies.is_empty();
        self.is_walking = false;
        self.look_from(document, 0);
        self.keyframes = KeyframeSelection::default();
        self.applied_keyframes = None;
        if let Some(pose) = self.pending_pose.take() {
            self.orbit = Orbit::of(&pose.camera());
            // The camera of a session stays until the time or the camera keyframes change.
            self.applied_keyframes =
                Some((document.moment(), document.settings().stage.motion.camera.clone()));
        }
    }

    /// Sets the camera from its keyframes whenever the time or the keyframes change.
    fn follow_camera_keyframes(&mut self, document: &Document) {
        let (motion, moment) = (&document.settings().stage.motion, document.moment());
        if moment != self.moment {
            self.moment = moment;
            self.last_moved = Some(Instant::now());
        }
        let Some(placement) = motion.camera.at(moment).filter(|_| !motion.has_free_camera) else {
            self.applied_keyframes = None;
            return;
        };
        let is_there =
            self.applied_keyframes.as_ref().is_some_and(|(m, track)| *m == moment && *track == motion.camera);
        if !is_there {
            self.change_orbit(|orbit| placement.apply_to(orbit));
            self.applied_keyframes = Some((moment, motion.camera.clone()));
        }
    }

    /// Draws the stage and returns the CPU time used.
    fn draw(&mut self, ui: &Ui, gpu: &mut Gpu, own: &UserFiles, shown: &StageScene<'_>) -> Duration {
        let begin = Instant::now();
        let StageScene { document, copies, base, levels, pose, rect } = shown;
        let settings = document.settings();
        let stage = &settings.stage;
        let size = drawing::pixels_of(ui, *rect);
        let is_many = self.status.chosen.triangles > MAX_FULL_SIZE_TRIANGLES;
        let is_moving = drawing::rests_in(ui.ctx(), self.last_moved).is_some();
        let is_coarse = is_moving && gpu.is_software() && is_many;
        let target = self.target.get_or_insert_with(|| gpu.target(size));
        let locked: Vec<_> =
            levels.iter().map(|l| l.draw.map(|d| d.lock().unwrap_or_else(PoisonError::into_inner))).collect();
        let placed: Vec<PlacedModel<'_>> = self
            .status
            .chosen
            .visible
            .iter()
            .filter_map(|seen| {
                Some(PlacedModel {
                    world_from_model: base.stage_from(&copies[seen.copy]),
                    selected: self.selected.contains(&seen.copy),
                    tint: if stage.view.has_level_colors { level_tint(seen.level) } else { 0 },
                    ..PlacedModel::new(locked[seen.level].as_deref()?, pose)
                })
            })
            .collect();
        let lighting = settings.look.lighting();
        let mut look = settings.look.look.clone();
        if look.shading == Shading::Heat {
            // Levels have no distances for the heat map.
            look.shading = Shading::Smooth;
        }
        let frame = Frame {
            models: &placed,
            bounds: base.bounds(stage.all_placements()),
            camera: self.orbit.camera(),
            look: &look,
            lighting: &lighting,
            background: settings.look.backdrop.background(ui.visuals().dark_mode),
            ground: true,
            matcap: own.matcap(),
            marks_stand_out: false,
            environment: own.environment(),
            shader: own.shader(),
        };
        self.is_smoothing = gpu.is_software() && !is_coarse;
        if self.is_smoothing {
            self.is_smoothing = self.smoothing.resize(ui.ctx(), target, &frame, size);
        } else {
            target.resize(size, if is_coarse { COARSE_SCALE } else { 1.0 });
        }
        let ready = begin.elapsed();
        // A picture in parts would never be completed if every frame differs.
        let drawn = if is_coarse { gpu.draw(target, &frame) } else { gpu.draw_in_parts(target, &frame) };
        if let Some(texture) = target.texture_id() {
            drawing::paint(&ui.painter_at(*rect), *rect, texture);
        }
        if let Some(share) = drawn.completed_fraction() {
            viewport::drawing_line(ui, *rect, share);
            ui.request_repaint();
        }
        ready + drawn.cpu_time
    }

    /// Returns the copy under a screen position, of those drawn.
    fn copy_at(&self, shown: &StageScene<'_>, at: Pos2) -> Option<usize> {
        let StageScene { copies, base, levels, pose, rect, .. } = shown;
        let model_of = |copy: usize| {
            let seen = self.status.chosen.visible.iter().find(|s| s.copy == copy)?;
            Some(levels.get(seen.level)?.model)
        };
        ground::copy_under(copies, base, pose, &self.orbit.camera(), *rect, at, model_of)
    }

    fn handle_mouse(&mut self, response: &Response, shown: &StageScene<'_>, requests: &mut Vec<UiRequest>) {
        let StageScene { document, copies, base, rect, .. } = shown;
        let (rect, secs) = (*rect, document.moment());
        let (modifiers, pressed_at) = response.ctx.input(|i| (i.modifiers, i.pointer.press_origin()));
        let dragged = response.dragged_by(PointerButton::Primary);
        let by = response.drag_delta();
        if self.is_walking {
            if dragged && by != Vec2::ZERO {
                let turn = |points: f32| f64::from(points) * LOOK_PER_POINT;
                self.change_orbit(|o| walk::look(o, turn(by.x), -turn(by.y)));
            }
            return;
        }
        let change = |change: StageChange| UiRequest::Command(Command::Stage(change));
        let is_turning = modifiers.alt || modifiers.command;
        let is_plain = !is_turning && !modifiers.shift && !self.is_placing;
        if response.drag_started_by(PointerButton::Primary)
            && is_plain
            && let Some(at) = pressed_at
            && let Some(copy) = self.copy_at(shown, at)
        {
            if !self.selected.contains(&copy) {
                self.select([copy]);
            }
            // Drag in a plane at half the copy's height, so that it stays under the pointer.
            let height = base.bounding_sphere(&copies[copy]).0.y;
            if let Some(from) = ground::on_plane(&self.orbit.camera(), rect, at, height) {
                // Pause the animation while copies are dragged.
                if document.is_playing() {
                    requests.push(UiRequest::Action(Action::Play));
                }
                self.drag = Some(CopyDrag { from, copies: self.selected(document) });
            }
        }
        if !response.dragged() {
            self.drag = None;
        }
        if let (Some(drag), Some(pointer)) = (&self.drag, response.interact_pointer_pos()) {
            if let Some(to) = ground::on_plane(&self.orbit.camera(), rect, pointer, drag.from.y) {
                let by = to - drag.from;
                let moved =
                    drag.copies.iter().map(|(n, c)| (*n, Placement { x: c.x + by.x, z: c.z + by.z, ..*c }));
                requests.push(change(StageChange::Move { copies: moved.collect(), secs }));
            }
        } else if dragged && is_turning && !self.selected.is_empty() {
            let (turn, factor) =
                (f64::from(by.x) * TURN_DEG_PER_POINT, (f64::from(-by.y) / SCALE_POINTS).exp());
            requests.extend(self.change_selected(document, |c| Placement {
                turn_deg: c.turn_deg + turn,
                scale: c.scale * factor,
                ..*c
            }));
        } else if self.orbit.interact(response, rect) {
            self.last_moved = Some(Instant::now());
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            if self.is_placing {
                if let Some(place) = ground::on_ground(&self.orbit.camera(), rect, at) {
                    requests.push(change(StageChange::Add(vec![Placement::at(place.x, place.z)])));
                    self.select([copies.len()]);
                }
            } else {
                match self.copy_at(shown, at) {
                    Some(copy) if modifiers.shift => {
                        if !self.selected.remove(&copy) {
                            self.selected.insert(copy);
                        }
                    }
                    Some(copy) => self.select([copy]),
                    None => self.selected.clear(),
                }
            }
        }
        if response.double_clicked()
            && !self.is_placing
            && let Some(at) = response.interact_pointer_pos()
        {
            let under = self.copy_at(shown, at);
            let copy = under.map(|n| base.bounding_sphere(&copies[n]).0);
            if let Some(place) = copy.or_else(|| ground::on_ground(&self.orbit.camera(), rect, at)) {
                self.change_orbit(|o| o.target = place);
            }
        }
    }

    /// Returns the request that changes all selected copies.
    pub fn change_selected(
        &self,
        document: &Document,
        of: impl Fn(&Placement) -> Placement,
    ) -> Option<UiRequest> {
        let copies: Vec<_> = self.selected(document).iter().map(|(n, c)| (*n, of(c))).collect();
        let secs = document.moment();
        (!copies.is_empty()).then_some(UiRequest::Command(Command::Stage(StageChange::Move { copies, secs })))
    }

    /// Draws circles on the ground around selected copies, and where a click would place a copy.
    fn draw_rings(&self, ui: &Ui, response: &Response, shown: &StageScene<'_>) {
        let StageScene { copies, base, rect, .. } = shown;
        let rect = *rect;
        let camera = self.orbit.camera();
        let p = palette(ui);
        let painter = ui.painter_at(rect);
        let ring = |at: DVec3, scale: f64, color: Color32| {
            let line = ground::circle(&camera, rect, at, base.footprint() * scale);
            if !line.is_empty() {
                painter.add(egui::Shape::closed_line(line, Stroke::new(2.0, color)));
            }
        };
        for copy in self.selected.iter().take(MAX_RINGS).filter_map(|n| copies.get(*n)) {
            ring(DVec3::new(copy.x, 0.0, copy.z), copy.scale, p.accent);
        }
        let hovered = response.hover_pos().filter(|_| self.is_placing && !response.dragged());
        if let Some(place) = hovered.and_then(|at| ground::on_ground(&camera, rect, at)) {
            ring(place, 1.0, p.weak);
        }
    }

    /// Draws the status text, hints, and the legend of level colours.
    fn draw_captions(&self, ui: &Ui, rect: Rect, document: &Document) {
        let stage = &document.settings().stage;
        let p = palette(ui);
        let painter = ui.painter_at(rect);
        let chosen = &self.status.chosen;
        let mut text = match stage.copies.len() {
            1 => "1 copy".to_owned(),
            n => format!("{} copies", grouped(n)),
        };
        if !chosen.visible.is_empty() {
            let triangles = usize::try_from(chosen.triangles).unwrap_or(usize::MAX);
            text += &format!(
                "  ·  {} visible  ·  {} triangles",
                grouped(chosen.visible.len()),
                grouped(triangles)
            );
            text += &format!("  ·  error up to {} px", significant(chosen.largest_px(), 2));
        }
        if chosen.left_out > 0 {
            text += &format!("  ·  {} omitted", grouped(chosen.left_out));
        }
        viewport::caption(ui, rect, "Stage", &text, false);
        let hint = if document.awaits_levels() {
            "Making levels; until then only some copies are drawn"
        } else if self.is_walking {
            "W A S D walk, Q and E move down and up, drag looks around, Shift walks faster, Esc exits"
        } else if self.is_placing && stage.copies.is_empty() {
            "Click on the ground to place a copy, or scatter copies from the panel"
        } else if self.is_placing {
            "Click on the ground to place a copy"
        } else if stage.copies.is_empty() {
            "No copies yet: place or scatter some"
        } else {
            ""
        };
        if !hint.is_empty() {
            let galley = painter.layout_no_wrap(hint.to_owned(), egui::FontId::proportional(13.0), p.text);
            let size = galley.size() + Vec2::new(24.0, 12.0);
            let place =
                Rect::from_center_size(pos2(rect.center().x, rect.bottom() - 12.0 - size.y / 2.0), size);
            painter.rect_filled(place, 5.0, p.panel.gamma_multiply(0.92));
            painter.galley(place.min + Vec2::new(12.0, 6.0), galley, p.text);
        }
        if stage.view.has_level_colors {
            self.draw_legend(&painter, p, rect);
        }
    }

    fn draw_legend(&self, painter: &egui::Painter, p: &Palette, rect: Rect) {
        const LINE: f32 = 18.0;
        let rows = self.status.levels.len() as f32;
        let size = Vec2::new(196.0, rows * LINE + 16.0);
        if rect.height() < size.y + 80.0 || rect.width() < size.x + 24.0 {
            return;
        }
        let place = Rect::from_min_size(pos2(rect.right() - size.x - 10.0, rect.top() + 10.0), size);
        painter.rect_filled(place, 5.0, p.panel.gamma_multiply(0.92));
        let font = egui::FontId::monospace(11.5);
        for (k, level) in self.status.levels.iter().enumerate() {
            let y = place.top() + 8.0 + LINE * (k as f32 + 0.5);
            let dot = Rect::from_center_size(pos2(place.left() + 16.0, y), Vec2::splat(10.0));
            let line = Stroke::new(1.0, p.weak);
            painter.rect(dot, 2.0, level_color(k), line, egui::StrokeKind::Inside);
            let color = if level.copies > 0 { p.text } else { p.weak };
            let faces = grouped(usize::try_from(level.faces).unwrap_or(usize::MAX));
            let text =
                |x: f32, align, text: String| painter.text(pos2(x, y), align, text, font.clone(), color);
            text(place.left() + 30.0, egui::Align2::LEFT_CENTER, format!("{k}  {faces}"));
            text(place.right() - 10.0, egui::Align2::RIGHT_CENTER, format!("× {}", grouped(level.copies)));
        }
    }
}

/// Maximum number of rings; more would only hide the ground.
const MAX_RINGS: usize = 200;

/// Returns the number of a level's colour in [`TINTS`], counted from 1.
fn level_tint(level: usize) -> u8 {
    level.min(TINTS.len() - 1) as u8 + 1
}

/// Returns the colour of a level.
pub fn level_color(level: usize) -> Color32 {
    let [r, g, b] = TINTS[level.min(TINTS.len() - 1)].map(|c| (c * 255.0).round() as u8);
    Color32::from_rgb(r, g, b)
}

/// Returns the reference height for the eye: the model's height, at least a tenth of its diagonal.
pub fn eye_reference_height(base: &ModelBase) -> f64 {
    base.size.y.max(0.1 * base.length())
}

/// Returns a bounding box of all copies; without copies, one three model diagonals wide.
fn copies_bounds(document: &Document) -> Option<lodsmith_core::Bounds> {
    let base = document.stage_base()?;
    let copies = document.current_placements();
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for copy in copies.iter() {
        let (centre, radius) = base.bounding_sphere(copy);
        min = min.min(centre - radius);
        max = max.max(centre + radius);
    }
    if copies.is_empty() {
        return Some(lodsmith_core::Bounds {
            min: [-1.5 * base.length(), 0.0, -1.5 * base.length()],
            max: [1.5 * base.length(), base.size.y, 1.5 * base.length()],
        });
    }
    min.y = 0.0;
    Some(lodsmith_core::Bounds { min: min.to_array(), max: max.to_array() })
}
