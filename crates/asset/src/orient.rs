//! Scaling and rotation of the output.

use lodsmith_core::TriMesh;
use lodsmith_io::Format;

use crate::destination::{Up, Writing};

/// Scales and rotates a mesh by the options; normals are rotated too.
pub fn orient(mesh: &mut TriMesh, writing: &Writing) {
    let scale = writing.scale.unwrap_or(1.0);
    if scale == 1.0 && writing.up.is_none() {
        return;
    }
    let up = writing.up;
    mesh.map_positions(|p| oriented(p, writing));
    if up.is_some() {
        let normals = mesh.normals().map(|n| n.iter().map(|&n| turn(n, up)).collect());
        mesh.set_normals(normals).expect("there are as many as before");
    }
}

/// Returns a position of a mesh after [`orient`].
pub(crate) fn oriented(p: [f64; 3], writing: &Writing) -> [f64; 3] {
    turn(p, writing.up).map(|x| x * writing.scale.unwrap_or(1.0))
}

/// Returns the rows of the map of [`orient`] for a scene that was read from this format, in the coordinates of a 3MF file
/// that it is written to.
pub(crate) fn rows_for_build(read: Format, writing: &Writing) -> [[f64; 3]; 3] {
    // The rotation is about the axes of the file that was read: y is up, but for 3MF.
    let into_read = writing.up.filter(|_| read != Format::ThreeMf).map(|_| Up::Y);
    let axis = |k: usize| oriented(turn([0, 1, 2].map(|i| f64::from(u8::from(i == k))), into_read), writing);
    let columns = [0, 1, 2].map(axis);
    [0, 1, 2].map(|row| columns.map(|column| column[row]))
}

/// Rotates by 90 degrees about x: the handedness is kept, and zero stays positive zero.
fn turn<T: Default + std::ops::Sub<Output = T>>([x, y, z]: [T; 3], up: Option<Up>) -> [T; 3] {
    match up {
        None => [x, y, z],
        // The z axis becomes the y axis.
        Some(Up::Y) => [x, z, T::default() - y],
        Some(Up::Z) => [x, T::default() - z, y],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_rotates_and_the_opposite_rotates_back() {
        assert_eq!(turn([0.0, 0.0, 1.0], Some(Up::Y)), [0.0, 1.0, 0.0]);
        assert_eq!(turn([0.0, 1.0, 0.0], Some(Up::Z)), [0.0, 0.0, 1.0]);
        assert_eq!(turn(turn([1.0, 2.0, 3.0], Some(Up::Y)), Some(Up::Z)), [1.0, 2.0, 3.0]);
    }
}
