//! Simplification of files.

use lodsmith::{MeshCounts, OwnedMeshData, Report, SimplifyOptions};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, Sizes, Warning};
use serde_json::{Value, json};

use crate::asset::{Asset, Edit};
use crate::baking::{BakedScene, Baking};
use crate::constraints::{self, PartNames};
use crate::destination::{Destination, Writing};
use crate::error::{AssetError, usage};
use crate::job::{Job, StageClock, Step};
use crate::normals::Normals;
use crate::paths::{Sink, Source};
use crate::report_json::{self, mesh_json, seconds};
use crate::sizes::WriteOutcome;
use crate::warnings::{not_reached, starved, texts, warnings_of};

/// Instructions for simplifying a file.
#[derive(Clone, Debug, Default)]
pub struct Recipe {
    /// Options of the engine.
    pub options: SimplifyOptions,
    /// Names of locked and important parts of the file.
    pub names: PartNames,
    /// Locks and importance by vertex instead of by name: for the vertices of all simplified meshes, one after the
    /// other.
    pub vertices: Option<OwnedMeshData>,
    /// Normals of the result.
    pub normals: Normals,
    /// Maps to bake.
    pub baking: Option<Baking>,
}

/// A simplified file that is not written yet.
#[derive(Debug)]
pub struct Made {
    /// The asset that the edit is for.
    pub asset: Asset,
    /// The new meshes and materials.
    pub edit: Edit,
    /// The report of the engine.
    pub report: Report,
    /// Counts of the meshes that were simplified, with their names; empty for a single mesh.
    pub meshes: Vec<(String, MeshCounts)>,
    /// The reason why the target was not reached.
    pub not_reached: Option<String>,
    /// Warnings of the run.
    pub warnings: Vec<Warning>,
    /// The result of baking, without the parts that are in `edit`.
    pub baked: Option<BakedScene>,
}

impl Recipe {
    /// Checks that the recipe has a target or an option that ends the method, and that its maps are compatible with the
    /// output and the options of writing.
    ///
    /// # Errors
    /// [`AssetError::Usage`].
    pub fn check(&self, writing: &Writing, output: Option<&Sink>) -> Result<(), AssetError> {
        if !self.options.has_end() {
            return Err(usage(
                "give a target (--faces, --vertices, --ratio, --error) or an option that ends the method",
            ));
        }
        self.baking.as_ref().map_or(Ok(()), |baking| baking.check(writing, output))
    }

    /// Simplifies the meshes of an asset, keeps or recomputes their normals, and bakes. `to` is where the result will
    /// be written.
    ///
    /// If maps are baked for a single mesh, it first becomes a scene, whose materials get the maps.
    ///
    /// # Errors
    /// [`AssetError::Name`], [`AssetError::Memory`], [`AssetError::Simplify`], [`AssetError::Bake`];
    /// [`AssetError::Cancelled`] if the caller ends.
    pub fn run(
        &self,
        mut asset: Asset,
        to: Option<&Destination>,
        job: &mut Job<'_>,
    ) -> Result<Made, AssetError> {
        let becomes_scene = self.baking.is_some();
        let (data, mut warnings) =
            asset.prepare(&self.names, self.vertices.as_ref(), becomes_scene, to, &self.options)?;
        job.check_memory("simplify", asset.need(&self.options, &data))?;
        let mut simplified = asset.simplify(&self.options, &data, job)?;
        let results = simplified.meshes.iter().flatten();
        let not_reached = not_reached(&simplified.report, &self.options, job.time_limit(), results);
        for mesh in simplified.meshes.iter_mut().flatten() {
            self.normals.apply(mesh);
        }
        warnings.extend(warnings_of(&simplified.report));
        let counts: Vec<MeshCounts> = simplified.counts.iter().map(|(_, counts)| *counts).collect();
        warnings.extend(starved(&counts));
        let mut edit = Edit { meshes: simplified.meshes, ..Edit::default() };
        let baked = match (&self.baking, asset.scene()) {
            (Some(baking), Some(scene)) => {
                job.enter(Step::Bake);
                let baked = edit.bake(scene.clone(), baking, job)?;
                warnings.extend(baked.warnings.iter().cloned());
                Some(baked)
            }
            _ => None,
        };
        let name = |(i, counts)| (asset.name(i).unwrap_or_default().to_owned(), counts);
        let meshes = simplified.counts.into_iter().map(name).collect();
        Ok(Made { asset, edit, report: simplified.report, meshes, not_reached, warnings, baked })
    }
}

impl Edit {
    /// Bakes maps of a scene for its new meshes, and assigns materials with these maps to the meshes.
    ///
    /// # Errors
    /// [`AssetError::Bake`]; [`AssetError::Cancelled`] if the caller ends.
    pub fn bake(
        &mut self,
        mut scene: Scene,
        baking: &Baking,
        job: &mut Job<'_>,
    ) -> Result<BakedScene, AssetError> {
        let mut baking = baking.clone();
        baking.options.is_same_model = true;
        let (high, unread) = scene.model();
        let low = lodsmith_bake::model_with(&high, &self.meshes);
        let mut baked = baking.bake(&high, &low, &mut scene, job)?;
        // Maps show the model at rest: they lack its images that were not read, but not its animations.
        baked.warnings.splice(0..0, unread.into_iter().filter(|warning| warning.data_lost));
        for (mesh, made) in self.meshes.iter_mut().zip(std::mem::take(&mut baked.replaced)) {
            if made.is_some() {
                *mesh = made;
            }
        }
        lodsmith_bake::set_materials(&mut scene, &baked.materials);
        scene.drop_unused_materials();
        self.files = std::mem::take(&mut baked.files);
        self.scene = Some(Box::new(scene));
        (self.is_baked, self.moved) = (true, baking.moved());
        Ok(baked)
    }
}

/// Outcome of simplifying a file.
#[derive(Debug)]
pub struct Outcome {
    /// Format of the input.
    pub input_format: Format,
    /// Sizes of the input; `None` if they are not known.
    pub sizes_before: Option<Sizes>,
    /// The report of the engine.
    pub report: Report,
    /// Counts of the meshes that were simplified, with their names; empty for a single mesh.
    pub meshes: Vec<(String, MeshCounts)>,
    /// The reason why the target was not reached.
    pub not_reached: Option<String>,
    /// Warnings of reading, of the run and of writing.
    pub warnings: Vec<Warning>,
    /// Report of the bake.
    pub baked: Option<Value>,
    /// The outcome of writing, without its warnings.
    pub written: WriteOutcome,
    /// Number of threads of the pool.
    pub threads: usize,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads a file, simplifies it, and writes it.
///
/// # Errors
/// Those of [`Asset::read`], [`Recipe::run`] and [`Asset::write`].
pub fn simplify(
    source: &Source,
    reading: &ReadOptions,
    recipe: &Recipe,
    to: Option<&Destination>,
    job: &mut Job<'_>,
) -> Result<Outcome, AssetError> {
    let writing = to.map_or_else(Writing::default, |to| to.writing);
    recipe.check(&writing, to.map(|to| &to.sink))?;
    job.enter(Step::Read);
    let mut reading = reading.clone();
    reading.properties = constraints::properties(&recipe.names);
    // Without an output, nothing is baked.
    let recipe = &Recipe { baking: recipe.baking.clone().filter(|_| to.is_some()), ..recipe.clone() };
    let is_scene = recipe.baking.is_some() || to.is_some_and(Destination::keeps_scenes);
    let asset = Asset::read(source, &reading, is_scene, job)?;
    job.enter(Step::Prepare);
    let (input_format, sizes_before) = (asset.format(), asset.sizes());
    let Made { asset, edit, report, meshes, not_reached, warnings: of_run, baked } =
        recipe.run(asset, to, job)?;
    let mut warnings = asset.warnings().to_vec();
    warnings.extend(of_run);
    job.enter(Step::Write);
    let mut written = match to {
        Some(to) => asset.write(edit, to, job)?,
        None => WriteOutcome::default(),
    };
    warnings.append(&mut written.warnings);
    Ok(Outcome {
        input_format,
        sizes_before,
        report,
        meshes,
        not_reached,
        warnings,
        baked: baked.map(|baked| baked.report),
        written,
        threads: rayon::current_num_threads(),
        clock: job.times(),
    })
}

impl Outcome {
    /// Returns the report, with this path of the input.
    pub fn to_json(&self, path: &str, recipe: &Recipe, to: Option<&Destination>, dry_run: bool) -> Value {
        let r = &self.report;
        let mut of_run = report_json::run(r, &recipe.options);
        for end in ["input", "output"] {
            let _ = report_json::take(&mut of_run, end);
        }
        let input = [r.input_faces, r.input_vertices];
        let mut report = json!({
            "input": report_json::file(path.into(), Some(self.input_format), input, self.sizes_before),
            "output": report_json::output(to, [r.faces, r.vertices], &self.written),
        });
        // The order of the first keys is promised.
        for key in ["method", "target", "reached", "stopped_by", "error", "refusals"] {
            report[key] = report_json::take(&mut of_run, key);
        }
        report["warnings"] = texts(&self.warnings).into();
        report["threads"] = self.threads.into();
        report["seconds"] = seconds(&self.clock);
        report_json::extend(&mut report, of_run);
        if !self.meshes.is_empty() {
            report["meshes"] = self.meshes.iter().map(mesh_json).collect();
        }
        if let Some(baked) = &self.baked {
            report["baked"] = baked.clone();
        }
        if dry_run {
            report["dry_run"] = true.into();
        }
        report
    }
}
