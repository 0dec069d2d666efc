//! A whole glTF file: its meshes can be read and replaced, everything else is preserved.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io::{self, Write};
use std::sync::Arc;

use lodsmith_core::{Bounds, TriMesh};
use serde_json::{Value, json};

use super::buffers::{Buffers, path_of};
use super::builder::BuiltScene;
use super::container::{Document, FileParts, list, list_mut, number, whole};
use super::copies::{self, CopyPlace};
use super::extension_losses::ExtensionLosses;
use super::external_files::{external_uris, is_file};
use super::lists::append;
use super::lod::{self, SceneLevels};
use super::mesh::{self, Budget};
use super::motion::{self, SceneMotion};
use super::names::MeshNames;
use super::pack::{SceneFormat, Written};
use super::placements::{self, PlacedNodes};
use super::survey::survey;
use super::{inventory, merged_built, pack, replace, unpack, write};
use crate::assets::{Asset, Assets, MAX_IMAGE_BYTES, Refusal};
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt;
use crate::finite::NonFinite;
use crate::format::Format;
use crate::limits::Limits;
use crate::loaded::{Contents, Loaded};
use crate::losses::losses;
use crate::material::image_type;
use crate::options::{ReadOptions, WriteOptions};
use crate::three_mf::{KeptContents, OF_THREE_MF};

/// A whole glTF file: its meshes one by one; nodes, materials, animations and everything else unchanged.
///
/// [`Scene::write`] writes the file with meshes replaced. [`read`](super::read) merges all placed meshes into
/// one instead.
#[derive(Clone, Debug)]
pub struct Scene {
    /// JSON of the file; the `uri` of each buffer is empty, since its bytes are in `buffers`.
    pub(super) json: Value,
    pub(super) buffers: Vec<Arc<Vec<u8>>>,
    meshes: Vec<SceneMesh>,
    bounds: Option<Bounds>,
    contents: Contents,
    warnings: Vec<Warning>,
    format: Format,
    /// See [`BuiltScene::source_vertices`]; for 3MF, in which vertex indices decide which triangles are neighbours.
    source_vertices: Option<Arc<BTreeMap<usize, Vec<u32>>>>,
    /// Contents of a 3MF file that the scene does not hold.
    kept: Option<Arc<KeptContents>>,
    /// See [`Scene::transform_build`].
    build_transform: Option<[[f64; 3]; 3]>,
    /// Number of bytes of the buffers that were decoded from compressed streams.
    pub(super) unpacked: usize,
    /// Location of images in separate files.
    pub(super) assets: Assets,
    pub(super) limits: Limits,
    /// Extensions that edits have left out since the file was read.
    pub(super) losses: ExtensionLosses,
    /// Materials that were added for new texture coordinates, until materials are removed.
    pub(super) atlas_materials: BTreeSet<usize>,
    /// Size in bytes of the file, or of its buffers if they are larger.
    size: usize,
}

/// Returns the number of bytes of images that are stored in buffers.
fn bytes_of_images(json: &Value) -> u64 {
    let views = list(json, "bufferViews");
    let view = |image: &Value| views.get(number(&image["bufferView"])?)?["byteLength"].as_u64();
    list(json, "images").iter().filter_map(view).fold(0, u64::saturating_add)
}

/// A mesh of a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SceneMesh {
    /// Its name; without a name, its index, as in `meshes[2]`.
    pub name: String,
    /// Its triangles, in local coordinates. Faces of primitive i have `RegionId(i)`; a mesh with one
    /// primitive has no regions. Vertices at equal positions are welded, across primitives too; wedges are
    /// the vertices of the file. Points and lines are left out, so there may be no faces.
    ///
    /// An attribute that only some primitives have is zero on the others, or white if it is a colour. Colours are linear, as
    /// in the file.
    pub mesh: Arc<TriMesh>,
    /// Number of instances in the default scene (under all roots if there is no scene).
    pub instances: usize,
    /// Largest factor by which one of its placements scales lengths; 1 if it has none. A skinned mesh is placed by its
    /// joints at rest.
    pub scale: f64,
    /// The rows of a linear map under which the mesh has the same lengths as at its largest placement; `None` if
    /// [`SceneMesh::scale`] alone describes all lengths, or if its placements stretch it in different ways, or flatten
    /// it.
    pub stretch: Option<[[f64; 3]; 3]>,
    /// Rows of its world transform, if it is placed exactly once; for a skinned mesh, the transform of one of the
    /// joints. Meshes with equal transforms share a coordinate system.
    pub world_from_mesh: Option<[[f64; 4]; 3]>,
    /// Rows of the world transform of each instance; empty if they are not known: for a skinned mesh, and beyond 65,536
    /// instances.
    pub places: Vec<[[f64; 4]; 3]>,
    /// True if a node places it with a skin.
    pub skinned: bool,
}

impl SceneMesh {
    /// Returns the diagonal of its bounding box where it is largest, before rotation; 0 for a mesh without vertices.
    pub fn largest_diagonal(&self) -> f64 {
        let Some(Bounds { min, max }) = self.mesh.positions().view().bounds() else { return 0.0 };
        let Some(rows) = self.stretch else { return Bounds { min, max }.diagonal() * self.scale };
        let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 0 { min[k] } else { max[k] });
        let stretched = |p: [f64; 3]| rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2]);
        Bounds::of((0..8).map(|c| stretched(corner(c)))).map_or(0.0, |b| b.diagonal())
    }
}

impl Scene {
    /// Reads a glTF 2.0 file, JSON or GLB.
    ///
    /// Meshes have all their attributes and morph targets; see [`SceneMesh`]. All buffers are read, separate
    /// files as far as [`ReadOptions::assets`] allows; separate image files are not opened. A scene without
    /// faces is not an error. Cost: O(bytes + triangles).
    ///
    /// # Errors
    /// As [`read`](super::read), except [`ReadError::NoFaces`].
    pub fn read(bytes: &[u8], options: &ReadOptions) -> Result<Self, ReadError> {
        let document = Document::parse(bytes, options.limits, 2)?;
        document.check_version()?;
        document.check_extensions()?;
        let format = if document.is_glb { Format::Glb } else { Format::Gltf };
        Self::of_document(document, bytes.len(), format, options)
    }

    /// Returns a mesh as a scene of one node, and warnings about what glTF cannot hold of it.
    ///
    /// The scene is the one that [`read`](Self::read) gives for the GLB that [`write_to`](crate::write_to) writes with
    /// these options, without packing; but no file is written or parsed. Its format is [`Format::Glb`], and it contains
    /// all its images. A mesh without faces is not an error. Cost: O(vertices + triangles + bytes of the images).
    ///
    /// # Errors
    /// [`ReadError::Memory`] and [`ReadError::Limit`] beyond the limits.
    pub fn of_mesh(
        mesh: &TriMesh,
        options: &WriteOptions,
        limits: Limits,
    ) -> Result<(Self, Vec<Warning>), ReadError> {
        let mut removed = NonFinite::default();
        let mesh = &*removed.removed_from(mesh, Format::Glb);
        let mut parts = write::parts(mesh, options);
        let mut warnings = removed.warnings(Format::Glb);
        warnings.append(&mut parts.warnings);
        warnings.extend(losses(mesh, Format::Glb, options));
        let (size, reading) = (parts.bytes.len(), ReadOptions { limits, ..ReadOptions::default() });
        Ok((Self::of_document(parts.document(), size, Format::Glb, &reading)?, warnings))
    }

    /// Returns the scene that was made from another format, read from `size` bytes.
    pub(crate) fn of_built(
        mut built: BuiltScene,
        size: usize,
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let (format, warnings) = (built.format, std::mem::take(&mut built.parts.warnings));
        let mut scene = Self::of_document(built.parts.document(), size, format, options)?;
        scene.warnings.splice(0..0, warnings);
        scene.kept = built.kept;
        scene.source_vertices = (format == Format::ThreeMf).then(|| Arc::new(built.source_vertices));
        Ok(scene)
    }

    fn of_document(
        document: Document<'_>,
        file_bytes: usize,
        format: Format,
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let mut buffers = Buffers::new(&document, options.files(), options.limits).load_all()?;
        let mut json = document.json;
        let (unpacked, losses) = unpack::unpack(&mut json, &mut buffers, options.limits.max_bytes())?;
        for buffer in list_mut(&mut json, "buffers") {
            if let Some(uri) = buffer.get_mut("uri") {
                *uri = "".into();
            }
        }

        // Memory of the file, its buffers, and the meshes, which come from all bytes that are not images:
        // with a table of positions and the source indices. (Measured: 2.6 times the buffers,
        // docs/decisions/0022.)
        let held: u64 = buffers.iter().map(|b| b.len() as u64).sum();
        let geometry = held.saturating_sub(bytes_of_images(&json));
        let need = (file_bytes as u64).saturating_add(held).saturating_add(geometry.saturating_mul(11) / 4);
        options.limits.check_memory("reading glTF", need)?;

        let mut warnings = losses.warnings();
        let size;
        let (meshes, contents, bounds) = {
            let opened = Buffers::loaded(&json, &buffers, unpacked);
            size = file_bytes.max(opened.total());
            let mut budget = Budget::new(size);
            let (mut meshes, mut ragged) = (Vec::new(), 0);
            for (i, mesh) in list(&json, "meshes").iter().enumerate() {
                let name = format!("meshes[{i}]");
                let (mesh_in_file, more) = mesh::read(&json, &opened, mesh, &name, &mut budget)?;
                ragged += more;
                let name = mesh["name"].as_str().map_or(name, str::to_owned);
                meshes.push(SceneMesh {
                    name,
                    mesh: Arc::new(mesh_in_file),
                    instances: 0,
                    scale: 1.0,
                    stretch: None,
                    world_from_mesh: None,
                    places: Vec::new(),
                    skinned: false,
                });
            }
            if ragged > 0 {
                warnings.push(Warning::note(format!(
                    "{ragged} primitives end with one or two indices too many: ignored"
                )));
            }
            let (contents, bounds) = place(&json, &opened, size, &mut meshes)?;
            (meshes, contents, bounds)
        };
        let (assets, limits) = (options.files(), options.limits);
        Ok(Self {
            json,
            buffers,
            meshes,
            bounds,
            contents,
            warnings,
            format,
            source_vertices: None,
            kept: None,
            build_transform: None,
            unpacked,
            assets,
            limits,
            losses: ExtensionLosses::default(),
            atlas_materials: BTreeSet::new(),
            size,
        })
    }

    /// Returns the memory of its buffers, in bytes.
    pub fn buffer_bytes(&self) -> u64 {
        self.buffers.iter().map(|b| b.len() as u64).sum()
    }

    /// Returns an error if nodes place more faces or vertices than a file of this size may, as
    /// [`read`](super::read) does. For callers that process each instance of a mesh.
    ///
    /// # Errors
    /// [`ReadError::Limit`].
    pub(crate) fn check_placed(&self) -> Result<(), ReadError> {
        let placed = |count: fn(&TriMesh) -> usize| {
            let of = |m: &SceneMesh| m.instances.saturating_mul(count(&m.mesh)) as u64;
            self.meshes.iter().map(of).fold(0, u64::saturating_add)
        };
        let (faces, vertices) = (placed(TriMesh::face_count), placed(TriMesh::vertex_count));
        placements::check_placed(faces, vertices, self.size)
    }

    /// Returns the meshes, in the order of the file.
    pub fn meshes(&self) -> &[SceneMesh] {
        &self.meshes
    }

    /// Returns the names of nodes and materials for each of [`Scene::meshes`], in their order.
    pub fn names(&self) -> Vec<MeshNames> {
        MeshNames::all(&self.json)
    }

    /// Returns a bounding box of all placed meshes, from the boxes of the meshes: it may be somewhat too
    /// large.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// Passes each external file that a model may use to `take`, with the number of bytes left for all files. Returns a
    /// warning for each file that may not be used, and for each that `take` refuses with a reason.
    pub(super) fn for_each_file(
        &self,
        mut take: impl FnMut(&str, &Asset, &mut u64) -> Result<(), String>,
    ) -> Vec<Warning> {
        // Guessed: more warnings would not help.
        const MAX_WARNINGS: usize = 16;
        let mut left = MAX_IMAGE_BYTES.min(self.limits.max_bytes());
        let (mut warnings, mut more) = (Vec::new(), 0);
        for uri in self.external_files() {
            let found = path_of(&uri).and_then(|path| self.assets.find(&path).map_err(Refusal::reason));
            match found.map_err(str::to_owned).and_then(|file| take(&uri, &file, &mut left)) {
                Ok(()) => {}
                Err(why) if warnings.len() < MAX_WARNINGS => {
                    warnings
                        .push(Warning::note(format!("the file {} {why}: its name is kept", excerpt(&uri))));
                }
                Err(_) => more += 1,
            }
        }
        if more > 0 {
            warnings.push(Warning::note(format!("{more} more files cannot be included")));
        }
        warnings
    }

    /// Returns the contents of the file; meshes and faces are counted once per instance.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Returns the warnings of reading the file.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns the format of the file that was read.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Writes the scene with some meshes replaced, as JSON with an embedded buffer or as GLB, packed if
    /// [`SceneFormat::packing`] requests it.
    ///
    /// `replaced[i]` replaces mesh i; if it is `None`, or if the list is shorter, the mesh stays identical
    /// byte for byte. The regions of a replacement's faces select their primitives; without regions, all
    /// faces go to the first primitive with triangles. A primitive keeps its attributes if the mesh has them,
    /// and their types if these represent the values; an attribute that no primitive had is added to all.
    /// Primitives without faces are removed, and so are meshes without primitives. All buffers of a file are
    /// merged into one; their bytes keep their order, and unused ones are left out.
    ///
    /// `relink` is called for every URI of [`Scene::external_files`], and may return another.
    ///
    /// # Errors
    /// I/O errors of the stream; [`io::ErrorKind::InvalidInput`] for another format, for a region that is not
    /// a primitive with triangles, and for a GLB of more than 4 GiB.
    pub fn write(
        &self,
        replaced: &[Option<TriMesh>],
        to: impl Into<SceneFormat>,
        relink: &dyn Fn(&str) -> Option<String>,
        out: &mut dyn Write,
    ) -> io::Result<Written> {
        let to = to.into();
        let mut parts = self.parts(&self.json, replaced, to, relink)?;
        parts.warnings.extend(self.kept().into_iter().flat_map(|kept| kept.losses(&self.json)));
        pack::write(parts, to, out)
    }

    /// Makes the file of the scene with this JSON and with some meshes replaced.
    fn parts(
        &self,
        json: &Value,
        replaced: &[Option<TriMesh>],
        to: SceneFormat,
        relink: &dyn Fn(&str) -> Option<String>,
    ) -> io::Result<FileParts> {
        let mut parts = replace::parts((json, &self.buffers, self.unpacked > 0), replaced, to, relink)?;
        parts.warnings.splice(0..0, self.losses.warnings());
        Ok(parts)
    }

    /// Writes the scene with levels of detail, by the extension `MSFT_lod`: every node whose mesh has levels
    /// refers to nodes with the levels, which are in no scene. Levels share materials, textures, skins and
    /// everything else they refer to; their meshes have the primitives of level 0. Morph targets and their
    /// animations are kept. Otherwise as [`Scene::write`].
    ///
    /// # Errors
    /// As [`Scene::write`]; [`io::ErrorKind::InvalidInput`] for a scene that has levels of detail already.
    pub fn write_levels(
        &self,
        levels: &SceneLevels,
        to: impl Into<SceneFormat>,
        relink: &dyn Fn(&str) -> Option<String>,
        out: &mut dyn Write,
    ) -> io::Result<Written> {
        let (json, replaced, losses) = lod::with_levels(&self.json, levels, &self.atlas_materials)?;
        let to = to.into();
        let mut parts = self.parts(&json, &replaced, to, relink)?;
        parts.warnings.splice(0..0, losses.warnings());
        parts.warnings.extend(self.kept().into_iter().flat_map(|kept| kept.losses(&self.json)));
        pack::write(parts, to, out)
    }

    /// Returns the scene with some meshes replaced: the one that [`read`](Self::read) gives for the GLB that
    /// [`write`](Self::write) writes, but no file is written or parsed. Cost: O(bytes of the scene + triangles).
    ///
    /// # Errors
    /// [`ReadError::Limit`] and [`ReadError::Memory`] beyond the limits that the scene was read with;
    /// [`ReadError::Malformed`] for a replacement that [`write`](Self::write) refuses.
    pub fn with_meshes(&self, replaced: &[Option<TriMesh>]) -> Result<Self, ReadError> {
        let parts = self.parts(&self.json, replaced, Format::Glb.into(), &|_| None);
        let mut parts = parts.map_err(|e| ReadError::file(e.to_string()))?;
        let (size, limits) = (parts.bytes.len().max(self.size), self.limits);
        let reading = ReadOptions { limits, ..ReadOptions::default() };
        let mut scene = Self::of_document(parts.document(), size, Format::Glb, &reading)?;
        scene.assets = self.assets.clone();
        Ok(scene)
    }

    /// Returns all placed meshes as one mesh, with some meshes of the scene replaced as in [`write`](Self::write).
    ///
    /// The result is the one that [`read`](super::read) gives for the GLB that [`write`](Self::write) writes, but no
    /// file is written or parsed. The limits are those that the scene was read with, and files that materials name
    /// are searched for where the scene was read. Warnings about the replaced meshes come before those of merging. Cost:
    /// O(bytes of the scene + placed triangles).
    ///
    /// # Errors
    /// [`ReadError::NoFaces`]; [`ReadError::Limit`] and [`ReadError::Memory`] beyond the limits;
    /// [`ReadError::Malformed`] for a replacement that [`write`](Self::write) refuses.
    pub fn joined(&self, replaced: &[Option<TriMesh>]) -> Result<Loaded, ReadError> {
        let parts = self.parts(&self.json, replaced, Format::Glb.into(), &|_| None);
        let parts = parts.map_err(|e| ReadError::file(e.to_string()))?;
        // How often meshes may be placed depends on the size of the file; the text only serves to determine it.
        let text = serde_json::to_vec(&parts.json).map_err(io::Error::from)?;
        let size = text.len() + parts.bytes.len();
        let built = BuiltScene {
            parts,
            format: Format::Glb,
            source_vertices: BTreeMap::new(),
            kept: self.kept.clone(),
        };
        merged_built(built, size, (self.assets.clone(), self.limits))
    }

    /// Returns the scene with a copy of its contents at each of these places, under its own node. Copies
    /// share meshes, materials and all data in buffers; each has its own nodes and skins, and animations move
    /// all of them. Nodes of other scenes of the file are no longer in any scene.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the nodes do not form trees.
    pub fn with_copies(&self, places: &[CopyPlace]) -> Result<Self, ReadError> {
        self.with_nodes(copies::with_copies(&self.json, places)?)
    }

    /// Returns the scene with further nodes and cameras, and an animation that moves them. Its numbers go
    /// into their own buffer, which is merged with the others when the scene is written. Times of a channel
    /// must be ascending; channels and references with invalid indices are left out.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the nodes do not form trees.
    pub fn with_motion(&self, motion: &SceneMotion) -> Result<Self, ReadError> {
        if motion.nodes.is_empty() {
            return Ok(self.clone());
        }
        let (json, numbers) = motion::with_motion(&self.json, motion)?;
        let mut scene = self.clone();
        scene.buffers.extend(numbers.map(Arc::new));
        scene.with_nodes(json)
    }

    /// Returns the scene with this JSON, which has other nodes.
    fn with_nodes(&self, json: Value) -> Result<Self, ReadError> {
        let mut meshes = self.meshes.clone();
        let opened = Buffers::loaded(&json, &self.buffers, self.unpacked);
        let (contents, bounds) = place(&json, &opened, self.size.max(opened.total()), &mut meshes)?;
        Ok(Self { json, meshes, contents, bounds, ..self.clone() })
    }

    /// Returns true if nodes refer to others as levels of detail.
    pub fn has_levels(&self) -> bool {
        lod::nodes_of_levels(&self.json).next().is_some()
    }

    /// Embeds a separate image file: `bytes` is the content of the file that `uri` names. Returns true if an
    /// image of a known type has that URI; otherwise nothing changes.
    pub fn embed(&mut self, uri: &str, bytes: Vec<u8>) -> bool {
        let named = |i: &Value| i["uri"] == uri && is_file(uri);
        let Some(first) = list(&self.json, "images").iter().find(|i| named(i)) else { return false };
        let said = first["mimeType"].as_str().map(str::to_owned);
        let Some(kind) = said.or_else(|| image_type(&bytes).map(str::to_owned)) else { return false };
        if bytes.is_empty() {
            return false;
        }
        let buffer = append(&mut self.json, "buffers", json!({ "byteLength": bytes.len() }));
        let view =
            append(&mut self.json, "bufferViews", json!({ "buffer": buffer, "byteLength": bytes.len() }));
        for image in list_mut(&mut self.json, "images").iter_mut().filter(|i| named(i)) {
            if let Some(image) = image.as_object_mut() {
                image.shift_remove("uri");
                image.insert("bufferView".to_owned(), view.into());
                image.insert("mimeType".to_owned(), kind.clone().into());
            }
        }
        self.buffers.push(Arc::new(bytes));
        true
    }

    /// Embeds separate image files that may be read. Returns a warning for each external file that is not an
    /// image, or not where a model may read files; such a file stays external.
    pub fn embed_files(&mut self) -> Vec<Warning> {
        let mut read = Vec::new();
        let warnings = self.for_each_file(|uri, file, left| {
            read.push((uri.to_owned(), file.read_image(left)?));
            Ok(())
        });
        for (uri, bytes) in read {
            self.embed(&uri, bytes);
        }
        warnings
    }

    /// Returns a warning for each kind of content beside meshes, nodes and materials, for formats that have only those.
    pub(crate) fn lost_beside_nodes(&self) -> Vec<Warning> {
        let nodes = PlacedNodes::new(&self.json).map(|nodes| nodes.or_all_meshes(&self.json));
        let mut placed = nodes.map_or_else(|_| Vec::new(), |nodes| nodes.placements);
        if self.kept.is_some() {
            // What a slicer does not print is hidden in the scene, and written as what it is.
            placed.iter_mut().for_each(|place| place.is_hidden = false);
        }
        inventory::take(&self.json, &placed, inventory::Kept::Nodes).1
    }

    /// Returns what a 3MF file has beside its scene; `None` for a scene of another format.
    pub(crate) fn kept(&self) -> Option<&KeptContents> {
        self.kept.as_deref()
    }

    /// Transforms everything that is placed by a linear map, whose rows these are, when the scene is written as 3MF: in the
    /// coordinates of that file, with z up. Other formats are not affected.
    pub fn transform_build(&mut self, rows: [[f64; 3]; 3]) {
        self.build_transform = Some(rows);
    }

    /// Returns the rows of the map of [`transform_build`](Self::transform_build).
    pub(crate) fn build_transform(&self) -> Option<[[f64; 3]; 3]> {
        self.build_transform
    }

    /// Returns what only 3MF has of a node; null for nothing.
    pub(crate) fn node_of_three_mf(&self, node: usize) -> &Value {
        &self.json["nodes"][node]["extras"][OF_THREE_MF]
    }

    /// Returns the marks of the triangles of each primitive of a mesh, which only 3MF has; null for none.
    pub(crate) fn marks(&self, mesh: usize) -> Vec<Value> {
        let primitives = list(&self.json["meshes"][mesh], "primitives");
        primitives.iter().map(|primitive| primitive["extras"][OF_THREE_MF].clone()).collect()
    }

    /// Returns the description of the file (metadata), as names and texts.
    pub(crate) fn description(&self) -> Vec<(String, String)> {
        let extras = self.json["asset"]["extras"].as_object();
        let text = |(name, value): (&String, &Value)| Some((name.clone(), value.as_str()?.to_owned()));
        extras.into_iter().flatten().filter_map(text).collect()
    }

    /// Returns the source vertex of each wedge of a mesh, if the format of the file distinguishes vertices at equal
    /// positions; `None` if [`SceneMesh::mesh`] has the same vertices.
    pub(crate) fn source_vertices(&self, mesh: usize) -> Option<Vec<u32>> {
        let sources = self.source_vertices.as_ref()?;
        let buffers = Buffers::loaded(&self.json, &self.buffers, self.unpacked);
        mesh::source_vertices(&self.json, &buffers, mesh, sources).ok()
    }

    /// Adds a warning.
    pub(crate) fn warn(&mut self, warning: Warning) {
        self.warnings.push(warning);
    }

    /// Returns the external files other than buffers, mostly images, by `uri` and each once. Network
    /// addresses are left out.
    pub fn external_files(&self) -> Vec<String> {
        let (mut found, mut known) = (Vec::new(), HashSet::new());
        external_uris(&self.json, &mut |uri| {
            if known.insert(uri) {
                found.push(uri.clone());
            }
        });
        found
    }
}

/// Sets the placements of each mesh; returns the contents of the file, with meshes and faces counted once per instance,
/// and the bounding box. `size` is the size of the file, or of its buffers if they are larger.
fn place(
    json: &Value,
    buffers: &Buffers<'_>,
    size: usize,
    meshes: &mut [SceneMesh],
) -> Result<(Contents, Option<Bounds>), ReadError> {
    let nodes = PlacedNodes::new(json)?;
    let shapes: Vec<&TriMesh> = meshes.iter().map(|m| &*m.mesh).collect();
    let (places, bounds) = survey(json, buffers, &nodes, &shapes, size)?;
    for (mesh, of_mesh) in meshes.iter_mut().zip(places) {
        mesh.instances = of_mesh.instances;
        mesh.scale = of_mesh.lengths.scale().unwrap_or(1.0);
        mesh.stretch = of_mesh.lengths.stretch();
        mesh.world_from_mesh = of_mesh.only.map(|place| place.0);
        mesh.places = of_mesh.known_places();
    }
    for node in list(json, "nodes") {
        let mesh = whole(node, "mesh", "a node")?.and_then(|m| meshes.get_mut(m));
        if let Some(mesh) = mesh {
            mesh.skinned |= !node["skin"].is_null();
            if mesh.skinned {
                mesh.places.clear();
            }
        }
    }
    let (mut contents, _) = inventory::take(json, &nodes.placements, inventory::Kept::Nodes);
    contents.meshes = meshes.iter().fold(0, |n, m| m.instances.saturating_add(n));
    let placed_faces = |m: &SceneMesh| m.instances.saturating_mul(m.mesh.face_count());
    contents.polygons = meshes.iter().fold(0, |n, m| placed_faces(m).saturating_add(n));
    Ok((contents, bounds))
}
