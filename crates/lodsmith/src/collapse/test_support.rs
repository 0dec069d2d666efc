//! Fixtures for the engine's unit tests that need its internal types: engines of small meshes without
//! ordering, welding and unit frame, and single collapses in them.

use glam::Vec3;
use lodsmith_core::{VertexId, WedgeId};

use super::attributes::Attributes;
use super::candidate::{Attempt, Candidate, CollapseOutcome};
use super::invariants::Checks;
use super::order;
use super::ring::Ring;
use super::store::Store;
use super::{Engine, Wedges};
use crate::cost::guard::Rules;
use crate::cost::metric::Metric;
use crate::options::{BorderPolicy, SimplifyOptions, Stop};
use crate::test_support::SmallMesh;

/// Options without lines along borders: only the surface counts.
pub(super) fn without_lines() -> SimplifyOptions {
    with_border(BorderPolicy::Free)
}

pub(super) fn with_border(border: BorderPolicy) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::faces(1));
    options.border = border;
    options
}

/// Returns an engine of a small mesh, before its first sweep.
pub(super) fn engine_of<M: Metric>(metric: M, small: &SmallMesh, options: &SimplifyOptions) -> Engine<M> {
    let store = Store::new(&small.points, small.triangles(), None, None);
    finished(metric, small, store, options, None)
}

/// Returns an engine of a small mesh with these wedges at its corners, and one value for each wedge, with
/// weight 1 in the cost.
pub(super) fn engine_with_values<M: Metric>(
    metric: M,
    small: &SmallMesh,
    (wedges, values): (&[[u32; 3]], &[f32]),
    options: &SimplifyOptions,
) -> Engine<M> {
    let wedges = wedges.iter().map(|t| t.map(WedgeId)).collect();
    let store = Store::new(&small.points, small.triangles(), Some(wedges), None);
    let mut attributes = Attributes::new(values.len(), 1, Vec::new(), Vec::new(), values, Vec::new());
    attributes.weights_mut()[0] = 1.0;
    finished(metric, small, store, options, Some(attributes))
}

fn finished<M: Metric>(
    metric: M,
    small: &SmallMesh,
    store: Store<M::Memory>,
    options: &SimplifyOptions,
    attributes: Option<Attributes>,
) -> Engine<M> {
    let mesh = small.mesh();
    let ordered = order::order(&mesh.surface());
    let rules = Rules::new(options, ordered.frame, ordered.diagonal);
    let none: Option<Wedges> = None;
    let (mut engine, duplicates) = Engine::new(metric, store, rules, none, attributes);
    assert_eq!(duplicates, 0, "there are duplicate faces");
    let mean = engine.mesh.cost.total_area / engine.mesh.store.live_faces as f64;
    engine.mesh.cost.area = mean as f32;
    engine
}

pub(super) fn ring_of<M: Metric>(engine: &Engine<M>, u: u32) -> Ring {
    let mut ring = Ring::default();
    engine.mesh.store.ring(VertexId(u), &mut ring);
    ring
}

/// Tries to merge `removed` into `kept` at the position of `kept` + `step`, if that costs at most `tau`.
pub(super) fn try_at<M: Metric>(
    engine: &mut Engine<M>,
    [kept, removed]: [u32; 2],
    step: Vec3,
    tau: f32,
) -> CollapseOutcome {
    attempt(engine, [kept, removed], step, tau, false)
}

fn attempt<M: Metric>(
    engine: &mut Engine<M>,
    [kept, removed]: [u32; 2],
    step: Vec3,
    tau: f32,
    is_probe: bool,
) -> CollapseOutcome {
    let rings = [kept, removed].map(|w| ring_of(engine, w));
    let candidate = Candidate { cost: 0.0, removed: VertexId(removed), step, form_cost: 0.0 };
    let rings = [&rings[0], &rings[1]];
    engine.collapse(&Attempt { kept: VertexId(kept), candidate: &candidate, tau, is_probe, rings })
}

/// Returns the exact cost of merging `removed` into `kept` at the position of `kept` + `step`, or why that is
/// refused. Changes nothing.
pub(super) fn cost_at<M: Metric>(
    engine: &mut Engine<M>,
    ends: [u32; 2],
    step: Vec3,
) -> Result<f32, crate::report::Refusal> {
    match attempt(engine, ends, step, f32::MAX, true) {
        CollapseOutcome::Later(cost) => Ok(cost),
        CollapseOutcome::Refused(why) => Err(why),
        CollapseOutcome::Done => unreachable!("a probe changes nothing"),
    }
}

/// Returns an error if the data of the engine contradict its faces.
pub(super) fn checked<M: Metric>(engine: &Engine<M>) -> Result<(), String> {
    engine.check(&mut Checks::default())
}

/// Returns the live faces, each starting at its lowest vertex, in order.
pub(super) fn live_faces<M: Metric>(engine: &Engine<M>) -> Vec<[u32; 3]> {
    let living = engine.mesh.store.t.iter().filter(|t| t[0] != order::NONE);
    let turned = living.map(|t| {
        let [a, b, c] = t.map(|w| w.0);
        [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or_default()
    });
    let mut faces: Vec<[u32; 3]> = turned.collect();
    faces.sort_unstable();
    faces
}

/// # Panics
/// If two numbers differ by more than a ten thousandth.
#[track_caller]
pub(super) fn assert_near(is: f32, wanted: f32) {
    assert!((is - wanted).abs() <= 1e-4 * wanted.abs(), "{is} instead of {wanted}");
}
