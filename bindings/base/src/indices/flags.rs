//! Flags of the calls that have the arguments of meshoptimizer's, with its values.

/// Vertices on open borders are not moved or removed.
pub const LOCK_BORDER: u32 = 1;
/// Errors are relative to the extent of the vertices that the indices use, and the time does not depend on the others.
pub const SPARSE: u32 = 2;
/// The limit of the error and the returned error are in the units of the positions.
pub const ERROR_ABSOLUTE: u32 = 4;
/// Whole parts are removed, and thin places cut, where that is cheapest.
pub const PRUNE: u32 = 8;
/// Faces are more regular, at some cost.
pub const REGULARIZE: u32 = 16;
/// Vertices at one position with different attributes may be merged, unless they are protected.
pub const PERMISSIVE: u32 = 32;
/// Faces are a little more regular, at a small cost.
pub const REGULARIZE_LIGHT: u32 = 64;
/// Accepted, without effect: folds are always preserved.
pub const PRESERVE_FOLDS: u32 = 128;
/// Accepted, without effect.
pub const ERROR_CLAMPED: u32 = 256;

/// The vertex keeps its position and its attributes.
pub const VERTEX_LOCK: u8 = 1;
/// The discontinuity of attributes at the vertex is kept, with [`PERMISSIVE`].
pub const VERTEX_PROTECT: u8 = 2;
/// The vertex is more likely to be kept.
pub const VERTEX_PRIORITY: u8 = 4;

/// All flags of calls that there are.
pub(crate) const ALL: u32 = 511;
