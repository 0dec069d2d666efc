//! Levels of a progressive mesh compared with single runs of the same size: errors, times, speed of collapses
//! and splits.
//!
//! ```text
//! progressive FILE... [--method NAME] [--between] [--scrub]
//! ```
//! RMS is two-way and measured (`compare`, the same seed for both), in percent of the diagonal. With
//! `--between`, levels lie halfway between checkpoints, where the moves of the fit are blended. Ratios are in
//! brackets where the errors differ by less than single-precision rounding: they mean nothing there. With
//! `--scrub` there are no single runs: the mesh goes down to 1 % and back, split by split, and must be
//! bit-identical on the way up and on the way down.
#![allow(clippy::print_stdout, reason = "a program speaks on standard output")]

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
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--method" => {
                let name = words.next().context("--method needs a name")?;
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
    let mut road = Progressive::build(mesh, options, &mut NoControl)?;
    let secs = start.elapsed().as_secs_f64();
    let start = Instant::now();
    simplify(mesh, &with_face_stop(options, 1))?;
    let single = start.elapsed().as_secs_f64();
    let data = road.splits();
    let fits: usize = data.checkpoints.iter().map(|c| c.vertices.len()).sum();
    println!(
        "\n## {name}: {} faces, {} levels, base {} faces; built in {secs:.2} s (one run to the end {single:.2} s), {} \
         checkpoints with {fits} moves, {:.2} corners and {:.2} moves a split",
        mesh.face_count(),
        road.levels(),
        data.counts[0].faces,
        data.checkpoints.len(),
        data.corners.at.len() as f64 / data.len().max(1) as f64,
        data.places.at.len() as f64 / data.len().max(1) as f64,
    );
    ensure!(road.mesh()? == *mesh, "{name}: the full level is not the input");
    let (down, up) = steps_per_second(&mut road);
    println!("{:.1} M contractions/s, {:.1} M splits/s", down / 1e6, up / 1e6);
    ensure!(road.mesh()? == *mesh, "{name}: the full level is not the input after the walk");
    println!(
        "| faces | % | single | road | fitted | road/single | fitted/single | estimate/fitted | texture, fitted/single |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let reference = Prepared::new(&mesh.surface())?;
    for share in shares(&road, between) {
        let goal = ((mesh.face_count() as f64 * share / 100.0).round() as usize).max(4);
        if goal < 20 || road.splits().counts[0].faces as usize > goal {
            continue;
        }
        road.to_faces(goal);
        let single = simplify(mesh, &with_face_stop(options, goal))?;
        let rms = |m: &TriMesh| -> Result<f64> {
            let compared =
                compare_prepared(&reference, &Prepared::new(&m.surface())?, &CompareOptions::default());
            Ok(100.0 * compared.rms.symmetric / compared.diagonal)
        };
        let (one, raw, fitted) = (rms(&single.mesh)?, rms(&road.mesh()?)?, rms(&road.fitted_mesh()?)?);
        let texture = |m: &TriMesh| -> Result<Option<f64>> {
            let compared = compare_attributes(mesh, m, &CompareOptions::default())?;
            Ok(compared.uvs.map(|t| t.rms.symmetric))
        };
        let texture = match (texture(&single.mesh)?, texture(&road.fitted_mesh()?)?) {
            (Some(one), Some(fitted)) => format!("{:.3}", fitted / one),
            _ => String::new(),
        };
        let estimate = 100.0 * road.error() / single.report.error.diagonal;
        println!(
            "| {} | {share:.1} | {one:.5} | {raw:.5} | {fitted:.5} | {} | {} | {:.2} | {texture} |",
            road.face_count(),
            ratio(raw, one),
            ratio(fitted, one),
            estimate / fitted
        );
    }
    Ok(())
}

/// Goes down to 1 % and back in steps of one split; compares whole buffers at many levels on the way.
fn scrub(name: &str, mesh: &TriMesh, options: &SimplifyOptions) -> Result<()> {
    let mut road = Progressive::build(mesh, options, &mut NoControl)?;
    let lowest = road.level_of_faces(mesh.face_count() / 100);
    let every = (road.top() - lowest).div_ceil(CHECKED_LEVELS).max(1);
    let mut seen = vec![sum(&road)];
    while road.level() > lowest {
        road.coarsen(1);
        if (road.top() - road.level()).is_multiple_of(every) {
            seen.push(sum(&road));
        }
    }
    let (faces, levels) = (road.face_count(), seen.len());
    loop {
        if (road.top() - road.level()).is_multiple_of(every) {
            let is_same = seen.pop() == Some(sum(&road));
            ensure!(is_same, "{name}: level {} is another on the way up", road.level());
        }
        if road.level() == road.top() {
            break;
        }
        road.refine(1);
    }
    ensure!(road.mesh()? == *mesh, "{name}: the full level is not the input");
    println!(
        "{name}: {} faces, down to {faces} and back in {} steps; {levels} levels the same, and the full one the input",
        mesh.face_count(),
        2 * (road.top() - lowest)
    );
    Ok(())
}

/// Returns a hash of everything in the current level, including its fit.
fn sum(road: &Progressive) -> u64 {
    let mut sum = DefaultHasher::new();
    let bits = |p: [f64; 3]| p.map(f64::to_bits);
    road.faces().hash(&mut sum);
    road.vertex_map().hash(&mut sum);
    road.regions().hash(&mut sum);
    road.values().iter().for_each(|x| x.to_bits().hash(&mut sum));
    road.positions().iter().for_each(|p| bits(p).hash(&mut sum));
    road.fitted_positions().view().iter().for_each(|p| bits(p).hash(&mut sum));
    sum.finish()
}

fn ratio(error: f64, of_single: f64) -> String {
    let ratio = error / of_single;
    if (error - of_single).abs() < ROUNDING { format!("({ratio:.3})") } else { format!("{ratio:.3}") }
}

/// Returns the same options with a face count as the stop.
fn with_face_stop(options: &SimplifyOptions, faces: usize) -> SimplifyOptions {
    let mut options = options.clone();
    options.stop = Stop::faces(faces);
    options
}

/// Returns fractions of the faces: round ones, or halfway between checkpoints.
fn shares(road: &Progressive, between: bool) -> Vec<f64> {
    if !between {
        return PERCENTAGES.to_vec();
    }
    let counts = &road.splits().counts;
    let all = f64::from(counts[road.top()].faces);
    let faces = |level: u32| f64::from(counts[level as usize].faces);
    let pairs = road.splits().checkpoints.windows(2).rev();
    pairs.map(|c| 100.0 * (faces(c[0].level) * faces(c[1].level)).sqrt() / all).step_by(2).collect()
}

/// Returns collapses and splits per second, over the whole sequence.
fn steps_per_second(road: &mut Progressive) -> (f64, f64) {
    let rounds = MIN_STEPS.div_ceil(road.top().max(1)).min(200);
    let (mut down, mut up) = (0.0, 0.0);
    for _ in 0..rounds {
        let start = Instant::now();
        road.to_level(0);
        down += start.elapsed().as_secs_f64();
        let start = Instant::now();
        road.to_level(road.top());
        up += start.elapsed().as_secs_f64();
    }
    let steps = (rounds * road.top()) as f64;
    (steps / down, steps / up)
}
