//! Writer of OFF files.

use std::io::{self, Write};

use lodsmith_core::{Positions, TriMesh, WedgeId};

use crate::error::Warning;
use crate::numbers::TextOut;
use crate::options::WriteOptions;

/// Writes a mesh as OFF, with the prefixes that its attributes need; returns warnings about what the format
/// cannot carry.
///
/// Vertices of OFF have one set of attributes each: a vertex on a seam is written once per wedge, at the same
/// position, and a warning counts these. Every number is the shortest decimal that reads back the same.
/// Colours are integers up to 255 if that is exact.
///
/// # Errors
/// The errors of the stream.
pub fn write(mesh: &TriMesh, _options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let mut warnings = Vec::new();
    let is_split = mesh.vertex_map().is_some() && mesh.has_attributes();
    let count = if is_split { mesh.wedge_count() } else { mesh.vertex_count() };
    if is_split && mesh.wedge_count() > mesh.vertex_count() {
        let more = mesh.wedge_count() - mesh.vertex_count();
        let text =
            format!("OFF has one set of attributes per vertex: {more} vertices on seams are duplicated");
        warnings.push(Warning::note(text));
    }
    let mut out = TextOut::new(out);
    for (prefix, is_there) in
        [("ST", mesh.uvs().is_some()), ("C", mesh.colors().is_some()), ("N", mesh.normals().is_some())]
    {
        if is_there {
            out.text(prefix);
        }
    }
    out.text("OFF\n");
    out.parse_integer(count);
    out.byte(b' ');
    out.parse_integer(mesh.face_count());
    out.text(" 0\n");
    let counts_to_255 = mesh.colors().is_some_and(fits_byte_colors);
    for i in 0..count {
        let vertex = if is_split { mesh.vertex_of(WedgeId::new(i)).index() } else { i };
        match mesh.positions() {
            Positions::F32(p) => words(&mut out, p[vertex]),
            Positions::F64(p) => words(&mut out, p[vertex]),
        }
        if let Some(normals) = mesh.normals() {
            out.decimals(normals[i]);
        }
        if let Some(colors) = mesh.colors() {
            if counts_to_255 {
                out.decimals(colors[i].map(|c| (c * 255.0).round()));
            } else {
                out.decimals(colors[i]);
            }
        }
        if let Some(uvs) = mesh.uvs() {
            out.decimals(uvs[i]);
        }
        out.end_line()?;
    }
    for triangle in mesh.triangles() {
        out.byte(b'3');
        for &wedge in triangle {
            out.byte(b' ');
            out.parse_integer(if is_split { wedge.0 } else { mesh.vertex_of(wedge).0 });
        }
        out.end_line()?;
    }
    out.finish()?;
    Ok(warnings)
}

fn words<const N: usize>(out: &mut TextOut<'_>, numbers: [impl zmij::Float; N]) {
    for (k, number) in numbers.into_iter().enumerate() {
        if k > 0 {
            out.byte(b' ');
        }
        out.parse_decimal(number);
    }
}

/// Returns true if all colours are integer multiples of 1/255, and at least one is above 1/255: readers
/// detect the range 0..255 by a value above 1.
fn fits_byte_colors(colors: &[[f32; 4]]) -> bool {
    let is_whole = |c: f32| (0.0..=1.0).contains(&c) && (c * 255.0).round() / 255.0 == c;
    colors.iter().flatten().all(|&c| is_whole(c)) && colors.iter().flatten().any(|&c| c * 255.0 > 1.5)
}
