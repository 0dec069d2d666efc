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

/// The requested destinations of results.
#[derive(Clone, Copy, Debug, Default)]
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
    /// Options of writing.
    pub writing: Writing,
    /// True if the report goes to standard output.
    pub json: bool,
    /// Write nothing.
    pub dry_run: bool,
}

/// Assigns an output to each input.
///
/// # Errors
/// [`AssetError::Usage`] for results that would overwrite each other, another input or a folder, for extensions without
/// a format, and for more than one use of a standard stream.
pub fn assign(outputs: &Outputs<'_>) -> Result<Vec<Assignment>, AssetError> {
    paths::at_most_one_stream(outputs.inputs)?;
    let assigned = |source: &Source, sink: Sink| {
        // (Only jobs that can write to a folder have a template.)
        let hint = if outputs.name.is_empty() { "" } else { ": use --out-dir to write into it" };
        paths::refuse_folder(&sink, hint)?;
        let format = paths::format_of(&sink, outputs.to)?;
        let output = Destination { sink, format, writing: outputs.writing, dry_run: outputs.dry_run };
        Ok(Assignment { source: source.clone(), output: Some(output) })
    };
    let assignments = match (outputs.output, outputs.out_dir) {
        (Some(_), Some(_)) => return Err(usage("an output or a folder for outputs is expected, not both")),
        (Some(_), _) if outputs.inputs.len() > 1 => {
            return Err(usage("several inputs cannot share one output: use a folder (--out-dir)"));
        }
        (Some(sink), _) => {
            if *sink == Sink::Stream && outputs.json && !outputs.dry_run {
                return Err(usage(
                    "standard output cannot have both the mesh and --json: write the mesh to a file",
                ));
            }
            vec![assigned(&outputs.inputs[0], sink.clone())?]
        }
        (None, Some(folder)) => {
            if folder.exists() && !folder.is_dir() {
                return Err(usage(format!("{}: is not a folder", folder.display())));
            }
            let in_folder = |source| assigned(source, Sink::Path(folder.join(name(source, outputs)?)));
            outputs.inputs.iter().map(in_folder).collect::<Result<_, AssetError>>()?
        }
        (None, None) => {
            outputs.inputs.iter().map(|s| Assignment { source: s.clone(), output: None }).collect()
        }
    };
    for Assignment { source, output } in &assignments {
        if let Some(to) = output {
            paths::refuse_inputs(&to.sink, [source], outputs.writing.force || outputs.dry_run)?;
        }
    }
    check_collisions(&assignments)?;
    Ok(assignments)
}

/// Returns the file name of a result by the template.
fn name(source: &Source, outputs: &Outputs<'_>) -> Result<String, AssetError> {
    let plain = paths::unpacked(source.name());
    let own = || hint_of(&plain).and(plain.extension()).map(|e| e.to_string_lossy().into_owned());
    let ext = outputs.to.or(outputs.from).map(|f| f.name().to_owned()).or_else(own);
    let mut name = outputs.name.replace("{stem}", &paths::stem(source.name()));
    if name.contains("{ext}") {
        let ext = ext.ok_or_else(|| {
            usage(format!("{source}: the extension is no format for the result: set one with --to"))
        })?;
        name = name.replace("{ext}", &ext);
    }
    // The stem may contain braces; the template may contain only known placeholders.
    let unknown = outputs.name.replace("{stem}", "").replace("{ext}", "");
    if unknown.contains(['{', '}']) {
        return Err(usage(format!("--name {}: only {{stem}} and {{ext}} are known", outputs.name)));
    }
    if name.contains(['/', '\\']) || name.is_empty() || name == "." || name == ".." {
        return Err(usage(format!("--name {}: {name} is a path; only a file name is allowed", outputs.name)));
    }
    Ok(name)
}

/// Returns an error if two results have the same path, or if a result would overwrite another input: the outcome
/// would depend on the order.
fn check_collisions(assignments: &[Assignment]) -> Result<(), AssetError> {
    let mut inputs: HashMap<PathBuf, usize> = HashMap::new();
    for (i, assigned) in assignments.iter().enumerate() {
        if let Source::Path(path) = &assigned.source {
            inputs.insert(identity(path), i);
        }
    }
    let mut outputs: HashMap<PathBuf, usize> = HashMap::new();
    for (i, assigned) in assignments.iter().enumerate() {
        let Some(Destination { sink: Sink::Path(path), .. }) = &assigned.output else { continue };
        let output = identity(path);
        if let Some(&other) = inputs.get(&output)
            && other != i
        {
            let (own, other) = (&assigned.source, &assignments[other].source);
            return Err(usage(format!(
                "the result of {own} would overwrite the input {other}: use another --name"
            )));
        }
        if let Some(other) = outputs.insert(output, i) {
            let (a, b) = (&assignments[other].source, &assigned.source);
            let path = path.display();
            return Err(usage(format!(
                "the results of {a} and {b} would have the same path {path}: use another --name or --out-dir"
            )));
        }
    }
    Ok(())
}
