//! Stanford polygon files (PLY): text, and binary of either byte order.
//!
//! The header declares elements (`vertex`, `face`, ...) and their properties; the body holds the records in that order.
//! Properties with known names are read, whatever their type and order; the others are skipped and named in a
//! warning.

mod body;
mod header;
mod source;
mod write;

use std::io::{self, Write};

use lodsmith_core::polygon::Triangulator;
use lodsmith_core::{Attribute, MeshError, Positions, Semantic, TriMesh, VertexId, WedgeId};

use crate::distinct::TripleSet;
use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::{Contents, Loaded};
use crate::options::ReadOptions;
use crate::options::WriteOptions;

use body::{Body, Corners, Discrete, Faces};
use header::Header;

/// Reads the bytes of a PLY file.
///
/// Vertices have positions (in double precision if the file has it), normals `nx ny nz`, colours
/// `red green blue [alpha]` and texture coordinates `s t`, `u v` or `texture_u texture_v`; other integer
/// properties of vertices become discrete attributes with the same names, unless single precision cannot hold
/// them. Faces have `vertex_indices` or `vertex_index` and per-corner texture coordinates (`texcoord`), which
/// become wedges. Polygons are triangulated; `tristrips` are converted to triangles. Everything else is
/// dropped with a warning; scalar properties of vertices can be returned besides the mesh
/// ([`ReadOptions::properties`]). Cost: O(bytes).
///
/// # Errors
/// [`ReadError::Malformed`] with the line, the byte or the element; [`ReadError::NoFaces`] for point clouds.
///
/// Source: G. Turk, "The PLY Polygon File Format" (1994), and what programs write today.
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let header = Header::parse(bytes)?;
    header.check_size(bytes.len())?;
    options.limits.check_memory("reading PLY", bytes.len() as u64 + header.mesh_bytes())?;
    let body = Body::read(&header, bytes, &options.properties, &options.progress)?;
    assemble(&header, body)
}

/// Writes a mesh as PLY: little-endian binary, or text if the options request it.
///
/// A mesh with wedges is written with one vertex per wedge. Colours are bytes if that is lossless, else
/// floats. Returns notes; nothing is lost.
///
/// # Errors
/// The errors of the stream.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    write::write(mesh, options.ascii, out)
}

/// Assembles the mesh from header and body.
fn assemble(header: &Header, body: Body) -> Result<Loaded, ReadError> {
    let Body { vertices, faces, mut warnings } = body;
    let positions = vertices.positions;
    let mut contents = Contents { meshes: 1, textures: header.texture_files, ..Contents::default() };
    let mut name = |present: bool, name: &str| {
        if present {
            contents.attributes.push(name.to_owned());
        }
    };
    name(vertices.normals.is_some(), "normals");
    name(vertices.uvs.is_some() || matches!(&faces, Faces::Polygons(c) if c.uvs.is_some()), "uvs");
    name(vertices.colors.is_some(), "colors");
    contents.attributes.extend(vertices.discrete.iter().map(|d| d.name.clone()));
    contents.attributes.extend(vertices.unknown);

    let (triangles, corner_uvs) = match faces {
        Faces::Triangles(triangles) => {
            contents.polygons = triangles.len();
            (triangles, None)
        }
        Faces::Polygons(corners) => {
            contents.polygons = corners.ends.len();
            split(corners, &positions, &mut warnings)?
        }
    };
    if triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: positions.len() });
    }

    let mut mesh = match corner_uvs {
        None => {
            let mut mesh = TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?;
            mesh.set_normals(vertices.normals)?;
            mesh.set_uvs(vertices.uvs)?;
            mesh.set_colors(vertices.colors)?;
            mesh
        }
        Some(corner_uvs) => {
            if vertices.uvs.is_some() {
                warnings.push(Warning::lost(
                    "both vertices and face corners have texture coordinates: those of the vertices are dropped",
                ));
            }
            with_corner_uvs(positions, vertices.normals, vertices.colors, &triangles, &corner_uvs)?
        }
    };
    for Discrete { name, of, values, .. } in vertices.discrete {
        let values = match mesh.vertex_map() {
            Some(map) => map.iter().map(|v| values[v.index()]).collect(),
            None => values,
        };
        mesh.add_attribute(Attribute { semantic: Semantic::Discrete { name, of }, width: 1, values })?;
    }
    if header.texture_files > 0 {
        warnings.push(Warning::lost("names of texture files are not kept: dropped"));
    }
    let loaded = Loaded::new(mesh, Format::Ply, contents, warnings);
    Ok(Loaded { properties: vertices.wanted, ..loaded })
}

/// Triangles, and texture coordinates of their corners if the polygons had them.
type Split = (Vec<[u32; 3]>, Option<Vec<[[f32; 2]; 3]>>);

/// Splits polygons into triangles.
fn split(corners: Corners, positions: &Positions, warnings: &mut Vec<Warning>) -> Result<Split, ReadError> {
    let positions = positions.view();
    let mut triangles = Vec::with_capacity(corners.indices.len().saturating_sub(2 * corners.ends.len()));
    let mut uvs = corners.uvs.as_ref().map(|_| Vec::with_capacity(triangles.capacity()));
    let (mut triangulator, mut points, mut cut) = (Triangulator::default(), Vec::new(), Vec::new());
    let mut small = 0usize;
    let mut start = 0usize;
    for (face, &end) in corners.ends.iter().enumerate() {
        let indices = &corners.indices[start..end];
        match indices.len() {
            ..3 => small += 1,
            3 => cut.push([0, 1, 2]),
            n if u32::try_from(n).is_err() => {
                return Err(ReadError::element(format!("face {face}"), "has more than 2^32 corners"));
            }
            _ => {
                points.clear();
                points.extend(indices.iter().map(|&i| positions.get(VertexId(i))));
                triangulator.triangulate(&points, &mut cut);
            }
        }
        for t in cut.drain(..) {
            let t = t.map(|c| start + c as usize);
            triangles.push(t.map(|c| corners.indices[c]));
            if let (Some(out), Some(all)) = (&mut uvs, &corners.uvs) {
                out.push(t.map(|c| all[c]));
            }
        }
        start = end;
    }
    if small > 0 {
        warnings.push(Warning::note(format!("{small} faces with fewer than three corners: dropped")));
    }
    Ok((triangles, uvs))
}

/// Returns a mesh whose wedges are the distinct pairs of a vertex and a texture coordinate, in order of first
/// use.
fn with_corner_uvs(
    positions: Positions,
    normals: Option<Vec<[f32; 3]>>,
    colors: Option<Vec<[f32; 4]>>,
    triangles: &[[u32; 3]],
    corner_uvs: &[[[f32; 2]; 3]],
) -> Result<TriMesh, ReadError> {
    let corners = triangles.len().saturating_mul(3);
    if u32::try_from(corners).is_err() {
        return Err(MeshError::TooLarge { what: "corners", count: corners }.into());
    }
    let mut wedges = TripleSet::with_capacity(positions.len());
    let faces: Vec<[WedgeId; 3]> = triangles
        .iter()
        .zip(corner_uvs)
        .map(|(t, uv)| {
            [0, 1, 2].map(|k| WedgeId(wedges.id_of([t[k], uv[k][0].to_bits(), uv[k][1].to_bits()])))
        })
        .collect();
    let keys = wedges.into_keys();
    let vertex_of = keys.iter().map(|k| VertexId(k[0])).collect();
    let mut mesh = TriMesh::with_wedges(positions, vertex_of, faces)?;
    mesh.set_uvs(Some(keys.iter().map(|k| [f32::from_bits(k[1]), f32::from_bits(k[2])]).collect()))?;
    mesh.set_normals(normals.map(|n| keys.iter().map(|k| n[k[0] as usize]).collect()))?;
    mesh.set_colors(colors.map(|c| keys.iter().map(|k| c[k[0] as usize]).collect()))?;
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(body: &str) -> Result<Loaded, ReadError> {
        read(body.as_bytes(), &ReadOptions::default())
    }

    const QUAD: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

    #[test]
    fn a_quad_becomes_two_triangles() {
        let got = text(QUAD).unwrap();
        assert_eq!((got.mesh.face_count(), got.mesh.vertex_count(), got.contents.polygons), (2, 4, 1));
        assert!(got.warnings.is_empty());
    }

    #[test]
    fn line_ends_of_all_systems() {
        for end in ["\r\n", "\r"] {
            assert_eq!(text(&QUAD.replace('\n', end)).unwrap().mesh, text(QUAD).unwrap().mesh, "{end:?}");
        }
    }

    #[test]
    fn a_strip_turns_every_other_triangle_and_restarts() {
        // 1---3   5
        // | \ | \ |
        // 0---2---4
        for (kind, restart) in
            [("int", "-1"), ("uint", "-1"), ("uint", "4294967295"), ("ushort", "65535"), ("uchar", "255")]
        {
            let got = text(&format!(
                "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n\
                 property float z\nelement tristrips 1\nproperty list int {kind} vertex_indices\nend_header\n\
                 0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n2 1 0\n9 0 2 1 3 {restart} 2 4 3 5\n",
            ))
            .unwrap();
            let faces: Vec<[u32; 3]> = got.mesh.triangles().iter().map(|t| t.map(|w| w.0)).collect();
            assert_eq!(faces, [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]], "{kind} {restart}");
        }
    }

    #[test]
    fn the_largest_number_of_a_type_is_a_vertex_in_large_meshes() {
        let vertices = "0 0 0\n1 0 0\n0 1 0\n".repeat(100);
        let got = text(&format!(
            "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\n\
             property float z\nelement tristrips 1\nproperty list int uchar vertex_indices\nend_header\n\
             {vertices}3 0 1 255\n",
        ))
        .unwrap();
        assert_eq!(got.mesh.face_count(), 1);
    }

    #[test]
    fn corner_coordinates_make_wedges() {
        let got = text(
            "ply\nformat ascii 1.0\ncomment TextureFile a b.png\nelement vertex 4\nproperty double x\n\
             property double y\nproperty double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             element face 2\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\n\
             property int texnumber\nend_header\n\
             0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 255 255 255\n\
             3 0 1 2 6 0 0 1 0 1 1 0\n3 0 2 3 6 0 0 .5 .5 0 1 0\n",
        )
        .unwrap();
        assert_eq!((got.mesh.vertex_count(), got.mesh.wedge_count()), (4, 5));
        assert!(matches!(got.mesh.positions(), Positions::F64(_)));
        assert_eq!(got.mesh.colors().unwrap()[3], [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(got.contents.textures, 1);
        let said: Vec<&str> = got.warnings.iter().map(|w| w.text.as_str()).collect();
        assert_eq!(
            said,
            [
                "face properties are not supported: texnumber dropped",
                "names of texture files are not kept: dropped"
            ]
        );
    }

    #[test]
    fn point_clouds_are_errors() {
        let e = text(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
        );
        assert!(matches!(e, Err(ReadError::NoFaces { vertices: 1 })));
    }

    #[test]
    fn reading_reports_progress() {
        let mesh = lodsmith_core::shapes::icosphere(3);
        let mut files = vec![(Vec::new(), crate::Format::Ply), (Vec::new(), crate::Format::Stl)];
        for (bytes, format) in &mut files {
            crate::write_to(&mesh, *format, &WriteOptions::default(), bytes).unwrap();
            let options = ReadOptions::default();
            assert_eq!(options.progress.done(), None);
            crate::read_bytes(bytes, &options).unwrap();
            assert_eq!(options.progress.done(), Some(1.0), "{format:?}");
        }
    }
}
