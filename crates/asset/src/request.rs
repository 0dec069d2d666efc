//! Jobs on files as plain values, with options by name, for the command and for packages in other languages.
//!
//! Names and values are as on the command line. Underscores count as dashes.

mod file_options;
mod planned;
mod verb;

use std::path::Path;

use lodsmith::OwnedMeshData;
use lodsmith_core::Image;
use serde_json::{Map, Value};

use crate::error::{AssetError, usage};
use crate::job::Watch;
use crate::paths::{Sink, Source};
use crate::warnings::Spelling;

pub use file_options::{FileKind, FileOption, FileOptions, JobOption, OptionSection, engine_value};
pub use planned::{Done, Note, Places, PlannedJob};
pub use verb::Verb;

/// A job with its options, checked.
#[derive(Clone, Debug)]
pub struct Request {
    verb: Verb,
    options: FileOptions,
    spelling: Spelling,
    /// Locks and importance by vertex, for [`Verb::Simplify`]; see [`Recipe::vertices`](crate::Recipe::vertices).
    pub vertices: Option<OwnedMeshData>,
}

/// Result of a request.
#[derive(Debug)]
pub struct Answer {
    /// The report, as the command prints it with `--json`.
    pub report: Value,
    /// Warnings, each with the path of its file.
    pub warnings: Vec<String>,
    /// Messages that `strict` turns from warnings into errors.
    pub faults: Vec<String>,
    /// The picture, if one was rendered and not written.
    pub picture: Option<Image>,
}

impl Request {
    /// Makes a request from options by name; messages name options with this spelling.
    ///
    /// # Errors
    /// [`AssetError::UnknownOption`]; [`AssetError::Usage`] for a value that an option does not take, and for options
    /// that exclude each other.
    pub fn new(verb: Verb, given: &Map<String, Value>, spelling: Spelling) -> Result<Self, AssetError> {
        Ok(Self { verb, options: FileOptions::of_json(verb, given)?, spelling, vertices: None })
    }

    /// Makes a request from options that were [set](JobOption::set).
    ///
    /// # Errors
    /// [`AssetError::Usage`] for options that exclude each other.
    pub fn of(verb: Verb, options: FileOptions) -> Result<Self, AssetError> {
        let options = options.completed(verb)?;
        Ok(Self { verb, options, spelling: Spelling::CommandLine, vertices: None })
    }

    /// Returns the options.
    pub fn options(&self) -> &FileOptions {
        &self.options
    }

    /// Returns the requested number of threads.
    pub fn threads(&self) -> Option<usize> {
        self.options.threads
    }

    /// Checks the options and assigns outputs to the inputs, before any work. Creates the folder of levels.
    ///
    /// # Errors
    /// [`AssetError::Usage`], [`AssetError::Simplify`] for options and outputs that exclude each other,
    /// [`AssetError::Folder`].
    pub fn plan(&self, places: &Places<'_>) -> Result<PlannedJob<'_>, AssetError> {
        PlannedJob::new(self.verb, &self.options, self.vertices.as_ref(), places)
    }

    /// Does the job in the current thread pool. `inputs` are one file, or the high-poly and the low-poly file for
    /// baking; the result goes to `output` or, for levels and frames, to `out_dir`.
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
        // (Baking has no partial result, but it ends in time.)
        let ends_in_time = matches!(self.verb, Verb::Simplify | Verb::Lod | Verb::Bake);
        if self.options.time_limit.is_some() && !ends_in_time {
            return Err(usage(format!("--time-limit: {} has no partial result", self.verb.name())));
        }
        let Some(source) = inputs.last() else { return Err(usage("an input is needed")) };
        let named = |why| match why {
            // These errors do not concern the file.
            AssetError::Usage(_) | AssetError::Cancelled => why,
            // Errors of pictures name their file already.
            #[cfg(feature = "pictures")]
            why if self.verb == Verb::Render => why,
            why => AssetError::of(why, source),
        };
        let places = Places { inputs, output, out_dir, ..Places::default() };
        let planned = self.plan(&places).map_err(named)?;
        let (report, warnings, faults) = (Value::Null, Vec::new(), Vec::new());
        let mut answer = Answer { report, warnings, faults, picture: None };
        for file in &planned.files {
            let done = planned.run(file, &mut planned.begin(watch)).map_err(named)?;
            answer.report = planned.report(file, &done);
            for Note { about, text, is_loss } in done.notes(&source.to_string()) {
                let is_fault = is_loss && self.options.strict;
                let list = if is_fault { &mut answer.faults } else { &mut answer.warnings };
                list.push(format!("{about}: {}", self.spelling.apply(&text)));
            }
            #[cfg(feature = "pictures")]
            if let Done::Render(done) = done {
                answer.picture = done.picture;
            }
        }
        Ok(answer)
    }
}
