//! Start and reference of a remesh: the input, simplified first where that saves time, its feature curves,
//! and search trees over both.

use std::collections::HashMap;

use glam::DVec3;
use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{DisjointSets, HalfEdgeId, Positions, PositionsView, Surface, TriMesh, VertexId};

use super::half_edges::{HalfEdges, LineKind, OPEN, gather};
use crate::collapse::order::NONE;
use crate::control::{Control, Stage, Verdict};
use crate::input::{Input, MeshData};
use crate::methods::task::{PreparedInput, Task};
use crate::options::{BorderPolicy, Fit, Length, SimplifyOptions, Stop, TopologyPolicy};
use crate::run::run_collapses;
use crate::{Simplified, SimplifyError, StoppedBy};

/// Edges with a larger dihedral bend than this are creases, in degrees. (A guess.)
const CREASE_DEG: f64 = 50.0;
/// A line has a corner where its two sides meet at less than 180 degrees minus this, both locally and
/// `CORNER_REACH` away. (A guess.)
const CORNER_DEG: f64 = 45.0;
/// Distance of the second corner test, in target edge lengths. (A guess.)
const CORNER_REACH: f64 = 0.7;
/// Creases shorter than this, in target edge lengths, are ignored. (A guess.)
const MIN_CREASE_LENGTH: f64 = 2.0;
/// An edge of the simplified mesh is a crease if it lies within this share of its length from a crease of the
/// input. (A guess.)
const NEAR_CREASE: f64 = 0.15;

/// The original surface, with the trees that project vertices back onto it.
pub(super) struct ReferenceSurface<'a> {
    pub(super) prepared: &'a PreparedInput,
    pub(super) tree: Bvh,
    /// Trees over the segments of each kind of line, in the order of [`LineKind::CURVES`].
    curves: [Option<Bvh>; 3],
    /// Cosine of the dihedral bend above which an edge is a crease.
    crease_cos: f64,
}

/// The input simplified by the collapse engine.
pub(super) struct SimplifiedInput {
    pub(super) mesh: HalfEdges,
    pub(super) parts_removed: usize,
    pub(super) necks_cut: usize,
    pub(super) steps: u64,
    pub(super) is_finished: bool,
}

impl<'a> ReferenceSurface<'a> {
    /// Builds the reference surface of a task, and its mesh with all lines marked.
    pub(super) fn new(task: &Task<'a>) -> (Self, HalfEdges) {
        let prepared = task.input;
        let mut mesh = HalfEdges::new(
            &prepared.points,
            &prepared.faces,
            prepared.regions.as_deref(),
            prepared.locked.as_deref(),
        );
        let crease_cos = libm::cos(task.options.method.crease_deg().unwrap_or(CREASE_DEG).to_radians());
        let bent: Vec<HalfEdgeId> = bends(&mesh, crease_cos).collect();
        bent.into_iter().for_each(|h| mesh.set_line(h, LineKind::Crease));
        let curves = LineKind::CURVES.map(|line| {
            let segments: Vec<[VertexId; 3]> = mesh
                .half_edges()
                .filter(|&h| mesh.is_first(h) && mesh.line[h.index()] == line)
                .map(|h| [mesh.from(h), mesh.to(h), mesh.to(h)])
                .collect();
            (!segments.is_empty()).then(|| tree(&mesh.points, &segments))
        });
        let reference = Self { prepared, tree: tree(&prepared.points, &prepared.faces), curves, crease_cos };
        (reference, mesh)
    }

    /// Returns the tree over the lines of a kind.
    pub(super) fn curve(&self, line: LineKind) -> Option<&Bvh> {
        let k = LineKind::CURVES.iter().position(|l| *l == line)?;
        self.curves[k].as_ref()
    }

    /// Returns the normal of a face of the original, of length 1 or 0.
    pub(super) fn normal(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.prepared.faces[face].map(|v| self.prepared.points[v.index()]);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Returns the mesh to start from: the input simplified to `wanted` faces, with its lines marked.
    pub(super) fn simplified(
        &self,
        task: &Task<'_>,
        wanted: usize,
        topology: TopologyPolicy,
        control: &mut dyn Control,
    ) -> Result<SimplifiedInput, SimplifyError> {
        let prepared = self.prepared;
        let mut mesh = TriMesh::new(
            Positions::F64(prepared.points.iter().map(|p| p.to_array()).collect()),
            prepared.faces.clone(),
        )?;
        mesh.set_regions(prepared.regions.clone())?;
        let mut options = engine_options(task.options, wanted);
        options.topology = topology;
        let data = MeshData { locked: prepared.locked.as_deref(), ..MeshData::default() };
        let lighter = run_engine(&Input::new(&mesh).with(data), &options, control)?;
        let points: Vec<DVec3> = lighter.mesh.positions().view().iter().map(DVec3::from).collect();
        let places: HashMap<[u64; 3], VertexId> =
            prepared.points.iter().zip(0..).map(|(p, v)| (bits(*p), VertexId(v))).collect();
        let kept: Vec<VertexId> =
            points.iter().map(|p| places.get(&bits(*p)).copied().unwrap_or(NONE)).collect();
        let locked = prepared
            .locked
            .as_ref()
            .map(|locked| kept.iter().map(|v| *v != NONE && locked[v.index()]).collect::<Vec<bool>>());
        let surface = lighter.mesh.surface();
        let mut mesh =
            HalfEdges::new(&points, surface.triangles(), lighter.mesh.regions(), locked.as_deref());
        mesh.kept = gather(&kept, &mesh.kept);
        self.find_creases(&mut mesh);
        let report = lighter.report;
        Ok(SimplifiedInput {
            mesh,
            parts_removed: report.parts_removed,
            necks_cut: report.necks_cut,
            steps: report.collapses,
            is_finished: report.stopped_by == StoppedBy::Caller,
        })
    }

    /// Finds the edges of a mesh near the original that lie along its creases and seams.
    pub(super) fn lines_of(
        &self,
        points: &[DVec3],
        faces: &[[VertexId; 3]],
    ) -> HashMap<[VertexId; 2], LineKind> {
        let mut mesh = HalfEdges::new(points, faces, None, None);
        self.find_creases(&mut mesh);
        if let Some(seams) = self.curve(LineKind::Seam) {
            let found: Vec<HalfEdgeId> =
                mesh.half_edges().filter(|&h| mesh.is_first(h) && is_along(&mesh, h, seams)).collect();
            found.into_iter().for_each(|h| mesh.set_line(h, mesh.line[h.index()].max(LineKind::Seam)));
        }
        let marked =
            mesh.half_edges().filter(|h| matches!(mesh.line[h.index()], LineKind::Crease | LineKind::Seam));
        let name = |v: VertexId| mesh.kept[v.index()];
        marked
            .map(|h| {
                let (a, b) = (name(mesh.from(h)), name(mesh.to(h)));
                ([a.min(b), a.max(b)], mesh.line[h.index()])
            })
            .collect()
    }

    /// Marks the bent edges that lie along a crease of the original.
    fn find_creases(&self, mesh: &mut HalfEdges) {
        let Some(creases) = self.curve(LineKind::Crease) else { return };
        // Simplification rounds creases off.
        let loose = libm::cos(0.7 * libm::acos(self.crease_cos));
        let found: Vec<HalfEdgeId> = bends(mesh, loose).filter(|&h| is_along(mesh, h, creases)).collect();
        found.into_iter().for_each(|h| mesh.set_line(h, LineKind::Crease));
    }
}

/// True if an edge lies along curves of the original, tested at three points.
fn is_along(mesh: &HalfEdges, h: HalfEdgeId, curves: &Bvh) -> bool {
    let (a, b) = (mesh.at(mesh.from(h)), mesh.at(mesh.to(h)));
    let near = NEAR_CREASE * a.distance(b);
    let at = |t: f64| a.lerp(b, t).to_array();
    [0.2, 0.5, 0.8].iter().all(|&t| curves.closest_within(at(t), near, &mut Hint::default()).is_some())
}

/// Returns the edges of the smooth surface whose dihedral bend exceeds an angle.
fn bends(mesh: &HalfEdges, cos: f64) -> impl Iterator<Item = HalfEdgeId> {
    mesh.half_edges().filter(move |&h| {
        if !mesh.is_first(h) || mesh.twin(h) == OPEN || mesh.line[h.index()] != LineKind::None {
            return false;
        }
        let (n, m) = (mesh.normal(h.face().index()), mesh.normal(mesh.twin(h).face().index()));
        let scale = n.length() * m.length();
        scale > 0.0 && n.dot(m) < cos * scale
    })
}

fn bits(p: DVec3) -> [u64; 3] {
    p.to_array().map(f64::to_bits)
}

pub(super) fn tree(points: &[DVec3], faces: &[[VertexId; 3]]) -> Bvh {
    let points: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
    Bvh::new(&Surface::new(PositionsView::F64(&points), faces).expect("the faces use these points"))
}

/// Returns the options of an engine run inside a remesh.
pub(super) fn engine_options(of: &SimplifyOptions, faces: usize) -> SimplifyOptions {
    let mut options = SimplifyOptions::new(Stop::faces(faces));
    (options.border, options.topology, options.fit) = (of.border, of.topology, Fit::Off);
    options
}

/// Runs the engine once, controlled by the caller of the remesh.
pub(super) fn run_engine(
    input: &Input<'_>,
    options: &SimplifyOptions,
    control: &mut dyn Control,
) -> Result<Simplified, SimplifyError> {
    Ok(run_collapses(input, options, &mut NestedControl(control))?.0)
}

/// Control of a nested run: forwards requests to stop, reports no stages.
struct NestedControl<'a>(&'a mut dyn Control);

impl Control for NestedControl<'_> {
    fn stage(&mut self, _: Stage) {}
    fn progress(&mut self, _: f64) -> Verdict {
        self.0.progress(0.0)
    }
}

/// Finalises the lines for an edge length: unmarks creases that are too short, pins corners. Returns the kind
/// of line on which each vertex lies.
pub(super) fn settle_lines(mesh: &mut HalfEdges, length: f64, border: BorderPolicy) -> Vec<LineKind> {
    drop_short_creases(mesh, length);
    if border == BorderPolicy::Lock {
        let open: Vec<HalfEdgeId> =
            mesh.half_edges().filter(|h| mesh.line[h.index()] == LineKind::Border).collect();
        for h in open {
            mesh.set_line(h, LineKind::Fixed);
            for v in [mesh.from(h), mesh.to(h)] {
                mesh.pinned[v.index()] = true;
            }
        }
    }
    let mut lines = Vec::new();
    let mut on = vec![LineKind::None; mesh.points.len()];
    let mut corners = Vec::new();
    for v in (0..mesh.points.len()).map(VertexId::new) {
        mesh.lines_at(v, &mut lines);
        let kinds = lines.iter().map(|x| mesh.line[x.0.index()]);
        on[v.index()] = kinds.clone().max().unwrap_or_default();
        let is_curve = lines.len() == 2 && mesh.line[lines[0].0.index()] == mesh.line[lines[1].0.index()];
        if !lines.is_empty() && (!is_curve || turns(mesh, v, [lines[0].1, lines[1].1], length)) {
            corners.push(v);
        }
    }
    corners.into_iter().for_each(|v| mesh.pinned[v.index()] = true);
    on
}

/// True if a line has a corner at `v`, both locally and some distance away.
fn turns(mesh: &HalfEdges, v: VertexId, next: [VertexId; 2], length: f64) -> bool {
    let at = mesh.at(v);
    let is_sharp = |a: DVec3, b: DVec3| {
        let (a, b) = ((a - at).normalize_or_zero(), (b - at).normalize_or_zero());
        a.dot(b) > -libm::cos(CORNER_DEG.to_radians())
    };
    if !is_sharp(mesh.at(next[0]), mesh.at(next[1])) {
        return false;
    }
    let far = next.map(|n| along(mesh, v, n, CORNER_REACH * length));
    is_sharp(far[0], far[1])
}

/// Maximum number of edges that `along` follows from one vertex.
const MAX_LINE_STEPS: usize = 64;

/// Returns the point at distance `reach` along a line.
fn along(mesh: &HalfEdges, mut last: VertexId, mut v: VertexId, reach: f64) -> DVec3 {
    let mut lines = Vec::new();
    let mut gone = 0.0;
    for _ in 0..MAX_LINE_STEPS {
        let (a, b) = (mesh.at(last), mesh.at(v));
        let step = a.distance(b);
        if gone + step >= reach {
            return a.lerp(b, ((reach - gone) / step).clamp(0.0, 1.0));
        }
        gone += step;
        mesh.lines_at(v, &mut lines);
        let next = lines.iter().map(|x| x.1).find(|w| *w != last);
        match next {
            Some(next) if lines.len() == 2 => (last, v) = (v, next),
            _ => return b,
        }
    }
    mesh.at(v)
}

/// Unmarks connected creases whose total length is below [`MIN_CREASE_LENGTH`].
fn drop_short_creases(mesh: &mut HalfEdges, length: f64) {
    let creases: Vec<HalfEdgeId> =
        mesh.half_edges().filter(|&h| mesh.is_first(h) && mesh.line[h.index()] == LineKind::Crease).collect();
    let mut lines = DisjointSets::new(mesh.points.len());
    for &h in &creases {
        lines.join(mesh.from(h).0, mesh.to(h).0);
    }
    let mut total = vec![0f64; mesh.points.len()];
    for &h in &creases {
        total[lines.find(mesh.from(h).0) as usize] += mesh.length_sq(h).sqrt();
    }
    for h in creases {
        if total[lines.find(mesh.from(h).0) as usize] < MIN_CREASE_LENGTH * length {
            mesh.set_line(h, LineKind::None);
        }
    }
}

/// Returns the edge length requested by a task, in the unit frame.
pub(super) fn asked_length(task: &Task<'_>) -> Option<f64> {
    task.options.method.edge_length().map(|l: Length| task.input.length(l))
}
