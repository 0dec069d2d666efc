//! Output files of levels: one file, or one for each level and a list of them.

use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;

use anyhow::Context as _;
use lodsmith::core::{Attribute, Positions, Semantic, TriMesh};
use lodsmith_io::gltf::{Scene, SceneLevels, SceneMesh};
use lodsmith_io::{Format, Regions, Warning};

use crate::args::{LodArgs, Naming};
use crate::file;
use crate::paths::{self, Sink, Source};
use crate::plan::{self, OutputArgs};
use crate::status::usage;

/// Attribute with the position of a vertex in the next level.
const GEOMORPH_ATTRIBUTE: &str = "_GEOMORPH";
/// The list of levels in a folder.
const LIST_FILE: &str = "lods.json";

/// Output of levels, determined before any work.
pub(super) enum Plan {
    /// All levels in one file.
    One(Sink, Format),
    /// Each level in a file of this folder; the template gives its name by its number.
    Each { folder: PathBuf, template: String, format: Format },
    /// No output.
    Nowhere,
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
        let jobs = plan::jobs(&OutputArgs {
            inputs: std::slice::from_ref(&args.input),
            output: args.output.as_ref(),
            out_dir: args.out_dir.as_deref(),
            name: &first,
            from: args.reading.from,
            to: args.writing.to,
            json: args.ending.json,
            dry_run: args.dry_run,
            force: args.writing.force,
        })?;
        let Some((sink, format)) = jobs.into_iter().find_map(|job| job.output) else {
            return Ok(Self::Nowhere);
        };
        let Some(folder) = &args.out_dir else {
            if !matches!(format, Format::Gltf | Format::Glb) {
                return Err(usage(format!(
                    "{sink}: one file holds all levels as GLB or glTF only; give a folder with -O for {}",
                    format.title()
                )));
            }
            return Ok(Self::One(sink, format));
        };
        let Sink::Path(path) = &sink else { return Ok(Self::Nowhere) };
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        // The name of level 0, with a placeholder where the template has the number.
        let (before, after) = template.split_once("{level}").unwrap_or((&template, ""));
        let is_stem_before = before.contains("{stem}");
        let tail = after.replace("{ext}", path.extension().and_then(|e| e.to_str()).unwrap_or_default());
        let template = match name.strip_suffix(&tail).filter(|_| !tail.contains("{stem}")) {
            Some(head) if is_stem_before || !after.contains("{stem}") => {
                format!("{}{{level}}{tail}", head.strip_suffix('0').unwrap_or(head))
            }
            _ => return Err(usage(format!("--name {template}: {{stem}} comes before {{level}}"))),
        };
        if !args.dry_run {
            fs::create_dir_all(folder)
                .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        }
        Ok(Self::Each { folder: folder.clone(), template, format })
    }

    pub(super) fn takes_stdout(&self) -> bool {
        matches!(self, Self::One(Sink::Stdout, _))
    }

    pub(super) fn format(&self) -> Option<Format> {
        match self {
            Self::One(_, format) | Self::Each { format, .. } => Some(*format),
            Self::Nowhere => None,
        }
    }

    /// Returns true if the output is glTF.
    pub(super) fn makes_scenes(&self) -> bool {
        matches!(self.format(), Some(Format::Gltf | Format::Glb))
    }

    /// Returns the file name of a level, in the folder.
    pub(super) fn file(&self, level: usize) -> Option<String> {
        match self {
            Self::Each { template, .. } => Some(template.replace("{level}", &level.to_string())),
            _ => None,
        }
    }

    /// Returns the output of a level, as typed.
    pub(super) fn sink(&self, level: usize) -> Option<Sink> {
        match self {
            Self::One(sink, _) => Some(sink.clone()),
            Self::Each { folder, .. } => self.file(level).map(|name| Sink::Path(folder.join(name))),
            Self::Nowhere => None,
        }
    }

    /// Returns the first output.
    pub(super) fn first_sink(&self) -> Sink {
        self.sink(0).unwrap_or(Sink::Stdout)
    }

    /// Writes the levels of a mesh, each to its file. Each warning about data that the format cannot hold is
    /// returned once.
    pub(super) fn write_meshes(
        &self,
        meshes: &[TriMesh],
        regions: &Regions,
        args: &LodArgs,
    ) -> anyhow::Result<Vec<Warning>> {
        let mut warnings = Vec::new();
        for (k, mesh) in meshes.iter().enumerate() {
            let (Some(sink), Some(format)) = (self.sink(k), self.format()) else { break };
            paths::refuse_inputs(&sink, [&args.input], args.writing.force || args.dry_run)?;
            let options = file::options(&args.writing, format, regions.clone());
            add(
                &mut warnings,
                match args.dry_run {
                    true => file::losses(mesh, &sink, format, &options)?,
                    false => file::write(mesh, &sink, format, &options)?,
                },
            );
        }
        if args.geomorph && self.format().is_some_and(|f| f != Format::Ply) {
            let title = self.format().map_or("the format", Format::title);
            warnings.push(Warning::lost(format!("{title} cannot carry geomorph data: dropped")));
        }
        Ok(warnings)
    }

    /// Writes the levels of a scene; `replaced` are the meshes of each level, including the first.
    pub(super) fn write_scene(
        &self,
        scene: &Scene,
        replaced: Vec<Vec<Option<TriMesh>>>,
        distances: &[f64],
        relink: &dyn Fn(&str) -> Option<String>,
        args: &LodArgs,
    ) -> anyhow::Result<Vec<Warning>> {
        let mut warnings = Vec::new();
        match self {
            Self::Nowhere => {}
            Self::One(sink, format) => {
                let mut levels = SceneLevels::new(replaced);
                levels.separator = args.naming.mark().to_owned();
                levels.numbers_level_0 = args.naming != Naming::Plain;
                levels.coverage = coverage(scene, distances, args);
                levels.default_name = name_of_input(&args.input, sink);
                warnings = match args.dry_run {
                    true => file::levels_losses(scene, &levels, relink, *format)?,
                    false => file::write_levels(scene, &levels, relink, sink, *format, &args.writing)?,
                };
            }
            Self::Each { format, .. } => {
                for (k, replaced) in replaced.iter().enumerate() {
                    let Some(sink) = self.sink(k) else { break };
                    paths::refuse_inputs(&sink, [&args.input], args.writing.force || args.dry_run)?;
                    add(
                        &mut warnings,
                        match args.dry_run {
                            true => file::scene_losses(scene, replaced, relink, *format)?,
                            false => {
                                file::write_scene(scene, replaced, relink, &sink, *format, &args.writing)?
                            }
                        },
                    );
                }
            }
        }
        Ok(warnings)
    }

    /// Writes the list of levels.
    pub(super) fn write_list(&self, list: &serde_json::Value, args: &LodArgs) -> anyhow::Result<()> {
        let Self::Each { folder, .. } = self else { return Ok(()) };
        if args.dry_run {
            return Ok(());
        }
        file::write_bytes(format!("{list:#}\n").as_bytes(), &folder.join(LIST_FILE), args.writing.force)
    }
}

/// Adds the warnings that are not in the list yet.
fn add(all: &mut Vec<Warning>, more: Vec<Warning>) {
    for warning in more {
        if !all.contains(&warning) {
            all.push(warning);
        }
    }
}

/// Returns for each mesh and level the fraction of the picture's height that the bounding sphere of the mesh
/// covers at the distance where the next level is used.
fn coverage(scene: &Scene, distances: &[f64], args: &LodArgs) -> Vec<Vec<f64>> {
    let screen = args.screen();
    let of_mesh = |m: &SceneMesh| {
        let diameter = m.mesh.positions().view().bounds().map_or(0.0, |b| b.diagonal()) * m.scale;
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

/// Returns for each vertex of a scene's mesh the vertices of the mesh that it was made from.
pub(super) fn vertices_of(there: &SceneMesh, mesh: &TriMesh) -> Vec<Vec<usize>> {
    let moved = there.world_from_mesh.map_or([0.0; 3], |m| m.map(|row| row[3]));
    // As written: relative to the node, and with -0 as 0.
    let key = |p: [f64; 3], by: [f64; 3]| [0, 1, 2].map(|k| ((p[k] - by[k]) as f32 + 0.0).to_bits());
    let mut at: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
    for (v, p) in mesh.positions().view().iter().enumerate() {
        at.entry(key(p, moved)).or_default().push(v);
    }
    let own = there.mesh.positions().view();
    own.iter().map(|p| at.get(&key(p, [0.0; 3])).cloned().unwrap_or_default()).collect()
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
