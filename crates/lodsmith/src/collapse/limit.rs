//! Bounded collapses: while a limit is set, a collapse is only done if the input near it stays within a distance of
//! the result, and the result within that distance of the input.
//!
//! ```text
//! samples of the input belong to faces of the mesh; the samples of the star that changes
//!     move to the nearest new face, or to one around the star       one beyond the limit: refused
//! new faces                                                          proven within the limit of the input
//!                                                                        and not turned against it
//! faces of the input with a sample far from the result               proven within the limit of the result
//! ```
//!
//! A refused edge is not tried again until a star at one of its ends has changed.

use glam::{DVec3, Vec3};
use lodsmith_core::measure::proof::local::BoxedFace;
use lodsmith_core::{FaceId, VertexId};

use super::bound::UNKNOWN;
use super::bounded::{
    BoundScratch, Bounded, END, MAX_BOUNDED_STAR, Moved, NearInput, homes, nearest, tree_of,
};
use super::components::Component;
use super::kind::Kind;
use super::order::NONE;
use super::parts::all_but_most_expensive;
use super::ring::{Ring, distinct};
use super::wings::Wings;
use super::{Engine, LiveMesh};
use crate::cost::metric::Metric;
use crate::report::Refusal;

/// A face of the input is tested exactly if one of its samples is farther than this share of the limit. (Measured:
/// at .6 the proof of the whole fails, and at .3 it takes no less time.)
const EXACT_SHARE: f32 = 0.5;
/// Smallest cosine between a face before and after a move of the fit.
const MIN_TURN_COS: f32 = 0.2;

impl<M: Metric> Engine<M> {
    /// Sets a limit, after a compaction.
    pub(crate) fn set_limit(&mut self, bounded: Bounded) {
        self.mesh.store.names = Some((0..self.mesh.store.t.len() as u32).collect());
        self.mesh.store.bound.fill(UNKNOWN);
        self.mesh.constraints.keeps_parts = true;
        self.mesh.constraints.cuts_necks = false;
        self.mesh.topology = super::Topology::default();
        self.mesh.bounded = Some(Box::new(bounded));
    }

    /// Removes parts of a compact mesh of which all samples are within the limit of the other parts, the cheapest
    /// first. One part stays.
    ///
    /// Cost: O(n log n).
    pub(crate) fn remove_parts_within(&mut self) {
        let (part_of, parts) = self.mesh.find_parts();
        let LiveMesh { store, bounded: Some(bounded), .. } = &mut self.mesh else { return };
        if parts.len() < 2 || bounded.samples.is_empty() {
            return;
        }
        let Some(names) = &store.names else { return };
        let tree = tree_of(store);
        let part_of = |t: &[VertexId; 3]| part_of[t[0].index()] as usize;
        let mut faces_of = vec![Vec::new(); parts.len()];
        for (face, t) in store.t.iter().enumerate() {
            faces_of[part_of(t)].push(face);
        }
        let cost: Vec<f32> = parts.iter().map(Component::weighted_cost).collect();
        let mut is_gone = vec![false; parts.len()];
        let mut moved = Vec::new();
        for part in all_but_most_expensive((0..parts.len()).collect(), &cost) {
            moved.clear();
            if !cost[part].is_finite() {
                continue;
            }
            let stays = |face: FaceId| {
                let other = part_of(&store.t[face.index()]);
                other != part && !is_gone[other]
            };
            let samples = |&face: &usize| bounded.listed(names[face]);
            let limit_of = |i: u32| match &bounded.varying {
                None => bounded.unit_limit,
                Some(_) => f64::from(bounded.limit_sq_of(i)).sqrt(),
            };
            let is_within = faces_of[part].iter().flat_map(samples).all(|(i, s)| {
                let hit = tree.closest_of_within(s.p.as_dvec3().to_array(), limit_of(i), stays);
                moved.extend(hit.map(|hit| (i, hit.face, hit.distance_sq as f32)));
                hit.is_some()
            });
            if !is_within {
                self.tally.refuse(Refusal::ErrorLimit);
                continue;
            }
            is_gone[part] = true;
            self.tally.parts_removed += 1;
            for &face in &faces_of[part] {
                bounded.heads[names[face] as usize] = END;
            }
            for &(i, face, distance_sq) in &moved {
                let next = std::mem::replace(&mut bounded.heads[names[face.index()] as usize], i);
                let s = &mut bounded.samples[i as usize];
                (s.distance_sq, s.next) = (distance_sq, next);
            }
        }
        if !is_gone.contains(&true) {
            return;
        }
        let gone: Vec<usize> = (0..store.t.len()).filter(|&face| is_gone[part_of(&store.t[face])]).collect();
        store.live_faces -= gone.len();
        gone.into_iter().for_each(|face| store.t[face][0] = NONE);
        let is_used = |t: &&[VertexId; 3]| t[0] != NONE;
        let mut used = vec![false; store.v.len()];
        store.t.iter().filter(is_used).flatten().for_each(|v| used[v.index()] = true);
        store.live_vertices = used.iter().filter(|used| **used).count();
        store.compact();
    }
}

impl<M: Metric> LiveMesh<M> {
    /// True if the mesh stays within the limit when the ends of an edge are merged at `at`, with the triangles of the
    /// star in the wings. The buffers then say where the samples go. Otherwise returns the sample that is too far, or
    /// [`END`].
    pub(super) fn stays_within(
        &self,
        bounded: &Bounded,
        ends: [VertexId; 2],
        at: Vec3,
        wings: &Wings,
        buffers: &mut BoundScratch,
    ) -> Result<(), u32> {
        let names = self.store.names.as_ref().expect("faces of a bounded run have names");
        let store = &self.store;
        let BoundScratch { star, moved, near, input_faces, corners, test, cover, .. } = buffers;
        star.set(store, at, wings);
        moved.clear();
        near.clear();
        if star.new_count > MAX_BOUNDED_STAR {
            return Err(END);
        }
        // The sample that refused last is likely to refuse again.
        for i in ends.map(|end| bounded.witness[end.index()]) {
            if let Some(s) = bounded.samples.get(i as usize)
                && star.nearest(s, bounded.limit_sq_of(i), store, wings).is_none()
            {
                return Err(i);
            }
        }
        let far_sq_of = |i: u32| EXACT_SHARE * EXACT_SHARE * bounded.limit_sq_of(i);
        let mut new = 0..;
        for (k, w) in wings.iter().enumerate() {
            // Mostly the face that takes the place of the old one is near enough.
            let successor = if w.both { None } else { new.next() };
            for (i, s) in bounded.listed(names[star.old[k] as usize]) {
                let quick = successor.map(|k| nearest(s.p, &star.faces[k..=k], (far_sq_of(i), END), k));
                let (distance_sq, to) = match quick {
                    Some(found) if found.1 != END => found,
                    _ => star.nearest(s, bounded.limit_sq_of(i), store, wings).ok_or(i)?,
                };
                moved.push(Moved { sample: i, to, distance_sq });
            }
        }
        input_faces.clear();
        let is_any_exact = !bounded.is_exact.is_empty();
        for m in moved.iter().filter(|m| is_any_exact || m.distance_sq > far_sq_of(m.sample)) {
            let sample = &bounded.samples[m.sample as usize];
            let is_far = m.distance_sq > far_sq_of(m.sample);
            let tested =
                homes(&bounded.cover, sample).filter(|face| is_far || bounded.is_exact[face.index()]);
            input_faces.extend(tested.map(|face| (face, m.to)));
        }
        if !input_faces.is_empty() {
            input_faces.sort_unstable();
            input_faces.dedup_by_key(|tested| tested.0);
            star.add_around(store, wings);
        }
        corners.clear();
        corners.extend(star.faces.iter().map(|f| BoxedFace::new(f.corners.map(Vec3::as_dvec3))));
        for &(face, mut hint) in input_faces.iter() {
            let (limit, values) = (bounded.unit_limit, bounded.values_of(face));
            let face = bounded.cover.corners(face).map(Vec3::as_dvec3);
            let is_within = match values {
                None => test.is_within_few(face, corners, limit, &mut hint),
                Some(values) => test.is_within_few_own(face, values, corners, limit, &mut hint),
            };
            if !is_within {
                return Err(END);
            }
        }
        for f in star.new_faces() {
            let NearInput { mut over, mut slot } = bounded.near[names[f.face as usize] as usize];
            let unit = f.corners.map(Vec3::as_dvec3);
            let limit = bounded.unit_limit * bounded.least_near(unit);
            if !bounded.cover.is_over(unit, limit, &mut over, cover) {
                let user = unit.map(|p| bounded.frame.user_from_unit(p));
                let is_within = match &bounded.varying {
                    None => test.is_within(user, &bounded.input, bounded.limit, &mut slot),
                    Some(varying) => {
                        test.is_within_map(user, (&bounded.input, &varying.map), bounded.limit, &mut slot)
                    }
                };
                if !is_within {
                    return Err(END);
                }
            }
            let centre = bounded.frame.user_from_unit(unit.iter().sum::<DVec3>() / 3.0);
            let below = bounded.input.tree().normal_near(centre, bounded.limit, slot);
            if below.is_some_and(|normal| normal.dot(f.normal.as_dvec3()) < 0.0) {
                return Err(END);
            }
            near.push(NearInput { over, slot });
        }
        Ok(())
    }

    /// Takes moves of vertices back as far as the limit requires: all of a move, half of it, or none. `before` has the
    /// positions and kinds before the moves.
    pub(crate) fn hold_back(&mut self, before: &[(Vec3, Kind)]) {
        let mut moves = Vec::new();
        for (i, (x, &(p, kind))) in self.store.v.iter_mut().zip(before).enumerate() {
            if x.p != p {
                moves.push((VertexId(i as u32), x.p, x.kind));
                (x.p, x.kind) = (p, kind);
            }
        }
        let (mut ring, mut wings, mut buffers) = (Ring::default(), Wings::default(), BoundScratch::default());
        for (u, to, kind) in moves {
            self.store.ring(u, &mut ring);
            wings.clear();
            wings.add_rim(&ring, |_| false);
            let x = &self.store.v[u.index()];
            let (from, origin) = (x.p, x.origin);
            for at in [to, from.lerp(to, 0.5)] {
                let is_upright = wings.iter().all(|w| {
                    let [a, b] = [w.a, w.b].map(|w| self.store.p(w));
                    let [old, new] = [from, at].map(|p| (a - p).cross(b - p));
                    old.dot(new) > MIN_TURN_COS * old.length() * new.length() || old == Vec3::ZERO
                });
                let bounded = self.bounded.as_ref().expect("a limit is set");
                if is_upright && self.stays_within(bounded, [origin; 2], at, &wings, &mut buffers).is_ok() {
                    let x = &mut self.store.v[u.index()];
                    (x.p, x.kind) = (at, kind);
                    self.move_samples(&buffers);
                    break;
                }
            }
        }
    }

    /// Moves the samples after a collapse that was tested, and marks what has changed around the merged vertex `u`.
    pub(super) fn note_bounded(&mut self, u: VertexId, buffers: &mut BoundScratch) {
        self.move_samples(buffers);
        let Self { store, bounded, .. } = self;
        let Some(bounded) = bounded else { return };
        bounded.change += 1;
        let [around, beyond] = &mut buffers.rings;
        store.ring(u, around);
        for w in distinct(around).chain([u]) {
            bounded.changes[store.v[w.index()].origin.index()] = bounded.change;
            // (At a hub nearly all edges are as they were.)
            if store.listed(w).len() > MAX_BOUNDED_STAR {
                continue;
            }
            store.ring(w, beyond);
            buffers.star.visited += beyond.len() as u64;
            for x in beyond.iter().flat_map(|r| [r.a, r.b]).chain([w]) {
                let bound = &mut store.bound[x.index()];
                if *bound == f32::INFINITY && x != NONE {
                    *bound = UNKNOWN;
                }
            }
        }
    }

    /// Gives samples to the faces that a test found.
    fn move_samples(&mut self, buffers: &BoundScratch) {
        let (Some(bounded), Some(names)) = (&mut self.bounded, &self.store.names) else { return };
        let BoundScratch { star, moved, near, .. } = buffers;
        for &face in &star.old {
            bounded.heads[names[face as usize] as usize] = END;
        }
        for m in moved {
            let head = &mut bounded.heads[names[star.faces[m.to as usize].face as usize] as usize];
            let s = &mut bounded.samples[m.sample as usize];
            (s.distance_sq, s.next) = (m.distance_sq, std::mem::replace(head, m.sample));
        }
        for (f, near) in star.new_faces().iter().zip(near) {
            bounded.near[names[f.face as usize] as usize] = *near;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lodsmith_core::Surface;
    use lodsmith_core::geometry::UnitFrame;
    use lodsmith_core::measure::Prepared;

    use super::*;
    use crate::collapse::Engine;
    use crate::collapse::bounded::Sampling;
    use crate::collapse::candidate::CollapseOutcome;
    use crate::collapse::test_support::{checked, engine_of, try_at, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::test_support::{SmallMesh, sheet};

    const FRAME: UnitFrame = UnitFrame::with_size([0.0; 3], 1.0);

    /// Returns an engine of a flat sheet of 5 × 5 cells that has to stay within a distance of itself.
    fn bounded(limit: f64, is_two_sided: bool) -> (SmallMesh, Engine<Memoryless>) {
        let small = sheet(5);
        let mut engine = engine_of(Memoryless, &small, &without_lines());
        let mesh = small.mesh();
        let input = Arc::new(Prepared::new(&mesh.surface()).expect("there are faces"));
        let given = (&small.points[..], &small.triangles()[..]);
        let kept = is_two_sided.then_some(Sampling { dense: &[], samples: 180_000.0 });
        let bounded = Bounded::new(input, FRAME, limit, given, kept, &engine.mesh.store);
        engine.set_limit(bounded);
        (small, engine)
    }

    /// Counts the samples in all lists.
    fn listed(engine: &Engine<Memoryless>) -> usize {
        let bounded = engine.mesh.bounded.as_ref().expect("a limit is set");
        (0..bounded.heads.len() as u32).map(|name| bounded.listed(name).count()).sum()
    }

    #[test]
    fn a_collapse_beyond_the_limit_is_refused_and_changes_nothing() {
        for is_two_sided in [true, false] {
            let (_, mut engine) = bounded(0.1, is_two_sided);
            let samples = listed(&engine);
            // (36 vertices, and at least the centres of 50 faces.)
            assert_eq!(samples >= 86, is_two_sided, "{samples}");
            let before = engine.mesh.store.t.clone();
            let outcome = try_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.12), f32::MAX);
            assert!(matches!(outcome, CollapseOutcome::Refused(Refusal::ErrorLimit)));
            assert_eq!((engine.mesh.store.t == before, listed(&engine)), (true, samples));
            let outcome = try_at(&mut engine, [14, 15], Vec3::new(0.5, 0.0, 0.09), f32::MAX);
            assert!(matches!(outcome, CollapseOutcome::Done));
            // No sample is lost, and each knows its new distance.
            assert_eq!(listed(&engine), samples);
            let farthest =
                |bounded: &Bounded| bounded.samples.iter().map(|s| s.distance_sq).fold(0.0, f32::max).sqrt();
            let farthest = farthest(engine.mesh.bounded.as_ref().expect("a limit is set"));
            assert!(
                if is_two_sided { (0.05..0.1).contains(&farthest) } else { farthest == 0.0 },
                "{farthest}"
            );
            assert_eq!(checked(&engine), Ok(()));
        }
    }

    #[test]
    fn a_refused_edge_waits_until_a_star_at_its_ends_changes() {
        let (_, mut engine) = bounded(0.1, true);
        let ends = [14, 15].map(VertexId);
        let was_refused = |engine: &Engine<Memoryless>, cost| {
            engine.mesh.bounded.as_ref().is_some_and(|bounded| bounded.was_refused(ends, cost))
        };
        assert!(!was_refused(&engine, 1.0));
        engine.mesh.bounded.as_mut().expect("a limit is set").set_tried(ends[0], 2.0);
        engine.mesh.store.bound[7] = f32::INFINITY;
        engine.mesh.store.bound[5] = f32::INFINITY;
        assert!(was_refused(&engine, 1.0) && !was_refused(&engine, 3.0));
        // Far away, and next to it: the vertices around are tried again.
        assert!(matches!(try_at(&mut engine, [32, 33], Vec3::X * 0.5, f32::MAX), CollapseOutcome::Done));
        assert!(was_refused(&engine, 1.0) && engine.mesh.store.bound[7] == f32::INFINITY);
        assert!(matches!(try_at(&mut engine, [8, 9], Vec3::X * 0.5, f32::MAX), CollapseOutcome::Done));
        assert!(!was_refused(&engine, 1.0) && engine.mesh.store.bound[7] == UNKNOWN);
        assert_eq!(engine.mesh.store.bound[5], f32::INFINITY);
    }

    #[test]
    fn no_face_is_turned_against_the_input() {
        for is_turned in [false, true] {
            let (small, mut engine) = bounded(0.1, true);
            let turned: Vec<[VertexId; 3]> = small.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
            let mesh = small.mesh();
            let surface = Surface::new(mesh.surface().positions(), &turned).expect("the same vertices");
            let turned = Arc::new(Prepared::new(&surface).expect("there are faces"));
            if is_turned {
                engine.mesh.bounded.as_mut().expect("a limit is set").input = turned;
            }
            let outcome = try_at(&mut engine, [14, 15], Vec3::X * 0.5, f32::MAX);
            assert_eq!(matches!(outcome, CollapseOutcome::Refused(Refusal::ErrorLimit)), is_turned);
            assert_eq!(matches!(outcome, CollapseOutcome::Done), !is_turned);
        }
    }

    #[test]
    fn moves_of_the_fit_are_taken_back_as_far_as_the_limit_requires() {
        let (_, mut engine) = bounded(0.1, true);
        let before: Vec<_> = engine.mesh.store.v.iter().map(|x| (x.p, x.kind)).collect();
        for (u, height) in [(7, 0.05), (16, 0.15), (28, 0.5)] {
            let x = &mut engine.mesh.store.v[u];
            (x.p.z, x.kind) = (height, x.kind.moved(true));
        }
        engine.mesh.hold_back(&before);
        let height = |u: usize| (engine.mesh.store.v[u].p.z, engine.mesh.store.v[u].kind.is_moved());
        assert_eq!([height(7), height(16), height(28)], [(0.05, true), (0.075, true), (0.0, false)]);
    }
}
