//! Comparing both sides, and baked maps: the difference picture, the quantities of the heat map, its histogram, and clicks.

use eframe::egui::{self, Key};
use egui_kittest::kittest::Queryable;
use lodsmith_render::Shading;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::settings::{Appearance, HeatOf, Layout, Sides};

use super::desk::AppHarness;
use super::{ORIGINAL, RESULT};

const DIFFERENCE: &str = "Picture of the difference";
const HISTOGRAM: &str = "Histogram of distances";

/// Opens a model with a result of some thirty steps of the slider.
fn with_result(name: &str) -> Option<AppHarness> {
    let mut desk = AppHarness::open(name)?;
    for _ in 0..30 {
        desk.press(Key::Minus);
    }
    Some(desk)
}

fn show(desk: &mut AppHarness, sides: Sides) {
    let layout = Layout { sides, ..desk.app().document().settings().layout };
    desk.harness.state_mut().document_mut().run(Command::Layout(layout));
    desk.settle();
}

fn heat_of(desk: &mut AppHarness, heat_of: HeatOf) {
    let mut look = Appearance { heat_of, ..desk.app().document().settings().look.clone() };
    look.look.shading = Shading::Heat;
    desk.harness.state_mut().document_mut().run(Command::Look(look));
    desk.settle();
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
    let Some(mut desk) = AppHarness::open("sphere.ply") else { return };
    show(&mut desk, Sides::Difference);
    assert!(desk.harness.query_by_label(ORIGINAL).is_none());
    assert!(desk.app().document().difference().is_none(), "nothing was simplified yet");
    desk.picture("difference_empty");
    for _ in 0..25 {
        desk.press(Key::Minus);
    }
    let some = desk.app().document().difference().unwrap().clone();
    assert!(some.drawn.mean > 0.001 && some.drawn.mean < 0.5, "{}", some.drawn.mean);
    for _ in 0..15 {
        desk.press(Key::Minus);
    }
    let more = desk.app().document().difference().unwrap().clone();
    assert!(more.drawn.mean > some.drawn.mean, "{} {}", more.drawn.mean, some.drawn.mean);
    let pixels = desk.pixels(DIFFERENCE);
    assert!(pixels.iter().any(|p| p[2] > p[0].saturating_add(40)), "equal places are blue");
    desk.picture("difference");
    // The camera is moved over it.
    let place = desk.harness.get_by_label(DIFFERENCE).rect().center();
    desk.drag(place, place + egui::vec2(90.0, 20.0));
    let turned = desk.app().document().difference().unwrap().clone();
    assert!(turned.of.seen.camera != more.of.seen.camera);
    assert_eq!(desk.app().orbits()[0], desk.app().orbits()[1]);
    show(&mut desk, Sides::Both);
    assert!(desk.app().document().difference().is_none(), "its memory is given back");
}

#[test]
fn normals_and_missing_attributes_have_heat_maps_too() {
    let Some(mut desk) = with_result("torus.obj") else { return };
    desk.press(Key::F7);
    heat_of(&mut desk, HeatOf::Distance);
    let distance = desk.pixels(RESULT);
    heat_of(&mut desk, HeatOf::Normals);
    let measured = desk.app().document().distances().unwrap().clone();
    assert!(measured.quantity == HeatOf::Normals && measured.largest > 1.0 && measured.largest < 90.0);
    assert!(desk.pixels(RESULT) != distance);
    desk.picture("heat_normals");
    for (quantity, text) in
        [(HeatOf::Uvs, "Both sides need UVs"), (HeatOf::Colors, "Both sides need vertex colours")]
    {
        heat_of(&mut desk, quantity);
        desk.harness.get_by_label(text);
    }
    desk.picture("heat_no_colours");
    heat_of(&mut desk, HeatOf::Distance);
    assert!(desk.pixels(RESULT) == distance);
}

#[test]
fn a_drag_over_the_histogram_shows_where_the_values_are() {
    let Some(mut desk) = with_result("sphere.ply") else { return };
    desk.press(Key::F7);
    heat_of(&mut desk, HeatOf::Distance);
    let whole = desk.pixels(RESULT);
    let rect = desk.harness.get_by_label(HISTOGRAM).rect();
    let at = |share: f32| egui::pos2(rect.left() + rect.width() * share, rect.center().y);
    desk.drag(at(0.5), at(0.98));
    let [from, to] = desk.app().document().settings().look.look.heat_brush.unwrap();
    let largest = desk.app().document().distances().unwrap().largest as f32;
    assert!(from > 0.4 * largest && from < 0.6 * largest && to >= largest, "{from} {to} {largest}");
    let brushed = desk.pixels(RESULT);
    assert!(greys(&brushed) > greys(&whole) + 2000, "{} {}", greys(&brushed), greys(&whole));
    desk.harness.get_by_label_contains(" vertices (");
    desk.picture("heat_brush");
    desk.press_with(egui::Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.app().document().settings().look.look.heat_brush, None, "a drag is one step");
    desk.press_with(egui::Modifiers::COMMAND, Key::Y);
    desk.point(at(0.2));
    assert_eq!(desk.app().document().settings().look.look.heat_brush, None, "a click shows everything");
    assert!(desk.pixels(RESULT) == whole);
}

#[test]
fn a_click_on_the_surface_reads_the_error_there() {
    let Some(mut desk) = with_result("sphere.ply") else { return };
    let shown = |desk: &AppHarness| desk.harness.query_by_label_contains("Error here: ").is_some();
    for side in [ORIGINAL, RESULT] {
        heat_of(&mut desk, HeatOf::Distance);
        let rect = desk.harness.get_by_label(side).rect();
        desk.point(rect.center() + egui::vec2(20.0, 10.0));
        assert!(shown(&desk), "{side}");
        desk.picture("heat_probe");
        heat_of(&mut desk, HeatOf::Normals);
        assert!(!shown(&desk), "it was another quantity");
        desk.point(rect.center() + egui::vec2(20.0, 10.0));
        assert!(shown(&desk), "{side}");
        desk.point(rect.left_bottom() + egui::vec2(30.0, -80.0));
        assert!(!shown(&desk), "beside the model there is none");
    }
    let value = desk.app().document().distances().unwrap().largest;
    assert!(value > 0.0);
    // Without a heat map or its panel a click does nothing.
    desk.press(Key::S);
    let rect = desk.harness.get_by_label(RESULT).rect();
    desk.press(Key::Minus);
    desk.point(rect.center());
    assert!(!shown(&desk));
}

#[test]
fn maps_are_baked_in_the_panel_and_shown_large() {
    let Some(mut desk) = with_result("torus.obj") else { return };
    // The panel below it comes up.
    desk.press(Key::F4);
    desk.press_with(egui::Modifiers::SHIFT, Key::F4);
    let maps = |desk: &AppHarness| desk.app().document().settings().bake.maps.len();
    assert_eq!(maps(&desk), 2);
    desk.harness.get_by_role_and_label(egui::accesskit::Role::CheckBox, "Colour").click();
    desk.settle();
    assert_eq!(maps(&desk), 1);
    let before = desk.pixels(RESULT);
    desk.click("Bake");
    let baked = desk.app().document().baked().expect("it is baked");
    assert_eq!(baked.maps[0].name, "normal");
    assert_eq!(desk.app().document().settings().look.look.shading, Shading::Textured);
    assert!(desk.app().command_line().contains("--bake normal"));
    assert!(desk.pixels(RESULT) != before);
    desk.picture("baked");
    desk.click("Map normal");
    desk.picture("baked_large");
    desk.click("Close");
    assert!(desk.harness.query_by_label("Close").is_none());
    desk.click("Remove maps");
    assert!(desk.app().document().baked().is_none());
    assert!(!desk.app().command_line().contains("--bake"));
}
