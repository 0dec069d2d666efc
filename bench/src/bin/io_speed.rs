//! Reading beside other readers of Rust: a torus of a million vertices as OBJ and as binary PLY.
//!
//! ```text
//! io_speed [--side N] [--reps N]     N × N vertices, 1000 if not said; 5 repetitions if not said
//! ```
//! All read the same file from the same folder in turn, from a path to positions and indices in memory.
#![allow(clippy::print_stdout, reason = "a program speaks on standard output")]

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use lodsmith_bench::{Soup, cases, process, stats};
use lodsmith_io::{ReadOptions, read_path};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{PropertyAccess, PropertyAccessResult};

fn main() -> Result<()> {
    let (mut side, mut reps) = (1000usize, 5usize);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut number = || -> Result<usize> { Ok(words.next().context("a number is missing")?.parse()?) };
        match word.as_str() {
            "--side" => side = number()?,
            "--reps" => reps = number()?,
            other => bail!("unknown argument {other}; usage: io_speed [--side N] [--reps N]"),
        }
    }
    ensure!(side >= 3 && reps >= 1, "--side must be 3 or more, --reps 1 or more");
    process::one_thread()?;

    let mesh = cases::torus(side, side);
    let folder = tempfile::tempdir()?;
    let obj = folder.path().join("torus.obj");
    let ply = folder.path().join("torus.ply");
    write_obj(&mesh, &obj)?;
    write_ply(&mesh, &ply)?;
    println!("{} vertices, {} triangles, one thread, least of {reps}\n", side * side, mesh.face_count());
    println!("| file | MB | lodsmith s | rival | rival s | lodsmith / rival | bytes alone s |");
    println!("|---|--:|--:|---|--:|--:|--:|");
    race(&obj, &mesh, "tobj 4.0.5", &by_tobj, reps)?;
    race(&ply, &mesh, "ply-rs-bw 4.0.1", &by_ply_rs, reps)?;
    Ok(())
}

fn race(
    path: &Path,
    wanted: &Soup,
    rival: &str,
    by: &dyn Fn(&Path) -> Result<Soup>,
    reps: usize,
) -> Result<()> {
    let counts = (wanted.positions.len(), wanted.face_count());
    let (mut ours, mut theirs, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..reps {
        let began = Instant::now();
        let loaded = read_path(path, &ReadOptions::default())?;
        ours.push(began.elapsed().as_secs_f64());
        let got = (loaded.mesh.vertex_count(), loaded.mesh.face_count());
        ensure!(got == counts, "lodsmith read {got:?} vertices and faces of {counts:?}");
        drop(loaded);

        let began = Instant::now();
        let soup = by(path)?;
        theirs.push(began.elapsed().as_secs_f64());
        let got = (soup.positions.len(), soup.face_count());
        ensure!(got == counts, "{rival} read {got:?} vertices and faces of {counts:?}");
        drop(soup);

        let began = Instant::now();
        let raw = std::fs::read(path)?;
        bytes.push(began.elapsed().as_secs_f64());
        drop(raw);
    }
    let (ours, theirs) = (stats::min(&ours), stats::min(&theirs));
    println!(
        "| {} | {:.0} | {ours:.3} | {rival} | {theirs:.3} | {:.2} | {:.3} |",
        path.extension().unwrap_or_default().display(),
        std::fs::metadata(path)?.len() as f64 / 1e6,
        ours / theirs,
        stats::min(&bytes),
    );
    Ok(())
}

fn write_obj(mesh: &Soup, path: &Path) -> Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    for [x, y, z] in &mesh.positions {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for t in mesh.indices.chunks_exact(3) {
        writeln!(out, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
    }
    Ok(out.flush()?)
}

fn write_ply(mesh: &Soup, path: &Path) -> Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len())?;
    write!(
        out,
        "property float x\nproperty float y\nproperty float z\nelement face {}\n",
        mesh.face_count()
    )?;
    write!(out, "property list uchar int vertex_indices\nend_header\n")?;
    for x in mesh.positions.as_flattened() {
        out.write_all(&x.to_le_bytes())?;
    }
    for t in mesh.indices.chunks_exact(3) {
        out.write_all(&[3])?;
        for i in t {
            out.write_all(&i.to_le_bytes())?;
        }
    }
    Ok(out.flush()?)
}

/// As its documentation shows it for drawing: one index for each corner, polygons cut into triangles.
fn by_tobj(path: &Path) -> Result<Soup> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options)?;
    let mesh = models.into_iter().next().context("no model")?.mesh;
    let positions = mesh.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    Ok(Soup { positions, indices: mesh.indices })
}

/// As its documentation shows it for speed: straight into structures of the caller.
fn by_ply_rs(path: &Path) -> Result<Soup> {
    struct Vertex([f32; 3]);
    impl PropertyAccess for Vertex {
        fn new() -> Self {
            Self([0.0; 3])
        }
        fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
            let axis = match name {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => return PropertyAccessResult::Ignored,
            };
            self.0[axis] = value;
            PropertyAccessResult::Set
        }
    }
    struct Face(Vec<i32>);
    impl PropertyAccess for Face {
        fn new() -> Self {
            Self(Vec::new())
        }
        fn set_list_int(&mut self, _: &str, value: Vec<i32>) -> PropertyAccessResult {
            self.0 = value;
            PropertyAccessResult::Set
        }
    }
    let (vertex_parser, face_parser) = (Parser::<Vertex>::new(), Parser::<Face>::new());
    let mut file = Reader::new(BufReader::new(File::open(path)?));
    let header = vertex_parser.read_header(&mut file)?;
    let mut soup = Soup::default();
    for (name, element) in &header.elements {
        if name.as_str() == "vertex" {
            let read = vertex_parser.read_payload_for_element(&mut file, element, &header)?;
            soup.positions = read.into_iter().map(|v| v.0).collect();
        } else {
            let read = face_parser.read_payload_for_element(&mut file, element, &header)?;
            soup.indices = read.into_iter().flat_map(|f| f.0).map(|i| i as u32).collect();
        }
    }
    Ok(soup)
}
