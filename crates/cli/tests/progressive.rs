//! `lodsmith progressive`.

use std::fs;

use crate::sandbox::{self, CliSandbox, hills};

/// A folder with the hills, as PLY and as LPM.
fn with_hills() -> (CliSandbox, Vec<u8>) {
    let sandbox = CliSandbox::new();
    sandbox.put("text.ply", &hills(24));
    sandbox.run("convert text.ply hills.ply").with_status(0);
    sandbox.run("progressive build hills.ply -o hills.lpm").with_status(0);
    let bytes = fs::read(sandbox.path("hills.lpm")).expect("it was written");
    (sandbox, bytes)
}

#[test]
fn the_finest_level_is_the_input_byte_for_byte() {
    let (sandbox, bytes) = with_hills();
    sandbox.run("progressive extract hills.lpm -o back.ply").with_status(0);
    let read = |name: &str| fs::read(sandbox.path(name)).expect("it was written");
    assert!(read("back.ply") == read("hills.ply"));
    sandbox.run("convert hills.lpm again.ply").with_status(0);
    assert!(read("again.ply") == read("hills.ply"));
    let same = sandbox.run("progressive build hills.ply -o - --threads 1").with_status(0);
    assert!(same.stdout == bytes);
}

#[test]
fn levels_meet_their_targets() {
    let (sandbox, bytes) = with_hills();
    let full = sandbox.faces("hills.ply");
    for (target, most) in
        [("--faces 200", 200), ("--ratio 0.25", full / 4), ("--ratio 0.25 --faces 300", 300)]
    {
        let outcome =
            sandbox.run(&format!("progressive extract hills.lpm -o out.glb --json {target}")).with_status(0);
        let report = &outcome.objects()[0];
        let faces = report["output"]["faces"].as_u64().expect("a count");
        assert!(faces <= most && faces + 4 >= most, "{report}");
        assert_eq!((sandbox.faces("out.glb"), &report["reached"]), (faces, &true.into()));
        assert!(report["error"]["estimate"].as_f64().expect("a length") > 0.0);
    }
    let outcome = sandbox.run("progressive extract hills.lpm -o v.ply --json --vertices 100").with_status(0);
    assert!(outcome.objects()[0]["output"]["vertices"].as_u64().expect("a count") <= 100);
    let near = sandbox.run("progressive extract hills.lpm -o e.ply --json --error 0.1%").with_status(0);
    let far = sandbox.run("progressive extract hills.lpm -o e.ply --json --error 1%").with_status(0);
    let faces =
        |outcome: &sandbox::RunOutcome| outcome.objects()[0]["output"]["faces"].as_u64().expect("a count");
    assert!(faces(&far) < faces(&near) && faces(&near) < full);
    let measured =
        far.objects()[0]["error"]["measured"]["hausdorff"]["symmetric"].as_f64().expect("a length");
    let outcome = sandbox.run("compare hills.ply e.ply --json").with_status(0);
    let compared = outcome.objects()[0]["hausdorff"]["symmetric"].as_f64().expect("a length");
    let diagonal = outcome.objects()[0]["diagonal"].as_f64().expect("a length");
    assert!(
        measured <= 0.01 * diagonal && compared <= 0.0101 * diagonal,
        "{measured} {compared} of {diagonal}"
    );
    // --error also limits the base of a new file.
    let outcome = sandbox.run("progressive build hills.ply -o near.lpm --error 1% --json").with_status(0);
    assert_eq!(outcome.objects()[0]["base"]["faces"], far.objects()[0]["output"]["faces"]);
    // The fit moves vertices, but adds none.
    sandbox.run("progressive extract hills.lpm -o fit.ply --faces 300").with_status(0);
    sandbox.run("progressive extract hills.lpm -o plain.ply --faces 300 --no-fit").with_status(0);
    assert_eq!(sandbox.faces("fit.ply"), sandbox.faces("plain.ply"));
    assert_ne!(fs::read(sandbox.path("fit.ply")).ok(), fs::read(sandbox.path("plain.ply")).ok());
    let piped = sandbox.run_with("progressive extract - -o - --to ply --faces 300", bytes).with_status(0);
    assert!(Some(piped.stdout) == fs::read(sandbox.path("fit.ply")).ok());
}

#[test]
fn a_base_target_is_kept_and_coarser_levels_are_unreachable() {
    let (sandbox, _) = with_hills();
    let outcome = sandbox.run("progressive build hills.ply -o half.lpm --ratio 0.5 --json").with_status(0);
    let report = &outcome.objects()[0];
    let base = report["base"]["faces"].as_u64().expect("a count");
    assert!(base * 2 <= sandbox.faces("hills.ply") && base * 5 > sandbox.faces("hills.ply") * 2, "{report}");
    assert!(
        report["bytes"]["total"].as_u64()
            == Some(fs::metadata(sandbox.path("half.lpm")).expect("it is there").len())
    );
    let outcome = sandbox.run("progressive extract half.lpm -o low.ply --faces 10").with_status(0);
    assert!(outcome.stderr.contains("target not reached, the base has"), "{}", outcome.stderr);
    sandbox.run("progressive extract half.lpm -o low.ply --faces 10 --strict").with_status(3);
}

#[test]
fn a_prefix_of_a_file_is_a_coarser_mesh_with_a_warning() {
    let (sandbox, bytes) = with_hills();
    fs::write(sandbox.path("cut.lpm"), &bytes[..bytes.len() - 20]).expect("the file can be written");
    let outcome = sandbox.run("progressive info cut.lpm --json").with_status(0);
    let report = &outcome.objects()[0];
    assert_eq!(report["complete"], false);
    assert!(report["warnings"][0].as_str().expect("a text").contains("incomplete"));
    let outcome = sandbox.run("progressive extract cut.lpm -o cut.ply").with_status(0);
    assert!(
        outcome.stderr.starts_with("warning: cut.lpm: ") && outcome.stderr.contains("incomplete"),
        "{}",
        outcome.stderr
    );
    sandbox.run("progressive extract cut.lpm -o cut.ply --strict").with_status(3);
    fs::write(sandbox.path("none.lpm"), &bytes[..60]).expect("the file can be written");
    let outcome = sandbox.run("progressive info none.lpm").with_status(1).with_one_error();
    assert!(outcome.stderr.contains("before the end of the base mesh"), "{}", outcome.stderr);
}

#[test]
fn bits_make_the_file_small_and_nearly_exact() {
    let (sandbox, bytes) = with_hills();
    let outcome = sandbox.run("progressive build hills.ply -o small.lpm --bits 16 --json").with_status(0);
    let report = &outcome.objects()[0];
    assert!(report["bytes"]["per_split"].as_f64().expect("a size") < 18.0, "{report}");
    assert!(report["output"]["bytes"].as_u64().expect("a size") * 4 < bytes.len() as u64 * 3);
    let outcome = sandbox.run("compare hills.ply small.lpm --json").with_status(0);
    let far = outcome.objects()[0]["relative_to_diagonal"]["hausdorff"].as_f64().expect("a share");
    assert!(far > 0.0 && far < 1e-4, "{far}");
    for wrong in ["--bits 5", "--bits 25", "--bits x"] {
        sandbox.run(&format!("progressive build hills.ply -o no.lpm {wrong}")).with_status(2);
    }
    let info = sandbox.run("progressive info small.lpm").with_status(0);
    assert!(
        info.text().contains("positions in 16 bits; ") && info.text().contains("; complete"),
        "{}",
        info.text()
    );
}

#[test]
fn materials_and_images_are_stored() {
    let sandbox = CliSandbox::new();
    sandbox.put("m.mtl", "newmtl red\nKd 1 0 0\nmap_Kd tex/a.png\nnewmtl blue\nmap_Kd gone.png\n");
    fs::create_dir(sandbox.path("tex")).expect("the file can be written");
    fs::write(
        sandbox.path("tex/a.png"),
        b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x02\x08\x02\0\0\0",
    )
    .expect("the file can be written");
    sandbox.put("hills.ply", &hills(12));
    let obj = sandbox.run("convert hills.ply - --to obj --quiet").with_status(0);
    let bare = obj.text().replacen("\nf ", "\nmtllib m.mtl\nusemtl red\nf ", 1);
    sandbox.put("hills.obj", &(bare + "usemtl blue\nf 1 2 40\n"));
    let outcome = sandbox.run("progressive build hills.obj -o hills.lpm").with_status(0);
    assert!(outcome.stderr.contains("texture gone.png was not found: left out"), "{}", outcome.stderr);
    fs::create_dir(sandbox.path("out")).expect("the file can be written");
    sandbox.run("progressive extract hills.lpm -o out/low.obj --ratio 0.5").with_status(0);
    assert_eq!(sandbox.names("out"), ["a.png", "low.mtl", "low.obj"]);
    let library = fs::read_to_string(sandbox.path("out/low.mtl")).expect("it was written");
    assert!(library.contains("map_Kd a.png") && library.contains("newmtl blue"), "{library}");
    let text = fs::read_to_string(sandbox.path("out/low.obj")).expect("it was written");
    assert!(text.contains("usemtl red"), "{text}");
    let outcome = sandbox.run("progressive build hills.obj -o bare.lpm --textures none").with_status(0);
    assert!(outcome.stderr.contains("images dropped"), "{}", outcome.stderr);
}

#[test]
fn invalid_commands_end_with_one_line() {
    let (sandbox, _) = with_hills();
    for (arguments, status, message) in [
        ("convert hills.ply out.lpm", 2, "write it with `lodsmith progressive build`"),
        ("progressive build hills.ply -o out.ply", 2, "the extension means PLY"),
        ("progressive build none.ply -o out.lpm", 1, "no such file"),
        ("progressive extract hills.ply -o out.ply", 1, "not an LPM file"),
        ("progressive extract none.lpm -o out.ply", 1, "no such file"),
        ("progressive extract hills.lpm -o -", 2, "--to"),
        ("progressive extract hills.lpm -o - --to ply --json", 2, "--json"),
    ] {
        let outcome = sandbox.run(arguments).with_status(status).with_one_error();
        assert!(outcome.stderr.contains(message), "{arguments}: {}", outcome.stderr);
    }
    assert!(!sandbox.path("out.lpm").exists());
}
