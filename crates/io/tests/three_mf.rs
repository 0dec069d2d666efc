//! 3MF: what is read of a file, and that what is written is read again.

use std::io::{Cursor, Read as _, Write};
use std::sync::Arc;

use lodsmith_core::shapes;
use lodsmith_io::{
    Format, Frame, Limits, Loaded, ReadError, ReadOptions, Unit, WriteOptions, read_bytes, read_model_bytes,
    read_scene_bytes, write_scene_to, write_to,
};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const HEAD: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<model unit="UNIT" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
 xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06""#;
const TETRAHEDRON: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="10" y="0" z="0"/>
<vertex x="0" y="10" z="0"/><vertex x="0" y="0" z="10"/></vertices><triangles>"#;
const PLAIN: &str = r#"<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/>
<triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh>"#;
/// A PNG of one pixel.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde\0\0\0\x0cIDATx\x9cc\xf8\xcf\xc0\0\0\x03\x01\x01\0\xc9\xfe\x92\xef\0\0\0\0IEND\xaeB`\x82";

fn zipped(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in parts {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn model(unit: &str, more: &str, content: &str) -> Vec<u8> {
    format!("{}{more}>{content}</model>", HEAD.replace("UNIT", unit)).into_bytes()
}

fn file(content: &str) -> Vec<u8> {
    zipped(&[("3D/3dmodel.model", &model("millimeter", "", content))])
}

fn read(bytes: &[u8]) -> Result<Loaded, ReadError> {
    read_bytes(bytes, &ReadOptions::default())
}

fn error(bytes: &[u8]) -> String {
    read(bytes).unwrap_err().to_string()
}

fn object(id: u32, more: &str, triangles: &str) -> String {
    format!(r#"<object id="{id}" {more}>{TETRAHEDRON}{triangles}</object>"#)
}

#[test]
fn components_are_placed_by_their_transforms() {
    let content = format!(
        r#"<resources>{}<object id="2"><components><component objectid="1"/>
        <component objectid="1" transform="0 1 0 -1 0 0 0 0 1 100 0 0"/></components></object></resources>
        <build><item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/></build>"#,
        object(1, "", PLAIN)
    );
    let loaded = read(&file(&content)).unwrap();
    assert_eq!(
        (loaded.format, loaded.mesh.face_count(), loaded.mesh.vertex_count()),
        (Format::ThreeMf, 8, 8)
    );
    assert_eq!(loaded.regions.frame(), Some(Frame::new(Unit::Millimeter, true)));
    let points: Vec<_> = loaded.mesh.positions().view().iter().collect();
    assert_eq!(points[1], [10.0, 0.0, 5.0]);
    // A quarter turn takes x to y; then it is moved.
    assert_eq!(points[5], [100.0, 10.0, 5.0]);

    // As a scene it is in metres, with y up.
    let scene = read_scene_bytes(&file(&content), &ReadOptions::default()).unwrap().unwrap();
    assert_eq!((scene.meshes().len(), scene.meshes()[0].instances), (1, 2));
    let bounds = scene.bounds().unwrap();
    for (got, wanted) in bounds.max.iter().zip([0.1, 0.015, 0.0]) {
        assert!((got - wanted).abs() < 1e-9, "{bounds:?}");
    }
}

#[test]
fn properties_become_colors_materials_and_textures() {
    let content = format!(
        r##"<resources>
        <basematerials id="5"><base name="red" displaycolor="#FF0000"/><base name="glass" displaycolor="#00FF0080"/></basematerials>
        <m:colorgroup id="6"><m:color color="#FF0033"/><m:color color="#000000"/></m:colorgroup>
        <m:texture2d id="7" path="/3D/Textures/a.png" contenttype="image/png" tilestyleu="mirror"/>
        <m:texture2dgroup id="8" texid="7"><m:tex2coord u="0" v="0.25"/><m:tex2coord u="1" v="1"/></m:texture2dgroup>
        {}{}</resources><build><item objectid="1"/><item objectid="2"/></build>"##,
        object(
            1,
            r#"pid="5" pindex="0""#,
            r#"<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3" p1="1"/>
            <triangle v1="1" v2="2" v3="3" pid="6" p1="0" p2="1" p3="1"/>
            <triangle v1="0" v2="3" v3="2" pid="8" p1="0" p2="1" p3="0"/></triangles></mesh>"#
        ),
        object(2, "", PLAIN),
    );
    let bytes =
        zipped(&[("3D/3dmodel.model", &model("millimeter", "", &content)), ("3D/Textures/a.png", PNG)]);
    let loaded = read(&bytes).unwrap();
    assert_eq!(loaded.warnings, []);
    assert_eq!((loaded.contents.materials, loaded.contents.textures), (4, 1));
    // Corners with several values are wedges of one vertex.
    assert_eq!((loaded.mesh.face_count(), loaded.mesh.vertex_count()), (8, 8));
    let names: Vec<_> = loaded.regions.materials().map(|n| String::from_utf8_lossy(n).into_owned()).collect();
    assert!(names.contains(&"red".to_owned()) && names.contains(&"glass".to_owned()), "{names:?}");
    assert!(loaded.mesh.colors().unwrap().contains(&[1.0, 0.0, 0.2, 1.0]));
    assert!(loaded.mesh.uvs().unwrap().contains(&[0.0, 0.25]));

    // Written and read again it is the same, to the byte from then on.
    let again = written(&loaded);
    let back = read(&again).unwrap();
    assert_eq!((back.mesh.face_count(), back.mesh.vertex_count()), (8, 8));
    assert!(back.mesh.colors().unwrap().contains(&[1.0, 0.0, 0.2, 1.0]));
    assert!(back.mesh.uvs().unwrap().contains(&[0.0, 0.25]));
    assert_eq!((back.contents.materials, back.contents.textures), (4, 1));
    let third = written(&read(&written(&back)).unwrap());
    assert_eq!(String::from_utf8(model_of(&written(&back))), String::from_utf8(model_of(&third)));
    assert_eq!(written(&back), third);
}

/// 3MF has colours in sRGB, glTF has linear ones.
#[test]
fn colors_are_linear_in_gltf_and_come_back() {
    let content = format!(
        r##"<resources><basematerials id="5"><base name="brown" displaycolor="#806040"/></basematerials>
        <m:colorgroup id="6"><m:color color="#204080"/></m:colorgroup>
        {}</resources><build><item objectid="1"/></build>"##,
        object(
            1,
            r#"pid="5" pindex="0""#,
            r#"<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3" pid="6" p1="0"/>
            <triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh>"#
        ),
    );
    let scene = read_scene_bytes(&file(&content), &ReadOptions::default()).unwrap().unwrap();
    let mut glb = Vec::new();
    write_scene_to(&scene, &[], Format::Glb, &|_| None, &mut glb).unwrap();
    let model = read_model_bytes(&glb, &ReadOptions::default()).unwrap().model;
    // The formula of sRGB for 0x20, 0x40, 0x60 and 0x80.
    let linear = [0.014_444, 0.051_269, 0.116_971, 0.215_861];
    let is_near = |a: &[f32], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.003);
    let brown = model.materials.iter().find(|m| m.name == "brown").unwrap();
    assert!(is_near(&brown.base_color[..3], [linear[3], linear[2], linear[1]]), "{brown:?}");
    let colors = model.meshes[0].mesh.colors().unwrap();
    assert!(colors.iter().any(|c| is_near(&c[..3], [linear[0], linear[1], linear[3]])), "{colors:?}");
    let text = String::from_utf8(model_of(&written(&read(&glb).unwrap()))).unwrap();
    assert!(text.contains("#806040") && text.contains("#204080"), "{text}");
}

/// Returns the model part of a file.
fn model_of(bytes: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut text = Vec::new();
    archive.by_name("3D/3dmodel.model").unwrap().read_to_end(&mut text).unwrap();
    text
}

fn written(loaded: &Loaded) -> Vec<u8> {
    let mut options = WriteOptions::default();
    options.regions = Some(Arc::new(loaded.regions.clone()));
    let mut out = Vec::new();
    write_to(&loaded.mesh, Format::ThreeMf, &options, &mut out).unwrap();
    out
}

#[test]
fn shapes_come_back_to_the_bit() {
    for (name, mesh) in shapes::all().into_iter().filter(|(_, mesh)| mesh.face_count() > 0) {
        let mut out = Vec::new();
        write_to(&mesh, Format::ThreeMf, &WriteOptions::default(), &mut out).unwrap();
        let back = read(&out).unwrap().mesh;
        let single = |m: &lodsmith_core::TriMesh| -> Vec<[f32; 3]> {
            m.positions().view().iter().map(|p| p.map(|x| x as f32)).collect()
        };
        assert_eq!(single(&back), single(&mesh), "{name}");
        assert_eq!(back.surface().triangles(), mesh.surface().triangles(), "{name}");
        let mut again = Vec::new();
        write_to(&back, Format::ThreeMf, &WriteOptions::default(), &mut again).unwrap();
        assert_eq!(single(&read(&again).unwrap().mesh), single(&mesh), "{name}");
    }
}

#[test]
fn units_and_axes_of_the_source_are_stored() {
    let mesh = shapes::cube(1);
    let mut options = WriteOptions::default();
    options.regions = Some(Arc::new(lodsmith_io::Regions::default().with_frame(Frame::GLTF)));
    let mut out = Vec::new();
    write_to(&mesh, Format::ThreeMf, &options, &mut out).unwrap();
    let loaded = read(&out).unwrap();
    assert_eq!(loaded.regions.frame(), Some(Frame::new(Unit::Meter, true)));
    let [x, y, z] = mesh.positions().view().get(lodsmith_core::VertexId(1));
    assert_eq!(loaded.mesh.positions().view().get(lodsmith_core::VertexId(1)), [x, -z, y]);
    // Back in glTF it is as it was.
    let scene = read_scene_bytes(&out, &ReadOptions::default()).unwrap().unwrap();
    let mut glb = Vec::new();
    scene.write(&[], Format::Glb, &|_| None, &mut glb).unwrap();
    let back = read(&glb).unwrap().mesh;
    let difference = |(a, b): ([f64; 3], [f64; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
    let (back, mesh) = (back.positions().view(), mesh.positions().view());
    let pairs = back.iter().zip(mesh.iter());
    assert!(pairs.map(difference).fold(0.0, f64::max) < 1e-6);
}

#[test]
fn objects_of_other_parts_are_found() {
    let first = model(
        "millimeter",
        r#" requiredextensions="p""#,
        r#"<resources><object id="2"><components><component objectid="1" p:path="/3D/Objects/Other.model"/></components></object></resources>
        <build><item objectid="2"/><item objectid="1" p:path="/3D/objects/other.model"/></build>"#,
    );
    let other = model("centimeter", "", &format!("<resources>{}</resources><build/>", object(1, "", PLAIN)));
    let relations = br#"<Relationships><Relationship Target="/3D/first.model" Id="a"
        Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;
    // Programs encode blanks in the archive, in references, or in both; some have backslashes.
    for (stored, referred) in [
        ("3D/Objects/other.model", "/Objects/Other.model"),
        ("3D/Objects/my other.model", "/Objects/my%20Other.model"),
        ("3D/Objects/my%20other.model", "/Objects/my other.model"),
        ("3D\\Objects\\other.model", "/Objects/Other.model"),
    ] {
        let first = String::from_utf8(first.clone()).unwrap().replace("/Objects/Other.model", referred);
        let first = first.replace("/objects/other.model", referred);
        let bytes =
            zipped(&[(stored, &other), ("_rels/.rels", relations), ("3D/first.model", first.as_bytes())]);
        let loaded = read(&bytes).unwrap();
        assert_eq!(loaded.mesh.face_count(), 8, "{stored}");
        // Centimetres of the other part, in millimetres.
        assert_eq!(loaded.mesh.positions().view().bounds().unwrap().max, [100.0; 3]);
    }
}

#[test]
fn faults_are_named() {
    let in_build =
        |objects: &str| format!(r#"<resources>{objects}</resources><build><item objectid="1"/></build>"#);
    let bad_vertex = object(1, "", r#"<triangle v1="0" v2="1" v3="4"/></triangles></mesh>"#);
    assert!(
        error(&file(&in_build(&bad_vertex)))
            .contains("object 1, triangle 0: it refers to a vertex beyond the 4")
    );
    let cycle = r#"<object id="1"><components><component objectid="1"/></components></object>"#;
    assert!(error(&file(&in_build(cycle))).contains("object 1: it contains itself"));
    assert!(
        error(&file(r#"<build><item objectid="9"/></build>"#)).contains("object 9: it is placed, but not in")
    );
    let word = object(1, "", r#"<triangle v1="0" v2="x" v3="1"/></triangles></mesh>"#);
    let text = error(&file(&in_build(&word)));
    assert!(text.contains("line 5: `x` is not a whole number"), "{text}");
    let entity = br#"<!DOCTYPE m [<!ENTITY a "b">]><model/>"#;
    assert!(error(&zipped(&[("3D/3dmodel.model", entity)])).contains("document type"));
    let unknown = model("millimeter", r#" xmlns:q="http://x.org/q" requiredextensions="q""#, "");
    assert!(
        error(&zipped(&[("3D/3dmodel.model", &unknown)])).contains("requires the extension http://x.org/q")
    );
    let parsec = model("parsec", "", "");
    assert!(error(&zipped(&[("3D/3dmodel.model", &parsec)])).contains("`parsec` is not known"));
    assert!(error(&zipped(&[("3D/other.txt", b"")])).contains("no 3D model"));
    let mut cut = file(&in_build(&object(1, "", PLAIN)));
    cut.truncate(cut.len() / 2);
    assert!(error(&cut).contains("the ZIP archive"), "{}", error(&cut));
}

#[test]
fn archives_that_unpack_without_end_are_refused() {
    // A hundred megabytes of blanks take a hundred kilobytes.
    let blanks = " ".repeat(100 << 20);
    let bytes = file(&blanks);
    assert!(bytes.len() < 200 << 10);
    assert!(matches!(read(&bytes), Err(ReadError::Ratio { what: "the ZIP archive", .. })));
    let mut options = ReadOptions::default();
    let mut limits = Limits::default();
    limits.memory = 1 << 20;
    options.limits = limits;
    assert!(matches!(read_bytes(&bytes, &options), Err(ReadError::Memory(_) | ReadError::Ratio { .. })));
}

#[test]
fn components_that_multiply_without_end_are_refused() {
    let mut objects = object(1, "", PLAIN);
    for id in 2..40 {
        let inner = format!(r#"<component objectid="{}"/>"#, id - 1).repeat(4);
        objects.push_str(&format!(r#"<object id="{id}"><components>{inner}</components></object>"#));
    }
    let text =
        error(&file(&format!(r#"<resources>{objects}</resources><build><item objectid="39"/></build>"#)));
    assert!(text.contains("more objects than allowed for a file of this size"), "{text}");
}

#[test]
fn content_that_is_dropped_is_named() {
    let painted = PLAIN.replacen("<triangle", r#"<triangle paint_color="8""#, 1);
    let content =
        format!(r#"<resources>{}</resources><build><item objectid="1"/></build>"#, object(1, "", &painted));
    let loaded = read(&file(&content)).unwrap();
    assert!(loaded.warnings.iter().any(|w| w.data_lost && w.text.contains("a slicer painted")));
}
