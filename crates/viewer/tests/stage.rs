//! The Stage: copies by commands without a window, and then with one, by mouse, keys and panel.
//!
//! With `LODSMITH_PICTURES=FOLDER` each picture is kept there, to be looked at.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, Modifiers, Pos2, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use lodsmith_core::shapes;
use lodsmith_viewer::ViewOptions;
use lodsmith_viewer::app::App;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::document::Document;
use lodsmith_viewer::gpu::{Context, Gpu};
use lodsmith_viewer::keys::{Action, CopiesAction};
use lodsmith_viewer::panel::Panel;
use lodsmith_viewer::stage::file::LayoutFile;
use lodsmith_viewer::stage::scatter::Scatter;
use lodsmith_viewer::stage::{Placement, StageChange, View};

const LONG: Duration = Duration::from_secs(120);
const PICTURE: &str = "Picture of the stage";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, mesh) in [("sphere.ply", shapes::icosphere(5)), ("torus.obj", shapes::torus(48, 24))] {
        lodsmith_io::write_path(&mesh, &folder.path().join(name), &Default::default()).unwrap();
    }
    folder
}

fn opened(path: &Path) -> Document {
    let mut document = Document::new(None, || {});
    document.run(Command::Open(vec![path.to_owned()]));
    assert!(document.settle(LONG), "opening never ends");
    document
}

fn row(count: usize) -> Vec<Placement> {
    (0..count).map(|k| Placement::at(3.0 * k as f64, 0.0)).collect()
}

#[test]
fn changes_of_the_stage_replay_and_are_taken_back() {
    let folder = folder();
    let changes = vec![
        StageChange::Show(true),
        StageChange::Add(row(3)),
        StageChange::Move(vec![(1, Placement { turn_deg: 45.0, ..Placement::at(9.0, 9.0) })]),
        StageChange::Delete(vec![0]),
        StageChange::View(View { pixels: 2.0, has_level_colors: true, ..View::default() }),
        StageChange::Scatter(Scatter { count: 40, footprint: 1.5, ..Scatter::default() }),
    ];
    let commands: Vec<_> = changes.into_iter().map(Command::Stage).collect();
    let text = serde_json::to_string(&commands).unwrap();
    let read: Vec<Command> = serde_json::from_str(&text).unwrap();
    assert_eq!(read, commands);
    let mut ends = Vec::new();
    for list in [commands, read] {
        let mut document = opened(&folder.path().join("sphere.ply"));
        let mut seen = vec![document.settings().clone()];
        for command in list {
            document.run(command);
            document.seal();
            seen.push(document.settings().clone());
        }
        assert!(document.settle(LONG));
        assert_eq!(document.settings().stage.copies.len(), 40);
        for before in seen.iter().rev().skip(1) {
            document.undo();
            assert_eq!(document.settings(), before);
        }
        for after in &seen[1..] {
            document.redo();
            assert_eq!(document.settings(), after);
        }
        ends.push(document.settings().stage.clone());
    }
    assert_eq!(ends[0], ends[1], "the same numbers place the same copies");
}

#[test]
fn a_stage_has_levels_while_it_is_shown() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    assert_eq!(document.stage_levels().len(), 1, "the original alone");
    document.run(Command::Stage(StageChange::Show(true)));
    assert!(document.awaits_levels());
    assert!(document.settle(LONG));
    let levels: Vec<_> = document.stage_levels().iter().map(|l| l.level).collect();
    assert!(levels.len() >= 6, "{levels:?}");
    assert_eq!((levels[0].error, levels[0].faces), (0.0, 20_480));
    assert!(levels.windows(2).all(|w| w[1].faces < w[0].faces && w[1].error > w[0].error));
    assert!(document.levels().is_empty(), "the two sides show what was asked for");
    // Another model has other copies.
    document.run(Command::Open(vec![folder.path().join("torus.obj")]));
    assert!(document.settle(LONG));
    assert!(document.stage().is_none() && document.settings().stage.copies.is_empty());
}

/// The faces that a glTF file shows, and those of all its levels by node.
fn read_stage(path: &Path) -> (usize, Vec<usize>) {
    let read = lodsmith_io::read_path(path, &Default::default()).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let nodes = json["nodes"].as_array().unwrap();
    let levels = nodes.iter().filter_map(|n| n["extensions"]["MSFT_lod"]["ids"].as_array().map(Vec::len));
    (read.mesh.face_count(), levels.collect())
}

#[test]
fn a_stage_is_exported_as_copies_that_share_levels() {
    let wave: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/wave.glb"].iter().collect();
    let folder = folder();
    for (k, model) in
        [folder.path().join("sphere.ply"), folder.path().join("torus.obj"), wave].iter().enumerate()
    {
        let mut document = opened(model);
        let faces = document.original().unwrap().content.faces;
        document.run(Command::Stage(StageChange::Add(row(5))));
        // Levels that the stage has are used; where it has none yet, they are made.
        document.run(Command::Stage(StageChange::Show(k != 1)));
        assert!(document.settle(LONG));
        let path = folder.path().join(format!("stage{k}.glb"));
        document.export_stage(path.clone(), 0.6);
        assert!(document.settle(LONG));
        assert_eq!(document.problem, None);
        let (shown, levels) = read_stage(&path);
        assert_eq!(shown, 5 * faces, "{}", model.display());
        assert!(levels.len() >= 5 && levels.iter().all(|n| *n >= 1), "{levels:?}");
        let alone = std::fs::metadata(&path).unwrap().len();
        document.run(Command::Stage(StageChange::Add(row(100))));
        document.export_stage(path.clone(), 0.6);
        assert!(document.settle(LONG));
        let many = std::fs::metadata(&path).unwrap().len();
        assert!(many < alone + 100 * 4000, "{many} of {alone}: copies share meshes");
    }
}

#[test]
fn an_empty_stage_is_not_written() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    let path = folder.path().join("none.glb");
    document.export_stage(path.clone(), 0.6);
    assert!(document.settle(LONG));
    assert!(document.problem.as_deref().is_some_and(|p| p.contains("no copy")), "{:?}", document.problem);
    assert!(!path.exists());
}

/// Whether there is an adapter; where one is demanded, there must be.
fn has_adapter() -> bool {
    match Gpu::headless() {
        Ok(_) => true,
        Err(e) if std::env::var_os("LODSMITH_REQUIRE_GPU").is_some_and(|v| v == "1") => {
            unreachable!("an adapter is demanded: {e}")
        }
        Err(e) => {
            let _ = std::io::Write::write_all(&mut std::io::stderr(), format!("SKIPPED: {e}\n").as_bytes());
            false
        }
    }
}

struct Desk {
    harness: Harness<'static, App>,
    folder: tempfile::TempDir,
}

impl Desk {
    fn open(is_light: bool, name: Option<&str>) -> Option<Self> {
        let folder = folder();
        let inputs = name.map(|n| folder.path().join(n)).into_iter().collect();
        Self::with(is_light, inputs, folder)
    }

    fn with(is_light: bool, inputs: Vec<PathBuf>, folder: tempfile::TempDir) -> Option<Self> {
        if !has_adapter() {
            return None;
        }
        let mut options = ViewOptions { inputs, ..ViewOptions::default() };
        (options.remember, options.use_system_dialogs) = (false, false);
        options.is_light = Some(is_light);
        let harness = Harness::builder()
            .with_size(egui::vec2(1440.0, 900.0))
            .with_step_dt(0.05)
            .with_theme(if is_light { egui::Theme::Light } else { egui::Theme::Dark })
            .wgpu_setup(Context::setup())
            .build_eframe(move |cc| App::new(cc, &options).unwrap());
        let mut desk = Self { harness, folder };
        desk.settle();
        Some(desk)
    }

    /// A window whose stage holds these copies.
    fn staged(is_light: bool, copies: Vec<Placement>) -> Option<Self> {
        let mut desk = Self::open(is_light, Some("sphere.ply"))?;
        desk.run(StageChange::Replace(copies.into()));
        desk.press(Key::Y);
        Some(desk)
    }

    fn settle(&mut self) {
        let end = Instant::now() + LONG;
        loop {
            self.harness.run_steps(2);
            let document = self.harness.state_mut().document_mut();
            if document.settle(Duration::from_millis(50)) {
                self.harness.run_steps(3);
                if self.harness.state().document().is_idle() {
                    return;
                }
            }
            assert!(Instant::now() < end, "work never ends");
        }
    }

    fn run(&mut self, change: StageChange) {
        self.harness.state_mut().document_mut().run(Command::Stage(change));
        self.harness.state_mut().document_mut().seal();
        self.settle();
    }
    fn app(&self) -> &App {
        self.harness.state()
    }
    fn copies(&self) -> Vec<Placement> {
        self.app().document().settings().stage.copies.to_vec()
    }
    fn selected(&self) -> Vec<usize> {
        self.app().stage_view().facts().selected
    }
    fn press(&mut self, key: Key) {
        self.harness.key_press(key);
        self.settle();
    }
    fn press_with(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.settle();
    }
    /// Presses the key of an action.
    fn act(&mut self, action: Action) {
        let shortcut = action.binding().unwrap().shortcut;
        self.press_with(shortcut.modifiers, shortcut.logical_key);
    }
    fn button(&mut self, label: &str) {
        self.harness.get_by_role_and_label(Role::Button, label).click();
        self.settle();
    }
    fn middle(&self) -> Pos2 {
        self.harness.get_by_label(PICTURE).rect().center()
    }
    fn click(&mut self, at: Pos2) {
        self.harness.drag_at(at);
        self.harness.run_steps(1);
        self.harness.drop_at(at);
        // A second click soon after would be a double one.
        self.harness.run_steps(10);
        self.settle();
    }
    fn drag(&mut self, from: Pos2, to: Pos2) {
        self.harness.drag_at(from);
        self.harness.run_steps(2);
        for i in 1..=4 {
            self.harness.hover_at(from + (to - from) * (i as f32 / 4.0));
            self.harness.run_steps(1);
        }
        self.harness.drop_at(to);
        self.settle();
    }
    fn picture(&mut self, name: &str) -> image::RgbaImage {
        let picture = self.harness.render().unwrap();
        if let Some(folder) = std::env::var_os("LODSMITH_PICTURES") {
            picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
        }
        picture
    }
}

#[test]
fn without_a_file_the_stage_says_what_to_do() {
    let Some(mut desk) = Desk::open(false, None) else { return };
    desk.press(Key::Y);
    assert!(desk.app().document().stage().is_none());
    desk.act(Action::Panel(Panel::Stage));
    desk.harness.get_by_label("open a file to place copies of it");
    desk.picture("stage_no_file");
}

#[test]
fn clicks_place_choose_and_move_copies() {
    let Some(mut desk) = Desk::open(false, Some("sphere.ply")) else { return };
    desk.press(Key::Y);
    assert!(desk.app().is_shown(Panel::Stage) && desk.app().stage_view().facts().is_placing);
    desk.picture("stage_empty_dark");
    let middle = desk.middle();
    desk.click(middle);
    desk.click(middle + egui::vec2(230.0, 40.0));
    let placed = desk.copies();
    assert_eq!(placed.len(), 2);
    assert_eq!(desk.selected(), [1]);
    assert!(placed[1].x > placed[0].x + 0.5, "{placed:?}");
    // A click beside all chooses none, one on a copy that, and with Shift one more.
    desk.act(Action::Copies(CopiesAction::Place));
    assert!(!desk.app().stage_view().facts().is_placing);
    desk.click(middle + egui::vec2(-300.0, 200.0));
    assert!(desk.selected().is_empty());
    let first = middle - egui::vec2(0.0, 30.0);
    desk.click(first);
    assert_eq!(desk.selected(), [0]);
    assert_eq!(desk.copies().len(), 2, "no copy was placed");
    // A drag moves what is chosen, as one step.
    let orbit = desk.app().stage_view().orbit();
    desk.drag(first, first + egui::vec2(-120.0, 60.0));
    let moved = desk.copies();
    assert_eq!(desk.app().stage_view().orbit(), orbit, "the camera stays");
    assert!(moved[0].z > placed[0].z + 0.5 && moved[1] == placed[1], "{placed:?} {moved:?}");
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.copies(), placed);
    // Beside all, the camera turns.
    let aside = middle + egui::vec2(-300.0, 200.0);
    desk.drag(aside, aside + egui::vec2(80.0, 0.0));
    assert_ne!(desk.app().stage_view().orbit(), orbit);
    assert_eq!(desk.copies(), placed);
}

#[test]
fn keys_change_the_chosen_copies() {
    let Some(mut desk) = Desk::staged(true, row(3)) else { return };
    let copies = |a: CopiesAction| Action::Copies(a);
    desk.act(copies(CopiesAction::All));
    assert_eq!(desk.selected(), [0, 1, 2]);
    desk.picture("stage_chosen_light");
    desk.act(copies(CopiesAction::Turn(1)));
    desk.act(copies(CopiesAction::Scale(1)));
    assert!(desk.copies().iter().all(|c| (c.turn_deg, c.scale) == (15.0, 1.1)));
    desk.act(copies(CopiesAction::Scale(-1)));
    assert!(desk.copies().iter().all(|c| (c.scale - 1.0).abs() < 1e-12));
    desk.act(copies(CopiesAction::Duplicate));
    assert_eq!((desk.copies().len(), desk.selected()), (6, vec![3, 4, 5]));
    desk.press(Key::Backspace);
    assert_eq!((desk.copies().len(), desk.selected()), (3, vec![]));
    desk.act(copies(CopiesAction::Delete));
    assert_eq!(desk.copies().len(), 3, "nothing is chosen");
    desk.act(copies(CopiesAction::Scatter));
    let scattered = desk.copies();
    assert_eq!(scattered.len(), Scatter::default().count);
    desk.act(copies(CopiesAction::Scatter));
    assert_ne!(desk.copies(), scattered);
    desk.press_with(Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.copies(), scattered);
    desk.act(copies(CopiesAction::Colors));
    assert!(desk.app().document().settings().stage.view.has_level_colors);
    desk.picture("stage_colors_light");
    desk.press(Key::Y);
    assert!(desk.app().document().stage().is_none());
    desk.harness.get_by_label("Picture of the result");
}

#[test]
fn the_panel_scatters_and_moves_and_shows_the_levels() {
    let Some(mut desk) = Desk::staged(false, row(2)) else { return };
    desk.button("Scatter");
    assert_eq!(desk.copies().len(), 100);
    let field = desk.harness.get_by_label("Copies to scatter");
    field.focus();
    desk.harness.run_steps(2);
    desk.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.harness.event(egui::Event::Text("12".to_owned()));
    desk.harness.run_steps(2);
    desk.press(Key::Enter);
    assert_eq!(desk.copies().len(), 100, "until it is pressed");
    desk.button("Scatter");
    assert_eq!(desk.copies().len(), 12);
    desk.button("All");
    assert_eq!(desk.selected().len(), 12);
    let levels = desk.app().stage_view().facts().levels;
    assert!(levels.len() >= 6 && levels.windows(2).all(|w| w[0].distance < w[1].distance), "{levels:?}");
    assert_eq!(
        levels.iter().map(|l| l.copies).sum::<usize>(),
        desk.app().stage_view().facts().chosen.in_sight.len()
    );
    desk.picture("stage_panel_dark");
    desk.button("Delete");
    assert!(desk.copies().is_empty());
}

#[test]
fn one_walks_by_keys_and_levels_switch_by_distance() {
    let copies = (0..30).map(|k| Placement::at(0.0, -4.0 * f64::from(k))).collect();
    let Some(mut desk) = Desk::staged(false, copies) else { return };
    desk.run(StageChange::View(View { has_level_colors: true, ..View::default() }));
    desk.press(Key::Num1);
    desk.press(Key::I);
    assert!(desk.app().stage_view().facts().is_walking);
    let eye = |desk: &Desk| desk.app().stage_view().orbit().camera().eye;
    // The sphere is 2 high.
    assert!((eye(&desk).y - 1.2).abs() < 1e-9, "{}", eye(&desk));
    let (start, look) = (eye(&desk), desk.app().document().settings().look.clone());
    let counts =
        |desk: &Desk| desk.app().stage_view().facts().levels.iter().map(|l| l.copies).collect::<Vec<_>>();
    let (before, picture) = (counts(&desk), desk.picture("stage_walk_start"));
    desk.harness.key_down(Key::W);
    desk.harness.run_steps(40);
    desk.harness.key_up(Key::W);
    desk.settle();
    assert!(eye(&desk).z < start.z - 3.0, "{} {start}", eye(&desk));
    assert_eq!(desk.app().document().settings().look, look, "W is no wireframe while one walks");
    assert_ne!(counts(&desk), before);
    assert_ne!(desk.picture("stage_walk_dark"), picture);
    let middle = desk.middle();
    let yaw = desk.app().stage_view().orbit().yaw_rad;
    let stood = eye(&desk);
    desk.drag(middle, middle + egui::vec2(100.0, 0.0));
    assert!(eye(&desk).distance(stood) < 1e-9 && desk.app().stage_view().orbit().yaw_rad != yaw);
    desk.press(Key::Escape);
    assert!(!desk.app().stage_view().facts().is_walking);
    desk.press(Key::W);
    assert!(desk.app().document().settings().look.look.wireframe);
}

#[test]
fn the_sample_stands_on_a_stage_in_the_colours_of_its_levels() {
    let sample: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/finial.ply"].iter().collect();
    let Some(mut desk) = Desk::with(false, vec![sample], folder()) else { return };
    desk.press(Key::Y);
    desk.act(Action::Copies(CopiesAction::Scatter));
    desk.act(Action::Copies(CopiesAction::Colors));
    desk.press(Key::I);
    let facts = desk.app().stage_view().facts();
    let used = facts.levels.iter().filter(|l| l.copies > 0).count();
    assert!(used >= 4, "{:?}", facts.levels);
    assert!(facts.chosen.triangles < 100 * facts.levels[0].faces / 10);
    // The picture of docs/viewer.md.
    let dark = desk.picture("stage");
    desk.press_with(Modifiers::COMMAND, Key::T);
    assert_ne!(desk.picture("stage_sample_light"), dark);
}

#[test]
fn a_layout_and_a_session_come_back() {
    let copies =
        vec![Placement { turn_deg: 30.0, scale: 1.5, ..Placement::at(-2.0, 1.0) }, Placement::at(2.0, 0.0)];
    let Some(mut desk) = Desk::staged(false, copies.clone()) else { return };
    desk.button("Save…");
    desk.press(Key::Enter);
    let layout = desk.folder.path().join("sphere_stage.json");
    assert_eq!(*LayoutFile::open(&layout).unwrap().0, copies);
    desk.act(Action::Copies(CopiesAction::All));
    desk.press(Key::Delete);
    assert!(desk.copies().is_empty());
    desk.harness.state_mut().document_mut().run(Command::Stage(StageChange::Show(false)));
    // Opened as any file is.
    desk.press_with(Modifiers::COMMAND, Key::O);
    desk.harness.get_by_role_and_label(Role::TextInput, "Path").focus();
    desk.harness.run_steps(2);
    desk.harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.harness.event(egui::Event::Text(layout.display().to_string()));
    desk.harness.run_steps(2);
    desk.press(Key::Enter);
    assert_eq!(desk.copies(), copies);
    assert!(desk.app().document().stage().is_some());

    desk.press(Key::Num7);
    let orbit = desk.app().stage_view().orbit();
    desk.press_with(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
    desk.press(Key::Enter);
    let session = desk.folder.path().join("sphere.lodsmith.json");
    let Some(again) = Desk::with(false, vec![session], desk.folder) else { return };
    assert_eq!(again.copies(), copies);
    assert!(again.app().document().stage().is_some());
    let back = again.app().stage_view().orbit();
    assert!((back.pitch_rad - orbit.pitch_rad).abs() < 1e-6 && (back.distance - orbit.distance).abs() < 1e-6);
}

#[test]
fn the_stage_is_written_from_its_panel() {
    let Some(mut desk) = Desk::staged(false, row(4)) else { return };
    desk.button("Export…");
    desk.press(Key::Enter);
    let (shown, levels) = read_stage(&desk.folder.path().join("sphere_stage.glb"));
    assert_eq!((shown, levels.len()), (4 * 20_480, 4));
}

#[test]
fn nothing_is_drawn_while_nobody_moves() {
    let Some(mut desk) = Desk::staged(false, row(5)) else { return };
    desk.press(Key::I);
    assert!(desk.harness.try_run().is_ok());
}
