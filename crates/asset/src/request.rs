//! Jobs on files as plain values: the options by name, as packages for other languages have them.
//!
//! Names and values are those of the command's options. Underscores count as dashes.

mod file_options;
mod verb;

use std::path::Path;

use lodsmith::options::by_name;
use lodsmith::{Measure, OwnedMeshData};
use serde_json::{Map, Value};

use crate::clean::clean;
use crate::convert::convert;
use crate::destination::Destination;
use crate::error::{AssetError, usage};
use crate::info::info;
use crate::job::{Job, Watch};
use crate::lod::{LevelOutputs, LodRecipe, lod};
use crate::paths::{Sink, Source};
use crate::plan::{self, Assignment, Outputs};
use crate::simplify::{Recipe, simplify};
use crate::warnings::{Spelling, viewing_warnings, warnings_of};
use crate::{bake, report_json};
use file_options::FileOptions;
pub use verb::Verb;

pub use file_options::engine_value;

/// Returns the names of the options of a job that are flags, and of the others.
pub fn options_of(verb: Verb) -> (Vec<&'static str>, Vec<&'static str>) {
    file_options::names(verb)
}

/// A job with its options, checked.
#[derive(Clone, Debug)]
pub struct Request {
    verb: Verb,
    options: FileOptions,
    spelling: Spelling,
    /// Locks and importance by vertex, for [`Verb::Simplify`]; see [`Recipe::vertices`].
    pub vertices: Option<OwnedMeshData>,
}

/// What came of a request.
#[derive(Debug)]
pub struct Answer {
    /// The report, as the command prints it with `--json`.
    pub report: Value,
    /// Warnings, each with the path of its file.
    pub warnings: Vec<String>,
    /// What `strict` makes a fault.
    pub faults: Vec<String>,
}

impl Request {
    /// Makes a request of options by name; texts of its answer name options with this spelling.
    ///
    /// # Errors
    /// [`AssetError::UnknownOption`], [`AssetError::Usage`] for a value that an option does not take and for options that
    /// do not go together.
    pub fn new(verb: Verb, given: &Map<String, Value>, spelling: Spelling) -> Result<Self, AssetError> {
        Ok(Self { verb, options: FileOptions::new(verb, given)?, spelling, vertices: None })
    }

    /// Returns the number of threads asked for.
    pub fn threads(&self) -> Option<usize> {
        self.options.threads
    }

    /// Does the job in the present thread pool. `inputs` are one file, or the detailed and the lighter one for a bake;
    /// `output` or, for levels, `out_dir` is where the result goes.
    ///
    /// # Errors
    /// Those of the job, with the path of the file.
    pub fn run(
        &self,
        inputs: &[Source],
        output: Option<&Sink>,
        out_dir: Option<&Path>,
        watch: &mut dyn Watch,
    ) -> Result<Answer, AssetError> {
        let options = &self.options;
        let memory = options.max_memory.unwrap_or_else(Job::default_memory);
        let mut job = Job::new(watch, options.time_limit, memory);
        let mut reading = options.reading();
        reading.limits.memory = memory;
        let outputs = Outputs {
            inputs: &inputs[inputs.len().saturating_sub(1)..],
            output,
            out_dir,
            name: "",
            from: options.from,
            to: options.to,
            writing: options.writing,
            json: false,
            dry_run: options.dry_run,
        };
        let Some(source) = inputs.last() else { return Err(usage("an input is needed")) };
        let path = source.to_string();
        let mut answer = Answer { report: Value::Null, warnings: Vec::new(), faults: Vec::new() };
        let mut note = |warnings: &[lodsmith_io::Warning], name: &str| {
            for warning in warnings {
                let list = if options.strict && warning.data_lost {
                    &mut answer.faults
                } else {
                    &mut answer.warnings
                };
                list.push(format!("{name}: {}", self.spelling.apply(&warning.text)));
            }
        };
        let mut missed = Vec::new();
        let mut work = || -> Result<Value, AssetError> {
            Ok(match self.verb {
                Verb::Simplify => {
                    let to = assigned(&outputs)?;
                    let recipe = self.recipe(&outputs)?;
                    let done = simplify(source, &reading, &recipe, to.as_ref(), &mut job)?;
                    note(&done.warnings, &path);
                    missed.extend(
                        done.not_reached.iter().map(|why| format!("{path}: {}", self.spelling.apply(why))),
                    );
                    done.to_json(&path, &recipe, to.as_ref(), options.dry_run)
                }
                Verb::Lod => {
                    let recipe = self.lod_recipe()?;
                    let to = LevelOutputs::new(
                        &outputs,
                        options.name.as_deref(),
                        options.naming,
                        recipe.baking.as_ref(),
                    )?;
                    let done = lod(&to, &reading, &recipe, &mut job)?;
                    note(&done.warnings, &path);
                    for (k, level) in done.levels.iter().enumerate() {
                        let name = format!("{path}: level {}", k + 1);
                        note(&warnings_of(&level.report), &name);
                        let missing = |why| format!("{name}: {}", self.spelling.apply(why));
                        missed.extend(level.not_reached.iter().map(|why| missing(why)));
                    }
                    done.to_json(&path, &report_json::levels_target(&recipe.options.levels), &recipe, &to)
                }
                Verb::Convert => {
                    let to = required(assigned(&outputs)?)?;
                    let done = convert(source, &reading, &to, &mut job)?;
                    note(&done.warnings, &path);
                    done.to_json(&path, &to)
                }
                Verb::Clean => {
                    let to = assigned(&outputs)?;
                    let done = clean(source, &reading, &options.clean, to.as_ref(), &mut job)?;
                    note(&done.warnings, &path);
                    done.to_json(&path, to.as_ref(), options.dry_run)
                }
                Verb::Bake => {
                    let [high, low] = inputs else {
                        return Err(usage("a detailed and a lighter file are needed"));
                    };
                    let to = required(assigned(&outputs)?)?;
                    let baking = options.baking().ok_or_else(|| usage("maps: nothing is to be baked"))?;
                    let done = bake::bake(high, low, &reading, &baking, &to, &mut job)?;
                    note(&done.warnings, &path);
                    done.to_json(&high.to_string(), &path, &to)
                }
                Verb::Info => {
                    let found = info(source, &reading, &mut job)?;
                    note(&viewing_warnings(&found.warnings), &path);
                    found.to_json(&path)
                }
            })
        };
        let report = work().map_err(|why| match why {
            // These are not about the file.
            AssetError::Usage(_) | AssetError::Cancelled => why,
            why => why.of(source),
        })?;
        answer.report = report;
        if options.strict { &mut answer.faults } else { &mut answer.warnings }.append(&mut missed);
        Ok(answer)
    }

    fn recipe(&self, outputs: &Outputs<'_>) -> Result<Recipe, AssetError> {
        let options = &self.options;
        let engine = by_name::from_names(&options.engine_values()).map_err(AssetError::from)?;
        let recipe = Recipe {
            options: engine,
            names: options.names.clone(),
            vertices: self.vertices.clone(),
            normals: options.normals,
            baking: options.checked_baking()?,
        };
        recipe.check(&options.writing, outputs.output)?;
        Ok(recipe)
    }

    fn lod_recipe(&self) -> Result<LodRecipe, AssetError> {
        let options = &self.options;
        let mut levels = options.levels()?;
        levels.simplify = by_name::from_names(&options.engine_values()).map_err(AssetError::from)?;
        levels.simplify.measure = Measure::Always;
        levels.geomorph = options.geomorph;
        Ok(LodRecipe {
            options: levels,
            names: options.names.clone(),
            normals: options.normals,
            baking: options.checked_baking()?,
            screen: options.screen()?,
            naming: options.naming,
        })
    }
}

/// Returns the output of the only input, if there is one.
fn assigned(outputs: &Outputs<'_>) -> Result<Option<Destination>, AssetError> {
    let Assignment { output, .. } = plan::assign(outputs)?.remove(0);
    Ok(output)
}

fn required(to: Option<Destination>) -> Result<Destination, AssetError> {
    to.ok_or_else(|| usage("an output is needed"))
}
