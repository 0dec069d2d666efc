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

use super::harness::AppHarness;
use super::stage::{PICTURE, row, run, staged};

fn motion(window: &AppHarness) -> Motion {
    window.app().document().settings().stage.motion.clone()
}

fn copies(action: CopiesAction) -> Action {
    Action::Copies(action)
}

fn go_to(window: &mut AppHarness, seconds: f64) {
    let playback = Playback { seconds, ..window.app().document().settings().playback };
    window.harness.state_mut().document_mut().run(Command::Playback(playback));
    window.harness.state_mut().document_mut().seal();
    window.settle();
}

fn moments(window: &AppHarness, mover: Mover) -> Vec<f64> {
    motion(window).moments(mover)
}

fn lane(window: &AppHarness, name: &str) -> Rect {
    window.harness.get_by_label(&format!("Keyframes of {name}")).rect()
}

/// Position of a time in a lane of ten seconds.
fn at(lane: Rect, secs: f32) -> Pos2 {
    egui::pos2(lane.left() + 8.0 + (lane.width() - 16.0) * secs / 10.0, lane.center().y)
}

/// Four copies that rotate and then shrink, while the camera orbits them.
fn moving(is_light: bool) -> Option<AppHarness> {
    let mut window = staged(is_light, row(4))?;
    window.act(Action::Panel(Panel::Timeline));
    window.act(copies(CopiesAction::CameraKeyframe));
    window.act(copies(CopiesAction::All));
    window.act(copies(CopiesAction::Keyframe));
    go_to(&mut window, 4.0);
    window.act(copies(CopiesAction::Turn(1)));
    go_to(&mut window, 8.0);
    window.act(copies(CopiesAction::Scale(-1)));
    window.press(Key::ArrowRight);
    window.press(Key::ArrowRight);
    window.act(copies(CopiesAction::CameraKeyframe));
    Some(window)
}

#[test]
fn keys_set_keyframes_and_the_time_moves_their_copies() {
    for is_light in [false, true] {
        let theme = if is_light { "light" } else { "dark" };
        let Some(mut window) = staged(is_light, row(4)) else { return };
        window.act(copies(CopiesAction::Keyframe));
        assert!(motion(&window).is_empty(), "no copy is chosen");
        window.act(Action::Panel(Panel::Timeline));
        window.picture(&format!("keyframes_none_{theme}"));
        window.act(copies(CopiesAction::CameraKeyframe));
        assert_eq!(moments(&window, Mover::Camera), [0.0]);
        window.act(copies(CopiesAction::All));
        window.act(copies(CopiesAction::Keyframe));
        let begin = window.app().document().current_placements();
        go_to(&mut window, 4.0);
        // A change of a copy with keyframes sets a keyframe; its other keyframes stay.
        window.act(copies(CopiesAction::Turn(1)));
        assert_eq!(moments(&window, Mover::Copy(2)), [0.0, 4.0]);
        assert!(window.app().document().current_placements().iter().all(|c| c.turn_deg == 15.0));
        let eye = |window: &AppHarness| window.app().stage_view().orbit().camera().eye;
        window.press(Key::ArrowRight);
        window.press(Key::ArrowRight);
        let there = eye(&window);
        window.act(copies(CopiesAction::CameraKeyframe));
        assert!(eye(&window).distance(there) < 1e-9, "a keyframe moves nothing by itself");
        go_to(&mut window, 2.0);
        assert!(eye(&window).distance(there) > 0.1, "the camera is on its way");
        assert!(window.app().document().current_placements().iter().all(|c| (c.turn_deg - 7.5).abs() < 1e-6));
        window.picture(&format!("keyframes_{theme}"));
        go_to(&mut window, 0.0);
        assert_eq!(window.app().document().current_placements(), begin);
        // Undo until there are no keyframes, and redo.
        let all = motion(&window);
        for _ in 0..20 {
            window.press_with(Modifiers::COMMAND, Key::Z);
        }
        assert!(motion(&window).is_empty());
        for _ in 0..20 {
            window.press_with(Modifiers::COMMAND, Key::Y);
        }
        assert_eq!(motion(&window), all);
    }
}

#[test]
fn playing_moves_copies_and_camera_and_a_pause_is_a_pause() {
    let Some(mut window) = moving(false) else { return };
    go_to(&mut window, 0.0);
    let before = window.pixels(PICTURE);
    let sights = |window: &AppHarness| window.app().stage_view().status().chosen.visible;
    let (seen, eye) = (sights(&window), window.app().stage_view().orbit().camera().eye);
    window.harness.key_press(Key::P);
    window.harness.run_steps(60);
    assert!(window.app().document().is_playing());
    window.press(Key::P);
    let secs = window.app().document().moment();
    assert!((secs - 3.0).abs() < 0.3, "{secs}");
    assert!(window.pixels(PICTURE) != before);
    assert!(sights(&window) != seen, "levels go by the distance of the moment");
    assert!(window.app().stage_view().orbit().camera().eye.distance(eye) > 0.1);
    // A window that requests a repaint every frame never settles.
    assert!(window.harness.try_run().is_ok());
    assert_eq!(window.app().document().moment(), secs);
    window.picture("keyframes_paused");
    // The camera can be freed from its keyframes.
    window.act(copies(CopiesAction::FreeCamera));
    let free = window.app().stage_view().orbit();
    go_to(&mut window, 7.0);
    assert_eq!(window.app().stage_view().orbit(), free);
    window.click("Camera view");
    assert_ne!(window.app().stage_view().orbit(), free);
    // Stepping from keyframe to keyframe.
    for (by, wanted) in [(-1, 4.0), (-1, 0.0), (-1, 0.0), (1, 4.0), (1, 8.0), (1, 8.0)] {
        window.act(copies(CopiesAction::ToKeyframe(by)));
        assert_eq!(window.app().document().moment(), wanted);
    }
}

#[test]
fn keyframes_are_dragged_copied_and_deleted() {
    let Some(mut window) = moving(true) else { return };
    assert_eq!(moments(&window, Mover::Copy(1)), [0.0, 4.0, 8.0]);
    let second = lane(&window, "copy 2");
    // A click selects a keyframe and goes to its time.
    window.point(at(second, 4.0));
    let chosen = |window: &AppHarness| window.app().stage_view().status().keyframes.chosen;
    assert_eq!(chosen(&window), [(Mover::Copy(1), 4.0)]);
    assert_eq!(window.app().document().moment(), 4.0);
    window.drag(at(second, 4.0), at(second, 5.0));
    let dragged = moments(&window, Mover::Copy(1));
    assert!(dragged.len() == 3 && (dragged[1] - 5.0).abs() < 0.03, "{dragged:?}");
    assert_eq!(chosen(&window), [(Mover::Copy(1), dragged[1])]);
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(moments(&window, Mover::Copy(1)), [0.0, 4.0, 8.0], "a drag is one step");
    // Shift selects keyframes of two lanes.
    let first = lane(&window, "copy 1");
    window.point(at(first, 4.0));
    window.harness.event(egui::Event::ModifiersChanged(Modifiers::SHIFT));
    window.point(at(second, 4.0));
    window.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    window.harness.run_steps(2);
    assert_eq!(chosen(&window).len(), 2, "{:?}", chosen(&window));
    window.drag(at(second, 4.0), at(second, 2.0));
    assert!([0, 1].iter().all(|n| (moments(&window, Mover::Copy(*n))[1] - 2.0).abs() < 0.03));
    window.picture("keyframes_dragged");
    // Duplicate at another time, then delete.
    go_to(&mut window, 6.0);
    window.click("Copy here");
    assert_eq!(moments(&window, Mover::Copy(0)).len(), 4);
    assert_eq!(chosen(&window), [(Mover::Copy(0), 6.0), (Mover::Copy(1), 6.0)]);
    window.press(Key::Delete);
    assert_eq!(
        (moments(&window, Mover::Copy(0)).len(), window.app().document().current_placements().len()),
        (3, 4)
    );
    // Stepped instead of smooth interpolation.
    window.point(at(second, 8.0));
    window.click("Steps");
    assert_eq!(motion(&window).curve(Mover::Copy(1)), Curve::Step);
    window.act(copies(CopiesAction::Curve));
    assert_eq!(motion(&window).curve(Mover::Copy(1)), Curve::Smooth);
    window.click("Delete key");
    assert_eq!(moments(&window, Mover::Copy(1)).len(), 2);
    // Without selected keyframes, the key deletes the selected copies.
    window.point(at(second, 9.5));
    assert!(chosen(&window).is_empty());
    window.press(Key::Delete);
    assert!(window.app().document().current_placements().is_empty() && motion(&window).copies.is_empty());
}

#[test]
fn alt_drags_a_duplicate_of_a_keyframe_and_a_length_can_be_typed() {
    let Some(mut window) = moving(false) else { return };
    let camera = lane(&window, "camera");
    window.harness.event(egui::Event::ModifiersChanged(Modifiers::ALT));
    window.drag(at(camera, 8.0), at(camera, 3.0));
    window.harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    window.harness.run_steps(2);
    let all = moments(&window, Mover::Camera);
    assert!(all.len() == 3 && (all[1] - 3.0).abs() < 0.03 && all[2] == 8.0, "{all:?}");
    window.write("Stage duration", "25");
    window.press(Key::Enter);
    assert_eq!(window.app().document().timeline_secs(), 25.0);
}

#[test]
fn dragging_an_animated_copy_pauses_and_sets_a_keyframe() {
    let Some(mut window) = staged(false, vec![Placement::at(0.0, 0.0)]) else { return };
    window.act(copies(CopiesAction::All));
    window.act(copies(CopiesAction::Keyframe));
    window.harness.key_press(Key::P);
    window.harness.run_steps(20);
    assert!(window.app().document().is_playing());
    let middle = window.harness.get_by_label(PICTURE).rect().center();
    let from = middle - egui::vec2(0.0, 20.0);
    window.drag(from, from + egui::vec2(120.0, 30.0));
    assert!(!window.app().document().is_playing());
    let all = moments(&window, Mover::Copy(0));
    assert!(all.len() == 2 && all[1] > 0.5, "{all:?}");
    let (one, two) =
        (motion(&window).copies[&0].at(0.0).unwrap(), window.app().document().current_placements()[0]);
    assert!(two.x > one.x + 0.2, "{one:?} {two:?}");
}

#[test]
fn a_layout_has_its_keyframes() {
    let Some(mut window) = moving(false) else { return };
    let before = motion(&window);
    window.click("Save…");
    window.press(Key::Enter);
    let layout = window.path("sphere_stage.json");
    assert_eq!(LayoutFile::open(&layout).unwrap().1, before);
    run(&mut window, StageChange::Motion(Motion::default()));
    window.harness.state_mut().document_mut().run(Command::Stage(StageChange::Show(false)));
    window.press_with(Modifiers::COMMAND, Key::O);
    window.write("Path", layout.display());
    window.press(Key::Enter);
    assert_eq!(motion(&window), before);
}
