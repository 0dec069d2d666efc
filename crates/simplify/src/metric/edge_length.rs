//! The shortest edge first.

use glam::{DVec3, Vec3};

use super::{Around, Place};

/// The squared length. A vertex off the feature edges goes onto one that lies on them, not halfway.
pub(super) fn judge(around: &Around) -> (f32, Vec3) {
    let d = around.d;
    let onto_line = match around.on_lines {
        [true, false] => Some(DVec3::ZERO),
        [false, true] => Some(d),
        _ => None,
    };
    let step = match around.place {
        Place::Kept => DVec3::ZERO,
        Place::Removed => d,
        Place::Ends => onto_line.unwrap_or(DVec3::ZERO),
        Place::Middle | Place::Anywhere => onto_line.unwrap_or(d * 0.5),
    };
    (d.length_squared() as f32, step.as_vec3())
}
