//! Levels of detail of files.

mod bake;
mod outputs;
mod report;

use lodsmith::{LodOptions, MeshCounts, Report, Screen};
use lodsmith_core::{Attribute, Positions, Semantic, TriMesh, WedgeId};
use lodsmith_io::gltf::{Scene, SceneLevels, SceneMesh};
use lodsmith_io::{Format, ReadOptions, Sizes, Warning};

pub use outputs::{LevelOutputs, Naming};

use crate::asset::{Asset, Chain, Edit};
use crate::baking::{Baking, MovedIntoMaps, write_files};
use crate::constraints::{self, PartNames};
use crate::destination::{Destination, Writing};
use crate::error::AssetError;
use crate::images::FolderMove;
use crate::job::{Job, StageClock, Step};
use crate::normals::Normals;
use crate::orient::oriented;
use crate::paths::{self, Sink, Source};
use crate::sizes::WriteOutcome;
use crate::warnings::{not_reached, starved};
use bake::{BakedLevels, bake_levels};

/// Attribute with the position of a vertex in the next level.
const GEOMORPH_ATTRIBUTE: &str = "_GEOMORPH";

/// Instructions for making levels of detail.
#[derive(Clone, Debug)]
pub struct LodRecipe {
    /// Options of the engine.
    pub options: LodOptions,
    /// Names of locked and important parts of the file.
    pub names: PartNames,
    /// Normals of the levels.
    pub normals: Normals,
    /// Maps to bake.
    pub baking: Option<Baking>,
    /// The screen for which switching distances are computed.
    pub screen: Screen,
    /// Naming of files, meshes and nodes.
    pub naming: Naming,
}

/// Outcome of making levels.
#[derive(Debug)]
pub struct LodOutcome {
    /// Format of the input.
    pub input_format: Format,
    /// Faces and vertices of level 0.
    pub counts: [usize; 2],
    /// The levels below the original.
    pub levels: Vec<Level>,
    /// The outputs of all levels, from level 0 on; empty if nothing is written.
    pub outputs: Vec<Sink>,
    /// Sizes of the input; `None` if they are not known.
    pub sizes_before: Option<Sizes>,
    /// Outcomes of writing, without their warnings: one for a single file, else one for each level from level 0 on.
    pub written: Vec<WriteOutcome>,
    /// Diagonal of the bounding box of the original.
    pub diagonal: f64,
    /// Warnings of reading, of the run and of writing.
    pub warnings: Vec<Warning>,
    /// Number of threads of the pool.
    pub threads: usize,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// A level below the original.
#[derive(Debug)]
pub struct Level {
    /// The report of the engine.
    pub report: Report,
    /// The reason why its target was not reached.
    pub not_reached: Option<String>,
    /// The distance from which on the level looks like the original, at the scale of the output; `None` if the time limit
    /// left no time to measure it.
    pub distance: Option<f64>,
    /// Counts of the meshes that were simplified, with their names; empty for a single mesh.
    pub meshes: Vec<(String, MeshCounts)>,
}

/// Reads a file, makes levels, and writes them.
///
/// # Errors
/// Those of [`simplify`](crate::simplify()); [`AssetError::Levels`] for a scene that has levels already.
pub fn lod(
    outputs: &LevelOutputs,
    reading: &ReadOptions,
    recipe: &LodRecipe,
    job: &mut Job<'_>,
) -> Result<LodOutcome, AssetError> {
    job.enter(Step::Read);
    let mut reading = reading.clone();
    reading.properties = constraints::properties(&recipe.names);
    let is_scene =
        outputs.first.as_ref().is_some_and(|to| recipe.baking.is_some() || Destination::keeps_scenes(to));
    let asset = Asset::read(&outputs.source, &reading, is_scene, job)?;
    recipe.run(asset, outputs, job)
}

impl LodRecipe {
    /// Makes levels of a file, and writes them.
    ///
    /// # Errors
    /// Those of [`lod`].
    pub fn run(
        &self,
        mut asset: Asset,
        outputs: &LevelOutputs,
        job: &mut Job<'_>,
    ) -> Result<LodOutcome, AssetError> {
        job.enter(Step::Prepare);
        let to = outputs.first.as_ref();
        let writing = to.map_or_else(Writing::default, |to| to.writing);
        let baking = self.baking.as_ref().filter(|_| to.is_some());
        let (input_format, counts, sizes_before) = (asset.format(), asset.counts(), asset.sizes());
        // For glTF outputs, a mesh becomes a scene, so that its levels are levels of a scene.
        let is_gltf = to.is_some_and(|to| matches!(to.format, Format::Gltf | Format::Glb));
        let becomes_scene = baking.is_some() || is_gltf;
        let options = &self.options.simplify;
        let (data, of_run) = asset.prepare(&self.names, None, becomes_scene, to, options)?;
        if asset.scene().is_some_and(Scene::has_levels) {
            return Err(AssetError::Levels);
        }
        let mut warnings = asset.warnings().to_vec();
        warnings.extend(of_run);
        job.check_memory("lod", asset.levels_need(options, &data))?;
        let Chain { levels: made, geomorphs } = asset.levels(&self.options, &data, job)?;

        // Only the first level with such meshes is reported: later levels have even fewer faces.
        let starved = made.iter().enumerate().find_map(|(k, level)| {
            let counts: Vec<_> = level.counts.iter().map(|(_, counts)| *counts).collect();
            Some(Warning::note(format!("level {}: {}", k + 1, starved(&counts)?)))
        });
        warnings.extend(starved);
        // A mesh that became a scene is scaled already.
        let scale = if is_gltf { 1.0 } else { writing.scale.unwrap_or(1.0) };
        let mut levels = Vec::with_capacity(made.len());
        let mut meshes = vec![geomorphed_originals(&asset, &geomorphs[0])];
        for level in made {
            let not_reached =
                not_reached(&level.report, options, job.time_limit(), level.meshes.iter().flatten());
            let name = |(i, counts)| (asset.name(i).unwrap_or_default().to_owned(), counts);
            levels.push(Level {
                not_reached,
                distance: lodsmith::lod::error_of(&level.report)
                    .map(|error| self.screen.distance(error) * scale),
                report: level.report,
                meshes: level.counts.into_iter().map(name).collect(),
            });
            let mut of_level = level.meshes;
            of_level.iter_mut().flatten().for_each(|mesh| self.normals.apply(mesh));
            meshes.push(of_level);
        }
        for (of_level, geomorphs) in meshes.iter_mut().zip(&geomorphs) {
            for (mesh, positions) in of_level.iter_mut().zip(geomorphs) {
                if let (Some(mesh), Some(positions)) = (mesh, positions) {
                    let transform = |p| if asset.scene().is_some() { p } else { oriented(p, &writing) };
                    add_geomorph(mesh, positions, transform)?;
                }
            }
        }
        let mut scene = asset.scene().cloned();
        let baked = match (baking, &mut scene) {
            (Some(baking), Some(scene)) => {
                job.enter(Step::Bake);
                let mut baked = bake_levels(scene, &mut meshes, baking, job)?;
                warnings.append(&mut baked.warnings);
                Some(baked)
            }
            _ => None,
        };
        job.enter(Step::Write);
        let mut writer = ChainWriter { asset: &asset, scene, meshes, baked, outputs, recipe: self };
        let distances: Option<Vec<f64>> = levels.iter().map(|level| level.distance).collect();
        let mut written = writer.write(distances.as_deref(), job)?;
        warnings.extend(written.iter_mut().flat_map(|made| std::mem::take(&mut made.warnings)));
        if let (true, None, Some(to)) = (self.options.geomorph, asset.scene(), to)
            && to.format != Format::Ply
        {
            warnings
                .push(Warning::lost(format!("{} cannot store geomorph data: dropped", to.format.title())));
        }
        let of_run = levels.first().map_or(0.0, |level| level.report.error.diagonal);
        let outcome = LodOutcome {
            input_format,
            counts,
            outputs: outputs.sinks(levels.len()),
            levels,
            sizes_before,
            written,
            diagonal: if asset.scene().is_some() { asset.diagonal() } else { of_run },
            warnings,
            threads: rayon::current_num_threads(),
            clock: job.times(),
        };
        outputs.write_list(&outcome.list(&outputs.source, self, scale), job)?;
        Ok(outcome)
    }
}

/// Returns copies of the original meshes that geomorph to the first level.
fn geomorphed_originals(asset: &Asset, geomorphs: &[Option<Positions>]) -> Vec<Option<TriMesh>> {
    let original = |(mesh, positions): (&TriMesh, &Option<Positions>)| {
        (positions.is_some() && mesh.face_count() > 0).then(|| mesh.clone())
    };
    asset.meshes().into_iter().zip(geomorphs).map(original).collect()
}

/// Adds to a mesh the positions of its vertices in the next level, after `transform`.
fn add_geomorph(
    mesh: &mut TriMesh,
    geomorph: &Positions,
    transform: impl Fn([f64; 3]) -> [f64; 3],
) -> Result<(), AssetError> {
    let wedges = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(WedgeId::new(w)));
    let values = wedges.flat_map(|v| transform(geomorph.view().get(v)).map(|x| x as f32)).collect();
    let semantic = Semantic::Custom(GEOMORPH_ATTRIBUTE.to_owned());
    mesh.add_attribute(Attribute { semantic, width: 3, values })?;
    Ok(())
}

/// Writes all levels.
struct ChainWriter<'a> {
    asset: &'a Asset,
    /// The scene, with the materials of baking.
    scene: Option<Scene>,
    /// For each level, from level 0 on, the meshes that differ from the meshes of the asset.
    meshes: Vec<Vec<Option<TriMesh>>>,
    baked: Option<BakedLevels>,
    outputs: &'a LevelOutputs,
    recipe: &'a LodRecipe,
}

impl ChainWriter<'_> {
    /// Writes the levels to one file, or each to its own file; without coverages, if not all distances are known.
    fn write(
        &mut self,
        distances: Option<&[f64]>,
        job: &mut Job<'_>,
    ) -> Result<Vec<WriteOutcome>, AssetError> {
        match (&self.outputs.first, &mut self.scene) {
            (None, _) => Ok(Vec::new()),
            (Some(to), Some(scene)) if self.outputs.folder.is_none() => {
                let folder_move = FolderMove::new(&self.outputs.source, &to.sink);
                let warnings = folder_move.embed(scene, to.format, to.writing.textures);
                let naming = self.recipe.naming;
                let mut levels = SceneLevels::new(std::mem::take(&mut self.meshes));
                levels.separator = naming.mark().to_owned();
                levels.numbers_level_0 = naming != Naming::Plain;
                levels.coverage = distances
                    .map_or_else(Vec::new, |distances| coverage(scene, distances, &self.recipe.screen));
                levels.default_name = name_of_input(&self.outputs.source, &to.sink);
                let baked = self.baked.take().unwrap_or_default();
                levels.materials = baked.materials;
                let mut made = to.write_levels(scene, &levels, &|uri| folder_move.uri(uri), job)?;
                made.warnings.splice(0..0, warnings);
                self.moved().drop_warnings(&mut made.warnings);
                for (level, files) in baked.files.iter().enumerate() {
                    let mark = format!("{}{}", naming.mark(), level + 1);
                    write_files(files, if baked.is_shared { "" } else { &mark }, to, job)?;
                }
                Ok(vec![made])
            }
            (Some(to), _) => {
                let mut to = to.clone();
                let sinks = self.outputs.sinks(self.meshes.len());
                let mut all: Vec<WriteOutcome> = Vec::new();
                for (k, sink) in (0..self.meshes.len()).zip(sinks) {
                    to.sink = sink;
                    let mut made = self.asset.write(self.edit(k), &to, job)?;
                    // Each warning is reported once.
                    made.warnings.retain(|w| !all.iter().any(|before| before.warnings.contains(w)));
                    all.push(made);
                }
                Ok(all)
            }
        }
    }

    fn moved(&self) -> MovedIntoMaps {
        self.recipe.baking.as_ref().map(Baking::moved).unwrap_or_default()
    }

    /// Returns the changes of the asset that make a level.
    fn edit(&mut self, level: usize) -> Edit {
        let mut edit = Edit { meshes: std::mem::take(&mut self.meshes[level]), ..Edit::default() };
        if let (Some(baked), Some(scene)) = (&self.baked, &self.scene) {
            let mut scene = scene.clone();
            let baked_level = level.checked_sub(1);
            if let Some(materials) = baked_level.and_then(|k| baked.materials.get(k)) {
                lodsmith_bake::set_materials(&mut scene, materials);
            }
            scene.drop_unused_materials();
            edit.files = baked_level.and_then(|k| baked.files.get(k)).cloned().unwrap_or_default();
            edit.scene = Some(Box::new(scene));
            (edit.is_baked, edit.moved) = (true, self.moved());
        }
        edit
    }
}

/// Returns, for each mesh and level, the fraction of the screen height that the bounding sphere of the mesh covers
/// at the distance where the next level is used. `distances` are in the units of the scene.
pub fn coverage(scene: &Scene, distances: &[f64], screen: &Screen) -> Vec<Vec<f64>> {
    let of_mesh = |m: &SceneMesh| {
        let diameter = m.largest_diagonal();
        let mut all: Vec<f64> = Vec::with_capacity(distances.len() + 1);
        for &distance in distances {
            let share = if distance > 0.0 { screen.coverage(diameter, distance).min(1.0) } else { 1.0 };
            all.push(share.min(all.last().copied().unwrap_or(1.0)));
        }
        // The last level is used at any distance.
        all.push(0.0);
        all
    };
    scene.meshes().iter().map(of_mesh).collect()
}

/// Returns the name of the input without its extension; for standard input, the name of the output.
fn name_of_input(input: &Source, sink: &Sink) -> Option<String> {
    let path = match (input, sink) {
        (Source::Path(path), _) | (Source::Stream, Sink::Path(path)) => path,
        (Source::Stream, Sink::Stream) => return None,
    };
    Some(paths::stem(path))
}
