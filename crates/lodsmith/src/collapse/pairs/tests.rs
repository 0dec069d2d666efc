//! Pair contraction, on two adjacent triangles and other small meshes.

use super::*;
use crate::collapse::test_support::{checked, engine_of, live_faces, with_border};
use crate::cost::metric::{Memoryless, Quadric};
use crate::options::BorderPolicy;
use crate::test_support::{SmallMesh, gap, octahedron, sheet};

const NO_GOAL: Goal = Goal { faces: None, vertices: None };

/// Returns an engine that may contract pairs nearer than `reach`.
fn engine(small: &SmallMesh, reach: f32) -> Engine<Memoryless> {
    let mut engine = engine_of(Memoryless, small, &with_border(BorderPolicy::Keep));
    engine.mesh.enable_pairs(reach);
    engine
}

fn contract<M: Metric>(engine: &mut Engine<M>, tau: f32, probe: bool) -> Vec<([u32; 2], f32)> {
    let verdict = engine.contract_pairs(&NO_GOAL, tau, probe, |_| Verdict::Continue);
    assert_eq!(verdict, Verdict::Continue);
    let pairs = engine.mesh.topology.pairs.as_ref().expect("pairs are enabled");
    pairs.list.iter().map(|pair| (pair.ends.map(|w| w.0), pair.bound)).collect()
}

#[test]
fn a_gap_between_two_triangles_is_closed_along_an_edge() {
    let width = 0.25;
    let mut engine = engine(&gap(width), 0.5);
    // Two flat triangles with doubled area 1 each: only the two gaps cost anything, a ten-thousandth of the
    // mean area times the squared width each.
    let cost = 2.0 * 1e-4 * width * width;
    let found = contract(&mut engine, 0.0, true);
    assert_eq!(found.iter().map(|pair| pair.0).collect::<Vec<_>>(), [[1, 3], [2, 5]]);
    assert!(found.iter().all(|pair| (pair.1 / cost - 1.0).abs() < 1e-3), "{found:?} instead of {cost}");
    assert_eq!((engine.tally.pairs_contracted, engine.mesh.store.live_vertices), (0, 6));
    // Above the limit nothing is contracted.
    contract(&mut engine, 0.99 * cost, false);
    assert_eq!(engine.tally.pairs_contracted, 0);
    contract(&mut engine, 1.01 * cost, false);
    let store = &engine.mesh.store;
    assert_eq!((engine.tally.pairs_contracted, engine.tally.collapses), (2, 2));
    assert_eq!((store.live_vertices, store.live_faces), (4, 2));
    assert_eq!(live_faces(&engine), [[0, 1, 2], [1, 4, 2]]);
    // Both meet in the middle of the gap.
    assert_eq!([1, 2].map(|w| store.p(VertexId(w)).x), [1.125; 2]);
    assert_eq!([1, 2].map(|w| store.merged_into[w].0), [1, 2]);
    assert_eq!([3, 5].map(|w| store.merged_into[w].0), [1, 2]);
    assert!((engine.tally.collapse_cost as f32 / cost - 1.0).abs() < 1e-3);
    assert_eq!(checked(&engine), Ok(()));
}

#[test]
fn pairs_are_within_the_reach_and_share_no_edge() {
    assert!(contract(&mut engine(&gap(0.25), 0.25), 0.0, true).is_empty());
    // Neighbours on a sheet face the same way and are no pairs; neither are the far sides of a solid.
    for small in [sheet(3), octahedron()] {
        assert!(contract(&mut engine(&small, 2.5), 0.0, true).is_empty());
    }
    // They are counted without a change, whatever the reach of the run is.
    let mut one = engine(&gap(0.25), 0.1);
    assert_eq!(one.possible_pairs(0.5), 2);
    assert_eq!(one.possible_pairs(0.2), 0);
    assert_eq!(one.mesh.store.live_vertices, 6);
}

#[test]
fn pairs_that_may_not_be_joined_are_refused() {
    let refused = |set: &dyn Fn(&mut Engine<Memoryless>), why: Refusal| {
        let mut engine = engine(&gap(0.25), 0.5);
        set(&mut engine);
        contract(&mut engine, 1.0, false);
        assert_eq!(engine.tally.pairs_contracted, 0, "{why:?}");
        assert!(engine.tally.refusals[why as usize] > 0, "{why:?}: {:?}", engine.tally.refusals);
        assert_eq!(engine.tally.refused(), engine.tally.refusals[why as usize]);
    };
    refused(&|e| e.mesh.constraints.rules.border = BorderPolicy::Lock, Refusal::Border);
    refused(&|e| e.mesh.store.lock(&[true; 6]), Refusal::Locked);
    refused(&|e| e.mesh.constraints.rules.max_valence = 2, Refusal::Valence);
    refused(&|e| e.mesh.constraints.rules.max_edge_sq = 1.2, Refusal::EdgeLength);
}

#[test]
fn a_single_locked_end_keeps_its_position() {
    let mut engine = engine(&gap(0.25), 0.5);
    engine.mesh.store.lock(&[false, false, false, true, false, true]);
    contract(&mut engine, 1.0, false);
    let store = &engine.mesh.store;
    assert_eq!(engine.tally.pairs_contracted, 2);
    assert_eq!([1, 2].map(|w| store.p(VertexId(w)).x), [1.25; 2]);
    // The kept position belongs to vertex 3 of the input.
    assert_eq!((store.merged_into[1].0, store.merged_into[3].0), (3, 3));
    assert_eq!(checked(&engine), Ok(()));
}

#[test]
fn line_quadrics_of_merged_borders_add_up() {
    let mut engine = engine_of(Quadric, &gap(0.25), &with_border(BorderPolicy::Keep));
    engine.mesh.enable_pairs(0.5);
    let trace = |engine: &Engine<Quadric>, w: usize| Quadric::tensor_of(&engine.mesh.store.v[w].q).trace();
    let lines = |engine: &Engine<Quadric>, w: usize| Quadric::tensor_of(&engine.mesh.cost.lines[w]).trace();
    // Vertex 1 has the lines to 0 and 2, with squared lengths 1.25 and 1 and weight 10. The trace of a line
    // is twice its squared length.
    assert!((lines(&engine, 1) - 2.0 * 10.0 * 2.25).abs() < 1e-3, "{}", lines(&engine, 1));
    assert!((trace(&engine, 1) - lines(&engine, 1) - 1.0).abs() < 1e-3);
    contract(&mut engine, 1.0, false);
    assert_eq!(engine.tally.pairs_contracted, 2);
    // 1 and 2 are still on the border: the lines of both ends add up.
    assert!((lines(&engine, 1) - 2.0 * 2.0 * 10.0 * 2.25).abs() < 1e-2, "{}", lines(&engine, 1));
}

#[test]
fn a_slit_is_closed_though_its_ends_share_an_edge() {
    // A sheet with a slit along 1-2: the two triangles above it end in 4, which lies on the edge 1-2.
    let slit = SmallMesh {
        points: [[0.5, -1.0], [0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, 0.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .into(),
        faces: vec![[0, 2, 1], [1, 4, 3], [4, 2, 3]],
    };
    let mut engine = engine(&slit, 1.05);
    let mut all = Vec::new();
    let alive: Vec<VertexId> = (0..5).map(VertexId).collect();
    engine.mesh.find_slits(&alive, 1.05, &mut all);
    all.sort_by_key(|pair| pair.1);
    // All three border edges of the slit, with their squared lengths.
    let found: Vec<([u32; 2], f32)> = all.iter().map(|x| (x.1.map(|w| w.0), x.0)).collect();
    assert_eq!(found, [([1, 2], 1.0), ([1, 4], 0.25), ([2, 4], 0.25)]);
    let mut none = Vec::new();
    engine.mesh.find_slits(&alive, 0.5, &mut none);
    assert!(none.is_empty());
}
