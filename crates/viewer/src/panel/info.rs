//! Info panel: counts, components, borders and times of both sides.

use eframe::egui::Ui;

use super::{Scope, parts};
use crate::numbers::{grouped, percent, seconds, significant};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut Scope<'_>) {
    let document = scope.document;
    let Some(original) = document.original() else {
        parts::nothing(ui, "open a file to see what is in it");
        return;
    };
    let o = &original.content;
    let lighter = document.lighter().map(|l| &l.content);
    parts::columns(ui, "", &["original".into(), "result".into()], true);
    let pair = |ui: &mut Ui, name: &str, one: Option<String>, two: Option<String>| {
        let dash = || "–".to_owned();
        parts::columns(ui, name, &[one.unwrap_or_else(dash), two.unwrap_or_else(dash)], false);
    };
    pair(ui, "Faces", Some(grouped(o.faces)), lighter.map(|l| grouped(l.faces)));
    pair(ui, "Vertices", Some(grouped(o.vertices)), lighter.map(|l| grouped(l.vertices)));
    let left = lighter.map(|l| percent(l.faces as f64 / o.faces.max(1) as f64));
    pair(ui, "Percent", Some("100 %".into()), left);
    let [one, two] = document.anatomies();
    let each = |of: &dyn Fn(&crate::content::Anatomy) -> String| [one.map(of), two.map(of)];
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
        parts::fact(ui, "RMS error of the diagonal", format!("{} %", significant(share, 3)));
    }
    if let Some(px) = scope.facts.error_px {
        parts::fact(ui, "RMS error on the screen", format!("{} px", significant(px, 2)));
    }

    parts::heading(ui, "File");
    parts::fact(ui, "Format", o.file.format.title());
    let size = [0, 1, 2].map(|k| significant(o.bounds.max[k] - o.bounds.min[k], 3));
    parts::fact(ui, "Size", size.join(" × "));
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
        parts::fact(ui, name, grouped(count));
    }
    if let Some(anatomy) = one.filter(|a| !a.attributes.is_empty()) {
        parts::fact(ui, "On vertices", anatomy.attributes.join(", "));
    }

    if let Some(stage) = document.stage() {
        let shown = &scope.facts.stage;
        parts::heading(ui, "Stage");
        parts::fact(ui, "Copies", grouped(stage.copies.len()));
        parts::fact(ui, "In sight", grouped(shown.chosen.in_sight.len()));
        parts::fact(ui, "Our part of a frame", seconds(shown.secs))
            .on_hover_text(format!("longest: {}", seconds(shown.longest_secs)));
    }

    parts::heading(ui, "Times");
    parts::fact(ui, "Opening", seconds(o.read_secs));
    if let Some(l) = lighter {
        parts::fact(ui, "Simplifying", seconds(l.seconds));
    }
    if let Some(d) = document.distances() {
        parts::fact(ui, "Measuring", seconds(d.seconds));
    }
    parts::fact(ui, "Frame, our part", seconds(scope.facts.frame_secs))
        .on_hover_text(format!("longest: {}", seconds(scope.facts.longest_frame_secs)));
    parts::fact(
        ui,
        "Triangles drawn",
        grouped(usize::try_from(scope.facts.triangles_drawn).unwrap_or(usize::MAX)),
    );
    ui.label(crate::theme::weak(ui, &scope.facts.adapter).small());
}
