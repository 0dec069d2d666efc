//! Keyframes of the stage: panel, keys, playback and mouse.

use eframe::egui::{self, Key, Modifiers, Pos2, Rect};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::panel::keys::{Action, CopiesAction};
use lodsmith_viewer::settings::playback::Playback;
use lodsmith_viewer::stage::file::LayoutFile;
use lodsmith_viewer::stage::motion::{Curve, Motion, Mover};
use lodsmith_viewer::stage::{Placement, StageChange};

use super::desk::AppHarness;
use super::stage::{PICTURE, row, run, staged};

fn motion(desk: &AppHarness) -> Motion {
    desk.app().document().settings().stage.motion.clone()
}

fn copies(action: CopiesAction) -> Action {
    Action::Copies(action)
}

fn go_to(desk: &mut AppHarness, seconds: f64) {
    let playback = Playback { seconds, ..desk.app().document().settings().playback };
    desk.harness.state_mut().document_mut().run(Command::Playback(playback));
    desk.harness.state_mut().document_mut().seal();
    desk.settle();
}

fn moments(desk: &AppHarness, mover: Mover) -> Vec<f64> {
    motion(desk).moments(mover)
}

fn lane(desk: &AppHarness, name: &str) -> Rect {
    desk.harness.get_by_label(&format!("Keyframes of {name}")).rect()
}

/// Position of a time in a lane of ten seconds.
fn at(lane: Rect, secs: f32) -> Pos2 {
    egui::pos2(lane.left() + 8.0 + (lane.width() - 16.0) * secs / 10.0, lane.center().y)
}

/// Four copies that rotate and then shrink, while the camera orbits them.
fn moving(is_light: bool) -> Option<AppHarness> {
    let mut desk = staged(is_light, row(4))?;
    desk.act(Action::Panel(Panel::Timeline));
    desk.act(copies(CopiesAction::CameraKeyframe));
    desk.act(copies(CopiesAction::All));
    desk.act(copies(CopiesAction::Keyframe));
    go_to(&mut desk, 4.0);
    desk.act(copies(CopiesAction::Turn(1)));
    go_to(&mut desk, 8.0);
    desk.act(copies(CopiesAction::Scale(-1)));
    desk.press(Key::ArrowRight);
    desk.press(Key::ArrowRight);
    desk.act(copies(CopiesAction::CameraKeyframe));
    Some(desk)
}

#[test]
fn keys_set_keyframes_and_the_moment_moves_what_has_them() {
    for is_light in [false, true] {
        let theme = if is_light { "light" } else { "dark" };
        let Some(mut desk) = staged(is_light, row(4)) else { return };
        desk.act(copies(CopiesAction::Keyframe));
        assert!(motion(&desk).is_empty(), "no copy is chosen");
        desk.act(Action::Panel(Panel::Timeline));
        desk.picture(&format!("keyframes_none_{theme}"));
        desk.act(copies(CopiesAction::CameraKeyframe));
        assert_eq!(moments(&desk, Mover::Camera), [0.0]);
        desk.act(copies(CopiesAction::All));
        desk.act(copies(CopiesAction::Keyframe));
        let begin = desk.app().document().current_placements();
        go_to(&mut desk, 4.0);
        // A change of a copy with keyframes sets a keyframe; its other keyframes stay.
        desk.act(copies(CopiesAction::Turn(1)));
        assert_eq!(moments(&desk, Mover::Copy(2)), [0.0, 4.0]);
        assert!(desk.app().document().current_placements().iter().all(|c| c.turn_deg == 15.0));
        let eye = |desk: &AppHarness| desk.app().stage_view().orbit().camera().eye;
        desk.press(Key::ArrowRight);
        desk.press(Key::ArrowRight);
        let there = eye(&desk);
        desk.act(copies(CopiesAction::CameraKeyframe));
        assert!(eye(&desk).distance(there) < 1e-9, "a keyframe moves nothing by itself");
        go_to(&mut desk, 2.0);
        assert!(eye(&desk).distance(there) > 0.1, "the camera is on its way");
        assert!(desk.app().document().current_placements().iter().all(|c| (c.turn_deg - 7.5).abs() < 1e-6));
        desk.picture(&format!("keyframes_{theme}"));
        go_to(&mut desk, 0.0);
        assert_eq!(desk.app().document().current_placements(), begin);
        // Undo until there are no keyframes, and redo.
        let all = motion(&desk);
        for _ in 0..20 {
            desk.press_with(Modifiers::COMMAND, Key::Z);
        }
        assert!(motion(&desk).is_empty());
        for _ in 0..20 {
            desk.press_with(Modifiers::COMMAND, Key::Y);
        }
        assert_eq!(motion(&desk), all);
    }
}

#[test]
fn playing_moves_copies_and_camera_and_a_pause_is_a_pause() {
    let Some(mut desk) = moving(false) else { return };
    go_to(&mut desk, 0.0);
    let before = desk.pixels(PICTURE);
    let sights = |desk: &AppHarness| desk.app().stage_view().status().chosen.visible;
    let (seen, eye) = (sights(&desk), desk.app().stage_view().orbit().camera().eye);
    desk.harness.key_press(Key::P);
    desk.harness.run_steps(60);
    assert!(desk.app().document().is_playing());
    desk.press(Key::P);
    let secs = desk.app().document().moment();
    assert!((secs - 3.0).abs() < 0.3, "{secs}");
    assert!(desk.pixels(PICTURE) != before);
    assert!(sights(&desk) != seen, "levels go by the distance of the moment");
    assert!(desk.app().stage_view().orbit().camera().eye.distance(eye) > 0.1);
    // A window that requests a repaint every frame never settles.
    assert!(desk.harness.try_run().is_ok());
    assert_eq!(desk.app().document().moment(), secs);
    desk.picture("keyframes_paused");
    // The camera can be freed from its keyframes.
    desk.act(copies(CopiesAction::FreeCamera));
    let free = desk.app().stage_view().orbit();
    go_to(&mut desk, 7.0);
    assert_eq!(desk.app().stage_view().orbit(), free);
    desk.click("Camera view");
    assert_ne!(desk.app().stage_view().orbit(), free);
    // Stepping from keyframe to keyframe.
    for (by, wanted) in [(-1, 4.0), (-1, 0.0), (-1, 0.0), (1, 4.0), (1, 8.0), (1, 8.0)] {
        desk.act(copies(CopiesAction::ToKeyframe(by)));
        assert_eq!(desk.app().document().moment(), wanted);
    }
}

#[test]
fn keyframes_are_dragged_copied_and_taken_away() {
    let Some(mut desk) = moving(true) else { return };
    assert_eq!(moments(&desk, Mover::Copy(1)), [0.0, 4.0, 8.0]);
    let second = lane(&desk, "copy 2");
    // A click selects a keyframe and goes to its time.
    desk.point(at(second, 4.0));
    let chosen = |desk: &AppHarness| desk.app().stage_view().status().keyframes.chosen;
    assert_eq!(chosen(&desk), [(Mover::Copy(1), 4.0)]);
    assert_eq!(desk.app().document().moment(), 4.0);
    desk.drag(at(second, 4.0), at(second, 5.0));
    let dragged = moments(&desk, Mover::Copy(1));
    assert!(dragged.len() == 3 && (dragged[1] - 5.0).abs() < 0.03, "{dragged:?}");
    assert_eq!(chosen(&desk), [(Mover::Copy(1), dragged[1])]);
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(moments(&desk, Mover::Copy(1)), [0.0, 4.0, 8.0], "a drag is one step");
    // Shift selects keyframes of two lanes.
    let first = lane(&desk, "copy 1");
    desk.point(at(first, 4.0));
    desk.harness.event(egui::Event::ModifiersChanged(Modifiers::SHIFT));
    desk.point(at(second, 4.0));
    desk.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    desk.harness.run_steps(2);
    assert_eq!(chosen(&desk).len(), 2, "{:?}", chosen(&desk));
    desk.drag(at(second, 4.0), at(second, 2.0));
    assert!([0, 1].iter().all(|n| (moments(&desk, Mover::Copy(*n))[1] - 2.0).abs() < 0.03));
    desk.picture("keyframes_dragged");
    // Duplicate at another time, then delete.
    go_to(&mut desk, 6.0);
    desk.click("Copy here");
    assert_eq!(moments(&desk, Mover::Copy(0)).len(), 4);
    assert_eq!(chosen(&desk), [(Mover::Copy(0), 6.0), (Mover::Copy(1), 6.0)]);
    desk.press(Key::Delete);
    assert_eq!(
        (moments(&desk, Mover::Copy(0)).len(), desk.app().document().current_placements().len()),
        (3, 4)
    );
    // Stepped instead of smooth interpolation.
    desk.point(at(second, 8.0));
    desk.click("Steps");
    assert_eq!(motion(&desk).curve(Mover::Copy(1)), Curve::Step);
    desk.act(copies(CopiesAction::Curve));
    assert_eq!(motion(&desk).curve(Mover::Copy(1)), Curve::Smooth);
    desk.click("Delete key");
    assert_eq!(moments(&desk, Mover::Copy(1)).len(), 2);
    // Without selected keyframes, the key deletes the selected copies.
    desk.point(at(second, 9.5));
    assert!(chosen(&desk).is_empty());
    desk.press(Key::Delete);
    assert!(desk.app().document().current_placements().is_empty() && motion(&desk).copies.is_empty());
}

#[test]
fn alt_drags_a_copy_of_a_keyframe_and_a_length_can_be_typed() {
    let Some(mut desk) = moving(false) else { return };
    let camera = lane(&desk, "camera");
    desk.harness.event(egui::Event::ModifiersChanged(Modifiers::ALT));
    desk.drag(at(camera, 8.0), at(camera, 3.0));
    desk.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    desk.harness.run_steps(2);
    let all = moments(&desk, Mover::Camera);
    assert!(all.len() == 3 && (all[1] - 3.0).abs() < 0.03 && all[2] == 8.0, "{all:?}");
    desk.write("Stage duration", "25");
    desk.press(Key::Enter);
    assert_eq!(desk.app().document().timeline_secs(), 25.0);
}

#[test]
fn moving_what_plays_stops_it_and_sets_a_keyframe() {
    let Some(mut desk) = staged(false, vec![Placement::at(0.0, 0.0)]) else { return };
    desk.act(copies(CopiesAction::All));
    desk.act(copies(CopiesAction::Keyframe));
    desk.harness.key_press(Key::P);
    desk.harness.run_steps(20);
    assert!(desk.app().document().is_playing());
    let middle = desk.harness.get_by_label(PICTURE).rect().center();
    let from = middle - egui::vec2(0.0, 20.0);
    desk.drag(from, from + egui::vec2(120.0, 30.0));
    assert!(!desk.app().document().is_playing());
    let all = moments(&desk, Mover::Copy(0));
    assert!(all.len() == 2 && all[1] > 0.5, "{all:?}");
    let (one, two) =
        (motion(&desk).copies[&0].at(0.0).unwrap(), desk.app().document().current_placements()[0]);
    assert!(two.x > one.x + 0.2, "{one:?} {two:?}");
}

#[test]
fn a_layout_has_its_keyframes() {
    let Some(mut desk) = moving(false) else { return };
    let before = motion(&desk);
    desk.click("Save…");
    desk.press(Key::Enter);
    let layout = desk.path("sphere_stage.json");
    assert_eq!(LayoutFile::open(&layout).unwrap().1, before);
    run(&mut desk, StageChange::Motion(Motion::default()));
    desk.harness.state_mut().document_mut().run(Command::Stage(StageChange::Show(false)));
    desk.press_with(Modifiers::COMMAND, Key::O);
    desk.write("Path", layout.display());
    desk.press(Key::Enter);
    assert_eq!(motion(&desk), before);
}
