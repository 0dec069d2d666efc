//! Writer of PLY files.

use std::io::{self, Write};

use lodsmith_core::{Attribute, IntegerType, Positions, Semantic, TriMesh, VertexId, WedgeId};

use crate::error::Warning;
use crate::material::FaceProperty;
use crate::options::WriteOptions;

/// Approximate size in bytes of the chunks written to the stream.
const PIECE: usize = 1 << 16;

pub(super) fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let ascii = options.ascii;
    let of_regions: &[FaceProperty] =
        options.regions.as_deref().map_or(&[], |regions| regions.properties_of_faces(mesh));
    let mut warnings = Vec::new();
    // Without attributes, wedges carry no information: the vertices are written.
    let split = mesh.has_attributes() && mesh.vertex_map().is_some();
    let surface;
    let (count, triangles): (usize, &[[u32; 3]]) = if split {
        if mesh.wedge_count() != mesh.vertex_count() {
            warnings.push(Warning::note(format!(
                "PLY has one set of attributes for each vertex: {} vertices are written as {}",
                mesh.vertex_count(),
                mesh.wedge_count()
            )));
        }
        (mesh.wedge_count(), bytemuck::cast_slice(mesh.triangles()))
    } else {
        surface = mesh.surface();
        (mesh.vertex_count(), bytemuck::cast_slice(surface.triangles()))
    };
    let vertex = |i: usize| if split { mesh.vertex_of(WedgeId::new(i)) } else { VertexId::new(i) };

    let colors = mesh.colors().map(|c| Colors {
        values: c,
        bytes: are_bytes(c),
        alpha: c.iter().any(|c| c[3] != 1.0),
    });
    let named: Vec<(&Attribute, Option<IntegerType>)> = mesh
        .further_attributes()
        .iter()
        .filter(|a| a.semantic.name().is_some())
        .map(|a| (a, integers_of(a)))
        .collect();
    let names = names_of(&named);
    header(mesh, ascii, (count, triangles.len()), colors.as_ref(), (&names, of_regions), out)?;

    let mut sink = Sink { out, piece: Vec::with_capacity(PIECE + 256), ascii };
    for i in 0..count {
        match mesh.positions() {
            Positions::F32(p) => p[vertex(i).index()].iter().for_each(|&x| sink.f32(x)),
            Positions::F64(p) => p[vertex(i).index()].iter().for_each(|&x| sink.f64(x)),
        }
        if let Some(normals) = mesh.normals() {
            normals[i].iter().for_each(|&x| sink.f32(x));
        }
        if let Some(uvs) = mesh.uvs() {
            uvs[i].iter().for_each(|&x| sink.f32(x));
        }
        if let Some(c) = &colors {
            for &x in &c.values[i][..if c.alpha { 4 } else { 3 }] {
                if c.bytes { sink.byte((x * 255.0).round() as u8) } else { sink.f32(x) }
            }
        }
        for &(a, integer) in &named {
            for &x in a.of(WedgeId::new(i)) {
                match integer {
                    Some(of) => sink.integer(of, x as i64),
                    None => sink.f32(x),
                }
            }
        }
        sink.end_record()?;
    }
    for (face, t) in triangles.iter().enumerate() {
        sink.byte(3);
        t.iter().for_each(|&i| sink.index(i));
        let region = mesh.regions().map_or(0, |all| all[face].index());
        for property in of_regions {
            let value = property.value(region);
            match property.of {
                Some(of) => sink.integer(of, value as i64),
                None => sink.f32(value as f32),
            }
        }
        sink.end_record()?;
    }
    sink.out.write_all(&sink.piece)?;
    Ok(warnings)
}

struct Colors<'a> {
    values: &'a [[f32; 4]],
    /// True if bytes hold the colours exactly.
    bytes: bool,
    /// True if any colour is not opaque.
    alpha: bool,
}

/// Returns the integer type to write an attribute as: its own type, if that holds all its values.
fn integers_of(a: &Attribute) -> Option<IntegerType> {
    let Semantic::Discrete { of, .. } = a.semantic else { return None };
    a.values.iter().all(|&x| of.holds(x)).then_some(of)
}

/// Returns the PLY name of an integer type.
fn type_name(of: IntegerType) -> &'static str {
    match of {
        IntegerType::I8 => "char",
        IntegerType::U8 => "uchar",
        IntegerType::I16 => "short",
        IntegerType::U16 => "ushort",
        IntegerType::I32 => "int",
        IntegerType::U32 => "uint",
    }
}

/// Returns the properties of named attributes, with their numeric types: the name in lower case, without the
/// leading underscore of glTF, plus the axis or index for several values. Characters not allowed in PLY
/// become underscores, and duplicates get underscores appended.
fn names_of(named: &[(&Attribute, Option<IntegerType>)]) -> Vec<(String, &'static str)> {
    let mut names: Vec<(String, &'static str)> = Vec::new();
    for (a, integer) in named {
        let own = a.semantic.name().unwrap_or_default();
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
        let name: String = own.strip_prefix('_').unwrap_or(own).chars().map(plain).collect();
        for k in 0..a.width {
            let mut full = match (a.width, ["x", "y", "z", "w"].get(k)) {
                (1, _) => name.clone(),
                (2..=4, Some(axis)) => format!("{name}_{axis}"),
                _ => format!("{name}_{k}"),
            };
            while names.iter().any(|n| n.0 == full) || RESERVED_NAMES.contains(&full.as_str()) {
                full.push('_');
            }
            names.push((full, integer.map_or("float", type_name)));
        }
    }
    names
}

/// Names of the other properties.
const RESERVED_NAMES: [&str; 13] =
    ["", "x", "y", "z", "nx", "ny", "nz", "s", "t", "red", "green", "blue", "alpha"];

fn are_bytes(colors: &[[f32; 4]]) -> bool {
    colors.iter().flatten().all(|&x| {
        let byte = (x * 255.0).round();
        (0.0..=255.0).contains(&byte) && byte / 255.0 == x
    })
}

fn header(
    mesh: &TriMesh,
    ascii: bool,
    (vertices, faces): (usize, usize),
    colors: Option<&Colors<'_>>,
    (named, of_faces): (&[(String, &str)], &[FaceProperty]),
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut text = String::from("ply\n");
    let mut line = |parts: &[&str]| {
        text += &parts.join(" ");
        text.push('\n');
    };
    line(&["format", if ascii { "ascii" } else { "binary_little_endian" }, "1.0"]);
    line(&["comment", "written by lodsmith"]);
    line(&["element", "vertex", &vertices.to_string()]);
    let position = if matches!(mesh.positions(), Positions::F64(_)) { "double" } else { "float" };
    ["x", "y", "z"].iter().for_each(|n| line(&["property", position, n]));
    if mesh.normals().is_some() {
        ["nx", "ny", "nz"].iter().for_each(|n| line(&["property", "float", n]));
    }
    if mesh.uvs().is_some() {
        ["s", "t"].iter().for_each(|n| line(&["property", "float", n]));
    }
    if let Some(c) = colors {
        let names = ["red", "green", "blue", "alpha"];
        let kind = if c.bytes { "uchar" } else { "float" };
        names[..if c.alpha { 4 } else { 3 }].iter().for_each(|n| line(&["property", kind, n]));
    }
    named.iter().for_each(|(name, kind)| line(&["property", kind, name]));
    line(&["element", "face", &faces.to_string()]);
    // Most readers expect signed indices, which suffice up to 2^31.
    let index = if vertices > i32::MAX as usize { "uint" } else { "int" };
    line(&["property", "list", "uchar", index, "vertex_indices"]);
    for property in of_faces {
        line(&["property", property.of.map_or("float", type_name), &property.name]);
    }
    line(&["end_header"]);
    out.write_all(text.as_bytes())
}

/// A buffered writer of numbers, in binary or text.
struct Sink<'a> {
    out: &'a mut dyn Write,
    piece: Vec<u8>,
    ascii: bool,
}

impl Sink<'_> {
    #[inline]
    fn put<const N: usize>(&mut self, bytes: [u8; N], text: impl FnOnce(&mut Vec<u8>)) {
        if self.ascii {
            text(&mut self.piece);
            self.piece.push(b' ');
        } else {
            self.piece.extend_from_slice(&bytes);
        }
    }
    #[inline]
    fn byte(&mut self, x: u8) {
        self.put([x], |to| word(to, format_args!("{x}")));
    }
    #[inline]
    fn index(&mut self, x: u32) {
        self.put(x.to_le_bytes(), |to| word(to, format_args!("{x}")));
    }
    /// Writes a value that fits the type.
    #[inline]
    fn integer(&mut self, of: IntegerType, x: i64) {
        match of {
            IntegerType::I8 => self.put((x as i8).to_le_bytes(), |to| word(to, format_args!("{x}"))),
            IntegerType::U8 => self.put((x as u8).to_le_bytes(), |to| word(to, format_args!("{x}"))),
            IntegerType::I16 => self.put((x as i16).to_le_bytes(), |to| word(to, format_args!("{x}"))),
            IntegerType::U16 => self.put((x as u16).to_le_bytes(), |to| word(to, format_args!("{x}"))),
            IntegerType::I32 => self.put((x as i32).to_le_bytes(), |to| word(to, format_args!("{x}"))),
            IntegerType::U32 => self.put((x as u32).to_le_bytes(), |to| word(to, format_args!("{x}"))),
        }
    }
    #[inline]
    fn f32(&mut self, x: f32) {
        self.put(x.to_le_bytes(), |to| {
            // Both notations are the shortest that read back as the same number.
            if is_plain(x.into()) { word(to, format_args!("{x}")) } else { word(to, format_args!("{x:e}")) }
        });
    }
    #[inline]
    fn f64(&mut self, x: f64) {
        self.put(x.to_le_bytes(), |to| {
            if is_plain(x) { word(to, format_args!("{x}")) } else { word(to, format_args!("{x:e}")) }
        });
    }
    #[inline]
    fn end_record(&mut self) -> io::Result<()> {
        if self.ascii {
            self.piece.pop();
            self.piece.push(b'\n');
        }
        if self.piece.len() >= PIECE {
            self.out.write_all(&self.piece)?;
            self.piece.clear();
        }
        Ok(())
    }
}

/// Returns true if a number is short without an exponent.
fn is_plain(x: f64) -> bool {
    x == 0.0 || (1e-4..1e9).contains(&x.abs())
}

fn word(to: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    // Writing to a vector cannot fail.
    let _ = to.write_fmt(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_bytes_if_that_is_exact() {
        let k = |k: u8| f32::from(k) / 255.0;
        assert!((0..=255).all(|i| are_bytes(&[[k(i), k(255 - i), 0.0, 1.0]])));
        assert!(!are_bytes(&[[0.3, 0.0, 0.0, 1.0]]));
        assert!(!are_bytes(&[[2.0, 0.0, 0.0, 1.0]]));
        assert!(!are_bytes(&[[f32::NAN, 0.0, 0.0, 1.0]]));
    }
}
