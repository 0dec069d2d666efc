//! Levels of a progressive mesh compared with single runs to the same face count: errors, times, speed of collapses
//! and splits.
//!
//! ```text
//! progressive FILE... [--method NAME] [--between] [--scrub]
//! ```
//! RMS is two-way and measured (`compare`, the same seed for both), in percent of the diagonal. With `--between`,
//! levels lie halfway between checkpoints, where the moves of the fit are interpolated. Ratios are in brackets where
//! the errors differ by less than single-precision rounding: they have no meaning there. With `--scrub` there are no
//! single runs: the mesh goes down to 1 % and back in single splits, and each level must be bit-identical in both
//! directions.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use lodsmith::{MethodKind, NoControl, Progressive, SimplifyOptions, Stop, simplify};
use lodsmith_core::TriMesh;
use lodsmith_core::measure::{CompareOptions, Prepared, compare_attributes, compare_prepared};

/// Fractions of the faces, in percent.
const PERCENTAGES: [f64; 8] = [70.0, 50.0, 35.0, 20.0, 10.0, 5.0, 2.0, 1.0];
/// Minimum number of collapses and splits in a timing.
const MIN_STEPS: usize = 20_000_000;
/// Number of levels that are compared in full.
const CHECKED_LEVELS: usize = 200;
/// Differences below this, in percent of the diagonal, are rounding.
const ROUNDING: f64 = 1e-5;

fn main() -> Result<()> {
    let mut options = SimplifyOptions::default();
    let (mut files, mut between, mut scrubs) = (Vec::new(), false, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--method" => {
                let name = arguments.next().context("--method needs a name")?;
                let known = MethodKind::ALL.into_iter().find(|m| m.name() == name);
                options.method = known.with_context(|| format!("no method {name}"))?.into();
            }
            "--between" => between = true,
            "--scrub" => scrubs = true,
            file => files.push(file.to_owned()),
        }
    }
    ensure!(!files.is_empty(), "usage: progressive FILE... [--method NAME] [--between] [--scrub]");
    for file in files {
        let mesh = lodsmith_io::read_path(Path::new(&file), &lodsmith_io::ReadOptions::default())
            .with_context(|| format!("reading {file}"))?
            .mesh;
        let name = Path::new(&file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if scrubs {
            scrub(&name, &mesh, &options)?;
        } else {
            report(&name, &mesh, &options, between)?;
        }
    }
    Ok(())
}

fn report(name: &str, mesh: &TriMesh, options: &SimplifyOptions, between: bool) -> Result<()> {
    let start = Instant::now();
    let mut progressive = Progressive::build(mesh, options, &mut NoControl)?;
    let secs = start.elapsed().as_secs_f64();
    let start = Instant::now();
    simplify(mesh, &with_face_stop(options, 1))?;
    let single = start.elapsed().as_secs_f64();
    let data = progressive.splits();
    let fits: usize = data.checkpoints.iter().map(|c| c.vertices.len()).sum();
    println!(
        "\n## {name}: {} faces, {} levels, base {} faces; built in {secs:.2} s (one run down to the end {single:.2} s), {} \
         checkpoints with {fits} moves, {:.2} corners and {:.2} moves per split",
        mesh.face_count(),
        progressive.levels(),
        data.counts[0].faces,
        data.checkpoints.len(),
        data.corners.at.len() as f64 / data.len().max(1) as f64,
        data.places.at.len() as f64 / data.len().max(1) as f64,
    );
    ensure!(progressive.mesh()? == *mesh, "{name}: the full level is not the input");
    let (down, up) = steps_per_second(&mut progressive);
    println!("{:.1} M contractions/s, {:.1} M splits/s", down / 1e6, up / 1e6);
    ensure!(progressive.mesh()? == *mesh, "{name}: the full level is not the input after all splits");
    println!(
        "| faces | % | single | level | fitted | level/single | fitted/single | estimate/fitted | texture, fitted/single |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let reference = Prepared::new(&mesh.surface())?;
    for percentage in percentages(&progressive, between) {
        let goal = ((mesh.face_count() as f64 * percentage / 100.0).round() as usize).max(4);
        if goal < 20 || progressive.splits().counts[0].faces as usize > goal {
            continue;
        }
        progressive.to_faces(goal);
        let single = simplify(mesh, &with_face_stop(options, goal))?;
        let rms = |m: &TriMesh| -> Result<f64> {
            let compared =
                compare_prepared(&reference, &Prepared::new(&m.surface())?, &CompareOptions::default());
            Ok(100.0 * compared.rms.symmetric / compared.diagonal)
        };
        let (one, raw, fitted) =
            (rms(&single.mesh)?, rms(&progressive.mesh()?)?, rms(&progressive.fitted_mesh()?)?);
        let texture = |m: &TriMesh| -> Result<Option<f64>> {
            let compared = compare_attributes(mesh, m, &CompareOptions::default())?;
            Ok(compared.uvs.map(|t| t.rms.symmetric))
        };
        let texture = match (texture(&single.mesh)?, texture(&progressive.fitted_mesh()?)?) {
            (Some(one), Some(fitted)) => format!("{:.3}", fitted / one),
            _ => String::new(),
        };
        let estimate = 100.0 * progressive.error() / single.report.error.diagonal;
        println!(
            "| {} | {percentage:.1} | {one:.5} | {raw:.5} | {fitted:.5} | {} | {} | {:.2} | {texture} |",
            progressive.face_count(),
            ratio(raw, one),
            ratio(fitted, one),
            estimate / fitted
        );
    }
    Ok(())
}

/// Goes down to 1 % and back in single splits; compares whole buffers at many levels.
fn scrub(name: &str, mesh: &TriMesh, options: &SimplifyOptions) -> Result<()> {
    let mut progressive = Progressive::build(mesh, options, &mut NoControl)?;
    let lowest = progressive.level_of_faces(mesh.face_count() / 100);
    let interval = (progressive.top() - lowest).div_ceil(CHECKED_LEVELS).max(1);
    let mut seen = vec![hash_of(&progressive)];
    while progressive.level() > lowest {
        progressive.coarsen(1);
        if (progressive.top() - progressive.level()).is_multiple_of(interval) {
            seen.push(hash_of(&progressive));
        }
    }
    let (faces, levels) = (progressive.face_count(), seen.len());
    loop {
        if (progressive.top() - progressive.level()).is_multiple_of(interval) {
            let is_same = seen.pop() == Some(hash_of(&progressive));
            ensure!(is_same, "{name}: level {} differs on the way up", progressive.level());
        }
        if progressive.level() == progressive.top() {
            break;
        }
        progressive.refine(1);
    }
    ensure!(progressive.mesh()? == *mesh, "{name}: the full level is not the input");
    println!(
        "{name}: {} faces, down to {faces} and back in {} steps; {levels} levels are identical, and the full level is the input",
        mesh.face_count(),
        2 * (progressive.top() - lowest)
    );
    Ok(())
}

/// Returns a hash of the current level with its fit.
fn hash_of(progressive: &Progressive) -> u64 {
    let mut hash = DefaultHasher::new();
    let bits = |p: [f64; 3]| p.map(f64::to_bits);
    progressive.faces().hash(&mut hash);
    progressive.vertex_map().hash(&mut hash);
    progressive.regions().hash(&mut hash);
    progressive.values().iter().for_each(|x| x.to_bits().hash(&mut hash));
    progressive.positions().iter().for_each(|p| bits(p).hash(&mut hash));
    progressive.fitted_positions().view().iter().for_each(|p| bits(p).hash(&mut hash));
    hash.finish()
}

fn ratio(error: f64, single: f64) -> String {
    let ratio = error / single;
    if (error - single).abs() < ROUNDING { format!("({ratio:.3})") } else { format!("{ratio:.3}") }
}

/// Returns the same options with a face count as the stop.
fn with_face_stop(options: &SimplifyOptions, faces: usize) -> SimplifyOptions {
    let mut options = options.clone();
    options.stop = Stop::faces(faces);
    options
}

/// Returns percentages of the faces: round ones, or halfway between checkpoints.
fn percentages(progressive: &Progressive, between: bool) -> Vec<f64> {
    if !between {
        return PERCENTAGES.to_vec();
    }
    let counts = &progressive.splits().counts;
    let all = f64::from(counts[progressive.top()].faces);
    let faces = |level: u32| f64::from(counts[level as usize].faces);
    let pairs = progressive.splits().checkpoints.windows(2).rev();
    pairs.map(|c| 100.0 * (faces(c[0].level) * faces(c[1].level)).sqrt() / all).step_by(2).collect()
}

/// Returns collapses and splits per second, over the whole sequence.
fn steps_per_second(progressive: &mut Progressive) -> (f64, f64) {
    let rounds = MIN_STEPS.div_ceil(progressive.top().max(1)).min(200);
    let (mut down, mut up) = (0.0, 0.0);
    for _ in 0..rounds {
        let start = Instant::now();
        progressive.to_level(0);
        down += start.elapsed().as_secs_f64();
        let start = Instant::now();
        progressive.to_level(progressive.top());
        up += start.elapsed().as_secs_f64();
    }
    let steps = (rounds * progressive.top()) as f64;
    (steps / down, steps / up)
}
