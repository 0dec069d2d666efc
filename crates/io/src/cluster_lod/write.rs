//! The way out.

use std::io::{self, Write};
use std::path::Path;

use lodsmith_core::{Attribute, ClusterLod, Morphed, Positions, Semantic};

use super::{DOUBLE, MAGIC, NONE, VERSION, sections};
use crate::error::WriteError;
use crate::obj::Regions;

/// Writes levels to a file, which appears when it is whole.
///
/// Of the regions their names are written; libraries and textures are not.
///
/// # Errors
/// [`WriteError`], which names the path; nothing is left behind.
pub fn write_path(lod: &ClusterLod, regions: &Regions, path: &Path) -> Result<(), WriteError> {
    crate::write::write_file(path, |out| write(lod, regions, out))
        .map_err(|source| WriteError::Io { path: path.to_owned(), source })
}

/// Writes levels to a stream, in large pieces.
///
/// # Errors
/// [`WriteError`].
pub fn write_to(lod: &ClusterLod, regions: &Regions, out: &mut dyn Write) -> Result<(), WriteError> {
    let path = Path::new("output stream").to_owned();
    write(lod, regions, out).map_err(|source| WriteError::Io { path, source })
}

fn write(lod: &ClusterLod, regions: &Regions, out: &mut dyn Write) -> io::Result<()> {
    let mesh = lod.mesh();
    let flags = if matches!(mesh.positions(), Positions::F64(_)) { DOUBLE } else { 0 };
    out.write_all(&MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&u32::to_le_bytes(flags))?;
    let positions = match mesh.positions() {
        Positions::F32(p) => singles(p.as_flattened()),
        Positions::F64(p) => p.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect(),
    };
    sections::write(*b"POSI", &positions, out)?;
    drop(positions);
    if let Some(map) = mesh.vertex_map() {
        sections::write(*b"WEDG", &numbers(map.iter().map(|v| v.0)), out)?;
    }
    let flat = [
        (*b"NORM", mesh.normals().map(<[[f32; 3]]>::as_flattened)),
        (*b"TEXC", mesh.uvs().map(<[[f32; 2]]>::as_flattened)),
        (*b"COLR", mesh.colors().map(<[[f32; 4]]>::as_flattened)),
    ];
    for (tag, values) in flat {
        if let Some(values) = values {
            sections::write(tag, &singles(values), out)?;
        }
    }
    for a in mesh.further_attributes() {
        sections::write(*b"ATTR", &attribute(a), out)?;
    }
    let doubles = |x: [f64; 5]| x.into_iter().flat_map(f64::to_le_bytes);
    let groups = lod.groups().iter().flat_map(|g| {
        let [x, y, z] = g.sphere.center;
        doubles([g.error, x, y, z, g.sphere.radius])
    });
    sections::write(*b"GRUP", &groups.collect::<Vec<u8>>(), out)?;
    let (mut clusters, mut lists) = (Vec::new(), Vec::new());
    for (id, c) in lod.ids().zip(lod.clusters()) {
        let meshlet = lod.meshlet(id);
        for count in [meshlet.triangles.len(), meshlet.wedges.len()] {
            clusters.extend_from_slice(&(count as u16).to_le_bytes());
        }
        for group in [c.from, c.into] {
            clusters.extend_from_slice(&group.map_or(NONE, |g| g.0).to_le_bytes());
        }
        let s = c.sphere;
        clusters.extend(s.center.into_iter().chain([s.radius]).flat_map(f64::to_le_bytes));
        lists.extend(meshlet.wedges.iter().flat_map(|w| w.0.to_le_bytes()));
        lists.extend(meshlet.triangles.iter().flatten());
        lists.resize(lists.len().next_multiple_of(4), 0);
    }
    sections::write(*b"CLUS", &clusters, out)?;
    sections::write(*b"LIST", &lists, out)?;
    if let Some(of_faces) = mesh.regions() {
        sections::write(*b"REGI", &numbers(of_faces.iter().map(|r| r.0)), out)?;
    }
    if !regions.is_empty() {
        sections::write(*b"NAME", &names(regions), out)?;
    }
    sections::write(*b"DONE", &[], out)?;
    out.flush()
}

fn singles(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn numbers(values: impl Iterator<Item = u32>) -> Vec<u8> {
    values.flat_map(u32::to_le_bytes).collect()
}

/// Kind, two numbers, width, name, values.
fn attribute(a: &Attribute) -> Vec<u8> {
    let (kind, first, second, name) = match &a.semantic {
        Semantic::Tangent => (0, 0, 0, ""),
        Semantic::Uv(set) => (1, u32::from(*set), 0, ""),
        Semantic::Color(set) => (2, u32::from(*set), 0, ""),
        Semantic::Joints(set) => (3, u32::from(*set), 0, ""),
        Semantic::Weights(set) => (4, u32::from(*set), 0, ""),
        Semantic::Morph { target, of } => {
            let of = match of {
                Morphed::Position => 0,
                Morphed::Normal => 1,
                Morphed::Tangent => 2,
            };
            (5, u32::from(*target), of, "")
        }
        Semantic::Custom(name) => (6, 0, 0, name.as_str()),
        Semantic::Discrete { name, of } => (7, of.number(), 0, name.as_str()),
    };
    let mut bytes = numbers([kind, first, second, a.width as u32, name.len() as u32].into_iter());
    bytes.extend_from_slice(name.as_bytes());
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.extend(a.values.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

/// For each region its object, groups, material and smoothing group: a length, or none, and the name.
fn names(regions: &Regions) -> Vec<u8> {
    let mut bytes = Vec::new();
    for r in regions.iter() {
        for name in [r.object, r.groups, r.material, r.smoothing] {
            bytes.extend_from_slice(&name.map_or(NONE, |n| n.len() as u32).to_le_bytes());
            bytes.extend_from_slice(name.unwrap_or(&[]));
        }
    }
    bytes
}
