//! Round trips from meshoptimizer's encoders to our glTF reader.

use lodsmith_core::mesh::Semantic;
use lodsmith_io::ReadOptions;
use lodsmith_io::gltf::Scene;
use meshopt::EncodeExpMode;
use serde_json::{Value, json};

/// A reproducible random generator.
struct Xorshift(u64);

impl Xorshift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Returns a number from -1 to 1.
    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

/// A compressed stream and its properties in the glTF extension.
struct Stream {
    bytes: Vec<u8>,
    mode: &'static str,
    filter: &'static str,
    count: usize,
    stride: usize,
}

/// Reads a GLB of one mesh over `vertices`: the indices and one more view are streams; the latter is read as
/// attributes `_0`, `_1` and so on, of four components each. Returns the corners and the attributes.
fn read(
    vertices: usize,
    indices: &Stream,
    data: &Stream,
    component: u32,
    size: usize,
) -> (Vec<u32>, Vec<Vec<f32>>) {
    let mut bin = vec![0u8; 12 * vertices];
    // All positions differ, so that none are merged.
    for (i, position) in bin.as_chunks_mut::<12>().0.iter_mut().enumerate() {
        position[..4].copy_from_slice(&(i as f32).to_le_bytes());
    }
    let mut views = vec![json!({ "buffer": 0, "byteLength": bin.len() })];
    for stream in [indices, data] {
        let Stream { bytes, mode, filter, count, stride } = stream;
        let mut view = json!({ "buffer": 1, "byteLength": count * stride, "extensions": {
            "KHR_meshopt_compression": {
                "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len(),
                "mode": mode, "filter": filter, "count": count, "byteStride": stride,
            },
        }});
        if *mode == "ATTRIBUTES" {
            view["byteStride"] = (*stride).into();
        }
        views.push(view);
        bin.extend_from_slice(bytes);
    }
    let last = vertices as f32 - 1.0;
    let index_type = if indices.stride == 2 { 5123 } else { 5125 };
    let mut accessors = vec![
        json!({ "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
            "min": [0, 0, 0], "max": [last, 0, 0] }),
        json!({ "bufferView": 1, "componentType": index_type, "count": indices.count, "type": "SCALAR" }),
    ];
    let mut attributes = json!({ "POSITION": 0 });
    for k in 0..data.stride / (4 * size) {
        attributes[format!("_{k}")] = accessors.len().into();
        accessors.push(json!({ "bufferView": 2, "byteOffset": 4 * size * k, "componentType": component,
            "count": data.count, "type": "VEC4" }));
    }
    let json = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_meshopt_compression"],
        "extensionsRequired": ["KHR_meshopt_compression"],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": 1 }] }],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{ "byteLength": bin.len() }, { "byteLength": 1 << 20 }],
    });
    let scene = Scene::read(&glb(&json, &bin), &ReadOptions::default()).unwrap();
    let mesh = &scene.meshes()[0].mesh;
    let corners = mesh.triangles().as_flattened().iter().map(|w| w.index() as u32).collect();
    let values = (0..data.stride / (4 * size)).map(|k| {
        // Integers that are not normalized are read as discrete attributes.
        let found = mesh.further_attributes().iter().find(|a| match &a.semantic {
            Semantic::Custom(name) | Semantic::Discrete { name, .. } => *name == format!("_{k}"),
            _ => false,
        });
        found.unwrap().values.clone()
    });
    (corners, values.collect())
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF".to_vec();
    let word = |n: usize| (n as u32).to_le_bytes();
    for part in [word(2), word(28 + text.len() + bin.len()), word(text.len()), *b"JSON"] {
        out.extend(part);
    }
    out.extend(&text);
    out.extend(word(bin.len()));
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

/// Returns a stream of indices that use all vertices, and the indices: three per triangle.
fn indices(vertices: usize, random: &mut Xorshift) -> (Stream, Vec<u32>) {
    let mut all: Vec<u32> = (0..vertices as u32).collect();
    for _ in 0..vertices {
        // Some indices near the previous one, some anywhere.
        let last = all[all.len() - 1];
        let near = (last + (random.next() % 7) as u32).saturating_sub(3).min(vertices as u32 - 1);
        all.push(if !random.next().is_multiple_of(4) {
            near
        } else {
            (random.next() % vertices as u64) as u32
        });
    }
    while !all.len().is_multiple_of(3) {
        all.push(0);
    }
    let is_list = random.next().is_multiple_of(2);
    let (bytes, mode) = if is_list {
        (meshopt::encode_index_buffer(&all, vertices).unwrap(), "TRIANGLES")
    } else {
        (meshopt::encode_index_sequence(&all, vertices).unwrap(), "INDICES")
    };
    if is_list {
        // The encoder rotates the corners of triangles; the crate's own decoder gives the result.
        let rotated = meshopt::decode_index_buffer::<u32>(&bytes, all.len()).unwrap();
        all.copy_from_slice(&rotated);
    }
    let stride = if vertices < 65535 && random.next().is_multiple_of(2) { 2 } else { 4 };
    (Stream { bytes, mode, filter: "NONE", count: all.len(), stride }, all)
}

fn elements<const STRIDE: usize>(random: &mut Xorshift) {
    for vertices in [1, 2, 15, 16, 17, 33, 129, 257, 600] {
        for version in [0, 1] {
            // Only the highest level rotates the bits of a channel.
            for level in [0, 2, 3] {
                let mut data: Vec<[u8; STRIDE]> = Vec::with_capacity(vertices);
                for i in 0..vertices {
                    let before = data.last().copied().unwrap_or([7; STRIDE]);
                    data.push(std::array::from_fn(|k| {
                        let before = before[k];
                        // Constant bytes, slowly changing bytes, and random bytes.
                        match (k / 4 + i / 40) % 5 {
                            0 => before,
                            1 => before.wrapping_add((random.next() % 3) as u8),
                            2 => before.wrapping_add((random.next() % 16) as u8).wrapping_sub(8),
                            3 if k % 4 == 1 => (random.next() % 4) as u8,
                            _ => random.next() as u8,
                        }
                    }));
                }
                let bytes = meshopt::encode_vertex_buffer_level(&data, level, Some(version)).unwrap();
                let stream =
                    Stream { bytes, mode: "ATTRIBUTES", filter: "NONE", count: vertices, stride: STRIDE };
                let (packed, corners) = indices(vertices, random);
                let (got_corners, got) = read(vertices, &packed, &stream, 5121, 1);
                assert_eq!(got_corners, corners);
                for (k, values) in got.iter().enumerate() {
                    let expected: Vec<f32> =
                        data.iter().flat_map(|e| e[4 * k..4 * k + 4].iter().map(|&b| f32::from(b))).collect();
                    assert_eq!(*values, expected, "{vertices} of {STRIDE}, version {version}, level {level}");
                }
            }
        }
    }
}

#[test]
fn elements_and_indices() {
    let mut random = Xorshift(7);
    elements::<4>(&mut random);
    elements::<8>(&mut random);
    elements::<20>(&mut random);
    elements::<64>(&mut random);
    elements::<252>(&mut random);
}

/// Smooth floats, whose bits differ in few places: the encoder rotates these.
#[test]
fn floats_without_loss() {
    let data: Vec<[f32; 4]> =
        (0..700).map(|i| [0.0, 0.3, 0.6, 0.9].map(|p| (i as f32 * 0.01 + p).sin())).collect();
    for level in 0..=3 {
        let bytes = meshopt::encode_vertex_buffer_level(&data, level, Some(1)).unwrap();
        let stream = Stream { bytes, mode: "ATTRIBUTES", filter: "NONE", count: data.len(), stride: 16 };
        let (packed, _) = indices(data.len(), &mut Xorshift(level as u64 + 1));
        let (_, got) = read(data.len(), &packed, &stream, 5126, 4);
        assert_eq!(got[0], data.as_flattened());
    }
}

#[test]
fn filters() {
    let mut random = Xorshift(11);
    let vertices = 300;
    let unit = |random: &mut Xorshift| -> [f32; 4] {
        let v = [0; 4].map(|_| random.unit());
        let length = v.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
        v.map(|x| x / length)
    };
    let fours: Vec<[f32; 4]> = (0..vertices).map(|_| unit(&mut random)).collect();
    let directions: Vec<[f32; 4]> = fours
        .iter()
        .map(|v| {
            let length = v[..3].iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-3);
            [v[0] / length, v[1] / length, v[2] / length, v[3]]
        })
        .collect();
    let colors: Vec<[f32; 4]> = fours.iter().map(|v| v.map(f32::abs)).collect();
    let (packed, _) = indices(vertices, &mut random);
    let check = |bytes: Vec<u8>, filter, stride, component, size, expected: Vec<f32>, max_error: f32| {
        let stream = Stream { bytes, mode: "ATTRIBUTES", filter, count: vertices, stride };
        let (_, got) = read(vertices, &packed, &stream, component, size);
        let error = got[0].iter().zip(&expected).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
        assert!(error <= max_error, "{filter}: off by {error}");
    };
    for bits in [4, 8, 12, 16] {
        let numbers = meshopt::encode_filter_oct::<i16>(&directions, bits);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_oct(&mut expected);
        check(
            bytes,
            "OCTAHEDRAL",
            8,
            5122,
            2,
            expected.iter().flatten().map(|&x| f32::from(x)).collect(),
            1.0,
        );

        let numbers = meshopt::encode_filter_quat(&fours, bits);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_quat(&mut expected);
        check(
            bytes,
            "QUATERNION",
            8,
            5122,
            2,
            expected.iter().flatten().map(|&x| f32::from(x)).collect(),
            1.0,
        );

        let numbers = meshopt::encode_filter_exp(&fours, bits, EncodeExpMode::Separate);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_exp(&mut expected);
        check(
            bytes,
            "EXPONENTIAL",
            16,
            5126,
            4,
            expected.iter().flatten().map(|&x| f32::from_bits(x)).collect(),
            0.0,
        );

        let numbers = meshopt::encode_filter_color::<u16>(&colors, bits);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_color(&mut expected);
        check(bytes, "COLOR", 8, 5123, 2, expected.iter().flatten().map(|&x| f32::from(x)).collect(), 1.0);
    }
    for bits in [4, 8] {
        let numbers = meshopt::encode_filter_oct::<i8>(&directions, bits);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_oct(&mut expected);
        check(
            bytes,
            "OCTAHEDRAL",
            4,
            5120,
            1,
            expected.iter().flatten().map(|&x| f32::from(x)).collect(),
            1.0,
        );

        let numbers = meshopt::encode_filter_color::<u8>(&colors, bits);
        let bytes = meshopt::encode_vertex_buffer(&numbers).unwrap();
        let mut expected = numbers;
        meshopt::decode_filter_color(&mut expected);
        check(bytes, "COLOR", 4, 5121, 1, expected.iter().flatten().map(|&x| f32::from(x)).collect(), 1.0);
    }
}
