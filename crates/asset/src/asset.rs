//! A file of any format as one value.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use lodsmith::{
    Input, LodChain, LodOptions, MeshCounts, OwnedMeshData, Part, Report, Simplified, SimplifiedScene,
    SimplifyError, SimplifyOptions,
};
use lodsmith_core::{Positions, Semantic, TriMesh};
use lodsmith_io::gltf::{PlacedMesh, Scene, SceneMesh, placed_meshes};
use lodsmith_io::{Contents, Format, Loaded, ModelFile, ModelSource, ReadOptions, Sizes, Warning};

use crate::baking::{MovedIntoMaps, SideFile, write_files};
use crate::constraints::{self, PartNames};
use crate::destination::{Destination, Writing};
use crate::error::AssetError;
use crate::images::FolderMove;
use crate::job::Job;
use crate::memory_need::{self, Size};
use crate::orient::{orient, rows_for_build};
use crate::palettes::Palettes;
use crate::paths::Source;
use crate::sizes::{self, WriteOutcome};
use crate::warnings::joined_per_mesh;

/// A file that was read: meshes and all data that belong to them.
///
/// A glTF, 3MF, COLLADA or FBX file is a scene whose meshes are simplified one by one, while everything else is kept.
/// Any other file is one mesh with its regions. A scene that is read for an output without scenes is also one mesh: all
/// of its instances are joined.
#[derive(Clone, Debug)]
pub struct Asset {
    head: Head,
    body: Body,
    /// Decoded once for all copies of the asset.
    palettes: Arc<OnceLock<Palettes>>,
}

/// Source of an asset, and the options that it was read with.
#[derive(Clone, Debug)]
struct Head {
    source: Source,
    reading: ReadOptions,
    format: Format,
    warnings: Vec<Warning>,
}

#[derive(Clone, Debug)]
enum Body {
    Mesh(Arc<Loaded>),
    Scene(Arc<Scene>),
}

/// The changes of a job to an asset: meshes, materials, and files beside the output.
#[derive(Clone, Debug, Default)]
pub struct Edit {
    /// The meshes that are replaced, by index; the list may be shorter than the list of meshes.
    pub meshes: Vec<Option<TriMesh>>,
    /// The scene with other materials, to be written instead of the scene of the asset.
    pub scene: Option<Box<Scene>>,
    /// Maps that are written to files beside the output.
    pub files: Vec<SideFile>,
    /// True if maps were baked.
    pub is_baked: bool,
    /// The data of the meshes that the maps hold now, which are not lost.
    pub moved: MovedIntoMaps,
}

/// The meshes that a run simplified, by index, and its report.
pub struct SimplifiedMeshes {
    /// The simplified meshes; `None` for a mesh without faces, which is not replaced.
    pub meshes: Vec<Option<TriMesh>>,
    /// The report.
    pub report: Report,
    /// Counts of the meshes that were simplified, with their indices; empty for a single mesh.
    pub counts: Vec<(usize, MeshCounts)>,
}

/// Levels of detail, each with the positions to which its vertices move in the next level, if requested.
pub struct Chain {
    /// The levels below the original.
    pub levels: Vec<SimplifiedMeshes>,
    /// For the original and each level, the positions in the next level for each mesh, by index.
    pub geomorphs: Vec<Vec<Option<Positions>>>,
}

/// Reads a file as a model for display.
pub(crate) fn read_model(
    source: &Source,
    reading: &ReadOptions,
    job: &mut Job<'_>,
) -> Result<ModelFile, AssetError> {
    Ok(match source {
        Source::Path(path) => lodsmith_io::read_model_path(path, reading)?,
        Source::Stream => lodsmith_io::read_model_bytes(&job.input(reading.limits)?, reading)?,
    })
}

impl Asset {
    /// Reads a file; a scene file as a scene if `as_scene` is set, else as one mesh.
    ///
    /// # Errors
    /// [`AssetError::Read`].
    pub fn read(
        source: &Source,
        options: &ReadOptions,
        as_scene: bool,
        job: &mut Job<'_>,
    ) -> Result<Self, AssetError> {
        let body = match source {
            Source::Path(path) => {
                let scene = if as_scene { lodsmith_io::read_scene_path(path, options)? } else { None };
                match scene {
                    Some(scene) => Body::Scene(Arc::new(scene)),
                    None => Body::Mesh(Arc::new(lodsmith_io::read_path(path, options)?)),
                }
            }
            Source::Stream => {
                let bytes = job.input(options.limits)?;
                let scene = if as_scene { lodsmith_io::read_scene_bytes(&bytes, options)? } else { None };
                match scene {
                    Some(scene) => Body::Scene(Arc::new(scene)),
                    None => Body::Mesh(Arc::new(lodsmith_io::read_bytes(&bytes, options)?)),
                }
            }
        };
        let (format, warnings) = match &body {
            Body::Mesh(loaded) => (loaded.format, loaded.warnings.clone()),
            Body::Scene(scene) => (scene.format(), scene.warnings().to_vec()),
        };
        let head = Head { source: source.clone(), reading: options.clone(), format, warnings };
        Ok(Self { head, body, palettes: Arc::default() })
    }

    /// Returns the asset that a model for display was made from, without copying; `None` if another process has it.
    pub fn of_model(file: &ModelFile, source: Source) -> Option<Self> {
        let body = match &file.source {
            ModelSource::Scene(scene) => Body::Scene(scene.clone()),
            ModelSource::Mesh(loaded) => Body::Mesh(loaded.clone()),
            _ => return None,
        };
        let mut asset = Self::of(body, file.format, file.warnings.clone());
        asset.head.source = source;
        Some(asset)
    }

    fn of(body: Body, format: Format, warnings: Vec<Warning>) -> Self {
        let (source, reading) = (Source::Stream, ReadOptions::default());
        Self { head: Head { source, reading, format, warnings }, body, palettes: Arc::default() }
    }

    /// Returns the format of the file.
    pub fn format(&self) -> Format {
        self.head.format
    }

    /// Returns the contents of the file.
    pub fn contents(&self) -> &Contents {
        match &self.body {
            Body::Mesh(loaded) => &loaded.contents,
            Body::Scene(scene) => scene.contents(),
        }
    }

    /// Returns the warnings of reading.
    pub fn warnings(&self) -> &[Warning] {
        &self.head.warnings
    }

    /// Returns the sizes of the file; `None` if they are not known.
    pub fn sizes(&self) -> Option<Sizes> {
        let read = match &self.body {
            Body::Mesh(loaded) => sizes::of_loaded(loaded),
            Body::Scene(scene) => scene.sizes(),
        };
        sizes::of_input(&self.head.source, &self.head.reading, read)
    }

    /// Returns the scene, if the file is one.
    pub fn scene(&self) -> Option<&Scene> {
        match &self.body {
            Body::Mesh(_) => None,
            Body::Scene(scene) => Some(scene),
        }
    }

    /// Returns the mesh of a file without a scene, with all data that belong to it.
    pub fn into_loaded(self) -> Option<Loaded> {
        match self.body {
            Body::Mesh(loaded) => Some(Arc::unwrap_or_clone(loaded)),
            Body::Scene(_) => None,
        }
    }

    /// Returns the meshes, in the order of the file.
    pub fn meshes(&self) -> Vec<&TriMesh> {
        match &self.body {
            Body::Mesh(loaded) => vec![&loaded.mesh],
            Body::Scene(scene) => scene.meshes().iter().map(|m| &*m.mesh).collect(),
        }
    }

    /// Returns the name of a mesh; `None` if the file is one mesh.
    pub(crate) fn name(&self, mesh: usize) -> Option<&str> {
        Some(&self.scene()?.meshes()[mesh].name)
    }

    /// Returns the indices of the meshes that a run simplifies: the meshes with instances, or all if no mesh has any.
    pub fn simplified_meshes(&self) -> Vec<usize> {
        match &self.body {
            Body::Mesh(_) => vec![0],
            Body::Scene(scene) => placed_meshes(scene.meshes()).iter().map(|placed| placed.index).collect(),
        }
    }

    /// Returns the number of vertices of each mesh that a run simplifies.
    fn vertex_counts(&self) -> Vec<usize> {
        let meshes = self.meshes();
        self.simplified_meshes().into_iter().map(|i| meshes[i].vertex_count()).collect()
    }

    /// Returns the numbers of faces and vertices, summed over all instances.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [TriMesh::face_count, TriMesh::vertex_count].map(|of| self.count(of))
    }

    /// Returns a count summed over all instances; each mesh counts once if no mesh has instances.
    fn count(&self, of: fn(&TriMesh) -> usize) -> usize {
        match &self.body {
            Body::Mesh(loaded) => of(&loaded.mesh),
            Body::Scene(scene) => {
                let is_placed = scene.meshes().iter().any(|m| m.instances > 0);
                let times = |m: &SceneMesh| if is_placed { m.instances } else { 1 };
                scene.meshes().iter().map(|m| of(&m.mesh) * times(m)).sum()
            }
        }
    }

    /// Returns the diagonal of the bounding box of all instances.
    pub fn diagonal(&self) -> f64 {
        let bounds = match &self.body {
            Body::Mesh(loaded) => loaded.mesh.positions().view().bounds(),
            Body::Scene(scene) => scene.bounds(),
        };
        bounds.map_or(0.0, |b| b.diagonal())
    }

    /// Drops the materials of a scene that was read as one mesh, so that their borders need not be preserved.
    fn drop_materials(&mut self) -> Result<(), AssetError> {
        if let Body::Mesh(loaded) = &mut self.body
            && loaded.format.is_scene()
        {
            Arc::make_mut(&mut Arc::make_mut(loaded).mesh).set_regions(None)?;
        }
        Ok(())
    }

    /// Returns the data of the meshes that a run simplifies (locks, importance, error maps and images), and warnings
    /// about images that are left out.
    ///
    /// # Errors
    /// [`AssetError::Name`] if a name is not found.
    pub fn data(&self, names: &PartNames) -> Result<(Vec<OwnedMeshData>, Vec<Warning>), AssetError> {
        let mut data = self.named_data(names)?;
        let left_out = self.add_palettes(&mut data);
        Ok((data, left_out))
    }

    /// Returns the data that names of parts give for the meshes that a run simplifies.
    pub(crate) fn named_data(&self, names: &PartNames) -> Result<Vec<OwnedMeshData>, AssetError> {
        match &self.body {
            Body::Mesh(loaded) => Ok(vec![constraints::of_mesh(names, loaded)?]),
            Body::Scene(scene) => constraints::of_scene(names, scene, &self.simplified_meshes()),
        }
    }

    /// Adds base-colour images to the data of the meshes that a run simplifies, so that the engine keeps palette
    /// colours in place. Returns warnings about images that are left out.
    pub(crate) fn add_palettes(&self, data: &mut [OwnedMeshData]) -> Vec<Warning> {
        if self.palettes.get().is_none() {
            // Not inside the cell's initialiser: decoding runs in parallel.
            let made = match &self.body {
                Body::Mesh(loaded) => Palettes::of_mesh(loaded),
                Body::Scene(scene) => Palettes::of_scene(scene, &self.simplified_meshes()),
            };
            let _ = self.palettes.set(made);
        }
        let Some(palettes) = self.palettes.get() else { return Vec::new() };
        palettes.add_to(data);
        palettes.left_out.clone()
    }

    /// Prepares a run for an output: returns the data of the meshes, and warnings about images and targets that have no
    /// effect. A mesh becomes a scene if `becomes_scene` is set; materials that are not written are left out.
    pub(crate) fn prepare(
        &mut self,
        names: &PartNames,
        vertices: Option<&OwnedMeshData>,
        becomes_scene: bool,
        to: Option<&Destination>,
        options: &SimplifyOptions,
    ) -> Result<(Vec<OwnedMeshData>, Vec<Warning>), AssetError> {
        let mut data = if becomes_scene {
            self.become_scene(names, &to.map_or_else(Writing::default, |to| to.writing))?
        } else {
            self.named_data(names)?
        };
        if let Some(all) = vertices {
            data = all.split(&self.vertex_counts())?;
        }
        let mut warnings = self.add_palettes(&mut data);
        if !to.is_some_and(Destination::keeps_materials) {
            self.drop_materials()?;
        }
        if options.per_mesh && self.scene().is_none() && self.contents().meshes > 1 {
            warnings.push(joined_per_mesh());
        }
        Ok((data, warnings))
    }

    /// Returns the peak memory of a run in bytes.
    pub(crate) fn need(&self, options: &SimplifyOptions, data: &[OwnedMeshData]) -> u64 {
        let run = match &self.body {
            Body::Mesh(loaded) => memory_need::simplify(&loaded.mesh, options),
            Body::Scene(scene) => memory_need::simplify_scene(scene.meshes(), scene.buffer_bytes(), options),
        };
        run.saturating_add(memory_need::images(data))
    }

    /// Returns the peak memory of making levels in bytes.
    pub(crate) fn levels_need(&self, options: &SimplifyOptions, data: &[OwnedMeshData]) -> u64 {
        let size = Size::of_all(self.meshes());
        let run = match &self.body {
            Body::Mesh(_) => memory_need::lod(size, options),
            Body::Scene(scene) => memory_need::lod_scene(size, options).saturating_add(scene.buffer_bytes()),
        };
        run.saturating_add(memory_need::images(data))
    }

    /// Returns the meshes that a run simplifies, with their data, as parts.
    pub fn parts<'a>(&'a self, data: &'a [OwnedMeshData]) -> Vec<Part<'a>> {
        let of = |mesh: &'a TriMesh, data: &'a OwnedMeshData| Part { data: data.view(), ..Part::new(mesh) };
        match &self.body {
            Body::Mesh(loaded) => data.iter().map(|data| of(&loaded.mesh, data)).collect(),
            Body::Scene(scene) => {
                let meshes = scene.meshes();
                let part = |(placed, data): (&PlacedMesh, &'a OwnedMeshData)| {
                    let m = &meshes[placed.index];
                    let (instances, scale, stretch) = (m.instances, m.scale, m.stretch);
                    let (system, places) = (placed.system, &m.places);
                    Part { instances, scale, stretch, system, places, ..of(&m.mesh, data) }
                };
                placed_meshes(meshes).iter().zip(data).map(part).collect()
            }
        }
    }

    /// Simplifies all meshes, with one target for all.
    ///
    /// # Errors
    /// Those of [`lodsmith::simplify_scene`].
    pub fn simplify(
        &self,
        options: &SimplifyOptions,
        data: &[OwnedMeshData],
        control: &mut dyn lodsmith::Control,
    ) -> Result<SimplifiedMeshes, SimplifyError> {
        match &self.body {
            Body::Mesh(loaded) => {
                let input = Input::new(&loaded.mesh).with(data[0].view());
                Ok(SimplifiedMeshes::of_mesh(lodsmith::simplify_with(input, options, control)?))
            }
            Body::Scene(_) => {
                let parts = self.parts(data);
                Ok(self.by_index(lodsmith::simplify_scene(&parts, self.diagonal(), options, control)?))
            }
        }
    }

    /// Makes levels of detail.
    ///
    /// # Errors
    /// Those of [`lodsmith::lod_scene`].
    pub fn levels(
        &self,
        options: &LodOptions,
        data: &[OwnedMeshData],
        control: &mut dyn lodsmith::Control,
    ) -> Result<Chain, SimplifyError> {
        match &self.body {
            Body::Mesh(loaded) => {
                let input = Input::new(&loaded.mesh).with(data[0].view());
                let chain = lodsmith::lod_with(&input, options, control)?;
                let geomorphs = (0..=chain.levels.len()).map(|k| vec![chain.geomorph(k).cloned()]).collect();
                let LodChain { levels, .. } = chain;
                Ok(Chain { levels: levels.into_iter().map(SimplifiedMeshes::of_mesh).collect(), geomorphs })
            }
            Body::Scene(scene) => {
                let parts = self.parts(data);
                let chain = lodsmith::lod_scene(&parts, self.diagonal(), options, control)?;
                let indices = self.simplified_meshes();
                let positions = |k: usize| {
                    let mut of_meshes = vec![None; scene.meshes().len()];
                    for (&i, positions) in indices.iter().zip(chain.geomorph(k).into_iter().flatten()) {
                        of_meshes[i] = Some(positions.clone());
                    }
                    of_meshes
                };
                let geomorphs = (0..=chain.levels.len()).map(positions).collect();
                let levels = chain.levels.into_iter().map(|level| self.by_index(level)).collect();
                Ok(Chain { levels, geomorphs })
            }
        }
    }

    /// Returns the result of a run on a scene, by the indices of its meshes.
    fn by_index(&self, result: SimplifiedScene) -> SimplifiedMeshes {
        let SimplifiedScene { meshes: simplified, mut report, counts } = result;
        let originals = self.meshes();
        let mut meshes = vec![None; originals.len()];
        let indices = self.simplified_meshes();
        // As in the file, before the reader merged vertices at equal positions.
        report.input_vertices = self.count(TriMesh::wedge_count);
        let counted = indices.iter().zip(counts).map(|(&i, mut counts)| {
            counts.input_vertices = originals[i].wedge_count();
            (i, counts)
        });
        let counts = counted.collect();
        for (&i, mesh) in indices.iter().zip(simplified) {
            meshes[i] = (originals[i].face_count() > 0).then_some(mesh);
        }
        SimplifiedMeshes { meshes, report, counts }
    }

    /// Converts a mesh to a scene, as writing and reading it would, and returns the data of its only mesh. A scene is
    /// not changed; returns the data of its meshes.
    ///
    /// # Errors
    /// [`AssetError::Name`] if a name is not found.
    pub(crate) fn become_scene(
        &mut self,
        names: &PartNames,
        writing: &Writing,
    ) -> Result<Vec<OwnedMeshData>, AssetError> {
        let Body::Mesh(loaded) = &self.body else { return self.named_data(names) };
        let of_mesh = constraints::of_mesh(names, loaded)?;
        let mut mesh = TriMesh::clone(&loaded.mesh);
        orient(&mut mesh, writing);
        let options = writing.mesh_options(Format::Glb, loaded.regions.clone());
        let (scene, lost) = Scene::of_mesh(&mesh, &options, self.head.reading.limits)?;
        let of_vertices = scene.meshes().first().map(|scene_mesh| vertices_of(scene_mesh, &mesh));
        let mut data = OwnedMeshData::default();
        if let Some(of) = of_vertices {
            data.locked = of_mesh.locked.map(|all| of.iter().map(|v| v.iter().any(|&v| all[v])).collect());
            data.importance = of_mesh.importance.map(|all| {
                of.iter().map(|v| v.iter().map(|&v| all[v]).reduce(f32::max).unwrap_or(1.0)).collect()
            });
            // (A value that is not a number stays one, so that it is reported.)
            let least = |x: f32, y: f32| if y.is_nan() || y < x { y } else { x };
            data.error_map = of_mesh.error_map.map(|all| {
                of.iter().map(|v| v.iter().map(|&v| all[v]).reduce(least).unwrap_or(1.0)).collect()
            });
        }
        self.head.warnings.extend(lost);
        (self.body, self.palettes) = (Body::Scene(Arc::new(scene)), Arc::default());
        Ok(vec![data])
    }

    /// Writes the asset with changes.
    ///
    /// # Errors
    /// [`AssetError::Write`], [`AssetError::Stream`]; [`AssetError::Cancelled`] if the caller ends.
    pub fn write(&self, edit: Edit, to: &Destination, job: &mut Job<'_>) -> Result<WriteOutcome, AssetError> {
        let scene = match (edit.scene, &self.body) {
            (Some(scene), _) => *scene,
            (None, Body::Scene(scene)) => Scene::clone(scene),
            (None, Body::Mesh(loaded)) => {
                let mesh = edit.meshes.into_iter().next().flatten();
                let mut mesh = mesh.unwrap_or_else(|| TriMesh::clone(&loaded.mesh));
                orient(&mut mesh, &to.writing);
                return to.write(&mesh, loaded.regions.clone(), job);
            }
        };
        let mut written = write_scene(scene, &self.head.source, edit.meshes, edit.is_baked, to, job)?;
        edit.moved.drop_warnings(&mut written.warnings);
        write_files(&edit.files, "", to, job)?;
        Ok(written)
    }
}

/// Writes a scene with some meshes replaced; if the format has no scenes, all instances are joined into one mesh.
fn write_scene(
    mut scene: Scene,
    source: &Source,
    mut replaced: Vec<Option<TriMesh>>,
    is_baked: bool,
    to: &Destination,
    job: &mut Job<'_>,
) -> Result<WriteOutcome, AssetError> {
    let folder_move = FolderMove::new(source, &to.sink);
    let mut warnings = folder_move.embed(&mut scene, to.format, to.writing.textures);
    if is_baked && !matches!(to.format, Format::Gltf | Format::Glb) {
        // Other formats have no tangents; viewers compute the same tangents.
        for mesh in replaced.iter_mut() {
            *mesh = mesh.take().map(|mesh| mesh.without_further(|semantic| *semantic == Semantic::Tangent));
        }
    }
    let mut written = if to.format.keeps_scenes() {
        if to.writing.moves() {
            scene.transform_build(rows_for_build(scene.format(), &to.writing));
        }
        to.write_scene(&scene, &replaced, &|uri| folder_move.uri(uri), job)?
    } else {
        let joined = scene.joined(&replaced)?;
        warnings.extend(joined.warnings);
        to.write(&joined.mesh, joined.regions, job)?
    };
    written.warnings.splice(0..0, warnings);
    Ok(written)
}

/// Returns, for each vertex of a mesh in a scene, the vertices at its position in `mesh`, which the scene was made
/// from.
fn vertices_of(scene_mesh: &SceneMesh, mesh: &TriMesh) -> Vec<Vec<usize>> {
    let translation = scene_mesh.world_from_mesh.map_or([0.0; 3], |m| m.map(|row| row[3]));
    // As in the written file: relative to the node, and with -0 as 0.
    let key = |p: [f64; 3], by: [f64; 3]| [0, 1, 2].map(|k| ((p[k] - by[k]) as f32 + 0.0).to_bits());
    let mut at: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
    for (v, p) in mesh.positions().view().iter().enumerate() {
        at.entry(key(p, translation)).or_default().push(v);
    }
    let positions = scene_mesh.mesh.positions().view();
    positions.iter().map(|p| at.get(&key(p, [0.0; 3])).cloned().unwrap_or_default()).collect()
}

impl SimplifiedMeshes {
    fn of_mesh(result: Simplified) -> Self {
        Self { meshes: vec![Some(result.mesh)], report: result.report, counts: Vec::new() }
    }
}

impl From<Scene> for Asset {
    fn from(scene: Scene) -> Self {
        let (format, warnings) = (scene.format(), scene.warnings().to_vec());
        Self::of(Body::Scene(Arc::new(scene)), format, warnings)
    }
}
