//! Animations: panel, keys, and playback on both sides.

use std::path::Path;

use eframe::egui::{self, Key, Modifiers, Role};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::settings::playback::Playback;

use super::harness::AppHarness;
use super::{ORIGINAL, RESULT};

const ARM: &str = "../../testdata/arm.glb";

fn playback(window: &AppHarness) -> Playback {
    window.app().document().settings().playback
}

/// Opens the arm and reduces it to about a quarter of its faces.
fn arm(is_light: bool) -> Option<AppHarness> {
    let mut window = AppHarness::with(is_light, Some(Path::new(ARM)))?;
    for _ in 0..13 {
        window.press(Key::Minus);
    }
    assert!(window.faces().unwrap() < 1264 / 3);
    Some(window)
}

#[test]
fn the_timeline_opens_and_closes_with_an_animated_file() {
    let Some(mut window) = AppHarness::with(false, Some(Path::new(ARM))) else { return };
    assert!(window.app().is_shown(Panel::Timeline));
    assert!(!window.app().document().is_playing());
    let torus = window.path("torus.obj");
    window.harness.state_mut().document_mut().run(Command::Open(vec![torus]));
    window.settle();
    assert!(!window.app().is_shown(Panel::Timeline));
    window.press(Key::F9);
    window.harness.get_by_label_contains("No animations in this file");
    window.picture("timeline_nothing");
    // A panel that the user opened stays open.
    window.press(Key::P);
    assert!(!window.app().document().is_playing());
    let files = vec![ARM.into(), window.path("sphere.ply")];
    window.harness.state_mut().document_mut().run(Command::Open(files));
    window.settle();
    window.harness.state_mut().document_mut().run(Command::Show(1));
    window.settle();
    assert!(window.app().is_shown(Panel::Timeline));
}

#[test]
fn playing_moves_both_sides_and_a_pause_is_a_pause() {
    for is_light in [false, true] {
        let Some(mut window) = arm(is_light) else { return };
        let theme = if is_light { "light" } else { "dark" };
        let before = [ORIGINAL, RESULT].map(|side| window.pixels(side));
        window.picture(&format!("timeline_{theme}_begin"));
        window.harness.key_press(Key::P);
        // A frame of the harness is a twentieth of a second.
        window.harness.run_steps(13);
        assert!(window.app().document().is_playing());
        let seconds = playback(&window).seconds;
        assert!((seconds - 0.6).abs() < 0.101, "{seconds}");
        window.press(Key::P);
        assert!(!window.app().document().is_playing());
        let after = [ORIGINAL, RESULT].map(|side| window.pixels(side));
        assert!(before[0] != after[0] && before[1] != after[1], "both sides move");
        window.picture(&format!("timeline_{theme}_bent"));
        // A window that requests a repaint every frame never settles.
        assert!(window.harness.try_run().is_ok());
        let stopped = playback(&window);
        window.harness.run_steps(5);
        assert_eq!(playback(&window), stopped);
    }
}

#[test]
fn playback_stops_at_the_end_or_loops() {
    let Some(mut window) = arm(false) else { return };
    window.press(Key::J);
    window.press_with(Modifiers::SHIFT, Key::P);
    window.press_with(Modifiers::SHIFT, Key::PageDown);
    assert_eq!(playback(&window), Playback { clip: Some(1), seconds: 0.0, speed: 2.0, repeats: false });
    window.harness.key_press(Key::P);
    window.harness.run_steps(30);
    assert!(!window.app().document().is_playing(), "one second at twice the speed is over");
    assert_eq!(playback(&window).seconds, 1.0);
    // At the end, playing starts over.
    window.harness.key_press(Key::P);
    window.harness.run_steps(4);
    assert!(window.app().document().is_playing() && playback(&window).seconds < 0.6);
    window.press(Key::P);
    window.press_with(Modifiers::SHIFT, Key::P);
    window.press(Key::P);
    window.harness.run_steps(30);
    assert!(window.app().document().is_playing());
    window.press(Key::Home);
    window.press(Key::P);
    assert!(playback(&window).seconds < 0.9);
}

#[test]
fn the_time_is_dragged_typed_and_stepped_to_and_undone() {
    let Some(mut window) = arm(false) else { return };
    let ruler = window.harness.get_by_role_and_label(Role::Slider, "Timeline ruler").rect();
    let at = |share: f32| egui::pos2(ruler.left() + 8.0 + (ruler.width() - 16.0) * share, ruler.center().y);
    window.press(Key::P);
    window.drag(at(0.1), at(0.5));
    assert!(!window.app().document().is_playing(), "who drags wants to look");
    assert!((playback(&window).seconds - 1.0).abs() < 0.02, "{:?}", playback(&window));
    window.picture("timeline_dragged");
    window.press(Key::PageDown);
    assert!((playback(&window).seconds - 1.0 - 1.0 / 24.0).abs() < 0.02);
    window.press(Key::PageUp);
    let dragged = playback(&window).seconds;
    window.write("Time", "0.25 s");
    window.press(Key::Enter);
    assert_eq!(playback(&window).seconds, 0.25);
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert!((playback(&window).seconds - dragged).abs() < 1e-9, "{:?}", playback(&window));
    window.press_with(Modifiers::COMMAND, Key::Y);
    assert_eq!(playback(&window).seconds, 0.25);
    // The buttons do the same as the keys.
    window.click("Go to start");
    assert_eq!(playback(&window).seconds, 0.0);
    window.click("Loop");
    assert!(!playback(&window).repeats);
    window.click("Play");
    assert!(window.app().document().is_playing());
    window.click("Pause");
    assert!(!window.app().document().is_playing());
}

#[test]
fn a_double_click_finds_the_place_where_it_has_moved() {
    let Some(mut window) = AppHarness::with(false, Some(Path::new(ARM))) else { return };
    window
        .harness
        .state_mut()
        .document_mut()
        .run(Command::Playback(Playback { seconds: 1.0, ..Default::default() }));
    window.press(Key::Num1);
    let place = window.harness.get_by_label(ORIGINAL).rect();
    // The arm is bent by a right angle: its end is to the left, where nothing is in the rest pose.
    let before = window.app().orbits()[0].target;
    let mut found = None;
    for share in [0.12, 0.16, 0.2, 0.24, 0.28, 0.32] {
        for down in [-0.2, -0.1, 0.0, 0.1] {
            if found.is_some() {
                continue;
            }
            let at =
                egui::pos2(place.left() + place.width() * share, place.center().y + place.height() * down);
            for _ in 0..2 {
                window.harness.drag_at(at);
                window.harness.drop_at(at);
            }
            window.harness.run_steps(10);
            let after = window.app().orbits()[0].target;
            found = (after != before).then_some(after);
        }
    }
    let found = found.expect("something stands there");
    assert!(found.x < -0.3, "left of the arm at rest: {found}");
}
