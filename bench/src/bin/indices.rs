//! The index call of the C interface beside `meshopt_simplify`: same buffers, same process, one thread.
//!
//! ```text
//! indices [FILE|FOLDER]... [--targets 50%,25%,10%] [--errors 0.01,0.001] [--reps N] [--samples N] [--seams]
//! ```
//! Ours runs to the count that meshoptimizer reached. Then both run to an error alone, whatever the count. Times are
//! processor times, the least of the repetitions, which alternate; errors are two-way RMS distances. With `--seams` the vertices of a file stay
//! as they are, several at one position where attributes differ; else they are welded.
#![allow(clippy::print_stdout, reason = "a program speaks on its standard output")]

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use lodsmith_bench::cases::{self, Target};
use lodsmith_bench::{Soup, process, stats};
use lodsmith_c::simplify_indices;
use lodsmith_core::measure::{CompareOptions, compare};
use lodsmith_core::{TriMesh, WedgeId};
use lodsmith_io::{ReadOptions, read_path};

/// An error bound that never ends a run.
const ANY_ERROR: f32 = 1e10;

struct Args {
    models: Vec<PathBuf>,
    targets: Vec<Target>,
    errors: Vec<f32>,
    reps: usize,
    samples: usize,
    has_seams: bool,
}

fn parse() -> Result<Args> {
    let targets = [50.0, 25.0, 10.0].map(Target::Percent).to_vec();
    let mut args = Args {
        models: Vec::new(),
        targets,
        errors: vec![0.01, 0.001],
        reps: 7,
        samples: 100_000,
        has_seams: false,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().with_context(|| format!("{word} needs a value"));
        match word.as_str() {
            "--targets" => args.targets = value()?.split(',').map(Target::parse).collect::<Result<_>>()?,
            "--errors" => args.errors = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            "--reps" => args.reps = value()?.parse()?,
            "--samples" => args.samples = value()?.parse()?,
            "--seams" => args.has_seams = true,
            place => args.models.extend(cases::find_models(Path::new(place))?),
        }
    }
    ensure!(!args.models.is_empty() && args.reps > 0, "no models: name files or a folder");
    Ok(args)
}

/// Reads a file with a vertex for each wedge.
fn read_with_seams(path: &Path) -> Result<Soup> {
    let mut options = ReadOptions::default();
    options.folder = path.parent().map(Path::to_owned);
    let mesh: TriMesh = read_path(path, &options)?.mesh;
    let view = mesh.positions().view();
    let place = |w: usize| view.get(mesh.vertex_of(WedgeId::new(w))).map(|x| x as f32);
    let positions = (0..mesh.wedge_count()).map(place).collect();
    Ok(Soup { positions, indices: mesh.triangles().iter().flatten().map(|w| w.0).collect() }.compacted())
}

/// One result: seconds, indices and the returned error.
struct Outcome {
    seconds: f64,
    indices: Vec<u32>,
    error: f32,
}

fn theirs(mesh: &Soup, target: usize, limit: f32) -> Result<Outcome> {
    let started = process::cpu_seconds();
    let vertices = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&mesh.positions), 12, 0)?;
    let mut error = 0.0;
    let none = meshopt::SimplifyOptions::None;
    let indices = meshopt::simplify(&mesh.indices, &vertices, target, limit, none, Some(&mut error));
    Ok(Outcome { seconds: process::cpu_seconds() - started, indices, error })
}

fn ours(mesh: &Soup, target: usize, limit: f32) -> Result<Outcome> {
    let started = process::cpu_seconds();
    let (indices, error) =
        simplify_indices(&mesh.indices, &mesh.positions, target, limit, 0).map_err(|text| anyhow!(text))?;
    Ok(Outcome { seconds: process::cpu_seconds() - started, indices, error })
}

fn best_of(reps: usize, mut run: impl FnMut(usize) -> Result<Outcome>) -> Result<[Outcome; 2]> {
    let mut least = [run(0)?, run(1)?];
    for rep in 1..reps {
        for who in [rep % 2, 1 - rep % 2] {
            let outcome = run(who)?;
            least[who].seconds = least[who].seconds.min(outcome.seconds);
        }
    }
    Ok(least)
}

fn rms(mesh: &Soup, result: &[u32], samples: usize) -> Result<f64> {
    let mut options = CompareOptions::default();
    options.samples = samples;
    let result = Soup { positions: mesh.positions.clone(), indices: result.to_vec() };
    let c = compare(&mesh.surface()?, &result.surface()?, &options)?;
    Ok(c.rms.symmetric / c.diagonal * 100.0)
}

/// Ratios of ours to theirs: RMS, time, faces, returned error.
type Ratios = [Vec<f64>; 4];

fn row(
    mesh: &Soup,
    name: &str,
    [theirs, ours]: &[Outcome; 2],
    samples: usize,
    all: &mut Ratios,
) -> Result<String> {
    let [a, b] = [rms(mesh, &theirs.indices, samples)?, rms(mesh, &ours.indices, samples)?];
    let ratios = [
        b / a,
        ours.seconds / theirs.seconds,
        ours.indices.len() as f64 / theirs.indices.len() as f64,
        f64::from(ours.error) / f64::from(theirs.error),
    ];
    for (all, ratio) in all.iter_mut().zip(ratios).filter(|x| x.1.is_finite() && x.1 > 0.0) {
        all.push(ratio);
    }
    Ok(format!(
        "| {name} | {} | {} | {} | {a:.4} | {b:.4} | {:.2} | {:.4} | {:.4} | {:.2} | {:.4} | {:.4} |",
        mesh.face_count(),
        theirs.indices.len() / 3,
        ours.indices.len() / 3,
        ratios[0],
        theirs.seconds,
        ours.seconds,
        ratios[1],
        theirs.error,
        ours.error
    ))
}

fn print_means(all: &Ratios) {
    let mean = |k: usize| stats::geometric_mean(all[k].iter().copied()).unwrap_or(f64::NAN);
    println!(
        "\nOurs over theirs, geometric means: RMS {:.3}, time {:.3}, faces {:.3}, returned error {:.3}\n",
        mean(0),
        mean(1),
        mean(2),
        mean(3)
    );
}

const HEAD: &str = "\
| model, goal | faces | theirs | ours | RMS % theirs | ours | ratio | s theirs | ours | ratio | error theirs | ours |
|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|";

fn main() -> Result<()> {
    let args = parse()?;
    process::one_thread()?;
    let read = |path: &PathBuf| if args.has_seams { read_with_seams(path) } else { Soup::read(path) };
    let meshes: Vec<(String, Soup)> =
        args.models.iter().map(|path| Ok((cases::stem(path), read(path)?))).collect::<Result<_>>()?;
    println!("{HEAD}");
    let mut all = Ratios::default();
    for (name, mesh) in &meshes {
        for target in &args.targets {
            let wanted = 3 * target.of(mesh.face_count());
            let reached = theirs(mesh, wanted, ANY_ERROR)?.indices.len();
            let both = best_of(args.reps, |who| match who {
                0 => theirs(mesh, wanted, ANY_ERROR),
                _ => ours(mesh, reached, ANY_ERROR),
            })?;
            println!("{}", row(mesh, &format!("{name}, {}", target.name()), &both, args.samples, &mut all)?);
        }
    }
    print_means(&all);
    println!("{HEAD}");
    let mut all = Ratios::default();
    for (name, mesh) in &meshes {
        for &limit in &args.errors {
            let both = best_of(args.reps, |who| match who {
                0 => theirs(mesh, 0, limit),
                _ => ours(mesh, 0, limit),
            })?;
            println!("{}", row(mesh, &format!("{name}, error {limit}"), &both, args.samples, &mut all)?);
        }
    }
    print_means(&all);
    Ok(())
}
