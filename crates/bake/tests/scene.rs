//! Maps in the materials of a glTF scene.

use lodsmith::NoControl;
use lodsmith_bake::{AtlasMode, BakeOptions, BakedScene, MapKind, bake_scene, set_materials};
use lodsmith_core::Image;
use lodsmith_core::model::Material;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{ModelFile, ReadOptions};

/// Returns a scene with a square for each material, side by side; each square covers its texture once.
fn squares(materials: &[&str]) -> Scene {
    let mut floats: Vec<f32> = vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
    for i in 0..materials.len() {
        let x = 2.0 * i as f32;
        floats
            .extend([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 1.0, 1.0, 0.0], [x, 1.0, 0.0]].as_flattened());
    }
    let mut bin: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    let corners_at = bin.len();
    bin.extend([0u8, 1, 2, 0, 2, 3, 0, 0]);
    let list = |of: &dyn Fn(usize) -> String| (0..materials.len()).map(of).collect::<Vec<_>>().join(",");
    let places = list(&|i| {
        let (offset, x) = (32 + 48 * i, 2 * i);
        format!(
            r#"{{"bufferView": 0, "byteOffset": {offset}, "componentType": 5126, "count": 4, "type": "VEC3",
                "min": [{x}, 0, 0], "max": [{}, 1, 0]}}"#,
            x + 1
        )
    });
    let primitives = list(&|i| {
        let place = i + 2;
        format!(
            r#"{{"attributes": {{"POSITION": {place}, "TEXCOORD_0": 0}}, "indices": 1, "material": {i}}}"#
        )
    });
    let mut json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "extensionsUsed": ["KHR_materials_emissive_strength", "KHR_materials_clearcoat"],
        "meshes": [{{"primitives": [{primitives}]}}], "materials": [{}], "buffers": [{{"byteLength": {}}}],
        "bufferViews": [
            {{"buffer": 0, "byteLength": {corners_at}}}, {{"buffer": 0, "byteOffset": {corners_at}, "byteLength": 6}}
        ],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC2"}},
            {{"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"}},
            {places}
        ]}}"#,
        materials.join(","),
        bin.len()
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    let length = |n: usize| (n as u32).to_le_bytes();
    bytes.extend(length(28 + json.len() + bin.len()));
    for (kind, chunk) in [(b"JSON", json.as_bytes()), (b"BIN\0", &bin)] {
        bytes.extend(length(chunk.len()));
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    Scene::read(&bytes, &ReadOptions::default()).unwrap()
}

/// Bakes a scene onto itself, and returns what was baked, and the scene as it is read again after writing.
fn baked(mut scene: Scene, maps: &[MapKind], atlas: AtlasMode) -> (BakedScene, ModelFile, String) {
    let mut options = BakeOptions::new(maps.iter().copied());
    (options.size, options.atlas) = (Some(32), atlas);
    let model = ModelFile::from(scene.clone()).model;
    let made = bake_scene(&model, &model, &mut scene, &options, false, &mut NoControl).unwrap();
    set_materials(&mut scene, &made.materials);
    scene.drop_unused_materials();
    let mut bytes = Vec::new();
    scene.write(&made.meshes, lodsmith_io::Format::Glb, &|_| None, &mut bytes).unwrap();
    let json = String::from_utf8_lossy(&bytes[20..]).split('\0').next().unwrap_or_default().to_owned();
    (made, ModelFile::from(Scene::read(&bytes, &ReadOptions::default()).unwrap()), json)
}

/// The light that the middle of a material emits.
fn emission(material: &Material, images: &[std::sync::Arc<Image>]) -> [f32; 3] {
    let texel = material.emissive_texture.map_or([255; 4], |t| {
        let image = &images[t.image];
        image.at(image.width() / 2, image.height() / 2)
    });
    [0, 1, 2].map(|k| material.emissive[k] * lodsmith_render::linear::of_byte(texel[k]))
}

#[test]
fn emission_stays_as_strong_as_it_was() {
    for (strength, atlas, map) in [
        (4.0, AtlasMode::Keep, MapKind::Emissive),
        (20.0, AtlasMode::Keep, MapKind::Emissive),
        (20.0, AtlasMode::Keep, MapKind::Normal),
        (0.5, AtlasMode::Keep, MapKind::Emissive),
        (20.0, AtlasMode::New, MapKind::Emissive),
        (20.0, AtlasMode::New, MapKind::Normal),
    ] {
        let material = format!(
            r#"{{"emissiveFactor": [0.2, 0.1, 0],
            "extensions": {{"KHR_materials_emissive_strength": {{"emissiveStrength": {strength}}}}}}}"#
        );
        let (_, file, json) = baked(squares(&[&material]), &[map], atlas);
        let used = &file.model.materials[file.model.meshes[0].materials[0].unwrap()];
        let found = emission(used, &file.model.images);
        let wanted = [0.2 * strength, 0.1 * strength, 0.0f32];
        let differs = |k: usize| (found[k] - wanted[k]).abs() > 0.01 * strength;
        assert!(!(0..3).any(differs), "{found:?} for {wanted:?}: {strength} {atlas:?} {map:?}");
        let lists = json.matches("KHR_materials_emissive_strength").count();
        assert!(lists == 0 || lists == 2, "the material has it, and the file names it: {json}");
    }
}

#[test]
fn the_maps_of_each_material_have_files_of_their_own() {
    let scene = squares(&["{}", "{}", r#"{"name": "Mat.1"}"#, r#"{"name": "mat 1"}"#]);
    let (made, ..) = baked(scene, &[MapKind::Height], AtlasMode::Keep);
    let names: Vec<&str> = made.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["_height.png", "_2_height.png", "_Mat_1_height.png", "_mat_1_4_height.png"]);
}

#[test]
fn the_maps_of_all_materials_count_as_memory() {
    let needs = |count: usize| {
        let mut scene = squares(&vec!["{}"; count]);
        let model = ModelFile::from(scene.clone()).model;
        let mut options = BakeOptions::new([MapKind::Normal]);
        (options.size, options.memory) = (Some(512), 25 << 20);
        bake_scene(&model, &model, &mut scene, &options, false, &mut NoControl).is_err()
    };
    assert!(!needs(1) && needs(4));
}

#[test]
fn data_of_materials_that_a_new_atlas_drops_are_named() {
    let coated = r#"{
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_unlit": {}},
        "extras": {"shader": "paint"}
    }"#;
    let lost = |atlas| {
        let (made, ..) = baked(squares(&["{}", coated]), &[MapKind::Normal], atlas);
        made.warnings.into_iter().filter(|w| w.data_lost).map(|w| w.text).collect::<Vec<_>>()
    };
    assert_eq!(lost(AtlasMode::Keep), [""; 0]);
    let [text] = &lost(AtlasMode::New)[..] else { panic!("one warning") };
    assert!(text.ends_with(": KHR_materials_clearcoat, extras"), "{text}");
}

/// Sixteen textures, each on a square of its own: several threads need each of them.
#[test]
fn many_threads_bake_many_textures_without_waiting_for_each_other() {
    use lodsmith_core::model::{ModelMesh, Node, Sampler, TextureRef};
    use lodsmith_core::{Model, Positions, TriMesh, VertexId};
    let mut model = Model::default();
    for i in 0..16 {
        let y = i as f32;
        let positions = vec![[0.0, y, 0.0], [1.0, y, 0.0], [1.0, y + 1.0, 0.0], [0.0, y + 1.0, 0.0]];
        let faces = [[0, 1, 2], [0, 2, 3]].map(|f| f.map(VertexId)).to_vec();
        let mut mesh = TriMesh::new(Positions::F32(positions), faces).unwrap();
        mesh.set_uvs(Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).unwrap();
        let (name, mesh, morph_weights) = (String::new(), std::sync::Arc::new(mesh), Vec::new());
        model.meshes.push(ModelMesh { name, mesh, materials: vec![Some(i)], morph_weights });
        model.nodes.push(Node { mesh: Some(i), ..Node::default() });
        model.roots.push(i);
        let (transform, sampler) = (TextureRef::PLAIN, Sampler::default());
        let texture = TextureRef { image: i, uv_set: 0, transform, sampler };
        model.materials.push(Material { base_color_texture: Some(texture), ..Material::default() });
        model.images.push(std::sync::Arc::new(Image::filled(128, 128, [16 * i as u8, 0, 0, 255])));
    }
    let (done, is_done) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().unwrap();
        let mut options = BakeOptions::new([MapKind::Color]);
        (options.size, options.atlas) = (Some(64), AtlasMode::New);
        let mut first = None;
        for _ in 0..30 {
            let baked =
                pool.install(|| lodsmith_bake::bake(&model, &model, &options, &mut NoControl)).unwrap();
            let maps: Vec<_> = baked.sets.into_iter().map(|set| set.maps).collect();
            assert!(*first.get_or_insert_with(|| maps.clone()) == maps, "the same maps each time");
        }
        done.send(()).unwrap();
    });
    is_done.recv_timeout(std::time::Duration::from_secs(120)).expect("there is no deadlock");
}
