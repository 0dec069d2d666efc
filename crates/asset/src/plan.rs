//! Assignment of outputs to inputs, before any work.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use lodsmith_io::Format;
use lodsmith_io::sniff::hint_of;

use crate::destination::{Destination, Writing};
use crate::error::{AssetError, usage};
use crate::paths::{self, Sink, Source, identity};

/// One input and its output.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// The input.
    pub source: Source,
    /// `None` with `--dry-run` and no output.
    pub output: Option<Destination>,
}

impl Assignment {
    /// Returns true if a scene stays one in the output.
    pub fn keeps_scenes(&self) -> bool {
        self.output.as_ref().is_some_and(Destination::keeps_scenes)
    }
}

/// Where results are to go.
pub struct Outputs<'a> {
    /// The inputs.
    pub inputs: &'a [Source],
    /// The output of the only input.
    pub output: Option<&'a Sink>,
    /// The folder for the outputs.
    pub out_dir: Option<&'a Path>,
    /// Template of file names in the folder.
    pub name: &'a str,
    /// Format of the inputs, if it was given.
    pub from: Option<Format>,
    /// Format of the outputs, if it was given.
    pub to: Option<Format>,
    /// How they are written.
    pub writing: Writing,
    /// True if standard output carries the report.
    pub json: bool,
    /// Nothing is written.
    pub dry_run: bool,
}

/// Assigns an output to each input.
///
/// # Errors
/// [`AssetError::Usage`]: results that would overwrite each other, another input or a folder; extensions that name no
/// format; more than one use of a standard stream.
pub fn assign(wanted: &Outputs<'_>) -> Result<Vec<Assignment>, AssetError> {
    paths::at_most_one_stream(wanted.inputs)?;
    let job = |source: &Source, sink: Sink| {
        // (Only several inputs have a template.)
        let hint = if wanted.name.is_empty() { "" } else { ": use -O to write into it" };
        paths::refuse_folder(&sink, hint)?;
        let format = paths::format_of(&sink, wanted.to)?;
        let output = Destination { sink, format, writing: wanted.writing, dry_run: wanted.dry_run };
        Ok(Assignment { source: source.clone(), output: Some(output) })
    };
    let jobs = match (wanted.output, wanted.out_dir) {
        (Some(_), Some(_)) => return Err(usage("an output or a folder for outputs is expected, not both")),
        (Some(_), _) if wanted.inputs.len() > 1 => {
            return Err(usage("several inputs cannot share one output: give a folder with -O"));
        }
        (Some(sink), _) => {
            if *sink == Sink::Stream && wanted.json && !wanted.dry_run {
                return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
            }
            vec![job(&wanted.inputs[0], sink.clone())?]
        }
        (None, Some(folder)) => {
            if folder.exists() && !folder.is_dir() {
                return Err(usage(format!("{}: is not a folder", folder.display())));
            }
            let job = |source| job(source, Sink::Path(folder.join(name(source, wanted)?)));
            wanted.inputs.iter().map(job).collect::<Result<_, AssetError>>()?
        }
        (None, None) => {
            wanted.inputs.iter().map(|s| Assignment { source: s.clone(), output: None }).collect()
        }
    };
    for job in &jobs {
        if let Some(to) = &job.output {
            paths::refuse_inputs(&to.sink, [&job.source], wanted.writing.force || wanted.dry_run)?;
        }
    }
    check_collisions(&jobs)?;
    Ok(jobs)
}

/// Returns the file name of a result by the template.
fn name(source: &Source, wanted: &Outputs<'_>) -> Result<String, AssetError> {
    let plain = paths::unpacked(source.name());
    let own = || hint_of(&plain).and(plain.extension()).map(|e| e.to_string_lossy().into_owned());
    let ext = wanted.to.or(wanted.from).map(|f| f.name().to_owned()).or_else(own);
    let mut name = wanted.name.replace("{stem}", &paths::stem(source.name()));
    if name.contains("{ext}") {
        let ext = ext.ok_or_else(|| {
            usage(format!("{source}: the ending names no format for the result: say which with --to"))
        })?;
        name = name.replace("{ext}", &ext);
    }
    // The stem may contain braces, the template only known placeholders.
    let unknown = wanted.name.replace("{stem}", "").replace("{ext}", "");
    if unknown.contains(['{', '}']) {
        return Err(usage(format!("--name {}: only {{stem}} and {{ext}} are known", wanted.name)));
    }
    if name.contains(['/', '\\']) || name.is_empty() || name == "." || name == ".." {
        return Err(usage(format!("--name {}: a name in the folder is wanted, not {name}", wanted.name)));
    }
    Ok(name)
}

/// Returns an error if two results have the same path, or a result is the input of another: the order would
/// be random.
fn check_collisions(jobs: &[Assignment]) -> Result<(), AssetError> {
    let mut inputs: HashMap<PathBuf, usize> = HashMap::new();
    for (i, job) in jobs.iter().enumerate() {
        if let Source::Path(path) = &job.source {
            inputs.insert(identity(path), i);
        }
    }
    let mut outputs: HashMap<PathBuf, usize> = HashMap::new();
    for (i, job) in jobs.iter().enumerate() {
        let Some(Destination { sink: Sink::Path(path), .. }) = &job.output else { continue };
        let place = identity(path);
        if let Some(&other) = inputs.get(&place)
            && other != i
        {
            let (own, other) = (&job.source, &jobs[other].source);
            return Err(usage(format!(
                "the result of {own} would fall onto the input {other}: use another --name"
            )));
        }
        if let Some(other) = outputs.insert(place, i) {
            let (a, b) = (&jobs[other].source, &job.source);
            let path = path.display();
            return Err(usage(format!(
                "the results of {a} and {b} would both be {path}: use another --name or -O"
            )));
        }
    }
    Ok(())
}
