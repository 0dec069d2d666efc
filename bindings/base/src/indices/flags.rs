//! Flags of index calls, with the values of meshoptimizer.

/// Vertices on open borders are not moved or removed.
pub const LOCK_BORDER: u32 = 1;
/// Errors are relative to the extent of the used vertices, and the time does not depend on unused vertices.
pub const SPARSE: u32 = 2;
/// The error limit and the returned error are in the units of the positions.
pub const ERROR_ABSOLUTE: u32 = 4;
/// Whole parts are removed, and necks cut, where that is cheapest.
pub const PRUNE: u32 = 8;
/// Faces are more regular, at the cost of some accuracy.
pub const REGULARIZE: u32 = 16;
/// Vertices at the same position with different attributes may be merged, unless they are protected.
pub const PERMISSIVE: u32 = 32;
/// Faces are slightly more regular, at a small cost of accuracy.
pub const REGULARIZE_LIGHT: u32 = 64;
/// Accepted without effect: folds are always preserved.
pub const PRESERVE_FOLDS: u32 = 128;
/// Accepted without effect.
pub const ERROR_CLAMPED: u32 = 256;

/// The vertex keeps its position and its attributes.
pub const VERTEX_LOCK: u8 = 1;
/// The discontinuity of attributes at the vertex is kept even with [`PERMISSIVE`].
pub const VERTEX_PROTECT: u8 = 2;
/// The vertex is more likely to be kept.
pub const VERTEX_PRIORITY: u8 = 4;

/// All flags of calls.
pub(crate) const ALL: u32 = 511;
