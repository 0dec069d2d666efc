//! COLLADA: what is read of a file.

use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Loaded, ReadError, ReadOptions, read_bytes, read_scene_bytes};

const SOURCES: &str = r##"<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<source id="n"><float_array id="na" count="3">0 0 1</float_array>
<technique_common><accessor source="#na" count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<source id="t"><float_array id="ta" count="8">0 0 1 0 1 1 0 0.25</float_array>
<technique_common><accessor source="#ta" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>"##;
const INPUTS: &str = r##"<input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/><input semantic="TEXCOORD" source="#t" offset="2" set="0"/>"##;

fn document(asset: &str, libraries: &str, primitives: &str, nodes: &str) -> String {
    format!(
        r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{asset}</asset>
{libraries}<library_geometries><geometry id="g" name="square"><mesh>{SOURCES}{primitives}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
    )
}

fn square(primitives: &str) -> String {
    document("", "", primitives, r##"<node><instance_geometry url="#g"/></node>"##)
}

fn polylist() -> String {
    format!(
        r#"<polylist count="1" material="m">{INPUTS}<vcount>4</vcount><p>0 0 0 1 0 1 2 0 2 3 0 3</p></polylist>"#
    )
}

fn read(text: &str) -> Result<Loaded, ReadError> {
    read_bytes(text.as_bytes(), &ReadOptions::default())
}

fn scene(text: &str) -> Scene {
    read_scene_bytes(text.as_bytes(), &ReadOptions::default()).unwrap().unwrap()
}

fn points(loaded: &Loaded) -> Vec<[f64; 3]> {
    loaded.mesh.positions().view().iter().collect()
}

#[test]
fn faces_of_every_kind_are_triangles() {
    let kinds = [
        (format!(r#"<triangles>{INPUTS}<p>0 0 0 1 0 1 2 0 2 0 0 0 2 0 2 3 0 3</p></triangles>"#), 2),
        (polylist(), 2),
        (format!(r#"<polygons>{INPUTS}<p>0 0 0 1 0 1 2 0 2 3 0 3</p></polygons>"#), 2),
        (format!(r#"<trifans>{INPUTS}<p>0 0 0 1 0 1 2 0 2 3 0 3</p></trifans>"#), 2),
        (format!(r#"<tristrips>{INPUTS}<p>0 0 0 1 0 1 3 0 3 2 0 2</p></tristrips>"#), 2),
    ];
    for (primitives, faces) in kinds {
        let loaded = read(&square(&primitives)).unwrap();
        assert_eq!(
            (loaded.format, loaded.mesh.face_count(), loaded.mesh.vertex_count()),
            (Format::Dae, faces, 4)
        );
        assert_eq!(loaded.mesh.normals().unwrap()[0], [0.0, 0.0, 1.0]);
        assert!(loaded.mesh.uvs().unwrap().contains(&[0.0, 0.25]), "{primitives}");
        // All of them look along z.
        for t in loaded.mesh.surface().triangles() {
            let [a, b, c] = t.map(|v| loaded.mesh.positions().view().get(v));
            assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0, "{primitives}");
        }
    }
    let with_hole = format!(
        r#"<polygons>{INPUTS}<ph><p>0 0 0 1 0 1 2 0 2 3 0 3</p><h>0 0 0 1 0 1 2 0 2</h></ph></polygons>"#
    );
    let loaded = read(&square(&with_hole)).unwrap();
    assert!(loaded.mesh.face_count() == 2 && loaded.warnings.iter().any(|w| w.text.contains("holes")));
}

#[test]
fn units_and_axes_are_those_of_gltf() {
    let axes = [("Y_UP", [0.01, 0.0, 0.0]), ("Z_UP", [0.01, 0.0, 0.0]), ("X_UP", [0.0, 0.01, 0.0])];
    for (axis, wanted) in axes {
        let asset = format!(r#"<unit name="centimeter" meter="0.01"/><up_axis>{axis}</up_axis>"#);
        let text = document(&asset, "", &polylist(), r##"<node><instance_geometry url="#g"/></node>"##);
        let got = points(&read(&text).unwrap())[1];
        assert!((0..3).all(|k| (got[k] - wanted[k]).abs() < 1e-7), "{axis}: {got:?}");
    }
    let asset = "<up_axis>Z_UP</up_axis>";
    let text = document(asset, "", &polylist(), r##"<node><instance_geometry url="#g"/></node>"##);
    let got = points(&read(&text).unwrap())[3];
    assert!(
        (0..3).all(|k| (got[k] - [0.0, 0.0, -1.0][k]).abs() < 1e-7),
        "y is away from the viewer: {got:?}"
    );
}

#[test]
fn nodes_place_their_geometries() {
    let library = r##"<library_nodes><node id="shared"><translate>0 0 5</translate><instance_geometry url="#g"/></node></library_nodes>"##;
    let nodes = r##"<node id="a" name="turned"><translate>10 0 0</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale>
        <instance_node url="#shared"/></node><node><matrix>1 0 0 3 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node>"##;
    let text = document("", library, &polylist(), nodes);
    let loaded = read(&text).unwrap();
    assert_eq!((loaded.mesh.face_count(), loaded.mesh.vertex_count()), (4, 8));
    let (first, second) = (points(&loaded)[1], points(&loaded)[5]);
    assert!((0..3).all(|k| (first[k] - [10.0, 2.0, 10.0][k]).abs() < 1e-6), "{first:?}");
    assert_eq!(second, [4.0, 0.0, 0.0]);
    let scene = scene(&text);
    assert_eq!(
        (scene.meshes().len(), scene.meshes()[0].instances, &*scene.meshes()[0].name),
        (1, 2, "square")
    );
}

#[test]
fn materials_and_textures_come_along() {
    let folder = tempfile::tempdir().unwrap();
    let mut tga = vec![0u8, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0];
    tga.extend([10, 20, 30]);
    std::fs::write(folder.path().join("a b.tga"), tga).unwrap();
    let libraries = r##"<library_images><image id="i"><init_from>file:///C:/elsewhere/a%20b.tga</init_from></image></library_images>
        <library_effects><effect id="e"><profile_COMMON>
        <newparam sid="sf"><surface type="2D"><init_from>i</init_from></surface></newparam>
        <newparam sid="sm"><sampler2D><source>sf</source></sampler2D></newparam>
        <technique sid="c"><phong><emission><color>0.5 0 0 1</color></emission><diffuse><texture texture="sm" texcoord="UV"/></diffuse>
        <transparent opaque="A_ONE"><color>1 1 1 0.5</color></transparent></phong></technique></profile_COMMON></effect></library_effects>
        <library_materials><material id="mat" name="wood"><instance_effect url="#e"/></material></library_materials>"##;
    let nodes = r##"<node><instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#mat"/></technique_common></bind_material></instance_geometry></node>"##;
    let text = document("", libraries, &polylist(), nodes);
    let mut options = ReadOptions::default();
    options.folder = Some(folder.path().to_owned());
    let scene = read_scene_bytes(text.as_bytes(), &options).unwrap().unwrap();
    let mut glb = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut glb).unwrap();
    let (model, warnings) = Scene::read(&glb, &ReadOptions::default()).unwrap().model();
    assert_eq!(warnings, []);
    let material = &model.materials[0];
    assert_eq!((&*material.name, material.emissive, material.base_color[3]), ("wood", [0.5, 0.0, 0.0], 0.5));
    assert_eq!(model.images[0].at(0, 0), [30, 20, 10, 255]);
    assert!(scene.warnings().iter().any(|w| !w.data_lost && w.text.contains("converted to PNG")));
    // Without the file the name of the texture is in a warning.
    let alone = read(&text).unwrap();
    assert!(alone.warnings.iter().any(|w| w.data_lost && w.text.contains("a b.tga")), "{:?}", alone.warnings);
}

/// A file with a texture on a square; `bound` is in the instance of its material, `inputs` are those of its faces.
fn textured(bound: &str, inputs: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let mut tga = vec![0u8, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0];
    tga.extend([10, 20, 30]);
    std::fs::write(folder.path().join("a.tga"), tga).unwrap();
    let libraries = r##"<library_images><image id="i"><init_from>a.tga</init_from></image></library_images>
        <library_effects><effect id="e"><profile_COMMON><technique sid="c"><phong>
        <emission><texture texture="i" texcoord="A"/></emission><diffuse><texture texture="i" texcoord="B"/></diffuse>
        </phong></technique></profile_COMMON></effect></library_effects>
        <library_materials><material id="mat"><instance_effect url="#e"/></material></library_materials>"##;
    let nodes = format!(
        r##"<node><instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#mat">{bound}</instance_material></technique_common></bind_material></instance_geometry></node>"##
    );
    let faces = format!(r#"<triangles material="m">{inputs}<p>0 0 1 1 2 2</p></triangles>"#);
    let mut options = ReadOptions::default();
    options.folder = Some(folder.path().to_owned());
    let text = document("", libraries, &faces, &nodes);
    let scene = read_scene_bytes(text.as_bytes(), &options).unwrap().unwrap();
    let mut gltf = Vec::new();
    scene.write(&[], Format::Gltf, &|_| None, &mut gltf).unwrap();
    let mut json: serde_json::Value = serde_json::from_slice(&gltf).unwrap();
    json["warnings"] = scene.warnings().iter().filter(|w| w.data_lost).map(|w| w.text.as_str()).collect();
    json
}

#[test]
fn textures_use_the_bound_set() {
    let inputs = r##"<input semantic="VERTEX" source="#v" offset="0"/><input semantic="TEXCOORD" source="#t" offset="1" set="3"/>
        <input semantic="TEXCOORD" source="#t" offset="1" set="1"/>"##;
    let bound = r#"<bind_vertex_input semantic="A" input_semantic="TEXCOORD" input_set="3"/>
        <bind_vertex_input semantic="B" input_semantic="TEXCOORD" input_set="1"/>"#;
    let material = textured(bound, inputs)["materials"][0].clone();
    assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 1);
    assert!(material["emissiveTexture"]["texCoord"].is_null() && material["emissiveTexture"]["index"] == 0);
    let plain = textured("", inputs);
    assert!(plain["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"].is_null());
}

#[test]
fn textures_need_texture_coordinates() {
    let inputs = r##"<input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#p" offset="1"/>"##;
    let json = textured("", inputs);
    let material = &json["materials"][0];
    assert!(json["materials"].as_array().unwrap().len() == 1 && json["images"].is_null(), "{json}");
    assert!(material["pbrMetallicRoughness"]["baseColorTexture"].is_null());
    assert!(material["emissiveTexture"].is_null() && material["emissiveFactor"].is_null());
    assert_eq!(json["warnings"][0], "textures are left out where a mesh has no texture coordinates");
}

#[test]
fn skins_and_animations_are_warnings() {
    let libraries = r##"<library_animations><animation id="a"/></library_animations>
        <library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 7 0 0 0 1</bind_shape_matrix></skin></controller></library_controllers>"##;
    let nodes = r##"<node><translate>100 0 0</translate><instance_controller url="#c"/></node>"##;
    let loaded = read(&document("", libraries, &polylist(), nodes)).unwrap();
    let texts: Vec<_> = loaded.warnings.iter().map(|w| &*w.text).collect();
    assert!(
        texts.iter().any(|t| t.contains("skins")) && texts.iter().any(|t| t.contains("animations")),
        "{texts:?}"
    );
    // In the pose of the binding, which no node moves.
    assert_eq!(points(&loaded)[0], [0.0, 0.0, 7.0]);
}

#[test]
fn faults_are_named() {
    let error = |text: &str| read(text).unwrap_err().to_string();
    let beyond = format!(r#"<triangles>{INPUTS}<p>0 0 0 1 0 1 9 0 2</p></triangles>"#);
    let text = error(&square(&beyond));
    assert!(text.contains("the index 9 is beyond the 4 values") && text.contains("line"), "{text}");
    let word = format!(r#"<triangles>{INPUTS}<p>0 0 0 1 0 x 2 0 2</p></triangles>"#);
    assert!(error(&square(&word)).contains("`x` is not a whole number"));
    let missing = r##"<node><instance_geometry url="#none"/></node>"##;
    assert!(error(&document("", "", &polylist(), missing)).contains("there is no geometry `#none`"));
    let far = r##"<node><instance_geometry url="other.dae#g"/></node>"##;
    assert!(error(&document("", "", &polylist(), far)).contains("is in another file"));
    assert!(
        error(&document("", "", &polylist(), "").replace("1.4.1", "2.0"))
            .contains("COLLADA 2.0 is not supported")
    );
    let cut = square(&polylist());
    assert!(error(&cut[..cut.len() - 20]).contains("the XML is damaged"));
    let cycle = r##"<node id="a"><instance_node url="#a"/></node>"##;
    assert!(error(&document("", "", &polylist(), cycle)).contains("contains itself"));
}

/// A reference to something that is missing costs what refers to it, not the file.
#[test]
fn dangling_references_leave_the_rest() {
    let good = r##"<node><instance_geometry url="#g"/></node>"##;
    let bound = |target: &str| {
        format!(
            r##"<node><instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="{target}"/></technique_common></bind_material></instance_geometry></node>"##
        )
    };
    let library = r##"<library_materials><material id="mat"><instance_effect url="#none"/></material></library_materials>
        <library_controllers><controller id="c"><skin source="#none"/></controller></library_controllers>"##;
    let node = |inner: &str| format!("{good}<node>{inner}</node>");
    let cases = [
        (bound("#none"), "there is no material `#none`: its faces get no material"),
        (bound("#mat"), "there is no effect `#none`: the material is plain"),
        (node(r##"<instance_geometry url="#none"/>"##), "there is no geometry `#none`: left out"),
        (node(r##"<instance_geometry url="far.dae#g"/>"##), "`far.dae#g` is in another file"),
        (node(r##"<instance_node url="#none"/>"##), "there is no node `#none`: left out"),
        (node(r##"<instance_controller url="#none"/>"##), "there is no controller `#none`: left out"),
        (node(r##"<instance_controller url="#c"/>"##), "there is no geometry `#none`: left out"),
        (
            node(r##"<instance_node url="#a"/><instance_node url="#b"/>"##),
            "there is no node `#a` (2 such references in all): left out",
        ),
    ];
    for (nodes, warning) in cases {
        let loaded = read(&document("", library, &polylist(), &nodes)).unwrap();
        assert_eq!(loaded.mesh.face_count(), 2, "{nodes}");
        let found = loaded.warnings.iter().find(|w| w.text.contains(warning));
        assert!(found.is_some_and(|w| w.data_lost && w.text.contains("line ")), "{:?}", loaded.warnings);
    }
    let no_normals = square(&polylist())
        .replace(r##"semantic="NORMAL" source="#n""##, r##"semantic="NORMAL" source="#x""##);
    let loaded = read(&no_normals).unwrap();
    assert!(loaded.mesh.normals().is_none() && loaded.mesh.uvs().is_some());
    assert!(loaded.warnings.iter().any(|w| w.text.contains("there is no source `#x`")));
    let no_scene = square(&polylist())
        .replace(r##"<instance_visual_scene url="#s"/>"##, r##"<instance_visual_scene url="#x"/>"##);
    assert_eq!(read(&no_scene).unwrap().mesh.face_count(), 2);
}

#[test]
fn the_declared_encoding_is_read() {
    let read = |encoding: &str| {
        let declaration = format!(r#"<?xml version="1.0" encoding='{encoding}'?>"#);
        let text = square(&polylist()).replacen(r#"<?xml version="1.0"?>"#, &declaration, 1);
        let (before, after) = text.split_once("square").unwrap();
        let bytes = [before.as_bytes(), b"caf\xe9 \x93", after.as_bytes()].concat();
        read_scene_bytes(&bytes, &ReadOptions::default())
    };
    for (encoding, is_known) in [("ISO-8859-1", true), ("windows-1252", true), ("gb2312", false)] {
        let scene = read(encoding).unwrap().unwrap();
        assert_eq!(scene.meshes()[0].name, "café “", "{encoding}");
        assert_eq!(scene.warnings().iter().any(|w| w.data_lost && w.text.contains(encoding)), !is_known);
    }
    assert!(read("UTF-8").unwrap_err().to_string().contains("not UTF-8"));
}

#[test]
fn document_types_are_refused() {
    let entities =
        r#"<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>"#;
    let text = square(&polylist()).replacen(r#"<?xml version="1.0"?>"#, entities, 1);
    assert!(read(&text).unwrap_err().to_string().contains("document type"));
}

#[test]
fn instances_that_multiply_without_end_are_refused() {
    let mut library = r##"<library_nodes><node id="n0"><instance_geometry url="#g"/></node>"##.to_owned();
    for k in 1..40 {
        let inner = format!(r##"<instance_node url="#n{}"/>"##, k - 1).repeat(4);
        library.push_str(&format!(r#"<node id="n{k}">{inner}</node>"#));
    }
    let text = document(
        "",
        &(library + "</library_nodes>"),
        &polylist(),
        r##"<node><instance_node url="#n39"/></node>"##,
    );
    assert!(read(&text).unwrap_err().to_string().contains("more nodes than allowed for a file of this size"));
}
