//! Top bar: menus, sides, shading.

use eframe::egui::{self, RichText, Ui};

use super::{Panel, PanelContext, look::SHADINGS, widgets};
use crate::command::Command;
use crate::panel::keys::{Action, CopiesAction};
use crate::settings::up_axis::UpAxis;
use crate::settings::{Layout, Sides};
use crate::theme::{self, palette, weak};

/// Draws the bar. `is_shown` returns whether a panel is shown.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>, is_shown: &dyn Fn(Panel) -> bool) {
    ui.horizontal_centered(|ui| {
        ui.label(RichText::new("Lodsmith").strong().size(15.0).color(palette(ui).accent));
        ui.add_space(8.0);
        menus(ui, scope, is_shown);
        ui.separator();
        sides(ui, scope);
        ui.separator();
        shading(ui, scope);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            scope.button(ui, Action::Help, "?", "Keys and mouse", true);
            let (name, text) =
                if ui.visuals().dark_mode { ("Light", "Light theme") } else { ("Dark", "Dark theme") };
            scope.button(ui, Action::Theme, name, text, true);
            if let Some(original) = scope.document.original() {
                let name = super::files::name(&original.content.path);
                ui.add(egui::Label::new(weak(ui, name)).truncate());
            }
        });
    });
}

fn menus(ui: &mut Ui, scope: &mut PanelContext<'_>, is_shown: &dyn Fn(Panel) -> bool) {
    let has_file = scope.document.original().is_some();
    let (undo, redo) = scope.document.history();
    ui.menu_button("File", |ui| {
        item(ui, scope, Action::Open, "Open…", true);
        item(ui, scope, Action::Export, "Export…", has_file);
        ui.add_enabled_ui(!scope.facts.recent.is_empty(), |ui| {
            ui.menu_button("Open recent", |ui| recent(ui, scope));
        });
        item(ui, scope, Action::Reload, "Reload", has_file);
        item(ui, scope, Action::Close, "Close", has_file);
        if scope.document.settings().files.len() > 1 && ui.button("Close all").clicked() {
            scope.command(Command::Close);
        }
        ui.separator();
        item(ui, scope, Action::OpenSession, "Open session…", true);
        item(ui, scope, Action::SaveSession, "Save session…", has_file);
        ui.separator();
        item(ui, scope, Action::CopyCommand, "Copy command line", has_file);
        item(ui, scope, Action::Screenshot, "Screenshot", true);
        ui.separator();
        item(ui, scope, Action::Quit, "Quit", true);
    });
    ui.menu_button("Edit", |ui| {
        let named = |word: &str, name: Option<&str>| name.map_or(word.to_owned(), |n| format!("{word} {n}"));
        item(ui, scope, Action::Undo, &named("Undo", undo), undo.is_some());
        item(ui, scope, Action::Redo, &named("Redo", redo), redo.is_some());
        ui.separator();
        item(ui, scope, Action::Restore, "Back to original", scope.document.settings().simplify.has_target());
    });
    ui.menu_button("View", |ui| {
        let views = [0, 1, 2, 3, 4, 5, 6].map(Action::View);
        for action in [Action::Frame].into_iter().chain(views) {
            item(ui, scope, action, action.binding().map_or("", |b| b.name), has_file);
        }
        ui.separator();
        for n in 0..4 {
            let is_kept = scope.document.settings().cameras[n].is_some();
            item(ui, scope, Action::RestoreCamera(n), &format!("Restore camera {}", n + 1), is_kept);
        }
        ui.separator();
        for n in 0..4 {
            item(ui, scope, Action::SaveCamera(n), &format!("Save camera {}", n + 1), has_file);
        }
        ui.separator();
        up_axis(ui, scope, has_file);
        item(ui, scope, Action::ResetRotation, "Reset rotation", has_file);
    });
    stage_menu(ui, scope, has_file);
    ui.menu_button("Panels", |ui| {
        let is_offered = |p: &Panel| !matches!(p, Panel::Benchmark | Panel::Bake) || !scope.facts.is_on_page;
        for panel in Panel::ALL.into_iter().filter(is_offered) {
            let action = Action::Panel(panel);
            let text = format!("{}  {}", if is_shown(panel) { "✔" } else { "     " }, panel.title());
            let response = ui.add(widgets::menu_item(&text, action));
            let is_on = is_shown(panel);
            response
                .widget_info(|| egui::WidgetInfo::selected(egui::Role::CheckBox, true, is_on, panel.title()));
            if response.clicked() {
                scope.action(action);
                ui.close();
            }
        }
        ui.separator();
        item(ui, scope, Action::Panels, "Hide all panels", true);
    });
}

fn stage_menu(ui: &mut Ui, scope: &mut PanelContext<'_>, has_file: bool) {
    let is_on = scope.document.stage().is_some();
    let has_copies = is_on && !scope.document.settings().stage.copies.is_empty();
    let has_chosen = is_on && !scope.facts.stage.selected.is_empty();
    let copies = Action::Copies;
    ui.menu_button("Stage", |ui| {
        item(ui, scope, Action::Stage, if is_on { "Exit stage" } else { "Show stage" }, has_file);
        item(ui, scope, Action::Walk, "Walk mode", is_on);
        ui.separator();
        item(ui, scope, copies(CopiesAction::Place), "Place copies", is_on);
        item(ui, scope, copies(CopiesAction::Scatter), "Reshuffle copies", is_on);
        item(ui, scope, copies(CopiesAction::All), "Select all copies", has_copies);
        item(ui, scope, copies(CopiesAction::Duplicate), "Duplicate selected copies", has_chosen);
        item(ui, scope, copies(CopiesAction::Delete), "Delete selected copies", has_chosen);
        ui.separator();
        item(ui, scope, copies(CopiesAction::Keyframe), "Keyframe selected copies", has_chosen);
        item(ui, scope, copies(CopiesAction::CameraKeyframe), "Keyframe stage camera", is_on);
        ui.separator();
        item(ui, scope, copies(CopiesAction::OpenLayout), "Open layout…", is_on);
        item(ui, scope, copies(CopiesAction::SaveLayout), "Save layout…", has_copies);
        item(ui, scope, copies(CopiesAction::Export), "Export stage…", has_copies);
    });
}

fn item(ui: &mut Ui, scope: &mut PanelContext<'_>, action: Action, text: &str, is_enabled: bool) {
    if ui.add_enabled(is_enabled, widgets::menu_item(text, action)).clicked() {
        scope.action(action);
        ui.close();
    }
}

/// Draws the list of recent files.
fn recent(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    for file in scope.facts.recent.clone() {
        let name = super::files::name(&file);
        let button = egui::Button::new(name).min_size(egui::vec2(180.0, 24.0));
        if ui.add(button).on_hover_text(file.display().to_string()).clicked() {
            scope.requests.push(super::UiRequest::OpenFile(file));
            ui.close();
        }
    }
}

/// Draws the list of axes that can point up.
fn up_axis(ui: &mut Ui, scope: &mut PanelContext<'_>, is_enabled: bool) {
    let document = scope.document;
    ui.add_enabled_ui(is_enabled, |ui| {
        ui.menu_button(format!("Up axis: {}", document.up().name()), |ui| {
            for (axis, name) in UpAxis::ALL {
                let is_chosen = document.settings().up == axis;
                let response =
                    ui.add(egui::Button::new(name).min_size(egui::vec2(120.0, 24.0)).selected(is_chosen));
                if response.clicked() {
                    scope.command(Command::Up(axis));
                    ui.close();
                }
            }
        });
    });
}

fn sides(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let layout = scope.document.settings().layout;
    ui.spacing_mut().item_spacing.x = 4.0;
    let key = Action::NextSides.key();
    let is_narrow = ui.ctx().content_rect().width() < theme::NARROW_WINDOW;
    if is_narrow {
        let mut sides = layout.sides;
        let shown = Sides::ALL.iter().find(|s| s.0 == sides).map_or("", |s| s.1);
        egui::ComboBox::from_id_salt("sides").width(100.0).selected_text(shown).show_ui(ui, |ui| {
            for (each, name) in Sides::ALL {
                ui.selectable_value(&mut sides, each, name);
            }
        });
        if sides != layout.sides {
            scope.command(Command::Layout(Layout { sides, ..layout }));
        }
    }
    for (sides, name) in Sides::ALL.into_iter().filter(|_| !is_narrow) {
        if widgets::segment(ui, name, layout.sides == sides, &format!("{name} ({key} cycles through all)")) {
            scope.command(Command::Layout(Layout { sides, ..layout }));
        }
    }
    scope.toggle(ui, Action::Link, "Linked", "Use one camera for both sides", layout.linked);
}

fn shading(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let settings = scope.document.settings();
    let mut look = settings.look.clone();
    let shown = SHADINGS.iter().find(|s| s.0 == look.look.shading).map_or("", |s| s.1);
    let combo = egui::ComboBox::from_id_salt("shading").width(124.0).selected_text(shown);
    let response = combo.show_ui(ui, |ui| {
        for (i, (shading, name)) in SHADINGS.iter().enumerate() {
            let text = format!("{name}  ({})", Action::Shade(i).key());
            ui.selectable_value(&mut look.look.shading, *shading, text);
        }
    });
    response.response.on_hover_text("How the surface is coloured");
    let tip = Action::Wireframe.tip("Draw all edges as lines");
    if widgets::segment(ui, "Wireframe", look.look.wireframe, &tip) {
        look.look.wireframe = !look.look.wireframe;
    }
    if look != settings.look {
        scope.command(Command::Look(look));
    }
}
