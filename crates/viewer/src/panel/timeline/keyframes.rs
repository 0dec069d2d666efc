//! Editing of the stage's keyframes in the timeline: set, select, drag, copy, delete.

use eframe::egui::{self, CursorIcon, Modifiers, Rect, Response, Sense, Shape, Stroke, Ui, Vec2, pos2};

use super::scale::{MARGIN, NAME_WIDTH, TimeScale, TimelineTrack};
use super::{PanelContext, widgets};
use crate::command::Command;
use crate::panel::UiRequest;
use crate::panel::keys::{Action, CopiesAction};
use crate::settings::playback::Playback;
use crate::stage::StageChange;
use crate::stage::motion::{Curve, KeyframeId, MAX_SECS, Motion, Mover, rounded_secs};
use crate::stage::status::{KeyframeDrag, KeyframeSelection};
use crate::theme::{palette, weak};

/// Half the size of a keyframe mark, and the distance within which the pointer hits it.
const MARK_RADIUS: f32 = 5.5;
const HIT_DISTANCE: f32 = 7.0;
/// Snapping of dragged keyframes: hundredths of a second.
const SNAPS_PER_SEC: f64 = 100.0;

/// Draws the row of keyframe actions; nothing without a stage.
pub(super) fn row(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let Some(stage) = scope.document.stage() else { return };
    let motion = stage.motion.clone();
    let facts = &scope.facts.stage;
    let (selected, chosen) = (!facts.selected.is_empty(), facts.keyframes.chosen.clone());
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.label(weak(ui, "Set keyframe:"));
        let tip = "Store the placement of the selected copies at the current time";
        scope.button(ui, Action::Copies(CopiesAction::Keyframe), "Copies", tip, selected);
        let tip = "Store the camera view at the current time";
        scope.button(ui, Action::Copies(CopiesAction::CameraKeyframe), "Camera", tip, true);
        ui.add_space(8.0);
        let is_any = !chosen.is_empty();
        let tip = "Paste the selected keyframes, the first at the current time";
        scope.button(ui, Action::Copies(CopiesAction::Duplicate), "Copy here", tip, is_any);
        scope.button(
            ui,
            Action::Copies(CopiesAction::Delete),
            "Delete key",
            "Delete the selected keyframes",
            is_any,
        );
        ui.add_space(8.0);
        let is_step = is_any && chosen.iter().all(|c| motion.curve(c.0) == Curve::Step);
        let key = Action::Copies(CopiesAction::Curve).key();
        let tip = format!("Hold each value until the next keyframe ({key} toggles)");
        for (text, is_on, curve) in
            [("Smooth", is_any && !is_step, Curve::Smooth), ("Steps", is_step, Curve::Step)]
        {
            let tip = if curve == Curve::Step {
                tip.clone()
            } else {
                "Interpolate along a curve through all keyframes".to_owned()
            };
            ui.add_enabled_ui(is_any, |ui| {
                if widgets::segment(ui, text, is_on, &tip) {
                    let with = motion.with(|m| chosen.iter().for_each(|c| m.set_curve(c.0, curve)));
                    scope.command(Command::Stage(StageChange::Motion(with)));
                }
            });
        }
        ui.add_space(8.0);
        let has_camera = !motion.camera.is_empty();
        ui.add_enabled_ui(has_camera, |ui| {
            let (action, tip) = (CopiesAction::FreeCamera, "Look through the animated camera");
            let is_on = has_camera && !motion.has_free_camera;
            scope.toggle(ui, Action::Copies(action), "Camera view", tip, is_on);
        });
    });
}

/// Draws the length of the timeline; it can be edited if there is a stage.
pub(super) fn length(ui: &mut Ui, scope: &mut PanelContext<'_>, length: f64) {
    let Some(stage) = scope.document.stage() else {
        ui.label(weak(ui, format!("of {length:.2} s")));
        return;
    };
    let mut secs = length;
    let least = stage.motion.last_secs().max(0.1);
    let drag = egui::DragValue::new(&mut secs).range(least..=MAX_SECS).speed(0.05).suffix(" s");
    let response = ui.add(drag.fixed_decimals(2)).on_hover_text("Duration of the stage animation");
    let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Stage duration"));
    ui.label(weak(ui, "of"));
    if secs != length {
        let with = stage.motion.with(|m| m.length_secs = Some(secs));
        scope.command(Command::Stage(StageChange::Motion(with)));
    }
}

/// Draws the keyframes of a lane and handles the mouse over them.
pub(super) fn lane(
    ui: &Ui,
    scope: &mut PanelContext<'_>,
    rect: Rect,
    scale: &TimeScale,
    track: &TimelineTrack,
    playback: &mut Playback,
) {
    let (Some(mover), Some(stage)) = (track.mover, scope.document.stage()) else { return };
    let bed = Rect::from_min_max(pos2(rect.left() + NAME_WIDTH, rect.top()), rect.max);
    let bed = bed.intersect(Rect::from_x_y_ranges(
        scale.x_range.min - MARGIN..=scale.x_range.max + MARGIN,
        rect.y_range(),
    ));
    let response = ui.interact(bed, ui.scope_id().with(("lane", mover)), Sense::click_and_drag());
    let name = format!("Keyframes of {}", track.name.to_lowercase());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Group, true, &name));
    let mut selection = scope.facts.stage.keyframes.clone();
    let before = selection.clone();
    if let Some(new) =
        handle_mouse(&response, scope, scale, &stage.motion, mover, &track.keys, &mut selection)
    {
        match new {
            LaneChange::Motion(motion) => scope.command(Command::Stage(StageChange::Motion(motion))),
            LaneChange::Moment(secs) => {
                if scope.document.is_playing() {
                    scope.action(Action::Play);
                }
                *playback = playback.at(scale.length, secs);
            }
        }
    }
    if selection != before {
        scope.requests.push(UiRequest::KeyframeSelection(selection));
    }
    paint(ui, scope, rect, scale, &response, (mover, &track.keys));
}

enum LaneChange {
    Motion(Motion),
    Moment(f64),
}

/// Handles the mouse: updates selection and drag, and returns a further change, if any.
fn handle_mouse(
    response: &Response,
    scope: &PanelContext<'_>,
    scale: &TimeScale,
    motion: &Motion,
    mover: Mover,
    keys: &[f64],
    selection: &mut KeyframeSelection,
) -> Option<LaneChange> {
    let (modifiers, pressed): (Modifiers, _) =
        response.ctx.input(|i| (i.modifiers, i.pointer.press_origin()));
    if response.drag_started()
        && let Some(at) = pressed
        && let Some(secs) = keyframe_at(scale, keys, at.x)
    {
        let name = (mover, secs);
        if !selection.chosen.contains(&name) {
            if !modifiers.shift {
                selection.chosen.clear();
            }
            selection.chosen.push(name);
        }
        let (names, before) = (selection.chosen.clone(), motion.clone());
        let from_secs = secs + scale.seconds_at(at.x) - scale.seconds_at(scale.x_of(secs));
        selection.drag = Some(KeyframeDrag { before, names, from_secs, keeps: modifiers.alt });
        return None;
    }
    // Only the dragged lane handles the drag.
    if response.dragged()
        && let Some(drag) = &selection.drag
        && let Some(pointer) = response.interact_pointer_pos()
    {
        let first = drag.names.iter().map(|n| n.1).fold(f64::INFINITY, f64::min);
        let last = drag.names.iter().map(|n| n.1).fold(0.0, f64::max);
        let by = (scale.seconds_at(pointer.x) - drag.from_secs).min((scale.length - last).max(0.0));
        // The first keyframe snaps; the others keep their distances to it.
        let to = ((first + by) * SNAPS_PER_SEC).round() / SNAPS_PER_SEC;
        let by = if by.abs() < 0.5 / SNAPS_PER_SEC { 0.0 } else { to - first };
        let mut new = Vec::new();
        let with = drag.before.with(|m| new = m.shift(&drag.names, by, drag.keeps));
        selection.chosen = new;
        return (with != *motion).then_some(LaneChange::Motion(with));
    }
    if response.drag_stopped() {
        selection.drag = None;
    }
    if !response.clicked() {
        return None;
    }
    let secs = response.interact_pointer_pos().and_then(|at| keyframe_at(scale, keys, at.x));
    let Some(secs) = secs else {
        selection.chosen.clear();
        return None;
    };
    let name: KeyframeId = (mover, secs);
    if !modifiers.shift {
        selection.chosen = vec![name];
        return (rounded_secs(scope.document.moment()) != secs).then_some(LaneChange::Moment(secs));
    }
    match selection.chosen.iter().position(|n| *n == name) {
        Some(at) => _ = selection.chosen.remove(at),
        None => selection.chosen.push(name),
    }
    None
}

/// Returns the keyframe under the pointer.
fn keyframe_at(scale: &TimeScale, keys: &[f64], x: f32) -> Option<f64> {
    let away = |secs: &f64| (scale.x_of(*secs) - x).abs();
    keys.iter().copied().filter(|s| away(s) <= HIT_DISTANCE).min_by(|a, b| away(a).total_cmp(&away(b)))
}

fn paint(
    ui: &Ui,
    scope: &PanelContext<'_>,
    rect: Rect,
    scale: &TimeScale,
    response: &Response,
    (mover, keys): (Mover, &[f64]),
) {
    let p = palette(ui);
    let painter = ui.painter_at(rect);
    let hovered = response.hover_pos().and_then(|at| keyframe_at(scale, keys, at.x));
    if hovered.is_some() {
        ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
    }
    let is_step = scope.document.stage().is_some_and(|s| s.motion.curve(mover) == Curve::Step);
    let y = rect.center().y;
    // A line shows interpolation between keyframes; steps have none.
    if !is_step && let (Some(first), Some(last)) = (keys.first(), keys.last()) {
        painter.hline(scale.x_of(*first)..=scale.x_of(*last), y, Stroke::new(1.5, p.weak));
    }
    let is_empty = scope.document.stage().is_some_and(|s| s.motion.is_empty());
    if is_empty {
        let hint = "Select copies or move the camera, then set a keyframe";
        let font = egui::TextStyle::Small.resolve(ui.style());
        painter.text(pos2(scale.x_range.min + 4.0, y), egui::Align2::LEFT_CENTER, hint, font, p.weak);
    }
    let selection = &scope.facts.stage.keyframes;
    for &secs in keys {
        let at = pos2(scale.x_of(secs), y);
        let is_chosen = selection.chosen.contains(&(mover, secs));
        let fill = if is_chosen { p.accent } else { p.panel };
        let line = if is_chosen || hovered == Some(secs) { p.text } else { p.weak };
        let points = [(0.0, -MARK_RADIUS), (MARK_RADIUS, 0.0), (0.0, MARK_RADIUS), (-MARK_RADIUS, 0.0)]
            .map(|(x, y)| at + Vec2::new(x, y));
        painter.add(Shape::convex_polygon(points.to_vec(), fill, Stroke::new(1.5, line)));
    }
    if let Some(secs) = hovered.filter(|_| !response.dragged()) {
        response.clone().on_hover_text(format!("{secs:.2} s"));
    }
}
