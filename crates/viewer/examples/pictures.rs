//! Takes the screenshots of the documents, without a window: `cargo xtask pictures viewer` calls this.
//!
//! `cargo run -p lodsmith-viewer --example pictures -- FOLDER` writes `NAME.png` for each page, and the frames
//! `slider_00.png` … of the moving slider. Without a graphics adapter it prints SKIPPED and writes nothing.

#[path = "../tests/adapter.rs"]
mod adapter;
#[path = "../tests/screens/harness.rs"]
mod harness;

use std::path::{Path, PathBuf};

use eframe::egui::{self, Key, Modifiers};
use egui_kittest::kittest::Queryable;
use harness::AppHarness;
use lodsmith::Stop;
use lodsmith_bake::MapKind;
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::panel::keys::{Action, CopiesAction};
use lodsmith_viewer::settings::bake::BakeSettings;
use lodsmith_viewer::settings::{HeatOf, Layout, Sides};

/// Face counts at the ends of the slider in the animation.
const SLIDER_FACES: [f64; 2] = [16_192.0, 90.0];
/// Number of frames from one end to the other.
const SLIDER_FRAMES: usize = 20;
/// Size of the window in the animation, in pixels.
const SLIDER_SIZE: [f32; 2] = [980.0, 580.0];

fn main() {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        panic!("name the folder for the pictures");
    };
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/finial.ply");
    let Some(mut window) = opened(&sample) else { return };
    let save = |window: &mut AppHarness, name: &str| {
        window.smooth();
        let picture = window.harness.render().expect("the adapter draws");
        picture.save(folder.join(format!("{name}.png"))).expect("the folder can be written");
    };
    // The command line there has the path of the copy.
    hide(&mut window, Panel::Report);
    window.press(Key::W);
    target(&mut window, 1300);
    heat(&mut window, HeatOf::Distance, true);
    save(&mut window, "viewer");

    // The right quarter of the histogram, and a click on the result.
    hide(&mut window, Panel::Method);
    if !window.app().is_shown(Panel::Error) {
        window.press(Key::F7);
    }
    window.press(Key::W);
    let rect = window.harness.get_by_label("Histogram of distances").rect();
    let at = |share: f32| egui::pos2(rect.left() + rect.width() * share, rect.center().y);
    window.drag(at(0.18), at(0.99));
    let result = window.harness.get_by_label("Picture of the result").rect();
    window.point(result.center() + egui::vec2(0.0, 40.0));
    save(&mut window, "viewer-error");

    heat(&mut window, HeatOf::Normals, true);
    save(&mut window, "viewer-normals");

    heat(&mut window, HeatOf::Distance, false);
    sides(&mut window, Sides::Difference);
    // The camera has come to rest, and the picture has its full size.
    std::thread::sleep(std::time::Duration::from_millis(300));
    window.settle();
    window.settle();
    save(&mut window, "viewer-difference");

    sides(&mut window, Sides::Both);
    bake(&mut window);
    save(&mut window, "viewer-bake");
    window.harness.state_mut().document_mut().remove_maps();
    heat(&mut window, HeatOf::Distance, false);
    hide(&mut window, Panel::Bake);

    let Some(mut copies) = opened(&sample) else { return };
    copies.press(Key::Y);
    copies.act(Action::Copies(CopiesAction::Scatter));
    copies.act(Action::Copies(CopiesAction::Colors));
    copies.press(Key::I);
    save(&mut copies, "stage");

    slider(&mut window, &folder);
}

/// Bakes a normal map and an occlusion map for a twentieth of the faces.
fn bake(window: &mut AppHarness) {
    target(window, 800);
    hide(window, Panel::Error);
    window.act(Action::Panel(Panel::Bake));
    let document = window.harness.state_mut().document_mut();
    let maps = vec![MapKind::Normal, MapKind::Occlusion];
    document.run(Command::Bake(BakeSettings { maps, size: Some(1024), ..BakeSettings::default() }));
    let mut look = document.settings().look.clone();
    look.look.shading = lodsmith_render::Shading::Textured;
    document.run(Command::Look(look));
    document.bake();
    window.settle();
    assert!(window.app().document().baked().is_some());
}

/// Opens a copy of a file in the folder of the harness.
fn opened(file: &Path) -> Option<AppHarness> {
    let mut window = AppHarness::with(false, None::<&Path>)?;
    let copy = window.path("finial.ply");
    std::fs::copy(file, &copy).expect("the sample can be copied");
    window.harness.state_mut().document_mut().run(Command::Open(vec![copy]));
    window.settle();
    Some(window)
}

/// Saves the frames of the slider from one end to the other, without panels.
fn slider(window: &mut AppHarness, folder: &Path) {
    window.harness.set_size(SLIDER_SIZE.into());
    window.press(Key::W);
    if window.app().is_shown(Panel::Look) {
        window.press(Key::Tab);
    }
    window.press_with(Modifiers::NONE, Key::F);
    let [from, to] = SLIDER_FACES;
    for frame in 0..SLIDER_FRAMES {
        let share = frame as f64 / (SLIDER_FRAMES - 1) as f64;
        target(window, (from * (to / from).powf(share)).round() as usize);
        window.smooth();
        let picture = window.harness.render().expect("the adapter draws");
        picture.save(folder.join(format!("slider_{frame:02}.png"))).expect("the folder can be written");
    }
}

fn target(window: &mut AppHarness, faces: usize) {
    let document = window.harness.state_mut().document_mut();
    document.run(Command::Target(SimplifyTarget::Faces(faces)));
    document.seal();
    window.settle();
    assert!(window.app().document().settings().simplify.options.stop == Stop::faces(faces));
}

/// Shows the heat map of a quantity, or the plain surface.
fn heat(window: &mut AppHarness, quantity: HeatOf, is_on: bool) {
    let document = window.harness.state_mut().document_mut();
    let mut look = document.settings().look.clone();
    look.heat_of = quantity;
    look.look.heat_brush = None;
    look.look.shading = if is_on { lodsmith_render::Shading::Heat } else { lodsmith_render::Shading::Smooth };
    document.run(Command::Look(look));
    document.seal();
    window.settle();
}

fn sides(window: &mut AppHarness, sides: Sides) {
    let document = window.harness.state_mut().document_mut();
    let layout = Layout { sides, ..document.settings().layout };
    document.run(Command::Layout(layout));
    window.settle();
}

fn hide(window: &mut AppHarness, panel: Panel) {
    if window.app().is_shown(panel) {
        window.act(Action::Panel(panel));
    }
}
