//! Removal of whole parts, if the target cannot be reached otherwise.
//!
//! A run that ends stuck above its target with more than one part left resumes from a snapshot of a state
//! in which sweeps were still productive ([`super::snapshot`]), and continues with the parts in order of
//! cost: a tiny part is then removed when it is cheaper than the current collapses, instead of after all the
//! expensive ones.

use glam::Vec3;
use lodsmith_core::VertexId;
use lodsmith_core::sorted::{indices_by_key, key_of};

use super::components::{Component, Parts, labels, measure_parts};
use super::invariants::need;
use super::order::NONE;
use super::vertex::Vertex;
use super::{Engine, Goal, LiveMesh};
use crate::cost::metric::Metric;
use crate::options::{BorderPolicy, TopologyPolicy};

/// Factor of the cost of parts if the topology may change and they are removed in order of cost: as expensive
/// as the collapses that would move their far ends to the rest of the surface. (Half the size squared, times
/// twice the area, is an eighth of the cost of a collapse for a rod that is attached at one end. Measured
/// against 1: brain_mri at 1 % has 0.155 % RMS instead of 0.183, at 8,000 faces 0.119 instead of 0.138,
/// heptoroid at 50 faces 7.3 instead of 13.9.)
const FREE_PART_WEIGHT: f32 = 8.0;

/// Share of the faces above which cheap parts block a run that keeps them. (The RMS distance is about
/// inversely proportional to the count, so with fewer faces to gain, the rest would not improve much.)
const MIN_BLOCKING_SHARE: f64 = 0.2;
/// Below this number of remaining faces the cost of parts is checked in every run: the check takes almost no
/// time there, and the few sweeps of such a run do not show whether it is productive. (Guessed.)
const ALWAYS_CHECKED_BELOW_FACES: usize = 10_000;
/// Maximum share of the target by which removing a part may undershoot it.
const MAX_OVERSHOOT: f64 = 0.1;
/// Maximum undershoot if nothing else reaches the target. (Guessed: compared with less than half of the
/// requested faces, a result above the target is closer to it.)
const MAX_LAST_OVERSHOOT: f64 = 0.5;

/// Sorts ascending indices by cost, the cheapest first, and drops the most expensive.
pub(super) fn all_but_most_expensive(all: Vec<usize>, cost: &[f32]) -> Vec<usize> {
    let mut order = indices_by_key(all.iter().map(|&i| key_of(f64::from(cost[i]))));
    order.pop();
    order.into_iter().map(|k| all[k]).collect()
}

impl<M: Metric> Engine<M> {
    /// Removes whole parts, the cheapest first, until the goal is reached or one part is left. Returns true
    /// if it is reached.
    pub(crate) fn remove_parts(&mut self, goal: &Goal) -> bool {
        let stay = self.mesh.constraints.keeps_parts
            || self.mesh.constraints.rules.topology == TopologyPolicy::Preserve;
        if stay || self.mesh.needed(goal).is_none() {
            return false;
        }
        self.mesh.store.compact();
        let (part_of, parts) = self.mesh.find_parts();
        let weighted_cost: Vec<f32> = parts.iter().map(Component::weighted_cost).collect();
        let mut order = all_but_most_expensive((0..parts.len()).collect(), &weighted_cost);
        order.retain(|&i| parts[i].cost_factor < f32::INFINITY);
        let faces: Vec<usize> = parts.iter().map(|p| p.faces).collect();
        let cost: Vec<f32> = parts.iter().map(Component::cost).collect();
        if let Some(record) = &mut self.record {
            record.raise_floor();
        }
        self.drop_parts(goal, &order, true, &faces, &cost, &part_of);
        self.mesh.needed(goal) == Some(0)
    }

    /// True if keeping all parts made a run expensive: parts with many of the faces would have been cheaper
    /// to remove than some of its collapses. `cuts` is true if necks could be cut as well. Cost: O(n), but
    /// only for a run that became unproductive or is small.
    pub(crate) fn has_blocking_parts(&self, cuts: bool) -> bool {
        let is_asked = self.tally.is_unproductive || self.mesh.store.live_faces < ALWAYS_CHECKED_BELOW_FACES;
        if !is_asked || self.mesh.topology.parts.is_some() {
            return false;
        }
        let parts = self.mesh.find_parts().1;
        let weight = if cuts { FREE_PART_WEIGHT } else { 1.0 };
        let rates: Vec<f32> = parts
            .iter()
            .map(|p| self.mesh.cost_per_face_pair(p, weight * p.weighted_cost(), p.faces))
            .collect();
        let all = (0..parts.len()).filter(|&i| parts[i].faces > 0).collect();
        let cheap = all_but_most_expensive(all, &rates)
            .into_iter()
            .filter(|&i| rates[i] <= self.tally.highest_threshold);
        let faces: usize = cheap.map(|i| parts[i].faces).sum();
        faces as f64 > MIN_BLOCKING_SHARE * self.mesh.store.live_faces as f64
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the cost per two faces of a part whose weighted cost is `weighted_cost` and which has `faces`
    /// faces left.
    fn cost_per_face_pair(&self, part: &Component, weighted_cost: f32, faces: usize) -> f32 {
        self.cost.metric.part_cost_per_face_pair(
            2.0 * weighted_cost / faces as f32,
            &part.size(faces),
            self.cost.mean_face,
        )
    }
}

impl<M: Metric> Engine<M> {
    /// Enables the removal of parts in order of cost. The store is compact.
    pub(crate) fn enable_part_removal(&mut self) {
        let (label, parts) = self.mesh.find_parts();
        let mut part_of = vec![0; self.mesh.store.merged_into.len()];
        for (x, &l) in self.mesh.store.v.iter().zip(&label) {
            part_of[x.origin.index()] = l;
        }
        self.set_parts(part_of, parts);
    }

    /// Enables the removal of parts in a running engine, with their size in the input, given by these
    /// positions and faces. Uses the current parts if necks were cut or pairs contracted since.
    pub(super) fn enable_part_removal_as_in(&mut self, points: &[Vec3], faces: &[[VertexId; 3]]) {
        if self.changes_of_parts() != [0, 0] {
            return self.enable_part_removal();
        }
        let part_of = labels(points.len(), faces);
        let mut parts = measure_parts(&part_of, |w| points[w.index()], faces);
        for x in &self.mesh.store.v {
            let part = &mut parts[part_of[x.origin.index()] as usize];
            part.cost_factor = part.cost_factor.max(self.mesh.absence_cost_factor(x));
        }
        self.mesh.keep_locked_borders(&part_of, faces, &mut parts);
        self.set_parts(part_of, parts);
    }

    fn set_parts(&mut self, part_of: Vec<u32>, parts: Vec<Component>) {
        let weight = if self.mesh.constraints.cuts_necks { FREE_PART_WEIGHT } else { 1.0 };
        let cost = parts.iter().map(|p| p.cost() * weight).collect();
        let weighted_cost = parts.iter().map(|p| p.weighted_cost() * weight).collect();
        self.mesh.topology.parts =
            Some(Parts { part_of, of_input: parts, cost, weighted_cost, changes: self.changes_of_parts() });
    }

    /// Removes the parts whose cost per two faces (as many as a collapse removes) is at most `tau`.
    pub(crate) fn drop_cheap_parts(&mut self, goal: &Goal, tau: f32) {
        if self.mesh.topology.parts.as_ref().is_some_and(|p| p.changes != self.changes_of_parts()) {
            // Cuts have created new parts, and pair contractions have joined some.
            self.mesh.store.compact();
            self.enable_part_removal();
        }
        let Some(parts) = self.mesh.topology.parts.take() else { return };
        let mut faces = vec![0usize; parts.cost.len()];
        for t in self.mesh.store.t.iter().filter(|t| t[0] != NONE) {
            faces[parts.part_of[self.mesh.store.v[t[0].index()].origin.index()] as usize] += 1;
        }
        let rate =
            |i: usize| self.mesh.cost_per_face_pair(&parts.of_input[i], parts.weighted_cost[i], faces[i]);
        let rates: Vec<f32> = (0..faces.len()).map(rate).collect();
        let mut order = all_but_most_expensive((0..faces.len()).filter(|&i| faces[i] > 0).collect(), &rates);
        order.retain(|&i| rates[i] <= tau);
        if !order.is_empty() {
            let part_of: Vec<u32> =
                self.mesh.store.v.iter().map(|x| parts.part_of[x.origin.index()]).collect();
            self.drop_parts(goal, &order, false, &faces, &parts.cost, &part_of);
        }
        self.mesh.topology.parts = Some(parts);
    }

    /// Returns an error if the tracked parts are inconsistent: each number must have an existing part, and
    /// each face must be in one part. (Skipped after cuts and pair contractions: then parts are found again
    /// before their next use.)
    pub(super) fn check_parts(&self, parts: &Parts) -> Result<(), String> {
        let (of, count) = (&parts.part_of, parts.cost.len());
        if parts.changes != self.changes_of_parts() {
            return Ok(());
        }
        let numbers = self.mesh.store.merged_into.len();
        need(of.len() == numbers, || format!("{numbers} numbers have parts for {}", of.len()))?;
        for (f, t) in self.mesh.store.t.iter().enumerate().filter(|t| t.1[0] != NONE) {
            let [a, b, c] = t.map(|w| of[self.mesh.store.v[w.index()].origin.index()] as usize);
            need(a == b && b == c && c < count, || format!("face {f} is in parts {a}, {b}, {c} of {count}"))?;
        }
        Ok(())
    }

    fn changes_of_parts(&self) -> [usize; 2] {
        [self.tally.necks_cut, self.tally.pairs_contracted]
    }

    /// Removes these parts, in this order, until the goal is reached, except parts whose removal would leave
    /// the result far below it; `part_of` is by vertex of the store. With `at_last` (nothing else is left),
    /// one of those may be removed at the end.
    fn drop_parts(
        &mut self,
        goal: &Goal,
        order: &[usize],
        at_last: bool,
        faces: &[usize],
        cost: &[f32],
        part_of: &[u32],
    ) {
        let mut gone = vec![false; faces.len()];
        let faces_of = self.record.as_ref().map(|_| self.faces_of_parts(part_of, faces.len()));
        let mut vertices = vec![0usize; faces.len()];
        for (_, &p) in self.mesh.store.v.iter().zip(part_of).filter(|x| !x.0.kind.is_gone()) {
            vertices[p as usize] += 1;
        }
        let (mut at, mut too_large) = (0, Vec::new());
        while self.mesh.needed(goal) != Some(0) {
            let (faces_left, vertices_left) = (self.mesh.store.live_faces, self.mesh.store.live_vertices);
            let left = |i: usize| (faces_left - faces[i], vertices_left - vertices[i]);
            let i = match order.get(at) {
                Some(&i) if !is_far_below(goal, left(i), MAX_OVERSHOOT) => i,
                Some(&i) => {
                    too_large.push(i);
                    at += 1;
                    continue;
                }
                // The part whose removal leaves the most faces.
                None if at_last => {
                    let fitting = too_large.iter().copied();
                    let fitting = fitting.filter(|&i| !is_far_below(goal, left(i), MAX_LAST_OVERSHOOT));
                    let Some(i) = fitting.min_by_key(|&i| (faces[i], i)) else { break };
                    too_large.clear();
                    i
                }
                None => break,
            };
            at += 1;
            gone[i] = true;
            self.tally.removed_part_cost += f64::from(cost[i]);
            self.mesh.store.live_faces -= faces[i];
            self.mesh.store.live_vertices -= vertices[i];
            self.tally.parts_removed += 1;
            if let Some(faces_of) = &faces_of {
                faces_of[i].iter().for_each(|&f| self.mesh.store.t[f][0] = NONE);
                let face = 2.0 * cost[i] / faces[i].max(1) as f32;
                self.log_change(faces_of[i].iter().copied(), &[], face);
            }
        }
        for t in self.mesh.store.t.iter_mut().filter(|t| t[0] != NONE) {
            if gone[part_of[t[0].index()] as usize] {
                t[0] = NONE;
            }
        }
        self.mesh.store.compact();
    }

    /// Returns the live faces of each part.
    fn faces_of_parts(&self, part_of: &[u32], parts: usize) -> Vec<Vec<usize>> {
        let mut faces = vec![Vec::new(); parts];
        for (f, t) in self.mesh.store.t.iter().enumerate().filter(|t| t.1[0] != NONE) {
            faces[part_of[t[0].index()] as usize].push(f);
        }
        faces
    }
}

impl<M: Metric> LiveMesh<M> {
    /// Returns the number of parts in a compact store.
    pub(crate) fn part_count(&self) -> usize {
        self.label_parts().into_iter().max().map_or(0, |m| m as usize + 1)
    }

    /// Returns the part of each vertex of a compact store, and the parts in the order of their first
    /// vertex.
    pub(super) fn find_parts(&self) -> (Vec<u32>, Vec<Component>) {
        let label = self.label_parts();
        let mut parts = measure_parts(&label, |w| self.store.p(w), &self.store.t);
        for (x, &l) in self.store.v.iter().zip(&label) {
            let part = &mut parts[l as usize];
            part.cost_factor = part.cost_factor.max(self.absence_cost_factor(x));
        }
        self.keep_locked_borders(&label, &self.store.t, &mut parts);
        (label, parts)
    }

    /// Marks parts with a border as locked if borders are locked. Cost: O(n log n) in that case, else O(1).
    fn keep_locked_borders(&self, part_of: &[u32], faces: &[[VertexId; 3]], parts: &mut [Component]) {
        if self.constraints.rules.border != BorderPolicy::Lock {
            return;
        }
        let living = faces.iter().filter(|t| t[0] != NONE);
        let sides = living.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut edges: Vec<[VertexId; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        for edge in edges.chunk_by(|e, f| e == f).filter(|same| same.len() == 1) {
            parts[part_of[edge[0][0].index()] as usize].cost_factor = f32::INFINITY;
        }
    }

    /// Returns the weight of the absence of a vertex.
    fn absence_cost_factor(&self, x: &Vertex<M::Memory>) -> f32 {
        if x.kind.is_locked() { f32::INFINITY } else { self.cost_factor(x.origin, x.origin) }
    }

    /// Returns the part of each vertex; parts are numbered in the order of their first vertex.
    pub(super) fn label_parts(&self) -> Vec<u32> {
        labels(self.store.v.len(), &self.store.t)
    }
}

/// True if these counts of faces and vertices are below the goal by more than a share of it.
fn is_far_below(goal: &Goal, (faces, vertices): (usize, usize), share: f64) -> bool {
    let is_below =
        |goal: Option<usize>, left: usize| goal.is_some_and(|n| (left as f64) < (1.0 - share) * n as f64);
    is_below(goal.faces, faces) || is_below(goal.vertices, vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse::test_support::{checked, engine_of, with_border, without_lines};
    use crate::cost::metric::Memoryless;
    use crate::options::SimplifyOptions;
    use crate::test_support::{SmallMesh, pyramid, tetrahedron};

    /// Three tetrahedra of sizes 1, 1/2 and 1/4, with four faces and four vertices each.
    fn three() -> SmallMesh {
        let other = |size: f32| tetrahedron().scaled(size);
        tetrahedron().and(&other(0.5), Vec3::X * 4.0).and(&other(0.25), Vec3::X * 8.0)
    }

    fn engine(small: &SmallMesh, options: &SimplifyOptions) -> Engine<Memoryless> {
        engine_of(Memoryless, small, options)
    }

    fn faces(n: usize) -> Goal {
        Goal { faces: Some(n), vertices: None }
    }

    /// The doubled area of the whole tetrahedron, times the square of half its diagonal.
    fn cost_of_whole() -> f64 {
        (3.0 + 3f64.sqrt()) * 0.25 * 3.0
    }

    /// Returns the longest edge of each remaining part, in order.
    fn sizes(engine: &Engine<Memoryless>) -> Vec<f32> {
        let (_, parts) = engine.mesh.find_parts();
        parts.iter().map(|p| (p.max - p.min).x).collect()
    }

    #[test]
    fn the_cheapest_parts_are_removed_first_until_the_goal_is_reached() {
        let mut one = engine(&three(), &without_lines());
        assert!(one.remove_parts(&faces(8)));
        assert_eq!((sizes(&one), one.tally.parts_removed), (vec![1.0, 0.5], 1));
        assert_eq!((one.mesh.store.live_faces, one.mesh.store.live_vertices), (8, 8));
        // The cost is proportional to the fourth power of the size.
        assert!((one.tally.removed_part_cost - cost_of_whole() / 256.0).abs() < 1e-5);
        assert_eq!(checked(&one), Ok(()));
        // With a goal in vertices it is the same; and the last part always stays.
        let mut two = engine(&three(), &without_lines());
        assert!(two.remove_parts(&Goal { faces: None, vertices: Some(4) }));
        assert_eq!((sizes(&two), two.tally.parts_removed), (vec![1.0], 2));
        assert!((two.tally.removed_part_cost - cost_of_whole() * (1.0 / 16.0 + 1.0 / 256.0)).abs() < 1e-5);
        assert!(!two.remove_parts(&faces(1)));
        assert_eq!((sizes(&two), two.tally.parts_removed), (vec![1.0], 2));
    }

    #[test]
    fn a_goal_is_far_undershot_only_if_nothing_else_reaches_it() {
        // A large and a small part of 4 faces each: at a goal of 5, removing one leaves 4, a fifth below it.
        let small = tetrahedron().and(&tetrahedron().scaled(0.5), Vec3::X * 4.0);
        let mut last = engine(&small, &without_lines());
        assert!(last.remove_parts(&faces(5)));
        assert_eq!(sizes(&last), [1.0]);
        // As long as there are other collapses, it stays; at a goal of 4 it is removed.
        for (goal, left) in [(5, vec![1.0, 0.5]), (4, vec![1.0])] {
            let mut live = engine(&small, &without_lines());
            live.enable_part_removal();
            live.drop_cheap_parts(&faces(goal), f32::MAX);
            assert_eq!(sizes(&live), left, "goal of {goal}");
        }
    }

    #[test]
    fn parts_with_locked_vertices_or_borders_stay() {
        let mut locked = engine(&three(), &without_lines());
        locked.mesh.store.v[9].kind = locked.mesh.store.v[9].kind.locked(true);
        assert!(locked.remove_parts(&faces(4)));
        assert_eq!(sizes(&locked), [0.25]);
        // A small pyramid with a border, and a large tetrahedron without.
        let open = pyramid(0.25).scaled(0.25).and(&tetrahedron(), Vec3::X * 4.0);
        for (border, left) in [(BorderPolicy::Keep, 1.0), (BorderPolicy::Lock, 0.5)] {
            let mut engine = engine(&open, &with_border(border));
            assert!(engine.remove_parts(&faces(4)));
            assert_eq!(sizes(&engine), [left], "{border:?}");
        }
        let mut kept = engine(&three(), &without_lines());
        kept.mesh.constraints.rules.topology = TopologyPolicy::Preserve;
        assert!(!kept.remove_parts(&faces(4)));
        assert_eq!(kept.tally.parts_removed, 0);
    }

    #[test]
    fn a_part_is_removed_if_two_of_its_faces_cost_no_more_than_a_collapse() {
        // The smallest part costs 1/256 of the whole, over four faces: half of that for two.
        let rate = (cost_of_whole() / 256.0 / 2.0) as f32;
        for (tau, removed) in [(0.99 * rate, 0), (1.01 * rate, 1), (15.9 * rate, 1), (16.1 * rate, 2)] {
            let mut engine = engine(&three(), &without_lines());
            engine.enable_part_removal();
            engine.drop_cheap_parts(&faces(1), tau);
            assert_eq!(engine.tally.parts_removed, removed, "at {tau}");
            assert_eq!(checked(&engine), Ok(()));
        }
        // Where necks may be cut, parts cost eight times as much.
        for (tau, removed) in [(7.9 * rate, 0), (8.1 * rate, 1)] {
            let mut engine = engine(&three(), &without_lines());
            engine.mesh.constraints.cuts_necks = true;
            engine.enable_part_removal();
            engine.drop_cheap_parts(&faces(1), tau);
            assert_eq!(engine.tally.parts_removed, removed, "at {tau}");
        }
    }

    #[test]
    fn parts_have_importance_too() {
        let mut engine = engine(&three(), &without_lines());
        // With its importance, the smallest part costs more than the middle one, whose cost is 16 times as
        // large.
        let factors = (0..12).map(|v| if v >= 8 { 17.0 } else { 1.0 }).collect();
        engine.mesh.set_cost_factors(Some(factors));
        engine.remove_parts(&faces(8));
        assert_eq!(sizes(&engine), [1.0, 0.25]);
    }

    #[test]
    fn cheap_parts_with_a_fifth_of_the_faces_block() {
        let mut engine = engine(&three(), &without_lines());
        // Two of the three parts were cheaper than a collapse that was done.
        engine.tally.highest_threshold = 1.0;
        assert!(engine.has_blocking_parts(false));
        engine.tally.highest_threshold = 1e-6;
        assert!(!engine.has_blocking_parts(false));
        engine.tally.highest_threshold = 1.0;
        engine.enable_part_removal();
        assert!(!engine.has_blocking_parts(false), "they have already been removed");
    }

    #[test]
    fn goals_are_undershot_by_a_share() {
        let goal = Goal { faces: Some(100), vertices: Some(50) };
        assert!(!is_far_below(&goal, (90, 50), 0.1) && is_far_below(&goal, (89, 50), 0.1));
        assert!(!is_far_below(&goal, (100, 45), 0.1) && is_far_below(&goal, (100, 44), 0.1));
        assert!(!is_far_below(&Goal::default(), (0, 0), 0.1));
        assert_eq!(all_but_most_expensive(vec![0, 1, 2, 3], &[2.0, 1.0, 5.0, 1.0]), [1, 3, 0]);
    }
}
