//! Limits set by the options, as numbers ready for the inner loop.

use lodsmith_core::geometry::UnitFrame;

use crate::options::{BlockSizes, BorderPolicy, Method, Placement, SimplifyOptions, TopologyPolicy};

/// Weight of a border edge's line. (docs/decisions/0001; 10 as in meshoptimizer.)
pub(crate) const BORDER_WEIGHT: f32 = 10.0;
/// Squared cosine of the largest rotation of a face in one collapse: 78 degrees. (Prototype; larger rotations
/// fold.)
const MAX_TURN: f32 = 0.04;

/// Limits on a collapse, in the unit frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub(crate) placement: Placement,
    pub(crate) border: BorderPolicy,
    pub(crate) topology: TopologyPolicy,
    /// Weight of a border edge's line relative to the planes of faces.
    pub(crate) border_weight: f32,
    /// Squared cosine of the largest rotation of a face.
    pub(crate) max_turn: f32,
    /// Square of the least quality of a new face.
    pub(crate) min_shape: f32,
    pub(crate) max_valence: usize,
    pub(crate) max_edge_sq: f32,
    /// True in a quick pass: there is no late phase with samples, and all seams are hard.
    pub(crate) is_quick: bool,
    /// Weight of the squared step of a vertex in a quick pass, over the area of its star.
    pub(crate) move_weight: f32,
    /// Estimate of the RMS distance at which a quick pass ends.
    pub(crate) max_estimate: f64,
    /// The largest cost of a collapse, which is a squared length if it is limited.
    pub(crate) max_cost: f32,
    pub(crate) blocks: BlockSizes,
}

impl Rules {
    pub(crate) fn new(options: &SimplifyOptions, frame: UnitFrame, diagonal: f64) -> Self {
        let guards = &options.guards;
        let cos = guards.max_normal_deg.map_or(0.0, |deg| libm::cos(deg.min(90.0).to_radians()) as f32);
        let max_edge = guards.max_edge.map_or(f64::INFINITY, |l| frame.unit_length(l.in_units(diagonal)));
        let longest = match options.method {
            Method::ShortestEdge { edge_length } => edge_length,
            _ => None,
        };
        let max_cost = longest.map_or(f64::INFINITY, |l| frame.unit_length(l.in_units(diagonal)));
        let max_estimate = options.quick.as_ref().and_then(|quick| quick.max_estimate);
        let max_estimate = max_estimate.map_or(f64::INFINITY, |l| frame.unit_length(l.in_units(diagonal)));
        Self {
            placement: options.placement,
            border: options.border,
            topology: options.topology,
            border_weight: match (options.border, options.sharp_deg) {
                // Line tensors are only needed for sharp edges.
                (BorderPolicy::Free, Some(_)) => 0.0,
                _ => BORDER_WEIGHT * options.weights.border as f32,
            },
            max_turn: MAX_TURN.max(cos * cos),
            min_shape: guards.min_quality.map_or(0.0, |q| (q * q) as f32),
            max_valence: guards.max_valence.unwrap_or(usize::MAX),
            max_edge_sq: (max_edge * max_edge) as f32,
            is_quick: options.quick.is_some(),
            move_weight: options.quick.as_ref().map_or(0.0, |quick| quick.move_weight),
            max_estimate,
            max_cost: (max_cost * max_cost) as f32,
            blocks: options.blocks,
        }
    }

    /// Returns true if a guard is set that moving a vertex can break.
    pub(crate) fn guards_moves(&self) -> bool {
        self.min_shape > 0.0 || self.max_edge_sq.is_finite() || self.guards_turns()
    }
    /// Returns true if the rotation of faces is limited more than by default.
    pub(crate) fn guards_turns(&self) -> bool {
        self.max_turn > MAX_TURN
    }
    /// Returns true if any guard besides the default ones has to be checked.
    pub(crate) fn has_extra_guards(&self) -> bool {
        self.min_shape > 0.0 || self.max_valence != usize::MAX || self.max_edge_sq.is_finite()
    }
}
