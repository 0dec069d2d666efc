//! Report of a run.

use lodsmith_core::TriMesh;
use lodsmith_core::measure::Comparison;

use crate::proposal::{Change, Proposal};
use crate::prune::Pruned;

/// Reason why a collapse was refused. Refusals are counted by reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Refusal {
    /// The ends share a neighbour outside their common faces: the collapse would pinch the surface. [Dey
    /// 1999]
    LinkCondition,
    /// A face would flip, or rotate further than a guard allows.
    NormalFlip,
    /// A face would become a sliver.
    Quality,
    /// A vertex would get too many edges.
    Valence,
    /// An edge would get too long.
    EdgeLength,
    /// The border policy forbids the collapse.
    Border,
    /// The vertex lies on a non-manifold edge or point and may not move off it.
    NonManifold,
    /// It would remove the last faces of a part, and the topology policy keeps parts.
    Component,
    /// Attributes would move to the other side of a seam.
    Seam,
    /// The result would be beyond the error limit. Counts parts too: those that stay because they are farther than the
    /// limit from the others.
    ErrorLimit,
    /// A vertex or its attributes are locked.
    Locked,
    /// The faces of a part do not have the pattern of a subdivision.
    Pattern,
}

impl Refusal {
    /// All reasons, in the order of reports.
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
        Self::ErrorLimit,
        Self::Locked,
        Self::Pattern,
    ];
    /// Returns the name of the reason in reports, such as `link_condition`.
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
            Self::ErrorLimit => "error_limit",
            Self::Locked => "locked",
            Self::Pattern => "pattern",
        }
    }
}

/// Reason why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StoppedBy {
    /// The number of triangles was reached.
    Faces,
    /// The number of vertices was reached.
    Vertices,
    /// The fraction of the triangles was reached.
    Ratio,
    /// The error limit was reached: the next step would exceed it.
    Error,
    /// No remaining collapse is allowed by topology and guards.
    Refusals,
    /// The method has nothing left to remove.
    Exhausted,
    /// The caller asked for the best mesh so far.
    Caller,
    /// No stop was given, or the input met it already.
    Nothing,
}

impl StoppedBy {
    /// Returns the name of the reason in reports, such as `faces`.
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

/// Repairs made before the run, as counts of elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cleanup {
    /// Vertices merged with another at the same position, or within the weld distance.
    pub welded_vertices: usize,
    /// Faces that used one position twice.
    pub degenerate_faces: usize,
    /// Faces that repeated another one, with the same winding.
    pub duplicate_faces: usize,
    /// Faces with a position that is NaN or infinite.
    pub non_finite_faces: usize,
    /// Vertices without faces, dropped.
    pub unused_vertices: usize,
}

/// Distance between the result and the input, in the units of the mesh.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorReport {
    /// The engine's estimate of the RMS distance.
    pub estimate: f64,
    /// Distances measured in both directions by samples, if measured. After a stop at an error, a quarter of
    /// the usual samples is taken, or all with [`Measure::Always`](crate::Measure::Always).
    pub measured: Option<Comparison>,
    /// In a scene, the number of the part that the farthest point belongs to; `None` for a single mesh, or if there is no
    /// such point.
    pub farthest_part: Option<usize>,
    /// Proven upper bound on the distance of any point, in the directions that
    /// [`SimplifyOptions::bound`](crate::SimplifyOptions) guarantees; `None` where it guarantees nothing. At
    /// most 1 % above the largest distance seen, or 25 % with a stop at an error, unless that took too much
    /// work.
    pub bound: Option<f64>,
    /// True if the caller [ended](crate::Verdict::Finish) the run before all was measured and proven that the options ask for:
    /// what is missing in `measured` and `bound` is not known.
    #[cfg_attr(feature = "serde", serde(default))]
    pub is_incomplete: bool,
    /// Diagonal of the input's bounding box.
    pub diagonal: f64,
}

/// Outcome of the clustering stage of [`Method::Cluster`](crate::Method::Cluster), before any other stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clustered {
    /// Edge length of a cell, in the units of the mesh; 0 if the input was light enough.
    pub cell: f64,
    /// Triangles after clustering; equal to the result's, unless a second stage followed.
    pub faces: usize,
    /// Vertices after clustering.
    pub vertices: usize,
    /// Edges with more than two triangles after clustering: sheets closer than a cell are merged.
    pub non_manifold_edges: usize,
}

/// Outcome of a run: counts, error, refusals, and the reason why it ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Report {
    /// Triangles of the input.
    pub input_faces: usize,
    /// Vertices of the input.
    pub input_vertices: usize,
    /// Triangles of the result.
    pub faces: usize,
    /// Vertices of the result.
    pub vertices: usize,
    /// True if a stop was met: no more triangles or vertices than requested, or the error limit reached.
    pub reached: bool,
    /// Reason why the run ended.
    pub stopped_by: StoppedBy,
    /// Distance between the result and the input.
    pub error: ErrorReport,
    /// Collapses refused, by reason; only reasons that occurred, in the order of [`Refusal::ALL`].
    pub refusals: Vec<(Refusal, u64)>,
    /// Collapses done.
    pub collapses: u64,
    /// Whole parts removed: because the target could not be met otherwise or, with free topology, because
    /// they were the cheapest to remove.
    pub parts_removed: usize,
    /// Necks that were cut, each a loop of three edges around a handle or a thin place.
    pub necks_cut: usize,
    /// Contracted pairs of vertices without an edge between them, with
    /// [`pairs`](crate::Method::Memoryless); included in the collapses.
    pub pairs_contracted: usize,
    /// Locked vertices; those at one position are counted once.
    pub locked_vertices: usize,
    /// Faces kept unchanged because all their vertices were locked.
    pub locked_faces: usize,
    /// True if seam vertices were merged across seams because no other collapse was left.
    pub seams_relaxed: bool,
    /// True if vertices left sharp edges that are features by the options, because no other collapse was
    /// left.
    pub sharp_relaxed: bool,
    /// Repairs made before the run.
    pub cleanup: Cleanup,
    /// Attributes of the input that the result does not carry: joints without weights of the same set, or
    /// weights without joints.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "dropped_names"))]
    pub dropped: Vec<&'static str>,
    /// True if the fit ran.
    pub fitted: bool,
    /// Changes of the options with which the run could continue if it is stuck above its target
    /// ([`StoppedBy::Refusals`]); the change that permits most comes first. Empty if no option helps.
    pub proposals: Vec<Proposal>,
    /// Steps that were tried after the first run, with [`SimplifyOptions::escalate`](crate::SimplifyOptions).
    pub escalated: Vec<Escalation>,
    /// Small parts that were removed first. Distances are measured from the remaining parts.
    pub pruned: Pruned,
    /// In a scene, places where borders of meshes touched and were separated: the meshes were simplified
    /// separately, or the method did not keep their vertices.
    pub gaps: usize,
    /// Pairs of faces of the input that lie on each other with opposite windings: the two sides of a sheet,
    /// reduced as one.
    pub two_sided_pairs: usize,
    /// Connected parts that are two-sided sheets too, but were reduced as closed surfaces and may lose area,
    /// because their sides have different triangles. (Only flat ones are counted: bent sides with different
    /// triangles cannot be distinguished from thin solids.)
    pub unpaired_sheets: usize,
    /// Outcome of the clustering stage, if there was one.
    pub clustered: Option<Clustered>,
    /// Number of face visits by collapses and their costs, as a measure of the work done; 0 for methods that
    /// do not collapse edges.
    #[doc(hidden)]
    pub faces_visited: u64,
}

/// Reads the names of dropped attributes.
#[cfg(feature = "serde")]
fn dropped_names<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<&'static str>, D::Error> {
    let names: Vec<String> = serde::Deserialize::deserialize(from)?;
    // The names from `Semantic::title`.
    let known = [
        "tangents",
        "further texture coordinates",
        "further colours",
        "joints",
        "weights",
        "morph targets",
        "custom attribute",
        "discrete attribute",
    ];
    let known = |name: String| known.into_iter().find(|known| *known == name);
    let unknown = || serde::de::Error::custom("a dropped attribute has an unknown name");
    names.into_iter().map(|name| known(name).ok_or_else(unknown)).collect()
}

/// One step of an escalation and its outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Escalation {
    /// The change of the options.
    pub change: Change,
    /// Triangles of the run before the change.
    pub before: usize,
    /// Triangles of the run with the change.
    pub after: usize,
}

/// The simplified mesh and the report of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct Simplified {
    /// The result.
    pub mesh: TriMesh,
    /// The report of the run.
    pub report: Report,
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_refusal_has_its_index_and_a_unique_name() {
        // Counts of refusals are indexed by their position in the list.
        assert!(Refusal::ALL.iter().enumerate().all(|(i, why)| *why as usize == i));
        let words: BTreeSet<&str> = Refusal::ALL.iter().map(|why| why.name()).collect();
        assert_eq!(words.len(), Refusal::ALL.len());
        let is_word =
            |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_lowercase() || b == b'_');
        assert!(words.into_iter().all(is_word));
    }
}
