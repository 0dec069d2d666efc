//! The first minute of a user: framing, up axis, presets, hint, layout of texts, borders and defects.

use std::path::Path;

use eframe::egui::{self, Key, Modifiers, Role};
use egui_kittest::kittest::{NodeT, Queryable};
use lodsmith_core::{Positions, TriMesh, VertexId, shapes};
use lodsmith_viewer::command::Command;
use lodsmith_viewer::settings::Backdrop;
use lodsmith_viewer::settings::up_axis::UpAxis;

use super::harness::AppHarness;
use super::{ORIGINAL, RESULT};

/// Returns the share of a picture's width and height that is not background.
fn filled(window: &mut AppHarness) -> [f32; 2] {
    let mut look = window.app().document().settings().look.clone();
    look.backdrop = Backdrop::Color([0.0, 0.0, 1.0]);
    window.harness.state_mut().document_mut().run(Command::Look(look));
    window.settle();
    window.smooth();
    let rect = window.harness.get_by_label(ORIGINAL).rect();
    let picture = window.harness.render().unwrap();
    let (mut min, mut max) = (egui::Vec2::INFINITY, -egui::Vec2::INFINITY);
    // The caption is above.
    for y in rect.top() as u32 + 42..rect.bottom() as u32 - 4 {
        for x in rect.left() as u32 + 4..rect.right() as u32 - 4 {
            let [r, _, b, _] = picture.get_pixel(x, y).0;
            if r > 60 || b < 150 {
                let at = egui::vec2(x as f32, y as f32);
                (min, max) = (min.min(at), max.max(at));
            }
        }
    }
    let size = (max - min) / rect.size();
    [size.x, size.y]
}

#[test]
fn a_model_fills_its_pane() {
    for name in ["sphere.ply", "torus.obj", "../../testdata/finial.ply"] {
        let Some(mut window) = AppHarness::with(false, Some(Path::new(name))) else { return };
        let [across, along] = filled(&mut window);
        let share = across.max(along);
        assert!((0.82..=0.95).contains(&share), "{name}: {across} x {along}");
        for key in [Key::Num1, Key::Num7, Key::F] {
            window.press(key);
            let [across, along] = filled(&mut window);
            assert!((0.82..=0.95).contains(&across.max(along)), "{name} {key:?}: {across} x {along}");
        }
    }
}

/// A file with infinite vertices once opened as two empty panes.
#[test]
fn finite_parts_of_a_model_are_shown_and_the_others_reported() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("broken.ply");
    let mesh = shapes::icosphere(3);
    let Positions::F32(mut positions) = mesh.positions().clone() else { panic!("single precision") };
    (positions[5][0], positions[20][1]) = (f32::INFINITY, f32::NAN);
    // By hand: the library writes no faces at such positions.
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        positions.len(),
        mesh.triangles().len()
    );
    for [x, y, z] in positions {
        text += &format!("{x} {y} {z}\n");
    }
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|w| mesh.vertex_of(w).index());
        text += &format!("3 {a} {b} {c}\n");
    }
    std::fs::write(&model, text).unwrap();
    let Some(mut window) = AppHarness::within(false, vec![model], folder) else { return };
    let said = window.app().document().problem.clone().unwrap();
    assert!(said.starts_with("2 of 642 vertices"), "{said}");
    window.harness.get_by_label(&said);
    window.picture("infinite");
    let [across, along] = filled(&mut window);
    assert!((0.75..=0.95).contains(&across.max(along)), "{across} x {along}");
    window.press(Key::Minus);
    assert!(window.faces().is_some_and(|n| n < 1270), "{:?}", window.faces());
}

/// A flat plate that stands on its edge if y points up.
fn plate() -> TriMesh {
    let mesh = shapes::torus(64, 32);
    let flat = |p: [f32; 3]| [p[0], p[1], 0.2 * p[2]];
    let Positions::F32(positions) = mesh.positions().clone() else { panic!("single precision") };
    let faces = mesh.triangles().iter().map(|t| t.map(|w| mesh.vertex_of(w))).collect();
    TriMesh::new(Positions::F32(positions.into_iter().map(flat).collect()), faces).unwrap()
}

#[test]
fn an_up_axis_is_guessed_chosen_and_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let (model, memory) = (folder.path().join("plate.stl"), folder.path().join("memory.json"));
    lodsmith_io::write_path(&plate(), &model, &Default::default()).unwrap();
    let Some(mut window) = AppHarness::remembering(model.clone(), memory.clone(), folder) else { return };
    assert_eq!(window.app().document().up(), UpAxis::Z, "the custom of STL");
    let lying = filled(&mut window);
    window.harness.state_mut().document_mut().run(Command::Up(UpAxis::Y));
    window.settle();
    let standing = filled(&mut window);
    assert!(standing[1] > 1.2 * lying[1], "{standing:?} {lying:?}");
    let folder = window.folder;
    let Some(window) = AppHarness::remembering(model, memory, folder) else { return };
    assert_eq!(window.app().document().settings().up, UpAxis::Y);
}

#[test]
fn a_hint_is_shown_once() {
    let folder = tempfile::tempdir().unwrap();
    let (model, memory) = (folder.path().join("ball.ply"), folder.path().join("memory.json"));
    lodsmith_io::write_path(&shapes::icosphere(3), &model, &Default::default()).unwrap();
    let Some(mut window) = AppHarness::remembering(model.clone(), memory.clone(), folder) else { return };
    window.picture("hint");
    window.click("Got it");
    assert!(window.harness.query_by_label("Got it").is_none());
    let folder = window.folder;
    let Some(window) = AppHarness::remembering(model, memory, folder) else { return };
    assert!(window.harness.query_by_label("Got it").is_none());
}

#[test]
fn a_preset_is_one_click_and_everything_else_is_folded() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    assert!(window.harness.query_by_role_and_label(Role::ComboBox, "Placement").is_none());
    for (name, preset) in
        [("Scan", "scan"), ("CAD", "cad"), ("Visual", "visual"), ("Print", "print"), ("Auto", "auto")]
    {
        window.click(name);
        assert_eq!(window.app().document().settings().simplify.preset.name(), preset);
    }
    window.harness.get_by_label("Advanced").click();
    window.settle();
    window.harness.get_by_role_and_label(Role::ComboBox, "Placement");
    window.picture("advanced");
}

#[test]
fn escape_closes_a_list_and_nothing_else() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.harness.get_by_label("File").click();
    window.harness.run_steps(3);
    assert!(window.harness.query_by_label("Open recent").is_some());
    window.harness.key_press(Key::Escape);
    window.harness.run_steps(3);
    assert!(window.harness.query_by_label("Open recent").is_none());
}

#[test]
fn the_detail_is_dragged_with_either_key() {
    for modifiers in [Modifiers::ALT, Modifiers::COMMAND] {
        let Some(mut window) = AppHarness::open("sphere.ply") else { return };
        let place = window.harness.get_by_label(ORIGINAL).rect().center();
        let before = window.app().orbits();
        window.drag_with(modifiers, place, place + egui::vec2(0.0, 80.0));
        assert!(window.faces().is_some_and(|n| n < 15_000), "{modifiers:?}: {:?}", window.faces());
        assert_eq!(window.app().orbits(), before);
    }
}

#[test]
fn the_light_is_dragged_in_the_picture() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    let place = window.harness.get_by_label(ORIGINAL).rect().center();
    let (before, pixels) = (window.app().orbits(), window.pixels(ORIGINAL));
    window.drag_with(Modifiers::COMMAND | Modifiers::SHIFT, place, place + egui::vec2(90.0, 0.0));
    let look = window.app().document().settings().look.clone();
    assert!(
        (look.lamp.unwrap().azimuth_deg - look.rig.lamp().azimuth_deg - 36.0).abs() < 1.0,
        "{:?}",
        look.lamp
    );
    assert_eq!(window.app().orbits(), before);
    assert!(window.pixels(ORIGINAL) != pixels);
    window.picture("light");
}

#[test]
fn borders_and_defects_are_seen_counted_and_visited() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("open.ply");
    let ball = shapes::icosphere(4);
    let Positions::F32(positions) = ball.positions().clone() else { panic!("single precision") };
    let mut faces: Vec<[VertexId; 3]> =
        ball.triangles().iter().map(|t| t.map(|w| ball.vertex_of(w))).collect();
    // A hole, and a face on an edge that has two already.
    faces.remove(200);
    let [a, b, _] = faces[100];
    let third = faces[101].into_iter().find(|v| *v != a && *v != b).unwrap();
    faces.push([a, b, third]);
    let mesh = TriMesh::new(Positions::F32(positions), faces).unwrap();
    lodsmith_io::write_path(&mesh, &model, &Default::default()).unwrap();
    let Some(mut window) = AppHarness::within(false, vec![model], folder) else { return };
    let red = |window: &mut AppHarness| {
        let marked = |p: &&[u8; 4]| p[0] > 200 && p[1] < 110 && p[2] < 90;
        window.pixels(ORIGINAL).iter().filter(marked).count()
    };
    assert_eq!(red(&mut window), 0);
    window.press(Key::B);
    window.press(Key::X);
    let flaws = window.app().document().flaws()[0].unwrap().clone();
    assert!(flaws.counts[0] >= 3 && flaws.counts[1] >= 1, "{:?}", flaws.counts);
    let before = window.app().orbits()[0];
    let mut most_red = 0;
    for n in 1..=flaws.places.len() {
        window.press_with(Modifiers::SHIFT, Key::X);
        assert!(window.app().orbits()[0].distance < 0.5 * before.distance);
        window.harness.get_by_label(&format!("{n} of {} places", flaws.places.len()));
        window.picture(&format!("flaw_{n}"));
        most_red = most_red.max(red(&mut window));
    }
    assert!(most_red > 100, "borders are seen: {most_red} pixels");
    assert!(!window.pixels(RESULT).is_empty());
}

#[test]
fn texts_do_not_overlap() {
    for is_light in [false, true] {
        for size in [[1440.0, 900.0], [1280.0, 720.0], [900.0, 600.0]] {
            let Some(mut window) = AppHarness::with(is_light, Some(Path::new("torus.obj"))) else { return };
            window.harness.set_size(size.into());
            window.settle();
            let check = |window: &mut AppHarness, state: &str| {
                let found = overlaps(window);
                assert!(found.is_empty(), "{size:?} {state}: {found:#?}");
            };
            check(&mut window, "opened");
            window.press(Key::Minus);
            check(&mut window, "reduced");
            window.picture(&format!("text_{}_{}", size[0], if is_light { "light" } else { "dark" }));
            window.press(Key::B);
            window.press(Key::F2);
            check(&mut window, "borders, files");
            window.press(Key::A);
            check(&mut window, "levels");
            window.press(Key::H);
            let found = overlaps_in(&window, "Keys and mouse");
            assert!(found.is_empty(), "{size:?} help: {found:#?}");
            window.picture(&format!("text_help_{}_{}", size[0], if is_light { "light" } else { "dark" }));
        }
    }
}

/// Returns the pairs of texts whose boxes overlap.
fn overlaps(window: &mut AppHarness) -> Vec<String> {
    overlaps_of(&boxes(window))
}

/// Returns the pairs among the texts after a heading: those of a dialog over the window.
fn overlaps_in(window: &AppHarness, heading: &str) -> Vec<String> {
    let all = boxes(window);
    let from = all.iter().position(|b| b.0 == heading).unwrap();
    overlaps_of(&all[from..])
}

/// Returns the texts with their boxes, as far as they are within the window.
fn boxes(window: &AppHarness) -> Vec<(String, egui::Rect)> {
    let screen = window.harness.ctx.content_rect();
    let is_text = |role: Role| {
        matches!(role, Role::Label | Role::Button | Role::CheckBox | Role::TextInput | Role::ComboBox)
    };
    let nodes = window.harness.root().children_recursive();
    let texts = nodes.filter(|n| is_text(n.accesskit_node().role()) && !n.accesskit_node().is_hidden());
    let named = texts.filter_map(|n| {
        let node = n.accesskit_node();
        let text = node.label().or_else(|| node.value()).filter(|t| !t.is_empty())?;
        Some((text, n.rect()))
    });
    named.filter(|(_, rect)| screen.contains_rect(*rect)).collect()
}

fn overlaps_of(boxes: &[(String, egui::Rect)]) -> Vec<String> {
    let mut found = Vec::new();
    for (i, (one, a)) in boxes.iter().enumerate() {
        for (two, b) in &boxes[i + 1..] {
            let both = a.intersect(*b);
            // A button contains its own text.
            let is_within = a.contains_rect(*b) || b.contains_rect(*a);
            if both.width() > 1.5
                && both.height() > 1.5
                && !(is_within && (one == two || one.contains(two.as_str())))
            {
                found.push(format!("{one:?} {a:?} and {two:?} {b:?}"));
            }
        }
    }
    found
}

#[test]
fn another_unit_changes_the_label_and_nothing_else() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.write("Target", "4000");
    window.press(Key::Enter);
    let before = window.app().document().settings().clone();
    let (faces, line) = (window.faces().unwrap(), window.app().command_line());
    let text = |window: &AppHarness| {
        window.harness.get_by_role_and_label(Role::TextInput, "Target").value().unwrap_or_default()
    };
    assert_eq!(text(&window), "4,000");
    // (4,000 of 20,480; vertices are counted, and the largest error was not measured.)
    for (unit, wanted) in [("Percent", "19.5%"), ("Vertices", "2,0"), ("Error", ""), ("Faces", "4,000")] {
        window.click(unit);
        assert!(
            text(&window).starts_with(wanted) && text(&window).is_empty() == wanted.is_empty(),
            "{}",
            text(&window)
        );
        assert_eq!((window.app().document().settings(), window.faces()), (&before, Some(faces)), "{unit}");
        assert_eq!(window.app().command_line(), line);
    }
    // What is typed in another unit is understood, and the slider follows it.
    window.write("Target", "10%");
    window.press(Key::Enter);
    assert_eq!(window.app().document().settings().simplify.options.stop.ratio, Some(0.1));
    assert_eq!(text(&window), "10%");
    assert!(
        window.app().command_line().contains("--ratio 0.1 ")
            || window.app().command_line().ends_with("--ratio 0.1")
    );
    window.write("Target", "2k");
    window.press(Key::Enter);
    assert_eq!(window.app().document().settings().simplify.options.stop.faces, Some(2000));
    assert_eq!(text(&window), "2,000");
}

#[test]
fn a_broken_file_is_marked_and_the_next_one_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let [broken, sound] = ["broken.off", "sound.ply"].map(|name| folder.path().join(name));
    std::fs::write(&broken, "").unwrap();
    lodsmith_io::write_path(&shapes::icosphere(3), &sound, &Default::default()).unwrap();
    let Some(mut window) = AppHarness::within(false, vec![broken, sound.clone()], folder) else { return };
    assert_eq!(window.app().document().original().unwrap().content.path, sound);
    assert!(window.app().document().problem.as_ref().is_some_and(|p| p.contains("broken.off")));
    if !window.app().is_shown(lodsmith_viewer::panel::Panel::Files) {
        window.act(lodsmith_viewer::panel::keys::Action::Panel(lodsmith_viewer::panel::Panel::Files));
    }
    window.harness.get_by_label("broken.off (cannot be read)");
    window.picture("files_broken");
    window.act(lodsmith_viewer::panel::keys::Action::Close);
    assert!(window.app().document().original().is_none(), "the other one cannot be read");
    window.harness.get_by_label("Drop a model here");
}

#[test]
fn a_session_of_two_folders_is_opened_after_a_question() {
    let [one, two] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let models = [one.path().join("here.ply"), two.path().join("there.ply")];
    for model in &models {
        lodsmith_io::write_path(&shapes::icosphere(3), model, &Default::default()).unwrap();
    }
    let settings = lodsmith_viewer::settings::Settings { files: models.to_vec(), ..Default::default() };
    let pose = lodsmith_viewer::settings::Pose {
        eye: [3.0; 3],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y_rad: 0.6,
    };
    let session = one.path().join("work.lodsmith.json");
    lodsmith_viewer::settings::session::Session::new(settings, [pose; 2]).save(&session).unwrap();
    for answer in ["Cancel", "Open anyway"] {
        let folder = tempfile::tempdir().unwrap();
        let Some(mut window) = AppHarness::within(false, vec![session.clone()], folder) else { return };
        assert!(window.app().document().original().is_none());
        window.harness.get_by_label_contains("there.ply");
        window.picture("session_outside");
        window.click(answer);
        let document = window.app().document();
        assert_eq!(document.original().is_some(), answer == "Open anyway");
        assert_eq!(document.settings().files.len(), if answer == "Cancel" { 0 } else { 2 });
        assert_eq!(document.problem, None);
        assert!(window.harness.query_by_label_contains("there.ply").is_none() || answer != "Cancel");
    }
}
