//! The comparison view: pictures of both sides, and mouse input over them.

mod difference;
mod probe;

use std::sync::{Arc, PoisonError};

use eframe::egui::{self, Color32, PointerButton, Rect, Response, Sense, Ui, Vec2, pos2};
use glam::{DQuat, DVec3};
use lodsmith_core::model::Pose;
use lodsmith_core::{Bounds, Model};
use lodsmith_render::{Camera, Look, Shading};
use web_time::Instant;

use crate::command::Command;
use crate::content::difference::DifferencePicture;
use crate::content::flaws::FlawPlace;
use crate::content::{Distances, Lighter};
use crate::document::Document;
use crate::gpu::preview_mesh;
use crate::gpu::shown::{Drawing, ShownModel};
use crate::gpu::{Frame, Gpu, PlacedModel, RenderTarget};
use crate::numbers::{grouped, percent, significant};
use crate::panel::{UiRequest, error};
use crate::settings::{Layout, Sides};
use crate::stage::picture::StageView;
use crate::theme::palette;
use crate::view::drawing::{self, COARSE_SCALE, MAX_FULL_SIZE_TRIANGLES, Smoothing};
use crate::view::orbit::{Orbit, moved_bounds, turn_matrix, turned_bounds};
use crate::view::user_files::UserFiles;
use crate::view::viewport;

/// One of the two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The file, unchanged.
    Original,
    /// The simplified mesh.
    Result,
}

impl Side {
    fn other(self) -> Self {
        match self {
            Self::Original => Self::Result,
            Self::Result => Self::Original,
        }
    }
    fn title(self) -> &'static str {
        match self {
            Self::Original => "Original",
            Self::Result => "Result",
        }
    }
    /// Returns the name by which tests and screen readers find it.
    fn picture(self) -> &'static str {
        match self {
            Self::Original => "Picture of the original",
            Self::Result => "Picture of the result",
        }
    }
}

/// Name of the difference picture for tests and screen readers.
const DIFFERENCE: &str = "Picture of the difference";

/// The pictures of both sides, with their cameras.
pub struct ComparisonView {
    gpu: Option<Gpu>,
    targets: [Option<RenderTarget>; 2],
    orbits: [Orbit; 2],
    /// Current pose of the model.
    pose: Pose,
    /// True while a key swaps the two sides.
    pub is_flickering: bool,
    /// Width over height of a picture, as last shown.
    pub aspect: f64,
    /// Height of a picture in pixels, as last shown.
    pub height_px: f64,
    /// Triangles of all pictures that are shown.
    pub triangles: u64,
    /// Stage view: copies on a ground, shown instead of the two sides.
    pub stage: StageView,
    /// Number of triangles of the last frame still to be drawn.
    pub triangles_left: u64,
    /// True until the antialiased picture of a scene at rest is complete.
    pub is_smoothing: bool,
    smoothings: [Smoothing; 2],
    moved: Option<Instant>,
    user_files: UserFiles,
    /// View to frame as soon as the size of the pictures is known.
    pending_view: Option<usize>,
    /// The difference picture on the screen.
    difference: Option<(Arc<DifferencePicture>, egui::TextureHandle)>,
    /// The clicked point.
    probe: Option<Probe>,
}

/// A clicked point.
#[derive(Clone)]
struct Probe {
    side: Side,
    place: DVec3,
    value: f64,
    of: Arc<Distances>,
    pose: Pose,
    turn: DQuat,
}

/// Smallest radius that a place of interest is shown with, in diagonals of the model.
const MIN_PLACE_RADIUS: f64 = 0.03;
/// Rotation of the light per point of mouse movement.
const LIGHT_DEG_PER_POINT: f32 = 0.4;
/// Length of a drag, in points, that changes the target by a factor of e.
const DETAIL_DRAG_POINTS: f32 = 120.0;

impl ComparisonView {
    /// Creates the pictures of an adapter; without one, nothing is drawn.
    pub fn new(gpu: Option<Gpu>) -> Self {
        let bounds = Bounds { min: [-0.5; 3], max: [0.5; 3] };
        let orbit = Orbit::fitting(&bounds, viewport::standard_view(0), 1.0);
        Self {
            gpu,
            targets: [None, None],
            orbits: [orbit; 2],
            pose: Pose::default(),
            is_flickering: false,
            aspect: 1.0,
            height_px: 600.0,
            triangles: 0,
            triangles_left: 0,
            stage: StageView::default(),
            is_smoothing: false,
            smoothings: [Smoothing::default(); 2],
            moved: None,
            user_files: UserFiles::default(),
            pending_view: None,
            difference: None,
            probe: None,
        }
    }

    /// Returns the adapter.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.gpu.as_ref()
    }

    /// Sets the pose of the model.
    pub fn set_pose(&mut self, pose: Pose) {
        if pose != self.pose {
            self.pose = pose;
            self.moved = Some(Instant::now());
        }
    }

    /// Reads the user's own appearance files that the settings name, and rereads changed ones. Returns an
    /// error message, if any.
    pub fn follow_files(&mut self, document: &Document, have_changed: bool) -> Option<String> {
        let has_metal = document.original().is_some_and(|o| o.content.model().has_metal());
        self.user_files.follow(self.gpu.as_ref(), &document.settings().look, has_metal, have_changed);
        if have_changed {
            self.targets.iter_mut().flatten().for_each(RenderTarget::forget);
        }
        self.user_files.error()
    }

    /// Returns the camera of a side.
    pub fn orbit(&self, side: Side) -> Orbit {
        self.orbits[side as usize]
    }

    /// Sets the camera of a side, or of both if they are linked.
    pub fn set_orbit(&mut self, side: Side, orbit: Orbit, linked: bool) {
        self.orbits[side as usize] = orbit;
        if linked {
            self.orbits = [orbit; 2];
        }
    }

    /// Changes the cameras of both sides.
    pub fn each_orbit(&mut self, change: impl Fn(&mut Orbit)) {
        self.orbits.iter_mut().for_each(change);
    }

    /// Draws the pictures in the remaining space and pushes requests of the mouse. Returns a factor for the
    /// target, if one was dragged.
    pub fn show(&mut self, ui: &mut Ui, document: &Document, requests: &mut Vec<UiRequest>) -> Option<f64> {
        if document.stage().is_some() {
            self.stage.show(ui, document, self.gpu.as_mut(), &self.user_files, &self.pose, requests);
            (self.triangles, self.triangles_left) = (self.stage.triangles(), 0);
            self.is_smoothing = self.stage.is_smoothing;
            return None;
        }
        let all = ui.available_rect_before_wrap();
        ui.allocate_rect(all, Sense::hover());
        let layout = document.settings().layout;
        let slots = slots(layout, all);
        if let Some((rect, ..)) = slots.first() {
            self.aspect = viewport::aspect(*rect);
        }
        if let Some(view) = self.pending_view.take() {
            self.look_from(document, view);
        }
        let mut detail = None;
        let mut is_moved = false;
        let is_wiping = layout.sides == Sides::Wipe;
        let is_difference = layout.sides == Sides::Difference;
        if !is_difference {
            self.difference = None;
        }
        for &(rect, seen, side) in &slots {
            let response =
                viewport::picture_area(ui, seen, if is_difference { DIFFERENCE } else { side.picture() });
            detail = detail.or(detail_factor(&response));
            drag_light(&response, document, requests);
            let mut orbit = self.orbit(side);
            if orbit.interact(&response, rect) {
                is_moved = true;
                self.set_orbit(side, orbit, layout.linked || is_wiping || is_difference);
            }
            if response.double_clicked() {
                self.recentre(document, side, &response, rect);
            } else if response.clicked() && !is_difference {
                self.probe_at(document, side, &response, rect);
            }
        }
        if is_moved {
            self.moved = Some(Instant::now());
        }
        (self.triangles, self.triangles_left, self.is_smoothing) = (0, 0, false);
        for (slot, &(rect, seen, side)) in slots.iter().enumerate() {
            let shown = if self.is_flickering { side.other() } else { side };
            if is_difference && !self.is_flickering {
                self.draw_difference(ui, document, rect, requests);
                continue;
            }
            // A picture covers all that is below it, which a software renderer need not fill.
            let below = ui.painter().add(egui::Shape::Noop);
            if !self.draw(ui, document, slot, rect, seen, shown) {
                ui.painter().set(below, egui::Shape::rect_filled(seen, 0.0, palette(ui).window));
            }
            let (lighter, level) = self.result(document);
            let pixels = lighter.and_then(|l| self.pixels(document, l.content.error()));
            overlay(ui, document, seen, shown, lighter, level.zip(pixels));
            self.draw_probe(ui, document, side, rect, seen);
        }
        match layout.sides {
            Sides::Both => {
                let line = Rect::from_min_max(
                    pos2(all.center().x - 1.0, all.top()),
                    pos2(all.center().x + 1.0, all.bottom()),
                );
                ui.painter().rect_filled(line, 0.0, palette(ui).window);
            }
            Sides::Wipe => wipe(ui, all, layout, requests),
            _ => {}
        }
        detail
    }

    /// Returns the mesh of the result side: the result, or the automatic level for this distance with its
    /// number.
    fn result<'a>(&self, document: &'a Document) -> (Option<&'a ShownModel<Lighter>>, Option<usize>) {
        if document.levels().is_empty() {
            return (document.lighter(), None);
        }
        let (number, level) = document.level_for(self.allowed_error(document));
        (level, Some(number))
    }

    /// Returns the largest error that stays within the allowed pixels from this distance, in the units of the
    /// model.
    pub fn allowed_error(&self, document: &Document) -> f64 {
        let pixels = document.settings().auto_lod.pixels;
        self.pixels(document, 1.0).map_or(0.0, |per_unit| pixels / per_unit.max(1e-300))
    }

    /// Moves both cameras to a place of the model, in its own coordinates, seen from the side that the surface
    /// faces there.
    pub fn look_at(&mut self, document: &Document, place: &FlawPlace) {
        let Some(original) = document.original() else { return };
        let bounds = &original.content.bounds;
        let world = turn_matrix(bounds, document.rotation());
        let target = world.transform_point3(place.centre);
        let before = self.orbits[0].camera();
        let facing = world.transform_vector3(place.facing).normalize_or(before.eye - before.target);
        let radius = (1.5 * place.radius).max(MIN_PLACE_RADIUS * bounds.diagonal());
        let corner = DVec3::splat(radius / 3f64.sqrt());
        let around = Bounds { min: (target - corner).to_array(), max: (target + corner).to_array() };
        let camera = Camera { eye: target + facing, target, ..before };
        self.orbits = [Orbit::of(&camera.framing(&around, self.aspect)); 2];
    }

    /// Draws a side into its texture and paints that. Returns true if there is a picture.
    fn draw(
        &mut self,
        ui: &Ui,
        document: &Document,
        slot: usize,
        rect: Rect,
        seen: Rect,
        side: Side,
    ) -> bool {
        let lighter = self.result(document).0.filter(|_| side == Side::Result);
        let (Some(gpu), Some(original)) = (self.gpu.as_mut(), document.original()) else { return false };
        let drawing: Option<&Drawing> = lighter.map_or(original.draw.as_ref(), |l| l.draw.as_ref());
        let Some(drawing) = drawing else { return false };
        let size = drawing::pixels_of(ui, rect);
        self.height_px = f64::from(size[1]);

        let faces = lighter.map_or(original.content.faces, |l| l.content.faces);
        let is_moving = drawing::rests_in(ui.ctx(), self.moved).is_some();
        let is_coarse = is_moving && gpu.is_software() && faces as u64 > MAX_FULL_SIZE_TRIANGLES;
        let [first, second] = &mut self.targets;
        let (target, other) = if slot == 0 { (first, None) } else { (second, first.as_ref()) };
        let target = target.get_or_insert_with(|| gpu.target(size));
        if is_coarse {
            target.resize(size, COARSE_SCALE);
        }

        let settings = document.settings();
        let turn = document.rotation();
        let look = shown_look(document);
        let lighting = settings.look.lighting();
        let drawing = drawing.lock().unwrap_or_else(PoisonError::into_inner);
        // Also for the first frame, so that something shows at once. The preview mesh has no distances for a
        // heat map.
        let has_time = !is_coarse && target.shows_model(&drawing);
        let is_large = faces > preview_mesh::PREVIEW_ABOVE_FACES;
        let is_light = !has_time && is_large && look.shading != Shading::Heat;
        let pictured = drawing.preview().filter(|_| is_light).unwrap_or(&drawing);
        let placed = PlacedModel {
            world_from_model: turn_matrix(&original.content.bounds, turn),
            ..PlacedModel::new(pictured, &self.pose)
        };
        let is_first = slot == 0 && settings.layout.sides != Sides::Result;
        let frame = Frame {
            models: &[placed],
            bounds: turned_bounds(&original.content.bounds, turn),
            camera: self.orbits[usize::from(!is_first)].camera(),
            look: &look,
            lighting: &lighting,
            background: settings.look.backdrop.background(ui.visuals().dark_mode),
            ground: settings.look.ground,
            matcap: self.user_files.matcap(),
            environment: self.user_files.environment(),
            marks_stand_out: true,
            shader: self.user_files.shader(),
        };
        // Sides that show the same frame share one picture.
        let is_same = |other: &&RenderTarget| other.shows(&frame) || other.draws(&frame);
        let same = other.filter(|other| other.screen_px() == size && is_same(other));
        if same.is_none() && !is_coarse {
            if gpu.is_software() {
                self.is_smoothing |= self.smoothings[slot.min(1)].resize(ui.ctx(), target, &frame, size);
            } else {
                target.resize(size, 1.0);
            }
        }
        self.triangles += pictured.triangles();
        let mut part = None;
        if same.is_none() {
            // A picture drawn in parts never completes if the frame changes each time.
            let is_whole = is_coarse && (is_light || !is_large);
            let drawn = if is_whole { gpu.draw(target, &frame) } else { gpu.draw_in_parts(target, &frame) };
            self.triangles_left += drawn.triangles_left;
            part = drawn.completed_fraction();
        }
        if self.triangles_left > 0 || is_light && !is_coarse {
            ui.request_repaint();
        }
        let shown = same.unwrap_or(target);
        if let Some(texture) = shown.texture_id() {
            drawing::paint(&ui.painter_at(seen), rect, texture);
        }
        if let Some(share) = part {
            viewport::drawing_line(ui, rect, share);
        }
        shown.has_picture()
    }

    /// Centres the camera on the clicked point; a click beside the model changes nothing.
    fn recentre(&mut self, document: &Document, side: Side, response: &Response, rect: Rect) {
        let Some(pointer) = response.interact_pointer_pos() else { return };
        let Some(original) = document.original() else { return };
        let model: &Model = match document.lighter().filter(|_| side == Side::Result) {
            Some(lighter) => &lighter.content.model,
            None => original.content.model(),
        };
        let mut orbit = self.orbit(side);
        let camera = orbit.camera();
        let along = viewport::ray(&camera, pointer - rect.center(), rect.height());
        let world = turn_matrix(&original.content.bounds, document.rotation());
        if let Some(place) = viewport::pick(model, &self.pose, world, camera.eye, along) {
            orbit.target = place;
            self.set_orbit(side, orbit, document.settings().layout.linked);
        }
    }

    /// Frames the whole model.
    pub fn frame(&mut self, document: &Document) {
        let orbits = self.orbits.map(|orbit| self.framed(document, orbit.camera()).unwrap_or(orbit));
        self.orbits = orbits;
    }

    /// Like [`ComparisonView::look_from`], when the pictures are next shown.
    pub fn look_from_next_frame(&mut self, view: usize) {
        self.pending_view = Some(view);
    }

    /// Frames the whole model from a standard view.
    pub fn look_from(&mut self, document: &Document, view: usize) {
        let Some(original) = document.original() else { return };
        let camera = Camera::fitting(&original.content.bounds, viewport::standard_view(view), self.aspect);
        if let Some(orbit) = self.framed(document, camera) {
            self.orbits = [orbit; 2];
        }
    }

    /// Returns an orbit with the direction of a camera that shows the posed and rotated model as large as
    /// possible. Cost: O(triangles).
    fn framed(&self, document: &Document, camera: Camera) -> Option<Orbit> {
        let original = &document.original()?.content;
        let turn = turn_matrix(&original.bounds, document.rotation());
        let standing = original.model().bounds(&self.pose).unwrap_or(original.bounds);
        let (model, bounds) = (original.model(), moved_bounds(&standing, &turn));
        Some(Orbit::of(&viewport::framed(model, &self.pose, turn, &bounds, camera, self.aspect)))
    }

    /// Returns the length in pixels of a segment at the centre of the model.
    pub fn pixels(&self, document: &Document, length: f64) -> Option<f64> {
        let bounds = rest_bounds(document)?;
        let middle = 0.5 * (DVec3::from(bounds.min) + DVec3::from(bounds.max));
        let camera = self.orbit(Side::Result).camera();
        Some(length / camera.length_per_pixel(camera.eye.distance(middle).max(1e-30), self.height_px))
    }
}

/// Returns the appearance of both sides, with the range of the heat map.
fn shown_look(document: &Document) -> Look {
    let mut look = document.settings().look.look.clone();
    if look.shading == Shading::Heat {
        match document.distances() {
            Some(distances) => {
                look.heat_range = Some(error::color_range(&look, document.heat_end(distances)))
            }
            // The distances are not known yet.
            None => look.shading = Shading::Smooth,
        }
    }
    look
}

/// Returns the pictures of a layout: the area of the whole picture, its visible part, and the side.
fn slots(layout: Layout, all: Rect) -> Vec<(Rect, Rect, Side)> {
    let half = Vec2::new((all.width() - 2.0) / 2.0, all.height());
    match layout.sides {
        Sides::Both => {
            let left = Rect::from_min_size(all.min, half);
            let right = Rect::from_min_size(pos2(all.right() - half.x, all.top()), half);
            vec![(left, left, Side::Original), (right, right, Side::Result)]
        }
        Sides::Wipe => {
            let x = all.left() + all.width() * layout.wipe.clamp(0.0, 1.0);
            let [mut left, mut right] = [all; 2];
            (left.max.x, right.min.x) = (x, x);
            vec![(all, left, Side::Original), (all, right, Side::Result)]
        }
        Sides::Original => vec![(all, all, Side::Original)],
        Sides::Result | Sides::Difference => vec![(all, all, Side::Result)],
    }
}

/// Returns the bounding box of the rotated model in its rest pose.
pub fn rest_bounds(document: &Document) -> Option<Bounds> {
    let original = document.original()?;
    Some(turned_bounds(&original.content.bounds, document.rotation()))
}

/// Returns the factor for the target of a drag with Ctrl or Alt held. Many Linux desktops move the window
/// when Alt is held.
fn detail_factor(response: &Response) -> Option<f64> {
    let is_held = response.ctx.input(|i| (i.modifiers.alt || i.modifiers.command) && !i.modifiers.shift);
    let is_dragged = response.dragged_by(PointerButton::Primary) && is_held;
    is_dragged.then(|| f64::from(-response.drag_delta().y / DETAIL_DRAG_POINTS).exp()).filter(|f| *f != 1.0)
}

/// Moves the light by a drag with Ctrl and Shift held.
fn drag_light(response: &Response, document: &Document, requests: &mut Vec<UiRequest>) {
    let is_held = response.ctx.input(|i| i.modifiers.command && i.modifiers.shift);
    let by = response.drag_delta();
    if is_held && response.dragged_by(PointerButton::Primary) && by != Vec2::ZERO {
        let mut look = document.settings().look.clone();
        look.lamp = Some(look.lamp().turned(by.x * LIGHT_DEG_PER_POINT, -by.y * LIGHT_DEG_PER_POINT));
        requests.push(UiRequest::Command(Command::Look(look)));
    }
}

/// Draws the draggable divider between the two sides.
fn wipe(ui: &Ui, all: Rect, layout: Layout, requests: &mut Vec<UiRequest>) {
    let x = all.left() + all.width() * layout.wipe.clamp(0.0, 1.0);
    let grab = Rect::from_min_max(pos2(x - 8.0, all.top()), pos2(x + 8.0, all.bottom()));
    let response = ui.interact(grab, ui.scope_id().with("wipe"), Sense::drag());
    response.widget_info(|| egui::WidgetInfo::slider(true, f64::from(layout.wipe), "Wipe"));
    let p = palette(ui);
    let response = response.on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    let color = if response.hovered() || response.dragged() { p.accent } else { Color32::WHITE };
    let painter = ui.painter_at(all);
    painter.vline(x, all.y_range(), egui::Stroke::new(2.0, color));
    let middle = pos2(x, all.center().y);
    painter.circle(middle, 11.0, p.panel, egui::Stroke::new(2.0, color));
    for side in [-1.0, 1.0] {
        let tip = [(7.0, 0.0), (3.0, -3.5), (3.0, 3.5)].map(|(x, y)| middle + Vec2::new(side * x, y));
        painter.add(egui::Shape::convex_polygon(tip.to_vec(), color, egui::Stroke::NONE));
    }
    if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        let wipe = ((pointer.x - all.left()) / all.width()).clamp(0.0, 1.0);
        requests.push(UiRequest::Command(Command::Layout(Layout { wipe, ..layout })));
    }
}

/// Draws the label of a side with its number of faces, and the legend of the heat map.
fn overlay(
    ui: &Ui,
    document: &Document,
    seen: Rect,
    side: Side,
    lighter: Option<&ShownModel<Lighter>>,
    level: Option<(usize, f64)>,
) {
    let Some(original) = document.original() else { return };
    let lighter = lighter.filter(|_| side == Side::Result);
    let faces = lighter.map_or(original.content.faces, |l| l.content.faces);
    let mut text = format!("{} faces", grouped(faces));
    if lighter.is_some() {
        let share = faces as f64 / original.content.faces.max(1) as f64;
        text += &format!("  ·  {}", percent(share));
    }
    if let Some((number, pixels)) = level.filter(|_| side == Side::Result) {
        text += &format!("  ·  level {number}  ·  {} px", significant(pixels, 2));
    }
    let is_right = document.settings().layout.sides == Sides::Wipe && side == Side::Result;
    viewport::caption(ui, seen, side.title(), &text, is_right);
    let look = &document.settings().look.look;
    if look.shading == Shading::Heat && side == Side::Result && document.lighter().is_some() {
        error::legend(ui, seen, document);
    }
}
