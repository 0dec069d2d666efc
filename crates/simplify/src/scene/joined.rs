//! A run on all parts of a scene as one mesh.

use std::collections::BTreeMap;
use std::sync::Arc;

use lodsmith_core::{MeshError, Positions, RegionId, TriMesh, VertexId};

use super::layout::{Layout, RegionTable};
use super::part::{MeshCounts, Part, SimplifiedScene};
use crate::constraints::HeldWedges;
use crate::control::Control;
use crate::input::Input;
use crate::options::{Length, SimplifyOptions, Stop};
use crate::report::{Report, StoppedBy};
use crate::textures::Textures;
use crate::{Simplified, SimplifyError, pipeline, prune};

/// Rounding of single-precision coordinates of a scene, as a share of its diagonal, four times over.
const SCENE_ROUNDING: f64 = 2.5e-7;
/// Largest number of runs in search of a count of all instances.
const MAX_COUNT_RUNS: usize = 6;
/// The search ends at a count within the goal and above this fraction of it.
const MIN_COUNT_SHARE: f64 = 0.97;

/// Target of a run, counted in the scene.
pub(super) struct SceneGoal {
    by_ratio: Option<usize>,
    faces: Option<usize>,
    vertices: Option<usize>,
    stop: Stop,
    /// The element that is counted, and the target count.
    counted: fn(&TriMesh) -> usize,
    count: Option<usize>,
    /// Elements of the run for each one of the scene.
    share: f64,
}

impl SceneGoal {
    /// Returns the target count of the run, as far as it is known before the run.
    pub(super) fn wanted(&self) -> Option<f64> {
        self.count.map(|n| n as f64 * self.share)
    }
    fn is_within(&self, got: usize) -> bool {
        self.count.is_none_or(|count| got <= count)
    }
}

/// All parts of a scene as one mesh, with the options of the run.
pub(super) struct JoinedScene<'a> {
    parts: &'a [Part<'a>],
    pub(super) layout: Layout,
    pub(super) mesh: TriMesh,
    table: RegionTable,
    /// Options with all lengths in units.
    pub(super) options: SimplifyOptions,
    diagonal: f64,
    is_placed: bool,
    /// Largest distance, in the scene, by which rounding to single precision moves a position of the result.
    output_rounding: f64,
}

impl<'a> JoinedScene<'a> {
    pub(super) fn new(
        parts: &'a [Part<'a>],
        diagonal: f64,
        options: &SimplifyOptions,
    ) -> Result<Self, MeshError> {
        let joining = options.weld.into_iter().chain(options.method_options.pairs);
        let layout = Layout::new(parts, joining.map(|d| d.in_units(diagonal)).fold(0.0, f64::max));
        let is_placed = parts.iter().any(|p| p.instances > 0);
        let (mesh, table) = layout.join_parts(parts)?;
        let mut options = options.clone();
        options.region_classes = options.region_classes.map(|own| classes(&own, &table));
        options.textures = options.textures.map(|all| {
            let of = |&(part, region): &(usize, Option<RegionId>)| all.of(part, region).cloned();
            Arc::new(Textures::of_regions(table.iter().map(of).collect()))
        });
        options.lengths_to_units(diagonal);
        // The error must still be kept after rounding to single precision.
        let written = parts.iter().map(rounding_of).fold(0.0, f64::max);
        options.stop.error =
            options.stop.error.map(|e| Length::Units((e.in_units(diagonal) - written).max(0.0)));
        // Parts of one system often were one mesh, and differ in the last digits where they touched.
        let rounding = SCENE_ROUNDING * diagonal;
        options.weld = match options.weld {
            Some(weld) => Some(Length::Units(weld.in_units(diagonal).max(rounding))),
            None => layout.has_neighbours.then_some(Length::Units(rounding)),
        };
        Ok(Self { parts, layout, mesh, table, options, diagonal, is_placed, output_rounding: written })
    }

    fn instances_of(&self, part: &Part<'_>) -> usize {
        if self.is_placed { part.instances } else { 1 }
    }

    /// Returns a count over all instances.
    fn count(&self, of: impl Fn(&TriMesh) -> usize) -> usize {
        self.parts.iter().map(|p| of(p.mesh).saturating_mul(self.instances_of(p))).sum()
    }

    /// Returns a count over all instances of other meshes in place of the parts.
    fn count_of_instances(&self, of: impl Fn(&TriMesh) -> usize, meshes: &[TriMesh]) -> usize {
        meshes.iter().zip(self.parts).map(|(m, p)| of(m).saturating_mul(self.instances_of(p))).sum()
    }

    pub(super) fn goal(&self, stop: &Stop) -> SceneGoal {
        let placed = self.count(TriMesh::face_count);
        let by_ratio = stop.ratio.map(|r| ((placed as f64 * r).round() as usize).max(1));
        let faces = stop.faces.into_iter().chain(by_ratio).max();
        let vertices = stop.vertices;
        let counted: fn(&TriMesh) -> usize =
            if faces.is_none() && vertices.is_some() { TriMesh::vertex_count } else { TriMesh::face_count };
        let share = counted(&self.mesh) as f64 / self.count(counted).max(1) as f64;
        SceneGoal { by_ratio, faces, vertices, stop: *stop, counted, count: faces.or(vertices), share }
    }

    /// Returns true if the count of a run follows from that of the scene. If instances differ, or meshes
    /// share vertices that each counts as its own, it is known only after the run and has to be searched for.
    pub(super) fn is_direct(&self, goal: &SceneGoal) -> bool {
        let shares_vertices = self.layout.has_neighbours && goal.faces.is_none();
        let same = self.parts.windows(2).all(|p| self.instances_of(&p[0]) == self.instances_of(&p[1]));
        same && !shares_vertices || goal.count.is_none()
    }

    /// Returns the stop of a run with this target count.
    pub(super) fn own_stop(&self, goal: &SceneGoal, wanted: Option<f64>) -> Stop {
        let own = |n: f64| (n.floor() as usize).max(1);
        let mut stop = Stop { error: self.options.stop.error, ..Stop::default() };
        match goal.faces {
            Some(_) => {
                stop.faces = wanted.map(own);
                stop.vertices = goal.vertices.map(|n| own(n as f64 * goal.share));
            }
            None => stop.vertices = wanted.map(own),
        }
        stop
    }

    pub(super) fn run_to(
        &self,
        stop: &Stop,
        control: &mut dyn Control,
    ) -> Result<SimplifiedScene, SimplifyError> {
        let goal = self.goal(stop);
        let most = self.parts.iter().map(|p| self.instances_of(p)).max().unwrap_or(1).max(1) as f64;
        let mut options = self.options.clone();
        let mut wanted = goal.wanted();
        let mut before: Option<(f64, f64)> = None;
        let mut best: Option<(Report, Vec<TriMesh>, usize)> = None;
        for _ in 0..if self.is_direct(&goal) { 1 } else { MAX_COUNT_RUNS } {
            options.stop = self.own_stop(&goal, wanted);
            let input = Input { surface: self.mesh.surface(), mesh: Some(&self.mesh), joined: None };
            let (Simplified { mesh, report }, held) = pipeline::simplify(&input, &options, control)?;
            let (meshes, _) = self.split_parts(&mesh, &held)?;
            let got = self.count_of_instances(goal.counted, &meshes);
            // The largest count within the goal is best; if none is within, the smallest.
            let is_better = best.as_ref().is_none_or(|b| match (goal.is_within(b.2), goal.is_within(got)) {
                (true, true) => got > b.2,
                (within_before, within_now) => within_now || !within_before && got < b.2,
            });
            let reached = report.reached;
            if is_better {
                best = Some((report, meshes, got));
            }
            let (Some(count), Some(asked)) = (goal.count, wanted) else { break };
            if !reached || (got <= count && got as f64 > MIN_COUNT_SHARE * count as f64) {
                break;
            }
            // Elements of the scene for each one of the run: at most the instances of a mesh.
            let slope = before
                .filter(|(x, _)| (asked - x).abs() >= 1.0)
                .map_or(1.0 / goal.share, |(x, y)| (got as f64 - y) / (asked - x))
                .clamp(0.01, most);
            before = Some((asked, got as f64));
            // Aims a little below the goal, since only counts within it are accepted.
            let aim = count as f64 * (1.0 + MIN_COUNT_SHARE) / 2.0;
            wanted = Some((asked + (aim - got as f64) / slope).max(1.0));
        }
        let Some((report, meshes, _)) = best else {
            return Err(SimplifyError::NoFaces { faces: self.count(TriMesh::face_count) });
        };
        Ok(self.build_result(report, meshes, &goal))
    }

    /// Splits a result into its parts. Also returns the numbers that their vertices have in the result.
    pub(super) fn split_parts(
        &self,
        all: &TriMesh,
        held: &HeldWedges,
    ) -> Result<(Vec<TriMesh>, Vec<Vec<VertexId>>), MeshError> {
        self.layout.split_parts(self.parts, all, &self.table, held)
    }

    /// Builds the result and converts the report to terms of the scene.
    pub(super) fn build_result(
        &self,
        mut report: Report,
        meshes: Vec<TriMesh>,
        goal: &SceneGoal,
    ) -> SimplifiedScene {
        report.input_faces = self.count(TriMesh::face_count);
        report.input_vertices = self.count(TriMesh::vertex_count);
        report.faces = self.count_of_instances(TriMesh::face_count, &meshes);
        report.vertices = self.count_of_instances(TriMesh::vertex_count, &meshes);
        report.error.diagonal = self.diagonal;
        report.error.bound = report.error.bound.map(|bound| bound + self.output_rounding);
        // The stop is of all instances, whatever the run made of its share.
        let stop = &goal.stop;
        let met = |n: Option<usize>, count: usize| n.is_some_and(|n| count <= n);
        let [by_faces, by_vertices, by_ratio] = [
            met(stop.faces, report.faces),
            met(stop.vertices, report.vertices),
            met(goal.by_ratio, report.faces),
        ];
        if stop.error.is_none() && goal.count.is_some() && report.stopped_by != StoppedBy::Caller {
            report.reached = by_faces || by_vertices || by_ratio;
            if report.reached {
                report.proposals.clear();
                report.stopped_by = match () {
                    () if by_faces => StoppedBy::Faces,
                    () if by_vertices => StoppedBy::Vertices,
                    () => StoppedBy::Ratio,
                };
            }
        }
        if let Some(size) = self.options.prune.filter(|_| report.pruned.parts > 0) {
            let near = self.options.weld.map(|d| d.in_units(self.diagonal));
            let locked = self.options.locked.as_deref();
            let small = prune::small_parts(&self.mesh.surface(), size.in_units(self.diagonal), near, locked);
            let regions = self.mesh.regions().unwrap_or_default();
            let times_of = |f: usize| self.instances_of(&self.parts[self.table[regions[f].index()].0]);
            report.pruned.parts = small.first_faces.iter().map(|&f| times_of(f)).sum();
            let gone = (0..small.is_small.len()).filter(|&f| small.is_small[f]);
            report.pruned.faces = gone.map(times_of).sum();
        }
        let is_shared = self.parts.len() > 1 && stop.error.is_none() && goal.count.is_some();
        let share = report.faces as f64 / report.input_faces.max(1) as f64;
        let count = |(part, mesh): (&Part<'_>, &TriMesh)| {
            let counts = MeshCounts::new(part, mesh, report.reached);
            if is_shared { counts.with_share(part, mesh, share) } else { counts }
        };
        let counts = self.parts.iter().zip(&meshes).map(count).collect();
        SimplifiedScene { meshes, report, counts }
    }
}

/// Returns the classes of the joined mesh's regions, from those of the parts.
fn classes(own: &[RegionId], table: &RegionTable) -> Arc<[RegionId]> {
    let mut first: BTreeMap<(usize, Option<RegionId>), RegionId> = BTreeMap::new();
    let class = |(i, &(part, region)): (usize, &(usize, Option<RegionId>))| {
        let class = region.map(|r| own.get(r.index()).copied().unwrap_or(r));
        *first.entry((part, class)).or_insert_with(|| RegionId::new(i))
    };
    table.iter().enumerate().map(class).collect()
}

/// Returns the largest distance, in the scene, by which rounding to single precision moves a position of a
/// part; 0 in double precision.
fn rounding_of(part: &Part<'_>) -> f64 {
    let Positions::F32(_) = part.mesh.positions() else { return 0.0 };
    let largest = part
        .mesh
        .positions()
        .view()
        .bounds()
        .map_or(0.0, |b| b.min.iter().chain(&b.max).fold(0f64, |most, x| most.max(x.abs())));
    // Half a step, 2^-25 to 2^-24 of the coordinate, along three axes.
    largest * part.scale.abs() * 3f64.sqrt() / f64::from(1u32 << 24)
}
