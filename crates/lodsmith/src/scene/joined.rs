//! A run on all parts of a scene as one mesh.

use std::collections::BTreeMap;

use lodsmith_core::{MeshError, Positions, RegionId, TriMesh, VertexId};

use super::farthest;
use super::layout::{Layout, RegionTable};
use super::part::{MeshCounts, Part, SimplifiedScene};
use super::touching::Touching;
use crate::attributes::textures::Textures;
use crate::constraints::HeldWedges;
use crate::control::Control;
use crate::input::{Input, MeshData, OwnedMeshData};
use crate::options::{Length, SimplifyOptions, Stop};
use crate::pipeline::borders;
use crate::report::Report;
use crate::run::CountedGoal;
use crate::{Simplified, SimplifyError, constraints, pipeline, prune};

/// Four times the rounding of single-precision coordinates of a scene, as a share of its diagonal.
const SCENE_ROUNDING: f64 = 2.5e-7;
/// All parts of a scene as one mesh, with the options of the run.
pub(super) struct JoinedScene<'a> {
    parts: &'a [Part<'a>],
    pub(super) layout: Layout,
    pub(super) mesh: TriMesh,
    table: RegionTable,
    /// Options with all lengths in units.
    pub(super) options: SimplifyOptions,
    data: OwnedMeshData,
    diagonal: f64,
    is_placed: bool,
    /// Where parts touch, if they do.
    touching: Option<Touching>,
    /// The vertex that each vertex of the mesh is joined with, if borders of parts differ by rounding.
    borders: Option<Vec<VertexId>>,
    /// Largest distance, in the scene, by which rounding to single precision moves a position of the result.
    output_rounding: f64,
}

impl<'a> JoinedScene<'a> {
    pub(super) fn new(
        parts: &'a [Part<'a>],
        diagonal: f64,
        options: &SimplifyOptions,
    ) -> Result<Self, SimplifyError> {
        for part in parts {
            constraints::check(&part.data, part.mesh.vertex_count())?;
        }
        let joining = options.weld.into_iter().chain(options.method.pairs());
        let touching = Touching::find(parts, options.per_mesh);
        let near = joining.map(|d| d.in_units(diagonal)).fold(0.0, f64::max);
        let layout = Layout::new(parts, near, touching.as_ref());
        let is_placed = parts.iter().any(|p| p.instances > 0);
        let (mesh, table) = layout.join_parts(parts)?;
        let mut options = options.clone();
        let mut data = joined_data(parts, &table);
        if let Some(locked) = constraints::locks_of_map(&data.view()) {
            data.locked = Some(locked);
        }
        if let Some(touching) = &touching {
            data.locked = touching.add_locks(parts, data.locked.take());
        }
        options.lengths_to_units(diagonal);
        // The error must still be kept after rounding to single precision.
        let written = parts.iter().map(rounding_of).fold(0.0, f64::max);
        options.stop.error =
            options.stop.error.map(|e| Length::Units((e.in_units(diagonal) - written).max(0.0)));
        // Parts of one system often were one mesh once, and differ in the last digits where they touched.
        let of_touching = touching.as_ref().filter(|t| t.joins()).map_or(0.0, |t| t.rounding);
        let rounding = (SCENE_ROUNDING * diagonal).max(of_touching);
        options.weld = match options.weld {
            Some(weld) => Some(Length::Units(weld.in_units(diagonal).max(rounding))),
            None => layout.has_neighbours.then_some(Length::Units(rounding)),
        };
        let borders = if options.weld.is_none() { joined_borders(parts) } else { None };
        let output_rounding = written;
        Ok(Self {
            parts,
            layout,
            mesh,
            table,
            options,
            data,
            diagonal,
            is_placed,
            touching,
            borders,
            output_rounding,
        })
    }

    /// Returns the input of a run.
    pub(super) fn input(&self) -> Input<'_> {
        let joined = self.borders.clone();
        Input { joined, knows_borders: true, ..Input::new(&self.mesh).with(self.data.view()) }
    }

    fn instances_of(&self, part: &Part<'_>) -> usize {
        if self.is_placed { part.instances } else { 1 }
    }

    /// Returns a count over all instances.
    fn count(&self, of: impl Fn(&TriMesh) -> usize) -> usize {
        self.parts.iter().map(|p| of(p.mesh).saturating_mul(self.instances_of(p))).sum()
    }

    /// Returns a count over all instances, with other meshes in place of the parts.
    fn count_of_instances(&self, of: impl Fn(&TriMesh) -> usize, meshes: &[TriMesh]) -> usize {
        meshes.iter().zip(self.parts).map(|(m, p)| of(m).saturating_mul(self.instances_of(p))).sum()
    }

    pub(super) fn goal(&self, stop: &Stop) -> CountedGoal {
        CountedGoal::new(stop, |of| self.count(of), &self.mesh)
    }

    /// Returns true if the count of a run follows from the count of the scene. If the numbers of instances
    /// differ, or meshes share vertices that each of them counts, it is known only after the run and has to
    /// be searched for.
    pub(super) fn is_direct(&self, goal: &CountedGoal) -> bool {
        let shares_vertices = self.layout.has_neighbours && goal.faces.is_none();
        let same = self.parts.windows(2).all(|p| self.instances_of(&p[0]) == self.instances_of(&p[1]));
        same && !shares_vertices || goal.count.is_none()
    }

    /// Returns the stop of a run with this target count.
    pub(super) fn own_stop(&self, goal: &CountedGoal, wanted: Option<f64>) -> Stop {
        goal.own_stop(self.options.stop.error, wanted)
    }

    pub(super) fn run_to(
        &self,
        stop: &Stop,
        control: &mut dyn Control,
    ) -> Result<SimplifiedScene, SimplifyError> {
        let goal = self.goal(stop);
        let most = self.parts.iter().map(|p| self.instances_of(p)).max().unwrap_or(1).max(1) as f64;
        let mut options = self.options.clone();
        let run = |stop| {
            options.stop = stop;
            let (Simplified { mesh, report }, held) = pipeline::simplify(&self.input(), &options, control)?;
            let (meshes, _) = self.split_parts(&mesh, &held)?;
            let (got, reached) = (self.count_of_instances(goal.counted, &meshes), report.reached);
            Ok(((report, meshes), got, reached))
        };
        let (report, meshes) = goal.search(self.is_direct(&goal), most, self.options.stop.error, run)?;
        Ok(self.build_result(report, meshes, &goal))
    }

    /// Splits a result into its parts. Also returns the numbers of their vertices in the result.
    pub(super) fn split_parts(
        &self,
        all: &TriMesh,
        held: &HeldWedges,
    ) -> Result<(Vec<TriMesh>, Vec<Vec<VertexId>>), MeshError> {
        self.layout.split_parts(self.parts, all, &self.table, held)
    }

    /// Builds the result and converts the report to the scene's counts and units.
    pub(super) fn build_result(
        &self,
        mut report: Report,
        meshes: Vec<TriMesh>,
        goal: &CountedGoal,
    ) -> SimplifiedScene {
        report.input_faces = self.count(TriMesh::face_count);
        report.input_vertices = self.count(TriMesh::vertex_count);
        report.faces = self.count_of_instances(TriMesh::face_count, &meshes);
        report.vertices = self.count_of_instances(TriMesh::vertex_count, &meshes);
        report.gaps = self.touching.as_ref().map_or(0, |touching| touching.gaps(self.parts, &meshes));
        report.error.diagonal = self.diagonal;
        farthest::locate(&mut report.error, self.parts, &meshes, &self.layout);
        report.error.bound = report.error.bound.map(|bound| bound + self.output_rounding);
        goal.judge(&mut report);
        if let Some(size) = self.options.prune.filter(|_| report.pruned.parts > 0) {
            let near = self.options.weld.map(|d| d.in_units(self.diagonal));
            let locked = self.data.locked.as_deref();
            let small = prune::small_parts(&self.mesh.surface(), size.in_units(self.diagonal), near, locked);
            let regions = self.mesh.regions().unwrap_or_default();
            let times_of = |f: usize| self.instances_of(&self.parts[self.table[regions[f].index()].0]);
            report.pruned.parts = small.first_faces.iter().map(|&f| times_of(f)).sum();
            let gone = (0..small.is_small.len()).filter(|&f| small.is_small[f]);
            report.pruned.faces = gone.map(times_of).sum();
        }
        let is_shared = self.parts.len() > 1 && goal.is_count_alone();
        let share = report.faces as f64 / report.input_faces.max(1) as f64;
        let count = |(part, mesh): (&Part<'_>, &TriMesh)| {
            let counts = MeshCounts::new(part, mesh, report.reached);
            if is_shared { counts.with_share(part, mesh, share) } else { counts }
        };
        let counts = self.parts.iter().zip(&meshes).map(count).collect();
        SimplifiedScene { meshes, report, counts }
    }
}

/// Returns the vertex that each vertex of the joined mesh is joined with, if borders of a part differ by
/// rounding.
fn joined_borders(parts: &[Part<'_>]) -> Option<Vec<VertexId>> {
    let (mut all, mut is_any) = (Vec::new(), false);
    for part in parts {
        let (first, count) = (all.len(), part.mesh.vertex_count());
        let joined = borders::joined(&part.mesh.surface());
        is_any |= joined.is_some();
        let own = |v| joined.as_ref().map_or(v, |joined| joined.of(v));
        all.extend((0..count).map(|v| VertexId::new(first + own(VertexId::new(v)).index())));
    }
    is_any.then_some(all)
}

/// Returns the data of the joined mesh.
fn joined_data(parts: &[Part<'_>], table: &RegionTable) -> OwnedMeshData {
    /// Returns the values of all parts, if any part has values; `neutral` fills the others.
    fn all<'a, T: Copy + 'a>(
        parts: &'a [Part<'_>],
        of: impl Fn(&MeshData<'a>) -> Option<&'a [T]>,
        neutral: T,
    ) -> Option<Vec<T>> {
        parts.iter().any(|p| of(&p.data).is_some()).then(|| {
            let own = |p: &Part<'a>| match of(&p.data) {
                Some(own) => own.to_vec(),
                None => vec![neutral; p.mesh.vertex_count()],
            };
            parts.iter().flat_map(own).collect()
        })
    }
    let of_regions = |(part, region): (usize, Option<RegionId>)| {
        parts[part].data.textures.and_then(|own| own.of(region).cloned())
    };
    let textures: Vec<_> = table.iter().copied().map(of_regions).collect();
    let mut first: BTreeMap<(usize, Option<RegionId>), RegionId> = BTreeMap::new();
    let class = |(i, &(part, region)): (usize, &(usize, Option<RegionId>))| {
        let own = parts[part].data.region_classes.unwrap_or_default();
        let class = region.map(|r| own.get(r.index()).copied().unwrap_or(r));
        *first.entry((part, class)).or_insert_with(|| RegionId::new(i))
    };
    let has_classes = parts.iter().any(|p| p.data.region_classes.is_some());
    OwnedMeshData {
        locked: all(parts, |data| data.locked, false),
        importance: all(parts, |data| data.importance, 1.0),
        error_map: all(parts, |data| data.error_map, 1.0),
        textures: textures.iter().any(Option::is_some).then(|| Textures::of_regions(textures)),
        region_classes: has_classes.then(|| table.iter().enumerate().map(class).collect()),
        wedge_values: None,
    }
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
