//! Arguments of commands that process several files.

use std::path::PathBuf;

use clap::Args;
use lodsmith_asset::{Sink, Source};

/// Inputs and outputs. Each command sets its default for the file names.
#[derive(Args, Debug)]
pub(crate) struct BatchFiles {
    /// Files to read; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(super) inputs: Vec<Source>,
    /// File to write; `-` is standard output
    #[arg(short, long, value_name = "OUT", conflicts_with = "out_dir")]
    pub(super) output: Option<Sink>,
    /// Folder for the results of several inputs; created if missing
    #[arg(short = 'O', long, value_name = "DIR")]
    pub(super) out_dir: Option<PathBuf>,
    /// File names in the folder
    #[arg(long, value_name = "TEMPLATE", default_value = "{stem}.{ext}", requires = "out_dir")]
    pub(super) name: String,
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use crate::args::Cli;

    fn plan(arguments: &[&str]) -> Result<Vec<String>, String> {
        let cli =
            Cli::try_parse_from(["lodsmith", "simplify", "--ratio", "0.5"].iter().chain(arguments)).unwrap();
        let job = cli.command.job().expect("simplify is a job");
        let request = job.request().unwrap();
        let planned = request.plan(&job.places()).map_err(|e| e.to_string())?;
        Ok(planned.files.into_iter().filter_map(|file| Some(file.output?.sink.to_string())).collect())
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
    fn invalid_outputs_are_refused_before_any_work() {
        for arguments in [
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
            assert!(plan(arguments).is_err(), "{arguments:?}");
        }
    }

    #[test]
    fn an_input_is_overwritten_only_with_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let path = path.to_str().unwrap();
        assert!(plan(&[path, "-o", path]).unwrap_err().contains("--force"));
        assert_eq!(plan(&[path, "-o", path, "--force"]).unwrap(), [path]);
    }
}
