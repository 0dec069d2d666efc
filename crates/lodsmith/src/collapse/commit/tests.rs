//! One collapse, in meshes where refusals, costs and changes can be computed by hand.

use super::*;
use crate::collapse::samples::SampledError;
use crate::collapse::test_support::{
    assert_near, checked, cost_at, engine_of, live_faces, ring_of, try_at, with_border, without_lines,
};
use crate::cost::TIE;
use crate::cost::metric::{EDGE_LENGTH, Memoryless, Quadric};
use crate::cost::tensor::Tensor;
use crate::test_support::{SmallMesh, octahedron, pyramid, sheet, tetrahedron, tube};

/// Displacement of corner 1 of a pyramid to its apex.
fn to_apex(height: f32) -> Vec3 {
    Vec3::new(-1.0, -1.0, height)
}

#[test]
fn flattening_a_pyramid_costs_its_squared_heights() {
    for h in [0.05f32, 0.25, 0.5, 0.9] {
        let mut engine = engine_of(Memoryless, &pyramid(h), &without_lines());
        // The apex merges into corner 1. The planes of the two sides away from that corner pass it at a distance of
        // 2 h / s, and their doubled areas are 2 s.
        let s = (1.0 + h * h).sqrt();
        let height_sq = 4.0 * h * h / (s * s);
        let planes = 2.0 * (2.0 * s) * height_sq;
        // A fifth of the mean area, which is less than .3 of the star's area.
        let peak = 0.2 * (2.0 * s) * height_sq;
        assert_near(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap(), planes + peak);
        assert_near(cost_at(&mut engine, [0, 1], -to_apex(h)).unwrap(), planes + peak);
    }
}

#[test]
fn the_weight_of_the_largest_distance_is_limited_by_the_star() {
    let h = 0.25f32;
    let mut engine = engine_of(Memoryless, &pyramid(h), &without_lines());
    let s = (1.0 + h * h).sqrt();
    let (planes, height_sq) = (16.0 * h * h / s, 4.0 * h * h / (s * s));
    // The doubled area of the star is 12 s: two sides count once, and the two on the edge twice.
    engine.mesh.cost.area = 1000.0;
    assert_near(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap(), planes + 0.3 * 12.0 * s * height_sq);
    // In the late phase the samples replace it.
    engine.mesh.sampled = Some(SampledError { set_of: Vec::new(), sets: Vec::new() });
    assert_near(engine.mesh.peak_weight(), 0.0);
}

#[test]
fn flat_collapses_cost_only_their_lengths() {
    let mut engine = engine_of(Memoryless, &sheet(5), &without_lines());
    // Two inner neighbours: the doubled area of their star is 12, with the two faces on the edge twice.
    let d = Vec3::X;
    for (step, squares) in [(Vec3::ZERO, 1.0), (d, 1.0), (d * 0.5, 0.5), (d * 0.25, 0.0625 + 0.5625)] {
        assert_near(cost_at(&mut engine, [14, 15], step).unwrap(), 0.5 * TIE * 12.0 * squares);
    }
}

#[test]
fn leaving_a_border_costs_its_lines() {
    let mut engine = engine_of(Memoryless, &pyramid(0.0), &with_border(BorderPolicy::Keep));
    // Corners 1 and 2 meet in the middle between them, one unit away from the lines through 1-4 and 2-3,
    // which have weight 10 and squared length 4. They stay on the line 1-2 itself.
    let lines = 2.0 * 10.0 * 4.0;
    let peak = 0.2 * 2.0 * 1.0;
    let middle = Vec3::new(-1.0, 0.0, 0.0);
    assert_near(cost_at(&mut engine, [1, 2], middle).unwrap(), lines + peak);
    // A corner moved inwards to the apex leaves both of its lines.
    assert_near(cost_at(&mut engine, [1, 0], to_apex(0.0)).unwrap(), 2.0 * 10.0 * 4.0 + peak);
    // A corner that does not move leaves none.
    assert!(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap() < 1e-9);
}

#[test]
fn a_tip_that_shrinks_along_its_plane_costs_the_distance_that_it_leaves() {
    //      1
    //    / | \       0 merges into 1: the left triangle remains, at a distance of 2 from where 0 was.
    //   3  |  0
    //    \ | /
    //      2
    let diamond = SmallMesh {
        points: [[2.0, 0.0], [0.0, 1.0], [0.0, -1.0], [-2.0, 0.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).into(),
        faces: vec![[0, 1, 2], [1, 3, 2]],
    };
    let mut engine = engine_of(Memoryless, &diamond, &without_lines());
    // Four times the squared distance, times a fifth of the mean doubled area, which is 4.
    assert_near(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap(), 4.0 * 4.0 * 0.2 * 4.0);
    // Where the surface continues behind a vertex, it leaves nothing uncovered.
    let mut engine = engine_of(Memoryless, &pyramid(0.0), &without_lines());
    assert!(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap() < 1e-9);
}

#[test]
fn importance_multiplies_the_cost_and_the_merged_vertex_inherits_it() {
    let mut engine = engine_of(Memoryless, &pyramid(0.5), &without_lines());
    let plain = cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap();
    engine.mesh.set_cost_factors(Some(vec![7.0, 3.0, 1.0, 1.0, 1.0]));
    assert_near(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap(), 7.0 * plain);
    // The limit applies to the weighted cost; the error of the result is not weighted.
    assert!(matches!(try_at(&mut engine, [1, 0], Vec3::ZERO, 6.9 * plain), CollapseOutcome::Later(_)));
    assert!(matches!(try_at(&mut engine, [1, 0], Vec3::ZERO, 7.1 * plain), CollapseOutcome::Done));
    assert_near(engine.tally.collapse_cost as f32, plain);
    assert_eq!(engine.mesh.constraints.cost_factors, Some(vec![7.0, 7.0, 1.0, 1.0, 1.0]));
}

#[test]
fn nothing_is_added_to_the_cost_of_metrics_that_decide() {
    let mut engine = engine_of(EDGE_LENGTH, &pyramid(0.5), &without_lines());
    let rings = [1, 0].map(|w| ring_of(&engine, w));
    let cost = 2.25;
    let candidate = Candidate { cost, removed: VertexId(0), step: to_apex(0.5) * 0.5, form_cost: 0.0 };
    let attempt = Attempt {
        kept: VertexId(1),
        candidate: &candidate,
        tau: 2.0,
        is_probe: false,
        rings: [&rings[0], &rings[1]],
    };
    assert!(matches!(engine.collapse(&attempt), CollapseOutcome::Later(found) if found == cost));
    assert!(matches!(engine.collapse(&Attempt { tau: 2.5, ..attempt }), CollapseOutcome::Done));
}

#[test]
fn the_link_condition_refuses_collapses_that_pinch() {
    // Nothing would be left of a tetrahedron; an edge around a tube would pinch it.
    let mut closed = engine_of(Memoryless, &tetrahedron(), &without_lines());
    for ends in [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] {
        assert_eq!(cost_at(&mut closed, ends, Vec3::ZERO), Err(Refusal::LinkCondition), "{ends:?}");
    }
    let mut tube = engine_of(Memoryless, &tube(3), &without_lines());
    assert_eq!(cost_at(&mut tube, [3, 4], Vec3::ZERO), Err(Refusal::LinkCondition));
    assert!(cost_at(&mut tube, [3, 6], Vec3::Z).is_ok());
    // An octahedron has eight faces, and keeps six.
    let mut eight = engine_of(Memoryless, &octahedron(), &without_lines());
    assert!(matches!(try_at(&mut eight, [0, 4], Vec3::new(-0.5, 0.0, 0.5), f32::MAX), CollapseOutcome::Done));
    assert_eq!(eight.mesh.store.live_faces, 6);
}

#[test]
fn faces_may_not_turn_over() {
    let mut engine = engine_of(Memoryless, &pyramid(0.0), &without_lines());
    // The left side of the square is the line x = -1: corner 1 (x = 1) may be moved up to it.
    let left = |by: f32| Vec3::new(-by, 0.0, 0.0);
    assert!(cost_at(&mut engine, [1, 0], left(1.9)).is_ok());
    assert_eq!(cost_at(&mut engine, [1, 0], left(2.0)), Err(Refusal::NormalFlip));
    assert_eq!(cost_at(&mut engine, [1, 0], left(2.1)), Err(Refusal::NormalFlip));
    // A side that is flattened turns by the angle of its slope.
    for (slope, is_allowed) in [(29.0f32, true), (31.0, false)] {
        let mut options = without_lines();
        options.guards.max_normal_deg = Some(30.0);
        let mut engine = engine_of(Memoryless, &pyramid(slope.to_radians().tan()), &options);
        let found = cost_at(&mut engine, [1, 0], Vec3::ZERO);
        assert_eq!(found.err(), (!is_allowed).then_some(Refusal::NormalFlip), "{slope} degrees");
    }
}

#[test]
fn faces_that_rotate_far_may_not_fold_onto_their_neighbours() {
    // A pyramid with a base whose diagonal is 2-4: flat sides would lie on it. Folds are checked for turns of more
    // than 45 degrees.
    for (h, is_allowed) in [(0.9f32, true), (1.2, false)] {
        let mut closed = pyramid(h);
        closed.faces.extend([[1, 4, 2], [2, 4, 3]]);
        let mut engine = engine_of(Memoryless, &closed, &without_lines());
        let found = cost_at(&mut engine, [1, 0], Vec3::ZERO);
        assert_eq!(found.err(), (!is_allowed).then_some(Refusal::NormalFlip), "height {h}");
        // Without the base there is nothing to lie on.
        let mut open = engine_of(Memoryless, &pyramid(h), &without_lines());
        assert!(cost_at(&mut open, [1, 0], Vec3::ZERO).is_ok(), "height {h}");
        // In a block the base may be elsewhere.
        open.mesh.constraints.frozen = 5;
        let found = cost_at(&mut open, [1, 0], Vec3::ZERO);
        assert_eq!(found.err(), (!is_allowed).then_some(Refusal::NormalFlip), "height {h}");
    }
}

#[test]
fn guards_refuse_collapses_beyond_their_limits() {
    /// Returns the refusals with a rule just short of a limit and just beyond.
    fn refusals(
        (small, ends): (&SmallMesh, [u32; 2]),
        set: fn(&mut crate::cost::guard::Rules, f32),
        values: [f32; 2],
    ) -> [Option<Refusal>; 2] {
        values.map(|value| {
            let mut engine = engine_of(Memoryless, small, &without_lines());
            set(&mut engine.mesh.constraints.rules, value);
            cost_at(&mut engine, ends, Vec3::ZERO).err()
        })
    }
    // Flattened, a side is half a square, with squared quality 12 · 4² / 16² = 3/4; before, it is .94.
    let quality = refusals((&pyramid(0.9), [1, 0]), |rules, x| rules.min_shape = x, [0.74, 0.76]);
    assert_eq!(quality, [None, Some(Refusal::Quality)]);
    // In a flat pyramid it was no better before.
    let as_before = refusals((&pyramid(0.0), [1, 0]), |rules, x| rules.min_shape = x, [0.74, 0.76]);
    assert_eq!(as_before, [None, None]);
    // Corner 1 gets an edge across the square to corner 3, with squared length 8.
    let edge = refusals((&pyramid(0.0), [1, 0]), |rules, x| rules.max_edge_sq = x, [8.1, 7.9]);
    assert_eq!(edge, [None, Some(Refusal::EdgeLength)]);
    // Two inner vertices of a sheet with six faces each, two of them shared: eight remain.
    let valence = |rules: &mut crate::cost::guard::Rules, x: f32| rules.max_valence = x as usize;
    assert_eq!(refusals((&sheet(5), [14, 15]), valence, [8.0, 7.0]), [None, Some(Refusal::Valence)]);
}

#[test]
fn locked_ends_keep_their_position() {
    let mut engine = engine_of(Memoryless, &pyramid(0.5), &without_lines());
    engine.mesh.store.lock(&[true, false, false, false, false]);
    assert!(cost_at(&mut engine, [1, 0], to_apex(0.5)).is_ok());
    // With both ends at one position, it is undefined which one stays.
    engine.mesh.store.v[1].p = engine.mesh.store.v[0].p;
    assert_eq!(cost_at(&mut engine, [1, 0], Vec3::ZERO), Err(Refusal::Locked));
}

#[test]
fn probes_and_costs_above_the_limit_change_nothing() {
    let mut engine = engine_of(Memoryless, &pyramid(0.5), &without_lines());
    let state = |engine: &Engine<Memoryless>| {
        let vertices = engine.mesh.store.v.iter().map(|x| (x.p, x.q, x.kind));
        (vertices.collect::<Vec<_>>(), engine.mesh.store.t.clone(), engine.tally.collapses)
    };
    let before = state(&engine);
    let cost = cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap();
    assert!(
        matches!(try_at(&mut engine, [1, 0], Vec3::ZERO, 0.999 * cost), CollapseOutcome::Later(c) if c == cost)
    );
    assert_eq!(state(&engine), before);
    assert!(matches!(try_at(&mut engine, [1, 0], Vec3::ZERO, 1.001 * cost), CollapseOutcome::Done));
    assert_ne!(state(&engine), before);
}

#[test]
fn a_collapse_removes_two_faces_and_updates_tensors() {
    for (step, at) in [
        (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)),
        (to_apex(0.5), Vec3::new(0.0, 0.0, 0.5)),
        (to_apex(0.5) * 0.5, Vec3::new(0.5, 0.5, 0.25)),
    ] {
        let mut engine = engine_of(Memoryless, &pyramid(0.5), &without_lines());
        assert!(matches!(try_at(&mut engine, [1, 0], step, f32::MAX), CollapseOutcome::Done));
        assert_eq!(live_faces(&engine), [[1, 2, 3], [1, 3, 4]]);
        let store = &engine.mesh.store;
        assert_eq!((store.live_faces, store.live_vertices, engine.tally.collapses), (2, 4, 1));
        assert_eq!(store.p(VertexId(1)), at);
        assert!(store.v[0].kind.is_gone() && store.bound[0] == f32::INFINITY);
        // Corner 2 keeps one face: its tensor is n nᵀ over twice the area.
        let [a, b] = [3, 1].map(|w| store.p(VertexId(w)) - store.p(VertexId(2)));
        let n = a.cross(b);
        let wanted = Tensor::outer(n, 1.0 / n.length());
        let off = store.v[2].q.less(&wanted).0.into_iter().fold(0.0, |most: f32, x| most.max(x.abs()));
        assert!(off < 1e-5, "{:?} instead of {wanted:?}", store.v[2].q);
        assert_eq!(checked(&engine), Ok(()));
    }
}

#[test]
fn the_merged_vertex_has_the_number_of_the_end_whose_position_it_keeps() {
    let merged = |step: Vec3| {
        let mut engine = engine_of(Memoryless, &pyramid(0.5), &without_lines());
        assert!(matches!(try_at(&mut engine, [1, 0], step, f32::MAX), CollapseOutcome::Done));
        let store = &engine.mesh.store;
        let numbers = [0, 1].map(|number: usize| store.merged_into[number].0);
        (store.v[1].origin.0, numbers, store.v[1].kind.is_moved())
    };
    assert_eq!(merged(Vec3::ZERO), (1, [1, 1], false));
    assert_eq!(merged(to_apex(0.5)), (0, [0, 0], false));
    assert_eq!(merged(to_apex(0.5) * 0.5), (1, [1, 1], true));
}

#[test]
fn the_accumulated_quadric_includes_removed_planes() {
    let mut engine = engine_of(Quadric, &pyramid(0.5), &without_lines());
    let flat = Candidate { cost: 0.0, removed: VertexId(0), step: Vec3::ZERO, form_cost: 0.0 };
    let rings = [1, 0].map(|w| ring_of(&engine, w));
    let attempt = Attempt {
        kept: VertexId(1),
        candidate: &flat,
        tau: f32::MAX,
        is_probe: false,
        rings: [&rings[0], &rings[1]],
    };
    assert!(matches!(engine.collapse(&attempt), CollapseOutcome::Done));
    // The quadric of corner 1 includes the four sides, two of which are 2 h / s away from it. All four meet
    // at the apex.
    let mut members = Vec::new();
    let ring = ring_of(&engine, 1);
    let here = engine.mesh.cost_at(VertexId(1), VertexId(3), Vec3::ZERO, &ring, &mut members);
    let apex = engine.mesh.cost_at(VertexId(1), VertexId(3), to_apex(0.5), &ring, &mut members);
    // Corner 3 lies on the same two sides, which count once more.
    let s = 1.25f32.sqrt();
    assert_near(here, 2.0 * 16.0 * 0.25 / s);
    assert!(apex < 1e-5, "{apex}");
}

#[test]
fn a_removed_vertex_has_no_faces() {
    let mut engine = engine_of(Memoryless, &sheet(5), &without_lines());
    assert!(matches!(try_at(&mut engine, [14, 15], Vec3::ZERO, f32::MAX), CollapseOutcome::Done));
    let living: Vec<_> = engine.mesh.store.t.iter().filter(|t| t[0] != NONE).collect();
    assert_eq!(living.len(), 48);
    assert!(living.iter().all(|t| !t.contains(&VertexId(15))));
    assert_eq!(engine.mesh.store.listed(VertexId(14)).len(), 8);
    assert_eq!(checked(&engine), Ok(()));
}
