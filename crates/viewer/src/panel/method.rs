//! Method panel: the options of the engine.

use eframe::egui::{CollapsingHeader, Ui};
use lodsmith::{Measure, Method, MethodOptions};

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::option_words::{BORDERS, FITS, NORMALS, PLACEMENTS, PRESETS, Simplification, TOPOLOGIES};

/// Methods with their descriptions.
const METHODS: [(Method, &str); 10] = [
    (
        Method::Memoryless,
        "Costs of the present surface alone, then a fit: the closest mesh [Lindstrom-Turk 1998]",
    ),
    (Method::Quadric, "Sums of plane quadrics that remember the original [Garland-Heckbert 1997]"),
    (Method::LindstromTurk, "Keeps volume and borders, as published [Lindstrom-Turk 1998]"),
    (Method::Melax, "Length times curvature, onto vertices of the input: game levels [Melax 1998]"),
    (Method::ShortestEdge, "Short edges first, onto their middle: evens out"),
    (Method::Cluster, "One vertex for each cell of a grid: the fastest, for huge meshes [Lindstrom 2000]"),
    (Method::VertexRemoval, "A subset of the vertices, holes filled anew [Schroeder et al. 1992]"),
    (Method::Planar, "Flat regions in few triangles, nothing else moves: CAD, voxels"),
    (Method::Unsubdivide, "Undoes 4:1 subdivision where it fits [Taubin 2001]"),
    (Method::Remesh, "A new, even mesh on the old surface; closed with a voxel size [Botsch-Kobbelt 2004]"),
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
    let mut preset = how.preset;
    let tip = "Options for a purpose; all can be changed afterwards";
    if widgets::choose(ui, "Preset", tip, PRESETS, &mut preset) {
        *how = Simplification::of_preset(preset, how.options.stop);
    }
    let o = &mut how.options;
    let names: Vec<_> = Method::ALL.iter().map(|m| (*m, m.name())).collect();
    let said = |method: Method| METHODS.iter().find(|m| m.0 == method).map_or("", |m| m.1);
    if widgets::choose(ui, "Method", said(o.method), &names, &mut o.method) {
        // Options of the previous method are an error for another one.
        o.method_options = MethodOptions::default();
    }
    ui.label(crate::theme::weak(ui, said(o.method)).small());
    of_method(ui, o.method, &mut o.method_options);
    widgets::choose(
        ui,
        "Placement",
        "Where a merged vertex goes; endpoint keeps a subset of the vertices",
        PLACEMENTS,
        &mut o.placement,
    );
    widgets::choose(ui, "Fit", "Last least-squares step towards the original", FITS, &mut o.fit);
    widgets::choose(
        ui,
        "Borders",
        "Open borders: held in place, moved along themselves, untouched, no care",
        BORDERS,
        &mut o.border,
    );
    let tip = "Edges sharper than this angle, in degrees, are features: their vertices keep to their line";
    widgets::optional(ui, "Sharp edges", tip, &mut o.sharp_deg, 30.0, 1.0..=179.0);
    let tip = "relaxed: no new defects; preserve: nothing changes; free: handles are cut and parts go where that is cheapest";
    widgets::choose(ui, "Topology", tip, TOPOLOGIES, &mut o.topology);
    widgets::choose(
        ui,
        "Normals",
        "Normals of the result: the input's, new ones, or none",
        NORMALS,
        &mut how.normals,
    );

    CollapsingHeader::new("Weights").show(ui, |ui| {
        let w = &mut o.weights;
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
            widgets::slider(
                ui,
                name,
                "Times what it counts by itself; 0 gives it no say",
                weight,
                0.0..=10.0,
            );
        }
    });
    CollapsingHeader::new("Guards").show(ui, |ui| {
        let g = &mut o.guards;
        widgets::optional(
            ui,
            "Turn of a face",
            "Largest turn of a face in one step, in degrees",
            &mut g.max_normal_deg,
            30.0,
            1.0..=180.0,
        );
        widgets::optional(
            ui,
            "Quality",
            "Least shape of a new face: 1 is equilateral",
            &mut g.min_quality,
            0.1,
            0.0..=1.0,
        );
        widgets::optional_count(ui, "Valence", "Most edges at a vertex", &mut g.max_valence, 12, 3);
        widgets::optional_length(ui, "Edge length", "Longest new edge", &mut g.max_edge);
    });
    CollapsingHeader::new("More").show(ui, |ui| {
        widgets::optional_length(
            ui,
            "Weld",
            "Join vertices closer than this first; equal ones always are",
            &mut o.weld,
        );
        widgets::optional_length(ui, "Prune", "Connected parts smaller than this go first", &mut o.prune);
        let mut is_measured = o.measure == Measure::Always;
        let tip = "Measure the result against the input, both ways; takes a while";
        if widgets::switch(ui, "Measure the result", None, tip, &mut is_measured) {
            o.measure = if is_measured { Measure::Always } else { Measure::Auto };
        }
        let tip = "Where the target is out of reach, try looser topology in turn";
        widgets::switch(ui, "Escalate", None, tip, &mut o.escalate);
        let tip = "In a scene: the target is for each mesh by itself";
        widgets::switch(ui, "Target for each mesh", None, tip, &mut o.per_mesh);
        widgets::field(ui, "Seed", "Equal seeds give equal results", |ui| {
            ui.add(eframe::egui::DragValue::new(&mut o.seed));
        });
    });
}

/// Draws the options that only this method has.
fn of_method(ui: &mut Ui, method: Method, m: &mut MethodOptions) {
    let angle = |ui: &mut Ui, m: &mut MethodOptions, tip: &str, first: f64| {
        widgets::optional(ui, "Angle", tip, &mut m.angle_deg, first, 0.0..=89.0);
    };
    match method {
        Method::Memoryless | Method::Quadric => {
            let tip = "Contract vertices closer than this too where no edge joins them, so that parts grow together";
            widgets::optional_length(ui, "Pairs", tip, &mut m.pairs);
        }
        Method::Cluster => {
            widgets::optional_length(ui, "Cell", "Edge of a cell", &mut m.cell);
            let tip = "Clusters only to a multiple of the target, and on with memoryless";
            widgets::switch(ui, "Two stages", None, tip, &mut m.two_stage);
        }
        Method::ShortestEdge => {
            widgets::optional_length(ui, "Edge length", "Edges up to this length go", &mut m.edge_length);
        }
        Method::VertexRemoval => angle(ui, m, "Edges bent by more are creases, in degrees", 30.0),
        Method::Planar => {
            angle(ui, m, "Largest angle between a face and the plane of its region, in degrees", 5.0);
            widgets::optional_length(ui, "Flat", "Largest distance from the plane of a region", &mut m.flat);
        }
        Method::Unsubdivide => {
            widgets::optional_count(ui, "Levels", "Levels to undo, at most", &mut m.iterations, 1, 1);
        }
        Method::Remesh => {
            widgets::optional_length(ui, "Edge length", "Length of the new edges", &mut m.edge_length);
            widgets::optional_length(
                ui,
                "Voxel",
                "A closed surface round the input, whatever state it is in",
                &mut m.voxel,
            );
            angle(ui, m, "Edges bent by more are creases, in degrees", 30.0);
            widgets::optional_count(ui, "Rounds", "Rounds of remeshing", &mut m.iterations, 5, 1);
            widgets::optional_count(
                ui,
                "Subdivisions",
                "A base mesh, subdivided so many times",
                &mut m.subdivisions,
                3,
                1,
            );
            widgets::switch(ui, "Adaptive", None, "Short edges where the surface is curved", &mut m.adaptive);
        }
        _ => {}
    }
}
