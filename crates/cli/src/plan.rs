//! Assignment of outputs to inputs, before any work.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use lodsmith_io::Format;
use lodsmith_io::sniff::hint_of;

use crate::args::Writing;
use crate::file::Destination;
use crate::paths::{self, Sink, Source, identity};
use crate::status::usage;

/// One input and its output.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub(crate) source: Source,
    /// `None` with `--dry-run` and no output.
    pub(crate) output: Option<Destination>,
}

impl Job {
    /// Returns true if a scene stays one in the output.
    pub(crate) fn keeps_scenes(&self) -> bool {
        self.output.as_ref().is_some_and(Destination::keeps_scenes)
    }
}

/// The output arguments of a command line.
pub(crate) struct OutputArgs<'a> {
    pub(crate) inputs: &'a [Source],
    pub(crate) output: Option<&'a Sink>,
    pub(crate) out_dir: Option<&'a Path>,
    /// Template of file names in the folder.
    pub(crate) name: &'a str,
    pub(crate) from: Option<Format>,
    pub(crate) writing: Writing,
    pub(crate) json: bool,
    pub(crate) dry_run: bool,
}

/// Plans all inputs of a command line.
///
/// # Errors
/// A usage error: results that would overwrite each other, another input or a folder; extensions that name no
/// format; more than one use of a standard stream.
pub(crate) fn jobs(wanted: &OutputArgs<'_>) -> anyhow::Result<Vec<Job>> {
    paths::at_most_one_stdin(wanted.inputs)?;
    let job = |source: &Source, sink: Sink| {
        paths::refuse_folder(&sink, ": use -O to write into it")?;
        let format = paths::format_of(&sink, wanted.writing.to)?;
        let output = Destination { sink, format, writing: wanted.writing, dry_run: wanted.dry_run };
        Ok(Job { source: source.clone(), output: Some(output) })
    };
    let jobs = match (wanted.output, wanted.out_dir) {
        (Some(_), _) if wanted.inputs.len() > 1 => {
            return Err(usage("several inputs cannot share one output: give a folder with -O"));
        }
        (Some(sink), _) => {
            if *sink == Sink::Stdout && wanted.json && !wanted.dry_run {
                return Err(usage("the mesh and --json both want standard output: give the mesh a file"));
            }
            vec![job(&wanted.inputs[0], sink.clone())?]
        }
        (None, Some(folder)) => {
            if folder.exists() && !folder.is_dir() {
                return Err(usage(format!("{}: is not a folder", folder.display())));
            }
            let job = |source| job(source, Sink::Path(folder.join(name(source, wanted)?)));
            wanted.inputs.iter().map(job).collect::<anyhow::Result<_>>()?
        }
        (None, None) => wanted.inputs.iter().map(|s| Job { source: s.clone(), output: None }).collect(),
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
fn name(source: &Source, wanted: &OutputArgs<'_>) -> anyhow::Result<String> {
    let path = match source {
        Source::Path(path) => path.as_path(),
        Source::Stdin => Path::new("stdin"),
    };
    let is_gz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let plain = if is_gz { path.with_extension("") } else { path.to_owned() };
    let text = |part: Option<&std::ffi::OsStr>| part.map(|s| s.to_string_lossy().into_owned());
    let stem = text(plain.file_stem()).unwrap_or_default();
    let own = || hint_of(&plain).and_then(|_| text(plain.extension()));
    let ext = wanted.writing.to.or(wanted.from).map(|f| f.name().to_owned()).or_else(own);
    let mut name = wanted.name.replace("{stem}", &stem);
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
fn check_collisions(jobs: &[Job]) -> anyhow::Result<()> {
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

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::args::{Cli, Command};

    fn plan(words: &[&str]) -> Result<Vec<String>, String> {
        let cli =
            Cli::try_parse_from(["lodsmith", "simplify", "--ratio", "0.5"].iter().chain(words)).unwrap();
        let Command::Simplify(args) = cli.command else { unreachable!("simplify was typed") };
        let jobs = jobs(&args.wanted()).map_err(|e| e.to_string())?;
        Ok(jobs.into_iter().filter_map(|j| Some(j.output?.sink.to_string())).collect())
    }

    #[test]
    fn results_are_named_by_the_template() {
        let got = plan(&["a.obj", "b.PLY", "c.stl.gz", "-O", "low"]).unwrap();
        assert_eq!(
            got,
            ["low/a_low.obj", "low/b_low.PLY", "low/c_low.stl"]
                .map(|s| s.replace('/', std::path::MAIN_SEPARATOR_STR))
        );
        assert_eq!(
            plan(&["a.x", "-O", "o", "--to", "glb", "--name", "{stem}-{stem}.{ext}"]).unwrap().len(),
            1
        );
    }

    #[test]
    fn what_cannot_be_is_refused_before_any_work() {
        for words in [
            &["a.obj", "b.obj", "-o", "c.obj"][..],
            &["x/a.obj", "y/a.obj", "-O", "low"],
            &["a.obj", "./a.obj", "-O", "low"],
            &["a.obj", "a_low.obj", "-O", "."],
            &["a.obj", "-o", "b.doc"],
            &["a.obj", "-o", "-"],
            &["a.obj", "-o", "-", "--to", "obj", "--json"],
            &["a.xyz", "-O", "low"],
            &["a.obj", "-O", "low", "--name", "{stem}_{faces}.obj"],
            &["a.obj", "-O", "low", "--name", "../{stem}.obj"],
            &["a.obj", "-o", "."],
            &["-", "-", "-O", "low", "--to", "obj"],
        ] {
            assert!(plan(words).is_err(), "{words:?}");
        }
    }

    #[test]
    fn an_input_is_its_own_output_by_force_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let path = path.to_str().unwrap();
        assert!(plan(&[path, "-o", path]).unwrap_err().contains("--force"));
        assert_eq!(plan(&[path, "-o", path, "--force"]).unwrap(), [path]);
    }
}
