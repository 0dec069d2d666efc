//! Edge length metric: the shortest edge first.

use glam::{DVec3, Vec3};

use super::{AllowedPlace, CostSource, Dimension, EdgeNeighbourhood, NeighbourhoodMetric};

pub(crate) const EDGE_LENGTH: NeighbourhoodMetric = NeighbourhoodMetric {
    cost_source: CostSource::Ends,
    evaluate,
    // Squared lengths fall as the density of triangles rises.
    cost_factor_exponent: 0.4,
    // (0.7 to 3.4, larger at fewer faces.)
    squared_rms_factor: 1.6,
    dimension: Dimension { length: 2, face: 0 },
    // Like edges as long as the part itself.
    part_cost_per_face_pair: |_, part, _| part.cost_factor * part.size_sq,
};

/// Returns the squared length and the displacement. If only one end lies on feature edges, the other moves
/// onto it, not halfway.
fn evaluate(around: &EdgeNeighbourhood, _: f32) -> Option<(f32, Vec3)> {
    let d = around.d;
    let onto_line = match around.on_lines {
        [true, false] => Some(DVec3::ZERO),
        [false, true] => Some(d),
        _ => None,
    };
    let step = match around.place {
        AllowedPlace::Kept => DVec3::ZERO,
        AllowedPlace::Removed => d,
        AllowedPlace::Ends => onto_line.unwrap_or(DVec3::ZERO),
        AllowedPlace::Middle | AllowedPlace::Anywhere => onto_line.unwrap_or(d * 0.5),
    };
    Some((d.length_squared() as f32, step.as_vec3()))
}
