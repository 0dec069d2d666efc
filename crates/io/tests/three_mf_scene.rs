//! Whole scenes as 3MF: an object for each mesh, and its places, as they were.

use std::io::{Cursor, Read as _};

use lodsmith_core::model::Wrap;
use lodsmith_core::{TriMesh, WedgeId};
use lodsmith_io::gltf::{Scene, SceneFormat};
use lodsmith_io::{Format, ReadOptions, Textures, Warning, read_bytes, read_scene_bytes, write_scene_to};
use serde_json::{Value, json};

use crate::scenes::{Pack, glb};

fn scene_of(bytes: &[u8]) -> Scene {
    read_scene_bytes(bytes, &ReadOptions::default()).unwrap().unwrap()
}

fn written(scene: &Scene, replaced: &[Option<TriMesh>]) -> (Vec<u8>, Vec<Warning>) {
    let mut out = Vec::new();
    let written = write_scene_to(scene, replaced, Format::ThreeMf, &|_| None, &mut out).unwrap();
    (out, written.warnings)
}

/// Returns a part of an archive.
fn part(bytes: &[u8], name: &str) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut part = Vec::new();
    archive.by_name(name).unwrap().read_to_end(&mut part).unwrap();
    part
}

fn model_of(bytes: &[u8]) -> String {
    String::from_utf8(part(bytes, "3D/3dmodel.model")).unwrap()
}

/// Returns the elements of an XML text that begin with this.
fn elements<'t>(text: &'t str, begin: &str) -> Vec<&'t str> {
    text.lines().map(str::trim).filter(|line| line.starts_with(begin)).collect()
}

/// Returns bits of the positions of a mesh, and its triangles by vertices.
fn geometry(mesh: &TriMesh) -> (Vec<[u64; 3]>, Vec<[u32; 3]>) {
    let points = mesh.positions().view().iter().map(|p| p.map(f64::to_bits)).collect();
    (points, mesh.surface().triangles().iter().map(|t| t.map(|v| v.0)).collect())
}

/// A PNG of one pixel.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde\0\0\0\x0cIDATx\x9cc\xf8\xcf\xc0\0\0\x03\x01\x01\0\xc9\xfe\x92\xef\0\0\0\0IEND\xaeB`\x82";

/// A truck: a body with a texture, two wheels of one material, of which one is mirrored, a load with colours, and a
/// flattened wheel.
fn truck() -> Vec<u8> {
    truck_with(PNG)
}

/// The truck with this image.
fn truck_with(image: &[u8]) -> Vec<u8> {
    let mut pack = Pack::default();
    let image = pack.view(image);
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.2, 0.7]]);
    let uvs = pack.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.75]);
    let mut colors = vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 1.0];
    colors.extend([1.0; 8]);
    let colors = pack.floats("VEC4", 4, &colors);
    let indices = pack.indices(&[0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
    let json = pack.json(json!({
        "asset": {"version": "2.0", "extras": {"Title": "A <truck>", "vendor:x": "1", "Application": "y"}},
        "scene": 0,
        "scenes": [{"nodes": [0, 4]}],
        "nodes": [
            {"name": "truck", "children": [1, 2, 3], "translation": [5, 0, 0]},
            {"name": "left", "mesh": 0, "translation": [0, 1, 0]},
            {"name": "right", "mesh": 0, "scale": [1, 1, -1]},
            {"name": "body", "mesh": 1, "children": [5]},
            {"name": "flat", "mesh": 0, "scale": [1, 1, 0]},
            {"name": "load \u{1}&", "mesh": 2, "rotation": [0.0, 0.0, 0.6, 0.8]},
        ],
        "meshes": [
            {"name": "wheel", "primitives": [
                {"attributes": {"POSITION": positions}, "indices": indices, "material": 0}]},
            {"name": "shell", "primitives": [
                {"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "indices": indices, "material": 1}]},
            {"primitives": [
                {"attributes": {"POSITION": positions, "COLOR_0": colors}, "indices": indices, "material": 2}]},
        ],
        "materials": [
            {"name": "rubber", "pbrMetallicRoughness": {
                "baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.25, "roughnessFactor": 0.5}},
            {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": 0,
                "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}}},
             "normalTexture": {"index": 0}},
            {"pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorFactor": [0.5, 1.0, 1.0, 1.0]}},
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33648, "wrapT": 33071, "magFilter": 9728}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "extensionsUsed": ["KHR_texture_transform", "KHR_materials_clearcoat"],
        "animations": [{"channels": [], "samplers": []}],
    }));
    glb(&json, &pack.bin)
}

#[test]
fn nodes_become_objects_components_and_items() {
    let (bytes, _) = written(&scene_of(&truck()), &[]);
    let text = model_of(&bytes);
    assert_eq!(
        elements(&text, "<object"),
        [
            r#"<object id="5" type="model" name="wheel" pid="1" pindex="0">"#,
            r#"<object id="8" type="model" name="shell" pid="7" pindex="0">"#,
            r#"<object id="10" type="model" name="load _&amp;" pid="9" pindex="0">"#,
            r#"<object id="11" type="model" name="body">"#,
            r#"<object id="12" type="model" name="truck">"#,
        ]
    );
    assert_eq!(
        elements(&text, "<component "),
        [
            r#"<component objectid="8"/>"#,
            // The cosine and the sine of the rotation.
            r#"<component objectid="10" transform="0.28 0.96 0 -0.96 0.28 0 0 0 1 0 0 0"/>"#,
            r#"<component objectid="5" transform="1 0 0 0 1 0 0 0 1 0 1 0"/>"#,
            r#"<component objectid="5" transform="1 0 0 0 1 0 0 0 -1 0 0 0"/>"#,
            r#"<component objectid="11"/>"#,
        ]
    );
    // From y up to z up.
    assert_eq!(elements(&text, "<item"), [r#"<item objectid="12" transform="1 0 0 0 0 1 0 -1 0 5 0 0"/>"#]);
    assert!(text.contains(r#"<model unit="meter""#));
    assert_eq!(
        elements(&text, "<metadata"),
        [
            r#"<metadata name="Title">A &lt;truck&gt;</metadata>"#,
            r#"<metadata name="Application">Lodsmith</metadata>"#
        ]
    );
}

#[test]
fn materials_colors_and_textures_are_written() {
    let (bytes, _) = written(&scene_of(&truck()), &[]);
    let text = model_of(&bytes);
    assert_eq!(elements(&text, "<base "), [r##"<base name="rubber" displaycolor="#000000"/>"##]);
    assert_eq!(
        elements(&text, "<m:pbmetallic "),
        [r#"<m:pbmetallic name="rubber" metallicness="0.25" roughness="0.5"/>"#]
    );
    assert_eq!(
        elements(&text, "<m:texture2d "),
        [
            r#"<m:texture2d id="3" path="/3D/Textures/texture_0.png" contenttype="image/png" tilestyleu="mirror" tilestylev="clamp" filter="nearest"/>"#
        ]
    );
    assert_eq!(part(&bytes, "3D/Textures/texture_0.png"), PNG);
    // The offset of the texture is in its coordinates, which 3MF counts from below.
    assert_eq!(
        elements(&text, "<m:tex2coord"),
        [
            r#"<m:tex2coord u="0.5" v="1"/>"#,
            r#"<m:tex2coord u="1.5" v="1"/>"#,
            r#"<m:tex2coord u="0.5" v="0"/>"#,
            r#"<m:tex2coord u="1.5" v="0.25"/>"#
        ]
    );
    // Linear 0.5 is 188 in sRGB: of a colour of red with the factor of the material, and of green.
    assert_eq!(
        elements(&text, "<m:color "),
        [
            r##"<m:color color="#BC0000"/>"##,
            r##"<m:color color="#00BC00"/>"##,
            r##"<m:color color="#BCFFFF"/>"##
        ]
    );
    let model = scene_of(&bytes).model().0;
    let texture = model.materials.iter().find_map(|m| m.base_color_texture).unwrap();
    assert_eq!((texture.sampler.wrap_u, texture.sampler.wrap_v), (Wrap::Mirror, Wrap::Clamp));
}

#[test]
fn a_scene_comes_back_to_the_bit() {
    let scene = scene_of(&truck());
    let (bytes, _) = written(&scene, &[]);
    let back = scene_of(&bytes);
    assert_eq!(back.meshes().len(), 3);
    for (before, after) in scene.meshes().iter().zip(back.meshes()) {
        assert_eq!(geometry(&before.mesh), geometry(&after.mesh), "{}", before.name);
        assert_eq!(after.instances, if before.name == "wheel" { 2 } else { 1 }, "{}", before.name);
    }
    // Merged, it is at the same place, and the mirrored wheel is not inside out.
    let merged = |bytes: &[u8]| read_bytes(bytes, &ReadOptions::default()).unwrap().mesh;
    let (before, after) = (merged(&truck()), merged(&bytes));
    assert_eq!(after.face_count() + 4, before.face_count());
    let volume = |mesh: &TriMesh| -> f64 {
        let at = mesh.positions().view();
        let surface = mesh.surface();
        let corners = surface.triangles().iter().map(|t| t.map(|v| at.get(v)));
        corners
            .map(|[a, b, c]| {
                let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                (0..3).map(|k| cross[k] * c[k]).sum::<f64>() / 6.0
            })
            .sum()
    };
    // Each of the four has a sixth of its height.
    assert!((volume(&after) - 4.0 * 0.7 / 6.0).abs() < 1e-6, "{}", volume(&after));
    // And from then on to the byte.
    let (again, _) = written(&back, &[]);
    assert_eq!(model_of(&again), model_of(&bytes));
    assert_eq!(again, written(&scene_of(&again), &[]).0);
}

#[test]
fn a_build_keeps_its_unit_and_its_vertices() {
    // Two tetrahedra that touch in an edge: their vertices are apart, at the same places.
    let corners = |z: i32| {
        format!(
            r#"<vertex x="0" y="0" z="0"/><vertex x="1.5" y="0" z="0"/><vertex x="0" y="{z}" z="0"/><vertex x="0" y="0" z="{z}"/>"#
        )
    };
    let triangles = |base: u32, turned: bool| -> String {
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
            .map(|[a, b, c]| {
                let [b, c] = if turned { [c, b] } else { [b, c] };
                format!(r#"<triangle v1="{}" v2="{}" v3="{}"/>"#, base + a, base + b, base + c)
            })
            .concat()
    };
    let text = format!(
        r#"<model unit="inch"><resources><object id="7" name="pair"><mesh><vertices>{}{}</vertices>
        <triangles>{}{}</triangles></mesh></object></resources>
        <build><item objectid="7" transform="0.1 0 0 0 0.1 0 0 0 0.1 3 4 5"/><item objectid="7"/></build></model>"#,
        corners(1),
        corners(-1),
        triangles(0, false),
        triangles(4, true)
    );
    let scene = scene_of(&archive(&text));
    let (bytes, warnings) = written(&scene, &[]);
    assert_eq!(warnings, []);
    let text = model_of(&bytes);
    assert!(text.contains(r#"<model unit="inch""#));
    assert_eq!((elements(&text, "<vertex ").len(), elements(&text, "<triangle ").len()), (8, 8));
    assert_eq!(elements(&text, "<vertex ")[5], r#"<vertex x="1.5" y="0" z="0"/>"#);
    assert_eq!(elements(&text, "<triangle ")[4], r#"<triangle v1="4" v2="5" v3="6"/>"#);
    assert_eq!(
        elements(&text, "<item"),
        [r#"<item objectid="4" transform="0.1 0 0 0 0.1 0 0 0 0.1 3 4 5"/>"#, r#"<item objectid="4"/>"#]
    );

    // By way of GLB it has its unit too.
    let mut glb = Vec::new();
    write_scene_to(&scene, &[], Format::Glb, &|_| None, &mut glb).unwrap();
    let text = model_of(&written(&scene_of(&glb), &[]).0);
    assert!(text.contains(r#"<model unit="inch""#), "{text}");
    assert_eq!(elements(&text, "<item").len(), 2);
}

/// Returns a 3MF file with this model.
fn archive(text: &str) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("3D/3dmodel.model", zip::write::SimpleFileOptions::default()).unwrap();
    std::io::Write::write_all(&mut zip, text.as_bytes()).unwrap();
    zip.finish().unwrap().into_inner()
}

#[test]
fn losses_are_named() {
    let (_, warnings) = written(&scene_of(&truck()), &[]);
    let texts: Vec<&str> = warnings.iter().filter(|w| w.data_lost).map(|w| &*w.text).collect();
    assert_eq!(
        texts,
        [
            "animations are not carried: only glTF and GLB keep them",
            "extensions KHR_materials_clearcoat are not carried: only glTF and GLB keep them",
            "1 node flattens its content, which 3MF advises against: left out",
            "3MF cannot carry normal maps: dropped",
        ]
    );
    let notes: Vec<&str> = warnings.iter().filter(|w| !w.data_lost).map(|w| &*w.text).collect();
    assert!(notes.iter().any(|n| n.contains("metadata vendor:x: left out")), "{notes:?}");
    assert!(notes.iter().any(|n| n.contains("other names were dropped for 1 meshes")), "{notes:?}");
}

#[test]
fn images_of_other_types_are_left_out() {
    let (bytes, warnings) = written(&scene_of(&truck_with(b"RIFF\0\0\0\0WEBPVP8 ")), &[]);
    let text = "texture images[0] is neither PNG nor JPEG: left out";
    assert!(warnings.iter().any(|w| w.data_lost && w.text == text), "{warnings:?}");
    assert_eq!(elements(&model_of(&bytes), "<m:texture2d").len(), 0);
}

#[test]
fn materials_can_be_left_out() {
    let (mut out, mut to) = (Vec::new(), SceneFormat::from(Format::ThreeMf));
    to.textures = Textures::None;
    let written = write_scene_to(&scene_of(&truck()), &[], to, &|_| None, &mut out).unwrap();
    assert!(written.warnings.iter().any(|w| w.text == "materials dropped: --textures none"));
    let text = model_of(&out);
    assert_eq!((elements(&text, "<base ").len(), elements(&text, "<m:texture2d ").len()), (0, 0));
    assert_eq!(elements(&text, "<object").len(), 5);
}

#[test]
fn replaced_meshes_are_written_and_empty_ones_are_not() {
    let scene = scene_of(&truck());
    let mesh = &scene.meshes()[1].mesh;
    let lighter = |count: usize| {
        let map = (0..mesh.wedge_count()).map(|w| mesh.vertex_of(WedgeId::new(w))).collect();
        TriMesh::with_wedges(mesh.positions().clone(), map, mesh.triangles()[..count].to_vec()).unwrap()
    };
    let (bytes, warnings) = written(&scene, &[Some(lighter(0)), Some(lighter(2))]);
    let text = model_of(&bytes);
    assert_eq!((elements(&text, "<object").len(), elements(&text, "<triangle ").len()), (4, 6));
    let emptied = "meshes without faces, such as wheel, are left out: 1";
    assert!(warnings.iter().any(|w| w.data_lost && w.text == emptied), "{warnings:?}");
    // It has no texture coordinates any more, but its material.
    assert!(!text.contains("texture2d"), "{text}");
    assert!(warnings.iter().all(|w| !w.text.contains("texture coordinates")), "{warnings:?}");
    let (bytes, _) = written(&scene, &[Some(lighter(0)), Some(lighter(0)), Some(lighter(0))]);
    assert_eq!(elements(&model_of(&bytes), "<item").len(), 0);
}

#[test]
fn deep_trees_become_flat_ones() {
    let mut pack = Pack::default();
    let positions = pack.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let depth = 5000;
    let mut nodes: Vec<Value> =
        (0..depth).map(|i| json!({"children": [i + 1], "translation": [1, 0, 0]})).collect();
    nodes.push(json!({"mesh": 0}));
    let json = pack.json(json!({
        "scenes": [{"nodes": [0]}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
    }));
    let (bytes, _) = written(&scene_of(&glb(&json, &pack.bin)), &[]);
    let back = read_bytes(&bytes, &ReadOptions::default()).unwrap().mesh;
    assert_eq!(back.positions().view().bounds().unwrap().min[0], f64::from(depth));
}
