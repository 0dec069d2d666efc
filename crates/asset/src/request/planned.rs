//! A job whose options are checked and whose outputs are assigned, and its results.

use std::path::Path;
use std::slice;

use lodsmith::OwnedMeshData;
use lodsmith_io::Warning;
use serde_json::Value;

use super::file_options::FileOptions;
use super::verb::Verb;
use crate::bake::{BakeOutcome, bake};
use crate::baking::Baking;
use crate::clean::{CleanOutcome, clean};
use crate::convert::{ConvertOutcome, convert};
use crate::error::{AssetError, usage};
use crate::info::{Info, info};
use crate::job::{Job, Watch};
use crate::lod::{LevelOutputs, LodOutcome, LodRecipe, lod};
use crate::paths::{self, Sink, Source};
#[cfg(feature = "pictures")]
use crate::picture::{self, PictureOutcome, PictureOutput};
use crate::plan::{self, Assignment, Outputs};
use crate::report_json;
use crate::simplify::{Outcome, Recipe, simplify};
use crate::warnings::{viewing_warnings, warnings_of};

/// The inputs and outputs of a job.
#[derive(Clone, Copy, Debug, Default)]
pub struct Places<'a> {
    /// The inputs; for baking, the high-poly file and the low-poly file.
    pub inputs: &'a [Source],
    /// The output of the only input.
    pub output: Option<&'a Sink>,
    /// The folder for outputs.
    pub out_dir: Option<&'a Path>,
    /// Template of file names in the folder, for results of several inputs.
    pub name: &'a str,
    /// True if the report goes to standard output.
    pub json: bool,
}

/// A job with checked options and outputs, for one input or several.
#[derive(Debug)]
pub struct PlannedJob<'r> {
    options: &'r FileOptions,
    /// Memory limit of a step, in bytes.
    memory: u64,
    work: Work,
    /// The inputs with their outputs.
    pub files: Vec<Assignment>,
}

/// The work on each input.
#[derive(Debug)]
enum Work {
    Simplify(Recipe),
    Lod(LodRecipe, LevelOutputs),
    Convert,
    Clean,
    Bake(Source, Baking),
    Info,
    /// All inputs are in one picture.
    #[cfg(feature = "pictures")]
    Render(Vec<Source>, Option<PictureOutput>),
}

/// The result for an input.
#[derive(Debug)]
pub enum Done {
    /// Result of simplification.
    Simplify(Box<Outcome>),
    /// Levels of detail.
    Lod(LodOutcome),
    /// Result of a conversion.
    Convert(ConvertOutcome),
    /// Result of repairs.
    Clean(CleanOutcome),
    /// Result of baking.
    Bake(BakeOutcome),
    /// Result of an inspection.
    Info(Info),
    /// Pictures of all inputs.
    #[cfg(feature = "pictures")]
    Render(PictureOutcome),
}

/// A message to the user about an input.
#[derive(Clone, Debug)]
pub struct Note {
    /// Path of the input, and the level if it concerns one.
    pub about: String,
    /// The message.
    pub text: String,
    /// True if data are lost or a target was not reached, which is an error with `strict`.
    pub is_loss: bool,
}

impl<'r> PlannedJob<'r> {
    /// Checks the options and assigns outputs to the inputs. `vertices` are the vertex data for [`Verb::Simplify`].
    pub(super) fn new(
        verb: Verb,
        options: &'r FileOptions,
        vertices: Option<&OwnedMeshData>,
        places: &Places<'_>,
    ) -> Result<Self, AssetError> {
        paths::at_most_one_stream(places.inputs)?;
        let inputs = match (verb, places.inputs) {
            (Verb::Bake, [_, low]) => slice::from_ref(low),
            (Verb::Bake, _) => return Err(usage("a high-poly and a low-poly file are needed")),
            (_, []) => return Err(usage("an input is needed")),
            (_, inputs) => inputs,
        };
        let outputs = Outputs {
            inputs,
            output: places.output,
            out_dir: places.out_dir,
            name: places.name,
            from: options.from,
            to: options.to,
            writing: options.writing,
            json: places.json,
            dry_run: options.dry_run,
        };
        let baking = options.baking();
        baking.iter().try_for_each(|baking| baking.check(&options.writing, places.output))?;
        let (names, normals) = (options.names.clone(), options.normals);
        let mut files = Vec::new();
        let work = match verb {
            Verb::Simplify => {
                let vertices = vertices.cloned();
                let recipe = Recipe { options: options.engine()?, names, vertices, normals, baking };
                recipe.check(&options.writing, places.output)?;
                Work::Simplify(recipe)
            }
            Verb::Lod => {
                let (screen, naming) = (options.screen, options.naming);
                let recipe = LodRecipe { options: options.levels()?, names, normals, baking, screen, naming };
                let levels = recipe.options.levels.count();
                let to = LevelOutputs::new(&outputs, options.name.as_deref(), naming, levels)?;
                files.push(Assignment { source: to.source.clone(), output: to.first.clone() });
                Work::Lod(recipe, to)
            }
            Verb::Convert => Work::Convert,
            Verb::Clean => Work::Clean,
            Verb::Bake => {
                let (high, baking) = (
                    places.inputs[0].clone(),
                    baking.ok_or_else(|| usage("--maps: at least one is needed"))?,
                );
                let is_allowed = options.writing.force;
                places.output.map_or(Ok(()), |to| paths::refuse_inputs(to, [&high], is_allowed))?;
                Work::Bake(high, baking)
            }
            Verb::Info => Work::Info,
            #[cfg(feature = "pictures")]
            Verb::Render => {
                let to = PictureOutput::new(&outputs, options.name.as_deref(), &options.picture)?;
                files.push(Assignment { source: inputs[0].clone(), output: None });
                Work::Render(inputs.to_vec(), to)
            }
        };
        if files.is_empty() {
            files = plan::assign(&outputs)?;
        }
        if matches!(verb, Verb::Convert | Verb::Bake) && files.iter().any(|file| file.output.is_none()) {
            return Err(usage("an output is needed"));
        }
        Ok(Self { options, memory: options.memory(), work, files })
    }

    /// Starts the job on one of the files.
    pub fn begin<'w>(&self, watch: &'w mut dyn Watch) -> Job<'w> {
        Job::new(watch, self.options.time_limit, self.memory)
    }

    /// Does the job on one of the files.
    ///
    /// # Errors
    /// Those of the job, without the name of the input.
    pub fn run(&self, file: &Assignment, job: &mut Job<'_>) -> Result<Done, AssetError> {
        let (source, to) = (&file.source, file.output.as_ref());
        let reading = &self.options.reading(self.memory);
        let output = || to.ok_or_else(|| usage("an output is needed"));
        Ok(match &self.work {
            Work::Simplify(recipe) => Done::Simplify(Box::new(simplify(source, reading, recipe, to, job)?)),
            Work::Lod(recipe, to) => Done::Lod(lod(to, reading, recipe, job)?),
            Work::Convert => Done::Convert(convert(source, reading, output()?, job)?),
            Work::Clean => Done::Clean(clean(source, reading, &self.options.clean, to, job)?),
            Work::Bake(high, baking) => Done::Bake(bake(high, source, reading, baking, output()?, job)?),
            Work::Info => Done::Info(info(source, reading, job)?),
            #[cfg(feature = "pictures")]
            Work::Render(inputs, to) => {
                Done::Render(picture::render(inputs, reading, &self.options.picture, to.as_ref(), job)?)
            }
        })
    }

    /// Returns the report of a file.
    pub fn report(&self, file: &Assignment, done: &Done) -> Value {
        let (path, to, dry_run) = (file.source.to_string(), file.output.as_ref(), self.options.dry_run);
        match (done, &self.work, to) {
            (Done::Simplify(done), Work::Simplify(recipe), to) => done.to_json(&path, recipe, to, dry_run),
            (Done::Lod(done), Work::Lod(recipe, to), _) => {
                done.to_json(&path, &report_json::levels_target(&recipe.options.levels), recipe, to)
            }
            (Done::Convert(done), _, Some(to)) => done.to_json(&path, to),
            (Done::Clean(done), _, to) => done.to_json(&path, to, dry_run),
            (Done::Bake(done), Work::Bake(high, _), Some(to)) => done.to_json(&high.to_string(), &path, to),
            (Done::Info(done), ..) => done.to_json(&path),
            #[cfg(feature = "pictures")]
            (Done::Render(done), Work::Render(_, to), _) => done.to_json(to.as_ref()),
            _ => Value::Null,
        }
    }
}

#[cfg(feature = "pictures")]
impl PlannedJob<'_> {
    /// Returns the output of pictures; `None` for other jobs, and for a picture that is not written.
    pub fn pictures(&self) -> Option<&PictureOutput> {
        match &self.work {
            Work::Render(_, to) => to.as_ref(),
            _ => None,
        }
    }
}

impl Done {
    /// Returns the messages to the user about a file: warnings, and targets that were not reached.
    pub fn notes(&self, path: &str) -> Vec<Note> {
        let mut notes = Vec::new();
        let mut add = |about: &str, warnings: &[Warning], missed: Option<&String>| {
            let note = |text: &str, is_loss| Note { about: about.to_owned(), text: text.to_owned(), is_loss };
            notes.extend(warnings.iter().map(|warning| note(&warning.text, warning.data_lost)));
            notes.extend(missed.map(|why| note(why, true)));
        };
        match self {
            Self::Simplify(done) => add(path, &done.warnings, done.not_reached.as_ref()),
            Self::Lod(done) => {
                add(path, &done.warnings, None);
                for (k, level) in done.levels.iter().enumerate() {
                    let about = format!("{path}: level {}", k + 1);
                    add(&about, &warnings_of(&level.report), level.not_reached.as_ref());
                }
            }
            Self::Convert(done) => add(path, &done.warnings, None),
            Self::Clean(done) => add(path, &done.warnings, None),
            Self::Bake(done) => add(path, &done.warnings, None),
            Self::Info(done) => add(path, &viewing_warnings(&done.warnings), None),
            #[cfg(feature = "pictures")]
            Self::Render(done) => {
                for (path, warnings) in &done.warnings {
                    add(path, &viewing_warnings(warnings), None);
                }
            }
        }
        notes
    }
}
