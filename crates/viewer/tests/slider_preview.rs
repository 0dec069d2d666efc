//! Preview of the slider: a progressive mesh shows any level at once, and an exact run follows after release.

use std::path::Path;

use lodsmith::{Length, MethodKind, SimplifyOptions, Stop, simplify};
use lodsmith_core::measure::{CompareOptions, compare};
use lodsmith_core::{TriMesh, shapes};
use lodsmith_io::{Format, Textures};
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::content::export::Export;
use lodsmith_viewer::content::sum_over_instances;
use lodsmith_viewer::document::Document;
use lodsmith_viewer::gpu::{Frame, Gpu, PlacedModel};
use lodsmith_viewer::job::JobKind;
use lodsmith_viewer::settings::simplification::Simplification;

use crate::adapter;
use crate::documents::{TIMEOUT, folder_with, opened, opened_with};

fn folder() -> tempfile::TempDir {
    folder_with([("blob.ply", shapes::blob(4, 3)), ("torus.obj", shapes::torus(48, 24))])
}

fn faces(document: &Document) -> usize {
    sum_over_instances(&document.lighter().unwrap().content.model, TriMesh::face_count)
}

fn is_level(document: &Document) -> bool {
    document.lighter().is_some_and(|l| l.content.report.is_none())
}

#[test]
fn a_drag_shows_levels_at_once_and_ends_with_a_run() {
    let folder = folder();
    let mut document = opened(&folder.path().join("blob.ply"));
    let whole = document.original().unwrap().content.faces;
    assert!(document.has_preview());
    let down = (1..=10).map(|i| whole * (21 - 2 * i) / 21);
    let up = (1..=10).map(|i| 100 + whole * i / 12);
    for n in down.chain(up) {
        document.run(Command::Target(SimplifyTarget::Faces(n)));
        assert!(faces(&document) <= n && faces(&document) + 3 > n, "{} for {n}", faces(&document));
        let level = &document.lighter().unwrap().content;
        assert_eq!(level.faces, faces(&document));
        assert!(level.report.is_none() && level.error() > 0.0);
        assert!(document.is_outdated() && document.progress().is_none(), "a run was begun for {n}");
        document.poll();
        assert!(document.progress().is_none(), "a run was begun for {n}");
    }
    document.run(Command::Target(SimplifyTarget::Faces(700)));
    document.seal();
    assert!(document.settle(TIMEOUT));
    let original = document.original().unwrap().content.model().meshes[0].mesh.clone();
    let run = simplify(&original, &SimplifyOptions::new(Stop::faces(700))).unwrap();
    let shown = &document.lighter().unwrap().content;
    assert_eq!(*shown.model.meshes[0].mesh, run.mesh, "the result is that of a plain run");
    assert_eq!(shown.report.as_ref(), Some(&run.report));
    document.undo();
    assert!(document.lighter().is_none(), "a drag is one step");
}

#[test]
fn every_unit_has_its_level() {
    let folder = folder();
    let mut document = opened(&folder.path().join("blob.ply"));
    let whole = document.original().unwrap().content.clone();
    document.run(Command::Target(SimplifyTarget::Vertices(300)));
    assert!(is_level(&document));
    let level = document.lighter().unwrap().content.clone();
    assert!(level.vertices <= 300 && level.vertices > 290, "{}", level.vertices);
    document.run(Command::Target(SimplifyTarget::Ratio(0.25)));
    assert!(is_level(&document));
    assert!(faces(&document) * 4 <= whole.faces && faces(&document) * 4 > whole.faces - 20);
    document.run(Command::Target(SimplifyTarget::Original));
    assert!(document.lighter().is_none());
    // An invalid target is passed to the engine, which reports it.
    document.run(Command::Target(SimplifyTarget::Ratio(-1.0)));
    assert!(!is_level(&document));
}

/// Returns the largest distance between the shown mesh and the original.
fn largest_distance(document: &Document) -> f64 {
    let original = document.original().unwrap().content.model().meshes[0].mesh.clone();
    let shown = document.lighter().unwrap().content.model.meshes[0].mesh.clone();
    let options = CompareOptions::default();
    compare(&original.surface(), &shown.surface(), &options).unwrap().hausdorff.symmetric
}

#[test]
fn a_drag_of_the_error_shows_levels_within_it_and_ends_with_a_proven_run() {
    let folder = folder();
    for name in ["blob.ply", "torus.obj"] {
        let mut document = opened(&folder.path().join(name));
        let diagonal = document.original().unwrap().content.bounds.diagonal();
        let mut last = usize::MAX;
        for share in [0.0005, 0.002, 0.005, 0.01, 0.02, 0.05] {
            document.run(Command::Target(SimplifyTarget::Error(share)));
            assert!(document.shows_preview() && document.progress().is_none(), "a run was begun for {share}");
            let limit = share * diagonal;
            assert_eq!(document.error_limit(), Some(limit));
            let level = document.lighter().unwrap().content.clone();
            assert!(level.faces < last, "{name}: {} faces after {last} at {share}", level.faces);
            last = level.faces;
            let estimate = level.largest_estimate.unwrap();
            assert!(estimate <= limit * (1.0 + 1e-9), "{name}: {estimate} for {limit}");
            // It is an estimate. (Measured: 0.5 to 1.2 of the limit.)
            let ratio = largest_distance(&document) / limit;
            assert!((0.3..1.6).contains(&ratio), "{name}: {ratio} at {share}");
            // In units of the file, it is the same level.
            document.run(Command::Target(SimplifyTarget::Distance(limit)));
            assert_eq!((faces(&document), document.error_limit()), (last, Some(limit)));
        }
        document.run(Command::Target(SimplifyTarget::Error(0.01)));
        let level = faces(&document);
        document.seal();
        assert!(document.is_busy(JobKind::Simplify), "no run was begun");
        assert!(document.settle(TIMEOUT));
        let result = document.lighter().unwrap().content.clone();
        let bound = result.report.as_ref().unwrap().error.bound.unwrap();
        assert!(bound <= 0.01 * diagonal * (1.0 + 1e-9), "{name}: {bound}");
        assert!(result.faces < level, "{name}: {} of {level}", result.faces);
        document.undo();
        assert!(document.lighter().is_none(), "a drag is one step");
        document.redo();
        assert_eq!(
            (document.settings().simplify.options.stop, faces(&document)),
            (result.how.options.stop, level)
        );
    }
}

#[test]
fn an_error_is_dragged_without_a_progressive_mesh_too() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    let mut how = Simplification::default();
    how.options.method = MethodKind::Planar.into();
    document.run(Command::Method(Box::new(how)));
    assert!(document.settle(TIMEOUT) && !document.has_preview());
    for share in [0.001, 0.005, 0.02] {
        document.run(Command::Target(SimplifyTarget::Error(share)));
        assert!(
            !document.shows_preview() && document.is_busy(JobKind::Simplify),
            "no run was begun for {share}"
        );
    }
    document.seal();
    assert!(document.settle(TIMEOUT));
    let result = document.lighter().unwrap().content.clone();
    assert_eq!(result.how.options.stop, Stop::error(Length::OfDiagonal(0.02)), "the newest value wins");
    let diagonal = document.original().unwrap().content.bounds.diagonal();
    let bound = result.report.as_ref().unwrap().error.bound.unwrap();
    assert!(bound <= 0.02 * diagonal * (1.0 + 1e-9) && result.faces < 48 * 24 * 2, "{bound}");
}

#[test]
fn a_resting_drag_gives_a_result_and_may_continue() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    document.run(Command::Target(SimplifyTarget::Faces(900)));
    document.start_exact_run();
    assert!(document.settle(TIMEOUT));
    assert!(!is_level(&document));
    document.run(Command::Target(SimplifyTarget::Faces(400)));
    assert!(is_level(&document) && faces(&document) <= 400);
    document.undo();
    assert!(document.lighter().is_none(), "a rest is no step");
    document.redo();
    assert!(is_level(&document) && document.settle(TIMEOUT));
    assert!(!is_level(&document) && faces(&document) <= 400);
}

#[test]
fn the_progressive_mesh_uses_the_options_of_the_method() {
    let folder = folder();
    let mut document = opened(&folder.path().join("torus.obj"));
    let mut how = Simplification::default();
    how.options.method = MethodKind::Planar.into();
    document.run(Command::Method(Box::new(how.clone())));
    assert!(document.settle(TIMEOUT));
    assert!(!document.has_preview());
    let is_noted =
        document.log.entries().iter().any(|l| l.text.contains("planar") && l.text.contains("slider"));
    assert!(is_noted, "nothing says that the slider does not follow");
    how.options.method = MethodKind::Quadric.into();
    document.run(Command::Method(Box::new(how.clone())));
    assert!(!document.has_preview(), "that of another method");
    document.run(Command::Target(SimplifyTarget::Faces(500)));
    assert!(!is_level(&document), "without a progressive mesh the method runs");
    assert!(document.settle(TIMEOUT));
    assert!(document.has_preview() && faces(&document) <= 500);
    document.run(Command::Target(SimplifyTarget::Faces(300)));
    assert!(is_level(&document) && faces(&document) <= 300);
    // Another file has its own progressive mesh.
    document.run(Command::Open(vec![folder.path().join("blob.ply")]));
    assert!(document.settle(TIMEOUT) && document.has_preview());
    document.run(Command::Target(SimplifyTarget::Faces(1000)));
    assert!(faces(&document) > 990);
}

#[test]
fn the_exact_result_is_written_and_no_preview_level() {
    let folder = folder();
    let mut document = opened(&folder.path().join("blob.ply"));
    document.run(Command::Target(SimplifyTarget::Faces(600)));
    assert!(is_level(&document));
    let path = folder.path().join("out.ply");
    let (format, textures) = (Format::Ply, Textures::default());
    document.export(Export { path: path.clone(), format, ascii: false, textures, levels: Vec::new() }, 0.0);
    assert!(document.settle(TIMEOUT));
    let original = document.original().unwrap().content.model().meshes[0].mesh.clone();
    let run = simplify(&original, &SimplifyOptions::new(Stop::faces(600))).unwrap();
    let read = lodsmith_io::read_path(&path, &Default::default()).unwrap();
    assert_eq!(*read.mesh, run.mesh);
}

#[test]
fn a_scene_moves_as_one() {
    let wave = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/wave.glb");
    let mut document = opened(&wave);
    let whole = document.original().unwrap().content.faces;
    for share in [0.8, 0.3, 0.5] {
        document.run(Command::Target(SimplifyTarget::Ratio(share)));
        assert!(is_level(&document));
        let count = faces(&document) as f64 / whole as f64;
        assert!(count <= share && count > share - 0.1, "{count} for {share}");
    }
    assert!(document.settle(TIMEOUT) && !is_level(&document));
}

/// Buffers that were patched level after level show the same as new ones.
#[test]
fn patched_levels_look_like_new_ones() {
    let Some(mut gpu) = adapter::context().map(Gpu::on) else { return };
    let folder = folder();
    for name in ["blob.ply", "torus.obj"] {
        let mut document = opened_with(Some(gpu.context().clone()), &folder.path().join(name));
        for n in [1000, 300, 320, 900, 60, 1500] {
            document.run(Command::Target(SimplifyTarget::Faces(n)));
            assert!(is_level(&document));
            let bounds = document.original().unwrap().content.bounds;
            let shown = document.lighter().unwrap();
            let fresh = gpu.upload(&shown.content.model);
            let patched = shown.draw.as_ref().unwrap().lock().unwrap();
            let [one, two] = [&patched, &fresh].map(|model| picture(&mut gpu, model, bounds));
            let off = one.pixels().iter().zip(two.pixels());
            let off: f64 =
                off.map(|(a, b)| (0..3).map(|k| f64::from(a[k].abs_diff(b[k]))).sum::<f64>()).sum();
            let mean = off / (3.0 * 255.0 * one.pixels().len() as f64);
            assert!(mean < 0.01, "{name} at {n}: {mean}");
        }
    }
}

fn picture(
    gpu: &mut Gpu,
    model: &lodsmith_viewer::gpu::DrawModel,
    bounds: lodsmith_core::Bounds,
) -> lodsmith_core::Image {
    let pose = lodsmith_core::model::Pose::default();
    let (look, lighting) = (lodsmith_render::Look::default(), lodsmith_render::Lighting::default());
    let camera = lodsmith_render::Camera::fitting(&bounds, lodsmith_render::StandardView::Iso, 1.0);
    let models = [PlacedModel::new(model, &pose)];
    let frame = Frame {
        background: lodsmith_render::Background::Color([0.5; 3]),
        ..Frame::new(&models, bounds, camera, &look, &lighting)
    };
    let mut target = gpu.target([200, 200]);
    gpu.draw(&mut target, &frame);
    target.read_back()
}
