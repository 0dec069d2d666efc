//! Plan of levels and their output: one file, or one for each level and a list of them.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use lodsmith::core::{Attribute, Positions, Semantic, TriMesh};
use lodsmith::{Method, Screen};
use lodsmith_io::gltf::{Scene, SceneLevels, SceneMesh};
use lodsmith_io::{Format, Regions};
use serde_json::Value;

use super::bake::BakedLevels;
use crate::args::{LodArgs, Naming};
use crate::baking;
use crate::file::{self, Destination};
use crate::paths::{self, Sink, Source};
use crate::plan::{self, Job};
use crate::sizes::WriteOutcome;
use crate::status::usage;

/// Attribute with the position of a vertex in the next level.
const GEOMORPH_ATTRIBUTE: &str = "_GEOMORPH";
/// The list of levels in a folder.
const LIST_FILE: &str = "lods.json";

/// Levels to make and their output, determined before any work.
pub(super) struct Plan {
    /// The input, and the output of the first level.
    pub(super) job: Job,
    /// Set if each level has a file of its own.
    pub(super) folder: Option<LevelFolder>,
    pub(super) screen: Screen,
    /// Factor from lengths of the engine to those of the output.
    pub(super) scale: f64,
    pub(super) method: Method,
    /// The target, for reports.
    pub(super) target: Value,
    naming: Naming,
}

impl Plan {
    /// Determines the output from the command line.
    ///
    /// # Errors
    /// If the command line is at fault.
    pub(super) fn new(args: &LodArgs) -> anyhow::Result<Self> {
        let template =
            args.name.clone().unwrap_or_else(|| format!("{{stem}}{}{{level}}.{{ext}}", args.naming.mark()));
        if args.out_dir.is_some() && !template.contains("{level}") {
            return Err(usage(format!(
                "--name {template}: {{level}} is missing, so all levels would be one file"
            )));
        }
        // The rest of the template is checked like that of any output folder; a level is a number.
        let first = template.replace("{level}", "0");
        let job = plan::jobs(&args.wanted(&first))?.remove(0);
        baking::check(&args.baking, &args.writing, args.output.as_ref())?;
        let folder = match (&args.out_dir, &job.output) {
            (None, Some(Destination { sink, format, .. }))
                if !matches!(format, Format::Gltf | Format::Glb) =>
            {
                return Err(usage(format!(
                    "{sink}: one file holds all levels as GLB or glTF only; give a folder with -O for {}",
                    format.title()
                )));
            }
            (Some(path), Some(to)) => Some(LevelFolder::new(path, &template, to)?),
            _ => None,
        };
        Ok(Self {
            job,
            folder,
            screen: args.screen(),
            scale: args.writing.scale.unwrap_or(1.0),
            method: args.options().simplify.method,
            target: args.target(),
            naming: args.naming,
        })
    }

    /// Returns the first output if it is glTF.
    pub(super) fn scenes(&self) -> Option<&Destination> {
        self.job.output.as_ref().filter(|to| matches!(to.format, Format::Gltf | Format::Glb))
    }

    /// Returns the outputs of the original and of this many levels below; none if nothing is asked for.
    pub(super) fn outputs(&self, levels: usize) -> Vec<Sink> {
        let sink = |level, first: &Sink| match &self.folder {
            Some(folder) => Sink::Path(folder.path.join(folder.file(level))),
            None => first.clone(),
        };
        self.job.output.iter().flat_map(|to| (0..=levels).map(|k| sink(k, &to.sink))).collect()
    }

    /// Writes the levels of a mesh, each to its file.
    pub(super) fn write_meshes(
        &self,
        meshes: &[TriMesh],
        regions: &Regions,
    ) -> anyhow::Result<Vec<WriteOutcome>> {
        self.write_each(meshes, |mesh, to| to.write(mesh, regions.clone()))
    }

    /// Writes the levels of a scene; `replaced` are the meshes of each level, including the first.
    pub(super) fn write_scene(
        &self,
        scene: &Scene,
        replaced: Vec<Vec<Option<TriMesh>>>,
        baked: &BakedLevels,
        distances: &[f64],
        relink: &dyn Fn(&str) -> Option<String>,
    ) -> anyhow::Result<Vec<WriteOutcome>> {
        match &self.job.output {
            Some(to) if self.folder.is_none() => {
                let mut levels = SceneLevels::new(replaced);
                levels.separator = self.naming.mark().to_owned();
                levels.numbers_level_0 = self.naming != Naming::Plain;
                levels.coverage = coverage(scene, distances, &self.screen);
                levels.default_name = name_of_input(&self.job.source, &to.sink);
                levels.materials = baked.materials.clone();
                let made = to.write_levels(scene, &levels, relink)?;
                for (level, files) in baked.files.iter().enumerate() {
                    let mark = format!("{}{}", self.naming.mark(), level + 1);
                    baking::write_files(files, if baked.is_shared { "" } else { &mark }, to)?;
                }
                Ok(vec![made])
            }
            _ if baked.materials.is_empty() => {
                self.write_each(&replaced, |replaced, to| to.write_scene(scene, replaced, relink))
            }
            _ => {
                let levels: Vec<_> = replaced.into_iter().enumerate().collect();
                self.write_each(&levels, |(k, replaced), to| {
                    let mut own = scene.clone();
                    if let Some(materials) = k.checked_sub(1).and_then(|k| baked.materials.get(k)) {
                        lodsmith_bake::set_materials(&mut own, materials);
                    }
                    own.drop_unused_materials();
                    if let Some(files) = k.checked_sub(1).and_then(|k| baked.files.get(k)) {
                        baking::write_files(files, "", to)?;
                    }
                    baking::write_baked(to, &own, replaced, relink)
                })
            }
        }
    }

    /// Writes each level to its file; returns the outcome of each. Each warning is in the first that has it.
    fn write_each<T>(
        &self,
        levels: &[T],
        write: impl Fn(&T, &Destination) -> anyhow::Result<WriteOutcome>,
    ) -> anyhow::Result<Vec<WriteOutcome>> {
        let Some(mut to) = self.job.output.clone() else { return Ok(Vec::new()) };
        let mut all: Vec<WriteOutcome> = Vec::new();
        for (level, sink) in levels.iter().zip(self.outputs(levels.len())) {
            to.sink = sink;
            paths::refuse_inputs(&to.sink, [&self.job.source], to.writing.force || to.dry_run)?;
            let mut made = write(level, &to)?;
            made.warnings.retain(|w| !all.iter().any(|before| before.warnings.contains(w)));
            all.push(made);
        }
        Ok(all)
    }

    /// Writes the list of levels.
    pub(super) fn write_list(&self, list: &Value) -> anyhow::Result<()> {
        match (&self.folder, &self.job.output) {
            (Some(folder), Some(to)) if !to.dry_run => {
                let text = format!("{list:#}\n");
                file::write_bytes(text.as_bytes(), &folder.path.join(LIST_FILE), to.writing.force)
            }
            _ => Ok(()),
        }
    }
}

/// A folder with a file for each level.
pub(super) struct LevelFolder {
    pub(super) path: PathBuf,
    /// Its names, with a placeholder for the level.
    template: String,
}

impl LevelFolder {
    /// Creates the folder, if the output of the first level shows that the template can name all of them.
    fn new(folder: &Path, template: &str, first: &Destination) -> anyhow::Result<Self> {
        let path = match &first.sink {
            Sink::Path(path) => path.as_path(),
            Sink::Stdout => Path::new(""),
        };
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        // The name of level 0, with a placeholder where the template has the number.
        let (before, after) = template.split_once("{level}").unwrap_or((template, ""));
        let is_stem_before = before.contains("{stem}");
        let tail = after.replace("{ext}", path.extension().and_then(|e| e.to_str()).unwrap_or_default());
        let template = match name.strip_suffix(&tail).filter(|_| !tail.contains("{stem}")) {
            Some(head) if is_stem_before || !after.contains("{stem}") => {
                format!("{}{{level}}{tail}", head.strip_suffix('0').unwrap_or(head))
            }
            _ => return Err(usage(format!("--name {template}: {{stem}} comes before {{level}}"))),
        };
        if !first.dry_run {
            fs::create_dir_all(folder)
                .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        }
        Ok(Self { path: folder.to_owned(), template })
    }

    /// Returns the file name of a level.
    fn file(&self, level: usize) -> String {
        self.template.replace("{level}", &level.to_string())
    }
}

/// Returns for each mesh and level the fraction of the picture's height that the bounding sphere of the mesh
/// covers at the distance where the next level is used.
fn coverage(scene: &Scene, distances: &[f64], screen: &Screen) -> Vec<Vec<f64>> {
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

/// Adds to a mesh the positions of its vertices in the next level, each mapped by `place`.
pub(super) fn carry(
    mesh: &mut TriMesh,
    geomorph: &Positions,
    place: impl Fn([f64; 3]) -> [f64; 3],
) -> anyhow::Result<()> {
    let wedges = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(lodsmith::core::WedgeId::new(w)));
    let values = wedges.flat_map(|v| place(geomorph.view().get(v)).map(|x| x as f32)).collect();
    let semantic = Semantic::Custom(GEOMORPH_ATTRIBUTE.to_owned());
    mesh.add_attribute(Attribute { semantic, width: 3, values })?;
    Ok(())
}

/// Returns the name of the input without its extension, or that of the output for standard input.
fn name_of_input(input: &Source, sink: &Sink) -> Option<String> {
    let path = match (input, sink) {
        (Source::Path(path), _) | (Source::Stdin, Sink::Path(path)) => path,
        (Source::Stdin, Sink::Stdout) => return None,
    };
    let is_packed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let path = if is_packed { path.with_extension("") } else { path.clone() };
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned())
}
