//! Conversion of materials from OBJ to glTF.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use lodsmith_io::{Format, ReadOptions, Textures, Warning, WriteOptions, read_path, write_to};
use serde_json::{Value, json};
use tempfile::TempDir;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x02\x08\x02\0\0\0";
const JPEG: &[u8] = b"\xff\xd8\xff\xc0\0\x0b\x08\0\x03\0\x02\x01\x01\x11\0";

const VERTEX_LINES: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
const FACES: &str =
    "f 1/1 2/2 3/3\nusemtl wood\nf 1/1 3/3 4/4\nusemtl glass\nf 1/1 2/2 4/4\nusemtl wood\nf 2/2 3/3 4/4\n";
const LIBRARY: &str = "newmtl unused\nmap_Kd unused.png\nnewmtl wood\nKa 1 1 1\nKd 0.5 0.25 0.125\nmap_Kd tex\\grain.png\n\
    norm bumps.jpg\nNewmtl glass\nKd 0.5 0.25 2\nd 0.25\nKe 0 1 0\nPr 0.125\nPm 1\nillum 2\nnewmtl wood\nKd 1 0 0\n";

fn folder(faces: &str, library: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    fs::create_dir(folder.path().join("tex")).unwrap();
    put("a.obj", format!("mtllib a.mtl\n{VERTEX_LINES}{faces}").as_bytes());
    put("a.mtl", library.as_bytes());
    put("tex/grain.png", PNG);
    put("bumps.jpg", JPEG);
    put("old.ppm", b"P3 1 1 255 0 0 0");
    folder
}

/// Returns the file as glTF, and the warnings.
fn written(folder: &Path, textures: Textures) -> (Value, Vec<u8>, Vec<Warning>) {
    let loaded = read_path(&folder.join("a.obj"), &ReadOptions::default()).unwrap();
    let mut options = WriteOptions::default();
    options.regions = Some(Arc::new(loaded.regions));
    options.textures = textures;
    let mut bytes = Vec::new();
    let warnings = write_to(&loaded.mesh, Format::Glb, &options, &mut bytes).unwrap().warnings;
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), bytes[28 + length..].to_vec(), warnings)
}

#[test]
fn each_material_has_a_primitive() {
    let folder = folder(FACES, LIBRARY);
    let (json, bin, warnings) = written(folder.path(), Textures::Copy);
    assert_eq!(warnings, []);
    assert_eq!(
        json["materials"],
        json!([
            {
                "name": "wood",
                "pbrMetallicRoughness":
                    {"metallicFactor": 0.0, "roughnessFactor": 1.0, "baseColorTexture": {"index": 0}},
                "normalTexture": {"index": 1},
            },
            {
                "name": "glass",
                "pbrMetallicRoughness":
                    {"metallicFactor": 1.0, "roughnessFactor": 0.125, "baseColorFactor": [0.5, 0.25, 1.0, 0.25]},
                "emissiveFactor": [0.0, 1.0, 0.0],
                "alphaMode": "BLEND",
            },
        ])
    );
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    let shown = |p: &Value| {
        let indices = &json["accessors"][p["indices"].as_u64().unwrap() as usize];
        (p["material"].as_u64(), indices["count"].as_u64().unwrap())
    };
    assert_eq!(primitives.iter().map(shown).collect::<Vec<_>>(), [(Some(0), 6), (Some(1), 3), (None, 3)]);
    assert!(primitives.iter().all(|p| p["attributes"] == primitives[0]["attributes"]));
    let images = json["images"].as_array().unwrap();
    assert_eq!(images.len(), 2);
    for (image, (name, kind, content)) in
        images.iter().zip([("grain", "image/png", PNG), ("bumps", "image/jpeg", JPEG)])
    {
        assert_eq!((&image["name"], &image["mimeType"]), (&name.into(), &kind.into()));
        let view = &json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let at = |key: &str| view[key].as_u64().unwrap() as usize;
        assert_eq!(&bin[at("byteOffset")..at("byteOffset") + at("byteLength")], content);
    }
    assert_eq!(json["textures"], json!([{"source": 0}, {"source": 1}]));
}

#[test]
fn one_material_is_one_primitive() {
    let folder = folder("usemtl glass\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n", LIBRARY);
    let (json, _, warnings) = written(folder.path(), Textures::Link);
    assert_eq!(warnings, []);
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!((primitives.len(), &primitives[0]["material"]), (1, &0.into()));
    assert_eq!(json["materials"][0]["name"], "glass");
}

#[test]
fn dropped_properties_are_reported() {
    let library =
        "newmtl wood\nKs 1 1 1\nNs 20\nmap_Ks y.png\nmap_d x.png\nmap_Kd -s 2 2 2 old.ppm\nbump none.png\n";
    let folder = folder(FACES, library);
    let (json, _, warnings) = written(folder.path(), Textures::Copy);
    let texts: Vec<&str> = warnings.iter().map(|w| w.text.as_str()).collect();
    assert_eq!(
        texts,
        [
            "texture old.ppm is neither PNG nor JPEG: left out",
            "texture none.png was not found: left out",
            "glTF cannot represent these material properties: map_d, map_kd -s, map_ks",
            "glTF has another shading model: ks, ns left out",
        ]
    );
    // Highlights are no data of the mesh.
    assert_eq!(warnings.iter().map(|w| w.data_lost).collect::<Vec<_>>(), [true, true, true, false]);
    assert!(json["images"].is_null() && json["textures"].is_null());
}

#[test]
fn emission_and_alpha_have_images_too() {
    let library = "newmtl wood\nmap_Kd tex/grain.png\nmap_d tex/grain.png\nmap_Ke bumps.jpg\n\
        newmtl glass\nKe 0 0 0\nmap_Ke bumps.jpg\nKd 0.5 0.5 0.5\n";
    let folder = folder(FACES, library);
    let (json, _, warnings) = written(folder.path(), Textures::Copy);
    assert_eq!(warnings, []);
    let [wood, glass] = [&json["materials"][0], &json["materials"][1]];
    assert_eq!((&wood["alphaMode"], &wood["emissiveFactor"]), (&json!("BLEND"), &json!([1.0, 1.0, 1.0])));
    assert_eq!(
        (&wood["emissiveTexture"], &glass["emissiveTexture"]),
        (&json!({"index": 1}), &json!({"index": 1}))
    );
    // Without an emissive colour, the emissive image is dropped.
    assert!(glass["emissiveFactor"].is_null() && glass["alphaMode"].is_null());
}

#[test]
fn textures_need_coordinates_and_materials_may_be_left() {
    let faces = "usemtl wood\nf 1 2 3\n";
    let bare = folder(faces, LIBRARY);
    let (json, _, warnings) = written(bare.path(), Textures::Copy);
    assert_eq!(warnings[0].text, "textures are left out: the mesh has no texture coordinates");
    assert!(json["images"].is_null() && !json["materials"].to_string().contains("Texture"), "{json}");
    let (json, _, warnings) = written(bare.path(), Textures::None);
    assert_eq!(warnings, [Warning::note("materials dropped: --textures none")]);
    assert!(json["materials"].is_null());
}
