//! Method panel: presets, and the options of the engine's table.

use eframe::egui::{CollapsingHeader, Ui, Vec2};
use lodsmith::options::by_name::{
    self, NamedOption, OPTIONS, OptionError, OptionGroup, OptionKind, OptionValue,
};
use lodsmith::{MethodKind, Preset, SimplifyError, SimplifyOptions};
use lodsmith_asset::Normals;

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::settings::simplification::Simplification;
use crate::theme::weak;

/// Presets with their names and descriptions.
const PRESETS: [(Preset, &str, &str); 5] = [
    (Preset::Auto, "Auto", "Closest shape for this many faces"),
    (Preset::Scan, "Scan", "3D scans: ignores noisy normals, joins what rounding separated"),
    (Preset::Cad, "CAD", "Machine parts: keeps holes and parts, borders slide along themselves"),
    (Preset::Visual, "Visual", "Games and rendering: shading counts more than distance"),
    (Preset::Print, "Print", "3D printing: closed stays closed, only the shape counts"),
];

/// Methods with their names and descriptions.
const METHODS: [(MethodKind, &str, &str); 10] = [
    (
        MethodKind::Memoryless,
        "Lodsmith (default)",
        "Costs from the current surface only, then a fit: the most accurate [Lindstrom-Turk 1998]",
    ),
    (
        MethodKind::Quadric,
        "Quadric (Garland-Heckbert)",
        "Accumulated plane quadrics of the original surface [Garland-Heckbert 1997]",
    ),
    (
        MethodKind::LindstromTurk,
        "Lindstrom-Turk",
        "Preserves volume and borders, as published [Lindstrom-Turk 1998]",
    ),
    (
        MethodKind::Melax,
        "Melax curvature",
        "Edge length times curvature, onto input vertices: for games [Melax 1998]",
    ),
    (
        MethodKind::ShortestEdge,
        "Shortest edge",
        "Shortest edges first, to their midpoint: evens out edge lengths",
    ),
    (
        MethodKind::Cluster,
        "Vertex clustering",
        "One vertex per grid cell: the fastest, for huge meshes [Lindstrom 2000]",
    ),
    (
        MethodKind::VertexRemoval,
        "Vertex removal",
        "Removes vertices and retriangulates the holes [Schroeder et al. 1992]",
    ),
    (
        MethodKind::Planar,
        "Planar regions",
        "Merges flat regions into few triangles, nothing else changes: for CAD and voxels",
    ),
    (MethodKind::Unsubdivide, "Reverse subdivision", "Reverses 4:1 subdivision where possible [Taubin 2001]"),
    (
        MethodKind::Remesh,
        "Remesh",
        "A new, uniform mesh on the same surface; closed if a voxel size is set [Botsch-Kobbelt 2004]",
    ),
];

/// Options with controls of their own: the slider has the target, and this panel lists of presets and methods.
const DRAWN_SPECIALLY: [&str; 6] = ["faces", "vertices", "ratio", "error", "preset", "method"];

/// Labels of options and attributes that are clearer than their names.
const LABELS: [(&str, &str); 9] = [
    ("border", "Borders"),
    ("color", "Colours"),
    ("max-normal", "Max normal deviation"),
    ("morph", "Morphs"),
    ("normal", "Normals"),
    ("per-mesh", "Target per mesh"),
    ("sharp", "Sharp edges"),
    ("uv", "UVs"),
    ("weight", "Weights"),
];

/// Largest factor of a weight on its slider.
const MAX_WEIGHT: f64 = 10.0;

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let before = &scope.document.settings().simplify;
    let mut how = before.clone();
    edit(ui, &mut how);
    if how != *before {
        scope.command(Command::Method(Box::new(how)));
    }
}

fn edit(ui: &mut Ui, how: &mut Simplification) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = Vec2::splat(4.0);
        for (preset, name, text) in PRESETS {
            if widgets::segment(ui, name, how.preset == preset, text) {
                *how = Simplification::of_preset(preset, how.options.stop);
            }
        }
    });
    let text = PRESETS.iter().find(|p| p.0 == how.preset).map_or("", |p| p.2);
    ui.label(weak(ui, text).small());
    if *how != Simplification::of_preset(how.preset, how.options.stop) {
        ui.horizontal_wrapped(|ui| {
            ui.label(weak(ui, "Options were changed under Advanced.").small());
            if ui.small_button("Reset").on_hover_text("Use the options of the preset").clicked() {
                *how = Simplification::of_preset(how.preset, how.options.stop);
            }
        });
    }
    CollapsingHeader::new("Advanced").show(ui, |ui| advanced(ui, how));
}

/// Draws all options but the preset.
fn advanced(ui: &mut Ui, how: &mut Simplification) {
    let mut kind = how.options.method.kind();
    let text = METHODS.iter().find(|m| m.0 == kind).map_or("", |m| m.2);
    if widgets::choose(ui, "Method", text, &METHODS.map(|m| (m.0, m.1)), &mut kind) {
        how.options.method = kind.into();
    }
    ui.label(weak(ui, text).small());
    rows(ui, OptionGroup::OfMethod, &mut how.options);
    rows(ui, OptionGroup::Simplification, &mut how.options);
    widgets::choose(
        ui,
        "Normals",
        "Normals of the result: from the input, recomputed, or none",
        &Normals::ALL.map(|normals| (normals, normals.name())),
        &mut how.normals,
    );
    for group in folded_groups() {
        let title = match group {
            OptionGroup::Guards => "Guards",
            OptionGroup::Deviation => "Deviation",
            _ => "Other options",
        };
        CollapsingHeader::new(title).show(ui, |ui| rows(ui, group, &mut how.options));
    }
}

/// Returns the groups of the table that are folded, in its order.
fn folded_groups() -> Vec<OptionGroup> {
    let mut groups = Vec::new();
    for group in OPTIONS.iter().map(|option| option.group) {
        let is_open =
            matches!(group, OptionGroup::Target | OptionGroup::Simplification | OptionGroup::OfMethod);
        if !is_open && !groups.contains(&group) {
            groups.push(group);
        }
    }
    groups
}

/// Draws the options of a group that the method has.
fn rows(ui: &mut Ui, group: OptionGroup, options: &mut SimplifyOptions) {
    let method = options.method.kind();
    let has = |option: &&NamedOption| option.methods.is_empty() || option.methods.contains(&method);
    for option in OPTIONS.iter().filter(|option| option.group == group).filter(has) {
        if !DRAWN_SPECIALLY.contains(&option.name) {
            row(ui, option, options);
        }
    }
}

/// Draws the control of an option by the kind of its values.
fn row(ui: &mut Ui, option: &NamedOption, options: &mut SimplifyOptions) {
    let name = label(option.name);
    let now = option.get(options);
    let new = match option.kind {
        OptionKind::Flag => {
            let mut is_on = now.is_some();
            widgets::switch(ui, &name, None, option.help, &mut is_on)
                .then_some(Some(OptionValue::Flag(is_on)))
        }
        OptionKind::Word(words) => {
            let text = now.map(|value| value.text());
            let mut chosen = words.iter().copied().find(|word| Some(*word) == text.as_deref());
            let unset = option.default_text().is_none().then_some((None::<&str>, "default"));
            let choices: Vec<_> =
                unset.into_iter().chain(words.iter().map(|word| (Some(*word), *word))).collect();
            let is_changed = widgets::choose(ui, &name, option.help, &choices, &mut chosen);
            is_changed.then_some(chosen.map(OptionValue::from))
        }
        OptionKind::Weights(_) => {
            let Some(OptionValue::Weights(mut weights)) = now else { return };
            let before = weights.clone();
            CollapsingHeader::new(&name).show(ui, |ui| {
                for (attribute, factor) in &mut weights {
                    widgets::slider(ui, &label(attribute), option.help, factor, 0.0..=MAX_WEIGHT);
                }
            });
            (weights != before).then_some(Some(OptionValue::Weights(weights)))
        }
        kind => {
            let wanted = kind.expected();
            let tip =
                format!("{}\n\nTakes {}. Empty: the default.", option.help, wanted.trim_end_matches(','));
            let text = now.map(|value| value.text()).unwrap_or_default();
            let is_good = |text: &str| text.trim().is_empty() || kind.parse(&text.into()).is_ok();
            let typed = widgets::field(ui, &name, &tip, |ui| {
                widgets::text_field(ui, &name, &text, "default", ui.available_width(), is_good)
            });
            typed.map(|text| (!text.trim().is_empty()).then(|| OptionValue::Text(text.into())))
        }
    };
    match new {
        None => {}
        Some(None) => by_name::reset(option, options),
        Some(Some(value)) => set(option, options, &value),
    }
}

/// Sets a value, and resets the options that exclude it.
fn set(option: &NamedOption, options: &mut SimplifyOptions, value: &OptionValue<'_>) {
    for _ in OPTIONS {
        match option.set(options, value) {
            Err(OptionError::Combination(SimplifyError::NotTogether { first, .. })) => {
                let Some(other) = by_name::find(first) else { return };
                by_name::reset(other, options);
            }
            _ => return,
        }
    }
}

/// Returns the label of an option or attribute: its name with a capital and blanks, unless [`LABELS`] has a better one.
fn label(name: &str) -> String {
    if let Some((_, label)) = LABELS.iter().find(|(known, _)| *known == name) {
        return (*label).to_owned();
    }
    let (first, rest) = name.split_at(name.len().min(1));
    format!("{}{}", first.to_uppercase(), rest.replace('-', " "))
}

#[cfg(test)]
mod tests {
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;
    use lodsmith::{Method, Remesh, RemeshPattern};

    use super::*;

    fn options_of(method: MethodKind) -> SimplifyOptions {
        let mut options = SimplifyOptions::default();
        options.method = method.into();
        options
    }

    #[test]
    fn every_option_of_the_table_is_drawn_by_its_kind_or_specially() {
        let mut drawn = DRAWN_SPECIALLY.to_vec();
        for method in MethodKind::ALL {
            let mut options = options_of(method);
            let harness = Harness::new_ui(|ui| {
                let open = [OptionGroup::OfMethod, OptionGroup::Simplification];
                for group in open.into_iter().chain(folded_groups()) {
                    rows(ui, group, &mut options);
                }
            });
            let is_drawn =
                |option: &&NamedOption| harness.query_all_by_label(&label(option.name)).next().is_some();
            let all = OPTIONS.iter().filter(is_drawn).map(|option| option.name);
            drawn.extend(all);
        }
        for option in OPTIONS {
            assert!(drawn.contains(&option.name), "{} has no control", option.name);
        }
    }

    #[test]
    fn a_new_value_replaces_the_options_that_exclude_it() {
        let mut options = options_of(MethodKind::Remesh);
        let steps = [("subdivisions", "3"), ("angle", "20"), ("voxel", "1%"), ("adaptive", "true")];
        for (name, text) in steps {
            set(by_name::find(name).unwrap(), &mut options, &text.into());
        }
        let pattern = RemeshPattern::Adaptive;
        let Method::Remesh(Remesh::OnSurface { pattern: got, crease_deg, .. }) = options.method else {
            panic!("{:?}", options.method)
        };
        assert_eq!((got, crease_deg), (pattern, None));
    }
}
