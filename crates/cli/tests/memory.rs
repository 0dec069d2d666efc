//! No run under a memory limit is aborted: it either completes, or fails with one line that names the limit.
//! docs/trust.md promises this to users.
#![cfg(target_os = "linux")]

use std::fs;
use std::process::{Command, Output};

use crate::sandbox::{CliSandbox, hills};

/// Runs the command with an address space of twice `mib` MiB, of which it may use half.
fn run_within(sandbox: &CliSandbox, mib: u64, arguments: &str) -> Output {
    let script = format!("ulimit -v {}; exec \"$@\" --max-memory {mib}M", 2 * mib * 1024);
    Command::new("sh")
        .args(["-c", &script, "sh"])
        .arg(assert_cmd::cargo::cargo_bin("lodsmith"))
        .args(arguments.split_whitespace())
        .current_dir(sandbox.folder.path())
        .env_remove("RUST_BACKTRACE")
        .output()
        .expect("there is a shell")
}

/// Checks how the process ended. Returns true if it completed.
fn is_done(output: &Output, what: &str) -> bool {
    let stderr = String::from_utf8_lossy(&output.stderr);
    match output.status.code() {
        Some(0) => true,
        Some(1) => {
            let errors: Vec<&str> = stderr.lines().filter(|line| line.contains("error: ")).collect();
            assert_eq!(errors.len(), 1, "{what}: {stderr}");
            assert!(errors[0].contains("--max-memory"), "{what}: {stderr}");
            false
        }
        other => panic!("{what}: {other:?}, {:?}: {stderr}", output.status),
    }
}

/// Writes models of about `faces` faces in several formats.
fn models(sandbox: &CliSandbox, faces: usize) {
    sandbox.put("a.ply", &hills(((faces / 2) as f64).sqrt() as usize));
    for name in ["a.obj", "a.stl", "a.glb", "a.off"] {
        sandbox.run(&format!("convert a.ply {name}")).with_status(0);
    }
    sandbox.run("progressive build a.ply -o a.lpm --ratio 0.5").with_status(0);
}

const COMMANDS: [&str; 22] = [
    "info a.ply",
    "info a.obj",
    "info a.stl",
    "info a.off",
    "info a.lpm",
    "convert a.glb out.glb",
    "convert a.glb out.ply",
    "convert a.obj out.stl",
    "convert a.ply out.glb",
    "clean a.obj -o out.obj",
    "clean a.glb -o out.glb",
    "simplify a.ply -o out.ply --ratio 0.5",
    "simplify a.glb -o out.glb --ratio 0.5",
    "simplify a.ply -o out.ply --ratio 0.5 --method quadric",
    "simplify a.ply -o out.ply --ratio 0.5 --method cluster",
    "simplify a.ply -o out.ply --method planar",
    "simplify a.obj a.stl a.off -O many --ratio 0.5 --name {stem}_{ext}.ply",
    "lod a.ply -o out.glb --levels 0.5,0.25",
    "compare a.ply a.obj",
    "progressive build a.ply -o out.lpm --ratio 0.5",
    "progressive extract a.lpm -o out.ply",
    "render a.ply -o out.png --size 2000x1600",
];

/// Runs every command within each limit. Returns the number of runs that completed, and the number of all runs.
fn run_all(sandbox: &CliSandbox, commands: &[&str], limits: &[u64]) -> (usize, usize) {
    let mut done = 0;
    for &mib in limits {
        for arguments in commands {
            done += usize::from(is_done(
                &run_within(sandbox, mib, arguments),
                &format!("{mib} MiB: {arguments}"),
            ));
        }
    }
    (done, commands.len() * limits.len())
}

#[test]
fn no_run_under_a_limit_is_aborted() {
    let sandbox = CliSandbox::new();
    // All 110 runs by hand: LODSMITH_ALL_RUNS=1 cargo test -p lodsmith-cli --test all memory::
    let is_all = std::env::var_os("LODSMITH_ALL_RUNS").is_some();
    models(&sandbox, if is_all { 200_000 } else { 10_000 });
    let few: Vec<&str> = COMMANDS.iter().copied().skip(1).step_by(2).collect();
    let (done, all) = match is_all {
        true => run_all(&sandbox, &COMMANDS, &[32, 48, 64, 96, 128]),
        false => run_all(&sandbox, &few, &[32, 40]),
    };
    // If all runs completed, or none, the limits would test nothing.
    assert!(done > 0 && done < all, "{done} of {all}");
}

#[test]
fn a_step_that_needs_too_much_memory_is_refused() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(200));
    for (arguments, step) in [
        ("simplify a.ply -o out.ply --ratio 0.5 --method planar", "simplify"),
        ("simplify a.ply -o out.ply --method remesh --edge-length 0.001", "simplify"),
        ("simplify a.ply -o out.ply --method remesh --voxel 0.001", "simplify"),
        ("lod a.ply -o out.glb --levels 0.5", "lod"),
        ("progressive build a.ply -o out.lpm", "progressive build"),
        ("compare a.ply a.ply --samples 5000000", "compare"),
        // (These ended in an abort.)
        ("compare a.ply a.ply --samples 9 --views 4294967296", "compare --views"),
        ("compare a.ply a.ply --samples 9 --views 99 --size 999x999 --views-sheet a.png", "compare --views"),
        ("methods a.ply --ratio 0.5", "methods"),
        ("methods a.ply --ratio 0.5 --samples 99999999999", "methods"),
        ("render a.ply -o out.png --size 4000x4000", "render"),
    ] {
        let outcome = sandbox.run(&format!("{arguments} --max-memory 32M")).with_status(1).with_one_error();
        assert!(
            outcome.stderr.contains(&format!("{step} would take about ")),
            "{arguments}: {}",
            outcome.stderr
        );
        assert!(
            outcome.stderr.contains("above the limit of 32.00 MiB (--max-memory)"),
            "{arguments}: {}",
            outcome.stderr
        );
    }
    assert_eq!(sandbox.names("."), ["a.ply"]);
    sandbox.run("info a.ply --max-memory 12").with_status(2);
    sandbox.run("info a.ply --max-memory 1G").with_status(0);
}

#[test]
fn a_process_that_uses_more_than_estimated_is_ended() {
    let sandbox = CliSandbox::new();
    // The estimate assumes half as many vertices as faces, as in a closed surface; here no two faces share a vertex.
    let facets = 400_000u32;
    let mut stl = vec![0; 80];
    stl.extend(facets.to_le_bytes());
    for i in 0..facets {
        stl.extend([0; 12]);
        for [x, y] in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]] {
            stl.extend([i as f32 + x, y, 0.0].into_iter().flat_map(f32::to_le_bytes));
        }
        stl.extend([0; 2]);
    }
    fs::write(sandbox.path("soup.stl"), stl).expect("the file can be written");
    let outcome = sandbox.run("convert soup.stl out.ply --max-memory 40M").with_status(1).with_one_error();
    assert!(
        outcome.stderr.contains("more memory is needed than the limit of 40.00 MiB"),
        "{}",
        outcome.stderr
    );
    assert_eq!(sandbox.names("."), ["soup.stl"]);
    sandbox.run("convert soup.stl out.ply --max-memory 400M").with_status(0);
}
