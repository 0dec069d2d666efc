//! Differences of one attribute at the wedges of a mesh, for heat maps.

use glam::DVec3;

use super::{MeasuredMesh, SEAM_TOLERANCE, distance};
use crate::geometry::triangle::double_area_normal;
use crate::measure::{MeasureError, chunks};
use crate::mesh::TriMesh;
use crate::spatial::Hint;

/// An attribute to be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparedAttribute {
    /// Normals: angles in degrees.
    Normals,
    /// Texture coordinates: distances; 1 is the width or height of the image.
    Uvs,
    /// Colours: distances; 1 is the range of a channel.
    Colors,
}

/// Distance of the compared point from its corner, as a share of the way to the centre of the face. On the
/// corner itself, faces around a sharp edge or a seam are equally near, and the wrong one could be taken.
/// (Guessed.)
const INSET: f64 = 0.05;
/// Number of wedges between two calls for progress. (About 20 ms.)
const PROGRESS_WEDGES: usize = 1 << 14;

/// Returns for each wedge of `mesh` how much an attribute differs from the attribute of `other` at the
/// nearest point; `None` if `go_on` returns false. `go_on` receives the progress, from 0 to 1.
///
/// A wedge is compared a twentieth of the way from its corner to the centre of a face that uses it, with the
/// rules of [`compare_attributes`](super::compare_attributes) for seams and sheets. Wedges that no face uses,
/// and points without a counterpart or without a valid normal, are NaN. All are NaN if one of the meshes lacks
/// the attribute. Deterministic at any number of threads. Cost: O(n log n) for n faces of both.
///
/// # Errors
/// [`MeasureError::Empty`] if either mesh has no face with finite corners.
pub fn wedge_differences(
    mesh: &TriMesh,
    other: &TriMesh,
    attribute: ComparedAttribute,
    go_on: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Vec<f32>>, MeasureError> {
    let from = MeasuredMesh::new(mesh, &[]).ok_or(MeasureError::Empty { which: "reference" })?;
    if !go_on(0.1) {
        return Ok(None);
    }
    let to = MeasuredMesh::new(other, &[]).ok_or(MeasureError::Empty { which: "candidate" })?;
    let diagonal = from.tree.bounds().into_iter().chain(to.tree.bounds()).map(|b| b.diagonal());
    let tolerance = SEAM_TOLERANCE * diagonal.fold(0.0, f64::max);
    let mut places: Vec<Option<(u32, u8)>> = vec![None; mesh.wedge_count()];
    for (face, wedges) in (0u32..).zip(mesh.triangles()) {
        for (corner, w) in (0u8..).zip(wedges) {
            places[w.index()].get_or_insert((face, corner));
        }
    }
    let mut all = Vec::with_capacity(places.len());
    while all.len() < places.len() {
        if !go_on(0.2 + 0.8 * all.len() as f64 / places.len() as f64) {
            return Ok(None);
        }
        let first = all.len();
        let count = PROGRESS_WEDGES.min(places.len() - first);
        let parts = chunks::map(count, |range| {
            let mut hint = Hint::default();
            let of = |i| from.difference_at(places[first + i], &to, attribute, tolerance, &mut hint);
            range.map(of).map(|d| d.map_or(f32::NAN, |d| d as f32)).collect::<Vec<_>>()
        });
        parts.into_iter().for_each(|part| all.extend(part));
    }
    Ok(Some(all))
}

impl MeasuredMesh<'_> {
    /// Returns the difference near a corner of a face.
    fn difference_at(
        &self,
        place: Option<(u32, u8)>,
        to: &MeasuredMesh<'_>,
        attribute: ComparedAttribute,
        tolerance: f64,
        hint: &mut Hint,
    ) -> Option<f64> {
        let (face, corner) = place?;
        let corners = self.corners(face as usize);
        if !corners.iter().all(|c| c.is_finite()) {
            return None;
        }
        let mut weights = [INSET / 3.0; 3];
        weights[usize::from(corner)] += 1.0 - INSET;
        let point: DVec3 = corners.iter().zip(weights).map(|(c, w)| *c * w).sum();
        let here = self.values(face as usize, weights);
        let there = to.counterpart(point, double_area_normal(corners), &here, tolerance, hint)?;
        match attribute {
            ComparedAttribute::Normals => {
                let (a, b) = (here.normal?, there.normal?);
                let is_valid = a != DVec3::ZERO && b != DVec3::ZERO;
                is_valid.then(|| libm::atan2(a.cross(b).length(), a.dot(b)).to_degrees())
            }
            ComparedAttribute::Uvs => Some(distance(&here.uv?, &there.uv?)),
            ComparedAttribute::Colors => Some(distance(&here.color?, &there.color?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::normals::vertex_normals;
    use crate::shapes;

    fn differences(a: &TriMesh, b: &TriMesh, attribute: ComparedAttribute) -> Vec<f32> {
        wedge_differences(a, b, attribute, &mut |_| true).unwrap().unwrap()
    }

    #[test]
    fn the_difference_of_each_attribute_is_its_change() {
        let mut a = shapes::grid(8);
        let uvs: Vec<[f32; 2]> = a.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
        let count = uvs.len();
        a.set_uvs(Some(uvs.clone())).unwrap();
        a.set_normals(Some(vec![[0.0, 0.0, 1.0]; count])).unwrap();
        a.set_colors(Some(vec![[0.5, 0.5, 0.5, 1.0]; count])).unwrap();
        let mut b = a.clone();
        b.set_uvs(Some(uvs.iter().map(|t| [t[0] + 0.003, t[1] - 0.004]).collect())).unwrap();
        let (sin, cos) = 12f32.to_radians().sin_cos();
        b.set_normals(Some(vec![[sin, 0.0, cos]; count])).unwrap();
        b.set_colors(Some(vec![[0.5, 0.75, 0.5, 1.0]; count])).unwrap();
        for (attribute, wanted) in [
            (ComparedAttribute::Normals, 12.0),
            (ComparedAttribute::Uvs, 0.005),
            (ComparedAttribute::Colors, 0.25),
        ] {
            for (one, two) in [(&a, &b), (&b, &a)] {
                let all = differences(one, two, attribute);
                assert_eq!(all.len(), count);
                assert!(all.iter().all(|d| (d - wanted).abs() < 1e-4), "{attribute:?}: {all:?}");
            }
            assert!(differences(&a, &a, attribute).iter().all(|d| *d < 1e-4));
        }
    }

    /// On the edges of a cube with its own normals on each side, the wrong side would be off by 90°.
    #[test]
    fn sharp_edges_are_compared_with_their_own_side() {
        let hard = |n: u32| {
            let cube = shapes::cube(n);
            let corners: Vec<_> = cube.surface().triangles().iter().flatten().copied().collect();
            let all: Vec<[f64; 3]> = corners.iter().map(|v| cube.positions().view().get(*v)).collect();
            let faces = (0..all.len() / 3).map(|i| [0, 1, 2].map(|k| crate::VertexId::new(3 * i + k)));
            let mut soup = TriMesh::new(crate::Positions::F64(all), faces.collect()).unwrap();
            let normals = vertex_normals(&soup.surface(), |v| v);
            soup.set_normals(Some(normals)).unwrap();
            soup
        };
        let (fine, coarse) = (hard(6), hard(1));
        for (one, two) in [(&fine, &coarse), (&coarse, &fine)] {
            let all = differences(one, two, ComparedAttribute::Normals);
            assert!(all.iter().all(|d| *d < 0.1), "{all:?}");
        }
    }

    #[test]
    fn missing_attributes_are_nan_and_a_run_can_be_stopped() {
        let mesh = shapes::grid(4);
        assert!(differences(&mesh, &mesh, ComparedAttribute::Uvs).iter().all(|d| d.is_nan()));
        assert_eq!(wedge_differences(&mesh, &mesh, ComparedAttribute::Uvs, &mut |_| false), Ok(None));
        let none = TriMesh::new(mesh.positions().clone(), Vec::new()).unwrap();
        assert!(wedge_differences(&mesh, &none, ComparedAttribute::Uvs, &mut |_| true).is_err());
    }
}
