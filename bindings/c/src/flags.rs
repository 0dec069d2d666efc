//! Flags of the calls that have the arguments of meshoptimizer's, with its values.

/// Vertices on open borders are not moved or removed.
pub const LODSMITH_SIMPLIFY_LOCK_BORDER: u32 = 1;
/// Errors are relative to the extent of the vertices that the indices use, and the time does not depend on the others.
pub const LODSMITH_SIMPLIFY_SPARSE: u32 = 2;
/// The limit of the error and the returned error are in the units of the positions.
pub const LODSMITH_SIMPLIFY_ERROR_ABSOLUTE: u32 = 4;
/// Whole parts are removed, and thin places cut, where that is cheapest.
pub const LODSMITH_SIMPLIFY_PRUNE: u32 = 8;
/// Faces are more regular, at some cost.
pub const LODSMITH_SIMPLIFY_REGULARIZE: u32 = 16;
/// Vertices at one position with different attributes may be merged, unless they are protected.
pub const LODSMITH_SIMPLIFY_PERMISSIVE: u32 = 32;
/// Faces are a little more regular, at a small cost.
pub const LODSMITH_SIMPLIFY_REGULARIZE_LIGHT: u32 = 64;
/// Accepted, without effect: folds are always preserved.
pub const LODSMITH_SIMPLIFY_PRESERVE_FOLDS: u32 = 128;
/// Accepted, without effect.
pub const LODSMITH_SIMPLIFY_ERROR_CLAMPED: u32 = 256;

/// The vertex keeps its position and its attributes.
pub const LODSMITH_VERTEX_LOCK: u8 = 1;
/// The discontinuity of attributes at the vertex is kept, with `LODSMITH_SIMPLIFY_PERMISSIVE`.
pub const LODSMITH_VERTEX_PROTECT: u8 = 2;
/// The vertex is more likely to be kept.
pub const LODSMITH_VERTEX_PRIORITY: u8 = 4;
