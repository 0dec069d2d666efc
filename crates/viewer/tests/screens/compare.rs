//! Comparing both sides, and baked maps: the difference picture, the quantities of the heat map, its histogram, and
//! clicks.

use eframe::egui::{self, Key};
use egui_kittest::kittest::Queryable;
use lodsmith_render::Shading;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::settings::{Appearance, HeatOf, Layout, Sides};

use super::harness::AppHarness;
use super::{ORIGINAL, RESULT};

const DIFFERENCE: &str = "Picture of the difference";
const HISTOGRAM: &str = "Histogram of distances";

/// Opens a model with a result of some thirty steps of the slider.
fn with_result(name: &str) -> Option<AppHarness> {
    let mut window = AppHarness::open(name)?;
    for _ in 0..30 {
        window.press(Key::Minus);
    }
    Some(window)
}

fn show(window: &mut AppHarness, sides: Sides) {
    let layout = Layout { sides, ..window.app().document().settings().layout };
    window.harness.state_mut().document_mut().run(Command::Layout(layout));
    window.settle();
}

fn heat_of(window: &mut AppHarness, heat_of: HeatOf) {
    let mut look = Appearance { heat_of, ..window.app().document().settings().look.clone() };
    look.look.shading = Shading::Heat;
    window.harness.state_mut().document_mut().run(Command::Look(look));
    window.settle();
}

/// Number of pixels of one grey, with some tolerance for light.
fn greys(pixels: &[[u8; 4]]) -> usize {
    pixels
        .iter()
        .filter(|[r, g, b, _]| r.abs_diff(*g) < 4 && g.abs_diff(*b) < 4 && (60..110).contains(r))
        .count()
}

#[test]
fn the_difference_of_both_sides_is_drawn_and_follows() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    show(&mut window, Sides::Difference);
    assert!(window.harness.query_by_label(ORIGINAL).is_none());
    assert!(window.app().document().difference().is_none(), "nothing was simplified yet");
    window.picture("difference_empty");
    for _ in 0..25 {
        window.press(Key::Minus);
    }
    let some = window.app().document().difference().unwrap().clone();
    assert!(some.drawn.mean > 0.001 && some.drawn.mean < 0.5, "{}", some.drawn.mean);
    for _ in 0..15 {
        window.press(Key::Minus);
    }
    let more = window.app().document().difference().unwrap().clone();
    assert!(more.drawn.mean > some.drawn.mean, "{} {}", more.drawn.mean, some.drawn.mean);
    let pixels = window.pixels(DIFFERENCE);
    assert!(pixels.iter().any(|p| p[2] > p[0].saturating_add(40)), "equal places are blue");
    window.picture("difference");
    // The pointer enters the picture.
    let place = window.harness.get_by_label(DIFFERENCE).rect().center();
    window.drag(place, place + egui::vec2(90.0, 20.0));
    let turned = window.app().document().difference().unwrap().clone();
    assert!(turned.of.seen.camera != more.of.seen.camera);
    assert_eq!(window.app().orbits()[0], window.app().orbits()[1]);
    show(&mut window, Sides::Both);
    assert!(window.app().document().difference().is_none(), "its memory is given back");
}

#[test]
fn normals_and_missing_attributes_have_heat_maps_too() {
    let Some(mut window) = with_result("torus.obj") else { return };
    window.press(Key::F7);
    heat_of(&mut window, HeatOf::Distance);
    let distance = window.pixels(RESULT);
    heat_of(&mut window, HeatOf::Normals);
    let measured = window.app().document().distances().unwrap().clone();
    assert!(measured.quantity == HeatOf::Normals && measured.largest > 1.0 && measured.largest < 90.0);
    assert!(window.pixels(RESULT) != distance);
    window.picture("heat_normals");
    for (quantity, text) in
        [(HeatOf::Uvs, "Both sides need UVs"), (HeatOf::Colors, "Both sides need vertex colours")]
    {
        heat_of(&mut window, quantity);
        window.harness.get_by_label(text);
    }
    window.picture("heat_no_colours");
    heat_of(&mut window, HeatOf::Distance);
    assert!(window.pixels(RESULT) == distance);
}

#[test]
fn a_drag_over_the_histogram_shows_where_the_values_are() {
    let Some(mut window) = with_result("sphere.ply") else { return };
    window.press(Key::F7);
    heat_of(&mut window, HeatOf::Distance);
    let whole = window.pixels(RESULT);
    let rect = window.harness.get_by_label(HISTOGRAM).rect();
    let at = |share: f32| egui::pos2(rect.left() + rect.width() * share, rect.center().y);
    window.drag(at(0.5), at(0.98));
    let [from, to] = window.app().document().settings().look.look.heat_brush.unwrap();
    let largest = window.app().document().distances().unwrap().largest as f32;
    assert!(from > 0.4 * largest && from < 0.6 * largest && to >= largest, "{from} {to} {largest}");
    let brushed = window.pixels(RESULT);
    assert!(greys(&brushed) > greys(&whole) + 2000, "{} {}", greys(&brushed), greys(&whole));
    window.harness.get_by_label_contains(" vertices (");
    window.picture("heat_brush");
    window.press_with(egui::Modifiers::COMMAND, Key::Z);
    assert_eq!(window.app().document().settings().look.look.heat_brush, None, "a drag is one step");
    window.press_with(egui::Modifiers::COMMAND, Key::Y);
    window.point(at(0.2));
    assert_eq!(window.app().document().settings().look.look.heat_brush, None, "a click shows everything");
    assert!(window.pixels(RESULT) == whole);
}

#[test]
fn a_click_on_the_surface_reads_the_error_there() {
    let Some(mut window) = with_result("sphere.ply") else { return };
    let shown = |window: &AppHarness| window.harness.query_by_label_contains("Error here: ").is_some();
    for side in [ORIGINAL, RESULT] {
        heat_of(&mut window, HeatOf::Distance);
        let rect = window.harness.get_by_label(side).rect();
        window.point(rect.center() + egui::vec2(20.0, 10.0));
        assert!(shown(&window), "{side}");
        window.picture("heat_probe");
        heat_of(&mut window, HeatOf::Normals);
        assert!(!shown(&window), "it was another quantity");
        window.point(rect.center() + egui::vec2(20.0, 10.0));
        assert!(shown(&window), "{side}");
        window.point(rect.left_bottom() + egui::vec2(30.0, -80.0));
        assert!(!shown(&window), "beside the model there is none");
    }
    let value = window.app().document().distances().unwrap().largest;
    assert!(value > 0.0);
    // Without a heat map or its panel a click does nothing.
    window.press(Key::S);
    let rect = window.harness.get_by_label(RESULT).rect();
    window.press(Key::Minus);
    window.point(rect.center());
    assert!(!shown(&window));
}

#[test]
fn maps_are_baked_in_the_panel_and_shown_large() {
    let Some(mut window) = with_result("torus.obj") else { return };
    // The panel below it comes up.
    window.press(Key::F4);
    window.press_with(egui::Modifiers::SHIFT, Key::F4);
    let maps = |window: &AppHarness| window.app().document().settings().bake.maps.len();
    assert_eq!(maps(&window), 2);
    window.harness.get_by_role_and_label(egui::accesskit::Role::CheckBox, "Colour").click();
    window.settle();
    assert_eq!(maps(&window), 1);
    let before = window.pixels(RESULT);
    window.click("Bake");
    let baked = window.app().document().baked().expect("it is baked");
    assert_eq!(baked.maps[0].name, "normal");
    assert_eq!(window.app().document().settings().look.look.shading, Shading::Textured);
    assert!(window.app().command_line().contains("--bake normal"));
    assert!(window.pixels(RESULT) != before);
    window.picture("baked");
    window.click("Map normal");
    window.picture("baked_large");
    window.click("Close");
    assert!(window.harness.query_by_label("Close").is_none());
    window.click("Remove maps");
    assert!(window.app().document().baked().is_none());
    assert!(!window.app().command_line().contains("--bake"));
}
