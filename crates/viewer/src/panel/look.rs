//! Look panel: appearance of surfaces, light and background.

use eframe::egui::{self, Ui};
use lodsmith_core::mesh::creases::{CREASE_ANGLE_DEG, Creases};
use lodsmith_render::{ColorMap, Shading};

use super::{PanelContext, UiRequest, files, widgets};
use crate::command::Command;
use crate::content::flaws::COUNT_NAMES;
use crate::numbers::grouped;
use crate::panel::keys::Action;
use crate::settings::up_axis::UpAxis;
use crate::settings::{Appearance, Backdrop, EnvironmentChoice, Rig};

/// Shadings with their names, in the order of their keys.
pub const SHADINGS: [(Shading, &str); 7] = [
    (Shading::Smooth, "Smooth"),
    (Shading::Flat, "Flat"),
    (Shading::Textured, "Textured"),
    (Shading::VertexColors, "Vertex colours"),
    (Shading::Normals, "Normals"),
    (Shading::Matcap, "Matcap"),
    (Shading::Heat, "Error heat map"),
];

/// Colour maps with their names.
const COLOR_MAPS: [(ColorMap, &str); 3] =
    [(ColorMap::Turbo, "Turbo"), (ColorMap::Viridis, "Viridis"), (ColorMap::Diverging, "Diverging")];

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let before = scope.document.settings().look.clone();
    let mut all = before.clone();
    let (mut up, up_before) = (scope.document.settings().up, scope.document.settings().up);
    let tip =
        "Axis of the file that points up. Auto guesses it from format and shape; a choice is remembered";
    let auto = format!("Auto ({})", scope.document.up().name());
    let axes =
        UpAxis::ALL.map(|(axis, name)| (axis, if axis == UpAxis::Auto { auto.as_str() } else { name }));
    widgets::choose(ui, "Up axis", tip, &axes, &mut up);
    if up != up_before {
        scope.command(Command::Up(up));
    }
    let look = &mut all.look;
    widgets::choose(ui, "Shading", "How the surface is coloured", &SHADINGS, &mut look.shading);
    let no_normals = scope
        .document
        .original()
        .filter(|o| o.content.model().meshes.iter().any(|m| m.mesh.normals().is_none()));
    if let Some(original) = no_normals {
        creases(ui, &mut all.creases, original.content.creases(Creases::Auto));
    }
    let look = &mut all.look;
    widgets::field(ui, "Surface", "Surface colour for shadings without their own", |ui| {
        widgets::color(ui, &mut look.surface);
    });
    widgets::switch(
        ui,
        "Wireframe",
        Some(Action::Wireframe),
        "Draw the edges of all faces as lines",
        &mut look.wireframe,
    );
    ui.add_enabled_ui(look.wireframe, |ui| {
        widgets::field(ui, "Lines", "Colour and width of the lines", |ui| {
            let [r, g, b, opacity] = look.wire;
            let mut rgb = [r, g, b];
            if widgets::color(ui, &mut rgb) {
                look.wire = [rgb[0], rgb[1], rgb[2], opacity];
            }
            let opaque =
                egui::DragValue::new(&mut look.wire[3]).range(0.0..=1.0).speed(0.01).fixed_decimals(2);
            ui.add(opaque).on_hover_text("Opacity");
            let width = egui::DragValue::new(&mut look.wire_width_px).range(0.5..=4.0).speed(0.02);
            ui.add(width.suffix(" px").fixed_decimals(1));
        });
    });
    widgets::switch(
        ui,
        "Open borders",
        Some(Action::Borders),
        "Highlight edges with only one face",
        &mut look.borders,
    );
    widgets::switch(
        ui,
        "Defects",
        Some(Action::Defects),
        "Highlight non-manifold edges, zero-area faces and duplicate faces",
        &mut look.defects,
    );
    if look.borders || look.defects {
        flaws(ui, scope, [look.borders, look.defects]);
    }
    widgets::switch(
        ui,
        "Backface culling",
        Some(Action::Cull),
        "Hide faces seen from behind",
        &mut look.cull_back,
    );

    widgets::heading(ui, "Background & lighting");
    let mut backdrop = match all.backdrop {
        Backdrop::Color(_) => Backdrop::Color([1.0; 3]),
        other => other,
    };
    if widgets::choose(ui, "Background", "", &Backdrop::ALL, &mut backdrop) {
        all.backdrop = backdrop;
        // A plain environment has no image to show as background.
        if matches!(backdrop, Backdrop::Surroundings | Backdrop::Blurred)
            && all.around == EnvironmentChoice::Plain
        {
            all.around = EnvironmentChoice::Auto;
        }
    }
    if let Backdrop::Color(color) = &mut all.backdrop {
        widgets::field(ui, "Colour", "", |ui| {
            widgets::color(ui, color);
        });
    }
    widgets::switch(ui, "Ground grid", Some(Action::Ground), "Show a grid below the model", &mut all.ground);
    if widgets::choose(ui, "Light", "", &Rig::ALL, &mut all.rig) {
        all.lamp = None;
    }
    super::lamp::show(ui, &mut all);
    environment_choice(ui, scope, &mut all.around);
    let mut brightness = f64::from(all.brightness);
    widgets::slider(ui, "Brightness", "", &mut brightness, 0.2..=3.0);
    all.brightness = brightness as f32;
    if all.look.shading == Shading::Heat {
        widgets::heading(ui, "Heat map");
        widgets::choose(ui, "Colours", "", &COLOR_MAPS, &mut all.look.color_map);
    }
    user_files(ui, scope, &mut all);
    if all != before {
        scope.command(Command::Look(all));
    }
}

/// Draws the choice of sharp edges, for files without normals.
fn creases(ui: &mut Ui, chosen: &mut Creases, auto: Creases) {
    let auto = match auto {
        Creases::Above(angle) => format!("Auto (above {angle}°)"),
        _ => "Auto (none)".to_owned(),
    };
    let angle = match chosen {
        Creases::Above(angle) => *angle,
        _ => CREASE_ANGLE_DEG,
    };
    let tip = "Edges drawn sharp, as the file has no normals: those whose faces differ by more than an angle. Auto: if \
        the original is made of surfaces that meet in sharp edges, like most CAD models. The same for the result";
    let choices =
        [(Creases::Auto, auto.as_str()), (Creases::Off, "None"), (Creases::Above(angle), "Above an angle")];
    widgets::choose(ui, "Sharp edges", tip, &choices, chosen);
    if let Creases::Above(angle) = chosen {
        widgets::field(ui, "Angle", "Edges between faces that differ by more are sharp", |ui| {
            ui.add(egui::DragValue::new(angle).range(0.0..=180.0).speed(0.5).suffix("°").max_decimals(1));
        });
    }
}

/// Draws the numbers of borders and defects on both sides, and the button that goes to the next one.
fn flaws(ui: &mut Ui, scope: &mut PanelContext<'_>, [borders, defects]: [bool; 2]) {
    let sides = scope.document.flaws();
    widgets::table_row(ui, "", &["original".into(), "result".into()], true);
    for (k, name) in COUNT_NAMES.iter().enumerate() {
        if if k == 0 { borders } else { defects } {
            let count = |which: usize| sides[which].map_or("–".to_owned(), |f| grouped(f.counts[k]));
            widgets::table_row(ui, name, &[count(0), count(1)], false);
        }
    }
    let side = if scope.document.lighter().is_some() { sides[1] } else { sides[0] };
    let places = side.map_or(0, |f| f.shown_places(borders, defects).count());
    ui.horizontal(|ui| {
        scope.button(ui, Action::NextFlaw, "Next", "Go to the next one, largest first", places > 0);
        let text = match scope.facts.flaw.filter(|n| *n < places) {
            Some(n) => format!("{} of {} places", grouped(n + 1), grouped(places)),
            None => format!("{} places", grouped(places)),
        };
        ui.label(crate::theme::weak(ui, text));
    });
}

/// Draws the choice of the environment.
fn environment_choice(ui: &mut Ui, scope: &mut PanelContext<'_>, around: &mut EnvironmentChoice) {
    let tip = "Image that lights materials in addition to the lights and is reflected by them: equirectangular (HDR, \
        PNG, JPEG), twice as wide as high, reloaded when it changes";
    let tip =
        &format!("{tip}. Auto: a studio if the model has metal ({} cycles)", Action::NextEnvironment.key());
    let names = [(0, "Auto"), (1, "Plain"), (2, "Studio"), (3, "Image file")];
    let before = match around {
        EnvironmentChoice::Auto => 0,
        EnvironmentChoice::Plain => 1,
        EnvironmentChoice::Studio => 2,
        EnvironmentChoice::File(_) => 3,
    };
    let mut chosen = before;
    widgets::choose(ui, "Environment", tip, &names, &mut chosen);
    match chosen {
        _ if chosen == before => {}
        0 => *around = EnvironmentChoice::Auto,
        1 => *around = EnvironmentChoice::Plain,
        2 => *around = EnvironmentChoice::Studio,
        _ => scope.requests.push(UiRequest::ChooseEnvironment),
    }
    if let Some(path) = around.file() {
        widgets::field(ui, "", tip, |ui| {
            if ui.add(egui::Button::new(files::name(path)).truncate()).clicked() {
                scope.requests.push(UiRequest::ChooseEnvironment);
            }
        });
    }
}

/// Draws the choice of the user's own files: matcap and shader.
fn user_files(ui: &mut Ui, scope: &mut PanelContext<'_>, all: &mut Appearance) {
    widgets::heading(ui, "Custom");
    let tip = "Image of a lit sphere (PNG, JPEG); reloaded when it changes";
    widgets::field(ui, "Matcap", tip, |ui| file(ui, &mut all.matcap, UiRequest::ChooseMatcap, scope));
    let tip = "WGSL file with `fn surface(at: Surface) -> vec4<f32>` that returns a linear colour; reloaded when \
        it changes";
    if scope.facts.is_on_page {
        return;
    }
    widgets::field(ui, "Shader", tip, |ui| file(ui, &mut all.shader, UiRequest::ChooseShader, scope));
    if let Some(error) = &scope.facts.shader_error {
        widgets::log_line(ui, crate::document::log::Severity::Error, error);
    }
}

fn file(ui: &mut Ui, path: &mut Option<std::path::PathBuf>, choose: UiRequest, scope: &mut PanelContext<'_>) {
    let text = path.as_deref().map_or("Built-in".to_owned(), files::name);
    if ui.button(text).clicked() {
        scope.requests.push(choose);
    }
    if path.is_some() && ui.button("×").on_hover_text("Use the built-in one").clicked() {
        *path = None;
    }
}
