//! Reading speed compared with other Rust readers: a torus of a million vertices as OBJ, with every form of
//! face, and as binary PLY.
//!
//! ```text
//! io_speed [--side N] [--reps N] [--threads N] [--only NAME] [--cpu]
//!     --side N       N × N vertices, default 1000
//!     --reps N       repetitions, default 5; the minimum time counts
//!     --threads N    threads of Lodsmith, default 1 (the others have one)
//!     --only NAME    only rows whose name contains this
//!     --cpu          processor time of all threads instead of wall-clock time
//! ```
//! All readers read the same file in turn, from a path to positions and indices in memory.
#![allow(clippy::print_stdout, reason = "a program prints to standard output")]

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use lodsmith_bench::{Soup, cases, process, stats};
use lodsmith_io::{ReadOptions, read_path};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{PropertyAccess, PropertyAccessResult};

/// The forms of OBJ corners: name of the row, and whether they have texture coordinates, normals, and a seam where the
/// texture coordinates wrap around.
const FORMS: [(&str, Form); 4] = [
    ("obj v", Form { uvs: false, normals: false, seam: false }),
    ("obj v//vn", Form { uvs: false, normals: true, seam: false }),
    ("obj v/vt/vn", Form { uvs: true, normals: true, seam: false }),
    ("obj v/vt/vn, seams", Form { uvs: true, normals: true, seam: true }),
];

#[derive(Clone, Copy, Debug)]
struct Form {
    uvs: bool,
    normals: bool,
    seam: bool,
}

fn main() -> Result<()> {
    let mut benchmark = ReadBenchmark { side: 1000, reps: 5, cpu: false };
    let (mut threads, mut only) = (1usize, String::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--side" => benchmark.side = value()?.parse()?,
            "--reps" => benchmark.reps = value()?.parse()?,
            "--threads" => threads = value()?.parse()?,
            "--only" => only = value()?,
            "--cpu" => benchmark.cpu = true,
            other => bail!(
                "unknown argument {other}; usage: io_speed [--side N] [--reps N] [--threads N] [--only NAME] [--cpu]"
            ),
        }
    }
    ensure!(benchmark.side >= 3 && benchmark.reps >= 1, "--side must be 3 or more, --reps 1 or more");
    if threads == 1 {
        process::one_thread()?;
    } else {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    }

    let mesh = cases::torus(benchmark.side, benchmark.side);
    let (vertices, faces) = (mesh.positions.len(), mesh.face_count());
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("torus");
    let (side, clock) = (benchmark.side, if benchmark.cpu { "processor" } else { "wall-clock" });
    println!(
        "{vertices} vertices, {faces} triangles, {threads} threads, {clock} time, minimum of {}\n",
        benchmark.reps
    );
    println!("| file | MB | lodsmith s | rival | rival s | lodsmith / rival | bytes alone s |");
    println!("|---|--:|--:|---|--:|--:|--:|");
    for (name, form) in FORMS.iter().filter(|(name, _)| name.contains(&only)) {
        write_obj(&mesh, side, *form, &path.with_extension("obj"))?;
        let wedges = if form.seam { (side + 1) * (side + 1) } else { vertices };
        benchmark.run(name, &path.with_extension("obj"), (wedges, faces), "tobj 4.0.5", &read_with_tobj)?;
    }
    if "ply".contains(&only) {
        write_ply(&mesh, &path.with_extension("ply"))?;
        let path = path.with_extension("ply");
        benchmark.run("ply", &path, (vertices, faces), "ply-rs-bw 4.0.1", &read_with_ply_rs)?;
    }
    Ok(())
}

/// The settings of a run.
struct ReadBenchmark {
    side: usize,
    reps: usize,
    cpu: bool,
}

impl ReadBenchmark {
    /// Prints the row of a file; all readers must find these numbers of vertices (with their attributes) and
    /// faces.
    fn run(
        &self,
        name: &str,
        path: &Path,
        counts: (usize, usize),
        rival: &str,
        read_with: &dyn Fn(&Path) -> Result<Soup>,
    ) -> Result<()> {
        let (mut ours, mut theirs, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..self.reps {
            let (seconds, loaded) = self.time(|| read_path(path, &ReadOptions::default()));
            ours.push(seconds);
            let loaded = loaded?;
            let got = (loaded.mesh.wedge_count(), loaded.mesh.face_count());
            ensure!(got == counts, "lodsmith read {got:?} vertices and faces of {counts:?}");
            drop(loaded);

            let (seconds, soup) = self.time(|| read_with(path));
            theirs.push(seconds);
            let soup = soup?;
            let got = (soup.positions.len(), soup.face_count());
            ensure!(got == counts, "{rival} read {got:?} vertices and faces of {counts:?}");
            drop(soup);

            let (seconds, raw) = self.time(|| std::fs::read(path));
            bytes.push(seconds);
            drop(raw?);
        }
        let (ours, theirs) = (stats::min(&ours), stats::min(&theirs));
        println!(
            "| {name} | {:.0} | {ours:.3} | {rival} | {theirs:.3} | {:.2} | {:.3} |",
            std::fs::metadata(path)?.len() as f64 / 1e6,
            ours / theirs,
            stats::min(&bytes),
        );
        Ok(())
    }

    fn time<T>(&self, work: impl FnOnce() -> T) -> (f64, T) {
        let (cpu, started) = (process::cpu_seconds(), Instant::now());
        let done = work();
        let clock = started.elapsed().as_secs_f64();
        (if self.cpu { process::cpu_seconds() - cpu } else { clock }, done)
    }
}

fn write_obj(mesh: &Soup, side: usize, form: Form, path: &Path) -> Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    for [x, y, z] in &mesh.positions {
        writeln!(out, "v {x} {y} {z}")?;
    }
    // With a seam, the map has one row and one column more.
    let row = side + usize::from(form.seam);
    if form.uvs {
        for i in 0..row * row {
            let [u, v] = [i / row, i % row].map(|k| k as f32 / side as f32);
            writeln!(out, "vt {u} {v}")?;
        }
    }
    if form.normals {
        for [x, y, z] in &mesh.positions {
            let length = (x * x + y * y + z * z).sqrt();
            writeln!(out, "vn {:.6} {:.6} {:.6}", x / length, y / length, z / length)?;
        }
    }
    for (face, t) in mesh.indices.chunks_exact(3).enumerate() {
        write!(out, "f")?;
        for &v in t {
            // The grid square of the face; corners beyond the last row wrap around to the first row, with texture
            // coordinates one turn further.
            let (i, j) = (face / 2 / side, face / 2 % side);
            let (a, b) = (v as usize / side, v as usize % side);
            let turned = |at: usize, from: usize| if at < from { side } else { at };
            let uv = if form.seam { turned(a, i) * row + turned(b, j) } else { v as usize };
            match (form.uvs, form.normals) {
                (false, false) => write!(out, " {}", v + 1)?,
                (false, true) => write!(out, " {0}//{0}", v + 1)?,
                _ => write!(out, " {0}/{1}/{0}", v + 1, uv + 1)?,
            }
        }
        writeln!(out)?;
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

/// Reads with tobj as its documentation shows for rendering: one index per corner, polygons triangulated.
fn read_with_tobj(path: &Path) -> Result<Soup> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options)?;
    let mesh = models.into_iter().next().context("no model")?.mesh;
    let positions = mesh.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    Ok(Soup { positions, indices: mesh.indices })
}

/// Reads with ply-rs as its documentation shows for speed: directly into structures of the caller.
fn read_with_ply_rs(path: &Path) -> Result<Soup> {
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
