//! Progressive meshes: exact in both directions.

use std::collections::HashSet;
use std::ops::Range;

use lodsmith::core::measure::{CompareOptions, Prepared, compare_prepared};
use lodsmith::core::{Positions, Splits, Topology, TriMesh, WedgeId, shapes};
use lodsmith::{
    BorderPolicy, Control, Input, Length, Method, MethodKind, NoControl, Placement, Progressive,
    SimplifyError, SimplifyOptions, Stage, Stop, TopologyPolicy, Verdict, simplify,
};

use crate::support::attributed::with_random_attributes;
use crate::support::{self, CaseFilter, Complaints, Random, bits, bytes, counts};

const METHODS: [MethodKind; 5] = [
    MethodKind::Memoryless,
    MethodKind::Quadric,
    MethodKind::LindstromTurk,
    MethodKind::Melax,
    MethodKind::ShortestEdge,
];

fn built(mesh: &TriMesh, options: &SimplifyOptions) -> Progressive {
    Progressive::build(mesh, options, &mut NoControl).unwrap()
}

fn with(set: impl FnOnce(&mut SimplifyOptions)) -> SimplifyOptions {
    let mut options = SimplifyOptions::default();
    set(&mut options);
    options
}

fn is_same(a: &TriMesh, b: &TriMesh) -> bool {
    bytes(a) == bytes(b) && a.vertex_map().is_some() == b.vertex_map().is_some()
}

/// Goes down and up one level at a time. Complains if a level differs from before, or is not a sound mesh.
fn walk<'a>(input: impl Into<Input<'a>>, options: &SimplifyOptions) -> Vec<String> {
    let input = input.into();
    let mesh = input.mesh().unwrap();
    let mut progressive = Progressive::build(&input, options, &mut NoControl).unwrap();
    let mut wrong = Vec::new();
    if !is_same(&progressive.mesh().unwrap(), mesh) {
        wrong.push("the full level is not the input".to_owned());
    }
    let before = counts(mesh);
    let has_pairs =
        matches!(options.method, Method::Memoryless { pairs: Some(_) } | Method::Quadric { pairs: Some(_) });
    let may_change = options.topology == TopologyPolicy::Free || has_pairs;
    let mut levels = Vec::new();
    loop {
        let level = progressive.mesh().unwrap();
        let surface = level.surface();
        let topology = Topology::unwelded(&surface);
        topology.check();
        let now = topology.counts();
        let number = progressive.level();
        let is_mended = number < progressive.top();
        if is_mended && !may_change && now.border_edge_count > before.border_edge_count {
            wrong.push(format!("level {number} has more border edges"));
        }
        if is_mended && !may_change && now.non_manifold_edge_count > before.non_manifold_edge_count {
            wrong.push(format!("level {number} has more non-manifold edges"));
        }
        let flat = surface.triangles().iter().filter(|t| t[0] == t[1] || t[1] == t[2] || t[2] == t[0]);
        if is_mended && flat.count() > 0 {
            wrong.push(format!("level {number} has degenerate faces"));
        }
        if (level.face_count(), level.vertex_count())
            != (progressive.face_count(), progressive.vertex_count())
            && is_mended
        {
            wrong.push(format!("level {number} has wrong counts"));
        }
        levels.push(bytes(&level));
        if progressive.level() == 0 {
            break;
        }
        progressive.coarsen(1);
    }
    for (number, level) in levels.iter().rev().enumerate() {
        if bytes(&progressive.mesh().unwrap()) != *level {
            wrong.push(format!("level {number} is different on the way up"));
        }
        progressive.refine(1);
    }
    wrong.truncate(3);
    wrong
}

#[test]
fn every_shape_is_exact_in_both_directions() {
    let mut complaints = Complaints::default();
    for (name, mesh) in shapes::all() {
        complaints.add(name, walk(&mesh, &SimplifyOptions::default()));
    }
    complaints.report_all();
}

#[test]
fn every_method_is_exact_in_both_directions() {
    let mut complaints = Complaints::default();
    let mut cases = CaseFilter::every(4);
    for method in METHODS {
        for (name, mesh) in shapes::all().into_iter().filter(|s| s.1.face_count() < 350) {
            for topology in [TopologyPolicy::Relaxed, TopologyPolicy::Preserve, TopologyPolicy::Free] {
                if !cases.takes() {
                    continue;
                }
                let options = with(|o| (o.method, o.topology) = (method.into(), topology));
                complaints.add(&format!("{name} {method:?} {topology:?}"), walk(&mesh, &options));
            }
        }
    }
    complaints.report_all();
}

#[test]
fn pairs_and_cuts_are_exact_in_both_directions() {
    let mut complaints = Complaints::default();
    let mut options = SimplifyOptions::default();
    let pairs = Some(Length::OfDiagonal(0.3));
    for (name, mesh) in [
        ("tetrahedra", shapes::tetrahedra(8)),
        ("soup", shapes::soup(40, 3)),
        ("doubled sheet", shapes::doubled_sheet(4)),
        ("parts", shapes::two_far_parts()),
    ] {
        for topology in [TopologyPolicy::Relaxed, TopologyPolicy::Free] {
            for method in [Method::Memoryless { pairs }, Method::Quadric { pairs }] {
                (options.topology, options.method) = (topology, method);
                complaints.add(name, walk(&mesh, &options));
            }
        }
    }
    // A torus has to be cut to reach four faces.
    let torus = shapes::torus(14, 8);
    for placement in [Placement::Optimal, Placement::Endpoint] {
        let options = with(|o| (o.placement, o.topology) = (placement, TopologyPolicy::Free));
        let progressive = built(&torus, &options);
        complaints.check("torus", progressive.splits().counts[0].faces < 14, "no neck was cut");
        complaints.add("torus", walk(&torus, &options));
    }
    complaints.report_all();
}

/// Meshes with attributes, seams, regions, locks, unused and duplicate elements, in both precisions.
#[test]
fn meshes_with_attributes_are_exact_in_both_directions() {
    let mut complaints = Complaints::default();
    let mut random = Random(0x5eed_0016);
    for round in 0..support::size(120, 30) {
        let all = shapes::all();
        let (name, plain) = &all[random.below(all.len() as u64) as usize];
        if plain.face_count() > 400 {
            continue;
        }
        let mesh = with_random_attributes(plain, &mut random);
        let mut options = SimplifyOptions::default();
        options.method = random.pick(&METHODS).into();
        options.topology =
            random.pick(&[TopologyPolicy::Relaxed, TopologyPolicy::Free, TopologyPolicy::Preserve]);
        options.border = random.pick(&[BorderPolicy::Keep, BorderPolicy::Slide, BorderPolicy::Lock]);
        options.shape_normals = random.below(4) == 0;
        if options.method.kind() == MethodKind::Memoryless {
            options.placement = random.pick(&[Placement::Optimal, Placement::Endpoint, Placement::Midpoint]);
        }
        options.weld = (random.below(4) == 0).then_some(Length::OfDiagonal(0.01));
        options.prune = (random.below(4) == 0).then(|| Length::OfDiagonal(0.3 * random.unit()));
        let has_locks = random.below(3) == 0;
        let mut lock = || (0..mesh.vertex_count()).map(|_| random.below(5) == 0).collect();
        let locked: Vec<bool> = if has_locks { lock() } else { Vec::new() };
        let mut input = Input::new(&mesh);
        if has_locks {
            input = input.locked(&locked);
        }
        let case = format!("{round}: {name}, {}", support::options_text(&options));
        match Progressive::build(&input, &options, &mut NoControl) {
            Ok(_) => complaints.add(&case, walk(&input, &options)),
            Err(SimplifyError::NoFaces { .. }) => {}
            Err(why) => complaints.add(&case, [why.to_string()]),
        }
    }
    complaints.report_all();
}

/// Defects of the input are restored: duplicate and degenerate faces, unused vertices, NaN.
#[test]
fn broken_input_is_restored() {
    let sphere = shapes::icosphere(2);
    let Positions::F32(mut points) = sphere.positions().clone() else { panic!("shapes are single") };
    let mut faces = sphere.surface().triangles().to_vec();
    let n = points.len() as u32;
    points.extend([[9.0; 3], [f32::NAN, 0.0, -0.0], points[5]]);
    let id = lodsmith::core::VertexId;
    faces.insert(7, faces[3]);
    faces.insert(0, [id(4), id(4), id(9)]);
    faces.push([id(1), id(2), id(n + 1)]);
    faces.push([id(n + 2), id(5), id(6)]);
    let swapped = faces.iter_mut().find(|t| t.contains(&id(5))).unwrap();
    *swapped = swapped.map(|v| if v == id(5) { id(n + 2) } else { v });
    let mesh = TriMesh::new(Positions::F32(points), faces).unwrap();
    let mut progressive = built(&mesh, &SimplifyOptions::default());
    assert!(is_same(&progressive.mesh().unwrap(), &mesh));
    progressive.to_faces(20);
    assert!(progressive.mesh().unwrap().positions().view().iter().flatten().all(f64::is_finite));
    progressive.to_level(progressive.top());
    assert!(is_same(&progressive.mesh().unwrap(), &mesh));
}

#[test]
fn jumps_and_steps_lead_to_the_same_levels() {
    let mut random = Random(16);
    for mesh in [
        shapes::blob(3, 5),
        support::charts::two_charts(8),
        with_random_attributes(&shapes::torus(16, 10), &mut random),
    ] {
        let mut progressive = built(&mesh, &SimplifyOptions::default());
        let all: Vec<_> = (0..progressive.levels())
            .map(|level| {
                progressive.to_level(level);
                (bytes(&progressive.mesh().unwrap()), bytes(&progressive.fitted_mesh().unwrap()))
            })
            .collect();
        for _ in 0..1000 {
            let level = random.below(all.len() as u64) as usize;
            progressive.to_level(level);
            assert_eq!(progressive.level(), level);
            assert_eq!(bytes(&progressive.mesh().unwrap()), all[level].0);
            assert_eq!(bytes(&progressive.fitted_mesh().unwrap()), all[level].1);
        }
    }
}

/// Buffers that are updated only in the changed ranges equal the buffers of the progressive mesh.
#[test]
fn changed_ranges_are_complete() {
    fn patch<T: Copy>(own: &mut Vec<T>, now: &[T], ranges: &[Range<usize>], stride: usize) {
        if own.is_empty() {
            own.extend_from_slice(now);
        }
        for r in ranges {
            own[r.start * stride..r.end * stride].copy_from_slice(&now[r.start * stride..r.end * stride]);
        }
    }
    let mut random = Random(61);
    for mesh in [shapes::blob(4, 9), with_random_attributes(&shapes::torus(24, 14), &mut random)] {
        let mut progressive = built(&mesh, &SimplifyOptions::default());
        let (mut faces, mut map, mut values, mut places) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let width = progressive.layout().width();
        let mut is_less = false;
        let mut changed = progressive.to_level(usize::MAX);
        patch(&mut faces, progressive.faces(), &[], 1);
        patch(&mut map, progressive.vertex_map().unwrap_or_default(), &[], 1);
        patch(&mut values, progressive.values(), &[], width);
        patch(&mut places, &progressive.positions().iter().map(bits).collect::<Vec<_>>(), &[], 1);
        for _ in 0..200 {
            patch(&mut faces, progressive.faces(), &changed.faces, 1);
            patch(
                &mut map,
                progressive.vertex_map().unwrap_or_default(),
                match progressive.vertex_map() {
                    Some(_) => &changed.wedges,
                    None => &[],
                },
                1,
            );
            patch(&mut values, progressive.values(), &changed.wedges, width);
            let now: Vec<_> = progressive.positions().iter().map(bits).collect();
            patch(&mut places, &now, &changed.vertices, 1);
            let counts = progressive.counts();
            assert_eq!(faces[..progressive.face_count()], *progressive.faces());
            assert_eq!(
                map[..progressive.vertex_map().map_or(0, <[_]>::len)],
                *progressive.vertex_map().unwrap_or_default()
            );
            let bits_of = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits_of(&values[..counts.wedges as usize * width]), bits_of(progressive.values()));
            assert_eq!(places[..counts.vertices as usize], now);
            let far = random.below(2) == 0;
            let to = random.below(progressive.levels() as u64) as usize;
            changed = match far {
                true => progressive.to_level(to),
                false if to > progressive.level() => progressive.refine(3),
                false => progressive.coarsen(3),
            };
            let touched: usize = changed.faces.iter().map(Range::len).sum();
            is_less |= touched > 0 && touched < progressive.face_count();
        }
        assert!(is_less || mesh.face_count() < 512, "every change of level changed everything");
    }
}

#[test]
fn counts_and_errors_lead_to_levels() {
    let mesh = shapes::blob(4, 2);
    let mut progressive = built(&mesh, &SimplifyOptions::default());
    let full = progressive.mesh().unwrap();
    for n in [1, 5, 77, 400, 2000, full.face_count(), usize::MAX] {
        progressive.to_faces(n);
        assert!(progressive.face_count() <= n || progressive.level() == 0, "{n}");
        let next = progressive.splits().counts.get(progressive.level() + 1);
        assert!(next.is_none_or(|c| c.faces as usize > n), "a finer level has {n} faces too");
        progressive.to_vertices(n);
        assert!(progressive.vertex_count() <= n || progressive.level() == 0);
        assert!(progressive.mesh().unwrap().vertex_count() == progressive.vertex_count());
    }
    let mut last = f64::INFINITY;
    for level in 0..progressive.levels() {
        progressive.to_level(level);
        assert!(progressive.error() <= last, "the error rises at {level}");
        last = progressive.error();
    }
    assert_eq!(last, 0.0, "the full mesh has no error");
    for share in [0.0, 1e-4, 1e-3, 1e-2, 10.0] {
        let limit = share * 2.0;
        progressive.to_error(limit);
        assert!(progressive.error() <= limit);
        if progressive.level() > 0 {
            progressive.coarsen(1);
            assert!(progressive.error() > limit, "a coarser level is within {limit} too");
        }
    }
}

/// Fault A16: a level chosen by its estimate can have a largest distance ten times as large.
#[test]
fn levels_by_deviation_are_within_it() {
    let mesh = shapes::blob(4, 2);
    let progressive = built(&mesh, &SimplifyOptions::default());
    let mut faces = usize::MAX;
    for share in [0.0, 0.001, 0.003, 0.01, 0.03, 10.0] {
        let limit = share * mesh.positions().view().bounds().unwrap().diagonal();
        for is_fitted in [false, true] {
            let mut at = progressive.clone();
            at.to_level(progressive.level_of_deviation(limit, is_fitted, &mut NoControl).unwrap());
            let far = at.deviation(is_fitted).unwrap().unwrap().hausdorff.symmetric;
            assert!(far <= limit + 1e-9, "{far} of {limit} at {share}");
            if is_fitted {
                assert!(at.face_count() <= faces, "a larger limit leads to more faces at {share}");
                faces = at.face_count();
            }
        }
        if share == 0.01 {
            let mut by_estimate = progressive.clone();
            by_estimate.to_error(limit);
            let far = by_estimate.deviation(true).unwrap().unwrap().hausdorff.symmetric;
            assert!(far > limit && faces < mesh.face_count(), "the estimate keeps {far} of {limit}");
        }
    }
    assert_eq!(faces, progressive.splits().counts[0].faces as usize, "any level is within ten diagonals");
    let cancelled = progressive.level_of_deviation(0.1, true, &mut AnswerAfter(1, Verdict::Cancel));
    assert_eq!(cancelled, Err(SimplifyError::Cancelled));
}

/// Compares the estimate of a level with the measured distance, and levels with single runs.
#[test]
fn levels_are_as_close_as_single_runs() {
    for (name, mesh) in [("blob", shapes::blob(5, 1)), ("torus", shapes::torus(80, 40))] {
        let reference = Prepared::new(&mesh.surface()).unwrap();
        let rms = |m: &TriMesh| {
            let candidate = Prepared::new(&m.surface()).unwrap();
            compare_prepared(&reference, &candidate, &CompareOptions::default()).rms.symmetric
        };
        let mut progressive = built(&mesh, &SimplifyOptions::default());
        for share in [0.6, 0.42, 0.25, 0.1, 0.03] {
            let goal = (mesh.face_count() as f64 * share) as usize;
            progressive.to_faces(goal);
            let single = simplify(&mesh, &SimplifyOptions::new(Stop::faces(goal))).unwrap();
            let (one, fitted) = (rms(&single.mesh), rms(&progressive.fitted_mesh().unwrap()));
            assert!(fitted <= 1.05 * one, "{name} at {share}: {fitted} for {one}");
            let estimate = progressive.error() / fitted;
            assert!(
                (0.4..2.5).contains(&estimate),
                "{name} at {share}: the estimate is {estimate} times the measured distance"
            );
        }
    }
}

#[test]
fn a_fit_does_not_change_the_splits() {
    let mesh = shapes::blob(4, 3);
    let mut progressive = built(&mesh, &SimplifyOptions::default());
    progressive.to_faces(300);
    let plain = bytes(&progressive.mesh().unwrap());
    let fitted = progressive.fitted_mesh().unwrap();
    assert_ne!(bytes(&fitted), plain);
    assert_eq!(bytes(&progressive.mesh().unwrap()), plain);
    let positions: HashSet<_> = fitted.positions().view().iter().map(bits).collect();
    let used: HashSet<_> = progressive.faces().iter().flatten().map(|w| w.index()).collect();
    let live = progressive.fitted_positions();
    let view = live.view();
    let live = view.iter().enumerate().filter(|p| used.contains(&p.0)).map(|p| bits(p.1));
    assert_eq!(live.collect::<HashSet<_>>(), positions);
}

/// Corrections of values, as a file may have them: complete at their checkpoint, and normals stay of unit
/// length.
#[test]
fn the_fit_corrects_values_too() {
    let mut mesh = shapes::blob(3, 3);
    let normals = mesh.positions().view().iter().map(|_| [0.0, 0.0, 1.0]).collect();
    mesh.set_normals(Some(normals)).unwrap();
    let uvs = mesh.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
    mesh.set_uvs(Some(uvs)).unwrap();
    let mut data = built(&mesh, &SimplifyOptions::default()).into_splits().into_data();
    let c = &mut data.checkpoints[2];
    let level = c.level as usize;
    (c.wedges, c.changes) = (vec![WedgeId(0)], vec![0.0, 1.0, 0.0, -0.25, 0.0]);
    data.original = None;
    let mut progressive = Progressive::new(Splits::new(data).unwrap());
    progressive.to_level(level);
    let (plain, fitted) = (progressive.mesh().unwrap(), progressive.fitted_mesh().unwrap());
    assert_eq!(fitted.uvs().unwrap()[0][0], plain.uvs().unwrap()[0][0] - 0.25);
    assert_eq!(fitted.uvs().unwrap()[1..], plain.uvs().unwrap()[1..]);
    let n = fitted.normals().unwrap()[0];
    assert!((n[1] - 0.5f32.sqrt()).abs() < 1e-6 && (n[2] - 0.5f32.sqrt()).abs() < 1e-6, "{n:?}");
}

#[test]
fn locked_vertices_stay_at_all_levels() {
    let mut random = Random(5);
    let mesh = with_random_attributes(&shapes::torus(20, 12), &mut random);
    let locked: Vec<bool> = (0..mesh.vertex_count()).map(|_| random.below(6) == 0).collect();
    let input = Input::new(&mesh).locked(&locked);
    let mut progressive = Progressive::build(input, &SimplifyOptions::default(), &mut NoControl).unwrap();
    let view = mesh.positions().view();
    let held: HashSet<_> = (0..locked.len())
        .filter(|&v| locked[v])
        .map(|v| bits(view.get(lodsmith::core::VertexId::new(v))))
        .collect();
    for level in (0..progressive.levels()).step_by(7) {
        progressive.to_level(level);
        for level in [progressive.mesh().unwrap(), progressive.fitted_mesh().unwrap()] {
            let there: HashSet<_> = level.positions().view().iter().map(bits).collect();
            assert!(held.is_subset(&there), "a locked vertex moved");
        }
    }
}

#[test]
fn stops_determine_the_base() {
    let mesh = shapes::blob(4, 4);
    let at = |stop: Stop| built(&mesh, &SimplifyOptions::new(stop)).splits().counts[0];
    let faces = at(Stop::faces(500)).faces;
    assert!((480..=500).contains(&faces), "{faces}");
    let vertices = at(Stop::vertices(300)).vertices;
    assert!((290..=300).contains(&vertices), "{vertices}");
    let progressive = built(&mesh, &SimplifyOptions::new(Stop::error(Length::OfDiagonal(0.002))));
    let base = {
        let mut base = progressive.clone();
        base.to_level(0);
        base
    };
    let limit = 0.002 * mesh.positions().view().bounds().unwrap().diagonal();
    assert!(base.error() > 0.0 && base.error() <= limit * (1.0 + 1e-9), "{} of {limit}", base.error());
    assert!(is_same(&progressive.mesh().unwrap(), &mesh));
    let whole = built(&mesh, &SimplifyOptions::default());
    assert!(whole.face_count() > base.face_count());
    let (mut whole, level) = (whole.clone(), whole.level_of_faces(base.face_count()));
    whole.to_level(level);
    assert_eq!(bytes(&whole.mesh().unwrap()), bytes(&base.mesh().unwrap()));
}

#[test]
fn splits_give_the_same_progressive_mesh() {
    let mesh = support::charts::two_charts(10);
    let mut progressive = built(&mesh, &SimplifyOptions::default());
    let mut again = Progressive::new(Splits::new(progressive.splits().clone().into_data()).unwrap());
    assert!(is_same(&again.mesh().unwrap(), &mesh));
    for n in [10, 40, 100] {
        progressive.to_faces(n);
        again.to_faces(n);
        assert_eq!(bytes(&progressive.fitted_mesh().unwrap()), bytes(&again.fitted_mesh().unwrap()));
    }
    let cut = progressive.clone().without_below(progressive.level());
    assert_eq!((cut.level(), cut.face_count()), (0, progressive.face_count()));
    assert_eq!(bytes(&cut.fitted_mesh().unwrap()), bytes(&progressive.fitted_mesh().unwrap()));
    let mut cut = cut;
    cut.to_level(cut.top());
    assert!(is_same(&cut.mesh().unwrap(), &mesh));
    // Without the numbers of the original, elements are in the order in which they become live; everything
    // else is equal.
    let mut data = progressive.into_splits().into_data();
    data.original = None;
    let bare = Progressive::new(Splits::new(data).unwrap());
    assert_eq!(bare.mesh().unwrap().face_count(), mesh.face_count());
}

#[test]
fn equal_runs_record_equal_splits() {
    let mut random = Random(77);
    let mesh = with_random_attributes(&shapes::noisy_sphere(3, 0.02, 1), &mut random);
    let [a, b] = [0, 1].map(|_| built(&mesh, &SimplifyOptions::default()).into_splits());
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
}

/// A control that gives an answer after a number of calls.
struct AnswerAfter(usize, Verdict);

impl Control for AnswerAfter {
    fn stage(&mut self, _: Stage) {}
    fn progress(&mut self, done: f64) -> Verdict {
        assert!((0.0..=1.0).contains(&done));
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 { self.1 } else { Verdict::Continue }
    }
}

#[test]
fn a_caller_can_end_the_build() {
    let mesh = shapes::blob(4, 6);
    for n in [1, 2, 5, 9] {
        let cancelled =
            Progressive::build(&mesh, &SimplifyOptions::default(), &mut AnswerAfter(n, Verdict::Cancel));
        assert!(matches!(cancelled, Err(SimplifyError::Cancelled)), "{n}");
        let progressive =
            Progressive::build(&mesh, &SimplifyOptions::default(), &mut AnswerAfter(n, Verdict::Finish))
                .unwrap();
        assert!(is_same(&progressive.mesh().unwrap(), &mesh));
    }
}

#[test]
fn methods_that_cannot_be_recorded_are_refused() {
    let mesh = shapes::icosphere(2);
    for method in MethodKind::ALL.into_iter().filter(|m| !METHODS.contains(m)) {
        let options = with(|o| o.method = method.into());
        let refused = Progressive::build(&mesh, &options, &mut NoControl);
        let why = refused.unwrap_err().to_string();
        assert!(why.contains(method.name()) && why.contains("lindstrom-turk"), "{why}");
    }
    let options = with(|o| o.escalate = true);
    assert!(Progressive::build(&mesh, &options, &mut NoControl).is_err());
    let nothing = TriMesh::new(Positions::F32(Vec::new()), Vec::new()).unwrap();
    let refused = Progressive::build(&nothing, &SimplifyOptions::default(), &mut NoControl);
    assert!(matches!(refused, Err(SimplifyError::NoFaces { faces: 0 })));
}

/// Splits with randomly changed numbers are rejected, or replayed without a panic.
#[test]
fn damaged_splits_are_rejected_or_replayed() {
    let mesh = support::charts::two_charts(6);
    let good = built(&mesh, &SimplifyOptions::default()).into_splits();
    let mut random = Random(99);
    let (mut refused, mut walked) = (0, 0);
    for _ in 0..600 {
        let mut data = good.clone().into_data();
        let mut any = |n: usize| random.below(n.max(1) as u64) as usize;
        let value = [0, 1, 7, 30, u32::MAX, 1 << 30][any(6)];
        match any(8) {
            0 => data.faces[any(good.faces.len())][any(3)] = WedgeId(value),
            1 => data.corners.at[any(good.corners.at.len())] = value,
            2 => data.corners.to[any(good.corners.at.len())] = WedgeId(value),
            3 => data.corners.ends[any(good.corners.ends.len())] = value,
            4 => data.counts[any(good.counts.len())].wedges = value,
            5 => data.counts[any(good.counts.len())].faces = value,
            6 => data.checkpoints[any(good.checkpoints.len())].level = value,
            _ => {
                if let Some(map) = &mut data.vertex_of {
                    map[any(good.counts[0].wedges as usize)].0 = value;
                }
            }
        }
        match Splits::new(data) {
            Err(_) => refused += 1,
            Ok(splits) => {
                walked += 1;
                let mut progressive = Progressive::new(splits);
                for level in [0, progressive.top() / 2, progressive.top()] {
                    progressive.to_level(level);
                    assert!(progressive.mesh().is_ok() && progressive.fitted_mesh().is_ok());
                }
            }
        }
    }
    assert!(refused > 100 && walked > 100, "{refused} {walked}");
}
