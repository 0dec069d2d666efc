//! Normals of meshes without normals.

use glam::{DVec3, Vec3};
use lodsmith_core::Surface;
use lodsmith_core::geometry::triangle::double_area_normal;

/// Cosine of the angle between two faces above which their edge is sharp: 40°. (Guessed: machine parts keep
/// their edges, and scans are smooth.)
const CREASE_COS: f64 = 0.766;

/// Computes normals at the corners of each face of a surface without normals: the mean of the normals of the
/// faces around the vertex that differ by less than 40° from this face, weighted by area.
///
/// Cost: O(faces · faces at a vertex); at a vertex with more than 64 faces they are not compared, and its normal is
/// their mean.
pub(crate) fn creased_normals(surface: &Surface<'_>) -> Vec<[Vec3; 3]> {
    let view = surface.positions();
    let triangles = surface.triangles();
    let doubled: Vec<DVec3> =
        triangles.iter().map(|t| double_area_normal(t.map(|v| DVec3::from(view.get(v))))).collect();
    // The faces at each vertex, one after the other.
    let mut start = vec![0u32; view.len() + 1];
    triangles.iter().flatten().for_each(|v| start[v.index() + 1] += 1);
    for v in 1..start.len() {
        start[v] += start[v - 1];
    }
    let mut next = start.clone();
    let mut faces = vec![0u32; triangles.len() * 3];
    for (f, t) in triangles.iter().enumerate() {
        for v in t {
            faces[next[v.index()] as usize] = f as u32;
            next[v.index()] += 1;
        }
    }
    let mut hubs: Vec<Option<DVec3>> = vec![None; view.len()];
    let of_corner = |f: usize, v: usize, hubs: &mut Vec<Option<DVec3>>| {
        let around = &faces[start[v] as usize..start[v + 1] as usize];
        if around.len() > MAX_COMPARED {
            let mean = || around.iter().map(|&g| doubled[g as usize]).sum::<DVec3>();
            return hubs[v].get_or_insert_with(mean).normalize_or_zero();
        }
        let own = doubled[f].normalize_or_zero();
        let is_smooth = |g: &&u32| {
            let other = doubled[**g as usize];
            own == DVec3::ZERO || own.dot(other) >= CREASE_COS * other.length()
        };
        around.iter().filter(is_smooth).map(|&g| doubled[g as usize]).sum::<DVec3>().normalize_or_zero()
    };
    let mut normals = Vec::with_capacity(triangles.len());
    for (f, t) in triangles.iter().enumerate() {
        normals.push(t.map(|v| of_corner(f, v.index(), &mut hubs).as_vec3()));
    }
    normals
}

/// Largest number of faces at a vertex that are compared with each other.
const MAX_COMPARED: usize = 64;

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn a_cube_has_sharp_edges_and_a_sphere_has_none() {
        let cube = shapes::cube(2);
        for (f, normals) in creased_normals(&cube.surface()).iter().enumerate() {
            let corners = cube.surface().triangles()[f].map(|v| DVec3::from(cube.positions().view().get(v)));
            let flat = double_area_normal(corners).normalize_or_zero().as_vec3();
            assert!(normals.iter().all(|n| n.dot(flat) > 0.9999), "{normals:?}");
        }
        let ball = shapes::icosphere(4);
        for (f, normals) in creased_normals(&ball.surface()).iter().enumerate() {
            for (n, v) in normals.iter().zip(ball.surface().triangles()[f]) {
                let p = DVec3::from(ball.positions().view().get(v)).normalize_or_zero().as_vec3();
                assert!(n.dot(p) > 0.999);
            }
        }
    }
}
