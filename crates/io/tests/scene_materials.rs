//! Materials of a glTF scene read as one mesh: written to OBJ with a library and images, and to glTF again.

use std::fs;
use std::sync::Arc;

use lodsmith_io::{
    Format, Loaded, ReadOptions, Textures, Warning, WriteOptions, read_bytes, read_path, write_path, write_to,
};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::scenes::{PNG, Pack, data_uri, glb};

const JPEG: &[u8] = b"\xff\xd8\xff and more";

/// Returns three triangles over the same corners: `wood` with an embedded image, one without a material,
/// `a\nb` with external images.
fn scene(materials: &Value) -> Vec<u8> {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    let uvs = pack.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let mut primitive = |corners: &[u16], material: Value| {
        let indices = pack.indices(corners);
        let mut p = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "indices": indices});
        p["material"] = material;
        p
    };
    let primitives = json!([
        primitive(&[0, 1, 2], 1.into()),
        primitive(&[1, 3, 2], Value::Null),
        primitive(&[0, 1, 3], 2.into()),
        primitive(&[0, 3, 2], 1.into()),
    ]);
    let view = pack.view(PNG);
    let json = pack.json(json!({
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "samplers": [{"wrapS": 10497}, {"wrapT": 33071}],
        "textures": [{"source": 0}, {"source": 1, "sampler": 0}, {"source": 2, "sampler": 1}, {"source": 3}],
        "images": [
            {"bufferView": view, "mimeType": "image/png", "name": "bark/Grain .png"},
            {"uri": data_uri(JPEG)},
            {"uri": "outside%20it.png"},
            {"uri": "../above.png"},
        ],
    }));
    glb(&json, &pack.bin)
}

fn materials() -> Value {
    json!([
        {"name": "unused", "occlusionTexture": {"index": 3}},
        {
            "name": "wood",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 1, 1, 0.25], "baseColorTexture": {"index": 0},
                "metallicFactor": 0, "roughnessFactor": 0.75,
            },
            "normalTexture": {"index": 1}, "alphaMode": "BLEND",
        },
        {"name": "wood", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0, 0, 0.5]}, "emissiveFactor": [0, 0, 1]},
    ])
}

fn options(loaded: &Loaded, textures: Textures) -> WriteOptions {
    let mut options = WriteOptions::default();
    options.regions = Some(Arc::new(loaded.regions.clone()));
    options.textures = textures;
    options
}

/// Writes the scene as an OBJ in a new folder.
fn to_obj(materials: &Value, textures: Textures) -> (TempDir, Vec<Warning>) {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("out")).unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, scene(materials)).unwrap();
    fs::write(
        folder.path().join("outside it.png"),
        b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x02\x08\x02\0\0\0",
    )
    .unwrap();
    let loaded = read_path(&path, &ReadOptions::default()).unwrap();
    let out = folder.path().join("out/a.obj");
    let mut warnings = loaded.warnings.clone();
    warnings.extend(write_path(&loaded.mesh, &out, &options(&loaded, textures)).unwrap());
    (folder, warnings)
}

fn names(folder: &TempDir) -> Vec<String> {
    let all = fs::read_dir(folder.path().join("out")).unwrap();
    let mut names: Vec<_> = all.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn texts(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.text.as_str()).collect()
}

#[test]
fn an_obj_gets_a_library_and_the_images() {
    let (folder, warnings) = to_obj(&materials(), Textures::Copy);
    assert_eq!(warnings, []);
    assert_eq!(names(&folder), ["Grain_.png", "a.mtl", "a.obj", "image_1.jpg"]);
    let text = |name: &str| fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    assert_eq!(
        text("a.mtl"),
        "# Lodsmith\nnewmtl wood\nKd 0.5 1 1\nd 0.25\nPm 0\nPr 0.75\nmap_Kd Grain_.png\nmap_d Grain_.png\n\
         norm image_1.jpg\nnewmtl wood_1\nKd 0.5 0 0\nKe 0 0 1\nPm 1\nPr 1\n"
    );
    let obj = text("a.obj");
    assert!(obj.starts_with("# Lodsmith\nmtllib a.mtl\n"), "{obj}");
    let faces = obj.split_once("\nf ").unwrap().1;
    let order: Vec<_> = faces.lines().filter(|l| l.starts_with("usemtl")).collect();
    assert_eq!(order, ["usemtl wood", "usemtl wood_1"]);
    // The face without a material comes before all that have one.
    assert!(
        faces.starts_with("2/2 4/4 3/3\nusemtl wood\nf 1/1 2/2 3/3\nf 1/1 4/4 3/3\nusemtl wood_1\n"),
        "{faces}"
    );
    assert_eq!(fs::read(folder.path().join("out/Grain_.png")).unwrap(), PNG);
    assert_eq!(fs::read(folder.path().join("out/image_1.jpg")).unwrap(), JPEG);
}

#[test]
fn images_that_are_files_are_copied_or_linked() {
    let materials = json!([{}, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}}, {}]);
    let (folder, warnings) = to_obj(&materials, Textures::Copy);
    assert_eq!(texts(&warnings), ["dropped from the materials: clamped or mirrored textures"]);
    assert!(warnings[0].data_lost);
    assert_eq!(names(&folder), ["a.mtl", "a.obj", "outside it.png"]);
    let (folder, _) = to_obj(&materials, Textures::Link);
    assert_eq!(names(&folder), ["a.mtl", "a.obj"]);
    let library = fs::read_to_string(folder.path().join("out/a.mtl")).unwrap();
    assert!(
        library.contains("newmtl material_1\n") && library.contains("map_Kd ../outside it.png\n"),
        "{library}"
    );
    // Embedded images cannot be linked to.
    let (folder, _) = to_obj(&showing(0), Textures::Link);
    assert_eq!(names(&folder), ["Grain_.png", "a.mtl", "a.obj"]);
    let (folder, warnings) = to_obj(&showing(0), Textures::None);
    assert_eq!(texts(&warnings), ["materials dropped: --textures none"]);
    assert_eq!(names(&folder), ["a.obj"]);
}

/// Returns materials whose second one shows this texture.
fn showing(texture: usize) -> Value {
    json!([{}, {"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}, {}])
}

/// Formats without transforms of textures get the texture coordinates that these give.
#[test]
fn transforms_of_textures_move_the_coordinates() {
    let transform = json!({"KHR_texture_transform": {"scale": [0.5, 0.25], "offset": [0.25, 0.0]}});
    let mut materials = showing(0);
    materials[1]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = transform.clone();
    materials[1]["normalTexture"] = json!({"index": 0, "extensions": transform});
    let (folder, warnings) = to_obj(&materials, Textures::Copy);
    assert_eq!(texts(&warnings), [] as [&str; 0]);
    let loaded = read_path(&folder.path().join("out/a.obj"), &ReadOptions::default()).unwrap();
    let (mesh, regions) = (&loaded.mesh, loaded.mesh.regions().unwrap());
    let mut of_wood = 0;
    for (triangle, &region) in mesh.triangles().iter().zip(regions) {
        let is_moved = loaded.regions.get(region).unwrap().material == Some(&b"material_1"[..]);
        of_wood += usize::from(is_moved);
        for &wedge in triangle {
            // Texture coordinates are the positions, from the upper left corner.
            let [x, y, _] = mesh.positions().view().get(mesh.vertex_of(wedge)).map(|c| c as f32);
            let wanted = if is_moved { [0.5 * x + 0.25, 1.0 - 0.25 * y] } else { [x, 1.0 - y] };
            assert_eq!(mesh.uvs().unwrap()[wedge.index()], wanted);
        }
    }
    assert!(of_wood == 2, "{of_wood} faces");
}

#[test]
fn properties_that_a_library_cannot_store_are_reported() {
    let materials = json!([
        {"extensions": {"KHR_materials_ior": {}}},
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 3}, "metallicRoughnessTexture": {"index": 0}},
            "normalTexture": {"index": 0, "scale": 2, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}},
            "occlusionTexture": {"index": 0}, "alphaMode": "BLEND",
            "emissiveTexture": {"index": 0, "texCoord": 1}, "emissiveFactor": [1, 1, 1],
            "extensions": {"KHR_materials_clearcoat": {}, "KHR_materials_emissive_strength": {"emissiveStrength": 4}},
        },
        {
            "extensions": {
                "KHR_materials_unlit": {},
                "KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 1, 0, 1], "diffuseTexture": {"index": 9}},
            }
        },
    ]);
    let (folder, warnings) = to_obj(&materials, Textures::Copy);
    let dropped = "dropped from the materials: KHR_materials_clearcoat, KHR_materials_pbrSpecularGlossiness, \
        KHR_texture_transform, emissiveTexture with another set of texture coordinates, \
        metallicRoughnessTexture, occlusionTexture, scale of normalTexture";
    let left = "texture images[3] is outside the folder of the model (--asset-root DIR or --allow-outside permits it): \
        left out";
    assert_eq!(texts(&warnings), [left, dropped]);
    assert!(warnings.iter().all(|w| w.data_lost));
    let library = fs::read_to_string(folder.path().join("out/a.mtl")).unwrap();
    assert_eq!(
        library,
        "# Lodsmith\nnewmtl material_1\nKd 1 1 1\nKe 4 4 4\nnorm Grain_.png\nnewmtl material_2\nKd 0 1 0\nillum 0\n"
    );
}

#[test]
fn alpha_of_images_is_named_where_they_can_have_any() {
    let material = |texture: usize| json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}});
    let library = |texture| {
        let (folder, warnings) = to_obj(&json!([{}, material(texture), {}]), Textures::Copy);
        let text = fs::read_to_string(folder.path().join("out/a.mtl")).unwrap();
        (text.contains("map_d"), texts(&warnings).join(""))
    };
    assert_eq!(library(0), (true, "dropped from the materials: alphaMode MASK".to_owned()));
    assert_eq!(library(1), (false, String::new()));
}

#[test]
fn a_stream_has_the_names_only() {
    let loaded = read_bytes(&scene(&materials()), &ReadOptions::default()).unwrap();
    let mut bytes = Vec::new();
    let warnings =
        write_to(&loaded.mesh, Format::Obj, &options(&loaded, Textures::Copy), &mut bytes).unwrap().warnings;
    assert_eq!(
        texts(&warnings),
        ["a stream cannot have material files beside it: only the names of materials are written"]
    );
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("\nusemtl wood\n") && !text.contains("mtllib"), "{text}");
}

#[test]
fn materials_go_into_gltf_again() {
    let loaded = read_bytes(&scene(&materials()), &ReadOptions::default()).unwrap();
    let mut bytes = Vec::new();
    let warnings =
        write_to(&loaded.mesh, Format::Gltf, &options(&loaded, Textures::Copy), &mut bytes).unwrap().warnings;
    assert_eq!(warnings, []);
    let json: Value = serde_json::from_slice(&bytes).unwrap();
    let surface = &json["materials"][0]["pbrMetallicRoughness"];
    assert_eq!(surface["baseColorFactor"], json!([0.5, 1.0, 1.0, 0.25]));
    assert_eq!((&surface["metallicFactor"], &surface["roughnessFactor"]), (&json!(0.0), &json!(0.75)));
    assert_eq!(json["images"].as_array().unwrap().len(), 2);
    assert_eq!(
        (&json["materials"][1]["name"], &json["images"][0]["name"]),
        (&json!("wood_1"), &json!("Grain_"))
    );
}

#[test]
fn bytes_that_many_images_show_are_kept_once() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let view = pack.view(&[PNG, &[0; 100_000]].concat());
    let count = 1000;
    let primitive = |m: usize| json!({"attributes": {"POSITION": positions}, "material": m});
    let material = |m: usize| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": m}}});
    let all = |f: &dyn Fn(usize) -> Value| (0..count).map(f).collect::<Vec<_>>();
    let json = pack.json(json!({
        "meshes": [{"primitives": all(&primitive)}], "materials": all(&material),
        "textures": all(&|m| json!({"source": m})), "images": all(&|_| json!({"bufferView": view})),
    }));
    let loaded = read_bytes(&glb(&json, &pack.bin), &ReadOptions::default()).unwrap();
    let mut bytes = Vec::new();
    let warnings =
        write_to(&loaded.mesh, Format::Obj, &options(&loaded, Textures::Copy), &mut bytes).unwrap().warnings;
    assert_eq!(warnings.len(), 18);
    assert!(warnings[15].text.ends_with("uses the same bytes as other images: left out"), "{}", warnings[15]);
    assert!(warnings[16].text.ends_with("more textures are left out"), "{}", warnings[16]);
}

#[test]
fn very_many_materials_of_one_name_take_no_square_time() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let count = 50_000;
    let primitive = |m: usize| json!({"attributes": {"POSITION": positions}, "material": m});
    let material =
        |m: usize| json!({"name": "Same", "pbrMetallicRoughness": {"baseColorTexture": {"index": m % 2}}});
    let all = |f: &dyn Fn(usize) -> Value| (0..count).map(f).collect::<Vec<_>>();
    let json = pack.json(json!({
        "meshes": [{"primitives": all(&primitive)}], "materials": all(&material),
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"uri": format!("{}.png", "x".repeat(1 << 20))}, {"uri": "x.png"}],
    }));
    let loaded = read_bytes(&glb(&json, &pack.bin), &ReadOptions::default()).unwrap();
    assert_eq!(loaded.regions.materials().last().unwrap(), b"Same_49999");
    // The long name is stored once, not once per material.
    assert!(loaded.regions.libraries()[0].text().unwrap().len() < 100 * count);
}

#[test]
fn missing_materials_are_ignored() {
    let loaded = read_bytes(&scene(&json!([])), &ReadOptions::default()).unwrap();
    assert!(loaded.regions.is_empty() && loaded.mesh.regions().is_none());
}

#[test]
fn damaged_descriptions_get_an_answer() {
    let whole = scene(&materials());
    let end = 20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let mut read = 0;
    for (at, byte) in (20..end).flat_map(|at| b"9\"- ".map(|byte| (at, byte))) {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        let Ok(loaded) = read_bytes(&bytes, &ReadOptions::default()) else { continue };
        read += 1;
        let _ = loaded.regions.image_sizes();
        write_to(&loaded.mesh, Format::Obj, &options(&loaded, Textures::Copy), &mut Vec::new()).unwrap();
        write_to(&loaded.mesh, Format::Glb, &options(&loaded, Textures::Copy), &mut Vec::new()).unwrap();
    }
    assert!(read > 1000, "{read}");
}
