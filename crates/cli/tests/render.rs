//! `lodsmith render` and the images of other commands, from end to end.

use lodsmith::core::Image;
use lodsmith_render::decode;

use crate::sandbox::{CliSandbox, coloured_cube, hills, keys};

fn picture(sandbox: &CliSandbox, name: &str) -> Image {
    decode(&std::fs::read(sandbox.path(name)).expect("it was written")).expect("it is a picture")
}

fn colours(picture: &Image) -> usize {
    picture.pixels().iter().collect::<std::collections::HashSet<_>>().len()
}

#[test]
fn a_file_is_rendered() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox.run("render hills.ply -o out.png --size 320x200").with_status(0);
    assert!(outcome.text().starts_with("out.png: 320 × 200 pixels, 800 faces, "), "{}", outcome.text());
    let seen = picture(&sandbox, "out.png");
    assert_eq!((seen.width(), seen.height()), (320, 200));
    assert!(colours(&seen) > 200, "{} colours", colours(&seen));
    assert_eq!(sandbox.names("."), ["hills.ply", "out.png"], "nothing else is left behind");
    assert_eq!(sandbox.run("render hills.ply -o out.png --quiet").with_status(0).text(), "");
}

#[test]
fn the_same_bytes_with_any_number_of_threads_and_options_change_them() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let draw = |options: &str| {
        sandbox.run(&format!("render cube.ply -o out.png --size 160x120 -q {options}")).with_status(0);
        std::fs::read(sandbox.path("out.png")).expect("it was written")
    };
    let usual = draw("--threads 1");
    assert_eq!(usual, draw("--threads 3"));
    assert_eq!(usual, draw("--shading vertex-colors"), "colours are shown where there are any");
    let mut all = vec![usual];
    for options in [
        "--shading smooth",
        "--shading flat --wireframe",
        "--shading normals",
        "--shading matcap",
        "--view front",
        "--azimuth 200",
        "--up z",
        "--parallel",
        "--background #ff8800",
        "--background transparent",
        "--light sun:1,0,0=0.5",
        "--grid --shadow",
        "--occlusion --fine",
    ] {
        let bytes = draw(options);
        assert!(!all.contains(&bytes), "{options} changes nothing");
        all.push(bytes);
    }
}

#[test]
fn a_background_may_be_transparent() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    sandbox.run("render cube.ply -o out.webp --size 100x100 --background transparent").with_status(0);
    let seen = picture(&sandbox, "out.webp");
    assert_eq!([seen.at(0, 0)[3], seen.at(50, 50)[3]], [0, 255]);
    let outcome = sandbox.run("render cube.ply -o - --size 40x30").with_status(0);
    assert_eq!(decode(&outcome.stdout).map(|p| p.width()).expect("a picture on standard output"), 40);
}

#[test]
fn levels_are_rendered_on_one_sheet() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(20));
    let outcome = sandbox
        .run("render hills.ply -o sheet.png --levels 400,200,50 --size 100x90 --wireframe --json")
        .with_status(0);
    let report = outcome.objects().remove(0);
    assert_eq!(keys(&report), ["output", "pictures", "heat_range", "threads", "seconds", "warnings"],);
    let pictures = report["pictures"].as_array().expect("a list");
    assert_eq!(pictures.len(), 4);
    assert_eq!(pictures[0]["faces"], 800);
    assert!(pictures[0]["largest_distance"].is_null());
    for (row, count) in pictures[1..].iter().zip([400, 200, 50]) {
        assert_eq!(row["level"], count);
        assert!(row["faces"].as_u64().is_some_and(|n| n <= count && n + 10 >= count), "{row}");
        assert!(row["largest_distance"].as_f64().is_some_and(|d| d > 0.0 && d < 0.2), "{row}");
    }
    let seen = picture(&sandbox, "sheet.png");
    assert_eq!(report["output"]["width"], seen.width());
    assert!(seen.width() > 400 && seen.height() > 120, "{seen:?}");
}

#[test]
fn materials_reflect_the_environment() {
    let sandbox = CliSandbox::new();
    std::fs::write(sandbox.path("squares.glb"), two_squares(2)).expect("a file");
    let draw = |options: &str| {
        sandbox.run(&format!("render squares.glb -o out.png --size 60x40 -q {options}")).with_status(0);
        picture(&sandbox, "out.png")
    };
    let plain = draw("");
    assert_eq!(plain, draw("--environment none"));
    let studio = draw("--environment studio");
    assert_ne!(plain, studio);
    // An environment may be an image file; an invalid file is an error.
    sandbox.run("render squares.glb -o sky.png --size 64x32 -q").with_status(0);
    let sky = draw("--environment sky.png");
    assert!(sky != plain && sky != studio);
    let error = sandbox
        .run("render squares.glb -o out.png --environment squares.glb")
        .with_status(1)
        .with_one_error();
    assert!(error.stderr.contains("squares.glb"), "{}", error.stderr);
    let error =
        sandbox.run("render squares.glb -o out.png --environment no.hdr").with_status(1).with_one_error();
    assert!(error.stderr.contains("no.hdr"), "{}", error.stderr);
}

/// A GLB with two squares of `n` by `n` cells, each a mesh with a material: a red one, and a green one twice as large.
fn two_squares(n: u32) -> Vec<u8> {
    let places = (0..=n).flat_map(|y| (0..=n).map(move |x| [x, y].map(|i| i as f32 / n as f32)));
    let mut bin: Vec<u8> = places.flat_map(|[x, y]| [x, y, 0.0]).flat_map(f32::to_le_bytes).collect();
    let faces_at = bin.len();
    let corner = |x: u32, y: u32| y * (n + 1) + x;
    let faces = (0..n).flat_map(|y| (0..n).map(move |x| [x, y])).flat_map(|[x, y]| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [a, b, c, a, c, d]
    });
    bin.extend(faces.flat_map(u32::to_le_bytes));
    let mesh = |material: u32| serde_json::json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": material }] });
    let material = |color: [f32; 4]| {
        let plain =
            serde_json::json!({ "baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 1 });
        serde_json::json!({ "pbrMetallicRoughness": plain, "doubleSided": true })
    };
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bin.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": faces_at },
            { "buffer": 0, "byteOffset": faces_at, "byteLength": bin.len() - faces_at },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": (n + 1) * (n + 1), "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5125, "count": 6 * n * n, "type": "SCALAR" },
        ],
        "materials": [material([1.0, 0.0, 0.0, 1.0]), material([0.0, 1.0, 0.0, 1.0])],
        "meshes": [mesh(0), mesh(1)],
        "nodes": [{ "mesh": 0 }, { "mesh": 1, "translation": [1.5, 0, 0], "scale": [2, 2, 2] }],
        "scenes": [{ "nodes": [0, 1] }],
        "scene": 0,
    });
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + bin.len();
    for part in [2, total, json.len(), 0x4E4F_534A] {
        file.extend((part as u32).to_le_bytes());
    }
    file.extend(json);
    file.extend((bin.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bin);
    file
}

#[test]
fn levels_of_a_scene_keep_its_materials_and_places() {
    let sandbox = CliSandbox::new();
    std::fs::write(sandbox.path("squares.glb"), two_squares(8)).expect("a file");
    let outcome = sandbox
        .run("render squares.glb -o sheet.png --levels 40 --size 120x90 --view front --columns 1 --no-captions --json")
        .with_status(0);
    let report = outcome.objects().remove(0);
    for row in report["pictures"].as_array().expect("a list") {
        assert_eq!(row["shading"], "textured", "{row}");
    }
    assert_eq!(report["pictures"][0]["faces"], 256);
    assert!(report["pictures"][1]["faces"].as_u64().is_some_and(|n| (4..=40).contains(&n)), "{report}");
    let seen = picture(&sandbox, "sheet.png");
    let is = |rows: std::ops::Range<usize>, k: usize| {
        let all = rows.flat_map(|y| (0..seen.width()).map(move |x| (x, y)));
        all.filter(|&(x, y)| {
            let p = seen.at(x, y);
            p[k] > 120 && p[1 - k] < 90
        })
        .count()
    };
    let half = seen.height() / 2;
    for rows in [0..half, half..seen.height()] {
        let (red, green) = (is(rows.clone(), 0), is(rows.clone(), 1));
        assert!(red > 400 && green > 3 * red && green < 5 * red, "{rows:?}: {red} red, {green} green");
    }
    // Flat squares lose nothing; rounding errors are not shown.
    let largest = report["pictures"][1]["largest_distance"].as_f64().expect("a number");
    assert!(largest < 1e-6, "{largest}");
    sandbox.run("render squares.glb -o heat.png --levels 40 --shading heat --size 60x60").with_status(0);
}

#[test]
fn heat_needs_a_reference() {
    let sandbox = CliSandbox::new();
    sandbox.put("full.ply", &hills(20));
    // The vertices of the two meshes do not coincide: 20 is not a multiple of 6.
    sandbox.put("low.ply", &hills(6));
    let error = sandbox.run("render low.ply -o out.png --shading heat").with_status(2).with_one_error();
    assert!(error.stderr.contains("--compare"), "{}", error.stderr);
    let outcome = sandbox
        .run("render low.ply -o out.png --shading heat --compare full.ply --size 200x150 --json")
        .with_status(0);
    let report = outcome.objects().remove(0);
    let high = report["heat_range"][1].as_f64().expect("a number");
    assert!(high > 0.0 && high < 0.1, "{report}");
    assert_eq!(report["pictures"].as_array().map(Vec::len), Some(2));
    let other = sandbox.run("render low.ply -o out.png --shading heat --compare full.ply --range 0,2 --json");
    assert_eq!(other.objects()[0]["heat_range"], serde_json::json!([0.0, 2.0]));
}

#[test]
fn invalid_commands_name_the_reason() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    sandbox.put("no.png", "no picture");
    sandbox.put("broken.ply", "ply\nnothing");
    for (arguments, status, part) in [
        ("render cube.ply -o out.gif", 2, ".png, .jpg or .webp"),
        ("render cube.ply -o .", 2, "folder"),
        ("render cube.ply -o out.png --matcap no.png --shading matcap", 1, "no.png"),
        ("render broken.ply -o out.png", 1, "broken.ply"),
        ("render none.ply -o out.png", 1, "none.ply"),
        ("render cube.ply -o none/out.png", 1, "none/out.png"),
        ("render cube.ply -o - --json", 2, "standard output"),
    ] {
        let outcome = sandbox.run(arguments).with_status(status).with_one_error();
        assert!(outcome.stderr.contains(part), "{arguments}: {}", outcome.stderr);
    }
    for arguments in
        ["--size 0x5", "--background red", "--light moon:1,2,3", "--levels 0", "--range 2,1", "--fov 0"]
    {
        let outcome = sandbox.run(&format!("render cube.ply -o out.png {arguments}")).with_status(2);
        assert!(outcome.stderr.starts_with("error: "), "{arguments}: {}", outcome.stderr);
    }
    assert!(!sandbox.path("out.png").exists(), "no picture is left behind");
}

#[test]
fn methods_and_compare_render_images() {
    let sandbox = CliSandbox::new();
    sandbox.put("full.ply", &hills(20));
    // The vertices of the two meshes do not coincide: 20 is not a multiple of 6.
    sandbox.put("low.ply", &hills(6));
    let methods = "--method memoryless --method quadric --samples 1000";
    sandbox.run(&format!("methods full.ply --faces 100 {methods} --sheet sheet.png")).with_status(0);
    let sheet = picture(&sandbox, "sheet.png");
    assert!(sheet.width() > 900 && colours(&sheet) > 200, "{sheet:?}");
    let error =
        sandbox.run(&format!("methods full.ply --faces 100 {methods} --sheet sheet.doc")).with_status(2);
    assert!(error.stderr.contains("sheet.doc"), "{}", error.stderr);
    let outcome = sandbox.run("compare full.ply low.ply --samples 1000 --heatmap map.png").with_status(0);
    assert!(outcome.text().contains("map.png: blue 0, red "), "{}", outcome.text());
    assert!(colours(&picture(&sandbox, "map.png")) > 200);
}

#[test]
fn a_time_of_an_animation_is_rendered_and_invalid_times_are_refused() {
    let sandbox = CliSandbox::new();
    let arm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/arm.glb");
    std::fs::copy(arm, sandbox.path("arm.glb")).expect("it is there");
    sandbox.put("hills.ply", &hills(4));
    sandbox.run("simplify arm.glb --ratio 0.25 -o low.glb").with_status(0);
    let draw = |options: &str| {
        sandbox.run(&format!("render arm.glb low.glb -o out.png --size 160x120 -q {options}")).with_status(0);
        std::fs::read(sandbox.path("out.png")).expect("it was written")
    };
    let first = draw("--time 0 --no-captions");
    assert_eq!(first, draw("--clip Bend --no-captions"), "the first animation, from its start");
    let mut all = vec![first];
    for options in ["--time 0.5", "--time 1", "--clip 2 --time 0.5", "--clip Bulge --time 0.25"] {
        let bytes = draw(&format!("{options} --no-captions"));
        assert!(!all.contains(&bytes), "{options} changes nothing");
        all.push(bytes);
    }
    let outcome =
        sandbox.run("render low.glb -o out.png --size 160x120 --clip Bulge --time 0.5 --json").with_status(0);
    let pictures = &outcome.objects()[0]["pictures"];
    assert_eq!((&pictures[0]["clip"], &pictures[0]["time"]), (&"Bulge".into(), &0.5.into()));
    for (arguments, part) in [
        ("render hills.ply -o out.png --time 1", "hills.ply: has no animation"),
        (
            "render arm.glb -o out.png --clip Walk",
            "has no animation \"Walk\"; the animations are 1 \"Bend\", 2 \"Bulge\"",
        ),
        ("render arm.glb -o out.png --clip 2 --time 1.5", "animation \"Bulge\" ends at 1.0 s"),
        ("render arm.glb -o out.png --time -1", "it must not be below 0"),
        ("render arm.glb -o out.png --time 1 --levels 100", "--time and --clip pose a scene"),
    ] {
        let outcome = sandbox.run(arguments).with_status(2);
        assert!(outcome.stderr.contains(part), "{arguments}: {}", outcome.stderr);
    }
}

/// Fault D15: the reference had the colour of distance 0 everywhere and no shading.
#[test]
fn both_sides_of_a_heat_map_are_shaded() {
    let sandbox = CliSandbox::new();
    sandbox.put("full.ply", &hills(20));
    sandbox.put("low.ply", &hills(6));
    let draw = |inputs: &str| {
        let outcome = sandbox
            .run(&format!(
                "render {inputs} -o out.png --shading heat --compare full.ply --size 120x90 --no-captions --json"
            ))
            .with_status(0);
        (picture(&sandbox, "out.png"), outcome.objects().remove(0))
    };
    let colours_of = |seen: &Image, columns: std::ops::Range<usize>| {
        let all = (0..100).flat_map(|y| columns.clone().map(move |x| (x, y)));
        all.map(|(x, y)| seen.at(x, y)).collect::<std::collections::HashSet<_>>().len()
    };
    let (seen, report) = draw("low.ply");
    assert!(report["pictures"][0]["largest_distance"].as_f64().is_some_and(|d| d > 0.0), "{report}");
    for columns in [12..132, 144..264] {
        assert!(
            colours_of(&seen, columns.clone()) > 200,
            "{columns:?}: {}",
            colours_of(&seen, columns.clone())
        );
    }
    // Equal meshes have no distance, but they are shaded nevertheless.
    let (seen, _) = draw("full.ply");
    assert!(colours_of(&seen, 12..132) > 100, "{}", colours_of(&seen, 12..132));
    // With several candidates, the reference has no heat map.
    let (_, report) = draw("low.ply full.ply");
    let shadings: Vec<_> =
        report["pictures"].as_array().expect("a list").iter().map(|p| p["shading"].clone()).collect();
    assert_eq!(shadings, ["smooth", "heat", "heat"]);
}

/// Returns the number of frames of an animated PNG, from its chunks; 0 for a still image.
fn frames(file: &[u8]) -> usize {
    file.windows(4).filter(|w| w == b"fcTL").count()
}

#[test]
fn a_turntable_is_an_animation_or_a_folder_of_images() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let turn = "--turntable 8 --size 80x60 --background transparent";
    let outcome = sandbox.run(&format!("render cube.ply -o turn.png {turn} --json")).with_status(0);
    assert_eq!(
        outcome.objects()[0]["output"],
        serde_json::json!({ "path": "turn.png", "format": "apng", "width": 80, "height": 60, "frames": 8 })
    );
    let bytes = std::fs::read(sandbox.path("turn.png")).expect("it was written");
    assert_eq!(frames(&bytes), 8);
    let first = picture(&sandbox, "turn.png");
    assert_eq!([first.at(0, 0)[3], first.at(40, 30)[3]], [0, 255]);
    let outcome = sandbox.run(&format!("render cube.ply -O turn {turn}")).with_status(0);
    assert!(outcome.text().starts_with("turn: 8 images: 80 × 60 pixels, "), "{}", outcome.text());
    let names: Vec<String> = (0..8).map(|i| format!("cube_{i}.png")).collect();
    assert_eq!(sandbox.names("turn"), names);
    assert_eq!(picture(&sandbox, "turn/cube_0.png"), first);
    let all: Vec<Image> = names.iter().map(|n| picture(&sandbox, &format!("turn/{n}"))).collect();
    for (i, a) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|b| a != b), "frame {i} is not new");
        assert_eq!([a.at(0, 0)[3], a.at(40, 30)[3]], [0, 255], "frame {i}");
    }
    let numbered = "-O other --name {frame}.jpg";
    sandbox.run(&format!("render cube.ply {numbered} --turntable 11 --size 40x30 -q")).with_status(0);
    assert_eq!(sandbox.names("other").len(), 11);
    assert!(sandbox.path("other/00.jpg").exists() && sandbox.path("other/10.jpg").exists());
    // Contact sheets can be turntables too, and the bytes do not depend on threads.
    let sheet = |options: &str| {
        let arguments =
            format!("render cube.ply -o - --levels 4 --turntable 3 --size 40x30 --fps 5 {options}");
        sandbox.run(&arguments).with_status(0).stdout
    };
    assert_eq!(frames(&sheet("")), 3);
    assert!(sheet("--threads 1") == sheet("--threads 3"));
}

#[test]
fn invalid_turntables_are_refused() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    for (arguments, part) in [
        ("-o turn.jpg --turntable 8", "a turntable is written as an animated .png"),
        ("-o turn.webp --turntable 8", "with --out-dir as one image for each frame"),
        ("-o turn.png --turntable 1", "2"),
        ("-O turn --turntable 8 --name cube.png", "{frame} is missing"),
        ("-O turn --turntable 8 --name {frame}.gif", "the name must end in .png, .jpg or .webp"),
        ("-O turn --turntable 8 --name ../{frame}.png", "only a file name is allowed"),
        ("-O turn --turntable 8 --name {ext}{frame}.png", "only {stem} and {frame} are known"),
        ("-O cube.ply --turntable 8", "is not a folder"),
        ("-O turn", "--turntable"),
        ("-o turn.png --fps 5", "--turntable"),
    ] {
        let outcome = sandbox.run(&format!("render cube.ply {arguments}")).with_status(2);
        assert!(outcome.stderr.contains(part), "{arguments}: {}", outcome.stderr);
    }
    assert_eq!(sandbox.names("."), ["cube.ply"], "nothing is left behind");
}
