//! Commands without a window: a list of commands is a session, which can be replayed, undone and redone.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use lodsmith::MethodKind;
use lodsmith_bake::MapKind;
use lodsmith_core::model::Transform;
use lodsmith_core::shapes;
use lodsmith_core::{Positions, TriMesh};
use lodsmith_io::{Format, Textures};
use lodsmith_render::Shading;
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::content::export::Export;
use lodsmith_viewer::content::sum_over_instances;
use lodsmith_viewer::document::Document;
use lodsmith_viewer::settings::bake::BakeSettings;
use lodsmith_viewer::settings::playback::Playback;
use lodsmith_viewer::settings::simplification::Simplification;
use lodsmith_viewer::settings::{Appearance, AutoLod, HeatOf, Pose, Turn};

use crate::documents::{TIMEOUT, folder_with, opened};

fn folder() -> tempfile::TempDir {
    folder_with([("sphere.ply", shapes::icosphere(4)), ("torus.obj", shapes::torus(48, 24))])
}

fn document() -> Document {
    Document::new(None, || {})
}

fn faces(document: &Document) -> usize {
    document.lighter().map_or(document.original().unwrap().content.faces, |l| {
        sum_over_instances(&l.content.model, TriMesh::face_count)
    })
}

fn export(document: &mut Document, path: PathBuf, format: Format) {
    let export = Export { path, format, ascii: false, textures: Textures::Copy, levels: Vec::new() };
    document.export(export, 0.0);
    assert!(document.settle(TIMEOUT) && document.problem.is_none(), "{:?}", document.problem);
}

#[test]
fn the_heat_map_ends_at_the_error_of_the_target() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    document.set_wanted_results(true, false);
    let diagonal = document.original().unwrap().content.bounds.diagonal();
    document.run(Command::Target(SimplifyTarget::Ratio(0.2)));
    assert!(document.settle(TIMEOUT));
    let distances = document.distances().unwrap().clone();
    assert_eq!((document.error_limit(), document.heat_end(&distances)), (None, distances.largest));
    document.run(Command::Target(SimplifyTarget::Error(0.01)));
    assert!(document.settle(TIMEOUT));
    let distances = document.distances().unwrap().clone();
    let limit = 0.01 * diagonal;
    assert_eq!((document.error_limit(), document.heat_end(&distances)), (Some(limit), limit));
    assert!(distances.largest > 0.0 && distances.largest <= limit * (1.0 + 1e-6), "{}", distances.largest);
    // During a drag the limit moves at once; the last exact distances stay for the histogram, not for the heat map.
    document.run(Command::Target(SimplifyTarget::Error(0.02)));
    assert!(document.shows_preview() && document.distances().is_none());
    assert!(Arc::ptr_eq(document.latest_distances().unwrap(), &distances));
    assert_eq!((document.error_limit(), document.heat_end(&distances)), (Some(2.0 * limit), 2.0 * limit));
    assert!(document.settle(TIMEOUT) && !document.shows_preview());
    assert!(!Arc::ptr_eq(document.distances().unwrap(), &distances));
    // Angles have no such limit.
    let mut look = document.settings().look.clone();
    look.heat_of = HeatOf::Normals;
    document.run(Command::Look(look));
    assert_eq!(document.error_limit(), None);
}

#[test]
fn maps_are_baked_for_the_result_exported_with_it_and_removed() {
    let folder = folder();
    let wave = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/wave.glb");
    for file in [folder.path().join("sphere.ply"), folder.path().join("torus.obj"), wave] {
        let mut document = opened(&file);
        let bake = BakeSettings { maps: vec![MapKind::Normal], size: Some(64), ..BakeSettings::default() };
        document.run(Command::Bake(bake.clone()));
        document.bake();
        assert!(document.settle(TIMEOUT) && document.baked().is_none(), "there is no result yet");
        document.set_wanted_results(true, false);
        document.run(Command::Target(SimplifyTarget::Ratio(0.2)));
        assert!(document.settle(TIMEOUT));
        let before = document.lighter().unwrap().content.clone();
        let largest = document.distances().unwrap().largest;

        document.bake();
        assert!(document.settle(TIMEOUT) && document.problem.is_none(), "{:?}", document.problem);
        let shown = document.lighter().unwrap().content.clone();
        let baked = shown.baked.as_ref().expect("maps are baked");
        assert_eq!(baked.settings, bake);
        assert!(baked.maps.iter().all(|map| map.name.ends_with("normal") && map.image.width() == 64));
        assert_eq!((shown.faces, &shown.how), (before.faces, &before.how));
        let has_map =
            |model: &lodsmith_core::Model| model.materials.iter().any(|m| m.normal_texture.is_some());
        assert!(has_map(&shown.model) && !has_map(&before.model), "{}", file.display());
        let there = document.distances().expect("the result with maps is measured too").largest;
        assert!((there - largest).abs() <= 1e-3 * largest, "{there} {largest}");

        let path = folder.path().join("out.glb");
        export(&mut document, path.clone(), Format::Glb);
        let read = lodsmith_io::read_model_path(&path, &Default::default()).unwrap();
        assert!(has_map(&read.model), "{}", file.display());
        assert_eq!(sum_over_instances(&read.model, TriMesh::face_count), shown.faces);
        export(&mut document, folder.path().join("out.obj"), Format::Obj);
        let written = std::fs::read_to_string(folder.path().join("out.mtl")).unwrap();
        assert!(written.contains("norm "), "{written}");

        let (path, levels) = (folder.path().join("levels"), vec![0.5, 0.2]);
        let (format, textures) = (Format::Glb, Textures::Copy);
        document.export(Export { path: path.clone(), format, ascii: false, textures, levels }, 0.0);
        assert!(document.settle(TIMEOUT) && document.problem.is_none(), "{:?}", document.problem);
        let stem = file.file_stem().unwrap().display().to_string();
        let of_levels = [0, 1, 2].map(|level| {
            let path = path.join(format!("{stem}_lod{level}.glb"));
            has_map(&lodsmith_io::read_model_path(&path, &Default::default()).unwrap().model)
        });
        assert_eq!(of_levels, [false, true, true], "{}", file.display());

        document.remove_maps();
        assert!(Arc::ptr_eq(&document.lighter().unwrap().content, &before));
        document.bake();
        document.run(Command::Target(SimplifyTarget::Ratio(0.5)));
        assert!(document.settle(TIMEOUT) && document.baked().is_none(), "maps of an older result");
    }
}

/// Such a mesh is moved by its node in a scene with single precision.
#[test]
fn a_mesh_far_from_the_origin_is_measured_with_maps_too() {
    let folder = folder();
    let mut ball = shapes::icosphere(4).into_buffers();
    let far = |p: [f64; 3]| [p[0] + 500_000.0, p[1] + 5_000_000.0, p[2]];
    ball.positions = Positions::F64(ball.positions.view().iter().map(far).collect::<Vec<_>>());
    let file = folder.path().join("far.ply");
    lodsmith_io::write_path(&TriMesh::try_from(ball).unwrap(), &file, &Default::default()).unwrap();
    let mut document = opened(&file);
    document.set_wanted_results(true, false);
    document.run(Command::Target(SimplifyTarget::Faces(500)));
    assert!(document.settle(TIMEOUT));
    let before = document.distances().unwrap().largest;
    document.run(Command::Bake(BakeSettings { size: Some(64), ..BakeSettings::default() }));
    document.bake();
    assert!(document.settle(TIMEOUT) && document.baked().is_some(), "{:?}", document.problem);
    let after = document.distances().unwrap().largest;
    assert!((after - before).abs() < 0.1 * before, "{after} {before}");
}

/// Uses only calls that the window makes by itself: no command follows `want`.
#[test]
fn a_late_request_is_measured_at_once() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    document.run(Command::Target(SimplifyTarget::Faces(500)));
    assert!(document.settle(TIMEOUT) && document.distances().is_none());
    document.set_wanted_results(true, true);
    let end = std::time::Instant::now() + TIMEOUT;
    while document.distances().is_none() || document.topologies().iter().any(Option::is_none) {
        assert!(std::time::Instant::now() < end, "nobody measures");
        document.poll();
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_file_with_materials_is_seen_with_them_and_a_chosen_shading_stays() {
    let folder = folder();
    let materials = "newmtl red\nKd 1 0 0\n";
    std::fs::write(folder.path().join("red.mtl"), materials).unwrap();
    let red = "mtllib red.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    std::fs::write(folder.path().join("red.obj"), red).unwrap();
    let paths = vec![folder.path().join("red.obj"), folder.path().join("sphere.ply")];
    let shading = |document: &Document| document.settings().look.look.shading;
    let mut document = document();
    for (command, wanted) in [
        (Command::Open(paths), Shading::Textured),
        (Command::Show(1), Shading::Smooth),
        (Command::Show(0), Shading::Textured),
    ] {
        document.run(command);
        assert!(document.settle(TIMEOUT));
        assert_eq!(shading(&document), wanted);
    }
    let mut look = document.settings().look.clone();
    look.look.shading = Shading::Flat;
    document.run(Command::Look(look));
    document.run(Command::Show(1));
    assert!(document.settle(TIMEOUT));
    assert_eq!(shading(&document), Shading::Flat);
}

#[test]
fn a_list_of_commands_replays_a_session() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let mut quadric = Simplification::default();
    quadric.options.method = MethodKind::Quadric.into();
    let mut look = Appearance::default();
    look.look.shading = Shading::Flat;
    let commands = vec![
        Command::Open(vec![path("sphere.ply"), path("torus.obj")]),
        Command::Target(SimplifyTarget::Ratio(0.25)),
        Command::Method(Box::new(quadric)),
        Command::Look(look),
        Command::Turn(Turn([0.0, 1.0, 0.0, 0.0])),
        Command::KeepCamera(
            1,
            Some(Pose { eye: [3.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 }),
        ),
        Command::Show(1),
        Command::Playback(Playback { clip: None, seconds: 0.5, speed: 2.0, repeats: false }),
        Command::Target(SimplifyTarget::Faces(500)),
    ];
    // Serialized commands read back unchanged.
    let text = serde_json::to_string(&commands).unwrap();
    let read: Vec<Command> = serde_json::from_str(&text).unwrap();
    assert_eq!(read, commands);
    let ends: Vec<_> = [commands, read]
        .into_iter()
        .map(|list| {
            let mut document = document();
            for command in list {
                document.run(command);
                document.seal();
                assert!(document.settle(TIMEOUT));
            }
            let mesh = document.lighter().unwrap().content.model.meshes[0].mesh.clone();
            (document.settings().clone(), mesh)
        })
        .collect();
    assert_eq!(ends[0].0, ends[1].0);
    assert_eq!(ends[0].1, ends[1].1, "the same commands make the same mesh");
    assert!(ends[0].1.face_count() <= 500);
    assert_eq!(ends[0].0.simplify.options.method, MethodKind::Quadric.into());
    assert_eq!(ends[0].0.playback.speed, 2.0);
}

#[test]
fn everything_is_undone_and_redone() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    let mut seen = vec![document.settings().clone()];
    let mut matcap = Appearance::default();
    matcap.look.shading = Shading::Matcap;
    for command in [
        Command::Target(SimplifyTarget::Faces(1000)),
        Command::Look(matcap),
        Command::Turn(Turn([0.0, 0.0, 1.0, 0.0])),
        Command::Playback(Playback { speed: 0.5, ..Playback::default() }),
        Command::Target(SimplifyTarget::Error(0.01)),
        Command::Target(SimplifyTarget::Distance(0.05)),
        Command::Open(vec![folder.path().join("torus.obj")]),
        Command::Target(SimplifyTarget::Vertices(200)),
    ] {
        document.run(command);
        document.seal();
        assert!(document.settle(TIMEOUT));
        seen.push(document.settings().clone());
    }
    let last = faces(&document);
    for before in seen.iter().rev().skip(1) {
        document.undo();
        assert!(document.settle(TIMEOUT));
        assert_eq!(document.settings(), before);
        let open = document.original().map(|o| o.content.path.clone());
        assert_eq!(open.as_deref(), before.file(), "what is shown is what the settings say");
    }
    assert!(document.lighter().is_none(), "back at the original");
    for after in &seen[1..] {
        document.redo();
        assert!(document.settle(TIMEOUT));
        assert_eq!(document.settings(), after);
    }
    assert_eq!(faces(&document), last);
}

#[test]
fn a_file_that_cannot_be_read_changes_nothing_and_says_why() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    document.run(Command::Target(SimplifyTarget::Faces(300)));
    document.seal();
    assert!(document.settle(TIMEOUT));
    let (settings, count) = (document.settings().clone(), faces(&document));
    let broken = folder.path().join("broken.obj");
    std::fs::write(&broken, "v 1 2\nf 1 2 nonsense\n").unwrap();
    for bad in [broken, folder.path().join("nowhere.glb"), folder.path().to_owned()] {
        document.run(Command::Open(vec![bad.clone()]));
        assert!(document.settle(TIMEOUT));
        let problem = document.problem.take().unwrap();
        assert!(problem.contains(&bad.display().to_string()), "{problem}");
        assert_eq!(document.settings(), &settings);
        assert_eq!(faces(&document), count);
    }
    // The document still works.
    document.run(Command::Target(SimplifyTarget::Faces(100)));
    assert!(document.settle(TIMEOUT));
    assert!(faces(&document) <= 100);
}

#[test]
fn undoing_to_a_deleted_file_changes_nothing() {
    let folder = folder();
    let gone = folder.path().join("sphere.ply");
    let mut document = opened(&gone);
    document.run(Command::Open(vec![folder.path().join("torus.obj")]));
    assert!(document.settle(TIMEOUT));
    let settings = document.settings().clone();
    std::fs::remove_file(&gone).unwrap();
    document.undo();
    assert!(document.settle(TIMEOUT));
    assert!(document.problem.is_some());
    assert_eq!(document.settings(), &settings);
    assert_eq!(document.original().unwrap().content.faces, 2 * 48 * 24);
}

#[test]
fn the_latest_target_wins() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    for n in (100..5000).rev().step_by(37) {
        document.run(Command::Target(SimplifyTarget::Faces(n)));
    }
    document.run(Command::Target(SimplifyTarget::Faces(77)));
    assert!(document.settle(TIMEOUT));
    assert!(faces(&document) <= 77);
    document.seal();
    document.undo();
    assert!(document.settle(TIMEOUT));
    assert!(document.lighter().is_none(), "a drag is one step");
}

#[test]
fn an_invalid_target_is_reported_and_the_last_result_stays() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    document.run(Command::Target(SimplifyTarget::Faces(300)));
    assert!(document.settle(TIMEOUT));
    let count = faces(&document);
    document.run(Command::Target(SimplifyTarget::Ratio(-1.0)));
    assert!(document.settle(TIMEOUT));
    assert!(document.problem.as_deref().is_some_and(|p| p.contains("ratio")), "{:?}", document.problem);
    assert_eq!(faces(&document), count);
}

#[test]
fn distances_and_parts_are_found_when_they_are_wanted() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    document.run(Command::Target(SimplifyTarget::Faces(400)));
    assert!(document.settle(TIMEOUT));
    assert!(document.distances().is_none());
    document.set_wanted_results(true, true);
    assert!(document.settle(TIMEOUT));
    let distances = document.distances().unwrap().clone();
    assert!(distances.largest > 0.0 && distances.largest < 0.2);
    let [one, two] = document.topologies().map(|a| a.cloned().unwrap());
    assert_eq!((one.components, one.is_closed), (1, true));
    assert_eq!((two.components, two.border_edges), (1, 0));
    // A new result is measured again.
    document.run(Command::Target(SimplifyTarget::Faces(100)));
    assert!(document.settle(TIMEOUT));
    assert!(document.distances().unwrap().largest > distances.largest);
}

#[test]
fn the_shown_mesh_is_written() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    document.run(Command::Target(SimplifyTarget::Faces(200)));
    assert!(document.settle(TIMEOUT));
    let count = faces(&document);
    for format in Format::WRITTEN {
        let path = folder.path().join(format!("out.{}", format.name()));
        let textures = Textures::default();
        document
            .export(Export { path: path.clone(), format, ascii: false, textures, levels: Vec::new() }, 0.0);
        assert!(document.settle(TIMEOUT));
        assert_eq!(document.problem, None, "{format:?}");
        let read = lodsmith_io::read_path(&path, &Default::default()).unwrap();
        assert_eq!(read.mesh.face_count(), count, "{format:?}");
    }
    let levels = folder.path().join("levels");
    document.export(
        Export {
            path: levels.clone(),
            format: Format::Glb,
            ascii: false,
            textures: Textures::default(),
            levels: vec![1.0, 0.5, 0.1],
        },
        0.0,
    );
    assert!(document.settle(TIMEOUT));
    let count = |i: usize| {
        let path = levels.join(format!("sphere_lod{i}.glb"));
        lodsmith_io::read_path(&path, &Default::default()).unwrap().mesh.face_count()
    };
    assert_eq!(count(0), 5120);
    assert!(count(1) <= 2560 && count(2) <= 512);
}

#[test]
fn an_exported_level_that_misses_its_target_is_reported() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    // (A closed surface needs four faces.)
    for (levels, is_missed) in [(vec![0.5, 0.1], false), (vec![0.5, 0.0002], true)] {
        let path = folder.path().join("levels");
        let (format, textures) = (Format::Glb, Textures::default());
        document.export(Export { path, format, ascii: false, textures, levels }, 0.0);
        assert!(document.settle(TIMEOUT) && document.problem.is_none(), "{:?}", document.problem);
        let reported = document.log.entries().iter().any(|entry| entry.text.contains("level 2: "));
        assert_eq!(reported, is_missed);
    }
}

#[test]
fn a_scene_keeps_its_nodes() {
    let wave: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../testdata/wave.glb"].iter().collect();
    let folder = tempfile::tempdir().unwrap();
    let mut document = opened(&wave);
    let whole = document.original().unwrap().content.faces;
    document.run(Command::Target(SimplifyTarget::Ratio(0.5)));
    assert!(document.settle(TIMEOUT));
    let count = faces(&document);
    assert!(count <= whole / 2, "{count} of {whole}");
    let path = folder.path().join("low.glb");
    let textures = Textures::default();
    document.export(
        Export { path: path.clone(), format: Format::Glb, ascii: false, textures, levels: Vec::new() },
        0.0,
    );
    assert!(document.settle(TIMEOUT));
    let mut again = opened(&path);
    assert!(again.settle(TIMEOUT));
    assert_eq!(faces(&again), count);
    let nodes = |d: &Document| d.original().unwrap().content.model().nodes.len();
    assert_eq!(nodes(&again), nodes(&document));
}

#[test]
fn levels_are_selected_by_the_allowed_error() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    assert!(document.levels().is_empty());
    document.run(Command::AutoLod(AutoLod { is_on: true, pixels: 1.0 }));
    assert!(document.settle(TIMEOUT));
    let count = document.levels().len();
    assert!(count >= 4, "{count}");
    let number = |error: f64| document.level_for(error).0;
    assert_eq!(number(0.0), 0, "the original has no error");
    assert_eq!(number(1e9), count);
    let middle = document.levels()[1].content.error();
    assert_eq!(number(middle * 1.0001), 2);
    document.run(Command::AutoLod(AutoLod { is_on: false, pixels: 1.0 }));
    assert!(document.settle(TIMEOUT));
    assert!(document.levels().is_empty());
}

#[test]
fn a_failed_write_is_reported() {
    let folder = folder();
    let mut document = opened(&folder.path().join("sphere.ply"));
    let path = folder.path().join("no/such/folder/out.glb");
    let (format, textures) = (Format::Glb, Textures::default());
    document.export(Export { path, format, ascii: false, textures, levels: Vec::new() }, 0.0);
    assert!(document.settle(TIMEOUT));
    assert!(
        document.problem.as_deref().is_some_and(|p| p.contains("no/such/folder")),
        "{:?}",
        document.problem
    );
}

#[test]
fn a_scene_plays_before_and_after_it_became_lighter() {
    let mut document = opened(Path::new("../../testdata/arm.glb"));
    let model = document.original().unwrap().content.model().clone();
    let elbow = |document: &Document| match document.pose().transforms[2] {
        Transform::Parts { rotation, .. } => 2.0 * rotation.w.clamp(-1.0, 1.0).acos().to_degrees(),
        Transform::Matrix(_) => f64::NAN,
    };
    document.play(true);
    // At double speed, a quarter of a second is half the rotation to a right angle.
    document.run(Command::Playback(document.settings().playback.at_speed(2.0)));
    document.advance_playback(0.25);
    assert!((elbow(&document) - 45.0).abs() < 1e-3, "{}", elbow(&document));
    document.run(Command::Target(SimplifyTarget::Ratio(0.25)));
    assert!(document.settle(TIMEOUT));
    document.advance_playback(0.25);
    assert!((elbow(&document) - 90.0).abs() < 1e-3, "{}", elbow(&document));
    assert!(document.is_playing(), "other work does not stop it");
    // Both sides reach the same extent: the simplified one stays within 1 % of the size of the original.
    let lighter = document.lighter().unwrap().content.clone();
    let pose = document.pose();
    assert!(faces(&document) <= 1264 / 4 + 2);
    let [whole, few] = [&model, &lighter.model].map(|m| m.bounds(&pose).unwrap());
    for k in 0..3 {
        let off = (whole.min[k] - few.min[k]).abs().max((whole.max[k] - few.max[k]).abs());
        assert!(off < 0.01 * whole.diagonal(), "{k}: {off}");
    }
    // The end of the bent arm is one unit to the left: moved by the joints, not at its rest position.
    assert!((whole.min[0] + 1.0).abs() < 0.01, "{whole:?}");
    document.run(Command::Open(vec![PathBuf::from("../../testdata/wave.glb")]));
    assert!(document.settle(TIMEOUT));
    assert!(!document.is_playing() && document.pose() == Default::default());
    assert_eq!(document.settings().playback.speed, 2.0);
    document.play(true);
    assert!(!document.is_playing(), "nothing moves in it");
}

#[test]
fn times_of_levels_fill_a_table_and_a_new_target_ends_it() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    assert_eq!(document.benchmark_table(), None);
    document.benchmark();
    assert!(document.settle(TIMEOUT));
    let table = document.benchmark_table().unwrap();
    let faces: Vec<usize> = table.rows.iter().map(|r| r.level.as_ref().unwrap().faces).collect();
    let whole = document.original().unwrap().content.faces;
    let wanted = [1.0, 0.5, 0.25, 0.1, 0.05, 0.01].map(|share| (whole as f64 * share) as usize);
    assert_eq!(faces.len(), wanted.len());
    assert_eq!(faces[0], whole);
    assert!(faces.iter().zip(wanted).all(|(got, wanted)| got.abs_diff(wanted) <= 2), "{faces:?} {wanted:?}");
    let errors: Vec<f64> = table.rows[1..].iter().map(|r| r.level.as_ref().unwrap().error.unwrap()).collect();
    assert!(errors.windows(2).all(|e| e[0] < e[1]), "{errors:?}");
    // There is no adapter.
    assert!(table.rows.iter().all(|r| r.level.as_ref().is_ok_and(|l| l.frame_secs.is_none())));
    assert!(table.title.contains("--method memoryless") && table.title.contains("no adapter"));

    // A new target cancels the benchmark.
    document.benchmark();
    document.run(Command::Target(SimplifyTarget::Faces(100)));
    assert!(document.settle(TIMEOUT));
    assert_eq!(faces_of(&document), Some(100));
    let again = document.benchmark_table().unwrap();
    assert!(again.rows.len() <= table.rows.len());
    document.run(Command::Open(vec![folder.path().join("sphere.ply")]));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.benchmark_table(), None, "times of another file");
}

fn faces_of(document: &Document) -> Option<usize> {
    document.lighter().map(|l| l.content.faces)
}

#[test]
fn the_next_file_is_shown_if_the_first_cannot_be_read() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let broken = path("broken.off");
    std::fs::write(&broken, "").unwrap();
    let mut document = document();
    document.run(Command::Open(vec![
        broken.clone(),
        path("nowhere.glb"),
        path("sphere.ply"),
        path("torus.obj"),
    ]));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.original().unwrap().content.path, path("sphere.ply"));
    assert_eq!((document.settings().files.len(), document.settings().shown), (4, 2));
    assert!(document.fault_of(&broken).unwrap().contains("broken.off"));
    assert!(
        document.fault_of(&path("nowhere.glb")).is_some() && document.fault_of(&path("sphere.ply")).is_none()
    );
    let problem = document.problem.take().unwrap();
    assert!(problem.contains("broken.off") && problem.contains("nowhere.glb"), "{problem}");
    // One step, which is taken back and done again.
    document.undo();
    assert!(document.settle(TIMEOUT) && document.settings().files.is_empty());
    document.redo();
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.settings().file(), Some(&*path("sphere.ply")));
    // A broken file stays where it is, and is shown once it is sound.
    document.run(Command::Show(0));
    assert!(document.settle(TIMEOUT) && document.problem.take().is_some());
    assert_eq!(document.settings().file(), Some(&*path("sphere.ply")));
    lodsmith_io::write_path(&shapes::icosphere(1), &broken, &Default::default()).unwrap();
    document.run(Command::Show(0));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.original().unwrap().content.faces, 80);
    assert_eq!((document.problem.as_deref(), document.fault_of(&broken)), (None, None));
    // If none can be read, nothing changes.
    let before = document.settings().clone();
    document.run(Command::Open(vec![path("no.stl"), path("not.stl")]));
    assert!(document.settle(TIMEOUT));
    assert!(document.problem.as_ref().is_some_and(|p| p.contains("no.stl") && p.contains("not.stl")));
    assert_eq!(document.settings(), &before);
}

#[test]
fn a_session_whose_shown_file_is_gone_shows_another() {
    let folder = folder();
    let files = ["gone.ply", "torus.obj"].map(|name| folder.path().join(name)).to_vec();
    let settings = lodsmith_viewer::settings::Settings { files, ..Default::default() };
    let mut document = document();
    document.run(Command::Session(Box::new(settings)));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.settings().file(), Some(&*folder.path().join("torus.obj")));
    assert!(document.fault_of(&folder.path().join("gone.ply")).is_some());
}

#[test]
fn opening_adds_files_and_closing_one_shows_its_neighbour() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let mut document = opened(&path("sphere.ply"));
    document.run(Command::Open(vec![path("torus.obj")]));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.settings().files, [path("sphere.ply"), path("torus.obj")]);
    assert_eq!(document.original().unwrap().content.path, path("torus.obj"));
    document.run(Command::CloseFile(1));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.settings().files, [path("sphere.ply")]);
    assert_eq!(document.original().unwrap().content.path, path("sphere.ply"));
    document.run(Command::CloseFile(0));
    assert!(document.settle(TIMEOUT) && document.original().is_none());
    document.undo();
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.original().unwrap().content.path, path("sphere.ply"));
}

/// The original decides which edges are sharp, for its results too.
#[test]
fn sharp_edges_of_a_result_are_those_of_its_original() {
    use lodsmith_core::mesh::creases::{CREASE_ANGLE_DEG, Creases};
    let folder = folder();
    let cube = folder.path().join("cube.stl");
    lodsmith_io::write_path(&shapes::cube(6), &cube, &Default::default()).unwrap();
    let mut document = opened(&folder.path().join("sphere.ply"));
    assert_eq!(document.creases(), Creases::Off);
    document.run(Command::Target(SimplifyTarget::Faces(20)));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.creases(), Creases::Off, "a coarse result decides nothing");
    document.run(Command::Open(vec![cube]));
    assert!(document.settle(TIMEOUT));
    assert_eq!(document.creases(), Creases::Above(CREASE_ANGLE_DEG));
    let mut look = document.settings().look.clone();
    look.creases = Creases::Above(20.0);
    document.run(Command::Look(look));
    assert_eq!(document.creases(), Creases::Above(20.0));
}
