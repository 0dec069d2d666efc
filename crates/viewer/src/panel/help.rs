//! Cheat sheet: the table of keys and gestures.

use eframe::egui::{self, RichText, Ui};

use crate::panel::keys::{Action, BINDINGS, CopiesAction, GESTURES, Group, text};
use crate::theme::{number, palette, weak};

/// Width of the keys, and the least width of a column, in points.
const KEY_WIDTH: f32 = 156.0;
const MIN_COLUMN_WIDTH: f32 = 340.0;

/// Shows the sheet; returns true if it is to be closed.
pub fn show(ctx: &egui::Context) -> bool {
    let modal = super::widgets::modal(ctx, "help").show(ctx, |ui| {
        let screen = ctx.content_rect();
        let width = (screen.width() - 80.0).clamp(320.0, 1160.0);
        ui.set_width(width);
        ui.horizontal(|ui| {
            ui.label(RichText::new("Keys and mouse").heading());
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let close = ui.button("Close").on_hover_text(format!("({})", Action::Help.key()));
                close.clicked()
            })
            .inner
        })
        .inner
            | {
                ui.add_space(8.0);
                egui::ScrollArea::vertical()
                    .max_height(screen.height() - 160.0)
                    .min_scrolled_height((screen.height() - 160.0).min(640.0))
                    .show(ui, |ui| {
                        // The scroll bar overlaps the content.
                        ui.set_max_width(ui.available_width() - 14.0);
                        ui.spacing_mut().interact_size.y = 0.0;
                        let count = ((width / MIN_COLUMN_WIDTH) as usize).clamp(1, 3);
                        ui.columns(count, |columns| {
                            for (group, title) in Group::ALL {
                                let column = match group {
                                    Group::File | Group::Detail | Group::Stage => 0,
                                    Group::Look | Group::Window => 1,
                                    Group::Camera | Group::Animation => 2,
                                };
                                block(&mut columns[column.min(count - 1)], group, title);
                            }
                        });
                    });
                false
            }
    });
    modal.inner || modal.should_close()
}

fn block(ui: &mut Ui, group: Group, title: &str) {
    ui.label(RichText::new(title).strong().color(palette(ui).accent));
    for (_, keys, name) in GESTURES.iter().filter(|g| g.0 == group) {
        line(ui, keys, name);
    }
    for b in BINDINGS.iter().filter(|b| b.group == group && !is_repeated(b.action)) {
        let (keys, name) = merged(b.action, text(&b.shortcut), b.name);
        line(ui, &keys, &name);
    }
    ui.add_space(12.0);
}

/// Draws a key and what it does; a long name takes several lines.
fn line(ui: &mut Ui, keys: &str, name: &str) {
    ui.horizontal_top(|ui| {
        let size = egui::vec2(KEY_WIDTH, 16.0);
        ui.allocate_ui_with_layout(size, egui::Layout::left_to_right(egui::Align::Min), |ui| {
            ui.set_min_width(KEY_WIDTH);
            ui.add(egui::Label::new(number(keys).small()).truncate());
        });
        ui.add(egui::Label::new(weak(ui, name)).wrap());
    });
}

/// Returns true if the line of another binding covers this one.
fn is_repeated(action: Action) -> bool {
    match action {
        Action::SaveCamera(n) | Action::RestoreCamera(n) => n > 0,
        Action::Orbit(x, y) | Action::TurnModel(x, y) => (x, y) != (-1, 0),
        Action::Copies(CopiesAction::Turn(n)) => n < 0,
        Action::Copies(CopiesAction::Scale(n)) => n > 0,
        _ => false,
    }
}

/// Merges several related bindings into one line.
fn merged(action: Action, keys: String, name: &str) -> (String, String) {
    match action {
        Action::SaveCamera(_) => (format!("{keys} … 4"), "Save camera".to_owned()),
        Action::RestoreCamera(_) => (format!("{keys} … 4"), "Restore camera".to_owned()),
        Action::Orbit(..) => ("Arrows".to_owned(), "Orbit".to_owned()),
        Action::TurnModel(..) => ("Alt+arrows".to_owned(), "Rotate model".to_owned()),
        Action::Copies(CopiesAction::Turn(_)) => {
            ("Shift+Left, Right".to_owned(), "Rotate selected copies".to_owned())
        }
        Action::Copies(CopiesAction::Scale(_)) => {
            ("Shift+Down, Up".to_owned(), "Scale selected copies".to_owned())
        }
        _ => (keys, name.to_owned()),
    }
}
