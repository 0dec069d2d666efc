//! Copies of a scene: shared data, separate nodes, and placement.

use lodsmith_core::model::{Channel, Interpolation, Track};
use lodsmith_io::gltf::{CopyPlace, MovingNode, Scene, SceneCamera, SceneLevels, SceneMotion};
use lodsmith_io::{Format, ReadOptions, read_bytes};
use serde_json::{Value, json};

use crate::scenes::{everything, glb, gltf, small, split};

fn places(count: usize) -> Vec<CopyPlace> {
    let at = |k: usize| CopyPlace {
        name: format!("copy_{}", k + 1),
        translation: [10.0 * k as f64, 0.0, 0.0],
        rotation: [0.0, 0.0, 0.0, 1.0],
        scale: (k + 1) as f64,
    };
    (0..count).map(at).collect()
}

fn scene((json, bin): (Value, Vec<u8>)) -> Scene {
    let read = |bytes: &[u8]| Scene::read(bytes, &ReadOptions::default()).unwrap();
    let (text, binary) = (read(&gltf(&json, &bin)), read(&glb(&json, &bin)));
    assert_eq!(text.contents(), binary.contents());
    binary
}

fn written(scene: &Scene) -> Vec<u8> {
    let mut bytes = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut bytes).unwrap();
    bytes
}

#[test]
fn copies_share_large_data_and_have_their_own_nodes() {
    let source = scene(everything());
    let copied = source.with_copies(&places(3)).unwrap();
    let faces = |s: &Scene| s.meshes().iter().map(|m| m.instances * m.mesh.face_count()).sum::<usize>();
    assert_eq!(faces(&copied), 3 * faces(&source));
    assert_eq!(copied.contents().polygons, 3 * source.contents().polygons);
    assert!(copied.bounds().unwrap().max[0] > source.bounds().unwrap().max[0] + 15.0);
    let (before, _) = split(&written(&source));
    let (after, _) = split(&written(&copied));
    for shared in ["meshes", "materials", "images", "accessors", "bufferViews", "cameras"] {
        assert_eq!(before[shared], after[shared], "{shared}");
    }
    assert_eq!(after["scenes"].as_array().unwrap().len(), 1);
    let tops: Vec<&Value> = after["scenes"][0]["nodes"].as_array().unwrap().iter().collect();
    let node = |n: &Value| &after["nodes"][n.as_u64().unwrap() as usize];
    let names: Vec<&Value> = tops.iter().map(|n| &node(n)["name"]).collect();
    assert_eq!(names, ["copy_1", "copy_2", "copy_3"]);
    assert_eq!(node(tops[2])["scale"], json!([3.0, 3.0, 3.0]));
    // Each node has one parent, so the copies are separate trees.
    let mut parents = vec![0; after["nodes"].as_array().unwrap().len()];
    for parent in after["nodes"].as_array().unwrap() {
        for child in parent["children"].as_array().into_iter().flatten() {
            parents[child.as_u64().unwrap() as usize] += 1;
        }
    }
    assert!(parents.iter().all(|n| *n <= 1));
}

#[test]
fn bones_and_channels_are_those_of_the_copy() {
    let copied = scene(everything()).with_copies(&places(2)).unwrap();
    let (json, _) = split(&written(&copied));
    let below = |top: u64| {
        let (mut all, mut open) = (Vec::new(), vec![top]);
        while let Some(n) = open.pop() {
            all.push(n);
            let children = json["nodes"][n as usize]["children"].as_array();
            open.extend(children.into_iter().flatten().filter_map(Value::as_u64));
        }
        all
    };
    let tops = json["scenes"][0]["nodes"].as_array().unwrap();
    let mut seen = Vec::new();
    for top in tops {
        let own = below(top.as_u64().unwrap());
        for n in &own {
            let Some(skin) = json["nodes"][*n as usize]["skin"].as_u64() else { continue };
            seen.push(skin);
            let joints = json["skins"][skin as usize]["joints"].as_array().unwrap();
            assert!(joints.iter().all(|j| own.contains(&j.as_u64().unwrap())), "bones of another copy");
        }
        let channels = json["animations"][0]["channels"].as_array().unwrap();
        let moved = channels.iter().filter(|c| own.contains(&c["target"]["node"].as_u64().unwrap()));
        assert_eq!(moved.count(), 1, "one channel for each copy");
    }
    seen.dedup();
    assert_eq!(seen.len(), 2, "a skin for each copy");
    assert_eq!(json["animations"][0]["samplers"].as_array().unwrap().len(), 1);
}

#[test]
fn a_file_without_nodes_can_be_copied_and_levels_come_along() {
    let copied = scene(small()).with_copies(&places(4)).unwrap();
    let lighter = copied.meshes()[0].mesh.as_ref().clone();
    let levels = SceneLevels::new(vec![Vec::new(), vec![Some(lighter)]]);
    let mut bytes = Vec::new();
    copied.write_levels(&levels, Format::Glb, &|_| None, &mut bytes).unwrap();
    let (json, _) = split(&bytes);
    let hosts = json["nodes"].as_array().unwrap().iter().filter(|n| !n["extensions"]["MSFT_lod"].is_null());
    assert_eq!(hosts.count(), 4);
    let read = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(read.mesh.face_count(), 4);
    let bounds = read.mesh.positions().view().bounds().unwrap();
    assert_eq!((bounds.min[0], bounds.max[0], bounds.max[1]), (0.0, 34.0, 4.0));
}

#[test]
fn levels_of_a_copy_are_nodes_of_its_own() {
    let source = scene(small()).with_copies(&places(1)).unwrap();
    let lighter = source.meshes()[0].mesh.as_ref().clone();
    let mut bytes = Vec::new();
    let levels = SceneLevels::new(vec![Vec::new(), vec![Some(lighter)]]);
    source.write_levels(&levels, Format::Glb, &|_| None, &mut bytes).unwrap();
    let copied = Scene::read(&bytes, &ReadOptions::default()).unwrap().with_copies(&places(3)).unwrap();
    let (json, _) = split(&written(&copied));
    let ids = |n: &Value| n["extensions"]["MSFT_lod"]["ids"].as_array().cloned().unwrap_or_default();
    let mut levels: Vec<u64> =
        json["nodes"].as_array().unwrap().iter().flat_map(ids).map(|id| id.as_u64().unwrap()).collect();
    levels.sort_unstable();
    levels.dedup();
    assert_eq!(levels.len(), 3, "{json:#}");
    for level in levels {
        assert_eq!(json["nodes"][level as usize]["mesh"], 1, "{json:#}");
    }
}

#[test]
fn levels_that_refer_to_each_other_or_to_nothing_are_copied_once() {
    let (mut json, bin) = small();
    let lod = |ids: Value| json!({"mesh": 0, "extensions": {"MSFT_lod": {"ids": ids}}});
    json["nodes"] = json!([lod(json!([1, 99, 0])), lod(json!([0, 1]))]);
    json["scenes"] = json!([{"nodes": [0]}]);
    let copied = scene((json, bin)).with_copies(&places(2)).unwrap();
    let (json, _) = split(&written(&copied));
    let copy = &json["nodes"][3];
    assert_eq!(copy["extensions"]["MSFT_lod"]["ids"], json!([4, 99, 3]), "{json:#}");
}

#[test]
fn no_copies_are_an_empty_scene() {
    let copied = scene(everything()).with_copies(&[]).unwrap();
    assert_eq!(copied.contents().meshes, 0);
}

/// Returns a node above the second of three copies, which moves along x by a curve, and a camera below
/// another node.
fn motion() -> SceneMotion {
    let moves = MovingNode {
        name: "moves".to_owned(),
        child_root: Some(1),
        translation: [0.0, 1.0, 0.0],
        scale: 2.0,
        ..MovingNode::default()
    };
    let stand =
        MovingNode { name: "stand".to_owned(), translation: [0.0, 0.0, 9.0], ..MovingNode::default() };
    let lens = Some(SceneCamera { fov_y_rad: 0.6, near: 0.01 });
    let camera =
        MovingNode { name: "camera".to_owned(), parent: Some(1), camera: lens, ..MovingNode::default() };
    let [still, far] = [[0.0, 1.0, 0.0], [8.0, 1.0, 0.0]];
    let curve = vec![[0.0; 3], still, [0.0; 3], [0.0; 3], far, [0.0; 3]];
    let half = [0.0, 0.5f32.sqrt(), 0.0, 0.5f32.sqrt()];
    let channel = |node, track, interpolation| Channel { node, track, times: vec![0.0, 2.0], interpolation };
    let channels = vec![
        channel(0, Track::Translation(curve), Interpolation::Cubic),
        channel(2, Track::Rotation(vec![[0.0, 0.0, 0.0, 1.0], half]), Interpolation::Step),
        channel(7, Track::Scale(vec![[1.0; 3]; 2]), Interpolation::Linear),
    ];
    SceneMotion { name: "stage".to_owned(), nodes: vec![moves, stand, camera], channels }
}

#[test]
fn a_scene_is_moved_by_nodes_above_it() {
    for source in [everything(), small()] {
        let source = scene(source);
        let copied = source.with_copies(&places(3)).unwrap();
        let moving = copied.with_motion(&motion()).unwrap();
        assert_eq!(moving.contents().polygons, copied.contents().polygons);
        let bytes = written(&moving);
        let (json, _) = split(&bytes);
        let nodes = json["nodes"].as_array().unwrap();
        let name = |n: &Value| nodes[n.as_u64().unwrap() as usize]["name"].as_str().unwrap();
        let roots: Vec<&str> = json["scenes"][0]["nodes"].as_array().unwrap().iter().map(name).collect();
        assert_eq!(roots, ["copy_1", "moves", "copy_3", "stand"]);
        let model = lodsmith_io::read_model_bytes(&bytes, &ReadOptions::default()).unwrap().model;
        let clips = source.contents().animations;
        assert_eq!(model.animations.len(), clips + 1);
        let place = |secs: f64, name: &str| {
            let pose = model.pose(clips, secs);
            let at = model.nodes.iter().position(|n| n.name == name).unwrap();
            model.world_from_nodes(&pose)[at]
        };
        for (secs, x) in [(0.0, 0.0), (1.0, 4.0), (2.0, 8.0)] {
            // The copy is at 10, in a node scaled by two.
            let origin = place(secs, "copy_2").w_axis.truncate();
            assert!((origin.x - x - 20.0).abs() < 1e-5 && (origin.y - 1.0).abs() < 1e-6, "{origin}");
        }
        assert_eq!(place(2.0, "camera").w_axis.z, 9.0);
        assert!((place(2.0, "camera").z_axis.x - 1.0).abs() < 1e-6, "turned by a right angle");
    }
}

#[test]
fn nodes_of_a_file_without_scenes_stay_visible_beside_moved_ones() {
    for scenes in [json!([]), Value::Null] {
        let (mut json, bin) = small();
        json["nodes"] = json!([{"mesh": 0, "name": "still"}]);
        json["scenes"] = scenes;
        let moving = scene((json, bin)).with_motion(&motion()).unwrap();
        assert_eq!(moving.contents().polygons, 1);
        let (json, _) = split(&written(&moving));
        assert_eq!(json["scenes"][0]["nodes"].as_array().unwrap().len(), 3, "{json:#}");
    }
}

#[test]
fn a_scene_that_nothing_moves_in_stays_as_it_is() {
    let copied = scene(small()).with_copies(&places(2)).unwrap();
    assert_eq!(written(&copied.with_motion(&SceneMotion::default()).unwrap()), written(&copied));
    // Nodes that refer to missing nodes become roots.
    let lost = MovingNode { child_root: Some(9), parent: Some(4), ..MovingNode::default() };
    let more = copied.with_motion(&SceneMotion { nodes: vec![lost], ..SceneMotion::default() }).unwrap();
    let (json, _) = split(&written(&more));
    assert_eq!(json["scenes"][0]["nodes"].as_array().unwrap().len(), 3);
    assert!(json.get("animations").is_none());
}
