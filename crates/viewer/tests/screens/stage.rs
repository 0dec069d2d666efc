//! The stage in its window: mouse, keys and panel.

use std::path::PathBuf;

use eframe::egui::{self, Key, Modifiers, Pos2};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::panel::keys::{Action, CopiesAction};
use lodsmith_viewer::stage::file::LayoutFile;
use lodsmith_viewer::stage::motion::Motion;
use lodsmith_viewer::stage::scatter::Scatter;
use lodsmith_viewer::stage::{Placement, StageChange, StageDisplay};

use super::harness::AppHarness;

pub(super) const PICTURE: &str = "Picture of the stage";

pub(super) fn row(count: usize) -> Vec<Placement> {
    (0..count).map(|k| Placement::at(3.0 * k as f64, 0.0)).collect()
}

/// Opens a window whose stage holds these copies.
pub(super) fn staged(is_light: bool, copies: Vec<Placement>) -> Option<AppHarness> {
    let mut window = AppHarness::with(is_light, Some("sphere.ply"))?;
    run(&mut window, StageChange::Replace(copies.into(), Motion::default()));
    window.press(Key::Y);
    Some(window)
}

pub(super) fn run(window: &mut AppHarness, change: StageChange) {
    window.harness.state_mut().document_mut().run(Command::Stage(change));
    window.harness.state_mut().document_mut().seal();
    window.settle();
}

fn copies(window: &AppHarness) -> Vec<Placement> {
    window.app().document().settings().stage.copies.to_vec()
}

fn selected(window: &AppHarness) -> Vec<usize> {
    window.app().stage_view().status().selected
}

fn middle(window: &AppHarness) -> Pos2 {
    window.harness.get_by_label(PICTURE).rect().center()
}

#[test]
fn without_a_file_the_stage_says_what_to_do() {
    let Some(mut window) = AppHarness::with(false, None::<&str>) else { return };
    window.press(Key::Y);
    assert!(window.app().document().stage().is_none());
    window.act(Action::Panel(Panel::Stage));
    window.harness.get_by_label("Open a file to place copies of it");
    window.picture("stage_no_file");
}

#[test]
fn clicks_place_choose_and_move_copies() {
    let Some(mut window) = AppHarness::with(false, Some("sphere.ply")) else { return };
    window.press(Key::Y);
    assert!(window.app().is_shown(Panel::Stage) && window.app().stage_view().status().is_placing);
    window.picture("stage_empty_dark");
    let middle = middle(&window);
    window.point(middle);
    window.point(middle + egui::vec2(230.0, 40.0));
    let placed = copies(&window);
    assert_eq!(placed.len(), 2);
    assert_eq!(selected(&window), [1]);
    assert!(placed[1].x > placed[0].x + 0.5, "{placed:?}");
    // A click beside all copies clears the selection, one on a copy selects it, and with Shift adds it.
    window.act(Action::Copies(CopiesAction::Place));
    assert!(!window.app().stage_view().status().is_placing);
    window.point(middle + egui::vec2(-300.0, 200.0));
    assert!(selected(&window).is_empty());
    let first = middle - egui::vec2(0.0, 30.0);
    window.point(first);
    assert_eq!(selected(&window), [0]);
    assert_eq!(copies(&window).len(), 2, "no copy was placed");
    // A drag moves the selected copies, as one undo step.
    let orbit = window.app().stage_view().orbit();
    window.drag(first, first + egui::vec2(-120.0, 60.0));
    let moved = copies(&window);
    assert_eq!(window.app().stage_view().orbit(), orbit, "the camera stays");
    assert!(moved[0].z > placed[0].z + 0.5 && moved[1] == placed[1], "{placed:?} {moved:?}");
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(copies(&window), placed);
    // A drag beside all copies orbits the camera.
    let aside = middle + egui::vec2(-300.0, 200.0);
    window.drag(aside, aside + egui::vec2(80.0, 0.0));
    assert_ne!(window.app().stage_view().orbit(), orbit);
    assert_eq!(copies(&window), placed);
}

#[test]
fn keys_change_the_chosen_copies() {
    let Some(mut window) = staged(true, row(3)) else { return };
    window.act(Action::Copies(CopiesAction::All));
    assert_eq!(selected(&window), [0, 1, 2]);
    window.picture("stage_chosen_light");
    window.act(Action::Copies(CopiesAction::Turn(1)));
    window.act(Action::Copies(CopiesAction::Scale(1)));
    assert!(copies(&window).iter().all(|c| (c.turn_deg, c.scale) == (15.0, 1.1)));
    window.act(Action::Copies(CopiesAction::Scale(-1)));
    assert!(copies(&window).iter().all(|c| (c.scale - 1.0).abs() < 1e-12));
    window.act(Action::Copies(CopiesAction::Duplicate));
    assert_eq!((copies(&window).len(), selected(&window)), (6, vec![3, 4, 5]));
    window.press(Key::Backspace);
    assert_eq!((copies(&window).len(), selected(&window)), (3, vec![]));
    window.act(Action::Copies(CopiesAction::Delete));
    assert_eq!(copies(&window).len(), 3, "nothing is chosen");
    window.act(Action::Copies(CopiesAction::Scatter));
    let scattered = copies(&window);
    assert_eq!(scattered.len(), Scatter::default().count);
    window.act(Action::Copies(CopiesAction::Scatter));
    assert_ne!(copies(&window), scattered);
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(copies(&window), scattered);
    window.act(Action::Copies(CopiesAction::Colors));
    assert!(window.app().document().settings().stage.view.has_level_colors);
    window.picture("stage_colors_light");
    window.press(Key::Y);
    assert!(window.app().document().stage().is_none());
    window.harness.get_by_label("Picture of the result");
}

#[test]
fn the_panel_scatters_and_moves_and_shows_the_levels() {
    let Some(mut window) = staged(false, row(2)) else { return };
    window.click("Scatter");
    assert_eq!(copies(&window).len(), 100);
    window.write("Copies to scatter", "12");
    window.press(Key::Enter);
    assert_eq!(copies(&window).len(), 100, "until it is pressed");
    window.click("Scatter");
    assert_eq!(copies(&window).len(), 12);
    window.click("All");
    assert_eq!(selected(&window).len(), 12);
    let levels = window.app().stage_view().status().levels;
    assert!(levels.len() >= 6 && levels.windows(2).all(|w| w[0].distance < w[1].distance), "{levels:?}");
    assert_eq!(
        levels.iter().map(|l| l.copies).sum::<usize>(),
        window.app().stage_view().status().chosen.visible.len()
    );
    window.picture("stage_panel_dark");
    window.click("Delete");
    assert!(copies(&window).is_empty());
}

#[test]
fn walking_by_keys_switches_levels_by_distance() {
    let copies = (0..30).map(|k| Placement::at(0.0, -4.0 * f64::from(k))).collect();
    let Some(mut window) = staged(false, copies) else { return };
    run(&mut window, StageChange::View(StageDisplay { has_level_colors: true, ..StageDisplay::default() }));
    window.press(Key::Num1);
    window.press(Key::I);
    assert!(window.app().stage_view().status().is_walking);
    let eye = |window: &AppHarness| window.app().stage_view().orbit().camera().eye;
    // The sphere is 2 units high.
    assert!((eye(&window).y - 1.2).abs() < 1e-9, "{}", eye(&window));
    let (start, look) = (eye(&window), window.app().document().settings().look.clone());
    let counts = |window: &AppHarness| {
        window.app().stage_view().status().levels.iter().map(|l| l.copies).collect::<Vec<_>>()
    };
    let (before, picture) = (counts(&window), window.picture("stage_walk_start"));
    window.harness.key_down(Key::W);
    window.harness.run_steps(40);
    window.harness.key_up(Key::W);
    window.settle();
    assert!(eye(&window).z < start.z - 3.0, "{} {start}", eye(&window));
    assert_eq!(window.app().document().settings().look, look, "W is no wireframe while one walks");
    assert_ne!(counts(&window), before);
    assert_ne!(window.picture("stage_walk_dark"), picture);
    let middle = middle(&window);
    let yaw = window.app().stage_view().orbit().yaw_rad;
    let stood = eye(&window);
    window.drag(middle, middle + egui::vec2(100.0, 0.0));
    assert!(eye(&window).distance(stood) < 1e-9 && window.app().stage_view().orbit().yaw_rad != yaw);
    window.press(Key::Escape);
    assert!(!window.app().stage_view().status().is_walking);
    window.press(Key::W);
    assert!(window.app().document().settings().look.look.wireframe);
}

#[test]
fn the_stage_shows_the_sample_in_the_colours_of_its_levels() {
    let sample: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/finial.ply"].iter().collect();
    let Some(mut window) = AppHarness::with(false, Some(sample)) else { return };
    window.press(Key::Y);
    window.act(Action::Copies(CopiesAction::Scatter));
    window.act(Action::Copies(CopiesAction::Colors));
    window.press(Key::I);
    let facts = window.app().stage_view().status();
    let used = facts.levels.iter().filter(|l| l.copies > 0).count();
    assert!(used >= 4, "{:?}", facts.levels);
    assert!(facts.chosen.triangles < 100 * facts.levels[0].faces / 10);
    // Screenshot for docs/viewer.md.
    let dark = window.picture("stage");
    window.press_with(Modifiers::COMMAND, Key::T);
    assert_ne!(window.picture("stage_sample_light"), dark);
}

#[test]
fn a_layout_and_a_session_come_back() {
    let placed =
        vec![Placement { turn_deg: 30.0, scale: 1.5, ..Placement::at(-2.0, 1.0) }, Placement::at(2.0, 0.0)];
    let Some(mut window) = staged(false, placed.clone()) else { return };
    window.click("Save…");
    window.press(Key::Enter);
    let layout = window.folder.path().join("sphere_stage.json");
    assert_eq!(*LayoutFile::open(&layout).unwrap().0, placed);
    window.act(Action::Copies(CopiesAction::All));
    window.press(Key::Delete);
    assert!(copies(&window).is_empty());
    window.harness.state_mut().document_mut().run(Command::Stage(StageChange::Show(false)));
    // A layout opens like any other file.
    window.press_with(Modifiers::COMMAND, Key::O);
    window.write("Path", layout.display());
    window.press(Key::Enter);
    assert_eq!(copies(&window), placed);
    assert!(window.app().document().stage().is_some());

    window.press(Key::Num7);
    let orbit = window.app().stage_view().orbit();
    window.press_with(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    window.press(Key::Enter);
    let session = window.folder.path().join("sphere.lodsmith.json");
    let Some(again) = AppHarness::within(false, vec![session], window.folder) else { return };
    assert_eq!(copies(&again), placed);
    assert!(again.app().document().stage().is_some());
    let back = again.app().stage_view().orbit();
    assert!((back.pitch_rad - orbit.pitch_rad).abs() < 1e-6 && (back.distance - orbit.distance).abs() < 1e-6);
}

#[test]
fn the_stage_is_written_from_its_panel() {
    let Some(mut window) = staged(false, row(4)) else { return };
    window.click("Export…");
    window.press(Key::Enter);
    let written = window.path("sphere_stage.glb");
    let read = lodsmith_io::read_path(&written, &Default::default()).unwrap();
    assert_eq!(read.mesh.face_count(), 4 * 20_480);
}

#[test]
fn nothing_is_drawn_while_nothing_moves() {
    let Some(mut window) = staged(false, row(5)) else { return };
    window.press(Key::I);
    assert!(window.harness.try_run().is_ok());
}
