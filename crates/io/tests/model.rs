//! Reading files as models for display.

use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use lodsmith_core::model::{AlphaMode, Interpolation, Pose, Sampler, Track, Transform, VertexColors, Wrap};
use lodsmith_core::{Model, TriMesh};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{
    Format, ModelFile, ModelSource, ReadError, ReadOptions, read_model_bytes, read_model_path,
};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::scenes::{Pack, data_uri, everything, glb, gltf, small, split};

/// Encodes red and green above blue and half-transparent white.
fn picture(format: image::ImageFormat) -> Vec<u8> {
    let pixels = vec![255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 128];
    let picture = image::RgbaImage::from_raw(2, 2, pixels).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    if format == image::ImageFormat::Jpeg {
        image::DynamicImage::from(picture).into_rgb8().write_to(&mut bytes, format).unwrap();
    } else {
        picture.write_to(&mut bytes, format).unwrap();
    }
    bytes.into_inner()
}

fn png() -> Vec<u8> {
    picture(image::ImageFormat::Png)
}

fn read(bytes: &[u8]) -> ModelFile {
    read_model_bytes(bytes, &ReadOptions::default()).unwrap()
}

fn warning_texts(file: &ModelFile) -> Vec<&str> {
    file.warnings.iter().map(|w| &*w.text).collect()
}

/// Returns a square with one material.
fn square(material: Value, rest: &[(&str, Value)], bin: impl FnOnce(&mut Pack)) -> Vec<u8> {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let uvs = pack.floats("VEC2", 2, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let indices = pack.indices(&[0, 1, 2, 0, 2, 3]);
    bin(&mut pack);
    let mut json = pack.json(json!({
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "materials": [material],
        "meshes": [{"primitives": [{"material": 0, "indices": indices,
            "attributes": {"POSITION": positions, "TEXCOORD_0": uvs}}]}],
    }));
    rest.iter().for_each(|(key, value)| json[*key] = value.clone());
    glb(&json, &pack.bin)
}

#[test]
fn a_scene_keeps_its_nodes_skins_and_animations() {
    let (json, bin) = everything();
    let file = read(&glb(&json, &bin));
    let ModelFile { model, format, source, .. } = &file;
    assert_eq!((*format, model.meshes.len(), model.nodes.len()), (Format::Glb, 2, 6));
    assert_eq!(model.roots, [0, 1, 4]);
    assert_eq!((&model.nodes[1].children[..], &model.nodes[5].children[..]), (&[2, 3][..], &[][..]));
    assert_eq!((model.nodes[0].skin, model.nodes[3].skin, model.nodes[2].mesh), (Some(0), None, Some(0)));
    assert_eq!((&*model.nodes[2].name, model.nodes[0].morph_weights.as_deref()), ("b", Some(&[0.5][..])));
    let Transform::Parts { rotation, scale, .. } = model.nodes[1].transform else { panic!("no parts") };
    assert_eq!((rotation.to_array(), scale.to_array()), ([0.0, 0.0, 0.6, 0.8], [1.0, 3.0, 2.0]));
    // A line primitive between the others has a material entry too.
    assert_eq!(model.meshes[0].materials, [Some(1), None, Some(0)]);
    assert_eq!((&model.meshes[0].morph_weights[..], &*model.meshes[0].name), (&[0.0][..], "quad"));
    assert_eq!(model.skins[0].joints, [4, 5]);
    assert_eq!(model.skins[0].joint_from_mesh, [glam::DMat4::IDENTITY; 2]);
    let channel = &model.animations[0].channels[0];
    assert_eq!((channel.node, &channel.times[..]), (0, &[0.0, 1.0][..]));
    assert_eq!(channel.interpolation, Interpolation::Linear);
    assert_eq!(channel.track, Track::MorphWeights(vec![0.0, 1.0]));
    assert_eq!(model.vertex_colors, VertexColors::Linear);
    assert_eq!((model.face_count(), file.contents.polygons), (8, 8));
    // Its image cannot be decoded.
    assert!(model.images.is_empty() && model.materials[1].base_color_texture.is_none());
    assert!(
        warning_texts(&file)[0].starts_with("image 0 has an unsupported type"),
        "{:?}",
        warning_texts(&file)
    );
    // Meshes are shared, not copied.
    let ModelSource::Scene(scene) = source else { panic!("no scene") };
    assert!(Arc::ptr_eq(&scene.meshes()[0].mesh, &model.meshes[0].mesh));
    // The meshes of the model can be written back to the file.
    let same: Vec<_> = model.meshes.iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
    let mut out = Vec::new();
    scene.write(&same, Format::Glb, &|_| None, &mut out).unwrap();
    assert_eq!((split(&out).0["nodes"]).clone(), json["nodes"]);
}

#[test]
fn materials_match_the_file() {
    let material = json!({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5,
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1, "texCoord": 1}},
        "normalTexture": {"index": 0, "scale": 0.75,
            "extensions": {"KHR_texture_transform": {"scale": [0.5, 0.5], "texCoord": 2}}},
        "occlusionTexture": {"index": 9}, "emissiveFactor": [0.0, 0.5, 1.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}, "KHR_materials_unlit": {},
            "ACME_unknown": {"sheen": 7}},
    });
    let rest = [
        (
            "textures",
            json!([{"source": 0}, {"extensions": {"EXT_texture_webp": {"source": 1}}, "sampler": 0}]),
        ),
        ("samplers", json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}])),
        ("images", json!([{"uri": data_uri(&png())}, {"bufferView": 3, "mimeType": "image/webp"}])),
    ];
    let file = read(&square(material, &rest, |pack| {
        pack.view(&picture(image::ImageFormat::WebP));
    }));
    assert_eq!(warning_texts(&file), [""; 0]);
    let [m] = &file.model.materials[..] else { panic!("one material") };
    assert_eq!((&*m.name, m.double_sided, m.unlit), ("all", true, true));
    assert_eq!((m.base_color, m.metallic, m.roughness), ([0.1, 0.2, 0.3, 0.4], 0.5, 1.0));
    assert_eq!((m.alpha, m.emissive, m.normal_scale), (AlphaMode::Mask(0.25), [0.0, 2.0, 4.0], 0.75));
    assert!(m.occlusion_texture.is_none() && m.emissive_texture.is_none());
    let (base, rough) = (m.base_color_texture.unwrap(), m.metallic_roughness_texture.unwrap());
    assert_eq!((base.image, base.uv_set, base.sampler), (0, 0, Sampler::default()));
    let sampler = Sampler { wrap_u: Wrap::Clamp, wrap_v: Wrap::Mirror, nearest: true };
    assert_eq!((rough.image, rough.uv_set, rough.sampler), (1, 1, sampler));
    let normal = m.normal_texture.unwrap();
    assert_eq!((normal.image, normal.uv_set), (0, 2));
    // The upper left quarter.
    assert_eq!([normal.look_up([0.0, 0.0]), normal.look_up([1.0, 1.0])], [[0.0, 0.5], [0.5, 1.0]]);
    let [a, b] = &file.model.images[..] else { panic!("two images") };
    assert_eq!((a.width(), a.height()), (2, 2));
    assert_eq!(
        (a.at(0, 0), a.at(1, 0), a.at(1, 1)),
        ([255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 255, 128])
    );
    assert_eq!(a, b);
    // The lower left corner of the image is the lower left corner of the square.
    assert_eq!(file.model.meshes[0].mesh.uvs().unwrap()[0], [0.0, 0.0]);
    assert_eq!(file.model.meshes[0].materials, [Some(0)]);
}

#[test]
fn the_older_kind_of_material_is_understood() {
    let material = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        "extensions": {"KHR_materials_pbrSpecularGlossiness":
            {"diffuseFactor": [0.5, 0.25, 1.0, 1.0], "glossinessFactor": 0.25}}});
    let file = read(&square(material, &[], |_| {}));
    let m = &file.model.materials[0];
    assert_eq!((m.base_color, m.metallic, m.roughness), ([0.5, 0.25, 1.0, 1.0], 0.0, 0.75));
}

#[test]
fn images_beside_the_file_are_found_and_never_above_it() {
    let folder = TempDir::new().unwrap();
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "emissiveTexture": {"index": 1}, "normalTexture": {"index": 2}});
    let rest = [
        ("textures", json!([{"source": 0}, {"source": 1}, {"source": 2}])),
        ("images", json!([{"uri": "a%20b.jpg"}, {"uri": "../x.png"}, {"uri": "none.png"}])),
    ];
    let file = square(material, &rest, |_| {});
    fs::create_dir(folder.path().join("in")).unwrap();
    fs::write(folder.path().join("x.png"), png()).unwrap();
    fs::write(folder.path().join("in/a b.jpg"), picture(image::ImageFormat::Jpeg)).unwrap();
    fs::write(folder.path().join("in/a.glb"), &file).unwrap();
    let got = read_model_path(&folder.path().join("in/a.glb"), &ReadOptions::default()).unwrap();
    let m = &got.model.materials[0];
    assert_eq!((m.base_color_texture.map(|t| t.image), got.model.images.len()), (Some(0), 1));
    assert!(m.emissive_texture.is_none() && m.normal_texture.is_none());
    let texts = warning_texts(&got);
    assert!(
        texts.len() == 2
            && texts[1].starts_with("image 1 (../x.png) is outside")
            && texts[0].starts_with("image 2 (none.png)"),
        "{texts:?}"
    );
    // Bytes without a path have no folder.
    assert!(read(&file).model.images.is_empty());
}

#[test]
fn images_above_the_limits_are_left_out() {
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 1}});
    let uri = data_uri(&png());
    let rest = [
        ("textures", json!([{"source": 0}, {"source": 1}])),
        ("images", json!([{"uri": uri}, {"uri": uri}])),
    ];
    let mut options = ReadOptions::default();
    options.limits.pixels = 7;
    let file = read_model_bytes(&square(material, &rest, |_| {}), &options).unwrap();
    // The first image uses four of the pixels.
    assert_eq!(file.model.images.len(), 1);
    assert!(file.model.materials[0].normal_texture.is_none());
    assert_eq!(
        warning_texts(&file),
        ["image 1 has 2 x 2 pixels, which is above the limits: surfaces are shown without it"]
    );
}

#[test]
fn materials_of_obj_are_seen() {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    put(
        "a.obj",
        b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\n\
          usemtl wood\nf 1/1 3/3 4/4\nusemtl glass\nf 1/1 2/2 4/4\nusemtl lamp\nf 2/2 3/3 4/4\n",
    );
    put(
        "a.mtl",
        b"newmtl wood\nKd 0.5 0.5 0.5\nmap_Kd grain.bmp\nmap_bump heights.png\nNs 30\nKs 1 1 1\nnewmtl glass\n\
          Kd 0.5 0.25 0.125\nd 0.25\nKe 0 1 0\nPr 0.5\nNs 5\nmap_Ke broken.png\nmap_disp unknown.png\nnewmtl lamp\nmap_Kd light.tga\n",
    );
    put("grain.bmp", &picture(image::ImageFormat::Bmp));
    put("light.tga", &picture(image::ImageFormat::Tga));
    put("broken.png", &png()[..40]);
    let mut grey = Cursor::new(Vec::new());
    image::GrayImage::from_raw(2, 1, vec![0, 255])
        .unwrap()
        .write_to(&mut grey, image::ImageFormat::Png)
        .unwrap();
    put("heights.png", &grey.into_inner());
    let file = read_model_path(&folder.path().join("a.obj"), &ReadOptions::default()).unwrap();
    let model = &file.model;
    assert_eq!(
        (model.nodes.len(), &model.meshes[0].materials[..]),
        (1, &[None, Some(0), Some(1), Some(2)][..])
    );
    let [wood, glass, lamp] = &model.materials[..] else { panic!("three materials") };
    // With an image, the colour is ignored; a height map is not used as a normal map.
    assert_eq!((wood.base_color, wood.base_color_texture.map(|t| t.image)), ([1.0; 4], Some(0)));
    assert!(wood.normal_texture.is_none() && wood.double_sided);
    assert!((wood.roughness - 0.5).abs() < 1e-6, "{}", wood.roughness);
    assert_eq!((glass.base_color, glass.alpha), ([0.5, 0.25, 0.125, 0.25], AlphaMode::Blend));
    assert_eq!((glass.roughness, glass.emissive), (0.5, [0.0, 1.0, 0.0]));
    assert!(glass.emissive_texture.is_none());
    let light = lamp.base_color_texture.map(|t| &model.images[t.image]);
    assert_eq!(
        light.map(|i| i.pixels()),
        Some(model.images[0].pixels()),
        "one and the same picture in two formats"
    );
    assert_eq!(model.images[0].at(1, 0)[..3], [0, 255, 0]);
    let texts = warning_texts(&file);
    assert!(texts.len() == 1 && texts[0].contains("cannot be decoded"), "{texts:?}");
    let ModelSource::Mesh(loaded) = &file.source else { panic!("no mesh") };
    assert_eq!(loaded.regions.len(), 4);
}

#[test]
fn unplaced_meshes_and_copies_are_placed() {
    let (json, bin) = small();
    let file = read(&gltf(&json, &bin));
    assert_eq!((file.model.nodes.len(), &file.model.roots[..], file.model.face_count()), (1, &[0][..], 1));

    let rest = [(
        "nodes",
        json!([{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 3}}}}]),
    )];
    let copies = square(json!({}), &rest, |pack| {
        pack.floats("VEC3", 3, &[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]);
    });
    let file = read(&copies);
    let places = file.model.instances(&Pose::default());
    let moved: Vec<_> = places.iter().map(|i| i.world_from_mesh.w_axis.truncate().to_array()).collect();
    assert_eq!(moved, [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]);
    assert_eq!((file.model.face_count(), file.contents.polygons), (6, 6));
}

#[test]
fn invalid_animations_are_reported_and_ignored() {
    let (mut json, bin) = everything();
    // Too few values, a missing node, and decreasing times.
    let weights = json["animations"][0]["samplers"][0].clone();
    json["animations"][0]["samplers"] = json!([
        {"input": weights["input"], "output": weights["output"], "interpolation": "CUBICSPLINE"},
        weights,
        {"input": weights["output"], "output": weights["output"], "interpolation": "WILD"},
    ]);
    let target = |node: usize| json!({"node": node, "path": "weights"});
    json["animations"][0]["channels"] = json!([
        {"sampler": 0, "target": target(0)}, {"sampler": 1, "target": target(77)}, {"sampler": 2, "target": target(0)},
        {"sampler": 1, "target": {"path": "pointer"}}, {"sampler": 1, "target": {"path": "weights"}},
        {"sampler": 1, "target": target(0)}, {"sampler": 1, "target": target(3)},
    ]);
    json["skins"][0]["inverseBindMatrices"] = 0.into();
    json["materials"] = Value::Null;
    let file = read(&glb(&json, &bin));
    assert_eq!((file.model.animations[0].channels.len(), file.model.skins.len()), (1, 0));
    assert!(file.model.nodes.iter().all(|n| n.skin.is_none()));
    let texts = warning_texts(&file);
    for (i, wanted) in [
        "skins[0] is left out",
        "2 values, expected 6",
        "node is missing",
        "interpolation is unknown",
        "KHR_animation_pointer",
        "no morph targets",
    ]
    .into_iter()
    .enumerate()
    {
        assert!(texts[i].contains(wanted), "{wanted}: {texts:?}");
    }
    assert_eq!(texts.len(), 6);
    // A region may still refer to a removed material.
    assert_eq!(file.model.meshes[0].materials, [None; 3]);
}

#[test]
fn simplified_meshes_replace_their_originals() {
    let file = read(&square(json!({"name": "m"}), &[], |_| {}));
    let whole = &file.model.meshes[0].mesh;
    let half = TriMesh::new(whole.positions().clone(), whole.surface().triangles()[..1].to_vec()).unwrap();
    let lighter = file.model.with_meshes(vec![Arc::new(half)]);
    assert_eq!((lighter.face_count(), file.model.face_count()), (1, 2));
    assert_eq!((&lighter.nodes, &lighter.materials), (&file.model.nodes, &file.model.materials));
    assert_eq!(lighter.meshes[0].materials, [Some(0)]);
}

#[test]
fn files_without_faces_are_refused() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0; 3]]);
    let json =
        pack.json(json!({"meshes": [{"primitives": [{"mode": 0, "attributes": {"POSITION": positions}}]}]}));
    let bytes = glb(&json, &pack.bin);
    assert!(matches!(read_model_bytes(&bytes, &ReadOptions::default()), Err(ReadError::NoFaces { .. })));
    let missing = read_model_path(Path::new("no/such.glb"), &ReadOptions::default()).unwrap_err();
    assert!(missing.to_string().contains("no/such.glb"));
}

/// Checks that every index in the model is in range.
fn check(model: &Model) {
    let all = |list: &[usize], count: usize| assert!(list.iter().all(|&i| i < count));
    all(&model.roots, model.nodes.len());
    for node in &model.nodes {
        all(&node.children, model.nodes.len());
        all(node.mesh.as_slice(), model.meshes.len());
        all(node.skin.as_slice(), model.skins.len());
    }
    for mesh in &model.meshes {
        mesh.materials.iter().for_each(|m| all(m.as_slice(), model.materials.len()));
        let regions = mesh.mesh.regions().and_then(|r| r.iter().max()).map_or(1, |r| r.index() + 1);
        assert!(regions <= mesh.materials.len());
    }
    for skin in &model.skins {
        all(&skin.joints, model.nodes.len());
        assert_eq!(skin.joints.len(), skin.joint_from_mesh.len());
    }
    for mut material in model.materials.iter().cloned() {
        material.textures_mut().into_iter().flatten().for_each(|t| all(&[t.image], model.images.len()));
    }
    let channels = model.animations.iter().flat_map(|a| &a.channels);
    channels.for_each(|c| all(&[c.node], model.nodes.len()));
}

#[test]
fn invalid_indices_are_harmless() {
    let (json, bin) = everything();
    let text = json.to_string();
    check(&read(&glb(&json, &bin)).model);
    // Changes every digit of the file in turn.
    let digits: Vec<usize> = (0..text.len()).filter(|&i| text.as_bytes()[i].is_ascii_digit()).collect();
    let mut read = 0;
    for at in digits {
        let mut other = text.clone().into_bytes();
        other[at] = if other[at] == b'9' { b'0' } else { b'9' };
        let Ok(json) = serde_json::from_slice(&other) else { continue };
        let Ok(scene) = Scene::read(&glb(&json, &bin), &ReadOptions::default()) else { continue };
        check(&scene.model().0);
        read += 1;
    }
    assert!(read > 100, "{read}");
}

/// Fault B5: a model of 60 million instances at one place was built, although reading it as one mesh was
/// refused.
#[test]
fn a_bomb_of_copies_is_refused_as_a_model_as_it_is_as_a_mesh() {
    let copies = 2_000;
    let faces = 2_000;
    let mut buffer: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    buffer.extend([0u8, 1, 2].repeat(faces));
    let digits = |six: u8| {
        b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[six as usize & 63] as char
    };
    let base64: String = buffer
        .chunks_exact(3)
        .flat_map(|b| [b[0] >> 2, b[0] << 4 | b[1] >> 4, b[1] << 2 | b[2] >> 6, b[2]].map(digits))
        .collect();
    let length = buffer.len();
    let nodes = vec![r#"{"mesh":0}"#; copies].join(",");
    let roots = (0..copies).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5121,"count":{count},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":{count}}}],
        "buffers":[{{"byteLength":{length},"uri":"data:application/octet-stream;base64,{base64}"}}]}}"#,
        count = 3 * faces,
    );
    let options = lodsmith_io::ReadOptions::default();
    let as_mesh = lodsmith_io::read_bytes(json.as_bytes(), &options).unwrap_err().to_string();
    let as_model = lodsmith_io::read_model_bytes(json.as_bytes(), &options).unwrap_err().to_string();
    assert!(as_mesh.contains("placed by nodes, for a file of this size, is 4000000"), "{as_mesh}");
    assert_eq!(as_mesh, as_model);
}
