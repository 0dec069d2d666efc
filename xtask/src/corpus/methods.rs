//! Runs every method on every model of a folder, to 50, 10 and 1 %.
//!
//! Checks of each result: no crash and no hang, at most the requested triangles if the report says `reached` and a
//! reason if not, never more triangles than before, a measurable distance, and no more defects of any kind than in the
//! input, except those that the method may add by design ([`ALLOWED_DEFECTS`]).

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::{Limits, Outcome, RATIOS, SUPPORTED_EXTENSIONS, call, extension, one_line, value};

/// Kinds of defects that a method may add by design. Folds are reported but not checked: on noisy scans every
/// method has some.
const ALLOWED_DEFECTS: &[(&str, &[&str])] = &[
    ("cluster", &["non_manifold_edges", "border_edges", "misoriented_edges"]),
    // Borders are resampled with edges of the new length.
    ("remesh", &["border_edges"]),
];
/// Larger models are skipped unless requested: the whole run should take minutes.
pub(super) const DEFAULT_MAX_FACES: u64 = 250_000;
/// Samples per comparison: enough to detect a misplaced result.
const SAMPLES: &str = "5000";

/// The settings of the sweep.
pub(super) struct Sweep {
    pub(super) command: PathBuf,
    pub(super) folder: PathBuf,
    pub(super) files: Vec<PathBuf>,
    /// Limits for one method on one model.
    pub(super) limits: Limits,
    pub(super) largest: u64,
}

/// The result of one method on one model at one ratio.
struct Case {
    method: String,
    /// `.` target reached, `*` ended above the target with a reason, `!` a check failed.
    mark: char,
    seconds: f64,
    rms: Option<f64>,
    folds: u64,
    problems: Vec<String>,
}

/// A model and its results.
struct MethodsRow {
    name: String,
    faces: Option<u64>,
    /// The results for each ratio.
    cases: Vec<Vec<Case>>,
    /// The reason for having no results.
    skipped: Option<String>,
}

impl Sweep {
    /// Runs the sweep on several models in parallel, and prints the tables.
    pub(super) fn run(&self) -> Result<()> {
        let next = AtomicUsize::new(0);
        let rows: Mutex<BTreeMap<usize, Result<MethodsRow>>> = Mutex::default();
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..workers {
                scope.spawn(|| {
                    while let Some((i, file)) = take(&self.files, &next) {
                        let row = self.row(file);
                        rows.lock().expect("no thread panics with it").insert(i, row);
                    }
                });
            }
        });
        let rows: Vec<MethodsRow> =
            rows.into_inner().expect("no thread panics with it").into_values().collect::<Result<_>>()?;
        print(&rows)
    }

    fn row(&self, file: &Path) -> Result<MethodsRow> {
        let name = file.strip_prefix(&self.folder).unwrap_or(file).to_string_lossy().replace('\\', "/");
        let mut row = MethodsRow { name, faces: None, cases: Vec::new(), skipped: None };
        if !SUPPORTED_EXTENSIONS.contains(&&*extension(file)) {
            row.skipped = Some("the format cannot be read".to_owned());
            return Ok(row);
        }
        let info = call(&self.command, &["info".as_ref(), file.as_os_str(), "--json".as_ref()], self.limits)?;
        let Some(about) = value(&info).filter(|_| info.status == Some(0)) else {
            // The run without `--methods` checks damaged files.
            row.skipped = Some(one_line(&info));
            return Ok(row);
        };
        row.faces = about["faces"].as_u64();
        if row.faces.is_none_or(|n| n > self.largest) {
            row.skipped = Some(format!("more than {} triangles: --largest N", self.largest));
            return Ok(row);
        }
        for ratio in RATIOS {
            row.cases.push(self.cases(file, ratio)?);
        }
        Ok(row)
    }

    /// Runs all methods in one process; after a failure one by one, to find the method that caused it.
    fn cases(&self, file: &Path, ratio: f64) -> Result<Vec<Case>> {
        let all = self.call(file, ratio, None)?;
        if let Some(report) = value(&all).filter(|_| matches!(all.status, Some(0 | 1))) {
            return Ok(evaluate_report(&report, ratio));
        }
        let mut cases = Vec::new();
        for method in METHODS {
            let one = self.call(file, ratio, Some(method))?;
            match value(&one).filter(|_| matches!(one.status, Some(0 | 1))) {
                Some(report) => cases.extend(evaluate_report(&report, ratio)),
                None => cases.push(Case {
                    method: method.to_owned(),
                    mark: '!',
                    seconds: one.seconds,
                    rms: None,
                    folds: 0,
                    problems: vec![format!(
                        "ends with {:?} after {:.1} s: {}",
                        one.status,
                        one.seconds,
                        one_line(&one)
                    )],
                }),
            }
        }
        Ok(cases)
    }

    fn call(&self, file: &Path, ratio: f64, method: Option<&str>) -> Result<Outcome> {
        // (The methods share the time.)
        let count = if method.is_some() { 1 } else { METHODS.len() };
        let seconds = self.limits.seconds * count as f64;
        let (ratio, limit) = (ratio.to_string(), seconds.to_string());
        let mut args: Vec<&OsStr> = vec!["methods".as_ref(), file.as_os_str()];
        let options =
            ["--json", "--threads", "1", "--samples", SAMPLES, "--ratio", &ratio, "--time-limit", &limit];
        args.extend(options.iter().map(OsStr::new));
        if let Some(method) = method {
            args.extend(["--method", method].map(OsStr::new));
        }
        let limits = Limits { seconds, ..self.limits };
        call(&self.command, &args, limits)
    }
}

/// The names of all methods.
const METHODS: [&str; lodsmith::MethodKind::ALL.len()] = {
    let mut names = [""; lodsmith::MethodKind::ALL.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = lodsmith::MethodKind::ALL[i].name();
        i += 1;
    }
    names
};

fn take<'a, T>(items: &'a [T], next: &AtomicUsize) -> Option<(usize, &'a T)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    items.get(i).map(|item| (i, item))
}

/// Evaluates the report of `lodsmith methods`.
fn evaluate_report(report: &Value, ratio: f64) -> Vec<Case> {
    let before = report["input"]["faces"].as_u64().unwrap_or(0);
    let rows = report["methods"].as_array().map_or(&[][..], Vec::as_slice);
    // If all methods report the same error, the mesh is the cause.
    let input = &report["input"]["defects"];
    let is_mesh_error = rows.first().map(|r| &r["error"]).filter(|e| rows.iter().all(|r| r["error"] == **e));
    let is_mesh_error = is_mesh_error.is_some_and(Value::is_string);
    rows.iter().map(|row| evaluate_method(row, (before, input), ratio, is_mesh_error)).collect()
}

/// Returns the number of misoriented or non-manifold edges: a non-manifold edge of four faces may become one
/// of two faces that is misoriented.
fn twisted_edge_count(defects: &Value) -> Option<u64> {
    Some(defects["misoriented_edges"].as_u64()? + defects["non_manifold_edges"].as_u64()?)
}

fn evaluate_method(row: &Value, (before, input): (u64, &Value), ratio: f64, is_mesh_error: bool) -> Case {
    let method = row["method"].as_str().unwrap_or_default().to_owned();
    let mut case = Case { method, mark: '*', seconds: 0.0, rms: None, folds: 0, problems: Vec::new() };
    let mut problem = |text: String| case.problems.push(text);
    if let Some(error) = row["error"].as_str() {
        if !is_mesh_error || error.contains("internal error") {
            problem(error.to_owned());
            case.mark = '!';
        }
        return case;
    }
    let faces = row["faces"].as_u64().unwrap_or(u64::MAX);
    let target = ((before as f64 * ratio).round() as u64).max(1);
    let reached = row["reached"] == true;
    if faces > before {
        problem(format!("{faces} faces from {before}"));
    }
    if reached && faces > target {
        problem(format!("reached with {faces} faces of {target}"));
    }
    let why = row["stopped_by"].as_str().unwrap_or_default();
    let has_refusals = row["refusals"].as_object().is_some_and(|r| !r.is_empty());
    match why {
        "time_limit" => problem("stopped by the time limit".to_owned()),
        "refusals" if !has_refusals => problem("not reached, and no reason".to_owned()),
        _ => {}
    }
    if row["measured"].is_null() {
        problem("its distance cannot be measured".to_owned());
    }
    let may_rise = ALLOWED_DEFECTS.iter().find(|m| m.0 == case.method).map_or(&[][..], |m| m.1);
    for (name, n) in row["new_defects"].as_object().into_iter().flatten() {
        let n = n.as_u64().unwrap_or(u64::MAX);
        let is_twist_undone =
            name == "misoriented_edges" && twisted_edge_count(&row["defects"]) <= twisted_edge_count(input);
        if name == "folds" {
            case.folds = n;
        } else if is_twist_undone {
            // Their sum has not increased.
        } else if n > 0 && !may_rise.contains(&name.as_str()) {
            case.problems.push(format!("{n} new {}", name.replace('_', " ")));
        }
    }
    case.seconds = row["seconds"].as_object().into_iter().flatten().filter_map(|s| s.1.as_f64()).sum();
    case.rms = row["relative_to_diagonal"]["rms"].as_f64();
    case.mark = match (case.problems.is_empty(), reached) {
        (false, _) => '!',
        (true, true) => '.',
        (true, false) => '*',
    };
    case
}

fn print(rows: &[MethodsRow]) -> Result<()> {
    println!(
        "`.` reached, `*` ended above the target with a reason, `!` something is wrong; for 50, 10 and 1 %\n"
    );
    println!("| file | faces | {} | |", METHODS.join(" | "));
    println!("|---|--:|{}---|", "---|".repeat(METHODS.len()));
    let mut failed = 0;
    for row in rows {
        let marks = |method: &str| -> String {
            row.cases.iter().flatten().filter(|c| c.method == method).map(|c| c.mark).collect()
        };
        let marks: Vec<_> = METHODS.iter().map(|m| marks(m)).collect();
        let describe = |(cases, ratio): (&Vec<Case>, f64)| -> Vec<String> {
            let of = |c: &Case| {
                (!c.problems.is_empty())
                    .then(|| format!("{} to {ratio}: {}", c.method, c.problems.join(", ")))
            };
            cases.iter().filter_map(of).collect()
        };
        let problems: Vec<String> = row.cases.iter().zip(RATIOS).flat_map(describe).collect();
        failed += usize::from(!problems.is_empty());
        let remark = match (&row.skipped, problems.is_empty()) {
            (Some(why), _) => format!("skipped: {why}"),
            (None, true) => String::new(),
            (None, false) => format!("**FAILS**: {}", problems.join("; ")),
        };
        let faces = row.faces.map_or("-".to_owned(), |n| n.to_string());
        println!("| {} | {faces} | {} | {} |", row.name, marks.join(" | "), remark.replace('|', "\\|"));
    }
    println!(
        "\n| method | runs | reached | above the target | wrong | new folds | seconds | slowest | RMS to the default's |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|");
    for method in METHODS {
        println!("{}", summary(rows, method));
    }
    let run = rows.iter().filter(|r| r.skipped.is_none()).count();
    println!("\n{run} models of {} files, {failed} with problems", rows.len());
    ensure!(run > 0, "no model was run");
    ensure!(failed == 0, "{failed} of {run} models have problems");
    Ok(())
}

fn summary(rows: &[MethodsRow], method: &str) -> String {
    let all = || rows.iter().flat_map(|r| &r.cases);
    let own: Vec<&Case> = all().flatten().filter(|c| c.method == method).collect();
    let marked = |mark: char| own.iter().filter(|c| c.mark == mark).count();
    let seconds: f64 = own.iter().map(|c| c.seconds).sum();
    let slowest = own.iter().fold(0f64, |m, c| m.max(c.seconds));
    // Distances are comparable only if both reached the same target.
    let rms = |cases: &[Case], name: &str| {
        cases.iter().find(|c| c.method == name && c.mark == '.').and_then(|c| c.rms).filter(|r| *r > 1e-9)
    };
    let ratios: Vec<f64> =
        all().filter_map(|c| Some(rms(c, method)?.ln() - rms(c, METHODS[0])?.ln())).collect();
    let mean = (ratios.iter().sum::<f64>() / ratios.len().max(1) as f64).exp();
    format!(
        "| {method} | {} | {} | {} | {} | {} | {seconds:.1} | {slowest:.2} | {} |",
        own.len(),
        marked('.'),
        marked('*'),
        marked('!'),
        own.iter().map(|c| c.folds).sum::<u64>(),
        if ratios.is_empty() { "-".to_owned() } else { format!("{mean:.2} in {}", ratios.len()) },
    )
}

/// Parses the number after an option of the command line.
pub(super) fn count(value: Option<&String>) -> Result<u64> {
    let value = value.context("--largest needs a number of triangles")?;
    value.parse().with_context(|| format!("--largest {value}: not a number of triangles"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn row(change: impl Fn(&mut Value)) -> Value {
        let mut row = json!({
            "method": "quadric", "faces": 50, "reached": true, "stopped_by": "ratio", "refusals": {},
            "measured": {}, "new_defects": { "border_edges": 0, "folds": 0, "misoriented_edges": 0 },
            "defects": { "misoriented_edges": 0, "non_manifold_edges": 2 }, "seconds": { "simplify": 0.5 },
            "relative_to_diagonal": { "rms": 0.01 },
        });
        change(&mut row);
        row
    }

    #[test]
    fn wrong_results_are_detected() {
        let input = json!({ "misoriented_edges": 0, "non_manifold_edges": 3 });
        let mark =
            |change: &dyn Fn(&mut Value)| evaluate_method(&row(change), (100, &input), 0.5, false).mark;
        assert_eq!(mark(&|_| {}), '.');
        assert_eq!(mark(&|r| r["new_defects"]["folds"] = 3.into()), '.');
        assert_eq!(mark(&|r| r["faces"] = 51.into()), '!');
        assert_eq!(mark(&|r| r["new_defects"]["border_edges"] = 1.into()), '!');
        assert_eq!(mark(&|r| r["measured"] = Value::Null), '!');
        assert_eq!(mark(&|r| r["error"] = "no".into()), '!');
        let twisted = |r: &mut Value, n: u64| {
            r["new_defects"]["misoriented_edges"] = n.into();
            r["defects"]["misoriented_edges"] = n.into();
        };
        assert_eq!(mark(&|r| twisted(r, 1)), '.');
        assert_eq!(mark(&|r| twisted(r, 2)), '!');
        let short = |r: &mut Value, by: &str| {
            (r["reached"], r["faces"], r["stopped_by"]) = (false.into(), 80.into(), by.into());
        };
        assert_eq!(mark(&|r| short(r, "exhausted")), '*');
        assert_eq!(mark(&|r| short(r, "refusals")), '!');
        assert_eq!(mark(&|r| short(r, "time_limit")), '!');
        let refused = |r: &mut Value| {
            short(r, "refusals");
            r["refusals"] = json!({ "border": 3 });
        };
        assert_eq!(mark(&refused), '*');
        let cluster = |r: &mut Value| {
            r["method"] = "cluster".into();
            r["new_defects"]["border_edges"] = 9.into();
        };
        assert_eq!(mark(&cluster), '.');
    }

    #[test]
    fn an_error_of_all_methods_is_caused_by_the_mesh() {
        let fails = |error: &str| json!({ "method": "a", "error": error });
        let report = |b: &str| json!({ "input": { "faces": 1 }, "methods": [fails("flat"), fails(b)] });
        let wrong = |report: &Value| evaluate_report(report, 0.5).iter().filter(|c| c.mark == '!').count();
        assert_eq!(wrong(&report("flat")), 0);
        assert_eq!(wrong(&report("internal error")), 2);
    }
}
