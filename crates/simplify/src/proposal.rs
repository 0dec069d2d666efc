//! What would let a run go on that is stuck above its target.

use crate::options::{BorderPolicy, Length, Method, Placement, SimplifyOptions, TopologyPolicy};

/// How near parts have to be that pairs are tried on, a share of the diagonal: half a percent.
const PAIRS: f64 = 0.005;

/// An option, and what it would have to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Another policy for borders.
    Border(BorderPolicy),
    /// Another policy for topology.
    Topology(TopologyPolicy),
    /// Another placement.
    Placement(Placement),
    /// A larger turn of a face.
    MaxNormal,
    /// A lower quality.
    MinQuality,
    /// More edges at a vertex.
    MaxValence,
    /// Longer edges.
    MaxEdge,
    /// Fewer locked vertices.
    Locked,
    /// Pairs of near vertices that share no edge, so that parts grow together.
    Pairs(Length),
}

/// Changes that together let a stuck run go on.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Proposal {
    /// One, or several where each alone would not do.
    pub changes: Vec<Change>,
    /// Edges of the result that could be collapsed then, and parts that could go.
    pub gain: usize,
}

impl Change {
    /// The options with this change. A guard is off then: where it lies best is for its owner to say.
    pub fn applied(self, options: &SimplifyOptions) -> SimplifyOptions {
        let mut options = options.clone();
        match self {
            Self::Border(border) => options.border = border,
            Self::Topology(topology) => options.topology = topology,
            Self::Placement(placement) => options.placement = placement,
            Self::MaxNormal => options.guards.max_normal_deg = None,
            Self::MinQuality => options.guards.min_quality = None,
            Self::MaxValence => options.guards.max_valence = None,
            Self::MaxEdge => options.guards.max_edge = None,
            Self::Locked => options.locked = None,
            Self::Pairs(reach) => options.of_method.pairs = Some(reach),
        }
        options
    }

    /// Pairs, where the method knows them and they are not contracted already.
    pub(crate) fn to_pairs(options: &SimplifyOptions) -> Option<Self> {
        let knows = matches!(options.method, Method::Memoryless | Method::Quadric);
        (knows && options.of_method.pairs.is_none()).then_some(Self::Pairs(Length::OfDiagonal(PAIRS)))
    }

    /// What is stricter in these options than need be: for each option the changes in their order, the gentlest first.
    pub(crate) fn open_to(options: &SimplifyOptions) -> Vec<Vec<Self>> {
        let guards = &options.guards;
        let mut all: Vec<Vec<Self>> = Vec::new();
        let mut guard = |is_on: bool, change| all.extend(is_on.then(|| vec![change]));
        guard(guards.max_normal_deg.is_some(), Self::MaxNormal);
        guard(guards.min_quality.is_some_and(|q| q > 0.0), Self::MinQuality);
        guard(guards.max_valence.is_some(), Self::MaxValence);
        guard(guards.max_edge.is_some(), Self::MaxEdge);
        guard(options.locked.is_some(), Self::Locked);
        all.push(match options.border {
            BorderPolicy::Lock => vec![Self::Border(BorderPolicy::Slide), Self::Border(BorderPolicy::Keep)],
            BorderPolicy::Slide => vec![Self::Border(BorderPolicy::Keep)],
            // These two differ in costs alone.
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
            // Theirs whatever the options say.
            _ if matches!(options.method, Method::Melax | Method::ShortestEdge) => Vec::new(),
            Placement::Endpoint | Placement::Midpoint => vec![Self::Placement(Placement::Optimal)],
        });
        all.retain(|changes| !changes.is_empty());
        all
    }
}
