//! `lodsmith methods`: runs every method on one model and compares the results.

use std::fs;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use lodsmith::core::measure::{CompareOptions, Comparison, Prepared, compare_prepared_until};
use lodsmith::core::mesh::creases::Creases;
use lodsmith::core::mesh::defects::clean_surface;
use lodsmith::core::{Image, Surface, TriMesh};
use lodsmith::{Control as _, MethodKind, Report, Simplified, Stage, Verdict};
use lodsmith_asset::plan::{self, Outputs};
use lodsmith_asset::report_json::measured_json;
use lodsmith_asset::warnings::{not_measured, refusals, texts};
use lodsmith_asset::{Destination, Job, Sink, StageClock, Step, memory_need, orient, paths, picture};
use lodsmith_io::{Format, Loaded, Warning};
use lodsmith_render::{Background, Camera, Panel, Subject, View, render, sheet};
use serde_json::{Value, json};

use crate::args::MethodsArgs;
use crate::exit;
use crate::file;
use crate::in_order;
use crate::memory;
use crate::numbers::{grouped, micros, seconds, short};
use crate::output::{self, Output};
use crate::progress::Progress;
use crate::run_control::{BarWatch, not_interrupted};
use crate::status::{Interrupted, Status, usage};
use crate::validity::Validity;
use crate::warnings::show_warnings;

/// Runs all methods in sequence and prints the table.
pub(super) fn run(args: &MethodsArgs) -> anyhow::Result<Status> {
    let methods = args.methods();
    let needs_target = |m: &&MethodKind| !args.options(**m).method.ends_without_stop();
    if let Some(method) = methods.iter().find(needs_target).filter(|_| !args.target.is_given()) {
        let name = method.name();
        return Err(usage(format!("{name} needs a target: --faces, --vertices, --ratio or --error")));
    }
    let sheet = args.sheet.clone().map(Sink::Path);
    let sheet = sheet.map(|sink| picture::picture_format(&sink).map(|format| (sink, format))).transpose()?;
    if let Some((sink, _)) = &sheet {
        paths::refuse_inputs(sink, [&args.input], args.writing.writing.force)?;
    }
    let sinks = methods.iter().map(|&m| sink(args, m)).collect::<anyhow::Result<Vec<_>>>()?;
    if let Some(folder) = &args.out_dir {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot create the folder", folder.display()))?;
    }
    let out = Output::new(args.run.loudness, args.json, false);
    let progress = Progress::new(methods.len() + 1, args.run.loudness.quiet);
    let path = args.input.to_string();
    let compared = in_order::pool(args.run.threads())?.install(|| {
        let jobs: Vec<_> = methods.into_iter().zip(sinks).collect();
        let compared = run_all(&path, jobs, args, &progress)?;
        if let Some((sink, format)) = &sheet {
            file::write_picture(&compared.sheet(), sink, *format, args.writing.writing.force)?;
        }
        anyhow::Ok(compared)
    });
    progress.finish();
    let compared = compared?;

    show_warnings(&out, &path, &compared.warnings, false);
    let mut status = Status::Done;
    for row in &compared.rows {
        let name = row.method.name();
        match &row.outcome {
            Ok(figures) => _ = show_warnings(&out, &format!("{path}: {name}"), &figures.warnings, false),
            Err(reason) => {
                output::error(&format!("{path}: {name}: {reason}"));
                status = Status::Failed;
            }
        }
    }
    out.object(&compared.to_json(&path, args));
    for line in compared.table(&path) {
        out.line(&line);
    }
    for row in &compared.rows {
        if let Ok(figures) = &row.outcome {
            out.detail(&format!("  {}: {}", row.method.name(), figures.detail()));
        }
    }
    out.finish(status)
}

/// Each method with the destination of its result.
type Jobs = Vec<(MethodKind, Option<Destination>)>;

/// A model and the results of all methods.
struct MethodComparison {
    format: Format,
    warnings: Vec<Warning>,
    model: PreparedModel,
    rows: Vec<MethodRow>,
    /// Images of the input and of each result, if a contact sheet is requested.
    panels: Vec<Panel>,
}

fn run_all(
    path: &str,
    jobs: Jobs,
    args: &MethodsArgs,
    progress: &Progress,
) -> anyhow::Result<MethodComparison> {
    let mut time = TimeShares::new(args.run.limits.time_limit, jobs.len());
    // As long as there is no result, the end of the time is an error.
    let alarm = args.run.limits.time_limit.map(exit::end_after).transpose()?;
    let bar = progress.file(path);
    bar.read();
    let loaded = file::read(&args.input, &args.reading).with_context(|| path.to_owned())?;
    let Loaded { mesh, format, regions, warnings, .. } = loaded;
    let largest_need =
        jobs.iter().map(|(m, _)| memory_need::simplify(&mesh, &args.options(*m))).max().unwrap_or(0);
    let mut compare = CompareOptions::default();
    (compare.samples, compare.seed) = (args.samples, args.seed);
    let need = memory_need::methods(&mesh, largest_need, &compare);
    memory::check("methods", need).with_context(|| path.to_owned())?;
    let model = PreparedModel::new(Arc::unwrap_or_clone(mesh), compare);
    drop(alarm);
    bar.end();
    let count = jobs.len();
    let mut rows = Vec::with_capacity(count);
    let mut panels = Vec::new();
    let mut first = None;
    if args.sheet.is_some() {
        let faces = format!("{} faces", grouped(model.mesh.face_count()));
        panels.push(render_panel(model.mesh.clone(), &mut first, vec!["original".to_owned(), faces])?);
    }
    for (method, to) in jobs {
        if exit::interrupted() {
            return Err(Interrupted.into());
        }
        let bar = progress.file(method.name());
        let outcome = exit::guarded(|| {
            let mut watch = BarWatch::new(&bar);
            let mut job =
                Job::new(&mut watch, time.next(), memory::limit()).with_grace(GRACE_SECS / count as f64);
            let result = model.simplified(method, args, &mut job)?;
            let mut figures = model.figures(&result, &mut job);
            if args.sheet.is_some() {
                panels.push(render_panel(result.mesh.clone(), &mut first, figures.caption(method))?);
            }
            if let Some(to) = &to {
                bar.write();
                let mut mesh = result.mesh;
                orient(&mut mesh, &to.writing);
                figures.warnings.extend(file::writer(|job| to.write(&mesh, regions.clone(), job))?.warnings);
            }
            Ok(figures)
        });
        bar.end();
        let outcome = match outcome {
            Err(e) if e.is::<Interrupted>() => return Err(e),
            Err(e) => Err(format!("{e:#}").replace('\n', " ")),
            Ok(figures) => Ok(figures),
        };
        rows.push(MethodRow { method, to, outcome });
    }
    Ok(MethodComparison { format, warnings, model, rows, panels })
}

/// Seconds after the time limit in which results are still measured, for all methods together.
const GRACE_SECS: f64 = 1.0;

/// The time limit, shared out among the methods.
struct TimeShares {
    end: Option<Instant>,
    left: usize,
}

impl TimeShares {
    fn new(limit: Option<f64>, methods: usize) -> Self {
        let end = limit.and_then(|secs| Instant::now().checked_add(Duration::try_from_secs_f64(secs).ok()?));
        Self { end, left: methods }
    }

    /// Returns the seconds of the next method: an equal share of what is left.
    fn next(&mut self) -> Option<f64> {
        let left = self.left.max(1);
        self.left = left - 1;
        let end = self.end?;
        Some(end.saturating_duration_since(Instant::now()).as_secs_f64() / left as f64)
    }
}

/// Size of one image in the contact sheet, in pixels.
const PANEL_SIZE: [usize; 2] = [300, 300];

/// Renders a mesh with its edges for the contact sheet. Camera and creases are those of the first mesh.
fn render_panel(
    mesh: TriMesh,
    first: &mut Option<(Camera, Creases)>,
    caption: Vec<String>,
) -> anyhow::Result<Panel> {
    let subject = Subject::of_mesh(mesh)?;
    let (camera, creases) =
        *first.get_or_insert_with(|| (picture::camera(&subject, PANEL_SIZE), subject.creases()));
    let subject = subject.with_creases(creases);
    let mut view = View::new(camera, PANEL_SIZE[0], PANEL_SIZE[1]);
    view.background = Background::Transparent;
    view.look.wireframe = true;
    Ok(Panel { picture: render(&subject, &view)?, caption })
}

/// Returns the destination for the result of a method, if it is written.
fn sink(args: &MethodsArgs, method: MethodKind) -> anyhow::Result<Option<Destination>> {
    let template = format!("{{stem}}_{}.{{ext}}", method.name());
    let jobs = plan::assign(&Outputs {
        inputs: std::slice::from_ref(&args.input),
        output: None,
        out_dir: args.out_dir.as_deref(),
        name: &template,
        from: args.reading.from,
        to: args.writing.to,
        writing: args.writing.writing,
        json: args.json,
        dry_run: args.out_dir.is_none(),
    })?;
    Ok(jobs.into_iter().find_map(|job| job.output))
}

/// The input, prepared for repeated runs and measurements.
struct PreparedModel {
    mesh: TriMesh,
    /// `None` if the input has no faces to measure from.
    reference: Option<Prepared>,
    validity: Validity,
    compare: CompareOptions,
}

/// Result of a method.
struct MethodResult {
    mesh: TriMesh,
    report: Report,
    clock: StageClock,
}

/// Figures of a result, without its mesh.
struct MethodFigures {
    report: Report,
    clock: StageClock,
    /// `None` if no face is left, or no time.
    measured: Option<Comparison>,
    validity: Validity,
    carried: CarriedAttributes,
    warnings: Vec<Warning>,
}

/// A row of the table.
struct MethodRow {
    method: MethodKind,
    to: Option<Destination>,
    /// The figures, or the reason why there are none.
    outcome: Result<MethodFigures, String>,
}

impl PreparedModel {
    fn new(mesh: TriMesh, compare: CompareOptions) -> Self {
        let surface = mesh.surface();
        // Faces without area or with invalid positions do not count: the engine drops them too.
        let cleaned = clean_surface(&surface, None);
        let reference = Surface::with_triangles(surface.positions(), cleaned.triangles)
            .ok()
            .and_then(|clean| Prepared::new(&clean).ok());
        let validity = Validity::of(&mesh);
        Self { reference, validity, compare, mesh }
    }

    fn simplified(
        &self,
        method: MethodKind,
        args: &MethodsArgs,
        job: &mut Job<'_>,
    ) -> anyhow::Result<MethodResult> {
        let options = args.options(method);
        job.enter(Step::Prepare);
        let done = lodsmith::simplify_with(&self.mesh, &options, job);
        let clock = job.times();
        let Simplified { mesh, report } = not_interrupted(done)?;
        Ok(MethodResult { mesh, report, clock })
    }

    fn figures(&self, result: &MethodResult, job: &mut Job<'_>) -> MethodFigures {
        job.stage(Stage::Measure);
        let mut is_over = || job.progress(0.0) != Verdict::Continue;
        let candidate = Prepared::new(&result.mesh.surface()).ok();
        let pair = self.reference.as_ref().zip(candidate.as_ref());
        let measured = pair.map(|(a, b)| compare_prepared_until(a, b, &self.compare, &mut is_over));
        MethodFigures {
            warnings: if measured == Some(None) { vec![not_measured()] } else { Vec::new() },
            measured: measured.flatten(),
            validity: Validity::of(&result.mesh),
            carried: CarriedAttributes::new(&self.mesh, &result.mesh),
            report: result.report.clone(),
            clock: result.clock.clone(),
        }
    }
}

/// Attributes of the input, by whether the result has them.
#[derive(Debug, PartialEq, Eq)]
struct CarriedAttributes {
    kept: Vec<&'static str>,
    dropped: Vec<&'static str>,
    /// Numbers of regions of the input and of the result, if the input has regions.
    regions: Option<(usize, usize)>,
}

impl CarriedAttributes {
    fn new(input: &TriMesh, result: &TriMesh) -> Self {
        let mut carried = Self { kept: Vec::new(), dropped: Vec::new(), regions: None };
        let mut all = vec![
            ("normals", input.normals().is_some(), result.normals().is_some()),
            ("uvs", input.uvs().is_some(), result.uvs().is_some()),
            ("colors", input.colors().is_some(), result.colors().is_some()),
        ];
        let others = result.further_attributes();
        all.extend(input.further_attributes().iter().map(|a| {
            let is_kept = others.iter().any(|b| (&a.semantic, a.width) == (&b.semantic, b.width));
            (a.semantic.title(), true, is_kept)
        }));
        for (name, _, is_kept) in all.into_iter().filter(|x| x.1) {
            let list = if is_kept { &mut carried.kept } else { &mut carried.dropped };
            // Several sets of joints are listed once.
            if !list.contains(&name) {
                list.push(name);
            }
        }
        carried.regions = input.regions().map(|_| (region_count(input), region_count(result)));
        carried
    }

    /// Returns the attributes as text; `-` if the input has none.
    fn line(&self) -> String {
        let mut items = self.kept.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        items.extend(self.regions.map(|(was, is)| format!("{is} of {was} regions")));
        items.extend(self.dropped.iter().map(|name| format!("not {name}")));
        if items.is_empty() { "-".to_owned() } else { items.join(", ") }
    }
}

fn region_count(mesh: &TriMesh) -> usize {
    let mut regions = mesh.regions().unwrap_or_default().to_vec();
    regions.sort_unstable();
    regions.dedup();
    regions.len()
}

impl MethodComparison {
    /// Returns the table.
    fn table(&self, path: &str) -> Vec<String> {
        let mut cells = vec![COLUMN_TITLES.map(str::to_owned)];
        let mut failed = Vec::new();
        for row in &self.rows {
            match &row.outcome {
                Ok(figures) => cells.push(figures.cells(row.method, &self.model)),
                Err(reason) => failed.push(format!("{}: failed: {reason}", row.method.name())),
            }
        }
        let width = |k: usize| cells.iter().map(|c| c[k].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..COLUMN_TITLES.len()).map(width).collect();
        let line = |row: &[String; COLUMN_TITLES.len()]| {
            let cell = |(k, text): (usize, &String)| match k {
                // Numbers are right-aligned.
                1..=6 => format!("{text:>0$}", widths[k]),
                _ => format!("{text:<0$}", widths[k]),
            };
            row.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        let faces = grouped(self.model.mesh.face_count());
        let mut lines = vec![format!("{path}: {faces} faces; distances in % of the diagonal")];
        lines.extend(cells.iter().map(line));
        lines.extend(failed);
        lines
    }

    /// Returns all results side by side.
    fn sheet(&self) -> Image {
        // The input and ten methods: three rows of four, with one place left.
        sheet(&self.panels, 4, Background::default(), None)
    }

    fn to_json(&self, path: &str, args: &MethodsArgs) -> Value {
        let model = &self.model;
        json!({
            "input": {
                "path": path, "format": self.format.name(),
                "faces": model.mesh.face_count(), "vertices": model.mesh.vertex_count(),
                "components": model.validity.components, "defects": object(model.validity.counts()),
            },
            "target": lodsmith_asset::report_json::target(&args.target.stop()),
            "diagonal": model.reference.as_ref().map(Prepared::diagonal),
            "samples": model.compare.samples,
            "threads": args.run.threads(),
            "methods": self.rows.iter().map(|row| row.to_json(model)).collect::<Vec<_>>(),
            "warnings": texts(&self.warnings),
        })
    }
}

/// Column headings of the table.
const COLUMN_TITLES: [&str; 10] =
    ["method", "faces", "", "time", "mean %", "rms %", "max %", "ended by", "new defects", "attributes"];

/// Returns a JSON object of numbers by name.
fn object<N: Into<Value>>(pairs: impl IntoIterator<Item = (&'static str, N)>) -> Value {
    let pairs = pairs.into_iter().map(|(name, n)| (name.to_owned(), n.into()));
    Value::Object(pairs.collect())
}

impl MethodRow {
    fn to_json(&self, model: &PreparedModel) -> Value {
        let name = self.method.name();
        match &self.outcome {
            Ok(figures) => figures.to_json(name, self.to.as_ref(), model),
            Err(reason) => json!({ "method": name, "error": reason }),
        }
    }
}

impl MethodFigures {
    fn cells(&self, method: MethodKind, model: &PreparedModel) -> [String; COLUMN_TITLES.len()] {
        let r = &self.report;
        let percent = 100.0 * r.faces as f64 / model.mesh.face_count().max(1) as f64;
        let share = |x: fn(&Comparison) -> f64| match &self.measured {
            Some(m) if m.diagonal > 0.0 => short(100.0 * x(m) / m.diagonal),
            _ => "-".to_owned(),
        };
        let ended = r.stopped_by.name().replace('_', " ");
        [
            method.name().to_owned(),
            grouped(r.faces),
            format!("{percent:.1} %"),
            seconds(self.clock.total()),
            share(|m| m.mean.symmetric),
            share(|m| m.rms.symmetric),
            share(|m| m.hausdorff.symmetric),
            if r.reached { ended } else { format!("{ended}, not reached") },
            self.defects(model),
            self.carried.line(),
        ]
    }

    /// Returns the caption below an image.
    fn caption(&self, method: MethodKind) -> Vec<String> {
        let largest = match &self.measured {
            Some(m) if m.diagonal > 0.0 => {
                format!("max {} %", short(100.0 * m.hausdorff.symmetric / m.diagonal))
            }
            _ => "not measured".to_owned(),
        };
        let faces = format!("{} faces, {}", grouped(self.report.faces), seconds(self.clock.total()));
        vec![method.name().to_owned(), faces, largest]
    }

    /// Returns the details for `-v`: times by stage, and refusals.
    fn detail(&self) -> String {
        let times = self.clock.stages.iter().filter(|(name, _)| *name != "read");
        let mut items: Vec<_> = times.map(|(name, secs)| format!("{name} {secs:.3} s")).collect();
        let refused = refusals(&self.report);
        if !refused.is_empty() {
            items.push(format!("refused: {refused}"));
        }
        items.join(", ")
    }

    /// Returns the defects that the input does not have, as text.
    fn defects(&self, model: &PreparedModel) -> String {
        let risen = self.validity.risen_from(&model.validity).filter(|r| r.1 > 0);
        let mut items: Vec<_> =
            risen.map(|(name, n)| format!("{} {}", grouped(n), name.replace('_', " "))).collect();
        let lost = model.validity.components.saturating_sub(self.validity.components);
        if lost > 0 {
            items.push(format!("{} parts lost", grouped(lost)));
        }
        if items.is_empty() { "none".to_owned() } else { items.join(", ") }
    }

    fn to_json(&self, method: &str, to: Option<&Destination>, model: &PreparedModel) -> Value {
        let r = &self.report;
        let relative = |m: &Comparison| {
            let share = |x: f64| if m.diagonal > 0.0 { x / m.diagonal } else { 0.0 };
            let [max, mean, rms] = [&m.hausdorff, &m.mean, &m.rms].map(|x| share(x.symmetric));
            json!({ "hausdorff": max, "mean": mean, "rms": rms })
        };
        let output = to.map(|to| json!({ "path": to.sink.to_string(), "format": to.format.name() }));
        let times = self.clock.stages.iter().filter(|(name, _)| *name != "read");
        let regions = self.carried.regions.map(|(was, is)| json!({ "input": was, "output": is }));
        json!({
            "method": method,
            "output": output,
            "faces": r.faces,
            "vertices": r.vertices,
            "reached": r.reached,
            "stopped_by": r.stopped_by.name(),
            "seconds": object(times.map(|&(name, s)| (name, micros(s)))),
            "measured": self.measured.as_ref().map(measured_json),
            "relative_to_diagonal": self.measured.as_ref().map(relative),
            "defects": object(self.validity.counts()),
            "new_defects": object(self.validity.risen_from(&model.validity)),
            "components": self.validity.components,
            "parts_removed": r.parts_removed,
            "refusals": object(r.refusals.iter().map(|(r, n)| (r.name(), *n))),
            "carried": { "kept": self.carried.kept, "dropped": self.carried.dropped, "regions": regions },
            "warnings": texts(&self.warnings),
        })
    }
}

#[cfg(test)]
mod tests {
    use lodsmith::core::{Attribute, RegionId, Semantic, shapes};

    use super::*;

    #[test]
    fn kept_and_dropped_attributes_are_listed() {
        let plain = shapes::cube(2);
        let count = plain.wedge_count();
        let mut input = plain.clone();
        input.set_uvs(Some(vec![[0.0; 2]; count])).unwrap();
        input.set_normals(Some(vec![[0.0, 0.0, 1.0]; count])).unwrap();
        for set in 0..2 {
            let values = vec![0.0; 4 * count];
            input.add_attribute(Attribute { semantic: Semantic::Joints(set), width: 4, values }).unwrap();
        }
        let regions = (0..input.face_count()).map(|f| RegionId((f % 3) as u32)).collect();
        input.set_regions(Some(regions)).unwrap();
        let mut result = plain.clone();
        result.set_uvs(Some(vec![[0.0; 2]; count])).unwrap();
        let carried = CarriedAttributes::new(&input, &result);
        assert_eq!(carried.line(), "uvs, 0 of 3 regions, not normals, not joints");
        assert_eq!(CarriedAttributes::new(&input, &input).line(), "normals, uvs, joints, 3 of 3 regions");
        assert_eq!(CarriedAttributes::new(&plain, &plain).line(), "-");
    }
}
