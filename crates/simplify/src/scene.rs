//! Simplification of all meshes of a scene under one budget: triangles are removed where that costs least,
//! whichever mesh they belong to.
//!
//! All meshes are laid side by side in one, at the sizes that they have in the scene, and simplified in one
//! run: its threshold is the same for all. Each collapse in a mesh with several instances saves as many times
//! the triangles as it makes errors, so instances change only the count.

mod per_mesh;

use std::collections::BTreeMap;
use std::sync::Arc;

use lodsmith_core::{
    Attribute, Bounds, MeshError, Morphed, Positions, RegionId, Semantic, TriMesh, VertexId, WedgeId,
};

use crate::attributes::ranges::{has_ranges, ranges, within};
use crate::constraints::{self, HeldWedges};
use crate::control::Control;
use crate::input::Input;
use crate::options::{Length, SimplifyOptions, Stop};
use crate::report::{Report, StoppedBy};
use crate::run;
use crate::textures::Textures;
use crate::{Simplified, SimplifyError, prune};

/// A mesh of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The mesh, in its own coordinates.
    pub mesh: &'a TriMesh,
    /// Number of instances in the scene. A mesh without instances is simplified too but not counted, unless
    /// no mesh has any.
    pub instances: usize,
    /// Scale of the mesh in the scene.
    pub scale: f64,
    /// Number of the coordinate system of the mesh, if it has one instance. Parts of one system that touch
    /// stay connected; others keep their borders separately.
    pub system: Option<usize>,
}

/// The simplified meshes of a scene and the report of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifiedScene {
    /// As many meshes as parts, in their order; a mesh may have lost all its faces.
    pub meshes: Vec<TriMesh>,
    /// Report with counts of all instances and lengths of the scene.
    pub report: Report,
    /// Counts of each mesh, in the same order.
    pub counts: Vec<MeshCounts>,
}

/// Counts of one mesh of a scene, whatever its number of instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MeshCounts {
    /// Number of instances in the scene.
    pub instances: usize,
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// True if its stop was met: that of the scene, if all meshes share one.
    pub reached: bool,
}

impl MeshCounts {
    fn new(part: &Part<'_>, result: &TriMesh, reached: bool) -> Self {
        Self {
            instances: part.instances,
            input_faces: part.mesh.face_count(),
            input_vertices: part.mesh.vertex_count(),
            faces: result.face_count(),
            vertices: result.vertex_count(),
            reached,
        }
    }
}

/// Gap between meshes laid side by side, in sizes of the largest.
const PART_GAP: f64 = 0.25;

/// Rounding of single-precision coordinates of a scene, as a share of its diagonal, four times over.
const SCENE_ROUNDING: f64 = 2.5e-7;
/// Largest number of runs in search of a count of all instances.
const MAX_COUNT_RUNS: usize = 6;
/// The search ends at a count within the goal and above this fraction of it.
const MIN_COUNT_SHARE: f64 = 0.97;

/// Reduces the number of triangles of several meshes under one budget: triangles are removed where that costs
/// least, whichever mesh they belong to.
///
/// # Input
/// Each [`Part`] is a mesh in its own coordinates, with a scale and a number of instances. Counts of the stop
/// are of all instances together. `diagonal` is the diagonal of the scene's bounding box, in the units of the
/// scene, and the one that lengths given as shares refer to. Lists over vertices
/// ([`SimplifyOptions::locked`], [`SimplifyOptions::importance`]) have one entry for each vertex of each
/// part, part after part; region classes and textures are those of each part.
///
/// # Output
/// One mesh for each part, in the same order and in the units, precision, attributes and regions of that
/// part; a mesh may have lost all its faces. Counts of the report are of all instances, its lengths in the
/// units of the scene.
///
/// With [`SimplifyOptions::per_mesh`] each part is simplified separately, and the stop applies to each, with
/// its instances counted once; parts that touch then do not stay connected.
///
/// # Promises
/// Those of [`simplify`](crate::simplify()), for all parts laid side by side. Parts of one
/// [system](Part::system) that touch stay connected. A proven bound includes the rounding of the results to
/// the precision of their parts. Same parts, options and seed, same bytes.
///
/// # Cost
/// That of [`simplify`](crate::simplify()) for all parts joined in one mesh, whose positions have double
/// precision: some 60 bytes more for each triangle. Where the numbers of instances differ, the count of all
/// instances has to be searched for: up to six runs.
///
/// # Errors
/// Those of [`simplify`](crate::simplify()): [`SimplifyError::NoFaces`] if no part has a face with an area
/// (with `per_mesh`, a part without one stays as it is), [`SimplifyError::WrongLength`] if a list does not
/// have one entry for each vertex of all parts together, [`SimplifyError::Mesh`] if all parts together have
/// more elements than 32-bit ids can name.
///
/// # Panics
/// Not on account of any mesh or option.
pub fn simplify_scene(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<SimplifiedScene, SimplifyError> {
    if options.per_mesh {
        return per_mesh::simplify_each(parts, diagonal, options, control);
    }
    JoinedScene::new(parts, diagonal, options)?.run_to(&options.stop, control)
}

/// A level of a scene, and for each part the positions to which the vertices of the level before it moved,
/// where known.
pub(crate) type SceneLevel = (SimplifiedScene, Vec<Vec<Option<[f64; 3]>>>);

/// Makes the levels of a scene in one run if that meets the counts of the scene. Returns `None` if meshes
/// have different numbers of instances, or the method makes each level separately.
pub(crate) fn chain_of_scene(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &SimplifyOptions,
    stops: &[Stop],
    is_traced: bool,
    control: &mut dyn Control,
) -> Result<Option<Vec<SceneLevel>>, SimplifyError> {
    if options.per_mesh || !run::is_chained(options, stops) {
        return Ok(None);
    }
    let whole = JoinedScene::new(parts, diagonal, options)?;
    let goals: Vec<SceneGoal> = stops.iter().map(|stop| whole.goal(stop)).collect();
    if goals.iter().any(|goal| !whole.is_direct(goal)) {
        return Ok(None);
    }
    let own: Vec<Stop> = goals.iter().map(|goal| whole.own_stop(goal, goal.wanted())).collect();
    let input = Input { surface: whole.mesh.surface(), mesh: Some(&whole.mesh), joined: None };
    let (all, mergers) = run::run_chain(&input, &whole.options, &own, is_traced, control)?;
    let mut first = 0;
    let mut before: Vec<Vec<VertexId>> = Vec::with_capacity(parts.len());
    for part in parts {
        let next = first + part.mesh.vertex_count();
        before.push((first..next).map(VertexId::new).collect());
        first = next;
    }
    let mut levels = Vec::with_capacity(all.len());
    for (k, ((done, held), goal)) in all.into_iter().zip(&goals).enumerate() {
        let view = done.mesh.positions().view();
        let went = |(numbers, place): (&Vec<VertexId>, &PartPlacement)| {
            let to =
                |v: &VertexId| mergers.get(k)?.get(v.index()).filter(|to| to.index() < view.len()).copied();
            numbers.iter().map(|v| to(v).map(|to| place.to_part(view.get(to)))).collect()
        };
        let targets = before.iter().zip(&whole.layout.places).map(went).collect();
        let (meshes, numbers) = whole.split_parts(&done.mesh, &held)?;
        before = numbers;
        levels.push((whole.build_result(done.report, meshes, goal), targets));
    }
    Ok(Some(levels))
}

/// Target of a run, counted in the scene.
struct SceneGoal {
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
    fn wanted(&self) -> Option<f64> {
        self.count.map(|n| n as f64 * self.share)
    }
    fn is_within(&self, got: usize) -> bool {
        self.count.is_none_or(|count| got <= count)
    }
}

/// All parts of a scene as one mesh, with the options of the run.
struct JoinedScene<'a> {
    parts: &'a [Part<'a>],
    layout: Layout,
    mesh: TriMesh,
    table: RegionTable,
    /// Options with all lengths in units.
    options: SimplifyOptions,
    diagonal: f64,
    is_placed: bool,
    /// Largest distance, in the scene, by which rounding to single precision moves a position of the result.
    output_rounding: f64,
}

impl<'a> JoinedScene<'a> {
    fn new(parts: &'a [Part<'a>], diagonal: f64, options: &SimplifyOptions) -> Result<Self, MeshError> {
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

    fn goal(&self, stop: &Stop) -> SceneGoal {
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
    fn is_direct(&self, goal: &SceneGoal) -> bool {
        let shares_vertices = self.layout.has_neighbours && goal.faces.is_none();
        let same = self.parts.windows(2).all(|p| self.instances_of(&p[0]) == self.instances_of(&p[1]));
        same && !shares_vertices || goal.count.is_none()
    }

    /// Returns the stop of a run with this target count.
    fn own_stop(&self, goal: &SceneGoal, wanted: Option<f64>) -> Stop {
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

    fn run_to(&self, stop: &Stop, control: &mut dyn Control) -> Result<SimplifiedScene, SimplifyError> {
        let goal = self.goal(stop);
        let most = self.parts.iter().map(|p| self.instances_of(p)).max().unwrap_or(1).max(1) as f64;
        let mut options = self.options.clone();
        let mut wanted = goal.wanted();
        let mut before: Option<(f64, f64)> = None;
        let mut best: Option<(Report, Vec<TriMesh>, usize)> = None;
        for _ in 0..if self.is_direct(&goal) { 1 } else { MAX_COUNT_RUNS } {
            options.stop = self.own_stop(&goal, wanted);
            let input = Input { surface: self.mesh.surface(), mesh: Some(&self.mesh), joined: None };
            let (Simplified { mesh, report }, held) = run::run(&input, &options, control)?;
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
    fn split_parts(
        &self,
        all: &TriMesh,
        held: &HeldWedges,
    ) -> Result<(Vec<TriMesh>, Vec<Vec<VertexId>>), MeshError> {
        self.layout.split_parts(self.parts, all, &self.table, held)
    }

    /// Builds the result and converts the report to terms of the scene.
    fn build_result(&self, mut report: Report, meshes: Vec<TriMesh>, goal: &SceneGoal) -> SimplifiedScene {
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
        let counts =
            self.parts.iter().zip(&meshes).map(|(p, m)| MeshCounts::new(p, m, report.reached)).collect();
        SimplifiedScene { meshes, report, counts }
    }
}

/// Placement of each part: scaled, then moved.
struct Layout {
    places: Vec<PartPlacement>,
    /// Offset of the joint indices of each part: joints of different systems are different joints.
    first_joints: Vec<f32>,
    /// True if several parts lie in one coordinate system.
    has_neighbours: bool,
}

#[derive(Clone, Copy)]
struct PartPlacement {
    scale: f64,
    offset: [f64; 3],
}

impl PartPlacement {
    fn to_scene(self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| p[k] * self.scale + self.offset[k])
    }
    fn to_part(self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (p[k] - self.offset[k]) / self.scale)
    }
}

/// For each region of the joined mesh, its part and the region that its faces had there.
type RegionTable = Vec<(usize, Option<RegionId>)>;

/// Returns the classes of the joined mesh's regions, from those of the parts.
fn classes(own: &[RegionId], table: &RegionTable) -> Arc<[RegionId]> {
    let mut first: BTreeMap<(usize, Option<RegionId>), RegionId> = BTreeMap::new();
    let class = |(i, &(part, region)): (usize, &(usize, Option<RegionId>))| {
        let class = region.map(|r| own.get(r.index()).copied().unwrap_or(r));
        *first.entry((part, class)).or_insert_with(|| RegionId::new(i))
    };
    table.iter().enumerate().map(class).collect()
}

impl Layout {
    /// Places groups so far apart that no distance up to `near` connects one with another.
    fn new(parts: &[Part<'_>], near: f64) -> Self {
        let scale = |p: &Part<'_>| if p.scale.is_finite() && p.scale > 0.0 { p.scale } else { 1.0 };
        // The group of each part, and the bounding box of each group.
        let mut groups: BTreeMap<usize, usize> = BTreeMap::new();
        let mut boxes: Vec<Option<Bounds>> = Vec::new();
        let mut scale_of: Vec<f64> = Vec::new();
        let mut group_of = Vec::with_capacity(parts.len());
        for p in parts {
            let mut fresh = || {
                boxes.push(None);
                scale_of.push(scale(p));
                boxes.len() - 1
            };
            let group = match p.system {
                Some(system) => *groups.entry(system).or_insert_with(fresh),
                None => fresh(),
            };
            group_of.push(group);
            // All parts of a system use one scale, to the bit.
            let scale = scale_of[group];
            if let Some(own) = p.mesh.positions().view().bounds() {
                let (min, max) = (own.min.map(|x| x * scale), own.max.map(|x| x * scale));
                let all = boxes[group].get_or_insert(Bounds { min, max });
                all.min = [0, 1, 2].map(|k| all.min[k].min(min[k]));
                all.max = [0, 1, 2].map(|k| all.max[k].max(max[k]));
            }
        }
        let extents = boxes.iter().flatten().flat_map(|b| [0, 1, 2].map(|k| b.max[k] - b.min[k]));
        let largest = extents.fold(0f64, f64::max);
        let cell = if largest.is_finite() && largest > 0.0 { largest * (1.0 + PART_GAP) } else { 1.0 };
        let cell = if near.is_finite() && near > 0.0 { cell + near } else { cell };
        let side = (1..).find(|n: &usize| n * n * n >= boxes.len()).unwrap_or(1);
        let offset = |group: usize| {
            let min = boxes[group].map_or([0.0; 3], |b| b.min);
            let at = [group % side, group / side % side, group / side / side];
            // A single group keeps its position.
            [0, 1, 2].map(|k| if boxes.len() > 1 { at[k] as f64 * cell - min[k] } else { 0.0 })
        };
        let place = |&group: &usize| PartPlacement { scale: scale_of[group], offset: offset(group) };
        let has_neighbours = boxes.len() < parts.len();
        let mut joints = vec![0f32; boxes.len()];
        for (part, &group) in parts.iter().zip(&group_of) {
            joints[group] = joints[group].max(joint_count(part.mesh));
        }
        let first = |&group: &usize| {
            let first: f32 = joints[..group].iter().sum();
            // If single precision could not represent all joint indices, systems share their numbers.
            if first + MAX_JOINTS < 16_777_216.0 { first } else { 0.0 }
        };
        let first_joints = group_of.iter().map(first).collect();
        Self { places: group_of.iter().map(place).collect(), first_joints, has_neighbours }
    }

    /// Returns the offset of the joint indices of a part; 0 for other attributes.
    fn first_joint(&self, part: usize, semantic: &Semantic) -> f32 {
        if matches!(semantic, Semantic::Joints(_)) { self.first_joints[part] } else { 0.0 }
    }

    /// Returns all parts as one mesh whose regions identify the part of each face.
    fn join_parts(&self, parts: &[Part<'_>]) -> Result<(TriMesh, RegionTable), MeshError> {
        let (mut positions, mut vertex_of, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        let (mut regions, mut table) = (Vec::new(), RegionTable::new());
        for (i, (part, place)) in parts.iter().zip(&self.places).enumerate() {
            let mesh = part.mesh;
            let (first_vertex, first_wedge) = (positions.len() as u32, vertex_of.len() as u32);
            positions.extend(mesh.positions().view().iter().map(|p| place.to_scene(p)));
            let wedges = (0..mesh.wedge_count() as u32).map(WedgeId);
            vertex_of.extend(wedges.map(|w| VertexId(mesh.vertex_of(w).0 + first_vertex)));
            triangles.extend(mesh.triangles().iter().map(|t| t.map(|w| WedgeId(w.0 + first_wedge))));
            let mut known: BTreeMap<Option<RegionId>, RegionId> = BTreeMap::new();
            for f in 0..mesh.face_count() {
                let own = mesh.regions().map(|r| r[f]);
                let id = *known.entry(own).or_insert_with(|| {
                    table.push((i, own));
                    RegionId::new(table.len() - 1)
                });
                regions.push(id);
            }
        }
        let mut all = TriMesh::with_wedges(Positions::F64(positions), vertex_of, triangles)?;
        all.set_regions(Some(regions))?;
        let any = |has: fn(&TriMesh) -> bool| parts.iter().any(|p| has(p.mesh));
        if any(|m| m.normals().is_some()) {
            all.set_normals(Some(joined(parts, TriMesh::normals, [0.0; 3])))?;
        }
        if any(|m| m.uvs().is_some()) {
            all.set_uvs(Some(joined(parts, TriMesh::uvs, [0.0; 2])))?;
        }
        if any(|m| m.colors().is_some()) {
            all.set_colors(Some(joined(parts, TriMesh::colors, [1.0; 4])))?;
        }
        // A name may have different widths in different parts: each is an attribute of its own.
        let mut kinds: Vec<(&Semantic, usize)> = Vec::new();
        for a in parts.iter().flat_map(|p| p.mesh.further_attributes()) {
            if !kinds.contains(&(&a.semantic, a.width)) {
                kinds.push((&a.semantic, a.width));
            }
        }
        for (semantic, width) in kinds {
            let mut values = Vec::new();
            for (i, (part, place)) in parts.iter().zip(&self.places).enumerate() {
                let scale = length_scale(semantic, place.scale);
                let first = self.first_joint(i, semantic);
                match find(part.mesh, semantic, width) {
                    Some(a) => values.extend(a.values.iter().map(|x| single(f64::from(*x) * scale) + first)),
                    None => values.resize(values.len() + part.mesh.wedge_count() * width, 0.0),
                }
            }
            all.add_attribute(Attribute { semantic: semantic.clone(), width, values })?;
        }
        Ok((all, table))
    }

    /// Splits a result into parts, each with the kinds of attributes that it had, and returns the numbers of
    /// their vertices in the result. Locked vertices keep the bits of the input.
    fn split_parts(
        &self,
        parts: &[Part<'_>],
        all: &TriMesh,
        table: &RegionTable,
        held: &HeldWedges,
    ) -> Result<(Vec<TriMesh>, Vec<Vec<VertexId>>), MeshError> {
        let mut faces_of: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
        let regions = all.regions().unwrap_or_default();
        for (f, r) in regions.iter().enumerate() {
            faces_of[table[r.index()].0].push(f);
        }
        let mut number_of_wedge = vec![u32::MAX; all.wedge_count()];
        let mut number_of_vertex = vec![u32::MAX; all.vertex_count()];
        let view = all.positions().view();
        let (mut meshes, mut numbers) = (Vec::with_capacity(parts.len()), Vec::with_capacity(parts.len()));
        let mut first_wedge = 0;
        for (i, ((part, place), faces)) in parts.iter().zip(&self.places).zip(&faces_of).enumerate() {
            let (mut wedges, mut vertices) = (Vec::new(), Vec::new());
            // The wedge and the vertex of the part that each one is, if locked.
            let (mut own_wedges, mut own_vertices) = (Vec::new(), Vec::new());
            for (f, k) in faces.iter().flat_map(|&f| [(f, 0), (f, 1), (f, 2)]) {
                let w = all.triangles()[f][k];
                if number_of_wedge[w.index()] == u32::MAX {
                    number_of_wedge[w.index()] = wedges.len() as u32;
                    wedges.push(w);
                    let own = held.at(f, k).and_then(|h| h.index().checked_sub(first_wedge));
                    let own = own.filter(|&i| i < part.mesh.wedge_count()).map(WedgeId::new);
                    own_wedges.push(own);
                    let v = all.vertex_of(w);
                    if number_of_vertex[v.index()] == u32::MAX {
                        number_of_vertex[v.index()] = vertices.len() as u32;
                        vertices.push(v);
                        own_vertices.push(own.map(|w| part.mesh.vertex_of(w)));
                    }
                }
            }
            first_wedge += part.mesh.wedge_count();
            let places = vertices.iter().map(|&v| place.to_part(view.get(v))).zip(&own_vertices);
            let positions = match part.mesh.positions() {
                Positions::F32(own) => Positions::F32(
                    places.map(|(p, v)| v.map_or_else(|| p.map(|x| x as f32), |v| own[v.index()])).collect(),
                ),
                Positions::F64(own) => {
                    Positions::F64(places.map(|(p, v)| v.map_or(p, |v| own[v.index()])).collect())
                }
            };
            let vertex_of = wedges.iter().map(|&w| VertexId(number_of_vertex[all.vertex_of(w).index()]));
            let triangles =
                faces.iter().map(|&f| all.triangles()[f].map(|w| WedgeId(number_of_wedge[w.index()])));
            let mut mesh = TriMesh::with_wedges(positions, vertex_of.collect(), triangles.collect())?;
            if part.mesh.regions().is_some() {
                let own = faces.iter().map(|&f| table[regions[f].index()].1.unwrap_or_default());
                mesh.set_regions(Some(own.collect()))?;
            }
            if part.mesh.normals().is_some() {
                mesh.set_normals(all.normals().map(|n| wedges.iter().map(|w| n[w.index()]).collect()))?;
            }
            if part.mesh.uvs().is_some() {
                mesh.set_uvs(all.uvs().map(|t| of_part(t, &wedges, part.mesh.uvs())))?;
            }
            if part.mesh.colors().is_some() {
                mesh.set_colors(all.colors().map(|c| of_part(c, &wedges, part.mesh.colors())))?;
            }
            for a in part.mesh.further_attributes() {
                let Some(source) = find(all, &a.semantic, a.width) else { continue };
                let scale = length_scale(&a.semantic, place.scale);
                let first = self.first_joint(i, &a.semantic);
                let given = |x: &f32| match first {
                    0.0 => single(f64::from(*x) / scale),
                    // (A joint with weight 0 has index 0 in the joined mesh.)
                    first => (x - first).max(0.0),
                };
                let mut values: Vec<f32> = wedges.iter().flat_map(|&w| source.of(w)).map(given).collect();
                if has_ranges(&a.semantic) {
                    let ranges = ranges(&a.values, a.width);
                    for row in values.chunks_exact_mut(a.width) {
                        row.iter_mut().zip(&ranges).for_each(|(x, range)| *x = within(*x, *range));
                    }
                }
                mesh.add_attribute(Attribute { values, ..a.clone() })?;
            }
            resum_weights(&mut mesh, all, &wedges);
            if own_wedges.iter().any(Option::is_some) {
                constraints::restore(&mut mesh, part.mesh, &own_wedges);
            }
            meshes.push(mesh);
            // Parts that touch share vertices, and each counts its own.
            wedges.iter().for_each(|w| number_of_wedge[w.index()] = u32::MAX);
            vertices.iter().for_each(|v| number_of_vertex[v.index()] = u32::MAX);
            numbers.push(vertices);
        }
        Ok((meshes, numbers))
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

/// Largest number of joints that a glTF mesh can use: their indices have two bytes.
const MAX_JOINTS: f32 = 65_536.0;

/// Returns the number of joints that a mesh may use.
fn joint_count(mesh: &TriMesh) -> f32 {
    let sets = mesh.further_attributes().iter().filter(|a| matches!(a.semantic, Semantic::Joints(_)));
    let largest = sets.flat_map(|a| &a.values).copied().filter(|x| x.is_finite()).fold(-1.0, f32::max);
    (largest + 1.0).min(MAX_JOINTS)
}

/// Concatenates an attribute of all parts, wedge after wedge; `blank` fills parts that do not have it.
fn joined<'a, const N: usize>(
    parts: &[Part<'a>],
    of: impl Fn(&'a TriMesh) -> Option<&'a [[f32; N]]>,
    blank: [f32; N],
) -> Vec<[f32; N]> {
    let mut all = Vec::new();
    for part in parts {
        match of(part.mesh) {
            Some(values) => all.extend_from_slice(values),
            None => all.resize(all.len() + part.mesh.wedge_count(), blank),
        }
    }
    all
}

/// Extracts an attribute of a part from that of the joined mesh, clamped to the ranges that it has in the
/// part.
fn of_part<const N: usize>(
    all: &[[f32; N]],
    wedges: &[WedgeId],
    source: Option<&[[f32; N]]>,
) -> Vec<[f32; N]> {
    let ranges = ranges(source.map_or(&[], <[_]>::as_flattened), N);
    wedges.iter().map(|w| std::array::from_fn(|k| within(all[w.index()][k], ranges[k]))).collect()
}

fn find<'a>(mesh: &'a TriMesh, semantic: &Semantic, width: usize) -> Option<&'a Attribute> {
    mesh.further_attributes().iter().find(|a| a.semantic == *semantic && a.width == width)
}

/// Returns the factor by which values grow with the mesh: displacements are lengths.
fn length_scale(semantic: &Semantic, scale: f64) -> f64 {
    if matches!(semantic, Semantic::Morph { of: Morphed::Position, .. }) { scale } else { 1.0 }
}

/// Converts to single precision; finite values beyond its range are clamped.
fn single(x: f64) -> f32 {
    if x.is_finite() { x.clamp(f64::from(-f32::MAX), f64::from(f32::MAX)) as f32 } else { x as f32 }
}

/// Rescales joint weights to a sum of 1 where some belonged to sets that the mesh does not have: those at its
/// wedges in `all`.
fn resum_weights(mesh: &mut TriMesh, all: &TriMesh, wedges: &[WedgeId]) {
    let is_weight = |a: &Attribute| matches!(a.semantic, Semantic::Weights(_)) && a.width == 4;
    let own = mesh.further_attributes();
    let sets: Vec<usize> = (0..own.len()).filter(|&i| is_weight(&own[i])).collect();
    let is_lost = |a: &&Attribute| is_weight(a) && !own.iter().any(|b| b.semantic == a.semantic);
    let lost: Vec<&Attribute> = all.further_attributes().iter().filter(is_lost).collect();
    for (w, of_all) in wedges.iter().enumerate() {
        if lost.iter().all(|a| a.of(*of_all) == [0.0; 4]) {
            continue;
        }
        let of = 4 * w..4 * w + 4;
        let sum: f32 = sets.iter().flat_map(|&i| &mesh.further_attributes()[i].values[of.clone()]).sum();
        if sum > 0.0 {
            for &i in &sets {
                mesh.further_values_mut(i)[of.clone()].iter_mut().for_each(|x| *x /= sum);
            }
        }
    }
}
