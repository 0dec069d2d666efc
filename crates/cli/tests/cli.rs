//! Every command from end to end, on small files that the tests make themselves.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// What a run left behind.
struct Ran {
    status: i32,
    stdout: Vec<u8>,
    stderr: String,
}

impl Ran {
    fn text(&self) -> &str {
        std::str::from_utf8(&self.stdout).expect("standard output is text")
    }
    fn objects(&self) -> Vec<Value> {
        self.text().lines().map(|line| serde_json::from_str(line).expect("each line is JSON")).collect()
    }
    #[track_caller]
    fn with_status(self, status: i32) -> Self {
        assert_eq!(self.status, status, "stdout: {}\nstderr: {}", self.stdout.escape_ascii(), self.stderr);
        self
    }
    /// A fault of ours to tell: one line, and no traces of the program's inside.
    #[track_caller]
    fn with_one_error(self) -> Self {
        assert_eq!(self.stderr.lines().count(), 1, "{}", self.stderr);
        assert!(self.stderr.starts_with("error: "), "{}", self.stderr);
        assert!(!self.stderr.contains("panicked") && !self.stderr.contains("backtrace"), "{}", self.stderr);
        self
    }
}

/// A folder to work in.
struct Desk {
    folder: TempDir,
}

impl Desk {
    fn new() -> Self {
        Self { folder: TempDir::new().expect("there is room for a folder") }
    }
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    fn put(&self, name: &str, content: &str) {
        fs::write(self.path(name), content).expect("there is room for a file");
    }
    fn run(&self, words: &str) -> Ran {
        self.run_with(words, Vec::new())
    }
    fn run_with(&self, words: &str, stdin: impl Into<Vec<u8>>) -> Ran {
        let output = Command::cargo_bin("lodsmith")
            .expect("the command is built")
            .args(words.split_whitespace())
            .current_dir(self.folder.path())
            .env_remove("RUST_BACKTRACE")
            .write_stdin(stdin)
            .output()
            .expect("it runs");
        Ran {
            status: output.status.code().expect("it ends by itself"),
            stdout: output.stdout,
            stderr: String::from_utf8(output.stderr).expect("errors are text"),
        }
    }
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect("the folder is there");
        let mut names: Vec<String> = entries
            .map(|e| e.expect("it can be listed").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
    fn info(&self, name: &str) -> Value {
        self.run(&format!("info --json {name}")).with_status(0).objects().remove(0)
    }
    fn faces(&self, name: &str) -> u64 {
        self.info(name)["faces"].as_u64().expect("a count")
    }
}

/// A hilly square of `2 n²` triangles as text PLY.
fn hills(n: usize) -> String {
    let mut vertices = String::new();
    let mut faces = String::new();
    for y in 0..=n {
        for x in 0..=n {
            let (u, v) = (x as f64 / n as f64, y as f64 / n as f64);
            writeln!(vertices, "{u} {v} {}", 0.1 * (9.0 * u).sin() * (7.0 * v).cos()).expect("text");
        }
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            writeln!(faces, "3 {a} {b} {d}\n3 {a} {d} {c}").expect("text");
        }
    }
    ply("", (n + 1) * (n + 1), 2 * n * n, &vertices, &faces)
}

/// A cube of twelve triangles with a colour at each corner.
fn coloured_cube() -> String {
    let mut vertices = String::new();
    for i in 0..8u32 {
        let [x, y, z] = [i & 1, i >> 1 & 1, i >> 2];
        writeln!(vertices, "{x} {y} {z} {} {} {}", 255 * x, 255 * y, 255 * z).expect("text");
    }
    let faces = "3 0 2 3\n3 0 3 1\n3 4 5 7\n3 4 7 6\n3 0 1 5\n3 0 5 4\n3 2 6 7\n3 2 7 3\n3 0 4 6\n3 0 6 2\n3 1 3 7\n3 1 7 5\n";
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    ply(colours, 8, 12, &vertices, faces)
}

fn ply(more: &str, vertex_count: usize, face_count: usize, vertices: &str, faces: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertex_count}\nproperty double x\nproperty double y\n\
         property double z\n{more}element face {face_count}\nproperty list uchar int vertex_indices\n\
         end_header\n{vertices}{faces}"
    )
}

fn keys(object: &Value) -> Vec<&str> {
    object.as_object().expect("an object").keys().map(String::as_str).collect()
}

// ---------------------------------------------------------------- simplify

#[test]
fn simplify_writes_a_lighter_mesh_and_says_so_in_one_line() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(20));
    let ran = desk.run("simplify hills.ply -o low.ply --ratio 0.25").with_status(0);
    let faces = desk.faces("low.ply");
    // A collapse may take two faces, so one less than asked is normal.
    assert!((199..=200).contains(&faces), "{faces}");
    assert_eq!(ran.text().lines().count(), 1);
    let begin = format!("hills.ply: 800 → {faces} faces ({:.1} %), rms ", faces as f64 / 8.0);
    assert!(ran.text().starts_with(&begin), "{}", ran.text());
    assert!(ran.text().contains(" % of the diagonal, ") && !ran.text().contains("max"), "{}", ran.text());
    assert_eq!(ran.stderr, "");
}

#[test]
fn the_report_has_the_promised_keys_in_their_order() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(20));
    let report = &desk.run("simplify hills.ply -o low.ply --faces 100 --json").with_status(0).objects()[0];
    let promised = [
        "input",
        "output",
        "method",
        "target",
        "reached",
        "stopped_by",
        "error",
        "refusals",
        "warnings",
        "threads",
        "seconds",
    ];
    assert_eq!(keys(report)[..promised.len()], promised);
    assert_eq!(keys(&report["input"]), ["path", "format", "faces", "vertices"]);
    assert_eq!(keys(&report["output"]), ["path", "format", "faces", "vertices"]);
    assert_eq!(keys(&report["error"]), ["estimate", "bound", "measured", "unit", "diagonal"]);
    assert_eq!(keys(&report["seconds"])[..3], ["read", "prepare", "simplify"]);
    assert_eq!(*keys(&report["seconds"]).last().expect("it has stages"), "write");
    assert_eq!(report["input"]["faces"], 800);
    assert_eq!(report["input"]["vertices"], 441);
    assert_eq!(report["output"]["path"], "low.ply");
    assert_eq!(report["method"], "memoryless");
    assert_eq!(report["target"].to_string(), r#"{"faces":100}"#);
    assert_eq!(report["reached"], true);
    assert_eq!(report["stopped_by"], "faces");
    assert_eq!(report["error"]["measured"], Value::Null);
    assert_eq!(report["error"]["bound"], Value::Null);
    let (faces, low) = (report["output"]["faces"].as_u64().expect("a count"), desk.info("low.ply"));
    assert!((1..=100).contains(&faces));
    assert_eq!((low["faces"].as_u64(), &low["vertices"]), (Some(faces), &report["output"]["vertices"]));
}

#[test]
fn a_measured_result_tells_the_largest_distance() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(12));
    let ran = desk.run("simplify hills.ply -o low.ply --ratio 0.5 --measure").with_status(0);
    assert!(ran.text().contains(" %, max "), "{}", ran.text());
    let words = "simplify hills.ply --dry-run --ratio 0.5 --bound two-sided --json";
    let report = &desk.run(words).with_status(0).objects()[0];
    assert_eq!(keys(&report["error"]["measured"]), ["hausdorff", "mean", "rms"]);
    assert_eq!(keys(&report["error"]["measured"]["rms"]), ["forward", "backward", "symmetric"]);
    assert_eq!(report["error"]["bound"], report["error"]["measured"]["hausdorff"]["symmetric"]);
}

#[test]
fn an_error_limit_is_kept_and_measured() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(20));
    let report = &desk.run("simplify hills.ply -o low.ply --error 0.5% --json").with_status(0).objects()[0];
    assert_eq!(report["target"].to_string(), r#"{"error":"0.5%"}"#);
    let error = &report["error"];
    let largest = error["measured"]["hausdorff"]["symmetric"].as_f64().expect("it is measured");
    assert!(largest <= 0.005 * error["diagonal"].as_f64().expect("a length"), "{error}");
}

#[test]
fn targets_are_checked_at_the_command_line() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(3));
    for target in [
        "",
        "--ratio 0",
        "--ratio 1.5",
        "--ratio x",
        "--faces 0",
        "--faces 1.5",
        "--vertices 0",
        "--error x",
        "--error nan",
        "--error=-1",
        "--ratio 0.5 --max-normal 400",
        "--ratio 0.5 --min-quality 2",
        "--ratio 0.5 --max-valence 1",
        "--ratio 0.5 --threads 0",
        "--ratio 0.5 --time-limit 0",
        "--ratio 0.5 --scale 0",
        "--ratio 0.5 --method magic",
        "--ratio 0.5 --preset magic",
    ] {
        let ran = desk.run(&format!("simplify hills.ply -o low.ply {target}")).with_status(2);
        assert!(ran.stderr.starts_with("error: ") && ran.stdout.is_empty(), "{target}: {}", ran.stderr);
    }
    assert_eq!(desk.names("."), ["hills.ply"]);
}

#[test]
fn several_targets_may_stand_together() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(10));
    let words = "simplify hills.ply -o low.ply --ratio 0.5 --faces 10 --json";
    let report = &desk.run(words).with_status(0).objects()[0];
    assert_eq!(report["target"].to_string(), r#"{"faces":10,"ratio":0.5}"#);
    assert_eq!(report["stopped_by"], "ratio");
}

#[test]
fn every_option_reaches_the_engine() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(10));
    let words = "simplify hills.ply -o low.obj --ratio 0.5 --fit off --placement endpoint --border lock \
                 --topology preserve --max-normal 60 --min-quality 0.01 --max-valence 12 --max-edge 50% --weld 0.001 \
                 --seed 7 --threads 1 --time-limit 60 --prune 1e-9 --escalate --per-mesh --method memoryless --normals recompute \
                 --preset visual --weight border=2";
    desk.run(words).with_status(0);
    assert!(desk.faces("low.obj") <= 200);
    assert_eq!(desk.info("low.obj")["attributes"].to_string(), r#"["normals"]"#);
}

#[test]
fn threads_do_not_change_the_result() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(30));
    desk.run("simplify hills.ply -o one.ply --ratio 0.1 --threads 1").with_status(0);
    desk.run("simplify hills.ply -o three.ply --ratio 0.1 --threads 3").with_status(0);
    let read = |name| fs::read(desk.path(name)).expect("it was written");
    assert!(read("one.ply") == read("three.ply"));
}

#[test]
fn dropped_attributes_are_warnings_and_strict_makes_them_faults() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    let ran = desk.run("simplify cube.ply -o low.stl --ratio 1").with_status(0);
    assert!(
        ran.stderr.starts_with("warning: cube.ply: ") && ran.stderr.contains("colours"),
        "{}",
        ran.stderr
    );
    let ran = desk.run("simplify cube.ply -o low.stl --ratio 1 --json").with_status(0);
    assert_eq!(ran.objects()[0]["warnings"].as_array().map(Vec::len), Some(1));
    assert_eq!(ran.stderr, "");
    fs::remove_file(desk.path("low.stl")).expect("it was written");
    let ran =
        desk.run("simplify cube.ply -o low.stl --ratio 1 --strict --quiet").with_status(3).with_one_error();
    assert!(ran.stdout.is_empty());
    assert_eq!(desk.faces("low.stl"), 12, "the result is written all the same");
}

#[test]
fn attributes_come_along() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    let ran = desk.run("simplify cube.ply -o low.ply --faces 8 --strict --weight color=2").with_status(0);
    assert_eq!(ran.stderr, "");
    assert_eq!(desk.info("low.ply")["attributes"].to_string(), r#"["colors"]"#);
    for wrong in ["--weight color", "--weight colour=1", "--weight color=-1"] {
        desk.run(&format!("simplify cube.ply -o low.ply --faces 8 {wrong}")).with_status(2);
    }
}

#[test]
fn a_target_out_of_reach_says_what_stopped_it() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(6));
    // Nothing but border: no vertex may be touched.
    desk.put("square.ply", &hills(1));
    let words = "simplify square.ply -o low.ply --faces 1 --border lock --topology preserve";
    let ran = desk.run(words).with_status(0);
    assert!(
        ran.stderr.starts_with("warning: square.ply: target not reached, stopped by refusals"),
        "{}",
        ran.stderr
    );
    assert_eq!(desk.faces("low.ply"), 2);
    desk.run(&format!("{words} --strict")).with_status(3).with_one_error();
    let report = &desk.run(&format!("{words} --strict --json")).with_status(3).objects()[0];
    assert_eq!(report["reached"], false);
    assert_eq!(report["stopped_by"], "refusals");
    assert_eq!(report["refusals"].to_string(), r#"{"border":10}"#);
}

#[test]
fn a_target_out_of_reach_says_what_would_help() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(10));
    let words = "simplify hills.ply -o low.ply --faces 2";
    let ran = desk.run(&format!("{words} --border lock")).with_status(0);
    assert!(ran.stderr.ends_with("; --border slide (now lock) would go further\n"), "{}", ran.stderr);
    let report = &desk.run(&format!("{words} --border lock --json")).with_status(0).objects()[0];
    let changes = &report["proposals"][0]["changes"];
    assert_eq!(changes.to_string(), r#"[{"option":"border","now":"lock","to":"slide"}]"#);
    assert!(report["proposals"][0]["gain"].as_u64() > Some(0));
    let ran = desk.run(&format!("{words} --max-edge 20%")).with_status(0);
    assert!(ran.stderr.ends_with("; a higher --max-edge (now 20%) would go further\n"), "{}", ran.stderr);
    // Nothing stands in the way but the shape: a closed surface needs four.
    desk.put("cube.ply", &coloured_cube());
    let ran = desk.run("simplify cube.ply -o low.ply --faces 1").with_status(0);
    assert!(ran.stderr.ends_with("; no option would go further\n"), "{}", ran.stderr);
    let report = &desk.run("simplify cube.ply -o low.ply --faces 1 --json").with_status(0).objects()[0];
    assert_eq!(report["proposals"].to_string(), "[]");
}

/// A ring of so many quads around and across.
fn ring(around: usize, across: usize) -> String {
    let (mut vertices, mut faces) = (String::new(), String::new());
    let turn = |i: usize, n: usize| i as f64 / n as f64 * std::f64::consts::TAU;
    for i in 0..around {
        for k in 0..across {
            let (a, b) = (turn(i, around), turn(k, across));
            let r = 1.0 + 0.4 * b.cos();
            vertices += &format!("{} {} {}\n", r * a.cos(), r * a.sin(), 0.4 * b.sin());
            let at = |i: usize, k: usize| i % around * across + k % across;
            let [p, q, r, s] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
            faces += &format!("3 {p} {q} {r}\n3 {p} {r} {s}\n");
        }
    }
    ply("", around * across, 2 * around * across, &vertices, &faces)
}

#[test]
fn an_escalation_says_what_it_did() {
    let desk = Desk::new();
    desk.put("ring.ply", &ring(32, 12));
    let words = "simplify ring.ply -o low.ply --faces 4 --topology preserve --escalate";
    let ran = desk.run(&format!("{words} --strict -v")).with_status(0);
    assert!(ran.stderr.contains("escalated to --topology relaxed: 20 → 4 faces"), "{}", ran.stderr);
    let report = &desk.run(&format!("{words} --json")).with_status(0).objects()[0];
    assert_eq!(report["reached"], true);
    assert!(report["necks_cut"].as_u64() > Some(0));
    let steps: Vec<_> = report["escalated"].as_array().expect("a list").iter().map(|s| &s["to"]).collect();
    assert_eq!(steps, ["relaxed"]);
    // Without it, the report proposes the step.
    let words = "simplify ring.ply -o low.ply --faces 4 --topology preserve --json";
    let report = &desk.run(words).with_status(0).objects()[0];
    assert_eq!(report["proposals"][0]["changes"][0]["to"], "relaxed");
}

#[test]
fn small_parts_are_pruned_and_counted() {
    let desk = Desk::new();
    // Tetrahedra of sizes 1, 2 and 4, apart.
    let (mut vertices, mut faces) = (String::new(), String::new());
    for (i, size) in [1, 2, 4].into_iter().enumerate() {
        let (x, n) = (10 * i, 4 * i);
        vertices += &format!("{x} 0 0\n{} 0 0\n{x} {size} 0\n{x} 0 {size}\n", x + size);
        for [a, b, c] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            faces += &format!("3 {} {} {}\n", a + n, b + n, c + n);
        }
    }
    desk.put("parts.ply", &ply("", 12, 12, &vertices, &faces));
    let words = "simplify parts.ply -o low.ply --ratio 1 --json --prune";
    let report = &desk.run(&format!("{words} 4")).with_status(0).objects()[0];
    assert_eq!(report["pruned"].to_string(), r#"{"parts":2,"faces":8}"#);
    assert_eq!((&report["warnings"], desk.faces("low.ply")), (&Value::Array(Vec::new()), 4));
    let report = &desk.run(&format!("{words} 10%")).with_status(0).objects()[0];
    assert_eq!(report["pruned"]["parts"], 1);
    let report = &desk.run(&format!("{words} 99")).with_status(0).objects()[0];
    assert_eq!(report["warnings"][0], "all parts are smaller than --prune: the largest was kept");
    assert_eq!(desk.faces("low.ply"), 4);
    desk.run("simplify parts.ply -o low.ply --ratio 1 --prune 0").with_status(2);
}

#[test]
fn a_preset_changes_the_result_and_what_is_typed_goes_before_it() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(20));
    let of = |words: &str| {
        desk.run(&format!("simplify hills.ply -o low.ply --ratio 0.2 {words}")).with_status(0);
        fs::read(desk.path("low.ply")).expect("it was written")
    };
    assert!(of("--preset auto") == of(""));
    let visual = of("--preset visual");
    assert_eq!(desk.info("low.ply")["attributes"], serde_json::json!([]), "lent normals are not written");
    assert!(visual != of(""));
    assert!(of("--preset cad") == of("--border slide --topology preserve"));
    assert!(of("--preset cad --border keep --topology relaxed") == of(""));
}

/// The hills as OBJ, the left half a group of its own with a material.
fn hills_in_groups(n: usize) -> String {
    let ply = hills(n);
    let body = ply.split_once("end_header\n").expect("it has a header").1;
    let (vertices, faces): (Vec<_>, Vec<_>) = body.lines().partition(|l| l.split(' ').count() == 3);
    let numbers =
        |l: &str| l.split(' ').skip(1).map(|i| i.parse::<usize>().expect("a number")).collect::<Vec<_>>();
    let line =
        |l: &&str| numbers(l).iter().fold("f".to_owned(), |text, i| format!("{text} {}", i + 1)) + "\n";
    let is_left = |l: &&&str| numbers(l)[0] % (n + 1) < n / 2;
    let (left, right): (Vec<&str>, Vec<&str>) = faces.iter().copied().partition(|l| is_left(&l));
    let mut text: String = vertices.iter().map(|v| format!("v {v}\n")).collect();
    text += "g left side\nusemtl grass\n";
    text.extend(left.iter().map(line));
    text += "g right\nusemtl rock\n";
    text.extend(right.iter().map(line));
    text
}

#[test]
fn what_is_locked_by_name_stays() {
    let desk = Desk::new();
    desk.put("hills.obj", &hills_in_groups(20));
    for name in ["left", "grass", "side"] {
        let words = format!("simplify hills.obj -o low.obj --ratio 0.6 --lock {name} --json");
        let report = &desk.run(&words).with_status(0).objects()[0];
        assert_eq!(report["reached"], true);
        assert_eq!(report["locked"]["faces"], 400, "{name}");
        assert_eq!(report["locked"]["vertices"], 11 * 21);
    }
    // All that may go goes; the reasons name the lock.
    let words = "simplify hills.obj -o low.obj --ratio 0.01 --lock left --lock rock --json";
    let report = &desk.run(words).with_status(0).objects()[0];
    assert_eq!((&report["reached"], &report["output"]["faces"]), (&false.into(), &800.into()));
    assert!(report["refusals"]["locked"].as_u64().is_some_and(|n| n > 0), "{}", report["refusals"]);
    let ran =
        desk.run("simplify hills.obj -o low.obj --ratio 0.5 --lock middle").with_status(1).with_one_error();
    assert!(
        ran.stderr.contains("--lock middle") && ran.stderr.contains("grass, left side, left, side"),
        "{}",
        ran.stderr
    );
    let plain = desk.run("simplify hills.obj -o low.obj --ratio 0.6 --json").with_status(0);
    assert!(!keys(&plain.objects()[0]).contains(&"locked"));
}

/// The hills with two more numbers at each vertex: where y is above a half, and y.
fn marked_hills(n: usize) -> String {
    let ply = hills(n);
    let (header, body) = ply.split_once("element face").expect("it has faces");
    let mut marked = String::new();
    for line in body.lines() {
        let y = line.split(' ').nth(1).and_then(|y| y.parse::<f64>().ok());
        match (line.split(' ').count(), y) {
            (3, Some(y)) if !line.contains("list") => {
                writeln!(marked, "{line} {} {}", u8::from(y > 0.5), 200.0 * y).expect("text");
            }
            _ => writeln!(marked, "{line}").expect("text"),
        }
    }
    format!("{header}property uchar lock\nproperty float rank\nelement face{marked}")
}

#[test]
fn attributes_of_vertices_lock_and_weigh() {
    let desk = Desk::new();
    desk.put("hills.ply", &marked_hills(20));
    let ran = desk.run("simplify hills.ply -o low.ply --faces 1 --lock lock --json").with_status(0);
    let report = &ran.objects()[0];
    assert_eq!((&report["locked"]["vertices"], &report["locked"]["faces"]), (&210.into(), &360.into()));
    let left = report["output"]["faces"].as_u64().expect("a count");
    assert!((360..440).contains(&left), "{left}");

    // With importance, the far side has more of the triangles.
    let far = |name: &str| {
        let text = fs::read_to_string(desk.path(name)).expect("it was written");
        let y = |l: &&str| l.split(' ').nth(2).and_then(|y| y.parse::<f64>().ok()).is_some_and(|y| y > 0.5);
        text.lines().filter(|l| l.starts_with("v ")).filter(y).count()
    };
    desk.run("simplify hills.ply -o plain.obj --faces 200").with_status(0);
    desk.run("simplify hills.ply -o far.obj --faces 200 --importance rank=20").with_status(0);
    assert!(far("far.obj") * 2 > far("plain.obj") * 3, "{} and {}", far("far.obj"), far("plain.obj"));
    let ran =
        desk.run("simplify hills.ply -o x.ply --faces 9 --importance heat").with_status(1).with_one_error();
    assert!(ran.stderr.contains("--importance heat") && ran.stderr.contains("lock, rank"), "{}", ran.stderr);
    desk.run("simplify hills.ply -o x.ply --faces 9 --importance rank=0").with_status(2);
}

#[test]
fn a_part_of_a_scene_is_locked_by_its_names() {
    let desk = Desk::new();
    desk.put("hills.ply", &hills(10));
    desk.run("convert hills.ply hills.gltf").with_status(0);
    let text = fs::read_to_string(desk.path("hills.gltf")).expect("it was written");
    let mut json: Value = serde_json::from_str(&text).expect("it is JSON");
    json["nodes"][0]["name"] = "near".into();
    json["nodes"].as_array_mut().expect("nodes").push(serde_json::json!({
        "name": "far", "mesh": 1, "translation": [5, 0, 0]
    }));
    let mut mesh = json["meshes"][0].clone();
    mesh["primitives"][0]["material"] = 0.into();
    json["meshes"].as_array_mut().expect("meshes").push(mesh);
    json["materials"] = serde_json::json!([{ "name": "stone" }]);
    json["scenes"][0]["nodes"] = serde_json::json!([0, 1]);
    desk.put("two.gltf", &json.to_string());
    for name in ["far", "stone", "meshes[1]"] {
        let words = format!("simplify two.gltf -o low.glb --ratio 0.1 --lock {name} --json");
        let report = &desk.run(&words).with_status(0).objects()[0];
        assert_eq!((&report["reached"], &report["locked"]["faces"]), (&false.into(), &200.into()), "{name}");
        let left = report["output"]["faces"].as_u64().expect("a count");
        assert!((200..220).contains(&left), "{left}");
    }
    let ran = desk.run("simplify two.gltf -o low.glb --ratio 0.1 --lock x").with_status(1).with_one_error();
    assert!(["near", "far", "stone"].iter().all(|n| ran.stderr.contains(n)), "{}", ran.stderr);
    let ran = desk.run("simplify two.gltf -o low.obj --ratio 0.1 --lock far").with_status(1).with_one_error();
    assert!(ran.stderr.contains("only where the output is glTF"), "{}", ran.stderr);
}

#[test]
fn a_failing_file_does_not_stop_the_others() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(5));
    desk.put("bad.ply", "ply\nformat ascii 1.0\nelement vertex many\nend_header\n");
    desk.put("b.ply", &hills(6));
    let ran = desk.run("simplify a.ply bad.ply missing.ply b.ply -O low --ratio 0.5 --json").with_status(1);
    let objects = ran.objects();
    assert_eq!(objects.len(), 4);
    assert_eq!(objects[0]["input"]["path"], "a.ply");
    assert_eq!(keys(&objects[1]), ["path", "error"]);
    assert_eq!(objects[1]["path"], "bad.ply");
    assert_eq!(objects[2]["path"], "missing.ply");
    assert_eq!(objects[3]["input"]["path"], "b.ply");
    assert_eq!(ran.stderr.lines().count(), 2);
    assert!(ran.stderr.starts_with("error: bad.ply: "), "{}", ran.stderr);
    assert_eq!(desk.names("low"), ["a_low.ply", "b_low.ply"]);
}

#[test]
fn many_files_come_out_in_their_order() {
    let desk = Desk::new();
    let names: Vec<String> = (0..9).map(|i| format!("m{i}.ply")).collect();
    for (i, name) in names.iter().enumerate() {
        desk.put(name, &hills(20 - 2 * i));
    }
    let words = format!("simplify {} -O low --ratio 0.5 --json --threads 4", names.join(" "));
    let objects = desk.run(&words).with_status(0).objects();
    let got: Vec<&str> = objects.iter().filter_map(|o| o["input"]["path"].as_str()).collect();
    assert_eq!(got, names);
}

#[test]
fn results_are_named_by_the_template() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(3));
    desk.put("b.ply", &hills(3));
    desk.run("simplify a.ply b.ply -O out/deep --to stl --name {stem}-half.{ext} --ratio 0.5").with_status(0);
    assert_eq!(desk.names("out/deep"), ["a-half.stl", "b-half.stl"]);
    assert_eq!(desk.info("out/deep/a-half.stl")["format"], "stl");
    for words in ["-O out --name same.ply", "-o one.ply", "-O out --name {nothing}.ply"] {
        let ran = desk.run(&format!("simplify a.ply b.ply {words} --ratio 0.5"));
        ran.with_status(2).with_one_error();
    }
    assert_eq!(desk.names("out"), ["deep"], "nothing is done before the fault is found");
}

#[test]
fn standard_streams_carry_meshes() {
    let desk = Desk::new();
    let ran = desk.run_with("simplify - -o - --to stl --ratio 0.5", hills(10)).with_status(0);
    let faces = (ran.stdout.len() - 84) / 50;
    assert!((99..=100).contains(&faces), "{faces}");
    assert!(ran.stderr.starts_with(&format!("-: 200 → {faces} faces")), "{}", ran.stderr);
    let ran = desk.run_with("info - --json", ran.stdout).with_status(0);
    assert_eq!((&ran.objects()[0]["format"], &ran.objects()[0]["faces"]), (&"stl".into(), &faces.into()));
    desk.run_with("simplify - -o - --ratio 0.5", hills(2)).with_status(2).with_one_error();
    desk.run_with("info --from stl -", "no mesh").with_status(1).with_one_error();
    desk.run("compare - -").with_status(2).with_one_error();
}

#[test]
fn an_existing_file_survives_a_failure_and_a_folder_is_refused() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(3));
    desk.put("bad.ply", "ply\nbad");
    desk.put("out.ply", "precious");
    desk.run("simplify bad.ply -o out.ply --ratio 0.5").with_status(1).with_one_error();
    assert_eq!(fs::read_to_string(desk.path("out.ply")).expect("it is there"), "precious");
    desk.run("simplify a.ply -o out.ply --ratio 0.5").with_status(0);
    assert_eq!(desk.faces("out.ply"), 9);
    fs::create_dir(desk.path("folder.ply")).expect("there is room");
    for command in ["simplify --ratio 0.5 a.ply -o", "simplify --ratio 0.5 --force a.ply -o", "convert a.ply"]
    {
        desk.run(&format!("{command} folder.ply")).with_status(2).with_one_error();
    }
    desk.run("simplify a.ply -o nowhere/out.ply --ratio 0.5").with_status(1).with_one_error();
    desk.run("simplify a.ply -O out.ply --ratio 0.5").with_status(2).with_one_error();
    assert_eq!(desk.names("."), ["a.ply", "bad.ply", "folder.ply", "out.ply"], "nothing else stays behind");
}

#[test]
fn a_file_can_be_its_own_output() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(10));
    desk.run("simplify a.ply -o a.ply --faces 50").with_status(0);
    assert!(desk.faces("a.ply") <= 50);
}

#[test]
fn a_write_protected_file_needs_force() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(3));
    desk.put("out.ply", "precious");
    let protect = |yes| {
        let mut permissions = fs::metadata(desk.path("out.ply")).expect("it is there").permissions();
        permissions.set_readonly(yes);
        fs::set_permissions(desk.path("out.ply"), permissions).expect("it is ours");
    };
    protect(true);
    desk.run("convert a.ply out.ply").with_status(1).with_one_error();
    assert_eq!(fs::read_to_string(desk.path("out.ply")).expect("it is there"), "precious");
    desk.run("convert a.ply out.ply --force").with_status(0);
    assert_eq!(desk.faces("out.ply"), 18);
    assert_eq!(desk.names("."), ["a.ply", "out.ply"]);
}

#[test]
fn a_dry_run_writes_nothing_and_knows_the_losses() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    let words = "simplify cube.ply -O low --to stl --ratio 1 --dry-run --json";
    let report = &desk.run(words).with_status(0).objects()[0];
    assert_eq!(report["dry_run"], true);
    assert_eq!(report["output"]["format"], "stl");
    assert_eq!(desk.names("."), ["cube.ply"]);
}

#[test]
fn quiet_is_quiet_and_verbose_tells_more() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(5));
    let ran = desk.run("simplify a.ply -o b.ply --ratio 0.5 --quiet").with_status(0);
    assert_eq!((ran.stdout.len(), ran.stderr.as_str()), (0, ""));
    let ran = desk.run("simplify a.ply -o b.ply --ratio 0.5 -v").with_status(0);
    assert!(ran.text().contains("prepare ") && ran.text().lines().count() > 1, "{}", ran.text());
    let ran = desk.run("simplify nothing.ply -o b.ply --ratio 0.5 --quiet").with_status(1).with_one_error();
    assert_eq!(ran.stderr, "error: nothing.ply: cannot read: there is no such file\n");
}

#[test]
fn the_output_is_scaled_and_turned() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    desk.run("convert cube.ply big.ply --scale 10 --up y").with_status(0);
    let bounds = &desk.info("big.ply")["bounds"];
    assert_eq!(bounds["min"].to_string(), "[0.0,0.0,-10.0]");
    assert_eq!(bounds["max"].to_string(), "[10.0,10.0,0.0]");
    assert!(
        desk.info("big.ply")["volume"].as_f64().expect("a volume") > 999.0,
        "it is not turned inside out"
    );
}

// ------------------------------------------------ info, compare, convert

#[test]
fn info_has_the_promised_keys_in_their_order() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    let info = desk.info("cube.ply");
    assert_eq!(
        keys(&info),
        [
            "path",
            "format",
            "meshes",
            "faces",
            "polygons",
            "vertices",
            "positions",
            "components",
            "border_edges",
            "border_loops",
            "non_manifold_edges",
            "non_manifold_vertices",
            "degenerate_faces",
            "duplicate_faces",
            "unused_vertices",
            "non_finite_vertices",
            "closed",
            "manifold",
            "oriented",
            "genus",
            "bounds",
            "area",
            "volume",
            "attributes",
            "materials",
            "textures",
            "skins",
            "animations",
            "morph_targets",
            "warnings",
        ]
    );
    assert_eq!(keys(&info["bounds"]), ["min", "max", "diagonal"]);
    assert_eq!(
        (&info["closed"], &info["manifold"], &info["oriented"]),
        (&true.into(), &true.into(), &true.into())
    );
    assert_eq!(
        (&info["genus"], &info["components"], &info["border_edges"]),
        (&0.into(), &1.into(), &0.into())
    );
    assert!((info["area"].as_f64().expect("an area") - 6.0).abs() < 1e-9);
    assert!((info["volume"].as_f64().expect("a volume") - 1.0).abs() < 1e-9);
    assert_eq!(info["attributes"].to_string(), r#"["colors"]"#);
}

#[test]
fn info_names_defects() {
    let desk = Desk::new();
    // Three faces at one edge, one of them twice, one without area, a vertex that nobody uses.
    let vertices = "0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n9 9 9\n";
    let faces = "3 0 1 2\n3 1 0 3\n3 0 1 4\n3 0 1 4\n3 0 0 1\n";
    desk.put("bad.ply", &ply("", 6, 5, vertices, faces));
    let info = desk.info("bad.ply");
    assert_eq!((&info["manifold"], &info["genus"]), (&false.into(), &Value::Null));
    assert_eq!(info["duplicate_faces"], 1);
    assert_eq!(info["degenerate_faces"], 1);
    assert_eq!(info["unused_vertices"], 1);
    let ran = desk.run("info bad.ply").with_status(0);
    for line in ["  duplicate faces  1", "  surface          not closed, not manifold"] {
        assert!(ran.text().contains(line), "{}", ran.text());
    }
}

#[test]
fn info_goes_on_after_a_failure() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(2));
    let ran = desk.run("info --json missing.ply a.ply").with_status(1);
    assert_eq!(keys(&ran.objects()[0]), ["path", "error"]);
    assert_eq!(ran.objects()[1]["faces"], 8);
    desk.run("info").with_status(2);
}

#[test]
fn compare_has_the_promised_keys_and_knows_equals() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(8));
    desk.run("convert a.ply b.ply --scale 1.5").with_status(0);
    let same =
        desk.run("compare a.ply a.ply --json --samples 1000 --seed 3").with_status(0).objects().remove(0);
    assert_eq!(
        keys(&same),
        [
            "hausdorff",
            "mean",
            "rms",
            "p99",
            "relative_to_diagonal",
            "diagonal",
            "normal_deviation_deg",
            "samples",
            "seed",
            "attributes",
            "warnings",
        ]
    );
    assert_eq!(keys(&same["p99"]), ["forward", "backward", "symmetric"]);
    assert_eq!(keys(&same["relative_to_diagonal"]), ["hausdorff", "mean", "rms"]);
    assert_eq!(keys(&same["normal_deviation_deg"]), ["mean", "p95"]);
    assert_eq!(same["seed"], 3);
    assert!(same["hausdorff"]["symmetric"].as_f64().expect("a distance") < 1e-12);
    let other = desk.run("compare a.ply b.ply --json").with_status(0).objects().remove(0);
    assert!(other["hausdorff"]["symmetric"].as_f64().expect("a distance") > 0.5);
    let table = desk.run("compare a.ply b.ply").with_status(0);
    for word in ["largest", "mean", "rms", "p99", "forward", "backward", "symmetric"] {
        assert!(table.text().contains(word), "{}", table.text());
    }
    desk.run("compare a.ply missing.ply").with_status(1).with_one_error();
}

#[test]
fn a_heat_map_is_the_reference_in_colours() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(8));
    desk.put("b.ply", &hills(3));
    desk.run("compare a.ply b.ply --heatmap heat.ply").with_status(0);
    let info = desk.info("heat.ply");
    assert_eq!((&info["faces"], &info["vertices"]), (&128.into(), &81.into()));
    assert_eq!(info["attributes"].to_string(), r#"["colors"]"#);
    desk.run("compare a.ply b.ply --heatmap heat.stl").with_status(2).with_one_error();
}

#[test]
fn convert_keeps_what_fits_and_warns_of_the_rest() {
    let desk = Desk::new();
    desk.put("cube.ply", &coloured_cube());
    let ran = desk.run("convert cube.ply cube.obj").with_status(0);
    assert_eq!(ran.stderr, "");
    assert_eq!(desk.info("cube.obj")["attributes"].to_string(), r#"["colors"]"#);
    let ran = desk.run("convert cube.ply cube.stl").with_status(0);
    assert!(ran.stderr.starts_with("warning: cube.ply: STL cannot carry colours"), "{}", ran.stderr);
    desk.run("convert cube.ply strict.stl --strict").with_status(3).with_one_error();
    assert_eq!(desk.faces("strict.stl"), 12);
    for name in ["cube.off", "cube.glb", "cube.gltf", "text.ply"] {
        desk.run(&format!("convert cube.ply {name} --ascii")).with_status(0);
        assert_eq!(desk.faces(name), 12, "{name}");
    }
    assert!(fs::read_to_string(desk.path("text.ply")).expect("it is text").contains("format ascii"));
    let ran = desk.run("convert cube.ply - --to stl --ascii --quiet").with_status(0);
    assert!(ran.text().starts_with("solid"));
    desk.run("convert cube.ply cube.doc").with_status(2).with_one_error();
}

/// A triangle with an outside image, an animated node and an extension that nobody knows.
const SCENE: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[1]}],
"nodes":[{"name":"leaf","mesh":0},{"name":"root","children":[0],"scale":[2,2,2],"extras":{"z":1,"a":0.1}}],
"meshes":[{"name":"kite","primitives":[{"material":0,"attributes":{"POSITION":0}}]}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"extensions":{"ACME_shine":{"b":2,"a":1}}}],
"textures":[{"source":0}],"images":[{"name":"skin","uri":"a%20b.png"}],"extensionsUsed":["ACME_shine"],
"animations":[{"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}}],"samplers":[{"input":1,"output":2}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":1,"type":"SCALAR","min":[0],"max":[0]},
{"bufferView":1,"componentType":5126,"count":1,"type":"VEC3"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12}],
"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAA"}]}"#;

#[test]
fn convert_keeps_a_whole_scene() {
    let desk = Desk::new();
    for folder in ["in", "out"] {
        fs::create_dir(desk.path(folder)).expect("there is room for a folder");
    }
    desk.put("in/a.gltf", SCENE);
    let image = b"\x89PNG, or nearly";
    fs::write(desk.path("in/a b.png"), image).expect("there is room for a file");
    let source: Value = serde_json::from_str(SCENE).expect("it is JSON");
    let kept =
        ["asset", "scene", "scenes", "nodes", "meshes", "materials", "textures", "animations", "accessors"];
    let json_of = |name: &str| {
        let bytes = fs::read(desk.path(name)).expect("it was written");
        let json = match bytes.strip_prefix(b"glTF") {
            None => bytes,
            Some(_) => bytes[20..]
                [..u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize]
                .to_vec(),
        };
        let json: Value = serde_json::from_slice(&json).expect("it is JSON");
        kept.iter()
            .for_each(|key| assert_eq!(json[key].to_string(), source[key].to_string(), "{name}: {key}"));
        json
    };

    // Into one file, the image too.
    let ran = desk.run("convert in/a.gltf out/a.glb --strict").with_status(0);
    assert_eq!(ran.stderr, "");
    let glb = json_of("out/a.glb");
    assert_eq!(glb["images"].to_string(), r#"[{"name":"skin","bufferView":2,"mimeType":"image/png"}]"#);
    let bytes = fs::read(desk.path("out/a.glb")).expect("it was written");
    assert!(bytes.windows(image.len()).any(|w| w == image));
    // And back; from standard input too.
    desk.run("convert out/a.glb out/b.gltf --strict").with_status(0);
    assert_eq!(json_of("out/b.gltf")["images"], glb["images"]);
    let ran = desk.run_with("convert - - --to glb --quiet", bytes.clone()).with_status(0);
    assert_eq!(ran.stdout, bytes);

    // Another folder: the image is where it was.
    let ran = desk.run("convert in/a.gltf out/c.gltf --strict").with_status(0);
    assert!(ran.stderr.contains("still those in the folder of the input: a%20b.png"), "{}", ran.stderr);
    assert_eq!(json_of("out/c.gltf")["images"][0]["uri"], "../in/a%20b.png");
    let ran = desk.run("convert in/a.gltf in/d.gltf --strict").with_status(0);
    assert_eq!(ran.stderr, "");
    assert_eq!(json_of("in/d.gltf")["images"], source["images"]);

    // Another format, or a turn, takes the mesh alone, and says so.
    let ran = desk.run("convert in/a.gltf out/a.ply").with_status(0);
    assert!(ran.stderr.contains("animations are not carried"), "{}", ran.stderr);
    desk.run("convert in/a.gltf out/e.glb --up z --strict").with_status(3);
    assert_eq!(desk.faces("out/e.glb"), 1);
}

#[test]
fn simplify_keeps_a_whole_scene() {
    let desk = Desk::new();
    desk.put("a.gltf", SCENE);
    let source: Value = serde_json::from_str(SCENE).expect("it is JSON");
    let ran = desk.run("simplify a.gltf -o b.gltf --faces 1 --strict --json").with_status(0);
    let report = &ran.objects()[0];
    assert_eq!((&report["input"]["faces"], &report["output"]["faces"]), (&1.into(), &1.into()));
    // The diagonal is that of the scene, where a node makes the mesh twice as large.
    let diagonal = report["error"]["diagonal"].as_f64().expect("it is a number");
    assert!((diagonal - 8f64.sqrt()).abs() < 1e-6, "{diagonal}");
    let text = fs::read_to_string(desk.path("b.gltf")).expect("it was written");
    let json: Value = serde_json::from_str(&text).expect("it is JSON");
    for key in ["asset", "scene", "scenes", "nodes", "materials", "textures", "images", "animations"] {
        assert_eq!(json[key].to_string(), source[key].to_string(), "{key}");
    }
    // Several triangles: the mesh is lighter, its node stays.
    desk.put("hills.ply", &hills(10));
    desk.run("convert hills.ply hills.glb").with_status(0);
    desk.run("simplify hills.glb -o low.glb --ratio 0.2 --strict").with_status(0);
    assert!(desk.faces("low.glb") <= 40);
    desk.run("simplify hills.glb -o low.ply --ratio 0.2").with_status(0);
    assert!(desk.faces("low.ply") <= 40);
    let words = "simplify hills.glb -o low.glb --ratio 0.2 --per-mesh --json";
    let meshes = &desk.run(words).with_status(0).objects()[0]["meshes"];
    assert_eq!((&meshes[0]["instances"], &meshes[0]["input"]["faces"]), (&1.into(), &200.into()));
    assert_eq!(meshes[0]["output"]["faces"].as_u64(), Some(desk.faces("low.glb")));
    assert_eq!(meshes[0]["reached"], true);
}

// --------------------------------------------------------------- the rest

#[test]
fn package_makers_get_their_pages() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(desk.run(&format!("completions {shell}")).with_status(0).text().contains("lodsmith"));
    }
    assert!(desk.run("man").with_status(0).text().contains(".TH lodsmith 1"));
    assert!(desk.run("man simplify").with_status(0).text().contains("lodsmith\\-simplify"));
    desk.run("man nothing").with_status(2).with_one_error();
    assert!(desk.run("--version").with_status(0).text().starts_with("lodsmith 0."));
}

#[test]
fn commands_of_later_releases_are_not_there_yet() {
    let desk = Desk::new();
    for command in ["lod", "view", "render", "progressive", "clean", "methods", "doctor"] {
        desk.run(command).with_status(2);
    }
}

#[test]
#[cfg(unix)]
fn a_closed_pipe_is_no_fault() {
    use std::process::{Command, Stdio};
    let desk = Desk::new();
    desk.put("a.ply", &hills(40));
    for words in
        ["info --json a.ply a.ply", "convert a.ply - --to obj --quiet", "completions zsh", "simplify --help"]
    {
        let mut child = Command::new(assert_cmd::cargo::cargo_bin("lodsmith"))
            .args(words.split_whitespace())
            .current_dir(desk.folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(0), "{words}");
        assert!(output.stderr.is_empty(), "{words}: {}", output.stderr.escape_ascii());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told_once() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(4));
    let ran = desk.run("convert a.ply /dev/full --to stl").with_status(1).with_one_error();
    assert_eq!(ran.stderr.matches("No space left").count(), 1, "{}", ran.stderr);
}

#[test]
#[cfg(unix)]
fn an_interrupt_ends_it_without_half_files() {
    use std::io::Read as _;
    use std::os::unix::process::ExitStatusExt as _;
    use std::process::{Command, Stdio};
    let desk = Desk::new();
    desk.put("a.ply", &hills(20));
    // It waits for a mesh on a pipe that stays open, so that the interrupt cannot come too late.
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("lodsmith"))
        .args([
            "simplify",
            "a.ply",
            "-",
            "-O",
            "low",
            "--to",
            "ply",
            "--ratio",
            "0.5",
            "--threads",
            "1",
            "--json",
        ])
        .current_dir(desk.folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    // Waiting for the end would close the pipe.
    let _open = child.stdin.take();
    // The first report says that it is on its way.
    let mut byte = [0];
    child.stdout.as_mut().expect("it is piped").read_exact(&mut byte).expect("a report comes");
    let killed =
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(killed.success());
    let status = child.wait().expect("it ends");
    assert_eq!((status.code(), status.signal()), (Some(130), None));
    assert_eq!(desk.names("low"), ["a_low.ply"]);
}

#[test]
fn nothing_is_drawn_on_a_pipe() {
    let desk = Desk::new();
    desk.put("a.ply", &hills(40));
    let ran = desk.run("simplify a.ply -o b.ply --ratio 0.1").with_status(0);
    assert!(!ran.stderr.contains('\x1b') && !ran.text().contains('\x1b'));
    assert!(Path::new(&desk.path("b.ply")).is_file());
}
