//! Lodsmith as a program of a benchmark lab that times simplifiers, each in its own process.
//!
//! ```text
//! peer-lodsmith --modes                          prints the modes, one per line
//! peer-lodsmith MODE IN OUT TARGET REPS SECONDS  simplifies IN to TARGET triangles up to REPS times (none is started
//!                                                after SECONDS), writes the last result to OUT and prints one
//!                                                line of JSON
//! ```
//! IN and OUT are exchange files (see `lab.rs`). Runs on one thread. `run` is the time from buffers to buffers.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::{
    BorderPolicy, Fit, MethodKind, NoControl, Placement, SimplifyOptions, Stop, TopologyPolicy, simplify_with,
};
use lodsmith_bench::{lab, process};
use serde_json::json;

type Change = fn(&mut SimplifyOptions);

/// The modes: each is the default with one change.
const MODES: &[(&str, Change)] = &[
    ("memoryless", |_| ()),
    ("nofit", |o| o.fit = Fit::Off),
    ("lindstrom-turk", |o| o.method = MethodKind::LindstromTurk.into()),
    ("melax", |o| o.method = MethodKind::Melax.into()),
    ("shortest-edge", |o| o.method = MethodKind::ShortestEdge.into()),
    ("quadric", |o| o.method = MethodKind::Quadric.into()),
    ("quadric-fit", |o| (o.method, o.fit) = (MethodKind::Quadric.into(), Fit::On)),
    ("endpoint", |o| o.placement = Placement::Endpoint),
    ("midpoint", |o| o.placement = Placement::Midpoint),
    ("border-slide", |o| o.border = BorderPolicy::Slide),
    ("border-lock", |o| o.border = BorderPolicy::Lock),
    ("border-free", |o| o.border = BorderPolicy::Free),
    ("preserve", |o| o.topology = TopologyPolicy::Preserve),
    ("topology-free", |o| o.topology = TopologyPolicy::Free),
];

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if args == ["--modes"] {
        for (name, _) in MODES {
            println!("{name}");
        }
        return Ok(());
    }
    let [mode, input, output, target, reps, seconds] = args.as_slice() else {
        bail!("usage: peer-lodsmith --modes | MODE IN OUT TARGET REPS SECONDS");
    };
    let (_, change) = MODES
        .iter()
        .find(|(name, _)| name == mode)
        .with_context(|| format!("no mode {mode}; see --modes"))?;
    let (target, reps): (usize, usize) = (target.parse()?, reps.parse()?);
    let seconds: f64 = seconds.parse()?;
    ensure!(reps > 0, "REPS must be 1 or more");
    process::one_thread()?;

    let mut options = SimplifyOptions::new(Stop::faces(target));
    change(&mut options);
    let mesh = lab::read(Path::new(input))?;
    let surface = mesh.surface()?;

    let base_kb = process::reset_peak_kb()?;
    let started = Instant::now();
    let mut rows = Vec::new();
    let mut last = None;
    while rows.len() < reps && (rows.is_empty() || started.elapsed().as_secs_f64() <= seconds) {
        drop(last.take()); // The previous result must not count in the peak.
        let (cpu, wall) = (process::cpu_seconds(), Instant::now());
        let result = simplify_with(surface.clone(), &options, &mut NoControl)?;
        let (run, run_cpu) = (wall.elapsed().as_secs_f64(), process::cpu_seconds() - cpu);
        rows.push(json!({"init": 0.0, "init_cpu": 0.0, "run": run, "run_cpu": run_cpu}));
        last = Some(result);
    }
    let peak_kb = process::peak_kb()?;
    let result = last.context("no run")?;
    lab::write(Path::new(output), &result.mesh.surface())?;

    let report = &result.report;
    let cleanup = &report.cleanup;
    let mut note = format!("own error {:e}, stopped by {}", report.error.estimate, report.stopped_by.name());
    for (reason, count) in &report.refusals {
        note += &format!(", {} {count}", reason.name());
    }
    // The lab looks for a line that begins with `reps`, so the keys are written in this order.
    println!(
        "{{\"reps\":{},\"base_kb\":{base_kb},\"peak_kb\":{peak_kb},\"dropped_faces\":{},\"note\":{}}}",
        serde_json::Value::from(rows),
        cleanup.degenerate_faces + cleanup.duplicate_faces + cleanup.non_finite_faces,
        serde_json::Value::from(note),
    );
    Ok(())
}
