//! Files that are compressed and quantized on writing, read again.

use lodsmith_core::model::Pose;
use lodsmith_core::{Model, Positions, TriMesh};
use lodsmith_io::gltf::{Compression, Packing, Scene, SceneFormat, Written};
use lodsmith_io::{Format, ReadOptions, WriteOptions, read_bytes, read_model_bytes, write_to};
use serde_json::{Value, json};

use crate::scenes::{Pack, everything, glb, gltf, small, split};

const WAVE: &[u8] = include_bytes!("../../../testdata/wave.glb");
const ARM: &[u8] = include_bytes!("../../../testdata/arm.glb");
const KHR: &[u8] = include_bytes!("../../../testdata/wave_meshopt_khr.glb");

fn scene(bytes: &[u8]) -> Scene {
    Scene::read(bytes, &ReadOptions::default()).unwrap()
}

fn packed(bytes: &[u8], compression: Compression, quantize: bool) -> (Vec<u8>, Written) {
    let to = SceneFormat::new(Format::Glb, Packing::new(compression, quantize));
    let mut out = Vec::new();
    let written = scene(bytes).write(&[], to, &|_| None, &mut out).unwrap();
    (out, written)
}

fn all_files() -> Vec<(&'static str, Vec<u8>)> {
    let (json, bin) = everything();
    let (one, of_one) = small();
    vec![
        ("wave", WAVE.to_vec()),
        ("arm", ARM.to_vec()),
        ("everything", glb(&json, &bin)),
        ("small", gltf(&one, &of_one)),
    ]
}

/// Returns the bits of all numbers at the corners of each face, sorted: the order of faces, of their corners,
/// and of vertices may change.
fn corners(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let Positions::F32(positions) = mesh.positions() else { panic!("the file has single precision") };
    let faces = mesh.triangles().iter().enumerate().map(|(i, t)| {
        let mut corners = t.map(|w| {
            let mut all: Vec<f32> = positions[mesh.vertex_of(w).index()].to_vec();
            all.extend(mesh.normals().map(|n| n[w.index()]).into_iter().flatten());
            all.extend(mesh.uvs().map(|n| n[w.index()]).into_iter().flatten());
            all.extend(mesh.colors().map(|n| n[w.index()]).into_iter().flatten());
            for further in mesh.further_attributes() {
                let width = further.width;
                all.extend_from_slice(&further.values[w.index() * width..][..width]);
            }
            all.into_iter().map(|x| (x + 0.0).to_bits()).collect::<Vec<_>>()
        });
        let first = (0..3).min_by_key(|&k| corners[k].clone()).unwrap();
        corners.rotate_left(first);
        let region = mesh.regions().map_or(0, |r| r[i].index() as u32);
        [vec![region], corners.concat()].concat()
    });
    let mut faces: Vec<Vec<u32>> = faces.collect();
    faces.sort();
    faces
}

#[test]
fn compression_loses_nothing() {
    for (name, file) in all_files() {
        for compression in [Compression::Meshopt, Compression::MeshoptKhr] {
            let (bytes, written) = packed(&file, compression, false);
            let report = written.packed.unwrap();
            assert!(report.errors.is_none() && written.warnings.is_empty(), "{written:?}");
            // A stream has 32 bytes at its end.
            assert!(report.packed_bytes < report.stream_bytes || name == "small", "{name}: {report:?}");
            let (before, after) = (scene(&file), scene(&bytes));
            for (a, b) in before.meshes().iter().zip(after.meshes()) {
                assert_eq!(corners(&a.mesh), corners(&b.mesh), "{name} {}", a.name);
                assert_eq!((&a.name, a.instances), (&b.name, b.instances));
            }
            assert_eq!(packed(&file, compression, false).0, bytes, "the same bytes again");
            let (json, _) = split(&bytes);
            let extension = if compression == Compression::Meshopt {
                "EXT_meshopt_compression"
            } else {
                "KHR_meshopt_compression"
            };
            assert!(json["extensionsRequired"].as_array().unwrap().contains(&extension.into()));
            assert_eq!(json["buffers"][1]["extensions"][extension]["fallback"], true);
            assert!(json["buffers"][1]["uri"].is_null());
        }
    }
}

/// Returns the pose of the first animation, if there is one.
fn pose(model: &Model, seconds: f64) -> Pose {
    if model.animations.is_empty() { Pose::default() } else { model.pose(0, seconds) }
}

#[test]
fn motions_stay_the_same() {
    for (name, file) in all_files() {
        let before = read_model_bytes(&file, &ReadOptions::default()).unwrap().model;
        for (quantize, tolerance) in [(false, 1e-5), (true, 2e-3)] {
            for compression in Compression::ALL {
                let (bytes, _) = packed(&file, compression, quantize);
                let after = read_model_bytes(&bytes, &ReadOptions::default()).unwrap().model;
                assert_eq!(before.animations.len(), after.animations.len());
                for seconds in [0.0, 0.3, 0.77] {
                    let [a, b] = [&before, &after].map(|m| m.bounds(&pose(m, seconds)).unwrap());
                    let size = a.diagonal();
                    for k in 0..3 {
                        let off = (a.min[k] - b.min[k]).abs().max((a.max[k] - b.max[k]).abs());
                        assert!(off <= tolerance * size, "{name} at {seconds}, {compression:?}: {a:?} {b:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn positions_are_as_near_as_the_report_says() {
    let [before, after] = [WAVE.to_vec(), packed(WAVE, Compression::Meshopt, true).0]
        .map(|bytes| read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh);
    let errors = packed(WAVE, Compression::Meshopt, true).1.packed.unwrap().errors.unwrap();
    let (Positions::F32(a), Positions::F32(b)) = (before.positions(), after.positions()) else {
        panic!("the file has single precision")
    };
    assert_eq!(before.face_count(), after.face_count());
    let mut largest = 0f64;
    for p in a {
        let distance = |q: &[f32; 3]| (0..3).map(|k| f64::from(p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
        largest = largest.max(b.iter().map(distance).fold(f64::INFINITY, f64::min));
    }
    assert!(largest <= errors.position * 1.01 + 1e-6, "{largest} {errors:?}");
    // A step of 14 bits, and normals of 8 bits.
    assert!((1e-7..1.0 / 16383.0).contains(&errors.position_share), "{errors:?}");
    assert!((0.1..1.5).contains(&errors.normal), "{errors:?}");
}

#[test]
fn the_sentence_contains_the_errors() {
    let (_, written) = packed(WAVE, Compression::None, true);
    assert_eq!(written.warnings.len(), 1);
    let text = &written.warnings[0].text;
    assert!(
        text.starts_with("quantization changes at most positions by ") && text.contains("normals by"),
        "{text}"
    );
    assert!(!written.warnings[0].data_lost);
}

#[test]
fn quantization_alone_uses_integers_and_nodes() {
    let (bytes, _) = packed(WAVE, Compression::None, true);
    let (json, _) = split(&bytes);
    assert_eq!(json["extensionsRequired"], json!(["KHR_mesh_quantization"]));
    let position = &json["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
    let accessor = &json["accessors"][position.as_u64().unwrap() as usize];
    assert_eq!((&accessor["componentType"], &accessor["type"]), (&json!(5123), &json!("VEC3")));
    assert_eq!(json["buffers"].as_array().unwrap().len(), 1);
    assert!(bytes.len() < WAVE.len(), "{} {}", bytes.len(), WAVE.len());
}

#[test]
fn instances_stay_in_place() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[1.0, 2.0, 3.0], [4.0, 2.0, 3.0], [1.0, 7.0, 3.5]]);
    let moved = pack.floats("VEC3", 3, &[10.0, 0.0, 0.0, 0.0, -20.0, 0.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turned = pack.floats("VEC4", 4, &[0.0, 0.0, half, half, half, 0.0, 0.0, half]);
    let json = pack.json(json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"], "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "many", "scale": [2, 2, 2], "extensions": {"EXT_mesh_gpu_instancing":
            {"attributes": {"TRANSLATION": moved, "ROTATION": turned}}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
    }));
    let file = glb(&json, &pack.bin);
    let (bytes, _) = packed(&file, Compression::Meshopt, true);
    let [a, b] = [&file, &bytes].map(|bytes| {
        let model = read_model_bytes(bytes, &ReadOptions::default()).unwrap().model;
        model.bounds(&pose(&model, 0.0)).unwrap()
    });
    for k in 0..3 {
        assert!((a.min[k] - b.min[k]).abs() < 2e-3 && (a.max[k] - b.max[k]).abs() < 2e-3, "{a:?} {b:?}");
    }
}

/// Numbers of two bytes have no encoding, so their view is copied: once.
#[test]
fn a_view_that_accessors_share_is_copied_once() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[1.0, 2.0, 3.0], [4.0, 2.0, 3.0], [1.0, 7.0, 3.5]]);
    let numbers = pack.indices(&[7; 40_000]);
    let view = pack.accessors[numbers]["bufferView"].clone();
    let node = |number: usize| {
        json!({"mesh": 0, "extensions":
            {"EXT_mesh_gpu_instancing": {"attributes": {"_FEATURE_ID_0": number}}}})
    };
    let mut nodes = vec![node(numbers)];
    for count in 1..50 {
        pack.accessors
            .push(json!({"bufferView": view, "componentType": 5123, "count": count, "type": "SCALAR"}));
        nodes.push(node(pack.accessors.len() - 1));
    }
    let json = pack.json(json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"], "scenes": [{"nodes": (0..50).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
    }));
    let file = glb(&json, &pack.bin);
    for compression in Compression::ALL {
        let (bytes, _) = packed(&file, compression, false);
        assert!(bytes.len() < 2 * file.len(), "{} bytes of {}: {compression:?}", bytes.len(), file.len());
        let (json, bin) = split(&bytes);
        let index = |value: &Value| value.as_u64().unwrap() as usize;
        let of_node = |node: usize| {
            let attributes = &json["nodes"][node]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
            &json["accessors"][index(&attributes["_FEATURE_ID_0"])]
        };
        assert!((1..50).all(|node| of_node(node)["count"] == node));
        let view = &json["bufferViews"][index(&of_node(0)["bufferView"])];
        let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        assert_eq!(bin[start..start + 4], [7, 0, 7, 0]);
    }
}

#[test]
fn constant_tracks_have_one_keyframe_and_equal_data_are_written_once() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[1.0, 2.0, 3.0], [4.0, 2.0, 3.0], [1.0, 7.0, 3.5]]);
    let [times, same_times, longer] =
        [[0.0, 0.5, 1.0], [0.0, 0.5, 1.0], [0.0, 0.5, 2.0]].map(|t| pack.floats("SCALAR", 1, &t));
    let moved = pack.floats("VEC3", 3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0]);
    let still = pack.floats("VEC3", 3, &[2.0; 9]);
    let track = |input: usize, output: usize| json!({"input": input, "output": output});
    let channel =
        |sampler: usize, path: &str| json!({"sampler": sampler, "target": {"node": 0, "path": path}});
    let json = pack.json(json!({
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "one"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
        "animations": [
            {"name": "within", "samplers": [track(times, moved), track(same_times, still)],
             "channels": [channel(0, "translation"), channel(1, "scale")]},
            {"name": "beyond", "samplers": [track(times, moved), track(longer, still)],
             "channels": [channel(0, "translation"), channel(1, "scale")]},
        ],
    }));
    let file = glb(&json, &pack.bin);
    let counts = |json: &Value, animation: usize| {
        [(0, "input"), (0, "output"), (1, "input"), (1, "output")].map(|(sampler, key)| {
            let index = json["animations"][animation]["samplers"][sampler][key].as_u64().unwrap();
            json["accessors"][index as usize]["count"].as_u64().unwrap()
        })
    };
    for compression in Compression::ALL {
        let (bytes, _) = packed(&file, compression, true);
        let (json, _) = split(&bytes);
        assert_eq!(counts(&json, 0), [3, 3, 1, 1], "{compression:?}");
        assert_eq!(counts(&json, 1), [3; 4], "the track that ends last gives the length: {compression:?}");
        let [before, after] =
            [&file, &bytes].map(|bytes| read_model_bytes(bytes, &ReadOptions::default()).unwrap().model);
        for seconds in [0.0, 0.3, 0.8] {
            let [a, b] = [&before, &after].map(|model| model.bounds(&pose(model, seconds)).unwrap());
            assert!((a.max[0] - b.max[0]).abs() < 2e-3, "{a:?} {b:?}");
        }
        let (bytes, _) = packed(&file, compression, false);
        let (json, _) = split(&bytes);
        assert_eq!(counts(&json, 0), [3; 4], "without rounding all keyframes stay");
        let samplers = &json["animations"][0]["samplers"];
        let is_packed = compression != Compression::None;
        assert_eq!(samplers[0]["input"] == samplers[1]["input"], is_packed, "{compression:?}");
    }
}

#[test]
fn a_mesh_of_another_format_is_packed_too() {
    let mesh = read_bytes(WAVE, &ReadOptions::default()).unwrap().mesh;
    let mut sizes = Vec::new();
    for packing in [
        Packing::default(),
        Packing::new(Compression::Meshopt, false),
        Packing::new(Compression::Meshopt, true),
        Packing::new(Compression::MeshoptKhr, true),
    ] {
        for format in [Format::Glb, Format::Gltf] {
            let mut options = WriteOptions::default();
            options.packing = packing;
            let mut bytes = Vec::new();
            write_to(&mesh, format, &options, &mut bytes).unwrap();
            let again = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
            assert_eq!(again.face_count(), mesh.face_count());
            if format == Format::Glb {
                sizes.push(bytes.len());
            }
        }
    }
    assert!(sizes.is_sorted_by(|a, b| a > b), "{sizes:?}");
}

/// Fault C7: the extension stayed required after positions had become floats.
#[test]
fn extensions_that_nothing_needs_any_more_are_left_out() {
    let (quantized, _) = packed(WAVE, Compression::None, true);
    let before = scene(&quantized);
    let same: Vec<Option<TriMesh>> = before.meshes().iter().map(|m| Some((*m.mesh).clone())).collect();
    let mut out = Vec::new();
    // Texture coordinates within one image may stay 16-bit fractions, which need no extension.
    let half: Vec<Option<TriMesh>> = same
        .into_iter()
        .map(|mesh| {
            let mut mesh = mesh?;
            if let Positions::F32(p) = mesh.positions() {
                let moved = p.iter().map(|p| p.map(|x| x + 0.25)).collect();
                mesh = TriMesh::new(Positions::F32(moved), mesh.surface().triangles().to_vec()).unwrap();
            }
            Some(mesh)
        })
        .collect();
    let written = before.write(&half, Format::Glb, &|_| None, &mut out).unwrap();
    let (json, _) = split(&out);
    assert!(json["extensionsRequired"].is_null() && json["extensionsUsed"].is_null(), "{json}");
    assert!(written.warnings.iter().any(|w| w.text.contains("--quantize")), "{:?}", written.warnings);
    let (_, written) = packed(KHR, Compression::Meshopt, false);
    assert!(written.warnings.is_empty(), "{:?}", written.warnings);
    let mut out = Vec::new();
    let written = scene(KHR).write(&[], Format::Glb, &|_| None, &mut out).unwrap();
    assert!(written.warnings.iter().any(|w| w.text.contains("--compress")), "{:?}", written.warnings);
}

#[test]
fn sizes_come_from_the_structure() {
    let (json, bin) = everything();
    let sizes = lodsmith_io::gltf::sizes(&glb(&json, &bin), &ReadOptions::default()).unwrap();
    // Two nodes, each with two primitives of two triangles and one of lines.
    assert_eq!((sizes.triangles, sizes.draw_calls, sizes.texture_bytes), (8, 6, 0));
    let (bytes, _) = packed(&glb(&json, &bin), Compression::Meshopt, true);
    let after = lodsmith_io::gltf::sizes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!((after.triangles, after.draw_calls, after.texture_bytes), (8, 6, 0));
    assert_eq!(after.file_bytes, Some(bytes.len() as u64));
}

#[test]
fn json_stays_the_same_beside_geometry() {
    let (json, bin) = everything();
    let (bytes, _) = packed(&glb(&json, &bin), Compression::Meshopt, false);
    let (after, _) = split(&bytes);
    for key in ["extras", "cameras", "materials", "textures", "scenes", "scene"] {
        assert_eq!(json[key], after[key], "{key}");
    }
    let names = |json: &Value| {
        json["nodes"].as_array().unwrap().iter().map(|n| n["name"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&json), names(&after));
}

/// Of several primitives with one list of positions, each gets its own vertices.
#[test]
fn bounds_are_those_of_the_vertices_that_stay() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[-9.0, -9.0, -9.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 3.0]]);
    let indices = pack.indices(&[1, 2, 3]);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices});
    let json = pack.json(json!({
        "meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
    }));
    for compression in Compression::ALL {
        for quantize in [false, true] {
            if compression == Compression::None && !quantize {
                continue;
            }
            let (bytes, _) = packed(&glb(&json, &pack.bin), compression, quantize);
            let accessors = split(&bytes).0["accessors"].clone();
            let accessor = accessors.as_array().unwrap().iter().find(|a| a["type"] == "VEC3").unwrap();
            let bounds = scene(&bytes).meshes()[0].mesh.positions().view().bounds().unwrap();
            let title = format!("{compression:?}, {quantize}: {accessor}");
            assert_eq!(accessor["count"], 3, "{title}");
            for (name, bound) in [("min", bounds.min), ("max", bounds.max)] {
                let declared = [0, 1, 2].map(|k| accessor[name][k].as_f64().unwrap());
                assert_eq!(declared, bound, "{title}");
            }
        }
    }
}
