//! `lodsmith bake` from end to end.

use std::fmt::Write as _;
use std::fs;

use lodsmith_io::{ReadOptions, read_model_path};

use crate::sandbox::{CliSandbox, hills, ply};

/// Colour of the coloured hills at a position: a gradient.
fn color(x: f64, y: f64) -> [u8; 3] {
    [x, y, 0.5].map(|c| (255.0 * c).round() as u8)
}

/// Hills of `2 n²` triangles with the colours of [`color`].
fn coloured_hills(n: usize) -> String {
    let (mut vertices, mut faces) = (String::new(), String::new());
    for i in 0..(n + 1) * (n + 1) {
        let (u, v) = ((i % (n + 1)) as f64 / n as f64, (i / (n + 1)) as f64 / n as f64);
        let [r, g, b] = color(u, v);
        writeln!(vertices, "{u} {v} {} {r} {g} {b}", 0.1 * (9.0 * u).sin() * (7.0 * v).cos()).expect("text");
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            writeln!(faces, "3 {a} {b} {d}\n3 {a} {d} {c}").expect("text");
        }
    }
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    ply(colours, (n + 1) * (n + 1), 2 * n * n, &vertices, &faces)
}

#[test]
fn a_mesh_without_coordinates_gets_an_atlas_and_a_material() {
    let sandbox = CliSandbox::new();
    sandbox.put("high.ply", &coloured_hills(48));
    sandbox.put("low.ply", &hills(8));
    let arguments = "bake high.ply low.ply -o out.glb --maps normal,color,height --texture-size 256 --json";
    let report = sandbox.run(arguments).with_status(0).objects().remove(0);
    assert_eq!(report["baked"]["sets"][0]["size"], 256);
    assert_eq!(report["baked"]["sources"]["elsewhere"], 0, "{report}");
    let height = report["baked"]["sets"][0]["ranges"]["height"].as_f64().expect("white has a height");
    assert!(height > 0.001 && height < 0.2, "hills of 0.1: {height}");
    assert_eq!(sandbox.names("."), ["high.ply", "low.ply", "out.glb", "out_height.png"]);

    let file = read_model_path(&sandbox.path("out.glb"), &ReadOptions::default()).unwrap();
    let mesh = &file.model.meshes[0];
    let material = &file.model.materials[mesh.materials[0].expect("it has a material")];
    assert_eq!((material.base_color, mesh.mesh.face_count()), ([1.0; 4], 128));
    assert!(mesh.mesh.colors().is_none(), "they would count twice");
    assert!(mesh.mesh.further_attributes().iter().any(|a| a.semantic == lodsmith::core::Semantic::Tangent));
    assert!(material.normal_texture.is_some());
    let texture = material.base_color_texture.expect("it is baked");
    let image = &file.model.images[texture.image];
    assert_eq!((image.width(), image.height()), (256, 256));
    // The baked colours at the vertices agree with the gradient.
    let uvs = mesh.mesh.uvs().expect("it has an atlas");
    for (w, uv) in uvs.iter().enumerate() {
        let vertex = mesh.mesh.vertex_of(lodsmith::core::WedgeId::new(w));
        let [x, y, _] = mesh.mesh.positions().view().get(vertex);
        let at = |t: f32| ((t * 256.0) as usize).min(255);
        let found = image.at(at(uv[0]), at(1.0 - uv[1]));
        let expected = color(x, y);
        assert!((0..3).all(|k| found[k].abs_diff(expected[k]) <= 6), "{found:?} for {expected:?}");
    }
    let height = fs::read(sandbox.path("out_height.png")).unwrap();
    assert_eq!((&height[1..4], height[24], height[25]), (&b"PNG"[..], 16, 0), "16 bits, grey");
}

#[test]
fn occlusion_and_roughness_share_a_texture() {
    let sandbox = CliSandbox::new();
    sandbox.put("high.ply", &coloured_hills(32));
    sandbox.put("low.ply", &hills(4));
    let arguments =
        "bake high.ply low.ply -o out.glb --maps ao,metallic-roughness --texture-size 64 --ao-rays 16";
    sandbox.run(arguments).with_status(0);
    let file = read_model_path(&sandbox.path("out.glb"), &ReadOptions::default()).unwrap();
    let material = &file.model.materials[0];
    let texture = material.occlusion_texture.expect("it is baked");
    assert_eq!(material.metallic_roughness_texture.map(|t| t.image), Some(texture.image));
    assert_eq!(file.model.images.len(), 1);
    let red = file.model.images[texture.image].pixels().iter().map(|p| p[0]);
    let (darkest, lightest) = red.fold((255, 0), |(low, high), r| (r.min(low), r.max(high)));
    assert!(darkest < 230 && lightest == 255, "the valleys are darker: {darkest} to {lightest}");
}

#[test]
fn coordinates_without_overlap_are_kept_and_an_obj_gets_its_library() {
    let sandbox = CliSandbox::new();
    sandbox.put("high.ply", &coloured_hills(32));
    // A square with its own coordinates.
    sandbox.put(
        "low.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9\nf 1/1 2/2 3/3 4/4\n",
    );
    let arguments =
        "bake high.ply low.obj -o out.obj --maps color,ao --texture-size 64 --ao-rays 4 --map-files";
    let outcome = sandbox.run(arguments).with_status(0);
    assert!(!outcome.stderr.contains("atlas"), "{}", outcome.stderr);
    let obj = fs::read_to_string(sandbox.path("out.obj")).unwrap();
    assert!(obj.contains("vt 0.1 0.1") && obj.contains("mtllib"), "{obj}");
    let library = fs::read_to_string(sandbox.path("out.mtl")).unwrap();
    assert!(library.contains("map_Kd"), "{library}");
    assert!(sandbox.path("out_color.png").exists() && sandbox.path("out_ao.png").exists());
    // If coordinates overlap, a new atlas is made, with a warning.
    sandbox.put(
        "low.obj",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1/1 3/2 4/3\n",
    );
    let outcome =
        sandbox.run("bake high.ply low.obj -o two.glb --maps color --texture-size 64").with_status(0);
    assert!(
        outcome.stderr.contains("a new atlas") && outcome.stderr.contains("overlap"),
        "{}",
        outcome.stderr
    );
}

/// Returns the material of each mesh and whether it has tangents.
fn materials(sandbox: &CliSandbox, name: &str) -> (Vec<(Option<usize>, bool)>, usize) {
    let scene = lodsmith_io::read_scene_path(&sandbox.path(name), &ReadOptions::default()).unwrap().unwrap();
    let model = lodsmith_io::ModelFile::from(scene).model;
    let tangents = |m: &lodsmith::core::model::ModelMesh| {
        m.mesh.further_attributes().iter().any(|a| a.semantic == lodsmith::core::Semantic::Tangent)
    };
    (model.meshes.iter().map(|m| (m.materials[0], tangents(m))).collect(), model.images.len())
}

#[test]
fn levels_share_the_maps_of_the_finest_or_have_their_own() {
    let sandbox = CliSandbox::new();
    let wave = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/wave.glb");
    fs::copy(wave, sandbox.path("wave.glb")).unwrap();
    let arguments = "lod wave.glb --levels 0.5,0.2 --bake normal --texture-size 64";
    sandbox.run(&format!("{arguments} -o keep.glb")).with_status(0);
    let first = Some(0);
    assert_eq!(materials(&sandbox, "keep.glb"), (vec![(None, false), (first, true), (first, true)], 1));
    sandbox.run(&format!("{arguments} -o new.glb --atlas new")).with_status(0);
    assert_eq!(materials(&sandbox, "new.glb"), (vec![(None, false), (first, true), (Some(1), true)], 2));
}

/// Puts wave.glb into a sandbox, and returns the JSON of it as a glTF file.
fn wave_json(sandbox: &CliSandbox) -> serde_json::Value {
    let wave = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/wave.glb");
    fs::copy(wave, sandbox.path("wave.glb")).unwrap();
    sandbox.run("convert wave.glb wave.gltf").with_status(0);
    serde_json::from_str(&fs::read_to_string(sandbox.path("wave.gltf")).unwrap()).unwrap()
}

#[test]
fn what_a_new_atlas_drops_counts_as_lost() {
    let sandbox = CliSandbox::new();
    let mut json = wave_json(&sandbox);
    json["extensionsUsed"] = serde_json::json!(["KHR_materials_clearcoat"]);
    json["materials"] =
        serde_json::json!([{"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}}]);
    json["meshes"][0]["primitives"][0]["material"] = 0.into();
    sandbox.put("coated.gltf", &json.to_string());
    let arguments =
        "simplify coated.gltf -o out.glb --ratio 0.5 --bake normal --texture-size 32 --strict --force";
    sandbox.run(arguments).with_status(0);
    let outcome = sandbox.run(&format!("{arguments} --atlas new")).with_status(3);
    assert!(outcome.stderr.contains("KHR_materials_clearcoat"), "{}", outcome.stderr);
}

#[test]
fn a_run_bakes_what_it_loses_and_nothing_counts_as_lost() {
    let sandbox = CliSandbox::new();
    sandbox.put("high.ply", &coloured_hills(24));
    let arguments = "simplify high.ply --ratio 10% --bake normal,color,height --texture-size 64 --json";
    let outcome = sandbox.run(&format!("{arguments} -o out.glb")).with_status(0);
    assert!(!outcome.stderr.contains("COLOR_0"), "they are in the map: {}", outcome.stderr);
    let report = outcome.objects().remove(0);
    assert_eq!(report["baked"]["sets"][0]["maps"].as_array().unwrap().len(), 3);
    assert!(sandbox.path("out_height.png").exists());
    let before = fs::read(sandbox.path("out.glb")).unwrap();
    sandbox.run(&format!("{arguments} -o out.glb --threads 1")).with_status(0);
    assert_eq!(fs::read(sandbox.path("out.glb")).unwrap(), before, "at any number of threads");
    sandbox
        .run("simplify high.ply --ratio 10% --bake color --texture-size 64 --strict -o out.obj")
        .with_status(0);
    assert!(fs::read_to_string(sandbox.path("out.mtl")).unwrap().contains("map_Kd"));
    sandbox.run("simplify high.ply --ratio 10% --texture-size 64 -o b.glb").with_status(2).with_one_error();
    sandbox.run("simplify high.ply --ratio 10% --bake color --up z -o b.glb").with_status(2).with_one_error();
}

/// The maps would be white without a word.
#[test]
fn an_image_that_is_not_read_is_lost_in_maps() {
    let sandbox = CliSandbox::new();
    let mut json = wave_json(&sandbox);
    json["images"] = serde_json::json!([{"uri": "data:image/ktx2;base64,q0tUWCAyMLsNChoK"}]);
    json["textures"] = serde_json::json!([{"source": 0}]);
    json["materials"] = serde_json::json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    json["meshes"][0]["primitives"][0]["material"] = 0.into();
    sandbox.put("unread.gltf", &json.to_string());
    let options = "--atlas new --texture-size 32 --strict --force";
    for command in [
        "simplify unread.gltf --ratio 0.5 --bake color -o out.glb",
        "lod unread.gltf --count 2 --bake color -o out.glb",
        "bake unread.gltf wave.glb --maps color -o out.glb",
    ] {
        let outcome = sandbox.run(&format!("{command} {options}")).with_status(3);
        let said = "image 0 is a KTX2 image, which is not supported";
        assert!(outcome.stderr.contains(said), "{command}: {}", outcome.stderr);
    }
}

/// A map of a model at rest loses nothing by an animation that is not shown.
#[test]
fn an_animation_that_is_not_read_is_not_lost_in_maps() {
    let sandbox = CliSandbox::new();
    let mut json = wave_json(&sandbox);
    json["animations"] = serde_json::json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
        "samplers": [{"input": 0, "output": 0}],
    }]);
    sandbox.put("moved.gltf", &json.to_string());
    assert!(sandbox.run("render moved.gltf -o out.png").with_status(0).stderr.contains("animation channels"));
    for command in [
        "simplify moved.gltf --ratio 0.5 --bake normal -o out.glb",
        "lod moved.gltf --levels 0.5 --bake normal -o out.glb",
        "bake moved.gltf wave.glb --maps normal -o out.glb",
    ] {
        sandbox.run(&format!("{command} --atlas new --texture-size 32 --strict --force")).with_status(0);
    }
}

#[test]
fn errors_are_one_line() {
    let sandbox = CliSandbox::new();
    sandbox.put("a.ply", &hills(3));
    for (arguments, status, hint) in [
        ("bake a.ply a.ply -o -", 2, "--to"),
        ("bake a.ply a.ply -o - --to glb --maps height", 2, "height"),
        ("bake a.ply a.ply -o b.glb --texture-size 1024 --max-memory 64M", 1, "baking would take about"),
        ("bake a.ply none.ply -o b.glb", 1, "none.ply"),
        ("bake a.ply a.ply -o a.ply", 2, "--force"),
        ("bake a.ply a.ply -o b.glb --up z", 2, "convert"),
    ] {
        let outcome = sandbox.run(arguments).with_status(status).with_one_error();
        assert!(outcome.stderr.contains(hint), "{arguments}: {}", outcome.stderr);
    }
    // These errors are found before anything is read.
    for (arguments, hint) in [
        ("bake a.ply none.ply -o b.glb --texture-size 4", "from 16 to 16384"),
        ("bake a.ply none.ply -o b.glb --texture-size 20000", "--texture-size"),
        ("simplify a.ply -o b.glb --ratio 0.5 --bake ao --ao-rays 10000000000000", "from 1 to 65536"),
    ] {
        let outcome = sandbox.run(arguments).with_status(2);
        assert!(outcome.stderr.contains(hint), "{arguments}: {}", outcome.stderr);
    }
    assert_eq!(sandbox.names("."), ["a.ply"]);
}
