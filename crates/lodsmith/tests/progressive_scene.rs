//! Progressive scenes: several meshes that change level with a common threshold.

use lodsmith::core::{Positions, TriMesh, shapes};
use lodsmith::{
    Control, MethodKind, NoControl, Part, Progressive, ProgressiveScene, SimplifyError, SimplifyOptions,
    Stop, Verdict, simplify_scene,
};

use crate::support::attributed::with_random_attributes;
use crate::support::{Random, bytes};

fn part(mesh: &TriMesh, instances: usize, scale: f64) -> Part<'_> {
    Part { instances, scale, ..Part::new(mesh) }
}

fn built(parts: &[Part<'_>], options: &SimplifyOptions) -> ProgressiveScene {
    ProgressiveScene::build(parts, 10.0, options, &mut NoControl).unwrap()
}

fn levels(scene: &ProgressiveScene) -> Vec<Vec<u64>> {
    scene.meshes().iter().map(|progressive| bytes(&progressive.mesh().unwrap())).collect()
}

fn nothing() -> TriMesh {
    TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap()
}

#[test]
fn each_mesh_is_restored_to_the_bit() {
    let mut random = Random(11);
    let meshes = [
        with_random_attributes(&shapes::torus(20, 12), &mut random),
        shapes::blob(3, 1),
        nothing(),
        shapes::grid(9),
    ];
    let times = [2, 1, 1, 0];
    let parts: Vec<_> = meshes.iter().zip(times).map(|(m, n)| part(m, n, 1.0 + n as f64)).collect();
    let mut scene = built(&parts, &SimplifyOptions::default());
    let full: Vec<_> = meshes.iter().map(bytes).collect();
    assert_eq!(levels(&scene), full);
    scene.to_level(0);
    assert!(scene.meshes().iter().all(|progressive| progressive.level() == 0));
    scene.to_level(usize::MAX);
    assert_eq!(levels(&scene), full);
    assert_eq!(scene.error(), 0.0);
}

#[test]
fn a_level_does_not_depend_on_the_path() {
    let meshes = [shapes::blob(3, 7), shapes::torus(24, 12), shapes::grid(12)];
    let parts: Vec<_> = meshes.iter().map(|m| part(m, 1, 1.0)).collect();
    let start = built(&parts, &SimplifyOptions::default());
    let again = built(&parts, &SimplifyOptions::default());
    let (mut one, mut random) = (start.clone(), Random(3));
    for _ in 0..60 {
        let level = random.below(start.top() as u64 + 1) as usize;
        one.to_level(level);
        let mut direct = again.clone();
        direct.to_level(level);
        assert_eq!(one.level(), level);
        assert_eq!(levels(&one), levels(&direct), "{level}");
        let sum: usize = one.meshes().iter().map(Progressive::level).sum();
        assert_eq!(sum, level, "each split belongs to one mesh");
    }
    // A clone changes level independently.
    let mut alone = one.meshes()[0].clone();
    alone.to_faces(40);
    assert!(alone.face_count() <= 40);
    assert_eq!(one.level(), one.meshes().iter().map(Progressive::level).sum::<usize>());
}

#[test]
fn counts_include_all_instances_and_are_met() {
    let (ball, ring) = (shapes::blob(3, 2), shapes::torus(24, 16));
    let mut scene = built(&[part(&ball, 1, 1.0), part(&ring, 5, 0.5)], &SimplifyOptions::default());
    let placed = |scene: &ProgressiveScene, of: fn(&TriMesh) -> usize| {
        let [a, b] = [0, 1].map(|i| of(&scene.meshes()[i].mesh().unwrap()));
        a + 5 * b
    };
    assert_eq!(scene.face_count(), ball.face_count() + 5 * ring.face_count());
    for n in [60, 100, 400, 1000, 3000, usize::MAX] {
        scene.to_faces(n);
        assert!(scene.face_count() <= n, "{n}");
        assert_eq!(scene.face_count(), placed(&scene, TriMesh::face_count));
        let level = scene.level();
        if level < scene.top() {
            scene.to_level(level + 1);
            assert!(scene.face_count() > n, "a finer level has {n} faces too");
        }
        scene.to_vertices(n);
        assert!(scene.vertex_count() <= n, "{n}");
        assert_eq!(scene.vertex_count(), placed(&scene, TriMesh::vertex_count));
    }
    let mut last = f64::INFINITY;
    for level in 0..=scene.top() {
        scene.to_level(level);
        assert!(scene.error() <= last, "the error rises at {level}");
        last = scene.error();
    }
    for limit in [1e-4, 1e-2, 0.1] {
        scene.to_error(limit);
        assert!(scene.error() <= limit);
        let level = scene.level();
        assert!(
            level == 0 || {
                scene.to_level(level - 1);
                scene.error() > limit
            }
        );
    }
}

/// A mesh that is larger in the scene gets the same share of the triangles as in a run on the scene.
#[test]
fn triangles_are_distributed_as_in_a_run_on_the_scene() {
    let (flat, small, large) = (shapes::grid(24), shapes::blob(4, 1), shapes::blob(4, 8));
    let parts = [part(&flat, 1, 1.0), part(&small, 1, 0.25), part(&large, 1, 1.0)];
    for method in [
        MethodKind::Memoryless,
        MethodKind::Quadric,
        MethodKind::LindstromTurk,
        MethodKind::Melax,
        MethodKind::ShortestEdge,
    ] {
        let mut options = SimplifyOptions::default();
        options.method = method.into();
        let mut scene = built(&parts, &options);
        options.stop = Stop::ratio(0.4);
        let run = simplify_scene(&parts, 10.0, &options, &mut NoControl).unwrap();
        scene.to_faces(run.report.faces);
        let own: Vec<_> = scene.meshes().iter().map(Progressive::face_count).collect();
        let wanted: Vec<_> = run.meshes.iter().map(TriMesh::face_count).collect();
        for (own, wanted) in own.iter().zip(&wanted) {
            let off = (*own as f64 - *wanted as f64).abs() / scene.face_count() as f64;
            assert!(off < 0.05, "{method:?}: {:?} for {wanted}, of {:?}", own, scene.face_count());
        }
    }
}

#[test]
fn stops_determine_the_base_of_the_scene() {
    let meshes = [shapes::blob(3, 7), shapes::torus(24, 12)];
    let parts: Vec<_> = meshes.iter().map(|m| part(m, 1, 1.0)).collect();
    let whole = built(&parts, &SimplifyOptions::default());
    let mut free = whole.clone();
    for stop in
        [Stop::faces(300), Stop::vertices(200), Stop::ratio(0.2), Stop::error(lodsmith::Length::Units(0.01))]
    {
        let mut bound = built(&parts, &SimplifyOptions::new(stop));
        assert_eq!(levels(&bound), levels(&whole));
        let splits = bound.top();
        bound.to_level(0);
        free.to_level(whole.top() - splits);
        assert_eq!(levels(&bound), levels(&free), "{stop:?}");
        let faces = bound.face_count();
        assert!(faces < 1200, "{stop:?} leaves {faces}");
        bound.to_faces(faces + 200);
        free.to_faces(faces + 200);
        assert_eq!(levels(&bound), levels(&free), "{stop:?}");
    }
}

/// Cancels at once.
struct Never;

impl Control for Never {
    fn progress(&mut self, _: f64) -> Verdict {
        Verdict::Cancel
    }
}

#[test]
fn invalid_options_are_errors() {
    let (mesh, empty) = (shapes::blob(2, 1), nothing());
    let parts = [part(&mesh, 1, 1.0), part(&mesh, 1, 1.0)];
    let why = |set: &dyn Fn(&mut SimplifyOptions)| {
        let mut options = SimplifyOptions::default();
        set(&mut options);
        ProgressiveScene::build(&parts, 10.0, &options, &mut NoControl).unwrap_err().to_string()
    };
    assert!(why(&|o| o.method = MethodKind::Planar.into()).contains("planar"));
    assert!(why(&|o| o.per_mesh = true).contains("per-mesh"));
    assert!(why(&|o| o.escalate = true).contains("escalate"));
    let mut few = parts;
    let locked = vec![false; mesh.vertex_count() - 1];
    few[1].data.locked = Some(&locked);
    let refused = ProgressiveScene::build(&few, 10.0, &SimplifyOptions::default(), &mut NoControl);
    assert!(refused.unwrap_err().to_string().contains("locked"));
    let options = SimplifyOptions::default();
    let refused = ProgressiveScene::build(&[part(&empty, 1, 1.0)], 1.0, &options, &mut NoControl);
    assert!(matches!(refused, Err(SimplifyError::NoFaces { faces: 0 })));
    let refused = ProgressiveScene::build(&parts, 10.0, &options, &mut Never);
    assert!(matches!(refused, Err(SimplifyError::Cancelled)));
}

#[test]
fn each_mesh_has_its_own_locks() {
    let (a, b) = (shapes::blob(3, 1), shapes::blob(3, 2));
    let mut parts = [part(&a, 1, 1.0), part(&b, 1, 1.0)];
    let locked = vec![true; b.vertex_count()];
    parts[1].data.locked = Some(&locked);
    let mut scene = built(&parts, &SimplifyOptions::default());
    scene.to_level(0);
    assert_eq!(scene.meshes()[1].face_count(), b.face_count());
    assert!(scene.meshes()[0].face_count() * 4 < a.face_count());
}

/// The buffers contain the fitted mesh, in another numbering.
#[test]
fn buffers_contain_the_fitted_mesh() {
    let mut random = Random(23);
    for mesh in [shapes::blob(3, 4), with_random_attributes(&shapes::torus(24, 12), &mut random)] {
        let mut progressive = Progressive::build(&mesh, &SimplifyOptions::default(), &mut NoControl).unwrap();
        for n in [50, 200, 333, usize::MAX] {
            progressive.to_faces(n);
            let (buffers, fitted) =
                (progressive.fitted_buffers().unwrap(), progressive.fitted_mesh().unwrap());
            assert_eq!(buffers.triangles(), progressive.faces());
            assert_eq!(buffers.face_count(), fitted.face_count());
            let corners = |mesh: &TriMesh| {
                let mut all: Vec<String> = (0..mesh.face_count())
                    .map(|f| {
                        let corner = |w: &lodsmith::core::WedgeId| {
                            let uv = mesh.uvs().map(|t| t[w.index()]);
                            let n = mesh.normals().map(|n| n[w.index()]);
                            let further: Vec<_> =
                                mesh.further_attributes().iter().map(|a| a.of(*w)).collect();
                            let p = mesh.positions().view().get(mesh.vertex_of(*w));
                            format!("{p:?} {uv:?} {n:?} {further:?}")
                        };
                        let region = mesh.regions().map(|r| r[f]);
                        format!("{region:?} {:?}", mesh.triangles()[f].iter().map(corner).collect::<Vec<_>>())
                    })
                    .collect();
                all.sort();
                all
            };
            assert_eq!(corners(&buffers), corners(&fitted), "{n}");
        }
    }
}
