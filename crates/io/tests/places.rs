//! Where meshes of a scene stand: nodes, instances of nodes, joints of skins, and hidden nodes.

use lodsmith_core::TriMesh;
use lodsmith_core::model::Pose;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Loaded, ReadError, ReadOptions, read_bytes, read_model_bytes};
use serde_json::{Value, json};

use crate::scenes::{self, Pack, glb};

fn scene_of(file: &[u8]) -> Scene {
    Scene::read(file, &ReadOptions::default()).unwrap()
}

fn mesh_of(file: &[u8]) -> Loaded {
    read_bytes(file, &ReadOptions::default()).unwrap()
}

fn losses(loaded: &Loaded) -> Vec<&str> {
    loaded.warnings.iter().filter(|w| w.data_lost).map(|w| w.text.as_str()).collect()
}

/// Translation, rotation and scale of some copies; the second is mirrored, the third stretched.
const COPIES: [([f32; 3], [f32; 4], [f32; 3]); 3] = [
    ([10.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0]),
    ([0.0, -20.0, 0.0], [0.0, 0.6, 0.0, 0.8], [-2.0, 2.0, 2.0]),
    ([0.0, 0.0, 30.0], [0.5, 0.5, 0.5, 0.5], [0.5, 3.0, 1.0]),
];

/// A triangle with normals, three times under a turned node: as instances, or as nodes.
fn three_times(is_instanced: bool) -> Vec<u8> {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let normals = pack.floats("VEC3", 3, [[0.6, 0.0, 0.8]; 3].as_flattened());
    let moves = pack.floats("VEC3", 3, COPIES.map(|c| c.0).as_flattened());
    let turns = pack.floats("VEC4", 4, COPIES.map(|c| c.1).as_flattened());
    let scales = pack.floats("VEC3", 3, COPIES.map(|c| c.2).as_flattened());
    let parent = json!({"rotation": [0.0, 0.6, 0.0, 0.8], "scale": [2.0, 2.0, 2.0]});
    let mut nodes = vec![parent];
    if is_instanced {
        nodes[0]["mesh"] = 0.into();
        let attributes = json!({"TRANSLATION": moves, "ROTATION": turns, "SCALE": scales});
        nodes[0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    } else {
        nodes[0]["children"] = json!([1, 2, 3]);
        let node = |(t, r, s)| json!({"mesh": 0, "translation": t, "rotation": r, "scale": s});
        nodes.extend(COPIES.map(node));
    }
    let used: &[&str] = if is_instanced { &["EXT_mesh_gpu_instancing"] } else { &[] };
    let json = pack.json(json!({
        "extensionsUsed": used, "extensionsRequired": used, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions, "NORMAL": normals}}]}],
    }));
    glb(&json, &pack.bin)
}

fn near(a: &TriMesh, b: &TriMesh) -> bool {
    let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-4);
    let (p, q) = (a.positions().view(), b.positions().view());
    let (m, n) = (a.normals().unwrap_or_default(), b.normals().unwrap_or_default());
    a.triangles() == b.triangles()
        && (p.len(), m.len()) == (q.len(), n.len())
        && p.iter().zip(q.iter()).all(|(a, b)| close(a, b))
        && m.iter().zip(n).all(|(a, b)| close(a.map(f64::from), b.map(f64::from)))
}

/// Regression: only one of twenty copies was read, a file that requires the extension was refused, and the box
/// contained one mesh at the origin.
#[test]
fn instances_are_placed_like_nodes_with_the_same_transforms() {
    let (instances, nodes) = (three_times(true), three_times(false));
    let (of_instances, of_nodes) = (mesh_of(&instances), mesh_of(&nodes));
    assert_eq!(of_instances.mesh.face_count(), 3);
    assert!(near(&of_instances.mesh, &of_nodes.mesh), "{:?}\n{:?}", of_instances.mesh, of_nodes.mesh);
    assert_eq!(of_instances.contents, of_nodes.contents);
    assert!(losses(&of_instances).is_empty(), "{:?}", of_instances.warnings);
    // The mirrored copy is turned: its normals and faces agree, as in the others.
    let mesh = &of_instances.mesh;
    for (f, t) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = t.map(|w| glam::DVec3::from(mesh.positions().view().get(mesh.vertex_of(w))));
        let normal = glam::Vec3::from(mesh.normals().unwrap()[t[0].index()]).as_dvec3();
        assert!((b - a).cross(c - a).dot(normal) > 0.0, "face {f}");
    }
    let (a, b) = (scene_of(&instances), scene_of(&nodes));
    assert_eq!((a.meshes()[0].instances, b.meshes()[0].instances), (3, 3));
    assert_eq!((a.contents().polygons, a.contents().meshes), (3, 3));
    assert!((a.meshes()[0].scale - 6.0).abs() < 1e-5 && (b.meshes()[0].scale - 6.0).abs() < 1e-5);
    let (own, drawn) = (a.bounds().unwrap(), read_model_bytes(&instances, &ReadOptions::default()).unwrap());
    let drawn = drawn.model.bounds(&Pose::default()).unwrap();
    for other in [b.bounds().unwrap(), drawn] {
        let all = own.min.iter().chain(&own.max).zip(other.min.iter().chain(&other.max));
        assert!(all.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{own:?} and {other:?}");
    }
}

/// A triangle that follows two joints, under a node that moves it far away; `world` places the joints.
fn skinned(ibm_scale: f32, weights: [f32; 2], world: &Value, pack: &mut Pack) -> Value {
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 200.0, 0.0]]);
    let normals = pack.floats("VEC3", 3, [[0.0, 0.0, 1.0]; 3].as_flattened());
    let joints = pack.push("VEC4", 5121, &[0, 1, 0, 0].repeat(3), 3);
    let weights = pack.floats("VEC4", 4, [[weights[0], weights[1], 0.0, 0.0]; 3].as_flattened());
    let s = ibm_scale;
    let matrix = [s, 0., 0., 0., 0., s, 0., 0., 0., 0., s, 0., 0., 0., 0., 1.];
    let bind = pack.floats("MAT4", 16, &matrix.repeat(2));
    let attributes =
        json!({"POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights});
    json!({
        "scenes": [{"nodes": [0, 1, 2]}], "meshes": [{"primitives": [{"attributes": attributes}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": bind}],
        "nodes": [{"mesh": 0, "skin": 0, "translation": [1000.0, 0.0, 0.0], "scale": [7.0, 7.0, 7.0]}, world, {}],
    })
}

/// A skinned mesh was measured, and written to formats without skins, as if its node placed it: here 100 times too large.
#[test]
fn skinned_meshes_are_placed_by_their_joints() {
    let mut pack = Pack::default();
    let world = json!({"translation": [0.0, 5.0, 0.0]});
    let json = skinned(0.01, [1.0, 0.0], &world, &mut pack);
    let file = glb(&pack.json(json), &pack.bin);
    let scene = scene_of(&file);
    let mesh = &scene.meshes()[0];
    assert!((mesh.scale - 0.01).abs() < 1e-6 && mesh.stretch.is_none(), "{}", mesh.scale);
    let bounds = scene.bounds().unwrap();
    assert!((bounds.max[0] - 1.0).abs() < 1e-6 && (bounds.max[1] - 7.0).abs() < 1e-6, "{bounds:?}");
    let model = read_model_bytes(&file, &ReadOptions::default()).unwrap().model;
    assert_eq!(model.bounds(&Pose::default()).unwrap(), bounds);
    let merged = mesh_of(&file).mesh;
    assert_eq!(merged.positions().view().bounds().unwrap(), bounds);
    assert_eq!(merged.normals().unwrap(), [[0.0, 0.0, 1.0]; 3]);
    let (rows, at) =
        (mesh.world_from_mesh.unwrap(), |r: usize, c: usize| mesh.world_from_mesh.unwrap()[r][c]);
    assert!((at(0, 0) - 0.01).abs() < 1e-6 && (at(1, 3) - 5.0).abs() < 1e-6, "{rows:?}");
}

/// Joints without vertices do not count; joints that mirror flip the faces.
#[test]
fn only_joints_in_use_place_a_skinned_mesh() {
    let mut pack = Pack::default();
    let world = json!({"scale": [-3.0, 3.0, 3.0]});
    let first = skinned(1.0, [1.0, 0.0], &world, &mut pack);
    let file = glb(&pack.json(first), &pack.bin);
    assert!((scene_of(&file).meshes()[0].scale - 3.0).abs() < 1e-6);
    let merged = mesh_of(&file).mesh;
    assert_eq!(merged.positions().view().bounds().unwrap().min, [-300.0, 0.0, 0.0]);
    let corners = merged.triangles()[0].map(|w| w.index());
    assert_eq!((corners, merged.normals().unwrap()[0]), ([0, 2, 1], [0.0, 0.0, 1.0]));

    let mut pack = Pack::default();
    let second = skinned(1.0, [0.0, 1.0], &world, &mut pack);
    let mesh = &scene_of(&glb(&pack.json(second), &pack.bin)).meshes()[0].clone();
    assert!((mesh.scale - 1.0).abs() < 1e-6, "{}", mesh.scale);
}

/// A triangle at the origin, and a hidden one under a hidden node.
fn hidden(pack: &mut Pack) -> Value {
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let primitive = json!({"attributes": {"POSITION": positions}});
    json!({
        "extensionsUsed": ["KHR_node_visibility"], "extensionsRequired": ["KHR_node_visibility"],
        "scenes": [{"nodes": [0, 1]}], "meshes": [{"primitives": [primitive]}, {"primitives": [primitive]}],
        "nodes": [{"mesh": 0}, {"children": [2], "extensions": {"KHR_node_visibility": {"visible": false}}},
            {"mesh": 1, "translation": [50.0, 0.0, 0.0]}],
    })
}

#[test]
fn hidden_meshes_stay_in_a_scene_and_are_left_out_elsewhere() {
    let mut pack = Pack::default();
    let mut json = pack_json(&mut pack);
    let file = glb(&json, &pack.bin);
    let scene = scene_of(&file);
    assert_eq!(scene.meshes().iter().map(|m| m.instances).collect::<Vec<_>>(), [1, 1]);
    assert_eq!(scene.bounds().unwrap().max, [1.0, 1.0, 0.0]);
    let model = read_model_bytes(&file, &ReadOptions::default()).unwrap().model;
    assert_eq!((model.meshes.len(), model.face_count()), (2, 1));
    let merged = mesh_of(&file);
    assert_eq!((merged.mesh.face_count(), merged.contents.meshes), (1, 1));
    assert_eq!(losses(&merged), ["1 hidden mesh (KHR_node_visibility) left out"]);
    let mut three_mf = Vec::new();
    let written =
        lodsmith_io::write_scene_to(&scene, &[], Format::ThreeMf, &|_| None, &mut three_mf).unwrap();
    assert!(
        written.warnings.iter().any(|w| w.data_lost && w.text.contains("hidden")),
        "{:?}",
        written.warnings
    );
    assert_eq!(mesh_of(&three_mf).mesh.face_count(), 1);
    // Where nothing is shown, all is taken.
    json["nodes"][0]["extensions"] = json["nodes"][1]["extensions"].clone();
    assert_eq!(mesh_of(&glb(&json, &pack.bin)).mesh.face_count(), 2);
}

fn pack_json(pack: &mut Pack) -> Value {
    let rest = hidden(pack);
    pack.json(rest)
}

/// `info`, `compare` and mesh formats refused files that require these, though nothing of them places a vertex.
#[test]
fn extensions_that_describe_or_choose_do_not_prevent_reading_a_mesh() {
    let (mut json, bin) = scenes::small();
    for name in ["EXT_mesh_features", "EXT_instance_features", "EXT_structural_metadata", "MSFT_lod"] {
        (json["extensionsUsed"], json["extensionsRequired"]) = (json!([name]), json!([name]));
        let loaded = mesh_of(&glb(&json, &bin));
        assert!(loaded.mesh.face_count() == 1 && losses(&loaded)[0].contains(name), "{:?}", loaded.warnings);
    }
}

#[test]
fn a_stretch_is_known_if_all_placements_share_it() {
    let mut pack = Pack::default();
    let mut json = pack_json(&mut pack);
    let mut of = |first: Value, second: Value| {
        json["nodes"] = json!([first, second]);
        let scene = scene_of(&glb(&json, &pack.bin));
        let mesh = scene.meshes()[0].clone();
        (mesh.scale, mesh.stretch)
    };
    let node = |scale: [f64; 3]| json!({"mesh": 0, "rotation": [0.6, 0.0, 0.0, 0.8], "scale": scale});
    let (scale, stretch) = of(node([2.0, 2.0, 8.0]), json!({}));
    let diagonal = |m: [[f64; 3]; 3]| [m[0][0], m[1][1], m[2][2]].map(|x| (x * 1e6).round() / 1e6);
    assert!((scale - 8.0).abs() < 1e-9 && diagonal(stretch.unwrap()) == [2.0, 2.0, 8.0]);
    // Half as large a second time; and stretched in another way.
    let (scale, stretch) = of(node([2.0, 2.0, 8.0]), node([1.0, 1.0, 4.0]));
    assert!((scale - 8.0).abs() < 1e-9 && diagonal(stretch.unwrap()) == [2.0, 2.0, 8.0]);
    let (scale, stretch) = of(node([2.0, 2.0, 8.0]), node([1.0, 4.0, 1.0]));
    assert!((scale - 8.0).abs() < 1e-9 && stretch.is_none());
    let (scale, stretch) = of(node([2.0, -2.0, 2.0]), json!({}));
    assert!((scale - 2.0).abs() < 1e-9 && stretch.is_none());
}

/// A few bytes may place very many copies: they are counted without being stored, and refused where each is needed.
#[test]
fn very_many_copies_take_no_memory() {
    let many = |nodes: usize, count: usize| {
        let mut pack = Pack::default();
        let rest = hidden(&mut pack);
        // No data: all copies stand at the node.
        pack.accessors.push(json!({"componentType": 5126, "count": count, "type": "VEC3"}));
        let copies = json!({"TRANSLATION": pack.accessors.len() - 1});
        let node = json!({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": copies}}});
        let mut json = pack.json(rest);
        json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
        (json["nodes"], json["scenes"]) =
            (vec![node; nodes].into(), json!([{"nodes": (0..nodes).collect::<Vec<_>>()}]));
        glb(&json, &pack.bin)
    };
    let refused = |e: ReadError| matches!(e, ReadError::Limit { .. });
    let file = many(1, 500_000);
    assert_eq!(scene_of(&file).meshes()[0].instances, 500_000);
    let file = many(1_000, 1 << 20);
    assert!(Scene::read(&file, &ReadOptions::default()).is_err_and(refused));
    assert!(read_bytes(&file, &ReadOptions::default()).is_err_and(refused));
    assert!(read_bytes(&many(3, 400_000), &ReadOptions::default()).is_err_and(refused));
}

/// Command and JavaScript decoded four million pixels of base colours, the viewer all of them: other results for one file.
#[test]
fn colors_of_large_images_are_the_same_as_in_the_model() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let uvs = pack.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let mut png = std::io::Cursor::new(Vec::new());
    let mut large = image::RgbaImage::from_pixel(2100, 2100, image::Rgba([200, 10, 10, 255]));
    large.put_pixel(2099, 2099, image::Rgba([1, 2, 3, 255]));
    large.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let view = pack.view(png.get_ref());
    let json = pack.json(json!({
        "images": [{"bufferView": view, "mimeType": "image/png"}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "material": 0}]}],
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    }));
    let file = glb(&json, &pack.bin);
    let scene = scene_of(&file);
    let (colors, warnings) = scene.base_colors();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(colors[0][0].as_ref().unwrap().0, scene.model().0.images[0]);
    // Images that do not fit the memory are reported.
    let mut options = ReadOptions::default();
    options.limits.memory = 64 << 20;
    let (colors, warnings) = Scene::read(&file, &options).unwrap().base_colors();
    assert!(colors[0][0].is_none());
    let text = "image 0 has 2100 x 2100 pixels, which is above the limits: its colors are not kept in place";
    assert_eq!(warnings.iter().map(|w| w.text.as_str()).collect::<Vec<_>>(), [text]);
}
