//! Benchmark of software rendering.
//!
//! ```text
//! render [FILE...] [--faces 70000,1000000] [--size 1024x768] [--reps N] [--threads N]
//! ```
//! Files are rendered as read; `--faces` adds wavy spheres of about these sizes. Default view and light, four samples
//! per pixel. Times are processor times over all threads: minimum and median of the repetitions. Normals are computed
//! once per subject and not timed.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::f32::consts::{PI, TAU};

use anyhow::{Context, Result, bail, ensure};
use lodsmith_bench::{process, stats};
use lodsmith_core::{Positions, TriMesh, VertexId};
use lodsmith_render::{Shading, StandardView, Subject, View, render};

struct Args {
    files: Vec<String>,
    faces: Vec<usize>,
    size: [usize; 2],
    reps: usize,
    threads: usize,
}

fn parse() -> Result<Args> {
    let mut args = Args { files: Vec::new(), faces: Vec::new(), size: [1024, 768], reps: 15, threads: 1 };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--faces" => args.faces = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            "--size" => {
                let size = value()?;
                let (width, height) = size.split_once('x').context("--size needs WIDTHxHEIGHT")?;
                args.size = [width.parse()?, height.parse()?];
            }
            "--reps" => args.reps = value()?.parse()?,
            "--threads" => args.threads = value()?.parse()?,
            file if !file.starts_with('-') => args.files.push(file.to_owned()),
            other => bail!("unknown option {other}"),
        }
    }
    ensure!(args.reps > 0 && args.threads > 0, "--reps and --threads must be 1 or more");
    if args.files.is_empty() && args.faces.is_empty() {
        args.faces = vec![70_000, 1_000_000];
    }
    Ok(args)
}

/// Returns a wavy sphere of about this many faces.
fn ball(faces: usize) -> Result<TriMesh> {
    let rows = ((faces as f32 / 4.0).sqrt() as u32).max(3);
    let columns = rows * 2;
    let position = |a: f32, b: f32| {
        let r = 1.0 + 0.08 * (8.0 * a).sin() * (8.0 * b).sin();
        [a.sin() * b.cos() * r, a.cos() * r, a.sin() * b.sin() * r]
    };
    let angle = |i: u32, n: u32, turn: f32| i as f32 / n as f32 * turn;
    let positions = (0..=rows)
        .flat_map(|r| (0..=columns).map(move |c| (r, c)))
        .map(|(r, c)| position(angle(r, rows, PI), angle(c, columns, TAU)))
        .collect();
    let triangles = (0..rows)
        .flat_map(|r| (0..columns).map(move |c| r * (columns + 1) + c))
        .flat_map(|k| [[k, k + 1, k + columns + 1], [k + columns + 1, k + 1, k + columns + 2]])
        .map(|t| t.map(VertexId))
        .collect();
    Ok(TriMesh::new(Positions::F32(positions), triangles)?)
}

fn main() -> Result<()> {
    let args = parse()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    println!("| model | faces | shading | processor ms, minimum | median |");
    println!("|---|--:|---|--:|--:|");
    for &faces in &args.faces {
        measure("ball", Subject::of_mesh(ball(faces)?)?, &args, &pool)?;
    }
    for file in &args.files {
        let model = lodsmith_io::read_model_path(file.as_ref(), &lodsmith_io::ReadOptions::default())
            .with_context(|| file.clone())?
            .model;
        let name = file.rsplit(['/', '\\']).next().unwrap_or_default();
        measure(name, Subject::new(&model)?, &args, &pool)?;
    }
    Ok(())
}

fn measure(name: &str, subject: Subject, args: &Args, pool: &rayon::ThreadPool) -> Result<()> {
    let bounds = subject.bounds().context("nothing to draw")?;
    let [width, height] = args.size;
    let mut view = View::of(&bounds, StandardView::Iso, width, height);
    for (shading, wireframe) in [(Shading::Smooth, false), (Shading::Flat, false), (Shading::Smooth, true)] {
        (view.look.shading, view.look.wireframe) = (shading, wireframe);
        // The first run computes the normals.
        pool.install(|| render(&subject, &view))?;
        let mut times = Vec::new();
        for _ in 0..args.reps {
            let started = process::cpu_seconds();
            pool.install(|| render(&subject, &view))?;
            times.push((process::cpu_seconds() - started) * 1e3);
        }
        let lines = if wireframe { " with lines" } else { "" };
        let (faces, least, median) = (subject.face_count(), stats::min(&times), stats::median(&times));
        println!("| {name} | {faces} | {}{lines} | {least:.1} | {median:.1} |", shading.name());
    }
    Ok(())
}
