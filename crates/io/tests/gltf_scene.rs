//! Whole glTF scenes: everything that is not replaced stays identical, byte for byte.

use lodsmith_core::mesh::{Morphed, Semantic};
use lodsmith_core::{RegionId, TriMesh, WedgeId};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadError, ReadOptions};
use serde_json::{Value, json};

use crate::scenes::{self, PNG, Pack, everything, glb, gltf, small};

fn scene_of(bytes: &[u8]) -> Scene {
    Scene::read(bytes, &ReadOptions::default()).unwrap()
}

fn written(scene: &Scene, replaced: &[Option<TriMesh>], format: Format) -> (Value, Vec<u8>, Vec<String>) {
    let mut out = Vec::new();
    let warnings = scene.write(replaced, format, &|_| None, &mut out).unwrap().warnings;
    let (json, bin) = scenes::split(&out);
    (json, bin, warnings.into_iter().map(|w| w.text).collect())
}

/// Returns the mesh with a selection of its faces.
fn only(mesh: &TriMesh, wanted: impl Fn(usize) -> bool) -> TriMesh {
    let kept: Vec<usize> = (0..mesh.face_count()).filter(|&i| wanted(i)).collect();
    let triangles = kept.iter().map(|&i| mesh.triangles()[i]).collect();
    let map = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(WedgeId::new(w))).collect();
    let mut out = TriMesh::with_wedges(mesh.positions().clone(), map, triangles).unwrap();
    out.set_normals(mesh.normals().map(<[_]>::to_vec)).unwrap();
    out.set_uvs(mesh.uvs().map(<[_]>::to_vec)).unwrap();
    out.set_colors(mesh.colors().map(<[_]>::to_vec)).unwrap();
    mesh.further_attributes().iter().for_each(|a| out.add_attribute(a.clone()).unwrap());
    out.set_regions(mesh.regions().map(|r| kept.iter().map(|&i| r[i]).collect())).unwrap();
    out
}

/// Returns the bytes of a buffer view.
fn view<'b>(json: &Value, bin: &'b [u8], index: usize) -> &'b [u8] {
    let view = &json["bufferViews"][index];
    let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
    &bin[start..start + view["byteLength"].as_u64().unwrap() as usize]
}

fn view_of_accessor<'b>(json: &Value, bin: &'b [u8], index: &Value) -> &'b [u8] {
    let accessor = &json["accessors"][index.as_u64().unwrap() as usize];
    view(json, bin, accessor["bufferView"].as_u64().unwrap() as usize)
}

#[test]
fn an_untouched_scene_is_the_same() {
    let (mut json, bin) = everything();
    let (got, bytes, warnings) = written(&scene_of(&glb(&json, &bin)), &[], Format::Glb);
    assert_eq!((&got, bytes.as_slice()), (&json, bin.as_slice()));
    assert!(warnings.is_empty());
    // As text too: the keys are also in the same order.
    assert_eq!(got.to_string(), json.to_string());

    let (mut got, bytes, _) = written(&scene_of(&gltf(&json, &bin)), &[None], Format::Gltf);
    got["buffers"][0]["uri"] = Value::Null;
    json["buffers"][0]["uri"] = Value::Null;
    assert_eq!((got, bytes), (json, bin));
}

#[test]
fn numbers_keep_their_last_digit() {
    let (mut json, bin) = small();
    json["extras"] =
        json!({"a": 0.1, "b": 1.7976931348623157e308, "c": 123456789.12345679, "d": 9007199254740993u64});
    let (got, ..) = written(&scene_of(&glb(&json, &bin)), &[], Format::Glb);
    assert_eq!(got["extras"].to_string(), json["extras"].to_string());
}

#[test]
fn a_mesh_is_read_with_all_that_it_has() {
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let mesh = &scene.meshes()[0];
    assert_eq!((mesh.name.as_str(), mesh.instances, mesh.skinned), ("quad", 2, true));
    // Its joints are at the origin, whatever the scale of its nodes.
    assert!((mesh.scale - 1.0).abs() < 1e-12);
    let m = &mesh.mesh;
    // Two quads of four vertices that share an edge.
    assert_eq!((m.face_count(), m.wedge_count(), m.vertex_count()), (4, 8, 6));
    assert_eq!(m.regions().unwrap(), [0, 0, 2, 2].map(RegionId));
    assert!(m.normals().is_some());
    assert_eq!(m.uvs().unwrap()[1], [0.25, 0.75]);
    assert_eq!(m.uvs().unwrap()[4], [0.0, 1.0]);
    assert_eq!(m.colors().unwrap()[0], [1.0; 4]);
    assert_eq!(m.colors().unwrap()[4], [1.0, 0.0, 51.0 / 255.0, 1.0]);
    let further = |s: Semantic| m.further_attributes().iter().find(|a| a.semantic == s).unwrap();
    assert_eq!(further(Semantic::Joints(0)).values[..4], [0.0, 1.0, 0.0, 0.0]);
    assert_eq!(further(Semantic::Weights(0)).values[..4], [204.0 / 255.0, 51.0 / 255.0, 0.0, 0.0]);
    assert_eq!(further(Semantic::Custom("_HEAT".to_owned())).width, 1);
    let moved = further(Semantic::Morph { target: 0, of: Morphed::Position });
    assert_eq!(moved.values[..6], [0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    assert_eq!(scene.meshes()[1].name, "meshes[1]");
    assert_eq!((scene.meshes()[1].instances, scene.meshes()[1].scale), (0, 1.0));
    assert_eq!((scene.contents().skins, scene.contents().animations), (1, 1));
    assert_eq!(scene.contents().polygons, 8);
}

#[test]
fn a_mesh_replaced_by_itself_reads_the_same() {
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let same: Vec<_> = scene.meshes().iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
    for format in [Format::Glb, Format::Gltf] {
        let mut out = Vec::new();
        assert!(
            scene.write(&same, format, &|_| None, &mut out).unwrap().warnings.iter().all(|w| !w.data_lost)
        );
        let again = scene_of(&out);
        for (a, b) in scene.meshes().iter().zip(again.meshes()) {
            assert_eq!(a.mesh, b.mesh);
        }
    }
}

#[test]
fn what_is_not_replaced_stays() {
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let half = only(&scene.meshes()[0].mesh, |i| i % 2 == 0);
    let (got, bytes, warnings) = written(&scene, &[Some(half)], Format::Glb);
    assert!(warnings.is_empty(), "{warnings:?}");
    for key in json.as_object().unwrap().keys() {
        if !["meshes", "accessors", "bufferViews", "buffers"].contains(&key.as_str()) {
            assert_eq!(got[key].to_string(), json[key].to_string(), "{key}");
        }
    }
    assert_eq!(keys(&got), keys(&json));
    let (before, after) = (&json["meshes"][0], &got["meshes"][0]);
    assert_eq!(keys(before), keys(after));
    for p in 0..3 {
        let (before, after) = (&before["primitives"][p], &after["primitives"][p]);
        assert_eq!(keys(before), keys(after));
        assert_eq!(keys(&before["attributes"]), keys(&after["attributes"]));
        assert_eq!(before["material"], after["material"]);
        assert_eq!(before["extras"], after["extras"]);
    }
    // The line primitive is unchanged, and so is the other mesh, byte for byte.
    assert_eq!(before["primitives"][1], after["primitives"][1]);
    assert_eq!(json["meshes"][1], got["meshes"][1]);
    for old in [
        &json["meshes"][0]["primitives"][1]["attributes"]["POSITION"],
        &json["meshes"][1]["primitives"][0]["attributes"]["POSITION"],
        &json["animations"][0]["samplers"][0]["input"],
        &json["animations"][0]["samplers"][0]["output"],
        &json["skins"][0]["inverseBindMatrices"],
    ] {
        assert_eq!(view_of_accessor(&json, &bin, old), view_of_accessor(&got, &bytes, old));
    }
    let image = json["images"][0]["bufferView"].as_u64().unwrap() as usize;
    assert_eq!(view(&got, &bytes, image), PNG);
    // Component types are kept if they hold the values.
    let accessor = |key: &str, p: usize| {
        let index = after["primitives"][p]["attributes"][key].as_u64().unwrap() as usize;
        got["accessors"][index].clone()
    };
    assert_eq!(accessor("JOINTS_0", 0)["componentType"], 5121);
    assert_eq!(accessor("WEIGHTS_0", 0)["componentType"], 5121);
    assert_eq!(accessor("WEIGHTS_0", 0)["normalized"], true);
    assert_eq!(accessor("COLOR_0", 2)["type"], "VEC3");
    // The line primitive still uses the positions of the first primitive; the positions of the last are
    // replaced in place.
    assert_eq!(accessor("POSITION", 0)["name"], Value::Null);
    assert_eq!(accessor("POSITION", 2)["name"], "corners");
    assert_eq!(accessor("POSITION", 2)["count"], 3);
    assert_eq!(scene_of(&glb(&got, &bytes)).meshes()[0].mesh.face_count(), 2);
    // No unused bytes are left: only the positions of the first primitive exist twice.
    assert!(bytes.len() <= bin.len() + 48, "{} of {}", bytes.len(), bin.len());
}

fn keys(object: &Value) -> Vec<&str> {
    object.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn a_primitive_without_faces_goes() {
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let mesh = &scene.meshes()[0].mesh;
    let (got, bytes, warnings) = written(&scene, &[Some(only(mesh, |i| i < 2))], Format::Glb);
    assert_eq!(got["meshes"][0]["primitives"].as_array().unwrap().len(), 2);
    assert!(warnings[0].starts_with("meshes[0].primitives[2] has no faces left"), "{warnings:?}");
    // The renumbered references still refer to the same data.
    assert_eq!(view_of_accessor(&got, &bytes, &got["skins"][0]["inverseBindMatrices"]).len(), 128);
    let image = got["images"][0]["bufferView"].as_u64().unwrap() as usize;
    assert_eq!(view(&got, &bytes, image), PNG);
    let again = scene_of(&glb(&got, &bytes));
    assert_eq!(again.meshes()[1].mesh, scene.meshes()[1].mesh);
    assert_eq!(again.meshes()[0].mesh.face_count(), 2);
}

#[test]
fn many_without_faces_are_one_warning() {
    let (mut json, bin) = small();
    let primitive = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["primitives"] = vec![primitive; 6].into();
    let scene = scene_of(&glb(&json, &bin));
    let (.., warnings) = written(&scene, &[Some(only(&scene.meshes()[0].mesh, |i| i == 1))], Format::Glb);
    assert_eq!(
        warnings,
        ["5 primitives have no faces left: removed, with their materials: meshes[0].primitives[0], \
          meshes[0].primitives[2], meshes[0].primitives[3] and 2 more"]
    );
}

#[test]
fn a_mesh_without_faces_goes_with_its_name_on_nodes() {
    let (mut json, bin) = everything();
    // Without the line primitive, which would keep the mesh.
    json["meshes"][0]["primitives"].as_array_mut().unwrap().remove(1);
    let scene = scene_of(&glb(&json, &bin));
    let empty = only(&scene.meshes()[0].mesh, |_| false);
    let (got, bytes, warnings) = written(&scene, &[Some(empty)], Format::Glb);
    assert_eq!(got["meshes"].as_array().unwrap().len(), 1);
    assert!(got["nodes"].as_array().unwrap().iter().all(|n| n["mesh"].is_null() || n["mesh"] == 0));
    assert!(got["nodes"][0]["skin"].is_null());
    assert!(warnings.last().unwrap().starts_with("meshes[0] has no faces left"));
    assert_eq!(scene_of(&glb(&got, &bytes)).meshes()[0].mesh, scene.meshes()[1].mesh);

    let all: Vec<_> = scene.meshes().iter().map(|m| Some(only(&m.mesh, |_| false))).collect();
    let (got, ..) = written(&scene, &all, Format::Glb);
    assert!(got.get("meshes").is_none());
}

#[test]
fn removed_attributes_are_reported_and_new_ones_are_written() {
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let whole = &scene.meshes()[0].mesh;
    let mut bare = TriMesh::with_wedges(
        whole.positions().clone(),
        whole.vertex_map().unwrap().to_vec(),
        whole.triangles().to_vec(),
    )
    .unwrap();
    bare.set_regions(whole.regions().map(<[_]>::to_vec)).unwrap();
    let (got, bytes, warnings) = written(&scene, &[Some(bare)], Format::Glb);
    let lost = warnings.iter().find(|w| w.contains("no longer has")).unwrap();
    for name in ["NORMAL", "JOINTS_0", "_HEAT", "targets[0].POSITION"] {
        assert!(lost.contains(name), "{lost}");
    }
    assert!(got["nodes"][0]["skin"].is_null() && got["nodes"][2]["skin"].is_null());
    // The number of morph targets must match the mesh's weights: they are kept, with zero offsets.
    let again = scene_of(&glb(&got, &bytes));
    let morphs = again.meshes()[0].mesh.further_attributes();
    assert!(
        morphs
            .iter()
            .any(|a| matches!(a.semantic, Semantic::Morph { .. }) && a.values.iter().all(|&x| x == 0.0))
    );

    let (json, bin) = small();
    let scene = scene_of(&glb(&json, &bin));
    let mut mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    mesh.set_normals(Some(vec![[0.0, 0.0, 1.0]; mesh.wedge_count()])).unwrap();
    let (got, bytes, _) = written(&scene, &[Some(mesh.clone())], Format::Glb);
    assert_eq!(*scene_of(&glb(&got, &bytes)).meshes()[0].mesh, mesh);
}

#[test]
fn shared_accessors_stay_for_those_that_still_want_them() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let first = pack.indices(&[0, 1, 2]);
    let second = pack.indices(&[0, 2, 3]);
    let primitive = |i: usize| json!({"attributes": {"POSITION": positions}, "indices": i});
    let json = pack.json(json!({
        "meshes": [{"primitives": [primitive(first)]}, {"primitives": [primitive(second)]}, {"primitives": [primitive(first)]}],
        "nodes": [{"mesh": 0}, {"mesh": 1}, {"mesh": 2}],
        "scenes": [{"nodes": [0, 1, 2]}],
    }));
    let scene = scene_of(&glb(&json, &pack.bin));
    let whole = |i: usize| Some(TriMesh::clone(&scene.meshes()[i].mesh));
    let (got, bytes, _) = written(&scene, &[whole(0)], Format::Glb);
    assert_eq!(got["meshes"][1], json["meshes"][1]);
    assert_ne!(got["meshes"][0]["primitives"][0]["attributes"]["POSITION"], positions);
    let again = scene_of(&glb(&got, &bytes));
    (0..3).for_each(|i| assert_eq!(again.meshes()[i].mesh, scene.meshes()[i].mesh));

    // Equal data are shared again.
    let (got, ..) = written(&scene, &[whole(0), whole(1), whole(2)], Format::Glb);
    assert_eq!(got["meshes"][0], got["meshes"][2]);
    assert_eq!(got["meshes"][0]["primitives"][0]["attributes"]["POSITION"], positions);
}

#[test]
fn strips_and_fans_become_triangles() {
    let mut pack = Pack::default();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
    let positions = pack.positions(&corners);
    let json = pack.json(json!({"meshes": [{"primitives": [
        {"mode": 5, "attributes": {"POSITION": positions}},
        {"attributes": {"POSITION": positions}, "mode": 6},
    ]}]}));
    let scene = scene_of(&glb(&json, &pack.bin));
    let mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    assert_eq!((mesh.face_count(), mesh.vertex_count(), mesh.wedge_count()), (6, 5, 10));
    let (got, bytes, _) = written(&scene, &[Some(mesh.clone())], Format::Glb);
    assert_eq!(got["meshes"][0]["primitives"][0]["mode"], 4);
    assert_eq!(*scene_of(&glb(&got, &bytes)).meshes()[0].mesh, mesh);
}

#[test]
fn quantised_numbers_stay_so_where_they_can() {
    let mut pack = Pack::default();
    let positions = pack.push(
        "VEC3",
        5123,
        &[0u16, 0, 0, 0, 100, 0, 0, 0, 0, 100, 0, 0].map(u16::to_le_bytes).concat(),
        3,
    );
    pack.views.last_mut().unwrap()["byteStride"] = 8.into();
    let normals = pack.push("VEC3", 5120, &[0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0], 3);
    pack.views.last_mut().unwrap()["byteStride"] = 4.into();
    pack.accessors[positions]["min"] = json!([0, 0, 0]);
    pack.accessors[positions]["max"] = json!([100, 100, 0]);
    pack.accessors[normals]["normalized"] = true.into();
    let json = pack.json(json!({
        "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions, "NORMAL": normals}}]}],
        "nodes": [{"mesh": 0, "scale": [0.01, 0.01, 0.01]}],
    }));
    let scene = scene_of(&glb(&json, &pack.bin));
    let mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    let (got, bytes, _) = written(&scene, &[Some(mesh.clone())], Format::Glb);
    assert_eq!(got["accessors"][positions]["componentType"], 5123);
    assert_eq!(got["accessors"][normals]["componentType"], 5120);
    assert_eq!(*scene_of(&glb(&got, &bytes)).meshes()[0].mesh, mesh);

    let mut moved = mesh;
    moved.map_positions(|p| p.map(|x| x + 0.5));
    let (got, bytes, _) = written(&scene, &[Some(moved.clone())], Format::Glb);
    assert_eq!(got["accessors"][positions]["componentType"], 5126);
    assert_eq!(got["extensionsRequired"], json["extensionsRequired"]);
    assert_eq!(*scene_of(&glb(&got, &bytes)).meshes()[0].mesh, moved);
}

#[test]
fn external_files_are_listed_and_relinked() {
    let (mut json, bin) = small();
    json["images"] = json!([{"uri": "a%20b/c.png"}, {"uri": "data:image/png;base64,AA=="}, {"uri": "https://x/y.png"},
        {"uri": "a%20b/c.png"}]);
    json["extras"] = json!({"uri": "mine.txt"});
    let scene = scene_of(&gltf(&json, &bin));
    assert_eq!(scene.external_files(), ["a%20b/c.png"]);
    let mut out = Vec::new();
    scene.write(&[], Format::Gltf, &|uri| Some(format!("../{uri}")), &mut out).unwrap();
    let (got, _) = scenes::split(&out);
    assert_eq!(got["images"][0]["uri"], "../a%20b/c.png");
    assert_eq!(got["images"][1], json["images"][1]);
    assert_eq!(got["images"][2], json["images"][2]);
    assert_eq!(got["extras"], json["extras"]);
}

#[test]
fn an_image_of_its_own_is_taken_in() {
    let (mut json, bin) = everything();
    json["images"]
        .as_array_mut()
        .unwrap()
        .extend([json!({"name": "n", "uri": "x.jpg"}), json!({"uri": "x.jpg"})]);
    let mut scene = scene_of(&glb(&json, &bin));
    assert!(!scene.embed("y.jpg", PNG.to_vec()));
    assert!(!scene.embed("x.jpg", b"no image".to_vec()));
    assert!(scene.embed("x.jpg", PNG.to_vec()));
    assert!(scene.external_files().is_empty());
    let same = Some(TriMesh::clone(&scene.meshes()[0].mesh));
    let (got, bytes, _) = written(&scene, &[same], Format::Glb);
    assert_eq!(keys(&got["images"][1]), ["name", "bufferView", "mimeType"]);
    assert_eq!(got["images"][1]["mimeType"], "image/png");
    for i in 0..3 {
        assert_eq!(view(&got, &bytes, got["images"][i]["bufferView"].as_u64().unwrap() as usize), PNG);
    }
}

#[test]
fn a_file_of_another_format_is_no_scene() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert!(lodsmith_io::read_scene_bytes(obj, &ReadOptions::default()).unwrap().is_none());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, obj).unwrap();
    assert!(lodsmith_io::read_scene_path(&path, &ReadOptions::default()).unwrap().is_none());

    // The content decides, and compressed files are decompressed automatically.
    let (json, bin) = everything();
    let scene = scene_of(&glb(&json, &bin));
    let path = folder.path().join("b.glb.gz");
    let relink = |_: &str| None;
    lodsmith_io::write_scene_path(&scene, &[], &path, &lodsmith_io::WriteOptions::default(), &relink)
        .unwrap();
    let again = lodsmith_io::read_scene_path(&path, &ReadOptions::default()).unwrap().unwrap();
    assert_eq!(written(&again, &[], Format::Glb), written(&scene, &[], Format::Glb));
    let path = folder.path().join("c.ply");
    std::fs::write(&path, gltf(&json, &bin)).unwrap();
    let again = lodsmith_io::read_scene_path(&path, &ReadOptions::default()).unwrap().unwrap();
    assert!(again.warnings()[0].text.starts_with("the extension says PLY"));
    std::fs::write(&path, b"glTF\x02").unwrap();
    let error = lodsmith_io::read_scene_path(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("c.ply: the GLB is cut off"), "{error}");
}

#[test]
fn several_buffers_become_one() {
    let (mut json, bin) = everything();
    let at = bin.len() / 2 / 8 * 8;
    let uri = scenes::data_uri(&bin);
    // The case of a scheme does not matter.
    let capital = uri.replacen("data:", "DATA:", 1);
    json["buffers"] = json!([{"byteLength": bin.len(), "uri": uri}, {"byteLength": bin.len(), "uri": capital, "name": "b"}]);
    for view in json["bufferViews"].as_array_mut().unwrap().iter_mut() {
        if view["byteOffset"].as_u64().unwrap() as usize >= at {
            view["buffer"] = 1.into();
        }
    }
    let scene = scene_of(json.to_string().as_bytes());
    let (got, bytes, _) = written(&scene, &[], Format::Glb);
    assert_eq!(got["buffers"].as_array().unwrap().len(), 1);
    let again = scene_of(&glb(&got, &bytes));
    for (a, b) in scene.meshes().iter().zip(again.meshes()) {
        assert_eq!(a.mesh, b.mesh);
    }
}

#[test]
fn instances_of_an_extension_are_counted() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let places = pack.positions(&[[0.0; 3]; 5]);
    let scales = pack.positions(&[[1.0; 3], [1.0, 4.0, 1.0], [1.0; 3], [1.0; 3], [1.0; 3]]);
    let json = pack.json(json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"], "extensionsRequired": ["EXT_mesh_gpu_instancing"],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
        "nodes": [{"mesh": 0, "scale": [2, 2, 2], "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
            {"TRANSLATION": places, "SCALE": scales}}}}],
    }));
    let scene = scene_of(&glb(&json, &pack.bin));
    assert_eq!((scene.meshes()[0].instances, scene.meshes()[0].scale), (5, 8.0));
    let gone = only(&scene.meshes()[0].mesh, |_| false);
    let (got, ..) = written(&scene, &[Some(gone)], Format::Glb);
    assert_eq!(got["nodes"][0], json!({"scale": [2, 2, 2]}));
}

#[test]
fn errors_name_what_cannot_be_read_or_written() {
    let (mut json, bin) = small();
    let refused =
        |json: &Value| Scene::read(&glb(json, &bin), &ReadOptions::default()).unwrap_err().to_string();
    json["extensionsRequired"] = json!(["VENDOR_folded_geometry"]);
    assert!(refused(&json).contains("VENDOR_folded_geometry"));
    json["extensionsRequired"] = Value::Null;
    json["accessors"][0]["count"] = 1000.into();
    assert!(refused(&json).starts_with("accessors[0]: "), "{}", refused(&json));
    json["buffers"][0]["uri"] = "outside.bin".into();
    assert!(matches!(
        Scene::read(&glb(&json, &bin), &ReadOptions::default()),
        Err(ReadError::Malformed { .. })
    ));

    let (json, bin) = small();
    let scene = scene_of(&glb(&json, &bin));
    let mut mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    let fails = |replaced: &[Option<TriMesh>], format: Format| {
        scene.write(replaced, format, &|_| None, &mut Vec::new()).unwrap_err().to_string()
    };
    assert!(fails(&[], Format::Obj).contains("OBJ"));
    assert!(fails(&[None, Some(mesh.clone())], Format::Glb).contains("meshes[1]"));
    mesh.set_regions(Some(vec![RegionId(7); mesh.face_count()])).unwrap();
    assert!(fails(&[Some(mesh)], Format::Glb).contains("region 7"));
}

/// Replaces every number of the JSON in turn, and every byte of its text.
#[test]
fn damaged_scenes_get_an_answer() {
    let (json, bin) = everything();
    let rewrite = |bytes: &[u8]| {
        let Ok(scene) = Scene::read(bytes, &ReadOptions::default()) else { return };
        let same: Vec<_> = scene.meshes().iter().map(|m| Some(TriMesh::clone(&m.mesh))).collect();
        let none: Vec<_> = scene.meshes().iter().map(|m| Some(only(&m.mesh, |_| false))).collect();
        for replaced in [&same[..], &none, &[]] {
            let mut out = Vec::new();
            let _ = scene.write(replaced, Format::Glb, &|_| None, &mut out);
        }
    };
    let count = numbers(&mut json.clone(), usize::MAX, &Value::Null);
    for at in 0..count {
        for new in [
            json!(0),
            json!(1),
            json!(3),
            json!(7),
            json!(-1),
            json!(4294967295u32),
            json!(5125),
            json!(0.5),
            json!("x"),
            json!({}),
            Value::Null,
        ] {
            let mut damaged = json.clone();
            numbers(&mut damaged, at, &new);
            rewrite(&glb(&damaged, &bin));
        }
    }
    let whole = glb(&json, &bin);
    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    for _ in 0..3000 {
        let mut bytes = whole.clone();
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let at = (random >> 33) as usize % bytes.len();
        bytes[at] = (random >> 20) as u8;
        rewrite(&bytes);
        rewrite(&bytes[..at]);
    }
}

/// Replaces one number; returns the count of numbers.
fn numbers(json: &mut Value, at: usize, new: &Value) -> usize {
    fn walk(value: &mut Value, next: &mut usize, at: usize, new: &Value) {
        match value {
            Value::Number(_) => {
                if *next == at {
                    *value = new.clone();
                }
                *next += 1;
            }
            Value::Array(all) => all.iter_mut().for_each(|v| walk(v, next, at, new)),
            Value::Object(all) => all.values_mut().for_each(|v| walk(v, next, at, new)),
            _ => {}
        }
    }
    let mut next = 0;
    walk(json, &mut next, at, new);
    next
}

/// The placements of all copies are listed: a run needs them to keep copies together where they touch.
#[test]
fn copies_of_a_mesh_have_their_placements() {
    let (mut json, bin) = small();
    json["meshes"] = json!([json["meshes"][0], json["meshes"][0], json["meshes"][0]]);
    json["nodes"] = json!([
        { "mesh": 0, "translation": [1, 2, 3] },
        { "mesh": 0, "scale": [-1, 1, 1] },
        { "mesh": 1, "skin": 0 },
    ]);
    json["skins"] = json!([{ "joints": [0] }]);
    json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
    json["scene"] = 0.into();
    let scene = scene_of(&gltf(&json, &bin));
    let [copied, skinned, unplaced] = scene.meshes() else { panic!("three meshes") };
    let moved = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];
    let mirrored = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    assert_eq!((copied.instances, &copied.places), (2, &vec![moved, mirrored]));
    assert!(skinned.places.is_empty() && unplaced.places.is_empty());
}
