//! From a mesh to the lines of an OBJ.

use std::collections::HashMap;
use std::io::{self, Write};

use lodsmith_core::{Positions, TriMesh};

use crate::error::Warning;
use crate::numbers::TextOut;
use crate::write::WriteOptions;

/// Writes a mesh as OBJ; returns what the format could not carry.
///
/// Every number is the shortest decimal that reads back the same, in the precision that the mesh has. Equal texture
/// coordinates and equal normals are written once. Colours stand behind the positions, as many programs read them;
/// they belong to vertices there, so where the wedges of a vertex differ the first one's is written, and alpha has no
/// place: both are warned of.
///
/// # Errors
/// What the stream answers.
pub fn write(mesh: &TriMesh, _options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let mut warnings = Vec::new();
    let colors = mesh.colors().map(|colors| vertex_colors(mesh, colors, &mut warnings));
    let mut out = TextOut::new(out);
    out.text("# Lodsmith\n");
    for vertex in 0..mesh.vertex_count() {
        out.byte(b'v');
        match mesh.positions() {
            Positions::F32(p) => out.decimals(p[vertex]),
            Positions::F64(p) => out.decimals(p[vertex]),
        }
        if let Some(colors) = &colors {
            out.decimals(colors[vertex]);
        }
        out.end_line()?;
    }
    let has_map = mesh.vertex_map().is_some();
    let uv_of = mesh.uvs().map(|uvs| write_once(&mut out, "vt", uvs, has_map)).transpose()?;
    let normal_of = mesh.normals().map(|normals| write_once(&mut out, "vn", normals, has_map)).transpose()?;
    for triangle in mesh.triangles() {
        out.byte(b'f');
        for &wedge in triangle {
            out.byte(b' ');
            out.whole(mesh.vertex_of(wedge).0 + 1);
            match (&uv_of, &normal_of) {
                (None, None) => {}
                (Some(uv), None) => {
                    out.byte(b'/');
                    out.whole(uv.number(wedge.index()));
                }
                (uv, Some(normal)) => {
                    out.byte(b'/');
                    if let Some(uv) = uv {
                        out.whole(uv.number(wedge.index()));
                    }
                    out.byte(b'/');
                    out.whole(normal.number(wedge.index()));
                }
            }
        }
        out.end_line()?;
    }
    out.finish()?;
    Ok(warnings)
}

/// Which line each wedge names, counted from 1.
enum Numbers {
    /// That of its own number.
    Own,
    Table(Vec<u32>),
}

impl Numbers {
    fn number(&self, wedge: usize) -> u32 {
        match self {
            Self::Own => wedge as u32 + 1,
            Self::Table(table) => table[wedge],
        }
    }
}

/// Writes vectors, equal ones once. Without seams each vertex writes its own: then corners need one number only, and
/// readers see that there are no seams.
fn write_once<const N: usize>(
    out: &mut TextOut<'_>,
    keyword: &str,
    vectors: &[[f32; N]],
    has_map: bool,
) -> io::Result<Numbers> {
    let mut line = |vector: &[f32; N]| {
        out.text(keyword);
        out.decimals(*vector);
        out.end_line()
    };
    if !has_map {
        vectors.iter().try_for_each(line)?;
        return Ok(Numbers::Own);
    }
    let mut seen: HashMap<[u32; N], u32> = HashMap::with_capacity(vectors.len());
    let mut table = Vec::with_capacity(vectors.len());
    for vector in vectors {
        let new = seen.len() as u32 + 1;
        let number = *seen.entry(vector.map(f32::to_bits)).or_insert(new);
        if number == new {
            line(vector)?;
        }
        table.push(number);
    }
    Ok(Numbers::Table(table))
}

/// Red, green and blue for each vertex; white for one without a wedge.
fn vertex_colors(mesh: &TriMesh, colors: &[[f32; 4]], warnings: &mut Vec<Warning>) -> Vec<[f32; 3]> {
    if colors.iter().any(|c| c[3] != 1.0) {
        warnings.push(Warning::lost("OBJ cannot carry the alpha of colours: dropped"));
    }
    let rgb = |c: &[f32; 4]| [c[0], c[1], c[2]];
    let Some(map) = mesh.vertex_map() else {
        return colors.iter().map(rgb).collect();
    };
    let mut of_vertex: Vec<Option<[f32; 3]>> = vec![None; mesh.vertex_count()];
    let mut differing = 0usize;
    for (vertex, color) in map.iter().zip(colors) {
        let kept = of_vertex[vertex.index()].get_or_insert_with(|| rgb(color));
        differing += usize::from(*kept != rgb(color));
    }
    if differing > 0 {
        warnings.push(Warning::lost(format!(
            "OBJ carries one colour for each vertex: those of {differing} wedges that differ are dropped"
        )));
    }
    of_vertex.into_iter().map(|c| c.unwrap_or([1.0; 3])).collect()
}
