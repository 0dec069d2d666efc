//! Malformed PLY, STL and glTF files, and their errors.

use lodsmith_core::{Positions, VertexId};
use lodsmith_io::{Loaded, ReadError, ReadOptions, gltf, ply, stl};
use serde_json::{Value, json};

fn error_text(result: Result<Loaded, ReadError>) -> String {
    match result {
        Ok(_) => "read without an error".to_owned(),
        Err(e) => e.to_string(),
    }
}

fn ply_error(bytes: &[u8]) -> String {
    error_text(ply::read(bytes, &ReadOptions::default()))
}

fn stl_error(bytes: &[u8]) -> String {
    error_text(stl::read(bytes, &ReadOptions::default()))
}

// ---- PLY

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

fn ply_text(vertices: &str, faces: &str, body: &str) -> Vec<u8> {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\n{XYZ}element face {faces}\n\
         property list uchar int vertex_indices\nend_header\n{body}"
    )
    .into_bytes()
}

fn ply_binary(vertices: &[[f32; 3]], faces: &[&[i32]]) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{XYZ}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    vertices.as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    for f in faces {
        bytes.push(f.len() as u8);
        f.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    bytes
}

const CORNERS: [[f32; 3]; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn ply_headers_that_claim_too_much() {
    assert_eq!(
        ply_error(&ply_text("4000000000000", "1", "0 0 0\n")),
        "the header claims 4000000000000 records of element vertex, which end at byte 24000000000000 of the body or \
         later, but the body has 6 bytes: the file is cut off, or the header is wrong"
    );
    // Products that overflow 64 bits.
    let huge = u64::MAX.to_string();
    assert!(
        ply_error(&ply_text(&huge, &huge, "0 0 0\n")).starts_with("the header claims 18446744073709551615")
    );
    let bytes = ply_binary(&CORNERS, &[&[0, 1, 2]]);
    assert_eq!(
        ply_error(&bytes[..bytes.len() - 20]),
        "the header claims 3 records of element vertex, which end at byte 36 of the body or later, but the body has 29 \
         bytes: the file is cut off, or the header is wrong"
    );
}

#[test]
fn ply_faces_that_are_wrong_are_named() {
    for (faces, wanted) in [
        (vec![&[0, 1, 2][..], &[0, 3, 1]], "face 1: uses vertex 3, but the mesh has 3"),
        (vec![&[0, 1, 2], &[0, 1, -1]], "face 1: uses vertex -1, but the mesh has 3"),
        (vec![&[0, 1, 2, 0], &[0, 1, i32::MAX]], "face 1: uses vertex 2147483647, but the mesh has 3"),
    ] {
        assert_eq!(ply_error(&ply_binary(&CORNERS, &faces)), wanted);
    }
    let mut bytes = ply_binary(&CORNERS, &[&[0, 1, 2]]);
    let at = bytes.len() - 13;
    bytes[at] = 200;
    assert_eq!(
        ply_error(&bytes),
        "face 0: vertex_indices claims 200 entries, but 12 bytes are left: the file is cut off, or the number is wrong"
    );
}

#[test]
fn ply_text_that_is_wrong_is_named_with_its_line() {
    let body = "0 0 0\n1 0 0\n0 1 0\n";
    let with = |face: &str| ply_error(&ply_text("3", "1", &format!("{body}{face}")));
    assert_eq!(with("3 0 1 x"), "line 13: `x` is not a number (vertex_indices of face 0)");
    assert_eq!(with("3 0 1 1.5"), "face 0: vertex_indices is 1.5, but must be a whole number");
    for (face, claims, left) in [("3 0 1", 3, 4), ("-3 0 1 2", -3, 6)] {
        assert_eq!(
            with(face),
            format!(
                "face 0: vertex_indices claims {claims} entries, but {left} bytes are left: the file is cut off, or the \
                 number is wrong"
            )
        );
    }
    assert_eq!(with("2 0 1"), "no faces in the file (3 vertices): nothing to work on");
    let bad = ply_text("3", "1", "0 0 0\n1 ? 0\n0 1 0\n3 0 1 2");
    assert_eq!(ply_error(&bad), "line 11: `?` is not a number (y of vertex 1)");
}

#[test]
fn ply_elements_that_lack_something() {
    let start = "ply\nformat ascii 1.0\n";
    for (rest, wanted) in [
        ("end_header\n", "the header does not declare an element `vertex`"),
        (
            "element vertex 1\nproperty float x\nend_header\n0\n",
            "element vertex: lacks one of the properties x, y, z",
        ),
        ("element vertex 1\nproperty quad x\n", "line 4: `quad` is not a PLY number type"),
        ("element vertex 1\nelement vertex 1\n", "line 4: element vertex is declared twice"),
    ] {
        assert_eq!(ply_error(format!("{start}{rest}").as_bytes()), wanted);
    }
    let text =
        format!("{start}element vertex 1\n{XYZ}element face 1\nproperty int a\nend_header\n0 0 0\n1\n");
    assert_eq!(ply_error(text.as_bytes()), "element face: lacks a list vertex_indices");
    assert_eq!(ply_error(b""), "line 1: a PLY file begins with a line `ply`");
}

#[test]
fn ply_of_every_type_and_order_with_unknown_things() {
    // A list before the coordinates, coordinates out of order, an unknown element, indices as doubles.
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty list ushort short tags\n\
        property int16 z\nproperty uint8 x\nproperty float64 y\nelement camera 1\nproperty list char double pose\n\
        element face 1\nproperty char kind\nproperty list uint float64 vertex_index\nend_header\n"
        .to_vec();
    for (z, x, y) in [(-5i16, 0u8, 0.5f64), (-5, 200, 0.5), (-5, 0, 2.5)] {
        bytes.extend([0, 1, 0, 9]);
        bytes.extend(z.to_be_bytes());
        bytes.push(x);
        bytes.extend(y.to_be_bytes());
    }
    bytes.push(2);
    bytes.extend([0; 16]);
    bytes.extend([7, 0, 0, 0, 3]);
    [0.0f64, 1.0, 2.0].iter().for_each(|i| bytes.extend(i.to_be_bytes()));
    let got = ply::read(&bytes, &ReadOptions::default()).unwrap();
    let wanted = vec![[0.0, 0.5, -5.0], [200.0, 0.5, -5.0], [0.0, 2.5, -5.0]];
    assert_eq!(*got.mesh.positions(), Positions::F64(wanted));
    let said: Vec<String> = got.warnings.into_iter().map(|w| w.text).collect();
    assert_eq!(
        said,
        [
            "vertex properties are not supported: tags dropped",
            "element camera is not supported: 1 records dropped"
        ]
    );
}

// ---- STL

#[test]
fn stl_counts_that_are_too_large() {
    let mut bytes = vec![b' '; 80];
    bytes.extend(4_000_000_000u32.to_le_bytes());
    bytes.extend([0; 100]);
    assert_eq!(
        stl_error(&bytes),
        "the header claims 4000000000 facets, which take 200000000084 bytes, but the file has 184: it is cut off, or \
         the header is wrong"
    );
    let short =
        "30 bytes are not an STL file: a binary file has at least 84, a text file begins with `solid`";
    assert_eq!(stl_error(&[0; 30]), short);
    let empty = "no faces in the file (0 vertices): nothing to work on";
    assert_eq!(stl_error(&[0; 84]), empty);
    assert_eq!(stl_error(b"solid empty\nendsolid empty\n"), empty);
}

// ---- glTF

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((12 + 8 + text.len() + 8 + bin.len()) as u32).to_le_bytes());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(bin);
    bytes
}

fn read_glb(json: &Value, bin: &[u8]) -> Result<Loaded, ReadError> {
    gltf::read(&glb(json, bin), &ReadOptions::default())
}

/// One triangle: three positions, three 16-bit indices, two bytes of padding.
fn triangle() -> (Value, Vec<u8>) {
    let mut bin: Vec<u8> = CORNERS.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bin.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let json = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "buffers": [{"byteLength": 44}],
    });
    (json, bin)
}

#[test]
fn gltf_numbers_that_are_wrong_are_named() {
    let (json, bin) = triangle();
    assert_eq!(error_text(read_glb(&json, &bin)), "read without an error");

    let big = 1u64 << 53;
    let max = u64::MAX;
    let beyond = |view: &str, what: &str| format!("{what} reach beyond {view}");
    let view0 = |what: &str| beyond("bufferViews[0] of 36 bytes", &format!("accessors[0]: {what}"));
    let whole = |what: &str| format!("accessors[0]: {what}, not a whole number from 0");
    let count = "/accessors/0/count";
    let primitive = "meshes[0].primitives[0]";
    let cases: Vec<(&str, Value, String)> = vec![
        (count, json!(4), view0("4 elements of 12 bytes from byte 0")),
        (count, json!(big), view0("9007199254740992 elements of 12 bytes from byte 0")),
        (count, json!(max), view0("18446744073709551615 elements of 12 bytes from byte 0")),
        (count, json!(-1), whole("count is -1")),
        (count, json!(1.5), whole("count is 1.5")),
        (count, json!(1e300), whole("count is 1e+300")),
        (count, json!("3"), whole("count is \"3\"")),
        (count, Value::Null, "accessors[0]: count is missing".into()),
        ("/accessors/0/byteOffset", json!(max), view0(&format!("3 elements of 12 bytes from byte {max}"))),
        (
            "/accessors/1/componentType",
            json!(5126),
            beyond("bufferViews[1] of 6 bytes", "accessors[1]: 3 elements of 4 bytes from byte 0"),
        ),
        (
            "/accessors/0/componentType",
            json!(5130),
            "accessors[0]: componentType is 5130, expected 5120 to 5123, 5125 or 5126".into(),
        ),
        (
            "/accessors/0/type",
            json!("VEC2"),
            format!("accessors[0]: POSITION of {primitive} is of type VEC2, expected VEC3"),
        ),
        (
            "/accessors/0/type",
            json!("MAT4"),
            "accessors[0]: the type is MAT4, expected SCALAR or VEC2 to VEC4".into(),
        ),
        ("/accessors/0/bufferView", json!(2), "accessors[0]: refers to bufferViews[2], but the file has 2".into()),
        (
            "/bufferViews/0/byteLength",
            json!(45),
            beyond("buffers[0] of 44 bytes", "bufferViews[0]: 45 bytes from byte 0"),
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(max),
            beyond("buffers[0] of 44 bytes", &format!("bufferViews[0]: 36 bytes from byte {max}")),
        ),
        (
            "/bufferViews/0/byteStride",
            json!(8),
            "bufferViews[0]: byteStride is 8, but an element of accessors[0] has 12 bytes".into(),
        ),
        ("/bufferViews/0/byteStride", json!(max), view0("3 elements of 12 bytes from byte 0")),
        ("/bufferViews/0/buffer", json!(1), "bufferViews[0]: refers to buffers[1], but the file has 1".into()),
        (
            "/buffers/0/byteLength",
            json!(big),
            "buffers[0]: byteLength is 9007199254740992, but there are 44 bytes".into(),
        ),
        (
            "/meshes/0/primitives/0/indices",
            json!(9),
            format!("{primitive}: refers to accessors[9], but the file has 2"),
        ),
        (
            "/meshes/0/primitives/0/mode",
            json!(7),
            format!("{primitive}: mode 7 is unknown: 0 to 6 are valid"),
        ),
        (
            "/meshes/0/primitives/0/mode",
            json!(1),
            "no faces in the file (0 vertices): nothing to work on".into(),
        ),
        (
            "/meshes/0/primitives/0/attributes/NORMAL",
            json!(1),
            format!("accessors[1]: NORMAL of {primitive} is of type SCALAR, expected VEC3"),
        ),
        ("/nodes/0/mesh", json!(3), "nodes[0]: refers to meshes[3], but the file has 1".into()),
        ("/nodes/0/matrix", json!([1, 2]), "nodes[0]: matrix is not 16 numbers".into()),
        (
            "/nodes/0/children",
            json!([0]),
            "nodes[0]: is reached twice: nodes must form a tree, but this one has two parents or is its own ancestor".into(),
        ),
        ("/scene", json!(1), "scene: refers to scenes[1], but the file has 1".into()),
        ("/asset/version", json!("1.1"), "glTF 1.0 is not read: convert the file to glTF 2.0 first".into()),
        ("/asset/version", Value::Null, "asset: the version is missing".into()),
        (
            "/extensionsRequired",
            json!(["VENDOR_x"]),
            "the file requires the extension VENDOR_x, which is not supported".into(),
        ),
    ];
    for (pointer, value, wanted) in cases {
        let (mut json, bin) = triangle();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        json.pointer_mut(parent).unwrap()[key] = value.clone();
        assert_eq!(error_text(read_glb(&json, &bin)), wanted, "{pointer} = {value}");
    }
}

#[test]
fn gltf_indices_that_are_floats_or_beyond_the_vertices() {
    let (mut json, mut bin) = triangle();
    json["accessors"][1] = json!({"bufferView": 0, "componentType": 5126, "count": 9, "type": "SCALAR"});
    assert_eq!(
        error_text(read_glb(&json, &bin)),
        "accessors[1]: indices must be unsigned integers, not floats"
    );
    let (json, _) = triangle();
    bin[38] = 3;
    assert_eq!(
        error_text(read_glb(&json, &bin)),
        "accessors[1]: entry 1 is the index 3, but meshes[0].primitives[0] has 3 vertices"
    );
}

#[test]
fn gltf_sparse_accessors() {
    let sparse = |index: u16, count: u64| {
        let (mut json, mut bin) = triangle();
        bin.extend(index.to_le_bytes());
        bin.extend([0, 0]);
        [9.0f32, 8.0, 7.0].iter().for_each(|x| bin.extend(x.to_le_bytes()));
        json["buffers"][0]["byteLength"] = 60.into();
        let view = json!({"buffer": 0, "byteOffset": 44, "byteLength": 16});
        json["bufferViews"].as_array_mut().unwrap().push(view);
        json["accessors"][0]["sparse"] = json!({
            "count": count,
            "indices": {"bufferView": 2, "componentType": 5123},
            "values": {"bufferView": 2, "byteOffset": 4},
        });
        read_glb(&json, &bin)
    };
    let got = sparse(1, 1).unwrap();
    assert_eq!(*got.mesh.positions(), Positions::F32(vec![[0.0; 3], [9.0, 8.0, 7.0], [0.0, 1.0, 0.0]]));
    assert_eq!(error_text(sparse(3, 1)), "accessors[0]: the sparse index 3 is beyond the 3 elements");
    assert_eq!(
        error_text(sparse(1, 1 << 53)),
        "accessors[0]: 9007199254740992 elements of 2 bytes from byte 0 reach beyond bufferViews[2] of 16 bytes"
    );
}

#[test]
fn gltf_accessors_without_bytes_stay_small() {
    let (mut json, bin) = triangle();
    json["accessors"][0] = json!({"componentType": 5126, "count": 1u64 << 53, "type": "VEC3"});
    assert_eq!(
        error_text(read_glb(&json, &bin)),
        "accessors[0]: claims 9007199254740992 elements, but has no bufferView"
    );
}

#[test]
fn gltf_that_places_a_mesh_too_often_is_refused_before_it_is_made() {
    assert_eq!(
        placed_3000_times(500_000),
        "number of triangles placed by nodes is 499998000, above the limit of 268435456"
    );
    let said = placed_3000_times(100_000);
    assert!(
        said.starts_with(
            "number of triangles placed by nodes, for a file of this size, is 99999000, above the limit of "
        ),
        "{said}"
    );
    assert!(placed_3000_times(300).is_empty());
}

/// Returns the error for a file that instantiates a mesh of `count` vertices 3000 times.
fn placed_3000_times(count: u32) -> String {
    let (mut json, _) = triangle();
    let bin: Vec<u8> = vec![0; count as usize * 12];
    json["accessors"] = json!([{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}]);
    json["bufferViews"] = json!([{"buffer": 0, "byteLength": bin.len()}]);
    json["buffers"] = json!([{"byteLength": bin.len()}]);
    json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": 0}}]}]);
    json["nodes"] = vec![json!({"mesh": 0}); 3_000].into();
    json["scenes"] = json!([{"nodes": (0..3_000).collect::<Vec<u32>>()}]);
    read_glb(&json, &bin).err().map_or_else(String::new, |e| e.to_string())
}

#[test]
fn json_may_be_padded_with_zeros() {
    let (mut json, bin) = triangle();
    // A length that needs padding, whatever the rest of the text is.
    for extra in ["", "a", "ab", "abc"] {
        json["asset"]["extras"] = extra.into();
        let mut bytes = glb(&json, &bin);
        let end = 20 + u32::from_le_bytes(*bytes[12..].first_chunk().unwrap()) as usize;
        bytes[20..end].iter_mut().rev().take_while(|b| **b == b' ').for_each(|b| *b = 0);
        assert_eq!(gltf::read(&bytes, &ReadOptions::default()).unwrap().mesh.face_count(), 1, "{extra}");
    }
}

#[test]
fn glb_containers_that_are_wrong() {
    let (json, bin) = triangle();
    let good = glb(&json, &bin);
    let total = good.len();
    let read = |bytes: &[u8]| error_text(gltf::read(bytes, &ReadOptions::default()));
    let with = |at: usize, value: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        read(&bytes)
    };
    assert_eq!(
        with(8, u32::MAX),
        format!(
            "the header claims 4294967295 bytes, but the file has {total}: it is cut off, or the header is wrong"
        )
    );
    let left = total - 20;
    assert_eq!(
        with(12, u32::MAX),
        format!("byte 12: a chunk claims 4294967295 bytes, but {left} are left of the GLB")
    );
    assert_eq!(with(4, 1), "glTF 1.0 is not read: convert the file to glTF 2.0 first");
    assert_eq!(with(4, 3), "byte 4: GLB version 3 is not supported: only 2 is");
    assert_eq!(with(16, 0), "byte 12: the GLB has no JSON chunk");
    assert_eq!(with(8, 12), "byte 12: the GLB has no JSON chunk");
    assert_eq!(with(20, 0), "not glTF: the JSON chunk is not a JSON object");
    assert!(with(24, 0).starts_with("the JSON is damaged: "));
    assert_eq!(read(&good[..7]), "the GLB is cut off: it has 7 bytes, and its header alone takes 12");
    assert_eq!(read(b"hello"), "not glTF: it begins with neither `glTF` nor a JSON object");
    let deep = "{\"a\":".repeat(100_000);
    assert!(read(deep.as_bytes()).starts_with("the JSON is damaged: recursion"));
}

#[test]
fn gltf_buffers_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (mut json, bin) = triangle();
    std::fs::write(folder.path().join("a b.bin"), &bin).unwrap();
    let mut read = |uri: &str, folder: Option<&std::path::Path>| {
        json["buffers"][0]["uri"] = uri.into();
        let mut options = ReadOptions::default();
        options.folder = folder.map(Into::into);
        error_text(gltf::read(&serde_json::to_vec(&json).unwrap(), &options))
    };
    let here = Some(folder.path());
    assert_eq!(read("a%20b.bin", here), "read without an error");
    assert_eq!(
        read("a b.bin", None),
        "buffers[0]: the file a b.bin is needed, but no folder is known to search for it"
    );
    assert_eq!(read("none.bin", here), "buffers[0]: the file none.bin was not found");
    let leaves = "is outside the folder of the model (--asset-root DIR or --allow-outside permits it)";
    for uri in ["../a b.bin", "/etc/passwd", "%2e%2e/x.bin", "x/../../y.bin", "..\\x.bin"] {
        let path = uri.replace("%2e", ".").replace('\\', "/");
        assert_eq!(read(uri, here), format!("buffers[0]: the file {path} {leaves}"));
    }
    assert_eq!(
        read("https://example.org/a.bin", here),
        "buffers[0]: the uri `https://example.org/a.bin` is a network address; only files are read"
    );
    assert_eq!(read("data:;base64,AAAA", here), "buffers[0]: byteLength is 44, but there are 3 bytes");
    assert_eq!(read(".", here), "buffers[0]: the file . is not a regular file");
}

#[test]
fn gltf_strips_and_fans_of_quantised_corners_in_a_mirror() {
    // 2---3   Corners as bytes, 64 to the unit; a strip and a fan over them,
    // | \ |   once as they are and once in a mirror.
    // 0---1
    let (mut json, _) = triangle();
    let corners: [[i8; 4]; 4] = [[0, 0, 0, 0], [64, 0, 0, 0], [0, 64, 0, 0], [64, 64, 0, 0]];
    let mut bin: Vec<u8> = corners.as_flattened().iter().map(|&x| x as u8).collect();
    bin.extend([0, 1, 3, 2]);
    json["buffers"][0]["byteLength"] = bin.len().into();
    json["bufferViews"] = json!([
        {"buffer": 0, "byteLength": 16, "byteStride": 4},
        {"buffer": 0, "byteOffset": 16, "byteLength": 4},
    ]);
    json["accessors"] = json!([
        {"bufferView": 0, "componentType": 5120, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5121, "count": 4, "type": "SCALAR"},
    ]);
    json["meshes"] = json!([{"primitives": [
        {"attributes": {"POSITION": 0}, "mode": 5},
        {"attributes": {"POSITION": 0}, "indices": 1, "mode": 6},
    ]}]);
    let s = 1.0 / 64.0;
    json["nodes"] = json!([
        {"mesh": 0, "scale": [s, s, s]},
        {"mesh": 0, "scale": [-s, s, s], "translation": [5, 0, 0]},
    ]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let got = read_glb(&json, &bin).unwrap();
    // The two primitives share their vertices.
    assert_eq!((got.mesh.face_count(), got.mesh.vertex_count(), got.contents.meshes), (8, 8, 2));
    let view = got.mesh.positions().view();
    assert_eq!(view.get(VertexId(7)), [4.0, 1.0, 0.0]);
    for t in got.mesh.surface().triangles() {
        let [a, b, c] = t.map(|v| view.get(v));
        let turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert_eq!(turn, 1.0, "all faces look up");
    }
}
