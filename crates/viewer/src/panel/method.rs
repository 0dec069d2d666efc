//! Method panel: the options of the engine.

use std::ops::RangeInclusive;

use eframe::egui::{CollapsingHeader, Ui};
use lodsmith::options::by_name::{self, OptionKind};
use lodsmith::{
    AttributeWeights, BorderPolicy, Fit, Guards, Length, Measure, Method, MethodKind, Placement, Preset,
    Remesh, RemeshPattern, SimplifyOptions, TopologyPolicy,
};

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::settings::simplification::{Normals, Simplification, named};

/// Presets with their names and descriptions.
const PRESETS: [(Preset, &str, &str); 5] = [
    (Preset::Auto, "Auto", "The closest surface for the count"),
    (Preset::Scan, "Scan", "3D scans: ignores noisy normals, joins what rounding separated"),
    (Preset::Cad, "CAD", "Machine parts: keeps holes and parts, borders slide along themselves"),
    (Preset::Visual, "Visual", "Games and rendering: shading counts more than distance"),
    (Preset::Print, "Print", "3D printing: closed stays closed, only the shape counts"),
];

/// Methods with their descriptions.
const METHODS: [(MethodKind, &str); 10] = [
    (
        MethodKind::Memoryless,
        "Costs from the current surface only, then a fit: the most accurate [Lindstrom-Turk 1998]",
    ),
    (MethodKind::Quadric, "Accumulated plane quadrics of the original surface [Garland-Heckbert 1997]"),
    (MethodKind::LindstromTurk, "Preserves volume and borders, as published [Lindstrom-Turk 1998]"),
    (MethodKind::Melax, "Edge length times curvature, onto input vertices: for games [Melax 1998]"),
    (MethodKind::ShortestEdge, "Shortest edges first, to their midpoint: evens out edge lengths"),
    (MethodKind::Cluster, "One vertex per grid cell: the fastest, for huge meshes [Lindstrom 2000]"),
    (MethodKind::VertexRemoval, "Removes vertices and retriangulates the holes [Schroeder et al. 1992]"),
    (MethodKind::Planar, "Merges flat regions into few triangles, nothing else changes: for CAD and voxels"),
    (MethodKind::Unsubdivide, "Reverses 4:1 subdivision where possible [Taubin 2001]"),
    (
        MethodKind::Remesh,
        "A new, uniform mesh on the same surface; closed if a voxel size is set [Botsch-Kobbelt 2004]",
    ),
];

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
        ui.spacing_mut().item_spacing = eframe::egui::Vec2::splat(4.0);
        for (preset, name, text) in PRESETS {
            if widgets::segment(ui, name, how.preset == preset, text) {
                *how = Simplification::of_preset(preset, how.options.stop);
            }
        }
    });
    let text = PRESETS.iter().find(|p| p.0 == how.preset).map_or("", |p| p.2);
    ui.label(crate::theme::weak(ui, text).small());
    if *how != Simplification::of_preset(how.preset, how.options.stop) {
        ui.horizontal_wrapped(|ui| {
            ui.label(crate::theme::weak(ui, "Options were changed under Advanced.").small());
            if ui.small_button("Reset").on_hover_text("Use the options of the preset").clicked() {
                *how = Simplification::of_preset(how.preset, how.options.stop);
            }
        });
    }
    CollapsingHeader::new("Advanced").show(ui, |ui| advanced(ui, how));
}

/// Draws all options but the preset.
fn advanced(ui: &mut Ui, how: &mut Simplification) {
    let o = &mut how.options;
    let mut kind = o.method.kind();
    let text = METHODS.iter().find(|m| m.0 == kind).map_or("", |m| m.1);
    if widgets::choose(ui, "Method", text, &named(MethodKind::ALL, MethodKind::name), &mut kind) {
        o.method = kind.into();
    }
    ui.label(crate::theme::weak(ui, text).small());
    of_method(ui, &mut o.method);
    widgets::choose(
        ui,
        "Placement",
        "Position of a merged vertex; endpoint keeps a subset of the vertices",
        &named(Placement::ALL, Placement::name),
        &mut o.placement,
    );
    widgets::choose(
        ui,
        "Fit",
        "Final least-squares fit to the original",
        &named(Fit::ALL, Fit::name),
        &mut o.fit,
    );
    widgets::choose(
        ui,
        "Borders",
        "How to treat open borders: keep their shape, slide along them, lock them, or ignore them",
        &named(BorderPolicy::ALL, BorderPolicy::name),
        &mut o.border,
    );
    let tip = "Edges sharper than this angle, in degrees, are features; their vertices stay on them";
    widgets::optional(ui, "Sharp edges", tip, &mut o.sharp_deg, 30.0, range("sharp"));
    let tip = "relaxed: no new defects; preserve: no changes; free: cut handles and remove parts where that is cheapest";
    widgets::choose(ui, "Topology", tip, &named(TopologyPolicy::ALL, TopologyPolicy::name), &mut o.topology);
    widgets::choose(
        ui,
        "Normals",
        "Normals of the result: from the input, recomputed, or none",
        &named(Normals::ALL, Normals::name),
        &mut how.normals,
    );

    CollapsingHeader::new("Weights").show(ui, |ui| edit_weights(ui, &mut o.weights));
    CollapsingHeader::new("Guards").show(ui, |ui| edit_guards(ui, &mut o.guards));
    CollapsingHeader::new("More").show(ui, |ui| edit_more(ui, o));
}

fn edit_weights(ui: &mut Ui, w: &mut AttributeWeights) {
    let all = [
        ("Normals", &mut w.normal),
        ("UVs", &mut w.uv),
        ("Colours", &mut w.color),
        ("Morphs", &mut w.morph),
        ("Skin", &mut w.skin),
        ("Other", &mut w.other),
        ("Borders", &mut w.border),
    ];
    for (name, weight) in all {
        widgets::slider(ui, name, "Multiplies the default weight; 0 ignores it", weight, 0.0..=10.0);
    }
}

fn edit_guards(ui: &mut Ui, g: &mut Guards) {
    widgets::optional(
        ui,
        "Max normal deviation",
        "Largest rotation of a face normal in one step, in degrees",
        &mut g.max_normal_deg,
        30.0,
        range("max-normal"),
    );
    widgets::optional(
        ui,
        "Quality",
        "Minimum shape quality of a new face; 1 is equilateral",
        &mut g.min_quality,
        0.1,
        range("min-quality"),
    );
    widgets::optional_count(ui, "Valence", "Maximum number of edges at a vertex", &mut g.max_valence, 12, 3);
    widgets::optional_length(ui, "Edge length", "Maximum length of a new edge", &mut g.max_edge);
}

fn edit_more(ui: &mut Ui, o: &mut SimplifyOptions) {
    widgets::optional_length(
        ui,
        "Weld",
        "Merge vertices closer than this first (coincident vertices are always merged)",
        &mut o.weld,
    );
    widgets::optional_length(ui, "Prune", "Remove connected parts smaller than this first", &mut o.prune);
    let mut is_measured = o.measure == Measure::Always;
    let tip = "Measure the result against the input in both directions; this takes a while";
    if widgets::switch(ui, "Measure the result", None, tip, &mut is_measured) {
        o.measure = if is_measured { Measure::Always } else { Measure::Auto };
    }
    let tip = "If the target cannot be reached, try progressively looser topology";
    widgets::switch(ui, "Escalate", None, tip, &mut o.escalate);
    let tip = "In a scene, apply the target to each mesh separately";
    widgets::switch(ui, "Target per mesh", None, tip, &mut o.per_mesh);
    widgets::field(ui, "Seed", "Equal seeds give equal results", |ui| {
        ui.add(eframe::egui::DragValue::new(&mut o.seed));
    });
}

/// Returns the range of an option's values for a control, in steps of 1 beside ends that are not in it.
fn range(name: &str) -> RangeInclusive<f64> {
    match by_name::find(name).map(|option| option.kind) {
        Some(OptionKind::Degrees(range) | OptionKind::Number(range)) => {
            let step = |is_in: bool| if is_in { 0.0 } else { 1.0 };
            range.least + step(range.has_least)..=range.most - step(range.has_most)
        }
        _ => 0.0..=f64::INFINITY,
    }
}

/// Draws the options that only this method has.
fn of_method(ui: &mut Ui, method: &mut Method) {
    let angle = |ui: &mut Ui, angle: &mut Option<f64>, tip: &str, first: f64| {
        widgets::optional(ui, "Angle", tip, angle, first, range("angle"));
    };
    const CREASES: &str = "Edges bent by more than this angle, in degrees, are creases";
    match method {
        Method::Memoryless { pairs } | Method::Quadric { pairs } => {
            let tip = "Also merge unconnected vertices closer than this, which joins separate parts";
            widgets::optional_length(ui, "Pairs", tip, pairs);
        }
        Method::Cluster { cell, two_stage } => {
            widgets::optional_length(ui, "Cell", "Edge length of a grid cell", cell);
            let tip = "Cluster to a multiple of the target, then continue with memoryless";
            widgets::switch(ui, "Two stages", None, tip, two_stage);
        }
        Method::ShortestEdge { edge_length } => {
            widgets::optional_length(ui, "Edge length", "Collapse edges up to this length", edge_length);
        }
        Method::VertexRemoval { crease_deg } => angle(ui, crease_deg, CREASES, 30.0),
        Method::Planar { angle_deg, flat } => {
            let tip = "Maximum angle between a face and the plane of its region, in degrees";
            angle(ui, angle_deg, tip, 5.0);
            widgets::optional_length(ui, "Flat", "Maximum distance from the plane of a region", flat);
        }
        Method::Unsubdivide { levels } => {
            widgets::optional_count(ui, "Levels", "Maximum number of levels to reverse", levels, 1, 1);
        }
        Method::Remesh(remesh) => edit_remesh(ui, remesh),
        _ => {}
    }
}

fn edit_remesh(ui: &mut Ui, remesh: &mut Remesh) {
    let mut voxel: Option<Length> = match remesh {
        Remesh::Voxels { size } => Some(*size),
        _ => None,
    };
    let tip = "Voxel size; wraps the input in a closed surface, whatever its defects";
    widgets::optional_length(ui, "Voxel", tip, &mut voxel);
    *remesh = match (voxel, *remesh) {
        (Some(size), _) => Remesh::Voxels { size },
        (None, Remesh::Voxels { .. }) => Remesh::default(),
        (None, own) => own,
    };
    let Remesh::OnSurface { edge_length, crease_deg, rounds, pattern } = remesh else { return };
    widgets::optional_length(ui, "Edge length", "Length of the new edges", edge_length);
    let tip = "Edges bent by more than this angle, in degrees, are creases";
    widgets::optional(ui, "Angle", tip, crease_deg, 30.0, range("angle"));
    widgets::optional_count(ui, "Iterations", "Number of remeshing iterations", rounds, 5, 1);
    let mut subdivisions = match pattern {
        RemeshPattern::SemiRegular { subdivisions } => Some(*subdivisions),
        _ => None,
    };
    let mut is_adaptive = *pattern == RemeshPattern::Adaptive;
    widgets::optional_count(
        ui,
        "Subdivisions",
        "Number of subdivisions of a base mesh",
        &mut subdivisions,
        3,
        1,
    );
    let tip = "Shorter edges where the surface is curved";
    let is_switched = widgets::switch(ui, "Adaptive", None, tip, &mut is_adaptive);
    *pattern = match subdivisions {
        _ if is_switched && is_adaptive => RemeshPattern::Adaptive,
        Some(subdivisions) => RemeshPattern::SemiRegular { subdivisions },
        None if is_adaptive => RemeshPattern::Adaptive,
        None => RemeshPattern::Even,
    };
}
