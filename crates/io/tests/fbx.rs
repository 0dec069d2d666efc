//! FBX: what is read of `testdata/arm.fbx`, an arm of two bones with a shape, an animation and an embedded texture.

use std::path::PathBuf;

use lodsmith_core::model::Track;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{
    Format, Limits, ModelFile, ReadOptions, read_bytes, read_model_path, read_path, read_scene_path,
};

fn arm() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/arm.fbx")
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|k| (a[k] - b[k]).abs() < 1e-5)
}

#[test]
fn a_file_is_read_as_one_mesh_in_metres_and_y_up() {
    let loaded = read_path(&arm(), &ReadOptions::default()).unwrap();
    assert_eq!((loaded.format, loaded.mesh.face_count(), loaded.mesh.vertex_count()), (Format::Fbx, 12, 14));
    let bounds = loaded.mesh.positions().view().bounds().unwrap();
    // 60 by 10 cm in the plane of x and y of a file with z up, 100 cm above the ground.
    assert!(near(bounds.min, [0.0, 1.0, -0.1]) && near(bounds.max, [0.6, 1.0, 0.0]), "{bounds:?}");
    let counts = [loaded.contents.materials, loaded.contents.textures, loaded.contents.skins];
    assert_eq!(counts, [1, 1, 1]);
    assert_eq!([loaded.contents.animations, loaded.contents.morph_targets], [1, 1]);
    let material = loaded.regions.materials().next().unwrap();
    assert_eq!(material, b"paint");
}

#[test]
fn skins_shapes_and_animations_come_along() {
    let scene = read_scene_path(&arm(), &ReadOptions::default()).unwrap().unwrap();
    assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
    assert!(scene.meshes()[0].skinned);
    let mut glb = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut glb).unwrap();
    let (model, warnings) = Scene::read(&glb, &ReadOptions::default()).unwrap().model();
    assert_eq!(warnings, []);
    assert_eq!((model.images.len(), model.images[0].at(0, 0)), (1, [200, 30, 30, 255]));
    assert_eq!(model.materials[0].emissive.map(|x| (x * 10.0).round()), [1.0, 0.0, 0.0]);
    let animation = &model.animations[0];
    assert_eq!(&*animation.name, "bend");
    let channel = |is: fn(&Track) -> bool| animation.channels.iter().find(|c| is(&c.track)).unwrap();
    let rotation = channel(|t| matches!(t, Track::Rotation(_)));
    assert_eq!((rotation.times[0], *rotation.times.last().unwrap()), (0.0, 1.0));
    let Track::Rotation(turns) = &rotation.track else { unreachable!() };
    // A quarter turn about z at half time.
    let middle = rotation.times.iter().position(|&t| (t - 0.5).abs() < 1e-3).unwrap();
    assert!((turns[middle][3] - std::f32::consts::FRAC_1_SQRT_2).abs() < 1e-3, "{:?}", turns[middle]);
    let weights = channel(|t| matches!(t, Track::MorphWeights(_)));
    let Track::MorphWeights(values) = &weights.track else { unreachable!() };
    assert_eq!((values[0], *values.last().unwrap()), (0.0, 1.0));
}

#[test]
fn a_model_is_the_same_as_its_glb() {
    let direct: ModelFile = read_model_path(&arm(), &ReadOptions::default()).unwrap();
    let scene = read_scene_path(&arm(), &ReadOptions::default()).unwrap().unwrap();
    let mut glb = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut glb).unwrap();
    let (again, _) = Scene::read(&glb, &ReadOptions::default()).unwrap().model();
    assert_eq!(direct.model.nodes.len(), again.nodes.len());
    assert_eq!(direct.model.meshes[0].mesh, again.meshes[0].mesh);
}

#[test]
fn damaged_files_are_errors() {
    let bytes = std::fs::read(arm()).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    for (what, damaged) in [
        ("cut", text[..text.len() / 3].to_owned()),
        ("index", text.replace("a: 0,2,3,-2", "a: 0,2,99,-2")),
        ("number", text.replace("Vertices: *42", "Vertices: *41")),
    ] {
        // An error or what is left; never a panic.
        let _ = read_bytes(damaged.as_bytes(), &ReadOptions::default()).map_err(|e| format!("{what}: {e}"));
    }
    let nothing = read_bytes(b"; FBX 7.5.0 project file\n", &ReadOptions::default()).unwrap_err();
    assert!(!nothing.to_string().contains('\n'), "{nothing}");
}

#[test]
fn a_limit_on_memory_holds() {
    let mut options = ReadOptions::default();
    let mut limits = Limits::default();
    limits.memory = 16 << 10;
    options.limits = limits;
    let error = read_bytes(&std::fs::read(arm()).unwrap(), &options).unwrap_err().to_string();
    assert!(error.contains("memory"), "{error}");
}

/// Returns a record of a binary FBX file that begins at `start`: name, properties (number and bytes) and records in it.
fn record(
    start: usize,
    name: &str,
    (count, properties): (u32, &[u8]),
    inner: impl FnOnce(usize) -> Vec<u8>,
) -> Vec<u8> {
    let inner = inner(start + 13 + name.len() + properties.len());
    let end = start + 13 + name.len() + properties.len() + inner.len();
    let numbers = [end as u32, count, properties.len() as u32];
    let mut record: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    record.push(name.len() as u8);
    record.extend([name.as_bytes(), properties, &inner].concat());
    record
}

#[test]
fn an_array_that_claims_more_than_the_file_can_hold_is_refused() {
    // (Found by fuzzing: 16.9 GB were reserved for a file of 17 kB.)
    let mut file = b"Kaydara FBX Binary  \0\x1a\0".to_vec();
    file.extend(7400u32.to_le_bytes());
    let text = |s: &[u8]| [&b"S"[..], &(s.len() as u32).to_le_bytes(), s].concat();
    let geometry = [&b"L\x01\0\0\0\0\0\0\0"[..], &text(b"a\0\x01Geometry"), &text(b"Mesh")].concat();
    // Two thousand million numbers, packed into eight bytes.
    let mut vertices = b"d".to_vec();
    vertices.extend([2_000_000_000u32, 1, 8].iter().flat_map(|n| n.to_le_bytes()));
    vertices.extend([0x78, 0x9c, 0x03, 0, 0, 0, 0, 1]);
    let objects = record(file.len(), "Objects", (0, &[]), |start| {
        let mut inner = record(start, "Geometry", (3, &geometry), |start| {
            [record(start, "Vertices", (1, &vertices), |_| Vec::new()), vec![0; 13]].concat()
        });
        inner.extend([0; 13]);
        inner
    });
    file.extend(objects);
    file.extend([0; 13]);
    let error = read_bytes(&file, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("memory"), "{error}");
}
