//! Guards hold in the result: after the fit, in levels of a progressive mesh, and for every method that has
//! them.

use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    BorderPolicy, Fit, Guards, Length, MethodKind, NoControl, Progressive, SimplifyOptions, Stop, simplify,
};

/// Slack above the rounding error of single precision.
const SLACK: f64 = 1e-5;

type Face = [[f64; 3]; 3];

fn faces(mesh: &TriMesh) -> Vec<Face> {
    let positions = mesh.positions().view();
    mesh.triangles().iter().map(|t| t.map(|w| positions.get(mesh.vertex_of(w)))).collect()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normal([a, b, c]: Face) -> [f64; 3] {
    let (x, y) = (sub(b, a), sub(c, a));
    [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
}

fn edges([a, b, c]: Face) -> [f64; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| dot(sub(b, a), sub(b, a)).sqrt())
}

fn shape(face: Face) -> f64 {
    let around: f64 = edges(face).iter().map(|e| e * e).sum();
    12f64.sqrt() * dot(normal(face), normal(face)).sqrt() / around
}

fn angle_deg(a: Face, b: Face) -> f64 {
    let (m, n) = (normal(a), normal(b));
    let cos = dot(m, n) / (dot(m, m) * dot(n, n)).sqrt();
    cos.clamp(-1.0, 1.0).acos().to_degrees()
}

fn inputs() -> [(&'static str, TriMesh); 3] {
    [
        ("blob", shapes::blob(4, 3)),
        ("noisy sphere", shapes::noisy_sphere(4, 0.02, 7)),
        ("sheet", shapes::wavy_sheet(40)),
    ]
}

fn diagonal(mesh: &TriMesh) -> f64 {
    mesh.positions().view().bounds().unwrap().diagonal()
}

/// Returns the result without and with the fit, face by face; some vertices must have moved.
fn both(name: &str, mesh: &TriMesh, guards: Guards, ratio: f64) -> [Vec<Face>; 2] {
    let run = |fit| {
        let mut options = SimplifyOptions::new(Stop::ratio(ratio));
        (options.guards, options.fit) = (guards, fit);
        faces(&simplify(mesh, &options).unwrap().mesh)
    };
    let [off, on] = [Fit::Off, Fit::On].map(run);
    assert_eq!(off.len(), on.len(), "{name}");
    let moved = off.iter().zip(&on).filter(|(a, b)| a != b).count();
    assert!(2 * moved > on.len(), "{name}: the fit moved {moved} of {} faces", on.len());
    [off, on]
}

/// Found with `--max-edge` on scans: 79 edges of up to 1.29 times the limit after the fit, none before.
#[test]
fn the_fit_makes_no_edge_longer_than_allowed() {
    for (name, mesh) in inputs() {
        let limit = 0.09 * diagonal(&mesh);
        let guards = Guards { max_edge: Some(Length::Units(limit)), ..Guards::default() };
        let [off, on] = both(name, &mesh, guards, 0.1);
        let near = on.iter().flat_map(|f| edges(*f)).filter(|e| *e > 0.9 * limit).count();
        assert!(near > 10, "{name}: only {near} edges are near the limit");
        for (before, after) in off.iter().zip(&on) {
            for (before, after) in edges(*before).into_iter().zip(edges(*after)) {
                assert!(after <= before.max(limit) * (1.0 + SLACK), "{name}: {before} became {after}");
            }
        }
    }
}

#[test]
fn the_fit_makes_no_face_worse_than_allowed() {
    for (name, mesh) in inputs() {
        for least in [0.3, 0.7] {
            let guards = Guards { min_quality: Some(least), ..Guards::default() };
            let [off, on] = both(name, &mesh, guards, 0.1);
            let near = on.iter().filter(|f| shape(**f) < least + 0.1).count();
            assert!(near > 3, "{name}: only {near} faces are near the limit");
            for (before, after) in off.iter().zip(&on) {
                let (before, after) = (shape(*before), shape(*after));
                assert!(after >= before.min(least) - SLACK, "{name}: {before} became {after}");
            }
        }
    }
}

#[test]
fn the_fit_rotates_no_face_farther_than_allowed() {
    for (name, mesh) in inputs() {
        let most = 4.0;
        let guards = Guards { max_normal_deg: Some(most), ..Guards::default() };
        let [off, on] = both(name, &mesh, guards, 0.3);
        for (before, after) in off.iter().zip(&on) {
            let turn = angle_deg(*before, *after);
            assert!(turn <= most + 0.01, "{name}: a face turned by {turn} degrees");
        }
    }
}

/// All guards at once, for all methods that have a fit.
#[test]
fn guards_hold_together_for_every_method_with_a_fit() {
    let mesh = shapes::blob(4, 5);
    let limit = 0.12 * diagonal(&mesh);
    let guards = Guards {
        max_normal_deg: Some(40.0),
        min_quality: Some(0.4),
        max_valence: Some(9),
        max_edge: Some(Length::Units(limit)),
    };
    for method in [MethodKind::Memoryless, MethodKind::Quadric, MethodKind::LindstromTurk] {
        let run = |fit| {
            let mut options = SimplifyOptions::new(Stop::ratio(0.15));
            (options.guards, options.fit, options.method) = (guards, fit, method.into());
            simplify(&mesh, &options).unwrap().mesh
        };
        let [off, on] = [Fit::Off, Fit::On].map(run);
        let mut valence = vec![0; on.vertex_count()];
        on.triangles().iter().flatten().for_each(|w| valence[on.vertex_of(*w).index()] += 1);
        assert!(valence.iter().all(|n| *n <= 9), "{method:?}");
        for (before, after) in faces(&off).into_iter().zip(faces(&on)) {
            assert!(angle_deg(before, after) <= 40.01, "{method:?}");
            assert!(shape(after) >= shape(before).min(0.4) - SLACK, "{method:?}");
            let (before, after) = (edges(before), edges(after));
            assert!((0..3).all(|k| after[k] <= before[k].max(limit) * (1.0 + SLACK)), "{method:?}");
        }
    }
}

/// The fit of a progressive mesh's levels keeps the guards too.
#[test]
fn guards_hold_in_the_fitted_levels_of_a_progressive_mesh() {
    let mesh = shapes::blob(4, 3);
    let limit = 0.1 * diagonal(&mesh);
    let mut options = SimplifyOptions::new(Stop::ratio(0.1));
    options.guards =
        Guards { max_edge: Some(Length::Units(limit)), min_quality: Some(0.3), ..Guards::default() };
    let mut progressive = Progressive::build(&mesh, &options, &mut NoControl).unwrap();
    let levels: Vec<usize> = progressive.splits().checkpoints.iter().map(|c| c.level as usize).collect();
    assert!(levels.len() > 3);
    let mut moved = 0;
    for level in levels {
        progressive.to_level(level);
        let (plain, fitted) =
            (faces(&progressive.mesh().unwrap()), faces(&progressive.fitted_mesh().unwrap()));
        for (before, after) in plain.into_iter().zip(fitted) {
            moved += usize::from(before != after);
            assert!(shape(after) >= shape(before).min(0.3) - 1e-4, "level {level}");
            let (before, after) = (edges(before), edges(after));
            assert!((0..3).all(|k| after[k] <= before[k].max(limit) * (1.0 + 1e-4)), "level {level}");
        }
    }
    assert!(moved > 100);
}

/// The border of a sheet does not move: with `Lock` all its vertices stay, with `Slide` it stays on the old
/// line.
#[test]
fn locked_and_sliding_borders_stay_in_place() {
    let mesh = shapes::wavy_sheet(40);
    for border in [BorderPolicy::Lock, BorderPolicy::Slide] {
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        (options.border, options.fit) = (border, Fit::On);
        let got = simplify(&mesh, &options).unwrap().mesh;
        let bits = |p: [f64; 3]| p.map(f64::to_bits);
        let old: Vec<_> = mesh.positions().view().iter().map(bits).collect();
        let topology = lodsmith::core::Topology::new(&got.surface());
        let mut count = 0;
        let border_edges = got.triangles().iter().flat_map(|t| {
            let v = t.map(|w| got.vertex_of(w));
            [[v[0], v[1]], [v[1], v[2]], [v[2], v[0]]]
        });
        let mut seen = std::collections::BTreeMap::new();
        border_edges.for_each(|[a, b]| *seen.entry((a.min(b), a.max(b))).or_insert(0) += 1);
        for ((a, b), _) in seen.into_iter().filter(|e| e.1 == 1) {
            for v in [a, b] {
                count += 1;
                let at = got.positions().view().get(v);
                assert!(old.contains(&bits(at)), "{border:?}: {at:?} is not a vertex of the input");
            }
        }
        assert!(count > 20 && topology.counts().border_edge_count * 2 == count, "{border:?}: {count}");
    }
}
