//! Vertex clustering compared with meshoptimizer's: same meshes, same process, same number of triangles.
//!
//! ```text
//! cluster FILE|FOLDER... [--targets 50%,10%,1%] [--reps N] [--samples N] [--no-errors] [--two-stage]
//! ```
//! meshoptimizer runs first, once; its triangle count is the target of Lodsmith. Speeds come from the minimum time of
//! the repetitions, which alternate, in millions of input triangles per second, from buffers in memory to buffers in
//! memory. One thread is measured in processor time, two threads in wall-clock time, which needs an idle machine. The
//! speedups with two threads are wall-clock ratios to Lodsmith on one thread and to meshoptimizer. Their means cover
//! meshes of 60,000 triangles or more: smaller ones use one thread. Errors are two-way, in percent of the diagonal;
//! ratios are Lodsmith over meshoptimizer. With `--two-stage`, Lodsmith's `memoryless` replaces meshoptimizer.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints to its standard streams")]

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::{Method, MethodKind, NoControl, SimplifyOptions, Stop, simplify_with};
use lodsmith_bench::cases::{self, Target};
use lodsmith_bench::{Soup, process, stats};
use lodsmith_core::measure::{CompareOptions, Prepared, compare_prepared};

/// Minimum number of faces for a mesh to count in the two-thread means.
const MIN_TWO_THREAD_FACES: usize = 60_000;

struct Args {
    models: Vec<PathBuf>,
    targets: Vec<Target>,
    reps: usize,
    samples: usize,
    errors: bool,
    two_stage: bool,
}

fn parse() -> Result<Args> {
    let mut args = Args {
        models: Vec::new(),
        targets: [50.0, 10.0, 1.0].map(Target::Percent).to_vec(),
        reps: 7,
        samples: 100_000,
        errors: true,
        two_stage: false,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--targets" => {
                args.targets = value()?.split(',').map(Target::parse).collect::<Result<Vec<_>>>()?
            }
            "--reps" => args.reps = value()?.parse()?,
            "--samples" => args.samples = value()?.parse()?,
            "--no-errors" => args.errors = false,
            "--two-stage" => args.two_stage = true,
            path if !path.starts_with('-') => args.models.extend(cases::find_models(path.as_ref())?),
            other => bail!("unknown option {other}"),
        }
    }
    ensure!(!args.models.is_empty(), "no models: name files or folders");
    ensure!(args.reps > 0, "--reps must be 1 or more");
    Ok(args)
}

/// Processor time and wall-clock time.
type Seconds = [f64; 2];

struct CpuAndWallClock {
    cpu: f64,
    wall: Instant,
}

impl CpuAndWallClock {
    fn start() -> Self {
        Self { cpu: process::cpu_seconds(), wall: Instant::now() }
    }
    fn seconds(&self) -> Seconds {
        [process::cpu_seconds() - self.cpu, self.wall.elapsed().as_secs_f64()]
    }
}

fn ours(mesh: &Soup, target: usize, method: Method) -> Result<(Seconds, Soup)> {
    let mut options = SimplifyOptions::new(Stop::faces(target));
    options.method = method;
    let clock = CpuAndWallClock::start();
    let result = simplify_with(mesh.surface()?, &options, &mut NoControl)?;
    Ok((clock.seconds(), Soup::of_mesh(&result.mesh)))
}

fn sloppy(mesh: &Soup, target: usize) -> Result<(Seconds, Soup)> {
    let clock = CpuAndWallClock::start();
    let vertices = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&mesh.positions), 12, 0)?;
    let indices = meshopt::simplify_sloppy(&mesh.indices, &vertices, target * 3, f32::MAX, None);
    let seconds = clock.seconds();
    Ok((seconds, Soup { positions: mesh.positions.clone(), indices }.compacted()))
}

fn main() -> Result<()> {
    let args = parse()?;
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let (one, two) = (pool(1)?, pool(2)?);
    let all = process::all_cores()?;
    let rival = if args.two_stage { "memoryless" } else { "meshopt sloppy" };
    println!(
        "| model | faces | target | {rival} faces | lodsmith faces | {rival} Mtri/s | lodsmith 1 thread | 2 threads \
         | time ratio 1 thread | 2 threads over 1 | 2 threads over {rival} | {rival} mean / rms / max % | error ratio mean / rms / max |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|---|");
    let mut ratios: [Vec<f64>; 6] = Default::default();
    for path in &args.models {
        let mesh = Soup::read(path)?;
        let faces = mesh.face_count();
        let prepared = match args.errors {
            true => Some(all.install(|| Prepared::new(&mesh.surface()?).context("no faces"))?),
            false => None,
        };
        for target in &args.targets {
            let requested = target.of(faces);
            let theirs = |n: usize| match args.two_stage {
                true => one.install(|| ours(&mesh, n, MethodKind::Memoryless.into())),
                false => sloppy(&mesh, n),
            };
            let (_, rival) = theirs(requested)?;
            let count = rival.face_count();
            if count == 0 || count >= faces {
                eprintln!("{}: nothing to compare at {}", cases::stem(path), target.name());
                continue;
            }
            let mine = || ours(&mesh, count, Method::Cluster { cell: None, two_stage: args.two_stage });
            // Processor time: theirs, ours. Wall-clock time: ours on one thread, ours on two threads, theirs.
            let mut times: [Vec<f64>; 5] = Default::default();
            let mut result = Soup::default();
            for _ in 0..args.reps {
                let (seconds, _) = theirs(requested)?;
                times[0].push(seconds[0]);
                times[4].push(seconds[1]);
                let (seconds, first) = one.install(mine)?;
                times[1].push(seconds[0]);
                times[2].push(seconds[1]);
                let (seconds, second) = two.install(mine)?;
                times[3].push(seconds[1]);
                ensure!(first == second, "{}: threads change the result", cases::stem(path));
                result = first;
            }
            let [theirs_s, one_s, one_wall, two_s, theirs_wall] = times.each_ref().map(|t| stats::min(t));
            let speed = |s: f64| faces as f64 / s / 1e6;
            let mut errors = ("-".to_owned(), "-".to_owned());
            if let Some(prepared) = &prepared {
                let mut options = CompareOptions::default();
                options.samples = args.samples;
                let of = |soup: &Soup| -> Result<[f64; 3]> {
                    let candidate = Prepared::new(&soup.surface()?)?;
                    let c = all.install(|| compare_prepared(prepared, &candidate, &options));
                    Ok([c.mean, c.rms, c.hausdorff].map(|e| e.symmetric / c.diagonal * 100.0))
                };
                let [a, b] = [of(&rival)?, of(&result)?];
                errors.0 = a.map(|x| format!("{x:.4}")).join(" / ");
                errors.1 = [0, 1, 2].map(|k| format!("{:.2}", b[k] / a[k])).join(" / ");
                (0..3).for_each(|k| ratios[3 + k].push(b[k] / a[k]));
            }
            ratios[0].push(one_s / theirs_s);
            if faces >= MIN_TWO_THREAD_FACES {
                ratios[1].push(one_wall / two_s);
                ratios[2].push(theirs_wall / two_s);
            }
            println!(
                "| {} | {faces} | {} | {count} | {} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {} | {} |",
                cases::stem(path),
                target.name(),
                result.face_count(),
                speed(theirs_s),
                speed(one_s),
                speed(two_s),
                one_s / theirs_s,
                one_wall / two_s,
                theirs_wall / two_s,
                errors.0,
                errors.1
            );
        }
    }
    let means = ratios.map(|r| stats::geometric_mean(r).map_or("-".into(), |m| format!("{m:.2}")));
    println!(
        "geometric means: time {}, two threads over one {}, over {rival} {}, mean {}, rms {}, max {}",
        means[0], means[1], means[2], means[3], means[4], means[5]
    );
    Ok(())
}
