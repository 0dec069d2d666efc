//! Stanford polygon files (PLY): text, and binary of either byte order.
//!
//! The header declares elements (`vertex`, `face`, ...) and their properties; the body holds the records in that order.
//! Properties with known names are read, whatever their type and order; the others are skipped and named in a
//! warning.

mod body;
mod face_values;
mod header;
mod source;
mod write;

use std::io::{self, Write};

use lodsmith_core::numbers::counted;
use lodsmith_core::polygon::Triangulator;
use lodsmith_core::{Attribute, MeshError, Positions, Semantic, TriMesh, VertexId, WedgeId};

use crate::distinct::TripleSet;
use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::{Contents, Loaded};
use crate::material::counts;
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
/// become wedges. Labels of faces (integers), their colours if these are few, and the pictures of `comment
/// TextureFile` with `texnumber` become regions; more colours become colours of corners. Polygons are triangulated;
/// `tristrips` are converted to triangles. Everything else is dropped with a warning; scalar properties of vertices
/// can be returned besides the mesh ([`ReadOptions::properties`]). Cost: O(bytes).
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
    assemble(&header, body, options)
}

/// Writes a mesh as PLY: little-endian binary, or text if the options request it.
///
/// A mesh with wedges is written with one vertex per wedge. Colours are bytes if that is lossless, else
/// floats. Values of faces that were read from PLY are written again. Returns notes; nothing is lost.
///
/// # Errors
/// The errors of the stream.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    write::write(mesh, options, out)
}

/// Assembles the mesh from header and body.
fn assemble(header: &Header, body: Body, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let Body { vertices, faces, columns, mut warnings } = body;
    let face_count = match &faces {
        Faces::Triangles(triangles) => triangles.len(),
        Faces::Polygons(corners) => corners.ends.len(),
    };
    let of_faces =
        face_values::regions(columns, face_count, &header.pictures, options.files(), &mut warnings);
    let positions = vertices.positions;
    let mut contents = Contents { meshes: 1, ..Contents::default() };
    let mut name = |present: bool, name: &str| {
        if present {
            contents.attributes.push(name.to_owned());
        }
    };
    name(vertices.normals.is_some(), "normals");
    name(vertices.uvs.is_some() || matches!(&faces, Faces::Polygons(c) if c.uvs.is_some()), "uvs");
    name(vertices.colors.is_some() || of_faces.colors.is_some(), "colors");
    contents.attributes.extend(vertices.discrete.iter().map(|d| d.name.clone()));
    contents.attributes.extend(vertices.unknown);

    let Split { triangles, uvs: corner_uvs, polygons } = match faces {
        Faces::Triangles(triangles) => {
            contents.polygons = triangles.len();
            Split { triangles, uvs: None, polygons: None }
        }
        Faces::Polygons(corners) => {
            contents.polygons = corners.ends.len();
            split(corners, &positions, &mut warnings)?
        }
    };
    if triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: positions.len() });
    }

    let polygon = |triangle: usize| polygons.as_ref().map_or(triangle, |all| all[triangle] as usize);
    let colors = of_faces.colors.map(|(palette, of_polygons)| {
        (palette, (0..triangles.len()).map(|t| of_polygons[polygon(t)]).collect::<Vec<u32>>())
    });
    let regions: Option<Vec<_>> =
        of_faces.of_faces.map(|all| (0..triangles.len()).map(|t| all[polygon(t)]).collect());
    if colors.is_some() && vertices.colors.is_some() {
        let text = "both vertices and faces have colours: those of the vertices are dropped";
        warnings.push(Warning::lost(text));
    }
    let mut mesh = match (&corner_uvs, &colors) {
        (None, None) => {
            let mut mesh = TriMesh::new(positions, bytemuck::allocation::cast_vec(triangles))?;
            mesh.set_normals(vertices.normals)?;
            mesh.set_uvs(vertices.uvs)?;
            mesh.set_colors(vertices.colors)?;
            mesh
        }
        _ => {
            if corner_uvs.is_some() && vertices.uvs.is_some() {
                warnings.push(Warning::lost(
                    "both vertices and face corners have texture coordinates: those of the vertices are dropped",
                ));
            }
            let of_vertices = OfVertices {
                positions,
                normals: vertices.normals,
                uvs: vertices.uvs,
                colors: vertices.colors,
            };
            with_corners(of_vertices, &triangles, corner_uvs.as_deref(), colors.as_ref())?
        }
    };
    for Discrete { name, of, values, .. } in vertices.discrete {
        let values = match mesh.vertex_map() {
            Some(map) => map.iter().map(|v| values[v.index()]).collect(),
            None => values,
        };
        mesh.add_attribute(Attribute { semantic: Semantic::Discrete { name, of }, width: 1, values })?;
    }
    mesh.set_regions(regions)?;
    (contents.materials, contents.textures) = counts(&of_faces.regions);
    let loaded = Loaded::new(mesh, Format::Ply, contents, warnings);
    Ok(Loaded { properties: vertices.wanted, regions: of_faces.regions, ..loaded })
}

/// Polygons cut into triangles.
struct Split {
    triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners, if the polygons had them.
    uvs: Option<Vec<[[f32; 2]; 3]>>,
    /// The polygon of each triangle, if these are not the polygons.
    polygons: Option<Vec<u32>>,
}

/// Splits polygons into triangles.
fn split(corners: Corners, positions: &Positions, warnings: &mut Vec<Warning>) -> Result<Split, ReadError> {
    let positions = positions.view();
    let mut triangles = Vec::with_capacity(corners.indices.len().saturating_sub(2 * corners.ends.len()));
    let mut uvs = corners.uvs.as_ref().map(|_| Vec::with_capacity(triangles.capacity()));
    let mut polygons = Vec::with_capacity(triangles.capacity());
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
            polygons.push(face as u32);
            if let (Some(out), Some(all)) = (&mut uvs, &corners.uvs) {
                out.push(t.map(|c| all[c]));
            }
        }
        start = end;
    }
    if small > 0 {
        warnings.push(Warning::note(format!(
            "{} with fewer than three corners: dropped",
            counted(small, "face", "faces")
        )));
    }
    Ok(Split { triangles, uvs, polygons: Some(polygons) })
}

/// Positions and attributes of vertices.
struct OfVertices {
    positions: Positions,
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    colors: Option<Vec<[f32; 4]>>,
}

/// Returns a mesh whose wedges are the distinct combinations of a vertex, a texture coordinate and a colour, in order of
/// first use. `colors` are those of faces: a list, and the index of each triangle in it.
fn with_corners(
    of_vertices: OfVertices,
    triangles: &[[u32; 3]],
    corner_uvs: Option<&[[[f32; 2]; 3]]>,
    colors: Option<&(Vec<[f32; 4]>, Vec<u32>)>,
) -> Result<TriMesh, ReadError> {
    let corners = triangles.len().saturating_mul(3);
    if u32::try_from(corners).is_err() {
        return Err(MeshError::TooLarge { what: "corners", count: corners }.into());
    }
    let OfVertices { positions, normals, uvs, colors: vertex_colors } = of_vertices;
    let mut placed = TripleSet::with_capacity(positions.len());
    let mut wedges = TripleSet::with_capacity(positions.len());
    let mut corner = |face: usize, k: usize| {
        let uv = corner_uvs.map_or([0.0; 2], |all| all[face][k]);
        let place = placed.id_of([triangles[face][k], uv[0].to_bits(), uv[1].to_bits()]);
        WedgeId(wedges.id_of([place, colors.map_or(0, |(_, of_faces)| of_faces[face]), 0]))
    };
    let faces: Vec<[WedgeId; 3]> =
        (0..triangles.len()).map(|face| [0, 1, 2].map(|k| corner(face, k))).collect();
    let (placed, wedges) = (placed.into_keys(), wedges.into_keys());
    let place = |key: &[u32; 3]| placed[key[0] as usize];
    let vertex = |key: &[u32; 3]| place(key)[0] as usize;
    let vertex_of = wedges.iter().map(|key| VertexId(place(key)[0])).collect();
    let mut mesh = TriMesh::with_wedges(positions, vertex_of, faces)?;
    let uv = |key: &[u32; 3]| [1, 2].map(|k| f32::from_bits(place(key)[k]));
    mesh.set_uvs(match corner_uvs {
        Some(_) => Some(wedges.iter().map(uv).collect()),
        None => uvs.map(|all| wedges.iter().map(|key| all[vertex(key)]).collect()),
    })?;
    mesh.set_normals(normals.map(|all| wedges.iter().map(|key| all[vertex(key)]).collect()))?;
    mesh.set_colors(match colors {
        Some((palette, _)) => Some(wedges.iter().map(|key| palette[key[1] as usize]).collect()),
        None => vertex_colors.map(|all| wedges.iter().map(|key| all[vertex(key)]).collect()),
    })?;
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
        assert_eq!((got.contents.textures, got.regions.len(), got.warnings.len()), (1, 1, 0));
        let library = got.regions.libraries()[0].text().unwrap();
        assert_eq!(library, b"newmtl material_0\nmap_Kd a b.png\n");
    }

    #[test]
    fn point_clouds_are_errors() {
        let e = text(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
        );
        assert!(matches!(e, Err(ReadError::NoFaces { vertices: 1 })));
    }

    /// Rows of triangles between two lines of vertices; `properties` and `value` are those of faces.
    fn strip(count: usize, properties: &str, value: impl Fn(usize) -> String) -> String {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {count}\nproperty list uchar int vertex_indices\n{properties}end_header\n",
            count + 2
        );
        (0..count + 2).for_each(|i| text += &format!("{} {} 0\n", i / 2, i % 2));
        (0..count)
            .for_each(|i| text += &format!("3 {} {} {} {}\n", i, i + 1 + i % 2, i + 2 - i % 2, value(i)));
        text
    }

    #[test]
    fn labels_and_few_colours_of_faces_become_regions_and_come_back() {
        let properties =
            "property int label\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
        let colors = ["255 0 0", "0 51 0"];
        let value = |i: usize| format!("{} {}", 20_000_001 + i / 20, colors[i / 30]);
        let got = text(&strip(60, properties, value)).unwrap();
        assert_eq!((got.regions.len(), got.warnings.len(), got.contents.materials), (4, 0, 2));
        let region = got.regions.get(got.mesh.regions().unwrap()[45]).unwrap();
        assert_eq!(region.groups, Some(&b"label_20000003"[..]));
        assert_eq!(region.material, Some(&b"color_003300"[..]));
        let regions = Some(std::sync::Arc::new(got.regions.clone()));
        let with_regions =
            |ascii| WriteOptions { regions: regions.clone(), ascii, ..WriteOptions::default() };
        for ascii in [true, false] {
            let options = with_regions(ascii);
            let mut bytes = Vec::new();
            let warnings = crate::write_to(&got.mesh, Format::Ply, &options, &mut bytes).unwrap().warnings;
            assert!(warnings.is_empty(), "{warnings:?}");
            let again = read(&bytes, &ReadOptions::default()).unwrap();
            assert_eq!((&again.mesh, &again.regions), (&got.mesh, &got.regions));
        }
        let lost = |format| {
            let written = crate::write_to(&got.mesh, format, &with_regions(false), &mut Vec::new()).unwrap();
            written.warnings.into_iter().filter(|w| w.data_lost).map(|w| w.text).collect::<Vec<_>>()
        };
        assert_eq!(lost(Format::Stl), ["STL cannot carry groups, materials: dropped"]);
        assert_eq!(lost(Format::Glb), ["GLB cannot carry groups: dropped"]);
    }

    #[test]
    fn many_colours_of_faces_are_colours_of_corners() {
        let properties = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int id\n";
        let got = text(&strip(60, properties, |i| format!("{} 0 0 {i}", i + 1))).unwrap();
        assert_eq!((got.regions.len(), got.mesh.wedge_count()), (0, 180));
        let color = |face: usize| got.mesh.colors().unwrap()[got.mesh.triangles()[face][0].index()];
        assert_eq!([color(0), color(59)], [1, 60].map(|k| [k as f32 / 255.0, 0.0, 0.0, 1.0]));
        let texts: Vec<&str> = got.warnings.iter().map(|w| w.text.as_str()).collect();
        assert_eq!(texts, ["face property id has 60 values, too many for regions: dropped"]);
    }

    #[test]
    fn pictures_belong_to_the_faces_that_name_them() {
        let with = |value: fn(usize) -> String| {
            let properties = "property int texnumber\n";
            let text_of = strip(40, properties, value);
            text(&text_of.replace("1.0\n", "1.0\ncomment TextureFile a.png\ncomment TextureFile b.jpg\n"))
                .unwrap()
        };
        let got = with(|i| format!("{}", i as i32 / 15 - 1));
        let material = |face: usize| got.regions.get(got.mesh.regions().unwrap()[face]).unwrap().material;
        assert_eq!([0, 20, 39].map(material), [None, Some(&b"material_0"[..]), Some(b"material_1")]);
        assert_eq!(got.contents.textures, 2);
    }

    #[test]
    fn normals_of_point_clouds_are_normals() {
        let vertices = QUAD.replace(
            "property float z\n",
            "property float z\nproperty float normal_x\nproperty float normal_y\nproperty float normal_z\n",
        );
        let got = text(&vertices.replace(" 0\n", " 0 0 0 2\n")).unwrap();
        assert_eq!(got.mesh.normals().unwrap(), [[0.0, 0.0, 1.0]; 4]);
        assert!(got.warnings.is_empty());
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
