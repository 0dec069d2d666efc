//! Laws of all methods over any mesh: guards, locks and errors hold in the result, chains get lighter,
//! progressive meshes can be restored, and position, size and file order of a mesh have little effect.

use std::collections::{HashMap, HashSet};

use lodsmith::core::arbitrary::{Coordinates, perturbed_shape, soup};
use lodsmith::core::measure::proof::{WithinResult, prove_within};
use lodsmith::core::measure::{CompareOptions, Prepared, compare};
use lodsmith::core::{Topology, TriMesh, VertexId};
use lodsmith::{
    Fit, Guards, Input, Length, Levels, LodOptions, MethodKind, NoControl, Progressive, SimplifyError,
    SimplifyOptions, Stop, lod, simplify,
};
use proptest::prelude::*;

use crate::support::attributed::{locked_complaints, with_random_attributes};
use crate::support::without_ties::{moved, reordered, shapes_without_ties};
use crate::support::{CaseFilter, Complaints, Random, bits, bytes, complaints, options_text, run, size};

/// Perturbed and damaged shapes, and soups of numbers from 1e-30 to 1e30, some of them NaN or infinite; half
/// of all with attributes.
fn any_mesh() -> impl Strategy<Value = TriMesh> {
    let plain = prop_oneof![
        2 => perturbed_shape(0.02),
        1 => perturbed_shape(0.5),
        1 => soup(40, Coordinates::Tame),
        2 => soup(40, Coordinates::Wild),
        1 => soup(40, Coordinates::NotFinite),
    ];
    (plain, any::<u64>()).prop_map(|(mesh, seed)| {
        if seed.is_multiple_of(2) { mesh } else { with_random_attributes(&mesh, &mut Random(seed)) }
    })
}

fn options(method: MethodKind, stop: Stop) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(stop);
    options.method = method.into();
    options
}

fn case(options: &SimplifyOptions) -> String {
    format!("{}: {}", options.method.kind().name(), options_text(options))
}

fn has_faces(mesh: &TriMesh) -> bool {
    !matches!(run(mesh, &SimplifyOptions::default()), Ok(Err(SimplifyError::NoFaces { .. })))
}

/// Returns true if an error says that the method cannot do this: an option of other methods, or a mesh of
/// which nothing would be left with the method's lengths. (A soup may have one face of size 1e30 and all
/// others of size 1.)
fn is_refusal(error: &SimplifyError) -> bool {
    match error {
        SimplifyError::NotOfMethod { .. } | SimplifyError::NoFaces { .. } => true,
        SimplifyError::BadOption { option, .. } => ["cell", "edge-length"].contains(option),
        _ => false,
    }
}

fn diagonal(mesh: &TriMesh) -> f64 {
    mesh.positions().view().bounds().map_or(0.0, |b| b.diagonal())
}

type Face = [[f64; 3]; 3];

/// Returns all faces with three different positions.
fn faces(mesh: &TriMesh) -> impl Iterator<Item = Face> {
    let surface = mesh.surface();
    let of = |t: &[VertexId; 3]| t.map(|v| surface.positions().get(v).map(|x| x + 0.0));
    let all: Vec<Face> = surface.triangles().iter().map(of).collect();
    let is_sound =
        |f: &Face| f.iter().flatten().all(|x| x.is_finite()) && f[0] != f[1] && f[1] != f[2] && f[2] != f[0];
    all.into_iter().filter(is_sound)
}

fn edges([a, b, c]: Face) -> [f64; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| (0..3).fold(0.0, |sum: f64, k| sum.hypot(b[k] - a[k])))
}

/// Returns the quality of a face: 1 is equilateral, 0 flat.
fn quality(face: Face) -> f64 {
    let longest = edges(face).into_iter().fold(0.0, f64::max);
    let to = |p: [f64; 3]| [0, 1, 2].map(|k| (p[k] - face[0][k]) / longest);
    let (x, y) = (to(face[1]), to(face[2]));
    let n = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let around: f64 = edges(face).iter().map(|e| (e / longest).powi(2)).sum();
    12f64.sqrt() * n.iter().map(|x| x * x).sum::<f64>().sqrt() / around
}

/// Returns true if an edge is below the rounding of the bounding box.
fn has_tiny_edges(mesh: &TriMesh) -> bool {
    let diagonal = diagonal(mesh);
    faces(mesh).flat_map(edges).any(|e| e < 1e-9 * diagonal)
}

fn longest_edge(mesh: &TriMesh) -> f64 {
    faces(mesh).flat_map(edges).fold(0.0, f64::max)
}

fn worst_quality(mesh: &TriMesh) -> f64 {
    faces(mesh).map(quality).fold(1.0, f64::min)
}

/// Returns the largest valence.
fn highest_valence(mesh: &TriMesh) -> usize {
    let mut around: HashMap<[u64; 3], HashSet<[u64; 3]>> = HashMap::new();
    for face in faces(mesh) {
        let [a, b, c] = face.map(bits);
        for (at, others) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            around.entry(at).or_default().extend(others);
        }
    }
    around.values().map(HashSet::len).max().unwrap_or(0)
}

/// Returns the guards that the result breaks by more than the input did.
fn guard_complaints(mesh: &TriMesh, guards: &Guards, result: &TriMesh) -> Vec<String> {
    let mut found = Vec::new();
    let mut check = |holds: bool, otherwise: String| found.extend((!holds).then_some(otherwise));
    let diagonal = diagonal(mesh);
    if let Some(limit) = guards.max_edge {
        let most = limit.in_units(diagonal).max(longest_edge(mesh)) + 1e-5 * diagonal;
        let got = longest_edge(result);
        check(got <= most, format!("an edge of {got}, longer than {most}"));
    }
    if let Some(limit) = guards.min_quality {
        let (least, got) = (limit.min(worst_quality(mesh)), worst_quality(result));
        check(got >= least - 1e-3, format!("a face of quality {got}, below {least}"));
    }
    if let Some(limit) = guards.max_valence {
        let (most, got) = (limit.max(highest_valence(mesh)), highest_valence(result));
        check(got <= most, format!("{got} edges at a vertex, more than {most}"));
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(size(24, 6)) })]

    /// If a method refuses guards or locks with an error that names them, it is run without them.
    #[test]
    fn guards_and_locks_hold_for_any_method_on_any_mesh(
        mesh in any_mesh(), ratio in 0.02..0.9f64, seed in any::<u64>(),
    ) {
        prop_assume!(has_faces(&mesh));
        let mut random = Random(seed | 1);
        let guards = Guards {
            max_edge: Some(Length::OfDiagonal(0.05 + 0.5 * random.unit())),
            min_quality: Some(0.5 * random.unit()),
            max_valence: Some(6 + random.below(8) as usize),
            ..Guards::default()
        };
        let locked: Vec<bool> = (0..mesh.vertex_count()).map(|_| random.below(4) == 0).collect();
        let has_tiny_edges = has_tiny_edges(&mesh);
        let mut all = Complaints::default();
        for method in MethodKind::ALL {
            let mut plain = options(method, Stop::ratio(ratio));
            plain.fit = random.pick(&[Fit::Auto, Fit::On, Fit::Off]);
            let mut guarded = plain.clone();
            guarded.guards = guards;
            let (free, held) = (Input::new(&mesh), Input::new(&mesh).locked(&locked));
            for (input, options) in [(&free, &plain), (&free, &guarded), (&held, &plain)] {
                let done = match run(input, options) {
                    Ok(Ok(done)) => done,
                    Ok(Err(error)) if is_refusal(&error) => continue,
                    Ok(Err(error)) => {
                        all.add(&case(options), [format!("fails: {error}")]);
                        continue;
                    }
                    Err(panic) => {
                        all.add(&case(options), [panic]);
                        continue;
                    }
                };
                let mut found = complaints(&mesh, options, &done);
                found.extend(guard_complaints(&mesh, &options.guards, &done.mesh));
                // A face that is tiny compared with the bounding box has no area to remesh, and is removed.
                if let Some(locked) = input.data().locked
                    && !(has_tiny_edges && method == MethodKind::Remesh)
                {
                    // Clustering can leave a single locked vertex without any face; then it is dropped.
                    let may_go = method == MethodKind::Cluster;
                    found.extend(locked_complaints(&mesh, locked, (may_go, false), &done.mesh));
                }
                all.add(&case(options), found);
            }
        }
        all.report_all();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(size(12, 4)) })]

    #[test]
    fn any_method_keeps_an_error_limit_on_any_shape(mesh in perturbed_shape(0.02), limit in 0.001..0.05f64) {
        prop_assume!(has_faces(&mesh) && mesh.face_count() < 400);
        let mut all = Complaints::default();
        for method in MethodKind::ALL {
            let options = options(method, Stop::error(Length::OfDiagonal(limit)));
            let case = case(&options);
            let done = match run(&mesh, &options) {
                Ok(Ok(done)) => done,
                Ok(Err(error)) if is_refusal(&error) => continue,
                other => {
                    all.add(&case, [format!("{:?}", other.map(|r| r.map(|d| d.report)))]);
                    continue;
                }
            };
            all.add(&case, complaints(&mesh, &options, &done));
            let most = limit * done.report.error.diagonal * (1.0 + 1e-9);
            let bound = done.report.error.bound;
            all.check(&case, bound.is_some_and(|b| b <= most), &format!("a bound of {bound:?} above {most}"));
            // Repeats the proof from the results alone.
            let [old, new] = [&mesh, &done.mesh].map(|m| Prepared::new(&m.surface()).expect("it has faces"));
            for (from, to, direction) in [(&old, &new, "forward"), (&new, &old, "backward")] {
                let is_kept = matches!(prove_within(from, to, most), WithinResult::Yes(_));
                all.check(&case, is_kept, &format!("{direction}: some point lies beyond {most}"));
            }
        }
        all.report_all();
    }

    #[test]
    fn levels_of_any_method_only_get_lighter(mesh in any_mesh(), geomorph in any::<bool>()) {
        prop_assume!(has_faces(&mesh));
        let ratios = [0.7, 0.3, 0.1, 0.02];
        let mut all = Complaints::default();
        for method in MethodKind::ALL {
            let mut chain = LodOptions::new(Levels::Ratios(ratios.to_vec()));
            chain.simplify.method = method.into();
            chain.geomorph = geomorph;
            let case = format!("{}, blending {geomorph}", method.name());
            let levels = match lod(&mesh, &chain) {
                Ok(chain) => chain.levels,
                Err(error) if is_refusal(&error) => continue,
                Err(error) => {
                    all.add(&case, [format!("fails: {error}")]);
                    continue;
                }
            };
            all.check(&case, levels.len() == ratios.len(), &format!("{} levels", levels.len()));
            let mut before = mesh.face_count();
            for (level, ratio) in levels.iter().zip(ratios) {
                let case = format!("{case}, level {ratio}");
                all.add(&case, complaints(&mesh, &options(method, Stop::ratio(ratio)), level));
                let count = level.mesh.face_count();
                all.check(&case, count <= before, &format!("{count} faces after {before}"));
                before = count;
            }
        }
        all.report_all();
    }

    #[test]
    fn any_mesh_can_be_restored_from_a_progressive_mesh(mesh in any_mesh(), seed in any::<u64>()) {
        prop_assume!(has_faces(&mesh));
        let mut random = Random(seed | 1);
        let mut all = Complaints::default();
        let mut built = 0;
        for method in MethodKind::ALL {
            let options = options(method, Stop::default());
            let case = case(&options);
            let mut progressive = match Progressive::build(&mesh, &options, &mut NoControl) {
                Ok(progressive) => progressive,
                Err(error) if is_refusal(&error) => continue,
                Err(error) => {
                    all.add(&case, [format!("fails: {error}")]);
                    continue;
                }
            };
            built += 1;
            let there = |progressive: &Progressive| progressive.mesh().map(|m| bytes(&m));
            // Goes down in a few steps and up again: each level is the same as before.
            let mut passed = Vec::new();
            while progressive.level() > 0 && passed.len() < 6 {
                passed.push((progressive.level(), there(&progressive)));
                progressive.to_level(random.below(progressive.level() as u64) as usize);
                let level = progressive.mesh().expect("each level is a mesh");
                Topology::unwelded(&level.surface()).check();
            }
            for (level, before) in passed.into_iter().rev() {
                progressive.to_level(level);
                all.check(&case, there(&progressive) == before, &format!("level {level} is different on the way up"));
            }
            progressive.to_level(progressive.top());
            let is_back = bytes(&progressive.mesh().expect("a mesh")) == bytes(&mesh);
            all.check(&case, is_back, "the full level is not the input");
        }
        prop_assert!(built >= 5, "{built} methods made a progressive mesh");
        all.report_all();
    }
}

/// Returns the RMS distance as a share of the diagonal of the first.
fn rms(a: &TriMesh, b: &TriMesh) -> f64 {
    let mut options = CompareOptions::default();
    options.samples = 10_000;
    let got = compare(&a.surface(), &b.surface(), &options).expect("both have faces");
    got.rms.symmetric / got.diagonal
}

/// Scaling by powers of two has no effect at all (`size_and_place_have_no_effect` in `methods.rs`); rounding
/// and another order in the file can change the choice between two steps of equal cost. The count stays the
/// same, except for methods with a grid or edges of one length, and the distance is about the same.
#[test]
fn place_size_and_order_have_little_effect_on_any_method() {
    let mut all = Complaints::default();
    let mut filter = CaseFilter::every(5);
    for method in MethodKind::ALL {
        // Two of the shapes: each is run seven times with every method.
        for (name, mesh) in shapes_without_ties().into_iter().skip(1) {
            let options = options(method, Stop::ratio(0.3));
            let light = |mesh: &TriMesh| simplify(mesh, &options).map(|d| d.mesh);
            let mesh = moved(&mesh, |p| p);
            let base = light(&mesh).expect("a shape can be simplified");
            let error = rms(&mesh, &base);
            let off = [123.4, -5.678, 0.0123];
            let mut cases =
                vec![("elsewhere".to_owned(), moved(&mesh, |p| [0, 1, 2].map(|k| p[k] + off[k])))];
            for scale in [1e-30, 0.037, 1e30] {
                cases.push((format!("times {scale:e}"), moved(&mesh, |p| p.map(|x| x * scale))));
            }
            cases.extend((1..3).map(|seed| (format!("order {seed}"), reordered(&mesh, seed))));
            for (how, other) in cases.into_iter().filter(|_| filter.takes()) {
                let case = format!("{name}, {}, {how}", method.name());
                let Ok(got) = light(&other) else {
                    all.add(&case, ["fails".to_owned()]);
                    continue;
                };
                let [is, was] = [&got, &base].map(TriMesh::face_count);
                let may_differ = match method {
                    MethodKind::Cluster | MethodKind::Remesh => was / 20,
                    _ => 0,
                };
                all.check(&case, is.abs_diff(was) <= may_differ, &format!("{is} faces, not {was}"));
                let rms = rms(&other, &got);
                let is_near = (rms - error).abs() <= 0.1 * error + 1e-6;
                all.check(&case, is_near, &format!("rms {rms} of the diagonal, not {error}"));
            }
        }
    }
    all.report_all();
}
