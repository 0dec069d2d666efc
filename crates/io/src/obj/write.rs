//! Writer of OBJ files.

use std::collections::HashMap;
use std::io::{self, Write};

use lodsmith_core::{Positions, TriMesh, WedgeId};

use crate::error::Warning;
use crate::material::{Heading, Library, Region, Regions, Textures, drops_materials, join_titles, names_of};
use crate::numbers::TextOut;
use crate::options::WriteOptions;

/// Writes a mesh as OBJ; returns warnings about what the format cannot carry.
///
/// Every number is the shortest decimal that reads back the same, in the precision of the mesh. Equal texture
/// coordinates and equal normals are written once. Colours follow the positions, as many programs read them;
/// there they belong to vertices, so if the wedges of a vertex differ, the colour of the first is written,
/// and alpha is dropped: there are warnings about both.
///
/// With regions in the options, faces are written in the order of their regions, in mesh order within each,
/// under lines `o`, `g`, `usemtl` and `s`. If the mesh has no regions but the options have several, only the
/// names on which all of them agree are written, with a warning. Material libraries keep the names of their
/// source.
///
/// # Errors
/// The errors of the stream.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    write_with_libraries(mesh, options, None, out)
}

/// Like [`write()`], with these library names.
pub(crate) fn write_with_libraries(
    mesh: &TriMesh,
    options: &WriteOptions,
    libraries: Option<&[Vec<u8>]>,
    out: &mut dyn Write,
) -> io::Result<Vec<Warning>> {
    let none = Regions::default();
    let regions = options.regions.as_deref().unwrap_or(&none);
    let over = HeadingWriter { regions, with_materials: options.textures != Textures::None };
    let mut warnings = Vec::new();
    warnings.extend(over.warning(mesh));
    if over.with_materials && !drops_materials(mesh, regions) {
        warnings.extend(regions.libraries().iter().flat_map(Library::losses));
        if libraries.is_none()
            && options.beside.is_none()
            && regions.libraries().iter().any(Library::is_generated)
        {
            let text =
                "a stream cannot have material files beside it: only the names of materials are written";
            warnings.push(Warning::lost(text));
        }
    }
    let colors = mesh.colors().map(|colors| vertex_colors(mesh, colors, &mut warnings));
    let mut out = TextOut::new(out);
    out.text("# Lodsmith\n");
    if over.with_materials && !drops_materials(mesh, regions) {
        for name in libraries.unwrap_or(&names_of(regions)) {
            out.text("mtllib ");
            out.bytes(name);
            out.end_line()?;
        }
    }
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
    let face = |out: &mut TextOut<'_>, triangle: &[WedgeId; 3]| {
        out.byte(b'f');
        for &wedge in triangle {
            out.byte(b' ');
            out.parse_integer(mesh.vertex_of(wedge).0 + 1);
            match (&uv_of, &normal_of) {
                (None, None) => {}
                (Some(uv), None) => {
                    out.byte(b'/');
                    out.parse_integer(uv.number(wedge.index()));
                }
                (uv, Some(normal)) => {
                    out.byte(b'/');
                    if let Some(uv) = uv {
                        out.parse_integer(uv.number(wedge.index()));
                    }
                    out.byte(b'/');
                    out.parse_integer(normal.number(wedge.index()));
                }
            }
        }
        out.end_line()
    };
    match mesh.regions().filter(|_| !regions.is_empty()) {
        None => {
            over.lines(&mut out, Region::default(), regions.common_names())?;
            mesh.triangles().iter().try_for_each(|triangle| face(&mut out, triangle))?;
        }
        Some(ids) => {
            let mut faces: Vec<u32> = (0..mesh.face_count() as u32).collect();
            faces.sort_by_key(|&f| ids[f as usize]);
            let (mut present, mut names) = (None, Region::default());
            for f in faces {
                let id = ids[f as usize];
                if present != Some(id) {
                    let next = regions.get(id).unwrap_or_default();
                    over.lines(&mut out, names, next)?;
                    (present, names) = (Some(id), next);
                }
                face(&mut out, &mesh.triangles()[f as usize])?;
            }
        }
    }
    out.finish()?;
    Ok(warnings)
}

/// The headings of the faces.
struct HeadingWriter<'a> {
    regions: &'a Regions,
    with_materials: bool,
}

impl HeadingWriter<'_> {
    /// Writes the lines that change from one region to the next.
    fn lines(&self, out: &mut TextOut<'_>, from: Region<'_>, to: Region<'_>) -> io::Result<()> {
        for heading in Heading::ALL {
            let name = to.name(heading);
            // Names are interned, so comparing pointers suffices and is fast for long names.
            let is_same = match (from.name(heading), name) {
                (Some(before), Some(now)) => std::ptr::eq(before, now),
                (before, now) => before.is_none() && now.is_none(),
            };
            if is_same || (heading == Heading::Material && !self.with_materials) {
                continue;
            }
            out.text(heading.keyword());
            // A heading can end only in regions that were not read from a file.
            let nothing: &[u8] = if heading == Heading::Smoothing { b"off" } else { b"" };
            let name = name.unwrap_or(nothing);
            if !name.is_empty() {
                out.byte(b' ');
                out.bytes(name);
            }
            out.end_line()?;
        }
        Ok(())
    }

    /// Returns the warning about headings that cannot be assigned to faces.
    fn warning(&self, mesh: &TriMesh) -> Option<Warning> {
        if mesh.regions().is_some() {
            return None;
        }
        let is_ours = |heading: &Heading| self.with_materials || *heading != Heading::Material;
        let lost = join_titles(self.regions.differing().filter(is_ours))?;
        Some(Warning::lost(format!("{lost} dropped: the mesh does not store which faces they belong to")))
    }
}

/// The line number that each wedge refers to, counted from 1.
enum LineNumbers {
    /// The number of the wedge itself, plus one.
    Own,
    Table(Vec<u32>),
}

impl LineNumbers {
    fn number(&self, wedge: usize) -> u32 {
        match self {
            Self::Own => wedge as u32 + 1,
            Self::Table(table) => table[wedge],
        }
    }
}

/// Writes vectors, equal ones once. Without seams each vertex writes its own, so that corners need only one
/// number and readers see that there are no seams.
fn write_once<const N: usize>(
    out: &mut TextOut<'_>,
    keyword: &str,
    vectors: &[[f32; N]],
    has_map: bool,
) -> io::Result<LineNumbers> {
    let mut line = |vector: &[f32; N]| {
        out.text(keyword);
        out.decimals(*vector);
        out.end_line()
    };
    if !has_map {
        vectors.iter().try_for_each(line)?;
        return Ok(LineNumbers::Own);
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
    Ok(LineNumbers::Table(table))
}

/// Returns red, green and blue of each vertex; white for a vertex without a wedge.
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
            "OBJ has one colour per vertex: those of {differing} wedges that differ are dropped"
        )));
    }
    of_vertex.into_iter().map(|c| c.unwrap_or([1.0; 3])).collect()
}
