//! The guarantees to users: every option on every shape.

use std::collections::HashSet;

use lodsmith::core::measure::{CompareOptions, compare};
use lodsmith::core::topology::EdgeKind;
use lodsmith::core::{Attribute, Semantic, Topology, TriMesh, VertexId, WedgeId, shapes};
use lodsmith::{
    BorderPolicy, Fit, Guards, Length, Measure, MethodKind, NoControl, Placement, Simplified, SimplifyError,
    SimplifyOptions, Stop, StoppedBy, TopologyPolicy, simplify, simplify_with,
};

use crate::support::{
    CaseFilter, Complaints, bits, bytes, complaints, options_text, places, run, size, topology_complaints,
};

const METHODS: [MethodKind; 2] = [MethodKind::Memoryless, MethodKind::Quadric];
const PLACEMENTS: [Placement; 3] = [Placement::Optimal, Placement::Endpoint, Placement::Midpoint];
const BORDERS: [BorderPolicy; 4] =
    [BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock, BorderPolicy::Free];
const TOPOLOGIES: [TopologyPolicy; 3] =
    [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free];
const FITS: [Fit; 3] = [Fit::Auto, Fit::On, Fit::Off];

/// Counts to stop at: out of reach for most shapes, hard, easy, already met, and several together.
fn stops(mesh: &TriMesh) -> Vec<Stop> {
    let (faces, vertices) = (mesh.face_count(), mesh.vertex_count());
    vec![
        Stop::faces(1),
        Stop::faces(4),
        Stop::faces(faces / 2),
        Stop::faces(faces / 10),
        Stop::faces(0),
        Stop::faces(faces),
        Stop::vertices(vertices / 3),
        Stop::vertices(5),
        Stop::ratio(0.25),
        Stop::ratio(1e-9),
        Stop::ratio(1.0),
        Stop { faces: Some(faces / 4), vertices: Some(vertices / 2), ratio: Some(0.3), error: None },
        Stop { faces: Some(faces / 2), ratio: Some(0.1), ..Stop::default() },
        Stop::default(),
    ]
}

/// One guard each.
fn guards() -> Vec<Guards> {
    let none = Guards::default();
    vec![
        Guards { max_normal_deg: Some(15.0), ..none },
        Guards { max_normal_deg: Some(180.0), ..none },
        Guards { min_quality: Some(0.3), ..none },
        Guards { max_valence: Some(8), ..none },
        Guards { max_edge: Some(Length::OfDiagonal(0.2)), ..none },
        Guards { max_edge: Some(Length::Units(0.5)), ..none },
        Guards {
            max_normal_deg: Some(40.0),
            min_quality: Some(0.2),
            max_valence: Some(10),
            max_edge: Some(Length::OfDiagonal(0.4)),
        },
    ]
}

/// Largest mesh that is run twice here: every option is run on a dozen smaller shapes, and more would double
/// the time.
const TWICE_UP_TO: usize = 250;

/// Returns all shapes, the largest of them with a quarter of its faces: these tests combine options, not
/// sizes.
fn all_shapes() -> Vec<(&'static str, TriMesh)> {
    let smaller = |(name, mesh)| if name == "blob" { (name, shapes::blob(3, 1)) } else { (name, mesh) };
    shapes::all().into_iter().map(smaller).collect()
}

/// Runs once, or twice for small meshes, and checks all guarantees except those of single options.
fn tried(all: &mut Complaints, name: &str, mesh: &TriMesh, options: &SimplifyOptions) -> Option<Simplified> {
    let case = format!("{name}, {}", options_text(options));
    let done = match run(mesh, options) {
        Ok(Ok(done)) => done,
        Ok(Err(error)) => {
            all.add(&case, [format!("fails: {error}")]);
            return None;
        }
        Err(panic) => {
            all.add(&case, [panic]);
            return None;
        }
    };
    all.add(&case, complaints(mesh, options, &done));
    all.add(&case, topology_complaints(mesh, options, &done));
    if mesh.face_count() <= TWICE_UP_TO {
        let same = |a: &Simplified| bytes(&a.mesh) == bytes(&done.mesh) && a.report == done.report;
        let again = matches!(run(mesh, options), Ok(Ok(a)) if same(&a));
        all.check(&case, again, "a second run gives another result");
    }
    Some(done)
}

fn each_policy(method: MethodKind, placement: Placement) {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in all_shapes() {
        for border in BORDERS {
            for topology in TOPOLOGIES {
                for fit in FITS {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = SimplifyOptions::new(Stop::faces(mesh.face_count() / 10));
                    (options.method, options.placement, options.fit) = (method.into(), placement, fit);
                    (options.border, options.topology) = (border, topology);
                    tried(&mut all, name, &mesh, &options);
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn every_policy_memoryless_optimal() {
    each_policy(MethodKind::Memoryless, Placement::Optimal);
}
#[test]
fn every_policy_memoryless_endpoint() {
    each_policy(MethodKind::Memoryless, Placement::Endpoint);
}
#[test]
fn every_policy_memoryless_midpoint() {
    each_policy(MethodKind::Memoryless, Placement::Midpoint);
}
#[test]
fn every_policy_quadric_optimal() {
    each_policy(MethodKind::Quadric, Placement::Optimal);
}
#[test]
fn every_policy_quadric_endpoint() {
    each_policy(MethodKind::Quadric, Placement::Endpoint);
}
#[test]
fn every_policy_quadric_midpoint() {
    each_policy(MethodKind::Quadric, Placement::Midpoint);
}

#[test]
fn every_stop() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in all_shapes() {
        for stop in stops(&mesh) {
            for method in METHODS {
                for topology in TOPOLOGIES {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = SimplifyOptions::new(stop);
                    (options.method, options.topology) = (method.into(), topology);
                    tried(&mut all, name, &mesh, &options);
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn every_guard() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in all_shapes() {
        for guards in guards() {
            for method in METHODS {
                for placement in PLACEMENTS {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = SimplifyOptions::new(Stop::faces(4));
                    (options.method, options.placement, options.guards) = (method.into(), placement, guards);
                    options.fit = Fit::Off;
                    let Some(done) = tried(&mut all, name, &mesh, &options) else { continue };
                    let case = format!("{name}, {}", options_text(&options));
                    if let Some(most) = guards.max_valence.filter(|&n| highest_valence(&mesh) <= n) {
                        let got = highest_valence(&done.mesh);
                        all.check(&case, got <= most, &format!("{got} edges at a vertex"));
                    }
                    if let Some(least) = guards.min_quality.filter(|&q| lowest_quality(&mesh) >= q) {
                        let got = lowest_quality(&done.mesh);
                        all.check(&case, got >= least - 1e-3, &format!("a face of quality {got}"));
                    }
                    let longest = guards.max_edge.map(|l| l.in_units(done.report.error.diagonal));
                    if let Some(most) = longest.filter(|&l| longest_edge(&mesh) <= l) {
                        let got = longest_edge(&done.mesh);
                        all.check(&case, got <= most * 1.0001, &format!("an edge of length {got} > {most}"));
                    }
                }
            }
        }
    }
    all.report_all();
}

fn corners(mesh: &TriMesh) -> impl Iterator<Item = [[f64; 3]; 3]> {
    let surface = mesh.surface();
    (0..mesh.face_count()).map(move |i| surface.triangles()[i].map(|v| surface.positions().get(v)))
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normal(p: [[f64; 3]; 3]) -> [f64; 3] {
    let (a, b) = (minus(p[1], p[0]), minus(p[2], p[0]));
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn highest_valence(mesh: &TriMesh) -> usize {
    let mut neighbours = vec![HashSet::new(); mesh.vertex_count()];
    for t in mesh.surface().triangles() {
        for k in 0..3 {
            neighbours[t[k].index()].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
        }
    }
    neighbours.iter().map(HashSet::len).max().unwrap_or(0)
}

fn lowest_quality(mesh: &TriMesh) -> f64 {
    let quality = |p: [[f64; 3]; 3]| {
        let n = normal(p);
        let around = |a: usize, b: usize| dot(minus(p[a], p[b]), minus(p[a], p[b]));
        12f64.sqrt() * dot(n, n).sqrt() / (around(0, 1) + around(1, 2) + around(2, 0))
    };
    corners(mesh).map(quality).fold(1.0, f64::min)
}

fn longest_edge(mesh: &TriMesh) -> f64 {
    let edges = |p: [[f64; 3]; 3]| [0, 1, 2].map(|k| minus(p[k], p[(k + 1) % 3]));
    corners(mesh).flat_map(edges).map(|e| dot(e, e).sqrt()).fold(0.0, f64::max)
}

/// Returns the border edges of a mesh, by position.
fn border(mesh: &TriMesh) -> Vec<[[f64; 3]; 2]> {
    let surface = mesh.surface();
    let topology = Topology::new(&surface);
    let on_border = topology.edges().filter(|&h| topology.kind(h) == Some(EdgeKind::Border));
    on_border.map(|h| [topology.origin(h), topology.target(h)].map(|v| surface.positions().get(v))).collect()
}

fn distance_to_edge(p: [f64; 3], [a, b]: [[f64; 3]; 2]) -> f64 {
    let (ab, ap) = (minus(b, a), minus(p, a));
    let t = (dot(ab, ap) / dot(ab, ab)).clamp(0.0, 1.0);
    let off = minus(ap, ab.map(|x| x * t));
    dot(off, off).sqrt()
}

#[test]
fn locked_borders_are_not_touched() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in all_shapes() {
        for method in METHODS {
            for placement in PLACEMENTS {
                for fit in FITS {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = SimplifyOptions::new(Stop::faces(mesh.face_count() / 10));
                    (options.method, options.placement, options.fit) = (method.into(), placement, fit);
                    options.border = BorderPolicy::Lock;
                    let Some(done) = tried(&mut all, name, &mesh, &options) else { continue };
                    // A removed part takes its border with it.
                    if done.report.parts_removed == 0 {
                        let here = places(&done.mesh);
                        let gone =
                            border(&mesh).iter().flatten().filter(|p| !here.contains(&bits(**p))).count();
                        let case = format!("{name}, {}", options_text(&options));
                        all.check(&case, gone == 0, &format!("{gone} ends of border edges are gone"));
                    }
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn sliding_border_vertices_stay_on_the_border() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, mesh) in all_shapes() {
        let before = border(&mesh);
        for method in METHODS {
            for placement in PLACEMENTS {
                for fit in FITS {
                    if !cases.takes() {
                        continue;
                    }
                    let mut options = SimplifyOptions::new(Stop::faces(mesh.face_count() / 4));
                    (options.method, options.placement, options.fit) = (method.into(), placement, fit);
                    options.border = BorderPolicy::Slide;
                    let Some(done) = tried(&mut all, name, &mesh, &options) else { continue };
                    let off = |p: &[f64; 3]| {
                        before.iter().map(|&e| distance_to_edge(*p, e)).fold(f64::INFINITY, f64::min)
                    };
                    let worst = border(&done.mesh).iter().flatten().map(off).fold(0.0, f64::max);
                    let case = format!("{name}, {}", options_text(&options));
                    let limit = 1e-5 * done.report.error.diagonal;
                    all.check(&case, worst < limit, &format!("a border vertex {worst} off the border"));
                }
            }
        }
    }
    all.report_all();
}

/// A mesh with attributes on its wedges: a seam where x changes sign.
fn with_attributes(mesh: &TriMesh) -> TriMesh {
    let surface = mesh.surface();
    let positions = surface.positions();
    let mut wedges: Vec<(VertexId, bool)> = Vec::new();
    let mut triangles = Vec::new();
    for t in surface.triangles() {
        let side = t.iter().map(|&v| positions.get(v)[0]).sum::<f64>() > 0.0;
        triangles.push(t.map(|v| {
            let at = wedges.iter().position(|&w| w == (v, side)).unwrap_or_else(|| {
                wedges.push((v, side));
                wedges.len() - 1
            });
            WedgeId(at as u32)
        }));
    }
    let vertex_of = wedges.iter().map(|w| w.0).collect();
    let mut result = TriMesh::with_wedges(mesh.positions().clone(), vertex_of, triangles).unwrap();
    let place = |w: &(VertexId, bool)| positions.get(w.0).map(|x| x as f32);
    let side = |w: &(VertexId, bool)| f32::from(u8::from(w.1));
    result
        .set_uvs(Some(wedges.iter().map(|w| [place(w)[1] + 7.0 * side(w), place(w)[2]]).collect()))
        .unwrap();
    result.set_normals(Some(wedges.iter().map(|w| [side(w), 1.0 - side(w), 0.0]).collect())).unwrap();
    result.set_colors(Some(wedges.iter().map(|w| [place(w)[0].abs(), side(w), 0.5, 1.0]).collect())).unwrap();
    result
}

/// Position and attributes of each wedge.
fn wedges(mesh: &TriMesh) -> HashSet<Vec<u64>> {
    let wedge = |w: u32| {
        let w = WedgeId(w);
        let mut all = bits(mesh.positions().view().get(mesh.vertex_of(w))).to_vec();
        let mut floats = |x: &[f32]| all.extend(x.iter().map(|x| u64::from(x.to_bits())));
        mesh.uvs().inspect(|n| floats(&n[w.index()]));
        mesh.normals().inspect(|n| floats(&n[w.index()]));
        mesh.colors().inspect(|n| floats(&n[w.index()]));
        all
    };
    (0..mesh.wedge_count() as u32).map(wedge).collect()
}

#[test]
fn endpoints_keep_input_vertices_with_their_attributes() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for (name, plain) in all_shapes() {
        let rich = with_attributes(&plain);
        for (name, mesh) in [(name.to_owned(), &plain), (format!("{name} with attributes"), &rich)] {
            let before = wedges(mesh);
            for method in METHODS {
                for (i, border) in BORDERS.into_iter().enumerate() {
                    if !cases.takes() {
                        continue;
                    }
                    let faces = [mesh.face_count() / 3, 4][i % 2];
                    let mut options = SimplifyOptions::new(Stop::faces(faces));
                    (options.method, options.placement) = (method.into(), Placement::Endpoint);
                    (options.border, options.fit) = (border, Fit::On);
                    let Some(done) = tried(&mut all, &name, mesh, &options) else { continue };
                    let case = format!("{name}, {}", options_text(&options));
                    // Where the report says that seams gave way, corners have the values of the surface under
                    // them.
                    if done.report.seams_relaxed {
                        continue;
                    }
                    let strange = wedges(&done.mesh).difference(&before).count();
                    all.check(&case, strange == 0, &format!("{strange} wedges are not from the input"));
                    let kept = done.mesh.has_attributes() == mesh.has_attributes();
                    all.check(&case, kept && done.report.dropped.is_empty(), "attributes are gone");
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn attributes_are_kept_and_exceptions_reported() {
    let whole = with_attributes(&shapes::torus(24, 12));
    // Joints without weights have no meaning.
    let mut half = whole.clone();
    let values = vec![0.0; 4 * whole.wedge_count()];
    half.add_attribute(Attribute { semantic: Semantic::Joints(0), width: 4, values }).unwrap();
    for method in METHODS {
        for placement in [Placement::Optimal, Placement::Midpoint] {
            let mut options = SimplifyOptions::new(Stop::ratio(0.5));
            (options.method, options.placement) = (method.into(), placement);
            for (mesh, dropped) in [(&whole, &[][..]), (&half, &["joints"][..])] {
                let done = simplify(mesh, &options).unwrap();
                assert!(done.report.collapses > 0);
                assert_eq!(done.report.dropped, dropped, "{}", options_text(&options));
                let mesh = &done.mesh;
                let left = [mesh.normals().is_some(), mesh.uvs().is_some(), mesh.colors().is_some()];
                assert_eq!((left, mesh.further_attributes().len()), ([true; 3], 0));
            }
        }
    }
}

#[test]
fn midpoint_placement_gives_midpoints() {
    let mut checked = 0;
    for method in METHODS {
        for (name, mesh) in shapes::all().into_iter().filter(|x| x.1.face_count() > 100) {
            let mut options = SimplifyOptions::new(Stop::vertices(mesh.vertex_count() - 1));
            (options.method, options.placement, options.fit) = (method.into(), Placement::Midpoint, Fit::Off);
            let done = simplify(&mesh, &options).unwrap();
            if done.report.collapses != 1 {
                continue; // unused vertices counted towards the stop
            }
            let (before, after) = (places(&mesh), places(&done.mesh));
            let new: Vec<[f64; 3]> = after.difference(&before).map(|p| p.map(f64::from_bits)).collect();
            let gone: Vec<[f64; 3]> = before.difference(&after).map(|p| p.map(f64::from_bits)).collect();
            let middle = |a: &[f64; 3], b: &[f64; 3]| {
                let off = minus([0, 1, 2].map(|k| (a[k] + b[k]) / 2.0), new[0]);
                dot(off, off).sqrt() < 1e-6 * done.report.error.diagonal
            };
            let is_middle = gone.iter().any(|a| gone.iter().any(|b| a != b && middle(a, b)));
            assert!(new.len() == 1 && is_middle, "{name}: {new:?} is not in the middle of two of {gone:?}");
            checked += 1;
        }
    }
    assert!(checked > 16, "{checked} midpoints were checked");
}

/// Collapses one edge at a time onto endpoints: the former normal of each face is known, and so is its
/// rotation.
#[test]
fn no_collapse_rotates_a_face_beyond_the_guard() {
    const DEG: f64 = 12.0;
    for method in METHODS {
        let mut mesh = shapes::wavy_sheet(16);
        let mut turned_faces = 0;
        for _ in 0..60 {
            let mut options = SimplifyOptions::new(Stop::vertices(mesh.vertex_count() - 1));
            (options.method, options.placement) = (method.into(), Placement::Endpoint);
            options.guards.max_normal_deg = Some(DEG);
            let done = simplify(&mesh, &options).unwrap();
            if done.report.collapses == 0 {
                break;
            }
            let after = places(&done.mesh);
            let faces = |m: &TriMesh| corners(m).map(rotated_to_lowest).collect::<HashSet<_>>();
            let (old, new) = (faces(&mesh), faces(&done.mesh));
            for &face in new.difference(&old) {
                // The same face before the collapse: one corner was at the removed position.
                let was = old.iter().map(|&f| f.map(|p| p.map(f64::from_bits))).find_map(|f| {
                    let gone = f.iter().position(|p| !after.contains(&bits(*p)))?;
                    let now = face.map(|p| p.map(f64::from_bits));
                    let rest = [f[(gone + 1) % 3], f[(gone + 2) % 3]];
                    let k = (0..3).find(|&k| [now[(k + 1) % 3], now[(k + 2) % 3]] == rest)?;
                    Some((f, [now[k], rest[0], rest[1]], gone))
                });
                let (f, now, gone) = was.expect("a new face differs from an old one in one corner");
                let (n, m) = (normal([f[gone], f[(gone + 1) % 3], f[(gone + 2) % 3]]), normal(now));
                let angle = (dot(n, m) / (dot(n, n) * dot(m, m)).sqrt()).clamp(-1.0, 1.0).acos().to_degrees();
                assert!(angle <= DEG + 0.1, "{method:?}: a face turned by {angle} degrees");
                turned_faces += 1;
            }
            mesh = done.mesh;
        }
        assert!(turned_faces > 50, "{method:?}: {turned_faces} faces seen");
    }
}

fn rotated_to_lowest(p: [[f64; 3]; 3]) -> [[u64; 3]; 3] {
    let [a, b, c] = p.map(bits);
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or([a, b, c])
}

#[test]
fn the_measured_error_stays_within_the_stop() {
    let mut all = Complaints::default();
    for (i, (name, mesh)) in shapes::all().into_iter().enumerate().step_by(size(1, 5)) {
        let limit = [Length::OfDiagonal(0.01), Length::Units(0.05), Length::OfDiagonal(0.0)][i % 3];
        let mut options = SimplifyOptions::new(Stop::error(limit));
        options.method = METHODS[i % 2].into();
        options.seed = 3;
        let case = format!("{name}, {}", options_text(&options));
        match run(&mesh, &options) {
            Ok(Ok(done)) => {
                all.add(&case, complaints(&mesh, &options, &done));
                all.add(&case, topology_complaints(&mesh, &options, &done));
                all.check(
                    &case,
                    done.report.reached,
                    "the result is within the error, but the report says that the stop was not reached",
                );
                // This measures again, independently of the engine.
                let mut compared = CompareOptions::default();
                let samples = done.report.error.measured.as_ref().map(|m| m.samples);
                (compared.seed, compared.samples) = (3, samples.unwrap_or(compared.samples));
                all.check(&case, compared.samples >= 50_000, "few samples");
                let again = compare(&mesh.surface(), &done.mesh.surface(), &compared).ok();
                all.check(&case, again == done.report.error.measured, "the report has another measurement");
            }
            other => all.add(&case, [format!("{:?}", other.map(|r| r.map(|d| d.report)))]),
        }
    }
    all.report_all();
}

#[test]
fn the_first_of_an_error_and_a_count_stops_the_run() {
    let mesh = shapes::blob(3, 2);
    // The error stops the first run, the count the second.
    for (faces, percent) in [(4, 0.01), (600, 0.2)] {
        let limit = Length::OfDiagonal(percent);
        let options =
            SimplifyOptions::new(Stop { faces: Some(faces), error: Some(limit), ..Stop::default() });
        let done = simplify(&mesh, &options).unwrap();
        let measured = done.report.error.measured.as_ref().unwrap().hausdorff.symmetric;
        assert!(measured <= limit.in_units(done.report.error.diagonal));
        assert!(done.report.reached);
        if faces == 4 {
            assert_eq!(done.report.stopped_by, StoppedBy::Error);
            let got = done.mesh.face_count();
            assert!(got > 4 && got < mesh.face_count() / 2, "{got} faces");
        } else {
            assert_eq!(done.report.stopped_by, StoppedBy::Faces);
            assert!(done.mesh.face_count() <= 600 && done.mesh.face_count() >= 598);
        }
    }
}

#[test]
fn a_larger_error_never_means_more_faces() {
    let mesh = shapes::blob(3, 2);
    let faces = [0.002, 0.01, 0.05].map(|e| {
        let options = SimplifyOptions::new(Stop::error(Length::OfDiagonal(e)));
        simplify(&mesh, &options).unwrap().mesh.face_count()
    });
    assert!(faces[0] > faces[1] && faces[1] > faces[2], "{faces:?}");
    assert!(faces[0] < mesh.face_count(), "within a fifth of a percent, some faces can be removed");
}

#[test]
fn clean_shapes_meet_easy_targets() {
    let mut all = Complaints::default();
    let mut cases = CaseFilter::every(5);
    for name in ["fine_cube", "icosphere", "noisy_sphere", "blob", "torus", "grid", "wavy_sheet", "cylinder"]
    {
        let mesh = shapes::all().into_iter().find(|s| s.0 == name).unwrap().1;
        for method in METHODS {
            for placement in PLACEMENTS {
                for topology in TOPOLOGIES {
                    for share in [0.5, 0.2] {
                        if !cases.takes() {
                            continue;
                        }
                        let mut options = SimplifyOptions::new(Stop::ratio(share));
                        (options.method, options.placement, options.topology) =
                            (method.into(), placement, topology);
                        let Some(done) = tried(&mut all, name, &mesh, &options) else { continue };
                        let case = format!("{name}, {}", options_text(&options));
                        all.check(&case, done.report.reached, &format!("{:?}", done.report.refusals));
                        // A collapse removes two faces inside the surface, so the last step may remove one
                        // too many.
                        let least = (share * mesh.face_count() as f64).round() as usize - 1;
                        let got = done.mesh.face_count();
                        all.check(&case, got >= least, &format!("{got} faces, fewer than {least}"));
                    }
                }
            }
        }
    }
    all.report_all();
}

#[test]
fn buffers_and_meshes_give_the_same_result() {
    for (name, mesh) in shapes::all() {
        let options = SimplifyOptions::new(Stop::ratio(0.3));
        let a = simplify(&mesh, &options).unwrap();
        let b = simplify_with(mesh.surface(), &options, &mut NoControl).unwrap();
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn threads_change_neither_the_result_nor_the_measurement() {
    // Sweeps have one thread; clustering, remeshing and the measurement have several, and the order of a large mesh.
    let pools = [1, 3].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for (method, size) in [
        (MethodKind::Memoryless, 4),
        (MethodKind::Memoryless, 6),
        (MethodKind::Cluster, 4),
        (MethodKind::Remesh, 4),
    ] {
        let mesh = shapes::blob(size, 3);
        let mut options = SimplifyOptions::new(Stop::ratio(0.1));
        (options.method, options.measure) = (method.into(), Measure::Always);
        let [one, three] = pools.each_ref().map(|pool| pool.install(|| simplify(&mesh, &options).unwrap()));
        assert!(one.report.error.measured.is_some());
        assert_eq!(one, three, "{}", method.name());
    }
}

#[test]
fn threads_do_not_change_the_fit_of_duplicates_and_attributes() {
    // The fit goes through the input in pieces of some thousand faces; after a removed duplicate, the final faces no
    // longer follow those of the input.
    let blob = shapes::blob(6, 3);
    let faces = blob.surface().triangles().to_vec();
    let twice = [faces.clone(), faces.into_iter().step_by(3000).collect()].concat();
    let mesh = TriMesh::new(blob.positions().clone(), twice).unwrap();
    let mut shaded = mesh.clone();
    let normals = blob.positions().view().iter().map(|p| p.map(|x| x as f32)).collect();
    shaded.set_normals(Some(normals)).unwrap();
    for (mesh, ratio) in [(&mesh, 0.5), (&shaded, 0.3)] {
        let [one, three] = [1, 3].map(|n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| simplify(mesh, &SimplifyOptions::new(Stop::ratio(ratio))).unwrap())
        });
        assert!(one.report.cleanup.duplicate_faces > 20);
        assert_eq!(one, three);
    }
}

#[test]
fn errors_name_the_option_out_of_range() {
    let mesh = shapes::cube(2);
    let plain = || SimplifyOptions::new(Stop::faces(4));
    let guards = |guards: Guards| {
        let mut options = plain();
        options.guards = guards;
        options
    };
    let none = Guards::default();
    let mut weld = plain();
    weld.weld = Some(Length::Units(f64::NAN));
    let cases = [
        ("ratio", SimplifyOptions::new(Stop::ratio(0.0))),
        ("ratio", SimplifyOptions::new(Stop::ratio(1.01))),
        ("ratio", SimplifyOptions::new(Stop::ratio(f64::NAN))),
        ("error", SimplifyOptions::new(Stop::error(Length::Units(-1.0)))),
        ("error", SimplifyOptions::new(Stop::error(Length::OfDiagonal(f64::INFINITY)))),
        ("max-normal", guards(Guards { max_normal_deg: Some(0.0), ..none })),
        ("min-quality", guards(Guards { min_quality: Some(1.5), ..none })),
        ("max-valence", guards(Guards { max_valence: Some(2), ..none })),
        ("max-edge", guards(Guards { max_edge: Some(Length::Units(0.0)), ..none })),
        ("weld", weld),
    ];
    for (name, options) in cases {
        match simplify(&mesh, &options) {
            Err(SimplifyError::BadOption { option, .. }) => assert_eq!(option, name),
            other => panic!("{name}: {other:?}"),
        }
    }
}
