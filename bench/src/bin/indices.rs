//! The index calls of the C interface compared with meshoptimizer's: same buffers, same process, one thread.
//!
//! ```text
//! indices [FILE|FOLDER]... [--call CALL]... [--targets 50%,25%,10%] [--errors 0.001,0.01,0.05] [--reps N]
//!         [--samples N]
//! ```
//! Calls: `plain` (`meshopt_simplify`, equal positions welded), `seams` (the same with the vertices of the file,
//! several at one position where attributes differ), `attributes` (`meshopt_simplifyWithAttributes`) and `update`
//! (`meshopt_simplifyWithUpdate`). Lodsmith runs to the count that meshoptimizer reached. Then both run to an error
//! limit without a target count. Times are minimum processor times of the repetitions, which alternate; errors are
//! two-way RMS distances in percent of the diagonal, and mean attribute differences.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use lodsmith_bench::cases::{self, Target};
use lodsmith_bench::{Soup, VertexBuffers, process, stats};
use lodsmith_c::IndexCall;
use lodsmith_core::measure::{CompareOptions, compare, compare_attributes};
use lodsmith_core::mesh::weld::weld_mesh;
use lodsmith_core::{Positions, TriMesh, VertexId};
use lodsmith_io::{ReadOptions, read_path};

/// An error limit that never stops a run.
const ANY_ERROR: f32 = 1e10;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Call {
    Plain,
    Seams,
    Attributes,
    Update,
}

impl Call {
    fn parse(name: &str) -> Result<Self> {
        Ok(match name {
            "plain" => Self::Plain,
            "seams" => Self::Seams,
            "attributes" => Self::Attributes,
            "update" => Self::Update,
            _ => bail!("no call {name}: plain, seams, attributes, update"),
        })
    }
}

struct Args {
    models: Vec<PathBuf>,
    calls: Vec<Call>,
    targets: Vec<Target>,
    errors: Vec<f32>,
    reps: usize,
    samples: usize,
}

/// Parses a comma-separated list; an empty text is an empty list.
fn list<T>(text: &str, parse: impl Fn(&str) -> Result<T>) -> Result<Vec<T>> {
    text.split(',').filter(|x| !x.is_empty()).map(parse).collect()
}

fn parse() -> Result<Args> {
    let targets = [50.0, 25.0, 10.0].map(Target::Percent).to_vec();
    let mut args = Args {
        models: Vec::new(),
        calls: Vec::new(),
        targets,
        errors: vec![0.001, 0.01, 0.05],
        reps: 7,
        samples: 100_000,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--call" => args.calls.push(Call::parse(&value()?)?),
            "--targets" => args.targets = list(&value()?, Target::parse)?,
            "--errors" => args.errors = list(&value()?, |x| Ok(x.parse()?))?,
            "--reps" => args.reps = value()?.parse()?,
            "--samples" => args.samples = value()?.parse()?,
            path => args.models.extend(cases::find_models(Path::new(path))?),
        }
    }
    ensure!(!args.models.is_empty() && args.reps > 0, "no models: name files or a folder");
    if args.calls.is_empty() {
        args.calls.push(Call::Plain);
    }
    Ok(args)
}

/// A mesh and the call that simplifies it.
struct Case {
    call: Call,
    name: String,
    buffers: VertexBuffers,
    /// The mesh of the buffers.
    mesh: TriMesh,
}

impl Case {
    fn read(call: Call, path: &Path) -> Result<Self> {
        let mesh = if call == Call::Plain {
            let soup = Soup::read(path)?;
            let triangles = soup.indices.as_chunks::<3>().0.iter().map(|t| t.map(VertexId)).collect();
            TriMesh::new(Positions::F32(soup.positions), triangles)?
        } else {
            let mut options = ReadOptions::default();
            options.folder = path.parent().map(Path::to_owned);
            let mut mesh = weld_mesh(&read_path(path, &options)?.mesh, None).mesh;
            // meshoptimizer does not support materials.
            mesh.set_regions(None)?;
            mesh
        };
        let buffers = VertexBuffers::new(&mesh);
        Ok(Self { call, name: cases::stem(path), mesh: buffers.mesh()?, buffers })
    }
}

/// The result of one run: seconds, buffers and the returned error.
struct Outcome {
    seconds: f64,
    buffers: VertexBuffers,
    error: f32,
}

fn theirs(case: &Case, target: usize, limit: f32) -> Result<Outcome> {
    let mut buffers = case.buffers.clone();
    let VertexBuffers { positions, indices, values, weights, .. } = &mut buffers;
    let (mut error, stride, none) = (0.0, size_of_val(&weights[..]), meshopt::SimplifyOptions::None);
    let started = process::cpu_seconds();
    match case.call {
        Call::Update => {
            let result_error = Some(&mut error);
            let count = meshopt::simplify_with_update(
                indices,
                positions,
                values,
                weights,
                stride,
                None,
                target,
                limit,
                none,
                result_error,
            );
            indices.truncate(count);
        }
        Call::Attributes => {
            let at = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(positions), 12, 0)?;
            let locks = vec![false; positions.len()];
            *indices = meshopt::simplify_with_attributes_and_locks(
                indices,
                &at,
                values,
                weights,
                stride,
                &locks,
                target,
                limit,
                none,
                Some(&mut error),
            );
        }
        Call::Plain | Call::Seams => {
            let at = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(positions), 12, 0)?;
            *indices = meshopt::simplify(indices, &at, target, limit, none, Some(&mut error));
        }
    }
    Ok(Outcome { seconds: process::cpu_seconds() - started, buffers, error })
}

fn ours(case: &Case, target: usize, limit: f32) -> Result<Outcome> {
    let mut buffers = case.buffers.clone();
    let started = process::cpu_seconds();
    let call = IndexCall {
        indices: &case.buffers.indices,
        positions: &case.buffers.positions,
        attributes: &case.buffers.values,
        weights: &case.buffers.weights,
        target_index_count: target,
        target_error: limit,
        ..IndexCall::default()
    };
    let error;
    match case.call {
        Call::Update => {
            let result = call.with_update().map_err(|text| anyhow!(text))?;
            (buffers.indices, buffers.positions, buffers.values) =
                (result.indices, result.positions, result.attributes);
            error = result.error;
        }
        Call::Attributes => {
            let result = call.with_attributes().map_err(|text| anyhow!(text))?;
            (buffers.indices, error) = (result.indices, result.error);
        }
        Call::Plain | Call::Seams => {
            let result = call.simplify().map_err(|text| anyhow!(text))?;
            (buffers.indices, error) = (result.indices, result.error);
        }
    }
    Ok(Outcome { seconds: process::cpu_seconds() - started, buffers, error })
}

fn best_of(reps: usize, mut run: impl FnMut(usize) -> Result<Outcome>) -> Result<[Outcome; 2]> {
    let mut best = [run(0)?, run(1)?];
    for rep in 1..reps {
        for who in [rep % 2, 1 - rep % 2] {
            let outcome = run(who)?;
            best[who].seconds = best[who].seconds.min(outcome.seconds);
        }
    }
    Ok(best)
}

/// Returns the errors of a result: RMS distance in percent of the diagonal, and mean differences of normals in degrees,
/// texture coordinates and colours.
fn errors(case: &Case, result: &VertexBuffers, samples: usize) -> Result<[Option<f64>; 4]> {
    let mut options = CompareOptions::default();
    options.samples = samples;
    let result = result.mesh()?;
    let c = compare(&case.mesh.surface(), &result.surface(), &options)?;
    let rms = Some(c.rms.symmetric / c.diagonal * 100.0);
    if case.call == Call::Plain {
        return Ok([rms, None, None, None]);
    }
    let a = compare_attributes(&case.mesh, &result, &options)?;
    Ok([
        rms,
        a.normals_deg.map(|e| e.mean.symmetric),
        a.uvs.map(|e| e.mean.symmetric),
        a.colors.map(|e| e.mean.symmetric),
    ])
}

/// Names of the ratios of ours to theirs.
const RATIOS: [&str; 7] = ["RMS", "normals", "uvs", "colours", "time", "faces", "returned error"];

/// Ratios of ours to theirs, of all rows of a table.
type Ratios = [Vec<f64>; RATIOS.len()];

fn row(case: &Case, goal: &str, pair: &[Outcome; 2], samples: usize, all: &mut Ratios) -> Result<String> {
    let [theirs, ours] = pair;
    let [a, b] = [errors(case, &theirs.buffers, samples)?, errors(case, &ours.buffers, samples)?];
    let ratio = |k: usize| Some(b[k]? / a[k]?);
    let ratios = [
        ratio(0),
        ratio(1),
        ratio(2),
        ratio(3),
        Some(ours.seconds / theirs.seconds),
        Some(ours.buffers.face_count() as f64 / theirs.buffers.face_count() as f64),
        Some(f64::from(ours.error) / f64::from(theirs.error)),
    ];
    for (all, ratio) in all.iter_mut().zip(ratios) {
        all.extend(ratio.filter(|x| x.is_finite() && *x > 0.0));
    }
    let pair = |k: usize| match (a[k], b[k]) {
        (Some(a), Some(b)) => format!("{a:.4} {b:.4} {:.2}", b / a),
        _ => String::new(),
    };
    Ok(format!(
        "| {}, {goal} | {} | {} {} | {} | {} | {} | {} | {:.4} {:.4} {:.2} | {:.4} {:.4} |",
        case.name,
        case.buffers.face_count(),
        theirs.buffers.face_count(),
        ours.buffers.face_count(),
        pair(0),
        pair(1),
        pair(2),
        pair(3),
        theirs.seconds,
        ours.seconds,
        ours.seconds / theirs.seconds,
        theirs.error,
        ours.error
    ))
}

fn print_means(all: &Ratios) {
    let means: Vec<String> = RATIOS
        .iter()
        .zip(all)
        .filter_map(|(name, all)| Some(format!("{name} {:.3}", stats::geometric_mean(all.iter().copied())?)))
        .collect();
    println!("\nOurs over theirs, geometric means: {}\n", means.join(", "));
}

const HEAD: &str = "\
| model, goal | faces | theirs, ours | RMS % | normals ° | uvs | colours | s | error |
|---|--:|--:|--:|--:|--:|--:|--:|--:|";

fn print_tables(cases: &[Case], args: &Args) -> Result<()> {
    println!("{HEAD}");
    let mut all = Ratios::default();
    for case in cases {
        for target in &args.targets {
            let requested = 3 * target.of(case.buffers.face_count());
            let reached = theirs(case, requested, ANY_ERROR)?.buffers.indices.len();
            let both = best_of(args.reps, |who| match who {
                0 => theirs(case, requested, ANY_ERROR),
                _ => ours(case, reached, ANY_ERROR),
            })?;
            println!("{}", row(case, &target.name(), &both, args.samples, &mut all)?);
        }
    }
    print_means(&all);
    println!("{HEAD}");
    let mut all = Ratios::default();
    for case in cases {
        for &limit in &args.errors {
            let both = best_of(args.reps, |who| match who {
                0 => theirs(case, 0, limit),
                _ => ours(case, 0, limit),
            })?;
            println!("{}", row(case, &format!("error {limit}"), &both, args.samples, &mut all)?);
        }
    }
    print_means(&all);
    Ok(())
}

fn main() -> Result<()> {
    let args = parse()?;
    process::one_thread()?;
    for &call in &args.calls {
        let cases: Vec<Case> =
            args.models.iter().map(|path| Case::read(call, path)).collect::<Result<_>>()?;
        print_tables(&cases, &args)?;
    }
    Ok(())
}
