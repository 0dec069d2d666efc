//! Reader and writer of glTF 2.0: a scene as JSON, with buffers embedded, in separate files, or in one binary
//! file (GLB).
//!
//! The JSON stays a generic tree; elements of a mesh are looked up by index, and every index, offset and
//! count is bounds-checked. [`read`] and [`write`](fn@write) are for one mesh; [`Scene`] keeps the whole
//! file.

mod accessors;
mod affine;
mod brought_images;
mod buffers;
mod builder;
mod compressed;
mod container;
mod copied_images;
mod copies;
mod encode;
mod extension_losses;
mod external_files;
mod features;
mod geometry;
mod instances;
mod inventory;
mod lists;
mod lod;
mod materials;
mod mesh;
mod meshopt;
mod model;
mod motion;
mod names;
pub(crate) mod pack;
mod placed;
mod placements;
mod places;
mod primitive;
mod references;
mod rematerial;
mod renumber;
mod repack;
mod replace;
mod scene;
mod sizes;
mod skins;
mod slot;
mod survey;
mod texture_transform;
mod unpack;
mod unplaced_textures;
mod unused_materials;
mod vrm;
mod write;

pub(crate) use brought_images::BroughtImages;
pub(crate) use buffers::{file_path_of_uri, percent_decoded};
#[cfg(feature = "fbx")]
pub(crate) use builder::MorphTarget;
pub(crate) use builder::{BuiltScene, MeshParts, SceneBuilder, matrix_of_node};
pub(crate) use copied_images::CopiedImages;
pub use copies::CopyPlace;
pub use lod::SceneLevels;
pub use motion::{MovingNode, SceneCamera, SceneMotion};
pub use names::MeshNames;
pub use pack::{Compression, PackReport, Packing, QuantizationErrors, SceneFormat, Written};
pub use placed::{PlacedMesh, placed_meshes};
pub use rematerial::{NewMaterial, SlotImage, TextureSlot};
pub use scene::{Scene, SceneMesh};
pub use sizes::sizes;

use std::collections::BTreeMap;
use std::io::{self, Write};

use lodsmith_core::TriMesh;

use crate::assets::Assets;
use crate::attributes::srgb_colors;
use crate::error::ReadError;
use crate::format::Format;
use crate::frame::Frame;
use crate::limits::Limits;
use crate::loaded::Loaded;
use crate::options::ReadOptions;
use crate::options::WriteOptions;

use buffers::Buffers;
use container::Document;
use placements::PlacedNodes;

/// Reads a glTF 2.0 file, JSON or GLB.
///
/// Merges all meshes of the default scene into one, each as often as it is placed there: placed by its nodes, by
/// instances of nodes, or by the joints of its skin at rest. Hidden nodes are left out, with a warning; if no node
/// refers to a mesh, all meshes are read untransformed. Triangles, strips and fans are read; so are normals, the first
/// set of texture coordinates (flipped to our lower-left origin) and colours (converted from linear to sRGB). Each
/// vertex of the file stays one vertex: nothing is welded. Positions are single precision unless a node moves a mesh so
/// far that half of its digits would be lost. Each material that faces use becomes a region, described by a material
/// library in memory. Buffers in separate files are searched in the folder of the options, as far as
/// [`ReadOptions::assets`] allows. Cost: O(bytes + placed triangles).
///
/// # Errors
/// [`ReadError::Unsupported`] for glTF 1.0 and for unsupported required extensions, by name;
/// [`ReadError::Malformed`] with the element at fault; [`ReadError::Limit`] if a small file requests too
/// much.
///
/// Source: Khronos, "glTF 2.0 Specification" (2.0.1, 2021).
pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let document = Document::parse(bytes, options.limits, 1)?;
    document.check_version()?;
    document.check_extensions()?;
    let format = if document.is_glb { Format::Glb } else { Format::Gltf };
    merged(document, bytes.len(), format, &BTreeMap::new(), (options.files(), options.limits))
}

/// Merges the meshes of a scene that was made from another format, read from `size` bytes.
pub(crate) fn read_built(built: BuiltScene, size: usize, options: &ReadOptions) -> Result<Loaded, ReadError> {
    merged_built(built, size, (options.files(), options.limits))
}

/// Merges the meshes of a scene that was made in memory, and counts as a file of `size` bytes. `found_in`: the files that
/// materials may name, and the limits of reading.
fn merged_built(mut built: BuiltScene, size: usize, found_in: (Assets, Limits)) -> Result<Loaded, ReadError> {
    let (format, warnings) = (built.format, std::mem::take(&mut built.parts.warnings));
    let mut loaded = merged(built.parts.document(), size, format, &built.source_vertices, found_in)?;
    loaded.warnings.splice(0..0, warnings);
    loaded.warnings.extend(built.kept.iter().filter_map(|kept| kept.file_losses()));
    Ok(loaded)
}

/// Merges all placed meshes of a document from a file of `size` bytes. `source_vertices`: see [`BuiltScene`].
fn merged(
    mut document: Document<'_>,
    size: usize,
    format: Format,
    source_vertices: &BTreeMap<usize, Vec<u32>>,
    (assets, limits): (Assets, Limits),
) -> Result<Loaded, ReadError> {
    let opened;
    let buffers = if unpack::is_needed(&document.json) {
        let mut all = Buffers::new(&document, assets.clone(), limits).load_all()?;
        let (unpacked, _) = unpack::unpack(&mut document.json, &mut all, limits.max_bytes())?;
        opened = all;
        Buffers::loaded(&document.json, &opened, unpacked)
    } else {
        Buffers::new(&document, assets.clone(), limits)
    };
    let nodes = PlacedNodes::new(&document.json)?.or_all_meshes(&document.json);
    let (mut contents, mut warnings) =
        inventory::take(&document.json, &nodes.placements, inventory::Kept::Mesh);
    let gathered = geometry::gather(&document.json, &buffers, &nodes, size, limits)?;
    let geometry::Gathered { mut mesh, runs, warnings: merge_warnings, bases } = gathered;
    if !source_vertices.is_empty() {
        mesh = geometry::with_source_vertices(&mesh, &bases, source_vertices);
    }
    let (regions, of_faces) = materials::regions(&document.json, &buffers, &runs, assets, size);
    mesh.set_regions(of_faces)?;
    if let Some(colors) = mesh.colors() {
        mesh.set_colors(Some(srgb_colors(colors)))?;
    }
    contents.polygons = mesh.face_count();
    warnings.extend(merge_warnings);
    let regions = regions.with_frame(Frame::GLTF);
    Ok(Loaded { regions, limits, ..Loaded::new(mesh, format, contents, warnings) })
}

/// Writes a mesh as glTF 2.0: as JSON with an embedded buffer if the format of the options is
/// [`Format::Gltf`], else GLB.
///
/// One node with one mesh; a mesh with wedges has one glTF vertex for each wedge. glTF has single precision
/// only: double positions far from the origin are stored relative to the centre of their box, which becomes
/// the node's translation. Returns notes on what was changed.
///
/// Materials are written if the options have the table of the mesh's regions and textures are not switched
/// off: colour, alpha, emission, and images of colours, normals and emission, which are read from their files
/// and embedded. Each material has its own primitive. [`WriteOptions::packing`] makes the file smaller.
///
/// # Errors
/// I/O errors of the stream; [`io::ErrorKind::InvalidInput`] for a GLB of more than 4 GiB.
pub fn write(mesh: &TriMesh, options: &WriteOptions, out: &mut dyn Write) -> io::Result<Written> {
    let format = options.format.filter(|f| *f == Format::Gltf).unwrap_or(Format::Glb);
    pack::write(write::parts(mesh, options), SceneFormat::new(format, options.packing), out)
}
