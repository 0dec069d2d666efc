//! Lodsmith compared with meshoptimizer: same meshes, same process, same run, one thread.
//!
//! ```text
//! rivals [FILE|FOLDER]... [--models FOLDER] [--all] [--quick] [--only TEXT] [--targets 50%,10%,1%,1000,100]
//!        [--orders file,morton,shuffled] [--clock wall|cpu] [--reps N] [--samples N] [--no-errors] [--json FILE]
//!        [--page FILE]
//! ```
//! From a folder, the program uses the models of `cases::MODELS` (of files with the same name the first), or every file
//! with `--all`; `--only` keeps models whose name contains TEXT. Every mesh is welded first, the same for all. Times
//! are measured from positions and indices in memory to positions and indices in memory, including preparation, in
//! wall-clock time or, on a shared machine, in processor time (`--clock cpu`); the repetitions of the three alternate.
//! meshoptimizer runs in its plain mode (which keeps the given positions) and in the mode that moves them (`update`),
//! whose copy of the input is not timed. Errors are two-way, in percent of the diagonal. They are the same for every
//! order up to noise, so they are measured once, in the order of the file. A meshoptimizer result above 1.02 × the
//! target is left out of all comparisons. `--page` writes the tables to the sections `rivals`, `rivals-losses` and
//! `rivals-cases` of a page.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints to its standard streams")]

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::{NoControl, SimplifyOptions, Stop, simplify_with};
use lodsmith_bench::cases::{self, Target};
use lodsmith_bench::order::Order;
use lodsmith_bench::{Soup, page, process, stats};
use lodsmith_core::measure::{CompareOptions, compare};
use lodsmith_core::numbers::grouped;
use serde_json::{Value, json};

/// A mesh of this many triangles or more counts as large in the published figures.
const MIN_LARGE_FACES: usize = 250_000;
/// The two sizes of meshes: the key and the name, and whether they are large.
const SIZES: [(&str, &str, bool); 2] = [("small", "below 250,000", false), ("large", "from 250,000", true)];

struct Args {
    models: Vec<PathBuf>,
    targets: Vec<Target>,
    orders: Vec<Order>,
    reps: Option<usize>,
    samples: usize,
    errors: bool,
    json: Option<PathBuf>,
    page: Option<PathBuf>,
}

fn parse() -> Result<Args> {
    let (mut inputs, mut only, mut all, mut quick) = (Vec::<PathBuf>::new(), String::new(), false, false);
    let mut targets = None;
    let mut orders = None;
    let (mut reps, mut samples, mut errors, mut json, mut page) = (None, 100_000, true, None, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--models" => inputs.push(value()?.into()),
            "--only" => only = value()?,
            "--all" => all = true,
            "--quick" => quick = true,
            "--targets" => {
                targets = Some(value()?.split(',').map(Target::parse).collect::<Result<Vec<_>>>()?);
            }
            "--orders" => {
                let order = |name: &str| {
                    Order::ALL
                        .into_iter()
                        .find(|o| o.name() == name)
                        .with_context(|| format!("no order {name}"))
                };
                orders = Some(value()?.split(',').map(order).collect::<Result<Vec<_>>>()?);
            }
            "--clock" => match value()?.as_str() {
                "wall" => {}
                "cpu" => _ = USE_CPU_TIME.set(true),
                other => bail!("no clock {other}"),
            },
            "--reps" => reps = Some(value()?.parse()?),
            "--samples" => samples = value()?.parse()?,
            "--no-errors" => errors = false,
            "--json" => json = Some(value()?.into()),
            "--page" => page = Some(PathBuf::from(value()?)),
            path if !path.starts_with('-') => inputs.push(path.into()),
            other => bail!("unknown option {other}"),
        }
    }
    ensure!(!inputs.is_empty(), "no models: name files or a folder");
    let mut models = Vec::new();
    let mut seen = HashSet::new();
    for input in &inputs {
        let named = input.is_file();
        let mut of_table =
            |stem: &str| all || named || (cases::MODELS.contains(&stem) && seen.insert(stem.to_owned()));
        models.extend(cases::find_models(input)?.into_iter().filter(|p| {
            let stem = cases::stem(p);
            of_table(&stem) && stem.contains(&only)
        }));
    }
    if quick {
        // Quick mode: two small models of different kinds, or the named ones.
        models.retain(|p| {
            !only.is_empty() || inputs.contains(p) || matches!(&*cases::stem(p), "bunny" | "fandisk")
        });
        targets.get_or_insert_with(|| vec![Target::Percent(10.0), Target::Percent(1.0)]);
        orders.get_or_insert_with(|| vec![Order::File]);
        reps = reps.or(Some(5));
        samples = samples.min(20_000);
    }
    ensure!(!models.is_empty(), "none of the models exists");
    ensure!(reps != Some(0), "--reps must be 1 or more");
    let orders = orders.unwrap_or_else(|| Order::ALL.to_vec());
    if let Some(page) = &page {
        ensure!(errors && orders == Order::ALL, "a page needs the errors and all orders");
        page::check(page, &["rivals", "rivals-losses", "rivals-cases"])?;
    }
    Ok(Args {
        models,
        targets: targets.unwrap_or_else(|| Target::DEFAULT.to_vec()),
        orders,
        reps,
        samples,
        errors,
        json,
        page,
    })
}

/// Returns the number of repetitions for a mesh of this size: more for short runs, which are noisier.
fn default_reps(faces: usize) -> usize {
    match faces {
        0..20_000 => 25,
        20_000..100_000 => 11,
        100_000..MIN_LARGE_FACES => 7,
        MIN_LARGE_FACES..500_000 => 5,
        _ => 3,
    }
}

/// The simplifiers, in column order.
const SIMPLIFIERS: [&str; 3] = ["lodsmith", "meshopt plain", "meshopt update"];

/// An error limit that never stops meshoptimizer, so that only the count does; its square is still finite.
const ANY_ERROR: f32 = 1e10;

fn lodsmith_run(mesh: &Soup, target: usize) -> Result<(f64, Soup)> {
    let options = SimplifyOptions::new(Stop::faces(target));
    let clock = Clock::start();
    let result = simplify_with(mesh.surface()?, &options, &mut NoControl)?;
    let seconds = clock.seconds();
    Ok((seconds, Soup::of_mesh(&result.mesh)))
}

fn plain_run(mesh: &Soup, target: usize) -> Result<(f64, Soup)> {
    let clock = Clock::start();
    let vertices = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&mesh.positions), 12, 0)?;
    let options = meshopt::SimplifyOptions::None;
    let indices = meshopt::simplify(&mesh.indices, &vertices, target * 3, ANY_ERROR, options, None);
    let seconds = clock.seconds();
    Ok((seconds, Soup { positions: mesh.positions.clone(), indices }.compacted()))
}

fn update_run(mesh: &Soup, target: usize) -> (f64, Soup) {
    let mut out = mesh.clone();
    let clock = Clock::start();
    let left = meshopt::simplify_with_update(
        &mut out.indices,
        &mut out.positions,
        &mut [],
        &[],
        0,
        None,
        target * 3,
        ANY_ERROR,
        meshopt::SimplifyOptions::None,
        None,
    );
    out.indices.truncate(left);
    let seconds = clock.seconds();
    (seconds, out.compacted())
}

/// A timer that uses the selected clock.
struct Clock {
    wall: Instant,
    cpu: f64,
}

/// True if [`Clock`] measures processor time, not wall time.
static USE_CPU_TIME: OnceLock<bool> = OnceLock::new();

impl Clock {
    fn start() -> Self {
        Self { cpu: process::cpu_seconds(), wall: Instant::now() }
    }
    fn seconds(&self) -> f64 {
        let wall = self.wall.elapsed().as_secs_f64();
        if USE_CPU_TIME.get() == Some(&true) { process::cpu_seconds() - self.cpu } else { wall }
    }
}

/// The measures of [`Errors`].
const MEASURES: [&str; 3] = ["mean", "rms", "max"];

/// Mean, RMS and maximum distance, in percent of the diagonal of the original.
type Errors = [f64; 3];

fn errors(original: &Soup, result: &Soup, samples: usize) -> Result<Errors> {
    let mut options = CompareOptions::default();
    options.samples = samples;
    let c = compare(&original.surface()?, &result.surface()?, &options)?;
    Ok([c.mean, c.rms, c.hausdorff].map(|e| e.symmetric / c.diagonal * 100.0))
}

/// One line of the table: one model, target and order.
struct Case {
    model: String,
    faces: usize,
    target: String,
    requested: usize,
    order: Order,
    /// Seconds of each repetition, in the order of [`SIMPLIFIERS`].
    times: [Vec<f64>; 3],
    /// Triangles of each result.
    faces_left: [usize; 3],
    errors: Option<[Errors; 3]>,
}

impl Case {
    fn min_time(&self, who: usize) -> f64 {
        stats::min(&self.times[who])
    }
    fn is_large(&self) -> bool {
        self.faces >= MIN_LARGE_FACES
    }
    fn rivals_that_reached(&self) -> impl Iterator<Item = usize> + '_ {
        let most = Target::max_faces(self.requested);
        (1..SIMPLIFIERS.len()).filter(move |&who| self.faces_left[who] <= most)
    }
    /// Lodsmith's time divided by the time of the fastest rival that reached the target, or of the fastest rival if
    /// none did.
    fn ratio(&self) -> f64 {
        let faster =
            |all: &mut dyn Iterator<Item = usize>| all.map(|who| self.min_time(who)).fold(f64::MAX, f64::min);
        let mut rivals = faster(&mut self.rivals_that_reached());
        if rivals == f64::MAX {
            rivals = faster(&mut (1..SIMPLIFIERS.len()));
        }
        self.min_time(0) / rivals
    }
    /// The minimum of each error over the rivals that reached the target; `None` if none did.
    fn best_rival(&self) -> Option<Errors> {
        let errors = self.errors?;
        self.rivals_that_reached().map(|who| errors[who]).reduce(|a, b| [0, 1, 2].map(|k| a[k].min(b[k])))
    }
    fn row(&self) -> String {
        let four = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.prec$}", prec = digits(x)) };
        let three = |e: Option<Errors>| e.map_or("-".into(), |e| e.map(four).join(" / "));
        let mark =
            |who: usize| if who == 0 || self.rivals_that_reached().any(|w| w == who) { "" } else { "*" };
        format!(
            "| {} | {} | {} | {} | {:.4} | {:.4}{} | {:.4}{} | {:.2} | {} | {} |",
            self.model,
            self.faces,
            self.target,
            self.order.name(),
            self.min_time(0),
            self.min_time(1),
            mark(1),
            self.min_time(2),
            mark(2),
            self.ratio(),
            three(self.errors.map(|e| e[0])),
            three(self.best_rival()),
        )
    }
    fn json(&self) -> Value {
        let who = |k: usize| {
            json!({
                "min_s": self.min_time(k), "median_s": stats::median(&self.times[k]), "faces": self.faces_left[k],
                "mean": self.errors.map(|e| e[k][0]), "rms": self.errors.map(|e| e[k][1]), "max": self.errors.map(|e| e[k][2]),
            })
        };
        json!({
            "model": self.model, "faces": self.faces, "target": self.target, "wanted": self.requested,
            "order": self.order.name(), "repetitions": self.times[0].len(), "ratio": self.ratio(),
            SIMPLIFIERS[0]: who(0), SIMPLIFIERS[1]: who(1), SIMPLIFIERS[2]: who(2),
        })
    }
}

/// Returns the number of decimals that show four significant digits.
fn digits(x: f64) -> usize {
    (3 - x.abs().log10().floor() as i32).clamp(0, 9) as usize
}

const HEAD: &str = "\
| model | faces | target | order | lodsmith s | meshopt plain s | meshopt update s | ratio to the faster | lodsmith mean / rms / max % | best of meshopt mean / rms / max % |
|---|--:|--:|---|--:|--:|--:|--:|---|---|";

fn main() -> Result<()> {
    let args = parse()?;
    process::one_thread()?;
    let pool = process::all_cores()?;
    let mut cases: Vec<Case> = Vec::new();
    let mut failures = 0;
    println!("{HEAD}");
    for path in &args.models {
        let model = cases::stem(path);
        let mesh = match Soup::read(path) {
            Ok(mesh) if mesh.face_count() > 0 => mesh,
            Ok(_) => continue,
            Err(error) => {
                eprintln!("{model}: {error:#}");
                failures += 1;
                continue;
            }
        };
        let faces = mesh.face_count();
        let targets: Vec<&Target> = args.targets.iter().filter(|t| t.of(faces) < faces).collect();
        let mut known: Vec<Option<[Errors; 3]>> = vec![None; targets.len()];
        for &order in &args.orders {
            let ordered = order.apply(&mesh);
            for (target, known) in targets.iter().zip(&mut known) {
                let requested = target.of(faces);
                let mut times: [Vec<f64>; 3] = Default::default();
                let mut results: [Soup; 3] = Default::default();
                let reps = args.reps.unwrap_or_else(|| default_reps(faces));
                for rep in 0..reps {
                    // The first simplifier rotates, so that none always runs after the same one.
                    for turn in 0..SIMPLIFIERS.len() {
                        let who = (rep + turn) % SIMPLIFIERS.len();
                        let (seconds, result) = match who {
                            0 => lodsmith_run(&ordered, requested)
                                .with_context(|| format!("{model} to {}", target.name()))?,
                            1 => plain_run(&ordered, requested)?,
                            _ => update_run(&ordered, requested),
                        };
                        times[who].push(seconds);
                        results[who] = result;
                    }
                }
                if args.errors && known.is_none() {
                    let mut all = [Errors::default(); 3];
                    for (errors_of, result) in all.iter_mut().zip(&results) {
                        *errors_of = if result.indices.is_empty() {
                            [f64::INFINITY; 3]
                        } else {
                            pool.install(|| errors(&mesh, result, args.samples))?
                        };
                    }
                    *known = Some(all);
                }
                let case = Case {
                    model: model.clone(),
                    faces,
                    target: target.name(),
                    requested,
                    order,
                    times,
                    faces_left: results.map(|r| r.face_count()),
                    errors: *known,
                };
                println!("{}", case.row());
                cases.push(case);
            }
        }
    }
    ensure!(!cases.is_empty(), "no case was run");
    let summary = summary(&cases);
    println!("\n`*`: did not reach the target.\n\n{}", summary.text);
    if let Some(path) = &args.json {
        let rows: Vec<Value> = cases.iter().map(Case::json).collect();
        let text = serde_json::to_string_pretty(&json!({"cases": rows, "summary": summary.json}))?;
        std::fs::write(path, text + "\n").with_context(|| format!("writing {}", path.display()))?;
    }
    if let Some(path) = &args.page {
        cases.sort_by_key(|c| c.faces);
        let clock = if USE_CPU_TIME.get() == Some(&true) { "processor" } else { "wall-clock" };
        let machine = process::machine();
        let about = format!("One run, best of several repetitions, {clock} time of one thread ({machine}):");
        let targets: Vec<String> = args.targets.iter().map(|target| target.name()).collect();
        let rows: Vec<String> = cases.iter().map(Case::row).collect();
        page::replace(
            path,
            &[
                ("rivals", format!("{about}\n\n{}\n{}", ratios_by_model(&cases, &targets), summary.text)),
                ("rivals-losses", losses(&cases, &targets)),
                ("rivals-cases", format!("{HEAD}\n{}", rows.join("\n"))),
            ],
        )?;
    }
    ensure!(failures == 0, "{failures} model(s) could not be read");
    Ok(())
}

/// Returns the table of ratios: a row for each model, a column for each target, in each cell all orders.
fn ratios_by_model(cases: &[Case], targets: &[String]) -> String {
    let names: Vec<String> = targets.iter().map(|target| target.replace('%', " %")).collect();
    let mut text = format!("| model | triangles | {} |\n", names.join(" | "));
    text += &format!("|---|--:|{}\n", "--:|".repeat(targets.len()));
    for of_model in cases.chunk_by(|a, b| a.model == b.model) {
        text += &format!("| {} | {} |", of_model[0].model, grouped(of_model[0].faces));
        for target in targets {
            let of_target = of_model.iter().filter(|case| case.target == *target);
            let ratios: Vec<String> = of_target.map(|case| format!("{:.2}", case.ratio())).collect();
            text += &format!(" {} |", if ratios.is_empty() { "–".into() } else { ratios.join(" · ") });
        }
        text.push('\n');
    }
    text
}

/// Returns a line for each size and measure in which meshoptimizer is better: in how many cases, and the worst.
fn losses(cases: &[Case], targets: &[String]) -> String {
    let mut text = String::new();
    for (_, name, large) in SIZES {
        let of_size: Vec<&Case> = cases.iter().filter(|c| c.is_large() == large).collect();
        let lost = of_size.iter().filter(|c| c.ratio() > 1.0).count();
        let worst = targets.iter().filter_map(|target| {
            let slower = of_size.iter().filter(|c| c.target == *target && c.ratio() > 1.0);
            let worst = slower.max_by(|a, b| a.ratio().total_cmp(&b.ratio()))?;
            Some(format!("{:.2} × at {target} ({}, {})", worst.ratio(), worst.model, worst.order.name()))
        });
        let worst: Vec<String> = worst.collect();
        if lost > 0 {
            text += &format!(
                "- **Time {name} triangles**: above the faster mode of meshoptimizer in {lost} of {} cases, at worst {}.\n",
                of_size.len(),
                worst.join(", "),
            );
        }
    }
    for (k, measure) in MEASURES.into_iter().enumerate() {
        let pairs = error_pairs(cases, k);
        let lost: Vec<_> = pairs.iter().filter(|(_, ours, theirs)| ours > theirs).collect();
        if let Some((case, ours, theirs)) = lost.iter().max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2))) {
            text += &format!(
                "- **Error, {measure}**: above the better mode of meshoptimizer in {} of {} cases, at worst {:.2} × ({} at {}).\n",
                lost.len(),
                pairs.len(),
                ours / theirs,
                case.model,
                case.target,
            );
        }
    }
    text
}

/// Returns our error and that of the better rival, for each model and target once: all orders have the same errors.
fn error_pairs(cases: &[Case], k: usize) -> Vec<(&Case, f64, f64)> {
    let mut seen = HashSet::new();
    let once = cases.iter().filter(|c| seen.insert((&c.model, &c.target)));
    once.filter_map(|c| Some((c, c.errors?[0][k], c.best_rival()?[k]))).collect()
}

struct Summary {
    text: String,
    json: Value,
}

fn summary(cases: &[Case]) -> Summary {
    let mut text = String::new();
    let mut json = serde_json::Map::new();
    for (key, name, large) in SIZES {
        let ratios: Vec<f64> = cases.iter().filter(|c| c.is_large() == large).map(Case::ratio).collect();
        if let Some(mean) = stats::geometric_mean(ratios.iter().copied()) {
            let worst = ratios.iter().copied().fold(0.0, f64::max);
            text += &format!(
                "- Time {name} triangles: {mean:.2} × the faster mode of meshoptimizer (geometric mean of {} cases), at worst {worst:.2} ×.\n",
                ratios.len()
            );
            json.insert(key.into(), json!({"cases": ratios.len(), "ratio": mean, "worst": worst}));
        }
    }
    for (k, measure) in MEASURES.into_iter().enumerate() {
        let pairs = error_pairs(cases, k);
        // Two zero errors are equal; their ratio is undefined.
        let real = pairs.iter().filter(|(_, _, theirs)| *theirs > 0.0 && theirs.is_finite());
        if let Some(mean) = stats::geometric_mean(real.map(|(_, ours, theirs)| ours / theirs)) {
            let won = pairs.iter().filter(|(_, ours, theirs)| ours <= theirs).count();
            let share = won as f64 / pairs.len() as f64;
            text += &format!(
                "- Error, {measure}: {mean:.2} × the better mode of meshoptimizer (geometric mean), not above it in {won} of {} cases ({:.0} %).\n",
                pairs.len(),
                share * 100.0
            );
            json.insert(
                measure.into(),
                json!({"cases": pairs.len(), "ratio": mean, "won": won, "share": share}),
            );
        }
    }
    Summary { text, json: json.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(faces: usize, times: [f64; 3], left: [usize; 3], errors: [Errors; 3]) -> Case {
        Case {
            model: format!("m{faces}"),
            faces,
            target: "100".into(),
            requested: 100,
            order: Order::File,
            times: times.map(|t| vec![t, t * 2.0]),
            faces_left: left,
            errors: Some(errors),
        }
    }

    #[test]
    fn a_rival_that_missed_the_target_is_ignored() {
        let missed = case(1000, [2.0, 1.0, 4.0], [100, 500, 100], [[1.0; 3], [0.1; 3], [2.0; 3]]);
        assert_eq!(missed.ratio(), 0.5);
        assert_eq!(missed.best_rival(), Some([2.0; 3]));
        let nobody = case(1000, [2.0, 1.0, 4.0], [100, 500, 500], [[1.0; 3]; 3]);
        assert_eq!((nobody.ratio(), nobody.best_rival()), (2.0, None));
    }

    #[test]
    fn the_summary_separates_small_and_large_meshes() {
        let errors = [[1.0, 1.0, 3.0], [2.0; 3], [4.0; 3]];
        let cases =
            [case(1000, [2.0, 1.0, 1.0], [100; 3], errors), case(300_000, [1.0, 2.0, 2.0], [100; 3], errors)];
        let got = summary(&cases).json;
        assert_eq!(got["small"]["ratio"], 2.0);
        assert_eq!(got["large"]["ratio"], 0.5);
        assert_eq!((&got["mean"]["won"], &got["max"]["won"]), (&json!(2), &json!(0)));
    }

    #[test]
    fn each_model_is_a_row_and_each_target_a_column() {
        let mut cases = vec![case(1000, [2.0, 1.0, 1.0], [100; 3], [[1.0; 3]; 3])];
        cases.push(Case { order: Order::Morton, ..case(1000, [3.0, 1.0, 1.5], [100; 3], [[1.0; 3]; 3]) });
        cases.push(Case { target: "10%".into(), ..case(300_000, [1.0, 2.0, 2.0], [100; 3], [[1.0; 3]; 3]) });
        let expected = "\
            | model | triangles | 100 | 10 % |\n|---|--:|--:|--:|\n\
            | m1000 | 1,000 | 2.00 · 3.00 | – |\n| m300000 | 300,000 | – | 0.50 |\n";
        assert_eq!(ratios_by_model(&cases, &["100".into(), "10%".into()]), expected);
    }

    #[test]
    fn losses_name_the_worst_case_of_each_target() {
        let better = [[1.0, 1.0, 3.0], [2.0; 3], [4.0; 3]];
        let mut cases = vec![case(1000, [2.0, 1.0, 1.0], [100; 3], better)];
        cases.push(Case { order: Order::Morton, ..case(1000, [3.0, 1.0, 1.5], [100; 3], better) });
        cases.push(case(2000, [0.5, 1.0, 1.0], [100; 3], [[1.0; 3]; 3]));
        cases.push(case(300_000, [1.0, 2.0, 2.0], [100; 3], [[1.0; 3]; 3]));
        let expected = "\
            - **Time below 250,000 triangles**: above the faster mode of meshoptimizer in 2 of 3 cases, \
            at worst 3.00 × at 100 (m1000, morton).\n\
            - **Error, max**: above the better mode of meshoptimizer in 1 of 3 cases, at worst 1.50 × (m1000 at 100).\n";
        assert_eq!(losses(&cases, &["100".into()]), expected);
    }

    #[test]
    fn meshoptimizer_gives_valid_results() {
        let mesh = cases::torus(40, 20);
        for (_, result) in [plain_run(&mesh, 400).unwrap(), update_run(&mesh, 400)] {
            assert!(result.face_count() <= 400 && result.face_count() > 300);
            assert!(result.surface().is_ok());
        }
    }

    #[test]
    fn four_significant_digits_are_shown() {
        assert_eq!((digits(12.3456), digits(0.001_234_5), digits(123_456.0)), (2, 6, 0));
    }
}
