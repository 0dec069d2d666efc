//! Stage panel: scattering, selected copies, levels and walking.

use eframe::egui::{self, Sense, Ui, Vec2};

use super::{PanelContext, UiRequest, widgets};
use crate::command::Command;
use crate::numbers::{grouped, seconds, significant};
use crate::panel::keys::{Action, CopiesAction};
use crate::stage::picture::level_color;
use crate::stage::scatter::Scatter;
use crate::stage::{MAX_COPIES, Placement, SCALE_RANGE, StageChange, StageDisplay};
use crate::theme::{palette, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    if scope.document.original().is_none() {
        return widgets::empty_note(ui, "Open a file to place copies of it");
    }
    let Some(stage) = scope.document.stage() else {
        ui.label(weak(
            ui,
            "Copies of the model on a ground plane, each at the level of detail for its distance.",
        ));
        let tip = format!("({})", Action::Stage.key());
        if widgets::primary(ui, "Show stage").on_hover_text(tip).clicked() {
            scope.action(Action::Stage);
        }
        return;
    };
    let (copies, view) = (scope.document.current_placements(), stage.view);
    let scatter = scope.facts.stage.form.unwrap_or(stage.scatter);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        scope.toggle(ui, Action::Stage, "Exit stage", "Back to original and result", false);
        let is_walking = scope.facts.stage.is_walking;
        scope.toggle(ui, Action::Walk, "Walk", "Walk through the copies in first person", is_walking);
        let (place, is_placing) = (Action::Copies(CopiesAction::Place), scope.facts.stage.is_placing);
        scope.toggle(ui, place, "Place", "Click on the ground to place a copy", is_placing);
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let actions = [
            (CopiesAction::OpenLayout, "Open…", "Open a layout from a JSON file"),
            (CopiesAction::SaveLayout, "Save…", "Save the layout to a JSON file"),
            (
                CopiesAction::Export,
                "Export…",
                "Export all copies as one GLB whose nodes share the levels (MSFT_lod)",
            ),
        ];
        for (action, text, tip) in actions {
            let is_enabled = action == CopiesAction::OpenLayout || !copies.is_empty();
            if ui.add_enabled(is_enabled, egui::Button::new(text)).on_hover_text(tip).clicked() {
                scope.action(Action::Copies(action));
            }
        }
    });
    scatter_fields(ui, scope, scatter);
    chosen(ui, scope, &copies);
    levels(ui, scope, view);
}

fn scatter_fields(ui: &mut Ui, scope: &mut PanelContext<'_>, before: Scatter) {
    widgets::heading(ui, "Scatter");
    let mut s = before;
    let number = |ui: &mut Ui, name: &str, add: egui::DragValue<'_>| {
        let response = ui.add(add);
        let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(name));
    };
    widgets::field(ui, "Copies", "Number of copies to scatter", |ui| {
        number(ui, "Copies to scatter", egui::DragValue::new(&mut s.count).range(1..=MAX_COPIES).speed(2));
    });
    widgets::field(ui, "Seed", "Another seed gives another layout", |ui| {
        number(ui, "Seed", egui::DragValue::new(&mut s.seed).speed(0.1));
    });
    widgets::field(ui, "Spacing", "Minimum gap between copies, in percent of the model's width", |ui| {
        let mut percent = 50.0 * s.gap;
        number(
            ui,
            "Spacing",
            egui::DragValue::new(&mut percent).range(0.0..=500.0).suffix(" %").max_decimals(0),
        );
        s.gap = percent / 50.0;
    });
    widgets::field(ui, "Area size", "Side of the square area, in model units; 0 fits all copies", |ui| {
        let side = egui::DragValue::new(&mut s.side).range(0.0..=1e9).max_decimals(3);
        let shown = |x: f64, _| if x == 0.0 { "auto".to_owned() } else { significant(x, 4) };
        let parsed = |t: &str| if t.trim() == "auto" { Some(0.0) } else { t.trim().parse().ok() };
        let side = side.custom_formatter(shown).custom_parser(parsed);
        number(ui, "Area size", side.speed(0.05 * s.footprint));
    });
    widgets::field(ui, "Scale", "Minimum and maximum scale", |ui| {
        for (k, name) in ["Minimum scale", "Maximum scale"].into_iter().enumerate() {
            let scale = egui::DragValue::new(&mut s.scale[k]).range(0.1..=10.0).speed(0.01).max_decimals(2);
            number(ui, name, scale);
        }
    });
    widgets::switch(
        ui,
        "Random rotation",
        None,
        "Otherwise all copies keep the model's orientation",
        &mut s.is_turned,
    );
    widgets::switch(ui, "Keep existing", None, "Otherwise existing copies are replaced", &mut s.keeps);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if widgets::primary(ui, "Scatter")
            .on_hover_text("The same settings always give the same layout")
            .clicked()
        {
            scope.requests.push(UiRequest::Scatter(s));
        }
        let again = Action::Copies(CopiesAction::Scatter);
        scope.toggle(ui, again, "Reshuffle", "Scatter again with the next seed", false);
    });
    if s != before {
        scope.requests.push(UiRequest::ScatterForm(s));
    }
}

fn chosen(ui: &mut Ui, scope: &mut PanelContext<'_>, copies: &[Placement]) {
    let selected = scope.facts.stage.selected.clone();
    widgets::heading(ui, "Selected");
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let text = format!("{} of {}", grouped(selected.len()), grouped(copies.len()));
        ui.label(weak(ui, text));
        let all = Action::Copies(CopiesAction::All);
        if !copies.is_empty() {
            scope.toggle(ui, all, "All", "Select all copies", false);
        }
        for (action, text, tip) in [
            (CopiesAction::Duplicate, "Duplicate", "Add duplicates beside the selected copies"),
            (CopiesAction::Delete, "Delete", "Delete the selected copies"),
        ] {
            if !selected.is_empty() {
                scope.toggle(ui, Action::Copies(action), text, tip, false);
            }
        }
    });
    if !selected.is_empty() {
        let tip = "Store the placement of the selected copies at the current time";
        scope.toggle(ui, Action::Copies(CopiesAction::Keyframe), "Set keyframe", tip, false);
    }
    let Some(first) = selected.first().and_then(|n| copies.get(*n)) else { return };
    let mut one = *first;
    let name = if selected.len() > 1 { "First position" } else { "Position" };
    widgets::field(ui, name, "Position on the ground, in model units", |ui| {
        for (value, name) in [(&mut one.x, "Position x"), (&mut one.z, "Position z")] {
            let response =
                ui.add(egui::DragValue::new(value).speed(0.02 * scope_length(scope)).max_decimals(3));
            let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(name));
        }
    });
    let keys = |a: CopiesAction, b: CopiesAction| [a, b].map(|a| Action::Copies(a).key()).join(" ");
    let tip =
        format!("Rotation about the vertical axis ({})", keys(CopiesAction::Turn(1), CopiesAction::Turn(-1)));
    widgets::field(ui, "Rotation", &tip, |ui| {
        let response = ui.add(egui::DragValue::new(&mut one.turn_deg).speed(1.0).suffix("°").max_decimals(1));
        let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Copy rotation"));
    });
    let tip =
        format!("Scale relative to the model ({})", keys(CopiesAction::Scale(-1), CopiesAction::Scale(1)));
    widgets::field(ui, "Scale", &tip, |ui| {
        let drag = egui::DragValue::new(&mut one.scale).range(SCALE_RANGE).speed(0.01).max_decimals(3);
        let response = ui.add(drag);
        let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Copy scale"));
    });
    if one != *first {
        // The other selected copies move by the same difference.
        let by = |c: &Placement| Placement {
            x: c.x + one.x - first.x,
            z: c.z + one.z - first.z,
            turn_deg: c.turn_deg + one.turn_deg - first.turn_deg,
            scale: c.scale * one.scale / first.scale,
        };
        let copies = selected.iter().filter_map(|&n| Some((n, by(copies.get(n)?)))).collect();
        let secs = scope.document.moment();
        scope.command(Command::Stage(StageChange::Move { copies, secs }));
    }
}

fn scope_length(scope: &PanelContext<'_>) -> f64 {
    scope.document.stage_base().map_or(1.0, |b| b.length())
}

fn levels(ui: &mut Ui, scope: &mut PanelContext<'_>, before: StageDisplay) {
    widgets::heading(ui, "Levels");
    let mut view = before;
    let tip = "Maximum RMS error of a level on screen, in pixels; levels switch there";
    widgets::field(ui, "Error", tip, |ui| {
        let drag = egui::DragValue::new(&mut view.pixels).range(0.05..=50.0).speed(0.02).suffix(" px");
        let response = ui.add(drag.max_decimals(2));
        let _ = ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Stage error"));
    });
    let tip = "Maximum triangles per frame; if exceeded, larger errors are allowed";
    widgets::field(ui, "Budget", tip, |ui| {
        let mut millions = view.budget as f64 / 1e6;
        let drag = egui::DragValue::new(&mut millions).range(0.01..=100.0).speed(0.02).suffix(" M");
        if ui.add(drag.max_decimals(2)).changed() {
            view.budget = (millions * 1e6).round() as u64;
        }
    });
    let colors = Some(Action::Copies(CopiesAction::Colors));
    widgets::switch(
        ui,
        "Colour by level",
        colors,
        "Show the level of each copy as its colour",
        &mut view.has_level_colors,
    );
    let facts = &scope.facts.stage;
    if scope.document.awaits_levels() {
        widgets::empty_note(ui, "Making levels…");
    } else if !facts.levels.is_empty() {
        widgets::table_row(ui, "Level, faces", &["distance".into(), "copies".into()], true);
        let spacing = std::mem::take(&mut ui.spacing_mut().item_spacing.y);
        for (k, level) in facts.levels.iter().enumerate() {
            ui.horizontal(|ui| {
                let (dot, _) = ui.allocate_exact_size(Vec2::new(10.0, 16.0), Sense::hover());
                if view.has_level_colors {
                    let dot = egui::Rect::from_center_size(dot.center(), Vec2::splat(8.0));
                    let line = egui::Stroke::new(1.0, palette(ui).weak);
                    ui.painter().rect(dot, 2.0, level_color(k), line, egui::StrokeKind::Inside);
                }
                let name = grouped(usize::try_from(level.faces).unwrap_or(usize::MAX));
                let from = if k == 0 { "0".to_owned() } else { significant(level.distance, 3) };
                widgets::table_row(ui, &format!("{k}  {name}"), &[from, grouped(level.copies)], false);
            });
        }
        ui.spacing_mut().item_spacing.y = spacing;
        let triangles = grouped(usize::try_from(facts.chosen.triangles).unwrap_or(usize::MAX));
        widgets::value_row(ui, "Visible triangles", triangles);
        let allowed = format!("{} px", significant(facts.chosen.pixels, 2));
        widgets::value_row(ui, "Switching error", allowed)
            .on_hover_text("The error set above, or a larger one if the budget requires it");
        if facts.chosen.left_out > 0 {
            widgets::value_row(ui, "Omitted (over budget)", grouped(facts.chosen.left_out));
        }
        widgets::value_row(ui, "Stage CPU time", seconds(facts.secs)).on_hover_text(format!(
            "Time to select levels and issue draw calls; maximum: {}",
            seconds(facts.longest_secs)
        ));
    }
    widgets::heading(ui, "Walking");
    widgets::field(ui, "Eye height", "Relative to the height of the model", |ui| {
        let drag = egui::DragValue::new(&mut view.eye_height).range(0.01..=20.0).speed(0.01).suffix(" ×");
        ui.add(drag.max_decimals(2));
    });
    widgets::field(ui, "Speed", "In model sizes per second; four times as fast with Shift", |ui| {
        let drag = egui::DragValue::new(&mut view.speed).range(0.05..=50.0).speed(0.01).suffix(" ×");
        ui.add(drag.max_decimals(2));
    });
    if view != before {
        scope.command(Command::Stage(StageChange::View(view)));
    }
}
