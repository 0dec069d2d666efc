//! Peak memory of a simplification, in bytes per triangle, not counting the input mesh.
//!
//! ```text
//! memory FILE [--target 10%] [--no-fit] [--threads N]
//! ```
//! The mesh is read and welded, passed to a second process as plain buffers and simplified there, so that memory freed
//! by the reader cannot hide the peak. The figure is the peak resident memory during the run minus the resident memory
//! with the loaded mesh; it includes the result. Linux only.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::{Fit, NoControl, SimplifyOptions, Stop, simplify_with};
use lodsmith_bench::cases::Target;
use lodsmith_bench::{Soup, lab, process};

struct Args {
    file: String,
    target: Target,
    fit: bool,
    threads: usize,
    /// True in the second process; the file is then an exchange file.
    second: bool,
}

fn parse() -> Result<Args> {
    let mut args =
        Args { file: String::new(), target: Target::Percent(10.0), fit: true, threads: 1, second: false };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--target" => args.target = Target::parse(&arguments.next().context("--target needs a value")?)?,
            "--threads" => args.threads = arguments.next().context("--threads needs a value")?.parse()?,
            "--no-fit" => args.fit = false,
            "--exchange" => args.second = true,
            file if !file.starts_with('-') && args.file.is_empty() => file.clone_into(&mut args.file),
            other => bail!("unknown argument {other}"),
        }
    }
    ensure!(!args.file.is_empty(), "usage: memory FILE [--target 10%] [--no-fit] [--threads N]");
    Ok(args)
}

fn main() -> Result<()> {
    let args = parse()?;
    if args.second { measure(&args) } else { run_second_process(&args) }
}

fn run_second_process(args: &Args) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let copy = folder.path().join("mesh.labm");
    lab::write(&copy, &Soup::read(Path::new(&args.file))?.surface()?)?;
    let mut second = Command::new(std::env::current_exe()?);
    second.arg(&copy).arg("--exchange").args(["--target", &args.target.name()]);
    second.args(["--threads", &args.threads.to_string()]);
    if !args.fit {
        second.arg("--no-fit");
    }
    ensure!(second.status()?.success(), "the second process failed");
    Ok(())
}

fn measure(args: &Args) -> Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(args.threads).build_global()?;
    let mesh = lab::read(Path::new(&args.file))?;
    let surface = mesh.surface()?;
    let faces = surface.triangles().len();
    let mut options = SimplifyOptions::new(Stop::faces(args.target.of(faces)));
    if !args.fit {
        options.fit = Fit::Off;
    }
    let base = process::reset_peak_kb()?;
    let result = simplify_with(surface.clone(), &options, &mut NoControl)?;
    let beyond = process::peak_kb()?.saturating_sub(base);
    println!(
        "{faces} -> {} faces, fit {}, {} thread(s): mesh loaded {:.1} MB, peak above it {:.1} MB, {:.1} bytes per triangle",
        result.report.faces,
        if result.report.fitted { "on" } else { "off" },
        args.threads,
        base as f64 / 1024.0,
        beyond as f64 / 1024.0,
        beyond as f64 * 1024.0 / faces as f64,
    );
    Ok(())
}
