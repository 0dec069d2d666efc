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

use super::desk::AppHarness;

pub(super) const PICTURE: &str = "Picture of the stage";

pub(super) fn row(count: usize) -> Vec<Placement> {
    (0..count).map(|k| Placement::at(3.0 * k as f64, 0.0)).collect()
}

/// Opens a window whose stage holds these copies.
pub(super) fn staged(is_light: bool, copies: Vec<Placement>) -> Option<AppHarness> {
    let mut desk = AppHarness::with(is_light, Some("sphere.ply"))?;
    run(&mut desk, StageChange::Replace(copies.into(), Motion::default()));
    desk.press(Key::Y);
    Some(desk)
}

pub(super) fn run(desk: &mut AppHarness, change: StageChange) {
    desk.harness.state_mut().document_mut().run(Command::Stage(change));
    desk.harness.state_mut().document_mut().seal();
    desk.settle();
}

fn copies(desk: &AppHarness) -> Vec<Placement> {
    desk.app().document().settings().stage.copies.to_vec()
}

fn selected(desk: &AppHarness) -> Vec<usize> {
    desk.app().stage_view().status().selected
}

fn middle(desk: &AppHarness) -> Pos2 {
    desk.harness.get_by_label(PICTURE).rect().center()
}

#[test]
fn without_a_file_the_stage_says_what_to_do() {
    let Some(mut desk) = AppHarness::with(false, None::<&str>) else { return };
    desk.press(Key::Y);
    assert!(desk.app().document().stage().is_none());
    desk.act(Action::Panel(Panel::Stage));
    desk.harness.get_by_label("Open a file to place copies of it");
    desk.picture("stage_no_file");
}

#[test]
fn clicks_place_choose_and_move_copies() {
    let Some(mut desk) = AppHarness::with(false, Some("sphere.ply")) else { return };
    desk.press(Key::Y);
    assert!(desk.app().is_shown(Panel::Stage) && desk.app().stage_view().status().is_placing);
    desk.picture("stage_empty_dark");
    let middle = middle(&desk);
    desk.point(middle);
    desk.point(middle + egui::vec2(230.0, 40.0));
    let placed = copies(&desk);
    assert_eq!(placed.len(), 2);
    assert_eq!(selected(&desk), [1]);
    assert!(placed[1].x > placed[0].x + 0.5, "{placed:?}");
    // A click beside all copies clears the selection, one on a copy selects it, and with Shift adds it.
    desk.act(Action::Copies(CopiesAction::Place));
    assert!(!desk.app().stage_view().status().is_placing);
    desk.point(middle + egui::vec2(-300.0, 200.0));
    assert!(selected(&desk).is_empty());
    let first = middle - egui::vec2(0.0, 30.0);
    desk.point(first);
    assert_eq!(selected(&desk), [0]);
    assert_eq!(copies(&desk).len(), 2, "no copy was placed");
    // A drag moves the selected copies, as one undo step.
    let orbit = desk.app().stage_view().orbit();
    desk.drag(first, first + egui::vec2(-120.0, 60.0));
    let moved = copies(&desk);
    assert_eq!(desk.app().stage_view().orbit(), orbit, "the camera stays");
    assert!(moved[0].z > placed[0].z + 0.5 && moved[1] == placed[1], "{placed:?} {moved:?}");
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(copies(&desk), placed);
    // A drag beside all copies orbits the camera.
    let aside = middle + egui::vec2(-300.0, 200.0);
    desk.drag(aside, aside + egui::vec2(80.0, 0.0));
    assert_ne!(desk.app().stage_view().orbit(), orbit);
    assert_eq!(copies(&desk), placed);
}

#[test]
fn keys_change_the_chosen_copies() {
    let Some(mut desk) = staged(true, row(3)) else { return };
    desk.act(Action::Copies(CopiesAction::All));
    assert_eq!(selected(&desk), [0, 1, 2]);
    desk.picture("stage_chosen_light");
    desk.act(Action::Copies(CopiesAction::Turn(1)));
    desk.act(Action::Copies(CopiesAction::Scale(1)));
    assert!(copies(&desk).iter().all(|c| (c.turn_deg, c.scale) == (15.0, 1.1)));
    desk.act(Action::Copies(CopiesAction::Scale(-1)));
    assert!(copies(&desk).iter().all(|c| (c.scale - 1.0).abs() < 1e-12));
    desk.act(Action::Copies(CopiesAction::Duplicate));
    assert_eq!((copies(&desk).len(), selected(&desk)), (6, vec![3, 4, 5]));
    desk.press(Key::Backspace);
    assert_eq!((copies(&desk).len(), selected(&desk)), (3, vec![]));
    desk.act(Action::Copies(CopiesAction::Delete));
    assert_eq!(copies(&desk).len(), 3, "nothing is chosen");
    desk.act(Action::Copies(CopiesAction::Scatter));
    let scattered = copies(&desk);
    assert_eq!(scattered.len(), Scatter::default().count);
    desk.act(Action::Copies(CopiesAction::Scatter));
    assert_ne!(copies(&desk), scattered);
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(copies(&desk), scattered);
    desk.act(Action::Copies(CopiesAction::Colors));
    assert!(desk.app().document().settings().stage.view.has_level_colors);
    desk.picture("stage_colors_light");
    desk.press(Key::Y);
    assert!(desk.app().document().stage().is_none());
    desk.harness.get_by_label("Picture of the result");
}

#[test]
fn the_panel_scatters_and_moves_and_shows_the_levels() {
    let Some(mut desk) = staged(false, row(2)) else { return };
    desk.click("Scatter");
    assert_eq!(copies(&desk).len(), 100);
    desk.write("Copies to scatter", "12");
    desk.press(Key::Enter);
    assert_eq!(copies(&desk).len(), 100, "until it is pressed");
    desk.click("Scatter");
    assert_eq!(copies(&desk).len(), 12);
    desk.click("All");
    assert_eq!(selected(&desk).len(), 12);
    let levels = desk.app().stage_view().status().levels;
    assert!(levels.len() >= 6 && levels.windows(2).all(|w| w[0].distance < w[1].distance), "{levels:?}");
    assert_eq!(
        levels.iter().map(|l| l.copies).sum::<usize>(),
        desk.app().stage_view().status().chosen.visible.len()
    );
    desk.picture("stage_panel_dark");
    desk.click("Delete");
    assert!(copies(&desk).is_empty());
}

#[test]
fn one_walks_by_keys_and_levels_switch_by_distance() {
    let copies = (0..30).map(|k| Placement::at(0.0, -4.0 * f64::from(k))).collect();
    let Some(mut desk) = staged(false, copies) else { return };
    run(&mut desk, StageChange::View(StageDisplay { has_level_colors: true, ..StageDisplay::default() }));
    desk.press(Key::Num1);
    desk.press(Key::I);
    assert!(desk.app().stage_view().status().is_walking);
    let eye = |desk: &AppHarness| desk.app().stage_view().orbit().camera().eye;
    // The sphere is 2 units high.
    assert!((eye(&desk).y - 1.2).abs() < 1e-9, "{}", eye(&desk));
    let (start, look) = (eye(&desk), desk.app().document().settings().look.clone());
    let counts = |desk: &AppHarness| {
        desk.app().stage_view().status().levels.iter().map(|l| l.copies).collect::<Vec<_>>()
    };
    let (before, picture) = (counts(&desk), desk.picture("stage_walk_start"));
    desk.harness.key_down(Key::W);
    desk.harness.run_steps(40);
    desk.harness.key_up(Key::W);
    desk.settle();
    assert!(eye(&desk).z < start.z - 3.0, "{} {start}", eye(&desk));
    assert_eq!(desk.app().document().settings().look, look, "W is no wireframe while one walks");
    assert_ne!(counts(&desk), before);
    assert_ne!(desk.picture("stage_walk_dark"), picture);
    let middle = middle(&desk);
    let yaw = desk.app().stage_view().orbit().yaw_rad;
    let stood = eye(&desk);
    desk.drag(middle, middle + egui::vec2(100.0, 0.0));
    assert!(eye(&desk).distance(stood) < 1e-9 && desk.app().stage_view().orbit().yaw_rad != yaw);
    desk.press(Key::Escape);
    assert!(!desk.app().stage_view().status().is_walking);
    desk.press(Key::W);
    assert!(desk.app().document().settings().look.look.wireframe);
}

#[test]
fn the_sample_stands_on_a_stage_in_the_colours_of_its_levels() {
    let sample: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/finial.ply"].iter().collect();
    let Some(mut desk) = AppHarness::with(false, Some(sample)) else { return };
    desk.press(Key::Y);
    desk.act(Action::Copies(CopiesAction::Scatter));
    desk.act(Action::Copies(CopiesAction::Colors));
    desk.press(Key::I);
    let facts = desk.app().stage_view().status();
    let used = facts.levels.iter().filter(|l| l.copies > 0).count();
    assert!(used >= 4, "{:?}", facts.levels);
    assert!(facts.chosen.triangles < 100 * facts.levels[0].faces / 10);
    // Screenshot for docs/viewer.md.
    let dark = desk.picture("stage");
    desk.press_with(Modifiers::COMMAND, Key::T);
    assert_ne!(desk.picture("stage_sample_light"), dark);
}

#[test]
fn a_layout_and_a_session_come_back() {
    let placed =
        vec![Placement { turn_deg: 30.0, scale: 1.5, ..Placement::at(-2.0, 1.0) }, Placement::at(2.0, 0.0)];
    let Some(mut desk) = staged(false, placed.clone()) else { return };
    desk.click("Save…");
    desk.press(Key::Enter);
    let layout = desk.folder.path().join("sphere_stage.json");
    assert_eq!(*LayoutFile::open(&layout).unwrap().0, placed);
    desk.act(Action::Copies(CopiesAction::All));
    desk.press(Key::Delete);
    assert!(copies(&desk).is_empty());
    desk.harness.state_mut().document_mut().run(Command::Stage(StageChange::Show(false)));
    // A layout opens like any other file.
    desk.press_with(Modifiers::COMMAND, Key::O);
    desk.write("Path", layout.display());
    desk.press(Key::Enter);
    assert_eq!(copies(&desk), placed);
    assert!(desk.app().document().stage().is_some());

    desk.press(Key::Num7);
    let orbit = desk.app().stage_view().orbit();
    desk.press_with(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    desk.press(Key::Enter);
    let session = desk.folder.path().join("sphere.lodsmith.json");
    let Some(again) = AppHarness::within(false, vec![session], desk.folder) else { return };
    assert_eq!(copies(&again), placed);
    assert!(again.app().document().stage().is_some());
    let back = again.app().stage_view().orbit();
    assert!((back.pitch_rad - orbit.pitch_rad).abs() < 1e-6 && (back.distance - orbit.distance).abs() < 1e-6);
}

#[test]
fn the_stage_is_written_from_its_panel() {
    let Some(mut desk) = staged(false, row(4)) else { return };
    desk.click("Export…");
    desk.press(Key::Enter);
    let written = desk.path("sphere_stage.glb");
    let read = lodsmith_io::read_path(&written, &Default::default()).unwrap();
    assert_eq!(read.mesh.face_count(), 4 * 20_480);
}

#[test]
fn nothing_is_drawn_while_nobody_moves() {
    let Some(mut desk) = staged(false, row(5)) else { return };
    desk.press(Key::I);
    assert!(desk.harness.try_run().is_ok());
}
