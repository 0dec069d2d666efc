//! Tables of accuracy and time from the results of a benchmark lab that runs many simplifiers.
//!
//! ```text
//! accuracy FOLDER [--name PEER] [--page FILE]
//! ```
//! FOLDER has the files `times.jsonl` and `scores.jsonl`, with an object in each line for each mesh, target and peer;
//! PEER is Lodsmith (`lodsmith/memoryless`, see `peer_lodsmith.rs`). The tables are printed, or written to the sections
//! of a page: `accuracy`, `accuracy-losses` and `accuracy-cases`, and for the models of suite `wild` (real CAD parts
//! and game assets) `wild-summary`, `wild-losses` and `wild`. If a folder has no case of one kind, its sections do not
//! change.
//!
//! In each case and measure, Lodsmith is compared with the best rival. A rival counts if it reached the target or has
//! no more faces than the result of Lodsmith; in suite `wild`, if it added no non-manifold or border edges and has at
//! most two faces more than the result of Lodsmith.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::cmp::Reverse;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use lodsmith_bench::cases::Target;
use lodsmith_bench::{page, stats};
use lodsmith_core::numbers::{grouped, significant};
use serde_json::Value;

/// The tools of the table, by peer. Other peers count only as the best rival of a case.
const TOOLS: [(&str, &str); 12] = [
    ("meshopt/simplify", "meshoptimizer, plain"),
    ("meshopt/update", "meshoptimizer, with update"),
    ("meshlab/qec", "MeshLab, quadric edge collapse"),
    ("cgal/lt", "CGAL, Lindstrom-Turk"),
    ("cgal/gh-plane", "CGAL, Garland-Heckbert planes"),
    ("openmesh/quadric", "OpenMesh, quadrics"),
    ("fastsimp/agg7", "fast-simplification"),
    ("pyfqmr/agg7", "pyfqmr"),
    ("vtk/quadric", "VTK, quadric decimation"),
    ("open3d/quadric", "Open3D, quadric decimation"),
    ("igl/qslim", "libigl, qslim"),
    ("blender/collapse", "Blender, decimate"),
];

/// Models of suite `wild` whose name does not begin with `wild-`.
const WILD: [&str; 6] = ["hammer", "heptoroid", "homer", "spot", "suzanne", "teapot"];

/// The measures: the key in `scores.jsonl` and the name.
const MEASURES: [(&str, &str); 3] = [("mean", "mean"), ("rms", "RMS"), ("max", "largest")];

/// Errors below this, in percent of the diagonal, count as equal: the resolution of single precision.
const EQUAL_BELOW: f64 = 6e-6;

/// Results with fewer faces do not count as the worst case of suite `wild`: a guess.
const WORST_MIN_FACES: usize = 300;

/// A result of a peer.
struct Outcome {
    peer: String,
    faces: usize,
    /// In percent of the diagonal, in the order of [`MEASURES`].
    errors: [f64; 3],
    cpu_s: f64,
    adds_defects: bool,
    flipped: usize,
}

/// Returns the result of a peer; `None` if it failed or was not measured.
fn outcome(time: &Value, score: &Value) -> Option<Outcome> {
    let count = |key: &str| score[key].as_u64();
    // An error that is not a number was written as null.
    let errors = MEASURES.map(|(key, _)| score[key].as_f64());
    Some(Outcome {
        peer: time["peer"].as_str()?.to_owned(),
        faces: count("faces")? as usize,
        errors: [errors[0]?, errors[1]?, errors[2]?],
        cpu_s: time["total_cpu"].as_f64()?,
        adds_defects: ["nonmanifold_edges", "boundary_edges"]
            .iter()
            .any(|key| count(key) > score["ref"][key].as_u64()),
        flipped: count("flipped_faces")? as usize,
    })
}

/// A mesh and a target.
struct Case {
    mesh: String,
    target: String,
    faces: usize,
    ours: Outcome,
    /// The rivals that count.
    rivals: Vec<Outcome>,
}

/// The figure of Lodsmith divided by the figure of the best rival.
struct Share<'a> {
    value: f64,
    case: &'a Case,
    rival: &'a str,
}

/// Divides two errors.
fn ratio(error: f64, other: f64) -> f64 {
    error.max(EQUAL_BELOW) / other.max(EQUAL_BELOW)
}

impl Case {
    fn is_wild(&self) -> bool {
        self.mesh.starts_with("wild-") || WILD.contains(&&*self.mesh)
    }
    fn name(&self) -> &str {
        self.mesh.strip_prefix("wild-").unwrap_or(&self.mesh)
    }
    fn target(&self) -> String {
        if self.target.ends_with('%') { self.target.clone() } else { format!("{} faces", self.target) }
    }
    /// Returns the share for a measure; `None` if no rival counts.
    fn share(&self, k: usize) -> Option<Share<'_>> {
        let best = self.rivals.iter().min_by(|a, b| a.errors[k].total_cmp(&b.errors[k]))?;
        Some(Share { value: ratio(self.ours.errors[k], best.errors[k]), case: self, rival: &best.peer })
    }
    /// Returns the cells of the three measures.
    fn cells(&self) -> String {
        let cell = |k: usize| {
            let share = self.share(k).map_or("–".into(), |s| format!("{:.2} {}", s.value, s.rival));
            format!("{} % · {share}", significant(self.ours.errors[k], 3))
        };
        [0, 1, 2].map(cell).join(" | ")
    }
}

/// Reads the objects of a file, one a line, by key. Of equal keys the last counts.
fn rows(path: &Path) -> Result<BTreeMap<String, Value>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let row = |line: &str| {
        // Python writes numbers that JSON does not have.
        let line = line.replace(":NaN", ":null").replace(":Infinity", ":null").replace(":-Infinity", ":null");
        let row: Value =
            serde_json::from_str(&line).with_context(|| format!("{}: {line}", path.display()))?;
        Ok((row["key"].as_str().context("a line has no key")?.to_owned(), row))
    };
    text.lines().map(row).collect()
}

/// Joins the rows of times and scores to cases: first suite `wild` by name, then the others by size.
fn cases(times: &BTreeMap<String, Value>, scores: &BTreeMap<String, Value>, name: &str) -> Result<Vec<Case>> {
    let mut groups: BTreeMap<_, Vec<Outcome>> = BTreeMap::new();
    for (key, time) in times {
        let text = |field: &str| time[field].as_str().with_context(|| format!("{key}: no {field}"));
        let count = |field: &str| time[field].as_u64().with_context(|| format!("{key}: no {field}"));
        let outcome = scores.get(key).and_then(|score| outcome(time, score));
        ensure!(outcome.is_some() || text("peer")? != name, "{key} was not measured: {}", time["status"]);
        let size = (Reverse(count("target_faces")?), count("in_faces")?);
        groups
            .entry((text("mesh")?.to_owned(), size, text("target")?.to_owned()))
            .or_default()
            .extend(outcome);
    }
    let mut cases = Vec::new();
    for ((mesh, (Reverse(requested), faces), target), mut rivals) in groups {
        let Some(at) = rivals.iter().position(|outcome| outcome.peer == name) else { continue };
        let mut case =
            Case { mesh, target, faces: faces as usize, ours: rivals.remove(at), rivals: Vec::new() };
        let most = if case.is_wild() {
            case.ours.faces + 2
        } else {
            Target::max_faces(requested as usize).max(case.ours.faces)
        };
        let counts = |rival: &Outcome| rival.faces <= most && !(case.is_wild() && rival.adds_defects);
        rivals.retain(|rival| counts(rival) && !rival.peer.starts_with("lodsmith/"));
        case.rivals = rivals;
        cases.push(case);
    }
    cases.sort_by_key(|case| if case.is_wild() { 0 } else { case.faces });
    Ok(cases)
}

/// Summary of a measure over all cases.
struct Summary<'a> {
    shares: Vec<Share<'a>>,
    /// Geometric mean of the shares.
    mean: f64,
    /// Number of cases in which Lodsmith is not above the best rival.
    won: usize,
    worst: Share<'a>,
}

impl Summary<'_> {
    fn percent(&self) -> f64 {
        100.0 * self.won as f64 / self.shares.len() as f64
    }
}

/// Returns the summary of a measure; `None` if there is no worst case.
fn summary(cases: &[Case], k: usize) -> Option<Summary<'_>> {
    let shares: Vec<Share<'_>> = cases.iter().filter_map(|case| case.share(k)).collect();
    let counts = |case: &&Case| !case.is_wild() || case.ours.faces >= WORST_MIN_FACES;
    let worst = cases.iter().filter(counts).filter_map(|case| case.share(k));
    Some(Summary {
        mean: stats::geometric_mean(shares.iter().map(|share| share.value))?,
        won: shares.iter().filter(|share| share.value <= 1.0).count(),
        worst: worst.max_by(|a, b| a.value.total_cmp(&b.value))?,
        shares,
    })
}

/// Returns the summaries of these measures, each as text.
fn summaries(
    cases: &[Case],
    measures: [usize; 3],
    text: impl Fn(&str, &Summary<'_>) -> String,
) -> Vec<String> {
    measures.into_iter().filter_map(|k| Some(text(MEASURES[k].1, &summary(cases, k)?))).collect()
}

/// Returns the sections of all models that are not of suite `wild`.
fn general(cases: &[Case]) -> [(&'static str, String); 3] {
    let meshes: HashSet<&str> = cases.iter().map(|case| &*case.mesh).collect();
    let mut table = format!(
        "{} cases of {} meshes, {} to {} triangles:\n\n\
         | tool | cases | mean | RMS | largest | CPU time |\n|---|--:|--:|--:|--:|--:|\n\
         | **Lodsmith** | {} | 1 | 1 | 1 | 1 |\n",
        cases.len(),
        meshes.len(),
        grouped(cases[0].faces),
        grouped(cases[cases.len() - 1].faces),
        cases.len(),
    );
    for (peer, tool) in TOOLS {
        let all = cases.iter().flat_map(|case| case.rivals.iter().map(move |rival| (case, rival)));
        let pairs: Vec<(&Case, &Outcome)> = all.filter(|(_, rival)| rival.peer == peer).collect();
        let mean =
            |of: &dyn Fn(&Case, &Outcome) -> f64| stats::geometric_mean(pairs.iter().map(|(c, o)| of(c, o)));
        let errors = [0, 1, 2].map(|k| mean(&|case, rival| ratio(rival.errors[k], case.ours.errors[k])));
        if let ([Some(average), Some(rms), Some(largest)], Some(time)) =
            (errors, mean(&|case, rival| rival.cpu_s / case.ours.cpu_s))
        {
            table += &format!(
                "| {tool} | {} | {average:.2} | {rms:.2} | {largest:.2} | {time:.1} |\n",
                pairs.len()
            );
        }
    }
    let best = summaries(cases, [0, 1, 2], |measure, t| {
        let (won, all, percent) = (t.won, t.shares.len(), t.percent());
        let (mean, worst) = (t.mean, t.worst.value);
        format!("{measure} {won} of {all} ({percent:.0} %), geometric mean {mean:.2}, worst {worst:.2}")
    });
    table += &format!(
        "\nAgainst the *best* rival of each case: {}. Case by case: [below](#accuracy-case-by-case).",
        best.join("; ")
    );
    let mut rows = "| model | target | mean · share of the best rival | RMS · share | largest · share |\n\
                    |---|---|---|---|---|\n"
        .to_owned();
    for case in cases {
        rows += &format!("| {} | {} | {} |\n", case.name(), case.target(), case.cells());
    }
    [("accuracy", table), ("accuracy-losses", losses(cases, "Accuracy")), ("accuracy-cases", rows)]
}

/// Returns the sections of suite `wild`.
fn wild(cases: &[Case]) -> [(&'static str, String); 3] {
    let meshes: HashSet<&str> = cases.iter().map(|case| &*case.mesh).collect();
    let parts = summaries(cases, [1, 0, 2], |measure, t| {
        format!("{measure} {:.2}, {} ({:.0} %)", t.mean, t.won, t.percent())
    });
    let summary = format!(
        "On CAD parts and game assets ({} models, suite `wild`: many parts, open and non-manifold meshes, few triangles; \
         {} cases), relative to the best rival that adds no defects, as geometric means, with the cases in which we are \
         not above it: {}. Case by case, including the cases that we lose: [below](#cad-parts-and-game-assets-suite-wild).",
        meshes.len(),
        cases.iter().filter(|case| !case.rivals.is_empty()).count(),
        parts.join("; "),
    );
    let lines = summaries(cases, [1, 0, 2], |measure, t| {
        let (mean, all, won) = (t.mean, t.shares.len(), t.won);
        let (percent, worst) = (t.percent(), t.worst.value);
        format!(
            "- {measure}: {mean:.2} of the best rival of each case (geometric mean of {all} cases), not above it in {won} \
             ({percent:.0} %), at worst {worst:.2}.\n"
        )
    });
    let mut text = lines.concat();
    text += &format!(
        "\n(Worst: among results with {WORST_MIN_FACES} faces or more.)\n\n\
         | model | target | faces | mean · share of the best rival | RMS · share | largest · share |\n\
         |---|--:|--:|---|---|---|\n"
    );
    for case in cases {
        let target = case.target.replace('%', " %");
        text += &format!("| {} | {target} | {} | {} |\n", case.name(), case.ours.faces, case.cells());
    }
    [("wild-summary", summary), ("wild-losses", losses(cases, "CAD parts and game assets")), ("wild", text)]
}

/// Returns a line for each measure in which a rival is closer, and one for flipped faces.
fn losses(cases: &[Case], subject: &str) -> String {
    let mut text = summaries(cases, [0, 1, 2], |measure, t| {
        let mut rivals: BTreeMap<&str, usize> = BTreeMap::new();
        for share in t.shares.iter().filter(|share| share.value > 1.0) {
            *rivals.entry(share.rival).or_default() += 1;
        }
        let Some((rival, times)) = rivals.iter().max_by_key(|(_, times)| **times) else { return String::new() };
        let (lost, all, worst) = (t.shares.len() - t.won, t.shares.len(), &t.worst);
        let (value, mesh, target) = (worst.value, worst.case.name(), worst.case.target());
        format!(
            "- **{subject}, {measure}**: above the best rival in {lost} of {all} cases, most often {rival} ({times}), at worst \
             {value:.2} × ({mesh} at {target}, {}).\n",
            worst.rival
        )
    })
    .concat();
    let mut flipped: Vec<&Case> = cases.iter().filter(|case| case.ours.flipped > 0).collect();
    flipped.sort_by_key(|case| Reverse(case.ours.flipped));
    if !flipped.is_empty() {
        let mut seen = HashSet::new();
        let of_meshes = flipped.iter().filter(|case| seen.insert(case.name())).take(3);
        let most =
            of_meshes.map(|case| format!("{} in {} at {}", case.ours.flipped, case.name(), case.target()));
        let most: Vec<String> = most.collect();
        text += &format!(
            "- **{subject}, flipped faces**: in {} of {} results, most {}.\n",
            flipped.len(),
            cases.len(),
            most.join(", ")
        );
    }
    text
}

fn main() -> Result<()> {
    let (mut folder, mut name, mut page) =
        (None::<PathBuf>, "lodsmith/memoryless".to_owned(), None::<PathBuf>);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--name" => name = value()?,
            "--page" => page = Some(value()?.into()),
            path if !path.starts_with('-') && folder.is_none() => folder = Some(path.into()),
            other => bail!("unknown argument {other}"),
        }
    }
    let folder = folder.context("usage: accuracy FOLDER [--name PEER] [--page FILE]")?;
    let cases = cases(&rows(&folder.join("times.jsonl"))?, &rows(&folder.join("scores.jsonl"))?, &name)?;
    ensure!(!cases.is_empty(), "no case has a result of {name}");
    let (of_wild, others) = cases.split_at(cases.partition_point(Case::is_wild));
    let mut sections = Vec::new();
    if !others.is_empty() {
        sections.extend(general(others));
    }
    if !of_wild.is_empty() {
        sections.extend(wild(of_wild));
    }
    match page {
        Some(page) => page::replace(&page, &sections)?,
        None => sections.iter().for_each(|(name, text)| println!("{name}\n\n{text}\n")),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Returns a line of `times.jsonl` and one of `scores.jsonl`.
    fn lines(mesh: &str, target: &str, peer: &str, cpu_s: f64, faces: usize, error: f64) -> [String; 2] {
        let key = format!("{mesh}|{target}|{peer}");
        let time = json!({
            "key": key, "mesh": mesh, "in_faces": 4000, "target": target, "target_faces": 1000, "peer": peer,
            "status": "ok", "total_cpu": cpu_s,
        });
        let score = json!({
            "key": key, "status": "ok", "faces": faces, "mean": error, "rms": error, "max": 2.0 * error,
            "nonmanifold_edges": 0, "boundary_edges": if peer == "igl/qslim" { 8 } else { 7 }, "flipped_faces": 3,
            "volume_err_pct": f64::NAN, "ref": {"nonmanifold_edges": 0, "boundary_edges": 7},
        });
        [time.to_string(), score.to_string().replace("\"volume_err_pct\":null", "\"volume_err_pct\":NaN")]
    }

    fn cases_of(results: &[[String; 2]]) -> Vec<Case> {
        let folder = tempfile::tempdir().unwrap();
        let [times, scores] = [0, 1].map(|k| {
            let path = folder.path().join(k.to_string());
            let lines: Vec<&str> = results.iter().map(|lines| &*lines[k]).collect();
            std::fs::write(&path, lines.join("\n")).unwrap();
            rows(&path).unwrap()
        });
        cases(&times, &scores, "lodsmith/memoryless").unwrap()
    }

    #[test]
    fn tools_are_compared_where_they_reached_the_target() {
        let cases = cases_of(&[
            lines("bunny", "25%", "lodsmith/memoryless", 1.0, 1000, 0.2),
            lines("bunny", "25%", "lodsmith/nofit", 1.0, 1000, 0.01),
            lines("bunny", "25%", "cgal/lt", 4.0, 1022, 0.1),
            lines("bunny", "25%", "vtk/quadric", 2.0, 1023, 0.01),
            lines("cow", "1000", "lodsmith/memoryless", 1.0, 1000, 0.1),
            lines("cow", "1000", "cgal/lt", 1.0, 1000, 0.8),
            lines("cow", "1000", "igl/qslim", 1.0, 1000, 0.3),
        ]);
        let [accuracy, losses, rows] = general(&cases).map(|(_, text)| text);
        assert!(accuracy.starts_with("2 cases of 2 meshes, 4,000 to 4,000 triangles:\n"), "{accuracy}");
        assert!(accuracy.contains("| CGAL, Lindstrom-Turk | 2 | 2.00 | 2.00 | 2.00 | 2.0 |\n"), "{accuracy}");
        assert!(
            accuracy.contains("mean 1 of 2 (50 %), geometric mean 0.82, worst 2.00; RMS 1"),
            "{accuracy}"
        );
        assert!(losses.contains(
            "- **Accuracy, largest**: above the best rival in 1 of 2 cases, most often cgal/lt (1), at worst 2.00 × \
             (bunny at 25%, cgal/lt).\n"
        ));
        assert!(
            losses.ends_with("in 2 of 2 results, most 3 in bunny at 25%, 3 in cow at 1000 faces.\n"),
            "{losses}"
        );
        assert!(rows.contains(
            "\n| bunny | 25% | 0.200 % · 2.00 cgal/lt | 0.200 % · 2.00 cgal/lt | 0.400 % · 2.00 cgal/lt |\n"
        ));
        assert!(rows.contains("\n| cow | 1000 faces | 0.100 % · 0.33 igl/qslim |"), "{rows}");
    }

    #[test]
    fn in_suite_wild_rivals_add_no_defects_and_few_faces() {
        let cases = cases_of(&[
            lines("wild-mug", "50%", "lodsmith/memoryless", 1.0, 1100, 1e-6),
            lines("wild-mug", "50%", "cgal/lt", 1.0, 1102, 1e-7),
            lines("wild-mug", "50%", "vtk/quadric", 1.0, 1103, 1e-8),
            lines("wild-mug", "50%", "igl/qslim", 1.0, 1000, 1e-9),
            lines("teapot", "50%", "lodsmith/memoryless", 1.0, 299, 0.3),
            lines("teapot", "50%", "cgal/lt", 1.0, 299, 0.1),
            lines("spot", "50%", "lodsmith/memoryless", 1.0, 1000, 0.3),
        ]);
        let [summary, losses, text] = wild(&cases).map(|(_, text)| text);
        assert!(summary.contains("(3 models, suite `wild`"), "{summary}");
        assert!(summary.contains("triangles; 2 cases), relative"), "{summary}");
        // Errors below single precision are equal, and the worst case has many faces.
        assert!(text.contains(
            "- mean: 1.73 of the best rival of each case (geometric mean of 2 cases), not above it in 1 (50 %), at worst 1.00.\n"
        ));
        assert!(text.contains("\n| mug | 50 % | 1100 | 1.00e-6 % · 1.00 cgal/lt |"), "{text}");
        assert!(
            text.contains("\n| spot | 50 % | 1000 | 0.300 % · – | 0.300 % · – | 0.600 % · – |\n"),
            "{text}"
        );
        assert!(losses.contains("RMS**: above the best rival in 1 of 2 cases"), "{losses}");
    }
}
