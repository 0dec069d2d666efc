//! Proposals: changes of the options with which a run that is stuck above its target could continue.

use crate::options::{BorderPolicy, Length, Method, Placement, SimplifyOptions, TopologyPolicy};

/// Largest distance of pairs to try, as a share of the diagonal: half a percent.
const PAIR_DISTANCE: f64 = 0.005;

/// A change of one option.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Change {
    /// Another border policy.
    Border(BorderPolicy),
    /// Another topology policy.
    Topology(TopologyPolicy),
    /// Another placement.
    Placement(Placement),
    /// A larger limit on the rotation of faces.
    MaxNormal,
    /// A lower limit on the quality of faces.
    MinQuality,
    /// A larger limit on the edges at a vertex.
    MaxValence,
    /// A larger limit on the length of edges.
    MaxEdge,
    /// Fewer locked vertices.
    Locked,
    /// Contraction of close pairs of vertices that share no edge, so that parts are joined.
    Pairs(Length),
}

/// Changes with which, together, a stuck run could continue.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Proposal {
    /// One change, or several if no single one is enough.
    pub changes: Vec<Change>,
    /// Edges of the result that could then be collapsed, and parts that could be removed.
    pub gain: usize,
}

impl Change {
    /// Returns the options with this change. A guard is switched off: the user has to choose its best limit.
    /// [`Change::Locked`] changes nothing: locks are data of the mesh.
    pub fn apply(self, options: &SimplifyOptions) -> SimplifyOptions {
        let mut options = options.clone();
        match self {
            Self::Border(border) => options.border = border,
            Self::Topology(topology) => options.topology = topology,
            Self::Placement(placement) => options.placement = placement,
            Self::MaxNormal => options.guards.max_normal_deg = None,
            Self::MinQuality => options.guards.min_quality = None,
            Self::MaxValence => options.guards.max_valence = None,
            Self::MaxEdge => options.guards.max_edge = None,
            // (Locks are data of the mesh.)
            Self::Locked => {}
            Self::Pairs(reach) => options.method = options.method.with_pairs(Some(reach)),
        }
        options
    }

    /// Returns pairs as a change, if the method has them and they are not set already.
    pub(crate) fn pairs_change(options: &SimplifyOptions) -> Option<Self> {
        let has_pairs = matches!(options.method, Method::Memoryless { .. } | Method::Quadric { .. });
        (has_pairs && options.method.pairs().is_none())
            .then_some(Self::Pairs(Length::OfDiagonal(PAIR_DISTANCE)))
    }

    /// Returns the changes that would relax these options: one list for each option, mildest change first.
    pub(crate) fn relaxations(options: &SimplifyOptions, has_locks: bool) -> Vec<Vec<Self>> {
        let guards = &options.guards;
        let mut all: Vec<Vec<Self>> = Vec::new();
        let mut guard = |is_on: bool, change| all.extend(is_on.then(|| vec![change]));
        guard(guards.max_normal_deg.is_some(), Self::MaxNormal);
        guard(guards.min_quality.is_some_and(|q| q > 0.0), Self::MinQuality);
        guard(guards.max_valence.is_some(), Self::MaxValence);
        guard(guards.max_edge.is_some(), Self::MaxEdge);
        guard(has_locks, Self::Locked);
        all.push(match options.border {
            BorderPolicy::Lock => vec![Self::Border(BorderPolicy::Slide), Self::Border(BorderPolicy::Keep)],
            BorderPolicy::Slide => vec![Self::Border(BorderPolicy::Keep)],
            // These two differ only in costs.
            BorderPolicy::Keep | BorderPolicy::Free => Vec::new(),
        });
        all.push(match options.topology {
            TopologyPolicy::Preserve => {
                vec![Self::Topology(TopologyPolicy::Relaxed), Self::Topology(TopologyPolicy::Free)]
            }
            TopologyPolicy::Relaxed => vec![Self::Topology(TopologyPolicy::Free)],
            TopologyPolicy::Free => Vec::new(),
        });
        all.push(match options.placement {
            Placement::Optimal => Vec::new(),
            // Their placement is fixed and does not depend on the options.
            _ if matches!(options.method, Method::Melax | Method::ShortestEdge { .. }) => Vec::new(),
            Placement::Endpoint | Placement::Midpoint => vec![Self::Placement(Placement::Optimal)],
        });
        all.retain(|changes| !changes.is_empty());
        all
    }
}
