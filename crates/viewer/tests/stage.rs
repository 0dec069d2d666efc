//! Commands of the stage, without a window: copies, keyframes, levels, and their files.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use lodsmith_core::shapes;
use lodsmith_io::AssetScope;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::settings::playback::Playback;
use lodsmith_viewer::settings::session::Session;
use lodsmith_viewer::settings::{Pose, Turn};
use lodsmith_viewer::stage::motion::{CameraPlacement, Curve, Motion, Mover};
use lodsmith_viewer::stage::scatter::Scatter;
use lodsmith_viewer::stage::{Placement, StageChange, StageDisplay};

use crate::documents::{TIMEOUT, folder_with, opened};

fn folder() -> tempfile::TempDir {
    folder_with([("sphere.ply", shapes::icosphere(5)), ("torus.obj", shapes::torus(48, 24))])
}

fn row(count: usize) -> Vec<Placement> {
    (0..count).map(|k| Placement::at(3.0 * k as f64, 0.0)).collect()
}

/// The second copy moves there and back and rotates, and the camera approaches.
fn round() -> Motion {
    Motion::default().with(|m| {
        let track = m.copies.entry(1).or_default();
        for (secs, x, turn_deg, scale) in
            [(0.0, 3.0, 0.0, 1.0), (2.0, 9.0, 170.0, 2.0), (4.0, 3.0, 300.0, 1.0)]
        {
            track.set(secs, Placement { turn_deg, scale, ..Placement::at(x, -x) });
        }
        let stand = |z: f64, yaw_deg: f64| CameraPlacement {
            x: 0.0,
            y: 2.0,
            z,
            yaw_deg,
            pitch_deg: -10.0,
            distance: z,
        };
        m.camera.set(0.0, stand(20.0, 0.0));
        m.camera.set(4.0, stand(8.0, 40.0));
    })
}

#[test]
fn changes_of_the_stage_replay_and_are_undone() {
    let folder = folder();
    let changes = vec![
        StageChange::Show(true),
        StageChange::Add(row(3)),
        StageChange::Move {
            copies: vec![(1, Placement { turn_deg: 45.0, ..Placement::at(9.0, 9.0) })],
            secs: 0.0,
        },
        StageChange::Motion(round()),
        StageChange::Move { copies: vec![(1, Placement::at(7.0, 7.0))], secs: 1.0 },
        StageChange::Duplicate { numbers: vec![1], aside: 2.0 },
        StageChange::Delete(vec![0]),
        StageChange::Motion(round().with(|m| m.set_curve(Mover::Camera, Curve::Step))),
        StageChange::View(StageDisplay { pixels: 2.0, has_level_colors: true, ..StageDisplay::default() }),
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
        assert!(document.settle(TIMEOUT));
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
    assert!(document.settle(TIMEOUT));
    let levels: Vec<_> = document.stage_levels().iter().map(|l| l.level).collect();
    assert!(levels.len() >= 6, "{levels:?}");
    assert_eq!((levels[0].error, levels[0].faces), (0.0, 20_480));
    assert!(levels.windows(2).all(|w| w[1].faces < w[0].faces && w[1].error > w[0].error));
    assert!(document.levels().is_empty(), "the two sides show what was asked for");
    // Opening another model does not change the stage, which has no copies yet.
    document.run(Command::Open(vec![folder.path().join("torus.obj")]));
    assert!(document.settle(TIMEOUT));
    assert!(document.settings().stage.copies.is_empty());
}

/// Returns the number of faces of a glTF file, and the number of levels of each node that has any.
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
        // Existing levels are used; the others are made during export.
        document.run(Command::Stage(StageChange::Show(k != 1)));
        assert!(document.settle(TIMEOUT));
        let path = folder.path().join(format!("stage{k}.glb"));
        document.export_stage(path.clone(), 0.6);
        assert!(document.settle(TIMEOUT));
        assert_eq!(document.problem, None);
        let (shown, levels) = read_stage(&path);
        assert_eq!(shown, 5 * faces, "{}", model.display());
        assert!(levels.len() >= 5 && levels.iter().all(|n| *n >= 1), "{levels:?}");
        let alone = std::fs::metadata(&path).unwrap().len();
        document.run(Command::Stage(StageChange::Add(row(100))));
        document.export_stage(path.clone(), 0.6);
        assert!(document.settle(TIMEOUT));
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
    assert!(document.settle(TIMEOUT));
    assert!(document.problem.as_deref().is_some_and(|p| p.contains("no copy")), "{:?}", document.problem);
    assert!(!path.exists());
}

#[test]
fn the_time_moves_the_copies_and_loops() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    document.play(true);
    assert!(!document.is_playing(), "nothing moves yet");
    document.run(Command::Stage(StageChange::Add(row(2))));
    document.run(Command::Stage(StageChange::Motion(round())));
    assert!(document.settle(TIMEOUT));
    assert!(document.stage().is_none() && document.timeline_secs() == 0.0);
    document.run(Command::Stage(StageChange::Show(true)));
    assert_eq!((document.timeline_secs(), document.moment()), (10.0, 0.0), "room for more keyframes");
    document.run(Command::Stage(StageChange::Motion(round().with(|m| m.length_secs = Some(4.0)))));
    document.play(true);
    document.advance_playback(1.0);
    let now = document.current_placements();
    assert_eq!(now[0], Placement::at(0.0, 0.0));
    assert!((now[1].x - 6.0).abs() < 0.8 && now[1].turn_deg > 60.0 && now[1].scale > 1.3, "{now:?}");
    document.advance_playback(4.0);
    assert!(document.is_playing() && document.current_placements() == now, "again from the begin");
    document.run(Command::Playback(Playback {
        seconds: 3.5,
        repeats: false,
        ..document.settings().playback
    }));
    document.advance_playback(2.0);
    assert!(!document.is_playing() && document.moment() == 4.0, "once is once");
    // The session stores all of it.
    let path = folder.path().join("s.json");
    let pose = Pose { eye: [1.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 };
    Session::new(document.settings().clone(), [pose; 2]).save(&path).unwrap();
    let back = Session::open(&path, &AssetScope::Anywhere).unwrap();
    assert_eq!(back.settings.stage, document.settings().stage);
    // A session saved before keyframes existed has none.
    let text = std::fs::read_to_string(&path).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    json["settings"]["stage"].as_object_mut().unwrap().remove("motion").unwrap();
    std::fs::write(&path, json.to_string()).unwrap();
    let older = Session::open(&path, &AssetScope::Anywhere).unwrap();
    assert!(older.settings.stage.motion.is_empty() && older.settings.stage.copies.len() == 2);
}

#[test]
fn motion_of_the_stage_is_written_to_its_file() {
    let arm: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/arm.glb"].iter().collect();
    let folder = folder();
    for (k, file) in [folder.path().join("sphere.ply"), arm].iter().enumerate() {
        let mut document = opened(file);
        let clips = document.original().unwrap().content.model().animations.len();
        document.run(Command::Turn(Turn(DQuat::from_rotation_x(-1.2).to_array())));
        document.run(Command::Stage(StageChange::Add(row(3))));
        document.run(Command::Stage(StageChange::Motion(round())));
        document.run(Command::Stage(StageChange::Show(true)));
        assert!(document.settle(TIMEOUT));
        let path = folder.path().join(format!("moving{k}.glb"));
        document.export_stage(path.clone(), 0.6);
        assert!(document.settle(TIMEOUT));
        assert_eq!(document.problem, None);
        let base = document.stage_base().unwrap();
        let stage = &document.settings().stage;
        let read = lodsmith_io::read_model_path(&path, &Default::default()).unwrap().model;
        assert_eq!(read.animations.len(), clips + 1);
        assert_eq!(read.animations[clips].name, "stage");
        for secs in [0.0, 0.7, 2.0, 3.1, 4.0, 5.0] {
            let pose = read.pose(clips, secs);
            let world = read.world_from_nodes(&pose);
            let copies = stage.copies_at(secs);
            let node = |name: &str| world[read.nodes.iter().position(|n| n.name == name).unwrap()];
            for (n, name) in ["copy_1", "copy_2", "copy_3"].iter().enumerate() {
                let off = (node(name) - base.stage_from(&copies[n])).to_cols_array();
                let off = off.iter().fold(0f64, |m, x| m.max(x.abs()));
                assert!(off < 2e-5 * base.length().max(1.0), "{secs} s, {name}: {off}");
            }
            let (stand, camera) = (stage.motion.camera.at(secs).unwrap(), node("camera"));
            let ahead = camera.transform_vector3(DVec3::NEG_Z);
            let (yaw, pitch) = (stand.yaw_deg.to_radians(), stand.pitch_deg.to_radians());
            let wanted = DVec3::new(-yaw.sin() * pitch.cos(), pitch.sin(), -yaw.cos() * pitch.cos());
            assert!(ahead.distance(wanted) < 1e-4 && (camera.w_axis.z - stand.z).abs() < 1e-5, "{secs} s");
        }
        if let Some(kept) = std::env::var_os("LODSMITH_PICTURES") {
            std::fs::copy(&path, Path::new(&kept).join(format!("moving{k}.glb"))).unwrap();
        }
    }
}
