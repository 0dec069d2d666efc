//! The place of the largest distance in a scene: its part, and the point where an instance of the part is.

use glam::DVec3;
use lodsmith_core::TriMesh;
use lodsmith_core::geometry::triangle;
use lodsmith_core::measure::FarthestPoint;

use super::layout::Layout;
use super::part::{Part, Place};
use super::touching::moved;
use crate::report::ErrorReport;

/// Converts the farthest point of a run on all parts to the coordinates of its part, and to those of the scene if the
/// places of the part are known; `results` are the parts of the result.
///
/// Cost: O(n) for the n faces of parts whose boxes are near the points; nothing for a single part.
pub(super) fn locate(error: &mut ErrorReport, parts: &[Part<'_>], results: &[TriMesh], layout: &Layout) {
    let Some(farthest) = error.measured.as_mut().and_then(|measured| measured.farthest.as_mut()) else {
        return;
    };
    let inputs: Vec<&TriMesh> = parts.iter().map(|part| part.mesh).collect();
    let results: Vec<&TriMesh> = results.iter().collect();
    let (from, to) = if farthest.is_forward { (inputs, results) } else { (results, inputs) };
    let part = part_at(farthest.point, &from, layout);
    let is_own = |p: &[f64; 3]| layout.groups[part_at(*p, &to, layout)] == layout.groups[part];
    let place = layout.places[part];
    farthest.nearest = farthest.nearest.filter(is_own).map(|p| place.to_part(p));
    farthest.point = place.to_part(farthest.point);
    move_to_scene(farthest, parts[part].places);
    error.farthest_part = Some(part);
}

/// Returns the number of the mesh that is nearest to a point, each at its placement; of equally near ones, the first.
fn part_at(point: [f64; 3], meshes: &[&TriMesh], layout: &Layout) -> usize {
    if meshes.len() == 1 {
        return 0;
    }
    let point = DVec3::from(point);
    let mut best = (f64::INFINITY, 0);
    for (i, (mesh, place)) in meshes.iter().zip(&layout.places).enumerate() {
        let view = mesh.positions().view();
        let Some(bounds) = view.bounds() else { continue };
        let corner = |k: usize| [0, 1, 2].map(|axis| [bounds.min, bounds.max][k >> axis & 1][axis]);
        let corners = || (0..8).map(|k| DVec3::from(place.to_scene(corner(k))));
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        if point.distance_squared(point.clamp(low, high)) >= best.0 {
            continue;
        }
        for t in mesh.surface().triangles() {
            let corners = t.map(|v| DVec3::from(place.to_scene(view.get(v))));
            let distance_sq = triangle::nearest(point, corners).distance_sq;
            if distance_sq < best.0 {
                best = (distance_sq, i);
            }
        }
    }
    best.1
}

/// Converts a farthest point from the coordinates of its part to those of the scene, at the instance where the distance
/// is largest; of equally large ones, the first. Without places it stays.
pub(super) fn move_to_scene(farthest: &mut FarthestPoint, places: &[Place]) {
    let (point, nearest) = (farthest.point, farthest.nearest);
    let image = |place: &Place| (moved(place, point), nearest.map(|p| moved(place, p)));
    let length_sq =
        |(a, b): &([f64; 3], Option<[f64; 3]>)| b.map_or(0.0, |b| DVec3::from(*a).distance_squared(b.into()));
    let farther = |a, b| if length_sq(&b) > length_sq(&a) { b } else { a };
    if let Some(image) = places.iter().map(image).reduce(farther) {
        (farthest.point, farthest.nearest) = image;
    }
}
