//! Info panel: counts, components, borders and times of both sides.

use eframe::egui::Ui;

use super::{PanelContext, widgets};
use crate::numbers::{grouped, percent, seconds, significant};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let Some(original) = document.original() else {
        widgets::empty_note(ui, "Open a file to see its contents");
        return;
    };
    let o = &original.content;
    let lighter = document.lighter().map(|l| &l.content);
    widgets::table_row(ui, "", &["original".into(), "result".into()], true);
    let pair = |ui: &mut Ui, name: &str, one: Option<String>, two: Option<String>| {
        let dash = || "–".to_owned();
        widgets::table_row(ui, name, &[one.unwrap_or_else(dash), two.unwrap_or_else(dash)], false);
    };
    pair(ui, "Faces", Some(grouped(o.faces)), lighter.map(|l| grouped(l.faces)));
    pair(ui, "Vertices", Some(grouped(o.vertices)), lighter.map(|l| grouped(l.vertices)));
    let left = lighter.map(|l| percent(l.faces as f64 / o.faces.max(1) as f64));
    pair(ui, "Remaining", Some("100 %".into()), left);
    let [one, two] = document.topologies();
    let each = |of: &dyn Fn(&crate::content::TopologySummary) -> String| [one.map(of), two.map(of)];
    let rows: [(&str, [Option<String>; 2]); 4] = [
        ("Parts", each(&|a| grouped(a.components))),
        ("Border edges", each(&|a| grouped(a.border_edges))),
        ("Border loops", each(&|a| grouped(a.border_loops))),
        ("Non-manifold", each(&|a| grouped(a.non_manifold_edges))),
    ];
    for (name, [one, two]) in rows {
        pair(ui, name, one, two);
    }
    pair(
        ui,
        "Closed",
        one.map(|a| if a.is_closed { "yes" } else { "no" }.into()),
        two.map(|a| if a.is_closed { "yes" } else { "no" }.into()),
    );
    if let Some(l) = lighter {
        let diagonal = o.bounds.diagonal();
        let share = if diagonal > 0.0 { 100.0 * l.error() / diagonal } else { 0.0 };
        widgets::value_row(ui, "RMS error (% of diagonal)", format!("{} %", significant(share, 3)));
    }
    if let Some(px) = scope.facts.error_px {
        widgets::value_row(ui, "RMS error on screen", format!("{} px", significant(px, 2)));
    }

    widgets::heading(ui, "File");
    widgets::value_row(ui, "Format", o.file.format.title());
    let size = [0, 1, 2].map(|k| significant(o.bounds.max[k] - o.bounds.min[k], 3));
    widgets::value_row(ui, "Size", size.join(" × "));
    if o.non_finite_vertices > 0 {
        widgets::value_row(ui, "Non-finite vertices", grouped(o.non_finite_vertices));
    }
    let c = &o.file.contents;
    let counts = [
        ("Meshes", c.meshes),
        ("Materials", c.materials),
        ("Textures", c.textures),
        ("Skins", c.skins),
        ("Animations", c.animations),
        ("Morph targets", c.morph_targets),
    ];
    for (name, count) in counts.into_iter().filter(|x| x.1 > usize::from(x.0 == "Meshes")) {
        widgets::value_row(ui, name, grouped(count));
    }
    if let Some(summary) = one.filter(|a| !a.attributes.is_empty()) {
        widgets::value_row(ui, "Vertex attributes", summary.attributes.join(", "));
    }

    if let Some(stage) = document.stage() {
        let shown = &scope.facts.stage;
        widgets::heading(ui, "Stage");
        widgets::value_row(ui, "Copies", grouped(stage.copies.len()));
        widgets::value_row(ui, "Visible", grouped(shown.chosen.visible.len()));
        widgets::value_row(ui, "Stage CPU time", seconds(shown.secs))
            .on_hover_text(format!("Maximum: {}", seconds(shown.longest_secs)));
    }

    widgets::heading(ui, "Times");
    widgets::value_row(ui, "Load time", seconds(o.read_secs));
    if let Some(l) = lighter {
        widgets::value_row(ui, "Simplify time", seconds(l.seconds));
    }
    if let Some(d) = document.distances() {
        widgets::value_row(ui, "Measure time", seconds(d.seconds));
    }
    let tip = format!(
        "Time that the program takes for a frame of the window, without the graphics adapter: median of the last \
         frames; longest of them: {}",
        seconds(scope.facts.longest_frame_secs)
    );
    widgets::value_row(ui, "CPU frame time", seconds(scope.facts.frame_secs)).on_hover_text(tip);
    widgets::value_row(
        ui,
        "Triangles drawn",
        grouped(usize::try_from(scope.facts.triangles_drawn).unwrap_or(usize::MAX)),
    )
    .on_hover_text("Triangles of all pictures that are shown");
    ui.label(crate::theme::weak(ui, &scope.facts.adapter).small());
}
