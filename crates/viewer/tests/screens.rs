//! The app in a headless harness: every panel and key, both themes, on a software adapter.
//!
//! With `LODSMITH_PICTURES=FOLDER` each picture is saved there for inspection.

mod adapter;
#[path = "screens/benchmark.rs"]
mod benchmark;
#[path = "screens/compare.rs"]
mod compare;
#[path = "screens/desk.rs"]
mod desk;
#[path = "screens/first_minute.rs"]
mod first_minute;
#[path = "screens/keyframes.rs"]
mod keyframes;
#[path = "screens/stage.rs"]
mod stage;
#[path = "screens/test_desk.rs"]
mod test_desk;
#[path = "screens/timeline.rs"]
mod timeline;

use std::path::Path;

use desk::AppHarness;
use eframe::egui::Role;
use eframe::egui::{self, Key, KeyboardShortcut, Modifiers};
use egui_kittest::kittest::Queryable;
use lodsmith_render::Shading;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::panel::keys::{Action, BINDINGS};
use lodsmith_viewer::settings::{Appearance, Backdrop, EnvironmentChoice, Sides};

const ORIGINAL: &str = "Picture of the original";
const RESULT: &str = "Picture of the result";

#[test]
fn an_empty_window_says_what_to_do() {
    for is_light in [false, true] {
        let Some(mut desk) = AppHarness::with(is_light, None::<&str>) else { return };
        desk.harness.get_by_label("Drop a model here");
        desk.picture(if is_light { "empty_light" } else { "empty_dark" });
        desk.click("Open sample");
        let original = desk.app().document().original().unwrap();
        assert!(original.content.faces > 1000);
        desk.picture(if is_light { "sample_light" } else { "sample_dark" });
    }
}

#[test]
fn the_slider_follows_the_pointer() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    assert_eq!(desk.faces(), None);
    let rail = desk.harness.get_by_label("Target slider").rect();
    let y = rail.top() + 13.0;
    let at = |share: f32| egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * share, y);
    desk.drag(at(1.0), at(0.6));
    let some = desk.faces().unwrap();
    desk.drag(at(0.6), at(0.3));
    let few = desk.faces().unwrap();
    assert!(few < some && few < 500, "{few} {some}");
    desk.picture("slider");
    desk.drag(at(0.3), at(0.9));
    assert!(desk.faces().unwrap() > some);
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.faces(), Some(few));
    desk.press_with(Modifiers::COMMAND, Key::Y);
    assert!(desk.faces().unwrap() > some);
    desk.press(Key::R);
    assert_eq!(desk.faces(), None);
}

#[test]
fn a_press_on_the_slider_sets_it_before_it_moves() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    let rail = desk.harness.get_by_label("Target slider").rect();
    let at = egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * 0.4, rail.top() + 13.0);
    desk.harness.drag_at(at);
    desk.harness.run_steps(2);
    let shown = desk.faces().expect("the slider follows a press");
    assert!(shown < 1000, "{shown}");
    desk.harness.drop_at(at);
    desk.settle();
    assert!(desk.app().document().lighter().is_some_and(|l| l.content.report.is_some()), "no run followed");
}

#[test]
fn a_held_slider_shows_levels_at_once() {
    for is_light in [false, true] {
        let Some(mut desk) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        let rail = desk.harness.get_by_label("Target slider").rect();
        let at =
            |share: f32| egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * share, rail.top() + 13.0);
        desk.harness.drag_at(at(1.0));
        desk.harness.run_steps(2);
        for share in [0.9, 0.6, 0.4, 0.7, 0.5] {
            desk.harness.hover_at(at(share));
            desk.harness.run_steps(1);
            let wanted = desk.app().document().settings().simplify.options.stop.faces.unwrap();
            let shown = desk.faces().unwrap();
            assert!(shown <= wanted && shown + 3 > wanted, "{shown} faces for {wanted}");
        }
        desk.picture(if is_light { "held_light" } else { "held_dark" });
        desk.harness.drop_at(at(0.5));
        desk.settle();
        let document = desk.app().document();
        assert!(document.lighter().is_some_and(|l| l.content.report.is_some()), "no run followed");
    }
}

#[test]
fn a_count_can_be_typed_in_every_unit() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    for (unit, text) in [("Faces", "1,000"), ("Vertices", "402"), ("Percent", "10"), ("Error", "0.5%")] {
        desk.click(unit);
        desk.write("Target", text);
        desk.press(Key::Enter);
        let stop = desk.app().document().settings().simplify.options.stop;
        let is_set = [
            stop.faces == Some(1000),
            stop.vertices == Some(402),
            stop.ratio == Some(0.1),
            stop.error.is_some(),
        ];
        let which = ["Faces", "Vertices", "Percent", "Error"].iter().position(|u| *u == unit).unwrap();
        assert!(is_set[which], "{unit}: {stop:?}");
        assert!(desk.faces().is_some_and(|n| n < 10_000), "{unit}: {:?}", desk.faces());
    }
}

#[test]
fn holding_m_goes_on_and_letting_go_stops() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    desk.harness.key_down(Key::M);
    desk.harness.run_steps(30);
    desk.harness.key_up(Key::M);
    desk.settle();
    let held = desk.faces().unwrap();
    assert!(held < 20_480);
    desk.harness.run_steps(10);
    desk.settle();
    assert_eq!(desk.faces(), Some(held));
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.faces(), None, "one press is one step");
}

#[test]
fn every_panel_has_a_key_that_shows_and_hides_it() {
    let Some(mut desk) = AppHarness::open("torus.obj") else { return };
    desk.press(Key::Minus);
    for panel in Panel::ALL {
        let KeyboardShortcut { modifiers, logical_key: key } =
            Action::Panel(panel).binding().unwrap().shortcut;
        if !desk.app().is_shown(panel) {
            desk.press_with(modifiers, key);
        }
        assert!(desk.app().is_shown(panel), "{panel:?}");
        let name = format!("Hide {}", panel.title());
        desk.harness.get_by_label(&name);
        desk.picture(&format!("panel_{}", panel.title().to_lowercase()));
        desk.press_with(modifiers, key);
        assert!(!desk.app().is_shown(panel), "{panel:?}");
        assert!(desk.harness.query_by_label(&name).is_none(), "{panel:?}");
    }
    desk.press(Key::F3);
    desk.press(Key::Tab);
    assert!(!desk.app().is_shown(Panel::Method));
    desk.picture("bare");
    desk.press(Key::Tab);
    assert!(desk.app().is_shown(Panel::Method));
}

#[test]
fn every_key_of_the_look_changes_it_and_the_picture() {
    let Some(mut desk) = AppHarness::open("torus.obj") else { return };
    desk.press(Key::Minus);
    desk.press(Key::Minus);
    for b in BINDINGS {
        let is_look =
            matches!(b.action, Action::Wireframe | Action::Shade(_) | Action::Ground | Action::Cull)
                || matches!(b.action, Action::Borders | Action::Defects);
        if !is_look {
            continue;
        }
        let before = desk.app().document().settings().look.clone();
        let pixels = desk.pixels(RESULT);
        desk.press(b.shortcut.logical_key);
        let after = desk.app().document().settings().look.clone();
        if b.action == Action::Shade(0) {
            continue;
        }
        assert_ne!(before, after, "{}", b.name);
        // The torus is closed and free of defects, and has neither colours nor texture.
        let shows = matches!(b.action, Action::Wireframe | Action::Ground)
            || matches!(b.action, Action::Shade(1 | 4 | 5 | 6));
        if shows {
            assert!(desk.pixels(RESULT) != pixels, "{} is not seen", b.name);
        }
        desk.picture(&format!("look_{}", b.name.to_lowercase().replace(' ', "_")));
        desk.press_with(Modifiers::COMMAND, Key::Z);
        assert_eq!(desk.app().document().settings().look, before, "{}", b.name);
    }
}

#[test]
fn sides_are_shown_in_every_way() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    for _ in 0..20 {
        desk.press(Key::Minus);
    }
    for (sides, name) in Sides::ALL {
        assert_eq!(desk.app().document().settings().layout.sides, sides);
        let has = |label: &str| desk.harness.query_by_label(label).is_some();
        assert_eq!(has(ORIGINAL), !matches!(sides, Sides::Result | Sides::Difference), "{name}");
        assert_eq!(has(RESULT), !matches!(sides, Sides::Original | Sides::Difference), "{name}");
        desk.picture(&format!("sides_{}", name.to_lowercase().replace(' ', "_")));
        desk.press(Key::V);
    }
    // While the key is held, the original replaces the result.
    desk.press(Key::W);
    let result = desk.pixels(RESULT);
    desk.harness.key_down(Key::Space);
    desk.harness.run_steps(3);
    assert!(desk.pixels(RESULT) != result);
    desk.harness.key_up(Key::Space);
    desk.harness.run_steps(3);
    assert!(desk.pixels(RESULT) == result);
}

#[test]
fn surroundings_are_mirrored_and_seen_behind() {
    let Some(mut desk) = AppHarness::with(false, Some(Path::new("../../testdata/arm.glb"))) else { return };
    let around = |desk: &AppHarness| desk.app().document().settings().look.around.clone();
    assert_eq!(around(&desk), EnvironmentChoice::Auto);
    let mut seen = vec![desk.pixels(ORIGINAL)];
    let key = Action::NextEnvironment.binding().unwrap().shortcut;
    for wanted in [EnvironmentChoice::Plain, EnvironmentChoice::Studio, EnvironmentChoice::Auto] {
        desk.press_with(key.modifiers, key.logical_key);
        assert_eq!(around(&desk), wanted);
        seen.push(desk.pixels(ORIGINAL));
    }
    assert!(seen[1] != seen[2], "a studio is seen");
    let has_metal = desk.app().document().original().unwrap().content.model().has_metal();
    let by_model = if has_metal { &seen[2] } else { &seen[1] };
    assert!(seen[0] == *by_model && seen[3] == *by_model);
    for (backdrop, name) in [(Backdrop::Surroundings, "sharp"), (Backdrop::Blurred, "blurred")] {
        let look = Appearance { backdrop, ..desk.app().document().settings().look.clone() };
        desk.harness.state_mut().document_mut().run(Command::Look(look));
        desk.settle();
        let now = desk.pixels(ORIGINAL);
        assert!(!seen.contains(&now), "{name}");
        seen.push(now);
        desk.picture(&format!("surroundings_{name}"));
    }
}

/// Sides share one picture only as long as both show the same.
#[test]
fn sides_that_differ_have_their_own_pictures() {
    let Some(mut desk) = AppHarness::open("torus.obj") else { return };
    let both = |desk: &mut AppHarness| [desk.pixels(ORIGINAL), desk.pixels(RESULT)];
    // Averages of samples are rounded by the place of the picture in the window.
    let alike = |a: &[[u8; 4]], b: &[[u8; 4]]| {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| a.abs_diff(*b) <= 2)
    };
    let [one, two] = both(&mut desk);
    assert!(alike(&one, &two) && one.iter().any(|p| *p != one[0]));
    desk.press(Key::L);
    let place = desk.harness.get_by_label(RESULT).rect().center();
    desk.drag(place, place + egui::vec2(60.0, 20.0));
    let [one_then, two_then] = both(&mut desk);
    assert!(one_then == one && !alike(&two_then, &two), "one camera moves one side");
    desk.press(Key::L);
    let [one, two] = both(&mut desk);
    assert!(alike(&one, &two), "linked again");
    desk.press(Key::Minus);
    desk.press(Key::W);
    let [one, two] = both(&mut desk);
    assert!(!alike(&one, &two), "a result is not the original");
}

#[test]
fn the_wipe_can_be_dragged() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    desk.press(Key::V);
    let line = desk.harness.get_by_role_and_label(Role::Slider, "Wipe").rect().center();
    let line = egui::pos2(line.x, line.y + 60.0);
    desk.drag(line, line - egui::vec2(150.0, 0.0));
    assert!(desk.app().document().settings().layout.wipe < 0.4);
}

#[test]
fn the_mouse_and_the_arrows_move_both_cameras() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    let place = desk.harness.get_by_label(ORIGINAL).rect().center();
    let before = desk.app().orbits();
    assert_eq!(before[0], before[1]);
    desk.drag(place, place + egui::vec2(90.0, 30.0));
    let turned = desk.app().orbits();
    assert_eq!(turned[0], turned[1], "cameras are linked");
    assert!((turned[0].yaw_rad - before[0].yaw_rad).abs() > 0.1);
    desk.press(Key::ArrowRight);
    assert!(desk.app().orbits()[0].yaw_rad != turned[0].yaw_rad);
    desk.press(Key::L);
    desk.drag(place, place + egui::vec2(-60.0, 0.0));
    let [one, two] = desk.app().orbits();
    assert_ne!(one, two, "cameras are free");
    desk.press(Key::L);
    let [one, two] = desk.app().orbits();
    assert_eq!(one, two);
    for (key, pitch) in [(Key::Num1, 0.0), (Key::Num7, std::f64::consts::FRAC_PI_2)] {
        desk.press(key);
        assert!((desk.app().orbits()[0].pitch_rad - pitch).abs() < 1e-6, "{key:?}");
    }
    // Zoom to the pointer, then frame the model again.
    let framed = desk.app().orbits()[0];
    desk.harness.hover_at(place + egui::vec2(40.0, 20.0));
    desk.harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, 200.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
        modifiers: Modifiers::NONE,
    });
    desk.harness.run_steps(20);
    assert!(desk.app().orbits()[0].distance < framed.distance);
    desk.press(Key::F);
    assert!((desk.app().orbits()[0].distance - framed.distance).abs() < 1e-6 * framed.distance);
}

#[test]
fn cameras_are_kept_and_the_model_turns() {
    let Some(mut desk) = AppHarness::open("torus.obj") else { return };
    let ctrl_shift = Modifiers::COMMAND | Modifiers::SHIFT;
    desk.press(Key::Num1);
    desk.press_with(ctrl_shift, Key::Num2);
    let kept = desk.app().orbits()[0];
    desk.press(Key::Num7);
    assert_ne!(desk.app().orbits()[0], kept);
    desk.press_with(Modifiers::COMMAND, Key::Num2);
    let back = desk.app().orbits()[0];
    assert!((back.yaw_rad - kept.yaw_rad).abs() < 1e-9 && (back.distance - kept.distance).abs() < 1e-9);
    let before = desk.pixels(ORIGINAL);
    desk.press_with(Modifiers::ALT, Key::ArrowUp);
    assert!(desk.pixels(ORIGINAL) != before, "the model has turned");
    desk.press_with(Modifiers::ALT, Key::Num0);
    assert!(desk.pixels(ORIGINAL) == before);
}

#[test]
fn a_double_click_looks_at_that_place() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    let place = desk.harness.get_by_label(ORIGINAL).rect().center() + egui::vec2(60.0, 10.0);
    let before = desk.app().orbits()[0].target;
    for _ in 0..2 {
        desk.harness.drag_at(place);
        desk.harness.drop_at(place);
    }
    desk.harness.run_steps(6);
    let after = desk.app().orbits()[0].target;
    assert!(after.distance(before) > 0.1);
    assert!((after.length() - 1.0).abs() < 0.05, "on the sphere: {after}");
}

#[test]
fn the_heat_map_has_a_legend_and_a_histogram() {
    for is_light in [false, true] {
        let Some(mut desk) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        for _ in 0..30 {
            desk.press(Key::Minus);
        }
        desk.press(Key::F7);
        desk.press(Key::E);
        assert_eq!(desk.app().document().settings().look.look.shading, Shading::Heat);
        assert!(desk.app().document().distances().is_some());
        desk.harness.get_by_label("Histogram of distances");
        desk.picture(if is_light { "heat_light" } else { "heat_dark" });
        // The picture contains blue and red.
        let pixels = desk.pixels(RESULT);
        assert!(
            pixels.iter().any(|p| p[0] > p[2].saturating_add(60))
                && pixels.iter().any(|p| p[2] > p[0].saturating_add(60))
        );
    }
}

#[test]
fn the_sample_stands_beside_its_result_with_wires_and_heat() {
    let sample = Path::new("../../testdata/finial.ply");
    let Some(mut desk) = AppHarness::with(false, Some(sample)) else { return };
    desk.press(Key::W);
    for _ in 0..24 {
        desk.press(Key::Minus);
    }
    let plain = desk.pixels(RESULT);
    desk.press(Key::E);
    assert!(desk.faces().unwrap() < desk.app().document().original().unwrap().content.faces / 4);
    assert_ne!(desk.pixels(RESULT), plain);
    // Screenshot for docs/viewer.md.
    desk.picture("viewer");
}

#[test]
fn a_broken_file_is_told_and_what_is_open_stays() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    let path = desk.path("broken.obj");
    std::fs::write(&path, "v 1 2\nf 1 2 nonsense\n").unwrap();
    desk.press_with(Modifiers::COMMAND, Key::O);
    desk.write("Path", path.display());
    desk.picture("chooser");
    desk.press(Key::Enter);
    assert!(desk.app().document().problem.as_deref().is_some_and(|p| p.contains("broken.obj")));
    assert_eq!(desk.app().document().original().unwrap().content.faces, 20_480);
    desk.picture("broken");
    desk.click("Dismiss");
    assert_eq!(desk.app().document().problem, None);
}

#[test]
fn the_export_dialog_writes_what_is_shown() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    for _ in 0..10 {
        desk.press(Key::Minus);
    }
    desk.press_with(Modifiers::COMMAND, Key::S);
    desk.picture("export");
    desk.click("Write");
    let read = lodsmith_io::read_path(&desk.path("sphere_low.ply"), &Default::default()).unwrap();
    assert_eq!(Some(read.mesh.face_count()), desk.faces());
}

#[test]
fn a_session_is_saved_and_opened_again() {
    let Some(mut desk) = AppHarness::open("torus.obj") else { return };
    desk.press(Key::Minus);
    desk.press(Key::W);
    desk.press_with(Modifiers::SHIFT, Key::PageDown);
    desk.press(Key::Num7);
    desk.press_with(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    desk.press(Key::Enter);
    let path = desk.path("torus.lodsmith.json");
    assert!(path.is_file());
    let (settings, orbit, faces) =
        (desk.app().document().settings().clone(), desk.app().orbits()[0], desk.faces());
    let Some(again) = AppHarness::within(false, vec![path], desk.folder) else { return };
    assert_eq!(again.app().document().settings().simplify, settings.simplify);
    assert_eq!(again.app().document().settings().look, settings.look);
    assert_eq!(again.app().document().settings().playback, settings.playback);
    assert_eq!(settings.playback.speed, 2.0);
    assert_eq!(again.faces(), faces);
    let back = again.app().orbits()[0];
    assert!((back.pitch_rad - orbit.pitch_rad).abs() < 1e-6 && (back.distance - orbit.distance).abs() < 1e-6);
}

#[test]
fn the_cheat_sheet_names_every_key_and_closes() {
    for is_light in [false, true] {
        let Some(mut desk) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        desk.press(Key::H);
        desk.harness.get_by_label("Hold M");
        desk.picture(if is_light { "help_light" } else { "help_dark" });
        desk.press(Key::H);
        assert!(desk.harness.query_by_label("Hold M").is_none());
    }
}

#[test]
fn the_theme_changes_by_its_key() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    let dark = desk.picture("theme_dark");
    desk.press_with(Modifiers::COMMAND, Key::T);
    let light = desk.picture("theme_light");
    let at = |picture: &image::RgbaImage| picture.get_pixel(20, 500).0[0];
    assert!(at(&light) > at(&dark) + 100);
}

#[test]
fn nothing_is_drawn_while_nothing_happens() {
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    desk.press(Key::Minus);
    // A window that requests a repaint every frame never settles.
    assert!(desk.harness.try_run().is_ok());
}
