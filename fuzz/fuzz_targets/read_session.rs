//! Reads untrusted bytes as a session of the viewer, as a layout of its stage and as its saved window state: each is
//! read or refused, never a panic. A session refers to no file outside its folder, all copies have finite positions at
//! all times, and a saved session can be read again.
#![no_main]

use std::fs;
use std::path::{Component, Path, PathBuf};

use lodsmith::{MethodKind, simplify};
use lodsmith_core::{Bounds, shapes};
use lodsmith_io::AssetScope;
use lodsmith_viewer::view::orbit::Orbit;
use lodsmith_viewer::settings::session::{ViewerPrefs, Session};
use lodsmith_viewer::settings::{Pose, Turn};
use lodsmith_viewer::stage::file::LayoutFile;
use lodsmith_viewer::stage::levels::{LevelSelector, Viewpoint, LodLevel};
use lodsmith_viewer::stage::scatter::Scatter;
use lodsmith_viewer::stage::{ModelBase, MAX_COPIES, SCALE_RANGE, Stage};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("the folder is created");
    let path = folder.path().join("in.json");
    let again = folder.path().join("out.json");
    fs::write(&path, bytes).expect("the file is written");

    ViewerPrefs::load(&path).add_recent(&path);

    let layout = LayoutFile::open(&path);
    assert!(layout.is_err() || LayoutFile::is_layout(&path));
    if let Ok((copies, motion, _)) = layout {
        assert!(motion.copies.keys().all(|n| *n < copies.len()), "keyframes of a missing copy");
        let stage = Stage { copies, motion, ..Stage::default() };
        evaluate_stage(&stage, Turn::default(), None);
        LayoutFile::new(&path, &stage).save(&again).expect("the file is written");
        let (copies, motion, lost) = LayoutFile::open(&again).expect("written files can be read");
        assert_eq!(
            (copies.len(), motion.copies.len(), lost),
            (stage.copies.len(), stage.motion.copies.len(), 0)
        );
    }

    // This is the only check that a path of the session is allowed.
    let Ok(session) = Session::open(&path, &AssetScope::Folder) else { return };
    let settings = &session.settings;
    for file in settings.files.iter().chain(settings.look.files()) {
        assert!(without_parents(file).starts_with(folder.path()), "{} lies outside", file.display());
    }
    evaluate_stage(&settings.stage, settings.turn, session.stage_camera.as_ref());
    for pose in session.cameras.iter().flatten() {
        let _ = Orbit::of(&pose.camera()).camera();
    }
    let scatter = Scatter { count: settings.stage.scatter.count.min(50), ..settings.stage.scatter };
    let few = &settings.stage.copies[..settings.stage.copies.len().min(50)];
    assert!(scatter.placements(few).len() <= 100);
    let (then, _) = settings.playback.advanced(2.0, 0.1);
    assert!((0.0..=2.0).contains(&then.seconds), "{then:?}");
    let options = &settings.simplify.options;
    // (The face count of a new mesh depends on its edge length only.)
    if options.method.kind() != MethodKind::Remesh {
        let _ = simplify(&shapes::cube(2), options);
    }

    session.save(&again).expect("the file is written");
    let back = Session::open(&again, &AssetScope::Folder).expect("written files can be read").settings;
    assert_eq!(back.files, settings.files);
    assert_eq!(back.stage.copies.len(), settings.stage.copies.len());
    assert_eq!(back.stage.motion.copies.len(), settings.stage.motion.copies.len());
    assert_eq!(back.simplify.words().len(), settings.simplify.words().len());
});

/// Returns a path without parent components. (There are no links in the folder.)
fn without_parents(path: &Path) -> PathBuf {
    let mut without_parents = PathBuf::new();
    for component in std::path::absolute(path).expect("the path is not empty").components() {
        match component {
            Component::ParentDir => _ = without_parents.pop(),
            other => without_parents.push(other),
        }
    }
    without_parents
}

/// Evaluates a stage as the window does: placement of all copies, camera, level of each copy.
fn evaluate_stage(stage: &Stage, turn: Turn, pose: Option<&Pose>) {
    assert!(stage.copies.len() <= MAX_COPIES, "more copies than a stage allows");
    let base = ModelBase::new(&Bounds { min: [-1.0; 3], max: [1.0; 3] }, turn.rotation());
    let levels = [(0.0, 2000), (0.01, 300), (0.1, 12)].map(|(error, faces)| LodLevel { error, faces });
    let length = stage.motion.length(0.0);
    let mut selector = LevelSelector::default();
    let mut orbit =
        Orbit::of(&Pose { eye: [3.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 }.camera());
    if let Some(pose) = pose {
        orbit = Orbit::of(&pose.camera());
    }
    for part in [0.0, 0.3, 0.77, 1.0] {
        let copies = stage.copies_at(part * length);
        for copy in copies.iter() {
            assert!(copy.x.is_finite() && copy.z.is_finite() && SCALE_RANGE.contains(&copy.scale), "{copy:?}");
        }
        if let Some(stand) = stage.motion.camera.at(part * length) {
            stand.apply_to(&mut orbit);
        }
        let eye = Viewpoint { camera: orbit.camera(), aspect: 1.5, height_px: 600.0 };
        let chosen = selector.choose(&copies, &base, &levels, &eye, &stage.view);
        assert!(chosen.visible.len() + chosen.left_out <= copies.len());
    }
    base.bounds(stage.all_placements());
}
