//! Vertex removal: removes the vertex with the smallest error and re-triangulates its hole.
//!
//! ```text
//! cost of every vertex: its distance from the mean plane of its faces, or from the line of its crease or border
//! loop:
//!     limit = the cost below which a fifth of the vertices lie, or as many as have to be removed
//!     for each vertex below the limit, along a Morton curve:
//!         recompute its cost, for its neighbours may have changed; if that is above the limit, keep it
//!         fill the hole that it would leave; if it lies farther from the filling than the limit allows, keep it
//!         replace its faces by the filling, and pass its error on to its neighbours
//! ```
//!
//! Source: [Schroeder et al. 1992], for the classes of vertices and the distance used for each. Errors
//! accumulate over removals, as in later programs of the same authors. New here: the sweeps, the optimal
//! filling, and the final check of its actual distance.

mod hole;
mod parts;
mod seams;
mod star;
mod store;

use glam::DVec3;
use lodsmith_core::VertexId;
use lodsmith_core::geometry::triangle;

use crate::SimplifyError;
use crate::collapse::order::NONE;
use crate::control::{Control, Verdict};
use crate::methods::task::{Ending, RebuiltSurface, Task};
use crate::options::{BorderPolicy, TopologyPolicy};
use crate::report::Refusal;
use hole::{HoleFiller, HoleRing, Limits, RejectReasons};
use seams::Seams;
use star::{Class, MAX_STAR_FACES, OrderedStar};
use store::{FaceStore, HUB_FACES};

/// Default crease angle, in degrees. (Guessed.)
const CREASE_DEG: f64 = 30.0;
/// Weight of the size of a star relative to its error, so that flat areas are decimated evenly. (Guessed.)
const SIZE_WEIGHT: f64 = 1e-5;
/// Vertices between two progress calls.
const PROGRESS_EVERY: usize = 1024;
/// The bound of a removed vertex.
const REMOVED_BOUND: f32 = f32::NEG_INFINITY;
/// Share of the vertices that a sweep considers. (Guessed: a smaller share takes more sweeps and follows the
/// order of costs more closely.)
const SWEEP_SHARE: f64 = 0.2;
/// Marks vertices outside the current ring.
const OUTSIDE: u8 = u8::MAX;

/// Removes vertices until the goal is met or no more can be removed. Each vertex of the result is a vertex of
/// the input.
pub(crate) fn make(task: &Task<'_>, control: &mut dyn Control) -> Result<RebuiltSurface, SimplifyError> {
    let mut removal = Removal::new(task);
    let mut end = removal.run(control)?;
    let mut seams_relaxed = false;
    if end == Ending::Stuck && removal.refusals[Refusal::Seam as usize] > 0 {
        // A displaced seam is better than a removed part.
        seams_relaxed = removal.relax_seams();
        if seams_relaxed {
            end = removal.run(control)?;
        }
    }
    let mut parts_removed = 0;
    if end == Ending::Stuck && task.options.topology != TopologyPolicy::Preserve {
        parts_removed = parts::remove_cheapest(&mut removal.store, task);
        if removal.store.meets(&task.goal) {
            end = Ending::Goal;
        }
    }
    Ok(RebuiltSurface { seams_relaxed, ..removal.made(end, parts_removed) })
}

struct Removal<'a> {
    task: &'a Task<'a>,
    store: FaceStore<'a>,
    /// Lower bound of the cost of each vertex; infinite if it can only be removed after a neighbour has
    /// changed.
    bounds: Vec<f32>,
    /// Largest possible distance of the surface around a vertex from the input.
    error: Vec<f32>,
    /// Index in the current ring, or [`OUTSIDE`].
    number: Vec<u8>,
    star: OrderedStar,
    ring: HoleRing,
    filler: HoleFiller,
    triangles: Vec<[usize; 3]>,
    crease_cos: f64,
    max_edge_sq: f64,
    steps: u64,
    refusals: [u64; Refusal::ALL.len()],
}

/// Planned removal of a vertex.
struct RemovalPlan {
    /// Distance from the vertex to the filling, in the unit frame.
    distance: f64,
    /// If this is above the limit, the hole may not have been filled yet.
    cost: f32,
    class: Class,
}

impl<'a> Removal<'a> {
    fn new(task: &'a Task<'a>) -> Self {
        let (options, prepared) = (task.options, task.input);
        let count = prepared.points.len();
        let guards = &options.guards;
        Self {
            task,
            store: FaceStore::new(
                prepared,
                task.mesh.map_or_else(Seams::default, |m| Seams::new(prepared, m)),
            ),
            bounds: vec![0.0; count],
            error: vec![0.0; count],
            number: vec![OUTSIDE; count],
            star: OrderedStar::default(),
            ring: HoleRing::default(),
            filler: HoleFiller::new(Limits::new(guards.max_normal_deg, guards.min_quality)),
            triangles: Vec::new(),
            crease_cos: libm::cos(options.method.crease_deg().unwrap_or(CREASE_DEG).to_radians()),
            max_edge_sq: guards.max_edge.map_or(f64::INFINITY, |l| prepared.length(l).powi(2)),
            steps: 0,
            refusals: [0; Refusal::ALL.len()],
        }
    }

    fn run(&mut self, control: &mut dyn Control) -> Result<Ending, SimplifyError> {
        if self.store.meets(&self.task.goal) {
            return Ok(Ending::Goal);
        }
        let count = self.bounds.len();
        let mut waiting: Vec<VertexId> = (0..count).map(VertexId::new).collect();
        waiting.retain(|v| self.bounds[v.index()] != REMOVED_BOUND);
        // All costs are computed before the first removal.
        let mut limit = -1.0;
        let mut prices = Vec::with_capacity(count);
        loop {
            for (i, &v) in waiting.iter().enumerate() {
                if i % PROGRESS_EVERY == 0 {
                    let (all, left) = (self.task.input.faces.len(), self.store.face_count);
                    match control.progress((all - left) as f64 / all as f64) {
                        Verdict::Cancel => return Err(SimplifyError::Cancelled),
                        Verdict::Finish => return Ok(Ending::Finish),
                        Verdict::Continue => {}
                    }
                }
                let bound = self.bounds[v.index()];
                if bound > limit && limit >= 0.0 || bound == f32::INFINITY {
                    continue;
                }
                match self.plan(v, limit) {
                    Ok(plan) if plan.cost <= limit => self.remove(v, &plan),
                    Ok(plan) => self.bounds[v.index()] = plan.cost,
                    Err(why) => {
                        self.refusals[why as usize] += 1;
                        self.bounds[v.index()] = f32::INFINITY;
                    }
                }
                if self.store.meets(&self.task.goal) {
                    return Ok(Ending::Goal);
                }
            }
            let bounds = &self.bounds;
            waiting.retain(|v| bounds[v.index()] != REMOVED_BOUND);
            prices.clear();
            prices.extend(waiting.iter().map(|v| bounds[v.index()]).filter(|b| b.is_finite()));
            if prices.is_empty() {
                return Ok(Ending::Stuck);
            }
            let wanted = self.wanted().clamp(1, prices.len());
            let most = (prices.len() as f64 * SWEEP_SHARE) as usize;
            let rank = wanted.min(most.max(1)) - 1;
            limit = limit.max(*prices.select_nth_unstable_by(rank, f32::total_cmp).1);
        }
    }

    /// Gives up the seams, if there are any, so that they block no vertex.
    fn relax_seams(&mut self) -> bool {
        let seams = std::mem::take(&mut self.store.seams);
        self.bounds.iter_mut().filter(|bound| **bound == f32::INFINITY).for_each(|bound| *bound = 0.0);
        !seams.is_empty()
    }

    /// Approximate number of vertices still to be removed.
    fn wanted(&self) -> usize {
        let goal = &self.task.goal;
        let by_faces = goal.faces.map(|n| self.store.face_count.saturating_sub(n).div_ceil(2));
        let by_vertices = goal.vertices.map(|n| self.store.vertex_count.saturating_sub(n));
        by_faces.into_iter().chain(by_vertices).min().unwrap_or(usize::MAX)
    }

    /// Cost of a vertex at this distance from the filling.
    fn cost(&self, v: VertexId, distance: f64) -> f32 {
        let area: f64 = self.star.areas.iter().map(|n| n.length()).sum();
        let price = f64::from(self.error[v.index()]) + distance + SIZE_WEIGHT * area.sqrt();
        (price * self.importance(v)) as f32
    }

    /// Returns the importance factor of a vertex. `prices` apply to areas times squared lengths; for a
    /// distance their cube root is taken.
    fn importance(&self, v: VertexId) -> f64 {
        self.task.input.cost_factors.as_ref().map_or(1.0, |p| libm::cbrt(f64::from(p[v.index()])))
    }

    /// Fills the hole that a vertex would leave, unless its cost is already known to exceed the limit.
    fn plan(&mut self, v: VertexId, limit: f32) -> Result<RemovalPlan, Refusal> {
        if self.task.input.locked.as_ref().is_some_and(|l| l[v.index()]) {
            return Err(Refusal::Locked);
        }
        self.star.gather(&mut self.store, v)?;
        let class = self.star.class(&self.store, v, self.crease_cos)?;
        let border = self.task.options.border;
        if class == Class::Border && border == BorderPolicy::Lock {
            return Err(Refusal::Border);
        }
        let price = self.cost(v, self.height_over_mean_plane(v, class));
        if price > limit {
            return Ok(RemovalPlan { distance: 0.0, cost: price, class });
        }
        let closing_faces = self.inspect_ring(v);
        let count = self.ring.points.len();
        self.triangles.clear();
        self.filler.why = RejectReasons::default();
        let along = |p: DVec3| p.normalize_or_zero();
        let sum = |range: std::ops::Range<usize>| -> DVec3 { self.star.areas[range].iter().sum() };
        let faces = self.star.faces.len();
        let whole = sum(0..faces);
        let is_filled = match class {
            Class::Border if count == 2 => match closing_faces {
                1 => true,
                0 => return Err(Refusal::Component),
                _ => return Err(Refusal::NonManifold),
            },
            Class::Border if self.ring.is_barred(0, count - 1) => return Err(Refusal::LinkCondition),
            _ if self.star.is_closed && (count < 3 || count == 3 && closing_faces > 0) => {
                return Err(if count == 3 && closing_faces == 1 {
                    Refusal::Component
                } else {
                    Refusal::LinkCondition
                });
            }
            Class::Inside | Class::Border => {
                self.filler.fill(&self.ring, 0..count, along(whole), &mut self.triangles)
            }
            Class::Edge(a, b) if self.ring.is_barred(a, b) => return Err(Refusal::LinkCondition),
            Class::Edge(a, b) => {
                let first = sum(a..b);
                self.filler.fill(&self.ring, a..b + 1, along(first), &mut self.triangles)
                    && self.filler.fill(
                        &self.ring,
                        (b..count).chain(0..a + 1),
                        along(whole - first),
                        &mut self.triangles,
                    )
            }
        };
        if !is_filled {
            return Err(match self.filler.why {
                RejectReasons { turned: true, .. } => Refusal::NormalFlip,
                RejectReasons { shape: true, .. } => Refusal::Quality,
                _ => Refusal::LinkCondition,
            });
        }
        if let Some(most) = self.task.options.guards.max_valence {
            self.check_valence(most)?;
        }
        let p = self.store.point(v);
        let q = &self.ring.points;
        let to_line = |a: usize, b: usize| triangle::nearest(p, [q[a], q[b], q[b]]).distance_sq;
        let to_filling = || {
            let each = self.triangles.iter().map(|t| triangle::nearest(p, t.map(|i| q[i])).distance_sq);
            each.fold(f64::INFINITY, f64::min)
        };
        let distance_sq = match class {
            Class::Edge(a, b) => to_line(a, b),
            Class::Border if count == 2 || border != BorderPolicy::Free => to_line(0, count - 1),
            Class::Border | Class::Inside => to_filling(),
        };
        let distance = distance_sq.sqrt();
        Ok(RemovalPlan { distance, cost: self.cost(v, distance), class })
    }

    /// Estimates the error of a vertex from its faces alone. [Schroeder et al. 1992]
    fn height_over_mean_plane(&self, v: VertexId, class: Class) -> f64 {
        let p = self.store.point(v);
        let at = |i: usize| self.store.point(self.star.ring[i]);
        let to_line = |a: usize, b: usize| triangle::nearest(p, [at(a), at(b), at(b)]).distance_sq.sqrt();
        match class {
            Class::Edge(a, b) => to_line(a, b),
            Class::Border if self.task.options.border != BorderPolicy::Free => {
                to_line(0, self.star.ring.len() - 1)
            }
            Class::Inside | Class::Border => {
                let count = self.star.ring.len();
                let whole: DVec3 = self.star.areas.iter().sum();
                let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
                for (i, area) in self.star.areas.iter().enumerate() {
                    let area = area.length();
                    sum += (at(i) + at((i + 1) % count) - 2.0 * p) * area;
                    weight += area;
                }
                if weight == 0.0 { 0.0 } else { (sum / (3.0 * weight)).dot(whole.normalize_or_zero()).abs() }
            }
        }
    }

    /// Collects the positions of the ring, the faces beyond it, and the existing edges between its vertices;
    /// the stars of hubs are not visited, and no edge is allowed between two hubs. Returns the number of
    /// faces beyond that would coincide with the filling: faces on the same three vertices, or at the edge of
    /// a ring of two.
    fn inspect_ring(&mut self, v: VertexId) -> usize {
        let Self { star, ring, number, store, .. } = self;
        let count = star.ring.len();
        ring.points.clear();
        ring.points.extend(star.ring.iter().map(|&r| store.point(r)));
        ring.beyond.clear();
        ring.beyond.resize(count, None);
        ring.barred.clear();
        ring.barred.resize(count, 0);
        for (i, &r) in star.ring.iter().enumerate() {
            number[r.index()] = i as u8;
        }
        let adjacent = |i: usize, k: usize| {
            let gap = i.abs_diff(k);
            gap == 1 || gap == count - 1 && star.is_closed
        };
        let mut closing_faces = 0;
        let mut hubs = 0u64;
        for (i, &r) in star.ring.iter().enumerate() {
            if store.degree(r) > HUB_FACES {
                hubs |= 1 << i;
                continue;
            }
            store.tidy(r);
            for corner in store.corners_at(r) {
                let (x, y) = (corner.next, corner.last);
                let (j, k) = (number[x.index()], number[y.index()]);
                if (j, k) == (OUTSIDE, OUTSIDE) || x == v || y == v {
                    continue;
                }
                let mut is_closing = count == 3 && j != OUTSIDE && k != OUTSIDE;
                for other in [j, k].into_iter().filter(|&o| o != OUTSIDE).map(usize::from) {
                    if !adjacent(i, other) {
                        ring.barred[i] |= 1 << other;
                        ring.barred[other] |= 1 << i;
                    }
                    is_closing |= count == 2;
                }
                closing_faces += usize::from(is_closing);
                let normal = || {
                    let [b, c] = [x, y].map(|v| store.point(v));
                    (b - ring.points[i]).cross(c - ring.points[i]).try_normalize()
                };
                let next = (i + 1) % count;
                if usize::from(k) == next && adjacent(i, next) {
                    ring.beyond[i] = normal();
                }
                // Found from the other end if this one is a hub.
                let before = (i + count - 1) % count;
                if usize::from(j) == before && adjacent(i, before) && hubs >> before & 1 == 1 {
                    ring.beyond[before] = normal();
                }
            }
        }
        for i in (0..count).filter(|i| hubs >> i & 1 == 1) {
            ring.barred[i] |= hubs;
        }
        if self.max_edge_sq < f64::INFINITY {
            for i in 0..count {
                for k in (0..count).filter(|&k| !adjacent(i, k)) {
                    let is_long = ring.points[i].distance_squared(ring.points[k]) > self.max_edge_sq;
                    ring.barred[i] |= u64::from(is_long) << k;
                }
            }
        }
        star.ring.iter().for_each(|r| number[r.index()] = OUTSIDE);
        // Each face was counted at all of its corners in the ring.
        closing_faces.div_ceil(count.min(3))
    }

    fn check_valence(&self, most: usize) -> Result<(), Refusal> {
        let count = self.star.ring.len();
        for (i, &r) in self.star.ring.iter().enumerate() {
            let is_end = !self.star.is_closed && (i == 0 || i == count - 1);
            let old = self.store.degree(r);
            let new = old + self.triangles.iter().flatten().filter(|&&k| k == i).count()
                - if is_end { 1 } else { 2 };
            if new > most.max(old) {
                return Err(Refusal::Valence);
            }
        }
        Ok(())
    }

    /// Carries out the last plan.
    fn remove(&mut self, v: VertexId, plan: &RemovalPlan) {
        if let Class::Edge(a, b) = plan.class {
            let [a, b] = [a, b].map(|i| self.star.ring[i]);
            if self.store.seams.has(v, a) || self.store.seams.has(v, b) {
                self.store.seams.add(a, b);
            }
        }
        for &f in &self.star.faces {
            self.store.remove(f);
        }
        for t in &self.triangles {
            // A removed face on the same side of a crease.
            let is_first = |i: usize| matches!(plan.class, Class::Edge(a, b) if (a..b).contains(&i));
            let inside = |&&i: &&usize| match plan.class {
                Class::Edge(a, b) => is_first(i) == t.iter().all(|k| (a..=b).contains(k)),
                _ => i < self.star.faces.len(),
            };
            let at = t.iter().find(inside).copied().unwrap_or(0);
            self.store.add(t.map(|i| self.star.ring[i]), self.star.faces[at]);
        }
        self.bounds[v.index()] = REMOVED_BOUND;
        self.steps += 1;
        let error = self.error[v.index()] + plan.distance as f32;
        for i in 0..self.star.ring.len() {
            let r = self.star.ring[i];
            let own = self.error[r.index()].max(error);
            self.error[r.index()] = own;
            let least = (f64::from(own) * self.importance(r)) as f32;
            let bound = &mut self.bounds[r.index()];
            if *bound < f32::INFINITY {
                *bound = bound.max(least);
            } else if self.store.degree(r) <= MAX_STAR_FACES {
                *bound = least;
            }
        }
    }

    fn made(self, end: Ending, parts_removed: usize) -> RebuiltSurface {
        let Self { store, steps, refusals, .. } = self;
        let mut number = vec![NONE; store.points.len()];
        let mut made = RebuiltSurface { end, steps, refusals, parts_removed, ..RebuiltSurface::default() };
        for t in store.faces().flat_map(|x| x.1) {
            number[t.index()] = VertexId(0);
        }
        for v in (0..number.len()).map(VertexId::new) {
            if number[v.index()] != NONE {
                number[v.index()] = VertexId::new(made.points.len());
                made.points.push(store.point(v));
                made.kept.push(v);
            }
        }
        made.faces = store.faces().map(|x| x.1.map(|v| number[v.index()])).collect();
        made.stands_for = store.faces().map(|x| store.stands_for(x.0)).collect();
        made
    }
}
