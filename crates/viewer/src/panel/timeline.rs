//! Timeline panel: playback controls, and a lane for each animated object.

mod keyframes;
mod scale;

use eframe::egui::{self, Rangef, Rect, Response, Sense, Stroke, Ui, Vec2, pos2};
use lodsmith_core::Model;

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::document::Document;
use crate::panel::keys::Action;
use crate::settings::playback::{Playback, SPEED_RANGE, clip_names, keyframes as of_clip};
use crate::stage::motion::Mover;
use crate::theme::palette;
use scale::{MARGIN, NAME_WIDTH, TimeScale, TimelineTrack};

const RULER_HEIGHT: f32 = 26.0;
const LANE_HEIGHT: f32 = 20.0;

/// Number of visible lanes; further ones are scrolled to.
const MAX_VISIBLE_LANES: usize = 6;

/// Returns all lanes from top to bottom.
fn tracks(document: &Document, model: &Model, playback: &Playback) -> Vec<TimelineTrack> {
    let clip = playback.clip.filter(|c| *c < model.animations.len());
    let from_file =
        |c| TimelineTrack { name: clip_names(model).swap_remove(c), keys: of_clip(model, c), mover: None };
    let mut all: Vec<TimelineTrack> = clip.map(from_file).into_iter().collect();
    if let Some(stage) = document.stage() {
        let of = |name: String, mover| TimelineTrack {
            name,
            keys: stage.motion.moments(mover),
            mover: Some(mover),
        };
        all.push(of("Camera".to_owned(), Mover::Camera));
        all.extend(stage.motion.copies.keys().map(|n| of(format!("Copy {}", n + 1), Mover::Copy(*n))));
    }
    all
}

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let Some(original) = document.original() else {
        widgets::empty_note(ui, "Open a file to see its animations");
        return;
    };
    let model = original.content.model();
    if model.animations.is_empty() && document.stage().is_none() {
        let text =
            "No animations in this file (glTF and GLB can have them); copies on the stage can have keyframes";
        widgets::empty_note(ui, text);
        return;
    }
    let before = document.settings().playback;
    let mut playback = before;
    ui.horizontal(|ui| transport(ui, scope, model, &mut playback));
    keyframes::row(ui, scope);
    lanes(ui, scope, model, &mut playback);
    if playback != before {
        scope.command(Command::Playback(playback));
    }
}

/// Draws the playback controls: play, step, clip, looping, speed, time.
fn transport(ui: &mut Ui, scope: &mut PanelContext<'_>, model: &Model, playback: &mut Playback) {
    let is_playing = scope.document.is_playing();
    let (name, text) = if is_playing {
        ("Pause", "Pause at the current time")
    } else {
        ("Play", "Play from the current time")
    };
    let button = egui::Button::new(name).min_size(Vec2::new(64.0, 0.0));
    if ui.add(button).on_hover_text(Action::Play.tip(text)).clicked() {
        scope.action(Action::Play);
    }
    for (action, name, text) in [
        (Action::GoToStart, "|<", "Go to start"),
        (Action::StepTime(-1), "<", "Previous frame"),
        (Action::StepTime(1), ">", "Next frame"),
    ] {
        let response = ui.button(name).on_hover_text(action.tip(text));
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, text));
        if response.clicked() {
            scope.action(action);
        }
    }
    ui.add_space(8.0);
    if !model.animations.is_empty() {
        clips(ui, model, playback);
    }
    let text = "Start over at the end";
    if widgets::segment(ui, "Loop", playback.repeats, &Action::Repeat.tip(text)) {
        playback.repeats = !playback.repeats;
    }
    ui.add_space(8.0);
    let mut speed = playback.speed;
    let drag =
        egui::DragValue::new(&mut speed).range(SPEED_RANGE[0]..=SPEED_RANGE[1]).speed(0.01).max_decimals(2);
    let keys = format!("{} and {}", Action::Speed(-1).key(), Action::Speed(1).key());
    let response =
        ui.add(drag.suffix(" ×")).on_hover_text(format!("Playback speed ({keys} halve and double it)"));
    let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Speed"));
    if response.changed() {
        *playback = playback.at_speed(speed);
    }
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        let length = scope.document.timeline_secs();
        keyframes::length(ui, scope, length);
        let is_good = |t: &str| seconds_of(t).is_some();
        let now = format!("{:.2}", playback.moment(length));
        if let Some(text) = widgets::text_field(ui, "Time", &now, "", 72.0, is_good)
            && let Some(seconds) = seconds_of(&text)
        {
            *playback = playback.at(length, seconds);
        }
    });
}

/// Draws the list of animations, with an entry for none.
fn clips(ui: &mut Ui, model: &Model, playback: &mut Playback) {
    let names = clip_names(model);
    let before = playback.clip;
    let shown = before.and_then(|c| names.get(c)).map_or("Rest pose", String::as_str);
    let combo = egui::ComboBox::from_id_salt("clip").width(168.0).truncate().selected_text(shown);
    let response = combo.show_ui(ui, |ui| {
        ui.selectable_value(&mut playback.clip, None, "Rest pose");
        for (i, name) in names.iter().enumerate() {
            ui.selectable_value(&mut playback.clip, Some(i), name);
        }
    });
    let response = response.response;
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "Animation"));
    response.on_hover_text(format!("Animation to play ({} selects the next)", Action::NextClip.key()));
    if playback.clip != before {
        playback.seconds = 0.0;
    }
}

/// Parses a typed time.
fn seconds_of(text: &str) -> Option<f64> {
    let number = text.trim().trim_end_matches('s').trim().parse::<f64>().ok();
    number.filter(|s| s.is_finite() && *s >= 0.0)
}

/// Draws the ruler, a lane for each track, and the time line across all of them.
fn lanes(ui: &mut Ui, scope: &mut PanelContext<'_>, model: &Model, playback: &mut Playback) {
    let tracks = tracks(scope.document, model, playback);
    let length = scope.document.timeline_secs();
    let (ruler, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), RULER_HEIGHT), Sense::hover());
    let reach = Rangef::new(ruler.left() + NAME_WIDTH + MARGIN, ruler.right() - MARGIN);
    let scale = TimeScale { x_range: reach, length };
    let (moment, p) = (playback.moment(length), palette(ui));
    let ruler = Rect::from_min_max(pos2(ruler.left() + NAME_WIDTH, ruler.top()), ruler.max);
    let response = scrub(ui, ruler, &scale, moment);
    marks(ui, ruler, &scale);
    ui.spacing_mut().item_spacing.y = 0.0;
    let shown = tracks.len().clamp(1, MAX_VISIBLE_LANES) as f32;
    let area =
        egui::ScrollArea::vertical().max_height(LANE_HEIGHT * shown).min_scrolled_height(LANE_HEIGHT * shown);
    let seen = area.auto_shrink([false, true]).show_rows(ui, LANE_HEIGHT, tracks.len().max(1), |ui, rows| {
        for track in rows.map(|row| tracks.get(row)) {
            let (rect, _) =
                ui.allocate_exact_size(Vec2::new(ui.available_width(), LANE_HEIGHT), Sense::hover());
            if let Some(track) = track {
                lane(ui, rect, &scale, track);
                keyframes::lane(ui, scope, rect, &scale, track, playback);
            }
        }
    });
    if scale.length > 0.0 {
        let x = scale.x_of(moment);
        let color = if response.hovered() || response.dragged() { p.text } else { p.accent };
        ui.painter().vline(x, ruler.bottom()..=seen.inner_rect.bottom(), Stroke::new(1.5, color));
        // Below the labels of the ruler, so that they stay readable.
        let top = ruler.bottom() - 9.0;
        let tip = [pos2(x, ruler.bottom() + 1.0), pos2(x - 6.0, top), pos2(x + 6.0, top)];
        ui.painter().add(egui::Shape::convex_polygon(tip.to_vec(), color, Stroke::NONE));
    }
    let pointed = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked());
    if let Some(pointer) = pointed.filter(|_| scale.length > 0.0) {
        if scope.document.is_playing() {
            scope.action(Action::Play);
        }
        *playback = playback.at(length, scale.seconds_at(pointer.x));
    }
}

/// Makes the ruler draggable.
fn scrub(ui: &Ui, ruler: Rect, scale: &TimeScale, moment: f64) -> Response {
    let is_enabled = scale.length > 0.0;
    let sense = if is_enabled { Sense::click_and_drag() } else { Sense::hover() };
    let response = ui.interact(ruler, ui.scope_id().with("ruler"), sense);
    response.widget_info(|| egui::WidgetInfo::slider(is_enabled, moment, "Timeline ruler"));
    response.on_hover_cursor(if is_enabled { egui::CursorIcon::ResizeHorizontal } else { Default::default() })
}

fn marks(ui: &Ui, ruler: Rect, scale: &TimeScale) {
    let p = palette(ui);
    let painter = ui.painter_at(ruler);
    let font = egui::TextStyle::Small.resolve(ui.style());
    painter.hline(scale.x_range, ruler.bottom() - 0.5, Stroke::new(1.0, p.line));
    if scale.length <= 0.0 {
        painter.text(ruler.left_center(), egui::Align2::LEFT_CENTER, "no animation", font, p.weak);
        return;
    }
    let step = scale.step();
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    let count = (scale.length / step + 1e-6) as usize;
    for k in 0..=count {
        let seconds = k as f64 * step;
        let x = scale.x_of(seconds);
        painter.vline(x, ruler.bottom() - 6.0..=ruler.bottom(), Stroke::new(1.0, p.weak));
        let galley = painter.layout_no_wrap(format!("{seconds:.decimals$} s"), font.clone(), p.weak);
        let left = (x - galley.size().x / 2.0).clamp(ruler.left(), ruler.right() - galley.size().x);
        painter.galley(pos2(left, ruler.top()), galley, p.weak);
    }
}

/// Draws the name of a track, and a mark for each keyframe of a clip.
fn lane(ui: &Ui, rect: Rect, scale: &TimeScale, track: &TimelineTrack) {
    let p = palette(ui);
    let painter = ui.painter_at(rect);
    let font = egui::TextStyle::Body.resolve(ui.style());
    let mut job = egui::text::LayoutJob::simple_singleline(track.name.clone(), font, p.text);
    job.wrap = egui::text::TextWrapping::truncate_at_width(NAME_WIDTH - 8.0);
    let galley = painter.layout_job(job);
    painter.galley(pos2(rect.left(), rect.center().y - galley.size().y / 2.0), galley, p.text);
    let bed = Rect::from_x_y_ranges(scale.x_range, rect.top() + 4.0..=rect.bottom() - 4.0);
    painter.rect_filled(bed.expand2(Vec2::new(MARGIN, 0.0)), 3.0, p.sunken);
    if track.mover.is_some() {
        return;
    }
    let mut last = f32::NEG_INFINITY;
    for &seconds in &track.keys {
        let x = scale.x_of(seconds);
        // Denser marks would merge into a block.
        if x - last < 2.0 {
            continue;
        }
        last = x;
        painter.vline(x, bed.y_range().shrink(2.0), Stroke::new(1.0, p.weak));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_can_be_typed() {
        assert_eq!(seconds_of("1.5 s"), Some(1.5));
        assert_eq!(seconds_of(" 2s"), Some(2.0));
        assert!(["", "x", "-1", "nan", "inf"].iter().all(|t| seconds_of(t).is_none()));
    }
}
