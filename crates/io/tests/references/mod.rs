//! References inside extensions: after every job they name the same elements, or what has them is a counted loss.
//!
//! The tests do not know the table of the crate: each case says by name what its extension refers to.

mod cases;
mod dangling;

use std::collections::BTreeSet;
use std::sync::Arc;

use lodsmith_core::TriMesh;
use lodsmith_core::model::Material;
use lodsmith_io::gltf::{
    Compression, CopyPlace, NewMaterial, Packing, Scene, SceneFormat, SceneLevels, SlotImage, TextureSlot,
};
use lodsmith_io::{Format, ReadOptions, Warning};
use serde_json::{Value, json};

use crate::levels::without_last_face;
use crate::scenes::{PNG, Pack, everything, glb, split};
use cases::Case;
use dangling::{dangling, new_dangling};

/// A job: its letter in [`Case::lost_in`], and what it makes of a scene.
type Job = (char, fn(&mut Scene) -> (Vec<u8>, Vec<Warning>));

/// The jobs that each scene goes through.
const JOBS: [Job; 5] = [('s', simplify), ('l', levels), ('m', compress), ('q', quantize), ('b', bake)];

/// Returns a scene of three meshes: "gone" will lose its faces, "main" has all attributes and a morph target, and
/// "third" stays as it is. Before every element that cases name there is another one, so that numbers change.
fn base() -> (Value, Pack) {
    let mut pack = Pack::default();
    let name = |pack: &mut Pack, accessor: usize, name: &str| pack.accessors[accessor]["name"] = name.into();
    let gone = pack.positions(&[[9.0, 0.0, 0.0], [9.5, 0.0, 0.0], [9.0, 0.5, 0.0]]);
    let points: Vec<[f32; 3]> = (0..9).map(|i| [(i % 3) as f32, (i / 3) as f32, 0.0]).collect();
    let positions = pack.positions(&points);
    name(&mut pack, positions, "positions");
    let uvs: Vec<f32> = points.iter().flat_map(|p| [p[0] / 2.0, p[1] / 2.0]).collect();
    let uvs = pack.floats("VEC2", 2, &uvs);
    let heat = pack.floats("SCALAR", 1, &[0.5; 9]);
    let features = pack.floats("SCALAR", 1, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    let morph = pack.floats("VEC3", 3, &[0.25; 27]);
    let corners: Vec<u16> = (0..4u16)
        .flat_map(|i| {
            let a = i % 2 + 3 * (i / 2);
            [a, a + 1, a + 4, a, a + 4, a + 3]
        })
        .collect();
    let indices = pack.indices(&corners);
    let triangles = pack.indices(&corners);
    name(&mut pack, triangles, "triangles");
    let third = pack.positions(&[[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]]);
    let times = pack.floats("SCALAR", 1, &[0.0, 1.0]);
    let values = pack.floats("SCALAR", 1, &[0.0, 1.0]);
    let edges = pack.indices(&[0, 1, 3, 4]);
    name(&mut pack, edges, "edges");
    let places = pack.floats("VEC3", 3, &[0.0, 0.0, 0.0, 3.0, 0.0, 0.0]);
    name(&mut pack, places, "places");
    let ids = pack.floats("SCALAR", 1, &[4.0, 5.0]);
    name(&mut pack, ids, "ids");
    let images = [pack.view(PNG), pack.view(&[PNG, b"2"].concat())];
    for (what, bytes) in [("table", &[1u8; 16][..]), ("offsets", &[2; 8])] {
        let view = pack.view(bytes);
        pack.views[view]["name"] = what.into();
    }
    let json = pack.json(json!({
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2, 4]}],
        "nodes": [
            {"name": "gone", "mesh": 0}, {"name": "main", "mesh": 1}, {"name": "bone", "children": [3]},
            {"name": "tip"}, {"name": "third", "mesh": 2}, {"name": "far", "mesh": 2},
        ],
        "meshes": [
            {"name": "gone", "weights": [0.0], "primitives": [{"attributes": {"POSITION": gone},
                "targets": [{"POSITION": gone}], "material": 1}]},
            {"name": "main", "weights": [0.0], "primitives": [{
                "attributes": {"POSITION": positions, "TEXCOORD_0": uvs, "_HEAT": heat, "_FEATURE_ID_0": features},
                "targets": [{"POSITION": morph}], "indices": indices, "material": 1}]},
            {"name": "third", "primitives": [{"attributes": {"POSITION": third}, "material": 2}]},
        ],
        "materials": [
            {"name": "odd"}, {"name": "main"}, {"name": "other", "normalTexture": {"index": 1}},
        ],
        "textures": [{"name": "unused", "source": 0}, {"name": "coat", "source": 1}],
        "images": [
            {"name": "unused", "bufferView": images[0], "mimeType": "image/png"},
            {"name": "picture", "bufferView": images[1], "mimeType": "image/png"},
        ],
        "animations": [{"name": "moves", "samplers": [{"input": times, "output": values}], "channels": [
            {"sampler": 0, "target": {"node": 1, "path": "weights"}}, {"sampler": 0, "target": {"path": "pointer"}},
        ]}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    }));
    (json, pack)
}

/// Returns the name of the extension of a case, which may be followed by a remark.
fn extension(case: &Case) -> &'static str {
    case.name.split(' ').next().unwrap()
}

/// Returns the pointer to the element that has an extension; `None` if it is not there.
fn host(json: &Value, host: &str) -> Option<String> {
    let at = |list: &str, name: &str| index(json, list, name).map(|i| format!("/{list}/{i}"));
    match host {
        "root" => Some(String::new()),
        "mesh" => at("meshes", "main"),
        "primitive" => Some(format!("{}/primitives/0", at("meshes", "main")?)),
        "channel" => {
            let channels = json["animations"][0]["channels"].as_array()?;
            let at = channels.iter().position(|c| c["target"]["path"] == "pointer")?;
            Some(format!("/animations/0/channels/{at}/target"))
        }
        other => other.split_once('/').and_then(|(list, name)| at(list, name)),
    }
}

fn index(json: &Value, list: &str, name: &str) -> Option<usize> {
    json[list].as_array()?.iter().position(|x| x["name"] == name)
}

/// Returns a value with numbers in place of names.
fn with_numbers(value: &Value, json: &Value) -> Value {
    let number = |text: &str| {
        let (list, name) = text.split_once('/').unwrap();
        index(json, list, name).unwrap_or_else(|| panic!("no {text}"))
    };
    match value {
        Value::String(text) if text.starts_with(['@', '=']) => number(&text[1..]).into(),
        Value::String(text) if text.contains("/@") => {
            let (list, rest) = text.split_once("/@").unwrap();
            let end = rest.match_indices('/').nth(1).map_or(rest.len(), |(at, _)| at);
            format!("{list}/{}{}", number(&rest[..end]), &rest[end..]).into()
        }
        Value::Array(all) => all.iter().map(|v| with_numbers(v, json)).collect(),
        Value::Object(all) => all.iter().map(|(k, v)| (k.clone(), with_numbers(v, json))).collect(),
        other => other.clone(),
    }
}

/// Returns the scene of a case.
fn file(case: &Case) -> Vec<u8> {
    let (mut json, pack) = base();
    let mut used = BTreeSet::from(["KHR_lights_punctual"]);
    let name = extension(case);
    for (at, content) in &case.parts {
        let content = with_numbers(content, &json);
        let at = host(&json, at).unwrap();
        json.pointer_mut(&at).unwrap()["extensions"][name] = content;
        used.insert(name);
    }
    if name == "EXT_instance_features" {
        let places = index(&json, "accessors", "places").unwrap();
        json["nodes"][4]["extensions"]["EXT_mesh_gpu_instancing"] =
            json!({"attributes": {"TRANSLATION": places}});
        used.insert("EXT_mesh_gpu_instancing");
    }
    if name != "KHR_animation_pointer" {
        json["animations"][0]["channels"].as_array_mut().unwrap().pop();
    }
    json["extensionsUsed"] = json!(used);
    glb(&json, &pack.bin)
}

/// A reference by name: the path to it with `*` for places in lists, and the list and name of what it names.
type Named = (String, String, String);

/// Collects the references of a template.
fn named_in(template: &Value, path: &str, out: &mut BTreeSet<Named>) {
    match template {
        Value::String(text) if text.starts_with(['@', '=']) => {
            let (list, name) = text[1..].split_once('/').unwrap();
            out.insert((path.to_owned(), format!("{}{list}", &text[..1]), name.to_owned()));
        }
        Value::String(text) if text.starts_with('/') => {
            let parts: Vec<&str> = text.split('/').collect();
            let list =
                if parts[4] == "weights" { format!("={}", parts[1]) } else { format!("@{}", parts[1]) };
            out.insert((path.to_owned(), list, parts[3].to_owned()));
        }
        Value::Array(all) => all.iter().for_each(|v| named_in(v, &format!("{path}/*"), out)),
        Value::Object(all) => all.iter().for_each(|(k, v)| named_in(v, &format!("{path}/{k}"), out)),
        _ => {}
    }
}

/// Collects the references of an extension in a file, at paths of `expected`; panics at one that names nothing.
fn named_at(
    json: &Value,
    content: &Value,
    path: &str,
    expected: &BTreeSet<Named>,
    out: &mut BTreeSet<Named>,
) {
    match content {
        Value::Array(all) => all.iter().for_each(|v| named_at(json, v, &format!("{path}/*"), expected, out)),
        Value::Object(all) => {
            all.iter().for_each(|(k, v)| named_at(json, v, &format!("{path}/{k}"), expected, out));
        }
        _ => {
            let Some((_, list, _)) = expected.iter().find(|(at, ..)| at == path) else { return };
            let number = match content.as_str() {
                Some(pointer) => pointer.split('/').nth(2).unwrap().parse().unwrap(),
                None => content.as_u64().unwrap() as usize,
            };
            out.insert((path.to_owned(), list.clone(), name_of(json, list, number)));
        }
    }
}

/// Returns the name of an element without the mark of its level. A node that is named for its mesh (`=`) has one, and may
/// be a child without a name.
fn name_of(json: &Value, list: &str, number: usize) -> String {
    let (is_of_mesh, list) = (list.starts_with('='), &list[1..]);
    let mut element = &json[list][number];
    assert!(element.is_object(), "{list}[{number}] does not exist: {json:#}");
    if is_of_mesh && list == "nodes" {
        assert!(!element["mesh"].is_null(), "nodes[{number}] has no mesh: {json:#}");
        let parents = json["nodes"].as_array().unwrap();
        let is_child = |p: &&Value| p["children"].as_array().is_some_and(|c| c.contains(&number.into()));
        if element["name"].is_null() {
            element = parents.iter().find(is_child).unwrap();
        }
    }
    let name = element["name"].as_str().unwrap_or_else(|| panic!("{list}[{number}] has no name: {json:#}"));
    name.split("_LOD").next().unwrap().to_owned()
}

fn write(scene: &Scene, replaced: &[Option<TriMesh>], packing: Packing) -> (Vec<u8>, Vec<Warning>) {
    let mut out = Vec::new();
    let to = SceneFormat::new(Format::Glb, packing);
    let written = scene.write(replaced, to, &|_| None, &mut out).unwrap();
    (out, written.warnings)
}

fn simplify(scene: &mut Scene) -> (Vec<u8>, Vec<Warning>) {
    let mut gone = (*scene.meshes()[0].mesh).clone();
    for _ in 0..gone.face_count() {
        gone = without_last_face(&gone);
    }
    let lighter = without_last_face(&scene.meshes()[1].mesh);
    write(scene, &[Some(gone), Some(lighter)], Packing::default())
}

fn levels(scene: &mut Scene) -> (Vec<u8>, Vec<Warning>) {
    let first = without_last_face(&scene.meshes()[1].mesh);
    let second = without_last_face(&first);
    let levels = SceneLevels::new(vec![Vec::new(), vec![None, Some(first)], vec![None, Some(second)]]);
    let mut out = Vec::new();
    match scene.write_levels(&levels, Format::Glb, &|_| None, &mut out) {
        Ok(written) => (out, written.warnings),
        // A scene that has levels already is refused.
        Err(_) => (Vec::new(), Vec::new()),
    }
}

fn compress(scene: &mut Scene) -> (Vec<u8>, Vec<Warning>) {
    write(scene, &[], Packing::new(Compression::Meshopt, false))
}

fn quantize(scene: &mut Scene) -> (Vec<u8>, Vec<Warning>) {
    write(scene, &[], Packing::new(Compression::None, true))
}

fn bake(scene: &mut Scene) -> (Vec<u8>, Vec<Warning>) {
    let image =
        SlotImage { slot: TextureSlot::BaseColor, name: "baked".to_owned(), png: Arc::new(PNG.to_vec()) };
    let look = Material { name: "baked".to_owned(), ..Material::default() };
    let material = scene.add_material(&NewMaterial::new(look, None, vec![image]));
    scene.set_material(0, None, material);
    scene.set_material(1, None, material);
    scene.drop_unused_materials();
    write(scene, &[], Packing::default())
}

/// Returns the references of a case in a written file, and whether all of its extensions are there.
fn found(case: &Case, json: &Value, expected: &BTreeSet<Named>) -> (BTreeSet<Named>, bool) {
    let (mut found, mut is_there) = (BTreeSet::new(), true);
    for (at, _) in &case.parts {
        // An extension of a node's mesh may have moved to a child with it.
        let content =
            host(json, at).map(|at| json.pointer(&at).unwrap()["extensions"][extension(case)].clone());
        match content.filter(|content| !content.is_null()) {
            Some(content) => named_at(json, &content, at, expected, &mut found),
            None => is_there = false,
        }
    }
    (found, is_there)
}

#[test]
fn references_in_extensions_name_the_same_or_are_counted_as_lost() {
    let (mut kept, mut problems) = (BTreeSet::new(), Vec::new());
    for case in cases::all() {
        let mut expected = BTreeSet::new();
        case.parts.iter().for_each(|(at, content)| named_in(content, at, &mut expected));
        let file = file(&case);
        for (letter, job) in JOBS {
            let mut scene = Scene::read(&file, &ReadOptions::default()).unwrap();
            let (bytes, warnings) = job(&mut scene);
            if bytes.is_empty() {
                assert_eq!((letter, case.name), ('l', "MSFT_lod"));
                continue;
            }
            let json = split(&bytes).0;
            // Some cases refer to lists of other extensions, which they do not have.
            let (before, after) = (dangling(&split(&file).0), dangling(&json));
            assert!(
                after.keys().all(|kind| before.contains_key(kind)),
                "{} in {letter}: {after:?}",
                case.name
            );
            let (found, is_there) = found(&case, &json, &expected);
            let title = format!("{} in {letter}: {warnings:?} {json:#}", case.name);
            let is_lost = case.lost_in.contains(letter);
            assert!(found.is_subset(&expected), "{title}\nexpected {expected:?}\nfound {found:?}");
            // The mesh of level 0 stays, and only its copies lose what describes vertices.
            let is_whole = is_there && found == expected;
            let named: Vec<&Warning> =
                warnings.iter().filter(|w| w.text.contains(extension(&case))).collect();
            let used = json["extensionsUsed"].as_array().cloned().unwrap_or_default();
            let remains = json.to_string().contains(&format!("\"{}\":", extension(&case)));
            if is_whole != (!is_lost || letter == 'l')
                || named.len() != usize::from(is_lost)
                || !named.iter().all(|w| w.data_lost)
                || used.contains(&extension(&case).into()) != remains
            {
                problems.push(format!("{} in {letter}: lost {is_lost}, whole {is_whole}, found {found:?}, used {used:?}, {warnings:?}", case.name));
            }
            if !is_lost {
                kept.insert((extension(&case), letter));
            }
            // It can be read again, and nothing is lost a second time.
            Scene::read(&bytes, &ReadOptions::default()).unwrap();
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    let everywhere: BTreeSet<&str> = kept.iter().map(|(name, _)| *name).collect();
    let count = |name: &&&str| JOBS.iter().all(|(letter, _)| kept.contains(&(**name, *letter)));
    assert!(everywhere.iter().filter(count).count() >= 25, "{everywhere:?}");
}

/// Returns the JSON of a written scene, after a change of the base.
fn written(change: impl Fn(&mut Value), job: fn(&mut Scene) -> (Vec<u8>, Vec<Warning>)) -> Value {
    let (mut json, pack) = base();
    json["animations"][0]["channels"].as_array_mut().unwrap().pop();
    change(&mut json);
    let mut scene = Scene::read(&glb(&json, &pack.bin), &ReadOptions::default()).unwrap();
    split(&job(&mut scene).0).0
}

#[test]
fn a_shape_of_a_body_keeps_its_coordinates() {
    let shape = |json: &mut Value| {
        json["extensions"]["OMI_physics_shape"] = json!({"shapes": [{"trimesh": {"mesh": 1}}]});
        json["nodes"][2]["extensions"]["KHR_physics_rigid_bodies"] =
            json!({"collider": {"geometry": {"node": 4}}});
    };
    let component = |json: &Value, mesh: usize| {
        let accessor =
            json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
        json["accessors"][accessor]["componentType"].as_u64().unwrap()
    };
    const FLOAT: u64 = 5126;
    let json = written(shape, quantize);
    assert_eq!([0, 1, 2].map(|mesh| component(&json, mesh) == FLOAT), [false, true, true]);
    let json = written(|_| (), quantize);
    assert_eq!([0, 1, 2].map(|mesh| component(&json, mesh) == FLOAT), [false; 3]);
}

#[test]
fn a_node_that_a_pointer_moves_keeps_its_transform() {
    let change = |json: &mut Value| {
        // Without names, the transforms of nodes may contain the grid.
        for node in [0, 1] {
            json["nodes"][node].as_object_mut().unwrap().remove("name");
        }
        let target = json!({"path": "pointer",
            "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/translation"}}});
        json["animations"][0]["channels"] = json!([{"sampler": 0, "target": target}]);
    };
    let json = written(change, quantize);
    assert!(json["nodes"][0]["mesh"].is_null() && json["nodes"][0]["scale"].is_null(), "{json:#}");
    assert_eq!(json["nodes"][1]["mesh"], 1);
    assert!(!json["nodes"][1]["scale"].is_null());
}

#[test]
fn instances_move_with_their_features_to_the_levels() {
    let change = |json: &mut Value| {
        let places = index(json, "accessors", "places").unwrap();
        json["nodes"][1]["extensions"] = json!({
            "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}},
            "EXT_instance_features": {"featureIds": [{"featureCount": 2}]},
        });
        json["nodes"][2]["extensions"] =
            json!({"VRMC_node_constraint": {"constraint": {"roll": {"source": 1}}}});
    };
    let json = written(change, levels);
    let main = &json["nodes"][1];
    assert!(main["extensions"].is_null() && main["mesh"].is_null(), "{json:#}");
    let host = &json["nodes"][main["children"][0].as_u64().unwrap() as usize];
    let mut all = vec![host];
    let ids = host["extensions"]["MSFT_lod"]["ids"].as_array().unwrap().iter();
    all.extend(ids.map(|id| &json["nodes"][id.as_u64().unwrap() as usize]));
    assert_eq!(all.len(), 3);
    for node in all {
        for name in ["EXT_mesh_gpu_instancing", "EXT_instance_features"] {
            assert!(!node["extensions"][name].is_null(), "{name}: {json:#}");
        }
    }
}

#[test]
fn copies_of_nodes_refer_to_the_copies() {
    let (mut json, pack) = base();
    json["nodes"][2]["extensions"] = json!({"VRMC_node_constraint": {"constraint": {"roll": {"source": 1}}}});
    json["animations"][0]["channels"][1] = json!({"sampler": 0, "target": {"path": "pointer",
        "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/3/translation"}}}});
    let scene = Scene::read(&glb(&json, &pack.bin), &ReadOptions::default()).unwrap();
    let place = |name: &str| CopyPlace {
        name: name.to_owned(),
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: 1.0,
    };
    let copies = scene.with_copies(&[place("a"), place("b")]).unwrap();
    let json = split(&write(&copies, &[], Packing::default()).0).0;
    let all = |name: &str| -> Vec<usize> {
        let nodes = json["nodes"].as_array().unwrap().iter().enumerate();
        nodes.filter(|(_, node)| node["name"] == name).map(|(i, _)| i).collect()
    };
    let source = |bone: &usize| {
        let constraint = &json["nodes"][*bone]["extensions"]["VRMC_node_constraint"]["constraint"];
        constraint["roll"]["source"].as_u64().unwrap() as usize
    };
    assert_eq!(all("bone").iter().map(source).collect::<Vec<_>>(), all("main"));
    let channels = json["animations"][0]["channels"].as_array().unwrap().iter();
    let pointers: Vec<&str> = channels
        .filter_map(|c| c["target"]["extensions"]["KHR_animation_pointer"]["pointer"].as_str())
        .collect();
    let expected: Vec<String> = all("tip").iter().map(|n| format!("/nodes/{n}/translation")).collect();
    assert_eq!((pointers.len(), pointers), (2, expected.iter().map(String::as_str).collect()));
}

/// Returns copies of a template, each with another reference to an element that does not exist.
fn broken(template: &Value) -> Vec<Value> {
    const NOWHERE: u64 = 1_000_000;
    match template {
        Value::String(text) if text.starts_with(['@', '=']) => vec![NOWHERE.into()],
        Value::String(text) if text.starts_with('/') => {
            vec![format!("/{}/{NOWHERE}/weights", text.split('/').nth(1).unwrap()).into()]
        }
        Value::Array(all) => {
            let with = |i: usize, value: Value| {
                let mut copy = all.clone();
                copy[i] = value;
                Value::from(copy)
            };
            all.iter().enumerate().flat_map(|(i, v)| broken(v).into_iter().map(move |b| with(i, b))).collect()
        }
        Value::Object(all) => {
            let with = |key: &str, value: Value| {
                let mut copy = all.clone();
                copy[key] = value;
                Value::from(copy)
            };
            all.iter().flat_map(|(k, v)| broken(v).into_iter().map(move |b| with(k, b))).collect()
        }
        _ => Vec::new(),
    }
}

#[test]
fn a_reference_of_an_extension_to_nowhere_is_found() {
    let mut count = 0;
    // Nobody knows what those of ACME refer to.
    for case in cases::all().iter().filter(|case| !case.name.starts_with("ACME_")) {
        let whole = split(&file(case)).0;
        for (at, content) in &case.parts {
            for content in broken(content) {
                let mut json = whole.clone();
                let at = host(&json, at).unwrap();
                let content = with_numbers(&content, &json);
                json.pointer_mut(&at).unwrap()["extensions"][extension(case)] = content.clone();
                assert_eq!(new_dangling(&json, Some(&whole)).len(), 1, "{}: {content}", case.name);
                count += 1;
            }
        }
    }
    assert!(count > cases::all().len(), "{count}");
}

#[test]
fn a_reference_of_the_core_to_nowhere_is_found() {
    let (whole, _) = everything();
    assert!(dangling(&whole).is_empty(), "{:?}", dangling(&whole));
    for at in [
        "/scene",
        "/scenes/1/nodes/0",
        "/nodes/0/mesh",
        "/nodes/0/skin",
        "/nodes/0/camera",
        "/nodes/0/children",
        "/skins/0/joints/0",
        "/skins/0/skeleton",
        "/skins/0/inverseBindMatrices",
        "/meshes/0/primitives/0/attributes/POSITION",
        "/meshes/0/primitives/0/targets/0/POSITION",
        "/meshes/0/primitives/0/indices",
        "/meshes/0/primitives/0/material",
        "/accessors/0/bufferView",
        "/accessors/0/sparse/values/bufferView",
        "/bufferViews/0/buffer",
        "/images/0/bufferView",
        "/textures/0/source",
        "/textures/0/sampler",
        "/materials/0/emissiveTexture/index",
        "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
        "/animations/0/channels/0/sampler",
        "/animations/0/channels/0/target/node",
        "/animations/0/samplers/0/output",
    ] {
        let mut json = whole.clone();
        let mut value = &mut json;
        for key in at.split('/').skip(1) {
            value = match key.parse::<usize>() {
                Ok(i) => &mut value[i],
                Err(_) => &mut value[key],
            };
        }
        *value = if at.ends_with("children") { json!([99]) } else { json!(99) };
        assert_eq!(new_dangling(&json, Some(&whole)).len(), 1, "{at}: {json:#}");
    }
}

#[test]
fn a_pointer_may_end_at_a_property_with_its_default_value() {
    let (json, _) = base();
    for (pointer, is_dangling) in [
        ("/nodes/1/translation", false),
        ("/nodes/1/weights/0", false),
        ("/nodes/2/weights/0", true),
        ("/nodes/99/translation", true),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", false),
        ("/extensions/KHR_lights_punctual/lights/0/color", false),
        ("/extensions/KHR_lights_punctual/lights/1/color", true),
        ("/extensions/ACME_lamps/lamps/0/color", true),
        ("nodes/1/translation", true),
    ] {
        let mut json = json.clone();
        let target = &mut json["animations"][0]["channels"][0]["target"];
        target["extensions"]["KHR_animation_pointer"]["pointer"] = pointer.into();
        assert_eq!(dangling(&json).len(), usize::from(is_dangling), "{pointer}");
    }
}
