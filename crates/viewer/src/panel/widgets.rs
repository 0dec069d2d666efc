//! Widgets of the panels.

use eframe::egui::{self, Align, Layout, Response, RichText, Sense, Ui, Vec2};

use super::dock::Panel;
use crate::panel::keys::Action;
use crate::theme::{self, SPACING, number, palette, weak};

/// Width of the label before a field.
const LABEL_WIDTH: f32 = 104.0;

/// Draws a section of a dock: heading with key and close button, and body. Returns true if it was closed.
pub fn section(ui: &mut Ui, panel: Panel, body: impl FnOnce(&mut Ui)) -> bool {
    let mut is_closed = false;
    let p = palette(ui);
    egui::Frame::NONE.fill(p.raised).inner_margin(egui::Margin::symmetric(12, 6)).show(ui, |ui| {
        ui.set_width(ui.available_width());
        ui.horizontal(|ui| {
            ui.label(RichText::new(panel.title()).strong());
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let key = Action::Panel(panel).key();
                let close = egui::Button::new(weak(ui, "×")).frame(false).min_size(Vec2::splat(18.0));
                let close = ui.add(close).on_hover_text(format!("Hide ({key})"));
                close.widget_info(|| {
                    let name = format!("Hide {}", panel.title());
                    egui::WidgetInfo::labeled(egui::Role::Button, true, name)
                });
                is_closed = close.clicked();
                ui.label(weak(ui, key).small());
            });
        });
    });
    egui::Frame::NONE.inner_margin(egui::Margin { left: 12, right: 12, top: 8, bottom: 14 }).show(ui, |ui| {
        ui.set_width(ui.available_width());
        ui.push_id(panel, body);
    });
    is_closed
}

/// Draws a heading within a section.
pub fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(SPACING);
    ui.label(weak(ui, text.to_uppercase()).small());
}

/// Draws a name and a right-aligned value.
pub fn value_row(ui: &mut Ui, name: &str, value: impl Into<String>) -> Response {
    let size = Vec2::new(ui.available_width(), 18.0);
    ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
        let response = ui.add(egui::Label::new(number(value)).truncate());
        row_name(ui, name);
        response
    })
    .inner
}

/// Draws the name of a row in the space that its values leave.
fn row_name(ui: &mut Ui, name: &str) {
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        ui.add(egui::Label::new(weak(ui, name)).truncate());
    });
}

/// Draws a row of a table: a name and right-aligned columns; `head` marks the row of column headings.
pub fn table_row(ui: &mut Ui, name: &str, values: &[String], head: bool) {
    let width = ui.available_width();
    ui.allocate_ui_with_layout(Vec2::new(width, 18.0), Layout::right_to_left(Align::Center), |ui| {
        ui.spacing_mut().item_spacing.x = SPACING;
        for value in values.iter().rev() {
            let text = if head { weak(ui, value.clone()).small() } else { number(value.clone()) };
            let size = Vec2::new((0.29 * width).min(84.0), 18.0);
            ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
                ui.set_min_size(size);
                ui.add(egui::Label::new(text).truncate());
            });
        }
        row_name(ui, name);
    });
}

/// Draws a label and a field after it.
pub fn field<R>(ui: &mut Ui, name: &str, tip: &str, add: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let width = LABEL_WIDTH.min(0.36 * ui.available_width());
        let size = Vec2::new(width, ui.spacing().interact_size.y);
        ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_size(size);
            let label = ui.add(egui::Label::new(weak(ui, name)).truncate().sense(Sense::hover()));
            if !tip.is_empty() {
                label.on_hover_text(tip);
            }
        });
        add(ui)
    })
    .inner
}

/// Draws a combo box. Returns true if another value was chosen.
pub fn choose<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    tip: &str,
    choices: &[(T, &str)],
    value: &mut T,
) -> bool {
    let before = *value;
    field(ui, name, tip, |ui| {
        let shown = choices.iter().find(|c| c.0 == *value).map_or("", |c| c.1);
        let combo = egui::ComboBox::from_id_salt(name).width(ui.available_width()).selected_text(shown);
        let response = combo.show_ui(ui, |ui| {
            for (choice, word) in choices {
                ui.selectable_value(value, *choice, *word);
            }
        });
        response.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
    });
    *value != before
}

/// Draws a checkbox with its key in the tooltip. Returns true if it was toggled.
pub fn switch(ui: &mut Ui, text: &str, action: Option<Action>, tip: &str, value: &mut bool) -> bool {
    let key = action.map(Action::key).filter(|k| !k.is_empty());
    let tip = match (tip, key) {
        ("", None) => String::new(),
        ("", Some(key)) => format!("{text} ({key})"),
        (tip, None) => tip.to_owned(),
        (tip, Some(key)) => format!("{tip} ({key})"),
    };
    let response = ui.checkbox(value, text);
    let response = if tip.is_empty() { response } else { response.on_hover_text(tip) };
    response.changed()
}

/// Draws a slider and a number field; both are labelled for screen readers.
pub fn slider(ui: &mut Ui, name: &str, tip: &str, value: &mut f64, range: std::ops::RangeInclusive<f64>) {
    field(ui, name, tip, |ui| {
        ui.spacing_mut().slider_width = (ui.available_width() - 64.0).max(40.0);
        let slider = ui.add(egui::Slider::new(value, range.clone()).show_value(false));
        let number = ui.add(egui::DragValue::new(value).range(range).speed(0.01).max_decimals(2));
        for response in [slider, number] {
            let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(name));
        }
    });
}

/// Draws a text field that returns its text when it loses focus or Enter is pressed; invalid text is red.
pub fn text_field(
    ui: &mut Ui,
    name: &str,
    now: &str,
    hint: &str,
    width: f32,
    is_good: impl Fn(&str) -> bool,
) -> Option<String> {
    let id = ui.scope_id().with(("typed", name));
    let kept: Option<String> = ui.data(|d| d.get_temp(id));
    let mut text = kept.clone().unwrap_or_else(|| now.to_owned());
    // A shown value may be one that cannot be typed, such as an error of 0.
    let good = text == now || is_good(&text);
    let mut edit = egui::TextEdit::singleline(&mut text)
        .id(id)
        .desired_width(width - 2.0 * SPACING)
        .hint_text(hint)
        .font(egui::TextStyle::Monospace);
    if !good {
        edit = edit.text_color(palette(ui).error);
    }
    let response = ui.add(edit);
    response.widget_info(|| {
        let mut info = egui::WidgetInfo::labeled(egui::Role::TextInput, true, name);
        info.current_text_value = Some(text.clone());
        info
    });
    if response.has_focus() {
        ui.data_mut(|d| d.insert_temp(id, text));
        return None;
    }
    if kept.is_some() {
        ui.data_mut(|d| d.remove::<String>(id));
    }
    let is_left = response.lost_focus() && !ui.input(|i| i.key_pressed(egui::Key::Escape));
    (is_left && good && text != now).then_some(text)
}

/// Draws a button of a group of which one is chosen. Returns true if it was clicked.
pub fn segment(ui: &mut Ui, text: &str, is_chosen: bool, tip: &str) -> bool {
    let p = palette(ui);
    let (fill, color) = if is_chosen { (p.accent, p.on_accent) } else { (p.button, p.text) };
    let button = egui::Button::new(RichText::new(text).color(color)).fill(fill).selected(is_chosen);
    let response = ui.add(button);
    let response = if tip.is_empty() { response } else { response.on_hover_text(tip) };
    response.clicked()
}

/// Makes an entry of a menu.
pub fn menu_item<'a>(text: &'a str, action: Action) -> egui::Button<'a> {
    egui::Button::new(text).shortcut_text(action.key()).min_size(Vec2::new(220.0, 24.0))
}

/// Makes a modal dialog with a margin.
pub fn modal(ctx: &egui::Context, name: &str) -> egui::Modal {
    let frame = egui::Frame::popup(&ctx.global_style()).inner_margin(20.0);
    egui::Modal::new(egui::Id::unique(name)).frame(frame)
}

/// Draws the default button of a dialog.
pub fn primary(ui: &mut Ui, text: &str) -> Response {
    let p = palette(ui);
    ui.add(egui::Button::new(RichText::new(text).color(p.on_accent).strong()).fill(p.accent))
}

/// Draws a log message in the colour of its level.
pub fn log_line(ui: &mut Ui, level: crate::document::log::Severity, text: &str) {
    use crate::document::log::Severity;
    let p = palette(ui);
    let color = match level {
        Severity::Good => p.good,
        Severity::Note => p.weak,
        Severity::Warning => p.warning,
        Severity::Error => p.error,
    };
    ui.horizontal_top(|ui| {
        let (dot, _) = ui.allocate_exact_size(Vec2::new(8.0, 16.0), Sense::hover());
        ui.painter().circle_filled(dot.center(), 3.5, color);
        let color = if matches!(level, Severity::Note | Severity::Good) { p.text } else { color };
        ui.add(egui::Label::new(RichText::new(text).color(color)).wrap().selectable(true));
    });
}

/// Draws a colour picker in sRGB. Returns true if the colour changed.
pub fn color(ui: &mut Ui, color: &mut [f32; 3]) -> bool {
    let mut bytes = color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
    let is_changed = ui.color_edit_button_srgb(&mut bytes).changed();
    if is_changed {
        *color = bytes.map(|b| f32::from(b) / 255.0);
    }
    is_changed
}

/// Draws the text of an empty panel.
pub fn empty_note(ui: &mut Ui, text: &str) {
    ui.label(theme::weak(ui, text).italics());
}
