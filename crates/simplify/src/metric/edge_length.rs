//! Edge length metric: the shortest edge first.

use glam::{DVec3, Vec3};

use super::{AllowedPlace, EdgeNeighbourhood};

/// Returns the squared length and the displacement. A vertex off the feature edges moves onto one that lies
/// on them, not halfway.
pub(super) fn evaluate(around: &EdgeNeighbourhood) -> (f32, Vec3) {
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
    (d.length_squared() as f32, step.as_vec3())
}
