//! The app in a headless harness: every panel and key, both themes, on a software adapter.
//!
//! With `LODSMITH_PICTURES=FOLDER` each picture is saved there for inspection.

mod benchmark;
mod compare;
mod first_minute;
mod harness;
mod keyframes;
mod stage;
mod test_harness;
mod timeline;

use std::path::Path;

use eframe::egui::Role;
use eframe::egui::{self, Key, KeyboardShortcut, Modifiers};
use egui_kittest::kittest::Queryable;
use harness::AppHarness;
use lodsmith::Length;
use lodsmith_render::Shading;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::document::target_scale::Unit;
use lodsmith_viewer::job::JobKind;
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::panel::keys::{Action, BINDINGS};
use lodsmith_viewer::settings::{Appearance, Backdrop, EnvironmentChoice, Sides};

const ORIGINAL: &str = "Picture of the original";
const RESULT: &str = "Picture of the result";

#[test]
fn an_empty_window_says_what_to_do() {
    for is_light in [false, true] {
        let Some(mut window) = AppHarness::with(is_light, None::<&str>) else { return };
        window.harness.get_by_label("Drop a model here");
        window.picture(if is_light { "empty_light" } else { "empty_dark" });
        window.click("Open sample");
        let original = window.app().document().original().unwrap();
        assert!(original.content.faces > 1000);
        window.picture(if is_light { "sample_light" } else { "sample_dark" });
    }
}

#[test]
fn the_slider_follows_the_pointer() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    assert_eq!(window.faces(), None);
    let rail = window.harness.get_by_label("Target slider").rect();
    let y = rail.top() + 13.0;
    let at = |share: f32| egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * share, y);
    window.drag(at(1.0), at(0.6));
    let some = window.faces().unwrap();
    window.drag(at(0.6), at(0.3));
    let few = window.faces().unwrap();
    assert!(few < some && few < 500, "{few} {some}");
    window.picture("slider");
    window.drag(at(0.3), at(0.9));
    assert!(window.faces().unwrap() > some);
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(window.faces(), Some(few));
    window.press_with(Modifiers::COMMAND, Key::Y);
    assert!(window.faces().unwrap() > some);
    window.press(Key::R);
    assert_eq!(window.faces(), None);
}

#[test]
fn a_press_on_the_slider_sets_it_before_it_moves() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let rail = window.harness.get_by_label("Target slider").rect();
    let at = egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * 0.4, rail.top() + 13.0);
    window.harness.drag_at(at);
    window.harness.run_steps(2);
    let shown = window.faces().expect("the slider follows a press");
    assert!(shown < 1000, "{shown}");
    window.harness.drop_at(at);
    window.settle();
    assert!(window.app().document().lighter().is_some_and(|l| l.content.report.is_some()), "no run followed");
}

#[test]
fn a_held_slider_shows_levels_at_once() {
    for is_light in [false, true] {
        let Some(mut window) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        let rail = window.harness.get_by_label("Target slider").rect();
        let at =
            |share: f32| egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * share, rail.top() + 13.0);
        window.harness.drag_at(at(1.0));
        window.harness.run_steps(2);
        for share in [0.9, 0.6, 0.4, 0.7, 0.5] {
            window.harness.hover_at(at(share));
            window.harness.run_steps(1);
            let wanted = window.app().document().settings().simplify.options.stop.faces.unwrap();
            let shown = window.faces().unwrap();
            assert!(shown <= wanted && shown + 3 > wanted, "{shown} faces for {wanted}");
        }
        window.picture(if is_light { "held_light" } else { "held_dark" });
        window.harness.drop_at(at(0.5));
        window.settle();
        let document = window.app().document();
        assert!(document.lighter().is_some_and(|l| l.content.report.is_some()), "no run followed");
    }
}

#[test]
fn a_held_error_slider_shows_levels_within_the_limit() {
    for (is_light, unit) in [(false, "Error"), (true, "Distance")] {
        let Some(mut window) = AppHarness::with(is_light, Some("torus.obj")) else { return };
        window.press(Key::E);
        window.press(Key::F7);
        window.click(unit);
        let rail = window.harness.get_by_label("Target slider").rect();
        let at =
            |share: f32| egui::pos2(rail.left() + 10.0 + (rail.width() - 20.0) * share, rail.top() + 13.0);
        window.drag(at(1.0), at(0.7));
        let limit_text = |window: &AppHarness| {
            let limit = window.app().document().error_limit().unwrap();
            format!("The line is the error limit, {}", lodsmith_core::numbers::significant(limit, 3))
        };
        let before = limit_text(&window);
        window.harness.get_by_label(&before);
        window.harness.drag_at(at(0.7));
        window.harness.run_steps(2);
        let mut last = 0;
        for share in [0.3, 0.4, 0.5] {
            window.harness.hover_at(at(share));
            window.harness.run_steps(2);
            let document = window.app().document();
            assert!(document.shows_preview());
            let level = document.lighter().unwrap().content.clone();
            let limit = document.error_limit().unwrap();
            assert!(level.largest_estimate.unwrap() <= limit * (1.0 + 1e-9), "{limit}");
            assert!(level.faces > last, "less error, more faces");
            last = level.faces;
            // On a slow machine the slider counts as resting already, and a run was begun.
            if !document.is_busy(JobKind::Simplify) {
                window.harness.get_by_label("Preview");
            }
            window.harness.get_by_label("Preview. The exact result follows");
            window.harness.get_by_label("Max error (estimated)");
            window.harness.get_by_label("Of the last exact result");
            let now = limit_text(&window);
            assert_ne!(now, before);
            window.harness.get_by_label(&now);
        }
        window.picture(if is_light { "held_distance_light" } else { "held_error_dark" });
        window.harness.drop_at(at(0.5));
        window.harness.run_steps(2);
        let document = window.app().document();
        assert!(document.is_busy(JobKind::Simplify) || !document.shows_preview(), "no run was begun");
        window.settle();
        let document = window.app().document();
        let result = document.lighter().unwrap().content.clone();
        let bound = result.report.as_ref().expect("no run followed").error.bound.unwrap();
        assert!(bound <= document.error_limit().unwrap() * (1.0 + 1e-9), "{bound}");
        assert!(window.harness.query_by_label("Preview").is_none());
        window.picture(if is_light { "released_distance_light" } else { "released_error_dark" });
        window.press_with(Modifiers::COMMAND, Key::Z);
        window.harness.get_by_label(&before);
    }
}

#[test]
fn arrow_keys_move_the_focused_slider_in_every_unit() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    for (unit, name) in Unit::ALL {
        window.press(Key::R);
        window.click(name);
        let camera = window.app().orbits();
        window.harness.get_by_label("Target slider").focus();
        window.harness.run_steps(2);
        let stop = |window: &AppHarness| window.app().document().settings().simplify.options.stop;
        let mut seen = vec![stop(&window)];
        for key in [Key::ArrowLeft, Key::ArrowDown, Key::ArrowRight] {
            window.press(key);
            seen.push(stop(&window));
            assert_eq!(Unit::of(window.app().document().settings()), Some(unit));
            let lighter = window.app().document().lighter();
            assert!(lighter.is_some_and(|l| l.content.report.is_some()), "no run followed");
        }
        assert!(seen[0] != seen[1] && seen[1] != seen[2] && seen[2] != seen[3], "{seen:?}");
        assert_eq!(window.app().orbits(), camera, "the keys turn the camera too");
        window.press(Key::Escape);
    }
}

#[test]
fn a_count_can_be_typed_in_every_unit() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    for (unit, text) in
        [("Faces", "1,000"), ("Vertices", "402"), ("Percent", "10"), ("Error", "0.5%"), ("Distance", "0.02")]
    {
        window.click(unit);
        window.write("Target", text);
        window.press(Key::Enter);
        let stop = window.app().document().settings().simplify.options.stop;
        let is_set = [
            stop.faces == Some(1000),
            stop.vertices == Some(402),
            stop.ratio == Some(0.1),
            stop.error == Some(Length::OfDiagonal(0.005)),
            stop.error == Some(Length::Units(0.02)),
        ];
        let which =
            ["Faces", "Vertices", "Percent", "Error", "Distance"].iter().position(|u| *u == unit).unwrap();
        assert!(is_set[which], "{unit}: {stop:?}");
        assert!(window.faces().is_some_and(|n| n < 10_000), "{unit}: {:?}", window.faces());
    }
}

#[test]
fn holding_m_goes_on_and_letting_go_stops() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.harness.key_down(Key::M);
    window.harness.run_steps(30);
    window.harness.key_up(Key::M);
    window.settle();
    let held = window.faces().unwrap();
    assert!(held < 20_480);
    window.harness.run_steps(10);
    window.settle();
    assert_eq!(window.faces(), Some(held));
    window.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(window.faces(), None, "one press is one step");
}

#[test]
fn every_panel_has_a_key_that_shows_and_hides_it() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    window.press(Key::Minus);
    for panel in Panel::ALL {
        let KeyboardShortcut { modifiers, logical_key: key } =
            Action::Panel(panel).binding().unwrap().shortcut;
        if !window.app().is_shown(panel) {
            window.press_with(modifiers, key);
        }
        assert!(window.app().is_shown(panel), "{panel:?}");
        let name = format!("Hide {}", panel.title());
        window.harness.get_by_label(&name);
        window.picture(&format!("panel_{}", panel.title().to_lowercase()));
        window.press_with(modifiers, key);
        assert!(!window.app().is_shown(panel), "{panel:?}");
        assert!(window.harness.query_by_label(&name).is_none(), "{panel:?}");
    }
    window.press(Key::F3);
    window.press(Key::Tab);
    assert!(!window.app().is_shown(Panel::Method));
    window.picture("bare");
    window.press(Key::Tab);
    assert!(window.app().is_shown(Panel::Method));
}

#[test]
fn every_key_of_the_look_changes_it_and_the_picture() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    window.press(Key::Minus);
    window.press(Key::Minus);
    for b in BINDINGS {
        let is_look =
            matches!(b.action, Action::Wireframe | Action::Shade(_) | Action::Ground | Action::Cull)
                || matches!(b.action, Action::Borders | Action::Defects);
        if !is_look {
            continue;
        }
        let before = window.app().document().settings().look.clone();
        let pixels = window.pixels(RESULT);
        window.press(b.shortcut.logical_key);
        let after = window.app().document().settings().look.clone();
        if b.action == Action::Shade(0) {
            continue;
        }
        assert_ne!(before, after, "{}", b.name);
        // The torus is closed and free of defects, and has neither colours nor texture.
        let shows = matches!(b.action, Action::Wireframe | Action::Ground)
            || matches!(b.action, Action::Shade(1 | 4 | 5 | 6));
        if shows {
            assert!(window.pixels(RESULT) != pixels, "{} is not seen", b.name);
        }
        window.picture(&format!("look_{}", b.name.to_lowercase().replace(' ', "_")));
        window.press_with(Modifiers::COMMAND, Key::Z);
        assert_eq!(window.app().document().settings().look, before, "{}", b.name);
    }
}

#[test]
fn sides_are_shown_in_every_way() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    for _ in 0..20 {
        window.press(Key::Minus);
    }
    for (sides, name) in Sides::ALL {
        assert_eq!(window.app().document().settings().layout.sides, sides);
        let has = |label: &str| window.harness.query_by_label(label).is_some();
        assert_eq!(has(ORIGINAL), !matches!(sides, Sides::Result | Sides::Difference), "{name}");
        assert_eq!(has(RESULT), !matches!(sides, Sides::Original | Sides::Difference), "{name}");
        window.picture(&format!("sides_{}", name.to_lowercase().replace(' ', "_")));
        window.press(Key::V);
    }
    // While the key is held, the original replaces the result.
    window.press(Key::W);
    let result = window.pixels(RESULT);
    window.harness.key_down(Key::Space);
    window.harness.run_steps(3);
    assert!(window.pixels(RESULT) != result);
    window.harness.key_up(Key::Space);
    window.harness.run_steps(3);
    assert!(window.pixels(RESULT) == result);
}

#[test]
fn environments_are_reflected_and_shown_as_background() {
    let Some(mut window) = AppHarness::with(false, Some(Path::new("../../testdata/arm.glb"))) else { return };
    let around = |window: &AppHarness| window.app().document().settings().look.around.clone();
    assert_eq!(around(&window), EnvironmentChoice::Auto);
    let mut seen = vec![window.pixels(ORIGINAL)];
    let key = Action::NextEnvironment.binding().unwrap().shortcut;
    for wanted in [EnvironmentChoice::Plain, EnvironmentChoice::Studio, EnvironmentChoice::Auto] {
        window.press_with(key.modifiers, key.logical_key);
        assert_eq!(around(&window), wanted);
        seen.push(window.pixels(ORIGINAL));
    }
    assert!(seen[1] != seen[2], "a studio is seen");
    let has_metal = window.app().document().original().unwrap().content.model().has_metal();
    let by_model = if has_metal { &seen[2] } else { &seen[1] };
    assert!(seen[0] == *by_model && seen[3] == *by_model);
    for (backdrop, name) in [(Backdrop::Surroundings, "sharp"), (Backdrop::Blurred, "blurred")] {
        let look = Appearance { backdrop, ..window.app().document().settings().look.clone() };
        window.harness.state_mut().document_mut().run(Command::Look(look));
        window.settle();
        let now = window.pixels(ORIGINAL);
        assert!(!seen.contains(&now), "{name}");
        seen.push(now);
        window.picture(&format!("surroundings_{name}"));
    }
}

/// Sides share one picture only as long as both show the same.
#[test]
fn sides_that_differ_have_their_own_pictures() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    let both = |window: &mut AppHarness| [window.pixels(ORIGINAL), window.pixels(RESULT)];
    // Averages of samples are rounded by the place of the picture in the window.
    let alike = |a: &[[u8; 4]], b: &[[u8; 4]]| {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| a.abs_diff(*b) <= 2)
    };
    let [one, two] = both(&mut window);
    assert!(alike(&one, &two) && one.iter().any(|p| *p != one[0]));
    window.press(Key::L);
    let place = window.harness.get_by_label(RESULT).rect().center();
    window.drag(place, place + egui::vec2(60.0, 20.0));
    let [one_then, two_then] = both(&mut window);
    assert!(one_then == one && !alike(&two_then, &two), "one camera moves one side");
    window.press(Key::L);
    let [one, two] = both(&mut window);
    assert!(alike(&one, &two), "linked again");
    window.press(Key::Minus);
    window.press(Key::W);
    let [one, two] = both(&mut window);
    assert!(!alike(&one, &two), "a result is not the original");
}

#[test]
fn the_wipe_can_be_dragged() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.press(Key::V);
    let line = window.harness.get_by_role_and_label(Role::Slider, "Wipe").rect().center();
    let line = egui::pos2(line.x, line.y + 60.0);
    window.drag(line, line - egui::vec2(150.0, 0.0));
    assert!(window.app().document().settings().layout.wipe < 0.4);
}

#[test]
fn the_mouse_and_the_arrows_move_both_cameras() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let place = window.harness.get_by_label(ORIGINAL).rect().center();
    let before = window.app().orbits();
    assert_eq!(before[0], before[1]);
    window.drag(place, place + egui::vec2(90.0, 30.0));
    let turned = window.app().orbits();
    assert_eq!(turned[0], turned[1], "cameras are linked");
    assert!((turned[0].yaw_rad - before[0].yaw_rad).abs() > 0.1);
    window.press(Key::ArrowRight);
    assert!(window.app().orbits()[0].yaw_rad != turned[0].yaw_rad);
    window.press(Key::L);
    window.drag(place, place + egui::vec2(-60.0, 0.0));
    let [one, two] = window.app().orbits();
    assert_ne!(one, two, "cameras are free");
    window.press(Key::L);
    let [one, two] = window.app().orbits();
    assert_eq!(one, two);
    for (key, pitch) in [(Key::Num1, 0.0), (Key::Num7, std::f64::consts::FRAC_PI_2)] {
        window.press(key);
        assert!((window.app().orbits()[0].pitch_rad - pitch).abs() < 1e-6, "{key:?}");
    }
    // Zoom to the pointer, then frame the model again.
    let framed = window.app().orbits()[0];
    window.harness.hover_at(place + egui::vec2(40.0, 20.0));
    window.harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, 200.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
        modifiers: Modifiers::NONE,
    });
    window.harness.run_steps(20);
    assert!(window.app().orbits()[0].distance < framed.distance);
    window.press(Key::F);
    assert!((window.app().orbits()[0].distance - framed.distance).abs() < 1e-6 * framed.distance);
}

#[test]
fn cameras_are_kept_and_the_model_turns() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    let ctrl_shift = Modifiers::COMMAND | Modifiers::SHIFT;
    window.press(Key::Num1);
    window.press_with(ctrl_shift, Key::Num2);
    let kept = window.app().orbits()[0];
    window.press(Key::Num7);
    assert_ne!(window.app().orbits()[0], kept);
    window.press_with(Modifiers::COMMAND, Key::Num2);
    let back = window.app().orbits()[0];
    assert!((back.yaw_rad - kept.yaw_rad).abs() < 1e-9 && (back.distance - kept.distance).abs() < 1e-9);
    let before = window.pixels(ORIGINAL);
    window.press_with(Modifiers::ALT, Key::ArrowUp);
    assert!(window.pixels(ORIGINAL) != before, "the model has turned");
    window.press_with(Modifiers::ALT, Key::Num0);
    assert!(window.pixels(ORIGINAL) == before);
}

#[test]
fn a_double_click_looks_at_that_place() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let place = window.harness.get_by_label(ORIGINAL).rect().center() + egui::vec2(60.0, 10.0);
    let before = window.app().orbits()[0].target;
    for _ in 0..2 {
        window.harness.drag_at(place);
        window.harness.drop_at(place);
    }
    window.harness.run_steps(6);
    let after = window.app().orbits()[0].target;
    assert!(after.distance(before) > 0.1);
    assert!((after.length() - 1.0).abs() < 0.05, "on the sphere: {after}");
}

#[test]
fn the_heat_map_has_a_legend_and_a_histogram() {
    for is_light in [false, true] {
        let Some(mut window) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        for _ in 0..30 {
            window.press(Key::Minus);
        }
        window.press(Key::F7);
        window.press(Key::E);
        assert_eq!(window.app().document().settings().look.look.shading, Shading::Heat);
        assert!(window.app().document().distances().is_some());
        window.harness.get_by_label("Histogram of distances");
        window.picture(if is_light { "heat_light" } else { "heat_dark" });
        // The picture contains blue and red.
        let pixels = window.pixels(RESULT);
        assert!(
            pixels.iter().any(|p| p[0] > p[2].saturating_add(60))
                && pixels.iter().any(|p| p[2] > p[0].saturating_add(60))
        );
    }
}

#[test]
fn the_sample_and_its_result_show_wires_and_a_heat_map() {
    let sample = Path::new("../../testdata/finial.ply");
    let Some(mut window) = AppHarness::with(false, Some(sample)) else { return };
    window.press(Key::W);
    for _ in 0..24 {
        window.press(Key::Minus);
    }
    let plain = window.pixels(RESULT);
    window.press(Key::E);
    assert!(window.faces().unwrap() < window.app().document().original().unwrap().content.faces / 4);
    assert_ne!(window.pixels(RESULT), plain);
    // Screenshot for docs/viewer.md.
    window.picture("viewer");
}

#[test]
fn a_broken_file_is_reported_and_the_open_file_stays() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let path = window.path("broken.obj");
    std::fs::write(&path, "v 1 2\nf 1 2 nonsense\n").unwrap();
    window.press_with(Modifiers::COMMAND, Key::O);
    window.write("Path", path.display());
    window.picture("chooser");
    window.press(Key::Enter);
    assert!(window.app().document().problem.as_deref().is_some_and(|p| p.contains("broken.obj")));
    assert_eq!(window.app().document().original().unwrap().content.faces, 20_480);
    window.picture("broken");
    window.click("Dismiss");
    assert_eq!(window.app().document().problem, None);
}

#[test]
fn the_export_dialog_writes_what_is_shown() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    for _ in 0..10 {
        window.press(Key::Minus);
    }
    window.press_with(Modifiers::COMMAND, Key::S);
    window.picture("export");
    window.click("Write");
    let read = lodsmith_io::read_path(&window.path("sphere_low.ply"), &Default::default()).unwrap();
    assert_eq!(Some(read.mesh.face_count()), window.faces());
}

#[test]
fn a_session_is_saved_and_opened_again() {
    let Some(mut window) = AppHarness::open("torus.obj") else { return };
    window.press(Key::Minus);
    window.press(Key::W);
    window.press_with(Modifiers::SHIFT, Key::PageDown);
    window.press(Key::Num7);
    window.press_with(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    window.press(Key::Enter);
    let path = window.path("torus.lodsmith.json");
    assert!(path.is_file());
    let (settings, orbit, faces) =
        (window.app().document().settings().clone(), window.app().orbits()[0], window.faces());
    let Some(again) = AppHarness::within(false, vec![path], window.folder) else { return };
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
        let Some(mut window) = AppHarness::with(is_light, Some("sphere.ply")) else { return };
        window.press(Key::H);
        window.harness.get_by_label("Hold M");
        window.picture(if is_light { "help_light" } else { "help_dark" });
        window.press(Key::H);
        assert!(window.harness.query_by_label("Hold M").is_none());
    }
}

#[test]
fn the_theme_changes_by_its_key() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let dark = window.picture("theme_dark");
    window.press_with(Modifiers::COMMAND, Key::T);
    let light = window.picture("theme_light");
    let at = |picture: &image::RgbaImage| picture.get_pixel(20, 500).0[0];
    assert!(at(&light) > at(&dark) + 100);
}

#[test]
fn nothing_is_drawn_while_nothing_happens() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.press(Key::Minus);
    // A window that requests a repaint every frame never settles.
    assert!(window.harness.try_run().is_ok());
}
