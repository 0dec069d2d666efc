//! Animations: panel, keys, and playback on both sides.

use std::path::Path;

use eframe::egui::{self, Key, Modifiers, Role};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::settings::playback::Playback;

use super::desk::AppHarness;
use super::{ORIGINAL, RESULT};

const ARM: &str = "../../testdata/arm.glb";

fn playback(desk: &AppHarness) -> Playback {
    desk.app().document().settings().playback
}

/// Opens the arm and reduces it to about a quarter of its faces.
fn arm(is_light: bool) -> Option<AppHarness> {
    let mut desk = AppHarness::with(is_light, Some(Path::new(ARM)))?;
    for _ in 0..13 {
        desk.press(Key::Minus);
    }
    assert!(desk.faces().unwrap() < 1264 / 3);
    Some(desk)
}

#[test]
fn the_timeline_comes_with_a_file_that_moves_and_goes_with_it() {
    let Some(mut desk) = AppHarness::with(false, Some(Path::new(ARM))) else { return };
    assert!(desk.app().is_shown(Panel::Timeline));
    assert!(!desk.app().document().is_playing());
    let torus = desk.path("torus.obj");
    desk.harness.state_mut().document_mut().run(Command::Open(vec![torus]));
    desk.settle();
    assert!(!desk.app().is_shown(Panel::Timeline));
    desk.press(Key::F9);
    desk.harness.get_by_label_contains("No animations in this file");
    desk.picture("timeline_nothing");
    // A panel that the user opened stays open.
    desk.press(Key::P);
    assert!(!desk.app().document().is_playing());
    let files = vec![ARM.into(), desk.path("sphere.ply")];
    desk.harness.state_mut().document_mut().run(Command::Open(files));
    desk.settle();
    desk.harness.state_mut().document_mut().run(Command::Show(1));
    desk.settle();
    assert!(desk.app().is_shown(Panel::Timeline));
}

#[test]
fn playing_moves_both_sides_and_a_pause_is_a_pause() {
    for is_light in [false, true] {
        let Some(mut desk) = arm(is_light) else { return };
        let theme = if is_light { "light" } else { "dark" };
        let before = [ORIGINAL, RESULT].map(|side| desk.pixels(side));
        desk.picture(&format!("timeline_{theme}_begin"));
        desk.harness.key_press(Key::P);
        // A frame of the harness is a twentieth of a second.
        desk.harness.run_steps(13);
        assert!(desk.app().document().is_playing());
        let seconds = playback(&desk).seconds;
        assert!((seconds - 0.6).abs() < 0.101, "{seconds}");
        desk.press(Key::P);
        assert!(!desk.app().document().is_playing());
        let after = [ORIGINAL, RESULT].map(|side| desk.pixels(side));
        assert!(before[0] != after[0] && before[1] != after[1], "both sides move");
        desk.picture(&format!("timeline_{theme}_bent"));
        // A window that requests a repaint every frame never settles.
        assert!(desk.harness.try_run().is_ok());
        let stopped = playback(&desk);
        desk.harness.run_steps(5);
        assert_eq!(playback(&desk), stopped);
    }
}

#[test]
fn once_stops_at_the_end_and_again_goes_round() {
    let Some(mut desk) = arm(false) else { return };
    desk.press(Key::J);
    desk.press_with(Modifiers::SHIFT, Key::P);
    desk.press_with(Modifiers::SHIFT, Key::PageDown);
    assert_eq!(playback(&desk), Playback { clip: Some(1), seconds: 0.0, speed: 2.0, repeats: false });
    desk.harness.key_press(Key::P);
    desk.harness.run_steps(30);
    assert!(!desk.app().document().is_playing(), "one second at twice the speed is over");
    assert_eq!(playback(&desk).seconds, 1.0);
    // At the end, playing starts over.
    desk.harness.key_press(Key::P);
    desk.harness.run_steps(4);
    assert!(desk.app().document().is_playing() && playback(&desk).seconds < 0.6);
    desk.press(Key::P);
    desk.press_with(Modifiers::SHIFT, Key::P);
    desk.press(Key::P);
    desk.harness.run_steps(30);
    assert!(desk.app().document().is_playing());
    desk.press(Key::Home);
    desk.press(Key::P);
    assert!(playback(&desk).seconds < 0.9);
}

#[test]
fn a_moment_is_dragged_typed_and_stepped_to_and_taken_back() {
    let Some(mut desk) = arm(false) else { return };
    let ruler = desk.harness.get_by_role_and_label(Role::Slider, "Timeline ruler").rect();
    let at = |share: f32| egui::pos2(ruler.left() + 8.0 + (ruler.width() - 16.0) * share, ruler.center().y);
    desk.press(Key::P);
    desk.drag(at(0.1), at(0.5));
    assert!(!desk.app().document().is_playing(), "who drags wants to look");
    assert!((playback(&desk).seconds - 1.0).abs() < 0.02, "{:?}", playback(&desk));
    desk.picture("timeline_dragged");
    desk.press(Key::PageDown);
    assert!((playback(&desk).seconds - 1.0 - 1.0 / 24.0).abs() < 0.02);
    desk.press(Key::PageUp);
    let dragged = playback(&desk).seconds;
    desk.write("Time", "0.25 s");
    desk.press(Key::Enter);
    assert_eq!(playback(&desk).seconds, 0.25);
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert!((playback(&desk).seconds - dragged).abs() < 1e-9, "{:?}", playback(&desk));
    desk.press_with(Modifiers::COMMAND, Key::Y);
    assert_eq!(playback(&desk).seconds, 0.25);
    // The buttons do the same as the keys.
    desk.click("Go to start");
    assert_eq!(playback(&desk).seconds, 0.0);
    desk.click("Loop");
    assert!(!playback(&desk).repeats);
    desk.click("Play");
    assert!(desk.app().document().is_playing());
    desk.click("Pause");
    assert!(!desk.app().document().is_playing());
}

#[test]
fn a_double_click_finds_the_place_where_it_has_moved() {
    let Some(mut desk) = AppHarness::with(false, Some(Path::new(ARM))) else { return };
    desk.harness
        .state_mut()
        .document_mut()
        .run(Command::Playback(Playback { seconds: 1.0, ..Default::default() }));
    desk.press(Key::Num1);
    let place = desk.harness.get_by_label(ORIGINAL).rect();
    // The arm is bent by a right angle: its end is to the left, where nothing is in the rest pose.
    let before = desk.app().orbits()[0].target;
    let mut found = None;
    for share in [0.12, 0.16, 0.2, 0.24, 0.28, 0.32] {
        for down in [-0.2, -0.1, 0.0, 0.1] {
            if found.is_some() {
                continue;
            }
            let at =
                egui::pos2(place.left() + place.width() * share, place.center().y + place.height() * down);
            for _ in 0..2 {
                desk.harness.drag_at(at);
                desk.harness.drop_at(at);
            }
            desk.harness.run_steps(10);
            let after = desk.app().orbits()[0].target;
            found = (after != before).then_some(after);
        }
    }
    let found = found.expect("something stands there");
    assert!(found.x < -0.3, "left of the arm at rest: {found}");
}
