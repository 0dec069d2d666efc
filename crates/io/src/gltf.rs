//! glTF 2.0: a scene as JSON, with buffers inside, beside it, or in one binary file (GLB).
//!
//! The JSON is kept as it is and walked; what a mesh needs is looked up by index, and every index, offset and count is
//! held against what is there. [`read`] and [`write`](fn@write) are for one mesh; [`Scene`] keeps the whole file.

mod accessors;
mod buffers;
mod container;
mod copies;
mod encode;
mod geometry;
mod inventory;
mod lists;
mod lod;
mod materials;
mod mesh;
mod meshopt;
mod model;
mod moving;
mod names;
mod outside;
mod placements;
mod primitive;
mod references;
mod repack;
mod replace;
mod scene;
mod slot;
mod unpack;
mod write;

pub use copies::CopyPlace;
pub use lod::SceneLevels;
pub use moving::{MovingNode, SceneLens, SceneMotion};
pub use names::MeshNames;
pub use scene::{Scene, SceneMesh};

use std::io::{self, Write};

use lodsmith_core::TriMesh;

use crate::error::{ReadError, Warning};
use crate::format::Format;
use crate::loaded::Loaded;
use crate::material::{Purpose, Textures, looks};
use crate::options::ReadOptions;
use crate::options::WriteOptions;

use buffers::Buffers;
use container::Document;

/// Reads a glTF 2.0 file, JSON or GLB.
///
/// All meshes of the default scene become one, placed by their nodes; if no node places a mesh, all are read as they
/// stand. Triangles, strips and fans are read; normals, the first set of texture coordinates (turned to our lower left
/// origin) and colours come along. Each vertex of the file stays one vertex: nothing is welded. Positions are
/// single precision unless a node moves a mesh so far that half of its digits would go. Each material that faces have is
/// a region, described by a library that is no file. Buffers that are files are
/// looked for in the folder of the options, as far as [`ReadOptions::assets`] lets them. Cost: O(bytes + placed triangles).
///
/// # Errors
/// [`ReadError::Unsupported`] for glTF 1.0 and for required extensions that are not known here, by name;
/// [`ReadError::Malformed`] with the element at fault; [`ReadError::Limit`] where few bytes ask for too much.
///
/// Source: Khronos, "glTF 2.0 Specification" (2.0.1, 2021).
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let mut document = Document::parse(bytes, options.limits, 1)?;
    document.check_version()?;
    document.check_extensions(false)?;
    let opened;
    let buffers = if unpack::is_needed(&document.json) {
        let mut all = Buffers::new(&document, options).load_all()?;
        let unpacked = unpack::unpack(&mut document.json, &mut all, options.limits.most_bytes())?;
        opened = all;
        Buffers::loaded(&document.json, &opened, unpacked)
    } else {
        Buffers::new(&document, options)
    };
    let placements = placements::placements(&document.json)?;
    let (mut contents, mut warnings) = inventory::take(&document.json, &placements);
    let gathered = geometry::gather(&document.json, &buffers, &placements, bytes.len(), options.limits)?;
    let geometry::Gathered { mut mesh, runs, warnings: told } = gathered;
    let (regions, of_faces) =
        materials::regions(&document.json, &buffers, &runs, options.files(), bytes.len());
    mesh.set_regions(of_faces)?;
    contents.polygons = mesh.face_count();
    warnings.extend(told);
    let format = if document.is_glb { Format::Glb } else { Format::Gltf };
    Ok(Loaded { regions, ..Loaded::new(mesh, format, contents, warnings) })
}

/// Writes a mesh as glTF 2.0: as JSON with its buffer inside if the format of the options is [`Format::Gltf`], else GLB.
///
/// One node with one mesh; a mesh with wedges has one glTF vertex for each wedge. glTF has single precision only: double
/// positions far from the origin are stored relative to the centre of their box, which becomes the node's translation.
/// Returns notes on what was changed.
///
/// Materials come along, if the options have the table of its regions: colour, alpha, emission, and images of
/// colours, normals and emission, which are read from their files and lie inside, unless textures are to be none. Each material
/// has a primitive of its own.
///
/// # Errors
/// What the stream answers; [`io::ErrorKind::InvalidInput`] beyond the 4 GiB of a GLB.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Vec<Warning>> {
    let looks = options
        .regions
        .as_deref()
        .filter(|_| options.textures != Textures::None)
        .and_then(|regions| looks(mesh, regions, Purpose::Gltf))
        .unwrap_or_default();
    write::write(mesh, looks, options.format != Some(Format::Gltf), out)
}
