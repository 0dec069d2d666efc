//! Colours of vertices: linear in glTF, sRGB in all other formats and in meshes. A model looks the same in each.

use lodsmith_core::TriMesh;
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, write_to};
use serde_json::json;

use crate::scenes::{Pack, glb, split};

const GREY: f32 = 128.0 / 255.0;
/// By the formula of sRGB.
const LINEAR_GREY: f32 = 0.215_860_5;

fn written(mesh: &TriMesh, format: Format) -> Vec<u8> {
    let mut out = Vec::new();
    write_to(mesh, format, &WriteOptions::default(), &mut out).unwrap();
    out
}

fn read(bytes: &[u8]) -> TriMesh {
    read_bytes(bytes, &ReadOptions::default()).unwrap().into_mesh()
}

/// A triangle with a grey corner.
fn triangle(alpha: f32) -> TriMesh {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut mesh =
        TriMesh::new(lodsmith_core::Positions::F32(positions), vec![[0, 1, 2].map(lodsmith_core::VertexId)])
            .unwrap();
    mesh.set_colors(Some(vec![[GREY, 0.0, 1.0, alpha], [1.0; 4], [0.2, 0.4, 0.6, 1.0]])).unwrap();
    mesh
}

#[test]
fn colors_are_linear_in_gltf_only() {
    let mesh = triangle(1.0);
    for format in [Format::Ply, Format::Obj, Format::Off, Format::ThreeMf] {
        let back = read(&written(&mesh, format));
        assert!((back.colors().unwrap()[0][0] - GREY).abs() < 1e-6, "{format:?}");
    }
    let glb = written(&mesh, Format::Glb);
    let scene = Scene::read(&glb, &ReadOptions::default()).unwrap();
    let linear = scene.meshes()[0].mesh.colors().unwrap()[0];
    assert!((linear[0] - LINEAR_GREY).abs() < 1e-6, "{linear:?}");
    // Alpha is no colour.
    let glb = written(&triangle(GREY), Format::Glb);
    assert_eq!(
        Scene::read(&glb, &ReadOptions::default()).unwrap().meshes()[0].mesh.colors().unwrap()[0][3],
        GREY
    );
    assert_eq!(read(&glb).colors().unwrap()[0], [GREY, 0.0, 1.0, GREY]);
}

#[test]
fn bytes_come_back_by_way_of_gltf() {
    let positions = |i: usize| [i as f32, (i % 7) as f32, (i % 3) as f32];
    let mut mesh = TriMesh::new(
        lodsmith_core::Positions::F32((0..258).map(positions).collect()),
        (0..86).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(lodsmith_core::VertexId)).collect(),
    )
    .unwrap();
    let color = |i: usize| [i.min(255), 255 - i.min(255), (7 * i) % 256, 255].map(|b| b as f32 / 255.0);
    mesh.set_colors(Some((0..258).map(color).collect())).unwrap();
    for format in [Format::Ply, Format::Off, Format::Obj] {
        let first = written(&mesh, format);
        let again = written(&read(&written(&read(&first), Format::Glb)), format);
        assert!(first == again, "{format:?}");
    }
}

/// A scene that is merged and written as one mesh has the colours that it had, in their type.
#[test]
fn linear_values_come_back_by_way_of_meshes() {
    for (component, size) in [(5121, 1), (5123, 2)] {
        let mut pack = Pack::default();
        let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let bytes: Vec<u8> = (0..12 * size).map(|i| (i * 21 + 5) as u8).collect();
        let colors = pack.push("VEC4", component, &bytes, 3);
        pack.accessors[colors]["normalized"] = true.into();
        let attributes = json!({ "POSITION": positions, "COLOR_0": colors });
        let json = pack.json(json!({ "meshes": [{ "primitives": [{ "attributes": attributes }] }] }));
        let (json, bin) = split(&written(&read(&glb(&json, &pack.bin)), Format::Glb));
        let accessor = &json["accessors"]
            [json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"].as_u64().unwrap() as usize];
        assert_eq!(
            (accessor["componentType"].as_u64(), accessor["normalized"].as_bool()),
            (Some(component.into()), Some(true))
        );
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        assert_eq!(bin[start..start + bytes.len()], bytes);
    }
}
