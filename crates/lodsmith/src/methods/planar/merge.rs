//! Selection of the regions to re-triangulate, and the resulting surface.

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::sorted::indices_by_key;
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{HalfEdgeId, PositionsView, Surface, Topology, VertexId};

use super::chains::{BorderRole, Chains};
use super::fill::{Outline, RegionFiller};
use super::regions::{NONE, Regions};
use crate::SimplifyError;
use crate::control::{Control, Verdict};
use crate::report::Refusal;

/// Maximum number of repair rounds; after these, all faces are kept as they were. (A round repairs everything
/// that it finds; at most three rounds have been seen on dirty models.)
const MAX_ROUNDS: usize = 40;
/// Faces of regions between two progress calls.
const ASK_EVERY: usize = 4096;

/// Numbers of faces and vertices, of a surface or as a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Count {
    pub(super) faces: i64,
    pub(super) vertices: i64,
}

impl Count {
    pub(super) fn meets(self, goal: Self) -> bool {
        self.faces <= goal.faces || self.vertices <= goal.vertices
    }
    /// Returns the number of vertices that can be kept inside a region while the goal is still met; each adds
    /// two faces.
    fn spare(self, goal: Self) -> i64 {
        ((goal.faces - self.faces) / 2).max(goal.vertices - self.vertices).max(0)
    }
}

/// Input of the merge.
pub(super) struct MergeInput<'a> {
    pub(super) points: &'a [DVec3],
    pub(super) faces: &'a [[VertexId; 3]],
    pub(super) topology: &'a Topology,
    pub(super) regions: &'a Regions,
    pub(super) chains: &'a Chains,
    pub(super) places: &'a [BorderRole],
    pub(super) is_locked: &'a dyn Fn(VertexId) -> bool,
    pub(super) noise: f64,
    /// True if two borders may become one edge, where a slit of zero width closes.
    pub(super) may_close: bool,
}

/// Permitted change of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RefillLevel {
    /// Re-triangulate with the simplified outline.
    Free,
    /// Re-triangulate with the original outline.
    Outline,
    /// Keep unchanged.
    Whole,
}

/// Inner vertices of a region.
#[derive(Clone, Copy, Default)]
struct InnerVertices {
    /// Closed fans.
    fans: i64,
    /// Vertices with no other fan, so that they can be removed.
    vertices: i64,
    /// Locked vertices among them.
    locked: i64,
}

#[derive(Clone, Default, PartialEq, Eq)]
struct MergePlan {
    is_chosen: Vec<bool>,
    /// Chains whose unneeded vertices are dropped.
    is_cut: Vec<bool>,
    /// A region, and the number of inner vertices that it keeps.
    spared: Option<(usize, i64)>,
}

/// Result of the merge.
pub(super) struct Merged {
    pub(super) faces: Vec<[VertexId; 3]>,
    /// For each face, an input face of the same region.
    pub(super) stands_for: Vec<usize>,
    pub(super) filled: u64,
    pub(super) refusals: [u64; Refusal::ALL.len()],
    pub(super) is_over: bool,
}

pub(super) struct RegionMerge<'a> {
    before: MergeInput<'a>,
    /// Start of each region's entries, and the chains along each region with their direction.
    entry_start: Vec<usize>,
    entries: Vec<(u32, bool)>,
    inside: Vec<InnerVertices>,
    /// For each vertex, the region that has all of its faces, if there is one.
    owner: Vec<u32>,
    level: Vec<RefillLevel>,
    /// Regions with savings, largest first.
    order: Vec<usize>,
    fills: Vec<Option<Vec<[VertexId; 3]>>>,
    refusals: [u64; Refusal::ALL.len()],
}

impl<'a> RegionMerge<'a> {
    pub(super) fn new(before: MergeInput<'a>) -> Self {
        let (regions, chains) = (before.regions, before.chains);
        let count = regions.count();
        let sides = || (0..chains.count()).flat_map(|c| chains.sides(c).iter().map(move |s| (c, s)));
        let mut entry_start = vec![0; count + 1];
        for (_, s) in sides() {
            entry_start[s.region as usize + 1] += 1;
        }
        for r in 0..count {
            entry_start[r + 1] += entry_start[r];
        }
        let mut at = entry_start.clone();
        let mut entries = vec![(0, false); entry_start[count]];
        for (c, s) in sides() {
            let slot = &mut at[s.region as usize];
            entries[*slot] = (c as u32, s.is_forward);
            *slot += 1;
        }
        let mut merge = Self {
            inside: vec![InnerVertices::default(); count],
            owner: vec![NONE; before.points.len()],
            level: vec![RefillLevel::Free; count],
            order: Vec::new(),
            fills: vec![None; count],
            refusals: [0; Refusal::ALL.len()],
            before,
            entry_start,
            entries,
        };
        merge.look_inside();
        for r in 0..count {
            if regions.faces(r).len() < 2 || regions.normals[r] == DVec3::ZERO {
                merge.level[r] = RefillLevel::Whole;
            }
        }
        let savings: Vec<i64> = (0..count).map(|r| merge.savings(r)).collect();
        let is_merged = |&r: &usize| merge.level[r] == RefillLevel::Free && savings[r] > 0;
        let free: Vec<usize> = (0..count).filter(is_merged).collect();
        let most_first = indices_by_key(free.iter().map(|&r| !savings[r].unsigned_abs()));
        merge.order = most_first.into_iter().map(|k| free[k]).collect();
        merge
    }

    /// Finds the fans that are closed within a region.
    fn look_inside(&mut self) {
        let topology = self.before.topology;
        let region = |h: HalfEdgeId| self.before.regions.of_face[h.face().index()];
        let is_within = |h: HalfEdgeId| {
            topology.kind(h) == Some(EdgeKind::Inner)
                && topology.twin(h).is_some_and(|g| region(g) == region(h))
        };
        for (v, place) in self.before.places.iter().enumerate() {
            let view = topology.vertex(VertexId::new(v));
            let Some(&first) = view.corners().first() else { continue };
            let fans = view.fan_count();
            let is_locked = (self.before.is_locked)(VertexId::new(v));
            if *place == BorderRole::Inside && fans == 1 {
                let r = region(first);
                let inside = &mut self.inside[r as usize];
                inside.fans += 1;
                inside.vertices += 1;
                inside.locked += i64::from(is_locked);
                self.owner[v] = r;
            } else if fans > 1 {
                for fan in view.fans() {
                    if fan.iter().all(|&h| is_within(h) && is_within(h.prev())) {
                        let r = region(fan[0]) as usize;
                        self.inside[r].fans += 1;
                        if is_locked {
                            // The vertex is locked, and other parts of the surface share it.
                            self.level[r] = RefillLevel::Whole;
                        }
                    }
                }
            }
        }
    }

    fn entries(&self, region: usize) -> &[(u32, bool)] {
        &self.entries[self.entry_start[region]..self.entry_start[region + 1]]
    }

    /// Number of faces removed if a region and all regions around it are re-triangulated.
    fn savings(&self, region: usize) -> i64 {
        let inside = &self.inside[region];
        let needless = |&(c, _): &(u32, bool)| self.before.chains.needless(c as usize) as i64;
        2 * (inside.fans - inside.locked) + self.entries(region).iter().map(needless).sum::<i64>()
    }

    /// Chooses regions until the goal is met.
    fn plan(&self, goal: Count, all: Count) -> MergePlan {
        let chains = self.before.chains;
        let mut plan = MergePlan {
            is_chosen: vec![false; self.level.len()],
            is_cut: vec![false; chains.count()],
            spared: None,
        };
        let mut waiting: Vec<usize> = (0..chains.count()).map(|c| chains.sides(c).len()).collect();
        let mut left = all;
        for &r in &self.order {
            if left.meets(goal) {
                break;
            }
            if self.level[r] == RefillLevel::Whole {
                continue;
            }
            plan.is_chosen[r] = true;
            let inside = &self.inside[r];
            left.faces -= 2 * (inside.fans - inside.locked);
            left.vertices -= inside.vertices - inside.locked;
            if self.level[r] == RefillLevel::Free {
                for &(c, _) in self.entries(r) {
                    let c = c as usize;
                    waiting[c] -= 1;
                    if waiting[c] == 0 {
                        plan.is_cut[c] = true;
                        left.faces -= (chains.needless(c) * chains.sides(c).len()) as i64;
                        left.vertices -= chains.needless(c) as i64;
                    }
                }
            }
            if left.meets(goal) {
                let spare = left.spare(goal).min(inside.vertices - inside.locked);
                plan.spared = (spare > 0).then_some((r, spare));
            }
        }
        plan
    }

    /// Fills regions, and repairs conflicts until the result is valid.
    pub(super) fn run(
        mut self,
        goal: Count,
        all: Count,
        control: &mut dyn Control,
    ) -> Result<Merged, SimplifyError> {
        let mut filler = RegionFiller::default();
        let mut last = MergePlan::default();
        let (mut is_over, mut progress) = (false, 0.5);
        for round in 0.. {
            if round == MAX_ROUNDS {
                self.level.fill(RefillLevel::Whole);
            }
            let plan = self.plan(goal, all);
            let mut is_sound = true;
            let mut since = 0;
            let share = 0.5 / self.order.len().max(1) as f64;
            for i in 0..self.order.len() {
                let r = self.order[i];
                if !self.is_stale(r, &last, &plan) {
                    continue;
                }
                self.fills[r] = None;
                if !plan.is_chosen[r] {
                    continue;
                }
                if since >= ASK_EVERY && !is_over {
                    since = 0;
                    progress = (0.5 + share * i as f64).max(progress);
                    match control.progress(progress) {
                        Verdict::Continue => {}
                        Verdict::Finish => is_over = true,
                        Verdict::Cancel => return Err(SimplifyError::Cancelled),
                    }
                    if is_over {
                        // Filled regions are kept unless they depend on unfilled ones.
                        for &r in &self.order[i..] {
                            self.level[r] = RefillLevel::Whole;
                        }
                        is_sound = false;
                        break;
                    }
                }
                since += self.before.regions.faces(r).len();
                if !self.fill(r, &plan, &mut filler) {
                    self.refuse(r, Refusal::NormalFlip, &plan);
                    is_sound = false;
                }
            }
            last = plan;
            if !is_sound {
                continue;
            }
            let (faces, stands_for, region) = self.faces();
            if round == MAX_ROUNDS || self.mend(&faces, &region, &last) {
                let filled = self.fills.iter().flatten().count() as u64;
                return Ok(Merged { faces, stands_for, filled, refusals: self.refusals, is_over });
            }
        }
        unreachable!("the last round returns")
    }

    /// True if the current triangulation of a region does not match the plan.
    fn is_stale(&self, r: usize, last: &MergePlan, plan: &MergePlan) -> bool {
        let was_chosen = last.is_chosen.get(r).copied().unwrap_or(false);
        let spared = |p: &MergePlan| p.spared.filter(|s| s.0 == r).map_or(0, |s| s.1);
        let cut = |p: &MergePlan, c: u32| p.is_cut.get(c as usize).copied().unwrap_or(false);
        was_chosen != plan.is_chosen[r]
            || self.fills[r].is_none() && plan.is_chosen[r]
            || spared(last) != spared(plan)
            || self.entries(r).iter().any(|e| cut(last, e.0) != cut(plan, e.0))
    }

    /// Re-triangulates a region; returns false on failure. A region that would not lose faces is kept.
    fn fill(&mut self, r: usize, plan: &MergePlan, filler: &mut RegionFiller) -> bool {
        let before = &self.before;
        let inside = &self.inside[r];
        let spared = plan.spared.filter(|s| s.0 == r).map_or(0, |s| s.1);
        let cut = |c: u32| plan.is_cut[c as usize];
        let gone: usize =
            self.entries(r).iter().filter(|e| cut(e.0)).map(|e| before.chains.needless(e.0 as usize)).sum();
        let old = before.regions.faces(r).len() as i64;
        let face_count = old - 2 * (inside.fans - inside.locked - spared) - gone as i64;
        if face_count == old {
            return true;
        }
        if face_count < 1 {
            return false;
        }
        let mut edges = Vec::new();
        for &(c, is_forward) in self.entries(r) {
            let mut vertices = before.chains.vertices(c as usize, !cut(c));
            let mut a = vertices.next().expect("a chain has an edge");
            for b in vertices {
                edges.push(if is_forward { [a, b] } else { [b, a] });
                a = b;
            }
        }
        let outline = Outline {
            points: before.points,
            normal: before.regions.normals[r],
            edges: &edges,
            inside: &self.stay_inside(r, spared),
            face_count: face_count as usize,
            noise: before.noise,
        };
        self.fills[r] = filler.fill(&outline);
        self.fills[r].is_some()
    }

    /// Returns the locked inner vertices of a region, and `spared` others, evenly spaced in the Morton order
    /// of the vertices.
    fn stay_inside(&self, r: usize, spared: i64) -> Vec<VertexId> {
        if self.inside[r].locked + spared == 0 {
            return Vec::new();
        }
        let before = &self.before;
        let corners = before.regions.faces(r).iter().flat_map(|&f| before.faces[f as usize]);
        let mut all: Vec<VertexId> = corners.filter(|v| self.owner[v.index()] as usize == r).collect();
        all.sort_unstable();
        all.dedup();
        let (mut stay, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|&v| (before.is_locked)(v));
        let spared = spared as usize;
        stay.extend((0..spared).map(|i| others[i * others.len() / spared]));
        stay
    }

    /// Moves a region to a stricter level.
    fn refuse(&mut self, r: usize, why: Refusal, plan: &MergePlan) {
        let has_cuts = self.entries(r).iter().any(|e| plan.is_cut[e.0 as usize]);
        self.fills[r] = None;
        self.level[r] = match self.level[r] {
            RefillLevel::Free if has_cuts => RefillLevel::Outline,
            _ => RefillLevel::Whole,
        };
        if self.level[r] == RefillLevel::Whole {
            self.refusals[Refusal::ALL.iter().position(|x| *x == why).expect("all are in the list")] += 1;
        }
    }

    /// Returns all current faces, the input face that each replaces, and the region that it was filled into.
    fn faces(&self) -> (Vec<[VertexId; 3]>, Vec<usize>, Vec<u32>) {
        let before = &self.before;
        let (mut faces, mut stands_for, mut region) = (Vec::new(), Vec::new(), Vec::new());
        let mut face_at = vec![0u32; before.points.len()];
        for r in 0..before.regions.count() {
            let own = before.regions.faces(r);
            match &self.fills[r] {
                None => {
                    faces.extend(own.iter().map(|&f| before.faces[f as usize]));
                    stands_for.extend(own.iter().map(|&f| f as usize));
                }
                Some(filled) => {
                    for &f in own {
                        before.faces[f as usize].iter().for_each(|v| face_at[v.index()] = f);
                    }
                    faces.extend(filled);
                    stands_for.extend(filled.iter().map(|t| face_at[t[0].index()] as usize));
                }
            }
            region.resize(faces.len(), if self.fills[r].is_some() { r as u32 } else { NONE });
        }
        (faces, stands_for, region)
    }

    /// Reverts regions whose new edges or faces conflict with existing ones; returns true if there are no
    /// conflicts.
    fn mend(&mut self, faces: &[[VertexId; 3]], region: &[u32], plan: &MergePlan) -> bool {
        if self.fills.iter().all(Option::is_none) {
            return true;
        }
        let positions = PositionsView::F64(bytemuck::cast_slice(self.before.points));
        let surface =
            Surface::with_triangles(positions, faces.to_vec()).expect("the faces use vertices of the input");
        let topology = Topology::unwelded(&surface);
        let borders = self.cut_edges(plan);
        let mut wrong: Vec<usize> = Vec::new();
        // Of the regions filled along an edge, only the last is reverted: the others may stay.
        let latest = |h: HalfEdgeId| {
            topology
                .edge(h)
                .map(|g| region[g.face().index()])
                .filter(|r| *r != NONE)
                .max()
                .map(|r| r as usize)
        };
        for h in topology.edges() {
            let kind = topology.kind(h);
            let ends = [topology.origin(h), topology.target(h)];
            let known = borders.get(&ordered(ends)).copied();
            let is_wrong = match kind {
                Some(EdgeKind::NonManifold | EdgeKind::Misoriented) => {
                    let faces = topology.edge(h).count();
                    let before = known.unwrap_or(0).max(self.faces_before(ends, kind));
                    faces > before
                }
                Some(EdgeKind::Inner) => known == Some(1) && !self.before.may_close,
                _ => false,
            };
            wrong.extend(latest(h).filter(|_| is_wrong));
        }
        for (f, t) in faces.iter().enumerate().filter(|x| region[x.0] != NONE) {
            let h = HalfEdgeId(3 * f as u32);
            let third = t[2];
            let is_twin = |g: HalfEdgeId| g != h && topology.triangle(g.face()).contains(&third);
            if topology.edge(h).any(is_twin) {
                wrong.extend(topology.edge(h).filter(|&g| g == h || is_twin(g)).filter_map(latest).max());
            }
        }
        wrong.sort_unstable();
        wrong.dedup();
        for &r in &wrong {
            self.refuse(r, Refusal::LinkCondition, plan);
        }
        wrong.is_empty()
    }

    /// Returns the number of faces along an edge in the input, if the edge was of the same kind there; else
    /// 0.
    fn faces_before(&self, [a, b]: [VertexId; 2], kind: Option<EdgeKind>) -> usize {
        let topology = self.before.topology;
        let found = topology
            .vertex(a)
            .corners()
            .iter()
            .flat_map(|&c| [c, c.prev()])
            .find(|&h| topology.origin(h) == b || topology.target(h) == b);
        match found {
            Some(h) if topology.kind(h) == kind => topology.edge(h).count(),
            _ => 0,
        }
    }

    /// Returns the new edges of simplified chains that do not have two opposite faces, with the number of
    /// faces at each.
    fn cut_edges(&self, plan: &MergePlan) -> HashMap<[VertexId; 2], usize> {
        let chains = self.before.chains;
        let mut edges = HashMap::new();
        for c in (0..chains.count()).filter(|&c| plan.is_cut[c] && chains.needless(c) > 0) {
            if !matches!(chains.sides(c), [a, b] if a.is_forward != b.is_forward) {
                let all: Vec<VertexId> = chains.vertices(c, false).collect();
                for w in all.windows(2) {
                    edges.insert(ordered([w[0], w[1]]), chains.sides(c).len());
                }
            }
        }
        edges
    }
}

fn ordered([a, b]: [VertexId; 2]) -> [VertexId; 2] {
    if a < b { [a, b] } else { [b, a] }
}
