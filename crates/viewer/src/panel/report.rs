//! Report panel: the engine's report of its run.

use eframe::egui::Ui;
use lodsmith::options::by_name;
use lodsmith::{Change, Proposal, Refusal, Report, StoppedBy};

use super::{PanelContext, UiRequest, widgets};
use crate::command::Command;
use crate::content::Lighter;
use crate::document::log::Severity;
use crate::numbers::{grouped, percent, point, seconds, significant};
use crate::panel::keys::Action;
use crate::settings::bake::BakeSettings;
use crate::settings::simplification::{Simplification, quoted};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let Some(shown) = scope.document.lighter() else {
        widgets::empty_note(ui, "Nothing simplified yet; drag the slider below");
        return;
    };
    let lighter = shown.content.clone();
    let Some(r) = &lighter.report else { return level(ui, scope, &lighter) };
    let severity = if r.reached { Severity::Good } else { Severity::Warning };
    widgets::log_line(ui, severity, &end_text(r));
    widgets::value_row(ui, "Faces", format!("{} → {}", grouped(r.input_faces), grouped(r.faces)));
    widgets::value_row(ui, "Vertices", format!("{} → {}", grouped(r.input_vertices), grouped(r.vertices)));
    widgets::value_row(ui, "Remaining", percent(r.faces as f64 / r.input_faces.max(1) as f64));
    let share = |d: f64| match r.error.diagonal {
        diagonal if diagonal > 0.0 => format!("{} %", significant(100.0 * d / diagonal, 3)),
        _ => "-".to_owned(),
    };
    match &r.error.measured {
        None => _ = widgets::value_row(ui, "RMS error (estimated)", share(r.error.estimate)),
        Some(m) => {
            widgets::value_row(ui, "RMS error (measured)", share(m.rms.symmetric));
            widgets::value_row(ui, "Max error (measured)", share(m.hausdorff.symmetric));
            if let Some((name, place)) = farthest_texts(r, &lighter) {
                widgets::value_row(ui, name, &place).on_hover_text(&place);
            }
        }
    }
    if let Some(bound) = r.error.bound {
        widgets::value_row(ui, "Max error (proven)", share(bound));
    }
    widgets::value_row(ui, "Time", seconds(lighter.seconds));
    more(ui, r);
    for warning in &lighter.warnings {
        widgets::log_line(ui, Severity::Warning, warning);
    }
    if lighter.counts.len() > 1 {
        widgets::heading(ui, "Meshes");
        for (mesh, m) in lighter.model.meshes.iter().zip(&lighter.counts) {
            widgets::value_row(ui, &mesh.name, format!("{} → {}", grouped(m.input_faces), grouped(m.faces)));
        }
    }
    if !r.refusals.is_empty() {
        widgets::heading(ui, "Kept because of");
        for (refusal, count) in &r.refusals {
            widgets::value_row(
                ui,
                refusal_text(*refusal),
                grouped(usize::try_from(*count).unwrap_or(usize::MAX)),
            );
        }
    }
    if !r.proposals.is_empty() {
        widgets::heading(ui, "Suggestions");
        for proposal in &r.proposals {
            propose(ui, scope, proposal);
        }
    }
    command(ui, scope);
}

/// Returns the name and the value of the row with the place of the largest distance.
fn farthest_texts(r: &Report, lighter: &Lighter) -> Option<(&'static str, String)> {
    let farthest = r.error.measured.as_ref()?.farthest?;
    let name = if farthest.is_forward { "Max error at, on original" } else { "Max error at, on result" };
    let at = point(farthest.point, r.error.diagonal);
    let mesh = r.error.farthest_part.filter(|_| lighter.counts.len() > 1);
    Some(match mesh.and_then(|mesh| lighter.model.meshes.get(mesh)) {
        Some(mesh) => (name, format!("{at}, in {}", mesh.name)),
        None => (name, at),
    })
}

/// Returns why the run ended.
fn end_text(r: &Report) -> String {
    match (r.reached, r.stopped_by) {
        (true, StoppedBy::Faces | StoppedBy::Ratio) => format!("Reached {} faces", grouped(r.faces)),
        (true, StoppedBy::Vertices) => format!("Reached {} vertices", grouped(r.vertices)),
        (true, StoppedBy::Error) => "Reached the error limit".to_owned(),
        (true, StoppedBy::Refusals) => "Within the error limit: no further collapse is allowed".to_owned(),
        (true, _) => "Target reached".to_owned(),
        (false, StoppedBy::Refusals) => "Target not reached: no further collapse is allowed".to_owned(),
        (false, StoppedBy::Exhausted) => {
            "Target not reached: the method has nothing left to remove".to_owned()
        }
        (false, StoppedBy::Error) => "Target not reached: it would exceed the error limit".to_owned(),
        (false, StoppedBy::Caller) => "Target not reached: the run was stopped".to_owned(),
        (false, _) => "Target not reached".to_owned(),
    }
}

/// Returns what a refusal protects.
fn refusal_text(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::LinkCondition => "Topology",
        Refusal::NormalFlip => "Flipped faces",
        Refusal::Quality => "Face quality",
        Refusal::Valence => "Edges per vertex",
        Refusal::EdgeLength => "Edge length",
        Refusal::Border => "Borders",
        Refusal::NonManifold => "Non-manifold edges",
        Refusal::Component => "Separate parts",
        Refusal::Seam => "Texture seams",
        Refusal::ErrorLimit => "Error limit",
        Refusal::Locked => "Locks",
        Refusal::Pattern => "Subdivision pattern",
        other => other.name(),
    }
}

/// Draws the figures of a preview level, for which there was no run.
fn level(ui: &mut Ui, scope: &mut PanelContext<'_>, lighter: &Lighter) {
    let Some(original) = scope.document.original().map(|o| o.content.clone()) else { return };
    match scope.document.is_outdated() {
        true => widgets::log_line(ui, Severity::Note, "Preview. The exact result follows"),
        false => widgets::log_line(ui, Severity::Warning, "Preview. The exact run did not finish"),
    }
    widgets::value_row(ui, "Faces", format!("{} → {}", grouped(original.faces), grouped(lighter.faces)));
    widgets::value_row(
        ui,
        "Vertices",
        format!("{} → {}", grouped(original.vertices), grouped(lighter.vertices)),
    );
    widgets::value_row(ui, "Remaining", percent(lighter.faces as f64 / original.faces.max(1) as f64));
    let diagonal = original.bounds.diagonal();
    let errors = [
        ("RMS error (estimated)", Some(lighter.error())),
        ("Max error (estimated)", lighter.largest_estimate),
    ];
    for (name, error) in errors {
        let Some(error) = error.filter(|_| diagonal > 0.0) else { continue };
        widgets::value_row(ui, name, format!("{} %", significant(100.0 * error / diagonal, 3)));
    }
    widgets::value_row(ui, "Time", seconds(lighter.seconds));
    command(ui, scope);
}

/// Draws the equivalent command line, to be copied.
fn command(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    widgets::heading(ui, "Command line");
    let line = command_line(scope.document.settings(), scope.document.baked().map(|b| &b.settings));
    ui.horizontal_wrapped(|ui| {
        ui.add(eframe::egui::Label::new(crate::theme::number(&line)).wrap().selectable(true));
    });
    let tip = Action::CopyCommand.tip("Copy to the clipboard");
    if ui.button("Copy").on_hover_text(tip).clicked() {
        scope.requests.push(UiRequest::Copy(line));
    }
}

fn more(ui: &mut Ui, r: &Report) {
    let c = &r.cleanup;
    let all = [
        ("Whole parts removed", r.parts_removed),
        ("Small parts pruned", r.pruned.parts),
        ("Necks cut", r.necks_cut),
        ("Pairs merged", r.pairs_contracted),
        ("Two-sided faces, pairs", r.two_sided_pairs),
        ("Vertices welded", c.welded_vertices),
        ("Degenerate faces removed", c.degenerate_faces),
        ("Duplicate faces removed", c.duplicate_faces),
        ("Non-finite faces removed", c.non_finite_faces),
    ];
    for (name, count) in all.into_iter().filter(|x| x.1 > 0) {
        widgets::value_row(ui, name, grouped(count));
    }
}

/// Draws a proposal for a run that did not reach its target, with a button if it can be applied.
fn propose(ui: &mut Ui, scope: &mut PanelContext<'_>, proposal: &Proposal) {
    let words: Vec<_> = proposal.changes.iter().map(change_text).collect();
    let mut how = scope.document.settings().simplify.clone();
    let can_do = proposal.changes.iter().all(|change| apply(*change, &mut how));
    ui.horizontal_wrapped(|ui| {
        if can_do && ui.button("Apply").on_hover_text("Apply these options").clicked() {
            scope.command(Command::Method(Box::new(how)));
        }
        ui.label(words.join(" and "));
    });
}

fn change_text(change: &Change) -> String {
    match *change {
        Change::Border(to) => format!("borders: {}", to.name()),
        Change::Topology(to) => format!("topology: {}", to.name()),
        Change::Placement(to) => format!("placement: {}", to.name()),
        Change::MaxNormal => "larger normal deviation".to_owned(),
        Change::MinQuality => "lower shape quality".to_owned(),
        Change::MaxValence => "higher valence".to_owned(),
        Change::MaxEdge => "longer edges".to_owned(),
        Change::Locked => "fewer locks".to_owned(),
        Change::Pairs(distance) => format!("pairs closer than {}", by_name::length_text(distance)),
    }
}

/// Applies a change to the options; returns false if the model has to change instead.
fn apply(change: Change, how: &mut Simplification) -> bool {
    how.options = change.apply(&how.options);
    change != Change::Locked
}

/// Returns the command line that makes the shown result.
pub fn command_line(settings: &crate::settings::Settings, baked: Option<&BakeSettings>) -> String {
    let Some(file) = settings.file() else { return "lodsmith view".to_owned() };
    let mut words = vec!["lodsmith".to_owned(), "simplify".to_owned(), file.display().to_string()];
    let (output, _) = crate::content::export::default_file(file, baked.is_some());
    words.extend(["-o".to_owned(), output.display().to_string()]);
    words.extend(settings.simplify.words());
    if !settings.simplify.has_target() && settings.simplify.options.stop.ratio.is_none() {
        words.extend(["--ratio".to_owned(), "1".to_owned()]);
    }
    words.extend(baked.into_iter().flat_map(BakeSettings::words));
    words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
}
