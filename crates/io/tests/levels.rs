//! Levels of detail in one glTF file: the written structure, and readers that do not count them twice.

use std::collections::BTreeSet;

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::{Scene, SceneLevels};
use lodsmith_io::{Format, ReadOptions, read_bytes};
use serde_json::{Value, json};

use crate::scenes::{self, everything, glb, gltf, split};

/// Returns the mesh without its last face.
pub(crate) fn without_last_face(mesh: &TriMesh) -> TriMesh {
    let mut triangles = mesh.triangles().to_vec();
    triangles.pop();
    let wedges = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(lodsmith_core::WedgeId::new(w)));
    let mut lighter =
        TriMesh::with_wedges(mesh.positions().clone(), wedges.collect(), triangles.clone()).unwrap();
    lighter.set_normals(mesh.normals().map(<[_]>::to_vec)).unwrap();
    lighter.set_uvs(mesh.uvs().map(<[_]>::to_vec)).unwrap();
    lighter.set_colors(mesh.colors().map(<[_]>::to_vec)).unwrap();
    for a in mesh.further_attributes() {
        lighter.add_attribute(a.clone()).unwrap();
    }
    let regions = mesh.regions().map(|r| r[..triangles.len()].to_vec());
    lighter.set_regions(regions).unwrap();
    lighter
}

fn written(scene: &Scene, levels: &SceneLevels) -> Value {
    let mut bytes = Vec::new();
    scene.write_levels(levels, Format::Glb, &|_| None, &mut bytes).unwrap();
    split(&bytes).0
}

/// Returns the complete scene, with two simplified levels of its first mesh.
fn with_levels() -> (Scene, SceneLevels) {
    let (json, bin) = everything();
    let scene = Scene::read(&gltf(&json, &bin), &ReadOptions::default()).unwrap();
    let first = without_last_face(&scene.meshes()[0].mesh);
    let second = without_last_face(&first);
    let mut levels = SceneLevels::new(vec![Vec::new(), vec![Some(first)], vec![Some(second)]]);
    levels.coverage = vec![vec![0.5, 0.1, 0.0]];
    (scene, levels)
}

#[test]
fn nodes_name_their_levels() {
    let (scene, levels) = with_levels();
    let json = written(&scene, &levels);
    let (source, _) = everything();
    let nodes = json["nodes"].as_array().unwrap();
    let hosts: Vec<&Value> = nodes.iter().filter(|n| !n["extensions"]["MSFT_lod"].is_null()).collect();
    assert_eq!(hosts.len(), 2, "both nodes of the mesh have levels");
    for host in hosts {
        assert_eq!(host["extras"]["MSFT_screencoverage"], json!([0.5, 0.1, 0.0]));
        let ids = host["extensions"]["MSFT_lod"]["ids"].as_array().unwrap();
        assert_eq!(ids.len(), 2);
        for (k, id) in ids.iter().enumerate() {
            let level = &nodes[id.as_u64().unwrap() as usize];
            for key in ["translation", "rotation", "scale", "matrix", "skin", "weights"] {
                assert_eq!(level[key], host[key], "{key}");
            }
            let mesh = &json["meshes"][level["mesh"].as_u64().unwrap() as usize];
            assert_eq!(mesh["name"], format!("quad_LOD{}", k + 1));
            assert!(level["name"].as_str().unwrap().ends_with(&format!("_LOD{}", k + 1)));
            let own = mesh["primitives"].as_array().unwrap().iter().map(|p| p["material"].clone());
            let all: BTreeSet<String> = own.map(|m| m.to_string()).collect();
            assert!(all.is_subset(&BTreeSet::from(["0", "1", "null"].map(str::to_owned))));
        }
    }
    assert!(json["extensionsUsed"].as_array().unwrap().contains(&json!("MSFT_lod")));
    for shared in ["materials", "textures", "skins", "cameras", "scenes"] {
        assert_eq!(
            json[shared].as_array().map(Vec::len),
            source[shared].as_array().map(Vec::len),
            "{shared}"
        );
    }
}

#[test]
fn levels_are_morphed_by_the_same_animation() {
    let (scene, levels) = with_levels();
    let json = written(&scene, &levels);
    let nodes = json["nodes"].as_array().unwrap();
    let morphed: BTreeSet<u64> = json["animations"][0]["channels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["target"]["node"].as_u64().unwrap())
        .collect();
    let host = &nodes[*morphed.first().unwrap() as usize];
    let ids = host["extensions"]["MSFT_lod"]["ids"].as_array().unwrap();
    assert!(ids.iter().all(|id| morphed.contains(&id.as_u64().unwrap())));
}

#[test]
fn readers_without_the_extension_see_level_0() {
    let (scene, levels) = with_levels();
    let mut bytes = Vec::new();
    scene.write_levels(&levels, Format::Glb, &|_| None, &mut bytes).unwrap();
    let again = Scene::read(&bytes, &ReadOptions::default()).unwrap();
    assert!(again.has_levels() && !scene.has_levels());
    assert_eq!(again.contents().polygons, scene.contents().polygons);
    let placed = |s: &Scene| s.meshes().iter().map(|m| m.instances).sum::<usize>();
    assert_eq!(placed(&again), placed(&scene));
    let loaded = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.mesh.face_count(), scene.contents().polygons);
    // One mesh was not instantiated before; meshes of levels are not counted with it.
    let unplaced = "1 mesh is not placed in the default scene: dropped";
    assert!(loaded.warnings.iter().any(|w| w.text == unplaced), "{:?}", loaded.warnings);
}

#[test]
fn levels_of_levels_are_refused() {
    let (scene, levels) = with_levels();
    let mut bytes = Vec::new();
    scene.write_levels(&levels, Format::Glb, &|_| None, &mut bytes).unwrap();
    let again = Scene::read(&bytes, &ReadOptions::default()).unwrap();
    let got = again.write_levels(&levels, Format::Glb, &|_| None, &mut Vec::new());
    assert!(got.unwrap_err().to_string().contains("already has levels of detail"));
}

#[test]
fn a_node_that_moves_hands_its_mesh_to_a_child() {
    let (mut json, bin) = everything();
    json["animations"][0]["channels"][0]["target"] = json!({"node": 2, "path": "translation"});
    let output = json["animations"][0]["samplers"][0]["input"].clone();
    json["animations"][0]["samplers"][0]["output"] = output;
    json["nodes"][2]["children"] = json!([]);
    json["nodes"][2].as_object_mut().unwrap().remove("children");
    let scene = Scene::read(&gltf(&json, &bin), &ReadOptions::default()).unwrap();
    let (_, levels) = with_levels();
    let got = written(&scene, &levels);
    let node = &got["nodes"][2];
    assert!(node["mesh"].is_null() && node["skin"].is_null(), "{node}");
    let child = &got["nodes"][node["children"][0].as_u64().unwrap() as usize];
    assert_eq!((&child["mesh"], &child["skin"]), (&json!(0), &json!(0)));
    assert_eq!(child["extensions"]["MSFT_lod"]["ids"].as_array().unwrap().len(), 2);
    assert_eq!(node["extras"], json!({"kept": true}));
}

#[test]
fn a_file_without_scenes_gets_one() {
    let (mut json, bin) = scenes::small();
    json.as_object_mut().unwrap().retain(|k, _| k != "scenes" && k != "scene");
    json["nodes"] = json!([{ "mesh": 0 }]);
    let scene = Scene::read(&gltf(&json, &bin), &ReadOptions::default()).unwrap();
    let same = TriMesh::clone(&scene.meshes()[0].mesh);
    let levels = SceneLevels::new(vec![Vec::new(), vec![Some(same)]]);
    let got = written(&scene, &levels);
    assert_eq!(got["scenes"], json!([{ "nodes": [0] }]));
    assert_eq!(got["nodes"].as_array().unwrap().len(), 2);
}

#[test]
fn named_values_go_into_ply() {
    use lodsmith_core::{Attribute, Semantic};
    let (json, bin) = scenes::small();
    let scene = Scene::read(&glb(&json, &bin), &ReadOptions::default()).unwrap();
    let mut mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    let add = |mesh: &mut TriMesh, name: &str, width: usize, values: Vec<f32>| {
        let semantic = Semantic::Custom(name.to_owned());
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    };
    add(&mut mesh, "_GEOMORPH", 3, (0..9).map(|i| i as f32).collect());
    add(&mut mesh, "_X", 1, vec![7.0; 3]);
    let mut options = lodsmith_io::WriteOptions::default();
    options.ascii = true;
    let mut bytes = Vec::new();
    lodsmith_io::write_to(&mesh, Format::Ply, &options, &mut bytes).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    for name in ["geomorph_x", "geomorph_y", "geomorph_z", "x_"] {
        assert!(text.contains(&format!("property float {name}\n")), "{text}");
    }
    assert!(text.lines().any(|l| l.ends_with(" 3 4 5 7")), "{text}");
    let again = read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(again.mesh.face_count(), 1);
}
