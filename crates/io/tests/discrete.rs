//! Discrete integer attributes: reading them, and writing them in their own type.

use lodsmith_core::{Attribute, IntegerType, Semantic, TriMesh, shapes};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, write_to};
use serde_json::{Value, json};

use crate::scenes::{self, Pack, glb};

fn discrete(mesh: &TriMesh, name: &str) -> Option<(IntegerType, Vec<f32>)> {
    mesh.further_attributes().iter().find_map(|a| match &a.semantic {
        Semantic::Discrete { name: own, of } if own == name => Some((*of, a.values.clone())),
        _ => None,
    })
}

/// Returns a scene of two triangles without common vertices, with attributes of these component types and
/// values.
fn scene(attributes: &[(&str, u32, Vec<u8>, bool)]) -> Scene {
    let mut pack = Pack::default();
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [2.0, 0.0], [3.0, 0.0], [2.0, 1.0]];
    let positions = pack.positions(&corners.map(|[x, y]| [x, y, 0.0]));
    let mut named = json!({"POSITION": positions});
    for (name, component, bytes, normalized) in attributes {
        let at = pack.push("SCALAR", *component, bytes, 6);
        let stride = bytes.len() / 6;
        if stride < 4 {
            pack.views.last_mut().unwrap()["byteStride"] = stride.into();
        }
        if *normalized {
            pack.accessors[at]["normalized"] = true.into();
        }
        named[*name] = at.into();
    }
    let json =
        pack.json(json!({"meshes": [{"primitives": [{"attributes": named}]}], "nodes": [{"mesh": 0}]}));
    Scene::read(&glb(&json, &pack.bin), &ReadOptions::default()).unwrap()
}

fn rewritten(scene: &Scene, mesh: &TriMesh) -> (Value, TriMesh) {
    let mut out = Vec::new();
    scene.write(&[Some(mesh.clone())], Format::Glb, &|_| None, &mut out).unwrap();
    let (json, _) = scenes::split(&out);
    let again = Scene::read(&out, &ReadOptions::default()).unwrap();
    (json, TriMesh::clone(&again.meshes()[0].mesh))
}

fn component(json: &Value, name: &str) -> u64 {
    let at = json["meshes"][0]["primitives"][0]["attributes"][name].as_u64().unwrap();
    json["accessors"][at as usize]["componentType"].as_u64().unwrap()
}

#[test]
fn integers_of_gltf_that_are_not_normalised_are_discrete_and_keep_their_type() {
    let shorts: Vec<u8> = [7u16, 7, 7, 300, 300, 300].into_iter().flat_map(|x| x.to_le_bytes()).collect();
    let floats: Vec<u8> = [7f32, 7.0, 7.0, 70000.0, 1.0, 2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let halves: Vec<u8> = [0.5f32; 6].iter().flat_map(|x| x.to_le_bytes()).collect();
    let scene = scene(&[
        ("_FEATURE_ID_0", 5123, shorts.clone(), false),
        ("_FEATURE_ID_1", 5126, floats.clone(), false),
        ("_FEATURE_ID_2", 5126, halves, false),
        ("_BATCHID", 5121, vec![1, 2, 3, 4, 5, 6], false),
        ("_SIGNED", 5120, vec![255, 1, 2, 3, 4, 5], false),
        ("_SHARE", 5121, vec![0, 51, 102, 153, 204, 255], true),
        ("_HEIGHT", 5126, floats, false),
    ]);
    let mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    let of = |name: &str| discrete(&mesh, name).map(|d| d.0);
    assert_eq!(of("_FEATURE_ID_0"), Some(IntegerType::U16));
    // Ids beyond 16 bits are floats in this format.
    assert_eq!(of("_FEATURE_ID_1"), Some(IntegerType::I32));
    assert_eq!(of("_BATCHID"), Some(IntegerType::U8));
    assert_eq!(of("_SIGNED"), Some(IntegerType::I8));
    assert_eq!(discrete(&mesh, "_SIGNED").unwrap().1[0], -1.0);
    // Neither fractions nor floats of a file are discrete.
    assert_eq!(["_FEATURE_ID_2", "_SHARE", "_HEIGHT"].map(of), [None; 3]);

    let mut turned = mesh.clone();
    turned.map_positions(|p| [p[1], p[0], p[2]]);
    let (json, again) = rewritten(&scene, &turned);
    assert_eq!(again, turned);
    for (name, code) in [
        ("_FEATURE_ID_0", 5123),
        ("_FEATURE_ID_1", 5126),
        ("_BATCHID", 5121),
        ("_SIGNED", 5120),
        ("_SHARE", 5121),
    ] {
        assert_eq!(component(&json, name), code, "{name}");
    }
}

#[test]
fn a_discrete_attribute_that_a_scene_lacks_comes_along_in_its_type() {
    let scene = scene(&[]);
    let mut mesh = TriMesh::clone(&scene.meshes()[0].mesh);
    for (name, of, top) in
        [("_A", IntegerType::U16, 9.0), ("_B", IntegerType::U32, 9.0), ("_C", IntegerType::U32, 70000.0)]
    {
        let semantic = Semantic::Discrete { name: name.to_owned(), of };
        let values = vec![1.0, 2.0, 3.0, 4.0, 5.0, top];
        mesh.add_attribute(Attribute { semantic, width: 1, values }).unwrap();
    }
    let (json, again) = rewritten(&scene, &mesh);
    // Vertex attributes of glTF have no 32-bit integers.
    assert_eq!(["_A", "_B", "_C"].map(|name| component(&json, name)), [5123, 5121, 5126]);
    assert_eq!(discrete(&again, "_A"), discrete(&mesh, "_A"));
}

const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nproperty uchar label\nproperty int id\nproperty float heat\nproperty uint hash\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n";

#[test]
fn integers_of_vertices_go_through_ply_in_their_type() {
    let body = "0 0 0 1 -70000 0.5 4294967295\n1 0 0 255 16777216 0.5 1\n0 1 0 0 3 0.5 2\n3 0 1 2\n";
    let mut options = ReadOptions::default();
    options.properties = vec!["id".to_owned()];
    let loaded = read_bytes(format!("{HEADER}{body}").as_bytes(), &options).unwrap();
    let mesh = loaded.mesh;
    assert_eq!(discrete(&mesh, "label"), Some((IntegerType::U8, vec![1.0, 255.0, 0.0])));
    assert_eq!(discrete(&mesh, "id"), Some((IntegerType::I32, vec![-70000.0, 16777216.0, 3.0])));
    assert_eq!(loaded.properties, [("id".to_owned(), vec![-70000.0, 16777216.0, 3.0])]);
    // Single precision cannot hold the first hash.
    assert_eq!(discrete(&mesh, "hash"), None);
    let texts: Vec<String> = loaded.warnings.iter().map(|w| w.text.clone()).collect();
    assert_eq!(texts, ["vertex properties are not supported: heat, hash dropped"]);
    for ascii in [true, false] {
        let mut bytes = Vec::new();
        let mut options = WriteOptions::default();
        options.ascii = ascii;
        write_to(&mesh, Format::Ply, &options, &mut bytes).unwrap();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        assert!(text.contains("property uchar label\nproperty int id\n"), "{text}");
        assert_eq!(read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh, mesh);
    }
}

#[test]
fn formats_without_integers_say_so() {
    let body = "0 0 0 1 1 0.5 1\n1 0 0 255 2 0.5 1\n0 1 0 0 3 0.5 2\n3 0 1 2\n";
    let mesh = read_bytes(format!("{HEADER}{body}").as_bytes(), &ReadOptions::default()).unwrap().mesh;
    for (format, name) in [(Format::Obj, "OBJ"), (Format::Off, "OFF"), (Format::Glb, "GLB")] {
        let warnings = write_to(&mesh, format, &WriteOptions::default(), &mut Vec::new()).unwrap().warnings;
        let texts: Vec<String> = warnings.into_iter().map(|w| w.text).collect();
        assert_eq!(texts, [format!("{name} cannot carry label, id, hash of vertices: dropped")]);
    }
}

#[test]
fn values_that_a_type_does_not_hold_are_written_as_floats() {
    let mut mesh = shapes::tetrahedron();
    let semantic = Semantic::Discrete { name: "label".to_owned(), of: IntegerType::U8 };
    mesh.add_attribute(Attribute { semantic, width: 1, values: vec![0.0, 256.0, 1.0, f32::NAN] }).unwrap();
    let mut bytes = Vec::new();
    write_to(&mesh, Format::Ply, &WriteOptions::default(), &mut bytes).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("property float label\n"));
}
