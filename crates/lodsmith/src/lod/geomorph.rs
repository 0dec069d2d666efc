//! Geomorphs: positions of the vertices of a level on the next coarser one.

use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{Positions, TriMesh};

/// Returns for each vertex of `own` the position of the vertex that it was merged into, or else the nearest
/// point of `coarser`. If `coarser` has no face, or the position is NaN or infinite, the vertex keeps its
/// position.
pub(super) fn geomorph(
    own: &TriMesh,
    coarser: &TriMesh,
    merged: impl Fn(usize) -> Option<[f64; 3]>,
) -> Positions {
    let mut tree = None;
    let mut hint = Hint::default();
    let view = own.positions().view();
    let places = view.iter().enumerate().map(|(v, p)| {
        merged(v).unwrap_or_else(|| {
            let tree = tree.get_or_insert_with(|| Bvh::new(&coarser.surface()));
            tree.closest_from(p, &mut hint).map_or(p, |hit| hit.point)
        })
    });
    match own.positions() {
        Positions::F32(_) => Positions::F32(places.map(|p| p.map(|x| x as f32)).collect()),
        Positions::F64(_) => Positions::F64(places.collect()),
    }
}
