//! Benchmark panel: times to make and to draw levels, as a table that can be copied.

use eframe::egui::{self, Align, Layout, RichText, Ui, Vec2};

use super::{PanelContext, UiRequest, widgets};
use crate::content::benchmark::{BENCHMARK_RATIOS, BenchmarkTable, COLUMN_HEADINGS};
use crate::job::JobKind;
use crate::panel::keys::Action;
use crate::theme::{number, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let is_running = document.is_busy(JobKind::Benchmark);
    let table = document.benchmark_table();
    ui.horizontal(|ui| {
        if is_running {
            scope.button(ui, Action::Cancel, "Stop benchmark", "Cancel running jobs", true);
        } else {
            let levels = BENCHMARK_RATIOS.len();
            let tip = format!("Make {levels} levels with the current method and render each");
            scope.button(ui, Action::Benchmark, "Run benchmark", &tip, document.original().is_some());
        }
        let Some(table) = table.as_ref().filter(|t| !t.rows.is_empty()) else { return };
        for (name, tip, text) in [
            ("Copy as Markdown", "The table as shown", table.markdown()),
            ("Copy as TSV", "Plain numbers for spreadsheets", table.tsv()),
        ] {
            if ui.button(name).on_hover_text(tip).clicked() {
                scope.requests.push(UiRequest::Copy(text));
            }
        }
    });
    match table.filter(|t| !t.rows.is_empty()) {
        Some(table) => {
            ui.add(egui::Label::new(weak(ui, &table.title).small()).wrap().selectable(true));
            grid(ui, &table);
        }
        None if document.original().is_none() => widgets::empty_note(ui, "Open a file to run the benchmark"),
        None if is_running => widgets::empty_note(ui, "Measuring the first row…"),
        None => widgets::empty_note(ui, "Nothing measured yet"),
    }
}

fn grid(ui: &mut Ui, table: &BenchmarkTable) {
    ui.spacing_mut().interact_size.y = 18.0;
    let width = ui.available_width() / COLUMN_HEADINGS.len() as f32;
    let cell = |ui: &mut Ui, column: usize, text: RichText| {
        let align = if column == 0 {
            Layout::left_to_right(Align::Center)
        } else {
            Layout::right_to_left(Align::Center)
        };
        let size = Vec2::new(width, 18.0);
        ui.allocate_ui_with_layout(size, align, |ui| {
            ui.set_min_size(size);
            ui.add(egui::Label::new(text).truncate());
        });
    };
    let line = |ui: &mut Ui, cells: Vec<RichText>| {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 0.0;
            cells.into_iter().enumerate().for_each(|(column, text)| cell(ui, column, text));
        });
    };
    ui.spacing_mut().item_spacing.y = 2.0;
    let heads = COLUMN_HEADINGS.map(|head| weak(ui, head).small());
    line(ui, heads.into());
    for row in &table.rows {
        line(ui, row.cells().map(number).into());
    }
}
