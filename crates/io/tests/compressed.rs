//! Compressed glTF files of other programs, compared with the uncompressed original.

use lodsmith_core::{Positions, TriMesh};
use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, ReadError, ReadOptions, read_bytes};
use serde_json::{Value, json};

const PLAIN: &[u8] = include_bytes!("../../../testdata/wave.glb");
const KHR: &[u8] = include_bytes!("../../../testdata/wave_meshopt_khr.glb");
const EXT: &[u8] = include_bytes!("../../../testdata/wave_meshopt_ext.glb");
const EXPONENTIAL: &[u8] = include_bytes!("../../../testdata/wave_meshopt_exp.glb");
const DRACO: &[u8] = include_bytes!("../../../testdata/wave_draco.glb");
const SEQUENTIAL: &[u8] = include_bytes!("../../../testdata/wave_draco_sequential.glb");

/// The compressed files, and the tolerances of positions, normals and texture coordinates. (Without a
/// material, gltfpack does not record how its integers map to texture coordinates.)
const FILES: [(&str, &[u8], [f32; 3]); 5] = [
    ("khr", KHR, [0.0, 1e-6, 0.0]),
    ("ext", EXT, [1e-4, 0.02, f32::INFINITY]),
    ("exponential", EXPONENTIAL, [1e-4, 0.02, f32::INFINITY]),
    ("draco", DRACO, [1e-4, 0.02, 1e-3]),
    ("sequential", SEQUENTIAL, [3e-4, 0.02, 1e-3]),
];

fn read(bytes: &[u8]) -> TriMesh {
    read_bytes(bytes, &ReadOptions::default()).unwrap().into_mesh()
}

/// Returns position, normal and texture coordinate of each corner of each face; faces are sorted by their
/// places in the sheet.
fn faces(mesh: &TriMesh) -> Vec<[[f32; 8]; 3]> {
    let Positions::F32(positions) = mesh.positions() else { panic!("the file has single precision") };
    let (normals, uvs) = (mesh.normals().unwrap(), mesh.uvs().unwrap());
    let corner = |w: lodsmith_core::WedgeId| {
        let (p, n, uv) = (positions[mesh.vertex_of(w).index()], normals[w.index()], uvs[w.index()]);
        [p[0], p[1], p[2], n[0], n[1], n[2], uv[0], uv[1]]
    };
    let mut faces: Vec<[[f32; 8]; 3]> = mesh.triangles().iter().map(|t| t.map(corner)).collect();
    let place = |c: &[f32; 8]| ((c[0] * 8.0).round() as i32, (c[1] * 8.0).round() as i32);
    for face in &mut faces {
        // Programs may rotate the corners of a face; here it begins with the smallest one.
        let first = (0..3).min_by_key(|&k| place(&face[k])).unwrap();
        face.rotate_left(first);
    }
    faces.sort_by_key(|f| f.map(|c| place(&c)));
    faces
}

/// Returns the JSON and the binary chunk of a GLB.
fn split_glb(bytes: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), bytes[20 + length + 8..].to_vec())
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let word = |n: usize| (n as u32).to_le_bytes();
    let header = [*b"glTF", word(2), word(28 + text.len() + bin.len()), word(text.len()), *b"JSON"];
    [header.as_flattened(), &text, &word(bin.len()), b"BIN\0", &bin].concat()
}

#[test]
fn compressed_meshes_equal_the_originals() {
    let plain = faces(&read(PLAIN));
    for (name, bytes, [position, normal, uv]) in FILES {
        let got = faces(&read(bytes));
        assert_eq!(got.len(), plain.len(), "{name}");
        for (a, b) in got.as_flattened().iter().zip(plain.as_flattened()) {
            for k in 0..8 {
                let most = [position, normal, uv][if k < 3 {
                    0
                } else if k < 6 {
                    1
                } else {
                    2
                }];
                assert!((a[k] - b[k]).abs() <= most, "{name}: {a:?} for {b:?}");
            }
        }
    }
}

#[test]
fn scenes_are_written_plainly() {
    for (name, bytes, _) in FILES {
        let scene = Scene::read(bytes, &ReadOptions::default()).unwrap();
        let mut out = Vec::new();
        scene.write(&[], Format::Glb, &|_| None, &mut out).unwrap();
        let (json, bin) = split_glb(&out);
        let text = json.to_string();
        assert!(!text.contains("meshopt") && !text.contains("draco"), "{name}: {text}");
        assert_eq!(json["buffers"].as_array().map(Vec::len), Some(1));
        assert_eq!(json["bufferViews"].as_array().map(Vec::len), Some(4), "{name}");
        // The compressed streams are gone: there are only the bytes of the views, and padding.
        let held: u64 =
            json["bufferViews"].as_array().unwrap().iter().map(|v| v["byteLength"].as_u64().unwrap()).sum();
        assert!((held..held + 32).contains(&(bin.len() as u64)), "{name}: {held} of {}", bin.len());
        // Bounds of positions match the rewritten bytes.
        let accessor = json["accessors"].as_array().unwrap().iter().find(|a| a["min"].is_array()).unwrap();
        let got = read(&out);
        let again = read(bytes);
        assert_eq!(faces(&got), faces(&again), "{name}");
        if accessor["componentType"] == 5126 {
            let bounds = got.positions().view().bounds().unwrap();
            for (k, (min, max)) in bounds.min.into_iter().zip(bounds.max).enumerate() {
                // Some programs write nine digits.
                let is = |bound: f64, name: &str| (bound - accessor[name][k].as_f64().unwrap()).abs() < 1e-9;
                assert!(is(min, "min") && is(max, "max"), "{name}: {accessor}, {bounds:?}");
            }
        }
    }
}

#[test]
fn a_replaced_mesh_is_written_plainly() {
    for (name, bytes, _) in FILES {
        let scene = Scene::read(bytes, &ReadOptions::default()).unwrap();
        let mesh = TriMesh::clone(&scene.meshes()[0].mesh);
        let mut out = Vec::new();
        scene.write(&[Some(mesh)], Format::Glb, &|_| None, &mut out).unwrap();
        assert_eq!(faces(&read(&out)).len(), 128, "{name}");
        let (json, _) = split_glb(&out);
        let required = json["extensionsRequired"].as_array().cloned().unwrap_or_default();
        assert!(required.iter().all(|e| e == "KHR_mesh_quantization"), "{name}: {required:?}");
    }
}

#[test]
fn a_fallback_is_not_asked_for() {
    let (mut json, bin) = split_glb(KHR);
    // As if the uncompressed bytes were in a missing file; the extension may then be missing from the
    // required ones.
    json["buffers"][1]["uri"] = "nowhere.bin".into();
    json.as_object_mut().unwrap().remove("extensionsRequired");
    assert_eq!(faces(&read(&glb(&json, &bin))), faces(&read(KHR)));
    // Without the mark, the fallback buffer is recognised by the views that refer to it.
    json["buffers"][1].as_object_mut().unwrap().remove("extensions");
    assert_eq!(faces(&read(&glb(&json, &bin))), faces(&read(KHR)));
}

#[test]
fn primitives_may_share_a_stream_of_draco() {
    let (mut json, bin) = split_glb(DRACO);
    let first = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["primitives"] = json!([first.clone(), first]);
    let twice = glb(&json, &bin);
    assert_eq!(read(&twice).face_count(), 256);
    let scene = Scene::read(&twice, &ReadOptions::default()).unwrap();
    let mut out = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut out).unwrap();
    let (json, _) = split_glb(&out);
    assert_eq!(json["meshes"][0]["primitives"][0], json["meshes"][0]["primitives"][1]);
    assert_eq!(json["accessors"].as_array().map(Vec::len), Some(4));
}

#[test]
fn errors_name_the_problem() {
    let said = |bytes: &[u8]| match read_bytes(bytes, &ReadOptions::default()) {
        Ok(_) => "nothing".to_owned(),
        Err(e) => e.to_string(),
    };
    let meshopt = |pointer: &str, value: Value| {
        let (mut json, bin) = split_glb(KHR);
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        json.pointer_mut(parent).unwrap()[key] = value;
        said(&glb(&json, &bin))
    };
    let extension = "/bufferViews/0/extensions/KHR_meshopt_compression";
    for (pointer, value, wanted) in [
        ("mode", json!("POINTS"), "bufferViews[0].KHR_meshopt_compression: the mode POINTS is unknown"),
        ("mode", json!("INDICES"), "bufferViews[0]: has a byteStride of 12, and indices need 2 or 4"),
        ("filter", json!("BLUR"), "bufferViews[0].KHR_meshopt_compression: the filter BLUR is unknown"),
        ("filter", json!("QUATERNION"), "bufferViews[0]: has a byteStride of 12, and its filter needs 8"),
        ("count", json!(80), "bufferViews[0]: byteLength is 972, but it holds 80 elements of 12 bytes"),
        ("count", Value::Null, "bufferViews[0].KHR_meshopt_compression: count is missing"),
        ("buffer", json!(7), "bufferViews[0]: refers to buffers[7], but the file has 2"),
        (
            "byteLength",
            json!(2000),
            "bufferViews[0]: its bytes 0 to 2000 reach beyond buffers[0] of 1424 bytes",
        ),
        (
            "byteLength",
            json!(30),
            "bufferViews[0]: is damaged: a channel of its compressed bytes has an unknown mode",
        ),
        (
            "byteOffset",
            json!(1),
            "bufferViews[0]: is damaged: its compressed bytes begin with an unknown version",
        ),
    ] {
        assert_eq!(meshopt(&format!("{extension}/{pointer}"), value), wanted);
    }

    let draco = |change: &dyn Fn(&mut Value)| {
        let (mut json, bin) = split_glb(DRACO);
        change(&mut json);
        said(&glb(&json, &bin))
    };
    let primitive = "meshes[0].primitives[0]";
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (pointer, value, wanted) in [
        (
            "/accessors/1/count",
            json!(82),
            format!("accessors[1]: claims 82 elements, but the Draco stream of {primitive} has 81 vertices"),
        ),
        (
            "/accessors/1/type",
            json!("VEC2"),
            "accessors[1]: is of type VEC2, but the Draco stream has 3 numbers".to_owned(),
        ),
        (
            "/meshes/0/primitives/0/mode",
            json!(1),
            format!(
                "{primitive}: the mode is 1; KHR_draco_mesh_compression is for triangles (4) and strips (5)"
            ),
        ),
        (
            &format!("{extension}/attributes/NORMAL"),
            json!(9),
            format!("{primitive}: NORMAL refers to attribute 9 of the Draco stream, which does not exist"),
        ),
        (
            &format!("{extension}/bufferView"),
            json!(9),
            format!("{primitive}: refers to bufferViews[9], but the file has 1"),
        ),
    ] {
        assert_eq!(draco(&|json| *json.pointer_mut(pointer).unwrap() = value.clone()), wanted);
    }
    let cut = draco(&|json| json["bufferViews"][0]["byteLength"] = 200.into());
    assert!(cut.starts_with("bufferViews[0]: its Draco stream cannot be decoded: "), "{cut}");
}

#[test]
fn a_few_bytes_do_not_unpack_to_very_many() {
    // A version 1 stream of constant values: each block of 256 elements is one byte.
    let blocks = 200_000;
    let mut stream = vec![0xaa; blocks + 1];
    stream[0] = 0xa1;
    stream.resize(stream.len() + 24, 0);
    let size = blocks * 256 * 4;
    let extension = json!({"buffer": 0, "byteLength": stream.len(), "mode": "ATTRIBUTES", "count": blocks * 256,
        "byteStride": 4});
    let json = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": stream.len()}, {"byteLength": size}],
        "bufferViews": [{"buffer": 1, "byteLength": size, "extensions": {"EXT_meshopt_compression": extension}}],
    });
    let error = Scene::read(&glb(&json, &stream), &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Limit { .. }), "{error}");
}

#[test]
fn damaged_streams_get_an_answer() {
    let mut state = 99u64;
    let mut random = move |end: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % end.max(1) as u64) as usize
    };
    for (_, bytes, _) in FILES {
        let (json, whole) = split_glb(bytes);
        for _ in 0..2500 {
            let mut bin = whole.clone();
            for _ in 0..=random(3) {
                let at = random(bin.len());
                match random(4) {
                    0 => bin[at] ^= 1 << random(8),
                    1 => bin[at] = random(256) as u8,
                    2 => {
                        let end = (at + random(9)).min(bin.len());
                        bin[at..end].fill([0, 0xff][random(2)]);
                    }
                    _ => {
                        let from = random(bin.len());
                        let length = random(20).min(bin.len() - at.max(from));
                        bin.copy_within(from..from + length, at);
                    }
                }
            }
            // The test is that this neither panics nor hangs.
            let _ = Scene::read(&glb(&json, &bin), &ReadOptions::default());
        }
    }
}
