//! What a run says of itself.

use lodsmith_core::TriMesh;
use lodsmith_core::measure::Comparison;

use crate::proposal::{Change, Proposal};
use crate::prune::Pruned;

/// Why a collapse was not done. Each is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Refusal {
    /// The ends share a neighbour beyond their common faces: the surface would be pinched. [Dey 1999]
    LinkCondition,
    /// A face would turn over, or further than a guard allows.
    NormalFlip,
    /// A face would become a sliver.
    Quality,
    /// A vertex would get too many edges.
    Valence,
    /// An edge would get too long.
    EdgeLength,
    /// The border policy forbids it.
    Border,
    /// The vertex lies on a non-manifold edge or point and may not move off it.
    NonManifold,
    /// The last faces of a part: the topology policy keeps parts.
    Component,
    /// Attributes would be torn off their side of a seam.
    Seam,
    /// It costs more than the stop allows.
    Cost,
    /// The vertices, or what stands on them, are locked.
    Locked,
    /// The faces of a part are not what a subdivision leaves.
    Pattern,
}

impl Refusal {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 12] = [
        Self::LinkCondition,
        Self::NormalFlip,
        Self::Quality,
        Self::Valence,
        Self::EdgeLength,
        Self::Border,
        Self::NonManifold,
        Self::Component,
        Self::Seam,
        Self::Cost,
        Self::Locked,
        Self::Pattern,
    ];
    /// The word for it in reports, such as `link_condition`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LinkCondition => "link_condition",
            Self::NormalFlip => "normal_flip",
            Self::Quality => "quality",
            Self::Valence => "valence",
            Self::EdgeLength => "edge_length",
            Self::Border => "border",
            Self::NonManifold => "non_manifold",
            Self::Component => "component",
            Self::Seam => "seam",
            Self::Cost => "cost",
            Self::Locked => "locked",
            Self::Pattern => "pattern",
        }
    }
}

/// What ended a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StoppedBy {
    /// The number of triangles.
    Faces,
    /// The number of vertices.
    Vertices,
    /// The part of the triangles.
    Ratio,
    /// The error: one step further would pass it.
    Error,
    /// No collapse is left that topology and guards allow.
    Refusals,
    /// The method is done: it has nothing more to take away.
    Exhausted,
    /// The caller asked for the best mesh so far.
    Caller,
    /// No stop was given, or the input met it already.
    Nothing,
}

impl StoppedBy {
    /// The word for it in reports, such as `faces`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Faces => "faces",
            Self::Vertices => "vertices",
            Self::Ratio => "ratio",
            Self::Error => "error",
            Self::Refusals => "refusals",
            Self::Exhausted => "exhausted",
            Self::Caller => "time_limit",
            Self::Nothing => "nothing_to_do",
        }
    }
}

/// What was mended before the run. Counts of elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleanup {
    /// Vertices joined with another at the same place, or within the weld distance.
    pub welded_vertices: usize,
    /// Faces that named one place twice.
    pub degenerate_faces: usize,
    /// Faces that were there already, with the same winding.
    pub duplicate_faces: usize,
    /// Faces with a corner that is not a number.
    pub non_finite_faces: usize,
    /// Vertices without faces, left out.
    pub unused_vertices: usize,
}

/// How far the result lies from the input, in the units of the mesh.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ErrorReport {
    /// The engine's own figure for the RMS distance.
    pub estimate: f64,
    /// Measured both ways, where asked: what samples saw. After a stop by an error it is by a quarter of the usual samples, unless
    /// [`Measure::Always`](crate::Measure::Always) asks for all.
    pub measured: Option<Comparison>,
    /// No point lies farther away: proven, for the ways that [`SimplifyOptions::bound`](crate::SimplifyOptions) promises;
    /// `None` where it promises nothing. At most 1 % above the largest distance seen, 25 % where the stop has an error, unless
    /// that took too much work.
    pub bound: Option<f64>,
    /// Diagonal of the input's bounding box.
    pub diagonal: f64,
}

/// What [`Method::Cluster`](crate::Method::Cluster) did before anything else came to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Clustered {
    /// Edge of a cell, in the units of the mesh; 0 where the input was light enough.
    pub cell: f64,
    /// Triangles of the clusters: those of the result, unless a second stage went on.
    pub faces: usize,
    /// Vertices of the clusters.
    pub vertices: usize,
    /// Edges with more than two triangles then: sheets that are nearer than a cell grow together.
    pub non_manifold_edges: usize,
}

/// What a run did and why it ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// Whether a stop was met: no more triangles or vertices than asked, or the error used up.
    pub reached: bool,
    /// What ended the run.
    pub stopped_by: StoppedBy,
    /// Deviation.
    pub error: ErrorReport,
    /// Collapses refused, by reason; only those that happened, in the order of [`Refusal::ALL`].
    pub refusals: Vec<(Refusal, u64)>,
    /// Collapses done.
    pub collapses: u64,
    /// Whole parts that went because the target could not be met otherwise, or, where topology is free, because they were
    /// the cheapest to go.
    pub parts_removed: usize,
    /// Necks that were cut: three edges round a handle or a thin place each.
    pub necks_cut: usize,
    /// Pairs of vertices without an edge between them that were contracted, with
    /// [`MethodOptions::pairs`](crate::MethodOptions); they are among the collapses.
    pub pairs_contracted: usize,
    /// Vertices that were locked, those at one place counted once.
    pub locked_vertices: usize,
    /// Faces that stayed as they were because all their vertices were locked.
    pub locked_faces: usize,
    /// Whether vertices on seams were merged across them, because nothing else was left to do.
    pub seams_relaxed: bool,
    /// Whether sharp edges that the options make features of were left, because nothing else was left to do.
    pub sharp_relaxed: bool,
    /// What was mended first.
    pub cleanup: Cleanup,
    /// Attributes that the result does not carry, though the input did: joints without weights of the same set, or weights
    /// without joints.
    pub dropped: Vec<&'static str>,
    /// Whether the fit ran.
    pub fitted: bool,
    /// What would let the run go on, where it is stuck above its target ([`StoppedBy::Refusals`]); the change that sets
    /// most free first. Empty where no option helps.
    pub proposals: Vec<Proposal>,
    /// The steps that were tried after the first run, with [`SimplifyOptions::escalate`](crate::SimplifyOptions).
    pub escalated: Vec<Escalation>,
    /// Small parts that went first. Distances are from what was left.
    pub pruned: Pruned,
    /// The grid, where there was one.
    pub clustered: Option<Clustered>,
    /// Faces that collapses and their costs looked at, each as often as it was, as a measure of the work done; 0 for methods
    /// that collapse no edges.
    #[doc(hidden)]
    pub faces_visited: u64,
}

/// A step of an escalation, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Escalation {
    /// What was changed.
    pub change: Change,
    /// Triangles of the run before.
    pub before: usize,
    /// Triangles of the run with the change.
    pub after: usize,
}

/// A lighter mesh, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Simplified {
    /// The result.
    pub mesh: TriMesh,
    /// What was done, and why it ended.
    pub report: Report,
}
