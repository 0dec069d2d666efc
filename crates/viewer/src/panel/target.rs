//! The wide slider under the pictures: target and status.

use eframe::egui::accesskit;
use eframe::egui::{self, Key, Modifiers, Rect, Response, Sense, Ui, Vec2, pos2};

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::document::target_scale::{OriginalSize, Unit, text_of};
use crate::numbers::percent;
use crate::panel::keys::Action;
use crate::theme::{palette, weak};

/// A bar narrower than this has its status in a row of its own.
const NARROW_BAR: f32 = 700.0;

/// Draws the bar under the pictures. Returns the chosen unit.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) -> Unit {
    let document = scope.document;
    let mut unit = scope.facts.unit;
    let whole = document.original_size();
    let is_narrow = ui.available_width() < NARROW_BAR;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if is_narrow {
            let shown = Unit::ALL.iter().find(|u| u.0 == unit).map_or("", |u| u.1);
            egui::ComboBox::from_id_salt("unit").width(72.0).selected_text(shown).show_ui(ui, |ui| {
                for (each, name) in Unit::ALL {
                    ui.selectable_value(&mut unit, each, name).on_hover_text(each.tip());
                }
            });
        } else {
            for (each, name) in Unit::ALL {
                if widgets::segment(ui, name, unit == each, each.tip()) {
                    unit = each;
                }
            }
            ui.add_space(8.0);
        }
        if let Some(whole) = &whole {
            let result = document.result_size();
            let now = text_of(document.settings(), whole, result.as_ref(), unit).unwrap_or_default();
            let is_good = |t: &str| whole.typed(unit, t).is_some();
            let width = if is_narrow { 84.0 } else { 120.0 };
            if let Some(text) = widgets::text_field(ui, "Target", &now, "not measured", width, is_good)
                && let Some(target) = whole.typed(unit, &text)
            {
                scope.command(Command::Target(target));
            }
        }
        if !is_narrow {
            by_distance(ui, scope);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            restore(ui, scope);
            if !is_narrow {
                status(ui, scope);
            }
        });
    });
    if is_narrow {
        ui.horizontal(|ui| {
            by_distance(ui, scope);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| status(ui, scope));
        });
    }
    ui.add_enabled_ui(whole.is_some(), |ui| slider(ui, scope, whole.as_ref(), unit));
    unit
}

/// Draws the toggle for automatic levels by distance, with the allowed error in pixels.
fn by_distance(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let before = scope.document.settings().auto_lod;
    let mut auto = before;
    ui.add_space(8.0);
    let tip = Action::AutoLod.tip("Select the level by camera distance");
    if widgets::segment(ui, "Auto LOD", auto.is_on, &tip) {
        auto.is_on = !auto.is_on;
    }
    if auto.is_on {
        let drag = egui::DragValue::new(&mut auto.pixels).range(0.05..=50.0).speed(0.02).suffix(" px");
        ui.add(drag).on_hover_text("Maximum error of a level on screen, in pixels");
    }
    if auto != before {
        scope.command(Command::AutoLod(auto));
    }
}

/// Draws the button that goes back to the original.
fn restore(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let has_target = scope.document.settings().simplify.has_target();
    scope.button(ui, Action::Restore, "Back to original", "Show the original again", has_target);
    ui.add_space(8.0);
}

/// Draws the progress of the current job. The pictures say how many faces they show.
fn status(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let text = |ui: &mut Ui, text: String| ui.add(egui::Label::new(weak(ui, text)).truncate());
    if let Some(progress) = document.progress() {
        scope.button(ui, Action::Cancel, "Stop", "Cancel running jobs", true);
        let width = (ui.available_width() - 120.0).clamp(24.0, 120.0);
        let read = document.opening_progress().and_then(|(_, _, done)| done);
        let done = read.map_or(progress.done, |done| done as f32);
        let bar = egui::ProgressBar::new(done).desired_width(width).desired_height(8.0);
        ui.add(bar.fill(palette(ui).accent));
        let stage = if progress.stage.is_empty() { String::new() } else { format!(": {}", progress.stage) };
        text(ui, format!("{}{stage}", progress.kind.title()));
    } else if let Some(progress) = document.preview_progress() {
        let tip = "Building a progressive mesh; then the result follows immediately while you drag";
        text(ui, format!("Making the slider instant: {}", percent(f64::from(progress.done))))
            .on_hover_text(tip);
    } else if document.shows_preview() && document.is_outdated() {
        text(ui, "Preview".to_owned()).on_hover_text("The exact result follows when you release the slider");
    }
}

/// Draws the slider, which sets the target.
fn slider(ui: &mut Ui, scope: &mut PanelContext<'_>, whole: Option<&OriginalSize>, unit: Unit) {
    let size = Vec2::new(ui.available_width(), 40.0);
    let (rect, mut response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    let rail =
        Rect::from_min_max(rect.min + Vec2::new(10.0, 10.0), pos2(rect.right() - 10.0, rect.top() + 16.0));
    let settings = scope.document.settings();
    let result = scope.document.result_size();
    let at = whole.map_or(Some(1.0), |w| w.slider_position(settings, result.as_ref(), unit));
    let p = palette(ui);
    let enabled = ui.is_enabled();
    let painter = ui.painter();
    painter.rect_filled(rail, 3.0, p.button);
    let x_of = |at: f64| rail.left() + rail.width() * at as f32;
    if let Some(at) = at {
        let done = Rect::from_min_max(rail.min, pos2(x_of(at), rail.bottom()));
        painter.rect_filled(done, 3.0, if enabled { p.accent } else { p.hovered });
    }
    let font = egui::TextStyle::Small.resolve(ui.style());
    if let Some(whole) = whole {
        let mut free = f32::INFINITY;
        for (place, text) in whole.ticks(unit) {
            let x = x_of(place);
            painter.vline(x, rail.bottom() + 3.0..=rail.bottom() + 7.0, egui::Stroke::new(1.0, p.weak));
            let galley = painter.layout_no_wrap(text, font.clone(), p.weak);
            let left = (x - galley.size().x / 2.0).clamp(rect.left(), rect.right() - galley.size().x);
            if left + galley.size().x + 8.0 < free {
                free = left;
                painter.galley(pos2(left, rail.bottom() + 8.0), galley, p.weak);
            }
        }
        // Mark of the result, if it differs from the target.
        if let Some(lighter) = scope.document.lighter() {
            let x = x_of(whole.slider_position_of_faces(lighter.content.faces as f64));
            if !unit.is_error() && at.is_some_and(|at| (x - x_of(at)).abs() > 3.0) {
                let mark = [
                    pos2(x, rail.top() - 1.0),
                    pos2(x - 4.0, rail.top() - 8.0),
                    pos2(x + 4.0, rail.top() - 8.0),
                ];
                painter.add(egui::Shape::convex_polygon(mark.to_vec(), p.text, egui::Stroke::NONE));
            }
        }
    }
    let fill = if !enabled {
        p.hovered
    } else if response.hovered() || response.dragged() {
        p.text
    } else {
        p.accent
    };
    // If the target is unknown in this unit, there is no knob until the slider is pressed.
    if let Some(at) = at {
        let knob = pos2(x_of(at), rail.center().y);
        painter.circle(knob, 8.0, fill, egui::Stroke::new(2.0, p.panel));
        if response.has_focus() {
            painter.circle_stroke(knob, 11.0, egui::Stroke::new(1.5, p.accent));
        }
    }
    response.widget_info(|| egui::WidgetInfo::slider(enabled, at.unwrap_or(1.0), "Target slider"));

    let Some(whole) = whole else { return };
    // A press counts before it is known whether it becomes a click or a drag.
    let is_held = response.is_pointer_button_down_on() || response.clicked();
    if let Some(pointer) = response.interact_pointer_pos().filter(|_| is_held) {
        let to = f64::from(((pointer.x - rail.left()) / rail.width()).clamp(0.0, 1.0));
        let target = whole.target(unit, to);
        if target.stop() != settings.simplify.options.stop {
            scope.command(Command::Target(target));
        }
        response.mark_changed();
    }
    let steps = pressed_steps(ui, &response);
    if steps != 0
        && let Some(target) = whole.stepped(settings, result.as_ref(), unit, steps)
    {
        scope.command(Command::Target(target));
        response.mark_changed();
    }
}

/// Returns the steps to the right that arrow keys ask for while the slider has the focus, or a screen reader.
fn pressed_steps(ui: &Ui, response: &Response) -> i32 {
    use accesskit::Action::{Decrement, Increment};
    ui.ctx().accesskit_node_builder(response.id, |node| {
        node.add_action(Increment);
        node.add_action(Decrement);
    });
    let asked = |action| ui.input(|i| i.num_accesskit_action_requests(response.id, action)) as i32;
    let mut steps = asked(Increment) - asked(Decrement);
    if response.has_focus() {
        let filter =
            egui::EventFilter { horizontal_arrows: true, vertical_arrows: true, ..Default::default() };
        ui.memory_mut(|m| m.set_focus_lock_filter(response.id, filter));
        let pressed = |key| ui.input_mut(|i| i.count_and_consume_key(Modifiers::NONE, key)) as i32;
        steps += pressed(Key::ArrowRight) + pressed(Key::ArrowUp);
        steps -= pressed(Key::ArrowLeft) + pressed(Key::ArrowDown);
    }
    steps
}
