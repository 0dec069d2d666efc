//! Writer of STL files.

use std::io::{self, Write};

use lodsmith_core::TriMesh;

use crate::attributes::rounding_warning;
use crate::error::Warning;

/// Approximate size in bytes of the chunks written to the stream.
const PIECE: usize = 1 << 16;

pub(super) fn write(mesh: &TriMesh, ascii: bool, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let surface = mesh.surface();
    let positions = surface.positions();
    let mut piece: Vec<u8> = Vec::with_capacity(PIECE + 512);
    if ascii {
        piece.extend_from_slice(b"solid lodsmith\n");
    } else {
        // A header that begins with `solid` could be mistaken for text.
        piece.extend_from_slice(b"binary STL, written by lodsmith");
        piece.resize(80, b' ');
        // A mesh has fewer than 2^32 corners.
        piece.extend_from_slice(&(mesh.face_count() as u32).to_le_bytes());
    }
    for t in surface.triangles() {
        let corners = t.map(|v| positions.get(v));
        let normal = normal(corners);
        let corners = corners.map(|p| p.map(|x| x as f32));
        if ascii {
            text(&mut piece, normal, corners)?;
        } else {
            normal
                .iter()
                .chain(corners.as_flattened())
                .for_each(|x| piece.extend_from_slice(&x.to_le_bytes()));
            piece.extend_from_slice(&[0, 0]);
        }
        if piece.len() >= PIECE {
            out.write_all(&piece)?;
            piece.clear();
        }
    }
    if ascii {
        piece.extend_from_slice(b"endsolid lodsmith\n");
    }
    out.write_all(&piece)?;
    Ok(warnings(mesh))
}

/// Returns the warnings about lost data.
fn warnings(mesh: &TriMesh) -> Vec<Warning> {
    let mut names = Vec::new();
    if mesh.normals().is_some() {
        names.push("normals of vertices");
    }
    if mesh.uvs().is_some() {
        names.push("texture coordinates");
    }
    if mesh.colors().is_some() {
        names.push("colours");
    }
    let mut warnings: Vec<Warning> =
        names.iter().map(|name| Warning::lost(format!("STL cannot carry {name}: dropped"))).collect();
    warnings.extend(rounding_warning(mesh, "STL", None));
    warnings
}

/// Returns the unit normal of a facet; zero if it has no area or a corner is not finite.
fn normal([a, b, c]: [[f64; 3]; 3]) -> [f32; 3] {
    let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
    // Scaled first to avoid underflow and overflow, for facets from 1e-200 to 1e200.
    let scale = |d: [f64; 3]| {
        let largest = d.iter().fold(0f64, |m, x| m.max(x.abs()));
        if largest > 0.0 { d.map(|x| x / largest) } else { d }
    };
    let (u, v) = (scale(u), scale(v));
    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
    let n = n.map(|x| (x / length) as f32);
    if n.iter().all(|x| x.is_finite()) { n } else { [0.0; 3] }
}

fn text(to: &mut Vec<u8>, normal: [f32; 3], corners: [[f32; 3]; 3]) -> io::Result<()> {
    let [x, y, z] = normal;
    writeln!(to, "facet normal {x} {y} {z}\n outer loop")?;
    for [x, y, z] in corners {
        writeln!(to, "  vertex {x:e} {y:e} {z:e}")?;
    }
    writeln!(to, " endloop\nendfacet")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_at_every_scale_and_none_without_area() {
        for s in [1e-200, 1.0, 1e200] {
            assert_eq!(normal([[0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0]]), [0.0, 0.0, 1.0], "{s}");
        }
        assert_eq!(normal([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), [0.0; 3]);
        assert_eq!(normal([[0.0; 3], [f64::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]]), [0.0; 3]);
    }
}
