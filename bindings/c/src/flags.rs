//! Flags of index calls, with the values of meshoptimizer.

/// Vertices on open borders are not moved or removed.
pub const LODSMITH_SIMPLIFY_LOCK_BORDER: u32 = 1;
/// Errors are relative to the extent of the used vertices, and the time does not depend on unused vertices.
pub const LODSMITH_SIMPLIFY_SPARSE: u32 = 2;
/// The error limit and the returned error are in the units of the positions.
pub const LODSMITH_SIMPLIFY_ERROR_ABSOLUTE: u32 = 4;
/// Whole parts are removed, and necks cut, where that is cheapest.
pub const LODSMITH_SIMPLIFY_PRUNE: u32 = 8;
/// Faces are more regular, at the cost of some accuracy.
pub const LODSMITH_SIMPLIFY_REGULARIZE: u32 = 16;
/// Vertices at the same position with different attributes may be merged, unless they are protected.
pub const LODSMITH_SIMPLIFY_PERMISSIVE: u32 = 32;
/// Faces are slightly more regular, at a small cost of accuracy.
pub const LODSMITH_SIMPLIFY_REGULARIZE_LIGHT: u32 = 64;
/// Accepted without effect: folds are always preserved.
pub const LODSMITH_SIMPLIFY_PRESERVE_FOLDS: u32 = 128;
/// Accepted without effect.
pub const LODSMITH_SIMPLIFY_ERROR_CLAMPED: u32 = 256;

/// The vertex keeps its position and its attributes.
pub const LODSMITH_VERTEX_LOCK: u8 = 1;
/// The discontinuity of attributes at the vertex is kept even with `LODSMITH_SIMPLIFY_PERMISSIVE`.
pub const LODSMITH_VERTEX_PROTECT: u8 = 2;
/// The vertex is more likely to be kept.
pub const LODSMITH_VERTEX_PRIORITY: u8 = 4;

/// Checks that the values agree with the flags of the shared functions.
const _: () = {
    use lodsmith_bindings::indices::flags;
    let here = [
        LODSMITH_SIMPLIFY_LOCK_BORDER,
        LODSMITH_SIMPLIFY_SPARSE,
        LODSMITH_SIMPLIFY_ERROR_ABSOLUTE,
        LODSMITH_SIMPLIFY_PRUNE,
        LODSMITH_SIMPLIFY_REGULARIZE,
        LODSMITH_SIMPLIFY_PERMISSIVE,
        LODSMITH_SIMPLIFY_REGULARIZE_LIGHT,
        LODSMITH_SIMPLIFY_PRESERVE_FOLDS,
        LODSMITH_SIMPLIFY_ERROR_CLAMPED,
        LODSMITH_VERTEX_LOCK as u32,
        LODSMITH_VERTEX_PROTECT as u32,
        LODSMITH_VERTEX_PRIORITY as u32,
    ];
    let there = [
        flags::LOCK_BORDER,
        flags::SPARSE,
        flags::ERROR_ABSOLUTE,
        flags::PRUNE,
        flags::REGULARIZE,
        flags::PERMISSIVE,
        flags::REGULARIZE_LIGHT,
        flags::PRESERVE_FOLDS,
        flags::ERROR_CLAMPED,
        flags::VERTEX_LOCK as u32,
        flags::VERTEX_PROTECT as u32,
        flags::VERTEX_PRIORITY as u32,
    ];
    let mut i = 0;
    while i < here.len() {
        assert!(here[i] == there[i]);
        i += 1;
    }
};
