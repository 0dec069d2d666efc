//! Merging of wedges, in meshes of a few faces with one value for each wedge.

use super::*;
use crate::collapse::Engine;
use crate::collapse::candidate::CollapseOutcome;
use crate::collapse::test_support::{
    assert_near, checked, cost_at, engine_with_values, ring_of, try_at, without_lines,
};
use crate::cost::metric::Memoryless;
use crate::test_support::{SmallMesh, pyramid, sheet};

/// Returns an engine of a mesh with one wedge for each vertex.
fn smooth(small: &SmallMesh, value: impl Fn(Vec3) -> f32) -> Engine<Memoryless> {
    let values: Vec<f32> = small.points.iter().map(|p| value(*p)).collect();
    engine_with_values(Memoryless, small, (&small.faces, &values), &without_lines())
}

/// Returns an engine of a sheet of 4 × 4 cells with a seam along its middle column x = 2, where values jump: on the
/// left wedge i belongs to vertex i, on the right wedge 25 + i.
fn with_seam(left: f32, right: f32) -> Engine<Memoryless> {
    let small = sheet(4);
    let is_right = |t: &[u32; 3]| t.iter().any(|v| v % 5 > 2);
    let wedges: Vec<[u32; 3]> =
        small.faces.iter().map(|t| t.map(|v| if is_right(t) { v + 25 } else { v })).collect();
    let values: Vec<f32> = (0..50).map(|w| if w < 25 { left } else { right }).collect();
    engine_with_values(Memoryless, &small, (&wedges, &values), &without_lines())
}

/// Returns the wedges of a vertex in order.
fn wedges_of(engine: &Engine<Memoryless>, u: u32) -> Vec<u32> {
    let attributes = engine.mesh.values.attributes.as_ref().expect("there are values");
    let first = engine.mesh.store.first_wedge[u as usize];
    let mut all: Vec<u32> = attributes.chain(first).map(|w| w.0).collect();
    all.sort_unstable();
    all
}

/// Returns the wedges that the live faces have at a vertex, in order.
fn corners_of(engine: &Engine<Memoryless>, u: u32) -> Vec<u32> {
    let wedges = engine.mesh.store.wedges.as_ref().expect("there are wedges");
    let ring = ring_of(engine, u);
    let mut all: Vec<u32> = ring.iter().map(|r| wedges[r.corner.face()][r.corner.k()].0).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn value(engine: &Engine<Memoryless>, wedge: u32) -> f32 {
    engine.mesh.values.attributes.as_ref().expect("there are values").of(WedgeId(wedge))[0]
}

fn is_done(outcome: &CollapseOutcome) -> bool {
    matches!(outcome, CollapseOutcome::Done)
}

#[test]
fn a_peak_of_values_costs_its_variance_over_the_area() {
    // The value is 1 at the apex of a flat pyramid and 0 on its rim. Corner 1 has the doubled area 4, and its value
    // extrapolates to 0; the apex has 8, and extrapolates to 1: together 2/3. The sides on the edge
    // extrapolate to 0 there (and count twice), the others to 2.
    let mut engine = smooth(&pyramid(0.0), |p| if p == Vec3::ZERO { 1.0 } else { 0.0 });
    let [near, far] = [0.0f32, 2.0].map(|x| (x - 2.0 / 3.0).powi(2));
    let wanted = 2.0 * (2.0 * 2.0) * near + 2.0 * 2.0 * far;
    assert_near(wanted, 32.0 / 3.0);
    assert_near(cost_at(&mut engine, [1, 0], Vec3::ZERO).unwrap(), wanted);
    assert!(is_done(&try_at(&mut engine, [1, 0], Vec3::ZERO, 10.7)));
    assert_near(value(&engine, 1), 2.0 / 3.0);
    assert_eq!(checked(&engine), Ok(()));
}

#[test]
fn values_that_are_linear_cost_nothing_and_stay_linear() {
    let linear = |p: Vec3| 3.0 + 0.25 * p.x - 0.5 * p.y;
    let mut engine = smooth(&sheet(5), linear);
    for step in [Vec3::ZERO, Vec3::X, Vec3::X * 0.5, Vec3::new(0.25, 0.1, 0.0)] {
        let cost = cost_at(&mut engine, [14, 15], step).unwrap();
        assert!(cost < 1e-8, "{cost} at {step}");
    }
    let step = Vec3::new(0.25, 0.1, 0.0);
    assert!(is_done(&try_at(&mut engine, [14, 15], step, 1.0)));
    assert_near(value(&engine, 14), linear(Vec3::new(2.25, 2.1, 0.0)));
    assert_eq!(checked(&engine), Ok(()));
    // Off the sheet the value stays that of the nearest point on it.
    let mut engine = smooth(&sheet(5), linear);
    assert!(is_done(&try_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.2), f32::MAX)));
    assert_near(value(&engine, 14), linear(Vec3::new(2.5, 2.0, 0.0)));
}

#[test]
fn the_form_of_an_edge_counts_values_like_its_triangles() {
    let bump = |p: Vec3| (-(p - Vec3::new(2.0, 2.0, 0.0)).length_squared()).exp();
    let mut engine = smooth(&sheet(5), bump);
    // Without the guess of the largest distance.
    engine.mesh.cost.area = 0.0;
    let ring = ring_of(&engine, 14);
    for step in [Vec3::ZERO, Vec3::X, Vec3::X * 0.5, Vec3::new(0.25, 0.1, 0.0)] {
        let exact = cost_at(&mut engine, [14, 15], step).unwrap();
        assert!(exact > 0.1, "{exact} at {step}");
        assert_near(engine.mesh.cost_at(VertexId(14), VertexId(15), step, &ring, &mut Vec::new()), exact);
    }
}

#[test]
fn along_a_seam_each_side_merges_with_itself() {
    let mut engine = with_seam(1.0, 5.0);
    assert_eq!([7, 12, 17].map(|u| wedges_of(&engine, u)), [[7, 32], [12, 37], [17, 42]]);
    assert_eq!(wedges_of(&engine, 11), [11]);
    // Constant on each side: no cost, and no value crosses the seam.
    let cost = cost_at(&mut engine, [12, 17], Vec3::Y * 0.5).unwrap();
    assert!(cost < 1e-8, "{cost}");
    assert!(is_done(&try_at(&mut engine, [12, 17], Vec3::Y * 0.5, 1.0)));
    assert_eq!(wedges_of(&engine, 12), [12, 37]);
    assert_eq!(corners_of(&engine, 12), [12, 37]);
    assert_eq!([12, 37].map(|w| value(&engine, w)), [1.0, 5.0]);
    assert_eq!(checked(&engine), Ok(()));
}

#[test]
fn in_a_collapse_across_a_seam_the_wedge_of_the_other_side_stays() {
    // 11 has one wedge on the left; 12 on the seam has two. Only the left ones are on the triangles of the edge.
    for [kept, removed] in [[11, 12], [12, 11]] {
        let mut engine = with_seam(1.0, 5.0);
        let step = engine.mesh.store.p(VertexId(12)) - engine.mesh.store.p(VertexId(kept));
        assert!(is_done(&try_at(&mut engine, [kept, removed], step, 1.0)), "{removed} into {kept}");
        // The merged wedge has the number of the kept end's; 37 stays on the right.
        assert_eq!(wedges_of(&engine, kept), [kept, 37]);
        assert_eq!(corners_of(&engine, kept), [kept, 37]);
        assert_eq!([kept, 37].map(|w| value(&engine, w)), [1.0, 5.0]);
        assert_eq!(checked(&engine), Ok(()));
    }
}

#[test]
fn a_locked_end_keeps_its_wedges_and_their_values() {
    let mut engine = smooth(&sheet(5), |p| p.x * p.x);
    let mut locked = vec![false; 36];
    locked[15] = true;
    engine.mesh.store.lock(&locked);
    assert!(is_done(&try_at(&mut engine, [14, 15], Vec3::X, f32::MAX)));
    assert_eq!(wedges_of(&engine, 14), [15]);
    assert_eq!(value(&engine, 15), 9.0);
    // If 11 is locked it may not get the right wedge of 12; if 12 is, its left wedge replaces the wedge of
    // 11.
    let is_kept = |locked: usize| {
        let mut engine = with_seam(1.0, 5.0);
        engine.mesh.store.v[locked].kind = engine.mesh.store.v[locked].kind.locked(true);
        engine.mesh.keeps_wedges(VertexId(11), VertexId(12), &ring_of(&engine, 11))
    };
    assert!(is_kept(12) && !is_kept(11));
}

#[test]
fn groups_are_made_by_the_triangles_on_the_edge() {
    let engine = with_seam(1.0, 5.0);
    let gather = |u: u32, v: u32, others: bool| {
        let (attributes, mut members) = (engine.mesh.values.attributes.as_ref().unwrap(), Vec::new());
        engine.mesh.gather(attributes, VertexId(u), VertexId(v), &ring_of(&engine, u), others, &mut members);
        members.iter().map(|m| (m.wedge.0, m.at_v, members[m.group].wedge.0)).collect::<Vec<_>>()
    };
    assert_eq!(gather(11, 6, true), [(11, false, 11), (6, true, 11)]);
    let mut along = gather(12, 17, true);
    along.sort_unstable();
    assert_eq!(along, [(12, false, 12), (17, true, 12), (37, false, 37), (42, true, 37)]);
    // Across: the right wedge of 12 is in no triangle on the edge, and listed only if the others are
    // requested.
    assert_eq!(gather(11, 12, false), [(11, false, 11), (12, true, 11)]);
    assert_eq!(gather(11, 12, true), [(11, false, 11), (12, true, 11), (37, true, 37)]);
}

#[test]
fn chains_are_split_and_shared() {
    let mut engine = with_seam(1.0, 5.0);
    let mut ring = Ring::default();
    // A vertex gets its own wedge, with the values of its first triangle's wedge.
    engine.mesh.split_wedge(VertexId(11), &mut ring);
    assert_eq!((wedges_of(&engine, 11), corners_of(&engine, 11)), (vec![50], vec![50]));
    assert_eq!(value(&engine, 50), 1.0);
    // Equal wedges at two vertices are shared; others are not.
    let mut engine = with_seam(1.0, 5.0);
    engine.mesh.share_wedges(VertexId(11), VertexId(12), &mut ring);
    assert_eq!(corners_of(&engine, 12), [11, 37]);
}

#[test]
fn a_pair_of_wedges_costs_the_same_as_a_group_of_two() {
    let bump = |p: Vec3| (p.x * 1.7).sin() * (p.y * 2.3).cos();
    let mut bent = sheet(5);
    bent.points.iter_mut().for_each(|p| p.z = 0.2 * (p.x * p.y).sin());
    let engine = smooth(&bent, bump);
    let attributes = engine.mesh.values.attributes.as_ref().expect("there are values");
    for [u, v] in [[14u32, 15], [14, 21], [15, 14], [8, 15]] {
        let d = engine.mesh.store.p(VertexId(v)) - engine.mesh.store.p(VertexId(u));
        // Pairs start with the kept end; anything else is summed as a group.
        let form = |order: [(u32, bool); 2]| {
            let members = order.map(|(w, at_v)| Member { wedge: WedgeId(w), at_v, group: 0 });
            let (mut sum, mut form) = (Sum::ZERO, Form::default());
            attributes.add_to(&members, d, &mut sum);
            sum.add_to(&mut form);
            form
        };
        let [pair, group] = [form([(u, false), (v, true)]), form([(v, true), (u, false)])];
        let size = pair.a.trace() + pair.c;
        let off = (pair.h - group.h).abs().max_element().max((pair.c - group.c).abs());
        let off_a = pair.a.less(&group.a).0.into_iter().fold(0f32, |most, x| most.max(x.abs()));
        assert!(size > 1e-3 && off.max(off_a) < 1e-5 * size.max(1.0), "{u}-{v}: {pair:?} and {group:?}");
    }
}
